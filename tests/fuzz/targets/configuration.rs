//! Runs `videofields_vision::fuzzing::configuration` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_vision::fuzzing::configuration(data);
});
