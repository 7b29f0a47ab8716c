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
    all: Vec<[f64; 2]>,
    visible: Vec<[f64; 2]>,
}

impl Outliner {
    /// Returns the silhouette of `body` in pictures of `size` columns and rows by `camera`, whatever part of it is seen; none if none is.
    pub(super) fn silhouette(
        &mut self,
        (camera, surfaces): (&Camera, &Surfaces),
        size: (usize, usize),
        body: &Body,
    ) -> Option<Silhouette> {
        let discs = discs(camera, surfaces, size, body)?;
        let (width, height) = (size.0 as f64, size.1 as f64);
        let first = (-BEYOND * height) as i64;
        let n_rows = ((1.0 + 2.0 * BEYOND) * height) as usize;
        for rows in [&mut self.all, &mut self.visible] {
            rows.clear();
            rows.resize(n_rows, [f64::INFINITY, f64::NEG_INFINITY]);
        }
        for (idx, disc) in discs.iter().enumerate() {
            let spacing = spacing(&discs, idx);
            let add = |y: i64, [left, right]: [f64; 2]| {
                let Some(row) = usize::try_from(y - first).ok().filter(|row| *row < n_rows) else { return };
                let widen = |rows: &mut [[f64; 2]]| {
                    rows[row] = [rows[row][0].min(left), rows[row][1].max(right)];
                };
                widen(&mut self.all);
                if !disc.is_hidden {
                    widen(&mut self.visible);
                }
            };
            rows_of(disc, spacing, add);
        }
        let area_px = self.all.iter().map(|[left, right]| (right - left).max(0.0)).sum::<f64>();
        let inside = &self.visible[(-first) as usize..][..size.1];
        let is_seen = |[left, right]: &[f64; 2]| left < right && *left < width && *right > 0.0;
        let top = inside.iter().position(is_seen)?;
        let bottom = inside.iter().rposition(is_seen)?;
        let span = |[left, right]: &[f64; 2]| {
            let left = left.clamp(0.0, width);
            [left as f32, right.clamp(left, width) as f32]
        };
        let spans = inside[top..=bottom].iter().map(span).collect();
        Some(Silhouette { first_row: top, spans, area_px: area_px as f32 })
    }
}

/// Returns the discs of a body, from the foot up; none if its middle is nowhere in the camera's view.
fn discs(
    camera: &Camera,
    surfaces: &Surfaces,
    (width, height): (usize, usize),
    body: &Body,
) -> Option<[Disc; DISCS.len()]> {
    let size = DVec2::new(width as f64, height as f64);
    let eye = camera.pose().position_in_world;
    let focal_px = camera.focal_px().x * size.x / f64::from(camera.size_px().0);
    let mut found =
        [Disc { center_px: DVec2::ZERO, radius_px: 0.0, flatness: 1.0, is_hidden: true }; DISCS.len()];
    let mut has_any = false;
    for (disc, [share, radius_m]) in found.iter_mut().zip(DISCS) {
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
        disc.is_hidden = !is_in || surfaces.is_hidden(eye, center);
        has_any |= !disc.is_hidden;
    }
    has_any.then_some(found)
}

/// Returns half of the way from the disc before to the one behind it.
fn spacing(discs: &[Disc], idx: usize) -> DVec2 {
    let (before, behind) = (idx.saturating_sub(1), (idx + 1).min(discs.len() - 1));
    (discs[behind].center_px - discs[before].center_px) / (behind - before) as f64
}

/// Calls `add` with the rows of an ellipse and the columns that it covers in each. Its axis along the body is at least as long as the
/// way to its neighbours, so that no row between them is left out.
fn rows_of(disc: &Disc, spacing: DVec2, mut add: impl FnMut(i64, [f64; 2])) {
    let along = spacing.try_normalize().unwrap_or(DVec2::Y);
    let across = along.perp();
    let a = disc.radius_px.max(0.5);
    let b = (disc.radius_px * disc.flatness).max(0.55 * spacing.length()).max(0.5);
    let [aa, bb] = [a * a, b * b];
    let yy = aa * across.y * across.y + bb * along.y * along.y;
    let xy = aa * across.x * across.y + bb * along.x * along.y;
    let xx = aa * across.x * across.x + bb * along.x * along.x;
    let reach = yy.sqrt();
    let narrow = (xx - xy * xy / yy).max(0.0);
    let (top, bottom) =
        ((disc.center_px.y - reach - 0.5).ceil() as i64, (disc.center_px.y + reach - 0.5).floor() as i64);
    // Bounds the rows of somebody who stands right before the lens.
    for y in top..=bottom.min(top + 65_536) {
        let off = y as f64 + 0.5 - disc.center_px.y;
        let half = (narrow * (1.0 - off * off / yy)).max(0.0).sqrt();
        let middle = disc.center_px.x + xy / yy * off;
        add(y, [middle - half, middle + half]);
    }
}
