//! Room that snapshots take, by whose they are.

use super::{COLUMNS, SnapshotRecord};
use crate::store::{Store, StoreError};

/// Owner whose snapshots are counted together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SnapshotOwner<'a> {
    /// The user who asked for them.
    User(&'a str),
    /// Whoever asked while there were no users.
    NoUser,
    /// The daemon, by its schedules.
    Schedules,
}

/// Number and bytes of snapshots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SnapshotUsage {
    /// Snapshots.
    pub n: u64,
    /// Bytes of all their files.
    pub n_bytes: u64,
}

impl<'a> SnapshotOwner<'a> {
    /// Returns the columns `made_by` and, as a number, whether there is a schedule.
    const fn columns(self) -> (Option<&'a str>, i64) {
        match self {
            Self::User(user) => (Some(user), 0),
            Self::NoUser => (None, 0),
            Self::Schedules => (None, 1),
        }
    }
}

/// Snapshots of an owner, `made_by` and, as a number, whether there is a schedule: of a user those alone that were made since there is
/// the account, and none of who had that name before.
const OWN: &str = "removed_at is null and made_by is ?1 and (schedule is not null) = ?2
    and made_at >= coalesce((select created_at from user where user.id = ?1), made_at)";

impl Store {
    /// Returns the room of an owner's snapshots that are not held.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn free_snapshots_of(&self, owner: SnapshotOwner<'_>) -> Result<SnapshotUsage, StoreError> {
        let (made_by, is_schedule) = owner.columns();
        let sql = format!("select count(*), coalesce(sum(bytes), 0) from snapshot where {OWN} and hold = 0");
        let counted = sqlx::query_as(sqlx::AssertSqlSafe(sql))
            .bind(made_by)
            .bind(is_schedule)
            .fetch_one(&self.cache)
            .await;
        counted.map(usage).map_err(|error| self.classify(error))
    }

    /// Returns whether a snapshot is an owner's.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn is_snapshot_of(&self, number: i64, owner: SnapshotOwner<'_>) -> Result<bool, StoreError> {
        let (made_by, is_schedule) = owner.columns();
        let sql = format!("select count(*) from snapshot where {OWN} and number = ?3");
        let counted = sqlx::query_scalar(sqlx::AssertSqlSafe(sql))
            .bind(made_by)
            .bind(is_schedule)
            .bind(number)
            .fetch_one(&self.cache)
            .await;
        counted.map(|n: i64| n > 0).map_err(|error| self.classify(error))
    }

    /// Returns how many versions of what is said of a snapshot are a user's.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn said_of_snapshot_by(&self, number: i64, user: &str) -> Result<u64, StoreError> {
        let counted =
            sqlx::query_scalar("select count(*) from snapshot_annotation where number = ? and by = ?")
                .bind(number)
                .bind(user)
                .fetch_one(&self.cache)
                .await;
        counted.map(i64::unsigned_abs).map_err(|error| self.classify(error))
    }

    /// Returns the room of the snapshots that a user holds, whoever made them; none that another of that name held before.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn snapshots_held_by(&self, user: &str) -> Result<SnapshotUsage, StoreError> {
        let counted = sqlx::query_as(
            "select count(*), coalesce(sum(bytes), 0) from snapshot
             where removed_at is null and hold = 1 and held_by = ?1 and exists (
                 select 1 from snapshot_annotation as said where said.number = snapshot.number and said.by = ?1 and said.hold = 1
                 and said.at >= coalesce((select created_at from user where user.id = ?1), said.at))",
        )
        .bind(user)
        .fetch_one(&self.cache)
        .await;
        counted.map(usage).map_err(|error| self.classify(error))
    }

    /// Returns an owner's snapshot that may go first: the oldest that is not held.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn oldest_free_snapshot_of(
        &self,
        owner: SnapshotOwner<'_>,
    ) -> Result<Option<SnapshotRecord>, StoreError> {
        let sql =
            format!("{COLUMNS} where {OWN} and snapshot.hold = 0 order by made_at, snapshot.number limit 1");
        let (made_by, is_schedule) = owner.columns();
        let row = sqlx::query(sqlx::AssertSqlSafe(sql))
            .bind(made_by)
            .bind(is_schedule)
            .fetch_optional(&self.cache)
            .await;
        row.map_err(|error| self.classify(error))?.map(|row| self.snapshot_of(&row)).transpose()
    }
}

fn usage((n, n_bytes): (i64, i64)) -> SnapshotUsage {
    SnapshotUsage { n: n.unsigned_abs(), n_bytes: n_bytes.unsigned_abs() }
}
