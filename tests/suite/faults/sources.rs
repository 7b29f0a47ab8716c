//! What cameras' files, addresses and scenes' pictures may name and hold: files that are none, links that are swapped
//! meanwhile, addresses within, and pictures that claim to be huge.

use super::client::{Ask, ask, configure, demo_camera, end, say, status_kib};
use crate::daemon::process::Daemon;
use serde_json::{Value, json};
use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempDir;
use videofields_recording::ingest::{self, MediaRoots};
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{CameraUrl, Network, SourceSettings};

/// A picture in one shade.
fn shade(path: &Path, code: u8) {
    image::GrayImage::from_pixel(8, 8, image::Luma([code])).save(path).unwrap();
}

/// What opening a source ends in, frames included.
fn refusal(source: &SourceSettings, roots: &MediaRoots) -> String {
    let opened = ingest::open(source, roots).and_then(|mut source| source.next_frame().map(|_| ()));
    opened.expect_err("a refusal").to_string()
}

#[test]
fn what_is_no_file_of_the_media_roots_is_refused_and_never_waited_for() {
    let folder = TempDir::new().unwrap();
    let root = folder.path().join("media");
    std::fs::create_dir(&root).unwrap();
    std::fs::write(folder.path().join("secret.png"), "s3cret").unwrap();
    symlink(folder.path().join("secret.png"), root.join("link0.png")).unwrap();
    symlink(folder.path(), root.join("up")).unwrap();
    symlink("/proc/self", root.join("self")).unwrap();
    symlink("/dev/zero", root.join("zero0.png")).unwrap();
    for pipe in ["pipe.avi", "pipe0.png"] {
        assert!(Command::new("mkfifo").arg(root.join(pipe)).status().unwrap().success());
    }
    let _socket = std::os::unix::net::UnixListener::bind(root.join("socket.avi")).unwrap();
    let roots = MediaRoots::new(std::slice::from_ref(&root)).unwrap();
    let clock = SystemClock::new();
    for path in [
        "../secret.png",
        "up/secret.png",
        "link%d.png",
        "link0.png",
        "self/environ",
        "/proc/self/environ",
        "/dev/zero",
        "/dev/stdin",
        "zero%d.png",
        "pipe.avi",
        "pipe%d.png",
        "socket.avi",
        ".",
        "a\0b.avi",
        "file:///etc/passwd",
        "concat:/etc/passwd|/etc/hostname",
        "exec:id",
        "http://169.254.169.254/latest/meta-data",
    ] {
        let said = refusal(&SourceSettings::of_path(root.join(path)), &roots);
        assert!(!said.contains("s3cret"), "{path}: {said}");
        let said = refusal(&SourceSettings::of_path(path), &roots);
        assert!(
            said.contains("media roots") || said.contains("URL") || said.contains("`..`"),
            "{path}: {said}"
        );
    }
    assert!(clock.monotonic() < Duration::from_secs(5), "a pipe without another end is not waited for");
}

#[test]
fn a_link_that_is_swapped_while_it_is_opened_never_opens_what_lies_outside() {
    const TURNS: u32 = 4000;
    let folder = TempDir::new().unwrap();
    let root = folder.path().join("media");
    std::fs::create_dir(&root).unwrap();
    shade(&root.join("dark.png"), 0);
    shade(&folder.path().join("white.png"), 255);
    let link = root.join("in0.png");
    symlink("dark.png", &link).unwrap();
    let roots = MediaRoots::new(std::slice::from_ref(&root)).unwrap();
    let source = SourceSettings::of_path(root.join("in%d.png"));
    let is_over = AtomicBool::new(false);
    let (n_opened, n_refused) = std::thread::scope(|scope| {
        scope.spawn(|| {
            let (inside, outside) = (root.join("dark"), root.join("white"));
            for to in ["dark.png", "../white.png"].iter().cycle() {
                let made = if to.starts_with("..") { &outside } else { &inside };
                symlink(to, made).unwrap();
                std::fs::rename(made, &link).unwrap();
                if is_over.load(Ordering::Relaxed) {
                    return;
                }
            }
        });
        let mut counts = (0, 0);
        for _ in 0..TURNS {
            match ingest::open(&source, &roots).and_then(|mut source| source.next_frame()) {
                Ok(Some(frame)) => {
                    let luma = frame.image.plane(0).row(0)[0];
                    assert!(luma < 128, "what lies outside of the roots was shown");
                    counts.0 += 1;
                }
                Ok(None) => panic!("a picture without an end"),
                Err(_) => counts.1 += 1,
            }
        }
        is_over.store(true, Ordering::Relaxed);
        counts
    });
    assert!(n_opened > 100 && n_refused > 100, "{n_opened} opened, {n_refused} refused");
}

#[test]
fn urls_that_lead_within_are_refused_before_anything_is_connected_to() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let port = listener.local_addr().unwrap().port();
    let far: Vec<Network> = vec!["10.99.0.0/16".parse().unwrap()];
    let elsewhere = MediaRoots::new(&[]).unwrap().with_networks(&far);
    let is_refused = |url: &str, roots: &MediaRoots| {
        let source = SourceSettings { url: Some(CameraUrl::new(url)), ..SourceSettings::default() };
        let said =
            ingest::open(&source, roots).err().unwrap_or_else(|| panic!("{url} was opened")).to_string();
        assert!(!said.contains("s3cret"), "{url}: {said}");
    };
    for host in [
        "127.0.0.1",
        "127.1",
        "2130706433",
        "0x7f.0.0.1",
        "0177.0.0.1",
        "[::1]",
        "[::ffff:127.0.0.1]",
        "[::ffff:7f00:1]",
        "[0:0:0:0:0:ffff:127.0.0.1]",
        "localhost",
        "0.0.0.0",
        "[::]",
    ] {
        for scheme in ["http", "rtsp", "https", "rtsps"] {
            is_refused(&format!("{scheme}://{host}:{port}/s3cret"), &elsewhere);
        }
    }
    let usual = MediaRoots::new(&[]).unwrap();
    for url in [
        "http://169.254.169.254/latest/meta-data/s3cret",
        "http://2852039166/s3cret",
        "http://[::ffff:a9fe:a9fe]/s3cret",
        "rtsp://[fd00:ec2::254]/s3cret",
        "file:///etc/passwd",
        "concat:http://127.0.0.1/|s3cret",
        "exec:s3cret",
        "pipe:0",
        "fd://0",
        "gopher://127.0.0.1/s3cret",
        "ftp://127.0.0.1/s3cret",
        "http://admin:s3cret@127.0.0.1/",
        "http://127.0.0.1\r\nHost: s3cret/",
        "//127.0.0.1/s3cret",
    ] {
        is_refused(url, &usual);
    }
    let connected = listener.accept().map(|_| ());
    assert_eq!(connected.expect_err("nobody came").kind(), ErrorKind::WouldBlock);
}

/// The checksum of PNG's chunks: CRC-32 as in its specification, annex D.
fn crc(bytes: &[u8]) -> u32 {
    let step = |crc: u32, byte: &u8| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    };
    !bytes.iter().fold(u32::MAX, step)
}

/// A sound PNG but that its header claims `side` pixels each way.
fn huge_png(side: u32) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(8, 8).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    let mut bytes = bytes.into_inner();
    for at in [16, 20] {
        bytes[at..at + 4].copy_from_slice(&side.to_be_bytes());
    }
    let sum = crc(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    bytes
}

/// A sound JPEG but that its frame header claims `side` pixels each way.
fn huge_jpeg(side: u16) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(16, 16).write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    let mut bytes = bytes.into_inner();
    let frame = bytes.windows(2).position(|pair| pair == [0xff, 0xc0]).unwrap();
    for at in [frame + 5, frame + 7] {
        bytes[at..at + 2].copy_from_slice(&side.to_be_bytes());
    }
    bytes
}

/// Bits of an H.264 parameter set, the first in the highest place.
#[derive(Default)]
struct Bits(Vec<bool>);

impl Bits {
    fn put(&mut self, n_bits: u32, value: u32) {
        self.0.extend((0..n_bits).rev().map(|bit| value >> bit & 1 == 1));
    }

    /// A number as ITU-T H.264, 9.1, writes it.
    fn golomb(&mut self, value: u32) {
        let length = (value + 1).ilog2();
        self.put(length, 0);
        self.put(length + 1, value + 1);
    }

    /// As bytes behind a start code, closed by a one and zeros; without emulation prevention, which these need not.
    fn unit(mut self, kind: u8) -> Vec<u8> {
        self.0.push(true);
        let byte =
            |bits: &[bool]| (0..8).fold(0, |byte, at| byte << 1 | u8::from(bits.get(at) == Some(&true)));
        [0, 0, 0, 1, kind].into_iter().chain(self.0.chunks(8).map(byte)).collect()
    }
}

/// An H.264 stream whose sequence parameter set claims `side` pixels each way, and a picture's beginning.
fn huge_h264(side: u32) -> Vec<u8> {
    let mut sequence = Bits::default();
    // Baseline, no constraints, level 6.2.
    sequence.put(24, 0x42_00_3e);
    // Ids and counts: set 0, 16 frame numbers, picture order 2, one reference, no gaps.
    for value in [0, 0, 2, 1] {
        sequence.golomb(value);
    }
    sequence.put(1, 0);
    sequence.golomb(side / 16 - 1);
    sequence.golomb(side / 16 - 1);
    // Frames alone, direct inference, no cropping, no further information.
    sequence.put(4, 0b1100);
    let mut picture = Bits::default();
    for value in [0, 0] {
        picture.golomb(value);
    }
    picture.put(2, 0);
    // One slice group, one reference each way, no weights, quantisation as usual.
    for value in [0, 0, 0] {
        picture.golomb(value);
    }
    picture.put(3, 0);
    for value in [0, 0, 0] {
        picture.golomb(value);
    }
    picture.put(3, 0);
    let mut slice = Bits::default();
    // From the first block on, of one kind, of set 0; frame 0, picture 0; a little that decodes to something.
    for value in [0, 7, 0] {
        slice.golomb(value);
    }
    slice.put(4, 0);
    slice.golomb(0);
    slice.put(32, 0x8123_456f);
    let mut bytes = sequence.unit(0x67);
    bytes.extend(picture.unit(0x68));
    for _ in 0..30 {
        bytes.extend_from_slice(&[0, 0, 0, 1, 0x65]);
        bytes.extend(
            slice.0.chunks(8).map(|bits| bits.iter().fold(0, |byte, bit| byte << 1 | u8::from(*bit))),
        );
        bytes.extend([0x5a; 200]);
    }
    bytes
}

/// A camera that sends one picture again and again as motion JPEG, to whoever comes, until the test is over.
fn sends(picture: Vec<u8>) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let serve = move || {
        for stream in listener.incoming() {
            let Ok(mut stream) = stream else { return };
            let picture = picture.clone();
            std::thread::Builder::new()
                .spawn(move || {
                    let mut head = [0; 1024];
                    if stream.read(&mut head).is_err() {
                        return;
                    }
                    let begin =
                        "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n";
                    let part = format!(
                        "--b\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n",
                        picture.len()
                    );
                    let clock = SystemClock::new();
                    let mut is_there = stream.write_all(begin.as_bytes()).is_ok();
                    while is_there {
                        let whole = [part.as_bytes(), &picture, b"\r\n"].concat();
                        is_there = stream.write_all(&whole).is_ok();
                        clock.sleep(Duration::from_millis(50));
                    }
                })
                .unwrap();
        }
    };
    std::thread::Builder::new().spawn(serve).unwrap();
    port
}

/// Most that the daemon may need beside a camera that works, KiB.
const ROOM_KIB: u64 = 400 << 10;

#[test]
fn pictures_and_streams_that_claim_to_be_huge_are_refused_in_a_bounded_memory() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, bytes: &[u8]| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    write("p0.png", &huge_png(65_500));
    write("j0.jpg", &huge_jpeg(65_500));
    let stream = write("s.h264", &huge_h264(16_384));
    let small = write("small.h264", &huge_h264(1024));
    let port = sends(huge_jpeg(65_500));
    let path = |name: &str| folder.path().join(name);
    let cameras = [
        ("png", format!("path = {:?}", path("p%d.png"))),
        ("jpg", format!("path = {:?}", path("j%d.jpg"))),
        ("still", format!("path = {:?}", path("j0.jpg"))),
        ("h264", format!("path = {stream:?}")),
        ("mjpeg", format!("url = \"http://127.0.0.1:{port}/\"")),
    ];
    let clips = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("config/demo/clips");
    let mut text = format!("[media]\nroots = [{:?}, {clips:?}]\n", folder.path());
    text += &demo_camera("sound");
    let sound = configure(folder.path(), &path("sound.sqlite"), &text);
    let daemon = Daemon::start(&sound);
    daemon.wait_until_live(&["sound"]);
    let usual_kib = status_kib(&daemon, "VmHWM");
    end(daemon);
    for (id, source) in &cameras {
        text += &format!("[[camera]]\nid = \"{id}\"\nsource = {{ {source} }}\n");
    }
    // The same stream of a size that is allowed gives pictures: it is refused for nothing but its size.
    text += &format!("[[camera]]\nid = \"small\"\nsource = {{ path = {small:?} }}\n");
    let config = configure(folder.path(), &path("kept.sqlite"), &text);
    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&["sound"]);
    let small = wait_for("a small picture", || {
        Some(daemon.json("/api/v1/cameras/small")).filter(|camera| camera["size_px"].is_array())
    });
    assert_eq!(small["size_px"], json!([1024, 1024]), "{small}");
    for (id, _) in cameras {
        let camera = wait_for(id, || {
            let camera = daemon.json(&format!("/api/v1/cameras/{id}"));
            let is_refused = camera["reason"].as_str().is_some_and(|reason| !reason.is_empty());
            (is_refused && camera["state"] != "connecting").then_some(camera)
        });
        assert_eq!(camera["size_px"], Value::Null, "{camera}");
        say(&format!("{id}: {} ({})", camera["state"], camera["reason"]));
    }
    // Scenes name pictures too, and models.
    let scene = |document: &Value| {
        let request =
            Ask { fields: &[("if-none-match", "*")], body: &document.to_string(), ..Ask::default() };
        let answer = ask(daemon.address, "PUT", "/api/v1/scenes/bomb", &request).unwrap();
        assert_eq!(answer.status, 400, "{}", answer.text());
        answer.json()["detail"].as_str().unwrap().to_owned()
    };
    for file in ["p0.png", "j0.jpg"] {
        let texture = json!({"file": file, "size_m": [1, 1]});
        let solid = json!({"id": "a", "center_m": [0, 0, 1], "size_m": [2, 2, 2], "texture": texture});
        let said = scene(&json!({"version": 1, "boxes": [solid]}));
        assert!(said.contains("1 to 8192 pixels each way are allowed, got 65500 x 65500"), "{said}");
    }
    let accessor = |kind: &str, code: u32| json!({"bufferView": 0, "componentType": code, "count": 1_u64 << 31, "type": kind});
    let model = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [accessor("VEC3", 5126), accessor("SCALAR", 5125)],
        "bufferViews": [{"buffer": 0, "byteLength": 1_u64 << 33}],
        "buffers": [{"uri": "claims.bin", "byteLength": 1_u64 << 33}],
    });
    write("claims.gltf", model.to_string().as_bytes());
    write("claims.bin", &[0; 64]);
    let said = scene(&json!({"version": 1, "models": [{"id": "m", "file": "claims.gltf"}]}));
    assert!(said.contains("claims.gltf"), "{said}");

    let most_kib = status_kib(&daemon, "VmHWM");
    assert!(most_kib < usual_kib + ROOM_KIB, "{most_kib} KiB, {usual_kib} with a camera that works");
    assert_eq!(daemon.json("/api/v1/cameras/sound")["state"], "live");
    say(&format!("{} MiB at most, {} MiB with a camera that works", most_kib >> 10, usual_kib >> 10));
    assert_eq!(end(daemon).status, Some(0));
}
