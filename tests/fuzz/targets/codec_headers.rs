//! Runs `videofields_recording::fuzzing::codec_headers` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::codec_headers(data);
});
