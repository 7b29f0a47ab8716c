//! Hulls as they are drawn, against the processor's exact ones: every method, in every hard case.
#![expect(clippy::unwrap_used, reason = "a test's way to fail")]

use super::stage::Stage;
use super::{Brush, keep, renderer, v, view};
use glam::{DMat2, DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::{Billboard, Entity, HullMaking, HullMemory, SceneState, Velocity};
use videofields_picture::plan::{
    self, Colors, EntityStyle, FieldsForm, HullForm, HullMethod, HullTexture, HullVisibility, HullWeights,
    Picture, Sampling, Settings, View, Wishes,
};
use videofields_render::FoundHulls;
use videofields_vision::frame::{ColorMatrix, ColorRange, Frame, Mask, RgbImage, YuvImage};
use videofields_vision::geometry::{Camera, Distortion, Ray};
use videofields_vision::hull::Scratch;
use videofields_vision::observation::Observation;
use videofields_vision::segment::PixelRect;

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
pub(super) fn met(foot: DVec3, ray: &Ray) -> Option<f64> {
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
pub(super) fn paint(at: DVec3) -> [u8; 3] {
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
            owner: 0,
            shown_share: 1.0,
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
                velocity: Velocity::UNKNOWN,
                reach_m: None,
                height_m: 1.76,
                sources: sources.collect(),
            }
        })
        .filter(|entity| !entity.sources.is_empty())
        .collect();
    place(&mut state, 0.0);
    state
}

/// Voxels along the longest side of a hull.
const N_VOXELS: u32 = 128;

/// Makes hulls ready for every method.
fn place(state: &mut SceneState, error_px: f64) {
    state.place_hulls(HullMaking { error_px, n_voxels: Some(N_VOXELS) }, &mut HullMemory::default());
}

/// Cameras in a ring around the middle, tinted by nothing.
pub(super) fn ring(n: usize) -> Stage {
    let plain = [1.0; 3];
    (0..n).fold(Stage::new(), |stage, i| {
        let turn = (i as f64 + 0.3) / n as f64 * std::f64::consts::TAU;
        let height = 2.6 + 0.5 * (i % 3) as f64;
        stage.with_camera(v(5.5 * turn.cos(), 5.5 * turn.sin(), height), v(0.0, 0.0, 0.9), plain)
    })
}

/// What the exact hulls say of a picture's pixels: depth of what is nearest. An eye in a hull sees what lies behind it.
fn exact(state: &SceneState, view: &View) -> Vec<Option<f64>> {
    const NEAR_M: f64 = 0.05;
    let mut scratch = Scratch::default();
    let forward = view.pose.forward_in_world();
    let mut pixel = |x: u32, y: u32| {
        let share = |at: u32, n: u32| (f64::from(at) + 0.5) / f64::from(n);
        let ray = view.ray(share(x, view.width_px), share(y, view.height_px));
        let from = NEAR_M / ray.direction.dot(forward);
        let mut nearest: Option<f64> = None;
        for hull in &state.hulls {
            let [low, high] = hull.bounds_in_world.map(|corner| (corner - ray.origin) / ray.direction);
            let (near, far) = (low.min(high).max_element(), low.max(high).min_element());
            if near.max(from) >= far {
                continue;
            }
            hull.hull.cut(&ray, [near.max(from), far], &mut scratch);
            let is_within = near < from && scratch.intervals.first().is_some_and(|first| first[0] == from);
            let first = scratch.intervals.get(usize::from(is_within)).map(|interval| interval[0]);
            nearest = nearest.into_iter().chain(first).reduce(f64::min);
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
    let hull = HullForm { method, ..HullForm::EXACT };
    let settings =
        Settings { entities: EntityStyle::Hulls, hull, sampling: Sampling::ONCE, ..Settings::default() };
    let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() };
    let plan = plan::make(state, &Picture::from(*view), wishes);
    assert!(!plan.hulls.is_empty(), "{:?}", plan.reasons);
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
    /// Shares of the pixels, and what their differences of depth stay below, metres.
    depths: [(f64, f64); 2],
}

fn bound(method: HullMethod) -> Bound {
    // Voxels are as coarse as they are, and half a diagonal larger: their weakness.
    let voxel_m = 2.2 / f64::from(N_VOXELS);
    match method {
        HullMethod::Rays => Bound { within_px: 1, wrong: 0.0, depths: [(0.5, 1e-5), (0.97, 5e-3)] },
        // Where faces of two cameras lie in each other, which of them is before the other is left to rounding.
        HullMethod::Csg => Bound { within_px: 1, wrong: 5e-4, depths: [(0.5, 1e-5), (0.97, 5e-3)] },
        // Masks between texels are not quite straight where outlines are.
        HullMethod::Trimming => Bound { within_px: 1, wrong: 4e-3, depths: [(0.5, 1e-3), (0.97, 2e-2)] },
        // Slivers where cones cross may be thinner than the valid region's texels.
        HullMethod::Hybrid => Bound { within_px: 1, wrong: 2e-3, depths: [(0.5, 1e-5), (0.97, 5e-3)] },
        // Where surfaces graze the eye's rays, a voxel is a long way: no more is held of their last quarter.
        HullMethod::Voxels => {
            Bound { within_px: 3, wrong: 5e-3, depths: [(0.5, 2.0 * voxel_m), (0.75, 4.0 * voxel_m)] }
        }
    }
}

/// Holds every method to the exact hulls of a state, seen by a view.
pub(super) fn check(name: &str, state: &SceneState, view: &View) {
    check_by(name, state, view, |_| true);
}

/// As [`check`], of some methods.
fn check_by(name: &str, state: &SceneState, view: &View, is_held: impl Fn(HullMethod) -> bool) {
    let Some(mut brush) = renderer("", 1) else { return };
    assert!(!state.hulls.is_empty(), "{name}");
    let exact = exact(state, view);
    for (word, method) in HullMethod::ALL.into_iter().filter(|(_, method)| is_held(*method)) {
        let Bound { within_px, wrong, depths } = bound(method);
        let name = format!("hulls_{name}_{word}");
        let found = found(&mut brush, state, view, (method, &name));
        let Comparison { n_wrong, n_exact, depths_m } = compare(&found, &exact, within_px);
        assert!(n_exact > 50, "{name}: {n_exact}");
        let at = |share: f64| depths_m[(share * (depths_m.len() - 1) as f64) as usize];
        let told = format!("{name}: {n_wrong} of {n_exact} wrong, depths {:?}", [0.5, 0.97, 1.0].map(at));
        assert!(n_wrong as f64 <= wrong * n_exact as f64, "{told}");
        assert!(depths.iter().all(|(share, most_m)| at(*share) <= *most_m), "{told}");
    }
}

/// The state with other masks: what `change` makes of each camera's, row by row.
fn masked(mut state: SceneState, mut change: impl FnMut(usize, u32, &mut [u8])) -> SceneState {
    for (idx, camera) in state.cameras.iter_mut().enumerate() {
        let mut labels = (*camera.observation.labels).clone();
        let width = labels.width;
        change(idx, width, &mut labels.data);
        let labels = Arc::new(labels);
        camera.observation.soft_mask = Arc::clone(&labels);
        camera.observation.labels = labels;
    }
    place(&mut state, 0.0);
    state
}

pub(super) fn seen_from(eye: DVec3) -> View {
    view(eye, v(0.0, 0.0, 0.9), 0.5, 96, 120)
}

#[test]
fn every_method_finds_the_hull_that_the_processor_finds() {
    let state = peopled(&ring(6), &[DVec3::ZERO]);
    assert_eq!(state.hulls[0].cameras.len(), 6);
    check("six", &state, &view(v(2.0, -4.0, 1.7), v(0.0, 0.0, 0.9), 0.5, 320, 400));
}

#[test]
fn no_fold_before_the_hull_opens_it() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = peopled(&ring(8), &[DVec3::ZERO]);
    let view = view(v(1.4, -3.2, 1.9), v(0.0, 0.0, 0.9), 0.55, 480, 600);
    let exact = exact(&state, &view);
    let found = found(&mut brush, &state, &view, (HullMethod::Rays, "hulls_folds"));
    let (width, height) = (i64::from(found.width_px), i64::from(found.height_px));
    let is_deep = |idx: i64| {
        let (x, y) = (idx % width, idx / width);
        let around = (-4..=4).flat_map(|dy| (-4..=4).map(move |dx| (x + dx, y + dy)));
        let is_in = |(x, y): (i64, i64)| {
            (0..width).contains(&x) && (0..height).contains(&y) && exact[(y * width + x) as usize].is_some()
        };
        { around }.all(is_in)
    };
    let deep: Vec<f32> = (0..width * height)
        .filter(|idx| is_deep(*idx))
        .map(|idx| found.pixels[idx as usize].map_or(0.0, |found| found.coverage))
        .collect();
    assert!(deep.len() > 5000, "{}", deep.len());
    let open = deep.iter().filter(|coverage| **coverage < 0.9).count();
    assert!(open == 0, "{open} of {} are open", deep.len());
}

#[test]
fn two_to_sixty_four_cameras_give_one_answer() {
    for n in [2, 3, 9, 24, 64] {
        let state = peopled(&ring(n), &[DVec3::ZERO]);
        assert_eq!(state.hulls[0].cameras.len(), n);
        check(&format!("of_{n}"), &state, &seen_from(v(3.0, 3.0, 1.4)));
    }
}

#[test]
fn an_eye_within_cones_and_within_the_hull_sees_what_lies_before_it() {
    let state = peopled(&ring(5), &[DVec3::ZERO]);
    // Behind one camera and in its cone, between a camera and the hull, in all cones before the hull: right at it.
    let camera = state.cameras[0].camera.pose().position_in_world;
    for (name, eye) in [
        ("behind_a_camera", camera * 1.4 - v(0.0, 0.0, 0.36)),
        ("in_a_camera", camera),
        ("in_a_cone", camera * 0.6 + v(0.0, 0.0, 0.4)),
        ("close", v(0.55, 0.4, 1.2)),
    ] {
        check(name, &state, &seen_from(eye));
    }
    // In the trunk, upwards to the head: the near plane cuts the hull. Voxels are no volume: from within, their other side shows.
    let within = view(v(0.0, 0.0, 1.05), v(0.3, 0.05, 1.5), 1.2, 96, 96);
    check_by("within", &state, &within, |method| method != HullMethod::Voxels);
    let cut = view(v(0.0, -0.22, 1.1), v(0.1, 0.05, 0.0), 1.4, 96, 96);
    check_by("near_plane", &state, &cut, |method| method != HullMethod::Voxels);
}

#[test]
fn cameras_in_one_place_opposite_and_in_a_line_give_one_answer() {
    let plain = [1.0; 3];
    let of = |eyes: &[DVec3]| {
        let stage =
            eyes.iter().fold(Stage::new(), |stage, eye| stage.with_camera(*eye, v(0.0, 0.0, 0.9), plain));
        peopled(&stage, &[DVec3::ZERO])
    };
    let eye = v(5.0, 0.4, 1.8);
    check("one_place", &of(&[eye, eye]), &seen_from(v(2.0, -4.0, 1.7)));
    check("opposite", &of(&[eye, v(-5.0, -0.4, 0.05)]), &seen_from(v(2.0, -4.0, 1.7)));
    check("in_a_line", &of(&[eye * 0.8, eye, eye * 1.2]), &seen_from(v(2.0, -4.0, 1.7)));
}

#[test]
fn a_silhouette_at_the_border_takes_nothing_away_beyond_it() {
    // The last camera has but the upper half of the body in its picture, the one before all of it as foreground.
    let plain = [1.0; 3];
    let stage = ring(4).with_camera(v(0.0, 4.0, 1.5), v(0.0, 0.0, 2.05), plain);
    let state = peopled(&stage, &[DVec3::ZERO]);
    let whole = masked(state, |idx, _, mask| {
        if idx == 3 {
            mask.fill(255);
        }
    });
    let cut = whole.hulls[0].hull.views().last().unwrap();
    assert!(cut.touches_border());
    let mut scratch = Vec::new();
    for place in [v(-0.2, 0.0, 0.2), v(0.2, 0.05, 0.12), v(0.0, 0.0, 1.3)] {
        assert!(whole.hulls[0].hull.contains(place, &mut scratch), "{place}");
    }
    check("border", &whole, &seen_from(v(2.0, -4.0, 1.7)));
}

#[test]
fn an_empty_silhouette_and_ones_that_contradict_each_other_leave_nothing_and_no_nan() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = peopled(&ring(4), &[DVec3::ZERO]);
    let empty = masked(state.clone(), |idx, _, mask| {
        if idx == 2 {
            mask.fill(0);
        }
    });
    // Two say that only the feet are there, two that only the head is.
    let contradicting = masked(state, |idx, _, mask| {
        let half = mask.len() / 2;
        if idx % 2 == 0 { mask[..half].fill(0) } else { mask[half..].fill(0) }
    });
    let view = seen_from(v(2.0, -4.0, 1.7));
    for state in [&empty, &contradicting] {
        let nothing = exact(state, &view).iter().filter(|at| at.is_some()).count();
        for (word, method) in HullMethod::ALL {
            let found = found(&mut brush, state, &view, (method, "hulls_nothing"));
            let n_found = found.pixels.iter().flatten().count();
            assert!(n_found <= nothing + 20, "{word}: {n_found} of {nothing}");
        }
    }
}

#[test]
fn thin_holed_and_ragged_silhouettes_are_one_to_all_methods() {
    // A line of one pixel reaches out on either side of the trunk; a chessboard of holes takes thousands of corners.
    let state = peopled(&ring(3), &[DVec3::ZERO]);
    let thin = masked(state.clone(), |_, width, mask| {
        let row = mask.len() / 2;
        let row = row - row % width as usize;
        mask[row + 120..row + 200].fill(255);
    });
    let ragged = masked(state, |_, width, mask| {
        for (i, value) in mask.iter_mut().enumerate() {
            let (x, y) = (i % width as usize, i / width as usize);
            if x % 3 == 0 && y % 3 == 0 {
                *value = 0;
            }
        }
    });
    let n_corners: usize = ragged.hulls[0].hull.views().iter().map(|view| view.outside().edges().len()).sum();
    assert!(n_corners > 1500, "{n_corners}");
    for (name, state) in [("thin", &thin), ("ragged", &ragged)] {
        // As near to one of the cameras as to compare what it sees.
        let exact = exact(state, &seen_from(v(3.0, 3.0, 1.4)));
        let Some(mut brush) = renderer("", 1) else { return };
        for (word, method) in HullMethod::ALL.into_iter().filter(|(_, method)| *method != HullMethod::Voxels)
        {
            let name = format!("hulls_{name}_{word}");
            let found = found(&mut brush, state, &seen_from(v(3.0, 3.0, 1.4)), (method, &name));
            let Comparison { n_wrong, n_exact, depths_m } = compare(&found, &exact, 1);
            let told = format!("{name}: {n_wrong} of {n_exact}, {}", depths_m[depths_m.len() / 2]);
            // What is seen through holes of holes is where texels and lines differ.
            assert!(n_wrong * 100 <= n_exact && depths_m[depths_m.len() / 2] < 0.01, "{told}");
        }
    }
}

#[test]
fn outlines_of_ten_thousand_corners_are_as_any_other() {
    let state = peopled(&ring(3), &[DVec3::ZERO]);
    // Masks seven times as fine as the pictures, with a hole in every four by four of their pixels.
    const FINER: u32 = 7;
    let mut fine = state.clone();
    for camera in &mut fine.cameras {
        let coarse = Arc::clone(&camera.observation.labels);
        let mut mask = Mask::filled(FINER * coarse.width, FINER * coarse.height, 0);
        for (i, value) in mask.data.iter_mut().enumerate() {
            let (x, y) = (i as u32 % (FINER * coarse.width), i as u32 / (FINER * coarse.width));
            let is_hole = x % 4 == 0 && y % 4 == 0;
            *value = if is_hole { 0 } else { coarse.get(x / FINER, y / FINER) };
        }
        let mask = Arc::new(mask);
        camera.observation.soft_mask = Arc::clone(&mask);
        camera.observation.labels = mask;
    }
    fine.entities[0].sources.iter_mut().for_each(|source| {
        let PixelRect { x, y, width, height } = source.rect;
        source.rect = PixelRect { x: FINER * x, y: FINER * y, width: FINER * width, height: FINER * height };
    });
    place(&mut fine, 0.0);
    // Pictures are drawn from masks of their own size.
    for (camera, coarse) in fine.cameras.iter_mut().zip(&state.cameras) {
        camera.observation.clone_from(&coarse.observation);
    }
    let corners = fine.hulls[0].hull.views().iter().map(|view| view.outside().edges().len());
    assert!(corners.clone().max().unwrap() > 10_000, "{:?}", corners.collect::<Vec<_>>());
    let view = seen_from(v(3.0, 3.0, 1.4));
    let exact = exact(&fine, &view);
    let Some(mut brush) = renderer("", 1) else { return };
    // Trimming sees masks of 256 texels a side at most, and so every third hole: its weakness.
    for (method, most) in [(HullMethod::Rays, 0.01), (HullMethod::Trimming, 0.05), (HullMethod::Csg, 0.01)] {
        let name = format!("hulls_ten_thousand_{}", method.as_str());
        let found = found(&mut brush, &fine, &view, (method, &name));
        let Comparison { n_wrong, n_exact, depths_m } = compare(&found, &exact, 1);
        let told = format!("{name}: {n_wrong} of {n_exact}, {}", depths_m[depths_m.len() / 2]);
        assert!(n_wrong as f64 <= most * n_exact as f64 && depths_m[depths_m.len() / 2] < 0.01, "{told}");
    }
}

/// Draws hulls with a texture.
fn textured(
    brush: &mut Brush,
    (state, view): (&SceneState, &View),
    (method, texture): (HullMethod, HullTexture),
    name: &str,
) -> RgbImage {
    let hull = HullForm { method, texture, ..HullForm::EXACT };
    let settings =
        Settings { entities: EntityStyle::Hulls, hull, sampling: Sampling::ONCE, ..Settings::default() };
    let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() };
    let plan = plan::make(state, &Picture::from(*view), wishes);
    let image = brush.render(state, view, &plan).unwrap().image;
    keep(name, &image);
    image
}

/// Pixels whose codes differ by more than so many.
pub(super) fn n_apart(a: &RgbImage, b: &RgbImage, codes: u8) -> usize {
    let pixels = a.data.chunks_exact(3).zip(b.data.chunks_exact(3));
    pixels.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > codes)).count()
}

#[test]
fn who_stands_before_somebody_lends_them_no_colour_by_depth_maps_and_by_rays() {
    let Some(mut brush) = renderer("", 1) else { return };
    // The viewer looks much as a camera does, before whom the one hides the lower half of the other.
    let eye = v(-5.5, 0.0, 2.4);
    let stage = ring(7).with_camera(eye, v(0.0, 0.0, 0.9), [1.0; 3]);
    let state = peopled(&stage, &[v(-1.0, 0.0, -0.6), v(0.6, 0.0, 0.0)]);
    assert_eq!(state.hulls.len(), 2);
    let view = view(v(-5.0, 1.6, 2.6), v(0.0, 0.0, 0.9), 0.5, 240, 240);
    let exact = HullForm::EXACT.texture;
    for (method, name) in [(HullMethod::Rays, "rays"), (HullMethod::Trimming, "trimming")] {
        let mut drawn = |visibility: HullVisibility| {
            let name = format!("hulls_hidden_{name}_{}", visibility.as_str());
            textured(&mut brush, (&state, &view), (method, HullTexture { visibility, ..exact }), &name)
        };
        let [off, depths, rays] =
            [HullVisibility::Off, HullVisibility::Depths, HullVisibility::Rays].map(&mut drawn);
        let [by_depths, by_none] = [&depths, &off].map(|image| n_apart(image, &rays, 24));
        assert!(by_none > 200, "{name}: the camera's weight is nothing without looking: {by_none}");
        assert!(by_depths * 8 < by_none, "{name}: {by_depths} pixels by depth maps, {by_none} by none");
    }
}

#[test]
fn depth_maps_that_are_seen_edge_on_hide_nothing_that_is_seen() {
    let Some(mut brush) = renderer("", 1) else { return };
    // One body alone, from aside: its surface grazes the cameras' rays at every outline, and nothing stands before it but itself.
    let state = peopled(&ring(5), &[DVec3::ZERO]);
    let exact = HullForm::EXACT.texture;
    for turn in [0.0_f64, 0.9, 2.1, 4.0] {
        let eye = v(4.0 * turn.cos(), 4.0 * turn.sin(), 1.6);
        let view = seen_from(eye);
        let mut drawn = |visibility: HullVisibility| {
            let texture = HullTexture { visibility, ..exact };
            let name = format!("hulls_edge_on_{turn}_{}", visibility.as_str());
            textured(&mut brush, (&state, &view), (HullMethod::Rays, texture), &name)
        };
        let [depths, rays] = [HullVisibility::Depths, HullVisibility::Rays].map(&mut drawn);
        let n = n_apart(&depths, &rays, 24);
        let found = found(&mut brush, &state, &view, (HullMethod::Rays, "hulls_edge_on"));
        let n_found = found.pixels.iter().flatten().count();
        assert!(n * 50 <= n_found, "{turn}: {n} of {n_found} pixels");
    }
}

#[test]
fn weights_at_corners_are_near_those_at_fragments() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = peopled(&ring(5), &[DVec3::ZERO]);
    let view = seen_from(v(3.0, -2.5, 1.7));
    let exact = HullForm::EXACT.texture;
    for method in [HullMethod::Rays, HullMethod::Trimming, HullMethod::Csg] {
        let mut drawn = |weights: HullWeights, name: &str| {
            let name = format!("hulls_weights_{}_{name}", method.as_str());
            textured(&mut brush, (&state, &view), (method, HullTexture { weights, ..exact }), &name)
        };
        let [corners, fragments] =
            [drawn(HullWeights::Corners, "corners"), drawn(HullWeights::Fragments, "fragments")];
        let n_hull = brush.renderer.found_hulls().unwrap().unwrap().pixels.iter().flatten().count();
        let n = n_apart(&corners, &fragments, 40);
        assert!(n * 10 < n_hull, "{method:?}: {n} of {n_hull}");
        // They are not the same thing twice.
        assert!(n_apart(&corners, &fragments, 0) > 20, "{method:?}");
    }
}

#[test]
fn people_who_hide_each_other_are_two_hulls_and_a_wall_cuts_nobody_in_half() {
    let feet = [v(-0.6, 0.1, 0.0), v(0.6, -0.1, 0.0)];
    let state = peopled(&ring(6), &feet);
    assert_eq!(state.hulls.len(), 2);
    check("two", &state, &seen_from(v(2.0, -5.0, 1.7)));
    // One beside the picture, the other cut by its edge.
    check("one_beside", &state, &view(v(2.0, -5.0, 1.7), v(1.0, -0.1, 1.2), 0.12, 96, 96));
    // Behind a wall one camera sees the heads alone.
    let walled = ring(6).with_box(v(2.2, 1.2, 0.5), v(0.2, 2.5, 1.0), 0.5);
    let state = peopled(&walled, &[DVec3::ZERO]);
    let hull = &state.hulls[0].hull;
    let mut scratch = Vec::new();
    for place in [v(-0.2, 0.0, 0.2), v(0.2, 0.05, 0.12), v(0.0, 0.0, 1.05)] {
        assert!(hull.contains(place, &mut scratch), "{place}");
    }
    check("walled", &state, &seen_from(v(-2.0, -4.0, 1.7)));
}

#[test]
fn hulls_at_map_coordinates_and_through_parallel_rays_are_as_exact() {
    let far = Stage { offset: v(5e5, 5e6, 300.0), ..Stage::new() };
    let stage = ring(5);
    let moved = stage.cameras.iter().fold(far, |far, (camera, tint)| {
        let eye = camera.pose().position_in_world;
        far.with_camera(eye, eye + camera.pose().forward_in_world(), *tint)
    });
    let state = peopled(&moved, &[DVec3::ZERO]);
    let offset = moved.offset;
    check("far", &state, &view(offset + v(2.0, -4.0, 1.7), offset + v(0.0, 0.0, 0.9), 0.5, 96, 120));
    let state = peopled(&stage, &[DVec3::ZERO]);
    let limits = super::LIMITS;
    let parallel =
        Picture::orthographic((v(2.0, -4.0, 1.7), v(0.0, 0.0, 0.9)), 1.6, (96, 120), &limits).unwrap();
    check("parallel", &state, &parallel.parts[0].view);
}

/// As cameras have it that see it at `at_s` each, where it goes on by `velocity` a second from the middle at 0.
pub(super) fn walking(stage: &Stage, velocity: DVec3, at_s: &[f64]) -> SceneState {
    let mut state = peopled(stage, &[DVec3::ZERO]);
    for (idx, at_s) in at_s.iter().enumerate() {
        let mut then = peopled(stage, &[velocity * *at_s]);
        let source = |state: &SceneState| {
            state.entities[0].sources.iter().position(|source| source.camera_idx == idx).unwrap()
        };
        let (here, there) = (source(&state), source(&then));
        state.entities[0].sources[here] = then.entities[0].sources.swap_remove(there);
        let mut camera = then.cameras.swap_remove(idx);
        let frame = &mut camera.observation.frame;
        frame.timestamp = frame.timestamp.saturating_add_nanos((at_s * 1e9) as i64);
        state.cameras[idx] = camera;
    }
    state.entities[0].velocity = Velocity { over_ground_m_per_s: velocity.truncate(), sd_m_per_s: 0.3 };
    place(&mut state, 0.0);
    state
}

#[test]
fn lenses_that_bend_are_as_any_others() {
    let bent = Distortion::BrownConrady { coefficients: [-0.18, 0.03, 0.002, -0.001, 0.0, 0.0, 0.0, 0.0] };
    let stage = (0..5).fold(Stage::new(), |stage, i| {
        let turn = f64::from(i) * 1.2;
        let eye = v(5.5 * turn.cos(), 5.5 * turn.sin(), 2.6 + 0.3 * f64::from(i));
        let lens = if i == 2 { Distortion::None } else { bent };
        stage.with_lens(eye, v(0.3, -0.5, 0.9), [1.0; 3], lens, 240.0)
    });
    let state = peopled(&stage, &[DVec3::ZERO]);
    assert_eq!(state.hulls[0].cameras.len(), 5);
    check("lenses", &state, &seen_from(v(2.0, -4.0, 1.7)));
}

#[test]
fn hulls_that_follow_from_the_same_are_made_once() {
    let state = || peopled(&ring(4), &[v(-0.8, 0.0, 0.0), v(0.8, 0.0, 0.0)]);
    let mut first = state();
    let making = HullMaking { error_px: 0.5, n_voxels: None };
    let mut memory = HullMemory::default();
    first.place_hulls(making, &mut memory);
    let is_same = |a: &SceneState, b: &SceneState| -> Vec<bool> {
        a.hulls.iter().zip(&b.hulls).map(|(a, b)| Arc::ptr_eq(a, b)).collect()
    };
    // Another picture of the instant.
    let mut again = SceneState { hulls: Vec::new(), ..first.clone() };
    again.place_hulls(making, &mut memory);
    assert_eq!(is_same(&first, &again), [true, true]);
    assert!(memory.n_bytes() > 1000);
    // Made otherwise, of somebody who moved, of a camera that saw anew or is calibrated anew: made again.
    let mut fine = first.clone();
    fine.place_hulls(HullMaking { error_px: 0.0, ..making }, &mut memory);
    assert_eq!(is_same(&first, &fine), [false, false]);
    let mut moved = first.clone();
    moved.entities[1].foot_in_world.x += 0.01;
    moved.place_hulls(making, &mut memory);
    assert_eq!(is_same(&first, &moved), [true, false]);
    let mut seen = first.clone();
    seen.cameras[2].observation.soft_mask = Arc::new((*seen.cameras[2].observation.soft_mask).clone());
    seen.place_hulls(making, &mut memory);
    assert_eq!(is_same(&first, &seen), [false, false]);
    let mut calibrated = first.clone();
    calibrated.cameras[0].corrected =
        Arc::new((*first.cameras[0].corrected).clone().moved(v(0.0, 0.0, 0.1)).unwrap());
    calibrated.place_hulls(making, &mut memory);
    assert_eq!(is_same(&first, &calibrated), [false, false]);
    // Of another scene, whose cameras have the same names.
    let mut other = state();
    other.place_hulls(making, &mut memory);
    assert_eq!(is_same(&first, &other), [false, false]);
    // What no picture asks for goes after some.
    let kept = memory.n_bytes();
    for _ in 0..40 {
        other.place_hulls(making, &mut memory);
    }
    assert!(memory.n_bytes() > 0 && memory.n_bytes() < kept / 2, "{} of {kept}", memory.n_bytes());
    // What has gone from memory goes from this one too.
    drop((first, again, fine, moved, seen, calibrated, other));
    let mut none = peopled(&ring(2), &[]);
    none.place_hulls(making, &mut memory);
    assert_eq!(memory.n_bytes(), 0);
}

#[test]
fn frames_of_several_instants_are_one_shape_where_it_is_known_how_somebody_walks() {
    // Instants whose mean is 0, so that the hull should stand in the middle.
    let (stage, at_s) = (ring(6), [-0.12, 0.06, 0.12, -0.06, 0.1, -0.1]);
    let still = peopled(&stage, &[DVec3::ZERO]);
    let mut walks = walking(&stage, v(1.4, 0.6, 0.0), &at_s);
    let of = &walks.hulls[0];
    assert!(
        (of.skew_s - 0.24).abs() < 1e-9 && (of.apart_m - 0.072).abs() < 1e-9,
        "{} {}",
        of.skew_s,
        of.apart_m
    );
    let overlap = |state: &SceneState| {
        let (mut scratch, mut both, mut either) = (Vec::new(), 0, 0);
        for i in 0..32_000 {
            let at = v(f64::from(i % 40) - 19.5, f64::from(i / 40 % 20) - 9.5, f64::from(i / 800) + 0.5);
            let place = at * v(0.03, 0.04, 0.045);
            let is = [&still, state].map(|of| of.hulls[0].hull.contains(place, &mut scratch));
            both += u32::from(is[0] && is[1]);
            either += u32::from(is[0] || is[1]);
        }
        f64::from(both) / f64::from(either)
    };
    let moved = overlap(&walks);
    check("walking", &walks, &seen_from(v(2.0, -4.0, 1.7)));
    // As if nothing were known of the way.
    walks.entities[0].velocity = Velocity::UNKNOWN;
    place(&mut walks, 0.0);
    let unmoved = overlap(&walks);
    // Masks of another place have other pixels: no two of them are closer.
    assert!(moved > 0.88 && unmoved < 0.3, "{moved} {unmoved}");
    assert!(walks.hulls[0].apart_m > 0.3);
    // Instants that are no part of one walk move nothing.
    let late = &mut walks.cameras[2].observation.frame;
    late.timestamp = late.timestamp.saturating_add_nanos(i64::MAX);
    walks.entities[0].velocity = Velocity { over_ground_m_per_s: DVec2::splat(1e3), sd_m_per_s: 0.0 };
    place(&mut walks, 0.0);
    let hull = &walks.hulls[0];
    assert!(hull.apart_m.is_finite() && hull.apart_m > 1e3);
    let stands = |idx: usize| walks.cameras[hull.cameras[idx]].camera.pose().position_in_world;
    assert!((0..6).all(|idx| hull.hull.views()[idx].camera().pose().position_in_world == stands(idx)));
}

#[test]
fn who_cannot_be_a_hull_is_a_billboard_and_the_plan_says_why() {
    let state = peopled(&ring(5), &[DVec3::ZERO]);
    let view = seen_from(v(2.0, -4.0, 1.7));
    let wishes = |entities| Wishes {
        settings: Settings {
            entities,
            hull: HullForm { least_cameras: 4, ..HullForm::EXACT },
            ..Settings::default()
        },
        see_through: false,
        colors: Colors::Raw,
        effects: Default::default(),
    };
    let reason = |state: &SceneState, effect: &str| {
        let plan = plan::make(state, &Picture::from(view), wishes(EntityStyle::Hulls));
        let reason = plan.reasons.iter().find(|reason| reason.effect == effect).unwrap().clone();
        (plan.hulls.len(), plan.billboards.len(), reason.is_on, reason.because)
    };
    let (n_hulls, n_billboards, is_on, because) = reason(&state, "hull");
    assert_eq!((n_hulls, n_billboards, is_on), (1, 0, true), "{because}");
    // One camera alone.
    let mut alone = state.clone();
    alone.entities[0].sources.truncate(1);
    place(&mut alone, 0.5);
    let (n_hulls, n_billboards, is_on, because) = reason(&alone, "hull");
    assert_eq!((n_hulls, n_billboards, is_on), (0, 1, false), "{because}");
    assert!(because.contains("1 seen by one camera"), "{because}");
    // Fewer than are asked for.
    let few = peopled(&ring(3), &[DVec3::ZERO]);
    let (n_hulls, n_billboards, is_on, because) = reason(&few, "hull");
    assert_eq!((n_hulls, n_billboards, is_on), (0, 1, false), "{because}");
    assert!(because.contains("fewer than 4 cameras"), "{because}");
    // A camera whose frame is of another moment.
    let mut skewed = state;
    let late = &mut skewed.cameras[1].observation.frame;
    late.timestamp = late.timestamp.saturating_add_nanos(250_000_000);
    place(&mut skewed, 0.5);
    assert!((skewed.hulls[0].skew_s - 0.25).abs() < 1e-9);
    let (n_hulls, n_billboards, is_on, because) = reason(&skewed, "hull");
    assert_eq!((n_hulls, n_billboards, is_on), (0, 1, false), "{because}");
    assert!(because.contains("0.25 s apart"), "{because}");
    // As is truest of each: a hull by cameras from different sides, a billboard by such as look along one line.
    let auto = |state: &SceneState| {
        let settings = Settings { entities: EntityStyle::Auto, ..Settings::default() };
        let plan = plan::make(state, &Picture::from(view), Wishes { settings, ..wishes(EntityStyle::Auto) });
        let reason = plan.reasons.iter().find(|reason| reason.effect == "hull").unwrap().clone();
        (plan.entities, plan.hulls.len(), plan.billboards.len(), reason.because)
    };
    let five = peopled(&ring(5), &[DVec3::ZERO]);
    let (style, n_hulls, n_billboards, because) = auto(&five);
    assert_eq!((style, n_hulls, n_billboards), (EntityStyle::Hulls, 1, 0), "{because}");
    let eye = v(5.0, 0.4, 1.8);
    let line = [eye, eye + v(0.0, 1.2, 0.2), v(-5.0, -0.4, 1.0)];
    let line =
        line.iter().fold(Stage::new(), |stage, eye| stage.with_camera(*eye, v(0.0, 0.0, 0.9), [1.0; 3]));
    let (style, n_hulls, n_billboards, because) = auto(&peopled(&line, &[DVec3::ZERO]));
    assert_eq!((style, n_hulls, n_billboards), (EntityStyle::Billboards, 0, 1), "{because}");
    assert!(because.contains("1 seen along one line but for less than 25 degrees"), "{because}");
    // Where none is asked for none is made ready.
    let plan = plan::make(&skewed, &Picture::from(view), wishes(EntityStyle::Billboards));
    assert!(
        plan.hulls.is_empty() && !plan.reasons.iter().any(|reason| reason.effect == "hull" && reason.is_on)
    );
}

#[test]
fn hulls_that_other_pictures_interrupt_are_the_same_to_the_byte() {
    let Some(mut brush) = renderer("", 4) else { return };
    let state = peopled(&ring(5), &[DVec3::ZERO]);
    let picture = Picture::from(view(v(2.0, -4.0, 1.7), v(0.0, 0.0, 0.9), 0.8, 160, 200));
    let whole = brush.wishes(EntityStyle::Hulls);
    let mut check = |settings: Settings| {
        let plan = plan::make(&state, &picture, Wishes { settings, ..whole });
        assert!(!plan.hulls.is_empty() || !plan.meshed_hulls.is_empty(), "{:?}", plan.reasons);
        let n_pieces = super::views::check_interrupted(&mut brush, &state, (&picture, &plan));
        assert_eq!(n_pieces, 4);
    };
    for method in
        [HullMethod::Rays, HullMethod::Trimming, HullMethod::Csg, HullMethod::Hybrid, HullMethod::Voxels]
    {
        check(Settings { hull: HullForm { method, ..HullForm::EXACT }, ..whole.settings });
    }
    for fields in [FieldsForm::Normals, FieldsForm::Montage] {
        check(Settings { fields, ..whole.settings });
    }
}
