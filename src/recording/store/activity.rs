//! Table `activity`: how much moved before the cameras, minute by minute; bounded in age.

use super::{Store, StoreError};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Nanoseconds of a minute.
const MINUTE_NANOS: i64 = 60_000_000_000;

/// Minutes that are kept behind the newest: 400 days, some 20 MB a camera.
const MINUTES_KEPT: i64 = 400 * 24 * 60;

/// What moved before a camera in one minute, or in several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActivityRecord {
    /// Scene time of the beginning; of a minute's, a whole minute.
    pub at: Timestamp,
    /// Frames looked at.
    pub n_frames: u64,
    /// Share of the picture that moved, 0 to 1, summed over the frames.
    pub moving_sum: f64,
    /// Most things that moved at once.
    pub max_tracks: u32,
    /// Things that came.
    pub new_tracks: u32,
}

impl ActivityRecord {
    /// Share of the picture that moved, 0 to 1, mean over the frames.
    #[must_use]
    pub fn moving_share(&self) -> f64 {
        self.moving_sum / self.n_frames.max(1) as f64
    }
}

impl Store {
    /// Adds what moved before `camera` to what is kept of that minute. A power cut may take the last minutes.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn add_activity(&self, camera: &CameraId, record: &ActivityRecord) -> Result<(), StoreError> {
        self.write_activity(camera, record).await.map_err(|error| self.classify(error))
    }

    async fn write_activity(&self, camera: &CameraId, record: &ActivityRecord) -> Result<(), sqlx::Error> {
        let minute = record.at.as_nanos().div_euclid(MINUTE_NANOS);
        let mut transaction = self.cache.begin_with("begin immediate").await?;
        sqlx::query(
            "insert into activity (camera, minute, n_frames, moving_sum, max_tracks, new_tracks)
             values (?, ?, ?, ?, ?, ?)
             on conflict (camera, minute) do update set
                 n_frames = n_frames + excluded.n_frames, moving_sum = moving_sum + excluded.moving_sum,
                 max_tracks = max(max_tracks, excluded.max_tracks), new_tracks = new_tracks + excluded.new_tracks",
        )
        .bind(camera.as_str())
        .bind(minute)
        .bind(i64::try_from(record.n_frames).unwrap_or(i64::MAX))
        .bind(record.moving_sum)
        .bind(record.max_tracks)
        .bind(record.new_tracks)
        .execute(&mut *transaction)
        .await?;
        // Behind the camera's own newest minute, so that one with a clock of its own loses nothing of others'.
        sqlx::query("delete from activity where camera = ? and minute < ?")
            .bind(camera.as_str())
            .bind(minute.saturating_sub(MINUTES_KEPT))
            .execute(&mut *transaction)
            .await?;
        transaction.commit().await
    }

    /// What moved before `camera` from the minute of `from` to that of `to`, in stretches of `minutes_each` minutes that
    /// begin at whole multiples of that since 1970; those in which nothing was looked at are left out.
    ///
    /// # Errors
    /// When the database fails.
    ///
    /// # Panics
    /// When `minutes_each` is 0.
    pub async fn activity(
        &self,
        camera: &CameraId,
        from: Timestamp,
        to: Timestamp,
        minutes_each: u32,
    ) -> Result<Vec<ActivityRecord>, StoreError> {
        assert!(minutes_each > 0, "a stretch has a length");
        let minute = |at: Timestamp| at.as_nanos().div_euclid(MINUTE_NANOS);
        // Division rounds towards zero in SQL; times before 1970 come before the stretch of minute 0.
        let rows: Vec<(i64, i64, f64, u32, i64)> = sqlx::query_as(
            "select (minute - ((minute % ?1) + ?1) % ?1) as start, sum(n_frames), sum(moving_sum), max(max_tracks),
                    sum(new_tracks)
             from activity where camera = ?2 and minute between ?3 and ?4 group by start order by start",
        )
        .bind(minutes_each)
        .bind(camera.as_str())
        .bind(minute(from))
        .bind(minute(to))
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let record = |(start, n_frames, moving_sum, max_tracks, new_tracks): (i64, i64, f64, u32, i64)| {
            ActivityRecord {
                at: Timestamp::from_nanos(start.saturating_mul(MINUTE_NANOS)),
                n_frames: u64::try_from(n_frames).unwrap_or(0),
                moving_sum,
                max_tracks,
                new_tracks: u32::try_from(new_tracks).unwrap_or(u32::MAX),
            }
        };
        Ok(rows.into_iter().map(record).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn minutes_add_up_and_stretches_begin_at_whole_multiples() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("test.sqlite")).await.unwrap();
        let (gate, yard) = (CameraId::new("gate").unwrap(), CameraId::new("yard").unwrap());
        let minute = |minute: i64| Timestamp::from_nanos(minute * MINUTE_NANOS);
        let record = |at: Timestamp, n_frames: u64| ActivityRecord {
            at,
            n_frames,
            moving_sum: 0.25 * n_frames as f64,
            max_tracks: n_frames as u32,
            new_tracks: 2,
        };
        for (at, n_frames) in [(-7, 1), (-1, 2), (0, 3), (4, 4), (4, 1), (5, 6), (11, 7)] {
            store.add_activity(&gate, &record(minute(at).saturating_add_nanos(59), n_frames)).await.unwrap();
        }
        store.add_activity(&yard, &record(minute(4), 9)).await.unwrap();
        let ask = async |from: i64, to: i64, each: u32| {
            let found = store.activity(&gate, minute(from), minute(to), each).await.unwrap();
            found.iter().map(|of| (of.at.as_nanos() / MINUTE_NANOS, of.n_frames)).collect::<Vec<_>>()
        };
        assert_eq!(ask(-10, 10, 1).await, [(-7, 1), (-1, 2), (0, 3), (4, 5), (5, 6)]);
        assert_eq!(ask(-10, 20, 5).await, [(-10, 1), (-5, 2), (0, 8), (5, 6), (10, 7)]);
        let all = store.activity(&gate, minute(0), minute(4), 5).await.unwrap();
        let expected =
            ActivityRecord { at: minute(0), n_frames: 8, moving_sum: 2.0, max_tracks: 4, new_tracks: 6 };
        assert_eq!(all, [expected]);
        // What is older than 400 days than the camera's newest goes; the other camera's stays.
        store.add_activity(&gate, &record(minute(MINUTES_KEPT + 1), 1)).await.unwrap();
        assert_eq!(ask(-10, 10, 1).await, [(4, 5), (5, 6)]);
        assert_eq!(store.activity(&yard, minute(0), minute(9), 1).await.unwrap().len(), 1);
    }
}
