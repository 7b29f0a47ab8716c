//! The hull itself: what all cameras' silhouettes leave of a ray or of space, at the precision of their texels.
//!
//! `[M00]` Matusik et al. 2000, Image-Based Visual Hulls: a ray is seen by each camera as a line of its
//! picture; where that leaves the silhouette, the ray leaves the hull.
//!
//! A camera takes away what it sees outside its silhouette, and nothing else: what lies beside its picture or behind it stays, so
//! that somebody whom a picture's border cuts is not cut in half. What fewer cameras see than are asked for is no hull.

use super::view::{HullError, View};
use crate::geometry::Ray;
use glam::{DVec2, DVec3};

/// Nearer to the plane through a camera than this share of the ray's distance from it, nothing is seen.
const LEAST_DEPTH: f64 = 1e-9;

/// Shorter than this share of their distances, a stretch of a ray is none.
const LEAST_LENGTH: f64 = 1e-12;

/// A ray that passes a camera this near, as a share of its distance from it, is seen as a point.
const POINT: f64 = 1e-12;

/// A hull of several silhouettes.
#[derive(Clone, Debug)]
pub struct Hull {
    views: Vec<View>,
    least_seen: usize,
}

/// What a ray is looked up with, kept from one to the next.
#[derive(Debug, Default)]
pub struct Scratch {
    outside: Vec<f64>,
    picture: Vec<f64>,
    events: Vec<Event>,
    /// Where the ray is within the hull: begins and ends, distances along it.
    pub intervals: Vec<[f64; 2]>,
}

/// A change along a ray: of how many cameras see it outside their silhouettes, and of how many see it.
#[derive(Clone, Copy, Debug)]
struct Event {
    at: f64,
    outside: i32,
    seen: i32,
}

/// How a camera sees a ray: its line in the tangent plane, and the stretch of it.
struct Line {
    normal: DVec3,
    along: DVec2,
    origin: DVec3,
    direction: DVec3,
    /// Stretch of the ray before the camera, and the same along the line, in order.
    reach: [f64; 2],
    ends: [f64; 2],
}

impl Hull {
    /// Fewest and most silhouettes.
    pub const COUNT: [usize; 2] = [1, 1024];

    /// The hull of these; what fewer than `least_seen` of them see is not in it (2 is usual: one camera's cone goes on for ever).
    ///
    /// # Errors
    /// Where there are too few or too many.
    pub fn new(views: Vec<View>, least_seen: usize) -> Result<Self, HullError> {
        let [least, most] = [least_seen.max(Self::COUNT[0]), Self::COUNT[1]];
        if !(least..=most).contains(&views.len()) {
            return Err(HullError::Count { n: views.len(), least, most });
        }
        Ok(Self { views, least_seen })
    }

    /// Its silhouettes.
    #[must_use]
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// How many of them must see what is in it.
    #[must_use]
    pub const fn least_seen(&self) -> usize {
        self.least_seen
    }

    /// Where a ray is within the hull between two distances, in order: [`Scratch::intervals`]. Exact at the outlines' precision.
    ///
    /// **Cost** a silhouette logarithmic in its outline's corners, and linear in how often the ray's picture crosses it.
    pub fn cut(&self, ray: &Ray, [from, to]: [f64; 2], scratch: &mut Scratch) {
        let Scratch { outside, picture, events, intervals } = scratch;
        events.clear();
        intervals.clear();
        for view in &self.views {
            let local = |of: DVec3| view.camera().pose().world_from_local.inverse() * of;
            let origin = local(ray.origin - view.camera().pose().position_in_world);
            view.cut(origin, local(ray.direction), [from, to], (outside, picture), events);
        }
        events.sort_unstable_by(|a, b| a.at.total_cmp(&b.at));
        let (mut n_outside, mut n_seen, mut begun) = (0, 0, None);
        let mut is_in = self.least_seen == 0;
        if is_in {
            begun = Some(from);
        }
        let mut i = 0;
        while i < events.len() {
            let at = events[i].at;
            while i < events.len() && events[i].at == at {
                n_outside += events[i].outside;
                n_seen += events[i].seen;
                i += 1;
            }
            let is_now = n_outside == 0 && n_seen >= self.least_seen as i32;
            if is_now && !is_in {
                begun = Some(at);
            } else if let Some(from) = begun.filter(|_| !is_now && is_in) {
                // What rounding alone makes is none.
                if at - from > LEAST_LENGTH * at.abs().max(from.abs()) {
                    intervals.push([from, at]);
                }
                begun = None;
            }
            is_in = is_now;
        }
        if let Some(from) = begun.filter(|from| *from < to) {
            intervals.push([from, to]);
        }
    }

    /// Whether a place is in the hull.
    #[must_use]
    pub fn contains(&self, place: DVec3, scratch: &mut Vec<f64>) -> bool {
        let mut n_seen = 0;
        for view in &self.views {
            let local = view.camera().pose().local_from_world_point(place);
            if local.z <= 0.0 {
                continue;
            }
            let at = local.truncate() / local.z;
            if !view.border().contains(at, scratch) {
                continue;
            }
            if view.outside().contains(at, scratch) {
                return false;
            }
            n_seen += 1;
        }
        n_seen >= self.least_seen
    }
}

impl View {
    /// Adds where a ray, in the camera's own axes, is seen, and where outside the silhouette.
    fn cut(
        &self,
        origin: DVec3,
        direction: DVec3,
        range: [f64; 2],
        (outside, picture): (&mut Vec<f64>, &mut Vec<f64>),
        events: &mut Vec<Event>,
    ) {
        let Some(reach) = before(origin, direction, range) else { return };
        let normal = origin.cross(direction);
        let is_point = normal.length() <= POINT * origin.length() * direction.length();
        let Some(line) = Line::of(normal, origin, direction, reach).filter(|_| !is_point) else {
            // The ray goes through the camera, or is seen as a point for another reason: all of it or nothing.
            let middle = origin + direction * some_within(reach);
            let at = middle.truncate() / middle.z;
            if at.is_finite() && self.border().contains(at, picture) {
                let outside = i32::from(self.outside().contains(at, outside));
                push(events, reach, (outside, 1));
            }
            return;
        };
        self.border().crossings(line.normal, line.along, picture);
        self.outside().crossings(line.normal, line.along, outside);
        for (stretches, change) in [(picture, (0, 1)), (outside, (1, 0))] {
            for stretch in stretches.chunks_exact(2) {
                if let Some(seen) = within([stretch[0], stretch[1]], line.ends) {
                    push(events, line.distances(seen), change);
                }
            }
        }
    }
}

/// The stretch of a ray in `range` before the camera.
fn before(origin: DVec3, direction: DVec3, [from, to]: [f64; 2]) -> Option<[f64; 2]> {
    let least = LEAST_DEPTH * (origin.length() + direction.length());
    let reach = if direction.z.abs() <= f64::MIN_POSITIVE {
        [if origin.z > least { from } else { f64::INFINITY }, to]
    } else {
        let at = (least - origin.z) / direction.z;
        if direction.z > 0.0 { [from.max(at), to] } else { [from, to.min(at)] }
    };
    (reach[0] < reach[1]).then_some(reach)
}

/// A distance within a stretch that may be endless.
fn some_within([from, to]: [f64; 2]) -> f64 {
    match (from.is_finite(), to.is_finite()) {
        (true, true) => f64::midpoint(from, to),
        (true, false) => from + from.abs().max(1.0),
        (false, true) => to - to.abs().max(1.0),
        (false, false) => 0.0,
    }
}

fn within([from, to]: [f64; 2], [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    let both = [from.max(low), to.min(high)];
    (both[0] < both[1]).then_some(both)
}

fn push(events: &mut Vec<Event>, [from, to]: [f64; 2], (outside, seen): (i32, i32)) {
    if from < to {
        events.push(Event { at: from, outside, seen });
        events.push(Event { at: to, outside: -outside, seen: -seen });
    }
}

impl Line {
    fn of(normal: DVec3, origin: DVec3, direction: DVec3, reach: [f64; 2]) -> Option<Self> {
        // A plane at right angles to the axis has no line in the picture, and nothing of it is before the camera.
        let mut along = DVec2::new(-normal.y, normal.x).try_normalize()?;
        // Places along it grow with the distance where this does.
        let growth = along.dot(direction.truncate() * origin.z - origin.truncate() * direction.z);
        if growth < 0.0 {
            along = -along;
        }
        let mut line =
            Self { normal, along, origin, direction, reach, ends: [f64::NEG_INFINITY, f64::INFINITY] };
        line.ends = reach.map(|at| line.place(at));
        (growth != 0.0 && line.ends[0] < line.ends[1]).then_some(line)
    }

    /// Where along the line a distance along the ray is seen.
    fn place(&self, at: f64) -> f64 {
        let (top, bottom) = if at.is_finite() {
            (self.origin + self.direction * at, 1.0)
        } else {
            (self.direction, at.signum())
        };
        let depth = top.z * bottom;
        // An endless ray that keeps its depth goes beyond all places.
        if depth.abs() <= f64::MIN_POSITIVE {
            return f64::INFINITY * at.signum();
        }
        self.along.dot(top.truncate()) / top.z
    }

    /// The distances along the ray of two places along the line.
    fn distances(&self, [from, to]: [f64; 2]) -> [f64; 2] {
        let distance = |at: f64| {
            let (along, origin, direction) = (self.along, self.origin, self.direction);
            (at * origin.z - along.dot(origin.truncate()))
                / (along.dot(direction.truncate()) - at * direction.z)
        };
        let of = |at: f64, end: usize| {
            if at == self.ends[end] {
                self.reach[end]
            } else {
                distance(at).clamp(self.reach[0], self.reach[1])
            }
        };
        [of(from, 0), of(to, 1)]
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::{Camera, Distortion, Pose};

    const SIZE: usize = 240;

    /// A camera that looks at the origin.
    pub(in super::super) fn camera(eye: DVec3) -> Camera {
        let size = SIZE as u32;
        let pose = Pose::looking_at(eye, DVec3::ZERO).expect("a direction");
        let middle = DVec2::splat(SIZE as f64 / 2.0);
        Camera::new((size, size), DVec2::splat(300.0), middle, Distortion::None, pose).expect("a camera")
    }

    /// What a camera sees of whatever its rays may meet.
    pub(in super::super) fn seen(camera: Camera, meets: impl Fn(&Ray) -> bool) -> View {
        let mask = (0..SIZE * SIZE).map(|i| {
            let at = DVec2::new((i % SIZE) as f64 + 0.5, (i / SIZE) as f64 + 0.5) / SIZE as f64;
            camera.ray(at).is_some_and(|ray| meets(&ray))
        });
        View::new(camera.clone(), (SIZE, mask.collect()), 0.0).expect("a view")
    }

    /// Whether a ray meets a ball of radius 1 about a place.
    pub(in super::super) fn meets_ball(ray: &Ray, centre: DVec3) -> bool {
        let to = centre - ray.origin;
        let along = to.dot(ray.direction);
        along > 0.0 && to.length_squared() - along * along < 1.0
    }

    pub(in super::super) fn eyes(n: usize) -> impl Iterator<Item = DVec3> {
        (0..n).map(move |i| {
            let angle = std::f64::consts::TAU * i as f64 / n as f64;
            DVec3::new(5.0 * angle.cos(), 5.0 * angle.sin(), 1.5 * (i % 3) as f64)
        })
    }

    pub(in super::super) fn ball(n: usize) -> Hull {
        let views = eyes(n).map(|eye| seen(camera(eye), |ray| meets_ball(ray, DVec3::ZERO)));
        Hull::new(views.collect(), 2).expect("a hull")
    }

    fn cut(hull: &Hull, origin: DVec3, towards: DVec3) -> Vec<[f64; 2]> {
        let mut scratch = Scratch::default();
        let direction = (towards - origin).normalize();
        hull.cut(&Ray { origin, direction }, [0.0, 50.0], &mut scratch);
        scratch.intervals
    }

    #[test]
    fn a_ball_is_cut_where_it_is_and_never_within() {
        let hull = ball(16);
        for eye in [DVec3::new(9.0, 0.3, 0.2), DVec3::new(-2.0, 7.0, 3.0), DVec3::new(0.5, 0.2, 9.0)] {
            let found = cut(&hull, eye, DVec3::ZERO);
            assert_eq!(found.len(), 1, "{eye}: {found:?}");
            let distance = eye.length();
            // Within half a pixel (1 / 60 of the radius), and larger as a hull is.
            assert!(found[0][0] < distance - 1.0 + 0.02 && found[0][0] > distance - 1.6, "{eye}: {found:?}");
            assert!(found[0][1] > distance + 1.0 - 0.02 && found[0][1] < distance + 1.6, "{eye}: {found:?}");
        }
        assert!(cut(&hull, DVec3::new(9.0, 0.0, 0.0), DVec3::new(0.0, 3.0, 0.0)).is_empty());
    }

    #[test]
    fn rays_and_places_agree() {
        let hull = ball(7);
        let (mut state, mut scratch) = (3_u64, Vec::new());
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as f64 / f64::from(1_u32 << 31) * 6.0 - 3.0
        };
        let mut n_inside = 0;
        for _ in 0..400 {
            let [from, to] = [0, 1].map(|_| DVec3::new(random(), random(), random()));
            let found = cut(&hull, from, to);
            for share in [0.13, 0.37, 0.51, 0.83] {
                let place = from.lerp(to, share);
                let at = from.distance(place);
                let is_near_end = found.iter().flatten().any(|end| (end - at).abs() < 1e-6);
                let is_inside = found.iter().any(|[from, to]| (*from..=*to).contains(&at));
                n_inside += usize::from(is_inside);
                assert!(is_near_end || hull.contains(place, &mut scratch) == is_inside, "{place}: {found:?}");
            }
        }
        assert!(n_inside > 50, "{n_inside}");
    }

    #[test]
    fn an_eye_in_a_camera_sees_all_of_its_cone_or_nothing() {
        let hull = ball(8);
        let eye = hull.views()[0].camera().pose().position_in_world;
        assert_eq!(cut(&hull, eye, DVec3::ZERO).len(), 1);
        assert_eq!(cut(&hull, eye, DVec3::new(0.0, 0.0, 2.5)).len(), 0);
        // From within the hull, and through a camera on the way.
        assert_eq!(cut(&hull, DVec3::ZERO, DVec3::X).first().map(|ends| ends[0]), Some(0.0));
        let found = cut(&hull, eye * 2.0, DVec3::ZERO);
        assert_eq!(found.len(), 1, "{found:?}");
    }

    #[test]
    fn cameras_in_one_place_opposite_each_other_and_in_a_line_give_a_hull() {
        let check = |eyes: &[DVec3]| {
            let views =
                eyes.iter().map(|eye| seen(camera(*eye), |ray| meets_ball(ray, DVec3::ZERO))).collect();
            let hull = Hull::new(views, 2).expect("a hull");
            let found = cut(&hull, DVec3::new(0.0, 9.0, 0.0), DVec3::ZERO);
            assert!(found.iter().flatten().all(|end| end.is_finite()), "{eyes:?}: {found:?}");
            assert!(found.iter().any(|[from, to]| (*from..=*to).contains(&9.0)), "{eyes:?}: {found:?}");
        };
        check(&[DVec3::X * 5.0, DVec3::X * 5.0]);
        check(&[DVec3::X * 5.0, DVec3::X * -5.0]);
        check(&[DVec3::X * 4.0, DVec3::X * 5.0, DVec3::X * 6.0]);
    }

    #[test]
    fn what_a_picture_does_not_show_is_not_taken_away_by_it() {
        // The ball is half beside the second camera's picture.
        let aside =
            Pose::looking_at(DVec3::new(0.0, 5.0, 0.0), DVec3::new(2.0, 0.0, 0.0)).expect("a direction");
        let size = (SIZE as u32, SIZE as u32);
        let middle = DVec2::splat(SIZE as f64 / 2.0);
        let cut_off =
            Camera::new(size, DVec2::splat(300.0), middle, Distortion::None, aside).expect("a camera");
        let views: Vec<View> = eyes(6)
            .map(camera)
            .chain([cut_off])
            .map(|camera| seen(camera, |ray| meets_ball(ray, DVec3::ZERO)))
            .collect();
        assert!(views[6].touches_border() && !views[0].touches_border());
        let hull = Hull::new(views, 2).expect("a hull");
        for place in [DVec3::new(-0.9, 0.0, 0.0), DVec3::new(0.9, 0.0, 0.0), DVec3::new(-0.5, 0.6, 0.3)] {
            assert!(hull.contains(place, &mut Vec::new()), "{place}");
        }
        // What but one camera sees is no hull.
        let seen_by_one = DVec3::new(2.0, -60.0, 0.0);
        assert!(!hull.contains(seen_by_one, &mut Vec::new()));
    }

    #[test]
    fn empty_and_full_silhouettes_are_what_they_say() {
        let with = |is_inside: bool| {
            let views = eyes(4).map(|eye| seen(camera(eye), |ray| meets_ball(ray, DVec3::ZERO)));
            let last = seen(camera(DVec3::new(0.0, 0.0, 6.0)), |_| is_inside);
            Hull::new(views.chain([last]).collect(), 2).expect("a hull")
        };
        // Where the last camera sees it: what lies beside its picture it does not take away.
        let left = cut(&with(false), DVec3::X * 9.0, DVec3::ZERO);
        assert!(left.iter().all(|[from, to]| *to < 9.0 - 2.3 || *from > 9.0 + 2.3), "{left:?}");
        let whole = cut(&with(true), DVec3::X * 9.0, DVec3::ZERO);
        assert!(whole.iter().any(|[from, to]| *from < 8.1 && *to > 9.9), "{whole:?}");
    }

    #[test]
    fn what_makes_no_view_or_no_hull_is_refused() {
        let of = |width, n| View::new(camera(DVec3::X * 5.0), (width, vec![true; n]), 0.0);
        assert!(matches!(of(0, 0), Err(HullError::NoPicture { .. })));
        assert!(matches!(of(7, 20), Err(HullError::NoPicture { width: 7, n_values: 20 })));
        let one = of(4, 16).expect("a view");
        assert!(matches!(Hull::new(vec![one.clone()], 2), Err(HullError::Count { n: 1, least: 2, .. })));
        assert!(matches!(Hull::new(vec![one; 1025], 2), Err(HullError::Count { n: 1025, .. })));
    }

    #[test]
    fn thousands_of_corners_and_many_views_stay_finite() {
        // A star with as many corners as pixels allow.
        let star = |ray: &Ray| {
            let at = ray.direction;
            meets_ball(ray, DVec3::ZERO) && ((at.z * 4000.0).sin() > -0.9 || at.z.abs() < 0.02)
        };
        let views: Vec<View> = eyes(64).map(|eye| seen(camera(eye), star)).collect();
        let hull = Hull::new(views, 2).expect("a hull");
        let found = cut(&hull, DVec3::new(9.0, 0.1, 0.05), DVec3::ZERO);
        assert!(!found.is_empty() && found.iter().flatten().all(|end| end.is_finite()));
        assert!(found.windows(2).all(|pair| pair[0][1] <= pair[1][0]));
    }
}
