//! What is ready, within a bound of bytes: what was asked for longest ago goes first.

use std::collections::VecDeque;
use std::sync::Arc;
use videofields_vision::fields::Moment;

/// What a cache did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct CacheCounts {
    /// Asked for and there.
    pub n_found: u64,
    /// Asked for and read.
    pub n_read: u64,
    /// Let go of for want of room.
    pub n_gone: u64,
    /// How many are there.
    pub n_kept: usize,
    /// Bytes that they take.
    pub n_bytes: usize,
}

/// Moments by the frames that they are of.
#[derive(Debug)]
pub(super) struct Cache {
    most_bytes: usize,
    /// The one asked for last at the end.
    kept: VecDeque<(usize, Arc<Moment>)>,
    counts: CacheCounts,
}

impl Cache {
    pub(super) fn new(most_bytes: usize) -> Self {
        Self { most_bytes, kept: VecDeque::new(), counts: CacheCounts::default() }
    }

    pub(super) fn get(&mut self, frame: usize) -> Option<Arc<Moment>> {
        let place = self.kept.iter().position(|(of, _)| *of == frame)?;
        let found = self.kept.remove(place)?;
        let moment = Arc::clone(&found.1);
        self.kept.push_back(found);
        self.counts.n_found += 1;
        Some(moment)
    }

    /// Keeps what was read; it stays even if it alone passes the bound.
    pub(super) fn put(&mut self, frame: usize, moment: &Arc<Moment>) {
        self.counts.n_read += 1;
        self.counts.n_bytes += moment.n_bytes();
        self.kept.push_back((frame, Arc::clone(moment)));
        while self.counts.n_bytes > self.most_bytes && self.kept.len() > 1 {
            let Some((_, gone)) = self.kept.pop_front() else { break };
            self.counts.n_bytes -= gone.n_bytes();
            self.counts.n_gone += 1;
        }
    }

    pub(super) fn counts(&self) -> CacheCounts {
        CacheCounts { n_kept: self.kept.len(), ..self.counts }
    }
}
