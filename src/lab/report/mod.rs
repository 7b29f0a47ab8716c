//! The report: `report.json`, one CSV a stage, and one HTML page that needs nothing else.
//!
//! What a sweep found goes in, files come out. Knows nothing of how it was measured.

mod csv;
mod page;
mod plot;

pub use plot::{Figure, Point, Series, figure_page};

use crate::unjudged::Unjudged;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use videofields::accuracy::{Example, Skipped, Stage, Sweep};
use videofields_picture::plan::{CostRow, CostTable, Machine};
use videofields_vision::encode::EncodeError;
use videofields_vision::error::ErrorKind;

/// Version of `report.json`.
pub const REPORT_VERSION: u32 = 1;

/// What was measured, of what, on what. As JSON, this is `report.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`REPORT_VERSION`].
    pub version: u32,
    /// Of what.
    pub subject: SubjectReport,
    /// On which machine.
    pub machine: Machine,
    /// When the measuring ended, RFC 3339.
    pub measured_at: String,
    /// What it took, seconds.
    pub took_secs: f64,
    /// Whether everything asked for was measured.
    pub is_complete: bool,
    /// One entry a stage that was swept.
    pub stages: Vec<StageReport>,
    /// Settings that were not measured, and why.
    pub skipped: Vec<Skipped>,
    /// Whole pipelines that no other beats, by rising cost: their values in the stage `pipeline`.
    pub front: Vec<String>,
    /// The front's knee, where more time begins to buy little.
    pub knee: Option<String>,
    /// What takes the place of errors where there is no truth.
    pub without_truth: Option<Unjudged>,
}

/// What was looked at.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubjectReport {
    /// `world` (simulated, with exact truth) or `scene` (live, without).
    pub kind: String,
    /// Its id.
    pub id: String,
    /// What errors are errors against, in a sentence.
    pub truth: String,
    /// How much of it was looked at, in a sentence.
    pub scope: String,
}

/// One stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageReport {
    /// Its name.
    pub name: String,
    /// What `error` of its rows is, with the unit.
    pub error: String,
    /// What `time_ms` of its rows is of.
    pub work: String,
    /// One row a setting.
    pub rows: Vec<CostRow>,
}

/// Why a report could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file or folder could not be written.
    #[error("cannot write: {source}: {}", path.display())]
    File {
        /// Which one.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The report could not be put into words.
    #[error("cannot write the report as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A picture could not be encoded.
    #[error(transparent)]
    Picture(#[from] EncodeError),
    /// A plot could not be drawn.
    #[error("cannot draw a plot: {0}")]
    Plot(String),
}

impl ReportError {
    /// What the caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        ErrorKind::Internal
    }
}

impl Report {
    /// The report of a sweep.
    #[must_use]
    pub fn new(
        subject: SubjectReport,
        machine: Machine,
        sweep: &Sweep,
        measured_at: String,
        took_secs: f64,
    ) -> Self {
        let label = |idx: &usize| sweep.rows.get(*idx).map(|row| row.value.clone());
        Self {
            version: REPORT_VERSION,
            subject,
            machine,
            measured_at,
            took_secs,
            is_complete: sweep.is_complete,
            stages: stages(&sweep.rows),
            skipped: sweep.skipped.clone(),
            front: sweep.front.iter().filter_map(label).collect(),
            knee: sweep.knee.as_ref().and_then(label),
            without_truth: None,
        }
    }

    /// The same as a daemon's table.
    #[must_use]
    pub fn into_table(self) -> CostTable {
        CostTable {
            version: videofields_picture::plan::COST_TABLE_VERSION,
            machine: self.machine,
            subject: format!("{} {}", self.subject.kind, self.subject.id),
            measured_at: self.measured_at,
            took_secs: self.took_secs,
            is_complete: self.is_complete,
            rows: self.stages.into_iter().flat_map(|stage| stage.rows).collect(),
        }
    }

    /// A stage's rows.
    #[must_use]
    pub fn stage(&self, stage: Stage) -> Option<&StageReport> {
        self.stages.iter().find(|found| found.name == stage.name())
    }

    /// Writes `report.json`, `<stage>.csv` and `index.html` into `folder`, which is made if it is not there; their
    /// paths.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &Path, examples: &[Example]) -> Result<Vec<PathBuf>, ReportError> {
        std::fs::create_dir_all(folder)
            .map_err(|source| ReportError::File { path: folder.to_owned(), source })?;
        let mut written = Vec::new();
        let mut write = |name: &str, text: String| {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(|source| ReportError::File { path: path.clone(), source })?;
            written.push(path);
            Ok::<_, ReportError>(())
        };
        write("report.json", serde_json::to_string_pretty(self)? + "\n")?;
        for stage in &self.stages {
            write(&format!("{}.csv", stage.name), csv::table(&stage.rows))?;
        }
        write("index.html", page::html(self, examples)?)?;
        Ok(written)
    }
}

fn stages(rows: &[CostRow]) -> Vec<StageReport> {
    let of = |stage: Stage| StageReport {
        name: stage.name().to_owned(),
        error: stage.error_name().to_owned(),
        work: stage.work().to_owned(),
        rows: rows.iter().filter(|row| row.stage == stage.name()).cloned().collect(),
    };
    Stage::ALL.map(of).into_iter().filter(|stage| !stage.rows.is_empty()).collect()
}
