//! What a camera sees of a patch: nothing, all of it, or what only a test at every pixel can tell.
//!
//! In the plane at distance 1 before the camera everything level is a convex polygon. What does not overlap there
//! cannot hide, and what one convex solid hides at its corners it hides as a whole. Both are proofs, not samples.

use crate::passes::single_face_bounds;
use glam::{DMat3, DVec2, DVec3};
use std::sync::Arc;
use videofields_vision::geometry::{Camera, Distortion, NEAR_M, Ray, Shape, Surfaces};

/// Share of a picture from its border within which it fades: `FEATHER` of surface.wgsl.
const FEATHER: f64 = 0.06;
/// As `LEAST_COSINE` of surface.wgsl: what is seen at less is not taken from a camera.
const LEAST_COSINE: f64 = 0.0087;
/// Texels by which depth maps dilate what hides, and one for rounding: `camera_depth.wgsl`.
const DILATION_TEXELS: f64 = 5.5;
/// Nearer than this to a plane, relative to the distance, a point lies in it.
const IN_PLANE: f64 = 1e-7;

/// What can stand before something: a level face, or a box around many.
#[derive(Debug)]
pub(super) struct Blocker {
    /// Of a level face its number.
    pub plane: Option<u32>,
    /// Unit normal, outwards; zero of a box.
    pub normal: DVec3,
    /// Corners around a face, or of a box.
    pub corners: Vec<DVec3>,
    /// The shape that it belongs to, by its place.
    pub place: usize,
}

/// A set of points that a patch lies within.
#[derive(Debug)]
pub(super) struct Extent<'a> {
    /// Of a level patch its face's number and normal.
    pub plane: Option<(u32, DVec3)>,
    /// Of a level patch around it, else the eight of a box.
    pub corners: &'a [DVec3],
}

/// How a camera sees a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Seen {
    /// From which side: the one that the normal points to, the other.
    pub sides: [bool; 2],
    /// Something may stand before some of it.
    pub is_tested: bool,
    /// It lies in the picture, where nothing fades.
    pub is_full: bool,
    /// The picture's border may cross it.
    pub is_crossed: bool,
}

/// A polygon in the plane at distance 1.
#[derive(Debug)]
struct Outline {
    corners: Vec<DVec2>,
    low: DVec2,
    high: DVec2,
}

#[derive(Debug)]
struct Shadow {
    /// Which of the blockers.
    blocker: usize,
    /// `None` of what reaches behind the camera: it may hide whatever.
    outline: Option<Outline>,
    /// In the camera's axes.
    corners: Vec<DVec3>,
    normal: DVec3,
    nearest_m: f64,
}

/// A camera with all that may stand before something.
#[derive(Debug)]
pub(super) struct Eyesight {
    camera: Arc<Camera>,
    position: DVec3,
    camera_from_world: DMat3,
    /// Middle and half extent of what it sees, tangents; `None` of a wide lens.
    bounds: Option<[f64; 4]>,
    margin: f64,
    shadows: Vec<Shadow>,
}

impl Eyesight {
    /// `depth_map_side_px`: texels of its depth map each way.
    pub(super) fn new(camera: &Arc<Camera>, blockers: &[Blocker], depth_map_side_px: u32) -> Self {
        let bounds = tangents_of(camera);
        let half = bounds.map_or(1.0, |[.., x, y]| x.max(y));
        let mut eyesight = Self {
            camera: Arc::clone(camera),
            position: camera.pose().position_in_world,
            camera_from_world: DMat3::from_quat(camera.pose().world_from_local).transpose(),
            bounds,
            margin: DILATION_TEXELS * 2.0 * half / f64::from(depth_map_side_px),
            shadows: Vec::new(),
        };
        if bounds.is_some() {
            let shadow = |(idx, blocker)| eyesight.shadow(idx, blocker);
            eyesight.shadows = blockers.iter().enumerate().filter_map(shadow).collect();
        }
        eyesight
    }

    pub(super) const fn position(&self) -> DVec3 {
        self.position
    }

    /// The shadows that are looked through for what lies anywhere.
    pub(super) fn all_shadows(&self) -> Vec<u32> {
        (0..self.shadows.len() as u32).collect()
    }

    fn local(&self, point: DVec3) -> DVec3 {
        self.camera_from_world * (point - self.position)
    }

    fn shadow(&self, idx: usize, blocker: &Blocker) -> Option<Shadow> {
        let corners: Vec<DVec3> = blocker.corners.iter().map(|corner| self.local(*corner)).collect();
        let normal = self.camera_from_world * blocker.normal;
        if blocker.plane.is_some() {
            // Depth maps leave out what is turned away.
            if normal.dot(corners[0]) >= 0.0 {
                return None;
            }
            let corners = before(&corners);
            let outline = Outline::around(&corners)?;
            self.is_in_view(&outline, self.margin).then_some(())?;
            let nearest_m = corners.iter().map(|corner| corner.z).fold(f64::INFINITY, f64::min);
            return Some(Shadow { blocker: idx, outline: Some(outline), corners, normal, nearest_m });
        }
        let nearest_m = corners.iter().map(|corner| corner.z).fold(f64::INFINITY, f64::min);
        let outline = match nearest_m > NEAR_M {
            true => Some(Outline::boxed(&corners)),
            false if corners.iter().all(|corner| corner.z <= NEAR_M) => return None,
            false => None,
        };
        let is_in_view = outline.as_ref().is_none_or(|outline| self.is_in_view(outline, self.margin));
        is_in_view.then_some(Shadow { blocker: idx, outline, corners, normal, nearest_m })
    }

    fn is_in_view(&self, outline: &Outline, margin: f64) -> bool {
        self.bounds.is_none_or(|[x, y, half_x, half_y]| {
            let (middle, half) = (DVec2::new(x, y), DVec2::new(half_x, half_y) + margin);
            (outline.low - middle).cmple(half).all() && (middle - outline.high).cmple(half).all()
        })
    }

    /// How it sees a patch, `None` if nothing of it, leaving in `candidates` the shadows that may fall on some of it.
    pub(super) fn see(
        &self,
        extent: &Extent<'_>,
        candidates: &mut Vec<u32>,
        surfaces: &Surfaces,
        blockers: &[Blocker],
    ) -> Option<Seen> {
        let sides = self.sides(extent)?;
        let corners: Vec<DVec3> = extent.corners.iter().map(|corner| self.local(*corner)).collect();
        let Some([x, y, half_x, half_y]) = self.bounds else {
            return Some(Seen { sides, is_tested: true, is_full: false, is_crossed: false });
        };
        let is_split = corners.iter().any(|corner| corner.z <= NEAR_M);
        let outline = match extent.plane {
            Some(_) => Outline::around(&before(&corners))?,
            None if corners.iter().all(|corner| corner.z <= NEAR_M) => return None,
            None if is_split => {
                return Some(Seen { sides, is_tested: true, is_full: false, is_crossed: true });
            }
            None => Outline::boxed(&corners),
        };
        if !self.is_in_view(&outline, 0.0) {
            return None;
        }
        let own = extent.plane.map(|(number, normal)| (number, self.camera_from_world * normal));
        candidates.retain(|idx| {
            let shadow = &self.shadows[*idx as usize];
            let is_own =
                blockers[shadow.blocker].plane.zip(own).is_some_and(|(plane, (own, _))| plane == own);
            !is_own && self.may_fall_on(shadow, &outline, &corners, own.map(|(_, normal)| normal))
        });
        if candidates
            .iter()
            .any(|idx| self.hides_all(blockers[self.shadows[*idx as usize].blocker].place, extent, surfaces))
        {
            return None;
        }
        let (middle, half) = (DVec2::new(x, y), DVec2::new(half_x, half_y));
        let is_inside = !is_split
            && (outline.low - middle).cmpge(-half).all()
            && (outline.high - middle).cmple(half).all();
        let is_tested = !candidates.is_empty();
        let is_full = is_inside && !is_tested && extent.corners.iter().all(|corner| self.is_unfaded(*corner));
        Some(Seen { sides, is_tested, is_full, is_crossed: !is_inside })
    }

    /// On which sides of a patch it may stand; `None` where it sees all of it as edge-on as makes no difference.
    fn sides(&self, extent: &Extent<'_>) -> Option<[bool; 2]> {
        let Some((_, normal)) = extent.plane else { return Some([true; 2]) };
        let height_m = (self.position - extent.corners[0]).dot(normal);
        let nearest_m = distance_to_convex(self.position, extent.corners, normal);
        let is_grazing = height_m.abs() <= LEAST_COSINE * nearest_m;
        (!is_grazing).then_some([height_m > 0.0, height_m < 0.0])
    }

    fn is_unfaded(&self, point: DVec3) -> bool {
        self.camera.project(point).is_some_and(|projection| {
            let inset = projection.texture.min(1.0 - projection.texture);
            inset.min_element() >= FEATHER
        })
    }

    fn may_fall_on(
        &self,
        shadow: &Shadow,
        outline: &Outline,
        corners: &[DVec3],
        normal: Option<DVec3>,
    ) -> bool {
        if shadow.outline.as_ref().is_some_and(|shape| shape.is_apart_from(outline, self.margin)) {
            return false;
        }
        let farthest_m = corners.iter().map(|corner| corner.z).fold(0.0, f64::max);
        if shadow.nearest_m >= farthest_m {
            return false;
        }
        // Wholly in the patch's plane or behind it.
        let is_behind = normal.is_some_and(|normal| {
            let towards = normal * -normal.dot(corners[0]).signum();
            let is_beyond =
                |point: &DVec3| towards.dot(*point - corners[0]) <= IN_PLANE * (1.0 + point.length());
            shadow.corners.iter().all(is_beyond)
        });
        // Or the patch wholly in the face's plane or before it.
        let is_before = shadow.normal != DVec3::ZERO && {
            let is_before = |point: &DVec3| {
                shadow.normal.dot(*point - shadow.corners[0]) >= -IN_PLANE * (1.0 + point.length())
            };
            corners.iter().all(is_before)
        };
        !is_behind && !is_before
    }

    /// Whether one convex solid stands before all of a patch: what lies on the rays to its corners spans what lies on all
    /// others between them.
    fn hides_all(&self, place: usize, extent: &Extent<'_>, surfaces: &Surfaces) -> bool {
        let Some(shape) = surfaces.shapes().get(place).filter(|shape| is_convex(shape)) else { return false };
        extent.corners.iter().all(|corner| {
            let to_corner = *corner - self.position;
            let Some(direction) = to_corner.try_normalize() else { return false };
            let entered = shape.enters(&Ray { origin: self.position, direction });
            entered.is_some_and(|distance_m| distance_m < to_corner.length() * (1.0 - 1e-9) - 1e-6)
        })
    }
}

/// Middle and half extent of what a camera sees, tangents: without a lens that bends its picture's own.
fn tangents_of(camera: &Camera) -> Option<[f64; 4]> {
    if *camera.distortion() != Distortion::None {
        return single_face_bounds(camera);
    }
    single_face_bounds(camera)?;
    let (width, height) = camera.size_px();
    let size = DVec2::new(f64::from(width), f64::from(height));
    let middle = (0.5 * size - camera.center_px()) / camera.focal_px();
    // Shaders round.
    let half = 0.5 * size / camera.focal_px() * (1.0 + 1e-5);
    Some([middle.x, middle.y, half.x, half.y])
}

fn is_convex(shape: &Shape) -> bool {
    match shape {
        Shape::Box(_) | Shape::Cylinder(_) => true,
        Shape::Footprint(footprint) => {
            let corners = footprint.corners();
            let n = corners.len();
            (0..n).all(|idx| {
                let (a, b, c) = (corners[idx], corners[(idx + 1) % n], corners[(idx + 2) % n]);
                (b - a).perp_dot(c - b) >= 0.0
            })
        }
        Shape::Ground(_) | Shape::HeightField(_) | Shape::Model(_) => false,
    }
}

/// What of a convex polygon lies before the camera's near plane.
fn before(corners: &[DVec3]) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (idx, a) in corners.iter().enumerate() {
        let b = corners[(idx + 1) % corners.len()];
        let (is_a, is_b) = (a.z > NEAR_M, b.z > NEAR_M);
        if is_a {
            kept.push(*a);
        }
        if is_a != is_b {
            kept.push(a.lerp(b, (NEAR_M - a.z) / (b.z - a.z)));
        }
    }
    kept
}

/// Least distance from a point to a convex polygon of this normal.
fn distance_to_convex(point: DVec3, corners: &[DVec3], normal: DVec3) -> f64 {
    let n = corners.len();
    let foot = point - normal * (point - corners[0]).dot(normal);
    let edge = |idx: usize| (corners[idx], corners[(idx + 1) % n]);
    let sides = (0..n).map(|idx| {
        let (a, b) = edge(idx);
        (b - a).cross(foot - a).dot(normal)
    });
    let (low, high) =
        sides.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| (low.min(s), high.max(s)));
    if low >= 0.0 || high <= 0.0 {
        return (point - foot).length();
    }
    let to_edge = |idx: usize| {
        let (a, b) = edge(idx);
        let along = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        (point - a.lerp(b, if along.is_finite() { along } else { 0.0 })).length()
    };
    (0..n).map(to_edge).fold(f64::INFINITY, f64::min)
}

impl Outline {
    fn of(corners: Vec<DVec2>) -> Self {
        let low = corners.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = corners.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        Self { corners, low, high }
    }

    /// Of a convex polygon before the near plane; `None` of nothing.
    fn around(corners: &[DVec3]) -> Option<Self> {
        let flat: Vec<DVec2> = corners.iter().map(|corner| corner.truncate() / corner.z).collect();
        (!flat.is_empty()).then(|| Self::of(flat))
    }

    /// The rectangle around what lies before the near plane.
    fn boxed(corners: &[DVec3]) -> Self {
        let Self { low, high, .. } =
            Self::of(corners.iter().map(|corner| corner.truncate() / corner.z).collect());
        Self::of(vec![low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)])
    }

    /// Whether a line parts them, with `margin` between.
    fn is_apart_from(&self, other: &Self, margin: f64) -> bool {
        let beside = (self.low - other.high).max(other.low - self.high);
        beside.max_element() >= margin || self.parts(other, margin) || other.parts(self, margin)
    }

    /// Whether the line along one of its own edges does.
    fn parts(&self, other: &Self, margin: f64) -> bool {
        let n = self.corners.len();
        (0..n).any(|idx| {
            let (a, b) = (self.corners[idx], self.corners[(idx + 1) % n]);
            let Some(across) = (b - a).perp().try_normalize() else { return false };
            let reach = |outline: &Self| {
                let along = outline.corners.iter().map(|corner| (*corner - a).dot(across));
                along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], s| [low.min(s), high.max(s)])
            };
            let ([low, high], [other_low, other_high]) = (reach(self), reach(other));
            other_low - high >= margin || low - other_high >= margin
        })
    }
}
