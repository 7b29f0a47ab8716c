//! Feeds the readers of configurations, calibrations and messages of what moves with bytes that nobody sends in earnest, and holds it to what is true of them all the same.
//!
//! Each function takes any bytes, tells how many things it found in them, and panics where something does not hold. `make fuzz` runs
//! them under a fuzzer (`tests/fuzz`), and the test below over the fuzzer's seeds and some thousand changes of them.

pub use crate::calibrate::fuzzing::calibration_files;
pub use crate::config::fuzzing::configuration;
pub use crate::encode::fuzzing::foreground_messages;

/// Takes any bytes, and tells how many things it found in them.
pub type Target = fn(&[u8]) -> usize;

/// All targets, by the names of their programs and of their seeds' folders.
pub const TARGETS: [(&str, Target); 3] = [
    ("calibration_files", calibration_files),
    ("configuration", configuration),
    ("foreground_messages", foreground_messages),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_holds_on_its_seeds_and_on_changes_of_them() {
        videofields_seeds::hold(&TARGETS);
    }

    #[test]
    fn every_target_has_a_program() {
        videofields_seeds::have_programs("videofields_vision", &TARGETS);
    }
}
