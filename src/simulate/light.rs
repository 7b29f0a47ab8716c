//! Sun and sky: how much light falls on a place.
//!
//! Everything reflects evenly in all directions (Lambert), so a place has one colour from wherever it is seen; that
//! makes the truth of any view comparable with a projection of any other. Owns the light; knows no materials.

use super::effects::CastShadows;
use crate::geometry::Surfaces;
use glam::DVec3;

/// A sun and a sky; linear light, such that a white surface at 1 is as bright as a picture can show.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// Unit vector towards the sun.
    pub(super) to_sun: DVec3,
    /// What the sun adds on a surface square to it.
    pub(super) sun: DVec3,
    /// What the sky adds on a level surface.
    pub(super) sky: DVec3,
    /// What the ground adds on a surface that faces down.
    pub(super) bounce: DVec3,
    /// Shadows, if the world names them.
    pub(super) cast_shadows: Option<CastShadows>,
}

/// Further than anything that could stand in the sun's way, metres.
const SUN_DISTANCE_M: f64 = 1e4;
/// How far off its surface a place is lit, so that it does not shade itself, metres.
const OFF_SURFACE_M: f64 = 1e-3;

impl Light {
    /// The light that a place with this normal reflects if it is white.
    pub(super) fn on(&self, place: DVec3, normal: DVec3, surfaces: &Surfaces) -> DVec3 {
        let upward = 0.5 + 0.5 * normal.z;
        let ambient = self.sky * upward + self.bounce * (1.0 - upward);
        let slope = normal.dot(self.to_sun);
        if slope <= 0.0 {
            return ambient;
        }
        let start = place + normal * OFF_SURFACE_M;
        let is_shaded = self
            .cast_shadows
            .is_some_and(|_settings| surfaces.is_hidden(start, start + self.to_sun * SUN_DISTANCE_M));
        if is_shaded { ambient } else { ambient + self.sun * slope }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::OrientedBox;

    #[test]
    fn the_sun_lights_what_faces_it_and_nothing_behind_a_box() {
        let light = |cast_shadows| Light {
            to_sun: DVec3::new(-0.6, 0.0, 0.8),
            sun: DVec3::ONE,
            sky: DVec3::splat(0.2),
            bounce: DVec3::splat(0.1),
            cast_shadows,
        };
        let tower = OrientedBox::new(DVec3::new(0.0, 0.0, 4.0), DVec3::new(2.0, 2.0, 8.0), 0.0).unwrap();
        let surfaces = Surfaces { ground: Vec::new(), boxes: vec![tower] };
        let on = |shadows, place: DVec3, normal: DVec3| light(shadows).on(place, normal, &surfaces).x;
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        // East of the tower, away from the sun in the west: its shadow reaches 1 + 8 * 0.6 / 0.8 = 7 m.
        assert!(near(on(Some(CastShadows::STILL), DVec3::new(6.9, 0.0, 0.0), DVec3::Z), 0.2));
        assert!(near(on(Some(CastShadows::STILL), DVec3::new(7.1, 0.0, 0.0), DVec3::Z), 1.0));
        assert!(near(on(None, DVec3::new(6.9, 0.0, 0.0), DVec3::Z), 1.0));
        // The tower's own walls.
        assert!(near(on(Some(CastShadows::STILL), DVec3::new(-1.0, 0.0, 3.0), -DVec3::X), 0.15 + 0.6));
        assert!(near(on(Some(CastShadows::STILL), DVec3::new(1.0, 0.0, 3.0), DVec3::X), 0.15));
    }
}
