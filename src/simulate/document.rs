//! A world as the rest of the project reads it: scene document and configuration.
//!
//! Owns the two texts; the formats are `scene`'s, `calibrate`'s and `config`'s.

use super::SimulateError;
use super::solids::{SolidHit, SolidId};
use super::world::{World, WorldView};
use crate::calibrate::CameraDocument;
use crate::geometry::{Face, SurfaceId};
use crate::scene::ViewDocument;
use glam::{DVec2, DVec3};
use serde::Serialize;
use std::path::Path;

/// What finds the figures: they cast no shadows, so none are looked for; the clips hold little noise, so little blur
/// suffices; trousers are much like the paving, so gaps are closed; at 640 x 360 pixels the farthest figure still has
/// about 100.
const SEGMENT_TOML: &str =
    "{ delta = 0.1, blur_sigma_px = 0.6, shadow_darkest = 1.0, close_radius_px = 2, min_area_px = 40 }";

#[derive(Serialize)]
struct GroundDocument {
    polygon: Vec<[f64; 2]>,
    height_m: f64,
    color_srgb: String,
}

#[derive(Serialize)]
struct BoxDocument<'a> {
    id: &'a str,
    center_m: [f64; 3],
    size_m: [f64; 3],
    yaw_deg: f64,
    color_srgb: String,
}

#[derive(Serialize)]
struct SceneCameraDocument<'a> {
    id: &'a str,
    calibration: CameraDocument,
}

fn hex([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

/// Millimetres are what the world's own numbers have; what arithmetic added beyond them is dropped.
fn whole_mm(value: f64) -> f64 {
    (value * 1e3).round() / 1e3 + 0.0
}

impl World {
    /// The scene document (JSON) with the cameras calibrated for pictures of `size_px` (where none is given, of each
    /// camera's own size), one line for each polygon, box and camera.
    ///
    /// # Errors
    /// When the size is none that a camera can have.
    pub fn scene_json(&self, size_px: impl Into<Option<(u32, u32)>>) -> Result<String, SimulateError> {
        let ground = self.surfaces().ground().zip(0..).map(|(polygon, idx)| GroundDocument {
            polygon: polygon.corners().iter().map(|corner| corner.to_array().map(whole_mm)).collect(),
            height_m: polygon.height_m(),
            color_srgb: hex(self.mean_srgb(SurfaceId::Ground(idx))),
        });
        let boxes = self.surfaces().boxes().zip(0..).map(|(solid, idx)| BoxDocument {
            id: &self.box_ids[usize::from(idx)],
            center_m: solid.center().to_array().map(whole_mm),
            size_m: (solid.half_size() * 2.0).to_array().map(whole_mm),
            yaw_deg: self.box_yaws_deg[usize::from(idx)],
            color_srgb: hex(self.mean_srgb(SurfaceId::Box(idx))),
        });
        let terraces = self.terraces();
        let ground = ground.chain(terraces);
        let cameras = self.cameras_at(size_px.into())?;
        let cameras = cameras
            .iter()
            .map(|(id, camera)| SceneCameraDocument { id, calibration: CameraDocument::from_camera(camera) });
        let origin = match &self.origin {
            Some(origin) => format!("\"origin\": {},\n  ", serde_json::to_string(origin)?),
            None => String::new(),
        };
        let view = match self.views.first() {
            Some(WorldView { eye_m, target_m, fov_deg, .. }) => {
                let view = ViewDocument { eye_m: *eye_m, target_m: *target_m, fov_deg: *fov_deg };
                format!(",\n  \"view\": {}", serde_json::to_string(&view)?)
            }
            None => String::new(),
        };
        Ok(format!(
            "{{\n  \"version\": 1,\n  \"name\": {},\n  \"sky\": {{\"color_srgb\": \"{}\"}},\n  \
             {}\"ground\": {},\n  \"boxes\": {},\n  \"cameras\": {}{}\n}}\n",
            serde_json::to_string(&self.name)?,
            hex(self.sky_srgb),
            origin,
            lines(ground)?,
            lines(boxes)?,
            lines(cameras)?,
            view,
        ))
    }

    /// The configuration (TOML) that serves the world's clips (`clips/<camera>.webm`) and scene document
    /// (`<world>.json`) from the folder in which it lies; `database` is relative to that folder.
    ///
    /// # Errors
    /// When the database's name cannot be written.
    pub fn config_toml(&self, database: &Path) -> Result<String, SimulateError> {
        let mut text = format!(
            "# The simulated {name}: what `videofields simulate --world {id}` writes.\n{notes}\n\
             [server]\nlisten = \"127.0.0.1:8080\"\n\n\
             [storage]\ndatabase = {database}\n",
            name = self.id,
            id = self.id,
            notes = self.approximations().iter().map(|note| format!("# {note}\n")).collect::<String>(),
            // A JSON string is a TOML string.
            database = serde_json::to_string(&database.to_string_lossy())?,
        );
        for camera in &self.cameras {
            text += &format!(
                "\n[[camera]]\nid = \"{id}\"\nname = {name}\n\
                 source = {{ path = \"clips/{id}.webm\", end = \"loop\" }}\n\
                 segment = {SEGMENT_TOML}\n",
                id = camera.id,
                name = serde_json::to_string(&camera.name)?,
            );
        }
        Ok(text + &format!("\n[[scene]]\nid = \"{id}\"\nfile = \"{id}.json\"\n", id = self.id))
    }
}

/// Terraces of a heightfield, each way at most: a scene may have 256 polygons.
const MAX_TERRACES: u32 = 12;

impl World {
    /// What the scene document cannot say of the world and says as nearly as it can, or leaves out.
    #[must_use]
    pub fn approximations(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.solids.terrain().is_some() {
            let n = self.n_terraces();
            notes.push(format!("Uneven ground is written as {n} x {n} level terraces of its mean height."));
        }
        if self.solids.has_shapes() {
            notes
                .push("Trees, posts, benches and parked cars are left out of the scene document.".to_owned());
        }
        notes
    }

    fn n_terraces(&self) -> u32 {
        let room = 256_usize.saturating_sub(self.surfaces().ground().len());
        (1..=MAX_TERRACES).rev().find(|n| (*n as usize).pow(2) <= room).unwrap_or(1)
    }

    /// The heightfield as level rectangles of its mean height.
    fn terraces(&self) -> Vec<GroundDocument> {
        const STEPS: u32 = 6;
        let Some(terrain) = self.solids.terrain() else { return Vec::new() };
        let (low, high) = (0..terrain.n_triangles())
            .map(|idx| terrain.part_bounds(idx))
            .reduce(|(low, high), (a, b)| (low.min(a), high.max(b)))
            .map_or((DVec2::ZERO, DVec2::ZERO), |(low, high)| (low.truncate(), high.truncate()));
        let n = self.n_terraces();
        let corner =
            |x: u32, y: u32| low + (high - low) * DVec2::new(f64::from(x), f64::from(y)) / f64::from(n);
        let terrace = |idx: u32| {
            let (x, y) = (idx % n, idx / n);
            let (from, to) = (corner(x, y), corner(x + 1, y + 1));
            let (mut height_m, mut light) = (0.0, DVec3::ZERO);
            for step in 0..STEPS * STEPS {
                let share = DVec2::new(f64::from(step % STEPS), f64::from(step / STEPS)) + 0.5;
                let at = from + (to - from) * share / f64::from(STEPS);
                let height = terrain.height_at(at).unwrap_or(0.0);
                let (point, solid) = (at.extend(height), SolidId::Terrain);
                height_m += height;
                let hit = SolidHit { distance_m: 1.0, point, normal: DVec3::Z, face: Face::Top, solid };
                light += self.still_light(&hit);
            }
            let count = f64::from(STEPS * STEPS);
            let polygon = [from, DVec2::new(to.x, from.y), to, DVec2::new(from.x, to.y)];
            GroundDocument {
                polygon: polygon.iter().map(|corner| corner.to_array().map(whole_mm)).collect(),
                height_m: whole_mm(height_m / count),
                color_srgb: hex((light / count).to_array().map(super::world::srgb_code)),
            }
        };
        (0..n * n).map(terrace).collect()
    }
}

/// A JSON array with one element a line.
fn lines<T: Serialize>(elements: impl Iterator<Item = T>) -> Result<String, serde_json::Error> {
    let rows = elements.map(|element| serde_json::to_string(&element)).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("[\n    {}\n  ]", rows.join(",\n    ")))
}
