//! Runs `videofields_recording::fuzzing::database_copies` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::database_copies(data);
});
