//! Recorded sequences in a picture: what is kept of each between frames, and their meshes drawn by texture fields.

use super::camera_data::FrameData;
use super::given_mesh::GivenMesh;
use super::mesh_fields::{Lent, MeshFields, MeshLook};
use super::passes::{DrawInto, Recording};
use crate::gpu::{Gpu, GpuError};
use glam::DVec3;
use std::sync::{Arc, Weak};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::Plan;
use videofields_picture::scene::Scene;
use videofields_vision::fields::FieldSettings;
use videofields_vision::fields::Moment;

/// Sequences that are kept: those of a scene, and of one that is looked at in turn.
const MOST_KEPT: usize = 8;

/// Most bytes of cameras' pictures of what is kept and not drawn.
const MAX_BYTES: u64 = 256 << 20;

/// Pictures after which what none of them showed goes.
const MAX_AGE: u64 = 32;

/// What is kept of sequences; each part is made when a plan first calls for it.
#[derive(Debug, Default)]
pub(super) struct Sequences {
    /// The one used last first.
    kept: Vec<Kept>,
    n_given: u64,
    n_pictures: u64,
}

#[derive(Debug)]
struct Kept {
    scene: Weak<Scene>,
    id: Arc<str>,
    /// Where its first mesh was: what places are relative to, from mesh to mesh.
    home_in_world: Option<DVec3>,
    used: u64,
    moment: Weak<Moment>,
    /// None where the device refused it.
    given: Option<GivenMesh>,
    fields: MeshFields,
    /// Which of the frame's cameras its own are.
    camera_idx: Vec<u32>,
    /// Its place among the plan's, where it has one now.
    place: Option<usize>,
}

impl Sequences {
    /// Gives the device what of the plan's sequences it does not have, and adds their cameras to the frame. What the device refuses is told
    /// in the log, and left out.
    pub(super) fn prepare(
        &mut self,
        gpu: &Gpu,
        (state, plan): (&SceneState, &Plan),
        (frame, anchor_in_world): (&mut FrameData, DVec3),
    ) {
        self.n_pictures += 1;
        let n_pictures = self.n_pictures;
        self.kept.retain(|kept| kept.scene.strong_count() > 0 && n_pictures - kept.used <= MAX_AGE);
        self.kept.iter_mut().for_each(|kept| kept.place = None);
        for (place, of) in plan.sequences.iter().enumerate() {
            let Some((id, moment)) =
                state.sequences.get(*of).and_then(|at| Some((&at.id, at.moment.as_ref().ok()?)))
            else {
                continue;
            };
            let is_it =
                |kept: &Kept| std::ptr::eq(kept.scene.as_ptr(), Arc::as_ptr(&state.scene)) && kept.id == *id;
            let known = self.kept.iter().position(is_it);
            let mut kept = known.map_or_else(|| Kept::new(&state.scene, id), |known| self.kept.remove(known));
            kept.used = self.n_pictures;
            if !std::ptr::eq(kept.moment.as_ptr(), Arc::as_ptr(moment)) {
                self.n_given += 1;
                kept.take(gpu, self.n_given, moment);
            }
            kept.place = Some(place);
            kept.camera_idx.clear();
            if let Some(given) = &kept.given {
                kept.camera_idx = given.add_cameras(frame, anchor_in_world);
            }
            self.kept.insert(0, kept);
        }
        self.kept.truncate(MOST_KEPT);
        let mut n_bytes = 0;
        self.kept.retain(|kept| {
            n_bytes += kept.given.as_ref().map_or(0, GivenMesh::n_bytes);
            kept.place.is_some() || n_bytes <= MAX_BYTES
        });
    }

    /// Records the fields of all that the plan has, the first planned first.
    ///
    /// # Errors
    /// What the device refuses.
    pub(super) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        frame: (&wgpu::BindGroup, &wgpu::BindGroupLayout),
        look: &MeshLook<'_>,
    ) -> Result<Vec<Lent>, GpuError> {
        let mut recorded = Vec::new();
        for kept in self.planned() {
            let Some(given) = &kept.given else { continue };
            // Its gains are its own.
            let look = MeshLook { camera_idx: &kept.camera_idx, gains: 0, ..*look };
            recorded.push(kept.fields.record(recording, frame, (&given.mesh, given.pictures()), &look)?);
        }
        Ok(recorded)
    }

    /// Records that one of what [`Self::record`] answered is drawn.
    ///
    /// # Errors
    /// What the device refuses.
    pub(super) fn show(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        (place, lent): (usize, &Lent),
    ) -> Result<(), GpuError> {
        let Some(kept) = self.planned().filter(|kept| kept.given.is_some()).nth(place) else { return Ok(()) };
        let Some(given) = &kept.given else { return Ok(()) };
        let into = DrawInto { has_gains: given.has_gains(), ..*into };
        kept.fields.show(recording, &into, (lent, given.pictures()))
    }

    /// Forgets all of them.
    pub(super) fn clear(&mut self) {
        self.kept.clear();
    }

    fn planned(&mut self) -> impl Iterator<Item = &mut Kept> {
        self.kept.sort_by_key(|kept| kept.place.unwrap_or(usize::MAX));
        self.kept.iter_mut().filter(|kept| kept.place.is_some())
    }
}

impl Kept {
    fn new(scene: &Arc<Scene>, id: &Arc<str>) -> Self {
        Self {
            scene: Arc::downgrade(scene),
            id: Arc::clone(id),
            home_in_world: None,
            used: 0,
            moment: Weak::new(),
            given: None,
            fields: MeshFields::default(),
            camera_idx: Vec::new(),
            place: None,
        }
    }

    fn take(&mut self, gpu: &Gpu, number: u64, moment: &Arc<Moment>) {
        let of = (&moment.mesh, moment.views.as_slice(), &FieldSettings::of_changing());
        self.moment = Arc::downgrade(moment);
        match GivenMesh::new(self.given.take(), gpu, (number, self.home_in_world), of) {
            Ok(given) => {
                self.home_in_world = Some(given.mesh.home_in_world);
                self.given = Some(given);
            }
            Err(error) => {
                tracing::error!(sequence = &*self.id, frame = moment.number, %error, "a sequence's frame is left out");
            }
        }
    }
}
