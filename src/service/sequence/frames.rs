//! Which frames a sequence has, when they are, and which of them answers for an instant.

use super::SequenceError;
use super::manifest::{Files, Manifest, Times};
use std::path::{Path, PathBuf};
use videofields_recording::ingest::{IngestError, MediaRoots};
use videofields_recording::timeline::{Extent, REACH_NANOS};
use videofields_vision::clock::Timestamp;
use videofields_vision::error::Fault;

/// Most frames of a sequence: two and a half hours at 30 a second.
pub(super) const MAX_FRAMES: usize = 1 << 18;

/// One frame of a sequence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Its number: of a pattern the one in the name, of a list its place from 0 on.
    pub number: u64,
    /// How many frames would be before it if none were missing: its place in lists.
    pub place: usize,
    /// When it is.
    pub at: Timestamp,
    /// Its mesh.
    pub mesh: PathBuf,
}

/// The frames in order, and which numbers between them are missing.
#[derive(Debug)]
pub(super) struct Frames {
    pub(super) all: Vec<Frame>,
    /// First and last of each run of numbers that are not there.
    pub(super) missing: Vec<[u64; 2]>,
    is_standing: bool,
}

impl Frames {
    /// Finds what a manifest names; files are not opened.
    pub(super) fn find(manifest: &Manifest, path: &Path, roots: &MediaRoots) -> Result<Self, SequenceError> {
        let numbered: Vec<(u64, PathBuf)> = match &manifest.meshes {
            Files::List(list) => {
                (0..).zip(list).filter_map(|(number, file)| Some((number, file.clone()?))).collect()
            }
            Files::Pattern(_, pattern) => {
                let folder = roots.resolve_folder(pattern.folder())?;
                let unreadable =
                    |source| IngestError::Unreadable { path: pattern.folder().to_path_buf(), source };
                let mut numbers = Vec::new();
                for entry in std::fs::read_dir(folder).map_err(unreadable)? {
                    let name = entry.map_err(unreadable)?.file_name();
                    numbers.extend(name.to_str().and_then(|name| pattern.number(name)));
                }
                numbers.sort_unstable();
                numbers.into_iter().map(|number| (number, pattern.path(number))).collect()
            }
        };
        let faulty = |place: &str, message: String| SequenceError::Faults {
            path: path.to_path_buf(),
            faults: vec![Fault::new(place, message)],
        };
        let (Some((first, _)), Some((last, _))) = (numbered.first(), numbered.last()) else {
            let pattern = match &manifest.meshes {
                Files::Pattern(pattern, _) => pattern.clone(),
                Files::List(_) => PathBuf::from("its list, which is null throughout"),
            };
            return Err(SequenceError::Empty { path: path.to_path_buf(), pattern });
        };
        if numbered.len() > MAX_FRAMES {
            let message = format!("at most {MAX_FRAMES} frames are allowed, got {}", numbered.len());
            return Err(faulty("/meshes", message));
        }
        // Places in lists are counted from the first number that a pattern has, or from 0.
        let zero = if matches!(manifest.meshes, Files::Pattern(..)) { *first } else { 0 };
        let n_numbers = last - zero + 1;
        if let Times::Listed(times) = &manifest.times
            && times.len() as u64 != n_numbers
        {
            let message = format!("{} times for {n_numbers} numbers, {zero} to {last}", times.len());
            return Err(faulty("/times_secs", message));
        }
        let secs = |number: u64| match &manifest.times {
            Times::Standing => 0.0,
            Times::Rate(rate_hz) => (number - zero) as f64 / rate_hz,
            Times::Listed(times) => times[(number - zero) as usize],
        };
        // A cast from float saturates, and so does the sum.
        let at = |number| manifest.start.saturating_add_nanos((secs(number) * 1e9).round() as i64);
        let missing = numbered
            .windows(2)
            .filter(|pair| pair[1].0 - pair[0].0 > 1)
            .map(|pair| [pair[0].0 + 1, pair[1].0 - 1])
            .collect();
        let is_standing = numbered.len() == 1;
        let frame = |(number, mesh)| Frame { number, place: (number - zero) as usize, at: at(number), mesh };
        let all: Vec<Frame> = numbered.into_iter().map(frame).collect();
        // Numbers far apart at a slow rate end where time does.
        if let Some(pair) = all.windows(2).find(|pair| pair[1].at <= pair[0].at) {
            let message = format!("frame {} is not after frame {}", pair[1].number, pair[0].number);
            return Err(faulty("/meshes", message));
        }
        Ok(Self { all, missing, is_standing })
    }

    /// The frame that answers for an instant: the nearest within 1 s, or twice its distance to the next one; one frame alone always.
    pub(super) fn at(&self, at: Timestamp) -> Result<usize, SequenceError> {
        let n_before = self.all.partition_point(|frame| frame.at <= at);
        let (before, after) = (n_before.checked_sub(1), Some(n_before).filter(|idx| *idx < self.all.len()));
        let away = |idx: Option<usize>| {
            idx.map_or(i64::MAX, |idx| self.all[idx].at.nanos_since(at).saturating_abs())
        };
        let nearest = if away(before) <= away(after) { before } else { after };
        let time = |idx: Option<usize>| idx.map(|idx| self.all[idx].at);
        nearest
            .filter(|idx| self.is_standing || away(Some(*idx)) <= self.reach_nanos(*idx))
            .ok_or_else(|| SequenceError::Gap { at, before: time(before), after: time(after) })
    }

    fn reach_nanos(&self, idx: usize) -> i64 {
        let beside = [idx.checked_sub(1).map(|before| (before, idx)), Some((idx, idx + 1))];
        let distance =
            |(from, to): (usize, usize)| Some(self.all.get(to)?.at.nanos_since(self.all.get(from)?.at));
        let least = beside.into_iter().flatten().filter_map(distance).min();
        least.map_or(REACH_NANOS, |nanos| REACH_NANOS.max(nanos.saturating_mul(2)))
    }

    /// From the first frame to the last.
    pub(super) fn extent(&self) -> Extent {
        let [first, last] = [self.all.first(), self.all.last()].map(|frame| frame.map(|frame| frame.at));
        Extent { first, live: last.unwrap_or_default() }
    }
}
