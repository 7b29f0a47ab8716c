//! Runs `videofields_picture::fuzzing::scene_documents` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_picture::fuzzing::scene_documents(data);
});
