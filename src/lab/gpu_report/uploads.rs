//! Pictures of cameras that come anew: what it takes to bring their planes to the device.

use super::load::Load;
use super::timed::Times;
use super::views::{plan_of, renderer};
use super::{Found, Stage};
use crate::made_scenes::{SIZE_PX, settings, tiled};
use anyhow::Result;
use std::sync::Arc;
use std::time::Duration;
use videofields_picture::plan::{EntityStyle, Filtering};
use videofields_vision::clock::Clock as _;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage};

/// Numbers of cameras.
const N_CAMERAS: [u32; 3] = [1, 8, 64];

/// Number of times that pictures come anew.
const N_TURNS: usize = 31;

/// Measures a picture of which every camera's background is new, beside the same picture of which none is.
pub(super) fn measure(stage: &Stage<'_>) -> Result<Found> {
    let mut found = Found::default();
    let clock = stage.budget.clock;
    for n_cameras in N_CAMERAS {
        if stage.budget.is_over() || (stage.is_small && n_cameras > 8) {
            found.is_cut_short |= stage.budget.is_over();
            continue;
        }
        let mut renderer = renderer(stage)?;
        let (mut state, picture) = tiled([1, 1], n_cameras, 0);
        let plan = plan_of(&state, &picture, settings(EntityStyle::None, Filtering::Levels, 1));
        let fresh = |code| {
            YuvImage::filled(SIZE_PX.0, SIZE_PX.1, [code, 128, 128], ColorMatrix::Bt709, ColorRange::Limited)
        };
        let n_bytes = fresh(0).len_bytes() as f64;
        renderer.render(&state, &picture, &plan)?;
        let (mut new, mut old) = (Times::default(), Times::default());
        let load = Load::new(renderer.gpu());
        load.first(renderer.gpu(), stage)?;
        let mut last = Duration::ZERO;
        for turn in 0..N_TURNS {
            if stage.budget.is_over() {
                break;
            }
            for camera in &mut state.cameras {
                let image = Arc::new(fresh(64 + turn as u8));
                camera.observation.frame.number += 1;
                camera.observation.frame.image = Arc::clone(&image);
                camera.observation.background = image;
            }
            for times in [&mut new, &mut old] {
                load.between(renderer.gpu(), stage, last)?;
                let before = renderer.gpu().counts();
                let begun = clock.monotonic();
                let rendered = renderer.render(&state, &picture, &plan)?;
                last = clock.monotonic().saturating_sub(begun);
                times.add(&rendered.timings, last);
                times.count(&before, &renderer.gpu().counts());
            }
        }
        let named = |word: &str| format!("{n_cameras} cameras of {} x {}, {word}", SIZE_PX.0, SIZE_PX.1);
        let measured =
            [new.measurement(named("new pictures"), None), old.measurement(named("the same pictures"), None)];
        if let [Some(new), Some(old)] = &measured {
            let bytes = f64::from(n_cameras) * n_bytes;
            let ms = new.whole_ms.median - old.whole_ms.median;
            found.notes.push(format!(
                "{n_cameras} cameras: {ms:.2} ms for {:.1} MB of planes, {:.2} GB/s",
                bytes * 1e-6,
                bytes * 1e-6 / ms.max(1e-6)
            ));
        }
        found.memory_bytes = found.memory_bytes.max(renderer.gpu().memory_bytes());
        found.measurements.extend(measured.into_iter().flatten());
    }
    Ok(found)
}
