//! A scene as glTF 2.0: cameras and all that stands as nodes, surfaces with their triangles in plain colours.

use super::gltf_kinds::{KINDS, NodeParts, parts};
use super::{Warnings, Written, list};
use crate::scene::Scene;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::{DQuat, DVec3, Vec3};
use serde_json::{Map, Value, json};
use std::collections::HashMap;
use videofields_vision::frame::linear_from_srgb;
use videofields_vision::geometry::{Shape, SurfaceId};

/// glTF's numbers for 32-bit floats, whole numbers, and what buffers are of.
const FLOAT: u32 = 5126;
const WHOLE: u32 = 5125;
const ARRAY: u32 = 34_962;
const INDICES: u32 = 34_963;

/// How the file is put together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Container {
    Json,
    Binary,
}

#[derive(Default)]
struct Writing {
    nodes: Vec<Value>,
    cameras: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    /// Which material a colour is.
    colors: HashMap<[u8; 3], usize>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    buffer: Vec<u8>,
    warnings: Warnings,
}

/// Writes `scene`, whose document is `document`.
pub(super) fn write(scene: &Scene, mut document: Value, container: Container) -> Written {
    let mut writing = Writing::default();
    for (kind, key) in KINDS {
        for (idx, of) in list(&document, key).iter().enumerate() {
            writing.node(scene, (kind, key, idx), of);
        }
    }
    // What is of the scene as a whole.
    if let Value::Object(members) = &mut document {
        for (_, key) in KINDS {
            members.remove(key);
        }
    }
    let mut gltf = json!({
        "asset": { "version": "2.0", "generator": concat!("videofields ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [{
            "name": scene.name,
            "nodes": (0..writing.nodes.len()).collect::<Vec<_>>(),
            "extras": { "videofields": document },
        }],
    });
    let Writing { nodes, cameras, meshes, materials, accessors, views, buffer, warnings, .. } = writing;
    if !warnings.0.is_empty() {
        let told = warnings.0.iter().map(|of| json!({ "pointer": of.place, "detail": of.message }));
        gltf["asset"]["extras"] = json!({ "warnings": told.collect::<Vec<_>>() });
    }
    let lists = [
        ("nodes", nodes),
        ("cameras", cameras),
        ("meshes", meshes),
        ("materials", materials),
        ("accessors", accessors),
        ("bufferViews", views),
    ];
    // Empty lists are not allowed.
    for (key, of) in lists.into_iter().filter(|(_, of)| !of.is_empty()) {
        gltf[key] = of.into();
    }
    let bytes = match container {
        Container::Json => {
            if !buffer.is_empty() {
                let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&buffer));
                gltf["buffers"] = json!([{ "byteLength": buffer.len(), "uri": uri }]);
            }
            serde_json::to_vec(&gltf).unwrap_or_default()
        }
        Container::Binary => {
            if !buffer.is_empty() {
                gltf["buffers"] = json!([{ "byteLength": buffer.len() }]);
            }
            binary(&serde_json::to_vec(&gltf).unwrap_or_default(), &buffer)
        }
    };
    Written { bytes, warnings: warnings.0 }
}

/// A GLB of both chunks.
fn binary(json: &[u8], buffer: &[u8]) -> Vec<u8> {
    let mut chunks = Vec::new();
    for (kind, data, fill) in [(b"JSON", json, b' '), (b"BIN\0", buffer, 0)] {
        if data.is_empty() {
            continue;
        }
        let length = data.len().next_multiple_of(4);
        chunks.extend((length as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(data);
        chunks.resize(chunks.len() + length - data.len(), fill);
    }
    let mut file = Vec::with_capacity(12 + chunks.len());
    file.extend(b"glTF");
    file.extend(2_u32.to_le_bytes());
    file.extend((12 + chunks.len() as u32).to_le_bytes());
    file.extend(chunks);
    file
}

impl Writing {
    /// Adds what stands at `idx` in the document's list `key`.
    fn node(&mut self, scene: &Scene, (kind, key, idx): (&str, &str, usize), of: &Value) {
        let NodeParts { translation, rotation, extras } = parts(kind, of);
        let mut node = Map::new();
        let id = of.get("id").and_then(Value::as_str).map_or_else(|| format!("{kind}-{idx}"), str::to_owned);
        match kind {
            "camera" => {
                node.insert("camera".to_owned(), json!(self.cameras.len()));
                self.cameras.push(camera(&id, &of["calibration"]));
            }
            "model" => self.warnings.add(
                format!("/{key}/{idx}"),
                "its triangles stay in its own file, which is named in the node's extras",
            ),
            _ => {
                let shape = surface(kind, idx).and_then(|surface| {
                    Some((scene.surfaces.shape(surface)?, scene.material(surface)?.color_srgb))
                });
                if let Some(mesh) = shape.and_then(|(shape, color)| {
                    let material = self.material(color);
                    self.mesh(&id, shape, (translation, rotation), material)
                }) {
                    node.insert("mesh".to_owned(), json!(mesh));
                }
            }
        }
        node.insert("name".to_owned(), json!(id));
        node.insert("translation".to_owned(), json!(translation.to_array()));
        if rotation != DQuat::IDENTITY {
            node.insert("rotation".to_owned(), json!(rotation.to_array()));
        }
        node.insert("extras".to_owned(), json!({ "videofields": extras }));
        self.nodes.push(Value::Object(node));
    }

    fn material(&mut self, color: [u8; 3]) -> usize {
        if let Some(known) = self.colors.get(&color) {
            return *known;
        }
        let linear = color.map(|code| linear_from_srgb(f32::from(code) / 255.0));
        self.materials.push(json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [linear[0], linear[1], linear[2], 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
        }));
        self.colors.insert(color, self.materials.len() - 1);
        self.materials.len() - 1
    }

    /// Adds a shape's triangles in its node's axes, each corner once; none of a shape without any.
    fn mesh(
        &mut self,
        id: &str,
        shape: &Shape,
        (translation, rotation): (DVec3, DQuat),
        material: usize,
    ) -> Option<usize> {
        let (mut points, mut indices) = (Vec::<Vec3>::new(), Vec::<u32>::new());
        let mut known = HashMap::new();
        let to_node = rotation.inverse();
        shape.triangles(&mut |triangle| {
            for corner in triangle.corners {
                let point = (to_node * (super::axes::y_up(corner) - translation)).as_vec3();
                let next = points.len() as u32;
                let place = *known.entry(point.to_array().map(f32::to_bits)).or_insert(next);
                if place == next {
                    points.push(point);
                }
                indices.push(place);
            }
        });
        let (first, rest) = points.split_first()?;
        let low = rest.iter().fold(*first, |low, point| low.min(*point));
        let high = rest.iter().fold(*first, |high, point| high.max(*point));
        let positions = points.iter().flat_map(|point| point.to_array()).flat_map(f32::to_le_bytes);
        let positions = self.view(positions.collect(), ARRAY);
        let n_indices = indices.len();
        let indices = self.view(indices.into_iter().flat_map(u32::to_le_bytes).collect(), INDICES);
        let first = self.accessors.len();
        self.accessors.push(json!({
            "bufferView": positions, "componentType": FLOAT, "type": "VEC3", "count": points.len(),
            "min": low.to_array(), "max": high.to_array(),
        }));
        self.accessors.push(json!({
            "bufferView": indices, "componentType": WHOLE, "type": "SCALAR", "count": n_indices,
        }));
        self.meshes.push(json!({
            "name": id,
            "primitives": [{ "attributes": { "POSITION": first }, "indices": first + 1, "material": material }],
        }));
        Some(self.meshes.len() - 1)
    }

    fn view(&mut self, bytes: Vec<u8>, target: u32) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len(), "target": target,
        }));
        self.buffer.extend(bytes);
        self.views.len() - 1
    }
}

/// Which surface of the scene it is.
fn surface(kind: &str, idx: usize) -> Option<SurfaceId> {
    let idx = u16::try_from(idx).ok()?;
    Some(match kind {
        "ground" => SurfaceId::Ground(idx),
        "box" => SurfaceId::Box(idx),
        "cylinder" => SurfaceId::Cylinder(idx),
        "footprint" => SurfaceId::Footprint(idx),
        "height_field" => SurfaceId::HeightField(idx),
        _ => return None,
    })
}

/// A pinhole with the camera's angle upwards; what it is exactly stands in its node's extras.
fn camera(id: &str, calibration: &Value) -> Value {
    let number = |pointer: &str| calibration.pointer(pointer).and_then(Value::as_f64).unwrap_or(1.0);
    let [across, up] = [0, 1]
        .map(|axis| 0.5 * number(&format!("/image_size_px/{axis}")) / number(&format!("/focal_px/{axis}")));
    json!({
        "name": id,
        "type": "perspective",
        "perspective": { "yfov": 2.0 * up.atan(), "aspectRatio": across / up, "znear": 0.01 },
    })
}
