//! Visual hulls by every method, as in the papers of 2003 and 2004.

use super::timed::{Against, Case, again_and_again, limited_by};
use super::views::{plan_of, renderer};
use super::{Found, Stage};
use crate::bench::hulls::{judged_states, ring};
use crate::worlds::prepare;
use anyhow::{Context as _, Result};
use serde_json::json;
use videofields::accuracy::{OpenGate, Scope, Stopwatch};
use videofields_picture::fuse::{HullMaking, HullMemory, SceneState};
use videofields_picture::plan::{EntityStyle, HullForm, HullMethod, Picture, Preset, Settings, View};
use videofields_simulate::World;

/// Columns and rows of the views that silhouettes are of, and of the picture.
const SEEN_PX: (u32, u32) = (320, 240);
const DRAWN_PX: (u32, u32) = (640, 480);

/// Voxels each way where hulls are carved.
const N_VOXELS: u32 = 64;

/// Pictures a second that the papers tell of: image-based hulls of 2003 by trimming and depth peeling, of 2004 by rays, voxels of both.
const PAPERS: [(HullMethod, u32, f64); 3] =
    [(HullMethod::Trimming, 8, 26.0), (HullMethod::Rays, 8, 4.0), (HullMethod::Voxels, 6, 30.0)];

/// Measures hulls of three people by every method from 8 views, and by voxels from 6.
pub(super) fn measure(stage: &Stage<'_>) -> Result<Found> {
    let mut renderer = renderer(stage)?;
    let (mut cases, mut smallest) = (Vec::new(), Vec::new());
    for n_views in [8, 6] {
        let (state, view) = people(stage, n_views)?;
        for (word, method) in HullMethod::ALL {
            if n_views == 6 && method != HullMethod::Voxels {
                continue;
            }
            let hull = HullForm { method, n_voxels: N_VOXELS, ..HullForm::EXACT };
            let settings = Settings { entities: EntityStyle::Hulls, hull, ..Preset::Balanced.settings(1) };
            let case = |name: String, view: View, paper_fps| {
                let picture = Picture::from(view);
                let plan = plan_of(&state, &picture, settings);
                Case { name, state: state.clone(), pictures: vec![(picture, plan)], paper_fps }
            };
            let paper = PAPERS.iter().find(|(of, n, _)| *of == method && *n == n_views);
            let name = format!("{word}, {n_views} views");
            cases.push(case(name.clone(), view, paper.map(|(.., fps)| *fps)));
            smallest.push(case(name, View { width_px: 16, height_px: 12, ..view }, None));
        }
    }
    let least = again_and_again(&mut renderer, &smallest, (stage, stage.budget.share(0.25)))?;
    let mut found = again_and_again(&mut renderer, &cases, (stage, stage.budget))?;
    for (measurement, least) in found.measurements.iter_mut().zip(&least.measurements) {
        let n_pixels = f64::from(DRAWN_PX.0) * f64::from(DRAWN_PX.1);
        let against = Against { least_ms: least.ms(), n_pixels };
        measurement.limited_by = Some(limited_by(measurement, &against, stage));
    }
    found.notes.push(
        "Three people whom simulated cameras around them see; times are of whole pictures, ground and all."
            .to_owned(),
    );
    Ok(found)
}

/// Returns the people whom `n_views` cameras see, and the view that is drawn.
fn people(stage: &Stage<'_>, n_views: u32) -> Result<(SceneState, View)> {
    let mut document = ring(n_views, SEEN_PX.0, Some(20.0));
    let cameras = document["cameras"].as_array_mut().context("a list of cameras")?;
    cameras.iter_mut().for_each(|camera| camera["size_px"] = json!([SEEN_PX.0, SEEN_PX.1]));
    let world = World::from_json("ring", &document.to_string())?;
    let scope = Scope {
        size_px: SEEN_PX,
        view_size_px: DRAWN_PX,
        samples_per_side: 1,
        n_frames: 16,
        max_cameras: 64,
        n_views: 1,
        n_moments: 1,
        ..Scope::FULL
    };
    let watch = Stopwatch::new(stage.budget.clock, &OpenGate);
    let subject = prepare(&world, &scope, &watch, &|_step| {})?;
    let (_, mut state) = judged_states(&subject)?.into_iter().next().context("no frame is judged")?;
    state.place_hulls(HullMaking { error_px: 0.5, n_voxels: Some(N_VOXELS) }, &mut HullMemory::default());
    let view = subject.views.first().context("the world has no view")?.view;
    Ok((state, view))
}
