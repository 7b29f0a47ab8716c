//! Pictures by WebSocket: their messages, credits, who is refused, and how a conversation ends.

use super::door::{FakeDoor, State};
use super::server::{Running, start};
use futures_util::{SinkExt, StreamExt};
use std::net::SocketAddr;
use std::time::Duration;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::http::{HeaderValue, StatusCode};
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async};
use videofields_service::engine::EngineError;
use videofields_service::wall::FrameHeader;
use videofields_vision::encode::PictureFormat;

pub(crate) type Socket = WebSocketStream<TcpStream>;

const FRAMES: &str = "/api/v1/scenes/plaza/frames?width=64&height=48&rate=30";

/// A conversation at `path`, with header fields of the caller's.
pub(crate) async fn dial(
    address: SocketAddr,
    path: &str,
    fields: &[(&'static str, String)],
) -> Result<Socket, Error> {
    let mut request = format!("ws://{address}{path}").into_client_request().unwrap();
    for (name, value) in fields {
        request.headers_mut().insert(*name, HeaderValue::from_str(value).unwrap());
    }
    let stream = TcpStream::connect(address).await.unwrap();
    client_async(request, stream).await.map(|(socket, _)| socket)
}

/// The next picture's header and bytes.
pub(crate) async fn frame(socket: &mut Socket) -> (FrameHeader, Vec<u8>) {
    loop {
        match socket.next().await.unwrap().unwrap() {
            Message::Binary(bytes) => {
                let (header, picture) = FrameHeader::read(&bytes).unwrap();
                return (header, picture.to_vec());
            }
            // On a slow machine a picture may have to be waited for.
            Message::Ping(_) | Message::Text(_) => {}
            other => panic!("{other:?}"),
        }
    }
}

pub(crate) async fn ack(socket: &mut Socket, frame: u64) {
    socket.send(Message::text(format!("{{\"ack\": {frame}}}"))).await.unwrap();
}

/// Code and reason of the end.
pub(crate) async fn end(socket: &mut Socket) -> (u16, String) {
    loop {
        match socket.next().await.unwrap().unwrap() {
            Message::Close(Some(frame)) => return (frame.code.into(), frame.reason.to_string()),
            Message::Close(None) => panic!("no reason"),
            _ => {}
        }
    }
}

async fn stop(running: Running) {
    running.stop.send(()).unwrap();
    tokio::time::timeout(Duration::from_secs(5), running.served).await.expect("it ends by itself").unwrap();
}

#[tokio::test]
async fn pictures_come_as_they_are_taken_and_none_waits_for_a_slow_client() {
    let running = start(State::default()).await;
    let mut slow = dial(running.address, &format!("{FRAMES}&credits=1"), &[]).await.unwrap();
    let (first, picture) = frame(&mut slow).await;
    assert_eq!((first.frame, first.format, first.rate_millihertz), (1, PictureFormat::Jpeg, 30_000));
    assert!(first.is_live && !first.is_pattern);
    assert_eq!(image::load_from_memory(&picture).unwrap().width(), 64);
    // Another takes picture after picture meanwhile.
    let mut quick = dial(running.address, FRAMES, &[]).await.unwrap();
    for number in 1..=20 {
        let (shown, _) = frame(&mut quick).await;
        assert_eq!(shown.frame, number);
        ack(&mut quick, number).await;
    }
    let waits = tokio::time::timeout(Duration::from_millis(100), slow.next()).await;
    assert!(waits.is_err(), "one picture at once: {waits:?}");
    ack(&mut slow, 1).await;
    assert_eq!(frame(&mut slow).await.0.frame, 2, "drawn when it was wanted, and not before");
    // An acknowledgement of what was never sent, or a second one, makes no more room than there is.
    ack(&mut slow, 1).await;
    ack(&mut slow, 1).await;
    let waits = tokio::time::timeout(Duration::from_millis(200), slow.next()).await;
    assert!(waits.is_err(), "{waits:?}");
    stop(running).await;
}

#[tokio::test]
async fn what_is_wrong_is_told_before_the_protocols_change() {
    let running = start(State::default()).await;
    let check = async |path: &str, fields: &[(&'static str, String)], expected: StatusCode| match dial(
        running.address,
        path,
        fields,
    )
    .await
    {
        Err(Error::Http(response)) => assert_eq!(response.status(), expected, "{path} {fields:?}"),
        other => panic!("{path} {fields:?}: {:?}", other.map(|_| ())),
    };
    let of_page = |origin: &str| [("origin", origin.to_owned())];
    check(FRAMES, &of_page("https://evil.example"), StatusCode::FORBIDDEN).await;
    check(FRAMES, &of_page("null"), StatusCode::FORBIDDEN).await;
    check(FRAMES, &[("sec-fetch-site", "cross-site".to_owned())], StatusCode::BAD_REQUEST).await;
    check(&format!("{FRAMES}&credits=5"), &[], StatusCode::BAD_REQUEST).await;
    check(&format!("{FRAMES}&rate=1000"), &[], StatusCode::BAD_REQUEST).await;
    check(&format!("{FRAMES}&widht=3"), &[], StatusCode::BAD_REQUEST).await;
    check("/api/v1/scenes/square/frames", &[], StatusCode::NOT_FOUND).await;
    check("/api/v1/views/gate/frames", &[], StatusCode::NOT_FOUND).await;
    check("/api/v1/walls/control/tiles/a/frames", &[], StatusCode::NOT_FOUND).await;
    let own = of_page(&format!("http://{}", running.address));
    drop(dial(running.address, FRAMES, &own).await.unwrap());
    stop(running).await;
    // Without a WebSocket there is nothing here.
    let answer = super::Bench::new().get(FRAMES).await;
    let problem = answer.problem(400, "/api/v1/scenes/plaza/frames");
    assert!(problem["detail"].as_str().unwrap().contains("WebSocket"), "{problem}");
}

#[tokio::test]
async fn conversations_end_with_a_reason() {
    let running = start(State::default()).await;
    let fail = |door: &FakeDoor, error| door.0.lock().unwrap().failure = error;
    for said in [Message::text("more"), Message::text("{\"credit\": 1}"), Message::binary(vec![1])] {
        let mut socket = dial(running.address, FRAMES, &[]).await.unwrap();
        socket.send(said).await.unwrap();
        assert_eq!(end(&mut socket).await.0, 1003);
    }
    // What is not to be had for now is waited for; what went wrong for good ends it.
    let mut socket = dial(running.address, FRAMES, &[]).await.unwrap();
    let busy = EngineError::Busy { waiting: 3, retry_after: Duration::from_secs(1) };
    fail(&running.door, Some(busy));
    let waiting = loop {
        match socket.next().await.unwrap().unwrap() {
            Message::Text(text) => break text.to_string(),
            Message::Binary(bytes) => {
                let number = FrameHeader::read(&bytes).unwrap().0.frame;
                ack(&mut socket, number).await;
            }
            _ => {}
        }
    };
    assert!(waiting.starts_with("{\"waiting\":"), "{waiting}");
    fail(&running.door, Some(EngineError::Internal("out of order".to_owned())));
    assert_eq!(end(&mut socket).await.0, 1011);
    fail(&running.door, None);
    let mut socket = dial(running.address, FRAMES, &[]).await.unwrap();
    frame(&mut socket).await;
    running.stop.send(()).unwrap();
    assert_eq!(end(&mut socket).await, (1001, "the daemon stops".to_owned()));
    tokio::time::timeout(Duration::from_secs(5), running.served).await.expect("it ends by itself").unwrap();
}
