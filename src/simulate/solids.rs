//! Everything that stands in a world, as rays meet it: ground, boxes, terrain, posts, crowns of trees.
//!
//! Owns the tree of boxes over it; what a solid looks like is `shade`'s. Answers exactly what trying every solid would
//! answer, which a property test holds it to. Crowns stand in a tree of their own, because wind sways them.

use super::Terrain;
use super::shape::Part;
use glam::DVec3;
use videofields_vision::geometry::{Bounds, BoundsTree, Face, Quality, Ray, SurfaceId, Surfaces};

/// What stands somewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SolidId {
    /// Ground, a box, or another surface that scenes have as well.
    Surface(SurfaceId),
    /// The terrain.
    Terrain,
    /// A post or trunk, by index.
    Post(u32),
    /// A crown of a tree, by index.
    Crown(u32),
}

/// Where a ray meets something that stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidHit {
    /// Distance along the ray, metres; above 0.
    pub distance_m: f64,
    /// The place in the world.
    pub point: DVec3,
    /// Unit normal on the ray's side (outward, for a ray that starts in a box).
    pub normal: DVec3,
    /// Which side of the solid; of round ones the upper third is the top.
    pub face: Face,
    /// Which solid.
    pub solid: SolidId,
}

/// What hides the end of a line stands at least this far before it, metres.
const BEFORE_END_M: f64 = 0.01;

/// Everything that stands.
#[derive(Clone, Debug)]
pub struct Solids {
    surfaces: Surfaces,
    terrain: Option<Terrain>,
    posts: Vec<Part>,
    crowns: Crowns,
    /// Over the surfaces' parts, the terrain's triangles and posts, numbered in this order.
    tree: BoundsTree,
}

/// Crowns of trees as wind holds them.
#[derive(Clone, Debug)]
pub(super) struct Crowns {
    parts: Vec<Part>,
    /// Of their middles above the ground below them.
    heights_m: Vec<f64>,
    tree: BoundsTree,
}

impl Crowns {
    const fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    fn new(parts: Vec<Part>, heights_m: Vec<f64>, quality: Quality) -> Self {
        let bounds: Vec<Bounds> = parts.iter().map(|part| part.shape.bounds()).collect();
        Self { tree: BoundsTree::new(&bounds, quality), parts, heights_m }
    }

    /// The crowns, each moved by what `offset` gives for its index and the height of its middle above the ground
    /// below it, metres.
    pub(super) fn swayed(&self, offset: impl Fn(u64, f64) -> DVec3) -> Self {
        let crowns = (0..).zip(self.parts.iter().zip(&self.heights_m));
        let moved = crowns.map(|(idx, (part, height_m))| {
            let shape = part.shape.moved(offset(idx, *height_m));
            Part { shape, ..*part }
        });
        Self::new(moved.collect(), self.heights_m.clone(), Quality::Passing)
    }
}

impl Solids {
    /// Surfaces, and uneven ground.
    #[must_use]
    pub fn new(surfaces: Surfaces, terrain: Option<Terrain>) -> Self {
        Self::with_shapes(surfaces, terrain, Vec::new(), Vec::new())
    }

    /// As [`Self::new`], with posts (shapes that stand still) and crowns of trees (shapes that wind sways).
    #[must_use]
    pub fn with_shapes(
        surfaces: Surfaces,
        terrain: Option<Terrain>,
        posts: Vec<Part>,
        crowns: Vec<Part>,
    ) -> Self {
        let mut bounds: Vec<Bounds> =
            (0..surfaces.n_parts()).map(|part| surfaces.part_bounds(part)).collect();
        if let Some(terrain) = &terrain {
            bounds.extend((0..terrain.n_triangles()).map(|idx| terrain.part_bounds(idx)));
        }
        bounds.extend(posts.iter().map(|post| post.shape.bounds()));
        let tree = BoundsTree::new(&bounds, Quality::Lasting);
        let no_crowns = Crowns::new(Vec::new(), Vec::new(), Quality::Lasting);
        let mut solids = Self { surfaces, terrain, posts, crowns: no_crowns, tree };
        let heights_m = crowns.iter().map(|crown| solids.height_over_ground(crown)).collect();
        solids.crowns = Crowns::new(crowns, heights_m, Quality::Lasting);
        solids
    }

    /// How high the middle of a crown stands above what is below it; above z = 0 where nothing is.
    fn height_over_ground(&self, crown: &Part) -> f64 {
        let (low, high) = crown.shape.bounds();
        let middle = (low + high) * 0.5;
        let down = Ray { origin: middle, direction: -DVec3::Z };
        let is_ground = |(distance, (_, _, solid)): Met| {
            matches!(solid, SolidId::Surface(SurfaceId::Ground(_)) | SolidId::Terrain)
                .then_some((distance, ()))
        };
        self.tree
            .nearest(&down, |idx| is_ground(self.meet(idx, &down)?))
            .map_or(middle.z, |(distance, ())| distance)
    }

    /// Ground, boxes and whatever else scenes have as well.
    #[must_use]
    pub const fn surfaces(&self) -> &Surfaces {
        &self.surfaces
    }

    /// Whether anything stands but ground and boxes.
    pub(super) const fn has_shapes(&self) -> bool {
        !self.posts.is_empty() || !self.crowns.is_empty()
    }

    /// Uneven ground, where there is any.
    #[must_use]
    pub const fn terrain(&self) -> Option<&Terrain> {
        self.terrain.as_ref()
    }

    /// The crowns at rest.
    pub(super) const fn crowns(&self) -> &Crowns {
        &self.crowns
    }

    /// What a post or crown is made of.
    pub(super) fn part(&self, solid: SolidId) -> Option<&Part> {
        match solid {
            SolidId::Post(idx) => self.posts.get(idx as usize),
            SolidId::Crown(idx) => self.crowns.parts.get(idx as usize),
            SolidId::Surface(_) | SolidId::Terrain => None,
        }
    }

    fn n_in_tree(&self) -> u32 {
        let n_triangles = match &self.terrain {
            Some(terrain) => terrain.n_triangles(),
            None => 0,
        };
        self.surfaces.n_parts() + self.posts.len() as u32 + n_triangles
    }

    /// Where the ray meets the tree's solid of this number: distance, normal, face, id.
    fn meet(&self, idx: u32, ray: &Ray) -> Option<(f64, (DVec3, Face, SolidId))> {
        if idx < self.surfaces.n_parts() {
            let (surface, met) = self.surfaces.hit_part(idx, ray)?;
            return Some((met.distance_m, (met.normal, met.face, SolidId::Surface(surface))));
        }
        let mut idx = idx - self.surfaces.n_parts();
        if let Some(terrain) = &self.terrain {
            if idx < terrain.n_triangles() {
                let met = terrain.hit_part(idx, ray)?;
                return Some((met.distance_m, (met.normal, met.face, SolidId::Terrain)));
            }
            idx -= terrain.n_triangles();
        }
        meet_part(&self.posts[idx as usize], ray, SolidId::Post(idx))
    }

    /// The nearest solid that the ray meets, with the crowns at rest.
    #[must_use]
    pub fn hit(&self, ray: &Ray) -> Option<SolidHit> {
        self.hit_with(&self.crowns, ray)
    }

    /// The nearest solid that the ray meets, with these crowns instead of those at rest.
    pub(super) fn hit_with(&self, crowns: &Crowns, ray: &Ray) -> Option<SolidHit> {
        let hard = self.tree.nearest(ray, |idx| self.meet(idx, ray));
        let soft =
            crowns.tree.nearest(ray, |idx| meet_part(&crowns.parts[idx as usize], ray, SolidId::Crown(idx)));
        nearer(hard, soft).map(|met| solid_hit(ray, met))
    }

    /// Whether something stands between two points (level ground hides nothing that stands on it); the last 1 cm
    /// before `to` does not count. As [`Surfaces::is_hidden`] where there are boxes alone.
    #[must_use]
    pub fn is_hidden(&self, from: DVec3, to: DVec3) -> bool {
        self.is_hidden_with(&self.crowns, from, to)
    }

    /// As [`Self::is_hidden`], with these crowns instead of those at rest.
    pub(super) fn is_hidden_with(&self, crowns: &Crowns, from: DVec3, to: DVec3) -> bool {
        let Some((ray, limit)) = line(from, to) else { return false };
        // Level ground comes first.
        let n_level = self.surfaces.ground().len() as u32;
        let hides =
            |idx: u32| idx >= n_level && self.meet(idx, &ray).is_some_and(|(distance, _)| distance < limit);
        self.tree.any(&ray, limit, hides)
            || crowns.tree.any(&ray, limit, |idx| {
                crowns.parts[idx as usize].shape.entry(&ray).is_some_and(|entry| entry.distance_m < limit)
            })
    }

    /// As [`Self::hit`], by trying every solid: what the tree is judged by.
    #[must_use]
    pub fn hit_by_trying_all(&self, ray: &Ray) -> Option<SolidHit> {
        let hard = (0..self.n_in_tree()).filter_map(|idx| self.meet(idx, ray));
        let soft = (0..).zip(&self.crowns.parts);
        let soft = soft.filter_map(|(idx, part)| meet_part(part, ray, SolidId::Crown(idx)));
        hard.chain(soft).min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|met| solid_hit(ray, met))
    }
}

type Met = (f64, (DVec3, Face, SolidId));

fn nearer(first: Option<Met>, second: Option<Met>) -> Option<Met> {
    match (first, second) {
        (Some(first), Some(second)) => Some(if second.0 < first.0 { second } else { first }),
        (first, second) => first.or(second),
    }
}

fn meet_part(part: &Part, ray: &Ray, solid: SolidId) -> Option<Met> {
    let entry = part.shape.entry(ray)?;
    let face = if entry.normal.z > 0.5 { Face::Top } else { Face::Side };
    Some((entry.distance_m, (entry.normal, face, solid)))
}

fn solid_hit(ray: &Ray, (distance_m, (normal, face, solid)): Met) -> SolidHit {
    SolidHit { distance_m, point: ray.at(distance_m), normal, face, solid }
}

/// The ray from one point to another, and the distance below which something on it hides the other.
pub(super) fn line(from: DVec3, to: DVec3) -> Option<(Ray, f64)> {
    let direction = (to - from).try_normalize()?;
    Some((Ray { origin: from, direction }, (to - from).length() - BEFORE_END_M))
}

#[cfg(test)]
mod tests {
    use super::super::material::noise::hash01;
    use super::super::shape::Shape;
    use super::*;
    use glam::DVec2;
    use proptest::prelude::*;
    use std::sync::LazyLock;
    use videofields_vision::geometry::{GroundPolygon, OrientedBox};

    /// A town of everything that can stand, around `at`.
    fn town(at: DVec3, n_boxes: i64) -> Solids {
        let unit = |i: i64, k: i64| hash01(i, k, 5);
        let boxes = (0..n_boxes).map(|i| {
            // Multiples of half a metre, so that faces coincide and rays along axes graze them.
            let place = DVec3::new(unit(i, 0), unit(i, 1), 0.0) * 60.0 - DVec3::new(30.0, 30.0, 0.0);
            let size = DVec3::new(unit(i, 2), unit(i, 3), unit(i, 4)) * 8.0 + 1.0;
            let (place, size) = ((place * 2.0).round() * 0.5, size.round());
            let yaw = if i % 3 == 0 { unit(i, 5) * 7.0 } else { 0.0 };
            OrientedBox::new(at + place + DVec3::Z * size.z * 0.5, size, yaw).unwrap()
        });
        let square = |low: f64, high: f64, z: f64| {
            let corners = [[low, low], [high, low], [high, high], [low, high]];
            let corners = corners.map(|corner| DVec2::from_array(corner) + at.truncate());
            GroundPolygon::new(corners.to_vec(), at.z + z).unwrap()
        };
        let heights = (0..20 * 20).map(|i| at.z + 3.0 * unit(i, 6) - 1.5).collect();
        let terrain = Terrain::new(at.truncate() + 31.0, 1.0, 20, heights).unwrap();
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let part = |shape| Part { shape, color: DVec3::ONE };
        let place = |i: i64| at + DVec3::new(unit(i, 7) * 60.0 - 30.0, unit(i, 8) * 60.0 - 30.0, 0.0);
        let post = |i: i64| {
            let shape = match i % 3 {
                0 => Shape::Capsule { from: place(i), to: place(i) + DVec3::Z * 4.0, radius_m: 0.2 },
                1 => Shape::block(place(i), axes, DVec3::new(1.0, 0.5, 2.0)),
                _ => Shape::Capsule { from: place(i), to: place(i), radius_m: 1.0 },
            };
            part(shape)
        };
        let crown =
            |i: i64| part(Shape::ellipsoid(place(i + 90) + DVec3::Z * 5.0, axes, DVec3::new(2.0, 2.5, 1.5)));
        // The first polygon is wider than the tree takes, the next two lie on each other.
        let ground = vec![square(-4e4, 4e4, -2.0), square(-30.0, 30.0, 0.0), square(-30.0, 10.0, 0.0)];
        Solids::with_shapes(
            Surfaces::of_ground_and_boxes(ground, boxes.collect()),
            Some(terrain),
            (0..12).map(post).collect(),
            (0..9).map(crown).collect(),
        )
    }

    /// Whether any solid but the ground, tried one by one, hides a line's end.
    fn is_hidden_by_trying_all(solids: &Solids, from: DVec3, to: DVec3) -> bool {
        let Some((ray, limit)) = line(from, to) else { return false };
        let hides = |distance: f64| distance < limit;
        (solids.surfaces.ground().len() as u32..solids.n_in_tree())
            .any(|idx| solids.meet(idx, &ray).is_some_and(|(distance, _)| hides(distance)))
            || solids
                .crowns
                .parts
                .iter()
                .any(|part| part.shape.entry(&ray).is_some_and(|entry| hides(entry.distance_m)))
    }

    fn agree(solids: &Solids, ray: &Ray) -> bool {
        let (found, expected) = (solids.hit(ray), solids.hit_by_trying_all(ray));
        assert_eq!(found, expected, "{ray:?}");
        if let Some(hit) = &found {
            // A line to what is met, past it, and from it on along every axis and back.
            let past = ray.at(hit.distance_m * 1.5 + 1.0);
            let aside = hit.point + hit.normal.any_orthonormal_vector() * 40.0;
            for (from, to) in [(ray.origin, hit.point), (ray.origin, past), (hit.point, aside)] {
                let expected = is_hidden_by_trying_all(solids, from, to);
                assert_eq!(solids.is_hidden(from, to), expected, "{from} to {to}");
            }
        }
        found.is_some()
    }

    #[test]
    fn the_tree_finds_what_trying_everything_finds() {
        for at in [DVec3::ZERO, DVec3::new(5e5, 5e6, 120.0), DVec3::new(-4e7, 8e7, 0.0)] {
            let solids = town(at, 60);
            let (mut n_hits, mut n_rays) = (0, 0);
            let mut check = |origin: DVec3, direction: DVec3| {
                n_rays += 1;
                n_hits += u32::from(agree(&solids, &Ray { origin, direction }));
            };
            for i in 0..1200 {
                let unit = |k: i64| hash01(i, k, 17);
                let eye = at + (DVec3::new(unit(0), unit(1), unit(2)) * 80.0 - 40.0);
                let target = at + DVec3::new(unit(3) * 60.0 - 30.0, unit(4) * 60.0 - 30.0, unit(5) * 6.0);
                let Some(direction) = (target - eye).try_normalize() else { continue };
                check(eye, direction);
                // From far away, level, and along an axis through whole coordinates, where faces lie.
                check(eye - direction * 10.0_f64.powf(2.0 + 5.0 * unit(6)), direction);
                check(eye, direction.with_z(0.0).normalize_or(DVec3::X));
                let axis = [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z][i as usize % 6];
                check(at + ((eye - at) * 2.0).round() * 0.5, axis);
                // On from a surface, off it, along it.
                let Some(hit) = solids.hit(&Ray { origin: eye, direction }) else { continue };
                let along = hit.normal.any_orthonormal_vector();
                for direction in [direction, hit.normal, along, -hit.normal] {
                    check(hit.point, direction);
                    check(hit.point + hit.normal * 1e-3, direction);
                }
            }
            assert!(n_hits > 3000 && n_rays - n_hits > 300, "{n_hits} of {n_rays} rays meet something");
        }
    }

    proptest! {
        #[test]
        fn any_ray_meets_what_it_meets_first(
            origin in prop::array::uniform3(-60.0..60.0_f64),
            direction in prop::array::uniform3(prop_oneof![Just(0.0), Just(-0.0), -1.0..1.0_f64, -1e-9..1e-9_f64]),
            is_far in any::<bool>(),
        ) {
            let at = if is_far { DVec3::new(5e5, 5e6, 0.0) } else { DVec3::ZERO };
            static TOWNS: LazyLock<[Solids; 2]> =
                LazyLock::new(|| [town(DVec3::ZERO, 7), town(DVec3::new(5e5, 5e6, 0.0), 7)]);
            if let Some(direction) = DVec3::from_array(direction).try_normalize() {
                agree(&TOWNS[usize::from(is_far)], &Ray { origin: at + DVec3::from_array(origin), direction });
            }
        }
    }

    #[test]
    fn an_empty_world_and_rays_that_are_none_meet_nothing() {
        let empty = Solids::new(Surfaces::default(), None);
        let ray = Ray { origin: DVec3::ZERO, direction: DVec3::X };
        assert_eq!(empty.hit(&ray), None);
        assert!(!empty.is_hidden(DVec3::ZERO, DVec3::X));
        let solids = town(DVec3::ZERO, 5);
        for origin in [DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e300)] {
            assert_eq!(solids.hit(&Ray { origin, direction: DVec3::X }), None);
        }
        let no_way = Ray { origin: DVec3::ZERO, direction: DVec3::NAN };
        assert_eq!(solids.hit(&no_way), None);
        assert!(!solids.is_hidden(DVec3::ONE, DVec3::ONE) && !solids.is_hidden(DVec3::NAN, DVec3::ONE));
    }

    #[test]
    fn one_solid_of_each_kind_is_met_for_what_it_is() {
        let solids = town(DVec3::ZERO, 1);
        let surface = SolidId::Surface;
        let mut found = std::collections::BTreeSet::new();
        for i in 0..20_000 {
            let place = DVec3::new(hash01(i, 0, 3) * 90.0 - 35.0, hash01(i, 1, 3) * 90.0 - 35.0, 20.0);
            if let Some(hit) = solids.hit(&Ray { origin: place, direction: -DVec3::Z }) {
                assert_eq!(
                    solids.part(hit.solid).is_some(),
                    matches!(hit.solid, SolidId::Post(_) | SolidId::Crown(_))
                );
                found.insert(hit.solid);
            }
        }
        assert!(
            found.contains(&SolidId::Terrain) && found.contains(&surface(SurfaceId::Box(0))),
            "{found:?}"
        );
        assert!(
            found.contains(&surface(SurfaceId::Ground(0))) && found.contains(&surface(SurfaceId::Ground(1))),
            "{found:?}"
        );
        // Some thin posts stand under crowns.
        assert!((0..12).filter(|i| found.contains(&SolidId::Post(*i))).count() > 8, "{found:?}");
        assert!((0..9).all(|i| found.contains(&SolidId::Crown(i))), "{found:?}");
    }

    #[test]
    fn swayed_crowns_are_met_where_they_sway() {
        let solids = town(DVec3::ZERO, 0);
        let by = DVec3::new(0.4, -0.3, 0.1);
        let swayed = solids.crowns().swayed(|_, _| by);
        let still = solids.crowns().swayed(|_, height| {
            assert!((4.9..5.1).contains(&height), "{height}");
            DVec3::ZERO
        });
        let mut n_crowns = 0;
        for i in 0..5000 {
            let place = DVec3::new(hash01(i, 0, 4) * 60.0 - 30.0, hash01(i, 1, 4) * 60.0 - 30.0, 30.0);
            let down = Ray { origin: place, direction: -DVec3::Z };
            let moved = Ray { origin: place + by, ..down };
            assert_eq!(solids.hit_with(&still, &down), solids.hit(&down));
            let (here, there) = (solids.hit(&down).unwrap(), solids.hit_with(&swayed, &moved));
            if let (SolidId::Crown(_), Some(there)) = (here.solid, there) {
                n_crowns += 1;
                assert!(there.solid == here.solid && (there.point - here.point - by).length() < 1e-9);
            }
        }
        assert!(n_crowns > 100, "{n_crowns}");
    }
}
