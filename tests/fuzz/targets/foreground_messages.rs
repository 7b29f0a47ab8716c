//! Runs `videofields_vision::fuzzing::foreground_messages` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_vision::fuzzing::foreground_messages(data);
});
