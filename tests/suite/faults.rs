//! Faults that machines, networks, files and people bring, injected one by one; `docs/faults.md` is the table of all of
//! them, those of other modules included.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

mod client;
mod engine;
mod http;
mod killed;
mod nested;
mod sources;
mod store;

/// The generator `SplitMix64`: the same numbers at every run.
struct Random(u64);

impl Random {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (mixed ^ (mixed >> 31)) % n
    }
}

/// Every line of every Rust file beneath a folder of the project.
fn sources(folder: &str) -> String {
    let mut text = String::new();
    let mut folders = vec![std::path::PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|end| end == "rs") {
                text += &std::fs::read_to_string(&path).unwrap();
            }
        }
    }
    text
}

#[test]
fn every_test_that_the_table_of_faults_names_is_there() {
    let table = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/faults.md")).unwrap();
    let (unit, suite) = (sources("src"), sources("tests"));
    let is_path = |text: &&str| {
        text.contains("::") && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == ':')
    };
    let named: Vec<&str> = table.split('`').filter(is_path).filter(|path| !path.ends_with("::")).collect();
    assert!(named.len() > 50, "{named:?}");
    let is_there = |path: &&str| {
        let place = if path.starts_with("src::") { &unit } else { &suite };
        let name = path.rsplit("::").next().unwrap();
        place.contains(&format!("fn {name}(")) || place.contains(&format!("mod {name}"))
    };
    let missing: Vec<&str> = named.into_iter().filter(|path| !is_there(path)).collect();
    assert!(missing.is_empty(), "{missing:?}");
}
