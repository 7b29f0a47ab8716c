//! Walls of screens: tiles with sizes and places, the window through which each shows its part of one view, and which instant
//! all of them show at once.
//!
//! In: a wall's document (JSON). Out: for every tile the viewer's eye and the corners of its window in the world, so that the
//! picture goes on behind bezels and around corners; frames that name an instant; pictures by which a wall is put up.
//!
//! Wall space: x to the right, y up, z towards the viewer; metres. The viewer looks along -z.

mod blend;
mod document;
mod frames;
mod message;
mod pattern;
mod surface;

pub use blend::blend;
pub use document::{WallDocument, WallViewDocument};
pub use frames::{FrameLock, WallFrame};
pub use message::{FrameHeader, HEADER_BYTES, MessageError};
pub use pattern::{Pattern, pattern};
pub use surface::{CylinderDocument, GridDocument, MAX_TILES, SurfaceDocument, TileDocument};

use glam::DVec3;
use videofields_vision::geometry::Pose;

/// A rectangle of the wall that one screen or projector shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    /// Its name.
    pub id: String,
    /// Columns and rows.
    pub size_px: [u32; 2],
    /// Its lower left, lower right and upper left corner as the viewer sees them, wall space, metres.
    pub corners_m: [DVec3; 3],
    /// Columns at its left and right and rows at its top and bottom over which it fades out where another overlaps it.
    pub blend_px: [u32; 4],
}

/// A wall that was validated.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    /// Name for people.
    pub name: String,
    /// The scene that it shows.
    pub scene: String,
    /// The playhead whose time it shows; live without one.
    pub playhead: Option<String>,
    /// Frames a second.
    pub rate_hz: f64,
    /// Where the viewer is in the world, metres.
    pub eye_m: DVec3,
    /// What is straight ahead of the viewer, metres.
    pub target_m: DVec3,
    /// The viewer's place in wall space, metres.
    pub viewer_m: DVec3,
    /// How much larger everything is shown than a window of the wall's size would.
    pub zoom: f64,
    /// Further parameters of views, as a query string.
    pub parameters: String,
    /// The tiles, ids unique.
    pub tiles: Vec<Tile>,
}

impl Wall {
    /// The tile of that name.
    #[must_use]
    pub fn tile(&self, id: &str) -> Option<&Tile> {
        self.tiles.iter().find(|tile| tile.id == id)
    }

    /// Where the corners of a rectangle in wall space are in the world, metres: the wall stands before the eye as it stands
    /// before the viewer.
    ///
    /// Source: Kooima, Generalized Perspective Projection, 2009; `zoom` divides x and y about the viewer's axis: what a window shows less of is larger.
    #[must_use]
    pub fn window(&self, corners_m: [DVec3; 3]) -> [DVec3; 3] {
        // Validated: there is a direction to look in.
        let world_from_local = Pose::looking_at(self.eye_m, self.target_m).map(|pose| pose.world_from_local);
        corners_m.map(|corner| {
            let DVec3 { x, y, z } = zoomed(corner - self.viewer_m, self.zoom);
            // A pose looks along +z with y down.
            self.eye_m + world_from_local.unwrap_or_default() * DVec3::new(x, -y, -z)
        })
    }
}

/// A direction from the viewer, wall space, as it is shown.
fn zoomed(from_viewer: DVec3, zoom: f64) -> DVec3 {
    from_viewer / DVec3::new(zoom, zoom, 1.0)
}
