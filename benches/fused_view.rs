//! What the fused view's passes cost, as ratios to a pass that only fills the picture: all in one run, in turns.
//!
//! `cargo bench --bench fused_view [-- <turns>]` prints tables for docs/benchmarks/fused-view.md: ratios, then curves over
//! pixels, cameras and people. The device's own clock is read; a device without one is told so.

#![expect(clippy::print_stdout, reason = "a bench reports on standard output")]

use videofields_lab::made_scenes::{SIZE_PX, quartiles, settings, tiled, yard};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{self, Colors, EntityStyle, Filtering, Picture, Plan, Settings, Wishes};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_vision::config::RenderSettings;

/// Medians of fewer mean little.
const LEAST_TURNS: usize = 31;

/// Pictures of one kind, with what was measured of them.
struct Case {
    name: String,
    state: SceneState,
    picture: Picture,
    plan: Plan,
    /// Milliseconds of the passes that count, a turn each.
    took_ms: Vec<f64>,
}

impl Case {
    fn new(name: &str, state: SceneState, picture: &Picture, settings: Settings) -> Self {
        let wishes =
            Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() };
        let plan = plan::make(&state, picture, wishes);
        Self { name: name.to_owned(), state, picture: picture.clone(), plan, took_ms: Vec::new() }
    }

    /// Draws it once; `passes` are those that count.
    fn turn(&mut self, renderer: &mut Renderer, passes: &[&str]) -> f64 {
        let rendered = renderer.render(&self.state, &self.picture, &self.plan).expect("a picture");
        let counted = rendered.timings.iter().filter(|time| passes.contains(&time.pass));
        counted.map(|time| time.gpu.as_secs_f64() * 1e3).sum()
    }
}

/// Draws all cases in turns and prints them beside the first.
fn measure(renderer: &mut Renderer, title: &str, mut cases: Vec<Case>, passes: &[&str], n_turns: usize) {
    // What is new to the device, and pipelines, are not what is measured.
    for case in &mut cases {
        case.turn(renderer, passes);
    }
    for _ in 0..n_turns {
        for case in &mut cases {
            let took = case.turn(renderer, passes);
            case.took_ms.push(took);
        }
    }
    println!("\n{title}\n\n| what | ms (quartiles) | ratio (quartiles) |\n| --- | --- | --- |");
    let base = cases[0].took_ms.clone();
    for case in &cases {
        let [low, median, high] = quartiles(&case.took_ms);
        let ratios: Vec<f64> = case.took_ms.iter().zip(&base).map(|(took, base)| took / base).collect();
        let [ratio_low, ratio, ratio_high] = quartiles(&ratios);
        let name = &case.name;
        println!(
            "| {name} | {median:.2} ({low:.2} to {high:.2}) | {ratio:.2} ({ratio_low:.2} to {ratio_high:.2}) |"
        );
    }
}

/// What a picture costs over its pixels, over cameras of which three see any place, and over people.
fn curves(renderer: &mut Renderer, n_turns: usize) {
    let all = ["surface", "billboard", "points"];
    let of = |style| settings(style, Filtering::Levels, 4);
    let sized = |(width, height): (u32, u32)| {
        let (state, picture) = yard(20, (width, height));
        Case::new(&format!("{width} x {height}"), state, &picture, of(EntityStyle::Billboards))
    };
    let sizes = [(320, 180), (640, 360), (1280, 720), (1920, 1080), (2560, 1440), (3840, 2160)];
    let title = "Over pixels: the yard with three cameras and 20 people as billboards, 4 samples";
    measure(renderer, title, sizes.map(sized).into(), &all, n_turns);
    let cameras = |(cells, beside): ([u32; 2], u32)| {
        let (state, picture) = tiled(cells, 3, beside);
        let name = format!("{} cameras", state.cameras.len());
        Case::new(&name, state, &picture, of(EntityStyle::None))
    };
    let counts = [([1, 1], 0), ([2, 1], 0), ([2, 2], 0), ([4, 2], 0), ([8, 2], 0), ([11, 3], 1)];
    let title = "Over cameras: ground of which three see any place, 1280 x 720, 4 samples";
    measure(renderer, title, counts.map(cameras).into(), &all, n_turns);
    let people = |n_people: usize, style| {
        let (mut state, picture) = yard(n_people, SIZE_PX);
        if style == EntityStyle::Points {
            state.place_points(1);
        }
        let word = if style == EntityStyle::Points { "points" } else { "billboards" };
        Case::new(&format!("{n_people} people as {word}"), state, &picture, of(style))
    };
    for style in [EntityStyle::Billboards, EntityStyle::Points] {
        let cases = [0, 10, 20, 40, 80, 160].map(|n_people| people(n_people, style));
        let title = "Over people: the yard with three cameras, 1280 x 720, 4 samples";
        measure(renderer, title, cases.into(), &all, n_turns);
    }
}

fn main() {
    let n_turns = std::env::args().filter_map(|arg| arg.parse().ok()).next().unwrap_or(LEAST_TURNS);
    let gpu = match Gpu::new("") {
        Ok(gpu) => gpu,
        Err(error) => return println!("no adapter: {error}"),
    };
    println!("{}, {} x {}, {n_turns} turns", gpu.name(), SIZE_PX.0, SIZE_PX.1);
    let mut renderer = Renderer::new(gpu, &RenderSettings::default()).expect("a renderer");
    for (samples, filtering) in
        [(1, Filtering::Levels), (1, Filtering::Bilinear), (1, Filtering::Nearest), (4, Filtering::Levels)]
    {
        let settings = settings(EntityStyle::None, filtering, samples);
        let case = |name: &str, cells, per_cell, beside| {
            let (state, picture) = tiled(cells, per_cell, beside);
            Case::new(name, state, &picture, settings)
        };
        let cases = vec![
            case("fills the picture, no camera", [1, 1], 1, 0).without_cameras(),
            case("1 camera", [1, 1], 1, 0),
            case("3 cameras, all see every pixel", [1, 1], 3, 0),
            case("8 cameras, 3 see any pixel", [2, 1], 3, 2),
            case("100 cameras, 3 see any pixel", [11, 3], 3, 1),
        ];
        let title = format!("Surfaces, {samples} samples, {filtering:?}");
        measure(&mut renderer, &title, cases, &["surface"], n_turns);
    }
    let all = ["surface", "billboard", "points"];
    let case = |name: &str, n_people, style| {
        let (mut state, picture) = yard(n_people, SIZE_PX);
        if style == EntityStyle::Points {
            state.place_points(1);
        }
        Case::new(name, state, &picture, settings(style, Filtering::Levels, 1))
    };
    let cases = vec![
        case("3 cameras, 6 boxes, nobody", 20, EntityStyle::None),
        case("20 people as billboards", 20, EntityStyle::Billboards),
        case("20 people as points", 20, EntityStyle::Points),
    ];
    measure(&mut renderer, "People", cases, &all, n_turns);
    curves(&mut renderer, n_turns);
}

impl Case {
    /// The same without a camera: what it takes to fill the picture.
    fn without_cameras(mut self) -> Self {
        self.state.cameras.clear();
        let wishes = Wishes {
            settings: settings(EntityStyle::None, Filtering::Levels, self.plan.sampling.samples),
            see_through: false,
            colors: Colors::Raw,
            effects: Default::default(),
        };
        self.plan = plan::make(&self.state, &self.picture, wishes);
        self
    }
}
