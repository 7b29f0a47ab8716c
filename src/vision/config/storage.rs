//! Section `[storage]`: the database, what it keeps of the backgrounds, and the folder of snapshots.

use super::telling::collector;
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
    /// The key (Ed25519, PEM, PKCS #8) that signs the audit log, snapshots and exports. Empty (default): nothing is signed.
    pub audit_key: PathBuf,
    /// The key that `audit_key` takes the place of: at the next start it signs that, and is needed no more. Default none.
    pub audit_key_before: PathBuf,
    /// The file that says how far the signed audit log reached. Empty (default): beside the database, with its name and the ending
    /// `.audit-head`.
    pub audit_head: PathBuf,
    /// Place at which the newest entry's number, digest and signature are told (POST, JSON): an http or https URL without user, password,
    /// query and fragment. Empty (default): nowhere but in the log.
    pub audit_anchor_url: String,
    /// Seconds between two entries that are told so, and in the log, 10 to 86400; where nothing is added, nothing is told. Default
    /// 300.
    pub audit_anchor_interval_secs: f64,
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

impl StorageSettings {
    /// Returns whether the audit log is signed.
    #[must_use]
    pub fn signs_audit(&self) -> bool {
        !self.audit_key.as_os_str().is_empty()
    }
}

impl StorageSettings {
    /// Returns where the newest entry of the audit log is told; none where it is nowhere, or the URL is none.
    #[must_use]
    pub fn anchor_url(&self) -> Option<url::Url> {
        collector(&self.audit_anchor_url)
    }
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
            audit_key: PathBuf::new(),
            audit_key_before: PathBuf::new(),
            audit_head: PathBuf::new(),
            audit_anchor_url: String::new(),
            audit_anchor_interval_secs: 300.0,
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
    let paths = [
        ("snapshot_folder", &storage.snapshot_folder),
        ("audit_key", &storage.audit_key),
        ("audit_key_before", &storage.audit_key_before),
        ("audit_head", &storage.audit_head),
    ];
    for (key, path) in paths.iter().filter(|(_, path)| !path.as_os_str().is_empty()) {
        super::validate::check_path(path, &format!("/storage/{key}"), gatherer);
    }
    if !storage.audit_anchor_url.is_empty() && storage.anchor_url().is_none() {
        let message = "expected an http or https URL such as https://anchors.example/videofields, without user, password, query \
                       and fragment";
        gatherer.fault("/storage/audit_anchor_url", message);
    }
    if !storage.audit_key_before.as_os_str().is_empty() && !storage.signs_audit() {
        let message = "a key that another takes the place of needs that one: name `audit_key`";
        gatherer.fault("/storage/audit_key_before", message);
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
        ("audit_anchor_interval_secs", storage.audit_anchor_interval_secs, 10.0, 86_400.0, "seconds"),
        ("snapshot_max_gib", storage.snapshot_max_gib, 0.001, 1_048_576.0, "GiB"),
        ("snapshot_max_age_days", storage.snapshot_max_age_days, 0.001, 36_500.0, "days"),
        ("snapshot_min_free_mib", f64::from(storage.snapshot_min_free_mib), 0.0, 1_073_741_824.0, "MiB"),
        ("snapshot_lift_window_mins", storage.snapshot_lift_window_mins, 1.0, 10_080.0, "minutes"),
    ];
    for (key, value, least, most, unit) in numbers {
        super::validate::range(gatherer, &format!("/storage/{key}"), value, least, most, unit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(storage: &StorageSettings) -> Vec<String> {
        let mut gatherer = Gatherer::default();
        check(storage, &mut gatherer);
        gatherer.into_faults().into_iter().map(|fault| fault.place).collect()
    }

    #[test]
    fn keys_of_the_audit_log_belong_together_and_an_anchor_is_a_plain_url() {
        let storage = StorageSettings::default();
        assert!(faults(&storage).is_empty() && !storage.signs_audit() && storage.anchor_url().is_none());
        let before = StorageSettings { audit_key_before: "old".into(), ..storage.clone() };
        assert_eq!(faults(&before), ["/storage/audit_key_before"]);
        let both = StorageSettings { audit_key: "new".into(), ..before };
        assert!(faults(&both).is_empty() && both.signs_audit());
        for (url, expected) in [
            ("https://anchors.example/a", &[][..]),
            ("https://ann:s3cret@anchors.example/", &["/storage/audit_anchor_url"]),
            ("anchors.example", &["/storage/audit_anchor_url"]),
        ] {
            assert_eq!(
                faults(&StorageSettings { audit_anchor_url: url.to_owned(), ..storage.clone() }),
                expected
            );
        }
        let hasty = StorageSettings { audit_anchor_interval_secs: 1.0, ..storage };
        assert_eq!(faults(&hasty), ["/storage/audit_anchor_interval_secs"]);
    }
}
