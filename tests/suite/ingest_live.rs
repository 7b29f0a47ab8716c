//! Live cameras seen from outside: an RTSP server and HTTP servers of this process, in real time.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

mod http;
mod odd;

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use videofields_recording::ingest::{
    self, CameraState, CameraStatus, CameraWorker, FrameConsumer, MediaRoots, Polled,
};
use videofields_recording::media::{Decoder, EncodedFrame, EncodedQueue, Input, Muxer, Peer};
use videofields_recording::telemetry::DropReason;
use videofields_testing::rtsp::{RtspServer, ball, jpeg_ball};
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::{CameraUrl, CredentialsSettings, SourceSettings, Transport};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, Frame};

fn settings(url: &str) -> SourceSettings {
    SourceSettings { url: Some(CameraUrl::new(url)), ..SourceSettings::default() }
}

fn roots() -> MediaRoots {
    MediaRoots::new(&[]).unwrap()
}

/// The machine's clocks, but that nobody waits long: sleeping moves them on.
struct HastyClock {
    system: SystemClock,
    skipped_nanos: AtomicU64,
}

impl Clock for HastyClock {
    fn now(&self) -> Timestamp {
        self.system.now()
    }

    fn monotonic(&self) -> Duration {
        self.system.monotonic() + Duration::from_nanos(self.skipped_nanos.load(Ordering::Relaxed))
    }

    fn sleep(&self, duration: Duration) {
        let real = duration / 20;
        self.system.sleep(real);
        let skipped = u64::try_from((duration - real).as_nanos()).unwrap();
        self.skipped_nanos.fetch_add(skipped, Ordering::Relaxed);
    }
}

/// What a camera delivered: scene time and size of each frame, and what was lost.
#[derive(Clone, Default)]
struct Kept(Arc<Mutex<Delivered>>);

#[derive(Default)]
struct Delivered {
    frames: Vec<(Timestamp, (u32, u32))>,
    lost: Vec<(DropReason, u64)>,
}

impl FrameConsumer for Kept {
    fn consume(&mut self, frame: Frame) {
        let size = (frame.image.width(), frame.image.height());
        self.0.lock().unwrap().frames.push((frame.timestamp, size));
    }

    fn miss(&mut self, reason: DropReason, n: u64) {
        self.0.lock().unwrap().lost.push((reason, n));
    }
}

struct Camera {
    worker: CameraWorker,
    kept: Kept,
}

impl Camera {
    fn connect(settings: SourceSettings) -> Self {
        Self::connect_within(roots(), settings)
    }

    fn connect_within(roots: MediaRoots, settings: SourceSettings) -> Self {
        let clock = HastyClock { system: SystemClock::new(), skipped_nanos: AtomicU64::new(0) };
        let (kept, start) = (Kept::default(), (clock.now(), clock.monotonic()));
        let id = CameraId::new("yard").unwrap();
        let consumer = Box::new(kept.clone());
        let worker = CameraWorker::spawn(id, settings, roots, Arc::new(clock), start, consumer).unwrap();
        Self { worker, kept }
    }

    /// Waits until the camera is as it should be.
    fn wait(&self, what: &str, is_so: impl Fn(&CameraStatus) -> bool) -> CameraStatus {
        wait_for(what, || Some(self.worker.status()).filter(|status| is_so(status)))
    }

    fn wait_failed(&self, part: &str) -> CameraStatus {
        let has = |status: &CameraStatus| status.reason.as_ref().is_some_and(|reason| reason.contains(part));
        self.wait(part, |status| status.state == CameraState::Failed && has(status))
    }

    /// Waits for `n` frames more.
    fn wait_frames(&self, n: u64) -> CameraStatus {
        let before = self.worker.status().frames;
        self.wait("frames", |status| status.frames >= before + n && status.state == CameraState::Live)
    }

    fn frames(&self) -> Vec<(Timestamp, (u32, u32))> {
        self.kept.0.lock().unwrap().frames.clone()
    }
}

fn assert_grows(frames: &[(Timestamp, (u32, u32))]) {
    assert!(frames.windows(2).all(|pair| pair[0].0 < pair[1].0), "{frames:?}");
}

/// What a live source shows to who looks once.
fn look(url: &str) -> Result<ingest::Look, ingest::IngestError> {
    ingest::look(&settings(url), 0.0, &roots(), &ingest::StopFlag::default())
}

#[test]
fn a_camera_is_looked_at_once() {
    let server = RtspServer::start(0, &ball(320, 240), None);
    let seen = look(&server.url()).unwrap();
    assert_eq!((seen.image.width(), seen.image.height()), (320, 240));
    assert_eq!(seen.codec.as_deref(), Some("h264"), "{seen:?}");
    assert!(seen.rate_hz.is_some_and(|rate| (5.0..=60.0).contains(&rate)), "{seen:?}");
    assert_eq!((seen.duration_secs, seen.at_secs), (None, None));
    let error = look("http://8.8.8.8/live?key=s3cret").unwrap_err();
    assert!(error.to_string().contains("media.networks") && !error.to_string().contains("s3cret"));
    // One that takes the connection and says nothing is waited for until nobody waits any more.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("rtsp://{}/live", silent.local_addr().unwrap());
    let stop = ingest::StopFlag::default();
    let waiting = stop.clone();
    let looked = std::thread::Builder::new()
        .name("look".to_owned())
        .spawn(move || ingest::look(&settings(&url), 0.0, &roots(), &waiting));
    SystemClock::new().sleep(Duration::from_millis(500));
    stop.raise();
    assert!(looked.unwrap().join().unwrap().is_err());
}

#[test]
fn frames_come_over_tcp_and_udp_with_the_time_of_their_arrival() {
    let server = RtspServer::start(0, &ball(320, 240), None);
    for transport in [Transport::Tcp, Transport::Udp] {
        let started = SystemClock::new();
        let camera = Camera::connect(SourceSettings { transport, ..settings(&server.url()) });
        camera.wait("a frame", |status| status.frames > 0);
        assert!(started.monotonic() < Duration::from_secs(5), "{transport:?}");
        let status = camera.wait_frames(20);
        let late = started.now().secs_since(status.last_timestamp.unwrap());
        assert!((-0.1..1.0).contains(&late), "{transport:?}: {late} s");
        assert_eq!((status.size, status.reason, status.retries), (Some((320, 240)), None, 0));
        let frames = camera.frames();
        assert_grows(&frames);
        let pace = frames[19].0.secs_since(frames[5].0) / 14.0;
        assert!((0.02..0.08).contains(&pace), "{transport:?}: {pace} s a frame");
    }
}

#[test]
fn the_password_opens_the_camera_and_is_never_told() {
    let server = RtspServer::start(0, &ball(320, 240), Some(("viewer", "s3cret-right")));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("password");
    std::fs::write(&path, "s3cret-wrong\n").unwrap();
    let (user, password_file) = (Some("viewer".to_owned()), Some(path.clone()));
    let camera = Camera::connect(SourceSettings { user, password_file, ..settings(&server.url()) });
    let status = camera.wait_failed("refuses the user or the password");
    assert!(status.reason.as_ref().unwrap().contains(&format!("rtsp://127.0.0.1:{}", server.port())));
    assert!(status.next_try.is_some() && !format!("{status:?}").contains("s3cret"), "{status:?}");
    // The file is read at each connecting.
    std::fs::write(&path, "s3cret-right\n").unwrap();
    let status = camera.wait_frames(3);
    assert!(status.retries > 0 && status.next_try.is_none(), "{status:?}");
    let nobody = Camera::connect(settings(&server.url()));
    nobody.wait_failed("refuses the user or the password");
}

#[test]
fn credentials_by_name_open_the_cameras_that_they_are_for() {
    let server = RtspServer::start(0, &ball(320, 240), Some(("viewer", "s3cret-right")));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("password");
    std::fs::write(&path, "s3cret-wrong\n").unwrap();
    let credentials = |network: &str| CredentialsSettings {
        id: "gates".to_owned(),
        user: "viewer".to_owned(),
        password_file: Some(path.clone()),
        password_env: None,
        networks: vec![network.parse().unwrap()],
    };
    let connect = |name: &str, network: &str| {
        let roots = roots().with_credentials(&[credentials(network)]);
        let credentials = Some(name.to_owned());
        Camera::connect_within(roots, SourceSettings { credentials, ..settings(&server.url()) })
    };
    connect("gates", "10.0.0.0/8").wait_failed("is in none of the networks of credentials \"gates\"");
    connect("yards", "127.0.0.0/8").wait_failed("no credentials \"yards\": it has gates");
    let camera = connect("gates", "127.0.0.0/8");
    camera.wait_failed("refuses the user or the password");
    // Tried anew before ten minutes are over, since the file is another.
    std::fs::write(&path, "s3cret-right\n").unwrap();
    let status = camera.wait_frames(3);
    assert!(!format!("{status:?}").contains("s3cret"), "{status:?}");
}

/// Memory that this process holds, bytes.
fn resident_bytes() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").unwrap();
    pages.split(' ').nth(1).unwrap().parse::<u64>().unwrap() * 4096
}

#[test]
fn a_camera_that_comes_back_is_live_again_every_time() {
    // In a process of its own: memory is the whole process's, and other tests take some.
    if std::env::var_os("VIDEOFIELDS_ALONE").is_none() {
        let name = "ingest_live::a_camera_that_comes_back_is_live_again_every_time";
        let mut alone = std::process::Command::new(std::env::current_exe().unwrap());
        let alone =
            alone.args(["--exact", name, "--nocapture"]).env("VIDEOFIELDS_ALONE", "1").output().unwrap();
        let said = String::from_utf8_lossy(&alone.stdout) + String::from_utf8_lossy(&alone.stderr);
        assert!(alone.status.success() && said.contains("1 passed"), "{said}");
        return;
    }
    let n: u64 = std::env::var("VIDEOFIELDS_RESTARTS").map_or(5, |n| n.parse().unwrap());
    let sizes = [(320, 240), (400, 304)];
    let mut server = Some(RtspServer::start(0, &ball(320, 240), None));
    let (port, url) = (server.as_ref().unwrap().port(), server.as_ref().unwrap().url());
    let camera = Camera::connect(settings(&url));
    camera.wait_frames(3);
    let mut before_bytes = resident_bytes();
    for turn in 1..=n {
        let retries = camera.worker.status().retries;
        drop(server.take());
        camera.wait("the camera is given up", |status| !status.state.delivers());
        let size = sizes[turn as usize % 2];
        server = Some(RtspServer::start(port, &ball(size.0, size.1), None));
        let is_back = |status: &CameraStatus| status.state == CameraState::Live && status.size == Some(size);
        let status = camera.wait("the camera is live again", is_back);
        assert!(status.retries > retries && status.reason.is_none(), "{status:?}");
        // What is loaded and cached once is there by then.
        if turn == n / 2 {
            before_bytes = resident_bytes();
        }
    }
    assert_grows(&camera.frames());
    let grown = resident_bytes().saturating_sub(before_bytes);
    assert!(grown < 48 << 20, "{grown} bytes more than {before_bytes} after {n} restarts");
}

#[test]
fn another_size_within_the_stream_goes_on_without_a_new_connection() {
    let server = RtspServer::start(0, &ball(320, 240), None);
    let camera = Camera::connect(settings(&server.url()));
    camera.wait_frames(5);
    server.resize(480, 360);
    let status = camera.wait("the new size", |status| status.size == Some((480, 360)));
    assert_eq!((status.retries, status.state), (0, CameraState::Live));
    camera.wait_frames(5);
    assert_grows(&camera.frames());
}

#[test]
fn packets_that_are_lost_cost_pictures_and_not_the_camera() {
    // Several packets a picture, so that pictures come in parts.
    let noise = ball(320, 240).replace("pattern=ball", "pattern=snow");
    let server = RtspServer::start(0, &noise, None);
    let transport = Transport::Udp;
    let camera = Camera::connect(SourceSettings { transport, ..settings(&server.url()) });
    camera.wait_frames(10);
    server.lose_every(50);
    let n_before = camera.worker.status().frames;
    wait_for("lost pictures to be counted", || {
        let lost = &camera.kept.0.lock().unwrap().lost;
        lost.iter().any(|(reason, _)| *reason == DropReason::Damaged).then_some(())
    });
    // The clock does not move on by itself: these frames have come meanwhile and after.
    let status = camera.wait_frames(25);
    assert!(status.frames > n_before && status.dropped > 0, "{status:?}");
    assert_eq!((status.retries, status.reason), (0, None), "the camera stays connected");
    assert_grows(&camera.frames());
}

#[test]
fn a_camera_that_comes_back_with_another_codec_is_live_again() {
    let mut server = Some(RtspServer::start(0, &ball(320, 240), None));
    let (port, url) = (server.as_ref().unwrap().port(), server.as_ref().unwrap().url());
    let camera = Camera::connect(settings(&url));
    camera.wait_frames(3);
    for (launch, size) in [(jpeg_ball(400, 304), (400, 304)), (ball(320, 240), (320, 240))] {
        drop(server.take());
        camera.wait("the camera is given up", |status| !status.state.delivers());
        server = Some(RtspServer::start(port, &launch, None));
        let is_back = |status: &CameraStatus| status.state == CameraState::Live && status.size == Some(size);
        camera.wait("the camera is live again", is_back);
        camera.wait_frames(3);
    }
    assert_grows(&camera.frames());
}

#[test]
fn who_never_answers_is_given_up_in_time() {
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = silent.local_addr().unwrap().port();
    for scheme in ["rtsp", "http"] {
        let started = SystemClock::new();
        let camera = Camera::connect(settings(&format!("{scheme}://127.0.0.1:{port}/s3cret")));
        let status = camera.wait_failed("does not answer in time");
        assert!(started.monotonic() < Duration::from_secs(10), "{scheme}: {:?}", started.monotonic());
        assert!(!format!("{status:?}").contains("s3cret"), "{status:?}");
    }
}

/// Answers each request of one connection after the other with what `answer` makes of it.
fn answering(answer: impl Fn(&str) -> String + Send + 'static) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let serve = move || {
        for stream in listener.incoming() {
            serve_one(stream.unwrap(), &answer);
        }
    };
    std::thread::Builder::new().name("camera".to_owned()).spawn(serve).unwrap();
    port
}

fn serve_one(mut stream: TcpStream, answer: &impl Fn(&str) -> String) {
    let (mut text, mut bytes) = (String::new(), [0; 4096]);
    while let Ok(n @ 1..) = stream.read(&mut bytes) {
        text.push_str(&String::from_utf8_lossy(&bytes[..n]));
        while let Some((head, rest)) = text.split_once("\r\n\r\n") {
            let reply = answer(head);
            text = rest.to_owned();
            if stream.write_all(reply.as_bytes()).is_err() {
                return;
            }
        }
    }
}

/// An RTSP answer to the request with this head.
fn rtsp_answer(head: &str, status: &str, fields: &str) -> String {
    let number = head.lines().find(|line| line.starts_with("CSeq")).unwrap_or("CSeq: 0");
    format!("RTSP/1.0 {status}\r\n{number}\r\n{fields}\r\n")
}

#[test]
fn redirects_are_refused_and_nobody_else_is_connected_to() {
    let elsewhere = TcpListener::bind("127.0.0.1:0").unwrap();
    elsewhere.set_nonblocking(true).unwrap();
    let other = elsewhere.local_addr().unwrap().port();
    let rtsp = answering(move |head| {
        if head.starts_with("OPTIONS") {
            rtsp_answer(head, "200 OK", "Public: DESCRIBE, SETUP, PLAY\r\n")
        } else {
            rtsp_answer(head, "302 Moved", &format!("Location: rtsp://127.0.0.1:{other}/a\r\n"))
        }
    });
    let http = answering(move |_head| {
        format!("HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:{other}/a\r\nContent-Length: 0\r\n\r\n")
    });
    for url in [format!("rtsp://127.0.0.1:{rtsp}/a"), format!("http://127.0.0.1:{http}/a")] {
        let camera = Camera::connect(settings(&url));
        camera.wait_failed("says that the stream is elsewhere");
        // Twice, so that the first attempt is wholly gone.
        camera.wait("a second attempt", |status| status.retries > 1);
        drop(camera);
        assert_eq!(
            elsewhere.accept().map(|_| ()).unwrap_err().kind(),
            std::io::ErrorKind::WouldBlock,
            "{url}"
        );
    }
}

#[test]
fn what_is_wrong_with_a_camera_is_told() {
    let server = RtspServer::start(0, &ball(320, 240), None);
    let closed = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let busy = answering(|head| rtsp_answer(head, "503 Service Unavailable", ""));
    let open = |url: &str| {
        let mut source =
            ingest::open(&settings(url), &roots()).map_err(|error| (error.kind(), error.to_string()));
        let first = source.as_mut().map_err(|error| error.clone()).and_then(|source| {
            source.next_frame().map(|_| ()).map_err(|error| (error.kind(), error.to_string()))
        });
        first.unwrap_err()
    };
    let check = |url: &str, kind: ErrorKind, parts: &[&str]| {
        let (found, said) = open(url);
        assert_eq!(found, kind, "{said}");
        assert!(parts.iter().all(|part| said.contains(part)) && !said.contains("s3cret"), "{said}");
    };
    let at = |port: u16| format!("rtsp://127.0.0.1:{port}");
    let other = server.url().replace("/cam", "/s3cret");
    check(&other, ErrorKind::NotFound, &[&at(server.port()), "has no such stream"]);
    check(&format!("{}/s3cret", at(closed)), ErrorKind::Unavailable, &[&at(closed), "is not reached"]);
    check(&format!("{}/s3cret", at(busy)), ErrorKind::Unavailable, &["answers with status 503"]);
    check(&format!("http://127.0.0.1:{closed}/s3cret"), ErrorKind::Unavailable, &["is not reached"]);
    check("rtsp://203.0.113.7/s3cret", ErrorKind::Invalid, &["203.0.113.7", "media.networks"]);
    check("http://169.254.169.254/s3cret", ErrorKind::Invalid, &["media.networks"]);
    let sound =
        RtspServer::start(0, "( audiotestsrc is-live=true ! alawenc ! rtppcmapay name=pay0 pt=8 )", None);
    let (_, said) = open(&sound.url());
    assert!(said.contains(&at(sound.port())), "{said}");
}

#[test]
fn the_time_of_capture_comes_with_the_frames() {
    let server = RtspServer::start(0, &ball(320, 240), None);
    let mut source = ingest::open(&settings(&server.url()), &roots()).unwrap();
    assert!(source.is_live());
    let clock = SystemClock::new();
    let reference = wait_for("a time of capture", || match source.poll().unwrap() {
        Polled::Frame(frame) => frame.reference,
        Polled::Waiting | Polled::Ended => None,
    });
    let late = clock.now().secs_since(reference);
    assert!((-0.05..1.0).contains(&late), "{late} s");
}

#[test]
fn encoded_frames_come_beside_the_pictures_of_a_camera() {
    let server = RtspServer::start(0, &ball(320, 240), None);
    let queue = Arc::new(EncodedQueue::new(1 << 20));
    let peer = Peer {
        address: ([127, 0, 0, 1], server.port()).into(),
        host: "127.0.0.1".to_owned(),
        is_encrypted: false,
        place: "a camera".to_owned(),
        authority: "127.0.0.1".to_owned(),
        url: server.url(),
        path_and_query: "/".to_owned(),
    };
    let input = Input::rtsp(&peer, Transport::Tcp, None).unwrap();
    let mut decoder = Decoder::start(input, Some(&queue)).unwrap();
    let patience = Duration::from_millis(10);
    let mut n_pictures = 0;
    wait_for("pictures", || {
        assert!(decoder.fault().is_none());
        n_pictures += u32::from(decoder.pull(patience).is_some());
        (n_pictures == 10).then_some(())
    });
    let frames: Vec<_> = std::iter::from_fn(|| queue.take()).collect();
    assert!(frames.len() >= 10, "{}", frames.len());
    assert!(frames[0].is_key);
    assert_eq!((frames[0].format.codec(), frames[0].format.size_px()), ("video/x-h264", Some((320, 240))));
    let times: Vec<_> = frames.iter().map(|frame| frame.stream_nanos).collect();
    let odd: Vec<_> = frames.iter().map(|f| (f.stream_nanos, f.is_key, f.len_bytes())).collect();
    assert!(times.iter().all(Option::is_some), "{odd:?}");
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
}
