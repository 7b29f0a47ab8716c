//! Proofs that the audit log is as this daemon wrote it: the newest entry, which is kept in memory and compared, the
//! signatures of entries (table `audit_signature`), and the signed head, a file that says how far the log reached.
//!
//! Each signature is of an entry's number and digest, and so of everything before it: who rewrites the log from any entry on
//! and computes all digests anew, but has no key, has no signatures of what stands there then. Who cuts off the end, or puts
//! an older database in its place, is told by the head in memory and by the file.

use super::audit::{AuditEntry, Head, Written, append_within, as_digest, hex, last, page};
use super::audit_base::{base, base_fault, is_vouched, removal_notice, said, unvouched};
use super::{Store, StoreError};
use crate::signing::{PublicKey, Purpose, Signature, SignatureText, SigningKey, unhex};
use serde::{Deserialize, Serialize};
use sqlx::{Connection, SqliteConnection};
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use videofields_vision::clock::Timestamp;

/// Action of an entry with which another key takes over; its target begins with the new public key.
pub const AUDIT_KEY: &str = "audit key";

/// Action of an entry that says that the log is not as it was left.
pub const AUDIT_CHANGED: &str = "audit log changed";

/// Action of an entry that says which entries before it were written without the key.
pub const AUDIT_UNSIGNED: &str = "audit entries without a signature";

/// Action of the entry of a restore.
pub const AUDIT_RESTORE: &str = "restore";

/// Most bytes of the file of a signed head.
const MAX_HEAD_BYTES: u64 = 4096;

/// Restores that are looked at for the one that put this database in its place.
const MAX_RESTORES: u32 = 16;

/// The last entry of the log as it was once signed; in a file, JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SignedHead {
    /// Its number.
    pub number: i64,
    /// Its digest, hexadecimal.
    pub digest: String,
    /// Key of its signer.
    #[serde(flatten)]
    pub signature: SignatureText,
}

impl SignedHead {
    fn of(head: Head, signature: Signature) -> Self {
        Self { number: head.number, digest: hex(&head.digest), signature: signature.into() }
    }

    /// Reads the file at `path`; none where it is not there.
    ///
    /// # Errors
    /// When it cannot be read, or is no signed head.
    pub fn read(path: &Path) -> std::io::Result<Option<Self>> {
        let file = match File::open(path) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error),
        };
        let mut text = Vec::new();
        file.take(MAX_HEAD_BYTES).read_to_end(&mut text)?;
        Ok(Some(serde_json::from_slice(&text)?))
    }

    /// Returns the key that signed it; none where its signature is not of it.
    #[must_use]
    pub fn signed_by(&self) -> Option<PublicKey> {
        let (head, signature) = self.parts()?;
        signature.is_of(Purpose::AuditHead, &head.message()).then_some(signature.key)
    }

    /// Returns number and digest as they are noted elsewhere.
    #[must_use]
    pub fn noted(&self) -> String {
        format!("{}:{}", self.number, self.digest)
    }

    fn parts(&self) -> Option<(Head, Signature)> {
        let head = Head { number: self.number, digest: unhex(&self.digest)? };
        Some((head, Signature::try_from(&self.signature).ok()?))
    }

    /// Writes it alone, unless a later one was written: `written` is the turn of the last.
    fn write_in_turn(&self, path: &Path, (written, turn): (&Mutex<u64>, u64)) -> std::io::Result<()> {
        let mut written = written.lock().unwrap_or_else(PoisonError::into_inner);
        if turn > *written {
            self.write(path)?;
            *written = turn;
        }
        Ok(())
    }

    /// Puts it in the place of the file at `path`; on the disk when it returns.
    fn write(&self, path: &Path) -> std::io::Result<()> {
        let mut beside = path.as_os_str().to_owned();
        beside.push(".new");
        let beside = PathBuf::from(beside);
        let mut file =
            std::fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&beside)?;
        file.write_all(&serde_json::to_vec_pretty(self)?)?;
        file.sync_all()?;
        std::fs::rename(&beside, path)?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
    }
}

/// Key with which a command signs what it notes, and the file of the signed head.
#[derive(Clone, Copy, Debug)]
pub struct NoteSigner<'a> {
    /// The key.
    pub key: &'a SigningKey,
    /// The file, which the first command that signs anything makes.
    pub head_file: &'a Path,
}

/// Makes the file of the signed head where there is none; that it cannot is told, since the daemon will miss it.
pub(super) fn begin_head(path: &Path, head: Head, signature: Signature) {
    let written = match SignedHead::read(path) {
        Ok(None) => SignedHead::of(head, signature).write(path),
        Ok(Some(_)) | Err(_) => Ok(()),
    };
    if let Err(error) = written {
        let path = path.display();
        tracing::warn!(%path, %error, "the signed head of the audit log cannot be written: the daemon will say that it is gone");
    }
}

/// With what the audit log is signed.
#[derive(Debug)]
pub struct AuditKeys {
    /// The key.
    pub key: Arc<SigningKey>,
    /// The key before it, which signs that this one takes over.
    pub before: Option<SigningKey>,
    /// The file of the signed head.
    pub head_file: PathBuf,
}

/// State of the audit log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AuditState {
    /// The newest entry's number and digest, hexadecimal.
    pub head: Option<(i64, String)>,
    /// The newest entry as it is signed; none without a key.
    pub signed: Option<SignedHead>,
    /// Fault that was found last.
    pub fault: Option<String>,
    /// Number of times that another fault was found.
    pub n_faults: u64,
}

/// Knowledge of a store about its audit log beside what the database says.
#[derive(Debug, Default)]
pub(super) struct Seal {
    keys: OnceLock<(Arc<SigningKey>, PathBuf)>,
    kept: Mutex<Kept>,
    /// The turn of the head that was written last; held while one is written.
    written: Arc<Mutex<u64>>,
}

#[derive(Debug, Default)]
struct Kept {
    head: Option<Head>,
    /// Counts heads: a later one has a greater turn.
    turn: u64,
    /// The base that was found good, or was told.
    base: Option<Head>,
    state: AuditState,
}

impl Seal {
    pub(super) fn key(&self) -> Option<&SigningKey> {
        self.keys.get().map(|(key, _)| &**key)
    }

    pub(super) fn head(&self) -> Option<Head> {
        self.kept().head
    }

    pub(super) fn state(&self) -> AuditState {
        self.kept().state.clone()
    }

    /// A panic leaves it whole.
    fn kept(&self) -> std::sync::MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Remembers the newest entry, with its signature where it has one.
    pub(super) fn remember(&self, head: Head, signature: Option<Signature>) {
        let mut kept = self.kept();
        kept.head = Some(head);
        kept.turn += 1;
        kept.state.head = (head.number > 0).then(|| (head.number, hex(&head.digest)));
        kept.state.signed = signature.map(|signature| SignedHead::of(head, signature));
    }

    /// Tells what is wrong, once.
    pub(super) fn tell(&self, fault: &str) {
        let mut kept = self.kept();
        if kept.state.fault.as_deref() != Some(fault) {
            kept.state.fault = Some(fault.to_owned());
            kept.state.n_faults += 1;
            drop(kept);
            tracing::error!(fault, "the audit log is not as this daemon wrote it");
        }
    }

    /// Remembers what was written, tells what was wrong before it, and writes the signed head.
    pub(super) async fn wrote(&self, written: &Written) {
        self.remember(written.head, written.signature);
        if let Some(fault) = &written.fault {
            self.tell(fault);
        }
        self.write_head().await;
    }

    /// Writes the newest entry's signature into the file of the signed head.
    async fn write_head(&self) {
        let Some((_, path)) = self.keys.get().cloned() else { return };
        let (signed, turn) = {
            let kept = self.kept();
            (kept.state.signed.clone(), kept.turn)
        };
        let Some(signed) = signed else { return };
        let (shown, written) = (path.display().to_string(), Arc::clone(&self.written));
        // It goes on where its caller leaves, and may come to its turn late.
        let wrote = tokio::task::spawn_blocking(move || signed.write_in_turn(&path, (&written, turn)));
        let failed = match wrote.await {
            Ok(Ok(())) => return,
            Ok(Err(error)) => error.to_string(),
            Err(panicked) => panicked.to_string(),
        };
        self.tell(&format!("the signed head of the audit log is not written: {failed}: {shown}"));
    }
}

impl Head {
    /// Returns what is signed of it.
    pub(super) fn message(&self) -> Vec<u8> {
        [&self.number.to_be_bytes()[..], &self.digest].concat()
    }
}

/// Change of the log since its newest entry was known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Since {
    /// It has that entry, and behind it only what was signed, or nothing.
    AsLeft,
    /// Behind it others wrote entries without a signature: the first and the last.
    Unsigned(i64, i64),
    /// It is another.
    Changed(String),
}

/// Compares the log with its newest entry as it was known; `key` signs what this program writes.
pub(super) async fn compare(
    connection: &mut SqliteConnection,
    path: &Path,
    known: Head,
    key: Option<PublicKey>,
) -> Result<Since, StoreError> {
    let newest = last(connection, path).await?;
    if newest == known {
        return Ok(Since::AsLeft);
    }
    let Head { number, digest } = known;
    match digest_at(connection, path, number).await? {
        None if newest.number < number => {
            let there = newest.number;
            return Ok(Since::Changed(format!(
                "entry {number} is missing: the log ends at entry {there}, though {number}:{} was written",
                hex(&digest)
            )));
        }
        Some(found) if found == digest => {}
        found => {
            let now = found.map_or_else(|| "missing".to_owned(), |found| hex(&found));
            return Ok(Since::Changed(format!(
                "entry {number} is not as it was written: its digest was {} and is {now}",
                hex(&digest)
            )));
        }
    }
    // What others wrote since.
    let (mut before, mut unsigned) = (known, None::<(i64, i64)>);
    loop {
        let records = page(connection, path, before.number, PAGE).await?;
        if records.is_empty() {
            break;
        }
        let signed = signatures(connection, path, (before.number, PAGE)).await?;
        for record in records {
            if record.number != before.number + 1 || !record.follows(&before.digest) {
                return Ok(Since::Changed(format!("entry {} does not follow the one before", record.number)));
            }
            before = Head { number: record.number, digest: record.digest };
            let own = signed.iter().find(|(of, _)| *of == record.number).map(|(_, signature)| signature);
            let is_own = own.is_some_and(|signature| {
                Some(signature.key) == key && signature.is_of(Purpose::AuditHead, &before.message())
            });
            if !is_own {
                let first = unsigned.map_or(record.number, |(first, _)| first);
                unsigned = Some((first, record.number));
            }
        }
    }
    Ok(unsigned.map_or(Since::AsLeft, |(first, last)| Since::Unsigned(first, last)))
}

/// Rows that are read at once.
const PAGE: u32 = 1000;

/// The digest of an entry, or of the last that was removed for its age; none where it is not there.
pub(super) async fn digest_at(
    connection: &mut SqliteConnection,
    path: &Path,
    number: i64,
) -> Result<Option<[u8; 32]>, StoreError> {
    let found: Option<Vec<u8>> = sqlx::query_scalar("select digest from audit where number = ?")
        .bind(number)
        .fetch_optional(&mut *connection)
        .await
        .map_err(|error| StoreError::classify(error, path))?;
    if let Some(found) = found {
        return as_digest(found, path).map(Some);
    }
    let base = base(connection, path).await?;
    Ok((base.number == number).then_some(base.digest))
}

/// The signatures of at most so many entries after one, with their numbers; none of a schema from before there were any.
pub(super) async fn signatures(
    connection: &mut SqliteConnection,
    path: &Path,
    (after, n): (i64, u32),
) -> Result<Vec<(i64, Signature)>, StoreError> {
    let classify = |error| StoreError::classify(error, path);
    let is_there: i64 = sqlx::query_scalar(
        "select count(*) from sqlite_schema where type = 'table' and name = 'audit_signature'",
    )
    .fetch_one(&mut *connection)
    .await
    .map_err(classify)?;
    if is_there == 0 {
        return Ok(Vec::new());
    }
    let rows: Vec<(i64, Vec<u8>, Vec<u8>)> = sqlx::query_as(
        "select number, key, signature from audit_signature where number > ?1 and number <= ?1 + ?2 order by number",
    )
    .bind(after)
    .bind(n)
    .fetch_all(connection)
    .await
    .map_err(classify)?;
    rows.into_iter().map(|(number, key, bytes)| Ok((number, signature(key, bytes, path)?))).collect()
}

pub(super) fn signature(key: Vec<u8>, bytes: Vec<u8>, path: &Path) -> Result<Signature, StoreError> {
    let odd = |what| StoreError::UnreadableRow { path: path.to_owned(), what };
    let key = key.try_into().map_err(|_wrong_length| odd("audit_signature.key"))?;
    let bytes = bytes.try_into().map_err(|_wrong_length| odd("audit_signature.signature"))?;
    Ok(Signature { key: PublicKey::from_bytes(key), bytes })
}

/// The newest signature with its entry's number.
pub(super) async fn newest_signature(
    connection: &mut SqliteConnection,
    path: &Path,
) -> Result<Option<(i64, Signature)>, StoreError> {
    let found: Option<(i64, Vec<u8>, Vec<u8>)> =
        sqlx::query_as("select number, key, signature from audit_signature order by number desc limit 1")
            .fetch_optional(connection)
            .await
            .map_err(|error| StoreError::classify(error, path))?;
    found.map(|(number, key, bytes)| Ok((number, signature(key, bytes, path)?))).transpose()
}

/// Returns what of a log contradicts the signed head in a file, which one of the keys must have signed; nothing where a restore that one
/// of them signed names that head as the one it replaced.
pub(super) async fn contradiction(
    connection: &mut SqliteConnection,
    path: &Path,
    kept: &SignedHead,
    keys: &[PublicKey],
) -> Result<Option<String>, StoreError> {
    let Some((head, _)) = kept.parts().filter(|_| kept.signed_by().is_some_and(|key| keys.contains(&key)))
    else {
        return Ok(Some("the signed head is not signed with a key of this log".to_owned()));
    };
    let base = base(connection, path).await?;
    let found = digest_at(connection, path, head.number).await?;
    if found == Some(head.digest) || is_restored(connection, path, (&kept.noted(), keys)).await? {
        return Ok(None);
    }
    let number = head.number;
    if number < base.number {
        let is_vouched = is_vouched(connection, path, &base, keys).await?;
        return Ok((!is_vouched).then(|| unvouched(&base)));
    }
    Ok(Some(match found {
        Some(_) => format!("entry {number} is another than the one that was signed, {}", kept.noted()),
        None => {
            let there = last(connection, path).await?.number;
            format!(
                "the log ends at entry {there}, but {} was signed: its end was cut off, or an older database was put in \
                 its place without `videofields restore`",
                kept.noted()
            )
        }
    }))
}

/// Returns true where a restore that one of the keys signed says that it replaced the log with that head.
async fn is_restored(
    connection: &mut SqliteConnection,
    path: &Path,
    (noted, keys): (&str, &[PublicKey]),
) -> Result<bool, StoreError> {
    let restores = said(connection, path, (AUDIT_RESTORE, MAX_RESTORES), keys).await?;
    let end = replaced(noted);
    Ok(restores.iter().any(|target| target.ends_with(&end)))
}

/// Returns the end of the target of a restore that replaced a log with that head.
#[must_use]
pub fn replaced(noted: &str) -> String {
    format!("#replaced={noted}")
}

/// An entry that the daemon makes of its own accord.
pub(super) fn notice(at: Timestamp, action: &str, target: String) -> AuditEntry {
    AuditEntry { at, user: None, action: action.to_owned(), target, status: 200 }
}

/// Returns the entry that tells of entries without signatures.
pub(super) fn unsigned_notice(at: Timestamp, (first, last): (i64, i64)) -> AuditEntry {
    notice(at, AUDIT_UNSIGNED, format!("entries {first} to {last}"))
}

impl Store {
    /// Signs the audit log from now on: compares it with the signed head that was kept, tells in the log what contradicts it,
    /// and that the key took over where the last signature is of another.
    ///
    /// # Errors
    /// When the database fails; nothing is signed then.
    pub async fn sign_audit(&self, keys: AuditKeys, at: Timestamp) -> Result<(), StoreError> {
        let AuditKeys { key, before, head_file } = keys;
        let classify = |error| self.classify(error);
        let mut connection = self.durable.acquire().await.map_err(classify)?;
        let mut transaction = connection.begin_with("begin immediate").await.map_err(classify)?;
        let path = &self.path;
        let mut known = vec![key.public()];
        known.extend(before.as_ref().map(SigningKey::public));
        let newest = newest_signature(&mut transaction, path).await?;
        let shown = head_file.display();
        let head = SignedHead::read(&head_file);
        // Nobody could sign what was removed before there was a key.
        let was_signed = newest.is_some() || !matches!(head, Ok(None));
        let mut faults: Vec<String> = match head {
            Ok(Some(kept)) => contradiction(&mut transaction, path, &kept, &known).await?,
            Ok(None) => newest.map(|_| format!("the signed head is gone: {shown}")),
            Err(error) => Some(format!("the signed head cannot be read: {error}: {shown}")),
        }
        .into_iter()
        .collect();
        if was_signed && let Some(fault) = base_fault(&mut transaction, path, &known).await? {
            faults.retain(|other| *other != fault);
            faults.push(fault);
        }
        let end = last(&mut transaction, path).await?;
        let mut told = Vec::new();
        let takes_over = match newest {
            Some((_, signature)) if signature.key == key.public() => None,
            found => Some(takes_over(&key, before.as_ref(), (found.map(|(_, of)| of.key), at))),
        };
        let base = base(&mut transaction, path).await?;
        let is_good = !was_signed || is_vouched(&mut transaction, path, &base, &known).await?;
        // Later starts do not know the key that vouched for it.
        let base = Some(base).filter(|base| takes_over.is_some() && is_good && base.number > 0);
        // The newest signature is to be of the key that signs from now on, also where the one before signs the change.
        let is_handed_over = takes_over.as_ref().is_some_and(|(_, signer)| signer.public() != key.public());
        told.extend(takes_over);
        told.extend(
            is_handed_over.then(|| (notice(at, AUDIT_KEY, format!("{}#signs", key.public())), &*key)),
        );
        told.extend(base.map(|base| (removal_notice(at, &base), &*key)));
        if let Some((signed, _)) = newest
            && signed < end.number
        {
            told.push((unsigned_notice(at, (signed + 1, end.number)), &*key));
        }
        told.extend(faults.iter().map(|fault| (notice(at, AUDIT_CHANGED, fault.clone()), &*key)));
        let (mut head, mut signature) = (end, newest.filter(|(of, _)| *of == end.number).map(|(_, of)| of));
        for (entry, key) in &told {
            let written = append_within(&mut transaction, path, entry, (None, Some(key))).await?;
            (head, signature) = (written.head, written.signature);
        }
        transaction.commit().await.map_err(classify)?;
        // A second call keeps to the first one's key.
        if self.audit.keys.set((Arc::clone(&key), head_file)).is_err() {
            tracing::warn!("the audit log is signed already");
        }
        self.audit.remember(head, signature);
        faults.iter().for_each(|fault| self.audit.tell(fault));
        self.audit.write_head().await;
        Ok(())
    }

    /// Returns the key of the newest signature.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn audit_signer(&self) -> Result<Option<PublicKey>, StoreError> {
        let mut connection = self.cache.acquire().await.map_err(|error| self.classify(error))?;
        Ok(newest_signature(&mut connection, &self.path).await?.map(|(_, signature)| signature.key))
    }

    /// Remembers the newest entry as it is there now.
    pub(super) async fn remember_audit(&self) -> Result<(), StoreError> {
        let mut connection = self.durable.acquire().await.map_err(|error| self.classify(error))?;
        let newest = last(&mut connection, &self.path).await?;
        self.audit.remember(newest, None);
        Ok(())
    }

    /// Returns how the audit log fares, as far as this process knows.
    #[must_use]
    pub fn audit_state(&self) -> AuditState {
        self.audit.state()
    }

    /// Compares the log with its newest entry as this process knows it, and asks who vouches for its base where that is another; what
    /// is wrong is told in the log and by [`Self::audit_state`].
    ///
    /// # Errors
    /// When the database fails.
    pub async fn check_audit_head(&self, at: Timestamp) -> Result<(), StoreError> {
        let (path, classify) = (&self.path, |error| self.classify(error));
        // The connection that writes: an entry that is on its way is known when its turn is over.
        let mut connection = self.durable.acquire().await.map_err(classify)?;
        let Some(known) = self.audit.head() else { return Ok(()) };
        let key = self.audit.key();
        let signer = key.map(SigningKey::public);
        if let Since::Changed(fault) = compare(&mut connection, path, known, signer).await? {
            self.audit.tell(&fault);
        }
        let found = base(&mut connection, path).await?;
        if self.audit.kept().base == Some(found) {
            return Ok(());
        }
        let mut transaction = connection.begin_with("begin immediate").await.map_err(classify)?;
        let fault = base_fault(&mut transaction, path, signer.as_slice()).await?;
        let Some(fault) = fault else {
            transaction.rollback().await.map_err(classify)?;
            self.audit.kept().base = Some(found);
            return Ok(());
        };
        let entry = notice(at, AUDIT_CHANGED, fault.clone());
        let written = append_within(&mut transaction, path, &entry, (Some(known), key)).await?;
        transaction.commit().await.map_err(classify)?;
        self.audit.kept().base = Some(found);
        self.audit.tell(&fault);
        self.audit.wrote(&written).await;
        Ok(())
    }

    /// Computes the digests of all entries anew; what is wrong is told as [`Self::check_audit_head`] does.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn check_whole_audit(&self, at: Timestamp) -> Result<(), StoreError> {
        if let Some(fault) = self.check_audit().await?.fault {
            self.audit.tell(&fault);
        }
        self.audit.kept().base = None;
        self.check_audit_head(at).await
    }
}

/// The entry with which `key` takes over, and the key that signs it: the one before where that signed last.
fn takes_over<'a>(
    key: &'a SigningKey,
    before: Option<&'a SigningKey>,
    (last, at): (Option<PublicKey>, Timestamp),
) -> (AuditEntry, &'a SigningKey) {
    let public = key.public();
    let Some(last) = last else { return (notice(at, AUDIT_KEY, format!("{public}#first")), key) };
    match before.filter(|before| before.public() == last) {
        Some(before) => (notice(at, AUDIT_KEY, format!("{public}#after={last}")), before),
        None => {
            tracing::warn!(
                key = %public, before = %last,
                "the audit log was signed with another key, and storage.audit_key_before does not name it: verifying needs \
                 both public keys"
            );
            (notice(at, AUDIT_KEY, format!("{public}#unvouched_after={last}")), key)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_that_are_written_at_once_or_late_do_no_harm() {
        let folder = tempfile::TempDir::new().unwrap();
        let (path, written) = (folder.path().join("head"), Mutex::new(0));
        let signature =
            SignatureText::from(Signature { key: PublicKey::from_bytes([1; 32]), bytes: [2; 64] });
        let head = |turn: u64| SignedHead {
            number: i64::try_from(turn).unwrap(),
            digest: hex(&[3; 32]),
            signature: signature.clone(),
        };
        let write = |turn: u64| head(turn).write_in_turn(&path, (&written, turn)).unwrap();
        std::thread::scope(|scope| {
            for thread in 0..8 {
                scope.spawn(move || (0..10).for_each(|round| write(round * 8 + thread + 1)));
            }
        });
        assert_eq!(SignedHead::read(&path).unwrap(), Some(head(80)));
        write(79);
        assert_eq!(SignedHead::read(&path).unwrap(), Some(head(80)));
        write(81);
        assert_eq!(SignedHead::read(&path).unwrap(), Some(head(81)));
    }
}
