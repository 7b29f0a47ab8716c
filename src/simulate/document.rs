//! A world as the rest of the project reads it: scene document and configuration.
//!
//! Owns the two texts; the formats are `scene`'s, `calibrate`'s and `config`'s.

use super::SimulateError;
use super::solids::{SolidHit, SolidId};
use super::world::{World, WorldView};
use glam::{DVec2, DVec3};
use serde::Serialize;
use std::path::Path;
use videofields_picture::scene::ViewDocument;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::geometry::{Face, SurfaceId};

/// Settings that find the figures of these clips, not the defaults: no shadows are looked for, since trousers are much like the paving in
/// shade, and gaps are closed for the same reason; the clips hold little noise, so little blur suffices; at 640 x 360 pixels the farthest
/// figure still has about 100.
const SEGMENT_TOML: &str =
    "{ delta = 0.1, blur_sigma_px = 0.6, shadow_darkest = 1.0, close_radius_px = 2, min_area_px = 40 }";

#[derive(Serialize)]
struct GroundDocument {
    polygon: Vec<[f64; 2]>,
    height_m: f64,
    color_srgb: String,
}

#[derive(Serialize)]
struct HeightFieldDocument {
    id: String,
    low_m: [f64; 2],
    step_m: f64,
    columns: u32,
    heights_m: Vec<f64>,
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
    /// The scene document (JSON) with the cameras as they are calibrated, errors included, for pictures of `size_px` (where none is given, of each
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
        let fields = match self.height_field() {
            Some(field) => format!("\"height_fields\": {},\n  ", lines(std::iter::once(field))?),
            None => String::new(),
        };
        let cameras = self.calibrated_at(size_px.into())?;
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
             {}\"ground\": {},\n  {}\"boxes\": {},\n  \"cameras\": {}{}\n}}\n",
            serde_json::to_string(&self.name)?,
            hex(self.sky_srgb),
            origin,
            lines(ground)?,
            fields,
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
            "# The simulated {name}: what `videofields-lab simulate --world {id}` writes.\n{notes}\n\
             [server]\nlisten = \"127.0.0.1:8080\"\n\n\
             [storage]\ndatabase = {database}\n\n\
             [media]\nroots = [\"clips\"]\n",
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

/// Heights that a scene document may have.
const MAX_HEIGHTS: usize = 262_144;

impl World {
    /// What the scene document cannot say of the world and says as nearly as it can, or leaves out.
    #[must_use]
    pub fn approximations(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if self.height_stride() > 1 {
            notes.push("Of uneven ground every second post each way is written.".to_owned());
        }
        if self.solids.has_shapes() {
            notes
                .push("Trees, posts, benches and parked cars are left out of the scene document.".to_owned());
        }
        notes
    }

    /// Every how manieth post of the heightfield is written.
    fn height_stride(&self) -> usize {
        let n_heights = self.solids.terrain().map_or(0, |terrain| terrain.heights_m().len());
        if n_heights > MAX_HEIGHTS { 2 } else { 1 }
    }

    /// The heightfield, in the mean colour of what it is of; posts that no stride meets are left out at its far edges.
    fn height_field(&self) -> Option<HeightFieldDocument> {
        /// Places each way that are looked at for the colour.
        const STEPS: u32 = 48;
        let terrain = self.solids.terrain()?;
        let (stride, n_columns) = (self.height_stride(), terrain.n_columns() as usize);
        let rows = || terrain.heights_m().chunks_exact(n_columns);
        let size_m = terrain.step_m() * DVec2::new((n_columns - 1) as f64, (rows().len() - 1) as f64);
        let mut light = DVec3::ZERO;
        for step in 0..STEPS * STEPS {
            let share =
                (DVec2::new(f64::from(step % STEPS), f64::from(step / STEPS)) + 0.5) / f64::from(STEPS);
            let at = terrain.origin() + size_m * share;
            let (point, solid) = (at.extend(terrain.height_at(at).unwrap_or(0.0)), SolidId::Terrain);
            let hit = SolidHit { distance_m: 1.0, point, normal: DVec3::Z, face: Face::Top, solid };
            light += self.still_light(&hit);
        }
        let light = light / f64::from(STEPS * STEPS);
        let heights_m =
            rows().step_by(stride).flat_map(|row| row.iter().step_by(stride).copied().map(whole_mm));
        let mut id = "terrain".to_owned();
        while self.box_ids.contains(&id) {
            id.push('-');
        }
        Some(HeightFieldDocument {
            id,
            low_m: terrain.origin().to_array(),
            step_m: terrain.step_m() * stride as f64,
            columns: n_columns.div_ceil(stride) as u32,
            heights_m: heights_m.collect(),
            color_srgb: hex(light.to_array().map(super::world::srgb_code)),
        })
    }
}

/// A JSON array with one element a line.
fn lines<T: Serialize>(elements: impl Iterator<Item = T>) -> Result<String, serde_json::Error> {
    let rows = elements.map(|element| serde_json::to_string(&element)).collect::<Result<Vec<_>, _>>()?;
    Ok(format!("[\n    {}\n  ]", rows.join(",\n    ")))
}
