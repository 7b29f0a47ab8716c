//! No camera paints what it cannot see: cameras of one flat colour each, held to the simulator's own rays, pixel by pixel.
//!
//! Everything but the cameras' pictures is black, so whatever a pixel has of a colour is that camera's share. A share is a
//! leak where the camera sees the surface nowhere in what the pixel shows, nor within one texel of its own picture of it.

use super::{LIMITS, keep, renderer, v, view};
use glam::{DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::{CameraState, SceneState};
use videofields_picture::plan::{self, Colors, EntityStyle, Picture, Preset, Settings, Wishes};
use videofields_picture::scene::{self, Material, Scene, SceneCamera, Sky};
use videofields_render::View;
use videofields_simulate::{SolidHit, SolidId, Solids, World};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, RgbImage, YuvImage};
use videofields_vision::geometry::{
    Camera, Cylinder, Distortion, ExtrudedFootprint, GroundPolygon, OrientedBox, Pose, Ray, Shape, SurfaceId,
    Surfaces,
};
use videofields_vision::observation::Observation;

/// Columns and rows of a camera's picture.
const CAMERA_SIZE: (u32, u32) = (1280, 720);
/// Columns and rows of the pictures drawn.
const VIEW_SIZE: (u32, u32) = (144, 100);
/// A channel of at most so much is rounding.
const MOST_ROUNDING: u8 = 2;
/// What is seen at less than 1.7 degrees has metres in a pixel: where a sample of it lies is rounding's.
const LEAST_VIEW_COSINE: f64 = 0.03;
/// BT.709, full range: nothing but red, green, blue; nothing at all.
const PURE: [[u8; 3]; 3] = [[50, 90, 255], [150, 20, 0], [10, 255, 110]];
const BLACK: [u8; 3] = [0, 128, 128];

/// A scene with what the simulator knows of its surfaces.
struct Place {
    state: SceneState,
    truth: Solids,
}

fn flat(size: (u32, u32), yuv: [u8; 3]) -> Arc<YuvImage> {
    Arc::new(YuvImage::filled(size.0, size.1, yuv, ColorMatrix::Bt709, ColorRange::Full))
}

impl Place {
    fn new(surfaces: Surfaces, cameras: Vec<Camera>) -> Self {
        let truth = Solids::new(surfaces.clone(), None);
        let cameras: Vec<CameraState> = cameras.into_iter().zip(0..).map(observed).collect();
        let member =
            |state: &CameraState| SceneCamera { id: state.id.clone(), camera: Arc::clone(&state.camera) };
        let scene = Scene {
            id: "place".to_owned(),
            name: "Place".to_owned(),
            materials: surfaces.shapes().iter().map(|_| Material::plain([0; 3])).collect(),
            surfaces,
            sky: Sky::Plain { color_srgb: [0; 3] },
            effects: Default::default(),
            sequences: vec![],
            min_entity_size_m: 0.0,
            cameras: cameras.iter().map(member).collect(),
            view: None,
            document: Arc::from("{}"),
        };
        let state = SceneState {
            scene: Arc::new(scene),
            instant: Timestamp::from_nanos(0),
            cameras,
            n_overlapping: 0,
            entities: Vec::new(),
            points: Vec::new(),
            hulls: Vec::new(),
            sequences: vec![],
        };
        Self { state, truth }
    }

    /// The still world of a world of the simulator's, with its cameras, as its scene document has it.
    fn of_world(id: &str) -> Self {
        let world = World::named(id).expect("a world");
        let text = world.scene_json(CAMERA_SIZE).expect("a document");
        let scene = scene::parse(id, &text, scene::no_imports).expect("a scene").scene;
        let cameras = scene.cameras.iter().map(|member| Camera::clone(&member.camera)).collect();
        Self::new(scene.surfaces, cameras)
    }

    /// The state with up to three of its cameras in pure colours, all others black.
    fn colored(&self, cameras: &[usize]) -> SceneState {
        let mut state = self.state.clone();
        for (idx, camera) in state.cameras.iter_mut().enumerate() {
            let place = cameras.iter().position(|colored| *colored == idx);
            let yuv = place.map_or(BLACK, |place| PURE[place]);
            camera.observation.background = flat(camera.camera.size_px(), yuv);
        }
        state
    }

    /// Whether a camera sees a surface where it was met, or within one texel of its picture beside that place, from the
    /// side that the viewer sees.
    fn sees(&self, camera: &Camera, met: &SolidHit) -> bool {
        let Some(projection) = camera.project(met.point) else { return false };
        let (width, height) = camera.size_px();
        let texel = DVec2::new(1.0 / f64::from(width), 1.0 / f64::from(height));
        let to_camera = (camera.pose().position_in_world - met.point).normalize();
        // What is round is drawn as a prism: its faces are turned by up to 1.4 degrees against the truth.
        let least_cosine = if is_round(met) { -0.025 } else { 0.0 };
        if to_camera.dot(met.normal) <= least_cosine {
            return false;
        }
        (0..25).any(|idx| {
            // The middle first.
            let idx = (idx + 12) % 25;
            let step = DVec2::new(f64::from(idx % 5) - 2.0, f64::from(idx / 5) - 2.0);
            let at = projection.texture + step * 0.5 * texel;
            let is_inside = at.cmpge(DVec2::ZERO).all() && at.cmple(DVec2::ONE).all();
            let ray = camera.ray(at).filter(|_| is_inside);
            ray.and_then(|ray| self.truth.hit(&ray)).is_some_and(|seen| face_of(&seen) == face_of(met))
        })
    }
}

fn is_round(hit: &SolidHit) -> bool {
    matches!(hit.solid, SolidId::Surface(SurfaceId::Cylinder(_))) && hit.normal.z.abs() < 0.5
}

/// What is one surface to the eye: a flat face, or all that is round of a cylinder.
fn face_of(hit: &SolidHit) -> (SolidId, [i64; 3]) {
    let normal = if is_round(hit) { DVec3::ZERO } else { hit.normal };
    (hit.solid, (normal * 1e3).round().to_array().map(|n| n as i64))
}

fn observed((camera, idx): (Camera, usize)) -> CameraState {
    let id = CameraId::new(&format!("cam{idx}")).expect("an id");
    let (width, height) = camera.size_px();
    let black = flat((width, height), BLACK);
    let nothing = Arc::new(Mask::filled(width, height, 0));
    let timestamp = Timestamp::from_nanos(0);
    let observation = Observation {
        frame: Frame { camera: id.clone(), timestamp, number: 0, image: Arc::clone(&black) },
        soft_mask: Arc::clone(&nothing),
        labels: nothing,
        background: black,
        blobs: Arc::from([]),
        tracks: Arc::from([]),
    };
    CameraState::new(id, Arc::new(camera), observation)
}

/// The rays of all that a pixel is made of, its middle first. Of one sample: places all over it. Of several: every
/// sixteenth of it and of the eight pixels around, since each sample is another edge: where a surface is grazed they lie
/// metres apart, and rounding moves them so. Of a coarse picture: the middles of the pixels that it lies between.
fn footprint(view: View, settings: &Settings, (x, y): (u32, u32)) -> Box<dyn Iterator<Item = Ray>> {
    let (width, height) = (f64::from(view.width_px), f64::from(view.height_px));
    let (x, y) = (f64::from(x), f64::from(y));
    let step_px = settings.resolution.step_px();
    if step_px > 1 {
        let coarse = view.coarse(step_px, 1);
        let along = |at: f64| ((at + 0.5) / f64::from(step_px) + 0.5).floor() + 0.5;
        let (x, y) = (along(x), along(y));
        let places = [(x, y), (x + 1.0, y), (x, y + 1.0), (x + 1.0, y + 1.0)];
        let (width, height) = (f64::from(coarse.width_px), f64::from(coarse.height_px));
        return Box::new(places.into_iter().map(move |(x, y)| coarse.ray(x / width, y / height)));
    }
    let (side, step) = if settings.sampling.samples > 1 { (49, 1.0 / 16.0) } else { (5, 0.25) };
    let along = move |idx: u32| 0.5 + step * (f64::from(idx) - f64::from(side / 2));
    let places = (0..side * side).map(move |idx| (idx + side * side / 2) % (side * side));
    let ray = move |idx: u32| view.ray((x + along(idx % side)) / width, (y + along(idx / side)) / height);
    Box::new(places.map(ray))
}

/// Pixels that a camera has painted, one for every camera with a share, and those of them that it cannot see.
#[derive(Debug, Default)]
struct Count {
    n_painted: usize,
    n_leaks: usize,
    /// Those of them that show something grazed: not judged.
    n_grazed: usize,
    /// The brightest leak: its channel's code, camera, pixel and where in the world that is.
    worst: Option<(u8, usize, (u32, u32), DVec3)>,
}

impl Count {
    fn add(&mut self, other: &Self) {
        self.n_painted += other.n_painted;
        self.n_leaks += other.n_leaks;
        self.n_grazed += other.n_grazed;
        let code = |count: &Self| count.worst.map_or(0, |(code, ..)| code);
        if code(other) > code(self) {
            self.worst = other.worst;
        }
    }
}

fn count(place: &Place, view: &View, settings: &Settings, image: &RgbImage, cameras: &[usize]) -> Count {
    let mut count = Count::default();
    for (y, x) in (0..image.height).flat_map(|y| (0..image.width).map(move |x| (y, x))) {
        let at = ((y * image.width + x) * 3) as usize;
        let codes = &image.data[at..at + 3];
        if codes.iter().all(|code| *code <= MOST_ROUNDING) {
            continue;
        }
        for (code, camera) in codes.iter().zip(cameras).filter(|(code, _)| **code > MOST_ROUNDING) {
            count.n_painted += 1;
            let shown = &place.state.cameras[*camera].camera;
            let mut met = footprint(*view, settings, (x, y)).filter_map(|ray| place.truth.hit(&ray));
            if met.any(|met| place.sees(shown, &met)) {
                continue;
            }
            let is_grazed = |ray: Ray| {
                let met = place.truth.hit(&ray);
                met.is_some_and(|met| met.normal.dot(ray.direction).abs() < LEAST_VIEW_COSINE)
            };
            if footprint(*view, settings, (x, y)).any(is_grazed) {
                count.n_grazed += 1;
                continue;
            }
            count.n_leaks += 1;
            if count.worst.is_none_or(|(worst, ..)| worst < *code) {
                let middle = footprint(*view, settings, (x, y)).next();
                let point = middle.and_then(|ray| place.truth.hit(&ray)).map_or(DVec3::NAN, |met| met.point);
                count.worst = Some((*code, *camera, (x, y), point));
            }
        }
    }
    count
}

/// Draws views of a place with each of its cameras in a colour of its own, and counts.
fn counted(name: &str, place: &Place, views: &[View], settings: &Settings) -> Option<Count> {
    let mut brush = renderer("", 1)?;
    let wishes =
        Wishes { settings: *settings, see_through: false, colors: Colors::Raw, effects: Default::default() };
    let all: Vec<usize> = (0..place.state.cameras.len()).collect();
    let mut sum = Count::default();
    for colored in all.chunks(3) {
        let state = place.colored(colored);
        for (idx, view) in views.iter().enumerate() {
            let picture = Picture::from(*view);
            let plan = plan::make(&state, &picture, wishes);
            let reason = plan.reasons.iter().find(|reason| reason.effect == "camera_depth");
            let reason = reason.expect("a reason");
            // Something may stand before what each of these cameras sees.
            let expected = if settings.depth_maps { plan.surface_cameras.as_slice() } else { &[] };
            assert_eq!(plan.depth_map_cameras, expected, "{name} {idx}");
            if !settings.depth_maps {
                assert_eq!((reason.is_on, reason.because.as_str()), (false, "left out by the settings"));
            }
            let image = brush.renderer.render(&state, &picture, &plan).expect("a picture").image;
            keep(&format!("leak_{name}_{idx}_{}", colored[0] / 3), &image);
            let found = count(place, view, settings, &image, colored);
            sum.add(&found);
        }
    }
    Some(sum)
}

fn camera(eye: DVec3, target: DVec3, distortion: Distortion, focal_px: f64) -> Camera {
    let pose = Pose::looking_at(eye, target).expect("a direction");
    let center = DVec2::new(f64::from(CAMERA_SIZE.0), f64::from(CAMERA_SIZE.1)) * 0.5;
    Camera::new(CAMERA_SIZE, DVec2::splat(focal_px), center, distortion, pose).expect("a camera")
}

/// A place of everything that hides: a thin wall, a kerb, a pillar and a post thinner than a texel's reach, boxes upon one
/// another, a roof on one leg, a tank, a house with a corner inwards; cameras high, grazing, bent, wide, straight above and
/// right behind the wall.
fn lane() -> Place {
    let corners = [[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]].map(DVec2::from);
    let ground = GroundPolygon::new(corners.to_vec(), 0.0).expect("ground");
    let solid = |center: DVec3, size: DVec3, yaw_rad: f64| {
        Shape::Box(OrientedBox::new(center, size, yaw_rad).expect("a box"))
    };
    let round = |base: DVec3, radius_m: f64, height_m: f64| {
        Shape::Cylinder(Cylinder::new(base, radius_m, height_m).expect("a cylinder"))
    };
    let outline =
        [[-16.0, -14.0], [-9.0, -14.0], [-9.0, -12.0], [-13.0, -12.0], [-13.0, -8.0], [-16.0, -8.0]];
    let house = ExtrudedFootprint::new(outline.map(DVec2::from).to_vec(), 0.0, 3.0).expect("a house");
    let surfaces = Surfaces::new(vec![
        Shape::Ground(ground),
        solid(v(0.0, 2.0, 1.5), v(10.0, 0.2, 3.0), 0.0),
        solid(v(-6.0, -6.0, 0.075), v(6.0, 0.12, 0.15), 0.3),
        solid(v(8.0, -5.0, 1.0), v(3.0, 2.0, 2.0), 0.5),
        solid(v(8.0, -5.0, 2.5), v(1.0, 1.0, 1.0), 0.2),
        solid(v(-3.0, -2.0, 1.5), v(0.12, 0.12, 3.0), 0.6),
        solid(v(8.0, 8.0, 3.1), v(6.0, 4.0, 0.2), 0.0),
        solid(v(8.0, 8.0, 1.5), v(0.3, 0.3, 3.0), 0.0),
        solid(v(3.0, -3.0, 0.02), v(2.0, 2.0, 0.04), 0.1),
        round(v(-9.0, 7.0, 0.0), 2.0, 4.0),
        round(v(3.0, -9.0, 0.0), 0.06, 5.0),
        Shape::Footprint(house),
    ]);
    let barrel = Distortion::BrownConrady { coefficients: [-0.2, 0.05, 0.001, -0.001, 0.0, 0.0, 0.0, 0.0] };
    let fisheye = Distortion::Fisheye { coefficients: [-0.02, 0.004, -0.001, 0.0] };
    let cameras = vec![
        camera(v(-14.0, -13.0, 7.0), v(0.0, 0.0, 0.5), Distortion::None, 1040.0),
        camera(v(14.0, -14.0, 6.0), v(0.0, 1.0, 0.5), Distortion::None, 1040.0),
        camera(v(0.0, -19.0, 1.0), v(0.0, 0.0, 0.6), Distortion::None, 1040.0),
        camera(v(2.0, 18.0, 8.0), v(0.0, 0.0, 0.5), barrel, 920.0),
        camera(v(-3.0, -1.0, 14.0), v(-3.0, -1.0, 0.0), Distortion::None, 1040.0),
        camera(v(4.0, 5.0, 6.0), v(4.0, 6.0, 0.0), fisheye, 360.0),
        camera(v(1.0, 3.2, 2.0), v(0.0, -8.0, 0.5), Distortion::None, 1040.0),
        camera(v(-19.0, 14.0, 1.8), v(0.0, 0.0, 0.0), Distortion::None, 1600.0),
    ];
    Place::new(surfaces, cameras)
}

fn look(eye: DVec3, target: DVec3, fov_y_rad: f64) -> View {
    view(eye, target, fov_y_rad, VIEW_SIZE.0, VIEW_SIZE.1)
}

fn lane_views() -> Vec<View> {
    let map = Picture::map(DVec3::ZERO, 40.0, 0.4, 36.0, VIEW_SIZE, &LIMITS).expect("a map");
    vec![
        look(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9),
        // Behind the wall, beside its edge, along the ground.
        look(v(0.0, 9.0, 2.0), v(0.0, 1.0, 0.5), 0.9),
        look(v(5.6, 3.5, 1.6), v(4.5, 1.5, 0.3), 0.9),
        look(v(-18.0, 4.0, 0.8), v(0.0, 2.0, 0.3), 0.7),
        // Straight down.
        look(v(0.0, 0.0, 30.0), v(0.0, 0.0, 0.0), 1.0),
        look(v(3.0, -8.5, 9.0), v(3.0, -8.5, 0.0), 0.7),
        // Near by: the kerb, the roof, the house's inner corner, the tank, the blocks.
        look(v(-6.0, -4.0, 1.2), v(-6.0, -6.3, 0.0), 0.9),
        look(v(14.0, 12.0, 5.0), v(8.0, 7.0, 1.0), 0.8),
        look(v(-9.0, -7.0, 5.0), v(-13.0, -12.0, 0.5), 0.8),
        look(v(-15.0, 10.0, 4.0), v(-9.0, 6.0, 1.0), 0.9),
        look(v(5.0, -1.0, 3.5), v(8.0, -5.5, 1.0), 0.8),
        map.parts[0].view,
    ]
}

fn world_views(id: &str) -> Vec<View> {
    match id {
        "plaza" => vec![
            look(v(-6.0, -19.0, 7.0), v(0.5, 1.0, 0.5), 0.8),
            // Behind the hall, beside the cafe, over the hedge, straight down.
            look(v(-9.0, 17.0, 4.0), v(-8.0, 9.0, 0.5), 0.9),
            look(v(6.5, -1.5, 2.0), v(8.5, 1.5, 0.5), 0.8),
            look(v(0.0, -26.0, 3.0), v(0.0, -20.0, 0.5), 0.9),
            look(v(0.0, 0.0, 45.0), v(0.0, 0.0, 0.0), 0.9),
        ],
        _ => vec![
            look(v(0.0, -17.0, 5.0), v(0.0, -1.0, 0.8), 0.8),
            // Behind the shed, over the eastern wall, beside it, straight down.
            look(v(-1.0, 7.5, 2.4), v(-4.0, 4.0, 0.5), 1.0),
            look(v(13.0, -3.0, 2.6), v(9.0, -3.0, 0.3), 0.9),
            look(v(9.0, -9.0, 0.8), v(10.1, 2.0, 0.4), 0.8),
            look(v(0.0, -3.0, 28.0), v(0.0, -3.0, 0.0), 0.9),
        ],
    }
}

fn exactly(preset: Preset, samples: u32) -> Settings {
    Settings { entities: EntityStyle::None, ..preset.settings(samples) }
}

/// Every preset, and the plainest form of the one that is drawn by default.
fn with_depth_maps(place: &str) -> Vec<(String, Settings)> {
    let [draft, balanced, exact] = Preset::ALL.map(|(name, preset)| (name, exactly(preset, 4)));
    let all = [draft, balanced, exact, ("plain", exactly(Preset::Balanced, 1))];
    all.map(|(name, settings)| (format!("{place}_{name}"), settings)).into()
}

/// Holds pictures of a place to it in each of the settings.
fn check(place: &Place, views: &[View], all: &[(String, Settings)], least_painted: usize) {
    let mut found = Vec::new();
    for (name, settings) in all {
        let Some(count) = counted(name, place, views, settings) else { return };
        assert!(count.n_painted > least_painted, "{name}: {count:?}");
        assert!(count.n_grazed <= count.n_painted / 10_000, "{name}: {count:?}");
        found.extend((count.n_leaks > 0).then(|| format!("{name}: {count:?}")));
    }
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn colors_of_cameras_are_told_apart() {
    for (channel, yuv) in PURE.into_iter().enumerate() {
        let color = flat((16, 16), yuv).to_rgb().data[..3].to_vec();
        let is_own = |(idx, code): (usize, &u8)| if idx == channel { *code >= 230 } else { *code == 0 };
        assert!(color.iter().enumerate().all(is_own), "{color:?}");
    }
    assert!(flat((16, 16), BLACK).to_rgb().data.iter().all(|code| *code == 0));
}

#[test]
fn no_camera_paints_what_it_cannot_see() {
    check(&lane(), &lane_views(), &with_depth_maps("lane"), 200_000);
}

#[test]
fn a_camera_alone_paints_nothing_that_it_cannot_see() {
    let place = lane();
    let settings = exactly(Preset::Balanced, 1);
    for (idx, camera) in place.state.cameras.iter().enumerate() {
        let alone = Place::new(place.state.scene.surfaces.clone(), vec![Camera::clone(&camera.camera)]);
        check(&alone, &lane_views(), &[(format!("lane_alone{idx}"), settings)], 200);
    }
}

#[test]
fn no_camera_paints_what_it_cannot_see_in_the_simulators_worlds() {
    for world in ["plaza", "yard"] {
        check(&Place::of_world(world), &world_views(world), &with_depth_maps(world), 20_000);
    }
}

/// The control: what the others find nothing of is there to be found. Settings without depth maps may leak, and say so.
#[test]
fn without_depth_maps_cameras_paint_what_they_cannot_see_and_the_plan_says_so() {
    let off = Settings { depth_maps: false, ..exactly(Preset::Balanced, 1) };
    let places = [
        ("lane", lane(), lane_views()),
        ("plaza", Place::of_world("plaza"), world_views("plaza")),
        ("yard", Place::of_world("yard"), world_views("yard")),
    ];
    for (name, place, views) in places {
        let Some(count) = counted(&format!("{name}_off"), &place, &views, &off) else { return };
        assert!(count.n_leaks > 50, "{name}: {count:?}");
    }
}
