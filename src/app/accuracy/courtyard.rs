//! A courtyard whose truth is exact, made by code: the fixed scene on which the daemon measures what its settings cost.
//!
//! Paving, two buildings, three cameras, three people of upright cylinders who walk in ellipses, and a sensor's noise. It needs no
//! simulated world and no file, and is the same on every machine, so tables of different machines can be compared.
//!
//! Light is Lambert's, from a sun and a sky; nothing casts a shadow. Textures are a hash of places in the world, so that every camera
//! and every view sees the same surface.

use super::SweepError;
use super::gate::Stopwatch;
use super::subject::{JudgedView, Scope, Subject, SubjectCamera, SubjectFigure, ViewTruth};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;
use videofields_picture::scene;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::config::{CameraSettings, RenderSettings, SourceSettings};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Mask, RgbImage, YuvImage, codes_of};
use videofields_vision::geometry::{Camera, Cylinder, Face, Hit, Ray, Shape, SurfaceId, Surfaces};
use videofields_vision::measures::dilated;

/// The scene's id.
const ID: &str = "courtyard";

/// After so many seconds everybody is where they were.
const PERIOD_SECS: f64 = 24.0;

/// The scene's document without its cameras.
const SCENE: &str = r##"{
  "version": 1,
  "name": "Courtyard",
  "sky": {"color_srgb": "#9cc4e6"},
  "ground": [{"polygon": [[-22, -17], [22, -17], [22, 17], [-22, 17]], "height_m": 0, "color_srgb": "#9c968a"}],
  "boxes": [
    {"id": "house", "center_m": [-9, 9.5, 3], "size_m": [14, 6, 6], "color_srgb": "#b08a64"},
    {"id": "kiosk", "center_m": [10.5, 3, 1.75], "size_m": [5, 4, 3.5], "yaw_deg": 18, "color_srgb": "#8fa3a0"}
  ],
  "view": {"eye_m": [-6, -19, 7], "target_m": [0.5, 1, 0.5], "fov_deg": 45}
}"##;

/// Cameras: id, place, what they look at, vertical field of view in degrees.
const CAMERAS: [(&str, DVec3, DVec3, f64); 3] = [
    ("west", DVec3::new(-15.5, -11.5, 6.4), DVec3::new(-0.6, -0.2, 0.3), 38.0),
    ("east", DVec3::new(16.0, -12.0, 6.0), DVec3::new(0.0, 0.2, 0.3), 38.0),
    ("north", DVec3::new(4.6, 13.6, 7.2), DVec3::new(0.4, -0.6, 0.0), 46.0),
];

/// Somebody who walks an ellipse once a period.
struct Walker {
    middle_m: DVec2,
    radii_m: DVec2,
    /// Where on it at the beginning, 0 to 1.
    start: f64,
    height_m: f64,
    /// Linear reflectance of legs, trunk and head.
    parts: [Vec3; 3],
}

impl Walker {
    /// Returns the place of their feet.
    fn foot(&self, time_secs: f64) -> DVec3 {
        let angle = TAU * (self.start + time_secs / PERIOD_SECS);
        (self.middle_m + self.radii_m * DVec2::from_angle(angle)).extend(0.0)
    }
}

const WALKERS: [Walker; 3] = [
    Walker {
        middle_m: DVec2::new(11.0, 3.2),
        radii_m: DVec2::new(6.0, 5.0),
        start: 0.1,
        height_m: 1.74,
        parts: [Vec3::new(0.03, 0.04, 0.08), Vec3::new(0.58, 0.03, 0.025), Vec3::new(0.55, 0.36, 0.24)],
    },
    Walker {
        middle_m: DVec2::new(-0.5, -2.6),
        radii_m: DVec2::new(5.0, 4.6),
        start: 0.3,
        height_m: 1.66,
        parts: [Vec3::new(0.05, 0.05, 0.06), Vec3::new(0.75, 0.45, 0.03), Vec3::new(0.25, 0.11, 0.06)],
    },
    Walker {
        middle_m: DVec2::new(-3.0, 2.6),
        radii_m: DVec2::new(7.0, 2.4),
        start: 0.62,
        height_m: 1.8,
        parts: [Vec3::new(0.35, 0.26, 0.15), Vec3::new(0.03, 0.11, 0.45), Vec3::new(0.72, 0.45, 0.31)],
    },
];

/// Shares of a person's height at which legs, trunk and head begin, and their radii in metres.
const PART_BEGINS: [f64; 4] = [0.0, 0.48, 0.84, 1.0];
const PART_RADII_M: [f64; 3] = [0.17, 0.23, 0.11];

/// Direction to the sun, its light, and the sky's light.
const TO_SUN: DVec3 = DVec3::new(-0.55, -0.41, 0.727);
const SUN: f32 = 0.85;
const SKY: f32 = 0.35;

/// Largest part that noise adds to or takes from a channel, 8-bit codes.
const NOISE_CODES: i32 = 2;

/// Pixels beside a person's that may hold a part of them.
const PERSON_MARGIN_PX: u32 = 2;

/// Makes the courtyard ready to be judged: casts what its cameras see, and what is true of it.
///
/// **Cost** about a microsecond a ray: a picture has `samples_per_side`^2 rays a pixel.
///
/// # Errors
/// When a size of `scope` is none that a camera can have, or the gate ends it.
pub fn courtyard(
    scope: &Scope,
    render: &RenderSettings,
    watch: &Stopwatch<'_>,
    progress: &dyn Fn(&str),
) -> Result<Subject, SweepError> {
    let all = cameras(scope.size_px)?;
    let text = document(&all)?;
    let mut scene = scene::parse(ID, &text, scene::no_imports)?.scene;
    let interval_secs = PERIOD_SECS / f64::from(scope.n_frames.max(2));
    let mut cameras = Vec::new();
    for (id, camera) in all.iter().take(scope.max_cameras) {
        progress(&format!("casting what camera {id} sees"));
        cameras.push(seen_by(id, camera, &scene.surfaces, scope, interval_secs, watch)?);
    }
    scene.cameras.retain(|member| cameras.iter().any(|camera| camera.id == member.id));
    let mut subject = Subject {
        id: ID.to_owned(),
        scene: Arc::new(scene),
        render: render.clone(),
        cameras,
        figures: (0..scope.n_frames.max(2))
            .map(|frame| figures_at(f64::from(frame) * interval_secs))
            .collect(),
        interval_secs,
        views: Vec::new(),
        n_world_cameras: all.len(),
    };
    let middle = WALKERS.iter().map(|walker| walker.middle_m).sum::<DVec2>() / WALKERS.len() as f64;
    for place in subject.places(middle.extend(0.0), scope) {
        progress(&format!("casting the truth of a view from {}", place.eye));
        let view = subject.judged_at(scope, place, watch, &mut |camera, time_secs| {
            Ok(judged(camera, &subject.scene.surfaces, &all, time_secs, scope.samples_per_side))
        })?;
        subject.views.push(view);
    }
    Ok(subject)
}

/// The cameras with their ids, calibrated for pictures of `size_px`.
fn cameras(size_px: (u32, u32)) -> Result<Vec<(CameraId, Camera)>, SweepError> {
    let camera = |(id, eye, target, fov_deg): (&str, DVec3, DVec3, f64)| {
        let camera = Camera::pinhole(eye, target, fov_deg.to_radians(), size_px).map_err(internal)?;
        Ok((CameraId::new(id).map_err(internal)?, camera))
    };
    CAMERAS.into_iter().map(camera).collect()
}

fn internal(error: impl std::fmt::Display) -> SweepError {
    SweepError::Subject { message: format!("the courtyard: {error}"), kind: ErrorKind::Internal }
}

/// Returns where everybody stands.
fn figures_at(time_secs: f64) -> Vec<SubjectFigure> {
    let of = |(idx, walker): (usize, &Walker)| SubjectFigure {
        instance: (idx + 1) as u8,
        ground_m: [walker.foot(time_secs).truncate(); 2],
        is_on_foot: true,
    };
    WALKERS.iter().enumerate().map(of).collect()
}

/// The scene's document with its cameras.
fn document(cameras: &[(CameraId, Camera)]) -> Result<String, SweepError> {
    let mut document: serde_json::Value = serde_json::from_str(SCENE).map_err(internal)?;
    document["cameras"] = cameras
        .iter()
        .map(|(id, camera)| {
            serde_json::json!({"id": id.as_str(), "calibration": CameraDocument::from_camera(camera)})
        })
        .collect();
    Ok(document.to_string())
}

/// Holds everybody at one instant.
struct People {
    /// Three cylinders each, legs first.
    surfaces: Surfaces,
}

impl People {
    fn at(time_secs: f64) -> Self {
        let parts = WALKERS.iter().flat_map(|walker| {
            let foot = walker.foot(time_secs);
            PART_RADII_M.into_iter().zip(PART_BEGINS.windows(2)).filter_map(move |(radius_m, ends)| {
                let base = foot + DVec3::Z * ends[0] * walker.height_m;
                Cylinder::new(base, radius_m, (ends[1] - ends[0]) * walker.height_m).ok()
            })
        });
        Self { surfaces: Surfaces::new(parts.map(Shape::Cylinder).collect()) }
    }
}

/// Holds what one ray shows.
struct Shown {
    light: Vec3,
    /// 0 for what stands still, else a walker's place in the list and one.
    instance: u8,
    distance_m: Option<f64>,
}

/// Returns what a ray shows: a person, or what stands behind.
fn cast(ray: &Ray, still: Option<&Hit>, people: &People) -> Shown {
    let person = people.surfaces.hit(ray, 0.0);
    if let Some(hit) = person.filter(|hit| still.is_none_or(|still| hit.distance_m < still.distance_m)) {
        let place = usize::from(hit.surface.kind_and_index().1);
        let reflectance = WALKERS[place / 3].parts[place % 3];
        let light = reflectance * lit(hit.normal_in_world);
        return Shown { light, instance: (place / 3 + 1) as u8, distance_m: Some(hit.distance_m) };
    }
    let light = still.map_or(Vec3::new(0.33, 0.55, 0.79), |hit| reflectance(hit) * lit(hit.normal_in_world));
    Shown { light, instance: 0, distance_m: still.map(|hit| hit.distance_m) }
}

/// Returns how bright a white surface is.
fn lit(normal: DVec3) -> f32 {
    SUN * TO_SUN.dot(normal).max(0.0) as f32 + SKY * (0.6 + 0.4 * normal.z as f32)
}

/// Linear reflectance of a surface where it was hit.
fn reflectance(hit: &Hit) -> Vec3 {
    let point = hit.point_in_world;
    let grain = 0.85 + 0.3 * (0.6 * noise(point * 1.7) + 0.4 * noise(point * 7.0)) as f32;
    let (kind, idx) = hit.surface.kind_and_index();
    let is_ground = matches!(hit.surface, SurfaceId::Ground(_));
    let base = match (kind, idx, hit.face) {
        _ if is_ground => {
            // Slabs, each of its own shade, with joints between them.
            let slab = point.truncate() / 1.25;
            let within = slab - slab.floor();
            let is_joint = within.min(DVec2::ONE - within).min_element() < 0.025;
            let shade = 0.8 + 0.4 * hashed(slab.floor().extend(0.0)) as f32;
            Vec3::new(0.36, 0.33, 0.28) * if is_joint { 0.5 } else { shade }
        }
        (_, _, Face::Side) => {
            // Storeys of windows.
            let along =
                if hit.normal_in_world.x.abs() > hit.normal_in_world.y.abs() { point.y } else { point.x };
            let place = DVec2::new(along / 2.1, point.z / 3.0);
            let within = place - place.floor();
            let is_window = (0.25..0.75).contains(&within.x) && (0.3..0.8).contains(&within.y);
            let wall = if idx == 0 { Vec3::new(0.55, 0.36, 0.2) } else { Vec3::new(0.3, 0.4, 0.38) };
            if is_window { Vec3::new(0.05, 0.08, 0.11) } else { wall }
        }
        _ => Vec3::new(0.28, 0.1, 0.06),
    };
    base * grain
}

/// A hash of a whole place, 0 to 1 (the finaliser of `MurmurHash3`).
fn hashed(cell: DVec3) -> f64 {
    let [x, y, z] = cell.to_array().map(|value| value as i64 as u64);
    let mut bits = x
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f))
        .wrapping_add(z.wrapping_mul(0x1656_67b1_9e37_79f9));
    for factor in [0xff51_afd7_ed55_8ccd_u64, 0xc4ce_b9fe_1a85_ec53] {
        bits = (bits ^ (bits >> 33)).wrapping_mul(factor);
    }
    ((bits ^ (bits >> 33)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Value noise between whole places, 0 to 1.
fn noise(place: DVec3) -> f64 {
    let (cell, part) = (place.floor(), place - place.floor());
    let part = part * part * (3.0 - 2.0 * part);
    let corner = |x: f64, y: f64, z: f64| hashed(cell + DVec3::new(x, y, z));
    let along = |y: f64, z: f64| {
        let (low, high) = (corner(0.0, y, z), corner(1.0, y, z));
        low + (high - low) * part.x
    };
    let across = |z: f64| along(0.0, z) + (along(1.0, z) - along(0.0, z)) * part.y;
    across(0.0) + (across(1.0) - across(0.0)) * part.z
}

/// Every sample's ray of a picture, and what it hits of the still world: cast once for all instants.
struct Plate<'a> {
    camera: &'a Camera,
    samples_per_side: u32,
    /// By sample: rows, columns, and within a pixel rows and columns again; `None` where a lens brings no light.
    still: Vec<Option<(Ray, Option<Hit>)>>,
    /// The same of pixels' centres.
    centers: Vec<Option<(Ray, Option<Hit>)>>,
}

impl<'a> Plate<'a> {
    fn new(camera: &'a Camera, surfaces: &Surfaces, samples_per_side: u32) -> Self {
        let samples_per_side = samples_per_side.max(1);
        let (width, height) = camera.size_px();
        let cast = |n_sides: u32| {
            let at = move |place: u32, of: u32| (f64::from(place) + 0.5) / f64::from(of * n_sides);
            let sample = move |column: u32, row: u32| {
                let ray = camera.ray(DVec2::new(at(column, width), at(row, height)))?;
                Some((ray, surfaces.hit(&ray, 0.0)))
            };
            (0..height * n_sides)
                .into_par_iter()
                .flat_map_iter(move |row| (0..width * n_sides).map(move |column| sample(column, row)))
                .collect::<Vec<_>>()
        };
        Self { camera, samples_per_side, still: cast(samples_per_side), centers: cast(1) }
    }

    /// Returns the picture and its truth at an instant.
    fn at(&self, time_secs: f64) -> ViewTruth {
        let people = People::at(time_secs);
        let (width, height) = self.camera.size_px();
        let n_sides = self.samples_per_side as usize;
        let n_columns = width as usize * n_sides;
        let mut rgb = RgbImage { width, height, data: vec![0; (width * height * 3) as usize] };
        rgb.data.par_chunks_mut(width as usize * 3).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let samples = (0..n_sides * n_sides)
                    .map(|idx| (y * n_sides + idx / n_sides) * n_columns + x * n_sides + idx % n_sides);
                let light: Vec3 = samples
                    .map(|idx| match &self.still[idx] {
                        Some((ray, still)) => cast(ray, still.as_ref(), &people).light,
                        None => Vec3::ZERO,
                    })
                    .sum();
                pixel.copy_from_slice(&codes_of(light / (n_sides * n_sides) as f32));
            }
        });
        let forward = self.camera.pose().forward_in_world();
        let shown = |center: &Option<(Ray, Option<Hit>)>| {
            let Some((ray, still)) = center else { return (0, 0.0) };
            let shown = cast(ray, still.as_ref(), &people);
            let along_axis = ray.direction.dot(forward);
            (shown.instance, shown.distance_m.map_or(0.0, |distance_m| (distance_m * along_axis) as f32))
        };
        let (instances, depth_m): (Vec<u8>, Vec<f32>) = self.centers.par_iter().map(shown).unzip();
        ViewTruth { rgb, instance: Mask { width, height, data: instances.into() }, depth_m }
    }

    /// Distance along the optical axis of what stands still, metres; 0 where there is nothing.
    fn still_depth_m(&self) -> Vec<f32> {
        let forward = self.camera.pose().forward_in_world();
        let depth = |center: &Option<(Ray, Option<Hit>)>| {
            let Some((ray, Some(hit))) = center else { return 0.0 };
            (hit.distance_m * ray.direction.dot(forward)) as f32
        };
        self.centers.iter().map(depth).collect()
    }
}

/// Returns all that a camera sees in one period.
fn seen_by(
    id: &CameraId,
    camera: &Camera,
    surfaces: &Surfaces,
    scope: &Scope,
    interval_secs: f64,
    watch: &Stopwatch<'_>,
) -> Result<SubjectCamera, SweepError> {
    watch.enter()?;
    let plate = Plate::new(camera, surfaces, scope.samples_per_side);
    let (mut frames, mut instances) = (Vec::new(), Vec::new());
    for number in 0..scope.n_frames.max(2) {
        watch.enter()?;
        let mut truth = plate.at(f64::from(number) * interval_secs);
        add_noise(&mut truth.rgb, number);
        let image = YuvImage::from_rgb(&truth.rgb, ColorMatrix::Bt601, ColorRange::Limited)
            .map_err(|error| SweepError::Picture(error.to_string()))?;
        frames.push(Arc::new(image));
        instances.push(truth.instance);
    }
    Ok(SubjectCamera {
        id: id.clone(),
        camera: camera.clone(),
        settings: CameraSettings::new(id.clone(), SourceSettings::default()),
        depth_m: plate.still_depth_m(),
        frames,
        instances,
    })
}

/// Adds what a sensor adds, of its own in every frame: the sum of two even draws.
fn add_noise(picture: &mut RgbImage, number: u32) {
    let row_bytes = picture.width as usize * 3;
    picture.data.par_chunks_mut(row_bytes).enumerate().for_each(|(y, row)| {
        for (x, value) in row.iter_mut().enumerate() {
            let draw = |turn: u32| hashed(DVec3::new(x as f64, y as f64, f64::from(2 * number + turn)));
            let codes = ((draw(0) + draw(1) - 1.0) * f64::from(NOISE_CODES)).round() as i32;
            *value = (i32::from(*value) + codes).clamp(0, 255) as u8;
        }
    });
}

/// The truth of a view at an instant, and which of it a camera sees and nobody walks at.
fn judged(
    view: &Camera,
    surfaces: &Surfaces,
    cameras: &[(CameraId, Camera)],
    time_secs: f64,
    samples_per_side: u32,
) -> JudgedView {
    let plate = Plate::new(view, surfaces, samples_per_side);
    let truth = plate.at(time_secs);
    let near_people = dilated(&truth.instance, PERSON_MARGIN_PX);
    let is_seen = |hit: &Hit| {
        cameras.iter().any(|(_, camera)| {
            let eye = camera.pose().position_in_world;
            (eye - hit.point_in_world).dot(hit.normal_in_world) > 0.0
                && camera.project(hit.point_in_world).is_some_and(|place| place.is_inside())
                && !surfaces.is_hidden(eye, hit.point_in_world)
        })
    };
    let still: Vec<u8> = plate
        .centers
        .par_iter()
        .zip(near_people.data.par_iter())
        .map(|(center, near)| {
            let hit = center.as_ref().and_then(|(_, hit)| hit.as_ref());
            if *near == 0 && hit.is_some_and(is_seen) { 255 } else { 0 }
        })
        .collect();
    let (width, height) = view.size_px();
    JudgedView { truth, still: Mask { width, height, data: still.into() } }
}

#[cfg(test)]
mod tests {
    use super::super::gate::OpenGate;
    use super::*;
    use videofields_vision::clock::SystemClock;

    const SCOPE: Scope =
        Scope { size_px: (160, 90), n_frames: 4, view_size_px: (96, 54), n_views: 1, ..Scope::DAEMON };

    fn ready() -> Subject {
        let clock = SystemClock::new();
        let watch = Stopwatch::new(&clock, &OpenGate);
        courtyard(&SCOPE, &RenderSettings::default(), &watch, &|_step| {}).unwrap()
    }

    #[test]
    fn it_is_the_same_every_time_it_is_made() {
        let (first, second) = (ready(), ready());
        assert_eq!(first.cameras.len(), 3);
        for (a, b) in first.cameras.iter().zip(&second.cameras) {
            assert_eq!(a.frames.len(), 4);
            assert!(a.frames.iter().zip(&b.frames).all(|(a, b)| a.to_rgb() == b.to_rgb()));
        }
    }

    #[test]
    fn every_camera_sees_people_who_move_and_a_ground_at_its_distance() {
        let subject = ready();
        for camera in &subject.cameras {
            let counts = camera.instances.iter().map(|mask| mask.data.iter().filter(|of| **of > 0).count());
            assert!(counts.min().unwrap() > 20, "camera {}", camera.id);
            assert_ne!(camera.instances[0], camera.instances[1], "camera {}", camera.id);
            // The picture's middle shows the ground, two metres or less before or behind what the camera looks at.
            let (width, height) = camera.size_px();
            let texture = DVec2::new(0.5 + 0.5 / f64::from(width), 0.5 + 0.5 / f64::from(height));
            let ray = camera.camera.ray(texture).unwrap();
            let depth_m = f64::from(camera.depth_m[(height / 2 * width + width / 2) as usize]);
            let point = ray.at(depth_m / ray.direction.dot(camera.camera.pose().forward_in_world()));
            assert!(point.z.abs() < 1e-3, "camera {}: {point}", camera.id);
        }
    }

    #[test]
    fn the_truth_of_a_view_is_where_its_pictures_say() {
        let subject = ready();
        let view = &subject.views[0];
        assert_eq!(subject.scene.view.unwrap().eye, view.camera.pose().position_in_world);
        let (_, judged) = &view.frames[0];
        let n_still = judged.still.data.iter().filter(|value| **value > 0).count();
        assert!(n_still > judged.still.data.len() / 3, "{n_still} pixels are seen by a camera");
        let is_apart = judged.still.data.iter().zip(judged.truth.instance.data.iter());
        assert!(is_apart.clone().all(|(still, instance)| *still == 0 || *instance == 0));
        assert!(judged.truth.instance.data.iter().any(|of| *of > 0));
    }

    #[test]
    fn noise_is_even_and_small() {
        let mut picture = RgbImage { width: 64, height: 64, data: vec![100; 64 * 64 * 3] };
        add_noise(&mut picture, 3);
        let sum: i64 = picture.data.iter().map(|value| i64::from(*value) - 100).sum();
        assert!(sum.abs() < 64 * 64 / 4, "mean {}", sum as f64 / (64.0 * 64.0 * 3.0));
        assert!(picture.data.iter().all(|value| value.abs_diff(100) <= NOISE_CODES as u8));
        assert!(picture.data.iter().any(|value| *value != 100));
    }
}
