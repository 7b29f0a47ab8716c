//! One frame's mesh: read, turned into the world, mended, and without what was drawn out by fast motion.

use super::SequenceError;
use super::frames::Frame;
use super::turn::Up;
use std::path::Path;
use videofields_picture::scene::{ImportReference, Imports, read_gltf};
use videofields_recording::ingest::{MediaRoots, read_bytes};
use videofields_vision::geometry::Camera;
use videofields_vision::mesh::{Mended, Mesh, ReadError, extruded};

/// Most bytes of a mesh's file.
const MAX_MESH_BYTES: usize = 512 << 20;

/// Most triangles of a frame.
pub(super) const MAX_TRIANGLES: usize = 1 << 21;

/// A frame's mesh in the world.
#[derive(Clone, Debug, Default)]
pub struct FrameMesh {
    /// The mesh; without triangles where nothing is there.
    pub mesh: Mesh,
    /// What was mended.
    pub mended: Mended,
    /// Triangles that were left out because they had been drawn out between things that moved apart.
    pub n_extruded: usize,
}

/// How meshes become the world's.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeshesAs {
    pub(super) metres_per_unit: f64,
    pub(super) up: Option<Up>,
    pub(super) extruded_times: Option<f64>,
}

/// Reads a frame's mesh.
pub(super) fn read(frame: &Frame, how: MeshesAs, roots: &MediaRoots) -> Result<FrameMesh, SequenceError> {
    let refused =
        |reason: String| SequenceError::Mesh { number: frame.number, path: frame.mesh.clone(), reason };
    let ending = frame.mesh.extension().and_then(std::ffi::OsStr::to_str).unwrap_or_default();
    let bytes = |path: &Path| {
        let bytes = read_bytes(path, roots, MAX_MESH_BYTES as u64 + 1).map_err(|error| error.to_string())?;
        if bytes.len() > MAX_MESH_BYTES {
            return Err(format!("at most {MAX_MESH_BYTES} bytes are allowed"));
        }
        Ok(bytes)
    };
    let told = |error: ReadError| error.to_string();
    let (mesh, usual_up) = match ending.to_ascii_lowercase().as_str() {
        "ply" => {
            (bytes(&frame.mesh).and_then(|bytes| Mesh::read_ply(&bytes, MAX_TRIANGLES).map_err(told)), Up::Z)
        }
        "obj" => {
            (bytes(&frame.mesh).and_then(|bytes| Mesh::read_obj(&bytes, MAX_TRIANGLES).map_err(told)), Up::Z)
        }
        "gltf" | "glb" => (gltf(&frame.mesh, roots), Up::Y),
        _ => (Err("a mesh's file ends with .ply, .obj, .gltf or .glb".to_owned()), Up::Z),
    };
    let mut mesh = mesh.map_err(refused)?;
    let up = how.up.unwrap_or(usual_up);
    mesh.positions_m.iter_mut().for_each(|at| *at = up.turned(*at) * how.metres_per_unit);
    let (mesh, mended) = mesh.mended();
    let drawn_out = how.extruded_times.map(|times| extruded(&mesh, times)).unwrap_or_default();
    let n_extruded = drawn_out.iter().filter(|is_extruded| **is_extruded).count();
    if n_extruded == 0 {
        return Ok(FrameMesh { mesh, mended, n_extruded });
    }
    let mut left = mesh;
    let mut each = drawn_out.into_iter();
    left.triangles.retain(|_| !each.next().unwrap_or(false));
    // Points that only such triangles had go with them; normals are those of what is left.
    let (mesh, _) = left.mended();
    Ok(FrameMesh { mesh, mended, n_extruded })
}

fn gltf(path: &Path, roots: &MediaRoots) -> Result<Mesh, String> {
    let file = path.to_str().ok_or("the path must be UTF-8")?;
    let found = read_gltf(file, MAX_TRIANGLES, &mut Beneath(roots))?;
    let mut mesh = Mesh::new(found.points, found.triangles);
    if let Some(of_triangles) = found.colors_srgb.filter(|colors| colors.len() == mesh.triangles.len()) {
        let mut colors = vec![[0; 3]; mesh.positions_m.len()];
        for (corners, color) in mesh.triangles.iter().zip(of_triangles) {
            corners.iter().for_each(|corner| colors[*corner as usize] = color);
        }
        mesh.colors_srgb = Some(colors);
    }
    Ok(mesh)
}

/// Files that a glTF names, beneath the media roots.
struct Beneath<'a>(&'a MediaRoots);

impl Imports for Beneath<'_> {
    fn calibration(&mut self, _: &ImportReference) -> Result<Camera, String> {
        Err("a mesh names no calibration".to_owned())
    }

    fn file(&mut self, file: &str, most_bytes: usize) -> Result<Vec<u8>, String> {
        let bytes =
            read_bytes(Path::new(file), self.0, most_bytes as u64 + 1).map_err(|error| error.to_string())?;
        if bytes.len() > most_bytes {
            return Err(format!("{file:?}: at most {most_bytes} bytes are allowed"));
        }
        Ok(bytes)
    }
}
