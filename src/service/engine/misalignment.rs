//! Looks again and again at how far the calibrations of every scene's cameras disagree, has people placed as if they agreed, and tells of
//! cameras that are far off. Writes nothing into a calibration (docs/decisions/0031-calibration-offsets.md).

use super::entities::unless_panics;
use super::shared::{CameraEntry, Shared};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
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

/// Scenes whose cameras are corrected, each with its cameras so; those that are gone go.
#[derive(Debug, Default)]
pub(super) struct Corrections(Mutex<Vec<(Weak<Scene>, Arc<Scene>)>>);

impl Corrections {
    /// Returns a scene with its cameras as what they see is placed, where any is corrected.
    pub(super) fn corrected_scene(&self, scene: &Scene) -> Option<Arc<Scene>> {
        let known = self.lock();
        let found = known.iter().find(|(of, _)| std::ptr::eq(of.as_ptr(), scene));
        found.map(|(_, corrected)| Arc::clone(corrected))
    }

    /// Notes how the cameras of a scene are corrected.
    fn note(&self, scene: &Arc<Scene>, corrected: Option<&Arc<Scene>>) {
        let mut known = self.lock();
        known.retain(|(of, _)| of.strong_count() > 0 && !std::ptr::eq(of.as_ptr(), Arc::as_ptr(scene)));
        known.extend(corrected.map(|corrected| (Arc::downgrade(scene), Arc::clone(corrected))));
    }

    fn lock(&self) -> MutexGuard<'_, Vec<(Weak<Scene>, Arc<Scene>)>> {
        // A panic leaves the list whole: it is changed entry by entry.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

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
        // By camera, of those of which it is known: 0 where they agree as far as can be told.
        let mut worst: BTreeMap<CameraId, f64> = BTreeMap::new();
        let mut members: BTreeSet<CameraId> = BTreeSet::new();
        for (scene, is_whole) in self.entities.placed() {
            members.extend(scene.cameras.iter().map(|member| member.id.clone()));
            if stop.is_raised() {
                return;
            }
            // One scene's failure never touches another.
            let Some(offsets) = unless_panics(|| self.correct_placing(&scene)) else { continue };
            let members = scene.cameras.iter().zip(&offsets).filter(|_| is_whole);
            let known =
                members.filter_map(|(member, offset)| Some((member, offset.filter(|of| of.is_known())?)));
            for (member, offset) in known {
                let offset_m = if offset.is_used() { offset.offset_m } else { 0.0 };
                let own = worst.entry(member.id.clone()).or_default();
                *own = own.max(offset_m);
            }
        }
        // A camera whose evidence is gone, such as after its zones were changed, stays as it was told until more is known.
        for camera in self.all_cameras().iter() {
            // A camera of no scene disagrees with nobody.
            let of_none = (!members.contains(&camera.id)).then_some(0.0);
            if let Some(offset_m) = worst.get(&camera.id).copied().or(of_none) {
                self.tell_offset(camera, offset_m);
            }
        }
    }

    /// Has people in a scene placed as if its cameras agreed, and returns how far they do not.
    fn correct_placing(&self, scene: &Arc<Scene>) -> Vec<Option<CalibrationOffset>> {
        let offsets = self.calibration_offsets_of(scene);
        if !self.is_there(scene) {
            // It was changed meanwhile, and its memory is let go of.
            return offsets;
        }
        let placing = self.placing_of(scene);
        let mut placing = placing.lock();
        let now = placing.corrected(scene);
        let wanted = keeping_unknown(with_offsets(scene, &offsets), (scene, &now), &offsets).map(Arc::new);
        if !is_same(&now, wanted.as_ref().unwrap_or(scene)) {
            for (member, offset) in scene.cameras.iter().zip(&offsets) {
                tracing::info!(scene = %scene.id, camera = %member.id, ?offset, "people are placed by a corrected calibration");
            }
            self.corrections.note(scene, wanted.as_ref());
            placing.correct(scene, wanted);
        }
        offsets
    }

    /// Tells how far a camera's calibration is off, in the scene in which it is most.
    fn tell_offset(&self, camera: &CameraEntry, offset_m: f64) {
        let id = camera.id.as_str();
        let Some(sightings) = self.roster.as_deref().and_then(|roster| roster.sightings_board(id)) else {
            return;
        };
        self.metrics.camera_calibration_offset.with_label_values(&[id]).set(offset_m);
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
fn misaligned_by(before: Option<f64>, offset_m: f64) -> Option<f64> {
    let [from_m, to_m] = MISALIGNED_M;
    let least_m = if before.is_some() { to_m } else { from_m };
    (offset_m >= least_m).then_some(offset_m)
}

/// Returns the scene with cameras as they are wanted, but those of which nothing is known as they are now; none where all are as calibrated.
fn keeping_unknown(
    wanted: Option<Scene>,
    (scene, now): (&Scene, &Scene),
    offsets: &[Option<CalibrationOffset>],
) -> Option<Scene> {
    let is_kept = |idx: &usize| {
        let is_known = offsets[*idx].is_some_and(|offset| offset.is_known());
        !is_known && !Arc::ptr_eq(&scene.cameras[*idx].camera, &now.cameras[*idx].camera)
    };
    let kept: Vec<usize> = (0..scene.cameras.len()).filter(is_kept).collect();
    if kept.is_empty() {
        return wanted;
    }
    let mut wanted = wanted.unwrap_or_else(|| scene.clone());
    kept.into_iter().for_each(|idx| wanted.cameras[idx].camera = Arc::clone(&now.cameras[idx].camera));
    Some(wanted)
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

    fn scene() -> Scene {
        let text = r#"{"version": 1, "cameras": [{"id": "a", "calibration": {"image_size_px": [64, 48],
            "focal_px": [60, 60], "center_px": [32, 24], "position_m": [0, 8, 6],
            "world_from_camera": [0, -0.9238795325112867, 0.3826834323650898, 0]}}]}"#;
        parse("yard", text, no_imports).unwrap().scene
    }

    /// Returns the scene with its camera moved and turned.
    fn changed(scene: &Scene, moved_m: f64, turned_rad: f64) -> Scene {
        let (mut other, of) = (scene.clone(), &scene.cameras[0].camera);
        let pose = Pose {
            position_in_world: of.pose().position_in_world + DVec3::Y * moved_m,
            world_from_local: DQuat::from_rotation_x(turned_rad) * of.pose().world_from_local,
        };
        let camera = Camera::new(of.size_px(), of.focal_px(), of.center_px(), *of.distortion(), pose);
        other.cameras[0].camera = Arc::new(camera.unwrap());
        other
    }

    #[test]
    fn a_camera_is_misaligned_from_half_a_metre_on_and_until_it_is_clearly_less() {
        let mut told = None;
        let offsets = [0.0, 0.49, 0.5, 0.9, 0.45, 0.39, 0.45, 0.6, 0.0];
        let all = offsets.map(|offset_m| {
            told = misaligned_by(told, offset_m);
            told
        });
        assert_eq!(all, [None, None, Some(0.5), Some(0.9), Some(0.45), None, None, Some(0.6), None]);
    }

    #[test]
    fn a_camera_of_which_nothing_is_known_any_more_stays_as_it_was_corrected() {
        let scene = scene();
        let changed = changed(&scene, 0.5, 0.0);
        let offset = |n_paths: usize| CalibrationOffset {
            moved_m: DVec3::ZERO,
            turned_rad: DVec3::ZERO,
            offset_m: 0.0,
            error_m: 0.1,
            apart_m: [0.1, 0.1],
            n_paths,
        };
        let after = |offset: Option<CalibrationOffset>| {
            let wanted = keeping_unknown(None, (&scene, &changed), &[offset])?;
            assert!(Arc::ptr_eq(&wanted.cameras[0].camera, &changed.cameras[0].camera));
            Some(())
        };
        assert_eq!([None, Some(offset(3)), Some(offset(99))].map(after), [Some(()), Some(()), None]);
        assert!(keeping_unknown(None, (&scene, &scene), &[None]).is_none());
    }

    #[test]
    fn cameras_that_hardly_moved_or_turned_are_the_same() {
        let scene = scene();
        for (moved_m, turned_rad, expected) in
            [(0.0, 0.0, true), (0.019, 0.0019, true), (0.021, 0.0, false), (0.0, 0.0021, false)]
        {
            assert_eq!(
                is_same(&scene, &changed(&scene, moved_m, turned_rad)),
                expected,
                "{moved_m} {turned_rad}"
            );
        }
    }
}
