//! PLY, as text or binary of either order: faces of any number of corners, with their vertices' colours.

use super::{MAX_POINTS, Model, too_many};
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

pub(super) fn read(bytes: &[u8], most_triangles: usize) -> Result<Model, String> {
    let parser = Parser::<Element>::new();
    let mut reader = Reader::new(bytes);
    let header = parser.read_header(&mut reader).map_err(|error| format!("not a PLY file: {error}"))?;
    if header.elements.len() > MAX_ELEMENTS {
        return Err(format!("at most {MAX_ELEMENTS} elements are read, got {}", header.elements.len()));
    }
    for (name, element) in &header.elements {
        let most = if name == "vertex" { MAX_POINTS } else { most_triangles };
        if element.count > most && name != "face" {
            return Err(format!("element {name}: at most {most} are allowed, got {}", element.count));
        }
        if element.count > most {
            return Err(too_many(element.count, most_triangles));
        }
        // What takes no bytes is not bounded by the file's.
        if element.properties.is_empty() && element.count > 0 {
            return Err(format!("element {name}: {} of them without a property", element.count));
        }
    }
    let mut model = Model::default();
    let (mut colors, mut has_colors): (Vec<DVec3>, bool) = (Vec::new(), false);
    let mut faces = Vec::new();
    for (name, definition) in &header.elements {
        let elements = parser
            .read_payload_for_element(&mut reader, definition, &header)
            .map_err(|error| format!("element {name}: {error}"))?;
        match name.as_str() {
            "vertex" => {
                has_colors = elements.iter().any(|element| element.has_color);
                model.points = elements.iter().map(|element| element.point).collect();
                colors = elements.iter().map(|element| DVec3::from(element.color)).collect();
            }
            "face" => faces = elements,
            _ => {}
        }
    }
    let mut triangles_srgb = Vec::new();
    for (idx, face) in faces.iter().enumerate() {
        if !face.is_sound {
            return Err(format!("face {idx}: expected at most {MAX_CORNERS} indices of vertices"));
        }
        if let Some(corner) = face.corners.iter().find(|corner| **corner as usize >= model.points.len()) {
            return Err(format!("face {idx} names vertex {corner}, but there are {}", model.points.len()));
        }
        let [first, rest @ ..] = face.corners.as_slice() else { continue };
        for pair in rest.windows(2) {
            let triangle = [*first, pair[0], pair[1]];
            model.triangles.push(triangle);
            let mean = triangle.map(|corner| colors[corner as usize]).into_iter().sum::<DVec3>() / 3.0;
            triangles_srgb.push(mean.to_array().map(|code| code.round() as u8));
        }
        if model.triangles.len() > most_triangles {
            return Err(too_many(model.triangles.len(), most_triangles));
        }
    }
    model.triangles_srgb = has_colors.then_some(triangles_srgb);
    model.let_go_of_stray_points();
    Ok(model)
}
