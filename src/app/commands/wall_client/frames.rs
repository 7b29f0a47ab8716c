//! What came of a wall's frames: which are whole, torn or late.

use super::quantiles;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::Duration;

/// A picture of a tile that came.
pub(super) struct Arrival {
    /// Which of the tiles.
    pub(super) tile: usize,
    pub(super) version: i64,
    pub(super) frame: u64,
    /// The instant shown, in whatever words the daemon has for it.
    pub(super) instant: String,
    /// When it had come, by the monotonic clock.
    pub(super) at: Duration,
    /// From asking for it (or, by WebSocket, from its sending, over the least of all) until it had come.
    pub(super) took: Duration,
    pub(super) n_bytes: usize,
}

/// One frame of the wall.
struct Seen {
    /// By tile.
    instants: Vec<Option<String>>,
    first_at: Duration,
    last_at: Duration,
}

/// Everything that came.
pub(super) struct Tally {
    tiles: Vec<String>,
    way: &'static str,
    time: Duration,
    frames: BTreeMap<(i64, u64), Seen>,
    latencies: Vec<Duration>,
    /// First and last frame of every tile.
    ranges: Vec<Option<[(i64, u64); 2]>>,
    n_bytes: u64,
    n_pictures: u64,
    /// Pictures of another frame than the one asked for.
    pub(super) n_moved_on: u64,
    /// Requests that came to nothing.
    pub(super) n_failed: u64,
}

impl Tally {
    pub(super) fn new(tiles: &[String], way: &'static str) -> Self {
        Self {
            tiles: tiles.to_vec(),
            way,
            time: Duration::ZERO,
            frames: BTreeMap::new(),
            latencies: Vec::new(),
            ranges: vec![None; tiles.len()],
            n_bytes: 0,
            n_pictures: 0,
            n_moved_on: 0,
            n_failed: 0,
        }
    }

    pub(super) fn take(&mut self, arrival: Arrival) {
        let Arrival { tile, version, frame, instant, at, took, n_bytes } = arrival;
        let n = self.tiles.len();
        let seen = self.frames.entry((version, frame)).or_insert_with(|| Seen {
            instants: vec![None; n],
            first_at: at,
            last_at: at,
        });
        seen.instants[tile] = Some(instant);
        seen.last_at = seen.last_at.max(at);
        let range = self.ranges[tile].get_or_insert([(version, frame); 2]);
        range[1] = (version, frame);
        self.latencies.push(took);
        self.n_bytes += n_bytes as u64;
        self.n_pictures += 1;
    }

    /// Notes for how long it was looked.
    pub(super) fn end(&mut self, time: Duration) {
        self.time = time;
    }

    pub(super) fn n_torn(&self) -> usize {
        let is_torn = |seen: &&Seen| {
            let mut instants = seen.instants.iter().flatten();
            let first = instants.next();
            instants.any(|other| Some(other) != first)
        };
        self.frames.values().filter(is_torn).count()
    }

    fn whole(&self) -> impl Iterator<Item = &Seen> {
        self.frames.values().filter(|seen| seen.instants.iter().all(Option::is_some))
    }

    pub(super) fn n_whole(&self) -> usize {
        self.whole().count()
    }

    /// Frames of which some tile never came, though all had begun and none had ended.
    fn n_incomplete(&self) -> usize {
        let began = self.ranges.iter().flatten().map(|range| range[0]).max();
        let ended = self.ranges.iter().flatten().map(|range| range[1]).min();
        let (Some(began), Some(ended)) = (began, ended) else { return self.frames.len() };
        let between = self.frames.iter().filter(|(id, _)| (began..=ended).contains(*id));
        between.filter(|(_, seen)| seen.instants.iter().any(Option::is_none)).count()
    }

    pub(super) fn report(&self, rate_hz: f64) -> Value {
        let spreads: Vec<Duration> =
            self.whole().map(|seen| seen.last_at.saturating_sub(seen.first_at)).collect();
        let seconds = self.time.as_secs_f64().max(1e-9);
        json!({
            "way": self.way,
            "tiles": self.tiles,
            "seconds": seconds,
            "rate_hz": { "asked": rate_hz, "whole_frames": self.n_whole() as f64 / seconds },
            "frames": {
                "whole": self.n_whole(), "torn": self.n_torn(), "incomplete": self.n_incomplete(),
                "pictures": self.n_pictures, "moved_on": self.n_moved_on, "failed": self.n_failed,
            },
            "latency_ms": quantiles(&self.latencies),
            "spread_ms": quantiles(&spreads),
            "bytes": self.n_bytes,
            "bytes_per_second": (self.n_bytes as f64 / seconds).round() as u64,
        })
    }

    /// The report in words.
    pub(super) fn told(&self, rate_hz: f64) -> String {
        let report = self.report(rate_hz);
        let ms = |name: &str| {
            let of = |quantile: &str| {
                report[name][quantile].as_f64().map_or("-".to_owned(), |ms| format!("{ms:.1}"))
            };
            format!("median {} ms, 99 % {} ms, most {} ms", of("p50"), of("p99"), of("max"))
        };
        let frames = &report["frames"];
        let latency = if self.way == "websocket" { "latency over the least" } else { "latency" };
        [
            format!("{} tiles by {} for {:.1} s", self.tiles.len(), self.way, self.time.as_secs_f64()),
            format!(
                "whole frames: {} ({:.2} a second of {rate_hz})",
                frames["whole"],
                report["rate_hz"]["whole_frames"].as_f64().unwrap_or_default()
            ),
            format!("torn frames: {}", frames["torn"]),
            format!("incomplete frames: {}", frames["incomplete"]),
            format!(
                "pictures: {}, of a later frame: {}, failed: {}",
                self.n_pictures, self.n_moved_on, self.n_failed
            ),
            format!("{latency}: {}", ms("latency_ms")),
            format!("first to last tile of a frame: {}", ms("spread_ms")),
            format!("bytes: {} ({} a second)", self.n_bytes, report["bytes_per_second"]),
        ]
        .join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrival(tile: usize, frame: u64, instant: &str, at_ms: u64) -> Arrival {
        let at = Duration::from_millis(at_ms);
        let (instant, took) = (instant.to_owned(), Duration::from_millis(5));
        Arrival { tile, version: 1, frame, instant, at, took, n_bytes: 10 }
    }

    #[test]
    fn frames_are_whole_torn_or_incomplete() {
        let mut tally = Tally::new(&["a".to_owned(), "b".to_owned()], "pull");
        for (tile, frame, instant, at) in [
            (0, 7, "x", 0),
            // Before all have begun.
            (0, 8, "y", 10),
            (1, 8, "y", 14),
            (0, 9, "z", 20),
            (1, 10, "t", 31),
            (0, 10, "u", 30),
            (0, 11, "v", 40),
            (1, 11, "v", 41),
            // After one has ended.
            (0, 12, "w", 50),
        ] {
            tally.take(arrival(tile, frame, instant, at));
        }
        tally.end(Duration::from_secs(2));
        let report = tally.report(10.0);
        assert_eq!((tally.n_whole(), tally.n_torn(), tally.n_incomplete()), (3, 1, 1));
        assert_eq!(report["rate_hz"]["whole_frames"], 1.5);
        assert_eq!(report["spread_ms"], json!({"p50": 1.0, "p99": 4.0, "max": 4.0}));
        assert_eq!((&report["bytes"], &report["bytes_per_second"]), (&json!(90), &json!(45)));
        assert!(tally.told(10.0).contains("torn frames: 1"));
    }
}
