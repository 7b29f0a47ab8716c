//! One frame, ready to be coloured: its mesh, what cameras show of it, and how much each may lend.

use super::{Sequence, SequenceError};
use crate::clock::Timestamp;
use crate::fields::{Field, FieldError, FieldSettings, Topology, View};
use crate::frame::{Mask, RgbImage};
use crate::geometry::{Camera, Distortion, Pose};
use crate::mesh::{Mended, Mesh};
use glam::{DQuat, DVec2, DVec3};

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
    /// Cameras without a picture of this frame, by their places in [`Sequence::cameras`], and what is wrong with it where there is one.
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
    /// Reads a frame and makes it ready, with its field where there are `settings` for it. A camera whose picture is missing or broken is
    /// blind.
    ///
    /// **Cost** that of reading the mesh, decoding as many pictures as cameras, and [`Field::new`].
    ///
    /// # Errors
    /// Where its mesh cannot be read.
    pub(super) fn read(
        sequence: &mut Sequence,
        idx: usize,
        settings: Option<&FieldSettings>,
    ) -> Result<Self, SequenceError> {
        let (number, at) = (sequence.frames()[idx].number, sequence.frames()[idx].at);
        let found = sequence.mesh(idx)?;
        let mut moment = Self {
            number,
            at,
            mesh: found.mesh,
            mended: found.mended,
            n_extruded: found.n_extruded,
            blind: Vec::new(),
            views: Vec::new(),
            field: None,
        };
        if moment.mesh.triangles.is_empty() {
            return Ok(moment);
        }
        let colorless = |source| SequenceError::Field { number, source };
        for camera in 0..sequence.cameras().len() {
            let view = match seen(sequence, idx, camera) {
                Ok(Some((picture, mask))) => {
                    View::new(sequence.cameras()[camera].camera.clone(), picture, mask)
                }
                Ok(None) => moment.blinded(camera, None, sequence.cameras()[camera].camera.clone()),
                Err(reason) => {
                    moment.blinded(camera, Some(reason), sequence.cameras()[camera].camera.clone())
                }
            };
            moment.views.push(view);
        }
        if moment.views.is_empty() {
            moment.views.push(blind_view(nobody()));
        }
        let Some(settings) = settings else { return Ok(moment) };
        let topology = Topology::of(&moment.mesh.positions_m, &moment.mesh.triangles);
        match Field::new(&moment.mesh, &topology, &mut moment.views, settings) {
            Ok(field) => moment.field = Some(field),
            Err(FieldError::Empty) => {}
            Err(source) => return Err(colorless(source)),
        }
        Ok(moment)
    }

    fn blinded(&mut self, camera: usize, reason: Option<String>, of: Camera) -> View {
        self.blind.push((camera, reason));
        blind_view(of)
    }

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

/// What a camera shows of a frame, and what of it is of the mesh.
fn seen(
    sequence: &mut Sequence,
    idx: usize,
    camera: usize,
) -> Result<Option<(RgbImage, Option<Mask>)>, String> {
    let Some(picture) = sequence.picture(idx, camera).map_err(|error| error.to_string())? else {
        return Ok(None);
    };
    let mask = sequence.mask(idx, camera).map_err(|error| format!("its mask: {error}"))?;
    Ok(Some((picture, mask)))
}

/// A camera that sees nothing of any mesh, so that it keeps its place among the views.
fn blind_view(camera: Camera) -> View {
    let picture = RgbImage { width: 1, height: 1, data: vec![0; 3] };
    View::new(camera, picture, Some(Mask::filled(1, 1, 0)))
}

/// A camera for who has none.
fn nobody() -> Camera {
    let pose = Pose { position_in_world: DVec3::ZERO, world_from_local: DQuat::IDENTITY };
    Camera::new((1, 1), DVec2::ONE, DVec2::splat(0.5), Distortion::None, pose)
        .expect("a pinhole of one pixel is a camera")
}
