//! `check-config`: everything that is wrong with a configuration, before a daemon meets it.

use anyhow::{Result, bail};
use std::path::PathBuf;
use videofields_picture::scene::{self, Scene};
use videofields_recording::ingest::{self, MediaRoots};
use videofields_recording::signing::SigningKey;
use videofields_service::engine::shape_concern;
use videofields_service::sequence::SceneSequences;
use videofields_vision::config::{self, CameraSettings, Settings, SourceSettings};
use videofields_vision::geometry::is_stretched;

/// Reads a configuration and the scenes it names, and says what is wrong with them.
///
/// Also reads the first frame of every camera and background clip and says which cannot be read now, and of which scenes'
/// calibrations are of another picture shape; which cameras of a scene are not configured, and which of its recorded sequences cannot
/// be opened. Those are warnings and do not make the configuration wrong.
#[derive(Debug, clap::Args)]
pub(crate) struct CheckConfig {
    /// The configuration (TOML).
    file: PathBuf,
}

impl CheckConfig {
    pub(crate) fn run(&self) -> Result<()> {
        let config = config::load(&self.file)?;
        let settings = config.settings();
        let (mut n_faulty, mut scenes) = (0, Vec::new());
        for scene in &settings.scene {
            match scene::load_file(&scene.id, &scene.file, settings.media_folders()) {
                Ok(parsed) => {
                    warn_of_unknown_cameras(settings, &parsed.scene);
                    let roots = MediaRoots::of_settings(settings);
                    for (id, reason) in SceneSequences::open(&parsed.scene, &roots, 0).problems() {
                        super::complain(&format!("warning: scene {}: sequence {id}: {reason}", scene.id));
                    }
                    scenes.push(parsed.scene);
                }
                Err(error) => {
                    super::complain(&format!("scene {}: {}: {error}", scene.id, scene.file.display()));
                    n_faulty += 1;
                }
            }
        }
        warn_of_roots(settings);
        let roots = MediaRoots::of_settings(settings);
        for camera in &settings.camera {
            if let Some(size_px) = warn_of_unreadable(camera, &roots) {
                warn_of_other_shape(camera, size_px, &scenes);
            }
        }
        warn_of_audit_key(settings);
        if n_faulty > 0 {
            bail!("{n_faulty} of {} scenes are at fault", settings.scene.len());
        }
        let (cameras, scenes) = (settings.camera.len(), settings.scene.len());
        super::say(&format!("{}: good, {cameras} cameras, {scenes} scenes", self.file.display()))
    }
}

/// Warns of media roots that cannot be used, and of those above what the daemon keeps itself.
fn warn_of_roots(settings: &Settings) {
    let is_needed = settings.camera.iter().any(|camera| camera.source.path.is_some());
    for root in &settings.media.roots {
        if let Err(error) = MediaRoots::new(std::slice::from_ref(root))
            && is_needed
        {
            super::complain(&format!("warning: {error}"));
        }
    }
    for overlap in settings.media_folders().overlaps() {
        super::complain(&format!("warning: {overlap}"));
    }
}

/// Warns of keys with which the audit log cannot be signed; `doctor` tells of a log that is to have none.
fn warn_of_audit_key(settings: &Settings) {
    let storage = &settings.storage;
    let keys = [
        (&storage.audit_key, "the audit log cannot be signed"),
        (&storage.audit_key_before, "storage.audit_key cannot take over where it has not"),
    ];
    for (key, why) in keys.into_iter().filter(|(key, _)| !key.as_os_str().is_empty()) {
        if let Err(error) = SigningKey::read(key) {
            super::complain(&format!("warning: {why}: {error}"));
        }
    }
}

fn warn_of_unknown_cameras(settings: &Settings, scene: &Scene) {
    for member in &scene.cameras {
        if !settings.camera.iter().any(|camera| camera.id == member.id) {
            super::complain(&format!("warning: scene {}: camera {} is not configured", scene.id, member.id));
        }
    }
}

/// Warns of calibrations of a camera that are of another shape than its pictures.
fn warn_of_other_shape(camera: &CameraSettings, size_px: (u32, u32), scenes: &[Scene]) {
    for scene in scenes {
        for member in scene.cameras.iter().filter(|member| member.id == camera.id) {
            let calibrated_px = member.camera.size_px();
            if is_stretched(calibrated_px, size_px) {
                let concern = shape_concern(&scene.id, calibrated_px, size_px);
                super::complain(&format!("warning: camera {}: {concern}", camera.id));
            }
        }
    }
}

/// Warns of what cannot be read now of a camera; returns the size of its first picture.
fn warn_of_unreadable(camera: &CameraSettings, roots: &MediaRoots) -> Option<(u32, u32)> {
    let mut size_px = None;
    let clip = camera
        .background
        .clip
        .as_ref()
        .map(|clip| SourceSettings { rate_hz: camera.source.rate_hz, ..SourceSettings::of_path(clip) });
    for (what, source) in [("", Some(&camera.source)), ("background clip: ", clip.as_ref())] {
        let Some(source) = source else { continue };
        match ingest::open(source, roots).and_then(|mut frames| frames.next_frame()) {
            Ok(Some(frame)) if what.is_empty() => size_px = Some((frame.image.width(), frame.image.height())),
            Ok(_) => {}
            Err(error) => super::complain(&format!("warning: camera {}: {what}{error}", camera.id)),
        }
    }
    size_px
}
