//! A named view's document: a place from which a scene is looked at, which people keep under a name.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeSet;
use videofields_vision::error::{Fault, Gatherer};
use videofields_vision::frame::is_id;

const MAX_NAME_CHARS: usize = 200;
const MAX_GROUP_CHARS: usize = 100;
const MAX_PARAMETER_BYTES: usize = 1024;
const MAX_TAGS: usize = 32;
const MAX_TAG_CHARS: usize = 64;

/// Furthest place in a list, either way.
const MAX_ORDER: i64 = 1_000_000;

/// A view as it is written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedView {
    /// Name for people, at most 200 characters. Default empty.
    #[serde(default)]
    pub name: String,
    /// The scene that it shows.
    pub scene: String,
    /// What it shows of it, as the query string of a view has it, at most 1024 bytes. Default the scene's own view.
    #[serde(default)]
    pub parameters: String,
    /// Under what it is listed, at most 100 characters. Default empty.
    #[serde(default)]
    pub group: String,
    /// Words by which it is found, at most 32 of 1 to 64 characters, each once. Default none.
    #[serde(default)]
    pub tags: Vec<String>,
    /// Its place in its group, -1000000 to 1000000; equal ones stand in the order of names. Default 0.
    #[serde(default)]
    pub order: i64,
}

impl NamedView {
    /// Reads a view's document. What its parameters mean is not looked at.
    ///
    /// # Errors
    /// With every fault, each at its JSON pointer.
    pub fn read(document: Value) -> Result<Self, Vec<Fault>> {
        let mut gatherer = Gatherer::default();
        if !document.is_object() {
            return Err(vec![Fault::new("", "expected an object")]);
        }
        let read = gatherer.read::<Self>(document, "");
        if let Some(view) = &read {
            view.check(&mut gatherer);
        }
        let faults = gatherer.into_faults();
        read.filter(|_| faults.is_empty()).ok_or(faults)
    }

    fn check(&self, gatherer: &mut Gatherer) {
        for (key, text, most) in
            [("/name", &self.name, MAX_NAME_CHARS), ("/group", &self.group, MAX_GROUP_CHARS)]
        {
            if text.chars().count() > most {
                gatherer.fault(key, format!("expected at most {most} characters"));
            }
        }
        if !is_id(&self.scene) {
            let message = "expected 1 to 64 of a-z, 0-9, - and _, the first a letter or digit";
            gatherer.fault("/scene", message);
        }
        if self.parameters.len() > MAX_PARAMETER_BYTES {
            gatherer.fault("/parameters", format!("expected at most {MAX_PARAMETER_BYTES} bytes"));
        }
        if self.tags.len() > MAX_TAGS {
            gatherer.fault("/tags", format!("expected at most {MAX_TAGS} tags"));
        }
        let mut known = BTreeSet::new();
        for (idx, tag) in self.tags.iter().enumerate() {
            if !(1..=MAX_TAG_CHARS).contains(&tag.chars().count()) {
                gatherer.fault(format!("/tags/{idx}"), format!("expected 1 to {MAX_TAG_CHARS} characters"));
            }
            if !known.insert(tag) {
                gatherer.fault(format!("/tags/{idx}"), "stands here twice");
            }
        }
        if self.order.abs() > MAX_ORDER {
            let message = format!("expected -{MAX_ORDER} to {MAX_ORDER}, got {}", self.order);
            gatherer.fault("/order", message);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn views_are_read_with_all_their_faults() {
        let view = NamedView::read(json!({"scene": "plaza"})).unwrap();
        assert_eq!((view.order, view.tags.len(), view.parameters.as_str()), (0, 0, ""));
        let check = |document: Value, places: &[&str]| {
            let faults = NamedView::read(document).unwrap_err();
            assert_eq!(faults.iter().map(|fault| fault.place.as_str()).collect::<Vec<_>>(), places);
        };
        check(json!([]), &[""]);
        check(json!({}), &[""]);
        check(json!({"scene": "Plaza"}), &["/scene"]);
        check(json!({"scene": "plaza", "fov": 3}), &["/fov"]);
        check(
            json!({
                "scene": "plaza", "name": "n".repeat(201), "group": "g".repeat(101), "parameters": "p".repeat(1025),
                "tags": ["", "a", "a", "t".repeat(65)], "order": 2_000_000,
            }),
            &["/name", "/group", "/parameters", "/tags/0", "/tags/2", "/tags/3", "/order"],
        );
        let many: Vec<String> = (0..33).map(|number| number.to_string()).collect();
        check(json!({"scene": "plaza", "tags": many}), &["/tags"]);
    }
}
