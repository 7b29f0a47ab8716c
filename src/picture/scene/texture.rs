//! Pictures that surfaces and the sky are painted with: PNG and JPEG files -> sRGB texels with their smaller levels.
//!
//! Sides and bytes are held against limits before anything is decoded; files come from where [`Imports`] allows.

use super::Imports;
use super::model::MAX_MODEL_BYTES;
use glam::Vec3;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use rayon::iter::{IndexedParallelIterator, ParallelIterator};
use rayon::slice::ParallelSliceMut;
use std::fmt;
use std::io::Cursor;
use std::sync::{Arc, LazyLock};
use videofields_vision::frame::{linear_from_srgb, srgb_from_linear};

/// Most columns and rows of a picture.
pub const MAX_TEXTURE_SIDE_PX: u32 = 8192;

/// Most bytes of all decoded pictures of a scene together, 4 a pixel; their smaller levels take a third more.
pub const MAX_TEXTURE_BYTES: u64 = 256 << 20;

/// Bytes of a texel: red, green, blue, and one that is always 255.
const TEXEL_BYTES: usize = 4;

/// What lies beyond a picture's edge, along one of its axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Its edge.
    Clamp,
    /// The picture again.
    Repeat,
    /// The picture again, mirrored every other time.
    Mirror,
}

/// A picture with its smaller levels, down to one texel.
#[derive(Clone, PartialEq, Eq)]
pub struct Texture {
    levels: Vec<TextureLevel>,
    wraps: [Wrap; 2],
}

/// A picture in one size.
#[derive(Clone, PartialEq, Eq)]
pub struct TextureLevel {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// 8-bit sRGB and 255. **Shape** rows from the top x columns x 4, row-major.
    pub texels: Vec<u8>,
}

impl fmt::Debug for Texture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.size_px();
        write!(f, "Texture({width} x {height}, {:?})", self.wraps)
    }
}

impl Texture {
    /// A picture of 8-bit sRGB (rows from the top x columns x 3) with its smaller levels.
    ///
    /// # Panics
    /// When there are not as many bytes as that takes, or none.
    #[must_use]
    pub fn from_rgb((width_px, height_px): (u32, u32), rgb: &[u8], wraps: [Wrap; 2]) -> Self {
        assert_eq!(rgb.len(), width_px as usize * height_px as usize * 3, "three bytes a pixel");
        let texels = rgb.as_chunks::<3>().0.iter().flat_map(|[r, g, b]| [*r, *g, *b, 255]).collect();
        Self::new(TextureLevel { width_px, height_px, texels }, wraps)
    }

    fn new(finest: TextureLevel, wraps: [Wrap; 2]) -> Self {
        assert!(!finest.texels.is_empty(), "a picture has pixels");
        let mut levels = vec![finest];
        while let Some(smaller) = levels.last().and_then(TextureLevel::smaller) {
            levels.push(smaller);
        }
        Self { levels, wraps }
    }

    /// Columns and rows.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        (self.levels[0].width_px, self.levels[0].height_px)
    }

    /// The picture, then each level half as wide and high, rounded down, as the mean of what it covers in linear light.
    #[must_use]
    pub fn levels(&self) -> &[TextureLevel] {
        &self.levels
    }

    /// What lies beyond its edges: to the sides, above and below.
    #[must_use]
    pub const fn wraps(&self) -> [Wrap; 2] {
        self.wraps
    }

    /// Bytes of all levels together.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.levels.iter().map(|level| level.texels.len() as u64).sum()
    }
}

/// Linear light of every 8-bit code.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| linear_from_srgb(code as f32 / 255.0)));

impl TextureLevel {
    /// The next level: each texel the mean of what it covers; `None` of a single texel.
    fn smaller(&self) -> Option<Self> {
        let (width, height) = (self.width_px, self.height_px);
        if width == 1 && height == 1 {
            return None;
        }
        let (width_px, height_px) = ((width / 2).max(1), (height / 2).max(1));
        let (across, down) = (Cover::all(width, width_px), Cover::all(height, height_px));
        let mut texels = vec![255; width_px as usize * height_px as usize * TEXEL_BYTES];
        let rows = texels.par_chunks_exact_mut(width_px as usize * TEXEL_BYTES).zip(&down);
        rows.for_each(|(row, rows)| self.mean_row(rows, &across, row));
        Some(Self { width_px, height_px, texels })
    }

    /// One row of the next level: the means of what lies in these rows.
    fn mean_row(&self, rows: &Cover, across: &[Cover], row: &mut [u8]) {
        let (texels, _) = row.as_chunks_mut::<TEXEL_BYTES>();
        for (texel, columns) in texels.iter_mut().zip(across) {
            let mut mean = Vec3::ZERO;
            for (y, share_y) in rows.texels() {
                for (x, share_x) in columns.texels() {
                    mean += self.light(x, y) * (share_x * share_y);
                }
            }
            for (code, light) in texel.iter_mut().zip(mean.to_array()) {
                *code = (srgb_from_linear(light) * 255.0).round() as u8;
            }
        }
    }

    /// A texel's linear light.
    fn light(&self, x: u32, y: u32) -> Vec3 {
        let at = (y as usize * self.width_px as usize + x as usize) * TEXEL_BYTES;
        Vec3::from([0, 1, 2].map(|channel| LINEAR[usize::from(self.texels[at + channel])]))
    }
}

/// The up to three finer texels that a coarser one covers along an axis, and their shares.
struct Cover {
    first: u32,
    shares: [f32; 3],
}

impl Cover {
    fn all(finer: u32, coarser: u32) -> Vec<Self> {
        let extent = f64::from(finer) / f64::from(coarser);
        let cover = |idx: u32| {
            let (from, to) = (f64::from(idx) * extent, f64::from(idx + 1) * extent);
            let first = from as u32;
            let share = |texel: u32| {
                let (low, high) = (f64::from(texel).max(from), f64::from(texel + 1).min(to));
                ((high - low).max(0.0) / extent) as f32
            };
            Self { first, shares: [0, 1, 2].map(|step| share(first + step)) }
        };
        (0..coarser).map(cover).collect()
    }

    fn texels(&self) -> impl Iterator<Item = (u32, f32)> {
        (self.first..).zip(self.shares).filter(|(_, share)| *share > 1e-6)
    }
}

/// A picture that was read, and as what.
struct Known {
    file: String,
    /// What shows where it is transparent; none where it is not.
    behind_srgb: Option<[u8; 3]>,
    wraps: [Wrap; 2],
    texture: Arc<Texture>,
}

/// The files of a scene that is being read: its pictures once each and within limits, and the way to all others.
pub(super) struct Files<'a> {
    imports: &'a mut dyn Imports,
    known: Vec<Known>,
    n_bytes_left: u64,
}

impl<'a> Files<'a> {
    pub(super) fn new(imports: &'a mut dyn Imports) -> Self {
        Self { imports, known: Vec::new(), n_bytes_left: MAX_TEXTURE_BYTES }
    }

    /// What else may be brought in.
    pub(super) fn imports(&mut self) -> &mut dyn Imports {
        self.imports
    }

    /// The picture in a file; where it is transparent, `behind_srgb` shows.
    pub(super) fn picture(
        &mut self,
        file: &str,
        behind_srgb: [u8; 3],
        wraps: [Wrap; 2],
    ) -> Result<Arc<Texture>, String> {
        let is_it = |known: &&Known| {
            let is_covered = known.behind_srgb.is_none_or(|behind| behind == behind_srgb);
            is_covered && (known.file.as_str(), known.wraps) == (file, wraps)
        };
        if let Some(known) = self.known.iter().find(is_it) {
            return Ok(Arc::clone(&known.texture));
        }
        let bytes = self.imports.file(file, MAX_MODEL_BYTES)?;
        let (texture, is_opaque) = self
            .over(&bytes, Some(behind_srgb), wraps)
            .map_err(|reason| format!("cannot read the picture {file:?}: {reason}"))?;
        let behind_srgb = (!is_opaque).then_some(behind_srgb);
        self.known.push(Known { file: file.to_owned(), behind_srgb, wraps, texture: Arc::clone(&texture) });
        Ok(texture)
    }

    /// A picture out of a file's bytes, as if nothing of it were transparent.
    pub(super) fn decoded(&mut self, bytes: &[u8], wraps: [Wrap; 2]) -> Result<Arc<Texture>, String> {
        self.over(bytes, None, wraps).map(|(texture, _)| texture)
    }

    /// A picture over what is behind it, and whether that shows nowhere.
    fn over(
        &mut self,
        bytes: &[u8],
        behind_srgb: Option<[u8; 3]>,
        wraps: [Wrap; 2],
    ) -> Result<(Arc<Texture>, bool), String> {
        let Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) = image::guess_format(bytes) else {
            return Err("only PNG and JPEG are read".to_owned());
        };
        let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
        let mut limits = Limits::default();
        // 16 bits a channel, and what the decoder itself needs.
        limits.max_alloc = Some(3 * MAX_TEXTURE_BYTES);
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(|error| said(&error))?;
        let (width_px, height_px) = decoder.dimensions();
        let most = MAX_TEXTURE_SIDE_PX;
        if !((1..=most).contains(&width_px) && (1..=most).contains(&height_px)) {
            return Err(format!("1 to {most} pixels each way are allowed, got {width_px} x {height_px}"));
        }
        let n_bytes = u64::from(width_px) * u64::from(height_px) * TEXEL_BYTES as u64;
        if n_bytes > self.n_bytes_left {
            return Err(format!(
                "{width_px} x {height_px} pixels take {n_bytes} bytes, but of the {MAX_TEXTURE_BYTES} that all pictures \
                 of a scene may have together {} are left",
                self.n_bytes_left
            ));
        }
        let picture = DynamicImage::from_decoder(decoder).map_err(|error| said(&error))?;
        self.n_bytes_left -= n_bytes;
        let mut texels = picture.into_rgba8().into_raw();
        let (rgba, _) = texels.as_chunks_mut::<TEXEL_BYTES>();
        let is_opaque = rgba.iter().all(|texel| texel[3] == 255);
        rgba.iter_mut().for_each(|texel| cover(texel, behind_srgb));
        let finest = TextureLevel { width_px, height_px, texels };
        Ok((Arc::new(Texture::new(finest, wraps)), is_opaque))
    }
}

/// Makes a texel opaque, over what is behind it.
fn cover(texel: &mut [u8; TEXEL_BYTES], behind_srgb: Option<[u8; 3]>) {
    let alpha = texel[3];
    texel[3] = 255;
    let Some(behind) = behind_srgb.filter(|_| alpha < 255) else { return };
    let share = f32::from(alpha) / 255.0;
    for (code, behind) in texel.iter_mut().zip(behind) {
        let (own, behind) = (LINEAR[usize::from(*code)], LINEAR[usize::from(behind)]);
        *code = (srgb_from_linear(behind + (own - behind) * share) * 255.0).round() as u8;
    }
}

/// What a library says may repeat the file's own text at length.
fn said(error: &image::ImageError) -> String {
    super::model::shortened(&error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLAMP: [Wrap; 2] = [Wrap::Clamp; 2];

    #[test]
    fn levels_halve_down_to_one_texel_and_keep_the_mean_light() {
        for (width, height) in [(1_u32, 1_u32), (1, 7), (5, 3), (16, 16), (33, 9), (640, 3)] {
            let rgb: Vec<u8> = (0..width * height * 3).map(|i| (i * 73 % 251) as u8).collect();
            let texture = Texture::from_rgb((width, height), &rgb, CLAMP);
            let mean = |level: &TextureLevel| {
                let light = |texel: &[u8; 4]| f64::from(LINEAR[usize::from(texel[1])]);
                let (texels, _) = level.texels.as_chunks::<4>();
                texels.iter().map(light).sum::<f64>() / texels.len() as f64
            };
            let levels = texture.levels();
            let last = &levels[levels.len() - 1];
            assert_eq!((last.width_px, last.height_px), (1, 1));
            assert_eq!(levels.len() as u32, width.max(height).ilog2() + 1);
            for pair in levels.windows(2) {
                assert_eq!(pair[1].width_px, (pair[0].width_px / 2).max(1));
                assert_eq!(pair[1].height_px, (pair[0].height_px / 2).max(1));
                // Rounding to codes is all that changes it: half a code is at most 0.0046 of light.
                assert!((mean(&pair[1]) - mean(&pair[0])).abs() < 2.5e-3, "{width} x {height}");
            }
        }
    }

    #[test]
    fn what_is_transparent_shows_what_is_behind_it() {
        let mut texel = [200, 10, 10, 0];
        cover(&mut texel, Some([1, 2, 3]));
        assert_eq!(texel, [1, 2, 3, 255]);
        let mut texel = [200, 10, 10, 0];
        cover(&mut texel, None);
        assert_eq!(texel, [200, 10, 10, 255]);
        let mut texel = [255, 255, 255, 128];
        cover(&mut texel, Some([0; 3]));
        assert_eq!(texel[..3], [188; 3], "half the light");
    }
}
