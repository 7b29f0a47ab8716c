//! The stage `map`: from texels to world points, judged in metres against the simulator's depth.
//!
//! What stands in the world and not in the scene (parked cars, trees) is no map's to know:
//! such texels are counted and left out. The unit of work that is timed is the map of one camera.

use super::SweepError;
use super::gate::Stopwatch;
use super::subject::{Subject, SubjectCamera};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;
use videofields_picture::plan::Spread;
use videofields_vision::geometry::Surfaces;
use videofields_vision::mapping::{Builder, MappingError, RELIABLE_THETA_RAD, WorldMap};
use videofields_vision::measures::distance_figures;

/// Cameras whose maps are built, at most: the first ones.
pub const MAX_MAP_CAMERAS: usize = 4;

/// A map that takes longer than this is built once, milliseconds.
const LONG_BUILD_MS: f64 = 2000.0;

/// The simulator's depth and the scene's may differ by this much, metres and share of the depth, where both mean the
/// same surface: depth is kept as f32 and documents in millimetres.
const SAME_DEPTH: (f64, f64) = (0.01, 1e-3);

/// What one builder gives.
#[derive(Debug, Default)]
pub struct MapRun {
    /// Distances between the map's points and the true ones, of reliable texels, metres.
    distances_m: Vec<f64>,
    /// Texels that show a surface, those of them that show it reliably, and the latter without an entry.
    n_shown: u64,
    n_reliable: u64,
    n_missing: u64,
    /// Texels that show nothing and have an entry all the same.
    n_spurious: u64,
    /// Texels that show what the scene does not know.
    n_unmodelled: u64,
    n_texels: u64,
    times_ms: Vec<f64>,
    bytes: u64,
    n_cameras: u64,
}

impl MapRun {
    /// Builds the maps of at most [`MAX_MAP_CAMERAS`] cameras, `n_builds` times each, once where it takes long.
    ///
    /// # Errors
    /// When the builder refuses (too many points), or the gate ends it.
    pub fn of(
        subject: &Subject,
        builder: Builder,
        n_builds: u32,
        watch: &Stopwatch<'_>,
    ) -> Result<Self, SweepError> {
        let mut run = Self::default();
        for _ in 0..n_builds.max(1) {
            run.build(subject, builder, watch)?;
        }
        Ok(run)
    }

    /// One more round over the cameras, unless the maps take long; the first is judged.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub fn build(
        &mut self,
        subject: &Subject,
        builder: Builder,
        watch: &Stopwatch<'_>,
    ) -> Result<(), SweepError> {
        if self.times_ms.iter().any(|time_ms| *time_ms > LONG_BUILD_MS) {
            return Ok(());
        }
        let is_first = self.times_ms.is_empty();
        let surfaces = &subject.scene.surfaces;
        for camera in subject.cameras.iter().take(MAX_MAP_CAMERAS) {
            let build = || builder.build(&camera.camera, surfaces, camera.camera.size_px());
            let (map, time_ms): (Result<WorldMap, MappingError>, f64) = watch.again(build)?;
            let map = map?;
            self.times_ms.push(time_ms);
            if is_first {
                self.judge(camera, surfaces, &map);
            }
        }
        Ok(())
    }

    fn judge(&mut self, camera: &SubjectCamera, surfaces: &Surfaces, map: &WorldMap) {
        self.bytes += map.len_bytes() as u64;
        self.n_cameras += 1;
        let (width, height) = map.size_px();
        for (column, row) in (0..height).flat_map(|row| (0..width).map(move |column| (column, row))) {
            self.n_texels += 1;
            let found = map.texel(column, row);
            let (point, theta_rad) = match truth(camera, surfaces, column, row) {
                Shown::Nothing => {
                    self.n_spurious += u64::from(found.is_some());
                    continue;
                }
                Shown::Unmodelled => {
                    self.n_unmodelled += 1;
                    continue;
                }
                Shown::Surface { point, theta_rad } => (point, theta_rad),
            };
            self.n_shown += 1;
            if theta_rad < RELIABLE_THETA_RAD {
                continue;
            }
            self.n_reliable += 1;
            match found {
                Some(location) => self.distances_m.push(location.point_in_world.distance(point)),
                None => self.n_missing += 1,
            }
        }
    }

    /// Of one camera's map.
    #[must_use]
    pub fn time_ms(&self) -> Option<Spread> {
        Spread::of(&self.times_ms)
    }

    /// Bytes of one camera's map, the mean over the cameras.
    #[must_use]
    pub const fn memory_bytes(&self) -> u64 {
        match self.bytes.checked_div(self.n_cameras) {
            Some(bytes) => bytes,
            None => 0,
        }
    }

    /// What is reported: the main error, the mean distance in metres, and every measure by name.
    #[must_use]
    pub fn measures(&self) -> (Option<f64>, BTreeMap<String, f64>) {
        let figures = distance_figures(self.distances_m.clone());
        let share = |part: u64, whole: u64| (whole > 0).then(|| part as f64 / whole as f64);
        let named = [
            ("mean_m", figures.map(|[mean, ..]| mean)),
            ("p95_m", figures.map(|[_, p95, _]| p95)),
            ("worst_m", figures.map(|[.., worst]| worst)),
            ("missing_share", share(self.n_missing, self.n_reliable)),
            ("spurious_share", share(self.n_spurious, self.n_texels)),
            ("unmodelled_share", share(self.n_unmodelled, self.n_texels)),
            ("reliable_share", share(self.n_reliable, self.n_shown)),
        ];
        (figures.map(|[mean, ..]| mean), super::named(named))
    }
}

/// What a texel's centre shows of the still world.
enum Shown {
    /// Sky, or nothing at all.
    Nothing,
    /// Something that the scene's surfaces lack.
    Unmodelled,
    /// One of the scene's surfaces, where the simulator's depth says; the angle between ray and surface.
    Surface { point: DVec3, theta_rad: f64 },
}

fn truth(camera: &SubjectCamera, surfaces: &Surfaces, column: u32, row: u32) -> Shown {
    let (width, height) = camera.camera.size_px();
    let texel = row as usize * width as usize + column as usize;
    let depth_m = camera.depth_m.get(texel).copied().map_or(0.0, f64::from);
    let size = DVec2::new(f64::from(width), f64::from(height));
    let texture = (DVec2::new(f64::from(column), f64::from(row)) + 0.5) / size;
    let Some(ray) = camera.camera.ray(texture) else { return Shown::Nothing };
    let along_axis = ray.direction.dot(camera.camera.pose().forward_in_world());
    let hit = surfaces.hit(&ray, 0.0);
    if depth_m <= 0.0 || along_axis <= 0.0 {
        return if hit.is_some() { Shown::Unmodelled } else { Shown::Nothing };
    }
    let distance_m = depth_m / along_axis;
    let (metres, share) = SAME_DEPTH;
    match hit {
        Some(hit) if (hit.distance_m - distance_m).abs() <= metres + share * distance_m => {
            Shown::Surface { point: ray.at(distance_m), theta_rad: hit.angle_to_surface_rad(&ray) }
        }
        _ => Shown::Unmodelled,
    }
}
