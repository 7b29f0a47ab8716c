//! The audit log against who has the database's file: lines that are forged, ends that are cut off, older copies that are put in
//! its place, and keys that take over.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use super::{at, folder, open, tamper};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use videofields_recording::signing::{PublicKey, SigningKey};
use videofields_recording::store::restore::{self, Replace, Restoring};
use videofields_recording::store::{
    self, AUDIT_CHANGED, AUDIT_KEY, AUDIT_RESTORE, AUDIT_UNSIGNED, AuditEntry, AuditKeys, NoteSigner,
    ReadOnly, SignatureCheck, SignedHead, Store,
};

/// Takes away what keeps programs from changing the log by mistake.
const OPEN: &str = "drop trigger if exists audit_is_not_changed; drop trigger if exists audit_is_not_shortened; \
                    drop trigger if exists audit_signature_is_not_changed; \
                    drop trigger if exists audit_signature_is_not_shortened; \
                    drop trigger if exists audit_anchor_moves_on;";

/// A daemon's folder, with its keys.
struct Site {
    folder: TempDir,
    database: PathBuf,
    head: PathBuf,
}

fn entry(target: &str) -> AuditEntry {
    AuditEntry {
        at: at(7),
        user: Some("ann".to_owned()),
        action: "GET /a".to_owned(),
        target: target.to_owned(),
        status: 200,
    }
}

impl Site {
    fn new() -> Self {
        let folder = folder();
        let (database, head) = (folder.path().join("a.sqlite"), folder.path().join("head"));
        SigningKey::make(&folder.path().join("one")).unwrap();
        SigningKey::make(&folder.path().join("two")).unwrap();
        Self { folder, database, head }
    }

    fn key(&self, name: &str) -> SigningKey {
        SigningKey::read(&self.folder.path().join(name)).unwrap()
    }

    fn signer<'a>(&'a self, key: &'a SigningKey) -> NoteSigner<'a> {
        NoteSigner { key, head_file: &self.head }
    }

    fn public(&self, name: &str) -> PublicKey {
        self.key(name).public()
    }

    /// Starts a daemon that signs with a key, after another one where that is named.
    async fn start(&self, key: &str, before: Option<&str>) -> Store {
        let store = open(&self.database).await;
        let keys = AuditKeys {
            key: Arc::new(self.key(key)),
            before: before.map(|name| self.key(name)),
            head_file: self.head.clone(),
        };
        store.sign_audit(keys, at(1)).await.unwrap();
        store
    }

    /// With so many entries of ann's, signed with key `one`, and the daemon stopped.
    async fn written(n: usize) -> Self {
        let site = Self::new();
        let store = site.start("one", None).await;
        note(&store, "", n).await;
        store.close().await.unwrap();
        site
    }

    async fn verify(&self, trusted: &[&str]) -> SignatureCheck {
        let head = SignedHead::read(&self.head).unwrap();
        self.verify_with(trusted, head.as_ref()).await
    }

    async fn verify_with(&self, trusted: &[&str], head: Option<&SignedHead>) -> SignatureCheck {
        let trusted: Vec<PublicKey> = trusted.iter().map(|name| self.public(name)).collect();
        let mut database = ReadOnly::open(&self.database).await.unwrap();
        assert_eq!(database.check_audit().await.unwrap().fault, None, "who forges computes digests too");
        let found = database.check_signatures(&trusted, head).await.unwrap();
        database.close().await.unwrap();
        found
    }

    async fn fault(&self, trusted: &[&str]) -> String {
        self.verify(trusted).await.fault.unwrap()
    }

    /// Rewrites all entries with right digests, as who has the file and not the key can, and leaves the signatures.
    async fn forge(&self, n: usize) {
        self.tamper("delete from audit").await;
        let store = open(&self.database).await;
        note(&store, "forged", n).await;
        store.close().await.unwrap();
    }

    async fn tamper(&self, sql: &str) {
        tamper(&self.database, &format!("{OPEN} {sql}")).await;
    }
}

async fn note(store: &Store, text: &str, n: usize) {
    for i in 0..n {
        store.append_audit(&entry(&format!("/{text}{i}"))).await.unwrap();
    }
}

/// Action and target of the last entries.
async fn last(store: &Store, n: usize) -> Vec<(String, String)> {
    let all = store.audit(0, 999).await.unwrap();
    let told = all.iter().skip(all.len() - n);
    told.map(|record| (record.entry.action.clone(), record.entry.target.clone())).collect()
}

#[tokio::test]
async fn a_signed_log_is_verified_from_its_first_signature_on() {
    let site = Site::new();
    let store = open(&site.database).await;
    note(&store, "before", 2).await;
    store.close().await.unwrap();
    let store = site.start("one", None).await;
    note(&store, "", 3).await;
    let state = store.audit_state();
    let signed = state.signed.unwrap();
    assert_eq!((state.head.unwrap().0, state.fault, signed.signed_by()), (6, None, Some(site.public("one"))));
    assert_eq!(SignedHead::read(&site.head).unwrap(), Some(signed));
    store.close().await.unwrap();
    let found = site.verify(&["one"]).await;
    assert_eq!((found.first_signed, found.last_signed, found.fault), (Some(3), Some(6), None));
    // Started again, nothing has to be told.
    let store = site.start("one", None).await;
    assert_eq!(store.audit(0, 99).await.unwrap().len(), 6);
    assert_eq!(store.audit_state().fault, None);
    store.close().await.unwrap();
    assert_eq!(site.fault(&["two"]).await, "no entry is signed with the key that was named");
}

#[tokio::test]
async fn a_log_that_was_rewritten_whole_is_noticed() {
    // With the signatures as they were.
    let site = Site::written(4).await;
    site.forge(5).await;
    assert!(site.fault(&["one"]).await.starts_with("the signature of entry 1 is not of what stands there"));
    // Without any.
    let site = Site::written(4).await;
    site.tamper("delete from audit_signature").await;
    site.forge(5).await;
    assert_eq!(site.fault(&["one"]).await, "no entry is signed with the key that was named");
    // With those of another key.
    let site = Site::written(4).await;
    site.tamper("delete from audit; delete from audit_signature").await;
    std::fs::remove_file(&site.head).unwrap();
    let store = site.start("two", None).await;
    note(&store, "forged", 4).await;
    store.close().await.unwrap();
    assert_eq!(site.fault(&["one"]).await, "no entry is signed with the key that was named");
    // From the middle on, with a key of the forger's from there.
    let site = Site::written(4).await;
    site.tamper("delete from audit where number > 3; delete from audit_signature where number > 3").await;
    let store = site.start("two", None).await;
    note(&store, "forged", 2).await;
    assert!(store.audit_state().fault.is_some());
    store.close().await.unwrap();
    let fault = site.fault(&["one"]).await;
    assert!(
        fault.starts_with("entry 4 is signed with") && fault.ends_with("no key that was named vouches"),
        "{fault}"
    );
}

#[tokio::test]
async fn lines_that_are_added_without_the_key_are_told() {
    let site = Site::written(2).await;
    let store = open(&site.database).await;
    note(&store, "forged", 2).await;
    store.close().await.unwrap();
    let found = site.verify(&["one"]).await;
    assert_eq!((found.last_signed, found.unsigned_from), (Some(3), Some(4)));
    assert!(found.fault.unwrap().starts_with("from entry 4 on nothing is signed"));
    // The daemon does not take them for its own.
    let store = site.start("one", None).await;
    assert_eq!(last(&store, 1).await, [(AUDIT_UNSIGNED.to_owned(), "entries 4 to 5".to_owned())]);
    // Also not while it runs.
    store::note_audit(&site.database, &entry("/forged"), None).await.unwrap();
    note(&store, "", 1).await;
    assert_eq!(last(&store, 2).await[0], (AUDIT_UNSIGNED.to_owned(), "entries 7 to 7".to_owned()));
    // A command that has the key is no stranger.
    store::note_audit(&site.database, &entry("/cli"), Some(site.signer(&site.key("one")))).await.unwrap();
    note(&store, "", 1).await;
    assert_eq!(last(&store, 2).await[0].1, "/cli");
    assert_eq!(store.audit_state().n_faults, 0);
    store.close().await.unwrap();
    let found = site.verify(&["one"]).await;
    assert_eq!((found.fault, found.n_unsigned, found.unsigned_from), (None, 3, None));
}

#[tokio::test]
async fn an_end_that_was_cut_off_is_noticed() {
    let site = Site::written(4).await;
    let cut = "delete from audit where number > 3; delete from audit_signature where number > 3";
    site.tamper(cut).await;
    // The log alone does not tell.
    assert_eq!(site.verify_with(&["one"], None).await.fault, None);
    let expected = "the log ends at entry 3, but 5:";
    assert!(site.fault(&["one"]).await.starts_with(expected));
    // Nor is a head of the forger's taken.
    let kept = std::fs::read_to_string(&site.head).unwrap();
    let other = SigningKey::make(&site.folder.path().join("forger")).unwrap();
    std::fs::write(&site.head, kept.replace(&site.public("one").to_string(), &other.to_string())).unwrap();
    assert_eq!(site.fault(&["one"]).await, "the signed head is not signed with a key of this log");
    std::fs::write(&site.head, kept).unwrap();
    // The daemon says so at its start, in its log.
    let store = site.start("one", None).await;
    assert!(store.audit_state().fault.unwrap().starts_with(expected));
    let told = last(&store, 1).await.pop().unwrap();
    assert!(told.0 == AUDIT_CHANGED && told.1.starts_with(expected), "{told:?}");
    store.close().await.unwrap();
    // Without the file it says that.
    std::fs::remove_file(&site.head).unwrap();
    let store = site.start("one", None).await;
    assert!(store.audit_state().fault.unwrap().starts_with("the signed head is gone"));
    store.close().await.unwrap();
}

#[tokio::test]
async fn what_is_done_to_the_log_while_the_daemon_runs_is_noticed() {
    for is_signed in [true, false] {
        for (sql, expected) in [
            (
                "delete from audit where number > 3; delete from audit_signature where number > 3",
                "entry 5 is missing: the log ends at entry 3",
            ),
            ("update audit set digest = zeroblob(32) where number = 5", "entry 5 is not as it was written"),
            (
                "insert into audit values (6, 0, 'eve', 'x', 'y', 200, zeroblob(32))",
                "entry 6 does not follow the one before",
            ),
        ] {
            let site = Site::new();
            let store = if is_signed {
                site.start("one", None).await
            } else {
                let store = open(&site.database).await;
                note(&store, "first", 1).await;
                store
            };
            note(&store, "", 4).await;
            store.check_audit_head(at(8)).await.unwrap();
            assert_eq!(store.audit_state().fault, None);
            site.tamper(sql).await;
            store.check_audit_head(at(8)).await.unwrap();
            assert!(store.audit_state().fault.unwrap().starts_with(expected), "{expected}");
            // The next entry says so before it.
            note(&store, "next", 1).await;
            let told = last(&store, 2).await;
            assert!(told[0].0 == AUDIT_CHANGED && told[0].1.starts_with(expected), "{told:?}");
            assert_eq!((told[1].1.as_str(), store.audit_state().n_faults), ("/next0", 1));
            store.check_audit_head(at(8)).await.unwrap();
            assert_eq!(store.audit_state().n_faults, 1, "once");
            store.close().await.unwrap();
        }
    }
    // In the middle it is found by a look at all of it.
    let site = Site::new();
    let store = site.start("one", None).await;
    note(&store, "", 4).await;
    site.tamper("update audit set user = 'eve' where number = 3").await;
    store.check_audit_head(at(8)).await.unwrap();
    assert_eq!(store.audit_state().fault, None);
    store.check_whole_audit(at(8)).await.unwrap();
    assert!(store.audit_state().fault.unwrap().starts_with("entry 3 or one before it"));
    store.close().await.unwrap();
}

#[tokio::test]
async fn another_key_takes_over_by_the_one_before() {
    let site = Site::written(2).await;
    let store = site.start("two", Some("one")).await;
    let (one, two) = (site.public("one"), site.public("two"));
    let said = |words: String| (AUDIT_KEY.to_owned(), format!("{two}#{words}"));
    assert_eq!(last(&store, 2).await, [said(format!("after={one}")), said("signs".to_owned())]);
    note(&store, "", 2).await;
    assert_eq!(store.audit_state().n_faults, 0, "the head that the old key signed is one of this log");
    store.close().await.unwrap();
    let found = site.verify(&["one"]).await;
    assert_eq!((found.fault, found.took_over, found.last_signed), (None, vec![(4, two)], Some(7)));
    let found = site.verify(&["two"]).await;
    assert_eq!((found.fault, found.n_others, found.first_signed), (None, 4, Some(5)));
    // The old key, once it is replaced, signs nothing any more.
    let store = open(&site.database).await;
    store.note_audit(&entry("/stolen"), Some(site.signer(&site.key("one")))).await.unwrap();
    store.close().await.unwrap();
    let expected = "entry 8 is signed with a key that another took the place of with entry 4";
    assert_eq!(site.fault(&["one"]).await, expected);
    // A key for which nobody vouches has to be named.
    let site = Site::written(2).await;
    let store = site.start("two", None).await;
    let unvouched = format!("{}#unvouched_after={}", site.public("two"), site.public("one"));
    assert_eq!(last(&store, 2).await[0], (AUDIT_KEY.to_owned(), unvouched));
    note(&store, "", 1).await;
    store.close().await.unwrap();
    assert!(site.fault(&["one"]).await.starts_with("entry 4 is signed with"));
    assert_eq!(site.verify(&["one", "two"]).await.fault, None);
}

#[tokio::test]
async fn a_restore_is_told_from_an_older_copy_that_was_put_there() {
    for is_signed in [true, false] {
        let site = Site::written(2).await;
        let copy = site.folder.path().join("copy.sqlite");
        store::copy(&site.database, &copy).await.unwrap();
        let store = site.start("one", None).await;
        note(&store, "later", 3).await;
        store.close().await.unwrap();
        // As who has no key does.
        let stash = std::fs::read(&site.database).unwrap();
        std::fs::copy(&copy, &site.database).unwrap();
        assert!(site.fault(&["one"]).await.starts_with("the log ends at entry 3, but 6:"));
        std::fs::write(&site.database, stash).unwrap();
        // As `videofields restore` does.
        let kept = SignedHead::read(&site.head).unwrap().unwrap();
        let said = AuditEntry {
            action: AUDIT_RESTORE.to_owned(),
            target: format!("/copy{}", store::replaced(&kept.noted())),
            ..entry("")
        };
        let key = site.key("one");
        let asked = Restoring {
            from: &copy,
            database: &site.database,
            replace: Replace::Anything,
            entry: said,
            key: is_signed.then_some(&key),
        };
        restore::restore(asked, at(9)).await.unwrap();
        if is_signed {
            assert_eq!(site.verify(&["one"]).await.fault, None);
        }
        let store = site.start("one", None).await;
        assert_eq!(store.audit_state().fault.is_some(), !is_signed, "{:?}", store.audit_state());
        note(&store, "since", 1).await;
        store.close().await.unwrap();
        assert_eq!(site.verify(&["one"]).await.fault, None);
    }
}

#[tokio::test]
async fn a_beginning_that_was_taken_away_is_told_from_retention() {
    let site = Site::written(4).await;
    let store = site.start("one", None).await;
    store.append_audit(&AuditEntry { at: at(50), ..entry("/young") }).await.unwrap();
    let (removed, _) = store.shorten_audit(at(20), at(60)).await.unwrap().unwrap();
    store.close().await.unwrap();
    let found = site.verify(&["one"]).await;
    assert_eq!((removed, found.fault, found.first_signed), (5, None, Some(6)));
    // As who has the file can do it, by what the database allows.
    let forged = "update audit_anchor set number = 6, digest = (select digest from audit where number = 6);
                  delete from audit where number <= 6; delete from audit_signature where number <= 6";
    tamper(&site.database, forged).await;
    let fault = site.fault(&["one"]).await;
    assert!(fault.starts_with("the entries up to 6 are gone, and no entry that is signed says"), "{fault}");
}

#[tokio::test]
async fn whoever_reads_a_head_that_is_none_is_told() {
    let site = Site::written(1).await;
    std::fs::write(&site.head, "{").unwrap();
    assert!(SignedHead::read(&site.head).is_err());
    let store = site.start("one", None).await;
    assert!(store.audit_state().fault.unwrap().starts_with("the signed head cannot be read"));
    store.close().await.unwrap();
    assert!(SignedHead::read(Path::new("/nowhere/head")).unwrap().is_none());
}

/// Words of a base for which nobody vouches.
fn gone(base: i64) -> String {
    format!(
        "the entries up to {base} are gone, and no entry that is signed says that they were removed for their age"
    )
}

/// Moves the base to an entry and takes away what stood before it.
fn without(base: i64) -> String {
    format!(
        "update audit_anchor set number = {base}, digest = (select digest from audit where number = {base});
         delete from audit where number <= {base}; delete from audit_signature where number <= {base};"
    )
}

#[tokio::test]
async fn a_log_that_was_emptied_and_given_another_base_is_told_at_the_next_start() {
    for (base, sql) in [
        (100_000, "update audit_anchor set number = 100000, digest = zeroblob(32)".to_owned()),
        (5, without(5)),
    ] {
        let site = Site::written(4).await;
        site.tamper(&format!("{sql}; delete from audit; delete from audit_signature")).await;
        let store = site.start("one", None).await;
        assert_eq!(store.audit_state().fault, Some(gone(base)));
        assert_eq!(last(&store, 1).await, [(AUDIT_CHANGED.to_owned(), gone(base))]);
        store.close().await.unwrap();
        // It stands in the log, and is told once.
        let store = site.start("one", None).await;
        assert_eq!((store.audit_state().n_faults, store.audit(0, 99).await.unwrap().len()), (0, 2));
        store.close().await.unwrap();
        assert_eq!(site.fault(&["one"]).await, gone(base));
    }
}

#[tokio::test]
async fn a_beginning_that_is_taken_away_while_the_daemon_runs_is_told_also_where_it_is_said_to_be_old() {
    for forges in [false, true] {
        let site = Site::new();
        let store = site.start("one", None).await;
        note(&store, "", 7).await;
        let digest = store.audit(3, 1).await.unwrap()[0].digest_text();
        site.tamper(&without(4)).await;
        if forges {
            let target = format!("entries up to 4 are removed; its digest was {digest}");
            let forged = AuditEntry { user: None, action: "audit retention".to_owned(), ..entry(&target) };
            store::note_audit(&site.database, &forged, None).await.unwrap();
            // The daemon's signature of the next one is of all before it, too.
            note(&store, "next", 1).await;
        }
        store.check_audit_head(at(8)).await.unwrap();
        let state = store.audit_state();
        assert_eq!((state.fault, state.n_faults), (Some(gone(4)), 1));
        let n = store.audit(0, 99).await.unwrap().len();
        assert_eq!(last(&store, 1).await, [(AUDIT_CHANGED.to_owned(), gone(4))]);
        store.check_whole_audit(at(8)).await.unwrap();
        assert_eq!((store.audit_state().n_faults, store.audit(0, 99).await.unwrap().len()), (1, n), "once");
        store.close().await.unwrap();
        assert_eq!(site.fault(&["one"]).await, gone(4));
    }
}

#[tokio::test]
async fn retention_does_not_hide_that_a_beginning_was_taken_away() {
    let site = Site::new();
    let store = site.start("one", None).await;
    note(&store, "", 7).await;
    site.tamper(&without(3)).await;
    assert_eq!(store.shorten_audit(at(20), at(60)).await.unwrap().unwrap().0, 7);
    assert_eq!(store.audit_state().fault, Some(gone(3)));
    let told = last(&store, 2).await;
    assert_eq!(told[0], (AUDIT_CHANGED.to_owned(), gone(3)));
    assert!(told[1].1.starts_with("entries up to 7 are removed"), "{told:?}");
    // Nothing is told after that.
    assert_eq!(store.shorten_audit(at(70), at(80)).await.unwrap().unwrap().0, 9);
    store.check_whole_audit(at(80)).await.unwrap();
    assert_eq!((store.audit_state().n_faults, last(&store, 1).await.len()), (1, 1));
    store.close().await.unwrap();
    assert_eq!(site.verify(&["one"]).await.fault, None);
}

#[tokio::test]
async fn retention_of_before_the_key_and_under_other_keys_is_none_of_these() {
    let site = Site::new();
    let store = open(&site.database).await;
    note(&store, "old", 4).await;
    store.shorten_audit(at(20), at(60)).await.unwrap().unwrap();
    store.check_whole_audit(at(60)).await.unwrap();
    assert_eq!(store.audit_state().fault, None);
    let copy = site.folder.path().join("copy.sqlite");
    store.close().await.unwrap();
    store::copy(&site.database, &copy).await.unwrap();
    // The key vouches for what it found, and so does the next one.
    for (key, before) in [("one", None), ("one", None), ("two", Some("one")), ("two", None)] {
        let store = site.start(key, before).await;
        store.check_whole_audit(at(61)).await.unwrap();
        assert_eq!(store.audit_state().fault, None, "{key}");
        store.close().await.unwrap();
        assert_eq!(site.verify(&[key]).await.fault, None, "{key}");
    }
    assert_eq!(site.verify(&["one"]).await.fault, None);
    let store = site.start("two", None).await;
    note(&store, "new", 2).await;
    store.shorten_audit(at(20), at(62)).await.unwrap().unwrap();
    store.check_whole_audit(at(62)).await.unwrap();
    assert_eq!(store.audit_state().fault, None);
    store.close().await.unwrap();
    // A copy of before the key is put back by who has it.
    let kept = SignedHead::read(&site.head).unwrap().unwrap();
    let target = format!("/copy{}", store::replaced(&kept.noted()));
    let key = site.key("two");
    let asked = Restoring {
        from: &copy,
        database: &site.database,
        replace: Replace::Anything,
        entry: AuditEntry { action: AUDIT_RESTORE.to_owned(), target, ..entry("") },
        key: Some(&key),
    };
    restore::restore(asked, at(63)).await.unwrap();
    let store = site.start("two", None).await;
    store.check_whole_audit(at(64)).await.unwrap();
    assert_eq!(store.audit_state().fault, None);
    store.close().await.unwrap();
    assert_eq!(site.verify(&["two"]).await.fault, None);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_removed_for_its_age_while_the_log_is_looked_at_is_no_fault() {
    let site = Site::new();
    let store = open(&site.database).await;
    note(&store, "", 1100).await;
    store.close().await.unwrap();
    let store = site.start("one", None).await;
    let (stop, stopped) = tokio::sync::watch::channel(());
    let looks = [0, 1, 2].map(|_| {
        let (store, stopped) = (store.clone(), stopped.clone());
        tokio::spawn(async move {
            let mut faults = Vec::new();
            while stopped.has_changed().is_ok() {
                faults.extend(store.check_audit().await.unwrap().fault);
            }
            faults
        })
    });
    let (database, public) = (site.database.clone(), site.public("one"));
    let verifies = tokio::spawn(async move {
        let mut faults = Vec::new();
        while stopped.has_changed().is_ok() {
            let mut database = ReadOnly::open(&database).await.unwrap();
            faults.extend(database.check_signatures(&[public], None).await.unwrap().fault);
            database.close().await.unwrap();
        }
        faults
    });
    // It takes away a page that is to be read next.
    tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    store.shorten_audit(at(20), at(60)).await.unwrap().unwrap();
    tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    drop(stop);
    for look in looks {
        assert_eq!(look.await.unwrap(), Vec::<String>::new());
    }
    assert_eq!(verifies.await.unwrap(), Vec::<String>::new());
    store.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whoever_leaves_while_the_signed_head_is_written_makes_no_false_alarm() {
    let site = Site::new();
    let store = site.start("one", None).await;
    let number = || store.audit_state().head.map(|(number, _)| number);
    for i in 0..150 {
        let (writing, before) = (store.clone(), number());
        let leaving =
            tokio::spawn(async move { writing.append_audit(&entry(&format!("/{i}"))).await.unwrap() });
        while number() == before {
            tokio::task::yield_now().await;
        }
        leaving.abort();
    }
    note(&store, "last", 1).await;
    let state = store.audit_state();
    assert_eq!(state.fault, None);
    store.close().await.unwrap();
    // Those that come late are over.
    tokio::time::sleep(std::time::Duration::from_millis(100)).await;
    assert_eq!(SignedHead::read(&site.head).unwrap(), state.signed);
    let store = site.start("one", None).await;
    assert_eq!(store.audit_state().fault, None);
    store.close().await.unwrap();
}

#[tokio::test]
async fn what_commands_sign_before_the_daemons_first_start_is_no_fault_and_its_head_is_looked_for() {
    let site = Site::new();
    open(&site.database).await.close().await.unwrap();
    let key = site.key("one");
    for target in ["/users/ann", "/users/ben"] {
        store::note_audit(&site.database, &entry(target), Some(site.signer(&key))).await.unwrap();
    }
    let store = site.start("one", None).await;
    assert_eq!(store.audit_state().fault, None);
    store.close().await.unwrap();
    let store = site.start("one", None).await;
    assert_eq!(store.audit_state().n_faults, 0);
    store.close().await.unwrap();
    // A head that is removed is missed, also where a command has been there since.
    std::fs::remove_file(&site.head).unwrap();
    store::note_audit(&site.database, &entry("/users/cleo"), Some(site.signer(&key))).await.unwrap();
    let store = site.start("one", None).await;
    assert!(store.audit_state().fault.unwrap().starts_with("the signed head is gone"));
    store.close().await.unwrap();
}
