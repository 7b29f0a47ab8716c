//! `check-config`: everything that is wrong with a configuration, before a daemon meets it.

use anyhow::{Result, bail};
use std::path::PathBuf;
use videofields::ingest::MediaRoots;
use videofields::{config, scene};

/// Reads a configuration and the scenes it names, and says what is wrong with them.
///
/// Also says which cameras' files cannot be opened now; those do not make the configuration wrong.
#[derive(Debug, clap::Args)]
pub(crate) struct CheckConfig {
    /// The configuration (TOML).
    file: PathBuf,
}

impl CheckConfig {
    pub(crate) fn run(&self) -> Result<()> {
        let config = config::load(&self.file)?;
        let settings = config.settings();
        let mut n_faulty = 0;
        for scene in &settings.scene {
            if let Err(error) = scene::load_file(&scene.id, &scene.file, &settings.media.roots) {
                super::complain(&error.to_string());
                n_faulty += 1;
            }
        }
        match MediaRoots::new(&settings.media.roots) {
            Ok(roots) => {
                for camera in &settings.camera {
                    if let Err(error) = videofields::ingest::open(&camera.source, &roots) {
                        super::complain(&format!("warning: camera {}: {error}", camera.id));
                    }
                }
            }
            Err(error) => super::complain(&format!("warning: {error}")),
        }
        if n_faulty > 0 {
            bail!("{n_faulty} of {} scenes are at fault", settings.scene.len());
        }
        let (cameras, scenes) = (settings.camera.len(), settings.scene.len());
        super::say(&format!("{}: good, {cameras} cameras, {scenes} scenes", self.file.display()));
        Ok(())
    }
}
