//! `calibration`: any known format in, the plain JSON out.

use super::parse::parse_size;
use anyhow::{Context, Result};
use std::path::PathBuf;
use videofields_vision::calibrate::{self, CameraDocument, Format, ImportOptions};

/// Reads a calibration in any known format and prints it as the plain JSON that scenes hold.
///
/// Lengths become metres and pixel centres lie at +0.5. Where a lens model had to be fitted, standard error says
/// how far the fit misses in the picture.
#[derive(Debug, clap::Args)]
pub(crate) struct Calibration {
    /// The file to read.
    file: PathBuf,
    /// tsai (PETS XML), opencv (YAML, XML or JSON) or json (the plain JSON itself); told from the text if absent.
    #[arg(long)]
    format: Option<Format>,
    /// Which camera, where the file holds several.
    #[arg(long, value_name = "ID")]
    camera: Option<String>,
    /// Columns and rows of the calibrated picture, where the file does not say, such as 768x576.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    image_size_px: Option<[u32; 2]>,
    /// Length of the file's unit in metres, where the format's own rule is not right.
    #[arg(long, value_name = "METRES")]
    metres_per_unit: Option<f64>,
}

impl Calibration {
    pub(crate) fn run(self) -> Result<()> {
        let path = self.file.display();
        let text = std::fs::read_to_string(&self.file).with_context(|| format!("cannot read {path}"))?;
        let options = ImportOptions {
            image_size_px: self.image_size_px,
            camera: self.camera,
            metres_per_unit: self.metres_per_unit,
        };
        let imported = calibrate::import(&text, self.format, &options)
            .with_context(|| format!("cannot import {path}"))?;
        if let Some(residual_px) = imported.residual_px {
            super::complain(&format!("the fitted lens misses the file's own by at most {residual_px:.4} px"));
        }
        super::say(&serde_json::to_string_pretty(&CameraDocument::from_camera(&imported.camera))?)
    }
}
