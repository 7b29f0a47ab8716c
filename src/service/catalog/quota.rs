//! Room for what users keep: so many views, walls and playheads each, and some for admins that no user takes.
//!
//! A quota is fixed, so that no user learns from it how many there are that are hidden. Whoever made a document has it counted, whoever
//! changes it later.

use super::{Catalog, CatalogError, State};
use crate::engine::MAX_PLAYHEADS;
use std::collections::BTreeMap;
use std::sync::PoisonError;
use videofields_recording::store::{DocumentKind, DocumentRecord, Store, StoreError};
use videofields_vision::access::Role;

/// Most documents of a kind that is for admins alone to make; of scenes, those of the configuration count too.
pub const MAX_DOCUMENTS: usize = 256;

/// Versions of a document that are looked through for who made it: as many as are kept.
const VERSIONS: u32 = 200;

/// Whoever changes what is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Changer {
    /// The user; none where there are no users.
    pub user: Option<String>,
    /// The user's role.
    pub role: Role,
}

impl Changer {
    /// Returns the daemon itself, or whoever may do everything.
    #[must_use]
    pub const fn anybody() -> Self {
        Self { user: None, role: Role::Admin }
    }
}

/// The room of a kind of documents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Room {
    /// Documents that one user may have made.
    of_user: usize,
    /// Documents of all, as far as users make them.
    of_all: usize,
    /// Documents that admins may make beyond that.
    of_admins: usize,
}

/// Returns the room of a kind; none of what admins alone make.
const fn room_of(kind: DocumentKind) -> Option<Room> {
    match kind {
        DocumentKind::View | DocumentKind::Wall => Some(Room { of_user: 64, of_all: 1024, of_admins: 256 }),
        DocumentKind::Playhead => Some(Room { of_user: 16, of_all: MAX_PLAYHEADS - 64, of_admins: 64 }),
        DocumentKind::Scene | DocumentKind::Camera => None,
    }
}

/// Users who made documents that are there, as far as it is known.
pub(super) type Makers = BTreeMap<(DocumentKind, String), Option<String>>;

/// Returns who made the documents that are there.
///
/// # Errors
/// When the database fails.
pub(super) async fn makers<'a>(
    store: &Store,
    newest: impl Iterator<Item = (DocumentKind, &'a DocumentRecord)>,
) -> Result<Makers, StoreError> {
    let mut makers = Makers::new();
    for (kind, record) in
        newest.filter(|(kind, record)| record.document.is_some() && room_of(*kind).is_some())
    {
        // The newest first, until it was not there: what was made anew is of who did that.
        let changes = store.document_changes(kind, &record.id, i64::MAX, VERSIONS).await?;
        let first = changes.into_iter().take_while(|(_, _, _, was_removed)| !was_removed).last();
        makers.insert((kind, record.id.clone()), first.and_then(|(_, _, by, _)| by));
    }
    Ok(makers)
}

impl Catalog {
    /// Refuses one more document of a kind to who has made as many as may be.
    ///
    /// # Errors
    /// [`CatalogError::Quota`], [`CatalogError::TooMany`].
    pub(super) fn check_room(&self, kind: DocumentKind, by: &Changer) -> Result<(), CatalogError> {
        let Some(room) = room_of(kind) else { return Ok(()) };
        let is_admin = by.role == Role::Admin;
        let makers = self.makers.read().unwrap_or_else(PoisonError::into_inner);
        let of_kind = makers.iter().filter(|((of, _), _)| *of == kind);
        if !is_admin && of_kind.clone().filter(|(_, maker)| **maker == by.user).count() >= room.of_user {
            return Err(CatalogError::Quota { kind, most: room.of_user });
        }
        let most = room.of_all + if is_admin { room.of_admins } else { 0 };
        if of_kind.count() >= most { Err(CatalogError::TooMany { kind, most }) } else { Ok(()) }
    }

    /// Returns how many documents of a kind there may be, whoever makes them.
    pub(super) const fn most(kind: DocumentKind) -> usize {
        match room_of(kind) {
            Some(room) => room.of_all + room.of_admins,
            None => MAX_DOCUMENTS,
        }
    }

    /// Notes who made a document, or that it is gone; `before` is how it stood.
    pub(super) fn note_maker(&self, kind: DocumentKind, record: &DocumentRecord, before: State) {
        let mut makers = self.makers.write().unwrap_or_else(PoisonError::into_inner);
        let key = (kind, record.id.clone());
        if record.document.is_none() {
            makers.remove(&key);
        } else if !before.is_there && room_of(kind).is_some() {
            makers.insert(key, record.changed_by.clone());
        }
    }
}
