//! Sun, sky and lamps: how much light falls on a place.
//!
//! Everything reflects evenly in all directions (Lambert), so a place has one colour from wherever it is seen; that
//! makes the truth of any view comparable with a projection of any other. Owns the sources of light; knows no
//! materials, and asks its caller what stands in a source's way.

use super::effects::LightGains;
use glam::DVec3;

/// A sun, a sky and lamps; linear light, such that a white surface at 1 is as bright as a picture can show.
#[derive(Clone, Debug)]
pub(super) struct Light {
    /// Unit vector towards the sun.
    pub(super) to_sun: DVec3,
    /// What the sun adds on a surface square to it.
    pub(super) sun: DVec3,
    /// What the sky adds on a level surface.
    pub(super) sky: DVec3,
    /// What the ground adds on a surface that faces down.
    pub(super) bounce: DVec3,
    pub(super) lamps: Vec<Lamp>,
}

/// A lamp: a point that shines all ways, or a spot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lamp {
    /// Where it hangs, metres; nothing that hides it may be nearer than 1 cm.
    pub(super) place: DVec3,
    /// What it adds on a surface square to it at 1 m; a quarter of that at 2 m.
    pub(super) color: DVec3,
    /// Where it shines, if not all ways.
    pub(super) spot: Option<Spot>,
}

/// The cone in which a spot shines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// Unit vector of its middle.
    pub(super) direction: DVec3,
    /// Angle from the middle within which it shines in full, radians.
    pub(super) inner_rad: f64,
    /// Angle beyond which it does not shine; smooth in between. More than `inner_rad`.
    pub(super) outer_rad: f64,
}

/// Where light comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Source {
    /// The sun, in this direction.
    Sun(DVec3),
    /// A lamp at this place.
    Lamp(DVec3),
}

impl Source {
    /// A point behind which nothing hides the source, as seen from `start`.
    pub(super) fn beyond(self, start: DVec3) -> DVec3 {
        match self {
            Self::Sun(direction) => start + direction * SUN_DISTANCE_M,
            Self::Lamp(place) => place,
        }
    }
}

/// What one source adds on a place if nothing stands in its way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share {
    pub(super) light: DVec3,
    pub(super) source: Source,
}

/// Further than anything that could stand in the sun's way, metres.
const SUN_DISTANCE_M: f64 = 1e4;
/// How far off its surface a place is lit, so that it does not shade itself, metres.
const OFF_SURFACE_M: f64 = 1e-3;
/// A source that adds less is left out: a seventh of the first code of an 8-bit picture.
const DARKEST: f64 = 4e-5;
/// Below this distance a lamp grows no brighter, metres.
const NEAREST_LAMP_M: f64 = 0.1;

/// Where a place of a surface is lit from: a little off it.
pub(super) fn off_surface(place: DVec3, normal: DVec3) -> DVec3 {
    place + normal * OFF_SURFACE_M
}

impl Lamp {
    /// What the lamp adds on a place with this normal if nothing stands in its way.
    fn on(&self, place: DVec3, normal: DVec3) -> DVec3 {
        let away = self.place - place;
        let distance = away.length().max(NEAREST_LAMP_M);
        let slope = normal.dot(away) / distance;
        if slope <= 0.0 {
            return DVec3::ZERO;
        }
        let cone = self.spot.map_or(1.0, |spot| {
            let angle = spot.direction.dot(-away / distance).clamp(-1.0, 1.0).acos();
            let share =
                ((spot.outer_rad - angle) / (spot.outer_rad - spot.inner_rad).max(1e-9)).clamp(0.0, 1.0);
            share * share * (3.0 - 2.0 * share)
        });
        self.color * (cone * slope / (distance * distance))
    }
}

impl Light {
    /// The light of sky and ground that a place with this normal reflects if it is white.
    pub(super) fn ambient(&self, normal: DVec3, gains: &LightGains) -> DVec3 {
        let upward = 0.5 + 0.5 * normal.z;
        (self.sky * upward + self.bounce * (1.0 - upward)) * gains.sky
    }

    /// What sun and lamps add on a place with this normal; sources that add nothing are left out.
    pub(super) fn shares(
        &self,
        place: DVec3,
        normal: DVec3,
        gains: &LightGains,
    ) -> impl Iterator<Item = Share> {
        let slope = normal.dot(self.to_sun);
        let sun = (slope > 0.0)
            .then(|| Share { light: self.sun * gains.sun * slope, source: Source::Sun(self.to_sun) });
        let lamps = self.lamps.iter().map(move |lamp| Share {
            light: lamp.on(place, normal) * gains.lamps,
            source: Source::Lamp(lamp.place),
        });
        sun.into_iter().chain(lamps).filter(|share| share.light.max_element() > DARKEST)
    }

    /// The light that a place with this normal reflects if it is white. `is_seen` says whether a source is
    /// seen from a point.
    pub(super) fn on(
        &self,
        place: DVec3,
        normal: DVec3,
        gains: &LightGains,
        is_seen: impl Fn(DVec3, Source) -> bool,
    ) -> DVec3 {
        let start = off_surface(place, normal);
        let lit = |light: DVec3, share: Share| {
            if is_seen(start, share.source) { light + share.light } else { light }
        };
        self.shares(place, normal, gains).fold(self.ambient(normal, gains), lit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn light(lamps: Vec<Lamp>) -> Light {
        Light {
            to_sun: DVec3::new(-0.6, 0.0, 0.8),
            sun: DVec3::ONE,
            sky: DVec3::splat(0.2),
            bounce: DVec3::splat(0.1),
            lamps,
        }
    }

    fn near(a: f64, b: f64) -> bool {
        (a - b).abs() < 1e-12
    }

    #[test]
    fn the_sun_lights_what_faces_it_by_its_slope_and_what_is_seen_of_it() {
        let light = light(Vec::new());
        let on =
            |normal: DVec3, seen: bool| light.on(DVec3::ZERO, normal, &LightGains::default(), |_, _| seen).x;
        assert!(near(on(DVec3::Z, true), 0.2 + 0.8));
        assert!(near(on(DVec3::Z, false), 0.2));
        assert!(near(on(-DVec3::X, true), 0.15 + 0.6));
        assert!(near(on(DVec3::X, true), 0.15));
        let dim = LightGains { sun: DVec3::splat(0.5), sky: DVec3::splat(2.0), ..LightGains::default() };
        assert!(near(light.on(DVec3::ZERO, DVec3::Z, &dim, |_, _| true).x, 0.4 + 0.4));
    }

    #[test]
    fn a_lamp_falls_off_with_the_square_of_its_distance() {
        let lamp = Lamp { place: DVec3::new(0.0, 0.0, 3.0), color: DVec3::new(9.0, 4.5, 0.9), spot: None };
        let light = Light { sun: DVec3::ZERO, sky: DVec3::ZERO, ..light(vec![lamp]) };
        let on =
            |place: DVec3, normal: DVec3, gains: &LightGains| light.on(place, normal, gains, |_, _| true);
        let full = LightGains::default();
        assert!((on(DVec3::ZERO, DVec3::Z, &full) - DVec3::new(1.0, 0.5, 0.1)).length() < 1e-12);
        // 5 m away, the slope is 3/5.
        assert!(near(on(DVec3::new(4.0, 0.0, 0.0), DVec3::Z, &full).x, 9.0 / 25.0 * 0.6));
        assert!(near(on(DVec3::new(4.0, 0.0, 0.0), -DVec3::X, &full).x, 0.05 + 9.0 / 25.0 * 0.8));
        assert_eq!(on(DVec3::ZERO, DVec3::Z, &LightGains { lamps: DVec3::ZERO, ..full }), DVec3::ZERO);
        assert!(near(on(DVec3::ZERO, DVec3::Z, &LightGains { lamps: DVec3::splat(0.5), ..full }).x, 0.5));
        assert!(on(lamp.place, DVec3::Z, &full).is_finite());
    }

    #[test]
    fn a_spot_shines_in_its_cone_alone() {
        let spot = Spot { direction: -DVec3::Z, inner_rad: PI / 6.0, outer_rad: PI / 4.0 };
        let lamp = Lamp { place: DVec3::Z * 2.0, color: DVec3::ONE, spot: Some(spot) };
        let on = |x: f64| lamp.on(DVec3::new(x, 0.0, 0.0), DVec3::Z).x;
        let bare = |x: f64| Lamp { spot: None, ..lamp }.on(DVec3::new(x, 0.0, 0.0), DVec3::Z).x;
        assert!(near(on(0.0), 0.25) && near(on(1.1), bare(1.1)));
        assert_eq!(on(2.001), 0.0);
        // Half way between both angles, half the light.
        let x = 2.0 * (PI * 5.0 / 24.0).tan();
        assert!(near(on(x), 0.5 * bare(x)));
        assert_eq!(lamp.on(DVec3::Z * 3.0, DVec3::Z), DVec3::ZERO);
    }
}
