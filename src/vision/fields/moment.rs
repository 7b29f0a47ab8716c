//! One mesh of those that follow each other, ready to be coloured: with what cameras show of it, and how much each may lend.

use super::{Field, View};
use crate::clock::Timestamp;
use crate::mesh::{Mended, Mesh};

/// One frame of a sequence in memory.
#[derive(Clone, Debug)]
pub struct Moment {
    /// The frame's number.
    pub number: u64,
    /// When it is.
    pub at: Timestamp,
    /// The mesh, mended, in the world.
    pub mesh: Mesh,
    /// What was mended.
    pub mended: Mended,
    /// Triangles that were left out as drawn out.
    pub n_extruded: usize,
    /// Cameras without a picture of this frame, by their places among the views, and what is wrong with it where there is one.
    pub blind: Vec<(usize, Option<String>)>,
    /// One a camera, in order, blind ones too; one blind view without cameras.
    pub views: Vec<View>,
    /// How much each view may lend; none where the mesh has no triangles, and where a device finds it.
    pub field: Option<Field>,
}

/// Bytes of a field by vertex and view: sight, ramp, weight, size of a pixel.
const FIELD_BYTES: usize = 1 + 4 + 4 + 4;

/// Bytes of a mesh and a field by vertex: place, normal, colour, mixed colour.
const VERTEX_BYTES: usize = 24 + 12 + 3 + 12;

impl Moment {
    /// Bytes that it takes.
    #[must_use]
    pub fn n_bytes(&self) -> usize {
        let n_vertices = self.mesh.positions_m.len();
        let pictures = self.views.iter().map(|view| {
            let picture = view.picture();
            // Levels of detail are a third more; a mask is at most as large as the picture, usually.
            picture.data.len() + picture.data.len() / 3 + picture.data.len() / 3
        });
        n_vertices * (VERTEX_BYTES + FIELD_BYTES * self.views.len())
            + self.mesh.triangles.len() * size_of::<[u32; 3]>()
            + pictures.sum::<usize>()
    }
}
