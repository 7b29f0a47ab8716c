//! Effects seen from outside: clips hold what arrived, truth is in the formats that its manifest says.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use glam::DVec3;
use serde_json::Value;
use std::path::Path;
use videofields_simulate::effects::{
    CastShadows, Casters, Clock, Compression, Corrupt, Damage, Drop, Duplicate, Noise,
};
use videofields_simulate::{Effects, SimulateError, SimulateOptions, World, write};
use videofields_testing::video::decode_timed;
use videofields_vision::frame::RgbImage;
use videofields_vision::measures::compare;

fn options(out_dir: &Path) -> SimulateOptions {
    SimulateOptions {
        seconds: Some(4.0),
        size_px: Some((96, 54)),
        samples_per_side: 1,
        truth_every_frames: 4,
        ..SimulateOptions::new(out_dir)
    }
}

fn json_lines(path: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn rgb(path: &Path) -> RgbImage {
    let image = image::open(path).unwrap().into_rgb8();
    RgbImage { width: image.width(), height: image.height(), data: image.into_raw() }
}

fn has(line: &Value, fate: &str) -> bool {
    line["fates"].as_array().unwrap().iter().any(|value| value == fate)
}

#[test]
fn a_clip_holds_what_arrived_at_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let effects = Effects {
        drop: Some(Drop { share: 0.2, burst_frames: 2 }),
        duplicate: Some(Duplicate { share: 0.2 }),
        corrupt: Some(Corrupt { share: 0.3, extent: 0.3, damage: Damage::Blocks }),
        clock: Some(Clock { most_offset_secs: 3.0, most_drift_ppm: 50_000.0 }),
        ..Effects::default()
    };
    let mut options = options(folder.path());
    options.truth_every_frames = 1;
    write(&World::plaza().with_effects(effects), &options).unwrap();
    for id in ["west", "east", "north"] {
        let lines = json_lines(&folder.path().join(format!("truth/{id}/delivery.jsonl")));
        let n_dropped = lines.iter().filter(|line| has(line, "dropped")).count();
        let n_second = lines.iter().filter(|line| line["copy"] == 1).count();
        assert!(n_dropped > 0 && n_second > 0, "{id}: {n_dropped} dropped, {n_second} twice");
        let arrived: Vec<_> = lines.iter().filter(|line| !has(line, "dropped")).collect();
        let decoded = decode_timed(&folder.path().join(format!("clips/{id}.webm")));
        assert_eq!(decoded.len(), arrived.len(), "{id}");
        let (mut n_whole, mut n_damaged) = (0, 0);
        for ((picture, secs), line) in decoded.iter().zip(&arrived) {
            // WebM keeps whole milliseconds.
            let expected = line["clip_secs"].as_f64().unwrap();
            assert!((secs - expected).abs() < 0.001_1, "{id}: {secs} s, expected {expected} s");
            let frame = line["frame"].as_u64().unwrap();
            let truth = rgb(&folder.path().join(format!("truth/{id}/frame/{frame:06}.png")));
            let psnr_db = compare(&truth, picture, None).unwrap().psnr_db.unwrap();
            if has(line, "corrupted") {
                assert!(psnr_db < 30.0, "{id} frame {frame} is damaged but has {psnr_db} dB");
                n_damaged += 1;
            } else {
                assert!(psnr_db > 31.0, "{id} frame {frame} is whole but has {psnr_db} dB");
                n_whole += 1;
            }
        }
        assert!(n_whole > 5 && n_damaged > 3, "{id}: {n_whole} whole, {n_damaged} damaged");
    }
}

#[test]
fn damaged_bytes_are_still_a_file_that_a_decoder_reads() {
    let folder = tempfile::tempdir().unwrap();
    let effects = Effects {
        corrupt: Some(Corrupt { share: 0.2, extent: 0.02, damage: Damage::Bytes }),
        ..Effects::default()
    };
    write(&World::plaza().with_effects(effects), &options(folder.path())).unwrap();
    let lines = json_lines(&folder.path().join("truth/west/delivery.jsonl"));
    let first = lines.iter().position(|line| has(line, "corrupted")).unwrap();
    let decoded = decode_timed(&folder.path().join("clips/west.webm"));
    assert!(decoded.len() > 20, "{} frames", decoded.len());
    let whole = tempfile::tempdir().unwrap();
    write(&World::plaza().with_effects(Effects::default()), &options(whole.path())).unwrap();
    let reference = decode_timed(&whole.path().join("clips/west.webm"));
    assert_eq!(reference.len(), 40);
    for ((picture, secs), (other, _)) in decoded.iter().zip(&reference).take(first) {
        assert_eq!(picture.data, other.data, "{secs} s comes before any damage");
    }
    assert!(decoded.iter().zip(&reference).any(|((a, _), (b, _))| a.data != b.data), "nothing is damaged");
}

#[test]
fn compression_costs_quality_and_saves_bytes() {
    let size_and_psnr = |compression| {
        let folder = tempfile::tempdir().unwrap();
        let effects = Effects { compression, ..World::plaza().effects().clone() };
        write(&World::plaza().with_effects(effects), &options(folder.path())).unwrap();
        let clip = folder.path().join("clips/west.webm");
        let truth = rgb(&folder.path().join("truth/west/frame/000008.png"));
        let psnr_db = compare(&truth, &decode_timed(&clip)[8].0, None).unwrap().psnr_db.unwrap();
        (std::fs::metadata(&clip).unwrap().len(), psnr_db)
    };
    let (fine, coarse) = (size_and_psnr(None), size_and_psnr(Some(Compression::default())));
    assert!(coarse.0 * 2 < fine.0 && coarse.1 + 4.0 < fine.1, "{fine:?} {coarse:?}");
    let spent = Compression { bitrate_kbit_per_sec: Some(20), quantizer: 4, ..Compression::default() };
    let spent = size_and_psnr(Some(spent));
    assert!(spent.0 < fine.0 && spent.1 < fine.1, "{fine:?} {spent:?}");
}

#[test]
fn truth_is_in_the_formats_that_its_manifest_says() {
    let folder = tempfile::tempdir().unwrap();
    let effects = Effects {
        cast_shadows: Some(CastShadows { casters: Casters::All, sun_diameter_deg: 0.0 }),
        noise: Some(Noise::default()),
        ..Effects::default()
    };
    let world = World::plaza().with_effects(effects);
    let mut options = options(folder.path());
    options.size_px = Some((160, 90));
    options.samples_per_side = 2;
    write(&world, &options).unwrap();
    let truth = folder.path().join("truth");
    let manifest: Value =
        serde_json::from_str(&std::fs::read_to_string(truth.join("truth.json")).unwrap()).unwrap();
    assert_eq!(
        (&manifest["version"], &manifest["world"], &manifest["n_frames"]),
        (&1.into(), &"plaza".into(), &40.into())
    );
    assert_eq!(manifest["effects"]["noise"]["full_well_electrons"], Noise::default().full_well_electrons);
    let west = truth.join("west");
    for (path, _) in manifest["files"].as_object().unwrap() {
        let path = path.replace("<camera>", "west").replace("NNNNNN", "000004");
        let is_of_view = path.starts_with("<view>");
        assert!(is_of_view || truth.join(&path).is_file(), "{path} is told of but not there");
    }
    for camera in manifest["cameras"].as_array().unwrap() {
        assert!(truth.join(camera["clip"].as_str().unwrap()).is_file());
        assert!(truth.join(camera["calibration"].as_str().unwrap()).is_file());
        assert_eq!(camera["clean"], "clean");
    }
    let label = image::open(west.join("label/000004.png")).unwrap();
    assert!(matches!(label, image::DynamicImage::ImageLuma8(_)));
    let label = label.into_luma8().into_raw();
    let count = |value: u8| label.iter().filter(|got| **got == value).count();
    assert_eq!(count(0) + count(50) + count(85) + count(170) + count(255), label.len());
    assert!(
        count(0) > 10_000 && count(50) > 2 && count(170) > 20 && count(255) > 20,
        "{} {} {}",
        count(50),
        count(170),
        count(255)
    );
    assert_eq!(count(85), 0, "this lens brings light everywhere");
    let instance = image::open(west.join("instance/000004.png")).unwrap().into_luma8().into_raw();
    let shadow = image::open(west.join("shadow/000004.png")).unwrap().into_luma8().into_raw();
    for ((label, instance), shadow) in label.iter().zip(&instance).zip(&shadow) {
        match label {
            255 => assert!(*instance > 0),
            0 => assert!(*instance == 0 && *shadow == 0),
            50 => assert!(*instance == 0 && *shadow == 255),
            _ => assert_eq!(*label, 170),
        }
    }
    let normal = image::open(west.join("normal/000004.png")).unwrap();
    assert!(matches!(normal, image::DynamicImage::ImageRgb16(_)));
    let normal = normal.into_rgb16();
    let depth = image::open(west.join("depth/000004.png")).unwrap();
    assert!(matches!(depth, image::DynamicImage::ImageLuma16(_)));
    let depth = depth.into_luma16();
    let (_, camera) = &world.cameras((160, 90)).unwrap()[0];
    let (mut n_ground, mut n_feet) = (0, 0);
    for (x, y, code) in normal.enumerate_pixels() {
        let depth_mm = depth.get_pixel(x, y).0[0];
        if code.0 == [u16::MAX; 3] {
            assert_eq!(depth_mm, 0, "only the sky has no normal");
            continue;
        }
        let normal = DVec3::from_array(code.0.map(|code| f64::from(code) / 32_767.0 - 1.0));
        assert!((normal.length() - 1.0).abs() < 1e-3, "{normal}");
        let at = glam::DVec2::new((f64::from(x) + 0.5) / 160.0, (f64::from(y) + 0.5) / 90.0);
        let ray = camera.ray(at).unwrap();
        let place =
            ray.at(f64::from(depth_mm) / 1000.0 / ray.direction.dot(camera.pose().forward_in_world()));
        if place.z.abs() < 0.002 && instance[(y * 160 + x) as usize] == 0 {
            // A wall's foot is as low as the ground.
            let is_up = (normal - DVec3::Z).length() < 1e-3;
            (n_ground, n_feet) = (n_ground + usize::from(is_up), n_feet + usize::from(!is_up));
        }
    }
    assert!(n_ground > 5000 && n_feet < 50, "{n_ground} level, {n_feet} upright");
    let seen_by = image::open(west.join("seen_by.png")).unwrap().into_luma8().into_raw();
    assert!(seen_by.iter().all(|count| *count <= 2) && seen_by.contains(&2) && seen_by.contains(&0));
    let visible = json_lines(&west.join("visible.jsonl"));
    let figure = &visible[1]["figures"][0];
    let of = figure["instance"].as_u64().unwrap();
    let n_pixels = instance.iter().filter(|value| u64::from(**value) == of).count();
    assert_eq!((visible[1]["frame"].as_u64(), figure["n_pixels"].as_u64()), (Some(4), Some(n_pixels as u64)));
    // The rectangle of what is visible lies in that around the whole box.
    let positions = json_lines(&truth.join("positions.jsonl"));
    let boxed = positions[4]["figures"].as_array().unwrap().iter().find(|f| f["instance"] == of).unwrap();
    for edge in 0..4 {
        let (seen, all) = (
            figure["rectangle_px"][edge].as_f64().unwrap(),
            boxed["rectangles_px"]["west"][edge].as_f64().unwrap(),
        );
        let is_inside = if edge < 2 { seen >= all - 1.0 } else { seen <= all + 1.0 };
        assert!(is_inside, "edge {edge}: {seen} against {all}");
    }
}

#[test]
fn a_camera_of_which_nothing_arrives_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let effects = Effects { drop: Some(Drop { share: 0.99, burst_frames: 1000 }), ..Effects::default() };
    let mut options = options(folder.path());
    (options.seconds, options.truth_every_frames) = (Some(0.1), 0);
    let refused = (0..400).find_map(|seed| {
        let world = World::plaza().with_effects(Effects { seed, ..effects.clone() });
        write(&world, &options).err()
    });
    assert!(matches!(refused, Some(SimulateError::NothingArrives { .. })), "{refused:?}");
}
