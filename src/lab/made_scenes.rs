//! Scenes made by code, without simulator and files: what benchmarks and reports of devices draw.

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::{Billboard, CameraState, Entity, SceneState, Velocity};
use videofields_picture::plan::{
    self, EntityStyle, Filtering, Picture, Sampling, Settings, View, ViewLimits,
};
use videofields_picture::scene::{Material, Scene, SceneCamera, Sky};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, RgbImage, YuvImage};
use videofields_vision::geometry::{Camera, Distortion, GroundPolygon, OrientedBox, Pose, Surfaces};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{MOVING, PixelRect};

/// Columns and rows of cameras' pictures, and of pictures where nothing else is said.
pub const SIZE_PX: (u32, u32) = (1280, 720);

/// Larger views are drawn than a daemon allows.
pub const LIMITS: ViewLimits = ViewLimits { max_side_px: 16_384, max_pixels: 1 << 28 };

/// Returns the default settings but for these.
#[must_use]
pub fn settings(entities: EntityStyle, filtering: Filtering, samples: u32) -> Settings {
    let sampling = Sampling { samples, supersampling: 1 };
    Settings { entities, filtering, sampling, ..Settings::default() }
}

/// Returns a picture of many colours; another `seed` is another picture.
///
/// # Panics
/// When a size is odd or 0.
#[must_use]
pub fn texture(width: u32, height: u32, seed: u32) -> Arc<YuvImage> {
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
    CameraState::new(id, Arc::new(camera), observation)
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

/// Returns ground under cells of cameras that look straight down, each exactly on its cell, so that no place is seen by more than
/// `per_cell` of them; `beside` more look elsewhere. The view shows all cells and nothing else.
///
/// # Panics
/// When there is no cell.
#[must_use]
pub fn tiled(cells: [u32; 2], per_cell: u32, beside: u32) -> (SceneState, Picture) {
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

/// Returns a yard with six boxes seen by three cameras around it, and `n_people` in it, and a view of `size_px` columns and rows.
///
/// # Panics
/// When a side is 0, or beyond [`LIMITS`].
#[must_use]
pub fn yard(n_people: usize, size_px: (u32, u32)) -> (SceneState, Picture) {
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
    let (eye, target) = (DVec3::new(3.0, -20.0, 12.0), DVec3::ZERO);
    let view = View::new(eye, target, 0.7, size_px.0, size_px.1, &LIMITS).expect("a view");
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
        owner: 0,
        shown_share: 1.0,
    })
}

/// Returns the least, median and greatest of the middle half.
///
/// # Panics
/// When there are no values.
#[must_use]
pub fn quartiles(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [0.25, 0.5, 0.75].map(|share| sorted[((sorted.len() - 1) as f64 * share).round() as usize])
}
