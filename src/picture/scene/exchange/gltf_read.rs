//! glTF 2.0 -> a scene document: cameras, and what says in its extras what it is. Numbers are read as they stand in the file, in
//! double precision (the `gltf` crate has single).

use super::axes::Placed;
use super::gltf_check::{self, MAX_ELEMENTS};
use super::gltf_kinds::{KINDS, element};
use super::{MAX_EXCHANGE_BYTES, Taken, Warnings, list};
use crate::scene::{SceneError, json};
use glam::{DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use videofields_vision::error::{Gatherer, pointer_to};

/// Rows of a camera's picture where nothing tells them: glTF knows no pixels.
const ASSUMED_ROWS: u32 = 1080;

/// How far a camera's angle may be from what its extras come to, radians: beyond, somebody has changed it.
const SAME_ANGLE_RAD: f64 = 1e-6;

/// Where the scene's own extras stand.
const OWN: &str = "/extras/videofields";

/// A node's place in its parent.
#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    camera: Option<usize>,
    #[serde(default)]
    mesh: Option<usize>,
    #[serde(default)]
    children: Vec<usize>,
    #[serde(default)]
    matrix: Option<[f64; 16]>,
    #[serde(default)]
    translation: Option<[f64; 3]>,
    #[serde(default)]
    rotation: Option<[f64; 4]>,
    #[serde(default)]
    scale: Option<[f64; 3]>,
    #[serde(default)]
    extras: Option<Value>,
}

/// Reads a file; `binary` is a GLB's own buffer.
pub(super) fn take(text: &str, binary: Option<&[u8]>) -> Result<Taken, SceneError> {
    gltf_check::check_values(text)?;
    let mut gatherer = Gatherer::default();
    let gltf = json::tree_within(text, MAX_EXCHANGE_BYTES, &mut gatherer)?;
    gltf_check::check(&gltf, binary.map(<[u8]>::len), &mut gatherer);
    let mut taking = Taking {
        gltf: &gltf,
        gatherer,
        warnings: Warnings::default(),
        origins: Vec::new(),
        made: Map::new(),
    };
    if taking.gatherer.faults().is_empty() {
        taking.scene();
    }
    let Taking { gatherer, warnings, origins, made, .. } = taking;
    if !gatherer.faults().is_empty() {
        return Err(SceneError::Faults(gatherer.into_faults()));
    }
    let document = Value::Object(made).to_string();
    Ok(Taken { document, warnings: warnings.0, origins, rest: "/scenes/0/extras/videofields" })
}

struct Taking<'a> {
    gltf: &'a Value,
    gatherer: Gatherer,
    warnings: Warnings,
    origins: Vec<(String, String)>,
    made: Map<String, Value>,
}

impl Taking<'_> {
    fn scene(&mut self) {
        let scenes = list(self.gltf, "scenes");
        let idx = self.gltf.get("scene").map_or(Some(0), Value::as_u64);
        let Some((idx, scene)) = idx.and_then(|idx| Some((idx, scenes.get(usize::try_from(idx).ok()?)?)))
        else {
            return self.gatherer.fault("/scene", format!("expected one of the {} scenes", scenes.len()));
        };
        let at = format!("/scenes/{idx}");
        let own = scene.pointer(OWN);
        if let Some(own) = own {
            let Some(own) = own.as_object() else {
                return self.gatherer.fault(format!("{at}{OWN}"), "expected an object");
            };
            self.made = own.clone();
        }
        self.made.entry("version").or_insert(json!(1));
        if let Some(name) = scene.get("name").filter(|_| !self.made.contains_key("name")) {
            self.made.insert("name".to_owned(), name.clone());
        }
        for (_, key) in KINDS {
            if self.made.remove(key).is_some() {
                self.warnings
                    .add(format!("{at}{OWN}/{key}"), "left out: what stands in a scene are its nodes");
            }
        }
        let roots: Vec<usize> = self
            .gatherer
            .read(scene.get("nodes").cloned().unwrap_or(json!([])), &format!("{at}/nodes"))
            .unwrap_or_default();
        self.nodes(roots);
    }

    /// Walks through all nodes from `roots` on, in their order, each once.
    fn nodes(&mut self, roots: Vec<usize>) {
        let nodes = list(self.gltf, "nodes");
        if nodes.len() > MAX_ELEMENTS {
            let message = format!("at most {MAX_ELEMENTS} are allowed, got {}", nodes.len());
            return self.gatherer.fault("/nodes", message);
        }
        let mut is_met = vec![false; nodes.len()];
        let mut waiting: Vec<(usize, DMat4)> =
            roots.into_iter().rev().map(|idx| (idx, DMat4::IDENTITY)).collect();
        while let Some((idx, parent)) = waiting.pop() {
            let place = format!("/nodes/{idx}");
            match is_met.get_mut(idx) {
                Some(is_met) if !*is_met => *is_met = true,
                Some(_) => return self.gatherer.fault(place, "is reached twice, or its own ancestor"),
                None => {
                    let message = format!("node {idx} is named, but there are {}", nodes.len());
                    return self.gatherer.fault("/nodes", message);
                }
            }
            let Some(node) = self.gatherer.read::<Node>(nodes[idx].clone(), &place) else { continue };
            let placed = match own_matrix(&node) {
                Ok(own) => parent * own,
                Err((key, reason)) => {
                    self.gatherer.fault(pointer_to(&place, key), reason);
                    continue;
                }
            };
            self.node(&node, placed, &place);
            // Whoever has too many faults is told of no more.
            if self.gatherer.faults().len() >= videofields_vision::error::MAX_FAULTS {
                return;
            }
            waiting.extend(node.children.iter().rev().map(|child| (*child, placed)));
        }
    }

    fn node(&mut self, node: &Node, matrix: DMat4, place: &str) {
        let own = node.extras.as_ref().and_then(|extras| extras.get("videofields"));
        let kind = own.map(|own| own.get("kind").and_then(Value::as_str).unwrap_or_default());
        let known = kind.and_then(|kind| KINDS.iter().find(|(name, _)| *name == kind));
        let ((kind, key), mut extras, at) = match (known, own) {
            (Some(known), Some(Value::Object(own))) => (*known, own.clone(), format!("{place}{OWN}")),
            (None, Some(_)) => {
                let names = KINDS.map(|(name, _)| name).join(", ");
                return self.gatherer.fault(format!("{place}{OWN}/kind"), format!("expected one of {names}"));
            }
            (_, _) if node.camera.is_some() => (KINDS[0], Map::new(), place.to_owned()),
            (_, _) => {
                if node.mesh.is_some() {
                    let message =
                        "left out: nothing says what it is; a scene names models by their files (`models`)";
                    self.warnings.add(pointer_to(place, "mesh"), message);
                }
                return;
            }
        };
        extras.remove("kind");
        if kind == "camera" && self.camera(&mut extras, node, place).is_none() {
            return;
        }
        let made = Placed::of(matrix).and_then(|placed| element(kind, extras, &placed));
        let made = match made {
            Ok(made) => made,
            Err(reason) => return self.gatherer.fault(place, reason),
        };
        let all = self.made.entry(key).or_insert_with(|| json!([]));
        let Value::Array(all) = all else { return };
        let part = format!("/{key}/{}", all.len());
        all.push(made);
        if kind == "camera" {
            self.origins.push((format!("{part}/calibration"), at.clone()));
        }
        self.origins.push((part, at));
    }

    /// Completes what a camera's extras say by what its glTF camera says; nothing where that is at fault or no camera of ours.
    fn camera(&mut self, extras: &mut Map<String, Value>, node: &Node, place: &str) -> Option<()> {
        let cameras = list(self.gltf, "cameras");
        let Some(idx) = node.camera else {
            // What it is stands in its extras alone.
            return Some(());
        };
        let Some(camera) = cameras.get(idx) else {
            let message = format!("expected one of the {} cameras", cameras.len());
            self.gatherer.fault(pointer_to(place, "camera"), message);
            return None;
        };
        let at = format!("/cameras/{idx}");
        if camera.get("type").and_then(Value::as_str) != Some("perspective") {
            self.warnings.add(&at, "left out: only perspective cameras are read");
            return None;
        }
        let number = |key: &str| camera.pointer(&format!("/perspective/{key}")).and_then(Value::as_f64);
        let yfov = number("yfov").filter(|yfov| (1e-3..std::f64::consts::PI).contains(yfov));
        let Some(yfov) = yfov else {
            self.gatherer.fault(format!("{at}/perspective/yfov"), "expected 0.001 to less than pi, radians");
            return None;
        };
        let aspect = number("aspectRatio");
        if aspect.is_some_and(|aspect| !(1e-3..=1e3).contains(&aspect)) {
            self.gatherer.fault(format!("{at}/perspective/aspectRatio"), "expected 0.001 to 1000");
            return None;
        }
        if !extras.contains_key("id") {
            let name = node.name.as_deref().or_else(|| camera.get("name").and_then(Value::as_str));
            extras.insert("id".to_owned(), json!(name.unwrap_or_default()));
        }
        let size =
            |axis: usize| extras.get("image_size_px").and_then(|size| size.get(axis)).and_then(Value::as_f64);
        let focal =
            |axis: usize| extras.get("focal_px").and_then(|focal| focal.get(axis)).and_then(Value::as_f64);
        let told = size(0).zip(size(1)).zip(focal(0).zip(focal(1)));
        if let Some(((_, rows), (_, focal_y))) = told
            && ((0.5 * rows / focal_y).atan() * 2.0 - yfov).abs() <= SAME_ANGLE_RAD
        {
            return Some(());
        }
        if told.is_some() {
            let message = "differs from the focal length in the node's extras, and is taken in its place";
            self.warnings.add(format!("{at}/perspective/yfov"), message);
        }
        let (columns, rows) = size(0).zip(size(1)).unwrap_or_else(|| {
            let message =
                format!("the picture's size is not told (extras.videofields.image_size_px): taken for {ASSUMED_ROWS} rows");
            self.warnings.add(&at, message);
            let rows = f64::from(ASSUMED_ROWS);
            ((rows * aspect.unwrap_or(16.0 / 9.0)).round().clamp(1.0, 65_536.0), rows)
        });
        let aspect = aspect.unwrap_or(columns / rows.max(1.0));
        let half = (0.5 * yfov).tan();
        extras.insert("image_size_px".to_owned(), json!([columns as u64, rows as u64]));
        extras.insert("focal_px".to_owned(), json!([columns / (2.0 * aspect * half), rows / (2.0 * half)]));
        extras.entry("center_px").or_insert_with(|| json!([0.5 * columns, 0.5 * rows]));
        Some(())
    }
}

/// A node's own matrix; or which of its members is at fault, and why.
fn own_matrix(node: &Node) -> Result<DMat4, (&'static str, &'static str)> {
    if let Some(matrix) = &node.matrix {
        return Ok(DMat4::from_cols_array(matrix));
    }
    let rotation = DQuat::from_array(node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    if (rotation.length() - 1.0).abs() > 0.01 {
        return Err(("rotation", "expected a unit quaternion (length within 1 % of 1)"));
    }
    let scale = DVec3::from_array(node.scale.unwrap_or([1.0; 3]));
    let translation = DVec3::from_array(node.translation.unwrap_or_default());
    Ok(DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation))
}
