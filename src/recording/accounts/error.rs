//! Why users or tokens are not as asked.

use super::NoRandomness;
use crate::store::StoreError;
use std::sync::Arc;
use std::time::Duration;
use videofields_vision::error::{ErrorKind, Fault, join_faults};

/// Why users or tokens are not as asked.
#[derive(Clone, Debug, thiserror::Error)]
pub enum AccountError {
    /// No user has that name.
    #[error("there is no user {id:?}")]
    NoUser {
        /// The name asked for.
        id: String,
    },
    /// No token has that id, or it is another's.
    #[error("there is no token {id:?}")]
    NoToken {
        /// The id asked for.
        id: String,
    },
    /// What was to be changed has become another meanwhile.
    #[error("it was changed meanwhile{}", now.map(|now| format!(": its version is {now}")).unwrap_or_default())]
    Changed {
        /// Its version now, if it is there.
        now: Option<i64>,
    },
    /// Nobody could change users any more.
    #[error("the last admin who can log in must stay one: make another first")]
    LastAdmin,
    /// The database has no users any more, while the daemon knows some.
    #[error("the database has no users any more; those known hold on until the daemon starts again")]
    UsersGone,
    /// The password is not the user's, or there is no such user.
    #[error("no user has that name and password")]
    WrongPassword,
    /// The name failed too often.
    #[error("that name failed to log in too often: wait {} s", wait.as_secs_f64().ceil())]
    Throttled {
        /// For how long.
        wait: Duration,
    },
    /// There are as many as there may be.
    #[error("there are {most} {what} already")]
    TooMany {
        /// What.
        what: &'static str,
        /// Most that there may be.
        most: usize,
    },
    /// The user has as many as one may make.
    #[error(
        "you have {n_own} {what}, as many as one user may make: revoke some that are not needed any more"
    )]
    Quota {
        /// What.
        what: &'static str,
        /// Most that there may be.
        n_own: usize,
    },
    /// Members of a document are wrong.
    #[error("{}", join_faults(.0))]
    Faults(Vec<Fault>),
    /// No secret can be made.
    #[error(transparent)]
    NoRandomness(#[from] NoRandomness),
    /// The database does not do as asked.
    #[error(transparent)]
    Store(Arc<StoreError>),
    /// A fault of the daemon.
    #[error("{0}")]
    Internal(String),
}

impl AccountError {
    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::NoUser { .. } | Self::NoToken { .. } => ErrorKind::NotFound,
            Self::Faults(_) => ErrorKind::Invalid,
            Self::TooMany { .. } | Self::Quota { .. } => ErrorKind::TooLarge,
            Self::Changed { .. } => ErrorKind::Changed,
            Self::LastAdmin => ErrorKind::Conflict,
            Self::WrongPassword => ErrorKind::Unauthenticated,
            Self::Throttled { .. } => ErrorKind::Throttled,
            Self::Store(error) => error.kind(),
            Self::NoRandomness(_) | Self::UsersGone | Self::Internal(_) => ErrorKind::Internal,
        }
    }
}
