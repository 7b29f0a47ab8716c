//! How long pictures take on this machine and what error settings leave, as far as is known: shared by the render thread, which
//! teaches it, and whoever asks for a plan.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use videofields_picture::plan::{Choice, EntityStyle};
use videofields_picture::plan::{
    CostTable, Deadline, Errors, Forecast, Known, Model, Named, Pending, Plan, Settings, StageTimes, Survey,
    Task, candidates,
};

/// What was expected of a picture before it was drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// How long it takes from what cameras saw to the finished picture.
    pub forecast: Forecast,
    /// The error that its settings leave, root mean square of 8-bit codes; none where nothing was measured.
    pub error: Option<f64>,
    /// The deadline that the settings were chosen for, if they were.
    pub deadline: Option<Deadline>,
}

/// Settings that were decided on, with what is to be learned from them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decision {
    pub(super) settings: Settings,
    pub(super) task: Task,
    pub(super) expected: Expected,
}

/// Why no settings fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NoneFits {
    /// What the fastest would take of the renderer's time, were nothing before it.
    pub(super) least: Duration,
}

#[derive(Default)]
struct Inner {
    model: Model,
    errors: Errors,
    table: Option<Arc<CostTable>>,
}

/// See the module.
#[derive(Default)]
pub(super) struct Forecaster(Mutex<Inner>);

impl Forecaster {
    fn inner(&self) -> std::sync::MutexGuard<'_, Inner> {
        // A model that a panic left half-fitted is fitted anew by the next picture.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a table that was measured on `adapter` by this version of the program for what is known; of any other machine's
    /// nothing is taken.
    pub(super) fn use_table(&self, table: Option<&Arc<CostTable>>, adapter: &str) {
        let is_own = |table: &&Arc<CostTable>| {
            table.machine.adapter == adapter && table.machine.version == env!("CARGO_PKG_VERSION")
        };
        let table = table.filter(is_own);
        let mut inner = self.inner();
        let is_same = match (&inner.table, table) {
            (Some(known), Some(table)) => Arc::ptr_eq(known, table),
            (None, None) => true,
            _ => false,
        };
        if !is_same {
            inner.table = table.cloned();
            inner.model.use_table(table.map(|table| &**table));
            inner.errors = table.and_then(|table| Errors::of(table)).unwrap_or_default();
        }
    }

    /// The device is another one: its programs are still to be made.
    pub(super) fn forget_programs(&self) {
        self.inner().model.forget_programs();
    }

    /// What `settings` come to.
    pub(super) fn expect(&self, survey: &Survey, pending: Pending, settings: &Settings) -> Decision {
        let inner = self.inner();
        let known = Known { survey, pending, model: &inner.model, errors: &inner.errors };
        decision(&known.choice(settings), None)
    }

    /// The best settings whose drawing fits in what is left of a deadline.
    pub(super) fn choose(
        &self,
        (survey, pending): (&Survey, Pending),
        (style, named): (EntityStyle, &Named),
        deadline: Deadline,
        left: Duration,
    ) -> Result<Decision, NoneFits> {
        let inner = self.inner();
        let known = Known { survey, pending, model: &inner.model, errors: &inner.errors };
        let most_ms = left.as_secs_f64() * 1e3;
        match known.within(&candidates(style, named), most_ms) {
            Ok(choice) => Ok(decision(&choice, Some(deadline))),
            Err(fastest) => {
                let least_ms = fastest.map_or(f64::INFINITY, |forecast| forecast.upper_ms);
                let least = Duration::try_from_secs_f64(least_ms * 1e-3).unwrap_or(Duration::MAX);
                Err(NoneFits { least: least.saturating_add(deadline.reserve) })
            }
        }
    }

    /// Learns what a picture took, without what making its scene ready took before it, if that was to be done.
    pub(super) fn note(&self, decision: &Decision, times: StageTimes, preparing: Duration) {
        let mut inner = self.inner();
        if decision.task.is_unprepared {
            inner.model.note_preparation(preparing.as_secs_f64() * 1e3);
        }
        inner.model.note(&decision.task, decision.expected.forecast.median_ms, times);
    }

    /// What a picture is to the model, once its own plan is known.
    pub(super) fn settled(&self, mut decision: Decision, survey: &Survey, pending: Pending) -> Decision {
        decision.task = self.inner().model.task(survey, &decision.settings, pending);
        decision
    }
}

const fn decision(choice: &Choice, deadline: Option<Deadline>) -> Decision {
    let expected = Expected { forecast: choice.forecast, error: choice.error, deadline };
    Decision { settings: choice.settings, task: choice.task, expected }
}

/// What is assumed to be new to a device that nothing is known of: every live frame, and no background.
pub(super) fn usual_pending(state: &videofields_picture::fuse::SceneState, plan: &Plan) -> Pending {
    let bytes = |idx: &usize| {
        let image = &state.cameras[*idx].observation.frame.image;
        u64::from(image.width()) * u64::from(image.height()) * 5 / 2
    };
    Pending { upload_bytes: plan.entity_cameras.iter().map(bytes).sum(), ..Pending::default() }
}
