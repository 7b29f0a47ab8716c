//! Small worlds with exactly known pictures: ground and boxes painted by a formula, seen by cameras ray by ray.

use glam::{DMat2, DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::{Billboard, CameraState, Entity, SceneState, Velocity};
use videofields_picture::scene::{Material, Scene, SceneCamera, Sky};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{
    CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage, YuvLayout, srgb_from_linear,
};
use videofields_vision::geometry::{
    Camera, Distortion, GroundPolygon, OrientedBox, Pose, Ray, Shape, SurfaceId, Surfaces,
};
use videofields_vision::observation::Observation;
use videofields_vision::segment::PixelRect;

pub(crate) const SKY: [u8; 3] = [120, 160, 210];
const CAMERA_SIZE: (u32, u32) = (320, 180);

/// A world under construction.
#[derive(Clone)]
pub(crate) struct Stage {
    /// Added to every coordinate: (5e5, 5e6) puts the world at map coordinates.
    pub offset: DVec3,
    pub half_ground_m: f64,
    pub boxes: Vec<OrientedBox>,
    /// What else stands, in the world.
    pub shapes: Vec<Shape>,
    pub cameras: Vec<(Arc<Camera>, [f64; 3])>,
    /// A person of 0.6 x 1.8 m: where the feet are.
    pub person: Option<DVec3>,
}

impl Stage {
    pub(crate) fn new() -> Self {
        Self {
            offset: DVec3::ZERO,
            half_ground_m: 20.0,
            boxes: Vec::new(),
            shapes: Vec::new(),
            cameras: Vec::new(),
            person: None,
        }
    }

    pub(crate) fn at(offset: DVec3) -> Self {
        Self { offset, ..Self::new() }
    }

    pub(crate) fn with_box(mut self, center: DVec3, size: DVec3, yaw_rad: f64) -> Self {
        self.boxes.push(OrientedBox::new(center + self.offset, size, yaw_rad).expect("a box"));
        self
    }

    pub(crate) fn with_shape(mut self, shape: Shape) -> Self {
        self.shapes.push(shape);
        self
    }

    /// A camera whose picture is tinted, so that weights show in the colour.
    pub(crate) fn with_camera(self, eye: DVec3, target: DVec3, tint: [f64; 3]) -> Self {
        self.with_lens(eye, target, tint, Distortion::None, 260.0)
    }

    pub(crate) fn with_lens(
        mut self,
        eye: DVec3,
        target: DVec3,
        tint: [f64; 3],
        distortion: Distortion,
        focal_px: f64,
    ) -> Self {
        let pose = Pose::looking_at(eye + self.offset, target + self.offset).expect("a direction");
        let center = DVec2::new(f64::from(CAMERA_SIZE.0), f64::from(CAMERA_SIZE.1)) * 0.5;
        let camera =
            Camera::new(CAMERA_SIZE, DVec2::splat(focal_px), center, distortion, pose).expect("a camera");
        self.cameras.push((Arc::new(camera), tint));
        self
    }

    pub(crate) fn with_person(mut self, foot: DVec3) -> Self {
        self.person = Some(foot + self.offset);
        self
    }

    pub(crate) fn surfaces(&self) -> Surfaces {
        let h = self.half_ground_m;
        let corner = |x: f64, y: f64| DVec2::new(x, y) + self.offset.truncate();
        let corners = vec![corner(-h, -h), corner(h, -h), corner(h, h), corner(-h, h)];
        let ground = vec![GroundPolygon::new(corners, self.offset.z).expect("ground")];
        let ground = ground.into_iter().map(Shape::Ground);
        let boxes = self.boxes.iter().copied().map(Shape::Box);
        Surfaces::new(ground.chain(boxes).chain(self.shapes.iter().cloned()).collect())
    }

    /// Linear light of a surface. Smooth, so that what is compared is geometry and weights, not resampling.
    fn paint(&self, point: DVec3, surface: SurfaceId) -> [f64; 3] {
        let p = point - self.offset;
        let wave = |along: f64, length: f64| 0.5 + 0.5 * (along * std::f64::consts::TAU / length).sin();
        match surface {
            SurfaceId::Ground(_) | SurfaceId::HeightField(_) => {
                let squares = wave(p.x, 4.0) * wave(p.y, 4.0);
                [0.15 + 0.6 * squares, 0.2 + 0.5 * wave(p.x + p.y, 9.0), 0.25 + 0.4 * squares]
            }
            _ => {
                [0.6 + 0.2 * wave(p.z, 1.5), 0.2 + 0.15 * wave(p.x - p.y, 2.0), 0.12 + 0.05 * wave(p.z, 3.0)]
            }
        }
    }

    /// The state at an instant, with pictures seen ray by ray.
    pub(crate) fn state(&self) -> SceneState {
        let surfaces = self.surfaces();
        let cameras: Vec<CameraState> =
            (0..self.cameras.len()).map(|idx| self.observe(&surfaces, idx)).collect();
        let members = cameras
            .iter()
            .map(|state| SceneCamera { id: state.id.clone(), camera: Arc::clone(&state.camera) })
            .collect();
        let scene = Scene {
            id: "stage".to_owned(),
            name: "Stage".to_owned(),
            materials: surfaces
                .shapes()
                .iter()
                .map(|shape| match shape {
                    Shape::Ground(_) | Shape::HeightField(_) => Material::plain([110, 108, 100]),
                    _ => Material::plain([170, 150, 130]),
                })
                .collect(),
            surfaces,
            sky: Sky::Plain { color_srgb: SKY },
            effects: Default::default(),
            sequences: vec![],
            min_entity_size_m: 0.0,
            cameras: members,
            view: None,
            document: Arc::from("{}"),
        };
        let sources: Vec<Billboard> =
            (0..self.cameras.len()).filter_map(|idx| self.billboard(idx, &cameras[idx])).collect();
        let entities = match self.person {
            Some(foot_in_world) if !sources.is_empty() => {
                let (foot_covariance_m2, height_m) = (DMat2::from_diagonal(DVec2::splat(0.04)), 1.8);
                let velocity = Velocity::UNKNOWN;
                vec![Entity {
                    id: 1,
                    foot_in_world,
                    foot_covariance_m2,
                    velocity,
                    reach_m: None,
                    height_m,
                    sources,
                }]
            }
            _ => Vec::new(),
        };
        SceneState {
            scene: Arc::new(scene),
            instant: Timestamp::from_nanos(0),
            cameras,
            n_overlapping: 0,
            entities,
            points: Vec::new(),
            hulls: Vec::new(),
            sequences: vec![],
        }
    }

    fn observe(&self, surfaces: &Surfaces, idx: usize) -> CameraState {
        let (camera, tint) = &self.cameras[idx];
        let (width, height) = camera.size_px();
        let id = CameraId::new(&format!("cam{idx}")).expect("an id");
        let mut background = Vec::new();
        let mut frame = Vec::new();
        let mut soft_mask = Mask::filled(width, height, 0);
        for row in 0..height {
            for column in 0..width {
                let at = |value: u32, size: u32| (f64::from(value) + 0.5) / f64::from(size);
                let ray = camera.ray(DVec2::new(at(column, width), at(row, height)));
                let hit = ray.and_then(|ray| surfaces.hit(&ray, 0.0));
                let seen = hit.map_or(SKY, |hit| {
                    let color = self.paint(hit.point_in_world, hit.surface);
                    [0, 1, 2].map(|c| srgb_code(color[c] * tint[c]))
                });
                background.push(seen);
                let person = ray.and_then(|ray| self.person_color(&ray, camera));
                soft_mask.data[(row * width + column) as usize] = if person.is_some() { 255 } else { 0 };
                frame.push(person.unwrap_or(seen));
            }
        }
        // Every camera has another matrix and range, as real ones do.
        let (matrix, range) = [
            (ColorMatrix::Bt709, ColorRange::Full),
            (ColorMatrix::Bt601, ColorRange::Limited),
            (ColorMatrix::Bt2020, ColorRange::Full),
        ][idx % 3];
        let observation = Observation {
            frame: Frame {
                camera: id.clone(),
                timestamp: Timestamp::from_nanos(0),
                number: 0,
                image: Arc::new(yuv_from_rgb(&frame, width, height, matrix, range)),
            },
            soft_mask: Arc::new(soft_mask),
            labels: Arc::new(Mask::filled(width, height, 0)),
            background: Arc::new(yuv_from_rgb(&background, width, height, matrix, range)),
            blobs: Arc::from([]),
            tracks: Arc::from([]),
        };
        CameraState::new(id, Arc::clone(camera), observation)
    }

    /// The person is a flat figure that faces every camera: what billboards assume.
    pub(crate) fn person_color(&self, ray: &Ray, camera: &Camera) -> Option<[u8; 3]> {
        let foot = self.person?;
        let (right, normal) = facing(foot, camera);
        let hit = ray.at(ray.distance_to_plane(foot, normal)?) - foot;
        let (along, up) = (hit.dot(right), hit.z);
        let is_head = DVec2::new(along, up - 1.6).length() < 0.2;
        let is_body = along.abs() < 0.3 && (0.0..1.4).contains(&up);
        (is_head || is_body).then_some(match (is_head, up > 0.8, along > 0.0) {
            (true, ..) => [230, 180, 150],
            (_, true, true) => [220, 40, 40],
            (_, true, false) => [250, 210, 40],
            _ => [30, 40, 120],
        })
    }

    fn billboard(&self, camera_idx: usize, state: &CameraState) -> Option<Billboard> {
        let foot = self.person?;
        let mask = &state.observation.soft_mask;
        let (width, height) = (mask.width, mask.height);
        let is_set = |x: u32, y: u32| mask.get(x, y) > 0;
        let (mut low, mut high) = ((width, height), (0, 0));
        for y in 0..height {
            for x in (0..width).filter(|x| is_set(*x, y)) {
                low = (low.0.min(x), low.1.min(y));
                high = (high.0.max(x + 1), high.1.max(y + 1));
            }
        }
        (low.0 < high.0).then(|| Billboard {
            camera_idx,
            rect: PixelRect { x: low.0, y: low.1, width: high.0 - low.0, height: high.1 - low.1 },
            foot_in_world: foot,
            right_in_world: facing(foot, &state.camera).0,
            left_right_m: [-0.3, 0.3],
            height_m: 1.8,
            is_truncated: false,
            owner: 0,
            shown_share: 1.0,
        })
    }
}

fn facing(foot: DVec3, camera: &Camera) -> (DVec3, DVec3) {
    let away = (foot - camera.pose().position_in_world).truncate().normalize();
    (DVec3::new(away.y, -away.x, 0.0), away.extend(0.0))
}

pub(crate) fn srgb_code(linear: f64) -> u8 {
    (f64::from(srgb_from_linear(linear.clamp(0.0, 1.0) as f32)) * 255.0).round() as u8
}

fn yuv_from_rgb(
    rgb: &[[u8; 3]],
    width: u32,
    height: u32,
    matrix: ColorMatrix,
    range: ColorRange,
) -> YuvImage {
    let (kr, kb) = matrix.red_blue_weights();
    let (offset, luma_scale, chroma_scale) = range.luma_offset_luma_scale_chroma_scale();
    let layout = YuvLayout::packed(width, height);
    let mut data = vec![0; YuvLayout::packed_len(width, height)];
    let ypbpr = |[r, g, b]: [u8; 3]| {
        let [r, g, b] = [r, g, b].map(|code| f32::from(code) / 255.0);
        let y = kr * r + (1.0 - kr - kb) * g + kb * b;
        [y, (b - y) / (2.0 * (1.0 - kb)), (r - y) / (2.0 * (1.0 - kr))]
    };
    for (out, pixel) in data.iter_mut().zip(rgb) {
        *out = (offset + luma_scale * ypbpr(*pixel)[0]).round() as u8;
    }
    let (width, height) = (width as usize, height as usize);
    for row in 0..height.div_ceil(2) {
        for column in 0..width.div_ceil(2) {
            let idx = row * width.div_ceil(2) + column;
            let at = |dx: usize, dy: usize| {
                ypbpr(rgb[(row * 2 + dy).min(height - 1) * width + (column * 2 + dx).min(width - 1)])
            };
            let quad = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
            for plane in [1, 2] {
                let mean = quad.iter().map(|sample| sample[plane]).sum::<f32>() / 4.0;
                data[layout.offsets[plane] + idx] = (128.0 + chroma_scale * mean).round() as u8;
            }
        }
    }
    YuvImage::new(layout, matrix, range, data).expect("a packed picture")
}
