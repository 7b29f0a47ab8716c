//! `bench vision`: the whole of vision beside decoding the same frames.

use anyhow::{Context as _, Result, ensure};
use rustix::time::{ClockId, clock_gettime};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields_picture::plan::Spread;
use videofields_recording::ingest::{self, MediaRoots, Pipeline};
use videofields_recording::telemetry::Stage;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings, SourceSettings};
use videofields_vision::frame::{CameraId, Frame, YuvImage};

/// Times the whole of vision against decoding the same frames.
///
/// Vision is all that is done with a camera's frame whether anyone looks or not: background, segmentation, tracks and
/// what is told of them, with the default settings. Both are told as CPU time of the whole process for a frame: the clip
/// is decoded, and it is decoded and looked at, in turns. Before that vision has seen the whole clip --warm-up times, as
/// a camera has been running for long.
#[derive(Debug, clap::Args)]
pub(super) struct Vision {
    /// A video file.
    #[arg(long, value_name = "FILE")]
    input: PathBuf,
    /// Times that each is run.
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
    runs: u32,
    /// Times that vision sees the clip before it is timed.
    #[arg(long, value_name = "COUNT", default_value_t = 1, value_parser = clap::value_parser!(u32).range(0..=100))]
    warm_up: u32,
}

/// A camera's pipeline, and where its scene time stands.
struct Camera {
    id: CameraId,
    pipeline: Pipeline,
    start_nanos: i64,
    n_frames: u64,
}

/// CPU time of one run for each frame, milliseconds.
struct Run {
    n_frames: u64,
    cpu_ms: f64,
    /// Time that passed on the thread that looks, by stage.
    stages_ms: [f64; Stage::ALL.len()],
}

impl Vision {
    pub(super) fn run(&self) -> Result<()> {
        let (mut decoding, mut vision, mut stages) =
            (Vec::new(), Vec::new(), vec![Vec::new(); Stage::ALL.len()]);
        let mut n_frames = 0;
        let mut camera = Camera {
            id: CameraId::new("input").context("an id")?,
            pipeline: Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default()),
            start_nanos: 0,
            n_frames: 0,
        };
        for _ in 0..self.warm_up {
            self.play(Some(&mut camera))?;
        }
        for _ in 0..self.runs {
            let decoded = self.play(None)?;
            let seen = self.play(Some(&mut camera))?;
            decoding.push(decoded.cpu_ms);
            vision.push(seen.cpu_ms - decoded.cpu_ms);
            for (all, one) in stages.iter_mut().zip(seen.stages_ms) {
                all.push(one);
            }
            n_frames = seen.n_frames;
        }
        let median = |times: &[f64]| Spread::of(times).map_or(f64::NAN, |spread| spread.median);
        let mut out = std::io::stdout().lock();
        writeln!(out, "{n_frames} frames, medians of {} runs, CPU time of a frame:", self.runs)?;
        writeln!(out, "decoding  {:.2} ms", median(&decoding))?;
        writeln!(
            out,
            "vision    {:.2} ms, {:.2} of decoding",
            median(&vision),
            median(&vision) / median(&decoding)
        )?;
        for (stage, times) in Stage::ALL.iter().zip(&stages) {
            writeln!(out, "  {:<12}{:.3} ms on the camera's thread", stage.as_str(), median(times))?;
        }
        Ok(())
    }

    /// Plays the clip once, as fast as it goes, before a camera or before nobody.
    fn play(&self, mut camera: Option<&mut Camera>) -> Result<Run> {
        let source = SourceSettings::of_path(&self.input);
        let mut frames = ingest::open(&source, &MediaRoots::of_caller(Path::new(&self.input))?)?;
        let started = cpu_ms(ClockId::ProcessCPUTime);
        let mut run = Run { n_frames: 0, cpu_ms: 0.0, stages_ms: [0.0; Stage::ALL.len()] };
        let (mut last_nanos, mut step_nanos) = (0, 40_000_000);
        while let Some(next) = frames.next_frame()? {
            run.n_frames += 1;
            if next.stream_nanos > last_nanos {
                step_nanos = next.stream_nanos - last_nanos;
            }
            last_nanos = next.stream_nanos;
            if let Some(camera) = &mut camera {
                camera.see(next.image, next.stream_nanos, &mut run.stages_ms);
            }
        }
        if let Some(camera) = camera {
            camera.start_nanos += last_nanos + step_nanos;
        }
        ensure!(run.n_frames > 0, "{} holds no frame", self.input.display());
        let n_frames = run.n_frames as f64;
        run.cpu_ms = (cpu_ms(ClockId::ProcessCPUTime) - started) / n_frames;
        run.stages_ms = run.stages_ms.map(|total| total / n_frames);
        Ok(run)
    }
}

impl Camera {
    /// Looks at a frame; adds what each stage took.
    fn see(&mut self, image: Arc<YuvImage>, stream_nanos: i64, stages_ms: &mut [f64; Stage::ALL.len()]) {
        let timestamp = Timestamp::from_nanos(self.start_nanos + stream_nanos);
        let frame = Frame { camera: self.id.clone(), timestamp, number: self.n_frames, image };
        self.n_frames += 1;
        let mut before = cpu_ms(ClockId::Monotonic);
        self.pipeline.process_staged(frame, |stage| {
            let now = cpu_ms(ClockId::Monotonic);
            let place = Stage::ALL.iter().position(|of| *of == stage);
            if let Some(total) = place.and_then(|place| stages_ms.get_mut(place)) {
                *total += now - before;
            }
            before = now;
        });
        self.pipeline.take_events();
    }
}

/// A clock's time, milliseconds.
fn cpu_ms(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}
