//! Room that snapshots take, shared by users: nobody's push out another's.
//!
//! A user's that are not held and those that the user holds are counted apart, each by a share of what is left free
//! (`recording::share`): nothing but an admin makes held ones go. Admins may fill all, the daemon's schedules half.

use super::making::Maker;
use super::{EvidenceError, MAX_COUNT, Snapshots};
use videofields_recording::share::{Bound, GREED, Room};
use videofields_recording::store::{SnapshotOwner, SnapshotUsage};
use videofields_recording::telemetry::SnapshotRemoval;
use videofields_vision::access::{Grants, Role};

/// Times what is left free that the snapshots may take which a user holds.
const HELD_GREED: u64 = 1;

/// Refusal of a snapshot for which a user's own make no room.
const NO_ROOM: &str = "your snapshots have no room left, and those that are held or others' stay: remove some of your own, or \
                       ask an admin to remove some or to raise storage.snapshot_max_gib";

/// Refusal of a hold beyond a user's share.
const HOLDS_TAKEN: &str = "the snapshots that you hold may take no more room: ask an admin to hold this one, or to lift other holds";

/// Place of a snapshot that is to be held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coming {
    /// On its way.
    New,
    /// Among those that are kept.
    Kept,
}

/// Room of snapshots, in bytes and in number.
#[derive(Clone, Copy)]
struct Rooms([Room; 2]);

impl Rooms {
    fn of(max_bytes: u64, [kept, own, freed]: [SnapshotUsage; 3]) -> Self {
        Self([
            Room { max: max_bytes, kept: kept.n_bytes, own: own.n_bytes, freed: freed.n_bytes },
            Room { max: MAX_COUNT, kept: kept.n, own: own.n, freed: freed.n },
        ])
    }

    fn without_own(self) -> Self {
        Self(self.0.map(Room::without_own))
    }

    /// Returns true where one snapshot of `n_bytes` may come.
    fn take(self, bound: Bound, n_bytes: u64) -> bool {
        let [bytes, number] = self.0.map(|room| room.left(bound));
        bytes >= n_bytes && number >= 1
    }
}

/// Returns the user, where there is one who is no admin.
pub(super) fn limited<'a>(user: Option<&'a str>, grants: &Grants) -> Option<&'a str> {
    user.filter(|_| grants.role() < Role::Admin)
}

impl<'a> Maker<'a> {
    /// Returns the owner with whose snapshots the maker's are counted.
    fn owner(&self) -> SnapshotOwner<'a> {
        match (self.schedule, self.user) {
            (Some(_), _) => SnapshotOwner::Schedules,
            (None, Some(user)) => SnapshotOwner::User(user),
            (None, None) => SnapshotOwner::NoUser,
        }
    }

    fn bound(&self) -> Bound {
        if self.schedule.is_some() {
            return Bound::Half;
        }
        limited(self.user, self.grants).map_or(Bound::All, |_user| Bound::Free(GREED))
    }
}

impl Snapshots {
    /// Removes the oldest of the maker's own until one of `n_bytes` more may come; in the caller's turn. Where all of them would
    /// not do, none goes.
    pub(super) async fn make_room(&self, maker: Maker<'_>, n_bytes: u64) -> Result<(), EvidenceError> {
        let (owner, bound, mut freed) = (maker.owner(), maker.bound(), SnapshotUsage::default());
        loop {
            let usages = [self.usage().await?, self.store.free_snapshots_of(owner).await?, freed];
            let rooms = Rooms::of(self.settings.max_bytes, usages);
            if rooms.take(bound, n_bytes) {
                return Ok(());
            }
            if !rooms.without_own().take(bound, n_bytes) {
                return Err(EvidenceError::Full(NO_ROOM));
            }
            let oldest = self.store.oldest_free_snapshot_of(owner).await?;
            let oldest = oldest.ok_or(EvidenceError::Full(NO_ROOM))?;
            self.remove_one(&oldest, None, maker.user, SnapshotRemoval::Bytes).await?;
            freed.n += 1;
            freed.n_bytes = freed.n_bytes.saturating_add(oldest.n_bytes.unsigned_abs());
        }
    }

    /// Refuses to let a limited user hold one of `n_bytes` more where that user's share is full; in the caller's turn.
    pub(super) async fn check_held(
        &self,
        user: &str,
        (coming, n_bytes): (Coming, u64),
    ) -> Result<(), EvidenceError> {
        let (mut kept, held) = (self.usage().await?, self.store.snapshots_held_by(user).await?);
        if coming == Coming::Kept {
            kept.n = kept.n.saturating_sub(1);
            kept.n_bytes = kept.n_bytes.saturating_sub(n_bytes);
        }
        let rooms = Rooms::of(self.settings.max_bytes, [kept, held, SnapshotUsage::default()]);
        let has_room = rooms.take(Bound::Free(HELD_GREED), n_bytes);
        has_room.then_some(()).ok_or(EvidenceError::Full(HOLDS_TAKEN))
    }

    async fn usage(&self) -> Result<SnapshotUsage, EvidenceError> {
        let (n, n_bytes) = self.store.snapshot_totals().await?;
        Ok(SnapshotUsage { n: n.unsigned_abs(), n_bytes: n_bytes.unsigned_abs() })
    }
}
