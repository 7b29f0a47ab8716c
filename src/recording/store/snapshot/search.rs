//! Snapshots that a caller may know of, by what they show and what was said of them.

use super::{COLUMNS, SnapshotRecord};
use crate::store::{Store, StoreError};
use videofields_vision::clock::Timestamp;

/// What is looked for. What is none is not asked about.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SnapshotSearch {
    /// Cameras of which the caller may have exports; a snapshot with any other is not there. None: of all.
    pub may_export: Option<Vec<String>>,
    /// Cameras of which the caller may look back; a snapshot with any other is not there unless `user` made it, and not another who had that name before. None: of all.
    pub may_look_back: Option<Vec<String>>,
    /// The caller.
    pub user: Option<String>,
    /// One snapshot alone.
    pub id: Option<String>,
    /// Earliest scene time shown.
    pub from: Option<Timestamp>,
    /// Scene time before which it lies.
    pub to: Option<Timestamp>,
    /// The scene.
    pub scene: Option<String>,
    /// A camera in it, or the camera that it shows.
    pub camera: Option<String>,
    /// Who asked for it.
    pub made_by: Option<String>,
    /// A part of its note or of one of its tags, whatever the case of ASCII letters.
    pub text: Option<String>,
    /// Those behind this one in the order of the answer: when it was made, and its id.
    pub before: Option<(Timestamp, String)>,
    /// Most of one answer.
    pub limit: u32,
}

/// Each `?` below, in this order.
const WHERE: &str = "where removed_at is null
    and (?1 is null or not exists (select 1 from snapshot_camera as held where held.number = snapshot.number
        and held.camera not in (select value from json_each(?1))))
    and (?2 is null or (?3 is not null and made_by = ?3
            and made_at >= coalesce((select created_at from user where user.id = ?3), made_at)) or not exists (
        select 1 from snapshot_camera as held where held.number = snapshot.number
        and held.camera not in (select value from json_each(?2))))
    and (?4 is null or id = ?4)
    and (?5 is null or shown_at >= ?5)
    and (?6 is null or shown_at < ?6)
    and (?7 is null or (kind = 'scene' and subject = ?7))
    and (?8 is null or exists (select 1 from snapshot_camera as held where held.number = snapshot.number
        and held.camera = ?8))
    and (?9 is null or made_by = ?9)
    and (?10 is null or instr(lower(snapshot.note), lower(?10)) > 0 or exists (
        select 1 from json_each(snapshot.tags) where instr(lower(value), lower(?10)) > 0))
    and (?11 is null or (made_at, id) < (?11, ?12))
    order by made_at desc, id desc limit ?13";

impl Store {
    /// The cameras that any snapshot has.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn snapshot_cameras(&self) -> Result<Vec<String>, StoreError> {
        sqlx::query_scalar("select distinct camera from snapshot_camera order by camera")
            .fetch_all(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The snapshots that are looked for, the one that was made last first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn find_snapshots(&self, search: &SnapshotSearch) -> Result<Vec<SnapshotRecord>, StoreError> {
        let list =
            |cameras: &Option<Vec<String>>| cameras.as_ref().map(|ids| serde_json::json!(ids).to_string());
        let nanos = |at: Option<Timestamp>| at.map(Timestamp::as_nanos);
        let rows = sqlx::query(sqlx::AssertSqlSafe(format!("{COLUMNS} {WHERE}")))
            .bind(list(&search.may_export))
            .bind(list(&search.may_look_back))
            .bind(&search.user)
            .bind(&search.id)
            .bind(nanos(search.from))
            .bind(nanos(search.to))
            .bind(&search.scene)
            .bind(&search.camera)
            .bind(&search.made_by)
            .bind(&search.text)
            .bind(search.before.as_ref().map(|(at, _)| at.as_nanos()))
            .bind(search.before.as_ref().map(|(_, id)| id))
            .bind(search.limit)
            .fetch_all(&self.cache)
            .await
            .map_err(|error| self.classify(error))?;
        rows.iter().map(|row| self.snapshot_of(row)).collect()
    }
}
