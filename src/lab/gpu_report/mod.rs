//! `gpu-report`: what this device draws how fast, part after part, within minutes; as JSON and as Markdown.
//!
//! | file | what |
//! | --- | --- |
//! | `timed` | draws pictures until a time is over, and what limits them |
//! | `views` | the views of "Video Fields" 2016, surfaces over cameras, effects |
//! | `hulls` | visual hulls by every method |
//! | `fields` | texture fields of a mesh that changes |
//! | `uploads` | pictures of cameras that come anew |
//! | `shading` | surfaces by fragments and by threads that compute |
//! | `soundness` | views from anywhere |
//! | `equality` | the tests of whatever draws, on this device |
//! | `load` | keeps the device busy before a picture is timed |
//! | `clocks` | the device's clocks meanwhile |
//! | `written` | the report as Markdown |
//!
//! The most telling part comes first. Each has its share of the time that is left, and ends by itself; the report is written after
//! every part, and a part that fails is told and ends no other.

mod clocks;
mod equality;
mod fields;
mod hulls;
mod load;
mod shading;
mod soundness;
mod timed;
mod uploads;
mod views;
mod written;

use anyhow::{Context as _, Result};
use serde::Serialize;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::time::Duration;
use videofields::accuracy::machine;
use videofields::commands::{complain, say};
use videofields_picture::plan::{Machine, Spread};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_render::gpu::Gpu;
use videofields_vision::clock::{Clock as _, SystemClock};

/// Version of `gpu-report.json`.
const VERSION: u32 = 1;

/// Measures what this device draws how fast, and writes gpu-report.json and gpu-report.md.
///
/// Nothing else should use the device or the processor meanwhile. On a device that draws on the processor sizes are smaller, and the
/// report says so.
#[derive(Debug, clap::Args)]
pub(crate) struct GpuReport {
    /// Longest that all parts together take.
    #[arg(long, value_name = "MINUTES", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=240))]
    minutes: u32,
    /// The folder to write to; made if it is not there.
    #[arg(long, value_name = "DIR", default_value = ".")]
    out: PathBuf,
    /// Part of the adapter's name; the first there is if absent.
    #[arg(long, value_name = "NAME", default_value = "")]
    adapter: String,
    /// Parts by name, with commas between; all if absent.
    #[arg(long, value_name = "PARTS", value_delimiter = ',', value_parser = known_part)]
    parts: Vec<String>,
    /// Measures the small sizes that devices which draw on the processor get.
    #[arg(long)]
    small: bool,
}

/// Holds what was measured, and on which machine and device. As JSON, this is gpu-report.json.
#[derive(Debug, Serialize)]
struct Report {
    version: u32,
    machine: Machine,
    device: Device,
    /// Time at which the report was begun, RFC 3339.
    begun_at: String,
    /// Longest that it may take, minutes.
    minutes: u32,
    /// Says that sizes are the small ones of devices that draw on the processor.
    is_small: bool,
    parts: Vec<Part>,
}

/// The device, in its driver's words.
#[derive(Debug, Serialize)]
struct Device {
    name: String,
    driver: String,
    driver_version: String,
    /// Says that it draws on the processor.
    is_software: bool,
    /// Says that it tells how long passes take; else times are of whole pictures alone.
    tells_times: bool,
    /// Bytes a second that it copies from buffer to buffer, read and written each once; none where that failed.
    copies_bytes_per_second: Option<f64>,
}

/// One part of the report.
#[derive(Debug, Serialize)]
struct Part {
    name: &'static str,
    title: &'static str,
    /// `done`, `cut short` (its time was over before it had everything) or `failed`.
    state: &'static str,
    /// Why it failed.
    reason: Option<String>,
    took_secs: f64,
    /// The device's clocks meanwhile; none where nothing tells them.
    clocks: Option<clocks::Clocks>,
    /// Bytes of the device's memory that were held at its end; none where nothing tells.
    memory_bytes: Option<u64>,
    measurements: Vec<Measurement>,
    /// Sentences beneath the table.
    notes: Vec<String>,
}

/// Pictures of one kind.
#[derive(Clone, Debug, Serialize)]
struct Measurement {
    name: String,
    /// Milliseconds that the device spent in all passes of one picture; none where it cannot tell.
    device_ms: Option<Spread>,
    /// Milliseconds from asking for a picture until its pixels are back.
    whole_ms: Spread,
    /// Milliseconds of each pass.
    passes_ms: BTreeMap<String, Spread>,
    /// Bytes that each pass of one picture moves at least, between its attachments and memory.
    passes_moved_bytes: BTreeMap<String, u64>,
    /// Pictures a second that a paper tells of the same on the hardware of its day.
    paper_fps: Option<f64>,
    /// Names what most of the time goes into, with the figure that says so.
    limited_by: Option<String>,
}

impl Measurement {
    /// Returns the milliseconds that count: the device's, or where it tells none, the whole picture's.
    fn ms(&self) -> f64 {
        self.device_ms.unwrap_or(self.whole_ms).median
    }

    fn fps(&self) -> f64 {
        1e3 / self.ms().max(1e-6)
    }
}

/// Tells when a part must end.
#[derive(Clone, Copy)]
struct Budget<'a> {
    clock: &'a SystemClock,
    until: Duration,
}

impl Budget<'_> {
    fn is_over(self) -> bool {
        self.clock.monotonic() >= self.until
    }

    /// Returns a share of what is left, 0 to 1.
    fn share(self, share: f64) -> Self {
        let left = self.until.saturating_sub(self.clock.monotonic());
        Self { until: self.clock.monotonic() + left.mul_f64(share), ..self }
    }
}

/// Holds the results of one part.
#[derive(Default)]
struct Found {
    measurements: Vec<Measurement>,
    notes: Vec<String>,
    memory_bytes: Option<u64>,
    /// Says that its time was over before it had everything.
    is_cut_short: bool,
}

/// Holds what every part needs: the adapter, sizes, and its time.
struct Stage<'a> {
    /// Part of the adapter's name, as it was asked for.
    adapter: &'a str,
    /// The adapter's whole name.
    device: &'a str,
    is_small: bool,
    copies_bytes_per_second: Option<f64>,
    budget: Budget<'a>,
}

impl Stage<'_> {
    fn gpu(&self) -> Result<Gpu> {
        Ok(Gpu::new(self.adapter)?)
    }
}

type Measure = fn(&Stage<'_>) -> Result<Found>;

/// Parts: name, title, weight among those that are still to come, by which it gets its share of the time, and what measures it.
const PARTS: [(&str, &str, f64, Measure); 9] = [
    ("views", "Views of \"Video Fields\" 2016", 4.0, views::papers),
    ("hulls", "Visual hulls of 2003 and 2004, 640 x 480 from views of 320 x 240", 4.0, hulls::measure),
    ("fields", "Texture fields of Montage4D 2019", 4.0, fields::measure),
    ("surfaces", "Surfaces over cameras and samples, beside a pass that only fills", 3.0, views::surfaces),
    ("shading", "Surfaces shaded by fragments and by threads that compute", 1.0, shading::measure),
    ("soundness", "Views from anywhere", 2.0, soundness::measure),
    ("equality", "Goldens, and twins on the processor", 6.0, equality::measure),
    ("effects", "Effects, each alone", 2.0, views::effects),
    ("uploads", "Pictures of cameras that come anew", 2.0, uploads::measure),
];

fn known_part(text: &str) -> Result<String, String> {
    let names = PARTS.map(|(name, ..)| name);
    if names.contains(&text) { Ok(text.to_owned()) } else { Err(format!("one of {}", names.join(", "))) }
}

impl GpuReport {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let clock = SystemClock::new();
        let until = clock.monotonic() + Duration::from_secs(60 * u64::from(self.minutes));
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        let gpu = Gpu::new(&self.adapter)?;
        let copies = gpu.copied_bytes_per_second(&clock);
        let device = Device {
            name: gpu.name().to_owned(),
            driver: gpu.driver().0.to_owned(),
            driver_version: gpu.driver().1.to_owned(),
            is_software: gpu.is_software(),
            tells_times: gpu.has_timestamps(),
            copies_bytes_per_second: copies.as_ref().ok().copied(),
        };
        let is_small = self.small || device.is_software;
        let mut report = Report {
            version: VERSION,
            machine: machine(gpu.name()),
            device,
            begun_at: clock.now().to_string(),
            minutes: self.minutes,
            is_small,
            parts: Vec::new(),
        };
        drop(gpu);
        let is_wanted = |name: &str| self.parts.is_empty() || self.parts.iter().any(|wanted| wanted == name);
        let parts: Vec<_> = PARTS.into_iter().filter(|(name, ..)| is_wanted(name)).collect();
        for (idx, &(name, title, weight, measure)) in parts.iter().enumerate() {
            complain(&format!("measuring {name}"));
            let begun = clock.monotonic();
            let whole = Budget { clock: &clock, until };
            let budget =
                whole.share(weight / parts[idx..].iter().map(|(_, _, weight, _)| weight).sum::<f64>());
            let sampler = clocks::Sampler::start();
            let stage = Stage {
                adapter: &self.adapter,
                device: &report.device.name,
                is_small,
                copies_bytes_per_second: report.device.copies_bytes_per_second,
                budget,
            };
            // Every part has a device of its own, so a panic leaves nothing half-changed.
            let found = catch_unwind(AssertUnwindSafe(|| measure(&stage)))
                .unwrap_or_else(|_panic| Err(anyhow::anyhow!("it panicked; the log has where")));
            let took_secs = clock.monotonic().saturating_sub(begun).as_secs_f64();
            let clocks = sampler.finish();
            report.parts.push(Part { clocks, ..part(name, title, took_secs, found) });
            self.write(&report)?;
        }
        for file in ["gpu-report.json", "gpu-report.md"] {
            say(&self.out.join(file).display().to_string())?;
        }
        Ok(())
    }

    fn write(&self, report: &Report) -> Result<()> {
        let write = |name: &str, text: String| {
            let path = self.out.join(name);
            std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
        };
        write("gpu-report.json", serde_json::to_string_pretty(report)? + "\n")?;
        write("gpu-report.md", written::markdown(report))
    }
}

fn part(name: &'static str, title: &'static str, took_secs: f64, found: Result<Found>) -> Part {
    let (state, reason, found) = match found {
        Ok(found) if found.is_cut_short => ("cut short", None, found),
        Ok(found) => ("done", None, found),
        Err(error) => ("failed", Some(format!("{error:#}")), Found::default()),
    };
    let Found { measurements, notes, memory_bytes, .. } = found;
    Part { name, title, state, reason, took_secs, clocks: None, memory_bytes, measurements, notes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_that_fails_says_why_and_one_that_is_cut_short_keeps_what_it_has() {
        let failed = part("views", "Views", 1.0, Err(anyhow::anyhow!("no memory").context("a picture")));
        assert_eq!((failed.state, failed.reason.as_deref()), ("failed", Some("a picture: no memory")));
        let found = Found { notes: vec!["half".to_owned()], is_cut_short: true, ..Found::default() };
        let short = part("views", "Views", 1.0, Ok(found));
        assert_eq!((short.state, short.notes.len(), short.reason), ("cut short", 1, None));
    }

    #[test]
    fn only_known_parts_are_taken() {
        assert!(known_part("hulls").is_ok());
        assert!(known_part("hull").unwrap_err().contains("hulls"));
    }
}
