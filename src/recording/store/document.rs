//! Table `document`: what people keep through the API, with its versions. Cannot be rebuilt, so a write is on disk when it
//! is acknowledged.

use super::{Store, StoreError, check_size};
use videofields_vision::clock::Timestamp;

/// Versions that are kept of one document; the oldest go first, but never the newest.
pub const MAX_VERSIONS: i64 = 200;

/// Bytes of one document's versions together, as of [`MAX_VERSIONS`].
pub const MAX_VERSIONS_BYTES: i64 = 32 << 20;

/// What kind of thing a document describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum DocumentKind {
    /// A scene.
    Scene,
    /// A view of a scene.
    View,
    /// A wall of screens.
    Wall,
    /// What was changed of a camera.
    Camera,
    /// A playhead.
    Playhead,
}

impl DocumentKind {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Scene, Self::View, Self::Wall, Self::Camera, Self::Playhead];

    /// As answers and the table have it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::View => "view",
            Self::Wall => "wall",
            Self::Camera => "camera",
            Self::Playhead => "playhead",
        }
    }
}

/// A document as one change left it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DocumentRecord {
    /// What it is called.
    pub id: String,
    /// 1 at first, and one more with every change.
    pub version: i64,
    /// JSON; none where the change removed it.
    pub document: Option<String>,
    /// When it was changed so.
    pub changed_at: Timestamp,
    /// Who changed it so; none where there are no users.
    pub changed_by: Option<String>,
}

type Row = (String, i64, Option<String>, i64, Option<String>);

impl From<Row> for DocumentRecord {
    fn from((id, version, document, changed_at, changed_by): Row) -> Self {
        Self { id, version, document, changed_at: Timestamp::from_nanos(changed_at), changed_by }
    }
}

impl Store {
    /// Adds a version after version `record.version - 1`, which must be the newest (0: there must be none), and answers whether
    /// it was. The oldest beyond [`MAX_VERSIONS`] and [`MAX_VERSIONS_BYTES`] go.
    ///
    /// # Errors
    /// When the document is no JSON or too large, or the database fails.
    #[tracing::instrument(level = "debug", name = "store", skip_all, fields(what = "add_document"))]
    pub async fn add_document(
        &self,
        kind: DocumentKind,
        record: &DocumentRecord,
    ) -> Result<bool, StoreError> {
        check_size("the document", record.document.as_deref().unwrap_or_default().as_bytes())?;
        let mut transaction = self.durable.begin().await.map_err(|error| self.classify(error))?;
        let done = sqlx::query(
            "insert into document (kind, id, version, document, changed_at, changed_by)
             select ?, ?, ?, ?, ?, ?
             where ? = coalesce((select max(version) from document where kind = ? and id = ?), 0) + 1",
        )
        .bind(kind.as_str())
        .bind(&record.id)
        .bind(record.version)
        .bind(&record.document)
        .bind(record.changed_at.as_nanos())
        .bind(&record.changed_by)
        .bind(record.version)
        .bind(kind.as_str())
        .bind(&record.id)
        .execute(&mut *transaction)
        .await
        .map_err(|error| self.classify(error))?;
        if done.rows_affected() == 0 {
            return Ok(false);
        }
        let prune = "delete from document where kind = ?1 and id = ?2 and version < ?3 and version in (
                 select version from (
                     select version, sum(coalesce(length(document), 0)) over (order by version desc) as bytes
                     from document where kind = ?1 and id = ?2
                 ) where version <= ?3 - ?4 or bytes > ?5
             )";
        sqlx::query(prune)
            .bind(kind.as_str())
            .bind(&record.id)
            .bind(record.version)
            .bind(MAX_VERSIONS)
            .bind(MAX_VERSIONS_BYTES)
            .execute(&mut *transaction)
            .await
            .map_err(|error| self.classify(error))?;
        transaction.commit().await.map_err(|error| self.classify(error))?;
        Ok(true)
    }

    /// The newest version of every document of a kind, those removed too, in the order of ids.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn newest_documents(&self, kind: DocumentKind) -> Result<Vec<DocumentRecord>, StoreError> {
        let rows: Vec<Row> = sqlx::query_as(
            "select id, version, document, changed_at, changed_by from document as newest
             where kind = ? and version =
                 (select max(version) from document where kind = newest.kind and id = newest.id)
             order by id",
        )
        .bind(kind.as_str())
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(rows.into_iter().map(DocumentRecord::from).collect())
    }

    /// Forgets a document with all of its versions.
    ///
    /// # Errors
    /// When the database fails.
    #[tracing::instrument(level = "debug", name = "store", skip_all, fields(what = "forget_document"))]
    pub async fn forget_document(&self, kind: DocumentKind, id: &str) -> Result<(), StoreError> {
        sqlx::query("delete from document where kind = ? and id = ?")
            .bind(kind.as_str())
            .bind(id)
            .execute(&self.durable)
            .await
            .map_err(|error| self.classify(error))?;
        Ok(())
    }

    /// Numbers of the newest `limit` versions of a document before version `before`, the newest first, with when and by whom
    /// each was made, and whether it removed the document.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn document_changes(
        &self,
        kind: DocumentKind,
        id: &str,
        before: i64,
        limit: u32,
    ) -> Result<Vec<(i64, Timestamp, Option<String>, bool)>, StoreError> {
        type Row = (i64, i64, Option<String>, bool);
        let rows: Vec<Row> = sqlx::query_as(
            "select version, changed_at, changed_by, document is null from document
             where kind = ? and id = ? and version < ? order by version desc limit ?",
        )
        .bind(kind.as_str())
        .bind(id)
        .bind(before)
        .bind(limit)
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let change = |(version, at, by, removed)| (version, Timestamp::from_nanos(at), by, removed);
        Ok(rows.into_iter().map(change).collect())
    }

    /// The newest `limit` versions of a document before version `before`, the newest first.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn document_versions(
        &self,
        kind: DocumentKind,
        id: &str,
        before: i64,
        limit: u32,
    ) -> Result<Vec<DocumentRecord>, StoreError> {
        let rows: Vec<Row> = sqlx::query_as(
            "select id, version, document, changed_at, changed_by from document
             where kind = ? and id = ? and version < ? order by version desc limit ?",
        )
        .bind(kind.as_str())
        .bind(id)
        .bind(before)
        .bind(limit)
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(rows.into_iter().map(DocumentRecord::from).collect())
    }
}
