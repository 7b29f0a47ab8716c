//! Holds JSON to JSON Schemas (2020-12), as far as the interface's contract uses them: a keyword that is not known here fails.

use regex::Regex;
use serde_json::{Map, Value};
use videofields_vision::clock::Timestamp;

/// What only describes.
const NOTES: [&str; 6] = ["default", "description", "examples", "format", "title", "writeOnly"];

/// What is wrong with `value`, one line a fault; `#/...` references lead into `document`.
pub fn faults(document: &Value, schema: &Value, value: &Value) -> Vec<String> {
    let mut checker = Checker { document, faults: Vec::new() };
    checker.check(schema, value, "");
    checker.faults
}

struct Checker<'a> {
    document: &'a Value,
    faults: Vec<String>,
}

impl<'a> Checker<'a> {
    fn check(&mut self, schema: &'a Value, value: &Value, place: &str) {
        let Some(keywords) = schema.as_object() else {
            return self.demand(schema != &Value::Bool(false), place, "is not allowed");
        };
        for (keyword, wanted) in keywords {
            self.keyword(keywords, (keyword, wanted), value, place);
        }
    }

    #[expect(clippy::fn_params_excessive_bools, reason = "what is demanded is a condition")]
    fn demand(&mut self, holds: bool, place: &str, otherwise: impl Into<String>) {
        if !holds {
            let place = if place.is_empty() { "(whole)" } else { place };
            self.faults.push(format!("{place}: {}", otherwise.into()));
        }
    }

    /// How many of these schemas hold.
    fn holding(&self, schemas: &'a Value, value: &Value) -> usize {
        let all = schemas.as_array().expect("a list of schemas");
        all.iter().filter(|schema| faults(self.document, schema, value).is_empty()).count()
    }

    fn keyword(
        &mut self,
        all: &'a Map<String, Value>,
        (keyword, wanted): (&str, &'a Value),
        value: &Value,
        place: &str,
    ) {
        let told = format!("{value} does not hold to {keyword} {wanted}");
        let number = wanted.as_f64().unwrap_or(f64::NAN);
        let chars = || value.as_str().map(|text| text.chars().count() as f64);
        let items = || value.as_array().map(|items| items.len() as f64);
        let holds = match keyword {
            "$ref" => return self.check(self.target(wanted), value, place),
            "type" => is_of_type(wanted, value),
            "enum" => wanted.as_array().expect("a list of values").contains(value),
            "minimum" => value.as_f64().is_none_or(|value| value >= number),
            "maximum" => value.as_f64().is_none_or(|value| value <= number),
            "minLength" => chars().is_none_or(|count| count >= number),
            "maxLength" => chars().is_none_or(|count| count <= number),
            "minItems" => items().is_none_or(|count| count >= number),
            "maxItems" => items().is_none_or(|count| count <= number),
            "uniqueItems" => is_unique(value),
            "pattern" => value.as_str().is_none_or(|text| pattern(wanted).is_match(text)),
            "format" if wanted == "date-time" => {
                value.as_str().is_none_or(|text| text.parse::<Timestamp>().is_ok() && text.contains('T'))
            }
            "anyOf" => self.holding(wanted, value) > 0,
            "oneOf" => self.holding(wanted, value) == 1,
            "allOf" => {
                for schema in wanted.as_array().into_iter().flatten() {
                    self.check(schema, value, place);
                }
                true
            }
            "items" => {
                for (idx, item) in value.as_array().into_iter().flatten().enumerate() {
                    self.check(wanted, item, &format!("{place}/{idx}"));
                }
                true
            }
            "required" | "properties" | "additionalProperties" => {
                return self.members(all, (keyword, wanted), value, place);
            }
            note => {
                let is_note = NOTES.contains(&note) || note.starts_with("x-");
                return self.demand(is_note, place, format!("the keyword {note} is not known"));
            }
        };
        self.demand(holds, place, told);
    }

    fn members(
        &mut self,
        all: &'a Map<String, Value>,
        (keyword, wanted): (&str, &'a Value),
        value: &Value,
        place: &str,
    ) {
        let Some(members) = value.as_object() else { return };
        let described = all.get("properties").and_then(Value::as_object);
        let is_described = |name: &str| described.is_some_and(|described| described.contains_key(name));
        match keyword {
            "required" => {
                for name in wanted.as_array().into_iter().flatten().filter_map(Value::as_str) {
                    self.demand(members.contains_key(name), place, format!("{name} is missing"));
                }
            }
            "properties" => {
                for (name, schema) in described.into_iter().flatten() {
                    let Some(member) = members.get(name) else { continue };
                    self.check(schema, member, &format!("{place}/{name}"));
                }
            }
            _ => {
                for (name, member) in members.iter().filter(|(name, _)| !is_described(name)) {
                    self.check(wanted, member, &format!("{place}/{name}"));
                }
            }
        }
    }

    fn target(&self, reference: &Value) -> &'a Value {
        let pointer = reference.as_str().and_then(|reference| reference.strip_prefix('#'));
        let target = pointer.and_then(|pointer| self.document.pointer(pointer));
        target.unwrap_or_else(|| panic!("{reference} leads nowhere"))
    }
}

fn pattern(wanted: &Value) -> Regex {
    Regex::new(wanted.as_str().expect("a pattern is text")).expect("a pattern can be read")
}

fn is_of_type(wanted: &Value, value: &Value) -> bool {
    let is = |kind: &str| match kind {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.as_f64().is_some_and(|number| number.fract() == 0.0),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        _ => false,
    };
    match wanted {
        Value::String(kind) => is(kind),
        kinds => kinds.as_array().into_iter().flatten().filter_map(Value::as_str).any(is),
    }
}

fn is_unique(value: &Value) -> bool {
    let items = value.as_array().map_or(&[][..], Vec::as_slice);
    items.iter().enumerate().all(|(idx, item)| !items[..idx].contains(item))
}

#[test]
fn what_does_not_hold_is_told_with_its_place() {
    use serde_json::json;
    let document = json!({"components": {"Id": {"type": "string", "pattern": "^[a-z]+$"}}});
    let schema = json!({
        "type": "object",
        "required": ["id"],
        "additionalProperties": false,
        "properties": {
            "id": {"$ref": "#/components/Id"},
            "size": {"type": ["integer", "null"], "minimum": 1},
            "at": {"type": "string", "format": "date-time"},
            "pair": {"type": "array", "items": {"type": "boolean"}, "minItems": 2, "uniqueItems": true},
            "kind": {"oneOf": [{"enum": ["a"]}, {"type": "null"}]},
        },
    });
    let check = |value: Value, places: &[&str]| {
        let found = faults(&document, &schema, &value);
        let found: Vec<&str> = found.iter().filter_map(|fault| fault.split(':').next()).collect();
        assert_eq!(found, places, "{value}");
    };
    check(
        json!({"id": "a", "size": null, "at": "2026-03-01T12:00:00Z", "pair": [true, false], "kind": null}),
        &[],
    );
    check(json!({}), &["(whole)"]);
    check(json!([]), &["(whole)"]);
    check(json!({"id": "A"}), &["/id"]);
    check(json!({"id": "a", "size": 0}), &["/size"]);
    check(json!({"id": "a", "size": 1.5}), &["/size"]);
    check(json!({"id": "a", "at": "yesterday"}), &["/at"]);
    check(json!({"id": "a", "pair": [true, true]}), &["/pair"]);
    check(json!({"id": "a", "pair": [true]}), &["/pair"]);
    check(json!({"id": "a", "pair": [true, 1]}), &["/pair/1"]);
    check(json!({"id": "a", "kind": "b"}), &["/kind"]);
    check(json!({"id": "a", "more": 1}), &["/more"]);
}
