//! Tables `snapshot`, `snapshot_camera` and `snapshot_annotation`: the index of snapshots, the chain of their records, and what
//! was said of them. Cannot be rebuilt whole, so a write is on disk when it is acknowledged.

mod search;
mod usage;

pub use search::SnapshotSearch;
pub use usage::{SnapshotOwner, SnapshotUsage};

use super::{Store, StoreError};
use crate::telemetry::SnapshotRemoval;
use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;
use videofields_vision::clock::Timestamp;

/// What was said of a snapshot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotAnnotation {
    /// 1 when it was made, and one more with every change.
    pub version: i64,
    /// When, by the machine's clock.
    pub at: Timestamp,
    /// By whom; none where there are no users, or for the daemon's own.
    pub by: Option<String>,
    /// A text for people.
    pub note: String,
    /// Words to find it by: a JSON list of texts.
    pub tags: String,
    /// Whether it stays, however old.
    pub hold: bool,
    /// True where its author asked to lift the hold, which another admin is to confirm.
    pub asks_lift: bool,
}

/// A request to lift a hold, which another admin is to confirm.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LiftRequest {
    /// The admin who asked.
    pub by: String,
    /// Instant at which it ends by itself, by the machine's clock.
    pub until: Timestamp,
}

/// A snapshot as the index has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotRecord {
    /// 1, 2, 3, ... in the order in which they were sealed.
    pub number: i64,
    /// Random, 32 hexadecimal digits.
    pub id: String,
    /// When it was made, by the machine's clock.
    pub made_at: Timestamp,
    /// Scene time that it shows.
    pub shown_at: Timestamp,
    /// `scene` or `camera`.
    pub kind: String,
    /// The scene's or camera's id.
    pub subject: String,
    /// The user who asked.
    pub made_by: Option<String>,
    /// The schedule that made it.
    pub schedule: Option<String>,
    /// Of all its files; 0 once it was removed.
    pub n_bytes: i64,
    /// SHA-256 of its record.
    pub digest: [u8; 32],
    /// SHA-256 of the record before; zeros for the first.
    pub previous: [u8; 32],
    /// What hides that in the record.
    pub salt: [u8; 32],
    /// What is said of it now.
    pub annotation: SnapshotAnnotation,
    /// The user who holds it; none where nothing holds it, or where there were no users.
    pub held_by: Option<String>,
    /// The newest request to lift its hold, however old.
    pub lift: Option<LiftRequest>,
    /// The cameras in it, in the order of their ids.
    pub cameras: Vec<String>,
    /// When it was removed.
    pub removed_at: Option<Timestamp>,
}

/// All columns, the cameras as a JSON list, and the newest annotation's time and author.
const COLUMNS: &str = "select snapshot.number, id, made_at, shown_at, kind, subject, made_by, schedule, bytes, digest, \
     previous, salt, snapshot.version, snapshot.note, snapshot.tags, snapshot.hold, held_by, lift_asked_by, lift_until, \
     removed_at, coalesce(annotation.at, made_at) as annotated_at, annotation.by as annotated_by, \
     coalesce(annotation.asks_lift, 0) as asks_lift, \
     (select json_group_array(camera) from (select camera from snapshot_camera where number = snapshot.number \
      order by camera)) as cameras \
     from snapshot left join snapshot_annotation as annotation \
     on annotation.number = snapshot.number and annotation.version = snapshot.version";

impl Store {
    fn snapshot_of(&self, row: &SqliteRow) -> Result<SnapshotRecord, StoreError> {
        let odd = |what| move || StoreError::UnreadableRow { path: self.path.clone(), what };
        let read = |error| self.classify(error);
        let digest = |name: &str, what| {
            let bytes: Vec<u8> = row.try_get(name).map_err(read)?;
            <[u8; 32]>::try_from(bytes).map_err(|_wrong_length| odd(what)())
        };
        let instant = |name: &str| row.try_get::<i64, _>(name).map(Timestamp::from_nanos).map_err(read);
        let cameras: String = row.try_get("cameras").map_err(read)?;
        let cameras = serde_json::from_str(&cameras);
        let removed_at: Option<i64> = row.try_get("removed_at").map_err(read)?;
        let lift_asked_by: Option<String> = row.try_get("lift_asked_by").map_err(read)?;
        let lift_until: Option<i64> = row.try_get("lift_until").map_err(read)?;
        let lift = lift_asked_by.zip(lift_until);
        Ok(SnapshotRecord {
            number: row.try_get("number").map_err(read)?,
            id: row.try_get("id").map_err(read)?,
            made_at: instant("made_at")?,
            shown_at: instant("shown_at")?,
            kind: row.try_get("kind").map_err(read)?,
            subject: row.try_get("subject").map_err(read)?,
            made_by: row.try_get("made_by").map_err(read)?,
            schedule: row.try_get("schedule").map_err(read)?,
            n_bytes: row.try_get("bytes").map_err(read)?,
            digest: digest("digest", "snapshot.digest")?,
            previous: digest("previous", "snapshot.previous")?,
            salt: digest("salt", "snapshot.salt")?,
            annotation: SnapshotAnnotation {
                version: row.try_get("version").map_err(read)?,
                at: instant("annotated_at")?,
                by: row.try_get("annotated_by").map_err(read)?,
                note: row.try_get("note").map_err(read)?,
                tags: row.try_get("tags").map_err(read)?,
                hold: row.try_get("hold").map_err(read)?,
                asks_lift: row.try_get("asks_lift").map_err(read)?,
            },
            held_by: row.try_get("held_by").map_err(read)?,
            lift: lift.map(|(by, until)| LiftRequest { by, until: Timestamp::from_nanos(until) }),
            cameras: cameras.map_err(|_no_list| odd("snapshot_camera.camera")())?,
            removed_at: removed_at.map(Timestamp::from_nanos),
        })
    }

    /// Number and digest of the snapshot that was sealed last, removed or not.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn snapshot_head(&self) -> Result<Option<(i64, [u8; 32])>, StoreError> {
        let last: Option<(i64, Vec<u8>)> =
            sqlx::query_as("select number, digest from snapshot order by number desc limit 1")
                .fetch_optional(&self.cache)
                .await
                .map_err(|error| self.classify(error))?;
        let unreadable = || StoreError::UnreadableRow { path: self.path.clone(), what: "snapshot.digest" };
        let head = |(number, digest): (i64, Vec<u8>)| {
            Ok((number, digest.try_into().map_err(|_wrong_length| unreadable())?))
        };
        last.map(head).transpose()
    }

    /// Adds a snapshot with its first annotation; whether it is the next of the chain, which it must be.
    ///
    /// # Errors
    /// When the database fails, or one of this number or id is there: then it was not added.
    pub async fn add_snapshot(&self, record: &SnapshotRecord) -> Result<bool, StoreError> {
        let classify = |error| self.classify(error);
        let mut transaction = self.durable.begin_with("begin immediate").await.map_err(classify)?;
        let done = sqlx::query(
            "insert into snapshot (number, id, made_at, shown_at, kind, subject, made_by, schedule, bytes, digest, previous,
                 salt, version, note, tags, hold, held_by)
             select ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?
             where ? = coalesce((select max(number) from snapshot) + 1, ?)",
        )
        .bind(record.number)
        .bind(&record.id)
        .bind(record.made_at.as_nanos())
        .bind(record.shown_at.as_nanos())
        .bind(&record.kind)
        .bind(&record.subject)
        .bind(&record.made_by)
        .bind(&record.schedule)
        .bind(record.n_bytes)
        .bind(&record.digest[..])
        .bind(&record.previous[..])
        .bind(&record.salt[..])
        .bind(record.annotation.version)
        .bind(&record.annotation.note)
        .bind(&record.annotation.tags)
        .bind(record.annotation.hold)
        .bind(&record.held_by)
        .bind(record.number)
        // The first that this database knows may be a later one: of a folder that is older than the database.
        .bind(record.number)
        .execute(&mut *transaction)
        .await
        .map_err(classify)?;
        if done.rows_affected() == 0 {
            return Ok(false);
        }
        for camera in &record.cameras {
            sqlx::query("insert into snapshot_camera (number, camera) values (?, ?)")
                .bind(record.number)
                .bind(camera)
                .execute(&mut *transaction)
                .await
                .map_err(classify)?;
        }
        insert_annotation(&mut transaction, record.number, &record.annotation).await.map_err(classify)?;
        transaction.commit().await.map_err(classify)?;
        Ok(true)
    }

    /// The snapshot of an id; none where it was removed or never was.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn snapshot(&self, id: &str) -> Result<Option<SnapshotRecord>, StoreError> {
        let sql = format!("{COLUMNS} where id = ? and removed_at is null");
        let row = sqlx::query(sqlx::AssertSqlSafe(sql)).bind(id).fetch_optional(&self.cache).await;
        row.map_err(|error| self.classify(error))?.map(|row| self.snapshot_of(&row)).transpose()
    }

    /// The first `limit` links of the chain after number `after`, those of removed ones too.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn snapshot_chain(&self, after: i64, limit: u32) -> Result<Vec<SnapshotRecord>, StoreError> {
        let sql = format!("{COLUMNS} where snapshot.number > ? order by snapshot.number limit ?");
        let rows = sqlx::query(sqlx::AssertSqlSafe(sql)).bind(after).bind(limit).fetch_all(&self.cache).await;
        rows.map_err(|error| self.classify(error))?.iter().map(|row| self.snapshot_of(row)).collect()
    }

    /// Number and bytes of the snapshots that are there.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn snapshot_totals(&self) -> Result<(i64, i64), StoreError> {
        sqlx::query_as("select count(*), coalesce(sum(bytes), 0) from snapshot where removed_at is null")
            .fetch_one(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The snapshot that may go first: the oldest that is not held, made before `before`.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn oldest_free_snapshot(
        &self,
        before: Timestamp,
    ) -> Result<Option<SnapshotRecord>, StoreError> {
        let sql = format!(
            "{COLUMNS} where removed_at is null and snapshot.hold = 0 and made_at < ? order by made_at, snapshot.number limit 1"
        );
        let row =
            sqlx::query(sqlx::AssertSqlSafe(sql)).bind(before.as_nanos()).fetch_optional(&self.cache).await;
        row.map_err(|error| self.classify(error))?.map(|row| self.snapshot_of(&row)).transpose()
    }

    /// Adds a snapshot's newest annotation, with who holds it and who asked to lift that, after version
    /// `annotation.version - 1`, which must be the newest; whether it was.
    ///
    /// # Errors
    /// When the database fails: then nothing was changed.
    pub async fn annotate_snapshot(&self, changed: &SnapshotRecord) -> Result<bool, StoreError> {
        let SnapshotRecord { number, annotation, held_by, lift, .. } = changed;
        let classify = |error| self.classify(error);
        let mut transaction = self.durable.begin_with("begin immediate").await.map_err(classify)?;
        let done = sqlx::query(
            "update snapshot set version = ?, note = ?, tags = ?, hold = ?, held_by = ?, lift_asked_by = ?, lift_until = ?
             where number = ? and version = ? and removed_at is null",
        )
        .bind(annotation.version)
        .bind(&annotation.note)
        .bind(&annotation.tags)
        .bind(annotation.hold)
        .bind(held_by)
        .bind(lift.as_ref().map(|lift| &lift.by))
        .bind(lift.as_ref().map(|lift| lift.until.as_nanos()))
        .bind(number)
        .bind(annotation.version - 1)
        .execute(&mut *transaction)
        .await
        .map_err(classify)?;
        if done.rows_affected() == 0 {
            return Ok(false);
        }
        insert_annotation(&mut transaction, *number, annotation).await.map_err(classify)?;
        transaction.commit().await.map_err(classify)?;
        Ok(true)
    }

    /// What was said of a snapshot, the first version first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn snapshot_annotations(&self, number: i64) -> Result<Vec<SnapshotAnnotation>, StoreError> {
        type Row = (i64, i64, Option<String>, String, String, bool, bool);
        let rows: Vec<Row> = sqlx::query_as(
            "select version, at, by, note, tags, hold, asks_lift from snapshot_annotation
             where number = ? order by version",
        )
        .bind(number)
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let annotation = |(version, at, by, note, tags, hold, asks_lift): Row| {
            let at = Timestamp::from_nanos(at);
            SnapshotAnnotation { version, at, by, note, tags, hold, asks_lift }
        };
        Ok(rows.into_iter().map(annotation).collect())
    }

    /// Notes that a snapshot is removed; its link of the chain stays, what was said of it goes. With `version`, only where
    /// that is its annotations' newest; without, only where nothing holds it. Whether it was so.
    ///
    /// # Errors
    /// When the database fails: then it is still there.
    pub async fn remove_snapshot(
        &self,
        number: i64,
        version: Option<i64>,
        (at, by): (Timestamp, Option<&str>),
        why: SnapshotRemoval,
    ) -> Result<bool, StoreError> {
        let classify = |error| self.classify(error);
        let mut transaction = self.durable.begin_with("begin immediate").await.map_err(classify)?;
        let done = sqlx::query(
            "update snapshot set removed_at = ?, removed_by = ?, removed_for = ?, bytes = 0, note = '', tags = '[]'
             where number = ? and removed_at is null and hold = 0 and version = coalesce(?, version)",
        )
        .bind(at.as_nanos())
        .bind(by)
        .bind(why.as_str())
        .bind(number)
        .bind(version)
        .execute(&mut *transaction)
        .await
        .map_err(classify)?;
        if done.rows_affected() == 0 {
            return Ok(false);
        }
        for sql in [
            "delete from snapshot_annotation where number = ?",
            "delete from snapshot_camera where number = ?",
        ] {
            sqlx::query(sql).bind(number).execute(&mut *transaction).await.map_err(classify)?;
        }
        transaction.commit().await.map_err(classify)?;
        Ok(true)
    }

    /// Forgets the oldest links that only removed snapshots have, but for the newest `kept` of the chain; their ids. What is
    /// left is one chain without gaps.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn forget_removed_snapshots(&self, kept: i64) -> Result<Vec<String>, StoreError> {
        sqlx::query_scalar(
            "delete from snapshot where number < coalesce(
                 (select min(number) from snapshot where removed_at is null), 9223372036854775807)
             and number <= (select max(number) from snapshot) - max(?, 1)
             returning id",
        )
        .bind(kept)
        .fetch_all(&self.durable)
        .await
        .map_err(|error| self.classify(error))
    }
}

async fn insert_annotation(
    connection: &mut sqlx::SqliteConnection,
    number: i64,
    annotation: &SnapshotAnnotation,
) -> Result<(), sqlx::Error> {
    sqlx::query(
        "insert into snapshot_annotation (number, version, at, by, note, tags, hold, asks_lift)
         values (?, ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(number)
    .bind(annotation.version)
    .bind(annotation.at.as_nanos())
    .bind(&annotation.by)
    .bind(&annotation.note)
    .bind(&annotation.tags)
    .bind(annotation.hold)
    .bind(annotation.asks_lift)
    .execute(connection)
    .await
    .map(|_done| ())
}
