//! The stage `map`: from texels to world points, judged in metres against the simulator's depth.
//!
//! The unit of work that is timed is the map of one camera.

use super::SweepError;
use super::gate::Stopwatch;
use super::measures::distance_figures;
use super::subject::{Subject, SubjectCamera};
use crate::geometry::Surfaces;
use crate::mapping::{Builder, MappingError, RELIABLE_THETA_RAD, WorldMap};
use crate::plan::Spread;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

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
    n_texels: u64,
    times_ms: Vec<f64>,
    bytes: u64,
    n_cameras: u64,
}

impl MapRun {
    /// Builds every camera's map, `n_builds` times each.
    ///
    /// # Errors
    /// When the builder refuses (too many points), or the gate ends it.
    pub fn of(
        subject: &Subject,
        builder: Builder,
        n_builds: u32,
        watch: &Stopwatch<'_>,
    ) -> Result<Self, SweepError> {
        let surfaces = &subject.scene.surfaces;
        let mut run = Self::default();
        for camera in &subject.cameras {
            let mut built: Option<WorldMap> = None;
            for _ in 0..n_builds.max(1) {
                let build = || builder.build(&camera.camera, surfaces, camera.camera.size_px());
                let (map, time_ms): (Result<WorldMap, MappingError>, f64) = watch.again(build)?;
                built = Some(map?);
                run.times_ms.push(time_ms);
            }
            if let Some(map) = built {
                run.judge(camera, surfaces, &map);
            }
        }
        Ok(run)
    }

    fn judge(&mut self, camera: &SubjectCamera, surfaces: &Surfaces, map: &WorldMap) {
        self.bytes += map.len_bytes() as u64;
        self.n_cameras += 1;
        let (width, height) = map.size_px();
        for (column, row) in (0..height).flat_map(|row| (0..width).map(move |column| (column, row))) {
            self.n_texels += 1;
            let found = map.texel(column, row);
            let Some((point, theta_rad)) = truth(camera, surfaces, column, row) else {
                self.n_spurious += u64::from(found.is_some());
                continue;
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
            ("reliable_share", share(self.n_reliable, self.n_shown)),
        ];
        (figures.map(|[mean, ..]| mean), super::named(named))
    }
}

/// What a texel's centre shows of the still world, by the simulator's depth, and the angle between ray and surface.
fn truth(camera: &SubjectCamera, surfaces: &Surfaces, column: u32, row: u32) -> Option<(DVec3, f64)> {
    let (width, height) = camera.camera.size_px();
    let depth_m = f64::from(*camera.depth_m.get(row as usize * width as usize + column as usize)?);
    let texture = (DVec2::new(f64::from(column), f64::from(row)) + 0.5)
        / DVec2::new(f64::from(width), f64::from(height));
    let ray = camera.camera.ray(texture)?;
    let along_axis = ray.direction.dot(camera.camera.pose().forward_in_world());
    if depth_m <= 0.0 || along_axis <= 0.0 {
        return None;
    }
    let theta_rad = surfaces.hit(&ray, 0.0)?.angle_to_surface_rad(&ray);
    Some((ray.at(depth_m / along_axis), theta_rad))
}
