//! Silhouettes of entities: what every camera that sees one has of it, as the hull of them all.
//!
//! A camera takes away only what it surely sees beside the entity. What it does not see, beyond its picture's border or behind a
//! building, it leaves to the others, so that somebody who is half hidden from one camera is not cut in half; of several people in
//! one blob it takes none away from any other, and the other cameras part them.
//!
//! Frames of cameras that are not of one instant show who walks in several places. What moves by `d` between a frame and the mean
//! instant of all is seen by that frame's camera as it would be, at the mean instant, by one that stands `d` further on: cameras are
//! moved, and silhouettes, textures and rays follow.

use super::billboard::MOVING;
use super::{Billboard, CameraState, Entity, HullMemory, SceneState};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::{Camera, NEAR_M, Surfaces, distance_to_stretch};
use videofields_vision::hull::{Bounds, Hull, Shell, View, Window};
use videofields_vision::segment::{DistanceTransform, PixelRect};

/// Least value of the soft mask that is inside a silhouette: half of its ramp.
const LEAST_SOFT: u8 = 128;

/// Pixels by which a window reaches beyond what may show the entity.
const MARGIN_PX: f64 = 2.0;

/// Pixels of a square in which one ray tells whether a building stands before the entity.
const CELL_PX: usize = 8;

/// What an entity's bounds have beyond what its billboards say: a share of them, and metres.
const WIDER: f64 = 0.1;
const BESIDE_M: f64 = 0.1;
const BENEATH_M: f64 = 0.08;
const TALLER: f64 = 1.06;
const ABOVE_M: f64 = 0.08;

/// Most of a foot's uncertainty that bounds are widened by, metres.
const MOST_UNCERTAIN_M: f64 = 0.15;

/// By how much what an entity reached to of late may be exceeded.
const LARGER: f64 = 1.4;

/// Reach of bodies from the line between foot and head, metres, where nearer people hide them.
const BODY_M: f64 = 0.3;

/// Half the side of bounds where cameras do not agree on any place, metres.
const UNAGREED_M: f64 = 0.6;

/// Cameras whose frames are further apart in time are not moved, seconds: nobody goes on straight for so long.
pub const MOST_MOVED_S: f64 = 0.5;

/// Silhouettes of fewer cameras are no hull.
pub const LEAST_VIEWS: usize = 2;

/// How hulls are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HullMaking {
    /// By how much outlines may be simplified, at most, pixels of the masks.
    pub error_px: f64,
    /// Voxels along the longest side of an entity's bounds, where it is to be carved.
    pub n_voxels: Option<u32>,
}

/// One entity as its silhouettes have it.
#[derive(Clone, Debug)]
pub struct EntityHull {
    /// Index into [`SceneState::entities`].
    pub entity_idx: usize,
    /// Lower and upper corner of the box that it is looked for in, metres.
    pub bounds_in_world: [DVec3; 2],
    /// Of each view of the hull, index into [`SceneState::cameras`]; at least [`LEAST_VIEWS`].
    pub cameras: Vec<usize>,
    /// How far apart the cameras' frames are in time, seconds.
    pub skew_s: f64,
    /// By how much the silhouettes may still be those of two places, standard deviation, metres: what is not known of how far the
    /// entity went meanwhile.
    pub apart_m: f64,
    /// The silhouettes, of cameras that stand further on by what the entity has moved between their frames and the mean of all.
    pub hull: Hull,
    /// Of each view, how far its pixels lie within its silhouette ([`View::distances`]).
    pub distances: Vec<Mask>,
    /// Its outermost voxels, where they were asked for and there are any.
    pub shell: Option<Shell>,
}

impl SceneState {
    /// Makes the hull of every entity that several cameras see, in place of those that there are. Where a lens sees a right angle or
    /// more from its axis, that camera is left out. What `memory` has is not made again.
    ///
    /// **Cost** linear in the pixels of the entities' windows, and a ray for every 8 x 8 of them; voxels as [`Shell::carve`]. On all
    /// processors.
    pub fn place_hulls(&mut self, making: HullMaking, memory: &mut HullMemory) {
        memory.begin();
        let known: Vec<Option<Arc<EntityHull>>> =
            (0..self.entities.len()).map(|idx| memory.get(self, idx, making)).collect();
        let of = |(entity_idx, known): (usize, Option<Arc<EntityHull>>)| {
            known.map(|known| (known, false)).or_else(|| {
                let hull = self.hull_of(entity_idx, &self.entities[entity_idx], making)?;
                Some((Arc::new(hull), true))
            })
        };
        let found: Vec<(Arc<EntityHull>, bool)> = known.into_par_iter().enumerate().filter_map(of).collect();
        for (hull, _) in found.iter().filter(|(_, is_new)| *is_new) {
            memory.insert(self, making, hull);
        }
        memory.end();
        self.hulls = found.into_iter().map(|(hull, _)| hull).collect();
    }

    fn hull_of(&self, entity_idx: usize, entity: &Entity, making: HullMaking) -> Option<EntityHull> {
        let mut seen_by: Vec<usize> = entity.sources.iter().map(|source| source.camera_idx).collect();
        seen_by.dedup();
        if seen_by.len() < LEAST_VIEWS {
            return None;
        }
        let frames = Frames::of(self, &seen_by);
        let bounds_in_world = bounds(entity);
        let mut cameras: Vec<usize> = Vec::new();
        let mut views: Vec<View> = Vec::new();
        for source in &entity.sources {
            let state = &self.cameras[source.camera_idx];
            // What one camera sees in several pieces is one silhouette.
            if cameras.contains(&source.camera_idx) {
                continue;
            }
            let pieces: Vec<(PixelRect, u16)> = entity
                .sources
                .iter()
                .filter(|of| of.camera_idx == source.camera_idx)
                .map(|of| (of.rect, of.owner))
                .collect();
            let moved_m = entity.velocity.over_ground_m_per_s * frames.to_mean(state);
            let Ok(camera) = (*state.corrected).clone().moved(moved_m.extend(0.0)) else { continue };
            let window =
                silhouette((state, &camera), &self.scene.surfaces, (entity, bounds_in_world), &pieces);
            let view = window.map(|window| View::within(camera, window, making.error_px));
            if let Some(Ok(view)) = view {
                cameras.push(source.camera_idx);
                views.push(view);
            }
        }
        if cameras.len() < LEAST_VIEWS {
            return None;
        }
        let skew_s = frames.skew_s;
        let unknown_m_per_s = if frames.are_moved() {
            entity.velocity.sd_m_per_s
        } else {
            entity.velocity.over_ground_m_per_s.length().hypot(entity.velocity.sd_m_per_s)
        };
        let apart_m = unknown_m_per_s * skew_s;
        // Within its bounds, what but one camera sees may be part of it.
        let mut transform = DistanceTransform::default();
        let distances = views.iter().map(|view| view.distances(&mut transform)).collect();
        let hull = Hull::new(views, 1).ok()?;
        let [low, high] = bounds_in_world;
        // Silhouettes that have nothing in common leave nothing to draw.
        let shell = making.n_voxels.zip(Bounds::new(low, high));
        let shell = shell.and_then(|(n_voxels, bounds)| Shell::carve(&hull, &bounds, n_voxels).ok());
        Some(EntityHull { entity_idx, bounds_in_world, cameras, skew_s, apart_m, hull, distances, shell })
    }
}

impl EntityHull {
    /// Bytes that it takes, but for some that do not grow.
    pub(super) fn n_bytes(&self) -> usize {
        let of = |view: &View| {
            let [width, height] = view.size_px();
            width * height + view.outside().n_bytes()
        };
        let distances = self.distances.iter().map(|mask| mask.data.len());
        let shell = self.shell.as_ref().map_or(0, |shell| size_of_val(shell.voxels.as_slice()));
        self.hull.views().iter().map(of).chain(distances).sum::<usize>() + shell
    }
}

/// When several cameras' frames are.
struct Frames {
    mean: Timestamp,
    /// From the first to the last, seconds.
    skew_s: f64,
}

impl Frames {
    fn of(state: &SceneState, cameras: &[usize]) -> Self {
        let at = |idx: &usize| state.cameras[*idx].observation.frame.timestamp;
        let first = cameras.iter().map(at).min().unwrap_or(state.instant);
        let since: Vec<f64> = cameras.iter().map(|idx| at(idx).secs_since(first)).collect();
        let skew_s = since.iter().copied().fold(0.0, f64::max);
        let mean_s = since.iter().sum::<f64>() / since.len().max(1) as f64;
        Self { mean: first.saturating_add_nanos((mean_s * 1e9).round() as i64), skew_s }
    }

    const fn are_moved(&self) -> bool {
        self.skew_s <= MOST_MOVED_S
    }

    /// Seconds from a camera's frame to the mean; 0 where frames are too far apart to be brought together.
    fn to_mean(&self, of: &CameraState) -> f64 {
        if self.are_moved() { self.mean.secs_since(of.observation.frame.timestamp) } else { 0.0 }
    }
}

/// What holds an entity: on the ground where all its cameras' billboards may be, each a strip along the way that its camera looks;
/// upwards what the tallest are. Who sits has their feet at one end of it.
fn bounds(entity: &Entity) -> [DVec3; 2] {
    let variance = entity.foot_covariance_m2.x_axis.x.max(entity.foot_covariance_m2.y_axis.y).max(0.0);
    let beside_m = BESIDE_M + variance.sqrt().min(MOST_UNCERTAIN_M);
    let reach_m = |source: &Billboard| source.left_right_m[0].abs().max(source.left_right_m[1].abs());
    let widest_m = entity.sources.iter().map(reach_m).fold(0.0, f64::max);
    let foot = entity.foot_in_world;
    // No strip is as long as two of the widest; and nobody is suddenly much larger than they were alone.
    let most_m = entity.reach_m.map_or(f64::INFINITY, |reach_m| LARGER * reach_m);
    let half = (2.0 * widest_m).min(most_m) + beside_m;
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    let mut place: Vec<DVec2> = corners.map(|corner| foot.truncate() + DVec2::from_array(corner)).to_vec();
    for source in &entity.sources {
        let [left, right] = source.left_right_m;
        let (across, from) = (source.right_in_world.truncate(), source.foot_in_world.truncate());
        let more_m = beside_m + WIDER * (right - left).abs();
        place = cut(&place, from + across * (right + more_m), across);
        place = cut(&place, from + across * (left - more_m), -across);
    }
    let nothing = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let (low, high) = place.iter().fold(nothing, |(low, high), at| (low.min(*at), high.max(*at)));
    let (low, high) = if place.len() < 3 {
        (foot.truncate() - UNAGREED_M, foot.truncate() + UNAGREED_M)
    } else {
        (low, high)
    };
    [low.extend(foot.z - BENEATH_M), high.extend(foot.z + entity.height_m * TALLER + ABOVE_M)]
}

/// What of a convex polygon does not lie beyond the line through `at` across `outwards`.
fn cut(polygon: &[DVec2], at: DVec2, outwards: DVec2) -> Vec<DVec2> {
    let beyond = |place: DVec2| (place - at).dot(outwards);
    let mut left = Vec::with_capacity(polygon.len() + 1);
    for (idx, place) in polygon.iter().enumerate() {
        let next = polygon[(idx + 1) % polygon.len()];
        let (here, there) = (beyond(*place), beyond(next));
        if here <= 0.0 {
            left.push(*place);
        }
        if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
            left.push(place.lerp(next, here / (here - there)));
        }
    }
    left
}

/// Returns the silhouette of an entity in one camera's picture, in the part that may show `bounds` to the camera where it is taken to
/// stand. `pieces` are the rectangles of what it shows of the entity, with their owners' numbers.
fn silhouette(
    (state, moved): (&CameraState, &Camera),
    surfaces: &Surfaces,
    (entity, bounds): (&Entity, [DVec3; 2]),
    pieces: &[(PixelRect, u16)],
) -> Option<Window> {
    let (labels, soft) = (&*state.observation.labels, &*state.observation.soft_mask);
    let [columns, rows] = seen_at(moved, bounds, [labels.width, labels.height]);
    let (width, height) = (columns.len(), rows.len());
    if width == 0 || height == 0 {
        return None;
    }
    let moves = |x: usize, y: usize| {
        let (x, y) = ((columns.start + x) as u32, (rows.start + y) as u32);
        (labels.get(x, y) == MOVING || soft.get(x, y) >= LEAST_SOFT)
            && pieces.iter().any(|(_, owner)| state.may_show(*owner, (x, y)))
    };
    let mut is_inside = joined(moves, (&columns, &rows), pieces.iter().map(|(rect, _)| *rect));
    let distance_m = entity.foot_in_world.distance(state.corrected.pose().position_in_world);
    let nearer_than_m = distance_m - (bounds[1] - bounds[0]).truncate().length() / 2.0;
    let is_hidden = |x: usize, y: usize| {
        let size = DVec2::new(f64::from(labels.width), f64::from(labels.height));
        let at = DVec2::new((columns.start + x) as f64 + 0.5, (rows.start + y) as f64 + 0.5);
        let hit = state.corrected.ray(at / size).and_then(|ray| surfaces.hit(&ray, 0.0));
        // The ground before its feet hides nothing.
        hit.is_some_and(|hit| {
            let distance_m = hit.point_in_world.distance(state.corrected.pose().position_in_world);
            distance_m < nearer_than_m && hit.point_in_world.z > bounds[0].z + 2.0 * BENEATH_M
        })
    };
    open_hidden((width, height), &mut is_inside, is_hidden);
    open_behind_people((state, moved), (entity, pieces), (&columns, &rows), &mut is_inside);
    Some(Window {
        picture_px: [labels.width as usize, labels.height as usize],
        left_top: [columns.start, rows.start],
        width,
        is_inside,
    })
}

/// Lets what nearer people hide of somebody be inside a window of the picture: other cameras tell what is there.
fn open_behind_people(
    (state, moved): (&CameraState, &Camera),
    (entity, pieces): (&Entity, &[(PixelRect, u16)]),
    (columns, rows): (&std::ops::Range<usize>, &std::ops::Range<usize>),
    is_inside: &mut [bool],
) {
    let Some(owners) = &state.owners else { return };
    let own = |number: u16| pieces.iter().any(|(_, owner)| *owner == number);
    let Some(own_m) = pieces.iter().find_map(|(_, owner)| owners.distance_m(*owner)) else { return };
    let labels = &state.observation.labels;
    let size = DVec2::new(f64::from(labels.width), f64::from(labels.height));
    let end = |up_m: f64| {
        let seen = moved.project(entity.foot_in_world + DVec3::Z * up_m)?;
        Some((seen.texture * size, seen.depth_m))
    };
    let Some(((foot, depth_m), (head, _))) = end(0.0).zip(end(entity.height_m)) else { return };
    let focal_px = state.corrected.focal_px().x * size.x / f64::from(state.corrected.size_px().0);
    let reach_px = BODY_M * focal_px / depth_m.max(NEAR_M);
    let hides = |x: usize, y: usize| {
        let number = owners.at(x as u32, y as u32);
        let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        !own(number)
            && owners.distance_m(number).is_some_and(|of| of < own_m)
            && distance_to_stretch(at, [foot, head]) <= reach_px
    };
    for (row, y) in rows.clone().enumerate() {
        for (column, x) in columns.clone().enumerate() {
            is_inside[row * columns.len() + column] |= hides(x, y);
        }
    }
}

/// The columns and rows of a picture that may show a box; all where part of it is beside the lens or behind the camera.
fn seen_at(camera: &Camera, [low, high]: [DVec3; 2], size: [u32; 2]) -> [std::ops::Range<usize>; 2] {
    let size_px = DVec2::new(f64::from(size[0]), f64::from(size[1]));
    let pick =
        |bit: usize, low: f64, high: f64, corner: usize| if corner >> bit & 1 == 0 { low } else { high };
    let corners = (0..8).map(|corner| {
        let at = |axis: usize| pick(axis, low[axis], high[axis], corner);
        camera.project(DVec3::new(at(0), at(1), at(2))).map(|seen| seen.texture * size_px)
    });
    let whole = [DVec2::ZERO, size_px];
    let seen: Option<Vec<DVec2>> = corners.collect();
    let [low, high] = seen.map_or(whole, |corners| {
        let nothing = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = corners.iter().fold(nothing, |(low, high), at| (low.min(*at), high.max(*at)));
        [low - MARGIN_PX, high + MARGIN_PX]
    });
    [0, 1].map(|axis| {
        let most = size_px[axis];
        low[axis].floor().clamp(0.0, most) as usize..high[axis].ceil().clamp(0.0, most) as usize
    })
}

/// Returns true for each pixel of a window that `moves` (asked by its column and row there) and is joined, within the window, to one that
/// moves in the rectangles of the picture.
fn joined(
    moves: impl Fn(usize, usize) -> bool,
    (columns, rows): (&std::ops::Range<usize>, &std::ops::Range<usize>),
    rects: impl Iterator<Item = PixelRect>,
) -> Vec<bool> {
    let (width, height) = (columns.len(), rows.len());
    let mut is_inside = vec![false; width * height];
    let mut open: Vec<(usize, usize)> = Vec::new();
    for rect in rects {
        let within = |range: &std::ops::Range<usize>, first: u32, n: u32| {
            let clamped = |at: usize| at.clamp(range.start, range.end) - range.start;
            clamped(first as usize)..clamped((first + n) as usize)
        };
        for y in within(rows, rect.y, rect.height) {
            open.extend(within(columns, rect.x, rect.width).filter(|x| moves(*x, y)).map(|x| (x, y)));
        }
    }
    while let Some((x, y)) = open.pop() {
        if std::mem::replace(&mut is_inside[y * width + x], true) {
            continue;
        }
        for y in y.saturating_sub(1)..(y + 2).min(height) {
            let beside = x.saturating_sub(1)..(x + 2).min(width);
            open.extend(beside.filter(|x| !is_inside[y * width + x] && moves(*x, y)).map(|x| (x, y)));
        }
    }
    is_inside
}

/// Lets all be inside where something stands before the entity, which is looked up once a cell, and in the cells around.
fn open_hidden(
    (width, height): (usize, usize),
    is_inside: &mut [bool],
    is_hidden: impl Fn(usize, usize) -> bool,
) {
    let cells = |n: usize| n.div_ceil(CELL_PX);
    for row in 0..cells(height) {
        for column in 0..cells(width) {
            let middle = |cell: usize, n: usize| (cell * CELL_PX + CELL_PX / 2).min(n - 1);
            if !is_hidden(middle(column, width), middle(row, height)) {
                continue;
            }
            let around = |cell: usize, n: usize| {
                (cell * CELL_PX).saturating_sub(CELL_PX / 2)..(cell * CELL_PX + CELL_PX + CELL_PX / 2).min(n)
            };
            for y in around(row, height) {
                is_inside[y * width..(y + 1) * width][around(column, width)].fill(true);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::OwnerMap;
    use crate::occupancy::drawn_people::{around, mask as drawn, observation, scene};

    fn mask(rows: &[&str]) -> Mask {
        let data: Vec<u8> =
            rows.iter().flat_map(|row| row.bytes()).map(|at| 255 * u8::from(at == b'#')).collect();
        Mask { width: rows[0].len() as u32, height: rows.len() as u32, data: data.into() }
    }

    /// An entity at the origin, of cameras that look along these directions and see it between these metres.
    fn entity(sources: &[(DVec2, [f64; 2])]) -> Entity {
        let source = |(camera_idx, (look, left_right_m)): (usize, &(DVec2, [f64; 2]))| Billboard {
            camera_idx,
            rect: PixelRect { x: 0, y: 0, width: 9, height: 9 },
            foot_in_world: DVec3::ZERO,
            right_in_world: DVec3::new(look.y, -look.x, 0.0),
            left_right_m: *left_right_m,
            height_m: 1.2,
            is_truncated: false,
            owner: 0,
            shown_share: 1.0,
        };
        Entity {
            id: 1,
            foot_in_world: DVec3::ZERO,
            foot_covariance_m2: glam::DMat2::ZERO,
            velocity: super::super::Velocity::UNKNOWN,
            reach_m: None,
            height_m: 1.2,
            sources: sources.iter().enumerate().map(source).collect(),
        }
    }

    #[test]
    fn a_camera_that_sees_two_parts_of_somebody_is_one_of_their_cameras() {
        let mut seen = entity(&[(DVec2::Y, [-0.3, 0.3]), (DVec2::X, [-0.3, 0.3]), (DVec2::X, [-0.1, 0.1])]);
        for (source, camera_idx) in seen.sources.iter_mut().zip([1, 4, 4]) {
            source.camera_idx = camera_idx;
        }
        assert_eq!(seen.cameras().collect::<Vec<_>>(), [1, 4]);
    }

    #[test]
    fn bounds_lie_where_all_cameras_may_have_it() {
        // Who sits, feet at the origin and the back at y = 0.8, is narrow from the front and long from the side.
        let seated = [(DVec2::Y, [-0.25, 0.25]), (DVec2::NEG_X, [-0.1, 0.8])];
        let [low, high] = bounds(&entity(&seated));
        for (axis, expected) in [(0, [-0.4, 0.4]), (1, [-0.29, 0.99]), (2, [-0.08, 1.352])] {
            assert!((low[axis] - expected[0]).abs() < 1e-9, "{axis}: {low}");
            assert!((high[axis] - expected[1]).abs() < 1e-9, "{axis}: {high}");
        }
        // One camera has three people in one blob: the others tell them apart.
        let merged = [(DVec2::Y, [-0.25, 2.5]), (DVec2::NEG_X, [-0.3, 0.3]), (DVec2::NEG_Y, [-0.3, 0.3])];
        let [low, high] = bounds(&entity(&merged));
        assert!((high - low).truncate().max_element() < 1.0, "{low} {high}");
        // All have it in one blob with others: no more than it was before is its own.
        let wide = [(DVec2::Y, [-2.0, 2.5]), (DVec2::NEG_X, [-2.2, 2.0])];
        let known = Entity { reach_m: Some(0.3), ..entity(&wide) };
        let [low, high] = bounds(&known);
        assert!((high - low).truncate().max_element() < 2.0 * (1.4 * 0.3 + 0.11), "{low} {high}");
        assert!((high - low).truncate().min_element() > 0.8, "{low} {high}");
        // Cameras that have it in two places.
        let apart = [(DVec2::Y, [3.0, 3.5]), (DVec2::Y, [-3.5, -3.0])];
        let [low, high] = bounds(&entity(&apart));
        assert!((high - low).truncate() == DVec2::splat(2.0 * UNAGREED_M) && low.is_finite());
    }

    #[test]
    fn what_is_joined_to_its_rectangle_is_the_entitys_and_nothing_else() {
        let labels = mask(&["##..#...", "##..#...", ".#..##..", "....#..#", ".......#"]);
        let moves = |x: usize, y: usize| labels.get(x as u32, y as u32) == MOVING;
        let one = |x, y, width, height| std::iter::once(PixelRect { x, y, width, height });
        let found = joined(moves, (&(0..8), &(0..5)), one(3, 0, 2, 2));
        let shown: Vec<String> = found
            .chunks(8)
            .map(|row| row.iter().map(|is_in| if *is_in { '#' } else { '.' }).collect())
            .collect();
        assert_eq!(shown, ["....#...", "....#...", "....##..", "....#...", "........"]);
        // In a window, places are the window's.
        let found = joined(|x, y| moves(x + 4, y + 1), (&(4..6), &(1..3)), one(0, 0, 8, 5));
        assert_eq!(found, [true, false, true, true]);
        let none = joined(|x, y| moves(x + 2, y), (&(2..4), &(0..2)), std::iter::empty());
        assert!(none.iter().all(|is_in| !is_in));
    }

    #[test]
    fn what_nearer_people_hide_is_left_to_other_cameras_and_what_farther_ones_do_is_not() {
        let size = (40_u32, 30_u32);
        let (eye, target) = (DVec3::new(0.0, -8.0, 0.9), DVec3::new(0.0, 0.0, 0.9));
        let camera = Camera::pinhole(eye, target, 0.3, size).unwrap();
        let id = videofields_vision::frame::CameraId::new("a").unwrap();
        let observation = observation(id.clone(), Mask::filled(size.0, size.1, 0));
        let mut state = CameraState::new(id, Arc::new(camera), observation);
        // Upper rows are the nearest's, lower ones the entity's own, those between whose is behind it.
        let cells =
            (0..size.1).flat_map(|row| (0..size.0).map(move |_| [1, 3, 2][row as usize / 10])).collect();
        state.owners = Some(Arc::new(OwnerMap::new(size, 1, cells, Box::new([4.0, 8.0, 12.0]))));
        let entity = Entity { height_m: 1.8, ..entity(&[(DVec2::Y, [-0.3, 0.3])]) };
        let rect = PixelRect { x: 0, y: 20, width: 40, height: 10 };
        let opened = |owner: u16, moved: &Camera| {
            let mut is_inside = vec![false; 20 * 30];
            open_behind_people(
                (&state, moved),
                (&entity, &[(rect, owner)]),
                (&(10..30), &(0..30)),
                &mut is_inside,
            );
            is_inside
        };
        let found = opened(2, &state.corrected);
        let top = state.corrected.project(DVec3::new(0.0, 0.0, 1.8)).unwrap().texture.y * 30.0;
        let beside = state.corrected.project(DVec3::new(BODY_M, 0.0, 0.9)).unwrap().texture.x * 40.0;
        assert!((1.0..6.0).contains(&top) && (22.5..30.0).contains(&beside), "{top} {beside}");
        for (place, is_in) in found.iter().enumerate() {
            let (x, y) = (place % 20 + 10, place / 20);
            let (off, row) = ((x as f64 + 0.5 - 20.0).abs(), y as f64 + 0.5);
            if off > beside - 20.0 + 0.01 || y >= 10 {
                assert!(!is_in, "{x} {y}");
            } else if row > top {
                assert!(*is_in, "{x} {y}");
            }
        }
        assert!(opened(0, &state.corrected).iter().all(|is_in| !is_in), "nobody is told apart");
        assert!(opened(1, &state.corrected).iter().all(|is_in| !is_in), "the nearest is hidden by nobody");
        // The frame is of where it stood before: its camera is taken to stand further on.
        let moved = (*state.corrected).clone().moved(DVec3::new(-0.4, 0.0, 0.0)).unwrap();
        let [here, there] = [&found, &opened(2, &moved)].map(|of| (0..20).find(|x| of[6 * 20 + x]).unwrap());
        assert!(there >= here + 3, "{here} {there}");
    }

    #[test]
    fn a_silhouette_is_cut_by_its_owner() {
        let size = (40_u32, 30_u32);
        let (eye, target) = (DVec3::new(0.0, -8.0, 0.9), DVec3::new(0.0, 0.0, 0.9));
        let camera = Camera::pinhole(eye, target, 0.3, size).unwrap();
        let id = videofields_vision::frame::CameraId::new("a").unwrap();
        // All moves; the left half is the entity's, the right half somebody's behind it.
        let cells = (0..size.1).flat_map(|_| (0..size.0).map(|x| if x < 20 { 1 } else { 2 })).collect();
        let observation = observation(id.clone(), Mask::filled(size.0, size.1, MOVING));
        let mut state = CameraState::new(id, Arc::new(camera), observation);
        state.owners = Some(Arc::new(OwnerMap::new(size, 1, cells, Box::new([8.0, 12.0]))));
        let entity = entity(&[(DVec2::Y, [-0.3, 0.3])]);
        let rect = PixelRect { x: 0, y: 0, width: 40, height: 30 };
        let bounds = [DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 1.8)];
        let views = (&state, &*state.corrected);
        let window = silhouette(views, &Surfaces::default(), (&entity, bounds), &[(rect, 1)]).unwrap();
        for (place, is_in) in window.is_inside.iter().enumerate() {
            let x = window.left_top[0] + place % window.width;
            assert_eq!(*is_in, x < 20, "{x}");
        }
    }

    #[test]
    fn a_hull_that_is_kept_is_made_anew_where_pixels_have_another_owner() {
        let cameras = around(DVec3::ZERO);
        let scene = scene(DVec3::ZERO, "", &cameras);
        let seen = |id: &videofields_vision::frame::CameraId| {
            let idx = scene.cameras.iter().position(|member| member.id == *id)?;
            Some(observation(id.clone(), drawn(&scene, &cameras[idx], &[(DVec3::ZERO, 1.7)])))
        };
        let mut state = crate::fuse::assemble(&scene, Timestamp::from_nanos(0), seen, None);
        let (making, mut memory) = (HullMaking { error_px: 0.5, n_voxels: None }, HullMemory::default());
        let mut made = |state: &mut SceneState| {
            state.place_hulls(making, &mut memory);
            Arc::clone(&state.hulls[0])
        };
        let first = made(&mut state);
        assert!(Arc::ptr_eq(&made(&mut state), &first));
        state.cameras[1].owners = None;
        assert!(!Arc::ptr_eq(&made(&mut state), &first));
    }

    #[test]
    fn what_a_building_hides_is_left_to_other_cameras() {
        let mut is_inside = vec![false; 40 * 24];
        open_hidden((40, 24), &mut is_inside, |x, _| x >= 24);
        for (i, is_in) in is_inside.iter().enumerate() {
            assert_eq!(*is_in, i % 40 >= 20, "{i}");
        }
    }
}
