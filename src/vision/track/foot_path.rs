//! Where a tracked thing's feet were, thinned out while it is followed, and encoded in few bytes.
//!
//! Knows nothing of pictures, of the world, or of where the bytes are kept.
//!
//! Encoding: a byte of version, then for each point the time since the one before it, in units of 0.1 s (LEB128), and u
//! and v (16 bits each, little endian).

use super::thinned::{MAX_PATH_POINTS, PathPlace, ThinnedPath, TimedPlace, push_number, take_number};
use crate::clock::Timestamp;
use crate::error::ErrorKind;

/// How far a thing moves before a point is kept at once: 2 % of the picture.
const FAR: u32 = 1311;

/// How far a thing wanders that stands still: 0.3 % of the picture.
const STILL: u32 = 197;

const VERSION: u8 = 1;

/// Place in a texture (u, v), 0 at the left and top, 65535 at the right and bottom.
pub type Foot = [u16; 2];

/// Where feet were at a time.
pub type PathPoint = TimedPlace<Foot>;

/// A path while it grows.
#[derive(Clone, Debug)]
pub struct FootPath {
    path: ThinnedPath<Foot>,
    feet: [Foot; 2],
    n_seen: u64,
}

/// Bytes that are no path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the path is unusable, {what}")]
pub struct PathError {
    what: &'static str,
}

impl PathError {
    /// Returns the error of bytes of which `what` is wrong.
    #[must_use]
    pub const fn new(what: &'static str) -> Self {
        Self { what }
    }

    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        ErrorKind::Internal
    }
}

impl PathPoint {
    /// Place in the texture, from (0, 0) at the top left corner to (1, 1).
    #[must_use]
    pub fn foot_in_texture(&self) -> [f64; 2] {
        self.place.map(|value| f64::from(value) / f64::from(u16::MAX))
    }
}

impl PathPlace for Foot {
    fn is_far_from(&self, before: &Self, spacing: u32) -> bool {
        away(self, before) > FAR * spacing
    }

    fn is_still_at(&self, stood: &Self) -> bool {
        away(self, stood) <= STILL
    }
}

/// Returns the larger of the distances along u and v.
fn away([u, v]: &Foot, [from_u, from_v]: &Foot) -> u32 {
    u32::from(u.abs_diff(*from_u)).max(u32::from(v.abs_diff(*from_v)))
}

/// 0 to 65535 for 0 to 1; `None` outside, and for what is no number.
fn sixteen_bits(share: f64) -> Option<u16> {
    (0.0..=1.0).contains(&share).then(|| (share * f64::from(u16::MAX)).round() as u16)
}

impl FootPath {
    /// A path that begins where something is seen first; `None` where its foot, in texture coordinates, lies outside the
    /// picture.
    #[must_use]
    pub fn new(at: Timestamp, foot_in_texture: [f64; 2]) -> Option<Self> {
        let [u, v] = foot_in_texture.map(sixteen_bits);
        let first = [u?, v?];
        Some(Self { path: ThinnedPath::new(at, first), feet: [first; 2], n_seen: 1 })
    }

    /// Takes the next sighting. One outside of the picture, or no later than the one before it, says nothing.
    pub fn add(&mut self, at: Timestamp, foot_in_texture: [f64; 2]) {
        let [Some(u), Some(v)] = foot_in_texture.map(sixteen_bits) else { return };
        if !self.path.add(at, [u, v]) {
            return;
        }
        self.n_seen += 1;
        let [low, high] = &mut self.feet;
        *low = [low[0].min(u), low[1].min(v)];
        *high = [high[0].max(u), high[1].max(v)];
    }

    /// Time of the first sighting.
    #[must_use]
    pub const fn began_at(&self) -> Timestamp {
        self.path.began_at()
    }

    /// Time of the latest sighting.
    #[must_use]
    pub const fn ended_at(&self) -> Timestamp {
        self.path.ended_at()
    }

    /// How often it was seen.
    #[must_use]
    pub const fn n_seen(&self) -> u64 {
        self.n_seen
    }

    /// The least box around all sightings: lower and upper corner.
    #[must_use]
    pub const fn feet(&self) -> [Foot; 2] {
        self.feet
    }

    /// What is kept of it, the latest sighting last: 1 to [`MAX_PATH_POINTS`] points.
    pub fn points(&self) -> impl Iterator<Item = PathPoint> + '_ {
        self.path.points().copied()
    }

    /// The same in bytes: 5 a point, seldom more.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![VERSION];
        let mut before = 0;
        for point in self.points() {
            push_number(&mut bytes, point.ticks - before);
            before = point.ticks;
            bytes.extend(point.place.iter().flat_map(|value| value.to_le_bytes()));
        }
        bytes
    }

    /// The points of what [`Self::encode`] made, in growing order of time, the first at 0.
    ///
    /// # Errors
    /// When the bytes are none of that: damaged, or of another version.
    pub fn decode(bytes: &[u8]) -> Result<Vec<PathPoint>, PathError> {
        let unusable = |what| Err(PathError::new(what));
        let Some((&VERSION, mut rest)) = bytes.split_first() else {
            return unusable("its version is not known");
        };
        let mut points: Vec<PathPoint> = Vec::with_capacity((rest.len() / 5).min(MAX_PATH_POINTS));
        while !rest.is_empty() {
            let Some((passed, behind)) = take_number(rest) else {
                return unusable("a time does not end or is too large");
            };
            let Some((&[u0, u1, v0, v1], behind)) = behind.split_first_chunk() else {
                return unusable("it ends within a point");
            };
            rest = behind;
            let before = points.last().map(|last| last.ticks);
            if (passed == 0) != before.is_none() {
                return unusable("its times do not grow");
            }
            let Some(ticks) = before.unwrap_or(0).checked_add(passed) else {
                return unusable("it lasts too long");
            };
            if points.len() == MAX_PATH_POINTS {
                return unusable("it has too many points");
            }
            let place = [u16::from_le_bytes([u0, u1]), u16::from_le_bytes([v0, v1])];
            points.push(PathPoint { ticks, place });
        }
        if points.is_empty() { unusable("it has no points") } else { Ok(points) }
    }

    /// As [`Self::decode`], of a path whose box of feet is known.
    ///
    /// # Errors
    /// As [`Self::decode`], and when a point lies outside of the box: one of the two is damaged.
    pub fn decode_within(bytes: &[u8], feet: [Foot; 2]) -> Result<Vec<PathPoint>, PathError> {
        let [low, high] = feet;
        let points = Self::decode(bytes)?;
        let is_within = |point: &PathPoint| {
            [0, 1].iter().all(|&axis| (low[axis]..=high[axis]).contains(&point.place[axis]))
        };
        if points.iter().all(is_within) { Ok(points) } else { Err(PathError::new("it leaves its box")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(millis: i64) -> Timestamp {
        Timestamp::from_nanos(millis * 1_000_000)
    }

    /// A path seen every `step_millis` at `foot(i)`.
    fn seen(n: i64, step_millis: i64, foot: impl Fn(i64) -> [f64; 2]) -> FootPath {
        let mut path = FootPath::new(at(5), foot(0)).unwrap();
        for i in 1..n {
            path.add(at(5 + i * step_millis), foot(i));
        }
        path
    }

    fn ticks(path: &FootPath) -> Vec<u32> {
        path.points().map(|point| point.ticks).collect()
    }

    #[test]
    fn a_point_a_second_is_kept_and_more_of_what_is_fast() {
        let slow = seen(46, 100, |i| [0.2 + 0.001 * i as f64, 0.5]);
        assert_eq!(ticks(&slow), [0, 10, 20, 30, 40, 45]);
        let fast = seen(11, 100, |i| [0.1 + 0.05 * i as f64, 0.5]);
        assert_eq!(ticks(&fast), (0..11).collect::<Vec<_>>());
        // Two sightings within a tenth of a second are one point.
        let hasty = seen(9, 25, |i| [0.1 + 0.1 * i as f64, 0.5]);
        assert_eq!(ticks(&hasty), [0, 1, 2]);
        assert_eq!((hasty.n_seen(), hasty.ended_at()), (9, at(205)));
        assert_eq!(hasty.feet(), [[6554, 32_768], [58_982, 32_768]], "all sightings count for the box");
    }

    #[test]
    fn what_stands_takes_two_points_and_what_creeps_is_not_taken_for_still() {
        let still = seen(6000, 100, |i| [0.5 + 0.001 * (i % 3) as f64, 0.5]);
        assert_eq!(ticks(&still), [0, 5990, 5999]);
        let creeping = seen(6000, 100, |i| [0.1 + 0.0001 * i as f64, 0.5]);
        for pair in creeping.points().collect::<Vec<_>>().windows(2) {
            assert!(away(&pair[1].place, &pair[0].place) < 600, "{pair:?}");
        }
    }

    #[test]
    fn a_path_of_hours_stays_small_and_even() {
        // There and back again, twice a minute, for ten hours.
        let path = seen(360_000, 100, |i| [0.5 + 0.4 * (i as f64 * 0.02).sin(), 0.5]);
        let points: Vec<_> = path.points().collect();
        assert!((MAX_PATH_POINTS / 4..=MAX_PATH_POINTS).contains(&points.len()), "{}", points.len());
        assert_eq!((points[0].ticks, points[points.len() - 1].ticks), (0, 359_999));
        let longest = points.windows(2).map(|pair| pair[1].ticks - pair[0].ticks).max().unwrap();
        assert!(longest < 359_999 / 64, "{longest} ticks without a point");
        assert_eq!(FootPath::decode(&path.encode()).unwrap(), points);
        assert!(path.encode().len() <= 8192);
    }

    #[test]
    fn what_lies_outside_or_comes_out_of_order_says_nothing() {
        for foot in [[-0.001, 0.5], [0.5, 1.001], [f64::NAN, 0.5], [0.5, f64::INFINITY]] {
            assert!(FootPath::new(at(0), foot).is_none(), "{foot:?}");
            let mut path = FootPath::new(at(0), [0.0, 1.0]).unwrap();
            path.add(at(2000), foot);
            assert_eq!((path.n_seen(), path.ended_at()), (1, at(0)), "{foot:?}");
        }
        let mut path = FootPath::new(at(0), [0.0, 1.0]).unwrap();
        for (millis, u) in [(1000, 0.1), (1000, 0.9), (500, 0.9), (-5000, 0.9), (2000, 0.2)] {
            path.add(at(millis), [u, 0.5]);
        }
        assert_eq!(ticks(&path), [0, 10, 20]);
        assert_eq!(path.feet()[1], [13_107, 65_535]);
        path.add(Timestamp::from_nanos(i64::MAX), [0.9, 0.5]);
        assert_eq!(path.ended_at(), at(2000), "292 years are no path");
    }

    #[test]
    fn bytes_that_are_no_path_are_refused() {
        let check = |bytes: &[u8], said: &str| {
            let error = FootPath::decode(bytes).unwrap_err();
            assert!(error.to_string().contains(said), "{bytes:?}: {error}");
        };
        check(&[], "version");
        check(&[2, 0, 1, 1, 1, 1], "version");
        check(&[1], "no points");
        check(&[1, 0, 1, 1, 1], "within a point");
        check(&[1, 5, 1, 1, 1, 1], "do not grow");
        check(&[1, 0, 1, 1, 1, 1, 0, 1, 1, 1, 1], "do not grow");
        check(&[1, 0, 1, 1, 1, 1, 0x80], "does not end");
        check(&[1, 0, 1, 1, 1, 1, 0xff, 0xff, 0xff, 0xff, 0x7f, 1, 1, 1, 1], "too large");
        let long = [0xff, 0xff, 0xff, 0xff, 0x0f, 1, 1, 1, 1];
        check(&[&[1, 0, 1, 1, 1, 1][..], &long, &long].concat(), "lasts too long");
        let many = [&[1, 0, 1, 1, 1, 1][..], &[1, 1, 1, 1, 1].repeat(MAX_PATH_POINTS)].concat();
        check(&many, "too many");
        let path = seen(30, 100, |i| [0.1 + 0.02 * i as f64, 0.5]);
        let [low, [right, bottom]] = path.feet();
        assert!(FootPath::decode_within(&path.encode(), [low, [right, bottom]]).is_ok());
        let error = FootPath::decode_within(&path.encode(), [low, [right - 1, bottom]]).unwrap_err();
        assert!(error.to_string().contains("leaves its box"), "{error}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn what_is_encoded_is_decoded(
            steps in prop::collection::vec((1_i64..400_000, 0.0..=1.0_f64, 0.0..=1.0_f64), 0..1500),
        ) {
            let mut path = FootPath::new(at(0), [0.5, 0.5]).unwrap();
            let mut millis = 0;
            for (step, u, v) in steps {
                millis += step;
                path.add(at(millis), [u, v]);
            }
            let points = FootPath::decode_within(&path.encode(), path.feet()).unwrap();
            prop_assert_eq!(&points, &path.points().collect::<Vec<_>>());
            prop_assert!(points.len() <= MAX_PATH_POINTS);
            for point in &points {
                prop_assert!(point.at(path.began_at()) <= path.ended_at().saturating_add_nanos(50_000_000));
            }
        }

        #[test]
        fn mutated_bytes_never_panic(
            cut in 0_usize..400,
            changes in prop::collection::vec((0_usize..400, any::<u8>()), 0..6),
        ) {
            let mut bytes = seen(80, 700, |i| [(i as f64 * 0.37).fract(), 0.5]).encode();
            for (place, value) in changes {
                let place = place % bytes.len();
                bytes[place] = value;
            }
            bytes.truncate(cut);
            if let Ok(points) = FootPath::decode(&bytes) {
                prop_assert!(points.windows(2).all(|pair| pair[0].ticks < pair[1].ticks));
            }
        }
    }
}
