//! The tree that all three syntaxes are read into, and how numbers and matrices are taken from it.
//!
//! A node knows its line where the syntax tells; a [`Place`] knows its JSON pointer. Knows nothing of cameras.

use crate::calibrate::CalibrateError;
use crate::calibrate::json::escaped;

/// Most numbers that a matrix may have.
const MAX_VALUES: usize = 4096;

/// A value of the text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) line: Option<usize>,
    pub(super) content: Content,
}

/// What a value is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    Scalar(String),
    List(Vec<Node>),
    Map(Vec<(String, Node)>),
}

/// A node and how to get there.
#[derive(Clone, Debug)]
pub(super) struct Place<'a> {
    pub(super) pointer: String,
    node: &'a Node,
}

/// Numbers in rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Matrix {
    pub(super) n_rows: usize,
    pub(super) n_columns: usize,
    /// Row-major; finite.
    pub(super) values: Vec<f64>,
}

/// A name without case and punctuation.
pub(super) fn plain(name: &str) -> String {
    name.chars().filter(char::is_ascii_alphanumeric).map(|c| c.to_ascii_lowercase()).collect()
}

impl<'a> Place<'a> {
    pub(super) const fn root(node: &'a Node) -> Self {
        Self { pointer: String::new(), node }
    }

    /// The first member whose [`plain`] name is one of `names`, the earlier names first.
    pub(super) fn find(&self, names: &[&str]) -> Option<Self> {
        let Content::Map(members) = &self.node.content else { return None };
        let (key, node) =
            names.iter().find_map(|name| members.iter().find(|(key, _)| plain(key) == *name))?;
        Some(self.at(key, node))
    }

    /// The members of a map or the elements of a list, with their names or indices; of a scalar none.
    pub(super) fn members(&self) -> Vec<(String, Self)> {
        match &self.node.content {
            Content::Map(members) => {
                members.iter().map(|(key, node)| (key.clone(), self.at(key, node))).collect()
            }
            Content::List(elements) => {
                let keyed = elements.iter().enumerate().map(|(idx, node)| (idx.to_string(), node));
                keyed.map(|(key, node)| (key.clone(), self.at(&key, node))).collect()
            }
            Content::Scalar(_) => Vec::new(),
        }
    }

    fn at(&self, key: &str, node: &'a Node) -> Self {
        Self { pointer: format!("{}/{}", self.pointer, escaped(key)), node }
    }

    /// A scalar's text.
    pub(super) fn text(&self) -> Option<String> {
        match &self.node.content {
            Content::Scalar(text) => Some(text.clone()),
            _ => None,
        }
    }

    /// A scalar that is a finite number.
    pub(super) fn number(&self) -> Result<f64, CalibrateError> {
        let number = self.text().and_then(|text| text.trim().parse().ok());
        number.filter(|number: &f64| number.is_finite()).ok_or_else(|| self.fault("must be a finite number"))
    }

    /// `number` as a count of pixels.
    pub(super) fn whole(&self, number: f64) -> Result<u32, CalibrateError> {
        if number.fract() == 0.0 && (1.0..=65_536.0).contains(&number) {
            return Ok(number as u32);
        }
        Err(self.fault("must be a whole number of pixels, 1 to 65536"))
    }

    /// A `FileStorage` matrix (`rows`, `cols`, `data`), a list of rows, or a list of numbers (one column).
    pub(super) fn matrix(&self) -> Result<Matrix, CalibrateError> {
        match &self.node.content {
            Content::Map(_) => self.storage_matrix(),
            Content::List(rows) if rows.iter().any(|row| matches!(row.content, Content::List(_))) => {
                let rows: Vec<_> =
                    self.members().iter().map(|(_, row)| row.numbers()).collect::<Result<_, _>>()?;
                let n_columns = rows[0].len();
                if rows.iter().any(|row| row.len() != n_columns) {
                    return Err(self.fault("its rows differ in length"));
                }
                Ok(Matrix { n_rows: rows.len(), n_columns, values: rows.concat() })
            }
            _ => {
                let values = self.numbers()?;
                Ok(Matrix { n_rows: values.len(), n_columns: 1, values })
            }
        }
    }

    fn storage_matrix(&self) -> Result<Matrix, CalibrateError> {
        let member = |name: &str| {
            self.find(&[name])
                .ok_or_else(|| self.fault(&format!("a matrix needs rows, cols and data; {name} is missing")))
        };
        let side = |name: &str| {
            let place = member(name)?;
            let number = place.number()?;
            if number.fract() == 0.0 && (0.0..=MAX_VALUES as f64).contains(&number) {
                return Ok(number as usize);
            }
            Err(place.fault(&format!("must be a whole number, 0 to {MAX_VALUES}")))
        };
        let (n_rows, n_columns) = (side("rows")?, side("cols")?);
        let data = member("data")?;
        let values = data.numbers()?;
        if values.len() != n_rows * n_columns {
            let expected = n_rows * n_columns;
            return Err(data.fault(&format!(
                "expected {n_rows} x {n_columns} = {expected} numbers, got {}",
                values.len()
            )));
        }
        Ok(Matrix { n_rows, n_columns, values })
    }

    /// The numbers of a list, or of a text with spaces between them as `FileStorage` writes XML.
    fn numbers(&self) -> Result<Vec<f64>, CalibrateError> {
        let numbers: Vec<_> = match &self.node.content {
            Content::List(elements) if elements.len() <= MAX_VALUES => {
                self.members().iter().map(|(_, element)| element.number()).collect::<Result<_, _>>()?
            }
            Content::Scalar(text) => {
                let tokens = text.split_ascii_whitespace().take(MAX_VALUES + 1).map(str::parse::<f64>);
                tokens
                    .collect::<Result<Vec<_>, _>>()
                    .ok()
                    .filter(|numbers| {
                        numbers.len() <= MAX_VALUES && numbers.iter().all(|number| number.is_finite())
                    })
                    .ok_or_else(|| self.fault("must be finite numbers"))?
            }
            _ => return Err(self.fault(&format!("must be a list of at most {MAX_VALUES} numbers"))),
        };
        Ok(numbers)
    }

    /// A fault here.
    pub(super) fn fault(&self, message: &str) -> CalibrateError {
        let line = self.node.line.map(|line| format!(" (line {line})")).unwrap_or_default();
        CalibrateError::invalid(self.pointer.clone(), format!("{message}{line}"))
    }
}
