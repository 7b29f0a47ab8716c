//! Devices that speak ONVIF: found, and asked for their clocks and streams, whatever they answer.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use std::sync::Arc;
use videofields_recording::ingest::MediaRoots;
use videofields_recording::onvif::{
    Audience, DeviceReport, OnvifError, Wish, describe, device_service, probe,
};
use videofields_testing::onvif::{Answers, Oddities, OnvifDevice, PASSWORD, USER, Wanted};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{CameraUrl, CredentialsSettings, MediaSettings};

/// Asks a device in `networks` as the user with that password.
fn asked_within(
    networks: [&str; 2],
    device: &OnvifDevice,
    wish: Wish,
    password: Option<&str>,
) -> DeviceReport {
    let folder = tempfile::tempdir().unwrap();
    let password_file = folder.path().join("password");
    std::fs::write(&password_file, password.unwrap_or_default()).unwrap();
    let [cameras, login] = networks.map(|network| vec![network.parse().unwrap()]);
    let credentials = CredentialsSettings {
        id: "gates".to_owned(),
        user: USER.to_owned(),
        password_file: Some(password_file),
        password_env: None,
        networks: login,
    };
    let roots = MediaRoots::new(&[]).unwrap().with_networks(&cameras).with_credentials(&[credentials]);
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let url = device_service(&device.address().to_string()).unwrap();
    describe(&url, (&roots, password.map(|_known| "gates")), wish, &clock)
}

fn asked(device: &OnvifDevice, wish: Wish, password: Option<&str>) -> DeviceReport {
    asked_within(["127.0.0.0/8"; 2], device, wish, password)
}

fn started(oddities: Oddities) -> (OnvifDevice, DeviceReport) {
    let device = OnvifDevice::start(oddities);
    let report = asked(&device, Wish::Streams, Some(PASSWORD));
    (device, report)
}

/// Each stream's profile, encoding and URL.
fn streams(report: &DeviceReport) -> Vec<(&str, &str, Option<CameraUrl>)> {
    let told = |url: &Option<CameraUrl>| url.clone();
    report
        .streams
        .iter()
        .map(|stream| (stream.profile.as_str(), stream.encoding.as_deref().unwrap_or(""), told(&stream.url)))
        .collect()
}

fn url(path: &str) -> Option<CameraUrl> {
    Some(CameraUrl::new(format!("rtsp://127.0.0.1:8554/live/{path}?a=1&b=2")))
}

fn is_well(report: &DeviceReport) {
    assert!(report.problem.is_none(), "{report:?}");
    assert_eq!(streams(report), [("The main", "H265", url("main")), ("The sub", "H264", url("sub"))]);
    assert_eq!((report.maker.as_deref(), report.model.as_deref()), (Some("Cameras & Sons"), Some("XN-7")));
    assert_eq!((report.streams[0].size_px, report.streams[0].rate_hz), (Some([3840, 2160]), Some(20.0)));
}

#[test]
fn a_device_is_found_once_and_named() {
    let noise = [b"hello".to_vec(), vec![b'<'; 60_000], b"<!DOCTYPE a [<!ENTITY x 'x'>]><a>&x;</a>".to_vec()];
    let device = OnvifDevice::start(Oddities { before_own: noise.to_vec(), ..Oddities::default() });
    let found = probe(Audience::One(device.probed()), &MediaSettings::default().networks).unwrap();
    assert_eq!(found.devices.len(), 1, "{found:?}");
    let camera = &found.devices[0];
    assert_eq!((camera.name.as_deref(), camera.model.as_deref()), (Some("North gate"), Some("XN-7")));
    assert_eq!(camera.services, [device_service(&device.address().to_string()).unwrap()]);
    // The question is put twice.
    assert_eq!((found.n_ignored, found.is_cut), (6, false));
    let elsewhere = ["10.0.0.0/8".parse().unwrap()];
    let none = probe(Audience::One(device.probed()), &elsewhere).unwrap();
    assert_eq!(
        (none.devices.len(), none.n_ignored),
        (0, 10),
        "answers from where no camera may be do not count"
    );
}

#[test]
fn a_device_whose_clock_is_off_is_logged_in_at_by_its_own_clock() {
    for ahead_secs in [37, -37, -1_000_000_000] {
        let (device, report) = started(Oddities { ahead_secs, ..Oddities::default() });
        is_well(&report);
        let clock = report.clock.unwrap();
        assert!((clock.secs - ahead_secs as f64).abs() <= clock.error_secs, "{clock:?}");
        assert!(clock.error_secs < 3.0, "{clock:?}");
        let asked = device.asked();
        assert_eq!(asked[0], "GetSystemDateAndTime nobody /onvif/device_service");
        assert!(asked[1..].iter().all(|asked| asked.contains(" token ")), "{asked:?}");
        assert_eq!(asked.last().unwrap(), "GetStreamUri token /onvif/media2");
    }
}

#[test]
fn a_clock_is_told_to_nobody_in_particular() {
    let device = OnvifDevice::start(Oddities { ahead_secs: 37, ..Oddities::default() });
    let report = asked(&device, Wish::Clock, Some(PASSWORD));
    assert!(report.problem.is_none() && report.streams.is_empty(), "{report:?}");
    assert!((report.clock.unwrap().secs - 37.0).abs() < 3.0, "{report:?}");
    assert_eq!(device.asked(), ["GetSystemDateAndTime nobody /onvif/device_service"]);
    let shy = OnvifDevice::start(Oddities { hides_clock: true, ..Oddities::default() });
    let report = asked(&shy, Wish::Streams, Some(PASSWORD));
    is_well(&report);
    assert_eq!(
        shy.asked()[..2],
        [
            "GetSystemDateAndTime nobody /onvif/device_service",
            "GetSystemDateAndTime token /onvif/device_service"
        ]
    );
}

#[test]
fn prefixes_and_age_do_not_matter() {
    let (_, report) = started(Oddities { prefix: Some("n"), ..Oddities::default() });
    is_well(&report);
    for is_very_old in [false, true] {
        let (_, report) = started(Oddities { is_old: true, is_very_old, ..Oddities::default() });
        assert!(report.problem.is_none(), "{report:?}");
        assert_eq!(streams(&report), [("The main", "H264", url("main")), ("The sub", "JPEG", url("sub"))]);
    }
}

#[test]
fn a_digest_of_http_does_where_a_token_does_not_and_the_password_is_never_told() {
    let (device, report) = started(Oddities { wanted: Wanted::Digest, ..Oddities::default() });
    is_well(&report);
    let tokens = device.asked().iter().filter(|asked| asked.contains(" token ")).count();
    assert_eq!(tokens, 1, "what was refused once is not tried again: {:?}", device.asked());
    let (device, report) = started(Oddities { wanted: Wanted::Basic, ..Oddities::default() });
    assert!(report.problem.is_some_and(|problem| problem.is_of_login()));
    assert!(device.asked().iter().all(|asked| !asked.contains("Basic")), "{:?}", device.asked());
    let device = OnvifDevice::start(Oddities { wanted: Wanted::Nothing, ..Oddities::default() });
    is_well(&asked(&device, Wish::Streams, None));
}

#[test]
fn a_wrong_password_is_sent_once_in_each_way() {
    for (wanted, n_tries) in [(Wanted::Token, 1), (Wanted::Digest, 2)] {
        let device = OnvifDevice::start(Oddities { wanted, ..Oddities::default() });
        let report = asked(&device, Wish::Streams, Some("s3cret"));
        let problem = report.problem.unwrap();
        assert!(
            problem.is_of_login() && problem.to_string().contains("refuses the user or the password"),
            "{problem}"
        );
        assert!(report.clock.is_some(), "the clock is known all the same");
        assert_eq!(device.asked().len(), 1 + n_tries, "{:?}", device.asked());
        let report = asked(&device, Wish::Streams, None);
        assert!(report.problem.is_some_and(|problem| problem.to_string().contains("or wants one")));
    }
}

#[test]
fn what_is_too_much_or_no_answer_is_told_as_such() {
    let of = |answers: Answers| started(Oddities { answers, ..Oddities::default() }).1.problem.unwrap();
    let check = |answers: Answers, part: &str| {
        let problem = of(answers);
        assert!(problem.to_string().contains(part), "{answers:?}: {problem}");
        assert!(!format!("{problem:?}").contains("s3cret"), "{problem:?}");
    };
    check(Answers::Huge, "more than 1048576 bytes");
    check(Answers::Entities, "does not answer as a camera with ONVIF does");
    check(Answers::Page, "has no such stream");
    check(Answers::Redirected, "is not followed");
    check(Answers::Never, "does not answer in time");
}

#[test]
fn another_host_is_told_beside_the_one_that_answered_and_never_asked() {
    for (authority, host) in [("192.168.0.100:80", "192.168.0.100"), ("0.0.0.0:80", "0.0.0.0")] {
        let told_login = Some("admin:s3cret");
        let (_device, report) =
            started(Oddities { told_authority: Some(authority), told_login, ..Oddities::default() });
        is_well(&report);
        let told = CameraUrl::new(format!("rtsp://{host}:8554/live/main?a=1&b=2"));
        assert_eq!(report.streams[0].reported_url, Some(told));
    }
    let device =
        OnvifDevice::start(Oddities { told_authority: Some("192.168.0.100:80"), ..Oddities::default() });
    let found = probe(Audience::One(device.probed()), &MediaSettings::default().networks).unwrap();
    let camera = &found.devices[0];
    assert_eq!(camera.services, [CameraUrl::new("http://127.0.0.1/onvif/device_service")]);
    assert_eq!(camera.reported_services, [CameraUrl::new("http://192.168.0.100:80/onvif/device_service")]);
}

#[test]
fn only_networks_of_cameras_are_asked_and_only_those_of_a_login_are_told_it() {
    let device = OnvifDevice::start(Oddities::default());
    for networks in [["10.0.0.0/8", "127.0.0.0/8"], ["127.0.0.0/8", "10.0.0.0/8"]] {
        let problem = asked_within(networks, &device, Wish::Streams, Some(PASSWORD)).problem.unwrap();
        let named =
            if networks[0] == "10.0.0.0/8" { "media.networks" } else { "networks of credentials \"gates\"" };
        assert!(matches!(problem, OnvifError::Reach(_)) && problem.to_string().contains(named), "{problem}");
        assert!(device.asked().is_empty());
    }
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let url = device_service(&device.address().to_string()).unwrap();
    let none = describe(&url, (&MediaRoots::new(&[]).unwrap(), Some("yards")), Wish::Streams, &clock);
    assert!(none.problem.unwrap().to_string().contains("no credentials \"yards\""));
}
