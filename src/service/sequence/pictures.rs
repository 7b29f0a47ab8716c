//! What a camera showed at a frame: a picture's file, or the picture of a video.

use super::frames::Frame;
use super::manifest::{Files, PicturesOf};
use super::video::Video;
use std::path::PathBuf;
use videofields_recording::ingest::{IngestError, MediaRoots, read_picture};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{Mask, RgbImage};

/// Where a camera's pictures come from.
#[derive(Debug)]
pub(super) enum Pictures {
    Files(Files, i64),
    Video { video: Box<Video>, offset_nanos: i64 },
}

impl Pictures {
    pub(super) fn new(of: &PicturesOf, roots: &MediaRoots) -> Self {
        match of {
            PicturesOf::Files(files, number_offset) => Self::Files(files.clone(), *number_offset),
            PicturesOf::Video { path, offset_secs, rate_hz } => Self::Video {
                video: Box::new(Video::new(path, roots, *rate_hz)),
                offset_nanos: (offset_secs * 1e9).round() as i64,
            },
        }
    }

    /// The file of a frame's picture, or the video; none where a list has none.
    pub(super) fn file(&self, frame: &Frame) -> Option<PathBuf> {
        match self {
            Self::Files(Files::Pattern(_, pattern), number_offset) => {
                Some(pattern.path(frame.number.checked_add_signed(*number_offset)?))
            }
            Self::Files(Files::List(list), _) => list.get(frame.place)?.clone(),
            Self::Video { video, .. } => Some(video.path().to_path_buf()),
        }
    }

    /// The picture of a frame; none where there is none: no file, null in a list, beyond a video's ends.
    pub(super) fn picture(
        &mut self,
        frame: &Frame,
        start: Timestamp,
        roots: &MediaRoots,
    ) -> Result<Option<RgbImage>, IngestError> {
        if let Self::Video { video, offset_nanos } = self {
            return video.at(frame.at.nanos_since(start).saturating_sub(*offset_nanos));
        }
        let Some(file) = self.file(frame) else { return Ok(None) };
        match read_picture(&file, roots) {
            Ok(picture) => Ok(Some(picture)),
            Err(IngestError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// A picture as a mask: 0 where it is black.
pub(super) fn mask_of(picture: &RgbImage) -> Mask {
    let is_of = |pixel: &[u8; 3]| u8::from(pixel.iter().any(|channel| *channel >= HALF)) * u8::MAX;
    Mask {
        width: picture.width,
        height: picture.height,
        data: picture.data.as_chunks().0.iter().map(is_of).collect::<Vec<u8>>().into(),
    }
}

/// What is darker counts as black: masks may be JPEG files or videos, whose black is not quite.
const HALF: u8 = 128;
