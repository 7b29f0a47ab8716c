//! From the scene's axes (x east, y north, z up; cameras look along +z, y down) to those of three.js and glTF (x east, y up, z
//! south; cameras look along -z, y up) and back. Both are right-handed: nothing is mirrored.

use glam::{DMat3, DMat4, DQuat, DVec3};

/// How far a rotation may be from one, and an upright axis from the vertical: files have few digits.
const TOLERANCE: f64 = 1e-4;

/// A point or direction of the scene as y-up programs have it.
pub(super) fn y_up(of: DVec3) -> DVec3 {
    DVec3::new(of.x, of.z, -of.y)
}

/// A point or direction of a y-up program in the scene.
pub(super) fn z_up(of: DVec3) -> DVec3 {
    DVec3::new(of.x, -of.z, of.y)
}

/// A turn about a quarter of a circle that takes the scene's axes to y-up ones.
fn y_up_from_z_up() -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(y_up(DVec3::X), y_up(DVec3::Y), y_up(DVec3::Z)))
}

/// What of a camera's axes (x right, y down, z forward) is of theirs (x right, y up, z backward), and the other way round.
const fn half_turn() -> DQuat {
    DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0)
}

/// The rotation of a camera node, from that of the scene's camera.
pub(super) fn node_rotation(world_from_camera: DQuat) -> DQuat {
    (y_up_from_z_up() * world_from_camera * half_turn()).normalize()
}

/// The rotation of the scene's camera, from that of a camera node.
pub(super) fn camera_rotation(node: DQuat) -> DQuat {
    (y_up_from_z_up().inverse() * node * half_turn()).normalize()
}

/// What a node's world matrix does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// In y-up axes, metres.
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    /// Along its own axes, each above 0.
    pub(super) scale: DVec3,
}

impl Placed {
    /// Takes a matrix apart.
    ///
    /// # Errors
    /// Why it is none of rotation, positive scales and translation, for people.
    pub(super) fn of(matrix: DMat4) -> Result<Self, String> {
        if !matrix.is_finite() {
            return Err("its numbers are too large".to_owned());
        }
        let last = [matrix.x_axis.w, matrix.y_axis.w, matrix.z_axis.w, matrix.w_axis.w];
        if last != [0.0, 0.0, 0.0, 1.0] {
            return Err(
                "the last row must be 0, 0, 0, 1: matrices are column-major, as three.js and glTF write them"
                    .to_owned(),
            );
        }
        let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|column| column.truncate());
        let scale = DVec3::from(columns.map(DVec3::length));
        // Also of a NaN, and of what is too small to have a direction.
        if !(scale.min_element() > 1e-9 && scale.max_element() < 1e9) {
            return Err("its axes must have lengths from 1e-9 to 1e9".to_owned());
        }
        let [x, y, z] = [columns[0] / scale.x, columns[1] / scale.y, columns[2] / scale.z];
        if x.dot(y).abs() > TOLERANCE || y.dot(z).abs() > TOLERANCE || z.dot(x).abs() > TOLERANCE {
            return Err("its axes must stand at right angles".to_owned());
        }
        if x.cross(y).dot(z) < 0.0 {
            return Err("it mirrors: the world is right-handed".to_owned());
        }
        let rotation = DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize();
        Ok(Self { translation: matrix.w_axis.truncate(), rotation, scale })
    }

    /// The turn about the vertical, from east towards north, radians.
    ///
    /// # Errors
    /// Where it is not upright.
    pub(super) fn yaw_rad(&self) -> Result<f64, String> {
        if (self.rotation * DVec3::Y).y < 1.0 - TOLERANCE * TOLERANCE {
            return Err("it must stand upright: turned about the vertical alone".to_owned());
        }
        let east = z_up(self.rotation * DVec3::X);
        Ok(east.y.atan2(east.x))
    }
}

/// A turn about the vertical, from east towards north.
pub(super) fn turn(yaw_rad: f64) -> DQuat {
    DQuat::from_rotation_y(yaw_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::geometry::Pose;

    #[test]
    fn up_is_up_north_is_backward_and_nothing_is_mirrored() {
        assert_eq!(y_up(DVec3::Z), DVec3::Y);
        assert_eq!(y_up(DVec3::Y), -DVec3::Z);
        assert_eq!(y_up(DVec3::X), DVec3::X);
        let point = DVec3::new(1.5, -2.25, 3.0);
        assert_eq!(z_up(y_up(point)), point);
        let axes = DMat3::from_cols(y_up(DVec3::X), y_up(DVec3::Y), y_up(DVec3::Z));
        assert!((axes.determinant() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn a_camera_looks_along_its_minus_z_with_its_y_up() {
        for (eye, target) in [
            (DVec3::new(3.0, -4.0, 5.0), DVec3::new(0.0, 2.0, 1.0)),
            (DVec3::ZERO, DVec3::X),
            (DVec3::new(0.0, 0.0, 9.0), DVec3::ZERO),
        ] {
            let pose = Pose::looking_at(eye, target).unwrap();
            let node = node_rotation(pose.world_from_local);
            let ahead = y_up((target - eye).normalize());
            assert!((node * -DVec3::Z).distance(ahead) < 1e-14, "{eye} {target}");
            let up = y_up(pose.world_from_local * -DVec3::Y);
            assert!((node * DVec3::Y).distance(up) < 1e-14, "{eye} {target}");
            let right = y_up(pose.world_from_local * DVec3::X);
            assert!((node * DVec3::X).distance(right) < 1e-14, "{eye} {target}");
            let back = camera_rotation(node);
            assert!(back.dot(pose.world_from_local).abs() > 1.0 - 1e-15, "{eye} {target}");
        }
    }

    #[test]
    fn matrices_come_apart_or_say_why_not() {
        let rotation = turn(0.3);
        let matrix = DMat4::from_scale_rotation_translation(
            DVec3::new(2.0, 3.0, 4.0),
            rotation,
            DVec3::new(5e5, 1.0, -5e6),
        );
        let placed = Placed::of(matrix).unwrap();
        assert!(placed.scale.distance(DVec3::new(2.0, 3.0, 4.0)) < 1e-14);
        assert_eq!(placed.translation, DVec3::new(5e5, 1.0, -5e6));
        assert!((placed.yaw_rad().unwrap() - 0.3).abs() < 1e-14);
        let fault = |matrix: DMat4| Placed::of(matrix).unwrap_err();
        assert!(fault(matrix.transpose()).contains("column-major"));
        assert!(fault(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0))).contains("mirrors"));
        assert!(fault(DMat4::from_scale(DVec3::new(0.0, 1.0, 1.0))).contains("lengths"));
        assert!(fault(DMat4::from_scale(DVec3::splat(f64::INFINITY))).contains("too large"));
        let sheared =
            DMat4::from_cols_array(&[1., 0., 0., 0., 0.5, 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.]);
        assert!(fault(sheared).contains("right angles"));
        let leaning = DMat4::from_quat(DQuat::from_rotation_x(0.1));
        assert!(Placed::of(leaning).unwrap().yaw_rad().unwrap_err().contains("upright"));
    }

    #[test]
    fn east_turns_towards_north() {
        // A quarter of a turn takes east to north, which is -z.
        assert!((turn(std::f64::consts::FRAC_PI_2) * DVec3::X).distance(-DVec3::Z) < 1e-15);
    }
}
