//! What is written of a camera for who follows its foreground: when a background is sent again, and what moves in a frame.

use axum::body::Bytes;
use std::sync::Arc;
use videofields_service::engine::Privacy;
use videofields_vision::clock::Timestamp;
use videofields_vision::encode::{
    EncodeError, ForegroundHeader, MovingRectangle, background_message, foreground_message,
};
use videofields_vision::frame::YuvImage;
use videofields_vision::observation::Observation;
use videofields_vision::segment::Blob;
use videofields_vision::track::Track;

/// Quality of every JPEG in it, as of all other pictures.
const JPEG_QUALITY: u8 = 88;

/// A background is sent again when, a second or more after the last look, this share of its luma differs by more than so many
/// codes from what was sent.
const LOOK_NANOS: i64 = 1_000_000_000;
const CHANGED_SHARE: f64 = 0.01;
const CHANGED_CODES: u8 = 8;

/// Every how manieth column and row is compared.
const STEP: usize = 4;

/// A message, and the background that it is or belongs to.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub(super) background: u32,
    pub(super) is_background: bool,
    pub(super) bytes: Bytes,
    /// What nobody may see, as it was when this was written.
    pub(super) privacy: Arc<Privacy>,
}

/// What a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PieceKind {
    Background,
    Foreground,
}

/// What was written of a camera so far.
#[derive(Default)]
pub(super) struct Writer {
    sequence: u64,
    /// The frame that was written last.
    newest: Option<Timestamp>,
    background: Option<Sent>,
    n_backgrounds: u32,
    privacy: Option<Arc<Privacy>>,
}

/// A background that was sent.
struct Sent {
    picture: Arc<YuvImage>,
    /// The frame at which it was compared last, and with what.
    looked: (Timestamp, Arc<YuvImage>),
}

impl Writer {
    /// The messages of what a camera saw; none of what was written already.
    pub(super) fn pieces(
        &mut self,
        seen: &Observation,
        privacy: &Arc<Privacy>,
    ) -> Result<Vec<Piece>, EncodeError> {
        let time = seen.frame.timestamp;
        if self.privacy.replace(Arc::clone(privacy)).is_some_and(|before| before != *privacy) {
            // Memory may not hide yet what is to be hidden now: written anew from the next look on.
            (self.background, self.newest) = (None, None);
            return Ok(Vec::new());
        }
        if self.newest == Some(time) {
            return Ok(Vec::new());
        }
        self.newest = Some(time);
        let mut pieces = Vec::new();
        if self.is_background_due(seen) {
            self.n_backgrounds = self.n_backgrounds.wrapping_add(1);
            let picture = Arc::clone(&seen.background);
            let looked = (time, Arc::clone(&picture));
            let header = self.header(time, &picture);
            let bytes = background_message(&header, &picture, JPEG_QUALITY)?.into();
            self.background = Some(Sent { picture, looked });
            pieces.push(self.piece(bytes, PieceKind::Background, privacy));
        }
        let track_of = |idx: usize| {
            let is_own = |track: &&Track| track.blob_idx == u32::try_from(idx).ok();
            seen.tracks.iter().find(is_own).map(|track| track.id)
        };
        let moving = |(idx, blob): (usize, &Blob)| MovingRectangle {
            rect: [blob.rect.x, blob.rect.y, blob.rect.width, blob.rect.height],
            track: track_of(idx),
        };
        let moving: Vec<MovingRectangle> = seen.blobs.iter().enumerate().map(moving).collect();
        let header = self.header(time, &seen.frame.image);
        let shown = (&*seen.frame.image, &*seen.labels);
        let bytes = foreground_message(&header, shown, &moving, JPEG_QUALITY)?.into();
        pieces.push(self.piece(bytes, PieceKind::Foreground, privacy));
        Ok(pieces)
    }

    fn piece(&self, bytes: Bytes, kind: PieceKind, privacy: &Arc<Privacy>) -> Piece {
        let is_background = kind == PieceKind::Background;
        Piece { background: self.n_backgrounds, is_background, bytes, privacy: Arc::clone(privacy) }
    }

    fn header(&mut self, time: Timestamp, picture: &YuvImage) -> ForegroundHeader {
        self.sequence += 1;
        let side = |pixels: u32| u16::try_from(pixels).unwrap_or(u16::MAX);
        let size_px = [side(picture.width()), side(picture.height())];
        ForegroundHeader { time, sequence: self.sequence, background: self.n_backgrounds, size_px }
    }

    fn is_background_due(&mut self, seen: &Observation) -> bool {
        let Some(sent) = &mut self.background else { return true };
        let size = |of: &YuvImage| (of.width(), of.height());
        if size(&sent.picture) != size(&seen.background) {
            return true;
        }
        let (at, compared) = &sent.looked;
        let is_early = (0..LOOK_NANOS).contains(&seen.frame.timestamp.nanos_since(*at));
        if is_early || Arc::ptr_eq(compared, &seen.background) {
            return false;
        }
        sent.looked = (seen.frame.timestamp, Arc::clone(&seen.background));
        changed_share(&sent.picture, &seen.background) > CHANGED_SHARE
    }
}

/// How much of a picture's luma differs noticeably from another's of the same size.
fn changed_share(a: &YuvImage, b: &YuvImage) -> f64 {
    let (a, b) = (a.plane(0), b.plane(0));
    let (mut n_changed, mut n) = (0_u32, 0_u32);
    for y in (0..a.height).step_by(STEP) {
        for (a, b) in a.row(y).iter().zip(b.row(y)).step_by(STEP) {
            n_changed += u32::from(a.abs_diff(*b) > CHANGED_CODES);
            n += 1;
        }
    }
    f64::from(n_changed) / f64::from(n.max(1))
}
