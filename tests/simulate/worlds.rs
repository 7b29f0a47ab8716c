//! Worlds as documents: the catalogue is whole, and what is faulty is refused with its place.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use std::collections::HashSet;
use std::path::Path;
use videofields_picture::scene;
use videofields_simulate::{ActorKind, CalibrationError, EffectKind, Effects, SimulateError, World};
use videofields_vision::config;
use videofields_vision::error::ErrorKind;
use videofields_vision::geometry::{Camera, Ray, SurfaceId};

fn catalogue() -> Vec<World> {
    World::catalogue()
        .iter()
        .map(|(id, _)| World::named(id).unwrap_or_else(|error| panic!("{id}: {error}")))
        .collect()
}

/// The cameras as they are, or smaller.
fn cameras(world: &World, size_px: (u32, u32)) -> Vec<Camera> {
    world.cameras(size_px).unwrap().into_iter().map(|(_, camera)| camera).collect()
}

#[test]
fn every_world_of_the_catalogue_is_whole() {
    let ids: Vec<String> = World::catalogue().into_iter().map(|(id, _)| id).collect();
    for id in [
        "plaza",
        "corner",
        "station",
        "carpark12",
        "campus100",
        "crowd40",
        "queue",
        "corridor",
        "one-camera",
        "no-overlap",
        "same-place",
    ] {
        assert!(ids.iter().any(|known| known == id), "{id}");
    }
    let folder = videofields_testing::root().join("config/worlds");
    let files = std::fs::read_dir(&folder).unwrap().count();
    assert_eq!(files, ids.len(), "every file of config/worlds is in the catalogue");
    for ((id, description), world) in World::catalogue().into_iter().zip(catalogue()) {
        assert_eq!(world.id(), id);
        assert!(description.len() > 20, "{id} says what it is");
        assert!(world.camera_settings().next().is_some(), "{id} has a camera");
        assert_eq!(
            Some(id.as_str()),
            folder.join(format!("{id}.json")).file_stem().and_then(|stem| stem.to_str())
        );
    }
}

#[test]
fn scene_documents_and_configurations_of_all_worlds_pass_their_own_readers() {
    for world in catalogue() {
        let id = world.id().to_owned();
        let text = world.scene_json((640, 360)).unwrap();
        let parsed =
            scene::parse(&id, &text, scene::no_imports).unwrap_or_else(|error| panic!("{id}: {error}"));
        assert_eq!(parsed.scene.cameras.len(), world.camera_settings().count(), "{id}");
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("clips")).unwrap();
        for camera in world.camera_settings() {
            std::fs::write(folder.path().join("clips").join(format!("{}.webm", camera.id)), "").unwrap();
        }
        std::fs::write(folder.path().join(format!("{id}.json")), &text).unwrap();
        let toml = world.config_toml(Path::new("x.sqlite")).unwrap();
        let path = folder.path().join("site.toml");
        std::fs::write(&path, &toml).unwrap();
        let read = config::load(&path);
        assert!(read.is_ok(), "{id}: {:?}", read.err());
    }
}

#[test]
fn uneven_ground_is_written_as_it_is() {
    let world = World::named("campus100").unwrap();
    let scene =
        scene::parse("campus100", &world.scene_json((320, 180)).unwrap(), scene::no_imports).unwrap().scene;
    let (low, high) = (DVec2::new(-215.0, -165.0), DVec2::new(215.0, 165.0));
    let down = |place: DVec2| Ray { origin: place.extend(500.0), direction: DVec3::NEG_Z };
    let mut n_uneven = 0;
    for step in 0..400 {
        let share = DVec2::new(f64::from(step % 20), f64::from(step / 20)) / 20.0;
        let ray = down(low + (high - low) * share + DVec2::new(0.37, 0.61));
        let hit = scene.surfaces.hit(&ray, 0.0).expect("ground everywhere");
        if matches!(hit.surface, SurfaceId::HeightField(_)) {
            let written = hit.point_in_world;
            let true_m = world.solids().terrain().unwrap().height_at(written.truncate()).unwrap();
            assert!((true_m - written.z).abs() < 2e-3, "at {written}: {true_m} m in truth");
            n_uneven += usize::from(written.z.abs() > 0.1);
        }
    }
    assert!(n_uneven > 50, "{n_uneven} places are uneven");
}

#[test]
fn every_world_shows_something_that_moves() {
    for world in catalogue() {
        let mut seen = HashSet::new();
        'search: for step in 0..8 {
            let time = world.period_secs() * f64::from(step) / 8.0;
            let figures = world.figures(time).unwrap();
            for camera in cameras(&world, (96, 54)) {
                // Only cameras that have somebody in their picture are worth casting.
                let has_somebody = figures.iter().any(|figure| {
                    camera.project(figure.foot_in_world + DVec3::Z).is_some_and(|place| place.is_inside())
                });
                if !has_somebody {
                    continue;
                }
                let bare = world.with_effects(Effects::default());
                let truth = bare.render(&camera, time, 1).unwrap();
                seen.extend(truth.instance.data.iter().copied().filter(|value| *value > 0));
                if seen.len() > 1 {
                    break 'search;
                }
            }
        }
        assert!(!seen.is_empty(), "{}: nobody is seen", world.id());
    }
}

#[test]
fn what_moves_stands_on_the_ground_and_keeps_out_of_walls() {
    for world in catalogue() {
        for step in 0..40 {
            let time = world.period_secs() * f64::from(step) / 40.0;
            for figure in world.figures(time).unwrap() {
                let place = format!("{} at {time}: {}", world.id(), figure.name);
                let foot = figure.foot_in_world;
                assert!((foot.z - world.ground_height(foot.truncate())).abs() < 1e-9, "{place}");
                let (low, high) = figure.box_in_world;
                let heights =
                    [low.truncate(), high.truncate(), DVec2::new(low.x, high.y), DVec2::new(high.x, low.y)]
                        .map(|at| world.ground_height(at));
                let lowest = heights.into_iter().fold(foot.z, f64::min);
                let highest = heights.into_iter().fold(foot.z, f64::max);
                assert!(
                    low.z > lowest - 0.12 && low.z < highest + 0.12,
                    "{place}: lowest {} of {heights:?}",
                    low.z
                );
                let tall = match figure.kind {
                    // Some sit.
                    ActorKind::Walker => 1.2..2.1,
                    ActorKind::Cyclist => 1.5..2.1,
                    ActorKind::Car => 1.3..2.4,
                };
                assert!(tall.contains(&figure.height_m), "{place}: {} m tall", figure.height_m);
                // A metre up, the middle of nobody is in a building.
                for (idx, solid) in world.surfaces().boxes().enumerate() {
                    let axis = |axis: DVec3| (solid.world_from_box_point(axis) - solid.center()).normalize();
                    let from_middle = foot + DVec3::Z - solid.center();
                    let local = DVec3::new(
                        from_middle.dot(axis(DVec3::X)),
                        from_middle.dot(axis(DVec3::Y)),
                        from_middle.z,
                    );
                    assert!((local.abs() - solid.half_size()).max_element() > 0.0, "{place} is in box {idx}");
                }
            }
        }
    }
}

#[test]
fn nobody_walks_or_drives_through_another() {
    for world in catalogue().into_iter().filter(|world| !world.id().starts_with("effect-")) {
        for step in 0..200 {
            let time = world.period_secs() * f64::from(step) / 200.0;
            let figures = world.figures(time).unwrap();
            for (i, one) in figures.iter().enumerate() {
                for other in &figures[i + 1..] {
                    let reach = |kind: ActorKind| match kind {
                        ActorKind::Walker => 0.2,
                        ActorKind::Cyclist => 0.4,
                        ActorKind::Car => 1.0,
                    };
                    let distance = (one.foot_in_world - other.foot_in_world).length();
                    let least = reach(one.kind) + reach(other.kind);
                    assert!(
                        distance > least,
                        "{} at {time}: {} and {} are {distance} m apart",
                        world.id(),
                        one.name,
                        other.name
                    );
                }
            }
        }
    }
}

#[test]
fn worlds_of_one_effect_differ_by_it_alone() {
    let yard = World::named("yard").unwrap();
    assert_eq!(yard.effects().named().count(), 0);
    for kind in EffectKind::ALL {
        let world = World::named(&format!("effect-{}", kind.id())).unwrap();
        assert_eq!(world.effects().named().collect::<Vec<_>>(), [kind]);
        assert_eq!(world.cameras((64, 36)).unwrap(), yard.cameras((64, 36)).unwrap());
        assert_eq!(world.figures(3.0).unwrap(), yard.figures(3.0).unwrap());
        let bare = world.with_effects(Effects::default());
        let (_, camera) = &yard.cameras((48, 27)).unwrap()[0];
        assert!(
            bare.render(camera, 2.0, 1).unwrap() == yard.render(camera, 2.0, 1).unwrap(),
            "{}",
            kind.id()
        );
    }
}

/// At most and at least so many cameras for each of these places' share.
fn cameras_over(world: &World, low: DVec2, high: DVec2, step_m: f64) -> Vec<usize> {
    let cameras = cameras(world, (640, 360));
    let steps = ((high - low) / step_m).floor();
    let mut counts = Vec::new();
    for j in 0..steps.y as u32 {
        for i in 0..steps.x as u32 {
            let at = low + DVec2::new(f64::from(i), f64::from(j)) * step_m;
            let place = at.extend(world.ground_height(at));
            let sees = |camera: &&Camera| camera.project(place).is_some_and(|found| found.is_inside());
            counts.push(cameras.iter().filter(sees).count());
        }
    }
    counts
}

#[test]
fn at_most_three_cameras_overlap_on_the_campus() {
    let world = World::named("campus100").unwrap();
    assert_eq!(world.camera_settings().count(), 100);
    // What stands in the way is left out, so no fewer are counted than see the place.
    let counts = cameras_over(&world, DVec2::new(-215.0, -165.0), DVec2::new(215.0, 165.0), 2.7);
    assert_eq!(counts.iter().max(), Some(&3));
    let share =
        |least: usize| counts.iter().filter(|count| **count >= least).count() as f64 / counts.len() as f64;
    assert!(share(1) > 0.4 && share(2) > 0.1, "{} seen, {} twice", share(1), share(2));
}

#[test]
fn degenerate_worlds_are_what_they_are_called() {
    let over = |id: &str| {
        cameras_over(&World::named(id).unwrap(), DVec2::new(-10.0, -14.0), DVec2::new(10.0, 8.0), 0.25)
    };
    let apart = over("no-overlap");
    assert!(apart.iter().all(|count| *count <= 1) && apart.contains(&1));
    assert_eq!(over("one-camera").iter().max(), Some(&1));
    assert_eq!(over("same-place").iter().max(), Some(&3));
    let same = World::named("same-place").unwrap();
    let places: Vec<_> =
        cameras(&same, (64, 36)).iter().map(|camera| camera.pose().position_in_world).collect();
    assert!(places.len() == 3 && places.iter().all(|place| *place == places[0]));
}

fn check(text: &str, expected: &[(&str, &str)]) {
    let error = World::from_json("test", text).err().unwrap_or_else(|| panic!("{text} is read"));
    assert_eq!(error.kind(), ErrorKind::Invalid);
    let SimulateError::World { faults, .. } = error else { panic!("{error}") };
    for (place, message) in expected {
        let is_met = faults.iter().any(|fault| fault.place == *place && fault.message.contains(message));
        assert!(is_met, "{place}: {message}: {faults:?}");
    }
    assert_eq!(faults.len(), expected.len(), "{faults:?}");
}

#[test]
fn faults_are_found_all_at_once_each_at_its_place() {
    check("{", &[("", "not JSON")]);
    check("[]", &[("", "expected an object")]);
    check("{}", &[("", "`version` is missing")]);
    check(r#"{"version": 2}"#, &[("/version", "expected 1")]);
    check(r#"{"version": 1, "period_secs": 1e999}"#, &[("", "finite numbers only")]);
    check(r#"{"version": 1, "seed": NaN}"#, &[("", "finite numbers only")]);
    check(&format!(r#"{{"version": 1, "sky": {}}}"#, "[".repeat(100_000)), &[("", "recursion")]);
    check(r#"{"version": 1, "actor": [], "period_secs": -3, "base": 7}"#, &[("/base", "name of a world")]);
    check(
        r#"{"version": 1, "actor": [], "period_secs": -3, "origin": {"latitude_deg": 91, "longitude_deg": 0}}"#,
        &[
            ("/actor", "did you mean `actors`?"),
            ("/period_secs", "expected 0.1 to 86400 seconds, got -3"),
            ("/origin/latitude_deg", "expected -90 to 90"),
        ],
    );
    check(r#"{"version": 1, "base": "yrad"}"#, &[("/base", "did you mean `yard`?")]);
    check(r#"{"version": 1, "base": "one-camera"}"#, &[("/base", "itself made from another")]);
    check(
        r##"{"version": 1, "materials": {"a": {"kind": "plian", "color_srgb": "#ffffff"},
            "b": {"kind": "plain", "color_srgb": "white"}, "c": {"kind": "meadow", "stripe_m": 0, "strip": 1},
            "d": {"kind": "asphalt", "markings": [{"kind": "line", "from_m": [0, 0], "to_m": [0, 0]}, {"kind": "zebra"}]},
            "e": {"kind": "picture", "file": "x.png", "width_m": 1}},
            "terrain": [{"kind": "level", "polygon": [[0, 0], [1, 0]], "material": "a"},
                {"kind": "level", "polygon": [[0, 0], [1, 0], [1, 1]], "material": "grass"},
                {"kind": "hills", "low_m": [0, 0], "high_m": [9000, 10], "hills": [], "material": "a"}]}"##,
        &[
            ("/materials/a/kind", "did you mean `plain`?"),
            ("/materials/b/color_srgb", "expected a colour"),
            ("/materials/c/strip", "did you mean `stripe_m`?"),
            ("/materials/c/stripe_m", "expected 0.05 to 100 metres"),
            ("/materials/d/markings/0/to_m", "at least 1 cm"),
            ("/materials/d/markings/1", "`center_m` is missing"),
            ("/materials/e/file", "only for worlds that lie in a file"),
            ("/terrain/0/polygon", "3 to 4096 corners"),
            ("/terrain/1/material", "unknown material `grass`"),
            ("/terrain/2/high_m", "513 posts"),
        ],
    );
    check(
        r#"{"version": 1, "period_secs": 10, "actors": [
            {"kind": "walker", "id": "a", "path": {"corners_m": [[0, 0], [0, 0], [1, 1]], "laps": 1}},
            {"kind": "walker", "id": "b", "path": {"corners_m": [[0, 0], [1, 1]], "laps": 1}},
            {"kind": "walker", "id": "c", "path": {"corners_m": [[0, 0], [9, 0], [9, 9]], "laps": 1, "speed_m_per_sec": 1}},
            {"kind": "walker", "id": "c", "path": {"corners_m": [[0, 0], [9, 0], [9, 9]], "laps": 1, "stops": [{"at_m": 99, "secs": 1}]}},
            {"kind": "car", "id": "d", "path": {"corners_m": [[0, 0], [9, 0], [9, 9]], "laps": 1, "stops": [{"at_m": 9, "secs": 11}]}},
            {"kind": "bus", "id": "e"}],
            "cameras": [{"id": "A", "eye_m": [0, 0, 3], "target_m": [0, 0, 3], "fov_x_deg": 60},
                {"id": "b", "eye_m": [0, 0, 3], "yaw_deg": 3, "fov_x_deg": 60},
                {"id": "c", "eye_m": [0, 0, 3], "target_m": [0, 5, 3], "fov_x_deg": 60, "rate_hz": 0, "size_px": [1, 100000]}],
            "calibration_error": {"turn_deg": 90},
            "effects": {"noize": {}, "rain": {"rate_mm_per_hour": -1}}}"#,
        &[
            ("/actors/0/path/corners_m/1", "1 cm from the corner before"),
            ("/actors/1/path/corners_m", "a closed path has 3 to 512"),
            ("/actors/2/path", "either `speed_m_per_sec` or `laps`"),
            ("/actors/3/id", "another actor `c`"),
            ("/actors/3/path/stops/0/at_m", "half a metre"),
            ("/actors/4/path/stops", "longer than a round"),
            ("/actors/5/kind", "unknown value `bus`"),
            ("/cameras/0/id", "invalid id"),
            ("/cameras/0/target_m", "must differ"),
            ("/cameras/1", "either `target_m`"),
            ("/cameras/2/rate_hz", "expected 0.1 to 240"),
            ("/cameras/2/size_px", "16 to 16383"),
            ("/cameras/2/size_px", "16 to 16383"),
            ("/calibration_error/turn_deg", "expected 0 to 45 degrees, got 90"),
            ("/effects/noize", "did you mean `noise`?"),
            ("/effects/rain/rate_mm_per_hour", "must be 0.1 to 200"),
        ],
    );
    let tree = format!(r#"{{"version": 1, "actors": [{}]}}"#, vec![r#"{"kind": "bus"}"#; 300].join(","));
    let SimulateError::World { faults, .. } = World::from_json("test", &tree).unwrap_err() else {
        panic!("faults")
    };
    assert!(faults.iter().any(|fault| fault.place == "/actors" && fault.message.contains("at most 254")));
    assert!(faults.len() <= 64, "faults are bounded");
}

#[test]
fn calibration_errors_are_in_what_is_written_and_not_in_what_is_cast() {
    let text = r#"{"version": 1, "base": "yard", "calibration_error": {"move_m": 0.1, "clock_ms": 50}, "cameras": [
        {"id": "a", "eye_m": [-9, -15, 4.6], "target_m": [0.5, -1.5, 0.6], "fov_x_deg": 66},
        {"id": "b", "eye_m": [9, -14, 4.4], "target_m": [-0.5, -1, 0.6], "fov_x_deg": 66, "calibration_error": {"turn_deg": 1}}]}"#;
    let world = World::from_json("off", text).unwrap();
    let true_ones = world.cameras((64, 36)).unwrap();
    let scene = |world: &World| {
        scene::parse("off", &world.scene_json((64, 36)).unwrap(), scene::no_imports).unwrap().scene
    };
    let off: Vec<f64> = scene(&world)
        .cameras
        .iter()
        .zip(&true_ones)
        .map(|(member, (_, camera))| {
            (member.camera.pose().position_in_world - camera.pose().position_in_world).length()
        })
        .collect();
    assert!((off[0] - 0.1).abs() < 1e-9 && off[1] < 1e-9, "one is moved, one turned: {off:?}");
    assert_eq!(world.late_secs("a").abs(), 0.05);
    assert_eq!(world.late_secs("b"), 0.0, "its own error has no clock");
    let exact = world.with_calibration_error(CalibrationError::default());
    assert_eq!(exact.cameras((64, 36)).unwrap(), true_ones);
    assert_eq!(scene(&exact).cameras[0].camera.pose(), true_ones[0].1.pose());
    assert_ne!(scene(&exact).cameras[1].camera.pose(), scene(&world).cameras[1].camera.pose());
}

/// A number that hangs on the last one.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 33
}

/// Every place in a tree, by its pointer.
fn places(tree: &Value, place: &str, found: &mut Vec<String>) {
    found.push(place.to_owned());
    match tree {
        Value::Object(fields) => {
            fields.iter().for_each(|(key, value)| places(value, &format!("{place}/{key}"), found));
        }
        Value::Array(elements) => {
            elements.iter().enumerate().for_each(|(i, value)| places(value, &format!("{place}/{i}"), found));
        }
        _ => {}
    }
}

#[test]
fn mutated_worlds_are_read_or_refused_but_never_panic() {
    let odd = [
        json!(null),
        json!(true),
        json!(0),
        json!(-0.0),
        json!(-1),
        json!(1),
        json!(0.5),
        json!(1e308),
        json!(-1e308),
        json!(1e-308),
        json!(1e9),
        json!(4_294_967_296_u64),
        json!(u64::MAX),
        json!(""),
        json!("\u{0}"),
        json!("plain"),
        json!("1e999"),
        json!([]),
        json!({}),
        json!([[0, 0]]),
        json!([0, 0]),
        json!([0, 0, 0]),
        json!([1e300, -1e300, 1e300]),
        json!({"kind": "hills"}),
        json!({"kind": "walker"}),
        json!("#000000"),
        json!("2026-01-01T00:00:00Z"),
    ];
    let (mut n_read, mut n_refused, mut state) = (0, 0, 17);
    for round in 0..1000 {
        let base = ["yard", "plaza", "station", "effect-rain"][round % 4];
        let text = World::document_of(base).unwrap();
        let text = if round % 5 == 4 {
            // Bytes: one is lost, doubled, or another.
            let mut bytes = text.as_bytes().to_vec();
            for _ in 0..=next(&mut state) % 3 {
                let at = next(&mut state) as usize % bytes.len();
                match next(&mut state) % 3 {
                    0 => drop(bytes.remove(at)),
                    1 => bytes.insert(at, bytes[at]),
                    _ => bytes[at] = b"0123456789-e.,:[]{}\"ntx"[next(&mut state) as usize % 23],
                }
            }
            String::from_utf8_lossy(&bytes).into_owned()
        } else {
            let mut tree: Value = serde_json::from_str(text).unwrap();
            for _ in 0..=next(&mut state) % 3 {
                let mut all = Vec::new();
                places(&tree, "", &mut all);
                let place = &all[next(&mut state) as usize % all.len()];
                let other = tree.pointer(&all[next(&mut state) as usize % all.len()]).cloned().unwrap();
                let value = tree.pointer_mut(place).unwrap();
                *value = match (next(&mut state) % 5, &*value) {
                    (0, _) => other,
                    (1, Value::Number(number)) => json!(number.as_f64().unwrap() * -1e6),
                    (2 | 4, Value::Number(number)) => json!(number.as_f64().unwrap() * 1.07),
                    (2, Value::Array(elements)) => Value::Array([elements.as_slice(), elements].concat()),
                    (3, Value::Object(fields)) => {
                        let mut fields = fields.clone();
                        let key = fields.keys().nth(next(&mut state) as usize % fields.len().max(1)).cloned();
                        key.and_then(|key| fields.remove(&key));
                        Value::Object(fields)
                    }
                    _ => odd[next(&mut state) as usize % odd.len()].clone(),
                };
            }
            tree.to_string()
        };
        match World::from_json("test", &text) {
            Err(SimulateError::World { faults, .. }) => {
                n_refused += 1;
                assert!(!faults.is_empty() && faults.iter().all(|fault| !fault.message.is_empty()));
            }
            Err(error) => panic!("{error}"),
            Ok(world) => {
                n_read += 1;
                for time in [0.0, 3.7, -1e9, 1e300] {
                    for figure in world.figures(time).unwrap() {
                        let (low, high) = figure.box_in_world;
                        assert!(low.is_finite() && high.is_finite(), "{text}");
                    }
                }
                if let Some((_, camera)) = world.cameras((8, 6)).unwrap().first() {
                    let truth = world.render(camera, 1.0, 1).unwrap();
                    assert!(truth.depth_m.iter().all(|depth| *depth >= 0.0));
                }
            }
        }
    }
    assert!(n_read > 100 && n_refused > 300, "{n_read} read, {n_refused} refused");
}

#[test]
fn worlds_are_loaded_by_name_and_from_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    assert_eq!(World::load("corner").unwrap().id(), "corner");
    let unknown = World::load("croner").unwrap_err();
    assert_eq!(unknown.kind(), ErrorKind::NotFound);
    assert!(unknown.to_string().contains("did you mean `corner`?"), "{unknown}");
    let missing = World::load(&path("none.json")).unwrap_err();
    assert_eq!(missing.kind(), ErrorKind::NotFound);
    assert_eq!(World::load(folder.path().to_str().unwrap()).unwrap_err().kind(), ErrorKind::Invalid);
    std::fs::write(folder.path().join("bytes.json"), [0xff, 0xfe]).unwrap();
    assert!(World::load(&path("bytes.json")).unwrap_err().to_string().contains("UTF-8"));

    // A picture beneath the file's folder is painted; one beside it is not read.
    let mut pixels = image::RgbImage::new(2, 2);
    pixels.fill(200);
    pixels.save(folder.path().join("grey.png")).unwrap();
    let world = |file: &str| {
        format!(
            r#"{{"version": 1, "materials": {{"p": {{"kind": "picture", "file": "{file}", "width_m": 1}}}},
                "terrain": [{{"kind": "level", "polygon": [[-9, -9], [9, -9], [9, 9], [-9, 9]], "material": "p"}}]}}"#
        )
    };
    std::fs::write(folder.path().join("painted.json"), world("grey.png")).unwrap();
    let painted = World::load(&path("painted.json")).unwrap();
    assert_eq!((painted.id(), painted.name()), ("painted", "painted"));
    let camera = Camera::pinhole(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 0.5, (16, 16)).unwrap();
    let truth = painted.render(&camera, 0.0, 1).unwrap();
    assert!(
        truth
            .rgb
            .data
            .iter()
            .all(|value| *value == truth.rgb.data[0] || value.abs_diff(truth.rgb.data[0]) < 60)
    );
    std::fs::write(folder.path().join("outside.json"), world("../outside.png")).unwrap();
    assert!(World::load(&path("outside.json")).unwrap_err().to_string().contains("/materials/p/file"));
    assert!(World::from_json("x", &world("grey.png")).is_err());
}
