//! Light from all around as nine real spherical harmonics a colour, by how bright every direction is.
//!
//! `[G03]` Green 2003, Spherical Harmonic Lighting: the gritty details. The basis is orthonormal; directions are unit vectors in the
//! world (z up).

use crate::geometry::Camera;
use glam::{DVec2, DVec3, Vec3};

/// Coefficients of three bands.
pub const N_HARMONICS: usize = 9;

/// Band of each coefficient.
pub(super) const BANDS: [usize; N_HARMONICS] = [0, 1, 1, 1, 2, 2, 2, 2, 2];

/// Rows of directions that a function of the sphere is looked at in; twice as many columns.
const ROWS: u32 = 32;

/// How much l^2 (l + 1)^2 counts beside the mean residual where only a part of all directions is known.
const SMOOTHNESS: f64 = 0.01;

/// Columns and rows of directions that a camera's picture is looked at in.
const CAMERA_GRID: [u32; 2] = [32, 18];

/// Luminance below which light is none, linear.
const LEAST_LUMINANCE: f32 = 1e-4;

/// Why light is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LightError {
    /// A direction has no number.
    #[error("the light from row {row}, column {column} is not a finite number of at least 0")]
    NotLight {
        /// Row from the top.
        row: u32,
        /// Column.
        column: u32,
    },
    /// Nothing is bright.
    #[error("no light comes from anywhere: everything is black")]
    Black,
    /// No direction is known.
    #[error("no direction is seen")]
    Unseen,
}

/// The basis functions at a unit direction, in the order (0, 0), (1, -1), (1, 0), (1, 1), (2, -2) to (2, 2).
///
/// Source: `[G03]`, appendix A3; written for z up.
#[must_use]
pub fn basis(direction: Vec3) -> [f32; N_HARMONICS] {
    let Vec3 { x, y, z } = direction;
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (x * x - y * y),
    ]
}

/// How bright every direction is: linear light, red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonics(pub [Vec3; N_HARMONICS]);

impl Harmonics {
    /// Of light that is known in every direction, looked at in 64 x 32 of them; their rows from straight up to straight down, and
    /// their columns from east towards north.
    ///
    /// # Errors
    /// Where it is no number, or black everywhere.
    pub fn of(light: impl Fn(Vec3) -> Vec3) -> Result<Self, LightError> {
        use std::f64::consts::{PI, TAU};
        let mut sums = [DVec3::ZERO; N_HARMONICS];
        for row in 0..ROWS {
            let edge = |row: u32| (PI * f64::from(row) / f64::from(ROWS)).cos();
            let solid = (edge(row) - edge(row + 1)) * TAU / f64::from(2 * ROWS);
            let (sin, cos) = (PI * (f64::from(row) + 0.5) / f64::from(ROWS)).sin_cos();
            for column in 0..2 * ROWS {
                let (north, east) = (TAU * (f64::from(column) + 0.5) / f64::from(2 * ROWS)).sin_cos();
                let direction = DVec3::new(sin * east, sin * north, cos).as_vec3();
                let from_there = light(direction);
                if !(from_there.is_finite() && from_there.min_element() >= 0.0) {
                    return Err(LightError::NotLight { row, column });
                }
                for (sum, value) in sums.iter_mut().zip(basis(direction)) {
                    *sum += from_there.as_dvec3() * (f64::from(value) * solid);
                }
            }
        }
        Self(sums.map(|sum| sum.as_vec3())).bright()
    }

    /// Of what a camera sees: `light` of a texture coordinate, linear, `None` where it may not be looked at. What lies beside the
    /// picture is as bright as the picture in the mean, smoothly.
    ///
    /// # Errors
    /// Where it is no number, black everywhere, or nothing is seen at all.
    pub fn of_camera(camera: &Camera, light: impl Fn(DVec2) -> Option<Vec3>) -> Result<Self, LightError> {
        let [columns, rows] = CAMERA_GRID;
        let mut gram = [[0.0; N_HARMONICS]; N_HARMONICS];
        let mut right = [DVec3::ZERO; N_HARMONICS];
        let mut weights = 0.0;
        let forward = camera.pose().forward_in_world();
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let along = |at: u32, n: u32| (f64::from(at) + 0.5) / f64::from(n);
            let texture = DVec2::new(along(column, columns), along(row, rows));
            let (Some(ray), Some(from_there)) = (camera.ray(texture), light(texture)) else { continue };
            if !(from_there.is_finite() && from_there.min_element() >= 0.0) {
                return Err(LightError::NotLight { row, column });
            }
            // A flat picture's pixel is the smaller the further off the axis it looks; a fisheye's is never none.
            let weight = ray.direction.dot(forward).max(0.1).powi(3);
            let values = basis(ray.direction.as_vec3()).map(f64::from);
            weights += weight;
            for (i, value) in values.iter().enumerate() {
                right[i] += from_there.as_dvec3() * (weight * value);
                for (j, other) in values.iter().enumerate() {
                    gram[i][j] += weight * value * other;
                }
            }
        }
        if weights <= 0.0 {
            return Err(LightError::Unseen);
        }
        for (i, band) in BANDS.iter().enumerate() {
            let stiffness = (band * (band + 1)) as f64;
            gram[i][i] += SMOOTHNESS * weights * stiffness * stiffness / (4.0 * std::f64::consts::PI);
        }
        Self(solved(gram, right).map(|sum| sum.as_vec3())).bright()
    }

    /// The same with light from one direction added, as much for what faces it as `strength` times the mean of all directions.
    #[must_use]
    pub fn with_sun(mut self, towards: Vec3, strength: f32) -> Self {
        let mean = luminance(self.mean());
        // What faces light of one direction gets irradiance E of it; what is around it, pi times its mean radiance.
        let irradiance = std::f32::consts::PI * mean * strength;
        for (sum, value) in self.0.iter_mut().zip(basis(towards)) {
            *sum += Vec3::splat(irradiance * value);
        }
        self
    }

    /// The mean of all directions.
    #[must_use]
    pub fn mean(&self) -> Vec3 {
        self.0[0] * basis(Vec3::Z)[0]
    }

    fn bright(self) -> Result<Self, LightError> {
        if luminance(self.mean()) >= LEAST_LUMINANCE { Ok(self) } else { Err(LightError::Black) }
    }
}

/// Of linear light (ITU-R BT.709).
pub(super) fn luminance(light: Vec3) -> f32 {
    light.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The solution of a symmetric, positive definite system (Cholesky), a colour at a time.
fn solved(mut gram: [[f64; N_HARMONICS]; N_HARMONICS], right: [DVec3; N_HARMONICS]) -> [DVec3; N_HARMONICS] {
    for i in 0..N_HARMONICS {
        for j in 0..=i {
            let sum: f64 = gram[i][j] - (0..j).map(|k| gram[i][k] * gram[j][k]).sum::<f64>();
            gram[i][j] = if i == j { sum.max(1e-12).sqrt() } else { sum / gram[j][j] };
        }
    }
    let mut found = right;
    for i in 0..N_HARMONICS {
        let known: DVec3 = (0..i).map(|k| found[k] * gram[i][k]).sum();
        found[i] = (found[i] - known) / gram[i][i];
    }
    for i in (0..N_HARMONICS).rev() {
        let known: DVec3 = (i + 1..N_HARMONICS).map(|k| found[k] * gram[k][i]).sum();
        found[i] = (found[i] - known) / gram[i][i];
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Distortion, Pose};

    #[test]
    fn the_basis_is_orthonormal() {
        let n = 20_000;
        let mut gram = [[0.0_f64; N_HARMONICS]; N_HARMONICS];
        for i in 0..n {
            // A Fibonacci lattice on the sphere.
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(n);
            let (sin, cos) = (f64::from(i) * 2.399_963_229_728_653).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let values = basis(DVec3::new(r * cos, r * sin, z).as_vec3());
            for (a, row) in values.iter().zip(&mut gram) {
                for (b, sum) in values.iter().zip(row) {
                    *sum += f64::from(*a) * f64::from(*b) * 4.0 * std::f64::consts::PI / f64::from(n);
                }
            }
        }
        for (i, row) in gram.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((value - f64::from(u8::from(i == j))).abs() < 2e-3, "{i} {j}: {value}");
            }
        }
    }

    #[test]
    fn light_of_three_bands_is_found_again() {
        let truth =
            |d: Vec3| Vec3::new(1.0 + 0.5 * d.x, 0.8 + 0.3 * d.y * d.z, 0.9 + 0.2 * (d.x * d.x - d.y * d.y));
        let found = Harmonics::of(truth).expect("light");
        for d in [Vec3::X, Vec3::Z, -Vec3::Y, Vec3::new(0.6, 0.0, -0.8)] {
            let sum: Vec3 = found.0.iter().zip(basis(d)).map(|(c, value)| *c * value).sum();
            assert!((sum - truth(d)).abs().max_element() < 0.01, "{d}: {sum} {}", truth(d));
        }
    }

    #[test]
    fn what_is_no_light_is_refused() {
        assert_eq!(Harmonics::of(|_| Vec3::ZERO), Err(LightError::Black));
        let spoilt = |d: Vec3| if d.z > 0.99 { Vec3::new(f32::NAN, 0.0, 0.0) } else { Vec3::ONE };
        let error = Harmonics::of(spoilt).expect_err("no number");
        assert_eq!(error, LightError::NotLight { row: 0, column: 0 });
        assert!(error.to_string().contains("row 0, column 0"));
        assert!(matches!(Harmonics::of(|d| Vec3::splat(d.x)), Err(LightError::NotLight { .. })));
    }

    #[test]
    fn a_camera_gives_the_light_that_it_sees_and_its_mean_elsewhere() {
        let pose =
            Pose::looking_at(DVec3::new(5e5, 5e6, 10.0), DVec3::new(5e5, 5e6 + 9.0, 10.0)).expect("a pose");
        let camera =
            Camera::new((320, 180), DVec2::splat(140.0), DVec2::new(160.0, 90.0), Distortion::None, pose);
        let camera = camera.expect("a camera");
        let even = Harmonics::of_camera(&camera, |_| Some(Vec3::new(0.2, 0.4, 0.1))).expect("light");
        for d in [Vec3::Y, -Vec3::Y, Vec3::Z] {
            let sum: Vec3 = even.0.iter().zip(basis(d)).map(|(c, value)| *c * value).sum();
            assert!((sum - Vec3::new(0.2, 0.4, 0.1)).abs().max_element() < 1e-3, "{d}: {sum}");
        }
        // Bright above, dark below: so it is where the camera looks.
        let lit = |place: DVec2| Some(Vec3::splat(if place.y < 0.5 { 0.9 } else { 0.1 }));
        let found = Harmonics::of_camera(&camera, lit).expect("light");
        let at = |d: Vec3| found.0.iter().zip(basis(d.normalize())).map(|(c, v)| c.x * v).sum::<f32>();
        assert!(at(Vec3::new(0.0, 1.0, 0.4)) > at(Vec3::new(0.0, 1.0, -0.4)) + 0.3);
        assert_eq!(Harmonics::of_camera(&camera, |_| None), Err(LightError::Unseen));
        assert_eq!(Harmonics::of_camera(&camera, |_| Some(Vec3::ZERO)), Err(LightError::Black));
    }

    #[test]
    fn the_sun_lights_what_faces_it_as_much_as_its_strength_says() {
        let sky = Harmonics::of(|_| Vec3::splat(0.3)).expect("light");
        let sunny = sky.with_sun(Vec3::X, 2.0);
        let [before, after] = [sky, sunny].map(|of| super::super::MattLight::unscaled(&of).at(Vec3::X).x);
        // Three bands hold 15/16 + ... of a cosine's peak: 1/4 + 1/2 + 5/16 = 1.0625 of it.
        assert!((after / before - 1.0 - 2.0 * 1.0625).abs() < 0.01, "{before} {after}");
    }
}
