//! Secrets: passwords as Argon2id keeps them, and random ones of 256 bits for tokens and sessions.
//!
//! A password is weak and therefore kept by a slow hash with salt (RFC 9106, OWASP's parameters: 19 MiB, two passes). A
//! random secret of 256 bits cannot be guessed however fast one tries, so its SHA-256 is enough, and a request does not wait.

use argon2::Argon2;
use argon2::password_hash::{PasswordHash, PasswordHasher, PasswordVerifier, SaltString};
use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use sha2::Digest;

/// What every token begins with, so that one that leaked is found by whoever looks for it.
const PREFIX: &str = "vf";

/// A hash that no password has, with the parameters of all others: who is not there takes as long as a wrong password.
const NOBODY: &str =
    "$argon2id$v=19$m=19456,t=2,p=1$bm9ib2R5IGlzIGhlcmU$AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";

/// The machine gives no random numbers.
#[derive(Clone, Debug, thiserror::Error)]
#[error("the machine gives no random numbers: {0}")]
pub struct NoRandomness(String);

/// Random bytes of the machine.
fn random<const N: usize>() -> Result<[u8; N], NoRandomness> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|error| NoRandomness(error.to_string()))?;
    Ok(bytes)
}

/// A random secret of 256 bits, as text of 43 characters.
pub(super) fn secret() -> Result<String, NoRandomness> {
    Ok(URL_SAFE_NO_PAD.encode(random::<32>()?))
}

/// A random name of 64 bits: hexadecimal.
pub(super) fn name() -> Result<String, NoRandomness> {
    Ok(random::<8>()?.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// SHA-256 of a secret.
pub(super) fn digest(secret: &str) -> [u8; 32] {
    sha2::Sha256::digest(secret.as_bytes()).into()
}

/// A token as its owner shows it.
pub(super) fn token(id: &str, secret: &str) -> String {
    format!("{PREFIX}_{id}_{secret}")
}

/// Id and secret of a token.
pub(super) fn parse_token(text: &str) -> Option<(&str, &str)> {
    let mut parts = text.splitn(3, '_');
    (parts.next()? == PREFIX).then_some((parts.next()?, parts.next()?))
}

/// A password as it is kept: a PHC string. Takes some tens of milliseconds.
pub(super) fn hash_password(password: &str) -> Result<String, NoRandomness> {
    let failed = |error: argon2::password_hash::Error| NoRandomness(error.to_string());
    let salt = SaltString::encode_b64(&random::<16>()?).map_err(failed)?;
    Ok(Argon2::default().hash_password(password.as_bytes(), &salt).map_err(failed)?.to_string())
}

/// Whether `password` is the one that is kept as `kept`; of nobody, never, in the same time.
pub(super) fn is_password(password: &str, kept: Option<&str>) -> bool {
    let Ok(hash) = PasswordHash::new(kept.unwrap_or(NOBODY)) else { return false };
    Argon2::default().verify_password(password.as_bytes(), &hash).is_ok() && kept.is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_known_again_and_is_not_kept() {
        let kept = hash_password("correct horse battery").unwrap();
        assert!(kept.starts_with("$argon2id$v=19$m=19456,t=2,p=1$"), "{kept}");
        assert!(!kept.contains("horse"));
        assert!(is_password("correct horse battery", Some(&kept)));
        assert!(!is_password("correct horse batterx", Some(&kept)));
        assert_ne!(kept, hash_password("correct horse battery").unwrap(), "each has its salt");
        assert!(PasswordHash::new(NOBODY).is_ok(), "it must be tried for who is not there");
        assert!(!is_password("anything", None));
        assert!(!is_password("anything", Some("no hash")));
    }

    #[test]
    fn tokens_are_taken_apart_as_they_were_put_together() {
        let (id, secret) = (name().unwrap(), secret().unwrap());
        let text = token(&id, &secret);
        assert_eq!(parse_token(&text), Some((id.as_str(), secret.as_str())));
        assert_eq!((id.len(), secret.len()), (16, 43));
        for text in ["", "vf", "vf_a", "xx_a_b", "vf-a-b"] {
            assert_eq!(parse_token(text), None, "{text}");
        }
        // A secret may hold the separator.
        assert_eq!(parse_token("vf_a_b_c"), Some(("a", "b_c")));
    }
}
