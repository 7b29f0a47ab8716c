//! Cameras that are worked out of what a person showed in a picture, and other programs' calibrations: told, and kept
//! nowhere.

use super::users::{House, Shows};
use super::{Answer, Bench};
use axum::body::Body;
use axum::http::Request;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::geometry::{Camera, Distortion, Pose};

const SOLVE: &str = "/api/v1/calibrations/solve";
const VANISHING: &str = "/api/v1/calibrations/vanishing";
const IMPORT: &str = "/api/v1/calibrations/import";

async fn post(bench: &Bench, path: &str, body: String) -> Answer {
    bench.send(Request::post(path).body(Body::from(body)).unwrap()).await
}

fn camera() -> Camera {
    let pose = Pose::looking_at(DVec3::new(9.0, -11.0, 6.0), DVec3::new(0.5, 0.5, 0.0)).unwrap();
    let center_px = DVec2::new(320.0, 180.0);
    Camera::new((640, 360), DVec2::splat(500.0), center_px, Distortion::None, pose).unwrap()
}

/// Places where the camera shows them.
fn pairs(n: usize) -> Vec<Value> {
    let places = [[-4, -3, 0], [4, -3, 0], [5, 4, 0], [-5, 5, 0], [0, 0, 2], [2, 7, 1], [-1, 3, 3]];
    let pair = |place: &[i32; 3]| {
        let shown = camera().project(DVec3::from(place.map(f64::from))).unwrap().texture;
        json!({"picture_px": (shown * DVec2::new(640.0, 360.0)).to_array(), "place_m": place})
    };
    places[..n].iter().map(pair).collect()
}

fn asked(n: usize) -> Value {
    json!({"image_size_px": [640, 360], "pairs": pairs(n)})
}

/// Where an answer says that the body is wrong.
fn pointers(answer: &Answer, path: &str) -> Vec<String> {
    let problem = answer.problem(400, path);
    let errors = problem["errors"].as_array().unwrap();
    errors.iter().map(|error| error["pointer"].as_str().unwrap().to_owned()).collect()
}

#[tokio::test]
async fn pairs_give_the_camera_that_shows_them() {
    let bench = Bench::new();
    let check = async |body: Value| {
        let answer = post(&bench, SOLVE, body.to_string()).await;
        assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
        assert_eq!(answer.field("cache-control"), "no-store");
        let told = answer.json();
        let found: CameraDocument = serde_json::from_value(told["calibration"].clone()).unwrap();
        let off = DVec3::from(found.position_m) - camera().pose().position_in_world;
        assert!(off.length() < 1e-4, "{told}");
        assert!((found.focal_px[0] - 500.0).abs() < 1e-2, "{told}");
        assert!(told["rms_px"].as_f64().unwrap() < 1e-4, "{told}");
        assert_eq!(told["misses"].as_array().unwrap().len(), body["pairs"].as_array().unwrap().len());
        assert!(told["misses"][0]["offset_px"][1].is_f64() && told["misses"][0]["distance_m"].is_f64());
        assert!(told["position_deviation_m"].as_f64().unwrap() > 0.0, "{told}");
        assert!(told["direction_deviation_deg"].as_f64().unwrap() > 0.0, "{told}");
        assert_eq!(told["focal_deviation_px"] == 0.0, body["focal_px"].is_number(), "{told}");
    };
    check(asked(6)).await;
    let mut known = asked(4);
    known["focal_px"] = json!(500);
    known["center_px"] = json!([320, 180]);
    check(known).await;
    let mut nulls = asked(7);
    (nulls["focal_px"], nulls["center_px"], nulls["finds_k1"]) = (Value::Null, Value::Null, json!(true));
    check(nulls).await;
}

#[tokio::test]
async fn pairs_that_give_none_are_told_by_their_place() {
    let bench = Bench::new();
    let check = async |change: &dyn Fn(&mut Value), expected: &[&str]| {
        let mut body = asked(6);
        change(&mut body);
        let answer = post(&bench, SOLVE, body.to_string()).await;
        assert_eq!(pointers(&answer, SOLVE), expected, "{body}");
    };
    check(&|body| body["pairs"] = json!(pairs(5)), &["/pairs"]).await;
    check(&|body| body["pairs"][2]["place_m"][1] = json!(1e9), &["/pairs/2/place_m"]).await;
    check(&|body| body["pairs"][2]["picture_px"][1] = json!(1e9), &["/pairs/2/picture_px"]).await;
    check(&|body| body["pairs"][2]["picture_px"] = json!([1]), &["/pairs/2/picture_px"]).await;
    check(&|body| body["pairs"][2]["place"] = json!([1]), &["/pairs/2/place"]).await;
    check(&|body| body["image_size_px"] = json!([0, 65_537]), &["/image_size_px/0", "/image_size_px/1"])
        .await;
    check(&|body| body["focal_px"] = json!(-5), &["/focal_px"]).await;
    check(&|body| body["center_px"] = json!([1e9, 0]), &["/center_px"]).await;
    check(&|body| body["finds"] = json!(true), &["/finds"]).await;
    // All at one place: where the camera stands is left open.
    let at_once = |body: &mut Value| body["pairs"] = json!(vec![pairs(1)[0].clone(); 6]);
    check(&at_once, &["/pairs"]).await;
    assert_eq!(pointers(&post(&bench, SOLVE, "[]".to_owned()).await, SOLVE), [""]);
    post(&bench, &format!("{SOLVE}?a=1"), asked(6).to_string()).await.problem(400, SOLVE);
    let foreign = Request::post(SOLVE).header("sec-fetch-site", "cross-site");
    bench.send(foreign.body(Body::from(asked(6).to_string())).unwrap()).await.problem(400, SOLVE);
}

/// Edges of a house as the camera shows them.
fn pencils() -> Value {
    let shown = |place: DVec3| {
        let shown = camera().project(place).unwrap().texture * DVec2::new(640.0, 360.0);
        json!(shown.to_array())
    };
    let pencil = |axis: &str, along: DVec3| {
        let (across, other) = (DVec3::new(along.z, along.x, along.y), DVec3::new(along.y, along.z, along.x));
        let line = |a: f64, b: f64| {
            let from = across * a + other * b;
            json!([shown(from), shown(from + along * 4.0)])
        };
        json!({"axis": axis, "lines": [line(0.0, 0.0), line(3.0, 0.0), line(0.0, 3.0)]})
    };
    json!([pencil("x", DVec3::X), pencil("z", DVec3::Z), pencil("y", DVec3::Y)])
}

#[tokio::test]
async fn lines_give_the_rotation_and_the_focal_length() {
    let bench = Bench::new();
    let pose = camera().pose().world_from_local.to_array();
    let body = json!({"image_size_px": [640, 360], "pencils": pencils(), "focal_px": null, "near": pose});
    let answer = post(&bench, VANISHING, body.to_string()).await;
    assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
    let told = answer.json();
    assert!((told["focal_px"].as_f64().unwrap() - 500.0).abs() < 1e-2, "{told}");
    let turned: [f64; 4] = serde_json::from_value(told["world_from_camera"].clone()).unwrap();
    let apart = glam::DQuat::from_array(turned).angle_between(glam::DQuat::from_array(pose));
    assert!(apart < 1e-5, "{told}");
    assert!(told["rms_px"].as_f64().unwrap() < 1e-4, "{told}");
    let misses = told["misses"].as_array().unwrap();
    assert_eq!((misses.len(), &misses[4]["axis"], &misses[4]["line_idx"]), (9, &json!("z"), &json!(1)));

    let check = async |change: &dyn Fn(&mut Value), expected: &str| {
        let mut body = body.clone();
        change(&mut body);
        let answer = post(&bench, VANISHING, body.to_string()).await;
        assert_eq!(pointers(&answer, VANISHING), [expected], "{body}");
    };
    check(&|body| body["pencils"][1]["axis"] = json!("x"), "/pencils/1/axis").await;
    check(&|body| body["pencils"][1]["axis"] = json!("w"), "/pencils/1/axis").await;
    check(&|body| body["pencils"] = json!([]), "/pencils").await;
    check(&|body| body["pencils"][0]["lines"] = json!([]), "/pencils/0/lines").await;
    check(&|body| body["pencils"][0]["lines"][2] = json!([[1, 1], [1, 1]]), "/pencils/0/lines/2").await;
    check(&|body| body["near"] = json!([0, 0, 0, 0]), "/near").await;
    check(&|body| body["focal_px"] = json!(0), "/focal_px").await;
    check(&|body| body["image_size_px"][0] = json!(0), "/image_size_px/0").await;
}

#[tokio::test]
async fn a_text_is_read_and_told_as_ours() {
    let bench = Bench::new();
    let own = serde_json::to_value(CameraDocument::from_camera(&camera())).unwrap();
    let answer = post(&bench, IMPORT, own.to_string()).await;
    assert_eq!((answer.status.as_u16(), answer.field("cache-control")), (200, "no-store"));
    assert_eq!(answer.json(), json!({"calibration": own, "residual_px": null}));
    let opencv = json!({
        "K": [[500, 0, 319.5], [0, 500, 179.5], [0, 0, 1]], "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 200],
    });
    let query = format!("{IMPORT}?format=opencv&image_size_px=640x360&metres_per_unit=0.01");
    let told = post(&bench, &query, opencv.to_string()).await.json();
    assert_eq!(told["calibration"]["center_px"], json!([320.0, 180.0]), "{told}");
    assert_eq!(told["calibration"]["position_m"][2], json!(-2.0), "{told}");

    let refused = post(&bench, IMPORT, opencv.to_string()).await.problem(400, IMPORT);
    assert!(refused["detail"].as_str().unwrap().contains("image_size_px"), "{refused}");
    let entry = format!("{IMPORT}?entry=left");
    let refused = post(&bench, &entry, json!({"cameras": []}).to_string()).await.problem(400, IMPORT);
    assert_eq!(refused["errors"][0]["parameter"], "entry");
    post(&bench, IMPORT, "hello".to_owned()).await.problem(400, IMPORT);
    post(&bench, &format!("{IMPORT}?scene=plaza"), own.to_string()).await.problem(400, IMPORT);
}

/// A camera may be called as these routes are: it is asked for by the same name, escaped.
#[tokio::test]
async fn a_camera_of_the_same_name_is_asked_for_with_an_escape() {
    let bench = Bench::new();
    let shadowed = bench.get(SOLVE).await;
    shadowed.problem(405, SOLVE);
    assert_eq!(shadowed.field("allow"), "POST");
    let path = "/api/v1/calibrations/%73olve";
    let problem = bench.get(path).await.problem(404, path);
    assert!(problem["detail"].as_str().unwrap().contains("calibrated camera \"solve\""), "{problem}");
}

#[tokio::test]
async fn viewers_work_nothing_out() {
    let (house, root) = House::with_admin().await;
    let made = [("viewer", "viewer"), ("keeper", "operator")];
    for (name, role) in made {
        let body = json!({"role": role, "cameras": {"north": ["live"]}});
        let path = format!("/api/v1/users/{name}");
        let answer = house.send("PUT", &path, Shows::Token(&root), &[("if-none-match", "*")], body).await;
        assert_eq!(answer.status, 201);
        let answer =
            house.send("POST", "/api/v1/tokens", Shows::Token(&root), &[], json!({"user": name})).await;
        let token = answer.json()["token"].as_str().unwrap().to_owned();
        let expected = if name == "viewer" { 403 } else { 200 };
        let own = serde_json::to_value(CameraDocument::from_camera(&camera())).unwrap();
        let lines = json!({"image_size_px": [640, 360], "pencils": pencils()});
        for (path, body) in [(SOLVE, asked(6)), (VANISHING, lines), (IMPORT, own)] {
            let answer = house.send("POST", path, Shows::Token(&token), &[], body.clone()).await;
            assert_eq!(answer.status.as_u16(), expected, "{name} {path}");
            house.send("POST", path, Shows::Nothing, &[], body).await.problem(401, path);
        }
    }
}
