//! A sequence that tests look at: a painted ball that rolls along, as cameras around it see it, with another mesh in every frame.

use super::{
    CameraEntry, FilesDocument, MANIFEST, MeshesDocument, Player, PlayerSettings, Sequence, SequenceDocument,
    SequenceError, VERSION,
};
use glam::{DQuat, DVec2, DVec3, Vec3};
use std::f64::consts::{PI, TAU};
use std::path::Path;
use tempfile::TempDir;
use videofields_recording::ingest::MediaRoots;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::frame::{RgbImage, codes_of};
use videofields_vision::geometry::{Camera, Distortion, Pose};
use videofields_vision::mesh::Mesh;

/// The ball's radius, metres.
pub(super) const RADIUS_M: f64 = 1.0;

/// Where the ball's middle is.
pub(super) fn middle(secs: f64) -> DVec3 {
    DVec3::new(0.4 * secs, 0.0, 1.5)
}

/// The ball's light in a direction from its middle.
pub(super) fn paint(direction: DVec3) -> Vec3 {
    let of = |phase: f64| (0.5 + 0.35 * (4.0 * direction.x + 3.0 * direction.z + phase).sin()) as f32;
    Vec3::new(of(0.0), of(2.0), of(4.0)) * 0.7
}

/// A camera of a ring of so many, 4 m from where the ball begins.
pub(super) fn camera(i: usize, n: usize, size: u32) -> Camera {
    looking(TAU * i as f64 / n as f64, size)
}

/// A camera at an angle around the ball's way.
pub(super) fn looking(angle: f64, size: u32) -> Camera {
    let eye = DVec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 2.2);
    let pose = Pose::looking_at(eye, middle(0.25)).expect("a direction");
    let focal = 1.1 * f64::from(size);
    Camera::new(
        (size, size),
        DVec2::splat(focal),
        DVec2::splat(f64::from(size) / 2.0),
        Distortion::None,
        pose,
    )
    .expect("a camera")
}

/// What a camera sees of the ball, and whether it is the ball, pixel by pixel.
pub(super) fn picture(camera: &Camera, secs: f64, exposure: f32) -> (RgbImage, Vec<bool>) {
    let (width, height) = camera.size_px();
    let (mut data, mut is_ball) = (Vec::new(), Vec::new());
    for pixel in 0..width * height {
        let at = DVec2::new(f64::from(pixel % width) + 0.5, f64::from(pixel / width) + 0.5);
        let ray = camera.ray(at / DVec2::new(f64::from(width), f64::from(height))).expect("a pinhole");
        let to_middle = middle(secs) - ray.origin;
        let along = to_middle.dot(ray.direction);
        let half_squared = RADIUS_M * RADIUS_M - (to_middle - ray.direction * along).length_squared();
        let on = (half_squared > 0.0).then(|| ray.at(along - half_squared.sqrt()) - middle(secs));
        data.extend(codes_of(on.map_or(Vec3::new(0.9, 0.0, 0.9), |at| exposure * paint(at / RADIUS_M))));
        is_ball.push(on.is_some());
    }
    (RgbImage { width, height, data }, is_ball)
}

/// A ball of rings of triangles, turned; other triangles with every number.
pub(super) fn ball(number: u64, middle: DVec3) -> Mesh {
    let (n_rings, n_around) = (14 + (number % 3) as u32, 24 + (number * 7 % 5) as u32);
    let turn = DQuat::from_rotation_x(0.7 * number as f64) * DQuat::from_rotation_z(1.3 * number as f64);
    let mut positions = vec![DVec3::Z, DVec3::NEG_Z];
    for ring in 1..n_rings {
        let (sin, cos) = (PI * f64::from(ring) / f64::from(n_rings)).sin_cos();
        positions.extend((0..n_around).map(|i| {
            let around = TAU * f64::from(i) / f64::from(n_around);
            DVec3::new(sin * around.cos(), sin * around.sin(), cos)
        }));
    }
    let at = |ring: u32, i: u32| match ring {
        0 => 0,
        ring if ring == n_rings => 1,
        ring => 2 + (ring - 1) * n_around + i % n_around,
    };
    let mut triangles = Vec::new();
    for ring in 0..n_rings {
        for i in 0..n_around {
            let [a, b, c, d] = [at(ring, i), at(ring + 1, i), at(ring + 1, i + 1), at(ring, i + 1)];
            triangles
                .extend([[a, b, c], [a, c, d]].into_iter().filter(|[a, b, c]| a != b && b != c && a != c));
        }
    }
    Mesh::new(positions.into_iter().map(|at| middle + turn * at * RADIUS_M).collect(), triangles)
}

/// What is written.
#[derive(Clone, Copy)]
pub(super) struct Rolling {
    pub(super) n_frames: u64,
    pub(super) rate_hz: f64,
    pub(super) n_cameras: usize,
    /// Whether every frame has other triangles, and the ball rolls.
    pub(super) is_changing: bool,
    /// Of pictures, camera by camera.
    pub(super) size: fn(usize) -> u32,
    pub(super) exposure: fn(usize) -> f32,
}

impl Default for Rolling {
    fn default() -> Self {
        Self { n_frames: 3, rate_hz: 10.0, n_cameras: 6, is_changing: true, size: |_| 64, exposure: |_| 1.0 }
    }
}

impl Rolling {
    /// When a frame is.
    fn secs(&self, number: u64) -> f64 {
        if self.is_changing { number as f64 / self.rate_hz } else { 0.0 }
    }

    /// Writes it all into a folder, and gives its manifest.
    pub(super) fn write(&self) -> (TempDir, SequenceDocument) {
        let folder = tempfile::tempdir().expect("a folder");
        for number in 0..self.n_frames {
            let secs = self.secs(number);
            let mesh = ball(if self.is_changing { number } else { 0 }, middle(secs));
            write_mesh(&folder.path().join(format!("{number:03}.ply")), &mesh);
            for i in 0..self.n_cameras {
                let camera = camera(i, self.n_cameras, (self.size)(i));
                let (picture, is_ball) = picture(&camera, secs, (self.exposure)(i));
                save(&folder.path().join(format!("c{i}-{number:03}.png")), &picture);
                let white = |is: &bool| [u8::from(*is) * 255; 3];
                let mask = RgbImage { data: is_ball.iter().flat_map(white).collect(), ..picture };
                save(&folder.path().join(format!("m{i}-{number:03}.png")), &mask);
            }
        }
        let pattern = |pattern: String| FilesDocument { pattern: Some(pattern), ..FilesDocument::default() };
        let document = SequenceDocument {
            version: VERSION,
            name: "a ball".to_owned(),
            start: None,
            rate_hz: Some(self.rate_hz),
            times_secs: None,
            meshes: MeshesDocument { pattern: Some("%03d.ply".to_owned()), ..MeshesDocument::default() },
            cameras: (0..self.n_cameras)
                .map(|i| CameraEntry {
                    id: format!("c{i}"),
                    calibration: serde_json::to_value(CameraDocument::from_camera(&camera(
                        i,
                        self.n_cameras,
                        (self.size)(i),
                    )))
                    .expect("it is written"),
                    pictures: pattern(format!("c{i}-%03d.png")),
                    masks: Some(pattern(format!("m{i}-%03d.png"))),
                })
                .collect(),
        };
        manifest(folder.path(), &document);
        (folder, document)
    }
}

pub(super) fn manifest(folder: &Path, document: &SequenceDocument) {
    std::fs::write(folder.join(MANIFEST), serde_json::to_string(document).expect("it is written"))
        .expect("it is written");
}

pub(super) fn write_mesh(path: &Path, mesh: &Mesh) {
    let mut bytes = Vec::new();
    mesh.write_ply(&mut bytes).expect("it is written");
    std::fs::write(path, bytes).expect("it is written");
}

pub(super) fn save(path: &Path, picture: &RgbImage) {
    image::save_buffer(path, &picture.data, picture.width, picture.height, image::ExtendedColorType::Rgb8)
        .expect("it is written");
}

pub(super) fn open(folder: &Path) -> Result<Sequence, SequenceError> {
    Sequence::open(folder, &MediaRoots::new(&[folder.to_path_buf()]).expect("it is written"))
}

pub(super) fn player(folder: &Path, settings: PlayerSettings) -> Player {
    Player::new(open(folder).expect("it is written"), settings)
}
