//! What moves in a world as a mesh: the surface of bodies' parts together on a grid, anew at every instant, as reconstructions have it.

use super::SimulateError;
use super::figure::Body;
use super::shape::Part;
use super::world::{World, srgb_code};
use glam::{DVec3, UVec3};
use videofields_vision::hull::{Crossings, Occupancy, surface};
use videofields_vision::mesh::{Mesh, MeshError};

/// Least and greatest step of the grid, metres.
pub(super) const STEPS_M: [f64; 2] = [0.005, 0.5];

/// How far outside of a body the places of a grid are, about.
struct Distances {
    values: Vec<f64>,
    size: [u32; 3],
}

impl Distances {
    fn idx(&self, [x, y, z]: [u32; 3]) -> usize {
        let [width, height, _] = self.size;
        (z as usize * height as usize + y as usize) * width as usize + x as usize
    }
}

impl Crossings for Distances {
    fn share(&self, axis: usize, lower: [u32; 3], _: &Occupancy) -> Option<f64> {
        let mut upper = lower;
        upper[axis] += 1;
        let [from, to] = [lower, upper].map(|at| self.values[self.idx(at)]);
        // Of points that were added in mending both are on one side.
        (from < 0.0 || to < 0.0).then(|| from / (from - to)).filter(|share| (0.0..=1.0).contains(share))
    }
}

impl World {
    /// Everybody and everything that moves at an instant, as one mesh in which each body is closed; no triangles where nobody is.
    /// `step_m` is the grid's step, 0.005 to 0.5 m: triangles are about as large. Their colours are the parts' own, without light.
    ///
    /// # Errors
    /// When the time is not a finite number, the step is out of its range, or a body too large for it.
    pub fn figures_mesh(&self, time_secs: f64, step_m: f64) -> Result<Mesh, SimulateError> {
        if !(STEPS_M[0]..=STEPS_M[1]).contains(&step_m) {
            return Err(SimulateError::View { field: "the mesh's step", allowed: "0.005 to 0.5 m" });
        }
        let (mut positions_m, mut colors, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
        for body in self.bodies(time_secs)?.iter().filter(|body| body.is_present()) {
            let mesh = match body_mesh(body, step_m) {
                Err(MeshError::Empty) => continue,
                found => found.map_err(SimulateError::Mesh)?,
            };
            let first = positions_m.len() as u32;
            colors.extend(mesh.positions_m.iter().map(|at| color(&body.parts, *at)));
            positions_m.extend(mesh.positions_m);
            triangles.extend(mesh.triangles.into_iter().map(|corners| corners.map(|corner| corner + first)));
        }
        Ok(Mesh { colors_srgb: Some(colors), ..Mesh::new(positions_m, triangles) })
    }
}

fn body_mesh(body: &Body, step_m: f64) -> Result<Mesh, MeshError> {
    // On one grid of the world, so that what stands still has the same mesh at every instant.
    let (low, high) = body.bounds;
    let first = (low / step_m).floor() - 1.0;
    let size = ((high / step_m).ceil() + 1.0 - first).as_uvec3() + 1;
    let mut occupancy = Occupancy::new(size.to_array(), first * step_m, step_m)?;
    let n_places = size.x as usize * size.y as usize * size.z as usize;
    let mut distances = Distances { values: vec![f64::INFINITY; n_places], size: size.to_array() };
    for part in &body.parts {
        let (low, high) = part.shape.bounds();
        // And one step around it, so that both ends of what it crosses are known.
        let from = ((low / step_m).floor() - first - 1.0).max(DVec3::ZERO).as_uvec3();
        let to = ((high / step_m).ceil() - first + 1.0).as_uvec3().min(size - 1);
        for at in places(from, to) {
            let idx = distances.idx(at);
            let value = &mut distances.values[idx];
            *value = value.min(part.shape.outside_m(occupancy.place(at)));
        }
    }
    for at in places(UVec3::ZERO, size - 1).filter(|at| distances.values[distances.idx(*at)] < 0.0) {
        occupancy.set(at);
    }
    surface(&mut occupancy, &distances)
}

/// All places of a grid from one corner to another.
fn places(from: UVec3, to: UVec3) -> impl Iterator<Item = [u32; 3]> {
    let rows = (from.z..=to.z).flat_map(move |z| (from.y..=to.y).map(move |y| [y, z]));
    rows.flat_map(move |[y, z]| (from.x..=to.x).map(move |x| [x, y, z]))
}

/// The colour of the part that a place is on.
fn color(parts: &[Part], at: DVec3) -> [u8; 3] {
    let away = |part: &&Part| part.shape.outside_m(at).abs();
    let nearest = parts.iter().min_by(|a, b| away(a).total_cmp(&away(b)));
    nearest.map_or([0; 3], |part| part.color.to_array().map(srgb_code))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walkers_are_closed_meshes_where_their_bodies_are() {
        let world = World::plaza();
        let mesh = world.figures_mesh(3.0, 0.04).unwrap();
        mesh.check().expect("closed");
        let figures = world.figures(3.0).unwrap();
        assert!(figures.len() > 1);
        let bodies = world.bodies(3.0).unwrap();
        for at in &mesh.positions_m {
            let away = |body: &Body| {
                body.parts.iter().map(|part| part.shape.outside_m(*at).abs()).fold(f64::INFINITY, f64::min)
            };
            let off_m =
                bodies.iter().filter(|body| body.is_present()).map(away).fold(f64::INFINITY, f64::min);
            assert!(off_m < 0.04, "{at} is {off_m} m beside");
        }
        // Everybody is there, from foot to head.
        for figure in figures {
            let (low, high) = figure.box_in_world;
            let own: Vec<_> = mesh
                .positions_m
                .iter()
                .filter(|at| at.cmpge(low - 0.05).all() && at.cmple(high + 0.05).all())
                .collect();
            let top = own.iter().map(|at| at.z).fold(f64::NEG_INFINITY, f64::max);
            let bottom = own.iter().map(|at| at.z).fold(f64::INFINITY, f64::min);
            assert!(
                (top - high.z).abs() < 0.06 && (bottom - low.z).abs() < 0.06,
                "{}: {bottom} to {top}",
                figure.name
            );
        }
        // Topology changes, and what is asked for twice is the same.
        assert_eq!(world.figures_mesh(3.0, 0.04).unwrap(), mesh);
        assert_ne!(world.figures_mesh(3.1, 0.04).unwrap().triangles.len(), mesh.triangles.len());
        for step_m in [0.0, f64::NAN, 1.0] {
            assert!(world.figures_mesh(3.0, step_m).is_err());
        }
    }
}
