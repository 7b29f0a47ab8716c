//! Gains by which the pictures of one mesh agree: cameras see the same vertices, each with its own exposure and white balance.

use super::{Sight, View};
use crate::frame::{Difference, log_gains};
use crate::mesh::Mesh;
use glam::{DVec3, Vec3};

/// Most vertices that are compared.
const MOST_PLACES: usize = 8192;

/// What two cameras differ by without anything wrong, as a logarithm: highlights, interpolation, a place a little beside.
const SPREAD: f64 = 0.15;

/// Light that sensors and their codes cannot tell from none.
const DARK: f32 = 4e-3;

/// Light from which on a channel may be cut off.
const BRIGHT: f32 = 0.9;

/// Sets all views' gains from what they see of the same vertices, in a level of detail. A view that is compared with none keeps 1.
pub(super) fn even(mesh: &Mesh, views: &mut [View], sights: &[Sight], level: f32) {
    let n_views = views.len();
    let step = mesh.positions_m.len().div_ceil(MOST_PLACES).max(1);
    let mut differences = Vec::new();
    let mut seen: Vec<(u16, DVec3)> = Vec::new();
    for vertex in (0..mesh.positions_m.len()).step_by(step) {
        seen.clear();
        for (view, of) in views.iter().enumerate() {
            if sights[vertex * n_views + view] != Sight::Seen {
                continue;
            }
            let Some((texture, _)) = of.project(mesh.positions_m[vertex]) else { continue };
            let light = of.light_at(texture, level) / of.gain;
            if light.min_element() > DARK && light.max_element() < BRIGHT {
                seen.push((view as u16, light.as_dvec3().map(f64::ln)));
            }
        }
        // Each with the next one: no more than there are, and together they hang together.
        differences.extend(seen.windows(2).map(|pair| {
            let [(a, of_a), (b, of_b)] = [pair[0], pair[1]];
            Difference { cameras: [a, b], log_ratio: of_b - of_a, variance: SPREAD * SPREAD }
        }));
    }
    for (view, log_gain) in views.iter_mut().zip(log_gains(n_views, &differences)) {
        view.gain = log_gain.map_or(Vec3::ONE, |of| of.map(f64::exp).as_vec3());
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{facing, grid};
    use super::*;

    #[test]
    fn cold_and_warm_cameras_meet() {
        let (positions, triangles) = grid(9, 0.0, |_, _| 0.0);
        let mesh = Mesh::new(positions, triangles);
        let light = |x: f64, y: f64| Vec3::new(0.2 + 0.02 * x as f32, 0.3, 0.2 + 0.02 * y as f32);
        let gains = [Vec3::new(0.8, 1.0, 1.3), Vec3::new(1.3, 1.0, 0.7), Vec3::ONE];
        let mut views: Vec<View> =
            (0..3).map(|i| facing(3.0 + f64::from(i), |x, y| gains[i as usize] * light(x, y))).collect();
        let mut sights = vec![Sight::Seen; 81 * 3];
        even(&mesh, &mut views, &sights, 0.0);
        let evened: Vec<Vec3> = views.iter().zip(gains).map(|(view, gain)| view.gain * gain).collect();
        for of in &evened[1..] {
            assert!((*of / evened[0] - 1.0).abs().max_element() < 0.02, "{evened:?}");
        }
        // Of one that nobody is compared with, nothing is known.
        (0..81).for_each(|vertex| sights[vertex * 3 + 2] = Sight::Hidden);
        even(&mesh, &mut views, &sights, 0.0);
        assert_eq!(views[2].gain, Vec3::ONE);
    }
}
