//! Whether all snapshots of a folder are as they were sealed, none is missing from their chain, and the index agrees.

use super::EvidenceError;
use super::folder::{find, names};
use super::record::{Link, hex, is_snapshot_id};
use super::verify::verify_place;
use std::collections::BTreeMap;
use std::path::Path;
use videofields_recording::store::Store;

/// Faults that are told one by one.
const MAX_TOLD: usize = 100;

/// Rows that are read at once.
const PAGE: u32 = 1000;

/// What a look at a folder found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CheckedFolder {
    /// Snapshots that are there.
    pub n_there: u64,
    /// Links of snapshots that were removed.
    pub n_removed: u64,
    /// The number of the first link of the chain: what was before it has been forgotten. 0 where there is none.
    pub first: i64,
    /// The SHA-256 of the record that was sealed last, removed or not: whoever noted it can tell later that nothing before it
    /// was changed, taken out or put in.
    pub head: Option<String>,
    /// Each that is there in the order of the chain, with the public key, hexadecimal, of who signed it.
    pub signers: Vec<(String, Option<String>)>,
    /// What is wrong, at most a hundred lines.
    pub faults: Vec<String>,
    /// How much is wrong.
    pub n_faults: u64,
    /// Digest, and whether it was removed, by id.
    links: BTreeMap<String, (String, bool)>,
}

impl CheckedFolder {
    fn fault(&mut self, fault: String) {
        self.n_faults += 1;
        if self.faults.len() < MAX_TOLD {
            self.faults.push(fault);
        }
    }
}

/// Looks at every snapshot of a folder, by itself and in the chain. Changes nothing.
///
/// # Errors
/// When the folder cannot be read.
pub fn check_folder(path: &Path) -> Result<CheckedFolder, EvidenceError> {
    let mut checked = CheckedFolder::default();
    let mut chain: Vec<Link> = Vec::new();
    let mut signers = BTreeMap::new();
    for id in names(path)?.into_iter().filter(|name| is_snapshot_id(name)) {
        let place = path.join(&id);
        let found = match find(&place) {
            Ok(found) => found,
            Err(error) => {
                checked.fault(format!("{id}: {error}"));
                continue;
            }
        };
        if found.link.id != id {
            checked.fault(format!("{id}: its link is that of {}", found.link.id));
            continue;
        }
        let is_removed = found.removal.is_some();
        if is_removed {
            checked.n_removed += 1;
        } else {
            checked.n_there += 1;
            let verified = verify_place(&place);
            signers.insert(found.link.number, (id.clone(), verified.signed_by));
            for fault in verified.faults {
                checked.fault(format!("{id}: {fault}"));
            }
        }
        checked.links.insert(id, (found.link.digest.clone(), is_removed));
        chain.push(found.link);
    }
    chain.sort_by_key(|link| link.number);
    checked.signers = signers.into_values().collect();
    checked.first = chain.first().map_or(0, |link| link.number);
    for pair in chain.windows(2) {
        let (before, link) = (&pair[0], &pair[1]);
        if link.number == before.number {
            checked.fault(format!("{} and {} have the same place in the chain", before.id, link.id));
        } else if link.number != before.number + 1 {
            let n = link.number - before.number - 1;
            checked.fault(format!("{}: {n} snapshots before it are missing", link.id));
        } else if link.previous != before.digest {
            checked.fault(format!("{}: is not chained to {}, which is before it", link.id, before.id));
        }
    }
    if let Some(first) = chain.first()
        && first.number == 1
        && first.previous != "0".repeat(64)
    {
        checked.fault(format!("{}: is the first, but is chained to another", first.id));
    }
    checked.head = chain.last().map(|link| link.digest.clone());
    Ok(checked)
}

/// Holds the index against what a look at the folder found.
///
/// # Errors
/// When the database fails.
pub async fn check_index(store: &Store, mut checked: CheckedFolder) -> Result<CheckedFolder, EvidenceError> {
    let (mut after, mut links) = (0, std::mem::take(&mut checked.links));
    loop {
        let rows = store.snapshot_chain(after, PAGE).await?;
        let Some(last) = rows.last() else { break };
        after = last.number;
        for row in rows {
            let known = (hex(&row.digest), row.removed_at.is_some());
            match links.remove(&row.id) {
                Some(found) if found == known => {}
                Some((digest, _)) if digest != known.0 => {
                    checked.fault(format!("{}: is not the one that the index has", row.id));
                }
                Some((_, true)) => checked.fault(format!("{}: was removed, and the index has it", row.id)),
                Some((_, false)) => {
                    checked.fault(format!("{}: the index says that it was removed, and it is there", row.id));
                }
                None => checked.fault(format!("{}: is missing from the folder", row.id)),
            }
        }
    }
    for id in links.keys() {
        checked.fault(format!("{id}: is not in the index"));
    }
    Ok(checked)
}
