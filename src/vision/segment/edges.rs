//! Whether something was put somewhere or taken from there: which of two pictures has edges along an outline.
//!
//! Luma of a frame and of its background, and a blob's outline, flow in; the mean steps across the outline flow out.
//! Where a thing stands, its outline is an edge of the frame; where one was taken away, it is an edge of the background,
//! which still shows the thing.
//!
//! `[C04]` Connell et al. 2004, Detection and tracking in the IBM People Vision system: edge energy along an outline
//! tells what was left from what was removed.

use crate::frame::Plane;

/// Pixels to either side of an outline within which its edge is looked for: masks are no more exact than that.
const REACH_PX: i64 = 2;

/// Distance from an outline, pixels, of what is compared with it: what lies there has as many edges as the place has anyway.
const BESIDE_PX: i64 = 5;

/// A mean step below this, 8-bit levels, is noise.
const LEAST_STEP: f32 = 6.0;

/// How many times stronger the one must be than the other to say.
const CLEAR_RATIO: f32 = 1.4;

/// What an outline is an edge of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutlineOf {
    /// Of the frame: something is there that the background does not know.
    Thing,
    /// Of the background: something is gone.
    Gap,
    /// Of both or of neither.
    Unclear,
}

/// Tells what `contour` (as [`super::Blob::contour`]) is an outline of, from the luma of a frame and of its background.
#[must_use]
pub fn outline_of(frame: Plane<'_>, background: Plane<'_>, contour: &[[u16; 2]]) -> OutlineOf {
    let (seen, learned) = (mean_step(frame, contour), mean_step(background, contour));
    if seen.max(learned) < LEAST_STEP {
        OutlineOf::Unclear
    } else if seen > CLEAR_RATIO * learned.max(0.0) {
        OutlineOf::Thing
    } else if learned > CLEAR_RATIO * seen.max(0.0) {
        OutlineOf::Gap
    } else {
        OutlineOf::Unclear
    }
}

/// Mean over an outline's unit edges of the greatest step of luma across it nearby, less that at [`BESIDE_PX`] inside and outside of it,
/// 8-bit levels; edges on the picture's border have none.
fn mean_step(plane: Plane<'_>, contour: &[[u16; 2]]) -> f32 {
    let (mut sum, mut n_edges) = (0.0, 0_u32);
    let mut add = |at: [i64; 2], across: [i64; 2]| {
        let Some(step) = greatest_step(plane, at, across) else { return };
        let beside = [-BESIDE_PX, BESIDE_PX].map(|offset| {
            greatest_step(plane, [at[0] + offset * across[0], at[1] + offset * across[1]], across)
        });
        let n_beside = beside.iter().flatten().count();
        if n_beside > 0 {
            sum += step - beside.iter().flatten().sum::<f32>() / n_beside as f32;
            n_edges += 1;
        }
    };
    let ends = contour.iter().cycle().skip(1);
    for (from, to) in contour.iter().zip(ends) {
        let (x0, x1) = (from[0].min(to[0]), from[0].max(to[0]));
        let (y0, y1) = (from[1].min(to[1]), from[1].max(to[1]));
        if x0 == x1 {
            (y0..y1).for_each(|y| add([i64::from(x0), i64::from(y)], [1, 0]));
        } else {
            (x0..x1).for_each(|x| add([i64::from(x), i64::from(y0)], [0, 1]));
        }
    }
    if n_edges == 0 { 0.0 } else { sum / n_edges as f32 }
}

/// The greatest difference of neighbours along `across` among the pixels up to `REACH_PX` before and behind `at`.
fn greatest_step(plane: Plane<'_>, at: [i64; 2], across: [i64; 2]) -> Option<f32> {
    let luma = |offset: i64| {
        let [x, y] = [at[0] + offset * across[0], at[1] + offset * across[1]];
        let is_inside = x >= 0 && y >= 0 && x < i64::from(plane.width) && y < i64::from(plane.height);
        is_inside.then(|| plane.row(y as u32)[x as usize])
    };
    // Both sides of the edge itself must be there.
    luma(-1)?;
    luma(0)?;
    (-REACH_PX..REACH_PX)
        .filter_map(|offset| Some(f32::from(luma(offset)?.abs_diff(luma(offset + 1)?))))
        .reduce(f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

    /// A floor with some texture, and on it a thing in columns 10 to 19, rows 8 to 23, if there is one.
    fn picture(thing: Option<u8>, noise: u32) -> YuvImage {
        let layout = YuvLayout::packed(40, 32);
        let mut data = vec![128; YuvLayout::packed_len(40, 32)];
        for (i, value) in data[..40 * 32].iter_mut().enumerate() {
            let (x, y) = (i % 40, i / 40);
            let hash = (i as u32).wrapping_mul(0x9e37_79b9).wrapping_add(noise).wrapping_mul(0x85eb_ca6b);
            let floor = 120 + (hash >> 30) as u8;
            *value = thing.filter(|_| (10..20).contains(&x) && (8..24).contains(&y)).unwrap_or(floor);
        }
        YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
    }

    #[test]
    fn a_thing_and_a_gap_are_told_apart() {
        let outline = [[10, 8], [20, 8], [20, 24], [10, 24]];
        // As masks are: one pixel too wide and too high.
        let wide = [[9, 7], [21, 7], [21, 25], [9, 25]];
        let tell = |seen: Option<u8>, learned: Option<u8>, outline: &[[u16; 2]]| {
            let (frame, background) = (picture(seen, 1), picture(learned, 2));
            outline_of(frame.plane(0), background.plane(0), outline)
        };
        for outline in [&outline, &wide] {
            for luma in [60, 200] {
                assert_eq!(tell(Some(luma), None, outline), OutlineOf::Thing, "{luma}");
                assert_eq!(tell(None, Some(luma), outline), OutlineOf::Gap, "{luma}");
            }
            assert_eq!(tell(None, None, outline), OutlineOf::Unclear, "noise");
            assert_eq!(tell(Some(60), Some(200), outline), OutlineOf::Unclear, "one in place of another");
        }
    }

    #[test]
    fn a_thing_before_a_crowded_place_is_no_gap() {
        // Stripes all over the place, so that lines anywhere cross their edges.
        let picture = |thing: Option<u8>| {
            let mut data = vec![128; YuvLayout::packed_len(60, 48)];
            for (i, value) in data[..60 * 48].iter_mut().enumerate() {
                let (x, y) = (i % 60, i / 60);
                let stripe = if (x + y) / 4 % 2 == 0 { 80 } else { 140 };
                let is_thing = (20..40).contains(&x) && (12..36).contains(&y);
                *value = thing.filter(|_| is_thing).unwrap_or(stripe);
            }
            let layout = YuvLayout::packed(60, 48);
            YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
        };
        let (place, outline) = (picture(None), [[20, 12], [40, 12], [40, 36], [20, 36]]);
        for luma in [20, 110, 200] {
            let thing = picture(Some(luma));
            assert_ne!(outline_of(thing.plane(0), place.plane(0), &outline), OutlineOf::Gap, "{luma}");
            assert_ne!(outline_of(place.plane(0), thing.plane(0), &outline), OutlineOf::Thing, "{luma}");
        }
        let dark = picture(Some(20));
        assert_eq!(outline_of(dark.plane(0), place.plane(0), &outline), OutlineOf::Thing);
        assert_eq!(outline_of(place.plane(0), dark.plane(0), &outline), OutlineOf::Gap);
    }

    #[test]
    fn steps_on_both_sides_of_an_outline_are_taken_off_it() {
        let mut data = vec![128; YuvLayout::packed_len(60, 48)];
        for row in data[..60 * 48].chunks_mut(60) {
            row.fill(80);
            row[..20].fill(140);
            row[..15].fill(100);
        }
        let layout = YuvLayout::packed(60, 48);
        let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
        // 60 at it, 40 to the left and nothing to the right; at 15 it is 40, 0 and 60.
        assert_eq!(mean_step(image.plane(0), &[[20, 10], [20, 30]]), 40.0);
        assert_eq!(mean_step(image.plane(0), &[[15, 10], [15, 30]]), 10.0);
    }

    #[test]
    fn outlines_at_the_border_and_of_nothing_are_harmless() {
        let (frame, background) = (picture(Some(60), 1), picture(None, 2));
        let whole = [[0, 0], [40, 0], [40, 32], [0, 32]];
        assert_eq!(outline_of(frame.plane(0), background.plane(0), &whole), OutlineOf::Unclear);
        assert_eq!(outline_of(frame.plane(0), background.plane(0), &[]), OutlineOf::Unclear);
        let point = YuvImage::filled(1, 1, [9, 9, 9], ColorMatrix::Bt601, ColorRange::Full);
        let outline = [[0, 0], [1, 0], [1, 1], [0, 1]];
        assert_eq!(outline_of(point.plane(0), point.plane(0), &outline), OutlineOf::Unclear);
    }
}
