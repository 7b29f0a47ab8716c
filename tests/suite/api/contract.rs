//! The contract: the document that the interface tells of itself, held against what it does.

use super::Bench;
use axum::body::Body;
use axum::http::Request;
use serde_json::Value;
use std::collections::BTreeSet;

pub(super) const CONTRACT: &str = "/api/v1/openapi.json";

const METHODS: [&str; 5] = ["get", "post", "put", "patch", "delete"];

pub(super) async fn document(bench: &Bench) -> Value {
    let answer = bench.get(CONTRACT).await;
    assert_eq!((answer.status.as_u16(), answer.field("content-type")), (200, "application/json"));
    answer.json()
}

/// Every method that is described: path, method, description.
pub(super) fn operations(document: &Value) -> Vec<(&str, &str, &Value)> {
    let paths = document["paths"].as_object().unwrap();
    assert!(paths.len() > 20, "{}", paths.len());
    paths
        .iter()
        .flat_map(|(path, item)| {
            METHODS.iter().filter_map(move |method| Some((path.as_str(), *method, item.get(method)?)))
        })
        .collect()
}

/// Every reference in it.
pub(super) fn references(of: &Value, found: &mut BTreeSet<String>) {
    match of {
        Value::Object(members) => {
            found.extend(members.get("$ref").and_then(Value::as_str).map(str::to_owned));
            members.values().for_each(|member| references(member, found));
        }
        Value::Array(items) => items.iter().for_each(|item| references(item, found)),
        _ => {}
    }
}

#[tokio::test]
async fn the_contract_holds_together() {
    let document = document(&Bench::new()).await;
    assert_eq!(document["openapi"], "3.1.0");
    let mut found = BTreeSet::new();
    references(&document, &mut found);
    assert!(found.len() > 20, "{found:?}");
    for reference in found {
        let pointer = reference.strip_prefix('#').unwrap();
        assert!(document.pointer(pointer).is_some(), "{reference} leads nowhere");
    }
    for (path, method, operation) in operations(&document) {
        let names: BTreeSet<&str> = path.split(['{', '}']).skip(1).step_by(2).collect();
        let declared: Vec<&str> = operation["parameters"]
            .as_array()
            .into_iter()
            .flatten()
            .filter(|parameter| parameter["in"] == "path")
            .map(|parameter| parameter["name"].as_str().unwrap())
            .collect();
        assert_eq!(declared.len(), names.len(), "{method} {path}: {declared:?}");
        assert_eq!(declared.into_iter().collect::<BTreeSet<_>>(), names, "{method} {path}");
    }
}

#[tokio::test]
async fn who_has_the_contract_is_spared_it() {
    let bench = Bench::new();
    let tag = bench.get(CONTRACT).await.field("etag").to_owned();
    let again = |tag: &str| Request::get(CONTRACT).header("if-none-match", tag).body(Body::empty()).unwrap();
    let answer = bench.send(again(&tag)).await;
    assert_eq!((answer.status.as_u16(), answer.body.len(), answer.field("etag")), (304, 0, tag.as_str()));
    assert_eq!(bench.send(again("\"other\"")).await.status.as_u16(), 200);
}

#[tokio::test]
async fn methods_that_are_not_described_are_refused_with_those_that_are() {
    let bench = Bench::new();
    let document = document(&bench).await;
    let paths = document["paths"].as_object().unwrap();
    for (path, item) in paths {
        let mut allowed = Vec::new();
        for method in METHODS.iter().filter(|method| item.get(method).is_some()) {
            allowed.push(method.to_uppercase());
            allowed.extend((*method == "get").then(|| "HEAD".to_owned()));
        }
        let allowed = allowed.join(", ");
        let target = path.replace(['{', '}'], "");
        for method in ["GET", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "BREW"] {
            if allowed.split(", ").any(|other| other == method) {
                continue;
            }
            let request = Request::builder().method(method).uri(&target).body(Body::empty()).unwrap();
            let answer = bench.send(request).await;
            answer.problem(405, &target);
            assert_eq!(answer.field("allow"), allowed, "{method} {path}");
        }
    }
}

#[tokio::test]
async fn the_daemon_says_what_it_is_and_what_it_holds_requests_to() {
    let system = Bench::new().get("/api/v1/system").await;
    assert_eq!((system.status.as_u16(), system.field("cache-control")), (200, "no-store"));
    let system = system.json();
    assert_eq!(system["device"]["adapter"], "llvmpipe");
    assert_eq!(system["counts"]["cameras"], 2, "{system}");
    assert_eq!(system["limits"]["target_bytes"], 2048, "{system}");
    assert!(system["uptime_secs"].is_u64(), "{system}");
    // Nothing is kept beside a stand-in.
    assert!(system["database"].is_null() && system["accounts"].is_null(), "{system}");
}
