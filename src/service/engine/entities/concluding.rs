//! Concludes who was where in five minutes that are over, from the tracks that each camera kept, and keeps it.

use super::gathered::{GONE_NANOS, record};
use super::pieces::{Piece, divide};
use super::recall::{Asked, MAX_ROWS, Sighting, instants, sightings};
use crate::engine::EngineError;
use crate::engine::past::Past;
use crate::engine::privacy::Privacy;
use crate::engine::shared::{CameraEntry, Shared};
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use videofields_picture::fuse::{EntityPath, Part, PartOf, Stand, join, middle_of, stand_at};
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::ingest::CameraState;
use videofields_recording::store::{EntityRecord, SpanChange, TrackRecord};
use videofields_vision::clock::Timestamp;
use videofields_vision::mapping;
use videofields_vision::track::{FootPath, PathError};

/// Tracks that are put together at once at most; of more, the latest.
const MAX_TRACKS: usize = 4096;

/// Tracks are written when they end, and while they go on every minute: what is as long ago is told by them.
const SETTLED_NANOS: i64 = 70_000_000_000;

/// Height of whom no camera shows from foot to head, metres, and which heights are told.
const USUAL_M: f64 = 1.7;
const HEIGHTS_M: [f64; 2] = [0.3, 3.0];

/// A camera whose newest frame is this much older than another's is not waited for.
const LAG_NANOS: i64 = 600_000_000_000;

/// A track, in the world.
struct PlacedTrack {
    /// Places of its feet, metres: in parts, where a zone hides them in between.
    parts: Vec<Vec<(Timestamp, DVec3)>>,
    /// Height, about, metres; none where its camera does not tell it.
    height_m: Option<f64>,
}

/// Somebody in a time that is concluded.
struct Sighted {
    /// Number among the people that were put together.
    person: usize,
    /// Number of the part of the time.
    piece: usize,
    /// The id that they are known by.
    known: Option<u64>,
    path: EntityPath,
    height_m: f64,
}

impl Shared {
    /// Concludes who was where in whole five minutes, as far as nothing is kept of them, and keeps it.
    pub(super) fn conclude(&self, asked: &Asked<'_>, (first, last): Piece) -> Result<(), EngineError> {
        let Asked { past, scene, set, .. } = asked;
        let wide = (first.saturating_sub(GONE_NANOS), last.saturating_add(GONE_NANOS));
        let spans = past.entity_spans(set, instants(wide))?;
        let (_, unknown) = divide(instants((first, last)), &spans);
        if unknown.is_empty() {
            return Ok(());
        }
        let (known, _) = divide(instants(wide), &spans);
        let mut parts = known_parts(past, &scene.id, &known)?;
        let mut heights = BTreeMap::new();
        let most = (MAX_TRACKS / scene.cameras.len().max(1)) as u32;
        for (idx, member) in scene.cameras.iter().enumerate() {
            let privacy = self.privacies.of_known(&member.id).now();
            for record in past.tracks(&member.id, instants(wide), None, most)? {
                let Ok(track) = placed(scene, member, &record, (wide, &privacy)) else { continue };
                for steps in track.parts {
                    heights.insert(parts.len(), track.height_m);
                    parts.push(Part { of: PartOf::Camera(idx as u16, record.number), steps });
                }
            }
        }
        let people = join(&parts);
        let mut sighted: Vec<Sighted> = Vec::new();
        for (person, of) in people.iter().enumerate() {
            let tracks: Vec<usize> =
                of.parts.iter().copied().filter(|idx| heights.contains_key(idx)).collect();
            let known = tracks.iter().filter_map(|idx| heights[idx]);
            let (n_known, sum_m) = known.fold((0, 0.0), |(n, sum), height_m| (n + 1, sum + height_m));
            let height_m = if n_known == 0 { USUAL_M } else { sum_m / f64::from(n_known) };
            for (piece, part) in unknown.iter().enumerate() {
                if let Some(path) = path_of(&tracks, &parts, *part) {
                    sighted.push(Sighted { person, piece, known: of.known, path, height_m });
                }
            }
        }
        let names = self.names(scene, &sighted);
        for (idx, piece) in unknown.iter().enumerate() {
            let own = sighted.iter().filter(|of| of.piece == idx);
            let records: Vec<EntityRecord> =
                own.map(|of| record(names[&of.person], &of.path, of.height_m)).collect();
            let (began_at, ended_at) = instants(*piece);
            let change = SpanChange { id: None, began_at, ended_at };
            if let Err(error) = past.put_entities(set, &change, &records) {
                // It is concluded again when somebody asks again.
                tracing::warn!(scene = %scene.id, %error, "who was where is not kept");
                break;
            }
        }
        Ok(())
    }

    /// Returns everybody's id: the one that they are known by, unless another has it at the same time, or a new one.
    fn names(&self, scene: &Scene, sighted: &[Sighted]) -> BTreeMap<usize, u64> {
        let mut names = BTreeMap::new();
        let mut ends: BTreeMap<u64, (usize, Timestamp)> = BTreeMap::new();
        // Reserves as many as there are people, so that none of those that the present gives is given here.
        let people: BTreeSet<usize> = sighted.iter().map(|of| of.person).collect();
        let mut new = self.reserve_entity_ids(scene, people.len() as u32)..;
        for of in sighted {
            let is_theirs = |id: &u64| {
                ends.get(id).is_none_or(|(person, end)| *person == of.person || *end < of.path.began_at())
            };
            let name = names.get(&of.person).copied().or(of.known.filter(is_theirs));
            let Some(name) = name.or_else(|| new.next()) else { continue };
            names.insert(of.person, name);
            ends.insert(name, (of.person, of.path.ended_at()));
        }
        names
    }

    /// Returns until when the tracks of a scene's cameras tell all there was.
    pub(super) fn settled(&self, scene: &Scene) -> i64 {
        let cameras: Vec<_> =
            scene.cameras.iter().filter_map(|member| self.camera(member.id.as_str()).ok()).collect();
        let last = |camera: &Arc<CameraEntry>| {
            // One that has ended has written all of its tracks before.
            let is_over = camera.status.read().state == CameraState::Ended;
            (!is_over).then(|| camera.timeline.range().map(|(_, last)| last.as_nanos()))
        };
        let going_on: Vec<Option<i64>> = cameras.iter().filter_map(last).collect();
        let Some(newest) = going_on.iter().copied().max() else { return i64::MAX };
        // Before the first frames of a run, what other runs saw is told by all of their tracks, up to now at most.
        let newest = newest.unwrap_or_else(|| self.clock.now().as_nanos());
        // One that lags for long, or is gone, holds nobody back.
        let slowest = going_on.iter().flatten().copied().min().unwrap_or(newest);
        slowest.max(newest.saturating_sub(LAG_NANOS)).saturating_sub(SETTLED_NANOS)
    }
}

/// Returns whom is known of the times beside those that are concluded.
fn known_parts(past: &Past, scene: &str, known: &[(i64, Piece)]) -> Result<Vec<Part>, EngineError> {
    let mut parts = Vec::new();
    for (span, piece) in known {
        let (from, to) = instants(*piece);
        let records = past.entities(*span, (from, to), MAX_ROWS)?;
        for Sighting { id, ends, points, .. } in sightings(scene, &records) {
            let place = |at: Timestamp| Some((at, stand_at(&points, ends, at)?.foot_in_world));
            let between =
                points.iter().map(|point| (point.at(ends.0).min(ends.1), point.place.foot_in_world));
            let between = between.filter(|(at, _)| from < *at && *at < to);
            let steps: Vec<_> = place(from).into_iter().chain(between).chain(place(to)).collect();
            if !steps.is_empty() {
                parts.push(Part { of: PartOf::Known(id), steps });
            }
        }
    }
    Ok(parts)
}

/// Returns where in the world a track was in a time, as far as no zone hides it, and how tall.
fn placed(
    scene: &Scene,
    member: &SceneCamera,
    record: &TrackRecord,
    ((from, to), privacy): (Piece, &Privacy),
) -> Result<PlacedTrack, PathError> {
    let points = FootPath::decode_within(&record.path, record.feet)?;
    let mut most_per_metre = 0.0_f64;
    let mut parts = vec![Vec::with_capacity(points.len())];
    for point in points {
        // Rounding must not lead out of the track.
        let at = point.at(record.began_at).min(record.ended_at);
        let texture = point.foot_in_texture();
        if privacy.at(at).any(|zone| zone.holds(texture)) {
            parts.push(Vec::new());
            continue;
        }
        if !(from..=to).contains(&at.as_nanos()) {
            continue;
        }
        let texture = DVec2::from_array(texture);
        let Some(place) = mapping::place(&member.camera, &scene.surfaces, texture) else { continue };
        if let Some(steps) = parts.last_mut().filter(|steps| steps.last().is_none_or(|(last, _)| *last < at))
        {
            steps.push((at, place));
        }
        if let Some(above) = member.camera.project(place + DVec3::Z) {
            most_per_metre = most_per_metre.max((texture.y - above.texture.y).abs());
        }
    }
    parts.retain(|steps: &Vec<(Timestamp, DVec3)>| !steps.is_empty());
    let height_m = f64::from(record.height) / f64::from(u16::MAX) / most_per_metre;
    let [least, most] = HEIGHTS_M;
    let height_m = (least..=most).contains(&height_m).then_some(height_m);
    Ok(PlacedTrack { parts, height_m })
}

/// Returns where somebody was in a time, of their tracks; none where they were not there.
fn path_of(tracks: &[usize], parts: &[Part], piece: Piece) -> Option<EntityPath> {
    let own: Vec<&Part> = tracks.iter().map(|idx| &parts[*idx]).collect();
    let mut path: Option<EntityPath> = None;
    let mut n_stands = 0;
    for (at, foot_in_world, who) in middle_of(&own, instants(piece)) {
        let camera = |idx: &usize| match own[*idx].of {
            PartOf::Camera(camera, _) => Some(camera),
            PartOf::Known(_) => None,
        };
        let mut cameras: Vec<u16> = who.iter().filter_map(camera).collect();
        cameras.sort_unstable();
        cameras.dedup();
        let stand = Stand { foot_in_world, cameras };
        n_stands += 1;
        match &mut path {
            Some(path) => path.add(at, stand),
            None => path = EntityPath::new(at, stand),
        }
    }
    path.filter(|_| n_stands > 1)
}
