//! PLY: one colour a face, the mean of its vertices'.

use super::{Model, too_many};
use glam::Vec3;
use videofields_vision::mesh::{Mesh, ReadError};

pub(super) fn read(bytes: &[u8], most_triangles: usize) -> Result<Model, String> {
    let mesh = Mesh::read_ply(bytes, most_triangles).map_err(|error| match error {
        ReadError::Triangles { count, most } => too_many(count, most),
        ReadError::Format(reason) => reason,
    })?;
    let mean = |colors: &[[u8; 3]], corners: &[u32; 3]| {
        let sum: Vec3 =
            corners.iter().map(|corner| Vec3::from(colors[*corner as usize].map(f32::from))).sum();
        (sum / 3.0).to_array().map(|code| code.round() as u8)
    };
    let triangles_srgb = mesh
        .colors_srgb
        .as_ref()
        .map(|colors| mesh.triangles.iter().map(|corners| mean(colors, corners)).collect());
    let mut model =
        Model { points: mesh.positions_m, triangles: mesh.triangles, triangles_srgb, ..Model::default() };
    model.let_go_of_stray_points();
    Ok(model)
}
