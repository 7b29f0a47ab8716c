//! The recorded sequences of the scenes that are looked at: opened once a scene, by whoever asks first.

use super::associations::Remembered;
use super::picture::{Common, Observations, Subject};
use super::roster::Roster;
use super::shared::Shared;
use crate::clock::Timestamp;
use crate::fuse::SceneState;
use crate::ingest::MediaRoots;
use crate::scene::Scene;
use crate::sequence::{AtInstant, SceneSequences};
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Scenes whose sequences are kept open, those asked for last.
const MAX_SCENES: usize = 4;

/// Most bytes of a scene's sequences' frames that are kept ready.
const MAX_BYTES: usize = 256 << 20;

/// A scene's sequences: one at a time asks for frames, others wait.
type Opened = Arc<Mutex<Option<SceneSequences>>>;

impl Shared {
    /// What stands where, by what was seen.
    pub(super) fn state_of(
        &self,
        subject: &Subject,
        observations: &Observations,
        remembered: &mut Remembered,
    ) -> SceneState {
        let roots = || self.roster.as_deref().map_or_else(|| MediaRoots::usable(&[]), Roster::roots);
        let common = Common { overlaps: &self.overlaps, recordings: &self.recordings, roots: &roots };
        subject.state(observations, remembered, &common)
    }
}

/// Sequences by scene; the scene asked for last is the last.
#[derive(Debug, Default)]
pub(super) struct Recordings(Mutex<Vec<(Weak<Scene>, Opened)>>);

impl Recordings {
    /// What there is of a scene's sequences at an instant. Files are opened beneath their manifests' own folders and `roots`.
    pub(super) fn at(
        &self,
        scene: &Arc<Scene>,
        roots: &dyn Fn() -> MediaRoots,
        instant: Timestamp,
    ) -> Vec<AtInstant> {
        if scene.sequences.is_empty() {
            return Vec::new();
        }
        let opened = self.opened(scene);
        // A panic on the way leaves frames that were read, or none.
        let mut opened = opened.lock().unwrap_or_else(PoisonError::into_inner);
        opened.get_or_insert_with(|| SceneSequences::open(scene, &roots(), MAX_BYTES)).at(instant)
    }

    fn opened(&self, scene: &Arc<Scene>) -> Opened {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|(of, _)| of.strong_count() > 0);
        let own = match known.iter().position(|(of, _)| std::ptr::eq(of.as_ptr(), Arc::as_ptr(scene))) {
            Some(place) => known.remove(place),
            None => (Arc::downgrade(scene), Opened::default()),
        };
        if known.len() == MAX_SCENES {
            known.remove(0);
        }
        let opened = Arc::clone(&own.1);
        known.push(own);
        opened
    }
}
