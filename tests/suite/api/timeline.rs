//! `/api/v1/scenes/{id}/timeline` over HTTP.

use super::Bench;
use axum::http::StatusCode;
use serde_json::json;

const TIMELINE: &str = "/api/v1/scenes/plaza/timeline";

#[tokio::test]
async fn a_scenes_timeline_is_shown_between_two_instants() {
    let bench = Bench::new();
    let asked = "from=1970-01-01T00:00:00Z&to=1970-01-01T01:00:00Z&resolution=90";
    let answer = bench.get(&format!("{TIMELINE}?{asked}")).await;
    assert_eq!((answer.status, answer.field("cache-control")), (StatusCode::OK, "no-store"));
    let expected = json!({
        "from": "1970-01-01T00:00:00Z",
        "to": "1970-01-01T01:00:00Z",
        "resolution_secs": 120,
        "cameras": [{
            "camera": "north",
            "ranges": [["1970-01-01T00:00:00Z", "1970-01-01T01:00:00Z"]],
            "activity": [
                {"at": "1970-01-01T00:00:00Z", "moving_share": 0.125, "max_tracks": 2, "new_tracks": 1}
            ]
        }],
        "events": []
    });
    assert_eq!(answer.json(), expected);
    bench
        .get(&format!("/api/v1/scenes/yard/timeline?{asked}"))
        .await
        .problem(404, "/api/v1/scenes/yard/timeline");
}

#[tokio::test]
async fn a_span_that_makes_no_sense_is_refused_at_its_place() {
    let bench = Bench::new();
    for (query, parameter, said) in [
        ("to=5", "from", "is required"),
        ("from=5", "to", "is required"),
        ("from=5&to=5", "to", "must be after from"),
        ("from=noon&to=5", "from", "RFC 3339"),
        ("from=0&to=9&resolution=59", "resolution", "whole number from 60"),
        ("from=1970-01-01T00:00:00Z&to=1971-01-01T00:00:00Z", "resolution", "must be at least 6308 s"),
        ("from=-9223372036854775808&to=9223372036854775807&resolution=31622400", "", ""),
    ] {
        let answer = bench.get(&format!("{TIMELINE}?{query}")).await;
        if parameter.is_empty() {
            assert_eq!(answer.status, StatusCode::OK, "{query}");
            continue;
        }
        let problem = answer.problem(400, TIMELINE);
        assert_eq!(problem["errors"][0]["parameter"], parameter, "{query}: {problem}");
        assert!(problem["errors"][0]["detail"].as_str().unwrap().contains(said), "{query}: {problem}");
    }
}

#[tokio::test]
async fn clocks_and_calibrations_are_compared() {
    let bench = Bench::new();
    let path = "/api/v1/scenes/plaza/alignment";
    let answer = bench.get(path).await;
    assert_eq!((answer.status.as_u16(), answer.field("cache-control")), (200, "no-store"));
    let mut body = answer.json();
    let calibration = body["cameras"][0]["calibration"].take();
    assert_eq!(calibration["corrected"]["image_size_px"], json!([64, 48]));
    let turned_deg = calibration["turned_deg"][2].as_f64().unwrap();
    assert!((turned_deg - 1.0).abs() < 1e-12, "{calibration}");
    let others =
        [("offset_m", 0.5), ("offset_error_m", 0.125), ("apart_m", 0.75), ("apart_corrected_m", 0.25)];
    for (name, expected) in others {
        assert_eq!(calibration[name], json!(expected), "{name}");
    }
    assert_eq!((&calibration["moved_m"], &calibration["paths"]), (&json!([0.1, 0.0, -0.25]), &json!(12)));
    assert_eq!(calibration["is_used"], json!(true));
    assert_eq!(
        body,
        json!({
            "cameras": [
                {
                    "camera": "north", "confidence": 0.9, "ahead_secs": 10.0,
                    "clock": {"offset_secs": -10.0, "drift_ppm": -100.0, "since": null},
                    "calibration": null,
                },
                {"camera": "south", "confidence": null, "ahead_secs": null, "clock": null, "calibration": null},
            ],
            "pairs": [{
                "first": "south", "second": "north", "offset_secs": 10.0, "offset_error_secs": 0.01,
                "drift_ppm": 100.0, "drift_error_ppm": 5.0, "since": super::FIRST.to_string(),
                "confidence": 0.9, "meetings": 7,
            }],
            "pairs_left_out": 0,
        })
    );
    bench.get("/api/v1/scenes/none/alignment").await.problem(404, "/api/v1/scenes/none/alignment");
    bench.get("/api/v1/scenes/plaza/alignment?x=1").await.problem(400, path);
}
