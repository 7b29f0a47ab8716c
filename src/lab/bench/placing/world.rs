//! A simulated world, played before its cameras for one period to learn and for one to be judged.

use super::Masks;
use super::judge::{Figure, Judge};
use super::true_masks::play_true;
use crate::bench::playing::play_all;
use crate::entities::{EntityScore, LEAST_PX};
use crate::worlds::prepare;
use anyhow::Result;
use std::collections::BTreeSet;
use std::sync::Arc;
use videofields::accuracy::{OpenGate, Scope, Stopwatch};
use videofields_picture::scene::Scene;
use videofields_simulate::{FigurePosition, World};
use videofields_vision::clock::Clock;
use videofields_vision::frame::{CameraId, Mask};
use videofields_vision::observation::Observation;

/// Periods that are learned where calibrations are corrected: few people walk in one.
const PERIODS_TO_CORRECT: usize = 8;

/// Plays `world` at `rate_hz` before all its cameras; how many these are, and what their entities show. `scene_of` gives the scene in
/// which they are associated.
pub(super) fn judge_world(
    world: &World,
    (rate_hz, masks): (f64, Masks),
    judge: &mut Judge<'_>,
    clock: &dyn Clock,
    scene_of: impl FnOnce(&Scene) -> Result<Scene>,
) -> Result<(usize, EntityScore)> {
    let scope = Scope {
        n_frames: (world.period_secs() * rate_hz).round() as u32,
        max_cameras: usize::MAX,
        samples_per_side: 2,
        n_views: 0,
        ..Scope::FULL
    };
    let watch = Stopwatch::new(clock, &OpenGate);
    let subject = prepare(world, &scope, &watch, &videofields::commands::complain)?;
    let scene = Arc::new(scene_of(&subject.scene)?);
    let n_learned = if judge.corrects() { PERIODS_TO_CORRECT } else { 1 };
    let mut entities = EntityScore::default();
    let at_frame = |frame: Option<usize>, number: usize, seen: &[Observation]| {
        let Some(frame) = frame else {
            seen.iter().for_each(|of| judge.learn(of));
            return Ok(());
        };
        if frame == 0 {
            judge.correct(&scene);
        }
        let state = judge.place(&scene, subject.instant(number), seen);
        let of = |id: &CameraId| subject.cameras.iter().find(|camera| camera.id == *id);
        let members = state.cameras.iter().filter_map(|camera| of(&camera.id));
        let truths: Vec<&Mask> = members.map(|camera| &camera.instances[frame]).collect();
        let positions = world.figures(frame as f64 * subject.interval_secs)?;
        entities.add(&state, &truths, &positions);
        let seen = seen_in(&truths);
        let figures: Vec<Figure> = positions.iter().map(|of| figure(of, &seen)).collect();
        judge.score(&state, &figures);
        Ok(())
    };
    match masks {
        Masks::Ours => play_all(&subject, n_learned, at_frame)?,
        Masks::True => play_true(&subject, n_learned, at_frame)?,
    }
    Ok((subject.cameras.len(), entities))
}

/// The figures of which a picture shows enough.
fn seen_in(truths: &[&Mask]) -> BTreeSet<u8> {
    let mut seen = BTreeSet::new();
    for truth in truths {
        let mut counts = [0_usize; 256];
        truth.data.iter().for_each(|value| counts[usize::from(*value)] += 1);
        seen.extend((1..=u8::MAX).filter(|of| counts[usize::from(*of)] >= LEAST_PX));
    }
    seen
}

fn figure(of: &FigurePosition, seen: &BTreeSet<u8>) -> Figure {
    let (low, high) = of.box_in_world;
    Figure {
        id: u64::from(of.instance),
        kind: of.kind.into(),
        foot_in_world: of.foot_in_world,
        ground_m: [low.truncate(), high.truncate()],
        is_seen: seen.contains(&of.instance),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_shows_in_one_picture_is_seen() {
        let mask = |n_first: usize, n_second: usize| {
            let data = [vec![1_u8; n_first], vec![2; n_second], vec![0; 100 - n_first - n_second]].concat();
            Mask { width: 10, height: 10, data: data.into() }
        };
        // 39 and 30 pixels of the first never come to 40; 40 of the second in one picture do.
        assert_eq!(seen_in(&[&mask(39, 0), &mask(30, 40)]), [2].into());
    }
}
