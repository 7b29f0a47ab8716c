//! What of a picture is timed by itself, and what each of these times depends on.

use super::work::{Feature, Work};

/// What is timed by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimedStage {
    /// Putting together what cameras saw, and deciding.
    Fuse,
    /// Pictures onto the device.
    Yuv,
    /// Depth maps.
    CameraDepth,
    /// Surfaces.
    Surface,
    /// What moves, and what is open before it.
    Entities,
    /// Averaging and enlarging.
    Resample,
    /// A sky of several colours, and what is done to the picture once the scene is drawn.
    Effects,
    /// All else of drawing: waiting, reading back.
    Rest,
}

use Feature as F;

/// A stage's name, and what its time depends on: each feature with a first guess, milliseconds a unit, of two processors that
/// rasterise.
pub(super) type StageForm = (&'static str, &'static [(Feature, f64)]);

/// By [`TimedStage`].
pub(super) const STAGES: [StageForm; 8] = [
    (
        "fuse",
        &[(F::One, 0.3), (F::Cameras, 0.1), (F::Sources, 5.0), (F::Points, 0.3), (F::Silhouettes, 80.0)],
    ),
    ("yuv", &[(F::Uploads, 3.0)]),
    ("camera_depth", &[(F::DepthMaps, 12.0)]),
    (
        "surface",
        &[
            (F::One, 0.3),
            (F::Parts, 0.2),
            (F::Drawn, 2.0),
            (F::Sampled, 8.0),
            (F::Surface, 3.0),
            (F::Nearest, 7.0),
            (F::Bilinear, 11.0),
            (F::Levels, 14.0),
            (F::DepthTests, 5.0),
            (F::Fields, 10.0),
            (F::Lenses, 5.0),
            (F::SurfacePrograms, 40.0),
        ],
    ),
    (
        "entities",
        &[
            (F::Rectangles, 12.0),
            (F::Entities, 1.0),
            (F::Points, 0.2),
            (F::HullRays, 200.0),
            (F::HullMeshes, 2000.0),
            (F::Later, 0.5),
            (F::EntityPrograms, 40.0),
        ],
    ),
    ("resample", &[(F::Resampled, 2.0), (F::ResamplePrograms, 10.0)]),
    (
        "effects",
        &[
            (F::Sky, 8.0),
            (F::Relit, 30.0),
            (F::Occluded, 90.0),
            (F::Stippled, 25.0),
            (F::EffectPrograms, 15.0),
        ],
    ),
    (
        "rest",
        &[
            (F::One, 1.5),
            (F::Parts, 0.5),
            (F::Finished, 4.0),
            (F::Drawn, 0.5),
            (F::Uploads, 2.0),
            (F::HullMeshes, 200.0),
        ],
    ),
];

/// Features that grow with the pixels of a picture.
const OF_PIXELS: [Feature; 17] = [
    F::Drawn,
    F::Sampled,
    F::Surface,
    F::Nearest,
    F::Bilinear,
    F::Levels,
    F::DepthTests,
    F::Lenses,
    F::Rectangles,
    F::HullRays,
    F::Later,
    F::Resampled,
    F::Finished,
    F::Sky,
    F::Relit,
    F::Occluded,
    F::Stippled,
];

impl Work {
    /// Returns about what the pixels take two processors that rasterise, milliseconds, by the first guess: the same for the same picture and
    /// settings, whatever was measured since and whatever the device has already.
    #[must_use]
    pub fn guessed_pixels_ms(&self) -> f64 {
        let features = STAGES.iter().flat_map(|(_, features)| *features);
        let of_pixels = features.filter(|(feature, _)| OF_PIXELS.contains(feature));
        of_pixels.map(|(feature, guess_ms)| guess_ms * self.of(*feature)).sum()
    }
}

/// How many stages there are.
pub(super) const N_STAGES: usize = STAGES.len();

/// Times by stage, milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimes(pub(super) [f64; N_STAGES]);

impl StageTimes {
    /// A picture's times by the names of its passes, where `render` took `render_ms` as a whole and what came before it
    /// `fuse_ms`. Of a device that tells no passes all is [`TimedStage::Rest`].
    #[must_use]
    pub fn of<'a>(fuse_ms: f64, render_ms: f64, passes: impl Iterator<Item = (&'a str, f64)>) -> Self {
        let mut times = Self::default();
        times.0[TimedStage::Fuse as usize] = fuse_ms;
        let mut of_passes = 0.0;
        for (pass, ms) in passes {
            let stage = match pass {
                "yuv" => TimedStage::Yuv,
                "camera_depth" => TimedStage::CameraDepth,
                "fields" | "surface" => TimedStage::Surface,
                "billboard" | "points" | "hull_rays" | "hull_trim" | "hull_peel" | "hull_voxels" | "hull"
                | "see_through" | "mesh_depths" | "mesh_sight" | "mesh_smooth" | "mesh_colors"
                | "mesh_carry" | "mesh_weights" | "fields_topology" | "fields_distances"
                | "changing_mesh" => TimedStage::Entities,
                "average" | "enlarge" => TimedStage::Resample,
                "sky" | "distance" | "relight" | "occlusion" | "stipple" => TimedStage::Effects,
                _ => continue,
            };
            times.0[stage as usize] += ms;
            of_passes += ms;
        }
        times.0[TimedStage::Rest as usize] = (render_ms - of_passes).max(0.0);
        times
    }

    /// A stage's time, milliseconds.
    #[must_use]
    pub const fn stage(&self, stage: TimedStage) -> f64 {
        self.0[stage as usize]
    }

    /// All of them together, milliseconds.
    #[must_use]
    pub fn sum(&self) -> f64 {
        self.0.iter().sum()
    }

    /// Names and times.
    pub fn named(&self) -> impl Iterator<Item = (&'static str, f64)> {
        STAGES.iter().zip(self.0).map(|((name, _), ms)| (*name, ms))
    }

    /// Whether all of them are times.
    pub(super) fn is_good(&self) -> bool {
        self.0.iter().all(|ms| ms.is_finite() && *ms >= 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_guessed_by_what_grows_with_them_alone() {
        let mut work = Work::default();
        for once in [F::One, F::Parts, F::Uploads, F::DepthMaps, F::SurfacePrograms, F::Silhouettes] {
            work.set(once, 100.0);
        }
        assert_eq!(work.guessed_pixels_ms(), 0.0);
        work.set(F::Drawn, 2.0);
        // On surfaces, and on reading back.
        assert_eq!(work.guessed_pixels_ms(), 2.0 * (2.0 + 0.5));
        work.set(F::HullRays, 3.0);
        assert_eq!(work.guessed_pixels_ms(), 5.0 + 600.0);
    }
}
