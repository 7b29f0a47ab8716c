//! Which cameras' billboards are one entity: nearest feet first, within what a pixel is worth there.

use super::{Billboard, Entity, Sighting};
use glam::DVec3;

/// Feet of one entity lie this far apart even where pixels are small: shoes, strides, what blobs miss, metres.
const GATE_M: f64 = 0.5;

/// Pixels by which a blob's foot is commonly wrong.
const GATE_PX: f64 = 3.0;

/// However coarse the pixels, feet further apart than this are two entities, metres.
const GATE_MAX_M: f64 = 1.5;

/// Groups sightings, at most one a camera in a group, closest pairs of feet first.
pub(super) fn entities(sightings: Vec<Sighting>) -> Vec<Entity> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, a) in sightings.iter().enumerate() {
        for (j, b) in sightings.iter().enumerate().skip(i + 1) {
            let gap = (a.billboard.foot_in_world - b.billboard.foot_in_world).length();
            if a.billboard.camera_idx != b.billboard.camera_idx && gap <= gate_m(a, b) {
                pairs.push((gap, i, j));
            }
        }
    }
    pairs.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
    let mut groups: Vec<Vec<usize>> = (0..sightings.len()).map(|i| vec![i]).collect();
    let mut group_of: Vec<usize> = (0..sightings.len()).collect();
    let camera_of = |i: usize| sightings[i].billboard.camera_idx;
    for (_, i, j) in pairs {
        let (a, b) = (group_of[i], group_of[j]);
        let shares_camera =
            groups[a].iter().any(|x| groups[b].iter().any(|y| camera_of(*x) == camera_of(*y)));
        if a == b || shares_camera {
            continue;
        }
        let moved = std::mem::take(&mut groups[b]);
        for member in &moved {
            group_of[*member] = a;
        }
        groups[a].extend(moved);
    }
    let mut sightings: Vec<Option<Sighting>> = sightings.into_iter().map(Some).collect();
    groups
        .into_iter()
        .filter(|group| !group.is_empty())
        .map(|group| entity(group.into_iter().filter_map(|i| sightings[i].take()).collect()))
        .collect()
}

fn gate_m(a: &Sighting, b: &Sighting) -> f64 {
    GATE_PX.mul_add(a.footprint_m.max(b.footprint_m), GATE_M).min(GATE_MAX_M)
}

fn entity(sightings: Vec<Sighting>) -> Entity {
    // Variance grows with the square of a pixel's footprint; half a decimetre stands for what is not the pixels'.
    let weight = |sighting: &Sighting| 1.0 / sighting.footprint_m.min(1e3).powi(2).max(0.05_f64.powi(2));
    let total: f64 = sightings.iter().map(weight).sum();
    let sum: DVec3 =
        sightings.iter().map(|sighting| sighting.billboard.foot_in_world * weight(sighting)).sum();
    let mut sources: Vec<Billboard> = sightings.into_iter().map(|sighting| sighting.billboard).collect();
    sources.sort_by_key(|billboard| billboard.camera_idx);
    Entity { foot_in_world: sum / total, sources }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::PixelRect;

    fn sighting(camera_idx: usize, x: f64, footprint_m: f64) -> Sighting {
        Sighting {
            billboard: Billboard {
                camera_idx,
                rect: PixelRect { x: 0, y: 0, width: 1, height: 1 },
                foot_in_world: DVec3::new(x, 0.0, 0.0),
                right_in_world: DVec3::X,
                left_right_m: [-0.3, 0.3],
                height_m: 1.7,
                is_truncated: false,
            },
            footprint_m,
        }
    }

    #[test]
    fn one_person_seen_by_three_cameras_is_one_entity() {
        let found = entities(vec![sighting(0, 1.0, 0.05), sighting(1, 1.3, 0.05), sighting(2, 0.9, 0.1)]);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].sources.iter().map(|s| s.camera_idx).collect::<Vec<_>>(), [0, 1, 2]);
        assert!((found[0].foot_in_world.x - 1.1).abs() < 0.1, "{}", found[0].foot_in_world);
    }

    #[test]
    fn two_people_in_one_camera_stay_two() {
        let found = entities(vec![sighting(0, 0.0, 0.05), sighting(0, 0.3, 0.05), sighting(1, 0.25, 0.05)]);
        assert_eq!(found.len(), 2);
        let pair = found.iter().find(|entity| entity.sources.len() == 2).expect("a pair");
        assert!((pair.foot_in_world.x - 0.275).abs() < 1e-9, "the nearest pair belongs together");
    }

    #[test]
    fn far_apart_or_unknown_feet_stay_apart_and_finite() {
        assert_eq!(entities(vec![sighting(0, 0.0, 0.05), sighting(1, 0.7, 0.05)]).len(), 2);
        assert_eq!(entities(vec![sighting(0, 0.0, f64::INFINITY), sighting(1, 1.6, 0.05)]).len(), 2);
        let found = entities(vec![sighting(0, 0.0, f64::INFINITY)]);
        assert!(found[0].foot_in_world.is_finite());
        assert!(entities(Vec::new()).is_empty());
    }
}
