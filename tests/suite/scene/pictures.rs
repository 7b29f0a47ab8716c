//! Pictures on ground, buildings, models and sky, in files made here.

use super::models::{Site, TRIANGLES, binary, gltf};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use std::io::Cursor;
use videofields_picture::scene::{
    self, FolderImports, MAX_TEXTURE_SIDE_PX, Paint, ParsedScene, Scene, SceneError, Sky, Wrap,
};
use videofields_vision::error::ErrorKind;
use videofields_vision::geometry::{Geodetic, SurfaceId, Triangle};

/// A picture whose red tells the column and whose green tells the row.
fn png(width: u32, height: u32) -> Vec<u8> {
    let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([x as u8, y as u8, 90]));
    let mut bytes = Vec::new();
    picture.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).expect("a picture");
    bytes
}

fn jpeg(width: u32, height: u32) -> Vec<u8> {
    let picture = image::RgbImage::from_pixel(width, height, image::Rgb([200, 100, 50]));
    let mut bytes = Vec::new();
    picture.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Jpeg).expect("a picture");
    bytes
}

/// A PNG that says it has so many pixels, and has none.
fn png_header(width: u32, height: u32) -> Vec<u8> {
    let chunk = |name: &[u8; 4], data: &[u8]| {
        let mut bytes = (data.len() as u32).to_be_bytes().to_vec();
        bytes.extend(name);
        bytes.extend(data);
        let crc = bytes[4..].iter().fold(u32::MAX, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 * (crc & 1)))
        });
        bytes.extend((!crc).to_be_bytes());
        bytes
    };
    let mut header = Vec::new();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 2, 0, 0, 0]);
    let parts = [chunk(b"IHDR", &header), chunk(b"IDAT", &[]), chunk(b"IEND", &[])];
    [b"\x89PNG\r\n\x1a\n".to_vec(), parts.concat()].concat()
}

/// The JPEG with the size in its header exchanged.
fn jpeg_header(width: u16, height: u16) -> Vec<u8> {
    let mut bytes = jpeg(16, 16);
    let frame = bytes.windows(2).position(|pair| pair == [0xff, 0xc0]).expect("a frame header");
    bytes[frame + 5..frame + 7].copy_from_slice(&height.to_be_bytes());
    bytes[frame + 7..frame + 9].copy_from_slice(&width.to_be_bytes());
    bytes
}

fn site() -> Site {
    Site::new().with("map.png", png(200, 100)).with("brick.jpg", jpeg(16, 8))
}

/// Ground 20 m each way around `at` with this picture on it.
fn with_imagery(at: [f64; 2], imagery: &Value) -> Value {
    let corner = |x: f64, y: f64| [at[0] + x, at[1] + y];
    let polygon = [corner(-20.0, -20.0), corner(20.0, -20.0), corner(20.0, 20.0), corner(-20.0, 20.0)];
    json!({"version": 1, "origin": {"latitude_deg": 52.0, "longitude_deg": 5.0},
        "ground": [{"polygon": polygon, "imagery": imagery}]})
}

/// Control points of the 200 x 100 picture laid 0.1 m a pixel, its lower left corner at `at`.
fn corners(at: [f64; 2]) -> Vec<Value> {
    [[0.0, 0.0], [200.0, 0.0], [200.0, 100.0], [0.0, 100.0]]
        .map(
            |[x, y]: [f64; 2]| json!({"pixel": [x, y], "world": [at[0] + x / 10.0, at[1] + 10.0 - y / 10.0]}),
        )
        .to_vec()
}

fn load(site: &Site, document: &Value) -> Result<ParsedScene, SceneError> {
    site.load_document(document)
}

/// The one fault of a document.
fn fault(site: &Site, document: &Value) -> String {
    let error = load(site, document).expect_err("a fault");
    assert_eq!(error.kind(), ErrorKind::Invalid);
    let [fault] = error.faults() else { panic!("one fault: {error}") };
    fault.to_string()
}

fn refused(site: &Site, document: &Value, expected: &str) {
    let said = fault(site, document);
    assert!(said.contains(expected), "expected {expected}, got {said}");
}

/// Where in its picture a point of a surface lies: the picture's place, continued over the triangle.
fn place_at(scene: &Scene, surface: SurfaceId, point: DVec3) -> Option<DVec2> {
    let shape = scene.surfaces.shape(surface).expect("a shape");
    let paint = scene.material(surface).and_then(|material| material.paint.as_deref())?;
    let mut found = None;
    shape.triangles(&mut |triangle: Triangle| {
        let [a, b, c] = triangle.corners;
        let whole = (b - a).cross(c - a).dot(triangle.normal);
        let share = |p: DVec3, q: DVec3| (p - point).cross(q - point).dot(triangle.normal) / whole;
        let weights = [share(b, c), share(c, a), share(a, b)];
        let is_on = (point - a).dot(triangle.normal).abs() < 1e-6;
        if !is_on || weights.iter().any(|weight| *weight < -1e-9) {
            return;
        }
        if let Some(painted) = paint.on(shape, &triangle) {
            let at: DVec3 =
                painted.corners.iter().zip(weights).map(|(corner, weight)| *corner * weight).sum();
            found = Some(at.truncate() / at.z);
        }
    });
    found
}

#[test]
fn control_points_lay_a_picture_on_the_ground_at_any_coordinates() {
    for at in [[0.0, 0.0], [5e5, 5e6]] {
        let document = with_imagery(at, &json!({"file": "map.png", "control_points": corners(at)}));
        let site = site();
        let parsed = load(&site, &document).expect("a scene");
        let imagery = parsed.document.ground[0].imagery.as_ref().expect("imagery");
        assert!(imagery.residual_m.expect("a residual") < 1e-7, "{imagery:?}");
        for (x, y) in [(0.0, 0.0), (7.3, 2.1), (19.9, 9.9), (-5.0, -8.0)] {
            let point = DVec3::new(at[0] + x, at[1] + y, 0.0);
            let place = place_at(&parsed.scene, SurfaceId::Ground(0), point).expect("a place");
            let expected = DVec2::new(x / 20.0, 1.0 - y / 10.0);
            assert!((place - expected).length() < 1e-8, "({x}, {y}): {place} for {expected}");
        }
        // The normal form says the residual, and reads the same again.
        let text = parsed.document.to_json();
        assert!(text.contains("residual_m"), "{text}");
        let imports = FolderImports::beside(&site.path().join("plaza.json"), &[]);
        assert_eq!(scene::parse("plaza", &text, imports).expect("its own output"), parsed);
    }
}

#[test]
fn the_residual_is_told_and_a_picture_is_bent_from_six_points_on() {
    let shifted = |transform: Option<&str>, n: usize| {
        let mut points = corners([0.0, 0.0]);
        points.push(json!({"pixel": [100, 50], "world": [10.3, 5.0]}));
        points.push(json!({"pixel": [50, 25], "world": [5.0, 7.7]}));
        points.truncate(n);
        let mut imagery = json!({"file": "map.png", "control_points": points});
        if let Some(transform) = transform {
            imagery["transform"] = json!(transform);
        }
        let parsed = load(&site(), &with_imagery([0.0, 0.0], &imagery)).expect("a scene");
        parsed.document.ground[0].imagery.as_ref().and_then(|imagery| imagery.residual_m).expect("a residual")
    };
    // One of five is 0.3 m off in the middle: its residual is 0.24 m, the others' 0.06 m.
    assert!((shifted(None, 5) - 0.12).abs() < 1e-9, "{}", shifted(None, 5));
    assert_eq!(shifted(None, 5), shifted(Some("affine"), 5));
    assert!(shifted(Some("homography"), 5) < shifted(None, 5));
    assert_eq!(shifted(None, 6), shifted(Some("homography"), 6));
    assert!(shifted(None, 6) < shifted(Some("affine"), 6));
}

#[test]
fn degenerate_control_points_are_refused_with_their_place() {
    let site = site();
    let check = |points: Value, expected: &str| {
        let imagery = json!({"file": "map.png", "control_points": points});
        refused(&site, &with_imagery([0.0, 0.0], &imagery), expected);
    };
    let point = |pixel: [f64; 2], world: [f64; 2]| json!({"pixel": pixel, "world": world});
    let good = corners([0.0, 0.0]);
    check(json!(good[..2]), "/ground/0/imagery/control_points: at least 3 control points are needed, got 2");
    let line: Vec<Value> = (0..7)
        .map(|i| point([f64::from(i) * 9.0, f64::from(i) * 5.0], [f64::from(i), f64::from(i * i)]))
        .collect();
    check(json!(line), "/ground/0/imagery/control_points: the control points lie (almost) on one line");
    let line: Vec<Value> =
        (0..4).map(|i| point([f64::from(i) * 9.0, f64::from(i * i)], [5e5 + f64::from(i), 5e6])).collect();
    check(json!(line), "/ground/0/imagery/control_points: the control points lie (almost) on one line");
    let mirrored: Vec<Value> = good
        .iter()
        .map(|point| json!({"pixel": [point["pixel"][0], 100.0 - point["pixel"][1].as_f64().unwrap()], "world": point["world"]}))
        .collect();
    check(json!(mirrored), "/ground/0/imagery/control_points: the control points mirror the picture");
    let mut beside = good.clone();
    beside[2]["pixel"] = json!([200.5, 100]);
    check(
        json!(beside),
        "/ground/0/imagery/control_points/2/pixel: lies beside the picture, which has 200 x 100",
    );
    beside[2]["pixel"] = json!([null, 100]);
    check(json!(beside), "/ground/0/imagery/control_points");
    beside[2] = point([200.0, 100.0], [2e8, 0.0]);
    check(
        json!(beside),
        "/ground/0/imagery/control_points/2/world/0: expected -100000000 to 100000000 metres",
    );
    // What JSON cannot say is no JSON.
    for number in ["NaN", "1e999", "-Infinity"] {
        let imagery = json!({"file": "map.png", "control_points": good});
        let text = with_imagery([0.0, 0.0], &imagery).to_string().replacen("200.0", number, 1);
        site.load_text(&text).expect_err(number);
    }
}

#[test]
fn imagery_is_laid_by_one_rule_of_its_two() {
    let site = site();
    let check = |imagery: &Value, expected: &str| {
        refused(&site, &with_imagery([0.0, 0.0], imagery), expected);
    };
    let bounds = json!({"west_deg": 4.999, "south_deg": 51.999, "east_deg": 5.001, "north_deg": 52.001});
    check(&json!({"file": "map.png"}), "/ground/0/imagery: expected either `control_points` or `bounds`");
    check(
        &json!({"file": "map.png", "bounds": bounds, "control_points": corners([0.0, 0.0])}),
        "/ground/0/imagery: expected either",
    );
    check(
        &json!({"file": "map.png", "bounds": bounds, "transform": "affine"}),
        "/ground/0/imagery/transform: is for control points",
    );
    let mut nowhere = with_imagery([0.0, 0.0], &json!({"file": "map.png", "bounds": bounds}));
    nowhere.as_object_mut().expect("an object").remove("origin");
    refused(&site, &nowhere, "/ground/0/imagery/bounds: needs the scene's `origin`");
    let mut both = with_imagery([0.0, 0.0], &json!({"file": "map.png", "bounds": bounds}));
    both["ground"][0]["texture"] = json!({"file": "brick.jpg", "size_m": [1, 1]});
    refused(&site, &both, "/ground/0/imagery: `imagery` and `texture` are both given");
}

#[test]
fn bounds_lay_a_picture_where_it_is_on_the_earth() {
    // A kilometre or two around origins north and south, and across the antimeridian either way.
    for (latitude, longitude) in
        [(52.0, 5.0), (-33.9, 18.4), (0.0, 0.0), (65.0, 179.995), (-17.0, -179.995), (10.0, 180.0)]
    {
        let around = |degrees: f64| (degrees + 540.0).rem_euclid(360.0) - 180.0;
        let (half, site) = (0.01, site());
        let bounds = json!({"west_deg": around(longitude - half), "south_deg": latitude - half,
            "east_deg": around(longitude + half), "north_deg": latitude + half});
        let mut document = with_imagery([0.0, 0.0], &json!({"file": "map.png", "bounds": bounds}));
        document["origin"] = json!({"latitude_deg": latitude, "longitude_deg": longitude, "height_m": 40.0});
        document["ground"][0]["polygon"] =
            json!([[-2000, -2000], [2000, -2000], [2000, 2000], [-2000, 2000]]);
        let parsed = load(&site, &document).expect("a scene");
        let imagery = parsed.document.ground[0].imagery.as_ref().expect("imagery");
        let residual_m = imagery.residual_m.expect("a residual");
        assert!(residual_m < 0.15, "{latitude} {longitude}: {residual_m}");
        let origin = Geodetic::from_degrees(latitude, longitude, 40.0);
        for (x, y) in [(0.5, 0.5), (0.1, 0.2), (0.9, 0.9), (0.02, 0.98)] {
            let there = Geodetic::from_degrees(
                latitude + half - 2.0 * half * y,
                longitude - half + 2.0 * half * x,
                40.0,
            );
            let point = origin.east_north_up_m(&there).truncate().extend(0.0);
            let place = place_at(&parsed.scene, SurfaceId::Ground(0), point).expect("a place");
            // The picture is at most 2230 m wide.
            let miss_m = (place - DVec2::new(x, y)).length() * 2230.0;
            assert!(miss_m < 0.5, "{latitude} {longitude} ({x}, {y}): {miss_m} m");
        }
    }
}

#[test]
fn bounds_that_no_level_world_fits_are_refused() {
    let site = site();
    let check = |[west, south, east, north]: [f64; 4], (latitude, longitude): (f64, f64), expected: &str| {
        let bounds = json!({"west_deg": west, "south_deg": south, "east_deg": east, "north_deg": north});
        let mut document = with_imagery([0.0, 0.0], &json!({"file": "map.png", "bounds": bounds}));
        document["origin"] = json!({"latitude_deg": latitude, "longitude_deg": longitude});
        refused(&site, &document, expected);
    };
    let place = "/ground/0/imagery/bounds";
    check([4.0, 80.0, 6.0, 90.0], (85.0, 5.0), &format!("{place}/north_deg: expected -85 to 85 degrees"));
    check([4.0, 84.9, 6.0, 85.1], (85.0, 5.0), &format!("{place}/north_deg: expected -85 to 85 degrees"));
    check([170.0, 1.0, 190.0, 2.0], (1.5, 180.0), &format!("{place}/east_deg: expected -180 to 180 degrees"));
    check([5.1, 51.9, 4.9, 52.1], (52.0, 5.0), "these bounds reach 359.800 degrees from west to east");
    check([4.9, 52.1, 5.1, 51.9], (52.0, 5.0), &format!("{place}/north_deg: must lie north of `south_deg`"));
    check([5.0, 51.9, 5.0, 52.1], (52.0, 5.0), &format!("{place}/east_deg: must lie east of `west_deg`"));
    check([4.9, 51.9, 5.1, 52.1], (48.0, 5.0), "must lie within 50 km of the scene's origin");
    check([-180.0, -80.0, 180.0, 80.0], (0.0, 0.0), &format!("{place}: must lie within 50 km"));
    // 35 km across at 84 degrees, parallels bend by more than half of a pixel of 460 m.
    check([3.5, 83.6, 6.5, 84.4], (84.0, 5.0), "a level world fits these bounds only to");
}

#[test]
fn pictures_are_read_within_limits_from_their_folders_alone() {
    let site = site()
        .with("huge.png", png_header(100_000, 100_000))
        .with("wide.png", png_header(100_000, 1))
        .with("none.png", png_header(0, 10))
        .with("tall.jpg", jpeg_header(16, 0xffff))
        .with("flat.jpg", jpeg_header(0, 16))
        .with("half.png", &png(200, 100)[..200])
        .with("half.jpg", &jpeg(64, 64)[..300])
        .with("text.png", "not a picture")
        .with("big.png", png_header(MAX_TEXTURE_SIDE_PX, MAX_TEXTURE_SIDE_PX))
        .with("bigger.png", png_header(MAX_TEXTURE_SIDE_PX + 1, 1));
    std::fs::write(site.path().parent().expect("a parent").join("outside.png"), png(4, 4)).expect("written");
    let check = |file: &str, expected: &str| {
        let texture = json!({"file": file, "size_m": [1, 1]});
        let document = json!({"version": 1, "boxes": [
            {"id": "a", "center_m": [0, 0, 1], "size_m": [2, 2, 2], "texture": texture}]});
        let said = fault(&site, &document);
        assert!(said.starts_with("/boxes/0/texture/file: "), "{said}");
        assert!(said.contains(expected), "{file}: expected {expected}, got {said}");
    };
    check("huge.png", "1 to 8192 pixels each way are allowed, got 100000 x 100000");
    check("wide.png", "got 100000 x 1");
    check("bigger.png", "got 8193 x 1");
    check("tall.jpg", "got 16 x 65535");
    check("none.png", "dimensions");
    check("flat.jpg", "");
    check("half.png", "");
    check("half.jpg", "");
    check("text.png", "only PNG and JPEG are read");
    check("missing.png", "No such file");
    check("../outside.png", "it lies neither beneath");
    check("/etc/passwd", "it lies neither beneath");
    check("http://example.org/a.png", "");
    check("", "`file` must be a path");
    // As large as one may be is held against what is left for all.
    let big = json!({"file": "big.png", "size_m": [1, 1]});
    let document = json!({"version": 1, "sky": {"picture": {"file": "map.png"}}, "boxes": [
        {"id": "a", "center_m": [0, 0, 1], "size_m": [2, 2, 2], "texture": big}]});
    refused(&site, &document, "8192 x 8192 pixels take 268435456 bytes, but of the 268435456");
    // Documents from elsewhere open nothing.
    let texture = json!({"file": "brick.jpg", "size_m": [1, 1]});
    let document = json!({"version": 1, "boxes": [
        {"id": "a", "center_m": [0, 0, 1], "size_m": [2, 2, 2], "texture": texture}]});
    let error = scene::parse("plaza", &document.to_string(), scene::no_imports).expect_err("a refusal");
    assert!(error.to_string().contains("pictures are read only by scene files"), "{error}");
}

#[test]
fn textures_cover_walls_roofs_and_uneven_ground() {
    let texture = |w: f64, h: f64| json!({"file": "brick.jpg", "size_m": [w, h]});
    let (walls, roof) = (texture(2.0, 1.0), texture(3.0, 3.0));
    let at = [5e5, 5e6];
    let document = json!({"version": 1,
        "boxes": [{"id": "a", "center_m": [at[0], at[1], 1], "size_m": [4, 4, 2], "texture": walls}],
        "cylinders": [{"id": "b", "base_m": [at[0] + 9.0, at[1], 0], "radius_m": 1, "height_m": 3, "roof_texture": roof}],
        "footprints": [{"id": "c", "polygon": [[at[0], 5e6 + 9.0], [5e5 + 6.0, 5e6 + 9.0], [5e5, 5e6 + 15.0]], "top_m": 3,
            "texture": walls, "roof_texture": roof}],
        "height_fields": [{"id": "d", "low_m": [5e5 - 30.0, 5e6], "step_m": 10, "columns": 2,
            "heights_m": [0, 1, 1, 2], "texture": roof}],
        "ground": [{"polygon": [[0, 0], [9, 0], [9, 9], [0, 9]], "texture": roof}]});
    let parsed = load(&site(), &document).expect("a scene");
    let scene = &parsed.scene;
    let check = |surface: SurfaceId, offset: [f64; 3], expected: Option<[f64; 2]>| {
        let point = DVec3::new(at[0], at[1], 0.0) + DVec3::from(offset);
        let place = place_at(scene, surface, point).map(|place| place - place.floor());
        let expected = expected.map(DVec2::from_array);
        let is_near = match (place, expected) {
            (Some(place), Some(expected)) => (place - expected).length() < 1e-8,
            (place, expected) => place == expected,
        };
        assert!(is_near, "{surface:?} {offset:?}: {place:?} for {expected:?}");
    };
    // The box's southern wall begins at its western edge, at its foot.
    check(SurfaceId::Box(0), [-1.5, -2.0, 0.25], Some([0.25, 0.75]));
    check(SurfaceId::Box(0), [1.5, 2.0, 0.25], Some([0.25, 0.75]));
    check(SurfaceId::Box(0), [0.3, 0.4, 2.0], None);
    check(SurfaceId::Cylinder(0), [9.5, 0.5, 3.0], Some([0.5, 0.5]));
    check(SurfaceId::Footprint(0), [0.75, 9.0, 0.5], Some([0.375, 0.5]));
    check(SurfaceId::Footprint(0), [0.75, 9.75, 3.0], Some([0.25, 0.75]));
    // 10 m up by 1 m east and 1 m north: a plane.
    check(SurfaceId::HeightField(0), [-30.0 + 7.0, 4.0, 1.1], Some([1.0 / 3.0, 2.0 / 3.0]));
    let materials = &scene.materials;
    assert!(materials.iter().all(|material| material.paint.is_some()));
    assert_eq!(materials[0].color_srgb, [0x8a, 0x8a, 0x84]);
    // One file is one picture however often it is named.
    let first = |material: &scene::Material| match material.paint.as_deref() {
        Some(Paint::Repeated { walls, level }) => {
            let repeated = walls.as_ref().or(level.as_ref()).expect("a picture");
            std::sync::Arc::as_ptr(&repeated.picture)
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(first(&materials[1]), first(&materials[3]));
    assert_eq!(first(&materials[0]), first(&materials[1]), "what hides all is behind no colour");
}

#[test]
fn textures_of_no_size_or_too_often_repeated_are_refused() {
    let site = site();
    let check = |size: Value, expected: &str| {
        let texture = json!({"file": "brick.jpg", "size_m": size});
        let document = json!({"version": 1, "boxes": [
            {"id": "a", "center_m": [0, 0, 1], "size_m": [2, 2, 2], "texture": texture},
            {"id": "b", "center_m": [9, 0, 1], "size_m": [5000, 2, 2], "roof_texture": {"file": "brick.jpg", "size_m": [5, 5]}}]});
        refused(&site, &document, expected);
    };
    check(json!([0, 1]), "/boxes/0/texture/size_m/0: expected 0.001 to 100000 metres, got 0");
    check(json!([1, -1]), "/boxes/0/texture/size_m/1: expected 0.001 to 100000 metres, got -1");
    check(json!([1, 1e6]), "/boxes/0/texture/size_m/1: expected 0.001 to 100000 metres");
    check(json!([1]), "/boxes/0/texture/size_m");
    let texture = json!({"file": "brick.jpg", "size_m": [0.1, 0.1]});
    let long = json!({"version": 1, "boxes": [
        {"id": "a", "center_m": [0, 0, 1], "size_m": [5000, 2, 2], "texture": texture}]});
    refused(
        &site,
        &long,
        "/boxes/0/texture/size_m: a picture may repeat at most 4096 times along a face, but here 50000 times",
    );
}

#[test]
fn a_sky_has_one_of_three_forms() {
    let site = site();
    let sky = |sky: Value| load(&site, &json!({"version": 1, "sky": sky})).expect("a scene").scene.sky;
    assert_eq!(sky(json!({})), Sky::Plain { color_srgb: [0x87, 0xb5, 0xdd] });
    assert_eq!(sky(json!({"color_srgb": "#010203"})), Sky::Plain { color_srgb: [1, 2, 3] });
    let gradient = json!({"zenith_srgb": "#3060a0", "horizon_srgb": "#c0d0e0", "ground_srgb": "#605040"});
    let Sky::Gradient { zenith_srgb, horizon_srgb, ground_srgb } = sky(json!({"gradient": gradient})) else {
        panic!("a gradient")
    };
    assert_eq!(
        [zenith_srgb, horizon_srgb, ground_srgb],
        [[0x30, 0x60, 0xa0], [0xc0, 0xd0, 0xe0], [0x60, 0x50, 0x40]]
    );
    let Sky::Picture { texture, yaw_rad } = sky(json!({"picture": {"file": "map.png", "yaw_deg": 90}}))
    else {
        panic!("a picture")
    };
    assert_eq!((texture.size_px(), texture.wraps()), ((200, 100), [Wrap::Repeat, Wrap::Clamp]));
    assert!((yaw_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    let document = json!({"version": 1, "sky": {"gradient": gradient, "color_srgb": "#010203"}});
    refused(&site, &document, "/sky: expected one of `color_srgb`, `gradient` and `picture`");
    let document =
        json!({"version": 1, "sky": {"gradient": {"zenith_srgb": "#3060a0", "ground_srgb": "#605040"}}});
    refused(&site, &document, "/sky/gradient: the key `horizon_srgb` is missing");
    let document = json!({"version": 1, "sky": {"picture": {"file": "nothing.png"}}});
    refused(&site, &document, "/sky/picture/file: cannot import");
    let document = json!({"version": 1, "sky": {"picture": {"file": "map.png", "yaw_deg": 1e9}}});
    refused(&site, &document, "/sky/picture/yaw_deg: expected -360 to 360 degrees");
}

/// The tetrahedron of [`gltf`] with these texture coordinates, a sampler and a picture.
fn textured(coordinates: &[[f32; 2]; 4], wrap: u32, image: &Value) -> (Value, Vec<u8>) {
    let mut buffer = binary();
    buffer.extend(coordinates.iter().flatten().flat_map(|number| number.to_le_bytes()));
    let mut document = gltf(Some("kiosk.bin"));
    document["buffers"][0]["byteLength"] = json!(buffer.len());
    document["bufferViews"]
        .as_array_mut()
        .expect("a list")
        .push(json!({"buffer": 0, "byteOffset": 72, "byteLength": 32}));
    document["accessors"]
        .as_array_mut()
        .expect("a list")
        .push(json!({"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"}));
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(2);
    document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0});
    document["textures"] = json!([{"source": 0, "sampler": 0}]);
    document["samplers"] = json!([{"wrapS": wrap, "wrapT": wrap}]);
    document["images"] = json!([image]);
    (document, buffer)
}

const SQUARE: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.25, 0.5]];

fn model(coordinates: &[[f32; 2]; 4], wrap: u32, image: &Value) -> Result<ParsedScene, SceneError> {
    let (document, buffer) = textured(coordinates, wrap, image);
    let site = site().with("models/kiosk.gltf", document.to_string()).with("models/kiosk.bin", buffer);
    let site = site.with("models/skin.png", png(8, 4));
    site.load(&json!([{"id": "kiosk", "file": "models/kiosk.gltf"}]))
}

#[test]
fn models_bring_their_pictures() {
    let data = {
        use base64::Engine;
        format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png(8, 4)))
    };
    for image in [json!({"uri": "skin.png"}), json!({"uri": data})] {
        for (wrap, expected) in [(10497, Wrap::Repeat), (33648, Wrap::Mirror), (33071, Wrap::Clamp)] {
            let parsed = model(&SQUARE, wrap, &image).expect("a scene");
            let material = &parsed.scene.materials[0];
            let Some(Paint::Mapped { pictures, triangles }) = material.paint.as_deref() else {
                panic!("{material:?}")
            };
            let [picture] = pictures.as_slice() else { panic!("one picture: {pictures:?}") };
            assert_eq!((picture.size_px(), picture.wraps()), ((8, 4), [expected; 2]));
            assert_eq!(triangles.len(), 4);
            for (triangle, corners) in triangles.iter().zip(TRIANGLES) {
                assert_eq!(triangle.picture, Some(0));
                assert_eq!(triangle.corners, corners.map(|corner| SQUARE[usize::from(corner)]));
            }
            // The base colour tints it.
            assert_eq!(material.part_srgb(0), [255, 0, 127]);
        }
    }
    // Out of a buffer, as a GLB has it; the library would take on trust that its type is told.
    let (mut document, mut buffer) = textured(&SQUARE, 10497, &json!({"bufferView": 3}));
    let picture = png(8, 4);
    document["bufferViews"]
        .as_array_mut()
        .expect("a list")
        .push(json!({"buffer": 0, "byteOffset": buffer.len(), "byteLength": picture.len()}));
    buffer.extend(picture);
    document["buffers"][0]["byteLength"] = json!(buffer.len());
    let load = |document: &Value| {
        let site = site().with("models/kiosk.gltf", document.to_string()).with("models/kiosk.bin", &buffer);
        site.load(&json!([{"id": "kiosk", "file": "models/kiosk.gltf"}]))
    };
    let parsed = load(&document).expect("a scene");
    assert!(matches!(parsed.scene.materials[0].paint.as_deref(), Some(Paint::Mapped { .. })));
    // Without coordinates nothing says where it lies.
    document["meshes"][0]["primitives"][0]["attributes"]
        .as_object_mut()
        .expect("an object")
        .remove("TEXCOORD_0");
    assert_eq!(load(&document).expect("a scene").scene.materials[0].paint, None);
    for (pointer, value) in [
        ("/images/0", json!({})),
        ("/images/0", json!({"bufferView": 9})),
        ("/textures/0/source", json!(9)),
        ("/textures/0", json!({})),
        ("/textures/0/sampler", json!(9)),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/index", json!(9)),
        ("/images/0", json!({"uri": "../../../outside.png"})),
        ("/images/0", json!({"uri": "https://example.org/skin.png"})),
        ("/images/0", json!({"uri": "kiosk.bin"})),
    ] {
        let mut wrong = document.clone();
        wrong["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(2);
        *wrong.pointer_mut(pointer).expect("a place") = value;
        let error = load(&wrong).expect_err(pointer);
        assert!(error.to_string().contains("/models/0/file: cannot read"), "{error}");
    }
}

#[test]
fn texture_coordinates_that_are_none_are_refused_and_far_ones_brought_near() {
    let image = json!({"uri": "skin.png"});
    let with = |value: f32| {
        let mut coordinates = SQUARE;
        coordinates[3][0] = value;
        coordinates
    };
    for wrong in [f32::NAN, f32::INFINITY, 1e9, -1e9] {
        for wrap in [10497, 33648, 33071] {
            let error = model(&with(wrong), wrap, &image).expect_err("a refusal").to_string();
            assert!(error.contains("/meshes/0/primitives/0: triangle 0: "), "{error}");
        }
    }
    // All of a triangle far away is the same as near.
    let far = SQUARE.map(|[s, t]| [s + 1e6, t - 1e6]);
    let parsed = model(&far, 10497, &image).expect("a scene");
    let Some(Paint::Mapped { triangles, .. }) = parsed.scene.materials[0].paint.as_deref() else {
        panic!("pictures")
    };
    assert!(triangles.iter().flat_map(|triangle| triangle.corners).flatten().all(|at| at.abs() <= 2.0));
    let error = model(&far, 33071, &image).expect_err("its edge alone").to_string();
    assert!(error.contains("texture coordinates reach over 1000001 pictures"), "{error}");
}
