//! The report as Markdown, for people.

use super::{Measurement, Part, Report};
use std::fmt::Write as _;
use videofields_picture::plan::Spread;

/// Returns the whole report.
pub(super) fn markdown(report: &Report) -> String {
    let mut text = format!("# What {} draws how fast\n\n", report.device.name);
    if report.device.is_software {
        text += "**This device draws on the processor: a software rasteriser, no graphics card. Its figures say nothing of one.**\n\n";
    }
    if report.is_small {
        text += "Sizes are the small ones.\n\n";
    }
    let device = &report.device;
    let lines = [
        ("Device", device.name.clone()),
        ("Driver", format!("{} {}", device.driver, device.driver_version)),
        ("Processor", format!("{}, {} processors", report.machine.processor, report.machine.n_processors)),
        ("Program", format!("videofields-lab {}, {}", report.machine.version, report.machine.build)),
        ("Begun", report.begun_at.clone()),
        ("Time", format!("at most {} minutes", report.minutes)),
        (
            "Copies from buffer to buffer",
            device
                .copies_bytes_per_second
                .map_or("not measured".to_owned(), |of| format!("{:.1} GB/s", of * 1e-9)),
        ),
        (
            "Times of passes",
            if device.tells_times { "by the device's own clock" } else { "not told by the device" }
                .to_owned(),
        ),
    ];
    text += "| | |\n| --- | --- |\n";
    for (name, value) in lines {
        row(&mut text, &[name, &value]);
    }
    text += "\nMedians with quartiles, milliseconds. Pictures a second are by the device's time where it tells it.\n";
    if !device.is_software {
        text += "Before each picture the device computes something else for as long as the last one took, but before small views from \
                 anywhere: cards lower their clocks while they wait. Beside a daemon that draws seldom they are lower.\n";
    }
    for of in &report.parts {
        text += &section(of);
    }
    text
}

fn row(text: &mut String, cells: &[&str]) {
    // A string takes all that is written to it.
    let _written = writeln!(text, "| {} |", cells.join(" | "));
}

fn section(part: &Part) -> String {
    let mut text = format!("\n## {}\n\n{}, {:.1} s.", part.title, part.state, part.took_secs);
    if let Some(reason) = &part.reason {
        text += &format!(" {reason}.");
    }
    if let Some(n_bytes) = part.memory_bytes {
        text += &format!(" {:.1} MB of the device's memory held.", n_bytes as f64 * 1e-6);
    }
    if let Some(clocks) = &part.clocks {
        text += &format!(" {clocks}");
    }
    text += "\n";
    if !part.measurements.is_empty() {
        let has_paper = part.measurements.iter().any(|of| of.paper_fps.is_some());
        let has_limit = part.measurements.iter().any(|of| of.limited_by.is_some());
        let mut head = vec!["what", "device, ms", "whole, ms", "a second"];
        head.extend(has_paper.then_some("the paper's"));
        head.extend(has_limit.then_some("limited by"));
        text += "\n";
        row(&mut text, &head);
        row(&mut text, &vec!["---"; head.len()]);
        for of in &part.measurements {
            let mut cells = vec![
                of.name.clone(),
                of.device_ms.as_ref().map_or("-".to_owned(), spread),
                spread(&of.whole_ms),
                format!("{:.1}", of.fps()),
            ];
            cells.extend(has_paper.then(|| of.paper_fps.map_or("-".to_owned(), |fps| format!("{fps:.1}"))));
            cells.extend(has_limit.then(|| of.limited_by.clone().unwrap_or_default()));
            row(&mut text, &cells.iter().map(String::as_str).collect::<Vec<_>>());
        }
        text += &passes(&part.measurements);
    }
    for note in &part.notes {
        text += &format!("\n{note}\n");
    }
    text
}

/// A table of the passes' medians, where there are several.
fn passes(measurements: &[Measurement]) -> String {
    let mut names: Vec<&str> =
        measurements.iter().flat_map(|of| of.passes_ms.keys().map(String::as_str)).collect();
    names.sort_unstable();
    names.dedup();
    if names.is_empty() {
        return String::new();
    }
    let mut text =
        "\nPasses, ms; beneath them GB/s of what they load, store and resolve, at least:\n\n".to_owned();
    row(&mut text, &[&["what"], names.as_slice()].concat());
    row(&mut text, &vec!["---"; names.len() + 1]);
    for of in measurements {
        let cell = |name: &&str| {
            let Some(spread) = of.passes_ms.get(*name) else { return "-".to_owned() };
            let moved = of.passes_moved_bytes.get(*name).filter(|_| spread.median > 0.0);
            let speed = moved.map(|n| format!("<br>{:.1}", *n as f64 * 1e-6 / spread.median));
            format!("{:.3}{}", spread.median, speed.unwrap_or_default())
        };
        let cells: Vec<String> = std::iter::once(of.name.clone()).chain(names.iter().map(cell)).collect();
        row(&mut text, &cells.iter().map(String::as_str).collect::<Vec<_>>());
    }
    text
}

fn spread(of: &Spread) -> String {
    format!("{:.2} ({:.2} to {:.2})", of.median, of.lower_quartile, of.upper_quartile)
}
