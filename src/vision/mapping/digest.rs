//! What a map was made from, in 32 bytes: another camera, surface, builder or size gives another digest, and a
//! stored map under the old one is stale.

use super::Builder;
use crate::geometry::{Camera, Distortion, Shape, Surfaces};
use glam::DVec3;
use sha2::{Digest, Sha256};

/// Changes when the builders come to answer otherwise for the same input.
const VERSION: u64 = 1;

/// SHA-256 over everything that decides a map's content.
///
/// Numbers enter by their bits, with -0 as 0, each list with its length first, so that no two inputs share a text.
#[must_use]
pub fn digest(camera: &Camera, surfaces: &Surfaces, builder: Builder, size_px: (u32, u32)) -> [u8; 32] {
    let mut bytes = Canonical(Sha256::new());
    bytes.0.update(b"videofields map");
    bytes.count(VERSION);
    bytes.camera(camera);
    bytes.surfaces(surfaces);
    match builder {
        Builder::Ray => bytes.count(0),
        Builder::Grid(settings) => {
            bytes.count(1);
            bytes.number(settings.step_m);
        }
    }
    bytes.count(size_px.0.into());
    bytes.count(size_px.1.into());
    bytes.0.finalize().into()
}

struct Canonical(Sha256);

impl Canonical {
    fn count(&mut self, count: u64) {
        self.0.update(count.to_le_bytes());
    }

    fn number(&mut self, number: f64) {
        // -0 + 0 is 0.
        self.count((number + 0.0).to_bits());
    }

    fn numbers(&mut self, numbers: &[f64]) {
        numbers.iter().for_each(|number| self.number(*number));
    }

    fn camera(&mut self, camera: &Camera) {
        let (width, height) = camera.size_px();
        self.count(width.into());
        self.count(height.into());
        self.numbers(&camera.focal_px().to_array());
        self.numbers(&camera.center_px().to_array());
        match camera.distortion() {
            Distortion::None => self.count(0),
            Distortion::BrownConrady { coefficients } => {
                self.count(1);
                self.numbers(coefficients);
            }
            Distortion::Fisheye { coefficients } => {
                self.count(2);
                self.numbers(coefficients);
            }
        }
        self.numbers(&camera.pose().position_in_world.to_array());
        self.numbers(&camera.pose().world_from_local.to_array());
    }

    fn surfaces(&mut self, surfaces: &Surfaces) {
        self.count(surfaces.ground().len() as u64);
        for ground in surfaces.ground() {
            self.number(ground.height_m());
            self.count(ground.corners().len() as u64);
            ground.corners().iter().for_each(|corner| self.numbers(&corner.to_array()));
        }
        self.count(surfaces.boxes().len() as u64);
        for shape in surfaces.boxes() {
            self.numbers(&shape.center().to_array());
            self.numbers(&shape.half_size().to_array());
            // The yaw, by where it turns the box's own x axis.
            self.numbers(&(shape.world_from_box_point(DVec3::X) - shape.center()).to_array());
        }
        // Each begins with its kind, so a scene of ground and boxes alone has the digest that it always had.
        for (surface, shape) in surfaces.named() {
            self.further_shape(surface.kind_and_index().0, shape);
        }
    }

    fn further_shape(&mut self, kind: u8, shape: &Shape) {
        if !matches!(shape, Shape::Ground(_) | Shape::Box(_)) {
            self.0.update(b"shape");
            self.count(kind.into());
        }
        match shape {
            Shape::Ground(_) | Shape::Box(_) => {}
            Shape::Cylinder(cylinder) => {
                self.numbers(&cylinder.base().to_array());
                self.numbers(&[cylinder.radius_m(), cylinder.height_m()]);
            }
            Shape::Footprint(footprint) => {
                self.numbers(&footprint.base_and_top_m());
                self.count(footprint.corners().len() as u64);
                footprint.corners().iter().for_each(|corner| self.numbers(&corner.to_array()));
            }
            Shape::HeightField(field) => {
                self.numbers(&field.origin().to_array());
                self.number(field.step_m());
                self.count(field.n_columns().into());
                self.count(field.heights_m().len() as u64);
                self.numbers(field.heights_m());
            }
            Shape::Model(mesh) => {
                self.count(mesh.points().len() as u64);
                mesh.points().iter().for_each(|point| self.numbers(&point.to_array()));
                self.count(mesh.triangles().len() as u64);
                mesh.triangles().iter().flatten().for_each(|point| self.count((*point).into()));
            }
        }
    }
}
