//! Whether a light or an exposure was switched.
//!
//! The share of foreground flows in frame by frame, and at each look how much of the picture is darker or lighter than
//! the place; whether another light is on flows out. Who passes close to the camera covers the place's edges, and
//! leaves it as it was: a light is told only once the edges are seen and most of the picture differs all the same.

/// More foreground than this share of the picture begins a change ...
const SUSPECT_SHARE: f64 = 0.5;

/// ... if it lasts so many frames and so many seconds: as the background's own change of light.
const SUSPECT_FRAMES: u32 = 5;
const SUSPECT_SECS: f64 = 0.4;

/// The looks' mean shows only what was after the change, so many seconds after it.
const SETTLE_SECS: f64 = 2.5;

/// A mean of what stood before the place and of the place itself shows the place's edges in another light: the place
/// must have been seen for so many seconds.
const UNMIXED_SECS: f64 = 2.0;

/// A change that was neither confirmed nor refuted by then is forgotten.
const FORGET_SECS: f64 = 15.0;

/// Share of the picture that differs when a change is told, and at the end of it.
const CHANGED_SHARE: f64 = 0.5;
const ADAPTED_SHARE: f64 = 0.2;

/// Levels by which a cell differs.
pub(super) const CHANGED_LEVELS: f32 = 10.0;

/// What is known of the light.
#[derive(Debug, Default)]
pub(super) struct Light {
    n_frames: u32,
    secs: f64,
    /// Seconds since a change was suspected.
    suspected_secs: Option<f64>,
    is_changed: bool,
}

impl Light {
    /// Takes a frame's share of foreground.
    pub(super) fn observe(&mut self, foreground_share: f64, step_secs: f64) {
        if let Some(secs) = &mut self.suspected_secs {
            *secs += step_secs;
        }
        if foreground_share <= SUSPECT_SHARE {
            (self.n_frames, self.secs) = (0, 0.0);
            return;
        }
        self.n_frames = self.n_frames.saturating_add(1);
        if self.n_frames > 1 {
            self.secs += step_secs;
        }
        if self.n_frames > SUSPECT_FRAMES && self.secs >= SUSPECT_SECS && self.suspected_secs.is_none() {
            self.suspected_secs = Some(0.0);
        }
    }

    /// Takes a look, the last of `sound_secs` seconds in which the place was seen where it belongs, and the share of
    /// the picture that differs from it; whether it stands in another light.
    pub(super) fn look(&mut self, sound_secs: f64, changed_share: f64) -> bool {
        let is_sound = sound_secs >= UNMIXED_SECS;
        if self.is_changed && is_sound && changed_share <= ADAPTED_SHARE {
            self.is_changed = false;
        }
        let Some(secs) = self.suspected_secs else { return self.is_changed };
        if secs >= SETTLE_SECS && is_sound {
            self.is_changed |= changed_share >= CHANGED_SHARE;
            self.suspected_secs = None;
        } else if secs >= FORGET_SECS {
            self.suspected_secs = None;
        }
        self.is_changed
    }
}
