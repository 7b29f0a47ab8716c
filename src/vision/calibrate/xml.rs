//! XML as hostile input is read: bounded, without entities, faults with line and column.
//!
//! Knows none of the formats that are written in it.

use super::CalibrateError;
use roxmltree::{Document, Node, ParsingOptions};

/// Most elements, attributes and texts that are read; an honest file has a dozen.
const MAX_NODES: u32 = 100_000;

/// The document; entities by which a short text stands for a huge one are refused.
pub(super) fn parse(text: &str) -> Result<Document<'_>, CalibrateError> {
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| {
        let at = error.pos();
        CalibrateError::Syntax { line: at.row.into(), column: at.col.into(), message: error.to_string() }
    })
}

/// Ends of a text's lines: to count them anew for each element would cost the square of the text's length.
pub(super) struct Lines(Vec<usize>);

impl Lines {
    pub(super) fn of(text: &str) -> Self {
        Self(text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at).collect())
    }

    /// Line of an element, from 1.
    pub(super) fn at(&self, node: Node<'_, '_>) -> usize {
        self.0.partition_point(|end| *end < node.range().start) + 1
    }
}

/// Line of an element, from 1.
pub(super) fn line_of(node: Node<'_, '_>) -> u32 {
    node.document().text_pos_at(node.range().start).row
}
