//! One frame, ready to be coloured: its mesh, what cameras show of it, and how much each may lend.

use super::{Sequence, SequenceError};
use glam::{DQuat, DVec2, DVec3};
use videofields_vision::fields::{Field, FieldError, FieldSettings, Moment, Topology, View};
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::geometry::{Camera, Distortion, Pose};

/// Reads a frame and makes it ready, with its field where there are `settings` for it. A camera whose picture is missing or broken is
/// blind.
///
/// **Cost** that of reading the mesh, decoding as many pictures as cameras, and [`Field::new`].
///
/// # Errors
/// Where its mesh cannot be read.
pub(super) fn read_moment(
    sequence: &mut Sequence,
    idx: usize,
    settings: Option<&FieldSettings>,
) -> Result<Moment, SequenceError> {
    let (number, at) = (sequence.frames()[idx].number, sequence.frames()[idx].at);
    let found = sequence.mesh(idx)?;
    let mut moment = Moment {
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
            Ok(Some((picture, mask))) => View::new(sequence.cameras()[camera].camera.clone(), picture, mask),
            Ok(None) => blinded(&mut moment, camera, None, sequence.cameras()[camera].camera.clone()),
            Err(reason) => {
                blinded(&mut moment, camera, Some(reason), sequence.cameras()[camera].camera.clone())
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

fn blinded(moment: &mut Moment, camera: usize, reason: Option<String>, of: Camera) -> View {
    moment.blind.push((camera, reason));
    blind_view(of)
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
