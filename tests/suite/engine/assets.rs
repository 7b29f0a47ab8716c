//! Files that scenes name, brought through the API: kept, shown, exchanged, refused, and there after a restart.

use super::SCENE;
use super::house::{Answer, House, answered};
use super::kept_scenes::start;
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};
use std::io::Cursor;
use std::path::Path;
use tempfile::TempDir;

const GROUND: &str = "/api/v1/assets/ground.png";
const NEW: (&str, &str) = ("if-none-match", "*");

fn picture(width: u32, srgb: [u8; 3]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let picture = image::RgbImage::from_pixel(width, 4, image::Rgb(srgb));
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn put(house: &House, path: &str, (name, value): (&str, &str), bytes: &[u8]) -> Answer {
    let request = Request::put(path).header(name, value).body(Body::from(bytes.to_vec())).unwrap();
    house.bench.runtime.block_on(answered(house.router.clone(), request))
}

/// A scene whose ground has a picture.
fn pictured(file: &str) -> String {
    let mut scene: Value = serde_json::from_str(SCENE).unwrap();
    scene["ground"][0]["texture"] = json!({"file": file, "size_m": [2, 2]});
    scene.to_string()
}

fn left(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder.join("test.assets")).unwrap();
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

#[test]
fn a_file_is_brought_named_by_a_scene_and_there_after_a_restart() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    assert_eq!(house.get("/api/v1/assets").body, json!({"assets": []}));
    assert_eq!(house.get(GROUND).status, 404);
    let lot = "/api/v1/scenes/lot";
    let early = house.send("PUT", lot, Some(NEW), &pictured("assets/ground.png"));
    assert_eq!((early.status, &early.body["errors"][0]["pointer"]), (400, &json!("/ground/0/texture/file")));

    let red = picture(6, [200, 40, 40]);
    let made = put(&house, GROUND, NEW, &red);
    assert_eq!(made.status, 201, "{}", made.body);
    assert_eq!((&made.body["file"], &made.body["bytes"]), (&json!("ground.png"), &json!(red.len())));
    assert_eq!(made.body["etag"].as_str(), made.etag.as_deref());
    let shown = house.get(GROUND);
    assert_eq!((shown.status, shown.field("content-type"), &shown.bytes), (200, "image/png", &red));
    assert_eq!(shown.etag, made.etag);
    let tag = made.etag.unwrap();
    assert_eq!(house.send("GET", GROUND, Some(("if-none-match", &tag)), "").status, 304);
    assert_eq!(put(&house, GROUND, NEW, &red).status, 412);
    assert_eq!(house.send("PUT", GROUND, None, "").status, 428);

    let scene = house.send("PUT", lot, Some(NEW), &pictured("assets/ground.png"));
    assert_eq!(scene.status, 201, "{}", scene.body);
    assert_eq!(scene.body["ground"][0]["texture"]["file"], "assets/ground.png");
    let texture = |house: &House| {
        let scene = house.bench.handle.scene("lot").unwrap();
        format!("{:?}", scene.materials)
    };
    assert!(texture(&house).contains("6 x 4"), "{}", texture(&house));

    // What a scene names stays; exchanged, the scene shows the new one, or what does not fit is refused.
    let refused = house.send("DELETE", GROUND, Some(("if-match", "*")), "");
    assert_eq!(refused.status, 409, "{}", refused.body);
    assert!(refused.body["detail"].as_str().unwrap().contains("lot"), "{}", refused.body);
    assert_eq!(put(&house, GROUND, ("if-match", "\"other\""), &red).status, 412);
    let mut broken = picture(8, [1, 2, 3]);
    broken.truncate(broken.len() - 20);
    let misfit = put(&house, GROUND, ("if-match", &tag), &broken);
    assert_eq!(misfit.status, 409, "{}", misfit.body);
    assert_eq!(house.get(GROUND).bytes, red);
    let exchanged = put(&house, GROUND, ("if-match", &tag), &picture(8, [40, 200, 40]));
    assert_eq!(exchanged.status, 200, "{}", exchanged.body);
    assert_ne!(exchanged.etag.as_deref(), Some(tag.as_str()));
    assert!(texture(&house).contains("8 x 4"), "{}", texture(&house));
    assert_eq!(left(folder.path()), ["ground.png"]);
    let audit = house.get("/api/v1/audit").body.to_string();
    assert!(audit.contains("PUT /api/v1/assets/{file}"), "{audit}");

    house.bench.stop();
    std::fs::write(folder.path().join("test.assets/.part-killed"), "half").unwrap();
    let house = start(folder.path());
    assert!(texture(&house).contains("8 x 4"), "{}", texture(&house));
    assert_eq!(left(folder.path()), ["ground.png"]);
    assert_eq!(house.get(GROUND).etag, exchanged.etag);
    assert_eq!(house.send("DELETE", lot, Some(("if-match", "*")), "").status, 204);
    assert_eq!(house.send("DELETE", GROUND, Some(("if-match", "\"0\"")), "").status, 412);
    assert_eq!(house.send("DELETE", GROUND, Some(("if-match", &exchanged.etag.unwrap())), "").status, 204);
    assert_eq!(house.send("DELETE", GROUND, Some(("if-match", "*")), "").status, 404);
    assert!(left(folder.path()).is_empty());
    house.bench.stop();
}

#[test]
fn what_is_no_such_file_is_refused() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let png = picture(4, [9; 3]);
    let check = |path: &str, bytes: &[u8], status: u16| {
        let answer = put(&house, path, NEW, bytes);
        assert_eq!(answer.status, status, "{path}: {}", answer.body);
    };
    for name in ["a.gif", "A.png", ".a.png", "..%2fa.png", "a%20b.png", "png", "a.gltf"] {
        check(&format!("/api/v1/assets/{name}"), &png, 400);
    }
    check("/api/v1/assets/a.jpg", &png, 400);
    check("/api/v1/assets/a.glb", &png, 400);
    check("/api/v1/assets/a.ply", &png, 400);
    check("/api/v1/assets/a.png", b"", 400);
    check("/api/v1/assets/a.png?x=1", &png, 400);
    check("/api/v1/assets/a.png", &vec![0; (64 << 20) + 1], 413);
    assert_eq!(house.get("/api/v1/assets/..%2ftest.sqlite").status, 404);
    assert!(!folder.path().join("test.assets").is_dir());
    // A scene finds beside itself what nobody brought, and nothing through a link.
    std::fs::create_dir(folder.path().join("test.assets")).unwrap();
    std::os::unix::fs::symlink("/etc/passwd", folder.path().join("test.assets/link.png")).unwrap();
    let lot = house.send("PUT", "/api/v1/scenes/lot", Some(NEW), &pictured("assets/link.png"));
    assert_eq!(lot.status, 400, "{}", lot.body);
    std::fs::create_dir(folder.path().join("assets")).unwrap();
    std::fs::write(folder.path().join("assets/own.png"), &png).unwrap();
    let lot = house.send("PUT", "/api/v1/scenes/lot", Some(NEW), &pictured("assets/own.png"));
    assert_eq!(lot.status, 201, "{}", lot.body);
    house.bench.stop();
}
