//! Dense optical flow between two grey pictures of which parts are known: coarse to fine, by least squares in windows.
//!
//! `[LK81]` Lucas and Kanade 1981, An iterative image registration technique with an application to stereo vision; `[B00]` Bouguet 2000,
//! Pyramidal implementation of the Lucas Kanade feature tracker, here at every pixel. Windows' means do not count, so that pictures may be
//! exposed differently; flat places keep what coarser levels say of them.

use glam::{Mat2, Vec2};

/// A grey picture, parts of which are known.
#[derive(Clone, Debug)]
pub(super) struct Gray {
    pub(super) size_px: [usize; 2],
    /// 8-bit codes, row by row.
    pub(super) codes: Vec<f32>,
    pub(super) is_known: Vec<bool>,
}

/// Pixels of a window to each side of its middle.
const HALF: usize = 5;

/// Levels end where a side would have fewer pixels.
const LEAST_PX: usize = 16;

/// Steps of every level.
const STEPS: u32 = 4;

/// Squares of steps between pixels, in codes, that are noise: what is flatter does not move.
const NOISE: f64 = 25.0;

/// Of its longer side, as far as a picture may lie beside another.
const FARTHEST: f32 = 1.0 / 32.0;

/// What is summed up over a window: how many pixels, differences and their squares, gradients, and products of all.
type Sums = [f64; 10];

/// By how much every pixel of `from` lies beside where `to` shows the same, pixels: from(x) = to(x + flow(x)). 0 where either is not
/// known, and where nothing comes nearer by it. Both of one size.
///
/// **Cost** some 1500 operations a pixel.
pub(super) fn flow(from: &Gray, to: &Gray) -> Vec<Vec2> {
    let mut levels = vec![(from.clone(), to.clone())];
    while let Some((from, to)) =
        levels.last().filter(|(of, _)| of.size_px.iter().all(|px| *px >= 2 * LEAST_PX))
    {
        let halved = (from.halved(), to.halved());
        levels.push(halved);
    }
    let mut found: Option<(Vec<Vec2>, [usize; 2])> = None;
    for (from, to) in levels.iter().rev() {
        let [width, height] = from.size_px;
        let mut flow = match &found {
            Some((coarse, size_px)) => doubled(coarse, *size_px, from.size_px),
            None => vec![Vec2::ZERO; width * height],
        };
        let farthest_px = FARTHEST * width.max(height) as f32;
        for _ in 0..STEPS {
            step(from, to, &mut flow, farthest_px);
        }
        found = Some((flow, from.size_px));
    }
    let mut flow = found.map_or_else(Vec::new, |(flow, _)| flow);
    let unmoved = windows(from, to, &vec![Vec2::ZERO; flow.len()]);
    let moved = windows(from, to, &flow);
    for (pixel, of) in flow.iter_mut().enumerate() {
        let is_nearer =
            spread(&moved[pixel]).zip(spread(&unmoved[pixel])).is_some_and(|(new, old)| new < old);
        if !is_nearer {
            *of = Vec2::ZERO;
        }
    }
    flow
}

/// Variance of the differences in a window; none without pixels.
fn spread(sums: &Sums) -> Option<f64> {
    (sums[0] > 0.0).then(|| sums[2] / sums[0] - (sums[1] / sums[0]).powi(2))
}

/// One step of `[LK81]` at every pixel, and what comes of it as even as its neighbours.
fn step(from: &Gray, to: &Gray, flow: &mut [Vec2], farthest_px: f32) {
    let sums = windows(from, to, flow);
    for (own, [n, d, _, gx, gy, gxx, gxy, gyy, gxd, gyd]) in flow.iter_mut().zip(&sums) {
        if *n <= 0.0 {
            continue;
        }
        // Products about their means.
        let about = |product: f64, a: f64, b: f64| product - a * b / n;
        let (xx, xy, yy) =
            (about(*gxx, *gx, *gx) + NOISE * n, about(*gxy, *gx, *gy), about(*gyy, *gy, *gy) + NOISE * n);
        let normal = Mat2::from_cols_array(&[xx, xy, xy, yy].map(|of| of as f32));
        let residual = Vec2::new(about(*gxd, *gx, *d) as f32, about(*gyd, *gy, *d) as f32);
        // At least the noise squared: never singular.
        let over = -(normal.inverse() * residual);
        if over.is_finite() {
            *own = (*own + over.clamp_length_max(1.0)).clamp_length_max(farthest_px);
        }
    }
    let [width, height] = from.size_px;
    let before = flow.to_vec();
    for (pixel, own) in flow.iter_mut().enumerate() {
        let (x, y) = (pixel % width, pixel / width);
        let around = (y.saturating_sub(1)..(y + 2).min(height))
            .flat_map(|y| (x.saturating_sub(1)..(x + 2).min(width)).map(move |x| y * width + x));
        let (sum, n) = around
            .filter(|near| sums[*near][0] > 0.0)
            .fold((Vec2::ZERO, 0.0), |(sum, n), near| (sum + before[near], n + 1.0));
        if n > 0.0 {
            *own = sum / n;
        }
    }
}

/// Sums over every pixel's window.
fn windows(from: &Gray, to: &Gray, flow: &[Vec2]) -> Vec<Sums> {
    let [width, height] = from.size_px;
    let own: Vec<Sums> = (0..width * height)
        .map(|pixel| {
            let (x, y) = (pixel % width, pixel / width);
            let (Some([gx, gy]), Some(there)) =
                (from.gradient(x, y), to.at(Vec2::new(x as f32, y as f32) + flow[pixel]))
            else {
                return [0.0; 10];
            };
            let d = there - from.codes[pixel];
            let [d, gx, gy] = [d, gx, gy].map(f64::from);
            [1.0, d, d * d, gx, gy, gx * gx, gx * gy, gy * gy, gx * d, gy * d]
        })
        .collect();
    boxes(&boxes(&own, [1, width], [width, height]), [width, 1], [height, width])
}

/// Sums of all within [`HALF`] along lines: `n_along` items that are `along` apart, lines that are `across` apart.
fn boxes(own: &[Sums], [along, across]: [usize; 2], [n_along, n_across]: [usize; 2]) -> Vec<Sums> {
    let mut out = vec![[0.0; 10]; own.len()];
    for line in (0..n_across).map(|line| line * across) {
        let mut sum = [0.0; 10];
        let add = |sum: &mut Sums, at: usize, sign: f64| {
            sum.iter_mut().zip(&own[line + at * along]).for_each(|(sum, of)| *sum += sign * of);
        };
        (0..HALF.min(n_along)).for_each(|at| add(&mut sum, at, 1.0));
        for at in 0..n_along {
            if at + HALF < n_along {
                add(&mut sum, at + HALF, 1.0);
            }
            if at > HALF {
                add(&mut sum, at - HALF - 1, -1.0);
            }
            out[line + at * along] = sum;
        }
    }
    // Whole numbers of pixels: what sliding leaves of none is none.
    out.iter_mut().filter(|sums| sums[0] < 0.5).for_each(|sums| *sums = [0.0; 10]);
    out
}

/// A coarser level's flow at the pixels of a finer one.
fn doubled(coarse: &[Vec2], size_px: [usize; 2], finer_px: [usize; 2]) -> Vec<Vec2> {
    let at = |pixel: usize| {
        let [x, y] = [pixel % finer_px[0], pixel / finer_px[0]].map(|of| of / 2);
        2.0 * coarse[y.min(size_px[1] - 1) * size_px[0] + x.min(size_px[0] - 1)]
    };
    (0..finer_px[0] * finer_px[1]).map(at).collect()
}

impl Gray {
    /// Half as large: means of what is known, where at least two of four pixels are.
    fn halved(&self) -> Self {
        let [width, height] = self.size_px.map(|side| side / 2);
        let of = |pixel: usize| {
            let (x, y) = (2 * (pixel % width), 2 * (pixel / width));
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| (y + dy) * self.size_px[0] + x + dx);
            let known = || four.into_iter().filter(|at| self.is_known[*at]);
            let n = known().count();
            (known().map(|at| self.codes[at]).sum::<f32>() / n.max(1) as f32, n >= 2)
        };
        let (codes, is_known) = (0..width * height).map(of).unzip();
        Self { size_px: [width, height], codes, is_known }
    }

    /// Between four pixels, all of which are known.
    fn at(&self, place: Vec2) -> Option<f32> {
        let [width, height] = self.size_px;
        let low = place.floor();
        if low.x < 0.0 || low.y < 0.0 || low.x + 1.0 >= width as f32 || low.y + 1.0 >= height as f32 {
            return None;
        }
        let first = low.y as usize * width + low.x as usize;
        let four = [first, first + 1, first + width, first + width + 1];
        four.iter().all(|at| self.is_known[*at]).then(|| {
            let [a, b, c, d] = four.map(|at| self.codes[at]);
            let share = place - low;
            let (top, bottom) = (a + (b - a) * share.x, c + (d - c) * share.x);
            top + (bottom - top) * share.y
        })
    }

    /// Half the difference of both neighbours, along rows and columns, where they and the pixel are known.
    fn gradient(&self, x: usize, y: usize) -> Option<[f32; 2]> {
        let [width, height] = self.size_px;
        if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height {
            return None;
        }
        let own = y * width + x;
        let all = [own, own - 1, own + 1, own - width, own + width];
        all.iter().all(|at| self.is_known[*at]).then(|| {
            let half = |from: usize, to: usize| 0.5 * (self.codes[to] - self.codes[from]);
            [half(own - 1, own + 1), half(own - width, own + width)]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(
        size_px: [usize; 2],
        code: impl Fn(f32, f32) -> f32,
        is_known: impl Fn(usize, usize) -> bool,
    ) -> Gray {
        let places = || (0..size_px[0] * size_px[1]).map(|at| (at % size_px[0], at / size_px[0]));
        Gray {
            size_px,
            codes: places().map(|(x, y)| code(x as f32, y as f32)).collect(),
            is_known: places().map(|(x, y)| is_known(x, y)).collect(),
        }
    }

    fn cloth(x: f32, y: f32) -> f32 {
        120.0
            + 40.0 * (0.31 * x + 0.1 * y).sin()
            + 35.0 * (0.27 * y - 0.12 * x).cos()
            + 20.0 * (0.7 * x).sin() * (0.6 * y).sin()
    }

    #[test]
    fn what_lies_beside_is_found_whatever_its_exposure() {
        for moved in [Vec2::new(1.7, -0.9), Vec2::new(-2.8, 2.1), Vec2::ZERO] {
            let from = picture([120, 90], cloth, |_, _| true);
            let to = picture([120, 90], |x, y| 15.0 + cloth(x - moved.x, y - moved.y), |_, _| true);
            let found = flow(&from, &to);
            let inner =
                (0..120 * 90).filter(|at| (12..108).contains(&(at % 120)) && (12..78).contains(&(at / 120)));
            let mut off: Vec<f32> = inner.map(|at| found[at].distance(moved)).collect();
            off.sort_by(f32::total_cmp);
            assert!(
                off[off.len() / 2] < 0.1 && off[off.len() * 19 / 20] < 0.3,
                "{moved}: {} {}",
                off[off.len() / 2],
                off[off.len() * 19 / 20]
            );
        }
    }

    #[test]
    fn flat_places_those_of_one_picture_alone_and_none_stay() {
        let flat = picture([64, 64], |_, _| 90.0, |_, _| true);
        assert!(
            flow(&flat, &picture([64, 64], |_, _| 120.0, |_, _| true)).iter().all(|of| *of == Vec2::ZERO)
        );
        let left = picture([64, 64], cloth, |x, _| x < 32);
        let right = picture([64, 64], |x, y| cloth(x - 1.0, y), |x, _| x >= 32);
        assert!(flow(&left, &right).iter().all(|of| *of == Vec2::ZERO));
        let none = picture([64, 64], cloth, |_, _| false);
        assert!(flow(&none, &left).iter().all(|of| *of == Vec2::ZERO));
        // Smaller than any window.
        let tiny = picture([3, 2], cloth, |_, _| true);
        assert_eq!(flow(&tiny, &tiny), [Vec2::ZERO; 6]);
        assert!(flow(&picture([0, 0], cloth, |_, _| true), &picture([0, 0], cloth, |_, _| true)).is_empty());
    }

    #[test]
    fn nothing_is_moved_farther_than_pictures_may_lie_apart() {
        let from = picture([96, 96], cloth, |_, _| true);
        let other = picture([96, 96], |x, y| cloth(1.9 * y, 250.0 - 1.3 * x), |_, _| true);
        assert!(flow(&from, &other).iter().all(|of| of.is_finite() && of.length() <= 3.0 + 1e-4));
    }
}
