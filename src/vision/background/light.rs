//! When the whole picture changes at once: a light switched on, a camera turned or put out of focus.
//!
//! The share of foreground pixels flows in, frame by frame; the moment at which the model should learn afresh flows
//! out. Knows nothing of pixels.

/// More foreground than this share of the picture is a change of the whole.
const CHANGED_SHARE: f64 = 0.5;

/// A change is believed once it lasted longer than this many frames ...
const CHANGED_FRAMES: u32 = 5;

/// ... and this many seconds, so that a lorry close to a fast camera does not count.
const CHANGED_SECS: f64 = 0.5;

/// How long most of the picture has been foreground.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LightChange {
    /// Frames in a row.
    pub(super) n_frames: u32,
    /// Seconds in a row, from the first of them.
    pub(super) secs: f64,
}

impl LightChange {
    /// Takes one frame that came `dt_secs` after the one before; true at the moment the change is believed, after
    /// which the count begins again.
    pub(super) fn observe(&mut self, foreground_share: f64, dt_secs: f64) -> bool {
        if foreground_share <= CHANGED_SHARE {
            *self = Self::default();
            return false;
        }
        self.n_frames = self.n_frames.saturating_add(1);
        if self.n_frames > 1 {
            self.secs += dt_secs;
        }
        let is_believed = self.n_frames > CHANGED_FRAMES && self.secs >= CHANGED_SECS;
        if is_believed {
            *self = Self::default();
        }
        is_believed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn change_is_believed_after_frames_and_time() {
        let check = |dt_secs: f64, shares: &[f64], expected: Option<usize>| {
            let mut change = LightChange::default();
            let found = shares.iter().position(|share| change.observe(*share, dt_secs));
            assert_eq!(found, expected, "{dt_secs} {shares:?}");
        };
        check(0.1, &[0.9; 20], Some(5));
        check(0.01, &[0.9; 20], None);
        check(0.04, &[0.9; 20], Some(13));
        check(10.0, &[0.9; 5], None);
        check(0.1, &[0.9, 0.9, 0.9, 0.9, 0.1, 0.9, 0.9, 0.9, 0.9, 0.9], None);
        check(0.1, &[0.5; 100], None);
    }
}
