//! glTF 2.0, as JSON with buffers beside it or as one GLB: triangles of all nodes of the scene, each in its place, with
//! their materials' base colours and pictures and their vertices' colours.

use super::accessor::Elements;
use super::gltf_picture::{Covering, ShownPicture, image_bytes, wraps_of};
use super::{MAX_MODEL_BYTES, MAX_POINTS, Model, too_many};
use crate::scene::Imports;
use crate::scene::paint::MappedTriangle;
use crate::scene::texture::Files;
use base64::Engine;
use glam::{DMat4, DVec3, Mat4};
use gltf::buffer::Source;
use gltf::mesh::Mode;
use gltf::{Document, Gltf, Mesh, Node, Primitive, Semantic};
use percent_encoding::percent_decode_str;
use std::collections::HashMap;
use std::path::Path;
use videofields_vision::frame::srgb_from_linear;

/// Most bytes of the JSON: its tree takes several times as much.
const MAX_JSON_BYTES: usize = 16 << 20;
/// Most nodes that are walked through, each as often as it is reached.
const MAX_NODES: usize = 1 << 16;
/// Most primitives of meshes that are looked at, each as often as a node shows it.
const MAX_PRIMITIVES: usize = 1 << 16;
/// Most pictures of a file that are shown.
const MAX_PICTURES: usize = 4096;
/// Length of a GLB's header and of a chunk's.
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;

pub(super) fn read(
    bytes: &[u8],
    file: &str,
    most_triangles: usize,
    files: &mut Files<'_>,
) -> Result<Model, String> {
    check_lengths(bytes)?;
    let gltf = parsed(bytes)?;
    let buffers = buffers(&gltf, file, files.imports())?;
    let mut reading = Reading {
        document: &gltf.document,
        file,
        files,
        pictures: Vec::new(),
        buffers,
        most_triangles,
        n_primitives: 0,
        model: Model { is_y_up: true, triangles_srgb: Some(Vec::new()), ..Model::default() },
    };
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let Some(scene) = scene else { return Err("/scenes: there is none".to_owned()) };
    // Every node that is reached, as often as it is; one that is its own ancestor is met here as well.
    let mut n_nodes = 0;
    let mut reach = |n_more: usize| {
        n_nodes += n_more;
        let message = || format!("/nodes: more than {MAX_NODES} are reached, or one is its own ancestor");
        if n_nodes <= MAX_NODES { Ok(()) } else { Err(message()) }
    };
    reach(scene.nodes().len())?;
    let mut waiting: Vec<(Node<'_>, DMat4)> = scene.nodes().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((node, parent)) = waiting.pop() {
        reach(node.children().len())?;
        let placed = parent * Mat4::from_cols_array_2d(&node.transform().matrix()).as_dmat4();
        if let Some(mesh) = node.mesh() {
            reading.mesh(&mesh, placed)?;
        }
        waiting.extend(node.children().map(|child| (child, placed)));
    }
    if reading.model.pictures.is_empty() {
        reading.model.mapped = Vec::new();
    }
    Ok(reading.model)
}

/// The document, valid as far as the library checks it. Its check looks primitives' positions up by their numbers as they
/// stand there, so these are checked before.
fn parsed(bytes: &[u8]) -> Result<Gltf, String> {
    let said = |error: gltf::Error| format!("not glTF 2.0: {error}");
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(said)?;
    let json = document.into_json();
    let n_accessors = json.accessors.len();
    for (mesh_idx, mesh) in json.meshes.iter().enumerate() {
        for (idx, primitive) in mesh.primitives.iter().enumerate() {
            if let Some(stray) = primitive.attributes.values().find(|stray| stray.value() >= n_accessors) {
                return Err(format!(
                    "/meshes/{mesh_idx}/primitives/{idx}/attributes: names accessor {} of {n_accessors}",
                    stray.value()
                ));
            }
        }
    }
    Ok(Gltf { document: Document::from_json(json).map_err(said)?, blob })
}

/// What the library takes on trust: that a GLB's header counts itself, and how long the JSON is.
fn check_lengths(bytes: &[u8]) -> Result<(), String> {
    let number =
        |at: usize| bytes.get(at..at + 4).and_then(|four| four.try_into().ok()).map(u32::from_le_bytes);
    let mut n_json = bytes.len();
    if bytes.starts_with(b"glTF") {
        let (Some(length), Some(json)) = (number(8), number(HEADER_BYTES)) else {
            return Err("the GLB ends within its header".to_owned());
        };
        let length = length as usize;
        if !(HEADER_BYTES + CHUNK_HEADER_BYTES..=bytes.len()).contains(&length) {
            return Err(format!("the GLB says that it has {length} bytes, but it has {}", bytes.len()));
        }
        n_json = json as usize;
    }
    if n_json > MAX_JSON_BYTES {
        return Err(format!("the JSON may have at most {MAX_JSON_BYTES} bytes, got {n_json}"));
    }
    Ok(())
}

fn buffers(gltf: &Gltf, file: &str, imports: &mut dyn Imports) -> Result<Vec<Vec<u8>>, String> {
    let mut all = Vec::new();
    let mut n_bytes = 0;
    for buffer in gltf.buffers() {
        let place = format!("/buffers/{}", buffer.index());
        let bytes = match buffer.source() {
            Source::Bin => {
                gltf.blob.clone().ok_or_else(|| format!("{place}: the GLB has no binary chunk"))?
            }
            Source::Uri(uri) => {
                linked(uri, file, imports).map_err(|reason| format!("{place}/uri: {reason}"))?
            }
        };
        n_bytes += bytes.len();
        if n_bytes > MAX_MODEL_BYTES {
            return Err(format!("/buffers: at most {MAX_MODEL_BYTES} bytes are allowed in all together"));
        }
        all.push(bytes);
    }
    Ok(all)
}

/// The bytes that a URI leads to: in the URI itself, or in a file beside the model's.
fn linked(uri: &str, file: &str, imports: &mut dyn Imports) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let Some((_, text)) = data.split_once(";base64,") else {
            return Err("only base64 is read".to_owned());
        };
        if text.len() / 4 * 3 > MAX_MODEL_BYTES {
            return Err(format!("at most {MAX_MODEL_BYTES} bytes are allowed"));
        }
        return base64::engine::general_purpose::STANDARD.decode(text).map_err(|error| error.to_string());
    }
    let path = percent_decode_str(uri).decode_utf8().map_err(|_utf8| "not UTF-8".to_owned())?;
    if path.split('/').next().unwrap_or_default().contains(':') {
        return Err("only files beside the model are read".to_owned());
    }
    let beside = Path::new(file).parent().unwrap_or(Path::new("")).join(&*path);
    imports.file(&beside.to_string_lossy(), MAX_MODEL_BYTES)
}

struct Reading<'a, 'f> {
    document: &'a Document,
    /// The model's own file.
    file: &'a str,
    files: &'a mut Files<'f>,
    /// Which of the document's textures which of the model's pictures is.
    pictures: Vec<(usize, u16)>,
    buffers: Vec<Vec<u8>>,
    most_triangles: usize,
    /// Primitives that were looked at, each as often as it is reached.
    n_primitives: usize,
    model: Model,
}

impl Reading<'_, '_> {
    /// The picture that a primitive's material names, read when it is first met.
    fn picture(&mut self, primitive: &Primitive<'_>) -> Result<Option<ShownPicture>, String> {
        let material = primitive.material();
        let Some(info) = material.pbr_metallic_roughness().base_color_texture() else { return Ok(None) };
        let (texture, set) = (info.texture(), info.tex_coord());
        if primitive.get(&Semantic::TexCoords(set)).is_none() {
            // Where it lies is not said.
            return Ok(None);
        }
        let wraps = wraps_of(&texture);
        let known = self.pictures.iter().find(|(known, _)| *known == texture.index());
        if let Some((_, place)) = known {
            return Ok(Some(ShownPicture { place: *place, wraps, set }));
        }
        if self.pictures.len() >= MAX_PICTURES {
            return Err(format!("/textures: at most {MAX_PICTURES} are read"));
        }
        let image = self.document.as_json().textures[texture.index()].source.value();
        let at = |reason: String| format!("/images/{image}: {reason}");
        let bytes = image_bytes(self.document, image, &self.buffers, |uri| {
            linked(uri, self.file, self.files.imports())
        })
        .map_err(at)?;
        // Alpha is for materials that are blended; these are opaque.
        let picture = self.files.decoded(&bytes, wraps).map_err(at)?;
        let place = self.model.pictures.len() as u16;
        self.model.pictures.push(picture);
        self.pictures.push((texture.index(), place));
        Ok(Some(ShownPicture { place, wraps, set }))
    }

    /// Adds the triangles of a mesh, moved to where its node stands.
    fn mesh(&mut self, mesh: &Mesh<'_>, placed: DMat4) -> Result<(), String> {
        for primitive in mesh.primitives() {
            let within = |reason: String| {
                if reason.starts_with('/') {
                    return reason;
                }
                format!("/meshes/{}/primitives/{}: {reason}", mesh.index(), primitive.index())
            };
            self.n_primitives += 1;
            if self.n_primitives > MAX_PRIMITIVES {
                return Err(format!("/meshes: more than {MAX_PRIMITIVES} primitives are reached"));
            }
            self.primitive(&primitive, placed).map_err(within)?;
        }
        Ok(())
    }

    /// Adds a primitive's triangles, moved to where its node stands.
    fn primitive(&mut self, primitive: &Primitive<'_>, placed: DMat4) -> Result<(), String> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let Some(positions) = primitive.get(&Semantic::Positions) else { return Ok(()) };
        let picture = self.picture(primitive)?;
        let place = format!("/accessors/{}", positions.index());
        let positions = Elements::new(&positions, &self.buffers, MAX_POINTS)?;
        if positions.width != 3 || !positions.is_float() {
            return Err(format!("{place}: positions are three floats each"));
        }
        let colors = primitive.get(&Semantic::Colors(0));
        let colors =
            colors.map(|accessor| Elements::new(&accessor, &self.buffers, MAX_POINTS)).transpose()?;
        let covering =
            picture.map(|picture| Covering::new(picture, primitive, &self.buffers)).transpose()?.flatten();
        let indices = primitive.indices();
        let most = 3 * self.most_triangles + 2;
        let indices = indices.map(|accessor| Elements::new(&accessor, &self.buffers, most)).transpose()?;
        let n_corners = indices.as_ref().map_or(positions.len(), Elements::len);
        let n_triangles = match mode {
            Mode::Triangles => n_corners / 3,
            _ => n_corners.saturating_sub(2),
        };
        let known = self.model.triangles.len();
        if known + n_triangles > self.most_triangles {
            return Err(too_many(known + n_triangles, self.most_triangles));
        }

        let factor = primitive.material().pbr_metallic_roughness().base_color_factor();
        let factor = DVec3::new(factor[0].into(), factor[1].into(), factor[2].into());
        let color_of = |corners: [u32; 3]| {
            let Some(colors) = &colors else { return factor };
            let corner =
                |idx: u32| DVec3::from([0, 1, 2].map(|channel| colors.number(idx as usize, channel)));
            factor * corners.map(corner).into_iter().sum::<DVec3>() / 3.0
        };
        // Points that triangles name, each once: primitives often share one large accessor.
        let mut kept: HashMap<u32, u32> = HashMap::new();
        // What mirrors turns triangles round.
        let is_mirrored = placed.determinant() < 0.0;
        let corner = |at: usize| indices.as_ref().map_or(at as u32, |indices| indices.number(at, 0) as u32);
        for idx in 0..n_triangles {
            let [a, mut b, mut c] = match mode {
                Mode::Triangles => [3 * idx, 3 * idx + 1, 3 * idx + 2],
                Mode::TriangleFan => [0, idx + 1, idx + 2],
                _ if idx.is_multiple_of(2) => [idx, idx + 1, idx + 2],
                _ => [idx + 1, idx, idx + 2],
            }
            .map(corner);
            if [a, b, c].into_iter().any(|corner| corner as usize >= positions.len()) {
                return Err(format!(
                    "triangle {idx} names a vertex beyond the {} there are",
                    positions.len()
                ));
            }
            if is_mirrored {
                std::mem::swap(&mut b, &mut c);
            }
            let points = &mut self.model.points;
            let mut kept_at = |corner: u32| {
                *kept.entry(corner).or_insert_with(|| {
                    let point = [0, 1, 2].map(|axis| positions.number(corner as usize, axis));
                    points.push(placed.transform_point3(DVec3::from(point)));
                    points.len() as u32 - 1
                })
            };
            self.model.triangles.push([a, b, c].map(&mut kept_at));
            let plain = MappedTriangle { picture: None, corners: [[0.0; 2]; 3] };
            let mapped = covering.as_ref().map_or(Ok(plain), |covering| covering.triangle([a, b, c]));
            self.model.mapped.push(mapped.map_err(|reason| format!("triangle {idx}: {reason}"))?);
            let color = srgb_codes(color_of([a, b, c]));
            self.model.triangles_srgb.get_or_insert_default().push(color);
        }
        Ok(())
    }
}

/// 8-bit sRGB of linear light.
fn srgb_codes(linear: DVec3) -> [u8; 3] {
    // A NaN becomes 0.
    linear.to_array().map(|light| (srgb_from_linear(light.clamp(0.0, 1.0) as f32) * 255.0).round() as u8)
}
