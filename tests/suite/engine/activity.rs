//! How much moved before cameras, as a running engine has kept it, and who is told of it.

use super::rights::{grants, router, seen, users};
use super::{Bench, pictures};
use axum::Router;
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};
use tempfile::TempDir;
use videofields_testing::wait_for;
use videofields_vision::access::{Right, Role};
use videofields_vision::clock::Timestamp;
use videofields_vision::error::ErrorKind;

const SPAN: &str = "from=1970-01-01T00:00:00Z&to=1970-01-01T00:02:00Z";

fn get(bench: &Bench, router: &Router, token: &str, path: &str) -> (u16, Value) {
    let request = Request::get(path).header("authorization", format!("Bearer {token}"));
    let request = request.body(Body::empty()).unwrap();
    let answer = bench.runtime.block_on(super::house::answered(router.clone(), request));
    (answer.status, answer.body)
}

#[test]
fn what_moved_is_told_step_by_step_to_who_may_see_the_past() {
    let folder = TempDir::new().unwrap();
    let bench = seen(folder.path(), pictures(folder.path(), "south", 0..20));
    let [root, guest] = users(&bench);
    let router = router(&bench);
    let ask =
        |token: &str, wishes: &str| get(&bench, &router, token, &format!("/api/v1/activity?{SPAN}{wishes}"));
    // The minute at hand is written when the film is over.
    let told = wait_for("what moved", || {
        let (status, told) = ask(&root, "");
        assert_eq!(status, 200, "{told}");
        let is_there = |of: &Value| of["frames"][0].is_u64();
        told["cameras"].as_array().unwrap().iter().all(is_there).then_some(told)
    });
    assert_eq!((&told["steps"], &told["first"]), (&json!(2), &json!("1970-01-01T00:00:00Z")));
    let north = &told["cameras"][0];
    assert_eq!((&north["camera"], &north["frames"][1]), (&json!("north"), &Value::Null));
    assert_eq!(north["frames"][0], bench.summary("north").frames);
    let share = north["moving_share"][0].as_f64().unwrap();
    assert!(share > 0.01 && share < 1.0, "{north}");
    // The same as of the scene's timeline.
    let (_, timeline) = get(&bench, &router, &root, &format!("/api/v1/scenes/yard/timeline?{SPAN}"));
    assert_eq!(timeline["cameras"][0]["activity"][0]["moving_share"], share);

    // The guest may see `north` alone.
    let (_, part) = ask(&guest, "");
    assert_eq!(part["cameras"], json!([north]));
    let (status, forbidden) = ask(&guest, "&cameras=north,south");
    assert_eq!(status, 404, "{forbidden}");
    let (_, nowhere) = ask(&guest, "&cameras=north,mouth");
    assert_eq!(forbidden.to_string().replace("south", "mouth"), nowhere.to_string());

    // Who sees the present alone is told of no past.
    let live = bench.handle.within(grants(Role::Viewer, &[], &[("north", &[Right::Live])]));
    let span = (Timestamp::from_nanos(0), Timestamp::from_nanos(60_000_000_000));
    assert_eq!(live.activity("north", span, 1).unwrap_err().kind(), ErrorKind::Forbidden);
    assert_eq!(live.activity("south", span, 1).unwrap_err().kind(), ErrorKind::NotFound);
    assert_eq!(bench.handle.activity("north", span, 1).unwrap().len(), 1);
    bench.stop();
}
