//! Which encoded frames of a live stream can be decoded right after packets were lost: none until the next whole key frame.

use gstreamer as gst;

/// How long a stream may be without a key frame after a loss; then its frames are taken as they are, since there are
/// streams without key frames that mend themselves bit by bit.
const LONGEST: gst::ClockTime = gst::ClockTime::from_seconds(10);

/// What is known of one stream.
#[derive(Debug, Default)]
pub(super) struct Losses {
    has_begun: bool,
    /// When something was lost that the frames since then build on.
    broken_since: Option<gst::ClockTime>,
}

impl Losses {
    /// Whether the next frame can be decoded right, by its flags; it comes at `now`.
    pub(super) fn is_good(&mut self, flags: gst::BufferFlags, now: gst::ClockTime) -> bool {
        let is_key = !flags.contains(gst::BufferFlags::DELTA_UNIT);
        // What follows a loss is marked so, and may itself be what lacks a part. The first frame follows nothing.
        let follows_loss = self.has_begun && flags.contains(gst::BufferFlags::DISCONT);
        let is_first = !std::mem::replace(&mut self.has_begun, true);
        if follows_loss || (is_first && !is_key) {
            self.broken_since.get_or_insert(now);
        } else if is_key {
            self.broken_since = None;
        }
        if self.broken_since.is_some_and(|since| now.saturating_sub(since) > LONGEST) {
            self.broken_since = None;
        }
        self.broken_since.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_loss_nothing_is_good_until_a_whole_key_frame_or_ten_seconds() {
        let (key, delta) = (gst::BufferFlags::empty(), gst::BufferFlags::DELTA_UNIT);
        let lost = gst::BufferFlags::DISCONT;
        let told = |frames: &[(u64, gst::BufferFlags)]| -> Vec<bool> {
            let mut losses = Losses::default();
            let is_good = |(secs, flags): &(u64, gst::BufferFlags)| {
                losses.is_good(*flags, gst::ClockTime::from_seconds(*secs))
            };
            frames.iter().map(is_good).collect()
        };
        assert_eq!(told(&[(0, key | lost), (1, delta), (2, delta)]), [true; 3]);
        assert_eq!(told(&[(0, delta | lost), (1, delta), (2, key)]), [false, false, true]);
        let frames = [(0, key), (1, delta), (2, delta | lost), (3, delta), (4, key), (5, delta)];
        assert_eq!(told(&frames), [true, true, false, false, true, true]);
        let torn_key = [(0, key), (1, key | lost), (2, delta), (3, key)];
        assert_eq!(told(&torn_key), [true, false, false, true]);
        let without_keys = [(0, key), (1, delta | lost), (6, delta), (11, delta), (12, delta), (13, delta)];
        assert_eq!(told(&without_keys), [true, false, false, false, true, true]);
    }
}
