//! What every file keeps to: headers, names, and that nothing lies about unused.

use crate::tree::{paths, root, texts};
use std::collections::BTreeSet;

/// Fails with one line a complaint.
fn complain(complaints: impl IntoIterator<Item = String>) {
    let complaints: Vec<_> = complaints.into_iter().collect();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

fn rust_files() -> Vec<crate::tree::Text> {
    let folders = ["src", "tests", "benches"];
    let files: Vec<_> = folders.into_iter().flat_map(|folder| texts(folder, &[".rs"])).collect();
    assert!(files.len() > 40, "the sources are found");
    files
}

#[test]
fn every_rust_file_opens_with_what_it_owns() {
    let is_silent = |text: &str| !text.starts_with("//! ");
    complain(
        rust_files().into_iter().filter(|file| is_silent(&file.text)).map(|file| {
            format!("{}: the first line must be a `//!` that says what the file owns", file.path)
        }),
    );
}

#[test]
fn nothing_is_put_off_or_switched_off() {
    // In pieces, so that this file does not complain of itself.
    let everywhere = [
        (concat!("TO", "DO"), "finish it, or say what falls short where users read it"),
        (concat!("FIX", "ME"), "mend it"),
        (concat!("XX", "X:"), "say it as a sentence"),
        (concat!("#[", "ignore"), "a test runs or is removed"),
        (concat!("#[", "should_panic"), "assert today's result"),
        (concat!("#[", "allow("), "use #[expect(…, reason = \"…\")]"),
        (concat!("#![", "allow("), "use #![expect(…, reason = \"…\")]"),
    ];
    let in_code = [
        (".unwrap()", "pass the error on, or `expect` with the reason why it cannot fail"),
        ("unimplemented!(", "finish it"),
        ("todo!(", "finish it"),
    ];
    let mut complaints = Vec::new();
    for file in rust_files() {
        for (i, line) in file.text.lines().enumerate() {
            for (found, advice) in everywhere.iter().filter(|(mark, _)| line.contains(mark)) {
                complaints.push(format!("{}:{}: {found}: {advice}", file.path, i + 1));
            }
        }
        if !file.path.starts_with("src/") {
            continue;
        }
        for (number, line) in file.code() {
            for (found, advice) in in_code.iter().filter(|(mark, _)| line.contains(mark)) {
                complaints.push(format!("{}:{number}: {found}: {advice}", file.path));
            }
        }
    }
    complain(complaints);
}

#[test]
fn no_text_names_a_place_on_somebody_s_machine() {
    let places = [concat!("/ho", "me/"), concat!("/Us", "ers/"), concat!("/wo", "rk/"), concat!("C:", "\\")];
    let endings = [
        ".rs", ".toml", ".md", ".sh", ".sql", ".wgsl", ".json", ".yml", ".yaml", ".html", ".txt", ".service",
        "Makefile", "run",
    ];
    let mut complaints = Vec::new();
    for file in texts("", &endings) {
        for (i, line) in file.text.lines().enumerate() {
            for place in places.iter().filter(|place| line.contains(**place)) {
                complaints.push(format!("{}:{}: {place} is a place on one machine", file.path, i + 1));
            }
        }
    }
    complain(complaints);
}

#[test]
fn migrations_are_named_numbered_and_listed() {
    let list = std::fs::read_to_string(root().join("src/recording/store/migrate.rs"))
        .expect("the list of migrations");
    let tables = ["create", "alter", "drop", "rename", "fill"];
    let paths = paths("migrations");
    assert!(!paths.is_empty());
    complain(paths.iter().enumerate().flat_map(|(i, path)| {
        let name = path.trim_start_matches("migrations/");
        let stem = name.strip_suffix(".sql").unwrap_or_default();
        let (number, rest) = stem.split_once('_').unwrap_or_default();
        let (verb, table) = rest.split_once('_').unwrap_or_default();
        let is_named = tables.contains(&verb)
            && !table.is_empty()
            && table.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
        let faults = [
            (number != format!("{:04}", i + 1), "the numbers are four digits and run on from 0001"),
            (
                !is_named,
                "the name must be NNNN_verb_table.sql, with a verb of create, alter, drop, rename, fill",
            ),
            (!list.contains(&format!("{path}\"")), "src/recording/store/migrate.rs does not list it"),
        ];
        let path = path.clone();
        faults.into_iter().filter(|(is_fault, _)| *is_fault).map(move |(_, fault)| format!("{path}: {fault}"))
    }));
}

#[test]
fn decisions_are_numbered_once() {
    let mut numbers = BTreeSet::new();
    complain(texts("docs/decisions", &[""]).into_iter().filter_map(|file| {
        let name = file.path.trim_start_matches("docs/decisions/");
        let (number, title) =
            name.strip_suffix(".md").and_then(|stem| stem.split_once('-')).unwrap_or_default();
        let is_number = number.len() == 4 && number.bytes().all(|byte| byte.is_ascii_digit());
        if !is_number || title.is_empty() {
            return Some(format!("{}: the name must be NNNN-title.md", file.path));
        }
        if !numbers.insert(number.to_owned()) {
            return Some(format!("{}: there is another decision {number}", file.path));
        }
        (!file.text.starts_with("# ")).then(|| format!("{}: the first line must be its title", file.path))
    }));
}

#[test]
fn goldens_and_shaders_are_in_use() {
    let sources: String = rust_files().into_iter().map(|file| file.text).collect();
    let goldens = paths("tests/golden").into_iter().filter_map(|path| {
        // A golden is named by its path, or by its stem where a test forms the path.
        let within = path.strip_prefix("tests/golden/")?.to_owned();
        let file = within.rsplit('/').next().unwrap_or_default();
        let stem = file.split('.').next().unwrap_or_default();
        let is_named = sources.contains(&format!("{within}\"")) || sources.contains(&format!("\"{stem}"));
        (!is_named).then(|| format!("{path}: no test names it"))
    });
    let shaders = paths("shaders").into_iter().filter_map(|path| {
        let within = path.strip_prefix("shaders/")?;
        (!sources.contains(&format!("\"{within}\""))).then(|| format!("{path}: no source names it"))
    });
    complain(goldens.chain(shaders));
}
