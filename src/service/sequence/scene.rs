//! The sequences of a scene, as they are at its instants: ready for a device that makes their fields.

use super::{MadeOn, Player, PlayerSettings, Sequence, SequenceError};
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;
use videofields_picture::fuse::SequenceAtInstant;
use videofields_picture::scene::{Scene, SceneSequence};
use videofields_recording::ingest::MediaRoots;
use videofields_recording::timeline::Extent;
use videofields_vision::clock::Timestamp;

/// A scene's sequences, opened.
#[derive(Debug, Default)]
pub struct SceneSequences(Vec<Playing>);

#[derive(Debug)]
struct Playing {
    id: Arc<str>,
    repeats: bool,
    /// Why it cannot be opened, with the names of files.
    player: Result<Box<Player>, String>,
    /// Frames whose fault is in the log.
    logged: HashSet<u64>,
}

/// Most frames whose faults are remembered, so that none is told in the log at every picture.
const MOST_LOGGED: usize = 1024;

impl SceneSequences {
    /// Those of `scene`; of all their frames at most `cache_bytes` are kept, and of each the one that was shown last. Files that a manifest
    /// names are opened beneath its own folder and `roots` alone. One that cannot be opened is told at every instant, and stops no other.
    #[must_use]
    pub fn open(scene: &Scene, roots: &MediaRoots, cache_bytes: usize) -> Self {
        let own_bytes = cache_bytes / scene.sequences.len().max(1);
        let open = |of: &SceneSequence| {
            let player = opened(&of.path, roots, own_bytes).inspect_err(|reason| {
                tracing::error!(scene = scene.id, sequence = of.id, %reason, "a sequence cannot be opened");
            });
            Playing { id: of.id.as_str().into(), repeats: of.repeats, player, logged: HashSet::new() }
        };
        Self(scene.sequences.iter().map(open).collect())
    }

    /// Which of them cannot be opened, and why, with the names of files: for who keeps the daemon.
    pub fn problems(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().filter_map(|of| Some((&*of.id, of.player.as_ref().err()?.as_str())))
    }

    /// What each of them is at an instant of scene time, in the scene's order.
    ///
    /// **Cost** of a frame that is not kept that of reading its mesh and decoding its cameras' pictures, by who asks.
    pub fn at(&mut self, instant: Timestamp) -> Vec<SequenceAtInstant> {
        self.0.iter_mut().map(|playing| playing.at(instant)).collect()
    }
}

impl Playing {
    fn at(&mut self, instant: Timestamp) -> SequenceAtInstant {
        let id = Arc::clone(&self.id);
        let moment = match &mut self.player {
            Ok(player) => {
                let at = if self.repeats { within(instant, player.extent()) } else { instant };
                player.moment(at).map_err(|error| told(&error, (&id, &mut self.logged)))
            }
            Err(_) => Err("it cannot be opened".into()),
        };
        SequenceAtInstant { id, moment }
    }
}

/// Why there is no frame, as callers are told; what names files goes to the log, once.
fn told(error: &SequenceError, (id, logged): (&str, &mut HashSet<u64>)) -> Arc<str> {
    match error {
        SequenceError::Gap { .. } => error.to_string().into(),
        SequenceError::Mesh { number, .. } | SequenceError::Field { number, .. } => {
            if logged.len() < MOST_LOGGED && logged.insert(*number) {
                tracing::error!(sequence = id, %error, "a frame of a sequence cannot be shown");
            }
            format!("frame {number} cannot be read").into()
        }
        SequenceError::File(_) | SequenceError::Faults { .. } | SequenceError::Empty { .. } => {
            "it cannot be read".into()
        }
    }
}

fn opened(path: &Path, roots: &MediaRoots, cache_bytes: usize) -> Result<Box<Player>, String> {
    let folder = if path.is_dir() { Some(path) } else { path.parent() };
    let folder = folder.ok_or_else(|| "it has no folder".to_owned())?;
    let roots = roots.clone().with_folder(folder).map_err(|error| error.to_string())?;
    let sequence = Sequence::open(path, &roots).map_err(|error| error.to_string())?;
    let settings = PlayerSettings { made_on: MadeOn::Device, cache_bytes, ..PlayerSettings::default() };
    Ok(Box::new(Player::new(sequence, settings)))
}

/// The instant of a recording that is shown over and over since ever: its begin and end follow each other.
fn within(instant: Timestamp, Extent { first, live }: Extent) -> Timestamp {
    let begin = first.unwrap_or(live);
    let length = live.nanos_since(begin);
    if length <= 0 {
        return begin;
    }
    begin.saturating_add_nanos(instant.nanos_since(begin).rem_euclid(length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_that_repeats_is_at_every_instant() {
        let at = Timestamp::from_nanos;
        let extent = |begin, end| Extent { first: Some(at(begin)), live: at(end) };
        for (instant, expected) in
            [(10, 10), (19, 19), (20, 10), (25, 15), (9, 19), (-91, 19), (1_000_000_013, 13)]
        {
            assert_eq!(within(at(instant), extent(10, 20)), at(expected), "{instant}");
        }
        assert_eq!(within(at(7), extent(10, 10)), at(10));
    }
}
