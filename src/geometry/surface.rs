//! The scene's static surfaces as rays meet them: ground polygons and boxes.

use super::Ray;
use glam::{DMat2, DVec2, DVec3};

/// Which surface of a scene: an index into [`Surfaces`], ground polygons first, then boxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SurfaceId {
    /// Ground polygon by index.
    Ground(u16),
    /// Box by index.
    Box(u16),
}

/// Which side of a surface was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Face {
    /// The upper side of the ground, or the roof.
    Top,
    /// A wall.
    Side,
    /// The under side.
    Bottom,
}

/// A level polygon of ground.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundPolygon {
    corners: Vec<DVec2>,
    height_m: f64,
}

/// A box that stands upright, turned about the vertical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    center: DVec3,
    half_size: DVec3,
    world_from_box: DMat2,
}

/// Why numbers are no surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SurfaceError {
    /// A value is not a finite number, or further than 1e8 m from the origin.
    #[error("{field} must be finite and within 1e8 m of the scene's origin")]
    NotFinite {
        /// Which value.
        field: &'static str,
    },
    /// Too few or too many corners.
    #[error("a ground polygon has 3 to 4096 corners, got {count}")]
    CornerCount {
        /// How many there are.
        count: usize,
    },
    /// No area.
    #[error("a ground polygon needs an area of at least 1e-6 m2 and no edge may cross another")]
    NoArea,
    /// A box without extent.
    #[error("a box needs a size of 0.001 m to 100000 m each way")]
    BoxSize,
}

const FARTHEST_M: f64 = 1e8;

impl GroundPolygon {
    /// A polygon with `corners` (x, y in metres, either way round, first not repeated) at height z = `height_m`.
    ///
    /// # Errors
    /// When a number is not finite or too large, there are fewer than 3 or more than 4096 corners, the area is
    /// below 1e-6 m2, or two edges cross.
    pub fn new(corners: Vec<DVec2>, height_m: f64) -> Result<Self, SurfaceError> {
        if !(3..=4096).contains(&corners.len()) {
            return Err(SurfaceError::CornerCount { count: corners.len() });
        }
        let near = |value: f64| value.abs() <= FARTHEST_M;
        if !corners.iter().all(|corner| near(corner.x) && near(corner.y)) {
            return Err(SurfaceError::NotFinite { field: "a corner" });
        }
        if !near(height_m) {
            return Err(SurfaceError::NotFinite { field: "the height" });
        }
        if signed_area(&corners).abs() < 1e-6 || edges_cross(&corners) {
            return Err(SurfaceError::NoArea);
        }
        Ok(Self { corners, height_m })
    }

    /// The corners in the order given.
    #[must_use]
    pub fn corners(&self) -> &[DVec2] {
        &self.corners
    }

    /// Height of the polygon, metres.
    #[must_use]
    pub const fn height_m(&self) -> f64 {
        self.height_m
    }

    /// Whether the polygon covers (x, y), by the even-odd rule.
    #[must_use]
    pub fn covers(&self, point: DVec2) -> bool {
        let mut is_inside = false;
        for (a, b) in edges(&self.corners) {
            if (a.y > point.y) != (b.y > point.y) {
                let crossing_x = (point.y - a.y).mul_add((b.x - a.x) / (b.y - a.y), a.x);
                is_inside ^= point.x < crossing_x;
            }
        }
        is_inside
    }

    /// Between which shares of the way from `start` to `end`, 0 to 1, lies all of it that the polygon covers; `None` where
    /// it covers nothing of the way. What lies between the first and the last need not be covered.
    #[must_use]
    pub fn covered_part(&self, start: DVec2, end: DVec2) -> Option<(f64, f64)> {
        let way = end - start;
        let crossing = |(a, b): (DVec2, DVec2)| {
            let edge = b - a;
            // 0 along the edge, where its neighbours are crossed.
            let turn = way.perp_dot(edge);
            let (share, along_edge) = ((a - start).perp_dot(edge) / turn, (a - start).perp_dot(way) / turn);
            let is_met = (0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&along_edge);
            is_met.then_some(share)
        };
        let ends = [(start, 0.0), (end, 1.0)].into_iter();
        let shares = ends.filter(|(point, _)| self.covers(*point)).map(|(_, share)| share);
        shares.chain(edges(&self.corners).filter_map(crossing)).fold(None, |part, share| {
            let (first, last) = part.unwrap_or((share, share));
            Some((first.min(share), last.max(share)))
        })
    }

    fn hit(&self, ray: &Ray) -> Option<(f64, DVec3, Face)> {
        let distance = ray.distance_to_plane(DVec3::new(0.0, 0.0, self.height_m), DVec3::Z)?;
        if !self.covers(ray.at(distance).truncate()) {
            return None;
        }
        Some(if ray.direction.z < 0.0 {
            (distance, DVec3::Z, Face::Top)
        } else {
            (distance, -DVec3::Z, Face::Bottom)
        })
    }
}

fn edges(corners: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

fn signed_area(corners: &[DVec2]) -> f64 {
    // Relative to a corner, so that polygons far from the origin keep their digits.
    let origin = corners[0];
    0.5 * edges(corners).map(|(a, b)| (a - origin).perp_dot(b - origin)).sum::<f64>()
}

fn edges_cross(corners: &[DVec2]) -> bool {
    let edges: Vec<_> = edges(corners).collect();
    let side = |a: DVec2, b: DVec2, p: DVec2| (b - a).perp_dot(p - a);
    edges.iter().enumerate().any(|(i, &(a, b))| {
        edges[i + 1..]
            .iter()
            .any(|&(c, d)| side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0)
    })
}

impl OrientedBox {
    /// A box around `center` with full extents `size_m` along its own x, y and z, turned by `yaw_rad` (from
    /// east towards north).
    ///
    /// # Errors
    /// When a number is not finite or a size lies outside 0.001 m to 100 km.
    pub fn new(center: DVec3, size_m: DVec3, yaw_rad: f64) -> Result<Self, SurfaceError> {
        if !(center.abs().max_element() <= FARTHEST_M && center.is_finite()) {
            return Err(SurfaceError::NotFinite { field: "the center" });
        }
        if !yaw_rad.is_finite() {
            return Err(SurfaceError::NotFinite { field: "the yaw" });
        }
        if !(size_m.is_finite() && size_m.min_element() >= 1e-3 && size_m.max_element() <= 1e5) {
            return Err(SurfaceError::BoxSize);
        }
        Ok(Self { center, half_size: size_m * 0.5, world_from_box: DMat2::from_angle(yaw_rad) })
    }

    /// The middle of the box in the world.
    #[must_use]
    pub const fn center(&self) -> DVec3 {
        self.center
    }

    /// Half the extents along the box's own axes, metres.
    #[must_use]
    pub const fn half_size(&self) -> DVec3 {
        self.half_size
    }

    /// A point given in the box's own axes (from its middle) in the world.
    #[must_use]
    pub fn world_from_box_point(&self, point: DVec3) -> DVec3 {
        (self.world_from_box * point.truncate()).extend(point.z) + self.center
    }

    fn box_from_world_direction(&self, direction: DVec3) -> DVec3 {
        (self.world_from_box.transpose() * direction.truncate()).extend(direction.z)
    }

    /// Where the ray enters the box (leaves it, when it starts inside): distance, outward normal, face.
    fn hit(&self, ray: &Ray) -> Option<(f64, DVec3, Face)> {
        let origin = self.box_from_world_direction(ray.origin - self.center);
        let direction = self.box_from_world_direction(ray.direction);
        let (mut enter, mut enter_axis) = (f64::NEG_INFINITY, 0);
        let (mut leave, mut leave_axis) = (f64::INFINITY, 0);
        for axis in 0..3 {
            let (o, d, h) = (origin[axis], direction[axis], self.half_size[axis]);
            if d.abs() < 1e-15 {
                if o.abs() > h {
                    return None;
                }
                continue;
            }
            let (t0, t1) = ((-h - o) / d, (h - o) / d);
            let (near, far) = if t0 < t1 { (t0, t1) } else { (t1, t0) };
            if near > enter {
                (enter, enter_axis) = (near, axis);
            }
            if far < leave {
                (leave, leave_axis) = (far, axis);
            }
        }
        if enter > leave || leave <= 0.0 {
            return None;
        }
        let (distance, axis, sign) =
            if enter > 0.0 { (enter, enter_axis, -1.0) } else { (leave, leave_axis, 1.0) };
        let mut normal = DVec3::ZERO;
        normal[axis] = sign * direction[axis].signum();
        let face = match (axis, normal.z > 0.0) {
            (2, true) => Face::Top,
            (2, false) => Face::Bottom,
            _ => Face::Side,
        };
        Some((distance, (self.world_from_box * normal.truncate()).extend(normal.z), face))
    }
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, metres; above 0.
    pub distance_m: f64,
    /// The point in the world.
    pub point_in_world: DVec3,
    /// Unit normal of the surface, on the ray's side (outward, for a ray that starts in a box).
    pub normal_in_world: DVec3,
    /// Which surface.
    pub surface: SurfaceId,
    /// Which side of it.
    pub face: Face,
}

impl Hit {
    /// Angle between the ray and the surface, 0 (grazing) to pi/2 (square on): Video Fields' theta.
    #[must_use]
    pub fn angle_to_surface_rad(&self, ray: &Ray) -> f64 {
        ray.direction.dot(self.normal_in_world).abs().min(1.0).asin()
    }
}

/// All static surfaces of a scene.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Surfaces {
    /// Ground polygons.
    pub ground: Vec<GroundPolygon>,
    /// Boxes.
    pub boxes: Vec<OrientedBox>,
}

impl Surfaces {
    /// The nearest surface that the ray meets, further than `min_distance_m` from its start.
    #[must_use]
    pub fn hit(&self, ray: &Ray, min_distance_m: f64) -> Option<Hit> {
        let ground = self
            .ground
            .iter()
            .enumerate()
            .filter_map(|(i, g)| Some((g.hit(ray)?, SurfaceId::Ground(i as u16))));
        let boxes =
            self.boxes.iter().enumerate().filter_map(|(i, b)| Some((b.hit(ray)?, SurfaceId::Box(i as u16))));
        let ((distance_m, normal_in_world, face), surface) = ground
            .chain(boxes)
            .filter(|((distance, ..), _)| *distance > min_distance_m)
            .min_by(|((a, ..), _), ((b, ..), _)| a.total_cmp(b))?;
        Some(Hit { distance_m, point_in_world: ray.at(distance_m), normal_in_world, surface, face })
    }

    /// Where the ray meets one of the surfaces, which must be one of these: distance, metres, above 0; unit normal
    /// as in [`Hit`]; side.
    pub(crate) fn hit_of(&self, surface: SurfaceId, ray: &Ray) -> Option<(f64, DVec3, Face)> {
        match surface {
            SurfaceId::Ground(idx) => self.ground[usize::from(idx)].hit(ray),
            SurfaceId::Box(idx) => self.boxes[usize::from(idx)].hit(ray),
        }
    }

    /// Least and greatest coordinates of the ground; `None` without any.
    #[must_use]
    pub fn ground_bounds(&self) -> Option<[DVec3; 2]> {
        let corners = |polygon: &GroundPolygon| {
            let height_m = polygon.height_m;
            polygon.corners.iter().map(move |corner| corner.extend(height_m)).collect::<Vec<_>>()
        };
        bounds_of(self.ground.iter().flat_map(corners))
    }

    /// Least and greatest coordinates of all surfaces; `None` without any.
    #[must_use]
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let corners = |solid: &OrientedBox| {
            let (solid, half) = (*solid, solid.half_size);
            let sign = |bit: usize| if bit == 0 { -1.0 } else { 1.0 };
            (0..8_usize).map(move |idx| {
                let side = DVec3::new(sign(idx & 1), sign(idx & 2), sign(idx & 4));
                solid.world_from_box_point(half * side)
            })
        };
        let ground = self.ground_bounds().into_iter().flatten();
        bounds_of(ground.chain(self.boxes.iter().flat_map(corners)))
    }

    /// Whether a box stands between two points (ground hides nothing that stands on it); the last 1 cm before
    /// `to` does not count.
    #[must_use]
    pub fn is_hidden(&self, from: DVec3, to: DVec3) -> bool {
        let Some(direction) = (to - from).try_normalize() else { return false };
        let ray = Ray { origin: from, direction };
        let length = (to - from).length();
        self.boxes.iter().any(|b| b.hit(&ray).is_some_and(|(distance, ..)| distance < length - 0.01))
    }
}

fn bounds_of(points: impl Iterator<Item = DVec3>) -> Option<[DVec3; 2]> {
    points.fold(None, |bounds, point| {
        let [low, high] = bounds.unwrap_or([point; 2]);
        Some([low.min(point), high.max(point)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(half: f64) -> Vec<DVec2> {
        vec![
            DVec2::new(-half, -half),
            DVec2::new(half, -half),
            DVec2::new(half, half),
            DVec2::new(-half, half),
        ]
    }

    fn ray(origin: DVec3, target: DVec3) -> Ray {
        Ray { origin, direction: (target - origin).normalize() }
    }

    #[test]
    fn the_nearest_surface_is_met() {
        let surfaces = Surfaces {
            ground: vec![GroundPolygon::new(square(50.0), 0.0).expect("a square")],
            boxes: vec![
                OrientedBox::new(DVec3::new(10.0, 0.0, 2.0), DVec3::new(2.0, 6.0, 4.0), 0.0).expect("a box"),
            ],
        };
        let wall =
            surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(20.0, 0.0, 1.4)), 0.0).expect("a wall");
        assert_eq!((wall.surface, wall.face), (SurfaceId::Box(0), Face::Side));
        assert!((wall.point_in_world.x - 9.0).abs() < 1e-12 && wall.normal_in_world == -DVec3::X);
        let roof =
            surfaces.hit(&ray(DVec3::new(10.0, 0.0, 30.0), DVec3::new(10.1, 0.0, 0.0)), 0.0).expect("a roof");
        assert_eq!((roof.face, roof.normal_in_world), (Face::Top, DVec3::Z));
        let ground =
            surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.0, 9.0, 0.0)), 0.0).expect("ground");
        assert_eq!((ground.surface, ground.face), (SurfaceId::Ground(0), Face::Top));
        assert_eq!(surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.0, 9.0, 1.5)), 0.0), None);
        assert_eq!(surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.0, 900.0, 0.0)), 0.0), None);
    }

    #[test]
    fn only_boxes_hide() {
        let surfaces = Surfaces {
            ground: vec![GroundPolygon::new(square(50.0), 0.0).expect("a square")],
            boxes: vec![
                OrientedBox::new(DVec3::new(10.0, 0.0, 2.0), DVec3::new(2.0, 6.0, 4.0), 0.7).expect("a box"),
            ],
        };
        let eye = DVec3::new(0.0, 0.0, 1.7);
        assert!(surfaces.is_hidden(eye, DVec3::new(20.0, 0.0, 0.0)));
        assert!(!surfaces.is_hidden(eye, DVec3::new(5.0, 0.0, 0.0)));
        assert!(!surfaces.is_hidden(eye, DVec3::new(20.0, 20.0, 0.0)));
        assert!(!surfaces.is_hidden(eye, eye));
    }

    #[test]
    fn numbers_that_are_no_surface_are_refused() {
        assert_eq!(
            GroundPolygon::new(square(1.0)[..2].to_vec(), 0.0),
            Err(SurfaceError::CornerCount { count: 2 })
        );
        assert_eq!(GroundPolygon::new(square(0.0), 0.0), Err(SurfaceError::NoArea));
        let mut bow_tie = square(1.0);
        bow_tie.swap(1, 2);
        bow_tie[0].x -= 1.0;
        assert_eq!(GroundPolygon::new(bow_tie, 0.0), Err(SurfaceError::NoArea));
        assert!(matches!(GroundPolygon::new(square(f64::NAN), 0.0), Err(SurfaceError::NotFinite { .. })));
        assert!(matches!(
            GroundPolygon::new(square(1.0), f64::INFINITY),
            Err(SurfaceError::NotFinite { .. })
        ));
        assert_eq!(OrientedBox::new(DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0), 0.0), Err(SurfaceError::BoxSize));
        assert_eq!(OrientedBox::new(DVec3::ZERO, DVec3::NAN, 0.0), Err(SurfaceError::BoxSize));
    }

    #[test]
    fn the_covered_part_of_a_way_runs_from_its_first_to_its_last_place_within() {
        let corners =
            [[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [4.0, 6.0], [4.0, 2.0], [2.0, 2.0], [2.0, 6.0], [0.0, 6.0]];
        for offset in [DVec2::ZERO, DVec2::new(5e5, 5e6)] {
            let corners = corners.map(|corner| DVec2::from_array(corner) + offset);
            let u = GroundPolygon::new(corners.to_vec(), 0.0).expect("a U");
            let check = |start: [f64; 2], end: [f64; 2], expected: Option<(f64, f64)>| {
                let [start, end] = [start, end].map(|point| DVec2::from_array(point) + offset);
                let near =
                    |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-9 && (b - d).abs() < 1e-9;
                let found = u.covered_part(start, end);
                let is_right = match (found, expected) {
                    (Some(found), Some(expected)) => near(found, expected),
                    (found, expected) => found.is_none() && expected.is_none(),
                };
                assert!(is_right, "{start} to {end}: {found:?}");
                let back = u.covered_part(end, start).map(|(first, last)| (1.0 - last, 1.0 - first));
                assert_eq!(back.is_some(), found.is_some(), "{start} to {end}");
            };
            check([1.0, 1.0], [5.0, 1.0], Some((0.0, 1.0)));
            // Through both arms, and what lies between them.
            check([-2.0, 4.0], [8.0, 4.0], Some((0.2, 0.8)));
            check([-2.0, 4.0], [3.0, 4.0], Some((0.4, 0.8)));
            check([3.0, 4.0], [3.0, -1.0], Some((0.4, 0.8)));
            check([3.0, 5.0], [3.0, 3.0], None);
            check([-1.0, 9.0], [7.0, 9.0], None);
            // Who stands.
            check([1.0, 1.0], [1.0, 1.0], Some((0.0, 1.0)));
            check([3.0, 4.0], [3.0, 4.0], None);
            check([f64::NAN, 1.0], [1.0, f64::NAN], None);
        }
    }

    #[test]
    fn ground_far_from_the_origin_keeps_its_edges() {
        let offset = DVec2::new(5e5, 5e6);
        let ground =
            GroundPolygon::new(square(5.0).into_iter().map(|c| c + offset).collect(), 0.0).expect("a square");
        assert!(ground.covers(offset + 4.999) && !ground.covers(offset + 5.001));
    }

    #[test]
    fn bounds_hold_every_corner() {
        assert_eq!(Surfaces::default().bounds(), None);
        let ground = GroundPolygon::new(square(3.0), -1.0).unwrap();
        let solid = OrientedBox::new(
            DVec3::new(5e5, 0.0, 2.0),
            DVec3::new(2.0, 2.0, 4.0),
            0.25 * std::f64::consts::PI,
        );
        let surfaces = Surfaces { ground: vec![ground], boxes: vec![solid.unwrap()] };
        assert_eq!(
            surfaces.ground_bounds(),
            Some([DVec3::new(-3.0, -3.0, -1.0), DVec3::new(3.0, 3.0, -1.0)])
        );
        let [low, high] = surfaces.bounds().unwrap();
        assert_eq!(low, DVec3::new(-3.0, -3.0, -1.0));
        assert!((high - DVec3::new(5e5 + 2_f64.sqrt(), 3.0, 4.0)).length() < 1e-9, "{high}");
    }
}
