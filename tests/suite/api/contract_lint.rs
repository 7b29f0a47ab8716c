//! The contract as a document: kept as a golden, whole, and with nothing in it that nobody needs.

use super::Bench;
use super::contract::{CONTRACT, document, operations, references};
use serde_json::Value;
use std::collections::BTreeSet;
use videofields_testing::{golden, schema};

/// What every operation may answer, whatever it is for.
const ALWAYS: [&str; 7] = ["400", "401", "414", "421", "431", "500", "503"];

/// A part that is not ready is told as one that is.
const NO_PROBLEM: [(&str, &str); 1] = [("show_readiness", "503")];

/// What a reference stands for, or what is there itself.
fn resolved<'a>(document: &'a Value, part: &'a Value) -> &'a Value {
    match part["$ref"].as_str() {
        Some(reference) => document.pointer(reference.strip_prefix('#').unwrap()).unwrap(),
        None => part,
    }
}

fn described(part: &Value) -> bool {
    part["description"].as_str().is_some_and(|text| !text.is_empty())
}

#[tokio::test]
async fn the_contract_is_the_one_that_is_kept() {
    let answer = Bench::new().get(CONTRACT).await;
    golden::check_text("openapi.json", &(String::from_utf8(answer.body).unwrap() + "\n"));
}

#[tokio::test]
async fn the_contract_says_the_same_in_the_same_order_every_time() {
    let first = Bench::new().get(CONTRACT).await;
    let text = String::from_utf8(first.body).unwrap();
    assert_eq!(serde_json::to_string_pretty(&serde_json::from_str::<Value>(&text).unwrap()).unwrap(), text);
    assert_eq!(Bench::new().get(CONTRACT).await.body, text.as_bytes());
}

#[tokio::test]
async fn every_operation_says_what_it_is_for() {
    let document = document(&Bench::new()).await;
    let tags: Vec<&Value> = document["tags"].as_array().unwrap().iter().collect();
    assert!(tags.iter().all(|tag| described(tag)), "{tags:?}");
    let known: BTreeSet<&str> = tags.iter().map(|tag| tag["name"].as_str().unwrap()).collect();
    assert_eq!(known.len(), tags.len(), "{tags:?}");
    let mut used = BTreeSet::new();
    let mut ids = BTreeSet::new();
    for (path, method, operation) in operations(&document) {
        let id = operation["operationId"].as_str().unwrap();
        assert!(ids.insert(id), "{id} is there twice");
        assert!(id.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_'), "{id}");
        let summary = operation["summary"].as_str().unwrap();
        assert!((4..=100).contains(&summary.len()) && !summary.ends_with('.'), "{id}: {summary:?}");
        let [tag] = operation["tags"].as_array().unwrap().as_slice() else {
            panic!("{id}: more tags than one")
        };
        used.insert(tag.as_str().unwrap());
        let is_open = operation["security"] == serde_json::json!([{}]);
        assert_eq!(operation["x-videofields-role"].is_string(), !is_open, "{method} {path}");
    }
    assert_eq!(used, known);
}

#[tokio::test]
async fn every_parameter_is_described_and_its_examples_hold() {
    let document = document(&Bench::new()).await;
    for (path, method, operation) in operations(&document) {
        let mut names = BTreeSet::new();
        for parameter in operation["parameters"].as_array().into_iter().flatten() {
            let place = format!("{method} {path}: {}", parameter["name"]);
            let (kind, name) = (parameter["in"].as_str().unwrap(), parameter["name"].as_str().unwrap());
            assert!(names.insert((kind, name)), "{place} is there twice");
            assert!(described(parameter), "{place} is not described");
            assert!(parameter["in"] != "path" || parameter["required"] == true, "{place}");
            let shape = &parameter["schema"];
            let told = shape["examples"].as_array().into_iter().flatten().chain(shape.get("default"));
            for example in told {
                assert_eq!(schema::faults(&document, shape, example), Vec::<String>::new(), "{place}");
            }
        }
        if let Some(body) = operation.get("requestBody") {
            let contents = body["content"].as_object().unwrap();
            assert!(!contents.is_empty(), "{method} {path}");
            assert!(contents.values().all(|content| content["schema"].is_object()), "{method} {path}");
        }
    }
}

#[tokio::test]
async fn every_failure_is_described_as_a_problem_document() {
    let document = document(&Bench::new()).await;
    let problem = serde_json::json!({"schema": {"$ref": "#/components/schemas/Problem"}});
    for (path, method, operation) in operations(&document) {
        let id = operation["operationId"].as_str().unwrap();
        let responses = operation["responses"].as_object().unwrap();
        let mut wanted: Vec<&str> = ALWAYS.to_vec();
        wanted.extend(path.contains('{').then_some("404"));
        wanted.extend((method != "get").then_some("403"));
        wanted.extend(operation.get("requestBody").is_some().then_some(["408", "413"]).into_iter().flatten());
        for status in wanted {
            assert!(responses.contains_key(status), "{id} says nothing of {status}");
        }
        assert!(responses.keys().any(|status| ["1", "2"].contains(&&status[..1])), "{id} never goes well");
        for (status, response) in responses {
            let response = resolved(&document, response);
            assert!(described(response), "{id}: {status}");
            if status.as_str() < "400" || NO_PROBLEM.contains(&(id, status)) {
                continue;
            }
            let contents = response["content"].as_object().unwrap();
            assert_eq!(contents.get("application/problem+json"), Some(&problem), "{id}: {status}");
            assert_eq!(contents.len(), 1, "{id}: {status}");
        }
    }
}

#[tokio::test]
async fn every_part_is_needed_and_every_credential_is_known() {
    let document = document(&Bench::new()).await;
    let mut found = BTreeSet::new();
    references(&document, &mut found);
    for group in ["schemas", "responses"] {
        for name in document["components"][group].as_object().unwrap().keys() {
            let reference = format!("#/components/{group}/{name}");
            assert!(found.contains(&reference), "nothing needs {reference}");
        }
    }
    let schemes = &document["components"]["securitySchemes"];
    assert_eq!((&schemes["token"]["type"], &schemes["token"]["scheme"]), (&"http".into(), &"bearer".into()));
    assert_eq!(
        (&schemes["session"]["type"], &schemes["session"]["in"]),
        (&"apiKey".into(), &"cookie".into())
    );
    assert_eq!(schemes.as_object().unwrap().len(), 2);
    assert_eq!(document["security"], serde_json::json!([{"token": []}, {"session": []}]));
    for (path, method, operation) in operations(&document) {
        let own = operation.get("security");
        assert!(own.is_none_or(|own| *own == serde_json::json!([{}])), "{method} {path}: {own:?}");
    }
}
