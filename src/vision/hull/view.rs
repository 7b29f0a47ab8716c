//! One camera with its silhouette: masks become outlines in the camera's tangent plane, every corner through the lens once.

use super::outline::{Outline, refined, simplified, trace};
use crate::geometry::{Camera, Ray};
use glam::DVec2;

/// Corners of the border of a picture along its longer side, and of any line as long: a lens bends it.
const BORDER_CORNERS: usize = 32;

/// One camera's silhouette, in its picture or in a window of it.
#[derive(Clone, Debug)]
pub struct View {
    camera: Camera,
    /// Size of the picture that the mask is of, or of which it is a part, pixels.
    picture_px: DVec2,
    /// The mask's first column and row in the picture, and its columns; its rows are as many as there are.
    left_top: [usize; 2],
    width: usize,
    is_inside: Vec<bool>,
    /// Around what of the mask is outside the silhouette.
    outside: Outline,
    /// Around all of the mask.
    border: Outline,
}

/// A part of a picture with a silhouette in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window {
    /// Columns and rows of the picture.
    pub picture_px: [usize; 2],
    /// Its own first column and row in the picture.
    pub left_top: [usize; 2],
    /// Its columns.
    pub width: usize,
    /// What is inside, row by row.
    pub is_inside: Vec<bool>,
}

/// Why silhouettes make no hull.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HullError {
    /// The mask's size does not fit, or it has none.
    #[error("a silhouette of {n_values} values is no picture of {width} columns")]
    NoPicture {
        /// Columns.
        width: usize,
        /// Values.
        n_values: usize,
    },
    /// The lens sees beyond a right angle from its axis, which has no tangent plane.
    #[error(
        "the picture's border lies a right angle or more from the camera's axis: such lenses cannot be used"
    )]
    TooWide,
    /// Fewer cameras than are needed.
    #[error("{n} silhouettes are given, but a hull needs {least} to {most}")]
    Count {
        /// As many.
        n: usize,
        /// At least.
        least: usize,
        /// At most.
        most: usize,
    },
    /// Nothing is left.
    #[error("the silhouettes have nothing in common: calibrations and pictures may be mixed up")]
    Empty,
    /// There is no telling how large the hull is.
    #[error(
        "the silhouettes leave the hull open: give its bounds, or have more cameras see what is part of it"
    )]
    Unbounded,
    /// Its surface cannot be found.
    #[error("the hull's surface: {0}")]
    Mesh(crate::mesh::MeshError),
    /// The grid would be too large or none.
    #[error("{n} places along the longest side, but {least} to {most} are possible")]
    Resolution {
        /// As many.
        n: u32,
        /// At least.
        least: u32,
        /// At most.
        most: u32,
    },
}

impl View {
    /// A camera and its silhouette: `is_inside` row by row, `width` columns, of any size of the same picture. The outline is simplified
    /// by at most `error_px` of the mask's pixels.
    ///
    /// # Errors
    /// Where the mask is no picture, or the lens sees a right angle or more from its axis.
    pub fn new(
        camera: Camera,
        (width, is_inside): (usize, Vec<bool>),
        error_px: f64,
    ) -> Result<Self, HullError> {
        let n_values = is_inside.len();
        if width == 0 || n_values == 0 || n_values % width != 0 {
            return Err(HullError::NoPicture { width, n_values });
        }
        let picture_px = [width, n_values / width];
        Self::within(camera, Window { picture_px, left_top: [0, 0], width, is_inside }, error_px)
    }

    /// As [`Self::new`], of a window of the picture: what lies beside it is taken as not seen.
    ///
    /// # Errors
    /// As there, or where the window reaches beyond the picture.
    pub fn within(camera: Camera, window: Window, error_px: f64) -> Result<Self, HullError> {
        let Window { picture_px, left_top, width, is_inside } = window;
        let n_values = is_inside.len();
        let height = n_values.checked_div(width).unwrap_or(0);
        let is_within = left_top[0] + width <= picture_px[0] && left_top[1] + height <= picture_px[1];
        if height == 0 || n_values % width != 0 || !is_within {
            return Err(HullError::NoPicture { width, n_values });
        }
        let of = |[x, y]: [usize; 2]| DVec2::new(x as f64, y as f64);
        let (picture, first) = (of(picture_px), of(left_top));
        let tangent = |at: DVec2| tangent(&camera, (at + first) / picture);
        let most_px = picture.max_element() / BORDER_CORNERS as f64;
        let polygon = |polygon: &Vec<DVec2>| {
            refined(&simplified(polygon, error_px), most_px).into_iter().map(tangent).collect()
        };
        let polygons = |is_inside: &[bool]| -> Option<Vec<Vec<DVec2>>> {
            trace(width, is_inside).iter().map(polygon).collect()
        };
        // The border is that of a mask with nothing inside: the same places to the last bit, or slivers would lie between both.
        let (outside, border) =
            polygons(&is_inside).zip(polygons(&vec![false; n_values])).ok_or(HullError::TooWide)?;
        Ok(Self {
            outside: Outline::new(&outside),
            border: Outline::new(&border),
            camera,
            picture_px: picture,
            left_top,
            width,
            is_inside,
        })
    }

    /// Around what of the picture is outside the silhouette, in the camera's tangent plane (x / z, y / z).
    #[must_use]
    pub const fn outside(&self) -> &Outline {
        &self.outside
    }

    /// Around all of it, there.
    pub(super) const fn border(&self) -> &Outline {
        &self.border
    }

    /// The camera.
    #[must_use]
    pub const fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Columns and rows of the mask.
    #[must_use]
    pub const fn size_px(&self) -> [usize; 2] {
        [self.width, self.is_inside.len() / self.width]
    }

    /// Columns and rows of the picture that the mask is of or a part of.
    #[must_use]
    pub const fn picture_px(&self) -> DVec2 {
        self.picture_px
    }

    /// The mask's first column and row in the picture.
    #[must_use]
    pub const fn left_top(&self) -> [usize; 2] {
        self.left_top
    }

    /// How many pixels of the mask are inside.
    #[must_use]
    pub fn n_inside(&self) -> usize {
        self.is_inside.iter().filter(|is| **is).count()
    }

    /// Whether the mask has a pixel inside at its border.
    #[must_use]
    pub fn touches_border(&self) -> bool {
        let [width, height] = self.size_px();
        let row = |y: usize| self.is_inside[y * width..(y + 1) * width].iter().any(|is| *is);
        let sides = |y: usize| self.is_inside[y * width] || self.is_inside[(y + 1) * width - 1];
        row(0) || row(height - 1) || (0..height).any(sides)
    }

    pub(super) fn is_inside_at(&self, x: usize, y: usize) -> bool {
        self.is_inside[y * self.width + x]
    }

    /// Where a texture coordinate lies in the mask, pixels from its first.
    pub(super) fn mask_px(&self, texture: DVec2) -> DVec2 {
        let [left, top] = self.left_top.map(|first| first as f64);
        texture * self.picture_px - DVec2::new(left, top)
    }

    /// What the mask has at a texture coordinate; none beside the picture.
    #[must_use]
    pub fn at(&self, texture: DVec2) -> Option<bool> {
        let [width, height] = self.size_px();
        let at = self.mask_px(texture);
        let is_in = at.x >= 0.0 && at.y >= 0.0 && at.x < width as f64 && at.y < height as f64;
        is_in.then(|| self.is_inside[at.y as usize * width + at.x as usize])
    }

    /// The tangent of the greatest angle from the axis at which the picture shows anything.
    pub(super) fn widest(&self) -> f64 {
        self.border.bounds().map_or(0.0, |[low, high]| low.abs().max(high.abs()).length())
    }

    /// The ray through the middle of the silhouette's extent; none where that is empty.
    pub(super) fn middle(&self) -> Option<Ray> {
        let [width, height] = self.size_px();
        let has = |mut at: Box<dyn Iterator<Item = usize> + '_>| at.any(|i| self.is_inside[i]);
        let column = |x: &usize| has(Box::new((0..height).map(|y| y * width + *x)));
        let row = |y: &usize| has(Box::new(*y * width..(*y + 1) * width));
        let [left, right] = [(0..width).find(column)?, (0..width).rfind(column)?];
        let [top, bottom] = [(0..height).find(row)?, (0..height).rfind(row)?];
        let of = |[x, y]: [usize; 2]| DVec2::new(x as f64, y as f64);
        let middle = of(self.left_top) + (of([left, top]) + of([right + 1, bottom + 1])) / 2.0;
        self.camera.ray(middle / self.picture_px)
    }
}

/// Where a texture coordinate lies in the tangent plane. Where the lens brings no light it is drawn in towards the middle, which
/// happens a pixel beyond the border alone.
fn tangent(camera: &Camera, texture: DVec2) -> Option<DVec2> {
    let (columns, rows) = camera.size_px();
    let middle = camera.center_px() / DVec2::new(f64::from(columns), f64::from(rows));
    let through = |share: f64| {
        let ray = camera.ray(middle + (texture - middle) * share)?;
        let local = camera.pose().world_from_local.inverse() * ray.direction;
        (local.z > 1e-3).then(|| local.truncate() / local.z)
    };
    if let Some(at) = through(1.0) {
        return Some(at);
    }
    // A share of 0.9 that has none is no matter of a pixel.
    let (mut low, mut high) = (0.9, 1.0);
    through(low)?;
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        if through(middle).is_some() { low = middle } else { high = middle }
    }
    through(low)
}
