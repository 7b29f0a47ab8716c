//! Places of a scene where people may stand, and where each camera would see their bodies.
//!
//! A scene and the cameras' picture sizes flow in once; cells flow out, each with the pixels that show somebody there. Whether a mask has
//! these pixels tells in no time where nobody stands.

use super::silhouette::{Body, FIRST_M, Outliner, Silhouette, TYPICAL_M, hidden_discs};
use crate::scene::Scene;
use glam::DVec3;
use std::collections::HashMap;
use std::sync::Arc;
use videofields_vision::geometry::{Camera, Face, Ray};

/// Least side of a cell, metres.
const LEAST_CELL_M: f64 = 0.05;

/// Cells of a scene at most: of larger scenes they are larger.
const MOST_CELLS: f64 = 1e6;

/// Heights above a cell at which a body is looked for, metres: legs may be hidden.
const LEVELS_M: [f64; 2] = [0.9, 1.45];

/// Somebody smaller than this in a picture is none that it tells of, pixels.
const LEAST_HEIGHT_PX: f64 = 5.0;

/// Levels of ground one above the other at most.
const MOST_STOREYS: usize = 3;

/// Room above a place where people stand, metres.
const HEADROOM_M: f64 = 1.9;

/// A cell counts as filled though one in so many of the cameras that see it shows no foreground: something that the scene does not know may
/// stand in its way.
const PER_BLIND: usize = 4;

/// Cameras that must see a place: fewer tell nothing together.
const LEAST_CAMERAS: usize = 2;

/// No pixel: beside the picture, or hidden.
const NO_PIXEL: u32 = u32::MAX;

/// Silhouettes of typical people that are kept, some 300 bytes each, of all cameras together: what more cells need is made again.
const MOST_KEPT: usize = 100_000;

/// Pixels of one camera that show a cell.
#[derive(Clone, Copy, Debug)]
struct Look {
    camera_idx: u32,
    /// By level.
    pixels: [u32; LEVELS_M.len()],
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    foot_in_world: DVec3,
    first_look: u32,
    /// Column and row over the ground.
    place: [u32; 2],
}

/// Silhouettes of a typical body in a cell, by camera of the scene, with what surfaces hide of it.
#[derive(Clone, Debug)]
pub(super) struct Known {
    pub(super) silhouettes: Arc<[Option<Silhouette>]>,
    /// Bits of the discs that surfaces hide, by camera.
    pub(super) hidden: Arc<[u16]>,
}

/// Cells of a scene, as cameras of given picture sizes see them.
#[derive(Debug)]
pub(super) struct Grid {
    /// Picture sizes by camera of the scene.
    sizes: Vec<(usize, usize)>,
    /// Side of a cell, metres.
    side_m: f64,
    cells: Vec<Cell>,
    /// Cameras' pixels of all cells, those of a cell together.
    looks: Vec<Look>,
    /// By cell and place among [`FIRST_M`].
    silhouettes: HashMap<(usize, usize), Known>,
}

impl Grid {
    /// Returns the cells of `scene`, with sides of `cell_m`, that a camera of `sizes` (columns and rows by camera; 0 of cameras that show nothing) sees.
    pub(super) fn new(scene: &Scene, sizes: Vec<(usize, usize)>, cell_m: f64) -> Self {
        let mut grid =
            Self { sizes, side_m: cell_m, cells: Vec::new(), looks: Vec::new(), silhouettes: HashMap::new() };
        let Some([low, high]) = scene.surfaces.ground_bounds() else { return grid };
        let area = ((high.x - low.x) * (high.y - low.y)).max(0.0);
        let side_m = LEAST_CELL_M.max(cell_m).max((area / MOST_CELLS).sqrt());
        grid.side_m = side_m;
        let top = scene.surfaces.bounds().map_or(high.z, |[_, high]| high.z) + 1.0;
        let count = |low: f64, high: f64| ((high - low) / side_m).ceil().max(1.0) as usize;
        for row in 0..count(low.y, high.y) {
            for column in 0..count(low.x, high.x) {
                let at = |low: f64, idx: usize| low + (idx as f64 + 0.5) * side_m;
                let above = DVec3::new(at(low.x, column), at(low.y, row), top);
                grid.add_storeys(scene, above, [column as u32, row as u32]);
            }
        }
        // Cameras of which no two see the same place tell nothing together.
        if (0..grid.cells.len()).all(|cell| grid.looks(cell).len() < LEAST_CAMERAS) {
            (grid.cells, grid.looks) = (Vec::new(), Vec::new());
        }
        grid
    }

    /// Adds a cell for each level of ground beneath `from`.
    fn add_storeys(&mut self, scene: &Scene, mut from: DVec3, place: [u32; 2]) {
        let mut ceiling = f64::INFINITY;
        for _ in 0..MOST_STOREYS {
            let Some(hit) = scene.surfaces.hit(&Ray { origin: from, direction: -DVec3::Z }, 0.0) else {
                return;
            };
            let foot = hit.point_in_world;
            if hit.face == Face::Top
                && ceiling - foot.z >= HEADROOM_M
                && !scene.surfaces.is_within_solid(foot + DVec3::Z * 0.3)
            {
                self.add_cell(scene, foot, place);
            }
            ceiling = foot.z;
            from = foot - DVec3::Z * 0.05;
        }
    }

    fn add_cell(&mut self, scene: &Scene, foot_in_world: DVec3, place: [u32; 2]) {
        let first_look = self.looks.len() as u32;
        for (camera_idx, (member, size)) in scene.cameras.iter().zip(&self.sizes).enumerate() {
            let pixels = LEVELS_M.map(|above_m| {
                let point = foot_in_world + DVec3::Z * above_m;
                pixel(&member.camera, *size, point)
                    .filter(|_| !scene.surfaces.is_hidden(member.camera.pose().position_in_world, point))
                    .unwrap_or(NO_PIXEL)
            });
            if pixels.iter().any(|pixel| *pixel != NO_PIXEL) {
                self.looks.push(Look { camera_idx: camera_idx as u32, pixels });
            }
        }
        if self.looks.len() as u32 > first_look {
            self.cells.push(Cell { foot_in_world, first_look, place });
        }
    }

    /// Returns true if it is for pictures of these sizes; those of cameras without pictures (0) do not matter.
    pub(super) fn is_for(&self, sizes: &[(usize, usize)]) -> bool {
        self.sizes.len() == sizes.len()
            && self.sizes.iter().zip(sizes).all(|(own, size)| size.0 == 0 || own == size)
    }

    /// Returns the bytes of the cells, of what cameras see of them, and of silhouettes that are kept.
    pub(super) fn memory_bytes(&self) -> usize {
        let rows = |of: &Silhouette| size_of_val(&*of.spans);
        let of_known = |known: &Known| {
            let silhouettes = known.silhouettes.iter().flatten().map(rows).sum::<usize>();
            size_of_val(&*known.silhouettes) + silhouettes + size_of_val(&*known.hidden)
        };
        let kept = self.silhouettes.values().map(of_known).sum::<usize>();
        let entry = size_of::<((usize, usize), Known)>();
        size_of::<Cell>() * self.cells.capacity()
            + size_of::<Look>() * self.looks.capacity()
            + entry * self.silhouettes.capacity()
            + kept
    }

    pub(super) fn sizes(&self) -> &[(usize, usize)] {
        &self.sizes
    }

    /// Returns a cell's looks.
    fn looks(&self, cell: usize) -> &[Look] {
        let end = self.cells.get(cell + 1).map_or(self.looks.len(), |next| next.first_look as usize);
        &self.looks[self.cells[cell].first_look as usize..end]
    }

    /// Calls `found` with every cell where somebody may be, with the share of the cameras that see a body there which show foreground, and
    /// with whether nearly all of them do, two at least, at the lower level; `is_foreground` is asked with a camera and a pixel (row by row).
    pub(super) fn candidates(
        &self,
        is_foreground: impl Fn(usize, usize) -> Option<bool>,
        mut found: impl FnMut(usize, f32, bool),
    ) {
        for cell in 0..self.cells.len() {
            if let Some(share) = self.share_with_foreground(cell, &is_foreground) {
                found(cell, share, self.is_filled(cell, &is_foreground));
            }
        }
    }

    /// Returns the share of the cameras that see a body in a cell which show foreground in its place; none where fewer than half of them
    /// do, so that nobody may be there.
    pub(super) fn share_with_foreground(
        &self,
        cell: usize,
        is_foreground: impl Fn(usize, usize) -> Option<bool>,
    ) -> Option<f32> {
        let (mut n_looks, mut n_hits) = (0, 0);
        for look in self.looks(cell) {
            let pixels = look.pixels.iter().filter(|pixel| **pixel != NO_PIXEL);
            let seen = pixels.filter_map(|pixel| is_foreground(look.camera_idx as usize, *pixel as usize));
            let (mut any, mut hit) = (false, false);
            for is_hit in seen {
                (any, hit) = (true, hit | is_hit);
            }
            n_looks += usize::from(any);
            n_hits += usize::from(hit);
        }
        (n_hits > 0 && 2 * n_hits >= n_looks).then(|| n_hits as f32 / n_looks as f32)
    }

    /// Returns true if nearly all cameras that see the lower level of a cell show foreground there, two at least.
    fn is_filled(&self, cell: usize, is_foreground: impl Fn(usize, usize) -> Option<bool>) -> bool {
        let low = self.looks(cell).iter().filter(|look| look.pixels[0] != NO_PIXEL);
        let low = low.filter_map(|look| is_foreground(look.camera_idx as usize, look.pixels[0] as usize));
        let (n_looks, n_hits) = low.fold((0, 0), |(looks, hits), hit| (looks + 1, hits + usize::from(hit)));
        n_hits >= 2 && PER_BLIND * (n_looks - n_hits) <= n_looks
    }

    /// Returns true if `is_so` of the pixels at the lower level of all cameras that see a body in a cell.
    pub(super) fn all_looks(&self, cell: usize, is_so: impl Fn(usize, usize) -> bool) -> bool {
        let pixels = self.looks(cell).iter().map(|look| (look.camera_idx, look.pixels[0]));
        pixels
            .filter(|(_, pixel)| *pixel != NO_PIXEL)
            .all(|(camera, pixel)| is_so(camera as usize, pixel as usize))
    }

    #[cfg(test)]
    pub(super) fn n_kept_silhouettes(&self) -> usize {
        self.silhouettes.len()
    }

    #[cfg(test)]
    pub(super) fn n_cells(&self) -> usize {
        self.cells.len()
    }

    /// Returns a cell's column and row over the ground.
    pub(super) fn place(&self, cell: usize) -> [i64; 2] {
        self.cells[cell].place.map(i64::from)
    }

    /// Returns the side of a cell, metres.
    pub(super) const fn side_m(&self) -> f64 {
        self.side_m
    }

    pub(super) fn foot(&self, cell: usize) -> DVec3 {
        self.cells[cell].foot_in_world
    }

    /// Returns the silhouettes of somebody in a cell, with a height by its place among [`FIRST_M`]; by camera of the scene.
    pub(super) fn silhouettes(
        &mut self,
        scene: &Scene,
        outliner: &mut Outliner,
        (cell, height): (usize, usize),
    ) -> Known {
        if self.silhouettes.len() > MOST_KEPT / self.sizes.len().max(1) {
            self.silhouettes.clear();
        }
        let body = Body { foot_in_world: self.cells[cell].foot_in_world, height_m: FIRST_M[height] };
        let sizes = &self.sizes;
        let known = self.silhouettes.entry((cell, height)).or_insert_with(|| {
            let hidden = hidden_of(scene, sizes, &body);
            Known { silhouettes: silhouettes(scene, sizes, outliner, &body, &hidden), hidden }
        });
        known.clone()
    }
}

/// Returns bits of the discs of a body that surfaces hide, by camera of the scene; none of cameras without pictures.
pub(super) fn hidden_of(scene: &Scene, sizes: &[(usize, usize)], body: &Body) -> Arc<[u16]> {
    let of = |(member, size): (&crate::scene::SceneCamera, &(usize, usize))| {
        if size.0 == 0 { 0 } else { hidden_discs(&member.camera, &scene.surfaces, body) }
    };
    scene.cameras.iter().zip(sizes).map(of).collect()
}

/// Returns the silhouettes of a body by camera of the scene, of which surfaces hide what is `hidden`.
pub(super) fn silhouettes(
    scene: &Scene,
    sizes: &[(usize, usize)],
    outliner: &mut Outliner,
    body: &Body,
    hidden: &[u16],
) -> Arc<[Option<Silhouette>]> {
    let cameras = scene.cameras.iter().zip(sizes).zip(hidden);
    let of = |((member, size), hidden): ((&crate::scene::SceneCamera, &(usize, usize)), &u16)| {
        if size.0 == 0 { None } else { outliner.silhouette(&member.camera, *size, body, *hidden) }
    };
    cameras.map(of).collect()
}

/// Returns the pixel that shows a point, if somebody there is large enough to be told.
fn pixel(camera: &Camera, (width, height): (usize, usize), point: DVec3) -> Option<u32> {
    let projection = camera.project(point)?;
    let focal_px = camera.focal_px().y * height as f64 / f64::from(camera.size_px().1);
    let is_large = TYPICAL_M * focal_px / projection.depth_m >= LEAST_HEIGHT_PX;
    if !is_large || !projection.is_inside() {
        return None;
    }
    let place = |share: f64, count: usize| Some(((share * count as f64) as usize).min(count.checked_sub(1)?));
    let (x, y) = (place(projection.texture.x, width), place(projection.texture.y, height));
    u32::try_from(y? * width + x?).ok()
}
