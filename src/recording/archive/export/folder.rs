//! The folder in which exports lie, each in one of its own, named by its id.
//!
//! As in the archive's own folder, every step is taken from the folder opened before it, and no link is followed.

use super::super::ArchiveError;
use super::super::folder::{self, Folder};
use super::manifest::{self, Manifest};
use crate::signing::{Purpose, SignatureText, SigningKey};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::PathBuf;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;

/// Its name in the archive's folder; no camera's, whose names have no dots.
const NAME: &str = "exported.clips";

/// A manifest that is longer was not written by us.
const MAX_MANIFEST_BYTES: u64 = 16 << 20;

/// A signature that is longer was not written by us.
const MAX_SIGNATURE_BYTES: u64 = 4096;

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 256 << 10;

/// Exports asked for within one second.
const MAX_NUMBER: u32 = 10_000;

/// The folder of all exports; made with the first of them.
#[derive(Debug)]
pub(super) struct ExportsFolder {
    archive: Arc<Folder>,
    path: PathBuf,
}

/// The folder of one export.
#[derive(Debug)]
pub(super) struct ExportFolder {
    path: PathBuf,
    root: File,
}

/// An export that was finished, and the SHA-256 of its manifest.
#[derive(Debug)]
pub(super) struct Finished {
    pub(super) manifest: Manifest,
    pub(super) manifest_sha256: String,
    pub(super) manifest_bytes: u64,
    /// Bytes and SHA-256 of the manifest's signature, where it is signed.
    pub(super) signature: Option<(u64, String)>,
}

impl ExportsFolder {
    /// That of an archive.
    pub(super) fn beneath(archive: Arc<Folder>) -> Self {
        let path = archive.path().join(NAME);
        Self { archive, path }
    }

    /// Every export that was finished; what was not goes, since it can be asked for again.
    pub(super) fn finished(&self) -> Result<Vec<Finished>, ArchiveError> {
        let names = match self.archive.enter(NAME).and_then(folder::names) {
            Err(error) if folder::is_nothing(&error) => return Ok(Vec::new()),
            names => names.map_err(ArchiveError::files("read", &self.path))?,
        };
        let mut all = Vec::new();
        // What has another name is somebody else's.
        for id in names.into_iter().filter(|name| is_export_id(name)) {
            let found = self.open(&id).and_then(|export| match export.manifest()? {
                Some(finished) => Ok(Some(finished)),
                None => {
                    tracing::info!(id, "an export was not finished and goes");
                    self.remove(&id).map(|()| None)
                }
            });
            match found {
                Ok(Some(finished)) if is_ours(&finished.manifest, &id) => all.push(finished),
                Ok(Some(_)) => tracing::warn!(id, "an export's manifest is another's; it is left as it is"),
                Ok(None) => {}
                Err(error) => tracing::warn!(id, %error, "an export is left as it is"),
            }
        }
        Ok(all)
    }

    /// The folder of one export.
    pub(super) fn open(&self, id: &str) -> Result<ExportFolder, ArchiveError> {
        let path = self.path.join(id);
        let root = self.archive.enter(NAME).and_then(|all| folder::enter(&all, id));
        let root = root.map_err(ArchiveError::files("enter", &path))?;
        Ok(ExportFolder { path, root })
    }

    /// Makes the folder of an export that is asked for at `now`; its id, which is none of those `taken`.
    pub(super) fn create(&self, now: Timestamp, taken: &[String]) -> Result<String, ArchiveError> {
        let time = instant_name(now);
        let all = self.archive.enter_or_make(NAME).map_err(ArchiveError::files("make", &self.path))?;
        for number in 1..MAX_NUMBER {
            let id = if number == 1 { time.clone() } else { format!("{time}-{number}") };
            if taken.contains(&id) {
                continue;
            }
            match folder::make(&all, &id) {
                Ok(()) => return Ok(id),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(ArchiveError::files("make", &self.path.join(&id))(error)),
            }
        }
        Err(ArchiveError::files("make", &self.path)(io::ErrorKind::AlreadyExists.into()))
    }

    /// Removes an export, its manifest first, so that what is left of it after a crash counts as unfinished.
    pub(super) fn remove(&self, id: &str) -> Result<(), ArchiveError> {
        let export = match self.open(id) {
            Err(ArchiveError::Files { source, .. }) if folder::is_nothing(&source) => return Ok(()),
            other => other?,
        };
        let failed = |error| ArchiveError::files("remove", &export.path)(error);
        folder::remove_file(&export.root, manifest::FILE).map_err(failed)?;
        for name in export.root.try_clone().and_then(folder::names).map_err(failed)? {
            folder::remove_file(&export.root, &name).map_err(failed)?;
        }
        self.archive.enter(NAME).and_then(|all| folder::remove_folder(&all, id)).map_err(failed)
    }

    /// A file of an export, opened for reading.
    pub(super) fn open_file(&self, id: &str, file: &str) -> Result<File, ArchiveError> {
        let export = self.open(id)?;
        folder::open_file(&export.root, file).map_err(ArchiveError::files("read", &export.path.join(file)))
    }
}

impl ExportFolder {
    /// Makes a file, which must not be there.
    pub(super) fn create(&self, name: &str) -> Result<File, ArchiveError> {
        folder::create_file(&self.root, name).map_err(ArchiveError::files("make", &self.path.join(name)))
    }

    /// Bytes and SHA-256 of a file that was written, once all of it is on the disk; none where it no longer `goes_on`.
    pub(super) fn digest(
        &self,
        name: &str,
        goes_on: &dyn Fn() -> bool,
    ) -> Result<Option<(u64, String)>, ArchiveError> {
        let failed = |error| ArchiveError::files("read", &self.path.join(name))(error);
        let mut file = folder::open_file(&self.root, name).map_err(failed)?;
        file.sync_all().map_err(failed)?;
        let (mut hash, mut n_bytes, mut chunk) = (Sha256::new(), 0, vec![0; CHUNK_BYTES]);
        while goes_on() {
            let n = file.read(&mut chunk).map_err(failed)?;
            if n == 0 {
                return Ok(Some((n_bytes, hexadecimal(&hash.finalize()))));
            }
            hash.update(&chunk[..n]);
            n_bytes += n as u64;
        }
        Ok(None)
    }

    /// Puts down the manifest, signed where there is a key, with which the export is finished.
    pub(super) fn finish(
        &self,
        manifest: Manifest,
        key: Option<&SigningKey>,
    ) -> Result<Finished, super::ExportError> {
        const PART: &str = "manifest.json.part";
        let text = serde_json::to_vec_pretty(&manifest)?;
        let failed = |error| ArchiveError::files("write", &self.path.join(manifest::FILE))(error);
        let signature = key.map(|key| SignatureText::from(key.sign(Purpose::Export, &text)));
        let signature = signature.map(|signature| serde_json::to_vec_pretty(&signature)).transpose()?;
        if let Some(signature) = &signature {
            let failed = |error| ArchiveError::files("write", &self.path.join(manifest::SIGNATURE))(error);
            let mut file = self.create(manifest::SIGNATURE)?;
            file.write_all(signature).and_then(|()| file.sync_all()).map_err(failed)?;
        }
        let mut file = self.create(PART)?;
        file.write_all(&text).and_then(|()| file.sync_all()).map_err(failed)?;
        folder::rename(&self.root, PART, manifest::FILE).map_err(failed)?;
        Ok(Finished {
            manifest,
            manifest_sha256: hexadecimal(&Sha256::digest(&text)),
            manifest_bytes: text.len() as u64,
            signature: signature.map(|text| (text.len() as u64, hexadecimal(&Sha256::digest(&text)))),
        })
    }

    /// The manifest, if there is one.
    fn manifest(&self) -> Result<Option<Finished>, ArchiveError> {
        let path = self.path.join(manifest::FILE);
        let file = match folder::open_file(&self.root, manifest::FILE) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(ArchiveError::files("read", &path))?,
        };
        let mut text = Vec::new();
        file.take(MAX_MANIFEST_BYTES).read_to_end(&mut text).map_err(ArchiveError::files("read", &path))?;
        let manifest = serde_json::from_slice(&text)
            .map_err(|error| ArchiveError::files("read", &path)(io::Error::other(error)))?;
        let manifest_sha256 = hexadecimal(&Sha256::digest(&text));
        let signature = self.signature()?;
        Ok(Some(Finished { manifest, manifest_sha256, manifest_bytes: text.len() as u64, signature }))
    }

    /// Bytes and SHA-256 of the manifest's signature, if there is one.
    fn signature(&self) -> Result<Option<(u64, String)>, ArchiveError> {
        let failed = |error| ArchiveError::files("read", &self.path.join(manifest::SIGNATURE))(error);
        let file = match folder::open_file(&self.root, manifest::SIGNATURE) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(failed)?,
        };
        let mut text = Vec::new();
        file.take(MAX_SIGNATURE_BYTES).read_to_end(&mut text).map_err(failed)?;
        Ok(Some((text.len() as u64, hexadecimal(&Sha256::digest(&text)))))
    }
}

/// Whether a folder is named as we name exports: `20260301t120000z`, or with a number behind it.
fn is_export_id(name: &str) -> bool {
    let (instant, number) = name.split_once('-').unwrap_or((name, "2"));
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let parts = instant.strip_suffix('z').and_then(|instant| instant.split_once('t'));
    is_digits(number) && parts.is_some_and(|(day, time)| is_digits(day) && day.len() == 8 && is_digits(time))
}

/// Whether a manifest is of the export of that id, and names no files but its own.
fn is_ours(manifest: &Manifest, id: &str) -> bool {
    manifest.id == id && manifest.clips().all(|clip| manifest::is_file_name(&clip.file))
}

/// An instant as a part of names, to the second: `20260301t120000z`.
fn instant_name(at: Timestamp) -> String {
    let text = at.to_string();
    let kept = text.split('.').next().unwrap_or_default().chars().filter(char::is_ascii_alphanumeric);
    let name: String = kept.map(|c| c.to_ascii_lowercase()).collect();
    format!("{}z", name.trim_end_matches('z'))
}

fn hexadecimal(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string never fails.
        let _infallible = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exports_are_known_by_their_names() {
        for name in ["20260301t120000z", "20260301t120000z-2", "19700101t000820z-9999"] {
            assert!(is_export_id(name), "{name}");
        }
        for name in ["2026-03-01", "case7", "20260301t120000z-", "20260301t120000z-x", "20260301", "t1z", ""]
        {
            assert!(!is_export_id(name), "{name}");
        }
        assert_eq!(instant_name("2026-03-01T12:00:00.123Z".parse().unwrap()), "20260301t120000z");
        assert_eq!(instant_name("2026-03-01T12:00:00Z".parse().unwrap()), "20260301t120000z");
    }

    #[test]
    fn clips_are_named_by_nothing_that_leads_elsewhere() {
        assert!(manifest::is_file_name("north-20260301T120000.0001Z.mp4"));
        for name in ["", "..", ".hidden", "/etc/passwd", "a/b", "../x", "a\0b"] {
            assert!(!manifest::is_file_name(name), "{name:?}");
        }
    }
}
