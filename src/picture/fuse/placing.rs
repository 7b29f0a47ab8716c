//! Places what the cameras of one scene see, instant after instant: who stands where, and who is who.
//!
//! People whom several cameras see are found by all masks together (`occupancy`), everything else by each camera's own blobs, which
//! are joined afterwards.

use super::together::Together;
use super::{Association, CameraState, SceneState, Sighting, billboard, line::Followed};
use crate::occupancy::Occupancy;
use crate::scene::Scene;
use glam::Vec3;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;
use videofields_vision::track::Track;

/// Where fewer cameras see anything, their own blobs say all there is.
const LEAST_CAMERAS: usize = 2;

/// Memory of the instants of one scene. What it knows of one scene says nothing of another: that begins anew.
#[derive(Debug)]
pub struct Placing {
    association: Association,
    /// None where people are placed by each camera's own blobs.
    occupancy: Option<Occupancy>,
}

impl Default for Placing {
    fn default() -> Self {
        Self { association: Association::default(), occupancy: Some(Occupancy::default()) }
    }
}

impl Placing {
    /// Returns a memory with which people are placed by each camera's own blobs alone, to compare.
    #[must_use]
    pub fn by_blobs() -> Self {
        Self { association: Association::default(), occupancy: None }
    }

    /// Puts together what the cameras saw at `instant`: `observe` gives a camera's observation, if it has one. Entities keep their ids
    /// from the instants before.
    ///
    /// With `point_stride`, the entities' texels are placed as points too, every `point_stride`-th row (1 is the exact form).
    ///
    /// **Cost** about two rays a row of every blob, with points two more a run of texels in it; some 0.5 ms a person where several
    /// cameras see them (docs/benchmarks/placing.md).
    pub fn assemble(
        &mut self,
        scene: &Arc<Scene>,
        instant: Timestamp,
        observe: impl FnMut(&CameraId) -> Option<Observation>,
        point_stride: Option<u32>,
    ) -> SceneState {
        let Self { association, occupancy } = self;
        assembled((association, occupancy.as_mut()), scene, instant, observe, point_stride)
    }

    /// Puts together what the cameras saw as [`Self::assemble`] does, with ids that hold for this instant alone; changes nothing of who
    /// is known.
    pub fn assemble_alone(
        &mut self,
        scene: &Arc<Scene>,
        instant: Timestamp,
        observe: impl FnMut(&CameraId) -> Option<Observation>,
        point_stride: Option<u32>,
    ) -> SceneState {
        let memory = (&mut Association::default(), self.occupancy.as_mut());
        assembled(memory, scene, instant, observe, point_stride)
    }
}

fn assembled(
    (association, occupancy): (&mut Association, Option<&mut Occupancy>),
    scene: &Arc<Scene>,
    instant: Timestamp,
    mut observe: impl FnMut(&CameraId) -> Option<Observation>,
    point_stride: Option<u32>,
) -> SceneState {
    let (members, mut cameras): (Vec<usize>, Vec<CameraState>) = scene
        .cameras
        .iter()
        .enumerate()
        .filter_map(|(idx, member)| {
            let observation = observe(&member.id)?;
            let (id, camera) = (member.id.clone(), Arc::clone(&member.camera));
            Some((idx, CameraState { id, camera, observation, gain: Vec3::ONE, owners: None }))
        })
        .unzip();
    let n_seeing = cameras.iter().filter(|camera| !camera.observation.blobs.is_empty()).count();
    let together = occupancy.filter(|_| n_seeing >= LEAST_CAMERAS).map(|occupancy| {
        let expected = association.expected(instant);
        Together::find(occupancy, scene, (&members, &cameras), &expected)
    });
    let of_camera = |(idx, (camera, member)): (usize, (&CameraState, &usize))| {
        let all = billboard::sightings((idx, *member), camera, &scene.surfaces, together.as_ref());
        all.collect::<Vec<_>>()
    };
    let of_cameras = cameras.iter().zip(&members).enumerate().flat_map(of_camera);
    let of_people = together.iter().flat_map(|together| together.sightings(&cameras, &members));
    let sightings: Vec<Sighting> = of_people
        .chain(of_cameras)
        .filter(|sighting| sighting.billboard.is_at_least(scene.min_entity_size_m))
        .collect();
    let tracks = |(member, camera): (&usize, &CameraState)| {
        let followed =
            |track: &Track| Followed { member: *member, number: track.id, since: track.first_seen };
        camera.observation.tracks.iter().map(followed).collect::<Vec<_>>()
    };
    let followed: Vec<Followed> = members.iter().zip(&cameras).flat_map(tracks).collect();
    if let Some(together) = &together {
        together.give_maps(&mut cameras);
    }
    let entities = association.update(instant, sightings, &followed);
    let mut state = SceneState {
        scene: Arc::clone(scene),
        instant,
        entities,
        cameras,
        n_overlapping: 0,
        points: Vec::new(),
        hulls: Vec::new(),
        sequences: Vec::new(),
    };
    if let Some(stride) = point_stride {
        state.place_points(stride);
    }
    state
}
