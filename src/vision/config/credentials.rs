//! Sections `[[credentials]]`: logins by a name that cameras, and whoever sets them up, may use without knowing them.

use super::network::Network;
use super::source::check_login;
use super::validate::{Ids, check_path};
use crate::error::Gatherer;
use crate::frame::is_id;
use serde::Deserialize;
use std::path::PathBuf;

/// Most credentials of one configuration.
pub(super) const MAX_CREDENTIALS: usize = 64;

/// Most blocks of addresses to which one login may go.
const MAX_NETWORKS: usize = 64;

/// A login by name.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CredentialsSettings {
    /// Id: 1 to 64 of a-z, 0-9, - and _; unique.
    pub id: String,
    /// The user, at most 200 characters.
    pub user: String,
    /// A file whose first line is the user's password, read at each connecting.
    #[serde(default)]
    pub password_file: Option<PathBuf>,
    /// The environment variable that holds the user's password.
    #[serde(default)]
    pub password_env: Option<String>,
    /// Blocks of addresses that may be told the login, 1 to 64: an administrator may have it sent to any camera there.
    pub networks: Vec<Network>,
}

/// Checks the login at `place`.
pub(super) fn check(of: &CredentialsSettings, place: &str, ids: &mut Ids, gatherer: &mut Gatherer) {
    let at = |key: &str| format!("{place}/{key}");
    if !is_id(&of.id) {
        gatherer.fault(at("id"), format!("invalid id {:?}: {}", of.id, crate::frame::IdError));
    } else if !ids.credentials.insert(of.id.clone()) {
        gatherer.fault(at("id"), format!("there are other credentials `{}`; ids are unique", of.id));
    }
    if let Some(path) = &of.password_file {
        check_path(path, &at("password_file"), gatherer);
    }
    let password = (of.password_file.is_some(), of.password_env.as_ref());
    check_login(Some(&of.user), password, place, gatherer);
    let n_networks = of.networks.len();
    if !(1..=MAX_NETWORKS).contains(&n_networks) {
        let message = format!(
            "expected 1 to {MAX_NETWORKS} blocks of addresses that may be told the login, such as 192.168.1.0/24, got {n_networks}"
        );
        gatherer.fault(at("networks"), message);
    }
}
