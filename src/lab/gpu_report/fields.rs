//! Texture fields of a mesh that changes, as in `Montage4D` 2019.

use super::load::Load;
use super::timed::{Against, Times, limited_by};
use super::{Found, Stage};
use crate::bench::meshes::{ball, looking, views_around};
use anyhow::Result;
use std::time::Duration;
use videofields_picture::plan::{FieldsForm, Followed, View};
use videofields_render::{Reading, SurfaceFields};
use videofields_vision::clock::{Clock as _, Timestamp};
use videofields_vision::fields::FieldSettings;

/// Most pictures that are drawn of each case.
const MOST_TURNS: u32 = 101;

/// Pictures a second that the paper tells of a mesh that stands still, and milliseconds of a new frame (Du et al. 2019, section 7:
/// 250,000 triangles, 8 pictures of 2048 x 2048).
const PAPER_FPS: f64 = 135.0;
const PAPER_NEW_MS: f64 = 10.4;

/// Measures a bumpy ball that cameras around it see: as another mesh in every picture, and as one that stands still.
pub(super) fn measure(stage: &Stage<'_>) -> Result<Found> {
    let gpu = stage.gpu()?;
    let (n_triangles, n_views, side_px, size_px) =
        if stage.is_small { (15_000, 4, 512, (640, 360)) } else { (250_000, 8, 2048, (1280, 720)) };
    let settings = FieldSettings { is_evened: false, ..FieldSettings::default() };
    let views = views_around(n_views, side_px)?;
    let by = |passed_secs| {
        let followed = Followed { number: 0, passed_secs: Some(passed_secs), instant: Timestamp::default() };
        (FieldsForm::Montage, Some(followed))
    };
    let mut device = SurfaceFields::new(&gpu);
    device.give(&gpu, &ball(n_triangles, 0.0), &views, &settings)?;
    device.picture(&gpu, &looking(0.0, size_px)?, by(0.0), Reading::Picture)?;
    let clock = stage.budget.clock;
    let load = Load::new(&gpu);
    load.first(&gpu, stage)?;
    let mut last = Duration::ZERO;
    let mut draw = |device: &mut SurfaceFields, times: &mut Times, at: &View, passed_secs| -> Result<()> {
        load.between(&gpu, stage, last)?;
        let before = gpu.counts();
        let begun = clock.monotonic();
        let (picture, _) = device.picture(&gpu, at, by(passed_secs), Reading::Picture)?;
        last = clock.monotonic().saturating_sub(begun);
        times.add(&picture.timings, last);
        times.count(&before, &gpu.counts());
        Ok(())
    };
    let half = stage.budget.share(0.6);
    let (mut new, mut new_least, mut still, mut still_least) =
        (Times::default(), Times::default(), Times::default(), Times::default());
    for turn in 1..=MOST_TURNS {
        if half.is_over() && new.len() > 2 {
            break;
        }
        for (idx, (times, size_px)) in
            [(&mut new, size_px), (&mut new_least, (16, 16))].into_iter().enumerate()
        {
            let bump = 0.01 * (2.0 * f64::from(turn) + idx as f64);
            device.give(&gpu, &ball(n_triangles, bump), &views, &settings)?;
            draw(&mut device, times, &looking(0.02 * f64::from(turn), size_px)?, 0.033)?;
        }
    }
    for turn in 1..=MOST_TURNS {
        if stage.budget.is_over() && still.len() > 2 {
            break;
        }
        for (times, size_px) in [(&mut still, size_px), (&mut still_least, (16, 16))] {
            draw(&mut device, times, &looking(0.02 * f64::from(turn), size_px)?, 0.008)?;
        }
    }
    let mut found = Found {
        is_cut_short: new.is_short() || still.is_short(),
        memory_bytes: gpu.memory_bytes(),
        ..Found::default()
    };
    for (name, times, least, paper_fps) in [
        ("a new mesh in every picture", new, new_least, 1e3 / PAPER_NEW_MS),
        ("a mesh that stands still", still, still_least, PAPER_FPS),
    ] {
        let paper_fps = (!stage.is_small).then_some(paper_fps);
        let least = least.measurement(String::new(), None);
        if let (Some(mut of), Some(least)) = (times.measurement(name.to_owned(), paper_fps), least) {
            let against = Against { least_ms: least.ms(), n_pixels: f64::from(size_px.0 * size_px.1) };
            of.limited_by = Some(limited_by(&of, &against, stage));
            found.measurements.push(of);
        }
    }
    found.notes.push(format!(
        "About {n_triangles} triangles, {n_views} pictures of {side_px} x {side_px} pixels, drawn with {} x {}. Handing over the mesh and \
         its pictures is not counted.",
        size_px.0, size_px.1
    ));
    Ok(found)
}
