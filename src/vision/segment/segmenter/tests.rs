//! Checks results of segmentation on frames that are made for one question each.

use super::super::object_sizes::ObjectSize;
use super::*;
use crate::config::StageChoice;
use crate::frame::{ColorMatrix, ColorRange, YuvLayout};
use crate::segment::{MOVING, SHADOW};

/// A rectangle's left column, upper row, width, height, luma, U and V.
type Thing = (u32, u32, u32, u32, u8, u8, u8);

/// A grey-green floor with things on it.
fn picture(width: u32, height: u32, things: &[Thing]) -> YuvImage {
    let layout = YuvLayout::packed(width, height);
    let mut data = vec![140; YuvLayout::packed_len(width, height)];
    data[layout.offsets[1]..layout.offsets[2]].fill(120);
    data[layout.offsets[2]..].fill(116);
    for (left, top, w, h, luma, u, v) in things.iter().copied() {
        for y in top..top + h {
            for x in left..left + w {
                data[(y * width + x) as usize] = luma;
                let chroma = ((y / 2) * width.div_ceil(2) + x / 2) as usize;
                data[layout.offsets[1] + chroma] = u;
                data[layout.offsets[2] + chroma] = v;
            }
        }
    }
    YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
}

fn planes(image: &YuvImage) -> [Plane<'_>; 3] {
    [image.plane(0), image.plane(1), image.plane(2)]
}

fn all(width: u32, height: u32) -> BitMask {
    let mut bits = BitMask::new(width, height);
    (0..height as usize).for_each(|y| bits.set_run(y, 0, width as usize));
    bits
}

/// Everything may be foreground for the mixture's part.
fn segment(settings: &SegmentSettings, frame: &YuvImage) -> Segmentation {
    let background = picture(frame.width(), frame.height(), &[]);
    let unmatched = all(frame.width(), frame.height());
    let found = Segmenter::new(settings).segment(frame, planes(&background), &unmatched, 0.1);
    check_consistency(&found);
    found
}

/// Asserts what holds for every result.
fn check_consistency(found: &Segmentation) {
    let n_moving = found.labels.data.iter().filter(|label| **label == MOVING).count() as u64;
    let areas: u64 = found.blobs.iter().map(|blob| u64::from(blob.area_px)).sum();
    assert!(n_moving >= areas, "every pixel of a blob is moving: {n_moving}, {areas}");
    for (soft, label) in found.soft_mask.data.iter().zip(&found.labels.data) {
        assert_eq!(*soft >= 128, *label == MOVING);
    }
    for blob in &found.blobs {
        let rect = blob.rect;
        assert!(rect.x + rect.width <= found.labels.width && rect.y + rect.height <= found.labels.height);
        assert!((f64::from(rect.x)..f64::from(rect.x + rect.width)).contains(&blob.foot_in_image[0]));
        assert_eq!(blob.foot_in_image[1], f64::from(rect.y + rect.height));
    }
}

fn sharp() -> SegmentSettings {
    SegmentSettings { blur_sigma_px: Some(0.0), min_area_px: 1, ..SegmentSettings::default() }
}

#[test]
fn person_becomes_a_blob_with_its_foot() {
    let found = segment(&sharp(), &picture(65, 49, &[(20, 10, 8, 20, 60, 140, 140)]));
    let rect = PixelRect { x: 20, y: 10, width: 8, height: 20 };
    let foot_in_image = [24.0, 30.0];
    let contour = [[20, 10], [28, 10], [28, 30], [20, 30]].into();
    assert_eq!(found.blobs, [Blob { rect, area_px: 160, foot_in_image, is_truncated: false, contour }]);
    assert_eq!(found.soft_mask.get(24, 20), 255);
    assert_eq!(found.soft_mask.get(10, 20), 0);
}

#[test]
fn blur_of_the_default_keeps_the_size_within_two_pixels() {
    let found = segment(&SegmentSettings::default(), &picture(96, 80, &[(30, 20, 20, 40, 50, 150, 150)]));
    assert_eq!(found.blobs.len(), 1);
    let rect = found.blobs[0].rect;
    assert!(rect.x.abs_diff(30) <= 2 && rect.y.abs_diff(20) <= 2, "{rect:?}");
    assert!(rect.width.abs_diff(20) <= 4 && rect.height.abs_diff(40) <= 4, "{rect:?}");
    let edge: Vec<u8> = (24..36).map(|x| found.soft_mask.get(x, 40)).collect();
    assert!(edge.windows(2).all(|pair| pair[0] <= pair[1]), "{edge:?}");
    assert!(edge.iter().any(|soft| (1..255).contains(soft)), "{edge:?}");
}

#[test]
fn what_touches_the_sides_or_the_foot_of_the_picture_is_truncated() {
    let check = |left, top, expected: bool| {
        let found = segment(&sharp(), &picture(40, 30, &[(left, top, 6, 10, 30, 120, 120)]));
        assert_eq!(found.blobs.len(), 1, "{left} {top}");
        assert_eq!(found.blobs[0].is_truncated, expected, "{left} {top}");
    };
    check(10, 10, false);
    check(10, 0, false);
    check(0, 10, true);
    check(34, 10, true);
    check(10, 20, true);
}

#[test]
fn nothing_everything_and_the_smallest_pictures() {
    for (width, height) in [(1, 1), (1, 5), (5, 1), (2, 2), (7, 3), (33, 31)] {
        for settings in [sharp(), SegmentSettings { min_area_px: 1, ..SegmentSettings::default() }] {
            let found = segment(&settings, &picture(width, height, &[]));
            assert!(found.blobs.is_empty() && found.soft_mask.data.iter().all(|soft| *soft == 0));
            let found = segment(&settings, &picture(width, height, &[(0, 0, width, height, 235, 90, 90)]));
            assert_eq!(found.blobs.len(), 1, "{width} x {height}");
            assert_eq!(found.blobs[0].rect, PixelRect { x: 0, y: 0, width, height });
            assert!(found.blobs[0].is_truncated);
            assert!(found.soft_mask.data.iter().all(|soft| *soft == 255), "{width} x {height}");
        }
    }
}

#[test]
fn small_pieces_are_background() {
    let settings = SegmentSettings { min_area_px: 17, ..sharp() };
    let things = [(4, 4, 4, 4, 20, 120, 120), (20, 10, 4, 5, 20, 120, 120)];
    let found = segment(&settings, &picture(40, 30, &things));
    assert_eq!(found.blobs.iter().map(|blob| blob.area_px).collect::<Vec<_>>(), [20]);
    assert_eq!((found.labels.get(5, 5), found.soft_mask.get(5, 5)), (0, 0));
}

/// Returns the mask's pixels and the blobs of the last frame of a floor of 320 x 240, on which a thing of `size_px` differs by so
/// many codes of luma wherever `is_there` says so, ten frames a second.
fn show(
    settings: &SegmentSettings,
    (size_px, codes): ((u32, u32), u8),
    is_there: impl Iterator<Item = bool>,
) -> (usize, usize) {
    let background = picture(320, 240, &[]);
    let mut segmenter = Segmenter::new(settings);
    let mut found = None;
    for is_there in is_there {
        let things = [(100, 100, size_px.0, size_px.1, 140 - codes, 120, 116)];
        let frame = picture(320, 240, if is_there { &things } else { &[] });
        let now = segmenter.segment(&frame, planes(&background), &all(320, 240), 0.1);
        check_consistency(&now);
        found = Some(now);
    }
    let found = found.unwrap();
    (found.labels.data.iter().filter(|label| **label == MOVING).count(), found.blobs.len())
}

#[test]
fn distinct_pieces_too_small_for_a_blob_stay_in_the_mask() {
    let settings = SegmentSettings { shadow: StageChoice::Off, ..SegmentSettings::default() };
    let once = || std::iter::once(true);
    let in_mask = |size_px, codes| show(&settings, (size_px, codes), once());
    let (n_moving, n_blobs) = in_mask((6, 5), 100);
    assert!((24..=36).contains(&n_moving) && n_blobs == 0, "{n_moving} {n_blobs}");
    let (n_moving, n_blobs) = in_mask((9, 9), 100);
    assert!((70..=90).contains(&n_moving) && n_blobs == 1, "{n_moving} {n_blobs}");
    // Smaller than what the blur makes of a single sample's noise.
    assert_eq!(in_mask((2, 2), 100), (0, 0));
    // A faint thing of this size could be noise; a large one could not.
    let faint = (settings.delta() * 219.0 * 1.25) as u8;
    assert_eq!(in_mask((6, 5), faint), (0, 0));
    assert_eq!(in_mask((20, 20), faint).1, 1);
    // A small thing that differs less than the high threshold everywhere is background, as a large one is.
    let high = SegmentSettings { delta_high: 0.4, ..settings.clone() };
    assert_eq!([((6, 5), 70), ((20, 20), 70)].map(|thing| show(&high, thing, once())), [(0, 0); 2]);
    assert!(show(&high, ((6, 5), 120), once()).0 > 20);
    // Leaves cannot be told from things if turning verdicts are not counted.
    let uncounted =
        SegmentSettings { flicker: StageChoice::Off, suppress_blinking: Some(false), ..settings.clone() };
    assert_eq!(show(&uncounted, ((6, 5), 100), once()), (0, 0));
    let set = SegmentSettings { min_area_px: 51, ..settings.clone() };
    assert_eq!(show(&set, ((6, 5), 100), once()), (0, 0), "what is set is meant");
}

/// Returns the areas of the blobs that are found of `things` on a floor of 320 x 240, halved or not, where objects cover at
/// least `share` of the picture in its lower half.
fn areas_where_objects_cover(share: f64, resolution: Resolution, things: &[Thing]) -> Vec<u32> {
    let settings = SegmentSettings { shadow: StageChoice::Off, resolution, ..SegmentSettings::default() };
    let mut segmenter = Segmenter::new(&settings);
    let size = ObjectSize { least_area_share: share, metre_share: None, ground_m: [0.0; 2] };
    let sizes = ObjectSizes::new(|[_, y]| (y > 0.5).then_some(size));
    segmenter.set_object_sizes(Some(Arc::new(sizes)));
    let factor = resolution.factor_in((320, 240));
    let [frame, background] = [things, &[]].map(|things| {
        let full = picture(320, 240, things);
        if factor == 1 { full } else { full.reduced(factor) }
    });
    let unmatched = all(frame.width(), frame.height());
    let found = segmenter.segment_reduced(&frame, planes(&background), &unmatched, 0.1, (320, 240));
    check_consistency(&found);
    found.blobs.iter().map(|blob| blob.area_px).collect()
}

#[test]
fn what_is_as_large_as_an_object_there_is_a_blob_however_small() {
    let share = |px: f64| px / (320.0 * 240.0);
    let (far, high) = ((100, 180, 6, 6, 40, 120, 116), (100, 60, 6, 6, 40, 120, 116));
    let areas = |px: f64, things: &[Thing]| areas_where_objects_cover(share(px), Resolution::Full, things);
    assert_eq!(areas(25.0, &[far]), [36]);
    assert_eq!(areas(45.0, &[far]), [0; 0], "smaller than an object there");
    assert_eq!(areas(25.0, &[high]), [0; 0], "nothing stands there");
    assert_eq!(areas(2000.0, &[(100, 180, 12, 12, 40, 120, 116)]), [144], "what was a blob stays one");
    let lowest = (100, 234, 6, 6, 40, 120, 116);
    assert_eq!(areas(25.0, &[lowest]), [36], "at the lower border too");
    // Parts of a larger thing, and somebody else farther away.
    let body = (100, 140, 20, 60, 40, 120, 116);
    let head = |y: u32| (106, y, 6, 6, 40, 120, 116);
    assert_eq!(areas(25.0, &[body, head(130)]), [1200]);
    assert_eq!(areas(25.0, &[(100, 140, 20, 40, 40, 120, 116), head(220)]), [800, 36]);
    assert_eq!(areas(25.0, &[head(130), (100, 170, 20, 60, 40, 120, 116)]), [36, 1200]);
    let hand = (128, 160, 6, 6, 40, 120, 116);
    assert_eq!(areas(25.0, &[body, hand]), [1200]);
    for beside in [(20, 180, 6, 6, 40, 120, 116), (200, 180, 6, 6, 40, 120, 116)] {
        let mut found = areas(25.0, &[body, beside]);
        found.sort_unstable();
        assert_eq!(found, [36, 1200], "{beside:?}");
    }
    let halved = |px: f64| areas_where_objects_cover(share(px), Resolution::Half, &[far]).len();
    assert_eq!((halved(25.0), halved(60.0)), (1, 0));
}

#[test]
fn small_pieces_leave_the_mask_where_verdicts_keep_turning() {
    let settings = SegmentSettings {
        shadow: StageChoice::Off,
        suppress_blinking: Some(false),
        ..SegmentSettings::default()
    };
    let thing = ((6, 5), 100);
    assert_eq!(show(&settings, thing, (0..41).map(|frame| frame % 4 < 2)).0, 0);
    assert!(show(&settings, thing, (0..41).map(|frame| frame > 30)).0 > 20, "who stays does not flicker");
}

/// A thing, and beside it its shadow: every channel of the floor at 65 %.
fn with_shadow(luma: u8, u: u8, v: u8) -> YuvImage {
    picture(60, 40, &[(10, 10, 8, 20, 30, 150, 150), (18, 26, 20, 4, luma, u, v)])
}

#[test]
fn darker_floor_of_the_same_colour_is_shadow() {
    // 16 + 0.65 * 124, and chroma's distance from 128 at 65 %.
    let found = segment(&sharp(), &with_shadow(97, 123, 120));
    assert_eq!(found.labels.get(25, 28), SHADOW);
    assert_eq!(found.blobs[0].rect.width, 8, "the shadow is no part of the blob");
    let settings = SegmentSettings { shadow_darkest: 1.0, ..sharp() };
    let found = segment(&settings, &with_shadow(97, 123, 120));
    assert_eq!(found.labels.get(25, 28), MOVING);
    assert_eq!(found.blobs[0].rect.width, 28);
}

#[test]
fn the_direction_of_shadows_is_learned_by_scene() {
    // Somebody 1.7 m tall, and to the right of their hips what is as dark as the floor in shadow.
    let frame = picture(320, 240, &[(100, 60, 36, 102, 40, 90, 150), (136, 110, 66, 18, 97, 123, 120)]);
    let background = picture(320, 240, &[]);
    let sizes = |metre_px: f64| {
        let size = move |[x, y]: [f64; 2]| {
            let ground_m = [x * 320.0 / metre_px, -y * 240.0 / metre_px];
            Some(ObjectSize { least_area_share: 0.001, metre_share: Some(metre_px / 240.0), ground_m })
        };
        Some(Arc::new(ObjectSizes::new(size)))
    };
    let mut segmenter = Segmenter::new(&sharp());
    let mut label = |metre_px: f64| {
        segmenter.set_object_sizes(sizes(metre_px));
        let found = segmenter.segment(&frame, planes(&background), &all(320, 240), 0.1);
        found.labels.get(170, 119)
    };
    assert_eq!(label(60.0), MOVING);
    (0..40).for_each(|_| _ = label(60.0));
    assert_eq!(label(60.0), SHADOW, "the same sizes again change nothing");
    assert_eq!(label(60.5), MOVING, "the scene is another");
}

#[test]
fn what_is_too_dark_or_of_another_colour_or_lighter_is_no_shadow() {
    for (luma, u, v) in [(60, 123, 120), (97, 150, 120), (97, 123, 90), (180, 120, 116)] {
        let found = segment(&sharp(), &with_shadow(luma, u, v));
        assert_eq!(found.labels.get(25, 28), MOVING, "{luma} {u} {v}");
    }
}

#[test]
fn shadow_of_black_is_not_looked_for() {
    let black = YuvImage::filled(8, 8, [10, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
    let frame = YuvImage::filled(8, 8, [80, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
    for (frame, background) in [(&frame, &black), (&black, &frame)] {
        let found = Segmenter::new(&sharp()).segment(frame, planes(background), &all(8, 8), 0.1);
        assert!(found.labels.data.iter().all(|label| *label == MOVING));
    }
}

/// Somebody dark with a gap of 6 columns from row 60 down that differs from the floor by less than the threshold.
fn with_notch() -> YuvImage {
    picture(120, 180, &[(20, 40, 20, 40, 60, 140, 140), (27, 60, 6, 20, 122, 120, 116)])
}

#[test]
fn notches_are_filled_in_the_mask_and_part_blobs() {
    let found = segment(&sharp(), &with_notch());
    let moving = found.labels.data.iter().filter(|label| **label == MOVING).count();
    assert_eq!(moving, 20 * 40, "all of it");
    assert_eq!(found.blobs.iter().map(|blob| blob.area_px).sum::<u32>(), 20 * 40 - 6 * 20);
    assert_eq!(found.soft_mask.get(30, 70), 255, "nobody is half there within");
    // As light as the floor, it is floor.
    let through = picture(120, 180, &[(20, 40, 20, 40, 60, 140, 140), (27, 60, 6, 20, 140, 120, 116)]);
    assert_eq!(segment(&sharp(), &through).labels.get(30, 70), super::super::BACKGROUND);
}

#[test]
fn notches_are_not_filled_by_the_blur_alone() {
    // As light as the floor, and so narrow that the blur carries the body into it from both sides.
    let narrow = picture(120, 180, &[(20, 40, 20, 40, 60, 140, 140), (28, 60, 4, 20, 140, 120, 116)]);
    let settings = SegmentSettings { blur_sigma_px: Some(2.0), ..sharp() };
    assert_eq!(segment(&settings, &narrow).labels.get(30, 70), super::super::BACKGROUND);
}

#[test]
fn notches_show_nothing_of_what_is_hidden() {
    let mut hidden = BitMask::new(120, 180);
    (65..75).for_each(|y| hidden.set_run(y, 28, 31));
    let mut segmenter = Segmenter::new(&sharp());
    segmenter.hide(Some(hidden));
    let background = picture(120, 180, &[]);
    let found = segmenter.segment(&with_notch(), planes(&background), &all(120, 180), 0.1);
    let is_moving = |(x, y): &(u32, u32)| found.labels.get(*x, *y) == MOVING;
    let all_of =
        |columns: std::ops::Range<u32>| (65..75).flat_map(move |y| columns.clone().map(move |x| (x, y)));
    assert_eq!(all_of(28..31).filter(is_moving).count(), 0);
    assert_eq!(all_of(20..40).filter(is_moving).count(), 17 * 10);
}

#[test]
fn mixture_counts_as_its_rule_says() {
    let frame = picture(60, 40, &[(10, 10, 10, 20, 30, 150, 150)]);
    let background = picture(60, 40, &[]);
    let mut unmatched = BitMask::new(60, 40);
    for y in 10..30 {
        unmatched.set_run(y, 15, 40);
    }
    // A lone verdict has no majority around it.
    unmatched.set_run(5, 50, 51);
    let columns = |mixture| {
        let settings = SegmentSettings { mixture, ..sharp() };
        let found = Segmenter::new(&settings).segment(&frame, planes(&background), &unmatched, 0.1);
        check_consistency(&found);
        assert_eq!(found.blobs.len(), 1, "{mixture:?}");
        (found.blobs[0].rect.x, found.blobs[0].rect.x + found.blobs[0].rect.width)
    };
    assert_eq!(columns(MixtureRule::Ignore), (10, 20));
    assert_eq!(columns(MixtureRule::Require), (15, 20));
    assert_eq!(columns(MixtureRule::Add), (10, 40));
}

#[test]
fn scratch_does_not_carry_over_to_another_frame_or_size() {
    // A threshold that is set follows nothing that is remembered.
    let settings = SegmentSettings { delta: Some(SegmentSettings::DELTA), ..SegmentSettings::default() };
    let mut used = Segmenter::new(&settings);
    let sizes = [(96, 80), (31, 29), (80, 96), (96, 80)];
    for (width, height) in sizes {
        let frame = picture(width, height, &[(4, 3, 20, 22, 50, 150, 150)]);
        let background = picture(width, height, &[]);
        let unmatched = all(width, height);
        let fresh = Segmenter::new(&settings).segment(&frame, planes(&background), &unmatched, 0.1);
        assert_eq!(used.segment(&frame, planes(&background), &unmatched, 0.1), fresh);
        assert_eq!(fresh.blobs.len(), 1);
    }
}
