//! A scene's surfaces as triangles in the world, f64, counter-clockwise seen from outside or above.

use glam::{DVec3, Vec3, Vec4};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use videofields_picture::scene::{Material, Scene, Texture};
use videofields_vision::frame::linear_from_srgb;
use videofields_vision::geometry::{Pose, Shape, SurfaceId, Triangle};

/// One corner of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MeshVertex {
    pub position_in_world: DVec3,
    /// Unit vector, outwards or upwards.
    pub normal: Vec3,
    /// What the surface looks like where no camera sees it, linear light.
    pub material: Vec3,
    /// Homogeneous texture coordinate s, t, q, linear over the triangle, and 1 where the plain colour shows beyond the picture,
    /// else 0. Means nothing on what is plain.
    pub texture: Vec4,
    /// What the picture is multiplied by, linear light.
    pub tint: Vec3,
    /// By which share of its depth it is drawn nearer than it is: [`super::coplanar`].
    pub nearer: f32,
}

/// Which part of its surface a triangle is of, and the place of the picture on it.
pub(super) type PartAndPicture = (u32, Option<usize>);

/// The triangles of one scene.
#[derive(Debug)]
pub(super) struct Mesh {
    pub scene: Arc<Scene>,
    /// Another for every mesh that a renderer makes.
    pub number: u64,
    /// Three a triangle.
    pub vertices: Vec<MeshVertex>,
    /// Which of the vertices are of which surface, in their order.
    pub ranges: Vec<(SurfaceId, Range<u32>)>,
    /// The pictures on it, each once.
    pub textures: Vec<Arc<Texture>>,
    /// Of every triangle, in their order, its part of the surface and the place of the picture on it.
    pub triangles: Vec<PartAndPicture>,
    /// Least and greatest coordinates; `None` of nothing.
    bounds: Option<[DVec3; 2]>,
}

impl Mesh {
    pub(super) fn new(scene: &Arc<Scene>, number: u64) -> Self {
        let mut mesh = Self {
            scene: Arc::clone(scene),
            number,
            vertices: Vec::new(),
            ranges: Vec::new(),
            textures: Vec::new(),
            triangles: Vec::new(),
            bounds: scene.surfaces.bounds(),
        };
        let fallback = Material::plain([128; 3]);
        let mut places = HashMap::new();
        for (place, (surface, shape)) in scene.surfaces.named().enumerate() {
            let first = mesh.vertices.len() as u32;
            mesh.append(shape, scene.materials.get(place).unwrap_or(&fallback), &mut places);
            mesh.ranges.push((surface, first..mesh.vertices.len() as u32));
        }
        super::coplanar::rank(&mut mesh.vertices, &mesh.ranges, mesh.bounds);
        mesh
    }

    fn append(&mut self, shape: &Shape, material: &Material, places: &mut HashMap<*const Texture, usize>) {
        let paint = material.paint.as_deref();
        shape.triangles(&mut |triangle| {
            let corners = plain(&triangle, material);
            let Some(painted) = paint.and_then(|paint| paint.on(shape, &triangle)) else {
                self.vertices.extend(corners);
                self.triangles.push((triangle.part, None));
                return;
            };
            let place = *places.entry(Arc::as_ptr(painted.picture)).or_insert_with(|| {
                self.textures.push(Arc::clone(painted.picture));
                self.textures.len() - 1
            });
            let light = Vec3::splat(light(corners[0].normal));
            self.vertices.extend([0, 1, 2].map(|idx| MeshVertex {
                texture: painted.corners[idx].as_vec3().extend(f32::from(u8::from(painted.ends))),
                tint: if painted.is_tinted { corners[idx].material } else { light },
                ..corners[idx]
            }));
            self.triangles.push((triangle.part, Some(place)));
        });
    }

    /// Of all surfaces, and of what is drawn beside them.
    fn bounds_with(&self, beyond: Option<[DVec3; 2]>) -> Option<[DVec3; 2]> {
        let both = |[low, high]: [DVec3; 2], [a, b]: [DVec3; 2]| [low.min(a), high.max(b)];
        self.bounds.into_iter().chain(beyond).reduce(both)
    }

    /// What points are relative to, seen from `eye`: the eye itself, unless it is so far away that single precision could
    /// not tell the scene's points apart; then the scene's nearest corner or side.
    pub(super) fn anchor(&self, eye: DVec3, beyond: Option<[DVec3; 2]>) -> DVec3 {
        let Some([low, high]) = self.bounds_with(beyond) else { return eye };
        let nearest = eye.clamp(low, high);
        let is_far = eye.distance(nearest) > FAR_TIMES * low.distance(high);
        if is_far { nearest } else { eye }
    }

    /// Between which distances before the plane through a view's eye the scene lies, metres, with room for what stands at
    /// its edge. None of it needs lie before the eye; the last is greater than 0 and than the first.
    pub(super) fn depths_m(&self, pose: &Pose, beyond: Option<[DVec3; 2]>) -> [f64; 2] {
        let Some(bounds) = self.bounds_with(beyond) else { return [0.0, ROOM_M] };
        let corner =
            |idx: usize| DVec3::new(bounds[idx & 1].x, bounds[idx >> 1 & 1].y, bounds[idx >> 2 & 1].z);
        let depths = (0..8).map(|idx| pose.local_from_world_point(corner(idx)).z);
        let [nearest_m, farthest_m] = depths
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], depth| [low.min(depth), high.max(depth)]);
        [nearest_m - ROOM_M, farthest_m.max(0.0) + ROOM_M]
    }
}

/// From how many times the scene's extent away an eye is far.
const FAR_TIMES: f64 = 4.0;

/// How far beyond the surfaces something may stand, metres.
const ROOM_M: f64 = 50.0;

/// Towards the light that untextured boxes are shaded by, so that they read as solids: from the south-west, high.
/// Level ground gets exactly its material's colour.
const TO_LIGHT: Vec3 = Vec3::new(-0.36, -0.48, 0.8);
/// Share of the light that comes from everywhere.
const AMBIENT: f32 = 0.6;

/// The corners of a triangle without a picture.
fn plain(triangle: &Triangle, material: &Material) -> [MeshVertex; 3] {
    let normal = triangle.normal.as_vec3();
    let color = material.part_srgb(triangle.part).map(|code| linear_from_srgb(f32::from(code) / 255.0));
    let material = Vec3::from(color) * light(normal);
    triangle.corners.map(|position_in_world| MeshVertex {
        position_in_world,
        normal,
        material,
        texture: Vec4::ZERO,
        tint: Vec3::ZERO,
        nearer: 0.0,
    })
}

/// How much light falls on what faces there: 0 to 1.
fn light(normal: Vec3) -> f32 {
    (AMBIENT + (1.0 - AMBIENT) * normal.dot(TO_LIGHT).max(0.0) / TO_LIGHT.z).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;
    use videofields_vision::geometry::{GroundPolygon, OrientedBox};

    fn normal_of(triangle: &[MeshVertex]) -> DVec3 {
        let [a, b, c] = [0, 1, 2].map(|idx| triangle[idx].position_in_world);
        (b - a).cross(c - a)
    }

    fn vertices_of(shape: &Shape) -> Vec<MeshVertex> {
        let mut vertices = Vec::new();
        shape.triangles(&mut |triangle| vertices.extend(plain(&triangle, &Material::plain([200; 3]))));
        vertices
    }

    #[test]
    fn ground_keeps_its_area_and_faces_up_either_way_round() {
        let offset = DVec2::new(5e5, 5e6);
        let mut corners: Vec<DVec2> = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 1.0), (0.0, 4.0)]
            .map(|c| DVec2::from(c) + offset)
            .into();
        for _ in 0..2 {
            let polygon = GroundPolygon::new(corners.clone(), 1.5).expect("a polygon");
            let vertices = vertices_of(&Shape::Ground(polygon));
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
        let vertices = vertices_of(&Shape::Box(solid));
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
