//! A scene's ground and boxes as triangles in the world, f64, counter-clockwise seen from outside or above.

use crate::frame::linear_from_srgb;
use crate::geometry::{GroundPolygon, OrientedBox};
use crate::scene::{Material, Scene};
use glam::{DVec3, Vec3};

/// One corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeshVertex {
    pub position_in_world: DVec3,
    /// Unit vector, outwards or upwards.
    pub normal: Vec3,
    /// What the surface looks like where no camera sees it, linear light.
    pub material: Vec3,
}

/// Towards the light that untextured boxes are shaded by, so that they read as solids: from the south-west, high.
/// Level ground gets exactly its material's colour.
const TO_LIGHT: Vec3 = Vec3::new(-0.36, -0.48, 0.8);
/// Share of the light that comes from everywhere.
const AMBIENT: f32 = 0.6;

/// Three vertices a triangle.
pub(super) fn triangles(scene: &Scene) -> Vec<MeshVertex> {
    let mut vertices = Vec::new();
    let fallback = Material { color_srgb: [128; 3] };
    let material = |materials: &[Material], idx: usize| materials.get(idx).copied().unwrap_or(fallback);
    for (idx, polygon) in scene.surfaces.ground.iter().enumerate() {
        append_ground(polygon, material(&scene.ground_materials, idx), &mut vertices);
    }
    for (idx, solid) in scene.surfaces.boxes.iter().enumerate() {
        append_box(solid, material(&scene.box_materials, idx), &mut vertices);
    }
    vertices
}

fn shaded(material: Material, normal: Vec3) -> Vec3 {
    let color = Vec3::from(material.color_srgb.map(|code| linear_from_srgb(f32::from(code) / 255.0)));
    color * (AMBIENT + (1.0 - AMBIENT) * normal.dot(TO_LIGHT).max(0.0) / TO_LIGHT.z).min(1.0)
}

fn append_ground(polygon: &GroundPolygon, material: Material, vertices: &mut Vec<MeshVertex>) {
    // Relative to a corner, so that the triangulation keeps its digits at map coordinates.
    let corners = polygon.corners();
    let origin = corners[0];
    let mut indices: Vec<u32> = Vec::new();
    earcut::Earcut::new().earcut(
        corners.iter().map(|corner| (*corner - origin).to_array()),
        &[],
        &mut indices,
    );
    let (ears, _) = indices.as_chunks::<3>();
    for ear in ears {
        let [a, mut b, mut c] = ear.map(|idx| corners[idx as usize]);
        if (b - a).perp_dot(c - a) < 0.0 {
            std::mem::swap(&mut b, &mut c);
        }
        vertices.extend([a, b, c].map(|corner| MeshVertex {
            position_in_world: corner.extend(polygon.height_m()),
            normal: Vec3::Z,
            material: shaded(material, Vec3::Z),
        }));
    }
}

fn append_box(solid: &OrientedBox, material: Material, vertices: &mut Vec<MeshVertex>) {
    let half = solid.half_size();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut outward = DVec3::ZERO;
            outward[axis] = side;
            // Two directions along the face whose cross product points outwards.
            let mut along = DVec3::ZERO;
            along[(axis + 1) % 3] = 1.0;
            let across = outward.cross(along);
            let corner =
                |u: f64, v: f64| solid.world_from_box_point((outward + along * u + across * v) * half);
            let normal = (solid.world_from_box_point(outward) - solid.center()).normalize().as_vec3();
            let quad = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            vertices.extend([0, 1, 2, 0, 2, 3].map(|idx| MeshVertex {
                position_in_world: quad[idx],
                normal,
                material: shaded(material, normal),
            }));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    fn normal_of(triangle: &[MeshVertex]) -> DVec3 {
        let [a, b, c] = [0, 1, 2].map(|idx| triangle[idx].position_in_world);
        (b - a).cross(c - a)
    }

    #[test]
    fn ground_keeps_its_area_and_faces_up_either_way_round() {
        let offset = DVec2::new(5e5, 5e6);
        let mut corners: Vec<DVec2> = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0), (0.0, 4.0)]
            .map(|c| DVec2::from(c) + offset)
            .into();
        for _ in 0..2 {
            let polygon = GroundPolygon::new(corners.clone(), 1.5).expect("a polygon");
            let mut vertices = Vec::new();
            append_ground(&polygon, Material { color_srgb: [200; 3] }, &mut vertices);
            let areas: Vec<f64> = vertices.chunks_exact(3).map(|t| normal_of(t).z * 0.5).collect();
            assert!(areas.iter().all(|area| *area > 0.0), "{areas:?}");
            assert!((areas.iter().sum::<f64>() - 10.0).abs() < 1e-6, "{areas:?}");
            corners.reverse();
        }
    }

    #[test]
    fn a_box_faces_outwards_on_all_sides() {
        let center = DVec3::new(5.0, -3.0, 2.0);
        let solid = OrientedBox::new(center, DVec3::new(2.0, 6.0, 4.0), 0.7).expect("a box");
        let mut vertices = Vec::new();
        append_box(&solid, Material { color_srgb: [200; 3] }, &mut vertices);
        assert_eq!(vertices.len(), 36);
        for triangle in vertices.chunks_exact(3) {
            let normal = normal_of(triangle);
            let middle = triangle.iter().map(|vertex| vertex.position_in_world).sum::<DVec3>() / 3.0;
            assert!(normal.dot(middle - center) > 0.0);
            assert!(normal.normalize().as_vec3().dot(triangle[0].normal) > 0.9999);
        }
        let area: f64 = vertices.chunks_exact(3).map(|t| normal_of(t).length() * 0.5).sum();
        assert!((area - 88.0).abs() < 1e-9);
    }
}
