//! Memory of who stands where, scene by scene, that everybody who looks at a scene shares: pictures, lists of entities, plans. So one
//! person has one id, whoever asks.
//!
//! The memory hangs on the scene's identity, and so on the cameras that the caller may see.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use videofields_picture::fuse::Placing;
use videofields_picture::scene::Scene;

/// Scenes that are remembered, those asked for last: where people may stand in one, and how cameras would show them there, takes some tens
/// of megabytes.
const MAX_SCENES: usize = 24;

/// Memory of one scene.
#[derive(Clone, Debug, Default)]
pub(super) struct ScenePlacing(Arc<Mutex<Placing>>);

impl ScenePlacing {
    /// Waits for whoever places people in the scene. A panic while somebody did costs what is known of who is who, and no more.
    pub(super) fn lock(&self) -> MutexGuard<'_, Placing> {
        self.0.lock().unwrap_or_else(|poisoned| {
            self.0.clear_poison();
            let mut own = PoisonError::into_inner(poisoned);
            *own = Placing::counting_from(own.next_id());
            own
        })
    }
}

/// Memory by scene; the scene asked for last is the last.
#[derive(Debug, Default)]
pub(super) struct Placings(Mutex<Vec<(Arc<Scene>, ScenePlacing)>>);

impl Placings {
    /// Returns what is remembered of `scene`; where nothing is, ids begin with what `first_id` returns. A scene that was changed is another one: its
    /// cameras and ground are.
    pub(super) fn of(&self, scene: &Arc<Scene>, first_id: impl FnOnce() -> u64) -> ScenePlacing {
        // A panic leaves the list whole: it is changed entry by entry.
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let own = match known.iter().position(|(of, _)| Arc::ptr_eq(of, scene)) {
            Some(place) => known.remove(place),
            None => {
                // Memory of a scene before it was changed is of no use. A part of a scene, with fewer cameras, is no change.
                known.retain(|(of, _)| !scene.replaces(of));
                let placing = Placing::counting_from(first_id());
                (Arc::clone(scene), ScenePlacing(Arc::new(Mutex::new(placing))))
            }
        };
        if known.len() == MAX_SCENES {
            known.remove(0);
        }
        let memory = own.1.clone();
        known.push(own);
        memory
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
        let memory = placings.of(&first, || 1);
        assert!(Arc::ptr_eq(&memory.0, &placings.of(&first, || 1).0));
        assert!(!Arc::ptr_eq(&memory.0, &placings.of(&changed, || 1).0));
        assert!(!Arc::ptr_eq(&memory.0, &placings.of(&first, || 1).0), "the first was let go of");
        for number in 0..2 * MAX_SCENES {
            placings.of(&scene(&format!("s{number}")), || 1);
        }
        assert_eq!(placings.0.lock().unwrap().len(), MAX_SCENES);
    }

    #[test]
    fn a_panic_costs_no_more_than_what_was_known() {
        let memory = Placings::default().of(&scene("a"), || 41);
        let panicked = std::panic::catch_unwind(|| {
            let mut own = memory.lock();
            own.take_ids(5);
            panic!("while people are placed");
        });
        assert!(panicked.is_err() && memory.0.is_poisoned());
        assert_eq!(memory.lock().next_id(), 46, "ids are not given again");
        assert!(!memory.0.is_poisoned());
    }
}
