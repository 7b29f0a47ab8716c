//! Copies while others write, what they refuse to read, and what is put back by whoever may be killed at any moment.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use super::{at, folder, open, tamper};
use sqlx::{Connection, SqliteConnection};
use std::ops::ControlFlow;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::Command;
use videofields_recording::store::probe::{Standing, beside, probe};
use videofields_recording::store::restore::{self, Replace, Restored, Restoring, Step};
use videofields_recording::store::{self, AuditEntry, Depth, ReadOnly, SCHEMA_VERSION, Store, StoreError};
use videofields_vision::error::ErrorKind;

fn entry(target: &str) -> AuditEntry {
    AuditEntry {
        at: at(7),
        user: Some("cli:test".to_owned()),
        action: "restore".to_owned(),
        target: target.to_owned(),
        status: 200,
    }
}

/// A database with `n` scenes and as many entries in its audit log, closed.
async fn database(path: &Path, n: i64) {
    let store = open(path).await;
    for i in 0..n {
        store.put_scene(&format!("s{i}"), "{}", at(i)).await.unwrap();
        store.append_audit(&entry(&format!("/s{i}"))).await.unwrap();
    }
    store.close().await.unwrap();
}

/// Everything in a folder: names and bytes.
fn listing(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.clone(), std::fs::read(path).unwrap_or_default()))
        .collect();
    files.sort();
    files
}

async fn n_scenes(path: &Path) -> usize {
    let store = open(path).await;
    let scenes = store.scenes().await.unwrap().len();
    let audit = store.check_audit().await.unwrap();
    assert_eq!(audit.fault, None);
    store.close().await.unwrap();
    scenes
}

fn anything<'a>(from: &'a Path, database: &'a Path) -> Restoring<'a> {
    Restoring { from, database, replace: Replace::Anything, entry: entry("copy"), key: None }
}

async fn restored(from: &Path, to: &Path, replace: Replace) -> Result<Restored, StoreError> {
    let asked = Restoring { from, database: to, replace, entry: entry("copy"), key: None };
    restore::restore(asked, at(1_772_366_400_500_000_000)).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_copy_is_one_instant_s_while_others_write() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    let store = open(&path).await;
    let writer = {
        let store = store.clone();
        tokio::spawn(async move {
            for i in 0..400_i64 {
                store.put_scene(&format!("s{i:03}"), "{}", at(i)).await.unwrap();
                store.append_audit(&entry(&format!("/s{i:03}"))).await.unwrap();
            }
        })
    };
    let mut counts = Vec::new();
    for i in 0..8 {
        let to = folder.path().join(format!("copy{i}.sqlite"));
        let contents = store::copy(&path, &to).await.unwrap();
        assert_eq!(contents.schema, SCHEMA_VERSION);
        let (scenes, audit) = (contents.rows["scene"], contents.rows["audit"]);
        // A scene is written, then its entry: of one instant they differ by at most one.
        assert!((0..=1).contains(&(scenes - audit)), "{scenes} scenes, {audit} entries");
        let mode = std::fs::metadata(&to).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "passwords' digests are in it");
        assert_eq!(store::verify(&to).await.unwrap(), contents);
        counts.push(scenes);
    }
    writer.await.unwrap();
    assert!(counts.is_sorted(), "{counts:?}");
    store.close().await.unwrap();
}

#[tokio::test]
async fn what_is_no_good_database_is_refused_and_left_as_it_is() {
    let folder = folder();
    let place = |name: &str| folder.path().join(name);
    database(&place("good.sqlite"), 3).await;
    std::fs::write(place("empty.sqlite"), "").unwrap();
    std::fs::write(place("empty.sqlite-wal"), "a log").unwrap();
    std::fs::write(place("gone.sqlite-wal"), "a log").unwrap();
    std::fs::write(place("text.sqlite"), "no database").unwrap();
    database(&place("newer.sqlite"), 1).await;
    tamper(&place("newer.sqlite"), "insert into _sqlx_migrations select 9999, description, installed_on, success, checksum, execution_time from _sqlx_migrations limit 1").await;
    tamper(&place("foreign.sqlite"), "create table other (x)").await;
    database(&place("damaged.sqlite"), 300).await;
    let mut bytes = std::fs::read(place("damaged.sqlite")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..].fill(0x5a);
    std::fs::write(place("damaged.sqlite"), &bytes).unwrap();
    let before = listing(folder.path());
    let out = tempfile::tempdir().unwrap();
    let check = async |name: &str, kind: ErrorKind, expected: &str| {
        let error = store::copy(&place(name), &out.path().join("copy")).await.expect_err(name);
        assert_eq!((error.kind(), error.to_string().contains(expected)), (kind, true), "{name}: {error}");
        assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0, "{name}: nothing is left of it");
    };
    check("empty.sqlite", ErrorKind::Invalid, "its log with 5 bytes").await;
    check("gone.sqlite", ErrorKind::Invalid, "its log with 5 bytes").await;
    check("nothing.sqlite", ErrorKind::NotFound, "there is no database").await;
    check("text.sqlite", ErrorKind::Invalid, "another kind of file").await;
    check("foreign.sqlite", ErrorKind::Invalid, "another program").await;
    check("newer.sqlite", ErrorKind::Unsupported, "schema 9999").await;
    check("damaged.sqlite", ErrorKind::Internal, "damaged").await;
    // SQLite may leave an empty log and its index beside what it only read.
    let is_old = |path: &PathBuf| before.iter().any(|(old, _)| old == path);
    let after: Vec<_> = listing(folder.path()).into_iter().filter(|(path, _)| is_old(path)).collect();
    assert!(before == after, "they are as they were");
    for name in ["empty.sqlite", "gone.sqlite"] {
        assert!(matches!(Store::open(&place(name)).await, Err(StoreError::LogAlone { bytes: 5, .. })));
        assert_eq!(std::fs::read(beside(&place(name), "-wal")).unwrap(), b"a log", "it is not thrown away");
    }
}

/// Makes a database what schema 10 was.
async fn make_older(path: &Path) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("migrations");
    let mut undo = String::from("delete from _sqlx_migrations where version > 10; drop table document;");
    // The one thing of then that later schemas have otherwise.
    let of_then = std::fs::read_to_string(folder.join("0010_create_audit.sql")).unwrap();
    let trigger = of_then.split("\n\n").find(|part| part.contains("create trigger audit_is_not_shortened"));
    undo += &format!("drop trigger audit_is_not_shortened; {}", trigger.unwrap());
    for file in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = file.file_name().unwrap().to_str().unwrap().to_owned();
        let later = name.split_once('_').unwrap().0.parse::<i64>().unwrap() > 10;
        let text = std::fs::read_to_string(&file).unwrap();
        for line in text.lines().filter(|_| later) {
            if let Some(table) = line.strip_prefix("create table ") {
                undo += &format!("drop table if exists {};", table.trim_end_matches([' ', '(']));
            }
        }
    }
    // And the one table of then that has another column.
    undo += "drop index segment_by_age; drop index segment_by_writing; alter table segment drop column written_at;
             create index segment_by_age on segment (last_at);";
    tamper(path, &undo).await;
}

#[tokio::test]
async fn the_audit_log_is_shortened_by_age_alone_and_proved_from_its_anchor() {
    let folder = folder();
    let path = folder.path().join("a.sqlite");
    let store = open(&path).await;
    for i in 1..=10_i64 {
        let entry = AuditEntry { at: at(i * 1000), ..entry(&format!("/{i}")) };
        store.append_audit(&entry).await.unwrap();
    }
    let all = store.check_audit().await.unwrap();
    assert_eq!((all.n_removed, all.n_whole), (0, 10));
    assert_eq!(store.shorten_audit(at(0), at(20_000)).await.unwrap(), None);
    let fourth = store.audit(3, 1).await.unwrap()[0].digest_text();
    assert_eq!(store.shorten_audit(at(5000), at(20_000)).await.unwrap(), Some((4, fourth.clone())));
    assert_eq!(store.shorten_audit(at(5000), at(20_000)).await.unwrap(), None);
    assert_eq!(store.audit(0, 99).await.unwrap()[0].number, 5);
    let left = store.check_audit().await.unwrap();
    // Which went is told in the same stroke.
    assert_eq!((left.n_removed, left.n_whole, left.fault), (4, 7, None));
    let told = store.audit(10, 1).await.unwrap()[0].entry.target.clone();
    assert_eq!(told, format!("entries up to 4 are removed; its digest was {fourth}"));
    assert_eq!(store.audit(9, 1).await.unwrap()[0].digest_text(), all.head.unwrap());
    // The newest stays, however old it is, and the chain goes on.
    store.shorten_audit(at(i64::MAX), at(20_000)).await.unwrap();
    assert_eq!(store.append_audit(&entry("/13")).await.unwrap(), 13);
    let left = store.check_audit().await.unwrap();
    assert_eq!((left.n_removed, left.n_whole, left.fault), (10, 3, None));
    store.close().await.unwrap();
    // Nobody shortens it otherwise, or gives it another beginning.
    for sql in [
        "delete from audit where number = 11",
        "update audit_anchor set number = 11",
        "update audit_anchor set number = 9, digest = zeroblob(32)",
        "delete from audit_anchor",
    ] {
        let url = format!("sqlite://{}", path.display());
        let mut connection = SqliteConnection::connect(&url).await.unwrap();
        assert!(sqlx::raw_sql(sql).execute(&mut connection).await.is_err(), "{sql}");
        connection.close().await.unwrap();
    }
    // An entry that was changed behind it shows.
    tamper(&path, "drop trigger audit_is_not_changed; update audit set target = '/x' where number = 11")
        .await;
    let store = open(&path).await;
    assert!(store.check_audit().await.unwrap().fault.unwrap().contains("entry 11"));
    store.close().await.unwrap();
}

#[tokio::test]
async fn an_older_database_is_looked_at_without_being_changed() {
    let folder = folder();
    let path = folder.path().join("old.sqlite");
    database(&path, 3).await;
    make_older(&path).await;
    let before = std::fs::read(&path).unwrap();
    let mut old = ReadOnly::open(&path).await.unwrap();
    assert_eq!(old.schema().await.unwrap(), 10);
    assert_eq!(old.faults(Depth::Full).await.unwrap(), Vec::<String>::new());
    assert_eq!(old.audit(1, 9).await.unwrap().len(), 2);
    assert_eq!(old.check_audit().await.unwrap().n_whole, 3);
    let contents = old.contents().await.unwrap();
    assert_eq!((contents.schema, contents.rows["scene"]), (10, 3));
    old.close().await.unwrap();
    assert!(matches!(
        store::note_audit(&path, &entry("x"), None).await,
        Err(StoreError::OtherSchema { found: 10, .. })
    ));
    assert!(before == std::fs::read(&path).unwrap(), "not a byte is another");
    assert_eq!(probe(&path).unwrap().log_bytes, 0);
    // Put back it is of this schema, with one entry more.
    let to = folder.path().join("new.sqlite");
    let done = restored(&path, &to, Replace::Damaged).await.unwrap();
    assert_eq!((done.contents.schema, done.contents.rows["audit"]), (SCHEMA_VERSION, 4));
    assert_eq!(n_scenes(&to).await, 3);
}

#[tokio::test]
async fn a_copy_takes_the_place_of_what_is_there_and_no_old_log_is_replayed_over_it() {
    let folder = folder();
    let copy = folder.path().join("copy.sqlite");
    database(&copy, 2).await;
    let home = folder.path().join("home");
    std::fs::create_dir(&home).unwrap();
    let path = home.join("a.sqlite");

    // A good one stays unless it is said.
    database(&path, 5).await;
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).unwrap();
    let before = listing(&home);
    assert!(matches!(restored(&copy, &path, Replace::Damaged).await, Err(StoreError::InTheWay { .. })));
    assert!(matches!(restored(&path, &path, Replace::Anything).await, Err(StoreError::NotADatabase { .. })));
    std::fs::write(home.join("text"), "no copy").unwrap();
    assert!(restored(&home.join("text"), &path, Replace::Anything).await.is_err());
    std::fs::remove_file(home.join("text")).unwrap();
    let old: Vec<_> =
        listing(&home).into_iter().filter(|(file, _)| before.iter().any(|(old, _)| old == file)).collect();
    assert!(old == before, "nothing is changed by what is refused");

    let done = restored(&copy, &path, Replace::Anything).await.unwrap();
    assert!(done.warnings.is_empty(), "{:?}", done.warnings);
    let aside = home.join("a.sqlite.before-20260301T120000Z");
    assert!(done.aside.contains(&aside), "{:?}", done.aside);
    assert_eq!(n_scenes(&path).await, 2);
    assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    let store = open(&path).await;
    let audit = store.audit(0, 9).await.unwrap();
    let last = &audit.last().unwrap().entry;
    assert_eq!((last.action.as_str(), last.user.as_deref()), ("restore", Some("cli:test")));
    store.close().await.unwrap();
    assert_eq!(n_scenes(&aside).await, 5, "the old one is whole under its new name");

    // A log without its database, and one that is another database's.
    for main in [None, Some(""), Some("not a database at all")] {
        std::fs::remove_file(&path).unwrap();
        if let Some(main) = main {
            std::fs::write(&path, main).unwrap();
        }
        std::fs::write(beside(&path, "-wal"), "an old log").unwrap();
        let done = restored(&copy, &path, Replace::Damaged).await.unwrap();
        assert_eq!(probe(&path).unwrap().log_bytes, 0);
        let log = done.aside.iter().find(|path| path.to_string_lossy().ends_with("-wal")).unwrap();
        assert_eq!(std::fs::read(log).unwrap(), b"an old log");
        assert_eq!(n_scenes(&path).await, 2);
    }
}

/// A database whose newest scenes are in its log alone, as a killed daemon leaves it.
async fn killed(path: &Path) {
    let away = tempfile::tempdir().unwrap();
    let from = away.path().join("a.sqlite");
    let store = open(&from).await;
    for i in 0..5 {
        store.put_scene(&format!("s{i}"), "{}", at(i)).await.unwrap();
    }
    for part in ["", "-wal", "-shm"] {
        std::fs::copy(beside(&from, part), beside(path, part)).unwrap();
    }
    store.close().await.unwrap();
    assert!(probe(path).unwrap().log_bytes > 0);
}

#[tokio::test]
async fn killed_at_any_step_it_leaves_the_old_one_whole_or_the_new_one() {
    let folder = folder();
    let copy = folder.path().join("copy.sqlite");
    database(&copy, 2).await;
    let mut all = Vec::new();
    let from = copy.as_path();
    let first = folder.path().join("first.sqlite");
    killed(&first).await;
    let mut count = |step: Step| {
        all.push(step);
        ControlFlow::Continue(())
    };
    restore::restore_in_steps(anything(from, &first), at(0), &mut count).await.unwrap();
    assert_eq!(all, [Step::Copied, Step::Noted, Step::Aside, Step::Aside, Step::Aside, Step::InPlace]);
    for n in 0..all.len() {
        for undoes in [false, true] {
            let home = tempfile::tempdir().unwrap();
            let path = home.path().join("a.sqlite");
            killed(&path).await;
            let mut left = n;
            let mut at_step = |_step| match left {
                0 => ControlFlow::Break(()),
                _ => {
                    left -= 1;
                    ControlFlow::Continue(())
                }
            };
            let broken = restore::restore_in_steps(anything(from, &path), at(0), &mut at_step).await;
            assert!(matches!(broken, Err(StoreError::RestoreBrokenOff { .. })));
            if n == 0 {
                // Nothing was renamed yet: the daemon starts with what it had, and says what is left.
                assert!(restore::leftover(&path).is_some());
                assert_eq!(n_scenes(&path).await, 5);
                restored(&copy, &path, Replace::Anything).await.unwrap();
                assert!(restore::leftover(&path).is_none(), "the next one sweeps it");
                assert_eq!(n_scenes(&path).await, 2);
                continue;
            }
            let told = Store::open(&path).await.unwrap_err();
            assert!(told.to_string().contains("restore --finish"), "{told}");
            assert!(store::copy(&path, &home.path().join("copy")).await.is_err());
            assert!(restored(&copy, &path, Replace::Anything).await.is_err());
            if undoes {
                restore::undo(&path).await.unwrap();
                assert_eq!(n_scenes(&path).await, 5, "step {n}: what its log held is there");
                assert_eq!(listing(home.path()).len(), 1, "{:?}", listing(home.path()));
            } else {
                let aside = restore::finish(&path).await.unwrap();
                assert_eq!(n_scenes(&path).await, 2, "step {n}");
                let main = aside
                    .iter()
                    .find(|path| !path.to_string_lossy().contains("sqlite.before-19700101T000000Z-"));
                assert_eq!(n_scenes(main.unwrap()).await, 5, "step {n}");
            }
            assert!(matches!(restore::undo(&path).await, Err(StoreError::NothingBrokenOff { .. })));
        }
    }
}

#[tokio::test]
async fn it_is_given_to_whom_the_old_one_belonged() {
    let folder = folder();
    let (copy, path) = (folder.path().join("copy.sqlite"), folder.path().join("a.sqlite"));
    database(&copy, 1).await;
    database(&path, 1).await;
    if std::os::unix::fs::chown(&path, Some(4711), Some(4712)).is_err() {
        return; // Only root gives files away.
    }
    restored(&copy, &path, Replace::Anything).await.unwrap();
    let owner = std::fs::metadata(&path).unwrap();
    assert_eq!((owner.uid(), owner.gid()), (4711, 4712));
    assert_eq!(probe(&path).unwrap().standing, Standing::Database);
}

/// A pipe that nobody writes to.
fn pipe(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

fn names(folder: &Path) -> Vec<PathBuf> {
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.sort();
    names
}

#[tokio::test]
async fn a_copy_that_is_no_file_is_refused_by_name_and_never_waited_for() {
    let folder = folder();
    let place = |name: &str| folder.path().join(name);
    database(&place("copy.sqlite"), 2).await;
    std::os::unix::fs::symlink(place("copy.sqlite"), place("link.sqlite")).unwrap();
    pipe(&place("pipe.sqlite"));
    std::fs::create_dir(place("folder.sqlite")).unwrap();
    for name in ["journal.sqlite", "log.sqlite"] {
        std::fs::copy(place("copy.sqlite"), place(name)).unwrap();
    }
    pipe(&place("journal.sqlite-journal"));
    std::os::unix::fs::symlink("/dev/zero", place("log.sqlite-wal")).unwrap();
    let home = place("home");
    std::fs::create_dir(&home).unwrap();
    let path = home.join("a.sqlite");
    let check = async |name: &str, of: &str, what: &str| {
        let error = restored(&place(name), &path, Replace::Anything).await.expect_err(name);
        let (said, of) = (error.to_string(), place(of).display().to_string());
        assert_eq!(error.kind(), ErrorKind::Invalid, "{error}");
        assert!(said.contains(what) && said.ends_with(&of), "{name}: {error}");
        assert_eq!(names(&home), Vec::<PathBuf>::new(), "{name}");
    };
    check("link.sqlite", "link.sqlite", "a symbolic link").await;
    check("pipe.sqlite", "pipe.sqlite", "a device, pipe or socket").await;
    check("folder.sqlite", "folder.sqlite", "a directory").await;
    check("journal.sqlite", "journal.sqlite-journal", "a device, pipe or socket").await;
    check("log.sqlite", "log.sqlite-wal", "a symbolic link").await;
    let nothing = restored(&place("nothing.sqlite"), &path, Replace::Anything).await.unwrap_err();
    assert!(matches!(nothing, StoreError::NoDatabase { .. }), "{nothing}");
    // Nor is a pipe waited for that stands in the database's place.
    pipe(&path);
    let error = restored(&place("copy.sqlite"), &path, Replace::Anything).await.unwrap_err();
    assert!(error.to_string().contains("a device, pipe or socket"), "{error}");
    std::fs::remove_file(&path).unwrap();
    // A link that leads nowhere yet is put aside, or the new database's log would be written where it leads.
    let away = place("away");
    std::os::unix::fs::symlink(&away, beside(&path, "-wal")).unwrap();
    let done = restored(&place("copy.sqlite"), &path, Replace::Anything).await.unwrap();
    assert!(done.aside.iter().any(|path| path.to_string_lossy().ends_with("-wal")), "{:?}", done.aside);
    assert_eq!(n_scenes(&path).await, 2);
    assert!(!away.try_exists().unwrap());
}

#[tokio::test]
async fn a_note_that_no_restore_wrote_renames_nothing() {
    let folder = folder();
    let copy = folder.path().join("copy.sqlite");
    database(&copy, 2).await;
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("a.sqlite");
    killed(&path).await;
    std::fs::write(home.path().join("other"), "another's").unwrap();
    let mut breaks_off = |step| match step {
        Step::Noted => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    restore::restore_in_steps(anything(&copy, &path), at(0), &mut breaks_off).await.unwrap_err();
    let note = beside(&path, ".restore-note");
    let good = std::fs::read_to_string(&note).unwrap();
    let aside = |pairs: &str| format!("{{\"aside\":[{pairs}]}}");
    let odd = [
        aside(r#"["../other","a.sqlite.before-1"]"#),
        aside(r#"["other","a.sqlite.before-1"]"#),
        aside(r#"["/etc/hostname","a.sqlite.before-1"]"#),
        aside(r#"["a.sqlite-other","a.sqlite.before-1-other"]"#),
        aside(r#"["a.sqlite","../a.sqlite.before-1"]"#),
        aside(r#"["a.sqlite","a.sqlite.before-/../../a"]"#),
        aside(r#"["a.sqlite","a.sqlite.before-.."]"#),
        aside(r#"["a.sqlite","a.sqlite.before-"]"#),
        aside(r#"["a.sqlite","other"]"#),
        aside(r#"["a.sqlite-wal","a.sqlite.before-1"]"#),
        aside(r#"["a.sqlite","a.sqlite.before-1"],["a.sqlite","a.sqlite.before-1"]"#),
        aside(r#"["a.sqlite-wal","a.sqlite.before-1-wal"],["a.sqlite","a.sqlite.before-2"]"#),
        good.replace("{\"aside\"", "{\"more\":1,\"aside\""),
        format!("{good}{}", " ".repeat(64 << 10)),
        String::new(),
    ];
    let check = async |what: &str| {
        let before = names(home.path());
        for error in [restore::finish(&path).await.unwrap_err(), restore::undo(&path).await.unwrap_err()] {
            assert_eq!(error.kind(), ErrorKind::Invalid, "{what}: {error}");
            let said = error.to_string();
            assert!(
                said.contains("nothing is renamed") && said.ends_with(".restore-note"),
                "{what}: {error}"
            );
        }
        assert_eq!(names(home.path()), before, "{what}");
        assert!(matches!(Store::open(&path).await, Err(StoreError::RestoreBrokenOff { .. })));
    };
    for text in odd {
        std::fs::write(&note, &text).unwrap();
        check(&text[..text.len().min(100)]).await;
    }
    std::fs::write(home.path().join("good"), &good).unwrap();
    std::fs::remove_file(&note).unwrap();
    std::os::unix::fs::symlink(home.path().join("good"), &note).unwrap();
    check("a link").await;
    std::fs::remove_file(&note).unwrap();
    pipe(&note);
    check("a pipe").await;
    std::fs::remove_file(&note).unwrap();
    std::fs::create_dir(&note).unwrap();
    check("a folder").await;
    std::fs::remove_dir(&note).unwrap();
    std::fs::write(&note, &good).unwrap();
    restore::undo(&path).await.unwrap();
    assert_eq!(n_scenes(&path).await, 5, "its own note is carried out");
    assert_eq!(std::fs::read(home.path().join("other")).unwrap(), b"another's");
}
