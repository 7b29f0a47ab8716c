//! Gathers who is where before one set of a scene's cameras, instant by instant, until it is written: a sighting that is over once, one
//! that goes on again and again, so that a daemon that is killed loses little.

use std::collections::VecDeque;
use videofields_picture::fuse::{EntityPath, Stand};
use videofields_recording::store::{EntityRecord, SpanChange};
use videofields_vision::clock::Timestamp;

/// Scene time after which who was not seen is gone; whoever comes back with the same id begins another sighting. A break of the same
/// length ends a span.
pub(super) const GONE_NANOS: i64 = 3_000_000_000;

/// Time that goes back by less is that of a camera that lagged: nothing is gathered until it is over. By more, clocks were set.
const SET_BACK_NANOS: i64 = 10_000_000_000;

/// Sightings that wait for a database that fails; older ones are lost. With the longest paths, some 60 MB; usually 1 MB.
const MAX_WAITING: usize = 4096;

/// Spans that wait so; older ones are lost.
const MAX_SPANS: usize = 16;

/// Whoever was seen fewer times is left out: most of it is nobody.
const LEAST_SEEN: u64 = 2;

/// Somebody at one instant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Placed {
    pub(super) id: u64,
    pub(super) height_m: f64,
    pub(super) stand: Stand,
}

/// Sightings that are gathered and not yet written.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    /// Spans that are over, the earliest first.
    ended: VecDeque<Span>,
    /// The span that goes on.
    current: Option<Span>,
    /// Entities that are there, of the span that goes on.
    followed: Vec<Followed>,
    /// The end of what was written.
    written_to: Option<Timestamp>,
    n_lost: u64,
}

/// Part of a span, as it is written.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unwritten {
    pub(super) change: SpanChange,
    pub(super) records: Vec<EntityRecord>,
    /// Number of those that are over, from the first on; the others go on.
    n_over: usize,
}

#[derive(Debug)]
struct Span {
    /// Its number, once it was written.
    id: Option<i64>,
    began_at: Timestamp,
    ended_at: Timestamp,
    /// Sightings that are over and not yet written.
    over: Vec<EntityRecord>,
}

#[derive(Debug)]
struct Followed {
    id: u64,
    path: EntityPath,
    height_m: f64,
    n_seen: u64,
    is_written: bool,
}

impl Gathered {
    /// Takes who was where at an instant; of one that is known already, who was not known to be there.
    pub(super) fn observe(&mut self, instant: Timestamp, placed: Vec<Placed>) {
        if let Some(span) = &self.current {
            let passed = instant.nanos_since(span.ended_at);
            if (-SET_BACK_NANOS..0).contains(&passed) {
                return;
            }
            if !(0..=GONE_NANOS).contains(&passed) {
                self.end();
            }
        }
        let mut span = self.current.take().unwrap_or_else(|| Span {
            id: None,
            began_at: instant,
            ended_at: instant,
            over: Vec::new(),
        });
        span.ended_at = instant;
        for of in placed {
            self.follow(instant, of);
        }
        let is_gone = |of: &mut Followed| instant.nanos_since(of.path.ended_at()) > GONE_NANOS;
        span.over.extend(self.followed.extract_if(.., is_gone).filter_map(|of| of.record()));
        self.current = Some(span);
        self.lose_surplus();
    }

    fn follow(&mut self, instant: Timestamp, Placed { id, height_m, stand }: Placed) {
        match self.followed.iter_mut().find(|of| of.id == id) {
            Some(of) if of.path.ended_at() == instant => {}
            Some(of) => {
                of.path.add(instant, stand);
                of.n_seen += 1;
                (of.height_m, of.is_written) = (height_m, false);
            }
            None => {
                let Some(path) = EntityPath::new(instant, stand) else { return };
                self.followed.push(Followed { id, path, height_m, n_seen: 1, is_written: false });
            }
        }
    }

    /// Ends all that goes on: what comes is of another time, or concluded otherwise.
    pub(super) fn end(&mut self) {
        let gone = std::mem::take(&mut self.followed);
        let Some(mut span) = self.current.take() else { return };
        span.over.extend(gone.iter().filter_map(Followed::record));
        self.written_to = None;
        self.ended.push_back(span);
        self.lose_surplus();
    }

    /// Returns what is not written yet, to be written by whoever asks, and then to be told of by [`Self::note_written`] or
    /// [`Self::take_back`]. A span of a single instant is nothing yet.
    pub(super) fn unwritten(&mut self) -> Vec<Unwritten> {
        let ended = self.ended.drain(..).filter(|span| span.began_at < span.ended_at);
        let mut all: Vec<Unwritten> = ended
            .map(|span| Unwritten { change: span.change(), records: span.over, n_over: usize::MAX })
            .collect();
        if let Some(span) = self.current.as_mut().filter(|span| span.began_at < span.ended_at) {
            let mut records = std::mem::take(&mut span.over);
            let n_over = records.len();
            records.extend(self.followed.iter().filter(|of| !of.is_written).filter_map(Followed::record));
            self.followed.iter_mut().for_each(|of| of.is_written = true);
            all.push(Unwritten { change: span.change(), records, n_over });
        }
        all
    }

    /// Notes under which number a span was written that began so.
    pub(super) fn note_written(&mut self, change: &SpanChange, id: i64) {
        let spans = self.ended.iter_mut().chain(&mut self.current);
        // One that ended meanwhile goes on under the same number.
        spans
            .filter(|span| span.began_at == change.began_at && span.id == change.id)
            .for_each(|span| span.id = Some(id));
        self.written_to = self.written_to.max(Some(change.ended_at));
    }

    /// Takes back what could not be written.
    pub(super) fn take_back(&mut self, unwritten: Vec<Unwritten>) {
        for Unwritten { change, mut records, n_over } in unwritten.into_iter().rev() {
            records.truncate(n_over);
            let is_it = |span: &&mut Span| span.began_at == change.began_at && span.id == change.id;
            match self.ended.iter_mut().chain(&mut self.current).find(is_it) {
                Some(span) => span.over.splice(..0, records).for_each(drop),
                None => {
                    let SpanChange { id, began_at, ended_at } = change;
                    self.ended.push_front(Span { id, began_at, ended_at, over: records });
                }
            }
        }
        self.followed.iter_mut().for_each(|of| of.is_written = false);
        self.lose_surplus();
    }

    /// Lets go of the oldest of what waits, where that is too much.
    fn lose_surplus(&mut self) {
        while self.ended.len() > MAX_SPANS {
            self.n_lost += self.ended.pop_front().map_or(0, |lost| lost.over.len() as u64);
        }
        for span in self.ended.iter_mut().chain(&mut self.current) {
            let n_surplus = span.over.len().saturating_sub(MAX_WAITING);
            span.over.drain(..n_surplus);
            self.n_lost += n_surplus as u64;
        }
    }

    /// Returns how many sightings were lost since this was asked for last.
    pub(super) const fn take_lost(&mut self) -> u64 {
        std::mem::replace(&mut self.n_lost, 0)
    }

    /// Tells that something of `from` or later, of what was gathered, may not be written yet.
    pub(super) fn is_news_from(&self, from: Timestamp) -> bool {
        let ends = self.current.as_ref().map(|span| span.ended_at);
        !self.ended.is_empty() || (ends > self.written_to && ends >= Some(from))
    }
}

impl Span {
    const fn change(&self) -> SpanChange {
        SpanChange { id: self.id, began_at: self.began_at, ended_at: self.ended_at }
    }
}

impl Followed {
    /// Returns what is written; none of whom was hardly seen.
    fn record(&self) -> Option<EntityRecord> {
        (self.n_seen >= LEAST_SEEN).then(|| record(self.id, &self.path, self.height_m))
    }
}

/// Returns a sighting as it is written.
pub(super) fn record(id: u64, path: &EntityPath, height_m: f64) -> EntityRecord {
    EntityRecord {
        id,
        began_at: path.began_at(),
        ended_at: path.ended_at(),
        height_mm: (height_m * 1e3).round().clamp(0.0, 1e6) as u32,
        path: path.encode(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn at(millis: i64) -> Timestamp {
        Timestamp::from_nanos(millis * 1_000_000)
    }

    fn placed(id: u64, millis: i64) -> Placed {
        let stand = Stand { foot_in_world: DVec3::new(1e-3 * millis as f64, 0.0, 0.0), cameras: vec![0] };
        Placed { id, height_m: 1.75, stand }
    }

    /// Shows `ids` every 0.2 s from the one time to the other, milliseconds.
    fn show(gathered: &mut Gathered, (from, to): (i64, i64), ids: &[u64]) {
        for millis in (from..to).step_by(200) {
            gathered.observe(at(millis), ids.iter().map(|id| placed(*id, millis)).collect());
        }
    }

    type Written = Vec<(Option<i64>, [i64; 2], Vec<(u64, [i64; 2])>)>;

    fn written(gathered: &mut Gathered) -> Written {
        let millis = |at: Timestamp| at.as_nanos() / 1_000_000;
        let mut all = Vec::new();
        for Unwritten { change, records, .. } in gathered.unwritten() {
            let of = |of: &EntityRecord| (of.id, [of.began_at, of.ended_at].map(millis));
            let ends = [change.began_at, change.ended_at].map(millis);
            assert!(records.iter().all(|of| of.height_mm == 1750));
            all.push((change.id, ends, records.iter().map(of).collect()));
            gathered.note_written(&change, change.id.unwrap_or(70 + all.len() as i64));
        }
        assert!(gathered.take_lost() == 0 && !gathered.is_news_from(at(i64::MIN / 1_000_000)));
        all
    }

    #[test]
    fn whoever_is_there_is_written_again_until_they_are_gone() {
        let mut gathered = Gathered::default();
        show(&mut gathered, (0, 2000), &[1, 2]);
        assert_eq!(written(&mut gathered), [(None, [0, 1800], vec![(1, [0, 1800]), (2, [0, 1800])])]);
        show(&mut gathered, (2000, 4000), &[2]);
        assert_eq!(written(&mut gathered), [(Some(71), [0, 3800], vec![(2, [0, 3800])])]);
        // A camera's frame of the same instant comes later, and shows one more.
        gathered.observe(at(3800), vec![placed(2, 3800), placed(3, 3800)]);
        gathered.observe(at(3800), vec![placed(3, 3800)]);
        // Somebody who comes back soon was there all the time; later, they are seen anew.
        show(&mut gathered, (4000, 4400), &[1]);
        show(&mut gathered, (4400, 9000), &[]);
        show(&mut gathered, (9000, 9400), &[1]);
        let all = written(&mut gathered);
        let expected = vec![(2, [0, 3800]), (1, [0, 4200]), (1, [9000, 9200])];
        assert_eq!(all, [(Some(71), [0, 9200], expected)]);
        assert_eq!(written(&mut gathered), [(Some(71), [0, 9200], vec![])]);
    }

    #[test]
    fn a_break_or_clocks_that_were_set_begin_another_span() {
        let mut gathered = Gathered::default();
        show(&mut gathered, (60_000, 61_000), &[1]);
        // A camera that lagged takes now back a little.
        show(&mut gathered, (59_000, 60_600), &[1, 2]);
        show(&mut gathered, (66_000, 66_400), &[1]);
        show(&mut gathered, (10_000, 10_400), &[1]);
        let spans = written(&mut gathered);
        let of = |from: i64, to: i64| (None, [from, to], vec![(1, [from, to])]);
        assert_eq!(spans, [of(60_000, 60_800), of(66_000, 66_200), of(10_000, 10_200)]);
    }

    #[test]
    fn who_was_hardly_seen_is_left_out() {
        let mut gathered = Gathered::default();
        show(&mut gathered, (0, 200), &[1]);
        show(&mut gathered, (200, 9000), &[]);
        assert_eq!(written(&mut gathered), [(None, [0, 8800], vec![])]);
    }

    #[test]
    fn a_database_that_fails_costs_no_memory_and_what_waits_is_written_then() {
        let mut gathered = Gathered::default();
        for i in 0..MAX_WAITING as i64 + 50 {
            show(&mut gathered, (4000 * i, 4000 * i + 400), &[i as u64]);
            show(&mut gathered, (4000 * i + 400, 4000 * i + 4000), &[]);
        }
        let waiting = gathered.unwritten();
        gathered.take_back(waiting.clone());
        assert_eq!(gathered.unwritten(), waiting, "it waits as it was");
        assert_eq!((waiting[0].records.len(), gathered.take_lost()), (MAX_WAITING, 50));
        for i in 0..MAX_SPANS as i64 + 3 {
            show(&mut gathered, (60_000_000 + 9000 * i, 60_000_400 + 9000 * i), &[1]);
        }
        let n_lost = gathered.take_lost();
        assert!((2..=3).contains(&n_lost) && gathered.unwritten().len() == MAX_SPANS + 1, "{n_lost}");
    }

    #[test]
    fn what_ends_while_it_is_written_goes_on_under_the_same_number() {
        let mut gathered = Gathered::default();
        show(&mut gathered, (0, 1000), &[1]);
        assert!(gathered.is_news_from(at(500)) && !gathered.is_news_from(at(801)));
        let in_hand = gathered.unwritten();
        gathered.end();
        gathered.note_written(&in_hand[0].change, 7);
        assert_eq!(gathered.unwritten()[0].change.id, Some(7));
        // A single instant is no time.
        gathered.observe(at(60_000), vec![placed(1, 60_000)]);
        gathered.end();
        assert_eq!(gathered.unwritten(), []);
    }
}
