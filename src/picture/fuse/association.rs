//! A scene's memory of who is who: a few lines of time, so that whoever looks at the past disturbs nobody's present.

use super::line::{Followed, KEPT_SECS, Line};
use super::{Entity, Sighting};
use crate::occupancy::Expected;
use videofields_vision::clock::Timestamp;

/// Lines that are kept: the present, which stays, and some who look at the past.
const MAX_LINES: usize = 6;

/// A line goes on to an instant this near, either way, seconds; for one further on, a copy of it does.
const STEP_SECS: f64 = 0.5;

/// Who is who in one scene: entities' ids, kept from camera to camera and from instant to instant.
///
/// Ids are never given twice. An instant goes on from what was known at the nearest instant asked for before: by a step
/// of at most half a second either way, or up to five seconds forwards. Any other begins anew, with new ids. The same
/// instants with the same observations in the same order give the same ids.
#[derive(Clone, Debug)]
pub(super) struct Association {
    lines: Vec<Line>,
    next_id: u64,
    n_updates: u64,
}

impl Default for Association {
    fn default() -> Self {
        Self::counting_from(1)
    }
}

impl Association {
    /// Returns a memory that gives ids from `next_id` on.
    pub(super) const fn counting_from(next_id: u64) -> Self {
        Self { lines: Vec::new(), next_id, n_updates: 0 }
    }

    /// Returns the least id that was not given yet.
    pub(super) const fn next_id(&self) -> u64 {
        self.next_id
    }

    /// Gives `count` ids away, and returns the first of them.
    pub(super) const fn take_ids(&mut self, count: u64) -> u64 {
        let first = self.next_id;
        self.next_id += count;
        first
    }

    /// Who is seen at `instant`, in growing order of ids; `followed` are all tracks of all cameras.
    ///
    /// **Cost** about a microsecond a sighting where few are near; no more than the square of what is near.
    pub(super) fn update(
        &mut self,
        instant: Timestamp,
        sightings: Vec<Sighting>,
        followed: &[Followed],
    ) -> Vec<Entity> {
        self.n_updates += 1;
        let line = self.line_to(instant);
        self.lines[line].used = self.n_updates;
        self.lines[line].advance(instant, sightings, followed, &mut self.next_id)
    }

    /// Returns who should be where at `instant`, of those whom several cameras saw together half a second before it at most.
    pub(super) fn expected(&self, instant: Timestamp) -> Vec<Expected> {
        let secs = self.lines.iter().filter_map(|line| Some((line.secs_to(instant)?, line)));
        let near = secs.filter(|(secs, _)| (-STEP_SECS..=STEP_SECS).contains(secs));
        let nearest = near.min_by(|(a, _), (b, _)| a.abs().total_cmp(&b.abs()));
        nearest.map_or_else(Vec::new, |(_, line)| line.expected(instant))
    }

    /// The line that goes on to `instant`.
    fn line_to(&mut self, instant: Timestamp) -> usize {
        let secs =
            self.lines.iter().enumerate().filter_map(|(idx, line)| Some((line.secs_to(instant)?, idx)));
        let near = secs.filter(|(secs, _)| (-STEP_SECS..=KEPT_SECS).contains(secs));
        let nearest = near.min_by(|(a, _), (b, _)| a.abs().total_cmp(&b.abs()));
        let begun = match nearest {
            Some((secs, idx)) if secs <= STEP_SECS => return idx,
            Some((_, idx)) => self.lines[idx].clone(),
            None => Line::default(),
        };
        if self.lines.len() < MAX_LINES {
            self.lines.push(begun);
            return self.lines.len() - 1;
        }
        // The newest instants are the present, which nobody who looks elsewhere may disturb.
        let present =
            self.lines.iter().enumerate().max_by_key(|(_, line)| line.instant()).map(|(idx, _)| idx);
        let others = self.lines.iter().enumerate().filter(|(idx, _)| Some(*idx) != present);
        let oldest = others.min_by_key(|(_, line)| line.used);
        let idx = oldest.map_or(0, |(idx, _)| idx);
        self.lines[idx] = begun;
        idx
    }
}
