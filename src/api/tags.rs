//! Entity tags (RFC 9110, sections 8.8.3 and 13.1.2): what a caller has already is not sent again, and a picture that was shown
//! before is not drawn again.
//!
//! A picture's tag is the digest of its bytes, so it tells nothing that the bytes do not tell. Which tag a picture has is
//! remembered by what the picture hangs on ([`Key`]): scene as the caller may see it, view and settings, instant, and what every
//! permitted camera saw then. A request that names the tag of what it means is answered 304 before anything is drawn; where
//! that is not remembered the picture is drawn, and still not sent where its bytes are those that the caller has.

use axum::body::Body;
use axum::extract::Request;
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use sha2::{Digest, Sha256};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError, Weak};
use videofields_service::engine::ViewIdentity;
use videofields_service::wall::{Tile, blend};
use videofields_vision::clock::Timestamp;
use videofields_vision::encode::PictureFormat;
use videofields_vision::frame::{Mask, RgbImage, YuvImage};

/// Pictures whose tags are remembered; what was shown longest ago goes first.
const MAX_KNOWN: usize = 1024;

/// Bytes of a digest that stand in a tag: none is met twice by chance.
const DIGEST_BYTES: usize = 16;

/// What a compressed answer's tag ends in: other bytes need another tag.
pub(super) const COMPRESSED: &str = "-gzip";

/// What decides the bytes of a picture. Whatever comes to decide them (a generation of privacy zones, say) belongs in here or
/// in [`ViewIdentity`]; how they are encoded hangs on the format alone.
#[derive(Clone, Debug)]
pub(super) enum Key {
    /// A fused view.
    View(Arc<ViewIdentity>, PictureFormat, Finish),
    /// A camera's frame or background.
    Picture(Weak<YuvImage>, PictureFormat),
    /// A camera's mask.
    Mask(Weak<Mask>, PictureFormat),
}

/// What is done to a view once it is drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Finish {
    /// Nothing.
    None,
    /// A wall's tile fades out where others overlap it.
    Faded(Box<Tile>),
}

impl Finish {
    /// What becomes of a picture.
    pub(super) fn of(&self, image: Arc<RgbImage>) -> Arc<RgbImage> {
        let Self::Faded(tile) = self else { return image };
        let mut faded = RgbImage::clone(&image);
        blend(tile, &mut faded);
        Arc::new(faded)
    }
}

impl Key {
    /// Whether it can equal a key that comes later.
    fn can_be_met(&self) -> bool {
        match self {
            Self::View(identity, ..) => identity.can_be_met(),
            Self::Picture(picture, _) => picture.strong_count() > 0,
            Self::Mask(mask, _) => mask.strong_count() > 0,
        }
    }

    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::View(a, a_format, a_finish), Self::View(b, b_format, b_finish)) => {
                a_format == b_format && a_finish == b_finish && a == b
            }
            (Self::Picture(a, a_format), Self::Picture(b, b_format)) => a_format == b_format && a.ptr_eq(b),
            (Self::Mask(a, a_format), Self::Mask(b, b_format)) => a_format == b_format && a.ptr_eq(b),
            _ => false,
        }
    }
}

/// A strong entity tag, with its quotation marks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct EntityTag(String);

impl EntityTag {
    /// The tag of these bytes.
    pub(super) fn of(bytes: &[u8]) -> Self {
        let digest = Sha256::digest(bytes);
        Self(format!("\"{}\"", URL_SAFE_NO_PAD.encode(&digest[..DIGEST_BYTES])))
    }

    /// As a field has it.
    pub(super) fn text(self) -> String {
        self.0
    }

    pub(super) fn value(&self) -> HeaderValue {
        HeaderValue::try_from(&self.0).unwrap_or(HeaderValue::from_static("\"\""))
    }
}

/// The tags of pictures that were shown.
#[derive(Debug, Default)]
pub(super) struct KnownTags(Mutex<VecDeque<(Key, EntityTag)>>);

impl KnownTags {
    /// The tag of the picture that `key` decides, if it was shown.
    pub(super) fn find(&self, key: &Key) -> Option<EntityTag> {
        let known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.iter().find(|(other, _)| other.is(key)).map(|(_, tag)| tag.clone())
    }

    /// Remembers the tag of a picture.
    pub(super) fn note(&self, key: Key, tag: EntityTag) {
        if !key.can_be_met() {
            return;
        }
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        known.retain(|(other, _)| other.can_be_met() && !other.is(&key));
        if known.len() == MAX_KNOWN {
            known.pop_front();
        }
        known.push_back((key, tag));
    }
}

/// The tags that a caller has already.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Had(Vec<String>);

impl Had {
    /// What `If-None-Match` names.
    pub(super) fn read(headers: &HeaderMap) -> Self {
        let fields = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
        // Ours have no commas.
        Self(fields.flat_map(|field| field.split(',')).map(|tag| tag.trim().to_owned()).collect())
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The tag among them that stands for what `tag` stands for: compared weakly, since nothing is changed by it; of a
    /// compressed answer too.
    fn same(&self, tag: &str) -> Option<&str> {
        let plain = uncompressed(tag);
        let is_it =
            |had: &&String| *had == "*" || uncompressed(had.strip_prefix("W/").unwrap_or(had)) == plain;
        self.0.iter().find(is_it).map(String::as_str)
    }

    /// Whether what `tag` stands for is among them.
    pub(super) fn has(&self, tag: &EntityTag) -> bool {
        self.same(&tag.0).is_some()
    }
}

/// The tag of the same before it was compressed.
pub(super) fn uncompressed(tag: &str) -> String {
    let inner = tag.strip_suffix('"').and_then(|tag| tag.strip_suffix(COMPRESSED));
    inner.map_or_else(|| tag.to_owned(), |inner| format!("{inner}\""))
}

/// The answer to who has this picture already.
pub(super) fn not_modified(tag: &EntityTag, instant: Timestamp, caching: HeaderValue) -> Response {
    let mut response = StatusCode::NOT_MODIFIED.into_response();
    let headers = response.headers_mut();
    headers.insert(header::ETAG, tag.value());
    headers.insert(header::CACHE_CONTROL, caching);
    if let Ok(instant) = HeaderValue::try_from(instant.to_string()) {
        headers.insert("videofields-time", instant);
    }
    response
}

/// Sends nothing that the caller has already: an answer whose tag `If-None-Match` names is 304 without a body.
pub(super) async fn spare(request: Request, next: Next) -> Response {
    let is_look = matches!(*request.method(), Method::GET | Method::HEAD);
    let had = if is_look { Had::read(request.headers()) } else { Had::default() };
    let response = next.run(request).await;
    if had.is_empty() || response.status() != StatusCode::OK {
        return response;
    }
    let tag = response.headers().get(header::ETAG).and_then(|tag| tag.to_str().ok()).map(str::to_owned);
    let Some(tag) = tag.filter(|tag| had.same(tag).is_some()) else { return response };
    // The tag that the caller named, so that it knows which of its copies is good.
    let named = had.same(&tag).filter(|named| *named != "*").unwrap_or(&tag);
    let (mut parts, _) = response.into_parts();
    parts.status = StatusCode::NOT_MODIFIED;
    for name in [header::CONTENT_TYPE, header::CONTENT_LENGTH, header::LAST_MODIFIED] {
        parts.headers.remove(name);
    }
    if let Ok(named) = HeaderValue::try_from(named.strip_prefix("W/").unwrap_or(named)) {
        parts.headers.insert(header::ETAG, named);
    }
    Response::from_parts(parts, Body::empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::{ColorMatrix, ColorRange};

    fn had(fields: &[&'static str]) -> Had {
        let fields = fields.iter().map(|text| (header::IF_NONE_MATCH, HeaderValue::from_static(text)));
        Had::read(&fields.collect())
    }

    #[test]
    fn tags_are_compared_weakly_and_without_their_coding() {
        let has = |fields: &[&'static str], tag: &str| had(fields).same(tag).is_some();
        assert!(has(&["\"17\""], "\"17\""));
        assert!(has(&["\"1\", W/\"17\""], "\"17\""));
        assert!(has(&["\"1\"", "\"17-gzip\""], "\"17\""));
        assert!(has(&["*"], "\"17\""));
        assert!(!has(&["\"170\"", "17"], "\"17\""));
        assert!(!has(&[], "\"17\""));
        assert_eq!(uncompressed("\"17-gzip\""), "\"17\"");
        assert_eq!(uncompressed("\"17\""), "\"17\"");
        assert_eq!(uncompressed("17-gzip"), "17-gzip");
    }

    #[test]
    fn tags_are_of_bytes_alone() {
        assert_eq!(EntityTag::of(b"abc"), EntityTag::of(b"abc"));
        assert_ne!(EntityTag::of(b"abc"), EntityTag::of(b"abd"));
        // SHA-256 of "abc" begins ba7816bf 8f01cfea 414140de 5dae2223.
        assert_eq!(EntityTag::of(b"abc").0, "\"ungWv48Bz-pBQUDeXa4iIw\"");
    }

    #[test]
    fn a_known_tag_goes_with_what_it_was_of() {
        let image =
            || Arc::new(YuvImage::filled(4, 2, [9, 128, 128], ColorMatrix::Bt601, ColorRange::Limited));
        let (first, second, known) = (image(), image(), KnownTags::default());
        let key = |of: &Arc<YuvImage>, format| Key::Picture(Arc::downgrade(of), format);
        known.note(key(&first, PictureFormat::Png), EntityTag::of(b"first"));
        assert_eq!(known.find(&key(&first, PictureFormat::Png)), Some(EntityTag::of(b"first")));
        assert_eq!(known.find(&key(&first, PictureFormat::Jpeg)), None, "another format is another picture");
        assert_eq!(known.find(&key(&second, PictureFormat::Png)), None, "equal pixels elsewhere may change");
        drop(first);
        known.note(key(&second, PictureFormat::Png), EntityTag::of(b"second"));
        assert_eq!(known.0.lock().unwrap().len(), 1, "what has gone from memory is forgotten");
        for number in 0..2 * MAX_KNOWN {
            known.note(key(&second, PictureFormat::Png), EntityTag::of(&number.to_le_bytes()));
        }
        assert_eq!(known.0.lock().unwrap().len(), 1);
    }
}
