//! Proof that a world runs the effects that it names and no other, and that the same seed gives the same bytes.
//!
//! Whole worlds are written to folders and read back; what each effect does is tested beside it.

use super::effects::{CastShadows, EffectKind, EffectStage, Effects};
use super::shape::{Part, Shape};
use super::solids::Solids;
use super::{ExtraView, SimulateOptions, World, write};
use glam::{DMat3, DVec3};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The plaza with a tree beside the rose, without any effect.
fn plaza_with_a_tree() -> World {
    let mut world = World::plaza().with_effects(Effects::default());
    let part = |shape| Part { shape, color: DVec3::new(0.1, 0.2, 0.05) };
    let foot = DVec3::new(-6.0, 3.0, 0.0);
    let post = Shape::Capsule { from: foot, to: foot + DVec3::Z * 2.0, radius_m: 0.15 };
    let axes = DMat3::IDENTITY;
    let crown = Shape::ellipsoid(
        foot + DVec3::Z * 3.2,
        [axes.x_axis, axes.y_axis, axes.z_axis],
        DVec3::new(1.3, 1.3, 1.5),
    );
    let surfaces = world.solids.surfaces().clone();
    world.solids = Solids::with_shapes(surfaces, None, vec![part(post)], vec![part(crown)]);
    world
}

fn options(out_dir: &Path) -> SimulateOptions {
    SimulateOptions {
        seconds: Some(0.6),
        size_px: Some((64, 36)),
        samples_per_side: 1,
        truth_every_frames: 3,
        extra_views: vec![ExtraView {
            name: "south".to_owned(),
            eye_in_world: DVec3::new(0.0, -14.0, 4.0),
            target_in_world: DVec3::new(0.0, 2.0, 1.0),
            fov_y_rad: 0.8,
            size_px: (40, 30),
        }],
        ..SimulateOptions::new(out_dir)
    }
}

#[test]
fn what_is_not_named_is_not_entered() {
    let plain = plaza_with_a_tree();
    for named in EffectKind::ALL.into_iter().map(Some).chain([None]) {
        let folder = tempfile::tempdir().expect("a folder");
        let effects = named.into_iter().fold(Effects::default(), Effects::with);
        let world = plain.with_effects(effects);
        write(&world, &options(folder.path())).expect("it can be simulated");
        for kind in EffectKind::ALL {
            let count = world.entries().count(kind);
            let name = named.map_or("nothing", EffectKind::id);
            assert_eq!(count > 0, named == Some(kind), "{} with {name}: {count}", kind.id());
        }
    }
}

/// Every file beneath a folder, by its path.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let bytes = std::fs::read(&path).expect("a file");
                found.insert(path.strip_prefix(folder).expect("it lies there").to_owned(), bytes);
            }
        }
    }
    found
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let all = EffectKind::ALL.into_iter().fold(Effects::default(), Effects::with);
    let written = |threads: usize, seed: u64| {
        let folder = tempfile::tempdir().expect("a folder");
        let world = plaza_with_a_tree().with_effects(Effects { seed, ..all.clone() });
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| write(&world, &options(folder.path()))).expect("it can be simulated");
        let mut files = files(folder.path());
        // A WebM file has a random id and a date; what it shows is compared by the suite.
        files.retain(|path, _| path.extension().is_none_or(|extension| extension != "webm"));
        files
    };
    let first = written(1, 5);
    assert!(first.len() > 60, "{}", first.len());
    for threads in [1, 2, 5] {
        let again = written(threads, 5);
        assert_eq!(again.keys().collect::<Vec<_>>(), first.keys().collect::<Vec<_>>());
        for (path, bytes) in &again {
            assert!(first[path] == *bytes, "{} differs on {threads} threads", path.display());
        }
    }
    let other = written(2, 6);
    let frame = Path::new("truth/west/frame/000003.png");
    assert!(other[frame] != first[frame], "another seed gives another picture");
}

/// The bits of the plaza's first frames: pictures, instances and depths of its three cameras at three times. They
/// change when the plaza, the caster or the machine's own sine and exponential do; then look at the pictures, and
/// write down the new digest.
const PLAZA_DIGEST: &str = "a79e3effab93616258842a9fbc16f6ef28e839a0c02a762991df0f51f9ce4085";

#[test]
fn the_plaza_keeps_its_bits() {
    let world = World::plaza();
    let shadows = Effects { cast_shadows: Some(CastShadows::STILL), ..Effects::default() };
    assert_eq!(
        *world.effects(),
        shadows,
        "the plaza names the shadows of what stands still, and nothing else"
    );
    let mut digest = Sha256::new();
    for (id, camera) in world.cameras((160, 90)).expect("cameras") {
        for time_secs in [0.0, 7.3, 19.9] {
            let truth = world.render(&camera, time_secs, 2).expect("a picture");
            digest.update(AsRef::<str>::as_ref(&id).as_bytes());
            digest.update(&truth.rgb.data);
            digest.update(&truth.instance.data);
            // Depths in millimetres, as they are written.
            for depth_m in &truth.depth_m {
                digest.update(((depth_m * 1000.0 + 0.5) as u16).to_le_bytes());
            }
        }
    }
    let got: String = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(got, PLAZA_DIGEST);
    let entered: Vec<_> =
        EffectKind::ALL.into_iter().filter(|kind| world.entries().count(*kind) > 0).collect();
    assert_eq!(entered, [EffectKind::CastShadows]);
}

#[test]
fn effects_of_sensors_and_delivery_leave_the_clean_truth_alone() {
    let plain = plaza_with_a_tree();
    let cast = |world: &World| {
        let folder = tempfile::tempdir().expect("a folder");
        write(world, &options(folder.path())).expect("it can be simulated");
        files(folder.path())
    };
    let bare = cast(&plain);
    let effects = EffectKind::ALL
        .into_iter()
        .filter(|kind| kind.stage() != EffectStage::Scene)
        .fold(Effects::default(), Effects::with);
    let full = cast(&plain.with_effects(effects));
    for id in ["west", "east", "north"] {
        let of = |files: &BTreeMap<PathBuf, Vec<u8>>, kind: &str| {
            files[&PathBuf::from(format!("truth/{id}/{kind}/000003.png"))].clone()
        };
        assert!(of(&full, "clean") == of(&bare, "frame"), "{id}: clean is what it would be without");
        assert!(of(&full, "frame") != of(&bare, "frame"), "{id}: the sensor shows");
        for kind in ["instance", "label", "depth", "normal", "shadow"] {
            assert!(of(&full, kind) == of(&bare, kind), "{id}: {kind}");
        }
    }
}
