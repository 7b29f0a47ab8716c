//! Truth on disk: what every pixel of every frame shows, in formats that other tools read.
//!
//! A [`Truth`] and the picture that a camera's sensor gave go in; PNG files and JSON lines come out, one folder a
//! camera or view, and a manifest that says what each of them means. Knows nothing of how pictures are made.

mod labels;
mod manifest;
mod positions;

pub use labels::{MOVING, OUTSIDE, SHADOW, STATIC, UNKNOWN, labels};
pub(super) use manifest::{Manifest, ManifestCamera, write_manifest};
pub(super) use positions::{visible, write_positions};

use super::SimulateError;
use super::cast::{Truth, center_ray};
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::geometry::Camera;

/// Who a folder of truth is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Of {
    /// A camera without effects of its sensor: its frames are clean.
    Camera,
    /// A camera with such effects.
    CameraWithSensor,
    /// A view where no camera stands.
    View,
}

impl Of {
    /// The folders of frames' pictures.
    const fn kinds(self) -> &'static [&'static str] {
        match self {
            Self::Camera => &["frame", "instance", "label", "shadow", "depth", "normal"],
            Self::CameraWithSensor => &["frame", "clean", "instance", "label", "shadow", "depth", "normal"],
            Self::View => &["frame", "instance", "label", "shadow", "depth", "normal", "seen", "static"],
        }
    }
}

/// Writes the truth of one camera or view.
pub(super) struct TruthFolder {
    pub(super) folder: PathBuf,
    is_lit: Vec<bool>,
}

impl TruthFolder {
    /// Makes the folders and writes the still world.
    pub(super) fn create(
        folder: PathBuf,
        camera: &Camera,
        background: &RgbImage,
        of: Of,
    ) -> Result<Self, SimulateError> {
        for kind in of.kinds() {
            make_folder(&folder.join(kind))?;
        }
        save_rgb(&folder.join("background.png"), background)?;
        let (width, height) = camera.size_px();
        let (width, height) = (width as usize, height as usize);
        let is_lit = |i| center_ray(camera, i % width, i / width).is_some();
        let is_lit = (0..width * height).into_par_iter().map(is_lit).collect();
        Ok(Self { folder, is_lit })
    }

    /// Where the picture of this kind of this frame lies.
    pub(super) fn path(&self, kind: &str, frame: u64) -> PathBuf {
        self.folder.join(kind).join(format!("{frame:06}.png"))
    }

    /// Writes one frame: what the camera gave, if that is not the clean picture, and all that is known about it.
    pub(super) fn frame(
        &self,
        frame: u64,
        truth: &Truth,
        from_sensor: Option<&RgbImage>,
    ) -> Result<(), SimulateError> {
        let size = (truth.rgb.width, truth.rgb.height);
        let save_clean = || match from_sensor {
            Some(picture) => {
                save_rgb(&self.path("frame", frame), picture)?;
                save_rgb(&self.path("clean", frame), &truth.rgb)
            }
            None => save_rgb(&self.path("frame", frame), &truth.rgb),
        };
        let save_masks = || {
            save_mask(&self.path("instance", frame), &truth.instance)?;
            save_mask(&self.path("label", frame), &self.labels(truth))?;
            truth.shadow.as_ref().map_or(Ok(()), |shadow| save_mask(&self.path("shadow", frame), shadow))
        };
        let save_geometry = || {
            save_u16(
                &self.path("depth", frame),
                &depth_mm(&truth.depth_m),
                size,
                image::ExtendedColorType::L16,
            )?;
            let Some(normals) = &truth.normals else { return Ok(()) };
            let codes: Vec<u16> = normals.iter().flat_map(normal_code).collect();
            save_u16(&self.path("normal", frame), &codes, size, image::ExtendedColorType::Rgb16)
        };
        let (clean, (masks, geometry)) = rayon::join(save_clean, || rayon::join(save_masks, save_geometry));
        clean.and(masks).and(geometry)
    }

    /// The labels of one frame.
    fn labels(&self, truth: &Truth) -> Mask {
        let is_partly_moving = |i: usize| truth.partial.as_ref().is_some_and(|partial| partial.data[i] > 0);
        labels(&truth.instance, truth.shadow.as_ref(), is_partly_moving, |i| self.is_lit[i])
    }

    /// Writes a mask of one frame.
    pub(super) fn mask(&self, kind: &str, frame: u64, mask: &Mask) -> Result<(), SimulateError> {
        save_mask(&self.path(kind, frame), mask)
    }
}

/// Depth in whole millimetres: 0 nothing, 65535 that far or further.
fn depth_mm(depth_m: &[f32]) -> Vec<u16> {
    // A cast from float saturates. What is nearer than half a millimetre is not nothing.
    let code = |depth: &f32| if *depth > 0.0 { ((depth * 1000.0 + 0.5) as u16).max(1) } else { 0 };
    depth_m.iter().map(code).collect()
}

/// A normal as three 16-bit codes: -1 is 0, 1 is 65534, and no normal at all is three times 65535.
fn normal_code(normal: &[f32; 3]) -> [u16; 3] {
    if *normal == [0.0; 3] {
        return [u16::MAX; 3];
    }
    normal.map(|value| ((value.clamp(-1.0, 1.0) + 1.0) * 32_767.0 + 0.5) as u16)
}

/// A file of JSON lines being written.
pub(super) struct JsonLines {
    path: PathBuf,
    file: std::io::BufWriter<std::fs::File>,
}

impl JsonLines {
    pub(super) fn create(path: PathBuf) -> Result<Self, SimulateError> {
        let file = std::fs::File::create(&path)
            .map_err(|source| SimulateError::File { path: path.clone(), source })?;
        Ok(Self { path, file: std::io::BufWriter::new(file) })
    }

    pub(super) fn write(&mut self, line: &impl Serialize) -> Result<(), SimulateError> {
        let text = serde_json::to_string(line)?;
        writeln!(self.file, "{text}").map_err(|source| self.fault(source))
    }

    pub(super) fn finish(mut self) -> Result<(), SimulateError> {
        self.file.flush().map_err(|source| self.fault(source))
    }

    fn fault(&self, source: std::io::Error) -> SimulateError {
        SimulateError::File { path: self.path.clone(), source }
    }
}

/// Writes a picture as PNG.
///
/// # Errors
/// When the file cannot be written.
pub fn save_rgb(path: &Path, rgb: &RgbImage) -> Result<(), SimulateError> {
    save(path, &rgb.data, (rgb.width, rgb.height), image::ExtendedColorType::Rgb8)
}

/// Writes a mask as PNG.
///
/// # Errors
/// When the file cannot be written.
pub fn save_mask(path: &Path, mask: &Mask) -> Result<(), SimulateError> {
    save(path, &mask.data, (mask.width, mask.height), image::ExtendedColorType::L8)
}

/// `image` takes 16-bit samples in the machine's own byte order.
fn save_u16(
    path: &Path,
    samples: &[u16],
    size_px: (u32, u32),
    color: image::ExtendedColorType,
) -> Result<(), SimulateError> {
    save(path, bytemuck::cast_slice(samples), size_px, color)
}

fn save(
    path: &Path,
    data: &[u8],
    size_px: (u32, u32),
    color: image::ExtendedColorType,
) -> Result<(), SimulateError> {
    image::save_buffer_with_format(path, data, size_px.0, size_px.1, color, image::ImageFormat::Png)
        .map_err(|source| SimulateError::Picture { path: path.to_owned(), source })
}

/// Makes a folder and those above it; one that is there is left as it is.
///
/// # Errors
/// When it cannot be made.
pub fn make_folder(path: &Path) -> Result<(), SimulateError> {
    std::fs::create_dir_all(path).map_err(|source| SimulateError::File { path: path.to_owned(), source })
}

/// Writes a text.
///
/// # Errors
/// When the file cannot be written.
pub fn write_file(path: &Path, text: &str) -> Result<(), SimulateError> {
    std::fs::write(path, text).map_err(|source| SimulateError::File { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_whole_millimetres_and_nothing_stays_nothing() {
        assert_eq!(
            depth_mm(&[0.0, 0.0001, 1.0, 12.3456, 65.534, 65.6, 900.0]),
            [0, 1, 1000, 12_346, 65_534, 65_535, 65_535]
        );
    }

    #[test]
    fn normals_are_read_back_to_within_their_step() {
        assert_eq!(normal_code(&[0.0; 3]), [65_535; 3]);
        for normal in [[0.0, 0.0, 1.0_f32], [-1.0, 0.0, 0.0], [0.6, -0.64, 0.48]] {
            let read = normal_code(&normal).map(|code| f32::from(code) / 32_767.0 - 1.0);
            assert!(normal.iter().zip(read).all(|(a, b)| (a - b).abs() < 2e-5), "{normal:?}: {read:?}");
            assert!(normal_code(&normal).iter().all(|code| *code < 65_535));
        }
    }
}
