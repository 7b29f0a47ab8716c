//! The paths of a world document's actors, and how they are travelled.

use super::super::actor::{Ending, Motion, MotionFault, Pace, Path, Posture, Stop};
use super::reader::{Reader, two};
use serde::Deserialize;
use std::sync::Arc;
use videofields_vision::error::pointer_to;

const MAX_CORNERS: usize = 512;
const MAX_STOPS: usize = 64;

/// A path as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PathDocument {
    corners_m: Vec<[f64; 2]>,
    #[serde(default = "PathDocument::closed")]
    closed: bool,
    #[serde(default)]
    laps: Option<u32>,
    #[serde(default)]
    speed_m_per_sec: Option<f64>,
    #[serde(default)]
    pub(super) stops: Vec<StopDocument>,
    #[serde(default)]
    acceleration_m_per_sec2: Option<f64>,
    #[serde(default)]
    start_secs: f64,
    #[serde(default)]
    start_share: f64,
    #[serde(default)]
    end: EndDocument,
}

impl PathDocument {
    const fn closed() -> bool {
        true
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StopDocument {
    at_m: f64,
    secs: f64,
    #[serde(default)]
    posture: Posture,
}

#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum EndDocument {
    #[default]
    Repeat,
    Stay,
    Leave,
}

/// What an actor moves on.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Legs {
    Two,
    /// Wheels.
    None,
}

/// The movement that `path` of the actor at `place` describes.
pub(super) fn motion(
    document: PathDocument,
    place: &str,
    legs: Legs,
    period_secs: Option<f64>,
    reader: &mut Reader<'_>,
) -> Option<Motion> {
    let place = pointer_to(place, "path");
    let place = place.as_str();
    let path = path(&document, place, reader)?;
    let length = path.length_m();
    let n_faults = reader.gatherer.faults().len();
    reader.number(place, "start_secs", document.start_secs, -1e6..=1e6, "seconds");
    reader.number(place, "start_share", document.start_share, 0.0..=1.0, "");
    let stops = stops(&document.stops, length, place, reader);
    for (i, _) in
        stops.iter().enumerate().filter(|(_, stop)| legs == Legs::None && stop.posture == Posture::Sit)
    {
        let place = format!("{}/{i}", pointer_to(place, "stops"));
        reader.fault(pointer_to(&place, "posture"), "only walkers sit down");
    }
    if let Some(acceleration) = document.acceleration_m_per_sec2 {
        if legs == Legs::Two {
            reader
                .fault(pointer_to(place, "acceleration_m_per_sec2"), "walkers start and stop within a step");
        }
        reader.number(
            place,
            "acceleration_m_per_sec2",
            acceleration,
            0.05..=100.0,
            "metres a second squared",
        );
    }
    if document.end != EndDocument::Repeat && document.laps.is_some() {
        reader.fault(pointer_to(place, "end"), "with `laps` a path is repeated");
    }
    let pace = match (document.laps, document.speed_m_per_sec, period_secs) {
        (None, Some(speed), _) => {
            reader.number(place, "speed_m_per_sec", speed, 0.01..=100.0, "metres a second");
            Pace::Speed(speed)
        }
        (Some(laps), None, Some(period_secs)) => {
            reader.number(place, "laps", f64::from(laps), 1.0..=10_000.0, "");
            Pace::Round(period_secs / f64::from(laps.max(1)))
        }
        (Some(_), None, None) => {
            reader.fault(pointer_to(place, "laps"), "needs the world's `period_secs`");
            return None;
        }
        _ => {
            reader.fault(place, "expected either `speed_m_per_sec` or `laps` (rounds in the world's period)");
            return None;
        }
    };
    if reader.gatherer.faults().len() > n_faults {
        return None;
    }
    let acceleration = document.acceleration_m_per_sec2.unwrap_or(f64::INFINITY);
    let ending = match document.end {
        EndDocument::Repeat => Ending::Repeat,
        EndDocument::Stay => Ending::Stay,
        EndDocument::Leave => Ending::Leave,
    };
    match Motion::new(Arc::new(path), pace, &stops, acceleration, ending) {
        Ok(motion) => {
            let motion = motion.started(document.start_secs, document.start_share);
            Some(document.laps.map_or_else(|| motion.clone(), |laps| motion.clone().lapping(f64::from(laps))))
        }
        Err(MotionFault::NoTime) => {
            reader.fault(pointer_to(place, "stops"), "take longer than a round does");
            None
        }
        Err(MotionFault::TooSlow) => {
            let message = "is too low: no speed completes a round in its time";
            reader.fault(pointer_to(place, "acceleration_m_per_sec2"), message);
            None
        }
    }
}

fn path(document: &PathDocument, place: &str, reader: &mut Reader<'_>) -> Option<Path> {
    let list = pointer_to(place, "corners_m");
    let corners = &document.corners_m;
    let least = if document.closed { 3 } else { 2 };
    if !(least..=MAX_CORNERS).contains(&corners.len()) {
        let kind = if document.closed { "a closed path" } else { "an open path" };
        reader.fault(list, format!("{kind} has {least} to {MAX_CORNERS} corners, got {}", corners.len()));
        return None;
    }
    for (i, corner) in corners.iter().enumerate() {
        if corner.iter().any(|value| value.abs() > 1e8) {
            reader.fault(format!("{list}/{i}"), "expected numbers within 1e8 of the origin (metres)");
            return None;
        }
        let before =
            if i > 0 { Some(corners[i - 1]) } else { document.closed.then(|| corners[corners.len() - 1]) };
        if before.is_some_and(|before| (two(before) - two(*corner)).length() < 0.01) {
            reader.fault(format!("{list}/{i}"), "must be at least 1 cm from the corner before it");
            return None;
        }
    }
    let points = corners.iter().copied().map(two).collect();
    let path = if document.closed { Path::closed(points) } else { Path::open(points) };
    if path.is_none() {
        reader.fault(list, "the path has no length");
    }
    path
}

fn stops(documents: &[StopDocument], length: f64, place: &str, reader: &mut Reader<'_>) -> Vec<Stop> {
    let list = pointer_to(place, "stops");
    if documents.len() > MAX_STOPS {
        reader.fault(list, format!("at most {MAX_STOPS} are allowed, got {}", documents.len()));
        return Vec::new();
    }
    let mut before = 0.0;
    for (i, stop) in documents.iter().enumerate() {
        let place = format!("{list}/{i}");
        reader.number(&place, "secs", stop.secs, 0.05..=1e6, "seconds");
        if !(before + 0.5..=length - 0.5).contains(&stop.at_m) {
            let message = format!(
                "expected a place half a metre from the one before it and from both ends, up to {:.2} m",
                length - 0.5
            );
            reader.fault(pointer_to(&place, "at_m"), message);
        }
        before = stop.at_m;
    }
    let stop = |stop: &StopDocument| Stop { at_m: stop.at_m, secs: stop.secs, posture: stop.posture };
    documents.iter().map(stop).collect()
}
