//! Recorded sequences in fused views: drawn as the processor shades them, at their times, and told where they are not.

use super::hulls::n_apart;
use super::{keep, renderer, v, view};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use videofields_lab::world_sequence::{SequenceOptions, write_sequence};
use videofields_picture::fuse::{SceneState, assemble};
use videofields_picture::plan::{
    self, Colors, EntityStyle, FieldsForm, Picture, Plan, Sampling, Settings, View, ViewSession, Wishes,
};
use videofields_picture::scene::exchange::{self, ExchangeFormat};
use videofields_picture::scene::{Scene, load_file};
use videofields_recording::ingest::MediaRoots;
use videofields_service::sequence::{Mixing, Player, PlayerSettings, SceneSequences, Sequence};
use videofields_simulate::World;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::clock::Timestamp;
use videofields_vision::geometry::{Camera, Distortion};

/// Somebody who walks over the plaza, seen by its cameras: three frames from 3 s on.
fn recorded(folder: &Path) {
    let options = SequenceOptions {
        seconds: 0.3,
        from_secs: 3.0,
        size_px: Some((320, 180)),
        samples_per_side: 1,
        step_m: 0.08,
        ..SequenceOptions::new(folder)
    };
    let n_frames = write_sequence(&World::plaza(), &options, |_, _| ()).expect("a sequence");
    assert_eq!(n_frames, 3);
}

const GROUND: &str =
    r##"{"polygon": [[-40, -40], [40, -40], [40, 40], [-40, 40]], "color_srgb": "#204020"}"##;

fn scene(folder: &Path, sequences: &str, boxes: &str) -> Arc<Scene> {
    let path = folder.join("scene.json");
    let text = format!(
        r##"{{"version": 1, "sky": {{"color_srgb": "#2040a0"}}, "ground": [{GROUND}], "boxes": [{boxes}], "sequences": [{sequences}]}}"##
    );
    std::fs::write(&path, text).expect("a file");
    Arc::new(load_file("place", &path, &[]).expect("a scene").scene)
}

fn opened(scene: &Scene) -> SceneSequences {
    SceneSequences::open(scene, &MediaRoots::usable(&[]), 64 << 20)
}

fn at(scene: &Arc<Scene>, opened: &mut SceneSequences, instant: Timestamp) -> SceneState {
    let mut state = assemble(scene, instant, |_| None, None);
    state.sequences = opened.at(instant);
    state
}

fn wishes(fields: FieldsForm) -> Wishes {
    let settings =
        Settings { entities: EntityStyle::None, fields, sampling: Sampling::ONCE, ..Settings::default() };
    Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() }
}

fn told(plan: &Plan) -> (bool, String) {
    let of = plan.reasons.iter().find(|reason| reason.effect == "changing_mesh").expect("a reason");
    (of.is_on, of.because.clone())
}

/// Where one of the people of a state's sequence stands, at half their height.
fn somebody(state: &SceneState, sequence: usize) -> DVec3 {
    let mesh = &state.sequences[sequence].moment.as_ref().expect("a frame").mesh;
    let first = mesh.positions_m[0];
    let near = mesh.positions_m.iter().filter(|at| at.truncate().distance(first.truncate()) < 1.0);
    let (sum, n) = near.fold((DVec3::ZERO, 0.0), |(sum, n), at| (sum + *at, n + 1.0));
    sum / n
}

fn looking_at(place: DVec3) -> View {
    view(place + v(0.9, -3.0, 1.0), place, 0.8, 160, 120)
}

#[test]
fn a_recorded_sequence_is_drawn_in_its_scene_as_the_processor_shades_it() {
    let Some(mut brush) = renderer("", 1) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    recorded(&folder.path().join("people"));
    let scene = scene(folder.path(), r#"{"id": "people", "file": "people"}"#, "");
    let mut opened = opened(&scene);
    let roots = MediaRoots::new(&[folder.path().to_path_buf()]).expect("roots");
    let sequence = || Sequence::open(&folder.path().join("people"), &roots).expect("a sequence");
    let first = sequence().frames()[0].at;
    let state = at(&scene, &mut opened, first);
    let looking = looking_at(somebody(&state, 0));
    let camera = {
        let ([left, right], [top, bottom]) = (looking.frustum.x, looking.frustum.y);
        let size = DVec2::new(160.0, 120.0);
        let focal_px = size / DVec2::new(right - left, bottom - top);
        Camera::new((160, 120), focal_px, -DVec2::new(left, top) * focal_px, Distortion::None, looking.pose)
            .expect("a camera")
    };
    for (form, mixing) in [
        (FieldsForm::Off, Mixing::Normals),
        (FieldsForm::Normals, Mixing::Normals),
        (FieldsForm::Montage, Mixing::Montage),
    ] {
        let plan = plan::make(&state, &looking.into(), wishes(form));
        assert_eq!(plan.sequences, [0]);
        assert_eq!(told(&plan), (true, "1 of 1 recorded sequences are there and in view".to_owned()));
        let drawn = brush.renderer.render(&state, &looking.into(), &plan).expect("a picture").image;
        let settings = PlayerSettings { mixing, ..PlayerSettings::default() };
        let look = Player::new(sequence(), settings).look(first, &camera).expect("a picture");
        let expected = look.shaded.expect("people").picture;
        keep(&format!("sequence-{}-found", form.as_str()), &drawn);
        keep(&format!("sequence-{}-expected", form.as_str()), &expected);
        let pairs = drawn.data.chunks_exact(3).zip(expected.data.chunks_exact(3)).zip(&look.is_mesh);
        let mut off: Vec<u8> = pairs
            .filter(|(_, is_mesh)| **is_mesh)
            .map(|((a, b), _)| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0))
            .collect();
        off.sort_unstable();
        assert!(off.len() > 150, "{} pixels of people", off.len());
        let at = |share: f64| off[(off.len() as f64 * share) as usize];
        assert!(at(0.5) <= 8 && at(0.8) <= 40, "{form:?}: {} and {} codes", at(0.5), at(0.8));
        // The same once more, and from the next frame another.
        assert_eq!(brush.renderer.render(&state, &looking.into(), &plan).expect("a picture").image, drawn);
    }
}

#[test]
fn sequences_are_shown_at_their_times_or_over_and_over_and_what_fails_is_told() {
    let Some(mut brush) = renderer("", 1) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    recorded(&folder.path().join("people"));
    std::fs::create_dir(folder.path().join("broken")).expect("a folder");
    std::fs::write(folder.path().join("broken/sequence.json"), r#"{"version": 1, "meshes": 7}"#)
        .expect("a file");
    let scene = scene(
        folder.path(),
        r#"{"id": "once", "file": "people/sequence.json"}, {"id": "again", "file": "people", "repeats": true},
           {"id": "broken", "file": "broken/sequence.json"}"#,
        "",
    );
    let mut opened = opened(&scene);
    let late = Timestamp::from_nanos(1_700_000_000_000_000_000);
    let state = at(&scene, &mut opened, late);
    assert!(state.sequences[0].moment.is_err() && state.sequences[1].moment.is_ok());
    let place = somebody(&state, 1);
    let looking: Picture = looking_at(place).into();
    let plan = plan::make(&state, &looking, wishes(FieldsForm::Montage));
    let (is_on, because) = told(&plan);
    assert!(is_on && plan.sequences == [1], "{because}");
    assert!(
        because.contains("once: there is no frame at")
            && because.contains("broken: it cannot be opened")
            && !because.contains("/meshes")
    );
    let shown = brush.renderer.render(&state, &looking, &plan).expect("a picture").image;
    // Nobody is there without it, and who looks elsewhere is not charged for it.
    let bare = SceneState { sequences: Vec::new(), ..state.clone() };
    let without = plan::make(&bare, &looking, wishes(FieldsForm::Montage));
    assert!(!without.reasons.iter().any(|reason| reason.effect == "changing_mesh"));
    let empty = brush.renderer.render(&bare, &looking, &without).expect("a picture").image;
    assert!(n_apart(&shown, &empty, 10) > 150);
    let away: Picture = view(place + v(0.0, 0.0, 60.0), place + v(0.0, 1.0, 90.0), 0.8, 64, 48).into();
    let plan = plan::make(&state, &away, wishes(FieldsForm::Montage));
    assert!(plan.sequences.is_empty() && !told(&plan).0);
    // A wall before them hides them.
    let wall = place + v(0.0, -1.5, 0.0);
    let boxed =
        format!(r#"{{"id": "wall", "center_m": [{}, {}, 3], "size_m": [60, 0.2, 30]}}"#, wall.x, wall.y);
    let hidden = self::scene(folder.path(), r#"{"id": "again", "file": "people", "repeats": true}"#, &boxed);
    let state = at(&hidden, &mut self::opened(&hidden), late);
    let images = [state.clone(), SceneState { sequences: Vec::new(), ..state }].map(|state| {
        let plan = plan::make(&state, &looking, wishes(FieldsForm::Montage));
        brush.renderer.render(&state, &looking, &plan).expect("a picture").image
    });
    assert_eq!(n_apart(&images[0], &images[1], 2), 0, "somebody shows through a wall");
}

#[test]
fn a_session_follows_a_sequence_whose_triangles_change() {
    let Some(mut brush) = renderer("", 1) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    recorded(&folder.path().join("people"));
    let scene = scene(folder.path(), r#"{"id": "people", "file": "people"}"#, "");
    let mut opened = opened(&scene);
    let roots = MediaRoots::new(&[folder.path().to_path_buf()]).expect("roots");
    let sequence = Sequence::open(&folder.path().join("people"), &roots).expect("a sequence");
    let times: Vec<Timestamp> = sequence.frames().iter().map(|frame| frame.at).collect();
    let mut session = ViewSession::default();
    let mut look = |state: &SceneState, picture: &Picture, session: Option<&mut ViewSession>| {
        let plan = plan::make_for(state, picture, wishes(FieldsForm::Montage), session);
        brush.renderer.render(state, picture, &plan).expect("a picture").image
    };
    let first = at(&scene, &mut opened, times[0]);
    look(&first, &looking_at(somebody(&first, 0)).into(), Some(&mut session));
    // From behind, a frame later.
    let second = at(&scene, &mut opened, times[1]);
    let place = somebody(&second, 0);
    let behind: Picture = view(place + v(-0.9, 3.0, 1.0), place, 0.8, 160, 120).into();
    let soon = look(&second, &behind, Some(&mut session));
    let again = look(&second, &behind, Some(&mut session));
    assert!(n_apart(&again, &soon, 1) < 20, "the same instant changes nothing");
    // How far weights are on their way is told elsewhere: here one camera at most sees each place well.
    let settled = look(&second, &behind, None);
    assert!(n_apart(&settled, &soon, 40) < 160 * 120 / 50);
}

#[test]
fn scenes_name_sequences_and_who_may_not_see_all_cameras_sees_none() {
    let folder = tempfile::tempdir().expect("a folder");
    recorded(&folder.path().join("people"));
    let path = folder.path().join("scene.json");
    let calibration = CameraDocument::from_camera(
        &Camera::pinhole(v(0.0, -9.0, 3.0), DVec3::ZERO, 0.8, (64, 48)).expect("a camera"),
    );
    let cameras: Vec<_> =
        ["north", "south"].iter().map(|id| json!({"id": id, "calibration": &calibration})).collect();
    let load = |sequences: Value| {
        let document = json!({"version": 1, "cameras": &cameras, "sequences": sequences});
        std::fs::write(&path, document.to_string()).expect("a file");
        load_file("place", &path, &[])
    };
    let parsed = load(json!([{"id": "people", "file": "people"}])).expect("a scene");
    assert!(parsed.scene.document.contains("sequences") && parsed.scene.sequences.len() == 1);
    let written = exchange::write(&parsed.scene, ExchangeFormat::Paper).expect("a document");
    assert!(written.warnings.iter().any(|warning| warning.place == "/sequences"), "it is told what is lost");
    assert_eq!(parsed.scene.with_cameras(|_| true).sequences.len(), 1);
    let part = parsed.scene.with_cameras(|id| id.as_str() == "north");
    assert!(part.sequences.is_empty() && !part.document.contains("people"), "{}", part.document);
    let faults = load(json!([
        {"id": "a", "file": "people"}, {"id": "a", "file": "people"}, {"id": "b", "file": "nowhere"},
        {"id": "c", "file": "people", "repeat": true},
    ]));
    let faults = faults.expect_err("it is refused");
    let places: Vec<&str> = faults.faults().iter().map(|fault| fault.place.as_str()).collect();
    assert_eq!(places, ["/sequences/1/id", "/sequences/2/file", "/sequences/3/repeat"], "{faults}");
    let many = (0..5).map(|i| json!({"id": format!("s{i}"), "file": "people"})).collect();
    assert!(load(Value::Array(many)).is_err());
    // A document that comes from elsewhere than a file names none.
    let text = r#"{"version": 1, "sequences": [{"id": "a", "file": "people"}]}"#;
    let refused = videofields_picture::scene::parse("place", text, videofields_picture::scene::no_imports)
        .expect_err("refused");
    assert!(refused.to_string().contains("sequences are read only by scene files"), "{refused}");
}
