//! Clips of what was recorded: what a caller may ask for, and what is put down of each camera.

use super::EngineError;
use super::blurring::{BlurAsked, MAX_TRACKS, Shown, TrackAsked, unknown_track};
use super::past::Past;
use super::redraw::{Redrawn, hidden_by};
use super::shared::Shared;
use serde::Deserialize;
use serde_json::{Value, json};
use std::fs::File;
use std::sync::Arc;
use videofields_recording::archive::{
    Archive, ArchiveError, ExportCamera, ExportFile, ExportRequest, ExportStatus, Exports, Manifest,
    Redrawing,
};
use videofields_recording::share::{Bound, GREED};
use videofields_vision::access::{Grants, Right, Role};
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault, Gatherer};
use videofields_vision::frame::CameraId;

/// An export's own description.
const MANIFEST: &str = "manifest.json";

/// Cameras of one export.
const MAX_CAMERAS: usize = 256;

/// Characters of a note.
const MAX_NOTE_CHARS: usize = 1000;

/// What a caller asks for.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExportAsked {
    /// The scene whose cameras are exported, where none are named.
    #[serde(default)]
    pub scene: Option<String>,
    /// The cameras' ids.
    #[serde(default)]
    pub cameras: Vec<String>,
    /// Scene time from which: RFC 3339 or nanoseconds.
    pub from: String,
    /// Scene time until which.
    pub to: String,
    /// What is to be known of it, at most 1000 characters.
    #[serde(default)]
    pub note: String,
    /// Whether people are made unrecognisable, and who is not. Default: nobody is.
    #[serde(default)]
    pub blur_people: Option<BlurAsked>,
}

/// What was asked for, once it was read.
struct Asked {
    scene: Option<String>,
    cameras: Vec<String>,
    span: (Timestamp, Timestamp),
    note: String,
    blur: Option<BlurAsked>,
}

impl Asked {
    /// Reads `body`.
    ///
    /// # Errors
    /// With every fault, each at its JSON pointer.
    fn read(body: Value) -> Result<Self, EngineError> {
        // serde would take a list for an object's members in their order.
        if !body.is_object() {
            return Err(EngineError::Faults(vec![Fault::new("", "expected an object")]));
        }
        let mut gatherer = Gatherer::default();
        let asked = gatherer.read::<ExportAsked>(body, "").and_then(|asked| Self::of(asked, &mut gatherer));
        let faults = gatherer.into_faults();
        asked.filter(|_| faults.is_empty()).ok_or(EngineError::Faults(faults))
    }

    fn of(asked: ExportAsked, gatherer: &mut Gatherer) -> Option<Self> {
        let ExportAsked { scene, cameras, from, to, note, blur_people } = asked;
        let instant = |gatherer: &mut Gatherer, text: &str, place: &str| {
            text.parse::<Timestamp>().map_err(|error| gatherer.fault(place, error.to_string())).ok()
        };
        let span = (instant(gatherer, &from, "/from"), instant(gatherer, &to, "/to"));
        if let (Some(from), Some(to)) = span
            && from >= to
        {
            gatherer.fault("/to", format!("must be after from, which is {from}"));
        }
        if cameras.is_empty() && scene.is_none() {
            gatherer.fault("/cameras", "name the cameras, or a scene for all of its cameras");
        }
        if cameras.len() > MAX_CAMERAS {
            gatherer.fault("/cameras", format!("at most {MAX_CAMERAS}"));
        }
        for (idx, camera) in cameras.iter().enumerate() {
            if cameras[..idx].contains(camera) {
                gatherer.fault(format!("/cameras/{idx}"), "is named more than once");
            }
        }
        if note.chars().count() > MAX_NOTE_CHARS {
            gatherer.fault("/note", format!("at most {MAX_NOTE_CHARS} characters"));
        }
        if let Some(blur) = &blur_people {
            blur.check(gatherer);
        }
        Some(Self { scene, cameras, span: (span.0?, span.1?), note, blur: blur_people })
    }
}

impl Shared {
    fn archive(&self) -> Result<&Archive, EngineError> {
        let archive = self.past.as_ref().and_then(|past| past.archive());
        archive.ok_or_else(|| {
            EngineError::Unavailable("nothing is recorded: archive.folder is empty".to_owned())
        })
    }

    /// Asks for clips.
    pub(super) fn asked_export(
        &self,
        body: Value,
        by: Option<&str>,
        grants: &Grants,
    ) -> Result<ExportStatus, EngineError> {
        let Asked { scene, mut cameras, span: (from, to), note, blur } = Asked::read(body)?;
        if let Some(scene) = &scene {
            let scene = self.scene_within(scene, &self.known_scope(grants))?;
            if cameras.is_empty() {
                cameras = self.members(&scene).iter().map(|camera| camera.id.to_string()).collect();
            }
        }
        for camera in &cameras {
            self.allowed(grants, camera, Right::Export)?;
        }
        if let Some(blur) = &blur {
            blur.check_cameras(|camera| cameras.iter().any(|own| own == camera), "exported")?;
        }
        let exported = |camera: &String| {
            let redrawing = self.redrawing(camera, from, blur.as_ref())?;
            Ok::<_, EngineError>(ExportCamera { redrawing, ..self.exported_camera(camera)? })
        };
        let cameras = cameras.iter().map(exported).collect::<Result<_, _>>()?;
        let is_limited = by.is_some() && grants.role() < Role::Admin;
        let bound = if is_limited { Bound::Free(GREED) } else { Bound::All };
        let request = ExportRequest { cameras, from, to, note, asked_by: by.map(str::to_owned), bound };
        let asked = self.archive()?.export(request).map_err(|error| failure(&error))?;
        asked.ok_or_else(|| {
            let message =
                "too many exports wait already, or as many of yours as may, or the archive is not ready";
            EngineError::Unavailable(message.to_owned())
        })
    }

    /// Refuses files of an export that show what is hidden by now: it was made before, or under other zones.
    fn check_unhidden(&self, exports: &Exports, status: &ExportStatus) -> Result<(), EngineError> {
        let from = status.from.parse().unwrap_or(Timestamp::from_nanos(i64::MIN));
        let hidden: Vec<(&String, String)> = status
            .cameras
            .iter()
            .filter_map(|camera| Some((camera, self.privacies.of(camera).ok()?.now())))
            .filter(|(_, own)| own.hides_from(from))
            .map(|(camera, own)| (camera, hidden_by(&own)))
            .collect();
        if hidden.is_empty() {
            return Ok(());
        }
        let manifest = exports.open(&status.id, MANIFEST).map_err(|error| failure(&error))?;
        let manifest: Option<Manifest> = manifest.and_then(|(file, _)| serde_json::from_reader(file).ok());
        for (camera, now) in hidden {
            let of = manifest.as_ref().and_then(|of| of.cameras.iter().find(|own| own.id == *camera));
            let then = of.and_then(|of| of.redrawn.as_ref()?.get("hidden_by")?.as_str());
            if then != Some(now.as_str()) {
                let message =
                    format!("this was made before something of camera {camera} was hidden: ask for it again");
                return Err(EngineError::Conflict(message));
            }
        }
        Ok(())
    }

    /// What is put down of a camera.
    fn exported_camera(&self, camera: &str) -> Result<ExportCamera, EngineError> {
        use super::handle::Door as _;
        let entry = self.camera(camera)?;
        let clock = self.feed(camera)?.clock;
        let written =
            |error: serde_json::Error| EngineError::Internal(format!("writing down {camera}: {error}"));
        let calibrations = self
            .scenes
            .all()
            .iter()
            .filter_map(|scene| {
                let member = scene.cameras.iter().find(|member| member.id == entry.id)?;
                let document = serde_json::to_value(CameraDocument::from_camera(&member.camera));
                Some(document.map(|document| (scene.id.clone(), document)))
            })
            .collect::<Result<_, _>>()
            .map_err(written)?;
        Ok(ExportCamera {
            id: entry.id.clone(),
            name: entry.name.clone(),
            clock: serde_json::to_value(clock).map_err(written)?,
            calibrations,
            redrawing: None,
        })
    }

    /// Who draws a camera's pictures anew, where they may not be given out as they were recorded.
    fn redrawing(
        &self,
        camera: &str,
        from: Timestamp,
        blur: Option<&BlurAsked>,
    ) -> Result<Option<Redrawing>, EngineError> {
        let own = self.privacies.of(camera)?.now();
        let Some(past) = self.past.as_ref().filter(|_| blur.is_some() || own.hides_from(from)) else {
            return Ok(None);
        };
        let id = &self.camera(camera)?.id;
        let shown = match blur {
            Some(blur) => {
                let own = blur.except.iter().enumerate().filter(|(_, who)| who.camera == camera);
                Some(own.map(|(idx, who)| shown(past, id, (idx, who))).collect::<Result<_, _>>()?)
            }
            None => None,
        };
        let redrawn = Redrawn::new(id.clone(), past, &self.privacies, shown);
        Ok(Some(Redrawing(Arc::new(redrawn))))
    }

    /// Every export; none where nothing is recorded.
    pub(super) fn all_exports(&self) -> Vec<ExportStatus> {
        self.archive().map(|archive| archive.exports().list()).unwrap_or_default()
    }

    /// Takes an export back, or removes it.
    pub(super) fn removed_export(&self, id: &str) -> Result<(), EngineError> {
        let was_there = self.archive()?.remove_export(id).map_err(|error| failure(&error))?;
        was_there.then_some(()).ok_or_else(|| EngineError::NoExport { id: id.to_owned() })
    }

    /// A file of an export that is done, opened for reading.
    pub(super) fn file_of_export(&self, id: &str, file: &str) -> Result<(File, ExportFile), EngineError> {
        let exports = self.archive()?.exports();
        let status = exports.one(id).ok_or_else(|| EngineError::NoExport { id: id.to_owned() })?;
        self.check_unhidden(exports, &status)?;
        let found = exports.open(id, file).map_err(|error| failure(&error))?;
        found.ok_or_else(|| EngineError::NoExportFile { id: id.to_owned(), file: file.to_owned() })
    }
}

/// Somebody who is to be seen, by a track of theirs.
fn shown(past: &Past, camera: &CameraId, (idx, who): (usize, &TrackAsked)) -> Result<Shown, EngineError> {
    let at = who.at.parse::<Timestamp>().unwrap_or_default();
    let found = past.tracks(camera, (at, at), None, MAX_TRACKS);
    let found = found.map_err(|error| EngineError::Unavailable(error.to_string()))?;
    let record = found.into_iter().find(|record| record.number == who.track);
    let name = json!({ "track": who.track, "at": who.at });
    let shown = record.and_then(|record| Shown::of(name, record.began_at, &record.path));
    shown.ok_or_else(|| unknown_track(idx, who))
}

fn failure(error: &ArchiveError) -> EngineError {
    match error.kind() {
        ErrorKind::Internal => EngineError::Internal(error.to_string()),
        _ => EngineError::Unavailable(error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn everything_wrong_with_what_is_asked_for_is_told_at_its_place() {
        let check = |body: Value, expected: &[&str]| {
            let faults = match Asked::read(body) {
                Err(EngineError::Faults(faults)) => faults,
                other => panic!("{:?}", other.map(|asked| asked.note)),
            };
            let told: Vec<_> = faults.iter().map(ToString::to_string).collect();
            assert_eq!(told.len(), expected.len(), "{told:?}");
            for (told, expected) in told.iter().zip(expected) {
                assert!(told.starts_with(expected), "{told}");
            }
        };
        let (from, to) = ("2026-03-01T12:00:00Z", "2026-03-01T12:05:00Z");
        check(json!([]), &["(document): expected an object"]);
        check(json!({"cameras": ["a"], "to": to}), &["(document): the key `from` is missing"]);
        check(json!({"from": from, "to": to}), &["/cameras: name the cameras"]);
        check(json!({"cameras": ["a"], "from": to, "to": from}), &["/to: must be after from"]);
        check(json!({"cameras": ["a", "b", "a"], "from": from, "to": to}), &["/cameras/2: is named more"]);
        check(
            json!({"cameras": ["a"], "from": "noon", "to": to, "note": "x".repeat(1001)}),
            &["/from", "/note"],
        );
        check(json!({"cameras": ["a"], "from": from, "to": to, "speed": 2}), &["/speed: unknown key"]);
        assert!(Asked::read(json!({"scene": "plaza", "from": from, "to": to})).is_ok());
    }
}
