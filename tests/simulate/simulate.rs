//! The simulate room seen from outside: truth that agrees with itself, clips that agree with the truth.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use glam::{DVec2, DVec3};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use videofields_simulate::{
    ExtraView, Parts, SimulateError, SimulateOptions, Truth, World, Written, run, write,
};
use videofields_testing::video::decode_timed;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::{Camera, OrientedBox, Ray};
use videofields_vision::measures::compare;

const SIZE: (u32, u32) = (320, 180);

fn view_from_the_south() -> Camera {
    Camera::pinhole(DVec3::new(0.0, -14.0, 4.0), DVec3::new(0.0, 2.0, 1.0), 0.8, SIZE).unwrap()
}

/// The world's cameras and a view where none stands.
fn cameras(world: &World) -> Vec<(&str, Camera)> {
    let mut cameras = world.cameras(SIZE).unwrap();
    cameras.push(("view", view_from_the_south()));
    cameras
}

fn center_ray(camera: &Camera, x: u32, y: u32) -> Ray {
    let (width, height) = camera.size_px();
    let pixel = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
    camera.ray(pixel / DVec2::new(f64::from(width), f64::from(height))).unwrap()
}

/// The pixel that shows a world point, if it lies in the picture.
fn pixel_of(camera: &Camera, point: DVec3) -> Option<(u32, u32)> {
    let projection = camera.project(point).filter(videofields_vision::geometry::Projection::is_inside)?;
    let (width, height) = camera.size_px();
    let at = |share: f64, count: u32| ((share * f64::from(count)) as u32).min(count - 1);
    Some((at(projection.texture.x, width), at(projection.texture.y, height)))
}

/// Low and high corner of an instance's pixels and how many there are.
fn rect_of(truth: &Truth, instance: u8) -> Option<([u32; 2], [u32; 2], usize)> {
    let (mut low, mut high, mut count) = ([u32::MAX; 2], [0; 2], 0);
    for y in 0..truth.instance.height {
        for (x, _) in (0..).zip(truth.instance.row(y)).filter(|(_, value)| **value == instance) {
            (low, high) = ([low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]);
            count += 1;
        }
    }
    (count > 0).then_some((low, high, count))
}

fn box_corners(low: DVec3, high: DVec3) -> impl Iterator<Item = DVec3> {
    (0..8).map(move |i| {
        let pick = |bit: u32, axis: usize| if i >> bit & 1 == 0 { low[axis] } else { high[axis] };
        DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    })
}

#[test]
fn the_same_world_and_time_give_the_same_truth() {
    for (id, camera) in cameras(&World::plaza()) {
        let first = World::plaza().render(&camera, 7.3, 2).unwrap();
        let again = World::plaza().render(&camera, 7.3, 2).unwrap();
        assert!(first == again, "{id}");
        let later = World::plaza().render(&camera, 7.4, 2).unwrap();
        assert!(first.instance != later.instance && first.rgb != later.rgb, "{id}: nothing moves");
    }
}

#[test]
fn only_pixels_of_figures_differ_from_the_still_world() {
    let world = World::plaza();
    for (id, camera) in cameras(&world) {
        let plate = world.plate(&camera, 1).unwrap();
        assert!(plate.truth().instance.data.iter().all(|value| *value == 0));
        // With one sample a pixel, its centre, the two truths tell of each other.
        for time in [0.0, 5.1, 16.7] {
            let truth = world.render_over(&plate, time).unwrap();
            let still = plate.truth();
            for (i, instance) in truth.instance.data.iter().enumerate() {
                if *instance == 0 {
                    assert_eq!(truth.depth_m[i], still.depth_m[i], "{id} at {time}");
                    assert_eq!(truth.rgb.data[i * 3..i * 3 + 3], still.rgb.data[i * 3..i * 3 + 3]);
                } else {
                    assert!(truth.depth_m[i] < still.depth_m[i] || still.depth_m[i] == 0.0, "{id} at {time}");
                }
            }
        }
    }
}

#[test]
fn the_loop_closes() {
    let world = World::plaza();
    let period = world.period_secs();
    for (id, camera) in cameras(&world) {
        let start = world.render(&camera, 0.0, 1).unwrap();
        assert!(start == world.render(&camera, period, 1).unwrap(), "{id}");
        assert!(start == world.render(&camera, -2.0 * period, 1).unwrap(), "{id}");
    }
    for (before, after) in world.figures(-0.01).unwrap().iter().zip(world.figures(0.0).unwrap()) {
        let walked = (after.foot_in_world - before.foot_in_world).length();
        assert!((0.005..0.03).contains(&walked), "{} jumps {walked} m over the seam", after.name);
    }
}

/// How far a point is from the surface of a box, metres.
fn distance_to_box(solid: &OrientedBox, point: DVec3) -> f64 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z]
        .map(|axis| (solid.world_from_box_point(axis) - solid.center()).normalize());
    let local = DVec3::from_array(axes.map(|axis| axis.dot(point - solid.center())));
    let beyond = local.abs() - solid.half_size();
    if beyond.max_element() <= 0.0 { -beyond.max_element() } else { beyond.max(DVec3::ZERO).length() }
}

/// How high a ray passes over the hedge, 2.1 m high and 1 m wide around (27, 22): the less of both edges, metres.
fn height_over_hedge(ray: &Ray) -> f64 {
    let height_at = |half: DVec2| {
        let direction = ray.direction.truncate();
        let edges = (half.copysign(direction) - ray.origin.truncate()) / direction;
        ray.at(edges.min_element()).z - 2.1
    };
    height_at(DVec2::new(26.5, 21.5)).min(height_at(DVec2::new(27.5, 22.5)))
}

#[test]
fn depth_along_the_ray_ends_on_what_is_seen() {
    let world = World::plaza();
    for (id, camera) in cameras(&world) {
        let truth = world.render(&camera, 3.0, 1).unwrap();
        let figures = world.figures(3.0).unwrap();
        let forward = camera.pose().forward_in_world();
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let ray = center_ray(&camera, x, y);
                let depth = f64::from(truth.depth_m[(y * SIZE.0 + x) as usize]);
                if depth == 0.0 {
                    let height = height_over_hedge(&ray);
                    assert!(height > -1e-9, "{id} ({x}, {y}): sky at {height} m over the hedge");
                    continue;
                }
                let point = ray.at(depth / ray.direction.dot(forward));
                let instance = truth.instance.get(x, y);
                if instance == 0 {
                    let boxes = world.surfaces().boxes();
                    let off = boxes.map(|solid| distance_to_box(solid, point)).fold(point.z.abs(), f64::min);
                    assert!(off < 1e-4, "{id} ({x}, {y}): {point} is {off} m off every surface");
                } else {
                    let (low, high) = figures[usize::from(instance) - 1].box_in_world;
                    let is_inside = point.cmpge(low - 1e-4).all() && point.cmple(high + 1e-4).all();
                    assert!(is_inside, "{id} ({x}, {y}): {point} is not on figure {instance}");
                }
            }
        }
    }
}

#[test]
fn figures_are_seen_where_they_stand() {
    let world = World::plaza();
    let mut n_seen = 0;
    for (id, camera) in cameras(&world) {
        let plate = world.plate(&camera, 1).unwrap();
        for step in 0..24 {
            let time = f64::from(step);
            let truth = world.render_over(&plate, time).unwrap();
            let figures = world.figures(time).unwrap();
            for figure in &figures {
                let chest = figure.foot_in_world + DVec3::Z * (0.72 * figure.height_m);
                let eye = camera.pose().position_in_world;
                let Some((x, y)) = pixel_of(&camera, chest) else { continue };
                let seen = truth.instance.get(x, y);
                if world.surfaces().is_hidden(eye, chest) {
                    assert_ne!(seen, figure.instance, "{id} at {time}: seen through a building");
                    continue;
                }
                let place = format!("{id} at {time}, figure {}", figure.name);
                if seen != figure.instance {
                    assert_ne!(seen, 0, "{place}: nobody is where it is");
                    let other = figures[usize::from(seen) - 1].foot_in_world;
                    assert!((other - eye).length() < (figure.foot_in_world - eye).length(), "{place}");
                    continue;
                }
                n_seen += 1;
                let (low, high, _) = rect_of(&truth, figure.instance).unwrap();
                // The picture's rectangle lies in the box's projection; a line bows by less than 2 px within it.
                let (box_low, box_high) = figure.box_in_world;
                let corners: Vec<_> =
                    box_corners(box_low, box_high).filter_map(|corner| camera.project(corner)).collect();
                let size = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
                let first = corners.iter().map(|c| c.texture * size).fold(DVec2::INFINITY, DVec2::min) - 2.0;
                let last =
                    corners.iter().map(|c| c.texture * size).fold(DVec2::NEG_INFINITY, DVec2::max) + 2.0;
                let [low, high] = [low, high].map(|p| DVec2::new(f64::from(p[0]), f64::from(p[1])) + 0.5);
                assert!(low.cmpge(first).all() && high.cmple(last).all(), "{place}: outside its box");
                let foot = camera.project(figure.foot_in_world).unwrap().texture * size;
                let is_whole = low.y > 1.0 && high.y < size.y - 2.0 && low.x > 1.0 && high.x < size.x - 2.0;
                let foot_is_bare =
                    truth.instance.data.iter().all(|value| *value == 0 || *value == figure.instance)
                        && !world.surfaces().is_hidden(eye, figure.foot_in_world + DVec3::Z * 0.02);
                if is_whole && foot_is_bare {
                    let slack = 0.25 * (high.y - low.y) + 1.0;
                    assert!((low.x - slack..high.x + slack).contains(&foot.x), "{place}: foot beside it");
                    assert!((foot.y - high.y).abs() < slack, "{place}: foot at {}, ends {}", foot.y, high.y);
                }
            }
        }
    }
    assert!(n_seen > 100, "figures are seen {n_seen} times");
}

#[test]
fn buildings_are_seen_where_their_corners_project() {
    let world = World::plaza();
    let mut n_seen = 0;
    for (id, camera) in cameras(&world) {
        let plate = world.plate(&camera, 1).unwrap();
        let forward = camera.pose().forward_in_world();
        let point_at = |x: u32, y: u32| {
            let ray = center_ray(&camera, x, y);
            let depth = f64::from(plate.truth().depth_m[(y * SIZE.0 + x) as usize]);
            (depth > 0.0).then(|| ray.at(depth / ray.direction.dot(forward)))
        };
        for (idx, solid) in world.surfaces().boxes().take(2).enumerate() {
            let place = format!("{id}, box {idx}");
            let corners: Vec<_> = box_corners(-solid.half_size(), solid.half_size()).collect();
            for corner in &corners {
                // A little within the corner, which is more than a pixel.
                let inset = solid.world_from_box_point(*corner * 0.94);
                let Some((x, y)) = pixel_of(&camera, inset) else { continue };
                let seen = point_at(x, y).unwrap_or_else(|| panic!("{place}: sky at {inset}"));
                let eye = camera.pose().position_in_world;
                let is_on_box = distance_to_box(solid, seen) < 1e-4;
                assert!(is_on_box || (seen - eye).length() < (inset - eye).length(), "{place}: {seen}");
                n_seen += usize::from(is_on_box);
            }
            let size = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
            let projected: Option<Vec<_>> = corners
                .iter()
                .map(|corner| Some(camera.project(solid.world_from_box_point(*corner))?.texture * size))
                .collect();
            let Some(projected) = projected else { continue };
            // The lens bows edges outwards by up to 3 px.
            let low = projected.iter().copied().fold(DVec2::INFINITY, DVec2::min) - 3.0;
            let high = projected.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max) + 3.0;
            for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
                // Half a centimetre above its foot, the wall is not the ground.
                let is_wall = point_at(x, y)
                    .is_some_and(|point| point.z > 0.005 && distance_to_box(solid, point) < 1e-4);
                let at = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                let is_within = at.cmpge(low).all() && at.cmple(high).all();
                assert!(is_within || !is_wall, "{place}: seen at {at}, outside {low} to {high}");
            }
        }
    }
    assert!(n_seen >= 24, "{n_seen} corners are seen");
}

#[test]
fn figures_walk_on_the_paving_clear_of_buildings_and_of_each_other() {
    let world = World::plaza();
    for step in 0..2400 {
        let time = f64::from(step) * 0.01;
        let (figures, later) = (world.figures(time).unwrap(), world.figures(time + 0.01).unwrap());
        for (i, figure) in figures.iter().enumerate() {
            let foot = figure.foot_in_world;
            assert!(foot.z == 0.0 && foot.x.abs() < 19.5 && foot.y.abs() < 14.5, "{} at {time}", figure.name);
            let speed = (later[i].foot_in_world - foot).length() / 0.01;
            assert!((1.0..2.0).contains(&speed), "{} walks {speed} m/s", figure.name);
            assert!((1.6..1.9).contains(&figure.height_m));
            for solid in world.surfaces().boxes() {
                let distance = distance_to_box(solid, foot + DVec3::Z);
                let is_outside = !is_in(solid, foot + DVec3::Z);
                assert!(is_outside && distance > 0.6, "{} at {time}: {distance} m", figure.name);
            }
            for other in &figures[i + 1..] {
                let distance = (other.foot_in_world - foot).length();
                assert!(distance > 1.2, "{} and {} at {time}: {distance} m", figure.name, other.name);
            }
        }
    }
}

fn is_in(solid: &OrientedBox, point: DVec3) -> bool {
    let toward_center = (solid.center() - point).normalize();
    let world = videofields_vision::geometry::Surfaces::of_ground_and_boxes(Vec::new(), vec![*solid]);
    // A ray from inside leaves: it meets the box on its way out, with an outward normal along it.
    world
        .hit(&Ray { origin: point, direction: toward_center }, 0.0)
        .is_some_and(|hit| hit.normal_in_world.dot(toward_center) > 0.0)
}

#[test]
fn every_camera_sees_figures_come_and_go_and_every_pixel_mostly_bare() {
    let world = World::plaza();
    let mut hidden = HashSet::new();
    for (id, camera) in world.cameras(SIZE).unwrap() {
        let plate = world.plate(&camera, 1).unwrap();
        let mut n_covered = vec![0; plate.truth().depth_m.len()];
        let mut seen = HashSet::new();
        for step in 0..120 {
            let time = f64::from(step) * 0.2;
            let truth = world.render_over(&plate, time).unwrap();
            for (count, instance) in n_covered.iter_mut().zip(&truth.instance.data) {
                *count += usize::from(*instance > 0);
            }
            for figure in world.figures(time).unwrap() {
                let (low, high) = figure.box_in_world;
                let is_in_picture = box_corners(low, high).all(|corner| pixel_of(&camera, corner).is_some());
                match rect_of(&truth, figure.instance) {
                    Some((_, _, n_pixels)) if n_pixels > 60 => drop(seen.insert(figure.instance)),
                    None if is_in_picture => drop(hidden.insert((id, figure.instance))),
                    _ => {}
                }
            }
        }
        assert!(seen.len() >= 2, "{id} sees {seen:?} at 60 pixels and more");
        let most = n_covered.iter().max().unwrap();
        assert!(*most <= 36, "{id}: a pixel is covered in {most} of 120 frames");
    }
    assert!(hidden.len() >= 2, "nobody passes behind a building: {hidden:?}");
}

#[test]
fn the_scene_document_tells_of_the_same_world() {
    let world = World::plaza();
    let json: serde_json::Value = serde_json::from_str(&world.scene_json((640, 360)).unwrap()).unwrap();
    assert_eq!((json["version"].as_u64(), json["name"].as_str()), (Some(1), Some("Plaza")));
    let color = |value: &serde_json::Value| {
        let text = value["color_srgb"].as_str().unwrap().strip_prefix('#').unwrap().to_owned();
        assert_eq!(text.len(), 6);
        u32::from_str_radix(&text, 16).unwrap()
    };
    let [red, green, blue] = world.sky_srgb();
    assert_eq!(color(&json["sky"]), u32::from_be_bytes([0, red, green, blue]));
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let ground = json["ground"].as_array().unwrap();
    assert_eq!(ground.len(), world.surfaces().ground().len());
    for (written, polygon) in ground.iter().zip(world.surfaces().ground()) {
        assert_eq!(written["height_m"].as_f64(), Some(polygon.height_m()));
        let corners: Vec<_> = written["polygon"].as_array().unwrap().iter().map(numbers).collect();
        let expected: Vec<_> = polygon.corners().iter().map(|corner| corner.to_array().to_vec()).collect();
        assert_eq!(corners, expected);
        assert_ne!(color(written), 0);
    }
    let boxes = json["boxes"].as_array().unwrap();
    assert_eq!(boxes.len(), world.surfaces().boxes().len());
    for (written, solid) in boxes.iter().zip(world.surfaces().boxes()) {
        let vector = |field: &str| DVec3::from_slice(&numbers(&written[field]));
        let yaw_rad = written["yaw_deg"].as_f64().unwrap().to_radians();
        let read = OrientedBox::new(vector("center_m"), vector("size_m"), yaw_rad).unwrap();
        for corner in [DVec3::ONE, DVec3::new(-1.0, 0.5, 0.0)] {
            let [a, b] = [&read, solid].map(|solid| solid.world_from_box_point(corner * solid.half_size()));
            assert!((a - b).length() < 1e-3, "{}", written["id"]);
        }
        assert_ne!(color(written), 0);
    }
    let written = json["cameras"].as_array().unwrap();
    let cameras = world.cameras((640, 360)).unwrap();
    assert_eq!(written.len(), cameras.len());
    for (written, (id, camera)) in written.iter().zip(&cameras) {
        assert_eq!(written["id"].as_str(), Some(*id));
        let document: CameraDocument = serde_json::from_value(written["calibration"].clone()).unwrap();
        let read = document.to_camera().unwrap();
        for point in [DVec3::ZERO, DVec3::new(4.0, -3.0, 1.7)] {
            let [a, b] = [&read, camera].map(|camera| camera.project(point).unwrap().texture);
            assert!((a - b).length() < 1e-12, "{id}");
        }
    }
}

/// All frames of a video, as a decoder gives them.
fn decode(path: &Path) -> Vec<RgbImage> {
    decode_timed(path).into_iter().map(|(picture, _)| picture).collect()
}

fn small_options(out_dir: PathBuf) -> SimulateOptions {
    SimulateOptions {
        seconds: Some(0.8),
        rate_hz: Some(10.0),
        size_px: Some((162, 90)),
        samples_per_side: 2,
        truth_every_frames: 4,
        extra_views: vec![ExtraView {
            name: "from-the-south".to_owned(),
            eye_in_world: DVec3::new(0.0, -14.0, 4.0),
            target_in_world: DVec3::new(0.0, 2.0, 1.0),
            fov_y_rad: 0.8,
            size_px: (80, 60),
        }],
        ..SimulateOptions::new(out_dir)
    }
}

#[test]
fn what_is_written_is_what_is_true() {
    let folder = tempfile::tempdir().unwrap();
    let world = World::plaza();
    let options = small_options(folder.path().join("new/plaza"));
    let Written { config, clips, views, n_frames } = write(&world, &options).unwrap();
    assert_eq!((n_frames, clips.len()), (8, 3));
    assert_eq!(views, [options.out_dir.join("truth/from-the-south")]);
    let text = std::fs::read_to_string(config.unwrap()).unwrap();
    let settings: videofields_vision::config::Settings = toml::from_str(&text).unwrap();
    assert_eq!(settings.camera.len(), 3);
    for camera in &settings.camera {
        assert!(
            camera.source.path.as_ref().is_some_and(|path| options.out_dir.join(path).is_file()),
            "{}",
            camera.id
        );
    }
    let scene = std::fs::read_to_string(options.out_dir.join(&settings.scene[0].file)).unwrap();
    assert_eq!(scene, world.scene_json(options.size_px).unwrap());
    for ((id, camera), clip) in world.cameras_at(options.size_px).unwrap().iter().zip(&clips) {
        let text = std::fs::read_to_string(options.out_dir.join(format!("calibration/{id}.json"))).unwrap();
        let document: CameraDocument = serde_json::from_str(&text).unwrap();
        assert_eq!(document, CameraDocument::from_camera(camera));
        let frames = decode(clip);
        assert_eq!(frames.len(), 8);
        for (frame, decoded) in frames.iter().enumerate() {
            let truth = world.render(camera, frame as f64 / 10.0, 2).unwrap();
            let psnr_db = compare(&truth.rgb, decoded, None).unwrap().psnr_db.unwrap();
            assert!(psnr_db >= 34.0, "{id} frame {frame}: {psnr_db} dB");
            let path = |kind: &str| options.out_dir.join(format!("truth/{id}/{kind}/{frame:06}.png"));
            if frame % 4 != 0 {
                assert!(!path("frame").is_file());
                continue;
            }
            assert_eq!(image::open(path("frame")).unwrap().into_rgb8().into_raw(), truth.rgb.data);
            assert_eq!(image::open(path("instance")).unwrap().into_luma8().into_raw(), *truth.instance.data);
            let depth_mm = image::open(path("depth")).unwrap().into_luma16().into_raw();
            for (read, depth_m) in depth_mm.iter().zip(&truth.depth_m) {
                assert!(
                    (f32::from(*read) / 1000.0 - depth_m).abs() <= 0.000_51,
                    "{read} mm, not {depth_m} m"
                );
            }
        }
    }
    let view = image::open(options.out_dir.join("truth/from-the-south/frame/000004.png")).unwrap();
    let camera =
        Camera::pinhole(DVec3::new(0.0, -14.0, 4.0), DVec3::new(0.0, 2.0, 1.0), 0.8, (80, 60)).unwrap();
    assert_eq!(view.into_rgb8().into_raw(), world.render(&camera, 0.4, 2).unwrap().rgb.data);
    let positions = std::fs::read_to_string(options.out_dir.join("truth/positions.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> =
        positions.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 8);
    let figure = &world.figures(0.5).unwrap()[1];
    let written = &lines[5]["figures"][1];
    assert_eq!(written["instance"].as_u64(), Some(u64::from(figure.instance)));
    assert_eq!(written["foot_m"][0].as_f64(), Some(figure.foot_in_world.x));
    assert_eq!(written["box_high_m"][2].as_f64(), Some(figure.height_m));
}

#[test]
fn views_alone_are_written_at_the_times_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let world = World::plaza();
    let mut options = small_options(folder.path().to_owned());
    options.parts = Parts::Views;
    options.truth_at_secs = vec![0.7, 0.2, 0.7];
    let Written { config, clips, views, .. } = write(&world, &options).unwrap();
    assert_eq!((config, clips.len()), (None, 0));
    let names = |path: &Path| {
        let entries = std::fs::read_dir(path).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    };
    assert_eq!(names(folder.path()), ["calibration", "truth"]);
    assert_eq!(names(&folder.path().join("truth")), ["from-the-south", "truth.json"]);
    let kinds =
        ["background.png", "depth", "frame", "instance", "label", "normal", "seen", "shadow", "static"];
    assert_eq!(names(&views[0]), kinds);
    for kind in &kinds[1..] {
        assert_eq!(names(&views[0].join(kind)), ["000002.png", "000007.png"], "{kind}");
    }
    let view = &options.extra_views[0];
    let camera =
        Camera::pinhole(view.eye_in_world, view.target_in_world, view.fov_y_rad, view.size_px).unwrap();
    let judged = world.judged_view(&camera, 0.7, 2, (162, 90)).unwrap();
    let read = |kind: &str| image::open(views[0].join(kind).join("000007.png")).unwrap();
    assert_eq!(read("frame").into_rgb8().into_raw(), judged.truth.rgb.data);
    assert_eq!(read("seen").into_luma8().into_raw(), *judged.seen.data);
    assert_eq!(read("static").into_luma8().into_raw(), *judged.still.data);
}

#[test]
fn what_a_camera_sees_is_seen_and_nothing_else() {
    let world = World::plaza();
    let cameras: Vec<Camera> = world.cameras(SIZE).unwrap().into_iter().map(|(_, camera)| camera).collect();
    // From a camera's own place everything but the sky is seen by it.
    for camera in &cameras {
        let plate = world.plate(camera, 1).unwrap();
        let seen = world.seen_by(&plate, std::slice::from_ref(camera));
        for (seen, depth) in seen.data.iter().zip(&plate.truth().depth_m) {
            assert_eq!(*seen, if *depth > 0.0 { 255 } else { 0 });
        }
        assert!(world.seen_by(&plate, &[]).data.iter().all(|seen| *seen == 0));
    }
    // From elsewhere a place counts when the nearest camera's own truth shows it at the right depth.
    let view = view_from_the_south();
    let plate = world.plate(&view, 1).unwrap();
    let seen = world.seen_by(&plate, &cameras[..1]);
    let camera = &cameras[0];
    let own = world.plate(camera, 1).unwrap();
    let (mut n_seen, mut n_wrong) = (0, 0);
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let ray = center_ray(&view, x, y);
            let depth = f64::from(plate.truth().depth_m[(y * SIZE.0 + x) as usize]);
            let is_shown = depth > 0.0 && {
                let point = ray.at(depth / ray.direction.dot(view.pose().forward_in_world()));
                pixel_of(camera, point).is_some_and(|(u, v)| {
                    let there = own.truth().depth_m[(v * SIZE.0 + u) as usize];
                    let here = camera.project(point).unwrap().depth_m as f32;
                    // Within a pixel's slope of level ground seen from 6 m up.
                    there > 0.0 && (there - here).abs() < 0.03 * here
                })
            };
            n_seen += u32::from(is_shown);
            n_wrong += u32::from(is_shown != (seen.get(x, y) == 255));
        }
    }
    assert!(n_seen > 10_000, "{n_seen} pixels are seen");
    assert!(n_wrong * 100 < n_seen, "{n_wrong} of {n_seen} pixels are wrong");
}

#[test]
fn the_static_part_keeps_clear_of_figures() {
    let world = World::plaza();
    let judged = world.judged_view(&view_from_the_south(), 12.0, 1, (640, 360)).unwrap();
    let figure_near = |x: u32, y: u32| {
        let columns = x.saturating_sub(2)..(x + 3).min(SIZE.0);
        (y.saturating_sub(2)..(y + 3).min(SIZE.1))
            .any(|y| columns.clone().any(|x| judged.truth.instance.get(x, y) > 0))
    };
    assert!(judged.truth.instance.data.iter().any(|instance| *instance > 0));
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let expected = if figure_near(x, y) { 0 } else { judged.seen.get(x, y) };
            assert_eq!(judged.still.get(x, y), expected, "({x}, {y})");
        }
    }
}

#[test]
fn the_committed_demo_is_what_the_world_writes() {
    let folder = videofields_testing::root().join("config/demo");
    let world = World::plaza();
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    assert_eq!(read("plaza.json"), world.scene_json((640, 360)).unwrap());
    let database = Path::new("../../target/demo/videofields.sqlite");
    assert_eq!(read("plaza.toml"), world.config_toml(database).unwrap());
    let mut n_bytes = 0;
    for (id, camera) in world.cameras((640, 360)).unwrap() {
        let clip = folder.join("clips").join(format!("{id}.webm"));
        n_bytes += std::fs::metadata(&clip).unwrap().len();
        let frames = decode(&clip);
        assert_eq!(frames.len(), 240, "{id}");
        let plate = world.plate(&camera, 3).unwrap();
        for frame in (0..240).step_by(37) {
            let truth = world.render_over(&plate, frame as f64 / 10.0).unwrap();
            let found = compare(&truth.rgb, &frames[frame], None).unwrap();
            let psnr_db = found.psnr_db.unwrap();
            assert!(psnr_db >= 36.0, "{id} frame {frame}: {psnr_db} dB");
        }
    }
    assert!(n_bytes < 8_000_000, "{n_bytes} bytes");
}

#[test]
fn what_cannot_be_simulated_is_refused_by_name() {
    let world = World::plaza();
    let folder = tempfile::tempdir().unwrap();
    let check = |change: &dyn Fn(&mut SimulateOptions), expected: &str| {
        let mut options = small_options(folder.path().join("never"));
        change(&mut options);
        let error = write(&world, &options).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Invalid, "{error}");
        assert!(error.to_string().contains(expected), "{error}");
        assert!(!options.out_dir.is_dir(), "{expected}: something was written");
    };
    check(&|o| o.rate_hz = Some(f64::NAN), "rate must be 0.1 to 240");
    check(&|o| o.rate_hz = Some(0.0), "rate");
    check(&|o| o.size_px = Some((0, 360)), "picture size must be 16 to 16383");
    check(&|o| o.size_px = Some((640, 16_384)), "picture size");
    check(&|o| o.seconds = Some(f64::INFINITY), "length must be");
    check(&|o| o.seconds = Some(f64::NAN), "length");
    check(&|o| o.seconds = Some(-1.0), "length");
    check(&|o| o.samples_per_side = 0, "samples per side must be 1 to 16");
    check(&|o| o.samples_per_side = 17, "samples per side");
    check(&|o| o.truth_at_secs = vec![0.1, 0.15], "time of truth must be the time of a frame");
    check(&|o| o.truth_at_secs = vec![0.8], "time of truth");
    check(&|o| o.truth_at_secs = vec![-0.1], "time of truth");
    check(&|o| o.truth_at_secs = vec![f64::NAN], "time of truth");
    check(&|o| o.extra_views[0].name = "north".to_owned(), "name of a view must be");
    check(&|o| o.extra_views[0].name = "../out".to_owned(), "name of a view");
    check(&|o| o.extra_views[0].fov_y_rad = f64::NAN, "field of view must be 0.01 to 3.0 rad");
    check(&|o| o.extra_views[0].eye_in_world = o.extra_views[0].target_in_world, "eye must be");
    check(&|o| o.extra_views[0].eye_in_world.x = f64::INFINITY, "eye");
    check(&|o| o.extra_views[0].size_px = (0, 1), "image size must be");
    let camera = view_from_the_south();
    for time in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(world.render(&camera, time, 1), Err(SimulateError::Time)));
        assert!(matches!(world.figures(time), Err(SimulateError::Time)));
    }
    assert!(world.figures(1e300).unwrap().iter().all(|figure| figure.foot_in_world.is_finite()));
    let error = World::named("moon").unwrap_err();
    assert!(matches!(
        run("moon", &small_options(folder.path().join("never"))),
        Err(SimulateError::UnknownWorld { .. })
    ));
    assert_eq!((error.kind(), World::named("plaza").unwrap().id()), (ErrorKind::NotFound, "plaza"));
    // A file where the folder should be.
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let error = write(&world, &small_options(file)).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Internal);
    assert!(error.to_string().contains("file"), "{error}");
}

#[test]
fn a_view_from_inside_a_wall_or_straight_down_is_still_a_picture() {
    let world = World::plaza();
    let hall = world.surfaces().boxes().next().unwrap().center();
    for (eye, target) in [
        (hall, hall + DVec3::Y),
        (DVec3::new(0.0, 0.0, 30.0), DVec3::ZERO),
        (DVec3::new(0.0, 0.0, -3.0), DVec3::new(1.0, 0.0, 5.0)),
        (DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 0.0, 9.0)),
    ] {
        let camera = Camera::pinhole(eye, target, 1.0, (32, 24)).unwrap();
        let truth = world.render(&camera, 1.0, 2).unwrap();
        assert!(truth.depth_m.iter().all(|depth| depth.is_finite() && *depth >= 0.0), "{eye}");
        assert_eq!(truth.rgb.data.len(), 32 * 24 * 3);
    }
}
