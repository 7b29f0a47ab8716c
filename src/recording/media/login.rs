//! Answers a camera's challenge for a user and a password: Basic, and Digest with MD5, SHA-256 or SHA-512/256.
//!
//! Cameras lock an account after some wrong passwords. So a challenge is answered once, and again only where the camera says
//! that it is the challenge that was too old, not the answer that was wrong.

use super::fault::ConnectionFault;
use http_auth::basic::BasicClient;
use http_auth::digest::{Algorithm, DigestClient};
use http_auth::{ChallengeRef, ParamValue, PasswordParams};

/// A user and a password.
#[derive(Clone, Copy)]
pub struct Login<'a> {
    /// The user.
    pub user: &'a str,
    /// The password.
    pub password: &'a str,
}

/// A user and a password that are kept for as long as a connection may be made.
#[derive(Clone)]
pub(crate) struct OwnedLogin {
    user: String,
    password: String,
}

impl OwnedLogin {
    pub(crate) fn of(login: Login<'_>) -> Self {
        Self { user: login.user.to_owned(), password: login.password.to_owned() }
    }
}

/// Logs in at one camera for as long as a connection lasts.
pub(crate) struct Answering {
    login: Option<OwnedLogin>,
    client: Option<Client>,
    /// True where an answer was taken since the last challenge.
    was_taken: bool,
    /// True where a challenge that was too old was answered anew since an answer was taken.
    was_stale: bool,
}

enum Client {
    Basic(BasicClient),
    Digest(DigestClient),
}

impl Answering {
    /// Returns one that has not answered yet.
    pub(crate) const fn new(login: Option<OwnedLogin>) -> Self {
        Self { login, client: None, was_taken: false, was_stale: false }
    }

    /// The header that answers the last challenge for a request; none where nobody asked yet.
    pub(crate) fn header(&mut self, method: &str, uri: &str) -> Option<String> {
        let OwnedLogin { user, password } = self.login.as_ref()?;
        match self.client.as_mut()? {
            Client::Basic(client) => Some(client.respond(user, password)),
            Client::Digest(client) => {
                // Cameras that offer to have the body looked at too seldom know how.
                let of = |body| PasswordParams { username: user, password, uri, method, body };
                let header = client.respond(&of(None)).or_else(|_wants_body| client.respond(&of(Some(&[]))));
                Some(with_algorithm(header.ok()?, client))
            }
        }
    }

    /// Tells that a request was answered other than by a challenge.
    pub(crate) const fn is_let_in(&mut self) {
        self.was_taken = self.client.is_some();
        self.was_stale = false;
    }

    /// Takes the challenges of an answer with status 401. The request is to be sent again then.
    ///
    /// # Errors
    /// When there is no login, it is refused, or the camera wants one in a way that is not known.
    pub(crate) fn challenge<'a>(
        &mut self,
        headers: impl Iterator<Item = &'a str>,
    ) -> Result<(), ConnectionFault> {
        if self.login.is_none() {
            return Err(ConnectionFault::Unauthorized);
        }
        let headers: Vec<&str> = headers.collect();
        let challenges: Vec<ChallengeRef<'_>> =
            headers.iter().flat_map(|header| challenges(header)).collect();
        // The first counts of those that hide the password equally well.
        let best = challenges.iter().rev().filter_map(client_of).max_by_key(|(rank, _)| *rank);
        let Some((_, client)) = best else {
            // One that asks for nothing has no better answer for anybody.
            let is_asked = !headers.is_empty();
            return Err(if is_asked { ConnectionFault::UnknownLogin } else { ConnectionFault::Unauthorized });
        };
        let is_stale = match (&client, &self.client) {
            (Client::Digest(new), Some(Client::Digest(old))) => new.stale() && new.nonce() != old.nonce(),
            _ => false,
        };
        if self.client.is_some() && !self.was_taken && (!is_stale || self.was_stale) {
            return Err(ConnectionFault::LoginRefused);
        }
        self.was_stale |= is_stale && !self.was_taken;
        self.was_taken = false;
        self.client = Some(client);
        Ok(())
    }
}

/// The challenges in a header, as the standard has them or, where it is written more loosely, the one that there is.
fn challenges(header: &str) -> Vec<ChallengeRef<'_>> {
    let mut found = http_auth::parse_challenges(header).unwrap_or_default();
    if found.is_empty() {
        found.extend(loose_challenge(header));
    }
    for challenge in &mut found {
        // An empty list of qualities is none, and algorithms are written in any case.
        challenge.params.retain(|(name, value)| {
            !(name.eq_ignore_ascii_case("qop") && value.as_escaped().trim().is_empty())
        });
        for (name, value) in &mut challenge.params {
            let known = ["MD5", "MD5-sess", "SHA-256", "SHA-256-sess", "SHA-512-256", "SHA-512-256-sess"];
            let known = known.into_iter().find(|known| known.eq_ignore_ascii_case(value.as_escaped()));
            if name.eq_ignore_ascii_case("algorithm")
                && let Some(Ok(known)) = known.map(ParamValue::try_from_escaped)
            {
                *value = known;
            }
        }
    }
    found
}

/// The challenge of a header with blanks or quotes where none belong, or without those that do.
fn loose_challenge(header: &str) -> Option<ChallengeRef<'_>> {
    let (scheme, mut rest) = header.trim().split_once(|letter: char| letter.is_ascii_whitespace())?;
    let mut challenge = ChallengeRef::new(scheme);
    while let Some((name, behind)) = rest.split_once('=') {
        let behind = behind.trim_start();
        let (value, behind) = match behind.strip_prefix('"') {
            Some(quoted) => quoted.split_once('"').unwrap_or((quoted, "")),
            None => behind.split_once(',').unwrap_or((behind, "")),
        };
        let name = name.trim_matches(|letter: char| letter == ',' || letter.is_ascii_whitespace());
        if let Ok(value) = ParamValue::try_from_escaped(value.trim()) {
            challenge.params.push((name, value));
        }
        rest = behind;
    }
    Some(challenge)
}

/// A way to answer a challenge, and how well it hides the password.
fn client_of(challenge: &ChallengeRef<'_>) -> Option<(u8, Client)> {
    if let Ok(client) = DigestClient::try_from(challenge) {
        let rank = if client.algorithm() == Algorithm::Md5 { 1 } else { 2 };
        return Some((rank, Client::Digest(client)));
    }
    BasicClient::try_from(challenge).ok().map(|client| (0, Client::Basic(client)))
}

/// Names the algorithm of an answer without quality of protection, which `http-auth` leaves out: cameras take such an answer for
/// one by MD5.
fn with_algorithm(header: String, client: &DigestClient) -> String {
    let name = match client.algorithm() {
        Algorithm::Sha256 => "SHA-256",
        Algorithm::Sha512Trunc256 => "SHA-512-256",
        _ => return header,
    };
    if client.rfc2069_compat() { format!("{header}, algorithm={name}") } else { header }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOGIN: Option<Login<'_>> = Some(Login { user: "u", password: "p@:/#% 1" });

    fn asked(challenges: &[&str]) -> (Answering, Result<(), ConnectionFault>) {
        let mut answering = Answering::new(LOGIN.map(OwnedLogin::of));
        assert_eq!(answering.header("DESCRIBE", "rtsp://cam/a"), None, "nobody asked");
        let answer = answering.challenge(challenges.iter().copied());
        (answering, answer)
    }

    #[test]
    fn the_best_of_several_challenges_is_answered_and_names_its_algorithm() {
        let (basic, md5) = ("Basic realm=\"x\"", "Digest realm=\"x\", nonce=\"abc\"");
        let sha = "Digest realm=\"x\", nonce=\"abc\", algorithm=SHA-256";
        let has = |challenges: &[&str], part: &str, none: &str| {
            let (mut answering, answer) = asked(challenges);
            assert_eq!(answer, Ok(()));
            let header = answering.header("DESCRIBE", "rtsp://cam/a").unwrap();
            assert!(header.contains(part) && !header.contains(none), "{challenges:?}: {header}");
        };
        has(&[basic], "Basic dTpwQDovIyUgMQ==", "Digest");
        has(&[basic, md5], "Digest username=\"u\"", "algorithm=SHA");
        has(&[md5, sha], "algorithm=SHA-256", "Basic");
        has(
            &[&format!("{sha}, qop=\"auth\"")],
            "algorithm=SHA-256, nc=00000001",
            "algorithm=SHA-256, algorithm",
        );
        // By hand: H(H(u:x:p@:/#% 1):abc:H(DESCRIBE:rtsp://cam/a)), as `printf` and `sha256sum` have it.
        has(&[sha], "response=\"1c0ee5da53e454e8086b09247a68e62bf01372011cf9f3dae55dd6ecc4ced218\"", "Basic");
        has(&[sha, "Digest realm=\"y\", nonce=\"abc\", algorithm=SHA-256"], "realm=\"x\"", "realm=\"y\"");
        let (_, answer) = asked(&["NTLM"]);
        assert_eq!(answer, Err(ConnectionFault::UnknownLogin));
        assert_eq!(asked(&[]).1, Err(ConnectionFault::Unauthorized));
    }

    #[test]
    fn a_refused_answer_is_not_given_again_but_to_a_challenge_that_was_too_old() {
        let (mut answering, _) = asked(&["Digest realm=\"x\", nonce=\"a\""]);
        let again = |answering: &mut Answering, challenge: &str| answering.challenge([challenge].into_iter());
        // A camera may give a new nonce with each refusal.
        let refused = again(&mut answering, "Digest realm=\"x\", nonce=\"b\"");
        assert_eq!(refused, Err(ConnectionFault::LoginRefused));
        assert_eq!(
            again(&mut answering, "Digest realm=\"x\", nonce=\"a\", stale=true"),
            refused,
            "the same nonce"
        );
        assert_eq!(again(&mut answering, "Digest realm=\"x\", nonce=\"c\", stale=true"), Ok(()));
        assert_eq!(
            again(&mut answering, "Digest realm=\"x\", nonce=\"d\", stale=true"),
            refused,
            "every one is"
        );
        assert_eq!(again(&mut answering, "Digest realm=\"x\", nonce=\"d\""), refused);
        // One that let somebody in before knows the password: its nonce has run out.
        answering.is_let_in();
        assert_eq!(again(&mut answering, "Digest realm=\"x\", nonce=\"e\""), Ok(()));
        assert_eq!(again(&mut answering, "Digest realm=\"x\", nonce=\"f\""), refused);
        let mut nobody = Answering::new(None);
        let asked = nobody.challenge(["Basic realm=\"x\""].into_iter());
        assert_eq!(asked, Err(ConnectionFault::Unauthorized));
    }
}
