//! Exposure and white balance evened out between the cameras of a scene, smoothly over scene time.
//!
//! A camera's gain multiplies its colours in linear light, a channel. It follows what the backgrounds of overlapping
//! cameras show of the same places; what moves is shown with its camera's gain, so that people match the ground.

use super::SceneState;
use super::overlap::Overlap;
use glam::{DVec3, Vec3};
use std::collections::VecDeque;
use std::sync::{Arc, Weak};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{YuvImage, log_gains};

/// Time constant with which gains follow what cameras show, seconds of scene time: quicker than clouds, slower than
/// whatever would be seen to pulse.
const FOLLOW_SECS: f64 = 10.0;

/// Backgrounds are compared anew after this long, seconds of scene time: they change more slowly.
const SAMPLE_SECS: f64 = 1.0;

/// Lines of time that are kept: the present, and some who look at the past.
const MAX_LINES: usize = 6;

/// A line goes on to an instant no further on than this, seconds; for one further on, a copy of it does.
const STEP_SECS: f64 = 2.0;
/// Furthest on that a line or its copy goes: then 95 % of any change are done anyway.
const KEPT_SECS: f64 = 30.0;
/// An instant this little before a line's is answered by it.
const BACK_SECS: f64 = 0.5;

/// Answers that are kept: tiles of a wall and pictures of one instant are asked for one after the other, other instants meanwhile, and all
/// have the same colours.
const MOST_ANSWERS: usize = 64;

/// One scene's gains along its time.
///
/// An instant goes on from the latest one within 30 seconds before it, or at most half a second after it; any other
/// begins anew with what the cameras come to, as does a camera that is compared for the first time. The same instants with
/// the same observations in the same order give the same gains, and one that was asked for of late gives what it gave.
#[derive(Clone, Debug)]
pub struct Exposure {
    overlap: Arc<Overlap>,
    lines: Vec<Line>,
    n_updates: u64,
    /// The latest last.
    answers: VecDeque<Answer>,
}

/// Gains of an instant as they were given; logarithms by the cameras' places in the scene.
#[derive(Clone, Debug)]
struct Answer {
    instant: Timestamp,
    /// Places of the cameras and what they were compared by: weak, so that nothing is held, and nothing else can take its address.
    compared: Vec<(usize, Weak<YuvImage>)>,
    shown: Vec<Option<DVec3>>,
}

impl Answer {
    fn is_of(&self, instant: Timestamp, backgrounds: &[(usize, &Arc<YuvImage>)]) -> bool {
        let mut pairs = self.compared.iter().zip(backgrounds);
        self.instant == instant
            && self.compared.len() == backgrounds.len()
            && pairs.all(|((member, of), (other, background))| {
                member == other && std::ptr::eq(of.as_ptr(), Arc::as_ptr(background))
            })
    }
}

/// What is known at an instant; logarithms of gains by the cameras' places in the scene.
#[derive(Clone, Debug)]
struct Line {
    instant: Timestamp,
    sampled_at: Timestamp,
    /// When it was last asked for: a count that grows.
    used: u64,
    wanted: Vec<Option<DVec3>>,
    shown: Vec<Option<DVec3>>,
}

impl Exposure {
    /// Of the scene whose overlap this is, before any instant.
    #[must_use]
    pub const fn new(overlap: Arc<Overlap>) -> Self {
        Self { overlap, lines: Vec::new(), n_updates: 0, answers: VecDeque::new() }
    }

    /// Gives the cameras of a state their gains: the state must be of the overlap's scene, else nothing is evened.
    ///
    /// **Cost** once a second of scene time 9 texels for each camera that sees one of the overlap's places, and the
    /// least squares; else next to nothing. Without overlap nothing is looked at.
    pub fn even(&mut self, state: &mut SceneState) {
        if self.overlap.is_empty() || state.scene.cameras.len() != self.overlap.n_members() {
            return;
        }
        let members = members(state);
        let compared: Vec<(usize, &Arc<YuvImage>)> = members
            .iter()
            .copied()
            .zip(state.cameras.iter().map(|camera| &camera.observation.background))
            .collect();
        let answered = self.answers.iter().find(|answer| answer.is_of(state.instant, &compared));
        let shown = match answered {
            Some(answer) => answer.shown.clone(),
            None => self.shown_at(state.instant, &compared),
        };
        let gains: Vec<Option<DVec3>> = members.iter().map(|member| shown[*member]).collect();
        state.n_overlapping = gains.iter().flatten().count();
        for (camera, gain) in state.cameras.iter_mut().zip(gains) {
            camera.gain = gain.map_or(Vec3::ONE, |log| log.exp().as_vec3());
        }
    }

    /// Goes on to an instant at which cameras have these backgrounds, and returns what it comes to.
    fn shown_at(&mut self, instant: Timestamp, compared: &[(usize, &Arc<YuvImage>)]) -> Vec<Option<DVec3>> {
        self.n_updates += 1;
        let overlap = Arc::clone(&self.overlap);
        let mut backgrounds: Vec<Option<&YuvImage>> = vec![None; overlap.n_members()];
        for (member, background) in compared {
            backgrounds[*member] = Some(background);
        }
        let sample = || log_gains(overlap.n_members(), &overlap.differences(&backgrounds));
        let line = self.line_to(instant, sample);
        let line = &mut self.lines[line];
        line.used = self.n_updates;
        line.advance(instant, sample);
        let shown = line.shown.clone();
        if self.answers.len() == MOST_ANSWERS {
            self.answers.pop_front();
        }
        let compared =
            compared.iter().map(|(member, background)| (*member, Arc::downgrade(background))).collect();
        self.answers.push_back(Answer { instant, compared, shown: shown.clone() });
        shown
    }

    /// The line that goes on to `instant`, begun by `sample` where there is none.
    fn line_to(&mut self, instant: Timestamp, sample: impl FnOnce() -> Vec<Option<DVec3>>) -> usize {
        let secs = self.lines.iter().enumerate().map(|(idx, line)| (instant.secs_since(line.instant), idx));
        let near = secs.filter(|(secs, _)| (-BACK_SECS..=KEPT_SECS).contains(secs));
        let nearest = near.min_by(|(a, _), (b, _)| a.abs().total_cmp(&b.abs()));
        let begun = match nearest {
            Some((secs, idx)) if secs <= STEP_SECS => return idx,
            Some((_, idx)) => self.lines[idx].clone(),
            None => {
                let wanted = sample();
                Line { instant, sampled_at: instant, used: 0, shown: wanted.clone(), wanted }
            }
        };
        if self.lines.len() < MAX_LINES {
            self.lines.push(begun);
            return self.lines.len() - 1;
        }
        let oldest = self.lines.iter().enumerate().min_by_key(|(_, line)| line.used);
        let idx = oldest.map_or(0, |(idx, _)| idx);
        self.lines[idx] = begun;
        idx
    }
}

impl Line {
    /// Goes on to `instant`, and stays where it is for one before its own.
    fn advance(&mut self, instant: Timestamp, sample: impl FnOnce() -> Vec<Option<DVec3>>) {
        let passed_secs = instant.secs_since(self.instant);
        if passed_secs <= 0.0 {
            return;
        }
        self.instant = instant;
        if instant.secs_since(self.sampled_at) >= SAMPLE_SECS {
            self.sampled_at = instant;
            self.wanted = sample();
        }
        let share = 1.0 - (-passed_secs / FOLLOW_SECS).exp();
        for (shown, wanted) in self.shown.iter_mut().zip(&self.wanted) {
            // Who cannot be compared for a while keeps what was found.
            let Some(wanted) = wanted else { continue };
            *shown = Some(shown.map_or(*wanted, |shown| shown.lerp(*wanted, share)));
        }
    }
}

/// The place in the scene of each of the state's cameras, which come in its order.
fn members(state: &SceneState) -> Vec<usize> {
    let mut ids = state.scene.cameras.iter().map(|member| &member.id).enumerate();
    let place = |id| ids.by_ref().find(|(_, member)| *member == id).map(|(place, _)| place);
    state.cameras.iter().map(|camera| &camera.id).map_while(place).collect()
}
