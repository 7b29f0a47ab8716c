//! From a mesh's own unit and axes into the world: metres, z up.

use glam::{DMat3, DQuat, DVec3};
use std::fmt;
use std::str::FromStr;

/// Which axis of a file is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// x.
    X,
    /// Against x.
    MinusX,
    /// y, as in glTF.
    Y,
    /// Against y, as cameras have it.
    MinusY,
    /// z, as in the world.
    Z,
    /// Against z.
    MinusZ,
}

impl Up {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::X, Self::MinusX, Self::Y, Self::MinusY, Self::Z, Self::MinusZ];

    /// Its name in manifests.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::MinusX => "-x",
            Self::Y => "y",
            Self::MinusY => "-y",
            Self::Z => "z",
            Self::MinusZ => "-z",
        }
    }

    /// The axis itself.
    #[must_use]
    pub const fn axis(self) -> DVec3 {
        match self {
            Self::X => DVec3::X,
            Self::MinusX => DVec3::NEG_X,
            Self::Y => DVec3::Y,
            Self::MinusY => DVec3::NEG_Y,
            Self::Z => DVec3::Z,
            Self::MinusZ => DVec3::NEG_Z,
        }
    }

    /// The axis that is nearest to a direction.
    #[must_use]
    pub fn nearest(direction: DVec3) -> Self {
        let along = |up: &Self| up.axis().dot(direction);
        Self::ALL.into_iter().max_by(|a, b| along(a).total_cmp(&along(b))).unwrap_or(Self::Z)
    }

    /// The turn that takes the file's axes to the world's: a quarter or half turn about one axis, or none.
    #[must_use]
    pub fn world_from_file(self) -> DQuat {
        let rows = match self {
            Self::X => [DVec3::NEG_Z, DVec3::Y, DVec3::X],
            Self::MinusX => [DVec3::Z, DVec3::Y, DVec3::NEG_X],
            // x stays east, -z becomes north.
            Self::Y => [DVec3::X, DVec3::NEG_Z, DVec3::Y],
            Self::MinusY => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
            Self::Z => return DQuat::IDENTITY,
            Self::MinusZ => [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z],
        };
        DQuat::from_mat3(&DMat3::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose()).normalize()
    }

    /// The same of a place: exact, since it only exchanges and turns round what coordinates there are.
    #[must_use]
    pub fn turned(self, at: DVec3) -> DVec3 {
        let DVec3 { x, y, z } = at;
        match self {
            Self::X => DVec3::new(-z, y, x),
            Self::MinusX => DVec3::new(z, y, -x),
            Self::Y => DVec3::new(x, -z, y),
            Self::MinusY => DVec3::new(x, z, -y),
            Self::Z => at,
            Self::MinusZ => DVec3::new(x, -y, -z),
        }
    }
}

impl fmt::Display for Up {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl FromStr for Up {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|up| up.name() == name)
            .ok_or_else(|| format!("expected one of {}, got {name:?}", names()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_is_turned_up_and_nothing_is_mirrored() {
        for up in Up::ALL {
            assert_eq!(up.turned(up.axis()), DVec3::Z, "{up}");
            let [x, y, z] = DVec3::AXES.map(|axis| up.turned(axis));
            assert_eq!(x.cross(y), z, "{up}");
            for at in [DVec3::new(1.0, 2.0, 3.0), DVec3::NEG_Y] {
                assert!((up.world_from_file() * at - up.turned(at)).length() < 1e-12, "{up}");
            }
            assert_eq!(up.name().parse(), Ok(up));
            assert_eq!(Up::nearest(up.axis() + DVec3::new(0.3, -0.2, 0.1)), up);
        }
        assert!("up".parse::<Up>().is_err());
    }
}
