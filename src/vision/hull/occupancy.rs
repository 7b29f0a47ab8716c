//! Which places of a regular grid are inside, in bits; and what a manifold surface around them asks of them.
//!
//! In: places, one by one or in runs. Out: the same with those added that make it well-composed (`mend`): where two places touch only
//! across the diagonal of a square or of a cube of the grid, two sheets of a surface would share a point or an edge. None is
//! taken away: a hull holds all that it is a hull of, and so must what is made of it.
//!
//! `[L97]` Latecki 1997, 3D well-composed pictures, Graphical Models and Image Processing 59(3), definition 2.4.

use crate::mesh::MeshError;
use glam::DVec3;
use std::array::from_fn;
use std::ops::Range;

/// Which points of a regular grid are inside.
///
/// **Shape**: bits, x fastest, rows padded to whole words of 64. **Cost**: a 512^3 grid is 16 MiB, one of 1024^3 128 MiB.
#[derive(Clone, Debug, PartialEq)]
pub struct Occupancy {
    size: [u32; 3],
    origin: DVec3,
    step_m: f64,
    words_per_row: usize,
    words: Vec<u64>,
}

impl Occupancy {
    /// Most points along an axis.
    pub const MAX_SIDE: u32 = 2048;
    /// Most points: 1024^3.
    pub const MAX_POINTS: u64 = 1 << 30;

    /// A grid of `size` points with nothing inside; the first is at `origin`, neighbours are `step_m` apart (metres, world).
    ///
    /// # Errors
    /// When the grid is too large, or its place or step is no such number.
    pub fn new(size: [u32; 3], origin: DVec3, step_m: f64) -> Result<Self, MeshError> {
        let n_points = || size.iter().map(|side| u64::from(*side)).product::<u64>();
        if size.iter().any(|side| *side > Self::MAX_SIDE) || n_points() > Self::MAX_POINTS {
            return Err(MeshError::Grid { size });
        }
        let last = origin + step_m * DVec3::from(size.map(f64::from));
        if !origin.is_finite() || !last.is_finite() || step_m <= 0.0 {
            return Err(MeshError::NotFinite { field: "the grid's origin or step" });
        }
        let words_per_row = size[0].div_ceil(64) as usize;
        let words = vec![0; words_per_row * size[1] as usize * size[2] as usize];
        Ok(Self { size, origin, step_m, words_per_row, words })
    }

    /// Points along x, y and z.
    #[must_use]
    pub const fn size(&self) -> [u32; 3] {
        self.size
    }

    /// Where the point (0, 0, 0) is, metres, in the world.
    #[must_use]
    pub const fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Distance between neighbours, metres.
    #[must_use]
    pub const fn step_m(&self) -> f64 {
        self.step_m
    }

    /// Where a point is, metres, in the world.
    #[must_use]
    pub fn place(&self, idx: [u32; 3]) -> DVec3 {
        self.origin + self.step_m * DVec3::from(idx.map(f64::from))
    }

    /// Whether the grid has this point.
    #[must_use]
    pub fn has(&self, idx: [u32; 3]) -> bool {
        idx.iter().zip(self.size).all(|(at, side)| *at < side)
    }

    /// Whether a point is inside; what the grid does not have is outside.
    #[must_use]
    pub fn get(&self, idx: [u32; 3]) -> bool {
        self.has(idx) && self.words[self.word_of(idx)] >> (idx[0] % 64) & 1 == 1
    }

    /// Puts a point inside.
    ///
    /// # Panics
    /// When the grid does not have it.
    pub fn set(&mut self, idx: [u32; 3]) {
        assert!(self.has(idx), "point {idx:?} is not in a grid of {:?}", self.size);
        let word = self.word_of(idx);
        self.words[word] |= 1 << (idx[0] % 64);
    }

    /// Puts a point outside.
    ///
    /// # Panics
    /// When the grid does not have it.
    pub fn clear(&mut self, idx: [u32; 3]) {
        assert!(self.has(idx), "point {idx:?} is not in a grid of {:?}", self.size);
        let word = self.word_of(idx);
        self.words[word] &= !(1 << (idx[0] % 64));
    }

    /// Puts those points of a row inside whose x is in the run; what of it is beyond the grid is left out.
    ///
    /// # Panics
    /// When the grid does not have the row.
    pub fn set_run(&mut self, run: Range<u32>, y: u32, z: u32) {
        let end = run.end.min(self.size[0]);
        let mut x = run.start;
        while x < end {
            assert!(self.has([x, y, z]), "row ({y}, {z}) is not in a grid of {:?}", self.size);
            let n_bits = (end - x).min(64 - x % 64);
            let word = self.word_of([x, y, z]);
            self.words[word] |= u64::MAX >> (64 - n_bits) << (x % 64);
            x += n_bits;
        }
    }

    /// How many points are inside.
    #[must_use]
    pub fn n_inside(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// Lowest and highest index of what is inside along each axis, both inclusive; none where nothing is.
    #[must_use]
    pub fn bounds_inside(&self) -> Option<([u32; 3], [u32; 3])> {
        let (mut low, mut high) = ([u32::MAX; 3], [0; 3]);
        for (word, y, z) in self.words_at() {
            let bits = self.word(word, y, z);
            if bits != 0 {
                let first = word as u32 * 64;
                low = least(low, [first + bits.trailing_zeros(), y, z]);
                high = most(high, [first + 63 - bits.leading_zeros(), y, z]);
            }
        }
        (low[0] != u32::MAX).then_some((low, high))
    }

    /// All words: which of its row, and the row's y and z.
    fn words_at(&self) -> impl Iterator<Item = (usize, u32, u32)> + use<> {
        let (words_per_row, [_, size_y, size_z]) = (self.words_per_row, self.size);
        let row = move |z| (0..size_y).flat_map(move |y| (0..words_per_row).map(move |word| (word, y, z)));
        (0..size_z).flat_map(row)
    }

    const fn word_of(&self, [x, y, z]: [u32; 3]) -> usize {
        (z as usize * self.size[1] as usize + y as usize) * self.words_per_row + x as usize / 64
    }

    /// The points from 64 `word` on of a row; none where the grid ends.
    fn word(&self, word: usize, y: u32, z: u32) -> u64 {
        let is_in_grid = word < self.words_per_row && y < self.size[1] && z < self.size[2];
        if is_in_grid { self.words[self.word_of([0, y, z]) + word] } else { 0 }
    }

    /// Edges of the grid, those that leave it included, of which one end is inside: the net's quads.
    pub(super) fn n_crossings(&self) -> u64 {
        let mut count = 0;
        for z in 0..=self.size[2] {
            for y in 0..=self.size[1] {
                let mut last_bit = 0;
                for word in 0..=self.words_per_row {
                    let here = self.word(word, y, z);
                    // Before the first row there is none: u32::MAX is beyond the grid.
                    let before = [
                        here << 1 | last_bit,
                        self.word(word, y.wrapping_sub(1), z),
                        self.word(word, y, z.wrapping_sub(1)),
                    ];
                    last_bit = here >> 63;
                    count += before.iter().map(|of| u64::from((here ^ of).count_ones())).sum::<u64>();
                }
            }
        }
        count
    }

    /// Adds points until what is inside is well-composed, and says how many. What is added lies within the bounds of what was
    /// inside. One walk is enough: whatever an added point makes critical is mended at once.
    pub(super) fn mend(&mut self) -> usize {
        let mut n_mended = 0;
        for (word, y, z) in self.words_at() {
            while let Some(bit) = lowest_bit(self.critical_cubes(word, y, z)) {
                n_mended += self.mend_from([word as u32 * 64 + bit, y, z]);
            }
        }
        n_mended
    }

    /// A bit for each of 64 cubes of eight points that is critical.
    fn critical_cubes(&self, word: usize, y: u32, z: u32) -> u64 {
        let rows: [[u64; 2]; 4] = from_fn(|row| {
            let (y, z) = (y + row as u32 % 2, z + row as u32 / 2);
            let here = self.word(word, y, z);
            [here, here >> 1 | self.word(word + 1, y, z) << 63]
        });
        let corners: [u64; 8] = from_fn(|corner| rows[corner / 2][corner % 2]);
        // Most of a grid is far from the surface.
        if corners == [0; 8] || corners == [u64::MAX; 8] {
            return 0;
        }
        FACES.iter().fold(critical_diagonals(&corners), |found, face| found | critical_face(&corners, *face))
    }

    /// Mends a cube and what that makes critical; says how many points were added.
    fn mend_from(&mut self, cube: [u32; 3]) -> usize {
        let mut n_mended = 0;
        let mut pending = vec![cube];
        while let Some(cube) = pending.pop() {
            let Some(added) = self.wanting(cube) else { continue };
            self.set(added);
            n_mended += 1;
            // A cube that begins before the grid has no critical face of its own.
            let around = (0..8).filter_map(|corner| {
                let [x, y, z] = offset_of(corner);
                Some([added[0].checked_sub(x)?, added[1].checked_sub(y)?, added[2].checked_sub(z)?])
            });
            pending.extend(around.filter(|cube| self.wanting(*cube).is_some()));
        }
        n_mended
    }

    /// A point that a critical cube lacks; none where the cube is not critical.
    pub(super) fn wanting(&self, cube: [u32; 3]) -> Option<[u32; 3]> {
        let points: [[u32; 3]; 8] = from_fn(|corner| {
            let offset = offset_of(corner);
            from_fn(|axis| cube[axis] + offset[axis])
        });
        let corners = points.map(|point| u64::from(self.get(point)));
        let is_outside = |corner: &usize| corners[*corner] == 0;
        let on_face = FACES.iter().find(|face| critical_face(&corners, **face) & 1 == 1);
        let corner = match on_face {
            Some(face) => face.iter().copied().find(is_outside),
            None if critical_diagonals(&corners) & 1 == 1 => (0..8).find(is_outside),
            None => None,
        };
        corner.map(|corner| points[corner])
    }
}

/// The corners of those three faces of a cube that meet in its lower corner: two that lie diagonally, then the others. The other
/// three are such faces of the next cubes. Bit 0 of a corner is its x, bit 1 y, bit 2 z.
const FACES: [[usize; 4]; 3] = [[0, 3, 1, 2], [0, 5, 1, 4], [0, 6, 2, 4]];

/// Where exactly two corners of a face, that lie diagonally, are inside. Each bit of a corner is another cube's.
const fn critical_face(corners: &[u64; 8], [a, b, c, d]: [usize; 4]) -> u64 {
    let [a, b, c, d] = [corners[a], corners[b], corners[c], corners[d]];
    (a & b & !(c | d)) | (c & d & !(a | b))
}

/// Where exactly two corners of a cube, opposite each other, are inside, or outside. Each bit of a corner is another cube's.
fn critical_diagonals(corners: &[u64; 8]) -> u64 {
    (0..4).fold(0, |found, corner| {
        let others = (0..8).filter(|of| *of != corner && *of != 7 - corner).map(|of| corners[of]);
        let (any, all) = others.fold((0, u64::MAX), |(any, all), of| (any | of, all & of));
        let [a, b] = [corners[corner], corners[7 - corner]];
        found | (a & b & !any) | (!(a | b) & all)
    })
}

const fn offset_of(corner: usize) -> [u32; 3] {
    [corner as u32 & 1, corner as u32 >> 1 & 1, corner as u32 >> 2]
}

fn lowest_bit(bits: u64) -> Option<u32> {
    (bits != 0).then(|| bits.trailing_zeros())
}

fn least(a: [u32; 3], b: [u32; 3]) -> [u32; 3] {
    from_fn(|axis| a[axis].min(b[axis]))
}

pub(super) fn most(a: [u32; 3], b: [u32; 3]) -> [u32; 3] {
    from_fn(|axis| a[axis].max(b[axis]))
}
