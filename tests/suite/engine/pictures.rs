//! Pictures asked for by many at once: shared, kept, refused in time, and drawn again after the device is lost.

use super::{Bench, FRAME_NANOS, SCENE, at, camera, has_adapter, named, pictures, request};
use glam::DVec3;
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;
use tokio::sync::oneshot;
use videofields_picture::plan::{Colors, EntityStyle, Plan, Reason};
use videofields_service::engine::{At, Door, EngineError, Flow, Origin, ViewAnswer, ViewKind, ViewRequest};
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{End, RenderSettings, Settings};
use videofields_vision::error::ErrorKind;

/// Longer than anything here may take, short of hanging.
const BOUNDED: Duration = Duration::from_secs(60);

/// Both cameras of the yard, at the end of their clips.
fn yard(folder: &TempDir, render: RenderSettings) -> Bench {
    let camera =
        ["north", "south"].map(|id| camera(id, pictures(folder.path(), id, 0..20), End::Stop)).to_vec();
    let bench =
        Bench::start(folder.path(), Settings { camera, render, ..Settings::default() }, &[("yard", SCENE)]);
    bench.wait_for_state("north", "ended");
    bench.wait_for_state("south", "ended");
    bench
}

fn still(width_px: u32) -> ViewRequest {
    ViewRequest { width_px, ..request("yard", at(FRAME_NANOS * 10)) }
}

type Asked = oneshot::Receiver<Result<ViewAnswer, EngineError>>;

fn ask(bench: &Bench, request: ViewRequest) -> Result<Asked, EngineError> {
    let (reply, answer) = oneshot::channel();
    Door::view(&*bench.handle, request, Flow::Common.into(), reply).map(|()| answer)
}

/// The answer, which must come in bounded time.
fn answered(bench: &Bench, asked: Asked) -> Result<ViewAnswer, EngineError> {
    bench.runtime.block_on(async { tokio::time::timeout(BOUNDED, asked).await.expect("no hang").unwrap() })
}

/// A counter's value.
fn counted(bench: &Bench, name: &str) -> u64 {
    let text = bench.handle.metrics_text().unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(&format!("videofields_{name} ")));
    line.unwrap_or_else(|| panic!("no {name} in\n{text}")).parse().unwrap()
}

fn stages(answer: &ViewAnswer) -> Vec<&'static str> {
    answer.timings.iter().map(|(stage, _)| *stage).collect()
}

#[test]
fn a_wall_that_asks_fifteen_times_is_drawn_for_once() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder, RenderSettings { queue_length: 8, ..RenderSettings::default() });
    let first = ask(&bench, still(64)).unwrap();
    let wall: Vec<Asked> = (0..15)
        .flat_map(|idx| {
            // Others ask between, and some name what the others leave open.
            let own = ViewRequest { effort: named(Some(4), None), ..still(40) };
            let other = (idx % 5 == 0).then(|| ask(&bench, still(41 + idx)).unwrap());
            let same = if idx % 2 == 0 { still(40) } else { own };
            [Some(ask(&bench, same).unwrap()), other]
        })
        .flatten()
        .collect();
    answered(&bench, first).unwrap();
    let answers: Vec<ViewAnswer> = wall.into_iter().map(|asked| answered(&bench, asked).unwrap()).collect();
    let wall: Vec<&ViewAnswer> = answers.iter().filter(|answer| answer.image.width == 40).collect();
    assert_eq!((wall.len(), answers.len()), (15, 18));
    assert!(wall.iter().all(|answer| Arc::ptr_eq(&answer.image, &wall[0].image)), "one drawing");
    assert!(wall.iter().all(|answer| answer.timings[0].0 == "wait"));
    assert_eq!(counted(&bench, "render_cache_misses_total"), 5);
    let n_not_drawn = counted(&bench, "render_shared_total") + counted(&bench, "render_cache_hits_total");
    assert_eq!(n_not_drawn, 14);
    assert_eq!(counted(&bench, "render_queue_length"), 0);
    bench.stop();
}

#[test]
fn a_picture_that_is_kept_is_shown_again_without_being_drawn() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder, RenderSettings::default());
    let one = bench.view(still(40)).unwrap();
    assert_eq!(
        (one.origin, &stages(&one)[..5]),
        (Origin::Drawn, &["wait", "resolve", "fuse", "plan", "render"][..])
    );
    let other = bench.view(still(50)).unwrap();
    assert_eq!(other.origin, Origin::Drawn);
    let again = bench.view(still(40)).unwrap();
    assert_eq!((again.origin, stages(&again)), (Origin::Kept, vec!["wait", "resolve"]));
    assert!(Arc::ptr_eq(&one.image, &again.image));
    assert_eq!((again.instant, &again.sources, &again.plan), (one.instant, &one.sources, &one.plan));
    assert_eq!(counted(&bench, "render_cache_hits_total"), 1);
    assert!(counted(&bench, "render_cache_bytes") > u64::from(40 * 30 * 3 + 50 * 30 * 3_u32));
    bench.stop();

    let folder = TempDir::new().unwrap();
    let bench = yard(&folder, RenderSettings { cache_mib: 0, ..RenderSettings::default() });
    let origins = [40, 40].map(|width| bench.view(still(width)).unwrap().origin);
    assert_eq!((origins, counted(&bench, "render_cache_bytes")), ([Origin::Drawn; 2], 0));
    bench.stop();
}

#[test]
fn a_frame_that_comes_late_is_shown_and_not_the_picture_without_it() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let camera = vec![camera("south", pictures(folder.path(), "south", 0..30), End::Loop)];
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &[("yard", SCENE)]);
    let newest = || bench.handle.observation("south", At::Live).ok().map(|seen| seen.frame.timestamp);
    // The renderer's first picture takes its time.
    wait_for("a frame", newest);
    bench.view(request("yard", At::Live)).unwrap();
    let shown_at = |answer: &ViewAnswer| answer.sources[0].timestamp;
    // Of an instant that is still to come the frame nearest so far is shown.
    let (soon, early) = wait_for("a picture in time", || {
        let soon = newest()?.saturating_add_nanos(20 * FRAME_NANOS);
        let early = bench.view(ViewRequest { width_px: 20, ..request("yard", At::Time(soon)) }).ok()?;
        (shown_at(&early) < soon.saturating_add_nanos(-FRAME_NANOS)).then_some((soon, early))
    });
    wait_for("its frame", || newest().filter(|newest| *newest > soon.saturating_add_nanos(FRAME_NANOS)));
    let asked = || bench.view(ViewRequest { width_px: 20, ..request("yard", At::Time(soon)) }).unwrap();
    let late = asked();
    assert_eq!(late.origin, Origin::Drawn);
    // A busy machine leaves frames out.
    let nearest = bench.handle.observation("south", At::Time(soon)).unwrap().frame.timestamp;
    let away = |answer: &ViewAnswer| shown_at(answer).nanos_since(soon).abs();
    assert_eq!(shown_at(&late), nearest);
    assert!(away(&late) < away(&early), "{:?} {:?}", early.sources, late.sources);
    assert!(!Arc::ptr_eq(&early.image, &late.image));
    assert_eq!(asked().origin, Origin::Kept, "what has settled is kept");
    bench.stop();
}

#[test]
fn two_views_of_an_instant_upload_nothing_twice() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder, RenderSettings::default());
    let from = |eye| ViewRequest { eye: Some(eye), ..still(40) };
    let first = bench.view(from(DVec3::new(7.0, -7.0, 5.0))).unwrap();
    if !stages(&first).contains(&"surface") {
        // A device that tells no times.
        return;
    }
    assert!(stages(&first).contains(&"yuv"), "{:?}", first.timings);
    let eyes = [DVec3::new(-7.0, -6.0, 4.0), DVec3::new(1.0, -9.0, 7.0)];
    let kinds = [ViewKind::Perspective, ViewKind::Map { across_m: None, heading_rad: 0.0 }];
    for (eye, kind) in eyes.into_iter().flat_map(|eye| kinds.map(|kind| (eye, kind))) {
        let other = bench.view(ViewRequest { kind, ..from(eye) }).unwrap();
        let plans = [&first, &other].map(|answer| {
            let mut cameras = answer.plan.surface_cameras.clone();
            cameras.sort_unstable();
            cameras
        });
        assert_eq!(plans[0], plans[1], "both show both cameras");
        if other.origin == Origin::Drawn {
            assert!(!stages(&other).contains(&"yuv"), "{:?}", other.timings);
        }
    }
    let later = bench.view(ViewRequest { at: at(FRAME_NANOS * 15), ..still(40) }).unwrap();
    assert!(stages(&later).contains(&"yuv"), "another instant is uploaded: {:?}", later.timings);
    bench.stop();
}

#[test]
fn fifty_requests_survive_the_loss_of_the_device() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let render = RenderSettings { queue_length: 50, ..RenderSettings::default() };
    let bench = yard(&folder, render);
    bench.view(still(40)).unwrap();
    let clock = SystemClock::new();
    // Once while much is drawn, and again right after the first of it came.
    for round in 0..3 {
        let asked: Vec<Asked> =
            (0..50).map(|idx| ask(&bench, still(300 + round * 50 + idx)).unwrap()).collect();
        let mut asked = asked.into_iter();
        if round > 0 {
            answered(&bench, asked.next().unwrap()).unwrap();
        }
        assert!(bench.engine.lose_device(), "there is a device to lose");
        let mut n_drawn = 0;
        for asked in asked {
            match answered(&bench, asked) {
                Ok(answer) => n_drawn += usize::from(answer.image.height == 30),
                Err(error) => {
                    assert_eq!(error.kind(), ErrorKind::Unavailable, "{error}");
                    assert!(error.retry_after().is_some(), "{error}");
                }
            }
        }
        assert!(n_drawn > 0, "what met the loss is drawn on the new device");
        let next = wait_for("the next picture", || bench.view(still(20 + round)).ok());
        assert_eq!(next.image.width, 20 + round);
    }
    assert!(counted(&bench, "render_devices_rebuilt_total") >= 3);
    assert!(bench.handle.readiness().ready);
    assert!(clock.monotonic() < BOUNDED, "{:?}", clock.monotonic());
    bench.stop();
}

#[test]
fn what_is_drawn_for_too_long_is_refused_in_time() {
    let Some(gpu) = videofields_testing::adapter("") else { return };
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder, RenderSettings { timeout_secs: 0.1, ..RenderSettings::default() });
    let small = wait_for("a picture", || bench.view(still(40)).ok());
    assert_eq!(small.image.width, 40);
    let clock = SystemClock::new();
    let huge = ViewRequest { width_px: 7680, height_px: 4320, ..still(40) };
    let asked = [ask(&bench, huge).unwrap(), ask(&bench, still(41)).unwrap()];
    let told = asked.map(|asked| answered(&bench, asked));
    let took = clock.monotonic();
    for error in told.iter().filter_map(|told| told.as_ref().err()) {
        assert!(matches!(error, EngineError::Late { .. }), "{error}");
        assert!(error.to_string().contains("no picture within 0.1 s"), "{error}");
        assert!(error.retry_after().is_some());
    }
    if gpu.is_software() {
        // The small one behind it waits for a piece of it alone, and may be there in time.
        assert!(told[0].is_err(), "33 million pixels take a processor longer");
        assert!(took < Duration::from_secs(5), "{took:?}: not after the drawing, but at the deadline");
    }
    // The render thread goes on with what comes after.
    let next = wait_for("the next picture", || bench.view(still(42)).ok());
    assert_eq!(next.image.width, 42);
    bench.stop();
}

#[test]
fn without_a_gpu_views_are_refused_and_plans_are_made() {
    let folder = TempDir::new().unwrap();
    let render = RenderSettings { adapter: "no such adapter".to_owned(), ..RenderSettings::default() };
    let bench = yard(&folder, render);
    let clock = SystemClock::new();
    let error = bench.view(still(40)).unwrap_err();
    assert!(matches!(error, EngineError::NoRenderer { .. }), "{error}");
    assert!(error.to_string().contains("no such adapter"), "{error}");
    let retry_after = error.retry_after().unwrap();
    assert!(retry_after > Duration::ZERO && retry_after <= Duration::from_secs(10), "{retry_after:?}");
    assert!(clock.monotonic() < Duration::from_secs(10), "refused at once");
    assert!(!bench.handle.readiness().ready);

    let planned = bench.handle.plan(&still(40)).unwrap();
    let mut cameras: Vec<&str> = planned.surface_cameras.iter().map(|id| id.as_str()).collect();
    cameras.sort_unstable();
    assert_eq!(cameras, ["north", "south"]);
    assert_eq!((planned.size_px, planned.n_parts), ([40, 30], 1));
    assert_eq!(planned.instant, Timestamp::from_nanos(FRAME_NANOS * 10));
    let sources: Vec<_> = planned.sources.iter().map(|of| (of.camera.as_str(), of.timestamp)).collect();
    assert_eq!(sources, [("north", planned.instant), ("south", planned.instant)]);
    assert!(planned.gaps.is_empty() && planned.depth_map_cameras.is_empty());
    assert!(planned.reasons.iter().any(|reason| reason.effect == "surface" && reason.is_on));
    for entity in &planned.entities {
        assert!(
            entity.foot_in_world.is_finite() && entity.seen_by.contains(&entity.shown_from),
            "{entity:?}"
        );
        assert!(planned.entity_cameras.contains(&entity.shown_from));
    }
    assert_eq!(planned.entities.is_empty(), planned.style == EntityStyle::None);
    // What is wrong is wrong without a device too.
    let check = |request: ViewRequest, kind: ErrorKind, place: &str| {
        let error = bench.handle.plan(&request).unwrap_err();
        assert_eq!(error.kind(), kind, "{error}");
        assert_eq!(error.fault().map_or("", |fault| fault.place.as_str()), place, "{error}");
        assert_eq!(bench.view(request).unwrap_err().to_string(), error.to_string());
    };
    check(ViewRequest { width_px: 0, ..still(40) }, ErrorKind::Invalid, "width");
    check(ViewRequest { width_px: 65_535, height_px: 65_535, ..still(40) }, ErrorKind::TooLarge, "width");
    check(ViewRequest { eye: Some(DVec3::NAN), ..still(40) }, ErrorKind::Invalid, "eye");
    check(request("street", At::Live), ErrorKind::NotFound, "");
    check(request("yard", at(-2_000_000_000)), ErrorKind::NotFound, "");
    bench.stop();
}

#[test]
fn a_plan_says_what_its_picture_does() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder, RenderSettings::default());
    for style in [EntityStyle::Billboards, EntityStyle::Points, EntityStyle::None] {
        let request = ViewRequest { style, kind: ViewKind::Orthographic { across_m: None }, ..still(40) };
        let planned = bench.handle.plan(&request).unwrap();
        let drawn = bench.view(request).unwrap();
        assert_eq!((planned.kind, planned.view), (drawn.kind, drawn.view), "also what was left open");
        assert_eq!((planned.instant, &planned.sources), (drawn.instant, &drawn.sources));
        assert_eq!((&planned.reasons, planned.settings.sampling), (&drawn.plan.reasons, drawn.plan.sampling));
        assert_eq!(
            (planned.style, planned.entities.len()),
            (drawn.plan.entities, drawn.plan.billboards.len())
        );
    }
    bench.stop();
}

/// Both cameras of the yard, the southern one a stop darker.
fn unequal_yard(folder: &TempDir) -> Bench {
    let camera =
        ["north", "south"].map(|id| camera(id, pictures(folder.path(), id, 0..20), End::Stop)).to_vec();
    for number in 0..20 {
        let file = folder.path().join(format!("south/in{number:04}.png"));
        let mut picture = image::open(&file).unwrap().into_luma8();
        picture.iter_mut().for_each(|code| *code = (f32::from(*code) * 0.73) as u8);
        picture.save(&file).unwrap();
    }
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &[("yard", SCENE)]);
    bench.wait_for_state("north", "ended");
    bench.wait_for_state("south", "ended");
    bench
}

fn exposure(reasons: &[Reason]) -> (bool, &str) {
    let reason = reasons.iter().find(|reason| reason.effect == "exposure").unwrap();
    (reason.is_on, &reason.because)
}

#[test]
fn colours_are_evened_unless_they_are_asked_for_as_they_are() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = unequal_yard(&folder);
    let raw_request = ViewRequest { colors: Colors::Raw, ..still(40) };
    let even = bench.view(still(40)).unwrap();
    let raw = bench.view(raw_request.clone()).unwrap();
    let of = |plan: &Plan| (plan.evens_colors, exposure(&plan.reasons).0);
    assert_eq!((of(&even.plan), of(&raw.plan)), ((true, true), (false, false)), "{:?}", even.plan);
    assert_eq!((even.origin, raw.origin), (Origin::Drawn, Origin::Drawn), "not the same picture");
    assert_ne!(even.image.data, raw.image.data);
    // What is kept of each is its own.
    let again = [still(40), raw_request.clone()].map(|request| bench.view(request).unwrap().image);
    assert!(Arc::ptr_eq(&again[0], &even.image) && Arc::ptr_eq(&again[1], &raw.image));
    // A plan alone says the same.
    let planned = bench.handle.plan(&still(40)).unwrap();
    assert_eq!(exposure(&planned.reasons), exposure(&even.plan.reasons));
    let planned = bench.handle.plan(&raw_request).unwrap();
    assert_eq!(exposure(&planned.reasons), (false, "asked for as they are"));
    bench.stop();
}
