//! Who was where at a time that is over: what was kept of it, and, where nothing was kept, what follows from the tracks that each
//! camera kept, which is kept then.
//!
//! Of one set of cameras, a time is concluded once: whoever asks for it again gets the same. What one question may cost is bounded.

use super::gathered::{GONE_NANOS, record};
use super::pieces::{Piece, around, cut, divide};
use super::set_of;
use crate::engine::EngineError;
use crate::engine::past::Past;
use crate::engine::presence::PresentEntity;
use crate::engine::privacy::Privacy;
use crate::engine::shared::Shared;
use crate::engine::track_search::{FoundTrack, ParseCursorError};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, PoisonError};
use videofields_picture::fuse::{EntityPath, Joined, Part, PartOf, Stand, join, middle_of, stand_at};
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::ingest::CameraState;
use videofields_recording::store::{EntityRecord, EntitySet, SpanChange, TrackRecord};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::Camera;
use videofields_vision::mapping;
use videofields_vision::track::{FootPath, PathError, TimedPlace};

/// Pieces of five minutes that one question concludes at most.
const MAX_PIECES: usize = 12;

/// Tracks that are put together at once at most; of more, the latest.
const MAX_TRACKS: usize = 4096;

/// Sightings that one question looks at.
const MAX_LOOKED_AT: u32 = 20_000;

/// Points after which an answer is full: some 5 MB of JSON.
const MAX_ANSWERED: usize = 50_000;

/// Tracks are written when they end, and while they go on every minute: what is as long ago is told by them.
const SETTLED_NANOS: i64 = 70_000_000_000;

/// Height of whom no camera shows from foot to head, metres, and which heights are told.
const USUAL_M: f64 = 1.7;
const HEIGHTS_M: [f64; 2] = [0.3, 3.0];

/// How far a camera may see somebody's feet from where all cameras together see them, metres, and be looking at them.
const SAME_M: f64 = 1.5;

/// Points of a track at which it is asked whose it is.
const MAX_ASKED: usize = 8;

/// Who is asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct EntityQuery {
    /// Seen at some time from the one to the other.
    pub span: (Timestamp, Timestamp),
    /// Behind this one in the order of answers.
    pub after: Option<EntityCursor>,
    /// Most sightings of the answer, 1 or more.
    pub limit: usize,
}

/// A place in the order of answers: by beginning, then by id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct EntityCursor {
    /// When the sighting at it began, within the time asked for.
    pub began_at: Timestamp,
    /// Its id.
    pub id: u64,
}

/// Who was found.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct FoundEntities {
    /// In the order of beginning.
    pub entities: Vec<FoundEntity>,
    /// Times of which nothing is known, in order; the first of them where there are many.
    pub unknown: Vec<(Timestamp, Timestamp)>,
    /// Where to go on; none where all were found.
    pub next: Option<EntityCursor>,
}

/// Somebody, from one sighting to another without a longer break, within the time asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundEntity {
    /// The same from sighting to sighting.
    pub id: u64,
    /// Height, metres.
    pub height_m: f64,
    /// Where they were, in order of time; never empty.
    pub path: Vec<FoundStand>,
}

/// Where somebody was.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundStand {
    /// When, within 0.05 s.
    pub at: Timestamp,
    /// Where in the world, metres.
    pub point_m: [f64; 3],
    /// The cameras that saw them.
    pub cameras: Vec<CameraId>,
}

impl fmt::Display for EntityCursor {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", self.began_at.as_nanos(), self.id)
    }
}

impl FromStr for EntityCursor {
    type Err = ParseCursorError;

    fn from_str(text: &str) -> Result<Self, ParseCursorError> {
        let (began_at, id) = text.split_once(':').ok_or(ParseCursorError)?;
        let began_at = began_at.parse().map_err(|_error| ParseCursorError)?;
        let id = id.parse().map_err(|_error| ParseCursorError)?;
        Ok(Self { began_at: Timestamp::from_nanos(began_at), id })
    }
}

/// What is kept of a time: which span has which part of it, and of which parts nothing is known.
struct Kept {
    known: Vec<(i64, Piece)>,
    unknown: Vec<Piece>,
}

/// A track, in the world.
struct PlacedTrack {
    /// Where its feet were, metres.
    steps: Vec<(Timestamp, DVec3)>,
    /// How tall it was about, metres, where its camera tells that.
    height_m: Option<f64>,
}

/// A sighting that is kept.
struct Sighting {
    id: u64,
    height_m: f64,
    ends: (Timestamp, Timestamp),
    points: Vec<TimedPlace<Stand>>,
}

impl Shared {
    /// Returns who was where in a scene. Blocks for the database, and for as much work as the bounds allow.
    pub(in crate::engine) fn find_entities(
        &self,
        scene: &Arc<Scene>,
        query: &EntityQuery,
    ) -> Result<FoundEntities, EngineError> {
        let Some(past) = &self.past else { return Ok(FoundEntities::default()) };
        let kept = self.kept(past, scene, query.span)?;
        let mut found = FoundEntities::default();
        let mut n_looked_at = 0;
        let mut all = Vec::new();
        for (span, piece) in kept.known {
            let time = instants(piece);
            let records = past.entities(span, time, MAX_LOOKED_AT - n_looked_at);
            let records = records?;
            n_looked_at += records.len() as u32;
            for sighting in sightings(&scene.id, &records) {
                all.extend(self.found(scene, &sighting, time));
            }
            if n_looked_at == MAX_LOOKED_AT {
                break;
            }
        }
        let place = |of: &FoundEntity| EntityCursor { began_at: of.path[0].at, id: of.id };
        all.retain(|of| query.after.is_none_or(|after| place(of) > after));
        all.sort_by_key(place);
        let (mut n_answered, mut n_found) = (0, 0);
        for of in &all {
            if n_found == query.limit || n_answered >= MAX_ANSWERED {
                found.next = n_found.checked_sub(1).map(|last| place(&all[last]));
                break;
            }
            n_answered += of.path.len();
            n_found += 1;
        }
        all.truncate(n_found);
        found.entities = all;
        found.unknown = kept.unknown.into_iter().map(instants).collect();
        Ok(found)
    }

    /// Returns who was where in a scene at an instant; `None` where nothing is known of it.
    pub(in crate::engine) fn recalled_at(
        &self,
        scene: &Arc<Scene>,
        instant: Timestamp,
    ) -> Result<Option<Vec<PresentEntity>>, EngineError> {
        let Some(past) = &self.past else { return Ok(None) };
        let kept = self.kept(past, scene, (instant, instant))?;
        let Some((span, piece)) = kept.known.first() else { return Ok(None) };
        let records = past.entities(*span, instants(*piece), MAX_LOOKED_AT)?;
        let present = |sighting: &Sighting| {
            let stand = stand_at(&sighting.points, sighting.ends, instant)?;
            let seen_by: Vec<CameraId> = self.seeing(scene, instant, &stand).collect();
            (!seen_by.is_empty()).then_some(PresentEntity {
                id: sighting.id,
                foot_in_world: stand.foot_in_world,
                height_m: sighting.height_m,
                seen_by,
            })
        };
        let mut entities: Vec<PresentEntity> =
            sightings(&scene.id, &records).filter_map(|of| present(&of)).collect();
        entities.sort_by_key(|of| of.id);
        Ok(Some(entities))
    }

    /// Returns whose tracks these are, one by one; none of whom nothing is kept.
    pub(in crate::engine) fn entities_of_tracks(
        &self,
        scene: &Arc<Scene>,
        tracks: &[FoundTrack],
    ) -> Result<Vec<Option<u64>>, EngineError> {
        let Some(past) = &self.past else { return Ok(vec![None; tracks.len()]) };
        let mut n_pieces = MAX_PIECES;
        self.write_entities_of(scene);
        let whose = |track: &FoundTrack| {
            let time = (track.began_at, track.ended_at);
            let kept = self.kept_within(past, scene, time, &mut n_pieces)?;
            let mut known = Vec::new();
            for (span, piece) in kept.known {
                let records = past.entities(span, instants(piece), MAX_LOOKED_AT / 16);
                let records = records?;
                known.extend(sightings(&scene.id, &records).map(|sighting| (piece, sighting)));
            }
            Ok(whose(scene, track, &known))
        };
        tracks.iter().map(whose).collect()
    }

    /// Returns what is kept of a time, once all was concluded that can be.
    fn kept(
        &self,
        past: &Past,
        scene: &Arc<Scene>,
        time: (Timestamp, Timestamp),
    ) -> Result<Kept, EngineError> {
        self.write_entities_of(scene);
        self.kept_within(past, scene, time, &mut { MAX_PIECES })
    }

    fn kept_within(
        &self,
        past: &Past,
        scene: &Arc<Scene>,
        time: (Timestamp, Timestamp),
        n_pieces: &mut usize,
    ) -> Result<Kept, EngineError> {
        let set = set_of(scene);
        let look = || -> Result<Kept, EngineError> {
            let spans = past.entity_spans(&set, time)?;
            let (known, unknown) = divide(time, &spans);
            Ok(Kept { known, unknown })
        };
        let kept = look()?;
        if kept.unknown.is_empty() || *n_pieces == 0 {
            return Ok(kept);
        }
        // One after the other, so that nobody concludes what another just did.
        let _turn = self.entities.recalling.lock().unwrap_or_else(PoisonError::into_inner);
        for piece in look()?.unknown.into_iter().flat_map(cut) {
            if *n_pieces == 0 {
                break;
            }
            *n_pieces -= 1;
            self.conclude(past, (scene, &set), piece)?;
        }
        look()
    }

    /// Concludes who was where in the five minutes around a time, as far as nothing is kept of them, and keeps it. What is too new for
    /// tracks to tell, or of which there are none, stays unknown.
    fn conclude(
        &self,
        past: &Past,
        (scene, set): (&Arc<Scene>, &EntitySet),
        piece: Piece,
    ) -> Result<(), EngineError> {
        let (first, last) = around(Timestamp::from_nanos(piece.0));
        let (first, last) = (first, last.min(self.settled(scene)));
        if first > last {
            return Ok(());
        }
        let wide = (first.saturating_sub(GONE_NANOS), last.saturating_add(GONE_NANOS));
        let spans = past.entity_spans(set, instants(wide))?;
        let (known, _) = divide(instants(wide), &spans);
        let (_, unknown) = divide(instants((first, last)), &spans);
        let mut parts = known_parts(past, &scene.id, &known)?;
        let n_known = parts.len();
        let mut heights = BTreeMap::new();
        for (idx, member) in scene.cameras.iter().enumerate() {
            let records = tracks_of(past, member, instants(wide), MAX_TRACKS.saturating_sub(parts.len()))?;
            for record in &records {
                let Ok(PlacedTrack { steps, height_m }) = placed(scene, member, record) else { continue };
                heights.insert(parts.len(), height_m);
                parts.push(Part { of: PartOf::Camera(idx as u16, record.number), steps });
            }
        }
        if parts.len() == n_known {
            return Ok(());
        }
        let people = join(&parts);
        for piece in unknown {
            self.keep(past, (scene, set), piece, &people, (&parts, &heights))?;
        }
        Ok(())
    }

    /// Keeps who was where in a time, of the people that were put together of `parts`.
    fn keep(
        &self,
        past: &Past,
        (scene, set): (&Arc<Scene>, &EntitySet),
        piece: Piece,
        people: &[Joined],
        (parts, heights): (&[Part], &BTreeMap<usize, Option<f64>>),
    ) -> Result<(), EngineError> {
        let paths = people.iter().filter_map(|person| {
            let tracks: Vec<usize> =
                person.parts.iter().copied().filter(|idx| heights.contains_key(idx)).collect();
            let path = path_of(&tracks, parts, piece)?;
            let known = tracks.iter().filter_map(|idx| heights[idx]);
            let (n_known, sum_m) = known.fold((0, 0.0), |(n, sum), height_m| (n + 1, sum + height_m));
            let height_m = if n_known == 0 { USUAL_M } else { sum_m / f64::from(n_known) };
            Some((person.known, path, height_m))
        });
        let paths: Vec<_> = paths.collect();
        let n_new = paths.iter().filter(|(known, ..)| known.is_none()).count();
        let (mut id, next_id) = {
            let placing = self.placing_of(scene);
            let mut placing = placing.lock();
            (placing.take_ids(n_new as u64), placing.next_id())
        };
        let mut name = || {
            id += 1;
            id - 1
        };
        let records: Vec<EntityRecord> = paths
            .iter()
            .map(|(known, path, height_m)| record(known.unwrap_or_else(&mut name), path, *height_m))
            .collect();
        let (began_at, ended_at) = instants(piece);
        let change = SpanChange { id: None, began_at, ended_at, next_id };
        past.put_entities(set, &change, &records)?;
        Ok(())
    }

    /// Returns until when the tracks of a scene's cameras tell all there was.
    fn settled(&self, scene: &Scene) -> i64 {
        let last = |member: &SceneCamera| {
            let camera = self.camera(member.id.as_str()).ok()?;
            // One that has ended has written all of its tracks before.
            let is_over = camera.status.read().state == CameraState::Ended;
            let (_, last) = camera.timeline.range().filter(|_| !is_over)?;
            Some(last.as_nanos().saturating_sub(SETTLED_NANOS))
        };
        scene.cameras.iter().filter_map(last).min().unwrap_or(i64::MAX)
    }

    /// Returns what of a sighting lies in a time, and may be seen; none where nothing does.
    fn found(
        &self,
        scene: &Scene,
        sighting: &Sighting,
        (from, to): (Timestamp, Timestamp),
    ) -> Option<FoundEntity> {
        let Sighting { id, height_m, ends: of, points } = sighting;
        let ends = [from, to].map(|end| Some((end, stand_at(points, *of, end)?)));
        // Rounding must not lead out of the sighting.
        let between = points.iter().map(|point| (point.at(of.0).min(of.1), point.place.clone()));
        let between = between.filter(|(at, _)| from < *at && *at < to);
        let [first, last] = ends;
        let all = first.into_iter().chain(between).chain(last.filter(|_| from < to));
        let stand = |(at, stand): (Timestamp, Stand)| {
            let cameras: Vec<CameraId> = self.seeing(scene, at, &stand).collect();
            let point_m = stand.foot_in_world.to_array();
            (!cameras.is_empty()).then_some(FoundStand { at, point_m, cameras })
        };
        let path: Vec<FoundStand> = all.filter_map(stand).collect();
        (!path.is_empty()).then_some(FoundEntity { id: *id, height_m: *height_m, path })
    }

    /// Returns the cameras that saw somebody where no zone hides them.
    fn seeing<'a>(
        &'a self,
        scene: &'a Scene,
        at: Timestamp,
        stand: &'a Stand,
    ) -> impl Iterator<Item = CameraId> + 'a {
        let members = stand.cameras.iter().filter_map(|idx| scene.cameras.get(usize::from(*idx)));
        let is_shown = move |member: &&SceneCamera| {
            let privacy = self.privacies.of_known(&member.id).now();
            !is_hidden(&privacy, &member.camera, at, stand.foot_in_world)
        };
        members.filter(is_shown).map(|member| member.id.clone())
    }
}

/// Tells that zones hide what a camera saw of a place.
fn is_hidden(privacy: &Privacy, camera: &Camera, at: Timestamp, foot_in_world: DVec3) -> bool {
    let mut zones = privacy.at(at).peekable();
    if zones.peek().is_none() {
        return false;
    }
    let texture = camera.project(foot_in_world).map(|seen| seen.texture.to_array());
    texture.is_some_and(|texture| zones.any(|zone| zone.holds(texture)))
}

const fn instants((from, to): Piece) -> (Timestamp, Timestamp) {
    (Timestamp::from_nanos(from), Timestamp::from_nanos(to))
}

/// Returns what is kept, as it can be read.
fn sightings<'a>(scene: &'a str, records: &'a [EntityRecord]) -> impl Iterator<Item = Sighting> + 'a {
    records.iter().filter_map(move |record| match EntityPath::decode(&record.path) {
        Ok(points) => Some(Sighting {
            id: record.id,
            height_m: f64::from(record.height_mm) * 1e-3,
            ends: (record.began_at, record.ended_at),
            points,
        }),
        Err(error) => {
            tracing::warn!(scene, entity = record.id, %error, "a sighting is left out");
            None
        }
    })
}

/// Returns whom is known of the times beside those that are concluded.
fn known_parts(past: &Past, scene: &str, known: &[(i64, Piece)]) -> Result<Vec<Part>, EngineError> {
    let mut parts = Vec::new();
    for (span, piece) in known {
        let (from, to) = instants(*piece);
        let records = past.entities(*span, (from, to), MAX_LOOKED_AT)?;
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

/// Returns a camera's tracks in a time, the one that began last first; `most` at most.
fn tracks_of(
    past: &Past,
    member: &SceneCamera,
    time: (Timestamp, Timestamp),
    most: usize,
) -> Result<Vec<TrackRecord>, EngineError> {
    let most = u32::try_from(most).unwrap_or(u32::MAX);
    Ok(past.tracks(&member.id, time, None, most)?)
}

/// Returns where in the world a track was, and how tall.
fn placed(scene: &Scene, member: &SceneCamera, record: &TrackRecord) -> Result<PlacedTrack, PathError> {
    let points = FootPath::decode_within(&record.path, record.feet)?;
    let mut most_per_metre = 0.0_f64;
    let mut steps = Vec::with_capacity(points.len());
    for point in points {
        let texture = DVec2::from_array(point.foot_in_texture());
        let Some(place) = mapping::place(&member.camera, &scene.surfaces, texture) else { continue };
        // Rounding must not lead out of the track.
        steps.push((point.at(record.began_at).min(record.ended_at), place));
        if let Some(above) = member.camera.project(place + DVec3::Z) {
            most_per_metre = most_per_metre.max((texture.y - above.texture.y).abs());
        }
    }
    steps.dedup_by_key(|(at, _)| *at);
    let height_m = f64::from(record.height) / f64::from(u16::MAX) / most_per_metre;
    let [least, most] = HEIGHTS_M;
    let height_m = (least..=most).contains(&height_m).then_some(height_m);
    Ok(PlacedTrack { steps, height_m })
}

/// Returns where somebody was in a time, of their tracks; none where they were not there.
fn path_of(tracks: &[usize], parts: &[Part], (from, to): Piece) -> Option<EntityPath> {
    let own: Vec<&Part> = tracks.iter().map(|idx| &parts[*idx]).collect();
    let mut path: Option<EntityPath> = None;
    let mut n_stands = 0;
    for (at, foot_in_world, who) in middle_of(&own) {
        if !(from..=to).contains(&at.as_nanos()) {
            continue;
        }
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

/// Returns whose track it is, of those who are known: whoever stands at most of its places.
fn whose(scene: &Scene, track: &FoundTrack, known: &[(Piece, Sighting)]) -> Option<u64> {
    let camera = scene.cameras.iter().position(|member| member.id == track.camera)?;
    let step = track.path.len().div_ceil(MAX_ASKED).max(1);
    let mut votes: BTreeMap<u64, usize> = BTreeMap::new();
    for point in track.path.iter().step_by(step) {
        let Some(place) = point.point_m.map(DVec3::from_array) else { continue };
        let away = |(piece, of): &(Piece, Sighting)| {
            if !(piece.0..=piece.1).contains(&point.at.as_nanos()) {
                return None;
            }
            let stand = stand_at(&of.points, of.ends, point.at)?;
            let is_seen = stand.cameras.iter().any(|idx| usize::from(*idx) == camera);
            let away_m = stand.foot_in_world.distance(place);
            (is_seen && away_m <= SAME_M).then_some((away_m, of.id))
        };
        let nearest = known.iter().filter_map(away).min_by(|(a, _), (b, _)| a.total_cmp(b));
        if let Some((_, id)) = nearest {
            *votes.entry(id).or_default() += 1;
        }
    }
    // Of as many, the one known first.
    votes.into_iter().max_by_key(|(id, votes)| (*votes, std::cmp::Reverse(*id))).map(|(id, _)| id)
}
