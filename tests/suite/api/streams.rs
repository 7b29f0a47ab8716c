//! Streams of pictures: their parts, who gets how many, and what is refused.

use super::door::State;
use super::{Bench, StatusCode};
use axum::body::{Body, BodyDataStream};
use axum::http::Request;
use futures_util::StreamExt;
use std::time::Duration;
use tower::ServiceExt;
use videofields_api::Limits;
use videofields_service::engine::EngineError;

const VIEW: &str = "/api/v1/scenes/plaza/view.mjpeg?width=64&height=48&rate=30";

async fn open(bench: &Bench, target: &str) -> BodyDataStream {
    let request = Request::get(target).body(Body::empty()).unwrap();
    let response = bench.router.clone().oneshot(request).await.unwrap();
    assert_eq!(response.status(), StatusCode::OK, "{target}");
    let kind = response.headers()["content-type"].to_str().unwrap().to_owned();
    assert_eq!(kind, "multipart/x-mixed-replace; boundary=videofields-picture");
    response.into_body().into_data_stream()
}

/// The next part's head and picture.
async fn part(stream: &mut BodyDataStream) -> Option<(String, Vec<u8>)> {
    let head = stream.next().await?.unwrap();
    let picture = stream.next().await?.unwrap();
    assert_eq!(&stream.next().await?.unwrap()[..], b"\r\n");
    Some((String::from_utf8(head.to_vec()).unwrap(), picture.to_vec()))
}

#[tokio::test]
async fn a_view_is_streamed_picture_after_picture() {
    let bench = Bench::new();
    let mut stream = open(&bench, VIEW).await;
    for _ in 0..3 {
        let (head, picture) = part(&mut stream).await.unwrap();
        assert!(head.starts_with("--videofields-picture\r\nContent-Type: image/jpeg\r\n"), "{head}");
        assert!(head.contains(&format!("Content-Length: {}\r\n", picture.len())), "{head}");
        assert!(head.contains("Videofields-Time: ") && head.ends_with("\r\n\r\n"), "{head}");
        let shown = image::load_from_memory(&picture).unwrap();
        assert_eq!((shown.width(), shown.height()), (64, 48));
    }
    // What the renderer cannot do for now passes; what is gone for good ends the stream.
    let fail = |error| bench.door.0.lock().unwrap().failure = error;
    let busy = EngineError::Busy { waiting: 3, retry_after: Duration::from_secs(1) };
    fail(Some(busy));
    let waits = tokio::time::timeout(Duration::from_millis(300), part(&mut stream)).await;
    assert!(waits.is_err(), "it waits");
    fail(None);
    drop(stream);
    let mut stream = open(&bench, VIEW).await;
    part(&mut stream).await.unwrap();
    fail(Some(EngineError::Internal("out of order".to_owned())));
    assert!(part(&mut stream).await.is_none(), "it ends");
}

#[tokio::test]
async fn nothing_is_drawn_for_who_does_not_read_and_streams_are_bounded() {
    let bench = Bench::within(Limits::default(), State::default());
    let mut streams = Vec::new();
    for _ in 0..96 {
        streams.push(open(&bench, VIEW).await);
    }
    bench.door.0.lock().unwrap().view = None;
    tokio::time::sleep(Duration::from_millis(200)).await;
    assert!(bench.door.0.lock().unwrap().view.is_none(), "nobody has taken the first picture");
    let refused = bench.get(VIEW).await;
    refused.problem(503, "/api/v1/scenes/plaza/view.mjpeg");
    streams.pop();
    drop(open(&bench, VIEW).await);
}

#[tokio::test]
async fn what_is_wrong_with_a_stream_is_told_before_it_begins() {
    let bench = Bench::new();
    let check = async |target: &str, status: u16| {
        let path = target.split('?').next().unwrap();
        bench.get(target).await.problem(status, path);
    };
    check("/api/v1/scenes/plaza/view.mjpeg?rate=0", 400).await;
    check("/api/v1/scenes/plaza/view.mjpeg?rate=1&rate=2", 400).await;
    check("/api/v1/scenes/plaza/view.mjpeg?width=0", 400).await;
    check("/api/v1/scenes/square/view.mjpeg", 404).await;
    check("/api/v1/walls/none/tiles/a/frame.mjpeg", 404).await;
}
