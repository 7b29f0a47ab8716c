//! What moves in a world as a mesh sequence (docs/sequences.md): a mesh a frame, with what the cameras see and which of it moves.
//!
//! ```text
//! <out>/sequence.json           the manifest
//! <out>/mesh/00000.ply          everybody, frame by frame
//! <out>/<camera>/00000.png      what the camera saw, without effects of its sensor
//! <out>/<camera>/mask/00000.png 255 where that is somebody, else 0
//! ```

use std::path::PathBuf;
use videofields_service::sequence::{
    CameraEntry, FilesDocument, MANIFEST, MeshesDocument, SequenceDocument, VERSION,
};
use videofields_simulate::{SimulateError, World, make_folder, save_mask, save_rgb, write_file};
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::frame::Mask;

/// What of a world is written as a mesh sequence, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceOptions {
    /// The folder; made if it is not there. Files of the same names are replaced.
    pub out_dir: PathBuf,
    /// When it begins, seconds of the world's time. Default 0.
    pub from_secs: f64,
    /// How long it is, seconds above 0, up to 86400. Default 2.
    pub seconds: f64,
    /// Frames a second, 0.1 to 240. Default 10.
    pub rate_hz: f64,
    /// Columns and rows of all cameras' pictures. Default: each camera's own.
    pub size_px: Option<(u32, u32)>,
    /// Samples a pixel, each way, 1 to 16. Default 2.
    pub samples_per_side: u32,
    /// About how large triangles are, 0.005 to 0.5 m. Default 0.03.
    pub step_m: f64,
}

impl SequenceOptions {
    /// The defaults, written to `out_dir`.
    #[must_use]
    pub fn new(out_dir: impl Into<PathBuf>) -> Self {
        Self {
            out_dir: out_dir.into(),
            from_secs: 0.0,
            seconds: 2.0,
            rate_hz: 10.0,
            size_px: None,
            samples_per_side: 2,
            step_m: 0.03,
        }
    }
}

/// Writes what moves in a world as a mesh sequence; `progress` hears after each frame how many of how many there are. Answers how many
/// frames there are.
///
/// # Errors
/// When an option is out of its range, or a file cannot be written.
pub fn write_sequence(
    world: &World,
    options: &SequenceOptions,
    mut progress: impl FnMut(u64, u64),
) -> Result<u64, SimulateError> {
    let outside = |field, allowed| Err(SimulateError::View { field, allowed });
    if !(0.1..=240.0).contains(&options.rate_hz) {
        return outside("the rate", "0.1 to 240 frames a second");
    }
    if !(options.seconds > 0.0 && options.seconds <= 86_400.0) {
        return outside("the length", "above 0 and at most 86400 seconds");
    }
    if !options.from_secs.is_finite() {
        return Err(SimulateError::Time);
    }
    let n_frames = ((options.seconds * options.rate_hz).round() as u64).max(1);
    make_folder(&options.out_dir.join("mesh"))?;
    let mut plates = Vec::new();
    let mut entries = Vec::new();
    for (id, camera) in world.cameras_at(options.size_px)? {
        make_folder(&options.out_dir.join(id).join("mask"))?;
        let pictures = |pattern: String| FilesDocument { pattern: Some(pattern), ..FilesDocument::default() };
        entries.push(CameraEntry {
            id: id.to_owned(),
            calibration: serde_json::to_value(CameraDocument::from_camera(&camera))?,
            pictures: pictures(format!("{id}/%05d.png")),
            masks: Some(pictures(format!("{id}/mask/%05d.png"))),
        });
        plates.push((id, world.plate(&camera, options.samples_per_side)?));
    }
    for frame in 0..n_frames {
        let time_secs = options.from_secs + frame as f64 / options.rate_hz;
        let path = options.out_dir.join(format!("mesh/{frame:05}.ply"));
        let mesh = world.figures_mesh(time_secs, options.step_m)?;
        let mut bytes = Vec::new();
        mesh.write_ply(&mut bytes)
            .and_then(|()| std::fs::write(&path, bytes))
            .map_err(|source| SimulateError::File { path, source })?;
        for (id, plate) in &plates {
            let truth = world.render_over(plate, time_secs)?;
            let folder = options.out_dir.join(id);
            save_rgb(&folder.join(format!("{frame:05}.png")), &truth.rgb)?;
            let somebody = truth.instance.data.iter().map(|of| u8::from(*of > 0) * u8::MAX);
            let mask = Mask { data: somebody.collect::<Vec<u8>>().into(), ..truth.instance };
            save_mask(&folder.join("mask").join(format!("{frame:05}.png")), &mask)?;
        }
        progress(frame + 1, n_frames);
    }
    let document = SequenceDocument {
        version: VERSION,
        name: world.name().to_owned(),
        start: None,
        rate_hz: Some(options.rate_hz),
        times_secs: None,
        meshes: MeshesDocument { pattern: Some("mesh/%05d.ply".to_owned()), ..MeshesDocument::default() },
        cameras: entries,
    };
    write_file(&options.out_dir.join(MANIFEST), &format!("{}\n", serde_json::to_string_pretty(&document)?))?;
    Ok(n_frames)
}
