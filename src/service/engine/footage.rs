//! Identity of what feeds cameras: two cameras that are fed by the same file, stream or device show the same place, and what is hidden of
//! one is hidden of both.

use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use videofields_vision::config::{Place, SourceSettings};

/// Links that are followed to a file that is not there.
const MAX_LINKS: usize = 40;

/// Identity of a file, stream or device.
#[derive(Clone, Debug)]
pub(super) enum Footage {
    /// A file, numbered pictures or a device: where it lies once links are followed, and which file lies there. A file that is put in
    /// its place is the same by the one, and one that has another name by the other.
    File { place: PathBuf, node: Option<Node> },
    /// A stream by its host, port, path and query, however it is spoken to.
    Stream { host: String, port: u16, path_and_query: String },
}

/// Identity of a file on its disk. A number is given again, but not with the time at which the file was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Node {
    device: u64,
    inode: u64,
    made_at: Option<SystemTime>,
}

impl Footage {
    /// Returns the identity of what `source` names by now; none where it names nothing.
    pub(super) fn of(source: &SourceSettings) -> Option<Self> {
        match source.place()? {
            Place::Path(path) | Place::Device(path) => Some(Self::of_path(path)),
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

    fn of_path(path: &Path) -> Self {
        let node = std::fs::metadata(path).ok().map(|metadata| Node {
            device: metadata.dev(),
            inode: metadata.ino(),
            made_at: metadata.created().ok(),
        });
        Self::File { place: resolved(path), node }
    }

    /// Returns true where both show the same.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::File { place, node }, Self::File { place: other_place, node: other_node }) => {
                place == other_place || node.is_some() && node == other_node
            }
            (
                Self::Stream { host, port, path_and_query },
                Self::Stream { host: other_host, port: other_port, path_and_query: other_path },
            ) => (host, port, path_and_query) == (other_host, other_port, other_path),
            _ => false,
        }
    }
}

/// Returns where `path` leads once links are followed, whether or not there is anything.
fn resolved(path: &Path) -> PathBuf {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        if let Ok(place) = path.canonicalize() {
            return place;
        }
        let folder = path.parent().unwrap_or(Path::new("/")).to_owned();
        let folder = folder.canonicalize().unwrap_or(folder);
        let Some(name) = path.file_name() else { return path };
        let place = folder.join(name);
        match place.read_link() {
            Ok(next) => path = folder.join(next),
            Err(_no_link) => return place,
        }
    }
    path
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
            assert!(of(same).is_same(&of("a.mp4")), "{same}");
        }
        assert!(!of("b.mp4").is_same(&of("a.mp4")));
        assert!(of("again/in%06d.jpg").is_same(&of("in%06d.jpg")));
        assert!(!of("in%06d.jpg").is_same(&of("out%06d.jpg")));
    }

    #[test]
    fn a_file_that_comes_or_is_put_in_the_place_of_another_is_the_same_there() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let of = |name: &str| Footage::of(&SourceSettings::of_path(at(name))).unwrap();
        std::os::unix::fs::symlink("later.mp4", at("link.mp4")).unwrap();
        std::os::unix::fs::symlink("link.mp4", at("links.mp4")).unwrap();
        std::os::unix::fs::symlink("loop.mp4", at("loop.mp4")).unwrap();
        let absent = of("later.mp4");
        assert!(of("links.mp4").is_same(&absent) && !of("loop.mp4").is_same(&absent));
        std::fs::write(at("later.mp4"), b"a").unwrap();
        let first = of("links.mp4");
        assert!(first.is_same(&absent));
        std::fs::rename(at("later.mp4"), at("moved.mp4")).unwrap();
        std::fs::write(at("later.mp4"), b"b").unwrap();
        let second = of("link.mp4");
        assert!(second.is_same(&first) && second.is_same(&absent));
        assert!(of("moved.mp4").is_same(&first) && !of("moved.mp4").is_same(&second));
        assert!(!of("moved.mp4").is_same(&absent));
    }

    #[test]
    fn streams_are_told_by_host_port_and_path() {
        let one = of_url("rtsp://Yard.example/live?channel=1").unwrap();
        let is_one = |url: &str| of_url(url).unwrap().is_same(&one);
        assert!(is_one("rtsp://yard.example:554/live?channel=1"));
        for other in [
            "rtsp://yard.example/live?channel=2",
            "rtsp://yard.example:555/live?channel=1",
            "rtsp://gate.example/live?channel=1",
        ] {
            assert!(!is_one(other), "{other}");
        }
        assert!(Footage::of(&SourceSettings::default()).is_none());
    }
}
