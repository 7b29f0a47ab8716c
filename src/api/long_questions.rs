//! Questions that cost the daemon much and the caller little: in turns by caller, behind what is live.

use super::Api;
use super::turns::Turn;
use std::num::NonZero;
use std::thread;
use tokio::runtime::Handle as Runtime;
use videofields_recording::priority;
use videofields_service::engine::{EngineError, Handle, LookedBack, ViewRequest};

/// Returns how many of each kind are answered at once: half of the machine's processors, and two at least, so that there is one for who
/// asks while another's takes long. All kinds together are fewer than there are threads of a lower priority.
pub(super) fn at_once() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get).div_ceil(2).clamp(2, 16)
}

impl Api {
    /// Asks the engine what takes a processor for long: in the caller's turn, on a thread of a lower priority. `action` is
    /// what a panic broke off.
    pub(super) async fn compute<T: Send + 'static>(
        &self,
        action: &'static str,
        question: impl FnOnce(Handle) -> Result<T, EngineError> + Send + 'static,
    ) -> Result<T, EngineError> {
        let turn = self.turn(&self.computations).await;
        let (door, runtime) = (self.door.clone(), Runtime::current());
        let work = move || {
            let _within = runtime.enter();
            let answer = question(door);
            // Held until now, though nobody may wait for it any more.
            drop(turn);
            answer
        };
        let broke_off = |_panic| Err(EngineError::Internal(format!("{action} was broken off")));
        priority::spawn(work).await.unwrap_or_else(broke_off)
    }

    /// Asks the engine what has to be read and decoded of recordings, in the caller's turn.
    pub(super) async fn look_back<T: Send + 'static>(
        &self,
        action: &'static str,
        question: impl FnOnce(Handle) -> Result<T, EngineError> + Send + 'static,
    ) -> Result<T, EngineError> {
        Ok(self.looking_back(action, question).await?.1)
    }

    /// Reads and decodes what a picture of the past shows, in the caller's turn, before the picture is asked for; none where memory
    /// holds all of it. The turn is over, and what was decoded is let go, once the answer is dropped.
    pub(super) async fn looked_back(&self, request: &ViewRequest) -> Option<(Turn<String>, LookedBack)> {
        if !self.door.looks_back(request) {
            return None;
        }
        let asked = request.clone();
        // A fault of the request is told when the picture is asked for.
        self.looking_back("looking back", move |door| door.look_back(&asked)).await.ok()
    }

    /// Asks for something in the caller's turn at looking back, which is over once the answer is dropped.
    async fn looking_back<T: Send + 'static>(
        &self,
        action: &'static str,
        question: impl FnOnce(Handle) -> Result<T, EngineError> + Send + 'static,
    ) -> Result<(Turn<String>, T), EngineError> {
        let turn = self.turn(&self.replays).await;
        self.ask(action, move |door| Ok((turn, question(door)?))).await
    }
}
