//! What a snapshot says of itself: the record's form, its link to the one before, and what is read back of them.

use serde::{Deserialize, Serialize};
use videofields_vision::clock::Timestamp;

use sha2::{Digest, Sha256};

/// The record's file.
pub(super) const RECORD: &str = "record.json";

/// The file that opens the record's link to the one before.
pub(super) const LINK: &str = "link.json";

/// The file of the record's signature, where there is a key.
pub(super) const SIGNATURE: &str = "signature.json";

/// The file that stays of a snapshot that was removed, beside its link.
pub(super) const REMOVAL: &str = "removal.json";

/// The rendered picture, or the camera's.
pub(super) const PICTURE: &str = "picture.png";

/// The form of records that this release writes.
pub(super) const VERSION: u32 = 1;

/// A record that is longer was not written by us.
pub(super) const MAX_RECORD_BYTES: u64 = 64 << 20;

/// Before what is hashed into a link, so that it is no other digest of ours.
const LINK_PREFIX: &[u8] = b"videofields snapshot link\n";

/// The file of a camera's frame.
pub(super) fn camera_file(camera: &str) -> String {
    format!("camera-{camera}.png")
}

/// A file of a snapshot, as its record names it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FileEntry {
    /// Its name in the snapshot's folder.
    pub(super) file: String,
    pub(super) bytes: u64,
    /// Lower-case hexadecimal.
    pub(super) sha256: String,
    /// Columns and rows.
    pub(super) size_px: [u32; 2],
}

/// What of a record is read back; all else in it is for people.
#[derive(Debug, Deserialize)]
pub(super) struct ReadRecord {
    pub(super) id: String,
    pub(super) made_at: String,
    pub(super) time: String,
    pub(super) made_by: Option<String>,
    pub(super) schedule: Option<String>,
    pub(super) kind: String,
    pub(super) subject: String,
    pub(super) note: String,
    pub(super) tags: Vec<String>,
    pub(super) hold: bool,
    pub(super) cameras: Vec<ReadCamera>,
    pub(super) files: Vec<FileEntry>,
    /// See [`link`].
    pub(super) previous: String,
}

/// A camera of a record.
#[derive(Debug, Deserialize)]
pub(super) struct ReadCamera {
    pub(super) id: String,
    #[serde(default)]
    pub(super) part: Option<String>,
    /// When what is shown of it was seen.
    #[serde(default)]
    pub(super) seen_at: Option<String>,
    #[serde(default)]
    pub(super) frame_time: Option<String>,
    /// What was hidden of it, in the texture.
    #[serde(default)]
    pub(super) hidden: Vec<Vec<[f64; 2]>>,
}

impl ReadCamera {
    /// Whether anything of it is shown.
    pub(super) fn takes_part(&self) -> bool {
        self.part.as_deref() != Some("none")
    }
}

/// What opens a record's link to the one before. Whoever has it learns how many there are: it is for who may see all.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Link {
    pub(super) version: u32,
    pub(super) id: String,
    /// 1, 2, 3, ... in the order in which they were sealed.
    pub(super) number: i64,
    /// SHA-256 of the record.
    pub(super) digest: String,
    /// SHA-256 of the record before; zeros for the first.
    pub(super) previous: String,
    pub(super) salt: String,
}

/// What stays of a snapshot that was removed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Removal {
    pub(super) version: u32,
    pub(super) id: String,
    pub(super) made_at: String,
    pub(super) removed_at: String,
    pub(super) removed_by: Option<String>,
    pub(super) removed_for: String,
}

/// What a record says of the one before: a digest that tells nothing to who does not have the salt, since whoever may see
/// one snapshot and not the one before it must not learn that there is one.
pub(super) fn link(salt: &[u8; 32], previous: &[u8; 32]) -> [u8; 32] {
    let mut hash = Sha256::new();
    for part in [LINK_PREFIX, salt, previous] {
        hash.update(part);
    }
    hash.finalize().into()
}

/// SHA-256 of `bytes`.
pub(super) fn digest(bytes: &[u8]) -> [u8; 32] {
    Sha256::digest(bytes).into()
}

/// Lower-case hexadecimal.
pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// What [`hex`] wrote of 32 bytes.
pub(super) fn unhex(text: &str) -> Option<[u8; 32]> {
    let is_hex = text.len() == 64 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    let mut bytes = [0; 32];
    for (place, byte) in bytes.iter_mut().enumerate().take_while(|_| is_hex) {
        *byte = u8::from_str_radix(&text[2 * place..2 * place + 2], 16).ok()?;
    }
    is_hex.then_some(bytes)
}

/// A document as it is written: RFC 8785, so that equal documents are equal bytes whoever writes them.
pub(super) fn canonical(document: &impl Serialize) -> Result<Vec<u8>, serde_json::Error> {
    serde_json_canonicalizer::to_vec(document)
}

/// Random bytes of the machine.
pub(super) fn random<const N: usize>() -> Result<[u8; N], super::EvidenceError> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|error| {
        super::EvidenceError::Internal(format!("the machine gives no random numbers: {error}"))
    })?;
    Ok(bytes)
}

/// Whether a text is the id of a snapshot: 32 hexadecimal digits.
pub(super) fn is_snapshot_id(text: &str) -> bool {
    text.len() == 32 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
}

/// An instant of a record.
pub(super) fn instant(text: &str) -> Option<Timestamp> {
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn records_are_written_as_rfc_8785_has_it() {
        // Its section 3.2.3 and appendix B: keys in order, numbers as ECMAScript writes them, no white space.
        let document = json!({"b": [1e21, 1.0, 1e-7, 4.50], "a": "\u{20ac}\n", "\u{20ac}": null});
        let text = String::from_utf8(canonical(&document).unwrap()).unwrap();
        assert_eq!(text, "{\"a\":\"\u{20ac}\\n\",\"b\":[1e+21,1,1e-7,4.5],\"\u{20ac}\":null}");
        let read: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(canonical(&read).unwrap(), text.as_bytes());
    }

    #[test]
    fn digests_are_read_as_they_are_written() {
        let digest = digest(b"abc");
        assert_eq!(hex(&digest), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        assert_eq!(unhex(&hex(&digest)), Some(digest));
        for text in ["", "ab", &"g".repeat(64), &"A".repeat(64), &"é".repeat(32)] {
            assert_eq!(unhex(text), None, "{text}");
        }
    }

    #[test]
    fn a_link_tells_nothing_without_its_salt() {
        let (first, other) = (link(&[1; 32], &[0; 32]), link(&[2; 32], &[0; 32]));
        assert!(first != other && first != digest(&[0; 32]) && first == link(&[1; 32], &[0; 32]));
        assert_ne!(first, link(&[1; 32], &[1; 32]));
    }
}
