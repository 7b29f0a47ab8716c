//! What callers met: answers, how long they took, refusals and failures.

use super::client::Answer;
use anyhow::{Context as _, Result};
use std::time::Duration;

/// What one caller or all of them met.
#[derive(Debug, Default)]
pub(super) struct Figures {
    /// For how long it was measured.
    over: Duration,
    /// Of each good answer.
    took: Vec<Duration>,
    n_bytes: u64,
    /// Answers of another status than 200.
    n_refused: u64,
    /// Connections and answers that broke off.
    n_failed: u64,
}

impl Figures {
    /// Nothing yet, to be told over that time.
    pub(super) fn of(over: Duration) -> Self {
        Self { over, ..Self::default() }
    }

    /// Notes what came of a question.
    pub(super) fn note(&mut self, answer: &Result<Answer>, took: Duration) {
        match answer {
            Ok(answer) if answer.status == 200 => {
                self.took.push(took);
                self.n_bytes += answer.body.len() as u64;
            }
            Ok(_) => self.n_refused += 1,
            Err(_) => self.n_failed += 1,
        }
    }

    /// Takes another caller's in.
    pub(super) fn add(&mut self, other: Self) {
        self.took.extend(other.took);
        self.n_bytes += other.n_bytes;
        self.n_refused += other.n_refused;
        self.n_failed += other.n_failed;
    }

    /// Columns of the table: answers and MiB a second, milliseconds in the median, of 99 in a hundred and at most, refused
    /// and failed.
    pub(super) fn columns(&self) -> String {
        let mut sorted = self.took.clone();
        sorted.sort_unstable();
        let ms = |share: f64| {
            let place = (sorted.len().saturating_sub(1) as f64 * share).round() as usize;
            sorted
                .get(place)
                .map_or_else(|| "-".to_owned(), |took| format!("{:.1}", took.as_secs_f64() * 1e3))
        };
        let secs = self.over.as_secs_f64().max(1e-9);
        format!(
            "{:.1} | {:.2} | {} | {} | {} | {} | {}",
            sorted.len() as f64 / secs,
            self.n_bytes as f64 / secs / f64::from(1 << 20),
            ms(0.5),
            ms(0.99),
            ms(1.0),
            self.n_refused,
            self.n_failed
        )
    }
}

/// The memory that a process holds, MiB.
pub(super) fn resident_mib(pid: u32) -> Result<u64> {
    let path = format!("/proc/{pid}/status");
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {path}"))?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kib = line.and_then(|line| line.trim().strip_suffix(" kB")).and_then(|kib| kib.parse::<u64>().ok());
    Ok(kib.with_context(|| format!("{path} does not tell VmRSS"))? >> 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_answers_are_told_by_their_order() {
        let mut all = Figures::of(Duration::from_secs(10));
        for number in (1..=100).rev() {
            let mut one = Figures::default();
            let answer = Ok(Answer { status: 200, body: vec![0; 104_858].into(), wall_frame: None });
            one.note(&answer, Duration::from_millis(number));
            all.add(one);
        }
        let refused = Ok(Answer { status: 503, body: Default::default(), wall_frame: None });
        all.note(&refused, Duration::from_secs(9));
        all.note(&Err(anyhow::anyhow!("cut off")), Duration::from_secs(9));
        assert_eq!(all.columns(), "10.0 | 1.00 | 51.0 | 99.0 | 100.0 | 1 | 1");
        assert_eq!(Figures::of(Duration::ZERO).columns(), "0.0 | 0.00 | - | - | - | 0 | 0");
    }
}
