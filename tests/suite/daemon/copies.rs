//! `backup`, `restore` and `audit` beside a running daemon, on databases of every kind, and what the audit log says of them.

use super::demo;
use super::process::{Daemon, Output, run, videofields};
use serde_json::Value;
use sqlx::{Connection, SqliteConnection};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;

fn command(name: &str, config: &Path, arguments: &[&str]) -> Command {
    let mut command = videofields();
    command.arg(name).arg("--config").arg(config).args(arguments);
    command
}

fn succeed(command: &mut Command) -> Output {
    let output = run(command);
    assert_eq!(output.status, Some(0), "{command:?}: {}", output.stderr);
    output
}

fn check_refused(command: &mut Command, expected: &str) {
    let output = run(command);
    assert_eq!(output.status, Some(1), "{command:?}: {}", output.stderr);
    assert!(output.stderr.contains(expected), "{expected:?} is not in {}", output.stderr);
}

#[test]
fn a_running_daemon_is_copied_and_a_stopped_one_restored() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let copy = folder.path().join("copy.sqlite");
    let copied = copy.to_str().unwrap();
    check_refused(&mut command("backup", &config, &["--out", copied]), "there is no database");

    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&super::CAMERAS);
    succeed(&mut command("backup", &config, &["--out", copied]));
    let manifest: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("copy.sqlite.json")).unwrap()).unwrap();
    assert_eq!(manifest["database"]["rows"]["scene"], 1, "{manifest}");
    assert_eq!(manifest["database"]["sha256"].as_str().unwrap().len(), 64);
    assert_eq!(manifest["scenes"].as_array().unwrap().len(), 1);
    assert!(manifest["configuration"]["path"].as_str().unwrap().ends_with("plaza.toml"));
    // Again over itself, but over nothing else.
    succeed(&mut command("backup", &config, &["--out", copied]));
    let database = folder.path().join("kept.sqlite");
    check_refused(
        &mut command("backup", &config, &["--out", database.to_str().unwrap()]),
        "the database itself",
    );
    check_refused(&mut command("backup", &config, &["--out", config.to_str().unwrap()]), "is no copy");
    check_refused(
        &mut command("restore", &config, &["--force", copied]),
        "has the database open: stop it first",
    );

    let listed = succeed(&mut command("audit", &config, &["list"])).stdout;
    let backups: Vec<&str> = listed.lines().filter(|line| line.contains("\tbackup\t")).collect();
    assert_eq!(backups.len(), 2, "{listed}");
    assert!(backups[0].contains("\tcli:") && backups[0].ends_with("copy.sqlite"), "{listed}");
    assert_eq!(daemon.stop("TERM").status, Some(0));

    check_refused(&mut command("restore", &config, &[copied]), "--force");
    succeed(&mut command("restore", &config, &["--force", copied]));
    let listed = succeed(&mut command("audit", &config, &["list", "--json"])).stdout;
    let last: Value = serde_json::from_str(listed.lines().last().unwrap()).unwrap();
    assert_eq!((&last["action"], &last["number"]), (&"restore".into(), &2.into()), "{listed}");
    assert!(last["target"].as_str().unwrap().ends_with("copy.sqlite"), "{last}");
    let noted = format!("2:{}", last["digest"].as_str().unwrap());
    succeed(&mut command("audit", &config, &["verify", "--noted", &noted]));
    let other = format!("1:{}", last["digest"].as_str().unwrap());
    check_refused(
        &mut command("audit", &config, &["verify", "--noted", &other]),
        "not the one that was noted",
    );
    check_refused(&mut command("restore", &config, &["--finish"]), "no copy was being put");

    // A copy that is another than what stands beside it says.
    let beside = folder.path().join("copy.sqlite.json");
    let mut told: Value = serde_json::from_slice(&std::fs::read(&beside).unwrap()).unwrap();
    told["database"]["sha256"] = "0".repeat(64).into();
    std::fs::write(&beside, told.to_string()).unwrap();
    check_refused(&mut command("restore", &config, &[copied]), "another digest");
    let again = Daemon::start(&config);
    again.wait_until_live(&super::CAMERAS);
    assert_eq!(again.stop("TERM").status, Some(0));
}

#[test]
fn a_folder_keeps_its_newest_copies_and_everything_else_in_it() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let mut user = videofields();
    user.arg("user").arg(&config).args(["set", "root", "--role", "admin", "--password"]);
    let mut made = user.stdin(Stdio::piped()).spawn().unwrap();
    made.stdin.take().unwrap().write_all(b"correct horse battery\n").unwrap();
    assert!(made.wait().unwrap().success());
    let copies = folder.path().join("copies");
    let to = copies.to_str().unwrap().to_owned();
    for name in ["videofields-20200101T000000Z.sqlite", "videofields-mine.sqlite", "notes"] {
        std::fs::create_dir_all(&copies).unwrap();
        std::fs::write(copies.join(name), "old").unwrap();
    }
    // A copy that was killed leaves its first name.
    for _ in 0..3 {
        succeed(&mut command("backup", &config, &["--out", &to, "--keep", "2"]));
    }
    let mut names: Vec<String> = std::fs::read_dir(&copies)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !name.starts_with('.'))
        .collect();
    names.sort();
    assert_eq!(names.len(), 6, "two copies, what stands beside them, and what is none: {names:?}");
    assert!(names.contains(&"notes".to_owned()) && names.contains(&"videofields-mine.sqlite".to_owned()));
    assert!(!names.contains(&"videofields-20200101T000000Z.sqlite".to_owned()));
    let listed = succeed(&mut command("audit", &config, &["list"])).stdout;
    assert!(listed.lines().next().unwrap().contains("\tuser set\troot"), "{listed}");
}

#[test]
fn another_s_lock_and_a_place_that_cannot_be_written_are_told() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    succeed(videofields().arg("user").arg(&config).args(["list"]));
    let copy = folder.path().join("copy.sqlite");
    let copied = copy.to_str().unwrap().to_owned();
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let url = format!("sqlite://{}", folder.path().join("kept.sqlite").display());
    let mut alone = runtime.block_on(async {
        let mut connection = SqliteConnection::connect(&url).await.unwrap();
        for text in ["pragma locking_mode = exclusive", "begin exclusive", "commit"] {
            sqlx::query(text).execute(&mut connection).await.unwrap();
        }
        connection
    });
    check_refused(&mut command("backup", &config, &["--out", &copied]), "busy");
    check_refused(&mut command("restore", &config, &[&copied]), "has the database open");
    runtime
        .block_on(async { sqlx::query("pragma locking_mode = normal").execute(&mut alone).await.unwrap() });
    runtime.block_on(alone.close()).unwrap();
    succeed(&mut command("backup", &config, &["--out", &copied]));
    let nowhere = folder.path().join("nowhere/copy.sqlite");
    check_refused(&mut command("backup", &config, &["--out", nowhere.to_str().unwrap()]), "nowhere");
    assert_eq!(std::fs::metadata(&copy).unwrap().len() % 512, 0);
}

#[test]
fn only_a_file_of_as_many_bytes_as_are_announced_is_restored() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    succeed(videofields().arg("user").arg(&config).args(["list"]));
    let place = |name: &str| folder.path().join(name);
    let named = |name: &str| place(name).to_str().unwrap().to_owned();
    let pipe = |name: &str| assert!(Command::new("mkfifo").arg(place(name)).status().unwrap().success());
    succeed(&mut command("backup", &config, &["--out", &named("copy.sqlite")]));
    let text = std::fs::read_to_string(place("copy.sqlite.json")).unwrap();
    let manifest: Value = serde_json::from_str(&text).unwrap();
    let n_bytes = std::fs::metadata(place("copy.sqlite")).unwrap().len();
    assert_eq!(manifest["database"]["bytes"], n_bytes);
    let (as_it_is, forced): (&[&str], &[&str]) = (&[], &["--force"]);
    let check = |name: &str, options: &[&str], expected: &str| {
        let arguments: Vec<&str> = options.iter().copied().chain([name]).collect();
        check_refused(&mut command("restore", &config, &arguments), expected);
    };
    // Nothing of what is no file is opened, whatever is forced.
    std::os::unix::fs::symlink(place("copy.sqlite"), place("link.sqlite")).unwrap();
    pipe("pipe.sqlite");
    std::fs::create_dir(place("folder.sqlite")).unwrap();
    for name in ["link.sqlite", "pipe.sqlite", "folder.sqlite"] {
        std::fs::write(place(&format!("{name}.json")), &text).unwrap();
    }
    std::fs::copy(place("copy.sqlite"), place("second.sqlite")).unwrap();
    std::os::unix::fs::symlink(place("copy.sqlite.json"), place("second.sqlite.json")).unwrap();
    std::fs::copy(place("copy.sqlite"), place("third.sqlite")).unwrap();
    pipe("third.sqlite.json");
    for options in [as_it_is, forced] {
        check(&named("link.sqlite"), options, "link.sqlite is a symbolic link");
        check(&named("pipe.sqlite"), options, "pipe.sqlite is a device, pipe or socket");
        check(&named("folder.sqlite"), options, "folder.sqlite is a directory");
        check(&named("second.sqlite"), options, "second.sqlite.json is a symbolic link");
        check(&named("third.sqlite"), options, "third.sqlite.json is a device, pipe or socket");
        check("/dev/zero", options, "/dev/zero is a device, pipe or socket");
    }
    // More than is announced is not read, nor less taken for it.
    let copy = named("copy.sqlite");
    std::fs::remove_file(place("kept.sqlite")).unwrap();
    for said in [n_bytes - 1, n_bytes + 1] {
        let mut other = manifest.clone();
        other["database"]["bytes"] = said.into();
        // The digest is as announced: only the length is not.
        std::fs::write(place("copy.sqlite.json"), other.to_string()).unwrap();
        check(&copy, as_it_is, &format!("copy.sqlite has {n_bytes} bytes, and "));
        check(&copy, as_it_is, &format!("says {said}"));
    }
    let mut silent = manifest.clone();
    silent["database"]["bytes"] = Value::Null;
    std::fs::write(place("copy.sqlite.json"), silent.to_string()).unwrap();
    check(&copy, as_it_is, "does not say how many bytes");
    std::fs::write(place("copy.sqlite.json"), format!("{text}{}", " ".repeat(1 << 20))).unwrap();
    check(&copy, as_it_is, "at most 1048576 stand beside a copy");
    let taken = succeed(&mut command("restore", &config, &["--force", &copy]));
    assert!(taken.stderr.contains("warning: "), "{}", taken.stderr);
    std::fs::write(place("copy.sqlite.json"), &text).unwrap();
    std::fs::remove_file(place("kept.sqlite")).unwrap();
    succeed(&mut command("restore", &config, &[&copy]));
}
