//! Pictures as answers: `{name}.{jpg,png}` taken apart, pixels encoded off the async threads and a bounded number
//! at once, and the header fields that say what is shown.

use super::Api;
use super::error::Problem;
use super::operation::Answer;
use super::query::Moment;
use super::shares::{Place, Shares};
use super::tags::{EntityTag, Had, Key, not_modified};
use axum::body::Bytes;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use std::time::Duration;
use videofields_recording::priority;
use videofields_vision::clock::Timestamp;
use videofields_vision::encode::{self, EncodeError, PictureFormat};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{RgbImage, YuvImage};

/// Quality of every JPEG, 1 to 100: above it files grow faster than pictures get better.
const JPEG_QUALITY: u8 = 88;

/// Most pixels of a picture that is encoded with the usual priority: encoding more takes tens of milliseconds.
const SMALL_PICTURE_PX: u64 = 1 << 19;

/// A picture of a fixed time may be kept by who asked for it, who asks whether it is still good each time: rights may end.
pub(super) const FIXED_TIME_CACHING: HeaderValue = HeaderValue::from_static("private, no-cache");

/// Pictures of now are of no use later, and no browser's disk should fill with them.
const LIVE_CACHING: HeaderValue = HeaderValue::from_static("no-store");

/// The formats in which every picture can be had.
const FORMATS: [PictureFormat; 2] = [PictureFormat::Jpeg, PictureFormat::Png];

/// Writes a colour picture.
pub(super) fn write_rgb(format: PictureFormat, image: &RgbImage) -> Result<Vec<u8>, EncodeError> {
    match format {
        PictureFormat::Jpeg => encode::jpeg(image, JPEG_QUALITY),
        PictureFormat::Png => encode::png_rgb(image),
    }
}

/// Writes a camera's picture.
pub(super) fn write_yuv(format: PictureFormat, image: &YuvImage) -> Result<Vec<u8>, EncodeError> {
    match format {
        PictureFormat::Jpeg => encode::jpeg_yuv(image, JPEG_QUALITY),
        PictureFormat::Png => encode::png_rgb(&image.to_rgb()),
    }
}

/// Takes `{name}.{jpg,png}` apart.
///
/// # Errors
/// Not found, with the list of what there is, where the name is none of `names` or the ending none of the two.
pub(super) fn split<T: Copy>(file: &str, names: &[(&str, T)]) -> Result<(T, PictureFormat), Problem> {
    let found = file.rsplit_once('.').and_then(|(name, ending)| {
        let (_, picture) = names.iter().find(|(known, _)| *known == name)?;
        let format = FORMATS.into_iter().find(|format| format.extension() == ending)?;
        Some((*picture, format))
    });
    found.ok_or_else(|| {
        let files = files(names);
        Problem::missing("picture", file, &files.iter().map(String::as_str).collect::<Vec<_>>())
    })
}

/// Every file that [`split`] takes apart.
pub(super) fn files<T>(names: &[(&str, T)]) -> Vec<String> {
    names
        .iter()
        .flat_map(|(name, _)| FORMATS.map(|format| format!("{name}.{}", format.extension())))
        .collect()
}

/// How a picture is answered, as the contract says it.
pub(super) fn pictured(meaning: &'static str) -> Answer {
    Answer::bytes(200, meaning, &["image/jpeg", "image/png"])
        .field("Videofields-Time", "The instant shown, RFC 3339")
        .field("Cache-Control", "`no-store` of the newest there is, `private, no-cache` of a fixed time")
        .field("ETag", "A digest of its bytes; `If-None-Match` takes it")
}

/// Bytes that a place of `Api::answers` stands for.
const ANSWER_UNIT_BYTES: usize = 1024;

/// Bytes on their way to one user for each that is left: a wall's screens may be one user.
const ANSWER_GREED: usize = 3;

/// Returns the places of bytes that are on their way.
pub(super) fn answers(limit_bytes: usize) -> Shares<String> {
    Shares::new(limit_bytes / ANSWER_UNIT_BYTES, ANSWER_GREED)
}

/// A file on its way to a client, counted among those that are until the last of it is sent or the client is gone.
struct HeldFile {
    bytes: Vec<u8>,
    _place: Place<String>,
}

impl AsRef<[u8]> for HeldFile {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

/// A picture's file.
pub(super) struct Encoded {
    pub(super) bytes: Bytes,
    /// Its entity tag.
    pub(super) tag: EntityTag,
    /// What encoding took.
    pub(super) took: Duration,
}

/// Whether what was asked for may be kept, and how.
pub(super) const fn caching(moment: Moment) -> HeaderValue {
    if moment.is_fixed { FIXED_TIME_CACHING } else { LIVE_CACHING }
}

impl Api {
    /// That the caller has the picture already that `key` decides, if so: known without drawing or encoding it.
    pub(super) fn spared(
        &self,
        had: &Had,
        key: &Key,
        (moment, instant): (Moment, Timestamp),
    ) -> Option<Response> {
        let tag = self.tags.find(key).filter(|tag| had.has(tag))?;
        Some(not_modified(&tag, instant, caching(moment)))
    }

    /// Counts `bytes` among what is on its way to clients: slow ones could else fill the memory.
    fn held(&self, bytes: Vec<u8>) -> Result<Bytes, Problem> {
        let limit = self.limits.answer_bytes / ANSWER_UNIT_BYTES;
        let units = bytes.len().div_ceil(ANSWER_UNIT_BYTES).min(limit);
        let place = self.shared_many(&self.answers, units, "KiB of pictures are on their way")?;
        Ok(Bytes::from_owner(HeldFile { bytes, _place: place }))
    }

    /// Encodes a picture of that size by `work` where that may take its time; the number of such works at once is bounded, and so are
    /// the bytes of their outcomes that clients have not taken yet. Large pictures are encoded with a lower priority: small ones,
    /// and what is drawn meanwhile, would wait for the processors else.
    pub(super) async fn encoded(
        &self,
        [width_px, height_px]: [u32; 2],
        work: impl FnOnce() -> Result<Vec<u8>, EncodeError> + Send + 'static,
    ) -> Result<Encoded, Problem> {
        let turn = self.turn(&self.encoders).await;
        let clock = Arc::clone(&self.clock);
        let timed = move || {
            let start = clock.monotonic();
            let bytes = work()?;
            let took = clock.monotonic().saturating_sub(start);
            let tag = EntityTag::of(&bytes);
            drop(turn);
            Ok::<_, EncodeError>((bytes, tag, took))
        };
        let is_large = u64::from(width_px) * u64::from(height_px) > SMALL_PICTURE_PX;
        let encoding = if is_large { priority::spawn(timed) } else { tokio::task::spawn_blocking(timed) };
        match encoding.await {
            Ok(outcome) => {
                let (bytes, tag, took) = outcome?;
                Ok(Encoded { bytes: self.held(bytes)?, tag, took })
            }
            Err(panicked) => {
                Err(Problem::new(ErrorKind::Internal, format!("encoding a picture: {panicked}")))
            }
        }
    }
}

/// An encoded picture on its way to the client.
pub(super) struct Picture {
    /// How it is written.
    pub(super) format: PictureFormat,
    /// The file.
    pub(super) bytes: Bytes,
    /// Its entity tag.
    pub(super) tag: EntityTag,
    /// Which time was asked for.
    pub(super) moment: Moment,
    /// The instant shown.
    pub(super) instant: Timestamp,
    /// Further header fields, by name.
    pub(super) fields: Vec<(&'static str, String)>,
}

impl IntoResponse for Picture {
    fn into_response(self) -> Response {
        let mut response = self.bytes.into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(self.format.content_type()));
        headers.insert(header::CACHE_CONTROL, caching(self.moment));
        headers.insert(header::ETAG, self.tag.value());
        headers.insert("videofields-time", field_value(&self.instant.to_string()));
        for (name, value) in self.fields {
            headers.insert(name, field_value(&value));
        }
        response
    }
}

/// `text` as a header field's value; what may not stand in one becomes a question mark.
fn field_value(text: &str) -> HeaderValue {
    let visible: String = text.chars().map(|c| if matches!(c, ' '..='~') { c } else { '?' }).collect();
    HeaderValue::try_from(visible).unwrap_or(HeaderValue::from_static("?"))
}

/// A `Server-Timing` value: stages and their milliseconds; a trace of the request tells of them too.
pub(super) fn server_timing(stages: &[(&str, Duration)]) -> String {
    videofields_recording::telemetry::tell_stages(stages);
    let stage = |(name, duration): &(&str, Duration)| {
        let token = name.replace(|c: char| !c.is_ascii_alphanumeric() && c != '_' && c != '-', "_");
        format!("{token};dur={:.3}", duration.as_secs_f64() * 1e3)
    };
    stages.iter().map(stage).collect::<Vec<_>>().join(", ")
}
