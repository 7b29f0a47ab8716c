//! JSON text -> a tree of values, noting what `serde_json` passes over in silence: keys written twice.

use super::MAX_DOCUMENT_BYTES;
use super::SceneError;
use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;
use videofields_vision::error::{Fault, Gatherer, pointer_to};

/// The tree of a whole document.
///
/// # Errors
/// When the text is no JSON, or a key stands twice.
pub fn tree(text: &str, gatherer: &mut Gatherer) -> Result<Value, SceneError> {
    tree_within(text, MAX_DOCUMENT_BYTES, gatherer)
}

/// The tree of a text of at most so many bytes.
pub(super) fn tree_within(
    text: &str,
    most_bytes: usize,
    gatherer: &mut Gatherer,
) -> Result<Value, SceneError> {
    if text.len() > most_bytes {
        return Err(SceneError::TooLarge { bytes: text.len() as u64 });
    }
    let mut deserializer = serde_json::Deserializer::from_str(text);
    Tree { place: String::new(), gatherer }
        .deserialize(&mut deserializer)
        .and_then(|tree| deserializer.end().map(|()| tree))
        .map_err(|error| SceneError::Faults(vec![Fault::new("", complain(text, &error))]))
}

/// Where the text stops being JSON, and why.
fn complain(text: &str, error: &serde_json::Error) -> String {
    let (line, column) = (error.line(), error.column());
    let said = error.to_string();
    let said = said.split(" at line ").next().unwrap_or_default();
    let rest = text.lines().nth(line.saturating_sub(1)).and_then(|line| line.get(column.saturating_sub(1)..));
    let word = rest.unwrap_or_default().trim_start_matches(['-', '+']).to_lowercase();
    let is_not_finite = said.contains("out of range")
        || ["nan", "inf", "an", "nf"].iter().any(|start| word.starts_with(start));
    let hint = if is_not_finite { "; JSON has finite numbers only, no NaN and no Infinity" } else { "" };
    format!("line {line}, column {column}: not JSON: {said}{hint}")
}

/// The tree at one place.
struct Tree<'a> {
    place: String,
    gatherer: &'a mut Gatherer,
}

impl<'de> DeserializeSeed<'de> for Tree<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Tree<'_> {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, truth: bool) -> Result<Value, E> {
        Ok(Value::Bool(truth))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Value, E> {
        Ok(Value::from(number))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Value, E> {
        Ok(Value::from(number))
    }

    fn visit_f64<E>(self, number: f64) -> Result<Value, E> {
        Ok(Number::from_f64(number).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::from(text))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        loop {
            let place = format!("{}/{}", self.place, values.len());
            match elements.next_element_seed(Tree { place, gatherer: self.gatherer })? {
                Some(value) => values.push(value),
                None => return Ok(Value::Array(values)),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut values = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            let place = pointer_to(&self.place, &key);
            let value = entries.next_value_seed(Tree { place: place.clone(), gatherer: self.gatherer })?;
            if values.insert(key, value).is_some() {
                self.gatherer.fault(place, "this key is written twice");
            }
        }
        Ok(Value::Object(values))
    }
}
