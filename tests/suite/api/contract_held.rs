//! The contract held against answers: what is looked at holds to its schema, and queries take what is listed and nothing else.

use super::contract::{document, operations};
use super::users::{House, Shows};
use axum::body::{Body, HttpBody, to_bytes};
use axum::http::{HeaderMap, Request};
use serde_json::{Value, json};
use videofields_testing::schema;

/// What the stand-in has nothing of: 503 is answered instead.
const NOT_THERE: [&str; 1] = ["/api/v1/snapshots"];

/// What came back; a body without end is left where it is.
struct Told {
    status: u16,
    headers: HeaderMap,
    body: Option<Vec<u8>>,
}

impl Told {
    fn media_type(&self) -> &str {
        let field = self.headers.get("content-type").map_or("", |field| field.to_str().unwrap());
        field.split(';').next().unwrap()
    }

    fn json(&self) -> Value {
        self.body.as_deref().and_then(|body| serde_json::from_slice(body).ok()).unwrap_or_default()
    }

    /// What is said of a parameter.
    fn said_of(&self, name: &str) -> Vec<String> {
        let errors = self.json()["errors"].as_array().cloned().unwrap_or_default();
        let of_it = errors.iter().filter(|error| error["parameter"] == name);
        of_it.map(|error| error["detail"].as_str().unwrap().to_owned()).collect()
    }
}

async fn look(house: &House, token: &str, target: &str) -> Told {
    let request = Request::get(target).header("authorization", format!("Bearer {token}"));
    let response = house.bench.send_open(request.body(Body::empty()).unwrap()).await;
    let (parts, body) = response.into_parts();
    let body = match body.size_hint().exact() {
        Some(_) => Some(to_bytes(body, 1 << 24).await.unwrap().to_vec()),
        None => None,
    };
    Told { status: parts.status.as_u16(), headers: parts.headers, body }
}

/// With a wall, a view, a playhead and an export beside what the stand-in has.
pub(super) async fn furnished() -> (House, String) {
    let (house, token) = House::with_admin().await;
    let new = [("if-none-match", "*")];
    let wall = json!({
        "scene": "plaza", "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3]}},
    });
    let made = [
        ("PUT", "/api/v1/walls/control", wall),
        ("PUT", "/api/v1/views/gate", json!({"scene": "plaza"})),
        ("PUT", "/api/v1/playheads/wall", json!({})),
        ("POST", "/api/v1/exports", json!({"from": "0", "to": "1"})),
    ];
    for (method, path, body) in made {
        let fields = if method == "PUT" { &new[..] } else { &[] };
        let answer = house.send(method, path, Shows::Token(&token), fields, body).await;
        assert!(answer.status.is_success(), "{path}: {}", String::from_utf8_lossy(&answer.body));
    }
    (house, token)
}

/// A value that a parameter takes.
fn sample(parameter: &Value) -> String {
    let shape = &parameter["schema"];
    let told = shape["enum"].get(0).or(shape["examples"].get(0)).or(shape.get("default"));
    let told = told.or(shape.get("minimum")).cloned();
    match (told, shape["$ref"].as_str().unwrap_or_default()) {
        (Some(Value::String(text)), _) => text,
        (Some(number), _) => number.to_string(),
        (None, "#/components/schemas/Instant") => {
            (if parameter["name"] == "to" { "9" } else { "1" }).to_owned()
        }
        (None, "#/components/schemas/Moment") => "live".to_owned(),
        (None, _) if parameter["name"] == "scene" => "plaza".to_owned(),
        (None, _) => "north".to_owned(),
    }
}

/// A path of things that are there.
pub(super) fn path_of(template: &str, operation: &Value) -> String {
    let mut before = "";
    let mut path = String::new();
    for segment in template.split('/').skip(1) {
        let named = segment.strip_prefix('{').and_then(|segment| segment.strip_suffix('}'));
        path.push('/');
        path.push_str(&match (before, named) {
            (_, None) => segment.to_owned(),
            ("cameras" | "calibrations", _) => "north".to_owned(),
            ("scenes", _) => "plaza".to_owned(),
            ("walls", _) => "control".to_owned(),
            ("views", _) => "gate".to_owned(),
            ("playheads", _) => "wall".to_owned(),
            ("users", _) => "root".to_owned(),
            ("versions", _) => "1".to_owned(),
            ("tiles", _) => "r1c1".to_owned(),
            ("exports", _) => "20260301t120000z".to_owned(),
            (_, Some(name)) => {
                let parameters = operation["parameters"].as_array().unwrap();
                sample(parameters.iter().find(|parameter| parameter["name"] == name).unwrap())
            }
        });
        before = segment;
    }
    path
}

/// The parameters of a query that must be there, with values, and `more`.
pub(super) fn query_of(operation: &Value, more: Option<(&str, &str)>) -> String {
    let queried = operation["parameters"].as_array().into_iter().flatten();
    let needed = queried.filter(|parameter| parameter["in"] == "query" && parameter["required"] == true);
    let mut pairs: Vec<String> = needed
        .filter(|parameter| more.is_none_or(|(name, _)| parameter["name"] != name))
        .map(|parameter| format!("{}={}", parameter["name"].as_str().unwrap(), sample(parameter)))
        .collect();
    pairs.extend(more.map(|(name, value)| format!("{name}={value}")));
    pairs.join("&")
}

/// What an answer does not hold to of its description.
fn faults(document: &Value, operation: &Value, told: &Told) -> Vec<String> {
    let described = &operation["responses"][told.status.to_string()];
    let described = match described["$ref"].as_str() {
        Some(reference) => document.pointer(&reference[1..]).unwrap(),
        None => described,
    };
    if !described.is_object() {
        return vec![format!("{} is not described: {}", told.status, told.json())];
    }
    let fields = described["headers"].as_object().into_iter().flatten();
    let missing =
        fields.filter(|(name, field)| field["required"] == true && !told.headers.contains_key(*name));
    let mut faults: Vec<String> = missing.map(|(name, _)| format!("{name} is missing")).collect();
    let Some(contents) = described["content"].as_object() else { return faults };
    let content = contents.iter().find(|(named, _)| named.split(';').next() == Some(told.media_type()));
    match content.map(|(_, content)| content) {
        None => faults.push(format!("{:?} is not described", told.media_type())),
        Some(content) if told.media_type().ends_with("json") => {
            faults.extend(schema::faults(document, &content["schema"], &told.json()));
        }
        Some(_) => {}
    }
    faults
}

#[tokio::test]
async fn what_is_looked_at_holds_to_its_schema() {
    let (house, token) = furnished().await;
    let document = document(&house.bench).await;
    let (mut n_held, mut n_whole) = (0, 0);
    let mut wrong = Vec::new();
    for (template, method, operation) in operations(&document) {
        if method != "get" {
            continue;
        }
        let target = format!("{}?{}", path_of(template, operation), query_of(operation, None));
        let told = look(&house, &token, &target).await;
        wrong.extend(
            faults(&document, operation, &told).into_iter().map(|fault| format!("{target}: {fault}")),
        );
        n_held += 1;
        if !template.contains('{') && !NOT_THERE.contains(&template) && told.status != 200 {
            wrong.push(format!("{target}: {} {}", told.status, told.json()));
        }
        n_whole += usize::from(told.status == 200);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(n_held > 50 && n_whole > 40, "{n_held} held, {n_whole} of them went well");
}

#[tokio::test]
async fn queries_take_what_is_listed_and_nothing_else() {
    const REFUSAL: &str = "is not a parameter here";
    let (house, token) = furnished().await;
    let document = document(&house.bench).await;
    let mut n_taken = 0;
    let mut wrong = Vec::new();
    for (template, method, operation) in operations(&document) {
        if method != "get" {
            continue;
        }
        let path = path_of(template, operation);
        let parameters = operation["parameters"].as_array().into_iter().flatten();
        for parameter in parameters.filter(|parameter| parameter["in"] == "query") {
            let name = parameter["name"].as_str().unwrap();
            let target = format!("{path}?{}", query_of(operation, Some((name, &sample(parameter)))));
            let said = look(&house, &token, &target).await.said_of(name);
            wrong.extend(said.iter().any(|said| said.contains(REFUSAL)).then_some(target));
            n_taken += 1;
        }
        // What asks for no WebSocket is told so first, and a probe is answered whatever else it is asked.
        let is_socket = operation["responses"]["101"].is_object();
        let is_probe = !template.starts_with("/api/");
        if is_socket || is_probe || NOT_THERE.iter().any(|of| template.starts_with(of)) {
            continue;
        }
        let target = format!("{path}?{}", query_of(operation, Some(("undescribed", "1"))));
        let told = look(&house, &token, &target).await;
        if told.status != 400 || !told.said_of("undescribed").iter().any(|said| said.contains(REFUSAL)) {
            wrong.push(format!("{target}: {} {}", told.status, told.json()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(n_taken > 100, "{n_taken}");
}

#[tokio::test]
async fn what_no_answer_gave_is_no_cursor() {
    let (house, token) = furnished().await;
    let document = document(&house.bench).await;
    let mut n_refused = 0;
    for (template, method, operation) in operations(&document) {
        let mut parameters = operation["parameters"].as_array().into_iter().flatten();
        if method != "get" || !parameters.any(|parameter| parameter["name"] == "cursor") {
            continue;
        }
        for cursor in ["0.5", "", "a%20b", &"7".repeat(201)] {
            let query = query_of(operation, Some(("cursor", cursor)));
            let target = format!("{}?{query}", path_of(template, operation));
            let told = look(&house, &token, &target).await;
            if NOT_THERE.contains(&template) {
                continue;
            }
            assert_eq!(told.status, 400, "{target}: {}", told.json());
            assert_eq!(told.said_of("cursor").len(), 1, "{target}: {}", told.json());
            n_refused += 1;
        }
    }
    assert!(n_refused >= 20, "{n_refused}");
}
