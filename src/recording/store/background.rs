//! Table `background`: what cameras learned of their backgrounds. A power cut may lose the last checkpoint; the
//! one before it is kept then.

use super::{Store, StoreError, check_size};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, ColorMatrix};

/// Picture sizes that are kept of one camera: one that changes between day and night finds each again.
const SIZES_KEPT: i64 = 4;

/// An encoded background.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BackgroundRecord {
    /// Whose it is.
    pub camera: CameraId,
    /// Scene time of the last frame that was learned.
    pub saved_at: Timestamp,
    /// Columns of the camera's picture.
    pub width: u32,
    /// Rows of the camera's picture.
    pub height: u32,
    /// Colour matrix of the camera's picture.
    pub matrix: ColorMatrix,
    /// Version of the encoding of `bytes`.
    pub version: u32,
    /// The encoded mixture.
    pub bytes: Vec<u8>,
}

/// A row: `saved_at`, `width`, `height`, `matrix`, `version`, `bytes`.
pub(super) type Row = (i64, u32, u32, String, u32, Vec<u8>);

impl Store {
    /// Writes a camera's background in place of the one of the same picture size. Of other sizes the three
    /// latest are kept.
    ///
    /// # Errors
    /// When it is too large, or the database fails.
    pub async fn put_background(&self, record: &BackgroundRecord) -> Result<(), StoreError> {
        check_size("the background", &record.bytes)?;
        self.write_background(record).await.map_err(|error| self.classify(error))
    }

    async fn write_background(&self, record: &BackgroundRecord) -> Result<(), sqlx::Error> {
        // Begun as a writer: a reader that turns writer late cannot wait for another writer.
        let mut transaction = self.cache.begin_with("begin immediate").await?;
        sqlx::query(
            "insert into background (camera, width, height, matrix, version, saved_at, bytes)
             values (?, ?, ?, ?, ?, ?, ?)
             on conflict (camera, width, height) do update set
                 matrix = excluded.matrix, version = excluded.version, saved_at = excluded.saved_at,
                 bytes = excluded.bytes",
        )
        .bind(record.camera.as_str())
        .bind(record.width)
        .bind(record.height)
        .bind(name_of(record.matrix))
        .bind(record.version)
        .bind(record.saved_at.as_nanos())
        .bind(record.bytes.as_slice())
        .execute(&mut *transaction)
        .await?;
        // The one just written stays, whatever its time: clocks step and clips begin again.
        sqlx::query(
            "delete from background where rowid in (
                 select rowid from background where camera = ?1
                 order by (width = ?2 and height = ?3) desc, saved_at desc limit -1 offset ?4)",
        )
        .bind(record.camera.as_str())
        .bind(record.width)
        .bind(record.height)
        .bind(SIZES_KEPT)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await
    }

    /// A camera's latest background, whatever its picture size.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn latest_background(&self, camera: &CameraId) -> Result<Option<BackgroundRecord>, StoreError> {
        let row: Option<Row> = sqlx::query_as(
            "select saved_at, width, height, matrix, version, bytes from background
             where camera = ? order by saved_at desc limit 1",
        )
        .bind(camera.as_str())
        .fetch_optional(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        row.map(|row| self.background_record(camera, row)).transpose()
    }

    /// A camera's background for pictures of one size.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn background(
        &self,
        camera: &CameraId,
        width: u32,
        height: u32,
    ) -> Result<Option<BackgroundRecord>, StoreError> {
        let row: Option<Row> = sqlx::query_as(
            "select saved_at, width, height, matrix, version, bytes from background
             where camera = ? and width = ? and height = ?",
        )
        .bind(camera.as_str())
        .bind(width)
        .bind(height)
        .fetch_optional(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        row.map(|row| self.background_record(camera, row)).transpose()
    }

    pub(super) fn background_record(
        &self,
        camera: &CameraId,
        row: Row,
    ) -> Result<BackgroundRecord, StoreError> {
        let (nanos, width, height, matrix, version, bytes) = row;
        let matrix = matrix_of(&matrix).ok_or_else(|| StoreError::UnreadableRow {
            path: self.path.clone(),
            what: "the colour matrix",
        })?;
        let saved_at = Timestamp::from_nanos(nanos);
        Ok(BackgroundRecord { camera: camera.clone(), saved_at, width, height, matrix, version, bytes })
    }
}

pub(super) const fn name_of(matrix: ColorMatrix) -> &'static str {
    match matrix {
        ColorMatrix::Bt601 => "bt601",
        ColorMatrix::Bt709 => "bt709",
        ColorMatrix::Bt2020 => "bt2020",
    }
}

fn matrix_of(name: &str) -> Option<ColorMatrix> {
    [ColorMatrix::Bt601, ColorMatrix::Bt709, ColorMatrix::Bt2020]
        .into_iter()
        .find(|matrix| name_of(*matrix) == name)
}
