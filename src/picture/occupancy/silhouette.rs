//! Outlines of upright people in a camera's picture: the rows that somebody who stands at a place would cover.
//!
//! A place, a height and a camera flow in; spans of rows flow out. People are stacks of level discs, which are ellipses in a picture,
//! however the camera is turned; discs that a surface of the scene hides cover nothing.

use glam::{DVec2, DVec3};
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
const LEAST_DEPTH_M: f64 = 0.2;

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
    let center = |share: f64| body.foot_in_world + DVec3::Z * (share * body.height_m);
    let bit = |(idx, [share, _]): (usize, &[f64; 2])| {
        let center = center(*share);
        let is_before = camera.project(center).is_some_and(|of| of.depth_m > LEAST_DEPTH_M);
        u16::from(is_before && surfaces.is_hidden(eye, center)) << idx
    };
    DISCS.iter().enumerate().map(bit).fold(0, std::ops::BitOr::bitor)
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

    /// Returns the share of the area that the picture shows.
    pub(super) fn seen_share(&self) -> f32 {
        self.spans.iter().map(|[left, right]| right - left).sum::<f32>() / self.area_px.max(1.0)
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
    let focal_px = camera.focal_px().x * size.x / f64::from(camera.size_px().0);
    let mut found =
        [Disc { center_px: DVec2::ZERO, radius_px: 0.0, flatness: 1.0, is_hidden: true }; DISCS.len()];
    let mut has_any = false;
    for (idx, (disc, [share, radius_m])) in found.iter_mut().zip(DISCS).enumerate() {
        let center = body.foot_in_world + DVec3::Z * (share * body.height_m);
        let projection = camera.project(center).filter(|of| of.depth_m > LEAST_DEPTH_M)?;
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
