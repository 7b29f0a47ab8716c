//! Identity of what feeds cameras: two cameras that are fed by the same file, stream or device show the same place, and what is hidden of
//! one is hidden of both.

use std::ffi::OsString;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use videofields_vision::config::{Place, SourceSettings};

/// Identity of a file, stream or device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Footage {
    /// A file or device by its device and inode.
    File { device: u64, inode: u64 },
    /// Numbered pictures by their folder and the pattern of their names; a file that is not there by its folder and name.
    Pictures { folder: PathBuf, name: OsString },
    /// A stream by its host, port, path and query, however it is spoken to.
    Stream { host: String, port: u16, path_and_query: String },
}

impl Footage {
    /// Returns the identity of what `source` names; none where it names nothing.
    pub(super) fn of(source: &SourceSettings) -> Option<Self> {
        match source.place()? {
            Place::Path(path) | Place::Device(path) => Self::of_path(path),
            Place::Url(url) => {
                let parts = url.parse().ok()?;
                Some(Self::Stream {
                    host: parts.host.to_string().to_ascii_lowercase(),
                    port: parts.port,
                    path_and_query: parts.path_and_query,
                })
            }
        }
    }

    fn of_path(path: &Path) -> Option<Self> {
        if let Ok(metadata) = std::fs::metadata(path) {
            return Some(Self::File { device: metadata.dev(), inode: metadata.ino() });
        }
        let folder = path.parent()?;
        let folder = folder.canonicalize().unwrap_or_else(|_missing| folder.to_owned());
        Some(Self::Pictures { folder, name: path.file_name()?.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::config::CameraUrl;

    fn of_url(url: &str) -> Option<Footage> {
        Footage::of(&SourceSettings { url: Some(CameraUrl::new(url)), ..SourceSettings::default() })
    }

    #[test]
    fn links_and_names_lead_to_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.mp4"), b"a").unwrap();
        std::fs::write(at("b.mp4"), b"a").unwrap();
        std::os::unix::fs::symlink(at("a.mp4"), at("link.mp4")).unwrap();
        std::fs::hard_link(at("a.mp4"), at("name.mp4")).unwrap();
        std::os::unix::fs::symlink(folder.path(), at("again")).unwrap();
        let of = |name: &str| Footage::of(&SourceSettings::of_path(at(name))).unwrap();
        for same in ["link.mp4", "name.mp4", "again/a.mp4", "./a.mp4"] {
            assert_eq!(of(same), of("a.mp4"), "{same}");
        }
        assert_ne!(of("b.mp4"), of("a.mp4"));
        assert_eq!(of("again/in%06d.jpg"), of("in%06d.jpg"));
        assert_ne!(of("in%06d.jpg"), of("out%06d.jpg"));
    }

    #[test]
    fn streams_are_told_by_host_port_and_path() {
        let one = of_url("rtsp://Yard.example/live?channel=1");
        assert!(one.is_some());
        assert_eq!(of_url("rtsp://yard.example:554/live?channel=1"), one);
        for other in [
            "rtsp://yard.example/live?channel=2",
            "rtsp://yard.example:555/live?channel=1",
            "rtsp://gate.example/live?channel=1",
        ] {
            assert_ne!(of_url(other), one, "{other}");
        }
        assert_eq!(Footage::of(&SourceSettings::default()), None);
    }
}
