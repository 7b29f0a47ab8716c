//! The paper's JSON \[DBV16\]: cameras as world matrices with their fields of view, ground and buildings as primitives with
//! world matrices, as three.js has them.
//!
//! Matrices are three.js's: sixteen numbers, column by column, from an object's own axes to the world's (y up, metres). A camera
//! looks along its -z with its y up; `fov` is its vertical field of view in degrees, `aspect` the ratio of the tangents of half its
//! angles across and up. Ground is a polygon in its object's plane y = 0; a box is the unit cube around its object's origin, a
//! cylinder has radius and height 1 around it, a `prism` is a polygon in y = 0 drawn up to `height`.

use super::axes::{Placed, camera_rotation, node_rotation, turn, y_up, z_up};
use super::{Taken, Warnings, list};
use crate::scene::SceneError;
use crate::scene::json;
use glam::{DMat4, DQuat, DVec3};
use serde::Deserialize;
use serde_json::{Map, Value, json};
use videofields_vision::error::{Gatherer, pointer_to};

/// What the format calls itself.
const FORMAT: &str = "video-fields";

/// Rows of a camera's picture where neither its width nor its height is told.
const ASSUMED_ROWS: u32 = 1080;

/// Most elements of a list: what a scene may have, or that a reader of scenes says so.
const MAX_ELEMENTS: usize = 1 << 16;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PaperCamera {
    name: String,
    matrix_world: [f64; 16],
    fov: f64,
    #[serde(default)]
    aspect: Option<f64>,
    #[serde(default)]
    width: Option<u32>,
    #[serde(default)]
    height: Option<u32>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PaperGround {
    matrix_world: [f64; 16],
    polygon: Vec<[f64; 2]>,
    #[serde(default)]
    color: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct PaperBuilding {
    name: String,
    geometry: Geometry,
    matrix_world: [f64; 16],
    #[serde(default)]
    polygon: Vec<[f64; 2]>,
    #[serde(default)]
    height: f64,
    #[serde(default)]
    color: Option<Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Geometry {
    Box,
    Cylinder,
    Prism,
}

/// Writes a normalised document.
pub(super) fn write(document: &Value) -> super::Written {
    let mut warnings = Warnings::default();
    for (key, what) in [
        ("origin", "the place on the earth"),
        ("view", "the view shown at first"),
        ("height_fields", "uneven ground"),
        ("models", "models in files"),
        ("sequences", "recorded sequences"),
        ("effects", "effects"),
    ] {
        if document.get(key).is_some() {
            warnings.add(format!("/{key}"), format!("left out: the format has no word for {what}"));
        }
    }
    if document.pointer("/sky/color_srgb").is_none() {
        warnings.add("/sky", "left out: the format has one colour for the sky");
    }
    if document.pointer("/entities/min_size_m").and_then(Value::as_f64).is_some_and(|least| least > 0.0) {
        warnings.add("/entities/min_size_m", "left out: the format has no word for it");
    }
    let cameras: Vec<Value> = placed(document, "cameras").map(|of| camera(of, &mut warnings)).collect();
    let ground: Vec<Value> = placed(document, "ground").map(|of| ground(of, &mut warnings)).collect();
    let solids = ["boxes", "cylinders", "footprints"];
    let buildings: Vec<Value> = solids
        .into_iter()
        .flat_map(|kind| placed(document, kind).map(move |of| (kind, of)))
        .map(|(kind, of)| building(kind, of, &mut warnings))
        .collect();
    let told: Vec<Value> =
        warnings.0.iter().map(|of| json!({ "pointer": of.place, "detail": of.message })).collect();
    let file = json!({
        "format": FORMAT,
        "version": 1,
        "up": "y",
        "name": document["name"],
        "sky": document.pointer("/sky/color_srgb"),
        "cameras": cameras,
        "ground": ground,
        "buildings": buildings,
        "warnings": told,
    });
    super::Written { bytes: serde_json::to_vec_pretty(&file).unwrap_or_default(), warnings: warnings.0 }
}

/// The elements of a list with their places.
fn placed<'a>(document: &'a Value, key: &'a str) -> impl Iterator<Item = (&'a Value, String)> {
    list(document, key).iter().enumerate().map(move |(idx, of)| (of, format!("/{key}/{idx}")))
}

fn number(of: &Value, pointer: &str) -> f64 {
    of.pointer(pointer).and_then(Value::as_f64).unwrap_or_default()
}

fn numbers<const N: usize>(of: &Value, key: &str) -> [f64; N] {
    std::array::from_fn(|idx| number(of, &format!("/{key}/{idx}")))
}

fn matrix(scale: DVec3, rotation: DQuat, at: DVec3) -> Vec<f64> {
    DMat4::from_scale_rotation_translation(scale, rotation, at).to_cols_array().to_vec()
}

fn camera((of, place): (&Value, String), warnings: &mut Warnings) -> Value {
    let calibration = &of["calibration"];
    let [width, height] = numbers::<2>(calibration, "image_size_px");
    let [fx, fy] = numbers::<2>(calibration, "focal_px");
    let [cx, cy] = numbers::<2>(calibration, "center_px");
    let at = format!("{place}/calibration");
    if (cx - 0.5 * width).abs() > 1e-9 || (cy - 0.5 * height).abs() > 1e-9 {
        warnings.add(format!("{at}/center_px"), "left out: the format's axes meet the middle of the picture");
    }
    if calibration.pointer("/distortion/model").and_then(Value::as_str).is_some_and(|model| model != "none") {
        warnings.add(format!("{at}/distortion"), "left out: the format has no word for lens distortion");
    }
    let rotation = node_rotation(DQuat::from_array(numbers(calibration, "world_from_camera")));
    let position = y_up(DVec3::from_array(numbers(calibration, "position_m")));
    json!({
        "name": of["id"],
        "matrixWorld": matrix(DVec3::ONE, rotation, position),
        "fov": 2.0 * (0.5 * height / fy).atan().to_degrees(),
        "aspect": width / fx / (height / fy),
        "width": calibration["image_size_px"][0],
        "height": calibration["image_size_px"][1],
    })
}

/// Pictures on it are not told.
fn painted(of: &Value, place: &str, warnings: &mut Warnings) {
    for key in ["imagery", "texture", "roof_texture"] {
        if of.get(key).is_some() {
            warnings.add(format!("{place}/{key}"), "left out: the format has plain colours alone");
        }
    }
}

/// x and z of corners in an object's plane.
fn corners(of: &Value) -> Vec<[f64; 2]> {
    let corner = |corner: &Value| [number(corner, "/0"), -number(corner, "/1")];
    list(of, "polygon").iter().map(corner).collect()
}

fn ground((of, place): (&Value, String), warnings: &mut Warnings) -> Value {
    painted(of, &place, warnings);
    let at = DVec3::new(0.0, number(of, "/height_m"), 0.0);
    json!({
        "matrixWorld": matrix(DVec3::ONE, DQuat::IDENTITY, at),
        "polygon": corners(of),
        "color": of["color_srgb"],
    })
}

fn building(kind: &str, (of, place): (&Value, String), warnings: &mut Warnings) -> Value {
    painted(of, &place, warnings);
    let mut building = match kind {
        "boxes" => {
            let [x, y, z] = numbers::<3>(of, "size_m");
            let rotation = turn(number(of, "/yaw_deg").to_radians());
            let at = y_up(DVec3::from_array(numbers(of, "center_m")));
            json!({ "geometry": "box", "matrixWorld": matrix(DVec3::new(x, z, y), rotation, at) })
        }
        "cylinders" => {
            let (radius, height) = (number(of, "/radius_m"), number(of, "/height_m"));
            let middle = DVec3::from_array(numbers(of, "base_m")) + DVec3::Z * (0.5 * height);
            let scale = DVec3::new(radius, height, radius);
            json!({ "geometry": "cylinder", "matrixWorld": matrix(scale, DQuat::IDENTITY, y_up(middle)) })
        }
        _ => {
            let (base, top) = (number(of, "/base_m"), number(of, "/top_m"));
            let at = DVec3::new(0.0, base, 0.0);
            json!({
                "geometry": "prism",
                "matrixWorld": matrix(DVec3::ONE, DQuat::IDENTITY, at),
                "polygon": corners(of),
                "height": top - base,
            })
        }
    };
    building["name"] = of["id"].clone();
    building["color"] = of["color_srgb"].clone();
    building
}

/// Reads a file of the paper's.
pub(super) fn take(text: &str) -> Result<Taken, SceneError> {
    let mut gatherer = Gatherer::default();
    let tree = json::tree(text, &mut gatherer)?;
    let mut taking = Taking { gatherer, warnings: Warnings::default(), origins: Vec::new() };
    let document = taking.document(tree);
    let Taking { gatherer, warnings, origins } = taking;
    match document {
        Some(document) if gatherer.faults().is_empty() => {
            Ok(Taken { document: document.to_string(), warnings: warnings.0, origins, rest: "" })
        }
        _ => Err(SceneError::Faults(gatherer.into_faults())),
    }
}

/// A file on its way to a document.
struct Taking {
    gatherer: Gatherer,
    warnings: Warnings,
    origins: Vec<(String, String)>,
}

impl Taking {
    fn document(&mut self, tree: Value) -> Option<Value> {
        let mut fields = self.gatherer.object(tree, "")?;
        let (format, place) = fields.require("format", &mut self.gatherer)?;
        if format != FORMAT {
            self.gatherer.fault(place, format!("expected {FORMAT:?}"));
            return None;
        }
        let version = fields.require("version", &mut self.gatherer)?;
        if version.0 != 1 {
            self.gatherer.fault(version.1, "expected 1, the only version that this release reads");
            return None;
        }
        if let Some((up, place)) = fields.take("up").filter(|(up, _)| up != "y") {
            self.gatherer.fault(place, format!("expected \"y\", as three.js has it, got {up}"));
        }
        let mut document = Map::new();
        document.insert("version".to_owned(), json!(1));
        if let Some((name, _)) = fields.take("name") {
            document.insert("name".to_owned(), name);
        }
        if let Some((sky, _)) = fields.take("sky").filter(|(sky, _)| !sky.is_null()) {
            document.insert("sky".to_owned(), json!({ "color_srgb": sky }));
        }
        // What was left out when it was written.
        fields.take("warnings");
        let [cameras, ground, buildings] = ["cameras", "ground", "buildings"].map(|key| fields.take(key));
        for (key, list) in [("cameras", cameras), ("ground", ground)] {
            let list = self.gatherer.list(list, MAX_ELEMENTS);
            let mut made = Vec::new();
            for (value, place) in list {
                let value = self.known(value, &place, key);
                let one =
                    if key == "cameras" { self.camera(value, &place) } else { self.ground(value, &place) };
                let Some(one) = one else { continue };
                let part = format!("/{key}/{}", made.len());
                self.origins.push((part, place));
                made.push(one);
            }
            document.insert(key.to_owned(), made.into());
        }
        for (value, place) in self.gatherer.list(buildings, MAX_ELEMENTS) {
            let value = self.known(value, &place, "buildings");
            let Some((kind, made)) = self.building(value, &place) else { continue };
            let all = document.entry(kind).or_insert_with(|| json!([]));
            let Value::Array(all) = all else { continue };
            self.origins.push((format!("/{kind}/{}", all.len()), place));
            all.push(made);
        }
        // Other programs' members are theirs.
        let mut unknown = Gatherer::default();
        fields.finish(&mut unknown);
        for fault in unknown.into_faults() {
            self.warnings.add(fault.place, "left out: it means nothing here");
        }
        Some(Value::Object(document))
    }

    /// An element without members that mean nothing here, which are told.
    fn known(&mut self, mut value: Value, place: &str, kind: &str) -> Value {
        let known: &[&str] = match kind {
            "cameras" => &["name", "matrixWorld", "fov", "aspect", "width", "height"],
            "ground" => &["matrixWorld", "polygon", "color"],
            _ => &["name", "geometry", "matrixWorld", "polygon", "height", "color"],
        };
        if let Value::Object(members) = &mut value {
            members.retain(|name, _| {
                let is_known = known.contains(&name.as_str());
                if !is_known {
                    self.warnings.add(pointer_to(place, name), "left out: it means nothing here");
                }
                is_known
            });
        }
        value
    }

    /// What a world matrix does.
    fn placed(&mut self, matrix: &[f64; 16], place: &str) -> Option<Placed> {
        let placed = Placed::of(DMat4::from_cols_array(matrix));
        placed.map_err(|reason| self.gatherer.fault(pointer_to(place, "matrixWorld"), reason)).ok()
    }

    fn camera(&mut self, value: Value, place: &str) -> Option<Value> {
        let camera: PaperCamera = self.gatherer.read(value, place)?;
        let placed = self.placed(&camera.matrix_world, place)?;
        if !(0.1..180.0).contains(&camera.fov) {
            self.gatherer.fault(pointer_to(place, "fov"), "expected 0.1 to less than 180 degrees");
            return None;
        }
        let told = camera.aspect.filter(|aspect| !(1e-3..=1e3).contains(aspect));
        if told.is_some() {
            self.gatherer.fault(pointer_to(place, "aspect"), "expected 0.001 to 1000");
            return None;
        }
        let (width, height) = match (camera.width, camera.height, camera.aspect) {
            (Some(width), Some(height), _) => (width, height),
            (_, _, None) => {
                self.gatherer.fault(place, "`aspect`, or `width` and `height`, is missing");
                return None;
            }
            (_, _, Some(aspect)) => {
                let message =
                    "the picture's size is not told: taken for 1080 rows; say `width` and `height` in pixels";
                self.warnings.add(place, message);
                ((f64::from(ASSUMED_ROWS) * aspect).round().clamp(1.0, 65_536.0) as u32, ASSUMED_ROWS)
            }
        };
        let (columns, rows) = (f64::from(width), f64::from(height));
        let half = (0.5 * camera.fov.to_radians()).tan();
        let aspect = camera.aspect.unwrap_or(columns / rows.max(1.0));
        Some(json!({
            "id": camera.name,
            "calibration": {
                "image_size_px": [width, height],
                "focal_px": [columns / (2.0 * aspect * half), rows / (2.0 * half)],
                "center_px": [0.5 * columns, 0.5 * rows],
                "position_m": z_up(placed.translation).to_array(),
                "world_from_camera": camera_rotation(placed.rotation).to_array(),
            },
        }))
    }

    /// Corners of an object's plane in the world, x and y, and their height.
    fn level(&mut self, polygon: &[[f64; 2]], placed: &Placed, place: &str) -> Option<(Vec<[f64; 2]>, f64)> {
        if let Err(reason) = placed.yaw_rad() {
            self.gatherer.fault(pointer_to(place, "matrixWorld"), reason);
            return None;
        }
        let corner = |[x, z]: &[f64; 2]| {
            let own = placed.scale * DVec3::new(*x, 0.0, *z);
            let at = z_up(placed.rotation * own + placed.translation);
            [at.x, at.y]
        };
        Some((polygon.iter().map(corner).collect(), placed.translation.y))
    }

    fn ground(&mut self, value: Value, place: &str) -> Option<Value> {
        let ground: PaperGround = self.gatherer.read(value, place)?;
        let placed = self.placed(&ground.matrix_world, place)?;
        let (polygon, height_m) = self.level(&ground.polygon, &placed, place)?;
        Some(colored(json!({ "polygon": polygon, "height_m": height_m }), ground.color))
    }

    fn building(&mut self, value: Value, place: &str) -> Option<(&'static str, Value)> {
        let building: PaperBuilding = self.gatherer.read(value, place)?;
        let placed = self.placed(&building.matrix_world, place)?;
        let yaw_rad = placed.yaw_rad();
        let yaw_rad =
            yaw_rad.map_err(|reason| self.gatherer.fault(pointer_to(place, "matrixWorld"), reason)).ok()?;
        let (middle, size) = (z_up(placed.translation), placed.scale);
        let (kind, made) = match building.geometry {
            Geometry::Box => {
                let size_m = [size.x, size.z, size.y];
                let made = json!({
                    "center_m": middle.to_array(), "size_m": size_m, "yaw_deg": yaw_rad.to_degrees(),
                });
                ("boxes", made)
            }
            Geometry::Cylinder => {
                if (size.x - size.z).abs() > 1e-6 * size.x {
                    let message = "a cylinder must be as wide in x as in z";
                    self.gatherer.fault(pointer_to(place, "matrixWorld"), message);
                    return None;
                }
                let base = middle - DVec3::Z * (0.5 * size.y);
                ("cylinders", json!({ "base_m": base.to_array(), "radius_m": size.x, "height_m": size.y }))
            }
            Geometry::Prism => {
                let (polygon, base_m) = self.level(&building.polygon, &placed, place)?;
                let top_m = building.height.mul_add(size.y, base_m);
                ("footprints", json!({ "polygon": polygon, "base_m": base_m, "top_m": top_m }))
            }
        };
        let mut made = colored(made, building.color);
        made["id"] = building.name.into();
        Some((kind, made))
    }
}

fn colored(mut made: Value, color: Option<Value>) -> Value {
    if let Some(color) = color.filter(|color| !color.is_null()) {
        made["color_srgb"] = color;
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera two metres up that looks north, as three.js has its world matrix: written out by hand.
    const CAMERA: &str = r#"{"format": "video-fields", "version": 1, "cameras": [{"name": "gate", "fov": 90, "width": 640,
        "height": 480, "matrixWorld": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 3, 2, -7, 1]}]}"#;

    #[test]
    fn an_untouched_camera_of_three_js_looks_north() {
        let taken = take(CAMERA).unwrap();
        assert_eq!(taken.warnings, []);
        let scene = crate::scene::parse("yard", &taken.document, crate::scene::no_imports).unwrap().scene;
        let camera = &scene.cameras[0].camera;
        let pose = camera.pose();
        assert!(pose.position_in_world.distance(DVec3::new(3.0, 7.0, 2.0)) < 1e-12, "north is -z");
        assert!(pose.forward_in_world().distance(DVec3::Y) < 1e-12, "-z is north");
        // Half of 90 degrees up is as far as it is ahead: the upper edge.
        let seen = camera.project(DVec3::new(3.0, 17.0, 12.0)).unwrap();
        assert!(seen.texture.distance(glam::DVec2::new(0.5, 0.0)) < 1e-12, "{:?}", seen.texture);
        let east = camera.project(DVec3::new(8.0, 17.0, 2.0)).unwrap();
        assert!(east.texture.x > 0.5, "east is right of who looks north");
    }

    #[test]
    fn what_is_wrong_is_told_at_its_place() {
        let check = |from: &str, to: &str, place: &str, message: &str| {
            assert!(CAMERA.contains(from), "{from}");
            let error = take(&CAMERA.replacen(from, to, 1)).map(|taken| taken.document).unwrap_err();
            let told = error.faults().iter().map(ToString::to_string).collect::<Vec<_>>().join("; ");
            assert_eq!(error.faults()[0].place, place, "{told}");
            assert!(told.contains(message), "{told}");
        };
        check("3, 2, -7, 1]", "3, 2, -7]", "/cameras/0/matrixWorld", "16");
        check("3, 2, -7, 1]", "3, 2, -7, 1e999]", "", "out of range");
        check("3, 2, -7, 1]", "3, 2, -7, NaN]", "", "no NaN");
        check("[1, 0, 0, 0, 0, 1", "[1, 0, 0, 3, 0, 1", "/cameras/0/matrixWorld", "column-major");
        check("[1, 0, 0, 0, 0, 1", "[-1, 0, 0, 0, 0, 1", "/cameras/0/matrixWorld", "mirrors");
        check("\"fov\": 90", "\"fov\": 180", "/cameras/0/fov", "less than 180");
        check("\"fov\": 90", "\"fov\": \"90\"", "/cameras/0/fov", "expected a number");
        check("\"width\": 640,", "", "/cameras/0", "aspect");
        check("\"version\": 1", "\"version\": 2", "/version", "expected 1");
        check("video-fields", "other", "/format", "expected");
        check("\"version\": 1,", "\"version\": 1, \"up\": \"z\",", "/up", "three.js");
        check("\"fov\": 90", "\"fov\": 90, \"fov\": 91", "/cameras/0/fov", "twice");
    }

    #[test]
    fn what_means_nothing_here_is_told_and_what_is_not_told_is_guessed_aloud() {
        let text =
            CAMERA.replace("\"width\": 640,\n        \"height\": 480", "\"aspect\": 1.5, \"near\": 0.1");
        let taken = take(&text).unwrap();
        let told: Vec<_> = taken.warnings.iter().map(|of| of.place.as_str()).collect();
        assert_eq!(told, ["/cameras/0/near", "/cameras/0"]);
        assert!(taken.document.contains("[1620,1080]"), "{}", taken.document);
    }
}
