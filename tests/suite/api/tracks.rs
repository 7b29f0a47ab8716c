//! `/api/v1/scenes/{id}/tracks` over HTTP.

use super::Bench;
use super::door::State;
use axum::http::StatusCode;
use glam::DVec2;
use proptest::prelude::*;
use serde_json::json;
use videofields_api::Limits;
use videofields_service::engine::{EngineError, TrackQuery};
use videofields_vision::clock::Timestamp;
use videofields_vision::error::Fault;

const TRACKS: &str = "/api/v1/scenes/plaza/tracks";
const SPAN: &str = "from=1970-01-01T00:00:00Z&to=1970-01-01T01:00:00Z";

fn searched(bench: &Bench) -> TrackQuery {
    bench.door.0.lock().unwrap().searched.clone().unwrap()
}

#[tokio::test]
async fn tracks_are_told_with_their_places() {
    let bench = Bench::new();
    let answer = bench.get(&format!("{TRACKS}?{SPAN}")).await;
    assert_eq!((answer.status, answer.field("cache-control")), (StatusCode::OK, "no-store"));
    let (from, to) = ("1970-01-01T00:00:00Z", "1970-01-01T01:00:00Z");
    let expected = json!({
        "from": from,
        "to": to,
        "tracks": [{
            "camera": "north", "track": 17, "entity": 3, "began": from, "ended": to, "height": 0.33333,
            "first_in_region": null, "last_in_region": null,
            "path": [
                {"at": from, "u": 0.5, "v": 0.75, "point_m": [1.5, -2.0, 0.0]},
                {"at": to, "u": 0.66667, "v": 0.75, "point_m": null},
            ],
        }],
        "is_complete": true,
        "next": null,
    });
    assert_eq!(answer.json(), expected);
    assert!(!String::from_utf8_lossy(&answer.body).contains("-0.0"), "what is nearly 0 is 0");
    let asked = searched(&bench);
    assert_eq!(asked.span, (Timestamp::from_nanos(0), Timestamp::from_nanos(3_600_000_000_000)));
    assert_eq!((asked.cameras, asked.region, asked.before, asked.limit), (None, None, None, 100));
}

#[tokio::test]
async fn a_search_asks_for_what_the_query_says_and_goes_on_where_it_ended() {
    let bench = Bench::new();
    let target = format!("{TRACKS}?{SPAN}&cameras=south,north&region=0,0;4.5,0;4.5,-3e0&limit=1");
    let first = bench.get(&target).await.json();
    assert_eq!(first["tracks"][0]["first_in_region"], "1970-01-01T00:00:00Z");
    assert_eq!(first["tracks"][0]["last_in_region"], "1970-01-01T01:00:00Z");
    assert_eq!((&first["is_complete"], &first["next"]), (&json!(false), &json!("0:north:17")));
    let asked = searched(&bench);
    let ids: Vec<_> = asked.cameras.unwrap().iter().map(ToString::to_string).collect();
    assert_eq!((ids, asked.limit), (vec!["south".to_owned(), "north".to_owned()], 1));
    let corners = [[0.0, 0.0], [4.5, 0.0], [4.5, -3.0]].map(DVec2::from_array);
    assert_eq!(asked.region.unwrap().corners(), corners);
    for next in ["0:north:17", "0%3Anorth%3A17"] {
        assert_eq!(bench.get(&format!("{target}&cursor={next}")).await.status, StatusCode::OK);
        assert_eq!(searched(&bench).before.unwrap().to_string(), "0:north:17");
    }
    let most: String = (0..64).map(|i| format!("{i},{};", i * i)).collect();
    let answer = bench.get(&format!("{TRACKS}?{SPAN}&region={}", most.trim_end_matches(';'))).await;
    assert_eq!(answer.status, StatusCode::OK, "64 corners");
}

#[tokio::test]
async fn what_is_wrong_with_a_search_is_named() {
    let bench = Bench::new();
    let check = async |query: &str, parameter: &str, said: &str| {
        let problem = bench.get(&format!("{TRACKS}?{query}")).await.problem(400, TRACKS);
        let errors = problem["errors"].as_array().unwrap();
        assert_eq!(errors.len(), 1, "{query}: {problem}");
        assert_eq!(errors[0]["parameter"], parameter, "{query}: {problem}");
        assert!(errors[0]["detail"].as_str().unwrap().contains(said), "{query}: {problem}");
    };
    check("to=5", "from", "is required").await;
    check("from=5", "to", "is required").await;
    check("from=5&to=5", "to", "must be after from").await;
    check("from=noon&to=5", "from", "RFC 3339").await;
    check(&format!("{SPAN}&camera=north"), "camera", "did you mean \"cameras\"?").await;
    for limit in ["0", "1001", "-1", "many", ""] {
        check(&format!("{SPAN}&limit={limit}"), "limit", "a whole number from 1 to 1000").await;
    }
    for cameras in ["", ",", "north,", "North", "north;south", "../etc"] {
        check(&format!("{SPAN}&cameras={cameras}"), "cameras", "must be ids of cameras with commas").await;
    }
    for before in ["", "1", "1:north", "1:north:2:3", "now:north:2", "1:no%20rth:2"] {
        check(&format!("{SPAN}&cursor={before}"), "cursor", "must be what an answer gave as next").await;
    }
    let too_many = "0,0;".repeat(65);
    for region in [
        "",
        "0,0;1,0",
        "0,0;1,0;",
        "0,0;1,0;1",
        "0,0;1,0;1,1,1",
        "0%200;1%200;1%201",
        // Not finite, too far off, no area, edges that cross.
        "0,0;1,0;NaN,1",
        "0,0;1,0;inf,1",
        "0,0;1,0;1e9,1",
        "0,0;1,0;1e999,1",
        "0,0;0,0;0,0",
        "0,0;1,1;2,2",
        "0,0;4,4;4,0;0,3",
        too_many.trim_end_matches(';'),
    ] {
        check(&format!("{SPAN}&region={region}"), "region", "3 to 64 corners").await;
    }
    let path = "/api/v1/scenes/yard/tracks";
    let problem = bench.get(&format!("{path}?{SPAN}")).await.problem(404, path);
    assert!(problem["detail"].as_str().unwrap().contains("known: plaza"), "{problem}");
}

#[tokio::test]
async fn what_the_engine_refuses_is_passed_on() {
    let check = async |failure: EngineError, status: u16| {
        let state = State { failure: Some(failure), ..State::default() };
        let bench = Bench::within(Limits::default(), state);
        bench.get(&format!("{TRACKS}?{SPAN}")).await.problem(status, TRACKS)
    };
    let fault = Fault::new("cameras", "unknown camera of the scene `west`; allowed: north, south");
    let problem = check(EngineError::Request(fault), 400).await;
    assert_eq!(problem["errors"][0]["parameter"], "cameras");
    check(EngineError::Unavailable("the database is busy".to_owned()), 503).await;
    check(EngineError::Internal("the database is damaged".to_owned()), 500).await;
}

proptest! {
    #![proptest_config(videofields_testing::seeded(64))]

    #[test]
    fn no_query_makes_it_panic(region in "[0-9,;.e+-]{0,60}", before in "[0-9a-z:-]{0,30}") {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let target = format!("{TRACKS}?{SPAN}&region={region}&cursor={before}");
            let status = Bench::new().get(&target).await.status.as_u16();
            assert!([200, 400].contains(&status), "{target}: {status}");
        });
    }
}

#[tokio::test]
async fn who_was_where_is_told_with_ids_and_page_by_page() {
    const PATHS: &str = "/api/v1/scenes/plaza/entities/paths";
    let bench = Bench::new();
    let answer = bench.get(&format!("{PATHS}?{SPAN}")).await;
    let (from, to) = ("1970-01-01T00:00:00Z", "1970-01-01T01:00:00Z");
    let expected = json!({
        "from": from,
        "to": to,
        "entities": [{
            "id": 3, "height_m": 1.75,
            "path": [
                {"at": from, "point_m": [1.5, -2.0, 0.0], "cameras": ["north"]},
                {"at": to, "point_m": [2.0, -2.0, 0.0], "cameras": ["north"]},
            ],
        }],
        "unknown": [{"from": from, "to": from}],
        "is_complete": true,
        "next": null,
    });
    assert_eq!((answer.status, answer.json()), (StatusCode::OK, expected));
    assert!(!String::from_utf8_lossy(&answer.body).contains("-0.0"), "what is nearly 0 is 0");
    let first = bench.get(&format!("{PATHS}?{SPAN}&limit=1")).await.json();
    assert_eq!((&first["is_complete"], &first["next"]), (&json!(false), &json!("0:3")));
    assert_eq!(bench.get(&format!("{PATHS}?{SPAN}&cursor=0:3")).await.status, StatusCode::OK);
    let after = bench.door.0.lock().unwrap().entities_after.unwrap();
    assert_eq!((after.began_at, after.id), (Timestamp::from_nanos(0), 3));
    for (query, parameter) in
        [("to=5", "from"), ("from=5&to=5", "to"), (&*format!("{SPAN}&cursor=3"), "cursor")]
    {
        let problem = bench.get(&format!("{PATHS}?{query}")).await.problem(400, PATHS);
        assert_eq!(problem["errors"][0]["parameter"], parameter, "{query}: {problem}");
    }
    bench
        .get("/api/v1/scenes/plazza/entities/paths?from=1&to=2")
        .await
        .problem(404, "/api/v1/scenes/plazza/entities/paths");
}
