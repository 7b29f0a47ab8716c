//! What pictures take and leave, learned from machines made up here, and what a deadline chooses by it.

use super::*;

const MACHINE_MS: [(Feature, f64); 7] = [
    (Feature::One, 4.0),
    (Feature::Drawn, 9.0),
    (Feature::Surface, 6.0),
    (Feature::Nearest, 2.0),
    (Feature::Bilinear, 5.0),
    (Feature::Levels, 8.0),
    (Feature::Finished, 3.0),
];

/// A survey of a picture that shows surfaces and some cameras, by numbers of its own.
fn survey(size_px: (u32, u32), n_cameras: usize) -> Survey {
    Survey::for_tests(size_px, n_cameras)
}

/// What a made-up machine takes for a work.
fn takes(work: &Work) -> StageTimes {
    let surface: f64 = MACHINE_MS[1..6].iter().map(|(feature, ms)| work.of(*feature) * ms).sum();
    let rest = work.of(Feature::One) * MACHINE_MS[0].1 + work.of(Feature::Finished) * MACHINE_MS[6].1;
    StageTimes::of(1.0, surface + rest, [("surface", surface)].into_iter())
}

fn pictures() -> Vec<Task> {
    let model = Model::default();
    let sizes = [(320, 180), (640, 360), (1280, 720), (800, 600), (1920, 1080)];
    let forms = candidates(EntityStyle::None, &Named::default());
    (0..120_usize)
        .map(|idx| {
            let survey = survey(sizes[idx % sizes.len()], 1 + idx % 6);
            model.task(&survey, &forms[(idx * 53) % forms.len()], Pending::default())
        })
        .collect()
}

fn learned(spoil: impl Fn(usize, f64) -> f64) -> Model {
    let mut model = Model::default();
    for round in 0..2 {
        for (idx, task) in pictures().iter().enumerate() {
            let expected = model.forecast(task).median_ms;
            let times = takes(&task.work);
            let factor = spoil(round * 1000 + idx, 1.0);
            let passes = [("surface", times.stage(TimedStage::Surface) * factor)];
            let whole = (times.sum() - 1.0) * factor;
            model.note(task, expected, StageTimes::of(1.0 * factor, whole, passes.into_iter()));
        }
    }
    model
}

/// Median relative error of a model for pictures of known programs.
fn error_of(model: &Model) -> f64 {
    let errors: Vec<f64> = pictures()
        .iter()
        .map(|task| {
            let took = takes(&task.work).sum();
            (model.forecast(task).median_ms - took).abs() / took
        })
        .collect();
    Spread::of(&errors).unwrap().median
}

#[test]
fn a_machine_is_learned_from_its_pictures() {
    let model = learned(|_, ms| ms);
    assert!(error_of(&model) < 0.05, "{}", error_of(&model));
    assert!(error_of(&Model::default()) > 0.2, "a guess is no machine");
    let task = &pictures()[3];
    assert_eq!(model.forecast(task).basis, Basis::Pictures);
    assert_eq!(Model::default().forecast(task).basis, Basis::Guess);
    let again = learned(|_, ms| ms);
    assert_eq!(model.forecast(task), again.forecast(task), "one history gives one model");
    let spread = model.ratios().unwrap();
    assert!((0.9..1.1).contains(&spread.median), "{spread:?}");
}

#[test]
fn one_outlier_of_a_hundred_times_does_not_spoil_it() {
    for factor in [100.0, 0.01] {
        let model = learned(|idx, ms| if idx == 1060 { ms * factor } else { ms });
        assert!(error_of(&model) < 0.08, "{factor}: {}", error_of(&model));
    }
}

#[test]
fn what_is_no_time_never_enters_the_model() {
    let clean = learned(|_, ms| ms);
    let mut model = clean.clone();
    let task = pictures()[5];
    for bad in [f64::NAN, f64::INFINITY, -3.0] {
        model.note(&task, 10.0, StageTimes::of(bad, 5.0, std::iter::empty()));
        model.note(&task, 10.0, StageTimes::of(1.0, bad, [("surface", bad)].into_iter()));
    }
    model.note(&task, 10.0, StageTimes::default());
    assert_eq!(model.forecast(&task), clean.forecast(&task));
    // What was expected may be no number either: the time still counts.
    model.note(&task, f64::NAN, takes(&task.work));
    assert!(model.forecast(&task).median_ms.is_finite());
    assert_eq!(model.ratios().unwrap().count, clean.ratios().unwrap().count);
}

#[test]
fn nothing_to_draw_takes_a_finite_time() {
    let model = learned(|_, ms| ms);
    for survey in [Survey::default(), survey((0, 0), 0), survey((1, 1), 0), survey((65_535, 65_535), 8)] {
        for settings in candidates(EntityStyle::Points, &Named::default()) {
            let task = model.task(&survey, &settings, Pending::default());
            let forecast = model.forecast(&task);
            assert!(forecast.median_ms.is_finite() && forecast.median_ms >= 0.0, "{settings:?}");
            assert!(forecast.upper_ms >= forecast.median_ms);
        }
    }
}

#[test]
fn a_program_that_was_never_drawn_with_takes_more_once() {
    const PROGRAM_MS: f64 = 120.0;
    let forms = candidates(EntityStyle::None, &Named::default());
    let task = |model: &Model, idx: usize| {
        let sizes = [(320, 180), (640, 360), (1280, 720)];
        let survey = survey(sizes[idx % 3], 1 + idx % 6);
        model.task(&survey, &forms[(idx * 53) % forms.len()], Pending::default())
    };
    let mut model = Model::default();
    for idx in 0..150 {
        // A device that is made anew now and then makes them again.
        if idx % 50 == 0 {
            model.forget_programs();
        }
        let task = task(&model, idx);
        let times = takes(&task.work);
        let making_ms = PROGRAM_MS * task.work.of(Feature::SurfacePrograms);
        let surface = times.stage(TimedStage::Surface) + making_ms;
        let whole = surface + times.stage(TimedStage::Rest);
        let expected = model.forecast(&task).median_ms;
        model.note(&task, expected, StageTimes::of(1.0, whole, [("surface", surface)].into_iter()));
    }
    let known = model.forecast(&task(&model, 149)).median_ms;
    let truth = takes(&task(&model, 149).work).sum();
    assert!((known / truth - 1.0).abs() < 0.2, "{known} for {truth}: all of its programs are there");
    model.forget_programs();
    let n_new = task(&model, 149).work.of(Feature::SurfacePrograms);
    let more = model.forecast(&task(&model, 149)).median_ms - known;
    assert!((more / (PROGRAM_MS * n_new) - 1.0).abs() < 0.2, "{more} for {n_new} of {PROGRAM_MS}");
}

/// The processor's rasteriser made all programs anew for another sampler: 0.8 s where 28 ms were expected.
#[test]
fn another_way_to_look_backgrounds_up_is_another_program() {
    let mut model = Model::default();
    let survey = survey((640, 360), 3);
    let n_new = |model: &Model, filtering| {
        let settings = Settings { filtering, ..Settings::default() };
        model.task(&survey, &settings, Pending::default()).work.of(Feature::SurfacePrograms)
    };
    for (_, filtering) in Filtering::ALL {
        assert!(n_new(&model, filtering) >= 1.0, "{filtering:?}");
        let settings = Settings { filtering, ..Settings::default() };
        let task = model.task(&survey, &settings, Pending::default());
        model.note(&task, 100.0, StageTimes::of(1.0, 100.0, [("surface", 80.0)].into_iter()));
        assert_eq!(n_new(&model, filtering), 0.0);
    }
}

#[test]
fn what_the_first_picture_of_a_scene_takes_more_is_expected_of_no_other() {
    let mut model = Model::default();
    let settings = Settings { entities: EntityStyle::None, ..Settings::default() };
    let of = |model: &Model, survey: &Survey, is_unprepared| {
        model.task(survey, &settings, Pending { is_unprepared, depth_maps: 3, ..Pending::default() })
    };
    let first = of(&model, &survey((640, 360), 3), true);
    let expected = model.forecast(&first);
    // Cutting it took a second, and as much went for programs and depth maps.
    model.note_preparation(1000.0);
    let passes = [("surface", 700.0), ("camera_depth", 300.0)];
    model.note(&first, expected.median_ms, StageTimes::of(1.0, 1050.0, passes.into_iter()));
    let seen = model.task(&survey((640, 360), 3), &settings, Pending::default());
    let next = model.forecast(&seen);
    assert!(next.upper_ms < 150.0, "{next:?}");
    let other = of(&model, &survey((640, 360), 3), true);
    assert!(model.forecast(&other).median_ms > next.median_ms + 900.0, "another scene must be cut too");
    // What was never drawn with costs what the first such programs cost, each.
    let mut more = model.task(&survey((640, 360), 4), &settings, Pending::default());
    assert_eq!(more.work.of(Feature::SurfacePrograms), 1.0);
    assert!(model.forecast(&more).median_ms < next.median_ms + 300.0, "{:?}", model.forecast(&more));
    more.work.set(Feature::SurfacePrograms, f64::NAN);
    assert!(model.forecast(&more).median_ms.is_finite());
}

#[test]
fn a_device_that_tells_no_passes_is_learned_as_a_whole() {
    let mut model = Model::default();
    for _ in 0..2 {
        for task in pictures() {
            let expected = model.forecast(&task).median_ms;
            let whole = takes(&task.work).sum() - 1.0;
            model.note(&task, expected, StageTimes::of(1.0, whole, std::iter::empty()));
        }
    }
    assert!(error_of(&model) < 0.15, "{}", error_of(&model));
}

fn row(stage: &str, knob: &str, value: &str, error: f64) -> CostRow {
    CostRow {
        stage: stage.to_owned(),
        knob: knob.to_owned(),
        value: value.to_owned(),
        is_default: matches!(value, "whole" | "4" | "1 x" | "levels" | "8" | "1024 px" | "billboards"),
        time_ms: Spread { median: 1.0, lower_quartile: 1.0, upper_quartile: 1.0, count: 1 },
        memory_bytes: 1,
        error: Some(error),
        measures: std::collections::BTreeMap::new(),
    }
}

/// A table of every knob; supersampling's default is told apart from cameras'.
fn table() -> CostTable {
    let mut rows = vec![
        row("surfaces", "resolution", "quarter", 9.0),
        row("surfaces", "resolution", "half", 7.0),
        row("surfaces", "resolution", "whole", 5.0),
        row("surfaces", "samples", "1", 5.5),
        row("surfaces", "samples", "4", 5.0),
        row("surfaces", "supersampling", "1", 5.0),
        row("surfaces", "supersampling", "2", 4.5),
        row("surfaces", "filtering", "nearest", 6.0),
        row("surfaces", "filtering", "bilinear", 5.2),
        row("surfaces", "filtering", "levels", 5.0),
        row("surfaces", "cameras", "1", 8.0),
        row("surfaces", "cameras", "8", 5.0),
        row("surfaces", "depth maps", "off", 7.5),
        row("surfaces", "depth maps", "1024 px", 5.0),
        row("entities", "style", "billboards, one source", 21.0),
        row("entities", "style", "billboards", 20.0),
        row("entities", "style", "points, stride 4", 30.0),
        row("entities", "style", "points, stride 2", 25.0),
        row("entities", "style", "points, stride 1", 22.0),
    ];
    rows[5].is_default = true;
    CostTable {
        version: COST_TABLE_VERSION,
        machine: Machine {
            processor: String::new(),
            n_processors: 2,
            adapter: "a GPU".to_owned(),
            version: String::new(),
            build: String::new(),
        },
        subject: String::new(),
        measured_at: String::new(),
        took_secs: 1.0,
        is_complete: true,
        rows,
    }
}

#[test]
fn errors_of_knobs_add_up_by_their_squares() {
    let errors = Errors::of(&table()).unwrap();
    let still = Settings { entities: EntityStyle::None, ..Settings::default() };
    let check = |settings: Settings, expected: f64| {
        let found = errors.expected(&settings);
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}: {settings:?}");
    };
    check(still, 5.0);
    check(Settings { resolution: Detail::Half, ..still }, 7.0);
    check(Settings { most_cameras: 3, ..still }, 8.0);
    let both = Settings { resolution: Detail::Half, most_cameras: 1, ..still };
    check(both, (49.0_f64 + 64.0 - 25.0).sqrt());
    check(Settings::default(), 0.5 * (5.0 + 20.0));
    check(Settings { sources: 1, ..Settings::default() }, 0.5 * (5.0 + 21.0));
    // A table that lacks a knob is no table.
    let mut torn = table();
    torn.rows.retain(|row| row.knob != "filtering");
    assert_eq!(Errors::of(&torn), None);
    assert!(!Errors::default().is_measured() && errors.is_measured());
}

#[test]
fn a_table_whose_views_show_no_leak_does_not_make_depth_maps_worthless() {
    let mut table = table();
    for row in &mut table.rows {
        if row.knob == "depth maps" || row.knob == "cameras" {
            row.error = Some(if row.is_default { 5.0 } else { 4.99 });
        }
    }
    let errors = Errors::of(&table).unwrap();
    let with = |most_cameras, depth_maps| {
        errors.expected(&Settings { most_cameras, depth_maps, ..Preset::Exact.settings(4) })
    };
    assert!(with(8, false) > with(8, true) + 0.05);
    assert!(with(1, true) > with(8, true) + 0.05);
    let spread = with(1, false) - with(8, true);
    assert!(spread < 3.0, "what was measured still counts: {spread}");
}

#[test]
fn what_is_dearer_is_taken_for_better_before_there_is_a_table() {
    let errors = Errors::default();
    let [draft, balanced, exact] = Preset::ALL.map(|(_, preset)| errors.expected(&preset.settings(4)));
    assert!(draft > balanced && balanced > exact);
}

#[test]
fn a_deadline_takes_the_least_error_that_fits() {
    let model = learned(|_, ms| ms);
    let survey = survey((1280, 720), 6);
    let errors = Errors::of(&table()).unwrap();
    let known = Known { survey: &survey, pending: Pending::default(), model: &model, errors: &errors };
    let all = candidates(EntityStyle::None, &Named::default());
    let mut last: Option<f64> = None;
    for most_ms in [20.0, 40.0, 80.0, 160.0, 500.0, 3000.0] {
        let Ok(choice) = known.within(&all, most_ms) else { continue };
        assert!(choice.forecast.upper_drawing_ms() <= most_ms);
        let error = choice.error.unwrap();
        assert!(last.is_none_or(|last| error <= last + 0.021), "more time is no worse");
        let better = all.iter().filter(|other| errors.expected(other) < error - 0.021);
        for other in better {
            assert!(
                known.choice(other).forecast.upper_drawing_ms() > most_ms,
                "{other:?} fits in {most_ms} too"
            );
        }
        last = Some(error);
    }
    assert!(last.is_some_and(|error| error
        <= errors.expected(&Settings { entities: EntityStyle::None, ..Preset::Exact.settings(4) }) + 0.021));
    for none in [0.0, -1.0, f64::NAN] {
        let fastest = known.within(&all, none).unwrap_err().unwrap();
        let least =
            all.iter().map(|of| known.choice(of).forecast.upper_drawing_ms()).fold(f64::INFINITY, f64::min);
        assert_eq!(fastest.upper_drawing_ms(), least);
    }
    assert_eq!(known.within(&[], 100.0), Err(None));
}

#[test]
fn rows_that_tell_their_work_are_learned_from() {
    let mut table = table();
    for (idx, task) in pictures().iter().take(40).enumerate() {
        let mut row = row("surfaces", "any", &idx.to_string(), 1.0);
        row.measures = told(&task.work, &takes(&task.work)).collect();
        table.rows.push(row);
    }
    let mut model = Model::default();
    model.use_table(Some(&table));
    let task = &pictures()[50];
    assert_eq!(model.forecast(task).basis, Basis::Table);
    let steady = |model: &Model| {
        let mut model = model.clone();
        for task in pictures() {
            // Once each, so that their programs are there.
            model.note(&task, 1.0, takes(&task.work));
        }
        model
    };
    assert!(error_of(&steady(&model)) < 0.1, "{}", error_of(&steady(&model)));
    model.use_table(None);
    assert_eq!(model.forecast(task).basis, Basis::Guess);
    // Rows whose times are no numbers are left out.
    for row in &mut table.rows {
        row.measures.values_mut().for_each(|value| *value = f64::NAN);
    }
    model.use_table(Some(&table));
    assert_eq!(model.forecast(task).basis, Basis::Guess);
}
