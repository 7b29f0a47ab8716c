//! Hidden things: a guest who may see camera `north` alone asks every route, and tries every change and every name, of a daemon that
//! has another camera, scenes, views, walls, playheads, files and users, and of one that has none of them. Not a byte of the answers
//! differs, but for [`TOLD`].

use super::rights::{accounts, router_over, walls};
use super::walk::{Ask, Told, change, changes, is_alike, look, looks, name_ending, told};
use super::{Bench, SCENE, camera, has_adapter, pictures};
use axum::Router;
use serde_json::{Value, json};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;
use videofields_recording::accounts::{Accounts, UserChange};
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::{Catalog, Changer, Condition};
use videofields_vision::access::Role;
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{End, EntitySettings, Settings};

/// Names that are given to what is hidden, or to nothing at all.
const HIDDEN: [&str; 3] = ["vault", "kiln", "lumber"];

/// Fields that are told on purpose: that a scene has other cameras, and whether a picture was drawn for somebody before.
const TOLD: [&str; 2] = ["videofields-restricted", "videofields-cache"];

/// A daemon, and the tokens of an admin and of the guest.
struct World {
    bench: Bench,
    router: Router,
    tokens: [String; 2],
}

impl World {
    fn asked(&self, who: usize, ask: &Ask) -> Told {
        let told = self.bench.runtime.block_on(told(&self.router, &self.tokens[who], ask));
        // A plan says it in its document.
        told.without_fields(&TOLD).replaced("\"restricted\":true", "\"restricted\":false")
    }

    fn ending(&self) -> String {
        self.bench.runtime.block_on(name_ending(&self.router, &self.tokens[1])).unwrap()
    }
}

/// The scene without one of its cameras, its ground with that picture.
fn scene_without(idx: usize, file: Option<&str>) -> String {
    let mut scene: Value = serde_json::from_str(SCENE).unwrap();
    scene["cameras"].as_array_mut().unwrap().remove(idx);
    if let Some(file) = file {
        scene["ground"][0]["texture"] = json!({"file": format!("assets/{file}"), "size_m": [2, 2]});
    }
    scene.to_string()
}

fn picture(srgb: [u8; 3]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image::RgbImage::from_pixel(4, 4, image::Rgb(srgb))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

fn wall_of(scene: &str, parameters: &str) -> Value {
    json!({
        "scene": scene, "parameters": parameters, "view": {"eye_m": [7, -7, 5], "target_m": [0, 0, 0]},
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3]}},
    })
}

/// Keeps what the guest may see, in both worlds: a yard, and a lot whose ground has a picture.
async fn keep_seen(bench: &Bench, catalog: &Arc<Catalog>) {
    catalog.put_asset(&bench.handle, ("seen.png", picture([9, 9, 9])), |_| true).await.unwrap();
    let lot = ("lot", scene_without(1, Some("seen.png")));
    catalog.put_scene(&bench.handle, lot, Condition::Absent, None).await.unwrap();
}

/// Keeps what only one world has.
async fn hide(bench: &Bench, catalog: &Arc<Catalog>) {
    catalog.put_asset(&bench.handle, ("spare.png", picture([0, 9, 0])), |_| true).await.unwrap();
    catalog.put_asset(&bench.handle, ("lumber.png", picture([0, 0, 9])), |_| true).await.unwrap();
    let lumber = ("lumber", scene_without(0, Some("lumber.png")));
    catalog.put_scene(&bench.handle, lumber, Condition::Absent, None).await.unwrap();
    let by_south = "relight=camera&relight_camera=south";
    let put = async |kind, id: &str, document: Value| {
        let root = Changer { user: Some("root".to_owned()), role: Role::Admin };
        catalog.put((kind, id), document.to_string(), Condition::Absent, root).await.unwrap();
    };
    for (id, scene, parameters) in [("vault", "lumber", ""), ("kiln", "yard", by_south)] {
        put(DocumentKind::View, id, json!({"scene": scene, "parameters": parameters})).await;
        put(DocumentKind::Wall, id, wall_of(scene, parameters)).await;
    }
    // One that was, and whose name is remembered.
    put(DocumentKind::View, "lumber", json!({"scene": "lumber"})).await;
    let by = Some("root".to_owned());
    catalog.remove((DocumentKind::View, "lumber"), Condition::Present, by).await.unwrap();
    bench.handle.put_playhead("vault", json!({"scene": "lumber", "paused": true})).unwrap();
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let accounts = Accounts::open(bench.store.clone(), clock).await.unwrap();
    let operator = json!({"role": "operator", "cameras": {"south": ["live", "manage"]}});
    accounts.put_user("vault", UserChange::read(operator).unwrap(), None).await.unwrap();
    accounts.add_token("vault", "a wall".to_owned(), None).await.unwrap();
}

/// Presence of what a guest may not see.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hidden {
    There,
    Absent,
}

fn world(folder: &Path, hidden: Hidden) -> World {
    let has_hidden = hidden == Hidden::There;
    let mut cameras = vec![camera("north", pictures(folder, "north", 0..20), End::Stop)];
    if has_hidden {
        cameras.push(camera("south", pictures(folder, "south", 0..20), End::Stop));
    }
    // Nobody is placed before somebody asks: which instants that reaches in time depends on how busy the machine is.
    let entities = EntitySettings { rate_hz: 0.0 };
    let settings = Settings { camera: cameras.clone(), entities, ..Settings::default() };
    let yard = if has_hidden { SCENE.to_owned() } else { scene_without(1, None) };
    let bench = Bench::start(folder, settings, &[("yard", &yard)]);
    for camera in cameras {
        bench.wait_for_state(camera.id.as_str(), "ended");
    }
    let tokens = accounts(&bench);
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let catalog = bench.runtime.block_on(async {
        let catalog = Arc::new(walls(&bench, &clock).await);
        keep_seen(&bench, &catalog).await;
        if has_hidden {
            hide(&bench, &catalog).await;
        }
        catalog
    });
    bench
        .handle
        .put_playhead("wall", json!({"scene": "yard", "at": "1970-01-01T00:00:00.2Z", "paused": true}))
        .unwrap();
    let router = router_over(&bench, catalog);
    World { bench, router, tokens }
}

/// Looks at what has a hidden name, by every route that takes one.
fn looks_at(name: &str) -> Vec<Ask> {
    let mut paths: Vec<String> = ["", "/versions", "/versions/1", "/picture.png?width=64&height=48"]
        .map(|rest| format!("/api/v1/views/{name}{rest}"))
        .into();
    let of_wall = ["", "/versions", "/screens", "/tiles", "/tiles/r1c1/frame.png", "/events"];
    paths.extend(of_wall.map(|rest| format!("/api/v1/walls/{name}{rest}")));
    paths.extend(["", "/events"].map(|rest| format!("/api/v1/playheads/{name}{rest}")));
    paths.extend([
        format!("/api/v1/views?scene={name}"),
        format!("/api/v1/assets/{name}.png"),
        format!("/api/v1/users/{name}"),
        format!("/api/v1/jobs?asked_by={name}"),
        format!("/api/v1/scenes/yard/view.png?width=64&height=48&t=playhead:{name}"),
    ]);
    paths.into_iter().map(look).collect()
}

/// Tries to give that name to something, under every condition.
fn tries_of(name: &str) -> Vec<Ask> {
    let view = json!({"scene": "yard"});
    let mut tries = Vec::new();
    for (path, document) in [
        (format!("/api/v1/views/{name}"), view.clone()),
        (format!("/api/v1/walls/{name}"), wall_of("yard", "")),
        (format!("/api/v1/playheads/{name}"), json!({"scene": "yard"})),
    ] {
        let put = |document: &Value| change("PUT", &path, document);
        tries.extend([
            put(&document),
            put(&document).with("if-none-match", "*"),
            put(&document).with("if-match", "*"),
            put(&document).with("if-match", "\"1\""),
            put(&document).with("if-match", "\"2\""),
            put(&json!([])).with("if-none-match", "*"),
            change("PATCH", &path, &json!({"name": "x"})).with("if-match", "*"),
            change("PATCH", &path, &json!({"paused": true})),
            change("DELETE", &path, &Value::Null).with("if-match", "*"),
            change("DELETE", &path, &Value::Null).with("if-match", "\"1\""),
            change("DELETE", &path, &Value::Null),
        ]);
        if !path.contains("playheads") {
            tries.push(change("PUT", format!("{path}?validate_only=true"), &document));
            tries.push(
                change("POST", format!("{path}/versions/1/restore"), &Value::Null).with("if-match", "*"),
            );
        }
    }
    tries
}

/// Tries to keep what names a camera.
fn tries_with(camera: &str) -> Vec<Ask> {
    let parameters = format!("relight=camera&relight_camera={camera}");
    let view = json!({"scene": "yard", "parameters": parameters});
    vec![
        change("PUT", "/api/v1/views/gate?validate_only=true", &view),
        change("PUT", "/api/v1/views/gate", &view).with("if-match", "\"1\""),
        change("PATCH", "/api/v1/views/gate", &json!({"parameters": parameters})).with("if-match", "*"),
        change("PUT", "/api/v1/walls/control?validate_only=true", &wall_of("yard", &parameters)),
        change("PATCH", "/api/v1/walls/control", &json!({"parameters": parameters})).with("if-match", "*"),
        look(format!("/api/v1/scenes/yard/view.png?width=64&height=48&{parameters}")),
        look(format!("/api/v1/views/gate/picture.png?width=64&height=48&{parameters}")),
        look(format!("/api/v1/scenes/yard/plan?width=64&height=48&{parameters}")),
    ]
}

#[test]
fn what_is_hidden_changes_not_a_byte_of_any_answer() {
    if !has_adapter() {
        return;
    }
    let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    let worlds = [world(folders[0].path(), Hidden::There), world(folders[1].path(), Hidden::Absent)];
    let both = |who: usize, ask: &Ask| worlds.each_ref().map(|world| world.asked(who, ask));
    let looks: Vec<Ask> = looks().into_iter().chain(HIDDEN.into_iter().flat_map(looks_at)).collect();
    let mut n_told = 0;
    for ask in &looks {
        let [with, without] = both(1, ask);
        is_alike("a look", ask, &with, &without);
        n_told += usize::from(with.status == 200);
        let quote = if ask.path == "/api/v1/openapi.json" { "\"" } else { "" };
        for name in HIDDEN.into_iter().chain(["south", "spare.png"]).filter(|name| !ask.path.contains(name)) {
            assert!(!with.names(&format!("{quote}{name}{quote}")), "{}: {}", ask.path, with.shown());
        }
    }
    assert!(n_told > 60, "{n_told} routes were answered");
    // What an admin sees comes after: of the world without, all of it is the guest's too, who would go on with what was found for others.
    let n_unlike = looks.iter().map(|ask| both(0, ask)).filter(|[with, without]| with != without).count();
    assert!(n_unlike > 60, "{n_unlike} answers tell whether it is there");
    let seen = both(1, &look("/api/v1/assets"));
    assert!(seen[0].names("seen.png") && !seen[0].names("lumber.png"), "{}", seen[0].shown());

    let tries =
        HIDDEN.into_iter().flat_map(tries_of).chain(["south", "nobody"].into_iter().flat_map(tries_with));
    for ask in tries.chain(changes("south", "lumber", "vault")) {
        let [with, without] = both(1, &ask);
        is_alike("a change", &ask, &with, &without);
        assert!(with.status >= 400, "{ask:?}: {}", with.shown());
    }
    for [hidden, nothing] in std::iter::zip(tries_with("south"), tries_with("mouth")).map(<[Ask; 2]>::from) {
        let [hidden, nothing] = [hidden, nothing].map(|ask| worlds[0].asked(1, &ask));
        let renamed = String::from_utf8_lossy(&hidden.body).replace("south", "mouth");
        assert_eq!(
            (hidden.status, renamed.as_bytes()),
            (nothing.status, &*nothing.body),
            "{}",
            hidden.shown()
        );
    }
    // Nothing was changed by any of it.
    for ask in [look("/api/v1/views"), look("/api/v1/walls"), look("/api/v1/playheads")] {
        assert!(
            worlds[0].asked(0, &ask).names("vault") && !worlds[1].asked(0, &ask).names("vault"),
            "{ask:?}"
        );
    }
    own_names(&worlds);
    for world in worlds {
        world.bench.stop();
    }
}

/// Names that the guest gives: what an admin hides afterwards in one world, and takes away in the other, is gone alike.
fn own_names(worlds: &[World; 2]) {
    let endings = worlds.each_ref().map(World::ending);
    let of_both = |who: usize, ask: &dyn Fn(&str) -> Ask| {
        [0, 1].map(|idx| worlds[idx].asked(who, &ask(&format!("own{}", endings[idx]))))
    };
    let path = |kind: &str, own: &str| format!("/api/v1/{kind}/{own}");
    for (kind, seen, hidden) in [
        ("views", json!({"scene": "yard"}), json!({"scene": "lumber"})),
        ("walls", wall_of("yard", ""), wall_of("lumber", "")),
        ("playheads", json!({"scene": "yard"}), json!({"scene": "lumber"})),
    ] {
        let made = of_both(1, &|own| change("PUT", path(kind, own), &seen).with("if-none-match", "*"));
        assert_eq!([made[0].status, made[1].status], [201, 201], "{kind}: {}", made[0].shown());
        is_alike(kind, &look("made"), &made[0], &made[1]);
        // It may take away and make again what is its own.
        let removed =
            of_both(1, &|own| change("DELETE", path(kind, own), &Value::Null).with("if-match", "*"));
        assert_eq!([removed[0].status, removed[1].status], [204, 204], "{kind}: {}", removed[0].shown());
        let made = of_both(1, &|own| change("PUT", path(kind, own), &seen).with("if-none-match", "*"));
        assert_eq!([made[0].status, made[1].status], [201, 201], "{kind}: {}", made[0].shown());

        let own = endings.each_ref().map(|ending| format!("own{ending}"));
        let moved = worlds[0].asked(0, &change("PUT", path(kind, &own[0]), &hidden).with("if-match", "*"));
        assert_eq!(moved.status, 200, "{kind}: {}", moved.shown());
        let gone = change("DELETE", path(kind, &own[1]), &Value::Null).with("if-match", "*");
        assert_eq!(worlds[1].asked(0, &gone).status, 204);
        for idx in 0..tries_of("x").len() {
            let [with, without] = of_both(1, &|own| tries_of(own).swap_remove(idx));
            is_alike(kind, &tries_of("own").swap_remove(idx), &with, &without);
        }
        for idx in 0..looks_at("x").len() {
            let [with, without] = of_both(1, &|own| looks_at(own).swap_remove(idx));
            is_alike(kind, &looks_at("own").swap_remove(idx), &with, &without);
        }
    }
}
