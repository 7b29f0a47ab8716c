//! When each key of the configuration takes effect once it is changed in the file and the daemon is told to read it again.

use super::Settings;
use std::fmt;

/// When a changed key takes effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// When the file is read again.
    AtOnce,
    /// Then, but for cameras that run: those keep to it until their thread begins anew.
    ForNewCameras,
    /// When the daemon is started again.
    AtRestart,
}

/// A key that was changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChangedKey {
    /// Its dotted path; `credentials`, `camera`, `scene` and `snapshot` for all of these.
    pub key: &'static str,
    /// When it takes effect.
    pub effect: Effect,
}

impl fmt::Display for ChangedKey {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.key)
    }
}

/// Declares every key once: its path, its effect, and how two settings are held against each other.
macro_rules! keys {
    ($($section:ident.$key:ident: $effect:ident,)*) => {
        /// Every key but those of cameras and scenes, which take effect at once, of credentials, which do for new cameras, and of
        /// snapshots' schedules, which do at a restart.
        pub const KEYS: &[(&str, Effect)] =
            &[$((concat!(stringify!($section), ".", stringify!($key)), Effect::$effect),)*];

        /// The keys in which two settings differ.
        #[must_use]
        pub fn changed_keys(before: &Settings, after: &Settings) -> Vec<ChangedKey> {
            let mut changed = Vec::new();
            $(if before.$section.$key != after.$section.$key {
                let key = concat!(stringify!($section), ".", stringify!($key));
                changed.push(ChangedKey { key, effect: Effect::$effect });
            })*
            if before.credentials != after.credentials {
                changed.push(ChangedKey { key: "credentials", effect: Effect::ForNewCameras });
            }
            if before.camera != after.camera {
                changed.push(ChangedKey { key: "camera", effect: Effect::AtOnce });
            }
            if before.scene != after.scene {
                changed.push(ChangedKey { key: "scene", effect: Effect::AtOnce });
            }
            if before.snapshot != after.snapshot {
                changed.push(ChangedKey { key: "snapshot", effect: Effect::AtRestart });
            }
            changed
        }
    };
}

keys! {
    server.listen: AtRestart,
    server.hosts: AtRestart,
    server.trusted_proxies: AtRestart,
    // What the files hold is read again once a minute and on SIGHUP; which files they are is not.
    server.certificate: AtRestart,
    server.private_key: AtRestart,
    storage.database: AtRestart,
    storage.checkpoint_interval_secs: ForNewCameras,
    storage.background_history_interval_mins: ForNewCameras,
    storage.background_history_count: ForNewCameras,
    storage.background_history_mib: ForNewCameras,
    storage.audit_max_age_days: AtOnce,
    storage.audit_key: AtRestart,
    storage.audit_key_before: AtRestart,
    storage.audit_head: AtRestart,
    storage.audit_anchor_url: AtRestart,
    storage.audit_anchor_interval_secs: AtRestart,
    storage.tracks_max_age_days: AtRestart,
    storage.activity_max_age_days: AtRestart,
    storage.background_history_max_age_days: AtRestart,
    storage.snapshot_folder: AtRestart,
    storage.snapshot_max_gib: AtRestart,
    storage.snapshot_max_age_days: AtRestart,
    storage.snapshot_min_free_mib: AtRestart,
    storage.snapshot_lift_by_two: AtRestart,
    storage.snapshot_lift_window_mins: AtRestart,
    archive.folder: AtRestart,
    archive.segment_secs: AtOnce,
    archive.max_gib: AtOnce,
    archive.max_age_days: AtOnce,
    archive.min_free_mib: AtOnce,
    archive.export_gib: AtOnce,
    archive.export_days: AtOnce,
    media.roots: ForNewCameras,
    media.networks: ForNewCameras,
    timeline.mib_per_camera: ForNewCameras,
    timeline.replay_mib: AtRestart,
    entities.rate_hz: AtRestart,
    render.adapter: AtRestart,
    render.samples: AtRestart,
    render.depth_map_side_px: AtRestart,
    render.max_pixels: AtRestart,
    render.queue_length: AtRestart,
    render.timeout_secs: AtRestart,
    render.cache_mib: AtRestart,
    render.warm_up: AtRestart,
    accuracy.measure_at_start: AtRestart,
    log.format: AtRestart,
    telemetry.otlp_endpoint: AtRestart,
    telemetry.service_name: AtRestart,
    telemetry.sampling_ratio: AtRestart,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::parse;
    use std::path::Path;

    /// The keys of the documented example, but for those of cameras and scenes.
    fn documented() -> Vec<String> {
        let (mut section, mut keys) = (String::new(), Vec::new());
        for line in include_str!("../../../config/example.toml").lines() {
            let line = line.strip_prefix('#').filter(|rest| !rest.starts_with(' ')).unwrap_or(line);
            if let Some(name) = line.strip_prefix('[') {
                section = name.trim_matches(['[', ']']).to_owned();
            } else if let Some((key, _)) = line.split_once(" = ")
                && !section.is_empty()
                && !["credentials", "camera", "scene", "snapshot"]
                    .contains(&section.split('.').next().unwrap_or_default())
            {
                keys.push(format!("{section}.{key}"));
            }
        }
        keys
    }

    #[test]
    fn every_documented_key_has_its_effect() {
        let mut documented = documented();
        documented.sort();
        let mut known: Vec<&str> = KEYS.iter().map(|(key, _)| *key).collect();
        known.sort_unstable();
        assert_eq!(known, documented);
    }

    #[test]
    fn what_differs_is_named_with_its_effect() {
        let settings = |text: &str| {
            let config = parse(text, Path::new("/etc/a.toml"), []).unwrap();
            config.settings().clone()
        };
        let check = |text: &str, expected: &[(&'static str, Effect)]| {
            let changed = changed_keys(&settings(""), &settings(text));
            let changed: Vec<_> = changed.iter().map(|of| (of.key, of.effect)).collect();
            assert_eq!(changed, expected, "{text}");
        };
        check("", &[]);
        check("[archive]\nmin_free_mib = 1", &[("archive.min_free_mib", Effect::AtOnce)]);
        check("[render]\nsamples = 1", &[("render.samples", Effect::AtRestart)]);
        check("[[camera]]\nid = \"a\"\nsource.path = \"a\"", &[("camera", Effect::AtOnce)]);
        let login =
            "[[credentials]]\nid = \"a\"\nuser = \"b\"\npassword_env = \"C\"\nnetworks = [\"10.0.0.0/8\"]";
        check(login, &[("credentials", Effect::ForNewCameras)]);
        let both = "[media]\nroots = [\"b\"]\n[[scene]]\nid = \"s\"\nfile = \"s.json\"";
        check(both, &[("media.roots", Effect::ForNewCameras), ("scene", Effect::AtOnce)]);
    }
}
