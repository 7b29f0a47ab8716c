//! Truths about calibrations, whatever text or bytes they come as.

use super::{
    CameraDocument, Format, ImportOptions, MAX_PICTURES, PictureCamera, SetFormat, SetOptions, import,
    import_colmap, import_set,
};
use crate::geometry::Camera;
use glam::DVec2;
use std::collections::HashSet;

/// Greatest distance between a turn that was normalised twice and one that was normalised once.
const TURN_SLACK: f64 = 1e-12;

/// Reads calibrations of one camera and of several in every format, named and told from the text: what is found are cameras of finite
/// numbers, which are read again where they are written, and places in pictures have rays.
///
/// The first byte says what the text leaves open: 1 the size of pictures, 2 the unit, 4 the camera's name. With 8 a model of COLMAP
/// follows: two bytes with the length of its cameras, these, and its images.
pub fn calibration_files(data: &[u8]) -> usize {
    let [kind, rest @ ..] = data else { return 0 };
    let metres_per_unit = (kind & 2 != 0).then_some(0.5);
    if kind & 8 != 0 {
        let [upper, lower, rest @ ..] = rest else { return 0 };
        let n_cameras = usize::from(u16::from_be_bytes([*upper, *lower])).min(rest.len());
        let (cameras, images) = rest.split_at(n_cameras);
        return import_colmap(cameras, images, metres_per_unit.unwrap_or(1.0)).map_or(0, holds_set);
    }
    let image_size_px = (kind & 1 != 0).then_some([640, 480]);
    let camera = (kind & 4 != 0).then(|| "left".to_owned());
    let text = String::from_utf8_lossy(rest);
    let options = ImportOptions { image_size_px, camera, metres_per_unit };
    holds_one(&text, &options) + holds_sets(&text, &options)
}

/// Reads a calibration of one camera.
fn holds_one(text: &str, options: &ImportOptions) -> usize {
    let told = import(text, None, options);
    let mut n_found = 0;
    for format in Format::ALL {
        let read = import(text, Some(format), options);
        if Format::detect(text) == Some(format) {
            assert_eq!(read, told, "{format}: as where its format is told from it");
        }
        let Ok(imported) = read else { continue };
        assert!(
            imported.residual_px.is_none_or(|missed| missed.is_finite() && missed >= 0.0),
            "{imported:?}"
        );
        if let Some([width, height]) = options.image_size_px {
            assert_eq!(imported.camera.size_px(), (width, height));
        }
        holds_camera(&imported.camera);
        n_found += 1;
    }
    n_found
}

/// Reads the calibrations of several pictures.
fn holds_sets(text: &str, options: &ImportOptions) -> usize {
    let size_of = |name: &str| (!name.is_empty()).then_some([320, 240]);
    let options = SetOptions {
        image_size_px: options.image_size_px,
        size_of: Some(&size_of),
        metres_per_unit: options.metres_per_unit,
    };
    let formats = SetFormat::ALL.into_iter().map(Some).chain([None]);
    formats.map(|format| import_set(text, format, &options).map_or(0, holds_set)).sum()
}

fn holds_set(pictures: Vec<PictureCamera>) -> usize {
    assert!((1..=MAX_PICTURES).contains(&pictures.len()), "{} pictures", pictures.len());
    let names: HashSet<_> = pictures.iter().map(|picture| &picture.name).collect();
    assert!(names.len() == pictures.len() && names.iter().all(|name| !name.is_empty()), "{names:?}");
    pictures.iter().for_each(|picture| holds_camera(&picture.camera));
    pictures.len()
}

fn holds_camera(camera: &Camera) {
    let document = CameraDocument::from_camera(camera);
    let text = serde_json::to_string(&document).expect("its numbers are finite");
    let read = CameraDocument::from_json(&text).and_then(|document| document.to_camera());
    let read = read.unwrap_or_else(|fault| panic!("{fault} in {text}"));
    assert_eq!(read.size_px(), camera.size_px());
    assert_eq!((read.focal_px(), read.center_px()), (camera.focal_px(), camera.center_px()));
    assert_eq!((read.distortion(), read.limit()), (camera.distortion(), camera.limit()));
    let (stands, was) = (read.pose(), camera.pose());
    assert_eq!(stands.position_in_world, was.position_in_world);
    assert!((stands.world_from_local - was.world_from_local).length() < TURN_SLACK, "{stands:?} for {was:?}");
    for place in [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
        let Some(ray) = camera.ray(DVec2::from_array(place)) else { continue };
        assert_eq!(ray.origin, was.position_in_world);
        assert!((ray.direction.length() - 1.0).abs() < TURN_SLACK, "{ray:?}");
        if let Some(seen) = camera.project(ray.at(10.0)) {
            assert!(seen.texture.is_finite() && seen.depth_m.is_finite(), "{seen:?}");
        }
    }
}
