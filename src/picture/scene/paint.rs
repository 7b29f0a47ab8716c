//! Pictures on surfaces, and where they lie on them.

use super::texture::Texture;
use glam::{DVec2, DVec3};
use std::sync::Arc;
use videofields_vision::geometry::{PlaneMap, Shape, Sheet, SheetKind, Triangle};

/// How pictures cover a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Paint {
    /// Repeated over its faces; what has none is plain.
    Repeated {
        /// Over upright faces.
        walls: Option<Repeated>,
        /// Over what is seen from above.
        level: Option<Repeated>,
    },
    /// Laid on the ground; beyond the picture the ground is plain.
    Registered {
        /// The picture.
        picture: Arc<Texture>,
        /// Where it lies.
        map: PlaneMap,
    },
    /// As a model's file says, triangle by triangle.
    Mapped {
        /// The pictures.
        pictures: Vec<Arc<Texture>>,
        /// For each of the model's triangles.
        triangles: Vec<MappedTriangle>,
    },
}

/// A picture that repeats over faces from their lower left corners on.
#[derive(Clone, Debug, PartialEq)]
pub struct Repeated {
    /// The picture.
    pub picture: Arc<Texture>,
    /// Its width and height on the face, metres.
    pub size_m: DVec2,
}

/// What covers a triangle of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MappedTriangle {
    /// Which of the pictures; none where the triangle is plain.
    pub picture: Option<u16>,
    /// Texture coordinates of its corners; whole numbers are taken off, so that they are small.
    pub corners: [[f32; 2]; 3],
}

/// How often a picture may repeat along a face: beyond, 32 bits no longer tell its texels apart.
pub(super) const MOST_REPEATS: f64 = 4096.0;

/// A picture on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Painted<'a> {
    /// The picture.
    pub picture: &'a Arc<Texture>,
    /// Homogeneous texture coordinates (s, t, q) of the corners: the picture's place is s/q, t/q, and all three are linear
    /// over the triangle. Where q is not above 0 there is no picture.
    pub corners: [DVec3; 3],
    /// Whether the plain colour shows beyond the picture, and not more of it.
    pub ends: bool,
    /// Whether the plain colour tints it.
    pub is_tinted: bool,
}

impl Paint {
    /// The picture on one of the triangles that are drawn for `shape`, which this is the paint of; `None` where that is
    /// plain.
    #[must_use]
    pub fn on(&self, shape: &Shape, triangle: &Triangle) -> Option<Painted<'_>> {
        match self {
            Self::Repeated { walls, level } => {
                let sheet = shape.sheet(triangle)?;
                let Repeated { picture, size_m } = match sheet.kind {
                    SheetKind::Wall => walls.as_ref()?,
                    SheetKind::Level => level.as_ref()?,
                };
                let corners = repeated(&sheet, *size_m).map(|corner| corner.extend(1.0));
                Some(Painted { picture, corners, ends: false, is_tinted: false })
            }
            Self::Registered { picture, map } => {
                let corners = triangle.corners.map(|corner| map.texture_at(corner.truncate()));
                Some(Painted { picture, corners, ends: true, is_tinted: false })
            }
            Self::Mapped { pictures, triangles } => {
                let MappedTriangle { picture, corners } = triangles.get(triangle.part as usize)?;
                let picture = pictures.get(usize::from((*picture)?))?;
                let corners = corners.map(|[s, t]| DVec3::new(s.into(), t.into(), 1.0));
                Some(Painted { picture, corners, ends: false, is_tinted: true })
            }
        }
    }
}

/// Texture coordinates of a triangle's corners, near 0: whole repetitions are taken off.
fn repeated(sheet: &Sheet, size_m: DVec2) -> [DVec2; 3] {
    let width_m = match sheet.around_m {
        // A whole number of times around, so that there is no seam.
        Some(around_m) => around_m / (around_m / size_m.x).round().max(1.0),
        None => size_m.x,
    };
    // Rows of pictures run downwards.
    let corners = sheet.corners_m.map(|place| DVec2::new(place.x / width_m, -place.y / size_m.y));
    near_zero(corners)
}

/// The same places of a picture that repeats, as near to 0 as whole numbers lead.
pub(super) fn near_zero(corners: [DVec2; 3]) -> [DVec2; 3] {
    let whole = corners[0].min(corners[1]).min(corners[2]).floor();
    // Mirrored pictures come again every second time.
    let even = (whole / 2.0).floor() * 2.0;
    corners.map(|corner| corner - even)
}

/// How often a picture repeats over a triangle, along the axis along which that is more.
pub(super) fn repeats(corners: &[DVec2; 3]) -> f64 {
    let [a, b, c] = corners;
    (a.max(*b).max(*c) - a.min(*b).min(*c)).max_element()
}

/// How often a picture of that size repeats over the triangle of the shape over which it does most.
pub(super) fn most_repeats(shape: &Shape, kind: SheetKind, size_m: DVec2) -> f64 {
    let mut most: f64 = 0.0;
    shape.triangles(&mut |triangle| {
        if let Some(sheet) = shape.sheet(&triangle).filter(|sheet| sheet.kind == kind) {
            most = most.max(repeats(&repeated(&sheet, size_m)));
        }
    });
    most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::texture::Wrap;
    use videofields_vision::geometry::{Cylinder, OrientedBox, TriangleMesh};

    fn picture() -> Arc<Texture> {
        Arc::new(Texture::from_rgb((1, 1), &[9; 3], [Wrap::Repeat; 2]))
    }

    fn painted(shape: &Shape, paint: &Paint) -> Vec<(Triangle, [DVec3; 3])> {
        let mut found = Vec::new();
        shape.triangles(&mut |triangle| {
            if let Some(painted) = paint.on(shape, &triangle) {
                found.push((triangle, painted.corners));
            }
        });
        found
    }

    #[test]
    fn a_picture_stands_upright_on_walls_and_its_lower_left_is_the_walls() {
        let solid = OrientedBox::new(DVec3::new(5e5, 5e6, 2.0), DVec3::new(8.0, 2.0, 4.0), 0.0).unwrap();
        let shape = Shape::Box(solid);
        let walls = Some(Repeated { picture: picture(), size_m: DVec2::new(2.0, 4.0) });
        let found = painted(&shape, &Paint::Repeated { walls, level: None });
        assert_eq!(found.len(), 8, "four walls, plain roof");
        for (triangle, corners) in found.iter().filter(|(triangle, _)| triangle.normal == DVec3::NEG_Y) {
            for (corner, at) in triangle.corners.iter().zip(corners) {
                // From 0 at the left edge to 4 widths, from 2 (or 0) at the foot to one less at the eaves.
                assert_eq!(at.x, (corner.x - (5e5 - 4.0)) / 2.0, "{triangle:?}");
                assert_eq!(at.y, 2.0 - corner.z / 4.0);
            }
        }
    }

    #[test]
    fn around_a_cylinder_a_picture_has_no_seam() {
        let shape = Shape::Cylinder(Cylinder::new(DVec3::ZERO, 2.0, 4.0).unwrap());
        let walls = Some(Repeated { picture: picture(), size_m: DVec2::new(5.0, 4.0) });
        // 12.57 m around: nearer to 3 times 4.19 m than to 2 times 6.28 m.
        let found = painted(&shape, &Paint::Repeated { walls, level: None });
        let (east, corners) = found
            .iter()
            .find(|(triangle, _)| triangle.normal.y < 0.0 && triangle.normal.x > 0.999)
            .expect("the last side");
        for (corner, at) in east.corners.iter().zip(corners) {
            if (corner.y).abs() < 1e-9 {
                assert!((at.x.fract() - 1.0).abs() < 1e-9 || at.x.fract().abs() < 1e-9, "{at}");
            }
        }
        let total: f64 =
            found.iter().map(|(_, [a, b, c])| a.x.max(b.x).max(c.x) - a.x.min(b.x).min(c.x)).sum();
        assert!((total - 6.0).abs() < 1e-9, "three times around, by two triangles a side: {total}");
    }

    #[test]
    fn whole_repetitions_are_taken_off() {
        let far = [DVec2::new(1e9, -3e8), DVec2::new(1e9 + 0.25, -3e8), DVec2::new(1e9, -3e8 + 0.5)];
        assert_eq!(near_zero(far), [DVec2::ZERO, DVec2::new(0.25, 0.0), DVec2::new(0.0, 0.5)]);
        // By even numbers, so that mirrored pictures stay as they are.
        assert_eq!(near_zero([DVec2::new(3.5, -0.5); 3])[0], DVec2::new(1.5, 1.5));
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
        let shape = Shape::Model(TriangleMesh::new(points, vec![[0, 1, 2]]).unwrap());
        assert_eq!(most_repeats(&shape, SheetKind::Wall, DVec2::ONE), 0.0, "models have their own");
    }
}
