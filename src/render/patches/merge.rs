//! Patches that are seen alike made one, so that what is cut finely along the borders of what cameras see is few triangles:
//! every edge within a picture costs the pixels on it twice.

use super::cut::{Cell, Plane};
use super::{Draft, Form, Sight, SightAndShadows};
use crate::patches::sight::Seen;

/// Takes back, the latest first, the splits that told nothing.
pub(super) fn joined(drafts: Vec<Draft>, splits: Vec<(usize, usize, Draft)>) -> Vec<Draft> {
    let mut kept: Vec<Option<Draft>> = drafts.into_iter().map(Some).collect();
    let mut is_split = vec![false; kept.len()];
    for (first, second, mut whole) in splits.into_iter().rev() {
        let halves = kept[first].as_ref().zip(kept[second].as_ref());
        let seen = halves.and_then(|(a, b)| alike(a, b)).filter(|_| !is_split[first] && !is_split[second]);
        match seen {
            Some(seen) => {
                whole.seen = seen;
                kept[first] = Some(whole);
                kept[second] = None;
            }
            None => is_split[first] = true,
        }
    }
    kept.into_iter().flatten().collect()
}

fn is_empty(draft: &Draft) -> bool {
    matches!(&draft.form, Form::Level(.., triangles) if triangles.is_empty())
}

/// How both halves of a draft are seen, where that is the same or one of them has nothing to be seen.
fn alike(a: &Draft, b: &Draft) -> Option<Vec<SightAndShadows>> {
    if is_empty(a) || is_empty(b) {
        return Some(if is_empty(a) { b.seen.clone() } else { a.seen.clone() });
    }
    let both = |((a, shadows), (b, _)): (&SightAndShadows, &SightAndShadows)| {
        let is_same =
            (a.camera, a.seen.sides, a.seen.is_tested) == (b.camera, b.seen.sides, b.seen.is_tested);
        let seen = Seen {
            is_full: a.seen.is_full && b.seen.is_full,
            is_crossed: a.seen.is_crossed || b.seen.is_crossed,
            ..a.seen
        };
        is_same.then(|| (Sight { seen, ..*a }, shadows.clone()))
    };
    (a.seen.len() == b.seen.len()).then(|| a.seen.iter().zip(&b.seen).map(both).collect()).flatten()
}

/// Makes one of level patches side by side that are seen alike and are a rectangle together, until there are none.
///
/// **Cost** n log n a round; each round but the last makes fewer of them.
pub(super) fn grown(drafts: Vec<Draft>, planes: &[Plane]) -> Vec<Draft> {
    let (mut level, mut others): (Vec<Draft>, Vec<Draft>) = drafts
        .into_iter()
        .filter(|draft| !is_empty(draft))
        .partition(|draft| matches!(draft.form, Form::Level(..)));
    loop {
        let n_before = level.len();
        for axis in [0, 1] {
            level = grown_along(axis, level, planes);
        }
        if level.len() == n_before {
            break;
        }
    }
    others.extend(level);
    others
}

/// A draft's face, cell and cameras with how they see it, ordered so that neighbours along `axis` follow one another.
fn order(axis: usize, draft: &Draft) -> Option<(usize, Vec<Look>, [u32; 3])> {
    let Form::Level(place, cell, _) = &draft.form else { return None };
    let across = 1 - axis;
    Some((
        *place,
        draft.seen.iter().map(look).collect(),
        [cell.low[across], cell.high[across], cell.low[axis]],
    ))
}

/// What two patches that are made one must have in common of each camera; beyond what makes them alike, whether others may
/// be left out since this one is sure to show.
type Look = (u16, [bool; 2], bool, bool);

fn look((sight, _): &SightAndShadows) -> Look {
    (sight.camera, sight.seen.sides, sight.seen.is_tested, sight.seen.is_full)
}

fn grown_along(axis: usize, mut drafts: Vec<Draft>, planes: &[Plane]) -> Vec<Draft> {
    drafts.sort_by_cached_key(|draft| order(axis, draft));
    let mut grown: Vec<Draft> = Vec::with_capacity(drafts.len());
    for draft in drafts {
        match grown.last().and_then(|last| one_of(axis, last, &draft, planes)) {
            Some(one) => *grown.last_mut().expect("it was looked at") = one,
            None => grown.push(draft),
        }
    }
    grown
}

/// Both as one, where the second begins along `axis` where the first ends.
fn one_of(axis: usize, first: &Draft, second: &Draft, planes: &[Plane]) -> Option<Draft> {
    let (Form::Level(place, a, of_a), Form::Level(other, b, of_b)) = (&first.form, &second.form) else {
        return None;
    };
    let across = 1 - axis;
    let is_beside = a.high[axis] == b.low[axis]
        && (a.low[across], a.high[across]) == (b.low[across], b.high[across])
        && (place, first.surface) == (other, second.surface);
    if !is_beside || !first.seen.iter().map(look).eq(second.seen.iter().map(look)) {
        return None;
    }
    let seen = alike(first, second)?;
    let cell = Cell { low: a.low, high: b.high };
    let mut triangles: Vec<u32> = of_a.iter().chain(of_b).copied().collect();
    triangles.sort_unstable();
    triangles.dedup();
    let corners = cell.corners_in_world(&planes[*place]).to_vec();
    let one = Draft::new(first.surface, corners, Form::Level(*place, cell, triangles));
    Some(Draft { seen, ..one })
}
