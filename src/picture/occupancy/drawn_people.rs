//! Pictures of people who are known to stand somewhere, for tests: drawn by points within bodies, with code of their own.

use crate::scene::{Scene, no_imports, parse};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::SegmentSettings;
use videofields_vision::frame::{BitMask, CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage};
use videofields_vision::geometry::{Camera, Pose};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{MOVING, blobs_of};

pub(crate) const SIZE: (u32, u32) = (320, 180);

/// Returns a camera that looks at a point.
pub(crate) fn camera(eye: DVec3, target: DVec3) -> Camera {
    Camera::pinhole(eye, target, 0.9, SIZE).expect("tests look at points apart from the camera")
}

/// Returns a square of 16 m around `middle`, with boxes as a scene's document names them, and cameras.
pub(crate) fn scene(middle: DVec3, boxes: &str, cameras: &[Camera]) -> Arc<Scene> {
    let corner = |x: f64, y: f64| format!("[{}, {}]", middle.x + x, middle.y + y);
    let cameras: Vec<String> = cameras
        .iter()
        .enumerate()
        .map(|(idx, camera)| {
            let Pose { position_in_world: at, world_from_local: DQuat { x, y, z, w } } = *camera.pose();
            let focal = camera.focal_px();
            format!(
                r#"{{"id": "c{idx}", "calibration": {{"image_size_px": [{}, {}], "focal_px": [{}, {}], "center_px": [{}, {}],
                "position_m": [{}, {}, {}], "world_from_camera": [{x}, {y}, {z}, {w}]}}}}"#,
                SIZE.0, SIZE.1, focal.x, focal.y, camera.center_px().x, camera.center_px().y, at.x, at.y, at.z
            )
        })
        .collect();
    let text = format!(
        r#"{{"version": 1, "ground": [{{"height_m": {}, "polygon": [{}, {}, {}, {}]}}], "boxes": [{boxes}], "cameras": [{}]}}"#,
        middle.z,
        corner(-8.0, -8.0),
        corner(8.0, -8.0),
        corner(8.0, 8.0),
        corner(-8.0, 8.0),
        cameras.join(", ")
    );
    Arc::new(parse("square", &text, no_imports).expect("the document is a scene").scene)
}

/// Half widths of a body by height, metres: legs, trunk, head; of somebody 1.7 m tall.
fn half_width_m(share: f64) -> f64 {
    match share {
        share if share < 0.5 => 0.16,
        share if share < 0.85 => 0.22,
        _ => 0.1,
    }
}

/// Draws what a camera sees of people, feet and heights, by points within them; whoever is behind a box is hidden by it.
pub(crate) fn mask(scene: &Scene, camera: &Camera, people: &[(DVec3, f64)]) -> Mask {
    let mut data = vec![0; (SIZE.0 * SIZE.1) as usize];
    let eye = camera.pose().position_in_world;
    let rings = || (0..8).flat_map(|ring| (0..24).map(move |turn| (f64::from(ring) / 7.0, f64::from(turn))));
    let levels = || (0..120).map(|step| (f64::from(step) + 0.5) / 120.0);
    for (foot, height_m) in people {
        for (share, (ring, turn)) in levels().flat_map(|share| rings().map(move |at| (share, at))) {
            let beside = DVec2::from_angle(turn / 24.0 * TAU) * ring * half_width_m(share);
            let point = *foot + beside.extend(share * *height_m);
            let Some(seen) = camera.project(point).filter(|seen| seen.is_inside()) else { continue };
            let [x, y] = (seen.texture * DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1))).to_array();
            let (x, y) = ((x as u32).min(SIZE.0 - 1), (y as u32).min(SIZE.1 - 1));
            if !scene.surfaces.is_hidden(eye, point) {
                data[(y * SIZE.0 + x) as usize] = MOVING;
            }
        }
    }
    Mask { width: SIZE.0, height: SIZE.1, data: data.into() }
}

/// Returns three cameras around a place, which look at it.
pub(crate) fn around(middle: DVec3) -> [Camera; 3] {
    [(9.0, -9.0), (-9.0, -8.0), (1.0, 10.0)]
        .map(|(x, y)| camera(middle + DVec3::new(x, y, 3.5), middle + DVec3::Z * 0.8))
}

/// Returns what a camera saw where `labels` is its mask: a grey picture, with the blobs of the mask and no tracks.
pub(crate) fn observation(camera: CameraId, labels: Mask) -> Observation {
    let (width, height) = (labels.width, labels.height);
    let grey = [110, 128, 128];
    let image = YuvImage::filled(width, height, grey, ColorMatrix::Bt601, ColorRange::Limited);
    let image = Arc::new(image);
    let mut moving = BitMask::new(width, height);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        if labels.get(x, y) == MOVING {
            moving.set_run(y as usize, x as usize, x as usize + 1);
        }
    }
    let labels = Arc::new(labels);
    Observation {
        frame: Frame { camera, timestamp: Timestamp::from_nanos(0), number: 0, image: Arc::clone(&image) },
        soft_mask: Arc::clone(&labels),
        labels,
        background: image,
        blobs: blobs_of(&moving, &SegmentSettings::default()).into(),
        tracks: Arc::default(),
    }
}
