//! Runs `videofields_recording::fuzzing::worker_messages` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::worker_messages(data);
});
