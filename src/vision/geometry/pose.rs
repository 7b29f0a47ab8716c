//! Where something stands and which way it is turned.

use glam::{DMat3, DQuat, DVec3};

/// A rigid pose: local axes placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Origin of the local axes in the world, metres.
    pub position_in_world: DVec3,
    /// Unit quaternion that turns local directions into world directions.
    pub world_from_local: DQuat,
}

impl Pose {
    /// The pose of a camera at `eye` that looks at `target` with the world's up at the top of its picture.
    ///
    /// Looking straight up or down, the picture's top is north. `None` when the two points coincide or a
    /// coordinate is not finite.
    #[must_use]
    pub fn looking_at(eye: DVec3, target: DVec3) -> Option<Self> {
        let forward = (target - eye).try_normalize()?;
        if !eye.is_finite() {
            return None;
        }
        let level = forward.cross(DVec3::Z);
        // Within 1e-6 rad of the vertical the cross product's direction is mostly rounding.
        let right =
            if level.length() > 1e-6 { level.normalize() } else { forward.cross(DVec3::Y).normalize() };
        let down = forward.cross(right);
        let world_from_local = DQuat::from_mat3(&DMat3::from_cols(right, down, forward)).normalize();
        Some(Self { position_in_world: eye, world_from_local })
    }

    /// `point_in_world` in local axes.
    #[must_use]
    pub fn local_from_world_point(&self, point_in_world: DVec3) -> DVec3 {
        self.world_from_local.inverse() * (point_in_world - self.position_in_world)
    }

    /// `point_in_local` in the world.
    #[must_use]
    pub fn world_from_local_point(&self, point_in_local: DVec3) -> DVec3 {
        self.world_from_local * point_in_local + self.position_in_world
    }

    /// Unit vector of the local z axis in the world: where a camera looks.
    #[must_use]
    pub fn forward_in_world(&self) -> DVec3 {
        self.world_from_local * DVec3::Z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_puts_the_target_on_the_axis_and_up_on_top() {
        let check = |eye: DVec3, target: DVec3| {
            let pose = Pose::looking_at(eye, target).expect("a direction");
            let local = pose.local_from_world_point(target);
            let distance = (target - eye).length();
            assert!((local - DVec3::Z * distance).length() < 1e-9 * distance, "{eye} {target}: {local}");
            let right = pose.world_from_local * DVec3::X;
            let down = pose.world_from_local * DVec3::Y;
            assert!(right.z.abs() < 1e-9 && down.z <= 1e-9, "{eye} {target}");
        };
        check(DVec3::ZERO, DVec3::X);
        check(DVec3::new(5e5, 5e6, 10.0), DVec3::new(5e5 + 3.0, 5e6 - 4.0, 0.0));
        check(DVec3::new(1.0, 2.0, 30.0), DVec3::new(1.0, 2.0, 0.0));
        check(DVec3::ZERO, DVec3::Z);
        assert_eq!(Pose::looking_at(DVec3::X, DVec3::X), None);
        assert_eq!(Pose::looking_at(DVec3::NAN, DVec3::X), None);
        assert_eq!(Pose::looking_at(DVec3::INFINITY, DVec3::X), None);
    }
}
