//! Who stands, what was left behind, what was taken away: what the background must not learn, and what it must.
//!
//! Tracks and blobs of one camera's frames flow in, with the frame and its background; events flow out, and two masks in
//! the model's size: pixels that must not learn, and pixels whose background is certain to be what is seen.
//!
//! Told from what moves: a track that once moved by its own size came by itself; one that never did was put there, or it
//! shows where something was taken from. Which of the two, its outline tells (`segment::outline_of`).

use super::unchanging::Unchanging;
use crate::timeline::{Event, EventKind};
use std::collections::BTreeMap;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::TrackSettings;
use videofields_vision::frame::{BitMask, CameraId, Plane};
use videofields_vision::segment::{Blob, GapFinder, OutlineOf, PixelRect, dilate, outline_of};
use videofields_vision::track::Track;

/// Time for which what appears is watched before it is decided what it is; meanwhile it is not learned.
const DECIDE_SECS: f64 = 3.0;

/// How often the outline of what stands is looked at.
const LOOK_SECS: f64 = 2.0;

/// In a background's first minute what goes away was in the first pictures, and never part of the place.
pub(super) const SETTLED_SECS: f64 = 60.0;

/// A background that has been learned for less than this knows little: what it shows is given up at the first sign.
const NEW_SECS: f64 = 10.0;

/// As [`DECIDE_SECS`] and [`LOOK_SECS`] while the background is new.
const NEW_DECIDE_SECS: f64 = 1.0;

/// A blob larger than this share of the picture is no thing that stands: light, a camera that turned, a curtain.
const GREATEST_SHARE: f64 = 0.25;

/// More foreground than this share of the picture says nothing of single things.
const GREATEST_FOREGROUND: f64 = 0.5;

/// What is known of one track beside what the tracker knows.
#[derive(Clone, Debug)]
struct Known {
    /// Its middle when it was first seen.
    first_center: [f64; 2],
    /// Whether it ever was farther from there than its own size.
    has_moved: bool,
    /// What its outline was when it was looked at last while it stood, and when that was.
    outline: Option<(OutlineOf, Timestamp)>,
    /// How often in a row that was a gap.
    n_gaps: u32,
    is_told: bool,
}

/// Watches one camera's tracks.
#[derive(Debug)]
pub(super) struct Standing {
    settings: TrackSettings,
    known: BTreeMap<u64, Known>,
    held: BitMask,
    /// Under what moves or is not decided, while `held` is gathered.
    passed: BitMask,
    /// Was held under a thing that stands, and is foreground since.
    kept: BitMask,
    unchanging: Unchanging,
    gap_finder: GapFinder,
    /// The gaps among them at the last look.
    gaps: BitMask,
    certain: BitMask,
    scratch: BitMask,
}

/// One frame as it is looked at here.
pub(super) struct Seen<'a> {
    pub(super) camera: &'a CameraId,
    pub(super) time: Timestamp,
    /// The size in which blobs and tracks are given.
    pub(super) size_px: (u32, u32),
    /// By how much the model's pictures are smaller.
    pub(super) factor: u32,
    /// Luma of the frame and of its background, in the model's size.
    pub(super) luma: [Plane<'a>; 2],
    pub(super) foreground_share: f64,
    /// For how long the background has been learned.
    pub(super) learned_secs: f64,
    /// Least area of a blob in the model's size, pixels.
    pub(super) min_area_px: u32,
    pub(super) blobs: &'a [Blob],
    pub(super) tracks: &'a [Track],
    /// The moving pixels, in the model's size.
    pub(super) moving: &'a BitMask,
}

impl Seen<'_> {
    const fn is_new(&self) -> bool {
        self.learned_secs < NEW_SECS
    }

    /// For how long what appears is watched before it is decided what it is.
    const fn decide_secs(&self) -> f64 {
        if self.is_new() { NEW_DECIDE_SECS } else { DECIDE_SECS }
    }

    const fn look_secs(&self) -> f64 {
        if self.is_new() { NEW_DECIDE_SECS } else { LOOK_SECS }
    }

    /// For how long a track has stood.
    fn still_secs(&self, track: &Track) -> f64 {
        track.still_since.map_or(0.0, |since| self.time.secs_since(since))
    }

    /// Whether all that share a blob stand: else its outline is partly that of what moves.
    fn is_still(&self, blob_idx: Option<u32>) -> bool {
        let mut sharing = self.tracks.iter().filter(|track| track.blob_idx == blob_idx);
        sharing.all(|track| self.still_secs(track) >= self.decide_secs())
    }
}

impl Standing {
    pub(super) fn new(settings: &TrackSettings) -> Self {
        Self {
            settings: settings.clone(),
            known: BTreeMap::new(),
            held: BitMask::default(),
            passed: BitMask::default(),
            kept: BitMask::default(),
            unchanging: Unchanging::default(),
            gap_finder: GapFinder::default(),
            gaps: BitMask::default(),
            certain: BitMask::default(),
            scratch: BitMask::default(),
        }
    }

    /// Forgets every track, as where the picture's format changed.
    pub(super) fn reset(&mut self) {
        self.known.clear();
        self.held.reset(0, 0);
        self.kept.reset(0, 0);
        self.unchanging = Unchanging::default();
        self.gaps.reset(0, 0);
    }

    /// The pixels that the next frame must not teach; none where the mask is empty or of another size.
    pub(super) const fn held(&self) -> &BitMask {
        &self.held
    }

    /// Looks at a frame. Events are given to `tell`; the answer is the pixels whose background is what is seen, if there
    /// are any.
    pub(super) fn observe(&mut self, seen: &Seen<'_>, mut tell: impl FnMut(Event)) -> Option<&BitMask> {
        for mask in [&mut self.held, &mut self.passed, &mut self.certain] {
            mask.reset(seen.moving.width(), seen.moving.height());
        }
        self.known.retain(|id, _| seen.tracks.binary_search_by_key(id, |track| track.id).is_ok());
        if self.settings.absorb_after_secs == 0.0 || seen.foreground_share > GREATEST_FOREGROUND {
            self.unchanging.forget();
            return None;
        }
        let mut has_certain = false;
        for track in seen.tracks {
            let Some(blob) = track.blob_idx.and_then(|idx| seen.blobs.get(idx as usize)) else { continue };
            let known = self.known.entry(track.id).or_insert_with(|| Known::new(track));
            known.has_moved |= known.is_far(track);
            let n_pixels = f64::from(seen.size_px.0) * f64::from(seen.size_px.1);
            // The outline of a blob smaller than the ordinary least area tells nothing.
            let is_small = blob.area_px < seen.min_area_px * seen.factor * seen.factor;
            if is_small || f64::from(blob.area_px) > GREATEST_SHARE * n_pixels {
                continue;
            }
            let still_secs = seen.still_secs(track);
            let is_gap = known.look(seen, track, blob);
            let is_undecided = seen.time.secs_since(track.first_seen) < seen.decide_secs();
            if is_gap {
                mark(&mut self.certain, seen, &blob.rect);
                has_certain = true;
            } else if still_secs < self.settings.absorb_after_secs {
                if known.is_thing() {
                    mark(&mut self.held, seen, &blob.rect);
                } else if known.is_moving() || is_undecided {
                    mark(&mut self.passed, seen, &blob.rect);
                }
            }
            let news = if is_gap {
                (!known.has_moved && !known.is_told).then_some(EventKind::TakenAway)
            } else {
                known.news(still_secs, self.settings.stop_after_secs)
            };
            // What was in the first pictures and went away was never part of the place.
            if let Some(kind) =
                news.filter(|kind| *kind != EventKind::TakenAway || seen.learned_secs >= SETTLED_SECS)
            {
                known.is_told = true;
                tell(Event {
                    camera: seen.camera.clone(),
                    time: seen.time,
                    since: track.still_since.unwrap_or(track.first_seen),
                    kind,
                    rect: Some(track.rect),
                    track: Some(track.id),
                    is_end: false,
                });
            }
        }
        let has_looked = self.unchanging.observe(seen.time, seen.moving, seen.luma[0], seen.look_secs());
        if has_looked {
            has_certain |= self.look_at_unchanging(seen);
        }
        self.hold_passed(seen.moving);
        grow(&mut self.held, &mut self.scratch);
        grow(&mut self.certain, &mut self.scratch);
        has_certain.then_some(&self.certain)
    }

    /// Adds to what is held under things that stand what is under things that move, but for pixels that have not changed
    /// for seconds: what moves has left them, and drags on its ghost, or the place that it hid when it was learned.
    fn hold_passed(&mut self, moving: &BitMask) {
        fit(&mut self.kept, moving);
        let words = self.held.words_mut().iter_mut().zip(self.kept.words_mut());
        let masks = self.passed.words().iter().zip(self.unchanging.bits().words()).zip(moving.words());
        for ((held, kept), ((passed, unchanging), moving)) in words.zip(masks) {
            *kept = (*kept | *held) & moving;
            *held |= passed & (!unchanging | *kept);
        }
    }

    /// Looks at the pieces that have not changed for seconds, whatever tracks they are under; whether the background of
    /// some is certain now: those that were gaps at the last look too, or at once while the background is new.
    fn look_at_unchanging(&mut self, seen: &Seen<'_>) -> bool {
        let [frame, background] = seen.luma;
        let gaps = self.gap_finder.find(self.unchanging.bits(), frame, background, seen.min_area_px);
        fit(&mut self.gaps, gaps);
        let mut has_certain = false;
        let words = self.certain.words_mut().iter_mut().zip(self.gaps.words_mut()).zip(gaps.words());
        for ((certain, before), now) in words {
            let sure = if seen.is_new() { *now } else { *now & *before };
            *certain |= sure;
            has_certain |= sure != 0;
            *before = *now & !sure;
        }
        has_certain
    }
}

impl Known {
    fn new(track: &Track) -> Self {
        Self { first_center: center(&track.rect), has_moved: false, outline: None, n_gaps: 0, is_told: false }
    }

    fn is_far(&self, track: &Track) -> bool {
        let [x, y] = center(&track.rect);
        let [from_x, from_y] = self.first_center;
        let size = f64::from(track.rect.width.max(track.rect.height));
        (x - from_x).hypot(y - from_y) > size
    }

    /// Looks at the outline of what stands, every now and then. Whether it shows where something was taken from: then that
    /// is forgotten at once, since its place becomes background and the track may go on with something else. Of a track
    /// that moved it takes a second look: what it followed has left, and it stays with what that had hidden.
    fn look(&mut self, seen: &Seen<'_>, track: &Track, blob: &Blob) -> bool {
        let is_due = self.outline.is_none_or(|(_, looked)| seen.time.secs_since(looked) >= seen.look_secs());
        if seen.still_secs(track) < seen.decide_secs() {
            self.outline = None;
            self.n_gaps = 0;
        } else if is_due && seen.is_still(track.blob_idx) {
            let found = outline(seen, blob);
            self.outline = Some((found, seen.time));
            self.n_gaps = if found == OutlineOf::Gap { self.n_gaps + 1 } else { 0 };
        }
        let is_gap = self.n_gaps >= if self.has_moved { 2 } else { 1 };
        if is_gap {
            self.outline = None;
            self.n_gaps = 0;
        }
        is_gap
    }

    /// Whether it came by itself and has not stood for long enough to be looked at. What has, and has no clear outline, is
    /// learned: it may be what is left of a ghost.
    const fn is_moving(&self) -> bool {
        self.has_moved && self.outline.is_none()
    }

    fn is_thing(&self) -> bool {
        self.outline.is_some_and(|(outline, _)| outline == OutlineOf::Thing)
    }

    /// What there is to tell of what stands, once.
    fn news(&self, still_secs: f64, stop_after_secs: f64) -> Option<EventKind> {
        let has_stood = still_secs >= stop_after_secs;
        if self.is_told {
            None
        } else if self.has_moved {
            has_stood.then_some(EventKind::Stopped)
        } else {
            (has_stood && self.is_thing()).then_some(EventKind::LeftBehind)
        }
    }
}

fn center(rect: &PixelRect) -> [f64; 2] {
    [f64::from(rect.x) + 0.5 * f64::from(rect.width), f64::from(rect.y) + 0.5 * f64::from(rect.height)]
}

/// What a blob is the outline of, in the model's pictures.
fn outline(seen: &Seen<'_>, blob: &Blob) -> OutlineOf {
    let factor = seen.factor as u16;
    if factor == 1 {
        return outline_of(seen.luma[0], seen.luma[1], &blob.contour);
    }
    let reduced: Vec<[u16; 2]> =
        blob.contour.iter().map(|corner| corner.map(|value| value / factor)).collect();
    outline_of(seen.luma[0], seen.luma[1], &reduced)
}

/// Marks the moving pixels of a rectangle.
fn mark(mask: &mut BitMask, seen: &Seen<'_>, rect: &PixelRect) {
    let reduced = |value: u32| (value / seen.factor) as usize;
    let right = ((rect.x + rect.width).div_ceil(seen.factor) as usize).min(mask.width());
    let bottom = ((rect.y + rect.height).div_ceil(seen.factor) as usize).min(mask.height());
    for y in reduced(rect.y)..bottom {
        seen.moving.copy_run(mask, y, reduced(rect.x), right);
    }
}

/// Empties a mask that is of another size than `other`.
fn fit(mask: &mut BitMask, other: &BitMask) {
    if (mask.width(), mask.height()) != (other.width(), other.height()) {
        mask.reset(other.width(), other.height());
    }
}

/// Grows a mask by two pixels: outlines are no more exact than that.
fn grow(mask: &mut BitMask, scratch: &mut BitMask) {
    dilate(mask, scratch);
    dilate(scratch, mask);
}
