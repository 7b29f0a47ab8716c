//! What is deployed fits what is built: service, package, image and configuration agree on their paths, and alerts and
//! dashboard ask for metrics that there are.

use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::Path;
use videofields_recording::media::look_at_sandbox;
use videofields_recording::telemetry::{DropReason, RecordingDrop, SnapshotFailure, ViewRefusal};
use videofields_vision::config::{self, Config};

const UNIT: &str = "deploy/systemd/videofields.service";
const CONFIG: &str = "/etc/videofields/videofields.toml";
const STATE: &str = "/var/lib/videofields";
const DASHBOARD: &str = "deploy/grafana/dashboards/videofields.json";
const NO_VARIABLES: [(OsString, OsString); 0] = [];

/// A file of the project.
fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The type of every metric, by its name.
fn metrics() -> BTreeMap<String, String> {
    let text = read("tests/golden/metrics.txt");
    let metric = |line: &str| {
        let mut words = line.split(' ').map(str::to_owned);
        words.next().zip(words.next())
    };
    text.lines().filter_map(metric).collect()
}

/// Everything in `text` that is written as a metric of the daemon's.
fn named(text: &str) -> BTreeSet<&str> {
    let is_part = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    text.match_indices("videofields_")
        .filter_map(|(start, _)| text[start..].split(|c: char| !is_part(c)).next())
        .collect()
}

/// Whether a metric or, of a histogram, a part of one has that name.
fn is_known(name: &str, metrics: &BTreeMap<String, String>) -> bool {
    let is_histogram = |base: &str| metrics.get(base).is_some_and(|kind| kind == "histogram");
    let parts = ["_bucket", "_sum", "_count"];
    metrics.contains_key(name) || parts.iter().any(|part| name.strip_suffix(part).is_some_and(is_histogram))
}

#[test]
fn alerts_and_dashboard_name_metrics_that_there_are() {
    let metrics = metrics();
    assert!(metrics.len() > 20, "{metrics:?}");
    for file in ["deploy/prometheus/alerts.yml", "deploy/prometheus/alerts.test.yml", DASHBOARD] {
        let text = read(file);
        let named = named(&text);
        assert!(!named.is_empty(), "{file} names no metric");
        let unknown: Vec<_> = named.into_iter().filter(|name| !is_known(name, &metrics)).collect();
        assert!(unknown.is_empty(), "{file}: {unknown:?}");
    }
    assert!(!is_known("videofields_build_info_bucket", &metrics));
}

#[test]
fn alerts_ask_for_reasons_that_there_are() {
    let mut known = BTreeSet::from(DropReason::ALL.map(DropReason::as_str));
    known.extend(RecordingDrop::ALL.map(RecordingDrop::as_str));
    known.extend(ViewRefusal::ALL.map(ViewRefusal::as_str));
    known.extend(SnapshotFailure::ALL.map(SnapshotFailure::as_str));
    let alerts = read("deploy/prometheus/alerts.yml");
    let quoted = |rest: &str| -> Option<String> {
        let rest = rest.trim_start_matches('~').strip_prefix('"')?;
        rest.split('"').next().map(str::to_owned)
    };
    let asked: Vec<String> = alerts.split("reason=").skip(1).filter_map(quoted).collect();
    assert!(asked.len() > 4, "{asked:?}");
    for reason in asked.iter().flat_map(|reasons| reasons.split('|')) {
        assert!(known.contains(reason), "{reason} is none of {known:?}");
    }
}

#[test]
fn every_panel_of_the_dashboard_says_what_it_shows() {
    let dashboard: Value = serde_json::from_str(&read(DASHBOARD)).expect("JSON");
    let panels = dashboard["panels"].as_array().expect("panels");
    let mut ids = BTreeSet::new();
    for panel in panels {
        assert!(ids.insert(panel["id"].as_u64().expect("a number")), "two panels of one id: {panel}");
        if panel["type"] == "row" {
            continue;
        }
        for key in ["title", "description"] {
            assert!(panel[key].as_str().is_some_and(|text| !text.is_empty()), "no {key}: {panel}");
        }
        let targets = panel["targets"].as_array().expect("targets");
        assert!(!targets.is_empty(), "{panel}");
        for target in targets {
            assert!(!named(target["expr"].as_str().expect("an expression")).is_empty(), "{target}");
        }
    }
    let file = DASHBOARD.rsplit('/').next().expect("a name");
    let compose = read("deploy/compose.yaml");
    assert!(compose.contains(&format!("HOME_DASHBOARD_PATH: /etc/grafana/dashboards/{file}\n")), "{file}");
}

fn parse(text: &str) -> Config {
    config::parse(text, Path::new(CONFIG), NO_VARIABLES).expect("a configuration without faults")
}

#[test]
fn the_installed_configuration_keeps_to_its_folders_and_to_this_machine() {
    let text = read("deploy/videofields.toml");
    let config = parse(&text);
    let settings = config.settings();
    assert!(settings.server.listen.ip().is_loopback());
    assert!(settings.storage.database.starts_with(STATE));
    assert!(settings.media.roots.iter().all(|root| root.starts_with(STATE)));
    assert!(!settings.archive.is_on() && settings.camera.is_empty() && settings.scene.is_empty());

    // Its example: # taken off where no space follows it.
    let switch_on = |line: &str| match line.strip_prefix('#') {
        Some(key) if !key.starts_with(' ') => key.to_owned(),
        _ => line.to_owned(),
    };
    let config = parse(&text.lines().map(switch_on).collect::<Vec<_>>().join("\n"));
    let [camera] = config.settings().camera.as_slice() else { panic!("one camera") };
    let unit = read(UNIT);
    let (credential, _) = value(&unit, "LoadCredential").split_once(':').expect("a name and a place");
    let password = Path::new("/run/credentials/videofields.service").join(format!("{credential}_yard"));
    assert_eq!(camera.source.password_file.as_deref(), Some(password.as_path()));
    assert_eq!(config.settings().scene[0].file, Path::new("/etc/videofields/site.json"));
}

/// The value of the only line `key=` of a unit file.
fn value<'a>(unit: &'a str, key: &str) -> &'a str {
    let lines = unit.lines().filter_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    let values: Vec<&str> = lines.collect();
    let [value] = values[..] else { panic!("{key}: {values:?}") };
    value
}

fn text(value: &toml::Value) -> &str {
    value.as_str().expect("text")
}

/// Where the package puts each of its files, by where it takes it from.
fn installed(deb: &toml::Value) -> BTreeMap<String, String> {
    let place = |asset: &toml::Value| {
        let (source, folder) = (text(&asset[0]), text(&asset[1]));
        let name = if folder.ends_with('/') { source.rsplit('/').next().unwrap_or_default() } else { "" };
        (source.to_owned(), format!("/{folder}{name}"))
    };
    deb["assets"].as_array().expect("assets").iter().map(place).collect()
}

fn package() -> toml::Value {
    let manifest: toml::Table = read("Cargo.toml").parse().expect("TOML");
    manifest["package"]["metadata"]["deb"].clone()
}

#[test]
fn the_service_runs_what_the_package_installs() {
    let (unit, deb) = (read(UNIT), package());
    let installed = installed(&deb);
    let words: Vec<&str> = value(&unit, "ExecStart").split(' ').collect();
    let [program, "serve", "--config", config] = words.as_slice() else { panic!("{words:?}") };
    assert_eq!(installed["target/release/videofields"], *program);
    assert_eq!(installed["deploy/videofields.toml"], *config);
    assert_eq!((*config, text(&deb["conf-files"][0])), (CONFIG, CONFIG));
    for place in value(&unit, "Documentation").split(' ').filter_map(|place| place.strip_prefix("file://")) {
        assert!(installed.values().any(|path| path == place), "{place}");
    }

    let folder = text(&deb["systemd-units"]["unit-scripts"]);
    assert_eq!(UNIT, format!("{folder}videofields.service"));
    for script in ["postinst", "postrm"] {
        let path = format!("{}{script}", text(&deb["maintainer-scripts"]));
        assert!(read(&path).contains("\n#DEBHELPER#\n"), "{path}");
    }
    // What is built or written by the program is not there yet.
    for source in installed.keys().filter(|source| !source.starts_with("target/")) {
        assert!(!read(source).is_empty(), "{source}");
    }
}

#[test]
fn the_service_s_user_has_its_folders() {
    let unit = read(UNIT);
    let user = value(&unit, "User");
    let users = read("deploy/systemd/sysusers.d/videofields.conf");
    assert!(users.lines().any(|line| line.starts_with(&format!("u {user} "))), "{users}");
    for group in value(&unit, "SupplementaryGroups").split(' ') {
        assert!(users.contains(&format!("\ng {group} ")), "{group}");
    }
    assert_eq!(STATE, format!("/var/lib/{}", value(&unit, "StateDirectory")));
    let (_, credentials) = value(&unit, "LoadCredential").split_once(':').expect("a name and a place");
    let folders = read("deploy/systemd/tmpfiles.d/videofields.conf");
    for (folder, mode, owner) in
        [(STATE, value(&unit, "StateDirectoryMode"), user), (credentials, "0700", "root")]
    {
        let expected = ["d", folder, mode, owner];
        let is_made = |line: &str| line.split_whitespace().take(4).eq(expected);
        assert!(folders.lines().any(is_made), "{expected:?} is not in\n{folders}");
    }
}

#[test]
fn the_image_is_what_the_package_is() {
    let (image, compose) = (read("deploy/Containerfile"), read("deploy/compose.yaml"));
    let deb = package();
    let version = env!("CARGO_PKG_VERSION");
    assert!(image.contains(&format!("ARG VERSION={version}\n")), "{version}");
    assert!(compose.contains(&format!("image: videofields:{version}\n")), "{version}");
    assert!(image.contains(&format!("CMD [\"serve\", \"--config\", \"{CONFIG}\"]\n")));
    assert!(image.contains(&format!("VOLUME [\"{STATE}\"]\n")));
    assert!(compose.contains(&format!("- ./videofields.toml:{CONFIG}:ro\n")));
    assert!(compose.contains(&format!("- state:{STATE}\n")));
    let is_opened = |name: &&str| name.starts_with("gstreamer") || name.starts_with("lib");
    let wanted: Vec<&str> = text(&deb["depends"]).split([' ', ',']).filter(is_opened).collect();
    assert!(wanted.len() > 4, "{wanted:?}");
    for name in wanted {
        assert!(image.contains(&format!(" {name} ")) || image.contains(&format!(" {name}\n")), "{name}");
    }

    let unit = read(UNIT);
    assert!(compose.contains(&format!("pids_limit: {}\n", value(&unit, "TasksMax"))));
    assert!(compose.contains(&format!("nofile: {}\n", value(&unit, "LimitNOFILE"))));
    assert!(compose.contains(&format!("core: {}\n", value(&unit, "LimitCORE"))));
}

/// Returns the names of the system calls that the unit lets through: sets as systemd 252 knows them, each line adding to what lines
/// before it left, or taking from it.
fn let_through() -> BTreeSet<String> {
    let sets = read("tests/suite/deploy/system-calls.txt");
    let sets: BTreeMap<&str, Vec<&str>> = sets
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(name, calls)| (name, calls.split(' ').collect()))
        .collect();
    let spelled_out = |word: &str| sets.get(word).cloned().unwrap_or_default();
    // Calls that every process needs to be started are always let through.
    let mut calls: BTreeSet<String> = spelled_out("@default").into_iter().map(str::to_owned).collect();
    let unit = read(UNIT);
    for value in unit.lines().filter_map(|line| line.strip_prefix("SystemCallFilter=")) {
        let (value, is_taken) = value.strip_prefix('~').map_or((value, false), |value| (value, true));
        for word in value.split(' ') {
            let named = if word.starts_with('@') {
                assert!(sets.contains_key(word), "{word} is not in the list of sets");
                spelled_out(word)
            } else {
                vec![word]
            };
            for call in named {
                if is_taken {
                    calls.remove(call);
                } else {
                    calls.insert(call.to_owned());
                }
            }
        }
    }
    calls
}

#[test]
fn the_services_filter_lets_decoding_processes_confine_themselves() {
    let calls = let_through();
    assert!(calls.contains("read") && !calls.contains("reboot") && !calls.contains("setpriority"));
    let architecture = std::env::consts::ARCH.try_into().unwrap();
    let compile = |calls: &[&str]| {
        let calls: Vec<_> = calls.iter().map(|call| json!({"syscall": call})).collect();
        let filter = json!({"unit": {
            "mismatch_action": {"errno": libc::EPERM},
            "match_action": "allow",
            "filter": calls,
        }});
        seccompiler::compile_from_json(filter.to_string().as_bytes(), architecture)
    };
    // Other architectures have other calls.
    let known: Vec<&str> = calls.iter().map(String::as_str).filter(|call| compile(&[call]).is_ok()).collect();
    assert!(known.len() > 200, "{known:?}");
    let filter = compile(&known).unwrap().remove("unit").unwrap();
    let confined = std::thread::Builder::new().name("confined".to_owned()).spawn(move || {
        seccompiler::apply_filter(&filter).unwrap();
        look_at_sandbox().unwrap()
    });
    let confined = confined.unwrap();
    let (confined, free) = (confined.join().unwrap(), look_at_sandbox().unwrap());
    assert!(confined.has_limits && confined.has_seccomp, "{confined:?}");
    assert_eq!(confined, free);
}
