//! Embeds the web pages that `make web` built into `web/dist`: writes a list of them for `page.rs` to include. Where they
//! were not built the list is empty, and the daemon's pages say how they are; in development builds it is empty too, and they are
//! read while the daemon runs.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("set by cargo"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("set by cargo"));
    println!("cargo::rerun-if-changed=build.rs");
    let dist = root.join("../../web/dist");
    let mut files = Vec::new();
    let is_development = env::var("PROFILE").is_ok_and(|profile| profile == "debug");
    if !is_development {
        println!("cargo::rerun-if-changed=../../web/dist");
    }
    if !is_development && dist.join("index.html").is_file() {
        gather(&dist, &mut files)?;
    }
    files.sort();
    let mut list = String::from("&[\n");
    for file in files {
        let name = file.strip_prefix(&dist).expect("found beneath it").to_str().expect("names of our own");
        let path = match name {
            "index.html" => "/".to_owned(),
            "wall.html" => "/wall".to_owned(),
            _ => format!("/{name}"),
        };
        writeln!(list, "    ({path:?}, include_bytes!({file:?})),").expect("a string takes all");
    }
    list.push(']');
    fs::write(out.join("web_pages.rs"), list)
}

/// Every file beneath `folder` but those whose names begin with a dot.
fn gather(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_name().as_encoded_bytes().starts_with(b".") {
            continue;
        }
        if entry.file_type()?.is_dir() {
            gather(&entry.path(), files)?;
        } else {
            files.push(entry.path());
        }
    }
    Ok(())
}
