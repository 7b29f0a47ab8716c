//! A daemon that signs its audit log: keys, what verifies them, who changes the database beside it, and restores.

use super::process::{Daemon, Output, run, videofields};
use super::{CAMERAS, demo};
use sqlx::{Connection, SqliteConnection};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use tempfile::TempDir;
use videofields_vision::clock::{Clock, SystemClock};

/// Longest that the daemon may take to notice.
const PATIENCE: Duration = Duration::from_secs(60);

fn command(name: &str, config: &Path, arguments: &[&str]) -> Command {
    let mut command = videofields();
    command.arg(name).arg("--config").arg(config).args(arguments);
    command
}

fn check(command: &mut Command, status: i32, expected: &str) -> Output {
    let output = run(command);
    let said = format!("{}{}", output.stdout, output.stderr);
    assert_eq!(output.status, Some(status), "{command:?}: {said}");
    assert!(said.contains(expected), "{expected:?} is not in {said}");
    output
}

/// The demo with a key; the configuration's path, and those of database and public key.
fn signed(folder: &Path) -> (PathBuf, PathBuf, String) {
    let config = demo(folder);
    let key = folder.join("audit.key");
    check(&mut command("audit", &config, &["key", "--out", key.to_str().unwrap()]), 0, "whose public key");
    check(
        &mut command("audit", &config, &["key", "--out", key.to_str().unwrap()]),
        1,
        "cannot write the key",
    );
    let text = std::fs::read_to_string(&config).unwrap();
    let line = "database = \"kept.sqlite\"\n";
    let text = text.replacen(line, &format!("{line}audit_key = \"audit.key\"\n"), 1);
    std::fs::write(&config, text).unwrap();
    (config, folder.join("kept.sqlite"), format!("{}.pub", key.display()))
}

fn change(database: &Path, sql: &str) {
    let done = async {
        let mut connection = SqliteConnection::connect(&format!("sqlite://{}", database.display())).await?;
        sqlx::raw_sql(sqlx::AssertSqlSafe(sql)).execute(&mut connection).await?;
        connection.close().await
    };
    tokio::runtime::Runtime::new().unwrap().block_on(done).unwrap();
}

#[test]
fn a_signed_log_is_verified_and_what_is_done_to_it_is_told() {
    let folder = TempDir::new().unwrap();
    let (config, database, public) = signed(folder.path());
    let verify = ["verify", "--public-key", &public];
    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&CAMERAS);
    let copy = folder.path().join("copy.sqlite");
    check(&mut command("backup", &config, &["--out", copy.to_str().unwrap()]), 0, "");
    assert_eq!(daemon.get("/api/v1/cameras/west/frame.jpg").status, 200);
    let audit = daemon.json("/api/v1/system")["audit"].clone();
    assert!(audit["signature"]["key"].is_string() && audit["fault"].is_null(), "{audit}");
    check(&mut command("audit", &config, &verify), 0, "entries 1 to 3 are signed");

    // Somebody opens the database beside the daemon.
    let forge = "drop trigger audit_is_not_changed; update audit set target = '/', digest = zeroblob(32) where number = 3";
    change(&database, forge);
    let clock = SystemClock::new();
    let fault = loop {
        let audit = daemon.json("/api/v1/system")["audit"].clone();
        if let Some(fault) = audit["fault"].as_str() {
            break fault.to_owned();
        }
        assert!(clock.monotonic() < PATIENCE, "{audit}");
        clock.sleep(Duration::from_millis(100));
    };
    assert!(fault.starts_with("entry 3 is not as it was written"), "{fault}");
    let metrics = String::from_utf8(daemon.get("/metrics").body).unwrap();
    assert!(metrics.contains("videofields_audit_faults_total"), "{metrics}");
    let stopped = daemon.stop("TERM");
    assert!(stopped.stderr.contains("the audit log is not as this daemon wrote it"), "{}", stopped.stderr);
    check(&mut command("audit", &config, &verify), 1, "entry 3 or one before it is not as it was written");

    // An older copy is no restore, unless the key says so.
    for part in ["kept.sqlite-wal", "kept.sqlite-shm"].map(|part| folder.path().join(part)) {
        if part.try_exists().unwrap() {
            std::fs::remove_file(part).unwrap();
        }
    }
    std::fs::copy(&copy, &database).unwrap();
    check(&mut command("audit", &config, &verify), 1, "the log ends at entry 1, but 3:");
    check(&mut command("restore", &config, &["--force", copy.to_str().unwrap()]), 0, "restored");
    check(&mut command("audit", &config, &verify), 0, "entries 1 to 2 are signed");
    let again = Daemon::start(&config);
    again.wait_until_live(&CAMERAS);
    assert!(again.json("/api/v1/system")["audit"]["fault"].is_null());
    again.stop("TERM");
    let head = folder.path().join("kept.sqlite.audit-head");
    std::fs::remove_file(head).unwrap();
    check(&mut command("audit", &config, &verify), 1, "there is no signed head at");
}

#[test]
fn a_key_that_everybody_can_read_is_refused_and_none_is_told() {
    let folder = TempDir::new().unwrap();
    let (config, _, _) = signed(folder.path());
    let key = folder.path().join("audit.key");
    std::fs::set_permissions(&key, std::fs::Permissions::from_mode(0o604)).unwrap();
    let expected = "can be read by every user of this machine";
    let listen = ["--listen", "127.0.0.1:0"];
    check(&mut command("serve", &config, &listen), 1, expected);
    check(videofields().arg("check-config").arg(&config), 0, expected);
    std::fs::remove_file(&key).unwrap();
    check(&mut command("serve", &config, &listen), 1, "the audit log cannot be signed");
    let text = std::fs::read_to_string(&config).unwrap();
    std::fs::write(&config, text.replace("audit_key = \"audit.key\"\n", "")).unwrap();
    check(videofields().arg("check-config").arg(&config), 0, "good");
}

#[test]
fn a_key_that_was_replaced_is_needed_until_the_other_has_taken_over() {
    let folder = TempDir::new().unwrap();
    let (config, _, _) = signed(folder.path());
    Daemon::start(&config).stop("TERM");
    let other = folder.path().join("other.key");
    check(&mut command("audit", &config, &["key", "--out", other.to_str().unwrap()]), 0, "whose public key");
    let text = std::fs::read_to_string(&config).unwrap();
    let both = "audit_key = \"other.key\"\naudit_key_before = \"audit.key\"\n";
    std::fs::write(&config, text.replacen("audit_key = \"audit.key\"\n", both, 1)).unwrap();
    let (before, away) = (folder.path().join("audit.key"), folder.path().join("away.key"));
    std::fs::rename(&before, &away).unwrap();
    let needed = "the key of the audit log that was used before cannot be read";
    check(&mut command("serve", &config, &["--listen", "127.0.0.1:0"]), 1, needed);
    std::fs::rename(&away, &before).unwrap();
    Daemon::start(&config).stop("TERM");
    std::fs::remove_file(&before).unwrap();
    let again = Daemon::start(&config);
    assert!(again.json("/api/v1/system")["audit"]["fault"].is_null());
    let stopped = again.stop("TERM");
    assert!(stopped.stderr.contains("storage.audit_key_before can be left out"), "{}", stopped.stderr);
}
