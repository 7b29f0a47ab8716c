//! Faces of several surfaces in one plane: which of them is seen where they cover one another.
//!
//! Depths of such faces differ by rounding alone, another way in every picture, so that they would flicker. The later surface
//! is taken to lie before the earlier one: ground that is laid over other ground, a sign on a wall. It is drawn with a depth
//! that is a little nearer, by a share of itself (as decals are, with what is known of the faces in place of a fixed bias);
//! where it is drawn does not change, so that nothing gapes.

use super::mesh::MeshVertex;
use glam::DVec3;
use std::collections::HashMap;
use std::ops::Range;
use videofields_vision::geometry::SurfaceId;

/// By how much the depth of a face is nearer than that of the one before it in its plane, of itself: more than rounding of
/// interpolated depths, and 3 mm at 100 m.
const NEARER: f32 = 3e-5;

/// Faces that lie one over another and are told apart; later ones count as the last of these.
const MOST_OVER: u8 = 15;

/// Normals that differ by no more than about this are one direction, and planes that lie no farther apart than about this, of
/// the scene's extent, are one.
const SAME: f64 = 1e-6;

/// What a surface has in one plane.
#[derive(Clone, Debug)]
struct Face {
    low: DVec3,
    high: DVec3,
    /// How many lie below it.
    rank: u8,
}

impl Face {
    fn touches(&self, other: &Self, room_m: f64) -> bool {
        (self.low - room_m).cmple(other.high).all() && (other.low - room_m).cmple(self.high).all()
    }
}

/// A plane among all planes: components of its normal and its distance from the scene's middle, counted in [`SAME`].
type Place = [f64; 4];
type Cell = [i64; 4];

/// Sets of the vertices of `surfaces` how much nearer they are drawn. `bounds` are the scene's.
///
/// **Cost** linear in triangles, each of which is looked up among those planes that rounding may have made of its own.
pub(super) fn rank(
    vertices: &mut [MeshVertex],
    surfaces: &[(SurfaceId, Range<u32>)],
    bounds: Option<[DVec3; 2]>,
) {
    let Some([low, high]) = bounds else { return };
    let (middle, room_m) = (0.5 * (low + high), SAME * low.distance(high));
    let mut known: HashMap<Cell, Vec<Face>> = HashMap::new();
    for (_, range) in surfaces {
        let own = &mut vertices[range.start as usize..range.end as usize];
        // Of each plane of this surface what lies in it.
        let mut places: HashMap<Cell, usize> = HashMap::new();
        let mut faces: Vec<(Place, Face)> = Vec::new();
        let mut of_triangles: Vec<usize> = Vec::with_capacity(own.len() / 3);
        for triangle in own.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|corner| triangle[corner].position_in_world);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let distance_m = normal.dot(a - middle);
            let place = [normal.x / SAME, normal.y / SAME, normal.z / SAME, distance_m / room_m];
            let idx = *places.entry(place.map(nearest)).or_insert_with(|| {
                faces.push((place, Face { low: a, high: a, rank: 0 }));
                faces.len() - 1
            });
            let face = &mut faces[idx].1;
            face.low = face.low.min(a).min(b).min(c);
            face.high = face.high.max(a).max(b).max(c);
            of_triangles.push(idx);
        }
        for (place, face) in &mut faces {
            let below = around(*place).filter_map(|cell| known.get(&cell)).flatten();
            let below = below.filter(|below| below.touches(face, room_m)).map(|below| below.rank).max();
            face.rank = below.map_or(0, |rank| (rank + 1).min(MOST_OVER));
        }
        for (triangle, idx) in own.chunks_exact_mut(3).zip(of_triangles) {
            let nearer = NEARER * f32::from(faces[idx].1.rank);
            triangle.iter_mut().for_each(|vertex| vertex.nearer = nearer);
        }
        for (place, face) in faces {
            known.entry(place.map(nearest)).or_default().push(face);
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates, and is no number only where a scene has no extent"
)]
const fn nearest(value: f64) -> i64 {
    value.round() as i64
}

/// The cells in which places are that differ by less than half a cell.
fn around(place: Place) -> impl Iterator<Item = Cell> {
    let ends = place.map(|value| [value.floor(), value.ceil()]);
    (0..16).map(move |idx: usize| [0, 1, 2, 3].map(|axis| nearest(ends[axis][idx >> axis & 1])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Mesh;
    use glam::DVec2;
    use std::sync::Arc;
    use videofields_picture::scene::{Scene, no_imports, parse};
    use videofields_vision::geometry::{GroundPolygon, OrientedBox, Shape, Surfaces};

    fn ground(middle: DVec2, half_m: f64, height_m: f64) -> Shape {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let corners = corners.map(|corner| middle + half_m * DVec2::from(corner));
        Shape::Ground(GroundPolygon::new(corners.to_vec(), height_m).expect("ground"))
    }

    /// Of every shape, in the order of surfaces, by how much its triangles are nearer, in steps.
    fn ranks(shapes: Vec<Shape>) -> Vec<Vec<u8>> {
        let empty = parse("a", r#"{"version": 1}"#, no_imports).unwrap().scene;
        let scene = Arc::new(Scene { surfaces: Surfaces::new(shapes), ..empty });
        let mesh = Mesh::new(&scene, 1);
        let of = |range: &Range<u32>| {
            let vertices = &mesh.vertices[range.start as usize..range.end as usize];
            vertices.chunks_exact(3).map(|triangle| (triangle[0].nearer / NEARER).round() as u8).collect()
        };
        mesh.ranges.iter().map(|(_, range)| of(range)).collect()
    }

    #[test]
    fn what_is_laid_over_others_lies_before_them_wherever_they_are() {
        for offset in [DVec2::ZERO, DVec2::new(5e5, 5e6), DVec2::splat(1e7)] {
            let at =
                |x: f64, half_m: f64, height_m: f64| ground(offset + DVec2::new(x, 0.3), half_m, height_m);
            // Lawn, path over it, mat over both; beside them, and a step above them.
            let found = ranks(vec![
                at(0.0, 20.0, 7.1),
                at(1.0, 5.0, 7.1),
                at(2.0, 1.0, 7.1),
                at(60.0, 5.0, 7.1),
                at(0.0, 3.0, 7.2),
            ]);
            assert_eq!(found, [[0; 2], [1; 2], [2; 2], [0; 2], [0; 2]], "{offset}");
        }
    }

    #[test]
    fn of_solids_only_faces_that_share_a_plane_and_a_side_are_told_apart() {
        let solid = |x: f64, depth_m: f64| {
            let center = DVec3::new(x, 0.5 * depth_m, 2.0);
            Shape::Box(OrientedBox::new(center, DVec3::new(4.0, depth_m, 3.0), 0.0).expect("a box"))
        };
        // Side by side and half over one another: fronts, tops and bottoms share planes, no sides and no backs do.
        let [first, second] = &ranks(vec![solid(0.0, 2.0), solid(2.0, 3.0)])[..] else { panic!("two boxes") };
        assert!(first.iter().all(|rank| *rank == 0), "{first:?}");
        assert_eq!(second.iter().filter(|rank| **rank == 1).count(), 6, "{second:?}");
        // Back to back they face one another, and neither covers the other.
        let [_, behind] = &ranks(vec![ground(DVec2::ZERO, 9.0, 0.5), solid(0.0, 2.0)])[..] else {
            panic!("ground and a box")
        };
        assert!(behind.iter().all(|rank| *rank == 0), "a box's bottom faces down: {behind:?}");
    }

    #[test]
    fn no_more_are_told_apart_than_depths_can_bear() {
        let found = ranks((0..40).map(|_| ground(DVec2::ZERO, 2.0, 0.0)).collect());
        assert_eq!(found.last(), Some(&vec![MOST_OVER; 2]));
        assert_eq!(found[3], [3, 3]);
    }
}
