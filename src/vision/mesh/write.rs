//! Meshes as files that other programs read: PLY (the world's axes) and GLB (glTF's).

use super::{Mesh, MeshError};
use crate::frame::linear_from_srgb;
use glam::{DVec3, Vec3};
use gltf::binary::{Glb, Header as GlbHeader};
use ply_rs_bw::ply::{
    Addable, ElementDef, Encoding, Header as PlyHeader, PropertyAccess, PropertyDef, PropertyType, ScalarType,
};
use ply_rs_bw::writer::Writer;
use serde_json::json;
use std::array::from_fn;
use std::f32::consts::FRAC_1_SQRT_2;
use std::io::{self, BufWriter, Write};

impl Mesh {
    /// Writes a PLY file: binary, little-endian; `float` x, y, z (metres, along the world's axes), nx, ny, nz, `uchar` red, green,
    /// blue (sRGB) where there are colours, and faces as lists of three. What is far from the world's origin is rounded to
    /// `float`: 0.1 mm at 1 km.
    ///
    /// # Errors
    /// When lists do not belong together (`InvalidInput`, a [`MeshError`]), or `to` cannot be written to.
    pub fn write_ply(&self, to: &mut impl Write) -> io::Result<()> {
        self.is_sound()?;
        let mut to = BufWriter::new(to);
        let writer = Writer::<Element>::new();
        let header = self.ply_header();
        writer.write_header(&mut to, &header)?;
        let [vertex, face] = [&header.elements["vertex"], &header.elements["face"]];
        // One element after the other: the library's own way would have all of them in memory once more.
        for idx in 0..self.positions_m.len() {
            let element = Element::Vertex {
                position: self.positions_m[idx].as_vec3(),
                normal: self.normals[idx],
                color_srgb: self.colors_srgb.as_ref().map_or([0; 3], |colors| colors[idx]),
            };
            writer.write_little_endian_element(&mut to, &element, vertex)?;
        }
        for corners in &self.triangles {
            let element = Element::Face(corners.map(u32::cast_signed));
            writer.write_little_endian_element(&mut to, &element, face)?;
        }
        to.flush()
    }

    fn ply_header(&self) -> PlyHeader {
        let mut header = PlyHeader::new();
        header.encoding = Encoding::BinaryLittleEndian;
        let mut vertex = ElementDef::new("vertex".into());
        vertex.count = self.positions_m.len();
        for name in ["x", "y", "z", "nx", "ny", "nz"] {
            vertex.properties.add(PropertyDef::new(name.into(), PropertyType::Scalar(ScalarType::Float)));
        }
        let colors: &[&str] = if self.colors_srgb.is_some() { &["red", "green", "blue"] } else { &[] };
        for name in colors {
            vertex.properties.add(PropertyDef::new((*name).into(), PropertyType::Scalar(ScalarType::UChar)));
        }
        let mut face = ElementDef::new("face".into());
        face.count = self.triangles.len();
        let list = PropertyType::List(ScalarType::UChar, ScalarType::Int);
        face.properties.add(PropertyDef::new("vertex_indices".into(), list));
        header.elements.add(vertex);
        header.elements.add(face);
        header
    }

    /// Writes a binary glTF 2.0 file. Points keep the world's axes; the one node turns them upright for glTF, whose y is up and
    /// whose -z is north, and moves them: they are `f32` relative to the middle of the mesh, so that its shape is as exact far
    /// from the world's origin as near it. Colours are 16-bit linear, as glTF wants them.
    ///
    /// # Errors
    /// When lists do not belong together or there are no triangles, which glTF cannot say (`InvalidInput`, a [`MeshError`]), or
    /// `to` cannot be written to.
    pub fn write_glb(&self, to: &mut impl Write) -> io::Result<()> {
        self.is_sound()?;
        let Some([low, high]) = self.bounds().filter(|_| !self.triangles.is_empty()) else {
            return Err(MeshError::Empty.into());
        };
        // Rounded first: what the node says is then exactly what was taken away.
        let origin = (0.5 * (low + high)).as_vec3();
        let relative = |at: DVec3| (at - origin.as_dvec3()).as_vec3();
        let positions = self.positions_m.iter().map(|at| relative(*at).to_array());

        let mut parts = GlbParts::default();
        let position = parts.push(positions.flatten().flat_map(f32::to_le_bytes), ARRAY_BUFFER);
        let normals = self.normals.iter().flat_map(Vec3::to_array);
        let normal = parts.push(normals.flat_map(f32::to_le_bytes), ARRAY_BUFFER);
        let indices =
            parts.push(self.triangles.iter().flatten().flat_map(|corner| corner.to_le_bytes()), INDEX_BUFFER);
        let n_points = self.positions_m.len();
        let mut accessors = vec![
            json!({
                "bufferView": position, "componentType": FLOAT, "type": "VEC3", "count": n_points,
                "min": relative(low).to_array(), "max": relative(high).to_array(),
            }),
            json!({ "bufferView": normal, "componentType": FLOAT, "type": "VEC3", "count": n_points }),
            json!({
                "bufferView": indices, "componentType": UNSIGNED_INT, "type": "SCALAR",
                "count": 3 * self.triangles.len(),
            }),
        ];
        let mut attributes = json!({ "POSITION": 0, "NORMAL": 1 });
        if let Some(colors) = &self.colors_srgb {
            let linear: [u16; 256] =
                from_fn(|code| (linear_from_srgb(code as f32 / 255.0) * 65535.0).round() as u16);
            // Four channels: attributes begin at multiples of four bytes.
            let channels = colors.iter().flat_map(|[r, g, b]| {
                [linear[usize::from(*r)], linear[usize::from(*g)], linear[usize::from(*b)], u16::MAX]
            });
            attributes["COLOR_0"] = accessors.len().into();
            accessors.push(json!({
                "bufferView": parts.push(channels.flat_map(u16::to_le_bytes), ARRAY_BUFFER),
                "componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4", "count": n_points,
            }));
        }
        let document = json!({
            "asset": { "version": "2.0", "generator": concat!("videofields ", env!("CARGO_PKG_VERSION")) },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{
                "mesh": 0,
                // A quarter turn about x: (x, y, z) to (x, z, -y). What it is moved by is in glTF's axes.
                "rotation": [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2],
                "translation": [origin.x, origin.z, -origin.y],
            }],
            "meshes": [{ "primitives": [{ "attributes": attributes, "indices": 2, "material": 0 }] }],
            "materials": [{ "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 } }],
            "accessors": accessors,
            "bufferViews": parts.views,
            "buffers": [{ "byteLength": parts.bytes.len() }],
        });
        let glb = Glb {
            // The library writes its own.
            header: GlbHeader { magic: *b"glTF", version: 2, length: 0 },
            json: serde_json::to_vec(&document)?.into(),
            bin: Some(parts.bytes.into()),
        };
        let mut to = BufWriter::new(to);
        glb.to_writer(&mut to).map_err(|error| match error {
            gltf::Error::Io(error) => error,
            other => io::Error::other(other),
        })?;
        to.flush()
    }
}

/// What glTF calls its kinds of numbers and buffers.
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const INDEX_BUFFER: u32 = 34963;

/// A GLB's one buffer, and its views.
#[derive(Default)]
struct GlbParts {
    bytes: Vec<u8>,
    views: Vec<serde_json::Value>,
}

impl GlbParts {
    /// Appends bytes and gives the index of their view. All parts here are of whole words, so each begins at one.
    fn push(&mut self, bytes: impl Iterator<Item = u8>, target: u32) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        self.views.push(json!({
            "buffer": 0, "byteOffset": offset, "byteLength": self.bytes.len() - offset, "target": target,
        }));
        self.views.len() - 1
    }
}

/// One element of a PLY file, as the library asks for it.
enum Element {
    Vertex { position: Vec3, normal: Vec3, color_srgb: [u8; 3] },
    Face([i32; 3]),
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::Face([0; 3])
    }

    fn get_float(&self, name: &str) -> Option<f32> {
        let Self::Vertex { position, normal, .. } = self else { return None };
        match name {
            "x" => Some(position.x),
            "y" => Some(position.y),
            "z" => Some(position.z),
            "nx" => Some(normal.x),
            "ny" => Some(normal.y),
            "nz" => Some(normal.z),
            _ => None,
        }
    }

    fn get_uchar(&self, name: &str) -> Option<u8> {
        let Self::Vertex { color_srgb: [red, green, blue], .. } = self else { return None };
        match name {
            "red" => Some(*red),
            "green" => Some(*green),
            "blue" => Some(*blue),
            _ => None,
        }
    }

    fn get_list_int(&self, _: &str) -> Option<&[i32]> {
        let Self::Face(corners) = self else { return None };
        Some(corners)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{colored, cube};
    use super::*;
    use gltf::Gltf;
    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Property};

    #[test]
    fn ply_reads_back() {
        for mesh in [cube(DVec3::new(1.0, -2.0, 3.5)), colored(DVec3::ZERO)] {
            let mut bytes = Vec::new();
            mesh.write_ply(&mut bytes).unwrap();
            let ply = Parser::<DefaultElement>::new().read_ply(&mut bytes.as_slice()).unwrap();
            let (vertices, faces) = (&ply.payload["vertex"], &ply.payload["face"]);
            assert_eq!((vertices.len(), faces.len()), (8, 12));
            let float = |vertex: &DefaultElement, name: &str| match vertex[name] {
                Property::Float(value) => value,
                ref other => panic!("{name} is {other:?}"),
            };
            for (idx, vertex) in vertices.iter().enumerate() {
                let read = ["x", "y", "z"].map(|name| float(vertex, name));
                assert_eq!(read, mesh.positions_m[idx].as_vec3().to_array());
                assert_eq!(["nx", "ny", "nz"].map(|name| float(vertex, name)), mesh.normals[idx].to_array());
                let color = ["red", "green", "blue"].map(|name| vertex.get(name).cloned());
                let expected = mesh.colors_srgb.as_ref().map(|colors| colors[idx].map(Property::UChar));
                assert_eq!(color, expected.map_or([const { None }; 3], |color| color.map(Some)));
            }
            for (face, corners) in faces.iter().zip(&mesh.triangles) {
                assert_eq!(face["vertex_indices"], Property::ListInt(corners.map(u32::cast_signed).to_vec()));
            }
        }
    }

    /// Whole words of a GLB's accessor.
    fn read<const N: usize>(gltf: &Gltf, accessor: &gltf::Accessor<'_>) -> Vec<[u8; N]> {
        let view = accessor.view().unwrap();
        let bytes = &gltf.blob.as_ref().unwrap()[view.offset()..view.offset() + view.length()];
        assert_eq!(bytes.len(), accessor.count() * accessor.size());
        assert_eq!(view.offset() % 4, 0);
        bytes.as_chunks().0.to_vec()
    }

    #[test]
    fn glb_reads_back_upright_and_where_it_is() {
        for mesh in [cube(DVec3::new(1.0, -2.0, 3.5)), colored(DVec3::new(4_000_123.25, -77.0, 12.0))] {
            let mut bytes = Vec::new();
            mesh.write_glb(&mut bytes).unwrap();
            let gltf = Gltf::from_slice(&bytes).unwrap();
            let node = gltf.default_scene().unwrap().nodes().next().unwrap();
            let (moved, turned, _) = node.transform().decomposed();
            let (moved, turned) = (Vec3::from(moved), glam::Quat::from_array(turned));
            let primitive = node.mesh().unwrap().primitives().next().unwrap();

            let accessor = primitive.get(&gltf::Semantic::Positions).unwrap();
            let words: Vec<f32> = read(&gltf, &accessor).into_iter().map(f32::from_le_bytes).collect();
            let points: Vec<Vec3> = words.as_chunks::<3>().0.iter().map(|at| Vec3::from(*at)).collect();
            let (low, high) =
                points.iter().fold((points[0], points[0]), |(low, high), at| (low.min(*at), high.max(*at)));
            assert_eq!(accessor.min().unwrap(), json!(low.to_array()));
            assert_eq!(accessor.max().unwrap(), json!(high.to_array()));
            for (at, truth) in points.iter().zip(&mesh.positions_m) {
                let found = (turned * *at).as_dvec3() + moved.as_dvec3();
                // East, up and south.
                assert!(found.distance(DVec3::new(truth.x, truth.z, -truth.y)) < 1e-6, "{found} for {truth}");
            }
            let accessor = primitive.indices().unwrap();
            let corners: Vec<u32> = read(&gltf, &accessor).into_iter().map(u32::from_le_bytes).collect();
            assert_eq!(corners.as_chunks::<3>().0, mesh.triangles.as_slice());
            let normals = primitive.get(&gltf::Semantic::Normals).unwrap();
            let words: Vec<f32> = read(&gltf, &normals).into_iter().map(f32::from_le_bytes).collect();
            assert!(words.iter().eq(mesh.normals.iter().flat_map(Vec3::as_ref)));

            let colors = primitive.get(&gltf::Semantic::Colors(0));
            assert_eq!(colors.is_some(), mesh.colors_srgb.is_some());
            let Some((accessor, truth)) = colors.zip(mesh.colors_srgb) else { continue };
            assert!(accessor.normalized());
            let words: Vec<u16> = read(&gltf, &accessor).into_iter().map(u16::from_le_bytes).collect();
            for (linear, srgb) in words.as_chunks::<4>().0.iter().zip(truth) {
                let code = |word: u16| {
                    (crate::frame::srgb_from_linear(f32::from(word) / 65535.0) * 255.0).round() as u8
                };
                assert_eq!([code(linear[0]), code(linear[1]), code(linear[2])], srgb);
                assert_eq!(linear[3], u16::MAX);
            }
        }
    }

    #[test]
    fn what_no_file_can_say_is_refused() {
        let check = |written: io::Result<()>, expected: io::ErrorKind| {
            assert_eq!(written.unwrap_err().kind(), expected);
        };
        let empty = Mesh::default();
        check(empty.write_glb(&mut Vec::new()), io::ErrorKind::InvalidInput);
        empty.write_ply(&mut Vec::new()).unwrap();
        let short = Mesh { normals: Vec::new(), ..cube(DVec3::ZERO) };
        check(short.write_ply(&mut Vec::new()), io::ErrorKind::InvalidInput);
        check(short.write_glb(&mut Vec::new()), io::ErrorKind::InvalidInput);
        let mut space = [0_u8; 64];
        check(cube(DVec3::ZERO).write_ply(&mut space.as_mut_slice()), io::ErrorKind::WriteZero);
        check(cube(DVec3::ZERO).write_glb(&mut space.as_mut_slice()), io::ErrorKind::WriteZero);
    }
}
