//! `bench meshes`: what texture fields of a mesh that changes cost the device, stage after stage, beside the processor's.

use anyhow::{Context as _, Result};
use glam::{DQuat, DVec2, DVec3};
use std::collections::HashMap;
use std::io::Write as _;
use std::str::FromStr as _;
use std::time::Duration;
use videofields::accuracy::machine;
use videofields_picture::plan::{FieldsForm, Followed, View, ViewLimits};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_render::gpu::{Gpu, PassTime};
use videofields_render::{Reading, SurfaceFields};
use videofields_vision::clock::{Clock as _, SystemClock, Timestamp};
use videofields_vision::config::RenderSettings;
use videofields_vision::fields::{Distances, Field, FieldSettings, Topology, View as Seen};
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::{Camera, Distortion, Pose};
use videofields_vision::mesh::Mesh;

/// Draws a bumpy ball that cameras around it see by texture fields: as another mesh in every picture, and as one that stands still
/// while the viewer goes around it. Prints the device's time of every pass, medians, and the processor's of the same.
#[derive(Debug, clap::Args)]
pub(super) struct Meshes {
    /// Triangles of the mesh, about: so many as a ball of whole rows has. Repeatable.
    #[arg(long, value_name = "COUNT", default_values = ["15000", "250000"], value_parser = clap::value_parser!(u32).range(100..=2_000_000))]
    triangles: Vec<u32>,
    /// Cameras.
    #[arg(long, value_name = "COUNT", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=64))]
    views: u32,
    /// Columns and rows of their pictures.
    #[arg(long, value_name = "PIXELS", default_value_t = 2048, value_parser = clap::value_parser!(u32).range(16..=8192))]
    side: u32,
    /// Columns of the picture; rows are nine sixteenths of them.
    #[arg(long, value_name = "PIXELS", default_value_t = 1280, value_parser = clap::value_parser!(u32).range(16..=8192))]
    width: u32,
    /// How distances from seams are found: off, marching or bounded.
    #[arg(long, value_name = "FORM", default_value = "marching", value_parser = Distances::from_str)]
    distances: Distances,
    /// How often each is drawn.
    #[arg(long, value_name = "COUNT", default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    turns: u32,
    /// Leaves the processor's times out.
    #[arg(long)]
    device_only: bool,
    /// Part of the adapter's name; the first there is if absent.
    #[arg(long, value_name = "NAME", default_value = "")]
    adapter: String,
}

/// Passes in the order in which they run, and what they do.
const PASSES: [(&str, &str); 9] = [
    ("mesh_depths", "depth maps"),
    ("fields_topology", "which faces meet"),
    ("mesh_sight", "sight, seams, distances by a front"),
    ("fields_distances", "distances by windows"),
    ("mesh_smooth", "smoothing"),
    ("mesh_colors", "colours, holes filled"),
    ("mesh_carry", "weights carried over"),
    ("mesh_weights", "weights, followed"),
    ("changing_mesh", "drawn"),
];

impl Meshes {
    pub(super) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let gpu = Gpu::new(&self.adapter)?;
        let machine = machine(gpu.name());
        let mut out = std::io::stdout().lock();
        writeln!(out, "{}, {} processors, {}", machine.processor, machine.n_processors, machine.adapter)?;
        for triangles in &self.triangles {
            self.measure(&gpu, *triangles, &mut out)?;
        }
        Ok(())
    }

    fn measure(&self, gpu: &Gpu, triangles: u32, out: &mut impl std::io::Write) -> Result<()> {
        let clock = SystemClock::new();
        let settings =
            FieldSettings { distances: self.distances, is_evened: false, ..FieldSettings::default() };
        let mut views = views_around(self.views, self.side)?;
        let mut device = SurfaceFields::new(gpu);
        let first = ball(triangles, 0.0);
        let (n_vertices, n_triangles) = (first.positions_m.len(), first.triangles.len());
        let by = |passed_secs| {
            (
                FieldsForm::Montage,
                Some(Followed { number: 0, passed_secs: Some(passed_secs), instant: Timestamp::default() }),
            )
        };
        // Programs are made by the first.
        device.give(gpu, &first, &views, &settings)?;
        device.picture(gpu, &looking(0.0, (self.width, self.height()))?, by(0.0), Reading::Picture)?;
        let (mut new, mut still) = (Times::default(), Times::default());
        for turn in 1..=self.turns {
            let mesh = ball(triangles, 0.01 * f64::from(turn));
            let at = looking(0.02 * f64::from(turn), (self.width, self.height()))?;
            let started = clock.monotonic();
            device.give(gpu, &mesh, &views, &settings)?;
            let given = clock.monotonic();
            let (picture, _) = device.picture(gpu, &at, by(0.033), Reading::Picture)?;
            new.add(&picture.timings, clock.monotonic().saturating_sub(given));
            new.given.push(given.saturating_sub(started));
        }
        for turn in 1..=self.turns {
            let at = looking(0.02 * f64::from(turn), (self.width, self.height()))?;
            let started = clock.monotonic();
            let (picture, _) = device.picture(gpu, &at, by(0.008), Reading::Picture)?;
            still.add(&picture.timings, clock.monotonic().saturating_sub(started));
        }
        let height = self.height();
        writeln!(
            out,
            "\n{n_triangles} triangles, {n_vertices} vertices, {} views of {} x {}, distances {}, a picture of {} x {height}; \
             medians of {}, milliseconds\n",
            self.views,
            self.side,
            self.side,
            self.distances.name(),
            self.width,
            self.turns
        )?;
        writeln!(out, "| pass | what | new frame | still |\n| --- | --- | ---: | ---: |")?;
        let told = |times: &Times, pass| times.pass_ms(pass).map_or("-".to_owned(), |ms| format!("{ms:.3}"));
        for (pass, what) in PASSES {
            writeln!(out, "| {pass} | {what} | {} | {} |", told(&new, pass), told(&still, pass))?;
        }
        let [new_ms, still_ms] = [&new, &still].map(Times::passes_ms);
        writeln!(out, "| all | | {new_ms:.3} | {still_ms:.3} |")?;
        writeln!(
            out,
            "\nWith handing over, waiting and reading back: {:.1} a new frame (before it {:.1} for mesh and pictures), {:.1} while it \
             stands still. By passes alone {:.1} frames a second while it stands still.",
            median_ms(&new.whole),
            median_ms(&new.given),
            median_ms(&still.whole),
            1e3 / still_ms.max(1e-6)
        )?;
        if !self.device_only {
            let started = clock.monotonic();
            let topology = Topology::of(&first.positions_m, &first.triangles);
            let field = Field::new(&first, &topology, &mut views, &settings)?;
            let made = clock.monotonic();
            let eye = looking(0.0, (self.width, self.height()))?.pose.position_in_world;
            std::hint::black_box(field.target(&first, &views, eye));
            let [field_ms, target_ms] =
                [made.saturating_sub(started), clock.monotonic().saturating_sub(made)]
                    .map(|time| time.as_secs_f64() * 1e3);
            writeln!(
                out,
                "On the processor: {field_ms:.1} to make the field, {target_ms:.1} for its weights."
            )?;
        }
        Ok(())
    }

    const fn height(&self) -> u32 {
        let rows = self.width * 9 / 16;
        if rows == 0 { 1 } else { rows }
    }
}

/// Returns what somebody sees who goes around the ball, in `size_px` columns and rows.
pub(crate) fn looking(turn: f64, size_px: (u32, u32)) -> Result<View> {
    let limits = videofields_render::view_limits(RenderSettings::default().max_pixels);
    let limits = ViewLimits { max_pixels: u64::MAX, ..limits };
    let eye = DQuat::from_rotation_z(turn) * DVec3::new(3.2, 0.6, 1.2);
    View::new(eye, DVec3::ZERO, 0.75, size_px.0, size_px.1, &limits)
        .map_err(|fault| anyhow::anyhow!("{}", fault.message))
}

/// Returns what cameras around the ball see, in pictures of so many columns and rows.
pub(crate) fn views_around(n_views: u32, side_px: u32) -> Result<Vec<Seen>> {
    (0..n_views)
        .map(|i| {
            let turn = f64::from(i) / f64::from(n_views) * std::f64::consts::TAU;
            let eye = DVec3::new(3.5 * turn.cos(), 3.5 * turn.sin(), 1.5 * (1.7 * f64::from(i)).sin());
            let pose = Pose::looking_at(eye, DVec3::ZERO).context("a camera stands in the middle")?;
            let side = f64::from(side_px);
            let (focal, center) = (DVec2::splat(1.3 * side), DVec2::splat(0.5 * side));
            let camera = Camera::new((side_px, side_px), focal, center, Distortion::None, pose)?;
            let wave = |at: u32, phase: f64| 128.0 + 90.0 * (f64::from(at) / side * 40.0 + phase).sin();
            let color = |at: u32| {
                let (x, y) = (at % side_px, at / side_px);
                [wave(x, turn), wave(y, 2.0), wave(x + y, 4.0)].map(|code| code as u8)
            };
            let data = (0..side_px * side_px).flat_map(color).collect();
            Ok(Seen::new(camera, RgbImage { width: side_px, height: side_px, data }, None))
        })
        .collect()
}

/// Times of one kind of picture.
#[derive(Default)]
struct Times {
    passes: HashMap<&'static str, Vec<Duration>>,
    whole: Vec<Duration>,
    given: Vec<Duration>,
}

impl Times {
    fn add(&mut self, timings: &[PassTime], whole: Duration) {
        self.whole.push(whole);
        let mut sums: HashMap<&'static str, Duration> = HashMap::new();
        timings.iter().for_each(|time| *sums.entry(time.pass).or_default() += time.gpu);
        sums.into_iter().for_each(|(pass, time)| self.passes.entry(pass).or_default().push(time));
    }

    fn pass_ms(&self, pass: &str) -> Option<f64> {
        self.passes.get(pass).map(|times| median_ms(times))
    }

    fn passes_ms(&self) -> f64 {
        PASSES.iter().filter_map(|(pass, _)| self.pass_ms(pass)).sum()
    }
}

fn median_ms(times: &[Duration]) -> f64 {
    let mut times = times.to_vec();
    times.sort_unstable();
    times.get(times.len() / 2).map_or(0.0, |time| time.as_secs_f64() * 1e3)
}

/// A ball with bumps that turn, of about so many triangles: rows of squares around it, two triangles each.
pub(crate) fn ball(triangles: u32, turn: f64) -> Mesh {
    let rows = (f64::from(triangles) / 4.0).sqrt().round().max(3.0) as u32;
    let columns = 2 * rows;
    let place = |row: u32, column: u32| {
        let down = std::f64::consts::PI * f64::from(row) / f64::from(rows);
        let around = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
        let at = DVec3::new(down.sin() * around.cos(), down.sin() * around.sin(), down.cos());
        let bump = 0.08 * (7.0 * around + turn * 9.0).sin() * (6.0 * down).sin();
        at * (1.0 + bump)
    };
    let vertices = (0..=rows).flat_map(|row| (0..columns).map(move |column| place(row, column)));
    let corners = (0..rows * columns).flat_map(|cell| {
        let (row, column) = (cell / columns, cell % columns);
        let next = (column + 1) % columns;
        let [a, b, c, d] = [(row, column), (row + 1, column), (row + 1, next), (row, next)]
            .map(|(row, column)| row * columns + column);
        [[a, b, c], [a, c, d]]
    });
    Mesh::new(vertices.collect(), corners.collect()).mended().0
}
