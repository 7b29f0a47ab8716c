//! The daemon's own table: measured once on a machine, in the background, and again when it is asked for.
//!
//! One thread. It measures on a scene of its own (`courtyard`), on a device of its own, only while no view is asked for: before every
//! step it waits for quiet and rests as long as the step took, and a step beside which a view came is timed again. The
//! cameras' own work goes on beside it.

use super::SweepError;
use super::courtyard::courtyard;
use super::gate::{Gate, Stopwatch};
use super::machine::{digest, machine};
use super::subject::Scope;
use super::sweep::{Stage, sweep_gated};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::runtime::Handle as Runtime;
use videofields_picture::plan::{COST_TABLE_VERSION, CostTable};
use videofields_recording::ingest::StopFlag;
use videofields_recording::store::Store;
use videofields_render::gpu::Gpu;
use videofields_service::engine::{AccuracyBoard, AccuracyState};
use videofields_vision::clock::Clock;
use videofields_vision::config::RenderSettings;

/// Longest that measuring works, rests and waits left out.
const WORK_TIME: Duration = Duration::from_secs(30);

/// Longest rest after a step.
const LONGEST_REST: Duration = Duration::from_millis(50);

/// How often a wish and the end are looked for.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// How a table is made.
#[derive(Clone, Debug)]
pub struct KeeperSettings {
    /// How much of the courtyard.
    pub scope: Scope,
    /// Which stages.
    pub stages: Vec<Stage>,
    /// The renderer's settings, whose adapter is measured.
    pub render: RenderSettings,
    /// Whether a table that the store lacks is made at once.
    pub measures_at_start: bool,
}

/// The thread that keeps the table.
#[derive(Debug)]
pub struct Keeper {
    stop: StopFlag,
    board: Arc<AccuracyBoard>,
    thread: JoinHandle<()>,
}

impl Keeper {
    /// Starts it; the table appears on `board`.
    ///
    /// # Errors
    /// When the thread cannot be started.
    pub fn start(
        settings: KeeperSettings,
        board: Arc<AccuracyBoard>,
        store: Store,
        runtime: Runtime,
        clock: Arc<dyn Clock>,
    ) -> std::io::Result<Self> {
        let stop = StopFlag::default();
        board.attend();
        let work = Work { settings, board: Arc::clone(&board), store, runtime, clock, stop: stop.clone() };
        let thread = std::thread::Builder::new().name("accuracy".to_owned()).spawn(move || work.run())?;
        Ok(Self { stop, board, thread })
    }

    /// Asks it to end, and returns at once.
    pub fn request_stop(&self) {
        self.stop.raise();
        self.board.leave();
    }

    /// Ends it; a step that takes longer than `patience` is left to itself.
    pub fn stop(self, clock: &dyn Clock, patience: Duration) {
        self.request_stop();
        let until = clock.monotonic().saturating_add(patience);
        while !self.thread.is_finished() && clock.monotonic() < until {
            clock.sleep(Duration::from_millis(5));
        }
        if !self.thread.is_finished() {
            tracing::warn!("measuring is left with the step it has in hand");
        } else if self.thread.join().is_err() {
            tracing::error!("the accuracy thread panicked");
        }
    }
}

struct Work {
    settings: KeeperSettings,
    board: Arc<AccuracyBoard>,
    store: Store,
    runtime: Runtime,
    clock: Arc<dyn Clock>,
    stop: StopFlag,
}

impl Work {
    fn run(self) {
        let mut is_wanted = !self.take_stored() && self.settings.measures_at_start;
        if is_wanted {
            self.board.set_state(AccuracyState::Pending, None);
        }
        while !self.stop.is_raised() {
            is_wanted |= self.board.take_wish();
            if std::mem::take(&mut is_wanted) {
                self.measure();
            } else {
                self.clock.sleep(LOOK_INTERVAL);
            }
        }
    }

    fn adapter(&self) -> Option<String> {
        Gpu::new(&self.settings.render.adapter).ok().map(|gpu| gpu.name().to_owned())
    }

    /// Puts the table up that the store has of this machine; false where there is none of use.
    fn take_stored(&self) -> bool {
        let machine = machine(&self.adapter().unwrap_or_default());
        let document = match self.runtime.block_on(self.store.measured_cost(&digest(&machine))) {
            Ok(Some(document)) => document,
            Ok(None) => return false,
            Err(error) => {
                tracing::warn!(%error, "the table of measured costs was not read");
                return false;
            }
        };
        match serde_json::from_str::<CostTable>(&document) {
            Ok(table) if table.version == COST_TABLE_VERSION => {
                self.board.put(table);
                true
            }
            _ => {
                tracing::warn!(
                    "the table of measured costs is of another version or damaged; measuring anew"
                );
                false
            }
        }
    }

    fn measure(&self) {
        self.board.set_state(AccuracyState::Measuring, None);
        // A panic leaves nothing half-changed: the sweep owns all that it works on.
        let measured = catch_unwind(AssertUnwindSafe(|| self.table()))
            .unwrap_or_else(|_panic| Err(SweepError::Picture("measuring panicked".to_owned())));
        match measured {
            Ok(Some(table)) => {
                tracing::info!(rows = table.rows.len(), took_secs = table.took_secs, "costs measured");
                self.keep(&table);
                self.board.put(table);
            }
            Ok(None) => {
                let reason = "ended before anything was measured".to_owned();
                self.board.set_state(AccuracyState::Failed, Some(reason));
            }
            Err(error) => {
                tracing::error!(%error, "costs were not measured");
                self.board.set_state(AccuracyState::Failed, Some(error.to_string()));
            }
        }
    }

    /// The table, as far as the time went; none where it did not go for a single row.
    fn table(&self) -> Result<Option<CostTable>, SweepError> {
        let KeeperSettings { scope, stages, render, .. } = &self.settings;
        let gate = QuietGate::new(&self.board, &*self.clock, &self.stop);
        let watch = Stopwatch::new(&*self.clock, &gate);
        let progress = |step: &str| tracing::debug!(step, "measuring");
        let prepare = || courtyard(scope, render, &watch, &progress);
        let found = sweep_gated(&prepare, scope, stages, &watch, &progress)?;
        if found.rows.is_empty() || self.stop.is_raised() {
            return Ok(None);
        }
        Ok(Some(CostTable {
            version: COST_TABLE_VERSION,
            machine: machine(&self.adapter().unwrap_or_default()),
            subject: "courtyard".to_owned(),
            measured_at: self.clock.now().to_string(),
            took_secs: gate.worked().as_secs_f64(),
            is_complete: found.is_complete,
            rows: found.rows,
        }))
    }

    /// A table that cannot be kept is still a table; it is measured again at the next start.
    fn keep(&self, table: &CostTable) {
        let machine = digest(&table.machine);
        let written = serde_json::to_string(table).map_err(|error| error.to_string()).and_then(|document| {
            let put = self.store.put_measured_cost(&machine, &document, self.clock.now());
            self.runtime.block_on(put).map_err(|error| error.to_string())
        });
        if let Err(error) = written {
            tracing::warn!(error, "the table of measured costs was not kept");
        }
    }
}

/// Lets steps begin while nothing is asked of the renderer, until the time is spent or the end is asked for.
struct QuietGate<'a> {
    board: &'a AccuracyBoard,
    clock: &'a dyn Clock,
    stop: &'a StopFlag,
    pace: Mutex<Pace>,
}

#[derive(Default)]
struct Pace {
    worked: Duration,
    step_began: Option<Duration>,
    asked_at_entry: u64,
}

impl<'a> QuietGate<'a> {
    fn new(board: &'a AccuracyBoard, clock: &'a dyn Clock, stop: &'a StopFlag) -> Self {
        Self { board, clock, stop, pace: Mutex::default() }
    }

    fn pace(&self) -> std::sync::MutexGuard<'_, Pace> {
        self.pace.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn worked(&self) -> Duration {
        self.pace().worked
    }

    /// Counts the step that ends now; what it took.
    fn end_step(&self) -> Duration {
        let mut pace = self.pace();
        let Some(began) = pace.step_began.take() else { return Duration::ZERO };
        let took = self.clock.monotonic().saturating_sub(began);
        pace.worked = pace.worked.saturating_add(took);
        took
    }
}

impl Gate for QuietGate<'_> {
    fn enter(&self) -> bool {
        let took = self.end_step();
        if self.stop.is_raised() || self.worked() >= WORK_TIME {
            return false;
        }
        self.clock.sleep(took.min(LONGEST_REST));
        while !self.board.is_quiet() {
            if self.stop.is_raised() {
                return false;
            }
            self.clock.sleep(LOOK_INTERVAL);
        }
        let mut pace = self.pace();
        pace.asked_at_entry = self.board.n_asked();
        pace.step_began = Some(self.clock.monotonic());
        true
    }

    fn was_alone(&self) -> bool {
        self.board.n_asked() == self.pace().asked_at_entry
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::clock::{SimulatedClock, Timestamp};

    #[test]
    fn the_gate_closes_when_its_time_is_spent_or_the_end_is_asked_for() {
        let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(0)));
        let board = AccuracyBoard::new(Arc::clone(&clock) as _);
        let stop = StopFlag::default();
        let gate = QuietGate::new(&board, &*clock, &stop);
        let mut n_steps = 0;
        while gate.enter() {
            assert!(gate.was_alone());
            clock.advance(Duration::from_secs(4));
            n_steps += 1;
        }
        assert_eq!(n_steps, 8, "30 s hold eight steps of four that begin within them");
        let fresh = QuietGate::new(&board, &*clock, &stop);
        assert!(fresh.enter());
        stop.raise();
        assert!(!fresh.enter());
    }
}
