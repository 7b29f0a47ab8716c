//! Wavefront OBJ: positions with or without colours, faces of any number of corners; groups and objects become one mesh. Materials,
//! normals and texture coordinates are passed over.

use super::{MAX_POINTS, Mesh, ReadError};
use glam::DVec3;
use std::collections::HashMap;
use tobj::LoadOptions;

/// How the library is to read: triangles, also of polygons, nothing else.
const OPTIONS: LoadOptions =
    LoadOptions { single_index: false, triangulate: true, ignore_points: true, ignore_lines: true };

impl Mesh {
    /// Reads an OBJ file of at most `most_triangles`; colours where its vertices have any (0 to 1, sRGB). Groups of a file do not share
    /// vertices as the library hands them on: those of the same place are one again here.
    ///
    /// # Errors
    /// What is wrong with it, or what it has too much of.
    pub fn read_obj(mut bytes: &[u8], most_triangles: usize) -> Result<Self, ReadError> {
        let no_materials = |_: &std::path::Path| Ok((Vec::new(), HashMap::new()));
        let (models, _) = tobj::load_obj_buf(&mut bytes, &OPTIONS, no_materials)
            .map_err(|error| format!("not an OBJ file: {error}"))?;
        let n_triangles: usize = models.iter().map(|model| model.mesh.indices.len() / 3).sum();
        if n_triangles > most_triangles {
            return Err(ReadError::Triangles { count: n_triangles, most: most_triangles });
        }
        let (mut positions_m, mut colors, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        let mut known: HashMap<[u64; 3], u32> = HashMap::new();
        let is_grouped = models.len() > 1;
        for model in &models {
            let mesh = &model.mesh;
            let places: Vec<u32> = (mesh.positions.as_chunks::<3>().0.iter().enumerate())
                .map(|(idx, at)| {
                    let next = positions_m.len() as u32;
                    let place =
                        if is_grouped { *known.entry(at.map(f64::to_bits)).or_insert(next) } else { next };
                    if place == next {
                        positions_m.push(DVec3::from_array(*at));
                        colors.extend(mesh.vertex_color.get(3 * idx..3 * idx + 3));
                    }
                    place
                })
                .collect();
            for corners in mesh.indices.as_chunks::<3>().0 {
                let found = corners.map(|corner| places.get(corner as usize).copied());
                let [Some(a), Some(b), Some(c)] = found else {
                    return Err(format!("a face of {:?} names a vertex that is not there", model.name).into());
                };
                triangles.push([a, b, c]);
            }
        }
        if positions_m.len() > MAX_POINTS {
            return Err(
                format!("at most {MAX_POINTS} vertices are allowed, got {}", positions_m.len()).into()
            );
        }
        let code = |channel: f64| (channel.clamp(0.0, 1.0) * 255.0).round() as u8;
        let codes: Vec<[u8; 3]> =
            colors.iter().map(|color: &&[f64]| [code(color[0]), code(color[1]), code(color[2])]).collect();
        let mut mesh = Self::new(positions_m, triangles);
        mesh.colors_srgb = (!codes.is_empty() && codes.len() == mesh.positions_m.len()).then_some(codes);
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_of_any_kind_and_groups_become_one_mesh() {
        let text = "# a strip\nmtllib none.mtl\no left\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nf 1//1 2//1 3//1 4//1\n\
            o right\nv 4000000.125 0 0\nv 2 1 0\nf -5/1/1 -2/1/1 -1/1/1\nf 2 6 3\nl 1 2\n";
        let mesh = Mesh::read_obj(text.as_bytes(), 100).unwrap();
        assert_eq!((mesh.positions_m.len(), mesh.triangles.len(), mesh.colors_srgb.is_none()), (6, 4, true));
        assert!(mesh.positions_m.contains(&DVec3::new(4_000_000.125, 0.0, 0.0)));
        let at = |corner: u32| mesh.positions_m[corner as usize];
        let first = mesh.triangles[0].map(at);
        assert_eq!(first, [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0)]);
        // Both objects share points.
        let (mended, told) = mesh.mended();
        assert!(told.is_none() && mended.triangles.len() == 4);
    }

    #[test]
    fn colours_are_read_where_every_vertex_has_them() {
        let text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0.5 0.5 2\nf 1 2 3\n";
        let mesh = Mesh::read_obj(text.as_bytes(), 1).unwrap();
        assert_eq!(mesh.colors_srgb, Some(vec![[255, 0, 0], [0, 255, 0], [128, 128, 255]]));
        let partly = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        assert!(Mesh::read_obj(partly.as_bytes(), 1).unwrap_err().to_string().contains("color"));
    }

    #[test]
    fn what_is_malformed_is_refused() {
        let check = |text: &str, says: &str| {
            let error = Mesh::read_obj(text.as_bytes(), 2).unwrap_err().to_string();
            assert!(error.contains(says), "{text:?}: {error}");
        };
        let points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        check("v 1 x 0\n", "OBJ");
        check(&format!("{points}f 1 2 9\n"), "OBJ");
        check(&format!("{points}f 1 2 -9\n"), "OBJ");
        check(&format!("{points}f 1 two 3\n"), "OBJ");
        check(&format!("{points}{}", "f 1 2 3\n".repeat(3)), "3 triangles, at most 2");
        assert!(Mesh::read_obj(b"", 2).unwrap().triangles.is_empty());
        let random: Vec<u8> = (0..=255).cycle().take(5000).collect();
        drop(Mesh::read_obj(&random, 2));
    }
}
