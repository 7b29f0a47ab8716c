//! A room uses only rooms above it in src/lib.rs. Tests at the foot of a file may look anywhere.

use crate::tree::{Text, root, texts};

/// The rooms in the order of src/lib.rs.
fn rooms() -> Vec<String> {
    let lib = std::fs::read_to_string(root().join("src/lib.rs")).expect("the list of rooms");
    lib.lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned))
        .collect()
}

/// The room that a file belongs to: `src/store/scene.rs` and `src/store.rs` to `store`.
fn room_of(path: &str) -> &str {
    let path = path.strip_prefix("src/").unwrap_or(path);
    path.split(['/', '.']).next().unwrap_or_default()
}

/// The rooms named after `crate::` in `code`: `crate::a::X`, and each of `crate::{a::X, b::{Y, Z}}`.
fn rooms_used(code: &str) -> Vec<String> {
    let mut used = Vec::new();
    for rest in code.split("crate::").skip(1) {
        let Some(group) = rest.strip_prefix('{') else {
            used.push(word(rest));
            continue;
        };
        let (mut depth, mut start) = (0_usize, 0);
        for (i, character) in group.char_indices() {
            match character {
                '{' => depth += 1,
                '}' if depth == 0 => {
                    used.push(word(&group[start..i]));
                    break;
                }
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    used.push(word(&group[start..i]));
                    start = i + 1;
                }
                _ => {}
            }
        }
    }
    used.retain(|room| !room.is_empty());
    used
}

fn word(text: &str) -> String {
    text.trim_start().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

/// What is wrong with a file's edges, given the order of the rooms.
fn complaints(file: &Text, rooms: &[String]) -> Vec<String> {
    let place = |room: &str| rooms.iter().position(|known| known == room);
    let room = room_of(&file.path);
    let Some(own) = place(room) else {
        return vec![format!("{}: src/lib.rs knows no room `{room}`", file.path)];
    };
    let code: Vec<_> = file.code().into_iter().map(|(_, line)| line).collect();
    let complain = |used: String| match place(&used) {
        Some(other) if other > own => {
            Some(format!("{}: `{room}` uses `{used}`, which stands below it in src/lib.rs", file.path))
        }
        Some(_) => None,
        None => Some(format!("{}: `crate::{used}` is no room of src/lib.rs", file.path)),
    };
    let used = rooms_used(&code.join("\n"));
    let forbidden =
        FORBIDDEN.iter().filter(|(from, to, _)| *from == room && used.iter().any(|used| used == to));
    let forbidden: Vec<String> =
        forbidden.map(|(from, to, why)| format!("{}: `{from}` uses `{to}`: {why}", file.path)).collect();
    used.into_iter().filter_map(complain).chain(forbidden).collect()
}

/// Edges that run downwards and must not be there all the same.
const FORBIDDEN: [(&str, &str, &str); 3] = [
    ("simulate", "render", "the simulator must not use the renderer that it judges"),
    ("simulate", "gpu", "the simulator must not use the renderer that it judges"),
    ("api", "ingest", "the engine's door is all that `api` sees"),
];

#[test]
fn rooms_use_only_rooms_above_them() {
    let rooms = rooms();
    assert!(rooms.len() > 20, "src/lib.rs lists the rooms, one `pub mod` each: {rooms:?}");
    let files = texts("src", &[".rs"]);
    let complaints: Vec<_> = files
        .iter()
        // The binary stands outside the house: it may use any room by its door.
        .filter(|file| !matches!(file.path.as_str(), "src/lib.rs" | "src/main.rs"))
        .filter(|file| !file.path.starts_with("src/commands/"))
        .flat_map(|file| complaints(file, &rooms))
        .collect();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn edges_are_found_in_every_form() {
    let check = |code: &str, expected: &[&str]| assert_eq!(rooms_used(code), expected, "{code}");
    check("use crate::store::Store;", &["store"]);
    check("let x = crate::clock::now() + crate::frame::y();", &["clock", "frame"]);
    check(
        "use crate::{\n    clock::{Clock, Timestamp},\n    frame,\n    store::{self, x::{A, B}},\n};",
        &["clock", "frame", "store"],
    );
    check("use std::fmt;", &[]);
}

#[test]
fn an_edge_downwards_is_refused() {
    let rooms = ["error", "store", "api"].map(str::to_owned);
    let file = |path: &str, text: &str| Text { path: path.to_owned(), text: text.to_owned() };
    let check = |path: &str, text: &str, expected: usize| {
        assert_eq!(complaints(&file(path, text), &rooms).len(), expected, "{path}: {text}");
    };
    check("src/store/scene.rs", "use crate::error::Fault;\nuse crate::store::Store;\n", 0);
    check("src/store/scene.rs", "use crate::api::Router;\n", 1);
    check("src/store.rs", "fn f() { crate::api::g(); crate::attic::h(); }\n", 2);
    check("src/store.rs", "// as crate::api says\n#[cfg(test)]\nmod tests { use crate::api::X; }\n", 0);
    check("src/attic/mod.rs", "", 1);
}
