//! Zones at borders, of one pixel, of the whole picture, at odd sizes; chroma.

use super::*;
use crate::frame::{BufferPool, ColorMatrix, ColorRange, YuvImage};
use proptest::prelude::*;

/// Columns and rows that are hidden, row by row, `#` for hidden.
fn drawn(mask: &ZoneMask) -> Vec<String> {
    let (width, height) = mask.size_px();
    let row = |y| (0..width).map(|x| if mask.hides(x, y) { '#' } else { '.' }).collect();
    (0..height).map(row).collect()
}

fn of(polygons: &[&[[f64; 2]]], size_px: (u32, u32)) -> ZoneMask {
    ZoneMask::of(polygons.iter().copied(), size_px)
}

const WHOLE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

#[test]
fn every_pixel_that_a_zone_touches_is_hidden() {
    let check = |polygon: &[[f64; 2]], size_px, expected: &[&str]| {
        assert_eq!(drawn(&of(&[polygon], size_px)), expected, "{polygon:?}");
    };
    // Along the pixels' borders: those within, and no others.
    let middle = [[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]];
    check(&middle, (4, 4), &["....", ".##.", ".##.", "...."]);
    // A little more in each direction.
    let wider = [[0.24, 0.24], [0.76, 0.24], [0.76, 0.76], [0.24, 0.76]];
    check(&wider, (4, 4), &["####", "####", "####", "####"]);
    // Thinner than a pixel, upright, level and slanting.
    check(&[[0.3, 0.0], [0.31, 0.0], [0.31, 1.0], [0.3, 1.0]], (4, 3), &[".#..", ".#..", ".#.."]);
    check(&[[0.1, 0.5], [0.9, 0.5], [0.9, 0.51]], (5, 3), &[".....", "#####", "....."]);
    check(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.999]], (4, 4), &["##..", ".##.", "..##", "...#"]);
    // In a corner, within one pixel.
    check(&[[0.99, 0.99], [1.0, 0.99], [1.0, 1.0]], (3, 3), &["...", "...", "..#"]);
    check(&WHOLE, (3, 2), &["###", "###"]);
    // A notch is seen where no pixel of it is touched.
    let notch = [
        [0.0, 0.0],
        [1.0, 0.0],
        [1.0, 1.0],
        [0.75, 1.0],
        [0.75, 0.25],
        [0.25, 0.25],
        [0.25, 1.0],
        [0.0, 1.0],
    ];
    check(&notch, (4, 4), &["####", "#..#", "#..#", "#..#"]);
}

#[test]
fn one_pixel_wide_and_one_pixel_in_all() {
    for size_px in [(1, 1), (1, 7), (7, 1), (3, 3), (64, 48), (65, 49)] {
        let (width, height) = (f64::from(size_px.0), f64::from(size_px.1));
        for (x, y) in [(0, 0), (size_px.0 - 1, size_px.1 - 1), (size_px.0 / 2, size_px.1 / 2)] {
            // A speck in the pixel's middle.
            let at = |right: f64, down: f64| [(f64::from(x) + right) / width, (f64::from(y) + down) / height];
            let mask = of(&[&[at(0.4, 0.4), at(0.6, 0.4), at(0.6, 0.6)]], size_px);
            assert_eq!((mask.bits().count_ones(), mask.hides(x, y)), (1, true), "{size_px:?} {x} {y}");
        }
        assert_eq!(of(&[&WHOLE], size_px).bits().count_ones(), u64::from(size_px.0 * size_px.1));
        assert_eq!(of(&[], size_px).bits().count_ones(), 0);
    }
}

/// A picture in which every sample is its own, in rows with padding.
fn motley(width: u32, height: u32) -> YuvImage {
    let mut layout = YuvLayout::packed(width, height);
    layout.strides = [width as usize + 5, width.div_ceil(2) as usize + 3, width.div_ceil(2) as usize + 3];
    let chroma_rows = height.div_ceil(2) as usize;
    layout.offsets = [0, layout.strides[0] * height as usize, 0];
    layout.offsets[2] = layout.offsets[1] + layout.strides[1] * chroma_rows;
    let len = layout.offsets[2] + layout.strides[2] * chroma_rows;
    let data: Vec<u8> = (0..len).map(|idx| (idx * 31 % 97) as u8).collect();
    YuvImage::new(layout, ColorMatrix::Bt709, ColorRange::Full, data).unwrap()
}

#[test]
fn chroma_that_stands_for_a_hidden_pixel_is_hidden_and_all_else_stays() {
    let pool = BufferPool::new(2);
    for (width, height) in [(1, 1), (2, 2), (5, 3), (8, 6), (33, 17)] {
        for polygon in
            [&WHOLE[..], &[[0.0, 0.0], [0.6, 0.0], [0.0, 0.7]], &[[0.9, 0.9], [1.0, 0.9], [1.0, 1.0]]]
        {
            let mask = Arc::new(of(&[polygon], (width, height)));
            let image = motley(width, height);
            let masked = image.masked_of(&pool, &mask);
            assert_eq!((masked.width(), masked.height()), (width, height));
            assert_eq!((masked.matrix(), masked.range()), (image.matrix(), image.range()));
            for (plane, scale) in [(0, 1), (1, 2), (2, 2)] {
                let (before, after) = (image.plane(plane), masked.plane(plane));
                for (x, y) in (0..after.height).flat_map(|y| (0..after.width).map(move |x| (x, y))) {
                    let touched = mask.touches([x * scale, y * scale], [scale, scale]);
                    let expected = [before.row(y)[x as usize], NEUTRAL_YUV[plane]][usize::from(touched)];
                    assert_eq!(
                        after.row(y)[x as usize],
                        expected,
                        "{width} x {height}, plane {plane}: {x} {y}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_mask_over_another_hides_what_either_hides() {
    let pool = BufferPool::new(2);
    let one = Arc::new(of(&[&[[0.0, 0.0], [0.25, 0.0], [0.25, 1.0], [0.0, 1.0]]], (8, 4)));
    let other = Arc::new(of(&[&[[0.5, 0.0], [1.0, 0.0], [1.0, 0.5], [0.5, 0.5]]], (8, 4)));
    let both = motley(8, 4).masked_of(&pool, &one).masked_of(&pool, &other);
    let hidden = both.zone_mask().unwrap();
    assert_eq!(drawn(hidden), ["##..####", "##..####", "##......", "##......"]);
    assert!(hidden.covers(&one) && hidden.covers(&other) && !one.covers(&other));
    assert_eq!(both.plane(0).row(3)[0], NEUTRAL_YUV[0]);
    assert_eq!(both.plane(0).row(0)[7], NEUTRAL_YUV[0]);
    assert!(Arc::ptr_eq(both.masked_of(&pool, &one).zone_mask().unwrap(), hidden), "nothing is added");
}

#[test]
fn smaller_pictures_hide_what_stands_for_anything_hidden() {
    let mask = of(&[&[[0.5, 0.5], [0.51, 0.5], [0.51, 0.51]]], (64, 48));
    for factor in [1, 2, 3, 4] {
        let reduced = mask.reduced(factor);
        assert_eq!(reduced.count_ones(), 1);
        assert!(reduced.get(32 / factor as usize, 24 / factor as usize));
        assert_eq!(
            (reduced.width(), reduced.height()),
            (64_usize.div_ceil(factor as usize), 48_usize.div_ceil(factor as usize))
        );
    }
    assert!(
        mask.touches([30, 20], [3, 5]) && !mask.touches([30, 20], [2, 5]) && !mask.touches([33, 0], [99, 99])
    );
    // With the pixels that share its colour.
    let unseen = |x, y| mask.sight().get(x, y) == 0;
    assert!([(32, 24), (33, 24), (32, 25), (33, 25)].into_iter().all(|(x, y)| unseen(x, y)));
    assert!(![(31, 24), (34, 24), (32, 23), (32, 26)].into_iter().any(|(x, y)| unseen(x, y)));
}

#[test]
fn the_memory_of_masked_pictures_goes_round() {
    let (pool, mask) = (BufferPool::new(2), Arc::new(of(&[&WHOLE[..3]], (64, 48))));
    let image = motley(64, 48);
    let first = image.masked_of(&pool, &mask);
    let place = first.plane(0).data.as_ptr();
    drop(first);
    assert_eq!(image.masked_of(&pool, &mask).plane(0).data.as_ptr(), place);
}

proptest! {
    /// No point of a zone lies in a pixel that is seen.
    #[test]
    fn no_point_of_a_zone_is_seen(
        corners in prop::collection::vec((0.0..=1.0, 0.0..=1.0), 3),
        (width, height) in (1_u32..40, 1_u32..40),
        weights in prop::collection::vec((0.0..1.0, 0.0..1.0), 40),
    ) {
        let corners: Vec<[f64; 2]> = corners.into_iter().map(|(u, v)| [u, v]).collect();
        let mask = of(&[&corners], (width, height));
        for (one, other) in weights {
            // Of a triangle, by its corners.
            let (a, b): (f64, f64) = if one + other > 1.0 { (1.0 - one, 1.0 - other) } else { (one, other) };
            let at = |axis: usize| {
                a * corners[0][axis] + b * corners[1][axis] + (1.0 - a - b) * corners[2][axis]
            };
            let (x, y) = (at(0) * f64::from(width), at(1) * f64::from(height));
            // On a border either side will do.
            let is_inner = |value: f64| (value - value.round()).abs() > 1e-9;
            if is_inner(x) && is_inner(y) {
                prop_assert!(mask.hides(x as u32, y as u32), "{x} {y} of {corners:?}");
            }
        }
    }
}
