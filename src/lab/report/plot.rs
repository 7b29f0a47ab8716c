//! Curves of error against milliseconds, as SVG to be put into a page.
//!
//! Series of points go in. Ink takes the page's own colour, so that a figure reads in light and dark; series have
//! colours that stand out from both.

use super::ReportError;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint, Ranged};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Drawn in this colour, which nothing else has, and replaced by the page's own.
const INK: RGBColor = RGBColor(1, 2, 3);
const INK_HEX: &str = "#010203";

const COLORS: [RGBColor; 6] = [
    RGBColor(0x2f, 0x7d, 0xe1),
    RGBColor(0xe0, 0x6c, 0x1f),
    RGBColor(0x2e, 0x9e, 0x5b),
    RGBColor(0xb0, 0x5a, 0xd0),
    RGBColor(0xd6, 0x45, 0x65),
    RGBColor(0x8a, 0x8a, 0x2a),
];

/// Letters are about this wide, share of their height: to see which labels would overlap.
const LETTER: f64 = 0.56;
const LABEL_PX: i32 = 12;

/// A point of a figure.
#[derive(Clone, Debug)]
pub struct Point {
    /// Milliseconds, above 0.
    pub x: f64,
    /// An error, at least 0.
    pub y: f64,
    /// Written beside it; empty for none.
    pub label: String,
    /// Drawn with a ring: the default.
    pub is_marked: bool,
    /// Drawn larger: the knee.
    pub is_large: bool,
}

/// Points of one colour.
#[derive(Clone, Debug)]
pub struct Series {
    /// Stands in the legend where there are several.
    pub name: String,
    /// In the order in which a line joins them.
    pub points: Vec<Point>,
    /// Whether a line joins them, in their order.
    pub is_joined: bool,
}

/// A figure.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Above it.
    pub title: String,
    /// What the milliseconds are of.
    pub x_name: String,
    /// What the error is.
    pub y_name: String,
    /// Whether the error's axis is logarithmic; milliseconds always are.
    pub is_log: bool,
    /// Each in a colour of its own.
    pub series: Vec<Series>,
}

const SIZE_PX: (u32, u32) = (760, 430);

/// An axis: its values are drawn as they are or as their logarithms.
#[derive(Clone, Debug)]
struct Axis {
    range: std::ops::Range<f64>,
    marks: Vec<f64>,
    is_log: bool,
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let share = (self.place(*value) - self.range.start) / (self.range.end - self.range.start);
        from + (share * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.marks.iter().map(|place| self.value(*place)).collect()
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.value(self.range.start)..self.value(self.range.end)
    }
}

impl Axis {
    fn place(&self, value: f64) -> f64 {
        if self.is_log { value.max(1e-300).log10() } else { value }
    }

    fn value(&self, place: f64) -> f64 {
        if self.is_log { 10_f64.powf(place) } else { place }
    }

    /// A logarithmic axis around positive values, with marks as close as they fit.
    fn log(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (low, high) = values
            .filter(|value| *value > 0.0 && value.is_finite())
            .fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        if high <= 0.0 {
            return None;
        }
        let (low, high) = (low.log10(), high.log10());
        // Room beside the outermost points, and never less than half a decade in all.
        let room = (0.08 * (high - low)).max(0.12).max(0.25 - 0.5 * (high - low));
        let range = low - room..high + room;
        let decades = range.start.floor() as i32..=range.end.ceil() as i32;
        let span = range.end - range.start;
        let leading: &[f64] = if span < 1.2 {
            &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0]
        } else if span < 2.5 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let every = (span / 8.0).ceil().max(1.0) as i32;
        let marks = decades
            .filter(|decade| decade.rem_euclid(every) == 0)
            .flat_map(|decade| leading.iter().map(move |digit| f64::from(decade) + digit.log10()))
            .filter(|place| range.contains(place))
            .collect();
        Some(Self { range, marks, is_log: true })
    }

    /// A linear axis from zero, or from below all values where they lie far above it.
    fn linear(values: impl Iterator<Item = f64>) -> Self {
        let (least, most) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        let most = if most > 0.0 { most } else { 1.0 };
        let from = if least > 0.5 * most { least - 0.4 * (most - least).max(0.02 * most) } else { 0.0 };
        let range = from..most + 0.12 * (most - from);
        let rough = (range.end - range.start) / 6.0;
        let decade = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * decade).into_iter().find(|step| *step >= rough);
        let step = step.unwrap_or(rough);
        let first = (range.start / step).ceil() as i64;
        let marks =
            (first..).map(|number| number as f64 * step).take_while(|mark| *mark <= range.end).collect();
        Self { range, marks, is_log: false }
    }
}

/// The figure as an SVG element; `None` where it has no points.
pub(super) fn svg(figure: &Figure) -> Result<Option<String>, ReportError> {
    let points: Vec<&Point> = figure.series.iter().flat_map(|series| &series.points).collect();
    let Some(x_axis) = Axis::log(points.iter().map(|point| point.x)) else { return Ok(None) };
    let y_log = figure.is_log.then(|| Axis::log(points.iter().map(|point| point.y))).flatten();
    let y_axis = y_log.unwrap_or_else(|| Axis::linear(points.iter().map(|point| point.y)));
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE_PX).into_drawing_area();
        draw(&root, figure, &x_axis, &y_axis).map_err(ReportError::Plot)?;
    }
    Ok(Some(text.replace(INK_HEX, "currentColor")))
}

/// The figure as an SVG file of its own, dark ink on white; `None` where it has no points.
///
/// # Errors
/// [`ReportError::Plot`] when it cannot be drawn.
pub fn figure_page(figure: &Figure) -> Result<Option<String>, ReportError> {
    let text = svg(figure)?;
    Ok(text.map(|text| text.replacen("<svg ", "<svg style=\"background:#fff;color:#222\" ", 1)))
}

fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".to_owned()
    } else if !(1e-4..1e6).contains(&size) {
        format!("{value:.0e}")
    } else {
        // Three digits that count, without zeros that do not.
        let digits = (2 - size.log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    }
}

fn ink(size_px: i32) -> TextStyle<'static> {
    ("sans-serif", size_px).into_font().color(&INK)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn draw(root: &Area<'_>, figure: &Figure, x_axis: &Axis, y_axis: &Axis) -> Result<(), String> {
    let told = |error: DrawingAreaErrorKind<std::io::Error>| error.to_string();
    let mut chart = ChartBuilder::on(root)
        .margin(12)
        .margin_right(24)
        .caption(&figure.title, ink(16))
        .x_label_area_size(44)
        .y_label_area_size(72)
        .build_cartesian_2d(x_axis.clone(), y_axis.clone())
        .map_err(told)?;
    chart
        .configure_mesh()
        .bold_line_style(INK.mix(0.16))
        .light_line_style(INK.mix(0.0))
        .axis_style(INK.mix(0.6))
        .x_desc(&figure.x_name)
        .y_desc(&figure.y_name)
        .axis_desc_style(ink(13))
        .label_style(ink(12))
        .x_labels(16)
        .y_labels(16)
        .x_label_formatter(&|value| number(*value))
        .y_label_formatter(&|value| number(*value))
        .draw()
        .map_err(told)?;
    let place = |point: &Point| (point.x, point.y);
    for (series, color) in figure.series.iter().zip(COLORS.iter().cycle()) {
        let places = || series.points.iter().map(place);
        if series.is_joined {
            chart.draw_series(LineSeries::new(places(), color.stroke_width(2))).map_err(told)?;
        }
        let dots = series
            .points
            .iter()
            .map(|point| Circle::new(place(point), if point.is_large { 7 } else { 4 }, color.filled()));
        let drawn = chart.draw_series(dots).map_err(told)?;
        if figure.series.len() > 1 {
            let color = *color;
            drawn.label(&series.name).legend(move |(x, y)| Circle::new((x + 8, y), 4, color.filled()));
        }
        let marked = series.points.iter().filter(|point| point.is_marked);
        let rings = marked.map(|point| Circle::new(place(point), 10, INK.stroke_width(2)));
        chart.draw_series(rings).map_err(told)?;
    }
    let all = || figure.series.iter().flat_map(|series| &series.points);
    let dots: Vec<(i32, i32)> = all().map(|point| chart.backend_coord(&place(point))).collect();
    let (legend, covered) = legend_place(figure, &dots);
    if figure.series.len() > 1 {
        chart
            .configure_series_labels()
            .position(legend)
            .label_font(ink(12))
            .border_style(INK.mix(0.3))
            .draw()
            .map_err(told)?;
    }
    // Labels last, each where it covers none before it.
    let mut taken: Vec<[i32; 4]> = Vec::new();
    if figure.series.len() > 1 {
        taken.push(covered);
    }
    let at = |point: &Point| chart.backend_coord(&place(point));
    taken.extend(dots.iter().map(|(x, y)| [x - 5, y - 5, x + 5, y + 5]));
    for point in all().filter(|point| !point.label.is_empty()) {
        if let Some((corner, covered)) = free_place(at(point), &point.label, &taken) {
            let style = ink(LABEL_PX).pos(Pos::new(HPos::Left, VPos::Top));
            root.draw(&Text::new(point.label.clone(), corner, style)).map_err(told)?;
            taken.push(covered);
        }
    }
    root.present().map_err(told)
}

/// Returns where the names of the series stand, and what they cover: at the right, below where points lie above and none does there.
fn legend_place(figure: &Figure, dots: &[(i32, i32)]) -> (SeriesLabelPosition, [i32; 4]) {
    let longest = figure.series.iter().map(|series| series.name.chars().count()).max().unwrap_or(0);
    let width = (longest as f64 * f64::from(LABEL_PX) * LETTER) as i32 + 60;
    let height = 26 + 20 * figure.series.len() as i32;
    let (right, bottom) = (SIZE_PX.0 as i32, SIZE_PX.1 as i32 - 56);
    let above = [right - 30 - width, 30, right, 30 + height];
    let below = [right - 30 - width, bottom - height, right, bottom];
    let is_free =
        |of: &[i32; 4]| dots.iter().all(|(x, y)| *x < of[0] || *x > of[2] || *y < of[1] || *y > of[3]);
    if !is_free(&above) && is_free(&below) {
        (SeriesLabelPosition::LowerRight, below)
    } else {
        (SeriesLabelPosition::UpperRight, above)
    }
}

/// Where a label fits beside a point: its corner, and what it covers; `None` where it fits nowhere.
fn free_place((x, y): (i32, i32), label: &str, taken: &[[i32; 4]]) -> Option<((i32, i32), [i32; 4])> {
    let width = (label.chars().count() as f64 * f64::from(LABEL_PX) * LETTER) as i32 + 4;
    let height = LABEL_PX + 2;
    let (right, left, above, below) = (x + 10, x - 10 - width, y - 10 - height, y + 10);
    let (middle_x, middle_y) = (x - width / 2, y - height / 2);
    let corners = [
        (right, above + 4),
        (right, middle_y),
        (middle_x, above),
        (middle_x, below),
        (right, below),
        (left, middle_y),
        (left, above),
        (left, below),
        (middle_x, above - height),
        (middle_x, below + height),
        (right, above - height),
        (right, below + height),
    ];
    corners.into_iter().find_map(|(left, top)| {
        let covered = [left, top, left + width, top + height];
        let is_inside = left >= 70
            && top >= 28
            && covered[2] <= SIZE_PX.0 as i32 - 6
            && covered[3] <= SIZE_PX.1 as i32 - 52;
        let is_free = taken
            .iter()
            .all(|[l, t, r, b]| covered[2] <= *l || covered[0] >= *r || covered[3] <= *t || covered[1] >= *b);
        (is_inside && is_free).then_some(((left, top), covered))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64, label: &str) -> Point {
        Point { x, y, label: label.to_owned(), is_marked: label == "b", is_large: false }
    }

    #[test]
    fn a_figure_names_axes_points_and_series_and_fixes_no_ink() {
        let points = vec![point(1.0, 0.5, "a"), point(20.0, 0.01, "b")];
        let series = |name: &str| Series { name: name.to_owned(), points: points.clone(), is_joined: true };
        let mut figure = Figure {
            title: "T".to_owned(),
            x_name: "time, ms".to_owned(),
            y_name: "error, m".to_owned(),
            is_log: true,
            series: vec![series("one"), series("two")],
        };
        for is_log in [true, false] {
            figure.is_log = is_log;
            let text = svg(&figure).unwrap().unwrap();
            for expected in ["time, ms", "error, m", "one", "two", "currentColor", "<svg"] {
                assert!(text.contains(expected), "{expected}: {text}");
            }
            assert!(!text.contains(INK_HEX));
        }
        figure.series.clear();
        assert_eq!(svg(&figure).unwrap(), None);
    }

    #[test]
    fn numbers_have_the_digits_that_count() {
        let check = |value: f64, expected: &str| assert_eq!(number(value), expected);
        check(0.0, "0");
        check(0.05, "0.05");
        check(0.25, "0.25");
        check(2.0, "2");
        check(12.34, "12.3");
        check(1500.0, "1500");
        check(1e-6, "1e-6");
    }

    #[test]
    fn the_names_of_series_stand_where_no_point_lies() {
        let series = |name: &str| Series { name: name.to_owned(), points: Vec::new(), is_joined: true };
        let figure = Figure {
            title: String::new(),
            x_name: String::new(),
            y_name: String::new(),
            is_log: false,
            series: vec![series("2 cameras"), series("3 cameras")],
        };
        let is_low = |dots: &[(i32, i32)]| {
            let (position, [.., top, _, bottom]) = legend_place(&figure, dots);
            assert!(top < bottom);
            matches!(position, SeriesLabelPosition::LowerRight)
        };
        let (above, below) = ((720, 60), (720, 350));
        assert!(!is_low(&[]) && !is_low(&[below]) && !is_low(&[(100, 60)]));
        assert!(is_low(&[above]) && !is_low(&[above, below]));
    }

    #[test]
    fn labels_stay_clear_of_one_another() {
        let first = free_place((300, 200), "half", &[]).unwrap();
        let second = free_place((300, 200), "half", &[first.1]).unwrap();
        assert_ne!(first.0, second.0);
        assert_eq!(free_place((300, 200), "half", &[[0, 0, 800, 800]]), None);
    }
}
