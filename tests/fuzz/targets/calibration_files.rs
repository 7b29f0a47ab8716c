//! Runs `videofields_vision::fuzzing::calibration_files` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_vision::fuzzing::calibration_files(data);
});
