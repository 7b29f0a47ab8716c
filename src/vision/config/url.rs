//! A camera's URL: which are taken, and their parts. What follows the port is never shown, since cameras are known to
//! want passwords there.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// Most bytes of a URL.
const MAX_URL_BYTES: usize = 2048;

/// A camera's URL as it is written; validated settings hold only such as [`CameraUrl::parse`] takes.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CameraUrl(String);

/// How a camera is spoken to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// RTSP.
    Rtsp,
    /// RTSP within TLS.
    Rtsps,
    /// Motion JPEG over HTTP.
    Http,
    /// Motion JPEG over HTTP within TLS.
    Https,
}

/// The parts of a camera's URL.
#[derive(Clone, PartialEq, Eq)]
pub struct UrlParts {
    /// How it is spoken to.
    pub scheme: Scheme,
    /// A name or an address; numbers in any base and number of parts are addresses.
    pub host: url::Host,
    /// The network interface behind which a link-local address lies (RFC 6874), by name or number.
    pub zone: Option<String>,
    /// The port, also where the URL names none.
    pub port: u16,
    /// Path and query, beginning with `/`; may hold secrets.
    pub path_and_query: String,
}

/// Why a text is no camera's URL. Never repeats more of it than its scheme.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UrlError {
    /// No URL at all.
    #[error(
        "expected a URL such as rtsp://192.168.1.20/stream, of at most {MAX_URL_BYTES} bytes without blanks"
    )]
    Malformed,
    /// A scheme that is no camera's.
    #[error("cameras have rtsp, rtsps, http or https URLs, not {0:?}")]
    Scheme(String),
    /// A user or a password stands in it.
    #[error(
        "a URL holds no user and no password: name the keys `user`, and `password_file` or `password_env`"
    )]
    Login,
}

impl Scheme {
    /// Its name, as URLs have it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Rtsp => "rtsp",
            Self::Rtsps => "rtsps",
            Self::Http => "http",
            Self::Https => "https",
        }
    }

    /// The port where none is named.
    #[must_use]
    pub const fn port(self) -> u16 {
        match self {
            Self::Rtsp => 554,
            Self::Rtsps => 322,
            Self::Http => 80,
            Self::Https => 443,
        }
    }

    /// Whether the connection is encrypted and the camera must prove its name.
    #[must_use]
    pub const fn is_encrypted(self) -> bool {
        matches!(self, Self::Rtsps | Self::Https)
    }
}

impl UrlParts {
    /// Whether it is RTSP, within TLS or not.
    #[must_use]
    pub const fn is_rtsp(&self) -> bool {
        matches!(self.scheme, Scheme::Rtsp | Scheme::Rtsps)
    }
}

impl CameraUrl {
    /// Takes a text as it is written; whether it is a camera's URL shows when it is parsed.
    #[must_use]
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    /// Its parts.
    ///
    /// # Errors
    /// When it is no URL that cameras have, or holds a user or a password.
    pub fn parse(&self) -> Result<UrlParts, UrlError> {
        let text = self.0.as_str();
        // The parser would drop line breaks and tabs silently.
        if text.len() > MAX_URL_BYTES || text.chars().any(|c| c.is_control() || c.is_whitespace()) {
            return Err(UrlError::Malformed);
        }
        let (text, zone) = without_zone(text)?;
        let text = text.as_ref();
        let parsed = url::Url::parse(text).map_err(|_unreadable: url::ParseError| UrlError::Malformed)?;
        let scheme = match parsed.scheme() {
            "rtsp" => Scheme::Rtsp,
            "rtsps" => Scheme::Rtsps,
            "http" => Scheme::Http,
            "https" => Scheme::Https,
            // `user:password` reads as a scheme too, if nothing follows as in a URL.
            other if text.contains("://") && other.len() <= 16 => {
                return Err(UrlError::Scheme(other.to_owned()));
            }
            other => {
                let known = ["file", "concat", "exec", "data", "pipe", "fd", "v4l2", "udp", "rtp", "srt"];
                let is_known = known.contains(&other);
                return Err(if is_known { UrlError::Scheme(other.to_owned()) } else { UrlError::Malformed });
            }
        };
        if !parsed.username().is_empty() || parsed.password().is_some() {
            return Err(UrlError::Login);
        }
        // Other than http's, hosts of rtsp URLs are left as they are written: read them alike, so that a number is
        // an address in both.
        let host = parsed.host_str().filter(|host| !host.is_empty()).ok_or(UrlError::Malformed)?;
        let host = url::Host::parse(host).map_err(|_unreadable: url::ParseError| UrlError::Malformed)?;
        let is_local = matches!(&host, url::Host::Ipv6(address) if address.is_unicast_link_local());
        if zone.is_some() && !is_local {
            return Err(UrlError::Malformed);
        }
        let port = parsed.port().unwrap_or(scheme.port());
        let query = parsed.query().map(|query| format!("?{query}")).unwrap_or_default();
        let path = if parsed.path().is_empty() { "/" } else { parsed.path() };
        let is_whole = port != 0 && path.starts_with('/');
        let path_and_query = format!("{path}{query}");
        is_whole.then_some(UrlParts { scheme, host, zone, port, path_and_query }).ok_or(UrlError::Malformed)
    }
}

/// Takes the zone out of an address in brackets: the library for URLs takes none.
fn without_zone(text: &str) -> Result<(Cow<'_, str>, Option<String>), UrlError> {
    /// Most letters of a network interface's name.
    const MAX_LETTERS: usize = 15;
    let Some((before, rest)) = text.split_once("://[") else { return Ok((text.into(), None)) };
    let Some((address, behind)) = rest.split_once(']') else { return Ok((text.into(), None)) };
    let Some((address, zone)) = address.split_once('%') else { return Ok((text.into(), None)) };
    // The sign before it is written as `%25` in a URL, and often as it is.
    let zone = zone.strip_prefix("25").filter(|zone| !zone.is_empty()).unwrap_or(zone);
    let is_letter = |letter: u8| letter.is_ascii_alphanumeric() || b"_.-".contains(&letter);
    if zone.is_empty() || zone.len() > MAX_LETTERS || !zone.bytes().all(is_letter) {
        return Err(UrlError::Malformed);
    }
    Ok((format!("{before}://[{address}]{behind}").into(), Some(zone.to_owned())))
}

impl fmt::Debug for CameraUrl {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.parse() {
            Ok(parts) => write!(formatter, "{parts:?}"),
            Err(_) => formatter.write_str("(no camera's URL)"),
        }
    }
}

impl fmt::Display for UrlParts {
    /// Scheme, host and port: what messages may show.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scheme = self.scheme.as_str();
        match (&self.host, &self.zone) {
            (url::Host::Ipv6(address), Some(zone)) => {
                write!(formatter, "{scheme}://[{address}%{zone}]:{}", self.port)
            }
            _ => write!(formatter, "{scheme}://{}:{}", self.host, self.port),
        }
    }
}

impl fmt::Debug for UrlParts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{self}/...")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<UrlParts, UrlError> {
        CameraUrl::new(text).parse()
    }

    #[test]
    fn cameras_urls_come_apart() {
        let check = |text: &str, shown: &str, path: &str| {
            let parts = parse(text).unwrap();
            assert_eq!((parts.to_string().as_str(), parts.path_and_query.as_str()), (shown, path), "{text}");
        };
        check("rtsp://cam.example", "rtsp://cam.example:554", "/");
        check("rtsp://10.0.0.2:8554/a/b?x=1", "rtsp://10.0.0.2:8554", "/a/b?x=1");
        check("RTSPS://[fe80::1]/a", "rtsps://[fe80::1]:322", "/a");
        check("http://h/video.mjpg#part", "http://h:80", "/video.mjpg");
        check("https://h:8443/", "https://h:8443", "/");
        check("rtsp://[fe80::1%25eth0]/a", "rtsp://[fe80::1%eth0]:554", "/a");
        check("rtsp://[fe80::1%eth0.7]:8554/a?b=[1%2]", "rtsp://[fe80::1%eth0.7]:8554", "/a?b=[1%2]");
        check("rtsp://[fe80::1%252]/", "rtsp://[fe80::1%2]:554", "/");
        // The same address in other words.
        for host in ["2130706433", "0177.0.0.1", "0x7f.1", "127.1"] {
            check(&format!("rtsp://{host}/a"), "rtsp://127.0.0.1:554", "/a");
            check(&format!("http://{host}/a"), "http://127.0.0.1:80", "/a");
        }
    }

    #[test]
    fn what_is_no_cameras_url_is_refused_and_not_repeated() {
        let check = |text: &str, expected: UrlError| {
            let error = parse(text).unwrap_err();
            assert_eq!(error, expected, "{text}");
            let said = format!("{error} {:?}", CameraUrl::new(text));
            assert!(!said.contains("s3cret") && !said.contains("admin"), "{said}");
        };
        let scheme = |name: &str| UrlError::Scheme(name.to_owned());
        check("file:///etc/s3cret", scheme("file"));
        check("concat:a|s3cret", scheme("concat"));
        check("exec:s3cret", scheme("exec"));
        check("rtmp://admin:s3cret@h/", scheme("rtmp"));
        check("rtsp://admin:s3cret@h/a", UrlError::Login);
        check("http://admin@h/a", UrlError::Login);
        check("rtsp://:s3cret@h/a", UrlError::Login);
        check("rtsp://admin:s3c@ret@h/a", UrlError::Login);
        for text in [
            "",
            "h",
            "/dev/s3cret",
            "rtsp:",
            "rtsp:admin:s3cret@h",
            "rtsp://",
            "rtsp:///s3cret",
            "admin:s3cret@h",
        ] {
            check(text, UrlError::Malformed);
        }
        for text in [
            "rtsp://[fe80::1%]/",
            "rtsp://[::1%eth0]/",
            "rtsp://[fe80::1%25et/h0]/",
            "rtsp://[fe80::1%0123456789abcdef]/",
        ] {
            check(text, UrlError::Malformed);
        }
        for text in
            ["rtsp://h/a\n", "rt\tsp://h/", "rtsp://h /", "rtsp://h:0/", "rtsp://h:70000/", "rtsp://%00/"]
        {
            check(text, UrlError::Malformed);
        }
        check(&format!("rtsp://h/{}", "a".repeat(2048)), UrlError::Malformed);
    }

    #[test]
    fn paths_and_queries_are_not_shown() {
        let url = CameraUrl::new("rtsp://h/user=admin&password=s3cret?p=s3cret");
        let said = format!("{url:?} {:?} {}", url.parse().unwrap(), url.parse().unwrap());
        assert!(said.contains("rtsp://h:554") && !said.contains("s3cret"), "{said}");
    }
}
