//! `/api/v1/activity` over HTTP.

use super::Bench;
use serde_json::json;

const ACTIVITY: &str = "/api/v1/activity";

#[tokio::test]
async fn series_of_all_cameras_have_one_length_and_gaps() {
    let bench = Bench::new();
    let asked = "from=1970-01-01T00:01:00Z&to=1970-01-01T00:05:30Z&step=90";
    let answer = bench.get(&format!("{ACTIVITY}?{asked}")).await;
    assert_eq!((answer.status.as_u16(), answer.field("cache-control")), (200, "no-store"));
    let expected = json!({
        "from": "1970-01-01T00:01:00Z",
        "to": "1970-01-01T00:05:30Z",
        "step_secs": 120,
        "first": "1970-01-01T00:00:00Z",
        "steps": 3,
        "cameras": [
            {
                "camera": "north",
                "frames": [null, null, 4],
                "moving_share": [null, null, 0.125],
                "max_tracks": [null, null, 2],
                "new_tracks": [null, null, 1],
            },
            {
                "camera": "south",
                "frames": [null, null, null],
                "moving_share": [null, null, null],
                "max_tracks": [null, null, null],
                "new_tracks": [null, null, null],
            },
        ]
    });
    assert_eq!(answer.json(), expected);
    let some = bench.get(&format!("{ACTIVITY}?{asked}&cameras=south,north,south")).await.json();
    let ids: Vec<_> = some["cameras"].as_array().unwrap().iter().map(|of| &of["camera"]).collect();
    assert_eq!(ids, ["south", "north"]);
    let missing = bench.get(&format!("{ACTIVITY}?{asked}&cameras=north,west")).await;
    assert!(missing.problem(404, ACTIVITY)["detail"].as_str().unwrap().contains("west"));
}

#[tokio::test]
async fn what_would_be_too_much_is_refused_with_what_would_not() {
    let bench = Bench::new();
    for (query, parameter, said) in [
        ("to=5", "from", "is required"),
        ("from=5", "to", "is required"),
        ("from=5&to=5", "to", "must be after from"),
        ("from=0&to=9&step=59", "step", "whole number from 60"),
        ("from=0&to=9&cameras=No!", "cameras", "ids of cameras"),
        ("from=1970-01-01T00:00:00Z&to=1971-01-01T00:00:00Z", "step", "for so long a time and 2 cameras"),
    ] {
        let problem = bench.get(&format!("{ACTIVITY}?{query}")).await.problem(400, ACTIVITY);
        assert_eq!(problem["errors"][0]["parameter"], parameter, "{query}: {problem}");
        assert!(problem["errors"][0]["detail"].as_str().unwrap().contains(said), "{query}: {problem}");
    }
    let year = "from=1970-01-01T00:00:00Z&to=1971-01-01T00:00:00Z&step=3600&cameras=north";
    let year = bench.get(&format!("{ACTIVITY}?{year}")).await.json();
    assert_eq!(year["steps"], 8760);
}
