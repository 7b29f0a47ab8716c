//! Who is where in every scene, placed again and again whether anyone asks or not, and kept: so that the past has the ids that the
//! present had (docs/decisions/0030-entity-rows.md).
//!
//! What is concluded hangs on the cameras it was concluded from: a scene, and each part of it that callers with fewer cameras ask
//! for, are sets of their own, with ids of their own.

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
use videofields_vision::frame::CameraId;

/// Sets that are placed at each turn: scenes in their order, then parts of scenes, those asked for last.
pub(super) const MAX_SETS: usize = 16;

/// Time for which a part of a scene goes on being placed once nobody asks for it.
const ASKED_TIME: Duration = Duration::from_secs(600);

/// Time between two writings of what is still there.
const WRITE_PERIOD: Duration = Duration::from_secs(5);

/// Longest that the thread sleeps before it looks whether it is to stop.
const NAP: Duration = Duration::from_millis(50);

/// What is gathered by set.
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
    /// When it was asked for last; none of a scene as it is.
    asked_at: Option<Duration>,
    gathered: Arc<Mutex<Gathered>>,
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

    /// Tells that a scene is placed at each turn.
    pub(super) fn is_placed(&self, scene: &Arc<Scene>) -> bool {
        self.find(scene).is_some()
    }

    fn find(&self, scene: &Arc<Scene>) -> Option<PlacedSet> {
        self.lock().iter().find(|set| Arc::ptr_eq(&set.scene, scene)).cloned()
    }

    /// Notes that somebody asked at `now` who is in a part of a scene: it is placed at each turn for a while.
    fn ask(&self, scene: &Arc<Scene>, now: Duration) {
        if self.period.is_none() {
            return;
        }
        let mut sets = self.lock();
        if let Some(set) = sets.iter_mut().find(|set| Arc::ptr_eq(&set.scene, scene)) {
            set.asked_at = set.asked_at.map(|_| now);
        } else if sets.len() < 2 * MAX_SETS {
            // The next turn lets go of those that are too many.
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
        Self { scene: Arc::clone(scene), asked_at, gathered: Arc::default() }
    }

    fn lock(&self) -> MutexGuard<'_, Gathered> {
        // What a panic left half done is a sighting with a point less.
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
    let mut written_at = clock.monotonic();
    let mut due = clock.monotonic();
    while !stop.is_raised() {
        let turn = catch_unwind(AssertUnwindSafe(|| {
            let sets = shared.placed_sets();
            sets.iter().take_while(|_| !stop.is_raised()).for_each(|set| shared.place_now(set));
        }));
        if turn.is_err() {
            tracing::error!("placing people panicked; it goes on with the next instant");
        }
        let now = clock.monotonic();
        if now.saturating_sub(written_at) >= WRITE_PERIOD {
            written_at = now;
            shared.write_entities();
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

    /// Writes what was gathered of all sets.
    fn write_entities(&self) {
        let sets = self.entities.lock().clone();
        sets.iter().for_each(|set| self.write_set(set));
    }

    /// Writes what was gathered of a scene, so that whoever asks finds it.
    fn write_entities_of(&self, scene: &Arc<Scene>) {
        if let Some(set) = self.entities.find(scene) {
            self.write_set(&set);
        }
    }

    fn write_set(&self, set: &PlacedSet) {
        let Some(past) = &self.past else { return };
        let key = set_of(&set.scene);
        let next_id = self.placing_of(&set.scene).lock().next_id();
        match set.lock().write(next_id, |change, records| past.put_entities(&key, change, records)) {
            Ok(0) => {}
            Ok(n_lost) => {
                self.metrics.entities_lost.inc_by(n_lost);
                tracing::warn!(scene = %key.scene, n_lost, "sightings lost while the database failed");
            }
            Err(error) => tracing::warn!(scene = %key.scene, %error, "who was where is not written"),
        }
    }

    /// Returns the least id that nobody in a scene has had.
    pub(super) fn first_entity_id(&self, scene: &Scene) -> u64 {
        let Some(past) = &self.past else { return 1 };
        past.next_entity_id(&set_of(scene)).unwrap_or_else(|error| {
            // Beyond all that were counted, and exact in JSON.
            let first = self.clock.now().as_nanos().unsigned_abs() / 1_000_000_000;
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
