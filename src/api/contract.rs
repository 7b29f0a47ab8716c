//! `/api/v1/openapi.json`: the contract of this interface as an OpenAPI 3.1 document, written of what the routes
//! register ([`openapi`](super::openapi)) and of nothing else.

use super::conditions::is_fresh;
use super::error::{PROBLEMS, Problem};
use super::openapi::{Route, Routes, Verb};
use super::operation::{Answer, Conditions, Operation, Segmented};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::{identity, schema};
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::sync::LazyLock;
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::path::{
    Operation as Described, OperationBuilder, Parameter as DescribedParameter, ParameterBuilder, ParameterIn,
};
use utoipa::openapi::request_body::RequestBodyBuilder;
use utoipa::openapi::schema::{Components, ComponentsBuilder};
use utoipa::openapi::security::{
    ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme,
};
use utoipa::openapi::tag::TagBuilder;
use utoipa::openapi::{
    ContentBuilder, HeaderBuilder, HttpMethod, Info, License, OpenApi, OpenApiBuilder, PathItem, Paths, Ref,
    RefOr, Required, ResponseBuilder, Server,
};

/// The document as it is answered, with its entity tag.
struct Contract {
    text: Vec<u8>,
    etag: String,
}

/// It follows from the program alone.
static CONTRACT: LazyLock<Contract> = LazyLock::new(|| {
    let text = serde_json::to_vec_pretty(&document(&super::described())).unwrap_or_default();
    let digest = Sha256::digest(&text);
    let etag = digest[..8].iter().fold("\"".to_owned(), |etag, byte| format!("{etag}{byte:02x}")) + "\"";
    Contract { text, etag }
});

/// Routes about the interface itself.
pub(super) fn routes() -> Routes {
    let show = Operation::new("show_contract", "This document")
        .about("The whole interface as an OpenAPI 3.1 document. It changes with the program alone.")
        .open()
        .revalidated()
        .answers(
            Answer::json(200, "The document", json!({"type": "object"}))
                .field("ETag", "Of the whole document; `If-None-Match` takes it"),
        );
    Routes::of(("System", "The daemon itself"), NONE).get("/api/v1/openapi.json", answer, show)
}

async fn answer(RawQuery(raw): RawQuery, headers: HeaderMap) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let Contract { text, etag } = &*CONTRACT;
    let fields = [(header::ETAG, etag.as_str()), (header::CACHE_CONTROL, "no-cache")];
    if is_fresh(&headers, etag) {
        return Ok((StatusCode::NOT_MODIFIED, fields).into_response());
    }
    Ok((fields, [(header::CONTENT_TYPE, "application/json")], text.as_slice()).into_response())
}

/// The document of these routes, with its members in the order of their names.
fn document(routes: &Routes) -> Value {
    let mut paths = Paths::new();
    for route in &routes.routes {
        let described = PathItem::new(method(route.verb), operation(route));
        match paths.paths.get_mut(route.path) {
            Some(item) => item.merge_operations(described),
            None => drop(paths.paths.insert(route.path.to_owned(), described)),
        }
    }
    let mut tags: Vec<_> = routes.routes.iter().map(|route| route.tag).collect();
    tags.sort_unstable();
    tags.dedup();
    let tags = tags
        .into_iter()
        .map(|(name, meaning)| TagBuilder::new().name(name).description(Some(meaning)).build());
    let mut info = Info::new("videofields", env!("CARGO_PKG_VERSION"));
    info.description = Some(ABOUT.to_owned());
    let mut license = License::new(env!("CARGO_PKG_LICENSE"));
    license.identifier = Some(env!("CARGO_PKG_LICENSE").to_owned());
    info.license = Some(license);
    let document: OpenApi = OpenApiBuilder::new()
        .info(info)
        // Where the document itself was found.
        .servers(Some([Server::new("/")]))
        .paths(paths)
        .components(Some(components()))
        .security(Some(credentials()))
        .tags(Some(tags))
        .build();
    // By way of a value, so that the order of members never changes.
    let mut document = serde_json::to_value(document).unwrap_or_default();
    for route in &routes.routes {
        require_fields(&mut document, route);
    }
    document
}

/// Marks the fields of answers that always come, for which the document's types have no word.
fn require_fields(document: &mut Value, route: &Route) {
    let method = route.verb.names()[0].to_lowercase();
    for answer in &route.operation.answers {
        let response = &mut document["paths"][route.path][&method]["responses"][answer.status.to_string()];
        for (name, _) in &answer.fields {
            response["headers"][name]["required"] = json!(true);
        }
    }
}

const fn method(verb: Verb) -> HttpMethod {
    match verb {
        Verb::Get => HttpMethod::Get,
        Verb::Post => HttpMethod::Post,
        Verb::Put => HttpMethod::Put,
        Verb::Patch => HttpMethod::Patch,
        Verb::Delete => HttpMethod::Delete,
    }
}

fn operation(route: &Route) -> Described {
    let Route { operation, .. } = route;
    let named: Vec<&str> = names(route.path).collect();
    let segmented = if named.is_empty() { Segmented::No } else { Segmented::Yes };
    let mut described = OperationBuilder::new()
        .tag(route.tag.0)
        .operation_id(Some(operation.id))
        .summary(Some(operation.summary))
        .extensions(Some(operation.extensions().into_iter().collect::<Extensions>()));
    if !operation.description.is_empty() {
        described = described.description(Some(operation.description.as_str()));
    }
    for name in named {
        // A name without a description is found by the tests.
        for segment in route.segments.iter().filter(|segment| segment.name == name) {
            described = described.parameter(parameter(&segment.required(), ParameterIn::Path));
        }
    }
    for wanted in &operation.parameters {
        described = described.parameter(parameter(wanted, ParameterIn::Query));
    }
    let once: &[Field] = if operation.is_once { &[ONCE] } else { &[] };
    for (name, meaning, shape) in conditions(operation.conditions).iter().chain(once) {
        let field = ParameterBuilder::new().name(*name).parameter_in(ParameterIn::Header);
        let field = field.description(Some(*meaning)).required(Required::False);
        described = described.parameter(field.schema(Some(schema::read(shape.schema()))));
    }
    if !operation.bodies.is_empty() {
        let needed = if operation.needs_body { Required::True } else { Required::False };
        let body = RequestBodyBuilder::new().required(Some(needed));
        let body = operation.bodies.iter().fold(body, |body, (media_type, shape)| {
            body.content(*media_type, ContentBuilder::new().schema(Some(schema::read(shape.clone()))).build())
        });
        described = described.request_body(Some(body.build()));
    }
    for status in operation.failures(route.verb.kind(), segmented) {
        let name = PROBLEMS.iter().find(|(of, ..)| *of == status).map_or("Internal", |(_, name, _)| name);
        described = described.response(status.to_string(), Ref::from_response_name(name));
    }
    for answer in &operation.answers {
        described = described.response(answer.status.to_string(), response(answer));
    }
    if operation.is_open {
        described = described.securities(Some([SecurityRequirement::default()]));
    }
    described.build()
}

/// The names of a path's segments.
fn names(path: &str) -> impl Iterator<Item = &str> {
    path.split('/').filter_map(|segment| segment.strip_prefix('{')?.strip_suffix('}'))
}

fn parameter(of: &Parameter, place: ParameterIn) -> DescribedParameter {
    ParameterBuilder::new()
        .name(of.name)
        .parameter_in(place)
        .description(Some(of.meaning))
        .required(if of.is_required { Required::True } else { Required::False })
        .schema(Some(schema::read(of.schema())))
        .build()
}

/// A field of a request: its name, its meaning, and what is read.
type Field = (&'static str, &'static str, Shape);

/// What a field's text may be.
#[derive(Clone, Copy)]
enum Shape {
    Any,
    Only(&'static str),
    Pattern(&'static str),
    Either(&'static [Self]),
}

impl Shape {
    fn schema(self) -> Value {
        match self {
            Self::Any => json!({"type": "string"}),
            Self::Only(word) => json!({"type": "string", "enum": [word]}),
            Self::Pattern(pattern) => json!({"type": "string", "pattern": pattern}),
            Self::Either(shapes) => {
                json!({"anyOf": shapes.iter().map(|shape| shape.schema()).collect::<Vec<_>>()})
            }
        }
    }
}

/// The key of a job.
const ONCE: Field = (
    "Idempotency-Key",
    "Names the job: asked for again with the same key and body within a day, it is answered as the first time and not made anew",
    Shape::Either(&[Shape::Pattern("^[!#-~]{1,255}$"), Shape::Pattern("^\"[!#-~]{1,255}\"$")]),
);

const fn conditions(of: Conditions) -> &'static [Field] {
    match of {
        Conditions::None => &[],
        Conditions::Change | Conditions::MayChange => &[
            (
                "If-Match",
                "The `ETag` of what is changed, or `*` for whichever version there is; not beside `If-None-Match`",
                Shape::Either(&[Shape::Only("*"), Shape::Pattern("^(W/)?\"[!#-~]{1,64}\"$")]),
            ),
            ("If-None-Match", "`*`: only where there is none yet", Shape::Only("*")),
        ],
        Conditions::Look => &[("If-None-Match", "The `ETag` of what the caller has", Shape::Any)],
        Conditions::File => &[
            (
                "Range",
                "One range of bytes, as `bytes=0-1023`; what is none, or several, is as if it were not there",
                Shape::Any,
            ),
            (
                "If-Modified-Since",
                "Only if it is younger: the `Last-Modified` of what the caller has",
                Shape::Any,
            ),
            ("If-Unmodified-Since", "Only if it is no younger", Shape::Any),
        ],
        Conditions::Resume => &[(
            "Last-Event-ID",
            "Goes on after the event of that `id`; stands above `after`",
            Shape::Pattern("^([0-9]{1,15}|[0-8][0-9]{15})$"),
        )],
    }
}

fn response(answer: &Answer) -> RefOr<utoipa::openapi::Response> {
    let mut response = ResponseBuilder::new().description(answer.meaning);
    for (media_type, shape) in &answer.contents {
        let content = ContentBuilder::new().schema(shape.clone().map(schema::read));
        response = response.content(*media_type, content.build());
    }
    for (name, meaning) in answer.fields.iter().chain(&answer.optional_fields) {
        let field = HeaderBuilder::new().description(Some(*meaning));
        response =
            response.header(*name, field.schema(Some(schema::read(json!({"type": "string"})))).build());
    }
    response.into()
}

/// The ways to say who asks; any of them will do.
fn credentials() -> [SecurityRequirement; 2] {
    let no_scopes: [&str; 0] = [];
    [SecurityRequirement::new("token", no_scopes), SecurityRequirement::new("session", no_scopes)]
}

fn components() -> Components {
    let mut components = ComponentsBuilder::new();
    for (name, shape) in schema::all_named() {
        components = components.schema(name, schema::read(shape()));
    }
    for (status, name, meaning) in PROBLEMS {
        let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
        let mut response =
            ResponseBuilder::new().description(meaning).content("application/problem+json", content);
        let field = match status {
            401 => Some(("WWW-Authenticate", "How to say who asks")),
            429 | 503 => Some(("Retry-After", "Seconds after which it may be asked again")),
            _ => None,
        };
        if let Some((field, meaning)) = field {
            let field_schema = schema::read(json!({"type": "string"}));
            let described = HeaderBuilder::new().description(Some(meaning)).schema(Some(field_schema));
            response = response.header(field, described.build());
        }
        components = components.response(name, response);
    }
    let token = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .description(Some("A token of a user: it begins with `vf_` (`POST /api/v1/tokens`)"))
        .build();
    let cookie = ApiKeyValue::with_description(
        identity::COOKIE,
        "The cookie of a page that logged in (`POST /api/v1/session`); changes need `X-CSRF-Token` beside it, with what \
         `GET /api/v1/session` tells",
    );
    components
        .security_scheme("token", SecurityScheme::Http(token))
        .security_scheme("session", SecurityScheme::ApiKey(ApiKey::Cookie(cookie)))
        .build()
}

/// What holds for the whole interface.
const ABOUT: &str = include_str!("contract.md");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_schema_is_lost() {
        for (name, shape) in schema::all_named() {
            let written = serde_json::to_value(schema::read(shape())).unwrap();
            assert_eq!(plain(written), plain(shape()), "{name}");
        }
    }

    /// With whole numbers as such: 16 and 16.0 are one number in JSON.
    fn plain(value: Value) -> Value {
        match value {
            Value::Number(number) => match number.as_f64() {
                Some(float) if float.fract() == 0.0 && float.abs() < 1e15 => Value::from(float as i64),
                _ => Value::Number(number),
            },
            Value::Array(values) => values.into_iter().map(plain).collect(),
            Value::Object(members) => members.into_iter().map(|(name, value)| (name, plain(value))).collect(),
            other => other,
        }
    }

    #[test]
    fn every_status_of_failure_is_described() {
        for route in super::super::described().routes {
            for status in route.operation.failures(route.verb.kind(), Segmented::Yes) {
                let is_known = PROBLEMS.iter().any(|(known, ..)| *known == status);
                assert!(is_known, "{} {}: {status}", route.path, route.operation.id);
            }
        }
    }
}
