//! A TOML file as a tree of values that remembers where each was written.

use super::MAX_FILE_BYTES;
use super::error::{ConfigError, ConfigFault, Origin, dotted};
use crate::error::{Fault, MAX_FAULTS, pointer_to};
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Longest pointer within which values have places of their own; no setting's is half as long. Whatever stands deeper has the place of what
/// is around it: a short text with a long key would take gigabytes of pointers.
const MAX_POINTER_BYTES: usize = 256;

/// A parsed file.
#[derive(Debug)]
pub(super) struct Document {
    file: PathBuf,
    text: String,
    /// Where each pointer's value was written.
    origins: HashMap<String, Written>,
    tree: Value,
}

#[derive(Debug)]
enum Written {
    Bytes(Range<usize>),
    Variable(String),
}

/// Reads a file's text, refusing what cannot be a configuration before it is read.
pub(super) fn read_text(path: &Path) -> Result<String, ConfigError> {
    let unreadable = |source| ConfigError::Unreadable { path: path.to_owned(), source };
    // Asked by name first: to open a named pipe would wait for a writer.
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        let what = if metadata.is_dir() { "a directory" } else { "a device, pipe or socket" };
        return Err(ConfigError::NotAFile { path: path.to_owned(), what });
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(unreadable)?;
    file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        return Err(ConfigError::TooLarge { path: path.to_owned() });
    }
    String::from_utf8(bytes).map_err(|error| {
        let readable = error.utf8_error().valid_up_to();
        let text = String::from_utf8_lossy(&error.as_bytes()[..readable]).into_owned();
        let message = "the file must be UTF-8, but a byte here is not".to_owned();
        ConfigError::Faults(vec![ConfigFault {
            origin: origin_at(path, &text, readable),
            path: String::new(),
            message,
        }])
    })
}

impl Document {
    /// Parses TOML; every syntax fault is reported.
    pub(super) fn parse(text: &str, file: &Path) -> Result<Self, ConfigError> {
        let mut document =
            Self { file: file.to_owned(), text: text.to_owned(), origins: HashMap::new(), tree: Value::Null };
        let (table, errors) = DeTable::parse_recoverable(text);
        let mut faults: Vec<ConfigFault> = errors
            .iter()
            .take(MAX_FAULTS)
            .map(|error| document.fault_at(error.span().unwrap_or(0..0), "", error.message().to_owned()))
            .collect();
        // What was recovered after a syntax fault is guesswork: its keys are not judged.
        if faults.is_empty() {
            document.tree = document.table(table.into_inner(), "", &mut faults);
        }
        if faults.is_empty() { Ok(document) } else { Err(ConfigError::Faults(faults)) }
    }

    /// Hands the tree out; where its values were written stays here.
    pub(super) fn take_tree(&mut self) -> Value {
        std::mem::take(&mut self.tree)
    }

    /// Puts a variable's value in a section, over the file's.
    pub(super) fn overlay(&mut self, section: &str, key: &str, value: Value, variable: &str) {
        let Value::Object(sections) = &mut self.tree else { return };
        let section_value = sections.entry(section).or_insert_with(|| Value::Object(Map::new()));
        // A section that is no table is a fault of the file, and is found there.
        let Value::Object(keys) = section_value else { return };
        keys.insert(key.to_owned(), value);
        let pointer = pointer_to(&pointer_to("", section), key);
        self.note_variable(pointer, variable);
    }

    /// Notes that what stands at `pointer` was written in a variable.
    pub(super) fn note_variable(&mut self, pointer: String, variable: &str) {
        self.origins.insert(pointer, Written::Variable(variable.to_owned()));
    }

    /// The fault with the place where it was written: its own, or that of the nearest table around it.
    pub(super) fn locate(&self, fault: &Fault) -> ConfigFault {
        let mut pointer = fault.place.as_str();
        loop {
            match self.origins.get(pointer) {
                Some(Written::Bytes(span)) => {
                    return self.fault_at(span.clone(), &fault.place, fault.message.clone());
                }
                Some(Written::Variable(variable)) => {
                    return ConfigFault {
                        origin: Origin::Environment { variable: variable.clone() },
                        path: dotted(&fault.place),
                        message: fault.message.clone(),
                    };
                }
                None => {}
            }
            let Some(parent) = pointer.rfind('/') else {
                return self.fault_at(0..0, &fault.place, fault.message.clone());
            };
            pointer = &pointer[..parent];
        }
    }

    fn fault_at(&self, span: Range<usize>, place: &str, message: String) -> ConfigFault {
        ConfigFault { origin: origin_at(&self.file, &self.text, span.start), path: dotted(place), message }
    }

    /// Notes where a value within `place` was written, and returns its pointer.
    fn noted<'a>(&mut self, place: &'a str, key: &str, span: Range<usize>) -> Cow<'a, str> {
        if place.len() > MAX_POINTER_BYTES {
            return Cow::Borrowed(place);
        }
        let pointer = pointer_to(place, key);
        self.origins.insert(pointer.clone(), Written::Bytes(span));
        Cow::Owned(pointer)
    }

    fn table(&mut self, table: DeTable<'_>, place: &str, faults: &mut Vec<ConfigFault>) -> Value {
        let mut values = Map::new();
        for (key, value) in table {
            let pointer = self.noted(place, key.get_ref(), key.span());
            let value = self.value(value, &pointer, faults);
            values.insert(key.into_inner().into_owned(), value);
        }
        Value::Object(values)
    }

    fn value(&mut self, value: Spanned<DeValue<'_>>, place: &str, faults: &mut Vec<ConfigFault>) -> Value {
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => self.table(table, place, faults),
            DeValue::Array(elements) => {
                let mut values = Vec::new();
                for (i, element) in elements.into_iter().enumerate() {
                    let pointer = self.noted(place, &i.to_string(), element.span());
                    values.push(self.value(element, &pointer, faults));
                }
                Value::Array(values)
            }
            scalar => scalar_value(&scalar).unwrap_or_else(|message| {
                if faults.len() < MAX_FAULTS {
                    faults.push(self.fault_at(span, place, message.to_owned()));
                }
                Value::Null
            }),
        }
    }
}

/// A number, text, truth value or date as JSON has them.
pub(super) fn scalar_value(scalar: &DeValue<'_>) -> Result<Value, &'static str> {
    match scalar {
        DeValue::String(text) => Ok(Value::String(text.to_string())),
        DeValue::Boolean(truth) => Ok(Value::Bool(*truth)),
        DeValue::Datetime(instant) => Ok(Value::String(instant.to_string())),
        DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
            .map(Value::from)
            .map_err(|_too_large: std::num::ParseIntError| "a whole number has at most 63 bits"),
        DeValue::Float(number) => number
            .as_str()
            .parse()
            .ok()
            .and_then(serde_json::Number::from_f64)
            .map(Value::Number)
            .ok_or("expected a finite number"),
        DeValue::Array(_) | DeValue::Table(_) => Err("expected a single value"),
    }
}

fn origin_at(file: &Path, text: &str, byte: usize) -> Origin {
    let before = text.get(..byte).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
    Origin::File {
        file: file.to_owned(),
        line: before.bytes().filter(|byte| *byte == b'\n').count() + 1,
        column: before[line_start..].chars().count() + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_key_does_not_take_the_square_of_its_length() {
        let text = format!("\"{}\" = [{}]\n[a]\nb = [1]\n", "k".repeat(10_000), "0,".repeat(10_000));
        let document = Document::parse(&text, Path::new("a.toml")).unwrap();
        let n_bytes: usize = document.origins.keys().map(String::len).sum();
        assert!(n_bytes < 2 * text.len(), "{n_bytes} of pointers for {} of text", text.len());
        let of = |place: &str| document.locate(&Fault::new(place, "x")).to_string();
        let deep = of(&format!("/{}/7", "k".repeat(10_000)));
        assert!(deep.starts_with("a.toml:1:1: "), "{}", &deep[..20]);
        assert_eq!(of("/a/b/0"), "a.toml:3:6: a.b[0]: x");
    }
}
