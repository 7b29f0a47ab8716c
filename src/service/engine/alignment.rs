//! Tells how far the clocks and the calibrations of a scene's cameras are apart, and what would bring them into step.
//!
//! In: where each camera saw things stand lately, and the scene's calibrations. Out: what every two cameras that see the
//! same place say of their clocks, for each camera the clock's settings that would bring it into step with one of
//! them, and the calibration with which it would see people where all others do. Changes nothing by itself.

use super::EngineError;
use super::shared::Shared;
use glam::DVec2;
use videofields_picture::fuse::{CalibrationOffset, FootSighting, calibration_offsets};
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::timeline::{Alignment, Sighting, align};
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::config::ClockSettings;
use videofields_vision::frame::CameraId;
use videofields_vision::mapping;

/// Furthest that clocks are looked for to be apart, seconds.
const MOST_SECS: f64 = 60.0;

/// Most pairs of cameras that are compared: some seconds of work.
const MAX_PAIRS: usize = 200;

/// Least confidence with which one camera's clock is corrected by another's.
const LEAST_CONFIDENCE: f64 = 0.5;

/// What is known of the clocks of a scene's cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneAlignment {
    /// Each camera of the scene.
    pub cameras: Vec<CameraAlignment>,
    /// What two cameras say that saw something in common.
    pub pairs: Vec<PairAlignment>,
    /// Pairs that were not compared, because there are too many.
    pub n_left_out: usize,
}

/// What is known of a camera's clock.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraAlignment {
    /// The camera.
    pub camera: CameraId,
    /// How sure its place beside the reference is, from 0 to 1: that of the weakest link between them. 1 for the reference;
    /// none where nothing leads from it to this camera.
    pub confidence: Option<f64>,
    /// Seconds by which its clock is ahead of the reference's now.
    pub ahead_secs: Option<f64>,
    /// The settings of its clock that would bring it into step.
    pub clock: Option<ClockSettings>,
    /// Disagreement of its calibration with all others'; none where nobody was seen by it and another.
    pub calibration: Option<CalibrationAlignment>,
}

/// Disagreement of a camera's calibration with all others', and what would mend it.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationAlignment {
    /// Movement and turn with which it would agree.
    pub offset: CalibrationOffset,
    /// The calibration with which it would see people where the others do; none while too few were seen to know.
    pub corrected: Option<CameraDocument>,
}

/// What two cameras say of their clocks.
#[derive(Clone, Debug, PartialEq)]
pub struct PairAlignment {
    /// The one.
    pub first: CameraId,
    /// The other, by whose clock the alignment is told.
    pub second: CameraId,
    /// By how much the second's clock is ahead.
    pub alignment: Alignment,
}

/// A clock against the reference's: ahead by `offset_secs` and running faster by `drift`, around an instant.
#[derive(Clone, Copy, Debug)]
struct Ahead {
    confidence: f64,
    offset_secs: f64,
    drift: f64,
}

impl Shared {
    /// Returns how far the calibration of each of a scene's cameras disagrees with the others', in the scene's order.
    pub(super) fn calibration_offsets_of(&self, scene: &Scene) -> Vec<Option<CalibrationOffset>> {
        let sightings = |member: &SceneCamera| self.sightings_of(member.id.as_str()).unwrap_or_default();
        let seen: Vec<Vec<FootSighting>> = scene.cameras.iter().map(sightings).collect();
        let seen: Vec<&[FootSighting]> = seen.iter().map(Vec::as_slice).collect();
        calibration_offsets(scene, &seen)
    }

    /// Compares the clocks and the calibrations of a scene's cameras. Takes up to some seconds.
    pub(super) fn align_scene(&self, scene: &Scene) -> Result<SceneAlignment, EngineError> {
        let members: Vec<_> = scene
            .cameras
            .iter()
            .filter_map(|member| Some((member, self.sightings_of(member.id.as_str())?)))
            .map(|(member, seen)| (member, places(scene, member, &seen)))
            .collect();
        let n_pairs = members.len() * members.len().saturating_sub(1) / 2;
        let pairs_of = |i: usize| members.iter().skip(i + 1).map(move |second| (i, second));
        let compared = (0..members.len()).flat_map(pairs_of).take(MAX_PAIRS);
        let pairs: Vec<_> = compared
            .filter_map(|(i, (second, seen))| {
                let (first, seen_first) = &members[i];
                let alignment = align(seen_first, seen, MOST_SECS)?;
                Some(PairAlignment { first: first.id.clone(), second: second.id.clone(), alignment })
            })
            .collect();
        let ids: Vec<&CameraId> = members.iter().map(|(member, _)| &member.id).collect();
        // By a common instant, so that what drifts can be added up along a chain.
        let now = members.iter().filter_map(|(_, seen)| seen.last()).map(|seen| seen.at).max();
        let now = now.unwrap_or_else(|| self.clock.now());
        let links = chains(&ids, &pairs, now);
        let offsets = scene.cameras.iter().zip(self.calibration_offsets_of(scene));
        let offsets: Vec<(&SceneCamera, CalibrationOffset)> =
            offsets.filter_map(|(member, offset)| Some((member, offset?))).collect();
        let calibration = |id: &CameraId| {
            let (member, offset) = offsets.iter().find(|(member, _)| member.id == *id)?;
            let corrected = offset.corrected(&member.camera).ok().filter(|_| offset.is_known());
            let corrected = corrected.map(|camera| CameraDocument::from_camera(&camera));
            Some(CalibrationAlignment { offset: *offset, corrected })
        };
        let camera = |(id, ahead): (&&CameraId, Option<Ahead>)| CameraAlignment {
            camera: (*id).clone(),
            confidence: ahead.map(|ahead| ahead.confidence),
            ahead_secs: ahead.map(|ahead| ahead.offset_secs),
            clock: ahead
                .and_then(|ahead| self.corrected_clock(id.as_str(), now, ahead.offset_secs, ahead.drift)),
            calibration: calibration(id),
        };
        Ok(SceneAlignment {
            cameras: ids.iter().zip(links).map(camera).collect(),
            pairs,
            n_left_out: n_pairs.saturating_sub(MAX_PAIRS),
        })
    }
}

/// Where in the world a camera saw things stand, as far as that can be trusted.
fn places(scene: &Scene, member: &SceneCamera, seen: &[FootSighting]) -> Vec<Sighting> {
    let place = |seen: &FootSighting| {
        let [u, v] = seen.foot_in_texture.map(f64::from);
        let found = mapping::place(&member.camera, &scene.surfaces, DVec2::new(u, v))?;
        Some(Sighting { at: seen.at, track: seen.track.into(), place_m: found.truncate() })
    };
    seen.iter().filter_map(place).collect()
}

/// By how much each camera's clock is ahead of the reference's at `now`, along the surest links: the reference is the first
/// camera that any other can be compared with.
fn chains(
    ids: &[&CameraId],
    pairs: &[PairAlignment],
    now: videofields_vision::clock::Timestamp,
) -> Vec<Option<Ahead>> {
    let place = |id: &CameraId| ids.iter().position(|other| *other == id);
    let mut links: Vec<(usize, usize, Ahead)> = pairs
        .iter()
        .filter(|pair| pair.alignment.confidence >= LEAST_CONFIDENCE)
        .filter_map(|pair| {
            let Alignment { offset_secs, drift_ppm, since, confidence, .. } = pair.alignment;
            let drift = drift_ppm * 1e-6;
            let offset_secs = offset_secs + drift * now.nanos_since(since) as f64 * 1e-9;
            Some((place(&pair.first)?, place(&pair.second)?, Ahead { confidence, offset_secs, drift }))
        })
        .collect();
    links.sort_by(|a, b| b.2.confidence.total_cmp(&a.2.confidence));
    let mut found: Vec<Option<Ahead>> = vec![None; ids.len()];
    let Some(reference) = links.iter().map(|(first, second, _)| *first.min(second)).min() else {
        return found;
    };
    found[reference] = Some(Ahead { confidence: 1.0, offset_secs: 0.0, drift: 0.0 });
    // The surest link from what is reached to what is not, again and again.
    while let Some((from, to, link)) =
        links.iter().find_map(|(first, second, link)| match (found[*first], found[*second]) {
            (Some(from), None) => Some((from, *second, *link)),
            (None, Some(from)) => {
                let back = Ahead { offset_secs: -link.offset_secs, drift: -link.drift, ..*link };
                Some((from, *first, back))
            }
            _ => None,
        })
    {
        found[to] = Some(Ahead {
            confidence: from.confidence.min(link.confidence),
            offset_secs: from.offset_secs + link.offset_secs,
            drift: from.drift + link.drift,
        });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::clock::Timestamp;

    #[test]
    fn clocks_are_chained_along_the_surest_links() {
        let ids = ["a", "b", "c", "d"].map(|id| CameraId::new(id).unwrap());
        let pair = |first: usize, second: usize, offset_secs: f64, drift_ppm: f64, confidence: f64| {
            let (since, n_meetings) = (Timestamp::from_nanos(0), 9);
            let alignment = Alignment {
                offset_secs,
                offset_error_secs: 0.01,
                drift_ppm,
                drift_error_ppm: 1.0,
                since,
                confidence,
                n_meetings,
            };
            PairAlignment { first: ids[first].clone(), second: ids[second].clone(), alignment }
        };
        let pairs = [pair(0, 2, 9.0, 0.0, 0.6), pair(0, 1, 2.0, 100.0, 0.9), pair(1, 2, -0.5, 0.0, 0.8)];
        let now = Timestamp::from_nanos(10_000_000_000_000);
        let found = chains(&ids.iter().collect::<Vec<_>>(), &pairs, now);
        let told: Vec<_> =
            found.iter().map(|ahead| ahead.map(|ahead| (ahead.offset_secs, ahead.confidence))).collect();
        assert_eq!(told, [Some((0.0, 1.0)), Some((3.0, 0.9)), Some((2.5, 0.8)), None]);
        let weak = [pair(0, 1, 2.0, 0.0, 0.4)];
        assert!(chains(&ids.iter().collect::<Vec<_>>(), &weak, now).iter().all(Option::is_none));
    }
}
