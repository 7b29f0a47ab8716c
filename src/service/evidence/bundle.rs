//! A snapshot as one file to be taken elsewhere: an archive (POSIX tar) of its files, its record, what was said of it, a list
//! of digests that `sha256sum` reads, and a text that says how. Read and sent piece by piece.

use super::EvidenceError;
use super::folder::{open, parsed, read};
use super::record::{RECORD, ReadRecord, SIGNATURE, hex};
use futures_util::stream::{self, Stream};
use serde_json::json;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;
use tokio::sync::OwnedSemaphorePermit;
use videofields_recording::store::{SnapshotAnnotation, SnapshotRecord};

/// The list of digests.
pub(super) const SUMS: &str = "SHA256SUMS";

/// The text that says how to verify the rest.
pub(super) const README: &str = "README.txt";

/// Bytes of one piece.
const PIECE_BYTES: usize = 256 << 10;

/// What tar's blocks and its end are made of.
const BLOCK_BYTES: u64 = 512;

/// An archive broke off.
pub type BundleError = io::Error;

/// An archive on its way.
pub struct Bundle {
    /// What it is to be called.
    pub name: String,
    len_bytes: u64,
    entries: std::vec::IntoIter<Entry>,
    /// The entry that is being read, what is left of it, and the zeros behind it.
    open: Option<(File, u64, usize)>,
    has_ended: bool,
    _permit: OwnedSemaphorePermit,
}

/// A file of an archive, with its header.
struct Entry {
    header: Vec<u8>,
    len_bytes: u64,
    content: Content,
}

enum Content {
    Text(Vec<u8>),
    File(PathBuf),
}

/// Zeros up to the end of a block.
const fn padding(len_bytes: u64) -> usize {
    ((BLOCK_BYTES - len_bytes % BLOCK_BYTES) % BLOCK_BYTES) as usize
}

impl Bundle {
    /// Of what lies at `place`, with the file `link` where it is named. Blocks for the disk.
    pub(super) fn of(
        record: &SnapshotRecord,
        annotations: &[SnapshotAnnotation],
        (place, link): (PathBuf, Option<&str>),
        permit: OwnedSemaphorePermit,
    ) -> Result<Self, EvidenceError> {
        let sealed = read(&place.join(RECORD))?;
        let document: ReadRecord = parsed(&sealed, &place.join(RECORD))?;
        let said = said(annotations)?;
        let mut sums = String::new();
        let mut sum = |name: &str, digest: &str| {
            // Writing to a string never fails.
            let _infallible = writeln!(sums, "{digest}  {name}");
        };
        sum(RECORD, &hex(&super::record::digest(&sealed)));
        sum("annotations.json", &hex(&super::record::digest(&said)));
        let name = format!("videofields-snapshot-{}", record.id);
        let at_secs = u64::try_from(record.made_at.as_nanos() / 1_000_000_000).unwrap_or(0);
        let entry = |file: &str, len_bytes: u64, content: Content| {
            let path = format!("{name}/{file}");
            header(&path, len_bytes, at_secs).map(|header| Entry { header, len_bytes, content })
        };
        let text = |file: &str, bytes: Vec<u8>| entry(file, bytes.len() as u64, Content::Text(bytes));
        let mut pictures = Vec::new();
        for file in &document.files {
            let path = place.join(&file.file);
            let is_there = open(&path).and_then(|file| file.metadata());
            let len_bytes = is_there.map_err(EvidenceError::files("read", &path))?.len();
            sum(&file.file, &file.sha256);
            pictures.push(entry(&file.file, len_bytes, Content::File(path))?);
        }
        let mut entries = vec![text(README, readme(record).into_bytes())?, text(SUMS, sums.into_bytes())?];
        entries.push(text(RECORD, sealed)?);
        entries.push(text("annotations.json", said)?);
        let signature = place.join(SIGNATURE);
        if signature.try_exists().map_err(EvidenceError::files("look at", &signature))? {
            entries.push(text(SIGNATURE, read(&signature)?)?);
        }
        if let Some(link) = link {
            entries.push(text(link, read(&place.join(link))?)?);
        }
        entries.extend(pictures);
        let whole = |entry: &Entry| BLOCK_BYTES + entry.len_bytes + padding(entry.len_bytes) as u64;
        let len_bytes = entries.iter().map(whole).sum::<u64>() + 2 * BLOCK_BYTES;
        let (entries, name) = (entries.into_iter(), format!("{name}.tar"));
        Ok(Self { name, len_bytes, entries, open: None, has_ended: false, _permit: permit })
    }

    /// Bytes of all of it.
    #[must_use]
    pub const fn len_bytes(&self) -> u64 {
        self.len_bytes
    }

    /// Piece by piece, read as they are taken.
    pub fn into_stream(self) -> impl Stream<Item = Result<Vec<u8>, BundleError>> + Send {
        stream::try_unfold(self, |bundle| async move {
            let read = tokio::task::spawn_blocking(move || bundle.next());
            read.await.unwrap_or_else(|error| Err(io::Error::other(error)))
        })
    }

    /// The next piece, and what comes after it; none at the end.
    fn next(mut self) -> io::Result<Option<(Vec<u8>, Self)>> {
        if let Some((mut file, left, zeros)) = self.open.take() {
            let mut piece = vec![0; PIECE_BYTES.min(usize::try_from(left).unwrap_or(PIECE_BYTES))];
            // A file that became shorter breaks the archive off: it must not pass for whole.
            file.read_exact(&mut piece)?;
            let left = left - piece.len() as u64;
            if left > 0 {
                self.open = Some((file, left, zeros));
            } else {
                piece.resize(piece.len() + zeros, 0);
            }
            return Ok(Some((piece, self)));
        }
        if let Some(Entry { mut header, len_bytes, content }) = self.entries.next() {
            let zeros = padding(len_bytes);
            match content {
                Content::Text(text) => {
                    header.extend(text);
                    header.resize(header.len() + zeros, 0);
                }
                Content::File(path) if len_bytes > 0 => self.open = Some((open(&path)?, len_bytes, zeros)),
                Content::File(_) => {}
            }
            return Ok(Some((header, self)));
        }
        if self.has_ended {
            return Ok(None);
        }
        self.has_ended = true;
        Ok(Some((vec![0; 2 * BLOCK_BYTES as usize], self)))
    }
}

fn header(path: &str, len_bytes: u64, at_secs: u64) -> Result<Vec<u8>, EvidenceError> {
    let mut header = tar::Header::new_ustar();
    let failed = |error: io::Error| EvidenceError::Internal(format!("naming {path} in an archive: {error}"));
    header.set_path(path).map_err(failed)?;
    header.set_entry_type(tar::EntryType::Regular);
    header.set_size(len_bytes);
    header.set_mode(0o644);
    header.set_mtime(at_secs);
    header.set_cksum();
    Ok(header.as_bytes().to_vec())
}

fn said(annotations: &[SnapshotAnnotation]) -> Result<Vec<u8>, EvidenceError> {
    let one = |of: &SnapshotAnnotation| {
        let tags: serde_json::Value = serde_json::from_str(&of.tags).unwrap_or_default();
        json!({
            "version": of.version, "at": of.at.to_string(), "by": of.by, "note": of.note, "tags": tags, "hold": of.hold,
        })
    };
    let document = json!({ "annotations": annotations.iter().map(one).collect::<Vec<_>>() });
    let written = super::record::canonical(&document);
    written.map_err(|error| EvidenceError::Internal(format!("writing what was said of a snapshot: {error}")))
}

fn readme(record: &SnapshotRecord) -> String {
    let (id, digest) = (&record.id, hex(&record.digest));
    format!(
        "Snapshot {id}, made {made_at} by videofields; it shows {shown_at}.\n\
         \n\
         picture.png          what was shown, pixel for pixel\n\
         camera-<id>.png      the original frame of each camera that took part\n\
         record.json          what it shows, from which cameras, frames and calibrations, who asked for it and when,\n\
         \u{20}                    and the SHA-256 of every picture\n\
         annotations.json     what was said of it since; no part of what was sealed\n\
         link.json            if it is there: opens the record's `previous`, its link to the snapshot before\n\
         signature.json       if it is there: who signed record.json (Ed25519), and the signature\n\
         SHA256SUMS           the SHA-256 of these files\n\
         \n\
         To verify it without the daemon:\n\
         \n\
         1. In this folder: sha256sum --check SHA256SUMS\n\
         \u{20}  Every line must end in OK. The digests of the pictures must be those in record.json.\n\
         2. sha256sum record.json\n\
         \u{20}  The digest of the record as it was sealed is\n\
         \u{20}  {digest}\n\
         \u{20}  Whoever could change this file could change that line too: hold it against the digest that the daemon\n\
         \u{20}  shows (`digest` of /api/v1/snapshots/{id}), or that was noted elsewhere.\n\
         \n\
         `videofields snapshot verify --archive FILE.tar --digest DIGEST` does both on the archive as it came,\n\
         and with --public-key FILE it verifies the signature, which nobody can make without the daemon's key.\n",
        made_at = record.made_at,
        shown_at = record.shown_at,
    )
}
