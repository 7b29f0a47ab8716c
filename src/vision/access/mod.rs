//! Who may see what: roles, and rights camera by camera.
//!
//! Plain values without I/O. In: what a user was granted. Out: [`Grants`], which say yes or no, and the [`Scope`] of
//! cameras that a question may be answered from. Whoever answers for cameras asks these and nothing else. And the [`Share`] of one
//! caller of what there is little of.

mod scope;
mod share;

pub use scope::Scope;
pub use share::{Full, Share};

use crate::frame::CameraId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// What a user may do beside seeing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Reads what it has rights to.
    Viewer,
    /// And moves playheads, asks for exports, and changes the cameras that it may manage.
    Operator,
    /// Everything, of all cameras; users and tokens too.
    Admin,
}

impl Role {
    /// All of them, the least first.
    pub const ALL: [Self; 3] = [Self::Viewer, Self::Operator, Self::Admin];

    /// Its name, as in JSON.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Admin => "admin",
        }
    }
}

/// What may be seen or changed of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Right {
    /// What it sees now.
    Live,
    /// What it saw at any time.
    History,
    /// Clips of what was recorded.
    Export,
    /// Its settings.
    Manage,
}

impl Right {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Live, Self::History, Self::Export, Self::Manage];

    /// Its name, as in JSON.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Live => "live",
            Self::History => "history",
            Self::Export => "export",
            Self::Manage => "manage",
        }
    }

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

impl fmt::Display for Right {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.as_str())
    }
}

/// A set of rights; in JSON a list of their names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(from = "Vec<Right>", into = "Vec<Right>")]
pub struct Rights(u8);

impl Rights {
    /// All there are.
    pub const ALL: Self = Self(0b1111);

    /// Whether `right` is among them.
    #[must_use]
    pub const fn has(self, right: Right) -> bool {
        self.0 & right.bit() != 0
    }

    /// Whether there is none.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl From<Vec<Right>> for Rights {
    fn from(rights: Vec<Right>) -> Self {
        Self(rights.into_iter().fold(0, |bits, right| bits | right.bit()))
    }
}

impl From<Rights> for Vec<Right> {
    fn from(rights: Rights) -> Self {
        Right::ALL.into_iter().filter(|right| rights.has(*right)).collect()
    }
}

/// What one caller may do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Grants {
    role: Role,
    /// Of every camera, also of those that come later.
    everywhere: Rights,
    /// Of single cameras, beside that.
    cameras: BTreeMap<CameraId, Rights>,
}

impl Grants {
    /// Rights `everywhere` and, beside them, those of single `cameras`. An admin has all of them whatever is named.
    #[must_use]
    pub fn new(role: Role, everywhere: Rights, cameras: BTreeMap<CameraId, Rights>) -> Self {
        let everywhere = if role == Role::Admin { Rights::ALL } else { everywhere };
        Self { role, everywhere, cameras }
    }

    /// Everything: who may do this needs no door of their own.
    #[must_use]
    pub fn everything() -> Self {
        Self::new(Role::Admin, Rights::ALL, BTreeMap::new())
    }

    /// Nothing: who is not known.
    #[must_use]
    pub fn nothing() -> Self {
        Self::new(Role::Viewer, Rights::default(), BTreeMap::new())
    }

    /// What the caller may do beside seeing.
    #[must_use]
    pub const fn role(&self) -> Role {
        self.role
    }

    /// Whether no question would be answered otherwise than to an admin.
    #[must_use]
    pub fn is_everything(&self) -> bool {
        self.role == Role::Admin
    }

    /// Whether the caller has `right` of every camera, also of those that come later.
    #[must_use]
    pub const fn has_everywhere(&self, right: Right) -> bool {
        self.everywhere.has(right)
    }

    /// Whether the caller has `right` of a camera, whether that exists or not.
    #[must_use]
    pub fn has(&self, camera: &str, right: Right) -> bool {
        self.everywhere.has(right) || self.of(camera).has(right)
    }

    /// Whether the caller may know of a camera: who may see nothing of it does not learn that it is there.
    #[must_use]
    pub fn knows(&self, camera: &str) -> bool {
        self.knows_all() || !self.of(camera).is_empty()
    }

    /// Returns whether the caller may know of every camera, also of those that come later.
    #[must_use]
    pub const fn knows_all(&self) -> bool {
        !self.everywhere.is_empty()
    }

    /// Those of `cameras` that `is_allowed`; all there ever are, for an admin alone: a camera may come that the caller may not
    /// see.
    pub fn scope<'a>(
        &self,
        cameras: impl Iterator<Item = &'a CameraId>,
        is_allowed: impl Fn(&CameraId) -> bool,
    ) -> Scope {
        if self.is_everything() {
            Scope::all()
        } else {
            Scope::of(cameras.filter(|id| is_allowed(id)).cloned())
        }
    }

    fn of(&self, camera: &str) -> Rights {
        // Few cameras are named one by one.
        let own = self.cameras.iter().find(|(id, _)| id.as_str() == camera);
        own.map_or(Rights::default(), |(_, rights)| *rights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(text: &str) -> CameraId {
        CameraId::new(text).unwrap()
    }

    #[test]
    fn rights_are_lists_of_names() {
        let rights: Rights = serde_json::from_str(r#"["export", "live", "live"]"#).unwrap();
        assert_eq!(serde_json::to_string(&rights).unwrap(), r#"["live","export"]"#);
        assert!(rights.has(Right::Live) && rights.has(Right::Export));
        assert!(!rights.has(Right::History) && !rights.has(Right::Manage));
        assert!(serde_json::from_str::<Rights>(r#"["see"]"#).is_err());
        assert_eq!(Rights::from(Right::ALL.to_vec()), Rights::ALL);
    }

    #[test]
    fn rights_everywhere_and_of_one_camera_add_up() {
        let live = Rights::from(vec![Right::Live]);
        let own = BTreeMap::from([(id("a"), Rights::from(vec![Right::History]))]);
        let grants = Grants::new(Role::Viewer, live, own.clone());
        assert!(grants.has("a", Right::Live) && grants.has("a", Right::History));
        assert!(grants.has("b", Right::Live) && !grants.has("b", Right::History));
        assert!(!grants.is_everything() && grants.knows("b") && grants.knows_all());
        let grants = Grants::new(Role::Operator, Rights::default(), own);
        assert!(
            !grants.knows("b") && grants.knows("a") && !grants.has("a", Right::Live) && !grants.knows_all()
        );
        let admin = Grants::new(Role::Admin, Rights::default(), BTreeMap::new());
        assert!(admin.is_everything() && admin.has("any", Right::Manage));
        assert!(!Grants::nothing().knows("a"));
    }

    #[test]
    fn a_scope_of_all_cameras_is_not_that_of_those_to_come() {
        let cameras = [id("a"), id("b")];
        let grants = Grants::nothing();
        let both = grants.scope(cameras.iter(), |_| true);
        assert!(both.allows(&cameras[0]) && both.allows(&cameras[1]) && !both.allows(&id("later")));
        assert_eq!(Grants::everything().scope(cameras.iter(), |_| true), Scope::all());
        let one = grants.scope(cameras.iter(), |camera| camera.as_str() == "b");
        assert!(one.allows(&cameras[1]) && !one.allows(&cameras[0]));
    }
}
