//! The calibrations: whether they are of pictures of the shape that the cameras' files have. Cameras in the network are not asked.

use super::line::Line;
use videofields_picture::scene::{self, Scene};
use videofields_recording::ingest::{self, MediaRoots};
use videofields_service::engine::shape_concern;
use videofields_vision::config::{CameraSettings, Config, SceneSettings, Settings};
use videofields_vision::geometry::is_stretched;

const SUBJECT: &str = "calibrations";

pub(super) fn look(config: &Config) -> Vec<Line> {
    let settings = config.settings();
    let roots = MediaRoots::of_settings(settings);
    let scenes = scenes(settings);
    let is_file = |camera: &&CameraSettings| camera.source.path.is_some();
    let found: Vec<Vec<Line>> = settings
        .camera
        .iter()
        .filter(is_file)
        .filter_map(|camera| Some(camera_lines(camera, first_size_px(camera, &roots)?, &scenes)))
        .collect();
    let n_looked_at = found.len();
    let mut lines: Vec<Line> = found.into_iter().flatten().collect();
    if lines.is_empty() && n_looked_at > 0 {
        lines.push(Line::ok(SUBJECT, format!("those of {n_looked_at} files are of their pictures' shape")));
    }
    lines
}

/// Returns the scenes of the configuration that can be read; `check-config` tells of the others.
fn scenes(settings: &Settings) -> Vec<Scene> {
    let folders = settings.media_folders();
    let load = |of: &SceneSettings| scene::load_file(&of.id, &of.file, &folders).ok();
    settings.scene.iter().filter_map(load).map(|parsed| parsed.scene).collect()
}

/// Returns the size of a camera's first picture; none where there is none to be read now.
fn first_size_px(camera: &CameraSettings, roots: &MediaRoots) -> Option<(u32, u32)> {
    let mut frames = ingest::open(&camera.source, roots).ok()?;
    let first = frames.next_frame().ok()??;
    Some((first.image.width(), first.image.height()))
}

/// Returns a warning for every scene whose calibration of the camera is of another shape.
fn camera_lines(camera: &CameraSettings, size_px: (u32, u32), scenes: &[Scene]) -> Vec<Line> {
    let members = scenes.iter().flat_map(|scene| scene.cameras.iter().map(move |member| (scene, member)));
    let other = members
        .filter(|(_, member)| member.id == camera.id && is_stretched(member.camera.size_px(), size_px))
        .map(|(scene, member)| {
            let why = shape_concern(&scene.id, member.camera.size_px(), size_px);
            Line::warning(SUBJECT, camera.id.to_string(), why)
                .do_this("calibrate the camera with pictures as it sends them, or have it send those that were calibrated")
        });
    other.collect()
}
