//! A camera that people make through the API: its document as it is asked for, kept and shown.
//!
//! Whoever names a source there may not thereby read the machine's files or be sent its passwords: of a camera with a
//! password only the configuration's author may speak.

use super::change::difference;
use super::clock::{self, ClockSettings};
use super::feed::{FeedSettings, check_place, shown_url};
use super::settings::{CameraSettings, SegmentSettings};
use super::source::{self, SourceSettings};
use super::validate::{check_segment, check_text};
use crate::error::{Fault, Gatherer};
use crate::frame::CameraId;
use serde::Deserialize;
use serde_json::{Map, Value, json};

/// Keys of a source that say who logs in at a camera.
const LOGIN: [&str; 3] = ["user", "password_file", "password_env"];

/// A camera's document.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MadeCamera {
    /// Name for people, at most 200 characters. Default: the camera's id.
    #[serde(default)]
    pub name: String,
    /// Whether frames are taken at all. Default true.
    #[serde(default = "default_enabled")]
    pub enabled: bool,
    /// Where they come from; without a login.
    pub source: SourceSettings,
    /// What is wrong with the camera's clock.
    #[serde(default)]
    pub clock: ClockSettings,
    /// How its foreground is found.
    #[serde(default)]
    pub segment: SegmentSettings,
}

const fn default_enabled() -> bool {
    true
}

impl MadeCamera {
    /// Reads a document. A URL that is written as [`Self::shown`] shows that of `before` is that one.
    ///
    /// # Errors
    /// With every fault, each at its JSON pointer.
    pub fn read(mut document: Value, before: Option<&CameraSettings>) -> Result<Self, Vec<Fault>> {
        if !document.is_object() {
            return Err(vec![Fault::new("", "expected an object with `name` and `source`")]);
        }
        let mut gatherer = Gatherer::default();
        for part in ["source", "clock"] {
            // What is null is not there, as in a change of it.
            if let Some(Value::Object(keys)) = document.get_mut(part) {
                keys.retain(|_key, value| !value.is_null());
            }
        }
        if let Some(source) = document.get_mut("source") {
            check_login(source, &mut gatherer);
            source::check_keys(source, "/source", &mut gatherer);
            if let (Some(url), Some(written)) =
                (before.and_then(|before| before.source.url.as_ref()), source.get_mut("url"))
                && written.as_str() == Some(&shown_url(url))
            {
                *written = serde_json::to_value(url).unwrap_or_default();
            } else if source.get("url").and_then(Value::as_str).is_some_and(|url| url.ends_with("/…")) {
                let message = "this is how a URL is shown, without what follows the host: write all of it";
                gatherer.fault("/source/url", message);
            }
        }
        let made = gatherer.read::<Self>(document, "");
        if let Some(made) = &made {
            check_text(&made.name, "/name", &mut gatherer);
            source::check(&made.source, "/source", &mut gatherer);
            check_place(&made.source, &mut gatherer);
            clock::check(&made.clock, &made.source, "/clock", &mut gatherer);
            check_segment(&made.segment, "/segment", &mut gatherer);
        }
        let faults = gatherer.into_faults();
        made.filter(|_| faults.is_empty()).ok_or(faults)
    }

    /// The document that makes such a camera.
    #[must_use]
    pub fn of(camera: &CameraSettings) -> Self {
        Self {
            name: camera.name.clone(),
            enabled: camera.enabled,
            source: camera.source.clone(),
            clock: camera.clock,
            segment: camera.segment.clone(),
        }
    }

    /// The camera that it makes.
    #[must_use]
    pub fn camera(self, id: CameraId) -> CameraSettings {
        let name = if self.name.is_empty() { id.to_string() } else { self.name };
        let Self { enabled, source, clock, segment, .. } = self;
        CameraSettings { name, enabled, clock, segment, ..CameraSettings::new(id, source) }
    }

    /// As it is shown: of a URL nothing behind the host, since cameras want passwords there.
    #[must_use]
    pub fn shown(&self) -> Value {
        self.with_feed(self.feed().shown(), serde_json::to_value(&self.segment).unwrap_or_default())
    }

    /// As it is kept: of how the foreground is found what is not the default.
    #[must_use]
    pub fn kept(&self) -> Value {
        let whole = |of: &SegmentSettings| serde_json::to_value(of).unwrap_or_default();
        let segment = difference(&whole(&SegmentSettings::default()), &whole(&self.segment));
        self.with_feed(self.feed().whole(), segment.unwrap_or_else(|| json!({})))
    }

    fn feed(&self) -> FeedSettings {
        FeedSettings { enabled: self.enabled, source: self.source.clone(), clock: self.clock }
    }

    fn with_feed(&self, feed: Value, segment: Value) -> Value {
        let Value::Object(feed) = feed else { return feed };
        let mut document = Map::from_iter([("name".to_owned(), json!(self.name))]);
        document.extend(feed);
        document.insert("segment".to_owned(), segment);
        Value::Object(document)
    }
}

/// Refuses a login, and takes it away so that nothing else is said of it.
fn check_login(source: &mut Value, gatherer: &mut Gatherer) {
    let Value::Object(keys) = source else { return };
    for key in LOGIN {
        if keys.remove(key).is_some() {
            let message = "a camera's user and password stand in the configuration file alone: have whoever keeps that file \
                           add `credentials` there, and name these";
            gatherer.fault(format!("/source/{key}"), message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(document: Value) -> Vec<String> {
        MadeCamera::read(document, None).unwrap_err().into_iter().map(|fault| fault.place).collect()
    }

    #[test]
    fn a_document_is_read_kept_and_shown() {
        let id = CameraId::new("gate").unwrap();
        let document = json!({"name": "Gate", "source": {"url": "rtsp://10.0.0.7/live?key=s3cret", "user": null},
            "clock": {"offset_secs": 2, "since": null}, "segment": {"delta": 0.25}});
        let made = MadeCamera::read(document, None).unwrap();
        assert_eq!(MadeCamera::read(made.kept(), None).unwrap(), made);
        assert_eq!(made.kept()["segment"], json!({"delta": 0.25}));
        let shown = made.shown();
        assert!(!shown.to_string().contains("s3cret"), "{shown}");
        assert_eq!((&shown["enabled"], &shown["segment"]["max_hole_px"]), (&json!(true), &json!(64)));
        assert!(shown["source"].get("path").is_none() && shown["source"].get("rate_hz").is_none(), "{shown}");
        let camera = made.clone().camera(id.clone());
        assert_eq!(MadeCamera::of(&camera), made);
        assert_eq!(
            MadeCamera::read(shown.clone(), Some(&camera)).unwrap(),
            made,
            "what was shown may be sent back"
        );
        assert_eq!(places(shown), Vec::<String>::from(["/source/url".to_owned()]));
        let nameless = MadeCamera::read(json!({"source": {"path": "/films/a.mp4"}}), None).unwrap();
        let camera = nameless.camera(id);
        assert_eq!((camera.name.as_str(), camera.record, camera.vision), ("gate", true, true));
    }

    #[test]
    fn what_is_wrong_is_told_by_its_pointer() {
        let source = |source: Value| places(json!({"name": "a", "source": source}));
        assert_eq!(places(json!([])), [""]);
        assert_eq!(places(json!({"name": "a"})), [""]);
        assert_eq!(source(json!({})), ["/source"]);
        assert_eq!(source(json!({"path": "/a", "url": "rtsp://10.0.0.7/"})), ["/source"]);
        assert_eq!(source(json!({"path": "films/a.mp4"})), ["/source/path"]);
        assert_eq!(source(json!({"url": "ftp://10.0.0.7/"})), ["/source/url"]);
        assert_eq!(source(json!({"url": "rtsp://u:p@10.0.0.7/"})), ["/source/url"]);
        assert_eq!(source(json!({"path": "/a", "transport": "tcp"})), ["/source/transport"]);
        let url = "rtsp://10.0.0.7/";
        assert_eq!(
            source(json!({"url": url, "user": "u", "password_file": "/etc/shadow"})),
            ["/source/user", "/source/password_file"]
        );
        assert_eq!(source(json!({"url": url, "password_env": "HOME"})), ["/source/password_env"]);
        let of = |key: &str, value: Value| {
            let mut document = json!({"source": {"path": "/a"}});
            document[key] = value;
            places(document)
        };
        assert_eq!(of("name", json!("a\nb")), ["/name"]);
        assert_eq!(of("clock", json!({"offset_secs": 1e10})), ["/clock/offset_secs"]);
        assert_eq!(of("segment", json!({"delta": 7})), ["/segment/delta"]);
        assert_eq!(of("record", json!(false)), ["/record"]);
    }
}
