//! Feeds whatever parses bytes from outside with bytes that nobody sends in earnest, and holds it to what is true of them all the same.
//!
//! Each function takes any bytes, tells how many things it found in them, and panics where something does not hold. `make fuzz` runs
//! them under a fuzzer (`tests/fuzz`), and the test below over the fuzzer's seeds and some thousand changes of them.

pub use crate::media::fuzzing::{
    codec_headers, http_pictures, login_challenges, rtsp_connection, rtsp_description, worker_channel,
    worker_messages,
};
pub use crate::onvif::fuzzing::onvif_answers;
pub use crate::store::fuzzing::database_copies;

/// Takes any bytes, and tells how many things it found in them.
pub type Target = fn(&[u8]) -> usize;

/// All targets, by the names of their programs and of their seeds' folders.
pub const TARGETS: [(&str, Target); 9] = [
    ("codec_headers", codec_headers),
    ("database_copies", database_copies),
    ("http_pictures", http_pictures),
    ("login_challenges", login_challenges),
    ("onvif_answers", onvif_answers),
    ("rtsp_connection", rtsp_connection),
    ("rtsp_description", rtsp_description),
    ("worker_channel", worker_channel),
    ("worker_messages", worker_messages),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_holds_on_its_seeds_and_on_changes_of_them() {
        videofields_seeds::hold(&TARGETS);
    }

    #[test]
    fn every_target_has_a_program() {
        videofields_seeds::have_programs("videofields_recording", &TARGETS);
    }
}
