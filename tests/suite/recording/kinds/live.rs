//! Cameras in the network and at this machine, each of another kind.

use super::check::{self, Expected, Known};
use super::{EVEN_PX, H264, H265, JPEG, Numbered, USUAL_PX, VP8, VP9, X264, X265};
use super::{can_be_found, in_threads, start, wait_for};
use crate::recording::{At, Running, number_of};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use videofields_testing::odd_rtsp::{ODD_PICTURES, OddCamera, Oddities};
use videofields_testing::rtsp::RtspServer;
use videofields_testing::video::luma_of;
use videofields_testing::{say_skipped, tls};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::frame::CameraId;

/// Frames of a camera's film: more than any test waits for.
const N_FRAMES: u64 = 400;

const RATE_HZ: u32 = 20;

/// Frames that are seen of each camera: more than a part of them that is exported.
const N_SEEN: usize = 26;

const RAW_ID: &str = "rtsp-raw";

/// A kind of RTSP camera.
struct Kind {
    id: &'static str,
    encoder: &'static str,
    /// Elements that make packets of what lies in Matroska.
    payloader: &'static str,
    size_px: (u32, u32),
    recorded: &'static str,
}

/// A camera that is recorded.
struct Live {
    id: &'static str,
    url: String,
    size_px: (u32, u32),
    recorded: &'static str,
    /// Numbers after which a film begins anew.
    n_numbers: u64,
}

impl Live {
    /// Pictures that come unencoded are recorded as far as they are seen: a newer one replaces one that was not taken.
    fn largest_step(&self) -> u64 {
        if self.id == RAW_ID { N_FRAMES / 2 } else { 1 }
    }
}

impl Kind {
    const fn new(
        id: &'static str,
        (encoder, payloader): (&'static str, &'static str),
        recorded: &'static str,
    ) -> Self {
        Self { id, encoder, payloader, size_px: USUAL_PX, recorded }
    }

    fn serve(&self, folder: &Path) -> (RtspServer, Live) {
        let path = folder.join(format!("{}.mkv", self.id));
        let film =
            Numbered { n_frames: N_FRAMES, rate_hz: RATE_HZ, encoder: self.encoder, muxer: "matroskamux" };
        film.write_sized(&path, self.size_px);
        let Self { id, payloader, size_px, recorded, .. } = *self;
        let launch =
            format!("( filesrc location={} ! matroskademux ! {payloader} name=pay0 pt=96 )", path.display());
        let server = RtspServer::start(0, &launch, None);
        let url = server.url();
        (server, Live { id, url, size_px, recorded, n_numbers: N_FRAMES })
    }
}

/// Serves JPEG over HTTP: picture after picture in an answer without end, or one an answer.
fn serve_jpeg(head: &'static str, send: fn(&mut TcpStream, &AtomicU64) -> std::io::Result<()>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}/video", listener.local_addr().unwrap());
    let serve = move || {
        let next = AtomicU64::new(0);
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut request = [0; 4096];
            // Whoever hangs up has seen enough.
            let answered = stream.read(&mut request).and_then(|_n| stream.write_all(head.as_bytes()));
            answered.and_then(|()| send(&mut stream, &next)).unwrap_or_default();
        }
    };
    std::thread::Builder::new().name("camera".to_owned()).spawn(serve).unwrap();
    url
}

fn jpeg(number: u64) -> Vec<u8> {
    let (width, height) = EVEN_PX;
    let picture = image::RgbImage::from_fn(width, height, |x, _y| image::Rgb([luma_of(number, x, width); 3]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

fn send_parts(stream: &mut TcpStream, next: &AtomicU64) -> std::io::Result<()> {
    let clock = SystemClock::new();
    loop {
        let bytes = jpeg(next.fetch_add(1, Ordering::Relaxed));
        let head = format!("--next\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", bytes.len());
        stream.write_all(&[head.as_bytes(), &bytes, b"\r\n"].concat())?;
        clock.sleep(Duration::from_millis(50));
    }
}

fn send_one(stream: &mut TcpStream, next: &AtomicU64) -> std::io::Result<()> {
    stream.write_all(&jpeg(next.fetch_add(1, Ordering::Relaxed)))
}

fn config(id: &str, place: &str) -> String {
    format!("[[camera]]\nid = \"{id}\"\nvision = false\n[camera.source]\n{place}\n")
}

/// Scene time of the first recorded frame of a camera.
fn first_recorded(running: &Running, id: &str) -> Option<Timestamp> {
    let (id, earliest) = (CameraId::new(id).unwrap(), Timestamp::from_nanos(0));
    let first = running.runtime.block_on(running.archive.next_segment(&id, earliest)).unwrap();
    first.map(|segment| segment.first_at)
}

/// Has a daemon record cameras for some seconds; returns what was seen of each and is recorded.
fn record(folder: &Path, cameras: &[Live]) -> Vec<Expected> {
    let settings: Vec<_> =
        cameras.iter().map(|camera| config(camera.id, &format!("url = \"{}\"", camera.url))).collect();
    let mut running = start(folder, &settings.concat());
    let mut expected: Vec<_> = cameras
        .iter()
        .map(|camera| Expected {
            id: camera.id.to_owned(),
            codec: camera.recorded,
            size_px: camera.size_px,
            shown: Vec::new(),
            known: Known::Some { n_numbers: camera.n_numbers, largest_step: camera.largest_step() },
        })
        .collect();
    wait_for("frames of every camera", || {
        for camera in &mut expected {
            let Ok(newest) = running.handle.observation(&camera.id, At::Live) else { continue };
            let Some(first_at) = first_recorded_once(&running, camera) else { continue };
            let at = newest.frame.timestamp;
            if at >= first_at && camera.shown.last().is_none_or(|(_, before)| *before < at) {
                camera.shown.push((number_of(&newest.frame.image), at));
            }
        }
        let states: Vec<_> =
            running.handle.cameras().into_iter().map(|of| (of.id, of.state, of.reason)).collect();
        assert!(states.iter().all(|(_, state, _)| state != "failed"), "{states:?}");
        expected.iter().all(|camera| camera.shown.len() >= N_SEEN).then_some(())
    });
    running.stop();
    expected
}

/// Returns the same, asked for as long as nothing was seen yet.
fn first_recorded_once(running: &Running, camera: &Expected) -> Option<Timestamp> {
    camera.shown.first().map(|(_, at)| *at).or_else(|| first_recorded(running, &camera.id))
}

/// Has a daemon record cameras, and another, when they are gone, show and export it.
fn record_and_read(cameras: &[Live], end: impl FnOnce()) {
    let folder = tempfile::tempdir().unwrap();
    let expected = record(folder.path(), cameras);
    end();
    // Nobody answers there any more.
    let gone: Vec<_> =
        cameras.iter().map(|camera| config(camera.id, "url = \"rtsp://127.0.0.1:9/gone\"")).collect();
    let mut running = start(folder.path(), &gone.concat());
    let complaints = check::complaints(&running, &expected);
    running.stop();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn cameras_in_the_network_come_back_as_they_were() {
    const VP8_FILM: &str = "vp8enc deadline=1 keyframe-max-dist=9";
    const VP9_FILM: &str = "vp9enc deadline=1 cpu-used=8 keyframe-max-dist=9";
    const H264_PACKETS: &str = "h264parse ! rtph264pay config-interval=-1";
    let kinds = [
        Kind::new("rtsp-h264", (X264, H264_PACKETS), H264),
        Kind { size_px: EVEN_PX, ..Kind::new("rtsp-h264-even", (X264, H264_PACKETS), H264) },
        Kind::new("rtsp-h265", (X265, "h265parse ! rtph265pay config-interval=-1"), H265),
        Kind::new("rtsp-jpeg", ("jpegenc", "rtpjpegpay"), JPEG),
        Kind::new("rtsp-vp8", (VP8_FILM, "rtpvp8pay"), VP8),
        Kind::new("rtsp-vp9", (VP9_FILM, "rtpvp9pay"), VP9),
        Kind::new(RAW_ID, ("identity", "rtpvrawpay"), JPEG),
    ];
    say_skipped("MPEG-4 part 2 over RTSP: GStreamer's payloader (1.22) gives the frames of a group one time");
    if !can_be_found("rtpav1pay") || !can_be_found("rtpav1depay") {
        say_skipped("AV1 over RTSP: no rtpav1pay and rtpav1depay");
    }
    let folder = tempfile::tempdir().unwrap();
    let (servers, mut cameras): (Vec<_>, Vec<_>) =
        in_threads(&kinds, |kind| vec![kind.serve(folder.path())]).into_iter().unzip();
    const PARTS: &str = "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=next\r\n\r\n";
    const ONE: &str = "HTTP/1.0 200 OK\r\nContent-Type: image/jpeg\r\n\r\n";
    let http = |id, url| Live { id, url, size_px: EVEN_PX, recorded: JPEG, n_numbers: N_FRAMES };
    cameras.push(http("http-parts", serve_jpeg(PARTS, send_parts)));
    cameras.push(http("http-one", serve_jpeg(ONE, send_one)));
    record_and_read(&cameras, || drop(servers));
}

/// Runs in a process of its own, since the certificates that are trusted are read once.
#[test]
fn an_encrypted_camera_comes_back_as_it_was() {
    const CERTIFICATES: &str = "VIDEOFIELDS_TEST_CERTIFICATES";
    let Some(folder) = std::env::var_os(CERTIFICATES).map(std::path::PathBuf::from) else {
        let (files, _) = tls::Files::new();
        let name = "recording::kinds::live::an_encrypted_camera_comes_back_as_it_was";
        let mut alone = std::process::Command::new(std::env::current_exe().unwrap());
        alone.args(["--exact", name, "--nocapture"]);
        alone.env(CERTIFICATES, files.folder()).env("SSL_CERT_FILE", files.certificate());
        let alone = alone.output().unwrap();
        let said = String::from_utf8_lossy(&alone.stdout) + String::from_utf8_lossy(&alone.stderr);
        assert!(alone.status.success() && said.contains("1 passed"), "{said}");
        return;
    };
    let server = OddCamera::encrypted(
        &tls::server(&folder.join("site.pem"), &folder.join("site.key")),
        Oddities::default(),
    );
    let (url, size_px) = (server.url(), (320, 240));
    let camera = Live { id: "rtsps-h264", url, size_px, recorded: H264, n_numbers: ODD_PICTURES };
    record_and_read(&[camera], || drop(server));
}

#[test]
fn a_camera_at_this_machine_comes_back() {
    let devices = videofields_recording::ingest::devices();
    let Some(device) = devices.first() else {
        return say_skipped("no V4L2 device: none is recorded");
    };
    let folder = tempfile::tempdir().unwrap();
    let camera = config("device", &format!("device = \"{}\"", device.display()));
    let mut running = start(folder.path(), &camera);
    let recorded = || running.handle.cameras()[0].recording.as_ref().map_or(0, |recording| recording.frames);
    wait_for("recorded frames", || (recorded() > 30).then_some(()));
    let newest = running.handle.observation("device", At::Live).unwrap();
    running.stop();
    drop(running);
    let mut running = start(folder.path(), &camera);
    let again = running.handle.observation("device", At::Time(newest.frame.timestamp)).unwrap();
    assert_eq!(again.frame.timestamp, newest.frame.timestamp);
    running.stop();
}
