//! Scenes changed through the API while the engine runs: what is shown, kept, refused, restored and there after a restart.

use super::house::House;
use super::{Bench, SCENE, camera, pictures, request};
use axum::body::Body;
use axum::http::Request;
use serde_json::json;
use std::path::Path;
use tempfile::TempDir;
use tower::ServiceExt;
use videofields_service::engine::{At, LocateMethod};
use videofields_vision::config::{End, Settings};

pub(super) fn start(folder: &Path) -> House {
    House::over(folder, bench(folder), ("yard", SCENE))
}

/// An engine without scenes, over two cameras.
pub(super) fn bench(folder: &Path) -> Bench {
    let mut settings = Settings::default();
    settings.media.roots = vec![folder.to_owned()];
    settings.camera = vec![
        camera("north", pictures(folder, "north", 0..30), End::Loop),
        camera("south", pictures(folder, "south", 0..30), End::Loop),
    ];
    Bench::start(folder, settings, &[])
}

fn ids(house: &House) -> Vec<String> {
    let listed = house.get("/api/v1/scenes").body;
    listed["scenes"].as_array().unwrap().iter().map(|of| of["id"].as_str().unwrap().to_owned()).collect()
}

const YARD: &str = "/api/v1/scenes/yard";

/// The yard with grass for ground.
fn green() -> String {
    SCENE.replace("#705030", "#20a030").replace("\"Yard\"", "\"Green yard\"")
}

#[test]
fn a_scene_is_changed_while_it_is_shown_and_stays_so() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    house.bench.wait_for_state("north", "live");
    let first = house.get(YARD);
    assert_eq!((first.status, first.etag.as_deref()), (200, Some("\"0\"")));

    // Without a condition, or with another's, nothing changes.
    assert_eq!(house.send("PUT", YARD, None, &green()).status, 428);
    assert_eq!(house.send("PUT", YARD, Some(("if-match", "\"7\"")), &green()).status, 412);
    assert_eq!(house.send("PUT", YARD, Some(("if-none-match", "*")), &green()).status, 412);
    assert_eq!(house.get(YARD).body["name"], "Yard");

    let changed = house.send("PUT", YARD, Some(("if-match", "\"0\"")), &green());
    assert_eq!((changed.status, changed.etag.as_deref()), (200, Some("\"1\"")), "{}", changed.body);
    assert_eq!(house.get(YARD).body["ground"][0]["color_srgb"], "#20a030");
    assert_eq!(house.bench.handle.scene("yard").unwrap().name, "Green yard");
    if super::has_adapter() {
        let shown = house.bench.view(request("yard", At::Live)).unwrap();
        assert!(shown.plan.reasons.iter().any(|reason| reason.is_on));
    }
    // Its maps are made anew.
    let located = || house.bench.handle.locate("north", glam::DVec2::splat(0.5), None, LocateMethod::Map);
    videofields_testing::wait_for("the map of the new scene", || located().ok());

    // Two who saw the same version: the second is told that there is a newer one.
    let patch = json!({"name": "Lawn", "view": {"eye_m": [7, -7, 5], "target_m": [0, 0, 0]}}).to_string();
    let patched = house.send("PATCH", YARD, Some(("if-match", "\"1\"")), &patch);
    assert_eq!((patched.status, patched.etag.as_deref()), (200, Some("\"2\"")), "{}", patched.body);
    let late = house.send("PATCH", YARD, Some(("if-match", "\"1\"")), &patch);
    assert_eq!(late.status, 412, "{}", late.body);
    assert_eq!(late.body["detail"], "it was changed meanwhile: its version is 2");
    assert_eq!(house.get(YARD).body["ground"][0]["color_srgb"], "#20a030", "what no patch names stays");

    // Another scene, of no file.
    let lot = "/api/v1/scenes/lot";
    let made = house.send("PUT", lot, Some(("if-none-match", "*")), SCENE);
    assert_eq!((made.status, made.etag.as_deref()), (201, Some("\"1\"")), "{}", made.body);
    assert_eq!(ids(&house), ["yard", "lot"]);

    // All of it is there after a restart.
    house.bench.stop();
    let house = start(folder.path());
    assert_eq!(ids(&house), ["yard", "lot"]);
    let again = house.get(YARD);
    assert_eq!((again.body["name"].as_str(), again.etag.as_deref()), (Some("Lawn"), Some("\"2\"")));

    // Versions: what, when and by whom; and back.
    let versions = house.get("/api/v1/scenes/yard/versions").body;
    let numbers: Vec<_> = versions["versions"].as_array().unwrap().iter().map(|of| &of["version"]).collect();
    assert_eq!(numbers, [2, 1], "{versions}");
    assert!(versions["versions"][0]["changed_at"].as_str().unwrap().ends_with('Z'), "{versions}");
    let page = house.get("/api/v1/scenes/yard/versions?limit=1").body;
    assert_eq!((&page["is_complete"], &page["next"]), (&json!(false), &json!("2")));
    let page = house.get("/api/v1/scenes/yard/versions?limit=1&cursor=2").body;
    assert_eq!((&page["versions"][0]["version"], &page["is_complete"]), (&json!(1), &json!(true)));
    assert_eq!(house.get("/api/v1/scenes/yard/versions/1").body["name"], "Green yard");
    assert_eq!(house.get("/api/v1/scenes/yard/versions/9").status, 404);
    assert_eq!(house.get("/api/v1/scenes/yard/versions/x").status, 400);
    let restore = "/api/v1/scenes/yard/versions/1/restore";
    assert_eq!(house.send("POST", restore, None, "").status, 428);
    let restored = house.send("POST", restore, Some(("if-match", "\"2\"")), "");
    assert_eq!((restored.status, restored.etag.as_deref()), (200, Some("\"3\"")), "{}", restored.body);
    assert_eq!(house.get(YARD).body["name"], "Green yard");

    // Away with it: the configuration's comes back, and a scene of no file is gone.
    assert_eq!(house.send("DELETE", YARD, Some(("if-match", "\"3\"")), "").status, 204);
    let back = house.get(YARD);
    assert_eq!((back.body["name"].as_str(), back.etag.as_deref()), (Some("Yard"), Some("\"4\"")));
    let refused = house.send("DELETE", YARD, Some(("if-match", "*")), "");
    assert_eq!(refused.status, 409, "{}", refused.body);
    assert_eq!(house.send("DELETE", lot, Some(("if-match", "*")), "").status, 204);
    assert_eq!(house.get(lot).status, 404);
    assert_eq!(ids(&house), ["yard"]);
    assert_eq!(house.send("DELETE", lot, Some(("if-match", "*")), "").status, 404);
    house.bench.stop();
}

#[test]
fn a_bad_document_changes_nothing_and_is_told_with_its_places() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let check = |body: &str, status: u16, pointer: &str| {
        let answer = house.send("PUT", YARD, Some(("if-match", "\"0\"")), body);
        assert_eq!(answer.status, status, "{body}: {}", answer.body);
        let errors = answer.body["errors"].as_array().cloned().unwrap_or_default();
        let told = errors.iter().any(|error| error["pointer"] == pointer);
        assert!(told || status == 413, "{pointer}: {}", answer.body);
    };
    check("{", 400, "");
    check("[]", 400, "");
    check(&SCENE.replace("\"height_m\": 0", "\"height_m\": \"low\""), 400, "/ground/0/height_m");
    check(&SCENE.replace("[60, 60]", "[60, 1e999]"), 400, "");
    check(&SCENE.replace("[60, 60]", "[60, -60]"), 400, "/cameras/0/calibration/focal_px");
    check(&SCENE.replace("\"version\": 1", "\"version\": 99"), 400, "/version");
    let deep = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    check(&deep, 400, "");
    check(&" ".repeat((4 << 20) + 1), 413, "");
    let outside = r#"{"version": 1, "models": [{"id": "m", "file": "../../../../etc/passwd", "position_m": [0, 0, 0]}]}"#;
    check(outside, 400, "/models/0/file");

    // Only tried: what would be kept, or why not; nothing is.
    let tried = house.send("PUT", "/api/v1/scenes/yard?validate_only=true", None, &green());
    assert_eq!((tried.status, &tried.body["is_valid"]), (200, &json!(true)), "{}", tried.body);
    assert_eq!(tried.body["document"]["name"], "Green yard");
    let wrong =
        house.send("PATCH", "/api/v1/scenes/yard?validate_only=true", Some(("if-none-match", "\"1\"")), "{}");
    assert_eq!((wrong.status, &wrong.body["errors"][0]["parameter"]), (400, &"If-None-Match".into()));
    let tried = house.send("PATCH", "/api/v1/scenes/yard?validate_only=true", None, "{\"version\": 2}");
    assert_eq!(tried.status, 400);
    assert_eq!(house.send("PUT", "/api/v1/scenes/No!", Some(("if-none-match", "*")), SCENE).status, 400);
    assert_eq!(house.send("POST", YARD, None, SCENE).status, 405);

    let stands = house.get(YARD);
    assert_eq!((stands.body["name"].as_str(), stands.etag.as_deref()), (Some("Yard"), Some("\"0\"")));
    assert!(
        house
            .bench
            .runtime
            .block_on(house.bench.store.newest_documents(videofields_recording::store::DocumentKind::Scene))
            .unwrap()
            .is_empty()
    );
    house.bench.stop();
}

#[test]
fn of_many_who_change_one_version_at_once_one_wins() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    for version in 0..8 {
        let tag = format!("\"{version}\"");
        let statuses = house.bench.runtime.block_on(async {
            let tries = (0..8).map(|writer| {
                let body = json!({"name": format!("Yard of {writer}")}).to_string();
                let request = Request::builder()
                    .method("PATCH")
                    .uri(YARD)
                    .header("if-match", &tag)
                    .body(Body::from(body));
                let router = house.router.clone();
                tokio::spawn(async move { router.oneshot(request.unwrap()).await.unwrap().status().as_u16() })
            });
            let tries: Vec<_> = tries.collect();
            let mut statuses = Vec::new();
            for tried in tries {
                statuses.push(tried.await.unwrap());
            }
            statuses
        });
        assert_eq!(statuses.iter().filter(|status| **status == 200).count(), 1, "{statuses:?}");
        assert!(statuses.iter().all(|status| matches!(status, 200 | 412)), "{statuses:?}");
    }
    assert_eq!(house.get(YARD).etag.as_deref(), Some("\"8\""));
    house.bench.stop();
}

#[test]
fn scenes_go_to_other_programs_and_come_back_over_http() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let export = |format: &str| house.get(&format!("{YARD}/export?format={format}"));
    let own = export("videofields");
    assert_eq!((own.status, own.field("content-type")), (200, "application/json"));
    assert_eq!(own.body, house.get(YARD).body);
    let gltf = export("gltf");
    assert_eq!((gltf.status, gltf.field("content-type")), (200, "model/gltf+json"));
    assert_eq!(gltf.field("content-disposition"), "attachment; filename=\"yard.gltf\"");
    assert_eq!(gltf.body["asset"]["version"], "2.0");
    let glb = export("glb");
    assert_eq!((glb.field("content-type"), &glb.bytes[..4]), ("model/gltf-binary", b"glTF".as_slice()));
    let had = glb.etag.as_deref().map(|tag| ("if-none-match", tag));
    assert_eq!(house.send("GET", &format!("{YARD}/export?format=glb"), had, "").status, 304);
    assert_eq!(export("obj").status, 400);
    assert_eq!(house.get("/api/v1/scenes/nowhere/export?format=gltf").status, 404);

    let import = format!("{YARD}/import?format=gltf");
    let file = String::from_utf8(gltf.bytes).unwrap().replace("\"Yard\"", "\"Imported\"");
    // On the conditions of PUT.
    assert_eq!(house.send("POST", &import, None, &file).status, 428);
    assert_eq!(house.send("POST", &import, Some(("if-match", "\"7\"")), &file).status, 412);
    assert_eq!(house.send("POST", &import, Some(("if-none-match", "*")), &file).status, 412);
    let tried = house.send("POST", &format!("{import}&validate_only=true"), None, &file);
    assert_eq!((tried.status, &tried.body["is_valid"]), (200, &json!(true)), "{}", tried.body);
    assert_eq!(house.get(YARD).body["name"], "Yard", "it was only tried");
    let taken = house.send("POST", &import, Some(("if-match", "\"0\"")), &file);
    assert_eq!((taken.status, taken.etag.as_deref()), (200, Some("\"1\"")), "{}", taken.body);
    assert_eq!((&taken.body["warnings"], &taken.body["document"]["name"]), (&json!([]), &json!("Imported")));
    assert_eq!(house.bench.handle.scene("yard").unwrap().name, "Imported");

    // What is at fault is told by its place in the file, and what is shown stays.
    for (from, to, pointer) in [
        ("\"count\":", "\"count\":2147483648,\"was\":", "/accessors/0/count"),
        ("data:application/octet-stream;base64,", "file:///etc/passwd", "/buffers/0/uri"),
        ("\"id\":\"north\"", "\"id\":\"No id\"", "/nodes/0/extras/videofields"),
        ("\"asset\":", "\"asset\":{},\"asset\":", "/asset"),
    ] {
        assert!(file.contains(from), "{from}");
        let bad = house.send("POST", &import, Some(("if-match", "*")), &file.replacen(from, to, 1));
        assert_eq!(bad.status, 400, "{}", bad.body);
        assert!(bad.body["errors"][0]["pointer"].as_str().unwrap().starts_with(pointer), "{}", bad.body);
    }
    assert_eq!(house.send("PUT", &import, None, "").status, 405);
    assert_eq!(house.get(YARD).etag.as_deref(), Some("\"1\""));

    // A new scene, of the paper's.
    let paper = export("paper");
    assert_eq!(paper.body["cameras"][0]["matrixWorld"].as_array().unwrap().len(), 16);
    let paper = String::from_utf8(paper.bytes).unwrap().replace("\"fov\"", "\"film\": 35, \"fov\"");
    let path = "/api/v1/scenes/copy/import?format=paper";
    let made = house.send("POST", path, Some(("if-none-match", "*")), &paper);
    assert_eq!((made.status, made.etag.as_deref()), (201, Some("\"1\"")), "{}", made.body);
    assert_eq!(made.body["warnings"][0]["pointer"], "/cameras/0/film");
    assert_eq!(ids(&house), ["yard", "copy"]);
    house.bench.stop();
}
