//! Calibrations that disagree, found by people whom cameras saw.

use super::*;
use crate::occupancy::drawn_people::{SIZE, around, camera, scene};
use videofields_vision::mapping;

/// Numbers from 0 to 1 that look random.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn noise(&mut self) -> f64 {
        ((0..12).map(|_| self.roll()).sum::<f64>() - 6.0).clamp(-4.0, 4.0)
    }
}

const RATE_HZ: f64 = 5.0;

/// People who walk over a square of 12 m, one after the other.
struct Walkers {
    n_at_once: usize,
    secs: f64,
    middle: DVec3,
}

/// Kinds of errors of feet in pictures.
#[derive(Clone, Copy, Debug, Default)]
struct FootErrors {
    noise_px: f64,
    /// Distance by which feet are seen nearer than they are, metres.
    nearer_m: f64,
    /// Share of sightings that are somewhere else.
    wrong: f64,
}

impl Walkers {
    /// Returns what a camera sees of them.
    fn sightings_by(&self, camera: &Camera, errors: FootErrors, seed: u64) -> Vec<FootSighting> {
        let (mut paths, mut dice) = (Dice(7), Dice(seed + 99));
        let mut all = Vec::new();
        for way in 0..(self.secs / 10.0) as usize * self.n_at_once {
            let begins = (way / self.n_at_once) as f64 * 10.0 + 2.0 * paths.roll();
            let mut corner = || DVec3::new(paths.roll() * 12.0 - 6.0, paths.roll() * 12.0 - 6.0, 0.0);
            let (from, to) = (corner(), corner());
            for step in 0..(7.5 * RATE_HZ) as usize {
                let walked = step as f64 / RATE_HZ;
                let foot = self.middle + from.lerp(to, walked / 7.5);
                let to_camera = (camera.pose().position_in_world - foot).truncate().normalize().extend(0.0);
                let seen = |at: DVec3| camera.project(at).map(|of| of.texture);
                let Some(low) = seen(foot + to_camera * errors.nearer_m) else { continue };
                let Some(high) = seen(foot + DVec3::Z * 1.7) else { continue };
                let size_px = DVec2::new(SIZE.0.into(), SIZE.1.into());
                let mut foot = low + DVec2::new(dice.noise(), dice.noise()) * errors.noise_px / size_px;
                if dice.roll() < errors.wrong {
                    foot += DVec2::new(dice.noise(), dice.noise()) * 0.1;
                }
                if !(foot.cmpge(DVec2::ZERO).all() && foot.cmplt(DVec2::ONE).all()) {
                    continue;
                }
                let height = (low.y - high.y).clamp(0.0, 1.0);
                all.push(FootSighting {
                    at: Timestamp::from_nanos(1_790_000_000_000_000_000 + ((begins + walked) * 1e9) as i64),
                    track: way as u32,
                    foot_in_texture: foot.as_vec2().to_array(),
                    size_in_texture: [0.17 * height, height].map(|share| (share * 65_535.0) as u16),
                });
            }
        }
        all.sort_by_key(|of| of.at);
        all
    }
}

/// Returns the offsets that are found where cameras stand as `truly` says and are taken to stand as `believed` says.
fn found(
    truly: &[Camera],
    believed: &[Camera],
    walkers: &Walkers,
    errors: FootErrors,
) -> Vec<Option<CalibrationOffset>> {
    let seen: Vec<Vec<FootSighting>> =
        truly.iter().zip(0..).map(|(camera, seed)| walkers.sightings_by(camera, errors, seed)).collect();
    let seen: Vec<&[FootSighting]> = seen.iter().map(Vec::as_slice).collect();
    calibration_offsets(&scene(walkers.middle, "", believed), &seen)
}

/// Returns how far places that a camera sees in the middle of the square are from where it truly sees them, root mean square.
fn error_m(truly: &Camera, believed: &Camera, offset: Option<&CalibrationOffset>, middle: DVec3) -> f64 {
    let believed = offset.map_or_else(|| believed.clone(), |offset| offset.corrected(believed).unwrap());
    let surfaces = &scene(middle, "", &[]).surfaces;
    let places = (0..49).map(|at| middle + DVec3::new(f64::from(at % 7) - 3.0, f64::from(at / 7) - 3.0, 0.0));
    let errors: Vec<f64> = places
        .filter_map(|at| {
            Some(mapping::place(&believed, surfaces, truly.project(at)?.texture)?.distance_squared(at))
        })
        .collect();
    assert!(errors.len() > 20);
    (errors.iter().sum::<f64>() / errors.len() as f64).sqrt()
}

fn off(camera: &Camera, turned_deg: [f64; 3], moved_m: [f64; 3]) -> Camera {
    let turned_rad = DVec3::from_array(turned_deg) * 1_f64.to_radians();
    corrected(camera, (DVec3::from_array(moved_m), turned_rad)).unwrap()
}

const FEW: Walkers = Walkers { n_at_once: 2, secs: 300.0, middle: DVec3::ZERO };
const USUAL: FootErrors = FootErrors { noise_px: 1.0, nearer_m: 0.08, wrong: 0.05 };

#[test]
fn one_camera_of_three_that_is_turned_and_moved_is_found() {
    let truly = around(DVec3::ZERO);
    for (n_at_once, most_m) in [(1, 0.1), (2, 0.1), (12, 0.12)] {
        let mut believed = truly.clone();
        believed[1] = off(&truly[1], [0.5, -0.4, 1.2], [0.1, 0.05, -0.1]);
        let before = error_m(&truly[1], &believed[1], None, DVec3::ZERO);
        let offsets = found(&truly, &believed, &Walkers { n_at_once, ..FEW }, USUAL);
        let all: Vec<f64> = (0..3)
            .map(|idx| error_m(&truly[idx], &believed[idx], offsets[idx].as_ref(), DVec3::ZERO))
            .collect();
        assert!(before > 0.3 && all.iter().all(|error| *error < most_m), "{before}, {all:?}");
        let offset = offsets[1].unwrap();
        assert!((offset.offset_m - before).abs() < 0.35 * before, "{offset:?}");
        assert!(offsets.iter().flatten().all(CalibrationOffset::is_known));
    }
}

#[test]
fn calibrations_that_agree_stay_as_they_are() {
    let truly = around(DVec3::ZERO);
    for offset in found(&truly, &truly, &FEW, USUAL) {
        assert!(offset.unwrap().offset_m < 0.07 && !offset.unwrap().is_used(), "{offset:?}");
    }
}

#[test]
fn two_cameras_that_disagree_are_brought_together_and_nobody_knows_which_is_wrong() {
    let [a, b, _] = around(DVec3::ZERO);
    let truly = [a, b];
    let believed = [truly[0].clone(), off(&truly[1], [0.0, 0.0, 1.5], [0.0; 3])];
    let offsets: [_; 2] = found(&truly, &believed, &FEW, USUAL).try_into().unwrap();
    let corrected: Vec<Camera> = offsets
        .iter()
        .zip(&believed)
        .map(|(offset, camera)| offset.unwrap().corrected(camera).unwrap())
        .collect();
    let surfaces = &scene(DVec3::ZERO, "", &[]).surfaces;
    let apart = |cameras: &[Camera]| {
        let see = |idx: usize, at: DVec3| {
            mapping::place(&cameras[idx], surfaces, truly[idx].project(at).unwrap().texture).unwrap()
        };
        let places = (0..25).map(|at| DVec3::new(f64::from(at % 5) - 2.0, f64::from(at / 5) - 2.0, 0.0));
        places.map(|at| see(0, at).distance(see(1, at))).sum::<f64>() / 25.0
    };
    let [before, after] = [apart(&believed), apart(&corrected)];
    assert!(before > 0.28 && after < 0.09, "{before} {after}");
    let [first, second] = offsets.map(|offset| offset.unwrap());
    assert!(first.error_m > 0.12 && second.error_m > 0.12, "{first:?} {second:?}");
}

#[test]
fn cameras_that_see_nobody_in_common_are_left_alone() {
    let truly = around(DVec3::ZERO);
    let seen = FEW.sightings_by(&truly[0], USUAL, 1);
    let scene = scene(DVec3::ZERO, "", &truly);
    assert_eq!(calibration_offsets(&scene, &[&seen, &[], &[]]), [None, None, None]);
    assert_eq!(calibration_offsets(&scene, &[&[], &[], &[]]), [None, None, None]);
}

#[test]
fn far_from_the_origin_it_is_the_same() {
    let middle = DVec3::new(1e7, -1e7, 40.0);
    let truly = around(middle);
    let mut believed = truly.clone();
    believed[2] = off(&truly[2], [0.3, 0.3, -1.0], [0.0, 0.1, 0.0]);
    let offsets = found(&truly, &believed, &Walkers { middle, ..FEW }, USUAL);
    let error = error_m(&truly[2], &believed[2], offsets[2].as_ref(), middle);
    assert!(error < 0.1, "{error} {offsets:?}");
}

#[test]
fn cameras_that_agree_as_far_as_feet_tell_are_not_moved_and_others_nearly_all_the_way() {
    let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
    let offset = |offset_m: f64, error_m: f64, n_paths: usize| CalibrationOffset {
        moved_m: DVec3::new(0.0, 0.0, 0.1),
        turned_rad: DVec3::new(0.01, 0.0, 0.0),
        offset_m,
        error_m,
        apart_m: [offset_m, 0.1],
        n_paths,
    };
    let shares = |offsets: [Option<CalibrationOffset>; 3]| {
        let corrected = with_offsets(&scene, &offsets)?;
        let pairs = scene.cameras.iter().zip(&corrected.cameras);
        let share = |(is, should): (&SceneCamera, &SceneCamera)| {
            let (is, should) = (is.camera.pose(), should.camera.pose());
            let turned = is.world_from_local.angle_between(should.world_from_local) / 0.01;
            let moved = (should.position_in_world - is.position_in_world).z / 0.1;
            assert!((turned - moved).abs() < 1e-6, "{turned} {moved}");
            moved
        };
        Some(pairs.map(share).collect::<Vec<_>>())
    };
    let not_nearer = CalibrationOffset { apart_m: [0.3, 0.25], ..offset(0.9, 0.0, 50) };
    assert_eq!(shares([None, Some(not_nearer), None]), None);
    let unsure =
        [Some(offset(0.11, 0.0, 50)), Some(offset(0.3, 0.6, 50)), Some(offset(0.9, 0.0, LEAST_PATHS - 1))];
    assert_eq!(shares(unsure), None);
    assert!(unsure.iter().flatten().all(|offset| !offset.is_used()));
    let some = shares([
        Some(offset(0.24, 0.0, 50)),
        Some(offset(0.4, 0.32, 50)),
        Some(offset(1.2, 0.0, LEAST_PATHS)),
    ]);
    let some = some.unwrap();
    assert!(
        (some[0] - 0.75).abs() < 1e-6 && (some[1] - 0.75).abs() < 1e-6 && (some[2] - 0.99).abs() < 1e-6,
        "{some:?}"
    );
}

#[test]
fn what_is_too_wide_or_tall_for_one_person_says_nothing() {
    let truly = around(DVec3::ZERO);
    let mut seen: Vec<Vec<FootSighting>> =
        truly.iter().map(|camera| FEW.sightings_by(camera, USUAL, 3)).collect();
    let scene = scene(DVec3::ZERO, "", &truly);
    let found = |seen: &[Vec<FootSighting>]| {
        let seen: Vec<&[FootSighting]> = seen.iter().map(Vec::as_slice).collect();
        calibration_offsets(&scene, &seen).iter().flatten().count()
    };
    assert_eq!(found(&seen), 3);
    seen.iter_mut().flatten().for_each(|of| of.size_in_texture[0] *= 3);
    assert_eq!(found(&seen), 0);
    seen.iter_mut().flatten().for_each(|of| of.size_in_texture = of.size_in_texture.map(|share| share / 3));
    assert_eq!(found(&seen), 0);
}

#[test]
fn an_observation_gives_feet_of_what_moves_alone_and_is_whole() {
    use crate::occupancy::drawn_people::{mask, observation};
    use videofields_vision::frame::CameraId;
    use videofields_vision::segment::PixelRect;
    use videofields_vision::track::Track;
    let camera = camera(DVec3::new(0.0, -9.0, 3.0), DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", std::slice::from_ref(&camera));
    let mut seen = observation(CameraId::new("a").unwrap(), mask(&scene, &camera, &[(DVec3::ZERO, 1.7)]));
    let track = Track {
        id: 7,
        rect: PixelRect { x: 144, y: 45, width: 32, height: 90 },
        blob_idx: Some(0),
        foot_in_image: [160.0, 135.0],
        velocity_px_per_sec: [0.0; 2],
        first_seen: Timestamp::from_nanos(0),
        last_seen: Timestamp::from_nanos(0),
        is_in_group: false,
        still_since: None,
    };
    let others = [
        Track { blob_idx: None, ..track.clone() },
        Track { is_in_group: true, ..track.clone() },
        Track { still_since: Some(Timestamp::from_nanos(0)), ..track.clone() },
        Track { foot_in_image: [160.0, 180.0], ..track.clone() },
    ];
    seen.tracks = others.into_iter().chain([track]).collect::<Vec<_>>().into();
    let found: Vec<FootSighting> = foot_sightings(&seen).collect();
    let foot = FootSighting {
        at: seen.frame.timestamp,
        track: 7,
        foot_in_texture: [0.5, 0.75],
        size_in_texture: [6554, 32_768],
    };
    assert_eq!(found, [foot]);
}

/// Returns the steps of paths, one after the other: each begins at a place and goes by so much from step to step.
fn walked(paths: &[(DVec3, DVec3)], n_steps: i64) -> Vec<PlacedStep> {
    let mut all: Vec<PlacedStep> = paths
        .iter()
        .zip(0..)
        .flat_map(|((from, by), path)| {
            (0..n_steps).map(move |instant| PlacedStep {
                instant,
                path,
                step: 0,
                foot_in_world: *from + *by * instant as f64,
                height_m: 1.7,
                covariance: DMat2::IDENTITY * 0.01,
                away: DVec2::X,
                away_a_metre: 2.0,
                by_twist: [DVec2::Y * 10.0; 6],
            })
        })
        .collect();
    all.sort_by_key(|step| (step.instant, step.path));
    all.iter_mut().zip(0..).for_each(|(step, idx)| step.step = idx);
    all
}

/// Returns how many steps of which paths of the one are matched with which of the other.
fn counted(own: &[(DVec3, DVec3)], its: &[(DVec3, DVec3)], n_steps: i64) -> BTreeMap<(u32, u32), usize> {
    let mut counts = BTreeMap::new();
    for found in matched(&[walked(own, n_steps), walked(its, n_steps)], GATES_M[0]) {
        *counts.entry((found.path_of(0), found.path_of(1))).or_default() += 1;
    }
    counts
}

#[test]
fn whoever_walks_beside_others_is_matched_by_the_difference_that_all_have() {
    // Five walk side by side, a metre apart; the second camera sees each nearer to where the first sees the next.
    let abreast = |shift_m: f64| -> Vec<(DVec3, DVec3)> {
        (0..5).map(|idx| (DVec3::new(f64::from(idx) + shift_m, 0.0, 0.0), DVec3::Y * 0.6)).collect()
    };
    let counts = counted(&abreast(0.0), &abreast(0.6), 10);
    let each: BTreeMap<(u32, u32), usize> = (0..5).map(|idx| ((idx, idx), 10)).collect();
    assert_eq!(counts, each);
}

#[test]
fn who_crosses_another_way_or_stands_on_another_storey_is_somebody_else() {
    let walks = (DVec3::ZERO, DVec3::new(0.6, 0.0, 0.0));
    let crosses = (DVec3::new(1.5, -1.5, 0.0), DVec3::new(0.0, 0.6, 0.0));
    let above = (DVec3::Z * 3.0, walks.1);
    let thrice = [0, 1, 2].map(|idx| (DVec3::Y * 5.0 * f64::from(idx), walks.1));
    let each: BTreeMap<(u32, u32), usize> = [0, 1, 2].map(|idx| ((idx, idx), 8)).into();
    assert_eq!(counted(&thrice, &thrice, 8), each);
    assert_eq!(counted(&thrice[..2], &thrice, 8), BTreeMap::new(), "two may be anybody");
    let others = |other: (DVec3, DVec3)| thrice.map(|(from, _)| (from + other.0, other.1));
    assert_eq!(counted(&thrice, &others(crosses), 8), BTreeMap::new());
    assert_eq!(counted(&thrice, &others(above), 8), BTreeMap::new());
    // Most differ by nothing, so that one who is 1.5 m from everybody is nobody whom the other saw.
    let aside = (DVec3::new(0.0, 21.5, 0.0), walks.1);
    let many: Vec<_> = (0..4).map(|idx| (DVec3::Y * 5.0 * f64::from(idx), walks.1)).collect();
    let alone = (DVec3::Y * 20.0, walks.1);
    let counts = counted(&[&many[..], &[alone]].concat(), &[&many[..], &[aside]].concat(), 8);
    assert_eq!(counts.into_keys().collect::<Vec<_>>(), [(0, 0), (1, 1), (2, 2), (3, 3)]);
}

#[test]
fn however_much_two_cameras_see_together_it_weighs_no_more_than_errors_that_stay() {
    let walks: Vec<_> = (0..300).map(|idx| (DVec3::X * 10.0 * f64::from(idx), DVec3::Y * 0.5)).collect();
    let weight = |n_paths: usize| {
        let steps = walked(&walks[..n_paths], 40);
        matched(&[steps.clone(), steps], 1.0).iter().map(|found| found.weight).sum::<f64>()
    };
    let [few, many] = [weight(10), weight(300)];
    assert!((few - 15.0).abs() < 1e-9 && (many - 150.0).abs() < 1e-9, "{few} {many}");
}

#[test]
fn what_was_not_followed_in_between_is_two_paths() {
    let seen = |secs: f64| FootSighting {
        at: Timestamp::from_nanos((secs * 1e9) as i64),
        track: 3,
        foot_in_texture: [0.25 + secs as f32 * 0.0625, 0.5],
        size_in_texture: [6553, 13_107],
    };
    let steps = steps(&[0.1, 0.9, 1.7, 6.1, 7.0].map(seen));
    let told: Vec<(i64, u32)> = steps.iter().map(|step| (step.instant, step.path)).collect();
    assert_eq!(told, [(1, 0), (2, 0), (3, 0), (13, 1), (14, 1)]);
    assert!((steps[1].foot_in_texture.x - 0.3125).abs() < 1e-6, "{:?}", steps[1]);
    assert!((steps[1].size_in_texture - DVec2::new(0.1, 0.2)).length() < 1e-4, "{:?}", steps[1]);
}

#[test]
fn errors_count_along_both_axes_of_the_ground_and_outliers_hardly() {
    let truly = around(DVec3::ZERO);
    let errors = FootErrors { wrong: 0.3, ..USUAL };
    let mut believed = truly.clone();
    believed[1] = off(&truly[1], [0.0, 0.0, 2.0], [0.0; 3]);
    let offsets = found(&truly, &believed, &FEW, errors);
    let error = error_m(&truly[1], &believed[1], offsets[1].as_ref(), DVec3::ZERO);
    assert!(error < 0.15, "{error} {offsets:?}");
    // Here cameras' errors move feet along the second axis alone.
    let own = walked(&[0.0, 5.0, 10.0].map(|y| (DVec3::Y * y, DVec3::X)), 20);
    let both = [own.clone(), own];
    let solution = solved(&both, &matched(&both, 1.0), &Solution::none(2));
    assert!(solution.error_m(0, &both[0][0]) > 0.001);
}

#[test]
fn few_feet_that_are_found_elsewhere_move_no_camera() {
    let walks: Vec<_> = (0..14).map(|idx| (DVec3::X * 10.0 * f64::from(idx), DVec3::X * 0.3)).collect();
    let elsewhere =
        |idx: usize, (from, by): (DVec3, DVec3)| (from + DVec3::Y * if idx < 4 { 0.9 } else { 0.0 }, by);
    let its: Vec<_> = walks.iter().enumerate().map(|(idx, walk)| elsewhere(idx, *walk)).collect();
    let both = [walked(&walks, 12), walked(&its, 12)];
    let matches = matched(&both, 1.0);
    assert_eq!(matches.len(), 14 * 12);
    let solution = solved(&both, &matches, &Solution::none(2));
    // Cameras' errors move feet along the second axis, by 10 m for each unit.
    let shifts = solution.twists.iter().map(|(moved, turned)| 10.0 * (moved + turned).element_sum());
    let apart_m = shifts.reduce(|a, b| a - b).unwrap().abs();
    assert!(apart_m < 0.1, "{apart_m}, and 0.26 if all counted alike");
}

#[test]
fn who_is_shorter_in_one_camera_has_hidden_legs_there_and_says_nothing() {
    let walks = [0, 1, 2].map(|idx| (DVec3::Y * 5.0 * f64::from(idx), DVec3::X * 0.5));
    let n_matched = |height_m: f64| {
        let mut its = walked(&walks, 8);
        its.iter_mut().for_each(|step| step.height_m = height_m);
        matched(&[walked(&walks, 8), its], 1.0).len()
    };
    assert_eq!([1.45, 1.55, 1.85, 1.95].map(n_matched), [0, 24, 24, 0]);
}

#[test]
fn of_cameras_that_see_more_than_is_compared_the_same_times_are_left_out() {
    let path = |every_ms: i64| -> Vec<Step> {
        let seen = |number: i64| FootSighting {
            at: Timestamp::from_nanos(number * every_ms * 1_000_000),
            track: (number / 100) as u32,
            foot_in_texture: [0.5; 2],
            size_in_texture: [6553, 13_107],
        };
        steps(&(0..2 * 3600 * 1000 / every_ms).map(seen).collect::<Vec<_>>())
    };
    // Nearly 14,400 half seconds, and of the second as many by half: it has breaks.
    let (mut whole, mut part) = (path(200), path(233));
    part.retain(|step| step.instant % 2 == 0);
    thin(vec![&mut whole, &mut part]);
    assert!(whole.len() <= MOST_STEPS && whole.len() > MOST_STEPS / 2, "{}", whole.len());
    let times: std::collections::BTreeSet<i64> = whole.iter().map(|step| step.instant / STRETCH).collect();
    assert!(part.iter().all(|step| times.contains(&(step.instant / STRETCH))) && part.len() > 2000);
}

#[test]
fn of_many_cameras_in_a_row_neighbours_are_compared() {
    let row: Vec<Vec<PlacedStep>> = (0..60)
        .map(|idx| {
            let walks = [0.0, 4.0, 8.0].map(|y| (DVec3::new(10.0 * f64::from(idx), y, 0.0), DVec3::X * 1.5));
            walked(&walks, 10)
        })
        .collect();
    // The last two see the same people.
    let last = matched(&[row[..58].to_vec(), vec![row[59].clone(), row[59].clone()]].concat(), 1.0);
    assert_eq!(
        last.iter()
            .map(|found| found.steps.map(|(camera, _)| camera))
            .collect::<std::collections::BTreeSet<_>>(),
        [[58, 59]].into()
    );
}
