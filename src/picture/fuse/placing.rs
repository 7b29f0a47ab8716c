//! Places what the cameras of one scene see, instant after instant: who stands where, and who is who.
//!
//! People whom several cameras see are found by all masks together (`occupancy`), everything else by each camera's own blobs, which
//! are joined afterwards.

use super::together::Together;
use super::{Association, CameraState, Entity, OwnerMap, SceneState, Sighting, billboard, line::Followed};
use crate::occupancy::{Effort, Occupancy};
use crate::scene::{Scene, SceneCamera};
use std::sync::{Arc, Weak};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, Mask, YuvImage};
use videofields_vision::geometry::Camera;
use videofields_vision::observation::Observation;
use videofields_vision::track::Track;

/// Cameras that must see anything for their masks to be looked at together: of fewer, their own blobs say all there is.
const LEAST_CAMERAS: usize = 2;

/// Memory of the instants of one scene. What it knows of one scene says nothing of another: that begins anew.
#[derive(Debug)]
pub struct Placing {
    association: Association,
    /// None where people are placed by each camera's own blobs.
    occupancy: Option<Occupancy>,
    /// Scene whose cameras are moved and turned so that they agree, and that scene with them so.
    corrected: Option<(Weak<Scene>, Arc<Scene>)>,
    /// Answers of late, the latest last.
    answers: Vec<Answer>,
}

/// Most answers that are kept, and least of them that are kept whatever their size: tiles of a wall, pictures and lists of one instant are
/// asked for one after the other, other instants meanwhile, and all show the same people.
const MOST_ANSWERS: usize = 64;
const LEAST_ANSWERS: usize = 8;

/// Most bytes of owner maps of all answers beyond the least.
const MOST_ANSWER_BYTES: usize = 32 << 20;

/// Camera by its place in the scene, and what it saw by its memory: weak, so that nothing is held, and nothing else can take its address.
#[derive(Debug)]
struct SeenBy {
    member: usize,
    labels: Weak<Mask>,
    image: Weak<YuvImage>,
}

/// Conclusion about an instant.
#[derive(Debug)]
struct Answer {
    scene: Weak<Scene>,
    instant: Timestamp,
    seen: Vec<SeenBy>,
    entities: Vec<Entity>,
    owners: Vec<Option<Arc<OwnerMap>>>,
    /// Cameras as they were when it was concluded.
    corrected: Vec<Arc<Camera>>,
}

impl SeenBy {
    fn new(member: usize, camera: &CameraState) -> Self {
        let of = &camera.observation;
        Self { member, labels: Arc::downgrade(&of.labels), image: Arc::downgrade(&of.frame.image) }
    }

    fn is(&self, member: usize, camera: &CameraState) -> bool {
        self.member == member
            && std::ptr::eq(self.labels.as_ptr(), Arc::as_ptr(&camera.observation.labels))
            && std::ptr::eq(self.image.as_ptr(), Arc::as_ptr(&camera.observation.frame.image))
    }
}

impl Answer {
    /// Returns true while all that the cameras saw is in memory: later nobody asks for it again.
    fn can_be_asked_for(&self) -> bool {
        self.seen.iter().all(|of| of.labels.strong_count() > 0 && of.image.strong_count() > 0)
    }

    /// Returns the bytes of its owner maps.
    fn n_bytes(&self) -> usize {
        self.owners.iter().flatten().map(|map| map.n_bytes()).sum()
    }

    fn is_of(
        &self,
        scene: &Arc<Scene>,
        instant: Timestamp,
        (members, cameras): (&[usize], &[CameraState]),
    ) -> bool {
        let seen = self.seen.iter().zip(members.iter().zip(cameras));
        self.instant == instant
            && std::ptr::eq(self.scene.as_ptr(), Arc::as_ptr(scene))
            && self.seen.len() == members.len()
            && seen.into_iter().all(|(of, (member, camera))| of.is(*member, camera))
    }
}

impl Default for Placing {
    fn default() -> Self {
        Self { occupancy: Some(Occupancy::default()), ..Self::by_blobs() }
    }
}

impl Placing {
    /// Returns a memory with which people are placed by each camera's own blobs alone, to compare.
    #[must_use]
    pub fn by_blobs() -> Self {
        Self { association: Association::default(), occupancy: None, corrected: None, answers: Vec::new() }
    }

    /// Returns a memory with which people are looked for with an effort other than the usual one.
    #[must_use]
    pub fn with_effort(effort: Effort) -> Self {
        Self { occupancy: Some(Occupancy::with(effort)), ..Self::by_blobs() }
    }

    /// Returns the bytes that are kept of the scene and of cameras' masks, to find people in them.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        self.occupancy.as_ref().map_or(0, Occupancy::memory_bytes)
    }

    /// Returns a memory that gives ids from `next_id` on, 1 at least.
    #[must_use]
    pub fn counting_from(next_id: u64) -> Self {
        Self { association: Association::counting_from(next_id.max(1)), ..Self::default() }
    }

    /// Returns the least id that was not given yet.
    #[must_use]
    pub const fn next_id(&self) -> u64 {
        self.association.next_id()
    }

    /// Gives `count` ids to others, and returns the first of them: nobody gets one of these any more.
    pub const fn take_ids(&mut self, count: u64) -> u64 {
        self.association.take_ids(count)
    }

    /// Places what the cameras of `scene` see from now on as if they stood as those of `corrected`, the same scene with cameras moved and
    /// turned ([`with_offsets`](super::with_offsets)); as they are calibrated where that is none. Instants that were placed stay as they were.
    pub fn correct(&mut self, scene: &Arc<Scene>, corrected: Option<Arc<Scene>>) {
        self.corrected = corrected.map(|corrected| (Arc::downgrade(scene), corrected));
    }

    /// Forgets who is known, and goes on with the ids that were not given yet.
    pub fn begin_anew(&mut self) {
        let corrected = self.corrected.take();
        let occupancy = self.occupancy.as_ref().map(|of| Occupancy::with(of.effort()));
        *self = Self { corrected, occupancy, ..Self::counting_from(self.next_id()) };
    }

    /// Returns `scene` with its cameras as what they see is placed: itself where none is corrected.
    #[must_use]
    pub fn corrected(&self, scene: &Arc<Scene>) -> Arc<Scene> {
        let is_it = |(of, _): &&(Weak<Scene>, Arc<Scene>)| std::ptr::eq(of.as_ptr(), Arc::as_ptr(scene));
        let corrected = self.corrected.as_ref().filter(is_it);
        Arc::clone(corrected.map_or(scene, |(_, corrected)| corrected))
    }

    /// Puts together what the cameras saw at `instant`: `observe` gives a camera's observation, if it has one. Entities keep their ids
    /// from the instants before.
    ///
    /// **Cost** about two rays a row of every blob. Where several cameras see people, some
    /// 0.5 ms for each of them, and at most 8192 cells are looked at (docs/decisions/0029-placing.md); the first time, and where a
    /// picture's size is new, the cells of the whole scene are found, a ray for each of them and camera.
    pub fn assemble(
        &mut self,
        scene: &Arc<Scene>,
        instant: Timestamp,
        observe: impl FnMut(&CameraId) -> Option<Observation>,
    ) -> SceneState {
        let corrected = self.corrected(scene);
        let (members, mut cameras) = observed(scene, &corrected, observe);
        let is_known = |answer: &Answer| answer.is_of(scene, instant, (&members, &cameras));
        if let Some(place) = self.answers.iter().position(is_known) {
            let known = self.answers.remove(place);
            for ((camera, owners), corrected) in cameras.iter_mut().zip(&known.owners).zip(&known.corrected) {
                camera.owners.clone_from(owners);
                camera.corrected = Arc::clone(corrected);
            }
            let state = state_of(scene, instant, (cameras, known.entities.clone()));
            self.answers.push(known);
            return state;
        }
        let memory = (&mut self.association, self.occupancy.as_mut());
        let entities = placed(memory, &corrected, instant, (&members, &mut cameras));
        self.keep(Answer {
            scene: Arc::downgrade(scene),
            instant,
            seen: members.iter().zip(&cameras).map(|(member, camera)| SeenBy::new(*member, camera)).collect(),
            entities: entities.clone(),
            owners: cameras.iter().map(|camera| camera.owners.clone()).collect(),
            corrected: cameras.iter().map(|camera| Arc::clone(&camera.corrected)).collect(),
        });
        state_of(scene, instant, (cameras, entities))
    }

    /// Keeps an answer as the latest one, and as many of those before it as there may be.
    fn keep(&mut self, answer: Answer) {
        self.answers.retain(Answer::can_be_asked_for);
        self.answers.push(answer);
        let mut n_bytes: usize = self.answers.iter().map(Answer::n_bytes).sum();
        let is_over = |n_kept: usize, n_bytes: usize| {
            n_kept > MOST_ANSWERS || (n_kept > LEAST_ANSWERS && n_bytes > MOST_ANSWER_BYTES)
        };
        let mut n_gone = 0;
        while is_over(self.answers.len() - n_gone, n_bytes) {
            n_bytes -= self.answers[n_gone].n_bytes();
            n_gone += 1;
        }
        self.answers.drain(..n_gone);
    }

    /// Puts together what the cameras saw as [`Self::assemble`] does, with ids that hold for this instant alone; changes nothing of who
    /// is known.
    pub fn assemble_alone(
        &mut self,
        scene: &Arc<Scene>,
        instant: Timestamp,
        observe: impl FnMut(&CameraId) -> Option<Observation>,
    ) -> SceneState {
        let corrected = self.corrected(scene);
        let (members, mut cameras) = observed(scene, &corrected, observe);
        let memory = (&mut Association::default(), self.occupancy.as_mut());
        let entities = placed(memory, &corrected, instant, (&members, &mut cameras));
        state_of(scene, instant, (cameras, entities))
    }
}

/// Returns the cameras that have an observation, with their places in the scene; `corrected` has the same cameras as what they see is placed.
fn observed(
    scene: &Scene,
    corrected: &Scene,
    mut observe: impl FnMut(&CameraId) -> Option<Observation>,
) -> (Vec<usize>, Vec<CameraState>) {
    let of = |(idx, member): (usize, &SceneCamera)| {
        let observation = observe(&member.id)?;
        let camera = CameraState::new(member.id.clone(), Arc::clone(&member.camera), observation);
        Some((idx, CameraState { corrected: Arc::clone(&corrected.cameras[idx].camera), ..camera }))
    };
    scene.cameras.iter().enumerate().filter_map(of).unzip()
}

/// Returns what stands where, and gives the cameras their owner maps.
fn placed(
    (association, occupancy): (&mut Association, Option<&mut Occupancy>),
    scene: &Arc<Scene>,
    instant: Timestamp,
    (members, cameras): (&[usize], &mut [CameraState]),
) -> Vec<Entity> {
    let n_seeing = cameras.iter().filter(|camera| !camera.observation.blobs.is_empty()).count();
    let mut occupancy = occupancy.filter(|_| n_seeing >= LEAST_CAMERAS);
    let together = occupancy.as_deref_mut().map(|occupancy| {
        let expected = association.expected(instant);
        Together::find(occupancy, scene, (members, cameras), &expected)
    });
    let of_camera = |(idx, (camera, member)): (usize, (&CameraState, &usize))| {
        let all = billboard::sightings((idx, *member), camera, &scene.surfaces, together.as_ref());
        all.collect::<Vec<_>>()
    };
    let is_large_enough = |of: &Sighting| of.billboard.is_at_least(scene.min_entity_size_m);
    let of_cameras = cameras.iter().zip(members).enumerate().flat_map(of_camera);
    let mut of_cameras: Vec<Sighting> = of_cameras.filter(is_large_enough).collect();
    if let Some((together, occupancy)) = together.as_ref().zip(occupancy) {
        together.drop_denied(occupancy, scene, &mut of_cameras);
    }
    let of_people = together.iter().flat_map(|together| together.sightings(cameras, members));
    let sightings: Vec<Sighting> = of_people.filter(is_large_enough).chain(of_cameras).collect();
    let tracks = |(member, camera): (&usize, &CameraState)| {
        let followed =
            |track: &Track| Followed { member: *member, number: track.id, since: track.first_seen };
        camera.observation.tracks.iter().map(followed).collect::<Vec<_>>()
    };
    let followed: Vec<Followed> = members.iter().zip(&*cameras).flat_map(tracks).collect();
    if let Some(together) = &together {
        together.give_maps(cameras);
    }
    association.update(instant, sightings, &followed)
}

/// Returns the state of an instant, without points and hulls.
fn state_of(
    scene: &Arc<Scene>,
    instant: Timestamp,
    (cameras, entities): (Vec<CameraState>, Vec<Entity>),
) -> SceneState {
    SceneState {
        scene: Arc::clone(scene),
        instant,
        entities,
        cameras,
        n_overlapping: 0,
        points: Vec::new(),
        hulls: Vec::new(),
        sequences: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::drawn_people::{SIZE, around, mask, observation, scene};
    use glam::{DVec2, DVec3};
    use videofields_vision::segment::PixelRect;

    const STEP_NANOS: i64 = 200_000_000;

    /// Returns what three cameras saw of two people at steps of 0.2 s: one walks along x, the other stands.
    fn observations_at(scene: &Scene, step: i64) -> Vec<Observation> {
        let walks = DVec3::new(0.2 * step as f64 - 1.0, -1.5, 0.0);
        let people = [(walks, 1.7), (DVec3::new(0.4, 1.2, 0.0), 1.8)];
        let of = |member: &SceneCamera| observation(member.id.clone(), mask(scene, &member.camera, &people));
        scene.cameras.iter().map(of).collect()
    }

    fn at(step: i64) -> Timestamp {
        Timestamp::from_nanos(step * STEP_NANOS)
    }

    #[test]
    fn people_are_there_with_their_ids_asked_again_and_backwards_in_time() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let steps: Vec<Vec<Observation>> = (0..4).map(|step| observations_at(&scene, step)).collect();
        let mut placing = Placing::default();
        let mut ids = |step: usize| {
            let find = |id: &CameraId| steps[step].iter().find(|of| of.frame.camera == *id).cloned();
            let state = placing.assemble(&scene, at(step as i64), find);
            assert!(state.cameras.iter().all(|camera| camera.owners.is_some()), "{step}");
            state.entities.iter().map(|entity| entity.id).collect::<Vec<_>>()
        };
        let first = ids(0);
        assert_eq!(first.len(), 2);
        for step in [0, 1, 1, 2, 3, 3, 2, 1, 0, 1] {
            assert_eq!(ids(step), first, "{step}");
        }
    }

    #[test]
    fn what_is_asked_again_is_not_placed_again_and_another_instant_is() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let seen = observations_at(&scene, 0);
        let mut placing = Placing::default();
        let mut state = |step: i64| {
            let find = |id: &CameraId| seen.iter().find(|of| of.frame.camera == *id).cloned();
            let state = placing.assemble(&scene, at(step), find);
            (state.cameras[0].owners.clone().unwrap(), state.entities)
        };
        let (map, entities) = state(0);
        let (again, same) = state(0);
        assert!(Arc::ptr_eq(&again, &map) && same == entities);
        // The same pictures a minute later say nothing of who these are.
        let (_, later) = state(300);
        assert!(later.iter().all(|of| entities.iter().all(|known| known.id != of.id)), "{later:?}");
    }

    #[test]
    fn an_instant_shows_the_same_people_however_many_others_are_placed_before_it_is_asked_for_again() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let steps: Vec<Vec<Observation>> = (0..40).map(|step| observations_at(&scene, step)).collect();
        let mut placing = Placing::default();
        let mut state = |step: usize| {
            let find = |id: &CameraId| steps[step].iter().find(|of| of.frame.camera == *id).cloned();
            placing.assemble(&scene, at(step as i64), find)
        };
        let first = state(0);
        for step in 1..40 {
            state(step);
        }
        let again = state(0);
        assert_eq!(again.entities, first.entities);
        for (a, b) in first.cameras.iter().zip(&again.cameras) {
            assert!(Arc::ptr_eq(a.owners.as_ref().unwrap(), b.owners.as_ref().unwrap()));
        }
    }

    #[test]
    fn answers_are_bounded_and_those_of_pictures_that_are_gone_are_let_go() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let mut placing = Placing::default();
        let assemble = |placing: &mut Placing, step: i64, of: &[Observation]| {
            let find = |id: &CameraId| of.iter().find(|seen| seen.frame.camera == *id).cloned();
            placing.assemble(&scene, at(step), find);
        };
        let kept = observations_at(&scene, 0);
        for step in 0..2 * MOST_ANSWERS as i64 {
            assemble(&mut placing, step, &kept);
            let n_bytes: usize = placing.answers.iter().map(Answer::n_bytes).sum();
            assert!(placing.answers.len() <= MOST_ANSWERS && n_bytes <= MOST_ANSWER_BYTES, "{n_bytes}");
        }
        let n_kept = placing.answers.len();
        assert!(n_kept > 4 * LEAST_ANSWERS, "{n_kept}");
        // Large maps leave few answers.
        let cells = vec![0_u16; MOST_ANSWER_BYTES / 2].into_boxed_slice();
        let large = Arc::new(OwnerMap::new((MOST_ANSWER_BYTES as u32 / 2, 1), 1, cells, Box::default()));
        placing.answers[n_kept - 1].owners[0] = Some(large);
        assemble(&mut placing, 1000, &kept);
        assert_eq!(placing.answers.len(), LEAST_ANSWERS);
        drop(kept);
        let seen = observations_at(&scene, 1);
        assemble(&mut placing, 1001, &seen);
        assert_eq!(placing.answers.len(), 1);
    }

    #[test]
    fn whoever_appears_while_time_runs_backwards_is_shown_from_their_second_instant_on() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let nobody = |member: &SceneCamera| {
            observation(member.id.clone(), mask(&scene, &member.camera, &[(DVec3::new(5.0, 5.0, 0.0), 1.7)]))
        };
        let nobody: Vec<Observation> = scene.cameras.iter().map(nobody).collect();
        let mut placing = Placing::default();
        let mut count = |of: &[Observation], step: i64| {
            let find = |id: &CameraId| of.iter().find(|seen| seen.frame.camera == *id).cloned();
            placing.assemble(&scene, at(step), find).entities.len()
        };
        count(&nobody, 5);
        count(&observations_at(&scene, 4), 4);
        assert_eq!(count(&observations_at(&scene, 3), 3), 2);
        assert_eq!(count(&observations_at(&scene, 2), 2), 2);
    }

    #[test]
    fn an_instant_that_is_asked_for_alone_leaves_ids_as_they_are() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let steps: Vec<Vec<Observation>> = (0..3).map(|step| observations_at(&scene, step)).collect();
        let find = |step: usize| {
            let of = &steps[step];
            move |id: &CameraId| of.iter().find(|seen| seen.frame.camera == *id).cloned()
        };
        let ids = |state: SceneState| state.entities.iter().map(|entity| entity.id).collect::<Vec<_>>();
        let mut placing = Placing::default();
        let first = ids(placing.assemble(&scene, at(0), find(0)));
        let alone = ids(placing.assemble_alone(&scene, at(1000), find(2)));
        assert_eq!(alone, ids(placing.assemble_alone(&scene, at(1000), find(2))));
        assert_eq!(ids(placing.assemble(&scene, at(1), find(1))), first);
    }

    #[test]
    fn people_are_placed_by_cameras_as_they_are_corrected_and_surfaces_are_not() {
        let truly = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let mut off = (*truly).clone();
        for member in &mut off.cameras {
            member.camera = Arc::new((*member.camera).clone().moved(DVec3::new(0.35, 0.35, 0.0)).unwrap());
        }
        let off = Arc::new(off);
        let seen = observations_at(&truly, 0);
        let mut placing = Placing::default();
        let mut farthest = |step: i64, corrected: Option<&Arc<Scene>>| {
            placing.correct(&off, corrected.cloned());
            let find = |id: &CameraId| seen.iter().find(|of| of.frame.camera == *id).cloned();
            let state = placing.assemble(&off, at(step), |id: &CameraId| find(id));
            for (idx, camera) in state.cameras.iter().enumerate() {
                assert!(Arc::ptr_eq(&camera.camera, &off.cameras[idx].camera));
                assert!(Arc::ptr_eq(&camera.corrected, &corrected.unwrap_or(&off).cameras[idx].camera));
            }
            assert!(Arc::ptr_eq(&state.scene, &off));
            // An instant that was placed stays, with the cameras that it was placed by.
            placing.correct(&off, None);
            let again = placing.assemble(&off, at(step), |id: &CameraId| find(id));
            let pairs = state.cameras.iter().zip(&again.cameras);
            assert!(pairs.into_iter().all(|(a, b)| Arc::ptr_eq(&a.corrected, &b.corrected)));
            assert_eq!(again.entities, state.entities);
            let truths = [DVec3::new(-1.0, -1.5, 0.0), DVec3::new(0.4, 1.2, 0.0)];
            let nearest = |truth: DVec3| {
                let all = state.entities.iter().map(|of| of.foot_in_world.distance(truth));
                all.fold(f64::INFINITY, f64::min)
            };
            truths.map(nearest).into_iter().fold(0.0, f64::max)
        };
        // So far apart that nobody is known from the instant before.
        assert!((farthest(0, None) - 0.5).abs() < 0.1);
        assert!(farthest(100, Some(&truly)) < 0.1);
        assert!((farthest(200, None) - 0.5).abs() < 0.1);
    }

    #[test]
    fn a_camera_whose_mask_says_nothing_neither_adds_nor_takes_anybody() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let places = |of: &[Observation]| {
            let find = |id: &CameraId| of.iter().find(|seen| seen.frame.camera == *id).cloned();
            let state = Placing::default().assemble(&scene, at(0), find);
            state.entities.iter().map(|entity| entity.foot_in_world).collect::<Vec<_>>()
        };
        let all = observations_at(&scene, 0);
        let without = places(&all[..2]);
        let mut with_gap = all;
        with_gap[2].labels = Arc::new(Mask::filled(0, 0, 0));
        with_gap[2].blobs = Arc::default();
        assert_eq!(places(&with_gap), without);
        assert_eq!(without.len(), 2);
    }

    /// Returns a camera's track of somebody under a number, as large as they are in its picture.
    fn track_of(camera: &Camera, id: u64, (foot, height_m): (DVec3, f64)) -> Track {
        let size = DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
        let [low, high] =
            [foot, foot + DVec3::Z * height_m].map(|at| camera.project(at).unwrap().texture * size);
        let half_width = 0.15 * (low.y - high.y);
        let [x, y, width, height] =
            [high.x - half_width, high.y, 2.0 * half_width, low.y - high.y].map(|value| value.round() as u32);
        Track {
            id,
            rect: PixelRect { x, y, width, height },
            blob_idx: Some(0),
            foot_in_image: low.to_array(),
            velocity_px_per_sec: [0.0; 2],
            first_seen: at(0),
            last_seen: at(0),
            is_in_group: false,
            still_since: None,
        }
    }

    #[test]
    fn a_placing_that_begins_anew_looks_for_people_as_before() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let people = [(DVec3::new(-0.4, 0.3, 0.0), 1.75)];
        let see = |member: &SceneCamera| {
            let mut seen = observation(member.id.clone(), mask(&scene, &member.camera, &people));
            seen.tracks = vec![track_of(&member.camera, 1, people[0])].into();
            seen
        };
        let seen: Vec<Observation> = scene.cameras.iter().map(see).collect();
        let bytes = |placing: &mut Placing, step: i64| {
            placing.assemble(&scene, at(step), |id| seen.iter().find(|of| of.frame.camera == *id).cloned());
            placing.memory_bytes()
        };
        let mut coarse = Placing::with_effort(Effort { cell_m: 1.0, ..Effort::default() });
        let [before, usual] = [bytes(&mut coarse, 0), bytes(&mut Placing::default(), 0)];
        assert!(0 < before && before < usual, "{before} {usual}");
        coarse.begin_anew();
        assert_eq!(bytes(&mut coarse, 1), before);
        let mut by_blobs = Placing::by_blobs();
        by_blobs.begin_anew();
        assert_eq!(bytes(&mut by_blobs, 0), 0);
    }

    #[test]
    fn whom_several_cameras_see_keeps_their_id_where_tracks_pass_from_one_to_another() {
        let scene = scene(DVec3::ZERO, "", &around(DVec3::ZERO));
        let people = [(DVec3::new(-0.4, 0.3, 0.0), 1.75), (DVec3::new(0.5, -0.3, 0.0), 1.72)];
        let mut placing = Placing::default();
        let mut places = |step: i64| {
            let of = |member: &SceneCamera| {
                let mut seen = observation(member.id.clone(), mask(&scene, &member.camera, &people));
                // Each track passes to the other person at the fourth step.
                let numbers = if step < 3 { [1, 2] } else { [2, 1] };
                let mut tracks: Vec<Track> =
                    (0..2).map(|idx| track_of(&member.camera, numbers[idx], people[idx])).collect();
                tracks.sort_by_key(|track| track.id);
                seen.tracks = tracks.into();
                seen
            };
            let seen: Vec<Observation> = scene.cameras.iter().map(of).collect();
            let find = |id: &CameraId| seen.iter().find(|of| of.frame.camera == *id).cloned();
            let state = placing.assemble(&scene, at(step), find);
            state.entities.iter().map(|of| (of.id, of.foot_in_world.x > 0.0)).collect::<Vec<_>>()
        };
        let first = places(0);
        assert_eq!(first.len(), 2);
        for step in 1..8 {
            assert_eq!(places(step), first, "{step}");
        }
    }
}
