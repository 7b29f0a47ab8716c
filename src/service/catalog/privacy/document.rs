//! Zones as JSON.

use super::CatalogError;
use crate::engine::LiftedZone;
use serde::{Deserialize, Serialize};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::Zone;

/// A lifted zone as it is written.
#[derive(Debug, Deserialize, Serialize)]
struct Lifted {
    zone: Zone,
    /// RFC 3339.
    until: String,
}

pub(super) fn zones_to_json(zones: &[Zone]) -> Result<String, CatalogError> {
    serde_json::to_string(zones).map_err(|error| CatalogError::Internal(format!("writing zones: {error}")))
}

pub(super) fn zones_from_json(text: &str) -> Result<Vec<Zone>, CatalogError> {
    serde_json::from_str(text).map_err(|error| unreadable(&error))
}

pub(super) fn lifted_to_json(lifted: &[LiftedZone]) -> Result<String, CatalogError> {
    let written = |of: &LiftedZone| Lifted { zone: of.zone.clone(), until: of.until.to_string() };
    let lifted: Vec<Lifted> = lifted.iter().map(written).collect();
    serde_json::to_string(&lifted).map_err(|error| CatalogError::Internal(format!("writing zones: {error}")))
}

pub(super) fn lifted_from_json(text: &str) -> Result<Vec<LiftedZone>, CatalogError> {
    let lifted: Vec<Lifted> = serde_json::from_str(text).map_err(|error| unreadable(&error))?;
    let read = |Lifted { zone, until }: Lifted| {
        let until = until.parse::<Timestamp>().map_err(|error| unreadable(&error))?;
        Ok(LiftedZone { zone, until })
    };
    lifted.into_iter().map(read).collect()
}

fn unreadable(error: &dyn std::error::Error) -> CatalogError {
    CatalogError::Internal(format!("kept privacy zones cannot be read: {error}"))
}

/// The zones' names, for a log.
pub(super) fn in_words(zones: &[Zone]) -> String {
    let names: Vec<&str> = zones.iter().map(|zone| zone.name.as_str()).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
