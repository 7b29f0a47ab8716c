//! A document's tree -> the normalised document and the scene, or all of its faults.

use super::document::{
    BoxDocument, EntitiesDocument, GroundDocument, ImportReference, OriginDocument, SceneCameraDocument,
    SceneDocument, SceneSequenceDocument, VERSION, ViewDocument,
};
use super::painting::{PaintedShape, Painting};
use super::{
    Imports, Material, ParsedScene, Scene, SceneCamera, SceneError, SceneSequence, SceneView, json, shapes,
};
use glam::{DVec2, DVec3};
use serde_json::Value;
use std::collections::HashSet;
use std::sync::Arc;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::error::{Gatherer, pointer_to};
use videofields_vision::frame::{CameraId, IdError, is_id};
use videofields_vision::geometry::{GroundPolygon, OrientedBox, Shape, SurfaceError, Surfaces};

const MAX_NAME_CHARS: usize = 200;
const MAX_POLYGONS: usize = 256;
/// Of all polygons together: to look for crossings costs the square of a polygon's corners.
const MAX_CORNERS: usize = 16_384;
const MAX_BOXES: usize = 4096;
const MAX_CAMERAS: usize = 256;
const MAX_SEQUENCES: usize = 4;
const MAX_VIEW_M: f64 = 1e8;
const MIN_VIEW_DISTANCE_M: f64 = 1e-3;

/// A value and its place in the document.
pub(super) type Placed = (Value, String);

/// Reads a document; `imports` brings in what stands elsewhere.
pub(super) fn parse(id: &str, text: &str, imports: &mut dyn Imports) -> Result<ParsedScene, SceneError> {
    let mut gatherer = Gatherer::default();
    if !is_id(id) {
        gatherer.fault("", format!("invalid scene id {id:?}: {IdError}"));
    }
    let tree = json::tree(text, &mut gatherer)?;
    let read = read(id, tree, imports, &mut gatherer);
    match read {
        Some(parsed) if gatherer.faults().is_empty() => Ok(parsed),
        _ => Err(SceneError::Faults(gatherer.into_faults())),
    }
}

fn read(id: &str, tree: Value, imports: &mut dyn Imports, gatherer: &mut Gatherer) -> Option<ParsedScene> {
    let mut fields = gatherer.object(tree, "")?;
    let version = fields.require("version", gatherer)?;
    if version.0.as_u64() != Some(u64::from(VERSION)) {
        // The rest of a document of another version cannot be judged.
        let message = format!(
            "expected {VERSION}, the only version that this release reads, got {}",
            short(&version.0)
        );
        gatherer.fault(version.1, message);
        return None;
    }
    let name = fields.take("name").and_then(|placed| name(placed, gatherer)).unwrap_or_else(|| id.to_owned());
    let origin = fields.take("origin").and_then(|placed| origin(placed, gatherer));
    let sky = fields.take("sky");
    let effects = fields.take("effects");
    let ground = gatherer.list(fields.take("ground"), MAX_POLYGONS);
    let boxes = gatherer.list(fields.take("boxes"), MAX_BOXES);
    let cylinders = gatherer.list(fields.take("cylinders"), shapes::MAX_CYLINDERS);
    let footprints = gatherer.list(fields.take("footprints"), shapes::MAX_FOOTPRINTS);
    let height_fields = gatherer.list(fields.take("height_fields"), shapes::MAX_HEIGHT_FIELDS);
    let models = gatherer.list(fields.take("models"), shapes::MAX_MODELS);
    let entities = fields.take("entities").and_then(|placed| entities(placed, gatherer)).unwrap_or_default();
    let sequences = gatherer.list(fields.take("sequences"), MAX_SEQUENCES);
    let cameras = gatherer.list(fields.take("cameras"), MAX_CAMERAS);
    let view = fields.take("view").and_then(|placed| view(placed, gatherer));
    fields.finish(gatherer);

    let ground = bounded(ground, gatherer);
    let mut painting = Painting::new(imports, origin.as_ref());
    let (sky_document, sky) = painting.sky(sky, gatherer);
    let (effects_document, effects) = super::effects::read(effects, &mut painting, gatherer);
    let mut ids = HashSet::new();
    let mut standing = Standing::default();
    let ground = standing.add(ground, |placed| {
        let place = placed.1.clone();
        let (document, made) = polygon(placed, gatherer)?;
        painting.painted((document, Shape::Ground(made)), &place, gatherer)
    });
    let boxes = standing.add(boxes, |placed| {
        let place = placed.1.clone();
        let (document, made) = upright_box(placed, &mut ids, gatherer)?;
        painting.painted((document, Shape::Box(made)), &place, gatherer)
    });
    let cylinders = standing.add(cylinders, |placed| {
        let place = placed.1.clone();
        let (document, made) = shapes::cylinder(placed, &mut ids, gatherer)?;
        painting.painted((document, Shape::Cylinder(made)), &place, gatherer)
    });
    let footprints = shapes::bounded_footprints(footprints, gatherer);
    let footprints = standing.add(footprints, |placed| {
        let place = placed.1.clone();
        let (document, made) = shapes::footprint(placed, &mut ids, gatherer)?;
        painting.painted((document, Shape::Footprint(made)), &place, gatherer)
    });
    let height_fields = shapes::bounded_fields(height_fields, gatherer);
    let height_fields = standing.add(height_fields, |placed| {
        let place = placed.1.clone();
        let (document, made) = shapes::height_field(placed, &mut ids, gatherer)?;
        painting.painted((document, Shape::HeightField(made)), &place, gatherer)
    });
    let mut n_left = shapes::max_triangles();
    let models = standing.add(models, |placed| {
        let (document, (mesh, material)) =
            shapes::model(placed, (&mut ids, &mut n_left), &mut painting.files, gatherer)?;
        Some((document, (Shape::Model(mesh), material)))
    });
    let imports = painting.files.imports();
    let mut ids = HashSet::new();
    let sequences = all(sequences, |placed| sequence(placed, &mut ids, imports, gatherer));
    let (sequence_documents, sequences): (Vec<_>, Vec<_>) = sequences.into_iter().unzip();
    let mut ids = HashSet::new();
    let cameras = all(cameras, |placed| camera(placed, &mut ids, imports, gatherer));

    let (camera_documents, cameras): (Vec<_>, Vec<SceneCamera>) = cameras.into_iter().unzip();
    if let Some(camera) = &effects.camera
        && !cameras.iter().any(|member| member.id == *camera)
    {
        gatherer.fault("/effects/relight/camera", format!("the scene has no camera `{camera}`"));
    }
    let document = SceneDocument {
        version: VERSION,
        name: name.clone(),
        origin,
        sky: sky_document,
        ground,
        boxes,
        cylinders,
        footprints,
        height_fields,
        models,
        sequences: sequence_documents,
        effects: effects_document,
        entities,
        cameras: camera_documents,
        view,
    };
    let scene = Scene {
        id: id.to_owned(),
        name,
        surfaces: Surfaces::new(standing.shapes),
        materials: standing.materials,
        sky,
        effects,
        min_entity_size_m: entities.min_size_m,
        sequences,
        cameras,
        view: view.map(|view| SceneView {
            eye: DVec3::from_array(view.eye_m),
            target: DVec3::from_array(view.target_m),
            fov_y_rad: view.fov_deg.to_radians(),
        }),
        document: document.to_json().into(),
    };
    Some(ParsedScene { scene, document })
}

/// Shapes and what they look like, in the order of [`Surfaces::shapes`].
#[derive(Default)]
struct Standing {
    shapes: Vec<Shape>,
    materials: Vec<Material>,
}

impl Standing {
    /// Reads shapes of one kind, though some are faulty, and adds the others; their documents come back.
    fn add<D>(
        &mut self,
        placed: Vec<Placed>,
        mut read: impl FnMut(Placed) -> Option<PaintedShape<D>>,
    ) -> Vec<D> {
        let add = |placed| {
            let (document, (shape, material)) = read(placed)?;
            self.materials.push(material);
            self.shapes.push(shape);
            Some(document)
        };
        placed.into_iter().filter_map(add).collect()
    }
}

/// The polygons, unless they have too many corners together. Asked before any is looked at closely.
fn bounded(ground: Vec<Placed>, gatherer: &mut Gatherer) -> Vec<Placed> {
    let corners = |(value, _): &Placed| value.get("polygon").and_then(Value::as_array).map_or(0, Vec::len);
    if ground.iter().map(corners).sum::<usize>() <= MAX_CORNERS {
        return ground;
    }
    gatherer.fault("/ground", format!("at most {MAX_CORNERS} corners are allowed in all polygons together"));
    Vec::new()
}

/// Reads every element, though some are faulty.
fn all<T>(elements: Vec<Placed>, read: impl FnMut(Placed) -> Option<T>) -> Vec<T> {
    elements.into_iter().filter_map(read).collect()
}

fn name((value, place): Placed, gatherer: &mut Gatherer) -> Option<String> {
    let name: String = gatherer.read(value, &place)?;
    let count = name.chars().count();
    if !(1..=MAX_NAME_CHARS).contains(&count) || name.chars().any(char::is_control) {
        let message = format!("expected 1 to {MAX_NAME_CHARS} characters, none of them a control character");
        gatherer.fault(place, message);
    }
    Some(name)
}

fn entities((value, place): Placed, gatherer: &mut Gatherer) -> Option<EntitiesDocument> {
    let entities: EntitiesDocument = gatherer.read(value, &place)?;
    range(gatherer, &place, "min_size_m", entities.min_size_m, 0.0, 10.0, "metres");
    Some(entities)
}

fn origin((value, place): Placed, gatherer: &mut Gatherer) -> Option<OriginDocument> {
    let origin: OriginDocument = gatherer.read(value, &place)?;
    range(gatherer, &place, "latitude_deg", origin.latitude_deg, -90.0, 90.0, "degrees");
    range(gatherer, &place, "longitude_deg", origin.longitude_deg, -180.0, 180.0, "degrees");
    range(gatherer, &place, "height_m", origin.height_m, -20_000.0, 100_000.0, "metres");
    Some(origin)
}

fn view((value, place): Placed, gatherer: &mut Gatherer) -> Option<ViewDocument> {
    let view: ViewDocument = gatherer.read(value, &place)?;
    for (key, point) in [("eye_m", view.eye_m), ("target_m", view.target_m)] {
        if !point.iter().all(|value| value.abs() <= MAX_VIEW_M) {
            let message = format!("expected three numbers within {MAX_VIEW_M:e} of the origin (metres)");
            gatherer.fault(pointer_to(&place, key), message);
        }
    }
    if DVec3::from_array(view.eye_m).distance(DVec3::from_array(view.target_m)) < MIN_VIEW_DISTANCE_M {
        let message = "must differ from eye_m: the view has no direction";
        gatherer.fault(pointer_to(&place, "target_m"), message);
    }
    range(gatherer, &place, "fov_deg", view.fov_deg, 1.0, 170.0, "degrees");
    Some(view)
}

fn polygon((value, place): Placed, gatherer: &mut Gatherer) -> Option<(GroundDocument, GroundPolygon)> {
    let document: GroundDocument = gatherer.read(value, &place)?;
    let corners = &document.polygon;
    let at = |key: &str| pointer_to(&place, key);
    let made =
        GroundPolygon::new(corners.iter().copied().map(DVec2::from_array).collect(), document.height_m);
    if !shapes::outline_is_sound(corners, &made, &place, gatherer) {
        return None;
    }
    match made {
        Ok(polygon) => Some((document, polygon)),
        Err(error) => {
            let is_height = matches!(error, SurfaceError::NotFinite { field: "the height" });
            gatherer.fault(at(if is_height { "height_m" } else { "polygon" }), error.to_string());
            None
        }
    }
}

fn upright_box(
    (value, place): Placed,
    ids: &mut HashSet<String>,
    gatherer: &mut Gatherer,
) -> Option<(BoxDocument, OrientedBox)> {
    let document: BoxDocument = gatherer.read(value, &place)?;
    shapes::unique_id(&document.id, (&place, "box"), ids, gatherer);
    range(gatherer, &place, "yaw_deg", document.yaw_deg, -360.0, 360.0, "degrees");
    let center = DVec3::from_array(document.center_m);
    let size = DVec3::from_array(document.size_m);
    match OrientedBox::new(center, size, document.yaw_deg.to_radians()) {
        Ok(made) => Some((document, made)),
        Err(error) => {
            let key = match error {
                SurfaceError::NotFinite { field: "the yaw" } => "yaw_deg",
                SurfaceError::NotFinite { .. } => "center_m",
                _ => "size_m",
            };
            gatherer.fault(pointer_to(&place, key), error.to_string());
            None
        }
    }
}

fn sequence(
    (value, place): Placed,
    ids: &mut HashSet<String>,
    imports: &mut dyn Imports,
    gatherer: &mut Gatherer,
) -> Option<(SceneSequenceDocument, SceneSequence)> {
    let document: SceneSequenceDocument = gatherer.read(value, &place)?;
    shapes::unique_id(&document.id, (&place, "sequence"), ids, gatherer);
    match imports.path(&document.file) {
        Ok(path) => {
            let made = SceneSequence { id: document.id.clone(), path, repeats: document.repeats };
            Some((document, made))
        }
        Err(message) => {
            gatherer.fault(pointer_to(&place, "file"), message);
            None
        }
    }
}

fn camera(
    (value, place): Placed,
    ids: &mut HashSet<CameraId>,
    imports: &mut dyn Imports,
    gatherer: &mut Gatherer,
) -> Option<(SceneCameraDocument, SceneCamera)> {
    let mut fields = gatherer.object(value, &place)?;
    let id = fields.require("id", gatherer);
    let calibration = fields.require("calibration", gatherer);
    fields.finish(gatherer);
    let id: Option<CameraId> = id.and_then(|(value, place)| {
        let id = gatherer.read::<CameraId>(value, &place)?;
        if !ids.insert(id.clone()) {
            gatherer.fault(place, format!("there is another camera `{id}`; ids are unique"));
        }
        Some(id)
    });
    let (calibration, place) = calibration?;
    let calibration = if calibration.get("import").is_some() {
        import((calibration, place.clone()), imports, gatherer)?
    } else {
        gatherer.read::<CameraDocument>(calibration, &place)?
    };
    match calibration.to_camera() {
        // Made from the normalised document, so that to read that again gives the same camera to the last bit.
        Ok(camera) => {
            let id = id?;
            Some((
                SceneCameraDocument { id: id.clone(), calibration },
                SceneCamera { id, camera: Arc::new(camera) },
            ))
        }
        Err(fault) => {
            gatherer.fault(format!("{place}{}", fault.place), fault.message);
            None
        }
    }
}

fn import(
    (value, place): Placed,
    imports: &mut dyn Imports,
    gatherer: &mut Gatherer,
) -> Option<CameraDocument> {
    let mut fields = gatherer.object(value, &place)?;
    let (reference, place) = fields.require("import", gatherer)?;
    fields.finish(gatherer);
    let reference: ImportReference = gatherer.read(reference, &place)?;
    if gatherer.is_faulty(&place) {
        return None;
    }
    match imports.calibration(&reference) {
        Ok(camera) => Some(CameraDocument::from_camera(&camera)),
        Err(message) => {
            gatherer.fault(place, message);
            None
        }
    }
}

pub(super) fn range(
    gatherer: &mut Gatherer,
    place: &str,
    key: &str,
    value: f64,
    least: f64,
    most: f64,
    unit: &str,
) {
    if !(least..=most).contains(&value) {
        gatherer.fault(pointer_to(place, key), format!("expected {least} to {most} {unit}, got {value}"));
    }
}

/// A value for a message.
fn short(value: &Value) -> String {
    value.to_string().chars().take(40).collect()
}
