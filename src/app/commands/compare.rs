//! `compare`: how far a picture, or a folder of them, is from its reference.

use super::pictures::{ending, read, rgb};
use anyhow::{Context as _, Result, ensure};
use serde::Serialize;
use std::path::{Path, PathBuf};
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::measures::{Pooled, SeamEnergy, Steadiness};

/// Compares a picture with a reference of the same size: RMSE, PSNR, SSIM and seam energy as one line of JSON.
///
/// The figures agree with scikit-image's `peak_signal_noise_ratio` and `structural_similarity` (7 x 7 windows,
/// per channel) to 1e-3. PSNR is null where the pictures are equal. Of two folders the pictures of the same names are
/// compared, in the order of their names as the moments of one view: figures are over all pixels, and flicker is the variance
/// over time where the reference stands still.
#[derive(Debug, clap::Args)]
pub(crate) struct Compare {
    /// The reference picture (PNG or JPEG), or a folder of them.
    reference: PathBuf,
    /// The picture to judge (PNG or JPEG), or a folder of them.
    picture: PathBuf,
    /// Compares only where this 8-bit picture is not 0.
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// An 8-bit picture of which camera counts most at a pixel, 255 for none: seam energy is measured where that changes.
    #[arg(long, value_name = "FILE")]
    owners: Option<PathBuf>,
}

/// What two folders come to.
#[derive(Debug, Serialize)]
struct Folders {
    rmse: Option<f64>,
    psnr_db: Option<f64>,
    ssim: Option<f64>,
    n_pictures: usize,
    #[serde(flatten)]
    seams: Option<Seams>,
    flicker_variance: Option<f64>,
}

/// What a picture comes to.
#[derive(Debug, Serialize)]
struct Single {
    #[serde(flatten)]
    comparison: videofields_vision::measures::Comparison,
    #[serde(flatten)]
    seams: Option<Seams>,
}

/// Steps between pixels beyond the reference's, 8-bit codes.
#[derive(Debug, Serialize)]
struct Seams {
    /// Where another camera comes to count most.
    seam_energy: Option<f64>,
    /// Where none does.
    step_within: Option<f64>,
    /// The former over the latter.
    seam_ratio: Option<f64>,
}

impl Seams {
    fn of(energy: &SeamEnergy) -> Self {
        let (across, within) = (energy.across.value(), energy.within.value());
        Self { seam_energy: across, step_within: within, seam_ratio: energy.ratio() }
    }
}

impl Compare {
    pub(crate) fn run(&self) -> Result<()> {
        let mask = self.mask.as_deref().map(read_mask).transpose()?;
        let owners = self.owners.as_deref().map(read_mask).transpose()?;
        if self.reference.is_dir() || self.picture.is_dir() {
            return self.folders(mask.as_ref(), owners.as_ref());
        }
        let (reference, picture) = (rgb(read(&self.reference)?), rgb(read(&self.picture)?));
        let comparison = videofields_vision::measures::compare(&reference, &picture, mask.as_ref())?;
        let mut energy = SeamEnergy::default();
        add_seams(&mut energy, (&picture, &reference), (owners.as_ref(), mask.as_ref()))?;
        let single = Single { comparison, seams: owners.is_some().then(|| Seams::of(&energy)) };
        super::say(&serde_json::to_string(&single)?)
    }

    fn folders(&self, mask: Option<&Mask>, owners: Option<&Mask>) -> Result<()> {
        let names = names(&self.reference)?;
        let (mut pooled, mut energy, mut steadiness) =
            (Pooled::default(), SeamEnergy::default(), Steadiness::default());
        let mut size = None;
        for name in &names {
            let (reference, picture) = (self.reference.join(name), self.picture.join(name));
            ensure!(picture.is_file(), "{} is missing, {} is there", picture.display(), reference.display());
            let (reference, picture) = (rgb(read(&reference)?), rgb(read(&picture)?));
            let comparison = videofields_vision::measures::compare(&reference, &picture, mask)
                .with_context(|| format!("{}", name.display()))?;
            let own = (reference.width, reference.height);
            let first = *size.get_or_insert(own);
            ensure!(first == own, "{}: {own:?} pixels, but those before it have {first:?}", name.display());
            pooled.add(&comparison);
            add_seams(&mut energy, (&picture, &reference), (owners, mask))?;
            steadiness.add(&picture, &reference, mask);
        }
        ensure!(!names.is_empty(), "{}: no picture (PNG or JPEG) is in it", self.reference.display());
        super::say(&serde_json::to_string(&Folders {
            rmse: pooled.rmse(),
            psnr_db: pooled.psnr_db(),
            ssim: pooled.ssim(),
            n_pictures: names.len(),
            seams: owners.is_some().then(|| Seams::of(&energy)),
            flicker_variance: steadiness.variance(),
        })?)
    }
}

fn add_seams(
    energy: &mut SeamEnergy,
    (picture, reference): (&RgbImage, &RgbImage),
    (owners, mask): (Option<&Mask>, Option<&Mask>),
) -> Result<()> {
    let Some(owners) = owners else { return Ok(()) };
    let (size, own) = ((reference.width, reference.height), (owners.width, owners.height));
    ensure!(size == own, "--owners has {} x {} pixels, the reference {} x {}", own.0, own.1, size.0, size.1);
    let everywhere = mask.is_none().then(|| Mask::filled(size.0, size.1, 255));
    if let Some(part) = mask.or(everywhere.as_ref()) {
        energy.add(picture, reference, owners, part);
    }
    Ok(())
}

/// The names of a folder's pictures, in their order.
fn names(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut names = Vec::new();
    for entry in entries {
        let name =
            PathBuf::from(entry.with_context(|| format!("cannot read {}", folder.display()))?.file_name());
        if ["png", "jpg", "jpeg"].contains(&ending(&name).as_str()) {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

fn read_mask(path: &Path) -> Result<Mask> {
    let image = read(path)?.into_luma8();
    Ok(Mask { width: image.width(), height: image.height(), data: image.into_raw().into() })
}
