//! Section `[archive]`: where cameras' streams are recorded, and how much of them is kept.

use crate::error::Gatherer;
use serde::Deserialize;
use std::path::PathBuf;

/// The recordings.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ArchiveSettings {
    /// The folder beneath which cameras' streams are recorded; made if it is not there. Empty records nothing. Default
    /// empty.
    pub folder: PathBuf,
    /// Seconds after which a file ends at the next key frame and another begins, 5 to 3600. Default 60.
    pub segment_secs: u32,
    /// Most GiB of all files of all cameras together, 0.01 to 1048576; the oldest go first. Default 100.
    pub max_gib: f64,
    /// Days of scene time after which a recording goes, or days after it was written where its time is still to come, 0.001 to 36500.
    /// Default 30.
    pub max_age_days: f64,
    /// MiB of the disk that are left free, 0 to 1073741824: with less, recording pauses. Default 1024.
    pub min_free_mib: u32,
    /// Most GiB of all exported clips together, 0.01 to 1048576. Users share it: each one's own oldest go first. Default 10.
    pub export_gib: f64,
    /// Days after which exported clips go, 0.001 to 36500. Default 7.
    pub export_days: f64,
}

impl Default for ArchiveSettings {
    fn default() -> Self {
        Self {
            folder: PathBuf::new(),
            segment_secs: 60,
            max_gib: 100.0,
            max_age_days: 30.0,
            min_free_mib: 1024,
            export_gib: 10.0,
            export_days: 7.0,
        }
    }
}

impl ArchiveSettings {
    /// Whether anything is recorded at all.
    #[must_use]
    pub fn is_on(&self) -> bool {
        !self.folder.as_os_str().is_empty()
    }
}

/// Checks everything.
pub(super) fn check(archive: &ArchiveSettings, gatherer: &mut Gatherer) {
    if archive.is_on() {
        super::validate::check_path(&archive.folder, "/archive/folder", gatherer);
    }
    let numbers = [
        ("segment_secs", f64::from(archive.segment_secs), 5.0, 3600.0, "seconds"),
        ("max_gib", archive.max_gib, 0.01, 1_048_576.0, "GiB"),
        ("max_age_days", archive.max_age_days, 0.001, 36_500.0, "days"),
        ("min_free_mib", f64::from(archive.min_free_mib), 0.0, 1_073_741_824.0, "MiB"),
        ("export_gib", archive.export_gib, 0.01, 1_048_576.0, "GiB"),
        ("export_days", archive.export_days, 0.001, 36_500.0, "days"),
    ];
    for (key, value, least, most, unit) in numbers {
        super::validate::range(gatherer, &format!("/archive/{key}"), value, least, most, unit);
    }
}
