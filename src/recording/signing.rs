//! Signatures (Ed25519, RFC 8032): a key that signs, keys that verify, and their files, as `openssl genpkey -algorithm ed25519`
//! and `openssl pkey -pubout` write them.
//!
//! Signed bytes begin with their purpose ([`Purpose`]), so that a signature of one thing is none of another.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use ring::signature::{ED25519, Ed25519KeyPair, KeyPair, UnparsedPublicKey};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{PrivatePkcs8KeyDer, SubjectPublicKeyInfoDer};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Before the 32 bytes of a private key (RFC 8410, section 7, without the public key).
const PRIVATE_PREFIX: [u8; 16] = [0x30, 0x2e, 2, 1, 0, 0x30, 5, 6, 3, 0x2b, 0x65, 0x70, 4, 0x22, 4, 0x20];

/// Before the 32 bytes of a public key (RFC 8410, section 4).
const PUBLIC_PREFIX: [u8; 12] = [0x30, 0x2a, 0x30, 5, 6, 3, 0x2b, 0x65, 0x70, 3, 0x21, 0];

/// Most bytes of a key's file.
const MAX_FILE_BYTES: u64 = 64 << 10;

/// Permissions of users who are neither the owner nor in the group.
const OTHERS: u32 = 0o007;

/// Meaning of a signature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Number and digest of an entry: the audit log reached so far.
    AuditHead,
    /// The record of a snapshot.
    Snapshot,
    /// The manifest of an export.
    Export,
}

impl Purpose {
    const fn prefix(self) -> &'static [u8] {
        match self {
            Self::AuditHead => b"videofields audit head 1\n",
            Self::Snapshot => b"videofields snapshot 1\n",
            Self::Export => b"videofields export 1\n",
        }
    }

    fn message(self, content: &[u8]) -> Vec<u8> {
        [self.prefix(), content].concat()
    }
}

/// Reason why there is no key.
#[derive(Debug, thiserror::Error)]
pub enum SigningError {
    /// The file cannot be read.
    #[error("cannot read the key: {source}: {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Users who have no business with it can read it.
    #[error(
        "the private key can be read by every user of this machine, so a signature of it proves nothing: make another key, and \
         keep it from them (chmod o=): {}",
        path.display()
    )]
    Exposed {
        /// The file.
        path: PathBuf,
    },
    /// The file has something else in it.
    #[error("{expected}: {}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Expected contents.
        expected: &'static str,
    },
    /// The file cannot be written.
    #[error("cannot write the key: {source}: {}", path.display())]
    NotWritable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The system gives no random numbers.
    #[error("the system gives no random numbers")]
    NoRandomness,
}

/// A private key. Shown nowhere, and never written but by [`SigningKey::make`].
pub struct SigningKey {
    pair: Ed25519KeyPair,
    public: PublicKey,
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("SigningKey").field("public", &self.public).finish_non_exhaustive()
    }
}

impl SigningKey {
    /// Reads a key from a file (PEM, PKCS #8, not encrypted).
    ///
    /// # Errors
    /// When the file cannot be read, can be read by everybody, or has something else in it.
    pub fn read(path: &Path) -> Result<Self, SigningError> {
        let (pem, mode) = read(path)?;
        if mode & OTHERS != 0 {
            return Err(SigningError::Exposed { path: path.to_owned() });
        }
        let expected = "expected an Ed25519 key that is not encrypted (PEM, PKCS #8), as `videofields audit key` makes one";
        let wrong = || SigningError::Content { path: path.to_owned(), expected };
        let der = PrivatePkcs8KeyDer::from_pem_slice(&pem).ok().ok_or_else(wrong)?;
        let pair =
            Ed25519KeyPair::from_pkcs8_maybe_unchecked(der.secret_pkcs8_der()).ok().ok_or_else(wrong)?;
        let public: [u8; 32] = pair.public_key().as_ref().try_into().ok().ok_or_else(wrong)?;
        Ok(Self { pair, public: PublicKey(public) })
    }

    /// Makes a new key and writes it to a file that is not there yet and that its owner alone may read; the public key to it.
    ///
    /// # Errors
    /// When the file is there or cannot be written, or the system gives no random numbers.
    pub fn make(path: &Path) -> Result<PublicKey, SigningError> {
        let mut seed = [0; 32];
        getrandom::fill(&mut seed).map_err(|_no_randomness| SigningError::NoRandomness)?;
        let text = pem("PRIVATE KEY", &[&PRIVATE_PREFIX[..], &seed].concat());
        let written = || {
            let mut file = std::fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(path)?;
            file.write_all(text.as_bytes())?;
            file.sync_all()
        };
        written().map_err(|source| SigningError::NotWritable { path: path.to_owned(), source })?;
        Self::read(path).map(|key| key.public)
    }

    /// Returns the key with which its signatures are verified.
    #[must_use]
    pub const fn public(&self) -> PublicKey {
        self.public
    }

    /// Signs `content`.
    #[must_use]
    pub fn sign(&self, purpose: Purpose, content: &[u8]) -> Signature {
        let mut bytes = [0; 64];
        // A signature of Ed25519 has 64 bytes.
        bytes.copy_from_slice(self.pair.sign(&purpose.message(content)).as_ref());
        Signature { key: self.public, bytes }
    }
}

/// A public key; as text 64 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PublicKey([u8; 32]);

impl PublicKey {
    /// Takes the 32 bytes of a key; whether they are one shows when a signature is verified.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Returns its 32 bytes.
    #[must_use]
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// Reads a public key from a file (PEM).
    ///
    /// # Errors
    /// When the file cannot be read or has something else in it.
    pub fn read(path: &Path) -> Result<Self, SigningError> {
        let expected = "expected an Ed25519 public key (PEM, -----BEGIN PUBLIC KEY-----)";
        let wrong = || SigningError::Content { path: path.to_owned(), expected };
        let (pem, _mode) = read(path)?;
        let der = SubjectPublicKeyInfoDer::from_pem_slice(&pem).ok().ok_or_else(wrong)?;
        let key = der.as_ref().strip_prefix(&PUBLIC_PREFIX).ok_or_else(wrong)?;
        key.try_into().ok().map(Self).ok_or_else(wrong)
    }

    /// Returns it as a file of OpenSSL has it.
    #[must_use]
    pub fn to_pem(&self) -> String {
        pem("PUBLIC KEY", &[&PUBLIC_PREFIX[..], &self.0].concat())
    }
}

impl fmt::Display for PublicKey {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&hex(&self.0))
    }
}

impl FromStr for PublicKey {
    type Err = NotHex;

    fn from_str(text: &str) -> Result<Self, NotHex> {
        unhex(text).map(Self).ok_or(NotHex)
    }
}

/// A text is no key or signature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected hexadecimal digits, two for each byte")]
pub struct NotHex;

/// A signature, and the key that verifies it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Signature {
    /// Key of the signer.
    pub key: PublicKey,
    /// Signature that the private key made.
    pub bytes: [u8; 64],
}

impl Signature {
    /// Returns whether `key` signed `content` so.
    #[must_use]
    pub fn is_of(&self, purpose: Purpose, content: &[u8]) -> bool {
        let key = UnparsedPublicKey::new(&ED25519, self.key.as_bytes());
        key.verify(&purpose.message(content), &self.bytes).is_ok()
    }
}

/// A signature as files have it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SignatureText {
    /// The public key, 64 hexadecimal digits.
    pub key: String,
    /// The signature, 128 hexadecimal digits.
    pub signature: String,
}

impl From<Signature> for SignatureText {
    fn from(signature: Signature) -> Self {
        Self { key: signature.key.to_string(), signature: hex(&signature.bytes) }
    }
}

impl TryFrom<&SignatureText> for Signature {
    type Error = NotHex;

    fn try_from(text: &SignatureText) -> Result<Self, NotHex> {
        Ok(Self { key: text.key.parse()?, bytes: unhex(&text.signature).ok_or(NotHex)? })
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the bytes that hexadecimal digits stand for.
pub(crate) fn unhex<const N: usize>(text: &str) -> Option<[u8; N]> {
    if text.len() != 2 * N || !text.is_ascii() {
        return None;
    }
    let mut bytes = [0; N];
    for (byte, at) in bytes.iter_mut().zip((0..).step_by(2)) {
        let pair = &text[at..at + 2];
        // `+f` would be read too.
        *byte = u8::from_str_radix(pair, 16).ok().filter(|_| !pair.starts_with('+'))?;
    }
    Some(bytes)
}

fn pem(what: &str, der: &[u8]) -> String {
    // At most 64 bytes: of one line.
    format!("-----BEGIN {what}-----\n{}\n-----END {what}-----\n", BASE64_STANDARD.encode(der))
}

/// Reads a key's file; its content and permissions.
fn read(path: &Path) -> Result<(Vec<u8>, u32), SigningError> {
    let unreadable = |source| SigningError::Unreadable { path: path.to_owned(), source };
    // Asked before it is opened: opening a pipe would wait for its other end.
    if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(SigningError::Content { path: path.to_owned(), expected: "expected a file" });
    }
    let file = File::open(path).map_err(unreadable)?;
    let mode = file.metadata().map_err(unreadable)?.mode();
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(unreadable)?;
    Ok((bytes, mode))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;
    use tempfile::TempDir;

    /// The first key of RFC 8032, section 7.1, as `openssl pkey` writes it.
    const KNOWN: &str = "-----BEGIN PRIVATE KEY-----\n\
                         MC4CAQAwBQYDK2VwBCIEIJ1hsZ3v/VpguoRK9JLsLMREScVpezJpGXA7rAMcrn9g\n\
                         -----END PRIVATE KEY-----\n";
    const KNOWN_PUBLIC: &str = "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a";

    fn put(folder: &TempDir, name: &str, text: &str, mode: u32) -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(mode)).unwrap();
        path
    }

    #[test]
    fn keys_are_those_of_others_programs() {
        let folder = TempDir::new().unwrap();
        let key = SigningKey::read(&put(&folder, "key", KNOWN, 0o440)).unwrap();
        assert_eq!(key.public().to_string(), KNOWN_PUBLIC);
        let public = "-----BEGIN PUBLIC KEY-----\nMCowBQYDK2VwAyEA11qYAYKxCrfVS/7TyWQHOg7hcvPapiMlrwIaaPcHURo=\n-----END PUBLIC KEY-----\n";
        assert_eq!(key.public().to_pem(), public);
        assert_eq!(PublicKey::read(&put(&folder, "public", public, 0o644)).unwrap(), key.public());
        assert!(!format!("{key:?}").contains("9d61b19d"), "{key:?}");
    }

    #[test]
    fn a_signature_is_of_one_key_one_purpose_and_one_content() {
        let folder = TempDir::new().unwrap();
        let key = SigningKey::read(&put(&folder, "key", KNOWN, 0o600)).unwrap();
        let signature = key.sign(Purpose::AuditHead, b"a");
        assert!(signature.is_of(Purpose::AuditHead, b"a"));
        assert!(!signature.is_of(Purpose::AuditHead, b"b") && !signature.is_of(Purpose::Export, b"a"));
        let other = SigningKey::make(&folder.path().join("other")).unwrap();
        assert!(!Signature { key: other, ..signature }.is_of(Purpose::AuditHead, b"a"));
        let text = SignatureText::from(signature);
        assert_eq!(Signature::try_from(&text), Ok(signature));
        assert_eq!(Signature::try_from(&SignatureText { key: "+0".repeat(32), ..text }), Err(NotHex));
    }

    #[test]
    fn keys_that_everybody_can_read_and_other_files_are_refused() {
        let folder = TempDir::new().unwrap();
        let refused = |path: &Path| SigningKey::read(path).unwrap_err().to_string();
        for mode in [0o604, 0o602, 0o601] {
            assert!(refused(&put(&folder, "seen", KNOWN, mode)).contains("every user of this machine"));
        }
        assert!(refused(&put(&folder, "text", "key", 0o600)).starts_with("expected an Ed25519 key"));
        assert!(refused(folder.path()).starts_with("expected a file"));
        assert!(refused(&folder.path().join("none")).starts_with("cannot read the key"));
        let path = folder.path().join("made");
        let made = SigningKey::make(&path).unwrap();
        assert_eq!(SigningKey::read(&path).unwrap().public(), made);
        assert_eq!(std::fs::metadata(&path).unwrap().mode() & 0o777, 0o600);
        assert!(SigningKey::make(&path).unwrap_err().to_string().starts_with("cannot write the key"));
        assert!(
            PublicKey::read(&path).unwrap_err().to_string().starts_with("expected an Ed25519 public key")
        );
    }
}
