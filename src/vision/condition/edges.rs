//! Edges of a look: its gradient, with the contrast taken out, and products of two such fields.
//!
//! Cells flow in, two signed planes flow out. Knows nothing of time.

/// Gradient at which an edge counts one half, levels a cell: well above the noise of a look's mean, well below the
/// edges of a place.
const HALF_GRADIENT: f32 = 2.0;

/// An edge of full strength, in the fields' whole numbers: their products over a look fit 32 bits.
pub(super) const FULL: f32 = 127.0;

/// The edges of a look: for every cell the direction of the gradient g, of length |g|^2 / (|g|^2 + h^2), so that gain
/// matters little, offset not at all, and noise next to nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct Edges {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Row-major, from the left to the right positive.
    pub(super) x: Vec<i16>,
    /// Row-major, downwards positive.
    pub(super) y: Vec<i16>,
}

/// A rectangle of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Cells {
    pub(super) left: usize,
    pub(super) top: usize,
    pub(super) right: usize,
    pub(super) bottom: usize,
}

impl Cells {
    /// The part that lies within `width` x `height` cells when displaced by `shift`.
    pub(super) fn displaced_within(self, shift: [i32; 2], width: usize, height: usize) -> Self {
        let clip = |first: usize, end: usize, by: i32, len: usize| {
            let least = (-by).max(0) as usize;
            let most = (len as i32 - by).clamp(0, len as i32) as usize;
            let first = first.max(least);
            (first, end.min(most).max(first))
        };
        let (left, right) = clip(self.left, self.right, shift[0], width);
        let (top, bottom) = clip(self.top, self.bottom, shift[1], height);
        Self { left, top, right, bottom }
    }

    pub(super) const fn is_empty(self) -> bool {
        self.right <= self.left || self.bottom <= self.top
    }
}

impl Edges {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { width, height, x: vec![0; width * height], y: vec![0; width * height] }
    }

    /// All cells.
    pub(super) const fn cells(&self) -> Cells {
        Cells { left: 0, top: 0, right: self.width, bottom: self.height }
    }

    /// Takes the edges of `luma` by central differences; the outermost cells have none.
    pub(super) fn compute(&mut self, luma: &[f32]) {
        let width = self.width;
        for y in 1..self.height - 1 {
            let row = y * width;
            let inner = row + 1..row + width - 1;
            let (left, right) = (&luma[row..row + width - 2], &luma[row + 2..row + width]);
            let (above, below) = (
                &luma[inner.start - width..inner.end - width],
                &luma[inner.start + width..inner.end + width],
            );
            let out = self.x[inner.clone()].iter_mut().zip(&mut self.y[inner]);
            let along = left.iter().zip(right);
            let across = above.iter().zip(below);
            for (((out_x, out_y), (left, right)), (above, below)) in out.zip(along).zip(across) {
                let (x, y) = (0.5 * (right - left), 0.5 * (below - above));
                let squared = x * x + y * y;
                let gain = FULL * squared.sqrt() / (squared + HALF_GRADIENT * HALF_GRADIENT);
                (*out_x, *out_y) = ((gain * x) as i16, (gain * y) as i16);
            }
        }
    }

    /// Leaves out edges weaker than `least`, a share of a full one.
    pub(super) fn drop_weak(&mut self, least: f32) {
        let least = (least * FULL) as i32;
        for (x, y) in self.x.iter_mut().zip(&mut self.y) {
            if i32::from(*x) * i32::from(*x) + i32::from(*y) * i32::from(*y) < least * least {
                (*x, *y) = (0, 0);
            }
        }
    }

    /// Sum over `cells` of this field times `other` at the cells displaced by `shift`, which must lie within it.
    pub(super) fn product(&self, cells: Cells, other: &Self, shift: [i32; 2]) -> i64 {
        if cells.is_empty() {
            return 0;
        }
        let len = cells.right - cells.left;
        let mut sum = 0;
        for y in cells.top..cells.bottom {
            let here = y * self.width + cells.left;
            let there = (y as i64 + i64::from(shift[1])) as usize * other.width
                + (cells.left as i64 + i64::from(shift[0])) as usize;
            let x = row_product(&self.x[here..here + len], &other.x[there..there + len]);
            let y = row_product(&self.y[here..here + len], &other.y[there..there + len]);
            sum += i64::from(x) + i64::from(y);
        }
        sum
    }
}

fn row_product(a: &[i16], b: &[i16]) -> i32 {
    a.iter().zip(b).map(|(a, b)| i32::from(*a) * i32::from(*b)).sum()
}

/// `luma` at half the width and height, rounded down: means of 2 x 2.
pub(super) fn halve(luma: &[f32], width: usize, out: &mut [f32]) {
    let half = width / 2;
    for (out, rows) in out.chunks_exact_mut(half).zip(luma.chunks_exact(2 * width)) {
        let (upper, lower) = rows.split_at(width);
        for ((out, upper), lower) in out.iter_mut().zip(upper.chunks_exact(2)).zip(lower.chunks_exact(2)) {
            *out = 0.25 * (upper[0] + upper[1] + lower[0] + lower[1]);
        }
    }
}
