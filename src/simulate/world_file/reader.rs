//! What every part of a world document is read with: ranges, points, ids, kinds, each fault at its place.

use glam::{DVec2, DVec3};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::HashSet;
use std::ops::RangeInclusive;
use videofields_vision::error::{Gatherer, pointer_to, unknown};
use videofields_vision::frame::{IdError, is_id};
use videofields_vision::geometry::SurfaceError;

/// Farthest from the origin that anything may be, metres.
const FARTHEST_M: f64 = 1e8;

/// A value and its place in the document.
pub(super) type Placed = (Value, String);

/// Reads values and notes faults.
pub(super) struct Reader<'a> {
    pub(super) gatherer: &'a mut Gatherer,
}

impl Reader<'_> {
    pub(super) fn fault(&mut self, place: impl Into<String>, message: impl Into<String>) {
        self.gatherer.fault(place, message);
    }

    /// The value as a `T`, whose numbers the caller still has to judge.
    pub(super) fn read<T: DeserializeOwned>(&mut self, (value, place): Placed) -> Option<T> {
        self.gatherer.read(value, &place)
    }

    /// Takes `kind` out of an object: which of `kinds` it is, by its index, and the rest.
    pub(super) fn kind(
        &mut self,
        (value, place): Placed,
        kinds: &[&'static str],
    ) -> Option<(&'static str, Placed)> {
        let Value::Object(mut fields) = value else {
            self.fault(place, "expected an object");
            return None;
        };
        let at = pointer_to(&place, "kind");
        match fields.remove("kind") {
            Some(Value::String(kind)) => match kinds.iter().find(|known| **known == kind) {
                Some(known) => Some((known, (Value::Object(fields), place))),
                None => {
                    self.fault(at, unknown("value", &kind, kinds));
                    None
                }
            },
            Some(_) => {
                self.fault(at, format!("expected one of {}", kinds.join(", ")));
                None
            }
            None => {
                self.fault(place, format!("the key `kind` is missing; allowed: {}", kinds.join(", ")));
                None
            }
        }
    }

    /// Whether a number is in its range.
    pub(super) fn number(
        &mut self,
        place: &str,
        key: &str,
        value: f64,
        range: RangeInclusive<f64>,
        unit: &str,
    ) -> bool {
        let is_in = range.contains(&value);
        if !is_in {
            let (least, most) = range.into_inner();
            let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
            self.fault(pointer_to(place, key), format!("expected {least} to {most}{unit}, got {value}"));
        }
        is_in
    }

    /// Whether a place is near enough to the origin.
    pub(super) fn place(&mut self, place: &str, key: &str, at: &[f64]) -> bool {
        let is_near = at.iter().all(|value| value.abs() <= FARTHEST_M);
        if !is_near {
            let message = format!("expected numbers within {FARTHEST_M:e} of the origin (metres)");
            self.fault(pointer_to(place, key), message);
        }
        is_near
    }

    /// A direction as a unit vector.
    pub(super) fn direction(&mut self, place: &str, key: &str, direction: [f64; 3]) -> Option<DVec3> {
        let unit = DVec3::from_array(direction).try_normalize();
        if unit.is_none() {
            self.fault(pointer_to(place, key), "expected a direction of finite length above 0");
        }
        unit
    }

    /// Notes an id that is none or that was met before.
    pub(super) fn id(&mut self, place: &str, id: &str, what: &str, known: &mut HashSet<String>) -> bool {
        let at = pointer_to(place, "id");
        if !is_id(id) {
            let shown: String = id.chars().take(70).collect();
            self.fault(at, format!("invalid id {shown:?}: {IdError}"));
            return false;
        }
        if !known.insert(id.to_owned()) {
            self.fault(at, format!("there is another {what} `{id}`; ids are unique"));
            return false;
        }
        true
    }

    /// A name for people.
    pub(super) fn name(&mut self, placed: Placed) -> Option<String> {
        let place = placed.1.clone();
        let name: String = self.read(placed)?;
        if !(1..=200).contains(&name.chars().count()) || name.chars().any(char::is_control) {
            self.fault(place, "expected 1 to 200 characters, none of them a control character");
            return None;
        }
        Some(name)
    }

    /// Notes why numbers are no surface, at the key that is to blame.
    pub(super) fn surface(&mut self, place: &str, error: &SurfaceError, keys: [&str; 3]) {
        let [shape, middle, turn] = keys;
        let key = match error {
            SurfaceError::NotFinite { field: "the yaw" } => turn,
            SurfaceError::NotFinite { field: "the center" | "the height" } => middle,
            _ => shape,
        };
        self.fault(pointer_to(place, key), error.to_string());
    }
}

/// Two numbers as a place.
pub(super) const fn two(at: [f64; 2]) -> DVec2 {
    DVec2::from_array(at)
}

/// Three numbers as a place.
pub(super) const fn three(at: [f64; 3]) -> DVec3 {
    DVec3::from_array(at)
}
