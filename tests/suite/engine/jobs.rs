//! Jobs of a running engine: who is told of which.

use super::rights::{accounts, router};
use super::{Bench, SCENE, camera, pictures};
use axum::Router;
use axum::body::Body;
use axum::http::Request;
use serde_json::Value;
use tempfile::TempDir;
use videofields_testing::wait_for;
use videofields_vision::config::{End, Settings};

fn get(bench: &Bench, router: &Router, token: &str, path: &str) -> (u16, Value) {
    let request = Request::get(path).header("authorization", format!("Bearer {token}"));
    let request = request.body(Body::empty()).unwrap();
    let answer = bench.runtime.block_on(super::house::answered(router.clone(), request));
    (answer.status, answer.body)
}

#[test]
fn maps_are_jobs_of_who_may_know_of_their_cameras() {
    let folder = TempDir::new().unwrap();
    let cameras = ["north", "south"].map(|id| camera(id, pictures(folder.path(), id, 0..5), End::Stop));
    let settings = Settings { camera: cameras.to_vec(), ..Settings::default() };
    let bench = Bench::start(folder.path(), settings, &[("yard", SCENE)]);
    let [root, guest] = accounts(&bench);
    let router = router(&bench);
    let ids = |token: &str| {
        let (status, body) = get(&bench, &router, token, "/api/v1/jobs?kind=map");
        assert_eq!(status, 200, "{body}");
        let jobs = body["jobs"].as_array().unwrap().clone();
        jobs.iter().map(|job| job["id"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(ids(&root), ["map:yard:north", "map:yard:south"]);
    assert_eq!(ids(&guest), ["map:yard:north"]);
    let done = wait_for("the map", || {
        let (_, job) = get(&bench, &router, &guest, "/api/v1/jobs/map:yard:north");
        (job["state"] == "done").then_some(job)
    });
    assert_eq!(done["progress"], 1.0);
    let (status, calibration) = get(&bench, &router, &guest, done["resource"].as_str().unwrap());
    assert_eq!((status, &calibration["camera"]), (200, &Value::from("north")));
    let missing = |job: &str| get(&bench, &router, &guest, &format!("/api/v1/jobs/{job}"));
    let (forbidden, nowhere) = (missing("map:yard:south"), missing("map:yard:mouth"));
    assert_eq!(forbidden.0, 404);
    assert_eq!(forbidden.1.to_string().replace("south", "mouth"), nowhere.1.to_string());
    assert_eq!(get(&bench, &router, &root, "/api/v1/jobs/map:yard:south").0, 200);
    bench.stop();
}
