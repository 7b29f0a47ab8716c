//! What of a camera's feed can be changed while it runs: whether it is fed at all, from where, and its clock.

use super::clock::{self, ClockSettings};
use super::settings::CameraSettings;
use super::source::{self, Place, SourceSettings};
use super::url::CameraUrl;
use crate::error::{Fault, Gatherer};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What feeds a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeedSettings {
    /// Whether frames are taken at all.
    pub enabled: bool,
    /// Where they come from.
    pub source: SourceSettings,
    /// What is wrong with the camera's clock.
    pub clock: ClockSettings,
}

impl FeedSettings {
    /// What feeds a camera by its settings.
    #[must_use]
    pub fn of(camera: &CameraSettings) -> Self {
        Self { enabled: camera.enabled, source: camera.source.clone(), clock: camera.clock }
    }

    /// As it is shown: of the source those keys that belong to its kind and say something, without the user, and of a URL
    /// nothing behind the host, since cameras want passwords there.
    #[must_use]
    pub fn shown(&self) -> Value {
        let mut shown = self.whole();
        if let Some(Value::Object(keys)) = shown.get_mut("source") {
            keys.remove("user");
            if let Some(url) = &self.source.url {
                keys.insert("url".to_owned(), Value::String(shown_url(url)));
            }
        }
        shown
    }

    /// As it is written, with everything that it says.
    pub(super) fn whole(&self) -> Value {
        let mut shown = serde_json::to_value(self).unwrap_or_default();
        if let Some(Value::Object(keys)) = shown.get_mut("source") {
            keys.retain(|key, value| !value.is_null() && source::is_of_kind(key, &self.source));
        }
        if let Some(Value::Object(keys)) = shown.get_mut("clock") {
            keys.retain(|_key, value| !value.is_null());
        }
        shown
    }

    /// The same with the members of the JSON object `change` merged into it (RFC 7396: `null` takes a member away).
    ///
    /// A caller who may name a source may not thereby read the machine's files or be sent its passwords: `password_file`
    /// and `password_env` stay as they are configured, and go nowhere but to the host that they were configured for.
    ///
    /// # Errors
    /// With every fault of the change, each at the JSON pointer of its member.
    pub fn changed(&self, change: &Value) -> Result<Self, Vec<Fault>> {
        if !change.is_object() {
            return Err(vec![Fault::new("", "expected an object with `enabled`, `source` or `clock`")]);
        }
        let mut gatherer = Gatherer::default();
        let mut whole = self.whole();
        merge(&mut whole, change);
        // Who sends back what was shown changes nothing by it.
        if let (Some(url), Some(written)) = (&self.source.url, whole.pointer_mut("/source/url"))
            && written.as_str() == Some(&shown_url(url))
        {
            *written = serde_json::to_value(url).unwrap_or_default();
        }
        if let Some(source) = whole.get("source") {
            source::check_keys(source, "/source", &mut gatherer);
        }
        let changed = gatherer.read::<Self>(whole, "");
        if let Some(changed) = &changed {
            source::check(&changed.source, "/source", &mut gatherer);
            clock::check(&changed.clock, &changed.source, "/clock", &mut gatherer);
            self.check_trust(&changed.source, &mut gatherer);
        }
        let faults = gatherer.into_faults();
        changed.filter(|_| faults.is_empty()).ok_or(faults)
    }

    /// Refuses what only the configuration's author may say.
    fn check_trust(&self, changed: &SourceSettings, gatherer: &mut Gatherer) {
        let before = &self.source;
        let secrets = [
            ("password_file", changed.password_file.is_some(), changed.password_file != before.password_file),
            ("password_env", changed.password_env.is_some(), changed.password_env != before.password_env),
        ];
        for (key, is_named, is_new) in secrets {
            if is_named && is_new {
                let message = "a password is named in the configuration file alone";
                gatherer.fault(format!("/source/{key}"), message);
            }
        }
        let has_password = changed.password_file.is_some() || changed.password_env.is_some();
        if has_password && changed.url != before.url {
            let host = |source: &SourceSettings| {
                let parts = source.url.as_ref()?.parse().ok()?;
                Some((parts.scheme.is_encrypted(), parts.host, parts.port))
            };
            if host(changed) != host(before) {
                let message = "the password was configured for another host: take `user`, `password_file` and \
                               `password_env` away (null), or change the configuration file";
                gatherer.fault("/source/url", message);
            }
        }
        check_place(changed, gatherer);
    }
}

/// Refuses a path that would begin at a folder of which only the configuration's author can know.
pub(super) fn check_place(source: &SourceSettings, gatherer: &mut Gatherer) {
    if let Some(Place::Path(path)) = source.place()
        && !path.is_absolute()
    {
        gatherer.fault("/source/path", "expected an absolute path");
    }
}

/// A URL as far as it holds no secret.
pub(super) fn shown_url(url: &CameraUrl) -> String {
    url.parse().map_or_else(
        |_not_a_url| "…".to_owned(),
        |parts| format!("{}://{}:{}/…", parts.scheme.as_str(), parts.host, parts.port),
    )
}

/// Merges `change` into `target` as RFC 7396 has it.
fn merge(target: &mut Value, change: &Value) {
    let Value::Object(members) = change else {
        change.clone_into(target);
        return;
    };
    if !target.is_object() {
        *target = Value::Object(serde_json::Map::new());
    }
    let Value::Object(into) = target else { return };
    for (key, value) in members {
        if value.is_null() {
            into.remove(key);
        } else {
            merge(into.entry(key).or_insert(Value::Null), value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::change::CameraChange;
    use super::super::source::Pace;
    use super::*;
    use crate::frame::CameraId;
    use serde_json::json;

    fn feed(source: SourceSettings) -> FeedSettings {
        FeedSettings { enabled: true, source, clock: ClockSettings::default() }
    }

    fn places(feed: &FeedSettings, change: &Value) -> Vec<String> {
        feed.changed(change).unwrap_err().into_iter().map(|fault| fault.place).collect()
    }

    #[test]
    fn members_are_changed_taken_away_and_shown() {
        let file = feed(SourceSettings::of_path("/films/a.mp4"));
        let shown = file.shown();
        assert_eq!(shown["source"]["path"], "/films/a.mp4");
        assert!(shown["source"].get("transport").is_none() && shown["source"].get("start").is_none());
        assert_eq!(file.changed(&json!({})).unwrap(), file);
        assert_eq!(file.changed(&shown).unwrap(), file);
        let cut = json!({"source": {"from_secs": 3.5}, "clock": {"offset_secs": -2}, "enabled": false});
        let changed = file.changed(&cut).unwrap();
        assert_eq!(
            (changed.enabled, changed.source.from_secs, changed.clock.offset_secs),
            (false, 3.5, -2.0)
        );
        let back = changed.changed(&json!({"source": {"from_secs": null}})).unwrap();
        assert_eq!(back.source.from_secs, 0.0);
        let away = json!({"source": {"path": null, "url": "rtsp://10.0.0.7/live", "timing": null,
            "rate_hz": null, "end": null, "start": null, "from_secs": null, "until_secs": null}});
        let camera = changed.changed(&away).unwrap();
        assert_eq!(camera.source.url, Some(CameraUrl::new("rtsp://10.0.0.7/live")));
        assert!(camera.shown()["source"].get("rate_hz").is_none());
    }

    #[test]
    fn the_pace_of_a_file_is_shown_where_it_is_not_the_usual_one() {
        let file = feed(SourceSettings::of_path("/films/a.mp4"));
        assert!(file.shown()["source"].get("pace").is_none());
        let whole = file.changed(&json!({"source": {"pace": "all"}})).unwrap();
        assert_eq!((whole.source.pace, &whole.shown()["source"]["pace"]), (Pace::All, &json!("all")));
        for usual in [json!(null), json!("real_time")] {
            assert_eq!(whole.changed(&json!({"source": {"pace": usual}})).unwrap(), file);
        }
        assert_eq!(places(&whole, &json!({"source": {"end": "loop"}})), ["/source/pace"]);
        // It is kept over a configuration that says otherwise.
        let camera = CameraSettings::new(CameraId::new("north").unwrap(), whole.source.clone());
        let change = CameraChange::default().with_feed(&camera, &file);
        assert_eq!(FeedSettings::of(&change.over(&camera).0), file);
    }

    #[test]
    fn what_is_wrong_is_told_by_its_pointer() {
        let file = feed(SourceSettings::of_path("/films/a.mp4"));
        assert_eq!(places(&file, &json!([])), [""]);
        assert_eq!(places(&file, &json!({"sauce": 1})), ["/sauce"]);
        assert_eq!(places(&file, &json!({"source": {"path": "a.mp4"}})), ["/source/path"]);
        assert_eq!(
            places(&file, &json!({"source": {"from_secs": 5, "until_secs": 5}})),
            ["/source/until_secs"]
        );
        assert_eq!(places(&file, &json!({"source": {"url": "rtsp://10.0.0.7/"}})), ["/source"]);
        assert_eq!(places(&file, &json!({"clock": {"offset_secs": 1e10}})), ["/clock/offset_secs"]);
        assert_eq!(places(&file, &json!({"source": null})), [""], "a camera has a source");
    }

    #[test]
    fn passwords_stay_where_they_were_configured() {
        let source = SourceSettings {
            url: Some(CameraUrl::new("rtsp://10.0.0.7/live")),
            user: Some("wall".to_owned()),
            password_file: Some("/etc/secret".into()),
            ..SourceSettings::default()
        };
        let camera = feed(source);
        let shown = camera.shown();
        assert_eq!(shown["source"]["url"], "rtsp://10.0.0.7:554/…", "what follows the host may be a secret");
        assert!(shown["source"].get("user").is_none(), "{shown}");
        assert_eq!(camera.changed(&shown).unwrap(), camera, "what was shown may be sent back");
        let url = |url: &str| json!({"source": {"url": url}});
        assert!(camera.changed(&url("rtsp://10.0.0.7/other")).is_ok());
        for elsewhere in ["rtsp://10.0.0.8/live", "rtsp://10.0.0.7:555/live", "rtsps://10.0.0.7:554/live"] {
            assert_eq!(places(&camera, &url(elsewhere)), ["/source/url"], "{elsewhere}");
        }
        let file = json!({"source": {"password_file": "/etc/shadow"}});
        assert_eq!(places(&camera, &file), ["/source/password_file"]);
        let bare = json!({"source": {"url": "rtsp://10.0.0.8/live", "user": null, "password_file": null}});
        let bare = camera.changed(&bare).unwrap();
        let again = json!({"source": {"user": "wall", "password_file": "/etc/secret"}});
        assert_eq!(places(&bare, &again), ["/source/password_file"]);
    }
}
