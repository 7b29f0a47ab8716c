//! What is wrong is refused with a problem document that names the place and what is allowed; nothing panics.

use super::door::State;
use super::{Answer, Bench, StatusCode};
use axum::body::Body;
use axum::http::Request;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::time::Duration;
use videofields_api::Limits;
use videofields_service::engine::EngineError;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::Fault;

const VIEW: &str = "/api/v1/scenes/plaza/view.jpg";
const FRAME: &str = "/api/v1/cameras/north/frame.jpg";
const LOCATE: &str = "/api/v1/cameras/north/locate";

fn path_of(target: &str) -> &str {
    target.split('?').next().unwrap()
}

#[tokio::test]
async fn each_wrong_parameter_is_named_with_what_is_allowed() {
    let bench = Bench::new();
    let check = async |path: &str, query: &str, parameter: &str, said: &str| {
        let problem = bench.get(&format!("{path}?{query}")).await.problem(400, path);
        assert_eq!(problem["type"], "urn:videofields:problem:invalid");
        let errors = problem["errors"].as_array().unwrap();
        assert_eq!(errors.len(), 1, "{query}: {problem}");
        assert_eq!(errors[0]["parameter"], parameter, "{query}: {problem}");
        assert!(errors[0]["detail"].as_str().unwrap().contains(said), "{query}: {problem}");
        assert!(errors[0].get("pointer").is_none(), "{query}: {problem}");
    };
    for eye in ["", "1", "1,2", "1,2,3,4", "NaN,0,0", "0,inf,0", "0,0,1e999", "1e9,0,0", "a,b,c", "1;2;3"] {
        check(VIEW, &format!("eye={eye}"), "eye", "must be x,y,z: three numbers of metres").await;
        check(VIEW, &format!("target={eye}"), "target", "must be x,y,z").await;
    }
    check(VIEW, "eye=1,2,3&target=1,2,3", "target", "at least 0.000001 m apart").await;
    check(VIEW, "eye=1,2,1", "eye", "at least 0.000001 m apart").await;
    for fov in ["0", "-10", "0.99", "170.5", "NaN", "inf", "", "wide"] {
        check(VIEW, &format!("fov={fov}"), "fov", "a number from 1 to 170 degrees").await;
    }
    for side in ["0", "-1", "65536", "4294967297", "1e3", "10.5", "", "NaN"] {
        check(VIEW, &format!("width={side}"), "width", "a whole number from 1 to 65535").await;
        check(VIEW, &format!("height={side}"), "height", "a whole number from 1 to 65535").await;
    }
    for t in ["", "now", "Live", "1970-01-01", "9223372036854775808", "1.5", "2026-13-01T00:00:00Z"] {
        check(VIEW, &format!("t={t}"), "t", "must be live, playhead: and its name, nanoseconds").await;
        check(FRAME, &format!("t={t}"), "t", "RFC 3339").await;
    }
    for (kind, others) in [
        ("perspective", "across=1&heading=1&span=90&eye_distance=0.1&convergence=3&window=0"),
        ("map", "eye=1,2,3&fov=50&span=90"),
        ("stereo", "across=9"),
    ] {
        for other in others.split('&') {
            let parameter = other.split('=').next().unwrap();
            let said = format!("means nothing to projection={kind}, which takes ");
            check(VIEW, &format!("projection={kind}&{other}"), parameter, &said).await;
        }
    }
    check(VIEW, "projection=fisheye", "projection", "one of perspective, orthographic, map, panorama").await;
    check(VIEW, "across=9", "across", "means nothing to projection=perspective").await;
    check(VIEW, "projection=map&across=0", "across", "a number from 0.001 to 10000000 metres").await;
    check(VIEW, "projection=map&heading=361", "heading", "a number from -360 to 360 degrees").await;
    check(VIEW, "projection=panorama&span=0.5", "span", "a number from 1 to 360 degrees").await;
    check(VIEW, "projection=stereo&eye_distance=-1", "eye_distance", "from 0 to 1000 metres").await;
    check(VIEW, "projection=stereo&convergence=0", "convergence", "from 0.001 to").await;
    check(VIEW, "projection=window", "window", "is required").await;
    for window in ["", "1,2,3", "0,0,0,1,0,0,0,0,NaN", "0,0,0,1,0,0,0,0,1,0", "0,0,0,1,0,0,0,0,1e9"] {
        check(VIEW, &format!("projection=window&window={window}"), "window", "x,y,z three times").await;
    }
    for deadline in ["0", "-5", "NaN", "inf", "1e9", "", "soon"] {
        check(VIEW, &format!("deadline_ms={deadline}"), "deadline_ms", "a number from 1 to 10000 ms").await;
    }
    check(VIEW, "deadline_ms=50&quality=draft", "deadline_ms", "together with quality").await;
    check(VIEW, "quality=best", "quality", "one of draft, balanced, exact").await;
    check(VIEW, "cameras=0", "cameras", "a whole number from 1 to 8").await;
    check(VIEW, "resolution=third", "resolution", "one of quarter, half, whole").await;
    check(VIEW, "stride=2", "stride", "entities=points alone").await;
    for (parameter, value) in
        [("method", "rays"), ("voxels", "64"), ("hull_cameras", "3"), ("hull_visibility", "rays")]
    {
        let query = format!("entities=points&{parameter}={value}");
        check(VIEW, &query, parameter, "entities=hulls and entities=auto alone").await;
    }
    check(VIEW, "entities=hulls&method=guess", "method", "one of voxels, trimming, hybrid, csg, rays").await;
    check(VIEW, "entities=auto&hull_visibility=on", "hull_visibility", "one of off, depths, rays").await;
    check(VIEW, "entities=hulls&hull_cameras=1", "hull_cameras", "a whole number from 2 to 112").await;
    check(
        VIEW,
        "entities=none&sources=1",
        "sources",
        "entities=billboards, entities=hulls and entities=auto alone",
    )
    .await;
    for samples in ["0", "2", "8", ""] {
        check(VIEW, &format!("samples={samples}"), "samples", "one of 1, 4").await;
    }
    for times in ["0", "5", "1.5"] {
        check(VIEW, &format!("supersampling={times}"), "supersampling", "a whole number from 1 to 4").await;
    }
    for colors in ["", "on", "Raw"] {
        check(VIEW, &format!("colors={colors}"), "colors", "one of even, raw").await;
    }
    for entities in ["", "Billboards", "sprites"] {
        check(
            VIEW,
            &format!("entities={entities}"),
            "entities",
            "one of billboards, points, hulls, auto, none",
        )
        .await;
    }
    for u in ["", "-0.1", "1.0001", "NaN", "inf", "half"] {
        check(LOCATE, &format!("u={u}&v=0"), "u", "a number from 0 to 1").await;
        check(LOCATE, &format!("u=0&v={u}"), "v", "a number from 0 to 1").await;
    }
    check(LOCATE, "u=0", "v", "is required").await;
    check(LOCATE, "u=0&v=0&method=guess", "method", "one of ray, map").await;
    check(LOCATE, "u=0&v=0&scene=../etc", "scene", "must be an id").await;
    check(VIEW, "widht=3", "widht", "did you mean \"width\"? known: projection, eye, target").await;
    check(VIEW, "fov=50&fov=60", "fov", "is given more than once").await;
    check(VIEW, "fov=%ff", "fov", "its escapes are not UTF-8").await;
    check("/api/v1/cameras", "limit=3", "limit", "is not a parameter here").await;
    check("/api/v1/cameras/north", "t=live", "t", "is not a parameter here").await;
    check("/api/v1/scenes", "x", "x", "is not a parameter here").await;
    check("/api/v1/scenes/plaza", "x=", "x", "is not a parameter here").await;
}

#[tokio::test]
async fn all_wrong_parameters_are_named_at_once() {
    let problem = Bench::new().get(&format!("{VIEW}?width=0&fov=0&x=1&t=?")).await.problem(400, VIEW);
    let mut named: Vec<&str> =
        problem["errors"].as_array().unwrap().iter().map(|e| e["parameter"].as_str().unwrap()).collect();
    named.sort_unstable();
    assert_eq!(named, ["fov", "t", "width", "x"]);
}

#[tokio::test]
async fn what_is_not_there_is_answered_with_what_is() {
    let bench = Bench::new();
    let check = async |path: &str, said: &str| {
        let problem = bench.get(path).await.problem(404, path_of(path));
        assert_eq!(problem["type"], "urn:videofields:problem:not-found");
        assert!(problem["detail"].as_str().unwrap().contains(said), "{path}: {problem}");
    };
    let cameras = "there is no camera \"nort\"; did you mean \"north\"? known: north, south";
    check("/api/v1/cameras/nort", cameras).await;
    check("/api/v1/cameras/nort/frame.jpg", cameras).await;
    check("/api/v1/cameras/nort/locate?u=0&v=0", cameras).await;
    check("/api/v1/cameras/north/locate?u=0&v=0&scene=x", "there is no scene \"x\"; known: plaza").await;
    check("/api/v1/scenes/x", "there is no scene \"x\"; known: plaza").await;
    check("/api/v1/scenes/x/view.jpg", "there is no scene \"x\"; known: plaza").await;
    let pictures = "known: frame.jpg, frame.png, background.jpg, background.png, mask.jpg, mask.png";
    for file in ["frame", "frame.", ".jpg", "frame.gif", "frame.JPG", "view.jpg", "frame.jpg.png", "%2e%2e"] {
        check(&format!("/api/v1/cameras/north/{file}"), pictures).await;
    }
    check("/api/v1/scenes/plaza/view.webp", "known: view.jpg, view.png").await;
    check("/api/v1/scenes/plaza/..%2f..%2fetc%2fpasswd", "known: view.jpg, view.png").await;
    for path in
        ["/nowhere", "/api", "/api/v1", "/api/v2/cameras", "/api/v1/cameras/", "/api/v1/cameras/a/b/c"]
    {
        check(path, "there is nothing at").await;
    }
}

#[tokio::test]
async fn a_path_that_is_not_utf8_is_refused() {
    for path in ["/api/v1/cameras/%ff", "/api/v1/cameras/%ff/frame.jpg", "/api/v1/scenes/%c3%28"] {
        let problem = Bench::new().get(path).await.problem(400, path);
        assert_eq!(problem["detail"], "the path's escapes are not UTF-8");
    }
}

#[tokio::test]
async fn only_get_and_head_are_answered() {
    let bench = Bench::new();
    for path in ["/", "/healthz", "/metrics", "/api/v1/cameras", VIEW, LOCATE] {
        for method in ["POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "BREW"] {
            let request = Request::builder().method(method).uri(path).body(Body::from("{}")).unwrap();
            let answer = bench.send(request).await;
            assert_eq!(answer.problem(405, path)["type"], "urn:videofields:problem:method");
            let allow: Vec<&str> =
                answer.headers.get_all("allow").iter().map(|value| value.to_str().unwrap()).collect();
            assert_eq!(allow, ["GET, HEAD"], "{method} {path}");
        }
    }
}

async fn asked_of_a_failing_engine(target: &str, failure: EngineError) -> Answer {
    Bench::within(Limits::default(), State { failure: Some(failure), ..State::default() }).get(target).await
}

#[tokio::test]
async fn each_failure_of_the_engine_has_its_status() {
    let text = || "because".to_owned();
    let gap = || EngineError::Gap {
        camera: "north".into(),
        asked: Timestamp::from_nanos(0),
        before: None,
        after: Some(Timestamp::from_nanos(1_000_000_000)),
    };
    let cases: [(EngineError, u16, &str, Option<Value>); 10] = [
        (EngineError::NoCamera { id: "w".into() }, 404, "not-found", None),
        (EngineError::NoScene { id: "w".into() }, 404, "not-found", None),
        (
            EngineError::Request(Fault::new("eye", "is inside the earth")),
            400,
            "invalid",
            Some(json!([{"parameter": "eye", "detail": "is inside the earth"}])),
        ),
        (gap(), 404, "not-found", Some(json!([{"parameter": "t", "detail": gap().to_string()}]))),
        (
            EngineError::NoFrame { camera: "north".into(), state: "connecting".into() },
            503,
            "unavailable",
            None,
        ),
        (EngineError::NoSurface(text()), 404, "not-found", None),
        (
            EngineError::TooLarge(Fault::new("width", "at most 8192")),
            422,
            "too-large",
            Some(json!([{"parameter": "width", "detail": "at most 8192"}])),
        ),
        (
            EngineError::Busy { waiting: 32, retry_after: Duration::from_millis(300) },
            503,
            "unavailable",
            None,
        ),
        (EngineError::Unavailable(text()), 503, "unavailable", None),
        (EngineError::Internal("secret: disk full".into()), 500, "internal", None),
    ];
    for (failure, status, slug, errors) in cases {
        for target in [VIEW, FRAME, &format!("{LOCATE}?u=0&v=0")] {
            let answer = asked_of_a_failing_engine(target, failure.clone()).await;
            let problem = answer.problem(status, path_of(target));
            assert_eq!(problem["type"], format!("urn:videofields:problem:{slug}"), "{failure:?}");
            assert_eq!(problem.get("errors"), errors.as_ref(), "{failure:?}");
            let retry = if status == 503 { "1" } else { "(absent)" };
            assert_eq!(answer.field("retry-after"), retry, "{failure:?}");
            assert!(!String::from_utf8_lossy(&answer.body).contains("secret"), "{target}");
        }
    }
}

#[tokio::test]
async fn a_time_in_no_frames_reach_says_where_the_frames_are() {
    let problem = Bench::new().get(&format!("{FRAME}?t=0")).await.problem(404, FRAME);
    assert_eq!(problem["errors"][0]["parameter"], "t");
    assert!(
        problem["detail"].as_str().unwrap().contains("the first frame kept is of 1970-01-01T00:00:01Z"),
        "{problem}"
    );
}

#[tokio::test]
async fn long_targets_and_large_fields_are_refused() {
    let bench = Bench::new();
    let problem = bench.get(&format!("/healthz?{}", "x".repeat(2048))).await.problem(414, "/healthz");
    assert!(problem["detail"].as_str().unwrap().contains("2048 bytes"));
    assert_eq!(bench.get(&format!("/healthz?{}", "x".repeat(2000))).await.status.as_u16(), 200);
    let request = Request::get("/healthz").header("cookie", "x".repeat(17_000)).body(Body::empty()).unwrap();
    let problem = bench.send(request).await.problem(431, "/healthz");
    assert!(problem["detail"].as_str().unwrap().contains("16384 bytes"));
}

#[tokio::test]
async fn a_view_that_never_comes_is_given_up() {
    let limits = Limits { request_time: Duration::from_millis(30), ..Limits::default() };
    let bench = Bench::within(limits, State { keeps_views: true, ..State::default() });
    let problem = bench.get(VIEW).await.problem(503, VIEW);
    assert!(problem["detail"].as_str().unwrap().contains("no answer within 0.0 s"), "{problem}");
    // The renderer is told that nobody waits any more.
    assert!(bench.door.0.lock().unwrap().kept[0].is_closed());
}

#[tokio::test]
async fn a_renderer_that_goes_away_is_unavailable() {
    let bench = Bench::within(Limits::default(), State { keeps_views: true, ..State::default() });
    let dropped = async {
        while bench.door.0.lock().unwrap().kept.pop().is_none() {
            tokio::task::yield_now().await;
        }
    };
    let (answer, ()) = tokio::join!(bench.get(VIEW), dropped);
    assert_eq!(answer.problem(503, VIEW)["detail"], "the renderer stopped");
}

#[tokio::test]
async fn too_many_requests_at_once_are_refused_but_probes_are_answered() {
    let limits = Limits { requests_at_once: 1, ..Limits::default() };
    let bench = Bench::within(limits, State { keeps_views: true, ..State::default() });
    let others = async {
        while bench.door.0.lock().unwrap().kept.is_empty() {
            tokio::task::yield_now().await;
        }
        let problem = bench.get("/api/v1/cameras").await.problem(503, "/api/v1/cameras");
        assert_eq!(problem["detail"], "1 requests are being answered already");
        for path in ["/healthz", "/readyz", "/metrics"] {
            assert_eq!(bench.get(path).await.status.as_u16(), 200, "{path}");
        }
        bench.door.0.lock().unwrap().kept.clear();
    };
    let (first, ()) = tokio::join!(bench.get(VIEW), others);
    first.problem(503, VIEW);
    assert_eq!(bench.get("/api/v1/cameras").await.status.as_u16(), 200);
}

/// Requests made of right and wrong parts in any order.
fn any_target() -> impl Strategy<Value = String> {
    let segment = || {
        prop_oneof![
            Just("north".to_owned()),
            Just("plaza".to_owned()),
            Just("cameras".to_owned()),
            Just("scenes".to_owned()),
            Just("locate".to_owned()),
            "(frame|background|mask|view)\\.(jpg|png|gif)",
            "[a-zA-Z0-9%._~+-]{1,12}",
        ]
    };
    let known = prop_oneof![
        Just(VIEW.to_owned()),
        Just(VIEW.replace("jpg", "png")),
        Just(FRAME.to_owned()),
        Just("/api/v1/cameras/north/mask.png".to_owned()),
        Just(LOCATE.to_owned()),
        Just("/api/v1/cameras".to_owned()),
        Just("/api/v1/scenes/plaza".to_owned()),
        prop::collection::vec(segment(), 1..4).prop_map(|parts| format!("/api/v1/{}", parts.join("/"))),
        prop::collection::vec(segment(), 0..3).prop_map(|parts| format!("/{}", parts.join("/"))),
    ];
    let name = prop_oneof![
        4 => "(projection|eye|target|fov|across|window|samples|width|height|t|entities|u|v|scene|method)",
        1 => "[a-z%0-9_-]{0,8}",
    ];
    let value = prop_oneof![
        3 => any::<f64>().prop_map(|number| number.to_string()),
        3 => (0.0..1.0_f64).prop_map(|number| number.to_string()),
        2 => any::<i64>().prop_map(|number| number.to_string()),
        3 => "-?[0-9]{1,4}(\\.[0-9]{1,3})?,-?[0-9]{1,4},-?[0-9]{1,4}(e[0-9]{1,3})?",
        2 => "(live|billboards|points|none|ray|map|plaza|NaN|inf|-0|1970-01-01T00:00:09(Z|\\+01:00))",
        2 => "[!-~&&[^#\"<>`{}|^\\\\]]{0,24}",
    ];
    let parameters = prop::collection::vec((name, value), 0..6).prop_map(|pairs| {
        pairs.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join("&")
    });
    (known, parameters).prop_map(|(path, query)| format!("{path}?{query}"))
}

#[test]
fn no_request_whatever_panics_or_is_the_daemons_fault() {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let bench = Bench::new();
    let mut runner = proptest::test_runner::TestRunner::new_with_rng(
        videofields_testing::seeded(3000),
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    let seen: [std::cell::Cell<u32>; 600] = std::array::from_fn(|_| std::cell::Cell::new(0));
    let outcome = runner.run(&any_target(), |target| {
        let request = match Request::get(&target).body(Body::empty()) {
            Ok(request) => request,
            Err(error) => return Err(TestCaseError::reject(error.to_string())),
        };
        let answer = runtime.block_on(bench.send(request));
        let status = answer.status.as_u16();
        prop_assert!([200, 400, 404].contains(&status), "{target}: {status}");
        if status != 200 {
            answer.problem(status, path_of(&target));
        }
        let count = &seen[usize::from(status)];
        count.set(count.get() + 1);
        Ok(())
    });
    outcome.unwrap();
    // Each kind of answer comes up often enough that the test says something.
    let [found, invalid, missing] = [200, 400, 404].map(|status: usize| seen[status].get());
    assert!(found > 100 && invalid > 500 && missing > 300, "{found} {invalid} {missing}");
}

#[tokio::test]
async fn only_the_daemons_own_names_are_answered() {
    let bench = Bench::new();
    let status = async |host: &str| {
        let request = Request::get(FRAME).header("host", host).body(Body::empty()).unwrap();
        bench.send(request).await
    };
    for host in
        ["127.0.0.1:8080", "127.0.0.1", "[::1]:8080", "[::1]", "localhost:8080", "LOCALHOST", "Wall.example"]
    {
        assert_eq!(status(host).await.status, 200, "{host}");
    }
    for host in
        ["evil.example", "evil.example:8080", "127.0.0.1.evil.example", "localhost.evil.example", "[::1", ""]
    {
        let problem = status(host).await.problem(421, FRAME);
        assert_eq!(problem["type"], "urn:videofields:problem:host", "{host}");
        assert!(problem["detail"].as_str().unwrap().contains("server.hosts"), "{host}");
    }
}

#[tokio::test]
async fn pictures_that_clients_have_not_taken_are_bounded() {
    let bench = Bench::within(Limits { answer_bytes: 2048, ..Limits::default() }, State::default());
    let ask = async || {
        let request = Request::get(FRAME).body(Body::empty()).unwrap();
        tower::ServiceExt::oneshot(bench.router.clone(), request).await.unwrap()
    };
    let (mut held, mut refused) = (Vec::new(), None);
    for _ in 0..8 {
        let response = ask().await;
        match response.status().as_u16() {
            200 => held.push(response),
            status => refused = refused.or(Some(status)),
        }
    }
    assert!(!held.is_empty() && refused == Some(503), "{} held, {refused:?}", held.len());
    drop(held);
    assert_eq!(ask().await.status(), 200, "what was taken or given up makes room");
}

#[tokio::test]
async fn a_body_that_never_comes_gives_its_place_back() {
    let limits =
        Limits { requests_at_once: 1, request_time: Duration::from_millis(200), ..Limits::default() };
    let bench = Bench::within(limits, State::default());
    let never = futures_util::stream::pending::<Result<Vec<u8>, std::convert::Infallible>>();
    let request = Request::patch("/api/v1/cameras/north/segment").body(Body::from_stream(never)).unwrap();
    let status = bench.send(request).await.status.as_u16();
    assert!(matches!(status, 408 | 503), "{status}");
    tokio::time::sleep(Duration::from_millis(100)).await;
    assert_eq!(bench.get("/api/v1/cameras").await.status, StatusCode::OK);
}
