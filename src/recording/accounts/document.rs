//! Users and tokens as they are asked for and answered, in JSON; and as they are looked up.

use super::{AccountError, Caller};
use crate::store::{TokenRecord, UserRecord};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;
use videofields_vision::access::{Grants, Rights, Role};
use videofields_vision::error::{Fault, Gatherer, pointer_to};
use videofields_vision::frame::CameraId;

/// The name under which rights of all cameras stand, also of those that come later.
const ALL_CAMERAS: &str = "*";

/// Most cameras that are named one by one.
const MAX_CAMERAS: usize = 1024;

/// Characters of a password.
const PASSWORD_CHARS: RangeInclusive<usize> = 12..=256;

/// What a user is to be.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UserChange {
    /// What the user may do beside seeing.
    pub role: Role,
    /// Rights by camera; `*` is all of them.
    #[serde(default)]
    pub cameras: BTreeMap<String, Rights>,
    /// The password, 12 to 256 characters; as it was if absent.
    #[serde(default)]
    pub password: Option<String>,
}

impl UserChange {
    /// Reads a document.
    ///
    /// # Errors
    /// [`AccountError::Faults`] with every fault, each at its JSON pointer.
    pub fn read(body: Value) -> Result<Self, AccountError> {
        // serde would take a list for an object's members in their order.
        if !body.is_object() {
            return Err(AccountError::Faults(vec![Fault::new("", "expected an object")]));
        }
        let mut gatherer = Gatherer::default();
        let change = gatherer.read::<Self>(body, "");
        if let Some(change) = &change {
            change.gather(&mut gatherer);
        }
        let faults = gatherer.into_faults();
        change.filter(|_| faults.is_empty()).ok_or(AccountError::Faults(faults))
    }

    /// Whether all that is named is allowed.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn check(&self) -> Result<(), AccountError> {
        let mut gatherer = Gatherer::default();
        self.gather(&mut gatherer);
        let faults = gatherer.into_faults();
        if faults.is_empty() { Ok(()) } else { Err(AccountError::Faults(faults)) }
    }

    fn gather(&self, gatherer: &mut Gatherer) {
        if self.cameras.len() > MAX_CAMERAS {
            gatherer.fault("/cameras", format!("at most {MAX_CAMERAS} cameras"));
        }
        for camera in self.cameras.keys().filter(|camera| *camera != ALL_CAMERAS) {
            if let Err(error) = CameraId::new(camera) {
                gatherer
                    .fault(pointer_to("/cameras", camera), format!("neither `*` nor a camera's id: {error}"));
            }
        }
        if let Some(password) = &self.password
            && !PASSWORD_CHARS.contains(&password.chars().count())
        {
            let (least, most) = (PASSWORD_CHARS.start(), PASSWORD_CHARS.end());
            gatherer.fault("/password", format!("expected {least} to {most} characters"));
        }
    }

    /// The rights as they are kept.
    pub(super) fn rights_text(&self) -> String {
        serde_json::to_string(&self.cameras).expect("names and words are JSON")
    }
}

/// A user as others are told of it: without the password.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct UserSummary {
    /// Its name.
    pub id: String,
    /// What it may do beside seeing.
    pub role: Role,
    /// Rights by camera.
    pub cameras: BTreeMap<String, Rights>,
    /// Whether it can log in with a password.
    pub has_password: bool,
    /// 1 at first, and one more with every change.
    pub version: i64,
    /// When it was made, RFC 3339.
    pub created_at: String,
    /// When it was changed last, RFC 3339.
    pub updated_at: String,
}

/// A token without its secret.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TokenSummary {
    /// Its public part.
    pub id: String,
    /// Whose it is.
    pub user: String,
    /// What it is for.
    pub note: String,
    /// When it was made, RFC 3339.
    pub created_at: String,
    /// From when on it is not taken any more, RFC 3339.
    pub expires_at: Option<String>,
}

impl From<&TokenRecord> for TokenSummary {
    fn from(record: &TokenRecord) -> Self {
        Self {
            id: record.id.clone(),
            user: record.user.clone(),
            note: record.note.clone(),
            created_at: record.created_at.to_string(),
            expires_at: record.expires_at.map(|at| at.to_string()),
        }
    }
}

/// A user, read once.
#[derive(Debug)]
pub(super) struct User {
    pub(super) record: UserRecord,
    pub(super) role: Role,
    cameras: BTreeMap<String, Rights>,
    grants: Arc<Grants>,
}

impl User {
    /// What `record` says.
    pub(super) fn read(record: UserRecord) -> Result<Self, AccountError> {
        let odd =
            |what: String| AccountError::Internal(format!("user {:?} cannot be read: {what}", record.id));
        let role = Role::ALL.into_iter().find(|role| role.as_str() == record.role);
        let role = role.ok_or_else(|| odd(format!("role {:?}", record.role)))?;
        let cameras: BTreeMap<String, Rights> =
            serde_json::from_str(&record.rights).map_err(|error| odd(error.to_string()))?;
        let everywhere = cameras.get(ALL_CAMERAS).copied().unwrap_or_default();
        let single = cameras.iter().filter(|(camera, _)| *camera != ALL_CAMERAS);
        let single: Result<BTreeMap<CameraId, Rights>, AccountError> = single
            .map(|(camera, rights)| {
                Ok((CameraId::new(camera).map_err(|error| odd(error.to_string()))?, *rights))
            })
            .collect();
        let grants = Arc::new(Grants::new(role, everywhere, single?));
        Ok(Self { record, role, cameras, grants })
    }

    pub(super) fn summary(&self) -> UserSummary {
        UserSummary {
            id: self.record.id.clone(),
            role: self.role,
            cameras: self.cameras.clone(),
            has_password: self.record.password.is_some(),
            version: self.record.version,
            created_at: self.record.created_at.to_string(),
            updated_at: self.record.updated_at.to_string(),
        }
    }

    pub(super) fn caller(&self, csrf_token: Option<String>) -> Caller {
        let (user, grants) = (Some(self.record.id.clone()), Arc::clone(&self.grants));
        Caller { user, grants, csrf_token, since: self.record.updated_at }
    }
}
