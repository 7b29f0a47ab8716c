//! What is told of the daemon itself, of playheads, events and exports.

use super::{
    Named, boolean, count, exactly, id, list, named, nullable, number, number_within, object, taken, text,
    time, word,
};
use serde_json::{Value, json};

/// Schemas by name.
pub(crate) const NAMED: [Named; 7] = [
    ("Readiness", readiness),
    ("Accuracy", accuracy),
    ("Playhead", playhead),
    ("PlayheadChange", playhead_change),
    ("Event", event),
    ("Export", export),
    ("Job", job),
];

/// The daemon itself.
pub(crate) fn system() -> Value {
    let platform = object([
        ("os", text(), ""),
        ("architecture", text(), ""),
        ("n_processors", count(), "Those that the daemon may use"),
    ]);
    let device = object([
        ("adapter", text(), "As its driver names it"),
        ("is_software", boolean(), "Whether it draws on the processor"),
        ("max_texture_side_px", count(), "Most columns and rows of a texture"),
        ("max_buffer_bytes", count(), "Most bytes of a buffer"),
        ("has_timestamps", boolean(), "Whether passes can be timed"),
    ]);
    let counts = object([
        ("cameras", count(), ""),
        ("scenes", count(), ""),
        ("walls", count(), ""),
        ("views", count(), ""),
        ("playheads", count(), ""),
        ("exports", count(), ""),
    ]);
    let database = object([("schema_version", count(), ""), ("bytes", count(), "Of its file and its log")]);
    let signature = object([
        ("key", text(), "Public key, 64 hexadecimal digits"),
        ("signature", text(), "Of the number and the digest, 128 hexadecimal digits"),
    ]);
    let audit = object([
        (
            "head",
            nullable(object([("number", count(), ""), ("digest", text(), "SHA-256, hexadecimal")])),
            "The newest entry, null where there is none",
        ),
        ("signature", nullable(signature), "Of that entry; null where it is not signed"),
        ("fault", nullable(text()), "How the log is otherwise than it was written, as it was found last"),
        ("faults", count(), "Times that something else was found so"),
    ]);
    let accounts = object([("users", count(), ""), ("tokens", count(), "")]);
    object([
        ("version", text(), "The program's"),
        ("build", word(&["release", "debug"]), "How it was built"),
        ("uptime_secs", nullable(count()), "For how long it answers; for admins"),
        ("platform", platform, "Where it runs"),
        ("device", nullable(device), "What pictures are drawn on; null while there is none"),
        ("limits", limits(), "What requests are held to"),
        ("counts", counts, "Of what the caller may see"),
        ("database", nullable(database), "For admins"),
        ("accounts", nullable(accounts), "For admins"),
        ("audit", nullable(audit), "For admins"),
    ])
}

fn limits() -> Value {
    object([
        ("target_bytes", count(), "Path and query together; 414 beyond"),
        ("head_bytes", count(), "A request's head; the connection is closed beyond"),
        ("fields", count(), "Header fields; 431 beyond"),
        ("field_bytes", count(), "Header fields together; 431 beyond"),
        ("body_bytes", count(), "A body where a route says nothing else; 413 beyond"),
        ("scene_bytes", count(), "A scene's document; 413 beyond"),
        ("body_depth", count(), "Lists and objects of a body within one another; 400 beyond"),
        ("request_secs", number(), "Until an answer begins, and until a body has come; 503 and 408 beyond"),
        ("requests_at_once", count(), "503 beyond"),
        ("answer_bytes", count(), "Of pictures that were not taken yet; 503 beyond"),
        ("encoders", count(), "Pictures that are written at once; more wait"),
        ("streams", count(), "Streams of pictures at once; 503 beyond"),
        ("listeners", count(), "Listeners to events at once; 503 beyond"),
        ("connections", count(), "At once; more wait"),
        ("connection_secs", number(), "After which a connection takes no further request"),
        ("idle_secs", number(), "For which a connection may ask for nothing"),
    ])
}

/// That the process answers.
pub(crate) fn health() -> Value {
    object([("status", word(&["ok"]), ""), ("version", text(), "The program's version")])
}

fn readiness() -> Value {
    let mut schema = object([
        ("ready", boolean(), "Whether every part is"),
        ("store", boolean(), "Whether the database takes what is written to it"),
        ("renderer", text(), "The adapter's name, or why there is none"),
        (
            "cameras_with_frames",
            exactly(2, count()),
            "How many, and of how many; strangers are told nothing of them",
        ),
    ]);
    schema["required"] = json!(["ready", "store", "renderer"]);
    schema
}

fn accuracy() -> Value {
    let spread = object([
        ("median", number(), ""),
        ("lower_quartile", number(), ""),
        ("upper_quartile", number(), ""),
        ("count", count(), "How many were measured"),
    ]);
    let row = object([
        ("stage", text(), "Which stage"),
        ("knob", text(), "What of it was set"),
        ("value", text(), "What it was set to"),
        ("is_default", boolean(), "Whether this is what is used where nothing else is said"),
        ("time_ms", spread, "Milliseconds for one unit of the stage's work"),
        ("memory_bytes", count(), "What the stage's result or state takes"),
        ("error", nullable(number()), "The stage's own error, where there is truth to judge by"),
        ("measures", super::map(number()), "Everything measured; units stand in the names"),
    ]);
    let machine = object([
        ("processor", text(), ""),
        ("n_processors", count(), "Those that the daemon may use"),
        ("adapter", text(), "The GPU adapter's name"),
        ("version", text(), "The program's version"),
        ("build", text(), "`release`, or `debug`"),
    ]);
    let table = object([
        ("version", count(), "Of the table's form"),
        ("machine", machine, "Where it was measured"),
        ("subject", text(), "On which world or scene"),
        ("measured_at", time(), "When the measuring ended"),
        ("took_secs", number(), ""),
        ("is_complete", boolean(), "False where the time was spent before all settings were measured"),
        ("rows", list(row), "One a setting"),
    ]);
    object([
        ("state", word(&["none", "pending", "measuring", "measured", "failed"]), "Where measuring stands"),
        ("reason", nullable(text()), "Why it failed"),
        ("table", nullable(table), "What was measured last on this machine"),
    ])
}

fn playhead() -> Value {
    object([
        ("id", id(), "Its name"),
        ("scene", id(), "In whose time it is a place"),
        ("mode", word(&["live", "playing", "paused"]), "What it does"),
        ("position", time(), "Where it stands now"),
        ("rate", number(), "Seconds of scene time a second while it plays"),
        ("loop", nullable(exactly(2, time())), "The stretch that it repeats"),
        ("version", count(), "How often it was changed"),
    ])
}

/// Every playhead.
pub(crate) fn playheads() -> Value {
    object([("playheads", list(named("Playhead")), "")])
}

fn playhead_change() -> Value {
    let live_or_instant = json!({"anyOf": [word(&["live"]), named("Instant")]});
    taken(
        &[],
        [
            ("scene", nullable(id()), "The scene; at first the first one"),
            (
                "loop",
                nullable(exactly(2, named("Instant"))),
                "Two instants: the stretch that is repeated; null repeats none",
            ),
            ("at", nullable(live_or_instant), "`live`, RFC 3339 or nanoseconds: where it goes"),
            ("rate", nullable(number_within(-8.0, 8.0)), "Seconds of scene time a second, not 0"),
            (
                "step",
                nullable(json!({"type": "integer", "enum": [-1, 1]})),
                "One frame on or back; it stands there",
            ),
            ("paused", nullable(boolean()), "Whether it stands"),
        ],
    )
}

/// What happens before cameras.
pub(crate) const EVENT_KINDS: [&str; 8] =
    ["stopped", "left_behind", "taken_away", "light_changed", "frozen", "covered", "moved", "misaligned"];

fn event() -> Value {
    object([
        ("id", count(), "When it was told: microseconds since 1970, or one more than the one before"),
        ("camera", id(), "Before which camera"),
        ("kind", word(&EVENT_KINDS), "What happened"),
        ("is_end", boolean(), "Whether that is over"),
        ("time", time(), "When"),
        ("since", time(), "Since when"),
        ("rect_px", nullable(exactly(4, count())), "Left, top, width and height in the camera's picture"),
        ("track", nullable(count()), "The track that it happened to"),
    ])
}

/// Events.
pub(crate) fn events() -> Value {
    object([("events", list(named("Event")), "The oldest first"), super::next()])
}

fn export() -> Value {
    let file = object([
        ("file", text(), "Its name"),
        ("bytes", count(), ""),
        ("sha256", text(), "Of its bytes, hexadecimal"),
        ("media_type", text(), ""),
    ]);
    object([
        ("id", text(), ""),
        ("state", word(&["waiting", "running", "done", "failed"]), "How far it is"),
        ("reason", nullable(text()), "Why it came to nothing"),
        ("progress", number_within(0.0, 1.0), "Share that was read"),
        ("made_at", time(), "When it was asked for, by the daemon's clock"),
        ("from", time(), "Scene time from which"),
        ("to", time(), "Scene time until which"),
        ("cameras", list(id()), ""),
        ("note", text(), "What is to be known of it"),
        ("asked_by", nullable(text()), "Which user asked for it"),
        ("bytes", count(), "Of its files"),
        ("files", list(file), "The manifest first, once it is done"),
    ])
}

/// Every job.
pub(crate) fn jobs() -> Value {
    object([("jobs", list(named("Job")), "In the order of their ids"), super::next()])
}

fn job() -> Value {
    object([
        ("id", text(), ""),
        ("kind", word(&["accuracy", "export", "map"]), "What is done"),
        ("state", word(&["waiting", "running", "done", "failed"]), "How far it is"),
        ("reason", nullable(text()), "Why it came to nothing"),
        ("progress", nullable(number_within(0.0, 1.0)), "Share that is done, where that is known"),
        ("asked_by", nullable(text()), "Which user asked for it; null where the daemon did by itself"),
        ("created_at", nullable(time()), "When it was asked for, by the daemon's clock, where that is known"),
        ("cameras", list(id()), "Which cameras it is about"),
        ("resource", text(), "Where it is told in full"),
    ])
}

/// Every export.
pub(crate) fn exports() -> Value {
    object([("exports", list(named("Export")), ""), super::next()])
}

/// Who is made unrecognisable.
pub(crate) fn blur_asked() -> Value {
    let who = taken(
        &["camera", "track", "at"],
        [
            ("camera", id(), "Which camera"),
            ("track", count(), "Its number"),
            ("at", named("Instant"), "A time at which it was there"),
        ],
    );
    let except = json!({"type": "array", "items": who, "maxItems": 64});
    taken(&[], [("except", except, "Tracks of those who may be seen")])
}

/// What an export is asked for with.
pub(crate) fn export_asked() -> Value {
    taken(
        &["from", "to"],
        [
            ("from", named("Instant"), "Scene time from which"),
            ("to", named("Instant"), "Scene time until which; frames of then and later are left out"),
            ("cameras", list(id()), "Which cameras"),
            ("scene", nullable(id()), "For all of its cameras, where none are named"),
            ("note", json!({"type": "string", "maxLength": 1000}), "What is to be known of it"),
            ("blur_people", nullable(blur_asked()), "Makes everybody unrecognisable who is found"),
        ],
    )
}
