//! Finds vehicles that several cameras show, so that no crowd of people is put where one of them stands.
//!
//! Masks and the cells that nearly all cameras show filled flow in; vehicles that fill their outline flow out. Where each of them stands is
//! association's to tell: here they are only what is nobody.

mod outline;
#[cfg(test)]
mod tests;

use super::evidence::Evidence;
use super::grid::Grid;
use super::silhouette::Silhouette;
use super::{Occupancy, ground_at};
use crate::scene::Scene;
use glam::{DVec2, DVec3};
use outline::Vehicle;
use std::collections::HashMap;
use std::f64::consts::PI;

/// Lengths and heights that are tried first, metres: a car and a van.
const FIRST_M: [[f64; 2]; 2] = [[4.3, 1.5], [5.2, 2.2]];

/// Ranges of lengths and heights, metres.
const LENGTHS_M: [f64; 2] = [3.2, 7.0];
const HEIGHTS_M: [f64; 2] = [1.3, 3.0];

/// Headings that are tried first, half a turn: front and back look alike.
const N_HEADINGS: usize = 6;

/// Steps by which places are moved, metres, and headings turned, radians, from coarse to fine.
const STEPS: [(f64, f64); 3] = [(0.4, 0.25), (0.2, 0.12), (0.08, 0.05)];

/// Steps of one size at most.
const MOST_STEPS: usize = 8;

/// Filled cells that hang together are looked at where they cover this much, square metres; so many of them at an instant at most.
const LEAST_CLUSTER_M2: f64 = 1.5;
const MOST_CLUSTERS: usize = 24;

/// Times that what is left is looked at again once vehicles were found: they stand side by side.
const MOST_ROUNDS: usize = 4;

/// Height at which a vehicle is looked for, metres.
const MIDDLE_M: f64 = 0.8;

/// Cameras that must show one.
const LEAST_CAMERAS: usize = 2;

/// Cameras that are asked at most: those that show one the largest.
const MOST_LOOKING: usize = 6;

/// A camera tells of one of which its picture shows this share ...
const LEAST_INSIDE: f32 = 0.5;

/// ... and the worst cameras, one in so many, tell nothing: something that the scene does not know may stand in their way.
const PER_WORST: usize = 4;

/// One is worth a closer look if foreground less background is this share of its outline, in the mean over cameras ...
const LEAST_FIRST: f32 = 0.2;

/// ... and is there with this share, and with that in each camera ...
const LEAST_MEAN: f32 = 0.6;
const LEAST_EACH: f32 = 0.2;

/// ... but with this one in the mean where it is as tall as people are, who may stand in two rows ...
const PEOPLE_M: [f64; 2] = [1.55, 1.95];
const LEAST_MEAN_OF_PEOPLE: f32 = 0.8;

/// ... if around it, up to so far off, metres, no more than this share is foreground: a crowd goes on.
const AROUND_M: f64 = 0.35;
const MOST_AROUND: f32 = 0.25;

/// Share of its height by which a vehicle is taken to be wider to both sides, when others are looked for beside it.
const WIDER: f32 = 0.1;

/// Filled cells that hang together.
#[derive(Clone, Debug)]
struct Cluster {
    middle_in_world: DVec3,
    /// Direction in which it is longest, radians, and its standard deviation that way, metres.
    heading_rad: f64,
    half_length_m: f64,
}

/// Fit of a vehicle's outline.
#[derive(Clone, Copy, Debug)]
struct Fit {
    /// Foreground less background within it, of what a typical car covers: larger where it grows over foreground. Mean over cameras.
    score: f32,
    /// The same, as a share of the outline: mean over cameras, and that of the worst.
    mean: f32,
    least: f32,
}

/// Camera that looks at a place.
#[derive(Clone, Copy, Debug)]
struct Looking {
    camera_idx: usize,
    /// Area that a typical car covers there, pixels.
    typical_px: f32,
}

impl Occupancy {
    /// Covers the pixels of vehicles, so that they say nothing of people. `filled` are cells that nearly all cameras show foreground.
    pub(super) fn cover_vehicles(&mut self, scene: &Scene, grid: &Grid, filled: Vec<usize>) {
        let mut open = filled;
        for _ in 0..MOST_ROUNDS {
            let mut has_any = false;
            for cluster in clusters(grid, &open) {
                if let Some(vehicle) = self.fitted(scene, &cluster) {
                    self.cover_vehicle(scene, &vehicle);
                    has_any = true;
                }
            }
            if !has_any {
                return;
            }
            let is_covered = |camera: usize, pixel: usize| {
                let evidence = &self.evidence[camera];
                !evidence.is_usable() || evidence.is_covered(pixel)
            };
            open.retain(|cell| !grid.all_looks(*cell, is_covered));
        }
    }

    /// Returns a vehicle that fills its outline about where a cluster lies.
    fn fitted(&self, scene: &Scene, cluster: &Cluster) -> Option<Vehicle> {
        let cameras = self.looking(scene, cluster.middle_in_world + DVec3::Z * MIDDLE_M);
        let (mut vehicle, mut fit) =
            self.first_fit(scene, &cameras, cluster).filter(|(_, fit)| fit.mean >= LEAST_FIRST)?;
        for (step_m, turn_rad) in STEPS {
            for _ in 0..MOST_STEPS {
                let before = vehicle;
                self.step_vehicle(scene, &cameras, (&mut vehicle, &mut fit), (step_m, turn_rad));
                if vehicle == before {
                    break;
                }
            }
        }
        (is_filled(&fit, vehicle.height_m)
            && self.foreground_around(scene, &cameras, &vehicle) <= MOST_AROUND)
            .then_some(vehicle)
    }

    /// Returns the cameras that look at a place which no surface hides from them, those that show it the largest first.
    fn looking(&self, scene: &Scene, place: DVec3) -> Vec<Looking> {
        let looking = |(camera_idx, evidence): (usize, &Evidence)| {
            let camera = &scene.cameras[camera_idx].camera;
            let distance_m = camera.pose().position_in_world.distance(place);
            let focal_px = camera.focal_px().x * evidence.size().0 as f64 / f64::from(camera.size_px().0);
            let [length_m, height_m] = FIRST_M[0];
            let is_seen = evidence.is_usable()
                && camera.project(place).is_some_and(|of| of.is_inside())
                && !scene.surfaces.is_hidden(camera.pose().position_in_world, place);
            let typical_px = (length_m * height_m * (focal_px / distance_m.max(1.0)).powi(2)).max(1.0) as f32;
            is_seen.then_some(Looking { camera_idx, typical_px })
        };
        let mut all: Vec<Looking> = self.evidence.iter().enumerate().filter_map(looking).collect();
        all.sort_by(|a, b| b.typical_px.total_cmp(&a.typical_px));
        all.truncate(MOST_LOOKING);
        all
    }

    /// Returns the best of what is tried first of a cluster.
    fn first_fit(&self, scene: &Scene, cameras: &[Looking], cluster: &Cluster) -> Option<(Vehicle, Fit)> {
        let along = DVec2::from_angle(cluster.heading_rad) * cluster.half_length_m;
        let mut best: Option<(Vehicle, Fit)> = None;
        for share in [0.0, -1.0, 1.0] {
            let place = cluster.middle_in_world.truncate() + along * share;
            let Some(middle_in_world) = ground_at(scene, place, cluster.middle_in_world.z) else { continue };
            let turns = (0..N_HEADINGS).map(|turn| turn as f64 / N_HEADINGS as f64 * PI);
            for (turn_rad, [length_m, height_m]) in turns.flat_map(|turn| FIRST_M.map(|size| (turn, size))) {
                let heading_rad = cluster.heading_rad + turn_rad;
                let vehicle = Vehicle { middle_in_world, heading_rad, length_m, height_m };
                let fit = self.vehicle_fit(scene, cameras, &vehicle);
                let is_better = |fit: &Fit| best.as_ref().is_none_or(|(_, of)| fit.score > of.score);
                if let Some(fit) = fit.filter(is_better) {
                    best = Some((vehicle, fit));
                }
            }
        }
        best
    }

    /// Moves, turns and stretches a vehicle to where it covers more foreground and less background.
    fn step_vehicle(
        &self,
        scene: &Scene,
        cameras: &[Looking],
        (vehicle, fit): (&mut Vehicle, &mut Fit),
        (step_m, turn_rad): (f64, f64),
    ) {
        let mut take = |of: Vehicle, vehicle: &mut Vehicle| {
            if let Some(better) = self.vehicle_fit(scene, cameras, &of).filter(|of| of.score > fit.score) {
                (*vehicle, *fit) = (of, better);
            }
        };
        for by in [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::NEG_Y] {
            let by = DVec2::from_angle(vehicle.heading_rad).rotate(by * step_m);
            let place = vehicle.middle_in_world.truncate() + by;
            if let Some(middle_in_world) = ground_at(scene, place, vehicle.middle_in_world.z) {
                take(Vehicle { middle_in_world, ..*vehicle }, vehicle);
            }
        }
        for by in [1.0, -1.0] {
            take(Vehicle { heading_rad: vehicle.heading_rad + by * turn_rad, ..*vehicle }, vehicle);
            let length_m = (vehicle.length_m + by * step_m).clamp(LENGTHS_M[0], LENGTHS_M[1]);
            take(Vehicle { length_m, ..*vehicle }, vehicle);
            let height_m = (vehicle.height_m + 0.5 * by * step_m).clamp(HEIGHTS_M[0], HEIGHTS_M[1]);
            take(Vehicle { height_m, ..*vehicle }, vehicle);
        }
    }

    /// Returns how well a vehicle fills its outline in the pictures of some cameras; none if too few of them show it.
    fn vehicle_fit(&self, scene: &Scene, cameras: &[Looking], vehicle: &Vehicle) -> Option<Fit> {
        let mut found: Vec<[f32; 2]> = self
            .outlines(scene, cameras, vehicle, 0.0)
            .map(|(evidence, silhouette, typical_px)| {
                let gain = evidence.gain(&silhouette);
                [gain / silhouette.shown_px(), gain / typical_px]
            })
            .collect();
        if found.len() < LEAST_CAMERAS {
            return None;
        }
        found.sort_by(|a, b| b[0].total_cmp(&a[0]));
        found.truncate(found.len() - found.len() / PER_WORST);
        let n = found.len() as f32;
        let [mean, score] = [0, 1].map(|of| found.iter().map(|both| both[of]).sum::<f32>() / n);
        let least = found.last().map_or(0.0, |[share, _]| *share);
        Some(Fit { score, mean, least })
    }

    /// Returns the share of what lies right around a vehicle that is foreground.
    fn foreground_around(&self, scene: &Scene, cameras: &[Looking], vehicle: &Vehicle) -> f32 {
        let (mut foreground, mut area) = (0.0, 0.0);
        for looking in cameras {
            let of = |around_m: f64| {
                let outline = self.outlines(scene, std::slice::from_ref(looking), vehicle, around_m).next();
                outline.map(|(evidence, silhouette, _)| {
                    let shown_px = silhouette.shown_px();
                    [0.5 * (evidence.gain(&silhouette) + shown_px), shown_px]
                })
            };
            if let (Some(within), Some(with_around)) = (of(0.0), of(AROUND_M)) {
                foreground += (with_around[0] - within[0]) / looking.typical_px;
                area += (with_around[1] - within[1]) / looking.typical_px;
            }
        }
        if area > 0.0 { foreground / area } else { 1.0 }
    }

    /// Returns a vehicle's outlines in the pictures of those of some cameras that show enough of it.
    fn outlines<'a>(
        &'a self,
        scene: &'a Scene,
        cameras: &'a [Looking],
        vehicle: &'a Vehicle,
        around_m: f64,
    ) -> impl Iterator<Item = (&'a Evidence, Silhouette, f32)> + 'a {
        cameras.iter().filter_map(move |Looking { camera_idx, typical_px }| {
            let evidence = &self.evidence[*camera_idx];
            let camera = &scene.cameras[*camera_idx].camera;
            let silhouette = vehicle.silhouette(camera, evidence.size(), around_m)?;
            let is_inside = silhouette.shown_px() >= LEAST_INSIDE * silhouette.area_px.max(1.0);
            is_inside.then_some((evidence, silhouette, *typical_px))
        })
    }

    /// Covers a vehicle's pixels in the cameras from which no surface hides its middle.
    fn cover_vehicle(&mut self, scene: &Scene, vehicle: &Vehicle) {
        for (evidence, member) in self.evidence.iter_mut().zip(&scene.cameras) {
            let eye = member.camera.pose().position_in_world;
            let middle = vehicle.middle_in_world + DVec3::Z * MIDDLE_M;
            if !evidence.is_usable() || scene.surfaces.is_hidden(eye, middle) {
                continue;
            }
            if let Some(silhouette) = vehicle.silhouette(&member.camera, evidence.size(), 0.0) {
                evidence.cover(&silhouette.widened(WIDER, evidence.size().0), 1);
            }
        }
    }
}

/// Returns true if a vehicle of a height is there that fits so well.
fn is_filled(fit: &Fit, height_m: f64) -> bool {
    let is_as_people = (PEOPLE_M[0]..=PEOPLE_M[1]).contains(&height_m);
    let least_mean = if is_as_people { LEAST_MEAN_OF_PEOPLE } else { LEAST_MEAN };
    fit.mean >= least_mean && fit.least >= LEAST_EACH
}

/// Returns the clusters of cells that are large enough for a vehicle, the largest first.
fn clusters(grid: &Grid, cells: &[usize]) -> Vec<Cluster> {
    let mut open: HashMap<[i64; 2], usize> = cells.iter().map(|cell| (grid.place(*cell), *cell)).collect();
    let mut found: Vec<Vec<DVec3>> = Vec::new();
    for cell in cells {
        let mut stack: Vec<([i64; 2], usize)> = open.remove_entry(&grid.place(*cell)).into_iter().collect();
        let mut places = Vec::new();
        while let Some(([column, row], cell)) = stack.pop() {
            places.push(grid.foot(cell));
            let beside = [[column - 1, row], [column + 1, row], [column, row - 1], [column, row + 1]];
            stack.extend(beside.iter().filter_map(|place| open.remove_entry(place)));
        }
        if places.len() as f64 * grid.side_m().powi(2) >= LEAST_CLUSTER_M2 {
            found.push(places);
        }
    }
    found.sort_by_key(|places| std::cmp::Reverse(places.len()));
    found.truncate(MOST_CLUSTERS);
    found.iter().map(|places| Cluster::of(places)).collect()
}

impl Cluster {
    fn of(places: &[DVec3]) -> Self {
        let n = places.len() as f64;
        let middle_in_world = places.iter().sum::<DVec3>() / n;
        let [mut xx, mut xy, mut yy] = [0.0; 3];
        for place in places {
            let off = (*place - middle_in_world).truncate();
            (xx, xy, yy) = (xx + off.x * off.x / n, xy + off.x * off.y / n, yy + off.y * off.y / n);
        }
        let heading_rad = 0.5 * (2.0 * xy).atan2(xx - yy);
        let along = DVec2::from_angle(heading_rad);
        let variance = along.x * along.x * xx + 2.0 * along.x * along.y * xy + along.y * along.y * yy;
        Self { middle_in_world, heading_rad, half_length_m: variance.max(0.0).sqrt() }
    }
}
