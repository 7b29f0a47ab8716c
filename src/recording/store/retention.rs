//! Removes what is too old: tracks, entities, activity, and backgrounds of the past.

use super::{Store, StoreError};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// How old rows may be, nanoseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AgeLimits {
    /// Tracks, by their beginning, and entities, by their end.
    pub tracks_nanos: i64,
    /// How much moved.
    pub activity_nanos: i64,
    /// Backgrounds that are kept for looking back; of cameras that are not configured any more, their last one too.
    pub backgrounds_nanos: i64,
}

/// A table, its column of time, and nanoseconds of that column's unit.
struct Aged {
    table: &'static str,
    column: &'static str,
    unit_nanos: i64,
    max_nanos: i64,
}

impl Store {
    /// Removes what is older than `limits` allow by the clock's `now`; of `steady` cameras, whose scene time is not the
    /// clock's, what is that much older than their newest. How many rows went.
    ///
    /// # Errors
    /// When the database fails; what went before is gone then.
    pub async fn forget_old(
        &self,
        limits: &AgeLimits,
        now: Timestamp,
        (configured, steady): (&[CameraId], &[CameraId]),
    ) -> Result<u64, StoreError> {
        let tables = [
            ("track", "began_at", 1, limits.tracks_nanos),
            ("activity", "minute", 60_000_000_000, limits.activity_nanos),
            ("background_history", "saved_at", 1, limits.backgrounds_nanos),
            ("background", "saved_at", 1, limits.backgrounds_nanos),
        ];
        let mut n_gone = 0;
        for (table, column, unit_nanos, max_nanos) in tables {
            let aged = Aged { table, column, unit_nanos, max_nanos };
            let cameras = self.cameras_of(table).await.map_err(|error| self.classify(error))?;
            for camera in cameras {
                let is_in = |of: &[CameraId]| of.iter().any(|id| id.as_str() == camera);
                // A camera goes on from its last background.
                if table == "background" && is_in(configured) {
                    continue;
                }
                let gone = self.forget_old_of(&aged, &camera, (!is_in(steady)).then_some(now)).await;
                n_gone += gone.map_err(|error| self.classify(error))?;
            }
        }
        n_gone += self.forget_old_entities(limits.tracks_nanos, now, steady).await?;
        Ok(n_gone)
    }

    /// The cameras that a table has rows of: found one after the other, so that not every row is looked at where there is an
    /// index.
    async fn cameras_of(&self, table: &str) -> Result<Vec<String>, sqlx::Error> {
        let next = format!(
            "with recursive known(camera) as (
                 select min(camera) from {table}
                 union all
                 select (select min(camera) from {table} where camera > known.camera) from known
                 where known.camera is not null
             ) select camera from known where camera is not null"
        );
        sqlx::query_scalar(sqlx::AssertSqlSafe(next)).fetch_all(&self.cache).await
    }

    async fn forget_old_of(
        &self,
        Aged { table, column, unit_nanos, max_nanos }: &Aged,
        camera: &str,
        now: Option<Timestamp>,
    ) -> Result<u64, sqlx::Error> {
        let newest = format!("select max({column}) from {table} where camera = ?");
        let newest = async {
            let newest: Option<i64> =
                sqlx::query_scalar(sqlx::AssertSqlSafe(newest)).bind(camera).fetch_one(&self.cache).await?;
            Ok::<_, sqlx::Error>(newest.map(|newest| newest.saturating_mul(*unit_nanos)))
        };
        let latest = match now {
            Some(now) => Some(now.as_nanos()),
            None => newest.await?,
        };
        let Some(latest) = latest else { return Ok(0) };
        let least = latest.saturating_sub(*max_nanos).div_euclid(*unit_nanos);
        let gone = format!("delete from {table} where camera = ? and {column} < ?");
        let done =
            sqlx::query(sqlx::AssertSqlSafe(gone)).bind(camera).bind(least).execute(&self.cache).await?;
        Ok(done.rows_affected())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{ActivityRecord, TrackRecord};

    const DAY: i64 = 86_400_000_000_000;

    #[tokio::test]
    async fn each_kind_goes_at_its_own_age_by_the_clock_or_behind_a_film_s_newest() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("a.sqlite")).await.unwrap();
        let [live, film, gone] = ["live", "film", "gone"].map(|id| CameraId::new(id).unwrap());
        let at = |days: i64| Timestamp::from_nanos(days * DAY);
        let now = at(20_000);
        for (camera, newest) in [(&live, 20_000), (&film, 10), (&gone, 19_999)] {
            for age in [0, 3, 30] {
                let began_at = at(newest - age);
                let track = TrackRecord {
                    began_at,
                    ended_at: began_at,
                    number: 1,
                    feet: [[0, 0], [1, 1]],
                    height: 9,
                    path: vec![1],
                };
                store.put_tracks(camera, &[track]).await.unwrap();
                let record = ActivityRecord {
                    at: began_at,
                    n_frames: 1,
                    moving_sum: 0.0,
                    max_tracks: 0,
                    new_tracks: 0,
                };
                store.add_activity(camera, &record).await.unwrap();
            }
        }
        let limits = AgeLimits { tracks_nanos: 2 * DAY, activity_nanos: 10 * DAY, backgrounds_nanos: DAY };
        let cameras = ([live.clone(), film.clone()], [film.clone()]);
        let n_gone = store.forget_old(&limits, now, (&cameras.0, &cameras.1)).await.unwrap();
        assert_eq!(n_gone, 3 * 2 + 3);
        let span = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
        for (camera, newest) in [(&live, 20_000), (&film, 10), (&gone, 19_999)] {
            let tracks = store.tracks(camera, span, None, 10).await.unwrap();
            assert_eq!(tracks.iter().map(|of| of.began_at).collect::<Vec<_>>(), [at(newest)], "{camera}");
            let minutes = store.activity(camera, at(-40_000), at(40_000), 1).await.unwrap();
            assert_eq!(
                minutes.iter().map(|of| of.at).collect::<Vec<_>>(),
                [at(newest - 3), at(newest)],
                "{camera}"
            );
        }
        assert_eq!(store.forget_old(&limits, now, (&cameras.0, &cameras.1)).await.unwrap(), 0);
        // A film that nobody plays any more is as old as the clock says.
        store.forget_old(&limits, now, (&[], &[])).await.unwrap();
        assert!(store.tracks(&film, span, None, 10).await.unwrap().is_empty());
    }
}
