//! XML of strangers: bounded, without entities, names without their prefixes, text without what a terminal would act upon.

use super::OnvifError;
use roxmltree::{Document, Node, ParsingOptions};

/// Most elements, attributes and texts of a document; a device with thirty profiles has about five thousand.
const MAX_NODES: u32 = 50_000;

/// Reads a document. Document types, and with them entities, are refused.
///
/// # Errors
/// When it is not well-formed, or has too much in it.
pub(super) fn read(text: &str) -> Result<Document<'_>, OnvifError> {
    let options = ParsingOptions { nodes_limit: MAX_NODES, allow_dtd: false, ..ParsingOptions::default() };
    // Some devices end what they say as a text in C.
    let text = text.trim_matches(|letter: char| letter == '\0' || letter.is_whitespace());
    Document::parse_with_options(text, options).map_err(|error| {
        tracing::debug!(at = %error.pos(), "a device's XML is not understood");
        OnvifError::NotUnderstood
    })
}

/// Returns the children of that name, whatever their prefix.
pub(super) fn children<'a, 'i>(node: Node<'a, 'i>, name: &'a str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// Returns what lies at the end of a path of names.
pub(super) fn at<'a, 'i>(node: Node<'a, 'i>, path: &[&'a str]) -> Option<Node<'a, 'i>> {
    path.iter().try_fold(node, |node, name| children(node, name).next())
}

/// Returns the text of an element at the end of a path, without blanks around it; none where it is empty.
pub(super) fn text_at<'a>(node: Node<'a, '_>, path: &[&'a str]) -> Option<&'a str> {
    at(node, path).and_then(|found| found.text()).map(str::trim).filter(|text| !text.is_empty())
}

/// Returns at most so many letters of a text, without those that steer a terminal or turn the direction of writing.
pub(super) fn shown(text: &str, max_letters: usize) -> String {
    let is_shown = |letter: &char| {
        !letter.is_control()
            && !matches!(letter, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
    };
    text.trim().chars().filter(is_shown).take(max_letters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefixes_and_what_surrounds_a_document_do_not_matter() {
        for text in [
            "<a xmlns='x'><b>\n one </b><c/></a>",
            "\n<?xml version='1.0'?><p:a xmlns:p='x'><q:b xmlns:q='y'>one</q:b></p:a>\0\0",
            "\u{feff}<a><z/><b>one</b><b>two</b></a>",
        ] {
            let document = read(text).unwrap();
            assert_eq!(text_at(document.root_element(), &["b"]), Some("one"), "{text:?}");
            assert_eq!(text_at(document.root_element(), &["c"]), None);
        }
    }

    #[test]
    fn bombs_are_refused() {
        let entities = "<!DOCTYPE a [<!ENTITY x 'xxxxxxxx'><!ENTITY y '&x;&x;&x;'>]><a>&y;</a>";
        let outside = "<!DOCTYPE a SYSTEM 'http://10.0.0.1/a.dtd'><a/>";
        let deep = format!("{}{}", "<a>".repeat(200_000), "</a>".repeat(200_000));
        let many = format!("<a>{}</a>", "<b/>".repeat(60_000));
        for text in [entities, outside, &deep, &many, "<a>&y;</a>", "<a>", "", "{}"] {
            let found = read(text);
            let start: String = text.chars().take(40).collect();
            assert!(matches!(found, Err(OnvifError::NotUnderstood)), "{start}");
        }
        assert!(read(&format!("{}{}", "<a>".repeat(20_000), "</a>".repeat(20_000))).is_ok());
    }

    #[test]
    fn what_steers_a_terminal_is_left_out() {
        assert_eq!(shown(" Gate\u{1b}[2J\r\n\u{202e}1\u{200b} ", 99), "Gate[2J1");
        assert_eq!(shown("Türkamera", 3), "Tür");
    }
}
