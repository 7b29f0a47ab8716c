//! Names that callers give to what they make, so that nobody learns by trying which names are given to what is hidden.
//!
//! A user who does not know of every camera gives names with an ending of its own, which nobody else gives, and no name that what is
//! hidden had before. Any other name of what the user does not see is refused in the same words, whether something has it or not.

use super::Api;
use super::error::Problem;
use sha2::{Digest, Sha256};
use videofields_recording::store::DocumentKind;
use videofields_vision::error::ErrorKind;

/// Characters of an ending, without those that are read as others.
const LETTERS: &[u8; 32] = b"abcdefghijkmnpqrstuvwxyz23456789";

/// Letters of an ending: 40 bits, so that no two users have the same.
const N_LETTERS: usize = 8;

impl Api {
    /// Returns whether something may be hidden from the caller.
    pub(super) fn is_restricted(&self) -> bool {
        !self.identity.caller.grants.knows_all()
    }

    /// Returns the ending of names that the caller gives; none for who may give any.
    pub(super) fn name_ending(&self) -> Option<String> {
        let user = self.identity.caller.user.as_deref().filter(|_| self.is_restricted())?;
        let made = self.accounts.as_ref()?.user(user).ok()?.created_at;
        Some(ending(user, &made))
    }

    /// Refuses a name that the caller may not give. `id` names nothing that the caller sees.
    ///
    /// # Errors
    /// When the caller does not know of every camera, and the name has not its ending or was somebody else's.
    pub(super) fn check_name(&self, kind: DocumentKind, id: &str) -> Result<(), Problem> {
        if !self.is_restricted() {
            return Ok(());
        }
        let ending = self.name_ending().unwrap_or_default();
        let user = self.identity.caller.user.as_deref();
        let is_own =
            id.strip_suffix(ending.as_str()).is_some_and(|stem| !ending.is_empty() && !stem.is_empty());
        // What it made itself and took away again it may make again.
        let is_free = || match &self.catalog {
            Some(catalog) => {
                !catalog.state(kind, id).is_there
                    && catalog.last_changed_by(kind, id).is_none_or(|by| by.as_deref() == user)
            }
            None => true,
        };
        if is_own && is_free() {
            return Ok(());
        }
        let detail = format!(
            "the name {id} is not yours to give: who does not see every camera gives new names that end with \
             {ending} and were nobody else's"
        );
        Err(Problem::new(ErrorKind::Forbidden, detail))
    }
}

/// Returns the ending of the names that a user gives, who was made at that time: others know that time of no user, and so whose
/// ending it is of none.
fn ending(user: &str, made: &str) -> String {
    let digest = Sha256::new().chain_update(user).chain_update([0]).chain_update(made).finalize();
    let letters = digest.iter().take(N_LETTERS).map(|byte| char::from(LETTERS[usize::from(byte % 32)]));
    std::iter::once('-').chain(letters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::is_id;

    #[test]
    fn endings_are_of_one_user_and_of_its_making() {
        let own = ending("guard", "2026-11-29T08:00:00Z");
        assert_eq!(own.len(), 1 + N_LETTERS);
        assert!(is_id(&format!("gate{own}")), "{own}");
        assert_eq!(own, ending("guard", "2026-11-29T08:00:00Z"));
        assert_ne!(own, ending("guard", "2026-11-29T08:00:01Z"));
        assert_ne!(own, ending("guarD", "2026-11-29T08:00:00Z"));
        assert_ne!(ending("a", "bc"), ending("ab", "c"), "name and time are told apart");
    }
}
