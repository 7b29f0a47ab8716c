//! What may stand in a request's query and path: of every parameter its name, its meaning and what is allowed, in one
//! place. Routes read by these lists ([`Query::parse`](super::query::Query::parse)), and the contract is written of them
//! ([`openapi`](super::openapi)), so it lists exactly what a route takes.

use serde_json::{Value, json};
use std::ops::RangeInclusive;

/// What names of cameras, scenes, walls, users and the like look like.
pub(super) const ID_PATTERN: &str = "^[a-z0-9][a-z0-9_-]{0,63}$";

/// Several of them with commas between.
pub(super) const IDS_PATTERN: &str = "^[a-z0-9][a-z0-9_-]{0,63}(,[a-z0-9][a-z0-9_-]{0,63})*$";

/// Three and nine numbers within [`MAX_COORDINATE_M`](super::query::MAX_COORDINATE_M), as far as a pattern can say it.
const POINT_PATTERN: &str = r"^[-+]?[0-9]{1,8}(\.[0-9]{1,17})?([eE]-[0-9]{1,2})?(,[-+]?[0-9]{1,8}(\.[0-9]{1,17})?([eE]-[0-9]{1,2})?){2}$";
const POINTS_PATTERN: &str = r"^[-+]?[0-9]{1,8}(\.[0-9]{1,17})?([eE]-[0-9]{1,2})?(,[-+]?[0-9]{1,8}(\.[0-9]{1,17})?([eE]-[0-9]{1,2})?){8}$";

/// A parameter of a query, or a named segment of a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameter {
    pub(super) name: &'static str,
    pub(super) meaning: &'static str,
    shape: Shape,
    pub(super) is_required: bool,
    /// What holds where it is left out, as a query would say it.
    default: Option<&'static str>,
}

/// What a parameter's value may be.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Whole(u64, u64),
    Number(f64, f64),
    /// One of a few words.
    Word(fn() -> Vec<&'static str>),
    /// `true` or `false`.
    Flag,
    /// One of a few files.
    File(fn() -> Vec<String>),
    Id,
    Instant,
    Moment,
    /// Any text of so many characters.
    Free(usize, usize),
    /// Text of that pattern, and one that is allowed.
    Text(&'static str, &'static str),
}

/// What a query may have, by its name.
pub(super) trait Named {
    fn name(&self) -> &str;
}

impl Named for Parameter {
    fn name(&self) -> &str {
        self.name
    }
}

/// Of routes that are not described yet.
impl Named for &str {
    fn name(&self) -> &str {
        self
    }
}

impl Parameter {
    const fn new(name: &'static str, shape: Shape, meaning: &'static str) -> Self {
        Self { name, meaning, shape, is_required: false, default: None }
    }

    /// A whole number within `range`.
    pub(super) const fn whole(
        name: &'static str,
        range: &RangeInclusive<u64>,
        meaning: &'static str,
    ) -> Self {
        Self::new(name, Shape::Whole(*range.start(), *range.end()), meaning)
    }

    /// A number within `range`.
    pub(super) const fn number(
        name: &'static str,
        range: &RangeInclusive<f64>,
        meaning: &'static str,
    ) -> Self {
        Self::new(name, Shape::Number(*range.start(), *range.end()), meaning)
    }

    /// One of a few words.
    pub(super) const fn word(
        name: &'static str,
        words: fn() -> Vec<&'static str>,
        meaning: &'static str,
    ) -> Self {
        Self::new(name, Shape::Word(words), meaning)
    }

    /// `true` or `false`, which is meant where it is left out.
    pub(super) const fn flag(name: &'static str, meaning: &'static str) -> Self {
        Self::new(name, Shape::Flag, meaning).default_is("false")
    }

    /// One of a few files.
    pub(super) const fn files(name: &'static str, files: fn() -> Vec<String>, meaning: &'static str) -> Self {
        Self::new(name, Shape::File(files), meaning)
    }

    /// A point in the world: three numbers of metres with commas between.
    pub(super) const fn point(name: &'static str, meaning: &'static str) -> Self {
        Self::text(name, (POINT_PATTERN, "12,-18,7"), meaning)
    }

    /// Three points in the world: nine numbers of metres with commas between.
    pub(super) const fn points(name: &'static str, meaning: &'static str) -> Self {
        Self::text(name, (POINTS_PATTERN, "-1,3,0,1,3,0,-1,3,1.5"), meaning)
    }

    /// The id of something.
    pub(super) const fn id(name: &'static str, meaning: &'static str) -> Self {
        Self::new(name, Shape::Id, meaning)
    }

    /// An instant: RFC 3339, or nanoseconds since 1970.
    pub(super) const fn instant(name: &'static str, meaning: &'static str) -> Self {
        Self::new(name, Shape::Instant, meaning)
    }

    /// Which time is asked for: `live`, an instant or a playhead.
    pub(super) const fn moment(name: &'static str, meaning: &'static str) -> Self {
        Self::new(name, Shape::Moment, meaning).default_is("live")
    }

    /// Any text of so many characters, least and most.
    pub(super) const fn free(
        name: &'static str,
        (least, most): (usize, usize),
        meaning: &'static str,
    ) -> Self {
        Self::new(name, Shape::Free(least, most), meaning)
    }

    /// Text that a regular expression describes, with an example.
    pub(super) const fn text(
        name: &'static str,
        (pattern, example): (&'static str, &'static str),
        meaning: &'static str,
    ) -> Self {
        Self::new(name, Shape::Text(pattern, example), meaning)
    }

    /// One that must come.
    pub(super) const fn required(self) -> Self {
        Self { is_required: true, ..self }
    }

    /// What holds where it is left out, as a query would say it.
    pub(super) const fn default_is(self, text: &'static str) -> Self {
        Self { default: Some(text), ..self }
    }

    /// Returns whether it names a time that is looked at.
    #[cfg(test)]
    pub(super) const fn is_time(&self) -> bool {
        matches!(self.shape, Shape::Instant | Shape::Moment)
    }

    /// Returns whether it names something.
    #[cfg(test)]
    pub(super) const fn is_id(&self) -> bool {
        matches!(self.shape, Shape::Id)
    }

    /// Its JSON Schema.
    pub(super) fn schema(&self) -> Value {
        let mut schema = match self.shape {
            Shape::Whole(least, most) => json!({"type": "integer", "minimum": least, "maximum": most}),
            Shape::Number(least, most) => json!({"type": "number", "minimum": least, "maximum": most}),
            Shape::Word(words) => {
                let words = words();
                let numbers: Option<Vec<u64>> = words.iter().map(|word| word.parse().ok()).collect();
                match numbers {
                    Some(numbers) => json!({"type": "integer", "enum": numbers}),
                    None => json!({"type": "string", "enum": words}),
                }
            }
            Shape::Flag => json!({"type": "boolean"}),
            Shape::File(files) => json!({"type": "string", "enum": files()}),
            Shape::Id => json!({"type": "string", "pattern": ID_PATTERN}),
            Shape::Instant => json!({"$ref": "#/components/schemas/Instant"}),
            Shape::Moment => json!({"$ref": "#/components/schemas/Moment"}),
            Shape::Free(least, most) => json!({"type": "string", "minLength": least, "maxLength": most}),
            Shape::Text(pattern, example) => {
                json!({"type": "string", "pattern": pattern, "examples": [example]})
            }
        };
        if let Some(default) = self.default {
            let is_text = schema["type"] == "string" || schema["$ref"].is_string();
            let value = if is_text { None } else { serde_json::from_str(default).ok() };
            schema["default"] = value.unwrap_or_else(|| json!(default));
        }
        schema
    }
}

/// The words of choices that routes read.
pub(super) fn words<T>(choices: &[(&'static str, T)]) -> Vec<&'static str> {
    choices.iter().map(|(word, _)| *word).collect()
}

/// No parameters.
pub(super) const NONE: &[Parameter] = &[];
