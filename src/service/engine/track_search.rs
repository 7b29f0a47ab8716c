//! What moved before a scene's cameras at what time, and in which part of the world: found among the tracks that are kept.
//!
//! In: tracks as cameras saw them, in their textures. Out: those that were there, with the places of their feet by the
//! calibrations of now, so that a better calibration betters what was seen before it. What one question may cost is
//! bounded; an answer that the bounds cut short says where to go on.

use super::EngineError;
use super::past::Past;
use super::privacy::Privacy;
use super::shared::Shared;
use glam::DVec2;
use std::collections::VecDeque;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::store::{StoreError, TrackRecord};
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{Fault, unknown};
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::GroundPolygon;
use videofields_vision::mapping;
use videofields_vision::track::{FootPath, PathError};

/// Most kept tracks that one question looks at.
const MAX_LOOKED_AT: usize = 20_000;

/// Points after which a question looks at no further track: each is a ray against every surface of the scene.
const MAX_PLACED: usize = 250_000;

/// Points after which an answer is full: some 5 MB of JSON.
const MAX_ANSWERED: usize = 50_000;

/// Tracks that are taken from the database at once, of each camera.
const PAGE: u32 = 64;

/// Which tracks are asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackQuery {
    /// Seen at some time from the one to the other, and in the region at such a time if one is named.
    pub span: (Timestamp, Timestamp),
    /// By one of these cameras; of all the scene's if absent.
    pub cameras: Option<Vec<CameraId>>,
    /// Seen over this part of the ground; its height says nothing.
    pub region: Option<GroundPolygon>,
    /// Behind this one in the order of answers.
    pub before: Option<TrackCursor>,
    /// Most tracks of the answer, 1 or more.
    pub limit: usize,
}

/// A place in the order of answers: newest beginning first, then by camera and number, backwards. It stays where it is
/// while tracks come and go.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TrackCursor {
    /// When the track at it began.
    pub began_at: Timestamp,
    /// Of which camera it is.
    pub camera: CameraId,
    /// Its number.
    pub number: u64,
}

/// A text that is no cursor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected what an answer gave as next")]
pub struct ParseCursorError;

/// The tracks that were found.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct FoundTracks {
    /// The one that began last first.
    pub tracks: Vec<FoundTrack>,
    /// Where to go on; none where all were found.
    pub next: Option<TrackCursor>,
}

/// What one camera followed.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundTrack {
    /// The camera.
    pub camera: CameraId,
    /// Its number in that run of the camera.
    pub number: u64,
    /// Id of the entity that it shows; none where that is not known.
    pub entity: Option<u64>,
    /// Its first sighting.
    pub began_at: Timestamp,
    /// Its last sighting.
    pub ended_at: Timestamp,
    /// Its largest height, share of the picture's, 0 to 1.
    pub height_share: f64,
    /// When it was first and last in the region within the span; none where no region was named.
    pub in_region: Option<(Timestamp, Timestamp)>,
    /// Where its feet were, in order of time, within the span or not; never empty.
    pub path: Vec<FoundPoint>,
}

/// Where feet were.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundPoint {
    /// When, within 0.05 s.
    pub at: Timestamp,
    /// In the camera's texture, from (0, 0) to (1, 1).
    pub texture: [f64; 2],
    /// In the world, metres; none above the horizon, beside every surface, or where the ray grazes the surface.
    pub point_m: Option<[f64; 3]>,
}

impl fmt::Display for TrackCursor {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}:{}", self.began_at.as_nanos(), self.camera, self.number)
    }
}

impl FromStr for TrackCursor {
    type Err = ParseCursorError;

    fn from_str(text: &str) -> Result<Self, ParseCursorError> {
        let parts: Vec<&str> = text.split(':').collect();
        let [began_at, camera, number] = parts[..] else { return Err(ParseCursorError) };
        let whole = |_error| ParseCursorError;
        Ok(Self {
            began_at: Timestamp::from_nanos(began_at.parse().map_err(whole)?),
            camera: CameraId::new(camera).map_err(|_error| ParseCursorError)?,
            number: number.parse().map_err(whole)?,
        })
    }
}

impl Shared {
    /// What moved before a scene's cameras. Blocks for the database, and for as much work as the bounds allow.
    pub(super) fn find_tracks(
        &self,
        scene: &Arc<Scene>,
        query: &TrackQuery,
    ) -> Result<FoundTracks, EngineError> {
        let members = members(scene, query.cameras.as_deref())?;
        let Some(past) = &self.past else { return Ok(FoundTracks::default()) };
        let mut lanes: Vec<Lane<'_>> =
            members.into_iter().map(|member| Lane::new(member, query.before.as_ref())).collect();
        let mut search = Search::new(scene, query);
        let mut last = None;
        let next = loop {
            let Some((member, record)) = newest(&mut lanes, past, query.span)? else { break None };
            if search.is_full() {
                break last;
            }
            let camera = member.id.clone();
            let place = TrackCursor { began_at: record.began_at, camera, number: record.number };
            search.look_at(member, &record, &self.privacies.of_known(&member.id).now());
            last = Some(place);
        };
        if let Some(error) = &search.first_unusable {
            let n_left_out = search.n_unusable;
            tracing::warn!(scene = %scene.id, n_left_out, %error, "tracks that cannot be read are left out");
        }
        let mut tracks = search.found;
        let entities = self.entities_of_tracks(scene, &tracks)?;
        tracks.iter_mut().zip(entities).for_each(|(track, entity)| track.entity = entity);
        Ok(FoundTracks { tracks, next })
    }
}

/// The cameras of a scene that are asked for, each once.
fn members<'a>(scene: &'a Scene, asked: Option<&[CameraId]>) -> Result<Vec<&'a SceneCamera>, EngineError> {
    let ids: Vec<&str> = scene.cameras.iter().map(|member| member.id.as_str()).collect();
    if let Some(stranger) = asked.and_then(|asked| asked.iter().find(|id| !ids.contains(&id.as_str()))) {
        let message = unknown("camera of the scene", stranger.as_str(), &ids);
        return Err(EngineError::Request(Fault::new("cameras", message)));
    }
    let is_asked = |member: &&SceneCamera| asked.is_none_or(|asked| asked.contains(&member.id));
    Ok(scene.cameras.iter().filter(is_asked).collect())
}

/// One camera's tracks, taken from the database page by page.
struct Lane<'a> {
    member: &'a SceneCamera,
    page: VecDeque<TrackRecord>,
    /// Behind this beginning and number the next page begins.
    before: Option<(Timestamp, u64)>,
    is_at_end: bool,
}

impl<'a> Lane<'a> {
    fn new(member: &'a SceneCamera, before: Option<&TrackCursor>) -> Self {
        let before = before.map(|cursor| {
            let number = match member.id.cmp(&cursor.camera) {
                // Of those that began at the same time, all come behind it; or none does.
                std::cmp::Ordering::Less => u64::MAX,
                std::cmp::Ordering::Equal => cursor.number,
                std::cmp::Ordering::Greater => 0,
            };
            (cursor.began_at, number)
        });
        Self { member, page: VecDeque::new(), before, is_at_end: false }
    }

    /// Sees to it that the next track is at hand, if there is one.
    fn fill(&mut self, past: &Past, span: (Timestamp, Timestamp)) -> Result<(), StoreError> {
        if self.page.is_empty() && !self.is_at_end {
            self.page = past.tracks(&self.member.id, span, self.before, PAGE)?.into();
            self.is_at_end = self.page.len() < PAGE as usize;
            self.before = self.page.back().map(|last| (last.began_at, last.number)).or(self.before);
        }
        Ok(())
    }
}

/// Takes the next track in the order of answers.
fn newest<'a>(
    lanes: &mut [Lane<'a>],
    past: &Past,
    span: (Timestamp, Timestamp),
) -> Result<Option<(&'a SceneCamera, TrackRecord)>, EngineError> {
    for lane in &mut *lanes {
        lane.fill(past, span)?;
    }
    let place = |lane: &&mut Lane<'a>| lane.page.front().map(|next| (next.began_at, lane.member.id.clone()));
    let next = lanes.iter_mut().filter(|lane| !lane.page.is_empty()).max_by_key(place);
    Ok(next.and_then(|lane| Some((lane.member, lane.page.pop_front()?))))
}

/// One question and what was found so far.
struct Search<'a> {
    scene: &'a Scene,
    query: &'a TrackQuery,
    found: Vec<FoundTrack>,
    n_looked_at: usize,
    n_placed: usize,
    n_answered: usize,
    n_unusable: usize,
    first_unusable: Option<PathError>,
}

impl<'a> Search<'a> {
    const fn new(scene: &'a Scene, query: &'a TrackQuery) -> Self {
        Self {
            scene,
            query,
            found: Vec::new(),
            n_looked_at: 0,
            n_placed: 0,
            n_answered: 0,
            n_unusable: 0,
            first_unusable: None,
        }
    }

    const fn is_full(&self) -> bool {
        self.found.len() >= self.query.limit
            || self.n_looked_at >= MAX_LOOKED_AT
            || self.n_placed >= MAX_PLACED
            || self.n_answered >= MAX_ANSWERED
    }

    /// Takes a track into the answer if it was in the region, as far as nobody may not see it.
    fn look_at(&mut self, member: &SceneCamera, record: &TrackRecord, privacy: &Privacy) {
        self.n_looked_at += 1;
        let (mut began_at, mut ended_at) = (record.began_at, record.ended_at);
        let path = match self.placed(member, record) {
            Ok(path) => path,
            Err(error) => {
                self.n_unusable += 1;
                self.first_unusable.get_or_insert(error);
                return;
            }
        };
        let n_points = path.len();
        let is_seen = |point: &FoundPoint| !privacy.at(point.at).any(|zone| zone.holds(point.texture));
        let path: Vec<FoundPoint> = path.into_iter().filter(is_seen).collect();
        if path.len() < n_points {
            let (Some(first), Some(last)) = (path.first(), path.last()) else { return };
            (began_at, ended_at) = (first.at, last.at);
        }
        let in_region = self.query.region.as_ref().map(|region| stay(&path, region, self.query.span));
        if in_region == Some(None) {
            return;
        }
        self.n_answered += path.len();
        self.found.push(FoundTrack {
            camera: member.id.clone(),
            number: record.number,
            entity: None,
            began_at,
            ended_at,
            height_share: f64::from(record.height) / f64::from(u16::MAX),
            in_region: in_region.flatten(),
            path,
        });
    }

    /// Where in the world a track's feet were.
    fn placed(&mut self, member: &SceneCamera, record: &TrackRecord) -> Result<Vec<FoundPoint>, PathError> {
        let points = FootPath::decode_within(&record.path, record.feet)?;
        self.n_placed += points.len();
        let placed = points.iter().map(|point| {
            let texture = point.foot_in_texture();
            let place = mapping::place(&member.camera, &self.scene.surfaces, DVec2::from_array(texture));
            FoundPoint {
                // Rounding must not lead out of the track.
                at: point.at(record.began_at).min(record.ended_at),
                texture,
                point_m: place.map(|place| place.to_array()),
            }
        });
        Ok(placed.collect())
    }
}

/// When a path was first and last over a region within a span of time: at its points, and straight between two that
/// follow one another and are both on the ground.
fn stay(
    path: &[FoundPoint],
    region: &GroundPolygon,
    (from, to): (Timestamp, Timestamp),
) -> Option<(Timestamp, Timestamp)> {
    let place = |point: &FoundPoint| point.point_m.map(|[x, y, _]| DVec2::new(x, y));
    let stands = path.iter().filter_map(|point| {
        let is_there = (from..=to).contains(&point.at) && region.covers(place(point)?);
        is_there.then_some((point.at, point.at))
    });
    let walks = path.windows(2).filter_map(|pair| {
        let (start, end) = (place(&pair[0])?, place(&pair[1])?);
        let nanos = pair[1].at.nanos_since(pair[0].at) as f64;
        // The part of the way that lies within the span.
        let share_at = |at: Timestamp| (at.nanos_since(pair[0].at) as f64 / nanos).clamp(0.0, 1.0);
        if nanos <= 0.0 || pair[1].at < from || pair[0].at > to {
            return None;
        }
        let (low, high) = (share_at(from), share_at(to));
        let (first, last) = region.covered_part(start.lerp(end, low), start.lerp(end, high))?;
        let at = |share: f64| {
            let passed = (low + share * (high - low)) * nanos;
            pair[0].at.saturating_add_nanos(passed.round() as i64)
        };
        Some((at(first), at(last)))
    });
    stands.chain(walks).reduce(|(first, last), (a, b)| (first.min(a), last.max(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(secs: f64) -> Timestamp {
        Timestamp::from_nanos((secs * 1e9) as i64)
    }

    fn path(points: &[(f64, Option<[f64; 2]>)]) -> Vec<FoundPoint> {
        let point = |(secs, place): &(f64, Option<[f64; 2]>)| FoundPoint {
            at: at(*secs),
            texture: [0.5, 0.5],
            point_m: place.map(|[x, y]| [x, y, 0.0]),
        };
        points.iter().map(point).collect()
    }

    #[test]
    fn who_was_over_a_region_and_when() {
        let corners = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
        let region = GroundPolygon::new(corners.map(DVec2::from_array).to_vec(), 0.0).unwrap();
        let check = |points: &[(f64, Option<[f64; 2]>)], span: (f64, f64), expected: Option<(f64, f64)>| {
            let found = stay(&path(points), &region, (at(span.0), at(span.1)));
            assert_eq!(found, expected.map(|(first, last)| (at(first), at(last))), "{points:?} {span:?}");
        };
        let through = [(0.0, Some([-10.0, 5.0])), (4.0, Some([30.0, 5.0]))];
        check(&through, (-9.0, 9.0), Some((1.0, 2.0)));
        // As much of it as lies within the span.
        check(&through, (1.25, 9.0), Some((1.25, 2.0)));
        check(&through, (-9.0, 1.5), Some((1.0, 1.5)));
        check(&through, (1.25, 1.5), Some((1.25, 1.5)));
        check(&through, (2.5, 9.0), None);
        check(&through, (-9.0, 0.5), None);
        check(&through, (5.0, 9.0), None);
        // In, out and in again.
        let twice = [
            (0.0, Some([5.0, 5.0])),
            (1.0, Some([5.0, 15.0])),
            (2.0, Some([6.0, 15.0])),
            (3.0, Some([6.0, 5.0])),
        ];
        check(&twice, (-9.0, 9.0), Some((0.0, 3.0)));
        check(&twice, (0.75, 9.0), Some((2.5, 3.0)));
        // What was not on the ground in between was not straight between.
        check(&[(0.0, Some([-10.0, 5.0])), (1.0, None), (2.0, Some([30.0, 5.0]))], (-9.0, 9.0), None);
        check(&[(0.0, None), (1.0, Some([3.0, 3.0])), (2.0, None)], (-9.0, 9.0), Some((1.0, 1.0)));
        check(&[(0.0, None), (1.0, None)], (-9.0, 9.0), None);
        check(&[(0.0, Some([3.0, 3.0]))], (0.0, 9.0), Some((0.0, 0.0)));
        check(&[(0.0, Some([-1.0, 3.0]))], (0.0, 9.0), None);
        check(&[], (-9.0, 9.0), None);
    }

    #[test]
    fn cursors_are_written_and_read_back() {
        let camera = CameraId::new("north-2").unwrap();
        for (nanos, number) in [(0, 1), (i64::MIN, 0), (1_790_000_000_123_456_789, u64::MAX)] {
            let cursor =
                TrackCursor { began_at: Timestamp::from_nanos(nanos), camera: camera.clone(), number };
            assert_eq!(cursor.to_string().parse(), Ok(cursor));
        }
        for text in ["", "1", "1:north", "1:north:2:3", "1:North:2", "x:north:2", "1:north:-2", "1::2"] {
            assert_eq!(text.parse::<TrackCursor>(), Err(ParseCursorError), "{text}");
        }
    }
}
