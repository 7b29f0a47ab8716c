//! The schema's history: every file of `migrations/`, in order, compiled in.

use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};

/// A migration: number, name, SQL.
type Step = (i64, &'static str, &'static str);

/// Never edited or reordered once released: their digests are kept in the database.
const STEPS: [Step; 19] = [
    (1, "create_scene", include_str!("../../../migrations/0001_create_scene.sql")),
    (2, "create_background", include_str!("../../../migrations/0002_create_background.sql")),
    (3, "create_texture_map", include_str!("../../../migrations/0003_create_texture_map.sql")),
    (4, "create_measured_cost", include_str!("../../../migrations/0004_create_measured_cost.sql")),
    (5, "create_background_history", include_str!("../../../migrations/0005_create_background_history.sql")),
    (6, "create_segment", include_str!("../../../migrations/0006_create_segment.sql")),
    (7, "create_activity", include_str!("../../../migrations/0007_create_activity.sql")),
    (8, "create_track", include_str!("../../../migrations/0008_create_track.sql")),
    (9, "create_user", include_str!("../../../migrations/0009_create_user.sql")),
    (10, "create_audit", include_str!("../../../migrations/0010_create_audit.sql")),
    (11, "create_document", include_str!("../../../migrations/0011_create_document.sql")),
    (12, "alter_document", include_str!("../../../migrations/0012_alter_document.sql")),
    (13, "create_snapshot", include_str!("../../../migrations/0013_create_snapshot.sql")),
    (14, "create_privacy", include_str!("../../../migrations/0014_create_privacy.sql")),
    (15, "create_audit_anchor", include_str!("../../../migrations/0015_create_audit_anchor.sql")),
    (16, "create_entity", include_str!("../../../migrations/0016_create_entity.sql")),
    (17, "alter_snapshot", include_str!("../../../migrations/0017_alter_snapshot.sql")),
    (18, "create_audit_signature", include_str!("../../../migrations/0018_create_audit_signature.sql")),
    (19, "alter_segment", include_str!("../../../migrations/0019_alter_segment.sql")),
];

/// The newest schema that this release knows.
pub const SCHEMA_VERSION: i64 = STEPS[STEPS.len() - 1].0;

/// The steps up to schema `version`.
pub(super) fn migrator(version: i64) -> Migrator {
    let steps = STEPS.iter().filter(|(number, ..)| *number <= version);
    let migration = |(number, name, sql): &Step| {
        Migration::new(*number, (*name).into(), MigrationType::Simple, sql.into_sql_str(), false)
    };
    Migrator::with_migrations(steps.map(migration).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use sqlx::{Connection, SqliteConnection};

    async fn schema(connection: &mut SqliteConnection) -> Vec<(String, String)> {
        sqlx::query_as("select name, coalesce(sql, '') from sqlite_schema order by name")
            .fetch_all(connection)
            .await
            .expect("the schema")
    }

    #[tokio::test]
    async fn stepwise_upgrade_equals_a_fresh_database() {
        let connect = || SqliteConnection::connect("sqlite::memory:");
        let mut fresh = connect().await.expect("a database");
        migrator(SCHEMA_VERSION).run(&mut fresh).await.expect("migrated");
        let mut stepwise = connect().await.expect("a database");
        let mut schemas = Vec::new();
        for version in 1..=SCHEMA_VERSION {
            migrator(version).run(&mut stepwise).await.expect("migrated");
            schemas.push(schema(&mut stepwise).await);
        }
        assert!(schemas.windows(2).all(|pair| pair[0] != pair[1]), "every step changes something");
        assert_eq!(schema(&mut stepwise).await, schema(&mut fresh).await);
        assert!(schema(&mut fresh).await.iter().any(|(name, _)| name == "texture_map"));
    }

    /// Adds snapshot `number` with a version for each of `holds`, each by another user.
    async fn add_snapshot(connection: &mut SqliteConnection, number: u8, holds: &[bool]) {
        let done = sqlx::query(
            "insert into snapshot (number, id, made_at, shown_at, kind, subject, bytes, digest, previous, salt, version,
                 note, tags, hold)
             values (?, ?, 0, 0, 'scene', 'yard', 1, ?, zeroblob(32), zeroblob(32), ?, '', '[]', ?)",
        )
        .bind(number)
        .bind(format!("{number:032}"))
        .bind(vec![number; 32])
        .bind(holds.len() as i64)
        .bind(holds.last())
        .execute(&mut *connection)
        .await;
        done.expect("added");
        for (version, hold) in (1_i64..).zip(holds) {
            let done = sqlx::query("insert into snapshot_annotation values (?, ?, 0, ?, '', '[]', ?)")
                .bind(number)
                .bind(version)
                .bind(format!("user{version}"))
                .bind(hold)
                .execute(&mut *connection)
                .await;
            done.expect("annotated");
        }
    }

    #[tokio::test]
    async fn an_older_database_learns_who_holds_its_snapshots() {
        let mut connection = SqliteConnection::connect("sqlite::memory:").await.expect("a database");
        migrator(16).run(&mut connection).await.expect("migrated");
        add_snapshot(&mut connection, 1, &[true, false, true, true]).await;
        add_snapshot(&mut connection, 2, &[true, true]).await;
        add_snapshot(&mut connection, 3, &[true, false]).await;
        migrator(17).run(&mut connection).await.expect("migrated");
        let held: Vec<(i64, Option<String>)> =
            sqlx::query_as("select number, held_by from snapshot order by number")
                .fetch_all(&mut connection)
                .await
                .expect("read");
        let expected = [(1, Some("user3")), (2, Some("user1")), (3, None)];
        assert_eq!(held, expected.map(|(number, user)| (number, user.map(str::to_owned))));
    }

    #[test]
    fn the_steps_are_numbered_without_gaps() {
        for (i, (number, name, _)) in STEPS.iter().enumerate() {
            assert_eq!(*number, i as i64 + 1, "{name}");
        }
    }
}
