//! The rows of a frame that one band of a model covers: two of luma, one of chroma.

use super::tile::TILE;
use crate::frame::YuvImage;

/// The rows of a frame that a band covers.
pub(super) struct BandRows<'a> {
    luma: [&'a [u8]; 2],
    n_luma: usize,
    pub(super) u: &'a [u8],
    pub(super) v: &'a [u8],
}

impl<'a> BandRows<'a> {
    pub(super) fn of(image: &'a YuvImage, pair_idx: usize) -> Self {
        let [luma, u, v] = [image.plane(0), image.plane(1), image.plane(2)];
        let pair_idx = pair_idx as u32;
        let first = 2 * pair_idx;
        let last = (first + 1).min(luma.height - 1);
        Self {
            luma: [luma.row(first), luma.row(last)],
            n_luma: (last - first + 1) as usize,
            u: u.row(pair_idx),
            v: v.row(pair_idx),
        }
    }

    pub(super) const fn width(&self) -> usize {
        self.luma[0].len()
    }

    /// Rows of luma: two, or one at the foot of an odd height.
    pub(super) const fn n_luma(&self) -> usize {
        self.n_luma
    }

    pub(super) fn luma(&self) -> impl Iterator<Item = &'a [u8]> {
        self.luma.into_iter().take(self.n_luma)
    }

    /// Whether a row of luma of `other`, of the same size, has the same codes in a tile.
    #[inline(always)]
    pub(super) fn has_same_luma(&self, other: &Self, row: usize, tile_idx: usize) -> bool {
        is_same::<TILE>(self.luma[row], other.luma[row], tile_idx)
    }

    /// Whether the row of chroma of `other`, of the same size, has the same codes in a tile.
    #[inline(always)]
    pub(super) fn has_same_chroma(&self, other: &Self, tile_idx: usize) -> bool {
        is_same::<{ TILE / 2 }>(self.u, other.u, tile_idx)
            && is_same::<{ TILE / 2 }>(self.v, other.v, tile_idx)
    }

    pub(super) fn sample(&self, luma: &[u8], x: usize) -> [f32; 3] {
        [f32::from(luma[x]), f32::from(self.u[x / 2]), f32::from(self.v[x / 2])]
    }
}

/// Whether two rows have the same `N` codes from `N tile_idx` on, or those that there are.
#[inline(always)]
fn is_same<const N: usize>(a: &[u8], b: &[u8], tile_idx: usize) -> bool {
    let (a, b) = (&a[tile_idx * N..], &b[tile_idx * N..]);
    let (Some(a), Some(b)) = (a.first_chunk::<N>(), b.first_chunk::<N>()) else { return a == b };
    // A plain loop, since comparing arrays is a call.
    let mut differs = 0;
    for i in 0..N {
        differs |= a[i] ^ b[i];
    }
    differs == 0
}
