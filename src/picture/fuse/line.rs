//! Who is who along one line of time: entities keep their ids from instant to instant and from camera to camera.
//!
//! What holds an id together are ties: a camera's track was this entity a moment ago, with odds that other cameras raise
//! or lower. Who is lost is expected for some seconds where their walk leads. One instant's evidence joins what is new;
//! what is known is parted and joined by evidence that lasts.

use super::billboard::brought_near;
use super::estimate::{Estimate, FOLLOWED_GATE, Foot, either};
use super::gone::Gone;
use super::grouping::{BESIDE_COST, Group, Grouping, KnownEstimate, Sign};
use super::walk::Walk;
use super::{Billboard, Entity, Sighting, Velocity};
use crate::occupancy::Expected;
use glam::{DMat2, DVec2};
use std::collections::BTreeMap;
use videofields_vision::clock::Timestamp;

/// Who was not seen for longer is forgotten, seconds.
pub(super) const KEPT_SECS: f64 = 5.0;

/// Most entities that are known, the latest seen.
const MAX_KNOWN: usize = 8192;

/// Log odds that a camera's track is who it was found to be, at first and at most: a single sight beside (at most
/// [`BESIDE_COST`]) parts nothing.
const FIRST_ODDS: f64 = 4.5;
const MAX_ODDS: f64 = 6.0;

/// Log odds a second that a track gains which no other camera can confirm, up to [`ALONE_ODDS`].
const ALONE_GAIN: f64 = 2.0;
const ALONE_ODDS: f64 = 5.0;

/// What one sight may say for or against a tie, log odds a second.
const MAX_EVIDENCE: f64 = 4.0;

/// However long ago the sight before was, it counts as if this long ago, seconds.
const MAX_STEP_SECS: f64 = 0.5;

/// Evidence that two who were known for a second or longer are one, and its most.
const ONE_EVIDENCE: f64 = 2.0;
const MAX_ONE_EVIDENCE: f64 = 4.0;

/// Share of what is newly seen of somebody in what is remembered of how they look and how tall they are.
const NEWS: f64 = 0.1;

/// Height of somebody of whom none is known, metres.
const TYPICAL_M: f64 = 1.7;

/// Somebody whom several cameras see together is shown from so many instants on, if others were known before.
const LEAST_SEEN: u32 = 2;

/// Log odds that somebody who was there an instant ago is there still, over that they are gone and a stranger stands in their place: of who
/// was seen for the first time then, who may be a phantom, and of who was followed for [`SURE_SECS`].
const STAYS_ODDS: [f64; 2] = [0.7, 3.0];
const SURE_SECS: f64 = 2.0;

/// Wider than this, metres, nobody is: vehicles.
const WIDEST_PERSON_M: f64 = 1.5;

/// How far off the feet of people who share a blob may be, standard deviation, metres.
const SHARED_M: f64 = 0.7;

/// A camera's track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Followed {
    /// The camera, by its place in the scene.
    pub(super) member: usize,
    /// The track's number.
    pub(super) number: u64,
    /// When it began: a tracker made anew counts from the start.
    pub(super) since: Timestamp,
}

/// Somebody.
#[derive(Clone, Debug)]
struct Known {
    id: u64,
    born: Timestamp,
    seen_at: Timestamp,
    walk: Walk,
    /// Place apart, as they were seen of late; the place where they were seen last.
    like: Estimate,
    /// Says that several cameras saw them together last.
    is_together: bool,
    /// Instants at which they were seen.
    n_seen: u32,
    /// Says that they were among the entities of an instant: their id stays.
    is_shown: bool,
    /// How far they reached from their foot while no camera had them in one blob with others, metres.
    reach_m: Option<f64>,
}

/// Who a camera's track is.
#[derive(Clone, Copy, Debug)]
struct Tie {
    since: Timestamp,
    id: u64,
    /// Log odds.
    odds: f64,
    tied_at: Timestamp,
    followed_at: Timestamp,
}

/// All that is known at an instant.
#[derive(Clone, Debug, Default)]
pub(super) struct Line {
    instant: Option<Timestamp>,
    /// The latest instant there was: what was seen up to then is not evidence again.
    newest: Option<Timestamp>,
    /// What was seen last and who that is: asked for again, it is the same.
    answered: (Vec<Billboard>, Vec<Entity>),
    /// When it was last asked for: a count that grows.
    pub(super) used: u64,
    /// In growing order of ids.
    known: Vec<Known>,
    /// By camera and track number.
    ties: BTreeMap<(usize, u64), Tie>,
    /// Evidence that two are one, by their ids, the lower first.
    near: BTreeMap<(u64, u64), f64>,
    /// People who were lost from sight and may come back.
    gone: Gone,
}

impl Line {
    /// Returns the instant that was seen last.
    pub(super) const fn instant(&self) -> Option<Timestamp> {
        self.instant
    }

    /// Seconds from here to `instant`; `None` where nothing was seen yet.
    pub(super) fn secs_to(&self, instant: Timestamp) -> Option<f64> {
        self.instant.map(|own| instant.secs_since(own))
    }

    /// Returns who should be where at `instant`, of those whom several cameras saw together last.
    pub(super) fn expected(&self, instant: Timestamp) -> Vec<Expected> {
        let passed_secs = self.secs_to(instant).unwrap_or(0.0);
        let known =
            self.known.iter().filter(|known| known.is_together && Some(known.seen_at) == self.instant);
        let expected = |known: &Known| {
            let mut walk = known.walk;
            walk.pass(passed_secs);
            Expected {
                foot_in_world: walk.foot().at.extend(known.like.ground_m),
                height_m: known.like.height.map_or(TYPICAL_M, |height| height.mean_m),
            }
        };
        known.map(expected).collect()
    }

    /// Goes on to `instant`, where `sightings` are seen and `followed` are all tracks of all cameras, those that are only
    /// predicted too. Who is new gets `next_id`.
    pub(super) fn advance(
        &mut self,
        instant: Timestamp,
        sightings: Vec<Sighting>,
        followed: &[Followed],
        next_id: &mut u64,
    ) -> Vec<Entity> {
        let seen: Vec<Billboard> = sightings.iter().map(|sighting| sighting.billboard.clone()).collect();
        if self.instant == Some(instant) && self.answered.0 == seen {
            return self.answered.1.clone();
        }
        let passed_secs = self.secs_to(instant).unwrap_or(0.0);
        let is_first = self.instant.is_none() || passed_secs.abs() > MAX_STEP_SECS;
        let gained_secs = self.newest.map_or(0.0, |newest| instant.secs_since(newest));
        let is_new = self.newest.is_none_or(|newest| instant > newest);
        let step_secs = gained_secs.clamp(0.0, MAX_STEP_SECS);
        self.instant = Some(instant);
        self.newest = self.newest.max(Some(instant));
        for known in &mut self.known {
            known.walk.pass(passed_secs);
        }
        self.forget(instant);

        let expected: Vec<KnownEstimate> = self.known.iter().map(Known::expected).collect();
        let signs: Vec<Sign> = sightings.iter().map(|sighting| self.sign(sighting)).collect();
        let mut grouping = Grouping::of(&signs, &expected);
        self.join(&mut grouping, instant, step_secs);
        self.part(&signs, &sightings, grouping.groups_mut());
        let names: Vec<usize> =
            grouping.groups().iter().map(|group| group.known.unwrap_or(usize::MAX)).collect();
        let elsewhere = grouping.elsewhere();
        let mut drawn: Vec<Drawn> = Vec::new();
        let mut newcomers: Vec<u64> = Vec::new();
        for (group, name) in names.into_iter().enumerate() {
            let Some(said) = grouping.said(group, None) else { continue };
            let known = match self.known.get_mut(name) {
                Some(known) => {
                    if is_new {
                        known.see(&said, instant);
                    }
                    known
                }
                None => {
                    let known = Known {
                        id: *next_id,
                        born: instant,
                        seen_at: instant,
                        walk: Walk::new(&said.foot),
                        like: said,
                        is_together: false,
                        n_seen: 0,
                        is_shown: false,
                        reach_m: None,
                    };
                    *next_id += 1;
                    self.known.push(known);
                    let last = self.known.len() - 1;
                    &mut self.known[last]
                }
            };
            known.is_together = grouping.is_person(group);
            known.n_seen += u32::from(is_new || passed_secs != 0.0);
            let is_certain = !known.is_together || known.n_seen >= LEAST_SEEN || is_first;
            // Arms that are spread are theirs at once.
            let alone_m = reach_m(&grouping, group, &sightings);
            if is_new {
                known.reach(alone_m);
            }
            if is_certain && !known.is_shown {
                known.is_shown = true;
                newcomers.push(known.id);
            }
            let id = known.id;
            let of = Drawn {
                id,
                group,
                said: Estimate {
                    height: either(said.height, known.like.height, |own, _| own),
                    foot: if self.newest == Some(instant) && !is_wide(&grouping, group, &sightings) {
                        let walk = if is_new { known.walk } else { known.walk.corrected(&said.foot) };
                        known.place(&walk, &said.foot)
                    } else {
                        said.foot
                    },
                    ..said
                },
                velocity: known.walk.velocity(),
                reach_m: either(known.reach_m, alone_m, f64::max),
            };
            drawn.extend(is_certain.then_some(of));
            self.tie(&grouping, (group, id), (&signs, &sightings), (&elsewhere, step_secs));
        }
        self.bring_back(instant, (&newcomers, is_first), &mut drawn);
        self.follow(followed, &sightings, step_secs);
        let entities = draw(drawn, &grouping, &sightings);
        self.answered = (seen, entities.clone());
        entities
    }

    /// Lets go of who was not seen for long, and of tracks that ended.
    fn forget(&mut self, instant: Timestamp) {
        let is_near = |at: Timestamp| instant.secs_since(at).abs() <= KEPT_SECS;
        for known in self.known.iter().filter(|known| !is_near(known.seen_at) && known.is_shown) {
            self.gone.add(instant, (known.id, known.seen_at), known.like);
        }
        self.gone.forget(instant);
        self.known.retain(|known| is_near(known.seen_at));
        if self.known.len() > MAX_KNOWN {
            self.known.sort_by_key(|known| (std::cmp::Reverse(known.seen_at), known.id));
            self.known.truncate(MAX_KNOWN);
            self.known.sort_by_key(|known| known.id);
        }
        let known = &self.known;
        let is_known = |id: u64| known.binary_search_by_key(&id, |known| known.id).is_ok();
        self.ties.retain(|_, tie| is_near(tie.followed_at) && is_known(tie.id));
        self.near.retain(|(a, b), _| is_known(*a) && is_known(*b));
    }

    /// Gives newcomers, of whom nothing was told yet, their old ids if they were gone and are back. The others count as strangers, but for
    /// those of a first instant, who need not have come just then.
    fn bring_back(&mut self, instant: Timestamp, (newcomers, is_first): (&[u64], bool), drawn: &mut [Drawn]) {
        let like = |id: &u64| Some((*id, self.known[self.place(*id)?].like));
        let newcomers: Vec<(u64, Estimate)> = newcomers.iter().filter_map(like).collect();
        let renamed = self.gone.bring_back(instant, &newcomers);
        if !is_first {
            self.gone.count_strangers(instant, newcomers.len() - renamed.len());
        }
        if renamed.is_empty() {
            return;
        }
        let rename = |id: &mut u64| {
            if let Some((_, own)) = renamed.iter().find(|(new, _)| new == id) {
                *id = *own;
            }
        };
        self.known.iter_mut().for_each(|known| rename(&mut known.id));
        self.known.sort_by_key(|known| known.id);
        self.ties.values_mut().for_each(|tie| rename(&mut tie.id));
        drawn.iter_mut().for_each(|of| rename(&mut of.id));
    }

    fn place(&self, id: u64) -> Option<usize> {
        self.known.binary_search_by_key(&id, |known| known.id).ok()
    }

    fn tie_of(&self, track: &Followed) -> Option<&Tie> {
        self.ties.get(&(track.member, track.number)).filter(|tie| tie.since == track.since)
    }

    fn sign(&self, sighting: &Sighting) -> Sign {
        let ties = sighting.tracks.iter().filter_map(|track| self.tie_of(track));
        let ties = ties.filter_map(|tie| Some((self.place(tie.id)?, tie.odds))).collect();
        let Sighting { member, estimate, head, person, .. } = sighting;
        Sign { member: *member, estimate: *estimate, head: *head, ties, person: *person }
    }

    /// Joins groups that are one: at once where one of them is new, by evidence that lasts where both are known.
    fn join(&mut self, grouping: &mut Grouping<'_>, instant: Timestamp, step_secs: f64) {
        let pairs = grouping.near();
        let mut near = std::mem::take(&mut self.near);
        let id = |group: usize| grouping.groups()[group].known.map(|known| self.known[known].id);
        let listed = pairs.iter().filter_map(|(cost, a, b)| Some(((id(*a)?, id(*b)?), *cost)));
        let costs: BTreeMap<(u64, u64), f64> =
            listed.map(|((a, b), cost)| ((a.min(b), a.max(b)), cost)).collect();
        for key in costs.keys() {
            near.entry(*key).or_insert(0.0);
        }
        for (key, evidence) in &mut near {
            let cost = costs.get(key).copied().unwrap_or(MAX_EVIDENCE).clamp(-MAX_EVIDENCE, MAX_EVIDENCE);
            *evidence = cost.mul_add(-step_secs, *evidence).min(MAX_ONE_EVIDENCE);
        }
        near.retain(|key, evidence| *evidence > 0.0 || costs.get(key).is_some_and(|cost| *cost < 0.0));
        let is_ripe = |a: usize, b: usize| {
            let (a, b) = (&self.known[a.min(b)], &self.known[a.max(b)]);
            let age_secs = instant.secs_since(a.born).abs().min(instant.secs_since(b.born).abs());
            near.get(&(a.id, b.id)).is_some_and(|evidence| *evidence >= ONE_EVIDENCE * age_secs.min(1.0))
        };
        let merged = grouping.join(&pairs, is_ripe);
        for (gone, kept) in merged {
            let (gone, kept) = (self.known[gone].id, self.known[kept].id);
            for tie in self.ties.values_mut().filter(|tie| tie.id == gone) {
                tie.id = kept;
            }
            // Its name is given to nobody any more; the next look forgets it.
            if let Some(place) = self.place(gone) {
                self.known[place].seen_at = Timestamp::from_nanos(i64::MIN);
            }
        }
        self.near = near;
    }

    /// Of a known entity whose signs part, the one tied to it for longer keeps the name.
    fn part(&self, signs: &[Sign], sightings: &[Sighting], groups: &mut [Group]) {
        let since = |group: &Group, known: usize| {
            let ties = group
                .signs
                .iter()
                .flat_map(|sign| &sightings[*sign].tracks)
                .filter_map(|track| self.tie_of(track));
            ties.filter(|tie| tie.id == self.known[known].id).map(|tie| tie.tied_at).min()
        };
        for new in (0..groups.len()).filter(|group| groups[*group].known.is_none()).collect::<Vec<_>>() {
            let ties = groups[new].signs.iter().flat_map(|sign| &signs[*sign].ties);
            let Some(known) = ties.map(|(known, _)| *known).min() else { continue };
            let Some(own) = since(&groups[new], known) else { continue };
            let Some(holder) = groups.iter().position(|group| group.known == Some(known)) else { continue };
            let is_older = since(&groups[holder], known).is_none_or(|other| own < other);
            if is_older {
                groups[new].known = Some(known);
                groups[holder].known = None;
            }
        }
    }

    /// Ties the tracks of a group to the entity that it is, and lets the other cameras speak for and against them.
    fn tie(
        &mut self,
        grouping: &Grouping<'_>,
        (group, id): (usize, u64),
        (signs, sightings): (&[Sign], &[Sighting]),
        (elsewhere, step_secs): (&[f64], f64),
    ) {
        let Some(instant) = self.instant else { return };
        for &sign in &grouping.groups()[group].signs {
            let tracks = &sightings[sign].tracks;
            let is_own = |tie: &Tie| tie.id == id;
            let is_alone = tracks.len() == 1;
            let has_own = tracks.iter().any(|track| self.tie_of(track).is_some_and(is_own));
            let has_any = tracks.iter().any(|track| self.tie_of(track).is_some());
            let others = grouping.said(group, Some(signs[sign].member));
            let cost = others.map(|others| {
                let found =
                    signs[sign].estimate.cost_or_by_head(signs[sign].head.as_ref(), &others, FOLLOWED_GATE);
                let cost = found.map_or(BESIDE_COST, |(cost, _)| cost);
                if elsewhere[sign] < cost { cost - elsewhere[sign] } else { cost }
            });
            for (nth, track) in tracks.iter().enumerate() {
                let tie = self.tie_of(track).copied();
                let goes_on = tie.filter(|tie| is_own(tie));
                // Of those who share a blob, each stays who they were.
                let begins = goes_on.is_none() && (is_alone || (!has_own && !has_any && nth == 0));
                let fresh =
                    Tie { since: track.since, id, odds: FIRST_ODDS, tied_at: instant, followed_at: instant };
                let Some(mut tie) = goes_on.or(begins.then_some(fresh)) else { continue };
                tie.odds = match cost {
                    Some(cost) => cost.clamp(-MAX_EVIDENCE, MAX_EVIDENCE).mul_add(-step_secs, tie.odds),
                    None if tie.odds < ALONE_ODDS => {
                        (ALONE_GAIN.mul_add(step_secs, tie.odds)).min(ALONE_ODDS)
                    }
                    None => tie.odds,
                }
                .clamp(-MAX_ODDS, MAX_ODDS);
                self.ties.insert((track.member, track.number), tie);
            }
        }
    }

    /// Keeps who is followed but not seen: predicted, or hidden in another's blob, near which they then are.
    fn follow(&mut self, followed: &[Followed], sightings: &[Sighting], step_secs: f64) {
        let Some(instant) = self.instant else { return };
        let mut kept = Vec::new();
        for track in followed {
            if let Some(tie) =
                self.ties.get_mut(&(track.member, track.number)).filter(|tie| tie.since == track.since)
            {
                tie.followed_at = instant;
                kept.push(tie.id);
            }
        }
        let shared = sightings.iter().filter(|sighting| sighting.tracks.len() > 1 && step_secs > 0.0);
        let hidden = shared
            .flat_map(|sighting| sighting.tracks.iter().map(move |track| (track, sighting.estimate.foot)));
        for (track, foot) in hidden {
            let Some(place) = self.tie_of(track).and_then(|tie| self.place(tie.id)) else { continue };
            let known = &mut self.known[place];
            if known.seen_at != instant {
                let spread = DMat2::from_diagonal(DVec2::splat(SHARED_M.powi(2)));
                known.walk.correct(&Foot::new(foot.at, foot.covariance + spread));
            }
        }
        for place in kept.into_iter().filter_map(|id| self.place(id)).collect::<Vec<_>>() {
            self.known[place].seen_at = instant;
        }
    }
}

impl Known {
    fn expected(&self) -> KnownEstimate {
        let share = self.followed_share();
        KnownEstimate {
            estimate: Estimate { foot: self.walk.foot(), ..self.like },
            stays_odds: (STAYS_ODDS[1] - STAYS_ODDS[0]).mul_add(share, STAYS_ODDS[0]),
        }
    }

    fn see(&mut self, said: &Estimate, instant: Timestamp) {
        self.walk.correct(&said.foot);
        self.seen_at = instant;
        self.like.foot = said.foot;
        self.like.ground_m = said.ground_m;
        self.like.height = either(self.like.height, said.height, |own, seen| own.towards(seen, NEWS));
        self.like.look = either(self.like.look, said.look, |own, seen| own.blended(&seen, NEWS));
    }

    /// Returns where they stand, by where they are seen now and, the longer they were followed, by their `walk` that took this in: at first
    /// nothing is known of how fast they go.
    fn place(&self, walk: &Walk, seen: &Foot) -> Foot {
        let to_walk = walk.foot().at - seen.at;
        Foot { at: seen.at + to_walk * self.followed_share(), ..*seen }
    }

    /// Returns the share of [`SURE_SECS`] for which they were followed, 1 at most.
    fn followed_share(&self) -> f64 {
        (self.seen_at.secs_since(self.born).abs() / SURE_SECS).min(1.0)
    }

    fn reach(&mut self, seen_m: Option<f64>) {
        self.reach_m = either(self.reach_m, seen_m, |own, seen| NEWS.mul_add(seen - own, own));
    }
}

/// Somebody who is seen: a group of signs, and what is known of them.
struct Drawn {
    id: u64,
    group: usize,
    said: Estimate,
    velocity: Velocity,
    reach_m: Option<f64>,
}

/// Returns true if a camera shows a group wider than people are: what they see of a vehicle, which is faster than people too, says little of
/// its middle.
fn is_wide(grouping: &Grouping<'_>, group: usize, sightings: &[Sighting]) -> bool {
    let width_m = |sign: &usize| {
        let [left, right] = sightings[*sign].billboard.left_right_m;
        right - left
    };
    grouping.groups()[group].signs.iter().map(width_m).any(|width_m| width_m > WIDEST_PERSON_M)
}

/// How far those signs of a group reach from their feet that show nobody else and are whole.
fn reach_m(grouping: &Grouping<'_>, group: usize, sightings: &[Sighting]) -> Option<f64> {
    let is_alone = |sign: &&usize| {
        let Sighting { tracks, billboard, .. } = &sightings[**sign];
        tracks.len() == 1 && !billboard.is_truncated && !grouping.is_by_head(**sign)
    };
    let reach =
        |sign: &usize| sightings[*sign].billboard.left_right_m.map(f64::abs).into_iter().fold(0.0, f64::max);
    grouping.groups()[group].signs.iter().filter(is_alone).map(reach).reduce(f64::max)
}

/// The entities that are seen, in growing order of ids.
fn draw(mut drawn: Vec<Drawn>, grouping: &Grouping<'_>, sightings: &[Sighting]) -> Vec<Entity> {
    drawn.sort_by_key(|of| of.id);
    let entity = |Drawn { id, group, said, velocity, reach_m }: Drawn| {
        let source = |sign: &usize| {
            let Sighting { billboard, head, .. } = &sightings[*sign];
            match head.filter(|_| grouping.is_by_head(*sign)) {
                Some(head) => brought_near(billboard, &head, said.foot.at),
                None => billboard.clone(),
            }
        };
        let mut sources: Vec<Billboard> = grouping.groups()[group].signs.iter().map(source).collect();
        sources.sort_by_key(|billboard| billboard.camera_idx);
        let tallest = || sources.iter().map(|source| source.height_m).fold(0.0, f64::max);
        let height_m = said.height.map_or_else(tallest, |height| height.mean_m);
        let foot_covariance_m2 = said.foot.covariance;
        let foot_in_world = said.foot_in_world();
        Entity { id, foot_in_world, foot_covariance_m2, velocity, reach_m, height_m, sources }
    };
    drawn.into_iter().map(entity).collect()
}
