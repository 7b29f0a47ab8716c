//! What of a camera's frames arrives, and when.
//!
//! The named delivery effects go in; one [`Arrival`] for every frame (two for a duplicated one) comes out, in the
//! order in which they arrive. Knows nothing of pictures.

use super::effects::{ClockError, Draw, Effects, Entries};
use serde::Serialize;

/// What became of a frame on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Fate {
    /// Arrived whole, once, in its time.
    Delivered,
    /// Never arrived.
    Dropped,
    /// Arrived twice; both arrivals say so.
    Duplicated,
    /// Arrived damaged.
    Corrupted,
    /// Arrived later than it should have.
    Late,
}

/// A frame's arrival, or that there is none; a line of `delivery.jsonl`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Arrival {
    /// Number of the frame, from 0.
    pub frame: u64,
    /// 0, or 1 for the second arrival of a duplicated frame.
    pub copy: u8,
    /// When it was captured, true time, seconds from the clips' start.
    pub captured_secs: f64,
    /// When it was captured by the camera's own clock, seconds from the true start.
    pub stamped_secs: f64,
    /// Where it lies in the clip, seconds from the clip's start; none if it was dropped.
    pub clip_secs: Option<f64>,
    /// When it arrived, true time, seconds from the clips' start; none if it was dropped.
    pub arrived_secs: Option<f64>,
    /// What became of it; `delivered` stands alone, others may stand together.
    pub fates: Vec<Fate>,
}

impl Arrival {
    /// Makes it of a frame that is captured so much later than its camera's times say, and arrives so much later, seconds.
    pub(super) fn shift(&mut self, late_secs: f64) {
        self.captured_secs += late_secs;
        self.arrived_secs = self.arrived_secs.map(|secs| secs + late_secs);
    }

    /// Whether this became of it.
    #[must_use]
    pub fn has(&self, fate: Fate) -> bool {
        self.fates.contains(&fate)
    }
}

/// The delivery of one camera's frames.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// The camera's clock.
    pub clock: ClockError,
    /// In order of arrival, dropped frames where they would have been.
    pub arrivals: Vec<Arrival>,
}

/// What becomes of `n_frames` frames that a camera captures at `rate_hz`; `draw` is the camera's.
#[must_use]
pub fn deliver(effects: &Effects, draw: Draw, n_frames: u64, rate_hz: f64, entries: &Entries) -> Delivery {
    let tally = entries.tally();
    let clock = effects.clock.as_ref().map_or_else(ClockError::default, |clock| clock.error(draw, &tally));
    let clip_start_secs = clock.shown_secs(0.0);
    let mut arrivals = Vec::new();
    let mut latest_secs = f64::NEG_INFINITY;
    for frame in 0..n_frames {
        let captured_secs = frame as f64 / rate_hz;
        let stamped_secs = clock.shown_secs(captured_secs);
        let mut arrival = Arrival {
            frame,
            copy: 0,
            captured_secs,
            stamped_secs,
            clip_secs: None,
            arrived_secs: None,
            fates: Vec::new(),
        };
        if effects.drop.as_ref().is_some_and(|drop| drop.loses(draw, frame, &tally)) {
            arrival.fates.push(Fate::Dropped);
            arrivals.push(arrival);
            continue;
        }
        let mut arrived_secs = captured_secs;
        if let Some(jitter) = &effects.jitter {
            arrived_secs += jitter.delay_secs(draw, frame, &tally);
        }
        if let Some(delay_secs) = effects.late.as_ref().and_then(|late| late.delay_secs(draw, frame, &tally))
        {
            arrived_secs += delay_secs;
            arrival.fates.push(Fate::Late);
        }
        // What comes as a stream waits for what went before.
        if !effects.jitter.as_ref().is_some_and(|jitter| jitter.overtakes) {
            arrived_secs = arrived_secs.max(latest_secs);
            latest_secs = arrived_secs;
        }
        if effects.corrupt.as_ref().is_some_and(|corrupt| corrupt.hits(draw, frame, &tally)) {
            arrival.fates.push(Fate::Corrupted);
        }
        let is_double =
            effects.duplicate.as_ref().is_some_and(|duplicate| duplicate.repeats(draw, frame, &tally));
        if is_double {
            arrival.fates.push(Fate::Duplicated);
        }
        if arrival.fates.is_empty() {
            arrival.fates.push(Fate::Delivered);
        }
        let clip_secs = stamped_secs - clip_start_secs;
        arrival.clip_secs = Some(clip_secs);
        arrival.arrived_secs = Some(arrived_secs);
        arrivals.push(arrival.clone());
        if is_double {
            // A file cannot hold two frames of one time: the second stands half a frame later.
            arrival.copy = 1;
            arrival.clip_secs = Some(clip_secs + 0.5 / rate_hz);
            arrivals.push(arrival);
        }
    }
    let order = |arrival: &Arrival| arrival.arrived_secs.unwrap_or(arrival.captured_secs);
    arrivals.sort_by(|a, b| order(a).total_cmp(&order(b)).then(a.frame.cmp(&b.frame)));
    Delivery { clock, arrivals }
}

#[cfg(test)]
mod tests {
    use super::super::effects::{Clock, Corrupt, Drop, Duplicate, EffectKind, Jitter, Late};
    use super::*;

    fn draw() -> Draw {
        Draw::of_camera(7, "west")
    }

    #[test]
    fn without_effects_everything_arrives_at_once_and_nothing_is_entered() {
        let entries = Entries::default();
        let delivery = deliver(&Effects::default(), draw(), 50, 10.0, &entries);
        assert_eq!(delivery.arrivals.len(), 50);
        for (frame, arrival) in (0..).zip(&delivery.arrivals) {
            let time = frame as f64 / 10.0;
            assert_eq!((arrival.frame, arrival.copy, &arrival.fates[..]), (frame, 0, &[Fate::Delivered][..]));
            assert_eq!((arrival.clip_secs, arrival.arrived_secs), (Some(time), Some(time)));
        }
        assert!(EffectKind::ALL.iter().all(|kind| entries.count(*kind) == 0));
    }

    #[test]
    fn fates_are_what_the_effects_say() {
        let entries = Entries::default();
        let effects = Effects {
            drop: Some(Drop { share: 0.2, burst_frames: 2 }),
            duplicate: Some(Duplicate { share: 0.3 }),
            late: Some(Late { share: 0.1, delay_secs: 1.0 }),
            corrupt: Some(Corrupt { share: 0.2, ..Corrupt::default() }),
            ..Effects::default()
        };
        let delivery = deliver(&effects, draw(), 500, 10.0, &entries);
        let count = |fate| delivery.arrivals.iter().filter(|arrival| arrival.has(fate)).count();
        assert!((60..140).contains(&count(Fate::Dropped)), "{}", count(Fate::Dropped));
        assert!(count(Fate::Duplicated) > 150 && count(Fate::Duplicated).is_multiple_of(2));
        assert!(count(Fate::Late) > 20 && count(Fate::Corrupted) > 40);
        let once = |copy: u8| move |arrival: &&Arrival| arrival.copy == copy;
        let mut frames: Vec<u64> = delivery.arrivals.iter().filter(once(0)).map(|a| a.frame).collect();
        frames.sort_unstable();
        assert_eq!(frames, (0..500).collect::<Vec<_>>(), "every frame has a line");
        // Places in the clip are all different, so that a file can hold them.
        let mut places: Vec<f64> = delivery.arrivals.iter().filter_map(|arrival| arrival.clip_secs).collect();
        places.sort_unstable_by(f64::total_cmp);
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] > 0.04));
        for arrival in &delivery.arrivals {
            assert_eq!(arrival.has(Fate::Dropped), arrival.arrived_secs.is_none());
            assert!(arrival.arrived_secs.is_none_or(|arrived| arrived >= arrival.captured_secs));
        }
    }

    #[test]
    fn a_stream_waits_and_datagrams_overtake() {
        let entries = Entries::default();
        let of = |overtakes| Effects {
            jitter: Some(Jitter { least_delay_secs: 0.0, mean_extra_secs: 0.3, overtakes }),
            ..Effects::default()
        };
        let order = |effects: &Effects| -> Vec<u64> {
            deliver(effects, draw(), 200, 10.0, &entries).arrivals.iter().map(|a| a.frame).collect()
        };
        assert_eq!(order(&of(false)), (0..200).collect::<Vec<_>>());
        assert_ne!(order(&of(true)), (0..200).collect::<Vec<_>>());
    }

    #[test]
    fn clocks_are_wrong_but_clips_begin_at_their_start() {
        let entries = Entries::default();
        let clock = Clock { most_offset_secs: 5.0, most_drift_ppm: 10_000.0 };
        let effects = Effects { clock: Some(clock), ..Effects::default() };
        let delivery = deliver(&effects, draw(), 100, 10.0, &entries);
        let last = &delivery.arrivals[99];
        let drift = 1.0 + delivery.clock.drift_ppm * 1e-6;
        assert!(delivery.clock.offset_secs != 0.0 && drift != 1.0);
        assert!((last.stamped_secs - delivery.clock.offset_secs - 9.9 * drift).abs() < 1e-9);
        assert!((last.clip_secs.unwrap_or(0.0) - 9.9 * drift).abs() < 1e-9);
        assert_eq!(delivery.arrivals[0].clip_secs, Some(0.0));
        assert_eq!(entries.count(EffectKind::Clock), 1);
    }
}
