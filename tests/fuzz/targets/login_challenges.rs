//! Runs `videofields_recording::fuzzing::login_challenges` under libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    videofields_recording::fuzzing::login_challenges(data);
});
