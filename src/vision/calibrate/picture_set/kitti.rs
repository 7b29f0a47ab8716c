//! KITTI's projections of rectified cameras: `calib.txt` and `calib_cam_to_cam.txt`.
//!
//! `P0: ` or `P_rect_00: ` and P = K \[I t\] in 3 rows of 4, pixel centres at integers, metres; `S_rect_00: ` and
//! the rectified pictures' columns and rows. All else (the cameras before rectification, lidar, GPS) is passed over.
//! The world is the axes of rectified camera 0: x right, y down, z forward. A picture's name is its key: the
//! pictures of `P0` and `P_rect_00` lie in the folders `image_0` and `image_00`.
//! Geiger et al. 2013, Vision meets Robotics: The KITTI Dataset, eq. 4,
//! <https://www.cvlibs.net/datasets/kitti/>.

use super::numbers::{focal_and_center, lines, numbers};
use super::{CalibrateError, Found, SetOptions, pose_in_world};
use crate::geometry::{Camera, Distortion};
use glam::{DQuat, DVec3};

/// Whether a line is a projection.
pub(super) fn has_projection(text: &str) -> bool {
    lines(text).any(|(_, line)| keyed(line).is_some_and(|(key, _)| is_projection(key)))
}

pub(super) fn import(text: &str, options: &SetOptions<'_>) -> Result<Vec<Found>, CalibrateError> {
    let entries: Vec<_> =
        lines(text).filter_map(|(place, line)| keyed(line).map(|(key, rest)| (place, key, rest))).collect();
    let mut found = Vec::new();
    for (place, key, values) in &entries {
        if !is_projection(key) {
            continue;
        }
        let size_key = key.replacen("P_rect_", "S_rect_", 1);
        let size = entries.iter().find(|(_, other, _)| key != other && *other == size_key);
        let said = size.map(|(place, _, values)| rectified_size(values, place)).transpose()?;
        let size_px = options.size_px(key, said, place)?;
        found.push(picture(place, key, values, size_px, options.metres())?);
    }
    if found.is_empty() {
        return Err(CalibrateError::invalid("line 1", "no projection (P0: or P_rect_00: and 12 numbers)"));
    }
    Ok(found)
}

fn keyed(line: &str) -> Option<(&str, &str)> {
    line.split_once(':').map(|(key, rest)| (key.trim_end(), rest))
}

fn is_projection(key: &str) -> bool {
    let number = key.strip_prefix("P_rect_").or_else(|| key.strip_prefix('P')).unwrap_or_default();
    (1..=4).contains(&number.len()) && number.bytes().all(|byte| byte.is_ascii_digit())
}

fn rectified_size(values: &str, place: &str) -> Result<[u32; 2], CalibrateError> {
    let sides: [f64; 2] = numbers(values, place)?;
    if sides.into_iter().all(|side| side.fract() == 0.0 && (1.0..=65_536.0).contains(&side)) {
        return Ok(sides.map(|side| side as u32));
    }
    Err(CalibrateError::invalid(place, "columns and rows must be whole numbers, 1 to 65536"))
}

fn picture(
    place: &str,
    key: &str,
    values: &str,
    size_px: (u32, u32),
    metres: f64,
) -> Result<Found, CalibrateError> {
    let p: [f64; 12] = numbers(values, place)?;
    let k = [p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]];
    let (focal_px, center_px) = focal_and_center(k, place)?;
    // t = K^-1 p4, with the principal point as the file counts it.
    let xy = (DVec3::new(p[3], p[7], 0.0).truncate() - center_px * p[11]) / focal_px;
    let pose = pose_in_world(DQuat::IDENTITY, xy.extend(p[11]) * metres);
    // Pixel centres at integers there, at +0.5 here.
    let camera = Camera::new(size_px, focal_px, center_px + 0.5, Distortion::None, pose)
        .map_err(|error| CalibrateError::no_camera(place, &error))?;
    Ok(Found { place: place.to_owned(), name: key.to_owned(), camera })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{check_beginnings, check_fault};
    use super::super::{SetFormat, import_set};
    use super::*;

    const ODOMETRY: &str = "P0: 700 0 600.5 0 0 710 180.5 0 0 0 1 0
P1: 700 0 600.5 -350 0 710 180.5 0 0 0 1 0
P2: 700 0 600.5 1342 0 710 180.5 362.2 0 0 1 2
Tr: 0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27
";

    const RAW: &str = "calib_time: 09-Jan-2012 13:57:47
corner_dist: 9.950000e-02
S_00: 1392 512
K_00: 984 0 690 0 980 233 0 0 1
S_rect_00: 1242 375
R_rect_00: 1 0 0 0 1 0 0 0 1
P_rect_00: 721.5 0 609.5 0 0 721.5 172.8 0 0 0 1 0
P_rect_01: 721.5 0 609.5 -387.5 0 721.5 172.8 0 0 0 1 0
S_rect_01: 1242 374
";

    #[test]
    fn projections_come_apart_into_cameras() {
        let options = SetOptions { image_size_px: Some([1241, 376]), ..SetOptions::default() };
        let pictures = import_set(ODOMETRY, None, &options).expect("a set");
        let check = |idx: usize, name: &str, position: DVec3| {
            let picture = &pictures[idx];
            assert_eq!(picture.name, name);
            assert_eq!(picture.camera.center_px().to_array(), [601.0, 181.0]);
            let stands = picture.camera.pose().position_in_world;
            assert!((stands - position).length() < 1e-12, "{name}: {stands}");
            assert_eq!(picture.camera.pose().forward_in_world(), DVec3::Z);
        };
        assert_eq!(pictures.len(), 3);
        check(0, "P0", DVec3::ZERO);
        check(1, "P1", DVec3::new(0.5, 0.0, 0.0));
        check(2, "P2", DVec3::new(-141.0 / 700.0, -1.2 / 710.0, -2.0));
        // P X by hand: (700 + 6005 + 1342, 2 710 + 1805 + 362.2, 12) / 12.
        let seen = pictures[2].camera.project(DVec3::new(1.0, 2.0, 10.0)).expect("in front");
        let pixel = seen.texture * glam::DVec2::new(1241.0, 376.0) - 0.5;
        assert!((pixel - glam::DVec2::new(8047.0, 3587.2) / 12.0).length() < 1e-9, "{pixel}");
    }

    #[test]
    fn rectified_sizes_are_taken_from_the_raw_recordings_text() {
        let pictures = import_set(RAW, None, &SetOptions::default()).expect("a set");
        let sizes: Vec<_> = pictures.iter().map(|p| (p.name.as_str(), p.camera.size_px())).collect();
        assert_eq!(sizes, [("P_rect_00", (1242, 375)), ("P_rect_01", (1242, 374))]);
    }

    #[test]
    fn faults_name_their_line() {
        let check = |change, place, says| check_fault(ODOMETRY, SetFormat::Kitti, change, place, says);
        check(["-350 ", ""], "line 2", "expected 12 numbers, got 11");
        check(["-350", "-350 0"], "line 2", "expected 12 numbers, got 13");
        check(["-350", "NaN"], "line 2", "number 4 must be finite, got \"NaN\"");
        check(["P1", "P0"], "line 2", "\"P0\" is at line 1 already");
        check(["P0: 700 0", "P0: 700 3"], "line 1", "a skew (k12) of 3");
        check(["P0: 700", "P0: 0"], "line 1", "fx and fy above 0");
        check(["0 0 1 2", "0 0 2 2"], "line 3", "K must be");
        check(["1342", "1e300"], "line 3", "within 1e8 m");
        check([ODOMETRY, "Tr: 0"], "line 1", "no projection");
        check([ODOMETRY, ""], "line 1", "no projection");
        let check = |change, place, says| check_fault(RAW, SetFormat::Kitti, change, place, says);
        check(["S_rect_00: 1242 375", "S_rect_00: 1242"], "line 5", "expected 2 numbers, got 1");
        check(["S_rect_00: 1242 375", "S_rect_00: 0 375"], "line 5", "1 to 65536");
        check(["S_rect_00: 1242 375", "S_rect_00: 1e9 375"], "line 5", "1 to 65536");
        check(["S_rect_00: 1242 375", "S_rect_00: 12.5 375"], "line 5", "1 to 65536");
        check(["", ""], "line 7", "1242 x 375 here, but 640 x 480 was asked for");
        check_beginnings(ODOMETRY);
        check_beginnings(RAW);
    }
}
