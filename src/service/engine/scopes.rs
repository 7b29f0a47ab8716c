//! Scenes as callers may see them: the same surfaces with fewer cameras, one scene for each set of cameras.
//!
//! Whatever is remembered or kept of a scene hangs on the scene's identity. So what is concluded for a caller (who is who,
//! gains, overlaps, pictures) comes from the cameras alone that the caller may see, and all callers with the same cameras
//! share it.

use std::sync::{Arc, Mutex, PoisonError};
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_vision::access::Scope;

/// Scenes without some of their cameras that are kept, those asked for last: each is a list of cameras and a document; what
/// is large they share.
const MAX_KEPT: usize = 64;

/// Scenes by what is left of their cameras.
#[derive(Debug, Default)]
pub(super) struct Scopes(Mutex<Vec<Kept>>);

#[derive(Debug)]
struct Kept {
    whole: Arc<Scene>,
    part: Arc<Scene>,
}

impl Scopes {
    /// What `scope` allows of a scene: itself where that is all of it.
    pub(super) fn part(&self, whole: &Arc<Scene>, scope: &Scope) -> Arc<Scene> {
        let is_left = |member: &&SceneCamera| scope.allows(&member.id);
        // Where no camera says who may see whom a sequence shows, it is who may see everything.
        let hides_sequences = whole.cameras.is_empty() && !whole.sequences.is_empty() && !scope.is_all();
        if whole.cameras.iter().all(|member| scope.allows(&member.id)) && !hides_sequences {
            return Arc::clone(whole);
        }
        // A panic leaves the list whole: it is changed entry by entry.
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |of: &Kept| {
            let ids = of.part.cameras.iter().map(|member| &member.id);
            Arc::ptr_eq(&of.whole, whole)
                && ids.eq(whole.cameras.iter().filter(is_left).map(|member| &member.id))
        };
        let of = |whole: &Scene| {
            if hides_sequences {
                whole.without_sequences()
            } else {
                whole.with_cameras(|id| scope.allows(id))
            }
        };
        let own = match kept.iter().position(is_it) {
            Some(place) => kept.remove(place),
            None => Kept { whole: Arc::clone(whole), part: Arc::new(of(whole)) },
        };
        let part = Arc::clone(&own.part);
        if kept.len() == MAX_KEPT {
            kept.remove(0);
        }
        kept.push(own);
        part
    }

    /// Tells that a part of a scene is kept.
    pub(super) fn has(&self, part: &Arc<Scene>) -> bool {
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.iter().any(|of| Arc::ptr_eq(&of.part, part))
    }

    /// Lets go of parts of scenes that are not `kept`.
    pub(super) fn retain(&self, is_kept: impl Fn(&Arc<Scene>) -> bool) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.retain(|of| is_kept(&of.whole));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::CameraId;

    fn scene() -> Arc<Scene> {
        let camera = |id: &str, x: f64| {
            format!(
                r#"{{"id": "{id}", "calibration": {{"image_size_px": [64, 48], "focal_px": [60, 60],
                "center_px": [32, 24], "position_m": [{x}, 8, 6],
                "world_from_camera": [0, -0.9238795325112867, 0.3826834323650898, 0]}}}}"#
            )
        };
        let cameras = [camera("a", 0.0), camera("b", 1.0), camera("c", 2.0)].join(",");
        let text = format!(r#"{{"version": 1, "cameras": [{cameras}]}}"#);
        Arc::new(
            videofields_picture::scene::parse("yard", &text, videofields_picture::scene::no_imports)
                .unwrap()
                .scene,
        )
    }

    fn scope(ids: &[&str]) -> Scope {
        Scope::of(ids.iter().map(|id| CameraId::new(id).unwrap()))
    }

    #[test]
    fn a_part_is_one_scene_a_set_of_cameras_and_knows_nothing_of_the_others() {
        let (scopes, whole) = (Scopes::default(), scene());
        assert!(Arc::ptr_eq(&scopes.part(&whole, &Scope::all()), &whole));
        assert!(Arc::ptr_eq(&scopes.part(&whole, &scope(&["c", "b", "a", "other"])), &whole));
        let part = scopes.part(&whole, &scope(&["a", "c"]));
        assert_eq!(part.cameras.iter().map(|member| member.id.as_str()).collect::<Vec<_>>(), ["a", "c"]);
        assert!(!part.document.contains("\"b\""), "{}", part.document);
        assert!(Arc::ptr_eq(&part, &scopes.part(&whole, &scope(&["c", "a", "elsewhere"]))));
        assert!(!Arc::ptr_eq(&part, &scopes.part(&whole, &scope(&["a"]))));
        assert!(
            !Arc::ptr_eq(&part, &scopes.part(&scene(), &scope(&["a", "c"]))),
            "a changed scene is another"
        );
    }

    #[test]
    fn whom_a_sequence_of_a_scene_without_cameras_shows_is_seen_by_who_may_see_everything() {
        let mut whole = (*scene()).clone();
        let path = std::path::PathBuf::from("people");
        whole.sequences =
            vec![videofields_picture::scene::SceneSequence { id: "people".to_owned(), path, repeats: true }];
        let scopes = Scopes::default();
        let with_cameras = Arc::new(whole.clone());
        assert_eq!(scopes.part(&with_cameras, &scope(&["a", "b", "c"])).sequences.len(), 1);
        assert!(scopes.part(&with_cameras, &scope(&["a"])).sequences.is_empty());
        whole.cameras.clear();
        let alone = Arc::new(whole);
        assert!(scopes.part(&alone, &scope(&["a", "b", "c"])).sequences.is_empty());
        assert_eq!(scopes.part(&alone, &Scope::all()).sequences.len(), 1);
    }

    #[test]
    fn few_parts_are_kept() {
        let scopes = Scopes::default();
        for _ in 0..2 * MAX_KEPT {
            scopes.part(&scene(), &scope(&["b"]));
        }
        assert_eq!(scopes.0.lock().unwrap().len(), MAX_KEPT);
    }
}
