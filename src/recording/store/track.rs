//! Table `track`: where what moved before the cameras went; bounded in rows and in age for each camera. The one written
//! longest ago goes first, not the one that began first: clocks step and clips begin again.

use super::{Store, StoreError};
use sqlx::SqliteConnection;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Rows that are kept of a camera: some 60 MB where a path has 30 points.
const ROWS_KEPT: i64 = 200_000;

/// How long a camera's rows are kept behind the one that began last: 400 days.
const NANOS_KEPT: i64 = 400 * 24 * 3600 * 1_000_000_000;

/// One thing that moved before a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrackRecord {
    /// Scene time of its first sighting.
    pub began_at: Timestamp,
    /// Scene time of its last sighting, not before the first.
    pub ended_at: Timestamp,
    /// Its number among those of one run of the camera; together with `began_at` no other of the camera has it.
    pub number: u64,
    /// The least box around its feet in the texture: lower and upper corner (u, v), 0 to 65535 over the picture.
    pub feet: [[u16; 2]; 2],
    /// Its largest height, 65535 being the picture's.
    pub height: u16,
    /// When its feet were where, encoded by others: 1 to 8192 bytes.
    pub path: Vec<u8>,
}

/// The columns of a record in the table's order, the path last.
type Row = (i64, i64, i64, i64, i64, i64, i64, i64, Vec<u8>);

impl Store {
    /// Adds tracks of `camera`, each in place of the one of the same beginning and number: all of them or none. A power
    /// cut may take the last ones.
    ///
    /// # Errors
    /// When the database fails, or a record does not keep to its ranges.
    pub async fn put_tracks(&self, camera: &CameraId, tracks: &[TrackRecord]) -> Result<(), StoreError> {
        self.write_tracks(camera, tracks, ROWS_KEPT).await.map_err(|error| self.classify(error))
    }

    async fn write_tracks(
        &self,
        camera: &CameraId,
        tracks: &[TrackRecord],
        rows_kept: i64,
    ) -> Result<(), sqlx::Error> {
        let mut transaction = self.cache.begin_with("begin immediate").await?;
        for track in tracks {
            insert(&mut transaction, camera, track).await?;
        }
        sqlx::query(
            "delete from track
             where camera = ?1 and written <= (select max(written) from track where camera = ?1) - ?2",
        )
        .bind(camera.as_str())
        .bind(rows_kept)
        .execute(&mut *transaction)
        .await?;
        // Behind the camera's own newest, so that one with a clock of its own loses nothing of others'.
        sqlx::query(
            "delete from track
             where camera = ?1 and began_at < (select max(began_at) from track where camera = ?1) - ?2",
        )
        .bind(camera.as_str())
        .bind(NANOS_KEPT)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await
    }

    /// The newest `limit` tracks of `camera` that were seen at some time from `from` to `to`, of those that come before
    /// `before` in the order of beginning and number; the one that began last first.
    ///
    /// # Errors
    /// When the database fails, or a row cannot be read.
    pub async fn tracks(
        &self,
        camera: &CameraId,
        (from, to): (Timestamp, Timestamp),
        before: Option<(Timestamp, u64)>,
        limit: u32,
    ) -> Result<Vec<TrackRecord>, StoreError> {
        let (before_began, before_number) = before.map_or((i64::MAX, i64::MAX), |(at, number)| {
            (at.as_nanos(), i64::try_from(number).unwrap_or(i64::MAX))
        });
        // None that reaches into the span begins further before it than the longest is long.
        let rows: Vec<Row> = sqlx::query_as(
            "select began_at, ended_at, number, min_u, min_v, max_u, max_v, height, path from track
             where camera = ?1 and (began_at, number) < (?2, ?3) and began_at <= ?4
                 and began_at >= ?5 - coalesce((select max(ended_at - began_at) from track where camera = ?1), 0)
                 and ended_at >= ?5
             order by began_at desc, number desc limit ?6",
        )
        .bind(camera.as_str())
        .bind(before_began)
        .bind(before_number)
        .bind(to.as_nanos())
        .bind(from.as_nanos())
        .bind(limit)
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let unreadable =
            || StoreError::UnreadableRow { path: self.path.clone(), what: "a number of a track" };
        rows.into_iter().map(|row| read(row).ok_or_else(unreadable)).collect()
    }
}

impl Store {
    /// Returns when the first of a camera's tracks began that was seen at `at` or later.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn next_track_at(
        &self,
        camera: &CameraId,
        at: Timestamp,
    ) -> Result<Option<Timestamp>, StoreError> {
        let began: Option<i64> = sqlx::query_scalar(
            "select began_at from track
             where camera = ?1 and ended_at >= ?2
                 and began_at >= ?2 - coalesce((select max(ended_at - began_at) from track where camera = ?1), 0)
             order by began_at limit 1",
        )
        .bind(camera.as_str())
        .bind(at.as_nanos())
        .fetch_optional(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(began.map(Timestamp::from_nanos))
    }
}

async fn insert(
    connection: &mut SqliteConnection,
    camera: &CameraId,
    track: &TrackRecord,
) -> Result<(), sqlx::Error> {
    let [[min_u, min_v], [max_u, max_v]] = track.feet;
    sqlx::query(
        "insert into track
             (camera, written, began_at, ended_at, number, min_u, min_v, max_u, max_v, height, path)
         values (?1, (select coalesce(max(written), 0) + 1 from track where camera = ?1), ?2, ?3, ?4, ?5, ?6, ?7, ?8,
             ?9, ?10)
         on conflict (camera, began_at, number) do update set
             ended_at = excluded.ended_at, min_u = excluded.min_u, min_v = excluded.min_v,
             max_u = excluded.max_u, max_v = excluded.max_v, height = excluded.height, path = excluded.path",
    )
    .bind(camera.as_str())
    .bind(track.began_at.as_nanos())
    .bind(track.ended_at.as_nanos())
    .bind(i64::try_from(track.number).unwrap_or(i64::MAX))
    .bind(min_u)
    .bind(min_v)
    .bind(max_u)
    .bind(max_v)
    .bind(track.height)
    .bind(track.path.as_slice())
    .execute(connection)
    .await?;
    Ok(())
}

/// None where a number is out of its range.
fn read((began_at, ended_at, number, min_u, min_v, max_u, max_v, height, path): Row) -> Option<TrackRecord> {
    let share = |value: i64| u16::try_from(value).ok();
    Some(TrackRecord {
        began_at: Timestamp::from_nanos(began_at),
        ended_at: Timestamp::from_nanos(ended_at),
        number: u64::try_from(number).ok()?,
        feet: [[share(min_u)?, share(min_v)?], [share(max_u)?, share(max_v)?]],
        height: share(height)?,
        path,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn secs(secs: i64) -> Timestamp {
        Timestamp::from_nanos(secs * 1_000_000_000)
    }

    fn record(began: i64, ended: i64, number: u64) -> TrackRecord {
        TrackRecord {
            began_at: secs(began),
            ended_at: secs(ended),
            number,
            feet: [[0, 100], [65_535, 200]],
            height: 9_000,
            path: vec![1, 2, 3, number as u8],
        }
    }

    async fn store(folder: &TempDir) -> Store {
        Store::open(&folder.path().join("test.sqlite")).await.unwrap()
    }

    fn camera(id: &str) -> CameraId {
        CameraId::new(id).unwrap()
    }

    fn told(found: &[TrackRecord]) -> Vec<(i64, u64)> {
        found.iter().map(|track| (track.began_at.as_nanos() / 1_000_000_000, track.number)).collect()
    }

    #[tokio::test]
    async fn tracks_of_a_span_come_newest_first_and_page_by_page() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let (gate, yard) = (camera("gate"), camera("yard"));
        // The first lasts an hour, so that it is found long after it began.
        let all =
            [record(-100, 3500, 7), record(0, 10, 1), record(0, 12, 2), record(20, 30, 3), record(40, 41, 4)];
        store.put_tracks(&gate, &all).await.unwrap();
        store.put_tracks(&yard, &[record(5, 6, 1)]).await.unwrap();
        let ask = async |from: i64, to: i64, before: Option<(i64, u64)>, limit: u32| {
            let before = before.map(|(at, number)| (secs(at), number));
            told(&store.tracks(&gate, (secs(from), secs(to)), before, limit).await.unwrap())
        };
        let everything = [(40, 4), (20, 3), (0, 2), (0, 1), (-100, 7)];
        assert_eq!(ask(-200, 5000, None, 9).await, everything);
        assert_eq!(ask(11, 20, None, 9).await, [(20, 3), (0, 2), (-100, 7)]);
        assert_eq!(ask(42, 99, None, 9).await, [(-100, 7)]);
        assert_eq!(ask(3501, 9999, None, 9).await, []);
        assert_eq!(ask(-999, -101, None, 9).await, []);
        let mut paged = Vec::new();
        loop {
            let page = ask(-200, 5000, paged.last().copied(), 2).await;
            paged.extend_from_slice(&page);
            if page.len() < 2 {
                break;
            }
        }
        assert_eq!(paged, everything);
        assert_eq!(store.tracks(&gate, (secs(40), secs(99)), None, 1).await.unwrap(), all[4..]);
        assert_eq!(store.tracks(&yard, (secs(0), secs(99)), None, 9).await.unwrap(), [record(5, 6, 1)]);
        let ends = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
        assert_eq!(store.tracks(&gate, ends, None, 9).await.unwrap().len(), all.len());
    }

    #[tokio::test]
    async fn the_next_track_is_the_first_that_is_not_over() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let gate = camera("gate");
        store.put_tracks(&gate, &[record(0, 50, 1), record(10, 12, 2), record(90, 91, 3)]).await.unwrap();
        for (at, expected) in [(i64::MIN / 1_000_000_000, Some(0)), (12, Some(0)), (51, Some(90)), (92, None)]
        {
            let next = store.next_track_at(&gate, secs(at)).await.unwrap();
            assert_eq!(next, expected.map(secs), "{at}");
        }
        assert_eq!(store.next_track_at(&camera("yard"), secs(0)).await.unwrap(), None);
    }

    #[tokio::test]
    async fn a_track_that_goes_on_takes_its_own_place() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let gate = camera("gate");
        store.put_tracks(&gate, &[record(0, 60, 1), record(30, 40, 2)]).await.unwrap();
        let longer = TrackRecord { feet: [[5, 5], [6, 6]], height: 7, path: vec![8], ..record(0, 120, 1) };
        store.put_tracks(&gate, std::slice::from_ref(&longer)).await.unwrap();
        let found = store.tracks(&gate, (secs(0), secs(999)), None, 9).await.unwrap();
        assert_eq!(found, [record(30, 40, 2), longer]);
        let refused = TrackRecord { ended_at: secs(-1), ..record(0, 120, 1) };
        store.put_tracks(&gate, &[record(70, 71, 3), refused]).await.unwrap_err();
        assert_eq!(store.tracks(&gate, (secs(0), secs(999)), None, 9).await.unwrap(), found, "all or none");
    }

    #[tokio::test]
    async fn what_was_written_longest_ago_and_what_is_too_old_goes() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let (gate, yard) = (camera("gate"), camera("yard"));
        store.put_tracks(&yard, &[record(0, 1, 1)]).await.unwrap();
        for number in 1..=6 {
            // The latest is written first.
            let began = 100 - number as i64;
            store.write_tracks(&gate, &[record(began, began, number)], 4).await.unwrap();
        }
        let all = (secs(-9), secs(999));
        let found = store.tracks(&gate, all, None, 9).await.unwrap();
        assert_eq!(told(&found), [(97, 3), (96, 4), (95, 5), (94, 6)]);
        let later = NANOS_KEPT / 1_000_000_000 + 96;
        store.put_tracks(&gate, &[record(later, later, 7)]).await.unwrap();
        let found = store.tracks(&gate, (secs(0), secs(later)), None, 9).await.unwrap();
        assert_eq!(told(&found), [(later, 7), (97, 3), (96, 4)]);
        assert_eq!(
            store.tracks(&yard, all, None, 9).await.unwrap().len(),
            1,
            "the other camera keeps its own"
        );
    }
}
