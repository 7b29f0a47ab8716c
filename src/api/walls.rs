//! `/api/v1/walls`: what the interface knows of walls' documents; `kept` lists, shows and changes them.

use super::error::Problem;
use super::openapi::{Routes, Tag};
use super::parameters::Parameter;
use super::picture::files;
use super::{documents, kept, schema, view};
use serde_json::{Value, json};
use videofields_recording::store::DocumentKind;
use videofields_service::engine::{ViewKind, ViewRequest};
use videofields_service::wall::Wall;
use videofields_vision::error::{ErrorKind, Fault};

/// Parameters of views that a wall decides itself.
const OWN: [&str; 7] = ["projection", "eye", "target", "window", "width", "height", "t"];

/// A wall that is kept, in one of its versions.
pub(super) type Kept = kept::Kept<Wall>;

/// What these routes, and those of tiles, are about.
pub(super) const TAG: Tag = ("Walls", "Walls of screens that show one view at one instant");

/// What their paths name.
pub(super) const SEGMENTS: &[Parameter] = &[
    Parameter::id("id", "A wall"),
    Parameter::id("tile", "A tile of the wall"),
    documents::NUMBER,
    Parameter::files("picture", || files(&[("frame", ())]), "The tile's picture, and how it is written"),
];

/// Routes about walls and their documents.
pub(super) fn routes() -> Routes {
    kept::routes::<Wall>()
}

impl kept::Kind for Wall {
    const KIND: DocumentKind = DocumentKind::Wall;
    const LIST: &'static str = "walls";
    const TAG: Tag = TAG;
    const SEGMENTS: &'static [Parameter] = SEGMENTS;
    const SCHEMA: &'static str = "Wall";
    const PATHS: [&'static str; 5] = [
        "/api/v1/walls",
        "/api/v1/walls/{id}",
        "/api/v1/walls/{id}/versions",
        "/api/v1/walls/{id}/versions/{number}",
        "/api/v1/walls/{id}/versions/{number}/restore",
    ];
    const OPERATIONS: [&'static str; 8] = [
        "list_walls",
        "show_wall",
        "put_wall",
        "change_wall",
        "remove_wall",
        "list_wall_versions",
        "show_wall_version",
        "restore_wall",
    ];

    fn list_schema() -> Value {
        schema::walls::all()
    }

    fn read(document: Value) -> Result<(Self, Value), Vec<Fault>> {
        let (wall, document) = Self::read(document)?;
        let normal = serde_json::to_value(document);
        Ok((wall, normal.map_err(|error| vec![Fault::new("", error.to_string())])?))
    }

    /// Refuses parameters that views do not know, and those that the wall itself decides.
    fn check(&self) -> Result<(), Problem> {
        let at = |message: String| Problem::at(ErrorKind::Invalid, vec![Fault::new("/parameters", message)]);
        let mut names = self.parameters.split('&').filter_map(|part| part.split('=').next());
        if let Some(name) = names.find(|name| OWN.contains(name)) {
            return Err(at(format!("{name}: is what the wall's other members say")));
        }
        let request = self.request().map_err(|faults| at(videofields_vision::error::join_faults(&faults)))?;
        // A field of view or the like would mean nothing.
        if request.kind == ViewKind::default() && request.fov_y_rad.is_none() {
            return Ok(());
        }
        Err(at("fov: is what the wall's size and its viewer's place say".to_owned()))
    }

    fn scene(&self) -> &str {
        &self.scene
    }

    fn request(&self) -> Result<ViewRequest, Vec<Fault>> {
        view::read_view_request(&self.scene, &self.parameters)
    }

    fn summary(kept: &Kept) -> Value {
        let kept::Kept { id, version, content: wall, .. } = kept;
        json!({
            "id": id, "name": wall.name, "scene": wall.scene, "version": version, "tiles": wall.tiles.len(),
        })
    }
}
