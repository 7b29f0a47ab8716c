//! Who is who over time, from sightings whose truth is known.

mod places;

use super::estimate::{Estimate, Foot, Height};
use super::line::Followed;
use super::look::Look;
use super::{Association, Billboard, Entity, Sighting};
use glam::{DMat2, DVec2, DVec3};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::segment::PixelRect;

/// What a camera says of a foot: well known across, as badly as `along_m` along the way that it looks.
fn covariance(look: DVec2, along_m: f64) -> DMat2 {
    let turn = DMat2::from_angle(look.to_angle());
    turn * DMat2::from_diagonal(DVec2::new(along_m, 0.1).powf(2.0)) * turn.transpose()
}

fn track(member: usize, number: u64) -> Followed {
    Followed { member, number, since: Timestamp::from_nanos(number as i64) }
}

fn sighting(member: usize, tracks: &[u64], at: DVec2, covariance: DMat2) -> Sighting {
    Sighting {
        billboard: Billboard {
            camera_idx: member,
            rect: PixelRect { x: 0, y: 0, width: 10, height: 30 },
            foot_in_world: at.extend(0.0),
            right_in_world: DVec3::X,
            left_right_m: [-0.3, 0.3],
            height_m: 1.75,
            is_truncated: false,
            owner: 0,
            shown_share: 1.0,
        },
        member,
        estimate: Estimate { foot: Foot::new(at, covariance), ground_m: 0.0, height: None, look: None },
        head: None,
        tracks: tracks.iter().map(|number| track(member, *number)).collect(),
        person: None,
        is_rest: false,
    }
}

fn plain(member: usize, number: u64, at: DVec2) -> Sighting {
    sighting(member, &[number], at, covariance(DVec2::X, 0.2))
}

fn at(secs: f64) -> Timestamp {
    Timestamp::from_nanos((secs * 1e9).round() as i64)
}

/// Lets an association see an instant at which every track is seen.
fn see(association: &mut Association, secs: f64, sightings: Vec<Sighting>) -> Vec<Entity> {
    let followed: Vec<Followed> = sightings.iter().flat_map(|sighting| sighting.tracks.clone()).collect();
    association.update(at(secs), sightings, &followed)
}

fn ids(entities: &[Entity]) -> Vec<u64> {
    entities.iter().map(|entity| entity.id).collect()
}

/// Steps of a tenth of a second.
fn steps(from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..((to - from) * 10.0).round() as u32).map(move |step| from + 0.1 * f64::from(step))
}

/// Wrong by up to 0.15 m, differently for each camera and step.
fn wrong(member: usize, secs: f64) -> DVec2 {
    DVec2::new((secs * 37.0 + member as f64).sin(), (secs * 53.0 + 2.0 * member as f64).cos()) * 0.15
}

#[test]
fn one_person_seen_by_three_cameras_is_one_entity_with_one_id_through_time() {
    let mut association = Association::default();
    for secs in steps(0.0, 20.0) {
        let place = DVec2::new(1.4 * secs, 3.0);
        let seen = (0..3).map(|member| plain(member, 7, place + wrong(member, secs))).collect();
        let found = see(&mut association, secs, seen);
        assert_eq!((ids(&found), found[0].sources.len()), (vec![1], 3), "{secs}");
        assert!((found[0].foot_in_world.truncate() - place).length() < 0.3);
        assert!(found[0].foot_covariance_m2.determinant() < 0.2_f64.powi(4));
    }
}

#[test]
fn two_who_cross_keep_their_ids_even_as_one_blob() {
    let mut association = Association::default();
    for secs in steps(0.0, 8.0) {
        // They pass 0.3 m from each other after four seconds.
        let (a, b) = (DVec2::new(1.2 * (secs - 4.0), 0.15), DVec2::new(-1.2 * (secs - 4.0), -0.15));
        let is_one_blob = (a - b).length() < 1.2;
        let mut seen = Vec::new();
        for member in 0..2 {
            let off = wrong(member, secs) * 0.5;
            if member == 0 && is_one_blob {
                seen.push(sighting(0, &[1, 2], (a + b) * 0.5, covariance(DVec2::X, 0.6)));
            } else {
                seen.extend([plain(member, 1, a + off), plain(member, 2, b + off)]);
            }
        }
        let found = see(&mut association, secs, seen);
        assert_eq!(ids(&found), [1, 2], "{secs}");
        assert!((found[0].foot_in_world.truncate() - a).length() < 0.6, "{secs}: {}", found[0].foot_in_world);
        if !is_one_blob {
            assert!(found.iter().all(|entity| entity.sources.len() == 2), "{secs}");
        }
    }
}

#[test]
fn people_close_together_are_two_to_cameras_that_graze_the_ground() {
    let mut association = Association::default();
    for secs in steps(0.0, 3.0) {
        let (a, b) = (DVec2::new(0.0, 0.0), DVec2::new(0.42, 0.42));
        let of = |member: usize, look: DVec2| {
            let off = wrong(member, secs) * look;
            [(1, a), (2, b)]
                .map(|(number, place)| sighting(member, &[number], place + off, covariance(look, 2.0)))
        };
        let seen =
            of(0, DVec2::X).into_iter().chain(of(1, DVec2::Y)).chain(of(2, DVec2::new(0.6, -0.8))).collect();
        let found = see(&mut association, secs, seen);
        assert_eq!(ids(&found), [1, 2], "{secs}");
        assert!(found.iter().all(|entity| entity.sources.len() == 3));
        assert!((found[0].foot_in_world.truncate() - a).length() < 0.25, "{}", found[0].foot_in_world);
    }
}

#[test]
fn who_is_lost_between_two_cameras_keeps_the_id_and_who_is_gone_does_not() {
    for (gap_secs, expected) in [(0.5, 1), (2.0, 1), (8.0, 2)] {
        let mut association = Association::default();
        let place = |secs: f64| DVec2::new(1.3 * secs, 0.0);
        for secs in steps(0.0, 3.0) {
            assert_eq!(
                ids(&see(&mut association, secs, vec![plain(0, 1, place(secs) + wrong(0, secs))])),
                [1]
            );
        }
        for secs in steps(3.0, 3.0 + gap_secs) {
            assert!(see(&mut association, secs, Vec::new()).is_empty());
        }
        for secs in steps(3.0 + gap_secs, 5.0 + gap_secs) {
            let found = see(&mut association, secs, vec![plain(1, 9, place(secs) + wrong(1, secs))]);
            assert_eq!(ids(&found), [expected], "{gap_secs}");
        }
    }
}

#[test]
fn who_hides_behind_a_pillar_or_leaves_for_some_time_keeps_the_id_and_a_stranger_gets_one() {
    let own = Look::grey(0.8, 0.2);
    for (gap_secs, look, expected) in
        [(5.5, own, 1), (20.0, own, 1), (20.0, Look::grey(0.2, 0.7), 3), (40.0, own, 3)]
    {
        let mut association = Association::default();
        let dressed = |look: Look, mut seen: Vec<Sighting>| {
            seen.iter_mut().for_each(|of| of.estimate.look = Some(look));
            seen
        };
        // Somebody else stands there all the time.
        let seen = |secs: f64, own: Option<(Look, DVec2)>| {
            let mut seen = dressed(Look::grey(0.4, 0.4), together(0..2, 0, DVec2::new(-4.0, 3.0)));
            let place = |place: DVec2| place + wrong(1, secs) * 0.3;
            seen.extend(own.iter().flat_map(|(look, at)| dressed(*look, together(0..2, 1, place(*at)))));
            seen
        };
        for secs in steps(0.0, 3.0) {
            let found = see(&mut association, secs, seen(secs, Some((own, DVec2::ZERO))));
            assert_eq!(ids(&found), [1, 2]);
        }
        for secs in steps(3.0, 3.0 + gap_secs) {
            assert_eq!(see(&mut association, secs, seen(secs, None)).len(), 1);
        }
        let from = 3.0 + gap_secs;
        assert_eq!(see(&mut association, from, seen(from, Some((look, DVec2::X)))).len(), 1);
        for secs in steps(from + 0.1, from + 2.0) {
            let found = ids(&see(&mut association, secs, seen(secs, Some((look, DVec2::X)))));
            let expected = if expected == 1 { vec![1, 2] } else { vec![1, 3] };
            assert_eq!(found, expected, "{gap_secs} s, at {secs}");
        }
    }
}

/// Returns the id of somebody who sits down in the shade after so many seconds in the sun.
fn id_in_the_shade(secs_in_sun: f64) -> u64 {
    let mut association = Association::default();
    let mut at_end = Vec::new();
    for secs in steps(0.0, secs_in_sun + 0.5) {
        let is_in_sun = secs < secs_in_sun;
        // Cameras' tracks begin anew then.
        let mut seen = together(0..2, usize::from(!is_in_sun), DVec2::ZERO);
        for of in &mut seen {
            of.estimate.look = Some(if is_in_sun { Look::grey(0.9, 0.1) } else { Look::grey(0.2, 0.3) });
            of.estimate.height = Some(Height { mean_m: if is_in_sun { 1.75 } else { 1.3 }, sd_m: 0.1 });
        }
        at_end = ids(&see(&mut association, secs, seen));
    }
    at_end[0]
}

#[test]
fn who_was_followed_for_long_is_who_they_were_and_of_who_was_just_seen_that_is_not_so_sure() {
    assert_eq!((id_in_the_shade(3.0), id_in_the_shade(0.2)), (1, 2));
}

#[test]
fn who_is_back_in_one_camera_is_followed_there_by_their_old_id() {
    let mut association = Association::default();
    let seen = |secs: f64, own: Option<DVec2>| {
        let mut seen: Vec<Sighting> =
            (2..6).map(|idx| plain(0, idx, DVec2::new(10.0 * idx as f64, 0.0) + wrong(0, secs))).collect();
        let own = own.map(|at| plain(0, if secs < 4.0 { 1 } else { 9 }, at));
        seen.splice(0..0, own);
        seen.iter_mut().for_each(|of| of.estimate.look = Some(Look::grey(0.8, 0.2)));
        seen
    };
    for secs in steps(0.0, 3.0) {
        assert_eq!(ids(&see(&mut association, secs, seen(secs, Some(DVec2::ZERO)))), [1, 2, 3, 4, 5]);
    }
    for secs in steps(3.0, 10.0) {
        assert_eq!(see(&mut association, secs, seen(secs, None)).len(), 4);
    }
    // The first sight of the new track tells who it is; at the next, their foot is seen far off.
    for (secs, at) in [(10.0, DVec2::X), (10.1, DVec2::new(1.0, 3.5))] {
        assert_eq!(ids(&see(&mut association, secs, seen(secs, Some(at)))), [1, 2, 3, 4, 5], "{secs}");
    }
}

#[test]
fn a_seek_begins_anew_and_a_look_at_the_past_disturbs_nobody() {
    let one = |secs: f64| vec![plain(0, 1, DVec2::new(secs, 0.0)), plain(1, 1, DVec2::new(secs, 0.0))];
    let mut association = Association::default();
    assert_eq!(ids(&see(&mut association, 100.0, one(100.0))), [1]);
    assert_eq!(ids(&see(&mut association, 30.0, one(30.0))), [2], "back");
    assert_eq!(ids(&see(&mut association, 200.0, one(200.0))), [3], "far on");
    // The present, a playhead that follows it, and looks at instants all over the past.
    for step in 1..200_u32 {
        let now = 200.0 + 0.1 * f64::from(step);
        assert_eq!(ids(&see(&mut association, now, one(now))), [3], "{now}");
        let behind = now - 60.0;
        let playhead = ids(&see(&mut association, behind, one(behind)));
        assert_eq!(playhead, [4], "{behind}");
        if step % 10 == 0 {
            see(&mut association, f64::from(step), one(f64::from(step)));
        }
    }
    // One who looks a little back, or asks for the same again, sees the same.
    let now = 200.0 + 0.1 * 199.0;
    for secs in [now, now - 0.3, now, now - 0.1, now] {
        assert_eq!(ids(&see(&mut association, secs, one(secs))), [3]);
    }
}

#[test]
fn two_taken_for_one_part_by_evidence_that_lasts_and_the_older_keeps_the_id() {
    let mut association = Association::default();
    let mut parted_at = None;
    for secs in steps(0.0, 8.0) {
        // From the third second on it shows that camera 1 follows somebody else.
        let apart = ((secs - 3.0) * 1.0).max(0.0);
        let mut seen = vec![plain(0, 1, DVec2::ZERO)];
        if secs >= 1.0 {
            seen.push(plain(1, 1, DVec2::new(0.0, apart)));
        }
        let found = see(&mut association, secs, seen);
        let of_camera = |camera: usize| {
            found
                .iter()
                .find(|entity| entity.sources.iter().any(|source| source.camera_idx == camera))
                .map(|entity| entity.id)
        };
        assert_eq!(of_camera(0), Some(1), "{secs}");
        if parted_at.is_none() && found.len() == 2 {
            parted_at = Some(secs);
        }
        if parted_at.is_some() {
            assert_eq!((found.len(), of_camera(1)), (2, Some(2)), "{secs}");
        }
    }
    assert!(parted_at.is_some_and(|secs| (3.6..5.5).contains(&secs)), "{parted_at:?}");
}

#[test]
fn a_sight_that_fits_another_better_goes_over_to_them_soon() {
    let mut association = Association::default();
    let mut gone_over_at = None;
    for secs in steps(0.0, 10.0) {
        // Somebody comes out of the shade of another, who walks on and waits; a camera that is far away saw both as
        // one, and now sees whoever stays. It could be either, but is rather the nearer.
        let walked = DVec2::Y * (secs - 2.0).clamp(0.0, 2.0);
        let mut seen = vec![plain(0, 1, walked), sighting(1, &[1], DVec2::ZERO, covariance(DVec2::Y, 1.0))];
        if secs >= 2.5 {
            seen.insert(1, plain(0, 2, DVec2::ZERO));
        }
        let found = see(&mut association, secs, seen);
        let of_far = found.iter().find(|entity| entity.sources.iter().any(|source| source.camera_idx == 1));
        if of_far.is_some_and(|entity| entity.id == 2) {
            gone_over_at = gone_over_at.or(Some(secs));
        } else {
            assert_eq!(gone_over_at, None, "{secs}: it went back");
        }
    }
    assert!(gone_over_at.is_some_and(|secs| (2.55..8.0).contains(&secs)), "{gone_over_at:?}");
}

#[test]
fn a_single_wrong_sight_parts_nothing() {
    let mut association = Association::default();
    for secs in steps(0.0, 4.0) {
        let off = if (2.0..2.05).contains(&secs) { 3.0 } else { 0.0 };
        let found =
            see(&mut association, secs, vec![plain(0, 1, DVec2::ZERO), plain(1, 1, DVec2::new(off, 0.0))]);
        assert_eq!(ids(&found), [1], "{secs}");
    }
}

#[test]
fn two_who_prove_to_be_one_merge_after_a_while_and_the_older_id_stays() {
    let mut association = Association::default();
    let mut merged_at = None;
    for secs in steps(0.0, 8.0) {
        // Camera 1 sees the same person in a wrong place at first, as where the foot is hidden.
        let off = (3.0 - secs).clamp(0.0, 1.5);
        let found =
            see(&mut association, secs, vec![plain(0, 1, DVec2::ZERO), plain(1, 1, DVec2::new(0.0, off))]);
        if secs < 2.0 {
            assert_eq!(ids(&found), [1, 2], "{secs}");
        } else if found.len() == 1 {
            merged_at = merged_at.or(Some(secs));
        }
        if merged_at.is_some() {
            assert_eq!(ids(&found), [1], "{secs}");
        }
    }
    assert!(merged_at.is_some_and(|secs| (2.2..4.0).contains(&secs)), "{merged_at:?}");
}

#[test]
fn what_was_seen_is_evidence_once_however_often_it_is_looked_at() {
    // As above: after some time both prove to be one.
    let seen = |secs: f64| {
        vec![plain(0, 1, DVec2::ZERO), plain(1, 1, DVec2::new(0.0, (3.0 - secs).clamp(0.0, 1.5)))]
    };
    let mut association = Association::default();
    let one = steps(0.0, 8.0).find(|secs| see(&mut association, *secs, seen(*secs)).len() == 1);
    let one = one.expect("they merge");
    let mut association = Association::default();
    let before: Vec<f64> = steps(0.0, one - 0.05).collect();
    for secs in &before {
        assert_eq!(ids(&see(&mut association, *secs, seen(*secs))), [1, 2]);
    }
    // Two who look, one a tenth of a second behind the other, add nothing to what was seen until then.
    for _ in 0..100 {
        for secs in before.iter().rev().take(2) {
            assert_eq!(ids(&see(&mut association, *secs, seen(*secs))), [1, 2], "{secs} of {one}");
        }
    }
    assert_eq!(ids(&see(&mut association, one, seen(one))), [1]);
}

#[test]
fn an_instant_that_is_asked_for_again_is_answered_alike() {
    let mut association = Association::default();
    // Known so badly that nothing says it is even itself.
    let vague = || {
        let covariance = DMat2::from_diagonal(DVec2::new(100.0, 4.0));
        vec![sighting(0, &[], DVec2::ZERO, covariance), sighting(1, &[], DVec2::new(9.0, 0.0), covariance)]
    };
    let first = see(&mut association, 1.0, vague());
    for _ in 0..20 {
        assert_eq!(see(&mut association, 1.0, vague()), first);
    }
}

#[test]
fn a_tracker_made_anew_gives_old_numbers_to_new_people() {
    let mut association = Association::default();
    for secs in steps(0.0, 2.0) {
        see(&mut association, secs, vec![plain(0, 1, DVec2::ZERO)]);
    }
    let mut newcomer = plain(0, 1, DVec2::new(30.0, 0.0));
    newcomer.tracks[0].since = at(2.0);
    assert_eq!(ids(&see(&mut association, 2.0, vec![newcomer])), [2]);
}

/// A walk of several people before several cameras, moved by `shift`.
fn walk(shift: DVec3, secs: f64) -> Vec<Sighting> {
    let mut seen = Vec::new();
    for member in 0..4 {
        for number in 0..6_u64 {
            let turn = 0.3 * secs + number as f64 * 1.05;
            let place = DVec2::from_angle(turn) * (3.0 + number as f64) + wrong(member, secs + number as f64);
            if !(number + member as u64).is_multiple_of(3) {
                let mut one = plain(member, number + 1, place + shift.truncate());
                one.estimate.ground_m += shift.z;
                one.billboard.foot_in_world += DVec3::Z * shift.z;
                seen.push(one);
            }
        }
    }
    seen
}

#[test]
fn the_same_sights_give_the_same_ids_wherever_the_scene_lies() {
    let followed = |shift: DVec3| {
        let mut association = Association::default();
        let found = steps(0.0, 6.0).map(|secs| see(&mut association, secs, walk(shift, secs)));
        found.collect::<Vec<_>>()
    };
    let (here, again, far) =
        (followed(DVec3::ZERO), followed(DVec3::ZERO), followed(DVec3::new(5e5, 5e6, 300.0)));
    assert_eq!(here, again);
    for (here, far) in here.iter().zip(&far) {
        assert_eq!(ids(here), ids(far));
        let n_sources =
            |found: &[Entity]| found.iter().map(|entity| entity.sources.len()).collect::<Vec<_>>();
        assert_eq!(n_sources(here), n_sources(far));
        for (here, far) in here.iter().zip(far) {
            assert!((far.foot_in_world - here.foot_in_world - DVec3::new(5e5, 5e6, 300.0)).length() < 1e-5);
        }
    }
    assert_eq!(ids(&here[50]), [1, 2, 3, 4, 5, 6]);
}

#[test]
fn feet_of_which_nothing_is_known_stay_apart_and_finite() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut association = Association::default();
        let unknown = DMat2::from_diagonal(DVec2::splat(value));
        for secs in steps(0.0, 1.0) {
            let seen = vec![
                sighting(0, &[1], DVec2::ZERO, unknown),
                sighting(1, &[1], DVec2::new(2.0, 0.0), unknown),
                plain(2, 1, DVec2::new(40.0, 0.0)),
            ];
            let found = see(&mut association, secs, seen);
            assert_eq!(ids(&found), [1, 2, 3]);
            assert!(
                found
                    .iter()
                    .all(|entity| entity.foot_in_world.is_finite() && entity.foot_covariance_m2.is_finite())
            );
        }
    }
    assert!(see(&mut Association::default(), 0.0, Vec::new()).is_empty());
}

#[test]
fn what_is_not_followed_yet_is_joined_by_place_alone() {
    let mut association = Association::default();
    let found = see(
        &mut association,
        0.0,
        (0..3).map(|member| sighting(member, &[], DVec2::ZERO, covariance(DVec2::Y, 0.3))).collect(),
    );
    assert_eq!((ids(&found), found[0].sources.len()), (vec![1], 3));
}

/// `n_cameras` that each see `n_people` of a crowd that stands a metre and a half apart.
fn crowd(n_cameras: usize, n_people: u64, secs: f64) -> Vec<Sighting> {
    let place = |number: u64| DVec2::new((number % 10) as f64, (number / 10) as f64) * 1.5;
    let of = |member: usize| {
        (0..n_people)
            .map(move |number| plain(member, number + 1, place(number) + wrong(member, secs + number as f64)))
    };
    (0..n_cameras).flat_map(of).collect()
}

#[test]
fn a_hundred_cameras_over_a_crowd_stay_bounded() {
    let clock = SystemClock::new();
    let mut association = Association::default();
    for secs in [0.0, 0.1] {
        let started = clock.monotonic();
        let found = see(&mut association, secs, crowd(100, 50, secs));
        let took = clock.monotonic().saturating_sub(started);
        assert!(took.as_secs_f64() < 5.0, "{took:?}");
        assert_eq!(found.len(), 50);
        for entity in &found {
            let mut cameras: Vec<usize> = entity.sources.iter().map(|source| source.camera_idx).collect();
            cameras.dedup();
            assert_eq!(cameras.len(), entity.sources.len(), "a camera sees somebody once");
        }
    }
}

#[test]
fn how_far_somebody_reaches_is_what_cameras_say_that_see_them_alone() {
    let mut association = Association::default();
    let reaching = |member: usize, tracks: &[u64], left_right_m: [f64; 2]| {
        let mut of = sighting(member, tracks, DVec2::ZERO, covariance(DVec2::Y, 0.2));
        of.billboard.left_right_m = left_right_m;
        of
    };
    let mut last = None;
    for secs in steps(0.0, 3.0) {
        // The second camera has them in one blob with somebody else.
        let sights = vec![reaching(0, &[1], [-0.2, 0.35]), reaching(1, &[1, 2], [-2.0, 0.3])];
        last = see(&mut association, secs, sights)[0].reach_m;
    }
    assert!((last.unwrap() - 0.35).abs() < 1e-9, "{last:?}");
    for secs in steps(3.0, 6.0) {
        let sights = vec![reaching(0, &[1, 3], [-1.5, 0.3]), reaching(1, &[1, 2], [-2.0, 0.3])];
        last = see(&mut association, secs, sights)[0].reach_m;
    }
    assert!((last.unwrap() - 0.35).abs() < 1e-9, "kept while nobody sees them alone: {last:?}");
    // Arms that are spread are theirs at once where a camera sees them alone, and remembered after a while.
    for secs in steps(6.0, 9.0) {
        last = see(&mut association, secs, vec![reaching(0, &[1], [-0.8, 0.35])])[0].reach_m;
        assert!(last.unwrap() >= 0.8, "{last:?}");
    }
    last = see(&mut association, 9.0, vec![reaching(0, &[1, 3], [-2.0, 0.35])])[0].reach_m;
    assert!(last.unwrap() > 0.75 && last.unwrap() < 0.81, "{last:?}");
    assert_eq!(
        see(&mut Association::default(), 0.0, vec![reaching(0, &[1, 2], [-1.0, 1.0])])[0].reach_m,
        None
    );
}

/// Returns what `members` see of a person whom all cameras together tell.
fn together(members: std::ops::Range<usize>, person: usize, at: DVec2) -> Vec<Sighting> {
    let seen = |member| Sighting {
        person: Some(person),
        ..sighting(member, &[10 * person as u64], at, covariance(DVec2::X, 0.3))
    };
    members.map(seen).collect()
}

#[test]
fn people_whom_all_cameras_tell_apart_are_two_however_near() {
    let mut association = Association::default();
    for secs in steps(0.0, 3.0) {
        let side = DVec2::new(0.5 * secs, 0.0);
        let mut seen = together(0..3, 0, side);
        seen.extend(together(0..2, 1, side + DVec2::new(0.0, 0.25)));
        let found = see(&mut association, secs, seen);
        assert_eq!(ids(&found), [1, 2], "{secs}");
        assert_eq!(found.iter().map(|of| of.sources.len()).collect::<Vec<_>>(), [3, 2]);
        assert!(found[1].foot_in_world.y > 0.15 && found[0].foot_in_world.y < 0.1, "{found:?}");
        assert_eq!(association.expected(at(secs)).len(), 2);
    }
    // Where they should be by then, a fifth of a second later.
    let expected = association.expected(at(3.1));
    assert!((expected[0].foot_in_world.x - 0.5 * 3.1).abs() < 0.03, "{expected:?}");
    assert!(association.expected(at(9.0)).is_empty());
    // They are two where no camera sees both, too.
    let mut seen = together(0..2, 0, DVec2::ZERO);
    seen.extend(together(2..4, 1, DVec2::new(0.0, 0.25)));
    assert_eq!(see(&mut Association::default(), 0.0, seen).len(), 2);
    // A camera of its own sees one more, at the place of the first: it has that one already.
    let mut seen = together(0..3, 0, DVec2::new(1.5, 0.0));
    seen.push(plain(2, 7, DVec2::new(1.5, 0.1)));
    assert_eq!(ids(&see(&mut association, 3.0, seen)), [1]);
}

#[test]
fn who_appears_for_an_instant_between_others_is_not_shown() {
    let mut association = Association::default();
    let first = see(&mut association, 0.0, together(0..2, 0, DVec2::ZERO));
    assert_eq!(first.len(), 1, "of the first instant all that is known is shown");
    let new = || {
        let mut seen = together(0..2, 0, DVec2::ZERO);
        seen.extend(together(0..2, 1, DVec2::new(4.0, 0.0)));
        seen
    };
    assert_eq!(ids(&see(&mut association, 0.2, new())), [1]);
    assert_eq!(ids(&see(&mut association, 0.2, new())), [1], "asked again it is the same");
    assert_eq!(see(&mut association, 0.4, together(0..2, 0, DVec2::ZERO)).len(), 1);
    let mut association = Association::default();
    see(&mut association, 0.0, together(0..2, 0, DVec2::ZERO));
    see(&mut association, 0.2, new());
    assert_eq!(ids(&see(&mut association, 0.4, new())), [1, 2]);
    // Who is seen by one camera alone is shown at once, as before.
    let mut seen = new();
    seen.push(plain(2, 9, DVec2::new(-4.0, 0.0)));
    assert_eq!(see(&mut association, 0.6, seen).len(), 3);
}

#[test]
fn whoever_looks_far_into_the_past_takes_no_id_from_the_present() {
    let mut association = Association::default();
    let live = ids(&see(&mut association, 1000.0, vec![plain(0, 1, DVec2::ZERO)]));
    for far in 0..20 {
        see(&mut association, 40.0 * f64::from(far), vec![plain(0, 100 + far as u64, DVec2::ZERO)]);
    }
    assert_eq!(ids(&see(&mut association, 1000.4, vec![plain(0, 1, DVec2::ZERO)])), live);
}
