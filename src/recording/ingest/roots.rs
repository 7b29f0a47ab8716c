//! The folders beneath which sources may open files, and the one place where they open them; beside them the networks in
//! which cameras may be reached, which `endpoint` holds addresses against.
//!
//! A path is refused if it is a URL, has a `..`, or leads out of the roots once symbolic links are resolved. What
//! is handed out is the open file, checked again after it was opened, so that a link swapped in between gains
//! nothing. Messages name the path as asked for and the roots as configured, never what lies outside them. What the daemon keeps for
//! itself is not opened, even beneath a root.

use super::IngestError;
use crate::media::descriptor_path;
use std::fs::{self, File};
use std::io;
use std::path::{Component, Path, PathBuf};
use videofields_vision::config::{CredentialsSettings, MediaSettings, Network, Settings};
use videofields_vision::private_files::PrivateFiles;

/// Folders beneath which files may be opened, networks in which cameras may be reached, and logins that cameras may name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MediaRoots {
    configured: Vec<PathBuf>,
    resolved: Vec<PathBuf>,
    networks: Vec<Network>,
    credentials: Vec<CredentialsSettings>,
    private: PrivateFiles,
}

impl MediaRoots {
    /// Takes existing folders as roots; symbolic links in them are resolved now.
    ///
    /// # Errors
    /// When a root does not exist, cannot be read, or is no folder.
    pub fn new(roots: &[PathBuf]) -> Result<Self, IngestError> {
        let resolve = |root: &PathBuf| {
            let as_error = |source| IngestError::Root { path: root.clone(), source };
            let resolved = fs::canonicalize(root).map_err(as_error)?;
            if !fs::metadata(&resolved).map_err(as_error)?.is_dir() {
                return Err(as_error(io::Error::from(io::ErrorKind::NotADirectory)));
            }
            Ok(resolved)
        };
        let resolved = roots.iter().map(resolve).collect::<Result<_, _>>()?;
        Ok(Self {
            configured: roots.to_vec(),
            resolved,
            networks: MediaSettings::default().networks,
            credentials: Vec::new(),
            private: PrivateFiles::default(),
        })
    }

    /// As [`Self::new`], leaving out roots that cannot be used (and logging them): what lies beneath the others can be
    /// opened all the same. One that comes back later counts again after a restart.
    #[must_use]
    pub fn usable(roots: &[PathBuf]) -> Self {
        let mut resolved = Vec::new();
        for root in roots {
            match Self::new(std::slice::from_ref(root)) {
                Ok(usable) => resolved.extend(usable.resolved),
                Err(IngestError::Root { path, source }) if source.kind() == io::ErrorKind::NotFound => {
                    tracing::warn!(path = %path.display(), "a media root is not there and left out");
                }
                Err(error) => tracing::error!(%error, "a media root is left out"),
            }
        }
        Self {
            configured: roots.to_vec(),
            resolved,
            networks: MediaSettings::default().networks,
            credentials: Vec::new(),
            private: PrivateFiles::default(),
        }
    }

    /// Returns the roots, networks and logins of `settings`, without roots that cannot be used, and without what the daemon keeps for
    /// itself.
    #[must_use]
    pub fn of_settings(settings: &Settings) -> Self {
        Self::usable(&settings.media.roots)
            .with_networks(&settings.media.networks)
            .with_credentials(&settings.credentials)
            .with_private(settings.private_files())
    }

    /// Returns the same roots, with these files as those that are never opened.
    #[must_use]
    pub fn with_private(self, private: PrivateFiles) -> Self {
        Self { private, ..self }
    }

    /// The same, with these networks as the ones in which cameras may be reached, instead of private, loopback and
    /// link-local ones.
    #[must_use]
    pub fn with_networks(self, networks: &[Network]) -> Self {
        Self { networks: networks.to_vec(), ..self }
    }

    /// Returns the same roots, with these logins as those that cameras may name.
    #[must_use]
    pub fn with_credentials(self, credentials: &[CredentialsSettings]) -> Self {
        Self { credentials: credentials.to_vec(), ..self }
    }

    /// The same with one more folder.
    ///
    /// # Errors
    /// When that folder does not exist, cannot be read, or is none.
    pub fn with_folder(mut self, folder: &Path) -> Result<Self, IngestError> {
        let more = Self::new(&[folder.to_path_buf()])?;
        self.configured.extend(more.configured);
        self.resolved.extend(more.resolved);
        Ok(self)
    }

    /// The folders as they are configured that can be used, each with no link left in it.
    pub(super) fn folders(&self) -> impl Iterator<Item = &Path> {
        let is_usable = |root: &&PathBuf| fs::canonicalize(root).is_ok_and(|root| self.contains(&root));
        self.configured.iter().filter(is_usable).map(PathBuf::as_path)
    }

    /// Networks in which cameras may be reached.
    #[must_use]
    pub fn networks(&self) -> &[Network] {
        &self.networks
    }

    /// Returns the logins that cameras may name.
    #[must_use]
    pub fn credentials(&self) -> &[CredentialsSettings] {
        &self.credentials
    }

    /// Returns as a root what a command's caller names by `path`, wherever symbolic links lead: whoever gives the command may read the
    /// file anyway.
    ///
    /// # Errors
    /// When the folder that `path` lies in does not exist or cannot be read.
    pub fn of_caller(path: &Path) -> Result<Self, IngestError> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let roots = Self::new(&[folder.unwrap_or_else(|| Path::new(".")).to_path_buf()])?;
        Ok(Self { resolved: vec![PathBuf::from("/")], ..roots })
    }

    /// Resolves a folder that must lie in the roots.
    ///
    /// # Errors
    /// When there is no such folder, or it lies outside the roots.
    pub fn resolve_folder(&self, path: &Path) -> Result<PathBuf, IngestError> {
        self.resolve(if path.as_os_str().is_empty() { Path::new(".") } else { path })
    }

    /// Opens the regular file at `path` for reading.
    pub(super) fn open(&self, path: &Path) -> Result<File, IngestError> {
        let resolved = self.resolve(path)?;
        let unreadable = |source| IngestError::Unreadable { path: path.to_path_buf(), source };
        // Asked before opening, because opening a pipe would wait for its other end.
        if !fs::metadata(&resolved).map_err(unreadable)?.is_file() {
            return Err(IngestError::NotAFile { path: path.to_path_buf() });
        }
        let file = File::open(&resolved).map_err(unreadable)?;
        if !file.metadata().map_err(unreadable)?.is_file() {
            return Err(IngestError::NotAFile { path: path.to_path_buf() });
        }
        let opened = fs::read_link(descriptor_path(&file)).map_err(unreadable)?;
        if !self.contains(&opened) {
            return Err(self.outside(path));
        }
        if self.private.holds(&file).map_err(unreadable)? {
            return Err(IngestError::Private { path: path.to_path_buf() });
        }
        Ok(file)
    }

    /// Returns true for a folder that the daemon keeps for itself, and for one that cannot be told from such.
    pub(super) fn is_private_folder(&self, folder: &Path) -> bool {
        self.private.holds_folder(folder).unwrap_or(true)
    }

    fn resolve(&self, path: &Path) -> Result<PathBuf, IngestError> {
        if let Some((scheme, _)) = path.to_string_lossy().split_once("://") {
            return Err(IngestError::Url { scheme: scheme.to_owned(), allowed: self.allowed() });
        }
        // What a root itself is called is its owner's business; the steps beneath it must go down.
        let beneath = self.configured.iter().find_map(|root| path.strip_prefix(root).ok()).unwrap_or(path);
        if beneath.components().any(|component| component == Component::ParentDir) {
            return Err(IngestError::ParentStep { path: path.to_path_buf(), allowed: self.allowed() });
        }
        match fs::canonicalize(path) {
            Ok(resolved) if self.contains(&resolved) => Ok(resolved),
            Ok(_) => Err(self.outside(path)),
            // Outside the roots a missing file looks like any other, so that nobody can feel about there.
            Err(_) if !self.deepest_existing(path).is_some_and(|folder| self.contains(&folder)) => {
                Err(self.outside(path))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                Err(IngestError::NotFound { path: path.to_path_buf() })
            }
            Err(source) => Err(IngestError::Unreadable { path: path.to_path_buf(), source }),
        }
    }

    fn deepest_existing(&self, path: &Path) -> Option<PathBuf> {
        path.ancestors().skip(1).find_map(|folder| {
            fs::canonicalize(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }).ok()
        })
    }

    fn contains(&self, resolved: &Path) -> bool {
        self.resolved.iter().any(|root| resolved.starts_with(root))
    }

    fn outside(&self, path: &Path) -> IngestError {
        IngestError::Outside { path: path.to_path_buf(), allowed: self.allowed() }
    }

    fn allowed(&self) -> String {
        if self.configured.is_empty() {
            return "no folder at all".to_owned();
        }
        self.configured.iter().map(|root| format!("{root:?}")).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::error::ErrorKind;

    fn plaza() -> (tempfile::TempDir, MediaRoots) {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("media");
        fs::create_dir_all(root.join("day")).unwrap();
        fs::write(root.join("day/a.avi"), b"a").unwrap();
        fs::write(folder.path().join("secret.avi"), b"s").unwrap();
        std::os::unix::fs::symlink(folder.path().join("secret.avi"), root.join("out.avi")).unwrap();
        std::os::unix::fs::symlink(root.join("day/a.avi"), root.join("in.avi")).unwrap();
        std::os::unix::fs::symlink(folder.path(), root.join("up")).unwrap();
        let roots = MediaRoots::new(&[root]).unwrap();
        (folder, roots)
    }

    #[test]
    fn only_regular_files_beneath_the_roots_open() {
        let (folder, roots) = plaza();
        let root = folder.path().join("media");
        for path in ["day/a.avi", "in.avi", "day/./a.avi"] {
            assert!(roots.open(&root.join(path)).is_ok(), "{path}");
        }
        let refuse = |path: &str, expected: ErrorKind, part: &str| {
            let error = roots.open(&root.join(path)).unwrap_err();
            assert_eq!(error.kind(), expected, "{path}: {error}");
            assert!(error.to_string().contains(part), "{path}: {error}");
            assert!(!error.to_string().contains("secret"), "{error}");
        };
        refuse("out.avi", ErrorKind::Invalid, "outside the media roots");
        refuse("up/other.avi", ErrorKind::Invalid, "outside the media roots");
        refuse("up/nowhere/other.avi", ErrorKind::Invalid, "outside the media roots");
        refuse("day/../day/a.avi", ErrorKind::Invalid, "`..`");
        refuse("day", ErrorKind::Invalid, "no regular file");
        refuse("day/b.avi", ErrorKind::NotFound, "there is no file");
        refuse("day/a.avi/b.avi", ErrorKind::Unavailable, "cannot read");
    }

    #[test]
    fn what_lies_elsewhere_is_refused_alike_whether_it_is_there_or_not() {
        let (folder, roots) = plaza();
        for path in ["/etc/passwd", "/no/such/file", "/dev/zero", "/proc/self/environ", "relative.avi"] {
            let error = roots.open(Path::new(path)).unwrap_err();
            assert!(matches!(error, IngestError::Outside { .. }), "{path}: {error}");
            assert!(error.to_string().contains(&format!("{:?}", folder.path().join("media"))), "{error}");
        }
        for path in ["http://169.254.169.254/a", "file:///etc/passwd", "rtsp://user:word@host/a"] {
            let error = roots.open(Path::new(path)).unwrap_err();
            assert!(matches!(error, IngestError::Url { .. }), "{path}: {error}");
            assert!(!error.to_string().contains("word"), "{error}");
        }
        assert!(roots.open(Path::new("")).is_err());
        assert!(roots.open(Path::new("a\0b")).is_err());
        assert!(MediaRoots::new(&[]).unwrap().open(Path::new("/etc/passwd")).is_err());
    }

    #[test]
    fn links_that_a_command_s_caller_names_are_followed() {
        let (folder, roots) = plaza();
        let link = folder.path().join("media/out.avi");
        assert!(matches!(roots.open(&link), Err(IngestError::Outside { .. })));
        let named = MediaRoots::of_caller(&link).unwrap();
        assert!(named.open(&link).is_ok());
        assert!(
            named.open(&folder.path().join("media/up/secret.avi")).is_ok(),
            "so are pictures of a pattern"
        );
        let steps = folder.path().join("media/day/../out.avi");
        assert!(MediaRoots::of_caller(&steps).unwrap().open(&steps).is_ok());
        let absent = folder.path().join("media/absent.avi");
        assert!(matches!(
            MediaRoots::of_caller(&absent).unwrap().open(&absent),
            Err(IngestError::NotFound { .. })
        ));
        assert!(matches!(named.open(Path::new("/dev/zero")), Err(IngestError::NotAFile { .. })));
    }

    #[test]
    fn what_the_daemon_keeps_is_not_opened_beneath_a_root_either() {
        let (folder, roots) = plaza();
        let at = |path: &str| folder.path().join("media").join(path);
        fs::create_dir_all(at("archive/north/2026-11-29")).unwrap();
        fs::write(at("archive/north/2026-11-29/1.mkv"), b"1").unwrap();
        fs::write(at("db.sqlite"), b"d").unwrap();
        std::os::unix::fs::symlink(at("archive/north/2026-11-29/1.mkv"), at("day/b.mkv")).unwrap();
        let private = PrivateFiles::new(vec![at("archive")], Some(at("db.sqlite")));
        let roots = roots.with_private(private).with_folder(&at("day")).unwrap();
        for path in ["archive/north/2026-11-29/1.mkv", "day/b.mkv", "db.sqlite"] {
            let error = roots.open(&at(path)).unwrap_err();
            assert!(matches!(error, IngestError::Private { .. }), "{path}: {error}");
            assert_eq!(error.kind(), ErrorKind::Invalid);
        }
        assert!(roots.open(&at("day/a.avi")).is_ok());
    }

    #[test]
    fn roots_that_are_no_folders_are_refused() {
        let (folder, _) = plaza();
        for path in ["secret.avi", "nowhere"] {
            let error = MediaRoots::new(&[folder.path().join(path)]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Invalid);
            assert!(error.to_string().contains(path), "{error}");
        }
        let relative = folder.path().join("media/../media/day");
        let roots = MediaRoots::new(std::slice::from_ref(&relative)).unwrap();
        assert!(roots.open(&relative.join("a.avi")).is_ok());
        assert!(matches!(roots.open(&relative.join("../day/a.avi")), Err(IngestError::ParentStep { .. })));
        let beside = MediaRoots::of_caller(&folder.path().join("secret.avi")).unwrap();
        assert!(beside.open(&folder.path().join("secret.avi")).is_ok());
        assert!(MediaRoots::of_caller(Path::new("secret.avi")).is_ok());
    }
}
