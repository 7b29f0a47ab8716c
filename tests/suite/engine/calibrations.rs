//! Calibrations through the API while the engine runs: what is told of them, who replaces them, and what follows.

use super::house::{Answer, House, answered};
use super::kept_scenes::{bench, start};
use super::{SCENE, rights};
use axum::body::Body;
use axum::http::Request;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use std::sync::Arc;
use tempfile::TempDir;
use videofields_recording::accounts::{Accounts, UserChange};
use videofields_service::engine::LocateMethod;
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock};

const ALL: &str = "/api/v1/calibrations";
const NORTH: &str = "/api/v1/calibrations/north";
const SOUTH: &str = "/api/v1/calibrations/south";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// A point through three rows of a matrix.
fn through(rows: &Value, point: DVec3) -> DVec3 {
    let row = |idx: usize| {
        let row = &rows[idx];
        let shift = row.get(3).map_or(0.0, number);
        number(&row[0]) * point.x + number(&row[1]) * point.y + number(&row[2]) * point.z + shift
    };
    DVec3::new(row(0), row(1), row(2))
}

/// A calibration by OpenCV's names, of what an answer says.
fn as_opencv(told: &Value) -> Value {
    let rows: Vec<&Value> = (0..3).map(|idx| &told["camera_from_world"][idx]).collect();
    let turn: Vec<_> = rows.iter().map(|row| json!([row[0], row[1], row[2]])).collect();
    let shift: Vec<_> = rows.iter().map(|row| &row[3]).collect();
    json!({
        "image_width": 64, "image_height": 48, "K": [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]], "R": turn, "t": shift,
    })
}

#[test]
fn a_calibration_is_told_with_what_it_means() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let told = house.get(NORTH);
    assert_eq!((told.status, told.field("cache-control")), (200, "no-store"));
    assert_eq!((&told.body["camera"], &told.body["scene"]), (&json!("north"), &json!("yard")));
    let scene = house.get("/api/v1/scenes/yard").body;
    assert_eq!(told.body["calibration"]["position_m"], scene["cameras"][0]["calibration"]["position_m"]);
    assert_eq!(told.body["source"]["kind"], "configuration");
    assert!(told.body["source"]["file"].as_str().unwrap().ends_with("yard.json"), "{}", told.body);

    // The matrices put places where the camera model does.
    let model = Arc::clone(&house.bench.handle.scene("yard").unwrap().cameras[0].camera);
    for point in [DVec3::ZERO, DVec3::new(1.0, -2.0, 0.5), DVec3::new(-2.0, 1.5, 1.8)] {
        let local = through(&told.body["camera_from_world"], point);
        let back = through(&told.body["world_from_camera"], local);
        assert!(back.distance(point) < 1e-12, "{point}: {back}");
        let pixel = through(&told.body["camera_matrix_px"], local / local.z);
        let texture = DVec2::new(pixel.x / 64.0, pixel.y / 48.0);
        let projected = model.project(point).unwrap();
        assert!(projected.texture.distance(texture) < 1e-12, "{point}");
        assert!((projected.depth_m - local.z).abs() < 1e-12, "{point}");
    }

    // Who has it is spared it, and the list says which tags are good.
    let tag = told.etag.unwrap();
    let again = house.send("GET", NORTH, Some(("if-none-match", &tag)), "");
    assert_eq!((again.status, again.bytes.len(), again.etag.as_deref()), (304, 0, Some(tag.as_str())));
    let all = house.get(ALL).body;
    let place = |of: &Value| [of["camera"].clone(), of["scene"].clone()];
    let places: Vec<_> = all["calibrations"].as_array().unwrap().iter().map(place).collect();
    assert_eq!(places, [["north", "yard"], ["south", "yard"]]);
    assert_eq!((&all["calibrations"][0]["etag"], &all["next"]), (&json!(tag), &Value::Null));
    assert_ne!(all["calibrations"][1]["etag"], json!(tag));

    // In pages, camera by camera and scene by scene.
    let lot = house.send("PUT", "/api/v1/scenes/lot", Some(("if-none-match", "*")), SCENE);
    assert_eq!(lot.status, 201, "{}", lot.body);
    let mut places = Vec::new();
    let mut path = format!("{ALL}?limit=1");
    while places.len() < 9 {
        let page = house.get(&path);
        places.extend(page.body["calibrations"].as_array().unwrap().iter().map(place));
        let Some(next) = page.body["next"].as_str() else { break };
        path = format!("{ALL}?limit=1&cursor={next}");
        assert_eq!(page.field("link"), format!("<{path}>; rel=\"next\""));
    }
    let expected =
        ["north", "south"].map(|camera| ["lot", "yard"].map(|scene| [json!(camera), json!(scene)]));
    assert_eq!(places, expected.concat());
    assert_eq!(house.get(&format!("{ALL}?scene=lot")).body["calibrations"].as_array().unwrap().len(), 2);
    assert_eq!(
        house.get(&format!("{NORTH}?scene=lot")).body["source"],
        json!({"kind": "kept", "file": null})
    );
    assert_eq!(house.get(&format!("{NORTH}?scene=nowhere")).status, 404);
    assert_eq!(house.get(&format!("{ALL}/west")).status, 404);
    house.bench.stop();
}

#[test]
fn a_calibration_is_replaced_while_the_engine_runs_and_stays_so() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let first = house.get(NORTH);
    let tag = first.etag.clone().unwrap();
    let located = |house: &House| {
        let middle = DVec2::splat(0.5);
        DVec3::from(house.bench.handle.locate("north", middle, None, LocateMethod::Ray).unwrap().point_m)
    };
    let mapped = |house: &House| {
        let found = house.bench.handle.locate("north", DVec2::splat(0.5), None, LocateMethod::Map);
        found.ok().map(|found| DVec3::from(found.point_m))
    };
    let before = located(&house);
    let south = house.get(SOUTH);
    let mut moved = first.body["calibration"].clone();
    moved["position_m"] = json!([1.25, 8, 6]);
    let moved = moved.to_string();

    // Without a condition, or with another's, nothing changes.
    assert_eq!(house.send("PUT", NORTH, None, &moved).status, 428);
    let stale = house.send("PUT", NORTH, Some(("if-match", south.etag.as_deref().unwrap())), &moved);
    assert_eq!(stale.status, 412, "{}", stale.body);
    assert_eq!(house.send("PUT", NORTH, Some(("if-match", "\"0\"")), &moved).status, 412);
    assert_eq!(house.send("PUT", NORTH, Some(("if-none-match", "*")), &moved).status, 412);
    let tried = house.send("PUT", &format!("{NORTH}?validate_only=true"), None, &moved);
    assert_eq!((tried.status, tried.etag), (200, None), "{}", tried.body);
    assert_eq!(tried.body["calibration"]["position_m"], json!([1.25, 8.0, 6.0]));
    assert_eq!((house.get(NORTH).etag.as_deref(), located(&house)), (Some(tag.as_str()), before));

    let changed = house.send("PUT", NORTH, Some(("if-match", &tag)), &moved);
    assert_eq!(changed.status, 200, "{}", changed.body);
    let now = house.get(NORTH);
    assert_eq!((&now.body, &now.etag), (&changed.body, &changed.etag));
    assert_ne!(now.etag.as_deref(), Some(tag.as_str()));
    assert_eq!(now.body["source"]["kind"], "kept");
    // In force at once, and the map is built anew.
    assert!((located(&house) - before).distance(DVec3::new(1.25, 0.0, 0.0)) < 1e-9, "{}", located(&house));
    let map = wait_for("the new map", || mapped(&house));
    assert!((map - located(&house)).length() < 1e-3, "{map}");
    // As a version of the scene, of which all else stays.
    let scene = house.get("/api/v1/scenes/yard");
    assert_eq!(scene.etag.as_deref(), Some("\"1\""));
    assert_eq!(scene.body["cameras"][0]["calibration"], now.body["calibration"]);
    assert_eq!(house.get(SOUTH).body["calibration"], south.body["calibration"]);
    assert_eq!(house.send("PUT", NORTH, Some(("if-match", &tag)), &moved).status, 412, "somebody was faster");
    let audit = house.get("/api/v1/audit").body;
    let noted = |status: i64| {
        let is_it = |entry: &&Value| {
            entry["action"] == "PUT /api/v1/calibrations/{camera}" && entry["status"] == status
        };
        audit["entries"].as_array().unwrap().iter().filter(is_it).count()
    };
    // A trial changed nothing and is not noted; the first refusal of a kind is.
    assert_eq!((noted(200), noted(412)), (1, 1), "{audit}");
    assert!(!audit.to_string().contains("validate_only"), "{audit}");

    // It is there after a restart; another format says the same.
    house.bench.stop();
    let house = start(folder.path());
    let again = house.get(NORTH);
    assert_eq!((&again.body, &again.etag), (&now.body, &now.etag));
    let opencv = as_opencv(&first.body).to_string();
    let taken = house.send("PUT", &format!("{NORTH}?format=opencv"), Some(("if-match", "*")), &opencv);
    assert_eq!(taken.status, 200, "{}", taken.body);
    assert!(located(&house).distance(before) < 1e-9, "{}", located(&house));
    let center = taken.body["calibration"]["center_px"].clone();
    assert_eq!(center, json!([32.0, 24.0]), "pixel centres lie at +0.5 here");
    house.bench.stop();
}

#[test]
fn a_bad_calibration_changes_nothing_and_is_told_with_its_place() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let first = house.get(NORTH);
    let good = first.body["calibration"].to_string();
    let check = |query: &str, body: &str, status: u16, place: (&str, &str), said: &str| {
        let path = format!("{NORTH}{query}");
        let answer = house.send("PUT", &path, Some(("if-match", "*")), body);
        assert_eq!(answer.status, status, "{query} {body}: {}", answer.body);
        let error = &answer.body["errors"][0];
        assert_eq!(error[place.0], place.1, "{query} {body}: {}", answer.body);
        assert!(error["detail"].as_str().unwrap().contains(said), "{query} {body}: {}", answer.body);
    };
    let pointer = |place| ("pointer", place);
    check("", &good.replace("[60.0,60.0]", "[60.0,-60.0]"), 400, pointer("/focal_px"), "focal length");
    check("", &good.replace("[60.0,60.0]", "[60.0,\"60\"]"), 400, pointer("/focal_px/1"), "f64");
    check("?format=json", "{", 400, pointer(""), "line 1");
    let yaml = "%YAML:1.0\n---\nK: [[60, 0, 31.5], [0, 60, 23.5]\nR: {";
    check("?format=opencv", yaml, 400, pointer(""), "line ");
    let mut skewed = as_opencv(&first.body);
    skewed["K"][0][1] = json!(3);
    check("", &skewed.to_string(), 501, pointer("/K"), "skew");
    check("?entry=left", &json!({"cameras": []}).to_string(), 400, ("parameter", "entry"), "left");
    check("", "hello", 400, ("parameter", "format"), "none of");
    check("?format=cake", &good, 400, ("parameter", "format"), "one of json");
    check("?image_size_px=64", &good, 400, ("parameter", "image_size_px"), "768x576");
    check("?image_size_px=32x24", &good, 400, pointer("/image_size_px"), "64 x 48");
    let not_text = house.bench.runtime.block_on(answered(
        house.router.clone(),
        Request::put(NORTH).header("if-match", "*").body(Body::from(vec![b'{', 0xff])).unwrap(),
    ));
    assert_eq!(not_text.status, 400, "{}", not_text.body);
    assert_eq!(house.send("PUT", NORTH, Some(("if-match", "*")), &" ".repeat((1 << 20) + 1)).status, 413);
    assert_eq!(house.send("PUT", &format!("{ALL}/west"), Some(("if-match", "*")), &good).status, 404);
    assert_eq!(house.send("PUT", &format!("{NORTH}?scene=lot"), Some(("if-match", "*")), &good).status, 404);
    assert_eq!(house.send("DELETE", NORTH, Some(("if-match", "*")), "").status, 405);
    let stands = house.get(NORTH);
    assert_eq!((&stands.body, &stands.etag), (&first.body, &first.etag));
    assert_eq!(house.get("/api/v1/scenes/yard").etag.as_deref(), Some("\"0\""));
    house.bench.stop();
}

/// Asks as who has that token.
fn ask(house: &House, token: &str, method: &str, path: &str, condition: Option<&str>, body: &str) -> Answer {
    let mut request = Request::builder().method(method).uri(path);
    request = request.header("authorization", format!("Bearer {token}"));
    if let Some(tag) = condition {
        request = request.header("if-match", tag);
    }
    let request = request.body(Body::from(body.to_owned())).unwrap();
    house.bench.runtime.block_on(answered(house.router.clone(), request))
}

#[test]
fn who_manages_a_camera_calibrates_it_and_learns_of_no_other() {
    let folder = TempDir::new().unwrap();
    let bench = bench(folder.path());
    // An admin, and an operator who sees `north` and does not manage it.
    let [root, guest] = rights::accounts(&bench);
    let [keeper, viewer] = bench.runtime.block_on(async {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let accounts = Accounts::open(bench.store.clone(), clock).await.unwrap();
        let mut tokens = Vec::new();
        for (name, role) in [("keeper", "operator"), ("viewer", "viewer")] {
            let body = json!({"role": role, "cameras": {"north": ["live", "manage"]}});
            accounts.put_user(name, UserChange::read(body).unwrap(), None).await.unwrap();
            tokens.push(accounts.add_token(name, String::new(), None).await.unwrap().1);
        }
        <[String; 2]>::try_from(tokens).unwrap()
    });
    let house = House::over(folder.path(), bench, ("yard", SCENE));
    let get = |token: &str, path: &str| ask(&house, token, "GET", path, None, "");
    let put =
        |token: &str, path: &str, tag: &str, body: &str| ask(&house, token, "PUT", path, Some(tag), body);
    let calibration = get(&root, NORTH).body["calibration"].clone();
    let text = calibration.to_string();

    for token in [&guest, &keeper, &viewer] {
        let north = get(token, NORTH);
        assert_eq!((north.status, &north.body["source"]), (200, &Value::Null), "{}", north.body);
        let all = get(token, ALL).body;
        assert_eq!(all["calibrations"].as_array().unwrap().len(), 1, "{all}");
        // The other camera is not there, for looks and for changes.
        let renamed = |answer: Answer| (answer.status, answer.body.to_string().replace("south", "mouth"));
        let nowhere = "/api/v1/calibrations/mouth";
        assert_eq!(renamed(get(token, SOUTH)), renamed(get(token, nowhere)));
        assert_eq!(renamed(put(token, SOUTH, "*", &text)), renamed(put(token, nowhere, "*", &text)));
        assert_eq!((get(token, SOUTH).status, put(token, SOUTH, "*", &text).status), (404, 404));
    }
    assert_eq!(put(&guest, NORTH, "*", &text).status, 403, "without the right");
    assert_eq!(put(&viewer, NORTH, "*", &text).status, 403, "without the role");
    assert_eq!(put(&viewer, &format!("{NORTH}?validate_only=true"), "*", &text).status, 403);

    // A change of the hidden camera is none of the keeper's: the tag stays good.
    let seen = get(&keeper, NORTH).etag.unwrap();
    let mut moved = get(&root, SOUTH).body["calibration"].clone();
    moved["position_m"] = json!([0.5, -8.5, 6.5]);
    assert_eq!(put(&root, SOUTH, "*", &moved.to_string()).status, 200);
    assert_eq!(get(&keeper, NORTH).etag.as_deref(), Some(seen.as_str()));
    let mut own = calibration;
    own["position_m"] = json!([0.25, 8.5, 6.5]);
    let kept = put(&keeper, NORTH, &seen, &own.to_string());
    assert_eq!((kept.status, &kept.body["source"]), (200, &Value::Null), "{}", kept.body);
    assert!(!kept.body.to_string().contains("south"), "{}", kept.body);
    assert_eq!(get(&keeper, NORTH).etag, kept.etag);
    assert_eq!(get(&root, SOUTH).body["calibration"]["position_m"], json!([0.5, -8.5, 6.5]));
    let versions = get(&root, "/api/v1/scenes/yard/versions").body;
    assert_eq!(
        (&versions["versions"][0]["version"], &versions["versions"][0]["changed_by"]),
        (&json!(2), &json!("keeper"))
    );
    // Who was too late is not told how often the scene was changed.
    let late = put(&keeper, NORTH, &seen, &own.to_string());
    assert_eq!(late.status, 412);
    assert_eq!(late.body["detail"], "the calibration was changed meanwhile: look at it again");
    house.bench.stop();
}
