//! Texture fields of a mesh that is another from frame to frame: made on the device once a frame, followed picture by picture.
//!
//! The mesh that was made last is the one that is there: two that are asked for in turn are made anew each time. Weights belong to who
//! looks, by the number of a session; those used longest ago go first where all are more than [`MAX_KEPT_BYTES`].

use super::lent_mesh::LentMesh;
use super::passes::{
    Before, ChangingMesh, ChangingMeshPass, DeviceBuffer, DrawInto, FieldsDistancesPass, FieldsTopologyPass,
    MOST_SLOTS, MadeMesh, MeshBuffers, MeshCamera, MeshCarryPass, MeshColorsPass, MeshDepthsPass,
    MeshSightPass, MeshSmoothPass, MeshWeightsPass, OnDevice, Reaching, Recording, ShownBy, WrittenMesh,
};
use super::renderer::made;
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use glam::DVec3;
use std::sync::Arc;
use videofields_picture::plan::{FieldsForm, Followed, Viewer};
use videofields_vision::clock::Timestamp;
use videofields_vision::fields::{Distances, FOLLOW_SECS, MAX_VIEWS, ROUNDS};
use videofields_vision::geometry::{Camera, Distortion};

/// Most bytes of weights of all sessions together.
const MAX_KEPT_BYTES: u64 = 64 << 20;

/// Cameras up to which depth maps have as many texels as the settings say: of more, half as many each way.
const MOST_FINE_MAPS: usize = 16;

/// Who looks at a mesh, and how.
#[derive(Clone, Copy)]
pub(super) struct MeshLook<'a> {
    pub form: FieldsForm,
    pub viewer: Viewer,
    pub followed: Option<Followed>,
    /// Whether weights go on: for the first piece of a picture.
    pub goes_on: bool,
    /// What tells the cameras' gains from those of another picture.
    pub gains: u64,
    /// What the frame's places are relative to.
    pub anchor_in_world: DVec3,
    /// By the mesh's cameras, their places among the frame's.
    pub camera_idx: &'a [u32],
    /// Cameras that are mixed at a place, at most.
    pub most_cameras: usize,
}

/// Weights of a mesh, and where its vertices are by what they are of.
#[derive(Debug)]
struct WeightsOf {
    mesh: u64,
    n_vertices: u32,
    weights: DeviceBuffer,
    homes: DeviceBuffer,
}

impl WeightsOf {
    fn nothing() -> Self {
        let (weights, homes) = (DeviceBuffer::new("mesh weights"), DeviceBuffer::new("mesh homes"));
        Self { mesh: u64::MAX, n_vertices: 0, weights, homes }
    }
}

/// What one who looks saw last, and room for what they see next.
#[derive(Debug)]
struct Session {
    number: Option<u64>,
    cameras: Vec<Arc<Camera>>,
    /// What they see now is the `latest` of both.
    both: [WeightsOf; 2],
    latest: usize,
    /// When it was last drawn.
    at: Option<Timestamp>,
}

impl Session {
    fn new(number: Option<u64>) -> Self {
        let both = [WeightsOf::nothing(), WeightsOf::nothing()];
        Self { number, cameras: Vec::new(), both, latest: 0, at: None }
    }

    fn n_bytes(&self) -> u64 {
        self.both.iter().map(|of| of.weights.n_bytes() + of.homes.n_bytes()).sum()
    }
}

/// Passes whose shaders know the cameras: of lenses that bend, and of none.
#[derive(Debug)]
struct Seeing {
    depths: MeshDepthsPass,
    sight: MeshSightPass,
    colors: MeshColorsPass,
}

/// Passes that are the same for all.
#[derive(Debug)]
struct Along {
    topology: FieldsTopologyPass,
    smooth: MeshSmoothPass,
    weights: MeshWeightsPass,
    carry: MeshCarryPass,
    slots: DeviceBuffer,
    carried: DeviceBuffer,
}

/// Makes and shows texture fields of changing meshes.
#[derive(Debug)]
pub(super) struct MeshFields {
    parameters: GrowingBuffer,
    size: GrowingBuffer,
    positions: GrowingBuffer,
    corners: GrowingBuffer,
    normals: GrowingBuffer,
    homes: GrowingBuffer,
    shifts: GrowingBuffer,
    colors: GrowingBuffer,
    buffers: MeshBuffers,
    /// Of cameras without lenses that bend, and of all.
    seeing: [Option<Seeing>; 2],
    along: Option<Along>,
    distances: Option<FieldsDistancesPass>,
    shown: Option<ChangingMeshPass>,
    /// The mesh whose values the buffers hold, and which of both values are smooth.
    made: Option<(u64, usize)>,
    /// The mesh and the gains whose colours are there.
    colored: Option<(u64, u64)>,
    /// The one used last first.
    sessions: Vec<Session>,
}

/// What was recorded, to be drawn.
pub(super) struct Lent {
    pub mesh: MadeMesh,
    pub weights: wgpu::Buffer,
    pub slots: wgpu::Buffer,
    /// Which of the mesh's values are smooth.
    pub values: usize,
    has_lenses: bool,
}

impl Default for MeshFields {
    fn default() -> Self {
        let storage = |label| GrowingBuffer::new(label, wgpu::BufferUsages::STORAGE);
        let positions = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::VERTEX);
        let corners = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::INDEX);
        let homes = wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC);
        Self {
            parameters: GrowingBuffer::new("mesh", wgpu::BufferUsages::STORAGE),
            size: GrowingBuffer::new("mesh size", wgpu::BufferUsages::STORAGE),
            positions: GrowingBuffer::new("mesh positions", positions),
            corners: GrowingBuffer::new("mesh corners", corners),
            normals: storage("mesh normals"),
            homes: GrowingBuffer::new("mesh homes", homes),
            shifts: storage("mesh shifts"),
            colors: GrowingBuffer::new("mesh own colors", wgpu::BufferUsages::COPY_SRC),
            buffers: MeshBuffers::new(),
            seeing: [None, None],
            along: None,
            distances: None,
            shown: None,
            made: None,
            colored: None,
            sessions: Vec::new(),
        }
    }
}

impl MeshFields {
    /// Records that a mesh's fields are made, where they are not there, and that what its cameras lend goes on to what `look` wants.
    ///
    /// # Errors
    /// Where the device refuses a shader, and of a mesh with more vertices and cameras than its buffers hold.
    pub(super) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        (frame, frame_layout): (&wgpu::BindGroup, &wgpu::BindGroupLayout),
        (mesh, frames): (&LentMesh, &wgpu::TextureView),
        look: &MeshLook<'_>,
    ) -> Result<Lent, GpuError> {
        let gpu = recording.gpu;
        let n @ [n_vertices, n_faces, n_views] = mesh.n();
        let n_entries = u64::from(n_vertices) * u64::from(n_views);
        mesh.check(gpu)?;
        let has_lenses = mesh.cameras.iter().any(|camera| *camera.distortion() != Distortion::None);
        let variant = [("HAS_LENSES", f64::from(u8::from(has_lenses)))];
        let maps_px = maps_px(mesh);
        let place = self.session(look.followed.map(|followed| followed.number));
        let session = &mut self.sessions[place];
        let latest = session.latest;
        let is_same = session.both[latest].mesh == mesh.number;
        let passed_secs = look.followed.and_then(|followed| followed.passed_since(session.at));
        if look.goes_on && passed_secs.is_none_or(|passed| passed > 0.0) {
            session.at = look.followed.map(|followed| followed.instant);
        }
        let is_there = session.both[latest].n_vertices > 0;
        let follow = passed_secs.filter(|_| is_there).map_or(1.0, |secs| -(-secs / FOLLOW_SECS).exp_m1());
        let n_before = if is_same || follow >= 1.0 { 0 } else { session.both[latest].n_vertices };
        let parameters = parameters(mesh, look, &maps_px, (follow, n_before, &session.cameras));
        let on_device = OnDevice {
            size: self.size.write(gpu, &[mesh.size]).clone(),
            of: mesh.size,
            positions: written(&mut self.positions, gpu, (&mesh.positions, self.made), mesh.number),
            corners: written(&mut self.corners, gpu, (&mesh.corners, self.made), mesh.number),
        };
        let written = WrittenMesh {
            parameters: self.parameters.write(gpu, &[parameters]).clone(),
            on_device,
            normals: written(&mut self.normals, gpu, (&mesh.normals, self.made), mesh.number),
            homes: written(&mut self.homes, gpu, (&mesh.homes, self.made), mesh.number),
            shifts: written(&mut self.shifts, gpu, (&mesh.shifts, self.made), mesh.number),
        };
        let on = self.buffers.sized(gpu, n, written);
        let along = made(&mut self.along, || Along::new(gpu))?;
        let values = match self.made {
            Some((number, values)) if number == mesh.number => values,
            _ => {
                // Until all of it is recorded there is none.
                (self.made, self.colored) = (None, None);
                let seeing = made(&mut self.seeing[usize::from(has_lenses)], || {
                    Seeing::new(gpu, frame_layout, &variant)
                })?;
                let maps = seeing.depths.record(recording, frame, (&on, &maps_px));
                let hangs_together = along.topology.record(recording, &on.on_device);
                let has_windows = mesh.has_windows();
                let reaching = match mesh.settings.distances {
                    Distances::Marching => Reaching::Front,
                    _ => Reaching::Seams,
                };
                seeing.sight.record(recording, frame, (&on, reaching), [&maps, frames]);
                if has_windows {
                    let distances = made(&mut self.distances, || FieldsDistancesPass::new(gpu))?;
                    let [begins, found] = &on.distances;
                    let of = (&on.on_device, &hangs_together);
                    distances.record(recording, of, (begins, found), (n_views as usize, ROUNDS));
                }
                let rounds = mesh.settings.smoothing_rounds;
                let distances = usize::from(has_windows);
                let values = along.smooth.record(recording, (&on, &hangs_together), (distances, rounds));
                self.made = Some((mesh.number, values));
                values
            }
        };
        if self.colored != Some((mesh.number, look.gains)) {
            let seeing =
                made(&mut self.seeing[usize::from(has_lenses)], || Seeing::new(gpu, frame_layout, &variant))?;
            let own = (!mesh.colors.is_empty()).then(|| self.colors.write(gpu, &mesh.colors));
            seeing.colors.record(recording, frame, (&on, values), (frames, own));
            self.colored = Some((mesh.number, look.gains));
        }
        let slots = along.slots.sized(gpu, 8 * u64::from(n_faces));
        let session = &mut self.sessions[place];
        if !look.goes_on && is_same {
            let weights = session.both[latest].weights.sized(gpu, 4 * n_entries);
            return Ok(Lent { mesh: on, weights, slots, values, has_lenses });
        }
        // What is kept of the latest is read, the other written.
        let carried = along.carried.sized(gpu, 4 * n_entries);
        let n_latest = session.both[latest].n_vertices;
        let bytes_before = 4 * u64::from(n_latest) * session.cameras.len() as u64;
        let mut before = carried.clone();
        if n_before > 0 {
            let of = &mut session.both[latest];
            let weights = of.weights.sized(gpu, bytes_before);
            let homes = of.homes.sized(gpu, 16 * u64::from(n_latest));
            let from = Before { n_vertices: n_latest, homes: &homes, weights: &weights };
            along.carry.record(recording, (&on, &from), &carried);
        } else if is_same {
            before = session.both[latest].weights.sized(gpu, bytes_before);
        }
        let next = &mut session.both[1 - latest];
        let weights = next.weights.sized(gpu, 4 * n_entries);
        let homes_bytes = 16 * u64::from(n_vertices);
        let homes = next.homes.sized(gpu, homes_bytes);
        if next.mesh != mesh.number {
            recording.encoder.copy_buffer_to_buffer(&on.homes, 0, &homes, 0, homes_bytes);
        }
        (next.mesh, next.n_vertices) = (mesh.number, n_vertices);
        session.latest = 1 - latest;
        session.cameras.clone_from(&mesh.cameras);
        along.weights.record(recording, (&on, values), [&before, &weights, &slots]);
        self.trim();
        Ok(Lent { mesh: on, weights, slots, values, has_lenses })
    }

    /// Records that what was recorded is drawn.
    ///
    /// # Errors
    /// Where the device refuses the shader.
    pub(super) fn show(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        (lent, frames): (&Lent, &wgpu::TextureView),
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let pass = made(&mut self.shown, || Ok(ChangingMeshPass::new(gpu)))?;
        let by = ShownBy { weights: &lent.weights, slots: &lent.slots };
        pass.record(recording, into, (&lent.mesh, &by), (lent.has_lenses, frames))
    }

    /// Forgets what was made, after what was recorded may not have been run.
    pub(super) fn clear(&mut self) {
        (self.made, self.colored) = (None, None);
        self.sessions.clear();
    }

    /// Where a session is, which is the one used last now.
    fn session(&mut self, number: Option<u64>) -> usize {
        let session = match self.sessions.iter().position(|session| session.number == number) {
            Some(place) => self.sessions.remove(place),
            None => Session::new(number),
        };
        self.sessions.insert(0, session);
        0
    }

    /// Lets go of sessions that were used longest ago, never of the latest.
    fn trim(&mut self) {
        let (mut n_bytes, mut is_latest) = (0, true);
        self.sessions.retain(|session| {
            n_bytes += session.n_bytes();
            std::mem::take(&mut is_latest) || n_bytes <= MAX_KEPT_BYTES
        });
    }
}

impl Along {
    fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        Ok(Self {
            topology: FieldsTopologyPass::new(gpu)?,
            smooth: MeshSmoothPass::new(gpu)?,
            weights: MeshWeightsPass::new(gpu)?,
            carry: MeshCarryPass::new(gpu)?,
            slots: DeviceBuffer::new("mesh slots"),
            carried: DeviceBuffer::new("mesh carried"),
        })
    }
}

impl Seeing {
    fn new(
        gpu: &Gpu,
        frame_layout: &wgpu::BindGroupLayout,
        variant: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        Ok(Self {
            depths: MeshDepthsPass::new(gpu, frame_layout, variant)?,
            sight: MeshSightPass::new(gpu, frame_layout, variant)?,
            colors: MeshColorsPass::new(gpu, frame_layout, variant)?,
        })
    }
}

/// A list of the mesh on the device: written where what is there is another's.
fn written<T: bytemuck::NoUninit>(
    buffer: &mut GrowingBuffer,
    gpu: &Gpu,
    (list, made): (&[T], Option<(u64, usize)>),
    number: u64,
) -> wgpu::Buffer {
    match buffer.get() {
        Some(kept) if made.is_some_and(|(made, _)| made == number) => kept.clone(),
        _ => buffer.write(gpu, list).clone(),
    }
}

/// Columns and rows of every camera's depth map.
fn maps_px(mesh: &LentMesh) -> Vec<[u32; 2]> {
    let halves = if mesh.cameras.len() > MOST_FINE_MAPS { 2 } else { 1 };
    let side_px = f64::from((mesh.settings.depth_map_px / halves).max(1));
    let of = |camera: &Arc<Camera>| {
        let (width, height) = camera.size_px();
        let scale = side_px / f64::from(width.max(height));
        [width, height].map(|side| ((f64::from(side) * scale).round() as u32).max(1))
    };
    mesh.cameras.iter().map(of).collect()
}

fn parameters(
    mesh: &LentMesh,
    look: &MeshLook<'_>,
    maps_px: &[[u32; 2]],
    (follow, n_before, cameras_before): (f64, u32, &[Arc<Camera>]),
) -> ChangingMesh {
    let [n_vertices, n_faces, n_views] = mesh.n();
    let mut cameras: [MeshCamera; MAX_VIEWS] = bytemuck::Zeroable::zeroed();
    for (view, to) in cameras.iter_mut().enumerate().take(mesh.cameras.len()) {
        let camera = &mesh.cameras[view];
        let was = cameras_before.iter().position(|known| Arc::ptr_eq(known, camera) || known == camera);
        *to = MeshCamera {
            eye: (camera.pose().position_in_world - mesh.origin_in_world).as_vec3().to_array(),
            camera_idx: look.camera_idx[view],
            map_px: maps_px[view].map(|side| side as f32),
            was: was.map_or(0, |place| place as u32 + 1),
            is_shown: 1,
        };
    }
    let (viewer, is_parallel) = match look.viewer {
        Viewer::At(eye) => (eye - mesh.origin_in_world, 0),
        Viewer::Along { direction, .. } => (-direction, 1),
    };
    ChangingMesh {
        shift: (mesh.origin_in_world - look.anchor_in_world).as_vec3().to_array(),
        n_vertices,
        n_faces,
        n_views,
        reach_m: mesh.reach_m as f32,
        depth_m: mesh.depth_m as f32,
        viewer: viewer.as_vec3().to_array(),
        is_parallel,
        follow: follow as f32,
        is_montage: u32::from(look.form == FieldsForm::Montage),
        visibility: mesh.visibility(),
        has_ramps: u32::from(mesh.settings.distances != Distances::Off),
        n_before,
        n_views_before: cameras_before.len() as u32,
        cell_m: mesh.cell_m as f32,
        table_mask: MeshCarryPass::table_slots(n_before) - 1,
        normal_exponent: mesh.settings.normal_exponent as f32,
        most_cameras: (look.most_cameras as u32).clamp(1, MOST_SLOTS),
        pad_a: 0,
        pad_b: 0,
        cameras,
    }
}
