//! PLY, as text or binary of either order: faces of any number of corners, with their vertices' colours.
//!
//! Every count is held against a limit before room is made for what it counts.

use super::{MAX_POINTS, Mesh, ReadError};
use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};

/// Most corners of a face.
const MAX_CORNERS: usize = 256;

/// Most kinds of elements of a file.
const MAX_ELEMENTS: usize = 16;

/// One element of the file, of whatever kind.
struct Element {
    point: DVec3,
    /// 0 to 255.
    color: [f64; 3],
    has_color: bool,
    corners: Vec<u32>,
    is_sound: bool,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { point: DVec3::NAN, color: [0.0; 3], has_color: false, corners: Vec::new(), is_sound: true }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        match name {
            "vertex_indices" | "vertex_index" => self.set_corners(&property),
            "x" | "y" | "z" => self.point["xyz".find(name).unwrap_or(0)] = number(&property),
            "red" | "green" | "blue" => {
                let channel = ["red", "green", "blue"].iter().position(|color| *color == name).unwrap_or(0);
                // Floats go from 0 to 1.
                let is_share = matches!(property, Property::Float(_) | Property::Double(_));
                self.color[channel] = number(&property) * if is_share { 255.0 } else { 1.0 };
                self.has_color = true;
            }
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}
impl Element {
    fn set_corners(&mut self, property: &Property) {
        let signed =
            |values: &mut dyn Iterator<Item = i64>| values.map(|value| u32::try_from(value).ok()).collect();
        let corners: Option<Vec<u32>> = match property {
            Property::ListChar(list) => signed(&mut list.iter().map(|value| i64::from(*value))),
            Property::ListUChar(list) => signed(&mut list.iter().map(|value| i64::from(*value))),
            Property::ListShort(list) => signed(&mut list.iter().map(|value| i64::from(*value))),
            Property::ListUShort(list) => signed(&mut list.iter().map(|value| i64::from(*value))),
            Property::ListInt(list) => signed(&mut list.iter().map(|value| i64::from(*value))),
            Property::ListUInt(list) => signed(&mut list.iter().map(|value| i64::from(*value))),
            _ => None,
        };
        self.is_sound &= corners.as_ref().is_some_and(|corners| corners.len() <= MAX_CORNERS);
        self.corners = corners.unwrap_or_default();
        self.corners.truncate(MAX_CORNERS);
    }
}

/// A number of any type; NaN for a list.
fn number(property: &Property) -> f64 {
    match property {
        Property::Char(value) => f64::from(*value),
        Property::UChar(value) => f64::from(*value),
        Property::Short(value) => f64::from(*value),
        Property::UShort(value) => f64::from(*value),
        Property::Int(value) => f64::from(*value),
        Property::UInt(value) => f64::from(*value),
        Property::Float(value) => f64::from(*value),
        Property::Double(value) => *value,
        _ => f64::NAN,
    }
}

impl Mesh {
    /// Reads a PLY file of at most `most_triangles`; colours where its vertices have any. Vertices stay as they are in the file, also
    /// those that no face names, and triangles without an area; faces of more corners become fans.
    ///
    /// # Errors
    /// What is wrong with it, or what it has too much of.
    pub fn read_ply(bytes: &[u8], most_triangles: usize) -> Result<Self, ReadError> {
        let parser = Parser::<Element>::new();
        let mut reader = Reader::new(bytes);
        let header = parser.read_header(&mut reader).map_err(|error| format!("not a PLY file: {error}"))?;
        if header.elements.len() > MAX_ELEMENTS {
            return Err(
                format!("at most {MAX_ELEMENTS} elements are read, got {}", header.elements.len()).into()
            );
        }
        for (name, element) in &header.elements {
            let most = if name == "vertex" { MAX_POINTS } else { most_triangles };
            if element.count > most && name != "face" {
                return Err(
                    format!("element {name}: at most {most} are allowed, got {}", element.count).into()
                );
            }
            if element.count > most {
                return Err(ReadError::Triangles { count: element.count, most: most_triangles });
            }
            // What takes no bytes is not bounded by the file's.
            if element.properties.is_empty() && element.count > 0 {
                return Err(format!("element {name}: {} of them without a property", element.count).into());
            }
        }
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for (name, definition) in &header.elements {
            let elements = parser
                .read_payload_for_element(&mut reader, definition, &header)
                .map_err(|error| format!("element {name}: {error}"))?;
            match name.as_str() {
                "vertex" => vertices = elements,
                "face" => faces = elements,
                _ => {}
            }
        }
        let mut triangles = Vec::with_capacity(faces.len());
        for (idx, face) in faces.iter().enumerate() {
            if !face.is_sound {
                return Err(format!("face {idx}: expected at most {MAX_CORNERS} indices of vertices").into());
            }
            if let Some(corner) = face.corners.iter().find(|corner| **corner as usize >= vertices.len()) {
                return Err(
                    format!("face {idx} names vertex {corner}, but there are {}", vertices.len()).into()
                );
            }
            let [first, rest @ ..] = face.corners.as_slice() else { continue };
            triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
            if triangles.len() > most_triangles {
                return Err(ReadError::Triangles { count: triangles.len(), most: most_triangles });
            }
        }
        let has_colors = vertices.iter().any(|vertex| vertex.has_color);
        // A NaN becomes 0.
        let code = |vertex: &Element| vertex.color.map(|code| code.round() as u8);
        let colors = has_colors.then(|| vertices.iter().map(code).collect());
        let mut mesh = Self::new(vertices.iter().map(|vertex| vertex.point).collect(), triangles);
        mesh.colors_srgb = colors;
        Ok(mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{colored, cube};
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        for mesh in [cube(DVec3::new(1.0, -2.0, 3.5)), colored(DVec3::ZERO)] {
            let mut bytes = Vec::new();
            mesh.write_ply(&mut bytes).unwrap();
            assert_eq!(Mesh::read_ply(&bytes, 12).unwrap(), mesh);
            let error = Mesh::read_ply(&bytes, 11).unwrap_err();
            assert_eq!(error, ReadError::Triangles { count: 12, most: 11 });
            for length in 0..bytes.len() {
                assert!(Mesh::read_ply(&bytes[..length], 12).is_err(), "{length} bytes of {}", bytes.len());
            }
        }
    }

    #[test]
    fn text_with_polygons_is_read() {
        let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\n\
            element face 2\nproperty list uchar uint vertex_index\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4000000.125 0 0\n\
            4 0 1 2 3\n2 0 1\n";
        let mesh = Mesh::read_ply(text.as_bytes(), 10).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(mesh.positions_m[4].x, 4_000_000.125);
        let error = Mesh::read_ply(text.replace("4 0 1 2 3", "4 0 1 2 7").as_bytes(), 10).unwrap_err();
        assert_eq!(error.to_string(), "face 0 names vertex 7, but there are 5");
    }
}
