//! A sequence that was opened: what there is of it, and reading it frame by frame.

use super::SequenceError;
use super::document::MANIFEST;
use super::frames::{Frame, Frames};
use super::manifest::{Manifest, read};
use super::meshes::{self, FrameMesh, MeshesAs};
use super::pictures::{Pictures, mask_of};
use std::path::{Path, PathBuf};
use videofields_picture::scene::MAX_DOCUMENT_BYTES;
use videofields_recording::ingest::{IngestError, MediaRoots, read_bytes};
use videofields_recording::timeline::Extent;
use videofields_vision::calibrate::MAX_BYTES;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::Fault;
use videofields_vision::frame::{CameraId, Mask, RgbImage};
use videofields_vision::geometry::Camera;

/// A mesh sequence. Nothing but its manifest, the calibrations that it names and the list of its files is in memory; videos that are
/// being decoded hold two pictures each.
#[derive(Debug)]
pub struct Sequence {
    path: PathBuf,
    name: String,
    start: Timestamp,
    frames: Frames,
    cameras: Vec<SequenceCamera>,
    how: MeshesAs,
    roots: MediaRoots,
}

/// A camera of a sequence.
#[derive(Debug)]
pub struct SequenceCamera {
    /// Its id.
    pub id: CameraId,
    /// Its calibration.
    pub camera: Camera,
    pictures: Pictures,
    masks: Option<Pictures>,
}

impl Sequence {
    /// Opens the manifest at `path`, or the one in the folder `path`; files are opened beneath `roots` alone.
    ///
    /// # Errors
    /// Where the manifest is not to be read, with every fault of it, and where it has no frame.
    pub fn open(path: &Path, roots: &MediaRoots) -> Result<Self, SequenceError> {
        let path = if path.is_dir() { path.join(MANIFEST) } else { path.to_path_buf() };
        let faulty = |faults| SequenceError::Faults { path: path.clone(), faults };
        let bytes = read_bytes(&path, roots, MAX_DOCUMENT_BYTES as u64 + 1)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let byte = error.utf8_error().valid_up_to();
            faulty(vec![Fault::new("", format!("the manifest must be UTF-8, but byte {byte} is not"))])
        })?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or_else(|| Path::new("."));
        let read_text = |file: &Path| {
            let bytes = read_bytes(file, roots, MAX_BYTES as u64).map_err(|error| error.to_string())?;
            String::from_utf8(bytes).map_err(|error| error.to_string())
        };
        let manifest = read(&text, folder, &read_text).map_err(faulty)?;
        let frames = Frames::find(&manifest, &path, roots)?;
        let how = MeshesAs {
            metres_per_unit: manifest.metres_per_unit,
            up: manifest.up,
            extruded_times: manifest.extruded_times(frames.all.len()),
        };
        let Manifest { name, start, cameras, .. } = manifest;
        let cameras = cameras
            .into_iter()
            .map(|camera| SequenceCamera {
                id: camera.id,
                camera: camera.camera,
                pictures: Pictures::new(&camera.pictures, roots),
                masks: camera.masks.map(|masks| Pictures::new(&masks, roots)),
            })
            .collect();
        Ok(Self { path, name, start, frames, cameras, how, roots: roots.clone() })
    }

    /// The manifest's path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its frames in order; never empty.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames.all
    }

    /// First and last of each run of numbers between the first frame and the last of which there is no mesh.
    #[must_use]
    pub fn missing(&self) -> &[[u64; 2]] {
        &self.frames.missing
    }

    /// Its cameras.
    #[must_use]
    pub fn cameras(&self) -> &[SequenceCamera] {
        &self.cameras
    }

    /// When its first and its last frame are: where playheads may be.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.frames.extent()
    }

    /// Which of [`Self::frames`] answers for an instant: the nearest within 1 s, or within twice its distance to the one beside it. Of a
    /// sequence of one frame that one always.
    ///
    /// # Errors
    /// Where none does, with the gap's ends.
    pub fn frame_at(&self, at: Timestamp) -> Result<usize, SequenceError> {
        self.frames.at(at)
    }

    /// The same without some of its cameras.
    #[must_use]
    pub fn without(mut self, cameras: &[CameraId]) -> Self {
        self.cameras.retain(|camera| !cameras.contains(&camera.id));
        self
    }

    /// Reads a frame's mesh.
    ///
    /// # Errors
    /// With the frame's number and file, where that is no mesh.
    ///
    /// # Panics
    /// Of a frame that is not there.
    pub fn mesh(&self, idx: usize) -> Result<FrameMesh, SequenceError> {
        meshes::read(&self.frames.all[idx], self.how, &self.roots)
    }

    /// Reads what a camera showed at a frame; none where there is no picture of that frame.
    ///
    /// # Errors
    /// Where there is one that cannot be read.
    ///
    /// # Panics
    /// Of a frame or camera that is not there.
    pub fn picture(&mut self, idx: usize, camera: usize) -> Result<Option<RgbImage>, IngestError> {
        self.cameras[camera].pictures.picture(&self.frames.all[idx], self.start, &self.roots)
    }

    /// Reads what of a camera's picture is of the mesh: 0 is not; none where no mask is named.
    ///
    /// # Errors
    /// Where one is named that is not there, or cannot be read.
    ///
    /// # Panics
    /// Of a frame or camera that is not there.
    pub fn mask(&mut self, idx: usize, camera: usize) -> Result<Option<Mask>, IngestError> {
        let frame = &self.frames.all[idx];
        let Some(masks) = &mut self.cameras[camera].masks else { return Ok(None) };
        match masks.picture(frame, self.start, &self.roots)? {
            Some(mask) => Ok(Some(mask_of(&mask))),
            None => Err(IngestError::NotFound { path: masks.file(frame).unwrap_or_default() }),
        }
    }
}
