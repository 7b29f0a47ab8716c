//! Path of an entity, with the cameras that saw it: gathered instant by instant, thinned out, and encoded in few bytes.
//!
//! Encoding: a byte of version; the first place (three 64-bit floats, metres, little endian); then for each point the time since the
//! one before it, in units of 0.1 s, how far it lies from the one before it along x, y and z, whole centimetres, the sign in the lowest
//! bit, and the cameras: 0 where they are those of the point before, else their number and one, and their indices. All of these are in
//! LEB128.

use glam::DVec3;
use videofields_vision::clock::Timestamp;
use videofields_vision::track::{
    MAX_PATH_POINTS, PathError, PathPlace, ThinnedPath, TimedPlace, push_number, take_number,
};

/// Metres that an entity moves before a point is kept at once.
const FAR_M: f64 = 0.3;

/// Metres that an entity wanders while it stands still.
const STILL_M: f64 = 0.15;

/// Most cameras that are kept of one point.
const MAX_CAMERAS: usize = 32;

/// Most bytes of an encoded path.
pub const MAX_ENTITY_PATH_BYTES: usize = 65_536;

const CENTIMETRES: f64 = 100.0;
const VERSION: u8 = 1;

/// A place of an entity, and the cameras that saw it there.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    /// Place where it touched the ground, metres.
    pub foot_in_world: DVec3,
    /// The cameras, by their places in a list that whoever keeps the path knows, in growing order.
    pub cameras: Vec<u16>,
}

/// A path while it grows.
#[derive(Clone, Debug)]
pub struct EntityPath {
    path: ThinnedPath<Stand>,
}

impl PathPlace for Stand {
    fn is_far_from(&self, before: &Self, spacing: u32) -> bool {
        self.cameras != before.cameras
            || self.foot_in_world.distance(before.foot_in_world) > FAR_M * f64::from(spacing)
    }

    fn is_still_at(&self, stood: &Self) -> bool {
        self.cameras == stood.cameras && self.foot_in_world.distance(stood.foot_in_world) <= STILL_M
    }
}

impl EntityPath {
    /// Returns a path that begins where an entity is seen first; `None` where that is no place.
    #[must_use]
    pub fn new(at: Timestamp, stand: Stand) -> Option<Self> {
        stand.foot_in_world.is_finite().then(|| Self { path: ThinnedPath::new(at, bounded(stand)) })
    }

    /// Takes the next sighting. One that is no place, or no later than the one before it, says nothing.
    pub fn add(&mut self, at: Timestamp, stand: Stand) {
        if stand.foot_in_world.is_finite() {
            self.path.add(at, bounded(stand));
        }
    }

    /// Returns when it was first seen.
    #[must_use]
    pub const fn began_at(&self) -> Timestamp {
        self.path.began_at()
    }

    /// Returns when it was last seen.
    #[must_use]
    pub const fn ended_at(&self) -> Timestamp {
        self.path.ended_at()
    }

    /// Returns the path in bytes, [`MAX_ENTITY_PATH_BYTES`] at most: some 7 a point.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![VERSION];
        let mut before: Option<TimedPlace<Stand>> = None;
        for point in self.path.points() {
            let origin = match &before {
                Some(before) => before.place.foot_in_world,
                None => {
                    let first = point.place.foot_in_world;
                    bytes.extend(first.to_array().iter().flat_map(|value| value.to_le_bytes()));
                    first
                }
            };
            push_number(&mut bytes, point.ticks - before.as_ref().map_or(0, |before| before.ticks));
            let steps = ((point.place.foot_in_world - origin) * CENTIMETRES).round();
            steps.to_array().iter().for_each(|step| push_number(&mut bytes, zigzag(*step as i32)));
            let cameras = &point.place.cameras;
            if before.as_ref().is_some_and(|before| before.place.cameras == *cameras) {
                push_number(&mut bytes, 0);
            } else {
                push_number(&mut bytes, cameras.len() as u32 + 1);
                cameras.iter().for_each(|camera| push_number(&mut bytes, u32::from(*camera)));
            }
            // The place as it is read back, so that rounding does not add up.
            let foot_in_world = origin + steps / CENTIMETRES;
            let place = Stand { foot_in_world, cameras: cameras.clone() };
            before = Some(TimedPlace { ticks: point.ticks, place });
        }
        bytes
    }

    /// Returns the points of what [`Self::encode`] made, in growing order of time, the first at 0.
    ///
    /// # Errors
    /// When the bytes are none of that: damaged, or of another version.
    pub fn decode(bytes: &[u8]) -> Result<Vec<TimedPlace<Stand>>, PathError> {
        let unusable = |what| Err(PathError::new(what));
        let Some((&VERSION, rest)) = bytes.split_first() else {
            return unusable("its version is not known");
        };
        let Some((first, mut rest)) = rest.split_first_chunk::<24>() else {
            return unusable("it ends within its first place");
        };
        let axis = |axis: usize| f64::from_le_bytes(std::array::from_fn(|i| first[8 * axis + i]));
        let mut before = TimedPlace {
            ticks: 0,
            place: Stand { foot_in_world: DVec3::new(axis(0), axis(1), axis(2)), cameras: Vec::new() },
        };
        let mut points: Vec<TimedPlace<Stand>> = Vec::new();
        while !rest.is_empty() {
            let Some((point, behind)) = take_point(&before, rest) else {
                return unusable("it ends within a point, or a number is too large");
            };
            rest = behind;
            if (point.ticks == before.ticks) != points.is_empty() {
                return unusable("its times do not grow");
            }
            if points.len() == MAX_PATH_POINTS {
                return unusable("it has too many points");
            }
            if !point.place.foot_in_world.is_finite() {
                return unusable("a place is no number");
            }
            points.push(point.clone());
            before = point;
        }
        if points.is_empty() { unusable("it has no points") } else { Ok(points) }
    }
}

/// Returns the point that `bytes` begin with, after the one `before`, and what follows it.
fn take_point<'a>(before: &TimedPlace<Stand>, bytes: &'a [u8]) -> Option<(TimedPlace<Stand>, &'a [u8])> {
    let (passed, mut rest) = take_number(bytes)?;
    let mut steps = [0.0; 3];
    for step in &mut steps {
        let (number, behind) = take_number(rest)?;
        (*step, rest) = (f64::from(unzigzag(number)), behind);
    }
    let (n_cameras, mut rest) = take_number(rest)?;
    let mut cameras = before.place.cameras.clone();
    if let Some(n_cameras) = n_cameras.checked_sub(1) {
        cameras.clear();
        if n_cameras as usize > MAX_CAMERAS {
            return None;
        }
        for _ in 0..n_cameras {
            let (camera, behind) = take_number(rest)?;
            cameras.push(u16::try_from(camera).ok()?);
            rest = behind;
        }
    }
    let foot_in_world = before.place.foot_in_world + DVec3::from_array(steps) / CENTIMETRES;
    let ticks = before.ticks.checked_add(passed)?;
    Some((TimedPlace { ticks, place: Stand { foot_in_world, cameras } }, rest))
}

/// Returns where an entity stood at an instant, of the points of its path and the times of its ends: straight between two of them, with
/// the cameras of the one before. `None` before the beginning and after the end.
#[must_use]
pub fn stand_at(
    points: &[TimedPlace<Stand>],
    (began_at, ended_at): (Timestamp, Timestamp),
    instant: Timestamp,
) -> Option<Stand> {
    if !(began_at..=ended_at).contains(&instant) {
        return None;
    }
    let next = points.partition_point(|point| point.at(began_at) < instant);
    // Times of points are rounded, the end is not.
    let Some(after) = points.get(next) else { return points.last().map(|last| last.place.clone()) };
    if after.at(began_at) == instant {
        return Some(after.place.clone());
    }
    let before = &points[next.checked_sub(1)?];
    let (from, to) = (before.at(began_at), after.at(began_at));
    let share = instant.secs_since(from) / to.secs_since(from);
    let foot_in_world = before.place.foot_in_world.lerp(after.place.foot_in_world, share);
    Some(Stand { foot_in_world, cameras: before.place.cameras.clone() })
}

/// Returns the stand with no more cameras than are kept.
fn bounded(mut stand: Stand) -> Stand {
    stand.cameras.truncate(MAX_CAMERAS);
    stand
}

/// Returns a number with its sign in the lowest bit.
const fn zigzag(number: i32) -> u32 {
    ((number << 1) ^ (number >> 31)) as u32
}

/// Returns the number whose [`zigzag`] this is.
const fn unzigzag(number: u32) -> i32 {
    (number >> 1) as i32 ^ -((number & 1) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(millis: i64) -> Timestamp {
        Timestamp::from_nanos(millis * 1_000_000)
    }

    fn stand(x: f64, cameras: &[u16]) -> Stand {
        Stand { foot_in_world: DVec3::new(x, 2.0, 0.5), cameras: cameras.to_vec() }
    }

    fn path(stands: impl IntoIterator<Item = (i64, Stand)>) -> EntityPath {
        let mut stands = stands.into_iter();
        let (first, place) = stands.next().unwrap();
        let mut path = EntityPath::new(at(first), place).unwrap();
        stands.for_each(|(millis, place)| path.add(at(millis), place));
        path
    }

    #[test]
    fn points_come_once_a_second_after_some_way_and_before_and_where_cameras_change() {
        let ticks = |path: &EntityPath| -> Vec<u32> {
            EntityPath::decode(&path.encode()).unwrap().iter().map(|point| point.ticks).collect()
        };
        let walks = path((0..=20).map(|i| (200 * i, stand(0.2 * i as f64, &[0]))));
        assert_eq!(ticks(&walks), [0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 40]);
        let stands = path((0..=50).map(|i| (200 * i, stand(0.01 * (i % 3) as f64, &[0]))));
        assert_eq!(ticks(&stands), [0, 100]);
        let handed_over = path((0..=20).map(|i| (200 * i, stand(0.0, if i < 8 { &[0] } else { &[0, 3] }))));
        let points = EntityPath::decode(&handed_over.encode()).unwrap();
        let seen: Vec<(u32, &[u16])> =
            points.iter().map(|point| (point.ticks, &point.place.cameras[..])).collect();
        assert_eq!(
            seen,
            [(0, &[0_u16][..]), (10, &[0]), (14, &[0]), (16, &[0, 3]), (36, &[0, 3]), (40, &[0, 3])]
        );
    }

    #[test]
    fn a_day_takes_no_more_bytes_than_are_allowed_and_keeps_its_ends() {
        let all: Vec<u16> = (900..1000).collect();
        let seen = |i: i64| if i % 2 == 0 { &all[..40] } else { &all[40..] };
        let day = path((0..432_000).map(|i| (200 * i, stand(7.0 * (i as f64 * 0.01).sin(), seen(i)))));
        let bytes = day.encode();
        assert!(bytes.len() <= MAX_ENTITY_PATH_BYTES, "{}", bytes.len());
        let points = EntityPath::decode(&bytes).unwrap();
        assert_eq!(points[0].ticks, 0);
        assert_eq!(points[points.len() - 1].at(day.began_at()), day.ended_at());
        assert!(points.iter().all(|point| point.place.cameras.len() == MAX_CAMERAS));
    }

    #[test]
    fn between_two_points_it_is_straight_and_beyond_the_ends_nowhere() {
        let walks = path([(1000, stand(1.0, &[2])), (3000, stand(5.0, &[1]))]);
        let points = EntityPath::decode(&walks.encode()).unwrap();
        let stood = |millis: i64| stand_at(&points, (at(1000), at(3000)), at(millis));
        assert_eq!(stood(999), None);
        assert_eq!(stood(1000), Some(stand(1.0, &[2])));
        assert_eq!(stood(1500), Some(stand(2.0, &[2])));
        assert_eq!(stood(3000), Some(stand(5.0, &[1])));
        assert_eq!(stood(3001), None);
        // Its end is exact, though the time of its last point is rounded down or up.
        for end in [1080, 1120, 1180] {
            let short = path([(1000, stand(1.0, &[2])), (end, stand(5.0, &[1]))]);
            let points = EntityPath::decode(&short.encode()).unwrap();
            let stood = |millis: i64| stand_at(&points, (short.began_at(), short.ended_at()), at(millis));
            assert!(stood(end).is_some() && stood(end + 1).is_none(), "{end}");
        }
    }

    #[test]
    fn what_is_no_place_says_nothing_and_damaged_bytes_are_refused() {
        let nowhere = Stand { foot_in_world: DVec3::NAN, cameras: vec![0] };
        assert!(EntityPath::new(at(0), nowhere.clone()).is_none());
        let mut stands = path([(0, stand(0.0, &[0]))]);
        stands.add(at(9000), nowhere);
        stands.add(at(0), stand(3.0, &[0]));
        assert_eq!(stands.ended_at(), at(0));
        let bytes = path([(0, stand(0.0, &[0])), (5000, stand(9.0, &[1]))]).encode();
        EntityPath::decode(&bytes).unwrap();
        for len in 0..bytes.len() {
            // Ended within the first place or a point, it is told; ended between two points, it is a shorter path.
            let is_whole = EntityPath::decode(&bytes[..len]).is_ok();
            assert_eq!(is_whole, len == bytes.len() - 7, "{len}");
        }
        let changed = |at: usize, to: u8| {
            let mut bytes = bytes.clone();
            bytes[at] = to;
            EntityPath::decode(&bytes)
        };
        changed(0, 2).unwrap_err();
        changed(25, 5).unwrap_err();
        changed(29, 200).unwrap_err();
    }

    proptest! {
        #[test]
        fn places_come_back_within_a_centimetre_wherever_the_scene_lies(
            origin in -1e7..1e7_f64,
            steps in prop::collection::vec((-9.0..9.0_f64, -9.0..9.0_f64, -1.0..1.0_f64, 0..4_u16), 1..60),
        ) {
            let mut place = DVec3::new(origin, -origin, 3.0);
            let mut told = Vec::new();
            for (x, y, z, camera) in &steps {
                place += DVec3::new(*x, *y, *z);
                told.push((1000 * told.len() as i64, Stand { foot_in_world: place, cameras: vec![*camera] }));
            }
            let points = EntityPath::decode(&path(told.clone()).encode()).unwrap();
            for point in points {
                let (_, stood) = &told[point.ticks as usize / 10];
                prop_assert!(point.place.foot_in_world.distance(stood.foot_in_world) < 0.0101);
                prop_assert_eq!(&point.place.cameras, &stood.cameras);
            }
        }

        #[test]
        fn no_bytes_break_it(bytes in prop::collection::vec(any::<u8>(), 0..99)) {
            let mut bytes = bytes;
            if let Some(first) = bytes.first_mut() {
                *first = VERSION;
            }
            if let Ok(points) = EntityPath::decode(&bytes) {
                prop_assert!(points.iter().all(|point| point.place.foot_in_world.is_finite()));
            }
        }
    }

    #[test]
    fn before_a_leap_somebody_stood_where_they_were() {
        let at = |tick: i64| Timestamp::from_nanos(tick * 100_000_000);
        let places = [0.0, 0.05, 0.1, 0.25, 0.28, 2.0, 2.1];
        let stand = |x: f64| Stand { foot_in_world: DVec3::X * x, cameras: vec![0] };
        let mut path = EntityPath::new(at(0), stand(places[0])).unwrap();
        for (tick, x) in (1..).zip(&places[1..]) {
            path.add(at(tick), stand(*x));
        }
        let points = EntityPath::decode(&path.encode()).unwrap();
        for (tick, x) in (0..).zip(places) {
            let there = stand_at(&points, (path.began_at(), path.ended_at()), at(tick)).unwrap();
            assert!((there.foot_in_world.x - x).abs() < 0.2, "{tick}: {there:?}");
        }
        assert_eq!(points.len(), 4);
    }
}
