//! Which waiting requests mean the picture in hand: they are answered with it, and drawn no more.

use crate::engine::handle::At;
use crate::engine::picture::Subject;
use crate::engine::queue::PlaceId;
use crate::engine::resolve::Seen;
use crate::engine::shared::Shared;
use crate::engine::view::ViewRequest;
use std::sync::Arc;

/// What of `waiting` means `subject` too, which `request` does. `known` is what was seen for `request` just now;
/// without it everything is looked at anew.
pub(super) fn same_as(
    shared: &Shared,
    (request, subject): (&ViewRequest, &Subject),
    known: Option<&Seen>,
    mut waiting: Vec<(PlaceId, ViewRequest)>,
) -> Vec<PlaceId> {
    let scene = &subject.scene;
    let mut live = known.filter(|_| request.at == At::Live).map(|_| Some(subject.instant));
    // Of an instant asked for as live another may be seen than of one asked for by its time: what lags is shown.
    let mut seen: [Option<Option<Seen>>; 2] = [None, None];
    let kind = |at: At| usize::from(at == At::Live);
    if let Some(known) = known {
        seen[kind(request.at)] = Some(Some(known.clone()));
    }
    let mut is_same = |other: &ViewRequest| {
        // Another caller's scene may have other cameras, or the scene was changed since: equal words mean another picture.
        let own = shared.scene_within(&other.scene, &other.scope);
        if !own.is_ok_and(|own| Arc::ptr_eq(&own, scene)) {
            return false;
        }
        let instant = match other.at {
            At::Live => *live.get_or_insert_with(|| shared.live_instant(scene).ok()),
            At::Time(instant) => Some(instant),
        };
        if instant != Some(subject.instant) {
            return false;
        }
        let at = (subject.instant, other.horizon.as_ref());
        // Two frames may have one instant and have been chosen at two moments: each is looked at by itself.
        let own = (other.horizon != request.horizon).then(|| shared.seen_at(scene, other.at, at).ok());
        let seen = match &own {
            Some(own) => own,
            None => seen[kind(other.at)].get_or_insert_with(|| shared.seen_at(scene, other.at, at).ok()),
        };
        let Some(seen) = seen else { return false };
        shared.subject(other, scene, subject.instant, seen).is_ok_and(|other| other == *subject)
    };
    waiting.retain(|(_, other)| may_be_same(request, other) && is_same(other));
    waiting.into_iter().map(|(place, _)| place).collect()
}

/// Whether two requests may mean one picture, by what can be told without a look at any camera.
fn may_be_same(a: &ViewRequest, b: &ViewRequest) -> bool {
    let drawn = |of: &ViewRequest| (of.width_px, of.height_px, of.style, of.see_through, of.colors);
    a.scene == b.scene
        && a.session == b.session
        && drawn(a) == drawn(b)
        && a.effects == b.effects
        && a.blur_people == b.blur_people
}
