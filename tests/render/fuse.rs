//! The fuse room seen from outside: flat figures of known place and size, drawn into masks by projecting them, are
//! found again.

mod exposure;
mod truth;

use glam::{DMat3, DQuat, DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::{PointRun, SceneState, assemble};
use videofields_picture::scene::{Material, Scene, SceneCamera, Sky};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, Mask, YuvImage};
use videofields_vision::geometry::{
    Camera, Cylinder, Distortion, ExtrudedFootprint, GroundPolygon, HeightField, OrientedBox, Pose, Ray,
    Shape, Surfaces, TriangleMesh,
};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{Blob, PixelRect};

pub(crate) const SIZE: (u32, u32) = (640, 480);

/// A flat upright figure that faces a camera.
#[derive(Clone, Copy)]
pub(crate) struct Figure {
    pub(crate) foot: DVec3,
    pub(crate) width_m: f64,
    pub(crate) height_m: f64,
}

pub(crate) fn camera(eye: DVec3, target: DVec3, roll_deg: f64) -> Arc<Camera> {
    let mut pose = Pose::looking_at(eye, target).expect("a direction");
    pose.world_from_local *= DQuat::from_mat3(&DMat3::from_rotation_z(roll_deg.to_radians()));
    let center = DVec2::new(320.0, 240.0);
    Arc::new(Camera::new(SIZE, DVec2::splat(520.0), center, Distortion::None, pose).expect("a camera"))
}

pub(crate) fn scene(cameras: &[Arc<Camera>], boxes: Vec<OrientedBox>) -> Arc<Scene> {
    scene_of(cameras, boxes.into_iter().map(Shape::Box).collect())
}

/// A square of ground with these shapes on it.
fn scene_of(cameras: &[Arc<Camera>], mut shapes: Vec<Shape>) -> Arc<Scene> {
    let corners =
        [[-60.0, -60.0], [60.0, -60.0], [60.0, 60.0], [-60.0, 60.0]].map(DVec2::from_array).to_vec();
    let grey = Material::plain([128; 3]);
    let member = |(i, camera): (usize, &Arc<Camera>)| SceneCamera {
        id: CameraId::new(&format!("c{i}")).expect("an id"),
        camera: Arc::clone(camera),
    };
    Arc::new(Scene {
        id: "test".to_owned(),
        name: String::new(),
        materials: vec![grey; 1 + shapes.len()],
        surfaces: Surfaces::new({
            shapes.push(Shape::Ground(GroundPolygon::new(corners, 0.0).expect("a square")));
            shapes
        }),
        sky: Sky::Plain { color_srgb: [0; 3] },
        effects: Default::default(),
        sequences: vec![],
        min_entity_size_m: 0.0,
        cameras: cameras.iter().enumerate().map(member).collect(),
        view: None,
        document: "{}".into(),
    })
}

/// What `camera` sees of the figures: each texel's ray is cut with the figure's own plane.
pub(crate) fn observe(id: &CameraId, camera: &Camera, figures: &[Figure]) -> Observation {
    let (width, height) = SIZE;
    let mut labels = Mask::filled(width, height, 0);
    let mut blobs = Vec::new();
    for figure in figures {
        let away = (figure.foot - camera.pose().position_in_world).truncate().normalize().extend(0.0);
        let right = away.cross(DVec3::Z);
        let mut drawn: Vec<(u32, u32)> = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let texture = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)
                    / DVec2::new(f64::from(width), f64::from(height));
                let ray = camera.ray(texture).expect("a pinhole");
                let Some(distance) = ray.distance_to_plane(figure.foot, -away) else { continue };
                let offset = ray.at(distance) - figure.foot;
                let is_inside = offset.dot(right).abs() <= figure.width_m / 2.0
                    && (0.0..=figure.height_m).contains(&offset.z);
                if is_inside {
                    labels.data[(y * width + x) as usize] = 255;
                    drawn.push((x, y));
                }
            }
        }
        blobs.extend(blob(&drawn));
    }
    let image =
        Arc::new(YuvImage::filled(width, height, [16, 128, 128], ColorMatrix::Bt601, ColorRange::Limited));
    let labels = Arc::new(labels);
    Observation {
        frame: Frame {
            camera: id.clone(),
            timestamp: Timestamp::from_nanos(0),
            number: 0,
            image: Arc::clone(&image),
        },
        soft_mask: Arc::clone(&labels),
        labels,
        background: image,
        blobs: blobs.into(),
        tracks: Arc::from([]),
    }
}

pub(crate) fn blob(drawn: &[(u32, u32)]) -> Option<Blob> {
    let (x0, x1) = (drawn.iter().map(|p| p.0).min()?, drawn.iter().map(|p| p.0).max()?);
    let (y0, y1) = (drawn.iter().map(|p| p.1).min()?, drawn.iter().map(|p| p.1).max()?);
    let lowest: Vec<u32> = drawn.iter().filter(|p| p.1 == y1).map(|p| p.0).collect();
    let middle = f64::from(lowest.iter().min()? + lowest.iter().max()? + 1) / 2.0;
    Some(Blob {
        rect: PixelRect { x: x0, y: y0, width: x1 + 1 - x0, height: y1 + 1 - y0 },
        area_px: drawn.len() as u32,
        foot_in_image: [middle, f64::from(y1 + 1)],
        is_truncated: y1 + 1 == SIZE.1 || x0 == 0 || x1 + 1 == SIZE.0,
        contour: Arc::default(),
    })
}

pub(crate) fn fused(cameras: &[Arc<Camera>], figures: &[Figure], point_stride: Option<u32>) -> SceneState {
    let scene = scene(cameras, Vec::new());
    let observe = |id: &CameraId| {
        let member = scene.cameras.iter().find(|member| member.id == *id)?;
        Some(observe(id, &member.camera, figures))
    };
    assemble(&scene, Timestamp::from_nanos(7), observe, point_stride)
}

#[test]
fn what_is_smaller_in_metres_than_the_scene_asks_for_is_no_entity() {
    // A bird close by, a person far away, a low trailer.
    let bird = Figure { foot: DVec3::new(-0.6, 5.0, 0.0), width_m: 0.3, height_m: 0.35 };
    let person = Figure { foot: DVec3::new(1.0, 14.0, 0.0), width_m: 0.5, height_m: 1.75 };
    let trailer = Figure { foot: DVec3::new(-4.0, 20.0, 0.0), width_m: 3.0, height_m: 0.6 };
    let camera = camera(DVec3::new(0.0, 0.0, 4.0), DVec3::new(0.0, 9.0, 0.0), 0.0);
    let n_entities = |min_entity_size_m: f64| {
        let plain = scene(std::slice::from_ref(&camera), Vec::new());
        let scene = Arc::new(Scene { min_entity_size_m, ..Scene::clone(&plain) });
        let observe = |id: &CameraId| Some(observe(id, &camera, &[bird, person, trailer]));
        assemble(&scene, Timestamp::from_nanos(7), observe, None).entities.len()
    };
    assert_eq!([0.0, 0.5, 2.0, 4.0].map(n_entities), [3, 2, 1, 0]);
}

#[test]
fn billboards_stand_where_the_figures_stand_whatever_pitch_and_roll() {
    let person = Figure { foot: DVec3::new(1.0, 14.0, 0.0), width_m: 0.5, height_m: 1.75 };
    for (height_m, roll_deg) in [(1.6, 0.0), (5.0, 0.0), (8.0, 0.0), (5.0, 10.0), (5.0, -25.0)] {
        let camera = camera(DVec3::new(0.0, 0.0, height_m), DVec3::new(0.5, 13.0, 1.0), roll_deg);
        let state = fused(&[camera], &[person], None);
        let [entity] = state.entities.as_slice() else { panic!("one entity, not {:?}", state.entities) };
        let [billboard] = entity.sources.as_slice() else { panic!("one source") };
        // A pixel at 14 m is 27 mm across; a foot's pixel covers 27 mm times distance over height along the
        // ground. A rolled camera's lowest texel is the figure's corner, half its width times tan(roll) lower.
        let footprint = 0.027 * 14.0 / height_m;
        let roll = 0.25 * f64::to_radians(roll_deg).tan().abs() * 14.0 / height_m;
        let gap = (billboard.foot_in_world - person.foot).length();
        assert!(gap <= 1.5 * footprint + roll, "{height_m} {roll_deg}: foot off by {gap}");
        let [left, right] = billboard.left_right_m;
        assert!((right - left - 0.5).abs() < 0.08, "{height_m} {roll_deg}: width {}", right - left);
        assert!(
            (billboard.height_m - 1.75).abs() < 0.12,
            "{height_m} {roll_deg}: height {}",
            billboard.height_m
        );
    }
}

#[test]
fn people_under_a_ceiling_camera_stand_on_their_feet_wherever_they_lie_in_the_picture() {
    let ceiling = [camera(DVec3::new(0.0, -0.01, 6.0), DVec3::ZERO, 0.0)];
    for foot in [DVec3::X * 2.0, DVec3::X * -2.0, DVec3::Y * 1.8, DVec3::Y * -1.8] {
        let state = fused(&ceiling, &[Figure { foot, width_m: 0.5, height_m: 1.6 }], None);
        let [entity] = state.entities.as_slice() else { panic!("{foot}: {:?}", state.entities) };
        assert!((entity.foot_in_world - foot).length() < 0.15, "{foot}: {}", entity.foot_in_world);
        assert!((entity.height_m - 1.6).abs() < 0.1, "{foot}: {} m", entity.height_m);
        let [left, right] = entity.sources[0].left_right_m;
        assert!((right - left - 0.5).abs() < 0.1, "{foot}: {} m", right - left);
    }
}

#[test]
fn heights_hold_above_the_horizon() {
    // From 1 m up, a head at 1.75 m is above the horizon at any distance.
    let person = Figure { foot: DVec3::new(0.0, 8.0, 0.0), width_m: 0.5, height_m: 1.75 };
    let camera = camera(DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.0, 8.0, 1.0), 0.0);
    let state = fused(&[camera], &[person], Some(1));
    let billboard = &state.entities[0].sources[0];
    assert!((billboard.height_m - 1.75).abs() < 0.05, "{}", billboard.height_m);
    let highest = state.points.iter().map(|run| run.ends_in_world[0].z).fold(0.0, f64::max);
    assert!((highest - 1.75).abs() < 0.05, "{highest}");
}

#[test]
fn points_of_one_entity_stand_in_one_place_though_its_cameras_differ() {
    let cameras = [
        camera(DVec3::new(-9.0, -10.0, 5.0), DVec3::ZERO, 0.0),
        camera(DVec3::new(9.0, -10.0, 5.0), DVec3::ZERO, 0.0),
    ];
    // The second camera is off by 0.4 m.
    let seen_by = [0.0, 0.4].map(|x| Figure { foot: DVec3::new(x, 0.0, 0.0), width_m: 0.5, height_m: 1.7 });
    let scene = scene(&cameras, Vec::new());
    let find = |id: &CameraId| {
        let idx = scene.cameras.iter().position(|member| member.id == *id)?;
        Some(observe(id, &cameras[idx], &seen_by[idx..=idx]))
    };
    let state = assemble(&scene, Timestamp::from_nanos(7), find, Some(1));
    assert_eq!((state.entities.len(), state.entities[0].sources.len()), (1, 2), "{:?}", state.entities);
    let middle = |camera_idx: usize| {
        let ends = || {
            let runs = state.points.iter().filter(|run| run.camera_idx == camera_idx);
            runs.flat_map(|run| run.ends_in_world)
        };
        ends().map(DVec3::truncate).sum::<DVec2>() / ends().count() as f64
    };
    let foot = state.entities[0].foot_in_world.truncate();
    for camera_idx in [0, 1] {
        let off_m = middle(camera_idx).distance(foot);
        assert!(off_m < 0.06, "camera {camera_idx}: {off_m} m");
    }
    assert!((foot.x - 0.2).abs() < 0.1, "{foot}");
}

#[test]
fn one_figure_in_three_cameras_is_one_entity_and_two_figures_are_two() {
    let cameras = [
        camera(DVec3::new(-12.0, -10.0, 5.0), DVec3::ZERO, 0.0),
        camera(DVec3::new(12.0, -10.0, 6.0), DVec3::ZERO, 0.0),
        camera(DVec3::new(0.0, 14.0, 5.0), DVec3::ZERO, 0.0),
    ];
    let figures = [
        Figure { foot: DVec3::new(-1.5, 0.0, 0.0), width_m: 0.5, height_m: 1.7 },
        Figure { foot: DVec3::new(1.5, 1.0, 0.0), width_m: 0.5, height_m: 1.7 },
    ];
    let state = fused(&cameras, &figures, None);
    assert_eq!(state.entities.len(), 2, "{:?}", state.entities);
    for entity in &state.entities {
        assert_eq!(entity.sources.len(), 3);
        let gap =
            figures.iter().map(|f| (f.foot - entity.foot_in_world).length()).fold(f64::INFINITY, f64::min);
        assert!(gap < 0.2, "{gap}");
    }
}

#[test]
fn points_lie_on_the_figure_and_their_squares_leave_no_gaps() {
    let person = Figure { foot: DVec3::new(0.0, 10.0, 0.0), width_m: 0.5, height_m: 1.75 };
    let camera = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::new(0.0, 10.0, 1.0), 0.0);
    for stride in [1, 3] {
        let state = fused(&[Arc::clone(&camera)], &[person], Some(stride));
        let billboard = &state.entities[0].sources[0];
        let mask = &state.cameras[0].observation.labels;
        let rows = (billboard.rect.y..).take(billboard.rect.height as usize).step_by(stride as usize);
        let n_moving = rows.clone().flat_map(|y| mask.row(y)).filter(|label| **label == 255).count();
        assert!(n_moving > 1000 / stride as usize, "{n_moving}");
        let texel = |run: &PointRun, end: usize| {
            let [u, v] = run.textures[end].map(f64::from);
            DVec2::new(u * f64::from(mask.width), v * f64::from(mask.height)) - 0.5
        };
        let mut n_texels = 0;
        for run in &state.points {
            let [first, last] = [0, 1].map(|end| texel(run, end));
            assert!((first.y - last.y).abs() < 1e-3 && last.x >= first.x && run.n_rows == stride, "{run:?}");
            n_texels += (last.x - first.x).round() as usize + 1;
            for idx in 0..=(last.x - first.x).round() as u32 {
                let at = first + DVec2::new(f64::from(idx), 0.0);
                assert!(mask.get(at.x.round() as u32, at.y.round() as u32) == 255, "{at} does not move");
                // Between the ends a point lies where its texel's own ray does, to a hundredth of a texel.
                let share = f64::from(idx) / (last.x - first.x).max(1.0);
                let place = run.ends_in_world[0].lerp(run.ends_in_world[1], share);
                let texture = (at + 0.5) / DVec2::new(f64::from(mask.width), f64::from(mask.height));
                let ray: Ray = camera.ray(texture).expect("a pinhole");
                let off_m = (ray.at((place - ray.origin).dot(ray.direction)) - place).length();
                assert!(off_m < 2e-4, "{off_m} m");
                let offset = place - person.foot;
                let is_on =
                    offset.x.abs() < 0.3 && offset.y.abs() < 0.15 && (-0.05..1.85).contains(&offset.z);
                assert!(is_on, "{offset}");
            }
            // A pixel there is about 11 m / 520 px across.
            let texel_m = 11.0 / 520.0;
            for size_m in run.sizes_m.map(f64::from) {
                assert!(size_m > texel_m && size_m < 2.0 * texel_m, "{size_m}");
            }
        }
        assert_eq!(n_texels, n_moving, "each once");
    }
}

#[test]
fn feet_that_meet_nothing_or_a_wall_stay_finite() {
    let camera = camera(DVec3::new(0.0, 0.0, 1.7), DVec3::new(0.0, 10.0, 1.7), 0.0);
    let above_horizon = Blob {
        rect: PixelRect { x: 300, y: 20, width: 20, height: 100 },
        area_px: 2000,
        foot_in_image: [310.0, 120.0],
        is_truncated: false,
        contour: Arc::default(),
    };
    let wall = OrientedBox::new(DVec3::new(0.0, 10.0, 3.0), DVec3::new(8.0, 1.0, 6.0), 0.0).expect("a box");
    let check = |shapes: Vec<Shape>, expected: usize| {
        let scene = scene_of(&[Arc::clone(&camera)], shapes);
        let observe = |id: &CameraId| {
            let mut observation = observe(id, &camera, &[]);
            let mut labels = (*observation.labels).clone();
            for y in 20..120 {
                labels.data[(y * SIZE.0 + 300) as usize..(y * SIZE.0 + 320) as usize].fill(255);
            }
            observation.labels = Arc::new(labels);
            observation.blobs = vec![above_horizon.clone()].into();
            Some(observation)
        };
        let state = assemble(&scene, Timestamp::from_nanos(0), observe, Some(1));
        assert_eq!(state.entities.len(), expected);
        assert!(state.points.iter().all(|run| run.ends_in_world.iter().all(|end| end.is_finite())
            && run.sizes_m.iter().all(|size_m| size_m.is_finite())));
        for entity in &state.entities {
            assert!(entity.foot_in_world.is_finite());
        }
        state
    };
    check(Vec::new(), 0);
    let outline = [[-4.0, 9.5], [4.0, 9.5], [4.0, 10.5], [-4.0, 10.5]].map(DVec2::from_array).to_vec();
    let corners =
        [[-4.0, 9.5, 0.0], [4.0, 9.5, 0.0], [4.0, 9.5, 6.0], [-4.0, 9.5, 6.0]].map(DVec3::from_array);
    let walls = [
        Shape::Box(wall),
        Shape::Footprint(ExtrudedFootprint::new(outline, 0.0, 6.0).expect("a house")),
        Shape::Model(TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]).expect("a screen")),
        // Its round is nearest where the camera looks at it.
        Shape::Cylinder(Cylinder::new(DVec3::new(0.0, 1e3 + 9.5, 0.0), 1e3, 6.0).expect("a tank")),
    ];
    for wall in walls {
        // Half a metre beside where it is nearest, the tank's round lies x^2 / 2 r further: 1.25e-4 m.
        let round_m = if matches!(wall, Shape::Cylinder(_)) { 1.5e-4 } else { 0.0 };
        let state = check(vec![wall], 1);
        let foot = state.entities[0].foot_in_world;
        assert!(
            foot.z.abs() < 1e-9 && (foot.y - 9.45).abs() < 1e-4 + round_m,
            "at the wall's own foot: {foot}"
        );
    }
    // A slope that one can stand on: the foot is where the ray meets it, 1.7 m high or more.
    let hill =
        HeightField::new(DVec2::new(-50.0, 5.0), 100.0, 2, vec![0.0, 0.0, 40.0, 40.0]).expect("a slope");
    let state = check(vec![Shape::HeightField(hill)], 1);
    let foot = state.entities[0].foot_in_world;
    assert!(foot.z > 1.7 && (foot.z - 0.4 * (foot.y - 5.0)).abs() < 0.05, "on the slope: {foot}");
}

#[test]
fn a_foot_is_known_worse_along_a_grazing_ray_than_across_it() {
    let person = Figure { foot: DVec3::new(0.0, 25.0, 0.0), width_m: 0.5, height_m: 1.75 };
    let grazing = camera(DVec3::new(0.0, 0.0, 1.6), DVec3::new(0.0, 25.0, 1.0), 0.0);
    let covariance = fused(&[grazing], &[person], None).entities[0].foot_covariance_m2;
    let (across, along) = (covariance.x_axis.x.sqrt(), covariance.y_axis.y.sqrt());
    // 1.9 pixels of 1/520 each, over 25 m at 1.6 m: 1.4 m.
    assert!((1.0..1.9).contains(&along) && (0.14..0.25).contains(&across), "{along} along, {across} across");
    let above = camera(DVec3::new(0.0, 22.0, 12.0), DVec3::new(0.0, 25.0, 0.0), 0.0);
    let covariance = fused(&[above], &[person], None).entities[0].foot_covariance_m2;
    assert!(covariance.y_axis.y.sqrt() < 0.3, "{covariance}");
}

#[test]
fn somebody_nearly_below_a_camera_has_a_place_with_a_finite_covariance() {
    let below = camera(DVec3::new(0.0, 0.0, 6.0), DVec3::new(0.0, 0.4, 0.0), 0.0);
    for distance in [0.06, 0.3, 1.0] {
        let person = Figure { foot: DVec3::new(0.0, distance, 0.0), width_m: 0.5, height_m: 1.75 };
        for entity in fused(std::slice::from_ref(&below), &[person], Some(2)).entities {
            assert!(entity.foot_covariance_m2.is_finite() && entity.height_m.is_finite(), "{distance}");
            assert!(
                (entity.foot_in_world - person.foot).length() < 1.0,
                "{distance}: {}",
                entity.foot_in_world
            );
        }
    }
}

#[test]
fn somebody_over_a_low_wall_stands_where_the_head_tells() {
    // One camera sees all of the person, the other one only what is above a wall half a metre before them.
    let person = Figure { foot: DVec3::new(0.0, 0.0, 0.0), width_m: 0.5, height_m: 1.75 };
    let cameras = [
        camera(DVec3::new(-12.0, 0.0, 5.0), DVec3::ZERO, 0.0),
        camera(DVec3::new(0.0, -14.0, 4.0), DVec3::ZERO, 0.0),
    ];
    let scene = scene(&cameras, Vec::new());
    let observe = |id: &CameraId| {
        let member = scene.cameras.iter().find(|member| member.id == *id)?;
        let mut observation = observe(id, &member.camera, &[person]);
        if id.as_str() == "c1" {
            let mut labels = (*observation.labels).clone();
            let rect = observation.blobs[0].rect;
            let hidden = rect.y + rect.height * 11 / 20;
            labels.data[(hidden * SIZE.0) as usize..].fill(0);
            let set = |place: u32| labels.data[place as usize] > 0;
            let drawn: Vec<(u32, u32)> = (0..SIZE.0 * SIZE.1)
                .filter(|place| set(*place))
                .map(|place| (place % SIZE.0, place / SIZE.0))
                .collect();
            observation.blobs = blob(&drawn).into_iter().collect();
            observation.labels = Arc::new(labels);
        }
        Some(observation)
    };
    let state = assemble(&scene, Timestamp::from_nanos(0), observe, None);
    let [entity] = state.entities.as_slice() else { panic!("one entity, not {:?}", state.entities) };
    assert!((entity.foot_in_world - person.foot).length() < 0.3, "{}", entity.foot_in_world);
    assert!((entity.height_m - 1.75).abs() < 0.15, "{}", entity.height_m);
    let [_, hidden] = entity.sources.as_slice() else { panic!("two sources") };
    assert!((hidden.foot_in_world - person.foot).length() < 0.4, "{}", hidden.foot_in_world);
    assert!((hidden.height_m - 1.75).abs() < 0.2, "{}", hidden.height_m);
}
