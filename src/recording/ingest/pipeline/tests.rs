//! A camera's way from frames to observations: clips, sizes, restarts.

use super::checkpoint::MAGIC;
use super::*;
use videofields_vision::config::Resolution;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvLayout};

/// Frame `number` of a noisy floor over which a box walks from the fourth frame on, at ten frames a second.
fn frame(width: u32, height: u32, number: u64) -> Frame {
    let layout = YuvLayout::packed(width, height);
    let mut data: Vec<u8> = (0..YuvLayout::packed_len(width, height) as u64)
        .map(|i| {
            let hash = (i ^ number.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let is_luma = i < layout.offsets[1] as u64;
            126 + (hash >> if is_luma { 61 } else { 62 }) as u8
        })
        .collect();
    let left = (number as u32 * 3) % (width - 12);
    for y in (height / 4..height / 4 + 24).filter(|_| number > 3) {
        data[(y * width + left) as usize..][..12].fill(30);
    }
    let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
    Frame {
        camera: CameraId::new("cam").unwrap(),
        timestamp: Timestamp::from_nanos(1_700_000_000_000_000_000 + number as i64 * 100_000_000),
        number,
        image: Arc::new(image),
    }
}

fn settings() -> (BackgroundSettings, SegmentSettings) {
    let segment = SegmentSettings { min_area_px: 40, ..SegmentSettings::default() };
    (BackgroundSettings::default(), segment)
}

fn pipeline() -> Pipeline {
    let (background, segment) = settings();
    Pipeline::new(&background, &segment)
}

fn assert_same(a: &Observation, b: &Observation) {
    assert!(a.labels == b.labels && a.soft_mask == b.soft_mask && a.blobs == b.blobs);
}

#[test]
fn walker_is_found_and_the_floor_is_the_background() {
    let mut pipeline = pipeline();
    let last = (0..60).map(|number| pipeline.process(frame(96, 64, number))).last().unwrap();
    assert_eq!(last.blobs.len(), 1, "{:?}", last.blobs);
    let rect = last.blobs[0].rect;
    assert!(rect.x.abs_diff(59 * 3 % 84) <= 2 && rect.width.abs_diff(12) <= 4, "{rect:?}");
    assert_eq!(last.tracks.iter().map(|track| track.blob_idx).collect::<Vec<_>>(), [Some(0)]);
    assert!(last.background.plane(0).row(20).iter().all(|luma| luma.abs_diff(129) <= 4));
    assert_eq!(last.frame.number, 59);
}

#[test]
fn a_reduced_resolution_finds_nearly_what_the_full_one_finds() {
    let (background, segment) = settings();
    let at = |resolution| {
        let segment = SegmentSettings { resolution, ..segment.clone() };
        let mut pipeline = Pipeline::new(&background, &segment);
        let last = (0..60).map(|number| pipeline.process(frame(98, 66, number))).last().unwrap();
        assert_eq!((last.labels.width, last.labels.height), (98, 66), "{resolution:?}");
        assert_eq!((last.soft_mask.width, last.soft_mask.height), (98, 66), "{resolution:?}");
        assert_eq!(last.blobs.len(), 1, "{resolution:?}: {:?}", last.blobs);
        let model = pipeline.current().unwrap().0;
        assert_eq!((model.width, model.height), pipeline.model_size_px(98, 66));
        last
    };
    let full = at(Resolution::Full);
    for (resolution, least_overlap) in [(Resolution::Half, 0.75), (Resolution::Quarter, 0.5)] {
        let reduced = at(resolution);
        let (mut both, mut either) = (0, 0);
        for (a, b) in full.labels.data.iter().zip(&reduced.labels.data) {
            both += u32::from(*a == 255 && *b == 255);
            either += u32::from(*a == 255 || *b == 255);
        }
        let overlap = f64::from(both) / f64::from(either);
        assert!(overlap >= least_overlap && overlap < 1.0, "{resolution:?}: {overlap}");
        let foot = |of: &Observation| of.blobs[0].foot_in_image;
        for (a, b) in foot(&full).into_iter().zip(foot(&reduced)) {
            assert!((a - b).abs() <= f64::from(resolution.factor_in((98, 66))) + 1.0, "{resolution:?}");
        }
        // The floor's dither comes back in full, though the model has its mean alone.
        assert_eq!((reduced.background.width(), reduced.background.height()), (98, 66));
        let rows = |of: &Observation| of.background.plane(0).row(2)[..98].to_vec();
        let worst = rows(&full).into_iter().zip(rows(&reduced)).map(|(a, b)| a.abs_diff(b)).max();
        assert!(worst.unwrap() <= 4, "{resolution:?}: {worst:?}");
    }
}

#[test]
fn large_pictures_are_reduced_unless_told_otherwise_and_their_backgrounds_are_not() {
    let mut pipeline = pipeline();
    let mut background = None;
    for number in 0..12 {
        background = Some(pipeline.process(frame(1002, 600, number)).background);
    }
    let (model, _) = pipeline.current().unwrap();
    assert_eq!((model.width, model.height), (501, 300));
    let background = background.unwrap();
    assert_eq!((background.width(), background.height()), (1002, 600));
    // A smaller stream of the same place goes on with the same model, and is shown at its own size at once.
    let small = pipeline.process(frame(501, 300, 12)).background;
    assert_eq!((small.width(), small.height()), (501, 300));
    let large = pipeline.process(frame(1002, 600, 13)).background;
    assert_eq!((large.width(), large.height()), (1002, 600));
    assert!(pipeline.aside.is_empty());
    let full = pipeline.model_bytes();
    assert!(full >= 501 * 300 * 36 + 1002 * 600 * 3, "detail counts: {full}");
}

#[test]
fn a_reduced_clip_leaves_its_detail() {
    let (mut background, segment) = settings();
    background.learning = Learning::Hold;
    let segment = SegmentSettings { resolution: Resolution::Half, ..segment };
    let mut pipeline = Pipeline::new(&background, &segment);
    let layout = YuvLayout::packed(96, 64);
    let mut data = vec![128; YuvLayout::packed_len(96, 64)];
    data[..96 * 64].iter_mut().enumerate().for_each(|(i, value)| *value = if i % 2 == 0 { 90 } else { 150 });
    let stripes = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
    for _ in 0..30 {
        pipeline.learn(&stripes, 0.1);
    }
    // Something covers half of the place from the first frame on.
    let mut data: Vec<u8> = (0..3)
        .flat_map(|index| {
            let plane = stripes.plane(index);
            (0..plane.height).flat_map(move |y| plane.row(y).to_vec())
        })
        .collect();
    data[..96 * 32].fill(30);
    let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
    let seen = pipeline.process(Frame { image: Arc::new(image), ..frame(96, 64, 1) });
    assert!(seen.labels.get(40, 10) == 255 && seen.labels.get(40, 50) == 0);
    for y in [10, 50] {
        let row = seen.background.plane(0).row(y);
        assert!(
            row.iter().enumerate().all(|(x, luma)| luma.abs_diff(if x % 2 == 0 { 90 } else { 150 }) <= 2)
        );
    }
}

#[test]
fn restart_in_the_middle_changes_no_bit_of_any_mask() {
    // Tracks begin anew after a restart, and with them what is held from learning: without that, nothing differs.
    let track = TrackSettings { absorb_after_secs: 0.0, ..TrackSettings::default() };
    let pipeline = || pipeline().with_track(&track);
    let mut unbroken = pipeline();
    for number in 0..40 {
        unbroken.process(frame(96, 64, number));
    }
    let mut restarted = pipeline();
    restarted.restore(&unbroken.checkpoint().unwrap()).unwrap();
    for number in 40..80 {
        let [a, b] = [&mut unbroken, &mut restarted].map(|one| one.process(frame(96, 64, number)));
        assert_same(&a, &b);
        assert!(!a.blobs.is_empty());
    }
    assert_eq!(unbroken.checkpoint(), restarted.checkpoint());
}

#[test]
fn background_picture_is_shared_for_a_second_of_scene_time() {
    let mut pipeline = pipeline();
    let seen: Vec<_> = (0..25).map(|number| pipeline.process(frame(96, 64, number)).background).collect();
    assert!(Arc::ptr_eq(&seen[0], &seen[9]) && Arc::ptr_eq(&seen[10], &seen[19]));
    assert!(!Arc::ptr_eq(&seen[9], &seen[10]) && !Arc::ptr_eq(&seen[19], &seen[20]));
}

#[test]
fn held_background_stays_as_the_clip_left_it() {
    let (mut background, segment) = settings();
    background.learning = Learning::Hold;
    let mut held = Pipeline::new(&background, &segment);
    assert!(!held.has_learned_clip());
    let empty = YuvImage::filled(96, 64, [127, 127, 127], ColorMatrix::Bt601, ColorRange::Limited);
    for _ in 0..20 {
        held.learn(&empty, 0.04);
    }
    assert!(held.has_learned_clip());
    let before = held.current.as_ref().unwrap().mixture.n_frames();
    let mut pictures = Vec::new();
    for _ in 0..200 {
        let observation = held.process(frame(96, 64, 5));
        assert_eq!(observation.blobs.len(), 1);
        pictures.push(observation.background);
    }
    assert_eq!(held.current.as_ref().unwrap().mixture.n_frames(), before);
    assert!(pictures.iter().all(|picture| Arc::ptr_eq(picture, &pictures[0])));
    let mut restored = Pipeline::new(&background, &segment);
    restored.restore(&held.checkpoint().unwrap()).unwrap();
    assert!(restored.has_learned_clip());
    assert_same(&restored.process(frame(96, 64, 6)), &held.process(frame(96, 64, 6)));
}

#[test]
fn clip_of_another_size_leaves_the_stream_to_adapt() {
    let (mut background, segment) = settings();
    background.learning = Learning::Hold;
    let mut pipeline = Pipeline::new(&background, &segment);
    let other = YuvImage::filled(48, 32, [10, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
    pipeline.learn(&other, 0.04);
    let last = (0..30).map(|number| pipeline.process(frame(96, 64, number))).last().unwrap();
    assert_eq!(last.blobs.len(), 1);
}

#[test]
fn size_that_comes_back_finds_what_was_learned_even_after_a_restart() {
    let mut one = pipeline();
    for number in 0..30 {
        one.process(frame(96, 64, number));
    }
    for number in 30..33 {
        let observation = one.process(frame(64, 96, number));
        assert_eq!((observation.labels.width, observation.background.width()), (64, 64));
    }
    let mut two = pipeline();
    two.restore(&one.checkpoint().unwrap()).unwrap();
    for pipeline in [&mut one, &mut two] {
        let observation = pipeline.process(frame(96, 64, 33));
        assert_eq!(observation.blobs.len(), 1, "known at once, not begun anew");
    }
    assert_same(&one.process(frame(64, 96, 34)), &two.process(frame(64, 96, 34)));
    // However often the size changes, memory stays bounded.
    for size in 40..60 {
        one.process(frame(size, 64, 100));
    }
    assert_eq!(one.aside.len(), MAX_ASIDE);
}

#[test]
fn time_that_stands_still_or_runs_back_is_survived() {
    let mut pipeline = pipeline();
    for number in [5, 5, 3, 0, 1000, 999] {
        pipeline.process(frame(96, 64, number));
    }
    let mut last = frame(96, 64, 7);
    for nanos in [i64::MAX, i64::MIN, 0] {
        last.timestamp = Timestamp::from_nanos(nanos);
        pipeline.process(last.clone());
    }
}

#[test]
fn bytes_that_are_no_checkpoint_change_nothing() {
    let mut one = pipeline();
    assert_eq!(one.checkpoint(), None);
    for number in 0..10 {
        one.process(frame(96, 64, number));
    }
    let good = one.checkpoint().unwrap();
    let header_len = MAGIC.len() + 1;
    let changed = |at: usize, value: u8| {
        let mut bytes = good.clone();
        bytes[at] = value;
        bytes
    };
    let mut endless = good.clone();
    endless[header_len + 1..header_len + 9].fill(0xff);
    let models = &good[header_len..];
    let bad = [
        ("nothing", vec![]),
        ("a name alone", MAGIC.to_vec()),
        ("no model", good[..header_len].to_vec()),
        ("version 0", changed(MAGIC.len(), 0)),
        ("a later version", changed(MAGIC.len(), 3)),
        ("flags that are none", changed(header_len, 8)),
        ("flags of a later version", changed(MAGIC.len(), 1)),
        ("no end", endless),
        ("a byte too few", good[..good.len() - 1].to_vec()),
        ("a byte too many", [good.as_slice(), &[1]].concat()),
        ("too many models", [&good, models, models, models].concat()),
    ];
    for (what, bytes) in bad {
        assert!(one.restore(&bytes).is_err(), "{what}");
    }
    assert_eq!(one.checkpoint().unwrap(), good);
    one.restore(&good).unwrap();
}

/// Builds of before wrote models without what segmentation remembers.
#[test]
fn checkpoints_of_version_1_are_taken_over() {
    let mut one = pipeline();
    for number in 0..10 {
        one.process(frame(96, 64, number));
    }
    let model = one.current.as_ref().unwrap();
    let encoded = model.mixture.encode(model.seen.unwrap()).unwrap();
    let mut old = b"vfpl\x01\x02".to_vec();
    old.extend((encoded.len() as u64).to_le_bytes());
    old.extend(&encoded);
    let mut restored = pipeline();
    restored.restore(&old).unwrap();
    let model = restored.current.as_ref().unwrap();
    assert_eq!(model.mixture.encode(model.seen.unwrap()).unwrap(), encoded);
    assert_eq!(*restored.segmenter.memory(), Memory::default());
}

#[test]
fn without_vision_pictures_are_passed_on_and_nothing_is_kept_or_copied() {
    let mut pipeline = pipeline().without_vision();
    let seen: Vec<_> = (0..10).map(|number| pipeline.process(frame(96, 64, number))).collect();
    for observation in &seen {
        assert!(Arc::ptr_eq(&observation.background, &observation.frame.image));
        assert!(observation.blobs.is_empty() && observation.tracks.is_empty());
        assert!(Arc::ptr_eq(&observation.labels, &seen[0].soft_mask), "all share one mask");
    }
    assert!(seen[0].labels.data.iter().all(|label| *label == 0));
    assert_eq!((pipeline.model_bytes(), pipeline.checkpoint()), (0, None));
    let other = pipeline.process(frame(64, 48, 11));
    assert_eq!((other.labels.width, other.labels.height), (64, 48));
}

/// Returns a place of soft spots, shifted, with somebody who walks before it after a while.
fn shaken(number: u64, shift: [i32; 2]) -> (Frame, [u32; 4]) {
    let (width, height) = (320, 240);
    let spot = |x: i32, y: i32| {
        let mut hash = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
        hash = (hash ^ hash >> 15).wrapping_mul(0xc2b2_ae35);
        f64::from((hash ^ hash >> 13) & 0xff)
    };
    let place = |x: i32, y: i32| {
        let (fx, fy) = (f64::from(x) / 9.0, f64::from(y) / 9.0);
        let (dx, dy) = (fx - fx.floor(), fy - fy.floor());
        let (x, y) = (fx.floor() as i32, fy.floor() as i32);
        let upper = spot(x, y) * (1.0 - dx) + spot(x + 1, y) * dx;
        let lower = spot(x, y + 1) * (1.0 - dx) + spot(x + 1, y + 1) * dx;
        60.0 + 0.4 * (upper * (1.0 - dy) + lower * dy)
    };
    // Nobody is there while the place is learned.
    let left = if number < 80 { -100 } else { 30 + 2 * (number as i32 - 80) } + shift[0];
    let top = 80 + shift[1];
    let mut data = vec![128; YuvLayout::packed_len(width, height)];
    for (at, code) in data[..(width * height) as usize].iter_mut().enumerate() {
        let (x, y) = (at as i32 % width as i32, at as i32 / width as i32);
        let is_body = (left..left + 30).contains(&x) && (top..top + 90).contains(&y);
        let luma = if is_body { 215.0 } else { place(x - shift[0], y - shift[1]) };
        *code = luma as u8;
    }
    let image =
        YuvImage::new(YuvLayout::packed(width, height), ColorMatrix::Bt601, ColorRange::Limited, data);
    let frame = Frame {
        camera: CameraId::new("cam").unwrap(),
        timestamp: Timestamp::from_nanos(1_700_000_000_000_000_000 + number as i64 * 40_000_000),
        number,
        image: Arc::new(image.unwrap()),
    };
    (frame, [left.max(0) as u32, top as u32, 30, 90])
}

#[test]
fn somebody_before_a_camera_that_shakes_is_found_where_the_picture_shows_them() {
    for reach_px in [3, 15] {
        let mut pipeline = Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default());
        let (mut n_hit, mut n_found, mut n_true, mut n_near) = (0, 0, 0, 0);
        for number in 0..200 {
            let sway = |period: f64| (f64::from(reach_px) * (number as f64 / period).sin()).round() as i32;
            let (frame, [x, y, width, height]) = shaken(number, [sway(1.7), sway(2.3)]);
            let found = pipeline.process(frame);
            if number < 100 {
                continue;
            }
            for (at, label) in found.labels.data.iter().enumerate() {
                let (column, row) = (at as u32 % 320, at as u32 / 320);
                let is_body = (x..x + width).contains(&column) && (y..y + height).contains(&row);
                n_true += u32::from(is_body);
                n_found += u32::from(*label == 255);
                n_hit += u32::from(is_body && *label == 255);
            }
            n_near += u32::from(found.tracks.iter().any(|track| {
                track.rect.x.abs_diff(x) <= 4 && track.rect.y.abs_diff(y) <= 4 && track.blob_idx.is_some()
            }));
        }
        let (precision, recall) =
            (f64::from(n_hit) / f64::from(n_found), f64::from(n_hit) / f64::from(n_true));
        assert!(
            precision > 0.9 && recall > 0.9,
            "{reach_px} px: precision {precision:.3}, recall {recall:.3}"
        );
        assert!(n_near > 90, "{reach_px} px: near in {n_near} of 100 frames");
    }
}

/// An exposure that creeps up by 14 % within three seconds, as cameras do when something dark enters: nothing is found but who stands.
#[test]
fn an_exposure_that_creeps_makes_no_ghosts_and_loses_nobody_who_stands() {
    let (width, height) = (320_u32, 240_u32);
    let mut pipeline = Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default());
    let (mut n_false, mut n_hit, mut n_true) = (0_u32, 0_u32, 0_u32);
    for number in 0..400_u64 {
        let gain = 1.0 + 0.14 * ((number as f32 - 200.0) / 70.0).clamp(0.0, 1.0);
        let left = (number.max(60) - 60).min(80) as u32 * 2;
        let is_body =
            |x: u32, y: u32| number > 60 && (left..left + 24).contains(&x) && (80..170).contains(&y);
        let mut data = vec![128; YuvLayout::packed_len(width, height)];
        for (at, code) in data[..(width * height) as usize].iter_mut().enumerate() {
            let (x, y) = (at as u32 % width, at as u32 / width);
            // Light walls in the upper half, where 14 % are most.
            let shade = if y < 120 { 170.0 } else { 90.0 } + ((x / 20 + y / 20) % 3) as f32 * 15.0;
            let noise = ((at as u64 ^ (number * 7919)).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 62) as f32;
            *code = (16.0 + gain * (if is_body(x, y) { 20.0 } else { shade }) + noise) as u8;
        }
        let image =
            YuvImage::new(YuvLayout::packed(width, height), ColorMatrix::Bt601, ColorRange::Limited, data);
        let found = pipeline.process(Frame {
            camera: CameraId::new("cam").unwrap(),
            timestamp: Timestamp::from_nanos(1_700_000_000_000_000_000 + number as i64 * 40_000_000),
            number,
            image: Arc::new(image.unwrap()),
        });
        if number < 200 {
            continue;
        }
        for (at, label) in found.labels.data.iter().enumerate() {
            let is_true = is_body(at as u32 % width, at as u32 / width);
            n_true += u32::from(is_true);
            n_hit += u32::from(is_true && *label == 255);
            n_false += u32::from(!is_true && *label == 255);
        }
    }
    let [n_false, n_hit, n_true] = [n_false, n_hit, n_true].map(f64::from);
    assert!(n_hit > 0.95 * n_true, "{n_hit} of {n_true}");
    assert!(n_false < 0.05 * n_true, "{n_false} beside {n_true}");
}
