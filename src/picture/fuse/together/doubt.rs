//! Asks other cameras about what one camera alone shows: shadows and parts of people, where these look and show nobody.
//!
//! Sightings of single cameras flow in; those that no other camera denies flow out.

use super::{Together, is_shown};
use crate::fuse::Sighting;
use crate::occupancy::{Occupancy, ground_beneath};
use crate::scene::Scene;

/// Steps between places that other cameras are asked about, metres, and their number at most: where there are more, too little is known.
const DENIED_STEP_M: f64 = 0.25;
const MOST_DENIED_STEPS: u32 = 24;

/// Standard deviations by which somebody may stand farther than what is seen lowest, and share of its distance at which they stand at least.
const FARTHER_SDS: f64 = 2.0;
const NEAREST_SHARE: f64 = 0.5;

/// Height by which the ground may rise along a camera's rays, metres.
const STEP_UP_M: f64 = 0.6;

/// Heights of anybody about whom other cameras are asked, metres: who would be taller at a place does not stand there.
const ASKED_HEIGHTS_M: [f64; 2] = [0.5, 2.1];

/// Sightings of one instant about which other cameras are asked at most; others are believed.
const MOST_ASKED: usize = 32;

impl Together {
    /// Leaves out sightings of one camera alone that other cameras deny.
    pub(in super::super) fn drop_denied(
        &self,
        occupancy: &mut Occupancy,
        scene: &Scene,
        sightings: &mut Vec<Sighting>,
    ) {
        let mut n_asked = 0;
        sightings.retain(|sighting| {
            let is_asked = is_doubtful(sighting) && n_asked < MOST_ASKED;
            n_asked += usize::from(is_asked);
            !(is_asked && self.is_denied(occupancy, scene, sighting))
        });
    }

    /// Returns true if nobody stands where one camera alone shows something doubtful: at each place along its rays where somebody may stand,
    /// another camera, which shows other people, looks and shows nobody, or its own camera shows background where it should show them; the
    /// former at one place at least.
    fn is_denied(&self, occupancy: &mut Occupancy, scene: &Scene, sighting: &Sighting) -> bool {
        let Sighting { billboard, member, estimate, .. } = sighting;
        let foot = billboard.foot_in_world;
        let shows_others = |member: usize| self.owners[member].people.iter().any(is_shown);
        let others: Vec<usize> =
            (0..self.owners.len()).filter(|other| other != member && shows_others(*other)).collect();
        let eye = scene.cameras[*member].camera.pose().position_in_world;
        let Some(away) = (foot - eye).truncate().try_normalize().filter(|_| !others.is_empty()) else {
            return false;
        };
        let distance_m = (foot - eye).truncate().length();
        let slope = (billboard.height_m + foot.z - eye.z) / distance_m;
        // The ray over the head, above the ground where it is seen lowest.
        let height_at = |metres_farther: f64| slope.mul_add(metres_farther, billboard.height_m);
        let farther_m = FARTHER_SDS * estimate.foot.sd_along_m(away);
        let mut is_denied_by_another = false;
        for step in 0.. {
            let metres_farther = farther_m - f64::from(step) * DENIED_STEP_M;
            let is_nearer = metres_farther < 0.0;
            let is_near_enough = metres_farther >= (NEAREST_SHARE - 1.0) * distance_m;
            let is_too_tall = is_nearer && height_at(metres_farther) > ASKED_HEIGHTS_M[1];
            if !is_near_enough || is_too_tall {
                break;
            }
            if step == MOST_DENIED_STEPS {
                return false;
            }
            let place = foot.truncate() + away * metres_farther;
            let Some(at) = ground_beneath(scene, place.extend(foot.z + STEP_UP_M)) else { continue };
            let height_m =
                (height_at(metres_farther) + foot.z - at.z).clamp(ASKED_HEIGHTS_M[0], ASKED_HEIGHTS_M[1]);
            let body = (at, height_m);
            let is_denied = others.iter().any(|other| occupancy.shows_nobody(scene, *other, body));
            is_denied_by_another |= is_denied;
            let shows_background =
                (is_nearer || !is_denied) && occupancy.shows_background(scene, *member, body);
            if shows_background && is_nearer {
                // Farther down the picture it shows no more of anybody.
                break;
            }
            if !is_denied && !shows_background {
                return false;
            }
        }
        is_denied_by_another
    }
}

/// Returns true if a camera alone shows something that it does not follow by itself: new, or what is left of a blob.
const fn is_doubtful(sighting: &Sighting) -> bool {
    (sighting.tracks.is_empty() || sighting.is_rest) && !sighting.billboard.is_truncated
}

#[cfg(test)]
mod tests {
    use crate::fuse::assemble as assemble_instant;
    use crate::occupancy::drawn_people::{around, camera, mask, observation, scene};
    use glam::DVec3;
    use videofields_vision::clock::Timestamp;
    use videofields_vision::frame::CameraId;
    use videofields_vision::geometry::Camera;
    use videofields_vision::segment::Blob;
    use videofields_vision::track::Track;

    /// Returns who is found where the first camera shows what the others do not, each thing of it with a track of its own if it `is_followed`.
    fn found_by_the_first_alone(
        boxes: &str,
        (cameras, people): (&[Camera], &[(DVec3, f64)]),
        (first_alone, is_followed): (&[(DVec3, f64)], bool),
    ) -> Vec<DVec3> {
        let scene = scene(DVec3::ZERO, boxes, cameras);
        let first = [people, first_alone].concat();
        let observe = |id: &CameraId| {
            let member = scene.cameras.iter().position(|member| member.id == *id)?;
            let shown = if member == 0 { first.as_slice() } else { people };
            let mut seen = observation(id.clone(), mask(&scene, &cameras[member], shown));
            if is_followed {
                let track = |(idx, blob): (usize, &Blob)| Track {
                    id: idx as u64,
                    rect: blob.rect,
                    blob_idx: Some(idx as u32),
                    foot_in_image: blob.foot_in_image,
                    velocity_px_per_sec: [0.0; 2],
                    first_seen: Timestamp::from_nanos(0),
                    last_seen: Timestamp::from_nanos(0),
                    is_in_group: false,
                    still_since: None,
                };
                seen.tracks = seen.blobs.iter().enumerate().map(track).collect();
            }
            Some(seen)
        };
        let state = assemble_instant(&scene, Timestamp::from_nanos(0), observe, Some(1));
        state.entities.iter().map(|entity| entity.foot_in_world).collect()
    }

    #[test]
    fn one_camera_alone_is_believed_of_who_is_followed_and_where_no_other_looks() {
        let cameras = around(DVec3::ZERO);
        let somebody = [(DVec3::ZERO, 1.75)];
        let n_found = |boxes: &str, first_alone: (DVec3, f64), is_followed: bool| {
            found_by_the_first_alone(boxes, (&cameras, &somebody), (&[first_alone], is_followed)).len()
        };
        let far = DVec3::new(2.2, 1.4, 0.0);
        for height_m in [1.7, 0.9] {
            assert_eq!([n_found("", (far, height_m), true), n_found("", (far, height_m), false)], [2, 1]);
        }
        let walls = r#"{"id": "a", "center_m": [1.2, 1.9, 1.5], "size_m": [0.2, 2.4, 3]},
            {"id": "b", "center_m": [2.4, 3.2, 1.5], "size_m": [2.4, 0.2, 3]}"#;
        assert_eq!(n_found(walls, (far, 1.7), false), 2);
    }

    #[test]
    fn a_camera_that_shows_nobody_at_all_denies_nobody_and_who_is_cut_by_the_border_may_stand_elsewhere() {
        let cameras = around(DVec3::ZERO);
        let wall = r#"{"id": "b", "center_m": [2.55, 2.2, 1.5], "size_m": [1.2, 0.2, 3]}"#;
        let scene = scene(DVec3::ZERO, wall, &cameras);
        let somebody = (DVec3::ZERO, 1.75);
        let (with_another, others) = ([somebody, (DVec3::new(2.6, 0.2, 0.0), 1.7)], [somebody]);
        let n_found = |second: &[(DVec3, f64)]| {
            let observe = |id: &CameraId| {
                let member = scene.cameras.iter().position(|member| member.id == *id)?;
                let shown = [with_another.as_slice(), second, others.as_slice()][member];
                Some(observation(id.clone(), mask(&scene, &cameras[member], shown)))
            };
            assemble_instant(&scene, Timestamp::from_nanos(0), observe, Some(1)).entities.len()
        };
        assert_eq!([n_found(&others), n_found(&[])], [1, 2]);
        // A third of them, legs alone, is not nobody.
        assert_eq!(n_found(&[somebody, (with_another[1].0, 0.6)]), 2);
        let cut = (DVec3::new(5.8, -5.8, 0.0), 1.7);
        let found = found_by_the_first_alone("", (&cameras, &[somebody]), (&[cut], false));
        assert_eq!(found.len(), 2, "{found:?}");
    }

    #[test]
    fn what_hangs_together_with_somebody_in_one_camera_alone_is_nobody() {
        // As long as them, and as they see it: a shadow on the ground towards the camera.
        let cameras = [(0.0, -9.0), (9.0, 0.0)].map(|(x, y)| camera(DVec3::new(x, y, 3.5), DVec3::Z * 0.8));
        let somebody = [(DVec3::ZERO, 1.75)];
        let shadow: Vec<(DVec3, f64)> =
            (1..=14).map(|step| (DVec3::new(0.08, -0.16, 0.0) * f64::from(step), 0.35)).collect();
        for is_followed in [false, true] {
            let found = found_by_the_first_alone("", (&cameras, &somebody), (&shadow, is_followed));
            assert!(found.len() == 1 && found[0].length() < 0.2, "{found:?}");
        }
        // Somebody there is as tall as people are.
        let behind = [(DVec3::new(-0.9, 0.0, 0.0), 1.7)];
        let found = found_by_the_first_alone("", (&cameras, &somebody), (&behind, true));
        assert_eq!(found.len(), 2, "{found:?}");
    }

    #[test]
    fn who_is_followed_by_one_camera_alone_stands_about_where_it_shows_them() {
        let (both, one) = ((DVec3::new(0.0, 0.0, 0.0), 1.75), (DVec3::new(2.2, 1.4, 0.0), 1.7));
        let cameras = around(DVec3::ZERO);
        let places = found_by_the_first_alone("", (&cameras, &[both]), (&[one], true));
        assert_eq!(places.len(), 2);
        assert!(
            [both, one].iter().all(|(at, _)| places.iter().any(|of| of.distance(*at) < 0.6)),
            "{places:?}"
        );
    }
}
