//! JSON text -> a tree of values, noting what `serde_json` passes over in silence: keys written twice.

use super::MAX_DOCUMENT_BYTES;
use super::SceneError;
use serde::de::{DeserializeSeed, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Number, Value};
use std::fmt;
use videofields_vision::error::{Fault, Gatherer, MAX_FAULTS, pointer_to};

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
    Tree { place: &Place::Whole, gatherer }
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

/// A place in the document; written as a pointer only where something is wrong there, or a long key would be written once for each value
/// within it.
enum Place<'a> {
    Whole,
    Key(&'a Self, &'a str),
    Index(&'a Self, usize),
}

impl Place<'_> {
    fn pointer(&self) -> String {
        match self {
            Self::Whole => String::new(),
            Self::Key(within, key) => pointer_to(&within.pointer(), key),
            Self::Index(within, index) => format!("{}/{index}", within.pointer()),
        }
    }
}

/// The tree at one place.
struct Tree<'a> {
    place: &'a Place<'a>,
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
            let place = Place::Index(self.place, values.len());
            match elements.next_element_seed(Tree { place: &place, gatherer: self.gatherer })? {
                Some(value) => values.push(value),
                None => return Ok(Value::Array(values)),
            }
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut values = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            let place = Place::Key(self.place, &key);
            let value = entries.next_value_seed(Tree { place: &place, gatherer: self.gatherer })?;
            if values.contains_key(&key) && self.gatherer.faults().len() < MAX_FAULTS {
                self.gatherer.fault(place.pointer(), "this key is written twice");
            }
            values.insert(key, value);
        }
        Ok(Value::Object(values))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use videofields_vision::clock::{Clock, SystemClock};

    #[test]
    fn a_long_key_does_not_take_the_square_of_its_length() {
        let (key, zeros) = ("k".repeat(1_500_000), "0,".repeat(1_000_000));
        let text = format!(r#"{{"{key}": [{zeros}{{"a/b": 1, "a/b": 2}}]}}"#);
        let clock = SystemClock::new();
        let mut gatherer = Gatherer::default();
        let tree = tree(&text, &mut gatherer).unwrap();
        assert!(clock.monotonic() < Duration::from_secs(10), "{:?}", clock.monotonic());
        assert_eq!(tree[&key].as_array().map(Vec::len), Some(1_000_001));
        let [fault] = gatherer.faults() else { panic!("one fault") };
        assert_eq!(fault.place, format!("/{key}/1000000/a~1b"));
    }
}
