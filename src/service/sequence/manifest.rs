//! What a manifest means: every value held to its range, every fault told with its JSON pointer.

use super::document::{CameraEntry, FilesDocument, MeshesDocument, SequenceDocument, VERSION};
use super::turn::Up;
use serde_json::Value;
use std::path::{Path, PathBuf};
use videofields_picture::scene::{SceneError, json_tree};
use videofields_recording::ingest::Pattern;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{Fault, Gatherer};
use videofields_vision::fields::MAX_VIEWS;
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::Camera;

/// Most characters of a name.
const MAX_NAME_CHARS: usize = 200;

/// Beyond so many seconds after its start no frame of a sequence is: thirty years.
const MAX_SECS: f64 = 1e9;

/// What [`MeshesDocument::extruded_times`] is of several frames where it is not said.
const EXTRUDED_TIMES: f64 = 8.0;

/// A manifest's meaning.
#[derive(Debug)]
pub(super) struct Manifest {
    pub(super) name: String,
    pub(super) start: Timestamp,
    pub(super) times: Times,
    pub(super) meshes: Files,
    pub(super) metres_per_unit: f64,
    /// None where the files' kind says it.
    pub(super) up: Option<Up>,
    /// None where it hangs on how many frames there are.
    pub(super) extruded_times: Option<f64>,
    pub(super) cameras: Vec<ManifestCamera>,
}

/// When frames are.
#[derive(Debug)]
pub(super) enum Times {
    /// Of one frame alone, which stands for ever.
    Standing,
    /// Frames a second.
    Rate(f64),
    /// Seconds after the start.
    Listed(Vec<f64>),
}

/// Files, one a frame.
#[derive(Clone, Debug)]
pub(super) enum Files {
    /// By a number.
    Pattern(PathBuf, Pattern),
    /// One after the other.
    List(Vec<Option<PathBuf>>),
}

/// Where a camera's pictures are.
#[derive(Clone, Debug)]
pub(super) enum PicturesOf {
    Files(Files, i64),
    Video { path: PathBuf, offset_secs: f64, rate_hz: Option<f64> },
}

#[derive(Debug)]
pub(super) struct ManifestCamera {
    pub(super) id: CameraId,
    pub(super) camera: Camera,
    pub(super) pictures: PicturesOf,
    pub(super) masks: Option<PicturesOf>,
}

/// What brings in a calibration's file.
pub(super) type ReadText<'a> = &'a dyn Fn(&Path) -> Result<String, String>;

/// How long [`Gatherer`]'s work goes on before a manifest's parts are looked at.
struct Reading<'a> {
    folder: &'a Path,
    gatherer: Gatherer,
    read_text: ReadText<'a>,
}

/// Reads a manifest that lies in `folder`.
///
/// # Errors
/// Every fault of it.
pub(super) fn read(text: &str, folder: &Path, read_text: ReadText<'_>) -> Result<Manifest, Vec<Fault>> {
    let mut gatherer = Gatherer::default();
    let tree = json_tree(text, &mut gatherer).map_err(|error| match error {
        SceneError::Faults(faults) => faults,
        other => vec![Fault::new("", other.to_string())],
    })?;
    if let Some(version) = tree.get("version").filter(|version| version.as_u64() != Some(u64::from(VERSION)))
    {
        return Err(vec![Fault::new("/version", format!("expected {VERSION}, got {version}"))]);
    }
    let document = gatherer.read::<SequenceDocument>(tree, "");
    let mut reading = Reading { folder, gatherer, read_text };
    let manifest = document.map(|document| reading.manifest(document));
    let faults = reading.gatherer.into_faults();
    match manifest.flatten() {
        Some(manifest) if faults.is_empty() => Ok(manifest),
        _ => Err(faults),
    }
}

impl Reading<'_> {
    fn manifest(&mut self, document: SequenceDocument) -> Option<Manifest> {
        if document.name.chars().count() > MAX_NAME_CHARS {
            self.gatherer.fault("/name", format!("expected at most {MAX_NAME_CHARS} characters"));
        }
        let start = match document.start.as_deref().map(str::parse::<Timestamp>) {
            Some(Err(error)) => {
                self.gatherer.fault("/start", error.to_string());
                None
            }
            Some(Ok(start)) => Some(start),
            None => Some(Timestamp::default()),
        };
        let MeshesDocument { pattern, list, metres_per_unit, up, extruded_times } = document.meshes;
        let files = FilesDocument { pattern, list, ..FilesDocument::default() };
        let meshes = match self.pictures(files, "/meshes") {
            Some(PicturesOf::Files(files, _)) => Some(files),
            _ => None,
        };
        self.range("/meshes/metres_per_unit", metres_per_unit, [1e-9, 1e9], "metres");
        if extruded_times != Some(0.0) {
            self.range("/meshes/extruded_times", extruded_times, [2.0, 1000.0], "median edges, or 0");
        }
        let up = up.and_then(|name| match name.parse() {
            Ok(up) => Some(up),
            Err(reason) => {
                self.gatherer.fault("/meshes/up", reason);
                None
            }
        });
        let times = self.times((document.rate_hz, document.times_secs), meshes.as_ref());
        let cameras = self.cameras(document.cameras, meshes.as_ref());
        Some(Manifest {
            name: document.name,
            start: start?,
            times: times?,
            meshes: meshes?,
            metres_per_unit: metres_per_unit.unwrap_or(1.0),
            up,
            extruded_times,
            cameras,
        })
    }

    fn range(&mut self, place: &str, value: Option<f64>, [least, most]: [f64; 2], unit: &str) {
        if let Some(value) = value.filter(|value| !(least..=most).contains(value)) {
            self.gatherer.fault(place, format!("expected {least} to {most} {unit}, got {value}"));
        }
    }

    fn times(
        &mut self,
        (rate_hz, times_secs): (Option<f64>, Option<Vec<f64>>),
        meshes: Option<&Files>,
    ) -> Option<Times> {
        self.range("/rate_hz", rate_hz, [0.01, 1000.0], "frames a second");
        let is_alone = matches!(meshes, Some(Files::List(list)) if list.len() == 1);
        match (rate_hz, times_secs) {
            (Some(_), Some(_)) => {
                self.gatherer.fault("/times_secs", "give either this or rate_hz");
                None
            }
            (Some(rate_hz), None) => Some(Times::Rate(rate_hz)),
            (None, Some(times_secs)) => {
                let is_in_range = |secs: &f64| (0.0..=MAX_SECS).contains(secs);
                if let Some(idx) = times_secs.iter().position(|secs| !is_in_range(secs)) {
                    let message = format!("expected 0 to {MAX_SECS:e} seconds, got {}", times_secs[idx]);
                    self.gatherer.fault(format!("/times_secs/{idx}"), message);
                } else if let Some(idx) = times_secs.windows(2).position(|pair| pair[1] <= pair[0]) {
                    let message = "expected a time after the one before it";
                    self.gatherer.fault(format!("/times_secs/{}", idx + 1), message);
                }
                if let Some(Files::List(list)) = meshes.filter(|_| !times_secs.is_empty())
                    && list.len() != times_secs.len()
                {
                    let message = format!("{} times for {} meshes", times_secs.len(), list.len());
                    self.gatherer.fault("/times_secs", message);
                }
                if times_secs.is_empty() {
                    self.gatherer.fault("/times_secs", "expected at least one time");
                }
                Some(Times::Listed(times_secs))
            }
            (None, None) if is_alone => Some(Times::Standing),
            (None, None) => {
                self.gatherer.fault("/rate_hz", "several meshes need this or times_secs");
                None
            }
        }
    }

    /// Files by one of their ways; a video is refused by who cannot use it.
    fn pictures(&mut self, files: FilesDocument, place: &str) -> Option<PicturesOf> {
        let FilesDocument { pattern, number_offset, list, video, offset_secs, rate_hz } = files;
        let n_ways = u8::from(pattern.is_some()) + u8::from(list.is_some()) + u8::from(video.is_some());
        if n_ways != 1 {
            let ways = if place == "/meshes" { "pattern and list" } else { "pattern, list and video" };
            self.gatherer.fault(place, format!("exactly one of {ways} is needed"));
            return None;
        }
        let stray = [
            ("number_offset", number_offset.is_some() && pattern.is_none(), "pattern"),
            ("offset_secs", offset_secs.is_some() && video.is_none(), "video"),
            ("rate_hz", rate_hz.is_some() && video.is_none(), "video"),
        ];
        for (key, _, of) in stray.into_iter().filter(|(_, is_stray, _)| *is_stray) {
            self.gatherer.fault(format!("{place}/{key}"), format!("goes with {of} alone"));
        }
        if let Some(video) = video {
            self.range(&format!("{place}/offset_secs"), offset_secs, [-MAX_SECS, MAX_SECS], "seconds");
            self.range(&format!("{place}/rate_hz"), rate_hz, [0.01, 1000.0], "pictures a second");
            let path = self.path(&video, &format!("{place}/video"))?;
            return Some(PicturesOf::Video { path, offset_secs: offset_secs.unwrap_or(0.0), rate_hz });
        }
        if let Some(pattern) = pattern {
            let place = format!("{place}/pattern");
            let path = self.path(&pattern, &place)?;
            return match Pattern::parse(&path) {
                Ok(parsed) => {
                    Some(PicturesOf::Files(Files::Pattern(path, parsed), number_offset.unwrap_or(0)))
                }
                Err(error) => {
                    self.gatherer.fault(place, error.to_string());
                    None
                }
            };
        }
        let list = list.unwrap_or_default();
        if list.is_empty() {
            self.gatherer.fault(format!("{place}/list"), "expected at least one file");
        }
        let mut paths = Vec::with_capacity(list.len());
        for (idx, file) in list.into_iter().enumerate() {
            paths.push(file.and_then(|file| self.path(&file, &format!("{place}/list/{idx}"))));
        }
        Some(PicturesOf::Files(Files::List(paths), 0))
    }

    fn path(&mut self, text: &str, place: &str) -> Option<PathBuf> {
        if text.is_empty() || text.contains('\0') {
            self.gatherer.fault(place, "expected a path");
            return None;
        }
        Some(self.folder.join(text))
    }

    fn cameras(&mut self, entries: Vec<CameraEntry>, meshes: Option<&Files>) -> Vec<ManifestCamera> {
        if entries.len() > MAX_VIEWS {
            let message = format!("at most {MAX_VIEWS} cameras are allowed, got {}", entries.len());
            self.gatherer.fault("/cameras", message);
            return Vec::new();
        }
        let mut cameras: Vec<ManifestCamera> = Vec::new();
        for (idx, CameraEntry { id, calibration, pictures, masks }) in entries.into_iter().enumerate() {
            let place = format!("/cameras/{idx}");
            let id = match CameraId::new(&id) {
                Ok(id) if cameras.iter().any(|camera| camera.id == id) => {
                    self.gatherer.fault(format!("{place}/id"), format!("another camera is {id} already"));
                    None
                }
                Ok(id) => Some(id),
                Err(error) => {
                    self.gatherer.fault(format!("{place}/id"), error.to_string());
                    None
                }
            };
            let camera = self.calibration(calibration, &format!("{place}/calibration"));
            let pictures = self.camera_files(pictures, &format!("{place}/pictures"), meshes);
            let masks = masks.and_then(|masks| self.camera_files(masks, &format!("{place}/masks"), meshes));
            if let (Some(id), Some(camera), Some(pictures)) = (id, camera, pictures) {
                cameras.push(ManifestCamera { id, camera, pictures, masks });
            }
        }
        cameras
    }

    /// A camera's files; lists are as long as that of the meshes.
    fn camera_files(
        &mut self,
        files: FilesDocument,
        place: &str,
        meshes: Option<&Files>,
    ) -> Option<PicturesOf> {
        let found = self.pictures(files, place);
        if let (Some(PicturesOf::Files(Files::List(own), _)), Some(Files::List(meshes))) = (&found, meshes)
            && own.len() != meshes.len()
        {
            let message = format!("{} pictures for {} meshes", own.len(), meshes.len());
            self.gatherer.fault(format!("{place}/list"), message);
        }
        found
    }

    fn calibration(&mut self, value: Value, place: &str) -> Option<Camera> {
        let document = match value {
            Value::String(file) => {
                let path = self.path(&file, place)?;
                let read = (self.read_text)(&path)
                    .and_then(|text| CameraDocument::from_json(&text).map_err(|fault| fault.to_string()));
                match read {
                    Ok(document) => document,
                    Err(reason) => {
                        self.gatherer.fault(place, format!("{file:?} is no calibration: {reason}"));
                        return None;
                    }
                }
            }
            other => self.gatherer.read::<CameraDocument>(other, place)?,
        };
        match document.to_camera() {
            Ok(camera) => Some(camera),
            Err(fault) => {
                self.gatherer.fault(format!("{place}{}", fault.place), fault.message);
                None
            }
        }
    }
}

impl Manifest {
    /// From how many median edges on a triangle counts as drawn out, with so many frames; none for never.
    pub(super) fn extruded_times(&self, n_frames: usize) -> Option<f64> {
        let times = self.extruded_times.unwrap_or(if n_frames > 1 { EXTRUDED_TIMES } else { 0.0 });
        (times > 0.0).then_some(times)
    }
}
