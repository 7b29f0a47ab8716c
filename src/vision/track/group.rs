//! People who touch are one blob: each member keeps its id and size and moves on within the blob.
//!
//! The blob's edges are those of its outermost members, so they tell where these are; who stands between them goes
//! on by prediction. That is what tells people who pass each other from people who meet and turn back.

use super::extent::Extent;
use super::motion::Motion;
use super::sighting::{self, Cut, Place};
use super::target::Target;

/// How far an outermost member's edge may lie from the blob's to be the same edge, share of its length.
const EDGE_REACH: f64 = 0.5;

/// How many times a member's length a blob must have for its two edges not to be that member's.
const LONGER: f64 = 1.15;

/// How much less a shared blob's edge says than a blob of one's own: times the variance.
const EDGE_VARIANCE: f64 = 2.0;

/// How many times over its members may fill a blob; where they would fill it more, one of them is hidden or gone.
const FILL: f64 = 1.5;

/// Share of a member that another must cover to hide it.
const HIDDEN: f64 = 0.85;

/// Moves the `members` (indices into `targets`, at least two) of a group whose blob is `seen`, `dt_secs` after the
/// frame before.
pub(super) fn see(
    targets: &mut [Target],
    members: &[usize],
    seen: &Extent,
    cut: &Cut,
    motion: &mut Motion,
    dt_secs: f64,
) {
    for axis in [0, 1] {
        let (lowest, highest) = outermost(targets, members, seen, axis);
        for &member in members {
            let role = Role { is_lowest: lowest == member, is_highest: highest == member };
            if let Some(place) = place(&targets[member], role, seen, cut, axis) {
                targets[member].correct(motion, axis, place, dt_secs);
            }
        }
    }
}

/// The members that make up the lower and the upper edge of `seen` along `axis`.
///
/// One member cannot make up both where the blob is clearly longer than it: then another has the edge that lies
/// farther from its own.
fn outermost(targets: &[Target], members: &[usize], seen: &Extent, axis: usize) -> (usize, usize) {
    let low = |index: usize| targets[index].extent().low[axis];
    let high = |index: usize| targets[index].extent().high[axis];
    let lowest_but = |but: Option<usize>| {
        let rest = members.iter().copied().filter(|index| Some(*index) != but);
        rest.min_by(|a, b| low(*a).total_cmp(&low(*b))).unwrap_or(members[0])
    };
    let highest_but = |but: Option<usize>| {
        let rest = members.iter().copied().filter(|index| Some(*index) != but);
        rest.max_by(|a, b| high(*a).total_cmp(&high(*b))).unwrap_or(members[0])
    };
    let (lowest, highest) = (lowest_but(None), highest_but(None));
    if lowest != highest || seen.size()[axis] <= LONGER * targets[lowest].size()[axis] {
        return (lowest, highest);
    }
    let off = |(lowest, highest): (usize, usize)| {
        (low(lowest) - seen.low[axis]).abs() + (high(highest) - seen.high[axis]).abs()
    };
    let choices = [(lowest, highest_but(Some(lowest))), (lowest_but(Some(highest)), highest)];
    if off(choices[0]) <= off(choices[1]) { choices[0] } else { choices[1] }
}

/// Which edges of its group a member makes up.
#[derive(Clone, Copy)]
struct Role {
    is_lowest: bool,
    is_highest: bool,
}

/// Where `seen` puts a member along `axis`; `None` where it says nothing.
fn place(member: &Target, role: Role, seen: &Extent, cut: &Cut, axis: usize) -> Option<Place> {
    let (extent, size) = (member.extent(), member.size());
    let (len, expected) = (size[axis], member.center()[axis]);
    let (low, high) = (seen.low[axis], seen.high[axis]);
    let variance_px2 = EDGE_VARIANCE * sighting::variance_px2(size);
    let at = |position_px: f64| Some(Place { position_px, variance_px2 });
    if high - low <= len {
        return sighting::place(seen, cut, axis, size, expected);
    }
    let is_near = |edge: f64, other: f64| (edge - other).abs() <= EDGE_REACH * len;
    let is_low = role.is_lowest && !cut.low[axis] && is_near(extent.low[axis], low);
    let is_high = role.is_highest && !cut.high[axis] && is_near(extent.high[axis], high);
    match (is_low, is_high) {
        (true, true) => at(f64::midpoint(low, high)),
        (true, false) => at(low + len / 2.0),
        (false, true) => at(high - len / 2.0),
        (false, false) => {
            let least = if cut.low[axis] { f64::NEG_INFINITY } else { low + len / 2.0 };
            let most = if cut.high[axis] { f64::INFINITY } else { high - len / 2.0 };
            let inside = expected.clamp(least, most);
            if inside == expected { None } else { at(inside) }
        }
    }
}

/// Whether `member` shows in the group's blob `seen`: the blob has room for all `members`, and no other of them
/// covers this one.
pub(super) fn is_visible(targets: &[Target], members: &[usize], member: usize, seen: &Extent) -> bool {
    let within = |index: &usize| targets[*index].extent().intersection(seen).area();
    let has_room = members.iter().map(within).sum::<f64>() <= FILL * seen.area();
    let own = targets[member].extent();
    let mut others = members.iter().filter(|other| **other != member);
    has_room && others.all(|other| own.share_within(&targets[*other].extent()) < HIDDEN)
}
