//! `simulate`: a world with known truth, as clips and truth files.

use anyhow::Result;
use std::path::PathBuf;
use videofields::simulate::{SimulateOptions, World, write};

/// Draws a world with known truth: clips, masks, depth, positions, a scene document and a configuration.
#[derive(Debug, clap::Args)]
pub(crate) struct Simulate {
    /// Which world: plaza.
    #[arg(long, default_value = "plaza")]
    world: String,
    /// The folder to write to; made if it is not there. Files of the same names are replaced.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Length of the clips, seconds. Default: the world's period, so that they loop without a seam.
    #[arg(long)]
    seconds: Option<f64>,
    /// Frames a second.
    #[arg(long, default_value_t = 10.0)]
    rate_hz: f64,
    /// Columns and rows of the cameras' pictures.
    #[arg(long, value_parser = super::calibration::parse_size, default_value = "640x360")]
    size_px: [u32; 2],
    /// Samples a pixel, each way.
    #[arg(long, default_value_t = 3)]
    samples: u32,
    /// Writes truth for every n-th frame; 0 writes none.
    #[arg(long, default_value_t = 1)]
    truth_every: u32,
}

impl Simulate {
    pub(crate) fn run(&self) -> Result<()> {
        let world = World::named(&self.world)?;
        let mut options = SimulateOptions::new(&self.out);
        options.seconds = self.seconds;
        options.rate_hz = self.rate_hz;
        options.size_px = (self.size_px[0], self.size_px[1]);
        options.samples_per_side = self.samples;
        options.truth_every_frames = self.truth_every;
        let written = write(&world, &options)?;
        super::say(&format!("{} frames a clip", written.n_frames));
        for clip in &written.clips {
            super::say(&clip.display().to_string());
        }
        super::say(&written.config.display().to_string());
        Ok(())
    }
}
