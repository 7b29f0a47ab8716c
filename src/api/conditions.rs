//! Conditions on changes (RFC 9110, section 13): what is changed must be what the caller last saw.

use super::error::Problem;
use super::tags::uncompressed;
use axum::http::{HeaderMap, header};
use videofields_service::catalog::Condition;
use videofields_vision::error::{ErrorKind, Fault};

/// The entity tag of a version.
pub(super) fn etag(version: i64) -> String {
    format!("\"{version}\"")
}

/// The condition of a change that must have one.
pub(super) fn required(headers: &HeaderMap) -> Result<Condition, Problem> {
    let field = |name| headers.get(name).map(|value| value.to_str().unwrap_or_default().trim());
    match (field(header::IF_MATCH), field(header::IF_NONE_MATCH)) {
        (None, None) => Err(Problem::precondition_required()),
        (None, Some("*")) => Ok(Condition::Absent),
        (Some("*"), None) => Ok(Condition::Present),
        (Some(tag), None) => {
            // What was compressed is of the same version.
            let tag = uncompressed(tag);
            let weak = tag.strip_prefix("W/");
            let version = weak.unwrap_or(&tag).strip_prefix('"').and_then(|tag| tag.strip_suffix('"'));
            let Some(version) = version else {
                return Err(fault("If-Match", "must be an answer's ETag, in its quotation marks, or *"));
            };
            // Another tag than ours, or a weak one, is no version that there ever was.
            let version = version.parse().ok().filter(|_| weak.is_none());
            Ok(Condition::Version(version.unwrap_or(-1)))
        }
        (None, Some(_)) => Err(fault("If-None-Match", "must be *; If-Match takes an answer's ETag")),
        (Some(_), Some(_)) => Err(fault("If-None-Match", "cannot stand beside If-Match")),
    }
}

/// A condition on what is known by a digest of what is shown, and not by a version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TagCondition {
    /// There is none yet.
    Absent,
    /// There is one, whichever.
    Present,
    /// It is one of these.
    OneOf(Vec<String>),
}

impl TagCondition {
    /// The condition of a change that must have one.
    pub(super) fn required(headers: &HeaderMap) -> Result<Self, Problem> {
        match required(headers)? {
            Condition::Absent => Ok(Self::Absent),
            Condition::Present => Ok(Self::Present),
            Condition::Version(_) => {
                let named = headers.get_all(header::IF_MATCH).iter().filter_map(|value| value.to_str().ok());
                // What was compressed is of the same content; a weak tag is of none.
                let tags = named.flat_map(|value| value.split(',')).map(|tag| uncompressed(tag.trim()));
                Ok(Self::OneOf(tags.collect()))
            }
        }
    }

    /// Whether it holds of what there is, whose entity tag that is.
    pub(super) fn holds(&self, etag: &str) -> bool {
        match self {
            Self::Absent => false,
            Self::Present => true,
            Self::OneOf(tags) => tags.iter().any(|tag| tag == etag),
        }
    }
}

fn fault(field: &str, message: &str) -> Problem {
    Problem::at(ErrorKind::Invalid, vec![Fault::new(field, message)])
}

/// Whether the caller has what that entity tag stands for already (`If-None-Match`; RFC 9110, section 13.1.2).
pub(super) fn is_fresh(headers: &HeaderMap, etag: &str) -> bool {
    let named = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let mut tags = named.flat_map(|value| value.split(',')).map(str::trim);
    // A weak comparison: what is only looked at need not be the same to the byte.
    tags.any(|tag| tag == "*" || tag.strip_prefix("W/").unwrap_or(tag) == etag)
}

/// The condition of a change that may have one.
pub(super) fn optional(headers: &HeaderMap) -> Result<Option<Condition>, Problem> {
    let has = |name| headers.contains_key(name);
    if has(header::IF_MATCH) || has(header::IF_NONE_MATCH) { required(headers).map(Some) } else { Ok(None) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn conditions_are_read_as_they_are_written() {
        let check = |fields: &[(header::HeaderName, &'static str)], expected: Option<Condition>| {
            let fields = fields.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value)));
            assert_eq!(required(&fields.collect()).ok(), expected);
        };
        check(&[], None);
        check(&[(header::IF_MATCH, "*")], Some(Condition::Present));
        check(&[(header::IF_NONE_MATCH, "*")], Some(Condition::Absent));
        check(&[(header::IF_MATCH, "\"17\"")], Some(Condition::Version(17)));
        check(&[(header::IF_MATCH, "\"17-gzip\"")], Some(Condition::Version(17)));
        check(&[(header::IF_MATCH, "W/\"17\"")], Some(Condition::Version(-1)));
        check(&[(header::IF_MATCH, "\"none of ours\"")], Some(Condition::Version(-1)));
        check(&[(header::IF_MATCH, "17")], None);
        check(&[(header::IF_MATCH, "\"")], None);
        check(&[(header::IF_NONE_MATCH, "\"17\"")], None);
        check(&[(header::IF_MATCH, "\"1\""), (header::IF_NONE_MATCH, "*")], None);
        assert_eq!(etag(17), "\"17\"");
    }

    #[test]
    fn conditions_on_digests_compare_strongly() {
        let read = |fields: &[(header::HeaderName, &'static str)]| {
            let fields = fields.iter().map(|(name, value)| (name.clone(), HeaderValue::from_static(value)));
            TagCondition::required(&fields.collect())
        };
        let holds = |value: &'static str| read(&[(header::IF_MATCH, value)]).unwrap().holds("\"aB-9\"");
        assert!(holds("\"aB-9\"") && holds("*") && holds("\"x\", \"aB-9-gzip\""));
        assert!(!holds("W/\"aB-9\"") && !holds("\"ab-9\"") && !holds("\"\""));
        assert!(!read(&[(header::IF_NONE_MATCH, "*")]).unwrap().holds("\"aB-9\""));
        assert!(read(&[(header::IF_MATCH, "aB-9")]).is_err());
        assert!(read(&[]).is_err() && read(&[(header::IF_NONE_MATCH, "\"aB-9\"")]).is_err());
    }

    #[test]
    fn who_has_the_newest_is_spared_it() {
        let check = |value: &'static str, expected: bool| {
            let fields = [(header::IF_NONE_MATCH, HeaderValue::from_static(value))];
            assert_eq!(is_fresh(&fields.into_iter().collect(), "\"17\""), expected, "{value}");
        };
        check("\"17\"", true);
        check("W/\"17\"", true);
        check("\"3\", \"17\"", true);
        check("*", true);
        check("17", false);
        check("\"18\"", false);
        assert!(!is_fresh(&HeaderMap::new(), "\"17\""));
    }
}
