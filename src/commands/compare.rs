//! `compare`: how far a picture is from its reference.

use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use videofields::accuracy;
use videofields::frame::{Mask, RgbImage};

/// Compares a picture with a reference of the same size: RMSE, PSNR and SSIM as one line of JSON.
///
/// The figures agree with scikit-image's `peak_signal_noise_ratio` and `structural_similarity` (7 x 7 windows,
/// per channel) to 1e-3. PSNR is null where the pictures are equal.
#[derive(Debug, clap::Args)]
pub(crate) struct Compare {
    /// The reference picture (PNG or JPEG).
    reference: PathBuf,
    /// The picture to judge (PNG or JPEG).
    picture: PathBuf,
    /// Compares only where this 8-bit picture is not 0.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
}

impl Compare {
    pub(crate) fn run(&self) -> Result<()> {
        let reference = read_rgb(&self.reference)?;
        let picture = read_rgb(&self.picture)?;
        let mask = self.mask.as_deref().map(read_mask).transpose()?;
        let comparison = accuracy::compare(&reference, &picture, mask.as_ref())?;
        super::say(&serde_json::to_string(&comparison)?)
    }
}

fn open(path: &Path) -> Result<image::DynamicImage> {
    image::ImageReader::open(path)
        .with_context(|| format!("cannot read {}", path.display()))?
        .with_guessed_format()
        .with_context(|| format!("cannot read {}", path.display()))?
        .decode()
        .with_context(|| format!("{} is no picture that can be read (PNG or JPEG)", path.display()))
}

fn read_rgb(path: &Path) -> Result<RgbImage> {
    let image = open(path)?.into_rgb8();
    Ok(RgbImage { width: image.width(), height: image.height(), data: image.into_raw() })
}

fn read_mask(path: &Path) -> Result<Mask> {
    let image = open(path)?.into_luma8();
    Ok(Mask { width: image.width(), height: image.height(), data: image.into_raw().into() })
}
