//! Places on the faces of shapes, by which a picture is spread over them.

use super::{Shape, Triangle};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// What of a shape a picture can be spread over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SheetKind {
    /// Upright: along the face, seen from outside to the right, and upwards.
    Wall,
    /// Seen from above: roofs along the shape's own x and y, ground along the world's.
    Level,
}

/// A triangle on the face that it belongs to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Which kind of face it is.
    pub kind: SheetKind,
    /// The triangle's corners, metres from the face's lower left corner.
    pub corners_m: [DVec2; 3],
    /// The length after which the face closes on itself, metres: around a cylinder.
    pub around_m: Option<f64>,
}

impl Shape {
    /// Where one of the triangles that are drawn for the shape lies on its face; `None` on an under side and on models,
    /// which have coordinates of their own.
    #[must_use]
    pub fn sheet(&self, triangle: &Triangle) -> Option<Sheet> {
        let Triangle { corners, normal, part } = triangle;
        let level = |origin: DVec3, turn: DVec2| {
            let corners_m = corners.map(|corner| turned_back(turn, (corner - origin).truncate()));
            Some(Sheet { kind: SheetKind::Level, corners_m, around_m: None })
        };
        let wall = |origin: DVec3| {
            // To the right for whom the normal points at.
            let along = DVec3::Z.cross(*normal);
            let corners_m =
                corners.map(|corner| DVec2::new((corner - origin).dot(along), corner.z - origin.z));
            Some(Sheet { kind: SheetKind::Wall, corners_m, around_m: None })
        };
        match (self, part) {
            (Self::Ground(_), _) => level(self.bounds().0, DVec2::X),
            (Self::HeightField(field), _) => level(field.origin().extend(0.0), DVec2::X),
            (Self::Box(_), 5) | (Self::Cylinder(_) | Self::Footprint(_), 1) | (Self::Model(_), _) => None,
            (Self::Box(solid), 4) => {
                let x_axis = solid.world_from_box_point(DVec3::X) - solid.center();
                level(solid.world_from_box_point(-solid.half_size()), x_axis.truncate())
            }
            (Self::Box(solid), _) => {
                let along = DVec3::Z.cross(*normal);
                let half = solid.half_size();
                let half_along = if *part < 2 { half.y } else { half.x };
                let half_out = if *part < 2 { half.x } else { half.y };
                wall(solid.center() + *normal * half_out - along * half_along - DVec3::Z * half.z)
            }
            (Self::Cylinder(_) | Self::Footprint(_), 0) => level(self.bounds().0, DVec2::X),
            (Self::Cylinder(cylinder), _) => {
                let (base, radius_m) = (cylinder.base(), cylinder.radius_m());
                let middle = normal.truncate();
                // Counted from east; the triangle's middle decides, so that the last side does not go back to 0.
                let turn = middle.to_angle().rem_euclid(TAU);
                let corners_m = corners.map(|corner| {
                    let beside = middle.angle_to((corner - base).truncate());
                    DVec2::new((turn + beside) * radius_m, corner.z - base.z)
                });
                Some(Sheet { kind: SheetKind::Wall, corners_m, around_m: Some(TAU * radius_m) })
            }
            (Self::Footprint(footprint), wall_part) => {
                let [base_m, _] = footprint.base_and_top_m();
                let corner = footprint.corners().get(*wall_part as usize - 2)?;
                wall(corner.extend(base_m))
            }
        }
    }
}

/// A vector in axes that are turned from the world's by a unit vector's angle.
fn turned_back(turn: DVec2, vector: DVec2) -> DVec2 {
    DVec2::new(turn.dot(vector), turn.perp_dot(vector))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cylinder, ExtrudedFootprint, GroundPolygon, HeightField, OrientedBox};

    /// Least and greatest coordinates of each kind of face, by part.
    fn extents(shape: &Shape) -> Vec<(u32, SheetKind, DVec2, DVec2)> {
        let mut found: Vec<(u32, SheetKind, DVec2, DVec2)> = Vec::new();
        shape.triangles(&mut |triangle| {
            let Some(sheet) = shape.sheet(&triangle) else { return };
            // Lengths are kept, and seen from the normal's side nothing is mirrored.
            let [a, b, c] = sheet.corners_m;
            let [p, q, r] = triangle.corners;
            let is_flat =
                sheet.around_m.is_none() && triangle.normal.z.abs() != 1.0 || triangle.normal.z == 1.0;
            if is_flat {
                let (area, seen) = ((q - p).cross(r - p).dot(triangle.normal), (b - a).perp_dot(c - a));
                assert!((area - seen).abs() < 1e-6 * area, "{triangle:?} {sheet:?}");
            }
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            match found.iter_mut().find(|(part, ..)| *part == triangle.part) {
                Some(known) => (known.2, known.3) = (known.2.min(low), known.3.max(high)),
                None => found.push((triangle.part, sheet.kind, low, high)),
            }
        });
        found.sort_by_key(|(part, ..)| *part);
        found
    }

    fn check(shape: &Shape, expected: &[(u32, SheetKind, [f64; 2])]) {
        let found = extents(shape);
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for ((part, kind, low, high), (expected_part, expected_kind, size)) in found.iter().zip(expected) {
            assert_eq!((part, kind), (expected_part, expected_kind));
            // Map coordinates leave 1e-9 m.
            assert!(low.abs().max_element() < 1e-8, "part {part} begins at {low}");
            assert!(
                (*high - DVec2::from_array(*size)).abs().max_element() < 1e-8,
                "part {part} ends at {high}"
            );
        }
    }

    #[test]
    fn faces_begin_at_their_lower_left_corner_at_any_coordinates() {
        use SheetKind::{Level, Wall};
        for at in [DVec3::ZERO, DVec3::new(5e5, 5e6, 130.0)] {
            for yaw in [0.0, 0.7, -2.0] {
                let solid = OrientedBox::new(at, DVec3::new(2.0, 6.0, 4.0), yaw).unwrap();
                let sides = [(0, Wall, [6.0, 4.0]), (1, Wall, [6.0, 4.0]), (2, Wall, [2.0, 4.0])];
                let rest = [(3, Wall, [2.0, 4.0]), (4, Level, [2.0, 6.0])];
                check(&Shape::Box(solid), &[sides.as_slice(), &rest].concat());
            }
            let outline = [[0.0, 0.0], [0.0, 5.0], [8.0, 5.0], [8.0, 0.0]];
            let outline: Vec<DVec2> =
                outline.map(|corner| DVec2::from_array(corner) + at.truncate()).to_vec();
            let house = ExtrudedFootprint::new(outline.clone(), at.z, at.z + 3.0).unwrap();
            let walls = [(0, Level, [8.0, 5.0]), (2, Wall, [8.0, 3.0]), (3, Wall, [5.0, 3.0])];
            let more = [(4, Wall, [8.0, 3.0]), (5, Wall, [5.0, 3.0])];
            let found = extents(&Shape::Footprint(house.clone()));
            // Which wall is the first is the outline's matter.
            let swapped = found[1].3.x < 6.0;
            let walls = if swapped {
                [(0, Level, [8.0, 5.0]), (2, Wall, [5.0, 3.0]), (3, Wall, [8.0, 3.0])]
            } else {
                walls
            };
            let more = if swapped { [(4, Wall, [5.0, 3.0]), (5, Wall, [8.0, 3.0])] } else { more };
            check(&Shape::Footprint(house), &[walls.as_slice(), &more].concat());
            check(&Shape::Ground(GroundPolygon::new(outline, at.z).unwrap()), &[(0, Level, [8.0, 5.0])]);
            let tank = Cylinder::new(at, 2.0, 4.0).unwrap();
            check(&Shape::Cylinder(tank), &[(0, Level, [4.0, 4.0]), (2, Wall, [TAU * 2.0, 4.0])]);
        }
    }

    #[test]
    fn a_wall_reads_from_left_to_right_for_whom_stands_before_it() {
        let solid = OrientedBox::new(DVec3::ZERO, DVec3::new(4.0, 2.0, 2.0), 0.0).unwrap();
        let shape = Shape::Box(solid);
        let mut n_checked = 0;
        shape.triangles(&mut |triangle| {
            // South: x is to the right; north: to the left.
            if triangle.normal.y.abs() != 1.0 {
                return;
            }
            let sign = -triangle.normal.y;
            let places = shape.sheet(&triangle).expect("a wall").corners_m;
            for (corner, place) in triangle.corners.iter().zip(places) {
                assert_eq!(place, DVec2::new(2.0 + sign * corner.x, corner.z + 1.0));
                n_checked += 1;
            }
        });
        assert_eq!(n_checked, 12);
    }

    #[test]
    fn height_fields_are_measured_from_their_first_post() {
        let field = HeightField::new(DVec2::new(5e5, 5e6), 0.5, 3, vec![1.0; 9]).unwrap();
        let shape = Shape::HeightField(field);
        let mut high = DVec2::ZERO;
        shape.triangles(&mut |triangle| {
            for place in shape.sheet(&triangle).expect("ground").corners_m {
                assert!(place.min_element() >= 0.0);
                high = high.max(place);
            }
        });
        assert_eq!(high, DVec2::ONE);
    }
}
