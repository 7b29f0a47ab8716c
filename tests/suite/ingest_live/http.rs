//! Cameras that send motion JPEG over HTTP.

use super::*;

/// A grey picture as JPEG.
fn jpeg(level: u8) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture =
        image::RgbImage::from_fn(160, 120, |x, y| image::Rgb([level, (x % 64) as u8, (y * 2) as u8]));
    picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

/// One part of an endless answer.
fn part(jpeg: &[u8]) -> Vec<u8> {
    let mut bytes =
        format!("--next\r\nContent-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", jpeg.len()).into_bytes();
    bytes.extend_from_slice(jpeg);
    bytes.extend_from_slice(b"\r\n");
    bytes
}

/// A camera whose connections send what `send` writes after the answer's head; the heads of the requests are kept.
fn camera(
    send: impl Fn(&mut TcpStream) -> std::io::Result<()> + Send + Sync + 'static,
) -> (u16, Arc<Mutex<Vec<String>>>) {
    const HEAD: &str = "HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=next\r\n\r\n";
    camera_with_head(HEAD, send)
}

/// The same with another head of its answers.
fn camera_with_head(
    head: &'static str,
    send: impl Fn(&mut TcpStream) -> std::io::Result<()> + Send + Sync + 'static,
) -> (u16, Arc<Mutex<Vec<String>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    let heads: Arc<Mutex<Vec<String>>> = Arc::default();
    let (kept, send) = (Arc::clone(&heads), Arc::new(send));
    let serve = move || {
        for stream in listener.incoming() {
            let (mut stream, kept, send) = (stream.unwrap(), Arc::clone(&kept), Arc::clone(&send));
            let answer = move || {
                let mut bytes = [0; 4096];
                let n = stream.read(&mut bytes).unwrap_or(0);
                kept.lock().unwrap().push(String::from_utf8_lossy(&bytes[..n]).into_owned());
                // Whoever hangs up has seen enough.
                if stream.write_all(head.as_bytes()).is_ok() {
                    send(&mut stream).unwrap_or_default();
                }
            };
            std::thread::Builder::new().name("connection".to_owned()).spawn(answer).unwrap();
        }
    };
    std::thread::Builder::new().name("camera".to_owned()).spawn(serve).unwrap();
    (port, heads)
}

fn pause(ms: u64) {
    SystemClock::new().sleep(Duration::from_millis(ms));
}

#[test]
fn motion_jpeg_is_looked_at_once() {
    let (port, _) = camera(|stream| {
        for n in 0..50 {
            stream.write_all(&part(&jpeg(n as u8)))?;
            pause(40);
        }
        Ok(())
    });
    let seen = look(&format!("http://127.0.0.1:{port}/")).unwrap();
    assert_eq!((seen.image.width(), seen.image.height(), seen.codec.as_deref()), (160, 120, Some("jpeg")));
    assert!(seen.rate_hz.is_some_and(|rate| rate > 5.0), "{seen:?}");
}

#[test]
fn a_camera_that_sends_other_pictures_is_told_of_before_it_counts_as_silent() {
    let (port, _) = camera(|stream| {
        for _ in 0..500 {
            stream.write_all(b"--next\r\nContent-Type: image/svg+xml\r\n\r\n<svg width=\"32000\"/>\r\n")?;
            pause(100);
        }
        Ok(())
    });
    let error = look(&format!("http://127.0.0.1:{port}/")).unwrap_err().to_string();
    assert!(error.contains("multipart/x-mixed-replace") && error.contains("no JPEG picture"), "{error}");
}

#[test]
fn a_first_picture_that_does_not_end_is_told_of_before_the_camera_counts_as_silent() {
    const HEAD: &str = "HTTP/1.1 200 OK\r\nContent-Type: image/jpeg\r\nContent-Length: 8589934592\r\n\r\n";
    let (port, _) = camera_with_head(HEAD, |stream| {
        let whole = jpeg(9);
        stream.write_all(&whole[..whole.len() / 2])?;
        pause(60_000);
        Ok(())
    });
    let error = look(&format!("http://127.0.0.1:{port}/")).unwrap_err().to_string();
    assert!(error.contains("the first picture that it sends does not end"), "{error}");
}

#[test]
fn pictures_come_and_the_camera_hears_its_own_name() {
    let (port, heads) = camera(|stream| {
        for n in 0..500 {
            stream.write_all(&part(&jpeg(n as u8)))?;
            pause(40);
        }
        Ok(())
    });
    let camera = Camera::connect(settings(&format!("http://localhost:{port}/video.mjpg?a=b")));
    let status = camera.wait_frames(10);
    assert_eq!((status.size, status.retries), (Some((160, 120)), 0));
    let frames = camera.frames();
    assert_grows(&frames);
    let head = heads.lock().unwrap()[0].clone();
    assert!(head.starts_with("GET /video.mjpg?a=b HTTP/1.1"), "{head}");
    let hosts: Vec<_> = head.lines().filter(|line| line.to_lowercase().starts_with("host:")).collect();
    assert_eq!(hosts, [format!("Host: localhost:{port}")]);
}

#[test]
fn pictures_cut_short_are_left_out_and_the_camera_stays() {
    let (port, _heads) = camera(|stream| {
        let whole = jpeg(90);
        for n in 0..500 {
            let cut = match n % 5 {
                1 => &whole[..whole.len() / 2],
                2 => &whole[..30],
                3 => b"no picture at all",
                _ => &whole[..],
            };
            stream.write_all(&part(cut))?;
            pause(30);
        }
        Ok(())
    });
    let camera = Camera::connect(settings(&format!("http://127.0.0.1:{port}/")));
    let status = camera.wait_frames(30);
    assert!(status.retries == 0 && status.dropped > 10, "{status:?}");
    let lost = camera.kept.0.lock().unwrap().lost.clone();
    let n_damaged: u64 =
        lost.iter().filter(|(reason, _)| *reason == DropReason::Damaged).map(|(_, n)| n).sum();
    assert!(n_damaged > 10, "{lost:?}");
    assert_eq!(status.size, Some((160, 120)));
    assert_grows(&camera.frames());
}

#[test]
fn silence_is_a_stall_and_then_a_failure() {
    let (port, _heads) = camera(|stream| {
        for _ in 0..10 {
            stream.write_all(&part(&jpeg(70)))?;
            pause(40);
        }
        pause(1_500);
        for _ in 0..25 {
            stream.write_all(&part(&jpeg(80)))?;
            pause(40);
        }
        pause(20_000);
        Ok(())
    });
    let stalls = SourceSettings { stall_secs: 0.5, ..settings(&format!("http://127.0.0.1:{port}/")) };
    let camera = Camera::connect(stalls);
    camera.wait_frames(5);
    let is_stalled = |status: &CameraStatus| status.state == CameraState::Stalled;
    let stalled = camera.wait("the camera stalls", is_stalled);
    assert!(stalled.reason.as_ref().unwrap().contains("sent no frame for 0.5 s"), "{stalled:?}");
    let back = camera.wait_frames(1);
    assert_eq!((back.retries, back.reason), (0, None), "the same connection");
    assert!(back.since > stalled.since);
    camera.wait("it stalls again", is_stalled);
    let failed = camera.wait("it is given up", |status| status.state == CameraState::Failed);
    assert!(failed.next_try.is_some(), "{failed:?}");
    camera.wait_frames(5);
}

#[test]
fn who_wants_a_password_is_told_apart() {
    let port = answering(|head| {
        let is_known = head.contains("Authorization: Basic dmlld2VyOnMzY3JldA==");
        let status = if is_known { "404 Not Found" } else { "401 Unauthorized" };
        format!("HTTP/1.1 {status}\r\nWWW-Authenticate: Basic realm=\"camera\"\r\nContent-Length: 0\r\n\r\n")
    });
    let url = format!("http://127.0.0.1:{port}/");
    Camera::connect(settings(&url)).wait_failed("refuses the user or the password");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("password");
    std::fs::write(&path, "s3cret").unwrap();
    let (user, password_file) = (Some("viewer".to_owned()), Some(path));
    let known = Camera::connect(SourceSettings { user, password_file, ..settings(&url) });
    let status = known.wait_failed("has no such stream");
    assert!(!format!("{status:?}").contains("s3cret"), "{status:?}");
}

#[test]
fn multipart_that_is_written_loosely_is_read() {
    // Cameras write every kind of text before each picture.
    for (before, after) in [
        ("Content-Type: image/jpeg\r\n\r\n", "\r\n--next\r\n"),
        ("--next\r\nContent-Type: image/jpg\r\nContent-Length: 17\r\n\r\n", ""),
        ("--next\n\n", "\n"),
        ("", ""),
    ] {
        let (port, _heads) = camera(move |stream| {
            for n in 0..500 {
                stream.write_all(&[before.as_bytes(), &jpeg(n as u8), after.as_bytes()].concat())?;
                pause(40);
            }
            Ok(())
        });
        let camera = Camera::connect(settings(&format!("http://127.0.0.1:{port}/")));
        let status = camera.wait_frames(10);
        assert_eq!((status.size, status.retries), (Some((160, 120)), 0), "{before:?}");
        let n_damaged: u64 = camera
            .kept
            .0
            .lock()
            .unwrap()
            .lost
            .iter()
            .filter(|(reason, _)| *reason == DropReason::Damaged)
            .map(|(_, n)| n)
            .sum();
        assert_eq!(n_damaged, 0, "{before:?}");
    }
}

#[test]
fn a_camera_that_answers_a_picture_at_a_time_is_asked_again_and_again() {
    let answers: Arc<Mutex<Vec<Duration>>> = Arc::default();
    let (told, clock) = (Arc::clone(&answers), SystemClock::new());
    let (port, heads) =
        camera_with_head("HTTP/1.0 200 OK\r\nContent-Type: image/jpeg\r\n\r\n", move |stream| {
            let mut told = told.lock().unwrap();
            told.push(clock.monotonic());
            stream.write_all(&jpeg(told.len() as u8))
        });
    let camera = Camera::connect(settings(&format!("http://127.0.0.1:{port}/snap.jpg")));
    let status = camera.wait_frames(6);
    assert_eq!((status.size, status.retries), (Some((160, 120)), 0));
    assert!(heads.lock().unwrap().iter().all(|head| head.starts_with("GET /snap.jpg HTTP/1.1")));
    let frames = camera.frames();
    assert_grows(&frames);
    let answers = answers.lock().unwrap();
    let secs = (answers[5] - answers[0]).as_secs_f64();
    assert!(secs > 0.8, "five a second at most: five in {secs} s");
}

#[test]
fn what_is_no_picture_is_named() {
    let (port, _heads) = camera_with_head("HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n", |stream| {
        stream.write_all(b"<html>Log in</html>")
    });
    Camera::connect(settings(&format!("http://127.0.0.1:{port}/")))
        .wait_failed("it sends text/html, and no JPEG");
}

#[test]
fn motion_jpeg_is_recorded_as_it_comes() {
    let (port, _heads) = camera(|stream| {
        for n in 0..500 {
            stream.write_all(&part(&jpeg(n as u8)))?;
            pause(40);
        }
        Ok(())
    });
    let (settings, stop) = (settings(&format!("http://127.0.0.1:{port}/")), ingest::StopFlag::default());
    let mut source = ingest::open_tapped(&settings, &roots(), &stop, ingest::Tap::Open).unwrap();
    let mut bytes = Vec::new();
    let mut muxer: Option<Muxer> = None;
    let mut first_nanos = 0;
    let n_frames = wait_for("recorded frames", || {
        source.poll().unwrap();
        while let Some(frame) = source.take_encoded() {
            assert_eq!((frame.format.codec(), frame.format.size_px()), ("image/jpeg", Some((160, 120))));
            let nanos = frame.stream_nanos.unwrap();
            let muxer = muxer.get_or_insert_with(|| {
                first_nanos = nanos;
                Muxer::start(&frame.format).unwrap()
            });
            muxer.push(&frame, u64::try_from(nanos - first_nanos).unwrap(), &mut bytes).unwrap();
        }
        let n_frames = bytes.windows(3).filter(|bytes| *bytes == [0xff, 0xd8, 0xff]).count();
        (n_frames >= 10).then_some(n_frames)
    });
    let mut decoder = Decoder::start(Input::stream(std::io::Cursor::new(bytes)), None).unwrap();
    let n_pictures = std::iter::from_fn(|| decoder.pull(Duration::from_secs(5))).count();
    assert_eq!(n_pictures, n_frames);
}
