//! `sequence from-colmap`, `sequence from-set`: manifests for meshes, cameras and pictures that others have.

use crate::commands::pictures::{ending, find, import_cameras, short};
use crate::commands::{complain, say};
use anyhow::{Context as _, Result, bail, ensure};
use glam::DVec3;
use std::path::{Path, PathBuf};
use videofields_service::sequence::{
    CameraEntry, FilesDocument, MANIFEST, MeshesDocument, SequenceDocument, Up, VERSION,
};
use videofields_vision::calibrate::{CameraDocument, PictureCamera, SetFormat, import_colmap};
use videofields_vision::fields::MAX_VIEWS;
use videofields_vision::geometry::{Camera, Pose};

/// Endings of files that are pictures, not videos.
const PICTURES: [&str; 3] = ["png", "jpg", "jpeg"];

/// Makes a sequence of a COLMAP model and a mesh.
///
/// The model is the folder with cameras and images, .txt or .bin (sparse/0); its points are not needed. The mesh is in the model's units
/// and axes. Lenses that are none of ours are refused by name.
#[derive(Debug, clap::Args)]
pub(super) struct FromColmap {
    /// The folder of the model.
    #[arg(long, value_name = "DIR")]
    model: PathBuf,
    /// The folder that the pictures' paths start at.
    #[arg(long, value_name = "DIR")]
    images: PathBuf,
    #[command(flatten)]
    to: To,
}

/// Makes a sequence of cameras in a format of picture sets, meshes, and pictures or videos.
///
/// Cameras are read as `hull` and `montage` read them. Pictures are those of the cameras' names in --images; or --pictures is a path in
/// which {camera} stands for a camera's name, and which may have a number: cam/{camera}/%05d.jpg, {camera}/video.avi.
#[derive(Debug, clap::Args)]
pub(super) struct FromSet {
    /// The cameras' file.
    #[arg(long, value_name = "FILE")]
    cameras: PathBuf,
    /// middlebury, opencv, kitti or nerf; told from the text if absent.
    #[arg(long)]
    format: Option<SetFormat>,
    /// Folder of one picture a camera.
    #[arg(long, value_name = "DIR", required_unless_present = "pictures")]
    images: Option<PathBuf>,
    /// Path of each camera's pictures or video, with {camera} for its name.
    #[arg(long, value_name = "PATH", conflicts_with = "images")]
    pictures: Option<String>,
    /// Path of each camera's masks, as --pictures.
    #[arg(long, value_name = "PATH")]
    masks: Option<String>,
    /// What is added to a mesh's number to get its picture's.
    #[arg(long, value_name = "NUMBER", allow_hyphen_values = true)]
    number_offset: Option<i64>,
    /// Pictures a second of videos, where their own times are not to be used.
    #[arg(long, value_name = "RATE")]
    video_rate_hz: Option<f64>,
    /// When the videos begin, seconds after the first mesh.
    #[arg(long, value_name = "SECONDS", allow_hyphen_values = true)]
    video_offset: Option<f64>,
    #[command(flatten)]
    to: To,
}

/// What all converters ask for.
#[derive(Debug, clap::Args)]
struct To {
    /// The mesh, or with a number meshes: mesh/%05d.ply; .ply, .obj, .gltf or .glb.
    #[arg(long, value_name = "FILE|PATTERN")]
    mesh: PathBuf,
    /// Meshes a second, where there are several.
    #[arg(long, value_name = "RATE")]
    rate_hz: Option<f64>,
    /// Which of the set's axes is up: x, -x, y, -y, z, -z, or auto: the one that is nearest to what is up in the pictures.
    #[arg(long, value_name = "AXIS", default_value = "auto", allow_hyphen_values = true, value_parser = parse_up)]
    up: Wanted,
    /// Length of the set's unit in metres.
    #[arg(long, value_name = "METRES", default_value_t = 1.0)]
    metres_per_unit: f64,
    /// Most cameras; of more, as many are taken at even distances.
    #[arg(long, value_name = "COUNT", default_value_t = MAX_VIEWS as u16, value_parser = clap::value_parser!(u16).range(1..=MAX_VIEWS as i64))]
    most_cameras: u16,
    /// What the sequence is called.
    #[arg(long, default_value = "")]
    name: String,
    /// The manifest to write, or the folder for it; made if it is not there.
    #[arg(long, value_name = "FILE|DIR")]
    out: PathBuf,
}

/// Which axis is up.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    Auto,
    Axis(Up),
}

fn parse_up(text: &str) -> Result<Wanted, String> {
    if text == "auto" { Ok(Wanted::Auto) } else { text.parse().map(Wanted::Axis) }
}

impl FromColmap {
    pub(super) fn run(self) -> Result<()> {
        let file = |stem: &str| -> Result<Vec<u8>> {
            let found = ["bin", "txt"].map(|ending| self.model.join(stem).with_extension(ending));
            let path = found.iter().find(|path| path.is_file()).with_context(|| {
                format!("{}: there is neither {stem}.bin nor {stem}.txt", self.model.display())
            })?;
            std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
        };
        let cameras = import_colmap(&file("cameras")?, &file("images")?, self.to.metres_per_unit)
            .with_context(|| format!("cannot import {}", self.model.display()))?;
        let cameras = self.to.some_of(cameras, |name| {
            let path = self.images.join(name);
            path.is_file().then_some(path)
        });
        let files = |path: &Path| {
            Ok(FilesDocument { list: Some(vec![Some(shown(path)?)]), ..FilesDocument::default() })
        };
        self.to.write(cameras, files, |_| Ok(None))
    }
}

impl FromSet {
    pub(super) fn run(self) -> Result<()> {
        let folders: Vec<&Path> = self.images.iter().map(PathBuf::as_path).collect();
        let unit = (self.to.metres_per_unit != 1.0).then_some(self.to.metres_per_unit);
        let cameras = import_cameras(&self.cameras, self.format, &folders, unit)?;
        let path_of = |name: &str| match (&self.images, &self.pictures) {
            (Some(folder), _) => find(folder, name),
            (None, Some(template)) => {
                let path = PathBuf::from(template.replace("{camera}", name));
                (is_pattern(&path) || path.is_file()).then_some(path)
            }
            (None, None) => None,
        };
        let cameras = self.to.some_of(cameras, path_of);
        let masks = |name: &str| {
            let path = self.masks.as_ref().map(|template| PathBuf::from(template.replace("{camera}", name)));
            path.map(|path| self.files(&path)).transpose()
        };
        self.to.write(cameras, |path| self.files(path), masks)
    }

    fn files(&self, path: &Path) -> Result<FilesDocument> {
        let file = shown(path)?;
        let empty = FilesDocument::default();
        Ok(if is_pattern(path) {
            FilesDocument { pattern: Some(file), number_offset: self.number_offset, ..empty }
        } else if PICTURES.contains(&ending(path).as_str()) {
            ensure!(
                !is_pattern(&self.to.mesh),
                "{}: one picture for several meshes; give a pattern or a video",
                path.display()
            );
            FilesDocument { list: Some(vec![Some(file)]), ..empty }
        } else {
            FilesDocument {
                video: Some(file),
                rate_hz: self.video_rate_hz,
                offset_secs: self.video_offset,
                ..empty
            }
        })
    }
}

/// Whether a path has a number.
fn is_pattern(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().contains(&b'%'))
}

/// A path as manifests have it from anywhere.
fn shown(path: &Path) -> Result<String> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let folder = folder.canonicalize().with_context(|| format!("cannot read {}", folder.display()))?;
    let full = folder.join(path.file_name().with_context(|| format!("{} names no file", path.display()))?);
    full.into_os_string()
        .into_string()
        .ok()
        .with_context(|| format!("{}: the path must be UTF-8", path.display()))
}

impl To {
    /// Cameras with their pictures, no more than are wanted; what is left out is told.
    fn some_of(
        &self,
        cameras: Vec<PictureCamera>,
        path_of: impl Fn(&str) -> Option<PathBuf>,
    ) -> Vec<(PictureCamera, PathBuf)> {
        let n_all = cameras.len();
        let mut found: Vec<(PictureCamera, PathBuf)> = cameras
            .into_iter()
            .filter_map(|camera| {
                let path = path_of(&camera.name);
                if path.is_none() {
                    complain(&format!("camera {} has no picture and is left out", camera.name));
                }
                Some((camera, path?))
            })
            .collect();
        let most = usize::from(self.most_cameras);
        if found.len() > most {
            let n_found = found.len();
            let mut idx = 0;
            found.retain(|_| {
                idx += 1;
                idx * most / n_found > (idx - 1) * most / n_found
            });
            complain(&format!("{most} of {n_all} cameras are taken"));
        }
        found
    }

    fn write(
        &self,
        cameras: Vec<(PictureCamera, PathBuf)>,
        files: impl Fn(&Path) -> Result<FilesDocument>,
        masks: impl Fn(&str) -> Result<Option<FilesDocument>>,
    ) -> Result<()> {
        ensure!(!cameras.is_empty(), "no camera has a picture");
        ensure!(
            self.rate_hz.is_some() == is_pattern(&self.mesh),
            "--rate-hz goes with several meshes (--mesh with a number), which need it"
        );
        if !is_pattern(&self.mesh) {
            ensure!(self.mesh.is_file(), "--mesh {}: there is no such file", self.mesh.display());
        }
        let up = match self.up {
            Wanted::Axis(up) => up,
            Wanted::Auto => {
                // Up in a picture is against its camera's y axis.
                let ups = cameras.iter().map(|(of, _)| of.camera.pose().world_from_local * DVec3::NEG_Y);
                let up = Up::nearest(ups.sum());
                complain(&format!("{up} of the set is nearest to what is up in its pictures"));
                up
            }
        };
        let (folder, path) = match self.out.extension() {
            Some(ending) if ending == "json" => {
                (self.out.parent().unwrap_or(Path::new("")), self.out.clone())
            }
            _ => (self.out.as_path(), self.out.join(MANIFEST)),
        };
        if !folder.as_os_str().is_empty() {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let mut entries: Vec<CameraEntry> = Vec::new();
        for (PictureCamera { name, camera }, pictures) in cameras {
            entries.push(CameraEntry {
                id: id_of(&short(&name), &entries)?,
                calibration: serde_json::to_value(CameraDocument::from_camera(&turned(&camera, up)?))?,
                pictures: files(&pictures)?,
                masks: masks(&name)?,
            });
        }
        let n_cameras = entries.len();
        let mesh = Some(shown(&self.mesh)?);
        let (pattern, list) = if is_pattern(&self.mesh) { (mesh, None) } else { (None, Some(vec![mesh])) };
        let document = SequenceDocument {
            version: VERSION,
            name: self.name.clone(),
            start: None,
            rate_hz: self.rate_hz,
            times_secs: None,
            meshes: MeshesDocument {
                pattern,
                list,
                metres_per_unit: (self.metres_per_unit != 1.0).then_some(self.metres_per_unit),
                up: Some(up.name().to_owned()),
                extruded_times: None,
            },
            cameras: entries,
        };
        let text = format!("{}\n", serde_json::to_string_pretty(&document)?);
        std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        // What was written is what can be read.
        let sequence = super::open(&path)?;
        say(&format!("{}: {} frames, {n_cameras} cameras", path.display(), sequence.frames().len()))
    }
}

/// The camera where the set's axis that is up is the world's z.
fn turned(camera: &Camera, up: Up) -> Result<Camera> {
    let Pose { position_in_world, world_from_local } = *camera.pose();
    let pose = Pose {
        position_in_world: up.turned(position_in_world),
        world_from_local: (up.world_from_file() * world_from_local).normalize(),
    };
    Ok(Camera::new(camera.size_px(), camera.focal_px(), camera.center_px(), *camera.distortion(), pose)?)
}

/// An id that is as like a name as ids can be, and no other's.
fn id_of(name: &str, others: &[CameraEntry]) -> Result<String> {
    let allowed = |char: char| if char.is_ascii_alphanumeric() || char == '_' { char } else { '-' };
    let id: String = name.to_ascii_lowercase().chars().map(allowed).collect();
    let id: String = id.trim_start_matches(['-', '_']).chars().take(56).collect();
    let id = if id.is_empty() { "camera".to_owned() } else { id };
    let is_free = |id: &String| others.iter().all(|other| other.id != *id);
    let ids = std::iter::once(id.clone()).chain((2..=MAX_VIEWS + 1).map(|n| format!("{id}-{n}")));
    match ids.into_iter().find(is_free) {
        Some(id) => Ok(id),
        None => bail!("too many cameras are called {name}"),
    }
}
