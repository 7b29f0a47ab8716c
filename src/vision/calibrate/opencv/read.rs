//! The three syntaxes of `OpenCV`'s files, each into the one tree.
//!
//! Input is hostile until read: nesting is bounded, and YAML's aliases, by which a short text stands for a huge
//! one, are refused (`FileStorage` never writes them). Knows nothing of cameras.

use super::node::{Content, Node};
use crate::calibrate::CalibrateError;
use crate::calibrate::xml::{Lines, parse};
use crate::error::Fault;
use saphyr_parser::{Event, Parser};

/// Deepest nesting; a list of cameras with matrices of rows needs 5.
const MAX_DEPTH: usize = 32;

pub(super) fn tree(text: &str) -> Result<Node, CalibrateError> {
    match text.trim_start().chars().next() {
        Some('<') => xml(text),
        Some('{' | '[') => json(text),
        _ => yaml(text),
    }
}

fn too_deep() -> CalibrateError {
    CalibrateError::invalid("", format!("nested more than {MAX_DEPTH} deep"))
}

fn json(text: &str) -> Result<Node, CalibrateError> {
    let value = serde_json::from_str(text).map_err(|error| CalibrateError::Syntax {
        line: error.line() as u64,
        column: error.column() as u64,
        message: error.to_string(),
    })?;
    from_json(value, 0)
}

fn from_json(value: serde_json::Value, depth: usize) -> Result<Node, CalibrateError> {
    use serde_json::Value;
    if depth > MAX_DEPTH {
        return Err(too_deep());
    }
    let content = match value {
        Value::Null => Content::Scalar(String::new()),
        Value::Bool(flag) => Content::Scalar(u8::from(flag).to_string()),
        Value::Number(number) => Content::Scalar(number.to_string()),
        Value::String(text) => Content::Scalar(text),
        Value::Array(elements) => Content::List(
            elements.into_iter().map(|element| from_json(element, depth + 1)).collect::<Result<_, _>>()?,
        ),
        Value::Object(members) => Content::Map(
            members
                .into_iter()
                .map(|(key, member)| Ok((key, from_json(member, depth + 1)?)))
                .collect::<Result<_, CalibrateError>>()?,
        ),
    };
    Ok(Node { line: None, content })
}

fn xml(text: &str) -> Result<Node, CalibrateError> {
    let document = parse(text)?;
    from_xml(document.root_element(), &Lines::of(document.input_text()), 0)
}

/// An element with elements is a map, or a list where they are `FileStorage`'s `_`; any other is its text.
fn from_xml(element: roxmltree::Node<'_, '_>, lines: &Lines, depth: usize) -> Result<Node, CalibrateError> {
    if depth > MAX_DEPTH {
        return Err(too_deep());
    }
    let line = Some(lines.at(element));
    let mut members = element
        .children()
        .filter(roxmltree::Node::is_element)
        .map(|child| Ok((child.tag_name().name().to_owned(), from_xml(child, lines, depth + 1)?)))
        .collect::<Result<Vec<_>, CalibrateError>>()?;
    let content = if members.is_empty() {
        Content::Scalar(element.text().unwrap_or_default().trim().to_owned())
    } else if members.iter().all(|(name, _)| name == "_") {
        Content::List(members.drain(..).map(|(_, node)| node).collect())
    } else {
        Content::Map(members)
    };
    Ok(Node { line, content })
}

/// A list or map that is still being read.
struct Open {
    node: Node,
    /// The member's name that was read before its value.
    key: Option<String>,
}

fn yaml(text: &str) -> Result<Node, CalibrateError> {
    // `FileStorage` opens with %YAML:1.0, which is no directive of any YAML; as a comment it keeps the lines' count.
    let comment = text.trim_start().strip_prefix('%').map(|rest| format!("#{rest}"));
    let mut stack: Vec<Open> = Vec::new();
    let mut root = None;
    for event in Parser::new_from_str(comment.as_deref().unwrap_or(text)) {
        let (event, span) = event.map_err(|error| CalibrateError::Syntax {
            line: error.marker().line() as u64,
            column: error.marker().col() as u64 + 1,
            message: error.info().to_owned(),
        })?;
        let line = Some(span.start.line());
        let complete = match event {
            Event::Alias(_) => {
                let message = format!("aliases are not supported (line {})", span.start.line());
                return Err(CalibrateError::Unsupported(Fault::new("", message)));
            }
            Event::SequenceStart(..) | Event::MappingStart(..) if stack.len() >= MAX_DEPTH => {
                return Err(too_deep());
            }
            Event::SequenceStart(..) => {
                stack.push(Open { node: Node { line, content: Content::List(Vec::new()) }, key: None });
                continue;
            }
            Event::MappingStart(..) => {
                stack.push(Open { node: Node { line, content: Content::Map(Vec::new()) }, key: None });
                continue;
            }
            Event::Scalar(text, ..) => Node { line, content: Content::Scalar(text.into_owned()) },
            Event::SequenceEnd | Event::MappingEnd => match stack.pop() {
                Some(open) => open.node,
                None => continue,
            },
            _ => continue,
        };
        match stack.last_mut() {
            Some(open) => take(open, complete)?,
            None if root.is_some() => {
                return Err(CalibrateError::invalid("", "holds more than one document"));
            }
            None => root = Some(complete),
        }
    }
    root.ok_or_else(|| CalibrateError::invalid("", "is empty"))
}

/// Puts a value that was read into the list or map around it.
fn take(open: &mut Open, value: Node) -> Result<(), CalibrateError> {
    match &mut open.node.content {
        Content::List(elements) => elements.push(value),
        Content::Map(members) => match (open.key.take(), value.content) {
            (Some(key), content) => members.push((key, Node { line: value.line, content })),
            (None, Content::Scalar(key)) => open.key = Some(key),
            (None, _) => return Err(CalibrateError::invalid("", "a member's name must be a text")),
        },
        Content::Scalar(_) => {}
    }
    Ok(())
}
