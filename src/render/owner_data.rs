//! Packs the owners of what moves in cameras' pictures as shaders read them.
//!
//! Owner maps of the cameras of one frame flow in; the words of one buffer flow out: four for each camera of the frame (where its cells
//! begin, how many there are in a row, how many rows, their sides in pixels; sides of 0 where nobody is told apart), then the cells of
//! all, two a word. shaders/render/billboard.wgsl is the counterpart.

use videofields_picture::fuse::OwnerMap;

/// Words of each camera before all cells.
const HEADER_WORDS: usize = 4;

/// Owner maps of one frame; empty where there are none.
#[derive(Debug, Default)]
pub(super) struct OwnerData {
    words: Vec<u32>,
}

impl OwnerData {
    /// Takes the maps of a frame of `n_cameras` cameras, with the places of theirs among these.
    pub(super) fn fill<'a>(&mut self, n_cameras: usize, maps: impl Iterator<Item = (usize, &'a OwnerMap)>) {
        self.words.clear();
        for (camera_idx, map) in maps {
            if self.words.is_empty() {
                self.words.resize(n_cameras * HEADER_WORDS, 0);
            }
            let (width, height) = map.size();
            let header = [self.words.len() as u32, width, height, map.side_px()];
            self.words[camera_idx * HEADER_WORDS..][..HEADER_WORDS].copy_from_slice(&header);
            let pair = |cells: &[u16]| {
                u32::from(cells[0]) | cells.get(1).map_or(0, |second| u32::from(*second) << 16)
            };
            self.words.extend(map.of_cells().chunks(2).map(pair));
        }
    }

    /// Returns all words; none where no camera has a map.
    pub(super) fn words(&self) -> &[u32] {
        &self.words
    }
}
