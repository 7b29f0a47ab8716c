//! Sections `[[snapshot]]`: snapshots that the daemon makes by itself; and what may be said of any snapshot.

use super::validate::{Ids, range};
use crate::error::Gatherer;
use crate::frame::{CameraId, is_id};
use serde::Deserialize;

/// Most characters of a note.
const MAX_NOTE_CHARS: usize = 2000;

/// Most tags, and characters of each.
const MAX_TAGS: usize = 16;
const MAX_TAG_CHARS: usize = 64;

/// Most bytes of a view's parameters: what a query string may have.
const MAX_PARAMETER_BYTES: usize = 2048;

/// A snapshot that the daemon makes every so often.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SnapshotScheduleSettings {
    /// Id: 1 to 64 of a-z, 0-9, - and _; unique.
    pub id: String,
    /// The scene of which a view is made; either this or a camera.
    #[serde(default)]
    pub scene: String,
    /// Parameters of the view, as a query string; without `t`.
    #[serde(default)]
    pub parameters: String,
    /// The camera whose picture is made.
    #[serde(default)]
    pub camera: Option<CameraId>,
    /// Minutes between two, 1 to 10080; they fall on whole multiples of it since 1970-01-01, UTC. Default 60.
    #[serde(default = "default_interval")]
    pub interval_mins: f64,
    /// Whether everybody is made unrecognisable who is found, before anything is kept. Default false.
    #[serde(default)]
    pub blur_people: bool,
    /// A text for people, at most 2000 characters. Default empty.
    #[serde(default)]
    pub note: String,
    /// Words to find it by, at most 16 of 1 to 64 characters. Default none.
    #[serde(default)]
    pub tags: Vec<String>,
}

const fn default_interval() -> f64 {
    60.0
}

/// Checks the schedule at `place`.
pub(super) fn check(of: &SnapshotScheduleSettings, place: &str, ids: &mut Ids, gatherer: &mut Gatherer) {
    let at = |key: &str| format!("{place}/{key}");
    if !is_id(&of.id) {
        gatherer.fault(at("id"), format!("invalid id {:?}: {}", of.id, crate::frame::IdError));
    } else if !ids.snapshots.insert(of.id.clone()) {
        gatherer.fault(at("id"), format!("there is another snapshot `{}`; ids are unique", of.id));
    }
    match (of.scene.as_str(), &of.camera) {
        ("", None) => gatherer.fault(place, "name a `scene` or a `camera`"),
        ("", Some(_)) if !of.parameters.is_empty() => {
            gatherer.fault(at("parameters"), "mean something to a `scene` alone");
        }
        ("", Some(_)) => {}
        (_, Some(_)) => {
            gatherer.fault(at("camera"), "is named beside a `scene`; a snapshot shows one of them");
        }
        (scene, None) if !is_id(scene) => {
            gatherer.fault(at("scene"), format!("invalid id {scene:?}: {}", crate::frame::IdError));
        }
        (_, None) => {}
    }
    if of.parameters.len() > MAX_PARAMETER_BYTES {
        gatherer.fault(at("parameters"), format!("at most {MAX_PARAMETER_BYTES} bytes"));
    }
    if of.parameters.split('&').any(|part| part.split('=').next() == Some("t")) {
        gatherer.fault(at("parameters"), "t: the daemon's own snapshots show what is live");
    }
    range(gatherer, &at("interval_mins"), of.interval_mins, 1.0, 10_080.0, "minutes");
    check_annotation((&of.note, &of.tags), place, gatherer);
}

/// Checks what is to be said of a snapshot: members `note` and `tags` at `place`.
pub fn check_annotation((note, tags): (&str, &[String]), place: &str, gatherer: &mut Gatherer) {
    let is_odd = |c: char| c.is_control() && c != '\n' && c != '\t';
    if note.chars().count() > MAX_NOTE_CHARS || note.chars().any(is_odd) {
        let message = format!(
            "expected at most {MAX_NOTE_CHARS} characters, no control characters but line ends and tabs"
        );
        gatherer.fault(format!("{place}/note"), message);
    }
    if tags.len() > MAX_TAGS {
        gatherer
            .fault(format!("{place}/tags"), format!("at most {MAX_TAGS} are allowed, got {}", tags.len()));
    }
    for (idx, tag) in tags.iter().enumerate().take(MAX_TAGS) {
        let pointer = format!("{place}/tags/{idx}");
        if !(1..=MAX_TAG_CHARS).contains(&tag.chars().count()) || tag.chars().any(char::is_control) {
            let message =
                format!("expected 1 to {MAX_TAG_CHARS} characters, none of them a control character");
            gatherer.fault(pointer, message);
        } else if tags[..idx].contains(tag) {
            gatherer.fault(pointer, "is named more than once");
        }
    }
}
