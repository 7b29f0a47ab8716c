//! A camera whose calibration is wrong is told of, and people are placed as if it were right: from pictures to the door.

use super::{Bench, camera, wait_for};
use glam::{DQuat, DVec2, DVec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use videofields_picture::scene;
use videofields_recording::timeline::EventKind;
use videofields_service::engine::SceneAlignment;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{End, EntitySettings, SegmentSettings, Settings};
use videofields_vision::geometry::{Camera, Pose};
use videofields_vision::mapping;

const SIZE: (u32, u32) = (160, 120);
const RATE_HZ: f64 = 12.5;

/// Frames of a walk, and of the pause after it.
const WALK: [u32; 2] = [40, 15];

/// Walks over the ground: from where to where, metres.
const WALKS: [[DVec2; 2]; 9] = [
    [DVec2::new(-4.0, -2.0), DVec2::new(4.0, -2.0)],
    [DVec2::new(4.0, 0.0), DVec2::new(-4.0, 0.0)],
    [DVec2::new(-4.0, 2.0), DVec2::new(4.0, 2.0)],
    [DVec2::new(-2.0, -3.0), DVec2::new(-2.0, 3.0)],
    [DVec2::new(0.0, 3.0), DVec2::new(0.0, -3.0)],
    [DVec2::new(2.0, -3.0), DVec2::new(2.0, 3.0)],
    [DVec2::new(-3.0, -3.0), DVec2::new(3.0, 3.0)],
    [DVec2::new(3.0, -3.0), DVec2::new(-3.0, 3.0)],
    [DVec2::new(-3.0, 1.0), DVec2::new(3.0, -1.0)],
];

/// Factor by which a test's clock runs faster than the machine's.
const FASTER: u32 = 5;

/// A clock that runs fast.
struct FastClock(SystemClock);

impl Clock for FastClock {
    fn now(&self) -> Timestamp {
        self.0.now()
    }

    fn monotonic(&self) -> Duration {
        self.0.monotonic() * FASTER
    }

    fn sleep(&self, duration: Duration) {
        self.0.sleep(duration / FASTER);
    }
}

/// Returns where the walker is at an instant; none at the beginning and end of walks, and between them.
fn walker_at(instant: Timestamp) -> Option<DVec2> {
    let [walk, pause] = WALK;
    let n_frames = WALKS.len() as u32 * (walk + pause);
    let number = (instant.as_nanos() as f64 * 1e-9 * RATE_HZ).round() as u64 % u64::from(n_frames);
    let (way, frame) = (number as u32 / (walk + pause), number as u32 % (walk + pause));
    let [from, to] = WALKS[way as usize];
    (10..walk - 5).contains(&frame).then(|| from.lerp(to, f64::from(frame) / f64::from(walk)))
}

fn cameras() -> [(&'static str, Camera); 3] {
    let of = |x: f64, y: f64| Camera::pinhole(DVec3::new(x, y, 5.0), DVec3::Z * 0.8, 0.8, SIZE).unwrap();
    [("north", of(1.0, 9.0)), ("east", of(9.0, -3.0)), ("west", of(-8.0, -6.0))]
}

/// Makes a folder of pictures of what a camera sees of the walkers; their pattern.
fn pictures(folder: &Path, id: &str, camera: &Camera) -> PathBuf {
    let folder = folder.join(id);
    std::fs::create_dir(&folder).unwrap();
    let [walk, pause] = WALK;
    let size = DVec2::new(SIZE.0.into(), SIZE.1.into());
    for number in 0..WALKS.len() as u32 * (walk + pause) {
        let frame = number % (walk + pause);
        let walker = (frame < walk).then(|| {
            let [from, to] = WALKS[(number / (walk + pause)) as usize];
            let foot = from.lerp(to, f64::from(frame) / f64::from(walk)).extend(0.0);
            let at = |above_m: f64| camera.project(foot + DVec3::Z * above_m).unwrap().texture * size;
            (at(0.0), at(1.7))
        });
        let picture = image::GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let is_walker = walker.is_some_and(|(low, high)| {
                let across = (f64::from(x) + 0.5 - low.x).abs();
                across < 0.15 * (low.y - high.y) && (high.y..low.y).contains(&(f64::from(y) + 0.5))
            });
            let hash = (u64::from(x) | u64::from(y) << 16 | u64::from(number) << 32)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .rotate_left(23)
                .wrapping_mul(0x9e37_79b9_7f4a_7c15);
            image::Luma([if is_walker { 220 } else { 96 + (hash >> 62) as u8 }])
        });
        picture.save(folder.join(format!("in{number:04}.png"))).unwrap();
    }
    folder.join("in%04d.png")
}

/// Returns the scene's document, in which `west` is turned by 6 degrees.
fn document() -> String {
    let document = |(id, camera): &(&str, Camera)| {
        let turn = if *id == "west" { DQuat::from_rotation_z(6_f64.to_radians()) } else { DQuat::IDENTITY };
        let pose = camera.pose();
        let pose = Pose { world_from_local: turn * pose.world_from_local, ..*pose };
        let (size, focal, center) = (camera.size_px(), camera.focal_px(), camera.center_px());
        let camera = Camera::new(size, focal, center, *camera.distortion(), pose).unwrap();
        serde_json::json!({"id": id, "calibration": CameraDocument::from_camera(&camera)})
    };
    let cameras: Vec<_> = cameras().iter().map(document).collect();
    let polygon = [[-12, -12], [12, -12], [12, 12], [-12, 12]];
    serde_json::json!({"version": 1, "ground": [{"polygon": polygon, "height_m": 0}], "cameras": cameras})
        .to_string()
}

#[test]
fn a_camera_that_sees_people_elsewhere_than_others_is_told_of_and_people_stand_where_they_do() {
    let folder = tempfile::tempdir().unwrap();
    let settings = |(id, of): &(&str, Camera)| {
        let path = pictures(folder.path(), id, of);
        let mut settings = camera(id, path, End::Loop);
        settings.source.rate_hz = RATE_HZ;
        settings.segment = SegmentSettings { min_area_px: 16, ..SegmentSettings::default() };
        settings.record = false;
        settings
    };
    let camera: Vec<_> = cameras().iter().map(settings).collect();
    let settings = Settings { camera, entities: EntitySettings { rate_hz: 5.0 }, ..Settings::default() };
    let clock = Arc::new(FastClock(SystemClock::new()));
    let bench = Bench::start_by(folder.path(), settings, &[("yard", &document())], clock);
    let events = || bench.handle.events(None, 0, 1000).unwrap();
    let is_told = || events().iter().any(|of| of.event.kind == EventKind::Misaligned).then_some(());
    wait_for("a camera that is misaligned", is_told);
    let told: Vec<_> = events().into_iter().filter(|of| of.event.kind == EventKind::Misaligned).collect();
    assert!(told.iter().all(|of| of.event.camera.as_str() == "west" && !of.event.is_end), "{told:?}");
    let reason =
        || bench.summary("west").reason.filter(|reason| reason.contains("disagrees with other cameras"));
    wait_for("the camera's reason", reason);
    assert!(bench.summary("north").reason.is_none() && bench.summary("east").reason.is_none());
    // One after the other walks, and nobody stands elsewhere.
    let (mut n_seen, mut off_m) = (0, 0.0);
    let mut last = None;
    while n_seen < 40 {
        let present = bench.handle.present("yard").unwrap();
        if last.replace(present.instant) == Some(present.instant) {
            std::thread::sleep(Duration::from_millis(5));
            continue;
        }
        let Some(truth) = walker_at(present.instant) else { continue };
        for entity in &present.entities {
            off_m += entity.foot_in_world.truncate().distance(truth);
            n_seen += 1;
        }
    }
    let mean_m = off_m / f64::from(n_seen);
    assert!(mean_m < 0.3, "{mean_m} m");
    let found: SceneAlignment = bench.handle.alignment("yard").unwrap();
    let offsets: Vec<f64> =
        found.cameras.iter().map(|of| of.calibration.as_ref().unwrap().offset.offset_m).collect();
    assert!(offsets[2] > 0.6 && offsets[0] < 0.2 && offsets[1] < 0.2, "{offsets:?}");
    let corrected =
        found.cameras[2].calibration.as_ref().unwrap().corrected.clone().unwrap().to_camera().unwrap();
    let scene = scene::parse("yard", &document(), scene::no_imports).unwrap().scene;
    // Mean distance between places on the ground and where the camera that was turned sees them.
    let error_m = |camera: &Camera| {
        let [_, _, (_, truly)] = cameras();
        let places =
            (0..9).map(|at| DVec3::new(f64::from(at % 3) * 2.0 - 2.0, f64::from(at / 3) * 2.0 - 2.0, 0.0));
        let see =
            |at: DVec3| mapping::place(camera, &scene.surfaces, truly.project(at).unwrap().texture).unwrap();
        places.map(|at| see(at).distance(at)).sum::<f64>() / 9.0
    };
    let (before_m, after_m) = (error_m(&scene.cameras[2].camera), error_m(&corrected));
    assert!(before_m > 0.9 && after_m < 0.3, "{before_m} m, then {after_m} m");
    bench.stop();
}
