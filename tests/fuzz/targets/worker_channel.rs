//! Runs `videofields_recording::fuzzing::worker_channel` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::worker_channel(data);
});
