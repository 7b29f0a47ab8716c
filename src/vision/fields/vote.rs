//! Which of the cameras that see a vertex are believed: those that enough others agree with, from coarse levels of detail to fine ones.
//!
//! `[M19]` section 4.2. Whoever shows something else there was calibrated a little wrong, sees what the mesh lacks, or a highlight.
//!
//! In a coarse level a texel near the end of what a camera sees mixes what lies behind, and the camera would be outvoted for what others
//! do not see: so nobody votes, or is voted on, in levels whose texels reach beyond where the surface goes on in its picture.

use super::{Sight, View};
use crate::frame::lab_of;
use crate::mesh::{Mesh, Raster};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

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
    /// The coarsest level whose texels show nothing but the surface.
    within: f32,
}

/// Room that is used again from vertex to vertex.
#[derive(Debug, Default)]
pub(super) struct Ballot {
    shown: Vec<Shown>,
}

impl Ballot {
    /// Turns [`Sight::Seen`] into [`Sight::Outvoted`] for cameras that fewer than half of all others who vote agree with, rounded down as of
    /// all, in any of the levels, from the coarsest on. `within` tells of every view the coarsest level of its own picture whose texels
    /// show nothing but the surface. One camera alone is believed; of two that disagree neither is.
    pub(super) fn vote(
        &mut self,
        place: DVec3,
        (views, within): (&[View], &[f32]),
        levels: VoteLevels,
        sights: &mut [Sight],
    ) {
        self.shown.clear();
        for (view, of) in views.iter().enumerate().filter(|(view, _)| sights[*view] == Sight::Seen) {
            let Some((texture, depth_m)) = of.project(place) else { continue };
            let finer = of.px_per_m(depth_m).log2() as f32;
            self.shown.push(Shown { view, texture, finer, lab: Vec3::ZERO, within: within[view] });
        }
        let coarsest = self.shown.iter().map(|shown| shown.finer).fold(f32::INFINITY, f32::min);
        for level in (levels.finest..=levels.coarsest).rev().map(|level| level as f32) {
            let own_level = |shown: &Shown| level + shown.finer - coarsest;
            for shown in &mut self.shown {
                shown.lab = lab_of(views[shown.view].light_at(shown.texture, own_level(shown))) / 100.0;
            }
            let voting = || self.shown.iter().filter(|shown| own_level(shown) <= shown.within);
            let n_voting = voting().count();
            for own in voting() {
                let agrees =
                    |other: &&Shown| other.view != own.view && own.lab.distance(other.lab) < AGREEMENT;
                if n_voting > 1 && voting().filter(agrees).count() < n_voting / 2 {
                    sights[own.view] = Sight::Outvoted;
                }
            }
        }
    }
}

/// By how much the change of reciprocals of depths from one texel to the next may itself change, relative, where a surface goes on: those of
/// a plane change evenly.
const MOST_BEND: f32 = 0.02;

/// The coarsest level of a view's own picture whose texels, around a vertex, show nothing but the surface that the vertex is on: by vertex,
/// and of a vertex by view. Negative where even the finest shows more, and where it is not in the picture.
///
/// **Cost** a depth map of `side_px` texels along its longer side a view.
pub(super) fn footprints(mesh: &Mesh, views: &[View], side_px: u32) -> Vec<f32> {
    let of_views: Vec<Vec<f32>> = views.par_iter().map(|view| footprints_of(mesh, view, side_px)).collect();
    (0..mesh.positions_m.len()).flat_map(|vertex| of_views.iter().map(move |of| of[vertex])).collect()
}

fn footprints_of(mesh: &Mesh, view: &View, side_px: u32) -> Vec<f32> {
    let (columns, rows) = view.camera().size_px();
    let side = f64::from(side_px) / f64::from(columns.max(rows));
    let size_px = [columns, rows].map(|of| ((f64::from(of) * side).round() as usize).max(1));
    // Texels of the depth map that a pixel of the picture is wide.
    let scale = size_px[0] as f64 / f64::from(view.picture().width);
    let [width, height] = size_px;
    let raster = Raster::of(mesh, view.camera(), size_px);
    let size = DVec2::new(width as f64, height as f64);
    let ends = |x: usize, y: usize| {
        // Of what lies beside the picture nothing is known.
        if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height {
            return true;
        }
        let near = |x: usize, y: usize| 1.0 / raster.depths_m()[y * width + x];
        let own = near(x, y);
        let bend = |before: f32, after: f32| (before + after - 2.0 * own).abs() > MOST_BEND * own;
        own <= 0.0
            || bend(near(x - 1, y), near(x + 1, y))
            || bend(near(x, y - 1), near(x, y + 1))
            || !view.is_foreground(DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / size)
    };
    let rooms = rooms(size_px, ends);
    let level = |place: &DVec3| {
        let Some((texture, _)) = view.project(*place) else { return f32::NEG_INFINITY };
        let at = (texture * size).as_uvec2();
        let room = rooms[(at.y as usize).min(height - 1) * width + (at.x as usize).min(width - 1)];
        // Between the middles of four texels, each of which reaches half its width beyond.
        (f64::from(room) / scale).log2() as f32
    };
    mesh.positions_m.iter().map(level).collect()
}

/// How many texels away, along rows and columns, is the nearest that `ends`: of each that many or fewer lie around it that do not.
fn rooms([width, height]: [usize; 2], ends: impl Fn(usize, usize) -> bool) -> Vec<u32> {
    let far = (width + height) as u32;
    let mut rooms: Vec<u32> =
        (0..width * height).map(|at| if ends(at % width, at / width) { 0 } else { far }).collect();
    // Two passes, each of which looks at the neighbours that were done before (Rosenfeld and Pfaltz 1966).
    let mut nearer = |x: usize, y: usize, over: [(isize, isize); 4]| {
        for (dx, dy) in over {
            let (Some(x_near), Some(y_near)) = (x.checked_add_signed(dx), y.checked_add_signed(dy)) else {
                continue;
            };
            if x_near < width && y_near < height {
                let room = rooms[y_near * width + x_near] + 1;
                let own = &mut rooms[y * width + x];
                *own = (*own).min(room);
            }
        }
    };
    for at in 0..width * height {
        nearer(at % width, at / width, [(-1, 0), (-1, -1), (0, -1), (1, -1)]);
    }
    for at in (0..width * height).rev() {
        nearer(at % width, at / width, [(1, 0), (1, 1), (0, 1), (-1, 1)]);
    }
    rooms
}

#[cfg(test)]
mod tests {
    use super::super::testing::{facing, grid};
    use super::*;

    #[test]
    fn rooms_are_as_wide_as_a_search_finds() {
        let ends = |x: usize, y: usize| (x * 7 + y * 13).is_multiple_of(41);
        let found = rooms([23, 17], ends);
        for (at, room) in found.iter().enumerate() {
            let (x, y) = (at % 23, at / 23);
            let all = (0..23 * 17).filter(|at| ends(at % 23, at / 23));
            let nearest = all.map(|at| (at % 23).abs_diff(x).max((at / 23).abs_diff(y))).min().unwrap();
            assert_eq!(*room as usize, nearest, "{x} {y}");
        }
        assert_eq!(rooms([2, 1], |_, _| false), [3, 3]);
    }

    #[test]
    fn near_the_end_of_what_it_sees_nobody_is_outvoted_for_what_lies_beside() {
        // A sheet before black, seen by one from near enough that its picture ends on it, and by two that see beyond it.
        let (positions, triangles) = grid(9, 0.0, |_, _| 0.0);
        let mesh = Mesh::new(positions, triangles);
        let sheet = |x: f64, y: f64| {
            let is_on = (0.0..=8.0).contains(&x) && (0.0..=8.0).contains(&y);
            if is_on { Vec3::splat(0.5) } else { Vec3::ZERO }
        };
        let views = [facing(3.5, sheet), facing(20.0, sheet), facing(20.5, sheet)];
        let within = footprints(&mesh, &views, 256);
        let level = |vertex: usize, view: usize| within[3 * vertex + view];
        // In the middle the sheet goes on for 4 m to either side: at 110 / 20 pixels a metre some 20 pixels.
        assert!((4.0..4.6).contains(&level(40, 1)), "{}", level(40, 1));
        assert!(level(4 * 9, 1) < 1.0 && level(0, 0) == f32::NEG_INFINITY);
        let levels = VoteLevels { finest: 0, coarsest: 6 };
        let mut ballot = Ballot::default();
        for vertex in 0..81 {
            let mut sights = [Sight::Seen; 3];
            let own = &within[3 * vertex..3 * vertex + 3];
            ballot.vote(mesh.positions_m[vertex], (&views, own), levels, &mut sights);
            assert_eq!(sights, [Sight::Seen; 3], "{vertex}");
        }
        // As before, whoever mixes in what lies beside loses.
        let mut sights = [Sight::Seen; 3];
        ballot.vote(
            mesh.positions_m[10],
            (&views, &[9.0; 3]),
            VoteLevels { finest: 5, coarsest: 5 },
            &mut sights,
        );
        assert_ne!(sights, [Sight::Seen; 3]);
    }
}
