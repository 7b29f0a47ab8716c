//! Calibrations of several pictures at once: one text in, the camera of every picture out.
//!
//! The second door of this room, [`import_set`], for data sets of one thing in many pictures. As at the first,
//! everything is converted into the project's conventions here and nothing is converted a second time. Knows no
//! files: what a picture's size is, where the text does not say, the caller finds out.
//!
//! | format | what | pictures are named by | pixel centres | sizes |
//! | --- | --- | --- | --- | --- |
//! | `middlebury` | `*_par.txt` of the multi-view stereo benchmark | the picture's file name | at integers | never said |
//! | `opencv` | what the first door takes as `opencv` | the camera's name, key or index | at integers | may be said |
//! | `kitti` | `calib.txt`, `calib_cam_to_cam.txt` | the key, as `P0` or `P_rect_00` | at integers | said as `S_rect_00` |
//! | COLMAP ([`import_colmap`], a door of its own: two files) | `cameras` and `images`, `.txt` or `.bin` | the picture's path | at +0.5 | said |
//! | `nerf` | `transforms.json` | `file_path` as written | at +0.5 | may be said |

mod colmap;
mod kitti;
mod middlebury;
mod nerf;
mod numbers;
mod opencv;

pub use colmap::import_colmap;

use super::{CalibrateError, ImportOptions, MAX_BYTES, agreed_size, without_byte_order_mark};
use crate::geometry::{Camera, Pose};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// Most pictures that a set may have; the benchmarks' largest have a few hundred.
pub const MAX_PICTURES: usize = 4096;

/// One picture of a set and the camera that took it.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureCamera {
    /// The picture's file name or the camera's name, as the text has it: not empty, once in a set, and otherwise
    /// anything, so it is no path to be opened.
    pub name: String,
    /// The camera.
    pub camera: Camera,
}

/// How a set is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetFormat {
    /// The multi-view stereo benchmark's `*_par.txt`.
    Middlebury,
    /// `OpenCV`'s names and conventions in YAML, XML or JSON, one camera or several.
    OpenCv,
    /// KITTI's projections of rectified cameras.
    Kitti,
    /// `transforms.json` of `NeRF`, instant-ngp and nerfstudio.
    Nerf,
}

impl SetFormat {
    /// Every format.
    pub const ALL: [Self; 4] = [Self::Middlebury, Self::OpenCv, Self::Kitti, Self::Nerf];

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Middlebury => "middlebury",
            Self::OpenCv => "opencv",
            Self::Kitti => "kitti",
            Self::Nerf => "nerf",
        }
    }

    /// The format that a text looks like; `None` when it looks like none.
    #[must_use]
    pub fn detect(text: &str) -> Option<Self> {
        let text = without_byte_order_mark(text).trim_start();
        match text.chars().next()? {
            '<' => text.contains("<opencv_storage").then_some(Self::OpenCv),
            '{' if text.contains("\"frames\"") || text.contains("\"transform_matrix\"") => Some(Self::Nerf),
            '{' | '[' | '%' => Some(Self::OpenCv),
            _ if middlebury::is_count(text) => Some(Self::Middlebury),
            _ if kitti::has_projection(text) => Some(Self::Kitti),
            _ => text.contains(": ").then_some(Self::OpenCv),
        }
    }
}

impl fmt::Display for SetFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for SetFormat {
    type Err = CalibrateError;

    fn from_str(name: &str) -> Result<Self, CalibrateError> {
        Self::ALL.into_iter().find(|format| format.name() == name).ok_or_else(unknown_format)
    }
}

fn unknown_format() -> CalibrateError {
    let names: Vec<_> = SetFormat::ALL.into_iter().map(SetFormat::name).collect();
    CalibrateError::invalid("format", format!("is none of {}", names.join(", ")))
}

/// Columns and rows of the picture of a name; `None` where there is no such picture.
pub type SizeOf<'a> = dyn Fn(&str) -> Option<[u32; 2]> + 'a;

/// What a set's text leaves open.
#[derive(Clone, Copy, Default)]
pub struct SetOptions<'a> {
    /// Columns and rows of every calibrated picture. A text that says otherwise is refused.
    pub image_size_px: Option<[u32; 2]>,
    /// Columns and rows of the picture of that name: asked for where neither the text nor `image_size_px` says.
    pub size_of: Option<&'a SizeOf<'a>>,
    /// Length of the text's unit in metres, 1e-9 to 1e9. Default: for `opencv` what the translation's name ends
    /// in (`_m`, `_cm`, `_mm`), else 1.
    pub metres_per_unit: Option<f64>,
}

impl SetOptions<'_> {
    fn metres(&self) -> f64 {
        self.metres_per_unit.unwrap_or(1.0)
    }

    /// The size of the picture of that name: what the text said, else what all are, else what the caller finds.
    fn size_px(&self, name: &str, said: Option<[u32; 2]>, place: &str) -> Result<(u32, u32), CalibrateError> {
        let found = || if said.is_none() { self.size_of.and_then(|size_of| size_of(name)) } else { None };
        let image_size_px = self.image_size_px.or_else(found);
        agreed_size(said, &ImportOptions { image_size_px, ..ImportOptions::default() }, place)
    }
}

/// A picture's camera and where in the text it is.
struct Found {
    place: String,
    name: String,
    camera: Camera,
}

/// The cameras of all pictures of a set, in the text's order (members of JSON by name); `format` is told from the
/// text where it is not named.
///
/// The world is the text's own in metres: its axes are kept, also where its up is not +z.
///
/// # Errors
/// When the text is too long, of another or no format, names no picture, one twice or more than
/// [`MAX_PICTURES`], a size is not to be had, or numbers are no camera; the fault says the line or JSON pointer.
pub fn import_set(
    text: &str,
    format: Option<SetFormat>,
    options: &SetOptions<'_>,
) -> Result<Vec<PictureCamera>, CalibrateError> {
    if text.len() > MAX_BYTES {
        return Err(CalibrateError::TooLong { length: text.len() });
    }
    if !(1e-9..=1e9).contains(&options.metres()) {
        return Err(CalibrateError::invalid("metres_per_unit", "must lie in 1e-9 to 1e9"));
    }
    let text = without_byte_order_mark(text);
    let found = match format.or_else(|| SetFormat::detect(text)).ok_or_else(unknown_format)? {
        SetFormat::Middlebury => middlebury::import(text, options)?,
        SetFormat::OpenCv => opencv::import(text, options)?,
        SetFormat::Kitti => kitti::import(text, options)?,
        SetFormat::Nerf => nerf::import(text, options)?,
    };
    refuse_doubles(&found)?;
    Ok(found.into_iter().map(|Found { name, camera, .. }| PictureCamera { name, camera }).collect())
}

fn refuse_doubles(found: &[Found]) -> Result<(), CalibrateError> {
    if found.len() > MAX_PICTURES {
        let message = format!("a set has at most {MAX_PICTURES} pictures, got {}", found.len());
        return Err(CalibrateError::invalid("", message));
    }
    let mut places = BTreeMap::new();
    for Found { place, name, .. } in found {
        if name.is_empty() {
            return Err(CalibrateError::invalid(place, "the picture's name must not be empty"));
        }
        if let Some(first) = places.insert(name, place) {
            let message = format!("the picture {:?} is at {first} already", shown(name));
            return Err(CalibrateError::invalid(place, message));
        }
    }
    Ok(())
}

/// The pose in the world of a camera for which p = `camera_from_world` X + `translation`.
fn pose_in_world(camera_from_world: DQuat, translation: DVec3) -> Pose {
    let world_from_local = camera_from_world.inverse();
    Pose { position_in_world: world_from_local * -translation, world_from_local }
}

/// As much of a word as an error message has room for.
fn shown(word: &str) -> String {
    word.chars().take(64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;
    use std::path::Path;

    /// A file of the real data beside the project; where it is not at hand, that is said.
    pub(super) fn real_text(path: &str) -> Option<String> {
        let full = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(path);
        let text = std::fs::read_to_string(full).ok();
        let is_required = std::env::var("VIDEOFIELDS_DATA").as_deref() == Ok("required");
        assert!(text.is_some() || !is_required, "no real data at ../shared/data/{path}");
        if text.is_none() {
            #[expect(clippy::print_stderr, reason = "a skipped test says so where a person looks")]
            {
                eprintln!("skipped: no real data at ../shared/data/{path}");
            }
        }
        text
    }

    /// Replaces `from` once, imports, and expects a fault there that says so.
    pub(super) fn check_fault(text: &str, format: SetFormat, [from, to]: [&str; 2], place: &str, says: &str) {
        assert!(text.contains(from), "{from}");
        let text = text.replacen(from, to, 1);
        let options = SetOptions { image_size_px: Some([640, 480]), ..SetOptions::default() };
        let error = import_set(&text, Some(format), &options).expect_err("a fault");
        let (CalibrateError::Invalid(fault) | CalibrateError::Unsupported(fault)) = &error else {
            panic!("{from} {to}: {error}");
        };
        assert_eq!(fault.place, place, "{from} {to}: {fault}");
        assert!(fault.message.contains(says), "{from} {to}: {fault}");
    }

    /// Every beginning of the text, read as every format, is a set or a fault, and never a panic.
    pub(super) fn check_beginnings(text: &str) {
        let options = SetOptions { image_size_px: Some([640, 480]), ..SetOptions::default() };
        for end in (0..=text.len()).filter(|end| text.is_char_boundary(*end)) {
            for format in SetFormat::ALL.into_iter().map(Some).chain([None]) {
                if let Ok(pictures) = import_set(&text[..end], format, &options) {
                    assert!(!pictures.is_empty(), "{format:?} {end}");
                }
            }
        }
    }

    #[test]
    fn formats_are_told_from_the_text() {
        let check = |text: &str, expected| assert_eq!(SetFormat::detect(text), expected, "{text}");
        check("\u{feff}16\r\na.png 1 0", Some(SetFormat::Middlebury));
        check("  2\na.png", Some(SetFormat::Middlebury));
        check("%YAML:1.0\n---\n", Some(SetFormat::OpenCv));
        check("<?xml version=\"1.0\"?>\n<opencv_storage></opencv_storage>", Some(SetFormat::OpenCv));
        check("{\"cam1\": {\"K\": []}}", Some(SetFormat::OpenCv));
        check("left:\n  K: [1]\n", Some(SetFormat::OpenCv));
        check("P0: 1 0 0 0", Some(SetFormat::Kitti));
        check("calib_time: 09-Jan-2012 13:57:47\nP_rect_00: 1", Some(SetFormat::Kitti));
        check("{\"camera_angle_x\": 0.7, \"frames\": []}", Some(SetFormat::Nerf));
        check("<html></html>", None);
        check("hello", None);
        check("", None);
        for format in SetFormat::ALL {
            assert_eq!(format.to_string().parse(), Ok(format));
        }
        let error = "colmap".parse::<SetFormat>().expect_err("no format");
        assert_eq!(error.to_string(), "format: is none of middlebury, opencv, kitti, nerf");
    }

    #[test]
    fn absurd_requests_are_refused() {
        for unit in [f64::NAN, 0.0, -1.0, 1e10] {
            let options = SetOptions { metres_per_unit: Some(unit), ..SetOptions::default() };
            let error = import_set("{}", Some(SetFormat::OpenCv), &options).expect_err("no unit");
            assert_eq!(error.kind(), ErrorKind::Invalid);
            assert!(error.to_string().starts_with("metres_per_unit: "), "{error}");
        }
        let long = " ".repeat(MAX_BYTES + 1);
        let error = import_set(&long, None, &SetOptions::default()).expect_err("too long");
        assert_eq!(error.kind(), ErrorKind::TooLarge);
        let error = import_set("", None, &SetOptions::default()).expect_err("nothing");
        assert_eq!(error, unknown_format());
    }

    #[test]
    fn the_text_says_the_size_before_the_options_and_those_before_the_caller() {
        let of_picture = |name: &str| (name == "a").then_some([30, 40]);
        let options = SetOptions { size_of: Some(&of_picture), ..SetOptions::default() };
        assert_eq!(options.size_px("a", None, ""), Ok((30, 40)));
        assert_eq!(options.size_px("a", Some([1, 2]), ""), Ok((1, 2)));
        assert!(options.size_px("b", None, "").is_err());
        let options = SetOptions { image_size_px: Some([5, 6]), ..options };
        assert_eq!(options.size_px("a", None, ""), Ok((5, 6)));
        assert_eq!(options.size_px("b", None, ""), Ok((5, 6)));
        assert!(options.size_px("a", Some([1, 2]), "").is_err());
    }
}
