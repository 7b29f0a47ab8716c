//! What a picture costs once its cameras' pictures and depth maps are on the device.

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use std::hint::black_box;
use std::sync::Arc;
use videofields_picture::fuse::{CameraState, Exposure, Overlap, SceneState};
use videofields_picture::plan::{
    self, Colors, EntityStyle, FieldsForm, Picture, Sampling, Settings, View, ViewLimits, Wishes,
};
use videofields_picture::scene::{Material, Scene, SceneCamera, Sky};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::RenderSettings;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage};
use videofields_vision::geometry::{Camera, Distortion, GroundPolygon, OrientedBox, Pose, Surfaces};
use videofields_vision::observation::Observation;

const WIDTH: u32 = 1280;
const HEIGHT: u32 = 720;

fn picture() -> Arc<YuvImage> {
    Arc::new(YuvImage::filled(WIDTH, HEIGHT, [120, 110, 140], ColorMatrix::Bt709, ColorRange::Limited))
}

/// A square with six boxes, seen by `n_cameras` around it.
fn state(n_cameras: u32) -> SceneState {
    let corner = |x: f64, y: f64| DVec2::new(x, y) * 60.0;
    let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    let ground = GroundPolygon::new(corners, 0.0).expect("a square");
    let boxes: Vec<OrientedBox> = (0..6)
        .map(|idx| {
            let (sin, cos) = (f64::from(idx) * 1.05).sin_cos();
            let center = DVec3::new(9.0 * cos, 9.0 * sin, 1.5);
            OrientedBox::new(center, DVec3::new(2.0, 3.0, 3.0), f64::from(idx)).expect("a box")
        })
        .collect();
    let cameras: Vec<CameraState> = (0..n_cameras)
        .map(|idx| {
            let (sin, cos) = (f64::from(idx) * std::f64::consts::TAU / f64::from(n_cameras)).sin_cos();
            let pose =
                Pose::looking_at(DVec3::new(25.0 * cos, 25.0 * sin, 9.0), DVec3::ZERO).expect("a view");
            let center = DVec2::new(f64::from(WIDTH), f64::from(HEIGHT)) * 0.5;
            let camera = Camera::new((WIDTH, HEIGHT), DVec2::splat(900.0), center, Distortion::None, pose);
            let id = CameraId::new(&format!("cam{idx}")).expect("an id");
            let observation = Observation {
                frame: Frame {
                    camera: id.clone(),
                    timestamp: Timestamp::from_nanos(0),
                    number: 0,
                    image: picture(),
                },
                soft_mask: Arc::new(Mask::filled(WIDTH, HEIGHT, 0)),
                labels: Arc::new(Mask::filled(WIDTH, HEIGHT, 0)),
                background: picture(),
                blobs: Arc::from([]),
                tracks: Arc::from([]),
            };
            let camera = Arc::new(camera.expect("a camera"));
            CameraState::new(id, camera, observation)
        })
        .collect();
    let scene = Scene {
        id: "bench".to_owned(),
        name: "Bench".to_owned(),
        materials: std::iter::once(Material::plain([110, 110, 100]))
            .chain(boxes.iter().map(|_| Material::plain([170, 150, 130])))
            .collect(),
        surfaces: Surfaces::of_ground_and_boxes(vec![ground], boxes),
        sky: Sky::Plain { color_srgb: [120, 160, 210] },
        effects: Default::default(),
        min_entity_size_m: 0.0,
        sequences: Vec::new(),
        cameras: cameras
            .iter()
            .map(|state| SceneCamera { id: state.id.clone(), camera: Arc::clone(&state.camera) })
            .collect(),
        view: None,
        document: Arc::from("{}"),
    };
    SceneState {
        scene: Arc::new(scene),
        instant: Timestamp::from_nanos(0),
        cameras,
        n_overlapping: 0,
        entities: Vec::new(),
        points: Vec::new(),
        hulls: Vec::new(),
        sequences: Vec::new(),
    }
}

fn view(width: u32, height: u32) -> Picture {
    let limits = ViewLimits { max_side_px: 16_384, max_pixels: 1 << 28 };
    // Ground fills the picture: the dearest case.
    View::new(DVec3::new(3.0, -20.0, 12.0), DVec3::ZERO, 0.7, width, height, &limits).expect("a view").into()
}

fn render(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("render");
    group.sample_size(20);
    let wishes = |samples| Wishes {
        settings: Settings {
            entities: EntityStyle::None,
            sampling: Sampling { samples, supersampling: 1 },
            ..Settings::default()
        },
        see_through: false,
        colors: Colors::Even,
        effects: Default::default(),
    };
    for samples in [1, 4] {
        let Ok(gpu) = Gpu::new("") else { return };
        let mut renderer = Renderer::new(gpu, &RenderSettings::default()).expect("a renderer");
        for n_cameras in [0, 1, 3, 8] {
            let state = state(n_cameras);
            for (width, height) in [(640, 360), (WIDTH, HEIGHT)] {
                let view = view(width, height);
                let plan = plan::make(&state, &view, wishes(samples));
                let name = format!("{width}x{height}/{n_cameras}_cameras/{samples}_samples");
                group.bench_function(name, |bencher| {
                    bencher.iter(|| renderer.render(&state, &view, black_box(&plan)).expect("a picture"));
                });
            }
        }
    }
    // A new background for each of three cameras, every picture: the price of uploads and smaller levels.
    let Ok(gpu) = Gpu::new("") else { return };
    let mut renderer = Renderer::new(gpu, &RenderSettings::default()).expect("a renderer");
    let view = view(WIDTH, HEIGHT);
    let mut state = state(3);
    let plan = plan::make(&state, &view, wishes(4));
    group.bench_function("1280x720/3_cameras/4_samples/new_backgrounds", |bencher| {
        bencher.iter(|| {
            for camera in &mut state.cameras {
                camera.observation.background = picture();
            }
            renderer.render(&state, &view, &plan).expect("a picture")
        });
    });
    // What stands still by texture fields: once settled, the same weights are found again for every picture.
    for n_cameras in [3, 8] {
        let state = self::state(n_cameras);
        for (word, fields) in FieldsForm::ALL {
            let mut wishes = wishes(1);
            wishes.settings.fields = fields;
            let plan = plan::make(&state, &view, wishes);
            renderer.make_ready(&state, &plan).expect("a scene");
            group.bench_function(format!("1280x720/{n_cameras}_cameras/fields_{word}"), |bencher| {
                bencher.iter(|| renderer.render(&state, &view, &plan).expect("a picture"));
            });
        }
    }
    group.bench_function("plan", |bencher| {
        bencher.iter(|| plan::make(&state, black_box(&view), wishes(4)));
    });
    group.finish();
}

/// Cameras' gains: places in common once a scene, a look at them once a second, and any other picture.
fn even(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("even");
    group.sample_size(10);
    for n_cameras in [4, 100] {
        let mut state = state(n_cameras);
        group.bench_function(format!("places/{n_cameras}_cameras"), |bencher| {
            bencher.iter(|| Overlap::of(black_box(&state.scene)));
        });
        let mut exposure = Exposure::new(Arc::new(Overlap::of(&state.scene)));
        for (what, step_millis) in [("compared", 1000), ("between", 0)] {
            group.bench_function(format!("{what}/{n_cameras}_cameras"), |bencher| {
                bencher.iter(|| {
                    state.instant = state.instant.saturating_add_nanos(step_millis * 1_000_000);
                    exposure.even(&mut state);
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, render, even);
criterion_main!(benches);
