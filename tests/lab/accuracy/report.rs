//! A small sweep of the plaza, from the world to the files.

use std::sync::atomic::{AtomicU32, Ordering};
use tempfile::TempDir;
use videofields::accuracy::{Gate, Scope, Stage, Stopwatch, machine, sweep_gated};
use videofields_lab::report::{Report, SubjectReport};
use videofields_lab::worlds::{prepare, sweep};
use videofields_simulate::World;
use videofields_testing::adapter;
use videofields_vision::clock::SystemClock;

const SCOPE: Scope = Scope {
    size_px: (160, 90),
    n_frames: 4,
    max_cameras: 2,
    samples_per_side: 1,
    view_size_px: (64, 36),
    n_views: 1,
    n_moments: 1,
    n_map_builds: 1,
    max_grid_points: 100_000,
    max_pipelines: 3,
    ..Scope::QUICK
};

fn subject() -> SubjectReport {
    let text = |text: &str| text.to_owned();
    SubjectReport { kind: text("world"), id: text("plaza"), truth: text("exact"), scope: SCOPE.told() }
}

#[test]
fn a_sweep_becomes_json_csv_and_a_page_that_loads_nothing() {
    if adapter("").is_none() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let found = sweep(&World::named("plaza").unwrap(), &SCOPE, &Stage::ALL, &SystemClock::new(), &|_step| {})
        .unwrap();
    let report = Report::new(subject(), machine(&found.adapter), &found, "now".to_owned(), 1.0);
    assert!(report.is_complete);
    let names: Vec<&str> = report.stages.iter().map(|stage| stage.name.as_str()).collect();
    assert_eq!(names, Stage::ALL.map(Stage::name));
    for stage in &report.stages {
        let mut knobs: Vec<&str> = stage.rows.iter().map(|row| row.knob.as_str()).collect();
        knobs.dedup();
        for knob in knobs {
            let defaults = stage.rows.iter().filter(|row| row.knob == knob && row.is_default).count();
            assert_eq!(defaults, 1, "{} {knob}", stage.name);
        }
    }
    // Every pipeline on the front is none that another beats; the knee is one of them.
    let pipelines = &report.stage(Stage::Pipeline).unwrap().rows;
    assert!((1..=SCOPE.max_pipelines).contains(&pipelines.len()), "{}", pipelines.len());
    for name in &report.front {
        let own = pipelines.iter().find(|row| row.value == *name).unwrap();
        let beats = |row: &&videofields_picture::plan::CostRow| {
            row.time_ms.median < own.time_ms.median && row.error < own.error
        };
        assert!(!pipelines.iter().any(|row| beats(&row)), "{name}");
    }
    assert!(report.front.contains(report.knee.as_ref().unwrap()));
    // What the bounds leave out is said.
    let is_left_out = |stage: &str, value: &str| {
        report.skipped.iter().any(|skipped| skipped.stage == stage && skipped.value.starts_with(value))
    };
    assert!(is_left_out("map", "grid 0.01 m"), "{:?}", report.skipped);
    // The machine's times decide how many pipelines there are, but each of them has two surfaces. A bound that is odd leaves
    // out at least one where there are more than two.
    let n_left_out = report.skipped.iter().filter(|skipped| skipped.stage == "pipeline").count();
    assert_eq!((pipelines.len() + n_left_out) % 2, 0, "{pipelines:?} {:?}", report.skipped);

    let written = report.write(folder.path(), &found.examples).unwrap();
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    let files: Vec<_> = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(
        files,
        [
            "report.json",
            "segmentation.csv",
            "map.csv",
            "placing.csv",
            "surfaces.csv",
            "entities.csv",
            "pipeline.csv",
            "index.html"
        ]
    );
    assert_eq!(serde_json::from_str::<Report>(&text("report.json")).unwrap(), report);
    for stage in &report.stages {
        assert_eq!(text(&format!("{}.csv", stage.name)).lines().count(), stage.rows.len() + 1);
    }
    let page = text("index.html");
    assert!(page.len() < 2_000_000, "{} bytes", page.len());
    // Nothing is fetched from anywhere.
    for loader in ["<script", "<link", "src=\"http", "url(", "@import"] {
        assert!(!page.contains(loader), "{loader}");
    }
    assert_eq!(page.matches("<svg").count(), 7, "a figure for every stage, two for the entities");
    assert_eq!(
        page.matches("data:image/jpeg;base64,").count(),
        12,
        "four pictures, their truth and difference"
    );
    for expected in ["Grid against ray map", "Early against deferred pruning", "knee", &found.adapter] {
        assert!(page.contains(expected), "{expected}");
    }
    // Which pipelines beat which is a matter of times; where none is beaten, one series needs no legend.
    assert_eq!(page.contains("Pareto front"), report.front.len() < pipelines.len());
}

/// Lets some steps through.
struct Steps(AtomicU32);

impl Gate for Steps {
    fn enter(&self) -> bool {
        self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_ok()
    }
}

#[test]
fn a_sweep_that_is_ended_keeps_what_it_has() {
    let clock = SystemClock::new();
    let ended = |n_steps| {
        let gate = Steps(AtomicU32::new(n_steps));
        let watch = Stopwatch::new(&clock, &gate);
        let prepared = || prepare(&World::named("plaza").unwrap(), &SCOPE, &watch, &|_step| {});
        sweep_gated(&prepared, &SCOPE, &[Stage::Segmentation], &watch, &|_step| {}).unwrap()
    };
    let nothing = ended(0);
    assert!(nothing.rows.is_empty() && !nothing.is_complete);
    // Casting takes 2 cameras of 1 + 4 steps and 1 view of 3; the seven forms take turns at 4 frames that are learned
    // and 4 that are judged, for each camera.
    assert!(ended(13 + 7 * 4 + 7).rows.is_empty(), "one time each is too little");
    let some = ended(13 + 7 * 8 + 20);
    assert_eq!((some.rows.len(), some.is_complete), (9, false));
    assert!(ended(10_000).is_complete);
}
