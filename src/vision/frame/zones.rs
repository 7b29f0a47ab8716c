//! Privacy zones: parts of a camera's picture that nobody may see, and what of a picture of some size they cover.
//!
//! Polygons in texture coordinates flow in, checked once; out comes a [`ZoneMask`] for a picture size, which fills what it
//! covers with one flat colour. What a zone hid once is gone from that picture: nothing here can bring it back.

mod mask;
mod shape;

pub use mask::{NEUTRAL_YUV, ZoneMask};

use crate::error::Gatherer;
use serde::{Deserialize, Serialize};

/// Most zones of one camera.
pub const MAX_ZONES: usize = 32;

/// Fewest and most corners of a zone.
const ZONE_CORNERS: [usize; 2] = [3, 64];

/// Least area of a zone, share of the picture: less is a slip, not a zone.
const LEAST_AREA: f64 = 1e-7;

const MAX_NAME_CHARS: usize = 100;
const MAX_REASON_CHARS: usize = 1000;

/// A part of a camera's picture that nobody may see.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// What it is called: 1 to 100 characters, none of them a control character; no two of a camera's alike.
    pub name: String,
    /// Why it is hidden, for whoever asks later: 1 to 1000 characters.
    pub reason: String,
    /// Its corners in texture coordinates, 3 to 64, each within [0, 1]; the last is joined to the first. Its sides may
    /// not cross one another.
    pub polygon: Vec<[f64; 2]>,
}

impl Zone {
    /// Whether a texture coordinate lies in it.
    #[must_use]
    pub fn holds(&self, texture: [f64; 2]) -> bool {
        polygon_holds(&self.polygon, texture)
    }
}

/// Whether a texture coordinate lies in a zone of these corners.
#[must_use]
pub fn polygon_holds(polygon: &[[f64; 2]], texture: [f64; 2]) -> bool {
    shape::holds(polygon, texture)
}

/// Checks a camera's zones; what is wrong is noted at its place beneath `place`, a JSON pointer.
pub fn check_zones(zones: &[Zone], place: &str, gatherer: &mut Gatherer) {
    if zones.len() > MAX_ZONES {
        gatherer.fault(place, format!("at most {MAX_ZONES} zones are allowed, got {}", zones.len()));
    }
    for (idx, zone) in zones.iter().enumerate() {
        let at = |key: &str| format!("{place}/{idx}/{key}");
        check_text(&zone.name, MAX_NAME_CHARS, &at("name"), gatherer);
        check_text(&zone.reason, MAX_REASON_CHARS, &at("reason"), gatherer);
        if zones[..idx].iter().any(|other| other.name == zone.name) {
            gatherer.fault(at("name"), format!("there is another zone {:?}; names are unique", zone.name));
        }
        check_polygon(&zone.polygon, &at("polygon"), gatherer);
    }
}

fn check_text(text: &str, most: usize, place: &str, gatherer: &mut Gatherer) {
    let is_good = (1..=most).contains(&text.chars().count()) && !text.chars().any(char::is_control);
    if !is_good || text.trim().is_empty() {
        let message = format!("expected 1 to {most} characters, none of them a control character");
        gatherer.fault(place, message);
    }
}

fn check_polygon(polygon: &[[f64; 2]], place: &str, gatherer: &mut Gatherer) {
    let [least, most] = ZONE_CORNERS;
    if !(least..=most).contains(&polygon.len()) {
        gatherer.fault(place, format!("expected {least} to {most} corners, got {}", polygon.len()));
        return;
    }
    for (idx, corner) in polygon.iter().enumerate() {
        // Written so that NaN is outside.
        if !corner.iter().all(|value| (0.0..=1.0).contains(value)) {
            let message = format!(
                "expected two numbers from 0 to 1 (texture coordinates), got {}, {}",
                corner[0], corner[1]
            );
            gatherer.fault(format!("{place}/{idx}"), message);
            return;
        }
    }
    if let Some([one, other]) = shape::crossing_sides(polygon) {
        let message =
            format!("the sides that begin at corners {one} and {other} cross: split it into several zones");
        gatherer.fault(place, message);
    } else if shape::area(polygon) < LEAST_AREA {
        gatherer.fault(place, "its corners lie on a line: it covers nothing");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(name: &str, polygon: &[[f64; 2]]) -> Zone {
        Zone { name: name.to_owned(), reason: "a neighbour's window".to_owned(), polygon: polygon.to_vec() }
    }

    const SQUARE: [[f64; 2]; 4] = [[0.25, 0.25], [0.5, 0.25], [0.5, 0.5], [0.25, 0.5]];

    fn faults(zones: &[Zone]) -> Vec<String> {
        let mut gatherer = Gatherer::default();
        check_zones(zones, "/zones", &mut gatherer);
        gatherer.into_faults().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_is_no_zone_is_told_at_its_place() {
        let check = |zones: &[Zone], expected: &[&str]| {
            let told = faults(zones);
            assert_eq!(told.len(), expected.len(), "{told:?}");
            for (told, expected) in told.iter().zip(expected) {
                assert!(told.starts_with(expected), "{told}, not {expected}");
            }
        };
        check(&[zone("window", &SQUARE), zone("door", &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])], &[]);
        check(&[zone("window", &SQUARE), zone("window", &SQUARE)], &["/zones/1/name: there is another"]);
        check(&[zone(" ", &SQUARE)], &["/zones/0/name: expected 1 to 100"]);
        check(
            &[Zone { reason: String::new(), ..zone("window", &SQUARE) }],
            &["/zones/0/reason: expected 1 to 1000"],
        );
        check(&[zone("a", &SQUARE[..2])], &["/zones/0/polygon: expected 3 to 64 corners, got 2"]);
        check(&[zone("a", &[[0.5; 2]; 65])], &["/zones/0/polygon: expected 3 to 64 corners, got 65"]);
        for outside in [-0.001, 1.001, f64::NAN, f64::INFINITY] {
            let polygon = [SQUARE[0], [outside, 0.5], SQUARE[2]];
            check(&[zone("a", &polygon)], &["/zones/0/polygon/1: expected two numbers"]);
        }
        let bow = [[0.1, 0.1], [0.9, 0.9], [0.9, 0.1], [0.1, 0.9]];
        check(&[zone("a", &bow)], &["/zones/0/polygon: the sides that begin at corners 0 and 2 cross"]);
        let line = [[0.1, 0.1], [0.5, 0.5], [0.9, 0.9]];
        check(&[zone("a", &line)], &["/zones/0/polygon: its corners lie on a line"]);
        let many: Vec<_> = (0..33).map(|idx| zone(&format!("zone {idx}"), &SQUARE)).collect();
        check(&many, &["/zones: at most 32 zones"]);
        check(&many[..32], &[]);
    }
}
