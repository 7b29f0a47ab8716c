//! What the fused view's passes cost, as ratios to a pass that only fills the picture: all in one run, in turns.
//!
//! `cargo bench --bench fused_view [-- <turns>]` prints tables for docs/benchmarks/fused-view.md: ratios, then curves over
//! pixels, cameras and people. The device's own clock is read; a device without one is told so.

#![expect(clippy::print_stdout, reason = "a bench reports on standard output")]

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3, Vec3};
use std::sync::Arc;
use videofields_picture::fuse::{Billboard, CameraState, Entity, SceneState, Velocity};
use videofields_picture::plan::{
    self, Colors, EntityStyle, Filtering, Picture, Plan, Sampling, Settings, View, ViewLimits, Wishes,
};
use videofields_picture::scene::{Material, Scene, SceneCamera, Sky};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::RenderSettings;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, RgbImage, YuvImage};
use videofields_vision::geometry::{Camera, Distortion, GroundPolygon, OrientedBox, Pose, Surfaces};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{MOVING, PixelRect};

const SIZE_PX: (u32, u32) = (1280, 720);
/// Medians of fewer mean little.
const LEAST_TURNS: usize = 31;
const LIMITS: ViewLimits = ViewLimits { max_side_px: 16_384, max_pixels: 1 << 28 };

/// Pictures of one kind, with what was measured of them.
struct Case {
    name: String,
    state: SceneState,
    picture: Picture,
    plan: Plan,
    /// Milliseconds of the passes that count, a turn each.
    took_ms: Vec<f64>,
}

impl Case {
    fn new(name: &str, state: SceneState, picture: &Picture, settings: Settings) -> Self {
        let wishes =
            Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() };
        let plan = plan::make(&state, picture, wishes);
        Self { name: name.to_owned(), state, picture: picture.clone(), plan, took_ms: Vec::new() }
    }

    /// Draws it once; `passes` are those that count.
    fn turn(&mut self, renderer: &mut Renderer, passes: &[&str]) -> f64 {
        let rendered = renderer.render(&self.state, &self.picture, &self.plan).expect("a picture");
        let counted = rendered.timings.iter().filter(|time| passes.contains(&time.pass));
        counted.map(|time| time.gpu.as_secs_f64() * 1e3).sum()
    }
}

fn settings(entities: EntityStyle, filtering: Filtering, samples: u32) -> Settings {
    let sampling = Sampling { samples, supersampling: 1 };
    Settings { entities, filtering, sampling, ..Settings::default() }
}

/// Something to look at: a picture of many colours.
fn texture(width: u32, height: u32, seed: u32) -> Arc<YuvImage> {
    let code = |idx: u32| 64 + (idx.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 25) as u8;
    let rgb = RgbImage { width, height, data: (0..width * height * 3).map(code).collect() };
    Arc::new(YuvImage::from_rgb(&rgb, ColorMatrix::Bt709, ColorRange::Limited).expect("a picture"))
}

fn camera_state(idx: usize, camera: Camera, mask: Mask) -> CameraState {
    let (width, height) = camera.size_px();
    let id = CameraId::new(&format!("cam{idx}")).expect("an id");
    let labels = mask.data.iter().map(|value| if *value > 0 { MOVING } else { 0 }).collect();
    let image = texture(width, height, idx as u32);
    let observation = Observation {
        frame: Frame {
            camera: id.clone(),
            timestamp: Timestamp::from_nanos(0),
            number: 0,
            image: Arc::clone(&image),
        },
        labels: Arc::new(Mask { width, height, data: labels }),
        soft_mask: Arc::new(mask),
        background: image,
        blobs: Arc::from([]),
        tracks: Arc::from([]),
    };
    CameraState { id, camera: Arc::new(camera), observation, gain: Vec3::ONE }
}

fn scene_state(ground: GroundPolygon, boxes: Vec<OrientedBox>, cameras: Vec<CameraState>) -> SceneState {
    let camera =
        |state: &CameraState| SceneCamera { id: state.id.clone(), camera: Arc::clone(&state.camera) };
    let scene = Scene {
        id: "bench".to_owned(),
        name: "Bench".to_owned(),
        materials: vec![Material::plain([120, 110, 100]); 1 + boxes.len()],
        surfaces: Surfaces::of_ground_and_boxes(vec![ground], boxes),
        sky: Sky::Plain { color_srgb: [120, 160, 210] },
        effects: Default::default(),
        min_entity_size_m: 0.0,
        sequences: Vec::new(),
        cameras: cameras.iter().map(camera).collect(),
        view: None,
        document: Arc::from("{}"),
    };
    let instant = Timestamp::from_nanos(0);
    let (entities, points) = (Vec::new(), Vec::new());
    SceneState {
        scene: Arc::new(scene),
        instant,
        cameras,
        n_overlapping: 0,
        entities,
        points,
        hulls: Vec::new(),
        sequences: Vec::new(),
    }
}

fn square(half_m: f64) -> GroundPolygon {
    let corner = |x: f64, y: f64| DVec2::new(x, y) * half_m;
    GroundPolygon::new(vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], 0.0)
        .expect("a square")
}

const REGION_M: DVec2 = DVec2::new(32.0, 18.0);

/// Ground under cells of cameras that look straight down, each exactly on its cell, so that no place is seen by more than
/// `per_cell` of them; `beside` more look elsewhere. The view shows all cells and nothing else.
fn tiled(cells: [u32; 2], per_cell: u32, beside: u32) -> (SceneState, Picture) {
    let down = DQuat::from_mat3(&DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z));
    let n = DVec2::new(f64::from(cells[0]), f64::from(cells[1]));
    let cell_m = REGION_M / n;
    // A texel a pixel, as near as whole numbers allow.
    let width = (SIZE_PX.0 / cells[0]).max(16) / 2 * 2;
    let height = ((f64::from(width) * cell_m.y / cell_m.x).round() as u32 / 2 * 2).max(16);
    let size = DVec2::new(f64::from(width), f64::from(height));
    let mut cameras = Vec::new();
    for idx in 0..cells[0] * cells[1] * per_cell + beside {
        let (cell, layer) = (idx / per_cell, idx % per_cell);
        let at = DVec2::new(f64::from(cell % cells[0]), f64::from(cell / cells[0]));
        let middle = (at + 0.5) * cell_m - 0.5 * REGION_M;
        let height_m = 8.0 + 1.5 * f64::from(layer);
        let pose = Pose { position_in_world: middle.extend(height_m), world_from_local: down };
        let camera =
            Camera::new((width, height), size * height_m / cell_m, 0.5 * size, Distortion::None, pose);
        cameras.push(camera_state(idx as usize, camera.expect("a camera"), Mask::filled(width, height, 0)));
    }
    let pose = Pose { position_in_world: DVec3::Z * 30.0, world_from_local: down };
    let half = 0.495 * REGION_M / 30.0;
    let frustum = plan::Frustum {
        projection: plan::Projection::Perspective,
        x: [-half.x, half.x],
        y: [-half.y, half.y],
    };
    let view = View { pose, frustum, width_px: SIZE_PX.0, height_px: SIZE_PX.1 };
    (scene_state(square(60.0), Vec::new(), cameras), view.into())
}

/// A yard with six boxes seen by three cameras around it, and `n_people` in it.
fn yard(n_people: usize) -> (SceneState, Picture) {
    let boxes: Vec<OrientedBox> = (0..6)
        .map(|idx| {
            let (sin, cos) = (f64::from(idx) * 1.05).sin_cos();
            let center = DVec3::new(9.0 * cos, 9.0 * sin, 1.5);
            OrientedBox::new(center, DVec3::new(2.0, 3.0, 3.0), f64::from(idx)).expect("a box")
        })
        .collect();
    let feet: Vec<DVec3> = (0..n_people)
        // Beyond a block of twenty, in blocks between these.
        .map(|idx| (idx % 20, (idx / 20) as f64 * 0.24))
        .map(|(idx, aside)| {
            DVec3::new((idx % 5) as f64 * 2.0 - 4.0 + aside, (idx / 5) as f64 * 2.0 - 5.0 + aside, 0.0)
        })
        .collect();
    let (width, height) = SIZE_PX;
    let mut sources: Vec<Vec<Billboard>> = vec![Vec::new(); n_people];
    let mut cameras = Vec::new();
    for camera_idx in 0..3 {
        let (sin, cos) = (f64::from(camera_idx) * std::f64::consts::TAU / 3.0).sin_cos();
        let pose = Pose::looking_at(DVec3::new(25.0 * cos, 25.0 * sin, 9.0), DVec3::ZERO).expect("a view");
        let center = DVec2::new(f64::from(width), f64::from(height)) * 0.5;
        let camera =
            Camera::new(SIZE_PX, DVec2::splat(900.0), center, Distortion::None, pose).expect("a camera");
        let mut mask = Mask::filled(width, height, 0);
        for (foot, sources) in feet.iter().zip(&mut sources) {
            let Some(billboard) = person(&camera, camera_idx as usize, *foot) else { continue };
            let PixelRect { x, y, width: across, height: down } = billboard.rect;
            for row in y..y + down {
                let start = (row * width + x) as usize;
                mask.data[start..start + across as usize].fill(255);
            }
            sources.push(billboard);
        }
        cameras.push(camera_state(camera_idx as usize, camera, mask));
    }
    let mut state = scene_state(square(60.0), boxes, cameras);
    let entity = |(idx, (foot, sources)): (usize, (&DVec3, Vec<Billboard>))| Entity {
        id: idx as u64,
        foot_in_world: *foot,
        foot_covariance_m2: DMat2::IDENTITY * 0.01,
        velocity: Velocity::UNKNOWN,
        reach_m: None,
        height_m: 1.8,
        sources,
    };
    state.entities = feet.iter().zip(sources).enumerate().map(entity).collect();
    let view =
        View::new(DVec3::new(3.0, -20.0, 12.0), DVec3::ZERO, 0.7, width, height, &LIMITS).expect("a view");
    (state, view.into())
}

fn person(camera: &Camera, camera_idx: usize, foot: DVec3) -> Option<Billboard> {
    let away = (foot - camera.pose().position_in_world).truncate().normalize();
    let right_in_world = DVec3::new(away.y, -away.x, 0.0);
    let (width, height) = camera.size_px();
    let size = DVec2::new(f64::from(width), f64::from(height));
    let corner = |along: f64, up: f64| {
        let point = foot + right_in_world * along + DVec3::Z * up;
        camera.project(point).filter(|at| at.is_inside()).map(|at| at.texture * size)
    };
    let corners = [corner(-0.3, 0.0)?, corner(0.3, 0.0)?, corner(-0.3, 1.8)?, corner(0.3, 1.8)?];
    let low = corners.into_iter().fold(size, DVec2::min).floor();
    let high = corners.into_iter().fold(DVec2::ZERO, DVec2::max).ceil().min(size);
    let (x, y) = (low.x as u32, low.y as u32);
    let rect = PixelRect { x, y, width: high.x as u32 - x, height: high.y as u32 - y };
    Some(Billboard {
        camera_idx,
        rect,
        foot_in_world: foot,
        right_in_world,
        left_right_m: [-0.3, 0.3],
        height_m: 1.8,
        is_truncated: false,
    })
}

/// The least, median and greatest of the middle half.
fn quartiles(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|share| sorted[((sorted.len() - 1) as f64 * share).round() as usize])
}

/// Draws all cases in turns and prints them beside the first.
fn measure(renderer: &mut Renderer, title: &str, mut cases: Vec<Case>, passes: &[&str], n_turns: usize) {
    // What is new to the device, and pipelines, are not what is measured.
    for case in &mut cases {
        case.turn(renderer, passes);
    }
    for _ in 0..n_turns {
        for case in &mut cases {
            let took = case.turn(renderer, passes);
            case.took_ms.push(took);
        }
    }
    println!("\n{title}\n\n| what | ms (quartiles) | ratio (quartiles) |\n| --- | --- | --- |");
    let base = cases[0].took_ms.clone();
    for case in &cases {
        let [low, median, high] = quartiles(&case.took_ms);
        let ratios: Vec<f64> = case.took_ms.iter().zip(&base).map(|(took, base)| took / base).collect();
        let [ratio_low, ratio, ratio_high] = quartiles(&ratios);
        let name = &case.name;
        println!(
            "| {name} | {median:.2} ({low:.2} to {high:.2}) | {ratio:.2} ({ratio_low:.2} to {ratio_high:.2}) |"
        );
    }
}

/// What a picture costs over its pixels, over cameras of which three see any place, and over people.
fn curves(renderer: &mut Renderer, n_turns: usize) {
    let all = ["surface", "billboard", "points"];
    let of = |style| settings(style, Filtering::Levels, 4);
    let sized = |(width, height): (u32, u32)| {
        let (state, _) = yard(20);
        let (eye, target) = (DVec3::new(3.0, -20.0, 12.0), DVec3::ZERO);
        let view = View::new(eye, target, 0.7, width, height, &LIMITS).expect("a view");
        Case::new(&format!("{width} x {height}"), state, &view.into(), of(EntityStyle::Billboards))
    };
    let sizes = [(320, 180), (640, 360), (1280, 720), (1920, 1080), (2560, 1440), (3840, 2160)];
    let title = "Over pixels: the yard with three cameras and 20 people as billboards, 4 samples";
    measure(renderer, title, sizes.map(sized).into(), &all, n_turns);
    let cameras = |(cells, beside): ([u32; 2], u32)| {
        let (state, picture) = tiled(cells, 3, beside);
        let name = format!("{} cameras", state.cameras.len());
        Case::new(&name, state, &picture, of(EntityStyle::None))
    };
    let counts = [([1, 1], 0), ([2, 1], 0), ([2, 2], 0), ([4, 2], 0), ([8, 2], 0), ([11, 3], 1)];
    let title = "Over cameras: ground of which three see any place, 1280 x 720, 4 samples";
    measure(renderer, title, counts.map(cameras).into(), &all, n_turns);
    let people = |n_people: usize, style| {
        let (mut state, picture) = yard(n_people);
        if style == EntityStyle::Points {
            state.place_points(1);
        }
        let word = if style == EntityStyle::Points { "points" } else { "billboards" };
        Case::new(&format!("{n_people} people as {word}"), state, &picture, of(style))
    };
    for style in [EntityStyle::Billboards, EntityStyle::Points] {
        let cases = [0, 10, 20, 40, 80, 160].map(|n_people| people(n_people, style));
        let title = "Over people: the yard with three cameras, 1280 x 720, 4 samples";
        measure(renderer, title, cases.into(), &all, n_turns);
    }
}

fn main() {
    let n_turns = std::env::args().filter_map(|arg| arg.parse().ok()).next().unwrap_or(LEAST_TURNS);
    let gpu = match Gpu::new("") {
        Ok(gpu) => gpu,
        Err(error) => return println!("no adapter: {error}"),
    };
    println!("{}, {} x {}, {n_turns} turns", gpu.name(), SIZE_PX.0, SIZE_PX.1);
    let mut renderer = Renderer::new(gpu, &RenderSettings::default()).expect("a renderer");
    for (samples, filtering) in
        [(1, Filtering::Levels), (1, Filtering::Bilinear), (1, Filtering::Nearest), (4, Filtering::Levels)]
    {
        let settings = settings(EntityStyle::None, filtering, samples);
        let case = |name: &str, cells, per_cell, beside| {
            let (state, picture) = tiled(cells, per_cell, beside);
            Case::new(name, state, &picture, settings)
        };
        let cases = vec![
            case("fills the picture, no camera", [1, 1], 1, 0).without_cameras(),
            case("1 camera", [1, 1], 1, 0),
            case("3 cameras, all see every pixel", [1, 1], 3, 0),
            case("8 cameras, 3 see any pixel", [2, 1], 3, 2),
            case("100 cameras, 3 see any pixel", [11, 3], 3, 1),
        ];
        let title = format!("Surfaces, {samples} samples, {filtering:?}");
        measure(&mut renderer, &title, cases, &["surface"], n_turns);
    }
    let all = ["surface", "billboard", "points"];
    let case = |name: &str, n_people, style| {
        let (mut state, picture) = yard(n_people);
        if style == EntityStyle::Points {
            state.place_points(1);
        }
        Case::new(name, state, &picture, settings(style, Filtering::Levels, 1))
    };
    let cases = vec![
        case("3 cameras, 6 boxes, nobody", 20, EntityStyle::None),
        case("20 people as billboards", 20, EntityStyle::Billboards),
        case("20 people as points", 20, EntityStyle::Points),
    ];
    measure(&mut renderer, "People", cases, &all, n_turns);
    curves(&mut renderer, n_turns);
}

impl Case {
    /// The same without a camera: what it takes to fill the picture.
    fn without_cameras(mut self) -> Self {
        self.state.cameras.clear();
        let wishes = Wishes {
            settings: settings(EntityStyle::None, Filtering::Levels, self.plan.sampling.samples),
            see_through: false,
            colors: Colors::Raw,
            effects: Default::default(),
        };
        self.plan = plan::make(&self.state, &self.picture, wishes);
        self
    }
}
