//! At which size a camera's pictures are looked at.

use serde::{Deserialize, Serialize};

/// Pixels that [`Resolution::Auto`] leaves at most, unless a quarter of each side is still more.
const GREATEST_AUTO_PIXELS: u64 = 600_000;

/// At which size of a camera's picture its background is learned and its foreground found. Masks, blobs and the
/// background picture are of the full size all the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Resolution {
    /// The largest of the others that leaves at most 600,000 pixels: 1280 x 720 and 1920 x 1080 are halved, 3840 x 2160
    /// quartered.
    #[default]
    Auto,
    /// Every pixel.
    Full,
    /// Half the columns and half the rows.
    Half,
    /// A quarter of the columns and of the rows.
    Quarter,
}

impl Resolution {
    /// By how much the sides of a picture of `size_px` are reduced: 1, 2 or 4.
    #[must_use]
    pub fn factor_in(self, size_px: (u32, u32)) -> u32 {
        match self.chosen_in(size_px) {
            Self::Half => 2,
            Self::Quarter => 4,
            Self::Full | Self::Auto => 1,
        }
    }

    /// What it comes to for pictures of `size_px`; never [`Self::Auto`].
    #[must_use]
    pub fn chosen_in(self, size_px: (u32, u32)) -> Self {
        if self != Self::Auto {
            return self;
        }
        let n_pixels =
            |factor: u32| u64::from(size_px.0.div_ceil(factor)) * u64::from(size_px.1.div_ceil(factor));
        if n_pixels(1) <= GREATEST_AUTO_PIXELS {
            Self::Full
        } else if n_pixels(2) <= GREATEST_AUTO_PIXELS {
            Self::Half
        } else {
            Self::Quarter
        }
    }

    /// Its name in settings.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Full => "full",
            Self::Half => "half",
            Self::Quarter => "quarter",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_leaves_as_many_pixels_as_people_need() {
        let chosen = |width, height| Resolution::Auto.chosen_in((width, height));
        for (width, height) in [(1, 1), (320, 240), (640, 360), (768, 576), (800, 600), (1000, 600)] {
            assert_eq!(chosen(width, height), Resolution::Full, "{width} x {height}");
        }
        for (width, height) in [(1001, 600), (1024, 768), (1280, 720), (1920, 1080)] {
            assert_eq!(chosen(width, height), Resolution::Half, "{width} x {height}");
        }
        for (width, height) in [(2592, 1944), (3840, 2160), (7680, 4320), (u32::MAX, u32::MAX)] {
            assert_eq!(chosen(width, height), Resolution::Quarter, "{width} x {height}");
        }
    }

    #[test]
    fn what_is_named_holds_at_every_size() {
        for (resolution, factor) in [(Resolution::Full, 1), (Resolution::Half, 2), (Resolution::Quarter, 4)] {
            for size_px in [(1, 1), (1280, 720), (7680, 4320)] {
                assert_eq!(resolution.chosen_in(size_px), resolution);
                assert_eq!(resolution.factor_in(size_px), factor);
            }
            assert_eq!(serde_json::to_value(resolution).unwrap(), resolution.as_str());
        }
        assert_eq!(Resolution::Auto.factor_in((1280, 720)), 2);
    }
}
