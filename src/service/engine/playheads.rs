//! The playheads that callers share, by name: bounded in number. What outlives the daemon is kept by others.

use super::EngineError;
use serde::{Deserialize, Deserializer, Serialize};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use videofields_recording::timeline::{Extent, MAX_RATE, Playhead, PlayheadMode};
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{Fault, Gatherer};

/// What followers see once no change will come any more.
pub const ENDED: u64 = u64::MAX;

/// Playheads at most, those of all users; how many each may make is the catalog's to say.
pub const MAX_PLAYHEADS: usize = 320;

/// A playhead as callers see it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlayheadState {
    /// Its name.
    pub id: String,
    /// The scene whose time it is a place in.
    pub scene: String,
    /// What it does.
    pub mode: PlayheadMode,
    /// Where it stands now, RFC 3339.
    pub position: String,
    /// Seconds of scene time a second while it plays.
    pub rate: f64,
    /// The stretch that it repeats, RFC 3339.
    #[serde(rename = "loop")]
    pub range: Option<[String; 2]>,
    /// How often it was changed.
    pub version: u64,
}

/// What is asked of a playhead; what is absent stays as it is. Done in this order.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlayheadChange {
    /// The scene.
    pub scene: Option<String>,
    /// The stretch that it repeats; null repeats none.
    #[serde(rename = "loop", deserialize_with = "given")]
    pub range: Option<Option<[String; 2]>>,
    /// `live`, RFC 3339 or nanoseconds.
    pub at: Option<String>,
    /// Seconds of scene time a second, -8 to 8 and not 0.
    pub rate: Option<f64>,
    /// One frame of any of the scene's cameras on (1) or back (-1); it stands there.
    pub step: Option<i8>,
    /// Whether it stands.
    pub paused: Option<bool>,
}

/// Tells null from nothing at all.
fn given<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

/// What a change comes to, once it was read.
#[derive(Debug, Default)]
pub(super) struct Change {
    pub(super) scene: Option<String>,
    range: Option<Option<(Timestamp, Timestamp)>>,
    at: Option<Place>,
    rate: Option<f64>,
    pub(super) step: Option<Step>,
    paused: Option<bool>,
}

#[derive(Clone, Copy, Debug)]
enum Place {
    Live,
    Instant(Timestamp),
}

/// Which way a frame is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    On,
    Back,
}

/// All playheads.
#[derive(Debug)]
pub(super) struct Playheads {
    entries: Mutex<Vec<Entry>>,
    version: watch::Sender<u64>,
}

#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) id: String,
    pub(super) scene: String,
    pub(super) playhead: Playhead,
    version: u64,
}

impl Change {
    /// Reads `body`.
    ///
    /// # Errors
    /// With every fault, each at its JSON pointer.
    pub(super) fn read(body: serde_json::Value) -> Result<Self, EngineError> {
        // serde would take a list for an object's members in their order.
        if !body.is_object() {
            return Err(EngineError::Faults(vec![Fault::new("", "expected an object")]));
        }
        let mut gatherer = Gatherer::default();
        let asked = gatherer.read::<PlayheadChange>(body, "");
        let change = asked.map(|asked| Self::of(asked, &mut gatherer));
        let faults = gatherer.into_faults();
        change.filter(|_| faults.is_empty()).ok_or(EngineError::Faults(faults))
    }

    fn of(asked: PlayheadChange, gatherer: &mut Gatherer) -> Self {
        let mut instant = |text: &str, place: &str| {
            text.parse::<Timestamp>().map_err(|error| gatherer.fault(place, error.to_string())).ok()
        };
        let at = asked.at.as_deref().and_then(|text| match text {
            "live" => Some(Place::Live),
            _ => instant(text, "/at").map(Place::Instant),
        });
        let range = asked
            .range
            .map(|range| range.and_then(|[from, to]| instant(&from, "/loop/0").zip(instant(&to, "/loop/1"))));
        if let Some(Some((from, to))) = range
            && from >= to
        {
            gatherer.fault("/loop/1", "must be after the loop's beginning");
        }
        if asked.rate.is_some_and(|rate| !rate.is_finite() || rate == 0.0 || rate.abs() > MAX_RATE) {
            gatherer.fault("/rate", format!("must be from -{MAX_RATE} to {MAX_RATE} and not 0"));
        }
        let step = asked.step.and_then(|step| match step {
            1 => Some(Step::On),
            -1 => Some(Step::Back),
            _ => {
                gatherer.fault("/step", "must be 1 or -1");
                None
            }
        });
        Self { scene: asked.scene, range, at, rate: asked.rate, step, paused: asked.paused }
    }
}

impl Entry {
    /// A playhead at the present of `scene`.
    pub(super) fn new(id: &str, scene: &str) -> Self {
        Self { id: id.to_owned(), scene: scene.to_owned(), playhead: Playhead::default(), version: 0 }
    }

    /// What `state` tells of, at monotonic time `now`.
    ///
    /// # Errors
    /// When an instant is none, the rate is no rate, or the stretch none.
    pub(super) fn again(state: &PlayheadState, now: Duration) -> Result<Self, EngineError> {
        let instant = |text: &str, place: &str| {
            text.parse::<Timestamp>().map_err(|error| Fault::new(place, error.to_string()))
        };
        let range = match &state.range {
            Some([from, to]) => {
                instant(from, "/loop/0").and_then(|from| Ok(Some((from, instant(to, "/loop/1")?))))
            }
            None => Ok(None),
        };
        let read = instant(&state.position, "/position").and_then(|position| Ok((position, range?)));
        let (position, range) = read.map_err(|fault| EngineError::Faults(vec![fault]))?;
        let rate = state.rate;
        let is_rate = rate.is_finite() && rate != 0.0 && rate.abs() <= MAX_RATE;
        if !is_rate || range.is_some_and(|(from, to)| from >= to) {
            let place = if is_rate { "/loop" } else { "/rate" };
            return Err(EngineError::Faults(vec![Fault::new(place, "is not what a playhead has")]));
        }
        let playhead = Playhead::again(state.mode, (position, now), rate, range);
        let (id, scene) = (state.id.clone(), state.scene.clone());
        Ok(Self { id, scene, playhead, version: state.version })
    }

    /// Does what was asked; `stepped` is where a step leads, if one was asked for.
    pub(super) fn apply(
        &mut self,
        change: &Change,
        now: Duration,
        extent: Extent,
        stepped: impl FnOnce(Timestamp) -> Option<Timestamp>,
    ) {
        let playhead = &mut self.playhead;
        if let Some(range) = change.range {
            playhead.set_range(range, now, extent);
        }
        match change.at {
            Some(Place::Live) => playhead.go_live(),
            Some(Place::Instant(at)) => playhead.seek(at, now),
            None => {}
        }
        if let Some(rate) = change.rate {
            playhead.set_rate(rate, now, extent);
        }
        if change.step.is_some() {
            playhead.pause(now, extent);
            if let Some(at) = stepped(playhead.position(now, extent)) {
                playhead.seek(at, now);
            }
        }
        match change.paused {
            Some(true) => playhead.pause(now, extent),
            // The present needs no playing, unless at a rate that was asked for.
            Some(false) if playhead.mode() == PlayheadMode::Paused || change.rate.is_some() => {
                playhead.play(now, extent);
            }
            Some(false) | None => {}
        }
        self.version += 1;
    }

    /// How often it was changed.
    pub(super) const fn version(&self) -> u64 {
        self.version
    }

    /// As callers see it.
    pub(super) fn state(&self, now: Duration, extent: Extent) -> PlayheadState {
        PlayheadState {
            id: self.id.clone(),
            scene: self.scene.clone(),
            mode: self.playhead.mode(),
            position: self.playhead.position(now, extent).to_string(),
            rate: self.playhead.rate(),
            range: self.playhead.range().map(|(from, to)| [from.to_string(), to.to_string()]),
            version: self.version,
        }
    }
}

impl Playheads {
    /// None yet.
    pub(super) fn new() -> Self {
        Self { entries: Mutex::default(), version: watch::Sender::new(0) }
    }

    /// All, in the order in which they were made.
    pub(super) fn all(&self) -> Vec<Entry> {
        self.lock().clone()
    }

    /// The one of that name.
    pub(super) fn find(&self, id: &str) -> Result<Entry, EngineError> {
        let entries = self.lock();
        let found = entries.iter().find(|entry| entry.id == id).cloned();
        found.ok_or_else(|| EngineError::NoPlayhead { id: id.to_owned() })
    }

    /// Puts `entry` in the place of the one of its name that has version `was`, or adds it where there was none; false
    /// where somebody else was faster.
    pub(super) fn replace(&self, entry: Entry, was: Option<u64>) -> Result<bool, EngineError> {
        let mut entries = self.lock();
        let place = entries.iter().position(|other| other.id == entry.id);
        if place.map(|place| entries[place].version) != was {
            return Ok(false);
        }
        match place {
            Some(place) => entries[place] = entry,
            None if entries.len() == MAX_PLAYHEADS => {
                let message = format!("there are {MAX_PLAYHEADS} playheads already; remove one first");
                return Err(EngineError::TooLarge(Fault::new("", message)));
            }
            None => entries.push(entry),
        }
        drop(entries);
        self.tell();
        Ok(true)
    }

    /// Puts `entry` in the place of the one of its name, whatever that is.
    pub(super) fn put(&self, entry: Entry) -> Result<(), EngineError> {
        let was = self.find(&entry.id).ok().map(|entry| entry.version);
        match self.replace(entry, was)? {
            true => Ok(()),
            false => Err(EngineError::Unavailable("a playhead was changed meanwhile".to_owned())),
        }
    }

    /// Removes the one of that name.
    pub(super) fn remove(&self, id: &str) -> Result<(), EngineError> {
        let mut entries = self.lock();
        let place = entries.iter().position(|entry| entry.id == id);
        let place = place.ok_or_else(|| EngineError::NoPlayhead { id: id.to_owned() })?;
        entries.remove(place);
        drop(entries);
        self.tell();
        Ok(())
    }

    /// Removes those of a scene that is gone.
    pub(super) fn remove_of(&self, scene: &str) {
        self.lock().retain(|entry| entry.scene != scene);
        self.tell();
    }

    /// Tells every follower that nothing more will come.
    pub(super) fn end(&self) {
        self.version.send_replace(ENDED);
    }

    /// Changes with every change of any of them; [`ENDED`] once the engine stops.
    pub(super) fn subscribe(&self) -> watch::Receiver<u64> {
        self.version.subscribe()
    }

    fn tell(&self) {
        self.version.send_if_modified(|version| {
            let is_running = *version != ENDED;
            *version += u64::from(is_running);
            is_running
        });
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Entry>> {
        // Each change is one assignment, so a poisoned list is whole.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const EXTENT: Extent =
        Extent { first: Some(Timestamp::from_nanos(0)), live: Timestamp::from_nanos(60_000_000_000) };

    fn secs(secs: i64) -> Timestamp {
        Timestamp::from_nanos(secs * 1_000_000_000)
    }

    #[test]
    fn every_fault_of_a_change_is_told_at_its_place() {
        let body = json!({
            "at": "noon", "rate": 9.0, "step": 2, "loop": ["1970-01-01T00:00:05Z", "1970-01-01T00:00:05Z"],
            "pausd": true
        });
        let Err(EngineError::Faults(faults)) = Change::read(body) else { panic!("it is refused") };
        let places: Vec<&str> = faults.iter().map(|fault| fault.place.as_str()).collect();
        assert_eq!(places, ["/pausd", "/at", "/loop/1", "/rate", "/step"]);
        assert!(faults[0].message.contains("paused"), "{}", faults[0].message);
        for rate in [json!(0), json!(-8.1), json!("fast")] {
            assert!(Change::read(json!({ "rate": rate })).is_err());
        }
        assert!(Change::read(json!([])).is_err());
        assert!(Change::read(json!({"rate": -8, "paused": false, "loop": null, "at": 5.5})).is_err());
        assert!(Change::read(json!({"rate": -8, "paused": false, "loop": null, "at": "live"})).is_ok());
    }

    #[test]
    fn changes_are_done_in_their_order() {
        let mut entry = Entry::new("wall", "plaza");
        let mut ask = |now: u64, body: serde_json::Value| {
            let change = Change::read(body).unwrap();
            let now = Duration::from_secs(now);
            entry.apply(&change, now, EXTENT, |from| {
                Some(from.saturating_add_nanos(if change.step == Some(Step::On) { 40 } else { -40 }))
            });
            entry.state(now, EXTENT)
        };
        let state = ask(0, json!({"paused": false}));
        assert_eq!((state.mode, state.version), (PlayheadMode::Live, 1), "the present needs no playing");
        let state = ask(1, json!({"at": "1970-01-01T00:00:10Z", "rate": 2, "paused": false}));
        assert_eq!((state.mode, state.position), (PlayheadMode::Playing, secs(10).to_string()));
        let state = ask(4, json!({"step": 1}));
        let on = secs(16).saturating_add_nanos(40);
        assert_eq!((state.mode, state.position), (PlayheadMode::Paused, on.to_string()));
        assert_eq!(ask(9, json!({"step": -1})).position, secs(16).to_string());
        let state =
            ask(9, json!({"loop": ["1970-01-01T00:00:15Z", "1970-01-01T00:00:17Z"], "paused": false}));
        assert_eq!(state.range, Some([secs(15).to_string(), secs(17).to_string()]));
        assert_eq!(
            ask(10, json!({"paused": true})).position,
            secs(16).to_string(),
            "2 s on in a loop of 2 s"
        );
        assert_eq!(ask(10, json!({"at": "live"})).mode, PlayheadMode::Live);
        let state = ask(10, json!({"rate": -1, "paused": false}));
        assert_eq!((state.mode, state.version), (PlayheadMode::Playing, 8));
    }

    #[test]
    fn a_change_upon_an_older_version_is_refused_and_there_is_a_bound() {
        let playheads = Playheads::new();
        let entry = Entry::new("a", "plaza");
        assert!(playheads.replace(entry.clone(), None).unwrap());
        assert!(!playheads.replace(entry.clone(), None).unwrap(), "it is there now");
        let newer = Entry { version: 1, ..entry.clone() };
        assert!(playheads.replace(newer, Some(0)).unwrap());
        assert!(!playheads.replace(entry, Some(0)).unwrap(), "it was changed meanwhile");
        for i in 1..MAX_PLAYHEADS {
            assert!(playheads.replace(Entry::new(&format!("p{i}"), "plaza"), None).unwrap());
        }
        let full = playheads.replace(Entry::new("z", "plaza"), None).unwrap_err();
        assert!(full.to_string().contains("320 playheads"), "{full}");
        playheads.remove("a").unwrap();
        assert!(matches!(playheads.remove("a"), Err(EngineError::NoPlayhead { .. })));
        let mut changes = playheads.subscribe();
        playheads.end();
        playheads.remove("p1").unwrap();
        assert_eq!(*changes.borrow_and_update(), ENDED);
    }
}
