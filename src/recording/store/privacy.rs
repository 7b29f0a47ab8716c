//! Table `privacy`: what nobody may see of the cameras' pictures, with its versions. Cannot be rebuilt, so a write is on disk
//! when it is acknowledged.

use super::{Store, StoreError, check_size};
use videofields_vision::clock::Timestamp;

/// Versions that are kept of one camera; the oldest go first.
const MAX_VERSIONS: i64 = 200;

/// A camera's zones as one change left them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PrivacyRecord {
    /// The camera.
    pub camera: String,
    /// 1 at first, and one more with every change.
    pub version: i64,
    /// The zones that were asked for, JSON; none where those of the configuration hold.
    pub zones: Option<String>,
    /// The zones that came in force, JSON.
    pub in_force: String,
    /// Zones that were in force before, and until when, JSON.
    pub lifted: String,
    /// When it was changed so.
    pub changed_at: Timestamp,
    /// Who changed it so; none where there are no users, and where the configuration was changed.
    pub changed_by: Option<String>,
}

type Row = (String, i64, Option<String>, String, String, i64, Option<String>);

impl From<Row> for PrivacyRecord {
    fn from((camera, version, zones, in_force, lifted, changed_at, changed_by): Row) -> Self {
        let changed_at = Timestamp::from_nanos(changed_at);
        Self { camera, version, zones, in_force, lifted, changed_at, changed_by }
    }
}

impl Store {
    /// Adds a version, which must be later than every other of the camera, and answers whether it was: another process may
    /// have been faster. The oldest beyond 200 go.
    ///
    /// # Errors
    /// When a list is no JSON or too large, or the database fails.
    pub async fn add_privacy(&self, record: &PrivacyRecord) -> Result<bool, StoreError> {
        check_size("the zones", record.in_force.as_bytes())?;
        let mut transaction = self.durable.begin().await.map_err(|error| self.classify(error))?;
        let done = sqlx::query(
            "insert into privacy (camera, version, zones, in_force, lifted, changed_at, changed_by)
             select ?1, ?2, ?3, ?4, ?5, ?6, ?7
             where ?2 > coalesce((select max(version) from privacy where camera = ?1), 0)",
        )
        .bind(&record.camera)
        .bind(record.version)
        .bind(&record.zones)
        .bind(&record.in_force)
        .bind(&record.lifted)
        .bind(record.changed_at.as_nanos())
        .bind(&record.changed_by)
        .execute(&mut *transaction)
        .await
        .map_err(|error| self.classify(error))?;
        if done.rows_affected() == 0 {
            return Ok(false);
        }
        sqlx::query("delete from privacy where camera = ? and version <= ?")
            .bind(&record.camera)
            .bind(record.version - MAX_VERSIONS)
            .execute(&mut *transaction)
            .await
            .map_err(|error| self.classify(error))?;
        transaction.commit().await.map_err(|error| self.classify(error))?;
        Ok(true)
    }

    /// The newest version of every camera, in the order of ids.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn newest_privacy(&self) -> Result<Vec<PrivacyRecord>, StoreError> {
        let rows: Vec<Row> = sqlx::query_as(
            "select camera, version, zones, in_force, lifted, changed_at, changed_by from privacy as newest
             where version = (select max(version) from privacy where camera = newest.camera) order by camera",
        )
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(rows.into_iter().map(PrivacyRecord::from).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn versions_grow_and_the_newest_is_found_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.sqlite");
        let store = Store::open(&path).await.unwrap();
        let record = |camera: &str, version: i64| PrivacyRecord {
            camera: camera.to_owned(),
            version,
            zones: (version % 2 == 1).then(|| format!("[{version}]")),
            in_force: format!("[{version}]"),
            lifted: "[]".to_owned(),
            changed_at: Timestamp::from_nanos(version),
            changed_by: Some("ann".to_owned()),
        };
        for (camera, version, is_taken) in [
            ("north", 1, true),
            ("north", 1, false),
            ("north", 3, true),
            ("north", 2, false),
            ("east", 7, true),
        ] {
            assert_eq!(
                store.add_privacy(&record(camera, version)).await.unwrap(),
                is_taken,
                "{camera} {version}"
            );
        }
        store.close().await.unwrap();
        let store = Store::open(&path).await.unwrap();
        assert_eq!(store.newest_privacy().await.unwrap(), [record("east", 7), record("north", 3)]);
        assert!(
            store
                .add_privacy(&PrivacyRecord { in_force: "no JSON".to_owned(), ..record("east", 8) })
                .await
                .is_err()
        );
        for version in 8..=300 {
            assert!(store.add_privacy(&record("east", version)).await.unwrap());
        }
        let n: i64 = sqlx::query_scalar("select count(*) from privacy where camera = 'east'")
            .fetch_one(&store.cache)
            .await
            .unwrap();
        assert_eq!(n, MAX_VERSIONS);
    }
}
