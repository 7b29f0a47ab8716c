//! Shadows: who casts them, and how soft their edges are.
//!
//! Settings and directions towards a disc of sun; whether something stands in the way is `cast`'s to find out.

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// What casts shadows; everything receives them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Casters {
    /// What stands alone: buildings, boxes, trees. Actors cast none.
    Still,
    /// What stands and what moves.
    #[default]
    All,
}

/// Settings of shadows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CastShadows {
    /// What casts them: `still` or `all`. Default `all`.
    pub casters: Casters,
    /// Diameter of the sun as seen from the ground, degrees, 0 (hard edges) to 20; the real one has 0.53, haze
    /// makes it wider. Default 0.
    pub sun_diameter_deg: f64,
}

impl Default for CastShadows {
    fn default() -> Self {
        Self { casters: Casters::All, sun_diameter_deg: 0.0 }
    }
}

impl CastShadows {
    /// Hard shadows of what stands alone, as the plaza has them.
    pub const STILL: Self = Self { casters: Casters::Still, sun_diameter_deg: 0.0 };

    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("sun_diameter_deg", self.sun_diameter_deg, 0.0..=20.0);
    }

    /// Whether what moves casts shadows too.
    #[must_use]
    pub const fn actors_cast(&self) -> bool {
        matches!(self.casters, Casters::All)
    }

    /// Direction in which the sun is looked for; `draw` and `index` choose a place on its disc, evenly.
    #[must_use]
    pub fn towards_sun(&self, to_sun: DVec3, draw: Draw, index: u64, tally: &Tally<'_>) -> DVec3 {
        tally.enter(EffectKind::CastShadows);
        if self.sun_diameter_deg <= 0.0 {
            return to_sun;
        }
        let radius = (self.sun_diameter_deg * 0.5).to_radians().tan();
        let (across, up) = to_sun.any_orthonormal_pair();
        let reach = radius * draw.unit(2 * index).sqrt();
        let (sin, cos) = (TAU * draw.unit(2 * index + 1)).sin_cos();
        (to_sun + (across * cos + up * sin) * reach).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn the_sun_is_looked_for_on_its_disc() {
        let to_sun = DVec3::new(-0.6, 0.0, 0.8);
        let entries = Entries::default();
        let draw = Draw::of_camera(0, "a");
        let hard = CastShadows::STILL.towards_sun(to_sun, draw, 3, &entries.tally());
        assert_eq!(hard, to_sun, "not a bit of a hard shadow changes");
        let soft = CastShadows { sun_diameter_deg: 2.0, ..CastShadows::default() };
        let (mut sum, mut far) = (DVec3::ZERO, 0.0_f64);
        for index in 0..2000 {
            let direction = soft.towards_sun(to_sun, draw, index, &entries.tally());
            far = far.max(direction.angle_between(to_sun).to_degrees());
            sum += direction;
        }
        assert!((0.95..=1.0).contains(&far), "{far}");
        assert!(sum.angle_between(to_sun).to_degrees() < 0.05);
        assert_eq!(entries.count(EffectKind::CastShadows), 2001);
    }
}
