//! The engine seen through its door: cameras, maps, checkpoints and the renderer at work over clips made here.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

mod activity;
mod assets;
mod blurred;
mod calibrations;
mod costs;
mod deadlines;
mod entities;
mod evidence;
mod fair;
mod feed;
mod footage;
mod frozen;
mod held;
mod hidden;
pub(crate) mod house;
mod hulls;
mod jobs;
mod kept_scenes;
mod masked;
mod misaligned;
mod mutations;
mod pictures;
pub(crate) mod privacy;
mod restart;
mod rights;
mod snapshots;
mod streams;
mod stretched;
mod tags;
mod tracks;
mod views;
mod walk;
mod walls;

use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use tokio::runtime::Runtime;
use tokio::sync::oneshot;
use videofields_picture::plan::{Colors, Effort, EntityStyle, Named};
use videofields_picture::scene::{self, Scene};
use videofields_recording::store::Store;
use videofields_recording::telemetry::Metrics;
use videofields_service::engine::{
    At, CameraSummary, Door, Engine, EngineError, Flow, Handle, LocateMethod, ViewAnswer, ViewKind,
    ViewRequest,
};
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{
    CameraSettings, ClockSettings, Config, End, MediaSettings, Pace, SegmentSettings, Settings,
    SourceSettings, TrackSettings,
};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, RgbImage};
use videofields_vision::segment::MOVING;

const SIZE: (u32, u32) = (64, 48);
const RATE_HZ: f64 = 50.0;
const FRAME_NANOS: i64 = 20_000_000;

/// Two cameras that look down on a square of ground, `north` from its north side and `south` from its south side.
pub(crate) const SCENE: &str = r##"{
    "version": 1, "name": "Yard",
    "sky": {"color_srgb": "#8090ff"},
    "ground": [{"polygon": [[-10, -10], [10, -10], [10, 10], [-10, 10]], "height_m": 0, "color_srgb": "#705030"}],
    "cameras": [
        {"id": "north", "calibration": {"image_size_px": [64, 48], "focal_px": [60, 60], "center_px": [32, 24],
            "position_m": [0, 8, 6], "world_from_camera": [0, -0.9238795325112867, 0.3826834323650898, 0]}},
        {"id": "south", "calibration": {"image_size_px": [64, 48], "focal_px": [60, 60], "center_px": [32, 24],
            "position_m": [0, -8, 6], "world_from_camera": [-0.9238795325112867, 0, 0, 0.3826834323650898]}}
    ]
}"##;

/// A whole daemon's interface over two cameras that are live and the scene `yard`.
pub(crate) fn live_house(folder: &Path) -> house::House {
    let house = kept_scenes::start(folder);
    house.bench.wait_for_state("north", "live");
    house
}

/// Whether pictures can be drawn here.
fn has_adapter() -> bool {
    videofields_testing::adapter("").is_some()
}

/// Picture `number` of a noisy floor over which a bright box walks to the right.
fn picture(number: u32) -> image::GrayImage {
    let left = number * 2 % (SIZE.0 - 12);
    image::GrayImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let hash = (u64::from(x) | u64::from(y) << 16 | u64::from(number) << 32)
            .wrapping_mul(0x9e37_79b9_7f4a_7c15)
            .rotate_left(23)
            .wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let floor = 96 + (hash >> 62) as u8;
        let is_box = (left..left + 12).contains(&x) && (12..36).contains(&y);
        image::Luma([if is_box { 220 } else { floor }])
    })
}

/// A folder of numbered pictures; its pattern.
pub(crate) fn pictures(folder: &Path, name: &str, numbers: std::ops::Range<u32>) -> PathBuf {
    let folder = folder.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    for number in numbers {
        picture(number).save(folder.join(format!("in{number:04}.png"))).unwrap();
    }
    folder.join("in%04d.png")
}

fn camera(id: &str, path: impl Into<PathBuf>, end: End) -> CameraSettings {
    CameraSettings {
        id: CameraId::new(id).unwrap(),
        name: String::new(),
        enabled: true,
        source: SourceSettings {
            rate_hz: RATE_HZ,
            end,
            // None is left out, however busy the machine is.
            pace: if end == End::Stop { Pace::All } else { Pace::RealTime },
            start: Some(Timestamp::from_nanos(0)),
            ..SourceSettings::of_path(path)
        },
        clock: ClockSettings::default(),
        record: true,
        vision: true,
        privacy_zones: Vec::new(),
        background: Default::default(),
        segment: SegmentSettings { min_area_px: 100, ..SegmentSettings::default() },
        track: TrackSettings::default(),
        condition: Default::default(),
    }
}

/// A running engine, and all that must outlive it.
pub(crate) struct Bench {
    runtime: Runtime,
    store: Store,
    engine: Engine,
    handle: Handle,
    cameras: Vec<CameraSettings>,
}

impl Bench {
    /// Starts cameras and scenes over the database in `folder`; nothing is drawn but what is asked for.
    fn start(folder: &Path, mut settings: Settings, scenes: &[(&str, &str)]) -> Self {
        settings.render.warm_up = false;
        Self::start_as_set(folder, settings, scenes)
    }

    /// As [`Self::start`], with every setting as it is.
    fn start_as_set(folder: &Path, settings: Settings, scenes: &[(&str, &str)]) -> Self {
        Self::start_by(folder, settings, scenes, Arc::new(SystemClock::new()))
    }

    /// Starts as [`Self::start_as_set`] does, by another clock.
    fn start_by(
        folder: &Path,
        mut settings: Settings,
        scenes: &[(&str, &str)],
        clock: Arc<dyn Clock>,
    ) -> Self {
        let runtime = Runtime::new().unwrap();
        let store = runtime.block_on(Store::open(&folder.join("test.sqlite"))).unwrap();
        // Pictures lie beside the database in most tests.
        if settings.media == MediaSettings::default() {
            settings.media.roots = vec![folder.to_owned()];
        }
        let config = Config::from_settings(settings, folder).unwrap();
        let scenes: Vec<Arc<Scene>> = scenes
            .iter()
            .map(|(id, text)| Arc::new(scene::parse(id, text, scene::no_imports).unwrap().scene))
            .collect();
        let engine = {
            let _entered = runtime.enter();
            Engine::start(&config, scenes, store.clone(), Arc::new(Metrics::new()), clock).unwrap()
        };
        let handle = engine.handle();
        let cameras = config.settings().camera.clone();
        Self { runtime, store, engine, handle, cameras }
    }

    /// Stops it as the daemon does; the handle lives on.
    pub(crate) fn stop(self) -> Handle {
        self.engine.stop();
        self.runtime.block_on(self.store.close()).unwrap();
        self.handle
    }

    fn summary(&self, id: &str) -> CameraSummary {
        self.handle.cameras().into_iter().find(|camera| camera.id.as_str() == id).unwrap()
    }

    fn wait_for_state(&self, id: &str, state: &str) -> CameraSummary {
        let what = format!("{id} to be {state}");
        wait_for(&what, || Some(self.summary(id)).filter(|summary| summary.state == state))
    }

    fn view(&self, request: ViewRequest) -> Result<ViewAnswer, EngineError> {
        self.runtime.block_on(self.handle.view(request))
    }
}

fn request(scene: &str, at: At) -> ViewRequest {
    ViewRequest {
        scene: scene.to_owned(),
        eye: Some(DVec3::new(7.0, -7.0, 5.0)),
        target: Some(DVec3::ZERO),
        fov_y_rad: None,
        width_px: 40,
        height_px: 30,
        at,
        style: EntityStyle::Billboards,
        kind: ViewKind::Perspective,
        see_through: true,
        colors: Colors::Even,
        session: None,
        effort: Effort::default(),
        effects: Default::default(),
        horizon: None,
        blur_people: None,
        scope: videofields_vision::access::Scope::all(),
    }
}

fn named(samples: Option<u32>, supersampling: Option<u32>) -> Effort {
    Effort { named: Named { samples, supersampling, ..Named::default() }, ..Effort::default() }
}

fn at(nanos: i64) -> At {
    At::Time(Timestamp::from_nanos(nanos))
}

#[test]
fn one_camera_at_fault_leaves_the_others_working() {
    let folder = TempDir::new().unwrap();
    let outside = TempDir::new().unwrap();
    let media = folder.path().join("media");
    std::fs::create_dir(&media).unwrap();
    std::fs::write(media.join("note.webm"), "this is no video").unwrap();
    std::fs::write(media.join("empty.webm"), "").unwrap();
    let beyond = pictures(outside.path(), "beyond", 0..2);
    let cut = pictures(&media, "cut", 0..6);
    let half = std::fs::read(cut.with_file_name("in0003.png")).unwrap();
    std::fs::write(cut.with_file_name("in0003.png"), &half[..half.len() / 2]).unwrap();
    let mut settings = Settings::default();
    settings.media.roots = vec![media.clone()];
    settings.camera = vec![
        camera("missing", media.join("nowhere.webm"), End::Stop),
        camera("north", pictures(&media, "north", 0..30), End::Stop),
        camera("text", media.join("note.webm"), End::Stop),
        camera("empty", media.join("empty.webm"), End::Stop),
        camera("outside", beyond, End::Stop),
        camera("folder", &media, End::Stop),
        camera("cut", cut, End::Stop),
        camera("south", pictures(&media, "south", 0..30), End::Loop),
    ];
    let bench = Bench::start(folder.path(), settings, &[("yard", SCENE)]);

    let check_failed = |id: &str, reason: &str| {
        let summary = bench.wait_for_state(id, "failed");
        let told = summary.reason.unwrap();
        assert!(told.contains(reason), "{id}: {told}");
    };
    check_failed("missing", "nowhere.webm");
    check_failed("text", "note.webm");
    check_failed("empty", "empty.webm");
    check_failed("outside", "media root");
    check_failed("folder", "media");
    check_failed("cut", "in0003.png");
    let error = bench.handle.observation("missing", At::Live).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unavailable);
    assert!(error.to_string().contains("its file cannot be played"), "{error}");
    assert!(bench.handle.observation("cut", at(0)).is_ok(), "what came before the damage is kept");

    let north = bench.wait_for_state("north", "ended");
    assert_eq!((north.size_px, north.reason), (Some([64, 48]), None));
    assert_eq!(north.frames + north.dropped, 30);
    assert_eq!(north.first.as_deref(), Some("1970-01-01T00:00:00Z"));
    assert_eq!(north.scenes, ["yard"]);
    let south = wait_for("south to loop", || Some(bench.summary("south")).filter(|south| south.frames > 40));
    assert_eq!((south.state.as_str(), south.reason), ("live", None));
    assert_eq!(bench.handle.readiness().cameras_with_frames, [3, 8]);

    if has_adapter() {
        let answer = bench.view(request("yard", At::Live)).unwrap();
        let sources: Vec<&str> = answer.sources.iter().map(|source| source.camera.as_str()).collect();
        assert_eq!(sources, ["north", "south"]);
    }
    let text = bench.handle.metrics_text().unwrap();
    assert!(text.contains("camera=\"north\""), "{text}");
    bench.stop();
}

#[test]
fn the_door_answers_what_was_seen_when_and_where() {
    let folder = TempDir::new().unwrap();
    let camera = vec![
        camera("north", pictures(folder.path(), "north", 0..40), End::Stop),
        camera("south", pictures(folder.path(), "south", 0..40), End::Stop),
    ];
    let settings = Settings { camera, ..Settings::default() };
    let bench = Bench::start(folder.path(), settings, &[("yard", SCENE)]);
    let handle = bench.handle.clone();
    assert_eq!(handle.observation("west", At::Live).unwrap_err().kind(), ErrorKind::NotFound);
    bench.wait_for_state("north", "ended");
    bench.wait_for_state("south", "ended");

    let first = handle.observation("north", at(0)).unwrap();
    assert_eq!(first.frame.number, 0);
    for nanos in [-1, 0, 1, FRAME_NANOS * 7 - 1, FRAME_NANOS * 7 + 1, FRAME_NANOS * 39] {
        let seen = handle.observation("north", at(nanos)).unwrap();
        let timestamp = seen.frame.timestamp.as_nanos();
        assert!((timestamp - nanos).abs() <= FRAME_NANOS / 2, "{nanos}");
        assert_eq!(timestamp, seen.frame.number as i64 * FRAME_NANOS, "{nanos}");
        assert_eq!((seen.labels.width, seen.labels.height), SIZE, "{nanos}");
        assert_eq!((seen.background.width(), seen.background.height()), SIZE, "{nanos}");
    }
    let live = handle.observation("north", At::Live).unwrap();
    assert!(live.labels.data.contains(&MOVING), "the box moves");
    let error = handle.observation("north", at(-2_000_000_000)).unwrap_err();
    assert!(matches!(error, EngineError::Gap { before: None, after: Some(_), .. }), "{error}");
    assert!(error.to_string().contains("the first frame kept is of 1970-01-01T00:00:00Z"), "{error}");
    let error = handle.observation("north", at(i64::MAX)).unwrap_err();
    assert!(matches!(error, EngineError::Gap { before: Some(_), after: None, .. }), "{error}");

    rays_and_map_agree(&bench);
    if has_adapter() {
        pictures_are_drawn_and_shared(&bench);
    }
    let handle = bench.stop();
    assert_eq!(handle.observation("north", At::Live).unwrap().frame.number, live.frame.number);
    let (reply, _answer) = oneshot::channel();
    let error = Door::view(&*handle, request("yard", At::Live), Flow::Common.into(), reply).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Unavailable, "{error}");
}

fn rays_and_map_agree(bench: &Bench) {
    let locate = |camera: &str, u: f64, v: f64, method| {
        bench.handle.locate(camera, DVec2::new(u, v), Some("yard"), method)
    };
    wait_for("the map", || match locate("south", 0.5, 0.5, LocateMethod::Map) {
        Err(EngineError::Unavailable(_)) => None,
        other => Some(other.unwrap()),
    });
    let mut n_seen = 0;
    for camera in ["north", "south"] {
        for (column, row) in (0..SIZE.0).step_by(5).flat_map(|x| (0..SIZE.1).step_by(5).map(move |y| (x, y)))
        {
            let u = (f64::from(column) + 0.5) / f64::from(SIZE.0);
            let v = (f64::from(row) + 0.5) / f64::from(SIZE.1);
            let [ray, map] =
                [LocateMethod::Ray, LocateMethod::Map].map(|method| locate(camera, u, v, method).ok());
            assert_eq!(ray.is_some(), map.is_some(), "{camera} {u} {v}");
            let Some((ray, map)) = ray.zip(map) else { continue };
            n_seen += 1;
            let distance_m = DVec3::from(ray.point_m).distance(DVec3::from(map.point_m));
            assert!(distance_m < 1e-3, "{camera} {u} {v}: {ray:?} {map:?}");
            assert_eq!((ray.surface, ray.surface_idx), (map.surface, map.surface_idx));
        }
    }
    assert!(n_seen > 50, "{n_seen}");
    // Straight ahead of `south`, 45 degrees down from (0, -8, 6), lies (0, -2, 0).
    let ahead = locate("south", 0.5, 0.5, LocateMethod::Ray).unwrap();
    assert!(DVec3::from(ahead.point_m).distance(DVec3::new(0.0, -2.0, 0.0)) < 1e-9, "{ahead:?}");
    for (u, v) in [(-0.1, 0.5), (0.5, 1.1), (f64::NAN, 0.5), (0.5, f64::INFINITY)] {
        assert_eq!(locate("south", u, v, LocateMethod::Ray).unwrap_err().kind(), ErrorKind::Invalid);
    }
    let elsewhere = bench.handle.locate("south", DVec2::splat(0.5), Some("street"), LocateMethod::Ray);
    assert!(matches!(elsewhere, Err(EngineError::NoScene { .. })), "{elsewhere:?}");
}

fn pictures_are_drawn_and_shared(bench: &Bench) {
    let one = bench.view(request("yard", at(0))).unwrap();
    assert_eq!((one.image.width, one.image.height), (40, 30));
    assert_eq!(one.instant, Timestamp::from_nanos(0));
    let same = bench.view(request("yard", at(0))).unwrap();
    assert!(Arc::ptr_eq(&one.image, &same.image), "equal requests share a picture");
    // The same picture, though what is looked at lies nearer: the answer says what was asked.
    let nearer = ViewRequest { target: Some(DVec3::new(3.5, -3.5, 2.5)), ..request("yard", at(0)) };
    assert_eq!(bench.view(nearer).unwrap().view.target, DVec3::new(3.5, -3.5, 2.5));
    let other = ViewRequest { style: EntityStyle::None, ..request("yard", at(0)) };
    assert!(!Arc::ptr_eq(&bench.view(other).unwrap().image, &one.image));
    let live = bench.view(request("yard", At::Live)).unwrap();
    assert_eq!(live.sources.len(), 2);
    assert!(is_drawn(&live.image));
    let own = ViewRequest { eye: None, target: None, ..request("yard", At::Live) };
    assert!(is_drawn(&bench.view(own).unwrap().image), "a scene without a view has one of all its ground");

    let check = |request: ViewRequest, kind: ErrorKind, text: &str| {
        let error = bench.view(request).unwrap_err();
        assert_eq!(error.kind(), kind, "{error}");
        assert!(error.to_string().contains(text), "{error}");
    };
    let good = || request("yard", At::Live);
    check(request("street", At::Live), ErrorKind::NotFound, "street");
    check(request("yard", at(-2_000_000_000)), ErrorKind::NotFound, "1970-01-01T00:00:00Z");
    check(ViewRequest { width_px: 0, ..good() }, ErrorKind::Invalid, "width");
    check(ViewRequest { height_px: u32::MAX, ..good() }, ErrorKind::TooLarge, "height");
    // Parallel rays show the same from everywhere along them, also from where single precision holds no metre.
    let aslant = |times: f64| {
        let kind = ViewKind::Orthographic { across_m: Some(8.0) };
        let eye = Some(DVec3::new(7.0, -7.0, 5.0) * times);
        bench.view(ViewRequest { kind, eye, ..request("yard", at(0)) }).unwrap().image
    };
    let near = aslant(1.0);
    for times in [1e3, 1e5, 1e7] {
        let far = aslant(times);
        let n_off = near.data.iter().zip(&far.data).filter(|(near, far)| near.abs_diff(**far) > 2).count();
        assert!(n_off <= near.data.len() / 200, "{times}: {n_off} of {}", near.data.len());
    }
    let odd = ViewKind::Stereo { eye_distance_m: 0.1, convergence_m: None };
    check(ViewRequest { kind: odd, width_px: 41, ..good() }, ErrorKind::Invalid, "even");
    let round = ViewKind::Panorama { span_rad: std::f64::consts::TAU };
    check(ViewRequest { kind: round, width_px: 1, ..good() }, ErrorKind::Invalid, "width");
    let large = ViewRequest { width_px: 6000, height_px: 3000, ..good() };
    check(ViewRequest { effort: named(None, Some(2)), ..large }, ErrorKind::TooLarge, "supersampling");
    check(ViewRequest { effort: named(None, Some(5)), ..good() }, ErrorKind::Invalid, "supersampling");
    check(ViewRequest { effort: named(Some(3), None), ..good() }, ErrorKind::Invalid, "samples");
    check(ViewRequest { eye: good().target, ..good() }, ErrorKind::Invalid, "target");
    check(ViewRequest { eye: Some(DVec3::NAN), ..good() }, ErrorKind::Invalid, "eye");
    check(ViewRequest { fov_y_rad: Some(f64::NAN), ..good() }, ErrorKind::Invalid, "fov");
}

/// Whether a picture shows more than one colour, and not nothing.
fn is_drawn(image: &RgbImage) -> bool {
    let mut pixels = image.data.chunks_exact(3);
    let first = pixels.next().unwrap();
    pixels.any(|pixel| pixel != first)
}

#[test]
fn a_full_queue_is_busy_and_a_scene_without_cameras_is_drawn() {
    let folder = TempDir::new().unwrap();
    let mut settings = Settings::default();
    settings.render.queue_length = 1;
    let mut document: serde_json::Value = serde_json::from_str(SCENE).unwrap();
    document.as_object_mut().unwrap().remove("cameras");
    let bench = Bench::start(folder.path(), settings, &[("yard", &document.to_string())]);
    // The renderer takes longer to open its device than these requests take to be asked.
    let mut answers = Vec::new();
    let mut n_busy = 0;
    for width_px in 20..40 {
        let (reply, answer) = oneshot::channel();
        match Door::view(
            &*bench.handle,
            ViewRequest { width_px, ..request("yard", At::Live) },
            Flow::Common.into(),
            reply,
        ) {
            Ok(()) => answers.push(answer),
            Err(EngineError::Busy { waiting, retry_after }) => {
                assert_eq!(waiting, 1);
                assert!(!retry_after.is_zero());
                n_busy += 1;
            }
            Err(other) => panic!("{other}"),
        }
    }
    assert!(n_busy > 0, "twenty pictures at once do not fit a queue of one");
    let drawn = has_adapter();
    for answer in answers {
        let answer = bench.runtime.block_on(answer).unwrap();
        assert_eq!(answer.is_ok_and(|answer| is_drawn(&answer.image)), drawn);
    }
    bench.stop();
}

#[test]
fn a_scene_whose_cameras_are_not_configured_says_so() {
    let folder = TempDir::new().unwrap();
    let bench = Bench::start(folder.path(), Settings::default(), &[("yard", SCENE)]);
    let error = bench.view(request("yard", At::Live)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::NotFound);
    assert!(error.to_string().contains("north"), "{error}");
    bench.stop();
}

#[test]
fn a_map_that_cannot_be_built_is_told_as_what_it_is() {
    let folder = TempDir::new().unwrap();
    let camera = vec![camera("north", pictures(folder.path(), "north", 0..2), End::Stop)];
    let settings = Settings { camera, ..Settings::default() };
    let huge = SCENE.replacen("[64, 48]", "[65000, 65000]", 1);
    let bench = Bench::start(folder.path(), settings, &[("yard", &huge)]);
    let error = wait_for("the map to fail", || {
        match bench.handle.locate("north", DVec2::splat(0.5), None, LocateMethod::Map) {
            Err(EngineError::Unavailable(_)) => None,
            other => Some(other.unwrap_err()),
        }
    });
    assert_eq!(error.kind(), ErrorKind::TooLarge, "{error}");
    bench.stop();
}

#[test]
fn stopping_does_not_wait_for_a_background_clip_to_be_learned() {
    let folder = TempDir::new().unwrap();
    let mut settings = Settings::default();
    let mut north = camera("north", pictures(folder.path(), "north", 0..2), End::Stop);
    // Far more pictures than can be read in the time that stopping may take.
    let clip = folder.path().join("clip");
    std::fs::create_dir(&clip).unwrap();
    let large = image::GrayImage::from_fn(1600, 1200, |x, y| image::Luma([(x * y % 251) as u8]));
    large.save(clip.join("first.png")).unwrap();
    for number in 0..400 {
        std::fs::hard_link(clip.join("first.png"), clip.join(format!("in{number:03}.png"))).unwrap();
    }
    north.background.clip = Some(clip.join("in%03d.png"));
    settings.camera = vec![north];
    let bench = Bench::start(folder.path(), settings, &[("yard", SCENE)]);
    bench.wait_for_state("north", "connecting");
    let clock = SystemClock::new();
    clock.sleep(std::time::Duration::from_millis(300));
    let started = clock.monotonic();
    bench.stop();
    let took = clock.monotonic().saturating_sub(started);
    assert!(took.as_secs_f64() < 2.0, "{took:?}");
    let runtime = Runtime::new().unwrap();
    let kept = runtime.block_on(async {
        let store = Store::open(&folder.path().join("test.sqlite")).await.unwrap();
        store.latest_background(&CameraId::new("north").unwrap()).await.unwrap()
    });
    assert_eq!(kept, None, "half a clip is no background");
}
