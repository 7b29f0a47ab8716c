//! Texture fields of a mesh that changes, as in `Montage4D` 2019.

use super::timed::{Against, Times, limited_by};
use super::{Found, Stage};
use crate::bench::meshes::{ball, looking, views_around};
use anyhow::Result;
use videofields_picture::plan::{FieldsForm, Followed};
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
    let half = stage.budget.share(0.6);
    let (mut new, mut still, mut least) = (Times::default(), Times::default(), Times::default());
    for turn in 1..=MOST_TURNS {
        if half.is_over() && new.len() > 2 {
            break;
        }
        device.give(&gpu, &ball(n_triangles, 0.01 * f64::from(turn)), &views, &settings)?;
        let before = gpu.counts();
        let begun = clock.monotonic();
        let at = looking(0.02 * f64::from(turn), size_px)?;
        let (picture, _) = device.picture(&gpu, &at, by(0.033), Reading::Picture)?;
        new.add(&picture.timings, clock.monotonic().saturating_sub(begun));
        new.count(&before, &gpu.counts());
    }
    for turn in 1..=MOST_TURNS {
        if stage.budget.is_over() && still.len() > 2 {
            break;
        }
        for (times, size_px) in [(&mut still, size_px), (&mut least, (16, 16))] {
            let before = gpu.counts();
            let begun = clock.monotonic();
            let (picture, _) = device.picture(
                &gpu,
                &looking(0.02 * f64::from(turn), size_px)?,
                by(0.008),
                Reading::Picture,
            )?;
            times.add(&picture.timings, clock.monotonic().saturating_sub(begun));
            times.count(&before, &gpu.counts());
        }
    }
    let mut found = Found {
        is_cut_short: new.is_short() || still.is_short(),
        memory_bytes: gpu.memory_bytes(),
        ..Found::default()
    };
    let paper_fps = (!stage.is_small).then_some(PAPER_FPS);
    let of_paper = (!stage.is_small).then_some(1e3 / PAPER_NEW_MS);
    found.measurements.extend(new.measurement("a new mesh in every picture".to_owned(), of_paper));
    let least = least.measurement(String::new(), None);
    if let (Some(mut of), Some(least)) =
        (still.measurement("a mesh that stands still".to_owned(), paper_fps), least)
    {
        let against = Against { least_ms: least.ms(), n_pixels: f64::from(size_px.0 * size_px.1) };
        of.limited_by = Some(limited_by(&of, &against, stage));
        found.measurements.push(of);
    }
    found.notes.push(format!(
        "About {n_triangles} triangles, {n_views} pictures of {side_px} x {side_px} pixels, drawn with {} x {}. Handing over the mesh and \
         its pictures is not counted.",
        size_px.0, size_px.1
    ));
    Ok(found)
}
