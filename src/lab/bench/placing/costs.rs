//! `bench placing --costs`: time of an instant by cameras and by people.

use super::Masks;
use super::judge::{Judge, Kind, Method};
use super::world::judge_world;
use crate::report::{Figure, Point, Series, figure_page};
use anyhow::{Context as _, Result};
use serde_json::{Value, json};
use std::io::Write as _;
use std::path::Path;
use videofields::accuracy::machine;
use videofields_simulate::World;
use videofields_vision::clock::SystemClock;
use videofields_vision::measures::quantile;

const CAMERAS: [u32; 4] = [2, 3, 4, 6];
const PEOPLE: [u32; 6] = [1, 5, 10, 20, 40, 80];

/// Instants a second, and length of what is judged, seconds.
const RATE_HZ: f64 = 5.0;
const PERIOD_SECS: u32 = 8;

/// Sides of the square on which people walk, metres.
const SQUARE_M: [f64; 2] = [24.0, 18.0];

/// Returns the document of a world: a square on which people walk, with cameras around it.
fn square(n_cameras: u32, n_people: u32) -> Value {
    let camera = |idx: u32| {
        let (sine, cosine) =
            ((f64::from(idx) + 0.3) / f64::from(n_cameras) * std::f64::consts::TAU).sin_cos();
        json!({
            "id": format!("c{idx}"),
            "eye_m": [0.62 * SQUARE_M[0] * cosine, 0.62 * SQUARE_M[1] * sine, 5.0],
            "target_m": [0, 0, 0.5],
            "fov_x_deg": 76,
            "size_px": [640, 360],
        })
    };
    // Spreads places evenly, however many there are: Roberts 2018, the R2 sequence.
    let spread = |idx: u32, step: f64| (0.5 + step * f64::from(idx)).fract() - 0.5;
    let walker = |idx: u32| {
        let [x, y] = [
            (SQUARE_M[0] - 4.0) * spread(idx, 0.754_877_666),
            (SQUARE_M[1] - 4.0) * spread(idx, 0.569_840_291),
        ];
        let turn = f64::from(idx) * 2.4;
        let corner = |nth: f64| {
            let (sine, cosine) = (turn + nth * std::f64::consts::TAU / 3.0).sin_cos();
            [x + 1.8 * cosine, y + 1.8 * sine]
        };
        json!({
            "kind": "walker",
            "id": format!("p{idx:03}"),
            "height_m": 1.55 + 0.35 * (0.5 + spread(idx, 0.618_033_989)),
            "path": {"corners_m": [corner(0.0), corner(1.0), corner(2.0)], "laps": 1, "start_share": 0.5 + spread(idx, 0.381_966)},
        })
    };
    json!({
        "version": 1, "name": "Square", "description": "people on a square", "seed": 5, "period_secs": PERIOD_SECS,
        "sky": {"color_srgb": "#9cc4e6"},
        "light": {"sun": {"direction": [-0.4, -0.5, 0.8]}},
        "materials": {"ground": {"kind": "paving", "slab_srgb": "#aea798", "slab_m": 0.8}},
        "terrain": [{"kind": "level", "polygon": [[-20, -16], [20, -16], [20, 16], [-20, 16]], "material": "ground"}],
        "actors": (0..n_people).map(walker).collect::<Vec<Value>>(),
        "cameras": (0..n_cameras).map(camera).collect::<Vec<Value>>(),
        "views": [{"id": "free", "eye_m": [2, -14, 5], "target_m": [0, 0, 0.9], "fov_deg": 45}],
    })
}

/// Time of an instant, and how well people are found.
struct Row {
    mean_ms: f64,
    most_ms: f64,
    moda: f64,
}

fn measure(n_cameras: u32, n_people: u32) -> Result<Row> {
    let world = World::from_json("square", &square(n_cameras, n_people).to_string())?;
    let clock = SystemClock::new();
    let mut judge = Judge::new(&clock, 0.5, Method::Both);
    judge_world(&world, (RATE_HZ, Masks::True), &mut judge, &clock, |scene| Ok(scene.clone()))?;
    let mut times = judge.placing_ms().to_vec();
    // The first instant finds the cells of the scene.
    times.remove(0);
    times.sort_by(f64::total_cmp);
    let figures = judge.scores().get(&Kind::Walker).map(super::score::PlacingScore::figures);
    Ok(Row {
        mean_ms: times.iter().sum::<f64>() / times.len() as f64,
        most_ms: quantile(&times, 0.95),
        moda: figures.and_then(|of| of.moda).context("nobody is seen")?,
    })
}

/// Measures, prints a table, and draws it to `plot` if that is some.
pub(super) fn run(plot: Option<&Path>) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let machine = machine("");
    writeln!(
        out,
        "{}, {} processors; true masks of 640 x 360 pixels",
        machine.processor, machine.n_processors
    )?;
    writeln!(out, "\n| cameras | people | an instant: mean, ms | 95 %, ms | MODA |")?;
    writeln!(out, "| ---: | ---: | ---: | ---: | ---: |")?;
    let mut series = Vec::new();
    for n_cameras in CAMERAS {
        let mut points = Vec::new();
        for n_people in PEOPLE {
            let Row { mean_ms, most_ms, moda } = measure(n_cameras, n_people)?;
            writeln!(out, "| {n_cameras} | {n_people} | {mean_ms:.2} | {most_ms:.2} | {moda:.3} |")?;
            points.push(Point {
                x: mean_ms,
                y: f64::from(n_people),
                label: String::new(),
                is_marked: false,
                is_large: false,
            });
        }
        series.push(Series { name: format!("{n_cameras} cameras"), points, is_joined: true });
    }
    let Some(path) = plot else { return Ok(()) };
    let figure = Figure {
        title: "Time of placing people at one instant".to_owned(),
        x_name: "milliseconds an instant, mean".to_owned(),
        y_name: "people".to_owned(),
        is_log: true,
        series,
    };
    let text = figure_page(&figure)?.context("nothing to draw")?;
    std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
