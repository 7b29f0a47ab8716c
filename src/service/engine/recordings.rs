//! The recorded sequences of the scenes that are looked at: opened once a scene, by whoever asks first.

use super::picture::Subject;
use super::roster::Roster;
use super::shared::Shared;
use crate::sequence::SceneSequences;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use videofields_picture::fuse::SequenceAtInstant;
use videofields_picture::scene::Scene;
use videofields_recording::ingest::MediaRoots;

/// Scenes whose sequences are kept open, those asked for last.
const MAX_SCENES: usize = 4;

/// Most bytes of a scene's sequences' frames that are kept ready.
const MAX_BYTES: usize = 256 << 20;

/// A scene's sequences: one at a time asks for frames, others wait.
type Opened = Arc<Mutex<Option<SceneSequences>>>;

impl Shared {
    /// What there is of the recorded sequences of a picture's scene. Reading them is none of what fusing takes.
    pub(super) fn sequences_of(&self, subject: &Subject) -> Vec<SequenceAtInstant> {
        let roots = || self.roster.as_deref().map_or_else(|| MediaRoots::usable(&[]), Roster::roots);
        self.recordings.of(subject, &roots)
    }
}

/// Sequences by scene; the scene asked for last is the last.
#[derive(Debug, Default)]
pub(super) struct Recordings(Mutex<Vec<(Weak<Scene>, Opened)>>);

impl Recordings {
    /// What there is of the sequences of a picture's scene at its instant. Files are opened beneath their manifests' own folders and
    /// `roots`. Nobody blurs those whom a sequence shows: who may see people blurred alone does not see it.
    pub(super) fn of(&self, subject: &Subject, roots: &dyn Fn() -> MediaRoots) -> Vec<SequenceAtInstant> {
        let (scene, instant) = (&subject.scene, subject.instant);
        if scene.sequences.is_empty() || subject.blurs.is_some() {
            self.forget_gone();
            return Vec::new();
        }
        let opened = self.opened(scene);
        // A panic on the way leaves frames that were read, or none.
        let mut opened = opened.lock().unwrap_or_else(PoisonError::into_inner);
        opened.get_or_insert_with(|| SceneSequences::open(scene, &roots(), MAX_BYTES)).at(instant)
    }

    fn forget_gone(&self) {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|(of, _)| of.strong_count() > 0);
    }

    fn opened(&self, scene: &Arc<Scene>) -> Opened {
        self.forget_gone();
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
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
