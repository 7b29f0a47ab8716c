//! What a picture costs the device beyond its pixels, counted: without anything optional the bare pass alone, and with each
//! effect exactly what is its own.

use super::stage::Stage;
use super::textures::{changed, gradient, imagery, panorama};
use super::{Brush, GREEN, RED, points_of, renderer, v, view};
use glam::{DVec3, Vec3};
use videofields_picture::fuse::{OwnerMap, SceneState};
use videofields_picture::plan::{
    self, Colors, Detail, EntityStyle, Filtering, Picture, Sampling, Settings, Wishes,
};
use videofields_render::gpu::Counted::{self, Buffer, Pass, Pipeline, Texture, Upload};
use videofields_vision::effects::{EffectSettings, LightSource, Occlusion, Relight, Stipple};

/// What was made and done: what, of which label, how often.
type Row = (Counted, &'static str, u64);

const SIZE: (u32, u32) = (96, 64);
const FOOT: DVec3 = DVec3::new(-1.0, 2.5, 0.0);

fn looking() -> Picture {
    view(v(0.0, -17.0, 7.0), v(0.0, 0.0, 0.5), 0.9, SIZE.0, SIZE.1).into()
}

/// Level ground, two cameras whose pictures overlap.
fn ground() -> Stage {
    Stage::new().with_camera(v(-14.0, -12.0, 7.0), v(-2.0, 0.0, 0.0), RED).with_camera(
        v(14.0, -13.0, 6.0),
        v(2.0, 1.0, 0.0),
        GREEN,
    )
}

/// The same with a wall.
fn walled() -> Stage {
    ground().with_box(v(0.0, 0.0, 1.5), v(8.0, 0.6, 3.0), 0.0)
}

/// Nothing that is left to whoever asks.
fn bare() -> Wishes {
    let settings =
        Settings { entities: EntityStyle::None, sources: 1, sampling: Sampling::ONCE, ..Settings::default() };
    Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() }
}

fn with(change: impl FnOnce(&mut Settings)) -> Wishes {
    let mut wishes = bare();
    change(&mut wishes.settings);
    wishes
}

/// What drawing a picture makes and does.
fn drawing(brush: &mut Brush, state: &SceneState, wishes: Wishes) -> Vec<Row> {
    let before = brush.renderer.gpu().counts();
    let plan = plan::make(state, &looking(), wishes);
    brush.renderer.render(state, &looking(), &plan).expect("a picture");
    let known = |what: Counted, label: &str| {
        let found = before.iter().find(|count| (count.what, count.label) == (what, label));
        found.map_or(0, |count| count.n)
    };
    let after = brush.renderer.gpu().counts();
    let rows = after.iter().map(|count| (count.what, count.label, count.n - known(count.what, count.label)));
    rows.filter(|(.., n)| *n > 0).collect()
}

/// What a bare picture of two cameras makes at first, drawn by so many variants of the surfaces' pipeline: five levels of a
/// picture are a pass each.
fn first_of_all(n_pipelines: u64) -> Vec<Row> {
    vec![
        (Pipeline, "surface", n_pipelines),
        (Pipeline, "yuv", 2),
        (Texture, "backgrounds", 1),
        (Texture, "color", 1),
        (Texture, "depth", 1),
        (Texture, "planes", 3),
        (Upload, "planes", 2 * 3),
        (Buffer, "cameras", 1),
        (Buffer, "conversions", 1),
        (Buffer, "lens limits", 1),
        (Buffer, "readback", 1),
        (Buffer, "surface indices", 1),
        (Buffer, "surface lists", 1),
        (Buffer, "surface vertices", 1),
        (Buffer, "view", 1),
        (Pass, "surface", 1),
        (Pass, "yuv", 2 * 5),
    ]
}

const SURFACE_ALONE: [Row; 1] = [(Pass, "surface", 1)];
/// Of level ground: no camera, one, both.
const N_LEVEL_PIPELINES: u64 = 3;

/// Returns the bytes that passes of a label move when a picture is drawn.
fn moved_bytes(brush: &mut Brush, state: &SceneState, wishes: Wishes, label: &str) -> u64 {
    let plan = plan::make(state, &looking(), wishes);
    let mut bytes = || {
        let counts = brush.renderer.gpu().counts();
        let found =
            counts.iter().find(|count| (count.what, count.label) == (Pass, label)).map(|of| of.n_bytes);
        brush.renderer.render(state, &looking(), &plan).expect("a picture");
        found.unwrap_or(0)
    };
    // Counts are read before each picture.
    bytes();
    let before = bytes();
    bytes() - before
}

#[test]
fn bytes_of_a_pass_are_what_its_attachments_load_store_and_resolve() {
    let Some(mut brush) = renderer("", 1) else { return };
    let (alone, peopled) = (ground().state(), ground().with_person(FOOT).state());
    let wishes = |entities, samples| {
        with(|settings| {
            settings.entities = entities;
            settings.sampling = Sampling { samples, supersampling: 1 };
        })
    };
    let n_pixels = u64::from(SIZE.0 * SIZE.1);
    // A pass that is the first and the last clears, and lets depths and samples go: its picture alone is stored, or resolved.
    for samples in [1, 4] {
        let found = moved_bytes(&mut brush, &alone, wishes(EntityStyle::None, samples), "surface");
        assert_eq!(found, 4 * n_pixels, "{samples} samples");
    }
    // With people after it, it stores colours and depths; their pass loads both and stores or resolves the picture.
    for (samples, surface, billboard) in [(1, 4 + 4, 4 + 4 + 4), (4, 16 + 16, 16 + 16 + 4)] {
        for (label, bytes) in [("surface", surface), ("billboard", billboard)] {
            let found = moved_bytes(&mut brush, &peopled, wishes(EntityStyle::Billboards, samples), label);
            assert_eq!(found, bytes * n_pixels, "{label}, {samples} samples");
        }
    }
}

#[test]
fn a_bare_picture_costs_its_pass_its_targets_and_its_cameras_pictures() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = ground().state();
    let plan = plan::make(&state, &looking(), bare());
    let on: Vec<_> = plan.reasons.iter().filter(|reason| reason.is_on).map(|reason| reason.effect).collect();
    assert_eq!((on.as_slice(), plan.surface_cameras.len()), (&["surface"][..], 2));
    assert_eq!(drawing(&mut brush, &state, bare()), first_of_all(N_LEVEL_PIPELINES));
    for _ in 0..3 {
        assert_eq!(drawing(&mut brush, &state, bare()), SURFACE_ALONE, "the same instants again");
    }
    let counts = brush.renderer.gpu().counts();
    let bytes = |what, label| {
        let found = counts.iter().find(|count| (count.what, count.label) == (what, label));
        found.expect("counted").n_bytes
    };
    let n_pixels = u64::from(SIZE.0 * SIZE.1);
    assert_eq!((bytes(Texture, "color"), bytes(Texture, "depth")), (4 * n_pixels, 4 * n_pixels));
    // Luma, and chroma at half of its columns and rows.
    assert_eq!(bytes(Upload, "planes"), 2 * (320 * 180 + 2 * 160 * 90));

    // A new picture of one camera is uploaded, and nothing else; so many bytes of new memory are none.
    let mut newer = state.clone();
    newer.cameras[1] = ground().state().cameras[1].clone();
    newer.cameras[1].camera = std::sync::Arc::clone(&state.cameras[1].camera);
    let expected = [(Upload, "planes", 3), (Pass, "surface", 1), (Pass, "yuv", 5)];
    assert_eq!(drawing(&mut brush, &newer, bare()), expected);
}

#[test]
fn a_picture_that_no_camera_has_a_part_in_costs_its_pass_and_its_targets() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = Stage { cameras: Vec::new(), ..walled() }.state();
    let expected = [
        (Pipeline, "surface", 1),
        (Texture, "color", 1),
        (Texture, "depth", 1),
        (Buffer, "cameras", 1),
        (Buffer, "lens limits", 1),
        (Buffer, "readback", 1),
        (Buffer, "surface indices", 1),
        (Buffer, "surface vertices", 1),
        (Buffer, "view", 1),
        (Pass, "surface", 1),
    ];
    assert_eq!(drawing(&mut brush, &state, bare()), expected);
    assert_eq!(drawing(&mut brush, &state, bare()), SURFACE_ALONE);
}

/// Draws a state without an effect, which must cost what the bare picture does, then `effect` of it: what that adds, and
/// what it costs again and again.
fn check_effect(
    name: &str,
    (state, n_pipelines): (&SceneState, u64),
    (without, with): (Wishes, Wishes),
    (added, again): (&[Row], &[Row]),
) {
    check_change(name, (state, state, n_pipelines), (without, with), (added, again));
}

/// As [`check_effect`], of an effect that is the scene's.
fn check_change(
    name: &str,
    (plain, changed, n_pipelines): (&SceneState, &SceneState, u64),
    (without, with): (Wishes, Wishes),
    (added, again): (&[Row], &[Row]),
) {
    let Some(mut brush) = renderer("", 1) else { return };
    assert_eq!(drawing(&mut brush, plain, without), first_of_all(n_pipelines), "without {name}");
    assert_eq!(drawing(&mut brush, plain, without), SURFACE_ALONE, "without {name}, again");
    assert_eq!(drawing(&mut brush, changed, with), added, "with {name}");
    assert_eq!(drawing(&mut brush, changed, with), again, "with {name}, again");
    assert_eq!(drawing(&mut brush, plain, without), SURFACE_ALONE, "without {name} once more");
}

#[test]
fn samples_and_resolution_cost_their_targets_and_passes() {
    let state = ground().state();
    let state = (&state, N_LEVEL_PIPELINES);
    let added = [
        (Pipeline, "surface", N_LEVEL_PIPELINES),
        (Texture, "color", 1),
        (Texture, "color samples", 1),
        (Texture, "depth", 1),
        (Pass, "surface", 1),
    ];
    let four = with(|settings| settings.sampling.samples = 4);
    check_effect("four samples", state, (bare(), four), (&added, &SURFACE_ALONE));
    for (name, wishes) in [
        ("average", with(|settings| settings.sampling.supersampling = 2)),
        ("enlarge", with(|settings| settings.resolution = Detail::Half)),
    ] {
        let again = [(Pass, name, 1), (Pass, "surface", 1)];
        let added = [
            vec![(Pipeline, name, 1), (Texture, name, 1), (Texture, "color", 1), (Texture, "depth", 1)],
            again.to_vec(),
        ]
        .concat();
        let mut added = added;
        added.sort_unstable();
        check_effect(name, state, (bare(), wishes), (&added, &again));
    }
}

#[test]
fn effects_cost_their_passes_and_their_pictures_and_leave_nothing_behind() {
    let state = ground().state();
    let state = (&state, N_LEVEL_PIPELINES);
    let with = |effects| Wishes { effects, ..bare() };
    let none = EffectSettings::NONE;
    // Targets have what effects look at beside the picture; what reads depths needs targets that keep them.
    let targets = [(Texture, "color", 1), (Texture, "depth", 1)];
    let check = |name, effects, own: &[Row], passes: &[Row]| {
        let mut again = [passes, &[(Pass, "surface", 1)]].concat();
        let mut added = [own, &targets, &again].concat();
        again.sort_unstable();
        added.sort_unstable();
        check_effect(name, state, (bare(), with(effects)), (&added, &again));
    };
    let light = Some(Relight::by(LightSource::Sky));
    check(
        "relight",
        EffectSettings { relight: light, ..none },
        &[
            (Pipeline, "distance", 1),
            (Pipeline, "relight", 1),
            (Texture, "distance", 1),
            (Texture, "relight", 1),
            (Buffer, "lens", 1),
            (Buffer, "relight", 1),
        ],
        &[(Pass, "distance", 1), (Pass, "relight", 1)],
    );
    check(
        "occlusion",
        EffectSettings { occlusion: Some(Occlusion::default()), ..none },
        &[
            (Pipeline, "distance", 1),
            (Pipeline, "occlusion", 2),
            (Texture, "distance", 1),
            (Texture, "occlusion", 1),
            (Texture, "occlusion open", 1),
            (Buffer, "lens", 1),
            (Buffer, "occlusion", 1),
        ],
        &[(Pass, "distance", 1), (Pass, "occlusion", 2)],
    );
    check(
        "stipple",
        EffectSettings { stipple: Some(Stipple::default()), ..none },
        &[(Pipeline, "stipple", 1), (Texture, "stipple", 1), (Buffer, "stipple", 1)],
        &[(Pass, "stipple", 1)],
    );
}

#[test]
fn plainer_look_ups_and_gains_cost_a_variant_of_the_pipelines_of_cameras() {
    let mut state = ground().state();
    state.n_overlapping = 2;
    state.cameras[0].gain = Vec3::new(0.7, 0.8, 0.9);
    state.cameras[1].gain = Vec3::new(1.3, 1.2, 1.1);
    let added = [(Pipeline, "surface", N_LEVEL_PIPELINES - 1), (Pass, "surface", 1)];
    let even = Wishes { colors: Colors::Even, ..bare() };
    let bilinear = with(|settings| settings.filtering = Filtering::Bilinear);
    for (name, wishes) in [("gains", even), ("look-ups", bilinear)] {
        check_effect(name, (&state, N_LEVEL_PIPELINES), (bare(), wishes), (&added, &SURFACE_ALONE));
    }
}

#[test]
fn levels_of_detail_are_made_when_a_picture_first_needs_them() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = ground().state();
    let bilinear = with(|settings| settings.filtering = Filtering::Bilinear);
    let mut first = first_of_all(N_LEVEL_PIPELINES);
    first.retain(|(what, label, _)| (*what, *label) != (Pass, "yuv"));
    first.push((Pass, "yuv", 2));
    assert_eq!(drawing(&mut brush, &state, bilinear), first);
    assert_eq!(drawing(&mut brush, &state, bilinear), SURFACE_ALONE);
    let levels = [(Pipeline, "surface", N_LEVEL_PIPELINES - 1), (Pass, "surface", 1), (Pass, "yuv", 2 * 4)];
    assert_eq!(drawing(&mut brush, &state, bare()), levels);
    assert_eq!(drawing(&mut brush, &state, bare()), SURFACE_ALONE);
    assert_eq!(drawing(&mut brush, &state, bilinear), SURFACE_ALONE);
}

#[test]
fn depth_maps_cost_two_passes_a_camera_once() {
    let state = walled().state();
    let off = with(|settings| settings.depth_maps = false);
    let added = [
        (Pipeline, "camera_depth", 2),
        // Of patches that something may stand before: one camera, both.
        (Pipeline, "surface", 2),
        (Texture, "camera_depth", 1),
        (Texture, "camera_depth maps", 1),
        (Buffer, "camera_depth faces", 1),
        (Buffer, "camera_depth vertices", 1),
        // More lists of cameras than there was room for.
        (Buffer, "surface lists", 1),
        (Pass, "camera_depth", 2 * 2),
        (Pass, "surface", 1),
    ];
    // One more: depths are drawn first where surfaces may lie one before another.
    check_effect("depth maps", (&state, N_LEVEL_PIPELINES + 1), (off, bare()), (&added, &SURFACE_ALONE));
}

/// Points are of the first camera: let it be the one that shows everybody.
fn by_the_first_camera(state: &mut SceneState) {
    state.entities.iter_mut().for_each(|entity| entity.sources.retain(|source| source.camera_idx == 0));
}

#[test]
fn entities_cost_their_cameras_frames_and_their_pass() {
    let mut state = ground().with_person(FOOT).state();
    state.points = points_of(&state, FOOT);
    by_the_first_camera(&mut state);
    for (style, name, instances) in [
        (EntityStyle::Billboards, "billboard", "billboard instances"),
        (EntityStyle::Points, "points", "points instances"),
    ] {
        let again = [(Pass, name, 1), (Pass, "surface", 1)];
        let added = [
            (Pipeline, name, 1),
            (Texture, "frames", 1),
            (Texture, "masks", 1),
            (Texture, "planes", 3),
            (Upload, "masks", 1),
            (Upload, "planes", 3),
            (Buffer, instances, 1),
            (Pass, name, 1),
            (Pass, "surface", 1),
            (Pass, "yuv", 1),
        ];
        let wishes = with(|settings| settings.entities = style);
        check_effect(name, (&state, N_LEVEL_PIPELINES), (bare(), wishes), (&added, &again));
    }
}

#[test]
fn people_who_are_told_apart_cost_one_buffer() {
    let mut state = ground().with_person(FOOT).state();
    by_the_first_camera(&mut state);
    let mask = &state.cameras[0].observation.soft_mask;
    let size = (mask.width, mask.height);
    let cells = vec![1; (size.0 * size.1) as usize].into();
    state.cameras[0].owners = Some(std::sync::Arc::new(OwnerMap::new(size, 1, cells, Box::new([9.0]))));
    state.entities[0].sources[0].owner = 1;
    let again = [(Pass, "billboard", 1), (Pass, "surface", 1)];
    let added = [
        (Pipeline, "billboard", 1),
        (Texture, "frames", 1),
        (Texture, "masks", 1),
        (Texture, "planes", 3),
        (Upload, "masks", 1),
        (Upload, "planes", 3),
        (Buffer, "billboard instances", 1),
        (Buffer, "owners of pixels", 1),
        (Pass, "billboard", 1),
        (Pass, "surface", 1),
        (Pass, "yuv", 1),
    ];
    let wishes = with(|settings| settings.entities = EntityStyle::Billboards);
    check_effect("owners", (&state, N_LEVEL_PIPELINES), (bare(), wishes), (&added, &again));
}

#[test]
fn skies_and_pictures_on_surfaces_cost_their_pass_and_their_texture() {
    let plain = ground().state();
    let again = [(Pass, "sky", 1), (Pass, "surface", 1)];
    let under = |sky| changed(plain.clone(), |scene| scene.sky = sky);
    let n = N_LEVEL_PIPELINES;
    let (gradient, panorama) = (under(gradient()), under(panorama()));
    let added = [(Pipeline, "sky", 1), (Buffer, "sky", 1), (Pass, "sky", 1), (Pass, "surface", 1)];
    check_change("a gradient", (&plain, &gradient, n), (bare(), bare()), (&added, &again));
    // 256 x 128 and its eight halves.
    let added = [
        (Pipeline, "sky", 1),
        (Texture, "texture", 1),
        (Upload, "texture", 9),
        (Buffer, "sky", 1),
        (Pass, "sky", 1),
        (Pass, "surface", 1),
    ];
    check_change("a panorama", (&plain, &panorama, n), (bare(), bare()), (&added, &again));
    let painted = changed(plain.clone(), |scene| {
        scene.materials[0].paint = Some(std::sync::Arc::new(imagery(v(0.0, 0.0, 0.0), 0.0)));
    });
    // 96 x 72 and its six halves.
    let added = [
        (Pipeline, "surface", N_LEVEL_PIPELINES),
        (Texture, "texture", 1),
        (Upload, "texture", 7),
        (Buffer, "surface texture vertices", 1),
        (Pass, "surface", 1),
    ];
    check_change("imagery", (&plain, &painted, n), (bare(), bare()), (&added, &SURFACE_ALONE));
}

#[test]
fn buildings_that_open_cost_their_variants_and_with_points_a_pass() {
    let foot = v(-0.5, 4.0, 0.0);
    let mut state = walled().with_person(foot).state();
    state.points = points_of(&state, foot);
    by_the_first_camera(&mut state);
    for style in [EntityStyle::Billboards, EntityStyle::Points] {
        let Some(mut brush) = renderer("", 1) else { return };
        let closed = with(|settings| settings.entities = style);
        let open = Wishes { see_through: true, ..closed };
        drawing(&mut brush, &state, closed);
        let entities = if style == EntityStyle::Points { "points" } else { "billboard" };
        let without = [(Pass, entities, 1), (Pass, "surface", 1)];
        assert_eq!(drawing(&mut brush, &state, closed), without, "{style:?}");
        let mut again = without.to_vec();
        if style == EntityStyle::Points {
            again.push((Pass, "see_through", 1));
            again.sort_unstable();
        }
        let added = drawing(&mut brush, &state, open);
        let (passes, made): (Vec<Row>, Vec<Row>) = added.into_iter().partition(|(what, ..)| *what == Pass);
        assert_eq!(passes, again, "{style:?}");
        // Of the wall: no camera, one, both, with a depth map or without; its lists of cameras may need more room.
        let is_own = |row: &Row| matches!(row, (Pipeline, "surface", 1..=5) | (Buffer, "surface lists", 1));
        assert!(made.first().is_some_and(|(what, ..)| *what == Pipeline), "{style:?}: {made:?}");
        assert!(made.iter().all(is_own), "{style:?}: {made:?}");
        assert_eq!(drawing(&mut brush, &state, open), again, "{style:?}, again");
        assert_eq!(drawing(&mut brush, &state, closed), without, "{style:?}, once more");
    }
}
