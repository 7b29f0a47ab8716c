//! What a camera sent is recorded while it runs, and shown again at any instant: the right frame, or a gap.

#![expect(clippy::unwrap_used, reason = "what is no test itself here serves tests alone")]

mod exports;
mod killed;
mod kinds;
mod privacy;

use serde_json::json;
use std::path::Path;
use std::sync::Arc;
use tokio::runtime::Runtime;
use videofields_picture::scene::{self, Scene};
use videofields_recording::archive::{Archive, RecordingState};
use videofields_recording::store::Store;
use videofields_recording::telemetry::{Metrics, RecordingDrop};
use videofields_service::engine::{At, Engine, EngineError, Handle};
use videofields_simulate::World;
use videofields_testing::rtsp::{RtspServer, ball};
use videofields_testing::video::{Numbered, number_of};
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config;
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;

const RATE_HZ: u32 = 20;
const FRAME_NANOS: i64 = 1_000_000_000 / RATE_HZ as i64;

/// Scene time of the first frame.
const START: Timestamp = Timestamp::from_nanos(1_772_366_400_000_000_000);

struct Running {
    runtime: Runtime,
    engine: Option<Engine>,
    archive: Arc<Archive>,
    store: Option<Store>,
    handle: Handle,
}

/// Two cameras that play the same film.
fn film() -> String {
    format!(
        "[[camera]]\nid = \"north\"\n[camera.source]\npath = \"film.mp4\"\nstart = \"{START}\"\n\
         [[camera]]\nid = \"south\"\nrecord = false\n[camera.source]\npath = \"film.mp4\"\nstart = \"{START}\"\n"
    )
}

/// A scene in which only the camera that is recorded stands.
fn scene() -> Scene {
    let text = World::named("yard").unwrap().scene_json((320, 180)).unwrap();
    let mut scene = scene::parse("yard", &text, scene::no_imports).unwrap().scene;
    scene.cameras.truncate(1);
    scene.cameras[0].id = CameraId::new("north").unwrap();
    scene
}

/// Starts cameras with so little memory that most of what they show is forgotten.
fn start(folder: &Path, cameras: &str) -> Running {
    let text = format!(
        "[storage]\ndatabase = \"v.sqlite\"\n[media]\nroots = [\".\"]\n[timeline]\nmib_per_camera = 8\n[accuracy]\nmeasure_at_start = false\n\
         [archive]\nfolder = \"recorded\"\nsegment_secs = 5\nmin_free_mib = 1\nmax_age_days = 36500.0\n\
         {cameras}"
    );
    std::fs::write(folder.join("v.toml"), text).unwrap();
    let config = config::load(&folder.join("v.toml")).unwrap();
    let settings = config.settings();
    let runtime = Runtime::new().unwrap();
    let _entered = runtime.enter();
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let metrics = Arc::new(Metrics::new());
    let store = runtime.block_on(Store::open(&settings.storage.database)).unwrap();
    let archive =
        Archive::start(settings.archive.clone(), store.clone(), Arc::clone(&metrics), Arc::clone(&clock));
    let archive = Arc::new(runtime.block_on(archive).unwrap());
    let recorded = Some(Arc::clone(&archive));
    let engine =
        Engine::start_recording(&config, vec![Arc::new(scene())], store.clone(), metrics, clock, recorded)
            .unwrap();
    let handle = engine.handle();
    Running { runtime, engine: Some(engine), archive, store: Some(store), handle }
}

impl Running {
    fn stop(&mut self) {
        self.engine.take().unwrap().stop();
        self.archive.stop();
        self.runtime.block_on(self.store.take().unwrap().close()).unwrap();
    }

    /// The number that is burned into the frame of an instant, and its scene time.
    fn shown(&self, camera: &str, nanos: i64) -> Result<(u64, i64), EngineError> {
        let at = At::Time(START.saturating_add_nanos(nanos));
        let seen = self.handle.observation(camera, at)?;
        Ok((number_of(&seen.frame.image), seen.frame.timestamp.nanos_since(START)))
    }
}

#[test]
fn every_instant_shows_its_frame_though_memory_has_forgotten_it() {
    const N_FRAMES: u64 = 160;
    let folder = tempfile::tempdir().unwrap();
    // Frames are stored in another order than they are seen.
    Numbered {
        n_frames: N_FRAMES,
        rate_hz: RATE_HZ,
        encoder: "x264enc bframes=2 key-int-max=15",
        muxer: "mp4mux",
    }
    .write(&folder.path().join("film.mp4"));
    let mut running = start(folder.path(), &film());
    wait_for("the film's end", || {
        // What is recorded and what memory holds are one, also while the rows are behind.
        let hour = (START, START.saturating_add_nanos(3_600_000_000_000));
        let timeline = running.handle.scene_timeline("yard", hour, 1).unwrap();
        assert!(timeline.cameras[0].ranges.len() <= 1, "{:?}", timeline.cameras[0].ranges);
        let cameras = running.handle.cameras();
        cameras.iter().all(|camera| camera.state == "ended").then_some(())
    });
    let range = |camera: &str| {
        let found = running.handle.cameras().into_iter().find(|of| of.id.as_str() == camera).unwrap();
        found.first.unwrap().parse::<Timestamp>().unwrap().nanos_since(START)
    };
    assert!(range("north") > 20 * FRAME_NANOS, "memory has forgotten the beginning");

    let mut nanos = 12_345_678;
    for _ in 0..500 {
        // Instants in no order, none of them half-way between two frames.
        nanos = (nanos * 7919 + 1_234_567) % (FRAME_NANOS * (N_FRAMES as i64 - 1));
        let (away, expected) = (nanos % FRAME_NANOS, (nanos + FRAME_NANOS / 2) / FRAME_NANOS);
        if (away - FRAME_NANOS / 2).abs() < 1_000_000 {
            continue;
        }
        let (number, at) = running.shown("north", nanos).unwrap();
        assert_eq!((number as i64, at), (expected, expected * FRAME_NANOS), "{nanos}");
    }
    // Playheads go where memory has forgotten, and step there.
    let at = |number: i64| START.saturating_add_nanos(number * FRAME_NANOS).to_string();
    let moved = |change: serde_json::Value| running.handle.put_playhead("p", change).unwrap().position;
    wait_for("the recording's beginning to be known", || {
        Some(()).filter(|()| moved(json!({"at": at(1), "paused": true})) == at(1))
    });
    for (step, expected) in [(1, 2), (1, 3), (-1, 2), (-1, 1), (-1, 0), (-1, 0)] {
        assert_eq!(moved(json!({ "step": step })), at(expected), "{step}");
    }
    // Over a segment's end.
    assert_eq!(moved(json!({"at": at(104), "step": 1})), at(105));
    assert_eq!(moved(json!({"step": -1})), at(104));

    // Playing on, frame by frame, over the segments' ends.
    for number in 0..N_FRAMES as i64 {
        assert_eq!(
            running.shown("north", number * FRAME_NANOS).unwrap(),
            (number as u64, number * FRAME_NANOS)
        );
    }
    let gap = running.shown("north", -3_000_000_000).unwrap_err();
    assert!(matches!(gap, EngineError::Gap { before: None, after: Some(START), .. }), "{gap}");
    // The other is not recorded.
    let gap = running.shown("south", 0).unwrap_err();
    assert!(matches!(gap, EngineError::Gap { before: None, after: Some(_), .. }), "{gap}");
    let status = running.archive.status();
    assert_eq!(status.cameras.len(), 1, "{status:?}");
    assert!(!matches!(status.cameras[0].state, RecordingState::Paused { .. }), "{status:?}");

    // The recording outlives the daemon: another one, whose memory is empty, shows it too.
    running.stop();
    std::fs::remove_file(folder.path().join("film.mp4")).unwrap();
    let mut running = start(folder.path(), &film());
    // First a leap over a segment's end, before its frames are at hand: the decoder that stands there has nothing of what
    // lies behind.
    for number in [102, 107, 0, 1, 77, N_FRAMES as i64 - 1] {
        assert_eq!(
            running.shown("north", number * FRAME_NANOS).unwrap(),
            (number as u64, number * FRAME_NANOS)
        );
    }
    let last = START.saturating_add_nanos((N_FRAMES as i64 - 1) * FRAME_NANOS);
    let gap = running.shown("north", N_FRAMES as i64 * FRAME_NANOS + 2_000_000_000).unwrap_err();
    assert!(matches!(gap, EngineError::Gap { before: Some(before), .. } if before == last), "{gap}");
    running.stop();
}

#[test]
fn a_live_camera_is_recorded_as_it_was_sent() {
    let server = RtspServer::start(0, &ball(320, 240), None);
    let folder = tempfile::tempdir().unwrap();
    let camera = format!("[[camera]]\nid = \"yard\"\n[camera.source]\nurl = \"{}\"\n", server.url());
    let mut running = start(folder.path(), &camera);
    // What was seen live: times, and pictures to the last bit.
    let luma = |seen: &Observation| {
        let plane = seen.frame.image.plane(0);
        (0..plane.height).flat_map(|y| plane.row(y).to_vec()).collect::<Vec<u8>>()
    };
    let mut seen = Vec::new();
    wait_for("four seconds of frames", || {
        if let Ok(newest) = running.handle.observation("yard", At::Live)
            && seen.last().is_none_or(|(at, _)| *at < newest.frame.timestamp)
        {
            seen.push((newest.frame.timestamp, luma(&newest)));
        }
        (seen.len() == 100).then_some(())
    });
    // On a busy machine the server's first key frame may be gone before it is asked to play: what comes before the next
    // is shown as far as it can be, and counted, but not recorded.
    let yard = CameraId::new("yard").unwrap();
    let before_all = Timestamp::from_nanos(0);
    let first = running.runtime.block_on(running.archive.next_segment(&yard, before_all)).unwrap().unwrap();
    let n_seen = seen.len();
    seen.retain(|(at, _)| *at >= first.first_at);
    let recorded = &running.archive.status().cameras[0];
    let (_, n_without_key) =
        recorded.dropped.iter().find(|(reason, _)| *reason == RecordingDrop::NoKeyFrame).unwrap();
    assert!((n_seen - seen.len()) as u64 <= *n_without_key && seen.len() > 50, "{recorded:?}");
    // Memory holds about a second of it; what lies before was written, if not yet synced to the disk.
    for (at, expected) in &seen {
        let again = running.handle.observation("yard", At::Time(*at)).unwrap();
        assert_eq!((again.frame.timestamp, luma(&again) == *expected), (*at, true), "{recorded:?}");
    }
    running.stop();
    drop(server);
    let mut running = start(folder.path(), &camera);
    for (at, expected) in &seen {
        let again = running.handle.observation("yard", At::Time(*at)).unwrap();
        assert_eq!(again.frame.timestamp, *at);
        assert!(luma(&again) == *expected, "another picture of {at}");
    }
    running.stop();
}
