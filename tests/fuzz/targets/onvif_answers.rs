//! Runs `videofields_recording::fuzzing::onvif_answers` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::onvif_answers(data);
});
