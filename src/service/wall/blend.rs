//! Edge blending: where projectors overlap, each fades out so that their light adds up to the picture's.

use super::Tile;
use videofields_vision::frame::{RgbImage, linear_from_srgb, srgb_from_linear};

/// Fades a tile's picture out over its `blend_px`. The light of a column or row `i` of `n` is `(i + 1/2) / n` of the whole,
/// counted from the edge, so that it and its mirror image add up to one.
pub fn blend(tile: &Tile, image: &mut RgbImage) {
    if tile.blend_px == [0; 4] {
        return;
    }
    let [left, right, top, bottom] = tile.blend_px;
    let columns: Vec<f32> = (0..image.width).map(|x| share(x, image.width, left, right)).collect();
    let linear: [f32; 256] = std::array::from_fn(|code| linear_from_srgb(code as f32 / 255.0));
    let width = image.width as usize;
    for (y, row) in image.data.chunks_exact_mut(3 * width.max(1)).enumerate() {
        let of_row = share(y as u32, image.height, top, bottom);
        for (pixel, of_column) in row.chunks_exact_mut(3).zip(&columns) {
            let light = of_row * of_column;
            if light < 1.0 {
                for code in pixel {
                    // A cast from float saturates.
                    *code = srgb_from_linear(linear[usize::from(*code)] * light).mul_add(255.0, 0.5) as u8;
                }
            }
        }
    }
}

/// The share of its light that a column or row keeps.
fn share(at: u32, count: u32, first: u32, last: u32) -> f32 {
    let ramp = |from_edge: u32, over: u32| {
        if from_edge < over { (from_edge as f32 + 0.5) / over as f32 } else { 1.0 }
    };
    ramp(at, first) * ramp(count - 1 - at, last)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_light_of_overlapping_edges_adds_up() {
        let tile = |blend_px| Tile {
            id: "r1c1".to_owned(),
            size_px: [40, 8],
            corners_m: [DVec3::ZERO, DVec3::X, DVec3::Y],
            blend_px,
        };
        let grey = || RgbImage { width: 40, height: 8, data: vec![180; 40 * 8 * 3] };
        let (mut left, mut right) = (grey(), grey());
        blend(&tile([0, 12, 0, 0]), &mut left);
        blend(&tile([12, 0, 0, 0]), &mut right);
        let light = |image: &RgbImage, x: usize| linear_from_srgb(f32::from(image.data[3 * x]) / 255.0);
        let whole = linear_from_srgb(180.0 / 255.0);
        for x in 0..12 {
            let sum = light(&left, 28 + x) + light(&right, x);
            assert!((sum - whole).abs() < 0.005, "{x}: {sum} of {whole}");
        }
        assert_eq!(left.data[0], 180);
        assert!(left.data[3 * 39] < 50 && right.data[0] < 50);
        let mut none = grey();
        blend(&tile([0; 4]), &mut none);
        assert_eq!(none, grey());
        // Rows fade as columns do, and corners of both.
        let mut corner = grey();
        blend(&tile([10, 10, 3, 3]), &mut corner);
        assert!(corner.data[0] < corner.data[3 * 20] && corner.data[3 * 20] < 180);
        assert_eq!(corner.data[(4 * 40 + 20) * 3], 180);
    }
}
