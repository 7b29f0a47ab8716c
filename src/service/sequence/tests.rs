//! Hard cases of sequences: files that are missing, broken and unlike, meshes that change with every frame, viewers that jump.

use super::testing::{
    Rolling, ball, looking, manifest, middle, open, paint, picture, player, save, write_mesh,
};
use super::{Look, Mixing, Player, PlayerSettings, SequenceDocument, SequenceError, check};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};
use std::fs;
use std::time::Duration;
use videofields_recording::timeline::{Playhead, PlayheadMode};
use videofields_vision::clock::Timestamp;
use videofields_vision::error::ErrorKind;
use videofields_vision::fields::Moment;
use videofields_vision::fields::{FieldSettings, Sight};
use videofields_vision::frame::{RgbImage, linear_from_srgb};
use videofields_vision::measures;
use videofields_vision::mesh::Mesh;

fn at(secs: f64) -> Timestamp {
    Timestamp::from_nanos((secs * 1e9).round() as i64)
}

/// Settings that are quick: depth maps as large as the pictures.
fn quick() -> PlayerSettings {
    PlayerSettings {
        fields: FieldSettings { depth_map_px: 128, ..FieldSettings::default() },
        ..PlayerSettings::default()
    }
}

/// How far a picture is from the ball as it is, 8-bit codes, where it is covered.
fn off(look: &Look, camera: &videofields_vision::geometry::Camera, secs: f64) -> f64 {
    let shaded = look.shaded.as_ref().unwrap();
    let (truth, _) = picture(camera, secs, 1.0);
    let evened = measures::exposed_like(&truth, &shaded.picture, &shaded.covered);
    measures::compare(&evened, &shaded.picture, Some(&shaded.covered)).unwrap().rmse
}

#[test]
fn a_ball_is_seen_from_where_no_camera_stands_at_every_frame() {
    let (folder, _) = Rolling::default().write();
    let mut player = player(folder.path(), quick());
    let camera = looking(0.5, 64);
    for (secs, number) in [(0.0, 0), (0.04, 0), (0.06, 1), (0.1, 1), (0.2, 2), (0.9, 2)] {
        let look = player.look(at(secs), &camera).unwrap();
        assert_eq!(look.moment.number, number, "{secs}");
        let n_covered = look.shaded.as_ref().unwrap().covered.data.iter().filter(|of| **of > 0).count();
        assert!(n_covered > 500, "{n_covered}");
        let off = off(&look, &camera, number as f64 / 10.0);
        assert!(off < 6.0, "{secs}: {off}");
        assert!(look.moment.blind.is_empty() && look.moment.mended.is_none() && look.moment.n_extruded == 0);
    }
    assert_eq!((player.counts().n_read, player.counts().n_found, player.counts().n_gone), (3, 3, 0));
    let found = check(&mut open(folder.path()).unwrap(), |_| ());
    assert_eq!((found.n_frames, found.n_faults, found.n_changed, found.missing.len()), (3, 0, 2, 0));
    assert!(found.cameras.iter().all(|camera| camera.n_pictures == 3 && camera.sizes_px == [[64, 64]]));
    assert!((found.duration_secs - 0.2).abs() < 1e-9);
}

#[test]
fn faults_of_manifests_name_file_and_pointer() {
    let (folder, document) = Rolling { n_frames: 1, n_cameras: 1, ..Rolling::default() }.write();
    let check = |change: &dyn Fn(&mut Value), place: &str, says: &str| {
        let mut tree = serde_json::to_value(&document).unwrap();
        change(&mut tree);
        fs::write(folder.path().join("sequence.json"), tree.to_string()).unwrap();
        let error = open(folder.path()).expect_err(place);
        let text = error.to_string();
        assert!(text.contains("sequence.json: ") && text.contains(&format!("{place}: ")), "{place}: {text}");
        assert!(text.contains(says), "{place}: {text}");
        assert_eq!(error.kind(), ErrorKind::Invalid);
    };
    check(&|of| of["version"] = json!(2), "/version", "expected 1, got 2");
    check(&|of| of["frames"] = json!([]), "/frames", "unknown key `frames`");
    check(&|of| of["meshes"]["patern"] = json!("a"), "/meshes/patern", "did you mean `pattern`?");
    check(&|of| of["meshes"]["list"] = json!(["a.ply"]), "/meshes", "exactly one of pattern and list");
    check(&|of| of["meshes"]["pattern"] = json!("a.ply"), "/meshes/pattern", "one number is needed");
    check(&|of| of["meshes"]["up"] = json!("north"), "/meshes/up", "x, -x, y, -y, z, -z");
    check(&|of| of["meshes"]["metres_per_unit"] = json!(0), "/meshes/metres_per_unit", "got 0");
    check(&|of| of["meshes"]["extruded_times"] = json!(1), "/meshes/extruded_times", "2 to 1000");
    check(&|of| of["rate_hz"] = json!(0), "/rate_hz", "0.01 to 1000");
    check(&|of| of["rate_hz"] = json!(null), "/rate_hz", "several meshes need this or times_secs");
    check(&|of| of["times_secs"] = json!([0]), "/times_secs", "give either this or rate_hz");
    check(&|of| of["start"] = json!("noon"), "/start", "RFC 3339");
    check(&|of| of["cameras"][0]["id"] = json!("North"), "/cameras/0/id", "a-z");
    check(&|of| of["cameras"][0]["pictures"] = json!({}), "/cameras/0/pictures", "pattern, list and video");
    check(
        &|of| of["cameras"][0]["pictures"]["offset_secs"] = json!(1),
        "/cameras/0/pictures/offset_secs",
        "goes with video alone",
    );
    check(
        &|of| of["cameras"][0]["pictures"] = json!({"video": "a.mp4", "rate_hz": 0}),
        "/cameras/0/pictures/rate_hz",
        "0.01 to 1000",
    );
    check(
        &|of| of["cameras"][0]["calibration"]["focal_px"] = json!([1]),
        "/cameras/0/calibration/focal_px",
        "",
    );
    check(&|of| of["cameras"][0]["calibration"] = json!("no.json"), "/cameras/0/calibration", "no.json");
    check(&|of| of["cameras"] = json!([of["cameras"][0], of["cameras"][0]]), "/cameras/1/id", "c0 already");
    check(
        &|of| {
            of["meshes"] = json!({"list": ["000.ply", null]});
            of["cameras"][0]["masks"] = json!({"list": ["a.png"]});
        },
        "/cameras/0/masks/list",
        "1 pictures for 2 meshes",
    );
    check(
        &|of| {
            of["rate_hz"] = json!(null);
            of["times_secs"] = json!([0, 1, 1]);
        },
        "/times_secs/2",
        "after the one before it",
    );
    check(
        &|of| {
            of["rate_hz"] = json!(null);
            of["times_secs"] = json!([0, 1]);
        },
        "/times_secs",
        "2 times for 1 numbers",
    );
    // All faults at once.
    check(
        &|of| {
            of["rate_hz"] = json!(0);
            of["meshes"]["up"] = json!("up");
        },
        "/meshes/up",
        "/rate_hz: ",
    );
    fs::write(folder.path().join("sequence.json"), "{\"version\": 1,").unwrap();
    assert!(open(folder.path()).unwrap_err().to_string().contains("not JSON"));
    fs::write(folder.path().join("sequence.json"), [0xff]).unwrap();
    assert!(open(folder.path()).unwrap_err().to_string().contains("UTF-8"));
}

#[test]
fn an_empty_folder_is_told_as_one() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(open(folder.path()).unwrap_err().kind(), ErrorKind::NotFound);
    for meshes in [json!({"pattern": "%d.ply"}), json!({"list": [null, null]})] {
        let text = json!({"version": 1, "rate_hz": 10, "meshes": meshes}).to_string();
        fs::write(folder.path().join("sequence.json"), text).unwrap();
        let error = open(folder.path()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::NotFound);
        assert!(error.to_string().contains("there is no mesh"), "{error}");
    }
}

#[test]
fn missing_frames_are_told_and_the_nearest_answers_within_its_reach() {
    let (folder, mut document) = Rolling { n_frames: 1, n_cameras: 0, ..Rolling::default() }.write();
    for number in [3, 4, 40] {
        write_mesh(&folder.path().join(format!("{number:03}.ply")), &ball(number, DVec3::ZERO));
    }
    let sequence = open(folder.path()).unwrap();
    assert_eq!(sequence.missing(), [[1, 2], [5, 39]]);
    let number = |secs: f64| sequence.frame_at(at(secs)).map(|idx| sequence.frames()[idx].number);
    for (secs, expected) in
        [(-0.5, 0), (0.0, 0), (0.14, 0), (0.16, 3), (0.35, 3), (0.36, 4), (1.3, 4), (3.2, 40)]
    {
        assert_eq!(number(secs).unwrap(), expected, "{secs}");
    }
    let error = number(2.0).unwrap_err();
    assert!(
        matches!(&error, SequenceError::Gap { before: Some(before), after: Some(after), .. }
        if *before == at(0.4) && *after == at(4.0)),
        "{error}"
    );
    assert_eq!(error.kind(), ErrorKind::NotFound);
    assert!(number(-1.5).is_err());
    // By a list with times of its own.
    document.rate_hz = None;
    document.times_secs = Some(vec![0.0, 0.5, 7.0]);
    document.meshes.pattern = None;
    document.meshes.list = Some(vec![Some("000.ply".to_owned()), None, Some("003.ply".to_owned())]);
    document.start = Some("2026-01-01T00:00:00Z".to_owned());
    manifest(folder.path(), &document);
    let sequence = open(folder.path()).unwrap();
    assert_eq!(sequence.missing(), [[1, 1]]);
    assert_eq!((sequence.frames()[1].number, sequence.frames()[1].place), (2, 2));
    assert_eq!(sequence.frames()[1].at.to_string(), "2026-01-01T00:00:07Z");
}

#[test]
fn a_frame_that_cannot_be_read_is_named_and_the_others_go_on() {
    let (folder, _) = Rolling { n_cameras: 2, ..Rolling::default() }.write();
    let path = folder.path().join("001.ply");
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let mut player = player(folder.path(), quick());
    let camera = looking(0.5, 32);
    for _ in 0..2 {
        let error = player.look(at(0.1), &camera).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Invalid);
        let text = error.to_string();
        assert!(text.starts_with("frame 1 cannot be read: ") && text.contains("001.ply"), "{text}");
        for secs in [0.0, 0.2] {
            assert!(player.look(at(secs), &camera).unwrap().shaded.is_some());
        }
    }
    assert_eq!(player.counts().n_read, 2);
    fs::write(folder.path().join("c1-002.png"), b"no picture").unwrap();
    let found = check(&mut open(folder.path()).unwrap(), |_| ());
    assert_eq!(found.n_faults, 2, "{:?}", found.faults);
    assert!(found.faults[0].starts_with("frame 1 ") && found.faults[1].starts_with("frame 2, camera c1: "));
}

#[test]
fn cameras_without_a_picture_are_blind_for_that_frame_alone() {
    let (folder, _) = Rolling { n_cameras: 3, ..Rolling::default() }.write();
    fs::remove_file(folder.path().join("c1-001.png")).unwrap();
    fs::write(folder.path().join("c2-001.png"), b"no picture").unwrap();
    let mut player = player(folder.path(), quick());
    let camera = looking(0.1, 32);
    for secs in [0.0, 0.1, 0.2] {
        let look = player.look(at(secs), &camera).unwrap();
        let sees = |view: usize| {
            let field = look.moment.field.as_ref().unwrap();
            (0..look.moment.mesh.positions_m.len() as u32)
                .any(|vertex| field.sight(vertex, view) == Sight::Seen)
        };
        let expected = [true, secs != 0.1, secs != 0.1];
        assert_eq!([0, 1, 2].map(sees), expected, "{secs}");
        let weights = player.weights().unwrap();
        assert_eq!(weights.n_views(), 3);
        let blind: Vec<_> =
            look.moment.blind.iter().map(|(camera, reason)| (*camera, reason.is_some())).collect();
        assert_eq!(blind, if secs == 0.1 { vec![(1, false), (2, true)] } else { vec![] });
    }
}

/// What a view lends where the ball is seen in a direction from its middle.
fn lent(player: &Player, moment: &Moment, direction: DVec3, view: usize) -> f64 {
    let place = middle(0.0) + direction;
    let nearest = (0..moment.mesh.positions_m.len())
        .min_by(|a, b| {
            let away = |vertex: usize| moment.mesh.positions_m[vertex].distance(place);
            away(*a).total_cmp(&away(*b))
        })
        .unwrap();
    f64::from(player.weights().unwrap().of(nearest as u32)[view])
}

/// Plays so many meshes at 30 a second until a viewer jumps, and how much of its way the view that lends least before and most after has gone by 0.1 s steps.
fn jumped(rate: u32, n_meshes: u64) -> Vec<f64> {
    // Six cameras see an edge of the ball from two sides; it stands still, whatever its triangles.
    let still = Rolling { n_frames: 1, n_cameras: 6, ..Rolling::default() };
    let (folder, mut document) = still.write();
    for number in 0..n_meshes {
        write_mesh(&folder.path().join(format!("{number:03}.ply")), &ball(number, middle(0.0)));
    }
    document.rate_hz = Some(30.0);
    let pattern = document.meshes.pattern.take().unwrap();
    document.meshes.list =
        Some((0..n_meshes).map(|number| Some(pattern.replace("%03d", &format!("{number:03}")))).collect());
    for (i, camera) in document.cameras.iter_mut().enumerate() {
        camera.pictures.pattern = None;
        camera.pictures.list = Some(vec![Some(format!("c{i}-000.png")); n_meshes as usize]);
        camera.masks = None;
    }
    manifest(folder.path(), &document);
    let mut player = player(folder.path(), quick());
    // Between cameras 0 and 1, seen by both.
    let direction = DVec3::new(0.5_f64.cos(), 0.5_f64.sin(), 0.2).normalize();
    let (before, after) = (looking(0.0, 16), looking(std::f64::consts::FRAC_PI_3, 16));
    let mut start = 0.0;
    for picture in 0..=rate / 2 {
        let look = player.look(at(f64::from(picture) / f64::from(rate)), &before).unwrap();
        start = lent(&player, &look.moment, direction, 1);
    }
    let mut way = Vec::new();
    for picture in 1..=rate / 2 {
        let look = player.look(at(0.5 + f64::from(picture) / f64::from(rate)), &after).unwrap();
        let field = look.moment.field.as_ref().unwrap();
        let weights = field.target(&look.moment.mesh, &look.moment.views, after.pose().position_in_world);
        let place = middle(0.0) + direction;
        let positions = &look.moment.mesh.positions_m;
        let nearest = (0..positions.len())
            .min_by(|a, b| positions[*a].distance(place).total_cmp(&positions[*b].distance(place)))
            .unwrap();
        let end = f64::from(weights.of(nearest as u32)[1]);
        assert!(end - start > 0.5, "the views change: {start} to {end}");
        way.push((lent(&player, &look.moment, direction, 1) - start) / (end - start));
    }
    assert_eq!(player.n_seeks(), 0);
    way
}

#[test]
fn an_abrupt_jump_of_the_viewer_is_followed_in_half_a_second_at_any_rate() {
    for rate in [10, 30, 120] {
        let way = jumped(rate, 1);
        assert!(way.is_sorted(), "{rate}: {way:?}");
        let last = way[way.len() - 1];
        assert!((0.95..0.96).contains(&last), "{rate}: {last}");
        // Not at once.
        let tenth = way[(rate as usize / 10).max(1) - 1];
        assert!((0.40..0.55).contains(&tenth), "{rate}: {tenth}");
    }
}

#[test]
fn topology_that_changes_with_every_frame_carries_weights_by_nearest_place() {
    for rate in [10, 30] {
        let way = jumped(rate, 46);
        let last = way[way.len() - 1];
        // The nearest vertex is another in every frame, and so is what it should come to.
        assert!((0.9..1.0).contains(&last), "{rate}: {way:?}");
        let tenth = way[(rate as usize / 10).max(1) - 1];
        assert!((0.3..0.65).contains(&tenth), "{rate}: {way:?}");
    }
}

#[test]
fn a_seek_drops_what_was_seen_and_playing_does_not() {
    let (folder, _) = Rolling { n_frames: 20, n_cameras: 2, ..Rolling::default() }.write();
    let mut player = player(folder.path(), quick());
    let extent = player.extent();
    let mut playhead = Playhead::default();
    assert_eq!(playhead.mode(), PlayheadMode::Live);
    let ms = Duration::from_millis;
    let camera = looking(0.3, 16);
    let step = |player: &mut Player, playhead: &Playhead, now: Duration| {
        let at = player.position(playhead, now);
        let number = player.look(at, &camera).unwrap().moment.number;
        (number, player.n_seeks())
    };
    assert_eq!(step(&mut player, &playhead, ms(0)), (19, 0), "the present is the last frame");
    playhead.seek(at(0.2), ms(0));
    assert_eq!(step(&mut player, &playhead, ms(40)), (2, 1));
    playhead.play(ms(40), extent);
    assert_eq!(step(&mut player, &playhead, ms(140)), (3, 1));
    playhead.set_rate(2.0, ms(140), extent);
    assert_eq!(step(&mut player, &playhead, ms(240)), (5, 1));
    playhead.set_rate(-1.0, ms(240), extent);
    assert_eq!(step(&mut player, &playhead, ms(340)), (4, 1));
    playhead.pause(ms(440), extent);
    assert_eq!(step(&mut player, &playhead, ms(900)), (3, 1));
    assert_eq!(step(&mut player, &playhead, ms(5000)), (3, 1));
    playhead.seek(at(0.5), ms(5010));
    assert_eq!(step(&mut player, &playhead, ms(5010)), (5, 2));
    // Round a stretch that is repeated.
    playhead.set_rate(1.0, ms(5010), extent);
    playhead.set_range(Some((at(0.4), at(0.6))), ms(5010), extent);
    playhead.play(ms(5010), extent);
    assert_eq!(step(&mut player, &playhead, ms(5090)), (6, 2));
    assert_eq!(step(&mut player, &playhead, ms(5140)), (4, 3));
    // What follows a seek is as if nothing had been before.
    player.seek();
    let look = player.look(at(1.0), &looking(2.0, 16)).unwrap();
    let field = look.moment.field.as_ref().unwrap();
    let eye = looking(2.0, 16).pose().position_in_world;
    assert_eq!(player.weights().unwrap(), &field.target(&look.moment.mesh, &look.moment.views, eye));
}

#[test]
fn frames_that_are_ready_stay_within_their_bytes() {
    let (folder, _) = Rolling { n_frames: 6, n_cameras: 2, ..Rolling::default() }.write();
    let camera = looking(0.3, 16);
    let mut whole = player(folder.path(), quick());
    let one = whole.moment(at(0.0)).unwrap().n_bytes();
    let mut tight = player(folder.path(), PlayerSettings { cache_bytes: one * 5 / 2, ..quick() });
    for secs in [0.0, 0.1, 0.2, 0.3, 0.2, 0.0, 0.5] {
        tight.look(at(secs), &camera).unwrap();
        let counts = tight.counts();
        assert!(counts.n_bytes <= one * 5 / 2 && (1..=2).contains(&counts.n_kept), "{counts:?}");
    }
    let counts = tight.counts();
    assert_eq!((counts.n_read, counts.n_found, counts.n_gone), (6, 1, 4));
    // One stays, however large.
    let mut none = player(folder.path(), PlayerSettings { cache_bytes: 0, ..quick() });
    none.look(at(0.0), &camera).unwrap();
    none.look(at(0.01), &camera).unwrap();
    assert_eq!((none.counts().n_read, none.counts().n_found, none.counts().n_kept), (1, 1, 1));
}

#[test]
fn pictures_of_other_sizes_and_exposures_meet() {
    let unlike = Rolling {
        n_frames: 1,
        size: |i| [48, 96, 64][i % 3],
        exposure: |i| [0.6, 1.0, 1.25][i % 3],
        ..Rolling::default()
    };
    let (folder, mut document) = unlike.write();
    // Calibrated at another size than the pictures have.
    for camera in &mut document.cameras {
        let of = |key: &str, i: usize| camera.calibration[key][i].as_f64().unwrap();
        let scaled = |key: &str| json!([of(key, 0) * 4.0, of(key, 1) * 4.0]);
        let [focal, center] = ["focal_px", "center_px"].map(scaled);
        let size = json!([of("image_size_px", 0) as u32 * 4, of("image_size_px", 1) as u32 * 4]);
        camera.calibration["focal_px"] = focal;
        camera.calibration["center_px"] = center;
        camera.calibration["image_size_px"] = size;
    }
    manifest(folder.path(), &document);
    let camera = looking(0.5, 64);
    let rmse = |is_evened: bool| {
        let settings = quick();
        let fields = FieldSettings { is_evened, ..settings.fields };
        let mut player = player(folder.path(), PlayerSettings { fields, ..settings });
        let look = player.look(at(0.0), &camera).unwrap();
        off(&look, &camera, 0.0)
    };
    let (evened, uneven) = (rmse(true), rmse(false));
    assert!(evened < 8.0 && uneven > 1.5 * evened, "{evened} evened, {uneven} not");
    let found = check(&mut open(folder.path()).unwrap(), |_| ());
    assert_eq!(found.n_faults, 0, "{:?}", found.faults);
    // Stretched ones are told.
    save(&folder.path().join("c0-000.png"), &RgbImage { width: 60, height: 30, data: vec![9; 5400] });
    let found = check(&mut open(folder.path()).unwrap(), |_| ());
    assert!(found.faults[0].starts_with("/cameras/0: a picture of 60 x 30"), "{:?}", found.faults);
}

fn light_of(picture: &RgbImage, is_mesh: &[bool]) -> Vec<Vec3> {
    let pixels = picture.data.as_chunks::<3>().0.iter().zip(is_mesh).filter(|(_, is)| **is);
    pixels.map(|(codes, _)| Vec3::from(codes.map(|code| linear_from_srgb(f32::from(code) / 255.0)))).collect()
}

#[test]
fn what_no_camera_sees_looks_like_what_is_around_it_or_as_the_mesh_says() {
    let (folder, mut document) = Rolling { n_frames: 1, ..Rolling::default() }.write();
    // One camera, and who looks from behind.
    document.cameras.truncate(1);
    manifest(folder.path(), &document);
    let behind = looking(std::f64::consts::PI, 32);
    for mixing in Mixing::ALL {
        let look =
            player(folder.path(), PlayerSettings { mixing, ..quick() }).look(at(0.0), &behind).unwrap();
        let shaded = look.shaded.unwrap();
        let lights = light_of(&shaded.picture, &look.is_mesh);
        assert!(lights.len() > 100);
        assert!(lights.iter().all(|light| light.is_finite() && light.max_element() > 0.02), "{mixing:?}");
        assert!(shaded.covered.data.iter().filter(|of| **of > 0).count() < lights.len() / 3);
    }
    // Nobody at all, and a mesh with colours of its own.
    document.cameras.clear();
    manifest(folder.path(), &document);
    let mut mesh = ball(0, middle(0.0));
    let color = |at: &DVec3| videofields_vision::frame::codes_of(paint(*at - middle(0.0)));
    mesh.colors_srgb = Some(mesh.positions_m.iter().map(color).collect());
    write_mesh(&folder.path().join("000.ply"), &mesh);
    let look = player(folder.path(), quick()).look(at(0.0), &behind).unwrap();
    let shaded = look.shaded.unwrap();
    let (truth, _) = picture(&behind, 0.0, 1.0);
    let pairs = truth.data.iter().zip(&shaded.picture.data).zip(look.is_mesh.iter().flat_map(|is| [is; 3]));
    let differences: Vec<f64> =
        pairs.filter(|(_, is)| **is).map(|((a, b), _)| f64::from(a.abs_diff(*b))).collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    assert!(mean < 6.0, "{mean}");
}

#[test]
fn frames_where_nobody_is_show_nothing_and_are_no_fault() {
    let (folder, _) = Rolling { n_cameras: 2, ..Rolling::default() }.write();
    write_mesh(&folder.path().join("001.ply"), &Mesh::default());
    let mut player = player(folder.path(), quick());
    let camera = looking(0.3, 16);
    for secs in [0.0, 0.1, 0.2] {
        assert_eq!(player.look(at(secs), &camera).unwrap().shaded.is_none(), secs == 0.1);
    }
    assert_eq!(check(&mut open(folder.path()).unwrap(), |_| ()).n_empty, 1);
}

#[test]
fn units_and_axes_of_meshes_become_the_worlds_whatever_their_files_are() {
    let (folder, mut document) = Rolling { n_frames: 1, n_cameras: 0, ..Rolling::default() }.write();
    let truth = ball(0, middle(0.0));
    let mut glb = Vec::new();
    truth.write_glb(&mut glb).unwrap();
    fs::write(folder.path().join("0.glb"), glb).unwrap();
    // y up, millimetres, as OBJ.
    let mut text = String::new();
    for DVec3 { x, y, z } in &truth.positions_m {
        text += &format!("v {} {} {}\n", x * 1000.0, z * 1000.0, -y * 1000.0);
    }
    for [a, b, c] in &truth.triangles {
        text += &format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    }
    fs::write(folder.path().join("0.obj"), text).unwrap();
    for (file, unit, up) in
        [("000.ply", None, None), ("0.glb", None, None), ("0.obj", Some(1e-3), Some("y".to_owned()))]
    {
        document.meshes.pattern = None;
        document.meshes.list = Some(vec![Some(file.to_owned())]);
        (document.meshes.metres_per_unit, document.meshes.up) = (unit, up);
        manifest(folder.path(), &document);
        let sequence = open(folder.path()).unwrap();
        let mesh = sequence.mesh(0).unwrap().mesh;
        assert_eq!(mesh.triangles.len(), truth.triangles.len(), "{file}");
        assert!((mesh.volume_m3() / truth.volume_m3() - 1.0).abs() < 1e-5, "{file}");
        for at in &mesh.positions_m {
            assert!(((*at - middle(0.0)).length() - 1.0).abs() < 1e-5, "{file}: {at}");
        }
        // One frame stands for ever.
        assert_eq!(sequence.frame_at(at(1e6)).unwrap(), 0);
    }
    document.meshes.list = Some(vec![Some("0.stl".to_owned())]);
    manifest(folder.path(), &document);
    let error = open(folder.path()).unwrap().mesh(0).unwrap_err().to_string();
    assert!(error.contains(".ply, .obj, .gltf or .glb"), "{error}");
}

#[test]
fn triangles_that_fast_motion_drew_out_are_left_out_and_told() {
    let (folder, mut document) = Rolling { n_frames: 2, n_cameras: 1, ..Rolling::default() }.write();
    let mut mesh = ball(0, middle(0.0));
    let n_triangles = mesh.triangles.len();
    mesh.positions_m.push(middle(0.0) + DVec3::Z * 6.0);
    let hand = mesh.positions_m.len() as u32 - 1;
    let [a, b, _] = mesh.triangles[40];
    mesh.triangles.push([a, b, hand]);
    write_mesh(&folder.path().join("000.ply"), &Mesh::new(mesh.positions_m, mesh.triangles));
    let found = open(folder.path()).unwrap().mesh(0).unwrap();
    assert_eq!((found.n_extruded, found.mesh.triangles.len()), (1, n_triangles));
    assert!(found.mesh.bounds().unwrap()[1].z < 2.6);
    assert_eq!(check(&mut open(folder.path()).unwrap(), |_| ()).n_extruded, 1);
    document.meshes.extruded_times = Some(0.0);
    manifest(folder.path(), &document);
    let found = open(folder.path()).unwrap().mesh(0).unwrap();
    assert_eq!((found.n_extruded, found.mesh.triangles.len()), (0, n_triangles + 1));
}

#[test]
fn files_beside_the_roots_are_not_opened() {
    let (folder, document) = Rolling { n_frames: 1, n_cameras: 1, ..Rolling::default() }.write();
    let other = tempfile::tempdir().unwrap();
    write_mesh(&other.path().join("000.ply"), &ball(0, DVec3::ZERO));
    let refused = |document: &SequenceDocument| {
        manifest(folder.path(), document);
        let error = open(folder.path()).and_then(|sequence| sequence.mesh(0)).unwrap_err();
        assert!(error.to_string().contains("outside the media roots"), "{error}");
    };
    let mut elsewhere = document.clone();
    elsewhere.meshes.pattern = Some(other.path().join("%03d.ply").to_str().unwrap().to_owned());
    refused(&elsewhere);
    elsewhere.meshes.pattern = None;
    elsewhere.meshes.list = Some(vec![Some(other.path().join("000.ply").to_str().unwrap().to_owned())]);
    refused(&elsewhere);
    let mut link = document;
    std::os::unix::fs::symlink(other.path().join("000.ply"), folder.path().join("link.ply")).unwrap();
    link.meshes.pattern = None;
    link.meshes.list = Some(vec![Some("link.ply".to_owned())]);
    refused(&link);
}
