//! The login in a SOAP message: WS-UsernameToken with a digest (OASIS, Web Services Security, username token profile 1.0).

use super::OnvifError;
use crate::media::Login;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha1::{Digest, Sha1};
use videofields_vision::clock::Timestamp;

const NANOS_PER_SEC: i64 = 1_000_000_000;

/// Bytes of a nonce: some cameras refuse longer ones.
const NONCE_BYTES: usize = 16;

const WSS: &str = "http://docs.oasis-open.org/wss/2004/01/oasis-200401-wss-";

/// Returns the header that logs in, made at `created` by the device's clock.
///
/// # Errors
/// When the machine gives no random bytes.
pub(super) fn security(login: Login<'_>, created: Timestamp) -> Result<String, OnvifError> {
    let mut nonce = [0; NONCE_BYTES];
    getrandom::fill(&mut nonce).map_err(|_error| OnvifError::NoRandomness)?;
    // Whole seconds, as cameras read them all.
    let secs = created.as_nanos().div_euclid(NANOS_PER_SEC);
    let created = Timestamp::from_nanos(secs.saturating_mul(NANOS_PER_SEC)).to_string();
    Ok(with_nonce(login, &nonce, &created))
}

fn with_nonce(login: Login<'_>, nonce: &[u8], created: &str) -> String {
    let digest = STANDARD.encode(digest(nonce, created, login.password));
    let (user, nonce) = (escaped(login.user), STANDARD.encode(nonce));
    format!(
        "<o:Security xmlns:o=\"{WSS}wssecurity-secext-1.0.xsd\" s:mustUnderstand=\"1\"><o:UsernameToken>\
         <o:Username>{user}</o:Username>\
         <o:Password Type=\"{WSS}username-token-profile-1.0#PasswordDigest\">{digest}</o:Password>\
         <o:Nonce EncodingType=\"{WSS}soap-message-security-1.0#Base64Binary\">{nonce}</o:Nonce>\
         <Created xmlns=\"{WSS}wssecurity-utility-1.0.xsd\">{created}</Created>\
         </o:UsernameToken></o:Security>"
    )
}

/// Base64 of this stands in place of a password.
fn digest(nonce: &[u8], created: &str, password: &str) -> [u8; 20] {
    let mut hash = Sha1::new();
    hash.update(nonce);
    hash.update(created.as_bytes());
    hash.update(password.as_bytes());
    hash.finalize().into()
}

/// Returns a text as it stands in XML.
pub(super) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_digest_is_the_one_of_onvifs_own_example() {
        // ONVIF Application Programmer's Guide, 6.1.1.3.
        let nonce = STANDARD.decode("LKqI6G/AikKCQrN0zqZFlg==").unwrap();
        let login = Login { user: "user", password: "userpassword" };
        let header = with_nonce(login, &nonce, "2010-09-16T07:50:45Z");
        assert!(header.contains(">tuOSpGlFlIXsozq4HFNeeGeFLEI=</o:Password>"), "{header}");
        assert!(header.contains(">LKqI6G/AikKCQrN0zqZFlg==</o:Nonce>"), "{header}");
        assert!(header.contains(">2010-09-16T07:50:45Z</Created>"), "{header}");
    }

    #[test]
    fn every_header_is_another_and_names_whole_seconds() {
        let login = Login { user: "a<b>&\"c\"", password: "s3cret" };
        let at = Timestamp::from_nanos(1_700_000_000_900_000_000);
        let (first, second) = (security(login, at).unwrap(), security(login, at).unwrap());
        assert_ne!(first, second);
        for header in [first, second] {
            assert!(header.contains(">2023-11-14T22:13:20Z</Created>"), "{header}");
            assert!(header.contains("<o:Username>a&lt;b&gt;&amp;&quot;c&quot;</o:Username>"), "{header}");
            assert!(!header.contains("s3cret"), "{header}");
        }
    }
}
