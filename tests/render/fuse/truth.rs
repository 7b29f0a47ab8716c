//! How often a simulated person is one entity with one id where several cameras see them: held against the truth.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use super::{Figure, camera, observe, scene as scene_with};
use glam::DVec3;
use std::sync::Arc;
use videofields_lab::entities::EntityScore;
use videofields_picture::fuse::{Placing, SceneState, assemble};
use videofields_picture::scene::{self, Scene};
use videofields_recording::ingest::Pipeline;
use videofields_simulate::{ActorKind, FigurePosition, Station, Wanted, World};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings};
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage};
use videofields_vision::observation::Observation;
use videofields_vision::segment::MOVING;

/// What every camera saw at one instant, and whom each pixel shows.
type Instant = Vec<(Observation, Mask)>;

/// Plays `secs` of a world twice, once to learn and once to keep.
fn play(world: &World, size_px: (u32, u32), rate_hz: f64, secs: f64) -> (Arc<Scene>, Vec<Instant>) {
    let text = world.scene_json(size_px).unwrap();
    let scene = scene::parse(world.id(), &text, scene::no_imports).unwrap().scene;
    let n_frames = (secs * rate_hz) as u64;
    let mut instants: Vec<Instant> = (0..n_frames).map(|_| Vec::new()).collect();
    for (id, camera) in world.cameras(size_px).unwrap() {
        let mut station = Station::new(world, id, &camera, 1, rate_hz, Wanted::Picture).unwrap();
        let mut shots = Vec::new();
        for number in 0..n_frames {
            let shot = station.shoot(number, number as f64 / rate_hz, Wanted::Picture).unwrap();
            let image = YuvImage::from_rgb(shot.picture(), ColorMatrix::Bt601, ColorRange::Limited).unwrap();
            shots.push((Arc::new(image), shot.truth.instance));
        }
        let mut pipeline = Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default());
        for number in 0..2 * n_frames {
            let (image, truth) = &shots[(number % n_frames) as usize];
            let timestamp = Timestamp::from_nanos((number as f64 / rate_hz * 1e9) as i64);
            let camera = CameraId::new(id).unwrap();
            let seen = pipeline.process(Frame { camera, timestamp, number, image: Arc::clone(image) });
            if number >= n_frames {
                instants[(number - n_frames) as usize].push((seen, truth.clone()));
            }
        }
    }
    (Arc::new(scene), instants)
}

/// The plaza's three cameras and three people, at ten frames a second. Grouping by the nearest feet alone showed people
/// twice at 119 of 553 instants.
#[test]
fn people_on_the_plaza_are_drawn_once_and_keep_their_ids() {
    let world = World::named("plaza").unwrap();
    let (scene, instants) = play(&world, (480, 270), 10.0, world.period_secs());
    let (mut within, mut alone) = (EntityScore::default(), EntityScore::default());
    let mut placing = Placing::default();
    for instant in &instants {
        let at = instant[0].0.frame.timestamp;
        let observe = |id: &CameraId| {
            let of = instant.iter().find(|(seen, _)| seen.frame.camera == *id);
            of.map(|(seen, _)| seen.clone())
        };
        let truths: Vec<&Mask> = instant.iter().map(|(_, truth)| truth).collect();
        let figures = world.figures(at.as_nanos() as f64 * 1e-9 % world.period_secs()).unwrap();
        within.add(&placing.assemble(&scene, at, observe), &truths, &figures);
        alone.add(&assemble(&scene, at, observe, None), &truths, &figures);
    }
    assert!(within.n_seen_twice > 500 && within.n_joined > 400, "{within:?}");
    assert!(within.n_duplicates <= 3 && within.n_mixed <= 3 && within.n_switches <= 10, "{within:?}");
    let [mean_m, most_m, _] = within.place_error_m().expect("somebody is shown");
    assert!(mean_m < 0.5 && most_m < 1.5, "{mean_m} m, 95 % {most_m} m");
    assert!(within.n_missed <= 80, "{within:?}");
    // Who is seen whole by two cameras is one, always.
    assert!(within.n_possible > 200, "{within:?}");
    assert_eq!(within.n_parted, 0, "{within:?}");
    assert!(alone.n_duplicates <= 60 && alone.n_mixed <= 5, "an instant alone: {alone:?}");
}

/// Somebody at the origin, 3 in truth.
fn somebody() -> FigurePosition {
    FigurePosition {
        instance: 3,
        name: "somebody".to_owned(),
        kind: ActorKind::Walker,
        foot_in_world: DVec3::ZERO,
        heading_rad: 0.0,
        height_m: 1.7,
        box_in_world: (DVec3::ZERO, DVec3::ONE),
    }
}

/// Truth that says of all that moves that it is [`somebody`], a camera.
fn truths_of(state: &SceneState) -> Vec<Mask> {
    let truth = |labels: &Mask| {
        let data = labels.data.iter().map(|label| u8::from(*label == MOVING) * 3).collect();
        Mask { width: labels.width, height: labels.height, data }
    };
    state.cameras.iter().map(|camera| truth(&camera.observation.labels)).collect()
}

#[test]
fn who_is_shown_twice_or_not_at_all_is_counted_and_measured() {
    let cameras = [-9.0, 9.0].map(|x| camera(DVec3::new(x, -10.0, 5.0), DVec3::ZERO, 0.0));
    // The second camera is off by 4 m: nobody takes what it sees for the same person.
    let seen_by = [0.0, 4.0].map(|x| Figure { foot: DVec3::X * x, width_m: 0.5, height_m: 1.7 });
    let scene = scene_with(&cameras, Vec::new());
    let find = |id: &CameraId| {
        let idx = scene.cameras.iter().position(|member| member.id == *id)?;
        Some(observe(id, &cameras[idx], &seen_by[idx..=idx]))
    };
    let mut state = assemble(&scene, Timestamp::from_nanos(7), find, None);
    let truths = truths_of(&state);
    let truths: Vec<&Mask> = truths.iter().collect();
    let figure = somebody();
    let mut score = EntityScore::default();
    score.add(&state, &truths, std::slice::from_ref(&figure));
    assert_eq!((score.n_seen, score.n_missed, score.n_seen_twice), (1, 0, 1), "{score:?}");
    assert_eq!(
        (score.n_duplicates, score.n_joined, score.n_mixed, score.n_ghosts),
        (1, 0, 0, 0),
        "{score:?}"
    );
    let [mean_m, _, worst_m] = score.place_error_m().unwrap();
    assert!((mean_m - 2.0).abs() < 0.1 && (worst_m - 4.0).abs() < 0.1, "{mean_m} m, {worst_m} m");
    // What the second camera sees is not where they stand: one sight alone is whole.
    assert_eq!((score.n_possible, score.n_parted), (0, 0), "{score:?}");
    // Without entities somebody is missed, and without truth an entity shows nobody.
    let entities = std::mem::take(&mut state.entities);
    score.add(&state, &truths, std::slice::from_ref(&figure));
    state.entities = entities;
    let nobody = Mask::filled(truths[0].width, truths[0].height, 0);
    score.add(&state, &[&nobody, &nobody], &[]);
    assert_eq!((score.n_seen, score.n_missed, score.n_ghosts), (2, 1, 2), "{score:?}");
}

#[test]
fn who_is_seen_whole_by_two_cameras_and_is_two_entities_counts_as_parted() {
    let cameras = [-9.0, 9.0].map(|x| camera(DVec3::new(x, -10.0, 5.0), DVec3::ZERO, 0.0));
    let figure = Figure { foot: DVec3::ZERO, width_m: 0.5, height_m: 1.7 };
    let scene = scene_with(&cameras, Vec::new());
    let find = |id: &CameraId| {
        let idx = scene.cameras.iter().position(|member| member.id == *id)?;
        Some(observe(id, &cameras[idx], std::slice::from_ref(&figure)))
    };
    let mut state = assemble(&scene, Timestamp::from_nanos(7), find, None);
    assert_eq!(state.entities.len(), 1);
    let truths = truths_of(&state);
    let figure = somebody();
    let count = |state: &SceneState, truths: &[Mask], figure: &FigurePosition| {
        let mut score = EntityScore::default();
        score.add(state, &truths.iter().collect::<Vec<_>>(), std::slice::from_ref(figure));
        (score.n_possible, score.n_parted)
    };
    assert_eq!(count(&state, &truths, &figure), (1, 0));
    let mut other = state.entities[0].clone();
    other.id += 1;
    other.sources.remove(0);
    state.entities[0].sources.truncate(1);
    state.entities.push(other);
    assert_eq!(count(&state, &truths, &figure), (1, 1));
    // Feet that are hidden in truth, a figure that is half another's, or one at the border: not whole.
    let elsewhere = FigurePosition { foot_in_world: DVec3::new(0.0, -1.5, 0.0), ..figure.clone() };
    assert_eq!(count(&state, &truths, &elsewhere), (0, 0));
    // Nor is who shows their legs alone.
    let taller = FigurePosition { height_m: 2.6, ..figure.clone() };
    assert_eq!(count(&state, &truths, &taller), (0, 0));
    let halved = truths.iter().map(|truth| {
        let data =
            truth.data.iter().enumerate().map(|(idx, of)| if idx % 2 == 0 { *of } else { *of / 3 * 4 });
        Mask { data: data.collect(), ..truth.clone() }
    });
    assert_eq!(count(&state, &halved.collect::<Vec<_>>(), &figure), (0, 0));
}
