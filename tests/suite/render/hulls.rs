//! Hulls as they are drawn, against the processor's exact ones: every method, in every hard case.
#![expect(clippy::unwrap_used, reason = "a test's way to fail")]

use super::stage::Stage;
use super::{Brush, keep, renderer, v, view};
use glam::{DMat2, DVec2, DVec3};
use std::sync::Arc;
use videofields::frame::{ColorMatrix, ColorRange, Frame, Mask, YuvImage};
use videofields::fuse::{Billboard, Entity, SceneState};
use videofields::geometry::{Camera, Ray};
use videofields::hull::Scratch;
use videofields::plan::{EntityStyle, HullMethod, View};
use videofields::render::FoundHulls;
use videofields::segment::PixelRect;
use videofields::timeline::Observation;

/// Somebody of balls: head, trunk, an arm that reaches out, legs apart (so that there is a hole between arm and trunk).
pub(super) const BODY: [([f64; 3], f64); 9] = [
    ([0.0, 0.0, 1.62], 0.14),
    ([0.0, 0.0, 1.3], 0.2),
    ([0.0, 0.0, 1.05], 0.2),
    ([0.1, 0.02, 0.75], 0.12),
    ([0.16, 0.03, 0.45], 0.1),
    ([0.2, 0.05, 0.12], 0.12),
    ([-0.12, 0.0, 0.6], 0.14),
    ([-0.2, 0.0, 0.2], 0.14),
    ([0.42, 0.1, 1.38], 0.1),
];

/// Where a ray meets the body that stands at `foot`, if it does.
fn met(foot: DVec3, ray: &Ray) -> Option<f64> {
    let of = |(center, radius): ([f64; 3], f64)| {
        let to = foot + DVec3::from_array(center) - ray.origin;
        let along = to.dot(ray.direction);
        let beside2 = to.length_squared() - along * along;
        let half = (radius * radius - beside2).max(0.0).sqrt();
        (beside2 <= radius * radius && along - half > 0.0).then_some(along - half)
    };
    BODY.into_iter().filter_map(of).reduce(f64::min)
}

/// What the body is painted with: bands that turn with the height, so that what lies where shows.
fn paint(at: DVec3) -> [u8; 3] {
    let wave = |phase: f64| (127.5 + 110.0 * (phase).sin()) as u8;
    [wave(at.z * 9.0), wave(at.z * 9.0 + 2.0 + 2.0 * at.x), wave(4.0 * at.y + 4.0)]
}

/// The stage's state with bodies at `feet`, each seen by the cameras that have it in their picture.
pub(super) fn peopled(stage: &Stage, feet: &[DVec3]) -> SceneState {
    let mut state = stage.state();
    let mut rects: Vec<Vec<Option<PixelRect>>> = vec![Vec::new(); feet.len()];
    for camera_state in &mut state.cameras {
        let camera = Arc::clone(&camera_state.camera);
        let (width, height) = camera.size_px();
        let surfaces = &state.scene.surfaces;
        let mut labels = Mask::filled(width, height, 0);
        let mut shown = vec![None::<(u32, u32, u32, u32)>; feet.len()];
        let mut frame = camera_state.observation.background.to_rgb();
        for row in 0..height {
            for column in 0..width {
                let at = |value: u32, size: u32| (f64::from(value) + 0.5) / f64::from(size);
                let Some(ray) = camera.ray(DVec2::new(at(column, width), at(row, height))) else { continue };
                let nearest = (0..feet.len())
                    .filter_map(|who| Some((met(feet[who] + stage.offset, &ray)?, who)))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                let Some((distance, who)) = nearest else { continue };
                let hit = surfaces.hit(&ray, 0.0);
                if hit.is_some_and(|hit| hit.point_in_world.distance(ray.origin) < distance) {
                    continue;
                }
                let idx = (row * width + column) as usize;
                labels.data[idx] = 255;
                let color = paint(ray.at(distance) - feet[who] - stage.offset);
                frame.data[3 * idx..3 * idx + 3].copy_from_slice(&color);
                let (left, top, right, bottom) = shown[who].unwrap_or((column, row, column, row));
                shown[who] = Some((left.min(column), top.min(row), right.max(column), bottom.max(row)));
            }
        }
        for (rects, shown) in rects.iter_mut().zip(shown) {
            rects.push(shown.map(|(x, y, right, bottom)| PixelRect {
                x,
                y,
                width: right + 1 - x,
                height: bottom + 1 - y,
            }));
        }
        let image = YuvImage::from_rgb(&frame, ColorMatrix::Bt709, ColorRange::Full).unwrap();
        let labels = Arc::new(labels);
        let observation = &camera_state.observation;
        camera_state.observation = Observation {
            frame: Frame { image: Arc::new(image), ..observation.frame.clone() },
            soft_mask: Arc::clone(&labels),
            labels,
            ..observation.clone()
        };
    }
    let source = |camera: &Camera, camera_idx: usize, foot: DVec3, rect: PixelRect| {
        let away = (foot - camera.pose().position_in_world).truncate().normalize_or(DVec2::X);
        Billboard {
            camera_idx,
            rect,
            foot_in_world: foot,
            right_in_world: DVec3::new(away.y, -away.x, 0.0),
            left_right_m: [-0.4, 0.5],
            height_m: 1.76,
            is_truncated: false,
        }
    };
    state.entities = feet
        .iter()
        .zip(&rects)
        .enumerate()
        .map(|(who, (foot, rects))| {
            let foot_in_world = *foot + stage.offset;
            let sources = rects.iter().enumerate().filter_map(|(idx, rect)| {
                Some(source(&state.cameras[idx].camera, idx, foot_in_world, (*rect)?))
            });
            Entity {
                id: who as u64 + 1,
                foot_in_world,
                foot_covariance_m2: DMat2::from_diagonal(DVec2::splat(0.01)),
                height_m: 1.76,
                sources: sources.collect(),
            }
        })
        .filter(|entity| !entity.sources.is_empty())
        .collect();
    state.place_hulls(0.0);
    state.carve_hulls(N_VOXELS);
    state
}

/// Voxels along the longest side of a hull.
const N_VOXELS: u32 = 128;

/// Cameras in a ring around the middle, tinted by nothing.
pub(super) fn ring(n: usize) -> Stage {
    let plain = [1.0; 3];
    (0..n).fold(Stage::new(), |stage, i| {
        let turn = (i as f64 + 0.3) / n as f64 * std::f64::consts::TAU;
        let height = 2.6 + 0.5 * (i % 3) as f64;
        stage.with_camera(v(5.5 * turn.cos(), 5.5 * turn.sin(), height), v(0.0, 0.0, 0.9), plain)
    })
}

/// What the exact hulls say of a picture's pixels: depth of what is nearest.
fn exact(state: &SceneState, view: &View) -> Vec<Option<f64>> {
    let mut scratch = Scratch::default();
    let forward = view.pose.forward_in_world();
    let mut pixel = |x: u32, y: u32| {
        let share = |at: u32, n: u32| (f64::from(at) + 0.5) / f64::from(n);
        let ray = view.ray(share(x, view.width_px), share(y, view.height_px));
        let mut nearest: Option<f64> = None;
        for hull in &state.hulls {
            let [low, high] = hull.bounds_in_world.map(|corner| (corner - ray.origin) / ray.direction);
            let (near, far) = (low.min(high).max_element(), low.max(high).min_element());
            if near.max(0.0) < far {
                hull.hull.cut(&ray, [near.max(0.0), far], &mut scratch);
                let first = scratch.intervals.first().map(|interval| interval[0]);
                nearest = match (nearest, first) {
                    (Some(a), Some(b)) => Some(a.min(b)),
                    (a, b) => a.or(b),
                };
            }
        }
        nearest.map(|at| at * ray.direction.dot(forward))
    };
    let pixels = (0..view.height_px).flat_map(|y| (0..view.width_px).map(move |x| (x, y)));
    pixels.map(|(x, y)| pixel(x, y)).collect()
}

/// Draws hulls by a method, and what it found.
pub(super) fn found(
    brush: &mut Brush,
    state: &SceneState,
    view: &View,
    (method, name): (HullMethod, &str),
) -> FoundHulls {
    let mut plan = brush.plan(state, view, EntityStyle::Hulls);
    assert!(!plan.hulls.is_empty(), "{:?}", plan.reasons);
    plan.hull.method = method;
    let rendered = brush.render(state, view, &plan).unwrap();
    keep(name, &rendered.image);
    brush.renderer.found_hulls().unwrap().unwrap()
}

/// How a method's picture compares with the exact one.
struct Comparison {
    /// Pixels that have the hull in one alone, and are farther than so many pixels from the exact silhouette.
    n_wrong: usize,
    n_exact: usize,
    /// Differences of depth, metres, in order.
    depths_m: Vec<f64>,
}

fn compare(found: &FoundHulls, exact: &[Option<f64>], within_px: i64) -> Comparison {
    let (width, height) = (i64::from(found.width_px), i64::from(found.height_px));
    let is_near_outline = |idx: usize| {
        let (x, y) = (idx as i64 % width, idx as i64 / width);
        let reach = -within_px..=within_px;
        let around = reach.clone().flat_map(|dy| reach.clone().map(move |dx| (x + dx, y + dy)));
        let mut around = around.filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y));
        around.any(|(x, y)| exact[(y * width + x) as usize].is_some() != exact[idx].is_some())
    };
    let mut result = Comparison { n_wrong: 0, n_exact: 0, depths_m: Vec::new() };
    for (idx, (found, exact)) in found.pixels.iter().zip(exact).enumerate() {
        result.n_exact += usize::from(exact.is_some());
        match (found, exact) {
            (Some(found), Some(exact)) => {
                assert!(found.depth_m.is_finite() && found.normal_in_world.is_finite());
                assert!((found.normal_in_world.length() - 1.0).abs() < 1e-3);
                result.depths_m.push((f64::from(found.depth_m) - exact).abs());
            }
            (None, None) => {}
            _ => result.n_wrong += usize::from(!is_near_outline(idx)),
        }
    }
    result.depths_m.sort_unstable_by(f64::total_cmp);
    result
}

/// What a method is held to.
struct Bound {
    /// Pixels from the exact silhouette, and the share of the hull's pixels that may be farther off.
    within_px: i64,
    wrong: f64,
    /// Median of differences of depth, and what all but a thirtieth stay below, metres.
    depths_m: [f64; 2],
}

fn bound(method: HullMethod) -> Bound {
    // Voxels are as coarse as they are, and half a diagonal larger: their weakness.
    let voxel_m = 2.2 / f64::from(N_VOXELS);
    match method {
        HullMethod::Rays | HullMethod::Csg | HullMethod::Hybrid => {
            Bound { within_px: 1, wrong: 0.0, depths_m: [1e-3, 5e-3] }
        }
        // Masks between texels are not quite straight where outlines are.
        HullMethod::Trimming => Bound { within_px: 1, wrong: 1e-3, depths_m: [1e-3, 1e-2] },
        HullMethod::Voxels => Bound { within_px: 3, wrong: 5e-3, depths_m: [1.2 * voxel_m, 4.0 * voxel_m] },
    }
}

/// Holds every method to the exact hulls of a state, seen by a view.
pub(super) fn check(name: &str, state: &SceneState, view: &View) {
    let Some(mut brush) = renderer("", 1) else { return };
    assert!(!state.hulls.is_empty(), "{name}");
    let exact = exact(state, view);
    for (word, method) in HullMethod::ALL {
        let Bound { within_px, wrong, depths_m: most_m } = bound(method);
        let name = format!("hulls_{name}_{word}");
        let found = found(&mut brush, state, view, (method, &name));
        let Comparison { n_wrong, n_exact, depths_m } = compare(&found, &exact, within_px);
        assert!(n_exact > 50, "{name}: {n_exact}");
        let at = |share: f64| depths_m[(share * (depths_m.len() - 1) as f64) as usize];
        let told = format!("{name}: {n_wrong} of {n_exact} wrong, depths {:?}", [0.5, 0.97, 1.0].map(at));
        assert!(n_wrong as f64 <= wrong * n_exact as f64, "{told}");
        assert!(at(0.5) <= most_m[0] && at(0.97) <= most_m[1], "{told}");
        eprintln!("{told}");
    }
}

#[test]
fn every_method_finds_the_hull_that_the_processor_finds() {
    let state = peopled(&ring(6), &[DVec3::ZERO]);
    assert_eq!(state.hulls[0].cameras.len(), 6);
    check("six", &state, &view(v(2.0, -4.0, 1.7), v(0.0, 0.0, 0.9), 0.5, 320, 400));
}
