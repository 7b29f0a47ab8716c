//! What was changed of a camera, as it is kept: what differs from the configuration, and nothing else of it.

use super::feed::FeedSettings;
use super::settings::{CameraSettings, SegmentSettings};
use crate::error::Fault;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// What was changed of a camera; each part as RFC 7396 merges it into what the configuration says.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraChange {
    /// The camera itself, where it was made through the API: [`super::MadeCamera::kept`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub made: Option<Value>,
    /// Of how its foreground is found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segment: Option<Value>,
    /// Of what feeds it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feed: Option<Value>,
}

/// A part of a change that does not go with the configuration any more, and what is wrong with it.
pub type Unfit = (&'static str, Vec<Fault>);

impl CameraChange {
    /// Whether nothing is changed of a camera.
    #[must_use]
    pub const fn is_nothing(&self) -> bool {
        self.segment.is_none() && self.feed.is_none()
    }

    /// The same with other settings of how the foreground is found.
    #[must_use]
    pub fn with_segment(self, configured: &CameraSettings, now: &SegmentSettings) -> Self {
        let whole = |of: &SegmentSettings| serde_json::to_value(of).unwrap_or_default();
        Self { segment: difference(&whole(&configured.segment), &whole(now)), ..self }
    }

    /// The same with another feed.
    #[must_use]
    pub fn with_feed(self, configured: &CameraSettings, now: &FeedSettings) -> Self {
        Self { feed: difference(&FeedSettings::of(configured).whole(), &now.whole()), ..self }
    }

    /// The camera with the change; parts that do not fit are left out and told.
    #[must_use]
    pub fn over(&self, configured: &CameraSettings) -> (CameraSettings, Vec<Unfit>) {
        let (mut camera, mut unfit) = (configured.clone(), Vec::new());
        if let Some(segment) = &self.segment {
            match super::changed_segment(&configured.segment, segment.clone()) {
                Ok(segment) => camera.segment = segment,
                Err(faults) => unfit.push(("segment", faults)),
            }
        }
        if let Some(feed) = &self.feed {
            match FeedSettings::of(configured).changed(feed) {
                Ok(feed) => {
                    (camera.enabled, camera.source, camera.clock) = (feed.enabled, feed.source, feed.clock);
                }
                Err(faults) => unfit.push(("source", faults)),
            }
        }
        (camera, unfit)
    }
}

/// What RFC 7396 merges into `before` to make it `after`; none where they are the same.
pub(super) fn difference(before: &Value, after: &Value) -> Option<Value> {
    let (Value::Object(old), Value::Object(new)) = (before, after) else {
        return (before != after).then(|| after.clone());
    };
    let mut changed = Map::new();
    for (key, value) in new {
        match old.get(key) {
            Some(was) => changed.extend(difference(was, value).map(|value| (key.clone(), value))),
            None => drop(changed.insert(key.clone(), value.clone())),
        }
    }
    let gone = old.keys().filter(|key| !new.contains_key(*key));
    changed.extend(gone.map(|key| (key.clone(), Value::Null)));
    (!changed.is_empty()).then_some(Value::Object(changed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{CameraUrl, Resolution, SourceSettings};
    use serde_json::json;

    fn camera(source: SourceSettings) -> CameraSettings {
        CameraSettings::new(crate::frame::CameraId::new("north").unwrap(), source)
    }

    #[test]
    fn what_differs_is_kept_and_merged_again() {
        let file = camera(SourceSettings::of_path("/films/a.mp4"));
        let segment = SegmentSettings { delta: Some(0.25), blur_sigma_px: Some(2.0), ..file.segment.clone() };
        let feed = json!({"enabled": false, "source": {"path": null, "url": "rtsp://10.0.0.7/live", "timing": null,
            "rate_hz": null, "end": null, "start": null, "from_secs": null, "until_secs": null},
            "clock": {"offset_secs": 2}});
        let feed = FeedSettings::of(&file).changed(&feed).unwrap();
        let change = CameraChange::default().with_segment(&file, &segment).with_feed(&file, &feed);
        assert_eq!(change.segment, Some(json!({"delta": 0.25, "blur_sigma_px": 2.0})));
        let read: CameraChange = serde_json::from_str(&serde_json::to_string(&change).unwrap()).unwrap();
        let (changed, unfit) = read.over(&file);
        assert!(unfit.is_empty(), "{unfit:?}");
        assert_eq!((&changed.segment, FeedSettings::of(&changed)), (&segment, feed));
        // What was not changed follows the configuration.
        let other = CameraSettings {
            segment: SegmentSettings { delta: Some(0.1), max_hole_px: 7, ..file.segment.clone() },
            ..file.clone()
        };
        let (changed, _) = read.over(&other);
        assert_eq!((changed.segment.delta, changed.segment.max_hole_px), (Some(0.25), 7));
        let back = read.with_segment(&file, &file.segment).with_feed(&file, &FeedSettings::of(&file));
        assert!(back.is_nothing(), "{back:?}");
    }

    #[test]
    fn what_does_not_fit_any_more_is_left_out_and_told() {
        let url = |host: &str, password: Option<&str>| SourceSettings {
            url: Some(CameraUrl::new(format!("rtsp://{host}/live"))),
            password_file: password.map(Into::into),
            user: password.map(|_| "wall".to_owned()),
            ..SourceSettings::default()
        };
        let bare = camera(url("10.0.0.7", None));
        let feed =
            FeedSettings::of(&bare).changed(&json!({"source": {"url": "rtsp://10.0.0.9/live"}})).unwrap();
        let mut change = CameraChange::default().with_feed(&bare, &feed);
        change.segment = Some(json!({"dleta": 3}));
        // Since then a password was configured: it goes to no other host.
        let secret = camera(url("10.0.0.7", Some("/etc/secret")));
        let (changed, unfit) = change.over(&secret);
        assert_eq!((&changed.source, &changed.segment), (&secret.source, &secret.segment));
        assert_eq!(unfit.iter().map(|(part, _)| *part).collect::<Vec<_>>(), ["segment", "source"]);
        assert!(changed.segment.resolution == Resolution::Auto);
    }
}
