//! What a snapshot says of what it does not show: privacy zones, and people who were made unrecognisable; and whether it shows
//! what is hidden by now.

use super::record::{ReadRecord, instant};
use super::{EvidenceError, Reader};
use crate::engine::{At, BlurAsked, CameraBlur, EngineError, Handle};
use serde_json::{Value, json};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{
    BLUR_CELLS, BLUR_MARGIN_SHARE, Blur, LEAST_BLUR_CELL_PX, LEAST_BLUR_MARGIN_PX,
};

/// Corners in a texture.
type Polygon = Vec<[f64; 2]>;

/// What was hidden of cameras when a picture was asked for.
pub(super) struct Hidden(Vec<(String, [Vec<Polygon>; 2])>);

/// All that ever was in force of a camera's zones, and what is now: whatever is changed changes one of both.
fn zones(door: &Handle, camera: &str) -> [Vec<Polygon>; 2] {
    let earliest = At::Time(Timestamp::from_nanos(i64::MIN));
    // One that is not configured has no pictures.
    [earliest, At::Live].map(|at| door.hidden(camera, at).unwrap_or_default())
}

impl Hidden {
    pub(super) fn of<'a>(door: &Handle, cameras: impl Iterator<Item = &'a str>) -> Self {
        Self(cameras.map(|camera| (camera.to_owned(), zones(door, camera))).collect())
    }

    /// Refuses to go on where zones were changed since: a picture of before would be named wrongly.
    pub(super) fn check_unchanged(&self, door: &Handle) -> Result<(), EvidenceError> {
        let changed = self.0.iter().find(|(camera, before)| zones(door, camera) != *before);
        let gone = |camera: &str| {
            EvidenceError::Gone(format!("the privacy zones of camera {camera} were changed meanwhile"))
        };
        changed.map_or(Ok(()), |(camera, _)| Err(gone(camera)))
    }

    /// What is hidden of what a camera saw at an instant.
    pub(super) fn at(
        &self,
        door: &Handle,
        camera: &str,
        time: Timestamp,
    ) -> Result<Vec<Polygon>, EvidenceError> {
        Ok(door.hidden(camera, At::Time(time))?)
    }
}

/// Who of the people is to be told in a picture, and by what the others are found and blurred.
pub(super) fn people_document(blur: Option<&BlurAsked>) -> Value {
    let Some(BlurAsked { except }) = blur else { return json!({ "blurred": false }) };
    json!({
        "blurred": true,
        "except": except,
        "found_by": "segmentation",
        "margin_share": BLUR_MARGIN_SHARE,
        "least_margin_px": LEAST_BLUR_MARGIN_PX,
        "cells_along": BLUR_CELLS,
        "least_cell_px": LEAST_BLUR_CELL_PX,
    })
}

/// What was blurred of one camera.
pub(super) fn blur_document(of: &CameraBlur) -> Value {
    let n_parts = match &of.blur {
        Blur::Parts(parts) => Some(parts.len()),
        Blur::Whole => None,
    };
    json!({ "whole": n_parts.is_none(), "parts": n_parts, "shown": of.n_shown })
}

impl Reader<'_> {
    /// The first camera of which a snapshot shows what is hidden by now, if there is one: it was made before.
    ///
    /// # Errors
    /// As [`Self::record`].
    pub async fn shows_hidden(&self, id: &str, door: &Handle) -> Result<Option<String>, EvidenceError> {
        let record: ReadRecord = serde_json::from_slice(&self.record(id).await?)
            .map_err(|error| EvidenceError::Internal(format!("the record of snapshot {id}: {error}")))?;
        for camera in record.cameras.iter().filter(|camera| camera.takes_part()) {
            // Of one from a release that did not say it, the instant shown is near.
            let seen_at = camera.seen_at.as_deref().or(camera.frame_time.as_deref()).unwrap_or(&record.time);
            let seen_at = instant(seen_at).unwrap_or(Timestamp::from_nanos(i64::MIN));
            let now = match door.hidden(&camera.id, At::Time(seen_at)) {
                Ok(now) => now,
                Err(EngineError::NoCamera { .. }) => continue,
                Err(error) => return Err(error.into()),
            };
            if now.iter().any(|polygon| !camera.hidden.contains(polygon)) {
                return Ok(Some(camera.id.clone()));
            }
        }
        Ok(None)
    }
}
