//! Where figures are: in the world, and in every camera's picture.
//!
//! Two files of JSON lines: `positions.jsonl` with every figure's place, box, and the rectangles around that box in the
//! cameras' pictures; `visible.jsonl` of a camera with what its instance masks show of them.

use super::JsonLines;
use crate::SimulateError;
use crate::actor::ActorKind;
use crate::options::Device;
use crate::world::World;
use glam::{DVec2, DVec3};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::Camera;

/// A line of `positions.jsonl`.
#[derive(Serialize)]
struct PositionsDocument<'a> {
    frame: u64,
    time_secs: f64,
    figures: Vec<FigureDocument<'a>>,
}

#[derive(Serialize)]
struct FigureDocument<'a> {
    instance: u8,
    name: &'a str,
    kind: ActorKind,
    foot_m: [f64; 3],
    heading_rad: f64,
    height_m: f64,
    box_low_m: [f64; 3],
    box_high_m: [f64; 3],
    /// By camera: left, top, right, bottom around the box's corners, cut to the picture; absent where the box is
    /// outside it or a corner of it has no place in it.
    rectangles_px: BTreeMap<&'a str, [f64; 4]>,
}

/// Writes where every figure is in each of `n_frames` frames, whose times `time_of` tells.
pub(crate) fn write_positions(
    path: PathBuf,
    world: &World,
    cameras: &[Device],
    n_frames: u64,
    time_of: impl Fn(u64) -> f64,
) -> Result<(), SimulateError> {
    let mut file = JsonLines::create(path)?;
    for frame in 0..n_frames {
        let time_secs = time_of(frame);
        let positions = world.figures(time_secs)?;
        let figures = positions.iter().map(|figure| {
            let (low, high) = figure.box_in_world;
            let rectangles = cameras
                .iter()
                .filter_map(|device| Some((device.id.as_str(), rectangle_px(&device.camera, low, high)?)));
            FigureDocument {
                instance: figure.instance,
                name: &figure.name,
                kind: figure.kind,
                foot_m: figure.foot_in_world.to_array(),
                heading_rad: figure.heading_rad,
                height_m: figure.height_m,
                box_low_m: low.to_array(),
                box_high_m: high.to_array(),
                rectangles_px: rectangles.collect(),
            }
        });
        let figures = figures.collect();
        file.write(&PositionsDocument { frame, time_secs, figures })?;
    }
    file.finish()
}

/// Left, top, right, bottom of the box along the world's axes between `low` and `high`, cut to the picture.
fn rectangle_px(camera: &Camera, low: DVec3, high: DVec3) -> Option<[f64; 4]> {
    let (width, height) = camera.size_px();
    let size = DVec2::new(f64::from(width), f64::from(height));
    let (mut least, mut most) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for corner in 0..8_u32 {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
        let at = camera.project(DVec3::new(pick(0), pick(1), pick(2)))?.texture * size;
        (least, most) = (least.min(at), most.max(at));
    }
    let (least, most) = (least.max(DVec2::ZERO), most.min(size));
    (least.x < most.x && least.y < most.y).then_some([least.x, least.y, most.x, most.y])
}

/// A line of a camera's `visible.jsonl`.
#[derive(Debug, PartialEq, Serialize)]
pub(crate) struct VisibleDocument {
    frame: u64,
    time_secs: f64,
    figures: Vec<VisibleFigure>,
}

#[derive(Debug, PartialEq, Serialize)]
struct VisibleFigure {
    instance: u8,
    /// Left, top, right, bottom around its pixels; right and bottom are the first column and row without any.
    rectangle_px: [u32; 4],
    n_pixels: u64,
}

/// What a frame's instance mask shows of the figures.
pub(crate) fn visible(frame: u64, time_secs: f64, instance: &Mask) -> VisibleDocument {
    let mut found: BTreeMap<u8, ([u32; 4], u64)> = BTreeMap::new();
    for y in 0..instance.height {
        for (x, value) in (0..).zip(instance.row(y)).filter(|(_, value)| **value > 0) {
            let ([left, top, right, bottom], count) =
                found.entry(*value).or_insert(([u32::MAX, u32::MAX, 0, 0], 0));
            (*left, *top) = ((*left).min(x), (*top).min(y));
            (*right, *bottom) = ((*right).max(x + 1), (*bottom).max(y + 1));
            *count += 1;
        }
    }
    let figure = |(instance, (rectangle_px, n_pixels))| VisibleFigure { instance, rectangle_px, n_pixels };
    VisibleDocument { frame, time_secs, figures: found.into_iter().map(figure).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_are_around_boxes_and_within_pictures() {
        let camera = Camera::pinhole(DVec3::new(0.0, -10.0, 1.0), DVec3::new(0.0, 0.0, 1.0), 0.6, (200, 100))
            .expect("a camera");
        let cube = |center: DVec3| rectangle_px(&camera, center - 0.5, center + 0.5);
        let [left, top, right, bottom] = cube(DVec3::Z).expect("in front");
        assert!((left + right - 200.0).abs() < 1e-6 && (top + bottom - 100.0).abs() < 1e-6);
        // The near face is 9.5 m away: its half width in pixels.
        let half = 0.5 / 9.5 * 50.0 / 0.3_f64.tan();
        assert!((right - 100.0 - half).abs() < 1e-6, "{right}");
        assert_eq!(cube(DVec3::new(0.0, -20.0, 1.0)), None, "behind");
        assert_eq!(cube(DVec3::new(50.0, 0.0, 1.0)), None, "beside");
        let [left, _, right, _] = cube(DVec3::new(6.1, 0.0, 1.0)).expect("at the edge");
        assert!(left > 185.0 && right == 200.0, "{left} {right}");
    }

    #[test]
    fn visible_figures_are_counted() {
        let instance = Mask { width: 4, height: 2, data: vec![0, 2, 2, 0, 0, 0, 2, 7].into() };
        let expected = [
            VisibleFigure { instance: 2, rectangle_px: [1, 0, 3, 2], n_pixels: 3 },
            VisibleFigure { instance: 7, rectangle_px: [3, 1, 4, 2], n_pixels: 1 },
        ];
        assert_eq!(
            visible(3, 0.3, &instance),
            VisibleDocument { frame: 3, time_secs: 0.3, figures: expected.into() }
        );
    }
}
