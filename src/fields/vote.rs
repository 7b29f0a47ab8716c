//! Which of the cameras that see a vertex are believed: those that enough others agree with, from coarse levels of detail to fine ones.
//!
//! `[M19]` section 4.2. Whoever shows something else there was calibrated a little wrong, sees what the mesh lacks, or a highlight.

use super::{Sight, View};
use crate::frame::lab_of;
use glam::{DVec2, DVec3, Vec3};

/// Within this of each other, in L*a*b* over 100, two colours agree.
pub const AGREEMENT: f32 = 0.15;

/// What a camera shows of a vertex.
#[derive(Clone, Copy, Debug)]
struct Shown {
    view: usize,
    texture: DVec2,
    /// By how many levels its picture is finer than the coarsest one's there: so a level is of one size on the surface for all.
    finer: f32,
    lab: Vec3,
}

/// Room that is used again from vertex to vertex.
#[derive(Debug, Default)]
pub(super) struct Ballot {
    shown: Vec<Shown>,
}

impl Ballot {
    /// Turns [`Sight::Seen`] into [`Sight::Outvoted`] for cameras that fewer than half of the others agree with, rounded down, in any of
    /// `n_levels` levels from the coarsest to the picture itself. One camera alone is believed; of two that disagree neither is.
    pub(super) fn vote(&mut self, place: DVec3, views: &[View], n_levels: u32, sights: &mut [Sight]) {
        self.shown.clear();
        for (view, of) in views.iter().enumerate().filter(|(view, _)| sights[*view] == Sight::Seen) {
            let Some((texture, depth_m)) = of.project(place) else { continue };
            let finer = of.px_per_m(depth_m).log2() as f32;
            self.shown.push(Shown { view, texture, finer, lab: Vec3::ZERO });
        }
        let n_seen = self.shown.len();
        if n_seen < 2 {
            return;
        }
        let coarsest = self.shown.iter().map(|shown| shown.finer).fold(f32::INFINITY, f32::min);
        for level in (0..n_levels).rev() {
            for shown in &mut self.shown {
                let light = views[shown.view].light_at(shown.texture, level as f32 + shown.finer - coarsest);
                shown.lab = lab_of(light) / 100.0;
            }
            for (i, own) in self.shown.iter().enumerate() {
                let agrees = |(j, other): (usize, &Shown)| j != i && own.lab.distance(other.lab) < AGREEMENT;
                let n_agreeing = self.shown.iter().enumerate().filter(|of| agrees(*of)).count();
                if n_agreeing < n_seen / 2 {
                    sights[own.view] = Sight::Outvoted;
                }
            }
        }
    }
}
