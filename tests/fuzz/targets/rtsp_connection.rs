//! Runs `videofields_recording::fuzzing::rtsp_connection` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::rtsp_connection(data);
});
