//! Clips of what was recorded, for people to keep: remuxed, with a manifest that says what they are; encoded anew only where
//! nobody may see them as they were recorded (`redraw`).
//!
//! In: which cameras, from when to when. Out: a folder with files that any player plays and `manifest.json`, which holds
//! their hashes, times, gaps and calibrations. One thread makes one export after the other; a folder without a manifest is
//! unfinished and goes at the next start.

mod board;
mod clips;
mod folder;
mod make;
mod manifest;
mod redraw;
mod verify;

#[cfg(test)]
mod tests;

pub use board::{ExportFile, ExportState, ExportStatus, Exports};
pub use manifest::{Clip, ExportedCamera, Manifest, Unreadable};
pub use redraw::{Redraw, Redrawing};
pub use verify::{VerifiedExport, verify_export};

pub(super) use make::run;

use super::ArchiveError;
use crate::media;
use crate::share::Bound;
use serde_json::Value;
use std::collections::BTreeMap;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// What is to be exported.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportRequest {
    /// Of which cameras, each once.
    pub cameras: Vec<ExportCamera>,
    /// Scene time from which it is asked for.
    pub from: Timestamp,
    /// Scene time until which it is asked for; frames of that time and later are left out.
    pub to: Timestamp,
    /// What its maker wants to be known of it.
    pub note: String,
    /// Which user asks for it; none where there are no users.
    pub asked_by: Option<String>,
    /// Part of what all exports may take that this user's exports may take.
    pub bound: Bound,
}

/// A camera, and what is put down of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportCamera {
    /// Which one.
    pub id: CameraId,
    /// Its name for people.
    pub name: String,
    /// How its clock was corrected.
    pub clock: Value,
    /// Its calibration in each scene that holds it, by the scene's id.
    pub calibrations: BTreeMap<String, Value>,
    /// Who draws its pictures anew, where they may not be given out as they were recorded.
    pub redrawing: Option<Redrawing>,
}

/// Why an export, or a part of it, came to nothing.
#[derive(Debug, thiserror::Error)]
pub(super) enum ExportError {
    /// It was taken back, or the daemon stops.
    #[error("it was broken off")]
    Cancelled,
    /// Nothing of it was recorded.
    #[error("nothing of it is recorded")]
    Nothing,
    /// More than all exports may take.
    #[error("archive.export_gib is less than what is to be written: {0} bytes")]
    TooLarge(u64),
    /// The user's exports have no room left, and those of others stay.
    #[error(
        "your exports have no room left for {0} bytes, and others' stay: remove some of your own, or ask an admin to remove \
         some or to raise archive.export_gib"
    )]
    NoRoom(u64),
    /// The disk has less room than exports leave to recording.
    #[error("the disk has {free_mib} MiB left, and exports leave {least_mib}: twice archive.min_free_mib")]
    NearlyFull {
        /// What it has.
        free_mib: u64,
        /// What is to be left.
        least_mib: u64,
    },
    /// A recorded file cannot be read; others may.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The file, from the archive's folder on.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Pictures that may not be given out as they were recorded cannot be drawn anew.
    #[error("its pictures cannot be drawn anew: {0}")]
    NotRedrawn(String),
    /// A clip cannot be written.
    #[error("{0}")]
    Unwritable(media::Fault),
    /// The manifest cannot be put down.
    #[error("cannot write the manifest: {0}")]
    Manifest(#[from] serde_json::Error),
    /// The archive does not answer.
    #[error("{}", .0.without_places())]
    Archive(#[from] ArchiveError),
}
