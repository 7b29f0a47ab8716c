//! Gives each foreground pixel of a camera's mask to the person whom it shows.
//!
//! People and masks flow in; a map of owners flows out, in the size in which masks are looked at. Of several who cover a pixel it is the
//! nearest's; what nobody covers goes to those whom it hangs together with, as far as arms reach.

use super::silhouette::Silhouette;
use super::{Occupancy, Person};
use crate::scene::Scene;

/// Foreground that hangs together with somebody is theirs up to this share of their height beyond their silhouette.
const REACH: f32 = 0.12;

/// ... and all that hangs together beyond that is, too, if it is no more than this share of what they cover: a leg, not somebody else.
const MOST_PART: f32 = 0.3;

/// Background up to so many cells beside somebody counts as theirs where they are shown.
const EDGE_CELLS: u16 = 2;

/// No owner.
const NOBODY: u16 = u16::MAX;

/// People's pixels in one camera's picture.
#[derive(Clone, Debug, Default)]
pub(crate) struct Owners {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Index of the person by pixel, row by row.
    of_pixels: Vec<u16>,
    /// By person.
    pub(crate) people: Vec<Owned>,
    /// All pixels that are somebody's.
    owned: Vec<usize>,
}

/// Somebody's pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Owned {
    /// Foreground that is theirs.
    pub(crate) n_px: u32,
    /// Pixels of their silhouette that nobody nearer covers, and how many of these are foreground.
    pub(crate) n_visible: u32,
    pub(crate) n_found: u32,
    /// First column and row, and those behind the last; all 0 where nothing is theirs.
    pub(crate) bounds: [usize; 4],
}

/// Map that names, for each cell of a camera's picture, the person whose it is, among those whom several cameras tell together.
#[derive(Clone, PartialEq)]
pub struct OwnerMap {
    width: u32,
    height: u32,
    side_px: u32,
    of_cells: Box<[u16]>,
    /// By person, metres from the camera.
    distances_m: Box<[f64]>,
}

impl OwnerMap {
    /// Number that stands for what is nobody's.
    pub const NOBODY: u16 = 0;

    /// Returns the map with these cells, row by row, of `side_px` pixels (0 counts as 1); `distances_m` gives by number, from 1 on, how
    /// far the people stand from the camera.
    ///
    /// # Panics
    /// If the cells are not as many as columns times rows.
    #[must_use]
    pub fn new(
        (width, height): (u32, u32),
        side_px: u32,
        of_cells: Box<[u16]>,
        distances_m: Box<[f64]>,
    ) -> Self {
        assert_eq!(of_cells.len(), width as usize * height as usize, "a cell for each column and row");
        Self { width, height, side_px: side_px.max(1), of_cells, distances_m }
    }

    /// Returns the bytes of its cells and distances.
    #[must_use]
    pub const fn n_bytes(&self) -> usize {
        size_of_val(&*self.of_cells) + size_of_val(&*self.distances_m)
    }

    /// Returns the number of cells in a row, and of rows.
    #[must_use]
    pub const fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Returns the sides of a cell, pixels of the mask; at least 1.
    #[must_use]
    pub const fn side_px(&self) -> u32 {
        self.side_px
    }

    /// Returns all cells, row by row: the number of the person (from 1 on) whose they are.
    #[must_use]
    pub const fn of_cells(&self) -> &[u16] {
        &self.of_cells
    }

    /// Returns how far the person of a number stands from the camera, metres; none of [`Self::NOBODY`].
    #[must_use]
    pub fn distance_m(&self, number: u16) -> Option<f64> {
        self.distances_m.get(usize::from(number).checked_sub(1)?).copied()
    }

    /// Returns the number of the person whose a pixel of the mask is.
    #[must_use]
    pub fn at(&self, x: u32, y: u32) -> u16 {
        let (column, row) = (x / self.side_px, y / self.side_px);
        let is_inside = column < self.width && row < self.height;
        if is_inside { self.of_cells[(row * self.width + column) as usize] } else { Self::NOBODY }
    }
}

impl std::fmt::Debug for OwnerMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { width, height, side_px, .. } = self;
        f.debug_struct("OwnerMap")
            .field("width", width)
            .field("height", height)
            .field("side_px", side_px)
            .finish_non_exhaustive()
    }
}

impl Owners {
    /// Returns the index of the person whose foreground a pixel is.
    pub(crate) fn get(&self, x: usize, y: usize) -> Option<usize> {
        let owner = *self.of_pixels.get(y * self.width + x)?;
        (x < self.width && owner != NOBODY).then_some(usize::from(owner))
    }
}

impl Occupancy {
    /// Returns whose the foreground of each camera is, by the camera's place in the scene, of the masks that were looked at last; empty
    /// of cameras that tell nothing, and of all where there is nobody.
    pub(crate) fn owners(&self, scene: &Scene, people: &[Person]) -> Vec<Owners> {
        (0..self.evidence.len()).map(|camera_idx| self.owners_in(scene, people, camera_idx)).collect()
    }

    /// Returns the map of a camera's `owners`, of masks as wide as `mask_width_px`; none where they tell nothing. What is background
    /// right beside somebody counts as theirs, so that soft edges are shown.
    pub(crate) fn owner_map(
        &self,
        (scene, people): (&Scene, &[Person]),
        owners: &Owners,
        (camera_idx, mask_width_px): (usize, u32),
    ) -> Option<OwnerMap> {
        if owners.width == 0 {
            return None;
        }
        let evidence = &self.evidence[camera_idx];
        let mut ringed = owners.clone();
        let reach = vec![EDGE_CELLS; owners.people.len()];
        ringed.grow(&reach, |pixel| !evidence.is_foreground(pixel));
        let eye = scene.cameras[camera_idx].camera.pose().position_in_world;
        let number = |owner: &u16| if *owner == NOBODY { OwnerMap::NOBODY } else { *owner + 1 };
        let of_cells = ringed.of_pixels.iter().map(number).collect();
        let distances_m = people.iter().map(|person| person.foot_in_world.distance(eye)).collect();
        let size = (owners.width as u32, owners.height as u32);
        Some(OwnerMap::new(size, mask_width_px.div_ceil(owners.width as u32), of_cells, distances_m))
    }

    fn owners_in(&self, scene: &Scene, people: &[Person], camera_idx: usize) -> Owners {
        let evidence = &self.evidence[camera_idx];
        if people.is_empty() || !evidence.is_usable() {
            return Owners { people: vec![Owned::default(); people.len()], ..Owners::default() };
        }
        let (width, height) = evidence.size();
        let mut owners = Owners {
            width,
            height,
            of_pixels: vec![NOBODY; width * height],
            people: vec![Owned::default(); people.len()],
            owned: Vec::new(),
        };
        let eye = scene.cameras[camera_idx].camera.pose().position_in_world;
        let mut nearest_first: Vec<usize> = (0..people.len().min(usize::from(NOBODY))).collect();
        let distance_m = |idx: &usize| people[*idx].foot_in_world.distance(eye);
        nearest_first.sort_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        let shown = nearest_first
            .into_iter()
            .filter_map(|idx| Some((idx, people[idx].silhouettes[camera_idx].as_ref()?)));
        owners.give_covered(shown, |pixel| evidence.is_foreground(pixel));
        let reach: Vec<u16> = people
            .iter()
            .map(|person| {
                let n_rows = person.silhouettes[camera_idx].as_ref().map_or(0, |of| of.spans.len());
                (REACH * n_rows as f32).ceil() as u16
            })
            .collect();
        owners.grow(&reach, |pixel| evidence.is_foreground(pixel));
        owners.take_parts(|pixel| evidence.is_foreground(pixel));
        owners.count();
        owners
    }
}

impl Owners {
    /// Gives people, the nearest first, what they cover and nobody nearer does.
    fn give_covered<'a>(
        &mut self,
        nearest_first: impl Iterator<Item = (usize, &'a Silhouette)>,
        is_foreground: impl Fn(usize) -> bool,
    ) {
        let mut background = Vec::new();
        for (idx, silhouette) in nearest_first {
            let (first_found, first_missing) = (self.owned.len(), background.len());
            for pixel in silhouette.runs(self.width).flatten() {
                if self.of_pixels[pixel] != NOBODY {
                    continue;
                }
                self.of_pixels[pixel] = idx as u16;
                let list = if is_foreground(pixel) { &mut self.owned } else { &mut background };
                list.push(pixel);
            }
            let n_found = self.owned.len() - first_found;
            let person = &mut self.people[idx];
            person.n_found = n_found as u32;
            person.n_visible = (n_found + background.len() - first_missing) as u32;
        }
        background.into_iter().for_each(|pixel| self.of_pixels[pixel] = NOBODY);
    }

    /// Gives foreground that hangs together with somebody's to them, up to so many steps by person.
    fn grow(&mut self, reach: &[u16], is_foreground: impl Fn(usize) -> bool) {
        let size = (self.width, self.height);
        // What was given in the step before, or at first whatever is somebody's.
        let mut last = 0..self.owned.len();
        for step in 1..=reach.iter().copied().max().unwrap_or(0) {
            for idx in last.clone() {
                let pixel = self.owned[idx];
                let owner = self.of_pixels[pixel];
                if reach[usize::from(owner)] < step {
                    continue;
                }
                let (first_new, of_pixels) = (self.owned.len(), &self.of_pixels);
                let is_open = |other: &usize| of_pixels[*other] == NOBODY && is_foreground(*other);
                self.owned.extend(beside(pixel, size).filter(is_open));
                for other in &self.owned[first_new..] {
                    self.of_pixels[*other] = owner;
                }
            }
            last = last.end..self.owned.len();
            if last.is_empty() {
                return;
            }
        }
    }

    /// Gives what hangs together with somebody and is small to whoever is nearest.
    fn take_parts(&mut self, is_foreground: impl Fn(usize) -> bool) {
        let mut is_seen = vec![false; self.of_pixels.len()];
        let mut is_part = vec![false; self.of_pixels.len()];
        let (mut part, mut has_parts) = (Vec::new(), false);
        for first in self.owned.iter().flat_map(|pixel| beside(*pixel, (self.width, self.height))) {
            let is_open = |pixel: usize| self.of_pixels[pixel] == NOBODY && is_foreground(pixel);
            if is_seen[first] || !is_open(first) {
                continue;
            }
            let most_visible = self.part_around(first, is_open, &mut is_seen, &mut part);
            let is_small = part.len() as f32 <= MOST_PART * most_visible as f32;
            has_parts |= is_small;
            part.drain(..).for_each(|pixel| is_part[pixel] = is_small);
        }
        if has_parts {
            self.grow(&vec![u16::MAX; self.people.len()], |pixel| is_part[pixel]);
        }
    }

    /// Fills `part` with the open pixels that hang together with one, and returns how many pixels are visible of the largest person
    /// beside them; 0 where there is none.
    fn part_around(
        &self,
        first: usize,
        is_open: impl Fn(usize) -> bool,
        is_seen: &mut [bool],
        part: &mut Vec<usize>,
    ) -> u32 {
        let (mut most_visible, mut next) = (0, 0);
        is_seen[first] = true;
        part.push(first);
        while let Some(pixel) = part.get(next).copied() {
            next += 1;
            for other in beside(pixel, (self.width, self.height)) {
                let owner = self.of_pixels[other];
                if owner != NOBODY {
                    most_visible = most_visible.max(self.people[usize::from(owner)].n_visible);
                } else if !is_seen[other] && is_open(other) {
                    is_seen[other] = true;
                    part.push(other);
                }
            }
        }
        most_visible
    }

    fn count(&mut self) {
        for pixel in &self.owned {
            let (x, y) = (pixel % self.width, pixel / self.width);
            let of = &mut self.people[usize::from(self.of_pixels[*pixel])];
            let [left, top, right, bottom] = of.bounds;
            of.bounds = if of.n_px == 0 {
                [x, y, x + 1, y + 1]
            } else {
                [left.min(x), top.min(y), right.max(x + 1), bottom.max(y + 1)]
            };
            of.n_px += 1;
        }
    }
}

/// Returns the pixels beside, above and beneath one.
fn beside(pixel: usize, (width, height): (usize, usize)) -> impl Iterator<Item = usize> {
    let (x, y) = (pixel % width, pixel / width);
    let all = [
        (x > 0).then(|| pixel - 1),
        (x + 1 < width).then(|| pixel + 1),
        (y > 0).then(|| pixel - width),
        (y + 1 < height).then(|| pixel + width),
    ];
    all.into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_person_grows_as_far_as_they_reach() {
        let mut owners = Owners {
            width: 12,
            height: 1,
            of_pixels: vec![NOBODY; 12],
            people: vec![Owned::default(); 2],
            owned: vec![1, 8],
        };
        (owners.of_pixels[1], owners.of_pixels[8]) = (0, 1);
        owners.grow(&[1, 3], |pixel| pixel != 11);
        let of = |column: usize| owners.get(column, 0);
        assert_eq!([0, 1, 2].map(of), [Some(0); 3]);
        assert_eq!([3, 4, 11].map(of), [None; 3]);
        assert_eq!([5, 6, 7, 8, 9, 10].map(of), [Some(1); 6]);
        owners.count();
        assert_eq!(owners.people[1].bounds, [5, 0, 11, 1]);
        assert_eq!(owners.people.iter().map(|of| of.n_px).collect::<Vec<_>>(), [3, 6]);
    }
}
