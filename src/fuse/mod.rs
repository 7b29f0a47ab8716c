//! Observations of all cameras at one instant -> `SceneState`: what stands where.
//!
//! In: a scene and at most one observation a camera. Out: an immutable state. Must not know of views, passes or
//! the GPU: one state serves every view of its instant.

mod associate;
mod billboard;
mod points;

use crate::clock::Timestamp;
use crate::frame::CameraId;
use crate::geometry::Camera;
use crate::scene::Scene;
use crate::segment::PixelRect;
use crate::timeline::Observation;
use glam::DVec3;
use std::sync::Arc;

/// Puts together what the cameras saw at `instant`: `observe` gives a camera's observation, if it has one.
///
/// With `point_stride`, the entities' texels are placed as points too, every `point_stride`-th each way (1 is the
/// exact form).
///
/// **Cost** about two rays a row of every blob; with points, one more a texel.
pub fn assemble(
    scene: &Arc<Scene>,
    instant: Timestamp,
    mut observe: impl FnMut(&CameraId) -> Option<Observation>,
    point_stride: Option<u32>,
) -> SceneState {
    let cameras: Vec<CameraState> = scene
        .cameras
        .iter()
        .filter_map(|member| {
            let observation = observe(&member.id)?;
            Some(CameraState { id: member.id.clone(), camera: Arc::clone(&member.camera), observation })
        })
        .collect();
    let sightings: Vec<Sighting> = cameras
        .iter()
        .enumerate()
        .flat_map(|(camera_idx, camera)| billboard::sightings(camera_idx, camera, &scene.surfaces))
        .filter(|sighting| sighting.billboard.is_at_least(scene.min_entity_size_m))
        .collect();
    let points = point_stride.map_or_else(Vec::new, |stride| {
        let of = |sighting: &Sighting| {
            let billboard = &sighting.billboard;
            points::points(&cameras[billboard.camera_idx], billboard, stride).collect::<Vec<_>>()
        };
        sightings.iter().flat_map(of).collect()
    });
    SceneState {
        scene: Arc::clone(scene),
        instant,
        entities: associate::entities(sightings),
        cameras,
        points,
    }
}

/// A billboard with how well its foot is known.
struct Sighting {
    billboard: Billboard,
    /// Extent of a pixel on the ground at the foot, metres.
    footprint_m: f64,
}

/// One instant of a scene, ready to be rendered. Immutable.
#[derive(Clone, Debug)]
pub struct SceneState {
    /// The scene.
    pub scene: Arc<Scene>,
    /// The instant asked for.
    pub instant: Timestamp,
    /// The cameras that have an observation at that instant, in the scene's order.
    pub cameras: Vec<CameraState>,
    /// What stands on the ground.
    pub entities: Vec<Entity>,
    /// The entities' foreground texels as points; empty unless points were asked for.
    pub points: Vec<EntityPoint>,
}

/// One camera at the instant.
#[derive(Clone, Debug)]
pub struct CameraState {
    /// Which camera.
    pub id: CameraId,
    /// Its calibration.
    pub camera: Arc<Camera>,
    /// What it saw.
    pub observation: Observation,
}

/// One thing that stands on the ground, seen by one camera or several.
#[derive(Clone, Debug, PartialEq)]
pub struct Entity {
    /// Where it touches the ground: the mean of its sources' feet, the better seen counting more.
    pub foot_in_world: DVec3,
    /// One billboard for each camera that sees it; never empty.
    pub sources: Vec<Billboard>,
}

/// What one camera sees of an entity, as an upright rectangle in the world that faces the camera horizontally.
#[derive(Clone, Debug, PartialEq)]
pub struct Billboard {
    /// Index into [`SceneState::cameras`].
    pub camera_idx: usize,
    /// Rectangle of its blob in that camera's picture.
    pub rect: PixelRect,
    /// Middle of the base line, on the ground.
    pub foot_in_world: DVec3,
    /// Unit vector along the base line, level, to the right as the camera sees it.
    pub right_in_world: DVec3,
    /// Extent along `right_in_world` from the foot to the left (negative) and right edge, metres.
    pub left_right_m: [f64; 2],
    /// Extent upwards from the foot, metres; above 0.
    pub height_m: f64,
    /// Whether the foot may lie outside the picture, so that place and height are estimates.
    pub is_truncated: bool,
}

impl Billboard {
    /// Whether it extends so far upwards or across, or is cut by the picture's border, so that there is no telling.
    fn is_at_least(&self, size_m: f64) -> bool {
        let [left, right] = self.left_right_m;
        self.is_truncated || self.height_m.max(right - left) >= size_m
    }
}

/// One foreground texel placed in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EntityPoint {
    /// Index into [`SceneState::cameras`].
    pub camera_idx: usize,
    /// Where it stands.
    pub position_in_world: DVec3,
    /// Side of the square that covers the texel's footprint without holes, metres.
    pub size_m: f32,
    /// Texture coordinate at which its colour and soft mask are read.
    pub texture: [f32; 2],
}
