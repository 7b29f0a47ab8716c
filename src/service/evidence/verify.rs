//! Whether a snapshot is as it was sealed: in the folder, or in an archive that was taken elsewhere.

use super::EvidenceError;
use super::board::OWN;
use super::bundle::{README, SUMS};
use super::folder::{names, open, parsed, read};
use super::record::{LINK, Link, MAX_RECORD_BYTES, RECORD, ReadRecord, SIGNATURE, digest, hex, link, unhex};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::{self, Read};
use std::path::Path;
use videofields_recording::signing::{Purpose, Signature, SignatureText};
use videofields_recording::store::SnapshotRecord;

/// What of an archive's entries may be in it beside what its record names.
const ANNOTATIONS: &str = "annotations.json";

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 256 << 10;

/// Entries of an archive: more than any record names.
const MAX_ENTRIES: usize = 4096;

/// What a look at a snapshot found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verification {
    /// Whether everything is as it was sealed.
    pub is_whole: bool,
    /// SHA-256 of the record as it stands there now; none where there is none.
    pub digest: Option<String>,
    /// The public key, hexadecimal, of who signed the record as it stands there; none where nobody did.
    pub signed_by: Option<String>,
    /// Every file that the record names.
    pub files: Vec<VerifiedFile>,
    /// What is wrong, in words.
    pub faults: Vec<String>,
}

/// A file that a record names.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct VerifiedFile {
    /// Its name.
    pub file: String,
    /// What the record says.
    pub sha256: String,
    /// Whether it is there as it was.
    pub is_whole: bool,
}

/// SHA-256 and number of bytes of what a reader gives.
fn digest_of(mut reader: impl Read) -> io::Result<(u64, String)> {
    let (mut hash, mut n_bytes, mut chunk) = (Sha256::new(), 0, vec![0; CHUNK_BYTES]);
    loop {
        let n = match reader.read(&mut chunk) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            read => read?,
        };
        if n == 0 {
            return Ok((n_bytes, hex(&hash.finalize())));
        }
        hash.update(&chunk[..n]);
        n_bytes += n as u64;
    }
}

/// Holds files against what their record says; `found` gives bytes and digest of one, or why there is none.
fn compare(
    record: &ReadRecord,
    mut found: impl FnMut(&str) -> Result<(u64, String), String>,
    faults: &mut Vec<String>,
) -> Vec<VerifiedFile> {
    let mut files = Vec::new();
    for entry in &record.files {
        let fault = match found(&entry.file) {
            Err(why) => Some(why),
            Ok((_, sha256)) if sha256 != entry.sha256 => Some("is not as it was sealed".to_owned()),
            Ok((n_bytes, _)) if n_bytes != entry.bytes => {
                Some(format!("has {n_bytes} bytes, not {}", entry.bytes))
            }
            Ok(_) => None,
        };
        let is_whole = fault.is_none();
        faults.extend(fault.map(|fault| format!("{}: {fault}", entry.file)));
        files.push(VerifiedFile { file: entry.file.clone(), sha256: entry.sha256.clone(), is_whole });
    }
    files
}

/// Looks at what stands in a snapshot's folder; `before` is the digest of the record before, where it is known.
pub(super) fn verify_files(place: &Path, row: &SnapshotRecord, before: Option<[u8; 32]>) -> Verification {
    let mut found = verify_place(place);
    let known = hex(&row.digest);
    if let Some(digest) = &found.digest
        && *digest != known
    {
        found.faults.push(format!("{RECORD}: its SHA-256 is {digest}, but {known} was sealed"));
    }
    if before.is_some_and(|before| before != row.previous) {
        found.faults.push("the snapshot before it is not the one that it was chained to".to_owned());
    }
    found.is_whole = found.faults.is_empty();
    found
}

/// Looks at a snapshot's folder by itself: record, link and files among one another.
pub(super) fn verify_place(place: &Path) -> Verification {
    let mut faults = Vec::new();
    let bytes = match read(&place.join(RECORD)) {
        Ok(bytes) => bytes,
        Err(error) => {
            let faults = vec![format!("{RECORD}: {error}")];
            return Verification {
                is_whole: false,
                digest: None,
                signed_by: None,
                files: Vec::new(),
                faults,
            };
        }
    };
    let sealed = digest(&bytes);
    let record = match parsed::<ReadRecord>(&bytes, &place.join(RECORD)) {
        Ok(record) => record,
        Err(error) => {
            let faults = vec![format!("{RECORD}: {error}")];
            let digest = Some(hex(&sealed));
            return Verification { is_whole: false, digest, signed_by: None, files: Vec::new(), faults };
        }
    };
    if place.file_name().is_none_or(|name| name != record.id.as_str()) {
        faults.push(format!("{RECORD}: is that of the snapshot {}", record.id));
    }
    match read(&place.join(LINK)).and_then(|bytes| parsed::<Link>(&bytes, &place.join(LINK))) {
        Ok(link) => faults.extend(link_fault(&link, &record, &sealed)),
        Err(error) => faults.push(format!("{LINK}: {error}")),
    }
    let signature = match read(&place.join(SIGNATURE)) {
        Ok(signature) => Some(signature),
        Err(EvidenceError::Files { source, .. }) if source.kind() == io::ErrorKind::NotFound => None,
        Err(error) => {
            faults.push(format!("{SIGNATURE}: {error}"));
            None
        }
    };
    let signed_by = signature.and_then(|signature| signer(&signature, &bytes, &mut faults));
    let look = |file: &str| match open(&place.join(file)).and_then(digest_of) {
        Ok(found) => Ok(found),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Err("is missing".to_owned()),
        Err(error) => Err(format!("cannot be read: {error}")),
    };
    // A name that leads elsewhere is no file of ours.
    let look = |file: &str| if is_plain(file) { look(file) } else { Err("is no name of a file".to_owned()) };
    let files = compare(&record, look, &mut faults);
    match names(place) {
        Ok(names) => {
            let is_known = |name: &str| OWN.contains(&name) || files.iter().any(|file| file.file == name);
            let unknown = names.iter().filter(|name| !is_known(name));
            faults.extend(unknown.map(|name| format!("{name}: is not in the record")));
        }
        Err(error) => faults.push(error.to_string()),
    }
    Verification { is_whole: faults.is_empty(), digest: Some(hex(&sealed)), signed_by, files, faults }
}

/// Returns the key that signed a record so; where it did not, that is a fault.
fn signer(signature: &[u8], record: &[u8], faults: &mut Vec<String>) -> Option<String> {
    let read = serde_json::from_slice::<SignatureText>(signature).ok();
    let Some(signature) = read.and_then(|text| Signature::try_from(&text).ok()) else {
        faults.push(format!("{SIGNATURE}: is no signature"));
        return None;
    };
    if !signature.is_of(Purpose::Snapshot, record) {
        faults.push(format!("{SIGNATURE}: is not the signature of {RECORD}"));
        return None;
    }
    Some(signature.key.to_string())
}

fn is_plain(file: &str) -> bool {
    !file.is_empty()
        && !file.starts_with('.')
        && file.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.'))
}

/// What is wrong with a link to the record before.
fn link_fault(opened: &Link, record: &ReadRecord, sealed: &[u8; 32]) -> Option<String> {
    if opened.id != record.id || opened.digest != hex(sealed) {
        return Some(format!("{RECORD}: is not the one that {LINK} was written for"));
    }
    let expected =
        unhex(&opened.salt).zip(unhex(&opened.previous)).map(|(salt, previous)| link(&salt, &previous));
    let is_it = expected.is_some_and(|expected| record.previous == hex(&expected));
    (!is_it).then(|| format!("{LINK}: does not open what the record says of the one before"))
}

/// Looks at an archive that was taken elsewhere; with `known`, holds its record against that SHA-256.
///
/// # Errors
/// When it cannot be read at all. What is wrong with its content stands in the answer.
pub fn check_archive(reader: impl Read, known: Option<&str>) -> io::Result<Verification> {
    let mut archive = tar::Archive::new(reader);
    let mut found: BTreeMap<String, (u64, String)> = BTreeMap::new();
    let (mut record, mut link, mut sums, mut signature) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut faults = Vec::new();
    for (idx, entry) in archive.entries()?.enumerate() {
        let mut entry = entry?;
        let path = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        let name = path.rsplit_once('/').map_or(path.as_str(), |(_, name)| name).to_owned();
        if idx >= MAX_ENTRIES {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "it has more entries than any snapshot"));
        }
        if !entry.header().entry_type().is_file() || !is_plain(&name) {
            faults.push(format!("{path:?}: is no file of a snapshot"));
            continue;
        }
        let kept = match name.as_str() {
            RECORD => Some(&mut record),
            LINK => Some(&mut link),
            SUMS => Some(&mut sums),
            SIGNATURE => Some(&mut signature),
            _ => None,
        };
        let of_it = match kept {
            Some(kept) => {
                kept.clear();
                entry.take(MAX_RECORD_BYTES).read_to_end(kept)?;
                (kept.len() as u64, hex(&digest(kept)))
            }
            None => digest_of(&mut entry)?,
        };
        if found.insert(name, of_it).is_some() {
            faults.push(format!("{path:?}: is there more than once"));
        }
    }
    let Ok(read) = serde_json::from_slice::<ReadRecord>(&record) else {
        let digest = found.get(RECORD).map(|(_, sha256)| sha256.clone());
        faults.push(format!("{RECORD}: is missing, or is no record of a snapshot"));
        return Ok(Verification { is_whole: false, digest, signed_by: None, files: Vec::new(), faults });
    };
    let sealed = digest(&record);
    if known.is_some_and(|known| !known.eq_ignore_ascii_case(&hex(&sealed))) {
        faults
            .push(format!("{RECORD}: its SHA-256 is {}, which is not the one that was named", hex(&sealed)));
    }
    if !link.is_empty() {
        match serde_json::from_slice::<Link>(&link) {
            Ok(link) => faults.extend(link_fault(&link, &read, &sealed)),
            Err(error) => faults.push(format!("{LINK}: {error}")),
        }
    }
    let signed_by = (!signature.is_empty()).then(|| signer(&signature, &record, &mut faults)).flatten();
    check_sums(&String::from_utf8_lossy(&sums), &found, &mut faults);
    let look = |file: &str| found.get(file).cloned().ok_or_else(|| "is missing".to_owned());
    let files = compare(&read, look, &mut faults);
    let others = [RECORD, LINK, SIGNATURE, SUMS, README, ANNOTATIONS];
    for name in found.keys() {
        if !others.contains(&name.as_str()) && !files.iter().any(|file| file.file == *name) {
            faults.push(format!("{name}: is not in the record"));
        }
    }
    Ok(Verification { is_whole: faults.is_empty(), digest: Some(hex(&sealed)), signed_by, files, faults })
}

/// Holds an archive's list of digests against its entries.
fn check_sums(sums: &str, found: &BTreeMap<String, (u64, String)>, faults: &mut Vec<String>) {
    if sums.is_empty() {
        faults.push(format!("{SUMS}: is missing"));
    }
    for line in sums.lines() {
        let named = line.split_once("  ").and_then(|(sha256, name)| Some((sha256, name, found.get(name)?)));
        match named {
            Some((sha256, _, (_, is))) if sha256 == is => {}
            Some((_, name, _)) => faults.push(format!("{name}: is not as {SUMS} has it")),
            None => faults.push(format!("{SUMS}: a line names no entry: {line:?}")),
        }
    }
}
