//! JSON Schemas of what bodies and answers are made of: few words to write them with, and those that all resources share.

pub(super) mod calibrations;
pub(super) mod cameras;
pub(super) mod evidence;
pub(super) mod past;
pub(super) mod scenes;
pub(super) mod sources;
pub(super) mod system;
pub(super) mod users;
pub(super) mod walls;

use super::parameters::ID_PATTERN;
use serde_json::{Map, Value, json};
use utoipa::openapi::{RefOr, Schema};

/// A schema that several answers or bodies share, and what it is called.
pub(super) type Named = (&'static str, fn() -> Value);

/// Schemas by name that are nobody's alone.
pub(super) const SHARED: [Named; 4] =
    [("Id", id_itself), ("Instant", instant_itself), ("Moment", moment_itself), ("Problem", problem)];

/// The member `next` of a page.
pub(super) fn next() -> (&'static str, Value, &'static str) {
    ("next", nullable(text()), "For `cursor` of the next page; null at the end")
}

/// One of a stream's server-sent events, called one of these names; its data is JSON.
pub(super) fn sent(names: &[&str], data: &str) -> Value {
    let event = if names.is_empty() { text() } else { word(names) };
    let mut sent = object([("event", event, "Its name"), ("data", text(), data)]);
    sent["properties"]["id"] = json!({"type": "string", "description": "What `Last-Event-ID` goes on after"});
    sent["description"] = json!("Each event of the stream; comments between keep the connection");
    sent
}

/// All schemas by name.
pub(super) fn all_named() -> impl Iterator<Item = Named> {
    SHARED
        .into_iter()
        .chain(cameras::NAMED)
        .chain(calibrations::NAMED)
        .chain(scenes::NAMED)
        .chain(walls::NAMED)
        .chain(system::NAMED)
        .chain(users::NAMED)
        .chain(evidence::NAMED)
}

/// A schema as the document's types have it. What these cannot say is lost, which a test of the contract's finds.
pub(super) fn read(schema: Value) -> RefOr<Schema> {
    serde_json::from_value(schema).unwrap_or_else(|_wrong| RefOr::T(Schema::default()))
}

/// The schema of that name.
pub(super) fn named(name: &str) -> Value {
    json!({"$ref": format!("#/components/schemas/{name}")})
}

/// A document that was kept, or that would be.
pub(super) fn kept_or_valid(document: Value) -> Value {
    let valid = object([
        ("is_valid", json!({"type": "boolean", "enum": [true]}), ""),
        ("document", document.clone(), "What would be kept"),
    ]);
    json!({"anyOf": [document, valid]})
}

/// Any object.
pub(super) fn anything() -> Value {
    json!({"type": "object"})
}

/// Any text.
pub(super) fn text() -> Value {
    json!({"type": "string"})
}

/// Text of 1 to so many characters, none of them a control character.
pub(super) fn line(most: usize) -> Value {
    json!({"type": "string", "pattern": format!(r"^[^\u0000-\u001f\u007f-\u009f]{{1,{most}}}$")})
}

/// One of a few words.
pub(super) fn word(words: &[&str]) -> Value {
    json!({"type": "string", "enum": words})
}

/// True or false.
pub(super) fn boolean() -> Value {
    json!({"type": "boolean"})
}

/// A number.
pub(super) fn number() -> Value {
    json!({"type": "number"})
}

/// A number from `least` to `most`.
pub(super) fn number_within(least: f64, most: f64) -> Value {
    json!({"type": "number", "minimum": least, "maximum": most})
}

/// A whole number, 0 or more.
pub(super) fn count() -> Value {
    json!({"type": "integer", "minimum": 0})
}

/// A whole number from `least` to `most`.
pub(super) fn whole_within(least: i64, most: i64) -> Value {
    json!({"type": "integer", "minimum": least, "maximum": most})
}

/// The id of something.
pub(super) fn id() -> Value {
    named("Id")
}

/// An instant as answers have it: RFC 3339, UTC.
pub(super) fn time() -> Value {
    json!({"type": "string", "format": "date-time"})
}

/// That or null.
pub(super) fn nullable(schema: Value) -> Value {
    match schema["type"].as_str() {
        Some(kind) if schema["enum"].is_null() => {
            let mut schema = schema.clone();
            schema["type"] = json!([kind, "null"]);
            schema
        }
        _ => json!({"oneOf": [schema, {"type": "null"}]}),
    }
}

/// A list of such.
pub(super) fn list(of: Value) -> Value {
    json!({"type": "array", "items": of})
}

/// A list of exactly so many.
pub(super) fn exactly(n: usize, of: Value) -> Value {
    json!({"type": "array", "items": of, "minItems": n, "maxItems": n})
}

/// An object by names that are data, such as cameras' ids.
pub(super) fn map(of: Value) -> Value {
    json!({"type": "object", "additionalProperties": of})
}

/// An object that always has all of these members: name, schema, meaning.
pub(super) fn object<const N: usize>(members: [(&str, Value, &str); N]) -> Value {
    let required: Vec<&str> = members.iter().map(|(name, ..)| *name).collect();
    json!({"type": "object", "required": required, "properties": properties(members)})
}

/// An object that a request brings: it must have `required`, may have the others of these members, and no more.
pub(super) fn taken<const N: usize>(required: &[&str], members: [(&str, Value, &str); N]) -> Value {
    let mut schema =
        json!({"type": "object", "properties": properties(members), "additionalProperties": false});
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

fn properties<const N: usize>(members: [(&str, Value, &str); N]) -> Map<String, Value> {
    let described = |(name, mut schema, meaning): (&str, Value, &str)| {
        if !meaning.is_empty() {
            schema["description"] = json!(meaning);
        }
        (name.to_owned(), schema)
    };
    members.into_iter().map(described).collect()
}

fn id_itself() -> Value {
    json!({"type": "string", "pattern": ID_PATTERN})
}

fn instant_itself() -> Value {
    json!({
        "description": "An instant: RFC 3339 such as 2026-03-01T12:00:00.5Z, or nanoseconds since 1970-01-01 (UTC); from the year 1678 to 2261",
        "anyOf": [
            {"type": "string", "format": "date-time"},
            // 64 bits reach into the year 2262; what a pattern can say in few words ends in 2255.
            {"type": "string", "pattern": "^-?([0-9]{1,18}|[0-8][0-9]{18})$"},
        ],
    })
}

fn moment_itself() -> Value {
    json!({
        "description": "Which time: `live`, the newest there is; `playhead:` and its name, where that stands; or an instant",
        "anyOf": [
            {"type": "string", "enum": ["live"]},
            {"type": "string", "pattern": "^playhead:[a-z0-9][a-z0-9_-]{0,63}$"},
            named("Instant"),
        ],
    })
}

fn problem() -> Value {
    let place = taken(
        &["detail"],
        [
            ("pointer", text(), "Where in the body: a JSON pointer (RFC 6901)"),
            ("parameter", text(), "Which parameter of the query or segment of the path"),
            ("detail", text(), "What is wrong there, and what is allowed"),
        ],
    );
    let mut problem = object([
        ("type", json!({"type": "string", "pattern": "^urn:videofields:problem:"}), "Which kind of failure"),
        ("title", text(), "The same in words"),
        ("status", whole_within(400, 599), "The answer's status"),
        ("detail", text(), "What is wrong with this request"),
        ("instance", text(), "The request's path"),
    ]);
    problem["properties"]["errors"] = list(place);
    problem["properties"]["errors"]["description"] =
        json!("Every place that is at fault, where there are any");
    problem["description"] = json!("Why a request failed (RFC 9457)");
    problem
}
