//! How far every pixel lies from its silhouette's outline: what texture is faded by towards it, and what edges are smoothed by.

use super::View;
use crate::frame::Mask;
use crate::segment::{DistanceTransform, NO_OUTSIDE};

/// Pixels from the outline that a distance tells; beyond, it is that. `REACH_PX` of common/hull.wgsl.
pub const REACH_PX: f64 = 8.0;

impl View {
    /// Of every pixel of the mask, how far its middle lies within the silhouette's outline, or outside of it, exact to what a byte
    /// holds: 0 is [`REACH_PX`] outside, 255 so far inside. The mask's own border is no outline: beyond it nothing is known.
    ///
    /// **Shape** as [`Self::size_px`], row by row. **Cost** linear in the pixels.
    #[must_use]
    pub fn distances(&self, transform: &mut DistanceTransform) -> Mask {
        let [width, height] = self.size_px();
        let coded = |i: usize| u8::from(self.is_inside_at(i % width, i / width));
        let mask = Mask {
            width: width as u32,
            height: height as u32,
            data: (0..width * height).map(coded).collect::<Vec<u8>>().into(),
        };
        let mut found = vec![0.0_f64; width * height];
        // From the middle of the nearest pixel of the other kind, half a pixel beyond the outline.
        for (kind, sign) in [(1, 1.0), (0, -1.0)] {
            transform.compute(&mask, |value| value == kind);
            for (y, row) in found.chunks_exact_mut(width).enumerate() {
                let squared = transform.squared_row(y as u32);
                for (distance, squared) in row.iter_mut().zip(squared).filter(|(_, squared)| **squared > 0) {
                    *distance = sign * from_outline(*squared);
                }
            }
        }
        let byte = |distance: f64| ((distance / REACH_PX).clamp(-1.0, 1.0) * 127.5 + 127.5).round() as u8;
        Mask { data: found.into_iter().map(byte).collect::<Vec<u8>>().into(), ..mask }
    }
}

/// Of a squared distance from the middle of the nearest pixel of the other kind.
fn from_outline(squared: u32) -> f64 {
    if squared == NO_OUTSIDE { REACH_PX } else { f64::from(squared).sqrt() - 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Distortion, Pose};
    use glam::{DVec2, DVec3};

    fn view(width: usize, is_inside: Vec<bool>) -> View {
        let pose = Pose::looking_at(DVec3::X * 5.0, DVec3::ZERO).expect("a direction");
        let camera =
            Camera::new((640, 480), DVec2::splat(500.0), DVec2::new(320.0, 240.0), Distortion::None, pose)
                .expect("a camera");
        View::new(camera, (width, is_inside), 0.0).expect("a view")
    }

    #[test]
    fn distances_are_those_from_the_outline_and_its_border_is_none() {
        // The right half of a row of pictures is inside.
        let of = view(20, (0..20 * 5).map(|i| i % 20 >= 10).collect());
        let found = of.distances(&mut DistanceTransform::default());
        let pixels = |x: u32| (f64::from(found.get(x, 2)) / 127.5 - 1.0) * REACH_PX;
        for (x, expected) in [(10, 0.5), (9, -0.5), (13, 3.5), (6, -3.5), (19, 8.0), (0, -8.0)] {
            assert!((pixels(x) - expected).abs() < REACH_PX / 127.0, "{x}: {}", pixels(x));
        }
        for (is_inside, expected) in [(true, 255), (false, 0)] {
            let found = view(7, vec![is_inside; 21]).distances(&mut DistanceTransform::default());
            assert!(found.data.iter().all(|value| *value == expected));
        }
    }
}
