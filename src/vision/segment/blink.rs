//! Tells pieces whose colours came and went here before: leaves, flags, water, barrier tape in the wind.
//!
//! A frame and its foreground flow in; how many of a run's pixels were seen so before flows out. Whoever walks or drives by brings
//! colours of its own, and leaves; what flutters brings the same again and again. A pixel whose difference only wavers around the
//! threshold has not left in between, so somebody who is hardly seen does not flutter.

use super::components::Run;
use super::difference::{Pair, TILE};
use super::dilate::dilate;
use crate::frame::{BitMask, Plane};

/// Amount that a colour's return adds to a pixel's count.
const RETURN: u8 = 32;

/// Two returns at once, or three within seconds: a pixel whose colour came back this often flutters.
const FLUTTERING: u8 = 64;

/// Counts sink by this share in this time: in ten seconds to a quarter.
const SINKING: u8 = 16;
const SINK_SECS: f64 = 0.5;

/// A colour is the one of before if they differ by at most so many codes, luma and both chroma planes together ...
const GREATEST_CODES: i32 = 30;

/// ... and by at most this share of what either differs from the background.
const GREATEST_SHARE: f32 = 0.65;

/// A piece of which at least this share flutters is no thing that moves through.
const FLUTTERING_SHARE: f64 = 0.5;

/// Colours that come and go; 4 bytes a pixel and three bits.
#[derive(Debug, Default)]
pub(super) struct Blinking {
    /// Pixels that are foreground, or were and still differ.
    present: BitMask,
    /// Colours of pixels when they were last seen as foreground; whole tiles, row by row.
    colors: Vec<[u8; 3]>,
    /// Counts of their returns.
    counts: Vec<u8>,
    /// Pixels whose count says that they flutter, and with them their neighbours.
    counted: BitMask,
    fluttering: BitMask,
    /// Time since the counts last sank.
    waited_secs: f64,
}

impl Blinking {
    /// Takes a frame's foreground and the pixels that differ by half of what makes foreground, `dt_secs` after the frame before it.
    pub(super) fn observe(
        &mut self,
        pair: &Pair<'_>,
        (foreground, weak): (&BitMask, &BitMask),
        dt_secs: f64,
    ) {
        let n_words = foreground.words().len();
        if (self.present.width(), self.present.height()) != (foreground.width(), foreground.height()) {
            self.colors.clear();
            self.colors.resize(n_words * TILE, [0; 3]);
            self.counts.clear();
            self.counts.resize(n_words * TILE, 0);
            self.counted = BitMask::new(foreground.width() as u32, foreground.height() as u32);
            self.fluttering = self.counted.clone();
            self.present = foreground.clone();
            return;
        }
        self.sink(dt_secs);
        let words_per_row = foreground.words_per_row();
        for (word, (now, weak)) in foreground.words().iter().zip(weak.words()).enumerate() {
            let present = &mut self.present.words_mut()[word];
            if *now | *present == 0 {
                continue;
            }
            let mut came = now & !*present;
            *present = (*present | now) & (now | weak);
            let (y, first) = (word / words_per_row, word % words_per_row * TILE);
            while came != 0 {
                let i = came.trailing_zeros() as usize;
                let (color, count) = (&mut self.colors[word * TILE + i], &mut self.counts[word * TILE + i]);
                let now = color_at(&pair.frame, (first + i, y));
                let is_back = is_same(color, &now, || color_at(&pair.background, (first + i, y)));
                if is_back {
                    *count = count.saturating_add(RETURN);
                } else {
                    (*color, *count) = (now, *count / 2);
                }
                let counted = &mut self.counted.words_mut()[word];
                *counted = *counted & !(1 << i) | u32::from(is_back && *count >= FLUTTERING) << i;
                came &= came - 1;
            }
            // Somebody may have come before what flutters.
            let mut staying = now & self.counted.words()[word];
            while staying != 0 {
                let i = staying.trailing_zeros() as usize;
                let now = color_at(&pair.frame, (first + i, y));
                let background = || color_at(&pair.background, (first + i, y));
                if !is_same(&self.colors[word * TILE + i], &now, background) {
                    self.counted.words_mut()[word] &= !(1 << i);
                }
                staying &= staying - 1;
            }
        }
        if self.counted.words().iter().any(|word| *word != 0) {
            dilate(&self.counted, &mut self.fluttering);
        } else {
            self.fluttering.words_mut().fill(0);
        }
    }

    fn sink(&mut self, dt_secs: f64) {
        self.waited_secs += if dt_secs > 0.0 { dt_secs.min(60.0) } else { 0.0 };
        while self.waited_secs >= SINK_SECS {
            self.waited_secs -= SINK_SECS;
            for count in &mut self.counts {
                *count -= count.div_ceil(SINKING);
            }
            let words = self.counted.words_mut().iter_mut().zip(self.counts.chunks_exact(TILE));
            for (counted, counts) in words.filter(|(counted, _)| **counted != 0) {
                for (i, count) in counts.iter().enumerate() {
                    *counted &= !(u32::from(*count < FLUTTERING) << i);
                }
            }
        }
    }

    /// Returns whether nothing was seen yet.
    pub(super) const fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    /// Returns whether most pixels of these runs flutter.
    pub(super) fn is_blinking<'a>(&self, runs: impl Iterator<Item = &'a Run>) -> bool {
        let (mut n_fluttering, mut n_pixels) = (0, 0);
        for run in runs {
            n_fluttering += self.fluttering.count_run(run.y as usize, run.start as usize, run.end as usize);
            n_pixels += run.end - run.start;
        }
        f64::from(n_fluttering) >= FLUTTERING_SHARE * f64::from(n_pixels)
    }
}

/// Returns whether a colour is the one of before, by how much either differs from the background, which is asked for if it matters.
fn is_same(before: &[u8; 3], now: &[u8; 3], background: impl Fn() -> [u8; 3]) -> bool {
    let codes = |[a, b, c]: &[u8; 3], [d, e, f]: &[u8; 3]| {
        i32::from(a.abs_diff(*d)) + i32::from(b.abs_diff(*e)) + i32::from(c.abs_diff(*f))
    };
    let changed = codes(before, now);
    if changed > GREATEST_CODES {
        return false;
    }
    let background = background();
    changed as f32 <= GREATEST_SHARE * codes(now, &background).min(codes(before, &background)) as f32
}

/// Returns a pixel's chroma and the mean luma of the pixels around it.
fn color_at([luma, u, v]: &[Plane<'_>; 3], (x, y): (usize, usize)) -> [u8; 3] {
    let chroma = |plane: &Plane<'_>| plane.row(y as u32 / 2)[x / 2];
    if x > 0 && y > 0 && x + 1 < luma.width as usize && y + 1 < luma.height as usize {
        let of_row =
            |y: usize| luma.row(y as u32)[x - 1..x + 2].iter().map(|code| u32::from(*code)).sum::<u32>();
        return [((of_row(y - 1) + of_row(y) + of_row(y + 1) + 4) / 9) as u8, chroma(u), chroma(v)];
    }
    let columns = x.saturating_sub(1)..(x + 2).min(luma.width as usize);
    let rows = y.saturating_sub(1)..(y + 2).min(luma.height as usize);
    let n = (columns.len() * rows.len()).max(1) as u32;
    let of_row =
        |y: usize| luma.row(y as u32)[columns.clone()].iter().map(|code| u32::from(*code)).sum::<u32>();
    let sum: u32 = rows.map(of_row).sum();
    [((sum + n / 2) / n) as u8, chroma(u), chroma(v)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

    const SIZE_PX: (u32, u32) = (40, 6);

    /// One frame: the luma of all of it, the columns that are foreground, and those that still differ.
    type Moment = (u8, (usize, usize), (usize, usize));

    /// Returns whether columns 5 to 15 flutter after these frames, ten a second, before a background of luma 100.
    fn flutters(moments: impl Iterator<Item = Moment>) -> bool {
        let place = picture(100);
        let mut blinking = Blinking::default();
        for (luma, foreground, weak) in moments {
            let frame = picture(luma);
            let planes = |of: &YuvImage| [of.plane(0), of.plane(1), of.plane(2)].map(|plane| plane.width);
            assert_eq!(planes(&frame), planes(&place));
            let pair = Pair {
                frame: [0, 1, 2].map(|plane| frame.plane(plane)),
                background: [0, 1, 2].map(|plane| place.plane(plane)),
            };
            blinking.observe(&pair, (&columns(foreground), &columns(weak)), 0.1);
        }
        blinking.is_blinking([Run { y: 3, start: 5, end: 15, piece_idx: 0 }].iter())
    }

    fn picture(luma: u8) -> YuvImage {
        YuvImage::filled(SIZE_PX.0, SIZE_PX.1, [luma, 128, 128], ColorMatrix::Bt601, ColorRange::Limited)
    }

    fn columns((start, end): (usize, usize)) -> BitMask {
        let mut mask = BitMask::new(SIZE_PX.0, SIZE_PX.1);
        for y in 0..SIZE_PX.1 as usize {
            mask.set_run(y, start, end);
        }
        mask
    }

    const NONE: (usize, usize) = (0, 0);

    #[test]
    fn colours_are_the_mean_luma_around_a_pixel_and_its_chroma() {
        let (width, height) = (9, 7);
        let data: Vec<u8> = (0..YuvLayout::packed_len(width, height) as u32)
            .map(|i| (i.wrapping_mul(0x9e37_79b9) >> 24) as u8)
            .collect();
        let layout = YuvLayout::packed(width, height);
        let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
        let planes = [0, 1, 2].map(|plane| image.plane(plane));
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let around = (0..height)
                .flat_map(|j| (0..width).map(move |i| (i, j)))
                .filter(|(i, j)| i.abs_diff(x) <= 1 && j.abs_diff(y) <= 1);
            let codes: Vec<u32> = around.map(|(i, j)| u32::from(planes[0].row(j)[i as usize])).collect();
            let (sum, n) = (codes.iter().sum::<u32>(), codes.len() as u32);
            let chroma = [1, 2].map(|plane: usize| planes[plane].row(y / 2)[x as usize / 2]);
            let expected = [((sum + n / 2) / n) as u8, chroma[0], chroma[1]];
            assert_eq!(color_at(&planes, (x as usize, y as usize)), expected, "{x} {y}");
        }
    }

    #[test]
    fn a_colour_that_comes_and_goes_flutters() {
        assert!(flutters((0..60).map(|frame| if frame % 8 < 4 {
            (160, (5, 15), (5, 15))
        } else {
            (100, NONE, NONE)
        })));
        // Twice is not enough: the first time is no return.
        assert!(!flutters((0..14).map(|frame| if frame % 8 < 4 {
            (160, (5, 15), (5, 15))
        } else {
            (100, NONE, NONE)
        })));
    }

    #[test]
    fn those_who_pass_in_colours_of_their_own_do_not_flutter_however_many_they_are() {
        let colors = [160, 40, 220, 60, 190, 20, 140];
        assert!(!flutters((0..200).map(|frame: usize| {
            if frame % 8 < 4 { (colors[frame / 8 % 7], (5, 15), (5, 15)) } else { (100, NONE, NONE) }
        })));
    }

    #[test]
    fn other_colours_make_what_came_back_before_forgotten() {
        let colors = [40, 220, 20, 200, 60, 240, 30, 210];
        let luma = |frame: usize| match frame {
            0..64 => 160,
            64..128 => colors[frame / 8 - 8],
            _ => 160,
        };
        let seen =
            |frame: usize| if frame % 8 < 4 { (luma(frame), (5, 15), (5, 15)) } else { (100, NONE, NONE) };
        assert!(flutters((0..60).map(seen)));
        // The first colour is back once.
        assert!(!flutters((0..140).map(seen)));
    }

    #[test]
    fn somebody_who_is_hardly_seen_and_never_leaves_does_not_flutter() {
        assert!(!flutters(
            (0..200)
                .map(|frame| { if frame % 4 < 2 { (130, (5, 15), (5, 15)) } else { (125, NONE, (5, 15)) } })
        ));
    }

    #[test]
    fn before_a_dark_place_colours_are_compared_by_how_much_they_differ_from_it() {
        // Others, each 12 codes from the background and up to 9 from each other: no colour that came back.
        assert!(!flutters((0..200).map(|frame: usize| {
            if frame % 8 < 4 { ([112, 121][frame / 8 % 2], (5, 15), (5, 15)) } else { (100, NONE, NONE) }
        })));
    }

    #[test]
    fn fluttering_is_forgotten_and_time_that_stands_or_leaps_is_harmless() {
        let flutter = |frame: usize| if frame % 8 < 4 { (160, (5, 15), (5, 15)) } else { (100, NONE, NONE) };
        assert!(!flutters((0..60).map(flutter).chain((0..300).map(|_| (100, NONE, NONE)))));
        let place = picture(100);
        let planes = [0, 1, 2].map(|plane| place.plane(plane));
        let pair = Pair { frame: planes, background: planes };
        let mut blinking = Blinking::default();
        for dt_secs in [0.0, f64::NAN, -5.0, 1e9, f64::INFINITY] {
            blinking.observe(&pair, (&columns((5, 15)), &columns(NONE)), dt_secs);
        }
        // Another size begins anew.
        let one = YuvImage::filled(1, 1, [9, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
        let planes = [0, 1, 2].map(|plane| one.plane(plane));
        let (seen, none) = (BitMask::new(1, 1), BitMask::new(1, 1));
        blinking.observe(&Pair { frame: planes, background: planes }, (&seen, &none), 0.1);
        assert!(!blinking.is_blinking([Run { y: 0, start: 0, end: 1, piece_idx: 0 }].iter()));
    }
}
