//! Walls: tiles put together are one picture, all of one frame, on any surface; and what is kept and refused of walls.

use super::house::{Answer, House};
use super::mutations::{demo, settings};
use super::{Bench, has_adapter};
use image::RgbImage;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use videofields_vision::config::Resolution;

const WALL: &str = "/api/v1/walls/control";

/// The plaza with all its cameras live.
pub(super) fn start(folder: &Path) -> House {
    let mut settings = settings();
    settings.render.max_pixels = 1 << 20;
    settings.render.timeout_secs = 10.0;
    // Segmentation that is not optimised leaves little time to draw in.
    settings.camera.iter_mut().for_each(|camera| camera.segment.resolution = Resolution::Quarter);
    let document = std::fs::read_to_string(demo("plaza.json")).unwrap();
    let house = House::over(folder, Bench::start(folder, settings, &[]), ("plaza", &document));
    for id in ["west", "east", "north"] {
        house.bench.wait_for_state(id, "live");
    }
    house
}

/// Five by three tiles of 96 x 64 pixels, 4 pixels apart.
fn flat() -> Value {
    json!({
        "name": "Control room",
        "scene": "plaza",
        "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
        "viewer_m": [0, 0.1, 2.4],
        "parameters": "entities=billboards",
        "surface": {"grid": {
            "columns": 5, "rows": 3, "tile_px": [96, 64], "tile_m": [0.96, 0.64], "gap_m": [0.04, 0.04],
        }},
    })
}

fn make(house: &House, document: &Value) {
    let made = house.send("PUT", WALL, Some(("if-none-match", "*")), &document.to_string());
    assert_eq!((made.status, made.etag.as_deref()), (201, Some("\"1\"")), "{}", made.body);
}

fn picture(answer: &Answer) -> RgbImage {
    assert_eq!(answer.status, 200, "{}", answer.body);
    image::load_from_memory(&answer.bytes).unwrap().into_rgb8()
}

fn number(answer: &Answer, field: &str) -> u64 {
    answer.field(field).parse().unwrap()
}

/// Where pictures lie for people to judge.
fn judged() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("target/pictures/wall");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// The tiles, as the wall lists them.
fn tiles(house: &House) -> Vec<Value> {
    house.get(&format!("{WALL}/tiles")).body["tiles"].as_array().unwrap().clone()
}

/// Paths of all tiles' pictures.
fn paths(tiles: &[Value], query: &str) -> Vec<String> {
    let path = |tile: &Value| format!("{WALL}/tiles/{}/frame.png{query}", tile["id"].as_str().unwrap());
    tiles.iter().map(path).collect()
}

/// The number of a frame that is soon due.
fn next_frame(house: &House) -> u64 {
    let first = house.get(&format!("{WALL}/tiles/r1c1/frame.png?pattern=test"));
    assert_eq!(first.status, 200, "{}", first.body);
    number(&first, "videofields-wall-frame") + 3
}

fn corner(tile: &Value, idx: usize) -> String {
    let point = tile["window_m"][idx].as_array().unwrap().iter().map(ToString::to_string);
    point.collect::<Vec<_>>().join(",")
}

/// What all tiles of a frame put together and the same window drawn at once differ by: how many codes by more than one level,
/// the most, and how many there are.
fn torn(house: &House, parameters: &str) -> (usize, u8, usize) {
    let tag = house.get(WALL).etag.unwrap();
    let change = json!({ "parameters": parameters }).to_string();
    assert_eq!(house.send("PATCH", WALL, Some(("if-match", &tag)), &change).status, 200);
    let tiles = tiles(house);
    assert_eq!(tiles.len(), 15);
    loop {
        if let Some(difference) = compared(house, &tiles, parameters) {
            return difference;
        }
    }
}

/// As [`torn`]; none where a camera that lagged at the frame's instant was seen further since, which the one picture shows and
/// tiles must not.
fn compared(house: &House, tiles: &[Value], parameters: &str) -> Option<(usize, u8, usize)> {
    let frame = next_frame(house);
    let answers = house.get_all(&paths(tiles, &format!("?at={frame}")));
    let time = answers[0].field("videofields-time").to_owned();
    for answer in &answers {
        assert_eq!(answer.status, 200, "{}", answer.body);
        let shown = (number(answer, "videofields-wall-frame"), answer.field("videofields-time"));
        assert_eq!(shown, (frame, time.as_str()));
    }
    let window = [corner(&tiles[10], 0), corner(&tiles[14], 1), corner(&tiles[0], 2)].join(",");
    let whole = format!(
        "/api/v1/scenes/plaza/view.png?projection=window&eye=0,-14,5&window={window}&width=496&height=200&t={time}&{parameters}"
    );
    let whole = house.get(&whole);
    let sources =
        |of: &Answer| (of.field("videofields-sources").to_owned(), of.field("videofields-gaps").to_owned());
    for answer in &answers {
        assert_eq!(sources(answer), sources(&answers[0]));
    }
    if sources(&whole) != sources(&answers[0]) {
        return None;
    }
    let whole = picture(&whole);
    // Behind bezels stands what the one picture shows there.
    let mut together = whole.clone();
    for (idx, answer) in answers.iter().enumerate() {
        let (left, top) = (idx as u32 % 5 * 100, idx as u32 / 5 * 68);
        image::imageops::replace(&mut together, &picture(answer), i64::from(left), i64::from(top));
    }
    together.save(judged().join("tiles.png")).unwrap();
    whole.save(judged().join("whole.png")).unwrap();
    // Not the same colour all over.
    assert!(whole.pixels().collect::<std::collections::HashSet<_>>().len() > 500);
    let differences = || together.as_raw().iter().zip(whole.as_raw()).map(|(a, b)| a.abs_diff(*b));
    Some((differences().filter(|by| *by > 1).count(), differences().max().unwrap(), whole.as_raw().len()))
}

/// With several samples a pixel, a rasteriser looks up what lies on a triangle's edge at a covered part of the pixel of its own
/// choice: there, and nowhere else, tiles differ from one large picture by more than rounding.
#[test]
fn fifteen_tiles_and_their_bezels_are_one_large_picture() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    make(&house, &flat());
    for parameters in ["samples=1", "samples=1&supersampling=2", "samples=1&entities=points&see_through=off"]
    {
        let (n_off, most, n) = torn(&house, parameters);
        assert!(most <= 1, "{parameters}: {n_off} of {n} codes are off, by {most} at most");
    }
    // Measured: 1.5 % of codes, by 38 levels at most.
    let (n_off, most, n) = torn(&house, "samples=4");
    assert!(n_off * 50 < n && most < 64, "{n_off} of {n} codes are off, by {most} at most");
    house.bench.stop();
}

#[test]
fn tiles_of_a_frame_show_one_instant_whoever_asks_and_late_ones_get_the_next() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let mut document = flat();
    // Slow enough that all tiles of a frame are asked for before it is over, on a machine that is busy beside.
    document["rate_hz"] = json!(2);
    document["surface"]["grid"]["tile_px"] = json!([32, 24]);
    document["surface"]["grid"]["tile_m"] = json!([0.32, 0.24]);
    make(&house, &document);
    let tiles = tiles(&house);
    // At most two frames of a slow wall are waited for.
    let mut frame = next_frame(&house) - 1;
    let mut times = std::collections::BTreeSet::new();
    for _ in 0..40 {
        let answers = house.get_all(&paths(&tiles, &format!("?at={frame}")));
        let ids = || answers.iter().map(|answer| number(answer, "videofields-wall-frame"));
        assert!(ids().all(|id| id >= frame), "before {frame}: {:?}", ids().collect::<Vec<_>>());
        if ids().all(|id| id == frame) {
            let shown: std::collections::BTreeSet<_> =
                answers.iter().map(|answer| answer.field("videofields-time").to_owned()).collect();
            assert_eq!(shown.len(), 1, "a torn wall: {shown:?}");
            times.extend(shown);
        }
        // A machine so busy that a frame was over before all had asked for it tells nothing of that frame.
        frame = ids().max().unwrap() + 1;
        if times.len() > 3 {
            break;
        }
    }
    assert!(times.len() > 3, "time goes on: {times:?}");

    // The same frame again is the same picture; one long over is the one that is due; one far ahead is not waited for.
    let path = |at: u64| format!("{WALL}/tiles/r2c3/frame.png?at={at}");
    let (first, again) = (house.get(&path(frame)), house.get(&path(frame)));
    assert!(first.bytes == again.bytes && first.status == 200);
    let late = house.get(&path(frame - 1000));
    assert!(number(&late, "videofields-wall-frame") >= frame, "{}", late.body);
    let early = house.get(&path(frame + 1000));
    assert_eq!((early.status, &early.body["errors"][0]["parameter"]), (400, &json!("at")), "{}", early.body);
    house.bench.stop();
}

#[test]
fn a_wall_around_the_viewer_goes_on_from_tile_to_tile() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let surface = json!({"cylinder": {
        "columns": 6, "rows": 1, "tile_px": [160, 200], "tile_m": [0.8, 1.0], "gap_m": [0.0, 0.0], "radius_m": 1.6,
    }});
    let mut document = flat();
    document["surface"] = surface;
    document.as_object_mut().unwrap().remove("viewer_m");
    make(&house, &document);
    assert_eq!(house.get(WALL).body["viewer_m"], json!([0.0, 0.0, 0.0]));
    let tiles = tiles(&house);
    let point = |tile: &Value, idx: usize| {
        let at = &tile["window_m"][idx];
        glam::DVec3::new(at[0].as_f64().unwrap(), at[1].as_f64().unwrap(), at[2].as_f64().unwrap())
    };
    let eye = glam::DVec3::new(0.0, -14.0, 5.0);
    for pair in tiles.windows(2) {
        // Edge to edge, and as far from the eye as the radius says.
        let (right, left) = (point(&pair[0], 1), point(&pair[1], 0));
        assert!(right.distance(left) < 1e-9, "{right} and {left}");
        let axis_m = 0.5_f64;
        assert!((right.distance(eye) - 1.6_f64.hypot(axis_m)).abs() < 1e-9, "{right}");
    }
    // The middle two meet straight ahead, and the order is from left to right.
    let ahead = (glam::DVec3::new(0.0, 2.0, 1.0) - eye).normalize();
    let middle = 0.5 * (point(&tiles[2], 1) + point(&tiles[3], 2)) - eye;
    assert!(middle.normalize().distance(ahead) < 1e-9, "{middle}");
    assert!(point(&tiles[0], 0).x < point(&tiles[5], 1).x);
    if has_adapter() {
        let frame = next_frame(&house);
        let mut together = RgbImage::new(6 * 160, 2 * 200);
        let shown = house.get_all(&paths(&tiles, &format!("?at={frame}")));
        let test = house.get_all(&paths(&tiles, "?pattern=test"));
        for (idx, (shown, test)) in shown.iter().zip(&test).enumerate() {
            image::imageops::replace(&mut together, &picture(shown), 160 * idx as i64, 0);
            image::imageops::replace(&mut together, &picture(test), 160 * idx as i64, 200);
        }
        together.save(judged().join("cylinder.png")).unwrap();
    }
    let named = picture(&house.get(&format!("{WALL}/tiles/r1c2/frame.png?pattern=identify")));
    named.save(judged().join("identify.png")).unwrap();
    let bright = named.pixels().filter(|pixel| pixel.0 == [235; 3]).count();
    assert!(bright > 200 && bright < 5_000, "{bright}");
    house.bench.stop();
}

#[test]
fn walls_are_kept_changed_and_refused_with_their_places() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let check = |change: Value, pointer: &str, part: &str| {
        let mut document = flat();
        for (key, value) in change.as_object().unwrap() {
            document[key] = value.clone();
        }
        let answer = house.send("PUT", WALL, Some(("if-none-match", "*")), &document.to_string());
        assert_eq!(answer.status, 400, "{change}: {}", answer.body);
        // Whoever only tries it hears the same.
        let tried = house.send("PUT", &format!("{WALL}?validate_only=true"), None, &document.to_string());
        assert_eq!((tried.status, &tried.body["errors"]), (400, &answer.body["errors"]), "{change}");
        let errors = answer.body["errors"].as_array().unwrap();
        let told = |error: &Value| {
            error["pointer"] == pointer
                && error["detail"].as_str().is_some_and(|detail| detail.contains(part))
        };
        assert!(errors.iter().any(told), "{pointer}, {part:?}: {}", answer.body);
    };
    check(json!({"scene": "nowhere"}), "/scene", "plaza");
    check(json!({"rate_hz": 0}), "/rate_hz", "0.5 to 60");
    check(json!({"zoom": 1e9}), "/zoom", "0.01 to 100");
    check(json!({"view": {"eye_m": [1, 1, 1], "target_m": [1, 1, 1]}}), "/view/target_m", "apart");
    check(json!({"view": {"eye_m": [1e9, 1, 1], "target_m": [1, 1, 1]}}), "/view/eye_m", "within");
    check(json!({"viewer_m": [0, 0, -1]}), "/viewer_m", "does not face the viewer");
    check(json!({"viewer_m": [0, 0, 0]}), "/viewer_m", "does not face the viewer");
    check(json!({"parameters": "width=3"}), "/parameters", "width");
    check(json!({"parameters": "fov=30"}), "/parameters", "fov");
    check(json!({"parameters": "qality=draft"}), "/parameters", "quality");
    check(json!({"surface": {"tiles": []}}), "/surface/tiles", "1 to 64");
    check(json!({"surface": {"sphere": {}}}), "/surface/sphere", "unknown");
    check(json!({"surface": {}}), "/surface", "expected one of");
    let grid = |key: &str, value: Value| {
        let mut grid = flat()["surface"]["grid"].clone();
        grid[key] = value;
        json!({"surface": {"grid": grid}})
    };
    check(grid("columns", json!(0)), "/surface/grid/columns", "1 or more");
    check(grid("rows", json!(4_000_000_000_u32)), "/surface/grid/rows", "at most 64");
    check(grid("tile_px", json!([96, 100_000])), "/surface/grid/tile_px/1", "16 to 16384");
    check(grid("tile_px", json!([16384, 16384])), "/surface/grid/tile_px", "at most 33177600 pixels");
    check(grid("tile_m", json!([0, 1])), "/surface/grid/tile_m/0", "metres");
    check(grid("gap_m", json!([-0.9, 0])), "/surface/grid/gap_m/0", "overlaps");
    check(grid("bezel", json!(1)), "/surface/grid/bezel", "unknown");
    let askew = json!({"surface": {"tiles": [{
        "id": "a", "size_px": [64, 64], "lower_left_m": [0, 0, 0], "lower_right_m": [1, 0, 0], "upper_left_m": [0.5, 1, 0],
    }]}});
    check(askew, "/surface/tiles/0", "rectangle");

    let tried = house.send("PUT", &format!("{WALL}?validate_only=true"), None, &flat().to_string());
    assert_eq!((tried.status, &tried.body["is_valid"]), (200, &json!(true)), "{}", tried.body);
    assert_eq!(tried.body["document"]["zoom"], 1.0, "with every default filled in");
    assert_eq!(house.get(WALL).status, 404, "and nothing is kept");
    make(&house, &flat());
    let listed = house.get("/api/v1/walls").body;
    assert_eq!(listed["walls"][0]["id"], "control");
    assert_eq!(listed["walls"][0]["tiles"], 15);
    assert_eq!(house.send("PATCH", WALL, None, "{}").status, 428);
    let patched = house.send("PATCH", WALL, Some(("if-match", "\"1\"")), "{\"zoom\": 2}");
    assert_eq!((patched.status, patched.etag.as_deref()), (200, Some("\"2\"")), "{}", patched.body);
    assert_eq!(house.send("PATCH", WALL, Some(("if-match", "\"1\"")), "{\"zoom\": 3}").status, 412);
    // Twice as large: half of what the window showed.
    let [first, last] = [0, 14].map(|idx| tiles(&house)[idx].clone());
    assert!(
        (first["window_m"][0][0].as_f64().unwrap() + 1.24).abs() < 1e-9 && last["id"] == "r3c5",
        "{first}"
    );
    assert_eq!(house.get(&format!("{WALL}/versions/1")).body["zoom"], 1.0);
    assert_eq!(house.get("/api/v1/walls/other").status, 404);
    assert_eq!(house.get(&format!("{WALL}/tiles/r9c9/frame.png")).status, 404);
    assert_eq!(house.get(&format!("{WALL}/tiles/r1c1/frame.gif")).status, 404);
    assert_eq!(house.get(&format!("{WALL}/tiles/r1c1/frame.png?pattern=bars")).status, 400);

    let restore = format!("{WALL}/versions/1/restore");
    assert_eq!(house.send("POST", &restore, Some(("if-match", "\"1\"")), "").status, 412);
    let restored = house.send("POST", &restore, Some(("if-match", "\"2\"")), "");
    assert_eq!((restored.status, restored.etag.as_deref()), (200, Some("\"3\"")), "{}", restored.body);
    assert_eq!(restored.body["zoom"], 1.0);
    let unknown = house.send("PATCH", WALL, Some(("if-match", "\"3\"")), "{\"playhead\": \"evening\"}");
    assert_eq!(unknown.status, 200);
    assert_eq!(house.get(&format!("{WALL}/tiles/r1c1/frame.png")).status, 404, "there is no such playhead");
    assert_eq!(house.send("DELETE", WALL, Some(("if-match", "\"4\"")), "").status, 204);
    assert_eq!(house.get(WALL).status, 404);
    house.bench.stop();
}
