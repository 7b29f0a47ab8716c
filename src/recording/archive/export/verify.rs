//! Verifies that an export is as it was made, wherever it lies by now: its manifest's signature, and every clip's digest.

use super::manifest::{self, Manifest};
use crate::signing::{PublicKey, Purpose, Signature, SignatureText};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// A manifest that is longer was not written by us.
const MAX_MANIFEST_BYTES: u64 = 16 << 20;

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 256 << 10;

/// Findings of a look at an export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VerifiedExport {
    /// Clips that the manifest names.
    pub n_clips: usize,
    /// Key that signed the manifest as it stands there; none where nobody did.
    pub signed_by: Option<PublicKey>,
    /// Faults, in words.
    pub faults: Vec<String>,
}

/// Looks at an export's folder.
///
/// # Errors
/// When its manifest cannot be read.
pub fn verify_export(folder: &Path) -> io::Result<VerifiedExport> {
    let text = read(&folder.join(manifest::FILE))?;
    let manifest: Manifest = serde_json::from_slice(&text)?;
    let mut faults = Vec::new();
    let signed_by = match read(&folder.join(manifest::SIGNATURE)) {
        Ok(signature) => signer(&signature, &text).map_err(|fault| faults.push(fault)).ok(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => {
            faults.push(format!("{}: {error}", manifest::SIGNATURE));
            None
        }
    };
    for clip in manifest.clips() {
        let found = if manifest::is_file_name(&clip.file) {
            digest(&folder.join(&clip.file)).map_err(|error| error.to_string())
        } else {
            Err("is no name of a clip".to_owned())
        };
        match found {
            Ok(sha256) if sha256 == clip.sha256 => {}
            Ok(_) => faults.push(format!("{}: is not as the manifest has it", clip.file)),
            Err(why) => faults.push(format!("{:?}: {why}", clip.file)),
        }
    }
    Ok(VerifiedExport { n_clips: manifest.clips().count(), signed_by, faults })
}

fn signer(signature: &[u8], text: &[u8]) -> Result<PublicKey, String> {
    let read = serde_json::from_slice::<SignatureText>(signature).ok();
    let signature = read.and_then(|text| Signature::try_from(&text).ok());
    let signature = signature.ok_or_else(|| format!("{}: is no signature", manifest::SIGNATURE))?;
    if signature.is_of(Purpose::Export, text) {
        return Ok(signature.key);
    }
    Err(format!("{}: is not the signature of {}", manifest::SIGNATURE, manifest::FILE))
}

fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    File::open(path)?.take(MAX_MANIFEST_BYTES).read_to_end(&mut text)?;
    Ok(text)
}

fn digest(path: &Path) -> io::Result<String> {
    // A pipe would be waited for.
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::other("is no file"));
    }
    let (mut file, mut hash, mut chunk) = (File::open(path)?, Sha256::new(), vec![0; CHUNK_BYTES]);
    loop {
        match file.read(&mut chunk) {
            Ok(0) => break,
            Ok(n) => hash.update(&chunk[..n]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
