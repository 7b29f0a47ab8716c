//! A world at an instant: where its actors are, how its crowns are bent, how bright its lights are, how its camera
//! sways.
//!
//! Everything that a ray asks about and that changes with time is made once for each instant that a picture needs
//! and then only read. A picture that takes time (motion blur, rolling shutter) is cut into [`N_MOMENTS`] instants,
//! and a ray is cast at the one nearest to its own. What stands is `Solids`'; nothing here knows pixels.

use super::SimulateError;
use super::effects::{Draw, Effects, LightGains};
use super::figure::Body;
use super::shape::Entry;
use super::solids::{Crowns, line};
use super::world::World;
use glam::DVec3;
use rayon::prelude::*;
use videofields_vision::geometry::{Bounds, BoundsTree, Quality};
use videofields_vision::geometry::{Camera, Ray};

/// Into how many instants a picture that takes time is cut. Odd, so that the middle one is the capture instant. A
/// picture that takes 1/30 s has instants half a millisecond apart, in which a car at 50 km/h drives 7 mm.
const N_MOMENTS: u32 = 65;

/// A world at an instant, as one camera sees it.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    pub(super) camera: Camera,
    pub(super) actors: Actors,
    pub(super) gains: LightGains,
    /// Crowns that wind bends; without, they are at rest.
    pub(super) crowns: Option<Crowns>,
}

impl Moment {
    /// Nobody there, crowns at rest, all lights as the world has them.
    pub(super) fn bare(camera: &Camera) -> Self {
        let actors = Actors::new(Vec::new());
        Self { camera: camera.clone(), actors, gains: LightGains::default(), crowns: None }
    }
}

/// The instants of one picture.
#[derive(Clone, Debug)]
pub(super) struct Moments {
    list: Vec<Moment>,
    /// From the first instant's beginning to the last one's end; the capture instant is in the middle.
    span_secs: f64,
}

impl Moments {
    /// One instant for the whole picture.
    pub(super) fn one(moment: Moment) -> Self {
        Self { list: vec![moment], span_secs: 0.0 }
    }

    /// The instant nearest to one that is so many seconds from the capture instant.
    pub(super) fn at(&self, offset_secs: f64) -> &Moment {
        if self.list.len() == 1 {
            return &self.list[0];
        }
        // A cast from float saturates.
        let place = (offset_secs / self.span_secs + 0.5) * self.list.len() as f64;
        &self.list[(place as usize).min(self.list.len() - 1)]
    }

    /// A box for everybody that is in the picture at any of its instants, around all places where they are.
    pub(super) fn actor_bounds(&self) -> Vec<Bounds> {
        let mut all: Vec<Option<Bounds>> = Vec::new();
        for moment in &self.list {
            all.resize(moment.actors.bodies.len(), None);
            for (bounds, body) in all.iter_mut().zip(&moment.actors.bodies) {
                if !body.parts.is_empty() {
                    let (low, high) = body.bounds;
                    *bounds = Some(bounds.map_or((low, high), |(a, b): Bounds| (a.min(low), b.max(high))));
                }
            }
        }
        all.into_iter().flatten().collect()
    }
}

/// What takes a picture, and when.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// As it is calibrated.
    pub camera: &'a Camera,
    /// Id of the world's camera that this is, if it is one: it shakes, blurs and rolls as the world's effects say.
    /// A view where no camera stands is steady and takes no time.
    pub device: Option<&'a str>,
    /// The capture instant, seconds: the middle of the picture's time.
    pub time_secs: f64,
}

/// How a shot's samples are spread over time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shutter<'a> {
    pub(super) effects: &'a Effects,
    /// The device's random numbers; a view has none and takes no time.
    pub(super) draw: Option<Draw>,
}

impl Shutter<'_> {
    fn span_secs(&self) -> f64 {
        let open = self.effects.motion_blur.map_or(0.0, |blur| blur.open_secs);
        let readout = self.effects.rolling_shutter.map_or(0.0, |rolling| rolling.readout_secs.abs());
        self.draw.map_or(0.0, |_| open + readout)
    }
}

impl World {
    pub(super) fn shutter(&self, shot: &Shot<'_>) -> Shutter<'_> {
        let draw = shot.device.map(|id| Draw::of_camera(self.effects.seed, id));
        Shutter { effects: &self.effects, draw }
    }

    /// The instants that a shot needs.
    ///
    /// # Errors
    /// When the time is not a finite number.
    pub(super) fn moments(&self, shot: &Shot<'_>) -> Result<Moments, SimulateError> {
        let shutter = self.shutter(shot);
        let span_secs = shutter.span_secs();
        if span_secs <= 0.0 {
            return Ok(Moments::one(self.moment(shot, shutter.draw, shot.time_secs)?));
        }
        let time_of = |k: u32| {
            let offset = (f64::from(k) + 0.5) / f64::from(N_MOMENTS) - 0.5;
            shot.time_secs + offset * span_secs
        };
        let moments = (0..N_MOMENTS).into_par_iter().map(|k| self.moment(shot, shutter.draw, time_of(k)));
        Ok(Moments { list: moments.collect::<Result<_, _>>()?, span_secs })
    }

    fn moment(&self, shot: &Shot<'_>, draw: Option<Draw>, time_secs: f64) -> Result<Moment, SimulateError> {
        let tally = self.entries.tally();
        let actors = Actors::new(self.bodies(time_secs)?);
        let gains = self.effects.light_gains(time_secs, &tally);
        let crowns = self.effects.foliage_motion.map(|motion| {
            let seed = self.effects.seed;
            self.solids.crowns().swayed(|idx, height_m| motion.sway(seed, idx, height_m, time_secs, &tally))
        });
        let camera = match (&self.effects.camera_shake, draw) {
            (Some(shake), Some(draw)) => {
                let rest = shot.camera;
                let pose = shake.pose(rest.pose(), draw, time_secs, &tally);
                let (size, focal, center) = (rest.size_px(), rest.focal_px(), rest.center_px());
                Camera::new(size, focal, center, *rest.distortion(), pose)?
            }
            _ => shot.camera.clone(),
        };
        Ok(Moment { camera, actors, gains, crowns })
    }
}

/// Everybody and everything that moves, where it is at an instant.
#[derive(Clone, Debug)]
pub(super) struct Actors {
    bodies: Vec<Body>,
    /// Body and part of each solid in the tree.
    parts: Vec<(u32, u32)>,
    tree: BoundsTree,
}

/// Where a ray meets an actor.
#[derive(Clone, Copy, Debug)]
pub(super) struct ActorHit {
    pub(super) entry: Entry,
    /// Albedo, linear light.
    pub(super) color: DVec3,
    /// Its value in instance masks, from 1.
    pub(super) instance: u8,
}

impl Actors {
    /// The bodies in the order of their instances, which begin at 1.
    pub(super) fn new(bodies: Vec<Body>) -> Self {
        let parts: Vec<(u32, u32)> = (0..)
            .zip(&bodies)
            .flat_map(|(body_idx, body)| {
                (0..).take(body.parts.len()).map(move |part_idx| (body_idx, part_idx))
            })
            .collect();
        let bounds: Vec<Bounds> =
            bodies.iter().flat_map(|body| body.parts.iter().map(|part| part.shape.bounds())).collect();
        Self { tree: BoundsTree::new(&bounds, Quality::Passing), bodies, parts }
    }

    /// The nearest part of anybody that the ray enters.
    pub(super) fn hit(&self, ray: &Ray) -> Option<ActorHit> {
        let (_, hit) = self.tree.nearest(ray, |idx| {
            let (body, part) = self.parts[idx as usize];
            let part = &self.bodies[body as usize].parts[part as usize];
            let entry = part.shape.entry(ray)?;
            // Worlds have at most 255 actors.
            let instance = u8::try_from(body + 1).unwrap_or(u8::MAX);
            Some((entry.distance_m, ActorHit { entry, color: part.color, instance }))
        })?;
        Some(hit)
    }

    /// Whether anybody stands between two points; the last 1 cm before `to` does not count.
    pub(super) fn hide(&self, from: DVec3, to: DVec3) -> bool {
        let Some((ray, limit)) = line(from, to) else { return false };
        self.tree.any(&ray, limit, |idx| {
            let (body, part) = self.parts[idx as usize];
            let shape = &self.bodies[body as usize].parts[part as usize].shape;
            shape.entry(&ray).is_some_and(|entry| entry.distance_m < limit)
        })
    }
}

/// Whether a cone around the ray, `spread` metres wide for each metre of distance, may meet the ball around a box.
pub(super) fn may_meet((low, high): &Bounds, ray: &Ray, spread: f64) -> bool {
    let to_center = (*low + *high) * 0.5 - ray.origin;
    let along = to_center.dot(ray.direction).max(0.0);
    let radius = (*high - *low).length() * 0.5 + spread * to_center.length();
    (to_center - ray.direction * along).length_squared() <= radius * radius
}
