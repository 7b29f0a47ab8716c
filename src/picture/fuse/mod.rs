//! Observations of all cameras at one instant -> `SceneState`: what stands where.
//!
//! In: a scene and at most one observation a camera. Out: an immutable state. Must not know of views, passes or
//! the GPU: one state serves every view of its instant.

mod association;
mod billboard;
mod entity_path;
mod estimate;
mod exposure;
mod gone;
mod grouping;
mod hull_memory;
mod hulls;
mod joined;
mod line;
mod look;
mod offsets;
mod overlap;
mod pieces;
mod placing;
mod points;
#[cfg(test)]
mod tests;
mod together;
mod upright;
mod walk;

pub use crate::occupancy::OwnerMap;
use association::Association;
pub use entity_path::{EntityPath, MAX_ENTITY_PATH_BYTES, Stand, stand_at};
pub use exposure::Exposure;
pub use hull_memory::HullMemory;
pub use hulls::{EntityHull, HullMaking, LEAST_VIEWS, MOST_MOVED_S};
pub use joined::{Joined, Part, PartOf, join, middle_of};
pub use offsets::{CalibrationOffset, FootSighting, calibration_offsets, foot_sightings, with_offsets};
pub use overlap::Overlap;
pub use placing::Placing;
pub(crate) use points::MAX_RUN;

use crate::scene::Scene;
use estimate::{Estimate, Head};
use glam::{DMat2, DVec2, DVec3, Vec3};
use line::Followed;
use std::sync::Arc;
use videofields_vision::clock::Timestamp;
use videofields_vision::fields::Moment;
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::Camera;
use videofields_vision::observation::Observation;
use videofields_vision::segment::PixelRect;

/// Puts together what the cameras saw at one instant as [`Placing::assemble`] does; who is who is told by this instant alone. With
/// `point_stride`, the entities' texels are placed as points too, every `point_stride`-th row (1 is the exact form).
///
/// **Cost** of [`Placing::assemble`], and that of finding the places where people may stand: use a [`Placing`] for several instants.
pub fn assemble(
    scene: &Arc<Scene>,
    instant: Timestamp,
    observe: impl FnMut(&CameraId) -> Option<Observation>,
    point_stride: Option<u32>,
) -> SceneState {
    let mut state = Placing::default().assemble(scene, instant, observe);
    if let Some(stride) = point_stride {
        state.place_points(stride);
    }
    state
}

/// A billboard with what it says of whom it shows.
struct Sighting {
    billboard: Billboard,
    /// The camera's place in the scene.
    member: usize,
    estimate: Estimate,
    /// The ray over its head, by which it is placed where its legs are hidden.
    head: Option<Head>,
    /// The camera's tracks that it shows.
    tracks: Vec<Followed>,
    /// Number of the person among those whom several cameras' masks tell together; none where the camera's own blobs are all there is.
    person: Option<usize>,
    /// Says that it is what is left of a blob, of which other pixels are somebody's whom several cameras tell together.
    is_rest: bool,
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
    /// How many of the cameras were compared with others that see the same surfaces ([`Exposure::even`]); 0 where nobody
    /// looked.
    pub n_overlapping: usize,
    /// What stands on the ground.
    pub entities: Vec<Entity>,
    /// The entities' foreground texels as points; empty unless points were asked for.
    pub points: Vec<PointRun>,
    /// The entities' hulls; empty unless they were asked for ([`SceneState::place_hulls`]).
    pub hulls: Vec<Arc<EntityHull>>,
    /// What there is of the scene's recorded sequences; empty where nobody placed them.
    pub sequences: Vec<SequenceAtInstant>,
}

/// What there is of a recorded mesh sequence at an instant.
#[derive(Clone, Debug)]
pub struct SequenceAtInstant {
    /// The sequence's id in its scene.
    pub id: Arc<str>,
    /// The frame that answers, or why there is none, for people who ask for pictures: without the names of files, which the log has.
    pub moment: Result<Arc<Moment>, Arc<str>>,
}

impl SceneState {
    /// Has every picture of a camera shown whole within its rectangles, as if nobody were told apart.
    pub fn forget_owners(&mut self) {
        self.cameras.iter_mut().for_each(|camera| camera.owners = None);
        let sources = self.entities.iter_mut().flat_map(|entity| &mut entity.sources);
        sources.for_each(|source| source.owner = OwnerMap::NOBODY);
    }

    /// Places the entities' texels as points, every `stride`-th row, in place of the points that there are. What several
    /// cameras see stands where the entity does, or one person would show beside themselves.
    pub fn place_points(&mut self, stride: u32) {
        let sources = self.entities.iter().enumerate().flat_map(|(entity_idx, entity)| {
            entity
                .sources
                .iter()
                .map(move |source| (entity_idx, source, entity.place_of(source) - source.foot_in_world))
        });
        let of = |(entity_idx, source, shift_m): (usize, &Billboard, DVec3)| {
            let camera = &self.cameras[source.camera_idx];
            points::runs(camera, (entity_idx, source), shift_m, stride).collect::<Vec<_>>()
        };
        self.points = sources.flat_map(of).collect();
    }
}

/// One camera at the instant.
#[derive(Clone, Debug)]
pub struct CameraState {
    /// Which camera.
    pub id: CameraId,
    /// Its calibration, by which what stands still is drawn.
    pub camera: Arc<Camera>,
    /// The camera as what moves is placed and drawn: moved and turned so that it sees people where others do ([`calibration_offsets`]); the
    /// same as `camera` where nothing is known of that.
    pub corrected: Arc<Camera>,
    /// What it saw.
    pub observation: Observation,
    /// What its colours are multiplied by in linear light to agree with other cameras', a channel: 1 where nothing is
    /// evened out, above 0, finite.
    pub gain: Vec3,
    /// Says whose what moves in its picture is, of the people whom several cameras tell together; none where its own blobs say all.
    pub owners: Option<Arc<OwnerMap>>,
}

impl CameraState {
    /// Returns a camera whose calibration is right, with what it saw.
    #[must_use]
    pub fn new(id: CameraId, camera: Arc<Camera>, observation: Observation) -> Self {
        Self { id, corrected: Arc::clone(&camera), camera, observation, gain: Vec3::ONE, owners: None }
    }
}

/// Least width of what may be seen in parts, metres: nobody is as broad.
const BROAD_M: f64 = 1.5;

/// Least distance between such parts, metres: what cameras that see the same thing make of its foot differs by less.
const APART_M: f64 = 1.0;

/// One thing that stands on the ground, seen by one camera or several.
#[derive(Clone, Debug, PartialEq)]
pub struct Entity {
    /// Its number: the same from camera to camera and from instant to instant of one [`Placing`].
    pub id: u64,
    /// Where it touches the ground: the mean of its sources' feet, the better known counting more; of people who were followed for a while,
    /// with where they should be by now.
    pub foot_in_world: DVec3,
    /// Covariance of the sources' mean on the ground, square metres; symmetric, finite.
    pub foot_covariance_m2: DMat2,
    /// How fast it goes.
    pub velocity: Velocity,
    /// How far it reaches from its foot, metres, by cameras that see it in one with nobody else, now or of late; none where none ever did.
    pub reach_m: Option<f64>,
    /// Its height, metres: what whole sources say, or said of late, or else the tallest there is.
    pub height_m: f64,
    /// A billboard for each camera that sees it, and more where a camera sees a part of it by itself, in the order of cameras; never empty.
    pub sources: Vec<Billboard>,
}

impl Entity {
    /// Returns the cameras that see it (indices into [`SceneState::cameras`]), each once, in their order.
    pub fn cameras(&self) -> impl Iterator<Item = usize> {
        let is_first = |(place, of): &(usize, &Billboard)| {
            self.sources[..*place].iter().all(|other| other.camera_idx != of.camera_idx)
        };
        self.sources.iter().enumerate().filter(is_first).map(|(_, of)| of.camera_idx)
    }

    /// Returns the place at which one of its `sources` is drawn: the entity's own, of which that camera's view of its foot is but one; of
    /// an entity with no other source, and of one that is seen [in parts](Self::is_seen_in_parts), that view's.
    #[must_use]
    pub fn place_of(&self, source: &Billboard) -> DVec3 {
        let is_shared = self.sources.len() > 1 && !self.is_seen_in_parts();
        if is_shared { self.foot_in_world } else { source.foot_in_world }
    }

    /// Returns true where it is broad, every camera's picture cuts it, and what they show of it lies apart: each shows another part, as of
    /// a car between two cameras.
    #[must_use]
    pub fn is_seen_in_parts(&self) -> bool {
        let widest_m = self.sources.iter().map(Billboard::width_m).fold(0.0, f64::max);
        widest_m >= BROAD_M
            && self.sources.iter().all(|source| source.is_truncated)
            && self.parts().nth(1).is_some()
    }

    /// Returns true for what is left of a camera's blob beside what several cameras tell to be the entity's.
    pub(crate) fn is_scrap(&self, source: &Billboard) -> bool {
        source.owner == OwnerMap::NOBODY && self.sources.iter().any(|other| other.owner != OwnerMap::NOBODY)
    }

    /// Returns the `sources` that show a part that none before them shows: those that lie apart from them, are not hidden, and no scraps.
    pub fn parts(&self) -> impl Iterator<Item = usize> {
        let is_part = move |idx: usize| {
            let source = &self.sources[idx];
            source.shown_share > 0.0 && !self.is_scrap(source)
        };
        let lies_apart = move |idx: usize, from: usize| {
            let [a, b] = [idx, from].map(|idx| self.sources[idx].foot_in_world);
            (a - b).length() > APART_M
        };
        let is_new = move |idx: &usize| {
            is_part(*idx) && (0..*idx).all(|from| !is_part(from) || lies_apart(*idx, from))
        };
        (0..self.sources.len()).filter(is_new)
    }
}

/// How fast somebody goes over the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity {
    /// Along the world's x and y, metres a second; finite.
    pub over_ground_m_per_s: DVec2,
    /// Standard deviation along the direction in which least is known of it, metres a second; finite.
    pub sd_m_per_s: f64,
}

impl Velocity {
    /// Of whom nothing is known yet: they may stand or walk.
    pub const UNKNOWN: Self = Self { over_ground_m_per_s: DVec2::ZERO, sd_m_per_s: walk::FIRST_VELOCITY };
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
    /// Number of whom it shows in [`CameraState::owners`]; [`OwnerMap::NOBODY`] of what is none of theirs.
    pub owner: u16,
    /// Share of them that the camera shows, where others or surfaces hide them: 0 to 1; 1 where nobody tells.
    pub shown_share: f64,
}

impl CameraState {
    /// Returns true if a pixel of the mask may show whom a billboard of this camera shows: it is theirs, or nobody is told apart here.
    #[must_use]
    pub fn may_show(&self, owner: u16, (x, y): (u32, u32)) -> bool {
        self.owners.as_ref().is_none_or(|owners| owners.at(x, y) == owner)
    }
}

impl Billboard {
    /// Returns its extent along the base line, metres.
    fn width_m(&self) -> f64 {
        let [left, right] = self.left_right_m;
        right - left
    }

    /// Whether it extends so far upwards or across, or is cut by the picture's border, so that there is no telling.
    fn is_at_least(&self, size_m: f64) -> bool {
        let [left, right] = self.left_right_m;
        self.is_truncated || self.height_m.max(right - left) >= size_m
    }
}

/// Foreground texels placed in the world: those side by side in a row of a camera's picture, told by the first and the last;
/// both are the same where there is one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointRun {
    /// Index into [`SceneState::entities`].
    pub entity_idx: usize,
    /// Index into [`SceneState::cameras`].
    pub camera_idx: usize,
    /// Where the first and the last stand; the others on the line between them.
    pub ends_in_world: [DVec3; 2],
    /// Sides of the squares that cover these texels' footprints without holes, metres.
    pub sizes_m: [f32; 2],
    /// Texture coordinates of the middles of these texels: between them its colours are read.
    pub textures: [[f32; 2]; 2],
    /// How many rows of texels it stands for; at least 1.
    pub n_rows: u32,
}
