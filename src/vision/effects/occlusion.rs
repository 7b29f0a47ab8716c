//! How much of the light from all around reaches a pixel, by what stands near it in the picture.
//!
//! `[M12]` `McGuire`, Mara, Luebke 2012, Scalable ambient obscurance, section 2.1, in units of its radius, without its levels of depth.

use super::{Distances, Occlusion};
use glam::Vec2;
use std::f32::consts::TAU;

/// Places that are looked at for a pixel.
pub const N_TAPS: usize = 12;

/// Turns of the spiral on which they lie.
const TURNS: f32 = 5.0;

/// How the spiral is turned from pixel to pixel, 4 x 4 of them.
pub const N_ROTATIONS: usize = 16;

/// Pixels before and behind one that are taken together, each way.
pub const BLUR_PX: [i32; 2] = [-2, 1];

/// Heights above a plane that count for nothing, of the radius: what normals are off by.
const BIAS: f32 = 0.02;

/// Squared distance, of the radius's, that keeps the nearest from counting alone.
const NEAREST: f32 = 0.01;

/// So much that a right angle's edge is half dark.
const GAIN: f32 = 4.5;

/// Distance from a pixel's plane, of the radius, from which on another lies on another surface.
const SAME_PLANE: f32 = 0.1;

/// Where the taps lie on the unit disc.
#[must_use]
pub fn taps() -> [Vec2; N_TAPS] {
    std::array::from_fn(|tap| {
        let share = (tap as f32 + 0.5) / N_TAPS as f32;
        Vec2::from_angle(TAU * TURNS * share) * share
    })
}

/// Cosine and sine by which the taps are turned, by place in the 4 x 4 pattern: neighbours far apart (Bayer's order).
#[must_use]
pub fn rotations() -> [Vec2; N_ROTATIONS] {
    const ORDER: [u8; N_ROTATIONS] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];
    ORDER.map(|place| Vec2::from_angle(TAU * f32::from(place) / N_ROTATIONS as f32))
}

/// Which rotation a pixel has; `anchored` is its place in all of the picture, wherever that begins.
const fn rotation_of(anchored: [i32; 2]) -> usize {
    ((anchored[1] & 3) * 4 + (anchored[0] & 3)) as usize
}

/// The share of light that reaches a pixel, 0 to 1, before it is smoothed; 1 of one that shows nothing. `most` bounds the radius:
/// a tangent, of parallel rays metres.
#[must_use]
pub fn open_share(
    distances: &Distances<'_>,
    pixel: [i32; 2],
    anchored: [i32; 2],
    settings: &Occlusion,
    most: f32,
) -> f32 {
    let beyond_m = distances.at(pixel);
    if beyond_m < 0.0 {
        return 1.0;
    }
    let lens = &distances.lens;
    let depth_m = lens.depth_m(beyond_m);
    let radius_m = settings.radius_m.min(most * depth_m);
    let reach_px = Vec2::splat(radius_m / depth_m) / lens.pitch;
    if reach_px.max_element() < 1.0 {
        return 1.0;
    }
    let place = lens.place(pixel, beyond_m);
    let normal = distances.normal(pixel);
    let turn = rotations()[rotation_of(anchored)];
    let middle = Vec2::new(pixel[0] as f32, pixel[1] as f32) + 0.5;
    let mut sum = 0.0;
    for tap in taps() {
        let turned = Vec2::new(tap.x * turn.x - tap.y * turn.y, tap.x * turn.y + tap.y * turn.x);
        let at = (middle + turned * reach_px).floor();
        let at = [at.x as i32, at.y as i32];
        let there_m = distances.at(at);
        if there_m < 0.0 {
            continue;
        }
        let way = (lens.place(at, there_m) - place) / radius_m;
        let squared = way.length_squared();
        let falling = (1.0 - squared).max(0.0);
        sum += falling * falling * falling * (way.dot(normal) - BIAS).max(0.0) / (squared + NEAREST);
    }
    (1.0 - settings.strength * GAIN * sum / N_TAPS as f32).max(0.0)
}

/// The mean of the shares around a pixel that lie in its plane; `open` gives those of pixels, 1 beside the picture.
#[must_use]
pub fn smoothed(
    distances: &Distances<'_>,
    pixel: [i32; 2],
    settings: &Occlusion,
    most: f32,
    open: impl Fn([i32; 2]) -> f32,
) -> f32 {
    let beyond_m = distances.at(pixel);
    if beyond_m < 0.0 {
        return 1.0;
    }
    let lens = &distances.lens;
    let radius_m = settings.radius_m.min(most * lens.depth_m(beyond_m));
    let place = lens.place(pixel, beyond_m);
    let normal = distances.normal(pixel);
    let (mut sum, mut weights) = (0.0, 0.0);
    for y in BLUR_PX[0]..=BLUR_PX[1] {
        for x in BLUR_PX[0]..=BLUR_PX[1] {
            let at = [pixel[0] + x, pixel[1] + y];
            let there_m = distances.at(at);
            if there_m < 0.0 {
                continue;
            }
            let off = (lens.place(at, there_m) - place).dot(normal).abs();
            let weight = (1.0 - off / (SAME_PLANE * radius_m)).max(0.0);
            sum += weight * open(at);
            weights += weight;
        }
    }
    // The pixel itself lies in its plane: there is always one.
    sum / weights.max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::super::distances::tests::{Rays, SIZE, lens, seen};
    use super::super::{Lens, NOTHING_M};
    use super::*;
    use glam::Vec3;

    fn open_of(lens: Lens, beyond_m: &[f32], radius_m: f32) -> Vec<f32> {
        let distances = Distances { width: SIZE, beyond_m, lens };
        let settings = Occlusion { radius_m, strength: 1.0 };
        // A tangent, of parallel rays metres: as much nine metres away.
        let most = if lens.is_parallel { 1.8 } else { 0.2 };
        let pixel = |at: u32| [(at % SIZE) as i32, (at / SIZE) as i32];
        let raw = |at: [i32; 2]| {
            let is_within = at.iter().all(|along| (0..SIZE as i32).contains(along));
            if is_within { open_share(&distances, at, at, &settings, most) } else { 1.0 }
        };
        (0..SIZE * SIZE).map(|at| smoothed(&distances, pixel(at), &settings, most, raw)).collect()
    }

    #[test]
    fn a_plane_is_open_however_it_lies() {
        for rays in [Rays::ThroughEye, Rays::Parallel] {
            for normal in [Vec3::NEG_Z, Vec3::new(0.3, -0.5, -0.8), Vec3::new(0.0, -1.0, -0.1)] {
                let lens = lens(rays);
                let normal = normal.normalize();
                let beyond_m = seen(lens, &[(normal, normal.dot(Vec3::new(0.0, 1.0, 9.0)))]);
                let open = open_of(lens, &beyond_m, 1.0);
                let least = open.iter().copied().fold(1.0, f32::min);
                assert!(least > 0.99, "{rays:?} {normal}: {least}");
            }
        }
    }

    #[test]
    fn a_right_angle_is_about_half_dark_at_its_edge_and_open_beyond_the_radius() {
        for rays in [Rays::ThroughEye, Rays::Parallel] {
            let lens = lens(rays);
            // A trough whose sides rise to the left and right of the axis.
            let sides = [Vec3::new(1.0, 0.0, -1.0).normalize(), Vec3::new(-1.0, 0.0, -1.0).normalize()];
            let planes = sides.map(|side| (side, side.dot(Vec3::new(0.0, 0.0, 9.0))));
            let beyond_m = seen(lens, &planes);
            let open = open_of(lens, &beyond_m, 1.0);
            let at = |x: u32| open[(SIZE / 2 * SIZE + x) as usize];
            let edge = 0.5 * (at(SIZE / 2 - 1) + at(SIZE / 2));
            assert!((0.35..0.65).contains(&edge), "{rays:?}: {edge}");
            assert!(at(3) > 0.98 && at(SIZE - 4) > 0.98, "{rays:?}: {} {}", at(3), at(SIZE - 4));
        }
    }

    #[test]
    fn an_edge_that_stands_out_is_open_on_its_own_sides() {
        let lens = lens(Rays::ThroughEye);
        let sides = [Vec3::new(1.0, 0.0, -1.0).normalize(), Vec3::new(-1.0, 0.0, -1.0).normalize()];
        // Seen from outside: the farther of both planes.
        let both = sides.map(|side| seen(lens, &[(side, side.dot(Vec3::new(0.0, 0.0, 9.0)))]));
        let ridge: Vec<f32> = both[0].iter().zip(&both[1]).map(|(a, b)| a.max(*b)).collect();
        let open = open_of(lens, &ridge, 1.0);
        let at = |x: u32| open[(SIZE / 2 * SIZE + x) as usize];
        assert!((4..SIZE - 4).all(|x| at(x) > 0.97), "{:?}", &open[512..544]);
    }

    #[test]
    fn where_nothing_stands_nothing_is_dark_and_no_number_is_none() {
        let lens = lens(Rays::ThroughEye);
        let sky = vec![NOTHING_M; (SIZE * SIZE) as usize];
        assert!(open_of(lens, &sky, 1.0).iter().all(|open| *open == 1.0));
        // A post before the sky, at the horizon of a plane that never ends.
        let mut beyond_m = seen(lens, &[(Vec3::NEG_Y, Vec3::NEG_Y.dot(Vec3::new(0.0, 1.5, 0.0)))]);
        for y in 4..20 {
            beyond_m[y * SIZE as usize + 16] = 5.0;
        }
        for radius_m in [0.05, 1.5, 20.0] {
            let open = open_of(lens, &beyond_m, radius_m);
            assert!(open.iter().all(|open| (0.0..=1.0).contains(open)), "{radius_m}");
        }
    }

    #[test]
    fn rotations_and_taps_fill_the_disc_evenly() {
        let mean: Vec2 = rotations().iter().copied().sum::<Vec2>() / N_ROTATIONS as f32;
        assert!(mean.length() < 1e-5);
        assert!(taps().iter().all(|tap| tap.length() <= 1.0));
        let mean: Vec2 = taps().iter().copied().sum::<Vec2>() / N_TAPS as f32;
        assert!(mean.length() < 0.12, "{mean}");
    }
}
