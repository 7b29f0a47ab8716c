//! Section `[camera.source]`: where a camera's frames come from, and which keys belong to which kind of source.

use super::url::CameraUrl;
use super::validate::{check_path, range};
use crate::clock::Timestamp;
use crate::error::Gatherer;
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::path::{Path, PathBuf};

/// Most characters of a user's name.
const MAX_USER_CHARS: usize = 200;

/// Where frames come from: a file or numbered pictures, a camera's URL, or a device. Exactly one of `path`, `url` and
/// `device` is named; the default names none, and is refused.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SourceSettings {
    /// A video file in any container and codec that GStreamer knows, or a pattern of numbered pictures with one
    /// printf-like number, such as `in%06d.jpg`.
    pub path: Option<PathBuf>,
    /// A camera: rtsp, rtsps, http or https (motion JPEG), without user and password.
    pub url: Option<CameraUrl>,
    /// A V4L2 device, such as `/dev/video0`.
    pub device: Option<PathBuf>,
    /// Where frame times of files come from. Default: `pts` for files, `index` for numbered pictures.
    pub timing: Option<Timing>,
    /// Frames a second, 0.01 to 1000: of a file, for `timing = "index"`; of a device, the nearest that it has. Default
    /// 25.
    pub rate_hz: f64,
    /// What follows a file's last frame. Default `stop`.
    pub end: End,
    /// Pace at which a file is played. Default `real_time`; `all` does not go with `end = "loop"`.
    #[serde(skip_serializing_if = "Pace::is_real_time")]
    pub pace: Pace,
    /// Scene time of a file's first frame, RFC 3339 or nanoseconds. Default: when the files that begin with it began.
    #[serde(deserialize_with = "timestamp", serialize_with = "as_text")]
    pub start: Option<Timestamp>,
    /// Where the part of a file begins that is played, seconds after its first frame, 0 to 1e7. Frames keep their times
    /// where `start` is named; else the part's beginning counts as the file's. Default 0.
    pub from_secs: f64,
    /// Where that part ends. Default: with the file.
    pub until_secs: Option<f64>,
    /// How an RTSP camera's frames travel. Default `tcp`.
    pub transport: Transport,
    /// The user for the URL, at most 200 characters. Default: nobody logs in.
    pub user: Option<String>,
    /// A file whose first line is the user's password, read at each connecting.
    pub password_file: Option<PathBuf>,
    /// The environment variable that holds the user's password.
    pub password_env: Option<String>,
    /// The id of credentials, in place of a user and a password.
    pub credentials: Option<String>,
    /// Seconds without a frame after which a camera is stalled, 0.5 to 60; five seconds later it is connected anew.
    /// Default 5.
    pub stall_secs: f64,
    /// Columns that a device is asked for, 16 to 8192. Default: the most it has up to 1920.
    pub width_px: Option<u32>,
    /// Rows that a device is asked for, 16 to 8192. Default: the most it has up to 1080.
    pub height_px: Option<u32>,
    /// In which form a device gives its pictures. Default `auto`.
    pub format: DeviceFormat,
}

impl Default for SourceSettings {
    fn default() -> Self {
        Self {
            path: None,
            url: None,
            device: None,
            timing: None,
            rate_hz: 25.0,
            end: End::Stop,
            pace: Pace::RealTime,
            start: None,
            from_secs: 0.0,
            until_secs: None,
            transport: Transport::Tcp,
            user: None,
            password_file: None,
            password_env: None,
            credentials: None,
            stall_secs: 5.0,
            width_px: None,
            height_px: None,
            format: DeviceFormat::Auto,
        }
    }
}

/// What a source is read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place<'a> {
    /// A file, or a pattern of numbered pictures.
    Path(&'a Path),
    /// A camera in the network.
    Url(&'a CameraUrl),
    /// A camera at this machine.
    Device(&'a Path),
}

impl SourceSettings {
    /// The file, or the pattern of numbered pictures, `path`; all else as by default.
    #[must_use]
    pub fn of_path(path: impl Into<PathBuf>) -> Self {
        Self { path: Some(path.into()), ..Self::default() }
    }

    /// Returns true where `other` shows the same at the same times: all but how it is transported, in which size and form a device
    /// gives it, how long it may stall, and what follows a file's last frame.
    #[must_use]
    pub fn shows_as(&self, other: &Self) -> bool {
        let alike = Self {
            end: self.end,
            transport: self.transport,
            stall_secs: self.stall_secs,
            width_px: self.width_px,
            height_px: self.height_px,
            format: self.format,
            ..other.clone()
        };
        alike == *self
    }

    /// The one place that is named; `None` where there are none or several, which validation refuses.
    #[must_use]
    pub fn place(&self) -> Option<Place<'_>> {
        match (&self.path, &self.url, &self.device) {
            (Some(path), None, None) => Some(Place::Path(path)),
            (None, Some(url), None) => Some(Place::Url(url)),
            (None, None, Some(device)) => Some(Place::Device(device)),
            _ => None,
        }
    }
}

/// An instant in RFC 3339.
pub(super) fn as_text<S: Serializer>(instant: &Option<Timestamp>, serializer: S) -> Result<S::Ok, S::Error> {
    match instant {
        Some(instant) => serializer.collect_str(instant),
        None => serializer.serialize_none(),
    }
}

/// An instant as text, or as a whole number of nanoseconds.
pub(super) fn timestamp<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Timestamp>, D::Error> {
    struct InstantVisitor;

    impl Visitor<'_> for InstantVisitor {
        type Value = Timestamp;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            formatter.write_str("an RFC 3339 instant or nanoseconds since 1970-01-01 (UTC)")
        }

        fn visit_i64<E: de::Error>(self, nanos: i64) -> Result<Timestamp, E> {
            Ok(Timestamp::from_nanos(nanos))
        }

        fn visit_u64<E: de::Error>(self, nanos: u64) -> Result<Timestamp, E> {
            i64::try_from(nanos).map(Timestamp::from_nanos).map_err(E::custom)
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<Timestamp, E> {
            text.parse().map_err(E::custom)
        }
    }

    deserializer.deserialize_any(InstantVisitor).map(Some)
}

/// Where frame times come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Timing {
    /// The file's own timestamps.
    Pts,
    /// The frame's number divided by `rate_hz`, for files whose timestamps are broken.
    Index,
}

/// What follows a file's last frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum End {
    /// Nothing: the camera keeps its last picture.
    #[default]
    Stop,
    /// The first frame again, one frame interval later: time runs on unbroken.
    Loop,
}

/// Pace of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Pace {
    /// The pace at which it was taken: frames that come too late are left out and counted.
    #[default]
    RealTime,
    /// The pace at which its frames are processed: none is left out.
    All,
}

impl Pace {
    /// Tells whether files are played as fast as they were taken.
    #[must_use]
    pub const fn is_real_time(&self) -> bool {
        matches!(self, Self::RealTime)
    }
}

/// How an RTSP camera's frames travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Transport {
    /// Within the RTSP connection: nothing is lost, and firewalls let it through.
    #[default]
    Tcp,
    /// In packets of their own: less delay on a bad network, and what is lost stays lost.
    Udp,
}

/// In which form a device gives its pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceFormat {
    /// What gives the asked-for size and rate: of several raw, then JPEG, then H.264.
    #[default]
    Auto,
    /// JPEG pictures.
    Mjpeg,
    /// Uncompressed pictures.
    Raw,
    /// H.264.
    H264,
}

/// The keys of each kind of source, and what its people call it.
const KINDS: [(&str, &str, &[&str]); 3] = [
    ("path", "a file", &["path", "timing", "rate_hz", "end", "pace", "start", "from_secs", "until_secs"]),
    (
        "url",
        "a camera's URL",
        &["url", "transport", "user", "password_file", "password_env", "credentials", "stall_secs"],
    ),
    ("device", "a device", &["device", "rate_hz", "stall_secs", "width_px", "height_px", "format"]),
];

/// Checks that the keys written in `source`, which stands at `place`, name one source and belong to its kind.
pub(super) fn check_keys(source: &serde_json::Value, place: &str, gatherer: &mut Gatherer) {
    let Some(written) = source.as_object() else { return };
    let named: Vec<_> = KINDS.iter().filter(|(key, _, _)| written.contains_key(*key)).collect();
    let [(kind, called, own)] = named.as_slice() else {
        gatherer.fault(place, NOT_ONE);
        return;
    };
    for key in written.keys() {
        let of_others: Vec<_> = KINDS.iter().filter(|(_, _, keys)| keys.contains(&key.as_str())).collect();
        if let [(_, other, _), ..] = of_others.as_slice()
            && !own.contains(&key.as_str())
        {
            let message = format!("`{key}` belongs to {other}, and this source is {called} (`{kind}`)");
            gatherer.fault(format!("{place}/{key}"), message);
        }
    }
    let is_rtsp = written.get("url").and_then(|url| url.as_str()).is_none_or(|url| url.starts_with("rtsp"));
    if *kind == "url" && !is_rtsp && written.contains_key("transport") {
        gatherer.fault(format!("{place}/transport"), "`transport` belongs to rtsp and rtsps URLs");
    }
}

/// Whether sources such as `source` have the key.
pub(super) fn is_of_kind(key: &str, source: &SourceSettings) -> bool {
    let kind = match source.place() {
        Some(Place::Path(_)) => "path",
        Some(Place::Url(_)) => "url",
        Some(Place::Device(_)) => "device",
        None => return true,
    };
    let is_web = source.url.as_ref().and_then(|url| url.parse().ok()).is_some_and(|parts| !parts.is_rtsp());
    KINDS.iter().any(|(named, _, keys)| *named == kind && keys.contains(&key))
        && !(is_web && key == "transport")
}

const NOT_ONE: &str = "exactly one of `path` (a file), `url` (a camera) and `device` (V4L2) is needed";

/// Checks what the types of the settings at `place` cannot say.
pub(super) fn check(source: &SourceSettings, place: &str, gatherer: &mut Gatherer) {
    let at = |key: &str| format!("{place}/{key}");
    // Told already where keys were counted as they were written.
    if source.place().is_none() && !gatherer.is_faulty(place) {
        gatherer.fault(place, NOT_ONE);
    }
    for (key, path) in
        [("path", &source.path), ("device", &source.device), ("password_file", &source.password_file)]
    {
        if let Some(path) = path {
            check_path(path, &at(key), gatherer);
        }
    }
    if let Some(Err(error)) = source.url.as_ref().map(CameraUrl::parse) {
        gatherer.fault(at("url"), error.to_string());
    }
    if source.pace == Pace::All && source.end == End::Loop {
        let message = "`all` does not go with `end = \"loop\"`: a loop has no last frame to be done with";
        gatherer.fault(at("pace"), message);
    }
    range(gatherer, &at("rate_hz"), source.rate_hz, 0.01, 1000.0, "frames a second");
    range(gatherer, &at("stall_secs"), source.stall_secs, 0.5, 60.0, "seconds");
    range(gatherer, &at("from_secs"), source.from_secs, 0.0, 1e7, "seconds");
    if let Some(until_secs) = source.until_secs {
        range(gatherer, &at("until_secs"), until_secs, 0.0, 1e7, "seconds");
        if until_secs <= source.from_secs && !gatherer.is_faulty(&at("from_secs")) {
            gatherer.fault(at("until_secs"), format!("expected more than `from_secs`, {}", source.from_secs));
        }
    }
    for (key, side) in [("width_px", source.width_px), ("height_px", source.height_px)] {
        range(gatherer, &at(key), f64::from(side.unwrap_or(16)), 16.0, 8192.0, "pixels");
    }
    let password = (source.password_file.is_some(), source.password_env.as_ref());
    check_login(source.user.as_ref(), password, place, gatherer);
    if source.credentials.is_some() && (source.user.is_some() || password.0 || password.1.is_some()) {
        let message = "`credentials` stand in place of `user`, `password_file` and `password_env`: name one or the other";
        gatherer.fault(at("credentials"), message);
    }
}

/// Checks a user, with whether a file with the password is named, and the variable with it, at `place`.
pub(super) fn check_login(
    user: Option<&String>,
    (has_file, variable): (bool, Option<&String>),
    place: &str,
    gatherer: &mut Gatherer,
) {
    let at = |key: &str| format!("{place}/{key}");
    let has_password = has_file || variable.is_some();
    match user {
        Some(user)
            if user.is_empty()
                || user.chars().count() > MAX_USER_CHARS
                || user.chars().any(|c| c.is_control() || c == ':') =>
        {
            let message =
                format!("expected 1 to {MAX_USER_CHARS} characters, none of them a control character or `:`");
            gatherer.fault(at("user"), message);
        }
        Some(_) if !has_password => {
            gatherer.fault(at("user"), "a user needs a password: name `password_file` or `password_env`");
        }
        None if has_password => {
            let key = if has_file { "password_file" } else { "password_env" };
            gatherer.fault(at(key), "a password needs a `user`");
        }
        _ => {}
    }
    if has_file && variable.is_some() {
        gatherer
            .fault(at("password_env"), "the password comes from `password_file` or `password_env`, not both");
    }
    let is_name = |name: &String| {
        (1..=128).contains(&name.len())
            && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
            && !name.as_bytes()[0].is_ascii_digit()
    };
    if variable.is_some_and(|name| !is_name(name)) {
        // Somebody may have written the password itself: it is not repeated.
        let message = "expected the name of an environment variable: letters, digits and `_`";
        gatherer.fault(at("password_env"), message);
    }
}
