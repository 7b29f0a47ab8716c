//! Deferred pruning: one upright rectangle a blob.
//!
//! Video Fields (Du, Bista, Varshney 2016), algorithm 2, in a form that holds for cameras with roll and beyond the
//! horizon: the base line runs through the lowest contact texel along the level line that faces the camera, and
//! the extent is the mask outline's rays cut with the upright plane through it. (The paper's widths come from the
//! image rectangle's corners on the ground, its height from tan(theta) there: that errs with pitch and roll, and
//! has no value above the horizon.)

use super::estimate::{Estimate, Foot, Head, Height, along};
use super::look::Look;
use super::pieces::{Piece, pieces};
use super::together::Together;
use super::upright::Down;
use super::{Billboard, CameraState, Sighting};
use crate::occupancy::OwnerMap;
use glam::{DMat2, DVec2, DVec3};
use videofields_vision::frame::Mask;
use videofields_vision::geometry::{Camera, Ray, Surfaces};
use videofields_vision::segment::PixelRect;

/// A blob's label in the hard mask.
pub(super) const MOVING: u8 = 255;

/// Least and greatest extent of a billboard, metres: below, nothing is left to draw; above, the foot was wrong.
pub(super) const EXTENT_RANGE_M: [f64; 2] = [0.05, 30.0];

/// Rows of a blob (columns, where people lie sideways) whose outline is cut with the plane, at most: neighbouring rows
/// hardly differ.
pub(super) const MAX_OUTLINE_ROWS: u32 = 96;

/// Nearer than this to the camera's nadir, an upright plane has no direction to face, metres.
const NADIR_M: f64 = 0.05;

/// Standard deviation of a foot in the picture: pixels, and share of the blob's width and height.
pub(super) const FOOT_PX: DVec2 = DVec2::new(1.0, 1.5);
pub(super) const FOOT_SHARE: DVec2 = DVec2::new(0.08, 0.03);

/// The same of a foot that the border cuts off and the track tells: share of the thing's width and height.
const CUT_SHARE: DVec2 = DVec2::new(0.12, 0.12);

/// Beyond the border by less than this share of its height, a track's foot is but where the border cuts: nobody saw the whole.
const BEYOND_SHARE: f64 = 0.1;

/// Standard deviation of a foot that nobody tells: cut off, or hidden behind a wall's edge, metres.
const GUESSED_M: f64 = 1.5;

/// What is broader than people, by more than this, metres, has sides: every camera sees the nearest one as its foot. Shares
/// of the excess by which the middle may lie along the ray and across it.
const SLENDER_M: f64 = 0.9;
const BEHIND_SHARE: f64 = 0.7;
const BESIDE_SHARE: f64 = 0.25;

/// Standard deviation of a height, metres, and of a head's place in the picture, pixels.
const HEIGHT_M: f64 = 0.06;
const HEAD_PX: f64 = 2.0;

/// Everything that a camera, `member` of the scene, sees as billboards; what has a foot that meets no surface is left
/// out.
pub(super) fn sightings<'a>(
    (camera_idx, member): (usize, usize),
    state: &'a CameraState,
    surfaces: &'a Surfaces,
    together: Option<&Together>,
) -> impl Iterator<Item = Sighting> + 'a {
    let observation = &state.observation;
    let mut pieces = pieces(member, &observation.blobs, &observation.tracks);
    if let Some(together) = together {
        pieces.retain_mut(|piece| together.leave_open(member, &observation.labels, piece));
    }
    pieces.into_iter().filter_map(move |piece| sighting((camera_idx, member), state, surfaces, piece))
}

fn sighting(
    (camera_idx, member): (usize, usize),
    state: &CameraState,
    surfaces: &Surfaces,
    piece: Piece,
) -> Option<Sighting> {
    let mask = &state.observation.labels;
    let size = DVec2::new(f64::from(mask.width), f64::from(mask.height));
    let rect = piece.rect;
    let middle = DVec2::new(
        0.5f64.mul_add(f64::from(rect.width), f64::from(rect.x)),
        0.5f64.mul_add(f64::from(rect.height), f64::from(rect.y)),
    );
    let down = Down::at(&state.corrected, middle / size, size);
    let piece = lying(piece, down, mask);
    let contact = ground_point(&state.corrected, surfaces, DVec2::from_array(piece.foot_in_image) / size)?;
    let plane = UprightPlane::facing(&state.corrected, contact)?;
    let n_lines = if down.is_sideways() { rect.width } else { rect.height };
    let (mut left, mut right, mut top) = (f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY);
    for line in down.lines(mask, rect, n_lines.div_ceil(MAX_OUTLINE_ROWS)) {
        for end in line.ends {
            let Some([across, _]) = plane.cut(&state.corrected, end / size) else { continue };
            left = left.min(across);
            right = right.max(across);
        }
        if let Some([_, up]) = plane.cut(&state.corrected, line.top / size) {
            top = top.max(up);
        }
    }
    // The lowest texel may belong to either foot, or to a corner where the camera is rolled: the outline's middle
    // says better where along the base line the entity stands.
    let foot_in_world = plane.point([0.5 * (left + right), 0.0]);
    let half_width = 0.5 * (right - left);
    let [least, most] = EXTENT_RANGE_M;
    let is_sound = |extent: f64| extent >= least && extent <= most;
    if !(is_sound(right - left) && is_sound(top)) {
        return None;
    }
    let billboard = Billboard {
        camera_idx,
        rect,
        foot_in_world,
        right_in_world: plane.right,
        left_right_m: [-half_width, half_width],
        height_m: top,
        is_truncated: piece.is_truncated,
        owner: OwnerMap::NOBODY,
        shown_share: 1.0,
    };
    let foot = foot(state, surfaces, (&piece, down), (contact, foot_in_world), right - left);
    let is_one = piece.tracks.len() < 2;
    let is_whole = !piece.is_truncated && is_one;
    let image = &state.observation.frame.image;
    let height = height(&state.corrected, &billboard, &foot, size);
    let shows_head = is_one && (is_whole || is_cut_below(&piece, mask));
    let head = if shows_head { head(&state.corrected, &billboard, height, size) } else { None };
    let estimate = Estimate {
        foot,
        ground_m: foot_in_world.z,
        height: is_whole.then_some(height),
        look: if is_whole { Look::of(image, mask, rect) } else { None },
    };
    Some(Sighting {
        billboard,
        member,
        estimate,
        head,
        tracks: piece.tracks,
        person: None,
        is_rest: piece.is_rest,
    })
}

/// A piece as it lies in the picture where down is not below: its foot is at its end that is down, the border may cut another
/// end, and no track tells where it is beyond.
fn lying(piece: Piece, down: Down, mask: &Mask) -> Piece {
    let foot = (down != Down::Below).then(|| down.foot_in_image(mask, piece.rect)).flatten();
    match foot {
        Some(foot) => Piece {
            foot_in_image: foot.to_array(),
            is_truncated: down.is_cut(piece.rect, mask),
            whole: None,
            ..piece
        },
        None => piece,
    }
}

/// Where a piece stands for sure and for unsure: `contact` is its lowest texel's place, `middle` its outline's.
fn foot(
    state: &CameraState,
    surfaces: &Surfaces,
    (piece, down): (&Piece, Down),
    (contact, middle): (DVec3, DVec3),
    width_m: f64,
) -> Foot {
    let mask = &state.observation.labels;
    let size = DVec2::new(f64::from(mask.width), f64::from(mask.height));
    let extent = |width: u32, height: u32| DVec2::new(f64::from(width), f64::from(height));
    let guessed = DMat2::from_diagonal(DVec2::splat(GUESSED_M.powi(2)));
    let away_m = (contact - state.corrected.pose().position_in_world).truncate();
    let away = away_m.normalize_or_zero();
    let excess_m = (width_m - SLENDER_M).max(0.0);
    let least = round(super::estimate::FLOOR_M)
        + along(away) * (BEHIND_SHARE * excess_m).powi(2)
        + along(away.perp()) * (BESIDE_SHARE * excess_m).powi(2);
    if piece.is_truncated {
        // The track knows how large the whole thing is, so also where its foot is beyond the border.
        let told = piece.whole.and_then(|(rect, foot)| {
            let beyond_px = foot[1] - size.y;
            if is_cut_below(piece, mask) && beyond_px < BEYOND_SHARE * f64::from(rect.height) {
                return None;
            }
            let texture = DVec2::from_array(foot) / size;
            let place = ground_point(&state.corrected, surfaces, texture)?;
            let noise = hypot(FOOT_PX, CUT_SHARE * extent(rect.width, rect.height));
            Some((place, ground_covariance(&state.corrected, place, texture, noise / size)?))
        });
        let (place, covariance) = told.unwrap_or((middle, guessed + along(away) * GUESSED_M.powi(2)));
        return Foot::new(place.truncate(), covariance + least);
    }
    let texture = DVec2::from_array(piece.foot_in_image) / size;
    let lying = extent(piece.rect.width, piece.rect.height);
    let noise = hypot(down.lying(FOOT_PX), down.lying(FOOT_SHARE) * lying);
    let mut covariance = ground_covariance(&state.corrected, contact, texture, noise / size)
        .unwrap_or(guessed + along(away) * GUESSED_M.powi(2));
    if piece.tracks.len() > 1 {
        // Whoever of those who share it: anywhere along its width.
        let across_px = down.lying(lying).x;
        let quarter_m = 0.25 * across_px / size.x * f64::from(state.corrected.size_px().0) * away_m.length()
            / state.corrected.focal_px().x;
        covariance += along(away.perp()) * quarter_m.powi(2);
    }
    Foot::new(middle.truncate(), covariance + least)
}

/// Whether the picture's lower border cuts a piece, and no other.
fn is_cut_below(piece: &Piece, mask: &Mask) -> bool {
    let PixelRect { x, y, width, height } = piece.rect;
    y > 0 && x > 0 && x + width < mask.width && y + height >= mask.height
}

fn hypot(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x.hypot(b.x), a.y.hypot(b.y))
}

fn round(sd_m: f64) -> DMat2 {
    DMat2::from_diagonal(DVec2::splat(sd_m * sd_m))
}

/// How well a place on the ground is known whose texture coordinate errs by `noise`, square metres: the error of its ray,
/// carried to the level plane through it. `None` where the ray does not come down on it there.
pub(super) fn ground_covariance(
    camera: &Camera,
    place: DVec3,
    texture: DVec2,
    noise: DVec2,
) -> Option<DMat2> {
    /// A ray that meets the plane further from the place was stopped before.
    const OFF_M: f64 = 0.02;
    let ray = camera.ray(texture)?;
    let reach = (place.z - ray.origin.z) / ray.direction.z;
    let met = ray.at(reach);
    if !(reach > 0.0 && met.distance(place) <= OFF_M + 1e-6 * reach) {
        return None;
    }
    // d/dt (o + d (z - o_z) / d_z) by the ray's direction d; a ray is asked for a small step beside, on either side.
    let step = |beside: DVec2| {
        let there = camera.ray(texture + beside).map(|other| other.direction - ray.direction);
        there.or_else(|| camera.ray(texture - beside).map(|other| ray.direction - other.direction))
    };
    let column = |axis: DVec2, noise: f64| {
        let turned = step(axis * 1e-4)? * 1e4 * noise;
        Some((reach * (turned - ray.direction * (turned.z / ray.direction.z))).truncate())
    };
    let [x, y] = [column(DVec2::X, noise.x)?, column(DVec2::Y, noise.y)?];
    Some(DMat2::from_cols(x * x.x + y * y.x, x * x.y + y * y.y))
}

/// The ray over a piece's head; of what is broader than tall, and than people are, there is none: that is no person.
fn head(camera: &Camera, billboard: &Billboard, height: Height, size: DVec2) -> Option<Head> {
    let [left, right] = billboard.left_right_m;
    let from_camera = billboard.foot_in_world - camera.pose().position_in_world;
    let distance_m = from_camera.truncate().length();
    let head = Head {
        camera: camera.pose().position_in_world.truncate(),
        above_m: -from_camera.z,
        away: from_camera.truncate() / distance_m,
        distance_m,
        slope: (billboard.height_m + from_camera.z) / distance_m,
        noise_m: height.sd_m.min(HEIGHT_M + HEAD_PX * distance_m / pixels_per_focal(camera, size)),
    };
    let is_slender =
        right - left < billboard.height_m || (billboard.is_truncated && right - left < SLENDER_M);
    (is_slender && distance_m > NADIR_M).then_some(head)
}

/// The billboard of somebody whose legs are hidden, who stands nearer to the camera than what is seen lowest: at `foot`.
pub(super) fn brought_near(billboard: &Billboard, head: &Head, foot: DVec2) -> Billboard {
    let share = ((foot - head.camera).dot(head.away) / head.distance_m).clamp(0.1, 1.0);
    let place = head.camera + (billboard.foot_in_world.truncate() - head.camera) * share;
    Billboard {
        foot_in_world: place.extend(billboard.foot_in_world.z),
        left_right_m: billboard.left_right_m.map(|edge| edge * share),
        height_m: (head.slope * share).mul_add(head.distance_m, head.above_m).max(EXTENT_RANGE_M[0]),
        ..billboard.clone()
    }
}

/// The focal length in pixels of masks of `size`.
fn pixels_per_focal(camera: &Camera, size: DVec2) -> f64 {
    camera.focal_px().y * size.y / f64::from(camera.size_px().1)
}

/// A billboard's height, with how well it is known: by the head's pixels, and by the foot, which says how far away it is.
fn height(camera: &Camera, billboard: &Billboard, foot: &Foot, size: DVec2) -> Height {
    let from_camera = billboard.foot_in_world - camera.pose().position_in_world;
    let away = from_camera.truncate();
    let head_m = HEAD_PX * from_camera.length() / pixels_per_focal(camera, size);
    // What the height changes by when the plane moves away by a metre.
    let slope = (billboard.height_m + from_camera.z) / away.length().max(NADIR_M);
    let by_foot_m = slope * foot.sd_along_m(away.normalize_or_zero());
    Height { mean_m: billboard.height_m, sd_m: HEIGHT_M.hypot(head_m).hypot(by_foot_m) }
}

/// Where a texel's ray meets what something can stand on. A wall met first stands behind the foot: its own foot
/// is then the farthest place that can be meant.
fn ground_point(camera: &Camera, surfaces: &Surfaces, texture: DVec2) -> Option<DVec3> {
    use videofields_vision::geometry::Face;
    let ray = camera.ray(texture)?;
    let hit = surfaces.hit(&ray, 0.0)?;
    match hit.face {
        Face::Top => Some(hit.point_in_world),
        // Ground has no side; anything else that is as steep as a wall is one.
        Face::Side => {
            let down = Ray { origin: hit.point_in_world + hit.normal_in_world * 0.05, direction: -DVec3::Z };
            surfaces.hit(&down, 0.0).map(|below| below.point_in_world)
        }
        Face::Bottom => None,
    }
}

/// The upright plane through a foot that faces a camera horizontally.
#[derive(Clone, Copy)]
pub(super) struct UprightPlane {
    foot: DVec3,
    normal: DVec3,
    right: DVec3,
}

impl UprightPlane {
    pub(super) fn facing(camera: &Camera, foot: DVec3) -> Option<Self> {
        let away = (foot - camera.pose().position_in_world).truncate();
        if away.length() < NADIR_M {
            return None;
        }
        let away = away.normalize().extend(0.0);
        Some(Self { foot, normal: -away, right: away.cross(DVec3::Z) })
    }

    /// The plane of a billboard that exists.
    pub(super) fn of(billboard: &Billboard) -> Self {
        let right = billboard.right_in_world;
        Self { foot: billboard.foot_in_world, normal: right.cross(DVec3::Z), right }
    }

    /// Where a texel's ray meets the plane: metres to the right of the foot and above it.
    pub(super) fn cut(&self, camera: &Camera, texture: DVec2) -> Option<[f64; 2]> {
        let ray = camera.ray(texture)?;
        let from_foot = ray.at(ray.distance_to_plane(self.foot, self.normal)?) - self.foot;
        Some([from_foot.dot(self.right), from_foot.z])
    }

    /// The inverse of [`Self::cut`].
    pub(super) fn point(&self, [across_m, up_m]: [f64; 2]) -> DVec3 {
        self.foot + self.right * across_m + DVec3::Z * up_m
    }
}
