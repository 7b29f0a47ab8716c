//! Table `background_history`: backgrounds of the past, for looking back in time. Bounded in rows for each camera and
//! in bytes over all cameras: the one written longest ago goes first, and a camera's newest never. Written order and
//! not scene time decides what is old: clocks step, clips begin again, and cameras may live in different years.

use super::background::{Row, name_of};
use super::{BackgroundRecord, Store, StoreError, check_size};
use sqlx::SqliteConnection;
use std::collections::HashMap;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// What an entry is called in messages.
const ENTRY: &str = "the background for the history";

/// How much of the past is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BackgroundHistoryBounds {
    /// Most entries of one camera, whatever their picture sizes; 0 counts as 1.
    pub count: u32,
    /// Most bytes of all entries of all cameras together, the encoded mixtures alone.
    pub bytes: u64,
}

impl Store {
    /// Adds a background to the history, in place of the camera's one of the same `saved_at`, and holds the whole
    /// history to `bounds`: entries written longest ago go first, but of every camera the one written last stays.
    ///
    /// # Errors
    /// [`StoreError::TooLarge`] when it does not fit beside the newest entries of the other cameras: it is not added
    /// then, and the camera's entries are kept as far as the bounds let them. Or when the database fails; nothing
    /// has changed then.
    pub async fn put_background_history(
        &self,
        record: &BackgroundRecord,
        bounds: BackgroundHistoryBounds,
    ) -> Result<(), StoreError> {
        check_size(ENTRY, &record.bytes)?;
        let written = self.write_background_history(record, bounds).await;
        let (bytes, most) = (record.bytes.len() as u64, written.map_err(|error| self.classify(error))?);
        if bytes > most {
            return Err(StoreError::TooLarge { what: ENTRY, bytes, most });
        }
        Ok(())
    }

    /// Adds the entry if it fits, and lets go what is beyond the bounds; the most bytes that would have fitted.
    async fn write_background_history(
        &self,
        record: &BackgroundRecord,
        bounds: BackgroundHistoryBounds,
    ) -> Result<u64, sqlx::Error> {
        let mut transaction = self.cache.begin_with("begin immediate").await?;
        let others = read_sizes(&mut transaction).await?.newest_but(record.camera.as_str());
        let room = bounds.bytes.saturating_sub(others);
        if record.bytes.len() as u64 <= room {
            insert(&mut transaction, record).await?;
        }
        for written in read_sizes(&mut transaction).await?.surplus(bounds) {
            sqlx::query("delete from background_history where written = ?")
                .bind(written)
                .execute(&mut *transaction)
                .await?;
        }
        transaction.commit().await?;
        Ok(room)
    }

    /// A camera's background for pictures of one size (columns and rows of the model, pixels) as it was at an
    /// instant: the newest one saved at or before it, else the oldest after it.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn background_at(
        &self,
        camera: &CameraId,
        width: u32,
        height: u32,
        at: Timestamp,
    ) -> Result<Option<BackgroundRecord>, StoreError> {
        let row: Option<Row> = sqlx::query_as(
            "select saved_at, width, height, matrix, version, bytes from background_history
             where written = coalesce(
                 (select written from background_history
                  where camera = ?1 and width = ?2 and height = ?3 and saved_at <= ?4
                  order by saved_at desc limit 1),
                 (select written from background_history
                  where camera = ?1 and width = ?2 and height = ?3 and saved_at > ?4
                  order by saved_at limit 1))",
        )
        .bind(camera.as_str())
        .bind(width)
        .bind(height)
        .bind(at.as_nanos())
        .fetch_optional(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        row.map(|row| self.background_record(camera, row)).transpose()
    }

    /// A camera's entries in the history, in order of scene time: when they were saved, columns and rows of the
    /// model, pixels, and the bytes of the encoded mixture.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn background_history(
        &self,
        camera: &CameraId,
    ) -> Result<Vec<(Timestamp, u32, u32, u64)>, StoreError> {
        let rows: Vec<(i64, u32, u32, i64)> = sqlx::query_as(
            "select saved_at, width, height, length(bytes) from background_history
             where camera = ? order by saved_at",
        )
        .bind(camera.as_str())
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let entry = |(nanos, width, height, bytes): (i64, u32, u32, i64)| {
            (Timestamp::from_nanos(nanos), width, height, u64::try_from(bytes).unwrap_or(0))
        };
        Ok(rows.into_iter().map(entry).collect())
    }

    /// Scene time of the camera's entry that was written last, which need not be the latest: clocks step.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn last_background_history(&self, camera: &CameraId) -> Result<Option<Timestamp>, StoreError> {
        let nanos: Option<i64> = sqlx::query_scalar(
            "select saved_at from background_history where camera = ? order by written desc limit 1",
        )
        .bind(camera.as_str())
        .fetch_optional(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(nanos.map(Timestamp::from_nanos))
    }
}

/// Every entry without its content, the one written last first.
struct Sizes(Vec<Size>);

struct Size {
    written: i64,
    camera: String,
    n_bytes: u64,
    /// How many of the camera's entries were written later.
    place: u32,
}

impl Sizes {
    /// Bytes of the newest entries of all cameras but one.
    fn newest_but(&self, camera: &str) -> u64 {
        let newest = self.0.iter().filter(|entry| entry.place == 0 && entry.camera != camera);
        newest.map(|entry| entry.n_bytes).sum()
    }

    /// What must go: of every camera what is beyond the count (all cameras, so that a lowered bound reaches those
    /// that write no more), and of the rest what was written longest ago, until the bytes fit or every camera has
    /// but its newest.
    fn surplus(&self, bounds: BackgroundHistoryBounds) -> Vec<i64> {
        let mut total: u64 = self.0.iter().filter(|entry| entry.place == 0).map(|entry| entry.n_bytes).sum();
        let mut is_full = false;
        let mut surplus = Vec::new();
        for entry in self.0.iter().filter(|entry| entry.place > 0) {
            if entry.place >= bounds.count {
                surplus.push(entry.written);
                continue;
            }
            total += entry.n_bytes;
            // From the first that does not fit, all go that are older, be they small enough.
            is_full |= total > bounds.bytes;
            if is_full {
                surplus.push(entry.written);
            }
        }
        surplus
    }
}

/// Summed up here and not in SQL: a window function would copy every background to number the rows.
async fn read_sizes(connection: &mut SqliteConnection) -> Result<Sizes, sqlx::Error> {
    let rows: Vec<(i64, String, i64)> =
        sqlx::query_as("select written, camera, length(bytes) from background_history order by written desc")
            .fetch_all(connection)
            .await?;
    let mut places: HashMap<String, u32> = HashMap::new();
    let size = |(written, camera, n_bytes): (i64, String, i64)| {
        let next = places.entry(camera.clone()).or_default();
        let place = *next;
        *next += 1;
        Size { written, camera, n_bytes: u64::try_from(n_bytes).unwrap_or(0), place }
    };
    Ok(Sizes(rows.into_iter().map(size).collect()))
}

async fn insert(connection: &mut SqliteConnection, record: &BackgroundRecord) -> Result<(), sqlx::Error> {
    sqlx::query(
        "insert or replace into background_history
             (written, camera, width, height, matrix, version, saved_at, bytes)
         values ((select coalesce(max(written), 0) + 1 from background_history), ?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(record.camera.as_str())
    .bind(record.width)
    .bind(record.height)
    .bind(name_of(record.matrix))
    .bind(record.version)
    .bind(record.saved_at.as_nanos())
    .bind(record.bytes.as_slice())
    .execute(connection)
    .await?;
    Ok(())
}
