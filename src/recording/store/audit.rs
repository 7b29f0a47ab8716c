//! Table `audit`: who did what. Only ever added to, on disk when it is acknowledged, and chained by digests. Where the oldest
//! entries are removed for their age, the base ([`super::audit_base`]) keeps the digest that the next one builds on.

use super::audit_base::{base, base_fault, removal_notice};
use super::audit_seal::{
    AUDIT_CHANGED, NoteSigner, Since, begin_head, compare, newest_signature, notice, unsigned_notice,
};
use super::audit_verify::{self, SignatureCheck};
use super::migrate::SCHEMA_VERSION;
use super::open::open_to_add;
use super::{ReadOnly, SignedHead, Store, StoreError};
use crate::signing::{PublicKey, Purpose, Signature, SigningKey};
use sha2::Digest;
use sqlx::{Connection, SqliteConnection};
use std::path::{Path, PathBuf};
use videofields_vision::clock::Timestamp;

/// The first schema that has the table.
const FIRST_SCHEMA: i64 = 10;

/// Entries that are removed at once: others wait for the database meanwhile.
pub(super) const MAX_REMOVED: i64 = 10_000;

/// Rows that are read at once when all are checked.
const PAGE: u32 = 1000;

/// Something that was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditEntry {
    /// When, by the machine's clock.
    pub at: Timestamp,
    /// By whom: a user, or `cli:` and the name of who ran a command; none where there are no users, or by a stranger.
    pub user: Option<String>,
    /// What: a method and a route's template, or a command of the command line.
    pub action: String,
    /// To what: path and query.
    pub target: String,
    /// What came of it: an HTTP status.
    pub status: u16,
}

/// An entry as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditRecord {
    /// 1, 2, 3, ... without gaps.
    pub number: i64,
    /// What was done.
    pub entry: AuditEntry,
    /// SHA-256 of the digest before and of this entry.
    pub digest: [u8; 32],
}

impl AuditRecord {
    /// Its digest, lower-case hexadecimal.
    #[must_use]
    pub fn digest_text(&self) -> String {
        hex(&self.digest)
    }

    /// Returns whether its digest is that of an entry behind one with the digest `before`.
    pub(super) fn follows(&self, before: &[u8; 32]) -> bool {
        self.digest == digest(before, self.number, &self.entry)
    }
}

/// What a look at all entries found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditCheck {
    /// Entries that were removed for their age: the first that is left has the number after it.
    pub n_removed: i64,
    /// Entries that are whole, from the first that is left on.
    pub n_whole: i64,
    /// The digest of the last of these, or of the last that was removed: whoever noted it can tell later that nothing before it was changed.
    pub head: Option<String>,
    /// What is wrong with the entry after them.
    pub fault: Option<String>,
}

type Row = (i64, i64, Option<String>, String, String, i64, Vec<u8>);

/// SHA-256 of the digest before and of an entry: every part with its length before it, so that none can be moved into the
/// next.
fn digest(before: &[u8; 32], number: i64, entry: &AuditEntry) -> [u8; 32] {
    let mut hash = sha2::Sha256::new();
    hash.update(before);
    hash.update(number.to_be_bytes());
    hash.update(entry.at.as_nanos().to_be_bytes());
    hash.update(entry.status.to_be_bytes());
    hash.update([u8::from(entry.user.is_some())]);
    for text in [entry.user.as_deref().unwrap_or_default(), &entry.action, &entry.target] {
        hash.update((text.len() as u64).to_be_bytes());
        hash.update(text.as_bytes());
    }
    hash.finalize().into()
}

/// The last entry of the log; of an empty one the last that was removed, or 0 and zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    pub(super) number: i64,
    pub(super) digest: [u8; 32],
}

/// Entry that was added to the log.
#[derive(Clone, Debug)]
pub(super) struct Written {
    /// The entry that was asked for, which is the last now.
    pub(super) head: Head,
    /// Signature of that entry, where there is a key.
    pub(super) signature: Option<Signature>,
    /// Fault that the log had before.
    pub(super) fault: Option<String>,
}

/// Adds an entry to what `connection` has open. It is on disk when it is acknowledged.
async fn append(
    connection: &mut SqliteConnection,
    path: &Path,
    entry: &AuditEntry,
    with: (Option<Head>, Option<&SigningKey>),
) -> Result<Written, StoreError> {
    let classify = |error| StoreError::classify(error, path);
    // The write lock is taken before the last row is read: another process may write too.
    let mut transaction = connection.begin_with("begin immediate").await.map_err(classify)?;
    let written = append_within(&mut transaction, path, entry, with).await?;
    transaction.commit().await.map_err(classify)?;
    Ok(written)
}

/// Adds an entry within a transaction, signed with the key where there is one. Before it the log is compared with its last entry
/// as it is known, and what others did to it since is told in entries of their own.
pub(super) async fn append_within(
    transaction: &mut SqliteConnection,
    path: &Path,
    entry: &AuditEntry,
    (known, key): (Option<Head>, Option<&SigningKey>),
) -> Result<Written, StoreError> {
    let since = match known {
        Some(known) => compare(transaction, path, known, key.map(SigningKey::public)).await?,
        None => Since::AsLeft,
    };
    let mut head = last(transaction, path).await?;
    let (told, fault) = match since {
        Since::AsLeft => (None, None),
        // Without a key nothing is signed, and commands write into the log too.
        Since::Unsigned(..) if key.is_none() => (None, None),
        Since::Unsigned(first, last) => (Some(unsigned_notice(entry.at, (first, last))), None),
        Since::Changed(fault) => (Some(notice(entry.at, AUDIT_CHANGED, fault.clone())), Some(fault)),
    };
    let mut signature = None;
    for entry in told.iter().chain([entry]) {
        (head, signature) = insert(transaction, path, (head, entry), key).await?;
    }
    Ok(Written { head, signature, fault })
}

/// Writes an entry behind the last one.
async fn insert(
    transaction: &mut SqliteConnection,
    path: &Path,
    (before, entry): (Head, &AuditEntry),
    key: Option<&SigningKey>,
) -> Result<(Head, Option<Signature>), StoreError> {
    let classify = |error| StoreError::classify(error, path);
    let number = before.number + 1;
    let head = Head { number, digest: digest(&before.digest, number, entry) };
    sqlx::query(
        "insert into audit (number, at, user, action, target, status, digest) values (?, ?, ?, ?, ?, ?, ?)",
    )
    .bind(number)
    .bind(entry.at.as_nanos())
    .bind(&entry.user)
    .bind(&entry.action)
    .bind(&entry.target)
    .bind(i64::from(entry.status))
    .bind(&head.digest[..])
    .execute(&mut *transaction)
    .await
    .map_err(classify)?;
    let Some(key) = key else { return Ok((head, None)) };
    let signature = key.sign(Purpose::AuditHead, &head.message());
    sqlx::query("insert into audit_signature (number, key, signature) values (?, ?, ?)")
        .bind(number)
        .bind(&signature.key.as_bytes()[..])
        .bind(&signature.bytes[..])
        .execute(transaction)
        .await
        .map_err(classify)?;
    Ok((head, Some(signature)))
}

/// The last entry of the log.
pub(super) async fn last(connection: &mut SqliteConnection, path: &Path) -> Result<Head, StoreError> {
    let last: Option<(i64, Vec<u8>)> =
        sqlx::query_as("select number, digest from audit order by number desc limit 1")
            .fetch_optional(&mut *connection)
            .await
            .map_err(|error| StoreError::classify(error, path))?;
    match last {
        Some((number, digest)) => Ok(Head { number, digest: as_digest(digest, path)? }),
        None => base(connection, path).await,
    }
}

pub(super) fn as_digest(bytes: Vec<u8>, path: &Path) -> Result<[u8; 32], StoreError> {
    let unreadable = || StoreError::UnreadableRow { path: path.to_owned(), what: "audit.digest" };
    bytes.try_into().map_err(|_wrong_length| unreadable())
}

/// Adds an entry to the database at `path`, whoever has it open, signed with the key where there is one; its number. A
/// database of another schema is left alone.
///
/// # Errors
/// When there is no database, its schema is another, or it fails: then it was not noted.
pub async fn note_audit(
    path: &Path,
    entry: &AuditEntry,
    signer: Option<NoteSigner<'_>>,
) -> Result<i64, StoreError> {
    let mut connection = open_to_add(path).await?;
    let written = note_by(&mut connection, path, entry, (None, None, signer)).await?;
    connection.close().await.map_err(|error| StoreError::classify(error, path))?;
    Ok(written)
}

/// Adds an entry for a command; the first that is signed leaves the signed head, which the daemon then looks for.
async fn note_by(
    connection: &mut SqliteConnection,
    path: &Path,
    entry: &AuditEntry,
    (known, own, signer): (Option<Head>, Option<&SigningKey>, Option<NoteSigner<'_>>),
) -> Result<i64, StoreError> {
    let is_first = signer.is_some() && newest_signature(connection, path).await?.is_none();
    let written = append(connection, path, entry, (known, own.or(signer.map(|signer| signer.key)))).await?;
    if let Some((NoteSigner { head_file, .. }, signature)) =
        signer.zip(written.signature).filter(|_| is_first)
    {
        begin_head(head_file, written.head, signature);
    }
    Ok(written.head.number)
}

/// Adds an entry to what `connection` has open, signed with the key where there is one; its number.
pub(super) async fn note_in(
    connection: &mut SqliteConnection,
    path: &Path,
    entry: &AuditEntry,
    key: Option<&SigningKey>,
) -> Result<i64, StoreError> {
    append(connection, path, entry, (None, key)).await.map(|written| written.head.number)
}

impl Store {
    /// Adds an entry, signed where there is a key; its number. What others did to the log since the last one is told in entries
    /// before it, and by [`Store::audit_state`].
    ///
    /// # Errors
    /// When the database fails: then it was not noted.
    #[tracing::instrument(level = "debug", name = "store", skip_all, fields(what = "append_audit"))]
    pub async fn append_audit(&self, entry: &AuditEntry) -> Result<i64, StoreError> {
        let mut connection = self.durable.acquire().await.map_err(|error| self.classify(error))?;
        let with = (self.audit.head(), self.audit.key());
        let written = append(&mut connection, &self.path, entry, with).await?;
        // The connection is held: there is one, so entries become known in their order.
        self.audit.wrote(&written).await;
        Ok(written.head.number)
    }

    /// Adds an entry as [`Store::append_audit`] does, signed with that key where the log is not signed by this process.
    ///
    /// # Errors
    /// Errors of [`Store::append_audit`].
    pub async fn note_audit(
        &self,
        entry: &AuditEntry,
        signer: Option<NoteSigner<'_>>,
    ) -> Result<i64, StoreError> {
        let mut connection = self.durable.acquire().await.map_err(|error| self.classify(error))?;
        let with = (self.audit.head(), self.audit.key(), signer);
        note_by(&mut connection, &self.path, entry, with).await
    }

    /// The first `limit` entries after number `after`.
    ///
    /// # Errors
    /// When the database fails, or holds what this program did not write.
    pub async fn audit(&self, after: i64, limit: u32) -> Result<Vec<AuditRecord>, StoreError> {
        let mut connection = self.cache.acquire().await.map_err(|error| self.classify(error))?;
        page(&mut connection, &self.path, after, limit).await
    }

    /// Looks at every entry, from the first to the last.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn check_audit(&self) -> Result<AuditCheck, StoreError> {
        let mut connection = self.cache.acquire().await.map_err(|error| self.classify(error))?;
        check(&mut connection, &self.path).await
    }

    /// Removes entries from before `until`, from the first on, at most 10 000, never the newest; the number and digest
    /// of the last that went, if any did. What is left is chained to that digest, and an entry of the time `at` says so.
    ///
    /// # Errors
    /// When the database fails: then none is removed.
    pub async fn shorten_audit(
        &self,
        until: Timestamp,
        at: Timestamp,
    ) -> Result<Option<(i64, String)>, StoreError> {
        let classify = |error| self.classify(error);
        let mut connection = self.durable.acquire().await.map_err(classify)?;
        let mut transaction = connection.begin_with("begin immediate").await.map_err(classify)?;
        let key = self.audit.key();
        let first = base(&mut transaction, &self.path).await?.number;
        // Another base would hide that nobody vouches for this one.
        let signer = key.map(SigningKey::public);
        let base_fault = base_fault(&mut transaction, &self.path, signer.as_slice()).await?;
        // The first that stays: one that is young enough, or the newest, or where as many went as may at once.
        let stays: Option<i64> = sqlx::query_scalar(
            "select min(coalesce((select min(number) from audit where at >= ?1), max(number)), max(number), ?2) from audit",
        )
        .bind(until.as_nanos())
        .bind(first + MAX_REMOVED + 1)
        .fetch_one(&mut *transaction)
        .await
        .map_err(classify)?;
        let Some(last) = stays.map(|stays| stays - 1).filter(|last| *last > first) else { return Ok(None) };
        let digest: Vec<u8> = sqlx::query_scalar("select digest from audit where number = ?")
            .bind(last)
            .fetch_one(&mut *transaction)
            .await
            .map_err(classify)?;
        for change in [
            "update audit_anchor set number = ?1, digest = ?2",
            "delete from audit where number <= ?1",
            "delete from audit_signature where number <= ?1",
        ] {
            let query = sqlx::query(change).bind(last);
            let query = if change.contains("?2") { query.bind(&digest) } else { query };
            query.execute(&mut *transaction).await.map_err(classify)?;
        }
        let removed = Head { number: last, digest: as_digest(digest, &self.path)? };
        let mut known = self.audit.head();
        if let Some(fault) = &base_fault {
            let entry = notice(at, AUDIT_CHANGED, fault.clone());
            let told = append_within(&mut transaction, &self.path, &entry, (known, key)).await?;
            known = Some(told.head);
        }
        let entry = removal_notice(at, &removed);
        let written = append_within(&mut transaction, &self.path, &entry, (known, key)).await?;
        transaction.commit().await.map_err(classify)?;
        if let Some(fault) = base_fault {
            self.audit.tell(&fault);
        }
        self.audit.wrote(&written).await;
        Ok(Some((last, hex(&removed.digest))))
    }
}

pub(super) fn hex(digest: &[u8; 32]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl ReadOnly {
    /// As [`Store::audit`].
    ///
    /// # Errors
    /// As [`Store::audit`]; when the schema is newer, or so old that it has no audit log.
    pub async fn audit(&mut self, after: i64, limit: u32) -> Result<Vec<AuditRecord>, StoreError> {
        let (connection, path) = self.audited().await?;
        page(connection, path, after, limit).await
    }

    /// As [`Store::check_audit`].
    ///
    /// # Errors
    /// As [`Store::check_audit`]; when the schema is newer, or so old that it has no audit log.
    pub async fn check_audit(&mut self) -> Result<AuditCheck, StoreError> {
        let (connection, path) = self.audited().await?;
        check(connection, path).await
    }

    /// Verifies the signatures of all entries with the keys that are trusted, and holds the log against the head as it was signed,
    /// where that is kept.
    ///
    /// # Errors
    /// Errors of [`Self::check_audit`].
    pub async fn check_signatures(
        &mut self,
        trusted: &[PublicKey],
        kept: Option<&SignedHead>,
    ) -> Result<SignatureCheck, StoreError> {
        let (connection, path) = self.audited().await?;
        audit_verify::verify(connection, path, trusted, kept).await
    }

    async fn audited(&mut self) -> Result<(&mut SqliteConnection, &PathBuf), StoreError> {
        let found = self.schema().await?;
        let known = SCHEMA_VERSION;
        let (connection, path) = self.connection();
        match found {
            found if found > known => Err(StoreError::NewerSchema { path: path.clone(), found, known }),
            found if found < FIRST_SCHEMA => {
                Err(StoreError::OtherSchema { path: path.clone(), found, known })
            }
            _ => Ok((connection, path)),
        }
    }
}

pub(super) async fn page(
    connection: &mut SqliteConnection,
    path: &Path,
    after: i64,
    limit: u32,
) -> Result<Vec<AuditRecord>, StoreError> {
    let rows: Vec<Row> = sqlx::query_as(
        "select number, at, user, action, target, status, digest from audit
         where number > ? order by number limit ?",
    )
    .bind(after)
    .bind(limit)
    .fetch_all(connection)
    .await
    .map_err(|error| StoreError::classify(error, path))?;
    let record = |(number, at, user, action, target, status, digest): Row| {
        let odd = |what| StoreError::UnreadableRow { path: path.to_owned(), what };
        let status = u16::try_from(status).map_err(|_too_large| odd("audit.status"))?;
        let digest = digest.try_into().map_err(|_wrong_length| odd("audit.digest"))?;
        let entry = AuditEntry { at: Timestamp::from_nanos(at), user, action, target, status };
        Ok(AuditRecord { number, entry, digest })
    };
    rows.into_iter().map(record).collect()
}

async fn check(connection: &mut SqliteConnection, path: &Path) -> Result<AuditCheck, StoreError> {
    let classify = |error| StoreError::classify(error, path);
    // All is read as of one instant: retention may move the base meanwhile. SQLite's log grows for as long as that takes.
    let mut snapshot = connection.begin().await.map_err(classify)?;
    let Head { number: n_removed, digest } = base(&mut snapshot, path).await?;
    let (mut last, mut before) = (n_removed, digest);
    let mut fault = None;
    'all: loop {
        let page = page(&mut snapshot, path, last, PAGE).await?;
        if page.is_empty() {
            break;
        }
        for record in page {
            if record.number != last + 1 {
                fault = Some(format!("entry {} is missing", last + 1));
                break 'all;
            }
            if !record.follows(&before) {
                let number = record.number;
                fault = Some(format!("entry {number} or one before it is not as it was written"));
                break 'all;
            }
            (last, before) = (record.number, record.digest);
        }
    }
    snapshot.rollback().await.map_err(classify)?;
    Ok(AuditCheck { n_removed, n_whole: last - n_removed, head: (last > 0).then(|| hex(&before)), fault })
}
