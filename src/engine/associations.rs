//! Who is who in the scenes that are looked at: one association a scene, of few scenes.

use crate::fuse::Association;
use crate::scene::Scene;
use std::sync::Arc;

/// Scenes whose entities are remembered, those asked for last: an association is small, a scene's document may not be.
const MAX_SCENES: usize = 32;

/// Associations by scene; the scene asked for last is the last.
#[derive(Debug, Default)]
pub(super) struct Associations(Vec<(Arc<Scene>, Association)>);

impl Associations {
    /// The association of `scene`. A scene that was changed is another one: its cameras and ground are.
    pub(super) fn of(&mut self, scene: &Arc<Scene>) -> &mut Association {
        let own = match self.0.iter().position(|(of, _)| Arc::ptr_eq(of, scene)) {
            Some(place) => self.0.remove(place),
            None => {
                // What a changed scene was before is of no use to anybody.
                self.0.retain(|(of, _)| of.id != scene.id);
                (Arc::clone(scene), Association::default())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(id: &str) -> Arc<Scene> {
        Arc::new(crate::scene::parse(id, r#"{"version": 1}"#, crate::scene::no_imports).unwrap().scene)
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
}
