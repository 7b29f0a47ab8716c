//! Decoding processes that are killed while cameras are recorded.

use super::*;
use rustix::process::{Pid, Signal, kill_process};
use std::time::Duration;
use videofields_recording::media::{Decoder, Input};
use videofields_service::engine::CameraSummary;

const CAMERAS: [&str; 4] = ["north", "east", "south", "west"];

fn camera(running: &Running, id: &str) -> CameraSummary {
    running.handle.cameras().into_iter().find(|camera| camera.id.as_str() == id).unwrap()
}

/// Decodes everything in a file, and counts its pictures.
fn n_decoded(bytes: Vec<u8>) -> u64 {
    let mut decoder = Decoder::start(Input::stream(std::io::Cursor::new(bytes)), None).unwrap();
    let mut n_pictures = 0;
    while !decoder.has_ended() {
        n_pictures += u64::from(decoder.pull(Duration::from_millis(100)).is_some());
        let fault = decoder.fault();
        assert!(fault.is_none(), "{fault:?}");
    }
    n_pictures
}

/// With `VIDEOFIELDS_KILLS` so many; prints how long cameras were away.
#[test]
fn a_decoding_process_that_is_killed_takes_nothing_with_it_but_a_moment_of_its_camera() {
    let n_kills: usize = std::env::var("VIDEOFIELDS_KILLS").map_or(6, |n| n.parse().unwrap());
    let servers = CAMERAS.map(|_| RtspServer::start(0, &ball(320, 240), None));
    let folder = tempfile::tempdir().unwrap();
    let section = |(id, server): (&&str, &RtspServer)| {
        format!("[[camera]]\nid = \"{id}\"\n[camera.source]\nurl = \"{}\"\n", server.url())
    };
    let cameras: String = CAMERAS.iter().zip(&servers).map(section).collect();
    let mut running = start(folder.path(), &cameras);
    let is_live = |id: &str| camera(&running, id).state == "live";
    wait_for("all cameras", || CAMERAS.iter().all(|id| is_live(id)).then_some(()));
    let clock = SystemClock::new();
    let mut away = Vec::new();
    for kill in 0..n_kills {
        // Moments that no rhythm of cameras or segments shares.
        clock.sleep(Duration::from_millis(300 + (kill as u64 * 7919) % 1400));
        let id = CAMERAS[kill * 7 % 4];
        let live = |camera: &CameraSummary| camera.state == "live";
        let before = wait_for("the camera", || Some(camera(&running, id)).filter(live));
        let others = CAMERAS.iter().filter(|other| **other != id);
        let others: Vec<_> = others.map(|other| camera(&running, other)).collect();
        let process_id = i32::try_from(before.decoding.unwrap().process_id).unwrap();
        let killed_at = clock.monotonic();
        kill_process(Pid::from_raw(process_id).unwrap(), Signal::KILL).unwrap();
        let failed = wait_for("its failure", || {
            let now = camera(&running, id);
            (now.state != "live" || now.retries > before.retries).then_some(now)
        });
        let reason = failed.reason.unwrap_or_default();
        assert!(reason.contains("signal 9") && reason.contains("decoding process"), "{reason}");
        wait_for("its return", || {
            let now = camera(&running, id);
            (now.state == "live" && now.frames > before.frames).then_some(())
        });
        away.push((clock.monotonic() - killed_at).as_secs_f64());
        for other in others {
            let now = camera(&running, other.id.as_str());
            assert_eq!((now.state.as_str(), now.retries - other.retries), ("live", 0), "{}", other.id);
        }
    }
    away.sort_by(f64::total_cmp);
    #[expect(clippy::print_stdout, reason = "a person runs it to see this")]
    {
        println!(
            "away for {:.2} s in the middle, {:.2} s at most",
            away[away.len() / 2],
            away[away.len() - 1]
        );
    }
    let archive = Arc::clone(&running.archive);
    running.stop();
    drop(servers);
    let store = running.runtime.block_on(Store::open(&folder.path().join("v.sqlite"))).unwrap();
    let (from, to) = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
    for status in &archive.status().cameras {
        let rows = running.runtime.block_on(store.segments(&status.camera, from, to)).unwrap();
        let n_indexed: u64 = rows.iter().map(|row| row.n_frames).sum();
        assert!(n_indexed > 0);
        assert_eq!(n_indexed, status.n_frames, "{}", status.camera);
        for row in rows {
            let bytes = std::fs::read(folder.path().join("recorded").join(&row.path)).unwrap();
            assert_eq!(n_decoded(bytes), row.n_frames, "{row:?}");
        }
    }
}
