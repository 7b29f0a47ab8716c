//! The multi-view stereo benchmark's `*_par.txt`: a count, then a line for each picture.
//!
//! `name.png k11 … k33 r11 … r33 t1 t2 t3` with p = K \[R t\] X, camera x right, y down, z forward, pixel centres at
//! integers; the sizes of the pictures are not said, the world's up is anything.
//! Seitz et al. 2006, A Comparison and Evaluation of Multi-View Stereo Reconstruction Algorithms,
//! <https://vision.middlebury.edu/mview/data/>.

use super::numbers::{focal_and_center, lines, numbers};
use super::{CalibrateError, Found, MAX_PICTURES, SetOptions, pose_in_world};
use crate::calibrate::opencv::rotation;
use crate::geometry::{Camera, Distortion};
use glam::DVec3;

/// Whether the first line that is not blank is a number and nothing else.
pub(super) fn is_count(text: &str) -> bool {
    lines(text).next().is_some_and(|(_, line)| line.bytes().all(|byte| byte.is_ascii_digit()))
}

pub(super) fn import(text: &str, options: &SetOptions<'_>) -> Result<Vec<Found>, CalibrateError> {
    let mut lines = lines(text);
    let (count_place, count) = lines.next().unwrap_or_else(|| ("line 1".to_owned(), ""));
    let n_pictures: Option<usize> = count.parse().ok().filter(|count| (1..=MAX_PICTURES).contains(count));
    let n_pictures = n_pictures.ok_or_else(|| {
        let message = format!("must be the count of pictures, 1 to {MAX_PICTURES}");
        CalibrateError::invalid(count_place.as_str(), message)
    })?;
    let rows: Vec<_> = lines.collect();
    if let Some((place, _)) = rows.get(n_pictures) {
        let message = format!("one picture too many: {count_place} says {n_pictures}");
        return Err(CalibrateError::invalid(place, message));
    }
    if rows.len() < n_pictures {
        let message = format!("says {n_pictures} pictures, but {} follow", rows.len());
        return Err(CalibrateError::invalid(count_place, message));
    }
    rows.into_iter().map(|(place, row)| picture(place, row, options)).collect()
}

fn picture(place: String, row: &str, options: &SetOptions<'_>) -> Result<Found, CalibrateError> {
    let (name, values) = row.split_once(char::is_whitespace).unwrap_or((row, ""));
    let values: [f64; 21] = numbers(values, &place)?;
    let (k, rest) = values.split_first_chunk::<9>().expect("21 numbers begin with 9");
    let (r, t) = rest.split_first_chunk::<9>().expect("12 numbers begin with 9");
    let (focal_px, center_px) = focal_and_center(*k, &place)?;
    let camera_from_world = rotation(r).ok_or_else(|| {
        CalibrateError::invalid(&place, "R must be a rotation: orthonormal rows, determinant 1")
    })?;
    let pose = pose_in_world(camera_from_world, DVec3::from_slice(t) * options.metres());
    let size_px = options.size_px(name, None, &place)?;
    // Pixel centres at integers there, at +0.5 here.
    let camera = Camera::new(size_px, focal_px, center_px + 0.5, Distortion::None, pose)
        .map_err(|error| CalibrateError::no_camera(&place, &error))?;
    Ok(Found { place, name: name.to_owned(), camera })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{check_beginnings, check_fault, real_text};
    use super::super::{SetFormat, import_set};
    use super::*;

    const TEXT: &str = "2
a.png 500 0 319.5 0 510 239.5 0 0 1  1 0 0 0 0 -1 0 1 0  1 2 3
b.png 400 0 319.5 0 400 239.5 0 0 1  1 0 0 0 1 0 0 0 1  0 0 0
";

    fn size_of(_: &str) -> Option<[u32; 2]> {
        Some([640, 480])
    }

    #[test]
    fn a_set_is_read() {
        let options =
            SetOptions { size_of: Some(&size_of), metres_per_unit: Some(0.1), ..SetOptions::default() };
        let pictures = import_set(TEXT, None, &options).expect("a set");
        let [a, b] = pictures.as_slice() else { panic!("two pictures") };
        assert_eq!((a.name.as_str(), b.name.as_str()), ("a.png", "b.png"));
        assert_eq!(a.camera.size_px(), (640, 480));
        assert_eq!(a.camera.center_px().to_array(), [320.0, 240.0]);
        assert_eq!(a.camera.focal_px().to_array(), [500.0, 510.0]);
        // X = -R^T t, and the camera looks along the third row of R.
        let position = a.camera.pose().position_in_world;
        assert!((position - DVec3::new(-0.1, -0.3, 0.2)).length() < 1e-12, "{position}");
        assert!((a.camera.pose().forward_in_world() - DVec3::Y).length() < 1e-12);
        let windows = TEXT.replace('\n', "\r\n\r\n");
        assert_eq!(import_set(&windows, None, &options), Ok(pictures));
    }

    #[test]
    fn faults_name_their_line() {
        let check = |change, place, says| check_fault(TEXT, SetFormat::Middlebury, change, place, says);
        check(["2\n", "3\n"], "line 1", "says 3 pictures, but 2 follow");
        check(["2\n", "1\n"], "line 3", "one picture too many: line 1 says 1");
        check(["2\n", "0\n"], "line 1", "1 to 4096");
        check(["2\n", "99999999999999999999999\n"], "line 1", "1 to 4096");
        check(["2\n", "-1\n"], "line 1", "1 to 4096");
        check([TEXT, ""], "line 1", "1 to 4096");
        check(["  0 0 0\n", "\n"], "line 3", "expected 21 numbers, got 18");
        check(["1 2 3", "1 2 3 4"], "line 2", "expected 21 numbers, got 22");
        check(["1 2 3", "1 nan 3"], "line 2", "number 20 must be finite, got \"nan\"");
        check(["b.png", "a.png"], "line 3", "\"a.png\" is at line 2 already");
        check(["500 0 ", "500 2 "], "line 2", "a skew (k12) of 2 is not supported");
        check(["0 0 -1 0", "0 0 1 0"], "line 2", "R must be a rotation");
        check(["1 2 3", "1 2 3e99"], "line 2", "within 1e8 m");
        check(["500", "1e8"], "line 2", "1e7 pixels");
        let error = import_set(TEXT, None, &SetOptions::default()).expect_err("no size");
        assert!(error.to_string().starts_with("line 2: the picture's size is not said"), "{error}");
        check_beginnings(TEXT);
    }

    #[test]
    fn the_benchmark_s_dinosaur_stands_in_every_picture() {
        let Some(text) = real_text("middlebury_dinoSparseRing/dinoSR_par.txt") else { return };
        let options = SetOptions { size_of: Some(&size_of), ..SetOptions::default() };
        let pictures = import_set(&text, None, &options).expect("a set");
        assert_eq!(pictures.len(), 16);
        assert_eq!(pictures[15].name, "dinoSR0016.png");
        // The middle of the tight bounds that the benchmark's README gives.
        let middle = DVec3::new(-0.0255, 0.024_676_5, -0.021_175);
        for picture in pictures {
            let seen = picture.camera.project(middle).expect("in front");
            assert!(seen.is_inside() && (0.5..0.8).contains(&seen.depth_m), "{}: {seen:?}", picture.name);
        }
    }
}
