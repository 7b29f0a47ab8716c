//! `simulate`: a world with known truth, as clips and truth files.

use anyhow::Result;
use glam::DVec3;
use std::path::PathBuf;
use videofields::simulate::{ExtraView, Parts, SimulateOptions, World, write};

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
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Frames a second, 0.1 to 240.
    #[arg(long, value_name = "RATE", default_value_t = 10.0)]
    rate_hz: f64,
    /// Columns and rows of the cameras' pictures, 16 to 16383 each.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = super::calibration::parse_size, default_value = "640x360")]
    size_px: [u32; 2],
    /// Samples a pixel, each way, 1 to 16.
    #[arg(long, value_name = "COUNT", default_value_t = 3)]
    samples: u32,
    /// Writes truth for every n-th frame; 0 writes none.
    #[arg(long, value_name = "N", default_value_t = 1)]
    truth_every: u32,
    /// Writes truth for the frame at this time alone, seconds from the clips' start; may be given again.
    #[arg(long = "at-secs", value_name = "SECONDS")]
    at_secs: Vec<f64>,
    /// The database that the configuration names, relative to the folder.
    #[arg(long, value_name = "FILE", default_value = "videofields.sqlite")]
    database: PathBuf,
    /// A view where no camera stands, whose truth is written too, with masks of what the cameras see there and of
    /// its still part: its name, eye and target (metres) and vertical field of view (degrees), 960x540 if no size
    /// is given, such as square=0,-20,6:0,4,1:45; may be given again.
    #[arg(long = "view", value_name = "NAME=EYE:TARGET:FOV[:WIDTHxHEIGHT]", value_parser = parse_view)]
    views: Vec<ExtraView>,
    /// Writes the truth of the --view views and nothing else.
    #[arg(long, requires = "views")]
    only_views: bool,
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
        options.database.clone_from(&self.database);
        options.truth_at_secs.clone_from(&self.at_secs);
        options.extra_views.clone_from(&self.views);
        options.parts = if self.only_views { Parts::Views } else { Parts::Everything };
        let written = write(&world, &options)?;
        if !written.clips.is_empty() {
            super::say(&format!("{} frames a clip", written.n_frames))?;
        }
        for path in written.clips.iter().chain(&written.views).chain(&written.config) {
            super::say(&path.display().to_string())?;
        }
        Ok(())
    }
}

fn parse_view(text: &str) -> Result<ExtraView, String> {
    let expected = || {
        "expected NAME=EYE:TARGET:FOV or NAME=EYE:TARGET:FOV:WIDTHxHEIGHT, such as \
         square=0,-20,6:0,4,1:45:960x540"
            .to_owned()
    };
    let (name, rest) = text.split_once('=').ok_or_else(expected)?;
    let parts: Vec<&str> = rest.split(':').collect();
    let (eye, target, fov, [width, height]) = match parts[..] {
        [eye, target, fov] => (eye, target, fov, [960, 540]),
        [eye, target, fov, size] => (eye, target, fov, super::calibration::parse_size(size)?),
        _ => return Err(expected()),
    };
    let fov_deg: f64 = fov.parse().map_err(|_not_a_number| format!("{fov:?} is no number of degrees"))?;
    Ok(ExtraView {
        name: name.to_owned(),
        eye_in_world: parse_point(eye)?,
        target_in_world: parse_point(target)?,
        fov_y_rad: fov_deg.to_radians(),
        size_px: (width, height),
    })
}

fn parse_point(text: &str) -> Result<DVec3, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    match numbers.as_deref() {
        Ok(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("{text:?} is no place: expected x,y,z in metres")),
    }
}
