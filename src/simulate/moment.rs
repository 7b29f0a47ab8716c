//! A world at an instant: where its actors are, how its crowns are bent, how bright its lights are.
//!
//! Everything that a ray asks about and that changes with time is made once for each instant that a picture needs
//! and then only read. What stands is `Solids`'; nothing here knows pictures.

use super::bounds::{Bounds, BoundsTree, Quality};
use super::figure::Body;
use super::light::LightGains;
use super::shape::Entry;
use super::solids::{Crowns, line};
use crate::geometry::Ray;
use glam::DVec3;

/// A world at an instant.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    pub(super) actors: Actors,
    pub(super) gains: LightGains,
    /// Crowns that wind bends; without, they are at rest.
    pub(super) crowns: Option<Crowns>,
}

impl Moment {
    /// Nobody there, crowns at rest, all lights as the world has them.
    pub(super) fn bare() -> Self {
        Self { actors: Actors::new(Vec::new()), gains: LightGains::default(), crowns: None }
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

    /// The box around each body, in their order.
    pub(super) fn bounds(&self) -> impl Iterator<Item = Bounds> {
        self.bodies.iter().map(|body| body.bounds)
    }
}

/// Whether a cone around the ray, `spread` metres wide for each metre of distance, may meet the ball around a box.
pub(super) fn may_meet((low, high): &Bounds, ray: &Ray, spread: f64) -> bool {
    let to_center = (*low + *high) * 0.5 - ray.origin;
    let along = to_center.dot(ray.direction).max(0.0);
    let radius = (*high - *low).length() * 0.5 + spread * to_center.length();
    (to_center - ray.direction * along).length_squared() <= radius * radius
}
