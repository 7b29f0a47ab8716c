//! What goes on for long over HTTP: events, tracks, foregrounds and tiles, to whom they go and what they tell.

#![expect(clippy::print_stdout, reason = "measured figures are shown with --nocapture")]

use super::house::House;
use super::rights::{router, two_worlds, users};
use super::walls::start;
use super::{Bench, has_adapter};
use crate::api::sockets::{Socket, ack, dial, frame};
use axum::body::{Body, BodyDataStream};
use axum::http::Request;
use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::process::Command;
use std::time::Duration;
use tempfile::TempDir;
use tokio_tungstenite::tungstenite::Message;
use tower::ServiceExt;
use videofields_vision::clock::Timestamp;
use videofields_vision::encode::{ForegroundMessage, MovingRectangle, read_foreground};

async fn open(router: &axum::Router, path: &str, fields: &[(&str, &str)]) -> BodyDataStream {
    let request =
        fields.iter().fold(Request::get(path), |request, (name, value)| request.header(*name, *value));
    let response = router.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap();
    assert_eq!(response.status(), 200, "{path}");
    response.into_body().into_data_stream()
}

/// The next server-sent event: its id, name and data.
async fn event(stream: &mut BodyDataStream) -> (String, String, Value) {
    loop {
        let next =
            tokio::time::timeout(Duration::from_secs(20), stream.next()).await.expect("an event comes");
        let text = String::from_utf8(next.unwrap().unwrap().to_vec()).unwrap();
        let field = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(": "));
        if let Some(data) = field("data") {
            let data = serde_json::from_str(data).unwrap();
            return (field("id").unwrap().to_owned(), field("event").unwrap().to_owned(), data);
        }
    }
}

#[test]
fn tracks_of_the_present_are_told_with_their_places() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let house = &house;
    house.bench.runtime.block_on(async {
        let mut stream = open(&house.router, "/api/v1/scenes/plaza/tracks/stream?rate=10", &[]).await;
        let (mut times, mut seen_by_two, mut longest) = (Vec::new(), 0, BTreeMap::new());
        for _ in 0..40 {
            let (_, name, told) = event(&mut stream).await;
            assert_eq!((name.as_str(), &told["scene"]), ("tracks", &json!("plaza")));
            times.push(told["time"].as_str().unwrap().parse::<Timestamp>().unwrap());
            for track in told["tracks"].as_array().unwrap() {
                let place: Vec<f64> =
                    track["position_m"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
                assert!(place.len() == 3 && place.iter().all(|x| x.abs() < 200.0), "{track}");
                assert!(track["height_m"].as_f64().unwrap() > 0.0, "{track}");
                seen_by_two += usize::from(track["cameras"].as_array().unwrap().len() > 1);
                *longest.entry(track["id"].as_u64().unwrap()).or_insert(0) += 1;
            }
        }
        assert!(times.is_sorted() && times.windows(2).all(|pair| pair[0] != pair[1]), "{times:?}");
        assert!(seen_by_two > 0, "nobody was seen by two cameras");
        assert!(longest.values().any(|n| *n >= 10), "ids stay: {longest:?}");
    });
    assert_eq!(house.get("/api/v1/scenes/nowhere/tracks/stream").status, 404);
    assert_eq!(house.get("/api/v1/scenes/plaza/tracks/stream?rate=11").status, 400);
}

fn difference(a: &image::Rgb<u8>, b: &image::Rgb<u8>) -> u64 {
    a.0.iter().zip(&b.0).map(|(a, b)| u64::from(a.abs_diff(*b))).sum()
}

#[test]
fn a_frame_comes_as_its_background_and_what_moves_in_fewer_bytes() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let (address, stop) = house.serve();
    let (mut n_frames, mut foreground_bytes, mut full_bytes, mut n_backgrounds) = (0_u32, 0, 0, 0);
    let (mut error_sum, mut full_error_sum, mut n_codes) = (0_u64, 0_u64, 0_u64);
    for camera in ["west", "east", "north"] {
        let path = format!("/api/v1/cameras/{camera}/foreground");
        let mut socket: Socket = house.bench.runtime.block_on(dial(address, &path, &[])).unwrap();
        let (mut background, mut sequence) = (None, 0);
        let mut n = 0;
        while n < 60 {
            let message = house.bench.runtime.block_on(socket.next()).unwrap().unwrap();
            let Message::Binary(bytes) = message else { continue };
            foreground_bytes += bytes.len();
            match read_foreground(&bytes).unwrap() {
                ForegroundMessage::Background(header, jpeg) => {
                    let picture = image::load_from_memory(jpeg).unwrap().into_rgb8();
                    assert_eq!([picture.width(), picture.height()], header.size_px.map(u32::from));
                    background = Some((header.background, picture));
                    n_backgrounds += 1;
                }
                ForegroundMessage::Foreground(header, parts) => {
                    let (number, shown) = background.as_ref().expect("the background comes first");
                    assert_eq!(*number, header.background);
                    assert!(header.sequence > sequence, "{} after {sequence}", header.sequence);
                    sequence = header.sequence;
                    (n, n_frames) = (n + 1, n_frames + 1);
                    let path = format!("/api/v1/cameras/{camera}/frame.jpg?t={}", header.time.as_nanos());
                    let full = house.get(&path).bytes;
                    full_bytes += full.len();
                    if n % 10 != 0 {
                        continue;
                    }
                    let path = path.replace(".jpg", ".png");
                    let whole = image::load_from_memory(&house.get(&path).bytes).unwrap().into_rgb8();
                    let full = image::load_from_memory(&full).unwrap().into_rgb8();
                    assert_eq!(whole.dimensions(), shown.dimensions());
                    for part in parts {
                        let MovingRectangle { rect: [x, y, width, _], .. } = part.of;
                        let colors = image::load_from_memory(part.jpeg).unwrap().into_rgb8();
                        let moving = part.mask.iter().zip(0_u32..).filter(|(moves, _)| **moves);
                        let within = moving.map(|(_, idx)| (idx % width, idx / width));
                        let wanted = |i, j| whole.get_pixel(x + i, y + j);
                        let error = |(i, j)| difference(colors.get_pixel(i, j), wanted(i, j));
                        let full_error = |(i, j)| difference(full.get_pixel(x + i, y + j), wanted(i, j));
                        error_sum += within.clone().map(error).sum::<u64>();
                        full_error_sum += within.clone().map(full_error).sum::<u64>();
                        n_codes += 3 * within.count() as u64;
                    }
                }
            }
        }
    }
    assert!(n_codes > 3000, "somebody moves: {n_codes}");
    let [error, full_error] = [error_sum, full_error_sum].map(|sum| sum as f64 / n_codes as f64);
    println!(
        "{n_frames} frames: {foreground_bytes} bytes with {n_backgrounds} backgrounds, {full_bytes} as whole JPEGs \
         ({:.1} %); {error:.2} codes of error where something moves, {full_error:.2} of whole JPEGs",
        100.0 * foreground_bytes as f64 / full_bytes as f64
    );
    assert!(error < 1.1 * full_error + 0.5, "{error}, {full_error} of whole JPEGs");
    assert!(foreground_bytes * 2 < full_bytes, "{foreground_bytes} of {full_bytes}");
    assert_eq!(house.get("/api/v1/cameras/west/foreground").status, 400, "without a WebSocket");
    stop.send(()).unwrap();
}

/// A wall of four tiles of 64 x 48 pixels.
fn make_wall(house: &House) {
    let wall = json!({
        "scene": "plaza",
        "rate_hz": 10,
        "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
        "surface": {"grid": {"columns": 2, "rows": 2, "tile_px": [64, 48], "tile_m": [0.64, 0.48]}},
    });
    let made = house.send("PUT", "/api/v1/walls/control", Some(("if-none-match", "*")), &wall.to_string());
    assert_eq!(made.status, 201, "{}", made.body);
    // What is drawn first waits for shaders.
    let first = "/api/v1/walls/control/tiles/r1c1/frame.jpg";
    videofields_testing::wait_for("a picture", || (house.get(first).status == 200).then_some(()));
}

#[test]
fn screens_of_a_wall_are_known_and_all_tiles_show_a_pattern_for_a_while() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    make_wall(&house);
    let (address, stop) = house.serve();
    let screens = || house.get("/api/v1/walls/control/screens").body;
    let put = |body: Value| house.send("PUT", "/api/v1/walls/control/pattern", None, &body.to_string());
    assert_eq!(
        screens(),
        json!({"wall": "control", "pattern": {"shows": "none", "seconds_left": null}, "screens": []})
    );

    let path = "/api/v1/walls/control/tiles/r2c1/frames?credits=4";
    let mut socket = house.bench.runtime.block_on(dial(address, path, &[])).unwrap();
    let mut shown = || {
        house.bench.runtime.block_on(async {
            let (header, _) = frame(&mut socket).await;
            ack(&mut socket, header.frame).await;
            header
        })
    };
    assert!(!shown().is_pattern);
    let known = videofields_testing::wait_for("the screen has a frame", || {
        let known = screens();
        known["screens"][0]["frame"].is_u64().then_some(known)
    });
    assert_eq!(known["screens"].as_array().unwrap().len(), 1);
    assert_eq!(
        (&known["screens"][0]["tile"], &known["screens"][0]["health"]),
        (&json!("r2c1"), &json!(null))
    );

    // A pattern goes to whoever does not ask for another, and what does ask still gets that.
    let asked = put(json!({"shows": "identify", "seconds": 600}));
    assert_eq!((asked.status, &asked.body["shows"]), (200, &json!("identify")), "{}", asked.body);
    assert!(videofields_testing::wait_for("a pattern", || shown().is_pattern.then_some(true)));
    let picture =
        |query: &str| house.get(&format!("/api/v1/walls/control/tiles/r2c1/frame.png{query}")).bytes;
    assert_eq!(picture(""), picture("?pattern=identify"));
    assert_ne!(picture(""), picture("?pattern=none"));
    assert_ne!(picture(""), picture("?pattern=test"));
    assert_eq!(screens()["pattern"]["shows"], "identify");
    assert_eq!(put(json!({"shows": "none"})).body, json!({"shows": "none", "seconds_left": null}));
    assert!(videofields_testing::wait_for("a picture", || (!shown().is_pattern).then_some(true)));

    let wrong = put(json!({"shows": "bars", "seconds": 0}));
    let places: Vec<&str> = wrong.body["errors"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|error| error["pointer"].as_str())
        .collect();
    assert_eq!((wrong.status, places), (400, vec!["/shows", "/seconds"]), "{}", wrong.body);
    assert_eq!(house.send("PUT", "/api/v1/walls/lobby/pattern", None, "{\"shows\": \"test\"}").status, 404);

    // What it says of itself stands beside what is known of it, and it is gone with its conversation.
    let health = json!({
        "frame": 9, "age_secs": 0.1, "rate_hz": 9.8, "missed": 1, "late": 2, "unreadable": 0, "reconnects": 3,
        "clock_offset_secs": null,
    });
    let said = Message::text(json!({ "health": health }).to_string());
    house.bench.runtime.block_on(socket.send(said)).unwrap();
    videofields_testing::wait_for("the screen's word", || {
        (screens()["screens"][0]["health"] == health).then_some(())
    });
    drop(socket);
    videofields_testing::wait_for("nobody", || {
        screens()["screens"].as_array().unwrap().is_empty().then_some(())
    });
    stop.send(()).unwrap();
}

#[test]
fn tiles_by_websocket_are_never_torn_and_a_slow_screen_holds_up_none() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    make_wall(&house);
    let (address, stop) = house.serve();
    let path = |tile: &str| format!("/api/v1/walls/control/tiles/{tile}/frames");
    let frames = house.bench.runtime.block_on(async {
        // It takes one picture and says nothing.
        let mut slow = dial(address, &format!("{}?credits=1", path("r1c1")), &[]).await.unwrap();
        frame(&mut slow).await;
        let mut tiles = Vec::new();
        for tile in ["r1c1", "r1c2", "r2c1", "r2c2"] {
            tiles.push(dial(address, &path(tile), &[]).await.unwrap());
        }
        let follow = async |socket: &mut Socket| {
            let mut shown = Vec::new();
            for _ in 0..12 {
                let (header, picture) = frame(socket).await;
                assert_eq!(image::load_from_memory(&picture).unwrap().width(), 64);
                ack(socket, header.frame).await;
                shown.push(header);
            }
            shown
        };
        let followed = futures_util::future::join_all(tiles.iter_mut().map(follow));
        let followed = tokio::time::timeout(Duration::from_secs(60), followed).await.expect("none waits");
        let shown = async {
            loop {
                match slow.next().await {
                    Some(Ok(Message::Ping(_))) => {}
                    other => return other,
                }
            }
        };
        let late = tokio::time::timeout(Duration::from_millis(50), shown).await;
        assert!(late.is_err(), "{late:?}");
        followed
    });
    let mut instants: BTreeMap<u64, Vec<_>> = BTreeMap::new();
    for header in frames.iter().flatten() {
        assert_eq!((header.version, header.is_live, header.rate_millihertz), (1, true, 10_000));
        instants.entry(header.frame).or_default().push(header.instant);
    }
    for (frame, of) in &instants {
        assert!(of.iter().all(|instant| *instant == of[0]), "frame {frame} is torn: {of:?}");
    }
    let n_whole = instants.values().filter(|of| of.len() == 4).count();
    assert!(n_whole >= 8, "{n_whole} whole frames: {:?}", instants.keys().collect::<Vec<_>>());
    for shown in &frames {
        assert!(shown.is_sorted_by_key(|header| header.frame));
    }
    stop.send(()).unwrap();
}

#[test]
fn the_reference_client_finds_no_frame_torn() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    make_wall(&house);
    let (address, stop) = house.serve();
    let client = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_videofields"));
        let url = format!("http://{address}");
        command.args(["wall-client", "--url", &url]).args(arguments).output().unwrap()
    };
    for way in
        [&["--json"][..], &["--json", "--websocket"], &["--json", "--websocket", "--tiles", "r1c1,r2c2"]]
    {
        let found = client(&[&["--wall", "control", "--seconds", "8"], way].concat());
        let told = String::from_utf8_lossy(&found.stderr).into_owned();
        assert!(found.status.success(), "{way:?}: {told}");
        let report: Value = serde_json::from_slice(&found.stdout).unwrap();
        assert_eq!(report["frames"]["torn"], 0, "{report}");
        assert!(report["frames"]["whole"].as_u64().unwrap() > 2, "{report}");
        assert!(
            report["latency_ms"]["p99"].as_f64().is_some() && report["bytes"].as_u64().unwrap() > 1000,
            "{report}"
        );
    }
    for (arguments, part) in [
        (["--wall", "none"].as_slice(), "there is no wall"),
        (&["--wall", "control", "--tiles", "r9c9"], "no tile \"r9c9\""),
        (
            &["--wall", "control", "--certificate", "/nowhere.pem", "--url", "https://localhost"],
            "/nowhere.pem",
        ),
    ] {
        let found = client(arguments);
        let told = String::from_utf8_lossy(&found.stderr).into_owned();
        assert!(
            found.status.code() == Some(1) && told.contains(part) || told.contains("cannot be used multiple"),
            "{told}"
        );
    }
    stop.send(()).unwrap();
}

/// What the streams of a daemon tell a caller first, a line each.
fn told(house: &(axum::Router, &Bench), token: &str) -> Vec<(String, Vec<u8>)> {
    let (router, bench) = house;
    let bearer = format!("Bearer {token}");
    bench.runtime.block_on(async {
        let mut lines = Vec::new();
        for (path, n) in [
            ("/api/v1/scenes/yard/view.mjpeg?width=64&height=48&rate=30", 2),
            ("/api/v1/views/gate/picture.mjpeg?width=64&height=48&rate=30", 2),
            ("/api/v1/walls/control/tiles/r1c1/frame.mjpeg", 2),
            ("/api/v1/scenes/yard/tracks/stream?rate=10", 1),
        ] {
            let mut stream = open(router, path, &[("authorization", &bearer)]).await;
            for _ in 0..n {
                let n_pieces = if path.contains("mjpeg") { 3 } else { 1 };
                let mut pieces = Vec::new();
                for _ in 0..n_pieces {
                    let next = tokio::time::timeout(Duration::from_secs(20), stream.next()).await.unwrap();
                    pieces.push(next.unwrap().unwrap().to_vec());
                }
                // Of a part the picture: its head has the number of a wall's frame, which is a time.
                lines.push((path.to_owned(), pieces.swap_remove(n_pieces / 2)));
            }
        }
        let path = "/api/v1/events/stream?after=0";
        let mut stream = open(router, path, &[("authorization", &bearer)]).await;
        while let Ok(Some(Ok(bytes))) = tokio::time::timeout(Duration::from_millis(500), stream.next()).await
        {
            // Ids are times.
            let text = String::from_utf8(bytes.to_vec()).unwrap();
            let data = text.lines().find_map(|line| line.strip_prefix("data: ")).unwrap_or_default();
            let mut data: Value = serde_json::from_str(data).unwrap_or_default();
            data["id"] = Value::Null;
            lines.push((path.to_owned(), data.to_string().into_bytes()));
        }
        lines
    })
}

#[test]
fn no_stream_tells_a_byte_of_a_forbidden_camera() {
    if !has_adapter() {
        return;
    }
    let (_folders, benches) = two_worlds();
    let both = benches.each_ref();
    let houses = both.map(|bench| {
        let tokens = users(bench);
        (router(bench), tokens)
    });
    let admins = [0, 1].map(|idx| told(&(houses[idx].0.clone(), both[idx]), &houses[idx].1[0]));
    assert!(admins[0] != admins[1], "an admin is told who is there");
    let mine = [0, 1].map(|idx| told(&(houses[idx].0.clone(), both[idx]), &houses[idx].1[1]));
    assert_eq!(mine[0].len(), mine[1].len());
    for ((path, a), (_, b)) in mine[0].iter().zip(&mine[1]) {
        let shown = |bytes: &[u8]| String::from_utf8_lossy(&bytes[..bytes.len().min(300)]).into_owned();
        assert!(a == b, "{path}: {}\nor {}", shown(a), shown(b));
        assert!(!String::from_utf8_lossy(a).contains("south"), "{path}: {}", shown(a));
    }
    // By WebSocket: the permitted camera's foreground is the same, the forbidden one is not there.
    for (idx, (router, [_, guest])) in houses.iter().enumerate() {
        let runtime = &both[idx].runtime;
        let (address, stop) = super::house::serve(runtime, router.clone());
        let bearer = [("authorization", format!("Bearer {guest}"))];
        let hidden = runtime.block_on(dial(address, "/api/v1/cameras/south/foreground", &bearer));
        assert!(
            matches!(hidden, Err(tokio_tungstenite::tungstenite::Error::Http(answer)) if answer.status() == 404)
        );
        let mut socket =
            runtime.block_on(dial(address, "/api/v1/cameras/north/foreground", &bearer)).unwrap();
        let first = runtime.block_on(socket.next()).unwrap().unwrap().into_data();
        assert!(matches!(read_foreground(&first), Some(ForegroundMessage::Background(..))));
        stop.send(()).unwrap();
    }
}
