//! Named views: kept, listed, changed and brought back, and their pictures.

use super::house::{Answer, House};
use super::{Bench, SCENE, camera, has_adapter, pictures};
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;
use videofields_vision::config::{End, Settings};

const GATE: &str = "/api/v1/views/gate";

/// A daemon that has seen a few frames.
fn start(folder: &Path) -> House {
    let cameras = [
        camera("north", pictures(folder, "north", 0..5), End::Stop),
        camera("south", pictures(folder, "south", 0..5), End::Stop),
    ];
    let settings = Settings { camera: cameras.to_vec(), ..Settings::default() };
    let house = House::over(folder, Bench::start(folder, settings, &[]), ("yard", SCENE));
    for id in ["north", "south"] {
        house.bench.wait_for_state(id, "ended");
    }
    house
}

fn put(house: &House, id: &str, document: &Value) -> Answer {
    let path = format!("/api/v1/views/{id}");
    house.send("PUT", &path, Some(("if-none-match", "*")), &document.to_string())
}

#[test]
fn views_are_kept_listed_in_their_order_and_brought_back() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let refused = |document: Value, pointer: &str, part: &str| {
        let answer = put(&house, "gate", &document);
        let errors = answer.body["errors"].as_array().unwrap();
        assert_eq!((answer.status, &errors[0]["pointer"]), (400, &json!(pointer)), "{}", answer.body);
        assert!(errors[0]["detail"].as_str().unwrap().contains(part), "{}", answer.body);
    };
    refused(json!({"scene": "nowhere"}), "/scene", "yard");
    refused(json!({"scene": "yard", "parameters": "fovy=3"}), "/parameters", "fov");
    refused(json!({"scene": "yard", "parameters": "fov=30&fov=31"}), "/parameters", "more than once");
    refused(json!({"scene": "yard", "orders": 3}), "/orders", "order");
    for (id, group, order) in [("gate", "Outside", 2), ("door", "Outside", 1), ("hall", "Inside", 9)] {
        let view = json!({
            "name": id.to_uppercase(), "scene": "yard", "group": group, "order": order, "tags": [id, "all"],
            "parameters": "eye=7,-7,5&target=0,0,0&t=playhead:later",
        });
        let made = put(&house, id, &view);
        assert_eq!((made.status, made.etag.as_deref()), (201, Some("\"1\"")), "{}", made.body);
    }
    let listed = |query: &str| {
        let answer = house.get(&format!("/api/v1/views{query}"));
        assert_eq!(answer.status, 200, "{}", answer.body);
        let views = answer.body["views"].as_array().unwrap();
        views.iter().map(|view| view["id"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(listed(""), ["hall", "door", "gate"]);
    assert_eq!(listed("?group=Outside"), ["door", "gate"]);
    assert_eq!(listed("?tag=gate&scene=yard"), ["gate"]);
    assert!(listed("?scene=nowhere").is_empty());
    assert_eq!(house.get("/api/v1/views?gruop=a").status, 400);

    assert_eq!(house.send("PATCH", GATE, None, "{}").status, 428);
    let changed = house.send("PATCH", GATE, Some(("if-match", "\"1\"")), "{\"order\": 0, \"name\": null}");
    assert_eq!((changed.status, &changed.body["name"], &changed.body["order"]), (200, &json!(""), &json!(0)));
    assert_eq!(house.send("PATCH", GATE, Some(("if-match", "\"1\"")), "{\"order\": 5}").status, 412);
    assert_eq!(listed("?group=Outside"), ["gate", "door"]);
    let restored = house.send("POST", &format!("{GATE}/versions/1/restore"), Some(("if-match", "\"2\"")), "");
    assert_eq!((restored.status, restored.etag.as_deref()), (200, Some("\"3\"")), "{}", restored.body);
    assert_eq!(house.get(GATE).body["name"], "GATE");
    assert_eq!(house.send("DELETE", GATE, Some(("if-match", "\"3\"")), "").status, 204);
    assert_eq!(house.get(GATE).status, 404);
    // What was taken away comes back by its version too.
    let back = house.send("POST", &format!("{GATE}/versions/2/restore"), Some(("if-none-match", "*")), "");
    assert_eq!((back.status, back.etag.as_deref(), &back.body["name"]), (201, Some("\"5\""), &json!("")));
    let unknown = house.send("POST", &format!("{GATE}/versions/4/restore"), Some(("if-match", "\"5\"")), "");
    assert_eq!(unknown.status, 404, "{}", unknown.body);
    let versions = house.get(&format!("{GATE}/versions")).body;
    assert_eq!(versions["versions"].as_array().unwrap().len(), 5, "{versions}");
    house.bench.stop();
}

#[test]
fn a_view_is_drawn_as_it_is_kept_with_what_the_request_says() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let view = json!({"scene": "yard", "parameters": "eye=7,-7,5&target=0,0,0&fov=40&t=40000000"});
    assert_eq!(put(&house, "gate", &view).status, 201);
    let shown = house.get(&format!("{GATE}/picture.png?width=64&height=48&fov=60"));
    assert_eq!(shown.status, 200, "{}", shown.body);
    let same = "/api/v1/scenes/yard/view.png?eye=7,-7,5&target=0,0,0&fov=60&t=40000000&width=64&height=48";
    let same = house.get(same);
    assert!(shown.bytes == same.bytes && !shown.bytes.is_empty());
    assert_eq!(shown.field("videofields-view-version"), "1");
    assert_eq!(house.get(&format!("{GATE}/picture.gif")).status, 404);
    assert_eq!(house.get(&format!("{GATE}/picture.png?fovy=3")).status, 400);
    assert_eq!(house.get("/api/v1/views/none/picture.png").status, 404);
    house.bench.stop();
}
