//! Which occluders open, so that whom they hide from the viewer is seen through them (Video Fields section 3.7).
//!
//! What hides is found by rays from several points of every entity to the viewer; an occluder opens where it hides most of
//! one. A picture by itself shows the settled state; a [`ViewSession`] comes to it smoothly over scene time.

use super::fields::FieldsHistory;
use super::{EntityStyle, Picture, Plan, Reason, Viewer};
use crate::fuse::{Billboard, Entity, SceneState};
use crate::scene::Scene;
use glam::DVec3;
use std::sync::{Arc, Weak};
use videofields_vision::clock::Timestamp;
use videofields_vision::geometry::{Ray, SurfaceId, Surfaces};

/// Opacity of an occluder that is open: enough to see where it stands and whom it hides.
pub const OPEN_OPACITY: f32 = 0.3;

/// Share of an entity's points that an occluder hides from which on it opens, and down to which one that is open stays so.
const OPENS_AT: f64 = 0.5;
const CLOSES_BELOW: f64 = 0.25;

/// Scene time in which all but 5 % of a change of opacity is done, seconds.
const SETTLED_SECS: f64 = 0.5;

/// A session goes on over steps of scene time up to this, and back by this (frames may be drawn out of their order),
/// seconds; what leaps further begins anew with the settled state.
const LONGEST_STEP_SECS: f64 = 5.0;
const LONGEST_BACK_SECS: f64 = 0.5;

/// Nearer to full opacity than this an occluder is as good as closed.
const CLOSED_OPACITY: f32 = 0.99;

/// Where on its rectangle an entity is looked for: shares of its extent to the left or right, and of its height. The lowest
/// lies a little above the ground, which hides nobody.
const LOOKED_AT: [(f64, f64); 7] =
    [(0.0, 0.06), (0.0, 0.3), (0.0, 0.55), (0.0, 0.8), (0.0, 0.97), (-0.7, 0.6), (0.7, 0.6)];

/// Most surfaces that a ray is followed through, and most times that it meets any: models have many sides.
const MAX_CROSSED: usize = 16;
const MAX_HITS: usize = 256;

/// Nearer than this to what it met last, a ray meets the same again, and nearer to the viewer nothing hides, metres.
const BESIDE_M: f64 = 0.02;

/// What lies no further than this above or below a foot is what it stands on, metres.
const STEP_M: f64 = 0.1;

/// An occluder that is drawn translucent.
#[derive(Clone, Debug, PartialEq)]
pub struct Opened {
    /// Which surface.
    pub surface: SurfaceId,
    /// How much of what lies behind it it covers, above 0, below 1.
    pub opacity: f32,
    /// Entities (indices into `SceneState::entities`) of which it hides a part: they are drawn before it.
    pub hides: Vec<usize>,
}

/// What an occluder hides at an instant.
#[derive(Clone, Debug)]
struct Occluder {
    surface: SurfaceId,
    /// Greatest share of one entity's points that it hides.
    share: f64,
    hides: Vec<usize>,
    /// Greatest distance to the viewer at which it is crossed, metres.
    distance_m: f64,
}

/// What is smoothed over scene time for one who looks: an operator's window, or all tiles of a wall, whichever of them is
/// drawn first.
///
/// It belongs to a scene: with another it begins anew.
#[derive(Clone, Debug, Default)]
pub struct ViewSession {
    scene: Weak<Scene>,
    at: Option<Timestamp>,
    /// How far everything had opened before the instant, and what share of a change is done by then.
    before: Vec<Opening>,
    gain: f32,
    /// What hides at the instant, as far as any picture of it has told.
    hiding: Vec<(SurfaceId, f64)>,
    now: Vec<Opening>,
    /// How far texture fields have followed.
    pub(super) fields: FieldsHistory,
}

/// How far an occluder has opened.
#[derive(Clone, Copy, Debug)]
struct Opening {
    surface: SurfaceId,
    opacity: f32,
    is_open: bool,
    /// Greatest distance to the viewer at which it hid somebody when it last did, metres.
    distance_m: f64,
}

impl ViewSession {
    /// Goes on to the state's instant, at which `occluders` hide something; what is not closed then stands in `now`.
    fn advance(&mut self, state: &SceneState, occluders: &[Occluder]) {
        let passed_secs = self.at.map(|at| state.instant.secs_since(at));
        let goes_on = std::ptr::eq(self.scene.as_ptr(), Arc::as_ptr(&state.scene))
            && passed_secs.is_some_and(|passed| (-LONGEST_BACK_SECS..=LONGEST_STEP_SECS).contains(&passed));
        let passed_secs = passed_secs.filter(|_| goes_on);
        match passed_secs {
            // A picture of a little before is shown as it is now.
            Some(passed) if passed < 0.0 => return,
            Some(passed) if passed > 0.0 => {
                self.before = std::mem::take(&mut self.now);
                // Three time constants leave 5 %.
                self.gain = 1.0 - (-3.0 * passed / SETTLED_SECS).exp() as f32;
                self.hiding.clear();
            }
            // Another picture of the same instant.
            Some(_) => {}
            None => {
                let fields = std::mem::take(&mut self.fields);
                *self = Self { scene: Arc::downgrade(&state.scene), gain: 1.0, fields, ..Self::default() };
            }
        }
        self.at = Some(state.instant);
        for Occluder { surface, share, distance_m, .. } in occluders {
            match self.hiding.iter_mut().find(|(known, _)| known == surface) {
                Some((_, most)) => *most = most.max(*share),
                None => self.hiding.push((*surface, *share)),
            }
            if let Some(known) = self.before.iter_mut().find(|opening| opening.surface == *surface) {
                known.distance_m = *distance_m;
            } else {
                let (surface, distance_m) = (*surface, *distance_m);
                self.before.push(Opening { surface, opacity: 1.0, is_open: false, distance_m });
            }
        }
        self.now.clone_from(&self.before);
        for opening in &mut self.now {
            let hiding = self.hiding.iter().find(|(surface, _)| *surface == opening.surface);
            let share = hiding.map_or(0.0, |(_, share)| *share);
            opening.is_open = share >= if opening.is_open { CLOSES_BELOW } else { OPENS_AT };
            let settled = if opening.is_open { OPEN_OPACITY } else { 1.0 };
            opening.opacity += (settled - opening.opacity) * self.gain;
        }
        self.now.retain(|opening| opening.is_open || opening.opacity < CLOSED_OPACITY);
    }

    /// What is seen through, the farthest first.
    fn seen_through(&self) -> Vec<Opening> {
        let is_seen_through = |opening: &&Opening| opening.opacity < CLOSED_OPACITY;
        let mut found: Vec<Opening> = self.now.iter().filter(is_seen_through).copied().collect();
        found.sort_by(|a, b| b.distance_m.total_cmp(&a.distance_m));
        found
    }
}

/// Fills in which occluders open for the entities that `plan` draws.
pub(super) fn plan(
    state: &SceneState,
    picture: &Picture,
    (wished, session): (EntityStyle, Option<&mut ViewSession>),
    plan: &mut Plan,
) {
    // By which source each is drawn.
    let drawn: Vec<(usize, usize)> =
        plan.billboards.iter().map(|planned| (planned.entity, planned.source)).collect();
    let is_wished = wished != EntityStyle::None;
    let mut looked_for = drawn.clone();
    if picture.is_window && is_wished {
        // All windows into a picture agree on what opens, whichever of them shows whom, and by which source.
        looked_for = (0..state.entities.len()).map(|idx| (idx, 0)).collect();
    } else if session.is_some() && is_wished {
        // All pictures of a session agree too, so they also look for whom they do not show themselves.
        let others = (0..state.entities.len()).filter(|idx| drawn.iter().all(|(entity, _)| entity != idx));
        looked_for.extend(others.map(|idx| (idx, 0)));
    }
    let occluders = if looked_for.is_empty() { Vec::new() } else { occluders(state, picture, &looked_for) };
    let mut alone = ViewSession::default();
    let session = session.unwrap_or(&mut alone);
    if is_wished {
        session.advance(state, &occluders);
        let hides = |surface: SurfaceId| {
            let hiding = occluders.iter().find(|occluder| occluder.surface == surface);
            hiding.map_or_else(Vec::new, |occluder| occluder.hides.clone())
        };
        let opened = session.seen_through().into_iter().map(|Opening { surface, opacity, .. }| Opened {
            surface,
            opacity,
            hides: hides(surface),
        });
        plan.opened = opened.collect();
    }
    let because = match (plan.opened.len(), drawn.len()) {
        (0, 0) => "no entity is drawn".to_owned(),
        (0, n) => format!("none of {n} entities is hidden by a building"),
        (n_opened, _) => {
            let mut hidden: Vec<usize> =
                plan.opened.iter().flat_map(|opened| &opened.hides).copied().collect();
            hidden.sort_unstable();
            hidden.dedup();
            format!(
                "{} of {} entities are hidden; buildings that open: {n_opened}",
                hidden.len(),
                looked_for.len()
            )
        }
    };
    plan.reasons.push(Reason { effect: "see_through", is_on: !plan.opened.is_empty(), because });
}

/// What stands between the viewer and the entities.
fn occluders(state: &SceneState, picture: &Picture, entities: &[(usize, usize)]) -> Vec<Occluder> {
    let surfaces = &state.scene.surfaces;
    let stood_upon: Vec<SurfaceId> =
        state.entities.iter().filter_map(|entity| stood_upon(surfaces, entity.foot_in_world)).collect();
    let mut found: Vec<Occluder> = Vec::new();
    for (entity, source) in entities {
        let of = &state.entities[*entity];
        let Some(billboard) = of.sources.get(*source) else { continue };
        let mut crossed: Vec<(SurfaceId, usize, f64)> = Vec::new();
        for point in looked_at(of, billboard) {
            let Some((ray, reach_m)) = to_viewer(picture, point) else { continue };
            let crossings = crossings(surfaces, &ray, reach_m);
            for (surface, distance_m) in
                crossings.into_iter().filter(|(surface, _)| !stood_upon.contains(surface))
            {
                let from_viewer_m = reach_m - distance_m;
                match crossed.iter_mut().find(|(known, ..)| *known == surface) {
                    Some((_, n, farthest)) => (*n, *farthest) = (*n + 1, farthest.max(from_viewer_m)),
                    None => crossed.push((surface, 1, from_viewer_m)),
                }
            }
        }
        for (surface, n_hidden, distance_m) in crossed {
            let share = n_hidden as f64 / LOOKED_AT.len() as f64;
            match found.iter_mut().find(|occluder| occluder.surface == surface) {
                Some(occluder) => {
                    occluder.share = occluder.share.max(share);
                    occluder.distance_m = occluder.distance_m.max(distance_m);
                    occluder.hides.push(*entity);
                }
                None => found.push(Occluder { surface, share, hides: vec![*entity], distance_m }),
            }
        }
    }
    found
}

/// What an entity stands on: a model that somebody stands on is ground as well, and stays closed.
fn stood_upon(surfaces: &Surfaces, foot: DVec3) -> Option<SurfaceId> {
    let down = Ray { origin: foot + DVec3::Z * STEP_M, direction: -DVec3::Z };
    let below = surfaces.hit(&down, 0.0)?;
    (below.distance_m <= 2.0 * STEP_M).then_some(below.surface)
}

/// Points of a source of an entity, where it is drawn.
fn looked_at(entity: &Entity, billboard: &Billboard) -> impl Iterator<Item = DVec3> {
    let ([left, right], foot) = (billboard.left_right_m, entity.place_of(billboard));
    let Billboard { right_in_world, height_m, .. } = *billboard;
    LOOKED_AT.iter().map(move |(across, up)| {
        let across_m = if *across < 0.0 { -across * left } else { across * right };
        foot + right_in_world * across_m + DVec3::Z * (up * height_m)
    })
}

/// The ray from a point to the viewer, and how long it is, metres; `None` at the viewer's own place or behind it.
fn to_viewer(picture: &Picture, point: DVec3) -> Option<(Ray, f64)> {
    let reach_m = match picture.viewer {
        Viewer::At(eye) => eye.distance(point),
        // Parallel rays begin in the plane through the part's eye.
        Viewer::Along { direction, .. } => {
            let eye = picture.parts.first()?.view.pose.position_in_world;
            (point - eye).dot(direction)
        }
    };
    let direction = -picture.viewer.direction_to(point);
    (reach_m > BESIDE_M && direction != DVec3::ZERO).then_some((Ray { origin: point, direction }, reach_m))
}

/// The buildings that a ray crosses before `reach_m`, each once, with where it is first met, metres. Ground never opens.
fn crossings(surfaces: &Surfaces, ray: &Ray, reach_m: f64) -> Vec<(SurfaceId, f64)> {
    let mut crossed: Vec<(SurfaceId, f64)> = Vec::new();
    // What touches the point counts: an exact shape is met once alone.
    let mut from_m = 0.0;
    for _ in 0..MAX_HITS {
        if crossed.len() == MAX_CROSSED {
            break;
        }
        let Some(hit) = surfaces.hit(ray, from_m).filter(|hit| hit.distance_m < reach_m) else { break };
        let is_known = crossed.iter().any(|(surface, _)| *surface == hit.surface);
        let is_ground = matches!(hit.surface, SurfaceId::Ground(_) | SurfaceId::HeightField(_));
        if !is_known && !is_ground {
            crossed.push((hit.surface, hit.distance_m));
        }
        // Onwards by more than what rounding brings back to the same place.
        from_m = hit.distance_m + BESIDE_M.max(1e-9 * hit.distance_m);
    }
    crossed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Settings, View, ViewLimits};
    use glam::DVec2;
    use videofields_vision::geometry::{GroundPolygon, OrientedBox};
    use videofields_vision::segment::PixelRect;

    const WALL: SurfaceId = SurfaceId::Box(0);

    /// A wall from x = -8 to 8 at y = 0, 4 m high, another at y = 20, and people of 1.8 m.
    fn state(feet: &[DVec3]) -> SceneState {
        let corners = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)].map(DVec2::from);
        let wall = |y: f64| {
            OrientedBox::new(DVec3::new(0.0, y, 2.0), DVec3::new(16.0, 1.0, 4.0), 0.0).expect("a wall")
        };
        let scene = Scene {
            id: "walls".to_owned(),
            name: "Walls".to_owned(),
            materials: Vec::new(),
            surfaces: Surfaces::of_ground_and_boxes(
                vec![GroundPolygon::new(corners.to_vec(), 0.0).expect("ground")],
                vec![wall(0.0), wall(20.0)],
            ),
            sky: crate::scene::Sky::Plain { color_srgb: [0; 3] },
            effects: Default::default(),
            min_entity_size_m: 0.0,
            sequences: Vec::new(),
            cameras: Vec::new(),
            view: None,
            document: Arc::from("{}"),
        };
        let entity = |foot: &DVec3| Entity {
            id: 1,
            foot_covariance_m2: glam::DMat2::IDENTITY,
            velocity: crate::fuse::Velocity::UNKNOWN,
            reach_m: None,
            height_m: 1.8,
            foot_in_world: *foot,
            sources: vec![Billboard {
                camera_idx: 0,
                rect: PixelRect { x: 0, y: 0, width: 1, height: 1 },
                foot_in_world: *foot,
                right_in_world: DVec3::X,
                left_right_m: [-0.3, 0.3],
                height_m: 1.8,
                is_truncated: false,
                owner: 0,
                shown_share: 1.0,
            }],
        };
        SceneState {
            scene: Arc::new(scene),
            instant: Timestamp::from_nanos(0),
            cameras: Vec::new(),
            n_overlapping: 0,
            entities: feet.iter().map(entity).collect(),
            points: Vec::new(),
            hulls: Vec::new(),
            sequences: Vec::new(),
        }
    }

    fn from_eye(eye: DVec3) -> Picture {
        let limits = ViewLimits { max_side_px: 1000, max_pixels: 1_000_000 };
        View::new(eye, DVec3::new(0.0, 30.0, 1.0), 1.0, 64, 36, &limits).expect("a view").into()
    }

    fn found(feet: &[DVec3], picture: &Picture) -> Vec<Occluder> {
        let entities: Vec<(usize, usize)> = (0..feet.len()).map(|idx| (idx, 0)).collect();
        occluders(&state(feet), picture, &entities)
    }

    #[test]
    fn what_stands_between_is_found_and_nothing_else() {
        let eye = from_eye(DVec3::new(0.0, -30.0, 1.7));
        let (before, behind, beside) =
            (DVec3::new(1.0, -5.0, 0.0), DVec3::new(1.0, 6.0, 0.0), DVec3::new(30.0, 6.0, 0.0));
        assert!(found(&[before, beside], &eye).is_empty());
        let hiding = found(&[before, behind, beside], &eye);
        assert_eq!((hiding.len(), hiding[0].surface, hiding[0].hides.as_slice()), (1, WALL, &[1][..]));
        assert!((hiding[0].share - 1.0).abs() < 1e-9 && (hiding[0].distance_m - 30.0).abs() < 1.0);
        // Behind both walls, both hide.
        assert_eq!(found(&[DVec3::new(0.0, 26.0, 0.0)], &eye).len(), 2);
        // Over the wall's edge the head is seen.
        let above = found(&[DVec3::new(0.0, 8.0, 0.0)], &from_eye(DVec3::new(0.0, -30.0, 16.0)));
        assert!(above[0].share > 0.1 && above[0].share < 0.9, "{above:?}");
        // Parallel rays, and an eye within the wall.
        let limits = ViewLimits { max_side_px: 1000, max_pixels: 1_000_000 };
        let ends = (DVec3::new(0.0, -30.0, 1.0), DVec3::new(0.0, 30.0, 1.0));
        let parallel = Picture::orthographic(ends, 40.0, (64, 36), &limits).expect("a picture");
        assert_eq!(found(&[behind], &parallel).len(), 1);
        assert_eq!(found(&[behind], &from_eye(DVec3::new(0.0, 0.0, 1.0))).len(), 1);
        // The viewer at the very point that is looked at, and at the foot.
        for place in [behind, behind + DVec3::Z * (0.55 * 1.8)] {
            assert!(found(&[behind], &from_eye(place)).is_empty());
        }
    }

    #[test]
    fn windows_into_one_picture_agree_on_what_opens_whichever_shows_whom() {
        let state = state(&[DVec3::new(3.0, 6.0, 0.0), DVec3::new(0.0, -10.0, 0.0)]);
        let limits = ViewLimits { max_side_px: 1000, max_pixels: 1_000_000 };
        let eye = DVec3::new(0.0, -30.0, 1.7);
        let corners =
            [DVec3::new(-10.5, 0.0, -1.0), DVec3::new(-0.5, 0.0, -1.0), DVec3::new(-10.5, 0.0, 5.0)];
        let window = Picture::through_window(eye, corners, (100, 60), &limits).unwrap();
        // None of the two is drawn in it.
        let opened = |picture: &Picture| {
            let mut planned = Plan::bare(&Settings::default());
            plan(&state, picture, (EntityStyle::Billboards, None), &mut planned);
            planned.opened.iter().map(|of| (of.surface, of.opacity, of.hides.clone())).collect::<Vec<_>>()
        };
        assert_eq!(opened(&window), [(WALL, OPEN_OPACITY, vec![0])]);
        // A picture that is no window stands for itself.
        assert!(opened(&Picture { is_window: false, ..window }).is_empty());
    }

    /// What one camera takes for somebody's foot, another sees metres beside it.
    #[test]
    fn an_entity_of_several_cameras_is_looked_for_where_it_is_drawn() {
        let eye = from_eye(DVec3::new(0.0, -30.0, 1.7));
        let (before, behind) = (DVec3::new(1.0, -5.0, 0.0), DVec3::new(1.0, 6.0, 0.0));
        let two_sources = |drawn: DVec3, seen: DVec3| {
            let mut state = state(&[drawn]);
            let mut source = state.entities[0].sources[0].clone();
            source.foot_in_world = seen;
            state.entities[0].sources = vec![source.clone(), source];
            state
        };
        assert_eq!(occluders(&two_sources(behind, before), &eye, &[(0, 0)]).len(), 1);
        assert!(occluders(&two_sources(before, behind), &eye, &[(0, 0)]).is_empty());
    }

    #[test]
    fn far_from_the_origin_the_same_is_found() {
        let ray = Ray { origin: DVec3::new(0.0, 6e6, 1.0), direction: -DVec3::Y };
        // From six thousand kilometres away the walls are still crossed once each.
        let crossed = crossings(&state(&[]).scene.surfaces, &ray, 1e7);
        assert_eq!(crossed.len(), 2, "{crossed:?}");
    }

    fn hiding(share: f64) -> Vec<Occluder> {
        vec![Occluder { surface: WALL, share, hides: vec![0], distance_m: 10.0 }]
    }

    fn at(state: &SceneState, millis: i64) -> SceneState {
        SceneState { instant: Timestamp::from_nanos(millis * 1_000_000), ..state.clone() }
    }

    fn advanced(
        session: &mut ViewSession,
        state: &SceneState,
        occluders: &[Occluder],
    ) -> Vec<(SurfaceId, f32)> {
        session.advance(state, occluders);
        session.seen_through().into_iter().map(|opening| (opening.surface, opening.opacity)).collect()
    }

    #[test]
    fn pictures_of_one_instant_agree_in_whatever_order_they_are_drawn() {
        let state = state(&[]);
        let mut sessions = [ViewSession::default(), ViewSession::default()];
        for session in &mut sessions {
            advanced(session, &state, &[]);
        }
        for frame in 1..=20 {
            let now = at(&state, frame * 40);
            let [first, second] = &mut sessions;
            // One tile shows whom the wall hides, the other shows nobody.
            let told_first = advanced(first, &now, &hiding(0.8));
            assert_eq!(advanced(first, &now, &[]), told_first);
            advanced(second, &now, &[]);
            assert_eq!(advanced(second, &now, &hiding(0.8)), told_first, "{frame}");
        }
        assert!((sessions[1].now[0].opacity - OPEN_OPACITY).abs() < 0.05);
    }

    #[test]
    fn what_somebody_stands_on_stays_closed() {
        let roof = DVec3::new(0.0, 0.0, 4.0);
        let eye = from_eye(DVec3::new(0.0, -30.0, 1.7));
        assert_eq!(found(&[DVec3::new(1.0, 6.0, 0.0)], &eye).len(), 1);
        assert!(found(&[DVec3::new(1.0, 6.0, 0.0), roof], &eye).is_empty());
    }

    #[test]
    fn a_session_opens_smoothly_and_a_single_picture_at_once() {
        let state = state(&[]);
        let alone = advanced(&mut ViewSession::default(), &state, &hiding(0.8));
        assert_eq!(alone, [(WALL, OPEN_OPACITY)]);
        let mut session = ViewSession::default();
        assert!(advanced(&mut session, &state, &[]).is_empty());
        let mut before = 1.0;
        for frame in 1..=25 {
            let opened = advanced(&mut session, &at(&state, frame * 40), &hiding(0.8));
            let [(WALL, opacity)] = opened[..] else { panic!("{frame}: {opened:?}") };
            assert!(opacity < before && before - opacity < 0.2, "{frame}: {before} to {opacity}");
            before = opacity;
        }
        assert!((before - OPEN_OPACITY).abs() < 0.01, "{before}");
        // The same instant again, and one a little earlier, change nothing.
        let again = advanced(&mut session, &at(&state, 1000), &hiding(0.8));
        assert_eq!(again, advanced(&mut session, &at(&state, 960), &hiding(0.8)));
        // It closes as smoothly, and is forgotten then.
        let closing: Vec<_> =
            (26..=60).map(|frame| advanced(&mut session, &at(&state, frame * 40), &[]).len()).collect();
        assert_eq!((closing[0], closing[34]), (1, 0), "{closing:?}");
        assert!(session.now.is_empty());
    }

    #[test]
    fn what_hides_a_part_now_and_then_does_not_flicker() {
        let state = state(&[]);
        let mut session = ViewSession::default();
        advanced(&mut session, &state, &[]);
        // Between both thresholds it stays closed, once open it stays open.
        for frame in 1..10 {
            assert!(advanced(&mut session, &at(&state, frame * 40), &hiding(0.4)).is_empty());
        }
        advanced(&mut session, &at(&state, 400), &hiding(0.6));
        for frame in 11..40 {
            advanced(&mut session, &at(&state, frame * 40), &hiding(if frame % 2 == 0 { 0.3 } else { 0.45 }));
        }
        assert!((session.now[0].opacity - OPEN_OPACITY).abs() < 0.01);
    }

    #[test]
    fn a_seek_or_another_scene_begins_anew() {
        let state = state(&[]);
        let mut session = ViewSession::default();
        advanced(&mut session, &at(&state, 0), &[]);
        advanced(&mut session, &at(&state, 40), &hiding(1.0));
        assert_eq!(advanced(&mut session, &at(&state, 60_000), &hiding(1.0)), [(WALL, OPEN_OPACITY)]);
        assert!(advanced(&mut session, &at(&state, 1000), &[]).is_empty(), "back by a minute");
        advanced(&mut session, &at(&state, 1040), &hiding(1.0));
        let other = SceneState { scene: Arc::new(Scene::clone(&state.scene)), ..at(&state, 1080) };
        assert_eq!(advanced(&mut session, &other, &hiding(1.0)), [(WALL, OPEN_OPACITY)]);
    }
}
