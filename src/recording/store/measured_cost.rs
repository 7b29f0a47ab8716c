//! Table `measured_cost`: what settings cost on the machines that this database was used on. A cache, bounded in rows:
//! the one measured longest ago goes first.

use super::{Store, StoreError, check_size};
use videofields_vision::clock::Timestamp;

/// Machines whose tables are kept.
const MACHINES_KEPT: i64 = 8;

impl Store {
    /// Keeps a machine's table (JSON) in place of the one that was there.
    ///
    /// # Errors
    /// When it is no JSON or too large, or the database fails.
    pub async fn put_measured_cost(
        &self,
        machine: &str,
        document: &str,
        measured_at: Timestamp,
    ) -> Result<(), StoreError> {
        check_size("the table of measured costs", document.as_bytes())?;
        self.write_measured_cost(machine, document, measured_at).await.map_err(|error| self.classify(error))
    }

    async fn write_measured_cost(
        &self,
        machine: &str,
        document: &str,
        measured_at: Timestamp,
    ) -> Result<(), sqlx::Error> {
        let mut transaction = self.cache.begin_with("begin immediate").await?;
        sqlx::query(
            "insert into measured_cost (machine, measured_at, document) values (?, ?, ?)
             on conflict (machine) do update set
                 measured_at = excluded.measured_at, document = excluded.document",
        )
        .bind(machine)
        .bind(measured_at.as_nanos())
        .bind(document)
        .execute(&mut *transaction)
        .await?;
        // The one just written stays, whatever its time: clocks step.
        sqlx::query(
            "delete from measured_cost where machine in (
                 select machine from measured_cost order by (machine = ?) desc, measured_at desc limit -1 offset ?)",
        )
        .bind(machine)
        .bind(MACHINES_KEPT)
        .execute(&mut *transaction)
        .await?;
        transaction.commit().await
    }

    /// A machine's table (JSON), if it is kept.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn measured_cost(&self, machine: &str) -> Result<Option<String>, StoreError> {
        let row: Option<(String,)> = sqlx::query_as("select document from measured_cost where machine = ?")
            .bind(machine)
            .fetch_optional(&self.cache)
            .await
            .map_err(|error| self.classify(error))?;
        Ok(row.map(|(document,)| document))
    }
}
