//! Table `scene`: the scene documents. Cannot be rebuilt, so a write is on disk when it is acknowledged.

use super::{Store, StoreError, check_size, digest_hex};
use videofields_vision::clock::Timestamp;

/// A scene document as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneRecord {
    /// Id by which the API names it.
    pub id: String,
    /// The document, JSON.
    pub document: String,
    /// SHA-256 of the document, lower-case hexadecimal.
    pub digest: String,
    /// When it was written.
    pub updated_at: Timestamp,
}

/// A scene without its document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneEntry {
    /// Id by which the API names it.
    pub id: String,
    /// SHA-256 of the document, lower-case hexadecimal.
    pub digest: String,
    /// When it was written.
    pub updated_at: Timestamp,
}

impl Store {
    /// Writes a document in place of the one that was there, and answers its digest. An equal document is left
    /// as it is, with its time.
    ///
    /// # Errors
    /// When the document is no JSON or too large, or the database fails.
    pub async fn put_scene(&self, id: &str, document: &str, now: Timestamp) -> Result<String, StoreError> {
        check_size("the scene document", document.as_bytes())?;
        let digest = digest_hex(document.as_bytes());
        sqlx::query(
            "insert into scene (id, document, digest, updated_at) values (?, ?, ?, ?)
             on conflict (id) do update set
                 document = excluded.document, digest = excluded.digest, updated_at = excluded.updated_at
             where digest <> excluded.digest",
        )
        .bind(id)
        .bind(document)
        .bind(&digest)
        .bind(now.as_nanos())
        .execute(&self.durable)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(digest)
    }

    /// The document of a scene, if there is one.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn scene(&self, id: &str) -> Result<Option<SceneRecord>, StoreError> {
        let row: Option<(String, String, String, i64)> =
            sqlx::query_as("select id, document, digest, updated_at from scene where id = ?")
                .bind(id)
                .fetch_optional(&self.cache)
                .await
                .map_err(|error| self.classify(error))?;
        Ok(row.map(|(id, document, digest, nanos)| SceneRecord {
            id,
            document,
            digest,
            updated_at: Timestamp::from_nanos(nanos),
        }))
    }

    /// All scenes by id, without their documents.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn scenes(&self) -> Result<Vec<SceneEntry>, StoreError> {
        let rows: Vec<(String, String, i64)> =
            sqlx::query_as("select id, digest, updated_at from scene order by id")
                .fetch_all(&self.cache)
                .await
                .map_err(|error| self.classify(error))?;
        let entry = |(id, digest, nanos)| SceneEntry { id, digest, updated_at: Timestamp::from_nanos(nanos) };
        Ok(rows.into_iter().map(entry).collect())
    }

    /// Removes a scene and answers whether there was one.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn delete_scene(&self, id: &str) -> Result<bool, StoreError> {
        let done = sqlx::query("delete from scene where id = ?")
            .bind(id)
            .execute(&self.durable)
            .await
            .map_err(|error| self.classify(error))?;
        Ok(done.rows_affected() > 0)
    }
}
