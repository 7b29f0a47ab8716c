//! `bench fields`: what cameras lend to what stands still and to people's hulls, stage after stage, against the truth and against the
//! time it takes; and how exact and how dear distances along surfaces are.

use super::hulls::judged_states;
use crate::worlds::prepare;
use anyhow::{Context as _, Result};
use glam::{DQuat, DVec3, Vec3};
use std::io::Write as _;
use std::path::PathBuf;
use std::time::Duration;
use videofields::accuracy::JudgedView;
use videofields::accuracy::{OpenGate, Scope, Stopwatch};
use videofields_picture::fuse::{CameraState, EntityHull, HullMaking, HullMemory, SceneState};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_simulate::World;
use videofields_vision::clock::{Clock as _, SystemClock};
use videofields_vision::encode;
use videofields_vision::fields::{
    Blend, Distances, Field, FieldSettings, NO_VIEW, Preference, ROUNDS, Steps, Tessellation, Topology, View,
    Visibility, VoteLevels, bounded, exact, marching, shade,
};
use videofields_vision::frame::{Mask, RgbImage, codes_of};
use videofields_vision::geometry::{Camera, Pose};
use videofields_vision::hull::{self, Bounds, Method};
use videofields_vision::measures::{Pooled, compare, exposed_like};
use videofields_vision::mesh::{Mesh, Raster};

/// Judges texture fields over simulated places against their truth, stage after stage, and prints tables.
///
/// Cameras are turned a little off their calibrations and exposed unevenly, as real ones are; all stages see the same. What stands still
/// is coloured by backgrounds, people's hulls by frames. With --geodesics distances along surfaces instead: error and time of every
/// form, on a plane, a sphere, hills and the meshes that are named.
#[derive(Debug, clap::Args)]
pub(super) struct Fields {
    /// A world: a name of the catalogue or the path of its document. Repeatable.
    #[arg(long, value_name = "WORLD", default_values = ["plaza", "carpark12"])]
    world: Vec<String>,
    /// By how many pixels of its picture each camera is turned off, at most.
    #[arg(long, value_name = "PIXELS", default_value_t = 1.5)]
    off_px: f64,
    /// By which share each camera's exposure and white balance are off, at most.
    #[arg(long, value_name = "SHARE", default_value_t = 0.2)]
    uneven: f64,
    /// Columns of cameras' pictures and of views; rows are nine sixteenths of them.
    #[arg(long, value_name = "PIXELS", default_value_t = 640)]
    width: u32,
    /// Frames of the world's period, which is played twice: backgrounds are learned from so many.
    #[arg(long, value_name = "COUNT", default_value_t = 24, value_parser = clap::value_parser!(u32).range(2..=1000))]
    frames: u32,
    /// Where every stage's pictures are written, and the truth, PNG.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// Distances along surfaces, in place of colours.
    #[arg(long)]
    geodesics: bool,
    /// A mesh (.ply) to measure distances on too. Repeatable.
    #[arg(long, value_name = "FILE", requires = "geodesics")]
    mesh: Vec<PathBuf>,
}

/// A stage: what is switched on with it.
struct Stage {
    name: &'static str,
    settings: FieldSettings,
    is_by_normals: bool,
    blend: Blend,
}

fn stages() -> Vec<Stage> {
    // A place's surfaces are known to a few centimetres.
    let plain = FieldSettings {
        preference: Preference::Errors { depth_m: Some(0.02), exponent: 4.0 },
        visibility: Visibility::Facing,
        vote: None,
        distances: Distances::Off,
        smoothing_rounds: 0,
        is_evened: false,
        ..FieldSettings::default()
    };
    let of = |name, settings, is_by_normals| Stage { name, settings, is_by_normals, blend: Blend::Mixed };
    let hidden = FieldSettings { visibility: Visibility::Depths, ..plain };
    let dilated = FieldSettings { visibility: Visibility::Dilated, ..plain };
    let evened = FieldSettings { is_evened: true, ..dilated };
    let sharp = FieldSettings { distances: Distances::Exact, ..evened };
    let full = FieldSettings { smoothing_rounds: FieldSettings::default().smoothing_rounds, ..sharp };
    let marched = FieldSettings { distances: Distances::Marching, ..full };
    let undistanced = FieldSettings { distances: Distances::Off, ..full };
    let voted = FieldSettings { vote: Some(VoteLevels::default()), ..full };
    let errors =
        |depth_m, exponent| FieldSettings { preference: Preference::Errors { depth_m, exponent }, ..full };
    let directions = FieldSettings {
        preference: Preference::Directions { exponent: 20.0 },
        coverage_exponent: 1.0,
        ..sharp
    };
    vec![
        Stage { blend: Blend::Best, ..of("best camera", evened, false) },
        of("normals, what faces", plain, true),
        of("+ depth maps", hidden, true),
        of("+ dilated", dilated, true),
        of("+ evened: the baseline", evened, true),
        Stage { blend: Blend::Filtered { error_m: 0.05 }, ..of("baseline, filtered", evened, true) },
        Stage { blend: Blend::Floating, ..of("baseline, floating", evened, true) },
        of("fields: by the viewer", evened, false),
        of("+ distances", sharp, false),
        of("+ smoothing: all", full, false),
        of("all but distances", undistanced, false),
        of("the paper: by directions, no smoothing", directions, false),
        of("all, by errors of 0.1 m", errors(Some(0.1), 4.0), false),
        of("all, by errors of 0.5 m", errors(Some(0.5), 4.0), false),
        of("all, by errors of 16 pixels", errors(None, 4.0), false),
        of("all, distances by a front", marched, false),
        of("all, distances bounded", FieldSettings { distances: Distances::Bounded, ..full }, false),
        of("baseline, with the vote", voted, true),
        of("all, with the vote", voted, false),
    ]
}

/// What came of a stage.
#[derive(Default)]
struct Outcome {
    pooled: Pooled,
    steps: Steps,
    field: Vec<Duration>,
    target: Vec<Duration>,
    shade: Vec<Duration>,
    /// Pictures of the last mesh, by view.
    last: Vec<RgbImage>,
}

impl Outcome {
    fn row(&self, name: &str) -> String {
        let of = |value: Option<f64>, digits: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        let ms = |all: &[Duration]| {
            all.iter().map(Duration::as_secs_f64).sum::<f64>() * 1e3 / all.len().max(1) as f64
        };
        format!(
            "{name} | {} | {} | {} | {} | {} | {} | {:.1} | {:.1} | {:.1}",
            of(self.pooled.rmse(), 2),
            of(self.pooled.psnr_db(), 2),
            of(self.pooled.ssim(), 4),
            of(self.steps.energy(), 3),
            of(self.steps.sharpness(), 2),
            of(self.steps.ratio(), 3),
            ms(&self.field),
            ms(&self.target),
            ms(&self.shade)
        )
    }
}

/// Numbers that look like chance, -1 to 1, the same at every run.
fn chance(of: u64) -> f64 {
    let mixed = (of ^ 0x9e37_79b9_7f4a_7c15).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0x94d0_49bb_1331_11eb) >> 11;
    2.0 * mixed as f64 / (1_u64 << 53) as f64 - 1.0
}

impl Fields {
    pub(super) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        if self.geodesics {
            return self.distances();
        }
        for name in &self.world {
            let world = World::load(name)?;
            self.judge(name, &world).with_context(|| format!("world {name}"))?;
        }
        Ok(())
    }

    fn judge(&self, name: &str, world: &World) -> Result<()> {
        let clock = SystemClock::new();
        let watch = Stopwatch::new(&clock, &OpenGate);
        let size_px = (self.width, self.width * 9 / 16);
        let scope = Scope {
            size_px,
            view_size_px: size_px,
            samples_per_side: 2,
            n_moments: 1,
            n_frames: self.frames,
            ..Scope::FULL
        };
        let subject = prepare(world, &scope, &watch, &videofields::commands::complain)?;
        let cameras: Vec<Camera> = subject.cameras.iter().map(|of| of.camera.clone()).collect();
        let mesh = Tessellation::default().of(&subject.scene.surfaces, &cameras);
        let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
        let mut still: Vec<(Stage, Outcome)> =
            stages().into_iter().map(|of| (of, Outcome::default())).collect();
        let mut people: Vec<(Stage, Outcome)> =
            stages().into_iter().map(|of| (of, Outcome::default())).collect();
        let mut n_hulls = 0;
        for (frame, mut state) in judged_states(&subject)? {
            let backgrounds = self.views(&state, |seen| seen.observation.background.to_rgb())?;
            let judged: Vec<(&Camera, &JudgedView)> = subject
                .views
                .iter()
                .flat_map(|view| view.frames.iter().map(move |(of, judged)| (*of, (&view.camera, judged))))
                .filter(|(of, _)| *of == frame)
                .map(|(_, judged)| judged)
                .collect();
            let parts: Vec<Part<'_>> = judged
                .iter()
                .map(|(camera, of)| Part { camera, truth: &of.truth.rgb, part: &of.still })
                .collect();
            judge_mesh((&mesh, &topology), &backgrounds, &parts, (&mut still, &clock))?;
            self.write(&format!("{name}-still"), &parts, &still)?;
            state.place_hulls(HullMaking { error_px: 0.5, n_voxels: None }, &mut HullMemory::default());
            // Where the truth has a person too: shapes are judged elsewhere.
            let parts: Vec<Part<'_>> = judged
                .iter()
                .map(|(camera, of)| Part { camera, truth: &of.truth.rgb, part: &of.truth.instance })
                .collect();
            for of in &state.hulls {
                n_hulls += 1;
                let (mesh, foregrounds) = hull_mesh(&state, of)?;
                let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
                let frames = self.hull_views(&state, of, &foregrounds)?;
                judge_mesh((&mesh, &topology), &frames, &parts, (&mut people, &clock))?;
                self.write(&format!("{name}-hull-{n_hulls}"), &parts, &people)?;
            }
        }
        let mut out = std::io::stdout().lock();
        for (what, outcomes, of) in [
            ("what stands still", &still, format!("{} triangles", mesh.triangles.len())),
            ("people's hulls", &people, format!("{n_hulls} hulls")),
        ] {
            writeln!(out, "\n{name}, {} cameras, {what}: {of}\n", cameras.len())?;
            writeln!(
                out,
                "| stage | RMSE | PSNR, dB | SSIM | seam energy | sharpness | across / within | field, ms | target, ms | picture, ms |\n\
                 | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
            )?;
            for (stage, outcome) in outcomes {
                writeln!(out, "| {} |", outcome.row(stage.name))?;
            }
        }
        Ok(())
    }

    /// Writes what was drawn last, and what should have been.
    fn write(&self, name: &str, parts: &[Part<'_>], outcomes: &[(Stage, Outcome)]) -> Result<()> {
        let Some(folder) = &self.pictures else { return Ok(()) };
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let write = |file: String, picture: &RgbImage| {
            let path = folder.join(file.replace([' ', ',', ':', '+'], "_"));
            std::fs::write(&path, encode::png_rgb(picture)?).with_context(|| path.display().to_string())
        };
        for (view, part) in parts.iter().enumerate() {
            write(format!("{name}-{view}-truth.png"), part.truth)?;
            for (stage, outcome) in outcomes {
                let drawn = outcome
                    .last
                    .len()
                    .checked_sub(parts.len())
                    .and_then(|first| outcome.last.get(first + view));
                if let Some(picture) = drawn {
                    write(format!("{name}-{view}-{}.png", stage.name), picture)?;
                }
            }
        }
        Ok(())
    }

    /// A camera that is turned a little off, and its picture unevenly exposed.
    fn view(
        &self,
        idx: usize,
        camera: &Camera,
        picture: &RgbImage,
        foreground: Option<Mask>,
    ) -> Result<View> {
        let chance = |which: u64| chance(7 * idx as u64 + which);
        let turn = DVec3::new(chance(0), chance(1), chance(2)) * self.off_px / camera.focal_px().x;
        let pose = camera.pose();
        let pose = Pose {
            world_from_local: (pose.world_from_local * DQuat::from_scaled_axis(turn)).normalize(),
            ..*pose
        };
        let camera =
            Camera::new(camera.size_px(), camera.focal_px(), camera.center_px(), *camera.distortion(), pose)?;
        let gain = [3, 4, 5].map(|which| (1.0 + self.uneven * 0.5 * (chance(which) + chance(6))) as f32);
        let mut data = Vec::with_capacity(picture.data.len());
        for pixel in 0..picture.width * picture.height {
            let light = picture.light(pixel % picture.width, pixel / picture.width);
            data.extend(codes_of(light * Vec3::from(gain)));
        }
        Ok(View::new(camera, RgbImage { width: picture.width, height: picture.height, data }, foreground))
    }

    fn views(&self, state: &SceneState, picture: impl Fn(&CameraState) -> RgbImage) -> Result<Vec<View>> {
        let cameras = state.cameras.iter().enumerate();
        cameras.map(|(idx, seen)| self.view(idx, &seen.camera, &picture(seen), None)).collect()
    }

    fn hull_views(&self, state: &SceneState, of: &EntityHull, foregrounds: &[Mask]) -> Result<Vec<View>> {
        let cameras = of.cameras.iter().zip(of.hull.views()).zip(foregrounds);
        cameras
            .map(|((camera, view), mask)| {
                let picture = state.cameras[*camera].observation.frame.image.to_rgb();
                self.view(*camera, view.camera(), &picture, Some(mask.clone()))
            })
            .collect()
    }
}

/// What a mesh is judged on: of a view's truth, where `part` is not 0.
struct Part<'a> {
    camera: &'a Camera,
    truth: &'a RgbImage,
    part: &'a Mask,
}

/// Judges every stage on a mesh.
fn judge_mesh(
    (mesh, topology): (&Mesh, &Topology),
    views: &[View],
    parts: &[Part<'_>],
    (outcomes, clock): (&mut [(Stage, Outcome)], &SystemClock),
) -> Result<()> {
    let shown: Vec<Shown<'_>> = parts.iter().map(|part| Shown::of(mesh, part)).collect();
    for (stage, outcome) in outcomes {
        let mut views = views.to_vec();
        let started = clock.monotonic();
        let field = Field::new(mesh, topology, &mut views, &stage.settings)?;
        outcome.field.push(clock.monotonic().saturating_sub(started));
        outcome.last.clear();
        for shown in &shown {
            draw((mesh, &field, &views), stage, shown, (outcome, clock))?;
        }
    }
    Ok(())
}

/// A mesh in a view, and where it is judged: within what rows and columns.
struct Shown<'a> {
    part: &'a Part<'a>,
    raster: Raster,
    /// The truth and what of it counts, within `window`.
    truth: RgbImage,
    judged: Mask,
    /// First column and row, and how many; none where nothing is judged.
    window: Option<[usize; 4]>,
}

/// Pixels around what is judged that similarity looks at too.
const MARGIN_PX: usize = 8;

impl<'a> Shown<'a> {
    fn of(mesh: &Mesh, part: &'a Part<'a>) -> Self {
        let [width, height] = [part.truth.width, part.truth.height].map(|side| side as usize);
        let raster = Raster::of(mesh, part.camera, [width, height]);
        // All stages are judged on the same pixels: where anything is, seen or filled.
        let mut judged = Mask::clone(part.part);
        judged.data.iter_mut().zip(raster.triangles()).for_each(|(judged, triangle)| {
            *judged = if *triangle == videofields_vision::mesh::NO_TRIANGLE { 0 } else { *judged };
        });
        let pixels = judged.data.iter().enumerate().filter(|(_, value)| **value > 0);
        let bounds = pixels.map(|(pixel, _)| [pixel % width, pixel / width]).fold(None, |bounds, [x, y]| {
            let [low_x, low_y, high_x, high_y] = bounds.unwrap_or([x, y, x, y]);
            Some([low_x.min(x), low_y.min(y), high_x.max(x), high_y.max(y)])
        });
        let window = bounds.map(|[low_x, low_y, high_x, high_y]| {
            let (x, y) = (low_x.saturating_sub(MARGIN_PX), low_y.saturating_sub(MARGIN_PX));
            let [right, bottom] = [(high_x + MARGIN_PX + 1).min(width), (high_y + MARGIN_PX + 1).min(height)];
            [x, y, right - x, bottom - y]
        });
        let all = [0, 0, width, height];
        let truth = cut(part.truth, window.unwrap_or(all));
        let rows = window.unwrap_or(all);
        let data = rows_of(&judged.data, width, rows).collect::<Vec<u8>>();
        let judged = Mask { width: rows[2] as u32, height: rows[3] as u32, data: data.into() };
        Self { part, raster, truth, judged, window }
    }
}

/// The values of a window of lines that are so long.
fn rows_of<T: Copy>(
    of: &[T],
    length: usize,
    [x, y, width, height]: [usize; 4],
) -> impl Iterator<Item = T> + '_ {
    (y..y + height).flat_map(move |row| of[row * length + x..][..width].iter().copied())
}

fn cut(of: &RgbImage, [x, y, width, height]: [usize; 4]) -> RgbImage {
    let data = rows_of(&of.data, 3 * of.width as usize, [3 * x, y, 3 * width, height]).collect();
    RgbImage { width: width as u32, height: height as u32, data }
}

/// Draws one view of a mesh by a stage, and judges it where anything is.
fn draw(
    (mesh, field, views): (&Mesh, &Field, &[View]),
    stage: &Stage,
    Shown { part, raster, truth, judged, window }: &Shown<'_>,
    (outcome, clock): (&mut Outcome, &SystemClock),
) -> Result<()> {
    let Some(window) = window else {
        let (width, height) = (part.truth.width, part.truth.height);
        let data = vec![0; part.truth.data.len()];
        outcome.last.push(RgbImage { width, height, data });
        return Ok(());
    };
    let started = clock.monotonic();
    let weights = if stage.is_by_normals {
        field.by_normals()
    } else {
        field.target(mesh, views, part.camera.pose().position_in_world)
    };
    outcome.target.push(clock.monotonic().saturating_sub(started));
    let started = clock.monotonic();
    let shaded = shade((mesh, raster), part.camera, (field, views, &weights), stage.blend);
    outcome.shade.push(clock.monotonic().saturating_sub(started));
    debug_assert!(
        shaded.owners.data.iter().all(|owner| usize::from(*owner) < views.len() || *owner == NO_VIEW)
    );
    let drawn = cut(&shaded.picture, *window);
    // How cameras are exposed is nothing that a blend could know.
    let truth = exposed_like(truth, &drawn, judged);
    outcome.pooled.add(&compare(&truth, &drawn, Some(judged))?);
    outcome.steps = outcome.steps.plus(shaded.steps);
    outcome.last.push(shaded.picture);
    Ok(())
}

/// A hull's surface, and of each of its views where it is.
fn hull_mesh(state: &SceneState, of: &EntityHull) -> Result<(Mesh, Vec<Mask>)> {
    let [low, high] = of.bounds_in_world;
    let bounds = Bounds::new(low, high).context("a hull without bounds")?;
    let mesh = hull::extract(&of.hull, &bounds, (Method::ImageBased, 96))?;
    let mask = |(camera, view): (&usize, &hull::View)| {
        let image = &state.cameras[*camera].observation.frame.image;
        let (width, height) = (image.width(), image.height());
        let inside = |pixel: u32| {
            let at = glam::DVec2::new(f64::from(pixel % width) + 0.5, f64::from(pixel / width) + 0.5);
            let is = view.at(at / glam::DVec2::new(f64::from(width), f64::from(height))) == Some(true);
            u8::from(is) * 255
        };
        Mask { width, height, data: (0..width * height).map(inside).collect::<Vec<u8>>().into() }
    };
    Ok((mesh, of.cameras.iter().zip(of.hull.views()).map(mask).collect()))
}

/// A mesh with a name, and where distances begin on it.
struct Measured {
    name: String,
    mesh: Mesh,
    sources: Vec<u32>,
}

impl Fields {
    fn distances(&self) -> Result<()> {
        let clock = SystemClock::new();
        let mut out = std::io::stdout().lock();
        writeln!(
            out,
            "| mesh | triangles | sources | form | ms | mean error, edges | worst error, edges | of vertices within five edges |\n\
             | --- | ---: | ---: | --- | ---: | ---: | ---: | ---: |"
        )?;
        for Measured { name, mesh, sources } in self.measured()? {
            let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
            let edge_m = topology.mean_length_m();
            let reach_m = 5.0 * edge_m;
            let timed = |of: &dyn Fn() -> Vec<f64>| {
                let started = clock.monotonic();
                let found = of();
                (found, clock.monotonic().saturating_sub(started).as_secs_f64() * 1e3)
            };
            let (truth, exact_ms) = timed(&|| exact(&topology, &mesh.positions_m, &sources, reach_m));
            let forms = [
                (
                    "bounded",
                    timed(&|| {
                        let found = bounded(&topology, &mesh.positions_m, &sources, ROUNDS);
                        found.into_iter().map(f64::from).collect()
                    }),
                ),
                ("marching", timed(&|| marching(&topology, &mesh.positions_m, &sources, reach_m))),
                ("exact", (truth.clone(), exact_ms)),
            ];
            for (form, (found, ms)) in forms {
                let near = || truth.iter().zip(&found).filter(|(truth, _)| **truth <= reach_m);
                let off = || near().map(|(truth, found)| (found.min(reach_m) - truth).abs() / edge_m);
                let n = near().count();
                let worst = off().fold(0.0, f64::max);
                writeln!(
                    out,
                    "| {name} | {} | {} | {form} | {ms:.1} | {:.5} | {worst:.4} | {n} |",
                    mesh.triangles.len(),
                    sources.len(),
                    off().sum::<f64>() / n.max(1) as f64,
                )?;
            }
        }
        Ok(())
    }

    fn measured(&self) -> Result<Vec<Measured>> {
        let mut all = Vec::new();
        for n in [64_u32, 128, 256, 512] {
            for (name, rough_m) in [("plane", 0.0), ("hills", 2.0)] {
                let mesh = sheet(n, rough_m);
                // Along a line across it.
                let line = (0..n).map(|x| (n / 2) * n + x);
                all.push(Measured { name: format!("{name} {n} x {n}"), mesh, sources: line.collect() });
            }
        }
        for level in [8, 11, 14] {
            let mesh = sphere(level);
            all.push(Measured { name: format!("sphere {level}"), mesh, sources: vec![2, 5] });
        }
        for path in &self.mesh {
            let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
            let (mesh, _) = Mesh::read_ply(&bytes, 1 << 21)?.mended();
            let n = mesh.positions_m.len() as u32;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            all.push(Measured { name, sources: (0..n).step_by(100).collect(), mesh });
        }
        Ok(all)
    }
}

/// An octahedron whose faces were cut into four so many times, on the unit sphere; its poles are points 2 and 5.
fn sphere(level: u32) -> Mesh {
    let poles = vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    let faces = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    let mut mesh = Mesh::new(poles, faces);
    for _ in 0..level {
        // Two halvings of every triangle are its cut into four.
        mesh = mesh.refined(1, usize::MAX, |_, _| true);
        mesh.positions_m.iter_mut().for_each(|at| *at = at.normalize());
    }
    mesh
}

/// Uneven triangles a metre or so wide, over a plane or hills of that height.
fn sheet(n: u32, rough_m: f64) -> Mesh {
    let place = |i: u32| {
        let (x, y) = (f64::from(i % n), f64::from(i / n));
        let (x, y) = (x + 0.25 * chance(2 * u64::from(i)), y + 0.25 * chance(2 * u64::from(i) + 1));
        DVec3::new(x, y, rough_m * ((0.7 * x).sin() + (0.5 * y).cos()))
    };
    let quad = |i: u32| {
        let (x, y) = (i % (n - 1), i / (n - 1));
        let [a, b, c, d] = [y * n + x, y * n + x + 1, (y + 1) * n + x + 1, (y + 1) * n + x];
        if (x + y) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    Mesh::new((0..n * n).map(place).collect(), (0..(n - 1) * (n - 1)).flat_map(quad).collect())
}
