//! The page: figures, tables and pictures in one HTML file that loads nothing.

use super::plot::{Figure, Point, Series, svg};
use super::{Report, ReportError, StageReport};
use base64::Engine as _;
use std::collections::BTreeSet;
use videofields::accuracy::{Example, Stage};
use videofields_picture::plan::CostRow;
use videofields_vision::encode;
use videofields_vision::frame::RgbImage;

const STYLE: &str = include_str!("page.css");

/// JPEG quality of the pictures: they are looked at, nothing is measured on them.
const QUALITY: u8 = 78;

/// Differences are shown this many times as large.
const DIFFERENCE_GAIN: u8 = 4;

const TIME: &str = "time, ms (median)";

/// The whole page.
pub(super) fn html(report: &Report, examples: &[Example]) -> Result<String, ReportError> {
    let mut body = head(report);
    for stage in Stage::ALL {
        if let Some(found) = report.stage(stage) {
            body += &section(report, stage, found)?;
        }
    }
    if let Some(unjudged) = &report.without_truth {
        body += &unjudged_section(unjudged);
    }
    body += &pictures(examples)?;
    body += &left_out(report);
    let title = format!("What accuracy costs: {}", escaped(&report.subject.id));
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
    ))
}

fn head(report: &Report) -> String {
    let machine = &report.machine;
    let rows = [
        ("Errors against", report.subject.truth.clone()),
        ("Looked at", report.subject.scope.clone()),
        ("Processor", format!("{}, {} of its processors", machine.processor, machine.n_processors)),
        ("Adapter", machine.adapter.clone()),
        ("Program", format!("videofields {}, {} build", machine.version, machine.build)),
        (
            "Measured",
            format!(
                "{}, in {:.0} s{}",
                report.measured_at,
                report.took_secs,
                if report.is_complete { "" } else { "; ended before all was measured" }
            ),
        ),
    ];
    let rows: String = rows
        .iter()
        .map(|(name, value)| format!("<tr><th scope=\"row\">{name}</th><td>{}</td></tr>\n", escaped(value)))
        .collect();
    let knee = report.knee.as_ref().map_or_else(String::new, |knee| {
        format!("<p class=\"knee\">The knee of the whole: <strong>{}</strong>.</p>\n", escaped(knee))
    });
    format!(
        "<h1>What accuracy costs: {} {}</h1>\n\
         <p>Each point is one setting: to the right it takes longer, further down it errs less. \
         A ring marks what is used where nothing else is said.</p>\n{knee}\
         <table class=\"facts\">\n{rows}</table>\n",
        escaped(&report.subject.kind),
        escaped(&report.subject.id)
    )
}

fn section(report: &Report, stage: Stage, found: &StageReport) -> Result<String, ReportError> {
    let mut text = format!(
        "<section id=\"{0}\">\n<h2>{0}</h2>\n<p>{1} Time is of {2}.</p>\n",
        found.name,
        about(stage),
        escaped(&found.work)
    );
    for figure in figures(report, stage, found) {
        if let Some(svg) = svg(&figure)? {
            text += &format!("<figure>\n{svg}</figure>\n");
        }
    }
    text += &table(stage, &found.rows, &report.front, report.knee.as_deref());
    Ok(text + "</section>\n")
}

const fn about(stage: Stage) -> &'static str {
    match stage {
        Stage::Segmentation => {
            "Every pixel of every frame against the simulator's instance masks, over the period that follows the one \
             in which the background was learned. F is the harmonic mean of precision and recall."
        }
        Stage::Map => {
            "Every texel's world point against the simulator's depth, where the ray meets the surface at half a degree \
             or more; of the first four cameras. What the world has and the scene does not is left out."
        }
        Stage::Placing => {
            "People at every frame, up to half a metre from where they are found, one to one; who shows 40 pixels in no camera does not \
             count. MODA is 1 less missed and false people as a share of those who are there. Columns are those in which masks are looked at, \
             sweeps how often everybody is moved and asked again, cells the sides of places where people are looked for."
        }
        Stage::Surfaces => {
            "The still part of views where no camera stands, as far as a camera sees it. Seam energy is the step at \
             pixels where another camera takes over, beyond the truth's step, and the seam ratio that over the same within what \
             one camera shows; flicker the change between frames beyond \
             the truth's; both in 8-bit codes."
        }
        Stage::Entities => {
            "People in views where no camera stands: their pixels and 4 around. Points are pruned early, billboards \
             late. Silhouettes are what a picture with entities shows and one without does not."
        }
        Stage::Pipeline => {
            "Whole pipelines, from what is worth having of each stage. The map is no part of them: no picture takes it."
        }
    }
}

/// Whether points say what was set.
#[derive(Clone, Copy, PartialEq)]
enum Labels {
    Shown,
    Hidden,
}

/// How a figure's upright axis runs.
#[derive(Clone, Copy, PartialEq)]
enum Scale {
    Linear,
    Logarithmic,
}

/// A stage's points of one knob.
fn series_of<'a>(
    name: &str,
    rows: impl Iterator<Item = &'a CostRow>,
    y: impl Fn(&CostRow) -> Option<f64>,
    labels: Labels,
) -> Series {
    let point = |row: &CostRow| {
        Some(Point {
            x: row.time_ms.median,
            y: y(row)?,
            label: if labels == Labels::Shown { row.value.clone() } else { String::new() },
            is_marked: row.is_default,
            is_large: false,
        })
    };
    Series { name: name.to_owned(), points: rows.filter_map(point).collect(), is_joined: true }
}

fn measure<'a>(name: &'a str) -> impl Fn(&CostRow) -> Option<f64> + 'a {
    move |row| row.measures.get(name).copied()
}

fn figure(title: &str, y_name: &str, scale: Scale, series: Vec<Series>) -> Figure {
    let is_log = scale == Scale::Logarithmic;
    Figure { title: title.to_owned(), x_name: TIME.to_owned(), y_name: y_name.to_owned(), is_log, series }
}

fn figures(report: &Report, stage: Stage, found: &StageReport) -> Vec<Figure> {
    let rows = &found.rows;
    // The default lies on every knob's curve: it is named once.
    let by_knob = |y: fn(&CostRow) -> Option<f64>| -> Vec<Series> {
        let mut knobs: Vec<&str> = rows.iter().map(|row| row.knob.as_str()).collect();
        knobs.dedup();
        let curve = |(place, knob): (usize, &str)| {
            let mut series = series_of(knob, rows.iter().filter(|row| row.knob == knob), y, Labels::Shown);
            for point in &mut series.points {
                point.label = match (point.is_marked, place) {
                    (true, 0) => "default".to_owned(),
                    (true, _) => String::new(),
                    (false, _) if knob == "modes" => format!("K {}", point.label),
                    (false, _) if knob == "samples" => format!("{} sample", point.label),
                    (false, _) => std::mem::take(&mut point.label),
                };
            }
            series
        };
        knobs.into_iter().enumerate().map(curve).collect()
    };
    match stage {
        Stage::Segmentation => {
            let series = by_knob(|row| row.error);
            vec![figure("Segmentation: error against time", &found.error, Scale::Linear, series)]
        }
        Stage::Placing => {
            let series = by_knob(|row| row.error);
            vec![figure("Placing: error against time", &found.error, Scale::Linear, series)]
        }
        Stage::Map => {
            let grids = || rows.iter().filter(|row| row.value != "ray");
            let ray = || rows.iter().filter(|row| row.value == "ray");
            let mut series = vec![
                series_of("grid, mean", grids(), measure("mean_m"), Labels::Shown),
                series_of("grid, worst", grids(), measure("worst_m"), Labels::Hidden),
                series_of("ray, mean", ray(), measure("mean_m"), Labels::Shown),
                series_of("ray, worst", ray(), measure("worst_m"), Labels::Hidden),
            ];
            series.retain(|series| !series.points.is_empty());
            vec![figure(
                "Grid against ray map: distance from the truth",
                "distance, m",
                Scale::Logarithmic,
                series,
            )]
        }
        Stage::Surfaces => {
            vec![figure(
                "Surfaces: error of the still part against time",
                &found.error,
                Scale::Linear,
                by_knob(|row| row.error),
            )]
        }
        Stage::Entities => {
            let early = || rows.iter().filter(|row| row.value.starts_with("points"));
            let late = || rows.iter().filter(|row| row.value == "billboards");
            let bare = || rows.iter().filter(|row| row.value == "none");
            let series = |y: fn(&CostRow) -> Option<f64>| {
                vec![
                    series_of("early pruning: points", early(), y, Labels::Shown),
                    series_of("deferred pruning: billboards", late(), y, Labels::Shown),
                    series_of("nothing drawn", bare(), y, Labels::Shown),
                ]
            };
            let missed = |row: &CostRow| Some(1.0 - row.measures.get("silhouette_iou")?);
            vec![
                figure(
                    "Early against deferred pruning: colour",
                    "RMSE at people, 8-bit codes",
                    Scale::Linear,
                    series(|row| row.error),
                ),
                figure(
                    "Early against deferred pruning: outline",
                    "1 - IoU of silhouettes",
                    Scale::Linear,
                    series(missed),
                ),
            ]
        }
        Stage::Pipeline => vec![pipeline_figure(report, found)],
    }
}

fn pipeline_figure(report: &Report, found: &StageReport) -> Figure {
    let place = |row: &CostRow| report.front.iter().position(|value| *value == row.value);
    let is_knee = |row: &CostRow| report.knee.as_ref() == Some(&row.value);
    let point = |row: &CostRow| {
        Some(Point {
            x: row.time_ms.median,
            y: row.error?,
            label: match (place(row), is_knee(row)) {
                (Some(number), true) => format!("{} (knee)", number + 1),
                (Some(number), false) => (number + 1).to_string(),
                (None, _) => String::new(),
            },
            is_marked: row.is_default,
            is_large: is_knee(row),
        })
    };
    let rows = |is_on_front: bool| found.rows.iter().filter(move |row| place(row).is_some() == is_on_front);
    let mut on_front: Vec<Point> = rows(true).filter_map(point).collect();
    on_front.sort_by(|a, b| a.x.total_cmp(&b.x));
    let beaten = Series {
        name: "beaten by another".to_owned(),
        points: rows(false).filter_map(point).collect(),
        is_joined: false,
    };
    let front = Series { name: "Pareto front".to_owned(), points: on_front, is_joined: true };
    let mut series = vec![front, beaten];
    series.retain(|series| !series.points.is_empty());
    figure("Whole pipelines: error against time", &found.error, Scale::Linear, series)
}

fn table(stage: Stage, rows: &[CostRow], front: &[String], knee: Option<&str>) -> String {
    // What the times were of is for those who predict, and stands in the CSV files.
    let is_shown = |name: &&str| !name.starts_with("work_") && !name.starts_with("took_ms_");
    let names: BTreeSet<&str> =
        rows.iter().flat_map(|row| row.measures.keys().map(String::as_str)).filter(is_shown).collect();
    let is_whole = stage == Stage::Pipeline;
    let mut rows: Vec<&CostRow> = rows.iter().collect();
    if is_whole {
        rows.sort_by(|a, b| a.time_ms.median.total_cmp(&b.time_ms.median));
    }
    let first = if is_whole { "on the front" } else { "knob" };
    let mut text = format!(
        "<div class=\"wide\"><table>\n<tr><th>{first}</th><th>value</th><th>ms</th><th>quartiles</th><th>memory</th>"
    );
    text.extend(names.iter().map(|name| format!("<th>{}</th>", escaped(&name.replace('_', " ")))));
    text += "</tr>\n";
    for row in rows {
        let place = front.iter().position(|value| *value == row.value);
        let knob = if is_whole {
            place.map_or_else(String::new, |place| (place + 1).to_string())
        } else {
            row.knob.clone()
        };
        let mut value = escaped(&row.value);
        if row.is_default {
            value += " <span class=\"mark\">default</span>";
        }
        if is_whole && knee == Some(row.value.as_str()) {
            value += " <span class=\"mark\">knee</span>";
        }
        let time = row.time_ms;
        text += &format!(
            "<tr><td>{}</td><td class=\"value\">{value}</td><td class=\"number\">{}</td><td class=\"number\">{} to {}</td><td class=\"number\">{}</td>",
            escaped(&knob),
            short(time.median),
            short(time.lower_quartile),
            short(time.upper_quartile),
            bytes(row.memory_bytes)
        );
        text.extend(names.iter().map(|name| {
            let value = row.measures.get(*name).map_or_else(|| "–".to_owned(), |value| short(*value));
            format!("<td class=\"number\">{value}</td>")
        }));
        text += "</tr>\n";
    }
    text + "</table></div>\n"
}

fn unjudged_section(unjudged: &crate::unjudged::Unjudged) -> String {
    let mut text = "<section id=\"without-truth\">\n<h2>without truth</h2>\n\
         <p>Nobody knows what this scene truly looks like. Instead each camera is left out in turn and its background \
         compared with what the others' backgrounds give at its place, where another camera sees the surface; and \
         frames are held back from learning and compared with the background that was learned without them.</p>\n\
         <div class=\"wide\"><table>\n<tr><th>camera</th><th>seen by others</th><th>RMSE</th><th>PSNR, dB</th><th>SSIM</th>\
         <th>frames held back</th><th>mean difference, codes</th><th>still pixels called moving</th></tr>\n".to_owned();
    for camera in &unjudged.cameras {
        let cell = |value: Option<f64>| {
            format!("<td class=\"number\">{}</td>", value.map_or_else(|| "–".to_owned(), short))
        };
        let left_out = camera.left_out.as_ref();
        let held = camera.held_back.as_ref();
        text += &format!(
            "<tr><td>{}</td>{}{}{}{}<td class=\"number\">{}</td>{}{}</tr>\n",
            escaped(&camera.id),
            cell(left_out.map(|of| of.seen_share)),
            cell(left_out.and_then(|of| of.rmse)),
            cell(left_out.and_then(|of| of.psnr_db)),
            cell(left_out.and_then(|of| of.ssim)),
            held.map_or(0, |of| of.n_frames),
            cell(held.and_then(|of| of.mean_difference_codes)),
            cell(held.and_then(|of| of.false_share)),
        );
    }
    text + "</table></div>\n</section>\n"
}

fn pictures(examples: &[Example]) -> Result<String, ReportError> {
    if examples.is_empty() {
        return Ok(String::new());
    }
    let mut text = format!(
        "<section id=\"pictures\">\n<h2>pictures</h2>\n<p>The same view and instant each time: as it is drawn, as it truly is, \
         and the difference, {DIFFERENCE_GAIN} times as large as it is.</p>\n"
    );
    for example in examples {
        text += &format!("<h3>{}</h3>\n<div class=\"triple\">\n", escaped(&example.title));
        let difference = difference(&example.picture, &example.truth);
        for (name, picture) in
            [("drawn", &example.picture), ("true", &example.truth), ("difference", &difference)]
        {
            let data = base64::engine::general_purpose::STANDARD.encode(encode::jpeg(picture, QUALITY)?);
            text += &format!(
                "<figure><img src=\"data:image/jpeg;base64,{data}\" width=\"{}\" height=\"{}\" alt=\"{name}: {}\"><figcaption>{name}</figcaption></figure>\n",
                picture.width,
                picture.height,
                escaped(&example.title)
            );
        }
        text += "</div>\n";
    }
    Ok(text + "</section>\n")
}

fn difference(a: &RgbImage, b: &RgbImage) -> RgbImage {
    let data =
        a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b).saturating_mul(DIFFERENCE_GAIN)).collect();
    RgbImage { width: a.width, height: a.height, data }
}

fn left_out(report: &Report) -> String {
    if report.skipped.is_empty() {
        return String::new();
    }
    let items: String = report
        .skipped
        .iter()
        .map(|skipped| {
            format!(
                "<li>{} {} {}: {}</li>\n",
                escaped(&skipped.stage),
                escaped(&skipped.knob),
                escaped(&skipped.value),
                escaped(&skipped.reason)
            )
        })
        .collect();
    format!("<section id=\"left-out\">\n<h2>not measured</h2>\n<ul>\n{items}</ul>\n</section>\n")
}

fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if size < 1e-3 {
        format!("{value:.1e}")
    } else if size < 1.0 {
        format!("{value:.3}")
    } else if size < 100.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.0}")
    }
}

fn bytes(count: u64) -> String {
    let count = count as f64;
    if count < 1e3 {
        format!("{count} B")
    } else if count < 1e6 {
        format!("{:.1} kB", count / 1e3)
    } else {
        format!("{:.1} MB", count / 1e6)
    }
}

/// Text as HTML shows it.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
