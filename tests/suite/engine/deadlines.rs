//! Pictures by preset and by deadline: what is chosen, what is told, what is refused.

use super::{Bench, FRAME_NANOS, SCENE, at, camera, has_adapter, pictures, request};
use std::time::Duration;
use tempfile::TempDir;
use videofields_picture::plan::{
    Aim, Basis, COST_TABLE_VERSION, CostTable, Deadline, Detail, Effort, Machine, Named, Preset,
};
use videofields_service::engine::{At, EngineError, Origin, ViewAnswer, ViewRequest};
use videofields_vision::config::{CameraSettings, End, Settings};
use videofields_vision::error::ErrorKind;

fn yard(folder: &TempDir) -> Bench {
    let camera =
        ["north", "south"].map(|id| camera(id, pictures(folder.path(), id, 0..20), End::Stop)).to_vec();
    let bench = Bench::start(folder.path(), Settings { camera, ..Settings::default() }, &[("yard", SCENE)]);
    bench.wait_for_state("north", "ended");
    bench.wait_for_state("south", "ended");
    bench
}

/// What a live picture of 640 x 360 is expected to take, milliseconds.
fn expected_ms(bench: &Bench) -> f64 {
    let live = ViewRequest {
        at: At::Live,
        width_px: 640,
        height_px: 360,
        ..still(Aim::default(), Named::default())
    };
    bench.handle.plan(&live).unwrap().expected.unwrap().forecast.median_ms
}

/// A daemon that has drawn nothing refused every deadline that its first picture could not keep, and so never drew one.
#[test]
fn a_scene_is_made_ready_before_anybody_asks() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let camera =
        ["north", "south"].map(|id| camera(id, pictures(folder.path(), id, 0..20), End::Stop)).to_vec();
    let settings = |camera: &[CameraSettings]| Settings { camera: camera.to_vec(), ..Settings::default() };
    let asked = Bench::start(folder.path(), settings(&camera), &[("yard", SCENE)]);
    for id in ["north", "south"] {
        asked.wait_for_state(id, "ended");
    }
    let cold_ms = expected_ms(&asked);
    asked.stop();

    let bench = Bench::start_as_set(folder.path(), settings(&camera), &[("yard", SCENE)]);
    for id in ["north", "south"] {
        bench.wait_for_state(id, "ended");
    }
    let is_ready = || bench.handle.metrics_text().unwrap().contains("videofields_render_warm_ups_total 1");
    super::wait_for("the scene to be ready", || is_ready().then_some(()));
    let text = bench.handle.metrics_text().unwrap();
    assert!(text.contains("videofields_render_picture_seconds_count 0"), "nobody asked: {text}");
    let warm_ms = expected_ms(&bench);
    assert!(warm_ms < cold_ms, "{warm_ms} ms after making ready, {cold_ms} before");
    bench.stop();
}

fn still(aim: Aim, named: Named) -> ViewRequest {
    ViewRequest { effort: Effort { aim, named }, ..request("yard", at(FRAME_NANOS * 10)) }
}

fn within(millis: u64) -> Aim {
    Aim::Within(Deadline { total: Duration::from_millis(millis), reserve: Duration::ZERO })
}

fn drawn(bench: &Bench, request: ViewRequest) -> ViewAnswer {
    bench.view(request).unwrap()
}

#[test]
fn presets_and_what_is_named_beside_them_are_drawn_and_told() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder);
    for (_, preset) in Preset::ALL {
        let answer = drawn(&bench, still(Aim::Preset(preset), Named::default()));
        assert_eq!(answer.settings, preset.settings(4), "{preset:?}");
        assert_eq!((answer.image.width, answer.image.height), (40, 30));
        assert_eq!(answer.plan.sampling, answer.settings.sampling);
        let expected = answer.expected.unwrap();
        assert!(expected.forecast.median_ms > 0.0 && expected.error.is_none());
        assert_eq!(expected.forecast.basis, Basis::Guess, "nothing was measured");
    }
    let named = Named { samples: Some(4), resolution: Some(Detail::Whole), ..Named::default() };
    let answer = drawn(&bench, still(Aim::Preset(Preset::Draft), named));
    assert_eq!((answer.settings.sampling.samples, answer.settings.resolution), (4, Detail::Whole));
    assert_eq!(answer.settings.sources, 1, "the rest is the preset's");
    // The same picture by another name is kept; another knob is another picture.
    let balanced = drawn(&bench, still(Aim::Preset(Preset::Balanced), Named::default()));
    assert_eq!(balanced.origin, Origin::Kept);
    let named = Named { supersampling: Some(2), samples: Some(4), ..Named::default() };
    let exact = drawn(&bench, still(Aim::Preset(Preset::Balanced), named));
    assert_eq!(exact.origin, Origin::Kept, "as exact has it");
    bench.stop();
}

#[test]
fn a_deadline_is_met_told_and_refused_with_the_least_that_is_possible() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder);
    let plenty = drawn(&bench, still(within(8_000), Named::default()));
    assert_eq!(plenty.settings, Preset::Exact.settings(4), "there is time for everything");
    assert!(plenty.expected.unwrap().deadline.is_some());
    let again = drawn(&bench, still(within(8_000), Named::default()));
    assert_eq!((again.origin, again.settings), (Origin::Kept, plenty.settings));
    let exact = drawn(&bench, still(Aim::Preset(Preset::Exact), Named::default()));
    assert_eq!(exact.origin, Origin::Kept, "a deadline's picture is kept under what was chosen");
    // What is named is not chosen.
    let named = Named { resolution: Some(Detail::Quarter), most_cameras: Some(1), ..Named::default() };
    let cheap = drawn(&bench, still(within(8_000), named));
    assert_eq!((cheap.settings.resolution, cheap.settings.most_cameras), (Detail::Quarter, 1));
    assert_eq!(cheap.plan.most_cameras_a_pixel, 1);

    let total = Duration::from_millis(1);
    let none_left = Aim::Within(Deadline { total, reserve: total });
    let error = bench.view(still(none_left, Named::default())).unwrap_err();
    // By itself it takes longer; or it would not, and something was before it.
    match &error {
        EngineError::TooLarge(fault) => assert_eq!(fault.place, "deadline_ms", "{error}"),
        EngineError::Crowded { .. } | EngineError::Late { .. } => {
            assert_eq!(error.kind(), ErrorKind::Unavailable);
        }
        other => panic!("{other}"),
    }
    let text = bench.handle.metrics_text().unwrap();
    assert!(text.contains("videofields_render_expected_ratio_count"), "{text}");
    bench.stop();
}

#[test]
fn a_plan_says_what_a_deadline_would_choose() {
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder);
    let planned = bench.handle.plan(&still(within(9_000), Named::default())).unwrap();
    assert_eq!(planned.settings, Preset::Exact.settings(4));
    let expected = planned.expected.unwrap();
    assert!(expected.forecast.upper_ms >= expected.forecast.median_ms && expected.forecast.median_ms > 0.0);
    let reserve = Duration::from_secs(20);
    let aim = Aim::Within(Deadline { total: Duration::from_secs(9), reserve });
    let error = bench.handle.plan(&still(aim, Named::default())).unwrap_err();
    assert_eq!((error.kind(), error.fault().unwrap().place.as_str()), (ErrorKind::TooLarge, "deadline_ms"));
    bench.stop();
}

#[test]
fn a_table_of_another_machine_tells_nothing() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let bench = yard(&folder);
    let machine = Machine {
        processor: "another".to_owned(),
        n_processors: 512,
        adapter: "another".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        build: "release".to_owned(),
    };
    let table = CostTable {
        version: COST_TABLE_VERSION,
        machine,
        subject: "world plaza".to_owned(),
        measured_at: String::new(),
        took_secs: 1.0,
        is_complete: true,
        rows: Vec::new(),
    };
    bench.engine.accuracy_board().put(table);
    let live = ViewRequest { at: At::Live, ..still(Aim::default(), Named::default()) };
    let expected = drawn(&bench, live).expected.unwrap();
    assert_eq!((expected.forecast.basis, expected.error), (Basis::Guess, None));
    bench.stop();
}
