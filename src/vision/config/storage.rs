//! Section `[storage]`: the database, what it keeps of the backgrounds, and the folder of snapshots.

use crate::error::Gatherer;
use serde::Deserialize;
use std::path::PathBuf;

/// The database.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StorageSettings {
    /// The SQLite file; made with its folder if it is not there. Default `videofields.sqlite`.
    pub database: PathBuf,
    /// Seconds between checkpoints of the backgrounds, 1 to 86400. Default 60.
    pub checkpoint_interval_secs: f64,
    /// Minutes of scene time between a camera's backgrounds that are kept for looking back, 0 to 10080; each is a
    /// checkpoint that is kept, so there is at most one a checkpoint. 0 adds none; those there are stay. Default 60.
    pub background_history_interval_mins: f64,
    /// Most backgrounds that are kept of one camera for looking back, 1 to 10000; the oldest go first. Default 48.
    pub background_history_count: u32,
    /// Most MiB of the backgrounds that are kept of all cameras for looking back, 1 to 1048576; the oldest go first,
    /// but never a camera's newest. Default 512.
    pub background_history_mib: u32,
    /// Days after which entries of the audit log are removed, the oldest first, 0 (never) to 36500. Default 0.
    pub audit_max_age_days: f64,
    /// The folder that snapshots lie in; made if it is not there. Empty (default): beside the database, with its name and
    /// the ending `.snapshots`.
    pub snapshot_folder: PathBuf,
    /// Most GiB of all snapshots together, 0.001 to 1048576. Users share it: each one's own oldest that are not held go first.
    /// Default 10.
    pub snapshot_max_gib: f64,
    /// Days after which snapshots that are not held go, 0.001 to 36500. Default 365.
    pub snapshot_max_age_days: f64,
    /// MiB of the disk that are left free, 0 to 1073741824: with less, no snapshot is made. Default 1024.
    pub snapshot_min_free_mib: u32,
    /// Requires two admins to lift the hold of a snapshot: one asks, another confirms. Default false.
    pub snapshot_lift_by_two: bool,
    /// Minutes within which the second confirms, 1 to 10080; then the request ends. Default 60.
    pub snapshot_lift_window_mins: f64,
    /// Days after which those backgrounds go, and the last ones of cameras that are not configured any more, 0.01 to 36500.
    /// Default 400.
    pub background_history_max_age_days: f64,
    /// Days after which tracks go, 0.01 to 400. Default 400.
    pub tracks_max_age_days: f64,
    /// Days after which it goes how much moved, 0.01 to 400. Default 400.
    pub activity_max_age_days: f64,
}

impl Default for StorageSettings {
    fn default() -> Self {
        Self {
            database: PathBuf::from("videofields.sqlite"),
            checkpoint_interval_secs: 60.0,
            background_history_interval_mins: 60.0,
            background_history_count: 48,
            background_history_mib: 512,
            audit_max_age_days: 0.0,
            snapshot_folder: PathBuf::new(),
            snapshot_max_gib: 10.0,
            snapshot_max_age_days: 365.0,
            snapshot_min_free_mib: 1024,
            snapshot_lift_by_two: false,
            snapshot_lift_window_mins: 60.0,
            background_history_max_age_days: 400.0,
            tracks_max_age_days: 400.0,
            activity_max_age_days: 400.0,
        }
    }
}

/// Checks everything but the database's path.
pub(super) fn check(storage: &StorageSettings, gatherer: &mut Gatherer) {
    if !storage.snapshot_folder.as_os_str().is_empty() {
        super::validate::check_path(&storage.snapshot_folder, "/storage/snapshot_folder", gatherer);
    }
    let count = f64::from(storage.background_history_count);
    let numbers = [
        ("checkpoint_interval_secs", storage.checkpoint_interval_secs, 1.0, 86_400.0, "seconds"),
        (
            "background_history_interval_mins",
            storage.background_history_interval_mins,
            0.0,
            10_080.0,
            "minutes",
        ),
        ("background_history_count", count, 1.0, 10_000.0, "backgrounds"),
        ("background_history_max_age_days", storage.background_history_max_age_days, 0.01, 36_500.0, "days"),
        ("tracks_max_age_days", storage.tracks_max_age_days, 0.01, 400.0, "days"),
        ("activity_max_age_days", storage.activity_max_age_days, 0.01, 400.0, "days"),
        ("background_history_mib", f64::from(storage.background_history_mib), 1.0, 1_048_576.0, "MiB"),
        ("audit_max_age_days", storage.audit_max_age_days, 0.0, 36_500.0, "days"),
        ("snapshot_max_gib", storage.snapshot_max_gib, 0.001, 1_048_576.0, "GiB"),
        ("snapshot_max_age_days", storage.snapshot_max_age_days, 0.001, 36_500.0, "days"),
        ("snapshot_min_free_mib", f64::from(storage.snapshot_min_free_mib), 0.0, 1_073_741_824.0, "MiB"),
        ("snapshot_lift_window_mins", storage.snapshot_lift_window_mins, 1.0, 10_080.0, "minutes"),
    ];
    for (key, value, least, most, unit) in numbers {
        super::validate::range(gatherer, &format!("/storage/{key}"), value, least, most, unit);
    }
}
