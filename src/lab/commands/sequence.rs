//! `sequence`: what moves in a simulated world as a sequence.

use crate::world_sequence::{SequenceOptions, write_sequence};
use anyhow::Result;
use std::path::PathBuf;
use videofields::commands::parse::parse_size;
use videofields::commands::progress::Progress;
use videofields::commands::say;
use videofields_service::sequence::MANIFEST;
use videofields_simulate::World;

/// Writes what moves in a simulated world as a sequence: a mesh a frame, and what the world's cameras see, with masks.
#[derive(Debug, clap::Args)]
pub(crate) struct Sequence {
    /// Which world: a name (`videofields-lab simulate --list` has them) or the path of a world's document (docs/worlds.md).
    #[arg(long, value_name = "NAME|FILE", default_value = "plaza")]
    world: String,
    /// The folder to write to; made if it is not there. Files of the same names are replaced.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// When it begins, seconds of the world's time.
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    from: f64,
    /// How long it is.
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0)]
    seconds: f64,
    /// Frames a second.
    #[arg(long, value_name = "RATE", default_value_t = 10.0)]
    rate_hz: f64,
    /// Columns and rows of all cameras' pictures; each camera's own if absent.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    size_px: Option<[u32; 2]>,
    /// Samples a pixel, each way, 1 to 16.
    #[arg(long, value_name = "COUNT", default_value_t = 2)]
    samples: u32,
    /// About how large triangles are, 0.005 to 0.5 m.
    #[arg(long, value_name = "METRES", default_value_t = 0.03)]
    step: f64,
}

impl Sequence {
    pub(crate) fn run(self) -> Result<()> {
        let world = World::load(&self.world)?;
        let options = SequenceOptions {
            out_dir: self.out.clone(),
            from_secs: self.from,
            seconds: self.seconds,
            rate_hz: self.rate_hz,
            size_px: self.size_px.map(Into::into),
            samples_per_side: self.samples,
            step_m: self.step,
        };
        let mut progress = Progress::new();
        write_sequence(&world, &options, |frame, n_frames| {
            progress.show(|| format!("frame {frame} of {n_frames}"));
        })?;
        progress.finish();
        say(&self.out.join(MANIFEST).display().to_string())
    }
}
