//! A scene's surfaces in patches, each with the cameras that can see any of it, so that a picture costs what is seen.
//!
//! Cameras and surfaces stand still, so who sees what is found once for all views: level faces are halved along a grid and
//! triangles of what is uneven are parted, where that tells most, until each patch is seen as a whole, not at all, or is too
//! small to matter. A patch that nothing can hide from a camera is drawn without looking into that camera's depth map.

mod cut;
mod lists;
mod merge;
mod sight;
#[cfg(test)]
mod tests;

use super::mesh::{Mesh, MeshVertex, PartAndPicture};
use cut::{Cell, Cutter, Plane};
use glam::DVec3;
use sight::{Blocker, Extent, Eyesight, Seen};
use std::collections::BinaryHeap;
use std::ops::Range;
use std::sync::Arc;
use videofields_vision::geometry::{Camera, Shape, SurfaceId};

pub(super) use cut::within;
pub(super) use lists::{Batch, Batches, CameraList, Drawing, MOST_LISTED, Shading};

/// Patches beyond which no more is halved; a scene of more faces has as many as those.
const MOST_PATCHES: usize = 6144;
/// A patch of less than this, seen from its cameras, is not halved: radians, about 8 texels of a picture.
const LEAST_ANGLE_RAD: f64 = 0.008;
/// Triangles of uneven surfaces that stay together.
const LEAST_TRIANGLES: usize = 64;
/// Boxes that stand for the triangles of one uneven surface where it may hide something.
const MOST_BOXES: usize = 256;
/// Comparisons of patches with what may hide them; what is left after them is looked at in every pixel.
const MOST_COMPARISONS: u64 = 40_000_000;

/// Which of the cameras sees a patch, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Sight {
    camera: u16,
    seen: Seen,
}

/// A part of a surface.
#[derive(Debug)]
struct Patch {
    surface: SurfaceId,
    /// In [`Patches::vertices`], three a triangle.
    vertices: Range<u32>,
    center: DVec3,
    radius_m: f64,
    /// Of what is level its unit normal, else zero.
    normal: DVec3,
    /// The place of the picture on it among the mesh's.
    texture: Option<usize>,
    sights: Vec<Sight>,
}

/// All surfaces of a scene, for a set of cameras.
#[derive(Debug)]
pub(super) struct Patches {
    /// Another for every set that a renderer makes.
    pub number: u64,
    mesh_number: u64,
    /// Each another.
    cameras: Vec<Arc<Camera>>,
    pub vertices: Vec<MeshVertex>,
    patches: Vec<Patch>,
    may_overlap: bool,
}

/// How a camera sees a draft, with which of what it knows may hide some of it.
type SightAndShadows = (Sight, Vec<u32>);

/// A patch that may still be halved.
#[derive(Debug)]
struct Draft {
    surface: SurfaceId,
    corners: Vec<DVec3>,
    center: DVec3,
    radius_m: f64,
    form: Form,
    seen: Vec<SightAndShadows>,
}

#[derive(Debug)]
enum Form {
    /// Of a face (its place among them), with the triangles (by the first of their vertices) that lie in it.
    Level(usize, Cell, Vec<u32>),
    /// These triangles, by the first of their vertices.
    Uneven(Vec<u32>),
}

/// What is known while patches are made.
struct Maker<'a> {
    mesh: &'a Mesh,
    planes: Vec<Plane>,
    blockers: Vec<Blocker>,
    eyes: Vec<Eyesight>,
    comparisons_left: u64,
}

impl Patches {
    /// The patches of a mesh for cameras with depth maps of this many texels each way.
    ///
    /// **Cost** some 0.1 s for 100 cameras among some hundred faces; bounded for any scene.
    pub(super) fn new(mesh: &Mesh, cameras: Vec<Arc<Camera>>, depth_map_side_px: u32, number: u64) -> Self {
        let mut maker = Maker {
            mesh,
            planes: Vec::new(),
            blockers: Vec::new(),
            eyes: Vec::new(),
            comparisons_left: MOST_COMPARISONS,
        };
        let mut drafts = maker.first_drafts();
        // Two that are calibrated alike see alike.
        let mut distinct: Vec<Arc<Camera>> = Vec::with_capacity(cameras.len());
        for camera in cameras {
            if !distinct.contains(&camera) {
                distinct.push(camera);
            }
        }
        let cameras = distinct;
        let eye = |camera| Eyesight::new(camera, &maker.blockers, depth_map_side_px);
        maker.eyes = cameras.iter().map(eye).collect();
        for draft in &mut drafts {
            let all = maker.eyes.iter().map(Eyesight::all_shadows);
            let unknown: Vec<_> = (0..).zip(all).collect();
            draft.seen = maker.see(draft, unknown);
        }
        let drafts = maker.halve(drafts);
        let (vertices, patches) = maker.finish(drafts);
        let may_overlap = !maker.blockers.is_empty();
        Self { number, mesh_number: mesh.number, cameras, vertices, patches, may_overlap }
    }

    /// Whether one may lie before another: not on level ground alone, of one height.
    pub(super) const fn may_overlap(&self) -> bool {
        self.may_overlap
    }

    /// Whether these are the patches of a mesh for at least these cameras.
    pub(super) fn serve(&self, mesh: &Mesh, cameras: &[Arc<Camera>]) -> bool {
        self.mesh_number == mesh.number && cameras.iter().all(|camera| self.place_of(camera).is_some())
    }

    fn place_of(&self, camera: &Arc<Camera>) -> Option<usize> {
        self.cameras.iter().position(|known| Arc::ptr_eq(known, camera) || known == camera)
    }
}

impl Draft {
    fn new(surface: SurfaceId, corners: Vec<DVec3>, form: Form) -> Self {
        let n = corners.len().max(1) as f64;
        let center = corners[0] + corners.iter().map(|corner| *corner - corners[0]).sum::<DVec3>() / n;
        let radius_m = corners.iter().map(|corner| corner.distance(center)).fold(0.0, f64::max);
        Self { surface, corners, center, radius_m, form, seen: Vec::new() }
    }

    /// How much halving it may tell: the solid angle in which it is not known what cameras see.
    fn worth(&self, eyes: &[Eyesight]) -> f64 {
        let worth = |(sight, shadows): &SightAndShadows| {
            let distance_m = eyes[usize::from(sight.camera)].position().distance(self.center);
            let angle = self.radius_m / distance_m.max(self.radius_m);
            let share = match (shadows.is_empty(), sight.seen.is_crossed) {
                (false, _) => 1.0,
                (true, true) => 0.25,
                (true, false) => 0.0,
            };
            if angle >= LEAST_ANGLE_RAD { angle * angle * share } else { 0.0 }
        };
        // The sum of nothing is the negative zero.
        self.seen.iter().map(worth).fold(0.0, |sum, worth| sum + worth)
    }
}

/// The corners of the box around points.
fn box_around(points: impl Iterator<Item = DVec3>) -> Vec<DVec3> {
    let (low, high) = points
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)));
    let pick = |idx: usize, axis: usize| if idx >> axis & 1 == 0 { low[axis] } else { high[axis] };
    (0..8).map(|idx| DVec3::new(pick(idx, 0), pick(idx, 1), pick(idx, 2))).collect()
}

impl Maker<'_> {
    /// One draft for every level face and for every uneven surface, with all that can hide something.
    fn first_drafts(&mut self) -> Vec<Draft> {
        let mesh = self.mesh;
        let surfaces = &mesh.scene.surfaces;
        let mut heights = surfaces.ground().map(videofields_vision::geometry::GroundPolygon::height_m);
        let first_height = heights.next();
        let is_stepped = heights.any(|height| Some(height) != first_height);
        let mut drafts = Vec::new();
        for (place, ((surface, shape), (_, range))) in surfaces.named().zip(&mesh.ranges).enumerate() {
            let firsts: Vec<u32> = range.clone().step_by(3).collect();
            if firsts.is_empty() {
                continue;
            }
            let hides = shape.hides() || is_stepped;
            if let Shape::Cylinder(_) | Shape::HeightField(_) | Shape::Model(_) = shape {
                for chunk in firsts.chunks(firsts.len().div_ceil(MOST_BOXES)) {
                    let corners = box_around(self.points(chunk));
                    self.blockers.push(Blocker { plane: None, normal: DVec3::ZERO, corners, place });
                }
                for firsts in self.groups(firsts, |(_, texture)| (0, texture)) {
                    let corners = box_around(self.points(&firsts));
                    drafts.push(Draft::new(surface, corners, Form::Uneven(firsts)));
                }
                continue;
            }
            // Each part is level.
            for firsts in self.groups(firsts, |of| of) {
                let corners: Vec<MeshVertex> =
                    firsts.iter().flat_map(|first| self.triangle(*first)).collect();
                let number = self.planes.len() as u32;
                let Some(plane) = Plane::of(number, &corners) else { continue };
                let corners = Cell::WHOLE.corners_in_world(&plane).to_vec();
                if hides {
                    let (plane, normal) = (Some(number), plane.normal);
                    self.blockers.push(Blocker { plane, normal, corners: corners.clone(), place });
                }
                drafts.push(Draft::new(surface, corners, Form::Level(number as usize, Cell::WHOLE, firsts)));
                self.planes.push(plane);
            }
        }
        drafts
    }

    /// Triangles apart by what `by` makes of their part and picture.
    fn groups(&self, firsts: Vec<u32>, by: fn(PartAndPicture) -> PartAndPicture) -> Vec<Vec<u32>> {
        let of = |first: u32| (by(self.mesh.triangles[first as usize / 3]), first);
        let mut ordered: Vec<_> = firsts.into_iter().map(of).collect();
        ordered.sort_unstable();
        let groups = ordered.chunk_by(|(a, _), (b, _)| a == b);
        groups.map(|group| group.iter().map(|(_, first)| *first).collect()).collect()
    }

    fn triangle(&self, first: u32) -> [MeshVertex; 3] {
        [0, 1, 2].map(|corner| self.mesh.vertices[first as usize + corner])
    }

    fn points(&self, firsts: &[u32]) -> impl Iterator<Item = DVec3> {
        firsts.iter().flat_map(|first| self.triangle(*first)).map(|corner| corner.position_in_world)
    }

    /// Which of these cameras see a draft, of those shadows that fell on what it is a part of.
    fn see(&mut self, draft: &Draft, known: Vec<(u16, Vec<u32>)>) -> Vec<SightAndShadows> {
        let plane = match &draft.form {
            Form::Level(plane, ..) => Some((*plane as u32, self.planes[*plane].normal)),
            Form::Uneven(_) => None,
        };
        let extent = Extent { plane, corners: &draft.corners };
        let mut seen = Vec::with_capacity(known.len());
        for (camera, mut shadows) in known {
            self.comparisons_left = self.comparisons_left.saturating_sub(1 + shadows.len() as u64);
            if self.comparisons_left == 0 {
                let unknown = Seen { sides: [true; 2], is_tested: true, is_full: false, is_crossed: false };
                seen.push((Sight { camera, seen: unknown }, Vec::new()));
                continue;
            }
            let eye = &self.eyes[usize::from(camera)];
            if let Some(how) = eye.see(&extent, &mut shadows, &self.mesh.scene.surfaces, &self.blockers) {
                seen.push((Sight { camera, seen: how }, shadows));
            }
        }
        seen
    }

    /// Halves what tells most, until nothing tells anything or there are enough.
    fn halve(&mut self, mut drafts: Vec<Draft>) -> Vec<Draft> {
        // Numbers above 0 are in the order of their bits.
        let rank =
            |draft: &Draft, idx: usize, eyes: &[Eyesight]| (draft.worth(eyes).to_bits(), usize::MAX - idx);
        let mut heap: BinaryHeap<(u64, usize)> =
            drafts.iter().enumerate().map(|(idx, draft)| rank(draft, idx, &self.eyes)).collect();
        let mut splits: Vec<(usize, usize, Draft)> = Vec::new();
        while let Some((worth, turned)) = heap.pop() {
            if worth == 0 || drafts.len() >= MOST_PATCHES || self.comparisons_left == 0 {
                break;
            }
            let idx = usize::MAX - turned;
            let Some([first, second]) = self.halves(&drafts[idx]) else { continue };
            let halves = [first, second].map(|mut half| {
                let is_empty = matches!(&half.form, Form::Level(.., triangles) if triangles.is_empty());
                let known = drafts[idx].seen.iter().map(|(sight, shadows)| (sight.camera, shadows.clone()));
                if !is_empty {
                    half.seen = self.see(&half, known.collect());
                }
                half
            });
            let [first, second] = halves;
            let whole = std::mem::replace(&mut drafts[idx], first);
            drafts.push(second);
            splits.push((idx, drafts.len() - 1, whole));
            for idx in [idx, drafts.len() - 1] {
                heap.push(rank(&drafts[idx], idx, &self.eyes));
            }
        }
        merge::grown(merge::joined(drafts, splits), &self.planes)
    }

    fn halves(&self, draft: &Draft) -> Option<[Draft; 2]> {
        match &draft.form {
            Form::Level(place, cell, triangles) => {
                let plane = &self.planes[*place];
                let halves = cell.halves(plane)?;
                Some(halves.map(|cell| {
                    let covers = |first: &&u32| plane.covers(&self.triangle(**first), &cell);
                    let triangles = triangles.iter().filter(covers).copied().collect();
                    let corners = cell.corners_in_world(plane).to_vec();
                    Draft::new(draft.surface, corners, Form::Level(*place, cell, triangles))
                }))
            }
            Form::Uneven(triangles) if triangles.len() > LEAST_TRIANGLES => {
                let size = draft.corners[7] - draft.corners[0];
                let axis =
                    if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
                let along = |first: &u32| {
                    self.triangle(*first).iter().map(|corner| corner.position_in_world[axis]).sum::<f64>()
                };
                let mut sorted = triangles.clone();
                let half = sorted.len() / 2;
                sorted.select_nth_unstable_by(half, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
                let second = sorted.split_off(half);
                Some([sorted, second].map(|triangles| {
                    Draft::new(draft.surface, box_around(self.points(&triangles)), Form::Uneven(triangles))
                }))
            }
            Form::Uneven(_) => None,
        }
    }

    fn finish(&self, drafts: Vec<Draft>) -> (Vec<MeshVertex>, Vec<Patch>) {
        let mut cutter = Cutter::default();
        for (idx, draft) in drafts.iter().enumerate() {
            if let Form::Level(place, cell, triangles) = &draft.form {
                for first in triangles {
                    cutter.put(&self.planes[*place], cell, &self.triangle(*first), idx);
                }
            }
        }
        let mut vertices: Vec<MeshVertex> = Vec::new();
        let mut ranges = vec![0..0; drafts.len()];
        let mut add = |idx: usize, triangle: [MeshVertex; 3]| {
            let first = vertices.len() as u32;
            let range: &mut Range<u32> = &mut ranges[idx];
            *range = if range.start == range.end { first } else { range.start }..first + 3;
            vertices.extend(triangle);
        };
        cutter.finish(&mut add);
        for (idx, draft) in drafts.iter().enumerate() {
            if let Form::Uneven(triangles) = &draft.form {
                triangles.iter().for_each(|first| add(idx, self.triangle(*first)));
            }
        }
        let patch = |(draft, vertices): (Draft, Range<u32>)| {
            let first = match &draft.form {
                Form::Level(.., triangles) | Form::Uneven(triangles) => triangles[0],
            };
            let texture = self.mesh.triangles[first as usize / 3].1;
            let normal = match &draft.form {
                Form::Level(place, ..) => self.planes[*place].normal,
                Form::Uneven(_) => DVec3::ZERO,
            };
            let Draft { surface, center, radius_m, seen, .. } = draft;
            let sights = seen.into_iter().map(|(sight, _)| sight).collect();
            Patch { surface, vertices, center, radius_m, normal, texture, sights }
        };
        let patches = drafts.into_iter().zip(ranges).filter(|(_, range)| !range.is_empty()).map(patch);
        let patches = patches.collect();
        (vertices, patches)
    }
}
