//! Runs `videofields_recording::fuzzing::http_pictures` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::http_pictures(data);
});
