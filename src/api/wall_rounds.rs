//! Which frame of a wall is being drawn for streams of its tiles.
//!
//! A machine that draws all tiles slower than frames are due must leave frames out, and of all tiles the same: so nobody
//! begins a newer frame while somebody still draws the one before. Whoever comes meanwhile joins that one. A client that does
//! not take its pictures draws nothing, and holds up nobody.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;
use videofields_service::wall::WallFrame;
use videofields_vision::frame::CameraId;

/// A wall in one of its versions, and the cameras that its frames hang on.
pub(super) type Key = (String, i64, Vec<CameraId>);

/// What is being drawn of all walls.
#[derive(Debug, Default)]
pub(super) struct Rounds {
    drawing: Mutex<Vec<Round>>,
    ended: Notify,
}

#[derive(Debug)]
struct Round {
    key: Key,
    frame: WallFrame,
    n_drawing: usize,
}

/// A tile that is being drawn; the round goes on until all of them are dropped.
#[derive(Debug)]
pub(super) struct Turn {
    rounds: Arc<Rounds>,
    key: Key,
    pub(super) frame: WallFrame,
}

impl Rounds {
    /// A turn in the frame that is being drawn, or in `due` where none is; none while that is `last`, which was drawn already.
    pub(super) fn enter(self: &Arc<Self>, key: &Key, last: Option<u64>, due: &WallFrame) -> Option<Turn> {
        let mut drawing = self.lock();
        let is_new = |frame: &WallFrame| last.is_none_or(|last| frame.id > last);
        let frame = match drawing.iter_mut().find(|round| round.key == *key) {
            Some(round) if is_new(&round.frame) => {
                round.n_drawing += 1;
                round.frame.clone()
            }
            None if is_new(due) => {
                drawing.push(Round { key: key.clone(), frame: due.clone(), n_drawing: 1 });
                due.clone()
            }
            _ => return None,
        };
        Some(Turn { rounds: Arc::clone(self), key: key.clone(), frame })
    }

    /// Completes with the end of some round.
    pub(super) fn ended(&self) -> tokio::sync::futures::Notified<'_> {
        self.ended.notified()
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Round>> {
        // Each change is one step: a panic leaves none by half.
        self.drawing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        let mut drawing = self.rounds.lock();
        if let Some(place) = drawing.iter().position(|round| round.key == self.key) {
            drawing[place].n_drawing -= 1;
            if drawing[place].n_drawing == 0 {
                drawing.swap_remove(place);
                self.rounds.ended.notify_waiters();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_recording::timeline::Horizon;
    use videofields_vision::clock::Timestamp;

    fn frame(id: u64) -> WallFrame {
        WallFrame { id, instant: Timestamp::from_nanos(id as i64), horizon: Horizon::default() }
    }

    #[test]
    fn nobody_begins_a_newer_frame_while_one_is_drawn() {
        let rounds = Arc::new(Rounds::default());
        let key = ("control".to_owned(), 1, Vec::new());
        let first = rounds.enter(&key, None, &frame(10)).unwrap();
        // Late ones join, though a newer frame is due; who has it waits.
        let second = rounds.enter(&key, Some(7), &frame(12)).unwrap();
        assert_eq!((first.frame.id, second.frame.id), (10, 10));
        assert!(rounds.enter(&key, Some(10), &frame(12)).is_none());
        let other = ("control".to_owned(), 2, Vec::new());
        assert_eq!(rounds.enter(&other, Some(10), &frame(12)).unwrap().frame.id, 12, "another version");
        drop(first);
        assert!(rounds.enter(&key, Some(10), &frame(12)).is_none());
        drop(second);
        assert!(rounds.enter(&key, Some(12), &frame(12)).is_none(), "not twice");
        assert_eq!(rounds.enter(&key, Some(10), &frame(12)).unwrap().frame.id, 12);
        assert!(rounds.lock().is_empty());
    }
}
