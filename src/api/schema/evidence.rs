//! What is told of snapshots, and of which cameras see a place.

use super::{
    Named, anything, boolean, count, exactly, id, list, named, nullable, number, object, taken, text, time,
    word,
};
use serde_json::{Value, json};

/// Schemas by name.
pub(crate) const NAMED: [Named; 1] = [("Snapshot", snapshot)];

fn note() -> Value {
    json!({"type": "string", "maxLength": 2000})
}

fn tags() -> Value {
    json!({"type": "array", "maxItems": 16, "items": {"type": "string", "minLength": 1, "maxLength": 64}})
}

/// The members of a snapshot, without its record.
fn snapshot() -> Value {
    let lift = object([
        ("asked_by", text(), "The admin who asked; another confirms"),
        ("until", time(), "When the request ends, by the daemon's clock"),
    ]);
    object([
        ("id", text(), "Random: it tells neither order nor number"),
        ("kind", word(&["scene", "camera"]), ""),
        ("subject", id(), "The scene's or camera's id"),
        ("cameras", list(id()), "Those in it"),
        ("time", time(), "The instant shown, scene time"),
        ("made_at", time(), "When it was asked for, by the daemon's clock"),
        ("made_by", nullable(text()), "The user who asked"),
        ("schedule", nullable(text()), "The schedule that made it"),
        ("bytes", count(), "Of all its files"),
        ("digest", text(), "SHA-256 of its record, hexadecimal"),
        ("version", count(), "Of what is said of it"),
        ("note", note(), ""),
        ("tags", tags(), ""),
        ("hold", boolean(), "Whether it stays, however old"),
        ("held_by", nullable(text()), "The user who holds it"),
        ("lift", nullable(lift), "Where two admins lift a hold: that one has asked to"),
    ])
}

/// Several of them.
pub(crate) fn all() -> Value {
    object([
        ("snapshots", list(named("Snapshot")), "The one made last first"),
        ("is_complete", boolean(), "Whether there are no more"),
        super::next(),
    ])
}

/// One with everything.
pub(crate) fn one() -> Value {
    let annotation = object([
        ("version", count(), ""),
        ("at", time(), ""),
        ("by", nullable(text()), ""),
        ("note", note(), ""),
        ("tags", tags(), ""),
        ("hold", boolean(), ""),
        ("asks_lift", boolean(), "Whether its author asked to lift the hold"),
    ]);
    let more = object([
        ("annotations", list(annotation), "What was said of it, the first version first"),
        ("record", anything(), "What was sealed"),
    ]);
    json!({"allOf": [named("Snapshot"), more]})
}

/// What one is made of.
pub(crate) fn asked() -> Value {
    taken(
        &[],
        [
            ("scene", nullable(id()), "The scene of a view; either this or a camera"),
            ("parameters", text(), "Those of the view, as a query string"),
            ("camera", nullable(id()), "The camera whose picture is kept"),
            ("t", nullable(named("Moment")), "Which time of the camera's; live without it"),
            ("note", note(), ""),
            ("tags", tags(), ""),
            ("hold", boolean(), ""),
            (
                "blur_people",
                nullable(super::system::blur_asked()),
                "Makes everybody unrecognisable who is found, before anything is kept",
            ),
        ],
    )
}

/// What may be said of one.
pub(crate) fn said() -> Value {
    taken(
        &[],
        [("note", nullable(note()), ""), ("tags", nullable(tags()), ""), ("hold", nullable(boolean()), "")],
    )
}

/// What a look at one found.
pub(crate) fn verification() -> Value {
    let file = object([
        ("file", text(), ""),
        ("sha256", text(), "As the record has it"),
        ("is_whole", boolean(), "Whether it is there as it was"),
    ]);
    object([
        ("is_whole", boolean(), "Whether everything is as it was sealed"),
        ("digest", nullable(text()), "SHA-256 of the record as it stands there now"),
        (
            "signed_by",
            nullable(text()),
            "The public key, hexadecimal, of who signed the record; null where nobody did",
        ),
        ("files", list(file), ""),
        ("faults", list(text()), "What is wrong"),
    ])
}

/// What cameras make of a place.
pub(crate) fn sights() -> Value {
    let mut sight = object([
        ("camera", id(), ""),
        ("state", nullable(text()), "The camera's; `moved` where its calibration is suspect"),
        ("sees", boolean(), ""),
    ]);
    let more = object([
        ("u", number(), "Where in its picture, or beside it"),
        ("v", number(), ""),
        ("pixels_per_m", number(), "Of its picture, there"),
        ("distance_m", number(), ""),
        ("off_axis_rad", number(), "From the optical axis"),
        ("down_rad", number(), "How steeply it looks down on it"),
        ("why", word(&["behind", "outside", "hidden", "masked", "at_camera"]), "Why it does not see it"),
        ("surface", text(), "The kind of what hides it"),
        ("surface_idx", count(), ""),
        ("hidden_at_m", exactly(3, number()), ""),
        ("hidden_after_m", number(), ""),
    ]);
    if let (Some(sight), Some(more)) = (sight["properties"].as_object_mut(), more["properties"].as_object()) {
        sight.extend(more.clone());
    }
    object([("point_m", exactly(3, number()), ""), ("cameras", list(sight), "The best first")])
}
