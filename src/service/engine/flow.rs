//! Among whom the renderer's time is shared, and whose turn is next.
//!
//! Start-time fair queueing (`[GVC96]` Goyal, Vin, Cheng 1996, Start-time fair queuing: a scheduling algorithm for integrated services
//! packet switching networks): a turn begins, in virtual time, where the last one of its flow ended or now, whichever is later; whose turn
//! begins earliest is next; a turn's length is what it took. Virtual time is never before the earliest beginning of those who wait
//! (`[BZ97]` Bennett, Zhang 1997, Hierarchical packet fair queueing algorithms), so that nobody saves up turns. Beginnings within one
//! [`ROUND`] count as equal, and among equals what is one piece goes before what is several. The same again within a flow, between pictures
//! of one piece and of several.

use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

/// Beginnings that lie no further apart than this count as equal: about what five pieces take on a small machine. A flow with less to do than
/// others so never waits for more than the piece that is being drawn, and none gets ahead by more than this.
pub(super) const ROUND: Duration = Duration::from_millis(200);

/// Callers among whom the renderer's time is not shared further.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub enum Flow {
    /// Everybody whom nothing tells apart.
    #[default]
    Common,
    /// A user.
    User(Arc<str>),
    /// Whoever asks from an address, where there are no users.
    Address(IpAddr),
}

/// On whose behalf a picture is asked for, and since when.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Asking {
    /// The callers in whose turns it is drawn.
    pub flow: Flow,
    /// Moment at which the caller began to wait, by the engine's clock; none where that is now.
    pub since: Option<Duration>,
}

impl From<Flow> for Asking {
    fn from(flow: Flow) -> Self {
        Self { flow, since: None }
    }
}

/// Kinds of pictures within a flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    /// Drawn in one piece.
    Small,
    /// Drawn in several.
    Large,
}

/// Virtual times of one flow.
#[derive(Debug)]
struct Times {
    flow: Flow,
    /// The end of its last turn.
    end: Duration,
    /// Virtual time within it.
    within: Duration,
    /// By kind, the end of the last turn within it.
    ends: [Duration; 2],
}

/// A turn that a flow could have next, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Offer<T: Ord> {
    /// Kind of the picture.
    pub(super) kind: Kind,
    /// The picture, the earliest first.
    pub(super) what: T,
}

/// See the module. Flows are remembered while they are ahead of others.
#[derive(Debug, Default)]
pub(super) struct Turns {
    now: Duration,
    times: Vec<Times>,
}

const fn round(begin: Duration) -> u128 {
    begin.as_nanos() / ROUND.as_nanos()
}

impl Turns {
    /// Notes that a flow has something to do.
    pub(super) fn note(&mut self, flow: &Flow) {
        if !self.times.iter().any(|times| times.flow == *flow) {
            let ends = [Duration::ZERO; 2];
            self.times.push(Times { flow: flow.clone(), end: self.now, within: Duration::ZERO, ends });
        }
    }

    /// Returns whose turn it is and what is to be done, where `offer` tells what a flow would do of a kind. Whoever is not noted has
    /// nothing to do.
    pub(super) fn next<T: Ord + Copy>(
        &mut self,
        offer: impl Fn(&Flow, Kind) -> Option<T>,
    ) -> Option<(Flow, Offer<T>)> {
        let mut earliest: Option<Duration> = None;
        let mut best: Option<(u128, Offer<T>, usize)> = None;
        for (idx, times) in self.times.iter().enumerate() {
            let Some(own) = times.choose(|kind| offer(&times.flow, kind)) else { continue };
            let begin = times.end.max(self.now);
            earliest = Some(earliest.map_or(begin, |known| known.min(begin)));
            let rank = (round(begin), own, idx);
            if best.as_ref().is_none_or(|known| rank < *known) {
                best = Some(rank);
            }
        }
        let (_, own, idx) = best?;
        self.now = self.now.max(earliest?);
        let times = &mut self.times[idx];
        let earliest_within = [Kind::Small, Kind::Large]
            .into_iter()
            .filter(|kind| offer(&times.flow, *kind).is_some())
            .map(|kind| times.ends[kind as usize])
            .min();
        times.within = times.within.max(earliest_within.unwrap_or_default());
        Some((times.flow.clone(), own))
    }

    /// Notes that a turn of a flow's took so long.
    pub(super) fn charge(&mut self, flow: &Flow, kind: Kind, took: Duration) {
        let now = self.now;
        let Some(times) = self.times.iter_mut().find(|times| times.flow == *flow) else { return };
        times.end = times.end.max(now).saturating_add(took);
        let end = &mut times.ends[kind as usize];
        *end = (*end).max(times.within).saturating_add(took);
    }

    /// Forgets flows that have nothing to do and are ahead of nobody; all of them where none has anything to do.
    pub(super) fn tidy(&mut self, is_waiting: impl Fn(&Flow) -> bool) {
        let is_idle = !self.times.iter().any(|times| is_waiting(&times.flow));
        let now = self.now;
        self.times.retain(|times| !is_idle && (times.end > now || is_waiting(&times.flow)));
    }

    /// Returns the flows that are remembered.
    pub(super) fn flows(&self) -> impl Iterator<Item = &Flow> {
        self.times.iter().map(|times| &times.flow)
    }
}

impl Times {
    fn choose<T: Ord + Copy>(&self, offer: impl Fn(Kind) -> Option<T>) -> Option<Offer<T>> {
        let of = |kind: Kind| {
            let begin = self.ends[kind as usize].max(self.within);
            offer(kind).map(|what| (round(begin), Offer { kind, what }))
        };
        [of(Kind::Small), of(Kind::Large)].into_iter().flatten().min().map(|(_, own)| own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn user(name: &str) -> Flow {
        Flow::User(name.into())
    }

    /// Work that flows have: by name and kind, how long each of their turns takes.
    struct Bench {
        turns: Turns,
        work: Vec<(&'static str, Kind, u32)>,
    }

    impl Bench {
        fn new(work: &[(&'static str, Kind, u32)]) -> Self {
            let mut turns = Turns::default();
            work.iter().for_each(|(name, ..)| turns.note(&user(name)));
            Self { turns, work: work.to_vec() }
        }

        /// Gives one turn; who had it.
        fn turn(&mut self) -> (&'static str, Kind) {
            let find =
                |flow: &Flow, kind: Kind| self.work.iter().position(|of| user(of.0) == *flow && of.1 == kind);
            let (flow, Offer { kind, what }) = self.turns.next(find).expect("somebody waits");
            let (name, of, ms) = self.work[what];
            assert!(user(name) == flow && of == kind);
            self.turns.charge(&flow, kind, MS * ms);
            (name, kind)
        }

        /// The time that each has had after so many turns, milliseconds.
        fn spent(&mut self, n_turns: usize) -> Vec<u32> {
            let mut spent = vec![0; self.work.len()];
            for _ in 0..n_turns {
                let (name, kind) = self.turn();
                let place = self.work.iter().position(|of| of.0 == name && of.1 == kind).expect("known");
                spent[place] += self.work[place].2;
            }
            spent
        }
    }

    #[test]
    fn time_is_shared_whatever_turns_take() {
        let mut bench =
            Bench::new(&[("a", Kind::Large, 300), ("b", Kind::Small, 20), ("c", Kind::Large, 700)]);
        let spent = bench.spent(2000);
        let [least, most] = [spent.iter().min().unwrap(), spent.iter().max().unwrap()];
        assert!(most - least <= 700 + 2 * ROUND.as_millis() as u32, "{spent:?}");
    }

    #[test]
    fn who_comes_with_little_waits_for_one_turn_at_most() {
        let mut bench = Bench::new(&[("a", Kind::Large, 300), ("b", Kind::Large, 500)]);
        bench.spent(31);
        for _ in 0..10 {
            bench.turns.note(&user("c"));
            bench.work.push(("c", Kind::Small, 20));
            assert_eq!(bench.turn(), ("c", Kind::Small));
            bench.work.pop();
            bench.turns.tidy(|flow| *flow != user("c"));
            bench.turn();
        }
    }

    #[test]
    fn nobody_saves_up_turns_and_nobody_is_charged_for_a_time_when_nobody_waited() {
        let mut bench = Bench::new(&[("a", Kind::Large, 300), ("b", Kind::Large, 300)]);
        // b has nothing to do for long.
        let b = bench.work.pop().unwrap();
        bench.spent(50);
        bench.work.push(b);
        let turns: Vec<&str> = (0..6).map(|_| bench.turn().0).collect();
        assert_eq!(turns.iter().filter(|name| **name == "a").count(), 3, "{turns:?}");
        bench.turns.tidy(|_| false);
        assert_eq!(bench.turns.flows().count(), 0);
        bench.turns.note(&user("a"));
        bench.turns.note(&user("b"));
        assert_eq!(bench.turn().0, "a", "the first of equals");
    }

    #[test]
    fn small_ones_of_a_flow_wait_for_one_turn_of_its_large_ones_and_have_half_of_its_time() {
        let mut bench =
            Bench::new(&[("a", Kind::Large, 300), ("a", Kind::Small, 30), ("b", Kind::Large, 300)]);
        let spent = bench.spent(1500);
        let [large, small, other] = spent[..] else { panic!("three") };
        assert!(large.abs_diff(small) <= 300 + 2 * ROUND.as_millis() as u32, "{spent:?}");
        assert!((large + small).abs_diff(other) <= 300 + 2 * ROUND.as_millis() as u32, "{spent:?}");
        let mut alone = Bench::new(&[("a", Kind::Large, 300)]);
        alone.spent(20);
        alone.work.push(("a", Kind::Small, 30));
        assert_eq!(alone.turn().1, Kind::Small);
    }

    #[test]
    fn who_was_away_comes_before_nobody_for_that() {
        let mut bench = Bench::new(&[("a", Kind::Large, 300), ("b", Kind::Large, 300)]);
        bench.spent(2);
        let a = bench.work.remove(0);
        bench.spent(50);
        // A flow that had a turn long ago begins no earlier than one that comes now: the small picture goes first.
        bench.work.push(a);
        bench.work.push(("c", Kind::Small, 20));
        bench.turns.note(&user("c"));
        assert_eq!(bench.turn(), ("c", Kind::Small));
    }

    #[test]
    fn a_kind_saves_up_no_turns_while_a_flow_has_none_of_it() {
        let mut bench = Bench::new(&[("a", Kind::Large, 300)]);
        bench.spent(20);
        bench.work.push(("a", Kind::Small, 30));
        let turns: Vec<Kind> = (0..40).map(|_| bench.turn().1).collect();
        let n_large = turns.iter().filter(|kind| **kind == Kind::Large).count();
        assert!(n_large >= 2, "half of the time: {turns:?}");
    }

    #[test]
    fn who_leaves_and_comes_back_is_still_ahead() {
        let mut bench = Bench::new(&[("a", Kind::Large, 3000), ("b", Kind::Large, 300)]);
        assert_eq!(bench.turn().0, "a");
        let a = bench.work.remove(0);
        bench.turns.tidy(|flow| *flow == user("b"));
        assert_eq!(bench.turn().0, "b");
        bench.work.push(a);
        bench.turns.note(&user("a"));
        let turns: Vec<&str> = (0..8).map(|_| bench.turn().0).collect();
        assert!(turns.iter().all(|name| *name == "b"), "{turns:?}");
    }
}
