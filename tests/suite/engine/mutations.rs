//! Requests and scene documents that were changed at random, against a real engine and a real renderer: no panic, no
//! fault of the daemon, and every picture as large as was asked.

use super::{Bench, has_adapter, is_drawn, request};
use axum::body::{Body, to_bytes};
use axum::http::Request;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use tempfile::TempDir;
use tower::ServiceExt;
use videofields_api as api;
use videofields_picture::plan::EntityStyle;
use videofields_picture::scene;
use videofields_service::engine::{At, ViewRequest};
use videofields_vision::clock::SystemClock;
use videofields_vision::config::{End, Settings};
use videofields_vision::error::ErrorKind;

/// The generator `SplitMix64`: the same changes at every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    fn pick<T: Clone>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())].clone()
    }
}

pub(super) fn demo(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("config/demo").join(file)
}

/// The demo's cameras over clips that end, so that nothing competes with the renderer for long.
pub(super) fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.media.roots = vec![demo("clips")];
    settings.render.max_pixels = 4096;
    settings.camera = ["west", "east", "north"]
        .map(|id| super::camera(id, demo("clips").join(format!("{id}.webm")), End::Loop))
        .into();
    settings
}

const POINTS: [&str; 22] = [
    "0,-10,6",
    "12,0,1.7",
    "-3.5,4,30",
    "0,0,0",
    "0,0,1e-9",
    "-15.5,-11.5,6.4",
    "11,3,2",
    "1e8,1e8,1e8",
    "-1e8,0,1e-300",
    "1e7,-1e7,3",
    "0,0,-5",
    "0,-22,1.05",
    "NaN,0,0",
    "inf,0,0",
    "1e999,0,0",
    "1,2",
    "1,2,3,4",
    "",
    ",,",
    "0x1,2,3",
    "1e9,0,0",
    "%00,1,2",
];
const NUMBERS: [&str; 18] = [
    "16",
    "9",
    "1",
    "0",
    "-1",
    "2",
    "64",
    "65535",
    "65536",
    "4294967296",
    "1e3",
    "170",
    "1.0001",
    "0.5",
    "NaN",
    "",
    "-0",
    "90",
];
const TIMES: [&str; 12] = [
    "live",
    "0",
    "1",
    "500000000",
    "-1",
    "9223372036854775807",
    "-9223372036854775808",
    "9223372036854775808",
    "1970-01-01T00:00:00Z",
    "2026-02-30T00:00:00Z",
    "1970-01-01T00:00:00.7+00:00",
    "NaN",
];
const STYLES: [&str; 6] = ["billboards", "points", "none", "Points", "", "cubes"];

/// A view's query, most of it right.
fn query(random: &mut Random) -> String {
    let mut pairs = vec![("width", "16"), ("height", "9")];
    for (name, values) in
        [("eye", &POINTS[..]), ("target", &POINTS), ("fov", &NUMBERS), ("t", &TIMES), ("entities", &STYLES)]
    {
        // Half of the values come from the front of the list, where the good ones are.
        let values = if random.below(2) == 0 { &values[..values.len() / 2] } else { values };
        if random.below(3) > 0 {
            pairs.push((name, random.pick(values)));
        }
    }
    if random.below(6) == 0 {
        let place = random.below(2);
        pairs[place].1 = random.pick(&NUMBERS);
    }
    if random.below(20) == 0 {
        let again = pairs[random.below(pairs.len())];
        pairs.push(again);
    }
    let mut text = pairs.iter().map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join("&");
    if random.below(10) == 0 && !text.is_empty() {
        let place = random.below(text.len());
        text.replace_range(place..=place, random.pick(&["", "%", "&", "=", "9", "-", ",", "%ff", "e"]));
    }
    text
}

#[test]
fn a_thousand_mutated_view_requests_are_answered_or_refused() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let document = std::fs::read_to_string(demo("plaza.json")).unwrap();
    let bench = Bench::start(folder.path(), settings(), &[("plaza", &document)]);
    for id in ["west", "east", "north"] {
        bench.wait_for_state(id, "live");
    }
    let router = api::router_within(
        api::Limits::default(),
        (bench.handle.clone(), None),
        Arc::new(SystemClock::new()),
        api::Site::default(),
    );
    let mut random = Random(2);
    let mut statuses = BTreeMap::new();
    for _ in 0..1000 {
        let query = query(&mut random);
        let target = format!("/api/v1/scenes/plaza/view.png?{query}");
        let (status, body) = bench.runtime.block_on(async {
            let response = router.clone().oneshot(Request::get(&target).body(Body::empty()).unwrap()).await;
            let response = response.unwrap();
            (response.status().as_u16(), to_bytes(response.into_body(), 1 << 20).await.unwrap())
        });
        *statuses.entry(status).or_insert(0) += 1;
        match status {
            200 => {
                let asked = api::read_view_request("plaza", &query).unwrap();
                let picture = image::load_from_memory(&body).unwrap().into_rgb8();
                assert_eq!(picture.dimensions(), (asked.width_px, asked.height_px), "{query}");
                // NaN would come out of the shader as black; nothing in the plaza or its sky is.
                let n_black = picture.pixels().filter(|pixel| pixel.0 == [0; 3]).count();
                assert_eq!(n_black, 0, "{query}");
            }
            400 | 404 | 422 => {
                let problem: Value = serde_json::from_slice(&body).unwrap();
                assert!(
                    problem["detail"].as_str().is_some_and(|detail| !detail.is_empty()),
                    "{query}: {problem}"
                );
            }
            _ => panic!("{status} for {query}: {}", String::from_utf8_lossy(&body)),
        }
    }
    // How many are drawn hangs on how much of the past is kept while they are asked for.
    assert!(statuses[&200] > 100 && statuses[&400] > 200 && statuses[&404] > 0, "{statuses:?}");
    assert_eq!(bench.handle.cameras().iter().filter(|camera| camera.state == "live").count(), 3);
    bench.stop();
}

/// Changes one value somewhere in a document.
fn mutate(value: &mut Value, random: &mut Random) {
    match value {
        Value::Object(fields) if !fields.is_empty() && random.below(12) > 0 => {
            let key = fields.keys().nth(random.below(fields.len())).unwrap().clone();
            if random.below(15) == 0 {
                fields.remove(&key);
            } else {
                mutate(&mut fields[&key], random);
            }
        }
        Value::Array(items) if !items.is_empty() && random.below(12) > 0 => {
            let place = random.below(items.len());
            match random.below(20) {
                0 => drop(items.remove(place)),
                1 => items.push(items[place].clone()),
                _ => mutate(&mut items[place], random),
            }
        }
        Value::Number(number) if random.below(3) > 0 => {
            let factor = random.pick(&[0.0, -1.0, 0.5, 1.0001, 1e-9, 1e6, 1e300]);
            *value = json!(number.as_f64().unwrap() * factor);
        }
        _ => {
            let others =
                [json!(null), json!(0), json!(-1), json!(1e8), json!("x"), json!([]), json!({}), json!(true)];
            *value = random.pick(&others);
        }
    }
}

#[test]
fn mutated_scenes_that_are_accepted_are_drawn() {
    if !has_adapter() {
        return;
    }
    let good: Value = serde_json::from_str(&std::fs::read_to_string(demo("plaza.json")).unwrap()).unwrap();
    let mut random = Random(3);
    let (mut accepted, mut n_refused) = (Vec::new(), 0);
    while accepted.len() < 40 {
        let mut document = good.clone();
        for _ in 0..=random.below(3) {
            mutate(&mut document, &mut random);
        }
        let text = document.to_string();
        match scene::parse("x", &text, scene::no_imports) {
            Ok(_) => accepted.push((format!("s{}", accepted.len()), text)),
            Err(error) => {
                assert!(!error.to_string().is_empty());
                n_refused += 1;
            }
        }
    }
    assert!(n_refused > 20, "{n_refused}");
    let folder = TempDir::new().unwrap();
    let scenes: Vec<(&str, &str)> = accepted.iter().map(|(id, text)| (id.as_str(), text.as_str())).collect();
    let bench = Bench::start(folder.path(), settings(), &scenes);
    for id in ["west", "east", "north"] {
        bench.wait_for_state(id, "live");
    }
    let mut n_drawn = 0;
    for (id, text) in &scenes {
        for style in [EntityStyle::Billboards, EntityStyle::Points] {
            for (eye, target) in [(None, None), (Some(glam::dvec3(0.0, -13.0, 5.0)), Some(glam::DVec3::Y))] {
                let asked =
                    ViewRequest { eye, target, style, width_px: 16, height_px: 9, ..request(id, At::Live) };
                match bench.view(asked) {
                    Ok(answer) => {
                        assert_eq!((answer.image.width, answer.image.height), (16, 9), "{text}");
                        n_drawn += u32::from(is_drawn(&answer.image));
                    }
                    // What has no camera that is configured, or lies where no view reaches, is refused.
                    Err(error) => assert_ne!(error.kind(), ErrorKind::Internal, "{error}: {text}"),
                }
            }
        }
    }
    assert!(n_drawn > 100, "{n_drawn}");
    bench.stop();
}
