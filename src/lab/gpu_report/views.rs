//! The views of "Video Fields" 2016 by early and deferred pruning, surfaces over cameras, and effects.

use super::timed::{Against, Case, again_and_again, limited_by};
use super::{Found, Stage};
use crate::made_scenes::{settings, tiled, yard};
use anyhow::Result;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{
    self, Colors, EntityStyle, Filtering, Picture, Plan, Settings, View, Wishes,
};
use videofields_render::Renderer;
use videofields_vision::config::RenderSettings;
use videofields_vision::effects::{EffectSettings, LightSource, Occlusion, Relight, Stipple, Sun};

/// People in the yard.
const N_PEOPLE: usize = 20;

/// The paper's views: name, columns, rows, how many of them make a frame, and its pictures a second by early and by deferred pruning
/// (Du, Bista and Varshney 2016, table of framerates: NVIDIA Quadro K6000).
const VIEWS: [(&str, u32, u32, usize, [f64; 2]); 3] = [
    ("2560 x 1440", 2560, 1440, 1, [60.0, 60.0]),
    ("2 x 960 x 1080", 960, 1080, 2, [55.2, 41.5]),
    ("6000 x 3000", 6000, 3000, 1, [48.6, 32.4]),
];

/// The paper's two ways: early pruning draws people as points, deferred pruning as billboards.
const WAYS: [(&str, EntityStyle); 2] =
    [("early pruning", EntityStyle::Points), ("deferred pruning", EntityStyle::Billboards)];

/// Sides are divided by this on devices that draw on the processor.
const SMALLER: u32 = 4;

/// Pictures of more pixels than a daemon allows by default.
pub(super) fn renderer(stage: &Stage<'_>) -> Result<Renderer> {
    let settings = RenderSettings { max_pixels: 1 << 26, ..RenderSettings::default() };
    Ok(Renderer::new(stage.gpu()?, &settings)?)
}

pub(super) fn plan_of(state: &SceneState, picture: &Picture, settings: Settings) -> Plan {
    let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() };
    plan::make(state, picture, wishes)
}

/// The yard, ready for one way of drawing people.
fn peopled(style: EntityStyle, size_px: (u32, u32)) -> (SceneState, Picture) {
    let (mut state, picture) = yard(N_PEOPLE, size_px);
    if style == EntityStyle::Points {
        state.place_points(1);
    }
    (state, picture)
}

/// Measures the paper's table, and what limits each of its figures.
pub(super) fn papers(stage: &Stage<'_>) -> Result<Found> {
    let mut renderer = renderer(stage)?;
    let shrink = if stage.is_small { SMALLER } else { 1 };
    let (mut cases, mut smallest) = (Vec::new(), Vec::new());
    for (name, width, height, n_pictures, paper_fps) in VIEWS {
        for ((word, style), paper_fps) in WAYS.into_iter().zip(paper_fps) {
            let of = settings(style, Filtering::Levels, 1);
            let size_px = (width / shrink, height / shrink);
            let (state, picture) = peopled(style, size_px);
            let plan = plan_of(&state, &picture, of);
            let pictures = vec![(picture, plan); n_pictures];
            let drawn = if shrink == 1 { name.to_owned() } else { format!("{name}, a {shrink}th each way") };
            // What a paper reached at other sizes is no measure of these.
            let paper_fps = (shrink == 1).then_some(paper_fps);
            cases.push(Case { name: format!("{drawn}, {word}"), state, pictures, paper_fps });
            let (state, picture) = peopled(style, (16, 16));
            let plan = plan_of(&state, &picture, of);
            smallest.push(Case {
                name: word.to_owned(),
                state,
                pictures: vec![(picture, plan); n_pictures],
                paper_fps: None,
            });
        }
    }
    let least = again_and_again(&mut renderer, &smallest, (stage, stage.budget.share(0.3)))?;
    let mut found = again_and_again(&mut renderer, &cases, (stage, stage.budget))?;
    for (measurement, least) in found.measurements.iter_mut().zip(&least.measurements) {
        let Some(case) = cases.iter().find(|case| case.name == measurement.name) else { continue };
        let n_pixels: f64 = case
            .pictures
            .iter()
            .map(|(picture, _)| f64::from(picture.width_px) * f64::from(picture.height_px))
            .sum();
        // Colour and depth are written, depth is read, the picture is copied: four bytes a pixel each.
        let against = Against { least_ms: least.ms(), n_pixels };
        measurement.limited_by = Some(limited_by(measurement, &against, stage));
    }
    found.notes.push(format!(
        "A yard with six boxes, three cameras of 1280 x 720 pixels and {N_PEOPLE} people; one sample a pixel. The paper's place was \
         another, its hardware an NVIDIA Quadro K6000."
    ));
    Ok(found)
}

/// Measures ground under 3, 8 and 100 cameras at one and four samples a pixel, beside the same ground without a camera.
pub(super) fn surfaces(stage: &Stage<'_>) -> Result<Found> {
    let mut renderer = renderer(stage)?;
    let mut cases = Vec::new();
    for samples in [1, 4] {
        let of = settings(EntityStyle::None, Filtering::Levels, samples);
        for (name, cells, per_cell, beside) in [
            ("no camera", [1, 1], 1, 0),
            ("3 cameras, all see every pixel", [1, 1], 3, 0),
            ("8 cameras, 3 see any pixel", [2, 1], 3, 2),
            ("100 cameras, 3 see any pixel", [11, 3], 3, 1),
        ] {
            let (mut state, picture) = tiled(cells, per_cell, beside);
            if name == "no camera" {
                state.cameras.clear();
            }
            let picture = if stage.is_small { smaller(&picture) } else { picture };
            let plan = plan_of(&state, &picture, of);
            let word = if samples == 1 { "1 sample" } else { "4 samples" };
            cases.push(Case {
                name: format!("{word}: {name}"),
                state,
                pictures: vec![(picture, plan)],
                paper_fps: None,
            });
        }
    }
    let mut found = again_and_again(&mut renderer, &cases, (stage, stage.budget))?;
    let mut bare = f64::NAN;
    for measurement in &found.measurements {
        let ms =
            measurement.passes_ms.get("surface").map_or(measurement.whole_ms.median, |spread| spread.median);
        if measurement.name.ends_with("no camera") {
            bare = ms;
        } else {
            found.notes.push(format!(
                "{}: {:.2} times the pass that only fills",
                measurement.name,
                ms / bare
            ));
        }
    }
    Ok(found)
}

/// The same view with half of its columns and rows.
fn smaller(picture: &Picture) -> Picture {
    let view = picture.parts[0].view;
    View { width_px: view.width_px / 2, height_px: view.height_px / 2, ..view }.into()
}

/// Measures each effect alone, and all.
pub(super) fn effects(stage: &Stage<'_>) -> Result<Found> {
    let mut renderer = renderer(stage)?;
    let size_px = if stage.is_small { (640, 360) } else { (1920, 1080) };
    let none = EffectSettings::NONE;
    let relight = Some(Relight { sun: Some(Sun::default()), ..Relight::by(LightSource::Sky) });
    let (occlusion, stipple) = (Some(Occlusion::default()), Some(Stipple::default()));
    let cases = [
        ("none", none),
        ("relight", EffectSettings { relight, ..none }),
        ("occlusion", EffectSettings { occlusion, ..none }),
        ("stipple", EffectSettings { stipple, ..none }),
        ("all", EffectSettings { relight, occlusion, stipple }),
    ]
    .map(|(name, effects)| {
        let (state, picture) = yard(N_PEOPLE, size_px);
        let settings = settings(EntityStyle::Billboards, Filtering::Levels, 1);
        let plan = plan::make(
            &state,
            &picture,
            Wishes { settings, see_through: false, colors: Colors::Raw, effects },
        );
        Case { name: name.to_owned(), state, pictures: vec![(picture, plan)], paper_fps: None }
    });
    let mut found = again_and_again(&mut renderer, &cases, (stage, stage.budget))?;
    found.notes.push(format!(
        "The yard of the first part, {} x {} pixels, one sample a pixel.",
        size_px.0, size_px.1
    ));
    Ok(found)
}
