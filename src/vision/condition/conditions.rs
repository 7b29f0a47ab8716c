//! One camera's conditions: what must last before it is told, and when the place is learned.
//!
//! Frames flow in; what begins and ends flows out.

use super::frozen::Stillness;
use super::light::{CHANGED_LEVELS, Light};
use super::look::{Grid, Looks};
use super::reference::{LIGHT_TAU_SECS, Reference, TAU_SECS};
use super::verdict::{Finding, Judge, Verdict};
use super::{Condition, ConditionChange, ConditionKind, Evidence, Phase};
use crate::clock::Timestamp;
use crate::config::ConditionSettings;
use crate::frame::{Plane, YuvImage};

/// Seconds between looks.
const LOOK_SECS: f64 = 0.5;

/// Looks from one lesson of the place to the next, once it is known.
const LOOKS_A_LESSON: u32 = 4;

/// Longest time that a frame stands for: a gap in the stream proves nothing.
const MAX_STEP_SECS: f64 = 2.0;

/// Other edges must last so many times as long as a displacement: a bus may stop before a camera.
const ELSEWHERE_FACTOR: f64 = 5.0;

/// Displacements that differ by more than this share of the picture's width from look to look do not last.
const STEADY_SHARE: f64 = 0.01;

/// Where neither the place nor its loss could be told for so long, the place is learned anew: it was learned while
/// something stood before it, or has changed beyond recognition bit by bit.
const UNSURE_SECS: f64 = 60.0;

/// What a camera's picture is watched with; its state, bounded, some 0.5 MB.
#[derive(Debug)]
pub struct Conditions {
    settings: ConditionSettings,
    /// The sizes of the frame and of the background that everything is for.
    sizes: Option<[(u32, u32); 2]>,
    /// None where the picture is too small.
    watch: Option<Watch>,
    stillness: Stillness,
    light: Light,
    seen: Option<Timestamp>,
    since_look_secs: f64,
    /// What a look must show, from the first of a row of them that agree.
    candidate: Candidate,
    /// Seconds for which the camera has been displaced.
    moved_secs: f64,
    /// The displaced camera's place was taken for the place: only a person ends the condition.
    is_moved_for_good: bool,
    finding: Finding,
    changed_share: f64,
    current: Vec<Condition>,
    changes: Vec<ConditionChange>,
}

/// What is judged at looks.
#[derive(Debug)]
struct Watch {
    looks: Looks,
    reference: Reference,
    judge: Judge,
    background: Vec<u16>,
    n_looks: u32,
}

/// A verdict and the seconds for which it has lasted.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    verdict: Verdict,
    secs: f64,
}

const SOUND: Finding = Finding { verdict: Verdict::Sound, edges_left: 1.0 };
const NO_CANDIDATE: Candidate = Candidate { verdict: Verdict::Unsure, secs: 0.0 };

impl Conditions {
    /// Conditions of a camera of which nothing has been seen.
    #[must_use]
    pub fn new(settings: &ConditionSettings) -> Self {
        Self {
            settings: settings.clone(),
            sizes: None,
            watch: None,
            stillness: Stillness::default(),
            light: Light::default(),
            seen: None,
            since_look_secs: LOOK_SECS,
            candidate: NO_CANDIDATE,
            moved_secs: 0.0,
            is_moved_for_good: false,
            finding: SOUND,
            changed_share: 0.0,
            current: Vec::with_capacity(4),
            changes: Vec::with_capacity(8),
        }
    }

    /// Takes the next frame; what begins or ends with it, most often nothing.
    ///
    /// `background_luma` is plane 0 of the background picture, of the frame's size or of that reduced by a whole
    /// number; `foreground_share` the share of the pixels that match no background mode, 0 to 1. A time that stands
    /// still or runs back counts as none; a frame or background of another size begins anew, and ends every condition
    /// but [`ConditionKind::Moved`], which only [`Self::accept`] ends then.
    ///
    /// **Cost** a few microseconds; twice a second of scene time about half a millisecond, and a millisecond or two
    /// more while the place is lost. Allocates for the first frame of a size only.
    pub fn observe(
        &mut self,
        time: Timestamp,
        frame: &YuvImage,
        background_luma: Plane<'_>,
        foreground_share: f64,
    ) -> &[ConditionChange] {
        self.changes.clear();
        if !self.settings.watch {
            return &self.changes;
        }
        self.fit_to(time, frame, background_luma);
        let step_secs = self.seen.map_or(0.0, |seen| time.secs_since(seen)).clamp(0.0, MAX_STEP_SECS);
        self.seen = Some(time);
        let luma = frame.plane(0);
        let is_frozen = self.stillness.observe(luma, step_secs, self.settings.frozen_after_secs);
        if is_frozen {
            self.begin(ConditionKind::Frozen, time);
        } else {
            self.end(ConditionKind::Frozen, time);
        }
        self.light.observe(foreground_share, step_secs);
        self.since_look_secs += step_secs;
        if self.since_look_secs >= LOOK_SECS {
            let secs = std::mem::take(&mut self.since_look_secs).min(MAX_STEP_SECS);
            self.look(time, luma, background_luma, secs);
        }
        &self.changes
    }

    /// What is wrong now, in the order in which it was told.
    #[must_use]
    pub fn state(&self) -> &[Condition] {
        &self.current
    }

    /// Whether it can be told that the camera is covered, moved or in another light: not in its first twenty seconds,
    /// nor where the place has too few edges (a blank wall, a black night) or the picture too few pixels.
    #[must_use]
    pub fn is_judged(&self) -> bool {
        self.watch.as_ref().is_some_and(|watch| watch.reference.is_judge() && watch.reference.is_confirmed())
    }

    /// Takes what the camera sees from now on for its place: somebody has put it right, or calibrated it anew. Ends
    /// [`ConditionKind::Moved`] and [`ConditionKind::Covered`] without a word.
    pub fn accept(&mut self) {
        if let Some(watch) = &mut self.watch {
            watch.reference.forget();
        }
        self.is_moved_for_good = false;
        (self.candidate, self.moved_secs, self.finding) = (NO_CANDIDATE, 0.0, SOUND);
        self.current
            .retain(|condition| !matches!(condition.kind, ConditionKind::Moved | ConditionKind::Covered));
    }

    /// Begins anew where the sizes are others than before.
    fn fit_to(&mut self, time: Timestamp, frame: &YuvImage, background: Plane<'_>) {
        let sizes = [(frame.width(), frame.height()), (background.width, background.height)];
        if self.sizes == Some(sizes) {
            return;
        }
        (self.finding, self.changed_share) = (SOUND, 0.0);
        (self.stillness, self.light) = (Stillness::default(), Light::default());
        for kind in [ConditionKind::Frozen, ConditionKind::Covered, ConditionKind::LightChanged] {
            self.end(kind, time);
        }
        self.is_moved_for_good = self.is(ConditionKind::Moved);
        (self.candidate, self.moved_secs, self.since_look_secs) = (NO_CANDIDATE, 0.0, LOOK_SECS);
        self.sizes = Some(sizes);
        self.watch = Grid::new(sizes[0], sizes[1]).map(|grid| Watch {
            looks: Looks::new(grid),
            reference: Reference::new(grid),
            judge: Judge::new(grid, frame.width()),
            background: vec![0; grid.n_cells()],
            n_looks: 0,
        });
    }

    fn look(&mut self, time: Timestamp, luma: Plane<'_>, background: Plane<'_>, secs: f64) {
        let Some(watch) = &mut self.watch else { return };
        watch.looks.take(luma);
        watch.judge.see(&watch.looks);
        watch.n_looks = watch.n_looks.wrapping_add(1);
        if !watch.reference.is_learned() {
            watch.learn(background, secs, TAU_SECS);
            return;
        }
        if !watch.looks.is_full() || !watch.reference.is_judge() {
            // A place without edges may get some: at dawn, when a cover is taken off that was there from the start.
            watch.learn_at_times(background, secs, TAU_SECS);
            return;
        }
        self.finding = watch.judge.judge(&watch.reference, &watch.looks);
        watch.reference.confirm(self.finding.verdict, secs);
        if !watch.reference.is_confirmed() {
            if self.finding.verdict == Verdict::Sound {
                watch.learn_at_times(background, secs, TAU_SECS);
            }
            (self.finding, self.candidate) = (SOUND, NO_CANDIDATE);
            return;
        }
        self.changed_share = watch.reference.changed_share(watch.judge.luma(), CHANGED_LEVELS);
        self.last(secs);
        let is_sound = self.finding.verdict == Verdict::Sound;
        let sound_secs = if is_sound { self.candidate.secs } else { 0.0 };
        let is_light_changed = self.light.look(sound_secs, self.changed_share);
        let is_wrong =
            self.is(ConditionKind::Covered) || (self.is(ConditionKind::Moved) && !self.is_moved_for_good);
        if let Some(watch) = &mut self.watch
            && is_sound
            && !is_wrong
        {
            watch.learn_at_times(background, secs, if is_light_changed { LIGHT_TAU_SECS } else { TAU_SECS });
        }
        if is_light_changed {
            self.begin(ConditionKind::LightChanged, time);
        } else {
            self.end(ConditionKind::LightChanged, time);
        }
        self.tell(time, secs);
    }

    /// Counts for how long the verdict has been what it is.
    fn last(&mut self, secs: f64) {
        let verdict = self.finding.verdict;
        let width = self.sizes.map_or(0.0, |[frame, _]| f64::from(frame.0));
        let goes_on = match (self.candidate.verdict, verdict) {
            (Verdict::Displaced(a), Verdict::Displaced(b)) => {
                (a[0] - b[0]).hypot(a[1] - b[1]) <= STEADY_SHARE * width
            }
            (before, now) => before == now,
        };
        let secs = if goes_on { self.candidate.secs + secs } else { 0.0 };
        self.candidate = Candidate { verdict, secs };
    }

    /// Begins and ends what has lasted long enough.
    fn tell(&mut self, time: Timestamp, secs: f64) {
        let least_secs = match self.candidate.verdict {
            Verdict::Elsewhere => ELSEWHERE_FACTOR * self.settings.begin_after_secs,
            _ => self.settings.begin_after_secs,
        };
        if self.candidate.secs >= least_secs {
            match self.candidate.verdict {
                Verdict::Sound => {
                    self.end(ConditionKind::Covered, time);
                    if !self.is_moved_for_good {
                        self.end(ConditionKind::Moved, time);
                    }
                    self.moved_secs = 0.0;
                }
                Verdict::Displaced(_) | Verdict::Elsewhere => {
                    self.end(ConditionKind::Covered, time);
                    self.begin(ConditionKind::Moved, time);
                }
                Verdict::Gone => self.begin(ConditionKind::Covered, time),
                Verdict::Unsure => self.give_up(),
            }
        }
        if self.is(ConditionKind::Moved) && !self.is(ConditionKind::Covered) && !self.is_moved_for_good {
            self.moved_secs += secs;
            if self.moved_secs >= self.settings.accept_after_secs {
                self.is_moved_for_good = true;
                if let Some(watch) = &mut self.watch {
                    watch.reference.forget();
                }
            }
        }
    }

    /// Learns the place anew if it has not been told from any other for too long.
    fn give_up(&mut self) {
        let is_told = self.is(ConditionKind::Moved) || self.is(ConditionKind::Covered);
        if let Some(watch) = &mut self.watch
            && !is_told
            && self.candidate.secs >= UNSURE_SECS
        {
            watch.reference.forget();
            self.candidate = NO_CANDIDATE;
        }
    }

    fn is(&self, kind: ConditionKind) -> bool {
        self.current.iter().any(|condition| condition.kind == kind)
    }

    fn evidence(&self, kind: ConditionKind) -> Evidence {
        let displacement_px = match self.finding.verdict {
            Verdict::Displaced(displacement_px) if kind == ConditionKind::Moved => Some(displacement_px),
            _ => None,
        };
        Evidence {
            still_secs: self.stillness.still_secs(),
            edges_left: self.finding.edges_left,
            displacement_px,
            changed_share: self.changed_share,
        }
    }

    /// Tells that a condition begins, unless it has begun before.
    fn begin(&mut self, kind: ConditionKind, time: Timestamp) {
        let evidence = self.evidence(kind);
        match self.current.iter_mut().find(|condition| condition.kind == kind) {
            None => {
                self.current.push(Condition { kind, since: time, evidence });
                self.changes.push(ConditionChange { time, kind, phase: Phase::Begun, evidence });
            }
            // Of a place that was taken for the place, the displacement from the one before is what remains.
            Some(condition) if kind == ConditionKind::Moved && !self.is_moved_for_good => {
                condition.evidence = evidence;
            }
            Some(_) => {}
        }
    }

    /// Tells that a condition ends, if it had begun.
    fn end(&mut self, kind: ConditionKind, time: Timestamp) {
        if let Some(index) = self.current.iter().position(|condition| condition.kind == kind) {
            let evidence = self.evidence(kind);
            self.current.remove(index);
            self.changes.push(ConditionChange { time, kind, phase: Phase::Ended, evidence });
        }
    }
}

impl Watch {
    /// Learns at every few looks.
    fn learn_at_times(&mut self, background: Plane<'_>, secs: f64, tau_secs: f64) {
        if self.n_looks.is_multiple_of(LOOKS_A_LESSON) {
            self.learn(background, f64::from(LOOKS_A_LESSON) * secs, tau_secs);
        }
    }

    fn learn(&mut self, background: Plane<'_>, secs: f64, tau_secs: f64) {
        self.looks.background(background, &mut self.background);
        self.reference.learn(&self.background, self.judge.luma(), secs, tau_secs);
    }
}
