//! Jobs that are asked for twice with one key.

use super::{Answer, Bench};
use axum::body::Body;
use axum::http::Request;
use serde_json::json;

const EXPORTS: &str = "/api/v1/exports";

async fn ask(bench: &Bench, key: &str, body: &str) -> Answer {
    let request = Request::post(EXPORTS).header("idempotency-key", key).body(Body::from(body.to_owned()));
    bench.send(request.unwrap()).await
}

fn n_made(bench: &Bench) -> usize {
    bench.door.0.lock().unwrap().exports.len()
}

#[tokio::test]
async fn a_job_that_is_asked_for_again_with_its_key_is_made_once() {
    let bench = Bench::new();
    let first = ask(&bench, "\"case-7\"", r#"{"note": "case 7"}"#).await;
    assert_eq!((first.status.as_u16(), first.field("idempotency-replayed")), (202, "(absent)"));
    let again = ask(&bench, "\"case-7\"", r#"{"note": "case 7"}"#).await;
    assert_eq!((again.status.as_u16(), again.field("idempotency-replayed")), (202, "true"));
    assert_eq!(again.body, first.body);
    for field in ["location", "content-type", "cache-control"] {
        assert_eq!(again.field(field), first.field(field), "{field}");
    }
    assert_eq!(n_made(&bench), 1);
    let problem = ask(&bench, "\"case-7\"", r#"{"note": "case 8"}"#).await.problem(422, EXPORTS);
    assert_eq!(problem["type"], "urn:videofields:problem:key-reused");
    assert_eq!(n_made(&bench), 1);
    assert_eq!(ask(&bench, "case-8", r#"{"note": "case 8"}"#).await.status.as_u16(), 202);
    // Without a key everything is another job.
    for _ in 0..2 {
        let request = Request::post(EXPORTS).body(Body::from(r#"{"note": "case 7"}"#)).unwrap();
        assert_eq!(bench.send(request).await.status.as_u16(), 202);
    }
    assert_eq!(n_made(&bench), 4);
}

#[tokio::test]
async fn what_came_to_nothing_may_be_asked_for_again() {
    let bench = Bench::new();
    ask(&bench, "k", "no JSON").await.problem(400, EXPORTS);
    assert_eq!(ask(&bench, "k", "{}").await.status.as_u16(), 202);
    for bad in ["", "\"\"", "\"open", "a b", &"x".repeat(256)] {
        let problem = ask(&bench, bad, "{}").await.problem(400, EXPORTS);
        assert_eq!(problem["errors"][0]["parameter"], json!("Idempotency-Key"), "{bad}");
    }
    let two = Request::post(EXPORTS).header("idempotency-key", "a").header("idempotency-key", "b");
    bench.send(two.body(Body::from("{}")).unwrap()).await.problem(400, EXPORTS);
    let foreign =
        Request::post(EXPORTS).header("idempotency-key", "k").header("sec-fetch-site", "cross-site");
    bench.send(foreign.body(Body::from("{}")).unwrap()).await.problem(400, EXPORTS);
    assert_eq!(n_made(&bench), 1);
    // Looking needs no key, and ignores one.
    let look = Request::get(EXPORTS).header("idempotency-key", "k").body(Body::empty()).unwrap();
    assert_eq!(bench.send(look).await.json()["exports"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn a_key_in_flight_is_a_conflict_and_a_caller_that_leaves_gets_its_answer_later() {
    let bench = Bench::new();
    let (begun, held) = (std::sync::mpsc::sync_channel(1), std::sync::mpsc::sync_channel(1));
    bench.door.0.lock().unwrap().export_gate = Some((begun.0, held.1));
    let waiting = tokio::spawn({
        let router = bench.router.clone();
        let request = Request::post(EXPORTS).header("idempotency-key", "k").body(Body::from("{}")).unwrap();
        async move { tower::ServiceExt::oneshot(router, request).await.unwrap().status().as_u16() }
    });
    tokio::task::spawn_blocking(move || begun.1.recv().unwrap()).await.unwrap();
    ask(&bench, "k", "{}").await.problem(409, EXPORTS);
    ask(&bench, "k", r#"{"note": "other"}"#).await.problem(422, EXPORTS);
    // Whoever asked leaves before it is answered: the job goes on.
    waiting.abort();
    assert!(waiting.await.unwrap_err().is_cancelled());
    held.0.send(()).unwrap();
    let answer = loop {
        let answer = ask(&bench, "k", "{}").await;
        if answer.status.as_u16() != 409 {
            break answer;
        }
        tokio::task::yield_now().await;
    };
    assert_eq!((answer.status.as_u16(), answer.field("idempotency-replayed")), (202, "true"));
    assert_eq!(n_made(&bench), 1);
}
