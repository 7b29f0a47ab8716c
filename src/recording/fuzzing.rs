//! Feeds whatever parses bytes from outside with bytes that nobody sends in earnest, and holds it to what is true of them all the same.
//!
//! Each function takes any bytes, tells how many things it found in them, and panics where something does not hold. `make fuzz` runs
//! them under a fuzzer (`tests/fuzz`), and the test below over the fuzzer's seeds and some thousand changes of them.

pub use crate::media::fuzzing::{
    codec_headers, http_pictures, login_challenges, rtsp_connection, rtsp_description, worker_channel,
    worker_messages,
};
pub use crate::onvif::fuzzing::onvif_answers;

/// Takes any bytes, and tells how many things it found in them.
pub type Target = fn(&[u8]) -> usize;

/// All targets, by the names of their programs and of their seeds' folders.
pub const TARGETS: [(&str, Target); 8] = [
    ("codec_headers", codec_headers),
    ("http_pictures", http_pictures),
    ("login_challenges", login_challenges),
    ("onvif_answers", onvif_answers),
    ("rtsp_connection", rtsp_connection),
    ("rtsp_description", rtsp_description),
    ("worker_channel", worker_channel),
    ("worker_messages", worker_messages),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::{Path, PathBuf};

    /// Most bytes of a seed.
    const MAX_SEED_BYTES: usize = 2048;

    /// Changes that are made to each seed.
    const N_CHANGED: u64 = 60;

    fn fuzz_folder() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz")
    }

    /// The seeds of a target by name.
    fn seeds(target: &str) -> Vec<(String, Vec<u8>)> {
        let folder = fuzz_folder().join("seeds").join(target);
        let entries =
            std::fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        let mut seeds: Vec<_> = entries
            .map(|entry| {
                let entry = entry.unwrap();
                (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap())
            })
            .collect();
        seeds.sort();
        seeds
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

    #[test]
    fn every_target_holds_on_its_seeds_and_on_changes_of_them() {
        for (name, target) in TARGETS {
            let seeds = seeds(name);
            assert!((5..=15).contains(&seeds.len()), "{name} has {} seeds", seeds.len());
            let mut numbers = Numbers(1);
            for (file, seed) in &seeds {
                assert!(seed.len() <= MAX_SEED_BYTES, "{name}/{file} has {} bytes", seed.len());
                let n_found = target(seed);
                // Others are there for what is not to be found in them.
                assert!(n_found > 0 || file.starts_with("odd"), "{name}/{file}: nothing is found in it");
                for _ in 0..N_CHANGED {
                    let other = &seeds[numbers.below(seeds.len())].1;
                    target(&changed(seed, other, &mut numbers));
                }
            }
        }
    }

    #[test]
    fn every_target_has_a_program() {
        let manifest = std::fs::read_to_string(fuzz_folder().join("Cargo.toml")).unwrap();
        for (name, _) in TARGETS {
            assert!(manifest.contains(&format!("name = \"{name}\"")), "{name} is no program of tests/fuzz");
            let program = fuzz_folder().join(format!("targets/{name}.rs"));
            let program = std::fs::read_to_string(&program).unwrap();
            assert!(program.contains(&format!("fuzzing::{name}(")), "{name} runs another target");
        }
        assert_eq!(manifest.matches("[[bin]]").count(), TARGETS.len());
    }
}
