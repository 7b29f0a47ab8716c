//! When measuring may go on, and whether what was timed ran alone; and the stopwatch that asks both.

use std::time::Duration;
use videofields_vision::clock::Clock;

/// Times that a step which was disturbed is done again before its time is taken as it is.
const MAX_RETRIES: u32 = 8;

/// Decides when measuring may go on.
pub trait Gate: Sync {
    /// Called before every step; may block until nothing else wants the machine. False ends the measuring.
    fn enter(&self) -> bool;

    /// Whether the step since the last [`Self::enter`] ran alone, so that its time counts.
    fn was_alone(&self) -> bool {
        true
    }
}

/// A gate that is always open: for a command that has the machine to itself.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenGate;

impl Gate for OpenGate {
    fn enter(&self) -> bool {
        true
    }
}

/// The measuring was ended by its gate before it was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the measuring was stopped")]
pub struct Stopped;

/// Times steps, one at a time, as its gate lets it.
#[derive(Clone, Copy)]
pub struct Stopwatch<'a> {
    clock: &'a dyn Clock,
    gate: &'a dyn Gate,
}

impl<'a> Stopwatch<'a> {
    /// A stopwatch over `clock` behind `gate`.
    #[must_use]
    pub fn new(clock: &'a dyn Clock, gate: &'a dyn Gate) -> Self {
        Self { clock, gate }
    }

    /// The clock.
    #[must_use]
    pub const fn clock(&self) -> &'a dyn Clock {
        self.clock
    }

    /// Waits until the gate lets a step begin.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn enter(&self) -> Result<(), Stopped> {
        if self.gate.enter() { Ok(()) } else { Err(Stopped) }
    }

    /// Does one step that cannot be done again; its time in milliseconds, unless it was disturbed.
    ///
    /// # Errors
    /// [`Stopped`], before the step.
    pub fn once<T>(&self, step: impl FnOnce() -> T) -> Result<(T, Option<f64>), Stopped> {
        self.enter()?;
        let (result, time_ms) = self.timed(step);
        Ok((result, self.gate.was_alone().then_some(time_ms)))
    }

    fn timed<T>(&self, step: impl FnOnce() -> T) -> (T, f64) {
        let started = self.clock.monotonic();
        let result = step();
        (result, millis(self.clock.monotonic().saturating_sub(started)))
    }

    /// Does one step, again while it was disturbed; its result and its time in milliseconds.
    ///
    /// # Errors
    /// [`Stopped`], before a step.
    pub fn again<T>(&self, mut step: impl FnMut() -> T) -> Result<(T, f64), Stopped> {
        self.again_after(&mut (), |()| {}, |()| step())
    }

    /// As [`Self::again`]; each time `prepare` comes before the step and is not timed.
    ///
    /// # Errors
    /// [`Stopped`], before either.
    pub fn again_after<S, T>(
        &self,
        state: &mut S,
        mut prepare: impl FnMut(&mut S),
        mut step: impl FnMut(&mut S) -> T,
    ) -> Result<(T, f64), Stopped> {
        let mut retries = 0;
        loop {
            self.enter()?;
            prepare(state);
            let (result, time_ms) = self.timed(|| step(state));
            retries += 1;
            if self.gate.was_alone() || retries >= MAX_RETRIES {
                return Ok((result, time_ms));
            }
        }
    }
}

fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};
    use videofields_vision::clock::{SimulatedClock, Timestamp};

    /// Disturbs the first two steps and ends after the fifth.
    #[derive(Default)]
    struct Busy(AtomicU32);

    impl Gate for Busy {
        fn enter(&self) -> bool {
            self.0.fetch_add(1, Ordering::Relaxed) < 5
        }

        fn was_alone(&self) -> bool {
            self.0.load(Ordering::Relaxed) > 2
        }
    }

    #[test]
    fn a_step_that_was_disturbed_is_timed_again() {
        let clock = SimulatedClock::new(Timestamp::from_nanos(0));
        let gate = Busy::default();
        let watch = Stopwatch::new(&clock, &gate);
        let mut n_steps = 0_u64;
        let step = || {
            n_steps += 1;
            clock.advance(Duration::from_millis(10 * n_steps));
            n_steps
        };
        assert_eq!(watch.again(step), Ok((3, 30.0)));
        assert_eq!(watch.once(|| 7), Ok((7, Some(0.0))));
        assert_eq!(watch.once(|| 7), Ok((7, Some(0.0))));
        assert_eq!(watch.once(|| 7), Err(Stopped));
        assert_eq!(watch.again(|| 7), Err(Stopped));
    }
}
