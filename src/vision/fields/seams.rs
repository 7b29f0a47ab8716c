//! Where a camera stops lending colour: triangles of which it is believed in one or two vertices.

use super::{Sight, Topology};

/// Seams of one camera, by why they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SeamCounts {
    /// Triangles that something else hides in part.
    pub n_hidden: usize,
    /// Triangles in part of which others disagree.
    pub n_outvoted: usize,
    /// Triangles that lie in part beside the picture, or beside what of it is of the mesh.
    pub n_beside: usize,
}

impl SeamCounts {
    /// All of them.
    #[must_use]
    pub const fn sum(&self) -> usize {
        self.n_hidden + self.n_outvoted + self.n_beside
    }
}

/// The vertices of a camera's seams, each once, in growing order; and how many triangles are seams.
pub(super) fn seams(topology: &Topology, sight: impl Fn(u32) -> Sight) -> (Vec<u32>, SeamCounts) {
    let mut counts = SeamCounts::default();
    let mut is_seam = vec![false; topology.n_vertices()];
    for face in (0..topology.n_faces() as u32).filter(|face| topology.is_face(*face)) {
        let corners = topology.corners(face);
        let sights = corners.map(&sight);
        let n_seen = sights.iter().filter(|sight| **sight == Sight::Seen).count();
        if !(1..=2).contains(&n_seen) {
            continue;
        }
        match sights.into_iter().max() {
            Some(Sight::Beside) => counts.n_beside += 1,
            Some(Sight::Near | Sight::Hidden) => counts.n_hidden += 1,
            _ => counts.n_outvoted += 1,
        }
        corners.into_iter().for_each(|corner| is_seam[corner as usize] = true);
    }
    let vertices = (0..).zip(&is_seam).filter(|(_, is_seam)| **is_seam).map(|(vertex, _)| vertex).collect();
    (vertices, counts)
}
