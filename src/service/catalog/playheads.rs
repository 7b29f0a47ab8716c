//! Playheads, which stand or move after a restart where they stood or were meanwhile.

use super::{Catalog, CatalogError, Changer, Condition};
use crate::engine::{EngineError, Handle, PlayheadState};
use videofields_recording::store::DocumentKind;
use videofields_recording::timeline::PlayheadMode;
use videofields_vision::access::Role;

/// Who changes which playhead, and what they must find.
#[derive(Clone, Debug)]
pub struct PlayheadAsked {
    /// The playhead.
    pub id: String,
    /// What the change must find; none where anything may be there.
    pub condition: Option<Condition>,
    /// User who changes it.
    pub by: Changer,
}

impl Catalog {
    /// The version of a playhead that a change names.
    #[must_use]
    pub fn playhead_version(&self, id: &str) -> i64 {
        self.state(DocumentKind::Playhead, id).version
    }

    /// Makes a playhead, or changes it, as `change` asks of the door, and keeps it: its version, whether it is new, and its state.
    ///
    /// # Errors
    /// Errors of `change`, [`CatalogError::Changed`] where the condition does not hold, [`CatalogError::Quota`],
    /// [`CatalogError::TooMany`], [`CatalogError::Store`]; it stands where it stood then.
    pub async fn move_playhead(
        &self,
        (door, whole): (&Handle, &Handle),
        asked: PlayheadAsked,
        change: impl FnOnce(Handle, &str) -> Result<PlayheadState, EngineError> + Send + 'static,
    ) -> Result<(i64, bool, PlayheadState), CatalogError> {
        let _turn = self.playhead_changes.lock().await;
        let before = whole.playhead(&asked.id).ok();
        let condition = self.check_playhead(&asked, before.as_ref(), door)?;
        if before.is_none() {
            self.check_room(DocumentKind::Playhead, &asked.by)?;
        }
        let (door, id) = (door.clone(), asked.id.clone());
        // A step may lead to what must be decoded first.
        let moved = tokio::task::spawn_blocking(move || change(door, &id)).await;
        let state = moved.unwrap_or_else(|error| {
            Err(EngineError::Internal(format!("moving a playhead broke off: {error}")))
        })?;
        let kept = self.keep_playhead(&asked, Some(&state), condition).await;
        if kept.is_err() {
            match &before {
                Some(before) => whole.restore_playhead(before)?,
                None => whole.remove_playhead(&asked.id)?,
            }
        }
        Ok((kept?, before.is_none(), state))
    }

    /// Removes a playhead for good.
    ///
    /// # Errors
    /// [`CatalogError::Engine`] where there is none, [`CatalogError::Changed`] where the condition does not hold,
    /// [`CatalogError::Store`]; it stays then.
    pub async fn remove_playhead(
        &self,
        (door, whole): (&Handle, &Handle),
        asked: PlayheadAsked,
    ) -> Result<(), CatalogError> {
        let _turn = self.playhead_changes.lock().await;
        let before = whole.playhead(&asked.id).ok();
        let condition = self.check_playhead(&asked, before.as_ref(), door)?;
        door.remove_playhead(&asked.id)?;
        let kept = self.keep_playhead(&asked, None, condition).await;
        if let (Err(_), Some(before)) = (&kept, &before) {
            whole.restore_playhead(before)?;
        }
        kept.map(|_version| ())
    }

    /// Puts every playhead where it stood, or would be by now; one whose scene is gone is left out, and the log says so.
    pub fn restore_playheads(&self, whole: &Handle) {
        for record in self.all(DocumentKind::Playhead) {
            let read = serde_json::from_str::<PlayheadState>(record.document.as_deref().unwrap_or_default());
            let put = read.map_err(|error| error.to_string()).and_then(|mut state| {
                let passed = self.now().nanos_since(record.changed_at);
                let at = state
                    .position
                    .parse::<videofields_vision::clock::Timestamp>()
                    .map_err(|error| error.to_string())?;
                if state.mode == PlayheadMode::Playing {
                    // A cast from float saturates.
                    let moved = at.saturating_add_nanos((passed as f64 * state.rate) as i64);
                    state.position = moved.to_string();
                }
                whole.restore_playhead(&state).map_err(|error| error.to_string())
            });
            if let Err(error) = put {
                tracing::warn!(playhead = record.id, error, "a kept playhead cannot be put back: left out");
            }
        }
    }

    /// Forgets the playheads of a scene that is gone.
    pub(super) async fn remove_playheads_of(
        &self,
        scene: &str,
        by: Option<&String>,
    ) -> Result<(), CatalogError> {
        let _turn = self.playhead_changes.lock().await;
        for record in self.all(DocumentKind::Playhead) {
            let read = serde_json::from_str::<PlayheadState>(record.document.as_deref().unwrap_or_default());
            if read.is_ok_and(|state| state.scene == scene) {
                let by = Changer { user: by.cloned(), role: Role::Admin };
                let asked = PlayheadAsked { id: record.id.clone(), condition: None, by };
                self.keep_playhead(&asked, None, Condition::Present).await?;
            }
        }
        Ok(())
    }

    /// What the change must find of what is kept. A playhead that is kept and not there is one whose scene is gone.
    fn check_playhead(
        &self,
        asked: &PlayheadAsked,
        before: Option<&PlayheadState>,
        door: &Handle,
    ) -> Result<Condition, CatalogError> {
        let kept = self.state(DocumentKind::Playhead, &asked.id);
        // Of one that the caller may not know of it learns no version.
        let is_there = before.is_some() && door.playhead(&asked.id).is_ok();
        let holds = match asked.condition {
            None => true,
            Some(Condition::Absent) => !is_there,
            Some(Condition::Present) => is_there,
            Some(Condition::Version(version)) => is_there && version == kept.version,
        };
        if !holds {
            return Err(CatalogError::Changed { now: is_there.then_some(kept.version) });
        }
        Ok(if kept.is_there { Condition::Version(kept.version) } else { Condition::Absent })
    }

    async fn keep_playhead(
        &self,
        asked: &PlayheadAsked,
        state: Option<&PlayheadState>,
        condition: Condition,
    ) -> Result<i64, CatalogError> {
        let document = state.map(serde_json::to_string).transpose();
        let document =
            document.map_err(|error| CatalogError::Internal(format!("writing a playhead: {error}")))?;
        let kept = self.state(DocumentKind::Playhead, &asked.id);
        if document.is_none() && !kept.is_there {
            return Ok(kept.version);
        }
        let of = (DocumentKind::Playhead, asked.id.as_str());
        let record = self.add(of, document, condition, asked.by.user.clone()).await?;
        Ok(self.publish(DocumentKind::Playhead, record))
    }
}
