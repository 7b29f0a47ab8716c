//! Who stands in a scene, and their hulls over HTTP: as meshes, and in views.

use super::has_adapter;
use super::walls::start;
use serde_json::Value;
use tempfile::TempDir;
use videofields_testing::wait_for;

#[test]
fn who_several_cameras_see_has_a_hull_as_a_mesh_and_in_views() {
    let folder = TempDir::new().unwrap();
    let house = start(folder.path());
    let base = "/api/v1/scenes/plaza";
    // People come and go: until one stands before two cameras at an instant that is still remembered.
    let (time, entity) = wait_for("somebody before two cameras", || {
        let live = house.get(&format!("{base}/entities"));
        assert_eq!(live.status, 200, "{}", live.body);
        // Looked at again by its time, of which the ids are.
        let time = live.body["time"].as_str()?.to_owned();
        let told = house.get(&format!("{base}/entities?t={time}")).body;
        let entity = told["entities"].as_array()?.iter().find(|of| of["has_hull"] == true)?.clone();
        Some((time, entity))
    });
    let id = &entity["id"];
    for (file, kind, magic) in
        [("hull.glb", "model/gltf-binary", &b"glTF"[..]), ("hull.ply", "application/octet-stream", b"ply\n")]
    {
        let mesh = house.get(&format!("{base}/entities/{id}/{file}?t={time}&resolution=48"));
        assert_eq!((mesh.status, mesh.field("content-type")), (200, kind), "{entity}");
        assert!(mesh.bytes.starts_with(magic) && mesh.bytes.len() > 4000, "{} bytes", mesh.bytes.len());
        let cameras: Vec<&str> = mesh.field("videofields-cameras").split(',').collect();
        let seen_by: Vec<&str> =
            entity["cameras"].as_array().unwrap().iter().map(|id| id.as_str().unwrap()).collect();
        assert_eq!(cameras, seen_by);
        assert!(mesh.field("videofields-skew").parse::<f64>().unwrap() < 1.0);
        assert_eq!(mesh.field("videofields-time"), time);
    }
    let status = |path: &str| house.get(&format!("{base}/{path}")).status;
    assert_eq!(status(&format!("entities/99999/hull.glb?t={time}")), 404);
    assert_eq!(status(&format!("entities/{id}/hull.obj?t={time}")), 404);
    assert_eq!(status(&format!("entities/{id}/hull.glb?t={time}&resolution=4000")), 400);
    assert_eq!(house.get("/api/v1/scenes/nowhere/entities").status, 404);
    if !has_adapter() {
        return;
    }
    let plan = house.get(&format!("{base}/plan?entities=hulls&t={time}&width=160&height=90")).body;
    let effect = |name: &str| -> Value {
        plan["effects"].as_array().unwrap().iter().find(|effect| effect["effect"] == name).cloned().unwrap()
    };
    assert!(effect("hull")["because"].as_str().unwrap().contains("entities"), "{plan}");
    for method in ["voxels", "trimming", "hybrid", "csg", "rays"] {
        let path = format!("{base}/view.png?entities=hulls&method={method}&t={time}&width=160&height=90");
        let view = house.get(&path);
        assert_eq!(view.status, 200, "{method}");
        assert!(view.field("videofields-settings").contains(&format!("method={method}")), "{method}");
    }
    let refused = house.get(&format!("{base}/view.png?method=rays&width=64&height=48"));
    assert_eq!(refused.status, 400, "means something to hulls alone: {}", refused.body);
}
