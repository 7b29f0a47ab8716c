//! Outlines of upright people in a camera's picture: the rows that somebody who stands at a place would cover.
//!
//! A place, a height and a camera flow in; spans of rows flow out. People are stacks of level discs, which are ellipses in a picture,
//! however the camera is turned; discs that a surface of the scene hides cover nothing.

use glam::{DVec2, DVec3};
use std::ops::Range;
use videofields_vision::geometry::{Camera, Surfaces};

/// Heights of the discs, share of the whole height, and their radii, metres, of somebody as tall as [`TYPICAL_M`].
const DISCS: [[f64; 2]; 14] = [
    [0.02, 0.14],
    [0.09, 0.13],
    [0.17, 0.13],
    [0.25, 0.14],
    [0.33, 0.15],
    [0.41, 0.16],
    [0.49, 0.19],
    [0.57, 0.21],
    [0.65, 0.22],
    [0.73, 0.23],
    [0.80, 0.22],
    [0.86, 0.14],
    [0.92, 0.11],
    [0.97, 0.08],
];

/// Height of somebody of whom nothing is known, metres.
pub(super) const TYPICAL_M: f64 = 1.7;

/// Heights at which people are looked for first, metres: adults who stand, children and those who sit.
pub(super) const FIRST_M: [f64; 2] = [TYPICAL_M, 1.15];

/// Rows beyond the picture for which spans are looked at, share of its height: what lies further off counts as if it were not there.
const BEYOND: f64 = 1.0;

/// Least distance along a camera's axis at which it shows somebody, metres.
pub(super) const LEAST_DEPTH_M: f64 = 0.2;

/// Rows from the feet to the head beneath which a silhouette is not moved but made anew.
const LEAST_ROWS: f64 = 4.0;

/// Somebody who stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Body {
    pub(super) foot_in_world: DVec3,
    /// Metres.
    pub(super) height_m: f64,
}

/// Returns bits of the discs of `body` that surfaces hide from `camera`.
pub(super) fn hidden_discs(camera: &Camera, surfaces: &Surfaces, body: &Body) -> u16 {
    let eye = camera.pose().position_in_world;
    let [foot, head] = ends_in_camera(camera, body);
    let bit = |(idx, [share, _]): (usize, &[f64; 2])| {
        let center = body.foot_in_world + DVec3::Z * (share * body.height_m);
        let is_before = foot.lerp(head, *share).z > LEAST_DEPTH_M;
        u16::from(is_before && surfaces.is_hidden(eye, center)) << idx
    };
    DISCS.iter().enumerate().map(bit).fold(0, std::ops::BitOr::bitor)
}

/// Returns where the foot and the top of a body are along the camera's own axes, metres.
fn ends_in_camera(camera: &Camera, body: &Body) -> [DVec3; 2] {
    [0.0, body.height_m]
        .map(|up_m| camera.pose().local_from_world_point(body.foot_in_world + DVec3::Z * up_m))
}

/// Feet and head of a body in a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    foot_px: DVec2,
    head_px: DVec2,
    /// Distance of the middle along the camera's axis, metres.
    depth_m: f64,
}

impl Axis {
    /// Returns that of `body` in pictures of `size` columns and rows by `camera`; none where it is not before the camera.
    pub(super) fn of(camera: &Camera, size: (usize, usize), body: &Body) -> Option<Self> {
        let size = DVec2::new(size.0 as f64, size.1 as f64);
        let [foot, head] = [DISCS[0][0], DISCS[DISCS.len() - 1][0]]
            .map(|share| camera.project(body.foot_in_world + DVec3::Z * (share * body.height_m)));
        let (foot, head) = (foot?, head?);
        let depth_m = f64::midpoint(foot.depth_m, head.depth_m);
        (depth_m > LEAST_DEPTH_M).then_some(Self {
            foot_px: foot.texture * size,
            head_px: head.texture * size,
            depth_m,
        })
    }

    fn slope(&self) -> f64 {
        (self.head_px.x - self.foot_px.x) / (self.head_px.y - self.foot_px.y)
    }
}

/// Way of a silhouette to where another body stands: rows are moved and scaled, and in each of them columns around the axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    from: DVec2,
    to: DVec2,
    /// Rows there for a row here, and columns for a column.
    scale: DVec2,
    /// Columns by which the axis goes to the right from a row to the next, here and there.
    slopes: [f64; 2],
}

impl Motion {
    /// Returns none where the body is seen from so far above that rows tell nothing of heights.
    pub(super) fn between(from: &Axis, to: &Axis) -> Option<Self> {
        let rows = |axis: &Axis| axis.foot_px.y - axis.head_px.y;
        let (here, there) = (rows(from), rows(to));
        (here > LEAST_ROWS && there > LEAST_ROWS).then(|| Self {
            from: from.foot_px,
            to: to.foot_px,
            scale: DVec2::new(from.depth_m / to.depth_m, there / here),
            slopes: [from.slope(), to.slope()],
        })
    }

    /// Returns the area there of a pixel here.
    pub(super) fn area_scale(&self) -> f32 {
        (self.scale.x * self.scale.y) as f32
    }

    /// Calls `row` with every `stride`-th of the rows that `silhouette` covers there, and its columns, in a picture of `size` columns and
    /// rows.
    pub(super) fn rows(
        &self,
        silhouette: &Silhouette,
        (width, height): (usize, usize),
        stride: usize,
        mut row: impl FnMut(usize, [f32; 2]),
    ) {
        let there = |y: f64| self.to.y + (y - self.from.y) * self.scale.y;
        let first = silhouette.first_row as f64;
        let top = (there(first) - 0.5).ceil().max(0.0) as usize;
        let bottom = (there(first + silhouette.spans.len() as f64) - 0.5).ceil().clamp(0.0, height as f64);
        // Both the row here and the way of the axis to the right are straight lines over the rows there.
        let here = |y: f64| self.from.y + (y + 0.5 - self.to.y) / self.scale.y;
        let shift = |y: f64| {
            let axis_here = self.from.x + (here(y) - self.from.y) * self.slopes[0];
            self.to.x + (y + 0.5 - self.to.y) * self.slopes[1] - axis_here * self.scale.x
        };
        let (row_here, shift) = (line(top as f64, |y| here(y) - first - 0.5), line(top as f64, shift));
        let (scale, width) = (self.scale.x as f32, width as f32);
        for y in (top + stride / 2..bottom as usize).step_by(stride) {
            let at = |line: [f32; 2]| line[0] + line[1] * (y - top) as f32;
            let [left, right] = silhouette.between_rows(at(row_here));
            if left < right {
                let shift = at(shift);
                row(y, [left, right].map(|x| (x * scale + shift).clamp(0.0, width)));
            }
        }
    }
}

/// Returns the value of a straight line at `start`, and by how much it rises for each 1 from there.
fn line(start: f64, value: impl Fn(f64) -> f64) -> [f32; 2] {
    let first = value(start);
    [first as f32, (value(start + 1.0) - first) as f32]
}

/// Pixels that a body covers in a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Silhouette {
    pub(super) first_row: usize,
    /// Columns of each row from the first on, from the left edge (0) to the right edge of the picture; empty where left is not below
    /// right.
    pub(super) spans: Box<[[f32; 2]]>,
    /// Area with what lies beyond the picture's border and what surfaces hide, pixels.
    pub(super) area_px: f32,
}

impl Silhouette {
    /// Returns the same, wider to both sides by a share of its number of rows, and by the half pixel that masks of whole pixels have more,
    /// in a picture of `width` columns.
    pub(super) fn widened(&self, share: f32, width: usize) -> Self {
        let by = share * self.spans.len() as f32 + 0.5;
        let widen = |[left, right]: &[f32; 2]| {
            if left < right {
                [(left - by).max(0.0), (right + by).min(width as f32)]
            } else {
                [*left, *right]
            }
        };
        Self { spans: self.spans.iter().map(widen).collect(), ..self.clone() }
    }

    /// Returns the whole pixels of each row, counted row by row in a picture of `width` columns.
    pub(super) fn runs(&self, width: usize) -> impl Iterator<Item = Range<usize>> {
        self.spans.iter().enumerate().map(move |(row, ends)| {
            let [left, right] = ends.map(|end| (end.round() as usize).min(width));
            let first = (self.first_row + row) * width;
            first + left..first + right
        })
    }

    /// Returns the columns at a place between the middles of rows, counted from that of the first.
    fn between_rows(&self, row: f32) -> [f32; 2] {
        let last = self.spans.len() - 1;
        let row = row.clamp(0.0, last as f32);
        let whole = row as usize;
        let (share, [above, below]) =
            (row - whole as f32, [whole, whole + 1].map(|row| self.spans[row.min(last)]));
        let is_empty = |[left, right]: [f32; 2]| left >= right;
        if is_empty(above) || is_empty(below) {
            return if share < 0.5 { above } else { below };
        }
        [0, 1].map(|end| above[end] + share * (below[end] - above[end]))
    }

    /// Returns the area that the picture shows, pixels.
    pub(super) fn shown_px(&self) -> f32 {
        self.spans.iter().map(|[left, right]| right - left).sum()
    }

    /// Returns the share of the area that the picture shows.
    pub(super) fn seen_share(&self) -> f32 {
        self.shown_px() / self.area_px.max(1.0)
    }
}

/// Level disc in a picture.
#[derive(Clone, Copy, Debug)]
struct Disc {
    center_px: DVec2,
    radius_px: f64,
    /// Share of the radius that is left of it along the body, as the camera looks at it.
    flatness: f64,
    is_hidden: bool,
}

/// Makes silhouettes; keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Outliner {
    rows: Vec<RowSpans>,
}

/// Columns of one row that a body covers, and those of them that no surface hides, from left to right.
#[derive(Clone, Copy, Debug)]
struct RowSpans {
    all: [f64; 2],
    visible: [f64; 2],
}

impl RowSpans {
    const EMPTY: Self =
        Self { all: [f64::INFINITY, f64::NEG_INFINITY], visible: [f64::INFINITY, f64::NEG_INFINITY] };
}

impl Outliner {
    /// Returns the silhouette of `body` in pictures of `size` columns and rows by `camera`, whatever part of it is seen; none if none is.
    /// Surfaces hide the discs whose bits are in `hidden`.
    pub(super) fn silhouette(
        &mut self,
        camera: &Camera,
        size: (usize, usize),
        body: &Body,
        hidden: u16,
    ) -> Option<Silhouette> {
        let discs = discs(camera, size, body, hidden)?;
        let (width, height) = (size.0 as f64, size.1 as f64);
        let (first, end) = ((-BEYOND * height) as i64, ((1.0 + BEYOND) * height) as i64);
        let ellipses = |idx: usize| Ellipse::new(&discs[idx], spacing(&discs, idx));
        let ellipses: [Ellipse; DISCS.len()] = std::array::from_fn(ellipses);
        let top = ellipses.iter().map(|of| of.top).min().unwrap_or(first).max(first);
        let bottom = ellipses.iter().map(|of| of.bottom).max().unwrap_or(first).min(end - 1);
        self.rows.clear();
        self.rows.resize(usize::try_from(bottom - top + 1).unwrap_or(0), RowSpans::EMPTY);
        for (ellipse, disc) in ellipses.iter().zip(&discs) {
            for y in ellipse.top.max(top)..=ellipse.bottom.min(bottom) {
                let [left, right] = ellipse.span(y);
                let widen = |span: &mut [f64; 2]| *span = [span[0].min(left), span[1].max(right)];
                let row = &mut self.rows[(y - top) as usize];
                widen(&mut row.all);
                if !disc.is_hidden {
                    widen(&mut row.visible);
                }
            }
        }
        let area_px = self.rows.iter().map(|RowSpans { all: [left, right], .. }| (right - left).max(0.0));
        let area_px = area_px.sum::<f64>();
        // The rows that the picture has.
        let above = usize::try_from(-top).unwrap_or(0).min(self.rows.len());
        let below = usize::try_from(bottom + 1 - size.1 as i64).unwrap_or(0).min(self.rows.len() - above);
        let inside = &self.rows[above..self.rows.len() - below];
        let is_seen = |RowSpans { visible: [left, right], .. }: &RowSpans| {
            left < right && *left < width && *right > 0.0
        };
        let first_seen = inside.iter().position(is_seen)?;
        let last_seen = inside.iter().rposition(is_seen)?;
        let span = |RowSpans { visible: [left, right], .. }: &RowSpans| {
            let left = left.clamp(0.0, width);
            [left as f32, right.clamp(left, width) as f32]
        };
        let spans = inside[first_seen..=last_seen].iter().map(span).collect();
        let first_row = usize::try_from(top).unwrap_or(0) + first_seen;
        Some(Silhouette { first_row, spans, area_px: area_px as f32 })
    }
}

/// Returns the discs of a body, from the foot up; none if its middle is nowhere in the camera's view.
fn discs(
    camera: &Camera,
    (width, height): (usize, usize),
    body: &Body,
    hidden: u16,
) -> Option<[Disc; DISCS.len()]> {
    let size = DVec2::new(width as f64, height as f64);
    let eye = camera.pose().position_in_world;
    let [foot, head] = ends_in_camera(camera, body);
    let focal_px = camera.focal_px().x * size.x / f64::from(camera.size_px().0);
    let mut found =
        [Disc { center_px: DVec2::ZERO, radius_px: 0.0, flatness: 1.0, is_hidden: true }; DISCS.len()];
    let mut has_any = false;
    for (idx, (disc, [share, radius_m])) in found.iter_mut().zip(DISCS).enumerate() {
        let center = body.foot_in_world + DVec3::Z * (share * body.height_m);
        let projection =
            camera.project_local(foot.lerp(head, share)).filter(|of| of.depth_m > LEAST_DEPTH_M)?;
        let away = center - eye;
        *disc = Disc {
            center_px: projection.texture * size,
            radius_px: focal_px * radius_m / projection.depth_m,
            flatness: (away.z / away.length()).abs(),
            is_hidden: false,
        };
        let reach = size + DVec2::splat(disc.radius_px);
        let is_in =
            (disc.center_px + disc.radius_px).min_element() > 0.0 && disc.center_px.cmplt(reach).all();
        disc.is_hidden = !is_in || hidden >> idx & 1 != 0;
        has_any |= !disc.is_hidden;
    }
    has_any.then_some(found)
}

/// Returns half of the way from the disc before to the one behind it.
fn spacing(discs: &[Disc], idx: usize) -> DVec2 {
    let (before, behind) = (idx.saturating_sub(1), (idx + 1).min(discs.len() - 1));
    (discs[behind].center_px - discs[before].center_px) / (behind - before) as f64
}

/// Disc in a picture, by its rows.
#[derive(Clone, Copy, Debug)]
struct Ellipse {
    /// First and last row.
    top: i64,
    bottom: i64,
    center_px: DVec2,
    /// Square of half of its height, pixels.
    reach_squared: f64,
    /// Square of half of its columns in the row of its middle, pixels.
    narrow: f64,
    /// Columns by which the middle of a row lies further to the right than that of the row above.
    slant: f64,
}

impl Ellipse {
    /// Makes the axis along the body at least as long as the way to the disc's neighbours, so that no row between them is left out.
    fn new(disc: &Disc, spacing: DVec2) -> Self {
        let along = spacing.try_normalize().unwrap_or(DVec2::Y);
        let across = along.perp();
        let a = disc.radius_px.max(0.5);
        let b = (disc.radius_px * disc.flatness).max(0.55 * spacing.length()).max(0.5);
        let [aa, bb] = [a * a, b * b];
        let yy = aa * across.y * across.y + bb * along.y * along.y;
        let xy = aa * across.x * across.y + bb * along.x * along.y;
        let xx = aa * across.x * across.x + bb * along.x * along.x;
        let reach = yy.sqrt();
        let top = (disc.center_px.y - reach - 0.5).ceil() as i64;
        let bottom = (disc.center_px.y + reach - 0.5).floor() as i64;
        Self {
            top,
            bottom,
            center_px: disc.center_px,
            reach_squared: yy,
            narrow: (xx - xy * xy / yy).max(0.0),
            slant: xy / yy,
        }
    }

    /// Returns the columns that it covers of a row.
    fn span(&self, y: i64) -> [f64; 2] {
        let off = y as f64 + 0.5 - self.center_px.y;
        let half = (self.narrow * (1.0 - off * off / self.reach_squared)).max(0.0).sqrt();
        let middle = self.center_px.x + self.slant * off;
        [middle - half, middle + half]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::occupancy::drawn_people::{SIZE, camera};

    fn silhouette(camera: &Camera, body: &Body) -> Silhouette {
        Outliner::default().silhouette(camera, (SIZE.0 as usize, SIZE.1 as usize), body, 0).unwrap()
    }

    /// Returns the columns of all rows that a silhouette covers.
    fn columns(of: &Silhouette) -> Vec<(usize, [f32; 2])> {
        of.spans.iter().enumerate().map(|(row, span)| (of.first_row + row, *span)).collect()
    }

    /// Returns the area that one of two covers and the other does not, as a share of the first's.
    fn difference(a: &[(usize, [f32; 2])], b: &[(usize, [f32; 2])]) -> f32 {
        let span = |of: &[(usize, [f32; 2])], row| {
            of.iter().find(|(at, _)| *at == row).map_or([0.0; 2], |(_, span)| *span)
        };
        let apart = |row| {
            let ([a, b], [c, d]) = (span(a, row), span(b, row));
            let both = (b.min(d) - a.max(c)).max(0.0);
            (b - a) + (d - c) - 2.0 * both
        };
        let area: f32 = a.iter().map(|(_, [left, right])| right - left).sum();
        (0..SIZE.1 as usize).map(apart).sum::<f32>() / area
    }

    #[test]
    fn a_moved_silhouette_is_nearly_that_of_who_stands_there() {
        let size = (SIZE.0 as usize, SIZE.1 as usize);
        let target = DVec3::Z * 0.8;
        let eyes = [
            (DVec3::new(0.0, -7.0, 1.7), 0.09),
            (DVec3::new(5.0, 6.0, 4.0), 0.12),
            (DVec3::new(-12.0, 3.0, 6.0), 0.22),
        ];
        for (eye, most) in eyes {
            let camera = camera(eye, target);
            let body = Body { foot_in_world: DVec3::new(0.3, -0.2, 0.0), height_m: 1.7 };
            let (from, shown) = (Axis::of(&camera, size, &body).unwrap(), silhouette(&camera, &body));
            for (by, taller_m) in [
                (DVec3::ZERO, 0.0),
                (DVec3::new(0.12, 0.0, 0.0), 0.0),
                (DVec3::new(0.0, -0.12, 0.0), 0.0),
                (DVec3::ZERO, 0.12),
                (DVec3::new(-0.4, 0.5, 0.0), -0.2),
            ] {
                let other =
                    Body { foot_in_world: body.foot_in_world + by, height_m: body.height_m + taller_m };
                let motion = Motion::between(&from, &Axis::of(&camera, size, &other).unwrap()).unwrap();
                let mut moved = Vec::new();
                motion.rows(&shown, size, 1, |y, span| moved.push((y, span)));
                let exact = silhouette(&camera, &other);
                let far = difference(&columns(&exact), &moved);
                // Discs cover whole rows: somebody of thirty rows changes by a fifth between two places.
                let most = if by.y == 0.0 && taller_m == 0.0 && eye.x == 0.0 { 0.01 } else { most };
                assert!(far < most, "{eye} {by}: {far}");
                let area = shown.area_px * motion.area_scale() / exact.area_px;
                assert!((area - 1.0).abs() < 0.05, "{eye} {by}: {area}");
            }
        }
    }

    #[test]
    fn some_rows_tell_about_as_much_as_all() {
        let size = (SIZE.0 as usize, SIZE.1 as usize);
        let camera = camera(DVec3::new(0.0, -5.0, 1.7), DVec3::Z * 0.8);
        let axis = |x: f64| {
            let body = Body { foot_in_world: DVec3::new(x, 0.0, 0.0), height_m: 1.7 };
            (Axis::of(&camera, size, &body).unwrap(), silhouette(&camera, &body))
        };
        let (from, shown) = axis(0.0);
        let motion = Motion::between(&from, &axis(0.1).0).unwrap();
        let area = |stride: usize| {
            let (mut area, mut rows) = (0.0, Vec::new());
            motion.rows(&shown, size, stride, |y, [left, right]| {
                area += (right - left) * stride as f32;
                rows.push(y);
            });
            (area, rows)
        };
        let (all, rows) = area(1);
        for stride in [2, 3] {
            let (some, own) = area(stride);
            assert!((some / all - 1.0).abs() < 0.05, "{stride}: {some} of {all}");
            assert!(
                own.windows(2).all(|pair| pair[1] == pair[0] + stride)
                    && own.len() <= rows.len() / stride + 1
            );
        }
    }

    #[test]
    fn who_comes_nearer_is_larger_in_both_directions() {
        let size = (SIZE.0 as usize, SIZE.1 as usize);
        let camera = camera(DVec3::new(0.0, -9.0, 1.7), DVec3::Z * 0.8);
        let body = |y: f64| Body { foot_in_world: DVec3::new(0.3, y, 0.0), height_m: 1.7 };
        let axis = |y: f64| Axis::of(&camera, size, &body(y)).unwrap();
        let shown = silhouette(&camera, &body(2.0));
        let motion = Motion::between(&axis(2.0), &axis(-2.0)).unwrap();
        let mut moved = Vec::new();
        motion.rows(&shown, size, 1, |y, span| moved.push((y, span)));
        let far = difference(&columns(&silhouette(&camera, &body(-2.0))), &moved);
        assert!(far < 0.15, "{far}");
    }

    #[test]
    fn who_is_seen_from_right_above_is_not_moved() {
        let camera = camera(DVec3::new(0.0, -0.01, 9.0), DVec3::ZERO);
        let size = (SIZE.0 as usize, SIZE.1 as usize);
        let axis = |x: f64| {
            let body = Body { foot_in_world: DVec3::new(x, 0.0, 0.0), height_m: 1.7 };
            Axis::of(&camera, size, &body).unwrap()
        };
        assert!(Motion::between(&axis(0.0), &axis(0.1)).is_none());
    }
}
