//! An instant of all cameras, associated and timed, and held against who is there in truth.
//!
//! Owns one association of a scene, and which row an entity counts in; the arithmetic is `score`'s.

use super::score::{FoundPlace, PlacingScore, TruePlace};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::Duration;
use videofields::commands::complain;
use videofields_picture::fuse::{
    Entity, FootSighting, Placing, SceneState, calibration_offsets, foot_sightings, with_offsets,
};
use videofields_picture::occupancy::Occupancy;
use videofields_picture::scene::Scene;
use videofields_simulate::ActorKind;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;

/// Kinds of figures, each a row of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    /// Somebody on foot.
    #[default]
    Walker,
    /// Somebody on a bicycle.
    Cyclist,
    /// A car or van.
    Car,
}

impl Kind {
    /// Its plural for people.
    pub(super) const fn plural(self) -> &'static str {
        match self {
            Self::Walker => "people",
            Self::Cyclist => "cyclists",
            Self::Car => "cars",
        }
    }
}

impl From<ActorKind> for Kind {
    fn from(kind: ActorKind) -> Self {
        match kind {
            ActorKind::Walker => Self::Walker,
            ActorKind::Cyclist => Self::Cyclist,
            ActorKind::Car => Self::Car,
        }
    }
}

/// Somebody or something that moves, where it truly is at an instant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Figure {
    pub(super) id: u64,
    pub(super) kind: Kind,
    pub(super) foot_in_world: DVec3,
    /// Low and high corner of the rectangle along the world's axes that it covers on the ground, metres.
    pub(super) ground_m: [DVec2; 2],
    /// Says whether a camera shows it.
    pub(super) is_seen: bool,
}

impl Figure {
    fn place(&self) -> TruePlace {
        let foot = self.foot_in_world.truncate();
        let [low_m, high_m] = if self.kind == Kind::Walker { [foot, foot] } else { self.ground_m };
        TruePlace { id: self.id, low_m, high_m, is_scored: self.is_seen }
    }
}

/// Method by which people are placed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Method {
    /// By each camera's blobs, joined afterwards.
    Association,
    /// By all cameras' masks together; knows nothing of who is who.
    Occupancy,
    /// By all cameras' masks together where several see somebody, by each camera's blobs elsewhere: as the daemon does.
    Both,
}

/// A scene's instants, associated and scored one after the other.
pub(super) struct Judge<'a> {
    clock: &'a dyn Clock,
    gate_m: f64,
    placing: Placing,
    /// None but where people are placed by occupancy alone.
    occupancy: Option<Occupancy>,
    /// Places of the instant by occupancy, each with a number that is given once.
    placed: Vec<FoundPlace>,
    n_placed: u64,
    /// Scores by kind of figure, of those that there ever were.
    scores: BTreeMap<Kind, PlacingScore>,
    placing_ms: Vec<f64>,
    n_instants: usize,
    /// Feet that cameras saw while they learned; none where their calibrations are taken as they are.
    learned: Option<HashMap<CameraId, Vec<FootSighting>>>,
}

impl<'a> Judge<'a> {
    pub(super) fn new(clock: &'a dyn Clock, gate_m: f64, method: Method) -> Self {
        Self {
            clock,
            gate_m,
            placing: if method == Method::Both { Placing::default() } else { Placing::by_blobs() },
            occupancy: (method == Method::Occupancy).then(Occupancy::default),
            placed: Vec::new(),
            n_placed: 0,
            scores: [(Kind::Walker, PlacingScore::new(gate_m))].into(),
            placing_ms: Vec::new(),
            n_instants: 0,
            learned: None,
        }
    }

    /// Has cameras corrected by what they see while they learn.
    pub(super) fn correcting(self) -> Self {
        Self { learned: Some(HashMap::new()), ..self }
    }

    /// Tells that cameras are corrected by what they see while they learn.
    pub(super) const fn corrects(&self) -> bool {
        self.learned.is_some()
    }

    /// Takes what a camera sees while it learns.
    pub(super) fn learn(&mut self, seen: &Observation) {
        if let Some(learned) = &mut self.learned {
            let kept = learned.entry(seen.frame.camera.clone()).or_default();
            kept.extend(foot_sightings(seen));
        }
    }

    /// Corrects the cameras of `scene` by what they saw while they learned, and prints by how much.
    pub(super) fn correct(&mut self, scene: &Arc<Scene>) {
        let Some(learned) = &self.learned else { return };
        let of = |id: &CameraId| learned.get(id).map_or(&[] as &[FootSighting], Vec::as_slice);
        let seen: Vec<&[FootSighting]> = scene.cameras.iter().map(|member| of(&member.id)).collect();
        let started = self.clock.monotonic();
        let offsets = calibration_offsets(scene, &seen);
        let took = self.clock.monotonic().saturating_sub(started);
        complain(&format!("calibrations compared in {:.1} ms", took.as_secs_f64() * 1000.0));
        for ((member, offset), seen) in scene.cameras.iter().zip(&offsets).zip(&seen) {
            let n_sightings = seen.len();
            complain(&match offset {
                None => format!("{}: {n_sightings} sightings, nobody whom others saw too", member.id),
                Some(of) => format!(
                    "{}: {n_sightings} sightings, {} paths, {:.3} +- {:.3} m off, {:.3} m from others, {:.3} m corrected{}",
                    member.id,
                    of.n_paths,
                    of.offset_m,
                    of.error_m,
                    of.apart_m[0],
                    of.apart_m[1],
                    if of.is_used() { "" } else { ", not used" }
                ),
            });
        }
        self.placing.correct(scene, with_offsets(scene, &offsets).map(Arc::new));
    }

    /// Puts together what the cameras saw, and takes the time that it needs.
    pub(super) fn place(
        &mut self,
        scene: &Arc<Scene>,
        instant: Timestamp,
        seen: &[Observation],
    ) -> SceneState {
        let find = |id: &CameraId| seen.iter().find(|of| of.frame.camera == *id).cloned();
        let started = self.clock.monotonic();
        let state = self.placing.assemble(scene, instant, find);
        let took = match self.occupancy.take() {
            Some(occupancy) => self.place_by(occupancy, scene, seen),
            None => self.clock.monotonic().saturating_sub(started),
        };
        self.placing_ms.push(took.as_secs_f64() * 1000.0);
        state
    }

    /// Places people by occupancy; the time that it takes.
    fn place_by(&mut self, mut occupancy: Occupancy, scene: &Arc<Scene>, seen: &[Observation]) -> Duration {
        let started = self.clock.monotonic();
        let people = occupancy.find(
            scene,
            |idx| {
                let of = seen.iter().find(|of| of.frame.camera == scene.cameras[idx].id);
                of.map(|of| of.labels.as_ref())
            },
            &[],
        );
        let took = self.clock.monotonic().saturating_sub(started);
        self.occupancy = Some(occupancy);
        let places = people.iter().map(|person| person.foot_in_world.truncate());
        self.placed = places.zip(self.n_placed..).map(|(place_m, id)| FoundPlace { id, place_m }).collect();
        self.n_placed += self.placed.len() as u64;
        took
    }

    /// Scores the entities of a state against the figures of its instant.
    pub(super) fn score(&mut self, state: &SceneState, figures: &[Figure]) {
        let mut rows: BTreeMap<Kind, (Vec<TruePlace>, Vec<FoundPlace>)> =
            self.scores.keys().map(|kind| (*kind, Default::default())).collect();
        for figure in figures {
            rows.entry(figure.kind).or_default().0.push(figure.place());
        }
        let found = match &self.occupancy {
            Some(_) => std::mem::take(&mut self.placed),
            None => state.entities.iter().map(place_of).collect(),
        };
        for of in found {
            rows.entry(row_of(of.place_m, figures, self.gate_m)).or_default().1.push(of);
        }
        for (kind, (truths, found)) in rows {
            let score = self.scores.entry(kind).or_insert_with(|| PlacingScore::new(self.gate_m));
            score.add(&truths, &found);
        }
        self.n_instants += 1;
    }

    pub(super) const fn scores(&self) -> &BTreeMap<Kind, PlacingScore> {
        &self.scores
    }

    /// Time of placing at each instant, milliseconds.
    pub(super) fn placing_ms(&self) -> &[f64] {
        &self.placing_ms
    }

    pub(super) const fn n_instants(&self) -> usize {
        self.n_instants
    }
}

fn place_of(entity: &Entity) -> FoundPlace {
    FoundPlace { id: entity.id, place_m: entity.foot_in_world.truncate() }
}

/// The row in which an entity counts, found or false: that of the nearest figure within the gate, or else of people.
fn row_of(place_m: DVec2, figures: &[Figure], gate_m: f64) -> Kind {
    let near = figures.iter().map(|figure| (figure.place().distance_m(place_m), figure.kind));
    let nearest = near.filter(|(distance_m, _)| *distance_m <= gate_m).min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map_or(Kind::Walker, |(_, kind)| kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entity_counts_with_whom_it_is_nearest() {
        let figure = |id: u64, kind: Kind, x: f64, half_m: f64| Figure {
            id,
            kind,
            foot_in_world: DVec3::new(x, 0.0, 0.0),
            ground_m: [DVec2::new(x - half_m, -half_m), DVec2::new(x + half_m, half_m)],
            is_seen: true,
        };
        let figures = [figure(1, Kind::Walker, 0.0, 0.3), figure(2, Kind::Car, 5.0, 2.0)];
        let row = |x: f64| row_of(DVec2::new(x, 0.0), &figures, 0.5);
        assert_eq!(row(0.4), Kind::Walker);
        assert_eq!(row(3.5), Kind::Car, "within the car");
        assert_eq!(row(2.6), Kind::Car, "by the car's edge");
        assert_eq!(row(2.4), Kind::Walker, "by nobody");
        // People are met at their foot, not anywhere that their arms reach.
        assert_eq!(figures[0].place().distance_m(DVec2::new(0.3, 0.0)), 0.3);
    }
}
