//! Tables `entity_set`, `entity_span` and `entity`: who was where in a scene, as it was concluded from a set of its cameras, with ids
//! that are never given twice. Bounded in rows for each set, in sets for each scene, and in age.

use super::{Store, StoreError};
use sqlx::SqliteConnection;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// Sightings that are kept of a set; those that ended first go.
const ROWS_KEPT: i64 = 200_000;

/// Sets of cameras that are kept of a scene; those that saw anything last longest ago go.
const SETS_KEPT: i64 = 32;

/// Spans that are kept of a set, and that are read at once; those begun first go.
const SPANS_KEPT: i64 = 4096;

/// A scene, and those of its cameras from which it was concluded who was where.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct EntitySet {
    /// The scene's id.
    pub scene: String,
    /// The cameras' ids in the scene's order, with commas between them.
    cameras: String,
}

/// A time of which it is known who was where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntitySpan {
    /// Its number: greater is later begun.
    pub id: i64,
    /// Scene time of its beginning.
    pub began_at: Timestamp,
    /// Scene time of its end, not before the beginning.
    pub ended_at: Timestamp,
}

/// Somebody or something, from one sighting to another without a longer break.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EntityRecord {
    /// The id within the set.
    pub id: u64,
    /// Scene time of the first sighting.
    pub began_at: Timestamp,
    /// Scene time of the last sighting, not before the first.
    pub ended_at: Timestamp,
    /// Height, millimetres, 0 to 1,000,000.
    pub height_mm: u32,
    /// Path with the cameras that saw it, encoded by others: 1 to 65,536 bytes.
    pub path: Vec<u8>,
}

/// A span that begins or goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpanChange {
    /// Number of the span that goes on; none of one that begins.
    pub id: Option<i64>,
    /// Scene time of its beginning.
    pub began_at: Timestamp,
    /// Scene time of its end.
    pub ended_at: Timestamp,
}

type Row = (i64, i64, i64, i64, Vec<u8>);

impl EntitySet {
    /// Returns the set of these cameras, in the scene's order.
    #[must_use]
    pub fn new<'a>(scene: &str, cameras: impl Iterator<Item = &'a CameraId>) -> Self {
        let cameras: Vec<&str> = cameras.map(CameraId::as_str).collect();
        Self { scene: scene.to_owned(), cameras: cameras.join(",") }
    }
}

impl Store {
    /// Adds sightings to a span, each in place of the one of the same beginning and id, and lets the span reach further: all of it or
    /// nothing. A power cut may take the last ones. Returns the span's number.
    ///
    /// # Errors
    /// When the database fails, or a record does not keep to its ranges.
    pub async fn put_entities(
        &self,
        set: &EntitySet,
        span: &SpanChange,
        records: &[EntityRecord],
    ) -> Result<i64, StoreError> {
        self.write_entities(set, span, records).await.map_err(|error| self.classify(error))
    }

    async fn write_entities(
        &self,
        set: &EntitySet,
        span: &SpanChange,
        records: &[EntityRecord],
    ) -> Result<i64, sqlx::Error> {
        let mut transaction = self.cache.begin_with("begin immediate").await?;
        let set_id: i64 = sqlx::query_scalar(
            "insert into entity_set (scene, cameras, next_id) values (?1, ?2, 1)
             on conflict (scene, cameras) do update set next_id = next_id
             returning id",
        )
        .bind(&set.scene)
        .bind(&set.cameras)
        .fetch_one(&mut *transaction)
        .await?;
        // One that retention removed meanwhile begins anew.
        let known: Option<i64> = sqlx::query_scalar(
            "update entity_span set ended_at = max(ended_at, ?3) where id = ?1 and entity_set = ?2 returning id",
        )
        .bind(span.id)
        .bind(set_id)
        .bind(span.ended_at.as_nanos())
        .fetch_optional(&mut *transaction)
        .await?;
        let span_id = match known {
            Some(id) => id,
            None => sqlx::query_scalar(
                "insert into entity_span (entity_set, began_at, ended_at) values (?1, ?2, ?3) returning id",
            )
            .bind(set_id)
            .bind(span.began_at.as_nanos())
            .bind(span.ended_at.as_nanos())
            .fetch_one(&mut *transaction)
            .await?,
        };
        for record in records {
            insert(&mut transaction, span_id, record).await?;
        }
        transaction.commit().await?;
        Ok(span_id)
    }

    /// Hands out `count` ids of a set, and returns the first of them: nobody else gets one of these, also after a crash.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn reserve_entity_ids(&self, set: &EntitySet, count: u32) -> Result<u64, StoreError> {
        let next: i64 = sqlx::query_scalar(
            "insert into entity_set (scene, cameras, next_id) values (?1, ?2, 1 + ?3)
             on conflict (scene, cameras) do update set next_id = next_id + ?3
             returning next_id",
        )
        .bind(&set.scene)
        .bind(&set.cameras)
        .bind(count)
        .fetch_one(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(u64::try_from(next - i64::from(count)).unwrap_or(1))
    }

    /// Returns the spans of a set that reach into a time, the one begun last first; 4096 at most.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn entity_spans(
        &self,
        set: &EntitySet,
        (from, to): (Timestamp, Timestamp),
    ) -> Result<Vec<EntitySpan>, StoreError> {
        let rows: Vec<(i64, i64, i64)> = sqlx::query_as(
            "select id, began_at, ended_at from entity_span
             where entity_set = (select id from entity_set where scene = ?1 and cameras = ?2)
                 and ended_at >= ?3 and began_at <= ?4
             order by id desc limit ?5",
        )
        .bind(&set.scene)
        .bind(&set.cameras)
        .bind(from.as_nanos())
        .bind(to.as_nanos())
        .bind(SPANS_KEPT)
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let span = |(id, began_at, ended_at)| EntitySpan {
            id,
            began_at: Timestamp::from_nanos(began_at),
            ended_at: Timestamp::from_nanos(ended_at),
        };
        Ok(rows.into_iter().map(span).collect())
    }

    /// Returns the sightings of a span that reach into a time, in growing order of beginning and id, `limit` at most.
    ///
    /// # Errors
    /// When the database fails, or a row cannot be read.
    pub async fn entities(
        &self,
        span: i64,
        (from, to): (Timestamp, Timestamp),
        limit: u32,
    ) -> Result<Vec<EntityRecord>, StoreError> {
        // None that reaches into the time begins further before it than the longest is long.
        let rows: Vec<Row> = sqlx::query_as(
            "select id, began_at, ended_at, height_mm, path from entity
             where entity_span = ?1 and began_at <= ?3 and ended_at >= ?2
                 and began_at >= ?2 - coalesce(
                     (select max(ended_at - began_at) from entity where entity_span = ?1), 0)
             order by began_at, id limit ?4",
        )
        .bind(span)
        .bind(from.as_nanos())
        .bind(to.as_nanos())
        .bind(limit)
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let unreadable =
            || StoreError::UnreadableRow { path: self.path.clone(), what: "a number of an entity" };
        rows.into_iter().map(|row| read(row).ok_or_else(unreadable)).collect()
    }

    /// Removes what is older than `max_nanos` by the clock's `now`, or, of sets with one of the `steady` cameras, whose scene time is
    /// not the clock's, behind the set's newest; and what is too much. Returns how many sightings went.
    ///
    /// # Errors
    /// When the database fails; what went before is gone then.
    pub(super) async fn forget_old_entities(
        &self,
        max_nanos: i64,
        now: Timestamp,
        steady: &[CameraId],
    ) -> Result<u64, StoreError> {
        self.remove_old_entities((max_nanos, ROWS_KEPT), now, steady)
            .await
            .map_err(|error| self.classify(error))
    }

    async fn remove_old_entities(
        &self,
        (max_nanos, rows_kept): (i64, i64),
        now: Timestamp,
        steady: &[CameraId],
    ) -> Result<u64, sqlx::Error> {
        let sets: Vec<(i64, String)> =
            sqlx::query_as("select id, cameras from entity_set").fetch_all(&self.cache).await?;
        let mut n_gone = 0;
        for (set, cameras) in sets {
            let is_steady =
                cameras.split(',').any(|camera| steady.iter().any(|steady| steady.as_str() == camera));
            let newest: Option<i64> = if is_steady {
                sqlx::query_scalar("select max(ended_at) from entity_span where entity_set = ?1")
                    .bind(set)
                    .fetch_one(&self.cache)
                    .await?
            } else {
                Some(now.as_nanos())
            };
            let Some(newest) = newest else { continue };
            let oldest = self.oldest_kept(set, rows_kept).await?;
            let least = newest.saturating_sub(max_nanos).max(oldest);
            n_gone += sqlx::query(
                "delete from entity where ended_at < ?2
                     and entity_span in (select id from entity_span where entity_set = ?1)",
            )
            .bind(set)
            .bind(least)
            .execute(&self.cache)
            .await?
            .rows_affected();
            // A span that began before is no longer known from its beginning.
            sqlx::query("delete from entity_span where entity_set = ?1 and ended_at < ?2")
                .bind(set)
                .bind(least)
                .execute(&self.cache)
                .await?;
            sqlx::query("update entity_span set began_at = ?2 where entity_set = ?1 and began_at < ?2")
                .bind(set)
                .bind(least)
                .execute(&self.cache)
                .await?;
            self.remove_further_spans(set).await?;
        }
        self.remove_further_sets().await?;
        Ok(n_gone)
    }

    /// Removes the spans of a set of which nothing counts, since one begun later has all of their time, and those beyond what is kept.
    async fn remove_further_spans(&self, set: i64) -> Result<(), sqlx::Error> {
        sqlx::query(
            "delete from entity_span where entity_set = ?1 and (
                 exists (
                     select 1 from entity_span as later where later.entity_set = ?1 and later.id > entity_span.id
                         and later.began_at <= entity_span.began_at and later.ended_at >= entity_span.ended_at)
                 or id <= (select id from entity_span where entity_set = ?1 order by id desc limit 1 offset ?2))",
        )
        .bind(set)
        .bind(SPANS_KEPT)
        .execute(&self.cache)
        .await?;
        Ok(())
    }

    /// Returns the end of the oldest of the newest `rows_kept` sightings of a set; the beginning of time where there are fewer.
    async fn oldest_kept(&self, set: i64, rows_kept: i64) -> Result<i64, sqlx::Error> {
        let oldest: Option<i64> = sqlx::query_scalar(
            "select ended_at from entity
             where entity_span in (select id from entity_span where entity_set = ?1)
             order by ended_at desc limit 1 offset ?2",
        )
        .bind(set)
        .bind(rows_kept - 1)
        .fetch_optional(&self.cache)
        .await?;
        Ok(oldest.unwrap_or(i64::MIN))
    }

    /// Removes the sets beyond those that are kept of each scene.
    async fn remove_further_sets(&self) -> Result<(), sqlx::Error> {
        sqlx::query(
            "delete from entity_set where id in (
                 select id from (
                     select entity_set.id as id, row_number() over (
                         partition by scene
                         order by (select max(entity_span.id) from entity_span where entity_set = entity_set.id) desc
                     ) as place from entity_set
                 ) where place > ?1)",
        )
        .bind(SETS_KEPT)
        .execute(&self.cache)
        .await?;
        Ok(())
    }
}

async fn insert(
    connection: &mut SqliteConnection,
    span: i64,
    record: &EntityRecord,
) -> Result<(), sqlx::Error> {
    sqlx::query(
        "insert into entity (entity_span, began_at, ended_at, id, height_mm, path)
         values (?1, ?2, ?3, ?4, ?5, ?6)
         on conflict (entity_span, began_at, id) do update set
             ended_at = excluded.ended_at, height_mm = excluded.height_mm, path = excluded.path",
    )
    .bind(span)
    .bind(record.began_at.as_nanos())
    .bind(record.ended_at.as_nanos())
    .bind(i64::try_from(record.id).unwrap_or(i64::MAX))
    .bind(record.height_mm)
    .bind(record.path.as_slice())
    .execute(connection)
    .await?;
    Ok(())
}

/// Returns the record of a row; none where a number is out of its range.
fn read((id, began_at, ended_at, height_mm, path): Row) -> Option<EntityRecord> {
    Some(EntityRecord {
        id: u64::try_from(id).ok()?,
        began_at: Timestamp::from_nanos(began_at),
        ended_at: Timestamp::from_nanos(ended_at),
        height_mm: u32::try_from(height_mm).ok()?,
        path,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    const DAY: i64 = 86_400;

    fn secs(secs: i64) -> Timestamp {
        Timestamp::from_nanos(secs * 1_000_000_000)
    }

    fn camera(id: &str) -> CameraId {
        CameraId::new(id).unwrap()
    }

    fn set(cameras: &[&str]) -> EntitySet {
        let cameras: Vec<CameraId> = cameras.iter().map(|id| camera(id)).collect();
        EntitySet::new("yard", cameras.iter())
    }

    fn record(id: u64, began: i64, ended: i64) -> EntityRecord {
        let path = vec![1, id as u8];
        EntityRecord { id, began_at: secs(began), ended_at: secs(ended), height_mm: 1700, path }
    }

    fn change(id: Option<i64>, began: i64, ended: i64) -> SpanChange {
        SpanChange { id, began_at: secs(began), ended_at: secs(ended) }
    }

    async fn store(folder: &TempDir) -> Store {
        Store::open(&folder.path().join("test.sqlite")).await.unwrap()
    }

    async fn ids(store: &Store, span: i64, from: i64, to: i64) -> Vec<u64> {
        let found = store.entities(span, (secs(from), secs(to)), 99).await.unwrap();
        found.iter().map(|of| of.id).collect()
    }

    #[tokio::test]
    async fn a_span_goes_on_and_its_entities_are_found_by_time() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let all = set(&["north", "south"]);
        let span = store.put_entities(&all, &change(None, 0, 10), &[record(1, 0, 9)]).await.unwrap();
        let longer = [record(1, 0, 900), record(2, 5, 12)];
        assert_eq!(store.put_entities(&all, &change(Some(span), 0, 1000), &longer).await.unwrap(), span);
        let (one, two) = (ids(&store, span, 13, 2000).await, ids(&store, span, 9, 12).await);
        assert_eq!((one, two), (vec![1], vec![1, 2]));
        assert!(ids(&store, span, 901, 2000).await.is_empty());
        assert_eq!(ids(&store, span, -9, 4).await, [1]);
        assert_eq!(store.entities(span, (secs(0), secs(99)), 1).await.unwrap(), longer[..1]);
        let spans = store.entity_spans(&all, (secs(1000), secs(2000))).await.unwrap();
        assert_eq!(spans, [EntitySpan { id: span, began_at: secs(0), ended_at: secs(1000) }]);
        assert_eq!(store.entity_spans(&all, (secs(1001), secs(2000))).await.unwrap(), []);
        assert_eq!(store.entity_spans(&set(&["north"]), (secs(0), secs(2000))).await.unwrap(), []);
        let later = store.put_entities(&all, &change(None, 100, 200), &[]).await.unwrap();
        let spans = store.entity_spans(&all, (secs(0), secs(2000))).await.unwrap();
        assert_eq!(spans.iter().map(|of| of.id).collect::<Vec<_>>(), [later, span]);
    }

    #[tokio::test]
    async fn no_id_is_given_twice_and_sets_do_not_mix() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let (all, part) = (set(&["north", "south"]), set(&["north"]));
        assert_eq!(store.reserve_entity_ids(&all, 40).await.unwrap(), 1);
        store.put_entities(&all, &change(None, 0, 1), &[]).await.unwrap();
        assert_eq!(store.reserve_entity_ids(&all, 8).await.unwrap(), 41);
        assert_eq!(store.reserve_entity_ids(&all, 8).await.unwrap(), 49);
        let span = store.put_entities(&part, &change(None, 0, 9), &[record(1, 0, 9)]).await.unwrap();
        // A span of another set does not go on.
        let other = store.put_entities(&all, &change(Some(span), 0, 9), &[]).await.unwrap();
        assert_ne!(other, span);
        assert!(ids(&store, other, 0, 9).await.is_empty());
        let refused = EntityRecord { path: Vec::new(), ..record(3, 0, 9) };
        store.put_entities(&part, &change(Some(span), 0, 99), &[record(2, 0, 9), refused]).await.unwrap_err();
        assert_eq!(ids(&store, span, 0, 99).await, [1], "all or nothing");
        assert_eq!(store.reserve_entity_ids(&part, 1).await.unwrap(), 1, "each set counts its own");
        assert_eq!(store.entity_spans(&part, (secs(10), secs(99))).await.unwrap(), []);
    }

    #[tokio::test]
    async fn what_is_too_old_too_much_or_of_sets_long_unused_goes() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let (live, film) = (set(&["gate"]), set(&["gate", "film"]));
        let now = secs(100 * DAY);
        store.reserve_entity_ids(&film, 7).await.unwrap();
        let mut spans = Vec::new();
        for (of, newest) in [(&live, 100), (&film, 3)] {
            for age in [0, 1, 9] {
                let began = (newest - age) * DAY;
                let written = [record(1, began - 20, began - 10), record(2, began - 5, began)];
                let span = store.put_entities(of, &change(None, began - 30, began), &written).await;
                spans.push(span.unwrap());
            }
        }
        let n_gone =
            store.forget_old_entities(2 * DAY * 1_000_000_000, now, &[camera("film")]).await.unwrap();
        assert_eq!(n_gone, 4);
        for (i, span) in spans.iter().enumerate() {
            let expected: &[u64] = if i % 3 == 2 { &[] } else { &[1, 2] };
            assert_eq!(ids(&store, *span, -9 * DAY, 200 * DAY).await, expected, "{i}");
        }
        assert_eq!(store.entity_spans(&film, (secs(-99 * DAY), secs(99 * DAY))).await.unwrap().len(), 2);
        // Three sightings of each set are kept: the oldest span begins where what is kept does.
        store.remove_old_entities((50 * DAY * 1_000_000_000, 3), now, &[camera("film")]).await.unwrap();
        assert_eq!(ids(&store, spans[1], 0, 200 * DAY).await, [2]);
        let left = store.entity_spans(&live, (secs(0), now)).await.unwrap();
        assert_eq!(left[0].began_at, secs(99 * DAY));
        // A film that nobody plays any more is as old as the clock says.
        store.forget_old_entities(50 * DAY * 1_000_000_000, now, &[]).await.unwrap();
        assert_eq!(store.entity_spans(&film, (secs(-99 * DAY), secs(99 * DAY))).await.unwrap(), []);
        assert_eq!(store.reserve_entity_ids(&film, 1).await.unwrap(), 8, "ids are not given again");
        for number in 0..SETS_KEPT {
            let other = set(&[&format!("c{number}")]);
            store.put_entities(&other, &change(None, 0, 1), &[]).await.unwrap();
        }
        store.forget_old_entities(i64::MAX, now, &[]).await.unwrap();
        assert_eq!(store.entity_spans(&live, (secs(0), now)).await.unwrap(), [], "the one used longest ago");
        assert_eq!(store.entity_spans(&set(&["c0"]), (secs(0), now)).await.unwrap().len(), 1);
    }

    #[tokio::test]
    async fn spans_whose_time_a_later_one_has_go_and_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let store = store(&folder).await;
        let all = set(&["gate"]);
        let mut put = Vec::new();
        for (began, ended) in [(0, 10), (20, 30), (5, 15), (18, 40), (0, 10)] {
            put.push(
                store
                    .put_entities(&all, &change(None, began, ended), &[record(1, began, ended)])
                    .await
                    .unwrap(),
            );
        }
        store.forget_old_entities(i64::MAX, secs(50), &[]).await.unwrap();
        let left = store.entity_spans(&all, (secs(0), secs(50))).await.unwrap();
        assert_eq!(left.iter().map(|of| of.id).collect::<Vec<_>>(), [put[4], put[3], put[2]]);
        assert!(ids(&store, put[0], 0, 50).await.is_empty() && ids(&store, put[2], 0, 50).await == [1]);
    }
}
