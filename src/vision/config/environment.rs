//! Environment variables `VIDEOFIELDS_SECTION__KEY` laid over the file's sections.
//!
//! Credentials, cameras, scenes and snapshots are lists and are written in the file alone.

use super::document::{Document, scalar_value};
use crate::error::{Gatherer, unknown};
use serde_json::Value;
use std::ffi::OsString;
use toml::de::DeValue;

const PREFIX: &str = "VIDEOFIELDS_";
const SECTIONS: [&str; 10] = [
    "server",
    "storage",
    "archive",
    "media",
    "timeline",
    "entities",
    "render",
    "accuracy",
    "log",
    "telemetry",
];

/// Keys whose values are text as they stand: a GPU may be called "4090".
const TEXTS: [&str; 14] = [
    "server.listen",
    "server.certificate",
    "server.private_key",
    "storage.database",
    "storage.snapshot_folder",
    "storage.audit_key",
    "storage.audit_key_before",
    "storage.audit_head",
    "storage.audit_anchor_url",
    "archive.folder",
    "render.adapter",
    "log.format",
    "telemetry.otlp_endpoint",
    "telemetry.service_name",
];

/// Lays the variables over the document. Variables without the prefix, or without `__` after it (such as
/// `VIDEOFIELDS_LOG`), are other people's.
pub(super) fn overlay(
    document: &mut Document,
    variables: impl IntoIterator<Item = (OsString, OsString)>,
    gatherer: &mut Gatherer,
) {
    let mut ours: Vec<_> = variables
        .into_iter()
        .filter_map(|(name, value)| {
            let name = name.into_string().ok()?;
            let (section, key) = name.strip_prefix(PREFIX)?.split_once("__")?;
            Some((section.to_lowercase(), key.to_lowercase(), name.clone(), value))
        })
        .collect();
    // The environment has no order; faults are told in one.
    ours.sort();
    for (section, key, variable, value) in ours {
        let place = format!("/{section}/{key}");
        if matches!(section.as_str(), "credentials" | "camera" | "scene" | "snapshot") {
            document.note_variable(place.clone(), &variable);
            gatherer.fault(
                place,
                "credentials, cameras, scenes and snapshots are written in the file, not in the environment",
            );
        } else if !SECTIONS.contains(&section.as_str()) {
            document.note_variable(place.clone(), &variable);
            gatherer.fault(place, unknown("section", &section, &SECTIONS));
        } else if let Ok(text) = value.into_string() {
            let value = parse(&format!("{section}.{key}"), text);
            document.overlay(&section, &key, value, &variable);
        } else {
            document.note_variable(place.clone(), &variable);
            gatherer.fault(place, "the value must be UTF-8");
        }
    }
}

/// A TOML value where the text is one, else the text itself.
fn parse(path: &str, text: String) -> Value {
    if TEXTS.contains(&path) {
        return Value::String(text);
    }
    let Ok(value) = DeValue::parse(&text) else { return Value::String(text) };
    let read = match value.get_ref() {
        DeValue::Array(elements) => elements.iter().map(|element| scalar_value(element.get_ref())).collect(),
        scalar => scalar_value(scalar),
    };
    read.unwrap_or(Value::String(text))
}
