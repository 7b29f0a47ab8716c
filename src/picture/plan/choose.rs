//! Which settings a deadline allows: those of the least expected error whose time, were it to come out high, still fits.

use super::{Errors, Forecast, Model, Pending, Settings, Survey, Task};

/// Errors are told apart no finer, codes: of such as good ones the fastest is taken.
const SAME_ERROR: f64 = 0.02;

/// What was chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// The settings.
    pub settings: Settings,
    /// What they are to the model.
    pub task: Task,
    /// How long they take.
    pub forecast: Forecast,
    /// The error that they leave, 8-bit codes, where one was measured.
    pub error: Option<f64>,
}

/// What decides, known before anything is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Known<'a> {
    /// What the picture shows.
    pub survey: &'a Survey,
    /// What the device lacks of it.
    pub pending: Pending,
    /// How long work takes.
    pub model: &'a Model,
    /// What settings leave.
    pub errors: &'a Errors,
}

impl Known<'_> {
    /// What `settings` come to.
    #[must_use]
    pub fn choice(&self, settings: &Settings) -> Choice {
        let task = self.model.task(self.survey, settings, self.pending);
        let error = self.errors.is_measured().then(|| self.errors.expected(settings));
        Choice { settings: *settings, task, forecast: self.model.forecast(&task), error }
    }

    /// The settings of `candidates` of the least expected error the upper quartile of whose drawing fits in `most_ms`.
    ///
    /// # Errors
    /// Where none fits, the fastest there is; `None` where there are no candidates.
    pub fn within(&self, candidates: &[Settings], most_ms: f64) -> Result<Choice, Option<Forecast>> {
        let mut fastest: Option<Forecast> = None;
        let mut best: Option<(f64, Choice)> = None;
        for settings in candidates {
            let choice = self.choice(settings);
            let upper_ms = choice.forecast.upper_drawing_ms();
            if fastest.is_none_or(|fastest| upper_ms < fastest.upper_drawing_ms()) {
                fastest = Some(choice.forecast);
            }
            // What is no number fits nowhere.
            let fits = upper_ms <= most_ms;
            if !fits {
                continue;
            }
            let error = self.errors.expected(settings);
            let is_better = best.is_none_or(|(least, best)| {
                let is_as_good = (error - least).abs() <= SAME_ERROR;
                if is_as_good { choice.forecast.median_ms < best.forecast.median_ms } else { error < least }
            });
            if is_better {
                best = Some((error, choice));
            }
        }
        best.map(|(_, choice)| choice).ok_or(fastest)
    }
}
