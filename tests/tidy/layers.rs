//! A room uses only rooms above it in its crate's lib.rs. Tests at the foot of a file may look anywhere.
//!
//! Which crate uses which is held by the manifests and the compiler.

use crate::tree::{Text, root, texts};

/// The crates whose lib.rs lists rooms, by their folders in `src`. Others are a room each.
const CRATES: [&str; 5] = ["vision", "picture", "recording", "service", "app"];

/// The rooms of a crate in the order of its lib.rs.
fn rooms(of_crate: &str) -> Vec<String> {
    let lib =
        std::fs::read_to_string(root().join("src").join(of_crate).join("lib.rs")).expect("the list of rooms");
    lib.lines()
        .filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';').map(str::to_owned))
        .collect()
}

/// The room that a file belongs to: `src/recording/store/scene.rs` and `src/recording/store.rs` to `store`.
fn room_of(path: &str) -> &str {
    path.split('/').nth(2).unwrap_or_default().split('.').next().unwrap_or_default()
}

/// What is named after `prefix` in `code`: `crate::a::X`, and each of `crate::{a::X, b::{Y, Z}}`.
fn named_after(prefix: &str, code: &str) -> Vec<String> {
    let mut used = Vec::new();
    for rest in code.split(prefix).skip(1) {
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

fn code_of(file: &Text) -> String {
    file.code().into_iter().map(|(_, line)| line).collect::<Vec<_>>().join("\n")
}

/// What is wrong with a file's edges within its crate, given the order of the rooms.
fn complaints(file: &Text, rooms: &[String]) -> Vec<String> {
    let place = |room: &str| rooms.iter().position(|known| known == room);
    let room = room_of(&file.path);
    let Some(own) = place(room) else {
        return vec![format!("{}: its crate's lib.rs knows no room `{room}`", file.path)];
    };
    let complain = |used: String| match place(&used) {
        Some(other) if other > own => {
            Some(format!("{}: `{room}` uses `{used}`, which stands below it in lib.rs", file.path))
        }
        Some(_) => None,
        None => Some(format!("{}: `crate::{used}` is no room of lib.rs", file.path)),
    };
    named_after("crate::", &code_of(file)).into_iter().filter_map(complain).collect()
}

#[test]
fn rooms_use_only_rooms_above_them() {
    let mut found = Vec::new();
    for of_crate in CRATES {
        let rooms = rooms(of_crate);
        assert!(rooms.len() > 2, "src/{of_crate}/lib.rs lists the rooms, one `pub mod` each: {rooms:?}");
        let files = texts(&format!("src/{of_crate}"), &[".rs"]);
        let is_root = |path: &str| path.ends_with("/lib.rs") || path == "src/app/main.rs";
        found.extend(
            files.iter().filter(|file| !is_root(&file.path)).flat_map(|file| complaints(file, &rooms)),
        );
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// Edges between crates that their manifests allow and that must not be there all the same: from which folder, to what, why.
const FORBIDDEN: [(&str, &str, &str); 2] = [
    (
        "src/api",
        "videofields_recording::ingest",
        "the engine's door is all that the interface sees of cameras",
    ),
    ("src/render/gpu", "videofields_picture", "devices know nothing of scenes"),
];

#[test]
fn forbidden_edges_are_not_there() {
    let mut found = Vec::new();
    for (folder, target, why) in FORBIDDEN {
        let files = texts(folder, &[".rs"]);
        assert!(!files.is_empty(), "{folder} has files");
        let uses = files.iter().filter(|file| code_of(file).contains(target));
        found.extend(uses.map(|file| format!("{}: uses `{target}`: {why}", file.path)));
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// What the daemon is built of without: its manifests must not name it, so that the compiler holds them to it.
#[test]
fn the_daemon_is_built_without_simulator_and_plots() {
    for file in texts("src", &["Cargo.toml"]) {
        if file.path.starts_with("src/lab/") || file.path.starts_with("src/simulate/") {
            continue;
        }
        for name in ["videofields-simulate", "videofields-lab", "plotters"] {
            assert!(!file.text.contains(name), "{} names {name}", file.path);
        }
    }
    let own = std::fs::read_to_string(root().join("Cargo.toml")).expect("the root's manifest");
    let dependencies =
        own.split("[dependencies]").nth(1).and_then(|rest| rest.split("\n[").next()).expect("a table");
    assert!(
        !dependencies.contains("videofields-simulate") && !dependencies.contains("videofields-lab"),
        "{dependencies}"
    );
    let simulator = std::fs::read_to_string(root().join("src/simulate/Cargo.toml")).expect("a manifest");
    assert!(
        !simulator.contains("videofields-render"),
        "the simulator must not use the renderer that it judges"
    );
}

#[test]
fn edges_are_found_in_every_form() {
    let check = |code: &str, expected: &[&str]| assert_eq!(named_after("crate::", code), expected, "{code}");
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
    let rooms = ["error", "store", "archive"].map(str::to_owned);
    let file = |path: &str, text: &str| Text { path: path.to_owned(), text: text.to_owned() };
    let check = |path: &str, text: &str, expected: usize| {
        assert_eq!(complaints(&file(path, text), &rooms).len(), expected, "{path}: {text}");
    };
    check("src/recording/store/scene.rs", "use crate::error::Fault;\nuse crate::store::Store;\n", 0);
    check("src/recording/store/scene.rs", "use crate::archive::Archive;\n", 1);
    check("src/recording/store.rs", "fn f() { crate::archive::g(); crate::attic::h(); }\n", 2);
    check(
        "src/recording/store.rs",
        "// as crate::archive says\n#[cfg(test)]\nmod tests { use crate::archive::X; }\n",
        0,
    );
    check("src/recording/attic/mod.rs", "", 1);
}

#[test]
fn nothing_is_made_or_done_on_the_device_but_what_is_counted() {
    const UNCOUNTED: [&str; 6] = [
        ".create_texture(",
        ".create_render_pipeline(",
        ".create_compute_pipeline(",
        ".create_buffer(",
        ".write_texture(",
        ".begin_render_pass(",
    ];
    let texts = texts("src", &[".rs"]);
    let others = texts.iter().filter(|text| !text.path.starts_with("src/render/gpu/"));
    let found: Vec<_> = others
        .flat_map(|of| UNCOUNTED.iter().filter(|call| of.text.contains(**call)).map(|call| (&of.path, call)))
        .collect();
    assert!(texts.len() > 100 && found.is_empty(), "{} files: {found:?}", texts.len());
}
