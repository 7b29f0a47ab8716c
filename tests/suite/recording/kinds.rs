//! Every kind of source, recorded, sought, played and exported: each frame shows its number, so the right one is told from others.

mod check;
mod live;
mod mpeg4;

use super::{Numbered, Running, START, start, wait_for};
use check::{Expected, Known, in_threads};
use std::path::{Path, PathBuf};
use videofields_testing::say_skipped;
use videofields_testing::video::luma_of;
use videofields_vision::clock::Timestamp;

/// Frames of a film: 7.2 s, of which the first 5 s and the rest are recorded in files of their own.
const N_FRAMES: u64 = 36;

/// Frames a second.
const SLOW_HZ: u32 = 5;

const SLOW_NANOS: i64 = 1_000_000_000 / SLOW_HZ as i64;

const USUAL_PX: (u32, u32) = (192, 96);

/// A size that no codec's blocks divide, with even sides where encoders want them.
const EVEN_PX: (u32, u32) = (162, 122);
const ODD_PX: (u32, u32) = (161, 121);

const H264: &str = "video/x-h264";
const H265: &str = "video/x-h265";
const VP8: &str = "video/x-vp8";
const VP9: &str = "video/x-vp9";
const AV1: &str = "video/x-av1";
const MPEG4: &str = "video/mpeg";
/// MPEG-4 part 2, as AVI files hold it.
const DIVX: &str = "video/x-divx";
const JPEG: &str = "image/jpeg";

const X264: &str = "x264enc key-int-max=9 bframes=0 ! h264parse";
const X264_B: &str = "x264enc key-int-max=9 bframes=2 b-adapt=false ! h264parse";
const X265: &str = "x265enc option-string=bframes=0:keyint=9:min-keyint=9:log-level=none ! h265parse";
const X265_B: &str =
    "x265enc option-string=bframes=2:b-adapt=0:open-gop=0:keyint=9:min-keyint=9:log-level=none ! h265parse";
const VPX: &str = "deadline=1 cpu-used=8 keyframe-max-dist=9";
const AOM: &str = "av1enc cpu-used=8 keyframe-max-dist=9 ! av1parse";

/// Form in which the pictures lie in their source beyond what their encoder makes of them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    AsWritten,
    /// The container says that they are to be turned a quarter to the right.
    Turned,
    /// A part of them is in a privacy zone.
    Masked,
}

/// A kind of file, and the media type in which it is recorded.
#[derive(Clone, Copy)]
struct Kind {
    id: &'static str,
    ending: &'static str,
    encoder: &'static str,
    muxer: &'static str,
    size_px: (u32, u32),
    recorded: &'static str,
    form: Form,
}

impl Kind {
    const fn new(
        (id, ending): (&'static str, &'static str),
        (encoder, muxer): (&'static str, &'static str),
        recorded: &'static str,
    ) -> Self {
        Self { id, ending, encoder, muxer, size_px: USUAL_PX, recorded, form: Form::AsWritten }
    }

    const fn sized(self, size_px: (u32, u32)) -> Self {
        Self { size_px, ..self }
    }

    const fn in_form(self, form: Form) -> Self {
        Self { form, ..self }
    }

    /// Writes the film; returns the camera's path to it.
    fn write(&self, folder: &Path) -> PathBuf {
        let path = folder.join(format!("{}.{}", self.id, self.ending));
        if self.muxer.is_empty() {
            return self.write_pictures(&path.with_extension(""));
        }
        let Self { encoder, muxer, .. } = *self;
        let encoder = encoder.replace("VPX", VPX);
        let film = Numbered { n_frames: N_FRAMES, rate_hz: SLOW_HZ, encoder: &encoder, muxer };
        match self.recorded {
            _ if self.ending == "y4m" => write_y4m(&path, self.size_px),
            MPEG4 if muxer != "avimux" => mpeg4::write(&film, &path, self.size_px),
            _ => film.write_sized(&path, self.size_px),
        }
        if self.form == Form::Turned {
            turn(&path);
        }
        path
    }

    /// Writes numbered pictures into a folder; returns their pattern.
    fn write_pictures(&self, folder: &Path) -> PathBuf {
        std::fs::create_dir(folder).unwrap();
        let (width, height) = self.size_px;
        for number in 0..N_FRAMES {
            let picture =
                image::RgbImage::from_fn(width, height, |x, _y| image::Rgb([luma_of(number, x, width); 3]));
            let path = folder.join(format!("in{number:04}.{}", self.ending));
            picture.save(&path).unwrap();
            if self.form == Form::Turned {
                let mut bytes = std::fs::read(&path).unwrap();
                // EXIF with one entry: orientation 6, a quarter to the right.
                let entry = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
                let length = (entry.len() as u16 + 2).to_be_bytes();
                bytes.splice(2..2, [&[0xff, 0xe1][..], &length, entry].concat());
                std::fs::write(&path, bytes).unwrap();
            }
        }
        folder.join(format!("in%04d.{}", self.ending))
    }

    fn expected(&self) -> Expected {
        let (width, height) = self.size_px;
        let size_px = if self.form == Form::Turned { (height, width) } else { (width, height) };
        let shown = (0..N_FRAMES).map(|number| (number, at(number))).collect();
        Expected { id: self.id.to_owned(), codec: self.recorded, size_px, shown, known: Known::All }
    }

    fn camera(&self, path: &Path) -> String {
        let zones = match self.form {
            Form::Masked => check::ZONE,
            _ => "",
        };
        format!(
            "[[camera]]\nid = \"{}\"\nvision = false\nprivacy_zones = [{zones}]\n[camera.source]\npath = \"{}\"\n\
             start = \"{START}\"\npace = \"all\"\nrate_hz = {SLOW_HZ}\n",
            self.id,
            path.display()
        )
    }
}

/// Scene time of a frame.
fn at(number: u64) -> Timestamp {
    START.saturating_add_nanos(number as i64 * SLOW_NANOS)
}

/// Writes the film as YUV4MPEG2, of which `GStreamer`'s writer (1.22) makes no readable file where sides are odd.
fn write_y4m(path: &Path, (width, height): (u32, u32)) {
    let mut bytes = format!("YUV4MPEG2 W{width} H{height} F{SLOW_HZ}:1 Ip A1:1 C420jpeg\n").into_bytes();
    let chroma = vec![128; (width.div_ceil(2) * height.div_ceil(2) * 2) as usize];
    for number in 0..N_FRAMES {
        bytes.extend_from_slice(b"FRAME\n");
        let row: Vec<_> = (0..width).map(|x| luma_of(number, x, width)).collect();
        bytes.extend(row.repeat(height as usize));
        bytes.extend_from_slice(&chroma);
    }
    std::fs::write(path, bytes).unwrap();
}

/// Makes the header of an MP4 or MOV file say that its pictures are to be turned a quarter to the right.
fn turn(path: &Path) {
    let mut bytes = std::fs::read(path).unwrap();
    // The matrix in the header of the track, 16.16 (ISO/IEC 14496-12, 8.3.2).
    let header = bytes.windows(4).position(|name| name == b"tkhd").unwrap();
    for (idx, value) in [0_i32, 1, 0, -1, 0].into_iter().enumerate() {
        let place = header + 44 + 4 * idx;
        bytes[place..place + 4].copy_from_slice(&(value << 16).to_be_bytes());
    }
    std::fs::write(path, bytes).unwrap();
}

/// Returns whether an element is installed.
fn can_be_found(name: &str) -> bool {
    gstreamer::init().unwrap();
    gstreamer::ElementFactory::find(name).is_some()
}

/// Returns whether what encodes and muxes a kind is installed; says so where it is not.
fn can_be_made(kind: &Kind) -> bool {
    let words = [kind.encoder, kind.muxer].map(|part| part.replace('!', " ! "));
    let names = words.iter().flat_map(|part| part.split(" ! "));
    let names = names.filter_map(|part| part.split_whitespace().next()).filter(|name| !name.contains('/'));
    let missing: Vec<_> = names.filter(|name| !can_be_found(name)).map(str::to_owned).collect();
    if !missing.is_empty() {
        say_skipped(&format!("{} is not recorded: no {}", kind.id, missing.join(", ")));
    }
    missing.is_empty()
}

/// Has a daemon record films of these kinds, and another, that has the recording alone, show and export it.
fn record_and_read(kinds: &[Kind]) {
    let kinds: Vec<_> = kinds.iter().filter(|kind| can_be_made(kind)).copied().collect();
    let folder = tempfile::tempdir().unwrap();
    let films = folder.path().join("films");
    std::fs::create_dir(&films).unwrap();
    let mut cameras = in_threads(&kinds, |kind| vec![kind.camera(&kind.write(&films))]);
    cameras.sort();
    let cameras = cameras.concat();
    let mut running = start(folder.path(), &cameras);
    let mut complaints = Vec::new();
    for kind in &kinds {
        complaints.extend(complaint_of_recording(&running, kind));
    }
    running.stop();
    // The folder is free for another once nothing of this one is left.
    drop(running);
    std::fs::remove_dir_all(&films).unwrap();

    let mut running = start(folder.path(), &cameras);
    let expected: Vec<_> = kinds.iter().map(Kind::expected).collect();
    complaints.extend(check::complaints(&running, &expected));
    running.stop();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// Waits until a film is recorded; returns what is wrong with that.
fn complaint_of_recording(running: &Running, kind: &Kind) -> Option<String> {
    let camera = || running.handle.cameras().into_iter().find(|of| of.id.as_str() == kind.id).unwrap();
    wait_for("the film's end", || ["ended", "failed"].contains(&camera().state.as_str()).then_some(()));
    // What the camera handed over is written a moment later.
    let id = camera().id;
    wait_for("all that was handed over", || (!running.archive.is_behind(&id)).then_some(()));
    let camera = camera();
    let recording = camera.recording.clone().unwrap();
    let is_whole =
        (camera.frames, camera.dropped, recording.frames, recording.dropped) == (N_FRAMES, 0, N_FRAMES, 0);
    let is_sound = camera.state == "ended" && camera.reason.is_none();
    (!is_whole || !is_sound).then(|| format!("{}: recorded as {camera:?}", kind.id))
}

#[test]
fn h264_and_h265_come_back_as_they_were() {
    record_and_read(&[
        Kind::new(("h264-mp4", "mp4"), (X264, "mp4mux"), H264),
        Kind::new(("h264-b-mp4", "mp4"), (X264_B, "mp4mux"), H264),
        Kind::new(("h264-b-mkv", "mkv"), (X264_B, "matroskamux"), H264).sized(EVEN_PX),
        Kind::new(("h264-b-ts", "ts"), (X264_B, "mpegtsmux"), H264),
        Kind::new(("h264-flv", "flv"), (X264, "flvmux"), H264),
        Kind::new(("h264-avi", "avi"), (X264, "avimux"), H264),
        Kind::new(("h264-b-avi", "avi"), (X264_B, "avimux"), H264),
        Kind::new(("h265-mp4", "mp4"), (X265, "mp4mux"), H265).sized(EVEN_PX),
        Kind::new(("h265-b-mp4", "mp4"), (X265_B, "mp4mux"), H265),
        Kind::new(("h265-b-mkv", "mkv"), (X265_B, "matroskamux"), H265),
        Kind::new(("h265-b-ts", "ts"), (X265_B, "mpegtsmux"), H265),
    ]);
}

#[test]
fn vp8_vp9_and_av1_come_back_as_they_were() {
    const VP8_HIDDEN: &str = "vp8enc VPX auto-alt-ref=true lag-in-frames=8 arnr-maxframes=5";
    const VP9_HIDDEN: &str = "vp9enc VPX auto-alt-ref=true lag-in-frames=8 arnr-maxframes=5";
    record_and_read(&[
        Kind::new(("vp8-webm", "webm"), ("vp8enc VPX", "webmmux"), VP8),
        Kind::new(("vp8-hidden", "mkv"), (VP8_HIDDEN, "matroskamux"), VP8),
        Kind::new(("vp8-odd", "mkv"), ("vp8enc VPX", "matroskamux"), VP8).sized(ODD_PX),
        Kind::new(("vp9-webm", "webm"), ("vp9enc VPX", "webmmux"), VP9),
        Kind::new(("vp9-hidden", "mkv"), (VP9_HIDDEN, "matroskamux"), VP9),
        Kind::new(("vp9-odd", "mkv"), ("vp9enc VPX", "matroskamux"), VP9).sized(ODD_PX),
        Kind::new(("vp9-mp4", "mp4"), ("vp9enc VPX ! vp9parse", "mp4mux"), VP9),
        Kind::new(("av1-mkv", "mkv"), (AOM, "matroskamux"), AV1),
        Kind::new(("av1-webm", "webm"), (AOM, "webmmux"), AV1),
        Kind::new(("av1-mp4", "mp4"), (AOM, "mp4mux"), AV1),
        Kind::new(("av1-odd", "mkv"), (AOM, "matroskamux"), AV1).sized(ODD_PX),
    ]);
}

#[test]
fn mpeg_4_jpeg_and_what_is_not_encoded_come_back_as_they_were() {
    const XVID: &str = "avenc_mpeg4 gop-size=9 bitrate=2000000";
    // One group: pictures that follow a key frame and are shown before it are lost where a file of the recording ends.
    const XVID_B: &str = "avenc_mpeg4 gop-size=60 bitrate=2000000 max-bframes=2";
    const MS: &str = "avenc_msmpeg4 gop-size=9 bitrate=2000000";
    const PNG: &str = "videoconvert ! pngenc";
    record_and_read(&[
        Kind::new(("mpeg4-avi", "avi"), (XVID, "avimux"), DIVX),
        Kind::new(("mpeg4-odd", "mkv"), (XVID, "matroskamux"), MPEG4).sized(ODD_PX),
        Kind::new(("mpeg4-b-mkv", "mkv"), (XVID_B, "matroskamux"), MPEG4),
        Kind::new(("msmpeg4-avi", "avi"), (MS, "avimux"), "video/x-msmpeg"),
        Kind::new(("jpeg-avi", "avi"), ("jpegenc", "avimux"), JPEG),
        Kind::new(("jpeg-odd", "mkv"), ("jpegenc", "matroskamux"), JPEG).sized(ODD_PX),
        Kind::new(("jpeg-mov", "mov"), ("jpegenc", "qtmux"), JPEG),
        Kind::new(("raw-y4m", "y4m"), ("identity", "identity"), JPEG),
        Kind::new(("raw-odd", "y4m"), ("identity", "identity"), JPEG).sized(ODD_PX),
        Kind::new(("raw-avi", "avi"), ("videoconvert ! video/x-raw,format=YUY2", "avimux"), JPEG),
        Kind::new(("raw-mkv", "mkv"), ("identity", "matroskamux"), JPEG),
        Kind::new(("png-mov", "mov"), (PNG, "qtmux"), JPEG).sized(ODD_PX),
        Kind::new(("pictures-png", "png"), ("", ""), JPEG).sized(ODD_PX),
        Kind::new(("pictures-jpeg", "jpg"), ("", ""), JPEG).sized(ODD_PX),
    ]);
}

/// Such are recorded as JPEG, whatever they come in: a recording does not hold that pictures are turned, and of masked ones
/// nobody may see what a camera sent.
#[test]
fn pictures_that_are_turned_or_masked_come_back_so() {
    record_and_read(&[
        Kind::new(("turned-h264", "mp4"), (X264_B, "mp4mux"), JPEG).in_form(Form::Turned),
        Kind::new(("turned-h265", "mp4"), (X265_B, "mp4mux"), JPEG).in_form(Form::Turned),
        Kind::new(("turned-jpeg", "mov"), ("jpegenc", "qtmux"), JPEG).in_form(Form::Turned).sized(EVEN_PX),
        Kind::new(("turned-av1", "mp4"), (AOM, "mp4mux"), JPEG).in_form(Form::Turned),
        Kind::new(("turned-pictures", "jpg"), ("", ""), JPEG).in_form(Form::Turned),
        Kind::new(("masked-h264", "mp4"), (X264_B, "mp4mux"), JPEG).in_form(Form::Masked).sized(EVEN_PX),
        Kind::new(("masked-h265", "mkv"), (X265_B, "matroskamux"), JPEG).in_form(Form::Masked),
        Kind::new(("masked-vp8", "webm"), ("vp8enc VPX", "webmmux"), JPEG).in_form(Form::Masked),
        Kind::new(("masked-av1", "mkv"), (AOM, "matroskamux"), JPEG).in_form(Form::Masked),
        Kind::new(("masked-jpeg", "avi"), ("jpegenc", "avimux"), JPEG).in_form(Form::Masked),
        Kind::new(("masked-raw", "y4m"), ("identity", "identity"), JPEG).in_form(Form::Masked).sized(ODD_PX),
        Kind::new(("masked-pictures", "png"), ("", ""), JPEG).in_form(Form::Masked),
    ]);
}

/// Checks that streams that are not read are not recorded either, and that the camera says why.
#[test]
fn what_is_not_read_says_so() {
    const REFUSED: [(&str, &str, &str, &str, &str); 4] = [
        ("theora", "mkv", "theoraenc", "matroskamux", "x-theora"),
        ("huffyuv", "avi", "videoconvert ! avenc_huffyuv", "avimux", "x-huffyuv"),
        ("ffv1", "mkv", "videoconvert ! avenc_ffv1", "matroskamux", "x-ffv"),
        ("flash", "flv", "avenc_flv", "flvmux", "x-flash-video"),
    ];
    let kinds = REFUSED
        .map(|(id, ending, encoder, muxer, named)| (Kind::new((id, ending), (encoder, muxer), ""), named));
    let kinds: Vec<_> = kinds.into_iter().filter(|(kind, _)| can_be_made(kind)).collect();
    let folder = tempfile::tempdir().unwrap();
    let cameras: Vec<_> = kinds.iter().map(|(kind, _)| kind.camera(&kind.write(folder.path()))).collect();
    let mut running = start(folder.path(), &cameras.concat());
    for (kind, named) in &kinds {
        let camera = || running.handle.cameras().into_iter().find(|of| of.id.as_str() == kind.id).unwrap();
        let camera = wait_for("a failure", || Some(camera()).filter(|camera| camera.state == "failed"));
        let reason = camera.reason.clone().unwrap();
        assert!(reason.contains(named) && reason.contains("H.264"), "{}: {reason}", kind.id);
        assert_eq!(camera.recording.map_or(0, |recording| recording.frames), 0, "{}", kind.id);
        running.handle.observation(kind.id, super::At::Time(START)).unwrap_err();
    }
    running.stop();
}
