//! What documents that are kept have in common: their versions, and changing members of them.

use super::Api;
use super::conditions::etag;
use super::error::Problem;
use super::operation::{Answer, Operation};
use super::pages;
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use axum::http::{Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};
use videofields_recording::store::DocumentKind;
use videofields_vision::access::Role;
use videofields_vision::error::{ErrorKind, Fault};

/// Greatest version that is asked for: what every JSON reader can hold.
const MAX_NUMBER: i64 = (1 << 53) - 1;

/// A segment that names a version.
pub(super) const NUMBER: Parameter = Parameter::whole("number", &(1..=MAX_NUMBER as u64), "A version of it");

const VERSION_PARAMETERS: &[Parameter] = &[pages::LIMIT, pages::CURSOR];

/// Describes a list of a document's versions.
pub(super) fn list_versions(id: &'static str) -> Operation {
    Operation::new(id, "What it was, the newest version first")
        .role(Role::Admin)
        .parameters(VERSION_PARAMETERS)
        .answers(Answer::page("The versions", schema::named("Versions")))
}

/// Describes a version of a document.
pub(super) fn show_version(id: &'static str, document: Value) -> Operation {
    Operation::new(id, "One version of its document")
        .role(Role::Admin)
        .answers(Answer::json(200, "The document as it was then", document).tagged())
}

/// What a document was, the newest version first.
pub(super) async fn versions(
    api: &Api,
    (kind, id): (DocumentKind, &str),
    uri: &Uri,
) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), VERSION_PARAMETERS);
    let is_number = |number: &i64| (1..=MAX_NUMBER).contains(number);
    let before = pages::cursor(&mut query, |text| text.parse().ok().filter(is_number));
    let limit = pages::limit(&mut query);
    query.finish(Some(()))?;
    // One more than is told, to know whether there are more.
    let found = api.catalog()?.versions((kind, id), before.unwrap_or(MAX_NUMBER), limit as u32 + 1).await;
    let mut versions = found?;
    let has_more = pages::cut(&mut versions, limit);
    let next = versions.last().filter(|_| has_more).map(|last| last.version.to_string());
    let body = json!({ "versions": versions, "is_complete": next.is_none() });
    Ok(pages::answer(uri, body, next))
}

/// One version of a document.
pub(super) async fn version(
    api: &Api,
    (kind, id): (DocumentKind, &str),
    text: &str,
    raw: Option<&str>,
) -> Result<Response, Problem> {
    Query::parse(raw, NONE).finish(Some(()))?;
    let number = number(text)?;
    let document = api.catalog()?.version(kind, id, number).await?;
    let fields = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::ETAG, etag(number)),
    ];
    Ok((fields, document).into_response())
}

/// A version's number, as a path has it.
pub(super) fn number(text: &str) -> Result<i64, Problem> {
    let number = text.parse().ok().filter(|number| (1..=MAX_NUMBER).contains(number));
    number.ok_or_else(|| {
        let fault = Fault::new("version", format!("expected a whole number from 1 to {MAX_NUMBER}"));
        Problem::at(ErrorKind::Invalid, vec![fault])
    })
}

/// JSON Merge Patch (RFC 7396, section 2).
pub(super) fn merge(target: &mut Value, patch: Value) {
    let Value::Object(patch) = patch else {
        *target = patch;
        return;
    };
    if !target.is_object() {
        *target = Value::Object(Map::new());
    }
    let Value::Object(target) = target else { return };
    for (key, value) in patch {
        match value {
            Value::Null => drop(target.remove(&key)),
            value => merge(target.entry(key).or_insert(Value::Null), value),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_merge_as_the_rfc_has_it() {
        // RFC 7396, appendix A.
        let check = |target: Value, patch: Value, expected: Value| {
            let mut merged = target;
            merge(&mut merged, patch);
            assert_eq!(merged, expected);
        };
        check(json!({"a": "b"}), json!({"a": "c"}), json!({"a": "c"}));
        check(json!({"a": "b"}), json!({"b": "c"}), json!({"a": "b", "b": "c"}));
        check(json!({"a": "b"}), json!({"a": null}), json!({}));
        check(json!({"a": ["b"]}), json!({"a": "c"}), json!({"a": "c"}));
        check(json!({"a": "c"}), json!({"a": ["b"]}), json!({"a": ["b"]}));
        let nested = json!({"a": {"b": "d", "c": null}});
        check(json!({"a": {"b": "c"}}), nested, json!({"a": {"b": "d"}}));
        check(json!({"a": [{"b": "c"}]}), json!({"a": [1]}), json!({"a": [1]}));
        check(json!(["a", "b"]), json!(["c", "d"]), json!(["c", "d"]));
        check(json!({"a": "b"}), json!(["c"]), json!(["c"]));
        check(json!({"e": null}), json!({"a": 1}), json!({"e": null, "a": 1}));
        check(json!([1, 2]), json!({"a": "b", "c": null}), json!({"a": "b"}));
        check(json!({}), json!({"a": {"bb": {"ccc": null}}}), json!({"a": {"bb": {}}}));
    }
}
