//! True places of everybody in a recording: `positions.jsonl` and `visible.jsonl`, as docs/truth.md has them.
//!
//! Files go in; figures by instant come out, or the first fault with its file and line.

use super::judge::{Figure, Kind};
use crate::entities::LEAST_PX;
use anyhow::{Context as _, Result, anyhow, bail, ensure};
use glam::{DVec2, DVec3};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use videofields_picture::scene::Scene;
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::Ray;

/// Largest distance from the origin, metres, and longest clip, seconds.
const MOST_M: f64 = 1e8;
const MOST_SECS: f64 = 1e7;

/// Largest difference in time at which a camera's line of `visible.jsonl` says who is seen, seconds.
const VISIBLE_REACH_SECS: f64 = 0.5;

/// Height of an upright person's middle over the ground, metres, and what may lie before it and hide nobody.
const MIDDLE_M: f64 = 0.9;
const SLACK_M: f64 = 0.1;

/// A line of `positions.jsonl`; what else stands in it is not read.
#[derive(Deserialize)]
struct PositionsLine {
    time_secs: f64,
    figures: Vec<FigureLine>,
}

#[derive(Deserialize)]
struct FigureLine {
    instance: u64,
    #[serde(default)]
    kind: Kind,
    foot_m: [f64; 3],
    #[serde(default)]
    box_low_m: Option<[f64; 3]>,
    #[serde(default)]
    box_high_m: Option<[f64; 3]>,
    /// Says whether a camera shows it, where that is known.
    #[serde(default)]
    is_seen: Option<bool>,
    #[serde(default)]
    rectangles_px: BTreeMap<String, [f64; 4]>,
}

/// A line of a camera's `visible.jsonl`.
#[derive(Deserialize)]
struct VisibleLine {
    time_secs: f64,
    figures: Vec<VisibleFigure>,
}

#[derive(Deserialize)]
struct VisibleFigure {
    instance: u64,
    n_pixels: u64,
}

/// An instant with everybody who is there.
#[derive(Debug, PartialEq)]
pub(super) struct Instant {
    /// Seconds from the clips' first frames.
    pub(super) time_secs: f64,
    pub(super) figures: Vec<Figure>,
}

/// Reads the truth of the recording in `folder`, at most `rate_hz` instants a second of it.
///
/// Somebody is seen if the truth says so; or else if a camera's `visible.jsonl` has 40 of their pixels near that time; or
/// where there is no such file, if a camera of the scene has their middle in its picture with no surface before it.
///
/// # Errors
/// When there is no truth, it cannot be read, or says what cannot be.
pub(super) fn read(folder: &Path, scene: &Scene, rate_hz: Option<f64>) -> Result<Vec<Instant>> {
    let path = [folder.join("positions.jsonl"), folder.join("truth/positions.jsonl")];
    let path = path.iter().find(|path| path.is_file()).with_context(|| {
        format!(
            "{}: neither positions.jsonl nor truth/positions.jsonl is there (docs/truth.md)",
            folder.display()
        )
    })?;
    let cameras: Vec<&CameraId> = scene.cameras.iter().map(|member| &member.id).collect();
    let visible = visible(&folder.join("truth"), &cameras)?;
    let mut instants: Vec<Instant> = Vec::new();
    let mut before = None;
    for (place, line) in lines::<PositionsLine>(path)? {
        check_time(line.time_secs, 0.0, before).with_context(|| place.clone())?;
        before = Some(line.time_secs);
        let kept = instants.last().map(|instant| instant.time_secs);
        let is_due = kept.zip(rate_hz).is_none_or(|(kept, rate_hz)| {
            // Times are rounded somewhere.
            line.time_secs - kept > 1.0 / rate_hz - 1e-6
        });
        check_figures(&line.figures, &cameras).with_context(|| place)?;
        if is_due {
            let time_secs = line.time_secs;
            let seen = visible.as_ref().map(|by_camera| seen_near(by_camera, time_secs));
            let figures = line.figures.iter().map(|of| figure(of, scene, seen.as_ref())).collect();
            instants.push(Instant { time_secs, figures });
        }
    }
    ensure!(!instants.is_empty(), "{}: holds no instant", path.display());
    Ok(instants)
}

/// Every line of a file, with its place for people.
fn lines<T: DeserializeOwned>(path: &Path) -> Result<Vec<(String, T)>> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let read = |(line, number): (&str, usize)| {
        let place = format!("{}, line {number}", path.display());
        let document = serde_json::from_str(line);
        Ok((place.clone(), document.map_err(|error| anyhow!("{place}: {}", without_place(&error)))?))
    };
    text.lines().zip(1..).map(read).collect()
}

/// A parser's complaint without its line, which is always the first.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let text = text.split(" at line ").next().unwrap_or_default();
    format!("{text} (column {}); a line is one JSON object, with finite numbers alone", error.column())
}

fn check_time(time_secs: f64, least_secs: f64, before: Option<f64>) -> Result<()> {
    ensure!(
        (least_secs..=MOST_SECS).contains(&time_secs),
        "time_secs: expected {least_secs:.0} to {MOST_SECS:.0} seconds, got {time_secs}"
    );
    if let Some(before) = before.filter(|before| time_secs <= *before) {
        bail!("time_secs: expected more than the {before} of an earlier line, got {time_secs}");
    }
    Ok(())
}

fn check_figures(figures: &[FigureLine], cameras: &[&CameraId]) -> Result<()> {
    let mut ids = BTreeSet::new();
    for figure in figures {
        let id = figure.instance;
        ensure!(ids.insert(id), "instance {id} is there twice; each is one figure");
        let corners = [Some(figure.foot_m), figure.box_low_m, figure.box_high_m];
        let is_near = |value: &f64| value.abs() <= MOST_M;
        ensure!(
            corners.iter().flatten().flatten().all(is_near),
            "instance {id}: expected places within {MOST_M:e} m of the origin"
        );
        if let (Some(low), Some(high)) = (figure.box_low_m, figure.box_high_m) {
            let is_box = low.iter().zip(high).all(|(low, high)| *low <= high);
            ensure!(is_box, "instance {id}: box_low_m is above box_high_m");
        }
        for camera in figure.rectangles_px.keys() {
            check_camera(camera, cameras)?;
        }
    }
    Ok(())
}

fn check_camera(camera: &str, cameras: &[&CameraId]) -> Result<()> {
    let known: Vec<&str> = cameras.iter().map(|id| id.as_str()).collect();
    if known.contains(&camera) {
        return Ok(());
    }
    bail!("{}", videofields_vision::error::unknown("camera", camera, &known))
}

/// Times and who is seen then, by camera.
type Visible = Vec<Vec<(f64, BTreeSet<u64>)>>;

/// Reads every camera's `visible.jsonl`; `None` where there is none.
fn visible(truth: &Path, cameras: &[&CameraId]) -> Result<Option<Visible>> {
    let mut by_camera = Visible::new();
    for path in visible_files(truth)? {
        let camera = path.parent().and_then(Path::file_name).unwrap_or_default().to_string_lossy();
        check_camera(&camera, cameras).with_context(|| path.display().to_string())?;
        let mut seen: Vec<(f64, BTreeSet<u64>)> = Vec::new();
        for (place, line) in lines::<VisibleLine>(&path)? {
            // A camera whose clock is off may have begun before the others.
            let before = seen.last().map(|(time_secs, _)| *time_secs);
            check_time(line.time_secs, -MOST_SECS, before).context(place)?;
            let enough = line.figures.iter().filter(|figure| figure.n_pixels >= LEAST_PX as u64);
            seen.push((line.time_secs, enough.map(|figure| figure.instance).collect()));
        }
        by_camera.push(seen);
    }
    Ok((!by_camera.is_empty()).then_some(by_camera))
}

fn visible_files(truth: &Path) -> Result<Vec<PathBuf>> {
    if !truth.is_dir() {
        return Ok(Vec::new());
    }
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(truth).with_context(|| format!("cannot read {}", truth.display()))? {
        let path = entry?.path().join("visible.jsonl");
        if path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

/// Returns who is seen by any camera, as its line nearest in time says.
fn seen_near(by_camera: &Visible, time_secs: f64) -> BTreeSet<u64> {
    let mut all = BTreeSet::new();
    for lines in by_camera {
        let next = lines.partition_point(|(at, _)| *at < time_secs);
        let around = lines[next.saturating_sub(1)..].iter().take(2);
        let away = |(at, _): &&(f64, BTreeSet<u64>)| (at - time_secs).abs();
        let nearest = around.min_by(|a, b| away(a).total_cmp(&away(b)));
        all.extend(
            nearest.filter(|line| away(line) <= VISIBLE_REACH_SECS).into_iter().flat_map(|(_, seen)| seen),
        );
    }
    all
}

fn figure(line: &FigureLine, scene: &Scene, seen: Option<&BTreeSet<u64>>) -> Figure {
    let foot = DVec3::from_array(line.foot_m);
    let corner =
        |corner: Option<[f64; 3]>| corner.map_or(foot.truncate(), |corner| DVec2::new(corner[0], corner[1]));
    let by_sight = || seen.map_or_else(|| is_in_sight(scene, foot), |seen| seen.contains(&line.instance));
    Figure {
        id: line.instance,
        kind: line.kind,
        foot_in_world: foot,
        ground_m: [corner(line.box_low_m), corner(line.box_high_m)],
        is_seen: line.is_seen.unwrap_or_else(by_sight),
    }
}

/// Says whether a camera has the middle of who stands there in its picture, and no surface before it.
fn is_in_sight(scene: &Scene, foot: DVec3) -> bool {
    let middle = foot + DVec3::Z * MIDDLE_M;
    scene.cameras.iter().any(|member| {
        let eye = member.camera.pose().position_in_world;
        let way = middle - eye;
        let ray = Ray { origin: eye, direction: way.normalize_or_zero() };
        let is_free = || {
            let hit = scene.surfaces.hit(&ray, 0.0);
            hit.is_none_or(|hit| (hit.point_in_world - eye).length() > way.length() - SLACK_M)
        };
        member.camera.project(middle).is_some_and(|place| place.is_inside()) && is_free()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    /// One camera 10 m south of the origin that looks north, and a wall from x 2 to 6 two metres north of the origin.
    fn scene() -> Scene {
        let text = r##"{"version": 1, "boxes": [{"id": "wall", "center_m": [4, 2, 1.5], "size_m": [4, 0.2, 3], "color_srgb": "#808080"}],
            "cameras": [{"id": "south", "calibration": {"image_size_px": [64, 36], "focal_px": [50, 50], "center_px": [32, 18],
             "position_m": [0, -10, 1.5], "world_from_camera": [-0.7071067811865476, 0, 0, 0.7071067811865476]}}]}"##;
        videofields_picture::scene::parse("yard", text, videofields_picture::scene::no_imports).unwrap().scene
    }

    fn read_text(text: &str, rate_hz: Option<f64>) -> Result<Vec<Instant>> {
        let folder = TempDir::new().unwrap();
        std::fs::write(folder.path().join("positions.jsonl"), text).unwrap();
        read(folder.path(), &scene(), rate_hz)
    }

    #[test]
    fn positions_are_read_with_who_is_seen() {
        let text = "\
            {\"time_secs\": 0, \"figures\": [{\"instance\": 3, \"foot_m\": [0, 4, 0], \"name\": \"a\"}, {\"instance\": 4, \"foot_m\": [4, 6, 0]}]}\n\
            {\"time_secs\": 0.1, \"figures\": [{\"instance\": 4, \"foot_m\": [4, 6, 0], \"is_seen\": true}, {\"instance\": 5, \"foot_m\": [0, -20, 0]}]}\n\
            {\"time_secs\": 0.5, \"figures\": [{\"instance\": 9, \"kind\": \"car\", \"foot_m\": [0, 0, 0], \"box_low_m\": [-2, -1, 0], \"box_high_m\": [2, 1, 1.5]}]}\n";
        let instants = read_text(text, None).unwrap();
        let seen = |instant: usize| -> Vec<(u64, bool)> {
            instants[instant].figures.iter().map(|figure| (figure.id, figure.is_seen)).collect()
        };
        assert_eq!(seen(0), [(3, true), (4, false)], "one stands behind the wall");
        assert_eq!(seen(1), [(4, true), (5, false)], "the truth knows better; one stands behind the camera");
        let car = &instants[2].figures[0];
        assert_eq!((car.kind, car.ground_m), (Kind::Car, [DVec2::new(-2.0, -1.0), DVec2::new(2.0, 1.0)]));
        let times = |rate_hz| -> Vec<f64> {
            read_text(text, Some(rate_hz)).unwrap().iter().map(|instant| instant.time_secs).collect()
        };
        assert_eq!(times(10.0), [0.0, 0.1, 0.5]);
        assert_eq!(times(5.0), [0.0, 0.5]);
    }

    #[test]
    fn what_a_camera_shows_of_somebody_decides() {
        let folder = TempDir::new().unwrap();
        let truth = folder.path().join("truth");
        std::fs::create_dir_all(truth.join("south")).unwrap();
        let at = |secs: f64| {
            format!("{{\"time_secs\": {secs}, \"figures\": [{{\"instance\": 1, \"foot_m\": [0, 0, 0]}}]}}\n")
        };
        std::fs::write(truth.join("positions.jsonl"), [at(0.0), at(1.0), at(3.0)].concat()).unwrap();
        let shown = |secs: f64, n: u32| {
            format!(
                "{{\"time_secs\": {secs}, \"figures\": [{{\"instance\": 1, \"rectangle_px\": [0, 0, 9, 9], \"n_pixels\": {n}}}]}}\n"
            )
        };
        std::fs::write(truth.join("south/visible.jsonl"), [shown(-0.1, 39), shown(0.9, 40)].concat())
            .unwrap();
        let instants = read(folder.path(), &scene(), None).unwrap();
        let seen: Vec<bool> = instants.iter().map(|instant| instant.figures[0].is_seen).collect();
        assert_eq!(seen, [false, true, false], "too few pixels; enough; nothing is known near the third");
        std::fs::create_dir(truth.join("north")).unwrap();
        std::fs::write(truth.join("north/visible.jsonl"), shown(0.0, 50)).unwrap();
        let error = format!("{:#}", read(folder.path(), &scene(), None).unwrap_err());
        assert!(
            error.contains("north/visible.jsonl") && error.contains("unknown camera `north`; allowed: south"),
            "{error}"
        );
    }

    #[test]
    fn faulty_truth_is_refused_with_its_line() {
        let good = "{\"time_secs\": 1, \"figures\": []}\n";
        let refused = |line: &str, expected: &[&str]| {
            let error = format!("{:#}", read_text(&format!("{good}{line}\n"), None).unwrap_err());
            for part in ["positions.jsonl, line 2"].iter().chain(expected) {
                assert!(error.contains(part), "{line}: {part:?} is not in {error}");
            }
        };
        refused("{", &["one JSON object"]);
        refused("", &["one JSON object"]);
        refused("{\"time_secs\": NaN, \"figures\": []}", &["column 15", "finite numbers"]);
        refused("{\"time_secs\": 1e999, \"figures\": []}", &["out of range", "finite numbers"]);
        refused("{\"figures\": []}", &["`time_secs`"]);
        refused("{\"time_secs\": -1, \"figures\": []}", &["time_secs: expected 0 to 10000000"]);
        refused(
            "{\"time_secs\": 1, \"figures\": []}",
            &["expected more than the 1 of an earlier line, got 1"],
        );
        let figures = |text: &str| format!("{{\"time_secs\": 2, \"figures\": [{text}]}}");
        refused(&figures("{\"instance\": 1}"), &["`foot_m`"]);
        refused(&figures("{\"instance\": 1, \"foot_m\": [0, 0]}"), &["length 2"]);
        refused(&figures("{\"instance\": 1, \"foot_m\": [0, 1e9, 0]}"), &["instance 1", "1e8 m"]);
        refused(
            &figures("{\"instance\": 1, \"kind\": \"bus\", \"foot_m\": [0, 0, 0]}"),
            &["`bus`", "`walker`"],
        );
        let one = "{\"instance\": 1, \"foot_m\": [0, 0, 0]}";
        refused(&figures(&format!("{one}, {one}")), &["instance 1 is there twice"]);
        let box_m = "\"box_low_m\": [0, 0, 0], \"box_high_m\": [-1, 0, 0]";
        refused(&figures(&format!("{{\"instance\": 1, \"foot_m\": [0, 0, 0], {box_m}}}")), &["box_low_m"]);
        let seen_by = "\"rectangles_px\": {\"suoth\": [0, 0, 1, 1]}";
        refused(
            &figures(&format!("{{\"instance\": 1, \"foot_m\": [0, 0, 0], {seen_by}}}")),
            &["did you mean `south`?"],
        );
        let error = format!("{:#}", read_text("", None).unwrap_err());
        assert!(error.contains("holds no instant"), "{error}");
        let folder = TempDir::new().unwrap();
        let error = read(folder.path(), &scene(), None).unwrap_err().to_string();
        assert!(error.contains("truth/positions.jsonl"), "{error}");
    }
}
