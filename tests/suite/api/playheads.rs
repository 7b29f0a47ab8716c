//! `/api/v1/playheads`: made, changed, followed and removed over HTTP.

use super::Bench;
use axum::body::{Body, BodyDataStream};
use axum::http::{Method, Request, StatusCode};
use futures_util::StreamExt;
use serde_json::{Value, json};
use tower::ServiceExt;

const WALL: &str = "/api/v1/playheads/wall";

fn asking(method: Method, target: &str, body: &Value) -> Request<Body> {
    Request::builder().method(method).uri(target).body(Body::from(body.to_string())).unwrap()
}

#[tokio::test]
async fn a_playhead_is_made_changed_and_removed() {
    let bench = Bench::new();
    let empty = bench.get("/api/v1/playheads").await;
    assert_eq!((empty.json(), empty.field("cache-control")), (json!({"playheads": []}), "no-store"));
    let problem = bench.get(WALL).await.problem(404, WALL);
    assert_eq!(problem["detail"], "there is no playhead \"wall\"; there is none");

    let at = json!({"at": "1970-01-01T00:00:05Z"});
    let made = bench.send(asking(Method::PUT, WALL, &at)).await;
    assert_eq!(made.status, StatusCode::CREATED);
    let expected = json!({
        "id": "wall", "scene": "plaza", "mode": "paused", "position": "1970-01-01T00:00:05Z", "rate": 1.0,
        "loop": null, "version": 1
    });
    assert_eq!(made.json(), expected);
    assert_eq!(bench.send(asking(Method::PUT, WALL, &json!({"rate": 2}))).await.status, StatusCode::OK);
    let changed = bench.send(asking(Method::PATCH, WALL, &json!({"rate": -4}))).await;
    assert_eq!((changed.status, &changed.json()["rate"]), (StatusCode::OK, &json!(-4.0)));
    assert_eq!(bench.get(WALL).await.json(), changed.json());

    let refused = bench.send(asking(Method::POST, WALL, &json!({}))).await;
    assert_eq!((refused.status.as_u16(), refused.field("allow")), (405, "GET, HEAD, PUT, PATCH, DELETE"));
    bench
        .send(asking(Method::PUT, "/api/v1/playheads/%20", &json!({})))
        .await
        .problem(400, "/api/v1/playheads/%20");
    let broken = Request::patch(WALL).body(Body::from("{\"rate\": ")).unwrap();
    bench.send(broken).await.problem(400, WALL);
    for method in [Method::PUT, Method::PATCH, Method::DELETE] {
        let mut foreign = asking(method, WALL, &json!({}));
        foreign.headers_mut().insert("sec-fetch-site", "cross-site".parse().unwrap());
        bench.send(foreign).await.problem(400, WALL);
    }
    assert_eq!(bench.send(asking(Method::DELETE, WALL, &json!({}))).await.status, StatusCode::NO_CONTENT);
    bench.get(WALL).await.problem(404, WALL);
}

#[tokio::test]
async fn pictures_are_asked_for_where_a_playhead_stands() {
    let bench = Bench::new();
    bench.send(asking(Method::PUT, WALL, &json!({"at": "1970-01-01T00:00:05Z"}))).await;
    let picture = bench.get("/api/v1/cameras/north/frame.jpg?t=playhead:wall").await;
    assert_eq!(picture.field("videofields-time"), "1970-01-01T00:00:05Z");
    assert_eq!(picture.field("cache-control"), "no-store", "it moves on");
    let view = bench.get("/api/v1/scenes/plaza/view.png?width=8&height=4&t=playhead:wall").await;
    assert_eq!(view.status, StatusCode::OK);
    let asked = bench.door.0.lock().unwrap().view.clone().unwrap();
    assert_eq!(asked.at, videofields_service::engine::At::Time("1970-01-01T00:00:05Z".parse().unwrap()));
    let path = "/api/v1/cameras/north/frame.jpg";
    let problem = bench.get(&format!("{path}?t=playhead:other")).await.problem(400, path);
    assert_eq!(problem["errors"], json!([{"parameter": "t", "detail": "there is no playhead \"other\""}]));
}

/// The data of the next event of a stream.
async fn next_event(stream: &mut BodyDataStream) -> Option<Value> {
    let chunk = stream.next().await?.unwrap();
    let text = String::from_utf8(chunk.to_vec()).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("data: ")).unwrap();
    Some(serde_json::from_str(line).unwrap())
}

#[tokio::test]
async fn a_playheads_followers_are_told_of_every_change_until_it_is_gone() {
    let bench = Bench::new();
    bench.send(asking(Method::PUT, WALL, &json!({}))).await;
    let events = format!("{WALL}/events");
    let response =
        bench.router.clone().oneshot(Request::get(&events).body(Body::empty()).unwrap()).await.unwrap();
    assert_eq!(response.status(), StatusCode::OK);
    assert_eq!(response.headers()["content-type"], "text/event-stream");
    let mut stream = response.into_body().into_data_stream();
    assert_eq!(next_event(&mut stream).await.unwrap()["version"], 1);
    bench.send(asking(Method::PATCH, WALL, &json!({"rate": 3}))).await;
    let told = next_event(&mut stream).await.unwrap();
    assert_eq!((&told["version"], &told["rate"]), (&json!(2), &json!(3.0)));
    bench.send(asking(Method::DELETE, WALL, &json!({}))).await;
    assert_eq!(next_event(&mut stream).await, None);

    bench.send(asking(Method::PUT, WALL, &json!({}))).await;
    let response =
        bench.router.clone().oneshot(Request::get(&events).body(Body::empty()).unwrap()).await.unwrap();
    let mut stream = response.into_body().into_data_stream();
    next_event(&mut stream).await.unwrap();
    bench.door.0.lock().unwrap().changes.send_replace(videofields_service::engine::ENDED);
    assert_eq!(next_event(&mut stream).await, None, "no stream holds up the daemon's end");
    bench.get("/api/v1/playheads/none/events").await.problem(404, "/api/v1/playheads/none/events");
}
