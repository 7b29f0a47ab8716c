//! Reads a document's tree of values into types and finds all of its faults, not only the first.
//!
//! A tree goes in piece by piece; values of the right type come out where there are any, and [`Gatherer::faults`]
//! holds what is wrong with the rest, each with its JSON pointer. serde stops at the first fault of a value: the
//! faulty part is then taken out and the value read again, until it is whole or nothing more can be found.
//! Knows nothing of what documents mean.

use super::Fault;
use super::wording::{Complaint, unknown};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use serde_path_to_error::Segment;

/// Faults that are reported of one document; more do not help anyone who must mend it.
pub const MAX_FAULTS: usize = 64;

/// Collects the faults of one document.
#[derive(Debug, Default)]
pub struct Gatherer {
    faults: Vec<Fault>,
}

/// An object that is being taken apart key by key.
#[derive(Debug)]
pub struct Fields {
    place: String,
    values: Map<String, Value>,
    known: Vec<&'static str>,
}

/// The pointer of `key` in the object at `place`.
#[must_use]
pub fn pointer_to(place: &str, key: &str) -> String {
    format!("{place}/{}", key.replace('~', "~0").replace('/', "~1"))
}

impl Gatherer {
    /// The faults found so far, in the order in which they were found.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }

    /// Ends the gathering.
    #[must_use]
    pub fn into_faults(self) -> Vec<Fault> {
        self.faults
    }

    /// Notes a fault; beyond [`MAX_FAULTS`] it is dropped.
    pub fn fault(&mut self, place: impl Into<String>, message: impl Into<String>) {
        if self.faults.len() < MAX_FAULTS {
            self.faults.push(Fault::new(place, message));
        }
    }

    /// Whether something at or beneath `place` was found faulty.
    #[must_use]
    pub fn is_faulty(&self, place: &str) -> bool {
        self.faults.iter().any(|fault| {
            fault.place.strip_prefix(place).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
        })
    }

    /// Reads `value`, which stands at `place`, noting every fault. The answer may lack the optional parts that
    /// were faulty, and is `None` when a needed part is, or once there are [`MAX_FAULTS`]: whoever sends a document of faults is not read
    /// to its end.
    pub fn read<T: DeserializeOwned>(&mut self, mut value: Value, place: &str) -> Option<T> {
        let mut removed = Vec::new();
        // Each turn takes a part out, so the loop ends.
        loop {
            if self.faults.len() >= MAX_FAULTS {
                return None;
            }
            let error = match serde_path_to_error::deserialize(&value) {
                Ok(read) => return Some(read),
                Err(error) => error,
            };
            let mut path = keys(&value, error.path());
            let message = error.inner().to_string();
            match Complaint::parse(&message) {
                Complaint::MissingKey { key } => {
                    path.push(key.to_owned());
                    if !removed.contains(&path) {
                        path.pop();
                        self.fault(join(place, &path), format!("the key `{key}` is missing"));
                    }
                    return None;
                }
                Complaint::UnknownKey { key, allowed } => {
                    if path.last().is_none_or(|last| last != key) {
                        path.push(key.to_owned());
                    }
                    self.fault(join(place, &path), unknown("key", key, &allowed));
                }
                Complaint::Other { message } => self.fault(join(place, &path), message),
            }
            removed.push(remove(&mut value, path)?);
        }
    }

    /// Takes the object at `place` apart.
    pub fn object(&mut self, value: Value, place: &str) -> Option<Fields> {
        match value {
            Value::Object(values) => Some(Fields { place: place.to_owned(), values, known: Vec::new() }),
            other => {
                self.fault(place, format!("expected an object, got {}", name_of(&other)));
                None
            }
        }
    }

    /// Takes a list at `place` apart into its elements and their places; an absent list is empty. Elements
    /// beyond `most` are a fault and are not read.
    pub fn list(&mut self, field: Option<(Value, String)>, most: usize) -> Vec<(Value, String)> {
        let Some((value, place)) = field else { return Vec::new() };
        match value {
            Value::Array(elements) => {
                if elements.len() > most {
                    self.fault(place.clone(), format!("at most {most} are allowed, got {}", elements.len()));
                }
                let placed = |(i, element)| (element, format!("{place}/{i}"));
                elements.into_iter().take(most).enumerate().map(placed).collect()
            }
            other => {
                self.fault(place, format!("expected a list, got {}", name_of(&other)));
                Vec::new()
            }
        }
    }
}

impl Fields {
    /// The value at `key` and its place, if it is there.
    pub fn take(&mut self, key: &'static str) -> Option<(Value, String)> {
        self.known.push(key);
        self.values.remove(key).map(|value| (value, pointer_to(&self.place, key)))
    }

    /// As [`Self::take`]; that the key is absent is a fault.
    pub fn require(&mut self, key: &'static str, gatherer: &mut Gatherer) -> Option<(Value, String)> {
        let field = self.take(key);
        if field.is_none() {
            gatherer.fault(self.place.clone(), format!("the key `{key}` is missing"));
        }
        field
    }

    /// Notes every key that was never asked for, as many as are told of a document.
    pub fn finish(self, gatherer: &mut Gatherer) {
        for key in self.values.keys().take(MAX_FAULTS) {
            gatherer.fault(pointer_to(&self.place, key), unknown("key", key, &self.known));
        }
    }
}

/// What people call a value's type.
fn name_of(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

/// The keys and indices that lead to a fault, as far as they lead through `value`.
fn keys(value: &Value, path: &serde_path_to_error::Path) -> Vec<String> {
    let mut keys = Vec::new();
    let mut node = Some(value);
    for segment in path {
        let (key, next) = match segment {
            Segment::Map { key } => (key.clone(), node.and_then(|node| node.get(key))),
            Segment::Seq { index } => (index.to_string(), node.and_then(|node| node.get(index))),
            Segment::Enum { .. } | Segment::Unknown => break,
        };
        keys.push(key);
        node = next;
    }
    keys
}

fn join(place: &str, keys: &[String]) -> String {
    keys.iter().fold(place.to_owned(), |pointer, key| pointer_to(&pointer, key))
}

/// Takes the faulty part out: the innermost key on the way to it, for to shorten a list would renumber it.
/// Answers the path of what was taken out, or `None` when there is nothing to take.
fn remove(value: &mut Value, mut path: Vec<String>) -> Option<Vec<String>> {
    while let Some(key) = path.pop() {
        if let Some(Value::Object(parent)) = value.pointer_mut(&join("", &path)) {
            parent.remove(&key)?;
            path.push(key);
            return Some(path);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::{Clock, SystemClock};
    use serde::Deserialize;
    use serde_json::json;
    use std::time::Duration;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Thing {
        needed: u32,
        #[serde(default)]
        size: [f64; 2],
        #[serde(default)]
        mode: Mode,
        #[serde(default)]
        shape: Shape,
    }

    thread_local! {
        /// Times that a [`Counted`] was read.
        static N_READS: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
    }

    /// A document without members that counts how often it is read.
    #[derive(Debug)]
    struct Counted;

    impl<'de> Deserialize<'de> for Counted {
        fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            #[derive(Deserialize)]
            #[serde(deny_unknown_fields)]
            struct Empty {}

            N_READS.set(N_READS.get() + 1);
            Empty::deserialize(deserializer).map(|Empty {}| Self)
        }
    }

    #[test]
    fn a_document_is_read_no_more_often_than_faults_are_told() {
        let members: Map<String, Value> =
            (0..20_000).map(|number| (format!("x{number}"), json!(1))).collect();
        let mut gatherer = Gatherer::default();
        assert!(gatherer.read::<Counted>(Value::Object(members.clone()), "").is_none());
        assert_eq!(gatherer.faults().len(), MAX_FAULTS);
        assert!(N_READS.get() <= MAX_FAULTS, "{} times", N_READS.get());
        // Nothing of a later part of such a document is read.
        N_READS.set(0);
        assert!(gatherer.read::<Counted>(Value::Object(members), "/next").is_none());
        assert_eq!(N_READS.get(), 0);
    }

    #[derive(Debug, Default, PartialEq, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Mode {
        #[default]
        Stop,
        Loop,
    }

    #[derive(Debug, Default, PartialEq, Deserialize)]
    #[serde(tag = "model", rename_all = "lowercase", deny_unknown_fields)]
    enum Shape {
        #[default]
        Point,
        Disc {
            radius: f64,
        },
    }

    fn check(value: Value, expected: &[(&str, &str)]) -> Option<Thing> {
        let mut gatherer = Gatherer::default();
        let read = gatherer.read(value, "/at");
        let faults: Vec<_> =
            gatherer.faults().iter().map(|f| (f.place.as_str(), f.message.as_str())).collect();
        assert_eq!(faults, expected);
        read
    }

    #[test]
    fn a_faultless_value_is_read() {
        let thing = check(json!({"needed": 1, "size": [1, 2.5], "mode": "loop"}), &[]).expect("a thing");
        assert_eq!((thing.needed, thing.size, thing.mode), (1, [1.0, 2.5], Mode::Loop));
    }

    #[test]
    fn every_fault_is_found() {
        let faults = [
            ("/at/mode", "unknown value `lop`; did you mean `loop`? allowed: stop, loop"),
            ("/at/needed", "wrong type: string \"x\", expected a whole number, 0 or more"),
        ];
        assert_eq!(check(json!({"needed": "x", "mode": "lop"}), &faults), None);
        let faults = [
            ("/at/siz", "unknown key `siz`; did you mean `size`? allowed: needed, size, mode, shape"),
            ("/at/size/1", "wrong type: null, expected a number"),
        ];
        let read = check(json!({"needed": 3, "siz": 2, "size": [1, null]}), &faults).expect("a thing");
        assert_eq!(read.size, [0.0, 0.0], "a faulty optional part is left out");
    }

    #[test]
    fn a_missing_key_is_said_once() {
        check(json!({}), &[("/at", "the key `needed` is missing")]);
        check(json!({"size": [1, 2]}), &[("/at", "the key `needed` is missing")]);
        check(
            json!({"needed": 1, "shape": {"model": "disc"}}),
            &[("/at/shape", "the key `radius` is missing")],
        );
        check(json!(3), &[("/at", "wrong type: integer `3`, expected a table for Thing")]);
    }

    #[test]
    fn keys_inside_tagged_values_are_named() {
        check(
            json!({"needed": 1, "shape": {"model": "disc", "radius": 1, "radios": 2}}),
            &[("/at/shape/radios", "unknown key `radios`; did you mean `radius`? allowed: radius")],
        );
        check(
            json!({"needed": 1, "shape": {"model": "disk"}}),
            &[("/at/shape/model", "unknown value `disk`; did you mean `disc`? allowed: point, disc")],
        );
    }

    #[test]
    fn keys_that_nobody_is_told_of_are_not_looked_at() {
        let members: Map<String, Value> =
            (0..200_000).map(|number| (format!("{number:060}"), json!(1))).collect();
        let mut gatherer = Gatherer::default();
        let mut fields = gatherer.object(Value::Object(members), "").expect("an object");
        for key in ["version", "name", "cameras", "ground", "boxes", "cylinders", "footprints", "entities"] {
            assert_eq!(fields.take(key), None);
        }
        let clock = SystemClock::new();
        // Each would be compared with all that are known.
        fields.finish(&mut gatherer);
        assert_eq!(gatherer.faults().len(), MAX_FAULTS);
        assert!(clock.monotonic() < Duration::from_secs(2), "{:?}", clock.monotonic());
    }

    #[test]
    fn pointers_are_escaped_and_faults_are_bounded() {
        assert_eq!(pointer_to("/a", "b/c~d"), "/a/b~1c~0d");
        let mut object: Map<String, Value> = (0..200).map(|i| (format!("k/{i}"), json!(0))).collect();
        object.insert("needed".to_owned(), json!(1));
        let mut gatherer = Gatherer::default();
        gatherer.read::<Thing>(Value::Object(object), "");
        assert_eq!(gatherer.faults().len(), MAX_FAULTS);
    }

    #[test]
    fn an_object_is_taken_apart() {
        let mut gatherer = Gatherer::default();
        let mut fields =
            gatherer.object(json!({"name": "x", "nam": 1, "list": [1, 2, 3]}), "").expect("an object");
        assert_eq!(fields.take("name"), Some((json!("x"), "/name".to_owned())));
        assert_eq!(fields.require("version", &mut gatherer), None);
        let list = fields.take("list");
        assert_eq!(
            gatherer.list(list, 2),
            [(json!(1), "/list/0".to_owned()), (json!(2), "/list/1".to_owned())]
        );
        fields.finish(&mut gatherer);
        assert_eq!(gatherer.object(json!([]), "/x").map(|_| ()), None);
        let said: Vec<_> = gatherer.faults().iter().map(ToString::to_string).collect();
        assert_eq!(
            said,
            [
                "(document): the key `version` is missing",
                "/list: at most 2 are allowed, got 3",
                "/nam: unknown key `nam`; did you mean `name`? allowed: name, version, list",
                "/x: expected an object, got a list",
            ]
        );
        assert!(gatherer.is_faulty("/list") && gatherer.is_faulty("") && !gatherer.is_faulty("/li"));
    }
}
