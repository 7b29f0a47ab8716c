//! Answers to who was where at a time that is over: what was kept of it, and, where nothing was kept, what follows from the tracks that
//! each camera kept, which is kept then.
//!
//! Whole five minutes are concluded once for each set of cameras, when all tracks of them are written: whoever asks again gets the same.

use super::pieces::{Piece, around, divide};
use super::set_of;
use crate::engine::EngineError;
use crate::engine::past::Past;
use crate::engine::presence::PresentEntity;
use crate::engine::privacy::Privacy;
use crate::engine::shared::Shared;
use crate::engine::track_search::{FoundTrack, ParseCursorError};
use glam::DVec3;
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, PoisonError};
use videofields_picture::fuse::{EntityPath, Stand, stand_at};
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::store::{EntityRecord, EntitySet};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::Camera;
use videofields_vision::track::TimedPlace;

/// Most times of five minutes that one question concludes.
const MAX_PIECES: usize = 12;

/// Sightings that are read at once.
pub(super) const MAX_ROWS: u32 = 4096;

/// Sightings after which no more are read to tell whose tracks are.
const MAX_LOOKED_AT: usize = 20_000;

/// Times of which nothing is known that an answer tells.
const MAX_UNKNOWN: usize = 100;

/// Points after which an answer is full: some 5 MB of JSON.
const MAX_ANSWERED: usize = 50_000;

/// Most metres between where one camera sees somebody's feet and where all cameras together do.
const SAME_M: f64 = 1.5;

/// Points of a track at which it is asked whose it is.
const MAX_ASKED: usize = 8;

/// Question for who was where.
#[derive(Clone, Debug, PartialEq)]
pub struct EntityQuery {
    /// The time that is asked for.
    pub span: (Timestamp, Timestamp),
    /// Place in the order of answers behind which the answer begins.
    pub after: Option<EntityCursor>,
    /// Most sightings of the answer, 1 or more.
    pub limit: usize,
}

/// A place in the order of answers: by beginning, then by id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct EntityCursor {
    /// Beginning of the sighting at it, within the time asked for.
    pub began_at: Timestamp,
    /// Id of the sighting at it.
    pub id: u64,
}

/// Answer to an [`EntityQuery`].
#[derive(Clone, Debug, PartialEq, Default)]
pub struct FoundEntities {
    /// Sightings in the order of beginning.
    pub entities: Vec<FoundEntity>,
    /// Times of which nothing is known, in order, the first hundred.
    pub unknown: Vec<(Timestamp, Timestamp)>,
    /// Place to go on behind; none where all were found.
    pub next: Option<EntityCursor>,
}

/// Somebody, from one sighting to another without a longer break, within the time asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundEntity {
    /// Id of the entity, from sighting to sighting.
    pub id: u64,
    /// Height, metres.
    pub height_m: f64,
    /// Places in order of time; never empty.
    pub path: Vec<FoundStand>,
}

/// Place of somebody at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundStand {
    /// The instant, within 0.05 s.
    pub at: Timestamp,
    /// Place in the world, metres.
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

/// Parts of a time: which span has which, and of which nothing is known.
struct Kept {
    known: Vec<(i64, Piece)>,
    unknown: Vec<Piece>,
}

/// A sighting that is kept.
pub(super) struct Sighting {
    pub(super) id: u64,
    height_m: f64,
    pub(super) ends: (Timestamp, Timestamp),
    pub(super) points: Vec<TimedPlace<Stand>>,
}

/// Time that is asked for of a scene, and how much may still be concluded of it.
pub(super) struct Asked<'a> {
    pub(super) past: &'a Past,
    pub(super) scene: &'a Arc<Scene>,
    pub(super) set: EntitySet,
    n_pieces: usize,
}

impl Shared {
    /// Returns who was where in a scene. Blocks for the database, and for as much work as the bounds allow.
    pub(in crate::engine) fn find_entities(
        &self,
        scene: &Arc<Scene>,
        query: &EntityQuery,
    ) -> Result<FoundEntities, EngineError> {
        let Some(past) = &self.past else { return Ok(FoundEntities::default()) };
        let kept = self.kept(&mut Asked::new(past, scene), query.span)?;
        let place = |of: &FoundEntity| EntityCursor { began_at: of.path[0].at, id: of.id };
        let mut found = FoundEntities::default();
        let (mut n_answered, mut goes_on) = (0, false);
        for (span, piece) in kept.known {
            let (from, to) = instants(piece);
            let begin = query.after.map_or(from, |after| after.began_at.max(from));
            if goes_on || begin > to {
                continue;
            }
            let records = past.entities(span, (begin, to), MAX_ROWS)?;
            let mut of_piece: Vec<FoundEntity> = Vec::new();
            for sighting in sightings(&scene.id, &records) {
                of_piece.extend(self.found(scene, &sighting, (from, to)));
            }
            of_piece.retain(|of| query.after.is_none_or(|after| place(of) > after));
            of_piece.sort_by_key(place);
            for of in of_piece {
                if found.entities.len() == query.limit || n_answered >= MAX_ANSWERED {
                    goes_on = true;
                    break;
                }
                n_answered += of.path.len();
                found.entities.push(of);
            }
            found.next = found.entities.last().filter(|_| goes_on).map(place);
            if !goes_on && records.len() == MAX_ROWS as usize {
                let last =
                    records.last().map(|of| EntityCursor { began_at: of.began_at.max(from), id: of.id });
                (found.next, goes_on) = (last, true);
            }
        }
        found.unknown = kept.unknown.into_iter().take(MAX_UNKNOWN).map(instants).collect();
        Ok(found)
    }

    /// Returns who was where in a scene at an instant; `None` where nothing is known of it.
    pub(in crate::engine) fn recalled_at(
        &self,
        scene: &Arc<Scene>,
        instant: Timestamp,
    ) -> Result<Option<Vec<PresentEntity>>, EngineError> {
        let Some(past) = &self.past else { return Ok(None) };
        let kept = self.kept(&mut Asked::new(past, scene), (instant, instant))?;
        let Some((span, piece)) = kept.known.first() else { return Ok(None) };
        let records = past.entities(*span, instants(*piece), MAX_ROWS)?;
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
        entities.dedup_by_key(|of| of.id);
        Ok(Some(entities))
    }

    /// Returns whose tracks these are, one by one; none of whom nothing is kept.
    pub(in crate::engine) fn entities_of_tracks(
        &self,
        scene: &Arc<Scene>,
        tracks: &[FoundTrack],
    ) -> Result<Vec<Option<u64>>, EngineError> {
        let ends = tracks.iter().map(|track| (track.began_at, track.ended_at));
        let time = ends.reduce(|(from, to), (began, ended)| (from.min(began), to.max(ended)));
        let (Some(past), Some(time)) = (&self.past, time) else { return Ok(vec![None; tracks.len()]) };
        let kept = self.kept(&mut Asked::new(past, scene), time)?;
        let mut known = Vec::new();
        let mut n_rows = 0;
        // Tracks are told from the newest on.
        for (span, piece) in kept.known.into_iter().rev() {
            let records = past.entities(span, instants(piece), MAX_ROWS)?;
            n_rows += records.len();
            known.extend(sightings(&scene.id, &records).map(|sighting| (piece, sighting)));
            if n_rows >= MAX_LOOKED_AT {
                break;
            }
        }
        Ok(tracks.iter().map(|track| whose(scene, track, &known)).collect())
    }

    /// Returns what is kept of a time, once all was concluded that can be.
    fn kept(&self, asked: &mut Asked<'_>, time: (Timestamp, Timestamp)) -> Result<Kept, EngineError> {
        self.write_entities_of(asked.scene, time.0);
        let kept = asked.look(time)?;
        let settled = self.settled(asked.scene);
        let is_settled = |piece: &&Piece| around(Timestamp::from_nanos(piece.0)).1 <= settled;
        if !kept.unknown.iter().any(|piece| is_settled(&piece)) {
            return Ok(kept);
        }
        // One after the other, so that nobody concludes what another just did.
        let _turn = self.entities.recalling.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = asked.look(time)?;
        let mut done: Option<i64> = None;
        for piece in kept.unknown.iter().filter(is_settled) {
            let (mut from, to) = *piece;
            while let Some(at) = asked.next_track(from, to)?.filter(|_| asked.n_pieces > 0) {
                let (first, last) = around(Timestamp::from_nanos(at));
                if last > settled {
                    break;
                }
                if done < Some(last) {
                    asked.n_pieces -= 1;
                    self.conclude(asked, (first, last))?;
                    done = Some(last);
                }
                let Some(next) = last.checked_add(1) else { break };
                from = next;
            }
        }
        asked.look(time)
    }

    /// Returns what of a sighting lies in a time, and may be seen: in parts, where it may not be seen in between.
    fn found(
        &self,
        scene: &Scene,
        sighting: &Sighting,
        (from, to): (Timestamp, Timestamp),
    ) -> Vec<FoundEntity> {
        let Sighting { id, height_m, ends: of, points } = sighting;
        let ends = [from, to].map(|end| Some((end, stand_at(points, *of, end)?)));
        // Rounding must not lead out of the sighting.
        let between = points.iter().map(|point| (point.at(of.0).min(of.1), point.place.clone()));
        let between = between.filter(|(at, _)| from < *at && *at < to);
        let [first, last] = ends;
        let all = first.into_iter().chain(between).chain(last.filter(|_| from < to));
        let stand = |(at, stand): (Timestamp, Stand)| {
            let cameras: Vec<CameraId> = self.seeing(scene, at, &stand).collect();
            FoundStand { at, point_m: stand.foot_in_world.to_array(), cameras }
        };
        let stands: Vec<FoundStand> = all.map(stand).collect();
        let shown = stands.split(|stand| stand.cameras.is_empty()).filter(|path| !path.is_empty());
        shown.map(|path| FoundEntity { id: *id, height_m: *height_m, path: path.to_vec() }).collect()
    }

    /// Returns the cameras that saw somebody where no zone hides them.
    fn seeing<'a>(
        &'a self,
        scene: &'a Scene,
        at: Timestamp,
        stand: &'a Stand,
    ) -> impl Iterator<Item = CameraId> + 'a {
        let corrected = self.corrections.corrected_scene(scene);
        let members = stand.cameras.iter().map(|idx| usize::from(*idx));
        let members = members.filter_map(|idx| Some((idx, scene.cameras.get(idx)?)));
        // Somebody may have been placed by the camera as it is calibrated or as it is corrected.
        let is_shown = move |(idx, member): &(usize, &SceneCamera)| {
            let privacy = self.privacies.of_known(&member.id).now();
            let is_hidden_from = |camera: &Camera| is_hidden(&privacy, camera, at, stand.foot_in_world);
            let in_use = corrected.as_ref().and_then(|of| of.cameras.get(*idx));
            !(is_hidden_from(&member.camera) || in_use.is_some_and(|member| is_hidden_from(&member.camera)))
        };
        members.filter(is_shown).map(|(_, member)| member.id.clone())
    }
}

impl<'a> Asked<'a> {
    fn new(past: &'a Past, scene: &'a Arc<Scene>) -> Self {
        Self { past, scene, set: set_of(scene), n_pieces: MAX_PIECES }
    }

    /// Returns what is kept of a time.
    fn look(&self, time: (Timestamp, Timestamp)) -> Result<Kept, EngineError> {
        let (known, unknown) = divide(time, &self.past.entity_spans(&self.set, time)?);
        Ok(Kept { known, unknown })
    }

    /// Returns when a camera first follows anything in a time.
    fn next_track(&self, from: i64, to: i64) -> Result<Option<i64>, EngineError> {
        let mut next: Option<i64> = None;
        for member in &self.scene.cameras {
            let began = self.past.next_track_at(&member.id, Timestamp::from_nanos(from))?;
            let began = began.map(|at| at.as_nanos().max(from)).filter(|at| *at <= to);
            next = next.into_iter().chain(began).min();
        }
        Ok(next)
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

pub(super) const fn instants((from, to): Piece) -> (Timestamp, Timestamp) {
    (Timestamp::from_nanos(from), Timestamp::from_nanos(to))
}

/// Returns what is kept, as it can be read.
pub(super) fn sightings<'a>(
    scene: &'a str,
    records: &'a [EntityRecord],
) -> impl Iterator<Item = Sighting> + 'a {
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
    // The one known first, where several have as many.
    votes.into_iter().max_by_key(|(id, votes)| (*votes, std::cmp::Reverse(*id))).map(|(id, _)| id)
}
