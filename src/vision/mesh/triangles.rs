//! Triangles between points, with directions and colours: bounds, volume, whether they are a closed manifold.

use crate::error::ErrorKind;
use glam::{DVec3, Vec3};
use std::io;

/// Why there is no mesh, or what is wrong with one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MeshError {
    /// There is no surface where nothing is inside.
    #[error("nothing is inside, so there is no surface")]
    Empty,
    /// More points than a grid may have.
    #[error("a grid of {size:?} points is too large: at most 2048 along an axis and 2^27 in all are allowed")]
    Grid {
        /// Points along x, y and z.
        size: [u32; 3],
    },
    /// More triangles than a mesh may have.
    #[error("the surface has {count} triangles, at most {} are allowed", Mesh::MAX_TRIANGLES)]
    Triangles {
        /// How many there are.
        count: u64,
    },
    /// A number is not finite, or a length not positive.
    #[error("{field} must be finite, and lengths positive")]
    NotFinite {
        /// What it is.
        field: &'static str,
    },
    /// Lists do not belong together.
    #[error("{field}: {count} for {n_points} points")]
    Count {
        /// Which list.
        field: &'static str,
        /// How many it has.
        count: usize,
        /// Points of the mesh.
        n_points: usize,
    },
    /// A triangle names a point that is not there, or one twice.
    #[error("triangle {triangle} has the corners {corners:?}, expected three different of {n_points} points")]
    Corners {
        /// Which triangle.
        triangle: usize,
        /// What it names.
        corners: [u32; 3],
        /// Points of the mesh.
        n_points: usize,
    },
    /// The triangles around a point are not one ring.
    #[error("the triangles around point {point} are not one closed ring, the same way around")]
    Ring {
        /// Which point.
        point: u32,
    },
}

/// A mesh that no file can hold.
impl From<MeshError> for io::Error {
    fn from(error: MeshError) -> Self {
        Self::new(io::ErrorKind::InvalidInput, error)
    }
}

impl MeshError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Empty => ErrorKind::NotFound,
            Self::Grid { .. } | Self::Triangles { .. } => ErrorKind::TooLarge,
            Self::NotFinite { .. } | Self::Count { .. } | Self::Corners { .. } => ErrorKind::Invalid,
            Self::Ring { .. } => ErrorKind::Internal,
        }
    }
}

/// Triangles between points, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// The points, metres, in the world.
    pub positions_m: Vec<DVec3>,
    /// The surface's direction at each point, outward, of length 1: the mean of its triangles', by their areas.
    pub normals: Vec<Vec3>,
    /// The colour of each point, where colours are known.
    pub colors_srgb: Option<Vec<[u8; 3]>>,
    /// Three points each.
    pub triangles: Vec<[u32; 3]>,
    /// Points of the grid that were added so that the surface is a manifold.
    pub n_mended: usize,
}

impl Mesh {
    /// Most triangles of a mesh.
    pub const MAX_TRIANGLES: usize = 1 << 23;

    /// A mesh without colours; its normals follow from its triangles, whose corners must be points that there are.
    #[must_use]
    pub fn new(positions_m: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let normals = normals_of(&positions_m, &triangles);
        Self { positions_m, normals, colors_srgb: None, triangles, n_mended: 0 }
    }

    /// How long sides of triangles are in the mean, each counted for each of its triangles, metres; 0 without triangles.
    #[must_use]
    pub fn mean_side_m(&self) -> f64 {
        let around_m = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| self.positions_m[corner as usize]);
            a.distance(b) + b.distance(c) + c.distance(a)
        };
        let n_sides = (3 * self.triangles.len()).max(1);
        self.triangles.iter().map(around_m).sum::<f64>() / n_sides as f64
    }

    /// Low and high corner of the box around all points, metres, in the world; none without points.
    #[must_use]
    pub fn bounds(&self) -> Option<[DVec3; 2]> {
        let first = *self.positions_m.first()?;
        Some(self.positions_m.iter().fold([first; 2], |[low, high], at| [low.min(*at), high.max(*at)]))
    }

    /// What the surface encloses, cubic metres; negative where it is inside out, and of no meaning where it is open.
    #[must_use]
    pub fn volume_m3(&self) -> f64 {
        // Tetrahedra from a point nearby: from the world's origin they would be large and cancel.
        let origin = self.positions_m.first().copied().unwrap_or_default();
        let six_volumes = self.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| self.positions_m[corner as usize] - origin);
            a.dot(b.cross(c))
        });
        six_volumes.sum::<f64>() / 6.0
    }

    /// Whether the surface is closed and a manifold: around each point its triangles form one ring, all the same way around.
    /// Each edge is then part of two triangles, in opposite directions.
    ///
    /// **Cost**: sorts all corners; 36 bytes a triangle meanwhile.
    ///
    /// # Errors
    /// With the first place where it is not, or where lists do not belong together.
    pub fn check(&self) -> Result<(), MeshError> {
        self.is_sound()?;
        // What lies across each corner of a triangle: its point, and the edge from the next point to the one after.
        let mut across: Vec<[u32; 3]> =
            self.triangles.iter().flat_map(|[a, b, c]| [[*a, *b, *c], [*b, *c, *a], [*c, *a, *b]]).collect();
        across.sort_unstable();
        let mut rest = across.as_slice();
        for point in 0..self.positions_m.len() as u32 {
            let n_corners = rest.iter().take_while(|corner| corner[0] == point).count();
            let (fan, others) = rest.split_at(n_corners);
            if !is_ring(fan) {
                return Err(MeshError::Ring { point });
            }
            rest = others;
        }
        Ok(())
    }

    /// Whether lists are as long as they must be, numbers finite, and all corners there.
    ///
    /// # Errors
    /// With the first thing that is not.
    pub fn is_sound(&self) -> Result<(), MeshError> {
        let n_points = self.positions_m.len();
        let n_colors = self.colors_srgb.as_ref().map_or(n_points, Vec::len);
        for (field, count) in [("normals", self.normals.len()), ("colours", n_colors)] {
            if count != n_points {
                return Err(MeshError::Count { field, count, n_points });
            }
        }
        if self.triangles.len() > Self::MAX_TRIANGLES {
            return Err(MeshError::Triangles { count: self.triangles.len() as u64 });
        }
        if !self.positions_m.iter().all(|at| at.is_finite())
            || !self.normals.iter().all(|normal| normal.is_finite())
        {
            return Err(MeshError::NotFinite { field: "positions and normals" });
        }
        for (triangle, corners) in self.triangles.iter().enumerate() {
            let [a, b, c] = *corners;
            if a == b || b == c || c == a || corners.iter().any(|corner| *corner as usize >= n_points) {
                return Err(MeshError::Corners { triangle, corners: *corners, n_points });
            }
        }
        Ok(())
    }
}

/// Whether triangles around a point, sorted and each given by the edge across, follow each other in one ring.
fn is_ring(fan: &[[u32; 3]]) -> bool {
    let Some([_, first, mut at]) = fan.first().copied() else { return false };
    // A ring of n comes back after n triangles, not before.
    for _ in 1..fan.len() {
        let Ok(next) = fan.binary_search_by_key(&at, |corner| corner[1]) else { return false };
        if at == first {
            return false;
        }
        at = fan[next][2];
    }
    at == first
}

/// Each point's outward direction: the mean of its triangles', by their areas; where those cancel out, that of one of them.
fn normals_of(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let twice_area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| positions[corner as usize]);
        (b - a).cross(c - a)
    };
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for corners in triangles {
        let along = twice_area(corners);
        for corner in corners {
            sums[*corner as usize] += along;
        }
    }
    let mut normals: Vec<Vec3> = sums.iter().map(|sum| sum.normalize_or_zero().as_vec3()).collect();
    for corners in triangles {
        for corner in corners {
            let normal = &mut normals[*corner as usize];
            if *normal == Vec3::ZERO {
                *normal = twice_area(corners).normalize_or(DVec3::Z).as_vec3();
            }
        }
    }
    normals
}

#[cfg(test)]
mod tests {
    use super::super::testing::cube;
    use super::*;

    #[test]
    fn a_cube_is_closed_and_has_its_volume_anywhere() {
        for low in [DVec3::ZERO, DVec3::new(-3.0, 7.0, 0.5), DVec3::splat(4e6)] {
            let mesh = cube(low);
            mesh.check().expect("a closed cube");
            assert!((mesh.volume_m3() - 8.0).abs() < 1e-9, "{}", mesh.volume_m3());
            assert_eq!(mesh.bounds(), Some([low, low + 2.0]));
            for (at, normal) in mesh.positions_m.iter().zip(&mesh.normals) {
                assert!((*at - low - 1.0).dot(normal.as_dvec3()) > 0.9 && normal.is_normalized());
            }
        }
    }

    #[test]
    fn what_is_not_closed_or_no_manifold_is_found() {
        let check = |change: &dyn Fn(&mut Mesh)| {
            let mut mesh = cube(DVec3::ZERO);
            change(&mut mesh);
            mesh.check()
        };
        let is_ring = |found: Result<(), MeshError>| matches!(found, Err(MeshError::Ring { .. }));
        assert!(is_ring(check(&|mesh| mesh.triangles.truncate(11))), "a hole");
        assert!(is_ring(check(&|mesh| mesh.triangles[3].swap(0, 1))), "a triangle the other way around");
        assert!(is_ring(check(&|mesh| mesh.triangles.push([0, 2, 3]))), "a triangle twice");
        let stray = check(&|mesh| {
            mesh.positions_m.push(DVec3::ONE);
            mesh.normals.push(Vec3::Z);
        });
        assert!(is_ring(stray), "a point without triangles");
        let touching = check(&|mesh| {
            let other = cube(DVec3::splat(2.0));
            // Corner 7 of one is corner 0 of the other.
            let joined = |corner: u32| if corner == 0 { 7 } else { corner + 7 };
            mesh.positions_m.extend(&other.positions_m[1..]);
            mesh.normals.extend(&other.normals[1..]);
            mesh.triangles.extend(other.triangles.iter().map(|corners| corners.map(joined)));
        });
        assert!(matches!(touching, Err(MeshError::Ring { point: 7 })), "two cubes that share a corner");
        assert!(matches!(
            check(&|mesh| mesh.triangles[0] = [0, 0, 1]),
            Err(MeshError::Corners { triangle: 0, .. })
        ));
        assert!(matches!(
            check(&|mesh| mesh.triangles[5] = [0, 8, 1]),
            Err(MeshError::Corners { triangle: 5, .. })
        ));
        assert!(matches!(check(&|mesh| mesh.positions_m[0].x = f64::NAN), Err(MeshError::NotFinite { .. })));
        assert!(matches!(
            check(&|mesh| mesh.normals.truncate(3)),
            Err(MeshError::Count { field: "normals", .. })
        ));
        assert!(matches!(check(&|mesh| mesh.colors_srgb = Some(Vec::new())), Err(MeshError::Count { .. })));
    }
}
