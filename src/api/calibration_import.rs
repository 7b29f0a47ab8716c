//! `POST /api/v1/calibrations/import`: other programs' calibrations read and told as ours, and kept nowhere; and how a
//! calibration's text is read wherever one comes.

use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter, words};
use super::query::Query;
use super::tune::refuse_foreign;
use super::{Api, cameras, schema};
use axum::Json;
use axum::body::Bytes;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;
use videofields_vision::access::Role;
use videofields_vision::calibrate::{self, CalibrateError, CameraDocument, Format, ImportOptions, Imported};
use videofields_vision::error::{ErrorKind, Fault};

const FORMATS: [(&str, Format); 3] =
    [("json", Format::Json), ("opencv", Format::OpenCv), ("tsai", Format::PetsXml)];

/// How a text is written.
pub(super) const FORMAT: Parameter =
    Parameter::word("format", || words(&FORMATS), "How the body is written; told from the text without it");

/// Which camera of several.
pub(super) const ENTRY: Parameter =
    Parameter::free("entry", (1, 200), "Which camera of a text that holds several, by its name there");

/// The size of the picture.
pub(super) const IMAGE_SIZE: Parameter = Parameter::text(
    "image_size_px",
    ("^([1-9][0-9]{0,3}|[1-5][0-9]{4})x([1-9][0-9]{0,3}|[1-5][0-9]{4})$", "768x576"),
    "Columns and rows of the calibrated picture, where the text does not say",
);

/// The text's unit.
pub(super) const METRES_PER_UNIT: Parameter =
    Parameter::number("metres_per_unit", &(1e-9..=1e9), "Length of the text's unit in metres");

const PARAMETERS: &[Parameter] = &[FORMAT, ENTRY, IMAGE_SIZE, METRES_PER_UNIT];

/// The route that reads and keeps nothing.
pub(super) fn routes() -> Routes {
    let import = Operation::new("read_calibration", "Reads another program's calibration and keeps nothing")
        .keeps_nothing()
        .about("As `PUT` of a camera's calibration reads it.")
        .role(Role::Operator)
        .parameters(PARAMETERS)
        .takes(json!({"anyOf": [schema::named("Calibration"), schema::anything()]}))
        .takes_media("application/yaml", schema::text())
        .takes_media("application/xml", schema::text())
        .may_fail(&[422, 501])
        .answers(Answer::json(200, "What it says", schema::calibrations::imported()));
    Routes::of(cameras::TAG, NONE).post("/api/v1/calibrations/import", self::import, import)
}

/// What a calibration's text says, as a scene's document has it.
pub(super) async fn import(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    let reading = Reading::read(&mut query);
    let reading = query.finish(Some(reading))?;
    refuse_foreign(&api.site, &headers)?;
    api.check_operator("reading calibrations")?;
    let Imported { camera, residual_px } = taken(&api, &body, reading).await?;
    let told = json!({ "calibration": CameraDocument::from_camera(&camera), "residual_px": residual_px });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(told)).into_response())
}

/// How a text is to be read, as a query says it.
pub(super) struct Reading {
    format: Option<Format>,
    options: ImportOptions,
}

impl Reading {
    pub(super) fn read(query: &mut Query) -> Self {
        let format = query.choice("format", &FORMATS);
        let camera = query.value("entry", "a name of 1 to 200 characters", |text| {
            (1..=200).contains(&text.chars().count()).then(|| text.to_owned())
        });
        let image_size_px =
            query.value("image_size_px", "columns x rows, each 1 to 65536, such as 768x576", |text| {
                let (width, height) = text.split_once('x')?;
                let side = |text: &str| text.parse().ok().filter(|side| (1..=65_536).contains(side));
                Some([side(width)?, side(height)?])
            });
        let metres_per_unit = query.number("metres_per_unit", &(1e-9..=1e9), " m");
        Self { format, options: ImportOptions { image_size_px, camera, metres_per_unit } }
    }
}

/// The camera that a body's text describes.
pub(super) async fn taken(api: &Api, body: &Bytes, reading: Reading) -> Result<Imported, Problem> {
    let text = String::from_utf8(body.to_vec()).map_err(|error| {
        let message = format!("the text must be UTF-8, but byte {} is not", error.utf8_error().valid_up_to());
        Problem::at(ErrorKind::Invalid, vec![Fault::new("", message)])
    })?;
    let Reading { format, options } = reading;
    // A lens model that is not ours is fitted, which takes its time.
    let read = api
        .compute("reading a calibration", move |_door| Ok(calibrate::import(&text, format, &options)))
        .await?;
    read.map_err(|error| refused(&error))
}

/// Why a text is no calibration, at its place in the text or in the query.
fn refused(error: &CalibrateError) -> Problem {
    let fault = match error {
        CalibrateError::Invalid(fault) | CalibrateError::Unsupported(fault) => fault.clone(),
        CalibrateError::UnknownFormat => Fault::new("format", error.to_string()),
        CalibrateError::NoSuchCamera { .. } | CalibrateError::CameraNotNamed { .. } => {
            // What the text holds, and not what there is here.
            return Problem::at(ErrorKind::Invalid, vec![Fault::new("entry", error.to_string())]);
        }
        CalibrateError::TooLong { .. } | CalibrateError::Syntax { .. } => Fault::new("", error.to_string()),
    };
    Problem::at(error.kind(), vec![fault])
}
