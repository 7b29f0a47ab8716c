//! The repository's text files, and Rust's without its comments and tests.

use std::path::{Path, PathBuf};

/// A file: its path from the repository's root, with `/` between folders, and its text.
pub(crate) struct Text {
    pub(crate) path: String,
    pub(crate) text: String,
}

/// Folders that are not ours to judge: built or fetched, wherever they lie.
const FOREIGN: [&str; 3] = [".git", "node_modules", "dist"];

/// The same beneath the root alone: built, or beside the project.
const FOREIGN_AT_ROOT: [&str; 2] = ["target", "shared"];

/// The repository's root.
pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every file beneath `folder` (from the root) by path; none when the folder is not there.
pub(crate) fn paths(folder: &str) -> Vec<String> {
    let mut found = Vec::new();
    walk(&root().join(folder), &mut found);
    let relative = |path: &Path| {
        let path = path.strip_prefix(root()).expect("beneath the root");
        path.components().map(|part| part.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
    };
    let mut paths: Vec<_> = found.iter().map(|path| relative(path)).collect();
    paths.sort();
    paths
}

fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
    if !folder.try_exists().expect("looked") {
        return;
    }
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let entry = entry.expect("an entry");
        let is_named = |names: &[&str]| names.iter().any(|name| entry.file_name() == *name);
        let is_foreign = is_named(&FOREIGN) || (folder == root() && is_named(&FOREIGN_AT_ROOT));
        let kind = entry.file_type().expect("a kind");
        if kind.is_dir() && !is_foreign {
            walk(&entry.path(), found);
        } else if kind.is_file() {
            found.push(entry.path());
        }
    }
}

/// The texts of all files beneath `folder` whose names end in one of `endings`.
pub(crate) fn texts(folder: &str, endings: &[&str]) -> Vec<Text> {
    paths(folder)
        .into_iter()
        .filter(|path| endings.iter().any(|ending| path.ends_with(ending)))
        .map(|path| {
            let text = std::fs::read_to_string(root().join(&path)).expect("UTF-8");
            Text { path, text }
        })
        .collect()
}

impl Text {
    /// The lines that run outside tests, numbered from 1: no comments, and nothing from the module of tests on,
    /// which by custom stands at the foot.
    pub(crate) fn code(&self) -> Vec<(usize, &str)> {
        if self.path.ends_with("/tests.rs") {
            return Vec::new();
        }
        self.text
            .split("\n#[cfg(test)]\nmod tests {")
            .next()
            .unwrap_or_default()
            .lines()
            .enumerate()
            .filter(|(_, line)| !line.trim_start().starts_with("//"))
            .map(|(i, line)| (i + 1, line))
            .collect()
    }
}
