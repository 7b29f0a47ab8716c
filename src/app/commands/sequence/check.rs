//! `sequence check`: what is in a sequence, and what is wrong with it.

use crate::commands::progress::Progress;
use crate::commands::say;
use anyhow::{Result, bail};
use std::path::PathBuf;
use videofields_service::sequence::{SequenceCheck, check};

/// Reads all of a sequence and tells what is in it and what is wrong with it; fails where something cannot be read.
#[derive(Debug, clap::Args)]
pub(super) struct Check {
    /// The manifest, or its folder.
    path: PathBuf,
    /// As JSON.
    #[arg(long)]
    json: bool,
}

impl Check {
    pub(super) fn run(self) -> Result<()> {
        let mut sequence = super::open(&self.path)?;
        let n_frames = sequence.frames().len();
        let mut progress = Progress::new();
        let found =
            check(&mut sequence, |n_read| progress.show(|| format!("{n_read} of {n_frames} frames read")));
        progress.finish();
        if self.json {
            say(&serde_json::to_string_pretty(&found)?)?;
        } else {
            tell(&found)?;
        }
        if found.n_faults > 0 {
            bail!("{}: {} faults", self.path.display(), found.n_faults);
        }
        Ok(())
    }
}

fn tell(found: &SequenceCheck) -> Result<()> {
    say(&format!("{} frames in {:.3} s", found.n_frames, found.duration_secs))?;
    for [first, last] in &found.missing {
        say(&format!("  no mesh: {first} to {last}"))?;
    }
    if let Some([least, most]) = found.n_triangles {
        say(&format!(
            "{least} to {most} triangles; {} frames differ in size from the one before",
            found.n_changed
        ))?;
    }
    if found.n_empty > 0 {
        say(&format!("{} frames without a triangle", found.n_empty))?;
    }
    if let Some([[x, y, z], [far_x, far_y, far_z]]) = found.bounds_m {
        say(&format!("from ({x:.3}, {y:.3}, {z:.3}) to ({far_x:.3}, {far_y:.3}, {far_z:.3}) m"))?;
    }
    if found.n_points_mended + found.n_triangles_mended > 0 {
        say(&format!(
            "superfluous: {} points, {} triangles",
            found.n_points_mended, found.n_triangles_mended
        ))?;
    }
    if found.n_extruded > 0 {
        say(&format!("drawn out, and not coloured: {} triangles", found.n_extruded))?;
    }
    for camera in &found.cameras {
        let sizes: Vec<String> =
            camera.sizes_px.iter().map(|[width, height]| format!("{width} x {height}")).collect();
        let missing = match camera.n_missing {
            0 => String::new(),
            count => format!(", {count} frames without one"),
        };
        say(&format!(
            "camera {}: {} pictures of {}{missing}",
            camera.id,
            camera.n_pictures,
            if sizes.is_empty() { "no size".to_owned() } else { sizes.join(", ") }
        ))?;
    }
    found.faults.iter().try_for_each(|fault| say(&format!("fault: {fault}")))?;
    let untold = found.n_faults - found.faults.len();
    if untold > 0 {
        say(&format!("and {untold} faults more"))?;
    }
    Ok(())
}
