//! What a wall's tiles make up: a plane of equal tiles, part of a cylinder, or any rectangles.

use super::Tile;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::f64::consts::TAU;
use videofields_vision::error::Gatherer;
use videofields_vision::frame::is_id;

/// Most tiles of a wall.
pub const MAX_TILES: usize = 64;

/// Columns or rows of a tile.
const SIDE_PX: [u32; 2] = [16, 16_384];

/// Most pixels of a tile: 7680 x 4320.
const MAX_TILE_PIXELS: u64 = 33_177_600;

/// Width or height of a tile, metres.
const SIDE_M: [f64; 2] = [0.01, 100.0];

/// Most metres that anything of a wall is away from its middle.
const MAX_COORDINATE_M: f64 = 1000.0;

/// What the tiles make up: one of the three.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceDocument {
    /// Equal tiles in columns and rows on the plane z = 0, its middle at the origin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridDocument>,
    /// Equal tiles around the viewer: columns are chords of a cylinder whose axis is x = z = 0, the middle at -z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cylinder: Option<CylinderDocument>,
    /// Any rectangles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tiles: Option<Vec<TileDocument>>,
}

/// Equal tiles on a plane; called `r1c1`, `r1c2`, ... from the upper left.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridDocument {
    /// Tiles side by side.
    pub columns: u32,
    /// Tiles one above the other.
    pub rows: u32,
    /// Columns and rows of each tile's picture.
    pub tile_px: [u32; 2],
    /// Width and height of each tile's picture, metres.
    pub tile_m: [f64; 2],
    /// Between the pictures of neighbours, metres: their bezels. Below 0 they overlap, and each fades out there. Default 0.
    #[serde(default)]
    pub gap_m: [f64; 2],
}

/// Equal tiles on part of a cylinder; called as those of a grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CylinderDocument {
    /// Tiles side by side.
    pub columns: u32,
    /// Tiles one above the other.
    pub rows: u32,
    /// Columns and rows of each tile's picture.
    pub tile_px: [u32; 2],
    /// Width and height of each tile's picture, metres.
    pub tile_m: [f64; 2],
    /// As of a grid; across, the length of a chord.
    #[serde(default)]
    pub gap_m: [f64; 2],
    /// From the axis to the tiles' vertical edges, metres.
    pub radius_m: f64,
}

/// One rectangle in wall space.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TileDocument {
    /// Its name.
    pub id: String,
    /// Columns and rows.
    pub size_px: [u32; 2],
    /// Corners as the viewer sees them, metres.
    pub lower_left_m: [f64; 3],
    /// As above.
    pub lower_right_m: [f64; 3],
    /// As above.
    pub upper_left_m: [f64; 3],
    /// Pixels at its left, right, top and bottom over which it fades out. Default none.
    #[serde(default)]
    pub blend_px: [u32; 4],
}

impl CylinderDocument {
    /// The same tiles on a plane.
    const fn grid(&self) -> GridDocument {
        let Self { columns, rows, tile_px, tile_m, gap_m, .. } = *self;
        GridDocument { columns, rows, tile_px, tile_m, gap_m }
    }
}

impl SurfaceDocument {
    /// The tiles, and what is wrong with them; `place` is the document's pointer.
    pub(super) fn tiles(&self, place: &str, gatherer: &mut Gatherer) -> Vec<Tile> {
        match (&self.grid, &self.cylinder, &self.tiles) {
            (Some(grid), None, None) => {
                let place = format!("{place}/grid");
                check_grid(grid, &place, gatherer);
                let ring = false;
                grid_tiles((grid, ring), &place, gatherer, |column, row| flat(grid, column, row))
            }
            (None, Some(cylinder), None) => {
                let (place, grid) = (format!("{place}/cylinder"), cylinder.grid());
                check_grid(&grid, &place, gatherer);
                check_cylinder(cylinder, &place, gatherer);
                let ring = step_rad(cylinder) * f64::from(cylinder.columns) > TAU - 1e-6;
                grid_tiles((&grid, ring), &place, gatherer, |column, row| bent(cylinder, column, row))
            }
            (None, None, Some(tiles)) => listed(tiles, &format!("{place}/tiles"), gatherer),
            _ => {
                gatherer.fault(place, "expected one of `grid`, `cylinder` and `tiles`");
                Vec::new()
            }
        }
    }
}

fn check_grid(grid: &GridDocument, place: &str, gatherer: &mut Gatherer) {
    let n_tiles = u64::from(grid.columns) * u64::from(grid.rows);
    for (key, count) in [("columns", grid.columns), ("rows", grid.rows)] {
        if count == 0 || n_tiles > MAX_TILES as u64 {
            let message = format!("expected 1 or more, columns times rows at most {MAX_TILES}, got {count}");
            gatherer.fault(format!("{place}/{key}"), message);
        }
    }
    check_size_px(grid.tile_px, &format!("{place}/tile_px"), gatherer);
    for (axis, (side_m, gap_m)) in grid.tile_m.into_iter().zip(grid.gap_m).enumerate() {
        if !(SIDE_M[0]..=SIDE_M[1]).contains(&side_m) {
            let message = format!("expected {} to {} metres, got {side_m}", SIDE_M[0], SIDE_M[1]);
            gatherer.fault(format!("{place}/tile_m/{axis}"), message);
        } else if !(-0.5 * side_m..=SIDE_M[1]).contains(&gap_m) {
            let (least, most) = (-0.5 * side_m, SIDE_M[1]);
            let message = format!("expected {least} (half a tile overlaps) to {most} metres, got {gap_m}");
            gatherer.fault(format!("{place}/gap_m/{axis}"), message);
        }
    }
}

fn check_cylinder(cylinder: &CylinderDocument, place: &str, gatherer: &mut Gatherer) {
    let CylinderDocument { columns, tile_m, gap_m, radius_m, .. } = cylinder;
    let least = 0.51 * tile_m[0] + gap_m[0].max(0.0);
    if !(least..=MAX_COORDINATE_M).contains(radius_m) {
        let message =
            format!("expected {least} (a tile must fit in) to {MAX_COORDINATE_M} metres, got {radius_m}");
        gatherer.fault(format!("{place}/radius_m"), message);
    } else if step_rad(cylinder) * f64::from(*columns) > TAU + 1e-6 {
        let message = format!("{columns} columns do not fit around the cylinder");
        gatherer.fault(format!("{place}/columns"), message);
    }
}

fn check_size_px(size_px: [u32; 2], place: &str, gatherer: &mut Gatherer) {
    let pixels = u64::from(size_px[0]) * u64::from(size_px[1]);
    if pixels > MAX_TILE_PIXELS {
        gatherer.fault(place, format!("at most {MAX_TILE_PIXELS} pixels are allowed, got {pixels}"));
    }
    for (axis, side) in size_px.into_iter().enumerate() {
        if !(SIDE_PX[0]..=SIDE_PX[1]).contains(&side) {
            let message = format!("expected {} to {} pixels, got {side}", SIDE_PX[0], SIDE_PX[1]);
            gatherer.fault(format!("{place}/{axis}"), message);
        }
    }
}

/// The tiles of a grid, from the upper left, where it is sound; `corners` has the corners of a column's and row's. In a ring
/// the last column's neighbour is the first.
fn grid_tiles(
    (grid, is_ring): (&GridDocument, bool),
    place: &str,
    gatherer: &Gatherer,
    corners: impl Fn(u32, u32) -> [DVec3; 3],
) -> Vec<Tile> {
    if gatherer.is_faulty(place) {
        return Vec::new();
    }
    // Pixels that neighbours share.
    let shared = |axis: usize| {
        let part = (-grid.gap_m[axis]).max(0.0) / grid.tile_m[axis];
        (part * f64::from(grid.tile_px[axis])).round() as u32
    };
    let (across, down) = (shared(0), shared(1));
    let tile = |(row, column): (u32, u32)| Tile {
        id: format!("r{}c{}", row + 1, column + 1),
        size_px: grid.tile_px,
        corners_m: corners(column, row),
        blend_px: [
            if column > 0 || is_ring { across } else { 0 },
            if column + 1 < grid.columns || is_ring { across } else { 0 },
            if row > 0 { down } else { 0 },
            if row + 1 < grid.rows { down } else { 0 },
        ],
    };
    let places = (0..grid.rows).flat_map(|row| (0..grid.columns).map(move |column| (row, column)));
    places.map(tile).collect()
}

/// How far the middle of the `idx`th of `count` tiles is from the middle of all, in steps.
fn from_middle(idx: u32, count: u32) -> f64 {
    f64::from(idx) - 0.5 * (f64::from(count) - 1.0)
}

/// The height of a row's lower edge, metres.
fn bottom_m(grid: &GridDocument, row: u32) -> f64 {
    -from_middle(row, grid.rows) * (grid.tile_m[1] + grid.gap_m[1]) - 0.5 * grid.tile_m[1]
}

fn flat(grid: &GridDocument, column: u32, row: u32) -> [DVec3; 3] {
    let left = from_middle(column, grid.columns) * (grid.tile_m[0] + grid.gap_m[0]) - 0.5 * grid.tile_m[0];
    let lower_left = DVec3::new(left, bottom_m(grid, row), 0.0);
    [lower_left, lower_left + DVec3::X * grid.tile_m[0], lower_left + DVec3::Y * grid.tile_m[1]]
}

/// Angle from one column to the next, radians: a chord of a tile's width and one of the gap's.
fn step_rad(cylinder: &CylinderDocument) -> f64 {
    let angle = |chord_m: f64| 2.0 * (0.5 * chord_m / cylinder.radius_m).clamp(-1.0, 1.0).asin();
    angle(cylinder.tile_m[0]) + angle(cylinder.gap_m[0])
}

fn bent(cylinder: &CylinderDocument, column: u32, row: u32) -> [DVec3; 3] {
    let (grid, radius_m) = (cylinder.grid(), cylinder.radius_m);
    let half = 0.5 * grid.tile_m[0];
    let depth = radius_m.mul_add(radius_m, -half * half).max(0.0).sqrt();
    // To the right means about -y: from -z towards +x.
    let turned = DQuat::from_rotation_y(-from_middle(column, grid.columns) * step_rad(cylinder));
    let lower_left = turned * DVec3::new(-half, bottom_m(&grid, row), -depth);
    [lower_left, lower_left + turned * DVec3::X * grid.tile_m[0], lower_left + DVec3::Y * grid.tile_m[1]]
}

fn listed(tiles: &[TileDocument], place: &str, gatherer: &mut Gatherer) -> Vec<Tile> {
    if !(1..=MAX_TILES).contains(&tiles.len()) {
        gatherer.fault(place, format!("expected 1 to {MAX_TILES} tiles, got {}", tiles.len()));
    }
    let mut ids = HashSet::new();
    for (idx, tile) in tiles.iter().enumerate() {
        let at = |key: &str| format!("{place}/{idx}/{key}");
        if !is_id(&tile.id) {
            let message = "expected 1 to 64 of a-z, 0-9, - and _, the first a letter or digit";
            gatherer.fault(at("id"), message);
        } else if !ids.insert(&tile.id) {
            gatherer.fault(at("id"), format!("there is another tile {:?}", tile.id));
        }
        check_size_px(tile.size_px, &at("size_px"), gatherer);
        let corners = [
            ("lower_left_m", tile.lower_left_m),
            ("lower_right_m", tile.lower_right_m),
            ("upper_left_m", tile.upper_left_m),
        ];
        for (key, corner) in corners {
            if corner.iter().any(|value| value.abs() > MAX_COORDINATE_M) {
                gatherer.fault(at(key), format!("expected three numbers within +-{MAX_COORDINATE_M} metres"));
            }
        }
        for (edge, (blend, side)) in tile.blend_px.into_iter().zip([0, 0, 1, 1]).enumerate() {
            let most = tile.size_px[side] / 2;
            if blend > most {
                let message = format!("expected at most {most} pixels, half the tile, got {blend}");
                gatherer.fault(format!("{place}/{idx}/blend_px/{edge}"), message);
            }
        }
    }
    let tile = |of: &TileDocument| Tile {
        id: of.id.clone(),
        size_px: of.size_px,
        corners_m: [of.lower_left_m, of.lower_right_m, of.upper_left_m].map(DVec3::from_array),
        blend_px: of.blend_px,
    };
    tiles.iter().map(tile).collect()
}
