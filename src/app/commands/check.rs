//! `check-config`: everything that is wrong with a configuration, before a daemon meets it.

use anyhow::{Result, bail};
use std::path::PathBuf;
use videofields_picture::scene::{self, Scene};
use videofields_recording::ingest::{self, MediaRoots};
use videofields_service::sequence::SceneSequences;
use videofields_vision::config::{self, CameraSettings, Settings, SourceSettings};

/// Reads a configuration and the scenes it names, and says what is wrong with them.
///
/// Also reads the first frame of every camera and background clip and says which cannot be read now, which
/// cameras of a scene are not configured, and which of its recorded sequences cannot be opened; those are warnings and do not make the configuration wrong.
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
            match scene::load_file(&scene.id, &scene.file, &settings.media.roots) {
                Ok(parsed) => {
                    warn_of_unknown_cameras(settings, &parsed.scene);
                    let roots = MediaRoots::usable(&settings.media.roots);
                    for (id, reason) in SceneSequences::open(&parsed.scene, &roots, 0).problems() {
                        super::complain(&format!("warning: scene {}: sequence {id}: {reason}", scene.id));
                    }
                }
                Err(error) => {
                    super::complain(&format!("scene {}: {}: {error}", scene.id, scene.file.display()));
                    n_faulty += 1;
                }
            }
        }
        match MediaRoots::new(&settings.media.roots) {
            Ok(roots) => {
                let roots = roots.with_networks(&settings.media.networks);
                settings.camera.iter().for_each(|camera| warn_of_unreadable(camera, &roots));
            }
            Err(error) => super::complain(&format!("warning: {error}")),
        }
        if n_faulty > 0 {
            bail!("{n_faulty} of {} scenes are at fault", settings.scene.len());
        }
        let (cameras, scenes) = (settings.camera.len(), settings.scene.len());
        super::say(&format!("{}: good, {cameras} cameras, {scenes} scenes", self.file.display()))
    }
}

fn warn_of_unknown_cameras(settings: &Settings, scene: &Scene) {
    for member in &scene.cameras {
        if !settings.camera.iter().any(|camera| camera.id == member.id) {
            super::complain(&format!("warning: scene {}: camera {} is not configured", scene.id, member.id));
        }
    }
}

fn warn_of_unreadable(camera: &CameraSettings, roots: &MediaRoots) {
    let clip = camera
        .background
        .clip
        .as_ref()
        .map(|clip| SourceSettings { rate_hz: camera.source.rate_hz, ..SourceSettings::of_path(clip) });
    for (what, source) in [("", Some(&camera.source)), ("background clip: ", clip.as_ref())] {
        let Some(source) = source else { continue };
        let first = ingest::open(source, roots).and_then(|mut frames| frames.next_frame());
        if let Err(error) = first {
            super::complain(&format!("warning: camera {}: {what}{error}", camera.id));
        }
    }
}
