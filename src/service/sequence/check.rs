//! What is in a sequence, and what is wrong with it: every frame and every picture read once.

use super::Sequence;
use glam::DVec3;
use serde::Serialize;
use std::collections::BTreeSet;
use videofields_vision::error::{Fault, pointer_to};
use videofields_vision::geometry::is_stretched;
use videofields_vision::mesh::Mended;

/// Most faults that are told; the rest is counted.
const MOST_FAULTS: usize = 64;

/// What is in a sequence.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SequenceCheck {
    /// Frames that there are.
    pub n_frames: usize,
    /// Numbers between the first and the last of which there is no mesh, first and last of each run.
    pub missing: Vec<[u64; 2]>,
    /// From the first frame to the last, seconds.
    pub duration_secs: f64,
    /// Least and most triangles of a frame.
    pub n_triangles: Option<[usize; 2]>,
    /// Frames whose mesh has none.
    pub n_empty: usize,
    /// Frames whose points or triangles differ in number from those of the frame before.
    pub n_changed: usize,
    /// Superfluous points of all frames.
    pub n_points_mended: usize,
    /// Superfluous triangles of all frames.
    pub n_triangles_mended: usize,
    /// Triangles of all frames that were drawn out, and are not coloured.
    pub n_extruded: usize,
    /// Low and high corner of the box around all frames, metres, in the world.
    pub bounds_m: Option<[[f64; 3]; 2]>,
    /// Camera by camera.
    pub cameras: Vec<CameraCheck>,
    /// What is wrong, by frame or camera: what cannot be read. Not more than 64 are told.
    pub faults: Vec<String>,
    /// Faults in all.
    pub n_faults: usize,
}

/// What a camera of a sequence has.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CameraCheck {
    /// Its id.
    pub id: String,
    /// Pictures that were read.
    pub n_pictures: usize,
    /// Frames of which it has none.
    pub n_missing: usize,
    /// All sizes of its pictures, columns and rows.
    pub sizes_px: Vec<[u32; 2]>,
    /// Whether they have another aspect than the picture that was calibrated.
    pub is_stretched: bool,
}

impl SequenceCheck {
    fn fault(&mut self, text: String) {
        self.n_faults += 1;
        if self.faults.len() < MOST_FAULTS {
            self.faults.push(text);
        }
    }
}

/// Reads all of a sequence, one frame after the other, and tells `progress` after each how many were read.
///
/// **Cost** all its files are read and decoded once; one frame is in memory at a time.
pub fn check(sequence: &mut Sequence, mut progress: impl FnMut(usize)) -> SequenceCheck {
    let extent = sequence.extent();
    let mut found = SequenceCheck {
        n_frames: sequence.frames().len(),
        missing: sequence.missing().to_vec(),
        duration_secs: extent.first.map_or(0.0, |first| extent.live.secs_since(first)),
        ..SequenceCheck::default()
    };
    let of_cameras = sequence.cameras().iter();
    found.cameras = of_cameras
        .map(|camera| CameraCheck { id: camera.id.to_string(), ..CameraCheck::default() })
        .collect();
    let mut sizes: Vec<BTreeSet<[u32; 2]>> = vec![BTreeSet::new(); found.cameras.len()];
    let mut before: Option<[usize; 2]> = None;
    let mut bounds: Option<[DVec3; 2]> = None;
    for idx in 0..sequence.frames().len() {
        match sequence.mesh(idx) {
            Ok(frame) => {
                let Mended { n_points, n_triangles } = frame.mended;
                found.n_points_mended += n_points;
                found.n_triangles_mended += n_triangles;
                found.n_extruded += frame.n_extruded;
                let size = [frame.mesh.positions_m.len(), frame.mesh.triangles.len()];
                found.n_empty += usize::from(size[1] == 0);
                found.n_changed += usize::from(before.is_some_and(|before| before != size));
                before = Some(size);
                let [least, most] = found.n_triangles.unwrap_or([size[1]; 2]);
                found.n_triangles = Some([least.min(size[1]), most.max(size[1])]);
                if let Some([low, high]) = frame.mesh.bounds() {
                    let [lowest, highest] = bounds.unwrap_or([low, high]);
                    bounds = Some([lowest.min(low), highest.max(high)]);
                }
            }
            Err(error) => found.fault(error.to_string()),
        }
        for (camera, sizes) in sizes.iter_mut().enumerate() {
            picture(sequence, (idx, camera), &mut found, sizes);
        }
        progress(idx + 1);
    }
    for (camera, sizes) in found.cameras.iter_mut().zip(sizes) {
        camera.sizes_px = sizes.into_iter().collect();
    }
    for camera in 0..found.cameras.len() {
        let (width, height) = sequence.cameras()[camera].camera.size_px();
        let is_other = |size: &[u32; 2]| is_stretched((width, height), (size[0], size[1]));
        if let Some([columns, rows]) = found.cameras[camera].sizes_px.iter().copied().find(is_other) {
            found.cameras[camera].is_stretched = true;
            let place = pointer_to("/cameras", &camera.to_string());
            let message = format!("a picture of {columns} x {rows}, but {width} x {height} was calibrated");
            found.fault(Fault::new(place, message).to_string());
        }
    }
    found.bounds_m = bounds.map(|corners| corners.map(|corner| corner.to_array()));
    found
}

fn picture(
    sequence: &mut Sequence,
    (idx, camera): (usize, usize),
    found: &mut SequenceCheck,
    sizes: &mut BTreeSet<[u32; 2]>,
) {
    let number = sequence.frames()[idx].number;
    let id = found.cameras[camera].id.clone();
    match sequence.picture(idx, camera) {
        Ok(Some(picture)) => {
            found.cameras[camera].n_pictures += 1;
            sizes.insert([picture.width, picture.height]);
            if let Err(error) = sequence.mask(idx, camera) {
                found.fault(format!("frame {number}, camera {id}: its mask: {error}"));
            }
        }
        Ok(None) => found.cameras[camera].n_missing += 1,
        Err(error) => found.fault(format!("frame {number}, camera {id}: {error}")),
    }
}
