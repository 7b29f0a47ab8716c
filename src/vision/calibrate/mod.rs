//! Calibrations in and out: the project's plain JSON, and importers of other people's formats.
//!
//! One door, [`import`]: text in, a [`Camera`] out, or an error that names the place in the text. Every importer
//! converts into the project's conventions (metres, pixel centres at +0.5, pose of the camera in the world) and
//! nothing is converted a second time. Knows no files, no network and no scene.
//!
//! Where there is no calibration yet, [`solve`] finds the camera from pairs of picture points and places, and [`turn`] how it is
//! turned from lines that are parallel to the world's axes.
//!
//! | format | what | pixel centres | lengths |
//! | --- | --- | --- | --- |
//! | `json` | [`CameraDocument`] | at +0.5 | metres |
//! | `opencv` | `FileStorage` YAML or XML, or JSON with the same names; one camera or several | at integers | see [`ImportOptions::metres_per_unit`] |
//! | `tsai` | PETS's XML | at integers | millimetres unless told otherwise |

mod correspondence;
#[cfg(any(test, feature = "fuzzing"))]
pub(crate) mod fuzzing;
mod json;
mod opencv;
mod picture_set;
mod tsai;
mod vanishing;
mod xml;

use crate::error::{ErrorKind, Fault};
use crate::geometry::{Camera, CameraError};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

pub use correspondence::{MAX_PAIRS, Miss, Pair, Solved, Unknowns, solve};
pub use json::{CameraDocument, DistortionDocument};
pub use picture_set::{
    MAX_PICTURES, PictureCamera, SetFormat, SetOptions, SizeOf, import_colmap, import_set,
};
pub use vanishing::{KnownView, MAX_LINES, Pencil, Turned, WorldAxis, turn};

/// Most bytes that a calibration may have: a thousand times what honest ones need.
pub const MAX_BYTES: usize = 4 * 1024 * 1024;

/// How a calibration is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Format {
    /// PETS's XML of Tsai's model.
    #[serde(rename = "tsai")]
    PetsXml,
    /// `OpenCV`'s names and conventions in YAML, XML or JSON.
    #[serde(rename = "opencv")]
    OpenCv,
    /// The project's own.
    #[serde(rename = "json")]
    Json,
}

impl Format {
    const ALL: [Self; 3] = [Self::PetsXml, Self::OpenCv, Self::Json];

    /// The name in configurations and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PetsXml => "tsai",
            Self::OpenCv => "opencv",
            Self::Json => "json",
        }
    }

    /// The format that a text looks like; `None` when it looks like none.
    #[must_use]
    pub fn detect(text: &str) -> Option<Self> {
        let text = without_byte_order_mark(text).trim_start();
        match text.chars().next()? {
            '<' if text.contains("<opencv_storage") => Some(Self::OpenCv),
            '<' if text.contains("<Intrinsic") && text.contains("<Extrinsic") => Some(Self::PetsXml),
            '<' => None,
            '{' if text.contains("\"world_from_camera\"") => Some(Self::Json),
            '{' | '[' | '%' => Some(Self::OpenCv),
            _ => text.contains(": ").then_some(Self::OpenCv),
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for Format {
    type Err = CalibrateError;

    fn from_str(name: &str) -> Result<Self, CalibrateError> {
        Self::ALL.into_iter().find(|format| format.name() == name).ok_or(CalibrateError::UnknownFormat)
    }
}

/// What a calibration's text leaves open.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Columns and rows of the calibrated picture, for formats that may not say (`opencv`). A text that says
    /// otherwise is refused.
    pub image_size_px: Option<[u32; 2]>,
    /// Which camera of a text that holds several; a text that holds none of that name is refused.
    pub camera: Option<String>,
    /// Length of the text's unit in metres, 1e-9 to 1e9. Default: 0.001 for `tsai`; for `opencv` what the
    /// translation's name ends in (`_m`, `_cm`, `_mm`), else 1; `json` is always in metres and takes none.
    pub metres_per_unit: Option<f64>,
}

/// A calibration in the project's conventions.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The camera.
    pub camera: Camera,
    /// Where the format's lens model had to be fitted by ours: the farthest that the fit misses in the picture,
    /// pixels. `None` where the models are the same.
    pub residual_px: Option<f64>,
}

/// Why a text is no calibration.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CalibrateError {
    /// More than [`MAX_BYTES`].
    #[error("a calibration has at most {MAX_BYTES} bytes, got {length}")]
    TooLong {
        /// How many bytes it has.
        length: usize,
    },
    /// Neither named nor to be told from the text.
    #[error("the format is none of tsai, opencv, json")]
    UnknownFormat,
    /// The text is not even of its format.
    #[error("line {line}, column {column}: {message}")]
    Syntax {
        /// Line, from 1.
        line: u64,
        /// Column, from 1.
        column: u64,
        /// What is wrong there.
        message: String,
    },
    /// A value is missing or wrong.
    #[error("{0}")]
    Invalid(Fault),
    /// A value is right, but not for this build.
    #[error("{0}")]
    Unsupported(Fault),
    /// The named camera is not in the text.
    #[error("no camera is named {name:?}, there are {known}")]
    NoSuchCamera {
        /// The name asked for.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// Several cameras, and none was named.
    #[error("several cameras, name one of {known}")]
    CameraNotNamed {
        /// The names that there are.
        known: String,
    },
}

impl CalibrateError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::TooLong { .. } => ErrorKind::TooLarge,
            Self::NoSuchCamera { .. } => ErrorKind::NotFound,
            Self::Unsupported(_) => ErrorKind::Unsupported,
            Self::UnknownFormat | Self::Syntax { .. } | Self::Invalid(_) | Self::CameraNotNamed { .. } => {
                ErrorKind::Invalid
            }
        }
    }

    fn invalid(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Invalid(Fault::new(place, message))
    }

    /// The camera model's refusal, in the words of the format's own element.
    fn no_camera(place: impl Into<String>, error: &CameraError) -> Self {
        Self::invalid(place, error.to_string())
    }
}

/// The camera that `text` describes; `format` is told from the text where it is not named.
///
/// # Errors
/// When the text is too long, of another or no format, names no such camera, or its numbers are no camera.
pub fn import(
    text: &str,
    format: Option<Format>,
    options: &ImportOptions,
) -> Result<Imported, CalibrateError> {
    if text.len() > MAX_BYTES {
        return Err(CalibrateError::TooLong { length: text.len() });
    }
    if let Some(unit) = options.metres_per_unit
        && !(1e-9..=1e9).contains(&unit)
    {
        return Err(CalibrateError::invalid("metres_per_unit", "must lie in 1e-9 to 1e9"));
    }
    let text = without_byte_order_mark(text);
    match format.or_else(|| Format::detect(text)).ok_or(CalibrateError::UnknownFormat)? {
        Format::PetsXml => tsai::import(text, options),
        Format::OpenCv => opencv::import(text, options),
        Format::Json => json::import(text, options),
    }
}

fn without_byte_order_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

/// The picture's size from the text and from the options, which must agree.
fn agreed_size(
    said: Option<[u32; 2]>,
    options: &ImportOptions,
    place: &str,
) -> Result<(u32, u32), CalibrateError> {
    match (said, options.image_size_px) {
        (Some(said), Some(asked)) if said != asked => Err(CalibrateError::invalid(
            place,
            format!(
                "the picture is {} x {} here, but {} x {} was asked for",
                said[0], said[1], asked[0], asked[1]
            ),
        )),
        (Some([width, height]), _) | (None, Some([width, height])) => Ok((width, height)),
        (None, None) => {
            Err(CalibrateError::invalid(place, "the picture's size is not said; give image_size_px"))
        }
    }
}

/// Names for an error message, cut where there are many.
fn list_names<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<_> = names.collect();
    let shown: Vec<_> = names.iter().take(16).map(|name| format!("{name:?}")).collect();
    let more = names.len() - shown.len();
    match (shown.len(), more) {
        (0, _) => "none".to_owned(),
        (_, 0) => shown.join(", "),
        _ => format!("{} and {more} more", shown.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_from_the_text() {
        let check = |text: &str, expected| assert_eq!(Format::detect(text), expected, "{text}");
        check("\u{feff}<?xml version=\"1.0\"?>\n<opencv_storage></opencv_storage>", Some(Format::OpenCv));
        check("<Camera><Intrinsic/><Extrinsic/></Camera>", Some(Format::PetsXml));
        check("%YAML:1.0\n---\n", Some(Format::OpenCv));
        check("{\"world_from_camera\": []}", Some(Format::Json));
        check("{\"K\": []}", Some(Format::OpenCv));
        check("image_width: 640\n", Some(Format::OpenCv));
        check("<html></html>", None);
        check("", None);
        check("hello", None);
        for format in Format::ALL {
            assert_eq!(format.to_string().parse(), Ok(format));
            assert_eq!(serde_json::to_string(&format).expect("a name"), format!("{:?}", format.name()));
        }
        assert_eq!("colmap".parse::<Format>(), Err(CalibrateError::UnknownFormat));
    }

    #[test]
    fn absurd_requests_are_refused() {
        let options = ImportOptions { metres_per_unit: Some(f64::NAN), ..ImportOptions::default() };
        let error = import("{}", Some(Format::OpenCv), &options).expect_err("no unit");
        assert_eq!(error.kind(), ErrorKind::Invalid);
        let long = " ".repeat(MAX_BYTES + 1);
        let error = import(&long, None, &ImportOptions::default()).expect_err("too long");
        assert_eq!(error.kind(), ErrorKind::TooLarge);
        let error = import("", None, &ImportOptions::default()).expect_err("nothing");
        assert_eq!(error, CalibrateError::UnknownFormat);
    }
}
