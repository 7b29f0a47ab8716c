//! Places everybody in every scene again and again, whether anyone asks or not, and keeps it: so that the past has the ids that the
//! present had (docs/decisions/0030-entity-rows.md).
//!
//! Conclusions belong to the cameras that they are drawn from: a scene, and each part of it that callers with fewer cameras ask
//! for, are sets of their own, with ids of their own.

mod concluding;
mod gathered;
mod pieces;
mod recall;

pub use recall::{EntityCursor, EntityQuery, FoundEntities, FoundEntity, FoundStand};

use super::presence::{Present, PresentEntity};
use super::shared::Shared;
use gathered::{Gathered, Placed};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_picture::fuse::Stand;
use videofields_picture::scene::Scene;
use videofields_recording::ingest::StopFlag;
use videofields_recording::store::EntitySet;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Sets that are placed at each turn: scenes in their order, then parts of scenes, those asked for last.
pub(super) const MAX_SETS: usize = 16;

/// Time for which a part of a scene goes on being placed once nobody asks for it.
const ASKED_TIME: Duration = Duration::from_secs(600);

/// Time between two writings of what is still there.
const WRITE_PERIOD: Duration = Duration::from_secs(5);

/// Time until it is tried again where the database failed.
const FAILED_PERIOD: Duration = Duration::from_secs(30);

/// Longest that the thread sleeps before it looks whether it is to stop.
const NAP: Duration = Duration::from_millis(50);

/// Sets that are placed.
#[derive(Debug, Default)]
pub(super) struct Entities {
    sets: Mutex<Vec<PlacedSet>>,
    /// Held by whoever concludes who was where at a time of which that is not known yet.
    recalling: Mutex<()>,
    /// Time between two instants that are placed; none where nobody is placed unasked.
    period: Option<Duration>,
}

/// Gathers of one set.
#[derive(Clone, Debug)]
struct PlacedSet {
    scene: Arc<Scene>,
    /// Monotonic time at which it was asked for last; none of a scene as it is.
    asked_at: Option<Duration>,
    gathered: Arc<Mutex<Gathered>>,
    /// Held by whoever writes what was gathered.
    writing: Arc<Mutex<()>>,
}

impl Entities {
    /// Returns a board on which everybody is placed `rate_hz` times a second; with 0 nobody is.
    pub(super) fn new(rate_hz: f64) -> Self {
        let period = Duration::try_from_secs_f64(1.0 / rate_hz).ok().filter(|_| rate_hz > 0.0);
        Self { period, ..Self::default() }
    }

    /// Returns the time between two instants that are placed, if any are.
    pub(super) const fn period(&self) -> Option<Duration> {
        self.period
    }

    /// Returns the scenes, and parts of scenes, whose people are placed at each turn, each with whether it is a whole scene.
    pub(super) fn placed(&self) -> Vec<(Arc<Scene>, bool)> {
        self.lock().iter().map(|set| (Arc::clone(&set.scene), set.asked_at.is_none())).collect()
    }

    /// Tells that a scene is placed at each turn.
    pub(super) fn is_placed(&self, scene: &Arc<Scene>) -> bool {
        self.find(scene).is_some()
    }

    fn find(&self, scene: &Arc<Scene>) -> Option<PlacedSet> {
        self.lock().iter().find(|set| Arc::ptr_eq(&set.scene, scene)).cloned()
    }

    /// Notes that somebody asked at `now` who is in a part of a scene: it is placed at each turn for a while. Where as many are placed as
    /// may be, it is not: none is displaced that others ask for.
    fn ask(&self, scene: &Arc<Scene>, now: Duration) {
        if self.period.is_none() || scene.cameras.is_empty() {
            return;
        }
        let mut sets = self.lock();
        if let Some(set) = sets.iter_mut().find(|set| Arc::ptr_eq(&set.scene, scene)) {
            set.asked_at = set.asked_at.map(|_| now);
        } else if sets.len() < MAX_SETS {
            sets.push(PlacedSet::new(scene, Some(now)));
        }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<PlacedSet>> {
        // A panic leaves the list whole: it is changed entry by entry.
        self.sets.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl PlacedSet {
    fn new(scene: &Arc<Scene>, asked_at: Option<Duration>) -> Self {
        Self { scene: Arc::clone(scene), asked_at, gathered: Arc::default(), writing: Arc::default() }
    }

    fn lock(&self) -> MutexGuard<'_, Gathered> {
        // A panic costs a sighting a point at most.
        self.gathered.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the set of a scene's cameras.
pub(super) fn set_of(scene: &Scene) -> EntitySet {
    EntitySet::new(&scene.id, scene.cameras.iter().map(|member| &member.id))
}

/// Places everybody in every scene, again and again, until `stop` is raised.
pub(super) fn run(shared: &Shared, stop: &StopFlag) {
    let Some(period) = shared.entities.period() else { return };
    let clock = &shared.clock;
    let mut write_at = clock.monotonic();
    let mut due = clock.monotonic();
    while !stop.is_raised() {
        let sets = unless_panics(|| shared.placed_sets()).unwrap_or_default();
        for set in sets.iter().take_while(|_| !stop.is_raised()) {
            // One scene's failure never touches another.
            unless_panics(|| shared.place_now(set));
        }
        if clock.monotonic() >= write_at {
            let is_written = unless_panics(|| shared.write_entities()).unwrap_or(false);
            let pause = if is_written { WRITE_PERIOD } else { FAILED_PERIOD };
            write_at = clock.monotonic().saturating_add(pause);
        }
        due += period;
        let late = clock.monotonic().saturating_sub(due);
        let n_skipped = (late.as_secs_f64() / period.as_secs_f64()) as u32;
        shared.metrics.entities_instants_skipped.inc_by(n_skipped.into());
        due += period * n_skipped;
        while !stop.is_raised() {
            let left = due.saturating_sub(clock.monotonic());
            if left.is_zero() {
                break;
            }
            clock.sleep(left.min(NAP));
        }
    }
    shared.entities.lock().iter().for_each(|set| set.lock().end());
    shared.write_entities();
}

/// Returns what `work` does; `None` where it panicked.
pub(super) fn unless_panics<T>(work: impl FnOnce() -> T) -> Option<T> {
    let done = catch_unwind(AssertUnwindSafe(work));
    if done.is_err() {
        tracing::error!("work for people in a scene panicked; it goes on");
    }
    done.ok()
}

impl Shared {
    /// Returns the sets that are placed at this turn: scenes that are there, and parts of them that were asked for of late. What was
    /// gathered of others ends and is written.
    fn placed_sets(&self) -> Vec<PlacedSet> {
        let now = self.clock.monotonic();
        let scenes = self.scenes.all();
        let mut gone = Vec::new();
        let placed = {
            let mut sets = self.entities.lock();
            let is_kept = |set: &PlacedSet| match set.asked_at {
                None => scenes.iter().any(|scene| Arc::ptr_eq(scene, &set.scene)),
                // A part of a scene that was changed since is another one.
                Some(asked_at) => self.is_there(&set.scene) && now.saturating_sub(asked_at) < ASKED_TIME,
            };
            gone.extend(sets.extract_if(.., |set| !is_kept(set)));
            for scene in scenes.iter().filter(|scene| !scene.cameras.is_empty()).take(MAX_SETS) {
                match sets.iter_mut().find(|set| Arc::ptr_eq(&set.scene, scene)) {
                    Some(set) => set.asked_at = None,
                    None => sets.push(PlacedSet::new(scene, None)),
                }
            }
            // Scenes as they are come first, then what was asked for last.
            sets.sort_by_key(|set| set.asked_at.map(std::cmp::Reverse));
            let n_surplus = sets.len().saturating_sub(MAX_SETS);
            let surplus = sets.len() - n_surplus;
            gone.extend(sets.drain(surplus..));
            sets.clone()
        };
        for set in gone {
            set.lock().end();
            self.write_set(&set);
        }
        placed
    }

    /// Notes that somebody asked who is in a scene.
    pub(super) fn ask_to_place(&self, scene: &Arc<Scene>) {
        self.entities.ask(scene, self.clock.monotonic());
    }

    /// Places everybody in a set now.
    fn place_now(&self, set: &PlacedSet) {
        let started = self.clock.monotonic();
        match self.place(&set.scene) {
            Ok((_, true)) => {
                let took = self.clock.monotonic().saturating_sub(started);
                self.metrics.entities_instant.observe(took.as_secs_f64());
                self.metrics.entities_instants.inc();
            }
            Ok((_, false)) => {}
            // No camera has a picture yet, or the scene's cameras are not there.
            Err(error) => tracing::trace!(scene = %set.scene.id, %error, "nobody is placed"),
        }
    }

    /// Gathers who is present in a scene, where it is placed at each turn.
    pub(super) fn gather(&self, scene: &Arc<Scene>, present: &Present) {
        if let Some(set) = self.entities.find(scene) {
            set.lock().observe(present.instant, placed(scene, present));
        }
    }

    /// Writes what was gathered of all sets, until one cannot be, and tells that all was.
    fn write_entities(&self) -> bool {
        let sets = self.entities.lock().clone();
        sets.iter().all(|set| self.write_set(set))
    }

    /// Writes what was gathered of a scene from an instant on, so that whoever asks finds it.
    fn write_entities_of(&self, scene: &Arc<Scene>, from: Timestamp) {
        if let Some(set) = self.entities.find(scene).filter(|set| set.lock().is_news_from(from)) {
            self.write_set(&set);
        }
    }

    /// Writes what was gathered of a set, and tells that all was; meanwhile more may be gathered.
    fn write_set(&self, set: &PlacedSet) -> bool {
        let Some(past) = &self.past else { return true };
        let key = set_of(&set.scene);
        let _turn = set.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut unwritten = set.lock().unwritten();
        let mut failure = None;
        while let Some(part) = unwritten.first() {
            match past.put_entities(&key, &part.change, &part.records) {
                Ok(id) => set.lock().note_written(&part.change, id),
                Err(error) => {
                    failure = Some(error);
                    break;
                }
            }
            unwritten.remove(0);
        }
        if !unwritten.is_empty() {
            set.lock().take_back(unwritten);
        }
        let n_lost = set.lock().take_lost();
        if n_lost > 0 {
            self.metrics.entities_lost.inc_by(n_lost);
            tracing::warn!(scene = %key.scene, n_lost, "sightings lost while the database failed");
        }
        if let Some(error) = &failure {
            tracing::warn!(scene = %key.scene, %error, "who was where is not written");
        }
        failure.is_none()
    }

    /// Hands out ids of a scene, and returns the first of them.
    pub(super) fn reserve_entity_ids(&self, scene: &Scene, count: u32) -> u64 {
        let Some(past) = self.past.as_ref().filter(|_| !scene.cameras.is_empty()) else { return 1 };
        past.reserve_entity_ids(&set_of(scene), count).unwrap_or_else(|error| {
            // Beyond all that were counted, one a microsecond, and exact in JSON.
            let first = self.clock.now().as_nanos().unsigned_abs() / 1000;
            tracing::warn!(scene = %scene.id, %error, first, "ids are counted anew");
            first
        })
    }
}

/// Returns who is where, cameras by their places in the scene.
fn placed(scene: &Scene, present: &Present) -> Vec<Placed> {
    let camera_at = |id: &CameraId| scene.cameras.iter().position(|member| member.id == *id);
    let entity = |of: &PresentEntity| {
        let cameras = of.seen_by.iter().filter_map(camera_at).filter_map(|idx| u16::try_from(idx).ok());
        let stand = Stand { foot_in_world: of.foot_in_world, cameras: cameras.collect() };
        Placed { id: of.id, height_m: of.height_m, stand }
    };
    present.entities.iter().map(entity).collect()
}
