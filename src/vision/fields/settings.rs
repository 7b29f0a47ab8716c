//! Which stages of a field are run, and how exactly: each can be off.
//!
//! `[M19]` Du et al. 2019, `Montage4D`, sections 4.2 to 4.5.

use super::{Visibility, VoteLevels};
use crate::error::one_of;

/// So many pixels wrong depths are taken to be: what a mesh that was made of the pictures themselves is off by (measured on the castle, in
/// docs/benchmarks/fields.md; half and twice as much are worse by a hundredth).
pub const DEPTH_PX: f64 = 16.0;

/// How distances from seams are found, from cheap to exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Distances {
    /// They are not: a camera lends up to its seams.
    Off,
    /// By one front.
    Marching,
    /// In rounds of two windows an edge, as a device does.
    Bounded,
    /// To rounding.
    Exact,
}

impl Distances {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Off, Self::Marching, Self::Bounded, Self::Exact];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Marching => "marching",
            Self::Bounded => "bounded",
            Self::Exact => "exact",
        }
    }
}

impl std::str::FromStr for Distances {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        one_of("way to find distances", name, &Self::ALL, Self::name)
    }
}

/// Which cameras lend most to a viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Preference {
    /// Those that look as the viewer does: the cosine between both directions, to a power (`[M19]`).
    Directions {
        /// The power.
        exponent: f64,
    },
    /// Those whose colours are least beside where the viewer sees them: by how a wrong depth is seen from another direction, and by how
    /// large a pixel is on the surface (after `[B01]` Buehler et al. 2001, Unstructured lumigraph rendering, section 3: angles and
    /// resolutions, both in metres here).
    Errors {
        /// How wrong depths are, metres; if none [`DEPTH_PX`] of the finest pixels on the surface, in the median, and no less than half
        /// of a mean edge, which is what the mesh itself leaves out.
        depth_m: Option<f64>,
        /// To which power the reciprocal of an error counts.
        exponent: f64,
    },
}

/// Which stages of a field are run, and how exactly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSettings {
    /// How hidden vertices are found.
    pub visibility: Visibility,
    /// Texels of depth maps along their longer side, at least 1.
    pub depth_map_px: u32,
    /// Levels of detail in which cameras vote on each other, if they do: where meshes lack what hides, as people; else it costs more than it
    /// mends (docs/benchmarks/fields.md).
    pub vote: Option<VoteLevels>,
    /// How distances from seams are found.
    pub distances: Distances,
    /// How far from its seams a camera lends in full, metres; if none what fifteen triangles reach.
    pub reach_m: Option<f64>,
    /// How often what weights are made of goes halfway to its neighbours' mean, 0 to leave it as it is: so far steps from vertex to
    /// vertex are spread, some four edges at 10.
    pub smoothing_rounds: u32,
    /// Whether pictures are evened out first.
    pub is_evened: bool,
    /// Which cameras are preferred where several are believed.
    pub preference: Preference,
    /// Exponent of the share of all vertices that a camera sees: 1 as `[M19]` has it, for one thing in the middle of all cameras; 0 for
    /// places of which cameras see parts, where who sees less may see it from nearer.
    pub coverage_exponent: f64,
    /// Exponent of the cosine between a surface's normal and the direction to a camera, in the baseline and what fields fall back to.
    pub normal_exponent: f64,
}

/// How wrong depths of places are taken to be, metres: what a camera that is turned a pixel off shows beside, on ground some tens of metres
/// away. Their surfaces are known better than [`DEPTH_PX`] of pixels, which would be metres (docs/benchmarks/fields.md).
pub const PLACE_DEPTH_M: f64 = 0.1;

impl FieldSettings {
    /// Of a mesh that is another from frame to frame, on a device: one front is off by less than smoothing spreads, and windows would take
    /// most of a frame's time.
    #[must_use]
    pub fn of_changing() -> Self {
        Self { distances: Distances::Marching, ..Self::default() }
    }

    /// Of what stands still in a scene, whose surfaces were measured and not made of pictures.
    #[must_use]
    pub fn of_places() -> Self {
        let preference = Preference::Errors { depth_m: Some(PLACE_DEPTH_M), exponent: 4.0 };
        Self { preference, ..Self::default() }
    }
}

impl Default for FieldSettings {
    fn default() -> Self {
        Self {
            visibility: Visibility::Dilated,
            depth_map_px: 1024,
            vote: None,
            distances: Distances::Exact,
            reach_m: None,
            smoothing_rounds: 10,
            is_evened: true,
            preference: Preference::Errors { depth_m: None, exponent: 4.0 },
            coverage_exponent: 0.0,
            normal_exponent: 2.0,
        }
    }
}
