//! What there is of a scene's time: what was recorded and what is kept in memory, how much moved, what happened.

use super::EngineError;
use super::shared::Shared;
use videofields_picture::scene::Scene;
use videofields_recording::store::ActivityRecord;
use videofields_recording::timeline::LoggedEvent;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Stretches closer than this are one: a camera's frames lie that far apart, and segments begin a frame later.
const JOINED_NANOS: i64 = 1_000_000_000;

/// Most events of one answer, the newest.
const MAX_EVENTS: usize = 1000;

/// What there is of a scene's time between two instants.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneTimeline {
    /// Each of its cameras.
    pub cameras: Vec<CameraTimeline>,
    /// What happened before them, in the order in which it was told: the newest 1000.
    pub events: Vec<LoggedEvent>,
}

/// What there is of a camera's time.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraTimeline {
    /// The camera.
    pub camera: CameraId,
    /// From when to when it can be shown, in order; between two there is a gap.
    pub ranges: Vec<(Timestamp, Timestamp)>,
    /// How much moved, in the stretches asked for.
    pub activity: Vec<ActivityRecord>,
}

impl Shared {
    /// What there is of a scene's time between `from` and `to`. Blocks for the database.
    pub(super) fn chronicle(
        &self,
        scene: &Scene,
        (from, to): (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<SceneTimeline, EngineError> {
        let mut cameras = Vec::new();
        for camera in self.members(scene) {
            let mut ranges = Vec::new();
            if let Some(past) = &self.past {
                let kept_from = camera.timeline.range().map(|(first, _)| first);
                ranges = past.recorded(&camera.id, (from, to), kept_from).map_err(unavailable)?;
            }
            let activity = self.activity_of(&camera.id, (from, to), minutes_each)?;
            ranges.extend(camera.timeline.range());
            let ranges = joined(ranges, (from, to));
            cameras.push(CameraTimeline { camera: camera.id.clone(), ranges, activity });
        }
        let is_asked = |camera: &CameraId| cameras.iter().any(|of| of.camera == *camera);
        let is_within = |time: Timestamp| (from..=to).contains(&time);
        let events =
            self.events.after(0, MAX_EVENTS, |event| is_asked(&event.camera) && is_within(event.time));
        Ok(SceneTimeline { cameras, events })
    }

    /// How much moved before a camera between `from` and `to`. Blocks for the database.
    pub(super) fn activity_of(
        &self,
        camera: &CameraId,
        (from, to): (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<Vec<ActivityRecord>, EngineError> {
        let Some(past) = &self.past else { return Ok(Vec::new()) };
        past.activity(camera, from, to, minutes_each).map_err(unavailable)
    }
}

fn unavailable(error: impl std::fmt::Display) -> EngineError {
    EngineError::Unavailable(error.to_string())
}

/// The stretches of `ranges` within `span`, in order, those that touch as one.
fn joined(
    mut ranges: Vec<(Timestamp, Timestamp)>,
    (from, to): (Timestamp, Timestamp),
) -> Vec<(Timestamp, Timestamp)> {
    ranges.sort_unstable();
    let mut joined: Vec<(Timestamp, Timestamp)> = Vec::new();
    for (first, last) in ranges {
        let (first, last) = (first.max(from), last.min(to));
        if first > last {
            continue;
        }
        match joined.last_mut() {
            Some((_, end)) if first.nanos_since(*end) <= JOINED_NANOS => *end = last.max(*end),
            _ => joined.push((first, last)),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_that_touch_are_one_and_end_where_the_span_does() {
        let secs = |secs: i64| Timestamp::from_nanos(secs * 1_000_000_000);
        let range = |(first, last): (i64, i64)| (secs(first), secs(last));
        let check = |ranges: &[(i64, i64)], expected: &[(i64, i64)]| {
            let found = joined(ranges.iter().copied().map(range).collect(), (secs(0), secs(100)));
            assert_eq!(found, expected.iter().copied().map(range).collect::<Vec<_>>(), "{ranges:?}");
        };
        check(&[], &[]);
        check(&[(60, 70), (10, 20), (21, 30), (33, 40)], &[(10, 30), (33, 40), (60, 70)]);
        check(&[(10, 50), (20, 30), (51, 52)], &[(10, 52)]);
        check(&[(-20, -10), (-5, 5), (99, 120), (130, 140)], &[(0, 5), (99, 100)]);
    }
}
