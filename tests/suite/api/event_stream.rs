//! Events as server-sent events: which come, from where on, and what is refused.

use super::Bench;
use axum::body::{Body, BodyDataStream};
use axum::http::Request;
use futures_util::StreamExt;
use serde_json::Value;
use std::time::Duration;
use tower::ServiceExt;

const STREAM: &str = "/api/v1/events/stream";

async fn open(bench: &Bench, query: &str, last: Option<&str>) -> BodyDataStream {
    let request = Request::get(format!("{STREAM}{query}"));
    let request = last.into_iter().fold(request, |request, id| request.header("last-event-id", id));
    let response = bench.router.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap();
    assert_eq!(
        (response.status().as_u16(), &response.headers()["content-type"]),
        (200, &"text/event-stream".parse().unwrap())
    );
    response.into_body().into_data_stream()
}

/// Ids and cameras of what comes within a moment.
async fn told(mut stream: BodyDataStream) -> Vec<(String, String)> {
    let mut told = Vec::new();
    while let Ok(Some(Ok(bytes))) = tokio::time::timeout(Duration::from_millis(400), stream.next()).await {
        let text = String::from_utf8(bytes.to_vec()).unwrap();
        let field = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
        let data: Value = serde_json::from_str(field("data").unwrap()).unwrap();
        assert_eq!(
            (field("id").unwrap(), field("event").unwrap()),
            (data["id"].to_string().as_str(), data["kind"].as_str().unwrap())
        );
        told.push((field("id").unwrap().to_owned(), data["camera"].as_str().unwrap().to_owned()));
    }
    told
}

#[tokio::test]
async fn events_come_after_the_one_that_was_had_last() {
    let bench = Bench::new();
    let check = async |query: &str, last: Option<&str>, expected: &[(&str, &str)]| {
        let told = told(open(&bench, query, last).await).await;
        let told: Vec<_> = told.iter().map(|(id, camera)| (id.as_str(), camera.as_str())).collect();
        assert_eq!(told, expected, "{query} {last:?}");
    };
    check("?after=0", None, &[("1", "north"), ("2", "south")]).await;
    check("?after=1", None, &[("2", "south")]).await;
    check("?after=0&camera=north", None, &[("1", "north")]).await;
    // What a browser says that comes back is newer than what its page asked for at first.
    check("?after=0", Some("1"), &[("2", "south")]).await;
    check("", Some("0"), &[("1", "north"), ("2", "south")]).await;
    check("", None, &[]).await;
}

#[tokio::test]
async fn what_is_wrong_is_told_before_it_begins() {
    let bench = Bench::new();
    for (query, status) in
        [("?camera=nobody", 404), ("?after=-1", 400), ("?since=1", 400), ("?after=1&after=2", 400)]
    {
        bench.get(&format!("{STREAM}{query}")).await.problem(status, STREAM);
    }
    let request = Request::get(STREAM).header("last-event-id", "yesterday").body(Body::empty()).unwrap();
    let problem = bench.send(request).await.problem(400, STREAM);
    assert_eq!(problem["errors"][0]["parameter"], "Last-Event-ID", "{problem}");
}
