//! What lies beneath the media roots that could feed a camera: videos by their endings, numbered pictures as one pattern.
//!
//! Symbolic links are not followed, so nothing is met twice and nothing outside; what begins with a dot is left out. A walk has
//! its bounds, and says where it met them.

use super::pattern::Pattern;
use super::{IngestError, MediaRoots, StopFlag};
use std::collections::BTreeMap;
use std::fs::{self, Metadata};
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;
use videofields_vision::clock::Timestamp;

/// Most files and patterns that are told.
const MAX_FOUND: usize = 2000;

/// Most names that are looked at: pictures are many, and one pattern.
const MAX_NAMES: usize = 200_000;

/// Most folders within one another, beneath where the walk begins.
const MAX_DEPTH: usize = 6;

/// Endings of videos that `GStreamer` has demuxers for.
const VIDEOS: [&str; 21] = [
    "3gp", "asf", "avi", "flv", "h264", "h265", "m2ts", "m4v", "mjpeg", "mjpg", "mkv", "mov", "mp4", "mpeg",
    "mpg", "mts", "mxf", "ogv", "ts", "webm", "wmv",
];

const PICTURES: [&str; 3] = ["jpeg", "jpg", "png"];

/// A file that could feed a camera, or a pattern of numbered pictures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundFile {
    /// Where it lies, beneath a media root as that is configured.
    pub path: PathBuf,
    /// How many bytes it has, all pictures together.
    pub bytes: u64,
    /// When it was last written, the newest of all pictures.
    pub modified_at: Timestamp,
    /// How many pictures a pattern has; none for a video.
    pub count: Option<u64>,
}

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FoundFiles {
    /// By their paths.
    pub files: Vec<FoundFile>,
    /// Whether there may be more.
    pub is_cut: bool,
}

/// Videos and numbered pictures beneath the folder `under`, or beneath all media roots where none is named. Ends early once
/// `stop` is raised.
///
/// # Errors
/// When `under` lies outside the media roots, does not exist or is no folder.
pub fn browse(roots: &MediaRoots, under: Option<&Path>, stop: &StopFlag) -> Result<FoundFiles, IngestError> {
    let mut walk = Walk { found: FoundFiles::default(), n_names: 0, roots, stop };
    match under {
        Some(folder) => {
            let resolved = roots.resolve_folder(folder)?;
            if !resolved.is_dir() {
                return Err(IngestError::NotAFolder { path: folder.to_path_buf() });
            }
            walk.enter(&resolved, folder, 0);
        }
        // One that cannot be used now has nothing beneath it.
        None => roots.folders().for_each(|root| walk.enter(root, root, 0)),
    }
    let mut found = walk.found;
    found.files.sort_by(|a, b| a.path.cmp(&b.path));
    found.files.dedup_by(|a, b| a.path == b.path);
    Ok(found)
}

/// V4L2 devices of this machine that give pictures.
#[must_use]
pub fn devices() -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir("/dev") else { return Vec::new() };
    let mut found: Vec<(u32, PathBuf)> = entries
        .filter_map(Result::ok)
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_char_device()))
        .filter_map(|entry| {
            let name = entry.file_name();
            let number = name.to_str()?.strip_prefix("video")?.parse().ok()?;
            // Of the devices of one camera the first has its pictures, the others what it says of them.
            let index = fs::read_to_string(format!("/sys/class/video4linux/video{number}/index"));
            let is_first = index.map_or(true, |index| index.trim() == "0");
            is_first.then(|| (number, entry.path()))
        })
        .collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}

struct Walk<'a> {
    found: FoundFiles,
    n_names: usize,
    roots: &'a MediaRoots,
    stop: &'a StopFlag,
}

impl Walk<'_> {
    /// Looks at a folder, which is told as `shown`.
    fn enter(&mut self, folder: &Path, shown: &Path, depth: usize) {
        if self.roots.is_private_folder(folder) {
            return;
        }
        // What may not be read has nothing for the daemon.
        let Ok(entries) = fs::read_dir(folder) else { return };
        let (mut pictures, mut folders) = (BTreeMap::<Stem, Vec<String>>::new(), Vec::new());
        for entry in entries.filter_map(Result::ok) {
            if self.is_full() {
                self.found.is_cut = true;
                break;
            }
            self.n_names += 1;
            let (Ok(kind), Ok(name)) = (entry.file_type(), entry.file_name().into_string()) else { continue };
            if name.starts_with('.') {
                continue;
            }
            if kind.is_dir() {
                folders.push(name);
            } else if kind.is_file() && has_ending(&name, &VIDEOS) {
                self.found.files.extend(entry.metadata().ok().map(|of| told(shown.join(&name), &of)));
            } else if kind.is_file()
                && has_ending(&name, &PICTURES)
                && let Some((stem, _)) = Stem::of(&name)
            {
                pictures.entry(stem).or_default().push(name);
            }
        }
        for (stem, names) in pictures {
            self.found.files.extend(stem.found(folder, shown, &names));
        }
        folders.sort_unstable();
        for name in folders {
            if depth + 1 > MAX_DEPTH || self.is_full() {
                self.found.is_cut = true;
                return;
            }
            self.enter(&folder.join(&name), &shown.join(&name), depth + 1);
        }
    }

    fn is_full(&self) -> bool {
        self.found.files.len() >= MAX_FOUND || self.n_names >= MAX_NAMES || self.stop.is_raised()
    }
}

fn has_ending(name: &str, endings: &[&str]) -> bool {
    let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase());
    ending.is_some_and(|ending| endings.contains(&ending.as_str()))
}

fn told(path: PathBuf, metadata: &Metadata) -> FoundFile {
    FoundFile { path, bytes: metadata.len(), modified_at: modified_at(metadata), count: None }
}

fn modified_at(metadata: &Metadata) -> Timestamp {
    let since = metadata.modified().ok().and_then(|at| at.duration_since(UNIX_EPOCH).ok());
    let nanos = since.and_then(|since| i64::try_from(since.as_nanos()).ok());
    Timestamp::from_nanos(nanos.unwrap_or_default())
}

/// What stands before and behind the last number in pictures' names.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Stem {
    before: String,
    after: String,
}

impl Stem {
    /// A picture's stem and its number's digits; none where it has no number.
    fn of(name: &str) -> Option<(Self, &str)> {
        let dot = name.rfind('.')?;
        let end = name[..dot].rfind(|c: char| c.is_ascii_digit())? + 1;
        let start = name[..end]
            .rfind(|c: char| !c.is_ascii_digit())
            .map_or(0, |at| at + name[at..].chars().next().map_or(1, char::len_utf8));
        let stem = Self { before: name[..start].to_owned(), after: name[end..].to_owned() };
        Some((stem, &name[start..end]))
    }

    /// The pattern that reads these pictures; none where they are fewer than two.
    fn found(&self, folder: &Path, shown: &Path, names: &[String]) -> Option<FoundFile> {
        let digits = names.iter().filter_map(|name| Some(Self::of(name)?.1));
        let shortest = digits.clone().map(str::len).min()?;
        let is_padded = digits.clone().any(|digits| digits.len() > 1 && digits.starts_with('0'));
        let number = if is_padded { format!("%0{shortest}d") } else { "%d".to_owned() };
        let escaped = |text: &str| text.replace('%', "%%");
        let name = format!("{}{number}{}", escaped(&self.before), escaped(&self.after));
        let pattern = Pattern::parse(&shown.join(&name)).ok()?;
        let (mut count, mut bytes, mut newest) = (0, 0, Timestamp::from_nanos(0));
        for name in names.iter().filter(|name| pattern.number(name).is_some()) {
            let Ok(metadata) = fs::symlink_metadata(folder.join(name)) else { continue };
            count += 1;
            bytes += metadata.len();
            newest = newest.max(modified_at(&metadata));
        }
        let path = shown.join(name);
        (count > 1).then_some(FoundFile { path, bytes, modified_at: newest, count: Some(count) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(files: &[&str]) -> (tempfile::TempDir, Vec<(String, Option<u64>)>) {
        let folder = tempfile::tempdir().unwrap();
        for file in files {
            let path = folder.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, b"abc").unwrap();
        }
        let roots = MediaRoots::new(&[folder.path().to_path_buf()]).unwrap();
        let found = browse(&roots, None, &StopFlag::default()).unwrap();
        let shown = |of: FoundFile| {
            let path = of.path.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned();
            assert_eq!(of.bytes, 3 * of.count.unwrap_or(1));
            (path, of.count)
        };
        let files = found.files.into_iter().map(shown).collect();
        (folder, files)
    }

    #[test]
    fn videos_and_patterns_are_found_and_nothing_else() {
        let (_folder, files) = found(&[
            "a.MP4",
            "day/b.avi",
            "day/notes.txt",
            ".hidden/c.mp4",
            "day/.d.mp4",
            "set/cam1_0001.jpg",
            "set/cam1_0002.jpg",
            "set/cam1_0002.png",
            "set/cam2_0001.jpg",
            "set/cam2_0003.jpg",
            "plain/in8.png",
            "plain/in9.png",
            "plain/in10.png",
            "odd/50%_01.jpg",
            "odd/50%_02.jpg",
            "odd/é1x.jpg",
            "odd/é2x.jpg",
            "odd/lone.jpg",
        ]);
        let expected = [
            ("a.MP4", None),
            ("day/b.avi", None),
            ("odd/50%%_%02d.jpg", Some(2)),
            ("odd/é%dx.jpg", Some(2)),
            ("plain/in%d.png", Some(3)),
            ("set/cam1_%04d.jpg", Some(2)),
            ("set/cam2_%04d.jpg", Some(2)),
        ];
        assert_eq!(files, expected.map(|(path, count)| (path.to_owned(), count)));
    }

    #[test]
    fn a_walk_stays_beneath_its_folder_and_within_its_bounds() {
        let (folder, _) = found(&["a/b.mp4", "a/1/2/3/4/5/6/deep.mp4", "c/d.mp4"]);
        let root = folder.path();
        let outside = tempfile::tempdir().unwrap();
        fs::write(outside.path().join("secret.mp4"), b"s").unwrap();
        std::os::unix::fs::symlink(outside.path(), root.join("a/link")).unwrap();
        std::os::unix::fs::symlink(root.join("c/d.mp4"), root.join("a/link.mp4")).unwrap();
        let roots = MediaRoots::new(&[root.to_path_buf()]).unwrap();
        let stop = StopFlag::default();
        let under = |path: &Path| browse(&roots, Some(path), &stop);
        let names = |found: &FoundFiles| found.files.iter().map(|of| of.path.clone()).collect::<Vec<_>>();
        let all = under(&root.join("a")).unwrap();
        assert_eq!(names(&all), [root.join("a/1/2/3/4/5/6/deep.mp4"), root.join("a/b.mp4")]);
        assert!(!all.is_cut);
        let whole = browse(&roots, None, &stop).unwrap();
        assert!(whole.is_cut && names(&whole).len() == 2, "{whole:?}");
        assert!(matches!(under(outside.path()), Err(IngestError::Outside { .. })));
        assert!(matches!(under(&root.join("a/link")), Err(IngestError::Outside { .. })));
        assert!(matches!(under(&root.join("a/b.mp4")), Err(IngestError::NotAFolder { .. })));
        assert!(matches!(under(&root.join("nowhere")), Err(IngestError::NotFound { .. })));
        assert!(matches!(under(&root.join("a/../c")), Err(IngestError::ParentStep { .. })));
        stop.raise();
        assert!(under(root).unwrap().is_cut);
    }
}
