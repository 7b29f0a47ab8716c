//! The device's clocks while a part is measured, from whatever tells them: NVIDIA's tool, or the kernel's files.

use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;
use videofields_picture::plan::Spread;

/// Time from one reading of the clocks to the next.
const EVERY: Duration = Duration::from_secs(1);

/// Clocks over the time of a part.
#[derive(Debug, Serialize)]
pub(super) struct Clocks {
    /// Names the tool or driver that told them.
    source: &'static str,
    /// Clock of the shading units, megahertz.
    graphics_mhz: Spread,
    /// Clock of the memory, megahertz; none where nothing tells it.
    memory_mhz: Option<Spread>,
}

impl fmt::Display for Clocks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { source, graphics_mhz: of, .. } = self;
        write!(f, "Clock {:.0} MHz ({:.0} to {:.0})", of.median, of.lower_quartile, of.upper_quartile)?;
        if let Some(of) = &self.memory_mhz {
            write!(f, ", memory {:.0} MHz", of.median)?;
        }
        write!(f, ", by {source}.")
    }
}

/// One reading, megahertz.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    graphics_mhz: f64,
    memory_mhz: Option<f64>,
}

/// Names a tool or a driver's file that tells clocks.
#[derive(Clone, Debug)]
enum Source {
    /// `nvidia-smi`, of the first card.
    Nvidia,
    /// A file of amdgpu that marks the clock which holds: `1: 1500Mhz *`.
    Amd(PathBuf),
    /// A file of i915 with a number.
    Intel(PathBuf),
}

impl Source {
    /// Returns the first that answers.
    fn find() -> Option<Self> {
        let mut sources = vec![Self::Nvidia];
        let cards = std::fs::read_dir("/sys/class/drm").into_iter().flatten().flatten();
        for card in cards.map(|entry| entry.path()) {
            sources.push(Self::Amd(card.join("device/pp_dpm_sclk")));
            sources.push(Self::Intel(card.join("gt_cur_freq_mhz")));
        }
        sources.into_iter().find(|source| source.read().is_some())
    }

    const fn name(&self) -> &'static str {
        match self {
            Self::Nvidia => "nvidia-smi",
            Self::Amd(_) => "amdgpu",
            Self::Intel(_) => "i915",
        }
    }

    fn read(&self) -> Option<Reading> {
        match self {
            Self::Nvidia => {
                let query = ["--query-gpu=clocks.sm,clocks.mem", "--format=csv,noheader,nounits"];
                let answer = Command::new("nvidia-smi").args(query).output().ok()?;
                nvidia(&String::from_utf8(answer.stdout).ok()?)
            }
            Self::Amd(path) => {
                let memory = std::fs::read_to_string(path.with_file_name("pp_dpm_mclk")).ok();
                Some(Reading {
                    graphics_mhz: amd(&std::fs::read_to_string(path).ok()?)?,
                    memory_mhz: memory.and_then(|text| amd(&text)),
                })
            }
            Self::Intel(path) => Some(Reading { graphics_mhz: number(path)?, memory_mhz: None }),
        }
    }
}

fn number(path: &Path) -> Option<f64> {
    std::fs::read_to_string(path).ok()?.trim().parse().ok()
}

fn nvidia(text: &str) -> Option<Reading> {
    let (graphics, memory) = text.lines().next()?.split_once(',')?;
    Some(Reading { graphics_mhz: graphics.trim().parse().ok()?, memory_mhz: memory.trim().parse().ok() })
}

fn amd(text: &str) -> Option<f64> {
    let line = text.lines().find(|line| line.trim_end().ends_with('*'))?;
    let value = line.split_once(':')?.1.trim_end_matches(['*', ' ']).trim();
    value.to_lowercase().strip_suffix("mhz")?.trim().parse().ok()
}

/// Reads clocks beside a part.
pub(super) struct Sampler {
    stop: SyncSender<()>,
    /// None where no thread could be started.
    readings: Option<JoinHandle<(Option<&'static str>, Vec<Reading>)>>,
}

impl Sampler {
    pub(super) fn start() -> Self {
        let (stop, stopped) = sync_channel(1);
        let readings = Builder::new().name("clocks".to_owned()).spawn(move || {
            let mut readings = Vec::new();
            let Some(source) = Source::find() else { return (None, readings) };
            while matches!(stopped.recv_timeout(EVERY), Err(RecvTimeoutError::Timeout)) {
                readings.extend(source.read());
            }
            (Some(source.name()), readings)
        });
        Self { stop, readings: readings.ok() }
    }

    /// Returns what was read; nothing where nobody tells clocks, or the part was over before the first reading.
    pub(super) fn finish(self) -> Option<Clocks> {
        // A thread that found nobody to ask has ended already.
        let _ended = self.stop.send(());
        let (source, readings) = self.readings?.join().ok()?;
        let graphics: Vec<f64> = readings.iter().map(|of| of.graphics_mhz).collect();
        let memory: Vec<f64> = readings.iter().filter_map(|of| of.memory_mhz).collect();
        Some(Clocks {
            source: source?,
            graphics_mhz: Spread::of(&graphics)?,
            memory_mhz: Spread::of(&memory),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_are_read_as_each_source_writes_them() {
        let expected = Reading { graphics_mhz: 1980.0, memory_mhz: Some(2619.0) };
        assert_eq!(nvidia("1980, 2619\n345, 405\n"), Some(expected));
        assert_eq!(nvidia("No devices were found\n"), None);
        assert_eq!(nvidia("[N/A], 405\n"), None);
        assert_eq!(amd("0: 500Mhz\n1: 1325Mhz *\n2: 2100Mhz\n"), Some(1325.0));
        assert_eq!(amd("0: 500Mhz\n"), None);
    }
}
