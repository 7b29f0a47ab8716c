//! RTSP cameras that behave as public reports say some do.

use super::*;
use std::path::Path;
use videofields_testing::odd_rtsp::{OddCamera, Oddities, OverTcp, Parameter, UNSUPPORTED_TRANSPORT};
use videofields_testing::tls;

/// A camera of these oddities, and who is connected to it; 25 frames come a second.
fn connect(oddities: Oddities) -> (OddCamera, Camera) {
    let server = OddCamera::start(oddities);
    let camera = Camera::connect(settings(&server.url()));
    (server, camera)
}

fn n_of(server: &OddCamera, method: &str) -> usize {
    server.requests().iter().filter(|request| request.starts_with(method)).count()
}

/// Fails where the camera was lost meanwhile, or some of its frames were.
fn stays_live(oddities: Oddities, n_frames: u64) -> OddCamera {
    let said = format!("{oddities:?}");
    let (server, camera) = connect(oddities);
    let status = camera.wait_frames(n_frames);
    assert_eq!((status.retries, &status.reason), (0, &None), "{said}");
    assert!(status.dropped * 4 <= status.frames, "{said}: {status:?}");
    assert_eq!(n_of(&server, "DESCRIBE"), 1, "{said}");
    assert_grows(&camera.frames());
    server
}

#[test]
fn a_camera_whose_ssrc_changes_stays_live() {
    stays_live(Oddities { ssrc_each_group: true, ..Oddities::default() }, 50);
    stays_live(Oddities { n_first_ssrc: 7, ..Oddities::default() }, 50);
}

#[test]
fn signs_of_life_go_out_as_the_camera_takes_them() {
    let of =
        |parameter, methods| Oddities { timeout_secs: Some(2), parameter, methods, ..Oddities::default() };
    let server = stays_live(of(Parameter::Answered, None), 100);
    assert!(n_of(&server, "GET_PARAMETER") >= 2);
    let server = stays_live(of(Parameter::Unknown, Some("OPTIONS, GET_PARAMETER")), 100);
    assert_eq!(n_of(&server, "GET_PARAMETER"), 1, "who does not know it is asked otherwise");
    // The first request of each connection is one.
    assert!(n_of(&server, "OPTIONS") >= 2, "{:?}", server.requests());
    let server = stays_live(of(Parameter::Closes, Some("OPTIONS, DESCRIBE, SETUP, PLAY")), 100);
    assert_eq!(n_of(&server, "GET_PARAMETER"), 0, "it does not say that it has it");
    stays_live(of(Parameter::Silent, None), 100);
}

#[test]
fn a_camera_that_ends_upon_a_sign_of_life_is_asked_otherwise_from_then_on() {
    let oddities = Oddities { timeout_secs: Some(2), parameter: Parameter::Closes, ..Oddities::default() };
    let (server, camera) = connect(oddities);
    camera.wait("a new connection", |status| status.retries == 1);
    let status = camera.wait_frames(100);
    assert_eq!((status.retries, n_of(&server, "GET_PARAMETER")), (1, 1));
}

#[test]
fn damage_in_the_connection_costs_pictures_and_not_the_camera() {
    for garbage in [&b"\0\x01\x02garbage"[..], b"$", b"$\0\0\x20no packet", b"\r\n"] {
        stays_live(Oddities { garbage: Some((40, garbage)), ..Oddities::default() }, 50);
    }
    let (_server, camera) = connect(Oddities { cut_each: Some(60), ..Oddities::default() });
    let status = camera.wait_frames(50);
    assert_eq!(status.retries, 0, "{status:?}");
    assert!(status.dropped > 0, "what was lost is counted: {status:?}");
}

#[test]
fn packets_that_change_places_in_a_picture_that_comes_late_cost_nothing() {
    for over_tcp in [OverTcp::Given, OverTcp::Refused(UNSUPPORTED_TRANSPORT)] {
        let (_server, camera) = connect(Oddities { late_each: Some(25), over_tcp, ..Oddities::default() });
        let status = camera.wait_frames(100);
        let lost = camera.kept.0.lock().unwrap().lost.clone();
        let is_damaged = lost.iter().any(|(reason, _)| *reason == DropReason::Damaged);
        assert!(status.retries == 0 && !is_damaged, "TCP: {over_tcp:?}: {status:?}");
    }
}

#[test]
fn loose_answers_are_taken() {
    stays_live(Oddities { has_bare_lines: true, ..Oddities::default() }, 20);
}

#[test]
fn a_transport_that_is_refused_is_followed_by_the_other() {
    // Cameras refuse it in many words.
    for status in [
        UNSUPPORTED_TRANSPORT,
        "406 TCP TRANSPORT IS NOT SUPPORTED",
        "400 Bad Request",
        "500 Internal Server Error",
    ] {
        let server = stays_live(Oddities { over_tcp: OverTcp::Refused(status), ..Oddities::default() }, 50);
        assert_eq!(n_of(&server, "SETUP"), 2, "{status}");
    }
    let server = OddCamera::start(Oddities { is_tcp_only: true, ..Oddities::default() });
    let camera = Camera::connect(SourceSettings { transport: Transport::Udp, ..settings(&server.url()) });
    assert_eq!(camera.wait_frames(20).retries, 0);
    let refuses =
        |status| Oddities { over_tcp: OverTcp::Refused(status), is_tcp_only: true, ..Oddities::default() };
    let (_server, camera) = connect(refuses(UNSUPPORTED_TRANSPORT));
    camera.wait_failed("neither over TCP nor over UDP");
    let (_server, camera) = connect(refuses("500 Internal Server Error"));
    camera.wait_failed("500");
    // No other transport helps where the stream is not there, or the camera has too much to do.
    let server = OddCamera::start(Oddities {
        over_tcp: OverTcp::Refused("453 Not Enough Bandwidth"),
        ..Oddities::default()
    });
    let camera = Camera::connect(settings(&server.url()));
    camera.wait_failed("453");
    assert!(server.requests().iter().all(|request| !request.contains("client_port")));
}

#[test]
fn a_camera_that_answers_with_udp_to_who_asks_for_tcp_is_asked_for_udp() {
    let (server, camera) = connect(Oddities { over_tcp: OverTcp::AnsweredByUdp, ..Oddities::default() });
    let status = camera.wait_frames(20);
    assert_eq!((status.retries, &status.reason), (0, &None), "{status:?}");
    let requests = server.requests();
    let of = |method: &str| requests.iter().filter(|request| request.starts_with(method)).collect::<Vec<_>>();
    let (set_up, played, ended) = (of("SETUP"), of("PLAY"), of("TEARDOWN"));
    assert!(set_up[0].contains("interleaved") && set_up[1].contains("client_port"), "{requests:?}");
    assert_eq!((set_up.len(), played.len(), ended.len()), (2, 1, 1), "it is not left waiting: {requests:?}");
}

#[test]
fn a_camera_that_ends_the_connection_with_its_refusal_is_asked_otherwise_the_next_time() {
    let over_tcp = OverTcp::RefusedAndClosed("406 Not Acceptable");
    let (server, camera) = connect(Oddities { over_tcp, ..Oddities::default() });
    camera.wait_failed("406");
    assert_eq!(camera.wait_frames(20).retries, 1);
    assert_eq!(n_of(&server, "PLAY"), 1);
}

#[test]
fn a_camera_that_answers_loosely_over_tcp_and_refuses_udp_is_taken_as_it_was_asked() {
    let (server, camera) =
        connect(Oddities { over_tcp: OverTcp::GivenLoosely, is_tcp_only: true, ..Oddities::default() });
    let status = camera.wait_frames(20);
    assert_eq!((status.retries, n_of(&server, "PLAY")), (0, 1), "{:?}", server.requests());
}

#[test]
fn a_camera_that_sends_nothing_in_one_way_is_asked_for_the_other_the_next_time() {
    let (server, camera) = connect(Oddities { over_tcp: OverTcp::Silent, ..Oddities::default() });
    let status = camera.wait_frames(20);
    assert_eq!(status.retries, 1, "{status:?}");
    let requests = server.requests();
    let set_up: Vec<_> = requests.iter().filter(|request| request.starts_with("SETUP")).collect();
    assert!(set_up.len() == 2 && set_up[1].contains("client_port"), "{requests:?}");
}

/// Keeps the times of pictures and of the encoded frames that it is to record.
#[derive(Clone, Default)]
struct Recorded {
    seen: Arc<Mutex<Vec<Timestamp>>>,
    recorded: Arc<Mutex<Vec<Timestamp>>>,
}

impl FrameConsumer for Recorded {
    fn consume(&mut self, frame: Frame) {
        self.seen.lock().unwrap().push(frame.timestamp);
    }

    fn tap(&self) -> ingest::Tap {
        ingest::Tap::Open
    }

    fn record(&mut self, _frame: &EncodedFrame, time: Timestamp) {
        self.recorded.lock().unwrap().push(time);
    }
}

/// Connects to a camera that is recorded.
fn record(url: &str) -> (CameraWorker, Recorded) {
    let recorded = Recorded::default();
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let (id, start) = (CameraId::new("yard").unwrap(), (clock.now(), clock.monotonic()));
    let consumer = Box::new(recorded.clone());
    (CameraWorker::spawn(id, settings(url), roots(), clock, start, consumer).unwrap(), recorded)
}

#[test]
fn pictures_that_come_unencoded_are_recorded_as_they_come() {
    let server = RtspServer::start(
        0,
        "videotestsrc is-live=true pattern=ball ! video/x-raw,format=I420,width=64,height=48,framerate=25/1 ! \
         rtpvrawpay name=pay0 pt=96",
        None,
    );
    let (worker, recorded) = record(&server.url());
    wait_for("pictures", || (recorded.seen.lock().unwrap().len() >= 30).then_some(()));
    drop(worker);
    let (seen, recorded) = (recorded.seen.lock().unwrap(), recorded.recorded.lock().unwrap());
    assert_eq!(*recorded, *seen);
}

#[test]
fn frames_on_their_way_when_a_connection_ends_are_recorded() {
    const N_SENT: usize = 23;
    let server = OddCamera::start(Oddities { ends_after: Some(N_SENT), ..Oddities::default() });
    let (worker, recorded) = record(&server.url());
    for n_connections in 1..=2 {
        wait_for("the end", || {
            let status = worker.status();
            (status.state == CameraState::Failed && status.retries == n_connections - 1).then_some(())
        });
        let times = recorded.recorded.lock().unwrap().clone();
        assert_eq!(times.len(), n_connections as usize * N_SENT);
        assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
    }
}

/// Runs in a process of its own, since the certificates that are trusted are read once.
#[test]
fn a_camera_proves_its_name_or_is_left() {
    const CERTIFICATES: &str = "VIDEOFIELDS_TEST_CERTIFICATES";
    const AUTHORITIES: [(&str, &str, i32); 3] =
        [("own", "localhost", 2100), ("other-name", "elsewhere", 2100), ("expired", "localhost", 2020)];
    let Some(folder) = std::env::var_os(CERTIFICATES).map(std::path::PathBuf::from) else {
        let (files, _) = tls::Files::new();
        let mut trusted = std::fs::read(files.certificate()).unwrap();
        for (folder, name, end_year) in AUTHORITIES {
            let folder = files.folder().join(folder);
            tls::write_authority(&folder, name, end_year);
            trusted.extend(std::fs::read(folder.join("site.pem")).unwrap());
        }
        let bundle = files.folder().join("trusted.pem");
        std::fs::write(&bundle, trusted).unwrap();
        let name = "ingest_live::odd::a_camera_proves_its_name_or_is_left";
        let mut alone = std::process::Command::new(std::env::current_exe().unwrap());
        alone.args(["--exact", name, "--nocapture"]);
        alone.env(CERTIFICATES, files.folder()).env("SSL_CERT_FILE", bundle);
        let alone = alone.output().unwrap();
        let said = String::from_utf8_lossy(&alone.stdout) + String::from_utf8_lossy(&alone.stderr);
        assert!(alone.status.success() && said.contains("1 passed"), "{said}");
        return;
    };
    let odd = |folder: &Path, oddities| {
        let config = tls::server(&folder.join("site.pem"), &folder.join("site.key"));
        OddCamera::encrypted(&config, oddities)
    };
    let of = |folder: &Path| odd(folder, Oddities::default());
    let trusted = of(&folder);
    let camera = Camera::connect(settings(&trusted.url()));
    assert_eq!(camera.wait_frames(20).retries, 0);
    let fails = |folder: &Path| {
        let server = of(folder);
        Camera::connect(settings(&server.url())).wait_failed("does not prove its name");
    };
    let (files, _) = tls::Files::new();
    fails(files.folder());
    let address = trusted.url().replace("localhost", "127.0.0.1");
    Camera::connect(settings(&address)).wait_failed("does not prove its name");
    // Certificates of authorities that cameras use as their own.
    let own = of(&folder.join("own"));
    assert_eq!(Camera::connect(settings(&own.url())).wait_frames(20).retries, 0);
    fails(&folder.join("other-name"));
    fails(&folder.join("expired"));
    tls::write_authority(files.folder(), "localhost", 2100);
    fails(files.folder());
    // Neither silence, which somebody on the way may cause, nor an odd answer makes its stream come in the other way, which is not
    // encrypted.
    for over_tcp in [OverTcp::Silent, OverTcp::AnsweredByUdp, OverTcp::Refused("406 Not Acceptable")] {
        let server = odd(&folder, Oddities { over_tcp, ..Oddities::default() });
        let camera = Camera::connect(settings(&server.url()));
        camera.wait("a second connection", |_| n_of(&server, "SETUP") >= 2);
        let requests = server.requests();
        assert!(
            requests.iter().all(|request| !request.contains("client_port")),
            "{over_tcp:?}: {requests:?}"
        );
    }
    let loose = odd(&folder, Oddities { over_tcp: OverTcp::GivenLoosely, ..Oddities::default() });
    assert_eq!(Camera::connect(settings(&loose.url())).wait_frames(20).retries, 0);
}

/// A camera with a login, and the folder of its password.
fn with_login(server: &OddCamera) -> (Camera, tempfile::TempDir) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("password");
    std::fs::write(&path, "s3cret\n").unwrap();
    let (user, password_file) = (Some("viewer".to_owned()), Some(path));
    (Camera::connect(SourceSettings { user, password_file, ..settings(&server.url()) }), folder)
}

#[test]
fn logins_by_sha_256_are_known_and_unknown_ones_are_named() {
    let sha = "Digest realm=\"IP Camera\", nonce=\"9d6bb5\", algorithm=SHA-256, stale=\"FALSE\"";
    let server = OddCamera::start(Oddities { challenges: vec![sha], lets_in: true, ..Oddities::default() });
    assert_eq!(with_login(&server).0.wait_frames(5).retries, 0);
    assert!(server.requests().iter().any(|request| request.contains("algorithm=SHA-256")));
    let server = OddCamera::start(Oddities { challenges: vec!["Negotiate"], ..Oddities::default() });
    with_login(&server).0.wait_failed("Basic and Digest");
}

#[test]
fn a_login_that_runs_out_is_renewed_with_the_next_sign_of_life() {
    let server = OddCamera::start(Oddities {
        challenges: vec!["Digest realm=\"IP Camera\", nonce=\"early\""],
        lets_in: true,
        late_challenge: Some("Digest realm=\"IP Camera\", nonce=\"late\", stale=true"),
        timeout_secs: Some(2),
        ..Oddities::default()
    });
    let (camera, _folder) = with_login(&server);
    let status = camera.wait_frames(100);
    assert_eq!((status.retries, status.reason), (0, None));
    let n_late = server.requests().iter().filter(|request| request.contains("nonce=\"late\"")).count();
    assert!(n_late >= 1 && n_of(&server, "GET_PARAMETER") > n_late, "{:?}", server.requests());
}

#[test]
fn a_wrong_password_is_sent_once() {
    let challenge = "Digest realm=\"IP Camera\", nonce=\"9d6bb5\"";
    let server = OddCamera::start(Oddities { challenges: vec![challenge], ..Oddities::default() });
    let (camera, _folder) = with_login(&server);
    let status = camera.wait_failed("refuses the user or the password");
    assert!(status.reason.as_ref().unwrap().contains("10 minutes"), "{status:?}");
    // Forty seconds by this clock, in which another fault would be met some four times.
    SystemClock::new().sleep(Duration::from_secs(2));
    let n_answers = server.requests().iter().filter(|request| request.contains("Authorization:")).count();
    assert_eq!(n_answers, 1, "{:?}", server.requests());
}

#[test]
fn streams_that_are_not_read_are_named() {
    let description = "m=video 0 RTP/AVP 97\r\na=rtpmap:97 jpeg2000/90000\r\na=control:track1\r\n";
    let (_server, camera) = connect(Oddities { description: Some(description), ..Oddities::default() });
    let status = camera.wait_failed("JPEG2000, which is not supported");
    assert!(status.reason.as_ref().unwrap().contains("H.264"), "{status:?}");
}
