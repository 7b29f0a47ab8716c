//! What stands in a scene as nodes of a glTF: where it stands is the node's, what it is stands in the node's `extras.videofields`,
//! which are the members of the scene document but for its place.

use super::axes::{Placed, camera_rotation, node_rotation, turn, y_up, z_up};
use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

/// How far a turn that a node has may be from the one in its extras, radians, to be taken for it.
const SAME_TURN_RAD: f64 = 1e-9;

/// Name in the extras, and list in a document.
pub(super) const KINDS: [(&str, &str); 7] = [
    ("camera", "cameras"),
    ("ground", "ground"),
    ("box", "boxes"),
    ("cylinder", "cylinders"),
    ("footprint", "footprints"),
    ("height_field", "height_fields"),
    ("model", "models"),
];

/// A node's place and what it is.
pub(super) struct NodeParts {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) extras: Map<String, Value>,
}

fn number(of: &Value, pointer: &str) -> f64 {
    of.pointer(pointer).and_then(Value::as_f64).unwrap_or_default()
}

fn numbers<const N: usize>(of: &Value, key: &str) -> [f64; N] {
    std::array::from_fn(|idx| number(of, &format!("/{key}/{idx}")))
}

/// What becomes of an element of the document's list of `kind`.
pub(super) fn parts(kind: &str, of: &Value) -> NodeParts {
    let mut extras = of.as_object().cloned().unwrap_or_default();
    let mut rotation = DQuat::IDENTITY;
    let translation = match kind {
        "camera" => {
            let calibration = extras.remove("calibration").unwrap_or_default();
            rotation = node_rotation(DQuat::from_array(numbers(&calibration, "world_from_camera")));
            let position = DVec3::from_array(numbers(&calibration, "position_m"));
            if let Value::Object(mut calibration) = calibration {
                calibration.remove("world_from_camera");
                calibration.remove("position_m");
                extras.append(&mut calibration);
            }
            position
        }
        "ground" => {
            extras.remove("height_m");
            own_corners(&mut extras).extend(number(of, "/height_m"))
        }
        "footprint" => {
            let (base, top) = (number(of, "/base_m"), number(of, "/top_m"));
            extras.remove("base_m");
            extras.remove("top_m");
            extras.insert("height_m".to_owned(), json!(top - base));
            own_corners(&mut extras).extend(base)
        }
        "box" => {
            rotation = turn(number(of, "/yaw_deg").to_radians());
            extras.remove("center_m");
            DVec3::from_array(numbers(of, "center_m"))
        }
        "cylinder" => {
            extras.remove("base_m");
            DVec3::from_array(numbers(of, "base_m"))
        }
        "height_field" => {
            extras.remove("low_m");
            let [x, y] = numbers::<2>(of, "low_m");
            DVec3::new(x, y, 0.0)
        }
        _ => {
            rotation = turn(number(of, "/yaw_deg").to_radians());
            extras.remove("position_m");
            DVec3::from_array(numbers(of, "position_m"))
        }
    };
    extras.insert("kind".to_owned(), json!(kind));
    NodeParts { translation: y_up(translation), rotation, extras }
}

/// Makes a polygon's corners relative to their middle, in whole metres so that nothing is rounded; answers that.
fn own_corners(extras: &mut Map<String, Value>) -> glam::DVec2 {
    let Some(Value::Array(corners)) = extras.get_mut("polygon") else { return glam::DVec2::ZERO };
    let at = |corner: &Value| glam::DVec2::new(number(corner, "/0"), number(corner, "/1"));
    let sum: glam::DVec2 = corners.iter().map(at).sum();
    let middle = (sum / corners.len().max(1) as f64).round();
    for corner in corners {
        *corner = json!((at(corner) - middle).to_array());
    }
    middle
}

/// The element of a document that a node's extras and place make.
///
/// # Errors
/// Why there is none, for people.
pub(super) fn element(kind: &str, mut of: Map<String, Value>, placed: &Placed) -> Result<Value, String> {
    let (at, scale) = (z_up(placed.translation), placed.scale);
    match kind {
        "camera" => {
            let id = of.remove("id").unwrap_or_default();
            of.insert("position_m".to_owned(), json!(at.to_array()));
            of.insert("world_from_camera".to_owned(), json!(camera_rotation(placed.rotation).to_array()));
            return Ok(json!({ "id": id, "calibration": of }));
        }
        "ground" => {
            placed.yaw_rad()?;
            set_corners(&mut of, placed);
            of.insert("height_m".to_owned(), json!(at.z));
        }
        "footprint" => {
            placed.yaw_rad()?;
            set_corners(&mut of, placed);
            let height_m = of.remove("height_m").and_then(|height| height.as_f64());
            let height_m = height_m.ok_or("extras.videofields.height_m: expected a number")?;
            of.insert("base_m".to_owned(), json!(at.z));
            of.insert("top_m".to_owned(), json!(height_m.mul_add(scale.y, at.z)));
        }
        "box" => {
            set_yaw(&mut of, placed)?;
            multiply(&mut of, "size_m", DVec3::new(scale.x, scale.z, scale.y));
            of.insert("center_m".to_owned(), json!(at.to_array()));
        }
        "cylinder" => {
            placed.yaw_rad()?;
            if (scale.x - scale.z).abs() > 1e-6 * scale.x {
                return Err("a cylinder must be as wide in x as in z".to_owned());
            }
            multiply(&mut of, "radius_m", DVec3::splat(scale.x));
            multiply(&mut of, "height_m", DVec3::splat(scale.y));
            of.insert("base_m".to_owned(), json!(at.to_array()));
        }
        "height_field" => {
            if placed.yaw_rad()?.abs() > SAME_TURN_RAD
                || (scale - DVec3::ONE).abs().max_element() > SAME_TURN_RAD
            {
                return Err("uneven ground can be moved, but neither turned nor scaled".to_owned());
            }
            if let Some(Value::Array(heights)) = of.get_mut("heights_m") {
                let risen =
                    |height: &Value| height.as_f64().map_or_else(|| height.clone(), |m| json!(m + at.z));
                *heights = heights.iter().map(risen).collect();
            }
            of.insert("low_m".to_owned(), json!([at.x, at.y]));
        }
        _ => {
            set_yaw(&mut of, placed)?;
            if (scale.x - scale.y).abs().max((scale.x - scale.z).abs()) > 1e-6 * scale.x {
                return Err("a model must be scaled alike in all directions".to_owned());
            }
            multiply(&mut of, "scale", DVec3::splat(scale.x));
            of.insert("position_m".to_owned(), json!(at.to_array()));
        }
    }
    Ok(Value::Object(of))
}

/// Puts a polygon's corners where its node stands. What is no list of corners is left for the document's reader to refuse.
fn set_corners(of: &mut Map<String, Value>, placed: &Placed) {
    let Some(Value::Array(corners)) = of.get_mut("polygon") else { return };
    for corner in corners {
        let Some([x, y]) = corner.as_array().map(Vec::as_slice) else { continue };
        let Some((x, y)) = x.as_f64().zip(y.as_f64()) else { continue };
        let own = placed.scale * y_up(DVec3::new(x, y, 0.0));
        let at = z_up(placed.rotation * own + placed.translation);
        *corner = json!([at.x, at.y]);
    }
}

/// The node's turn; as the extras write it where that is the same.
fn set_yaw(of: &mut Map<String, Value>, placed: &Placed) -> Result<(), String> {
    let yaw_rad = placed.yaw_rad()?;
    let written = of.get("yaw_deg").map_or(Some(0.0), Value::as_f64);
    let is_same = |deg: f64| {
        let off = (deg.to_radians() - yaw_rad).rem_euclid(std::f64::consts::TAU);
        off.min(std::f64::consts::TAU - off) < SAME_TURN_RAD
    };
    if written.is_none_or(|deg| !is_same(deg)) {
        of.insert("yaw_deg".to_owned(), json!(yaw_rad.to_degrees()));
    }
    Ok(())
}

/// Multiplies a number, or three, by a node's scale; a scale of 1 leaves it to the bit.
fn multiply(of: &mut Map<String, Value>, key: &str, scale: DVec3) {
    if (scale - DVec3::ONE).abs().max_element() < 1e-12 {
        return;
    }
    match of.get_mut(key) {
        Some(Value::Array(numbers)) => {
            for (value, scale) in numbers.iter_mut().zip(scale.to_array()) {
                *value = value.as_f64().map_or_else(|| value.clone(), |number| json!(number * scale));
            }
        }
        Some(value) => {
            *value = value.as_f64().map_or_else(|| value.clone(), |number| json!(number * scale.x));
        }
        None if key == "scale" => drop(of.insert(key.to_owned(), json!(scale.x))),
        None => {}
    }
}
