//! Pictures that wait or are in hand, and which of them is next.

use super::{
    Caller, GREED, Job, JobId, MAX_BYTES, MAX_PAUSED, MAX_PAUSED_BYTES, Next, PlaceId, State, request_bytes,
};
use crate::engine::flow::{Flow, Kind, Offer};
use crate::engine::view::ViewRequest;
use std::time::Duration;
use videofields_recording::telemetry::ViewRefusal;
use videofields_render::expected_pieces;

/// One picture, and who waits for it.
pub(super) struct Place {
    pub(super) id: PlaceId,
    pub(super) request: ViewRequest,
    pub(super) callers: Vec<Caller>,
    /// Set once the render thread has it.
    pub(super) hand: Option<Hand>,
    n_pieces: u32,
    n_bytes: u64,
}

/// Progress of a picture in hand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hand {
    pub(super) job: JobId,
    pub(super) begun_at: Duration,
    /// True where pieces of it are left, and it waits for its next turn.
    pub(super) is_paused: bool,
    /// Time that these take by what its plan expects, once that is known.
    pub(super) left: Option<Duration>,
}

impl Hand {
    pub(super) const fn new(job: JobId, begun_at: Duration) -> Self {
        Self { job, begun_at, is_paused: false, left: None }
    }
}

impl Place {
    /// A place for a picture that is drawn with so many samples where it asks for none.
    pub(super) fn new(id: PlaceId, request: ViewRequest, caller: Caller, samples: u32) -> Self {
        // Drawing tells what is wrong with the request.
        let settings = request.effort.settings(request.style, samples);
        let size_px = (request.width_px, request.height_px);
        let n_pieces = settings.map_or(1, |settings| expected_pieces(size_px, settings.sampling));
        let n_pieces = u32::try_from(n_pieces).unwrap_or(u32::MAX);
        let n_bytes = request_bytes(&request);
        Self { id, request, callers: vec![caller], hand: None, n_pieces, n_bytes }
    }

    /// Returns how long a caller waits: until its deadline for the drawing to begin, and for what has begun as for any.
    pub(super) fn patience(&self, timeout: Duration) -> Duration {
        match self.request.effort.deadline() {
            Some(deadline) if self.hand.is_none() => deadline.total.min(timeout),
            _ => timeout,
        }
    }

    pub(super) fn is_of(&self, job: JobId) -> bool {
        self.hand.as_ref().is_some_and(|hand| hand.job == job)
    }

    /// Returns true where anybody of a flow waits for it.
    pub(super) fn is_for(&self, flow: &Flow) -> bool {
        self.callers.iter().any(|caller| caller.flow == *flow)
    }

    /// Returns true where the place counts as that flow's: its first caller's.
    fn is_held_by(&self, flow: &Flow) -> bool {
        self.callers.first().is_some_and(|caller| caller.flow == *flow)
    }

    fn paused(&self) -> Option<&Hand> {
        self.hand.as_ref().filter(|hand| hand.is_paused)
    }

    /// Returns true while it is being drawn.
    fn is_drawn(&self) -> bool {
        self.hand.as_ref().is_some_and(|hand| !hand.is_paused)
    }

    const fn kind(&self) -> Kind {
        if self.n_pieces > 1 || self.hand.is_some() { Kind::Large } else { Kind::Small }
    }

    /// Returns what of the renderer's time it still takes, where a piece takes `piece`.
    fn expected(&self, piece: Duration) -> Duration {
        let left = self.hand.as_ref().and_then(|hand| hand.left);
        left.unwrap_or_else(|| piece.saturating_mul(self.n_pieces))
    }
}

impl State {
    pub(super) fn n_waiting(&self) -> usize {
        self.places.iter().filter(|place| place.hand.is_none()).count()
    }

    /// Pictures that wait for their first or next turn and count as that flow's.
    pub(super) fn n_held_by(&self, flow: &Flow) -> usize {
        self.places.iter().filter(|place| !place.is_drawn() && place.is_held_by(flow)).count()
    }

    /// Returns why a picture of so many bytes gets no place; none where it does. Whoever holds nothing gets a place while there is one.
    pub(super) fn refusal(&self, flow: &Flow, n_bytes: u64, max_pictures: usize) -> Option<ViewRefusal> {
        // Those of which pieces are drawn too: there are no more of them than places.
        let n_held = self.places.iter().filter(|place| !place.is_drawn()).count();
        let n_free = max_pictures.saturating_sub(n_held);
        if n_free == 0 {
            return Some(ViewRefusal::QueueFull);
        }
        let n_all_bytes: u64 = self.places.iter().map(|place| place.n_bytes).sum();
        if n_all_bytes > 0 && n_all_bytes.saturating_add(n_bytes) > MAX_BYTES {
            return Some(ViewRefusal::QueueBytes);
        }
        if *flow == Flow::Common {
            return None;
        }
        if self.n_held_by(flow) >= GREED * n_free {
            return Some(ViewRefusal::UserShare);
        }
        let own = self.places.iter().filter(|place| place.is_held_by(flow));
        let n_own_bytes: u64 = own.map(|place| place.n_bytes).sum();
        let n_free_bytes = MAX_BYTES.saturating_sub(n_all_bytes).saturating_sub(n_bytes);
        let is_over = n_own_bytes > 0 && n_own_bytes.saturating_add(n_bytes) > GREED as u64 * n_free_bytes;
        is_over.then_some(ViewRefusal::UserBytes)
    }

    /// Gives whose turn it is what they wait for, if anybody waits for what can be drawn now.
    pub(super) fn begin_turn(&mut self, now: Duration) -> Option<Next> {
        let Self { places, turns, turn, .. } = self;
        // Each picture once, however many wait for it.
        let is_first = |idx: usize, job: JobId| !places[..idx].iter().any(|place| place.is_of(job));
        let is_open =
            |(idx, place): &(usize, &Place)| place.hand.is_some_and(|hand| is_first(*idx, hand.job));
        let n_paused = |of: fn(&Place) -> u64| {
            places.iter().enumerate().filter(is_open).map(|(_, place)| of(place)).sum::<u64>()
        };
        let (n_open, n_open_bytes) = (n_paused(|_| 1), n_paused(|place| place.n_bytes));
        let has_room = |n_bytes: u64| {
            n_open == 0
                || (n_open < MAX_PAUSED as u64 && n_open_bytes.saturating_add(n_bytes) <= MAX_PAUSED_BYTES)
        };
        let offer = |flow: &Flow, kind: Kind| {
            let own = || places.iter().enumerate().filter(|(_, place)| place.is_for(flow));
            if kind == Kind::Large
                && let Some((idx, _)) = own().find(|(_, place)| place.paused().is_some())
            {
                return Some(idx);
            }
            let waits = |place: &Place| place.hand.is_none() && place.kind() == kind;
            let fits = |place: &Place| kind == Kind::Small || has_room(place.n_bytes);
            own().find(|(_, place)| waits(place)).filter(|(_, place)| fits(place)).map(|(idx, _)| idx)
        };
        let (flow, Offer { kind, what: idx }) = turns.next(offer)?;
        *turn = Some((flow.clone(), kind, now));
        if let Some(job) = places[idx].paused().map(|hand| hand.job) {
            for hand in places.iter_mut().filter_map(|place| place.hand.as_mut()) {
                hand.is_paused &= hand.job != job;
            }
            return Some(Next::GoOn(job));
        }
        let place = &mut places[idx];
        let id = place.id;
        place.hand = Some(Hand::new(id, now));
        let asked_at = place.callers.iter().map(|caller| caller.asked_at).min().unwrap_or(now);
        Some(Next::Picture(Box::new(Job { id, request: place.request.clone(), asked_at, flow })))
    }

    /// Returns how many other flows wait, and how much of the renderer's time these can take while the flow itself has `own` of it.
    pub(super) fn rivals(&self, flow: &Flow, own: Duration) -> (u32, Duration) {
        let piece = self.pace.median();
        let most = own.saturating_add(piece);
        let (mut n_others, mut all) = (0, Duration::ZERO);
        for other in self.turns.flows().filter(|other| *other != flow) {
            let own = self.places.iter().filter(|place| place.is_held_by(other) && !place.is_drawn());
            let backlog: Duration = own.map(|place| place.expected(piece)).sum();
            n_others += u32::from(!backlog.is_zero());
            all = all.saturating_add(backlog.min(most));
        }
        (n_others, all)
    }

    /// Returns about how long what is before a new request of a flow takes: what it waits for itself, and what others get meanwhile. What is drawn
    /// counts as one piece. After `timeout` nothing of that waits any more.
    pub(super) fn retry_after(&self, flow: &Flow, now: Duration, timeout: Duration) -> Duration {
        let piece = self.pace.median();
        let own = self.places.iter().filter(|place| place.is_held_by(flow) && !place.is_drawn());
        let own: Duration = own.map(|place| place.expected(piece)).sum();
        let is_drawing = self.places.iter().any(Place::is_drawn);
        let drawn = if is_drawing { piece } else { Duration::ZERO };
        let (_, others) = self.rivals(flow, own);
        let queued = own.saturating_add(others).saturating_add(drawn).min(timeout);
        queued.max(self.down_until.saturating_sub(now))
    }
}
