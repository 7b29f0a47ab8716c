//! The cameras: files and devices that can be read, passwords, and the parts of `GStreamer` that they need.

use super::line::Line;
use rustix::fs::{Access, access};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;
use videofields_recording::media::{Codec, decoded_codecs, look_at_sandbox, missing_elements};
use videofields_vision::config::{CameraSettings, Config, Place};

/// What every camera is decoded with.
const ALWAYS: [&str; 6] = ["decodebin", "videoconvert", "videoscale", "videoflip", "appsink", "capsfilter"];

/// What recordings are made and read with.
const RECORDED: [&str; 7] =
    ["parsebin", "h264parse", "h265parse", "matroskamux", "matroskademux", "mp4mux", "h264timestamper"];

pub(super) fn look_at_codecs(config: &Config) -> Vec<Line> {
    let settings = config.settings();
    let mut names = ALWAYS.to_vec();
    for camera in &settings.camera {
        names.extend(match camera.source.place() {
            Some(Place::Url(url))
                if url.parse().is_ok_and(|parts| parts.scheme.as_str().starts_with("rtsp")) =>
            {
                vec!["appsrc", "rtpjitterbuffer", "rtph264depay", "rtph265depay", "rtpjpegdepay"]
            }
            Some(Place::Url(_)) => vec!["appsrc", "jpegdec"],
            Some(Place::Device(_)) => vec!["v4l2src"],
            Some(Place::Path(_)) => vec!["filesrc"],
            None => Vec::new(),
        });
    }
    if settings.archive.is_on() {
        names.extend(RECORDED);
    }
    names.sort_unstable();
    names.dedup();
    let install = "install gstreamer1.0-plugins-base, -good, -bad and gstreamer1.0-libav";
    let missing = match missing_elements(&names) {
        Ok(missing) if missing.is_empty() => {
            Line::ok("codecs", format!("GStreamer has the {} parts that are needed", names.len()))
        }
        Ok(missing) => {
            let why = "cameras and recordings that need them fail";
            Line::problem("codecs", format!("GStreamer lacks {}", missing.join(", ")), why).do_this(install)
        }
        Err(error) => {
            return vec![
                Line::problem("codecs", "GStreamer cannot be used".to_owned(), error.to_string())
                    .do_this(install),
            ];
        }
    };
    let decoded = decoded_codecs().unwrap_or_default();
    let lacking: Vec<&str> =
        Codec::ALL.into_iter().filter(|codec| !decoded.contains(codec)).map(Codec::as_str).collect();
    let codecs = if lacking.is_empty() {
        Line::ok("codecs", "every usual codec is decoded".to_owned())
    } else {
        let what = format!("{} cannot be decoded", lacking.join(", "));
        Line::warning("codecs", what, "cameras that send it fail").do_this(install)
    };
    vec![missing, codecs, sandbox()]
}

/// Looks whether decoding is confined: cameras and files may hold what takes a decoder over.
fn sandbox() -> Line {
    let sandbox = match look_at_sandbox() {
        Ok(sandbox) => sandbox,
        Err(fault) => {
            let what = "no decoding process can be started".to_owned();
            return Line::problem("decoding", what, format!("no camera has pictures: {fault}"));
        }
    };
    let (mut holds, mut lacks) = (Vec::new(), Vec::new());
    let mut part = |name: String, is_held: bool| if is_held { holds.push(name) } else { lacks.push(name) };
    part("limits of memory and files".to_owned(), sandbox.has_limits);
    let version = sandbox.landlock_abi.map_or(String::new(), |abi| format!(" {abi}"));
    part(format!("Landlock{version}"), sandbox.landlock_abi.is_some());
    part("seccomp".to_owned(), sandbox.has_seccomp);
    let what = format!("decoding processes are held by {}", holds.join(", "));
    if lacks.is_empty() {
        return Line::ok("decoding", what);
    }
    let why =
        format!("{} not at work here: a stream that takes a decoder over can do more", lacks.join(" and "));
    Line::warning("decoding", what, why)
        .do_this("use a kernel from 5.13 on with Landlock, and let the service manager's filter allow landlock and seccomp")
}

pub(super) fn look(config: &Config) -> Vec<Line> {
    let settings = config.settings();
    let credentials = settings.credentials.iter().filter_map(|login| {
        let called = format!("credentials {}", login.id);
        password(&called, login.password_file.as_deref(), login.password_env.as_deref())
    });
    credentials.chain(settings.camera.iter().map(camera)).collect()
}

fn camera(camera: &CameraSettings) -> Line {
    let id = &camera.id;
    let source = &camera.source;
    if let Some(line) = password(id.as_str(), source.password_file.as_deref(), source.password_env.as_deref())
    {
        return line;
    }
    match camera.source.place() {
        Some(Place::Device(device)) => self::device(id.as_str(), device),
        Some(Place::Path(path)) => file(id.as_str(), path),
        Some(Place::Url(_)) => Line::ok("cameras", format!("{id}: in the network, not asked from here")),
        None => Line::problem("cameras", format!("{id}: has no source"), "nothing feeds it"),
    }
}

/// Returns what is wrong with where a password stands; none where nothing is.
fn password(called: &str, file: Option<&Path>, variable: Option<&str>) -> Option<Line> {
    if let Some(file) = file
        && let Err(error) = access(file, Access::READ_OK)
    {
        let what = format!("{called}: the password's file {}", file.display());
        let line = Line::problem("cameras", what, error.to_string());
        return Some(
            line.do_this("a file of the service manager's credentials is there only while the service runs"),
        );
    }
    let variable = variable.filter(|variable| std::env::var_os(variable).is_none())?;
    let what = format!("{called}: the password's variable {variable}");
    Some(Line::warning("cameras", what, "it is not set here; the daemon's environment counts"))
}

fn device(id: &str, device: &Path) -> Line {
    let what = format!("{id}: {}", device.display());
    let metadata = match std::fs::metadata(device) {
        Ok(metadata) => metadata,
        Err(error) => {
            return Line::problem("cameras", what, error.to_string())
                .do_this("connect the camera; `ls /dev/video*` shows what there is");
        }
    };
    if !metadata.file_type().is_char_device() {
        return Line::problem("cameras", what, "it is no device").do_this("name one such as /dev/video0");
    }
    match access(device, Access::READ_OK | Access::WRITE_OK) {
        Ok(()) => Line::ok("cameras", what),
        Err(error) => {
            let why = format!("this user may not use it: {error}; it is group {}'s", metadata.gid());
            Line::problem("cameras", what, why)
                .do_this("put the daemon's user into that group (most often `video`), or give it the device")
        }
    }
}

fn file(id: &str, path: &Path) -> Line {
    let what = format!("{id}: {}", path.display());
    // A pattern of numbered pictures is no file's name.
    let looked_at = if what.contains('%') { path.parent().unwrap_or(path) } else { path };
    match access(looked_at, Access::READ_OK) {
        Ok(()) => Line::ok("cameras", what),
        Err(error) => Line::problem("cameras", what, error.to_string()).do_this("see `source.path`"),
    }
}
