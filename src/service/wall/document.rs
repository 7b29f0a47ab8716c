//! A wall's document: what is shown, from where, on which tiles; validated with JSON pointers.

use super::{SurfaceDocument, Wall, zoomed};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use videofields_vision::error::{Fault, Gatherer};
use videofields_vision::frame::is_id;

/// Distance of the viewer from a wall that does not say, in heights of the wall.
const VIEWER_HEIGHTS: f64 = 1.5;

/// Least distance between eye and target, metres: below it there is no direction to look in.
const MIN_DISTANCE_M: f64 = 1e-6;

/// Most metres that a place in the world is away from its origin.
const MAX_WORLD_M: f64 = 1e7;

/// Most metres that the viewer is away from the wall's origin.
const MAX_WALL_M: f64 = 1000.0;

const MAX_NAME_CHARS: usize = 200;
const MAX_PARAMETER_BYTES: usize = 1024;

/// A wall as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WallDocument {
    /// Name for people, at most 200 characters. Default empty.
    #[serde(default)]
    pub name: String,
    /// The scene that it shows.
    pub scene: String,
    /// The playhead whose time it shows; live without one.
    #[serde(default)]
    pub playhead: Option<String>,
    /// Frames a second, 0.5 to 60. Default 10.
    #[serde(default = "default_rate_hz")]
    pub rate_hz: f64,
    /// Where the viewer stands in the world.
    pub view: WallViewDocument,
    /// The viewer's place in wall space, metres. Default: of a cylinder its axis, of any other wall one and a half of its
    /// heights before its middle.
    #[serde(default)]
    pub viewer_m: Option<[f64; 3]>,
    /// How much larger everything is shown than a window of the wall's size would, 0.01 to 100. Default 1.
    #[serde(default = "default_zoom")]
    pub zoom: f64,
    /// Further parameters of views, as a query string has them, such as `quality=draft&see_through=off`. Default none.
    #[serde(default)]
    pub parameters: String,
    /// The tiles.
    pub surface: SurfaceDocument,
}

/// Where the viewer of a wall stands in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WallViewDocument {
    /// The eye, metres.
    pub eye_m: [f64; 3],
    /// What is straight ahead, metres.
    pub target_m: [f64; 3],
}

const fn default_rate_hz() -> f64 {
    10.0
}

const fn default_zoom() -> f64 {
    1.0
}

impl Wall {
    /// Reads a wall's document; answers it with every default filled in too.
    ///
    /// # Errors
    /// With every fault, each at its JSON pointer.
    pub fn read(document: Value) -> Result<(Self, WallDocument), Vec<Fault>> {
        let mut gatherer = Gatherer::default();
        let is_object = document.is_object();
        if !is_object {
            gatherer.fault("", "expected an object");
        }
        let document = if is_object { gatherer.read::<WallDocument>(document, "") } else { None };
        let Some(mut document) = document else { return Err(gatherer.into_faults()) };
        let wall = checked(&document, &mut gatherer);
        let faults = gatherer.into_faults();
        if !faults.is_empty() {
            return Err(faults);
        }
        document.viewer_m = Some(wall.viewer_m.to_array());
        Ok((wall, document))
    }
}

fn checked(document: &WallDocument, gatherer: &mut Gatherer) -> Wall {
    if document.name.chars().count() > MAX_NAME_CHARS {
        gatherer.fault("/name", format!("expected at most {MAX_NAME_CHARS} characters"));
    }
    for (key, id) in [("/scene", Some(&document.scene)), ("/playhead", document.playhead.as_ref())] {
        if id.is_some_and(|id| !is_id(id)) {
            gatherer.fault(key, "expected 1 to 64 of a-z, 0-9, - and _, the first a letter or digit");
        }
    }
    if document.parameters.len() > MAX_PARAMETER_BYTES {
        gatherer.fault("/parameters", format!("expected at most {MAX_PARAMETER_BYTES} bytes"));
    }
    for (key, value, [least, most], unit) in [
        ("/rate_hz", document.rate_hz, [0.5, 60.0], " frames a second"),
        ("/zoom", document.zoom, [0.01, 100.0], ""),
    ] {
        if !(least..=most).contains(&value) {
            gatherer.fault(key, format!("expected {least} to {most}{unit}, got {value}"));
        }
    }
    let WallViewDocument { eye_m, target_m } = document.view;
    for (key, place) in [("/view/eye_m", eye_m), ("/view/target_m", target_m)] {
        if place.iter().any(|value| value.abs() > MAX_WORLD_M) {
            gatherer.fault(key, format!("expected three numbers within +-{MAX_WORLD_M:e} metres"));
        }
    }
    let (eye_m, target_m) = (DVec3::from_array(eye_m), DVec3::from_array(target_m));
    if eye_m.distance(target_m) < MIN_DISTANCE_M {
        let message = format!("eye_m and target_m must be at least {MIN_DISTANCE_M} m apart");
        gatherer.fault("/view/target_m", message);
    }
    let tiles = document.surface.tiles("/surface", gatherer);
    let viewer_m = document.viewer_m.map_or_else(|| viewer_of(&document.surface, &tiles), DVec3::from_array);
    let wall = Wall {
        name: document.name.clone(),
        scene: document.scene.clone(),
        playhead: document.playhead.clone(),
        rate_hz: document.rate_hz,
        eye_m,
        target_m,
        viewer_m,
        zoom: document.zoom,
        parameters: document.parameters.clone(),
        tiles,
    };
    // Faults of the tiles themselves are told already, and would be told again.
    if !gatherer.is_faulty("/surface") && !gatherer.is_faulty("/zoom") {
        check_windows(&wall, &document.surface, gatherer);
    }
    wall
}

/// Where the viewer of a wall is that does not say.
fn viewer_of(surface: &SurfaceDocument, tiles: &[super::Tile]) -> DVec3 {
    if surface.cylinder.is_some() {
        return DVec3::ZERO;
    }
    let corners = || {
        tiles.iter().flat_map(|tile| {
            let [lower_left, lower_right, upper_left] = tile.corners_m;
            [lower_left, lower_right, upper_left, lower_right + upper_left - lower_left]
        })
    };
    let Some(first) = corners().next() else { return DVec3::Z };
    let (low, high) = corners().fold((first, first), |(low, high), at| (low.min(at), high.max(at)));
    let middle = 0.5 * (low + high);
    DVec3::new(middle.x, middle.y, VIEWER_HEIGHTS.mul_add((high.y - low.y).max(0.01), high.z))
}

/// Every tile must be a rectangle that faces the viewer, as it is shown.
fn check_windows(wall: &Wall, surface: &SurfaceDocument, gatherer: &mut Gatherer) {
    if wall.viewer_m.to_array().iter().any(|value| value.abs() > MAX_WALL_M) {
        gatherer.fault("/viewer_m", format!("expected three numbers within +-{MAX_WALL_M} metres"));
        return;
    }
    for (idx, tile) in wall.tiles.iter().enumerate() {
        let place = match surface.tiles {
            Some(_) => format!("/surface/tiles/{idx}"),
            None => "/viewer_m".to_owned(),
        };
        let [lower_left, lower_right, upper_left] =
            tile.corners_m.map(|corner| zoomed(corner - wall.viewer_m, wall.zoom));
        let (across, upwards) = (lower_right - lower_left, upper_left - lower_left);
        let area = across.cross(upwards);
        let is_rectangle = across.dot(upwards).abs() <= 1e-3 * across.length() * upwards.length();
        if !(across.length() >= 1e-3 && upwards.length() >= 1e-3 && is_rectangle) {
            let message = "expected a rectangle of at least 1 mm each way; with a zoom, its lower edge level or its side upright";
            gatherer.fault(place, message);
            return;
        }
        // Towards the viewer, as far as the tile is large.
        let distance = -lower_left.dot(area.normalize());
        if distance.is_nan() || distance < 1e-6 * across.length().max(upwards.length()) {
            let message = format!("tile {} does not face the viewer at {}", tile.id, wall.viewer_m);
            gatherer.fault(place, message);
            return;
        }
    }
}
