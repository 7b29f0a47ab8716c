//! Looks again and again at how far the calibrations of every scene's cameras disagree, has people placed as if they agreed, and tells of
//! cameras that are far off. Writes nothing into a calibration (docs/decisions/0031-calibration-offsets.md).

use super::entities::unless_panics;
use super::shared::{CameraEntry, Shared};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use videofields_picture::fuse::{CalibrationOffset, with_offsets};
use videofields_picture::scene::Scene;
use videofields_recording::ingest::StopFlag;
use videofields_recording::timeline::{Event, EventKind};
use videofields_vision::frame::CameraId;

/// Time between two looks: calibrations change slowly, and so do sightings of an hour.
const PERIOD: Duration = Duration::from_secs(60);

/// Longest that the thread sleeps before it looks whether it is to stop.
const NAP: Duration = Duration::from_millis(100);

/// Offset on the ground from which a camera is told to be misaligned, and below which it is no more, metres.
const MISALIGNED_M: [f64; 2] = [0.5, 0.4];

/// Cameras that would be moved and turned by less than that are left as they are in use: every change costs, since it has to be found anew
/// where people may stand.
const SAME_M: f64 = 0.02;
const SAME_RAD: f64 = 0.002;

/// Looks at every scene, again and again, until `stop` is raised.
pub(super) fn run(shared: &Shared, stop: &StopFlag) {
    let clock = &shared.clock;
    let mut due = clock.monotonic().saturating_add(PERIOD);
    while !stop.is_raised() {
        let left = due.saturating_sub(clock.monotonic());
        if !left.is_zero() {
            clock.sleep(left.min(NAP));
            continue;
        }
        unless_panics(|| shared.look_at_calibrations(stop));
        due = clock.monotonic().saturating_add(PERIOD);
    }
}

impl Shared {
    /// Looks at the calibrations of all scenes whose people are placed.
    fn look_at_calibrations(&self, stop: &StopFlag) {
        let mut worst: BTreeMap<CameraId, f64> = BTreeMap::new();
        for (scene, is_whole) in self.entities.placed() {
            if stop.is_raised() {
                return;
            }
            // One scene's failure never touches another.
            let Some(offsets) = unless_panics(|| self.correct(&scene)) else { continue };
            for (member, offset) in scene.cameras.iter().zip(&offsets) {
                if let Some(offset) = offset.filter(|offset| is_whole && offset.is_used()) {
                    let own = worst.entry(member.id.clone()).or_default();
                    *own = own.max(offset.offset_m);
                }
            }
        }
        for camera in self.all_cameras().iter() {
            self.tell_offset(camera, worst.get(&camera.id).copied());
        }
    }

    /// Has people in a scene placed as if its cameras agreed, and returns how far they do not.
    fn correct(&self, scene: &Arc<Scene>) -> Vec<Option<CalibrationOffset>> {
        let offsets = self.calibration_offsets_of(scene);
        let wanted = with_offsets(scene, &offsets).map(Arc::new);
        let placing = self.placing_of(scene);
        let mut placing = placing.lock();
        if !is_same(&placing.corrected(scene), wanted.as_ref().unwrap_or(scene)) {
            for (member, offset) in scene.cameras.iter().zip(&offsets) {
                tracing::info!(scene = %scene.id, camera = %member.id, ?offset, "people are placed by a corrected calibration");
            }
            placing.correct(scene, wanted);
        }
        offsets
    }

    /// Tells how far a camera's calibration is off, in the scene in which it is most.
    fn tell_offset(&self, camera: &CameraEntry, offset_m: Option<f64>) {
        let id = camera.id.as_str();
        self.metrics.camera_calibration_offset.with_label_values(&[id]).set(offset_m.unwrap_or(0.0));
        let Some(sightings) = self.roster.as_deref().and_then(|roster| roster.sightings_board(id)) else {
            return;
        };
        let before = sightings.misaligned_m();
        let now = misaligned_by(before, offset_m);
        sightings.tell_misaligned(now);
        if before.is_some() == now.is_some() {
            return;
        }
        let time = camera.timeline.range().map_or_else(|| self.clock.now(), |(_, last)| last);
        let event = Event::of_picture(camera.id.clone(), time, EventKind::Misaligned);
        let event = Event { is_end: now.is_none(), ..event };
        tracing::info!(camera = id, kind = event.kind.as_str(), is_end = event.is_end, offset_m, "event");
        self.metrics.ingest_events.with_label_values(&[id, event.kind.as_str()]).inc();
        self.events.push(event, self.clock.now());
    }
}

/// Returns by how much a camera is told to be misaligned whose offset is that, in metres, where `before` was told last.
fn misaligned_by(before: Option<f64>, offset_m: Option<f64>) -> Option<f64> {
    let [from_m, to_m] = MISALIGNED_M;
    let least_m = if before.is_some() { to_m } else { from_m };
    offset_m.filter(|offset_m| *offset_m >= least_m)
}

/// Tells that the cameras of both stand about alike.
fn is_same(a: &Scene, b: &Scene) -> bool {
    a.cameras.iter().zip(&b.cameras).all(|(a, b)| {
        let (a, b) = (a.camera.pose(), b.camera.pose());
        a.position_in_world.distance(b.position_in_world) <= SAME_M
            && a.world_from_local.angle_between(b.world_from_local) <= SAME_RAD
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};
    use videofields_picture::scene::{no_imports, parse};
    use videofields_vision::geometry::{Camera, Pose};

    #[test]
    fn a_camera_is_misaligned_from_half_a_metre_on_and_until_it_is_clearly_less() {
        let mut told = None;
        let offsets =
            [None, Some(0.49), Some(0.5), Some(0.9), Some(0.45), Some(0.39), Some(0.45), Some(0.6), None];
        let all = offsets.map(|offset_m| {
            told = misaligned_by(told, offset_m);
            told
        });
        assert_eq!(all, [None, None, Some(0.5), Some(0.9), Some(0.45), None, None, Some(0.6), None]);
    }

    #[test]
    fn cameras_that_hardly_moved_or_turned_are_the_same() {
        let text = r#"{"version": 1, "cameras": [{"id": "a", "calibration": {"image_size_px": [64, 48],
            "focal_px": [60, 60], "center_px": [32, 24], "position_m": [0, 8, 6],
            "world_from_camera": [0, -0.9238795325112867, 0.3826834323650898, 0]}}]}"#;
        let scene = parse("yard", text, no_imports).unwrap().scene;
        let changed = |moved_m: f64, turned_rad: f64| {
            let (mut other, of) = (scene.clone(), &scene.cameras[0].camera);
            let pose = Pose {
                position_in_world: of.pose().position_in_world + DVec3::Y * moved_m,
                world_from_local: DQuat::from_rotation_x(turned_rad) * of.pose().world_from_local,
            };
            let camera = Camera::new(of.size_px(), of.focal_px(), of.center_px(), *of.distortion(), pose);
            other.cameras[0].camera = Arc::new(camera.unwrap());
            other
        };
        for (moved_m, turned_rad, expected) in
            [(0.0, 0.0, true), (0.019, 0.0019, true), (0.021, 0.0, false), (0.0, 0.0021, false)]
        {
            assert_eq!(is_same(&scene, &changed(moved_m, turned_rad)), expected, "{moved_m} {turned_rad}");
        }
    }
}
