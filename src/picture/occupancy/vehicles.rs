//! Finds vehicles that several cameras show, so that no crowd of people is put where one of them stands.
//!
//! Masks and the cells that nearly all cameras show filled flow in; vehicles that fill their outline flow out. Where each of them stands is
//! association's to tell: here they are only what is nobody.

use super::evidence::Evidence;
use super::grid::Grid;
use super::silhouette::{LEAST_DEPTH_M, Silhouette};
use super::{Occupancy, ground_at};
use crate::scene::Scene;
use glam::{DVec2, DVec3};
use std::collections::HashMap;
use std::f64::consts::PI;
use videofields_vision::geometry::Camera;

/// Lengths and heights that are tried first, metres: a car and a van.
const FIRST_M: [[f64; 2]; 2] = [[4.3, 1.5], [5.2, 2.2]];

/// Ranges of lengths and heights, metres, and widths of what is lower than a van and of vans.
const LENGTHS_M: [f64; 2] = [3.2, 7.0];
const HEIGHTS_M: [f64; 2] = [1.3, 3.0];
const WIDTHS_M: [f64; 2] = [1.75, 2.0];

/// Vans are taller than this, metres.
const VAN_M: f64 = 1.9;

/// Height of the ground's clearance, metres, and of the part beneath the windows, share of the whole.
const CLEARANCE_M: f64 = 0.2;
const BELT: f64 = 0.58;

/// Lengths of the part with windows at its foot and at the roof, shares of the whole, of cars and of vans; and its width.
const CABINS: [[f64; 2]; 2] = [[0.74, 0.4], [0.95, 0.8]];
const CABIN_WIDTH: f64 = 0.82;

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

/// Something that stands on wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Vehicle {
    middle_in_world: DVec3,
    heading_rad: f64,
    length_m: f64,
    height_m: f64,
}

impl Vehicle {
    /// Returns the corners of the part beneath the windows, and of that with windows; both larger by `around_m` to all sides and upwards.
    fn corners(&self, around_m: f64) -> [[DVec3; 8]; 2] {
        let (length, height) = (self.length_m, self.height_m);
        let kind = usize::from(height > VAN_M);
        let (width, [foot, roof]) = (WIDTHS_M[kind], CABINS[kind]);
        let along = DVec2::from_angle(self.heading_rad);
        let corners = |lengths: [f64; 2], width: f64, heights: [f64; 2]| {
            std::array::from_fn(|idx| {
                let side = |bit: usize| if idx >> bit & 1 == 0 { -1.0 } else { 1.0 };
                let is_upper = idx >> 2 & 1;
                let reach = |of: f64| 0.5 * of + around_m;
                let level =
                    along * (side(0) * reach(lengths[is_upper])) + along.perp() * (side(1) * reach(width));
                self.middle_in_world + level.extend(heights[is_upper])
            })
        };
        let belt = BELT * height;
        [
            corners([length; 2], width, [CLEARANCE_M, belt + around_m]),
            corners([foot * length, roof * length], CABIN_WIDTH * width, [belt, height + around_m]),
        ]
    }

    /// Returns its outline in pictures of `size` columns and rows by `camera`; none where that is not in view.
    fn silhouette(
        &self,
        camera: &Camera,
        (width, height): (usize, usize),
        around_m: f64,
    ) -> Option<Silhouette> {
        let size = DVec2::new(width as f64, height as f64);
        let mut points = [[DVec2::ZERO; 8]; 2];
        for (corner, point) in self.corners(around_m).as_flattened().iter().zip(points.as_flattened_mut()) {
            let projection = camera.project(*corner).filter(|of| of.depth_m > LEAST_DEPTH_M)?;
            *point = projection.texture * size;
        }
        let rows_of = |by: fn(f64, f64) -> f64, none: f64| {
            points.as_flattened().iter().map(|point| point.y).fold(none, by)
        };
        let (top, bottom) = (rows_of(f64::min, f64::INFINITY), rows_of(f64::max, f64::NEG_INFINITY));
        if bottom - top > 4.0 * size.y {
            return None;
        }
        let (top, bottom) = (top.floor() as i64, bottom.ceil() as i64);
        let n_rows = usize::try_from(bottom - top).unwrap_or(0);
        let mut rows = vec![[f32::INFINITY, f32::NEG_INFINITY]; n_rows];
        for part in &points {
            for (idx, from) in part.iter().enumerate() {
                for to in &part[idx + 1..] {
                    widen_by(&mut rows, top, [*from, *to]);
                }
            }
        }
        let area_px = rows.iter().map(|[left, right]| (right - left).max(0.0)).sum();
        for row in &mut rows {
            let left = row[0].clamp(0.0, width as f32);
            *row = [left, row[1].clamp(left, width as f32)];
        }
        let above = usize::try_from(-top).unwrap_or(0).min(rows.len());
        let below = usize::try_from(bottom - height as i64).unwrap_or(0).min(rows.len() - above);
        let spans = rows[above..rows.len() - below].into();
        Some(Silhouette { first_row: usize::try_from(top).unwrap_or(0), spans, area_px })
    }
}

/// Widens rows, of which the first is `top`, by what a line covers.
fn widen_by(rows: &mut [[f32; 2]], top: i64, [from, to]: [DVec2; 2]) {
    let (from, to) = if from.y <= to.y { (from, to) } else { (to, from) };
    let first = (from.y - 0.5).ceil() as i64;
    let last = (to.y - 0.5).floor() as i64;
    let slope = (to.x - from.x) / (to.y - from.y).max(1e-9);
    for y in first..=last {
        let x = (from.x + slope * (y as f64 + 0.5 - from.y)) as f32;
        if let Some([left, right]) = usize::try_from(y - top).ok().and_then(|row| rows.get_mut(row)) {
            (*left, *right) = (left.min(x), right.max(x));
        }
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::drawn_people::{SIZE, around, camera, mask, scene};
    use std::sync::Arc;
    use videofields_vision::frame::Mask;
    use videofields_vision::segment::MOVING;

    /// Draws what a camera sees of blocks on the ground (middle, heading, length, width, heights), by points within them.
    fn draw(mask: &mut Mask, camera: &Camera, blocks: &[(DVec3, f64, [f64; 2], [f64; 2])]) {
        let mut data = mask.data.to_vec();
        let steps = |n: u32| (0..=n).map(move |step| f64::from(step) / f64::from(n));
        for (middle, heading_rad, [length, width], [low, high]) in blocks {
            let along = DVec2::from_angle(*heading_rad);
            let places =
                steps(90).flat_map(|x| steps(36).flat_map(move |y| steps(30).map(move |z| [x, y, z])));
            for [x, y, z] in places {
                let level = along * ((x - 0.5) * length) + along.perp() * ((y - 0.5) * width);
                let point = *middle + level.extend(low + z * (high - low));
                let Some(seen) = camera.project(point).filter(|seen| seen.is_inside()) else { continue };
                let at = seen.texture * DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
                let (x, y) = ((at.x as u32).min(SIZE.0 - 1), (at.y as u32).min(SIZE.1 - 1));
                data[(y * SIZE.0 + x) as usize] = MOVING;
            }
        }
        mask.data = data.into();
    }

    /// Middle, heading, and whether it is a van.
    type Car = (DVec3, f64, bool);

    /// Returns the blocks of a car, or of a van.
    fn blocks((middle, heading_rad, is_van): Car) -> Vec<(DVec3, f64, [f64; 2], [f64; 2])> {
        let back = middle - (DVec2::from_angle(heading_rad) * 0.2).extend(0.0);
        if is_van {
            return vec![(middle, heading_rad, [5.2, 2.0], [0.25, 2.2])];
        }
        vec![
            (middle, heading_rad, [4.3, 1.75], [0.2, 0.85]),
            (back, heading_rad, [2.6, 1.5], [0.85, 1.2]),
            (back, heading_rad, [1.9, 1.35], [1.2, 1.45]),
        ]
    }

    fn masks(scene: &Scene, cameras: &[Camera], people: &[(DVec3, f64)], cars: &[Car]) -> Vec<Mask> {
        let all: Vec<_> = cars.iter().copied().flat_map(blocks).collect();
        let drawn = |camera: &Camera| {
            let mut mask = mask(scene, camera, people);
            draw(&mut mask, camera, &all);
            mask
        };
        cameras.iter().map(drawn).collect()
    }

    /// Returns where the people are that are found beside cars.
    fn people_beside(people: &[(DVec3, f64)], cars: &[Car]) -> Vec<DVec3> {
        let cameras = around(DVec3::ZERO);
        let scene = scene(DVec3::ZERO, "", &cameras);
        let masks = masks(&scene, &cameras, people, cars);
        let found = Occupancy::default().find(&scene, |idx| masks.get(idx), &[]);
        found.iter().map(|of| of.foot_in_world).collect()
    }

    #[test]
    fn a_car_is_no_crowd_and_who_stands_beside_it_is_found() {
        for (heading_rad, is_van) in [(0.0, false), (0.6, false), (2.2, false), (0.3, true), (1.8, true)] {
            let car = (DVec3::new(0.4, -0.3, 0.0), heading_rad, is_van);
            assert!(people_beside(&[], &[car]).is_empty(), "{heading_rad} {is_van}");
            // A van hides who stands behind it from two of the three cameras.
            let away = DVec2::from_angle(heading_rad).perp() * if is_van { -2.4 } else { 2.4 };
            let somebody = (car.0 + away.extend(0.0), 1.75);
            let found = people_beside(&[somebody], &[car]);
            let is_there = found.len() == 1 && found[0].distance(somebody.0) < 0.3;
            assert!(is_there, "{heading_rad} {is_van}: {found:?}");
        }
    }

    #[test]
    fn cars_side_by_side_are_no_crowd() {
        for apart_m in [2.7, 2.4] {
            let cars = [
                (DVec3::new(-1.2, 0.0, 0.0), 1.5, false),
                (DVec3::new(apart_m - 1.2, 0.3, 0.0), 1.55, false),
            ];
            assert!(people_beside(&[], &cars).is_empty(), "{apart_m}");
        }
    }

    #[test]
    fn a_dense_group_as_large_as_a_car_is_none() {
        let cameras = around(DVec3::ZERO);
        let scene = scene(DVec3::ZERO, "", &cameras);
        let place = |idx: u32| DVec3::new(f64::from(idx % 7) * 0.65, f64::from(idx / 7) * 0.6, 0.0);
        for n in [9, 12, 14, 21, 28] {
            let people: Vec<(DVec3, f64)> =
                (0..n).map(|idx| (place(idx), 1.6 + 0.03 * f64::from(idx % 6))).collect();
            let masks = masks(&scene, &cameras, &people, &[]);
            let mut occupancy = Occupancy::default();
            let all: Vec<Option<&Mask>> = masks.iter().map(Some).collect();
            occupancy.fit(&scene, &all);
            let (_, grid) = occupancy.grid.take().unwrap();
            let cells = occupancy.cells_with_foreground(&grid);
            let filled: Vec<usize> = cells.iter().filter(|of| of.1).map(|of| of.0).collect();
            assert!(!clusters(&grid, &filled).is_empty(), "{n}: it is worth a look");
            occupancy.cover_vehicles(&scene, &grid, filled);
            let n_px = (SIZE.0 * SIZE.1) as usize;
            assert!((0..n_px).all(|pixel| occupancy.evidence.iter().all(|of| !of.is_covered(pixel))), "{n}");
        }
    }

    /// Returns what is fitted near `middle` where `n_cameras` cameras show blocks, and those of `blind` nothing.
    fn fit_to(
        blocks: &[(DVec3, f64, [f64; 2], [f64; 2])],
        (n_cameras, blind): (usize, &[usize]),
        cluster: &Cluster,
    ) -> Option<Vehicle> {
        let [a, b, c] = around(DVec3::ZERO);
        let more = camera(DVec3::new(10.0, 2.0, 4.5), DVec3::Z * 0.8);
        let cameras = [a, b, c, more];
        let scene = scene(DVec3::ZERO, "", &cameras[..n_cameras]);
        let drawn = |(idx, camera): (usize, &Camera)| {
            let mut mask = Mask::filled(SIZE.0, SIZE.1, 0);
            draw(&mut mask, camera, if blind.contains(&idx) { &[] } else { blocks });
            mask
        };
        let masks: Vec<Mask> = cameras[..n_cameras].iter().enumerate().map(drawn).collect();
        let mut occupancy = Occupancy::default();
        occupancy.fit(&scene, &masks.iter().map(Some).collect::<Vec<_>>());
        occupancy.fitted(&scene, cluster)
    }

    fn beside(middle: DVec3, heading_rad: f64) -> Cluster {
        Cluster { middle_in_world: middle, heading_rad, half_length_m: 1.0 }
    }

    #[test]
    fn a_vehicle_is_placed_where_it_stands_and_is_as_large_as_it_is() {
        let middle = DVec3::new(-0.5, 0.7, 0.0);
        let lorry = vec![(middle, 0.7, [6.4, 2.0], [0.25, 2.7])];
        for (blocks, heading_rad, size_m) in [
            (blocks((middle, 0.2, false)), 0.2, [4.3, 1.45]),
            (blocks((middle, 1.3, false)), 1.3, [4.3, 1.45]),
            (blocks((middle, 2.7, true)), 2.7, [5.2, 2.2]),
            (lorry, 0.7, [6.4, 2.7]),
        ] {
            let cluster = beside(middle + DVec3::new(0.6, -0.5, 0.0), heading_rad + 0.4);
            let found = fit_to(&blocks, (3, &[]), &cluster).unwrap();
            let turn = (found.heading_rad - heading_rad).rem_euclid(PI);
            let turn = turn.min(PI - turn);
            let off_m = found.middle_in_world.distance(middle);
            assert!(off_m < 0.35 && turn < 0.12, "{found:?}");
            let wrong = [(found.length_m - size_m[0]).abs(), (found.height_m - size_m[1]).abs()];
            assert!(wrong[0] < 0.35 && wrong[1] < 0.25, "{found:?}");
        }
    }

    #[test]
    fn a_car_that_one_camera_of_four_does_not_show_is_there_and_of_three_is_not() {
        let car = blocks((DVec3::ZERO, 0.4, false));
        let cluster = beside(DVec3::new(0.3, 0.2, 0.0), 0.6);
        assert!(fit_to(&car, (4, &[1]), &cluster).is_some());
        assert_eq!(fit_to(&car, (3, &[1]), &cluster), None);
    }

    #[test]
    fn what_goes_on_is_no_vehicle() {
        let wall = [(DVec3::ZERO, 0.4, [13.0, 1.75], [0.2, 1.45])];
        assert_eq!(fit_to(&wall, (3, &[]), &beside(DVec3::ZERO, 0.4)), None);
    }

    #[test]
    fn what_is_as_tall_as_people_must_be_filled_better() {
        let fit = |mean: f32, least: f32| Fit { score: 1.0, mean, least };
        assert!(is_filled(&fit(0.65, 0.25), 1.45) && is_filled(&fit(0.65, 0.25), 2.2));
        assert!(!is_filled(&fit(0.65, 0.25), 1.7) && is_filled(&fit(0.85, 0.25), 1.7));
        assert!(!is_filled(&fit(0.55, 0.25), 1.45) && !is_filled(&fit(0.65, 0.15), 1.45));
    }

    #[test]
    fn a_car_that_one_camera_of_four_does_not_show_is_no_crowd_to_the_others() {
        let [a, b, c] = around(DVec3::ZERO);
        let cameras = [a, b, c, camera(DVec3::new(10.0, 2.0, 4.5), DVec3::Z * 0.8)];
        let scene = scene(DVec3::ZERO, "", &cameras);
        let mut masks = masks(&scene, &cameras, &[], &[(DVec3::new(0.4, -0.3, 0.0), 0.6, false)]);
        masks[1] = Mask::filled(SIZE.0, SIZE.1, 0);
        let found = Occupancy::default().find(&scene, |idx| masks.get(idx), &[]);
        assert!(found.is_empty(), "{}", found.len());
    }

    #[test]
    fn cameras_that_look_elsewhere_are_not_asked() {
        // Six stand nearer to the car than those who see it, and look away from it.
        let away = |idx: u32| {
            let eye = DVec2::from_angle(f64::from(idx)).extend(0.0) * 5.0 + DVec3::Z * 3.5;
            camera(eye, eye * 3.0)
        };
        let cameras: Vec<Camera> = (0..6).map(away).chain(around(DVec3::ZERO)).collect();
        let scene = scene(DVec3::ZERO, "", &cameras);
        let masks = masks(&scene, &cameras, &[], &[(DVec3::ZERO, 0.3, false)]);
        let mut occupancy = Occupancy::default();
        occupancy.fit(&scene, &masks.iter().map(Some).collect::<Vec<_>>());
        let asked: Vec<usize> = occupancy.looking(&scene, DVec3::Z).iter().map(|of| of.camera_idx).collect();
        assert_eq!(asked.len(), 3, "{asked:?}");
        assert!(asked.iter().all(|idx| *idx >= 6), "{asked:?}");
    }

    #[test]
    fn one_camera_alone_tells_of_no_vehicle() {
        let cameras = around(DVec3::ZERO);
        let scene = scene(DVec3::ZERO, "", &cameras[..1]);
        let masks = masks(&scene, &cameras[..1], &[], &[(DVec3::ZERO, 0.3, false)]);
        let mut occupancy = Occupancy::default();
        occupancy.fit(&scene, &[Some(&masks[0])]);
        let cluster = Cluster { middle_in_world: DVec3::ZERO, heading_rad: 0.3, half_length_m: 1.0 };
        assert_eq!(occupancy.fitted(&scene, &cluster), None);
    }

    #[test]
    fn outlines_are_cut_by_the_picture_and_none_behind_the_camera() {
        let camera = camera(DVec3::new(0.0, -12.0, 3.0), DVec3::Z * 0.8);
        let size = (SIZE.0 as usize, SIZE.1 as usize);
        let at = |x: f64, y: f64| Vehicle {
            middle_in_world: DVec3::new(x, y, 0.0),
            heading_rad: 0.0,
            length_m: 4.3,
            height_m: 1.5,
        };
        let whole = at(0.0, 0.0).silhouette(&camera, size, 0.0).unwrap();
        assert!((whole.shown_px() / whole.area_px - 1.0).abs() < 1e-5);
        // A camera 12.4 m away shows a side of 4.3 m by as many pixels of a metre.
        let metre_px = camera.focal_px().x / 12.0;
        let widest = whole.spans.iter().map(|[left, right]| right - left).fold(0.0, f32::max);
        assert!((f64::from(widest) / (4.3 * metre_px) - 1.0).abs() < 0.15, "{widest} {metre_px}");
        let larger = at(0.0, 0.0).silhouette(&camera, size, 0.3).unwrap();
        assert!(larger.area_px > 1.2 * whole.area_px);
        let reach_m = 0.5 * f64::from(SIZE.0) / metre_px;
        let cut = at(reach_m, 0.0).silhouette(&camera, size, 0.0).unwrap();
        let share = cut.shown_px() / cut.area_px;
        assert!((0.35..0.65).contains(&share), "{share}");
        assert_eq!(at(0.0, -13.0).silhouette(&camera, size, 0.0), None);
        assert_eq!(at(0.0, -40.0).silhouette(&camera, size, 0.0), None);
    }

    #[test]
    fn cells_that_hang_together_are_a_cluster() {
        let cameras = around(DVec3::ZERO);
        let scene: Arc<Scene> = scene(DVec3::ZERO, "", &cameras);
        let sizes = vec![(SIZE.0 as usize, SIZE.1 as usize); 3];
        let grid = Grid::new(&scene, sizes);
        let is_in = |cell: usize, middle: DVec2, half: DVec2| {
            (grid.foot(cell).truncate() - middle).abs().cmple(half).all()
        };
        let (long, square) = (DVec2::new(2.0, 1.0), DVec2::new(-3.0, -2.0));
        let cells: Vec<usize> = (0..grid.n_cells())
            .filter(|cell| {
                is_in(*cell, long, DVec2::new(0.5, 2.0))
                    || is_in(*cell, square, DVec2::splat(0.8))
                    || is_in(*cell, DVec2::new(0.0, -5.0), DVec2::splat(0.4))
            })
            .collect();
        let found = clusters(&grid, &cells);
        assert_eq!(found.len(), 2, "one is too small: {found:?}");
        assert!(found[0].middle_in_world.truncate().distance(long) < 0.1);
        assert!(
            (found[0].heading_rad.abs() - 0.5 * PI).abs() < 0.05
                && (found[0].half_length_m - 4.0 / 12f64.sqrt()).abs() < 0.1
        );
        assert!(found[1].middle_in_world.truncate().distance(square) < 0.2);
    }
}
