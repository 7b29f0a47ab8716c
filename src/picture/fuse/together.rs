//! People whom the masks of several cameras tell together: a sighting for each of them and each camera that shows them.
//!
//! Observations of one instant flow in; sightings cut by person flow out, and what of a camera's blobs is nobody's. Who is who is
//! association's to tell.

mod doubt;

use super::billboard::{EXTENT_RANGE_M, MAX_OUTLINE_ROWS, MOVING, UprightPlane};
use super::estimate::{Estimate, Foot, Height, along};
use super::line::Followed;
use super::look::Look;
use super::pieces::Piece;
use super::{Billboard, CameraState, Sighting};
use crate::occupancy::{Expected, Occupancy, Owned, OwnerMap, Owners, Person};
use crate::scene::Scene;
use glam::{DMat2, DVec2};
use std::sync::Arc;
use videofields_vision::frame::Mask;
use videofields_vision::segment::PixelRect;

/// People whom fewer cameras show are left to these cameras' own blobs.
const LEAST_CAMERAS: usize = 2;

/// A camera shows somebody of whom it has this share of what it could see, and so many pixels of the reduced mask.
const LEAST_FOUND: f32 = 0.4;
const LEAST_FOUND_PX: u32 = 8;

/// A blob is left to its camera if this share of it is nobody's.
const LEAST_OPEN: f64 = 0.4;

/// Least share of what a track and somebody cover together that both cover, for the track to be theirs.
const LEAST_COMMON: f64 = 0.3;

/// Standard deviations of a place by one camera's outline: across its view, metres and pixels of the reduced mask, and along it, metres.
const ACROSS_M: f64 = 0.06;
const ACROSS_PX: f64 = 1.0;
const ALONG_M: f64 = 0.5;

/// Standard deviation of a height, metres.
const HEIGHT_M: f64 = 0.1;

/// Least share of what a camera could see of somebody with which their colours are told.
const LEAST_LOOK: f32 = 0.6;

/// People at one instant, with their pixels in each camera.
pub(super) struct Together {
    people: Vec<Person>,
    /// By camera of the scene.
    owners: Vec<Owners>,
    /// By person and camera of the scene: the track that shows them.
    tracks: Vec<Vec<Option<Followed>>>,
    /// By camera with an observation.
    maps: Vec<Option<Arc<OwnerMap>>>,
}

impl Together {
    /// Finds the people whom `cameras` show, of which `members` gives the places in the scene.
    pub(super) fn find(
        occupancy: &mut Occupancy,
        scene: &Arc<Scene>,
        (members, cameras): (&[usize], &[CameraState]),
        expected: &[Expected],
    ) -> Self {
        let labels = |member| {
            let idx = members.iter().position(|of| *of == member)?;
            Some(&*cameras[idx].observation.labels)
        };
        let mut people = occupancy.find(scene, labels, expected);
        let mut owners = occupancy.owners(scene, &people);
        let n_cameras = |person: usize| owners.iter().filter(|of| is_shown(&of.people[person])).count();
        let n_found = people.len();
        let is_kept: Vec<bool> = (0..n_found).map(|person| n_cameras(person) >= LEAST_CAMERAS).collect();
        let mut kept = is_kept.iter();
        people.retain(|person| {
            let is_kept = *kept.next().unwrap_or(&false);
            if !is_kept {
                occupancy.uncover(person);
            }
            is_kept
        });
        if people.len() < n_found {
            owners = occupancy.owners(scene, &people);
        }
        let mut tracks = vec![vec![None; owners.len()]; people.len()];
        for (member, camera) in members.iter().zip(cameras) {
            for (person, track) in tracks_of(&owners[*member], camera) {
                let track = &camera.observation.tracks[track];
                let followed = Followed { member: *member, number: track.id, since: track.first_seen };
                tracks[person][*member] = Some(followed);
            }
        }
        let map = |(member, camera): (&usize, &CameraState)| {
            let mask = (*member, camera.observation.labels.width);
            let map = occupancy.owner_map((scene, &people), &owners[*member], mask);
            map.map(Arc::new)
        };
        let maps = members.iter().zip(cameras).map(map).collect();
        Self { people, owners, tracks, maps }
    }

    /// Gives each camera the map of whose what moves in its picture is.
    pub(super) fn give_maps(&self, cameras: &mut [CameraState]) {
        for (camera, map) in cameras.iter_mut().zip(&self.maps) {
            camera.owners.clone_from(map);
        }
    }

    /// Returns a sighting for each person and each camera that shows them.
    pub(super) fn sightings<'a>(
        &'a self,
        cameras: &'a [CameraState],
        members: &'a [usize],
    ) -> impl Iterator<Item = Sighting> + 'a {
        (0..self.people.len()).flat_map(move |person| {
            let shown = |(_, member): &(usize, &usize)| is_shown(&self.owners[**member].people[person]);
            let by: Vec<(usize, &usize)> = members.iter().enumerate().filter(shown).collect();
            let foot = self.foot(person, by.iter().map(|(idx, member)| (&cameras[*idx], **member)));
            let n = by.len() as f64;
            by.into_iter().filter_map(move |(idx, member)| {
                self.sighting(person, (idx, *member), &cameras[idx], (&foot, n))
            })
        })
    }

    /// Returns where somebody stands, by all cameras that show them.
    fn foot<'a>(&self, person: usize, by: impl Iterator<Item = (&'a CameraState, usize)>) -> Foot {
        let at = self.people[person].foot_in_world;
        let mut information = DMat2::ZERO;
        for (camera, member) in by {
            let from_camera = at - camera.corrected.pose().position_in_world;
            let away = from_camera.truncate().try_normalize().unwrap_or(DVec2::Y);
            let pixels = self.owners[member].width as f64 / f64::from(camera.corrected.size_px().0);
            let across_m =
                ACROSS_M.hypot(ACROSS_PX * from_camera.length() / (camera.corrected.focal_px().x * pixels));
            information += along(away.perp()) * across_m.powi(-2) + along(away) * ALONG_M.powi(-2);
        }
        Foot::new(at.truncate(), information.inverse())
    }

    /// Returns what one of `n` cameras shows of somebody. Each says what all say together, so that its part of that is one in `n`.
    fn sighting(
        &self,
        person: usize,
        (camera_idx, member): (usize, usize),
        state: &CameraState,
        (foot, n): (&Foot, f64),
    ) -> Option<Sighting> {
        let (of, owners) = (&self.people[person], &self.owners[member]);
        let owned = &owners.people[person];
        let labels = &state.observation.labels;
        let rect = rect_of(owned, owners, labels);
        let plane = UprightPlane::facing(&state.corrected, of.foot_in_world)?;
        let size = DVec2::new(owners.width as f64, owners.height as f64);
        let (mut left, mut right, mut top) = (f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
        let [x0, y0, x1, y1] = owned.bounds;
        let step = (y1 - y0).div_ceil(MAX_OUTLINE_ROWS as usize).max(1);
        for y in (y0..y1).step_by(step) {
            let is_own = |x: &usize| owners.get(*x, y) == Some(person);
            let Some((first, last)) = (x0..x1).find(is_own).zip((x0..x1).rev().find(is_own)) else {
                continue;
            };
            for x in [first as f64, last as f64 + 1.0] {
                let cut = |y: f64| plane.cut(&state.corrected, DVec2::new(x, y) / size);
                let (Some([across, _]), Some([_, up])) = (cut(y as f64 + 0.5), cut(y as f64)) else {
                    continue;
                };
                (left, right, top) = (left.min(across), right.max(across), top.max(up));
            }
        }
        let [least, most] = EXTENT_RANGE_M;
        let is_sound = |extent: f64| extent >= least && extent <= most;
        if !(is_sound(right - left) && is_sound(top)) {
            return None;
        }
        let is_truncated =
            rect.x == 0 || rect.x + rect.width >= labels.width || rect.y + rect.height >= labels.height;
        let billboard = Billboard {
            camera_idx,
            rect,
            foot_in_world: of.foot_in_world,
            right_in_world: plane.point([1.0, 0.0]) - plane.point([0.0, 0.0]),
            left_right_m: [left, right],
            height_m: top,
            is_truncated,
            owner: u16::try_from(person + 1).unwrap_or(OwnerMap::NOBODY),
            shown_share: (f64::from(owned.n_found) / of.area_px(member).max(1.0)).min(1.0),
        };
        let shows_much = owned.n_found as f32 >= LEAST_LOOK * owned.n_visible as f32;
        let factor = factor_of(owners, labels);
        let look = shows_much.then(|| {
            Look::of_pixels(&state.observation.frame.image, labels, rect, |x, y| {
                owners.get(x as usize / factor, y as usize / factor) == Some(person)
            })
        });
        let estimate = Estimate {
            foot: Foot::new(foot.at, foot.covariance * n),
            ground_m: of.foot_in_world.z,
            height: Some(Height { mean_m: of.height_m, sd_m: HEIGHT_M * n.sqrt() }),
            look: look.flatten(),
        };
        let tracks = self.tracks[person][member].into_iter().collect();
        Some(Sighting {
            billboard,
            member,
            estimate,
            head: None,
            tracks,
            person: Some(person),
            is_rest: false,
        })
    }

    /// Leaves of a camera's piece what nobody explains; returns false if that is too little to be somebody.
    pub(super) fn leave_open(&self, member: usize, labels: &Mask, piece: &mut Piece) -> bool {
        let owners = &self.owners[member];
        if owners.width == 0 {
            return true;
        }
        let factor = factor_of(owners, labels);
        let PixelRect { x, y, width, height } = piece.rect;
        let cells =
            |first: u32, n: u32| first as usize / factor..(first + n).div_ceil(factor as u32) as usize;
        let (mut n_all, mut n_open) = (0_u32, 0_u32);
        let mut bounds = [usize::MAX, usize::MAX, 0, 0];
        for row in cells(y, height) {
            for column in cells(x, width) {
                let middle = |cell: usize, n: u32| ((cell * factor + factor / 2) as u32).min(n - 1);
                if labels.get(middle(column, labels.width), middle(row, labels.height)) != MOVING {
                    continue;
                }
                n_all += 1;
                if owners.get(column, row).is_none() {
                    n_open += 1;
                    let [left, top, right, bottom] = bounds;
                    bounds = [left.min(column), top.min(row), right.max(column + 1), bottom.max(row + 1)];
                }
            }
        }
        if n_open == n_all {
            return true;
        }
        if f64::from(n_open) < LEAST_OPEN * f64::from(n_all) {
            return false;
        }
        let [left, top, right, bottom] = bounds.map(|at| (at * factor) as u32);
        let (left, top) = (left.max(x), top.max(y));
        let (right, bottom) = (right.min(x + width), bottom.min(y + height));
        piece.rect = PixelRect { x: left, y: top, width: right - left, height: bottom - top };
        piece.foot_in_image = [0.5 * f64::from(left + right), f64::from(bottom)];
        let taken = |track: &Followed| self.tracks.iter().any(|of| of[member] == Some(*track));
        piece.tracks.retain(|track| !taken(track));
        piece.whole = None;
        piece.is_rest = true;
        true
    }
}

/// Returns true if a camera shows somebody of whom it has these pixels.
fn is_shown(owned: &Owned) -> bool {
    owned.n_found >= LEAST_FOUND_PX && owned.n_found as f32 >= LEAST_FOUND * owned.n_visible as f32
}

/// Returns the sides of the pixels of `labels` that are one of `owners`.
fn factor_of(owners: &Owners, labels: &Mask) -> usize {
    (labels.width as usize).div_ceil(owners.width.max(1)).max(1)
}

/// Returns the rectangle of somebody's pixels in the mask itself.
fn rect_of(owned: &Owned, owners: &Owners, labels: &Mask) -> PixelRect {
    let factor = factor_of(owners, labels);
    let [left, top, right, bottom] = owned.bounds.map(|at| (at * factor) as u32);
    let (right, bottom) = (right.min(labels.width), bottom.min(labels.height));
    PixelRect { x: left, y: top, width: right.saturating_sub(left), height: bottom.saturating_sub(top) }
}

/// Returns pairs of a person and one of the camera's tracks, by place, that cover the most together; each once.
fn tracks_of(owners: &Owners, camera: &CameraState) -> Vec<(usize, usize)> {
    let labels = &camera.observation.labels;
    let mut pairs = Vec::new();
    for (person, owned) in owners.people.iter().enumerate().filter(|(_, owned)| is_shown(owned)) {
        let rect = rect_of(owned, owners, labels);
        for (track, of) in camera.observation.tracks.iter().enumerate() {
            let common = common_share(rect, of.rect);
            if common >= LEAST_COMMON {
                pairs.push((common, person, track));
            }
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut chosen: Vec<(usize, usize)> = Vec::new();
    for (_, person, track) in pairs {
        if !chosen.iter().any(|(other, of)| *other == person || *of == track) {
            chosen.push((person, track));
        }
    }
    chosen
}

/// Returns the share of what two rectangles cover together that both cover.
fn common_share(a: PixelRect, b: PixelRect) -> f64 {
    let overlap = |from: u32, len: u32, other_from: u32, other_len: u32| {
        f64::from((from + len).min(other_from + other_len).saturating_sub(from.max(other_from)))
    };
    let both = overlap(a.x, a.width, b.x, b.width) * overlap(a.y, a.height, b.y, b.height);
    let area = |of: PixelRect| f64::from(of.width) * f64::from(of.height);
    both / (area(a) + area(b) - both).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fuse::estimate::FLOOR_M;
    use crate::fuse::{SceneState, assemble as assemble_instant};
    use crate::occupancy::drawn_people::{SIZE, around, camera, mask, observation, scene};
    use glam::DVec3;
    use std::collections::BTreeMap;
    use videofields_vision::clock::Timestamp;
    use videofields_vision::frame::CameraId;
    use videofields_vision::geometry::Camera;

    /// Assembles what three cameras see of the people that each of them shows.
    fn assemble(shown: [&[(DVec3, f64)]; 3]) -> SceneState {
        assemble_among("", &around(DVec3::ZERO), &shown)
    }

    /// Assembles what cameras see, of which each shows some people, among boxes as a scene's document names them.
    fn assemble_among(boxes: &str, cameras: &[Camera], shown: &[&[(DVec3, f64)]]) -> SceneState {
        let scene = scene(DVec3::ZERO, boxes, cameras);
        let masks: Vec<Mask> =
            cameras.iter().zip(shown).map(|(camera, people)| mask(&scene, camera, people)).collect();
        let observe = |id: &CameraId| {
            let member = scene.cameras.iter().position(|member| member.id == *id)?;
            Some(observation(id.clone(), masks[member].clone()))
        };
        assemble_instant(&scene, Timestamp::from_nanos(0), observe, Some(1))
    }

    fn farthest(state: &SceneState, people: &[(DVec3, f64)]) -> f64 {
        let nearest = |at: &DVec3| {
            let all = state.entities.iter().map(|of| of.foot_in_world.distance(*at));
            all.fold(f64::INFINITY, f64::min)
        };
        people.iter().map(|(at, _)| nearest(at)).fold(0.0, f64::max)
    }

    #[test]
    fn people_who_hide_each_other_are_each_one_entity_of_the_pixels_that_show_them() {
        let people = [
            (DVec3::new(0.0, 0.0, 0.0), 1.75),
            (DVec3::new(0.5, -0.4, 0.0), 1.65),
            (DVec3::new(-0.5, 0.5, 0.0), 1.8),
        ];
        let state = assemble([&people; 3]);
        assert_eq!(state.entities.len(), people.len(), "{:?}", state.entities);
        assert!(farthest(&state, &people) < 0.25, "{}", farthest(&state, &people));
        for entity in &state.entities {
            assert!(entity.sources.len() >= LEAST_CAMERAS);
            for source in &entity.sources {
                let [left, right] = source.left_right_m;
                assert!(right - left < 1.0 && source.height_m < 2.1, "{source:?}");
            }
            assert!((1.5..2.0).contains(&entity.height_m), "{}", entity.height_m);
            // However many cameras say it, what all say together is said once.
            let sd_m = entity.foot_covariance_m2.determinant().powf(0.25);
            assert!(sd_m >= 0.99 * FLOOR_M, "{sd_m}");
        }
    }

    #[test]
    fn what_moves_is_shown_once_and_as_the_one_whom_it_shows() {
        let people = [(DVec3::new(0.0, 0.0, 0.0), 1.75), (DVec3::new(0.45, -0.4, 0.0), 1.65)];
        let state = assemble([&people; 3]);
        assert_eq!(state.entities.len(), 2);
        let mut n_told = [0; 2];
        for (camera_idx, camera) in state.cameras.iter().enumerate() {
            let labels = &camera.observation.labels;
            let (size, mut shown) = (DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1)), BTreeMap::new());
            for run in state.points.iter().filter(|run| run.camera_idx == camera_idx) {
                let [first, last] =
                    run.textures.map(|[x, y]| (DVec2::new(x.into(), y.into()) * size).floor());
                for x in first.x as u32..=last.x as u32 {
                    let other = shown.insert((x, first.y as u32), run.entity_idx);
                    assert_eq!(other, None, "twice");
                }
            }
            let n_moving = labels.data.iter().filter(|label| **label == MOVING).count();
            assert!(shown.len() as f64 > 0.97 * n_moving as f64, "{} of {n_moving}", shown.len());
            // Each is drawn alone too: most of what only one of them can be is theirs.
            for (person, at) in people.iter().enumerate() {
                let entity = |idx: &usize| state.entities[*idx].foot_in_world.distance(at.0) < 0.25;
                let entity = (0..2).find(entity).unwrap();
                let [own, other] = [person, 1 - person]
                    .map(|person| mask(&state.scene, &camera.corrected, &people[person..=person]));
                let is_only = |(x, y): &(u32, u32)| own.get(*x, *y) == MOVING && other.get(*x, *y) != MOVING;
                let only: Vec<_> = shown.iter().filter(|(at, _)| is_only(at)).collect();
                let n_right = only.iter().filter(|(_, of)| **of == entity).count();
                n_told = [n_told[0] + n_right, n_told[1] + only.len()];
            }
        }
        assert!(
            n_told[1] > 500 && f64::from(n_told[0] as u32) > 0.85 * f64::from(n_told[1] as u32),
            "{n_told:?}"
        );
    }

    #[test]
    fn how_much_of_somebody_a_camera_shows_is_told() {
        let alone = (DVec3::new(0.0, 0.0, 0.0), 1.75);
        let shares = |people: &[(DVec3, f64)]| {
            let state = assemble([people; 3]);
            let entity = state.entities.iter().find(|of| of.foot_in_world.distance(alone.0) < 0.25).unwrap();
            entity.sources.iter().map(|of| (of.camera_idx, of.shown_share)).collect::<BTreeMap<_, _>>()
        };
        let whole = shares(&[alone]);
        assert!(whole.len() == 3 && whole.values().all(|share| (0.7..=1.0).contains(share)), "{whole:?}");
        // Somebody stands before them as the first camera sees them, and half beside.
        let eye = around(DVec3::ZERO)[0].pose().position_in_world;
        let towards = eye.truncate().normalize();
        let before = (towards * 0.9 + towards.perp() * 0.1).extend(0.0);
        let hidden = shares(&[alone, (before, 1.75)]);
        let first = hidden.get(&0).copied().unwrap_or(0.0);
        assert!(first < whole[&0] - 0.15, "{hidden:?} {whole:?}");
        assert!((hidden[&1] - whole[&1]).abs() < 0.1, "{hidden:?} {whole:?}");
    }

    #[test]
    fn once_owners_are_forgotten_all_in_a_rectangle_is_shown() {
        let people = [(DVec3::new(0.0, 0.0, 0.0), 1.75), (DVec3::new(0.45, -0.4, 0.0), 1.65)];
        let mut state = assemble([&people; 3]);
        let sources =
            |state: &SceneState| state.entities.iter().flat_map(|of| of.sources.clone()).collect::<Vec<_>>();
        let is_hidden = |state: &SceneState, of: &Billboard| {
            let (camera, rect) = (&state.cameras[of.camera_idx], of.rect);
            let mut all =
                (0..rect.height).flat_map(|y| (0..rect.width).map(move |x| (rect.x + x, rect.y + y)));
            all.any(|at| !camera.may_show(of.owner, at))
        };
        assert!(sources(&state).iter().any(|of| is_hidden(&state, of)));
        state.forget_owners();
        assert!(!sources(&state).iter().any(|of| is_hidden(&state, of)));
    }

    #[test]
    fn who_shows_but_their_head_over_a_high_counter_is_one_entity_about_where_they_stand() {
        let cameras = [(5.0, -9.0), (-5.0, -9.0)].map(|(x, y)| camera(DVec3::new(x, y, 2.6), DVec3::Z * 1.2));
        let counter = r#"{"id": "counter", "center_m": [0, -0.7, 0.65], "size_m": [9, 0.4, 1.3]}"#;
        let people = [(DVec3::new(-1.2, 0.0, 0.0), 1.75), (DVec3::new(1.1, 0.2, 0.0), 1.65)];
        let state = assemble_among(counter, &cameras, &[people.as_slice(); 2]);
        let places: Vec<DVec3> = state.entities.iter().map(|of| of.foot_in_world).collect();
        assert_eq!(places.len(), people.len(), "{places:?}");
        // Somebody whose feet nobody sees may be taken to stand on the counter, but no farther before or behind it than this.
        for (at, _) in people {
            let far = |of: &DVec3| (*of - at).truncate().length();
            assert!(places.iter().map(far).fold(f64::INFINITY, f64::min) < 0.35, "{places:?}");
        }
    }

    #[test]
    fn whom_all_cameras_show_has_a_source_for_each_and_one_camera_tells_nobody_together() {
        let state = assemble([&[(DVec3::ZERO, 1.75)]; 3]);
        assert_eq!(state.entities.iter().map(|entity| entity.sources.len()).collect::<Vec<_>>(), [3]);
        assert!(assemble([&[]; 3]).entities.is_empty());
        // The other cameras have no picture.
        let alone = state.cameras[1].clone();
        let together = Together::find(&mut Occupancy::default(), &state.scene, (&[1], &[alone]), &[]);
        assert!(together.people.is_empty());
    }
}
