//! Pieces of a mask where the background still shows what is gone.
//!
//! Bits and the luma of a frame and of its background flow in; bits flow out. Knows nothing of time or of tracks.

use super::components::{Components, Connectivity, Wanted};
use super::contour::contour;
use super::edges::{OutlineOf, outline_of};
use crate::frame::{BitMask, Plane};

/// Finds gaps; keeps its memory from one look to the next.
#[derive(Debug, Default)]
pub struct GapFinder {
    components: Components,
    is_gap: Vec<bool>,
    bits: BitMask,
}

impl GapFinder {
    /// The 8-connected pieces of `of`, of at least `min_area_px` pixels, whose outline is that of something that is
    /// gone ([`outline_of`]).
    ///
    /// **Cost** linear in the pixels of `of`.
    pub fn find(
        &mut self,
        of: &BitMask,
        frame: Plane<'_>,
        background: Plane<'_>,
        min_area_px: u32,
    ) -> &BitMask {
        self.bits.reset(of.width(), of.height());
        self.components.find(of, Wanted::Ones, Connectivity::Eight);
        let pieces = self.components.pieces();
        self.is_gap.clear();
        self.is_gap.resize(pieces.len(), false);
        let mut n_begun = 0;
        for run in self.components.runs() {
            let piece_idx = run.piece_idx as usize;
            // Pieces come in the order of their first runs.
            if piece_idx == n_begun {
                n_begun += 1;
                self.is_gap[piece_idx] = pieces[piece_idx].area_px >= min_area_px && {
                    let corners = contour(of, 0..of.width() as u32, (run.start, run.y));
                    outline_of(frame, background, &corners) == OutlineOf::Gap
                };
            }
            if self.is_gap[piece_idx] {
                self.bits.set_run(run.y as usize, run.start as usize, run.end as usize);
            }
        }
        &self.bits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

    /// An even floor with dark boxes: columns, rows.
    fn picture(boxes: &[[std::ops::Range<usize>; 2]]) -> YuvImage {
        let mut data = vec![128; YuvLayout::packed_len(64, 32)];
        for [columns, rows] in boxes {
            for y in rows.clone() {
                data[y * 64..][columns.clone()].fill(40);
            }
        }
        YuvImage::new(YuvLayout::packed(64, 32), ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
    }

    #[test]
    fn what_is_gone_is_found_and_what_came_is_not() {
        let (gone, came, small) = ([4..14, 4..24], [30..40, 4..24], [50..53, 4..7]);
        let background = picture(&[gone.clone(), small.clone()]);
        let frame = picture(std::slice::from_ref(&came));
        let mut foreground = BitMask::new(64, 32);
        for [columns, rows] in [&gone, &came, &small] {
            for y in rows.clone() {
                foreground.set_run(y, columns.start, columns.end);
            }
        }
        let mut finder = GapFinder::default();
        let found = finder.find(&foreground, frame.plane(0), background.plane(0), 20);
        assert_eq!(found.count_ones(), 200);
        assert!(found.get(4, 4) && found.get(13, 23));
        assert_eq!(
            finder.find(&foreground, frame.plane(0), background.plane(0), 9).count_ones(),
            209,
            "the small one too"
        );
        let nothing = BitMask::new(64, 32);
        assert_eq!(finder.find(&nothing, frame.plane(0), background.plane(0), 1).count_ones(), 0);
    }
}
