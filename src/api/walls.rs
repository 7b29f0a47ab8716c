//! `/api/v1/walls`: what the interface knows of walls' documents; `kept` lists, shows and changes them.

use super::error::Problem;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::Parameter;
use super::picture::files;
use super::{documents, kept, schema, view};
use crate::access::Role;
use crate::engine::ViewKind;
use crate::error::{ErrorKind, Fault};
use crate::store::DocumentKind;
use crate::wall::Wall;
use serde_json::{Value, json};

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
    let kept = |status, meaning| Answer::json(status, meaning, schema::named("Wall")).tagged();
    let list = Operation::new("list_walls", "Every wall, in the order of names").answers(Answer::json(
        200,
        "The walls",
        schema::walls::all(),
    ));
    let one = Operation::new("show_wall", "A wall's document").answers(kept(200, "The document"));
    let put = Operation::new("put_wall", "Makes a wall or replaces one")
        .role(Role::Operator)
        .conditional()
        .takes(schema::named("Wall"))
        .may_fail(&[409])
        .answers(kept(200, "It is replaced"))
        .answers(kept(201, "It is made"));
    let change = Operation::new("change_wall", "Changes the members of a wall's document that come")
        .about("Lists are replaced whole, null takes a member away (JSON Merge Patch, RFC 7396).")
        .role(Role::Operator)
        .conditional()
        .takes_patch(schema::walls::patch())
        .may_fail(&[409])
        .answers(kept(200, "It is changed"));
    let remove = Operation::new("remove_wall", "Takes a wall away")
        .role(Role::Operator)
        .conditional()
        .may_fail(&[409])
        .answers(Answer::nothing(204, "It is gone"));
    let restore = Operation::new("restore_wall", "Makes a version of before the newest")
        .role(Role::Admin)
        .conditional()
        .may_fail(&[409])
        .answers(kept(200, "It is the newest"))
        .answers(kept(201, "It is there again"));
    Routes::of(TAG, SEGMENTS)
        .get("/api/v1/walls", kept::list::<Wall>, list)
        .get("/api/v1/walls/{id}", kept::one::<Wall>, one)
        .put("/api/v1/walls/{id}", kept::put::<Wall>, put)
        .patch("/api/v1/walls/{id}", kept::change::<Wall>, change)
        .delete("/api/v1/walls/{id}", kept::remove::<Wall>, remove)
        .get(
            "/api/v1/walls/{id}/versions",
            kept::versions::<Wall>,
            documents::list_versions("list_wall_versions"),
        )
        .get(
            "/api/v1/walls/{id}/versions/{number}",
            kept::version::<Wall>,
            documents::show_version("show_wall_version", schema::named("Wall")),
        )
        .post("/api/v1/walls/{id}/versions/{number}/restore", kept::restore::<Wall>, restore)
}

impl kept::Kind for Wall {
    const KIND: DocumentKind = DocumentKind::Wall;
    const LIST: &'static str = "walls";

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
        let read = view::read_view_request(&self.scene, &self.parameters);
        let request = read.map_err(|faults| at(crate::error::join_faults(&faults)))?;
        // A field of view or the like would mean nothing.
        if request.kind == ViewKind::default() && request.fov_y_rad.is_none() {
            return Ok(());
        }
        Err(at("fov: is what the wall's size and its viewer's place say".to_owned()))
    }

    fn scene(&self) -> &str {
        &self.scene
    }

    fn summary(kept: &Kept) -> Value {
        let kept::Kept { id, version, content: wall, .. } = kept;
        json!({
            "id": id, "name": wall.name, "scene": wall.scene, "version": version, "tiles": wall.tiles.len(),
        })
    }
}
