//! Gives each foreground pixel of a camera's mask to the person whom it shows.
//!
//! People and masks flow in; a map of owners flows out, in the size in which masks are looked at. Of several who cover a pixel it is the
//! nearest's; what nobody covers goes to those whom it hangs together with, as far as arms reach.

use super::{Occupancy, Person};
use crate::scene::Scene;

/// Foreground that hangs together with somebody is theirs up to this share of their height beyond their silhouette.
const REACH: f32 = 0.12;

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

impl Owners {
    /// Returns the index of the person whose foreground a pixel is.
    pub(crate) fn get(&self, x: usize, y: usize) -> Option<usize> {
        let owner = *self.of_pixels.get(y * self.width + x)?;
        (x < self.width && owner != NOBODY).then_some(usize::from(owner))
    }
}

impl Occupancy {
    /// Returns whose the foreground of each camera is, by the camera's place in the scene, of the masks that were looked at last; empty
    /// of cameras that tell nothing.
    pub(crate) fn owners(&self, scene: &Scene, people: &[Person]) -> Vec<Owners> {
        (0..self.evidence.len()).map(|camera_idx| self.owners_in(scene, people, camera_idx)).collect()
    }

    fn owners_in(&self, scene: &Scene, people: &[Person], camera_idx: usize) -> Owners {
        let evidence = &self.evidence[camera_idx];
        if !evidence.is_usable() {
            return Owners { people: vec![Owned::default(); people.len()], ..Owners::default() };
        }
        let (width, height) = evidence.size();
        let mut owners = Owners {
            width,
            height,
            of_pixels: vec![NOBODY; width * height],
            people: vec![Owned::default(); people.len()],
        };
        let eye = scene.cameras[camera_idx].camera.pose().position_in_world;
        let mut farthest_first: Vec<usize> = (0..people.len().min(usize::from(NOBODY))).collect();
        let distance_m = |idx: &usize| people[*idx].foot_in_world.distance(eye);
        farthest_first.sort_by(|a, b| distance_m(b).total_cmp(&distance_m(a)));
        for idx in farthest_first {
            let Some(silhouette) = &people[idx].silhouettes[camera_idx] else { continue };
            for (row, [left, right]) in silhouette.spans.iter().enumerate() {
                let [left, right] = [*left, *right].map(|end| (end.round() as usize).min(width));
                let first = (silhouette.first_row + row) * width;
                if left < right {
                    owners.of_pixels[first + left..first + right].fill(idx as u16);
                }
            }
        }
        for (pixel, owner) in owners.of_pixels.iter_mut().enumerate() {
            if *owner == NOBODY {
                continue;
            }
            let of = &mut owners.people[usize::from(*owner)];
            of.n_visible += 1;
            if evidence.is_foreground(pixel) {
                of.n_found += 1;
            } else {
                *owner = NOBODY;
            }
        }
        let reach: Vec<u16> = people
            .iter()
            .map(|person| {
                let n_rows = person.silhouettes[camera_idx].as_ref().map_or(0, |of| of.spans.len());
                (REACH * n_rows as f32).ceil() as u16
            })
            .collect();
        owners.grow(&reach, |pixel| evidence.is_foreground(pixel));
        owners.count();
        owners
    }
}

impl Owners {
    /// Gives foreground that hangs together with somebody's to them, up to so many steps by person.
    fn grow(&mut self, reach: &[u16], is_foreground: impl Fn(usize) -> bool) {
        let (width, height) = (self.width, self.height);
        let mut open: Vec<usize> =
            (0..self.of_pixels.len()).filter(|pixel| self.of_pixels[*pixel] != NOBODY).collect();
        let mut next = Vec::new();
        for step in 1..=reach.iter().copied().max().unwrap_or(0) {
            open.retain(|pixel| reach[usize::from(self.of_pixels[*pixel])] >= step);
            for pixel in open.drain(..) {
                let owner = self.of_pixels[pixel];
                let first_new = next.len();
                let is_open = |other: &usize| self.of_pixels[*other] == NOBODY && is_foreground(*other);
                next.extend(beside(pixel, (width, height)).filter(is_open));
                for other in &next[first_new..] {
                    self.of_pixels[*other] = owner;
                }
            }
            std::mem::swap(&mut open, &mut next);
        }
    }

    fn count(&mut self) {
        for (pixel, owner) in self.of_pixels.iter().enumerate().filter(|(_, owner)| **owner != NOBODY) {
            let (x, y) = (pixel % self.width, pixel / self.width);
            let of = &mut self.people[usize::from(*owner)];
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
