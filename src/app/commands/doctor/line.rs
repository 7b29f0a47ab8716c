//! A line of what was found.

use serde::Serialize;
use std::fmt;

/// How it is. Its number is the exit status.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Level {
    Ok = 0,
    Warning = 1,
    Problem = 2,
}

/// What was found of a subject.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Line {
    pub(super) level: Level,
    subject: &'static str,
    what: String,
    why: Option<String>,
    to_do: Option<String>,
}

impl Line {
    pub(super) const fn ok(subject: &'static str, what: String) -> Self {
        Self { level: Level::Ok, subject, what, why: None, to_do: None }
    }

    pub(super) fn warning(subject: &'static str, what: String, why: impl Into<String>) -> Self {
        Self { level: Level::Warning, subject, what, why: Some(why.into()), to_do: None }
    }

    pub(super) fn problem(subject: &'static str, what: String, why: impl Into<String>) -> Self {
        Self { level: Level::Problem, ..Self::warning(subject, what, why) }
    }

    /// The same with what helps.
    pub(super) fn do_this(self, what: impl Into<String>) -> Self {
        Self { to_do: Some(what.into()), ..self }
    }
}

impl fmt::Display for Line {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let level = match self.level {
            Level::Ok => "ok",
            Level::Warning => "warning",
            Level::Problem => "problem",
        };
        write!(formatter, "{level:<8} {:<13} {}", self.subject, self.what)?;
        if let Some(why) = &self.why {
            write!(formatter, ": {why}")?;
        }
        if let Some(to_do) = &self.to_do {
            write!(formatter, "\n{:<23}to do: {to_do}", "")?;
        }
        Ok(())
    }
}
