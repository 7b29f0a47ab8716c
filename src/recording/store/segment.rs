//! Table `segment`: one row a recorded file. A row is made again by reading its file, so all but the mark `deleting` is
//! written by the connections that a power cut may cost their last commits: the archive then reads on in the file.
//! `deleting` is on disk before it is acknowledged, so that a file that is gone is never taken for one that was lost.

use super::{Store, StoreError, check_size};
use sqlx::sqlite::SqliteRow;
use sqlx::{FromRow, Row};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// What became of a segment's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SegmentState {
    /// It is being written.
    Open,
    /// It is whole.
    Closed,
    /// There is none.
    Missing,
    /// It cannot be read and was put aside.
    Quarantined,
    /// It is to go, or gone.
    Deleting,
}

/// A recorded segment as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SegmentRecord {
    /// Order of writing; 0 for one that was not written yet.
    pub id: i64,
    /// The camera.
    pub camera: CameraId,
    /// The file, from the archive's folder on.
    pub path: String,
    /// Scene time of the first frame.
    pub first_at: Timestamp,
    /// Scene time of the newest frame.
    pub last_at: Timestamp,
    /// Instant at which the file was begun, by the machine's clock; of one that was found without a row, of its last bytes.
    pub written_at: Timestamp,
    /// Frames.
    pub n_frames: u64,
    /// Bytes of the file that are whole and on the disk.
    pub n_bytes: u64,
    /// Bytes before the first cluster.
    pub header_bytes: u64,
    /// The codec's media type.
    pub codec: String,
    /// Columns and rows, pixels; 0 where the stream does not say them.
    pub size_px: (u32, u32),
    /// What became of the file.
    pub state: SegmentState,
    /// Where decoding can begin, encoded.
    pub keys: Vec<u8>,
}

impl SegmentState {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Open, Self::Closed, Self::Missing, Self::Quarantined, Self::Deleting];

    /// The name in the table.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Closed => "closed",
            Self::Missing => "missing",
            Self::Quarantined => "quarantined",
            Self::Deleting => "deleting",
        }
    }

    fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_str() == name)
    }
}

impl<'r> FromRow<'r, SqliteRow> for SegmentRecord {
    fn from_row(row: &'r SqliteRow) -> Result<Self, sqlx::Error> {
        let unreadable = |what: &str| sqlx::Error::Decode(format!("the segment's {what}").into());
        let count = |column: &str| {
            row.try_get::<i64, _>(column)
                .and_then(|n| u64::try_from(n).map_err(|error| sqlx::Error::Decode(error.into())))
        };
        let camera: String = row.try_get("camera")?;
        let state: String = row.try_get("state")?;
        Ok(Self {
            id: row.try_get("id")?,
            camera: CameraId::new(&camera)
                .map_err(|_foreign: videofields_vision::frame::IdError| unreadable("camera"))?,
            path: row.try_get("path")?,
            first_at: Timestamp::from_nanos(row.try_get("first_at")?),
            last_at: Timestamp::from_nanos(row.try_get("last_at")?),
            written_at: Timestamp::from_nanos(row.try_get("written_at")?),
            n_frames: count("n_frames")?,
            n_bytes: count("n_bytes")?,
            header_bytes: count("header_bytes")?,
            codec: row.try_get("codec")?,
            size_px: (row.try_get("width")?, row.try_get("height")?),
            state: SegmentState::named(&state).ok_or_else(|| unreadable("state"))?,
            keys: row.try_get("keys")?,
        })
    }
}

/// Every column but the keys, which are read where they are needed.
const WITHOUT_KEYS: &str = "id, camera, path, first_at, last_at, written_at, n_frames, n_bytes, header_bytes, codec, width, \
                            height, state, x'' as keys";

/// What can be read: the state of a row's file says that it is there.
const READABLE: &str = "state in ('open', 'closed')";

impl Store {
    /// Writes a segment's row, in place of the one of the same path if there is one, and answers its id. When that was written stays.
    ///
    /// # Errors
    /// When the keys are too large or the database fails.
    pub async fn put_segment(&self, record: &SegmentRecord) -> Result<i64, StoreError> {
        check_size("a segment's index", &record.keys)?;
        let number = |n: u64| i64::try_from(n).unwrap_or(i64::MAX);
        // All rows, though there is one: whoever takes the first and leaves is not told that its commit failed.
        let ids: Result<Vec<i64>, sqlx::Error> = sqlx::query_scalar(
            "insert into segment (camera, path, first_at, last_at, written_at, n_frames, n_bytes, header_bytes, codec, width,
                                  height, state, keys)
             values (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
             on conflict (path) do update set
                 first_at = excluded.first_at, last_at = excluded.last_at, n_frames = excluded.n_frames,
                 n_bytes = excluded.n_bytes, header_bytes = excluded.header_bytes, codec = excluded.codec,
                 width = excluded.width, height = excluded.height, state = excluded.state, keys = excluded.keys
             returning id",
        )
        .bind(record.camera.as_str())
        .bind(&record.path)
        .bind(record.first_at.as_nanos())
        .bind(record.last_at.as_nanos())
        .bind(record.written_at.as_nanos())
        .bind(number(record.n_frames))
        .bind(number(record.n_bytes))
        .bind(number(record.header_bytes))
        .bind(&record.codec)
        .bind(record.size_px.0)
        .bind(record.size_px.1)
        .bind(record.state.as_str())
        .bind(record.keys.as_slice())
        .fetch_all(&self.cache)
        .await;
        let ids = ids.map_err(|error| self.classify(error))?;
        ids.first().copied().ok_or_else(|| self.classify(sqlx::Error::RowNotFound))
    }

    /// Changes what a row says of its file.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn set_segment_state(&self, id: i64, state: SegmentState) -> Result<(), StoreError> {
        sqlx::query("update segment set state = ? where id = ?")
            .bind(state.as_str())
            .bind(id)
            .execute(&self.cache)
            .await
            .map(|_done| ())
            .map_err(|error| self.classify(error))
    }

    /// Marks a closed segment whose file is to go; on disk when it is acknowledged, with all that was written before.
    /// Answers whether there was one.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn mark_segment_deleting(&self, id: i64) -> Result<bool, StoreError> {
        sqlx::query("update segment set state = 'deleting' where id = ? and state = 'closed'")
            .bind(id)
            .execute(&self.durable)
            .await
            .map(|done| done.rows_affected() > 0)
            .map_err(|error| self.classify(error))
    }

    /// Removes the row of a segment that was marked and whose file is gone.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn forget_segment(&self, id: i64) -> Result<(), StoreError> {
        sqlx::query("delete from segment where id = ? and state = 'deleting'")
            .bind(id)
            .execute(&self.cache)
            .await
            .map(|_done| ())
            .map_err(|error| self.classify(error))
    }

    /// The segments of a state in order of writing, without their keys.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segments_in_state(&self, state: SegmentState) -> Result<Vec<SegmentRecord>, StoreError> {
        let text = format!("select {WITHOUT_KEYS} from segment where state = ? order by id");
        sqlx::query_as(sqlx::AssertSqlSafe(text))
            .bind(state.as_str())
            .fetch_all(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The segments of a camera that hold anything of a span (both ends included) and can be read, in order of time,
    /// without their keys.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segments(
        &self,
        camera: &CameraId,
        from: Timestamp,
        to: Timestamp,
    ) -> Result<Vec<SegmentRecord>, StoreError> {
        // Segments of a camera do not overlap: the one that holds `from` is the last that begins before it.
        let text = format!(
            "select {WITHOUT_KEYS} from segment
             where camera = ?1 and {READABLE} and last_at >= ?2 and first_at <= ?3
               and first_at >= coalesce((select max(first_at) from segment
                                         where camera = ?1 and {READABLE} and first_at <= ?2), ?2)
             order by first_at"
        );
        sqlx::query_as(sqlx::AssertSqlSafe(text))
            .bind(camera.as_str())
            .bind(from.as_nanos())
            .bind(to.as_nanos())
            .fetch_all(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The segment of a camera that can be read and begins last at or before an instant, with its keys.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segment_before(
        &self,
        camera: &CameraId,
        at: Timestamp,
    ) -> Result<Option<SegmentRecord>, StoreError> {
        let text = format!(
            "select * from segment where camera = ? and {READABLE} and first_at <= ? order by first_at desc limit 1"
        );
        self.one_segment(text, camera, at).await
    }

    /// The segment of a camera that can be read and begins first after an instant, with its keys.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segment_after(
        &self,
        camera: &CameraId,
        at: Timestamp,
    ) -> Result<Option<SegmentRecord>, StoreError> {
        let text = format!(
            "select * from segment where camera = ? and {READABLE} and first_at > ? order by first_at limit 1"
        );
        self.one_segment(text, camera, at).await
    }

    async fn one_segment(
        &self,
        text: String,
        camera: &CameraId,
        at: Timestamp,
    ) -> Result<Option<SegmentRecord>, StoreError> {
        sqlx::query_as(sqlx::AssertSqlSafe(text))
            .bind(camera.as_str())
            .bind(at.as_nanos())
            .fetch_optional(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The row of a file, with its keys.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segment_at_path(&self, path: &str) -> Result<Option<SegmentRecord>, StoreError> {
        sqlx::query_as("select * from segment where path = ?")
            .bind(path)
            .fetch_optional(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The closed segment of all cameras that was written first, without its keys: scene time is what a camera says.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn oldest_segment(&self) -> Result<Option<SegmentRecord>, StoreError> {
        let text = format!(
            "select {WITHOUT_KEYS} from segment where state = 'closed' order by written_at, id limit 1"
        );
        sqlx::query_as(sqlx::AssertSqlSafe(text))
            .fetch_optional(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The oldest of the closed segments of all cameras whose newest frame is of before `before`, or which were written before it;
    /// without its keys.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn aged_segment(&self, before: Timestamp) -> Result<Option<SegmentRecord>, StoreError> {
        let text = format!(
            "select {WITHOUT_KEYS} from segment where state = 'closed' and min(last_at, written_at) < ?
             order by min(last_at, written_at), id limit 1"
        );
        sqlx::query_as(sqlx::AssertSqlSafe(text))
            .bind(before.as_nanos())
            .fetch_optional(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// The segments of all cameras in the order of their paths, `most` of them, behind the one at `path`; without their
    /// keys. Paths of one camera are in the order of time.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segments_behind(&self, path: &str, most: u32) -> Result<Vec<SegmentRecord>, StoreError> {
        let text = format!("select {WITHOUT_KEYS} from segment where path > ? order by path limit ?");
        sqlx::query_as(sqlx::AssertSqlSafe(text))
            .bind(path)
            .bind(most)
            .fetch_all(&self.cache)
            .await
            .map_err(|error| self.classify(error))
    }

    /// Bytes of all segments whose files are there, those that are to go included.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn segments_bytes(&self) -> Result<u64, StoreError> {
        let bytes: i64 = sqlx::query_scalar(
            "select coalesce(sum(n_bytes), 0) from segment where state in ('open', 'closed', 'deleting')",
        )
        .fetch_one(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(u64::try_from(bytes).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_row_whose_commit_fails_does_not_count_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("test.sqlite")).await.unwrap();
        let record = SegmentRecord {
            id: 0,
            camera: CameraId::new("gate").unwrap(),
            path: "gate/1970-01-01/000001.000000000Z.mkv".to_owned(),
            first_at: Timestamp::from_nanos(1_000_000_000),
            last_at: Timestamp::from_nanos(2_000_000_000),
            written_at: Timestamp::from_nanos(3_000_000_000),
            n_frames: 10,
            n_bytes: 1000,
            header_bytes: 100,
            codec: "image/jpeg".to_owned(),
            size_px: (8, 4),
            state: SegmentState::Open,
            keys: vec![1, 2, 3],
        };
        let id = store.put_segment(&record).await.unwrap();
        // As a disk does that is full when the row is to be made safe.
        let mut held = Vec::new();
        for _ in 0..store.cache.options().get_max_connections() {
            let mut connection = store.cache.acquire().await.unwrap();
            connection.lock_handle().await.unwrap().set_commit_hook(|| false);
            held.push(connection);
        }
        drop(held);
        let closed = SegmentRecord { state: SegmentState::Closed, n_frames: 20, ..record.clone() };
        store.put_segment(&closed).await.unwrap_err();
        let kept = store.segment_at_path(&record.path).await.unwrap().unwrap();
        assert_eq!(kept, SegmentRecord { id, ..record });
    }
}
