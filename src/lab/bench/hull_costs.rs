//! `bench hulls --costs`: how the time of each method grows with cameras, with pixels and with outlines' corners.

use super::hulls::{drawn, judged_states, median, ring};
use crate::worlds::prepare;
use anyhow::{Context as _, Result, anyhow};
use std::io::Write as _;
use videofields::accuracy::{OpenGate, Scope, Stopwatch, Subject, machine};
use videofields_picture::fuse::{HullMaking, HullMemory, SceneState};
use videofields_picture::plan::{
    EntityStyle, HullForm, HullMethod, HullTexture, HullVisibility, Picture, Preset, Settings, View,
    ViewLimits,
};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_simulate::World;
use videofields_vision::clock::{Clock as _, SystemClock};
use videofields_vision::geometry::Pose;

/// Drawings of which the median counts, after one that makes ready.
const N_DRAWINGS: usize = 5;

/// Outlines are simplified by so much where nothing else is said, pixels: as views have it.
const ERROR_PX: f64 = 0.5;

const LIMITS: ViewLimits = ViewLimits { max_side_px: 16_384, max_pixels: 1 << 28 };

/// Colours without looking for what stands between: finding and showing alone.
const TEXTURE: HullTexture = HullTexture { visibility: HullVisibility::Off, ..HullForm::EXACT.texture };

/// Makes hulls ready for every method.
fn place(state: &mut SceneState, error_px: f64) {
    let making = HullMaking { error_px, n_voxels: Some(HullForm::EXACT.n_voxels) };
    state.place_hulls(making, &mut HullMemory::default());
}

/// Somebody in front of cameras, and who draws them.
struct Bench {
    subject: Subject,
    state: SceneState,
    renderer: Renderer,
    clock: SystemClock,
}

impl Bench {
    fn new(n_cameras: u32, columns: u32) -> Result<Self> {
        let world = World::from_json("ring", &ring(n_cameras, columns, Some(20.0)).to_string())?;
        let clock = SystemClock::new();
        let scope = Scope {
            size_px: (columns, columns * 9 / 16),
            view_size_px: (64, 36),
            samples_per_side: 1,
            n_frames: 24,
            max_cameras: 64,
            n_views: 1,
            n_moments: 1,
            ..Scope::FULL
        };
        let watch = Stopwatch::new(&clock, &OpenGate);
        let subject = prepare(&world, &scope, &watch, &videofields::commands::complain)?;
        let state = judged_states(&subject)?.into_iter().next().context("no frame is judged")?.1;
        let renderer = Renderer::new(Gpu::new(&subject.render.adapter)?, &subject.render)?;
        let mut bench = Self { subject, state, renderer, clock };
        place(&mut bench.state, ERROR_PX);
        Ok(bench)
    }

    /// The view aside, so many columns wide.
    fn picture(&self, columns: u32) -> Result<Picture> {
        let pose = self.subject.views.first().context("no view")?.view.pose;
        looking(&pose, 45.0, (columns, columns * 9 / 16))
    }

    /// What hulls take of a picture beyond the same picture without them, and that, milliseconds.
    fn hulls_ms(&mut self, picture: &Picture, hull: HullForm) -> Result<[f64; 2]> {
        let settings = |entities| Settings { entities, hull, ..Preset::Balanced.settings(1) };
        let bare = self.drawing_ms(picture, settings(EntityStyle::None))?;
        let all = self.drawing_ms(picture, settings(EntityStyle::Hulls))?;
        Ok([(all - bare).max(0.0), bare])
    }

    fn drawing_ms(&mut self, picture: &Picture, settings: Settings) -> Result<f64> {
        drawn(&mut self.renderer, &self.state, picture, settings)?;
        let mut times = Vec::new();
        for _ in 0..N_DRAWINGS {
            let begun = self.clock.monotonic();
            drawn(&mut self.renderer, &self.state, picture, settings)?;
            times.push(self.clock.monotonic().saturating_sub(begun).as_secs_f64() * 1e3);
        }
        Ok(median(&times))
    }

    /// Corners of a silhouette, in the mean.
    fn corners(&self) -> f64 {
        let views = || self.state.hulls.iter().flat_map(|hull| hull.hull.views());
        let n: usize = views().map(|view| view.outside().edges().len()).sum();
        n as f64 / (views().count() as f64).max(1.0)
    }
}

/// The picture of so many degrees upwards and so many pixels that somebody there sees.
fn looking(pose: &Pose, fov_degrees: f64, (width_px, height_px): (u32, u32)) -> Result<Picture> {
    let eye = pose.position_in_world;
    let target = eye + pose.forward_in_world();
    let view = View::new(eye, target, fov_degrees.to_radians(), width_px, height_px, &LIMITS);
    Ok(Picture::from(view.map_err(|fault| anyhow!("{fault}"))?))
}

/// The methods that are compared, each by its name.
fn methods() -> Vec<(&'static str, HullForm)> {
    let of = |(word, method)| (word, HullForm { method, n_voxels: 64, texture: TEXTURE, ..HullForm::EXACT });
    HullMethod::ALL.into_iter().map(of).collect()
}

/// The exponent of a power of `x` that `y` grows by: the slope of the straight line through their logarithms.
fn exponent(points: &[[f64; 2]]) -> f64 {
    let logs: Vec<[f64; 2]> = points.iter().map(|[x, y]| [x.ln(), y.max(1e-3).ln()]).collect();
    let n = logs.len() as f64;
    let mean = |idx: usize| logs.iter().map(|of| of[idx]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let (over, under) = logs.iter().fold((0.0, 0.0), |(over, under), of| {
        ((of[0] - x).mul_add(of[1] - y, over), (of[0] - x).mul_add(of[0] - x, under))
    });
    over / under
}

/// A table of what grows: a row for each place, a column for each method, and the exponents beneath.
fn table(
    out: &mut impl std::io::Write,
    what: &str,
    rows: &[(String, f64, Vec<f64>, f64)],
) -> std::io::Result<()> {
    let names: Vec<&str> = methods().iter().map(|(name, _)| *name).collect();
    writeln!(out, "\n| {what} | {} | all else |", names.join(" | "))?;
    writeln!(out, "| ---: |{}", " ---: |".repeat(names.len() + 1))?;
    for (name, _, times, bare) in rows {
        let cells: Vec<String> =
            times.iter().map(|ms| format!("{ms:.1} ({:.2})", ms / bare.max(1e-6))).collect();
        writeln!(out, "| {name} | {} | {bare:.1} |", cells.join(" | "))?;
    }
    let of = |idx: usize| exponent(&rows.iter().map(|(_, x, times, _)| [*x, times[idx]]).collect::<Vec<_>>());
    let exponents: Vec<String> = (0..names.len()).map(|idx| format!("{:.2}", of(idx))).collect();
    writeln!(out, "| exponent | {} | |", exponents.join(" | "))
}

/// Draws and prints.
pub(super) fn run() -> Result<()> {
    let mut out = std::io::stdout().lock();
    let mut rows = Vec::new();
    let mut eight = None;
    for n_cameras in [2, 4, 8, 16, 32] {
        let mut bench = Bench::new(n_cameras, 640)?;
        if rows.is_empty() {
            let adapter = bench.renderer.gpu().name().to_owned();
            let machine = machine(&adapter);
            writeln!(out, "{}, {} processors, {adapter}", machine.processor, machine.n_processors)?;
            writeln!(
                out,
                "milliseconds of finding and showing hulls, and in brackets over all else of the picture"
            )?;
        }
        let picture = bench.picture(640)?;
        let (times, bare) = all_methods(&mut bench, &picture)?;
        rows.push((n_cameras.to_string(), f64::from(n_cameras), times, bare));
        if n_cameras == 8 {
            eight = Some(bench);
        }
    }
    table(&mut out, "cameras", &rows)?;
    let mut bench = eight.context("eight are among them")?;
    rows.clear();
    for columns in [160, 320, 640, 1280] {
        let picture = bench.picture(columns)?;
        let (times, bare) = all_methods(&mut bench, &picture)?;
        let pixels = f64::from(columns * (columns * 9 / 16));
        rows.push((format!("{columns} x {}", columns * 9 / 16), pixels, times, bare));
    }
    table(&mut out, "pixels, 8 cameras", &rows)?;
    rows.clear();
    let picture = bench.picture(640)?;
    for error_px in [2.0, 1.0, 0.5, 0.25, 0.0] {
        place(&mut bench.state, error_px);
        let corners = bench.corners();
        let (times, bare) = all_methods(&mut bench, &picture)?;
        rows.push((format!("{corners:.0} (simplified by {error_px} px)"), corners, times, bare));
    }
    table(&mut out, "corners a silhouette, 8 cameras", &rows)?;
    place(&mut bench.state, ERROR_PX);
    references(&mut out, &mut bench)?;
    Ok(())
}

fn all_methods(bench: &mut Bench, picture: &Picture) -> Result<(Vec<f64>, f64)> {
    let mut times = Vec::new();
    let mut bare = Vec::new();
    for (_, hull) in methods() {
        let [ms, bare_ms] = bench.hulls_ms(picture, hull)?;
        times.push(ms);
        bare.push(bare_ms);
    }
    Ok((times, median(&bare)))
}

/// What every camera sees of the hulls as depth maps: as views by two methods, and as they are drawn for visibility.
fn references(out: &mut impl std::io::Write, bench: &mut Bench) -> Result<()> {
    let mut sums = [0.0; 2];
    let n_cameras = bench.subject.cameras.len();
    for idx in 0..n_cameras {
        let pose = *bench.subject.cameras[idx].camera.pose();
        let seen = looking(&pose, 35.0, (320, 240))?;
        for (sum, method) in sums.iter_mut().zip([HullMethod::Trimming, HullMethod::Csg]) {
            let hull = HullForm { method, texture: TEXTURE, ..HullForm::EXACT };
            *sum += bench.hulls_ms(&seen, hull)?[0];
        }
    }
    let picture = bench.picture(640)?;
    let mut by = |visibility| {
        let texture = HullTexture { visibility, ..TEXTURE };
        bench.hulls_ms(&picture, HullForm { texture, ..HullForm::EXACT })
    };
    let [off, depths, rays] =
        [HullVisibility::Off, HullVisibility::Depths, HullVisibility::Rays].map(&mut by);
    let off = off?[0];
    writeln!(out, "\n| reference depths of {n_cameras} cameras | ms |\n| --- | ---: |")?;
    writeln!(out, "| by trimming, 320 x 240 a camera, as views | {:.1} |", sums[0])?;
    writeln!(out, "| by csg, 320 x 240 a camera, as views | {:.1} |", sums[1])?;
    writeln!(out, "| by trimming, beside each other, and asked | {:.1} |", depths?[0] - off)?;
    writeln!(out, "| rays in place of them | {:.1} |", rays?[0] - off)?;
    Ok(())
}
