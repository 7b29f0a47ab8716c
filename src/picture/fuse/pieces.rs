//! What one camera sees, a piece for each thing: blobs with the tracks that they show, fragments gathered.

use super::line::Followed;
use videofields_vision::segment::{Blob, PixelRect};
use videofields_vision::track::Track;

/// Share of a blob without a track of its own that must lie within a track's rectangle for it to be a fragment of that
/// one; the tracker takes them so too.
const FRAGMENT_COVER: f64 = 0.7;

/// What is less tall than this share of a track's rectangle is no person beside it but a part, a limb that swings clear or comes
/// back, if it lies within that rectangle broadened by this share of its width on either side.
const PART_HEIGHT: f64 = 0.45;
const PART_BESIDE: f64 = 0.25;

/// Most blobs of one camera that are looked at, the largest: the tracker looks at no more.
const MAX_BLOBS: usize = 1024;

/// A blob with its fragments.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    /// Around all of it.
    pub(super) rect: PixelRect,
    /// The lowest foot, pixels with pixel centres at +0.5.
    pub(super) foot_in_image: [f64; 2],
    /// Whether the foot may lie outside the picture.
    pub(super) is_truncated: bool,
    /// Whose it is; several of people who share a blob, none of what is not followed yet.
    pub(super) tracks: Vec<Followed>,
    /// Of a single track, the rectangle of the whole thing and its foot, also where the border cuts it.
    pub(super) whole: Option<(PixelRect, [f64; 2])>,
    /// Says that it is what is left of a blob, of which other pixels are somebody's whom several cameras tell together.
    pub(super) is_rest: bool,
}

/// The pieces of one frame, in the order of their largest blobs.
pub(super) fn pieces(member: usize, blobs: &[Blob], tracks: &[Track]) -> Vec<Piece> {
    let mut chosen: Vec<usize> = (0..blobs.len()).collect();
    if chosen.len() > MAX_BLOBS {
        chosen.sort_by_key(|idx| (std::cmp::Reverse(blobs[*idx].area_px), *idx));
        chosen.truncate(MAX_BLOBS);
        chosen.sort_unstable();
    }
    let shown: Vec<Vec<&Track>> = chosen
        .iter()
        .map(|idx| {
            let in_blob = |track: &&Track| track.blob_idx.is_some_and(|blob| blob as usize == *idx);
            let all: Vec<&Track> = tracks.iter().filter(in_blob).collect();
            let is_part = |track: &&Track| all.iter().any(|whole| is_part(track.rect, whole.rect));
            all.iter().filter(|track| !is_part(track)).copied().collect()
        })
        .collect();
    let mut pieces: Vec<Option<Piece>> =
        chosen.iter().zip(&shown).map(|(idx, shown)| Some(piece(member, &blobs[*idx], shown))).collect();
    for free in 0..chosen.len() {
        if !shown[free].is_empty() {
            continue;
        }
        let rect = blobs[chosen[free]].rect;
        let cover =
            |shown: &[&Track]| shown.iter().map(|track| share_of_part(rect, track.rect)).fold(0.0, f64::max);
        let covers = shown.iter().map(|shown| cover(shown)).enumerate();
        let owner =
            covers.filter(|(_, cover)| *cover >= FRAGMENT_COVER).max_by(|(_, a), (_, b)| a.total_cmp(b));
        let Some((owner, _)) = owner else { continue };
        let Some(fragment) = pieces[free].take() else { continue };
        if let Some(piece) = &mut pieces[owner] {
            piece.gather(&fragment);
        }
    }
    pieces.into_iter().flatten().collect()
}

fn piece(member: usize, blob: &Blob, shown: &[&Track]) -> Piece {
    let followed = |track: &&Track| Followed { member, number: track.id, since: track.first_seen };
    let whole = match shown {
        [track] if !track.is_in_group => Some((track.rect, track.foot_in_image)),
        _ => None,
    };
    Piece {
        rect: blob.rect,
        foot_in_image: blob.foot_in_image,
        is_truncated: blob.is_truncated,
        tracks: shown.iter().map(followed).collect(),
        whole,
        is_rest: false,
    }
}

impl Piece {
    fn gather(&mut self, fragment: &Self) {
        let (own, its) = (self.rect, fragment.rect);
        let (x, y) = (own.x.min(its.x), own.y.min(its.y));
        let right = (own.x + own.width).max(its.x + its.width);
        let bottom = (own.y + own.height).max(its.y + its.height);
        self.rect = PixelRect { x, y, width: right - x, height: bottom - y };
        if fragment.foot_in_image[1] > self.foot_in_image[1] {
            self.foot_in_image = fragment.foot_in_image;
        }
        self.is_truncated |= fragment.is_truncated;
    }
}

/// Whether `rect` is but a part of what has the rectangle `whole`.
fn is_part(rect: PixelRect, whole: PixelRect) -> bool {
    f64::from(rect.height) < PART_HEIGHT * f64::from(whole.height)
        && share_of_part(rect, whole) >= FRAGMENT_COVER
}

/// Share of `rect` that `whole` covers; of what is low, also a little beside it.
fn share_of_part(rect: PixelRect, whole: PixelRect) -> f64 {
    let is_low = f64::from(rect.height) < PART_HEIGHT * f64::from(whole.height);
    let beside = if is_low { (PART_BESIDE * f64::from(whole.width)).ceil() as u32 } else { 0 };
    let x = whole.x.saturating_sub(beside);
    let right = whole.x.saturating_add(whole.width).saturating_add(beside);
    share_within(rect, PixelRect { x, width: right - x, ..whole })
}

/// Share of `rect` that `other` covers.
fn share_within(rect: PixelRect, other: PixelRect) -> f64 {
    let overlap = |from: u32, len: u32, other_from: u32, other_len: u32| {
        f64::from((from + len).min(other_from + other_len).saturating_sub(from.max(other_from)))
    };
    let both = overlap(rect.x, rect.width, other.x, other.width)
        * overlap(rect.y, rect.height, other.y, other.height);
    both / (f64::from(rect.width) * f64::from(rect.height)).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use videofields_vision::clock::Timestamp;

    fn rect(x: u32, y: u32, width: u32, height: u32) -> PixelRect {
        PixelRect { x, y, width, height }
    }

    fn blob(rect: PixelRect) -> Blob {
        let foot_in_image =
            [f64::from(rect.x) + 0.5 * f64::from(rect.width), f64::from(rect.y + rect.height)];
        Blob {
            rect,
            area_px: rect.width * rect.height,
            foot_in_image,
            is_truncated: false,
            contour: Arc::default(),
        }
    }

    fn track(id: u64, rect: PixelRect, blob_idx: Option<u32>, n_others: u32) -> Track {
        let at = Timestamp::from_nanos(id as i64);
        Track {
            id,
            rect,
            blob_idx,
            foot_in_image: [1.0, 2.0],
            velocity_px_per_sec: [0.0; 2],
            first_seen: at,
            last_seen: at,
            is_in_group: n_others > 0,
            still_since: None,
        }
    }

    #[test]
    fn fragments_belong_to_their_track_and_its_foot_is_the_lowest() {
        let blobs = [blob(rect(10, 10, 20, 30)), blob(rect(12, 45, 6, 10)), blob(rect(60, 10, 20, 50))];
        let tracks = [track(1, rect(9, 9, 22, 50), Some(0), 0), track(2, rect(0, 0, 5, 5), None, 0)];
        let found = pieces(3, &blobs, &tracks);
        assert_eq!(found.len(), 2);
        assert_eq!((found[0].rect, found[0].foot_in_image), (rect(10, 10, 20, 45), [15.0, 55.0]));
        assert_eq!(found[0].tracks, [Followed { member: 3, number: 1, since: Timestamp::from_nanos(1) }]);
        assert_eq!(found[0].whole, Some((rect(9, 9, 22, 50), [1.0, 2.0])));
        assert!(found[1].tracks.is_empty() && found[1].rect == blobs[2].rect);
    }

    #[test]
    fn a_limb_that_swings_clear_is_no_person_and_comes_back_as_none() {
        let body = rect(100, 100, 20, 50);
        let limb = rect(118, 125, 10, 15);
        let gathered = pieces(0, &[blob(body), blob(limb)], &[track(1, body, Some(0), 0)]);
        assert_eq!((gathered.len(), gathered[0].rect), (1, rect(100, 100, 28, 50)));
        // Who is as tall as half of them, or further beside, is somebody.
        for other in [rect(118, 120, 10, 26), rect(132, 125, 10, 15)] {
            let found = pieces(0, &[blob(body), blob(other)], &[track(1, body, Some(0), 0)]);
            assert_eq!(found.len(), 2, "{other:?}");
        }
        // A track of its own, in the meantime: it is not who the whole is.
        let tracks = [track(1, body, Some(0), 1), track(2, limb, Some(0), 1)];
        let found = pieces(0, &[blob(body)], &tracks);
        assert_eq!(found[0].tracks, [Followed { member: 0, number: 1, since: Timestamp::from_nanos(1) }]);
    }

    #[test]
    fn people_who_share_a_blob_are_one_piece_and_indices_may_lie() {
        let tracks = [
            track(1, rect(0, 0, 9, 9), Some(0), 1),
            track(2, rect(0, 0, 9, 9), Some(0), 1),
            track(3, rect(0, 0, 9, 9), Some(9), 0),
        ];
        let found = pieces(0, &[blob(rect(0, 0, 9, 9))], &tracks);
        assert_eq!((found.len(), found[0].tracks.len(), found[0].whole), (1, 2, None));
        assert!(pieces(0, &[], &tracks).is_empty());
    }
}
