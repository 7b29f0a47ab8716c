//! What a ray sees: the nearest thing on its way, and the light that this sends back along the ray.
//!
//! Joins what stands (`Solids`), what moves (`Moment`), what it is painted with and what shines on it (`Light`).
//! Knows nothing of pictures and pixels.

use super::effects::{Draw, EffectKind, LightGains, Tally, WetGround};
use super::light::{Share, Source, off_surface};
use super::material::WallPoint;
use super::material::noise::noise;
use super::moment::Moment;
use super::solids::{Crowns, SolidHit, SolidId};
use super::world::{World, srgb_code};
use glam::{DMat2, DVec2, DVec3};
use videofields_vision::geometry::{Face, Ray, Shape, SurfaceId};

/// The nearest thing on a ray's way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    pub(super) distance_m: f64,
    pub(super) place: DVec3,
    /// Unit normal on the ray's side.
    pub(super) normal: DVec3,
    pub(super) what: What,
}

/// What a ray meets.
#[derive(Clone, Copy, Debug)]
pub(super) enum What {
    /// Somebody or something that moves.
    Actor { instance: u8, color: DVec3 },
    /// Something that stands.
    Solid(SolidHit),
}

/// A source counts for the shadow mask where it adds at least this share of what falls on a place.
const SHADOW_SHARE: f64 = 0.05;

/// A world at an instant, as rays see it.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) world: &'a World,
    pub(super) moment: &'a Moment,
    /// Where effects note their entries.
    pub(super) tally: &'a Tally<'a>,
    /// What the places on the sun's disc and the ripples of puddles are drawn from. It knows no time, so that what
    /// stands still looks the same in every frame.
    pub(super) draw: Draw,
}

/// One sample of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// How much it widens for each metre of its way.
    pub(super) width_for_a_metre: f64,
    /// Its number, which no other sample of the picture has.
    pub(super) index: u64,
}

impl Scene<'_> {
    fn crowns(&self) -> &Crowns {
        self.moment.crowns.as_ref().unwrap_or_else(|| self.world.solids.crowns())
    }

    /// The nearest thing that the ray meets; what moves only if it is nearer than what stands.
    pub(super) fn meet(&self, ray: &Ray) -> Option<Met> {
        let still = self.world.solids.hit_with(self.crowns(), ray);
        let still_distance = still.map_or(f64::INFINITY, |hit| hit.distance_m);
        if let Some(hit) = self.moment.actors.hit(ray).filter(|hit| hit.entry.distance_m < still_distance) {
            let distance_m = hit.entry.distance_m;
            let what = What::Actor { instance: hit.instance, color: hit.color };
            return Some(Met { distance_m, place: ray.at(distance_m), normal: hit.entry.normal, what });
        }
        still.map(|hit| Met {
            distance_m: hit.distance_m,
            place: hit.point,
            normal: hit.normal,
            what: What::Solid(hit),
        })
    }

    /// The light that comes along the ray, and whether it comes from something that moves.
    pub(super) fn light(&self, ray: &Ray, sample: Sample) -> (DVec3, bool) {
        let Some(met) = self.meet(ray) else { return (self.sky(), false) };
        let dry = self.plain(&met, ray, sample, 0.0);
        match (&self.world.effects.wet_ground, met.what) {
            (Some(wet), What::Solid(hit)) if is_level_ground(&hit) => {
                (self.wet(wet, dry, &met, ray, sample), false)
            }
            (_, What::Solid(_)) => (dry, false),
            (_, What::Actor { .. }) => (dry, true),
        }
    }

    fn sky(&self) -> DVec3 {
        self.world.sky * self.moment.gains.sky
    }

    /// The light that what is met scatters; `before_m` is how far the sample had come to where its ray starts.
    fn plain(&self, met: &Met, ray: &Ray, sample: Sample, before_m: f64) -> DVec3 {
        let color = match &met.what {
            What::Actor { color, .. } => *color,
            What::Solid(hit) => {
                let cosine = ray.direction.dot(met.normal).abs();
                let width_m = sample.width_for_a_metre * (before_m + met.distance_m);
                self.world.albedo(hit, footprint_m(width_m, cosine))
            }
        };
        color * self.falling(met.place, met.normal, sample.index)
    }

    /// The light of wet ground that would scatter `dry` if it were not: darker, and with what one mirrored ray sees.
    fn wet(&self, wet: &WetGround, dry: DVec3, met: &Met, ray: &Ray, sample: Sample) -> DVec3 {
        let cosine = -ray.direction.dot(met.normal);
        let wetness = wet.at(met.place.truncate(), cosine, self.tally);
        let scattered = dry * (wetness.albedo_gain * (1.0 - wetness.mirrored));
        let direction = wet.mirrored(ray.direction, met.normal, self.draw, sample.index, self.tally);
        let mirrored = Ray { origin: off_surface(met.place, met.normal), direction };
        let seen = self
            .meet(&mirrored)
            .map_or_else(|| self.sky(), |seen| self.plain(&seen, &mirrored, sample, met.distance_m));
        scattered + seen * wetness.mirrored
    }

    /// Whether what moves, and nothing that stands, keeps the light of a source from a place: the sun's, or a lamp's,
    /// that would add at least 5 % of what falls there. Never where nothing that moves casts shadows.
    pub(super) fn is_in_shadow_of_actor(&self, met: &Met) -> bool {
        if !self.world.effects.cast_shadows.is_some_and(|shadows| shadows.actors_cast()) {
            return false;
        }
        let start = off_surface(met.place, met.normal);
        let (light, gains) = (&self.world.light, &self.moment.gains);
        let shares: Vec<Share> = light.shares(met.place, met.normal, gains).collect();
        let all = shares.iter().map(|share| share.light).sum::<DVec3>() + light.ambient(met.normal, gains);
        shares.iter().any(|share| {
            let end = share.source.beyond(start);
            share.light.element_sum() >= SHADOW_SHARE * all.element_sum()
                && self.moment.actors.hide(start, end)
                && !self.world.solids.is_hidden_with(self.crowns(), start, end)
        })
    }

    fn falling(&self, place: DVec3, normal: DVec3, index: u64) -> DVec3 {
        let is_seen = |start: DVec3, source: Source| {
            let Some(shadows) = &self.world.effects.cast_shadows else { return true };
            let source = match source {
                Source::Sun(to_sun) => {
                    let draw = self.draw.of_effect(EffectKind::CastShadows);
                    Source::Sun(shadows.towards_sun(to_sun, draw, index, self.tally))
                }
                lamp @ Source::Lamp(_) => lamp,
            };
            let end = source.beyond(start);
            let is_hidden = self.world.solids.is_hidden_with(self.crowns(), start, end)
                || (shadows.actors_cast() && self.moment.actors.hide(start, end));
            !is_hidden
        };
        self.world.light.on(place, normal, &self.moment.gains, is_seen)
    }
}

/// Whether water could stand there: ground that slopes less than 1 in 4.
fn is_level_ground(hit: &SolidHit) -> bool {
    matches!(hit.solid, SolidId::Surface(SurfaceId::Ground(_)) | SolidId::Terrain) && hit.normal.z > 0.97
}

/// How wide a sample is on a surface: across the ray as given, along the surface stretched by 1/cos; the mean of both.
fn footprint_m(width_m: f64, cosine: f64) -> f64 {
    width_m / cosine.max(0.02).sqrt()
}

impl World {
    /// What share of light a place of something that stands reflects, for a sample of this width.
    fn albedo(&self, hit: &SolidHit, footprint_m: f64) -> DVec3 {
        match hit.solid {
            SolidId::Surface(SurfaceId::Ground(idx)) => self.ground_paints[usize::from(idx)]
                .albedo(&WallPoint::ground(hit.point.truncate()), footprint_m),
            SolidId::Surface(SurfaceId::Box(idx)) => {
                let idx = usize::from(idx);
                self.box_paints[idx].albedo(&self.wall_point(idx, hit), footprint_m)
            }
            SolidId::Terrain => self.terrain_paint.as_ref().map_or(DVec3::ZERO, |paint| {
                paint.albedo(&WallPoint::ground(hit.point.truncate()), footprint_m)
            }),
            // Worlds are made of ground, boxes, terrain and parts alone.
            SolidId::Surface(_) => DVec3::ZERO,
            SolidId::Post(_) => self.solids.part(hit.solid).map_or(DVec3::ZERO, |part| part.color),
            SolidId::Crown(_) => self.solids.part(hit.solid).map_or(DVec3::ZERO, |part| {
                let at = hit.point.truncate() + DVec2::new(0.7, -0.6) * hit.point.z;
                part.color
                    * (1.0 + 0.3 * noise(at, 0.35, footprint_m, 71) + 0.2 * noise(at, 1.1, footprint_m, 72))
            }),
        }
    }

    fn wall_point(&self, idx: usize, hit: &SolidHit) -> WallPoint {
        let Some(solid) = self.solids.surfaces().boxes().nth(idx) else {
            return WallPoint::ground(DVec2::ZERO);
        };
        let box_from_world = DMat2::from_angle(-self.box_yaws_deg[idx].to_radians());
        let local = box_from_world * (hit.point - solid.center()).truncate();
        let half = solid.half_size();
        if hit.face != Face::Side {
            return WallPoint { wall: None, at: local, size: half.truncate() * 2.0 };
        }
        let normal = box_from_world * hit.normal.truncate();
        let (wall, along, half_width) = if normal.y.abs() > normal.x.abs() {
            if normal.y < 0.0 { (0, local.x, half.x) } else { (2, -local.x, half.x) }
        } else if normal.x > 0.0 {
            (1, local.y, half.y)
        } else {
            (3, -local.y, half.y)
        };
        let foot = solid.center().z - half.z;
        WallPoint {
            wall: Some(wall),
            at: DVec2::new(along + half_width, hit.point.z - foot),
            size: DVec2::new(half_width, half.z) * 2.0,
        }
    }

    /// Light that a place of the still world sends back, for a sample 5 cm wide.
    pub(super) fn still_light(&self, hit: &SolidHit) -> DVec3 {
        let is_seen = |start: DVec3, source: Source| {
            self.effects.cast_shadows.is_none() || !self.solids.is_hidden(start, source.beyond(start))
        };
        let falling = self.light.on(hit.point, hit.normal, &LightGains::default(), is_seen);
        self.albedo(hit, footprint_m(0.05, 1.0)) * falling
    }

    /// The mean colour of a surface (a box's walls) as it is lit, 8-bit sRGB: what a scene shows where no camera
    /// looks.
    pub(super) fn mean_srgb(&self, surface: SurfaceId) -> [u8; 3] {
        const STEPS: u32 = 48;
        let share = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS);
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        let mut add = |point: DVec3, normal: DVec3, face: Face| {
            let solid = SolidId::Surface(surface);
            let hit = SolidHit { distance_m: 1.0, point, normal, face, solid };
            sum += self.still_light(&hit);
            count += 1.0;
        };
        match self.solids.surfaces().shape(surface) {
            Some(Shape::Ground(polygon)) => {
                let low = polygon.corners().iter().copied().fold(DVec2::INFINITY, DVec2::min);
                let high = polygon.corners().iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
                for i in 0..STEPS * STEPS {
                    let at = low + (high - low) * DVec2::new(share(i % STEPS), share(i / STEPS));
                    if polygon.covers(at) {
                        add(at.extend(polygon.height_m()), DVec3::Z, Face::Top);
                    }
                }
            }
            Some(Shape::Box(solid)) => {
                let half = solid.half_size();
                for wall in 0..4 {
                    let outward = DVec2::from_angle(f64::from(wall) * std::f64::consts::FRAC_PI_2);
                    let normal =
                        (solid.world_from_box_point(outward.extend(0.0)) - solid.center()).normalize();
                    for i in 0..STEPS * STEPS {
                        let along = outward.perp() * (2.0 * share(i % STEPS) - 1.0);
                        let up = 2.0 * share(i / STEPS) - 1.0;
                        let at = solid.world_from_box_point((outward + along).extend(up) * half);
                        add(at, normal, Face::Side);
                    }
                }
            }
            _ => {}
        }
        (sum / f64::max(count, 1.0)).to_array().map(srgb_code)
    }
}
