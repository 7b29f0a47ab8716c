//! A place in scene time that moves: what several operators and walls look at together.
//!
//! Arithmetic alone: where it stands follows from what was asked of it and how much time has passed since, so any number
//! of callers see the same. Times of the machine flow in as monotonic durations; knows no clock, no camera, no frame.

use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// Fastest that a playhead moves either way, seconds of scene time a second.
pub const MAX_RATE: f64 = 8.0;

/// A place in scene time that stands, moves, or is the present.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playhead {
    anchor: Anchor,
    rate: f64,
    range: Option<(Timestamp, Timestamp)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Anchor {
    Live,
    Paused(Timestamp),
    /// It was there at that monotonic time.
    Playing(Timestamp, Duration),
}

/// What a playhead does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PlayheadMode {
    /// It is the present.
    Live,
    /// It moves.
    Playing,
    /// It stands.
    Paused,
}

/// Where a playhead may be: what was seen first and last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// The earliest instant that anything is kept of, if anything is.
    pub first: Option<Timestamp>,
    /// The present.
    pub live: Timestamp,
}

impl Default for Playhead {
    fn default() -> Self {
        Self { anchor: Anchor::Live, rate: 1.0, range: None }
    }
}

impl Playhead {
    /// One that does what another did, which stood at `position` at monotonic time `now`.
    ///
    /// # Panics
    /// As [`Self::set_rate`] and [`Self::set_range`].
    #[must_use]
    pub fn again(
        mode: PlayheadMode,
        (position, now): (Timestamp, Duration),
        rate: f64,
        range: Option<(Timestamp, Timestamp)>,
    ) -> Self {
        assert!(rate.abs() <= MAX_RATE && rate != 0.0, "a rate from -8 to 8 and not 0");
        assert!(range.is_none_or(|(from, to)| from < to), "a stretch has a length");
        let anchor = match mode {
            PlayheadMode::Live => Anchor::Live,
            PlayheadMode::Paused => Anchor::Paused(position),
            PlayheadMode::Playing => Anchor::Playing(position, now),
        };
        Self { anchor, rate, range }
    }

    /// What it does.
    #[must_use]
    pub const fn mode(&self) -> PlayheadMode {
        match self.anchor {
            Anchor::Live => PlayheadMode::Live,
            Anchor::Paused(_) => PlayheadMode::Paused,
            Anchor::Playing(..) => PlayheadMode::Playing,
        }
    }

    /// Seconds of scene time a second, -8 to 8, never 0; in force while it plays.
    #[must_use]
    pub const fn rate(&self) -> f64 {
        self.rate
    }

    /// The stretch that it repeats.
    #[must_use]
    pub const fn range(&self) -> Option<(Timestamp, Timestamp)> {
        self.range
    }

    /// Where it stands at monotonic time `now`: never before the first that is kept, never after the present, and
    /// within the stretch that it repeats.
    #[must_use]
    pub fn position(&self, now: Duration, extent: Extent) -> Timestamp {
        let position = match self.anchor {
            Anchor::Live => return extent.live,
            Anchor::Paused(position) => position,
            Anchor::Playing(from, since) => {
                let passed_nanos = now.saturating_sub(since).as_nanos() as f64 * self.rate;
                // A cast from float saturates.
                self.wrapped(from.saturating_add_nanos(passed_nanos.round() as i64))
            }
        };
        let first = extent.first.unwrap_or(position).min(extent.live);
        position.clamp(first, extent.live)
    }

    fn wrapped(&self, position: Timestamp) -> Timestamp {
        let Some((from, to)) = self.range else { return position };
        let length = to.nanos_since(from).max(1);
        from.saturating_add_nanos(position.nanos_since(from).rem_euclid(length))
    }

    /// Goes to the present and stays there.
    pub const fn go_live(&mut self) {
        self.anchor = Anchor::Live;
    }

    /// Goes to `position`; plays on from there if it played, and stands there if it stood or was the present.
    pub fn seek(&mut self, position: Timestamp, now: Duration) {
        self.anchor = match self.anchor {
            Anchor::Playing(..) => Anchor::Playing(position, now),
            Anchor::Live | Anchor::Paused(_) => Anchor::Paused(position),
        };
    }

    /// Stands where it is.
    pub fn pause(&mut self, now: Duration, extent: Extent) {
        self.anchor = Anchor::Paused(self.position(now, extent));
    }

    /// Plays from where it is.
    pub fn play(&mut self, now: Duration, extent: Extent) {
        self.anchor = Anchor::Playing(self.position(now, extent), now);
    }

    /// Plays so fast from now on; where it plays, it goes on from where it is.
    ///
    /// # Panics
    /// When `rate` is not finite, 0, or beyond [`MAX_RATE`]: callers have refused that.
    pub fn set_rate(&mut self, rate: f64, now: Duration, extent: Extent) {
        assert!(rate.abs() <= MAX_RATE && rate != 0.0, "a rate from -8 to 8 and not 0");
        if self.mode() == PlayheadMode::Playing {
            self.play(now, extent);
        }
        self.rate = rate;
    }

    /// Repeats the stretch from the first to the second instant while it plays, or none.
    ///
    /// # Panics
    /// When the second is not after the first: callers have refused that.
    pub fn set_range(&mut self, range: Option<(Timestamp, Timestamp)>, now: Duration, extent: Extent) {
        assert!(range.is_none_or(|(from, to)| from < to), "a stretch has a length");
        if self.mode() == PlayheadMode::Playing {
            self.play(now, extent);
        }
        self.range = range;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const EXTENT: Extent =
        Extent { first: Some(Timestamp::from_nanos(0)), live: Timestamp::from_nanos(100_000_000_000) };

    fn secs(secs: i64) -> Timestamp {
        Timestamp::from_nanos(secs * 1_000_000_000)
    }

    #[test]
    fn it_plays_either_way_and_stops_at_both_ends() {
        let mut playhead = Playhead::default();
        let at = |playhead: &Playhead, now: u64| playhead.position(Duration::from_secs(now), EXTENT);
        assert_eq!((at(&playhead, 5), playhead.mode()), (EXTENT.live, PlayheadMode::Live));
        playhead.seek(secs(40), Duration::from_secs(5));
        assert_eq!((at(&playhead, 9), playhead.mode()), (secs(40), PlayheadMode::Paused));
        playhead.play(Duration::from_secs(10), EXTENT);
        assert_eq!(at(&playhead, 12), secs(42));
        playhead.set_rate(8.0, Duration::from_secs(12), EXTENT);
        assert_eq!((at(&playhead, 12), at(&playhead, 15)), (secs(42), secs(66)));
        assert_eq!(at(&playhead, 60), EXTENT.live, "the present is the end");
        playhead.set_rate(-1.0, Duration::from_secs(60), EXTENT);
        assert_eq!((at(&playhead, 61), at(&playhead, 161)), (secs(99), secs(0)));
        playhead.pause(Duration::from_secs(71), EXTENT);
        assert_eq!(at(&playhead, 999), secs(89));
        playhead.seek(secs(500), Duration::from_secs(1000));
        assert_eq!(at(&playhead, 1000), EXTENT.live);
        playhead.go_live();
        assert_eq!(at(&playhead, 1000), EXTENT.live);
    }

    #[test]
    fn a_stretch_is_repeated_either_way() {
        let mut playhead = Playhead::default();
        playhead.seek(secs(12), Duration::ZERO);
        playhead.set_range(Some((secs(10), secs(14))), Duration::ZERO, EXTENT);
        playhead.play(Duration::ZERO, EXTENT);
        let at = |playhead: &Playhead, now: u64| playhead.position(Duration::from_secs(now), EXTENT);
        let seen: Vec<_> = (0..7).map(|now| at(&playhead, now)).collect();
        assert_eq!(seen, [12, 13, 10, 11, 12, 13, 10].map(secs));
        playhead.set_rate(-2.0, Duration::from_secs(7), EXTENT);
        assert_eq!([at(&playhead, 7), at(&playhead, 8)], [secs(11), secs(13)]);
        playhead.set_range(None, Duration::from_secs(8), EXTENT);
        assert_eq!(at(&playhead, 9), secs(11));
    }

    proptest! {
        #[test]
        fn it_never_leaves_what_there_is(
            steps in prop::collection::vec((0_u8..6, -300_i64..300, -8.0_f64..8.0, 0_u64..50), 1..40),
            first in prop::option::of(-50_i64..150),
        ) {
            let mut playhead = Playhead::default();
            let extent = Extent { first: first.map(secs), ..EXTENT };
            let mut now = Duration::ZERO;
            for (step, place, rate, passed) in steps {
                now += Duration::from_secs(passed);
                match step {
                    0 => playhead.seek(secs(place), now),
                    1 => playhead.play(now, extent),
                    2 => playhead.pause(now, extent),
                    3 => playhead.set_rate(if rate == 0.0 { 1.0 } else { rate }, now, extent),
                    4 => playhead.set_range(Some((secs(place), secs(place + 7))), now, extent),
                    _ => playhead.go_live(),
                }
                let before = playhead.position(now, extent);
                prop_assert!(before <= extent.live && before >= secs(first.unwrap_or(i64::MIN / 1_000_000_000)).min(extent.live));
                // What is asked of it takes effect from where it is.
                let mut paused = playhead;
                paused.pause(now, extent);
                prop_assert_eq!(paused.position(now + Duration::from_secs(3), extent), before);
            }
        }
    }
}
