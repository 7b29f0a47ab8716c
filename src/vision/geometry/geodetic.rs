//! Places on the earth as places in a level world.
//!
//! `[EPSG]` IOGP Publication 373-7-2 (2019), sections 4.1.1 (geographic to geocentric, method 9602) and 4.1.2
//! (geocentric to topocentric, method 9836).

use glam::DVec3;

/// A place on the earth (WGS 84).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    /// Latitude, radians, -pi/2 to pi/2.
    pub latitude_rad: f64,
    /// Longitude, radians.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, metres.
    pub height_m: f64,
}

/// Half the ellipsoid's greater axis, metres, and its flattening (WGS 84).
const SEMI_MAJOR_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;

impl Geodetic {
    /// A place given in degrees.
    #[must_use]
    pub fn from_degrees(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Self {
        let (latitude_rad, longitude_rad) = (latitude_deg.to_radians(), longitude_deg.to_radians());
        Self { latitude_rad, longitude_rad, height_m }
    }

    /// From the earth's middle: towards the equator at longitude 0, towards it at 90 degrees east, north.
    fn geocentric(&self) -> DVec3 {
        let squared_eccentricity = FLATTENING * (2.0 - FLATTENING);
        let (sin, cos) = self.latitude_rad.sin_cos();
        let (sin_longitude, cos_longitude) = self.longitude_rad.sin_cos();
        let radius = SEMI_MAJOR_M / (1.0 - squared_eccentricity * sin * sin).sqrt();
        let around = (radius + self.height_m) * cos;
        let north = (radius * (1.0 - squared_eccentricity) + self.height_m) * sin;
        DVec3::new(around * cos_longitude, around * sin_longitude, north)
    }

    /// `place` in the level world whose origin is here: metres east, north and up of the plane that touches the
    /// ellipsoid.
    #[must_use]
    pub fn east_north_up_m(&self, place: &Self) -> DVec3 {
        let way = place.geocentric() - self.geocentric();
        let (sin, cos) = self.latitude_rad.sin_cos();
        let (sin_longitude, cos_longitude) = self.longitude_rad.sin_cos();
        let east = DVec3::new(-sin_longitude, cos_longitude, 0.0);
        let north = DVec3::new(-sin * cos_longitude, -sin * sin_longitude, cos);
        let up = DVec3::new(cos * cos_longitude, cos * sin_longitude, sin);
        DVec3::new(way.dot(east), way.dot(north), way.dot(up))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_of_the_guidance_note_is_met() {
        // [EPSG] section 4.1.2: topocentric origin 55 N 5 E, 200 m; point 53 48 33.82 N 2 07 46.38 E, 73 m.
        let origin = Geodetic::from_degrees(55.0, 5.0, 200.0);
        let degrees = |degrees: f64, minutes: f64, seconds: f64| degrees + minutes / 60.0 + seconds / 3600.0;
        let place = Geodetic::from_degrees(degrees(53.0, 48.0, 33.82), degrees(2.0, 7.0, 46.38), 73.0);
        let found = origin.east_north_up_m(&place);
        let said = DVec3::new(-189_013.869, -128_642.040, -4_220.171);
        assert!((found - said).abs().max_element() < 0.2, "{found}");
    }

    #[test]
    fn a_metre_is_a_metre_everywhere() {
        for (latitude, longitude) in [(0.0, 0.0), (52.0, 5.0), (-33.0, 180.0), (89.9, -120.0)] {
            let origin = Geodetic::from_degrees(latitude, longitude, 30.0);
            let above = Geodetic { height_m: 31.0, ..origin };
            assert!((origin.east_north_up_m(&above) - DVec3::Z).length() < 1e-8);
            // A hundredth of a second of latitude is 0.31 m, the same across 180 degrees.
            let north = Geodetic { latitude_rad: origin.latitude_rad + 1e-6, ..origin };
            let way = origin.east_north_up_m(&north);
            assert!((way.y - 6.37).abs() < 0.05 && way.x.abs() < 1e-6, "{way}");
            let around =
                Geodetic { longitude_rad: origin.longitude_rad - std::f64::consts::TAU + 1e-6, ..origin };
            let way = origin.east_north_up_m(&around);
            assert!((way.x - 6.38 * origin.latitude_rad.cos()).abs() < 0.03, "{way}");
        }
    }
}
