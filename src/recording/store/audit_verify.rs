//! Verifies that the audit log is as it was signed: every signature, the keys that took over, and the head that was kept.

use super::audit::{AuditRecord, Head, page};
use super::audit_base::{AUDIT_RETENTION, base, removal, unvouched};
use super::audit_seal::{AUDIT_KEY, contradiction, signatures};
use super::{SignedHead, StoreError};
use crate::signing::{PublicKey, Purpose, Signature};
use sqlx::{Connection, SqliteConnection};
use std::path::Path;

/// Rows that are read at once.
const PAGE: u32 = 1000;

/// Findings of a look at the signatures of all entries.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SignatureCheck {
    /// The first entry that a trusted key signed.
    pub first_signed: Option<i64>,
    /// The last one: all up to it are as they were when it was written.
    pub last_signed: Option<i64>,
    /// Entries between these that nobody signed when they were written.
    pub n_unsigned: u64,
    /// Entries before the first that other keys signed.
    pub n_others: u64,
    /// Keys that took over, in their order.
    pub took_over: Vec<(i64, PublicKey)>,
    /// The first entry behind the last signed one: nothing vouches for it and those after it.
    pub unsigned_from: Option<i64>,
    /// Faults.
    pub fault: Option<String>,
}

/// A look at all entries.
struct Walk {
    trusted: Vec<PublicKey>,
    /// Keys that were replaced, with the entry that says so.
    replaced: Vec<(PublicKey, i64)>,
    /// Words of the entry with which the log begins later, until one that is signed says them.
    removal: Option<String>,
    found: SignatureCheck,
    n_unsigned_since: u64,
}

impl Walk {
    /// Takes an entry and its signature; what is wrong with it.
    fn take(&mut self, record: &AuditRecord, signature: Option<&Signature>) -> Result<(), String> {
        let number = record.number;
        let Some(signature) = signature else {
            self.n_unsigned_since += u64::from(self.found.last_signed.is_some());
            return Ok(());
        };
        if !self.trusted.contains(&signature.key) {
            let of = self.replaced.iter().find(|(key, _)| *key == signature.key);
            return match (of, self.found.last_signed) {
                (Some((_, by)), _) => Err(format!(
                    "entry {number} is signed with a key that another took the place of with entry {by}"
                )),
                (None, Some(_)) => Err(format!(
                    "entry {number} is signed with {}, for which no key that was named vouches",
                    signature.key
                )),
                (None, None) => {
                    self.found.n_others += 1;
                    Ok(())
                }
            };
        }
        let head = Head { number, digest: record.digest };
        if !signature.is_of(Purpose::AuditHead, &head.message()) {
            return Err(format!(
                "the signature of entry {number} is not of what stands there: it or one before it was rewritten"
            ));
        }
        self.found.first_signed.get_or_insert(number);
        self.found.last_signed = Some(number);
        self.found.n_unsigned += std::mem::take(&mut self.n_unsigned_since);
        if record.entry.action == AUDIT_RETENTION {
            self.removal.take_if(|removal| *removal == record.entry.target);
        }
        self.take_over(record, signature.key);
        Ok(())
    }

    /// Trusts the key that a signed entry says takes over, from then on in the place of the one that signed.
    fn take_over(&mut self, record: &AuditRecord, signer: PublicKey) {
        if record.entry.action != AUDIT_KEY || record.entry.user.is_some() {
            return;
        }
        let named = record.entry.target.split('#').next().and_then(|text| text.parse::<PublicKey>().ok());
        let Some(named) = named.filter(|named| *named != signer) else { return };
        self.trusted.retain(|key| *key != signer && *key != named);
        self.trusted.push(named);
        self.replaced.retain(|(key, _)| *key != named);
        self.replaced.push((signer, record.number));
        self.found.took_over.push((record.number, named));
    }
}

/// Verifies the signatures of all entries whose digests were found whole.
pub(super) async fn verify(
    connection: &mut SqliteConnection,
    path: &Path,
    trusted: &[PublicKey],
    kept: Option<&SignedHead>,
) -> Result<SignatureCheck, StoreError> {
    let classify = |error| StoreError::classify(error, path);
    // Read as of one instant, as the digests are.
    let mut snapshot = connection.begin().await.map_err(classify)?;
    let found = verify_within(&mut snapshot, path, trusted, kept).await?;
    snapshot.rollback().await.map_err(classify)?;
    Ok(found)
}

async fn verify_within(
    connection: &mut SqliteConnection,
    path: &Path,
    trusted: &[PublicKey],
    kept: Option<&SignedHead>,
) -> Result<SignatureCheck, StoreError> {
    let base = base(&mut *connection, path).await?;
    let mut walk = Walk {
        trusted: trusted.to_vec(),
        replaced: Vec::new(),
        removal: (base.number > 0).then(|| removal(&base)),
        found: SignatureCheck::default(),
        n_unsigned_since: 0,
    };
    let mut last = base.number;
    'all: loop {
        let records = page(&mut *connection, path, last, PAGE).await?;
        if records.is_empty() {
            break;
        }
        let signed = signatures(&mut *connection, path, (last, PAGE)).await?;
        let mut signed = signed.iter().peekable();
        for record in records {
            while signed.next_if(|(number, _)| *number < record.number).is_some() {}
            let own = signed.peek().filter(|(number, _)| *number == record.number);
            if let Err(fault) = walk.take(&record, own.map(|(_, signature)| signature)) {
                walk.found.fault = Some(fault);
                break 'all;
            }
            last = record.number;
        }
    }
    let Walk { trusted: end, replaced, removal, mut found, .. } = walk;
    if found.fault.is_some() {
        return Ok(found);
    }
    let Some(until) = found.last_signed else {
        found.fault = Some("no entry is signed with the key that was named".to_owned());
        return Ok(found);
    };
    found.unsigned_from = (last > until).then_some(until + 1);
    let known: Vec<PublicKey> =
        trusted.iter().copied().chain(end).chain(replaced.into_iter().map(|(key, _)| key)).collect();
    found.fault = match kept {
        Some(kept) => contradiction(connection, path, kept, &known).await?,
        None => None,
    };
    if found.fault.is_none() && removal.is_some() {
        found.fault = Some(unvouched(&base));
    }
    if let (None, Some(from)) = (&found.fault, found.unsigned_from) {
        found.fault = Some(format!(
            "from entry {from} on nothing is signed: it was written without the key, or forged"
        ));
    }
    Ok(found)
}
