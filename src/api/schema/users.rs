//! What is told of users, tokens, sessions and what they did.

use super::{
    Named, boolean, count, id, list, map, named, nullable, object, taken, text, time, whole_within, word,
};
use serde_json::{Value, json};

/// Schemas by name.
pub(crate) const NAMED: [Named; 4] = [("User", user), ("Token", token), ("Rights", rights), ("Role", role)];

fn role() -> Value {
    word(&["viewer", "operator", "admin"])
}

fn rights() -> Value {
    map(list(word(&["live", "history", "export", "manage"])))
}

fn user() -> Value {
    object([
        ("id", id(), "Its name"),
        ("role", named("Role"), "What it may do beside seeing"),
        ("cameras", named("Rights"), "Rights by camera; `*` is all of them"),
        ("has_password", boolean(), "Whether it can log in with a password"),
        ("version", count(), "1 at first, and one more with every change"),
        ("created_at", time(), "When it was made"),
        ("updated_at", time(), "When it was changed last"),
    ])
}

/// A user as a request brings it.
pub(crate) fn user_asked() -> Value {
    let password = json!({"type": "string", "minLength": 12, "maxLength": 256, "writeOnly": true});
    taken(
        &["role"],
        [
            ("role", named("Role"), "What it may do beside seeing"),
            (
                "cameras",
                named("Rights"),
                "Rights by camera; `*` is all of them, also of cameras that come later",
            ),
            ("password", nullable(password), "As it was if absent"),
        ],
    )
}

/// Every user.
pub(crate) fn users() -> Value {
    object([("users", list(named("User")), "")])
}

fn token() -> Value {
    object([
        ("id", text(), "Its public part"),
        ("user", id(), "Whose it is"),
        ("note", text(), "What it is for"),
        ("created_at", time(), "When it was made"),
        ("expires_at", nullable(time()), "From when on it is not taken any more"),
    ])
}

/// Tokens.
pub(crate) fn tokens() -> Value {
    object([("tokens", list(named("Token")), "")])
}

/// A token as it is asked for.
pub(crate) fn token_asked() -> Value {
    let note = json!({"type": "string", "maxLength": 200});
    taken(
        &[],
        [
            ("user", nullable(id()), "Whose it is to be; the caller's if absent"),
            ("note", note, "What it is for"),
            (
                "expires_at",
                nullable(named("Instant")),
                "From when on it is not taken any more; never if absent",
            ),
        ],
    )
}

/// A token that was made just now.
pub(crate) fn token_made() -> Value {
    let secret = object([("token", text(), "Its secret, told this once")]);
    json!({"allOf": [named("Token"), secret]})
}

/// Who asks.
pub(crate) fn caller() -> Value {
    object([
        ("user", nullable(id()), "Its name; null of who did not log in, and where there are no users"),
        ("role", nullable(named("Role")), "What it may do beside seeing"),
        ("csrf_token", nullable(text()), "What a page sends as `X-CSRF-Token` with a change"),
        (
            "name_ending",
            nullable(text()),
            "What names end with that it gives to views, walls and playheads; null where they may be any",
        ),
    ])
}

/// What logs in.
pub(crate) fn credentials() -> Value {
    let user =
        taken(&["user", "password"], [("user", text(), "Its name"), ("password", text(), "Its password")]);
    json!({"oneOf": [user, taken(&["token"], [("token", text(), "Of a screen: what it is told by")])]})
}

/// What was done.
pub(crate) fn audit() -> Value {
    let entry = object([
        ("number", count(), "Its place in the log"),
        ("at", time(), "When"),
        ("user", nullable(text()), "Who; null of who did not log in"),
        ("action", text(), "Method and route"),
        ("target", text(), "Path and query"),
        ("status", whole_within(100, 599), "What came of it"),
        ("digest", text(), "SHA-256 of the entry and of the digest before, hexadecimal"),
    ]);
    object([("entries", list(entry), "The oldest first"), super::next()])
}
