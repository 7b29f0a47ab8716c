//! The segment room seen from outside: real footage through source and pipeline, against truth.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use std::collections::BTreeMap;
use std::path::Path;
use videofields_recording::ingest::{self, MediaRoots, Pipeline, Source};
use videofields_testing::real_data;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, Learning, SegmentSettings, SourceSettings, Timing};
use videofields_vision::frame::{CameraId, Frame};
use videofields_vision::segment::{MOVING, PixelRect};

fn open(path: &Path) -> Box<dyn Source> {
    let settings =
        SourceSettings { timing: Some(Timing::Index), rate_hz: 10.0, ..SourceSettings::of_path(path) };
    ingest::open(&settings, &MediaRoots::of_caller(path).unwrap()).unwrap()
}

pub(crate) fn frames(path: &Path) -> impl Iterator<Item = Frame> + use<> {
    let mut source = open(path);
    std::iter::from_fn(move || source.next_frame().unwrap()).map(|frame| Frame {
        camera: CameraId::new("real").unwrap(),
        timestamp: Timestamp::from_nanos(frame.stream_nanos),
        number: frame.number,
        image: frame.image,
    })
}

/// Centre x, centre y, width, height of every box of every frame.
pub(crate) fn truth_boxes(path: &Path) -> BTreeMap<u64, Vec<[f64; 4]>> {
    let text = std::fs::read_to_string(path).unwrap();
    let document = roxmltree::Document::parse(&text).unwrap();
    let number = |node: roxmltree::Node<'_, '_>, name| node.attribute(name).unwrap().parse::<f64>().unwrap();
    document
        .root_element()
        .children()
        .filter(|node| node.has_tag_name("frame"))
        .map(|frame| {
            let boxes = frame.descendants().filter(|node| node.has_tag_name("box"));
            let boxes = boxes.map(|node| ["xc", "yc", "w", "h"].map(|name| number(node, name))).collect();
            (number(frame, "number") as u64, boxes)
        })
        .collect()
}

/// Intersection over union of two rectangles given as centre and size.
fn overlap(a: [f64; 4], b: [f64; 4]) -> f64 {
    let common = |i: usize| {
        (a[i] + a[i + 2] / 2.0).min(b[i] + b[i + 2] / 2.0)
            - (a[i] - a[i + 2] / 2.0).max(b[i] - b[i + 2] / 2.0)
    };
    let both = common(0).max(0.0) * common(1).max(0.0);
    both / (a[2] * a[3] + b[2] * b[3] - both)
}

fn centred(rect: PixelRect) -> [f64; 4] {
    let [x, y, width, height] = [rect.x, rect.y, rect.width, rect.height].map(f64::from);
    [x + width / 2.0, y + height / 2.0, width, height]
}

/// Boxes that one of the rectangles found meets at an overlap of 0.3, every one used once.
pub(crate) fn n_met(boxes: &[[f64; 4]], found: impl Iterator<Item = PixelRect>) -> usize {
    let mut free: Vec<[f64; 4]> = found.map(centred).collect();
    let mut n_met = 0;
    for truth in boxes {
        let best =
            (0..free.len()).max_by(|a, b| overlap(*truth, free[*a]).total_cmp(&overlap(*truth, free[*b])));
        if let Some(best) = best.filter(|best| overlap(*truth, free[*best]) >= 0.3) {
            free.swap_remove(best);
            n_met += 1;
        }
    }
    n_met
}

/// A widely used mixture with a 5 x 5 median after it meets 0.82 of these boxes, and 0.88 of its blobs meet one.
#[test]
fn people_on_a_campus_are_met_by_the_defaults_better_than_by_a_mixture_and_a_median() {
    let Some(folder) = real_data("pets2009_s2l1") else { return };
    let truth = truth_boxes(&folder.join("boxes_frames_0_399.xml"));
    let mut pipeline = Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default());
    let (mut n_boxes, mut n_blobs, mut n_met_in_all) = (0, 0, 0);
    for frame in frames(&folder.join("vtest.avi")).take(400) {
        let number = frame.number;
        let observation = pipeline.process(frame);
        if number >= 100 {
            let boxes = truth.get(&number).map_or(&[][..], Vec::as_slice);
            n_met_in_all += n_met(boxes, observation.blobs.iter().map(|blob| blob.rect));
            n_boxes += boxes.len();
            n_blobs += observation.blobs.len();
        }
    }
    assert_eq!(n_boxes, 1873);
    let (of_boxes, of_blobs) = (n_met_in_all as f64 / n_boxes as f64, n_met_in_all as f64 / n_blobs as f64);
    assert!(of_boxes >= 0.89, "{of_boxes:.3} of the boxes met");
    assert!(of_blobs >= 0.94, "{of_blobs:.3} of the blobs meet a box");
}

#[test]
fn person_who_sits_still_is_cut_out_of_a_held_background() {
    let background = BackgroundSettings { learning: Learning::Hold, ..BackgroundSettings::default() };
    // Measured by eye in frame 200, from the mask's head to its feet, chair included.
    let seated = [
        ("utrecht_voxel4/cam1", PixelRect { x: 335, y: 152, width: 88, height: 178 }),
        ("utrecht_voxel4/cam2", PixelRect { x: 300, y: 236, width: 84, height: 206 }),
    ];
    for (folder, rect) in seated {
        let Some(folder) = real_data(folder) else { return };
        let mut pipeline = Pipeline::new(&background, &SegmentSettings::default());
        for frame in frames(&folder.join("background.avi")) {
            pipeline.learn(&frame.image, 0.04);
        }
        let mut frames = frames(&folder.join("video.avi"));
        let observation = pipeline.process(frames.nth(200).unwrap());
        let person = observation.blobs.iter().max_by_key(|blob| blob.area_px).unwrap();
        assert!(overlap(centred(person.rect), centred(rect)) > 0.8, "{folder:?}: {person:?}");
        let n_moving = observation.labels.data.iter().filter(|label| **label == MOVING).count();
        assert!(
            f64::from(person.area_px) > 0.9 * n_moving as f64,
            "{folder:?}: little else moves, {person:?} of {n_moving}"
        );
    }
}
