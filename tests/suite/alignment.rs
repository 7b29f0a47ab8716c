//! Clocks of two cameras compared by what both see, from pictures on.

use glam::DVec2;
use std::sync::Arc;
use videofields_picture::scene;
use videofields_recording::ingest::Pipeline;
use videofields_recording::timeline::{Sighting, align};
use videofields_simulate::{Station, Wanted, World};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings};
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, YuvImage};
use videofields_vision::mapping;

const SECS: f64 = 120.0;
const RATE_HZ: f64 = 5.0;
const SIZE_PX: (u32, u32) = (320, 180);

/// What the second camera's clock is ahead, and how much faster it runs.
const AHEAD_SECS: f64 = 10.0;
const DRIFT: f64 = 100e-6;

/// Three people in a yard, whose ways repeat after two minutes and not sooner.
const WORLD: &str = r##"{
    "version": 1, "base": "yard", "name": "Two clocks", "period_secs": 120, "actors": [
        {"kind": "walker", "id": "red", "height_m": 1.76, "path": {"laps": 9,
            "corners_m": [[-5, -3.6], [-2, -4.4], [3.0, -3.2], [2.2, -0.8], [-2.6, 0], [-5.2, -1.2]]}},
        {"kind": "walker", "id": "blue", "height_m": 1.68, "path": {"laps": 7, "start_share": 0.4,
            "corners_m": [[-3, -5.6], [5, -4.6], [6, -1.5], [3.5, 1.4], [-1.2, -1.4]]}},
        {"kind": "walker", "id": "green", "height_m": 1.8, "path": {"laps": 4, "start_share": 0.7,
            "corners_m": [[-6, -6.5], [6, -6.3], [7, 0.5], [0, -2], [-6.5, 0.8]]}}
    ]
}"##;

#[test]
fn two_cameras_whose_clocks_are_ten_seconds_and_a_hundred_ppm_apart_are_brought_into_step() {
    let world = World::from_json("two-clocks", WORLD).unwrap();
    let text = world.scene_json(SIZE_PX).unwrap();
    let scene = scene::parse("two-clocks", &text, scene::no_imports).unwrap().scene;
    let shown = |secs: f64, ahead: f64, drift: f64| {
        Timestamp::from_nanos(1_790_000_000_000_000_000 + ((secs + ahead + drift * secs) * 1e9) as i64)
    };
    let mut seen = Vec::new();
    for (member, (ahead, drift)) in scene.cameras.iter().zip([(0.0, 0.0), (AHEAD_SECS, DRIFT)]) {
        let id = member.id.as_str();
        let mut station = Station::new(&world, id, &member.camera, 1, RATE_HZ, Wanted::Picture).unwrap();
        let mut pipeline = Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default());
        let mut sightings = Vec::new();
        for number in 0..(SECS * RATE_HZ) as u64 {
            let secs = number as f64 / RATE_HZ;
            let shot = station.shoot(number, secs, Wanted::Picture).unwrap();
            let image = YuvImage::from_rgb(shot.picture(), ColorMatrix::Bt601, ColorRange::Limited).unwrap();
            let at = shown(secs, ahead, drift);
            let camera = CameraId::new(id).unwrap();
            let seen = pipeline.process(Frame { camera, timestamp: at, number, image: Arc::new(image) });
            let size = DVec2::new(SIZE_PX.0.into(), SIZE_PX.1.into());
            for track in seen.tracks.iter().filter(|track| track.blob_idx.is_some() && !track.is_in_group) {
                let texture = DVec2::from_array(track.foot_in_image) / size;
                if let Some(found) = mapping::locate(&member.camera, &scene.surfaces, texture) {
                    let place_m = found.point_in_world.truncate();
                    sightings.push(Sighting { at, track: track.id, place_m });
                }
            }
        }
        seen.push(sightings);
    }
    let found = align(&seen[0], &seen[1], 60.0).unwrap();
    for secs in [0.0, SECS] {
        let at = shown(secs, AHEAD_SECS, DRIFT);
        let since = at.nanos_since(found.since) as f64 * 1e-9;
        let ahead = found.offset_secs + found.drift_ppm * 1e-6 * since;
        let error = ahead - (AHEAD_SECS + DRIFT * secs);
        // Half of the time between two frames.
        assert!(error.abs() < 0.5 / RATE_HZ, "at {secs} s: {error:.4} s wrong; {found:?}");
    }
    assert!(found.confidence > 0.5, "{found:?}");
}
