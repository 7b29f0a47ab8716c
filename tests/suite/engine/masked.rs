//! A zone that is put while pictures are known to clients, kept by the renderer and sealed in snapshots: whichever way one looks
//! from then on, and whatever one has already, it hides.

use super::house::serve;
use super::privacy::{others, zone};
use super::snapshots::House;
use super::{FRAME_NANOS, SCENE, at, camera, has_adapter, pictures, request};
use crate::api::sockets::{Socket, dial};
use futures_util::StreamExt;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;
use tokio_tungstenite::tungstenite::Message;
use videofields_picture::scene;
use videofields_service::engine::view_once;
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{CameraSettings, Config, End, MediaSettings, Settings};
use videofields_vision::encode::{ForegroundMessage, read_foreground};

const WHOLE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
const NORTH: &str = "/api/v1/cameras/north/privacy";
const ALL: &str = "/api/v1/snapshots";

/// Two cameras, of which the north one hides these zones from the beginning.
fn cameras(folder: &Path, hidden: &[[[f64; 2]; 4]]) -> Vec<CameraSettings> {
    let mut cameras = ["north", "south"].map(|id| camera(id, pictures(folder, id, 0..20), End::Stop));
    cameras[0].privacy_zones = hidden.iter().map(|polygon| zone("all", polygon)).collect();
    cameras.to_vec()
}

/// Hides all that the north camera sees; the answer's tag.
fn hide(house: &House, tag: (&str, &str)) -> String {
    let body = json!({"zones": [{"name": "all", "reason": "not ours", "polygon": WHOLE}]});
    let put = house.send_with(("root", "PUT", NORTH), &[tag], body);
    assert_eq!(put.status, 200, "{}", put.body);
    put.field("etag").to_owned()
}

/// Every way to a picture of what the north camera saw.
fn ways() -> Vec<String> {
    let size = "width=64&height=48";
    let mut ways = vec!["/api/v1/cameras/north/strip.jpg?from=0&to=380000000&count=4".to_owned()];
    for kind in ["frame.png", "frame.jpg", "background.png", "mask.png"] {
        ways.push(format!("/api/v1/cameras/north/{kind}"));
        ways.push(format!("/api/v1/cameras/north/{kind}?t=200000000"));
    }
    for more in ["", "&t=200000000", "&t=200000000&entities=points", "&t=200000000&projection=map&colors=raw"]
    {
        ways.push(format!("/api/v1/scenes/yard/view.png?{size}{more}"));
    }
    ways.push(format!("/api/v1/scenes/yard/view.jpg?{size}"));
    ways
}

#[test]
fn what_is_hidden_is_gone_from_every_way_to_a_picture_whatever_tag_one_has() {
    if !has_adapter() {
        return;
    }
    let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let house = House::of(folders[0].path(), cameras(folders[0].path(), &[]));
    // Where it was hidden from the beginning nothing can be left of it.
    let clean = House::of(folders[1].path(), cameras(folders[1].path(), &[WHOLE]));
    let ways = ways();
    let had: Vec<(String, Vec<u8>)> = ways
        .iter()
        .map(|path| {
            let first = house.get("root", path);
            assert_eq!(first.status, 200, "{path}: {}", first.body);
            let tag = first.field("etag").to_owned();
            let again = house.send_with(("root", "GET", path), &[("if-none-match", &tag)], Value::Null);
            assert_eq!(again.status, 304, "{path}");
            (tag, first.bytes)
        })
        .collect();
    let wall = json!({
        "name": "Wall", "scene": "yard", "view": {"eye_m": [7, -7, 5], "target_m": [0, 0, 0]},
        "viewer_m": [0, 0.1, 2.4], "parameters": "entities=billboards",
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [64, 48], "tile_m": [0.64, 0.48], "gap_m": [0, 0]}},
    });
    let none = [("if-none-match", "*")];
    for house in [&house, &clean] {
        let made = house.send_with(("root", "PUT", "/api/v1/walls/control"), &none, wall.clone());
        assert_eq!(made.status, 201, "{}", made.body);
    }
    let tile = "/api/v1/walls/control/tiles/r1c1/frame.png";
    let of_tile = house.get("root", tile);
    assert_eq!(of_tile.status, 200, "{}", of_tile.body);
    let tile_tag = of_tile.field("etag").to_owned();
    let again = house.send_with(("root", "GET", tile), &[("if-none-match", &tile_tag)], Value::Null);
    assert_eq!(again.status, 304, "another frame of the same instant");
    let names_north = |house: &House| {
        let present = house.bench.handle.present("yard").unwrap();
        present.entities.iter().any(|entity| entity.seen_by.iter().any(|id| id.as_str() == "north"))
    };
    assert!(names_north(&house) && !names_north(&clean));
    let mjpeg = "/api/v1/scenes/yard/view.mjpeg?width=64&height=48&rate=30";
    let mut stream = house.stream("root", mjpeg);
    let mut part = |house: &House| {
        let pieces = house.bench.runtime.block_on(stream.by_ref().take(3).collect::<Vec<_>>());
        pieces[1].as_ref().unwrap().to_vec()
    };
    let live = ways.iter().position(|path| path.contains("view.jpg")).unwrap();
    assert_eq!(part(&house), had[live].1);

    hide(&house, ("if-none-match", "*"));
    let hidden_live = house.get("root", &ways[live]).bytes;
    assert_eq!(part(&house), hidden_live, "the stream's next picture");
    assert!(!names_north(&house), "who stands where nobody may look is not told of");
    for (path, (tag, bytes)) in ways.iter().zip(&had) {
        let now = house.send_with(("root", "GET", path), &[("if-none-match", tag)], Value::Null);
        assert_eq!((now.status, now.bytes == *bytes), (200, false), "{path}");
        let expected = clean.get("root", path);
        assert!(now.bytes == expected.bytes, "{path}: not as if it never had been seen");
        let tag = now.field("etag").to_owned();
        assert_eq!(tag, expected.field("etag"), "{path}");
        let again = house.send_with(("root", "GET", path), &[("if-none-match", &tag)], Value::Null);
        assert_eq!(again.status, 304, "{path}");
    }
    let now = house.send_with(("root", "GET", tile), &[("if-none-match", &tile_tag)], Value::Null);
    assert_eq!(now.status, 200);
    assert!(now.bytes == clean.get("root", tile).bytes && now.bytes != of_tile.bytes);
    house.bench.stop();
    clean.bench.stop();
}

/// The next background of a stream of what moves.
async fn background(socket: &mut Socket) -> Vec<u8> {
    loop {
        let Message::Binary(bytes) = socket.next().await.unwrap().unwrap() else { continue };
        if let ForegroundMessage::Background(_, jpeg) = read_foreground(&bytes).unwrap() {
            return image::load_from_memory(jpeg).unwrap().into_luma8().into_raw();
        }
    }
}

#[test]
fn a_stream_of_what_moves_goes_on_with_a_background_that_hides() {
    let folder = TempDir::new().unwrap();
    let house = House::of(folder.path(), cameras(folder.path(), &[]));
    let (address, stop) = serve(&house.bench.runtime, house.router.clone());
    let token = &house.tokens.iter().find(|(name, _)| *name == "root").unwrap().1;
    let fields = [("authorization", format!("Bearer {token}"))];
    let open = async || dial(address, "/api/v1/cameras/north/foreground", &fields).await.unwrap();
    let is_grey = |luma: &[u8]| luma.iter().all(|code| code.abs_diff(luma[0]) <= 2);
    let runtime = &house.bench.runtime;
    let mut before = runtime.block_on(open());
    assert!(!is_grey(&runtime.block_on(background(&mut before))));
    hide(&house, ("if-none-match", "*"));
    let mut after = runtime.block_on(open());
    assert!(
        is_grey(&runtime.block_on(background(&mut after))),
        "the first that somebody gets who comes then"
    );
    assert!(is_grey(&runtime.block_on(background(&mut before))), "the next of who was there already");
    stop.send(()).unwrap();
}

#[test]
fn a_stream_of_what_moves_hides_what_is_hidden_of_another_camera_that_shows_the_same() {
    let folder = TempDir::new().unwrap();
    let file = pictures(folder.path(), "north", 0..20);
    let cameras = ["north", "south"].map(|id| camera(id, &file, End::Stop));
    let house = House::of(folder.path(), cameras.to_vec());
    let (address, stop) = serve(&house.bench.runtime, house.router.clone());
    let token = &house.tokens.iter().find(|(name, _)| *name == "root").unwrap().1;
    let fields = [("authorization", format!("Bearer {token}"))];
    let open = async || dial(address, "/api/v1/cameras/south/foreground", &fields).await.unwrap();
    let is_grey = |luma: &[u8]| luma.iter().all(|code| code.abs_diff(luma[0]) <= 2);
    let runtime = &house.bench.runtime;
    let mut before = runtime.block_on(open());
    assert!(!is_grey(&runtime.block_on(background(&mut before))));
    hide(&house, ("if-none-match", "*"));
    let mut after = runtime.block_on(open());
    assert!(is_grey(&runtime.block_on(background(&mut after))), "whoever comes then");
    assert!(is_grey(&runtime.block_on(background(&mut before))), "who was there already");
    stop.send(()).unwrap();
}

/// The targets of all lines of the audit log about a route.
fn noted(house: &House, action: &str) -> Vec<String> {
    let audit = house.get("root", "/api/v1/audit?limit=1000").body;
    let entries = audit["entries"].as_array().unwrap().iter();
    let of = entries.filter(|entry| entry["action"] == action);
    of.map(|entry| entry["target"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_sealed_snapshot_stays_and_what_it_shows_of_a_later_zone_is_for_admins_alone() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = House::of(folder.path(), cameras(folder.path(), &[]));
    let view = json!({"scene": "yard", "parameters": "width=64&height=48&t=200000000"});
    let of_north = json!({"camera": "north", "t": "200000000"});
    let sealed = [view.clone(), of_north.clone()].map(|body| house.make("both", body));
    let of_south = house.make("both", json!({"camera": "south", "t": "200000000"}));
    let files = |path: &str| {
        let all = ["picture.png", "cameras/north.png", "archive.tar"];
        all.map(|file| format!("{path}/{file}"))
    };
    for path in sealed.iter().flat_map(|path| files(path)) {
        assert_eq!(house.get("both", &path).status, 200, "{path}");
    }
    let tag = hide(&house, ("if-none-match", "*"));
    for path in &sealed {
        for file in files(path) {
            let refused = house.get("both", &file);
            assert_eq!(refused.status, 409, "{file}");
            assert!(refused.body["detail"].as_str().unwrap().contains("camera north"), "{}", refused.body);
            assert_eq!(house.get("half", &file).status, if path == &sealed[0] { 404 } else { 409 }, "{file}");
            assert_eq!(house.get("root", &file).status, 200, "{file}: evidence");
        }
        assert_eq!(house.get("both", path).status, 200);
        assert_eq!(house.get("both", &format!("{path}/verification")).body["is_whole"], json!(true));
    }
    assert_eq!(house.get("both", &format!("{of_south}/picture.png")).status, 200);
    // What is made from now on of that time hides it, and says so.
    let masked = [view, of_north].map(|body| house.make("both", body));
    let frame = house.get("both", "/api/v1/cameras/north/frame.png?t=200000000").bytes;
    let pixels = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgb8().into_raw();
    for path in &masked {
        assert_eq!(pixels(&house.get("both", &format!("{path}/cameras/north.png")).bytes), pixels(&frame));
        assert_eq!(house.get("both", &format!("{path}/archive.tar")).status, 200);
        let record = house.get("both", &format!("{path}/record.json")).body;
        assert_eq!(record["cameras"][0]["hidden"], json!([[[0, 0], [1, 0], [1, 1], [0, 1]]]));
        assert_eq!(record["people"], json!({"blurred": false}));
    }
    // Lifted, what was seen before stays hidden: of the past, and in what was sealed before.
    let lifted = house.send("root", "DELETE", NORTH, Some(&tag), Value::Null);
    assert_eq!(lifted.status, 200, "{}", lifted.body);
    assert_eq!(house.get("both", &format!("{}/picture.png", sealed[0])).status, 409);
    assert_eq!(house.get("both", &format!("{}/picture.png", masked[0])).status, 200);
    let id = |path: &str| path.rsplit('/').next().unwrap().to_owned();
    assert_eq!(noted(&house, "PUT /api/v1/cameras/{id}/privacy"), [format!("{NORTH}#zones=1&version=1")]);
    assert_eq!(noted(&house, "DELETE /api/v1/cameras/{id}/privacy"), [format!("{NORTH}#zones=0&version=2")]);
    let made = noted(&house, "POST /api/v1/snapshots");
    let first = format!("{ALL}#snapshot={}&people=seen&shown=1970-01-01T00:00:00.2Z", id(&sealed[0]));
    assert_eq!(made[0], first);
    assert_eq!(made.len(), 5);
    let looks = noted(&house, "GET /api/v1/snapshots/{id}/picture.png");
    assert!(looks.contains(&format!("{}/picture.png#shows_hidden=north", sealed[0])), "{looks:?}");
    assert!(looks.contains(&format!("{}/picture.png", sealed[0])), "{looks:?}");
    house.bench.stop();
}

#[test]
fn a_picture_without_a_daemon_hides_what_the_configuration_hides() {
    if !has_adapter() {
        return;
    }
    let hidden = zone("garden", &super::privacy::RIGHT);
    let scene = Arc::new(scene::parse("yard", SCENE, scene::no_imports).unwrap().scene);
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let drawn = |is_other: bool, zones: &[videofields_vision::frame::Zone]| {
        let folder = TempDir::new().unwrap();
        let south = match is_other {
            true => others(folder.path(), "south", 0..20, &hidden),
            false => pictures(folder.path(), "south", 0..20),
        };
        let north = camera("north", pictures(folder.path(), "north", 0..20), End::Stop);
        let south = CameraSettings { privacy_zones: zones.to_vec(), ..camera("south", south, End::Stop) };
        let media = MediaSettings { roots: vec![folder.path().to_owned()], ..MediaSettings::default() };
        let settings = Settings { camera: vec![north, south], media, ..Settings::default() };
        let config = Config::from_settings(settings, folder.path()).unwrap();
        view_once(&config, &scene, &request("yard", at(FRAME_NANOS * 12)), &*clock).unwrap().image
    };
    let zones = std::slice::from_ref(&hidden);
    assert_eq!(drawn(false, zones).data, drawn(true, zones).data);
    assert_ne!(drawn(false, &[]).data, drawn(true, &[]).data, "else it would say nothing");
}

#[test]
fn a_camera_that_hides_a_place_says_so_to_who_asks_who_sees_it() {
    let folder = TempDir::new().unwrap();
    let house = House::of(folder.path(), cameras(folder.path(), &[]));
    let asked = "/api/v1/scenes/yard/which-cameras?point=0,2,0";
    let order = |user: &str| {
        let found = house.get(user, asked).body;
        let one =
            |of: &Value| (of["camera"].as_str().unwrap().to_owned(), of["sees"].clone(), of["why"].clone());
        found["cameras"].as_array().unwrap().iter().map(one).collect::<Vec<_>>()
    };
    let seen = |id: &str| (id.to_owned(), json!(true), Value::Null);
    assert_eq!(order("root"), [seen("north"), seen("south")]);
    hide(&house, ("if-none-match", "*"));
    let masked = ("north".to_owned(), json!(false), json!("masked"));
    assert_eq!(order("root"), [seen("south"), masked.clone()]);
    assert_eq!(order("half"), [masked], "whoever knows of the camera");
    house.bench.stop();
}
