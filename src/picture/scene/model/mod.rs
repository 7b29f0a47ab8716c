//! Models in files beside a scene document: glTF, GLB and PLY -> triangles with colours and pictures.
//!
//! Every count is held against a limit before room is made for what it counts, every offset against the bytes that are
//! there; what is malformed is refused with a reason, and nothing is fetched from anywhere but the files that
//! [`super::Imports`] allows.

mod accessor;
mod gltf;
mod gltf_picture;
mod ply;

use super::paint::MappedTriangle;
use super::texture::{Files, Texture};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;
use videofields_vision::mesh::MAX_POINTS;

/// Most bytes of a model's file, and of each file that it names.
pub const MAX_MODEL_BYTES: usize = 64 << 20;

/// Most triangles of all models of a scene together.
pub const MAX_MODEL_TRIANGLES: usize = 1 << 20;

/// What a model's file holds.
#[derive(Debug, Default)]
pub(super) struct Model {
    /// In the file's own axes and units.
    pub(super) points: Vec<DVec3>,
    /// Three indices of points each, counter-clockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The colour of each triangle, 8-bit sRGB; none where the file has no colours.
    pub(super) triangles_srgb: Option<Vec<[u8; 3]>>,
    /// The pictures on it.
    pub(super) pictures: Vec<Arc<Texture>>,
    /// What covers each triangle; empty without pictures.
    pub(super) mapped: Vec<MappedTriangle>,
    /// Whether the file's axes have y upwards, as glTF's have; else z is.
    pub(super) is_y_up: bool,
}

impl Model {
    /// Keeps the points alone that triangles name, in the order in which they do first: so triangles bound what it takes.
    fn let_go_of_stray_points(&mut self) {
        const NOWHERE: u32 = u32::MAX;
        let mut places = vec![NOWHERE; self.points.len()];
        let mut kept = Vec::new();
        for corner in self.triangles.iter_mut().flatten() {
            let place = &mut places[*corner as usize];
            if *place == NOWHERE {
                *place = kept.len() as u32;
                kept.push(self.points[*corner as usize]);
            }
            *corner = *place;
        }
        self.points = kept;
    }
}

/// Reads a model with at most `most_triangles`.
pub(super) fn read(file: &str, most_triangles: usize, files: &mut Files<'_>) -> Result<Model, String> {
    let bytes = files.imports().file(file, MAX_MODEL_BYTES)?;
    let extension = Path::new(file).extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let model = match extension.to_ascii_lowercase().as_str() {
        "gltf" | "glb" => gltf::read(&bytes, file, most_triangles, files),
        "ply" => ply::read(&bytes, most_triangles),
        _ => Err("a model's file ends with .gltf, .glb or .ply".to_owned()),
    };
    model.map_err(|reason| format!("cannot read {file:?}: {}", shortened(&reason)))
}

/// The triangles of a glTF or GLB file alone, in its own axes (y up) and units, with the colour of each where there are any.
///
/// # Errors
/// When the file is no glTF, holds what is not read, or more than `most_triangles`.
pub fn read_gltf(
    file: &str,
    most_triangles: usize,
    imports: &mut dyn super::Imports,
) -> Result<GltfTriangles, String> {
    let bytes = imports.file(file, MAX_MODEL_BYTES)?;
    let model = gltf::read(&bytes, file, most_triangles, &mut Files::new(imports))
        .map_err(|reason| shortened(&reason))?;
    Ok(GltfTriangles { points: model.points, triangles: model.triangles, colors_srgb: model.triangles_srgb })
}

/// What [`read_gltf`] finds.
pub struct GltfTriangles {
    pub points: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Of every triangle.
    pub colors_srgb: Option<Vec<[u8; 3]>>,
}

/// What a library says may repeat the file's own text at length.
pub(super) fn shortened(reason: &str) -> String {
    const MOST_CHARS: usize = 300;
    let line = |char: char| if char.is_control() { ' ' } else { char };
    reason.chars().take(MOST_CHARS).map(line).collect()
}

/// What is said of too many triangles.
fn too_many(count: usize, most_triangles: usize) -> String {
    format!(
        "{count} triangles, but of {MAX_MODEL_TRIANGLES} that all models of a scene may have together \
         {most_triangles} are left"
    )
}
