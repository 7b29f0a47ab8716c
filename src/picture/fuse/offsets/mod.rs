//! Tells how far each camera's calibration disagrees with all others', by people whom several cameras saw at the same time.
//!
//! In: a scene, and where each of its cameras saw feet of late. Out: for each camera the small movement and turn with which it would see
//! people where the others do. A foot that two cameras saw is one place; all movements and turns are found together, so that the places
//! come nearest to each other, while each movement is as small as that allows (docs/decisions/0031-calibration-offsets.md). Changes
//! nothing by itself.
//!
//! The unknowns are small poses in the world, as bundle adjustment has them (`[TMHF00]` Triggs et al. 2000,
//! Bundle adjustment: a modern synthesis, sections 3.3 robust weights, 9.2 the inner constraints that a prior takes the place of).

mod matches;
mod solve;
#[cfg(test)]
mod tests;

use super::billboard::{FOOT_PX, FOOT_SHARE, ground_covariance};
use crate::scene::{Scene, SceneCamera};
use glam::{DMat2, DQuat, DVec2, DVec3};
use matches::{Match, matched};
use solve::{Solution, solved};
use std::collections::BTreeMap;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::geometry::{Camera, CameraError, Face, Pose, Surfaces};
use videofields_vision::observation::Observation;

/// Steps at which paths of different cameras are compared, nanoseconds.
const STEP_NANOS: i64 = 500_000_000;

/// Sightings of one thing further apart are not joined, nanoseconds.
const LONGEST_GAP_NANOS: i64 = 1_000_000_000;

/// Steps of a camera, and of all cameras together, that are compared, about; of more, whole stretches of time are left out.
const MOST_STEPS: usize = 6000;
const MOST_STEPS_OF_ALL: usize = 60_000;

/// Length of these stretches, in steps.
const STRETCH: i64 = 60;

/// Heights and widths of what may be one person on foot, metres: wider are several, or one with their shadow.
const HEIGHTS_M: [f64; 2] = [1.4, 2.15];
const MOST_WIDTH_M: f64 = 0.9;

/// Feet that are known worse than that say too little, standard deviation, metres.
const MOST_SD_M: f64 = 1.0;

/// Distances between two cameras' places of one foot that are looked at, metres: from round to round, as the cameras agree better.
const GATES_M: [f64; 5] = [1.6, 1.2, 1.0, 1.0, 1.0];

/// Least number of paths by which a camera's offset is known.
const LEAST_PATHS: usize = 12;

/// Movements and turns beyond these are none that people could tell: metres, and radians.
const MOST_MOVED_M: f64 = 3.0;
const MOST_TURNED_RAD: f64 = 0.3;

/// Offset that cameras show which agree, metres: feet are not found better than that (docs/decisions/0031-calibration-offsets.md).
const AGREEING_M: f64 = 0.12;

/// Share of its distance from others that is left at most where a correction is to be believed.
const LEFT: f64 = 0.8;

/// Share of an offset's error that is the camera's own: the rest is by how much all may be off together, which places nobody twice.
const OWN_ERROR: f64 = 0.5;

/// Place in a camera's picture where somebody or something stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FootSighting {
    /// Time by the camera's clock.
    pub at: Timestamp,
    /// Number of the thing, the same while the camera follows it.
    pub track: u32,
    /// Middle of its lower edge, from (0, 0) at the picture's top left corner to (1, 1).
    pub foot_in_texture: [f32; 2],
    /// Width and height, each in 65535ths of the picture's.
    pub size_in_texture: [u16; 2],
}

/// Returns where a camera sees things stand that move and touch nobody else, their feet within the picture.
pub fn foot_sightings(seen: &Observation) -> impl Iterator<Item = FootSighting> + '_ {
    let size = DVec2::new(seen.frame.image.width().into(), seen.frame.image.height().into());
    let is_alone = |track: &&videofields_vision::track::Track| {
        track.blob_idx.is_some() && !track.is_in_group && track.still_since.is_none()
    };
    seen.tracks.iter().filter(is_alone).filter_map(move |track| {
        let foot = DVec2::from_array(track.foot_in_image) / size;
        let is_within = foot.cmpge(DVec2::ZERO).all() && foot.cmplt(DVec2::ONE).all();
        let extent = DVec2::new(track.rect.width.into(), track.rect.height.into()) / size;
        is_within.then(|| FootSighting {
            at: seen.frame.timestamp,
            track: track.id as u32,
            foot_in_texture: foot.as_vec2().to_array(),
            size_in_texture: (extent * f64::from(u16::MAX)).to_array().map(|share| share.round() as u16),
        })
    })
}

/// Movement and turn with which a camera would see people where all others do, and how well that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationOffset {
    /// Movement of the camera, metres in the world.
    pub moved_m: DVec3,
    /// Turn of the camera about itself: axis in the world times angle, radians.
    pub turned_rad: DVec3,
    /// Distance between where it sees people and where it would, metres on the ground: median of its sightings.
    pub offset_m: f64,
    /// Standard error of that, metres: large where the cameras that disagree are too few to tell which of them is wrong.
    pub error_m: f64,
    /// Distance between where it sees people and where others do, metres: median, as it is, and with all movements and turns.
    pub apart_m: [f64; 2],
    /// Paths of people by which it is known.
    pub n_paths: usize,
}

impl CalibrationOffset {
    /// Tells that enough people were seen for it to be believed.
    #[must_use]
    pub const fn is_known(&self) -> bool {
        self.n_paths >= LEAST_PATHS
    }

    /// Tells that the camera is farther off than cameras that agree seem to be, so that people are placed by it as corrected.
    #[must_use]
    pub fn is_used(&self) -> bool {
        self.share() > 0.0
    }

    /// Returns the share of the movement and turn with which a camera is better than as it is, from 0 to 1 (`[JS61]` James, Stein 1961,
    /// Estimation with quadratic loss: the positive part).
    fn share(&self) -> f64 {
        let noise_m2 = AGREEING_M.powi(2) + (OWN_ERROR * self.error_m).powi(2);
        let is_nearer = self.apart_m[1] <= LEFT * self.apart_m[0];
        if self.is_known() && is_nearer { (1.0 - noise_m2 / self.offset_m.powi(2)).max(0.0) } else { 0.0 }
    }

    /// Returns the camera with the movement and turn.
    ///
    /// # Errors
    /// Fails as [`Camera::new`] does, by the position.
    pub fn corrected(&self, camera: &Camera) -> Result<Camera, CameraError> {
        corrected(camera, (self.moved_m, self.turned_rad))
    }
}

/// Movement and turn of a camera.
type Twist = (DVec3, DVec3);

fn corrected(camera: &Camera, (moved_m, turned_rad): Twist) -> Result<Camera, CameraError> {
    let pose = camera.pose();
    let pose = Pose {
        position_in_world: pose.position_in_world + moved_m,
        world_from_local: (DQuat::from_scaled_axis(turned_rad) * pose.world_from_local).normalize(),
    };
    Camera::new(camera.size_px(), camera.focal_px(), camera.center_px(), *camera.distortion(), pose)
}

/// Step of a path in a camera's picture.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Number of the instant.
    instant: i64,
    /// Number of the path among the camera's.
    path: u32,
    foot_in_texture: DVec2,
    size_in_texture: DVec2,
}

/// Step of a path in the world.
#[derive(Clone, Copy, Debug)]
struct PlacedStep {
    instant: i64,
    path: u32,
    /// Place among the camera's steps.
    step: usize,
    foot_in_world: DVec3,
    /// Metres, of somebody who stands there.
    height_m: f64,
    /// Square metres.
    covariance: DMat2,
    /// Level unit vector from the camera to it.
    away: DVec2,
    /// Metres by which it is seen nearer for each metre that it is seen lower.
    away_a_metre: f64,
    /// Metres on the ground for each metre along the world's axes that the camera moves, and each radian that it turns about them.
    by_twist: [DVec2; 6],
}

/// Returns how far each camera of `scene` disagrees with the others, in the scene's order: `seen` has what each saw, in the order of time.
/// None of a camera that saw nobody whom another saw too, or is too far off to tell.
///
/// **Cost** some rays for each half second in which a camera saw somebody, of which 6000 are looked at, and comparing them with other
/// cameras': 5 ms for a camera that saw people a thousand times.
#[must_use]
pub fn calibration_offsets(scene: &Scene, seen: &[&[FootSighting]]) -> Vec<Option<CalibrationOffset>> {
    let mut members: Vec<(&SceneCamera, Vec<Step>)> =
        scene.cameras.iter().zip(seen).map(|(member, seen)| (member, steps(seen))).collect();
    thin(members.iter_mut().map(|(_, steps)| steps).collect());
    let placed = |twists: &[Twist]| -> Vec<Vec<PlacedStep>> {
        let of = |((member, steps), twist): (&(&SceneCamera, Vec<Step>), &Twist)| {
            corrected(&member.camera, *twist)
                .map_or_else(|_| Vec::new(), |own| placed_steps(&own, &scene.surfaces, steps))
        };
        members.iter().zip(twists).map(of).collect()
    };
    let mut solution = Solution::none(members.len());
    let as_they_are = placed(&solution.twists);
    let mut now = as_they_are.clone();
    let mut matches: Vec<Match> = Vec::new();
    for gate_m in GATES_M {
        matches = matched(&now, gate_m);
        if matches.is_empty() {
            break;
        }
        solution = solved(&now, &matches, &solution);
        now = placed(&solution.twists);
    }
    let of = |camera: usize| offset_of(camera, (&as_they_are, &now), &matches, &solution);
    (0..members.len()).map(of).collect()
}

/// Returns a camera's offset; none where nobody's feet tell it.
fn offset_of(
    camera: usize,
    (before, after): (&[Vec<PlacedStep>], &[Vec<PlacedStep>]),
    matches: &[Match],
    solution: &Solution,
) -> Option<CalibrationOffset> {
    let own: Vec<&Match> = matches.iter().filter(|of| of.has(camera)).collect();
    let mut paths: Vec<u32> = own.iter().map(|of| of.path_of(camera)).collect();
    paths.sort_unstable();
    paths.dedup();
    let place = |of: &[Vec<PlacedStep>], (camera, step): (usize, usize)| {
        let found = of[camera].binary_search_by_key(&step, |of| of.step).ok()?;
        Some(of[camera][found])
    };
    let apart = |of: &[Vec<PlacedStep>]| {
        let distance = |found: &&Match| {
            let [a, b] = found.steps.map(|step| place(of, step));
            Some(a?.foot_in_world.distance(b?.foot_in_world))
        };
        median(own.iter().filter_map(distance).collect())
    };
    let moved = |found: &&Match| {
        let step = (camera, found.step_of(camera));
        Some(place(before, step)?.foot_in_world.distance(place(after, step)?.foot_in_world))
    };
    let error =
        |found: &&Match| Some(solution.error_m(camera, &place(after, (camera, found.step_of(camera)))?));
    let (moved_m, turned_rad) = solution.twists[camera];
    let offset_m = median(own.iter().filter_map(moved).collect())?;
    // Feet farther apart were not compared.
    let is_tellable =
        moved_m.length() <= MOST_MOVED_M && turned_rad.length() <= MOST_TURNED_RAD && offset_m <= GATES_M[0];
    if !is_tellable {
        return None;
    }
    Some(CalibrationOffset {
        moved_m,
        turned_rad,
        offset_m,
        error_m: median(own.iter().filter_map(error).collect())?,
        apart_m: [apart(before)?, apart(after)?],
        n_paths: paths.len(),
    })
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Returns the steps of paths, at instants that all cameras share, in the order of time.
fn steps(seen: &[FootSighting]) -> Vec<Step> {
    let mut tracks: BTreeMap<u32, Vec<&FootSighting>> = BTreeMap::new();
    for sighting in seen {
        tracks.entry(sighting.track).or_default().push(sighting);
    }
    let mut steps = Vec::new();
    let mut n_paths = 0;
    for sightings in tracks.into_values() {
        let is_one =
            |a: &&FootSighting, b: &&FootSighting| (1..=LONGEST_GAP_NANOS).contains(&b.at.nanos_since(a.at));
        for path in sightings.chunk_by(is_one) {
            steps.extend(path.windows(2).flat_map(|ends| between(n_paths, [ends[0], ends[1]])));
            n_paths += 1;
        }
    }
    steps.sort_by_key(|step| (step.instant, step.path));
    steps
}

/// Leaves out whole stretches of time, the same of all cameras, where they saw more than is compared.
fn thin(mut cameras: Vec<&mut Vec<Step>>) {
    let most = (MOST_STEPS_OF_ALL / cameras.len().max(1)).min(MOST_STEPS);
    let longest = cameras.iter().map(|steps| steps.len()).max().unwrap_or(0);
    let kept_of = longest.div_ceil(most.max(1)).max(1) as i64;
    let is_kept = |step: &Step| step.instant.div_euclid(STRETCH).rem_euclid(kept_of) == 0;
    cameras.iter_mut().for_each(|steps| steps.retain(is_kept));
}

/// Returns the steps between two sightings of one thing: after the first, and until the second.
fn between(path: u32, [from, to]: [&FootSighting; 2]) -> impl Iterator<Item = Step> {
    let number = |of: &FootSighting| of.at.as_nanos().div_euclid(STEP_NANOS);
    let span = to.at.nanos_since(from.at) as f64;
    let vector = |of: [f32; 2]| DVec2::new(f64::from(of[0]), f64::from(of[1]));
    let size = |of: [u16; 2]| DVec2::new(f64::from(of[0]), f64::from(of[1])) / f64::from(u16::MAX);
    (number(from) + 1..=number(to)).map(move |instant| {
        let share = (instant * STEP_NANOS - from.at.as_nanos()) as f64 / span;
        Step {
            instant,
            path,
            foot_in_texture: vector(from.foot_in_texture).lerp(vector(to.foot_in_texture), share),
            size_in_texture: size(from.size_in_texture).lerp(size(to.size_in_texture), share),
        }
    })
}

/// Returns steps with their places in the world: those that people may have made and that are known well enough.
fn placed_steps(camera: &Camera, surfaces: &Surfaces, steps: &[Step]) -> Vec<PlacedStep> {
    let size_px = DVec2::new(f64::from(camera.size_px().0), f64::from(camera.size_px().1));
    let eye = camera.pose().position_in_world;
    let of = |(idx, step): (usize, &Step)| {
        // On a wall's side nobody stands.
        let hit =
            surfaces.hit(&camera.ray(step.foot_in_texture)?, 0.0).filter(|hit| hit.face == Face::Top)?;
        let foot_in_world = hit.point_in_world;
        let seen_px =
            |above_m: f64| Some(camera.project(foot_in_world + DVec3::Z * above_m)?.texture * size_px);
        let across_m =
            (step.size_in_texture.x * size_px.x) * eye.distance(foot_in_world) / camera.focal_px().x;
        let height_m = step.size_in_texture.y * size_px.y / seen_px(1.0)?.distance(seen_px(0.0)?);
        let [least, most] = HEIGHTS_M;
        if across_m > MOST_WIDTH_M || !(least..=most).contains(&height_m) {
            return None;
        }
        let share = FOOT_SHARE * step.size_in_texture;
        let noise =
            DVec2::new((FOOT_PX.x / size_px.x).hypot(share.x), (FOOT_PX.y / size_px.y).hypot(share.y));
        let covariance = ground_covariance(camera, foot_in_world, step.foot_in_texture, noise)?;
        let ray = camera.ray(step.foot_in_texture)?.direction;
        let reach_m = eye.distance(foot_in_world);
        // The ray meets the level plane elsewhere by what its direction and origin change by, less that part along the ray that keeps
        // to the plane.
        let on_plane = |change: DVec3| (change - ray * (change.z / ray.z)).truncate();
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let moved = axes.map(on_plane);
        let turned = axes.map(|axis| on_plane(axis.cross(ray) * reach_m));
        let by_twist = [moved[0], moved[1], moved[2], turned[0], turned[1], turned[2]];
        let is_known = (covariance.x_axis.x + covariance.y_axis.y) < MOST_SD_M * MOST_SD_M
            && by_twist.iter().all(|of| of.is_finite());
        is_known.then(|| PlacedStep {
            instant: step.instant,
            path: step.path,
            step: idx,
            foot_in_world,
            height_m,
            covariance,
            away: ray.truncate().normalize_or_zero(),
            away_a_metre: ray.truncate().length() / -ray.z,
            by_twist,
        })
    };
    steps.iter().enumerate().filter_map(of).collect()
}

/// Returns `scene` with cameras moved and turned by what is known of their offsets; none where all agree as far as can be told.
#[must_use]
pub fn with_offsets(scene: &Scene, offsets: &[Option<CalibrationOffset>]) -> Option<Scene> {
    let mut corrected_scene = scene.clone();
    let mut is_another = false;
    for (member, offset) in corrected_scene
        .cameras
        .iter_mut()
        .zip(offsets)
        .filter_map(|(member, of)| Some((member, of.as_ref()?)))
    {
        let share = offset.share();
        let twist = (offset.moved_m * share, offset.turned_rad * share);
        if let Some(camera) = corrected(&member.camera, twist).ok().filter(|_| share > 0.0) {
            member.camera = Arc::new(camera);
            is_another = true;
        }
    }
    is_another.then_some(corrected_scene)
}
