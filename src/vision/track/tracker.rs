//! One camera's tracker: the order in which blobs are dealt out.
//!
//! Confirmed targets choose first, one blob each. Those left without one join the group of the blob that covers
//! them. Blobs still free are fragments of a target, then sightings of tentative targets, then births.

use super::Track;
use super::assign::{Pair, assign};
use super::extent::Extent;
use super::group;
use super::motion::Motion;
use super::sighting::{self, Cut};
use super::target::Target;
use crate::clock::Timestamp;
use crate::config::TrackSettings;
use crate::segment::Blob;

/// Most things that are followed at once, tentative ones included; what else appears is dropped and counted.
pub const MAX_TRACKS: usize = 512;

/// Most blobs of one frame that are looked at, the largest first.
const MAX_BLOBS: usize = 1024;

/// Greatest squared distance from the prediction over its variance: 99.9 % of chi-squared with 2 degrees of freedom.
const GATE: f64 = 13.8;

/// Intersection over union at which a blob may be the target whatever its distance.
const OVERLAP: f64 = 0.3;

/// Cost of a target without a blob: a pair costs its squared distance over [`GATE`] and one less its overlap.
const ALONE: f64 = 1.9;

/// Share of a target that a blob must cover for the target to be in its group.
const GROUP_COVER: f64 = 0.5;

/// Share of a fragment that must lie within its target.
const FRAGMENT_COVER: f64 = 0.7;

/// How much larger than the target its fragments together may be, each way.
const FRAGMENT_FIT: f64 = 1.25;

/// Frames that a track lives on unseen, where that is longer than its setting.
const MISSED_FRAMES: f64 = 2.5;

/// Longest time from a frame to the next that is a rate and no pause, seconds.
const GREATEST_INTERVAL_SECS: f64 = 12.0;

/// Links one camera's blobs over time.
#[derive(Debug)]
pub struct Tracker {
    settings: TrackSettings,
    motion: Motion,
    targets: Vec<Target>,
    next_id: u64,
    /// Time and size of the frame before.
    before: Option<(Timestamp, (u32, u32))>,
    /// Time from the frame before the last to the last, seconds; 0 where that was no time between frames.
    interval_secs: f64,
    n_dropped: u64,
}

/// The blobs of one frame, and who has them.
struct FrameBlobs {
    /// Columns and rows of the picture.
    size_px: (u32, u32),
    /// Their indices in the frame.
    idx: Vec<usize>,
    extents: Vec<Extent>,
    cuts: Vec<Cut>,
    is_taken: Vec<bool>,
}

/// What of a frame shows one target.
struct Claim {
    target: usize,
    /// The largest of its blobs.
    blob: usize,
    /// Around all of them.
    seen: Extent,
}

impl Tracker {
    /// A tracker that has seen nothing.
    #[must_use]
    pub fn new(settings: &TrackSettings) -> Self {
        Self {
            settings: settings.clone(),
            motion: Motion::new(),
            targets: Vec::new(),
            next_id: 1,
            before: None,
            interval_secs: 0.0,
            n_dropped: 0,
        }
    }

    /// Ends all tracks. Their ids are not given again.
    pub fn reset(&mut self) {
        self.targets.clear();
        self.before = None;
    }

    /// Things that were not followed since [`MAX_TRACKS`] others were.
    #[must_use]
    pub const fn n_dropped(&self) -> u64 {
        self.n_dropped
    }

    /// Takes the next frame's blobs, of a picture of `size_px` columns and rows; returns the confirmed tracks in
    /// growing order of their ids.
    ///
    /// Time that stands still or steps back moves nothing. All tracks end where it leaps by more than
    /// `max_miss_secs` either way, and where the picture's size changes. Where frames come so seldom that this would be at every frame,
    /// down to one in ten seconds, `max_miss_secs` is two and a half times from one to the next.
    pub fn update(&mut self, time: Timestamp, size_px: (u32, u32), blobs: &[Blob]) -> Vec<Track> {
        let passed_secs = self.before.map_or(0.0, |(before, _)| time.secs_since(before));
        let is_other_size = self.before.is_some_and(|(_, before)| before != size_px);
        let max_miss_secs = self.max_miss_secs(passed_secs);
        if is_other_size || passed_secs.abs() > max_miss_secs {
            self.reset();
        }
        self.before = Some((time, size_px));
        let dt_secs = passed_secs.max(0.0);
        for target in &mut self.targets {
            target.predict(&mut self.motion, dt_secs);
        }
        let mut frame = FrameBlobs::new(blobs, size_px);
        self.follow(&mut frame, time, dt_secs);
        self.try_out(&mut frame, time, dt_secs);
        self.bear(&mut frame, time);
        self.bury(size_px, max_miss_secs);
        let mut tracks = Vec::with_capacity(self.targets.len());
        for target in &mut self.targets {
            target.settle(time, dt_secs);
            if target.id.is_none() && target.blob.is_some() && target.age_secs >= self.settings.confirm_secs {
                target.id = Some(self.next_id);
                self.next_id += 1;
            }
            tracks.extend(target.track(size_px));
        }
        tracks.sort_unstable_by_key(|track| track.id);
        tracks
    }

    /// Returns for how long a track lives on unseen, at a frame `passed_secs` after the one before it: the setting, or more where frames
    /// are seldom. Of two intervals in a row the shorter counts, so that a pause is no rate.
    fn max_miss_secs(&mut self, passed_secs: f64) -> f64 {
        let before_secs = self.interval_secs;
        let is_interval = passed_secs > 0.0 && passed_secs <= GREATEST_INTERVAL_SECS;
        self.interval_secs = if is_interval { passed_secs } else { 0.0 };
        let shorter_secs =
            if before_secs > 0.0 { before_secs.min(self.interval_secs) } else { self.interval_secs };
        self.settings.max_miss_secs.max(MISSED_FRAMES * shorter_secs)
    }

    /// Deals blobs out to confirmed targets: one each, then groups, then fragments.
    fn follow(&mut self, frame: &mut FrameBlobs, time: Timestamp, dt_secs: f64) {
        let confirmed: Vec<usize> =
            (0..self.targets.len()).filter(|index| self.targets[*index].id.is_some()).collect();
        let mut claims = frame.claims(&self.targets, &confirmed);
        // A blob and who joins the one that has it.
        let mut joined: Vec<(usize, usize)> = Vec::new();
        for &index in &confirmed {
            if claims.iter().all(|claim| claim.target != index)
                && let Some(blob) = frame.covering(&self.targets[index].extent())
            {
                joined.push((blob, index));
            }
        }
        joined.sort_unstable();
        for claim in &mut claims {
            if joined.iter().any(|(blob, _)| *blob == claim.blob) {
                frame.hush(&self.targets[claim.target]);
            } else {
                frame.gather(claim, &self.targets[claim.target]);
            }
        }
        for (_, index) in &joined {
            frame.hush(&self.targets[*index]);
        }
        let mut members = Vec::new();
        for claim in &claims {
            let cut = Cut::of(&claim.seen, frame.size_px);
            members.clear();
            members.push(claim.target);
            members.extend(joined.iter().filter(|(blob, _)| *blob == claim.blob).map(|(_, index)| index));
            self.targets[claim.target].note_seen(frame.idx[claim.blob], time);
            if members.len() == 1 {
                self.targets[claim.target].see(&mut self.motion, &claim.seen, &cut, dt_secs);
                continue;
            }
            group::see(&mut self.targets, &members, &claim.seen, &cut, &mut self.motion, dt_secs);
            for &member in &members {
                let is_visible = group::is_visible(&self.targets, &members, member, &claim.seen);
                let target = &mut self.targets[member];
                (target.is_in_group, target.blob) = (true, Some(frame.idx[claim.blob]));
                if is_visible {
                    target.note_seen(frame.idx[claim.blob], time);
                }
            }
        }
    }

    /// Deals what is left out to tentative targets.
    fn try_out(&mut self, frame: &mut FrameBlobs, time: Timestamp, dt_secs: f64) {
        let tentative: Vec<usize> =
            (0..self.targets.len()).filter(|index| self.targets[*index].id.is_none()).collect();
        for mut claim in frame.claims(&self.targets, &tentative) {
            let target = &mut self.targets[claim.target];
            frame.gather(&mut claim, target);
            target.note_seen(frame.idx[claim.blob], time);
            target.see(&mut self.motion, &claim.seen, &Cut::of(&claim.seen, frame.size_px), dt_secs);
        }
    }

    /// Begins a target for every blob that nobody has.
    fn bear(&mut self, frame: &mut FrameBlobs, time: Timestamp) {
        for blob in 0..frame.idx.len() {
            if frame.is_taken[blob] {
                continue;
            }
            if self.targets.len() < MAX_TRACKS {
                self.targets.push(Target::new(&frame.extents[blob], frame.idx[blob], time));
            } else {
                self.n_dropped += 1;
            }
        }
    }

    /// Ends what was missed for too long or left the picture.
    fn bury(&mut self, size_px: (u32, u32), max_miss_secs: f64) {
        let picture = Extent { low: [0.0; 2], high: [f64::from(size_px.0), f64::from(size_px.1)] };
        let confirm_secs = self.settings.confirm_secs;
        self.targets.retain(|target| {
            let max_secs = if target.id.is_some() { max_miss_secs } else { confirm_secs.min(max_miss_secs) };
            let shown = target.extent().share_within(&picture);
            let has_left = shown <= 0.0 || (shown < 0.5 && target.blob.is_none());
            target.missed_secs <= max_secs && !has_left
        });
    }
}

impl FrameBlobs {
    fn new(blobs: &[Blob], size_px: (u32, u32)) -> Self {
        let mut idx: Vec<usize> =
            (0..blobs.len()).filter(|i| blobs[*i].rect.width > 0 && blobs[*i].rect.height > 0).collect();
        if idx.len() > MAX_BLOBS {
            idx.sort_by_key(|i| std::cmp::Reverse(blobs[*i].area_px));
            idx.truncate(MAX_BLOBS);
            idx.sort_unstable();
        }
        let extents: Vec<Extent> = idx.iter().map(|i| Extent::of(blobs[*i].rect)).collect();
        let cuts = extents.iter().map(|extent| Cut::of(extent, size_px)).collect();
        Self { size_px, is_taken: vec![false; idx.len()], idx, extents, cuts }
    }

    /// One free blob for each of the `chosen` targets that finds one.
    fn claims(&mut self, targets: &[Target], chosen: &[usize]) -> Vec<Claim> {
        let mut pairs = Vec::new();
        for (i, &index) in chosen.iter().enumerate() {
            for blob in (0..self.idx.len()).filter(|blob| !self.is_taken[*blob]) {
                if let Some(cost) = cost(&targets[index], &self.extents[blob], &self.cuts[blob]) {
                    pairs.push(Pair { target: i, blob, cost });
                }
            }
        }
        let assigned = assign(&pairs, chosen.len(), self.idx.len(), ALONE);
        let mut claims = Vec::new();
        for (&target, blob) in chosen.iter().zip(assigned) {
            if let Some(blob) = blob {
                self.is_taken[blob] = true;
                claims.push(Claim { target, blob, seen: self.extents[blob] });
            }
        }
        claims
    }

    /// The taken blob that covers most of `extent`, if it covers enough.
    fn covering(&self, extent: &Extent) -> Option<usize> {
        let shares = self.extents.iter().map(|seen| extent.share_within(seen)).enumerate();
        shares
            .filter(|(blob, share)| self.is_taken[*blob] && *share >= GROUP_COVER)
            .max_by(|(_, a), (_, b)| a.total_cmp(b))
            .map(|(blob, _)| blob)
    }

    /// Adds the free blobs that are fragments of `target` to what it claims.
    fn gather(&mut self, claim: &mut Claim, target: &Target) {
        for blob in 0..self.idx.len() {
            if !self.is_fragment(blob, target) {
                continue;
            }
            let hull = claim.seen.hull(&self.extents[blob]);
            if (0..2).all(|axis| hull.size()[axis] <= FRAGMENT_FIT * target.size()[axis]) {
                if self.extents[blob].area() > self.extents[claim.blob].area() {
                    claim.blob = blob;
                }
                claim.seen = hull;
                self.is_taken[blob] = true;
            }
        }
    }

    /// Takes the free blobs within `target`, a member of a group, so that they begin nothing.
    fn hush(&mut self, target: &Target) {
        for blob in 0..self.idx.len() {
            self.is_taken[blob] |= self.is_fragment(blob, target);
        }
    }

    /// Whether `blob` is free and lies within `target`.
    fn is_fragment(&self, blob: usize, target: &Target) -> bool {
        !self.is_taken[blob] && self.extents[blob].share_within(&target.extent()) >= FRAGMENT_COVER
    }
}

/// What it costs that `seen` is `target`; `None` where it cannot be.
fn cost(target: &Target, seen: &Extent, cut: &Cut) -> Option<f64> {
    let (center, size) = (target.center(), target.size());
    let mut distance = 0.0;
    for axis in [0, 1] {
        if let Some(place) = sighting::place(seen, cut, axis, size, center[axis]) {
            let variance = target.variance_px2(axis) + place.variance_px2;
            distance += (place.position_px - center[axis]).powi(2) / variance;
        }
    }
    let iou = target.extent().iou(seen);
    // Who stops dead or turns on the spot leaves the gate, but hardly its own box.
    (distance <= GATE || iou >= OVERLAP).then(|| (distance / GATE).min(1.0) + 1.0 - iou)
}
