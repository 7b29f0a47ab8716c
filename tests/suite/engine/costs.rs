//! The daemon's own table of costs: made beside a running engine, kept, found again, made anew when asked for.

use super::*;
use videofields::accuracy::{Keeper, KeeperSettings, Scope, Stage};
use videofields_service::engine::{AccuracyState, AccuracyStatus};
use videofields_vision::config::RenderSettings;

/// A few small pictures: what is measured does not matter here, that it is does.
fn settings() -> KeeperSettings {
    let scope = Scope { size_px: (160, 90), n_frames: 4, max_cameras: 1, n_map_builds: 1, ..Scope::DAEMON };
    KeeperSettings {
        scope,
        stages: vec![Stage::Segmentation, Stage::Map],
        render: RenderSettings::default(),
        measures_at_start: true,
    }
}

fn keeper(bench: &Bench, settings: KeeperSettings) -> Keeper {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let runtime = bench.runtime.handle().clone();
    let board = bench.engine.accuracy_board();
    Keeper::start(settings, board, bench.store.clone(), runtime, clock).unwrap()
}

fn wait_for_table(bench: &Bench) -> AccuracyStatus {
    wait_for("the table of costs", || {
        let status = bench.handle.accuracy();
        assert_ne!(status.state, AccuracyState::Failed, "{:?}", status.reason);
        (status.state == AccuracyState::Measured).then_some(status)
    })
}

#[test]
fn costs_are_measured_once_kept_and_measured_anew_when_asked() {
    let folder = TempDir::new().unwrap();
    let start = || Bench::start(folder.path(), Settings::default(), &[("yard", SCENE)]);
    let clock = SystemClock::new();
    let patience = std::time::Duration::from_secs(5);

    let bench = start();
    assert_eq!(
        bench.handle.refresh_accuracy(None).unwrap_err().kind(),
        ErrorKind::Unavailable,
        "nobody measures"
    );
    assert_eq!(bench.handle.accuracy().state, AccuracyState::None);
    let first = keeper(&bench, settings());
    let measured = wait_for_table(&bench).table.unwrap();
    assert!(measured.is_complete, "{measured:?}");
    let rows = |stage: &str| measured.rows.iter().filter(|row| row.stage == stage).count();
    assert_eq!(rows("segmentation"), 9, "{measured:?}");
    assert!(rows("map") >= 4, "{measured:?}");
    for row in &measured.rows {
        assert!(row.time_ms.median > 0.0 && row.memory_bytes > 0, "{row:?}");
        assert!(row.error.is_some_and(f64::is_finite), "{row:?}");
    }
    for (stage, knob) in [("segmentation", "modes"), ("map", "builder")] {
        let is_default = |row: &&videofields_picture::plan::CostRow| {
            row.stage == stage && row.knob == knob && row.is_default
        };
        assert_eq!(measured.rows.iter().filter(is_default).count(), 1, "{stage} {knob}");
    }
    first.stop(&clock, patience);
    bench.stop();

    // The same machine after a restart: nothing is measured, until it is asked for.
    let bench = start();
    let second = keeper(&bench, settings());
    assert_eq!(wait_for_table(&bench).table.unwrap(), measured, "as it was kept");
    bench.handle.refresh_accuracy(None).unwrap();
    let status = wait_for("a newer table", || {
        let status = bench.handle.accuracy();
        let is_newer = status.table.as_ref().is_some_and(|table| table.measured_at != measured.measured_at);
        (status.state == AccuracyState::Measured && is_newer).then_some(status)
    });
    assert_eq!(status.table.unwrap().rows.len(), measured.rows.len());
    second.stop(&clock, patience);
    assert_eq!(bench.handle.refresh_accuracy(None).unwrap_err().kind(), ErrorKind::Unavailable);
    bench.stop();
}

#[test]
fn nothing_is_measured_where_it_is_switched_off() {
    let folder = TempDir::new().unwrap();
    let bench = Bench::start(folder.path(), Settings::default(), &[("yard", SCENE)]);
    let keeper = keeper(&bench, KeeperSettings { measures_at_start: false, ..settings() });
    keeper.stop(&SystemClock::new(), std::time::Duration::from_secs(5));
    assert_eq!(bench.handle.accuracy(), AccuracyStatus::default());
    bench.stop();
}
