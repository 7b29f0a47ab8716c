//! Which way down is in a camera's picture where something stands: under a ceiling camera people lie along the picture's
//! rays from the nadir, and their foot is the end that points to it, not their lowest row.

use super::billboard::MOVING;
use glam::{DVec2, DVec3};
use videofields_vision::frame::Mask;
use videofields_vision::geometry::Camera;
use videofields_vision::segment::PixelRect;

/// How far from the camera the point lies that is moved down, and by how much, metres: their ratio alone matters, and only
/// that it is small.
const PROBE_M: [f64; 2] = [10.0, 0.01];

/// The side of the picture that is down, the nearest of four.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Down {
    Below,
    Above,
    Left,
    Right,
}

/// A row, or where people lie sideways a column, of a thing's outline, pixels with pixel centres at +0.5.
pub(super) struct Slice {
    /// Its outer ends.
    pub(super) ends: [DVec2; 2],
    /// Between them, at its edge that is further up.
    pub(super) top: DVec2,
    /// Between them, at its edge that is further down.
    pub(super) bottom: DVec2,
}

impl Down {
    /// At `texture` in the pictures of `camera`, which have `size` pixels.
    pub(super) fn at(camera: &Camera, texture: DVec2, size: DVec2) -> Self {
        let [reach_m, drop_m] = PROBE_M;
        let moved = camera.ray(texture).and_then(|ray| {
            let from = ray.at(reach_m);
            let [from, to] = [from, from - DVec3::Z * drop_m].map(|point| camera.project(point));
            Some((to?.texture - from?.texture) * size)
        });
        match moved {
            Some(by) if by.y.abs() >= by.x.abs() && by.y < 0.0 => Self::Above,
            Some(by) if by.x.abs() > by.y.abs() => {
                if by.x < 0.0 {
                    Self::Left
                } else {
                    Self::Right
                }
            }
            _ => Self::Below,
        }
    }

    /// Whether people lie sideways.
    pub(super) const fn is_sideways(self) -> bool {
        matches!(self, Self::Left | Self::Right)
    }

    /// What is said of a thing's width and height, as it lies in the picture.
    pub(super) const fn lying(self, across_up: DVec2) -> DVec2 {
        if self.is_sideways() { DVec2::new(across_up.y, across_up.x) } else { across_up }
    }

    /// Whether the border cuts something anywhere but at its upper end, so that its foot may lie outside the picture.
    pub(super) const fn is_cut(self, rect: PixelRect, mask: &Mask) -> bool {
        let [left, above] = [rect.x == 0, rect.y == 0];
        let [right, below] = [rect.x + rect.width >= mask.width, rect.y + rect.height >= mask.height];
        match self {
            Self::Below => left || right || below,
            Self::Above => left || right || above,
            Self::Left => left || above || below,
            Self::Right => right || above || below,
        }
    }

    /// Every `step`-th line of what moves within `rect`, the uppermost first.
    pub(super) fn lines(self, mask: &Mask, rect: PixelRect, step: u32) -> impl Iterator<Item = Slice> + '_ {
        let count = if self.is_sideways() { rect.width } else { rect.height };
        (0..count).step_by(step.max(1) as usize).filter_map(move |nth| self.line(mask, rect, nth))
    }

    /// The foot of what moves within `rect`: the middle of its lowest line, at that line's lower edge.
    pub(super) fn foot_in_image(self, mask: &Mask, rect: PixelRect) -> Option<DVec2> {
        let count = if self.is_sideways() { rect.width } else { rect.height };
        (0..count).rev().find_map(|nth| self.line(mask, rect, nth)).map(|line| line.bottom)
    }

    /// The line that is `nth` from above.
    fn line(self, mask: &Mask, rect: PixelRect, nth: u32) -> Option<Slice> {
        let nth = match self {
            Self::Below | Self::Right => nth,
            Self::Above => rect.height - 1 - nth,
            Self::Left => rect.width - 1 - nth,
        };
        let is_moving = |along: &u32| {
            let (x, y) = if self.is_sideways() {
                (rect.x + nth, rect.y + along)
            } else {
                (rect.x + along, rect.y + nth)
            };
            mask.get(x, y) == MOVING
        };
        let len = if self.is_sideways() { rect.height } else { rect.width };
        let (first, last) = ((0..len).find(is_moving)?, (0..len).rev().find(is_moving)?);
        let corner = if self.is_sideways() { [rect.y, rect.x] } else { [rect.x, rect.y] };
        let (across, line) = (f64::from(corner[0]), f64::from(corner[1] + nth));
        // A pixel's outer edges, so that whole pixels are covered.
        let (from, to) = (across + f64::from(first), across + f64::from(last) + 1.0);
        let (upper, lower) = match self {
            Self::Below | Self::Right => (line, line + 1.0),
            Self::Above | Self::Left => (line + 1.0, line),
        };
        let place = |across: f64, line: f64| self.lying(DVec2::new(across, line));
        Some(Slice {
            ends: [place(from, line + 0.5), place(to, line + 0.5)],
            top: place(0.5 * (from + to), upper),
            bottom: place(0.5 * (from + to), lower),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::geometry::{Distortion, Pose};

    const SIZE: DVec2 = DVec2::new(64.0, 48.0);

    fn camera(eye: DVec3, target: DVec3) -> Camera {
        let pose = Pose::looking_at(eye, target).unwrap();
        let centre = SIZE * 0.5;
        Camera::new((64, 48), DVec2::splat(40.0), centre, Distortion::None, pose).unwrap()
    }

    #[test]
    fn down_is_below_before_a_level_camera_and_inwards_under_a_ceiling() {
        let at = |camera: &Camera, x: f64, y: f64| Down::at(camera, DVec2::new(x, y), SIZE);
        let level = camera(DVec3::Z * 3.0, DVec3::new(0.0, 10.0, 0.0));
        for (x, y) in [(0.1, 0.1), (0.9, 0.5), (0.5, 0.9)] {
            assert_eq!(at(&level, x, y), Down::Below);
        }
        let ceiling = camera(DVec3::Z * 6.0, DVec3::new(0.0, 0.01, 0.0));
        assert_eq!(at(&ceiling, 0.1, 0.5), Down::Right);
        assert_eq!(at(&ceiling, 0.9, 0.5), Down::Left);
        assert_eq!(at(&ceiling, 0.5, 0.1), Down::Below);
        assert_eq!(at(&ceiling, 0.5, 0.9), Down::Above);
    }

    #[test]
    fn a_foot_is_the_end_that_is_down_and_the_border_may_cut_the_head() {
        let mut mask = Mask::filled(8, 6, 0);
        // A bar of 2 x 5, narrower at its left end.
        for (x, y) in (1..6).flat_map(|x| [(x, 2), (x, 3)]).filter(|place| *place != (1, 2)) {
            mask.data[y * 8 + x] = MOVING;
        }
        let rect = PixelRect { x: 1, y: 2, width: 5, height: 2 };
        let foot = |down: Down| down.foot_in_image(&mask, rect).unwrap();
        assert_eq!(foot(Down::Left), DVec2::new(1.0, 3.5));
        assert_eq!(foot(Down::Right), DVec2::new(6.0, 3.0));
        assert_eq!(foot(Down::Below), DVec2::new(3.5, 4.0));
        assert_eq!(foot(Down::Above), DVec2::new(4.0, 2.0));
        let tops: Vec<DVec2> = Down::Left.lines(&mask, rect, 4).map(|line| line.top).collect();
        assert_eq!(tops, [DVec2::new(6.0, 3.0), DVec2::new(2.0, 3.5)]);
        let at_border = PixelRect { x: 0, ..rect };
        let is_cut = |down: Down| down.is_cut(at_border, &mask);
        assert!(!is_cut(Down::Right) && is_cut(Down::Left) && is_cut(Down::Below) && is_cut(Down::Above));
        assert_eq!(Down::Below.foot_in_image(&Mask::filled(8, 6, 0), rect), None);
    }
}
