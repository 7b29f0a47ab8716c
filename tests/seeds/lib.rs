//! Runs the targets of fuzzers (`tests/fuzz`) over their seeds and over changes of these, and holds targets, programs and seeds to each
//! other.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Takes any bytes, tells how many things it found in them, and panics where something does not hold.
pub type Target = fn(&[u8]) -> usize;

/// Numbers of seeds that a target may have.
const N_SEEDS: std::ops::RangeInclusive<usize> = 5..=15;

/// Most bytes of a seed.
const MAX_SEED_BYTES: usize = 2048;

/// Changes that are made to each seed.
const N_CHANGED: u64 = 60;

/// Runs each target over its seeds and over changes of them, the same each time.
///
/// # Panics
/// When something does not hold, and where seeds are too many, too few, too long, or one in which nothing is found is not called odd.
pub fn hold(targets: &[(&str, Target)]) {
    for (name, target) in targets {
        let seeds = seeds(name);
        assert!(N_SEEDS.contains(&seeds.len()), "{name} has {} seeds", seeds.len());
        let mut numbers = Numbers(1);
        for (file, seed) in &seeds {
            assert!(seed.len() <= MAX_SEED_BYTES, "{name}/{file} has {} bytes", seed.len());
            let n_found = run(name, *target, seed);
            // Others are there for what is not to be found in them.
            assert!(n_found > 0 || file.starts_with("odd"), "{name}/{file}: nothing is found in it");
            for _ in 0..N_CHANGED {
                let other = &seeds[numbers.below(seeds.len())].1;
                run(name, *target, &changed(seed, other, &mut numbers));
            }
        }
    }
}

/// Holds the programs that run targets of a crate, which is named as `use` names it, to these targets.
///
/// # Panics
/// When one lacks its program, or a program runs another.
pub fn have_programs(of_crate: &str, targets: &[(&str, Target)]) {
    let programs = programs().into_iter().filter(|(_, runs)| runs.starts_with(&format!("{of_crate}::")));
    let runs: BTreeSet<_> = programs.map(|(_, runs)| runs).collect();
    let wanted: BTreeSet<_> =
        targets.iter().map(|(name, _)| format!("{of_crate}::fuzzing::{name}")).collect();
    assert_eq!(runs, wanted, "targets of {of_crate} that programs of tests/fuzz/targets run");
}

/// Runs a target; bytes on which something does not hold are kept.
fn run(name: &str, target: Target, bytes: &[u8]) -> usize {
    std::panic::catch_unwind(|| target(bytes)).unwrap_or_else(|broken| {
        let kept = std::env::temp_dir().join(format!("videofields-{name}-{}", std::process::id()));
        let told = std::fs::write(&kept, bytes).map_or_else(|error| error.to_string(), |()| String::new());
        let said = broken.downcast_ref::<String>().map_or("something does not hold", String::as_str);
        panic!("{name}: {said}; on the bytes of {}{told}", kept.display())
    })
}

fn fuzz_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz")
}

/// The files of a folder by name.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<_> = entries
        .map(|entry| {
            let path = entry.expect("an entry").path();
            let name = path.file_name().and_then(|name| name.to_str()).expect("a name in UTF-8");
            (name.to_owned(), std::fs::read(&path).expect("a file"))
        })
        .collect();
    files.sort();
    files
}

/// The seeds of a target by name.
fn seeds(target: &str) -> Vec<(String, Vec<u8>)> {
    files(&fuzz_folder().join("seeds").join(target))
}

/// The programs by name, each with the path of the function that it runs.
fn programs() -> Vec<(String, String)> {
    let programs = files(&fuzz_folder().join("targets")).into_iter().map(|(file, text)| {
        let text = String::from_utf8(text).expect("UTF-8");
        let runs = text.split(['\n', ';']).find_map(|line| line.trim().strip_suffix("(data)"));
        let runs = runs.unwrap_or_else(|| panic!("{file} runs nothing")).to_owned();
        (file.trim_end_matches(".rs").to_owned(), runs)
    });
    programs.collect()
}

/// Numbers that look random and are the same each time (Knuth's generator).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end.max(1)
    }

    /// Returns a place in `bytes`, and the end of some bytes from there on.
    fn range(&mut self, bytes: &[u8]) -> (usize, usize) {
        let from = self.below(bytes.len());
        (from, (from + 1 + self.below(16)).min(bytes.len()))
    }
}

/// Returns `seed` with some changes, as fuzzers make them: other bits and bytes, pieces that are cut, doubled or another seed's.
fn changed(seed: &[u8], other: &[u8], numbers: &mut Numbers) -> Vec<u8> {
    const ODD: [u8; 8] = [0, 1, 0x7f, 0x80, 0xd8, 0xff, b'\n', b'$'];
    let mut bytes = seed.to_vec();
    for _ in 0..=numbers.below(6) {
        if bytes.is_empty() {
            break;
        }
        let (from, to) = numbers.range(&bytes);
        match numbers.below(6) {
            0 => bytes[from] ^= 1 << numbers.below(8),
            1 => bytes[from] = ODD[numbers.below(ODD.len())],
            2 => drop(bytes.drain(from..to)),
            3 => bytes.extend_from_within(from..to),
            4 => bytes.truncate(from + 1),
            _ => {
                let (begins, ends) = numbers.range(other);
                bytes.splice(from..from, other.get(begins..ends).unwrap_or_default().iter().copied());
            }
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The crates with targets; each holds its own to their programs.
    const CRATES: [&str; 3] = ["videofields_picture", "videofields_recording", "videofields_vision"];

    #[test]
    fn every_program_is_built_runs_a_target_of_its_name_and_has_seeds() {
        let manifest = std::fs::read_to_string(fuzz_folder().join("Cargo.toml")).unwrap();
        let bins = manifest.split("[[bin]]").skip(1).map(|bin| {
            let name =
                bin.lines().find_map(|line| line.strip_prefix("name = \"")?.strip_suffix('"')).unwrap();
            assert!(bin.contains(&format!("path = \"targets/{name}.rs\"")), "{name} is another file");
            name.to_owned()
        });
        let bins: Vec<_> = bins.collect();
        let programs = programs();
        for (name, runs) in &programs {
            let of_crate = runs.strip_suffix(&format!("::fuzzing::{name}"));
            assert!(of_crate.is_some_and(|of_crate| CRATES.contains(&of_crate)), "{name} runs {runs}");
            assert!(N_SEEDS.contains(&seeds(name).len()), "{name}");
        }
        let names: Vec<_> = programs.into_iter().map(|(name, _)| name).collect();
        assert_eq!(bins, names, "programs of tests/fuzz/Cargo.toml, by name, and files of its targets");
        let entries = std::fs::read_dir(fuzz_folder().join("seeds")).unwrap();
        let mut seeds: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        seeds.sort();
        assert_eq!(seeds, names, "folders of seeds");
    }

    #[test]
    fn changes_are_the_same_each_time_and_none_is_left_out() {
        let (seed, other) = (b"abcdefghijklmnopqrstuvwxyz".as_slice(), b"0123456789".as_slice());
        let all = |n: u64| {
            let mut numbers = Numbers(n);
            (0..200).map(|_| changed(seed, other, &mut numbers)).collect::<Vec<_>>()
        };
        assert_eq!(all(1), all(1));
        let made = all(1);
        assert!(made.iter().any(|bytes| bytes.len() < seed.len()), "cut");
        assert!(made.iter().any(|bytes| bytes.iter().any(u8::is_ascii_digit)), "another's");
        assert!(made.iter().any(|bytes| bytes.contains(&0xff)), "odd");
    }
}
