//! The configuration as an operator writes it: the documented example, its faults, and the environment.

use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;
use std::path::{Path, PathBuf};
use videofields_vision::config::{
    self, CameraUrl, Config, ConfigError, Learning, SegmentSettings, Settings, SourceSettings, Timing,
};
use videofields_vision::error::ErrorKind;

const NO_VARIABLES: [(OsString, OsString); 0] = [];

fn example() -> String {
    let path = videofields_testing::root().join("config/example.toml");
    std::fs::read_to_string(path).expect("the example is there")
}

/// The example with its camera and scene switched on: `#` taken off where no space follows it.
fn full_example() -> String {
    let switch_on = |line: &str| match line.strip_prefix('#') {
        Some(key) if !key.starts_with(' ') => key.to_owned(),
        _ => line.to_owned(),
    };
    example().lines().map(switch_on).collect::<Vec<_>>().join("\n")
}

fn parse(text: &str) -> Result<Config, ConfigError> {
    config::parse(text, Path::new("/etc/videofields/site.toml"), NO_VARIABLES)
}

fn variables(pairs: &[(&str, &str)]) -> Vec<(OsString, OsString)> {
    pairs.iter().map(|(name, value)| ((*name).into(), (*value).into())).collect()
}

fn faults(result: Result<Config, ConfigError>) -> Vec<String> {
    let error = result.expect_err("faults");
    assert_eq!(error.kind(), ErrorKind::Invalid);
    error.faults().iter().map(ToString::to_string).collect()
}

/// What every fault of `text` says, without the file's name.
fn faults_of(text: &str) -> Vec<String> {
    faults(parse(text)).iter().map(|fault| fault.replace("/etc/videofields/site.toml:", "")).collect()
}

#[test]
fn the_example_parses_to_the_defaults() {
    let config = parse(&example()).expect("a configuration without faults");
    let defaults =
        Config::from_settings(Settings::default(), Path::new("/etc/videofields")).expect("defaults");
    assert_eq!(config, defaults);
    assert_eq!(config.settings().storage.database, Path::new("/etc/videofields/videofields.sqlite"));
    assert_eq!(config.settings().media.roots, [PathBuf::from("/etc/videofields/media")]);
}

#[test]
fn the_example_s_camera_has_the_defaults_too() {
    let config = parse(&full_example()).expect("a configuration without faults");
    let [camera, yard, gate, lane, desk] = config.settings().camera.as_slice() else {
        panic!("five cameras")
    };
    let minimal = parse("[[camera]]\nid = \"north\"\nsource.path = \"north.webm\"").expect("enough");
    let mut expected = minimal.settings().camera[0].clone();
    // Those that have no value to show as their default.
    expected.source.timing = Some(Timing::Pts);
    expected.source.start = "2026-03-01T12:00:00Z".parse().ok();
    expected.source.until_secs = Some(3600.0);
    expected.clock.since = expected.source.start;
    expected.segment.delta = Some(SegmentSettings::DELTA);
    expected.segment.blur_sigma_px = Some(1.5);
    expected.segment.suppress_blinking = Some(true);
    expected.background.clip = Some("/etc/videofields/north-empty.webm".into());
    assert_eq!(camera, &expected);
    assert_eq!(camera.name, "north");
    let default = SourceSettings::default();
    let user = Some("viewer".to_owned());
    let yard_expected = SourceSettings {
        url: Some(CameraUrl::new("rtsp://192.168.1.20/stream1")),
        user: user.clone(),
        password_file: Some("/etc/videofields/yard.password".into()),
        ..default.clone()
    };
    assert_eq!(yard.source, yard_expected);
    let gate_expected = SourceSettings {
        url: Some(CameraUrl::new("http://192.168.1.21/video.mjpg")),
        user,
        password_env: Some("VIDEOFIELDS_GATE_PASSWORD".to_owned()),
        ..default.clone()
    };
    assert_eq!(gate.source, gate_expected);
    let lane_expected = SourceSettings {
        url: Some(CameraUrl::new("rtsp://192.168.1.22/stream1")),
        credentials: Some("gates".to_owned()),
        ..default.clone()
    };
    assert_eq!(lane.source, lane_expected);
    let [gates, yards] = config.settings().credentials.as_slice() else { panic!("two credentials") };
    assert_eq!(gates.password_file.as_deref(), Some(Path::new("/etc/videofields/gates.password")));
    assert_eq!(yards.password_env.as_deref(), Some("VIDEOFIELDS_YARDS_PASSWORD"));
    let (device, width_px, height_px) = (Some("/dev/video0".into()), Some(1280), Some(720));
    assert_eq!(desk.source, SourceSettings { device, width_px, height_px, ..default });
    assert_eq!(config.settings().scene[0].file, Path::new("/etc/videofields/plaza.json"));
}

#[test]
fn the_example_names_every_key() {
    let example: toml::Table = full_example().parse().expect("TOML");
    let check = |table: &toml::Table, path: &str, document: &str| {
        // Every key that the types know is told by the fault of an unknown one.
        let said = faults_of(document);
        let fault = said.iter().find(|fault| fault.contains("`zzz`")).expect("a fault");
        let known = fault.split_once("allowed: ").expect("what is allowed").1;
        let mut known: Vec<_> = known.split(", ").collect();
        let mut written: Vec<_> = table.keys().map(String::as_str).collect();
        known.sort_unstable();
        written.sort_unstable();
        assert_eq!(written, known, "{path}");
    };
    check(&example, "", "zzz = 1");
    for section in [
        "server",
        "storage",
        "archive",
        "media",
        "timeline",
        "entities",
        "render",
        "accuracy",
        "log",
        "telemetry",
    ] {
        check(example[section].as_table().expect("a table"), section, &format!("{section}.zzz = 1"));
    }
    let camera = example["camera"][0].as_table().expect("a table");
    check(camera, "camera", "[[camera]]\nid = \"a\"\nsource.path = \"a\"\nzzz = 1");
    for part in ["source", "clock", "background", "segment", "track", "condition"] {
        let document = format!("[[camera]]\nid = \"a\"\nsource.path = \"a\"\n{part}.zzz = 1");
        let mut written = camera[part].as_table().expect("a table").clone();
        if part == "source" {
            // Each kind of source has keys of its own, so they are spread over the cameras.
            for other in example["camera"].as_array().expect("cameras") {
                written.extend(other["source"].as_table().expect("a table").clone());
            }
        }
        check(&written, part, &document);
    }
    let mut credentials = example["credentials"][0].as_table().expect("a table").clone();
    credentials.extend(example["credentials"][1].as_table().expect("a table").clone());
    check(&credentials, "credentials", "[[credentials]]\nid = \"a\"\nzzz = 1");
    let scene = example["scene"][0].as_table().expect("a table");
    check(scene, "scene", "[[scene]]\nid = \"a\"\nfile = \"a\"\nzzz = 1");
    // One shows a scene, another a camera.
    let mut snapshot = example["snapshot"][0].as_table().expect("a table").clone();
    snapshot.extend(example["snapshot"][1].as_table().expect("a table").clone());
    check(&snapshot, "snapshot", "[[snapshot]]\nid = \"a\"\nscene = \"a\"\nzzz = 1");
}

#[test]
fn snapshots_lie_beside_the_database_and_are_made_of_one_thing() {
    let folder = |text: &str| parse(text).expect("no faults").settings().storage.snapshot_folder.clone();
    assert_eq!(folder(""), Path::new("/etc/videofields/videofields.snapshots"));
    assert_eq!(folder("storage.database = \"/srv/db/site.sqlite\""), Path::new("/srv/db/site.snapshots"));
    assert_eq!(folder("storage.snapshot_folder = \"evidence\""), Path::new("/etc/videofields/evidence"));
    let check = |text: &str, expected: &str| {
        let said = faults_of(&format!("[[snapshot]]\n{text}"));
        assert!(said.len() == 1 && said[0].contains(expected), "{text}: {said:?}");
    };
    check("id = \"a\"", "name a `scene` or a `camera`");
    check("id = \"a\"\nscene = \"a\"\ncamera = \"a\"", "beside a `scene`");
    check("id = \"A\"\nscene = \"a\"", "invalid id \"A\"");
    check("id = \"a\"\nscene = \"a b\"", "invalid id \"a b\"");
    check("id = \"a\"\ncamera = \"a\"\nparameters = \"width=3\"", "a `scene` alone");
    check("id = \"a\"\nscene = \"a\"\nparameters = \"width=3&t=5\"", "show what is live");
    check("id = \"a\"\nscene = \"a\"\ninterval_mins = 0.5", "1 to 10080 minutes");
    check("id = \"a\"\nscene = \"a\"\ntags = [\"b\", \"b\"]", "more than once");
    check("id = \"a\"\nscene = \"a\"\n[[snapshot]]\nid = \"a\"\nscene = \"a\"", "ids are unique");
    for (key, value) in [("max_gib", "0"), ("max_age_days", "0"), ("min_free_mib", "1073741825")] {
        let said = faults_of(&format!("storage.snapshot_{key} = {value}"));
        assert!(said.len() == 1 && said[0].contains("expected 0"), "{key}: {said:?}");
    }
}

#[test]
fn a_wrong_key_fails_with_its_place_and_what_was_meant() {
    let check = |text: &str, expected: &[&str]| assert_eq!(faults_of(text), expected, "{text}");
    let example = example().replace("samples = 4", "sample = 4");
    let line = example.lines().position(|line| line == "sample = 4").expect("the wrong key") + 1;
    check(
        &example,
        &[&format!(
            "{line}:1: render.sample: unknown key `sample`; did you mean `samples`? allowed: adapter, samples, \
             depth_map_side_px, max_pixels, queue_length, timeout_secs, cache_mib, warm_up"
        )],
    );
    check(
        "[sever]\nlisten = \"127.0.0.1:1\"",
        &[
            "1:2: sever: unknown key `sever`; did you mean `server`? allowed: server, storage, archive, media, \
           timeline, entities, render, accuracy, log, telemetry, credentials, camera, scene, snapshot",
        ],
    );
}

#[test]
fn all_faults_are_told_at_once() {
    let text = r#"
[server]
listen = "0.0.0.0:80"
[storage]
checkpoint_interval_secs = 0
[render]
samples = "many"
queue_lenght = 3
[[camera]]
id = "North"
source.path = "a.webm"
source.end = "lop"
[[camera]]
source.path = "b.webm"
[[camera]]
id = "c"
source.path = "c.webm"
background.learning = "hold"
background.modes = 6
[[camera]]
id = "c"
source.path = ""
[[scene]]
id = "Plaza"
file = "plaza.json"
"#;
    let said = faults_of(text);
    let expected = [
        "7:1: render.samples: wrong type: string \"many\", expected a whole number, 0 or more",
        "8:1: render.queue_lenght: unknown key `queue_lenght`; did you mean `queue_length`?",
        "3:1: server.listen: 0.0.0.0 can be reached from other machines",
        "5:1: storage.checkpoint_interval_secs: expected 1 to 86400 seconds, got 0",
        "10:1: camera[0].id: invalid id \"North\": an id has 1 to 64 characters",
        "12:8: camera[0].source.end: unknown value `lop`; did you mean `loop`? allowed: stop, loop",
        "13:1: camera[1]: the key `id` is missing",
        "19:12: camera[2].background.modes: expected 1 to 5 modes, got 6",
        "18:12: camera[2].background.learning: `hold` needs a `clip`",
        "21:1: camera[3].id: there is another camera `c`; ids are unique",
        "22:8: camera[3].source.path: expected a path of 1 to 4096 bytes",
        "24:1: scene[0].id: invalid id \"Plaza\"",
    ];
    assert_eq!(said.len(), expected.len(), "{said:#?}");
    for start in expected {
        assert!(said.iter().any(|fault| fault.starts_with(start)), "{start} is not in {said:#?}");
    }
}

#[test]
fn numbers_outside_their_range_are_refused() {
    let check = |section: &str, text: &str, expected: &str| {
        let head = match section.strip_prefix("camera.") {
            Some("source") => "[[camera]]\nid = \"a\"\n[camera.source]\npath = \"a\"\n".to_owned(),
            Some(part) => format!("[[camera]]\nid = \"a\"\nsource.path = \"a\"\n[camera.{part}]\n"),
            None => format!("[{section}]\n"),
        };
        let said = faults_of(&format!("{head}{text}"));
        assert!(said.len() == 1 && said[0].contains(expected), "{text}: {said:?}");
    };
    check("storage", "checkpoint_interval_secs = nan", "expected a finite number");
    check("storage", "checkpoint_interval_secs = -inf", "expected a finite number");
    check("storage", "checkpoint_interval_secs = 86400.5", "1 to 86400 seconds");
    check("storage", "background_history_interval_mins = -1", "0 to 10080 minutes");
    check("storage", "background_history_interval_mins = 10081", "0 to 10080 minutes");
    check("storage", "background_history_count = 0", "1 to 10000 backgrounds");
    check("storage", "background_history_count = 1.5", "whole number");
    check("storage", "background_history_mib = 0", "1 to 1048576 MiB");
    check("storage", "background_history_max_age_days = 0.0", "0.01 to 36500 days");
    check("storage", "tracks_max_age_days = 401.0", "0.01 to 400 days");
    check("storage", "activity_max_age_days = -1.0", "0.01 to 400 days");
    check("storage", "background_history_mib = 1048577", "1 to 1048576 MiB");
    check("archive", "segment_secs = 4", "5 to 3600 seconds, got 4");
    check("archive", "segment_secs = 7.5", "whole number");
    check("archive", "max_gib = 0", "0.01 to 1048576 GiB");
    check("archive", "max_gib = nan", "expected a finite number");
    check("archive", "max_age_days = 0", "0.001 to 36500 days");
    check("archive", "min_free_mib = 1073741825", "0 to 1073741824 MiB");
    check("archive", "folder = \"a\\u0000b\"", "archive.folder");
    check("timeline", "mib_per_camera = 7", "8 to 65536 MiB");
    check("timeline", "mib_per_camera = -1", "0 or more");
    check("timeline", "replay_mib = 31", "32 to 65536 MiB");
    check("timeline", "mib_per_camera = 1e30", "0 or more");
    check("timeline", "mib_per_camera = 99999999999999999999", "63 bits");
    check("render", "samples = 2", "expected 1 or 4, got 2");
    check("render", "depth_map_side_px = 1000", "256, 512, 1024, 2048 or 4096 texels, got 1000");
    check("render", "max_pixels = 0", "1 to 268435456 pixels");
    check("render", "queue_length = 1025", "1 to 1024 pictures");
    check("render", "timeout_secs = 0", "0.1 to 10 seconds");
    check("render", "timeout_secs = nan", "expected a finite number");
    check("render", "cache_mib = 65537", "0 to 65536 MiB");
    check("render", "adapter = \"a\\u001b[31m\"", "control character");
    check("media", "roots = []", "1 to 64 folders");
    check("media", "roots = [\"\"]", "media.roots[0]");
    check("camera.source", "rate_hz = 0", "0.01 to 1000 frames a second");
    check("camera.source", "start = \"noon\"", "RFC 3339");
    check("camera.source", "timing = \"clock\"", "allowed: pts, index");
    check("camera.background", "tau_secs = 0", "0.1 to 10000000 seconds");
    check("camera.background", "match_threshold = 8.9", "9 to 16");
    check("camera.background", "background_ratio = 1", "0.1 to 0.99");
    check("camera.background", "variance_min = 20", "variance_min 20 <= variance_init 15");
    check("camera.background", "variance_max = 0", "0.1 to 65025");
    check("camera.background", "variance_init = []", "expected a number");
    check("camera.segment", "delta = 0", "0.001 to 1");
    check("camera.segment", "blur_sigma_px = 17", "0 to 16 pixels");
    check("camera.segment", "min_area_px = 2000000000", "0 to 1000000000 pixels");
    check("camera.track", "max_miss_secs = 0", "0.05 to 60 seconds");
    check("camera.track", "confirm_secs = -1", "0 to 10 seconds");
    check("camera.condition", "frozen_after_secs = 0.5", "1 to 3600 seconds");
    check("camera.condition", "begin_after_secs = 0", "0.5 to 60 seconds");
    check("camera.condition", "accept_after_secs = 1", "10 to 10000000 seconds");
}

#[test]
fn nothing_is_recorded_without_a_folder() {
    let config =
        parse("[[camera]]\nid = \"a\"\nsource.path = \"a\"\nrecord = false").expect("a configuration");
    assert!(!config.settings().archive.is_on() && !config.settings().camera[0].record);
    assert_eq!(config.settings().archive.folder, Path::new(""));
    let config = parse("[archive]\nfolder = \"./tapes\"").expect("a configuration");
    assert!(config.settings().archive.is_on());
    assert_eq!(config.settings().archive.folder, Path::new("/etc/videofields/tapes"));
}

#[test]
fn a_source_is_one_thing_and_has_its_own_keys_alone() {
    let said = |source: &str| faults_of(&format!("[[camera]]\nid = \"a\"\n[camera.source]\n{source}"));
    let check = |source: &str, expected: &str| {
        let said = said(source);
        assert!(said.len() == 1 && said[0].contains(expected), "{source}: {said:#?}");
    };
    let url = "url = \"rtsp://10.0.0.2/a\"\n";
    let device = "device = \"/dev/video0\"\n";
    for good in [
        "path = \"a\"",
        "path = \"a\"\npace = \"all\"",
        url,
        device,
        "url = \"https://cam/a\"\nstall_secs = 9",
    ] {
        assert_eq!(
            parse(&format!("[[camera]]\nid = \"a\"\n[camera.source]\n{good}")).err().map(|e| e.to_string()),
            None
        );
    }
    check("", "exactly one of `path` (a file), `url` (a camera) and `device` (V4L2) is needed");
    check("path = \"a\"\nurl = \"rtsp://10.0.0.2/a\"", "exactly one of");
    check(
        &format!("{url}end = \"loop\""),
        "source.end: `end` belongs to a file, and this source is a camera's URL",
    );
    check(&format!("{url}rate_hz = 5"), "`rate_hz` belongs to");
    check(&format!("{url}pace = \"all\""), "`pace` belongs to a file");
    check(
        "path = \"a\"\npace = \"al\"",
        "source.pace: unknown value `al`; did you mean `all`? allowed: real_time, all",
    );
    check(
        "path = \"a\"\nend = \"loop\"\npace = \"all\"",
        "source.pace: `all` does not go with `end = \"loop\"`",
    );
    check(&format!("{url}width_px = 640"), "`width_px` belongs to a device");
    check(
        &format!("{device}transport = \"udp\""),
        "`transport` belongs to a camera's URL, and this source is a device",
    );
    check("path = \"a\"\nstall_secs = 3", "`stall_secs` belongs to");
    check("url = \"http://10.0.0.2/a\"\ntransport = \"udp\"", "`transport` belongs to rtsp and rtsps URLs");
    check(&format!("{url}transport = \"multicast\""), "allowed: tcp, udp");
    check(&format!("{url}stall_secs = 0.4"), "0.5 to 60 seconds");
    check(&format!("{url}stall_secs = 61"), "0.5 to 60 seconds");
    check(&format!("{device}width_px = 15"), "16 to 8192 pixels");
    check(&format!("{device}format = \"yuyv\""), "allowed: auto, mjpeg, raw, h264");
    check(&format!("{url}user = \"a\""), "source.user: a user needs a password");
    check(&format!("{url}password_env = \"A\""), "source.password_env: a password needs a `user`");
    check(&format!("{url}user = \"a\"\npassword_env = \"A\"\npassword_file = \"b\""), "not both");
    check(&format!("{url}user = \"a:b\"\npassword_env = \"A\""), "source.user: expected 1 to 200");
}

#[test]
fn credentials_say_who_logs_in_and_where() {
    let of = |text: &str| faults_of(&format!("[[credentials]]\nid = \"a\"\nuser = \"b\"\n{text}"));
    let check = |text: &str, expected: &str| {
        let said = of(text);
        assert!(said.len() == 1 && said[0].contains(expected), "{text}: {said:#?}");
    };
    let rest = "password_env = \"C\"\nnetworks = [\"10.0.0.0/8\"]\n";
    let good = format!("[[credentials]]\nid = \"a\"\nuser = \"b\"\n{rest}");
    let camera = "[[camera]]\nid = \"c\"\n[camera.source]\nurl = \"rtsp://10.0.0.2/a\"\n";
    assert!(parse(&format!("{good}{camera}credentials = \"a\"")).is_ok());
    check("networks = [\"10.0.0.0/8\"]", "credentials[0].user: a user needs a password");
    check("password_env = \"C\"", "the key `networks` is missing");
    check("password_env = \"C\"\nnetworks = []", "1 to 64 blocks of addresses");
    check("password_env = \"s3cret!\"\nnetworks = [\"::1\"]", "the name of an environment variable");
    check(&format!("{rest}password_file = \"d\""), "not both");
    check(&format!("{rest}[[credentials]]\nid = \"a\"\nuser = \"b\"\n{rest}"), "ids are unique");
    check(
        &format!("{rest}{camera}credentials = \"d\""),
        "source.credentials: unknown credentials `d`; allowed: a",
    );
    check(
        &format!("{rest}{camera}credentials = \"a\"\nuser = \"b\"\npassword_env = \"C\""),
        "stand in place of",
    );
    let file = "[[camera]]\nid = \"c\"\n[camera.source]\npath = \"a\"\n";
    check(&format!("{rest}{file}credentials = \"a\""), "`credentials` belongs to a camera's URL");
    let said =
        faults_of("[[credentials]]\nid = \"A\"\nuser = \"b\"\npassword_env = \"C\"\nnetworks = [\"::1\"]");
    assert!(said.len() == 1 && said[0].contains("invalid id \"A\""), "{said:?}");
}

#[test]
fn no_fault_repeats_a_password() {
    let check = |source: &str, expected: &str| {
        let said = faults_of(&format!("[[camera]]\nid = \"a\"\n[camera.source]\n{source}")).join("\n");
        assert!(said.contains(expected), "{source}: {said}");
        assert!(!said.contains("s3cret") && !said.contains("admin"), "{said}");
    };
    check(
        "url = \"rtsp://admin:s3cret@10.0.0.2/a\"",
        "name the keys `user`, and `password_file` or `password_env`",
    );
    check("url = \"admin:s3cret@10.0.0.2\"", "expected a URL such as");
    check("url = \"file:///s3cret\"", "not \"file\"");
    check("url = \"concat:s3cret\"", "not \"concat\"");
    check("url = \"exec:s3cret\"", "not \"exec\"");
    let url = "url = \"rtsp://10.0.0.2/a\"\nuser = \"b\"\n";
    check(&format!("{url}password_env = \"s3cret!\""), "the name of an environment variable");
    let good = parse("[[camera]]\nid = \"a\"\nsource.url = \"rtsp://10.0.0.2/user=admin&password=s3cret\"");
    let shown = format!("{:?}", good.expect("a configuration"));
    assert!(shown.contains("rtsp://10.0.0.2:554") && !shown.contains("s3cret"), "{shown}");
}

#[test]
fn networks_are_blocks_of_addresses() {
    let said = faults_of("[media]\nnetworks = [\"10.0.0.0/8\", \"lan\"]");
    assert!(said[0].contains("media.networks[1]: expected an address or a block of addresses"), "{said:?}");
    let networks = vec!["\"10.0.0.1\""; 65].join(",");
    let said = faults_of(&format!("[media]\nnetworks = [{networks}]"));
    assert!(said[0].contains("at most 64 are allowed, got 65"), "{said:?}");
    let file = Path::new("/etc/videofields/site.toml");
    let given = variables(&[("VIDEOFIELDS_MEDIA__NETWORKS", "[\"203.0.113.7\"]")]);
    let config = config::parse("", file, given).expect("a configuration");
    let [network] = config.settings().media.networks.as_slice() else { panic!("one network") };
    assert!(network.contains("203.0.113.7".parse().expect("an address")));
}

#[test]
fn only_loopback_is_listened_on_without_a_certificate() {
    for listen in ["127.0.0.1:0", "127.8.8.8:80", "[::1]:8080"] {
        assert!(parse(&format!("server.listen = \"{listen}\"")).is_ok(), "{listen}");
    }
    for listen in ["0.0.0.0:80", "[::]:80", "192.168.0.2:80", "[::ffff:127.0.0.1]:80"] {
        let said = faults_of(&format!("server.listen = \"{listen}\""));
        assert!(said[0].contains("unencrypted"), "{listen}: {said:?}");
    }
    for listen in ["localhost:80", "127.0.0.1", ":80", ""] {
        let said = faults_of(&format!("server.listen = \"{listen}\""));
        assert!(said[0].contains("such as 127.0.0.1:8080"), "{listen}: {said:?}");
    }
    let config = parse("").expect("an empty file has the defaults");
    assert!(config.clone().with_listen("127.0.0.1:1".parse().expect("an address")).is_ok());
    let said = faults(config.with_listen("10.0.0.1:1".parse().expect("an address")));
    assert!(said[0].starts_with("server.listen: 10.0.0.1 can be reached"), "{said:?}");

    let pair = "certificate = \"site.pem\"\nprivate_key = \"keys/site.key\"";
    let config = parse(&format!("[server]\nlisten = \"0.0.0.0:443\"\n{pair}")).expect("a configuration");
    let server = &config.settings().server;
    assert!(server.is_encrypted());
    assert_eq!(server.certificate, Path::new("/etc/videofields/site.pem"));
    assert_eq!(server.private_key, Path::new("/etc/videofields/keys/site.key"));
    let said = faults_of("[server]\ncertificate = \"site.pem\"");
    assert!(said[0].contains("server.private_key: `certificate` needs a `private_key`"), "{said:?}");
    let said = faults_of("[server]\nlisten = \"[::]:443\"\nprivate_key = \"site.key\"");
    assert!(said.iter().any(|fault| fault.contains("server.certificate: `private_key` needs")), "{said:?}");
    assert!(said.iter().any(|fault| fault.contains("unencrypted")), "{said:?}");
}

#[test]
fn syntax_faults_have_line_and_column() {
    let said = faults_of("[server]\nlisten = \n[render\nsamples = 4\nsamples = 4");
    assert!(said.iter().any(|fault| fault.starts_with("2:")), "{said:?}");
    assert!(said.iter().any(|fault| fault.starts_with("3:")), "{said:?}");
    let said = faults_of("[render]\nsamples = 4\nsamples = 4");
    assert!(said[0].starts_with("3:1: duplicate key"), "{said:?}");
    // Columns are counted in characters: two bytes of u-umlaut are one.
    let said = faults_of("render = { adapter = \"\u{fc}\", sample = 4 }");
    assert!(said[0].starts_with("1:27: render.sample:"), "{said:?}");
}

#[test]
fn the_environment_wins_and_its_faults_name_the_variable() {
    let file = Path::new("/etc/videofields/site.toml");
    let read = |pairs| config::parse("[render]\nsamples = 1\nmax_pixels = 5", file, variables(pairs));
    let config = read(&[
        ("VIDEOFIELDS_RENDER__SAMPLES", "4"),
        ("VIDEOFIELDS_RENDER__ADAPTER", "4090"),
        ("VIDEOFIELDS_SERVER__LISTEN", "127.0.0.1:9000"),
        ("VIDEOFIELDS_MEDIA__ROOTS", "[\"a\", \"/b\"]"),
        ("VIDEOFIELDS_LOG", "debug"),
        ("HOME", "/srv"),
    ])
    .expect("a configuration without faults");
    let settings = config.settings();
    assert_eq!((settings.render.samples, settings.render.max_pixels), (4, 5));
    assert_eq!(settings.render.adapter, "4090");
    assert_eq!(settings.server.listen.port(), 9000);
    assert_eq!(settings.media.roots, [Path::new("/etc/videofields/a"), Path::new("/b")]);

    let said = faults(read(&[
        ("VIDEOFIELDS_RENDER__SAMPLES", "3"),
        ("VIDEOFIELDS_RENDER__SAMPLE", "1"),
        ("VIDEOFIELDS_RENDR__SAMPLES", "1"),
        ("VIDEOFIELDS_CAMERA__ID", "1"),
        ("VIDEOFIELDS_TIMELINE__MIB_PER_CAMERA", "lots"),
    ]));
    assert_eq!(said.len(), 5, "{said:#?}");
    for expected in [
        "environment variable VIDEOFIELDS_RENDER__SAMPLES: render.samples: expected 1 or 4, got 3",
        "environment variable VIDEOFIELDS_RENDER__SAMPLE: render.sample: unknown key `sample`; did you mean",
        "environment variable VIDEOFIELDS_RENDR__SAMPLES: rendr.samples: unknown section `rendr`; did you mean",
        "environment variable VIDEOFIELDS_CAMERA__ID: camera.id: credentials, cameras, scenes and snapshots are written in the file",
        "environment variable VIDEOFIELDS_TIMELINE__MIB_PER_CAMERA: timeline.mib_per_camera: wrong type: string",
    ] {
        assert!(said.iter().any(|fault| fault.starts_with(expected)), "{expected} is not in {said:#?}");
    }

    let broken = vec![("VIDEOFIELDS_SERVER__LISTEN".into(), OsString::from_vec(vec![0xff]))];
    let said = faults(config::parse("", file, broken));
    assert!(said[0].ends_with("server.listen: the value must be UTF-8"), "{said:?}");
}

#[test]
fn a_file_that_cannot_be_a_configuration_is_refused_before_it_is_parsed() {
    let folder = tempfile::tempdir().expect("a folder");
    let load = |path: &Path| config::load_with(path, NO_VARIABLES).expect_err("a refusal");
    let missing = load(&folder.path().join("none.toml"));
    assert_eq!(missing.kind(), ErrorKind::NotFound);
    assert!(missing.to_string().ends_with("none.toml"), "{missing}");
    assert!(load(folder.path()).to_string().contains("this is a directory"));
    assert!(load(Path::new("/dev/zero")).to_string().contains("a device, pipe or socket"));

    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        path
    };
    let large = write("large.toml", &vec![b'#'; 1 << 21]);
    assert_eq!(load(&large).kind(), ErrorKind::TooLarge);
    let latin = write("latin.toml", b"# one\n# caf\xe9\n");
    assert!(load(&latin).to_string().contains("latin.toml:2:6: the file must be UTF-8"));

    let good = write("good.toml", b"[storage]\ndatabase = \"data/./a.sqlite\"\n");
    let config = config::load_with(&good, NO_VARIABLES).expect("a configuration");
    assert_eq!(config.settings().storage.database, folder.path().join("data/a.sqlite"));
    assert_eq!(config.folder(), folder.path());
    assert_eq!(config.settings().camera.len(), 0);
}

#[test]
fn settings_of_a_program_are_validated_too() {
    let folder = Path::new("/srv");
    let text = "[[camera]]\nid = \"a\"\nsource.path = \"a.webm\"\nbackground.clip = \"b.webm\"\n\
                background.learning = \"hold\"";
    let mut settings = parse(text).expect("a camera").settings().clone();
    assert_eq!(settings.camera[0].background.learning, Learning::Hold);
    settings.camera.push(settings.camera[0].clone());
    settings.camera[1].segment.delta = Some(f64::NAN);
    let said = faults(Config::from_settings(settings, folder));
    assert_eq!(
        said,
        [
            "camera[1].id: there is another camera `a`; ids are unique",
            "camera[1].segment.delta: expected 0.001 to 1 (share of full scale), got NaN",
        ]
    );
}

mod mutations {
    //! Whatever is done to a configuration's text, the answer is a configuration or faults with places.

    use super::{full_example, parse};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(videofields_testing::seeded(1000))]
        #[test]
        fn no_text_makes_it_panic(
            cut in any::<prop::sample::Index>(),
            length in 0_usize..40,
            put in "(nan|inf|-1|1e999|\"|'|\\[|\\]|\\{|=|\\.|#|\n|\u{0}|\u{fc}|[a-z_0-9 ]){0,6}",
        ) {
            let example = full_example();
            let characters: Vec<char> = example.chars().collect();
            let start = cut.index(characters.len());
            let end = (start + length).min(characters.len());
            let text: String = characters[..start].iter().copied()
                .chain(put.chars())
                .chain(characters[end..].iter().copied())
                .collect();
            if let Err(error) = parse(&text) {
                prop_assert!(!error.faults().is_empty());
                prop_assert!(error.faults().iter().all(|fault| !fault.message.is_empty()));
            }
        }
    }
}
