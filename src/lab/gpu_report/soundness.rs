//! Views from anywhere: none is refused, and none shows what is no number.

use super::timed::Times;
use super::views::{plan_of, renderer};
use super::{Found, Stage};
use crate::made_scenes::{LIMITS, settings, yard};
use anyhow::Result;
use glam::DVec3;
use videofields_picture::plan::{EntityStyle, Filtering, Picture, View};
use videofields_vision::clock::Clock as _;

/// Number of views that are drawn.
const N_VIEWS: u32 = 10_000;

/// Columns and rows of each.
const SIZE_PX: (u32, u32) = (64, 36);

/// Draws views from random places of the yard. Nothing in it is black, so a black pixel shows what is no number: drivers write 0 for
/// it where a target has 8 bits.
pub(super) fn measure(stage: &Stage<'_>) -> Result<Found> {
    let mut renderer = renderer(stage)?;
    let (state, _) = yard(20, SIZE_PX);
    let of = settings(EntityStyle::Billboards, Filtering::Levels, 1);
    let (mut n_drawn, mut n_black, mut n_refused) = (0_u32, 0_u32, 0_u32);
    let mut random = Random(2016);
    let mut times = Times::default();
    while n_drawn + n_refused < N_VIEWS && !stage.budget.is_over() {
        let mut within = |low: f64, high: f64| low + (high - low) * random.next();
        let eye = DVec3::new(within(-40.0, 40.0), within(-40.0, 40.0), within(0.05, 30.0));
        let target = DVec3::new(within(-20.0, 20.0), within(-20.0, 20.0), within(-1.0, 4.0));
        let fov_y_rad = within(0.05, 2.6);
        let Ok(view) = View::new(eye, target, fov_y_rad, SIZE_PX.0, SIZE_PX.1, &LIMITS) else {
            n_refused += 1;
            continue;
        };
        let picture = Picture::from(view);
        let plan = plan_of(&state, &picture, of);
        let before = renderer.gpu().counts();
        let begun = stage.budget.clock.monotonic();
        let rendered = renderer.render(&state, &picture, &plan)?;
        times.add(&rendered.timings, stage.budget.clock.monotonic().saturating_sub(begun));
        times.count(&before, &renderer.gpu().counts());
        n_black += u32::from(rendered.image.data.chunks_exact(3).any(|pixel| pixel == [0, 0, 0]));
        n_drawn += 1;
    }
    let mut found = Found {
        is_cut_short: n_drawn + n_refused < N_VIEWS,
        memory_bytes: renderer.gpu().memory_bytes(),
        ..Found::default()
    };
    found
        .measurements
        .extend(times.measurement(format!("{n_drawn} views of {} x {}", SIZE_PX.0, SIZE_PX.1), None));
    found
        .notes
        .push(format!("{n_drawn} views drawn, {n_refused} that cannot be; {n_black} with a black pixel."));
    Ok(found)
}

/// The generator `SplitMix64`: the same views in every run.
struct Random(u64);

impl Random {
    /// Returns the next number, 0 to 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}
