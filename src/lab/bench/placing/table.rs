//! Results of placing: a line for each world or recording and kind of figure, as a Markdown table and as JSON.

use super::judge::{Judge, Kind};
use super::score::PlacingFigures;
use crate::entities::EntityScore;
use anyhow::Result;
use serde::Serialize;
use std::io::Write;
use videofields_vision::measures::quantile;

/// Result of one world or recording.
#[derive(Debug, Serialize)]
pub(super) struct Outcome {
    /// Its name, or its folder.
    pub(super) name: String,
    pub(super) n_cameras: usize,
    pub(super) n_instants: usize,
    /// Time of placing an instant: mean and 95 % point, milliseconds.
    pub(super) placing_ms: [f64; 2],
    pub(super) kinds: Vec<KindOutcome>,
    /// Counts by the pixels that entities show; absent where it is not known whose these are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) entities: Option<EntityOutcome>,
}

/// Figures of one kind.
#[derive(Debug, Serialize)]
pub(super) struct KindOutcome {
    pub(super) kind: Kind,
    /// Mean number of those who count, over the instants.
    pub(super) mean_count: f64,
    #[serde(flatten)]
    pub(super) figures: PlacingFigures,
}

/// Counts of [`EntityScore`].
#[derive(Debug, Serialize)]
pub(super) struct EntityOutcome {
    #[serde(skip)]
    score: EntityScore,
    n_seen: usize,
    n_missed: usize,
    n_seen_twice: usize,
    n_duplicates: usize,
    n_possible: usize,
    n_parted: usize,
    n_switches: usize,
    n_mixed: usize,
    n_ghosts: usize,
    /// Mean, 95 % point and largest.
    place_error_m: Option<[f64; 3]>,
}

impl From<EntityScore> for EntityOutcome {
    fn from(score: EntityScore) -> Self {
        Self {
            n_seen: score.n_seen,
            n_missed: score.n_missed,
            n_seen_twice: score.n_seen_twice,
            n_duplicates: score.n_duplicates,
            n_possible: score.n_possible,
            n_parted: score.n_parted,
            n_switches: score.n_switches,
            n_mixed: score.n_mixed,
            n_ghosts: score.n_ghosts,
            place_error_m: score.place_error_m(),
            score,
        }
    }
}

impl Outcome {
    pub(super) fn of(name: &str, n_cameras: usize, judge: &Judge<'_>, entities: Option<EntityScore>) -> Self {
        let mut placing_ms = judge.placing_ms().to_vec();
        placing_ms.sort_by(f64::total_cmp);
        let mean_ms = placing_ms.iter().sum::<f64>() / placing_ms.len().max(1) as f64;
        let most_ms = quantile(&placing_ms, 0.95);
        let kind = |(kind, score): (&Kind, &super::score::PlacingScore)| {
            let figures = score.figures();
            let mean_count = figures.n_true as f64 / judge.n_instants().max(1) as f64;
            KindOutcome { kind: *kind, mean_count, figures }
        };
        Self {
            name: name.to_owned(),
            n_cameras,
            n_instants: judge.n_instants(),
            placing_ms: [mean_ms, most_ms],
            kinds: judge.scores().iter().map(kind).collect(),
            entities: entities.map(EntityOutcome::from),
        }
    }
}

/// Writes both tables.
pub(super) fn write_tables(out: &mut impl Write, outcomes: &[Outcome]) -> Result<()> {
    let heads = [
        "MODA",
        "MODP",
        "IDF1",
        "switches",
        "missed",
        "false",
        "of",
        "place: mean, m",
        "95 %, m",
        "count error",
        "placing: mean, ms",
        "95 %, ms",
    ];
    writeln!(out, "| world | cameras | who | at once | {} |", heads.join(" | "))?;
    writeln!(out, "| --- | ---: | --- | ---: |{}", " ---: |".repeat(heads.len()))?;
    for outcome in outcomes {
        for KindOutcome { kind, mean_count, figures } in &outcome.kinds {
            let share = |value: Option<f64>, digits: usize| {
                value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
            };
            let [mean_m, most_m] = [0, 1].map(|of| figures.place_error_m.map(|error_m| error_m[of]));
            let cells = [
                share(figures.moda, 3),
                share(figures.modp, 3),
                share(figures.idf1, 3),
                figures.n_switches.to_string(),
                figures.n_missed.to_string(),
                figures.n_false.to_string(),
                figures.n_true.to_string(),
                share(mean_m, 3),
                share(most_m, 3),
                share(figures.count_error, 2),
                format!("{:.2}", outcome.placing_ms[0]),
                format!("{:.2}", outcome.placing_ms[1]),
            ];
            writeln!(
                out,
                "| {} | {} | {} | {mean_count:.1} | {} |",
                outcome.name,
                outcome.n_cameras,
                kind.plural(),
                cells.join(" | ")
            )?;
        }
    }
    let judged = || outcomes.iter().filter_map(|outcome| Some((outcome, outcome.entities.as_ref()?)));
    if judged().next().is_none() {
        return Ok(());
    }
    writeln!(out, "\n| world | {} |", EntityScore::HEADS.join(" | "))?;
    writeln!(out, "| --- |{}", " ---: |".repeat(EntityScore::HEADS.len()))?;
    for (outcome, entities) in judged() {
        writeln!(out, "| {} | {} |", outcome.name, entities.score.cells().join(" | "))?;
    }
    Ok(())
}
