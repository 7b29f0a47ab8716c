//! Patches held to rays, to their areas and to one another.

use super::*;
use glam::DVec2;
use std::collections::BTreeMap;
use videofields_picture::scene::{Material, Scene};
use videofields_vision::geometry::{
    Distortion, ExtrudedFootprint, GroundPolygon, OrientedBox, Pose, Surfaces,
};

const SIDE_PX: u32 = 1024;

fn scene(shapes: Vec<Shape>) -> Arc<Scene> {
    let materials = shapes.iter().map(|_| Material::plain([128; 3])).collect();
    Arc::new(Scene {
        id: "patches".to_owned(),
        name: "Patches".to_owned(),
        materials,
        surfaces: Surfaces::new(shapes),
        sky: videofields_picture::scene::Sky::Plain { color_srgb: [0; 3] },
        effects: Default::default(),
        sequences: Vec::new(),
        min_entity_size_m: 0.0,
        cameras: Vec::new(),
        view: None,
        document: Arc::from("{}"),
    })
}

fn camera(eye: DVec3, target: DVec3, focal_px: f64) -> Arc<Camera> {
    let pose = Pose::looking_at(eye, target).expect("a direction");
    let center = DVec2::new(160.0, 90.0);
    Arc::new(
        Camera::new((320, 180), DVec2::splat(focal_px), center, Distortion::None, pose).expect("a camera"),
    )
}

fn yard(offset: DVec3) -> Vec<Shape> {
    let corners = |corners: &[(f64, f64)]| -> Vec<DVec2> {
        corners.iter().map(|(x, y)| DVec2::new(*x, *y) + offset.truncate()).collect()
    };
    // A concave yard with a concave hall, a hut and a low wall.
    let ground = [(-30.0, -30.0), (30.0, -30.0), (30.0, 30.0), (5.0, 30.0), (2.0, 12.0), (-30.0, 30.0)];
    let hall = [(2.0, 2.0), (9.0, 2.5), (9.0, 5.0), (5.0, 5.0), (5.0, 9.0), (2.0, 9.0)];
    let solid = |x: f64, y: f64, size: DVec3, yaw_rad: f64| {
        let center = DVec3::new(x, y, 0.5 * size.z) + offset;
        Shape::Box(OrientedBox::new(center, size, yaw_rad).expect("a box"))
    };
    vec![
        Shape::Ground(GroundPolygon::new(corners(&ground), offset.z).expect("ground")),
        solid(-6.0, -4.0, DVec3::new(3.0, 2.0, 2.5), 0.4),
        solid(-2.0, 8.0, DVec3::new(9.0, 0.3, 1.2), 1.1),
        Shape::Footprint(ExtrudedFootprint::new(corners(&hall), offset.z, offset.z + 6.0).expect("a hall")),
    ]
}

fn watchers(offset: DVec3) -> Vec<Arc<Camera>> {
    let at = |eye: [f64; 3], target: [f64; 3], focal_px| {
        camera(DVec3::from(eye) + offset, DVec3::from(target) + offset, focal_px)
    };
    vec![
        at([-18.0, -16.0, 6.0], [0.0, 0.0, 0.0], 260.0),
        at([20.0, -12.0, 9.0], [0.0, 3.0, 1.0], 300.0),
        at([0.0, 25.0, 4.0], [1.0, 0.0, 0.0], 180.0),
        // Mounted on the hut, over its own roof.
        at([-6.0, -4.0, 3.5], [-12.0, 2.0, 0.0], 200.0),
        // On the ground's level but for a hand's breadth.
        at([12.0, -20.0, 0.1], [0.0, 0.0, 0.5], 260.0),
    ]
}

fn patches(offset: DVec3) -> (Mesh, Patches) {
    let mesh = Mesh::new(&scene(yard(offset)), 1);
    let patches = Patches::new(&mesh, watchers(offset), SIDE_PX, 1);
    (mesh, patches)
}

const FAR: DVec3 = DVec3::new(5e5, 5e6, 300.0);

#[test]
fn solids_stay_closed_to_the_last_bit_however_they_are_cut() {
    for offset in [DVec3::ZERO, FAR] {
        let (mesh, patches) = patches(offset);
        let mut n_solids = 0;
        for (surface, _) in mesh.scene.surfaces.named().filter(|(_, shape)| shape.hides()) {
            let mut open: BTreeMap<[[u64; 3]; 2], i32> = BTreeMap::new();
            let of_surface = patches.patches.iter().filter(|patch| patch.surface == surface);
            for corner in of_surface.flat_map(|patch| patch.vertices.clone()) {
                let first = corner - corner % 3;
                let at = |corner: u32| {
                    let position = patches.vertices[corner as usize].position_in_world;
                    position.to_array().map(|coordinate| (coordinate + 0.0).to_bits())
                };
                let (a, b) = (at(corner), at(first + (corner + 1) % 3));
                *open.entry(if a < b { [a, b] } else { [b, a] }).or_default() += if a < b { 1 } else { -1 };
            }
            let n_open = open.values().filter(|count| **count != 0).count();
            assert!(open.len() > 30, "{surface:?} was hardly cut: {} edges", open.len());
            assert_eq!(n_open, 0, "edges of {surface:?} at {offset} without a neighbour");
            n_solids += 1;
        }
        assert_eq!(n_solids, 3);
    }
}

#[test]
fn patches_cover_what_they_are_cut_from() {
    for offset in [DVec3::ZERO, FAR] {
        let (mesh, patches) = patches(offset);
        let area = |vertices: &[MeshVertex]| -> f64 {
            let area = |t: &[MeshVertex]| {
                let [a, b, c] = [0, 1, 2].map(|corner| t[corner].position_in_world);
                0.5 * (b - a).cross(c - a).dot(t[0].normal.as_dvec3())
            };
            let areas: Vec<f64> = vertices.chunks_exact(3).map(area).collect();
            assert!(areas.iter().all(|area| *area > 0.0), "a triangle is turned or empty");
            areas.iter().sum()
        };
        let (whole, parts) = (area(&mesh.vertices), area(&patches.vertices));
        assert!((whole - parts).abs() < 1e-6 * whole, "{parts} of {whole} m^2");
        assert!((40..=MOST_PATCHES).contains(&patches.patches.len()), "{} patches", patches.patches.len());
    }
}

/// Numbers in [0, 1) without a seed from outside.
fn numbers() -> impl FnMut() -> f64 {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// A point of a patch.
fn point_of(patches: &Patches, patch: &Patch, number: &mut impl FnMut() -> f64) -> DVec3 {
    let n_triangles = (patch.vertices.len() / 3) as f64;
    let first = patch.vertices.start as usize + 3 * (number() * n_triangles) as usize;
    let (u, v) = (number(), number());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    let [a, b, c] = [0, 1, 2].map(|corner| patches.vertices[first + corner].position_in_world);
    a + (b - a) * u + (c - a) * v
}

/// Whether a camera sees a point of a surface of this normal; `None` where that hangs on rounding, or it does not look there.
fn is_open(camera: &Camera, surfaces: &Surfaces, point: DVec3, normal: DVec3) -> Option<bool> {
    let position = camera.pose().position_in_world;
    let height = (position - point).dot(normal);
    let is_squarely = height.abs() > 0.009 * position.distance(point);
    let is_in_picture = camera.project(point).is_some_and(|at| at.is_inside());
    // Off the surface on the camera's side, so that the point's own face does not count.
    let before = point + normal * height.signum() * 1e-4;
    (is_in_picture && is_squarely).then(|| !surfaces.is_hidden(position, before))
}

#[test]
fn what_is_said_of_a_patch_holds_for_every_point_of_it() {
    let mut number = numbers();
    for offset in [DVec3::ZERO, FAR] {
        let (mesh, patches) = patches(offset);
        let surfaces = &mesh.scene.surfaces;
        let (mut n_seen, mut n_unseen, mut n_hidden) = (0, 0, 0);
        let pairs =
            patches.patches.iter().flat_map(|patch| (0..patches.cameras.len()).map(move |c| (patch, c)));
        for (patch, camera_idx) in pairs.flat_map(|pair| [pair; 6]) {
            let camera = &patches.cameras[camera_idx];
            let point = point_of(&patches, patch, &mut number);
            let Some(is_open) = is_open(camera, surfaces, point, patch.normal) else { continue };
            let sight = patch.sights.iter().find(|sight| usize::from(sight.camera) == camera_idx);
            let said = format!("{point} of {:?} by camera {camera_idx}: {sight:?}", patch.surface);
            let Some(Sight { seen, .. }) = sight else {
                n_unseen += 1;
                assert!(!is_open, "{said} is seen");
                continue;
            };
            n_seen += 1;
            n_hidden += usize::from(!is_open);
            let is_behind = (camera.pose().position_in_world - point).dot(patch.normal) < 0.0;
            assert!(seen.sides[usize::from(is_behind)], "{said} is seen from there");
            assert!(is_open || seen.is_tested, "{said} is hidden");
        }
        assert!(n_seen > 1000 && n_unseen > 50 && n_hidden > 20, "{n_seen} {n_unseen} {n_hidden}");
    }
}

#[test]
fn most_of_a_yard_needs_no_look_into_a_depth_map() {
    let (mesh, patches) = patches(DVec3::ZERO);
    assert!(patches.serve(&mesh, &watchers(DVec3::ZERO)[1..3]));
    assert!(!patches.serve(&mesh, &[camera(DVec3::ONE, DVec3::ZERO, 100.0)]));
    let (mut tested_sr, mut all_sr) = (0.0, 0.0);
    for patch in &patches.patches {
        for Sight { camera, seen } in &patch.sights {
            let distance =
                patches.cameras[usize::from(*camera)].pose().position_in_world.distance(patch.center);
            let angle = patch.radius_m / distance.max(patch.radius_m);
            all_sr += angle * angle;
            tested_sr += if seen.is_tested { angle * angle } else { 0.0 };
        }
    }
    assert!(tested_sr < 0.3 * all_sr, "{tested_sr:.3} of {all_sr:.3} sr");
}

#[test]
fn cameras_calibrated_alike_are_known_once_and_listed_each() {
    let one = camera(DVec3::new(0.0, -9.0, 5.0), DVec3::ZERO, 200.0);
    let twin = Arc::new(Camera::clone(&one));
    let mesh = Mesh::new(&scene(yard(DVec3::ZERO)), 1);
    let patches = Patches::new(&mesh, vec![Arc::clone(&one), Arc::clone(&twin)], SIDE_PX, 1);
    assert_eq!(patches.cameras.len(), 1);
    let stand = crate::prepare::Stand {
        eye_in_world: DVec3::new(0.0, -12.0, 6.0),
        anchor_in_world: DVec3::ZERO,
        parallel_to: None,
    };
    let data: [crate::camera_data::Camera; 2] = bytemuck::Zeroable::zeroed();
    let drawing = Drawing {
        stand: &stand,
        cameras: &[one, twin],
        data: &data,
        opened: &[],
        filtering: videofields_picture::plan::Filtering::Levels,
        most_cameras: MOST_LISTED,
    };
    let mut batches = Batches::default();
    patches.batch(&drawing, &mut batches);
    assert!(batches.opaque.iter().any(|batch| batch.shading.n_cameras == 2));
    let n_drawn: usize = batches.opaque.iter().map(|batch| batch.indices.len()).sum();
    assert_eq!(n_drawn, patches.vertices.len(), "every patch is drawn once");
    // With one camera a pixel each batch has at most one.
    patches.batch(&Drawing { most_cameras: 1, ..drawing }, &mut batches);
    assert!(batches.opaque.iter().all(|batch| batch.shading.n_cameras <= 1));
}

/// What is cut finely along the border of a picture stays as fine across it, and is long along it.
#[test]
fn strips_along_a_pictures_border_are_few_patches() {
    let corners = [(-60.0, -60.0), (60.0, -60.0), (60.0, 60.0), (-60.0, 60.0)].map(DVec2::from).to_vec();
    let mesh = Mesh::new(&scene(vec![Shape::Ground(GroundPolygon::new(corners, 0.0).expect("ground"))]), 1);
    // Level pictures from above: their borders run along the grid, none of them on a line of it.
    let down = |x: f64, y: f64| {
        let looking = glam::DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z);
        let pose = Pose {
            position_in_world: DVec3::new(x, y, 10.0),
            world_from_local: glam::DQuat::from_mat3(&looking),
        };
        let center = DVec2::new(160.0, 90.0);
        Arc::new(
            Camera::new((320, 180), DVec2::splat(200.0), center, Distortion::None, pose).expect("a camera"),
        )
    };
    let cameras: Vec<_> =
        (0..12).map(|idx| down(f64::from(idx % 4) * 17.3 - 26.0, f64::from(idx / 4) * 9.7 - 10.0)).collect();
    let patches = Patches::new(&mesh, cameras, SIDE_PX, 1);
    // Each picture has four borders of less than ten patches each, with corners and what lies within and between.
    assert!((50..12 * 60).contains(&patches.patches.len()), "{} patches", patches.patches.len());
    // What is listed is hardly more than what is seen: 12 pictures of 16 m x 9 m.
    let area_m2 = |patch: &Patch| {
        let at = |idx: u32| patches.vertices[idx as usize].position_in_world;
        let areas = patch.vertices.clone().step_by(3).map(|first| {
            let [a, b, c] = [0, 1, 2].map(|corner| at(first + corner));
            0.5 * (b - a).cross(c - a).length()
        });
        areas.sum::<f64>()
    };
    let listed_m2: f64 = patches.patches.iter().map(|patch| area_m2(patch) * patch.sights.len() as f64).sum();
    let seen_m2 = 12.0 * 16.0 * 9.0;
    assert!((1.0..1.1).contains(&(listed_m2 / seen_m2)), "{listed_m2} m^2 listed of {seen_m2} seen");
}

#[test]
fn scenes_without_surfaces_or_cameras_have_what_there_is() {
    let nothing = Mesh::new(&scene(Vec::new()), 1);
    let patches = Patches::new(&nothing, watchers(DVec3::ZERO), SIDE_PX, 1);
    assert!(patches.patches.is_empty() && patches.vertices.is_empty());
    let mesh = Mesh::new(&scene(yard(DVec3::ZERO)), 1);
    let patches = Patches::new(&mesh, Vec::new(), SIDE_PX, 1);
    assert!(patches.patches.iter().all(|patch| patch.sights.is_empty()));
    // One a face: nothing calls for a cut.
    assert_eq!(patches.patches.len(), 1 + 6 + 6 + 8);
}
