//! A world as the rest of the project reads it: scene document and configuration.
//!
//! Owns the two texts; the formats are `scene`'s, `calibrate`'s and `config`'s.

use super::SimulateError;
use super::world::World;
use crate::calibrate::CameraDocument;
use crate::geometry::SurfaceId;
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
struct BoxDocument {
    id: &'static str,
    center_m: [f64; 3],
    size_m: [f64; 3],
    yaw_deg: f64,
    color_srgb: String,
}

#[derive(Serialize)]
struct SceneCameraDocument {
    id: &'static str,
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
    /// The scene document (JSON) with the cameras calibrated for pictures of `size_px`, one line for each polygon,
    /// box and camera.
    ///
    /// # Errors
    /// When the size is none that a camera can have.
    pub fn scene_json(&self, size_px: (u32, u32)) -> Result<String, SimulateError> {
        let ground = self.surfaces().ground.iter().zip(0..).map(|(polygon, idx)| GroundDocument {
            polygon: polygon.corners().iter().map(|corner| corner.to_array().map(whole_mm)).collect(),
            height_m: polygon.height_m(),
            color_srgb: hex(self.mean_srgb(SurfaceId::Ground(idx))),
        });
        let boxes = self.surfaces().boxes.iter().zip(0..).map(|(solid, idx)| BoxDocument {
            id: self.box_ids[usize::from(idx)],
            center_m: solid.center().to_array().map(whole_mm),
            size_m: (solid.half_size() * 2.0).to_array().map(whole_mm),
            yaw_deg: self.box_yaws_deg[usize::from(idx)],
            color_srgb: hex(self.mean_srgb(SurfaceId::Box(idx))),
        });
        let cameras = self.cameras(size_px)?;
        let cameras = cameras
            .iter()
            .map(|(id, camera)| SceneCameraDocument { id, calibration: CameraDocument::from_camera(camera) });
        Ok(format!(
            "{{\n  \"version\": 1,\n  \"name\": {},\n  \"sky\": {{\"color_srgb\": \"{}\"}},\n  \
             \"ground\": {},\n  \"boxes\": {},\n  \"cameras\": {},\n  \"view\": {}\n}}\n",
            serde_json::to_string(self.name)?,
            hex(self.sky_srgb),
            lines(ground)?,
            lines(boxes)?,
            lines(cameras)?,
            serde_json::to_string(&self.view)?,
        ))
    }

    /// The configuration (TOML) that serves the world's clips (`clips/<camera>.webm`) and scene document
    /// (`<world>.json`) from the folder in which it lies; `database` is relative to that folder.
    ///
    /// # Errors
    /// When the database's name cannot be written.
    pub fn config_toml(&self, database: &Path) -> Result<String, SimulateError> {
        let mut text = format!(
            "# The simulated {name}: what `videofields simulate --world {id}` writes.\n\n\
             [server]\nlisten = \"127.0.0.1:8080\"\n\n\
             [storage]\ndatabase = {database}\n",
            name = self.id,
            id = self.id,
            // A JSON string is a TOML string.
            database = serde_json::to_string(&database.to_string_lossy())?,
        );
        for camera in &self.cameras {
            text += &format!(
                "\n[[camera]]\nid = \"{id}\"\nname = \"{name}\"\n\
                 source = {{ path = \"clips/{id}.webm\", end = \"loop\" }}\n\
                 segment = {SEGMENT_TOML}\n",
                id = camera.id,
                name = camera.name,
            );
        }
        Ok(text + &format!("\n[[scene]]\nid = \"{id}\"\nfile = \"{id}.json\"\n", id = self.id))
    }
}

/// A JSON array with one element a line.
fn lines<T: Serialize>(elements: impl Iterator<Item = T>) -> Result<String, serde_json::Error> {
    let rows = elements.map(|element| serde_json::to_string(&element)).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("[\n    {}\n  ]", rows.join(",\n    ")))
}
