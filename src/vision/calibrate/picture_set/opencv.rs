//! Every camera of a text by `OpenCV`'s names and conventions, where the first door takes one.
//!
//! All that is known of the format is known to [`crate::calibrate::opencv`].

use super::{CalibrateError, Found, SetOptions};
use crate::calibrate::opencv::import_all;

pub(super) fn import(text: &str, options: &SetOptions<'_>) -> Result<Vec<Found>, CalibrateError> {
    let size_px = |name: &str, said, pointer: &str| options.size_px(name, said, pointer);
    let cameras = import_all(text, options.metres_per_unit, size_px)?;
    Ok(cameras.into_iter().map(|(place, name, camera)| Found { place, name, camera }).collect())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{check_beginnings, check_fault, real_text};
    use super::super::{SetFormat, import_set};
    use super::*;
    use crate::calibrate::{self, ImportOptions};
    use glam::DVec3;

    const TEXT: &str = r#"{"cameras": [
    {"name": "left", "width": 640, "height": 480, "K": [[500, 0, 319.5], [0, 510, 239.5], [0, 0, 1]],
     "dist": [-0.3, 0.1, 0.001, -0.002], "R": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "t_mm": [100, 200, 3000]},
    {"K": [[400, 0, 319.5], [0, 400, 239.5], [0, 0, 1]], "R": [0, 0, 0], "t": [0, 0, 2]}]}"#;

    const YAML: &str = "K: [[500, 0, 319.5], [0, 510, 239.5], [0, 0, 1]]\nrvec: [0, 0, 0]\ntvec: [1, 2, 3]\n";

    fn options() -> SetOptions<'static> {
        SetOptions { image_size_px: Some([640, 480]), ..SetOptions::default() }
    }

    #[test]
    fn every_camera_is_the_one_that_the_first_door_gives() {
        let pictures = import_set(TEXT, None, &options()).expect("a set");
        let names: Vec<_> = pictures.iter().map(|picture| picture.name.as_str()).collect();
        assert_eq!(names, ["left", "1"]);
        for picture in pictures {
            let one = ImportOptions {
                image_size_px: Some([640, 480]),
                camera: Some(picture.name),
                metres_per_unit: None,
            };
            assert_eq!(picture.camera, calibrate::import(TEXT, None, &one).expect("a camera").camera);
        }
    }

    #[test]
    fn a_text_of_one_camera_is_a_set_of_one() {
        let pictures = import_set(YAML, None, &options()).expect("a set");
        assert_eq!((pictures.len(), pictures[0].name.as_str()), (1, "0"));
        let named = import_set(&format!("name: hall\n{YAML}"), None, &options()).expect("a set");
        assert_eq!(named[0].name, "hall");
    }

    #[test]
    fn faults_name_their_pointer() {
        let check = |change, place, says| check_fault(TEXT, SetFormat::OpenCv, change, place, says);
        check(["640", "320"], "/cameras/0", "320 x 480 here, but 640 x 480");
        check(["[0, 0, 2]", "[0, 0]"], "/cameras/1/t", "expected 3 numbers, got 2");
        check(["[0, 0, 2]", "[0, 0, 2, 1]"], "/cameras/1/t", "expected 3 numbers, got 4");
        check(["[0, 0, 2]", "[0, 0, \"nan\"]"], "/cameras/1/t/2", "finite number");
        check(["{\"K\"", "{\"name\": \"left\", \"K\""], "/cameras/1", "\"left\" is at /cameras/0 already");
        check(["{\"K\"", "{\"name\": \"\", \"K\""], "/cameras/1", "must not be empty");
        check([TEXT, "[]"], "/camera_matrix", "no camera matrix");
        let camera = r#"{"K": [[400, 0, 1], [0, 400, 1], [0, 0, 1]], "R": [0, 0, 0], "t": [0, 0, 2]}"#;
        let many = vec![camera; 4097].join(",");
        check([TEXT, &format!("[{many}]")], "", "at most 4096 pictures, got 4097");
        check_beginnings(TEXT);
        check_beginnings(YAML);
    }

    #[test]
    fn the_students_hall_has_its_four_cameras() {
        let Some(text) = real_text("utrecht_voxel4/calibration_refined.json") else { return };
        let pictures = import_set(&text, None, &SetOptions::default()).expect("a set");
        let names: Vec<_> = pictures.iter().map(|picture| picture.name.as_str()).collect();
        assert_eq!(names, ["cam1", "cam2", "cam3", "cam4"]);
        let camera = &pictures[0].camera;
        assert_eq!(camera.size_px(), (644, 486));
        let center_m = DVec3::new(2.905_339_101, -3.369_261_877, 1.419_746_263);
        let position = camera.pose().position_in_world;
        assert!((position - center_m).length() < 1e-6, "{position}");
    }
}
