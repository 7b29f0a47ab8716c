//! Table `texture_map`: texture-to-world maps under the digest of all that they were built from. A cache, bounded
//! in bytes: the one used longest ago goes first.

use super::{Store, StoreError, check_size};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;

/// An encoded texture-to-world map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TextureMapRecord {
    /// SHA-256 of calibration, surfaces and builder's settings.
    pub digest: [u8; 32],
    /// The scene it was built for.
    pub scene: String,
    /// The camera it was built for.
    pub camera: CameraId,
    /// When it was built.
    pub created_at: Timestamp,
    /// The encoded map.
    pub bytes: Vec<u8>,
}

impl Store {
    /// Keeps a map, and lets those go that were used longest ago while all together are larger than the bound.
    ///
    /// # Errors
    /// When it alone is larger than the bound, or the database fails.
    pub async fn put_texture_map(&self, record: &TextureMapRecord) -> Result<(), StoreError> {
        check_size("the texture-to-world map", &record.bytes)?;
        let bytes = record.bytes.len() as u64;
        if bytes > self.texture_maps_bytes {
            let most = self.texture_maps_bytes;
            return Err(StoreError::TooLarge { what: "the texture-to-world map", bytes, most });
        }
        self.write_texture_map(record).await.map_err(|error| self.classify(error))
    }

    async fn write_texture_map(&self, record: &TextureMapRecord) -> Result<(), sqlx::Error> {
        let mut transaction = self.cache.begin_with("begin immediate").await?;
        sqlx::query(
            "insert into texture_map (digest, scene, camera, created_at, used, bytes)
             values (?, ?, ?, ?, (select coalesce(max(used), 0) + 1 from texture_map), ?)
             on conflict (digest) do update set
                 scene = excluded.scene, camera = excluded.camera, created_at = excluded.created_at,
                 used = excluded.used, bytes = excluded.bytes",
        )
        .bind(record.digest.as_slice())
        .bind(&record.scene)
        .bind(record.camera.as_str())
        .bind(record.created_at.as_nanos())
        .bind(record.bytes.as_slice())
        .execute(&mut *transaction)
        .await?;
        sqlx::query(
            "delete from texture_map where digest in (
                 select digest from (
                     select digest, sum(length(bytes)) over (order by used desc) as total from texture_map)
                 where total > ?)",
        )
        .bind(i64::try_from(self.texture_maps_bytes).unwrap_or(i64::MAX))
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await
    }

    /// The map with this digest, if it is kept; it counts as used.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn texture_map(&self, digest: &[u8; 32]) -> Result<Option<TextureMapRecord>, StoreError> {
        // One statement reads and notes the use, so no other connection can come between.
        let row: Option<(String, String, i64, Vec<u8>)> = sqlx::query_as(
            "update texture_map set used = (select max(used) + 1 from texture_map) where digest = ?
             returning scene, camera, created_at, bytes",
        )
        .bind(digest.as_slice())
        .fetch_optional(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let Some((scene, camera, nanos, bytes)) = row else { return Ok(None) };
        let camera = CameraId::new(&camera).map_err(|_not_an_id: videofields_vision::frame::IdError| {
            StoreError::UnreadableRow { path: self.path.clone(), what: "the camera's id" }
        })?;
        let created_at = Timestamp::from_nanos(nanos);
        Ok(Some(TextureMapRecord { digest: *digest, scene, camera, created_at, bytes }))
    }

    /// Removes the maps of a camera in a scene but the one in use, and answers how many went.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn delete_stale_texture_maps(
        &self,
        scene: &str,
        camera: &CameraId,
        current_digest: &[u8; 32],
    ) -> Result<u64, StoreError> {
        sqlx::query("delete from texture_map where scene = ? and camera = ? and digest <> ?")
            .bind(scene)
            .bind(camera.as_str())
            .bind(current_digest.as_slice())
            .execute(&self.cache)
            .await
            .map(|done| done.rows_affected())
            .map_err(|error| self.classify(error))
    }
}
