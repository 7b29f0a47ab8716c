//! Memory of who stands where, scene by scene, that everybody who looks at a scene shares: pictures, lists of entities, plans. So one
//! person has one id, whoever asks.
//!
//! The memory hangs on the scene's identity, and so on the cameras that the caller may see.

use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use videofields_picture::fuse::Placing;
use videofields_picture::scene::Scene;

/// Scenes that are remembered, those asked for last: where people may stand in one, and how cameras would show them there, takes some tens
/// of megabytes.
const MAX_SCENES: usize = 24;

/// Ids that are reserved at once, and how few are left when more are: one instant gives fewer.
const IDS_AT_ONCE: u32 = 2048;
const LEAST_IDS: u64 = 1024;

/// Memory of one scene.
#[derive(Clone, Debug)]
pub(super) struct ScenePlacing(Arc<Mutex<Own>>);

/// Memory with the ids that it may give.
#[derive(Debug)]
struct Own {
    placing: Placing,
    /// The least id that is not reserved.
    reserved_to: u64,
}

/// Memory of one scene, held by whoever places people in it.
pub(super) struct HeldPlacing<'a>(MutexGuard<'a, Own>);

impl Deref for HeldPlacing<'_> {
    type Target = Placing;

    fn deref(&self) -> &Placing {
        &self.0.placing
    }
}

impl DerefMut for HeldPlacing<'_> {
    fn deref_mut(&mut self) -> &mut Placing {
        &mut self.0.placing
    }
}

impl ScenePlacing {
    fn reserving(reserve: impl FnOnce(u32) -> u64) -> Self {
        let first = reserve(IDS_AT_ONCE);
        let placing = Placing::counting_from(first);
        Self(Arc::new(Mutex::new(Own { placing, reserved_to: first + u64::from(IDS_AT_ONCE) })))
    }

    /// Waits for whoever places people in the scene. A panic while somebody did costs what is known of who is who, and no more.
    pub(super) fn lock(&self) -> HeldPlacing<'_> {
        HeldPlacing(self.0.lock().unwrap_or_else(|poisoned| {
            self.0.clear_poison();
            let mut own = PoisonError::into_inner(poisoned);
            own.placing.begin_anew();
            own
        }))
    }

    /// Reserves more ids where few are left.
    fn keep_ids(&self, reserve: impl FnOnce(u32) -> u64) {
        let mut own = self.lock();
        let next_id = own.next_id();
        if own.0.reserved_to.saturating_sub(next_id) >= LEAST_IDS {
            return;
        }
        let first = reserve(IDS_AT_ONCE);
        if first != own.0.reserved_to {
            // Others have had those in between.
            own.take_ids(first.saturating_sub(next_id));
        }
        own.0.reserved_to = first + u64::from(IDS_AT_ONCE);
    }
}

/// Memory by scene; the scene asked for last is the last.
#[derive(Debug, Default)]
pub(super) struct Placings(Mutex<Vec<(Arc<Scene>, ScenePlacing)>>);

impl Placings {
    /// Returns what is remembered of `scene`; `reserve` hands out ids and returns the first of them. A scene that was changed is another
    /// one: its cameras and ground are.
    pub(super) fn of(&self, scene: &Arc<Scene>, reserve: impl Fn(u32) -> u64) -> ScenePlacing {
        let known = self.used(scene, None);
        let memory = known.unwrap_or_else(|| {
            // Whoever waits for the database holds up nobody in another scene.
            let begun = ScenePlacing::reserving(&reserve);
            self.used(scene, Some(begun.clone())).unwrap_or(begun)
        });
        memory.keep_ids(reserve);
        memory
    }

    /// Returns what is remembered of `scene`, now the one used last; `begun` where nothing is.
    fn used(&self, scene: &Arc<Scene>, begun: Option<ScenePlacing>) -> Option<ScenePlacing> {
        // A panic leaves the list whole: it is changed entry by entry.
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let own = match known.iter().position(|(of, _)| Arc::ptr_eq(of, scene)) {
            Some(place) => known.remove(place),
            None => {
                let begun = begun?;
                // Memory of a scene before it was changed is of no use. A part of a scene, with fewer cameras, is no change.
                known.retain(|(of, _)| !scene.replaces(of));
                (Arc::clone(scene), begun)
            }
        };
        if known.len() == MAX_SCENES {
            known.remove(0);
        }
        let memory = own.1.clone();
        known.push(own);
        Some(memory)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_picture::scene::{no_imports, parse};

    fn scene(id: &str) -> Arc<Scene> {
        Arc::new(parse(id, r#"{"version": 1}"#, no_imports).unwrap().scene)
    }

    #[test]
    fn all_who_look_at_a_scene_share_its_memory_and_a_changed_scene_begins_anew() {
        let (placings, first, changed) = (Placings::default(), scene("a"), scene("a"));
        let memory = placings.of(&first, |_| 1);
        assert!(Arc::ptr_eq(&memory.0, &placings.of(&first, |_| 1).0));
        assert!(!Arc::ptr_eq(&memory.0, &placings.of(&changed, |_| 1).0));
        assert!(!Arc::ptr_eq(&memory.0, &placings.of(&first, |_| 1).0), "the first was let go of");
        for number in 0..2 * MAX_SCENES {
            placings.of(&scene(&format!("s{number}")), |_| 1);
        }
        assert_eq!(placings.0.lock().unwrap().len(), MAX_SCENES);
    }

    #[test]
    fn a_panic_costs_no_more_than_what_was_known() {
        let memory = Placings::default().of(&scene("a"), |_| 41);
        let panicked = std::panic::catch_unwind(|| {
            let mut own = memory.lock();
            own.take_ids(5);
            panic!("while people are placed");
        });
        assert!(panicked.is_err() && memory.0.is_poisoned());
        assert_eq!(memory.lock().next_id(), 46, "ids are not given again");
        assert!(!memory.0.is_poisoned());
    }

    #[test]
    fn ids_are_reserved_before_they_are_given() {
        let reserved = std::cell::Cell::new(1);
        let reserve = |count: u32| reserved.replace(reserved.get() + u64::from(count));
        let (placings, scene) = (Placings::default(), scene("a"));
        let take = |count: u64| placings.of(&scene, reserve).lock().take_ids(count);
        assert_eq!((take(1000), take(1)), (1, 1001));
        for _ in 0..9 {
            let first = take(LEAST_IDS);
            assert!(first + LEAST_IDS <= reserved.get(), "{first}");
        }
        // Another process has had some.
        reserved.set(reserved.get() + 77_777);
        let before = reserved.get();
        let firsts: Vec<u64> = (0..4).map(|_| take(LEAST_IDS)).collect();
        assert!(
            firsts.is_sorted() && firsts[3] >= before && firsts[3] + LEAST_IDS <= reserved.get(),
            "{firsts:?}"
        );
        // A memory that is begun anew gives none of these.
        let again = Placings::default().of(&scene, reserve).lock().next_id();
        assert!(again >= firsts[3] + LEAST_IDS);
    }
}
