//! Places of a scene's surfaces that several cameras see, and what their backgrounds show there.
//!
//! The places hang on surfaces and calibrations alone and are found once; a background is read at a few hundred texels.

use crate::scene::Scene;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use videofields_vision::frame::{Difference, YuvImage, linear_from_srgb};
use videofields_vision::geometry::{Camera, Hit, Surfaces};

/// Most rays that are cast from one camera, and from all of a scene.
const MAX_RAYS: usize = 512;
const MAX_ALL_RAYS: usize = 8192;

/// Most other cameras that one place is compared with.
const MAX_OTHERS: usize = 3;

/// Sine of the least angle between a ray and the surface: from flatter on, a texel is metres long, and what shines
/// mirrors the sky.
const LEAST_SINE: f64 = 0.1;

/// Colours are the mean over a patch of so many texels each way.
const PATCH: i8 = 3;
/// So many texels of the coarser camera apart.
const PATCH_STEP: f64 = 1.5;

/// sRGB codes that a camera's colour counts within: beyond them it is clipped, or mostly noise.
const CODES: [u8; 2] = [10, 248];

/// Standard deviation of the logarithm of two cameras' colours of one place, of a smooth surface.
const LEAST_SPREAD: f64 = 0.04;

/// Share of a patch's own unevenness that counts as uncertainty: pictures lie on one another within about a texel.
const UNEVEN_SHARE: f64 = 0.3;

/// Share of the variance of strangers' differences that a pair's own may have, of many places: whoever sees the same
/// surface knows two thirds of what it looks like from place to place.
const UNSHARED: f64 = 1.0 / 3.0;
/// By so much over the number of places less of it: few agree by chance more easily.
const FEW: f64 = 2.4;
/// How far on in a pair's list, as shares of it, the places are that count as strangers.
const STRANGERS: [f64; 3] = [0.25, 0.5, 0.75];

/// Length of the shortest interval over half of normal values, standard deviations.
const SHORTEST_HALF: f64 = 1.349;

/// One place in one camera's picture.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sight {
    /// The camera, by its place in the scene.
    member: u16,
    /// Texture coordinate.
    middle: [f32; 2],
    /// Steps of the patch along two directions of the surface, in texture coordinates.
    steps: [[f32; 2]; 2],
}

/// Where a scene's cameras see the same surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlap {
    n_members: usize,
    /// Place after place, of each the camera's that found it first.
    sights: Vec<Sight>,
    /// Where each place's sights end.
    ends: Vec<u32>,
}

impl Overlap {
    /// Looks for places along rays from every camera of a scene: kept are those that another camera sees too, with
    /// nothing before it and neither at a grazing angle. The same scene has the same places.
    ///
    /// **Cost** at most 8192 rays, and for each a projection into every camera and a ray from those that look there; over all cores.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let cameras: Vec<&Camera> = scene.cameras.iter().map(|member| &*member.camera).collect();
        let n_members = cameras.len();
        if n_members < 2 {
            return Self { n_members, ..Self::default() };
        }
        let n_rays = MAX_RAYS.min(MAX_ALL_RAYS / n_members).max(1);
        let found: Vec<Vec<Vec<Sight>>> = (0..n_members)
            .into_par_iter()
            .map(|member| {
                let places = places(cameras[member], n_rays).enumerate();
                places.filter_map(|(nth, at)| sights(&cameras, &scene.surfaces, (member, nth), at)).collect()
            })
            .collect();
        let mut overlap = Self { n_members, ..Self::default() };
        for of_place in found.into_iter().flatten() {
            overlap.sights.extend(of_place);
            overlap.ends.push(overlap.sights.len() as u32);
        }
        overlap
    }

    /// Whether no two cameras see one place.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// How many places there are.
    #[must_use]
    pub const fn n_places(&self) -> usize {
        self.ends.len()
    }

    /// How many cameras the scene has.
    pub(super) const fn n_members(&self) -> usize {
        self.n_members
    }

    /// What backgrounds, in the order of the scene's cameras, show of the places; what is clipped or black is left out,
    /// and so is every pair of cameras whose places tell that it does not see the same surface ([`is_supported`]).
    ///
    /// **Cost** 9 texels for each camera that sees a place, and for each pair's places a dozen sortings.
    pub(super) fn differences(&self, backgrounds: &[Option<&YuvImage>]) -> Vec<Difference> {
        let mut compared = self.compared(backgrounds);
        // Stable: a pair's places stay in the order of the grid.
        compared.sort_by_key(|of| of.cameras);
        let pairs = compared.chunk_by(|a, b| a.cameras == b.cameras).filter(|pair| is_supported(pair));
        pairs.flatten().map(Compared::difference).collect()
    }

    /// Every place as any two cameras show it, place after place.
    fn compared(&self, backgrounds: &[Option<&YuvImage>]) -> Vec<Compared> {
        let light: Vec<f32> = (0..=u8::MAX).map(|code| linear_from_srgb(f32::from(code) / 255.0)).collect();
        let seen = |sight: &Sight| {
            let image = backgrounds.get(usize::from(sight.member)).copied().flatten()?;
            Shade::of(image, sight, &light)
        };
        let mut compared = Vec::new();
        let mut first = 0;
        for end in &self.ends {
            let sights = &self.sights[first..*end as usize];
            first = *end as usize;
            let Some((own, others)) = sights.split_first() else { continue };
            let Some(shade) = seen(own) else { continue };
            let others = others.iter().filter_map(|other| Some((other.member, seen(other)?)));
            compared.extend(others.map(|other| Compared::of((own.member, &shade), (other.0, &other.1))));
        }
        compared
    }
}

/// One place as two cameras show it, the one that comes first in the scene first.
#[derive(Clone, Copy, Debug)]
struct Compared {
    cameras: [u16; 2],
    /// Natural logarithm of linear light, a camera, a channel.
    log_light: [DVec3; 2],
    /// Variance of the difference of these.
    variance: f64,
}

impl Compared {
    fn of(one: (u16, &Shade), other: (u16, &Shade)) -> Self {
        let [first, second] = if one.0 <= other.0 { [one, other] } else { [other, one] };
        Self {
            cameras: [first.0, second.0],
            log_light: [first.1.log_light, second.1.log_light],
            variance: LEAST_SPREAD.powi(2) + first.1.variance + second.1.variance,
        }
    }

    fn difference(&self) -> Difference {
        let [first, second] = self.log_light;
        Difference { cameras: self.cameras, log_ratio: second - first, variance: self.variance }
    }
}

/// Whether two cameras show the same surface, by all places that they have in common.
///
/// A camera before which a tree stands that the scene does not know sees leaves wherever another sees the lawn: places
/// that differ all alike, as by a gain. But what the lawn looks like from place to place the leaves do not tell. So a
/// place's two colours must lie closer together, over the pair, than one's colour of a place and the other's of a
/// stranger: a place far on in the list (a permutation test). A gain changes neither. What fewer than half of the places
/// show otherwise (cars, people) counts in neither. Surfaces that look alike everywhere tell nothing: differences that
/// scatter no more than those of a smooth surface are enough.
fn is_supported(pair: &[Compared]) -> bool {
    let n = pair.len();
    let scatter = |shift: usize| {
        let strangers = pair.iter().cycle().skip(shift);
        let differences =
            pair.iter().zip(strangers).map(|(own, other)| other.log_light[1] - own.log_light[0]);
        scatter(&differences.collect::<Vec<DVec3>>())
    };
    // A cast from float saturates.
    let mut strangers = STRANGERS.map(|share| scatter((n as f64 * share).round() as usize));
    strangers.sort_by(f64::total_cmp);
    let allowed = UNSHARED - FEW / n as f64;
    scatter(0) <= 3.0 * LEAST_SPREAD.powi(2) + allowed * strangers[STRANGERS.len() / 2]
}

/// Variance of the denser half of some values, all channels together, by the shortest interval over half of them
/// (Rousseeuw and Leroy 1988): the rest may be anything.
fn scatter(values: &[DVec3]) -> f64 {
    let of_channel = |channel: usize| {
        let mut sorted: Vec<f64> = values.iter().map(|value| value[channel]).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let n_half = sorted.len().div_ceil(2);
        let lengths = sorted.iter().zip(sorted.iter().skip(n_half.saturating_sub(1)));
        let shortest = lengths.map(|(first, last)| last - first).fold(f64::INFINITY, f64::min);
        (shortest / SHORTEST_HALF).powi(2)
    };
    (0..3).map(of_channel).sum()
}

/// Texture coordinates of about `n` places evenly over a camera's picture.
fn places(camera: &Camera, n: usize) -> impl Iterator<Item = DVec2> + use<> {
    let (width, height) = camera.size_px();
    let aspect = f64::from(width) / f64::from(height);
    // A cast from float saturates.
    let rows = ((n as f64 / aspect).sqrt() as usize).clamp(1, n);
    let columns = n / rows;
    let middle = |idx: usize, count: usize| (idx as f64 + 0.5) / count as f64;
    (0..rows * columns)
        .map(move |idx| DVec2::new(middle(idx % columns, columns), middle(idx / columns, rows)))
}

/// Who sees the place that a camera shows at a texture coordinate; `None` if nobody else does.
fn sights(
    cameras: &[&Camera],
    surfaces: &Surfaces,
    (member, nth): (usize, usize),
    texture: DVec2,
) -> Option<Vec<Sight>> {
    let ray = cameras[member].ray(texture)?;
    let hit = surfaces.hit(&ray, 0.0)?;
    // From another camera on for every place, so that of many all are compared with all.
    let others = (0..cameras.len()).map(|step| (member + nth + step) % cameras.len());
    let near = others.filter(|other| *other != member && may_see(cameras[*other], &hit));
    let mut seeing: Vec<usize> = vec![member];
    // Whoever sees the place may still not see the patch; that is found once its size is known.
    seeing
        .extend(near.filter(|other| is_open(cameras[*other], surfaces, hit.point_in_world)).take(MAX_OTHERS));
    if seeing.len() < 2 || !may_see(cameras[member], &hit) {
        return None;
    }
    let texel_m = |member: &usize| {
        let camera = cameras[*member];
        camera.pose().position_in_world.distance(hit.point_in_world) / camera.focal_px().min_element()
    };
    let step_m = PATCH_STEP * seeing.iter().map(texel_m).fold(0.0, f64::max);
    let found: Vec<Sight> =
        seeing.iter().filter_map(|member| sight(cameras[*member], surfaces, *member, &hit, step_m)).collect();
    let is_shared = found.len() > 1 && usize::from(found[0].member) == member;
    is_shared.then_some(found)
}

/// Whether a place lies in a camera's picture and is seen steeply enough.
fn may_see(camera: &Camera, hit: &Hit) -> bool {
    let to_camera = (camera.pose().position_in_world - hit.point_in_world).normalize_or_zero();
    to_camera.dot(hit.normal_in_world) >= LEAST_SINE
        && camera.project(hit.point_in_world).is_some_and(|projection| projection.is_inside())
}

/// Whether nothing stands between the camera and a point of a surface.
fn is_open(camera: &Camera, surfaces: &Surfaces, point_in_world: DVec3) -> bool {
    let origin = camera.pose().position_in_world;
    let Some(direction) = (point_in_world - origin).try_normalize() else { return false };
    let distance_m = origin.distance(point_in_world);
    let hit = surfaces.hit(&videofields_vision::geometry::Ray { origin, direction }, 0.0);
    hit.is_some_and(|hit| (hit.distance_m - distance_m).abs() <= 0.01 + 1e-3 * distance_m)
}

/// How a camera sees the patch with steps of `step_m`: all of it, or not at all.
fn sight(camera: &Camera, surfaces: &Surfaces, member: usize, hit: &Hit, step_m: f64) -> Option<Sight> {
    let (across, along) = hit.normal_in_world.any_orthonormal_pair();
    let reach_m = step_m * f64::from(PATCH / 2);
    let corners = [across + along, across - along, along - across, -across - along];
    let is_seen = |direction: &DVec3| {
        let corner = hit.point_in_world + *direction * reach_m;
        camera.project(corner).is_some_and(|projection| projection.is_inside())
            && is_open(camera, surfaces, corner)
    };
    if !corners.iter().all(is_seen) {
        return None;
    }
    let middle = camera.project(hit.point_in_world)?.texture;
    let step = |direction: DVec3| {
        let moved = camera.project(hit.point_in_world + direction * step_m)?.texture;
        Some((moved - middle).as_vec2().to_array())
    };
    let steps = [step(across)?, step(along)?];
    Some(Sight { member: member as u16, middle: middle.as_vec2().to_array(), steps })
}

/// What a background shows over a patch.
struct Shade {
    /// Natural logarithm of the mean of linear light, a channel.
    log_light: DVec3,
    /// Variance of that by the patch's unevenness.
    variance: f64,
}

impl Shade {
    /// `None` where any texel is black or clipped: what is left would be the brighter or the darker half. None also where
    /// any is hidden.
    fn of(image: &YuvImage, sight: &Sight, light: &[f32]) -> Option<Self> {
        let (width, height) = (image.width(), image.height());
        let [x, y] = sight.middle;
        let (mut sum, mut squares) = (DVec3::ZERO, DVec3::ZERO);
        let half = PATCH / 2;
        for row in -half..=half {
            for column in -half..=half {
                let [[right, down], [left, up]] = sight.steps;
                let (column, row) = (f32::from(column), f32::from(row));
                // A cast from float saturates; the last row and column go on beyond the picture.
                let x = ((x + right * column + left * row) * width as f32) as u32;
                let y = ((y + down * column + up * row) * height as f32) as u32;
                let (x, y) = (x.min(width - 1), y.min(height - 1));
                let codes = image.rgb_at(x, y);
                if image.zone_mask().is_some_and(|zones| zones.sight().get(x, y) == 0) {
                    return None;
                }
                if codes.iter().any(|code| !(CODES[0]..=CODES[1]).contains(code)) {
                    return None;
                }
                let seen = DVec3::from(codes.map(|code| f64::from(light[usize::from(code)])));
                sum += seen;
                squares += seen * seen;
            }
        }
        let n = f64::from(PATCH).powi(2);
        let mean = sum / n;
        let uneven = (squares / n - mean * mean).max(DVec3::ZERO) / (mean * mean);
        let variance = UNEVEN_SHARE.powi(2) * uneven.max_element();
        Some(Self { log_light: DVec3::new(mean.x.ln(), mean.y.ln(), mean.z.ln()), variance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::log_gains;

    const LAWN: DVec3 = DVec3::new(-2.6, -1.9, -3.1);
    const LEAVES: DVec3 = DVec3::new(-4.2, -3.4, -4.3);

    /// Sums of waves that follow no grid: what a surface looks like from place to place, by a number of its own. Leaves
    /// are rougher than a lawn: standard deviations of 0.22 and 0.06, on the simulated campus 0.1 to 0.8 and 0.05 to 0.2.
    fn pattern(place: f64, surface: f64) -> f64 {
        let wave = |nth: i32| (place * 0.31 * surface.sqrt() * f64::from(nth) + surface).sin();
        0.02 * surface * (1..6).map(wave).sum::<f64>()
    }

    /// Two cameras over a lawn, the second so many times as bright; before the second a tree stands over a share of
    /// the places, which lie side by side.
    fn pair(n: usize, share: f64, log_exposure: DVec3) -> Vec<Compared> {
        let place = |idx: usize| {
            let at = idx as f64;
            let lawn = LAWN + pattern(at, 2.0);
            let is_tree = at < share * n as f64;
            let error = 0.02 * (at * 2.4).sin();
            let seen = if is_tree { LEAVES + pattern(at, 7.0) } else { lawn + error };
            Compared {
                cameras: [0, 1],
                log_light: [lawn, seen + log_exposure],
                variance: LEAST_SPREAD.powi(2),
            }
        };
        (0..n).map(place).collect()
    }

    /// How far the two gains are off, the greatest of all channels.
    fn off(pair: &[Compared], log_exposure: DVec3) -> f64 {
        let gains = log_gains(2, &pair.iter().map(Compared::difference).collect::<Vec<_>>());
        let [first, second] = [0, 1].map(|camera: usize| gains[camera].expect("compared"));
        (first - second - log_exposure).abs().max_element()
    }

    #[test]
    fn a_tree_that_the_scene_does_not_know_supports_no_gain() {
        for n in [40, 80, 300] {
            for share in [0.6, 0.8, 1.0] {
                let seen = pair(n, share, DVec3::ZERO);
                // Least squares, however robust, would believe it.
                assert!(off(&seen, DVec3::ZERO) > 0.5, "{n} {share}");
                assert!(!is_supported(&seen), "{n} {share}");
            }
        }
    }

    #[test]
    fn what_both_see_supports_any_gain() {
        for log_exposure in [DVec3::ZERO, DVec3::new(1.2, 1.0, 0.6), DVec3::splat(-1.3)] {
            for (n, share) in [(8, 0.0), (20, 0.3), (60, 0.3), (300, 0.4)] {
                let seen = pair(n, share, log_exposure);
                assert!(is_supported(&seen), "{n} {share} {log_exposure}");
                let off = off(&seen, log_exposure);
                assert!(off < 0.04, "{n} {share} {log_exposure}: {off}");
            }
        }
    }

    #[test]
    fn a_surface_that_looks_alike_everywhere_tells_nothing_against_it() {
        let place = |idx: u32| {
            // Noise of each camera's own.
            let noise = [1.7, 2.9].map(|step| LAWN + 0.02 * (f64::from(idx) * step).sin());
            Compared { cameras: [0, 1], log_light: noise, variance: LEAST_SPREAD.powi(2) }
        };
        assert!(is_supported(&(0..40).map(place).collect::<Vec<_>>()));
        let even = Compared { cameras: [0, 1], log_light: [LAWN; 2], variance: 1.0 };
        assert!(is_supported(&[even; 8]));
    }
}
