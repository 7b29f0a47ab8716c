//! Draws pictures again and again until a time is over; and what limits them.

use super::load::Load;
use super::{Budget, Found, Measurement, Stage};
use anyhow::{Context as _, Result};
use std::collections::BTreeMap;
use std::time::Duration;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{Picture, Plan, Spread};
use videofields_render::Renderer;
use videofields_render::gpu::{Count, Counted, PassTime};
use videofields_vision::clock::Clock as _;

/// Turns after which a case is left alone, and at which a median begins to mean something.
const MOST_TURNS: usize = 201;
const LEAST_TURNS: usize = 5;

/// Pictures of one kind that are drawn: several where one frame of it is several pictures.
pub(super) struct Case {
    pub(super) name: String,
    pub(super) state: SceneState,
    pub(super) pictures: Vec<(Picture, Plan)>,
    pub(super) paper_fps: Option<f64>,
}

/// Times of one kind.
#[derive(Default)]
pub(super) struct Times {
    passes: Vec<(&'static str, Vec<f64>)>,
    device: Vec<f64>,
    whole: Vec<f64>,
    /// Bytes that the passes of one picture move at least, by label.
    moved: BTreeMap<&'static str, u64>,
}

impl Times {
    /// Takes the bytes that the passes of one picture moved from the device's counts before and after it.
    pub(super) fn count(&mut self, before: &[Count], after: &[Count]) {
        let of = |counts: &[Count], label| {
            counts
                .iter()
                .find(|count| (count.what, count.label) == (Counted::Pass, label))
                .map_or(0, |of| of.n_bytes)
        };
        let labels = after.iter().filter(|count| count.what == Counted::Pass).map(|count| count.label);
        self.moved = labels
            .map(|label| (label, of(after, label) - of(before, label)))
            .filter(|(_, n)| *n > 0)
            .collect();
    }

    /// Returns whether there are too few for a median.
    pub(super) fn is_short(&self) -> bool {
        self.whole.len() < LEAST_TURNS
    }

    pub(super) fn add(&mut self, timings: &[PassTime], whole: Duration) {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        let mut sums: Vec<(&'static str, f64)> = Vec::new();
        for time in timings {
            match sums.iter_mut().find(|(pass, _)| *pass == time.pass) {
                Some((_, sum)) => *sum += ms(time.gpu),
                None => sums.push((time.pass, ms(time.gpu))),
            }
        }
        if !sums.is_empty() {
            self.device.push(sums.iter().map(|(_, sum)| sum).sum());
        }
        for (pass, sum) in sums {
            match self.passes.iter_mut().find(|(of, _)| *of == pass) {
                Some((_, all)) => all.push(sum),
                None => self.passes.push((pass, vec![sum])),
            }
        }
        self.whole.push(ms(whole));
    }

    pub(super) fn len(&self) -> usize {
        self.whole.len()
    }

    /// Returns what they come to; none without any.
    pub(super) fn measurement(&self, name: String, paper_fps: Option<f64>) -> Option<Measurement> {
        let passes_ms: BTreeMap<String, Spread> = self
            .passes
            .iter()
            .filter_map(|(pass, all)| Some(((*pass).to_owned(), Spread::of(all)?)))
            .collect();
        Some(Measurement {
            name,
            device_ms: Spread::of(&self.device),
            whole_ms: Spread::of(&self.whole)?,
            passes_ms,
            passes_moved_bytes: self.moved.iter().map(|(pass, n)| ((*pass).to_owned(), *n)).collect(),
            paper_fps,
            limited_by: None,
        })
    }
}

/// Draws one case after the other, each in its share of the time, until it was drawn often enough. The first picture of a case, which
/// makes programs and uploads pictures, is not counted; cases that took turns would upload theirs again and again.
pub(super) fn again_and_again(
    renderer: &mut Renderer,
    cases: &[Case],
    (stage, budget): (&Stage<'_>, Budget<'_>),
) -> Result<Found> {
    let clock = budget.clock;
    let load = Load::new(renderer.gpu());
    let mut found = Found::default();
    for (idx, case) in cases.iter().enumerate() {
        if budget.is_over() {
            found.is_cut_short = true;
            break;
        }
        let own = budget.share(1.0 / (cases.len() - idx) as f64);
        let mut times = Times::default();
        let mut last = Duration::ZERO;
        load.first(renderer.gpu(), stage)?;
        for turn in 0..=MOST_TURNS {
            if turn > 1 && own.is_over() {
                break;
            }
            load.between(renderer.gpu(), stage, last)?;
            let begun = clock.monotonic();
            let mut timings = Vec::new();
            let before = renderer.gpu().counts();
            for (picture, plan) in &case.pictures {
                let rendered = renderer.render(&case.state, picture, plan);
                timings.extend(rendered.with_context(|| case.name.clone())?.timings);
            }
            last = clock.monotonic().saturating_sub(begun);
            if turn > 0 {
                times.add(&timings, last);
                times.count(&before, &renderer.gpu().counts());
            }
        }
        found.is_cut_short |= times.is_short();
        found.measurements.extend(times.measurement(case.name.clone(), case.paper_fps));
    }
    found.memory_bytes = renderer.gpu().memory_bytes();
    Ok(found)
}

/// Holds what a headline figure is compared with: the same state as a picture of few pixels, and bytes that a picture moves at least.
pub(super) struct Against {
    /// Milliseconds of the same passes over 16 x 16 pixels: what they take whatever the size.
    pub(super) least_ms: f64,
    /// Pixels of a picture: each is read and written once more when the picture is copied.
    pub(super) n_pixels: f64,
}

/// Says what most of a picture's time goes into, by the figure that says so.
pub(super) fn limited_by(measurement: &Measurement, against: &Against, stage: &Stage<'_>) -> String {
    let Some(device) = measurement.device_ms else {
        return "not told: the device does not say how long passes take".to_owned();
    };
    let (device_ms, whole_ms) = (device.median, measurement.whole_ms.median);
    if whole_ms > 2.0 * device_ms {
        let back_ms = whole_ms - device_ms;
        return format!("readback and waiting: {back_ms:.2} of {whole_ms:.2} ms lie outside of all passes");
    }
    let fixed_share = against.least_ms / device_ms.max(1e-6);
    if fixed_share > 0.5 {
        let longest = measurement.passes_ms.iter().max_by(|a, b| a.1.median.total_cmp(&b.1.median));
        let longest = longest
            .map(|(pass, of)| format!(", most of it is {pass}, {:.2} ms", of.median))
            .unwrap_or_default();
        return format!(
            "passes: {:.0} % of their time stays at 16 x 16 pixels{longest}",
            100.0 * fixed_share
        );
    }
    let moved = measurement.passes_moved_bytes.values().sum::<u64>() as f64 + 8.0 * against.n_pixels;
    let achieved = moved / (device_ms.max(1e-6) * 1e-3);
    match stage.copies_bytes_per_second {
        Some(most) if achieved > 0.5 * most => {
            format!("bandwidth: {:.1} GB/s of the {:.1} GB/s that copies reach", achieved * 1e-9, most * 1e-9)
        }
        Some(most) => format!(
            "occupancy and arithmetic: attachments and copies alone move {:.1} of {:.1} GB/s, and {:.0} % of the time stays at 16 x 16 pixels",
            achieved * 1e-9,
            most * 1e-9,
            100.0 * fixed_share
        ),
        None => "not told: how fast the device copies is not known".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::clock::SystemClock;

    fn measured(device_ms: f64, whole_ms: f64) -> Measurement {
        let mut times = Times::default();
        let secs = |secs: f64| Duration::try_from_secs_f64(secs).unwrap();
        let gpu = secs(device_ms * 0.5e-3);
        for _ in 0..5 {
            let passes = [PassTime { pass: "surface", gpu }, PassTime { pass: "surface", gpu }];
            times.add(&passes, secs(whole_ms * 1e-3));
        }
        times.measurement("view".to_owned(), None).unwrap()
    }

    #[test]
    fn spans_of_one_pass_are_added_up() {
        let measured = measured(4.0, 5.0);
        assert!((measured.device_ms.unwrap().median - 4.0).abs() < 1e-6);
        assert!((measured.passes_ms["surface"].median - 4.0).abs() < 1e-6);
        assert!((measured.fps() - 250.0).abs() < 1e-3);
    }

    #[test]
    fn bytes_of_passes_are_those_of_one_picture() {
        let count = |what, label, n_bytes| Count { what, label, n: 1, n_bytes };
        let before = [count(Counted::Buffer, "surface", 7), count(Counted::Pass, "surface", 100)];
        let after = [
            count(Counted::Buffer, "surface", 9),
            count(Counted::Pass, "sky", 4),
            count(Counted::Pass, "surface", 160),
        ];
        let mut times = Times::default();
        times.add(&[], Duration::from_millis(1));
        times.count(&before, &after);
        let moved = times.measurement(String::new(), None).unwrap().passes_moved_bytes;
        assert_eq!(moved, BTreeMap::from([("sky".to_owned(), 4), ("surface".to_owned(), 60)]));
    }

    #[test]
    fn each_limit_is_told_by_its_figure() {
        let clock = SystemClock::new();
        let stage = |copies| Stage {
            adapter: "",
            device: "",
            is_small: true,
            copies_bytes_per_second: copies,
            budget: Budget { clock: &clock, until: Duration::ZERO },
        };
        let told = |device, whole, least_ms, n_bytes, copies| {
            limited_by(
                &measured(device, whole),
                &Against { least_ms, n_pixels: n_bytes / 8.0 },
                &stage(copies),
            )
        };
        assert!(told(1.0, 3.0, 0.1, 1e3, Some(1e9)).starts_with("readback"));
        let passes = told(1.0, 1.5, 0.6, 1e3, Some(1e9));
        assert_eq!(
            passes,
            "passes: 60 % of their time stays at 16 x 16 pixels, most of it is surface, 1.00 ms"
        );
        // 8 MB in 10 ms are 0.8 GB/s.
        assert!(told(10.0, 12.0, 0.1, 8e6, Some(1e9)).starts_with("bandwidth: 0.8 GB/s of the 1.0"));
        assert!(told(10.0, 12.0, 0.1, 4e6, Some(1e9)).starts_with("occupancy"));
        assert!(told(10.0, 12.0, 0.1, 4e6, None).starts_with("not told"));
    }
}
