//! A camera's user and password, read where the configuration says, each time the camera is connected to.

use super::endpoint::Endpoint;
use super::{CameraError, MediaRoots};
use crate::media::Login;
use std::fmt;
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Read};
use std::path::Path;
use videofields_vision::config::{CredentialsSettings, SourceSettings};

/// Most bytes of a file with a password.
const MAX_FILE_BYTES: u64 = 4096;

/// A text that nothing shows.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct Secret(String);

impl fmt::Debug for Secret {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("(secret)")
    }
}

/// Who logs in at a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Credentials {
    user: String,
    password: Secret,
}

impl Credentials {
    /// Those that `settings` name; `None` where nobody logs in.
    pub(super) fn read(settings: &SourceSettings) -> Result<Option<Self>, CameraError> {
        let Some(user) = settings.user.clone() else { return Ok(None) };
        let password = match (&settings.password_file, &settings.password_env) {
            (Some(path), _) => {
                first_line(path).map_err(|source| CameraError::PasswordFile { path: path.clone(), source })?
            }
            (None, Some(name)) => std::env::var(name)
                .map_err(|_error: std::env::VarError| CameraError::PasswordVariable { name: name.clone() })?,
            (None, None) => return Ok(None),
        };
        Ok(Some(Self { user, password: Secret(password) }))
    }

    /// Returns those that `settings` name, or that stand at their name in `roots`, for the camera at `endpoint`; `None` where nobody
    /// logs in.
    pub(super) fn for_camera(
        settings: &SourceSettings,
        roots: &MediaRoots,
        endpoint: &Endpoint,
    ) -> Result<Option<Self>, CameraError> {
        match &settings.credentials {
            Some(name) => Self::named(name, roots, endpoint).map(Some),
            None => Self::read(settings),
        }
    }

    /// Returns those of that name in `roots`, which may go to `endpoint`.
    pub(crate) fn named(name: &str, roots: &MediaRoots, endpoint: &Endpoint) -> Result<Self, CameraError> {
        let found = find(name, roots)?;
        if !endpoint.is_within(&found.networks) {
            return Err(CameraError::CredentialsElsewhere { name: name.to_owned(), place: endpoint.place() });
        }
        Self::read(&source_of(found))?.ok_or_else(|| missing(name, roots))
    }

    /// What a connection needs.
    pub(crate) fn login(&self) -> Login<'_> {
        Login { user: &self.user, password: &self.password.0 }
    }
}

/// Tells whether a camera's login has changed since it was refused, without holding it.
#[derive(Clone, Debug)]
pub(super) struct LoginWatch {
    settings: Option<SourceSettings>,
    state: RandomState,
    refused: Option<u64>,
}

impl LoginWatch {
    /// Watches the login that `settings` name, or that stands at their name in `roots`; none where nobody logs in.
    pub(super) fn of(settings: &SourceSettings, roots: &MediaRoots) -> Option<Self> {
        let settings = match &settings.credentials {
            Some(name) => find(name, roots).ok().map(source_of),
            None => Some(settings.user.as_ref().map(|_user| settings.clone())?),
        };
        Some(Self { settings, state: RandomState::new(), refused: None })
    }

    /// Remembers the login as it is now, before it is tried.
    pub(super) fn remember(&mut self) {
        self.refused = self.digest();
    }

    /// Returns whether the login is another than was remembered.
    pub(super) fn has_changed(&self) -> bool {
        self.digest() != self.refused
    }

    /// A number that stands for the login; none where it cannot be read.
    fn digest(&self) -> Option<u64> {
        let credentials = Credentials::read(self.settings.as_ref()?).ok()??;
        Some(self.state.hash_one((&credentials.user, &credentials.password.0)))
    }
}

fn find<'a>(name: &str, roots: &'a MediaRoots) -> Result<&'a CredentialsSettings, CameraError> {
    roots.credentials().iter().find(|known| known.id == name).ok_or_else(|| missing(name, roots))
}

fn missing(name: &str, roots: &MediaRoots) -> CameraError {
    let known: Vec<&str> = roots.credentials().iter().map(|known| known.id.as_str()).collect();
    let known =
        if known.is_empty() { "it has none".to_owned() } else { format!("it has {}", known.join(", ")) };
    CameraError::NoCredentials { name: name.to_owned(), known }
}

/// A source with that login of its own.
fn source_of(named: &CredentialsSettings) -> SourceSettings {
    SourceSettings {
        user: Some(named.user.clone()),
        password_file: named.password_file.clone(),
        password_env: named.password_env.clone(),
        ..SourceSettings::default()
    }
}

fn first_line(path: &Path) -> io::Result<String> {
    // Asked before opening, because opening a pipe would wait for its other end.
    if !std::fs::metadata(path)?.is_file() {
        return Err(io::Error::other("it is no regular file"));
    }
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(MAX_FILE_BYTES).read_to_end(&mut bytes)?;
    let line = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    match std::str::from_utf8(line) {
        Ok("") => Err(io::Error::other("its first line is empty")),
        Ok(line) => Ok(line.to_owned()),
        Err(_) => Err(io::Error::other("it is no UTF-8")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_line_of_a_file_is_the_password_and_is_not_shown() {
        let folder = tempfile::tempdir().unwrap();
        let read = |bytes: &[u8]| {
            let path = folder.path().join("password");
            std::fs::write(&path, bytes).unwrap();
            let (user, password_file) = (Some("guard".to_owned()), Some(path));
            Credentials::read(&SourceSettings { user, password_file, ..SourceSettings::default() })
        };
        for bytes in [&b"s3cret\n"[..], b"s3cret", b"s3cret\r\nmore"] {
            let found = read(bytes).unwrap().unwrap();
            assert_eq!((found.login().user, found.login().password), ("guard", "s3cret"));
            assert!(!format!("{found:?}").contains("s3cret"));
        }
        for bytes in [&b""[..], b"\ns3cret", b"s3cret\xff"] {
            let error = read(bytes).unwrap_err();
            assert!(error.to_string().contains("cannot read the password"), "{error}");
            assert!(!format!("{error} {error:?}").contains("s3cret"));
        }
    }

    #[test]
    fn what_is_not_there_is_named() {
        let of = |file: Option<&str>, name: Option<&str>| {
            Credentials::read(&SourceSettings {
                user: Some("guard".to_owned()),
                password_file: file.map(Into::into),
                password_env: name.map(str::to_owned),
                ..SourceSettings::default()
            })
        };
        assert!(of(Some("/no/such/file"), None).unwrap_err().to_string().contains("/no/such/file"));
        assert!(of(Some("/dev/null"), None).unwrap_err().to_string().contains("no regular file"));
        let error = of(None, Some("VIDEOFIELDS_NO_SUCH_PASSWORD")).unwrap_err();
        assert!(error.to_string().contains("VIDEOFIELDS_NO_SUCH_PASSWORD"), "{error}");
        let cargo = of(None, Some("CARGO_PKG_NAME")).unwrap().unwrap();
        assert_eq!(cargo.login().password, "videofields-recording");
        assert_eq!(Credentials::read(&SourceSettings::default()).unwrap(), None);
    }
}
