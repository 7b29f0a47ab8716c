//! `bench hulls`: people as hulls by every method, as billboards and as points, against the truth and against the time they take,
//! by how many cameras see them.

use super::playing::play;
use crate::report::{Figure, Point, Series, figure_page};
use crate::worlds::prepare;
use anyhow::{Context as _, Result};
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use videofields::accuracy::JudgedView;
use videofields::accuracy::{OpenGate, Scope, Stopwatch, Subject, SubjectView, ViewsRun, machine};
use videofields_picture::fuse::{HullMemory, Placing, SceneState};
use videofields_picture::plan::{
    self, Colors, EntityStyle, HullForm, HullMethod, HullTexture, HullVisibility, HullWeights, Picture,
    Preset, Settings, Wishes,
};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_render::gpu::Gpu;
use videofields_render::{FoundHulls, Renderer};
use videofields_simulate::World;
use videofields_vision::clock::{Clock as _, SystemClock};
use videofields_vision::frame::{CameraId, RgbImage};

/// Draws simulated people, seen by more and more cameras around them, in every way there is, and prints how true that is and what
/// it takes.
///
/// Three people walk on a level place. Views stand where no camera does, halfway between two, and pictures are judged at the people
/// and four pixels around. Times are of drawing, beyond that of the same picture without people, and the processor's for making hulls ready.
#[derive(Debug, clap::Args)]
pub(super) struct Hulls {
    /// How many cameras stand around them. Repeatable, or with commas between.
    #[arg(long, value_name = "COUNT", value_delimiter = ',', default_values_t = [2, 3, 4, 8, 12])]
    cameras: Vec<u32>,
    /// Columns of cameras' pictures and of views; rows are nine sixteenths of them.
    #[arg(long, value_name = "PIXELS", default_value_t = 640)]
    width: u32,
    /// Moments at which every view is drawn, two frames at each.
    #[arg(long, value_name = "COUNT", default_value_t = 2)]
    moments: u32,
    /// Where a plot of error against time is written, SVG.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Where the people of the last view are written as each form has them, and as they are, PNG.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// Views stand so many degrees beside the first camera, in place of halfway between two. Repeatable, or with commas between.
    #[arg(long, value_name = "DEGREES", value_delimiter = ',')]
    aside: Vec<f64>,
    /// How each method's time grows with cameras, pixels and corners, in place of how true it is.
    #[arg(long)]
    costs: bool,
}

/// One way to draw people.
#[derive(Clone)]
struct Form {
    name: String,
    settings: Settings,
}

fn forms() -> Vec<Form> {
    let of = |name: &str, entities: EntityStyle, hull: HullForm| Form {
        name: name.to_owned(),
        settings: Settings { entities, hull, ..Preset::Balanced.settings(1) },
    };
    let textured = |texture| HullForm { texture, ..HullForm::EXACT };
    let exact = HullForm::EXACT.texture;
    let mut forms = vec![
        of("billboards", EntityStyle::Billboards, HullForm::EXACT),
        of("points", EntityStyle::Points, HullForm::EXACT),
    ];
    for (word, method) in HullMethod::ALL {
        if method == HullMethod::Voxels {
            for n_voxels in [32, 64, 128] {
                let hull = HullForm { method, n_voxels, ..HullForm::EXACT };
                forms.push(of(&format!("hulls, {word} {n_voxels}"), EntityStyle::Hulls, hull));
            }
        } else {
            let hull = HullForm { method, ..HullForm::EXACT };
            forms.push(of(&format!("hulls, {word}"), EntityStyle::Hulls, hull));
        }
    }
    for (name, texture) in [
        ("rays, not feathered", HullTexture { feather: false, ..exact }),
        ("rays, visible or not", HullTexture { visibility: HullVisibility::Off, ..exact }),
        ("rays, visible by depth maps", HullTexture { visibility: HullVisibility::Depths, ..exact }),
        ("rays, weights at corners", HullTexture { weights: HullWeights::Corners, ..exact }),
    ] {
        forms.push(of(name, EntityStyle::Hulls, textured(texture)));
    }
    forms.push(of("auto", EntityStyle::Auto, HullForm::EXACT));
    forms
}

/// What came of a form.
#[derive(Default)]
struct Outcome {
    run: ViewsRun,
    /// Differences of depth from the truth where both show a person, metres.
    depths_m: Vec<f64>,
    /// Of each picture: what the processor does before it is drawn.
    placing_ms: Vec<f64>,
    /// All of drawing, as the caller waits for it, and of the same picture without people.
    drawing_ms: Vec<f64>,
    bare_ms: Vec<f64>,
}

pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

impl Outcome {
    /// What people take of drawing: devices that rasterise on the processor tell no times of passes that compute.
    fn people_ms(&self) -> f64 {
        (median(&self.drawing_ms) - median(&self.bare_ms)).max(0.0)
    }

    fn total_ms(&self) -> f64 {
        self.people_ms() + median(&self.placing_ms)
    }
}

impl Hulls {
    pub(super) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        if self.costs {
            return super::hull_costs::run();
        }
        let mut series = Vec::new();
        let mut out = std::io::stdout().lock();
        let asides: Vec<Option<f64>> =
            if self.aside.is_empty() { vec![None] } else { self.aside.iter().copied().map(Some).collect() };
        let runs = self.cameras.iter().flat_map(|n| asides.iter().map(move |aside| (*n, *aside)));
        for (idx, (n_cameras, aside)) in runs.enumerate() {
            let world = World::from_json("ring", &ring(n_cameras, 640, aside).to_string())?;
            let judged = self.judge(&world, if aside.is_some() { 1 } else { 2 });
            let (adapter, outcomes) = judged.with_context(|| format!("{n_cameras} cameras"))?;
            let cameras = aside
                .map_or_else(|| n_cameras.to_string(), |aside| format!("{n_cameras}, {aside} degrees aside"));
            if idx == 0 {
                let machine = machine(&adapter);
                writeln!(out, "{}, {} processors, {}\n", machine.processor, machine.n_processors, adapter)?;
                writeln!(
                    out,
                    "| cameras | people as | silhouettes: IoU | PSNR, dB | SSIM | depth: mean error, mm | drawing, ms | making ready, ms | drawing over all else |\n\
                     | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
                )?;
            }
            for (form, outcome) in &outcomes {
                writeln!(out, "| {cameras} | {} |", row(&form.name, outcome))?;
            }
            let points = outcomes.iter().map(|(form, outcome)| Point {
                // Less is lost in what times differ by anyway.
                x: outcome.total_ms().max(0.1),
                y: 1.0 - outcome.run.measures().get("silhouette_iou").copied().unwrap_or(0.0),
                label: form.name.replace("hulls, ", ""),
                is_marked: form.settings.entities != EntityStyle::Hulls,
                is_large: false,
            });
            series.push(Series {
                name: format!("{cameras} cameras"),
                points: points.collect(),
                is_joined: false,
            });
        }
        if let Some(path) = &self.plot {
            let figure = Figure {
                title: "People from where no camera stands".to_owned(),
                x_name: "milliseconds for the people of a picture".to_owned(),
                y_name: "1 - IoU of silhouettes".to_owned(),
                is_log: false,
                series,
            };
            let text = figure_page(&figure)?.context("nothing to draw")?;
            std::fs::write(path, text).with_context(|| path.display().to_string())?;
        }
        Ok(())
    }

    fn judge(&self, world: &World, n_views: usize) -> Result<(String, Vec<(Form, Outcome)>)> {
        let clock = SystemClock::new();
        let watch = Stopwatch::new(&clock, &OpenGate);
        let size_px = (self.width, self.width * 9 / 16);
        let scope = Scope {
            size_px,
            view_size_px: size_px,
            samples_per_side: 2,
            max_cameras: 64,
            n_views,
            n_moments: self.moments,
            ..Scope::FULL
        };
        let subject = prepare(world, &scope, &watch, &videofields::commands::complain)?;
        let mut renderer = Renderer::new(Gpu::new(&subject.render.adapter)?, &subject.render)?;
        let mut outcomes: Vec<(Form, Outcome)> =
            forms().into_iter().map(|form| (form, Outcome::default())).collect();
        for (frame, state) in judged_states(&subject)? {
            for view in &subject.views {
                for (_, judged) in view.frames.iter().filter(|(of, _)| *of == frame) {
                    self.draw((view, judged), &state, (&mut renderer, &clock), &mut outcomes)?;
                }
            }
        }
        Ok((renderer.gpu().name().to_owned(), outcomes))
    }

    fn draw(
        &self,
        (view, judged): (&SubjectView, &JudgedView),
        state: &SceneState,
        (renderer, clock): (&mut Renderer, &SystemClock),
        outcomes: &mut [(Form, Outcome)],
    ) -> Result<()> {
        let since_ms = |begun| clock.monotonic().saturating_sub(begun).as_secs_f64() * 1e3;
        if let Some(folder) = &self.pictures {
            write_people(folder, (state.cameras.len(), "truth"), (&judged.truth.rgb, judged))?;
        }
        let picture = Picture::from(view.view);
        let plain = Settings { entities: EntityStyle::None, ..Preset::Balanced.settings(1) };
        drawn(renderer, state, &picture, plain)?;
        let begun = clock.monotonic();
        let bare = drawn(renderer, state, &picture, plain)?;
        let bare_ms = since_ms(begun);
        for (form, outcome) in outcomes {
            let begun = clock.monotonic();
            let mut state = state.clone();
            form.settings.place(&mut state, &mut HullMemory::default());
            outcome.placing_ms.push(since_ms(begun));
            // Twice: pictures that are new to the device, and programs, are the first one's.
            drawn(renderer, &state, &picture, form.settings)?;
            let begun = clock.monotonic();
            let shown = drawn(renderer, &state, &picture, form.settings)?;
            outcome.drawing_ms.push(since_ms(begun));
            outcome.bare_ms.push(bare_ms);
            outcome.run.judge(view, judged, &shown, &bare)?;
            if form.settings.entities.has_hulls()
                && let Some(found) = renderer.found_hulls()?
            {
                outcome.depths_m.extend(depth_errors(&found, judged));
            }
            if let Some(folder) = &self.pictures {
                write_people(folder, (state.cameras.len(), &form.name), (&shown, judged))?;
            }
        }
        Ok(())
    }
}

/// Pixels around people that their pictures show.
const AROUND_PX: usize = 24;

/// Writes the part of a picture in which there are people, or all of it where there are none.
fn write_people(
    folder: &Path,
    (n_cameras, name): (usize, &str),
    (image, judged): (&RgbImage, &JudgedView),
) -> Result<()> {
    let (width, height) = (image.width as usize, image.height as usize);
    let people = judged.truth.instance.data.iter().enumerate().filter(|(_, instance)| **instance > 0);
    let around = people.map(|(i, _)| (i % width, i / width)).fold(None, |around, (x, y)| {
        let [left, top, right, bottom] = around.unwrap_or([x, y, x, y]);
        Some([left.min(x), top.min(y), right.max(x), bottom.max(y)])
    });
    let [left, top, right, bottom] = around.unwrap_or([0, 0, width - 1, height - 1]);
    let (left, top) = (left.saturating_sub(AROUND_PX), top.saturating_sub(AROUND_PX));
    let (right, bottom) = ((right + AROUND_PX).min(width - 1), (bottom + AROUND_PX).min(height - 1));
    let row = |y: usize| &image.data[(y * width + left) * 3..(y * width + right + 1) * 3];
    let pixels: Vec<u8> = (top..=bottom).flat_map(row).copied().collect();
    let path = folder.join(format!("hulls_{n_cameras}_{}.png", name.replace([',', ' '], "_")));
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let (columns, rows) = ((right + 1 - left) as u32, (bottom + 1 - top) as u32);
    image::save_buffer(&path, &pixels, columns, rows, image::ExtendedColorType::Rgb8)
        .with_context(|| path.display().to_string())
}

/// What stands before the cameras at each of the frames that are judged.
pub(crate) fn judged_states(subject: &Subject) -> Result<Vec<(usize, SceneState)>> {
    let mut placing = Placing::default();
    let (judged, scene) = (subject.judged_frames(), &subject.scene);
    let mut states = Vec::new();
    play(subject, |frame, number, seen| {
        let find = |id: &CameraId| seen.iter().find(|of| of.frame.camera == *id).cloned();
        // At every frame: who is who follows from those before.
        let state = placing.assemble(scene, subject.instant(number), find);
        if judged.contains(&frame) {
            states.push((frame, state));
        }
        Ok(())
    })?;
    Ok(states)
}

/// Where both the truth and what was found have a person.
fn depth_errors(found: &FoundHulls, judged: &JudgedView) -> Vec<f64> {
    let truth = judged.truth.instance.data.iter().zip(&judged.truth.depth_m);
    let both = found.pixels.iter().zip(truth).filter(|(_, (instance, _))| **instance > 0);
    both.filter_map(|(found, (_, depth_m))| Some(f64::from((found.as_ref()?.depth_m - depth_m).abs())))
        .collect()
}

pub(super) fn drawn(
    renderer: &mut Renderer,
    state: &SceneState,
    picture: &Picture,
    settings: Settings,
) -> Result<RgbImage> {
    let plan = plan::make(
        state,
        picture,
        Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() },
    );
    Ok(renderer.render(state, picture, &plan)?.image)
}

fn row(name: &str, outcome: &Outcome) -> String {
    let measures = outcome.run.measures();
    let cell = |of: &str, digits: usize| {
        measures.get(of).map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
    };
    let depth = if outcome.depths_m.is_empty() {
        "-".to_owned()
    } else {
        format!("{:.0}", outcome.depths_m.iter().sum::<f64>() / outcome.depths_m.len() as f64 * 1e3)
    };
    let people_ms = outcome.people_ms();
    format!(
        "{name} | {} | {} | {} | {depth} | {people_ms:.1} | {:.1} | {:.2}",
        cell("silhouette_iou", 3),
        cell("people_psnr_db", 2),
        cell("people_ssim", 3),
        median(&outcome.placing_ms),
        people_ms / median(&outcome.bare_ms).max(1e-6),
    )
}

/// Three people on a level place, and so many cameras around it with pictures of so many columns; a view so far beside the first of them,
/// or before them all.
pub(crate) fn ring(n_cameras: u32, columns: u32, aside_deg: Option<f64>) -> Value {
    let camera = |i: u32| {
        let turn = (f64::from(i) + 0.2) / f64::from(n_cameras) * std::f64::consts::TAU;
        // Two that face each other would see the same outlines.
        let turn = if n_cameras == 2 { turn * 0.5 } else { turn };
        json!({
            "id": format!("c{i:02}"),
            "eye_m": [9.0 * turn.cos(), 9.0 * turn.sin(), 3.2 + 0.4 * f64::from(i % 2)],
            "target_m": [0, 0, 0.7],
            "fov_x_deg": 62,
            "size_px": [columns, columns * 9 / 16],
        })
    };
    let walker = |id: &str, height_m: f64, clothes: [&str; 2], corners: Value, share: f64| {
        json!({
            "kind": "walker", "id": id, "height_m": height_m,
            "clothes": {
                "jacket_srgb": clothes[0], "trousers_srgb": clothes[1], "shoes_srgb": "#242222",
                "skin_srgb": "#d8a888", "hair_srgb": "#3c2a20",
            },
            "path": {"corners_m": corners, "laps": 1, "start_share": share},
        })
    };
    let turn = 0.2 / f64::from(n_cameras) * std::f64::consts::TAU * if n_cameras == 2 { 0.5 } else { 1.0 };
    let beside = |degrees: f64| {
        let (sine, cosine) = (turn + degrees.to_radians()).sin_cos();
        [8.0 * cosine, 8.0 * sine, 2.9]
    };
    json!({
        "version": 1, "name": "Ring", "description": "people in a ring of cameras", "seed": 7, "period_secs": 8,
        "sky": {"color_srgb": "#9cc4e6"},
        "light": {"sun": {"direction": [-0.4, -0.5, 0.8]}},
        "materials": {"ground": {"kind": "paving", "slab_srgb": "#aea798", "slab_m": 0.8}},
        "terrain": [{"kind": "level", "polygon": [[-14, -14], [14, -14], [14, 14], [-14, 14]], "material": "ground"}],
        "actors": [
            walker("red", 1.76, ["#c8302c", "#2c344c"], json!([[-2, -1], [0, -2], [1, -0.5], [-0.5, 0.5]]), 0.0),
            walker("blue", 1.68, ["#2c5cb4", "#a08c6c"], json!([[1.5, 0.8], [2.6, 1.8], [1.6, 2.8], [0.4, 1.8]]), 0.3),
            walker("green", 1.83, ["#2f8f4e", "#303030"], json!([[-2.8, 1], [-1.6, 1.4], [-1.8, 2.8], [-3, 2.4]]), 0.6),
        ],
        "cameras": (0..n_cameras).map(camera).collect::<Vec<Value>>(),
        "views": [{"id": "free", "eye_m": aside_deg.map_or([0.5, -6.5, 2.2], beside), "target_m": [0, 0, 0.9], "fov_deg": 45}],
    })
}
