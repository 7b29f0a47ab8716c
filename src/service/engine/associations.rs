//! Memory of the scenes that pictures are drawn of from instant to instant, of few scenes: how cameras' colours agree, and hulls.

use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};
use videofields_picture::fuse::{Exposure, HullMemory, Overlap};
use videofields_picture::scene::Scene;

/// Scenes of which anything is remembered, those asked for last.
pub(super) const MAX_SCENES: usize = 32;

/// What pictures of one scene remember.
#[derive(Debug, Default)]
pub(super) struct Remembered {
    /// None before colours are first evened.
    pub(super) exposure: Option<Exposure>,
    pub(super) hulls: HullMemory,
}

/// What is remembered by scene; the scene asked for last is the last.
#[derive(Debug, Default)]
pub(super) struct Associations(Vec<(Arc<Scene>, Remembered)>);

impl Associations {
    /// What is remembered of `scene`. A scene that was changed is another one: its cameras and ground are.
    pub(super) fn of(&mut self, scene: &Arc<Scene>) -> &mut Remembered {
        let own = match self.0.iter().position(|(of, _)| Arc::ptr_eq(of, scene)) {
            Some(place) => self.0.remove(place),
            None => {
                // What a changed scene was before is of no use to anybody. A part of a scene, with fewer cameras, is no change.
                self.0.retain(|(of, _)| !scene.replaces(of));
                (Arc::clone(scene), Remembered::default())
            }
        };
        if self.0.len() == MAX_SCENES {
            self.0.remove(0);
        }
        self.0.push(own);
        let last = self.0.len() - 1;
        &mut self.0[last].1
    }
}

impl Associations {
    /// Has gains reckoned anew from what is to be seen now.
    pub(super) fn forget_gains(&mut self) {
        self.0.iter_mut().for_each(|(_, remembered)| remembered.exposure = None);
    }
}

/// A scene's overlap, once it was found.
type Found = Arc<OnceLock<Arc<Overlap>>>;

/// Where the cameras of scenes overlap: found once a scene, by whoever asks first, while others wait.
#[derive(Debug, Default)]
pub(super) struct Overlaps(Mutex<Vec<(Weak<Scene>, Found)>>);

impl Overlaps {
    /// That of `scene`.
    pub(super) fn of(&self, scene: &Arc<Scene>) -> Arc<Overlap> {
        let own = self.found(scene);
        Arc::clone(own.get_or_init(|| Arc::new(Overlap::of(scene))))
    }

    fn found(&self, scene: &Arc<Scene>) -> Found {
        // A panic leaves the list whole: it is changed entry by entry.
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|(of, _)| of.strong_count() > 0);
        if let Some((_, own)) = known.iter().find(|(of, _)| std::ptr::eq(of.as_ptr(), Arc::as_ptr(scene))) {
            return Arc::clone(own);
        }
        if known.len() == MAX_SCENES {
            known.remove(0);
        }
        let own = Found::default();
        known.push((Arc::downgrade(scene), Arc::clone(&own)));
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(id: &str) -> Arc<Scene> {
        Arc::new(
            videofields_picture::scene::parse(
                id,
                r#"{"version": 1}"#,
                videofields_picture::scene::no_imports,
            )
            .unwrap()
            .scene,
        )
    }

    #[test]
    fn a_changed_scene_begins_anew_and_few_are_kept() {
        let mut associations = Associations::default();
        let (first, changed) = (scene("a"), scene("a"));
        associations.of(&first);
        associations.of(&changed);
        assert_eq!(associations.0.len(), 1);
        assert!(Arc::ptr_eq(&associations.0[0].0, &changed));
        for number in 0..2 * MAX_SCENES {
            associations.of(&scene(&format!("s{number}")));
        }
        assert_eq!(associations.0.len(), MAX_SCENES);
    }

    #[test]
    fn overlaps_are_found_once_a_scene_and_go_with_it() {
        let (overlaps, kept) = (Overlaps::default(), scene("a"));
        let found = overlaps.of(&kept);
        assert!(Arc::ptr_eq(&overlaps.of(&kept), &found));
        assert!(!Arc::ptr_eq(&overlaps.of(&scene("a")), &found), "another scene of the same id");
        assert!(Arc::ptr_eq(&overlaps.of(&kept), &found));
        assert_eq!(overlaps.0.lock().unwrap().len(), 1);
        let many: Vec<_> = (0..MAX_SCENES + 3).map(|number| scene(&format!("s{number}"))).collect();
        many.iter().for_each(|scene| drop(overlaps.of(scene)));
        assert_eq!(overlaps.0.lock().unwrap().len(), MAX_SCENES);
    }
}
