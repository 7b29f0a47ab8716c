//! What decides a picture, kept without holding any of it: whether a request means a picture that was shown before can be
//! told before anything is drawn.

use super::EngineError;
use super::blurring::CameraBlur;
use super::picture::{Memory, Subject};
use super::shared::Shared;
use super::view::{SourceTime, ViewKind, ViewRequest};
use std::sync::{Arc, Weak};
use videofields_picture::plan::{Deadline, Named, Picture, Wishes};
use videofields_picture::scene::{Scene, SceneView};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// What a picture hangs on: its scene as the caller may see it, its view and settings, its instant, and what every camera saw
/// then. Equal identities mean one picture. It holds neither scene nor frames; what has gone from memory equals nothing that
/// comes later.
#[derive(Clone, Debug)]
pub struct ViewIdentity {
    scene: Weak<Scene>,
    from: SceneView,
    kind: ViewKind,
    picture: Picture,
    wishes: Wishes,
    deadline: Option<(Deadline, Named)>,
    instant: Timestamp,
    sources: Vec<SourceTime>,
    gaps: Vec<CameraId>,
    seen: Vec<Memory>,
    blurs: Option<Arc<[CameraBlur]>>,
    session: Option<String>,
}

impl PartialEq for ViewIdentity {
    fn eq(&self, other: &Self) -> bool {
        let is_same = |(a, b): (&Memory, &Memory)| a.0.ptr_eq(&b.0) && a.1.ptr_eq(&b.1) && a.2.ptr_eq(&b.2);
        self.scene.ptr_eq(&other.scene)
            && self.instant == other.instant
            && self.from == other.from
            && self.kind == other.kind
            && self.picture == other.picture
            && self.wishes == other.wishes
            && self.deadline == other.deadline
            && self.sources == other.sources
            && self.gaps == other.gaps
            && self.blurs == other.blurs
            && self.session == other.session
            && self.seen.len() == other.seen.len()
            && self.seen.iter().zip(&other.seen).all(is_same)
    }
}

impl ViewIdentity {
    pub(super) fn of(subject: &Subject) -> Self {
        Self {
            scene: Arc::downgrade(&subject.scene),
            from: subject.from,
            kind: subject.kind,
            picture: subject.picture.clone(),
            wishes: subject.wishes,
            deadline: subject.deadline,
            instant: subject.instant,
            sources: subject.sources.clone(),
            gaps: subject.gaps.clone(),
            seen: subject.seen.clone(),
            blurs: subject.blurs.clone(),
            session: subject.session.clone(),
        }
    }

    /// The instant shown.
    #[must_use]
    pub const fn instant(&self) -> Timestamp {
        self.instant
    }

    /// Whether the same may be asked for again: not of a session, whose pictures follow from those before, and not once scene
    /// or frames have gone from memory.
    #[must_use]
    pub fn can_be_met(&self) -> bool {
        let is_there = |(frame, mask, background): &Memory| {
            frame.strong_count() > 0 && mask.strong_count() > 0 && background.strong_count() > 0
        };
        self.session.is_none() && self.scene.strong_count() > 0 && self.seen.iter().all(is_there)
    }
}

impl Shared {
    /// The identity of the picture that `request` means now.
    pub(super) fn identity_of(&self, request: &ViewRequest) -> Result<ViewIdentity, EngineError> {
        Ok(ViewIdentity::of(&self.resolve(request)?.subject))
    }
}
