//! Which of the cameras that see a vertex are believed: those that enough others agree with, from coarse levels of detail to fine ones.
//!
//! `[M19]` section 4.2. Whoever shows something else there was calibrated a little wrong, sees what the mesh lacks, or a highlight.

use super::{Sight, View};
use crate::frame::lab_of;
use glam::{DVec2, DVec3, Vec3};

/// Within this of each other, in L*a*b* over 100, two colours agree.
pub const AGREEMENT: f32 = 0.15;

/// Levels of detail in which cameras vote, of the picture that is coarsest at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct VoteLevels {
    /// The finest: where pictures lie beside each other by as much as a pixel of it, everything disagrees.
    pub finest: u32,
    /// The coarsest, which comes first.
    pub coarsest: u32,
}

impl Default for VoteLevels {
    fn default() -> Self {
        Self { finest: 4, coarsest: 6 }
    }
}

impl std::fmt::Display for VoteLevels {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}-{}", self.finest, self.coarsest)
    }
}

impl std::str::FromStr for VoteLevels {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "expected FINEST-COARSEST, both 0 to 12, such as 2-5".to_owned();
        let (finest, coarsest) = text.split_once('-').ok_or_else(wrong)?;
        let [finest, coarsest] = [finest, coarsest].map(|of| of.trim().parse::<u32>().ok());
        match (finest, coarsest) {
            (Some(finest), Some(coarsest)) if finest <= coarsest && coarsest <= 12 => {
                Ok(Self { finest, coarsest })
            }
            _ => Err(wrong()),
        }
    }
}

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
    /// Turns [`Sight::Seen`] into [`Sight::Outvoted`] for cameras that fewer than half of all who see it agree with, rounded down, in any
    /// of the levels, from the coarsest on. One camera alone is believed; of two that disagree neither is.
    pub(super) fn vote(&mut self, place: DVec3, views: &[View], levels: VoteLevels, sights: &mut [Sight]) {
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
        for level in (levels.finest..=levels.coarsest).rev() {
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
