//! Where the sun stands over a place at an instant, and how bright it shines through a clear sky.
//!
//! `[M98]` Meeus 1998, Astronomical Algorithms, 2nd edition, chapters 7, 12, 13, 22, 25 (low accuracy: 0.01 degrees).
//! `[KY89]` Kasten and Young 1989, Revised optical air mass tables and approximation formula, Applied Optics 28.
//! `[MM76]` Meinel and Meinel 1976, Applied Solar Energy: the direct beam behind an air mass.
//!
//! Without refraction, which lifts a sun on the horizon by its own diameter and one 10 degrees high by 0.09.

use glam::DVec3;

/// Julian day of 1970-01-01T00:00:00Z.
const UNIX_JULIAN_DAY: f64 = 2_440_587.5;
/// Terrestrial time less universal time, seconds: about right for 2000 to 2050 (`[M98]` chapter 10); 10 s are
/// 0.0001 degrees of the sun's way.
const DELTA_T_SECS: f64 = 70.0;

/// Where the sun stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SunPosition {
    /// Above the horizon, radians; below 0 at night.
    pub(super) altitude_rad: f64,
    /// From north through east, radians, 0 to 2 pi.
    pub(super) azimuth_rad: f64,
}

/// The sun over a place (degrees north and east) at an instant (seconds since 1970, UTC).
pub(super) fn sun_position(unix_secs: f64, latitude_deg: f64, longitude_deg: f64) -> SunPosition {
    let (right_ascension, declination) = equatorial(unix_secs);
    let julian_day = unix_secs / 86_400.0 + UNIX_JULIAN_DAY;
    let centuries = (julian_day - 2_451_545.0) / 36_525.0;
    // [M98] eq. 12.4.
    let sidereal_deg = 280.460_618_37
        + 360.985_647_366_29 * (julian_day - 2_451_545.0)
        + centuries * centuries * (0.000_387_933 - centuries / 38_710_000.0);
    let hour_angle = (sidereal_deg + longitude_deg).rem_euclid(360.0).to_radians() - right_ascension;
    let (sin_latitude, cos_latitude) = latitude_deg.to_radians().sin_cos();
    // [M98] eq. 13.5 and 13.6, with the azimuth from north.
    let east = -declination.cos() * hour_angle.sin();
    let north = declination.sin() * cos_latitude - declination.cos() * sin_latitude * hour_angle.cos();
    let up = declination.sin() * sin_latitude + declination.cos() * cos_latitude * hour_angle.cos();
    let azimuth_rad = east.atan2(north).rem_euclid(std::f64::consts::TAU);
    SunPosition { altitude_rad: up.clamp(-1.0, 1.0).asin(), azimuth_rad }
}

/// Apparent right ascension and declination, radians (`[M98]` chapter 25).
fn equatorial(unix_secs: f64) -> (f64, f64) {
    let julian_day = (unix_secs + DELTA_T_SECS) / 86_400.0 + UNIX_JULIAN_DAY;
    let t = (julian_day - 2_451_545.0) / 36_525.0;
    let mean_longitude = 280.466_46 + t * (36_000.769_83 + t * 0.000_303_2);
    let anomaly = (357.529_11 + t * (35_999.050_29 - t * 0.000_153_7)).to_radians();
    let center = (1.914_602 - t * (0.004_817 + t * 0.000_014)) * anomaly.sin()
        + (0.019_993 - 0.000_101 * t) * (2.0 * anomaly).sin()
        + 0.000_289 * (3.0 * anomaly).sin();
    let node = (125.04 - 1934.136 * t).to_radians();
    let longitude = (mean_longitude + center - 0.005_69 - 0.004_78 * node.sin()).to_radians();
    // [M98] eq. 22.2 with the correction of 25.8.
    let obliquity = (23.439_291_11 - t * (0.013_004_167 + t * (1.639e-7 - t * 5.036e-7))
        + 0.002_56 * node.cos())
    .to_radians();
    let right_ascension = (obliquity.cos() * longitude.sin()).atan2(longitude.cos());
    (right_ascension, (obliquity.sin() * longitude.sin()).asin())
}

impl SunPosition {
    /// Unit vector towards the sun: x east, y north, z up.
    pub(super) fn direction(self) -> DVec3 {
        let (sin_azimuth, cos_azimuth) = self.azimuth_rad.sin_cos();
        let (sin_altitude, cos_altitude) = self.altitude_rad.sin_cos();
        DVec3::new(sin_azimuth * cos_altitude, cos_azimuth * cos_altitude, sin_altitude)
    }

    /// Share of the direct beam at the zenith that comes through the air, per colour: 0 below the horizon, redder the
    /// lower the sun. White light falls as `[MM76]`: 0.7^(m^0.678) of what is outside the air, m its mass by `[KY89]`;
    /// blue falls faster than red, as Rayleigh scattering has it, with the exponents below chosen so that the mean of
    /// all three is about that of white.
    pub(super) fn beam(self) -> DVec3 {
        let altitude_deg = self.altitude_rad.to_degrees();
        if altitude_deg <= 0.0 {
            return DVec3::ZERO;
        }
        let mass = 1.0 / (self.altitude_rad.sin() + 0.505_72 * (altitude_deg + 6.079_95).powf(-1.6364));
        let through = |transmission: f64| f64::powf(transmission, mass.powf(0.678) - 1.0);
        DVec3::new(through(0.77), through(0.70), through(0.60))
    }

    /// Share of a day's skylight: 1 with the sun 20 degrees high, 0.002 from 12 degrees below the horizon on (nautical
    /// twilight's end, whose light is some hundred times fainter still: enough for a picture that is black).
    pub(super) fn skylight(self) -> f64 {
        let t = ((self.altitude_rad.to_degrees() + 12.0) / 32.0).clamp(0.0, 1.0);
        0.002 + 0.998 * t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unix(text: &str) -> f64 {
        text.parse::<jiff::Timestamp>().unwrap().as_second() as f64
    }

    #[test]
    fn the_sun_stands_where_the_almanac_has_it() {
        // [M98] example 25.a: 1992-10-13 at 0 h dynamical time, 59 s before universal time.
        let (ascension, declination) = equatorial(unix("1992-10-13T00:00:00Z") - DELTA_T_SECS);
        assert!((ascension.to_degrees().rem_euclid(360.0) - 198.380_83).abs() < 0.001);
        assert!((declination.to_degrees() + 7.785_07).abs() < 0.001);
    }

    #[test]
    fn the_sun_is_seen_where_published_tables_have_it() {
        let check = |time: &str, latitude: f64, longitude: f64, altitude: f64, azimuth: f64| {
            let sun = sun_position(unix(time), latitude, longitude);
            let (found_altitude, found_azimuth) =
                (sun.altitude_rad.to_degrees(), sun.azimuth_rad.to_degrees());
            assert!((found_altitude - altitude).abs() < 0.02, "{time}: altitude {found_altitude}");
            assert!((found_azimuth - azimuth).abs() < 0.03, "{time}: azimuth {found_azimuth}");
        };
        // Reda and Andreas 2004, Solar Position Algorithm (NREL/TP-560-34302), appendix A.5, before refraction.
        check("2003-10-17T19:30:30Z", 39.742_476, -105.1786, 39.872_046, 194.340_241);
        // The solstice of June 2024 at noon over the tropic: the sun is overhead, so only the altitude is sharp.
        let sun = sun_position(unix("2024-06-20T20:51:00Z"), 23.4385, -132.3);
        assert!((sun.altitude_rad.to_degrees() - 90.0).abs() < 0.2, "{sun:?}");
    }

    #[test]
    fn light_falls_with_the_sun_and_ends_at_the_horizon() {
        let beam =
            |altitude: f64| SunPosition { altitude_rad: altitude.to_radians(), azimuth_rad: 0.0 }.beam();
        assert!((beam(90.0) - DVec3::ONE).length() < 1e-3);
        assert_eq!(beam(0.0), DVec3::ZERO);
        assert_eq!(beam(-30.0), DVec3::ZERO);
        let (high, low) = (beam(50.0), beam(5.0));
        assert!(low.max_element() < 0.5 * high.min_element());
        assert!(low.x / low.z > 2.0 * high.x / high.z, "low sun is red");
        let mut before = DVec3::ZERO;
        for step in 1..90 {
            let here = beam(f64::from(step));
            assert!(here.cmpgt(before).all() && here.is_finite(), "{step}");
            before = here;
        }
    }
}
