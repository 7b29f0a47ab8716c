//! Reads a recording back: any instant, one after the other, and exports, by our own decoder and by `ffprobe` where it is installed.

use super::super::exports::numbers;
use super::super::{At, EngineError, Running, number_of, wait_for};
use crate::engine::privacy::{hides, zone};
use serde_json::{Value, json};
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::Duration;
use videofields_recording::archive::{ExportState, ExportedCamera, Manifest};
use videofields_service::engine::Privacy;
use videofields_testing::say_skipped;
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::YuvImage;

/// The part of masked pictures that nobody may see: not where the number is read.
pub(super) const ZONE: &str =
    "{name = \"garden\", reason = \"not ours\", polygon = [[0, 0], [0.4, 0], [0.4, 0.3], [0, 0.3]]}";
const ZONE_CORNERS: [[f64; 2]; 4] = [[0.0, 0.0], [0.4, 0.0], [0.4, 0.3], [0.0, 0.3]];

/// Recorded frames of a camera.
#[derive(Debug)]
pub(super) struct Expected {
    pub id: String,
    /// Media type in which they are recorded.
    pub codec: &'static str,
    pub size_px: (u32, u32),
    /// The number that each shows, and its scene time.
    pub shown: Vec<(u64, Timestamp)>,
    pub known: Known,
}

/// Which of the frames that are recorded are known before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Known {
    All,
    /// Those that were looked at; numbers begin anew after so many, and go on from frame to frame by this at most.
    Some {
        n_numbers: u64,
        largest_step: u64,
    },
}

impl Expected {
    /// Holds what a clip shows against what is known of the frames in these places.
    fn hold(&self, shown: &[(u64, Timestamp)], (from, to): (usize, usize)) -> Checked {
        let asked = &self.shown[from..to.min(self.shown.len())];
        let missing: Vec<_> = asked.iter().filter(|frame| !shown.contains(frame)).collect();
        equal("missing", &missing, &Vec::new())?;
        match self.known {
            Known::All => {
                let strange: Vec<_> = shown.iter().filter(|frame| !self.shown.contains(frame)).collect();
                equal("strange", &strange, &Vec::new())
            }
            Known::Some { n_numbers, largest_step } => {
                let goes_on = |pair: &[(u64, Timestamp)]| {
                    let step = (pair[1].0 + n_numbers - pair[0].0) % n_numbers;
                    (1..=largest_step).contains(&step) && pair[1].1 > pair[0].1
                };
                let torn: Vec<_> = shown.windows(2).filter(|pair| !goes_on(pair)).collect();
                equal("torn", &torn, &Vec::new())
            }
        }
    }
}

/// Returns what is wrong with a recording; none where nothing is.
type Checked = Result<(), String>;

/// Asks for each of `items` in one of a few threads; returns all answers, in no order.
pub(super) fn in_threads<T: Sync, A: Send>(items: &[T], ask: impl Fn(&T) -> Vec<A> + Sync) -> Vec<A> {
    const THREADS: usize = 3;
    let (next, answers) = (Mutex::new(items.iter()), Mutex::new(Vec::new()));
    let work = || {
        loop {
            let Some(item) = next.lock().unwrap().next() else { return };
            let answer = ask(item);
            answers.lock().unwrap().extend(answer);
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..THREADS {
            std::thread::Builder::new().name("kinds".to_owned()).spawn_scoped(scope, work).unwrap();
        }
    });
    answers.into_inner().unwrap()
}

fn equal<T: PartialEq + Debug>(what: &str, found: &T, expected: &T) -> Checked {
    if found == expected { Ok(()) } else { Err(format!("{what}: {found:?} and not {expected:?}")) }
}

/// Shows and exports what is recorded of cameras that give nothing any more; returns all that is wrong.
pub(super) fn complaints(running: &Running, expected: &[Expected]) -> Vec<String> {
    let told = |part: &str, expected: &Expected, checked: Checked| {
        checked.err().map(|complaint| format!("{}: {part}: {complaint}", expected.id))
    };
    let mut found = in_threads(expected, |expected| {
        let parts = [
            ("sought", sought(running, expected)),
            ("played", played(running, expected)),
            ("previewed", previewed(running, expected)),
        ];
        parts.into_iter().filter_map(|(part, checked)| told(part, expected, checked)).collect()
    });
    let folder = tempfile::tempdir().unwrap();
    let is_probed = ["ffprobe", "ffmpeg"].map(is_installed) == [true; 2];
    if !is_probed {
        say_skipped("exports are not held against ffprobe and ffmpeg, which are not installed");
    }
    let manifest = export(running, expected, (0, usize::MAX), &folder.path().join("whole")).unwrap();
    found.extend(in_threads(&of_cameras(&manifest, expected), |(camera, expected)| {
        let exported = whole(camera, expected, &folder.path().join("whole"));
        let probed = exported
            .clone()
            .and_then(|(path, shown)| if is_probed { probe(&path, expected, &shown) } else { Ok(()) });
        let parts = [("exported", exported.map(|_clip| ())), ("probed", probed)];
        parts.into_iter().filter_map(|(part, checked)| told(part, expected, checked)).collect()
    }));
    let manifest = export(running, expected, PART, &folder.path().join("part")).unwrap();
    found.extend(in_threads(&of_cameras(&manifest, expected), |(camera, expected)| {
        told("partly exported", expected, part(camera, expected, &folder.path().join("part")))
            .into_iter()
            .collect()
    }));
    let hidden = zone("garden", &ZONE_CORNERS);
    for expected in expected {
        let privacy = Privacy { zones: [hidden.clone()].into(), lifted: [].into(), version: 1, since: None };
        running.handle.hold_privacy(&expected.id, privacy).unwrap();
    }
    found.extend(in_threads(expected, |expected| {
        let folder = folder.path().join(&expected.id);
        let exported = export(running, std::slice::from_ref(expected), PART, &folder);
        let checked = exported.and_then(|manifest| redrawn(running, &manifest.cameras[0], expected, &folder));
        told("redrawn", expected, checked).into_iter().collect()
    }));
    found.sort();
    found
}

/// Frames of which a part is exported: from within a group of pictures to the middle of another.
const PART: (usize, usize) = (13, 22);

/// Instants in no order, some beside a frame's own time.
fn sought(running: &Running, expected: &Expected) -> Checked {
    let shown = &expected.shown;
    for turn in 0..4 {
        let idx = (turn * 7919 + 20) % shown.len();
        let (number, at) = shown[idx];
        let beside_nanos = if turn % 2 == 0 { 3_000_000 } else { 0 };
        let seen = running.handle.observation(&expected.id, At::Time(at.saturating_add_nanos(beside_nanos)));
        let seen = seen.map_err(|error| format!("frame {number}: {error}"))?;
        let image = &seen.frame.image;
        equal("frame", &(number_of(image), seen.frame.timestamp), &(number, at))?;
        equal("size", &(image.width(), image.height()), &expected.size_px)?;
    }
    // A live camera may be recorded for a while before its first picture is seen.
    let before = shown[0].1.saturating_add_nanos(-3_600_000_000_000);
    match running.handle.observation(&expected.id, At::Time(before)) {
        Err(EngineError::Gap { before: None, .. }) => Ok(()),
        other => Err(format!("before the beginning: {:?}", other.map(|seen| seen.frame.timestamp))),
    }
}

/// All frames, one after the other.
fn played(running: &Running, expected: &Expected) -> Checked {
    for (number, at) in &expected.shown {
        let seen = running.handle.observation(&expected.id, At::Time(*at));
        let seen = seen.map_err(|error| format!("frame {number}: {error}"))?;
        equal("frame", &(number_of(&seen.frame.image), seen.frame.timestamp), &(*number, *at))?;
    }
    Ok(())
}

fn previewed(running: &Running, expected: &Expected) -> Checked {
    let (number, at) = expected.shown[11];
    let seen = running.handle.preview(&expected.id, at, Duration::ZERO);
    let seen = seen.map_err(|error| format!("frame {number}: {error}"))?;
    equal("frame", &(number_of(&seen.image), seen.timestamp), &(number, at))
}

/// Exports frames of these places in what is expected, and copies the clips into `folder`.
fn export(
    running: &Running,
    expected: &[Expected],
    (from, to): (usize, usize),
    folder: &Path,
) -> Result<Manifest, String> {
    let times = |place: usize| expected.iter().filter_map(move |of| of.shown.get(place)).map(|(_, at)| *at);
    let last = || expected.iter().filter_map(|of| of.shown.last()).map(|(_, at)| at.saturating_add_nanos(1));
    let (from, to) = (times(from).min().unwrap(), times(to).max().or_else(|| last().max()).unwrap());
    let ids: Vec<_> = expected.iter().map(|of| of.id.as_str()).collect();
    let asked = json!({"cameras": ids, "from": from.to_string(), "to": to.to_string()});
    // The archive may be reading on what was open.
    let asked = wait_for("the archive", || match running.handle.ask_export(asked.clone(), None) {
        Err(EngineError::Unavailable(_)) => None,
        asked => Some(asked.unwrap()),
    });
    let done = wait_for("the export", || {
        let status = running.handle.exports().into_iter().find(|status| status.id == asked.id).unwrap();
        [ExportState::Done, ExportState::Failed].contains(&status.state).then_some(status)
    });
    if done.state == ExportState::Failed {
        return Err(format!("{done:?}"));
    }
    let (file, _) = running.handle.export_file(&asked.id, "manifest.json").unwrap();
    let manifest: Manifest = serde_json::from_reader(file).unwrap();
    std::fs::create_dir(folder).unwrap();
    for clip in manifest.clips() {
        let (mut file, _) = running.handle.export_file(&asked.id, &clip.file).unwrap();
        let mut copy = std::fs::File::create(folder.join(&clip.file)).unwrap();
        std::io::copy(&mut file, &mut copy).unwrap();
    }
    Ok(manifest)
}

fn of_cameras<'a>(
    manifest: &'a Manifest,
    expected: &'a [Expected],
) -> Vec<(&'a ExportedCamera, &'a Expected)> {
    let of = |id: &str| manifest.cameras.iter().find(|camera| camera.id == id).unwrap();
    expected.iter().map(|expected| (of(&expected.id), expected)).collect()
}

/// A clip's path, the numbers that it shows and their scene times.
type Shown = (PathBuf, Vec<(u64, Timestamp)>);

/// The one clip of a camera.
fn clip(camera: &ExportedCamera, folder: &Path) -> Result<Shown, String> {
    let [clip] = camera.clips.as_slice() else { return Err(format!("no single clip: {camera:?}")) };
    equal("unreadable", &camera.unreadable.len(), &0)?;
    let (path, first_at) = (folder.join(&clip.file), clip.first_at.parse::<Timestamp>().unwrap());
    let shown = numbers(&path).into_iter();
    let shown = shown.map(|(number, nanos)| (number, first_at.saturating_add_nanos(nanos))).collect();
    Ok((path, shown))
}

/// An export of all that is recorded.
fn whole(camera: &ExportedCamera, expected: &Expected, folder: &Path) -> Result<Shown, String> {
    let (path, shown) = clip(camera, folder)?;
    if expected.known == Known::All {
        equal("gaps", &camera.gaps, &Vec::new())?;
    }
    let clip = &camera.clips[0];
    equal("codec", &clip.codec.as_str(), &expected.codec)?;
    equal("size", &clip.size_px.map(<(u32, u32)>::from), &Some(expected.size_px))?;
    if expected.known == Known::All {
        equal("frames", &shown, &expected.shown)?;
    }
    expected.hold(&shown, (0, usize::MAX))?;
    Ok((path, shown))
}

/// An export that begins and ends within groups of pictures.
fn part(camera: &ExportedCamera, expected: &Expected, folder: &Path) -> Checked {
    let (_path, shown) = clip(camera, folder)?;
    expected.hold(&shown, PART)
}

/// An export whose pictures are drawn anew, since not all of them may be seen.
fn redrawn(running: &Running, camera: &ExportedCamera, expected: &Expected, folder: &Path) -> Checked {
    let (_path, shown) = clip(camera, folder)?;
    equal("codec", &camera.clips[0].codec.as_str(), &"image/jpeg")?;
    expected.hold(&shown, PART)?;
    let (number, at) = expected.shown[PART.0];
    let seen = running.handle.preview(&expected.id, at, Duration::ZERO);
    let seen = seen.map_err(|error| format!("frame {number}: {error}"))?;
    let is_hidden = |image: &YuvImage| hides(image, &zone("garden", &ZONE_CORNERS));
    equal("hidden", &(number_of(&seen.image), is_hidden(&seen.image)), &(number, true))
}

fn is_installed(program: &str) -> bool {
    Command::new(program).arg("-version").output().is_ok_and(|output| output.status.success())
}

/// The name that `ffprobe` has for a codec.
fn name_of(codec: &str) -> &str {
    match codec {
        "video/x-h264" => "h264",
        "video/x-h265" => "hevc",
        "video/mpeg" | "video/x-divx" => "mpeg4",
        "video/x-msmpeg" => "msmpeg4v3",
        "image/jpeg" => "mjpeg",
        other => other.trim_start_matches("video/x-"),
    }
}

/// Holds a clip against what `ffprobe` reads in it, and has `ffmpeg` decode it.
fn probe(path: &Path, expected: &Expected, shown: &[(u64, Timestamp)]) -> Checked {
    let entries =
        "stream=codec_name,width,height,nb_read_frames:format=duration:frame=best_effort_timestamp_time";
    let mut probing = Command::new("ffprobe");
    probing.args([
        "-v",
        "error",
        "-count_frames",
        "-select_streams",
        "v",
        "-of",
        "json",
        "-show_entries",
        entries,
    ]);
    let probed = probing.arg(path).output().map_err(|error| error.to_string())?;
    equal("ffprobe complains", &String::from_utf8_lossy(&probed.stderr).as_ref(), &"")?;
    let probed: Value = serde_json::from_slice(&probed.stdout).map_err(|error| error.to_string())?;
    let stream = &probed["streams"][0];
    equal("ffprobe's codec", &stream["codec_name"].as_str(), &Some(name_of(expected.codec)))?;
    let size_px = (stream["width"].as_u64(), stream["height"].as_u64());
    let (width, height) = expected.size_px;
    equal("ffprobe's size", &size_px, &(Some(u64::from(width)), Some(u64::from(height))))?;
    equal("ffprobe's frames", &stream["nb_read_frames"].as_str(), &Some(shown.len().to_string().as_str()))?;
    let ticks = |text: &Value| {
        text.as_str().and_then(|text| text.parse::<f64>().ok()).map(|secs| (secs * 1e3).round())
    };
    let times = probed["frames"].as_array().into_iter().flatten();
    let times: Vec<_> = times.map(|frame| ticks(&frame["best_effort_timestamp_time"])).collect();
    let first_at = shown[0].1;
    let own: Vec<_> = shown.iter().map(|(_, at)| Some((at.secs_since(first_at) * 1e3).round())).collect();
    let is_near =
        |pair: (&Option<f64>, &Option<f64>)| matches!(pair, (Some(a), Some(b)) if (a - b).abs() <= 1.0);
    if times.len() != own.len() || !times.iter().zip(&own).all(is_near) {
        return Err(format!("ffprobe's times: {times:?} and not {own:?}"));
    }
    let length = own.last().copied().flatten().unwrap_or_default();
    let interval = length / (shown.len() - 1) as f64;
    let told = ticks(&probed["format"]["duration"]).unwrap_or_default();
    if !(length - 1.0..=length + (2.0 * interval).max(1000.0)).contains(&told) {
        return Err(format!("ffprobe's length is {told} ms and not about {length}"));
    }
    let mut decoding = Command::new("ffmpeg");
    decoding.args(["-v", "error", "-nostdin", "-i"]).arg(path).args(["-fps_mode", "vfr", "-f", "null", "-"]);
    let decoded = decoding.output().map_err(|error| error.to_string())?;
    equal("ffmpeg complains", &String::from_utf8_lossy(&decoded.stderr).as_ref(), &"")
}
