//! Tables `user` and `token`: who may ask for what. Cannot be rebuilt, so a write is on disk when it is acknowledged.

use super::{Store, StoreError};
use videofields_vision::clock::Timestamp;

/// A user as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UserRecord {
    /// Name by which the user logs in.
    pub id: String,
    /// `viewer`, `operator` or `admin`.
    pub role: String,
    /// Rights by camera, JSON.
    pub rights: String,
    /// The password as a PHC string; none for who has tokens alone.
    pub password: Option<String>,
    /// 1 at first, and one more with every change.
    pub version: i64,
    /// When it was made.
    pub created_at: Timestamp,
    /// When it was changed last.
    pub updated_at: Timestamp,
}

/// A token as it is kept: its secret is not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenRecord {
    /// Its public part.
    pub id: String,
    /// Whose it is.
    pub user: String,
    /// What it is for.
    pub note: String,
    /// SHA-256 of its secret part.
    pub digest: [u8; 32],
    /// When it was made.
    pub created_at: Timestamp,
    /// From when on it is not taken any more.
    pub expires_at: Option<Timestamp>,
}

impl Store {
    /// Writes a user in place of the one of version `was` (0: of none), and answers whether it was that.
    ///
    /// # Errors
    /// When a value is not allowed, or the database fails.
    #[tracing::instrument(level = "debug", name = "store", skip_all, fields(what = "put_user"))]
    pub async fn put_user(&self, user: &UserRecord, was: i64) -> Result<bool, StoreError> {
        let done = sqlx::query(
            "insert into user (id, role, rights, password, version, created_at, updated_at)
             select ?, ?, ?, ?, ?, ?, ?
             where ? = coalesce((select version from user where id = ?), 0)
             on conflict (id) do update set
                 role = excluded.role, rights = excluded.rights, password = excluded.password,
                 version = excluded.version, updated_at = excluded.updated_at",
        )
        .bind(&user.id)
        .bind(&user.role)
        .bind(&user.rights)
        .bind(&user.password)
        .bind(user.version)
        .bind(user.created_at.as_nanos())
        .bind(user.updated_at.as_nanos())
        .bind(was)
        .bind(&user.id)
        .execute(&self.durable)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(done.rows_affected() > 0)
    }

    /// All users, in the order of their names.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn users(&self) -> Result<Vec<UserRecord>, StoreError> {
        type Row = (String, String, String, Option<String>, i64, i64, i64);
        let rows: Vec<Row> = sqlx::query_as(
            "select id, role, rights, password, version, created_at, updated_at from user order by id",
        )
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let record = |(id, role, rights, password, version, created_at, updated_at)| UserRecord {
            id,
            role,
            rights,
            password,
            version,
            created_at: Timestamp::from_nanos(created_at),
            updated_at: Timestamp::from_nanos(updated_at),
        };
        Ok(rows.into_iter().map(record).collect())
    }

    /// Returns when a user was made; none where there is none of that name.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn user_since(&self, id: &str) -> Result<Option<Timestamp>, StoreError> {
        let created_at: Result<Option<i64>, sqlx::Error> =
            sqlx::query_scalar("select created_at from user where id = ?")
                .bind(id)
                .fetch_optional(&self.cache)
                .await;
        Ok(created_at.map_err(|error| self.classify(error))?.map(Timestamp::from_nanos))
    }

    /// Removes the user of that version with all of its tokens, and answers whether there was one.
    ///
    /// # Errors
    /// When the database fails.
    #[tracing::instrument(level = "debug", name = "store", skip_all, fields(what = "delete_user"))]
    pub async fn delete_user(&self, id: &str, version: i64) -> Result<bool, StoreError> {
        let done = sqlx::query("delete from user where id = ? and version = ?")
            .bind(id)
            .bind(version)
            .execute(&self.durable)
            .await
            .map_err(|error| self.classify(error))?;
        Ok(done.rows_affected() > 0)
    }

    /// Adds a token.
    ///
    /// # Errors
    /// When there is no such user, the id is taken, or the database fails.
    #[tracing::instrument(level = "debug", name = "store", skip_all, fields(what = "add_token"))]
    pub async fn add_token(&self, token: &TokenRecord) -> Result<(), StoreError> {
        sqlx::query(
            "insert into token (id, user, note, digest, created_at, expires_at) values (?, ?, ?, ?, ?, ?)",
        )
        .bind(&token.id)
        .bind(&token.user)
        .bind(&token.note)
        .bind(&token.digest[..])
        .bind(token.created_at.as_nanos())
        .bind(token.expires_at.map(|at| at.as_nanos()))
        .execute(&self.durable)
        .await
        .map_err(|error| self.classify(error))?;
        Ok(())
    }

    /// All tokens, in the order in which they were made.
    ///
    /// # Errors
    /// When the database fails, or a row is none that this program wrote.
    pub async fn tokens(&self) -> Result<Vec<TokenRecord>, StoreError> {
        type Row = (String, String, String, Vec<u8>, i64, Option<i64>);
        let rows: Vec<Row> = sqlx::query_as(
            "select id, user, note, digest, created_at, expires_at from token order by created_at, id",
        )
        .fetch_all(&self.cache)
        .await
        .map_err(|error| self.classify(error))?;
        let unreadable = || StoreError::UnreadableRow { path: self.path.clone(), what: "token.digest" };
        let record = |(id, user, note, digest, created_at, expires_at): Row| {
            Ok(TokenRecord {
                id,
                user,
                note,
                digest: digest.try_into().map_err(|_wrong_length| unreadable())?,
                created_at: Timestamp::from_nanos(created_at),
                expires_at: expires_at.map(Timestamp::from_nanos),
            })
        };
        rows.into_iter().map(record).collect()
    }

    /// Removes a token and answers whether there was one.
    ///
    /// # Errors
    /// When the database fails.
    #[tracing::instrument(level = "debug", name = "store", skip_all, fields(what = "delete_token"))]
    pub async fn delete_token(&self, id: &str) -> Result<bool, StoreError> {
        let done = sqlx::query("delete from token where id = ?")
            .bind(id)
            .execute(&self.durable)
            .await
            .map_err(|error| self.classify(error))?;
        Ok(done.rows_affected() > 0)
    }
}
