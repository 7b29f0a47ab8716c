//! `/api/v1/jobs` over HTTP.

use super::Bench;
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};

const JOBS: &str = "/api/v1/jobs";

async fn ids(bench: &Bench, query: &str) -> Vec<String> {
    let answer = bench.get(&format!("{JOBS}?{query}")).await;
    assert_eq!((answer.status.as_u16(), answer.field("cache-control")), (200, "no-store"), "{query}");
    let jobs = answer.json()["jobs"].as_array().unwrap().clone();
    jobs.iter().map(|job| job["id"].as_str().unwrap().to_owned()).collect()
}

#[tokio::test]
async fn what_takes_long_is_told_of_in_one_list() {
    let bench = Bench::new();
    let all = ["accuracy", "map:plaza:north", "map:plaza:south"];
    assert_eq!(ids(&bench, "").await, all);
    let asked = Request::post("/api/v1/exports").body(Body::from("{}")).unwrap();
    assert_eq!(bench.send(asked).await.status.as_u16(), 202);
    let export = "export:20260301t120000z";
    assert_eq!(ids(&bench, "").await, [all[0], export, all[1], all[2]]);
    assert_eq!(ids(&bench, "kind=export").await, [export]);
    assert_eq!(ids(&bench, "kind=map&state=running").await, ["map:plaza:north"]);
    assert_eq!(ids(&bench, "state=waiting").await, [export]);
    assert_eq!(ids(&bench, "asked_by=ann").await, [""; 0]);

    let page = bench.get(&format!("{JOBS}?limit=2")).await;
    assert_eq!((&page.json()["next"], page.json()["jobs"].as_array().unwrap().len()), (&json!(export), 2));
    assert_eq!(page.field("link"), format!("<{JOBS}?limit=2&cursor={export}>; rel=\"next\""));
    assert_eq!(ids(&bench, &format!("cursor={export}")).await, [all[1], all[2]]);

    let told = bench.get(&format!("{JOBS}/{export}")).await.json();
    let expected = json!({
        "id": export, "kind": "export", "state": "waiting", "reason": null, "progress": 0.0, "asked_by": null,
        "created_at": super::LAST.to_string(), "cameras": ["north"],
        "resource": "/api/v1/exports/20260301t120000z",
    });
    assert_eq!(told, expected);
    let resource = told["resource"].as_str().unwrap().to_owned();
    assert_eq!(bench.get(&resource).await.status.as_u16(), 200);
    let map = bench.get(&format!("{JOBS}/map:plaza:north")).await.json();
    assert_eq!((&map["state"], &map["progress"]), (&json!("running"), &Value::Null));
    assert_eq!(map["resource"], "/api/v1/calibrations/north?scene=plaza");
    // What a fault of the daemon's was its log alone says.
    let failed = bench.get(&format!("{JOBS}/map:plaza:south")).await.json();
    assert_eq!(failed["state"], "failed");
    assert!(!failed.to_string().contains("sda1") && failed["reason"].is_string(), "{failed}");

    let measured = bench.get(&format!("{JOBS}/accuracy")).await.json();
    assert_eq!((&measured["state"], &measured["progress"]), (&json!("done"), &json!(1.0)));
    let again = Request::post("/api/v1/accuracy").body(Body::empty()).unwrap();
    assert_eq!(bench.send(again).await.status.as_u16(), 202);
    let measured = bench.get(&format!("{JOBS}/accuracy")).await.json();
    assert_eq!((&measured["state"], &measured["progress"]), (&json!("waiting"), &Value::Null));
}

#[tokio::test]
async fn what_is_no_job_is_refused() {
    let bench = Bench::new();
    let path = format!("{JOBS}/export:none");
    let problem = bench.get(&path).await.problem(404, &path);
    assert!(problem["detail"].as_str().unwrap().contains("accuracy"), "{problem}");
    for (query, parameter) in [("kind=cake", "kind"), ("state=late", "state"), ("limit=0", "limit")] {
        let problem = bench.get(&format!("{JOBS}?{query}")).await.problem(400, JOBS);
        assert_eq!(problem["errors"][0]["parameter"], parameter, "{problem}");
    }
    let removed = Request::delete(&path).body(Body::empty()).unwrap();
    bench.send(removed).await.problem(405, &path);
}
