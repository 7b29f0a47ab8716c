//! Meshes that tests measure on.

use super::View;
use crate::frame::{RgbImage, codes_of};
use crate::geometry::{Camera, Distortion, Pose};
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;

/// Numbers that look like chance, 0 to 1.
fn chance(of: u64) -> f64 {
    let mixed = (of ^ 0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((mixed ^ mixed >> 29).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A sheet of n x n vertices a metre apart, inner ones moved by up to `jitter` either way, of that height.
pub(super) fn grid(n: u32, jitter: f64, height_m: impl Fn(f64, f64) -> f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let place = |i: u32| {
        let (x, y) = (i % n, i / n);
        let moved = |at: u32, which: u64| {
            let is_inner = x > 0 && y > 0 && x + 1 < n && y + 1 < n;
            let off = (2.0 * chance(2 * u64::from(i) + which) - 1.0) * jitter;
            f64::from(at) + if is_inner { off } else { 0.0 }
        };
        let at = DVec2::new(moved(x, 0), moved(y, 1));
        at.extend(height_m(at.x, at.y))
    };
    let quad = |i: u32| {
        let (x, y) = (i % (n - 1), i / (n - 1));
        let [a, b, c, d] = [y * n + x, y * n + x + 1, (y + 1) * n + x + 1, (y + 1) * n + x];
        if (x + y) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    ((0..n * n).map(place).collect(), (0..(n - 1) * (n - 1)).flat_map(quad).collect())
}

/// An octahedron whose faces were cut into four so many times, on the unit sphere.
pub(super) fn sphere(level: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut positions = vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    for _ in 0..level {
        let mut known: HashMap<[u32; 2], u32> = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[from, to]| {
                *known.entry([from.min(to), from.max(to)]).or_insert_with(|| {
                    positions.push((positions[from as usize] + positions[to as usize]).normalize());
                    positions.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (positions, triangles)
}

/// A fan of slivers that are so thin, with needles around it.
pub(super) fn fan(thin: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let rim = |i: u32| DVec3::new(1.0 + 0.1 * f64::from(i % 3), thin * f64::from(i), 0.2 * f64::from(i % 2));
    let positions = std::iter::once(DVec3::ZERO).chain((0..12).map(rim)).chain([DVec3::new(5.0, 0.5, 0.0)]);
    let inner = (1..12).map(|i| [0, i, i + 1]);
    let outer = (1..12).map(|i| [i + 1, i, 13]);
    (positions.collect(), inner.chain(outer).collect())
}

/// A camera that looks straight down on the middle of [`grid`]'s nine metres from `height_m`, and sees this light there.
pub(super) fn facing(height_m: f64, light: impl Fn(f64, f64) -> Vec3) -> View {
    looking(DVec3::new(4.0, 4.0, height_m), DVec3::new(4.0, 4.001, 0.0), light)
}

/// A camera whose picture shows this light at the places of the level ground that it sees.
pub(super) fn looking(eye: DVec3, target: DVec3, light: impl Fn(f64, f64) -> Vec3) -> View {
    let pose = Pose::looking_at(eye, target).expect("a direction");
    let (size, focal) = (240_u32, 110.0);
    let camera = Camera::new((size, size), DVec2::splat(focal), DVec2::splat(120.0), Distortion::None, pose)
        .expect("a camera");
    let mut data = Vec::with_capacity(size as usize * size as usize * 3);
    for pixel in 0..size * size {
        let at = DVec2::new(f64::from(pixel % size) + 0.5, f64::from(pixel / size) + 0.5) / f64::from(size);
        let ray = camera.ray(at).expect("a pinhole");
        let ground = ray.distance_to_plane(DVec3::ZERO, DVec3::Z).map(|along_m| ray.at(along_m));
        data.extend(codes_of(ground.map_or(Vec3::ZERO, |at| light(at.x, at.y))));
    }
    View::new(camera, RgbImage { width: size, height: size, data }, None)
}
