//! How much each camera lends to the vertices of a scene's fine mesh: texture fields, for one who looks from somewhere.
//!
//! Weights follow one who looks from picture to picture: they are kept by the session's number, the ones used last up to a bound in
//! bytes. Pictures of nobody's session are of fields that have settled.

use super::Recording;
use super::compute::{Access, bind, dispatch, layout, pipelines};
use crate::field_mesh::FieldMesh;
use crate::gpu::{Gpu, GpuError, GrowingBuffer, mirror};
use glam::Vec3;
use videofields_picture::plan::{FieldsForm, Followed, Viewer};
use videofields_vision::fields::{FOLLOW_SECS, MAX_VIEWS};

const LABEL: &str = "fields";

/// Most cameras that lend to one vertex: what a list of the surfaces' holds.
pub(crate) const FIELD_SLOTS: usize = videofields_picture::plan::MAX_BLENDED_CAMERAS;

/// In place of a camera where a group has fewer.
pub(crate) const NO_FIELD_VIEW: u32 = u32::MAX;

/// Bytes that one vertex' weights take.
const LENT_BYTES: u64 = (FIELD_SLOTS * size_of::<f32>()) as u64;

/// Most bytes of weights of all sessions together; the one used longest ago goes first, and begins anew.
const MAX_KEPT_BYTES: u64 = 128 << 20;

mirror! { "render/fields.wgsl",
/// What changes from picture to picture. The shader documents the fields.
pub(super) struct FieldFrame {
    viewer: [f32; 3],
    is_parallel: u32,
    n_vertices: u32,
    most_cameras: u32,
    depth_m: f32,
    follow: f32,
    is_montage: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
    eyes: [[f32; 4]; MAX_VIEWS],
}}

mirror! { "render/fields.wgsl",
/// A vertex with what each camera of its group has to do with it. The shader documents the fields.
pub(crate) struct FieldVertex {
    position: [f32; 3],
    group: u32,
    ramps_low: [f32; 4],
    ramps_high: [f32; 4],
    normals_low: [f32; 4],
    normals_high: [f32; 4],
    pixels_low: [f32; 4],
    pixels_high: [f32; 4],
    fallback_low: [f32; 4],
    fallback_high: [f32; 4],
}}

/// What each camera of a group has to do with a vertex.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FieldSlots {
    /// How far from its seams, 0 to 1; 0 of who does not see it.
    pub ramps: [f32; FIELD_SLOTS],
    /// What it lends by normals alone.
    pub normals: [f32; FIELD_SLOTS],
    /// How large its pixels are on the surface, metres; of who does not see it they may be infinite.
    pub pixels_m: [f32; FIELD_SLOTS],
    /// What it lends where fields give way.
    pub fallback: [f32; FIELD_SLOTS],
}

mirror! { "render/fields.wgsl",
/// The cameras of a group, the best first.
pub(crate) struct FieldGroup {
    low: [u32; 4],
    high: [u32; 4],
}}

/// The first four and the last four.
fn halves<T: Copy>(of: [T; FIELD_SLOTS]) -> [[T; 4]; 2] {
    [[0, 1, 2, 3], [4, 5, 6, 7]].map(|places| places.map(|place: usize| of[place]))
}

impl FieldGroup {
    /// Of cameras by their places among the field's.
    pub(crate) fn of(views: [u32; FIELD_SLOTS]) -> Self {
        let [low, high] = halves(views);
        Self { low, high }
    }
}

impl FieldVertex {
    pub(crate) fn new(position: Vec3, group: u32, slots: &FieldSlots) -> Self {
        let finite = |pixel_m: f32| if pixel_m.is_finite() { pixel_m } else { f32::MAX.sqrt() };
        let [ramps_low, ramps_high] = halves(slots.ramps);
        let [normals_low, normals_high] = halves(slots.normals);
        let [pixels_low, pixels_high] = halves(slots.pixels_m.map(finite));
        let [fallback_low, fallback_high] = halves(slots.fallback);
        let position = position.to_array();
        Self {
            position,
            group,
            ramps_low,
            ramps_high,
            normals_low,
            normals_high,
            pixels_low,
            pixels_high,
            fallback_low,
            fallback_high,
        }
    }
}

/// Whose fields are wanted, of how many cameras, seen from where.
#[derive(Clone, Copy)]
pub(crate) struct FieldsWanted<'a> {
    pub form: FieldsForm,
    pub viewer: Viewer,
    /// By the field's views: whether each has a picture now.
    pub is_shown: &'a [bool],
    pub most_cameras: usize,
    pub followed: Option<Followed>,
    /// Whether weights go on: for the first piece of a picture.
    pub goes_on: bool,
}

/// Weights of one who looks.
#[derive(Debug)]
struct Kept {
    session: Option<u64>,
    mesh: u64,
    weights: wgpu::Buffer,
}

/// Finds the weights of fields.
#[derive(Debug)]
pub(crate) struct FieldsPass {
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
    frame: GrowingBuffer,
    vertices: GrowingBuffer,
    groups: GrowingBuffer,
    /// Of which mesh both are.
    written: Option<u64>,
    /// The one used last first.
    kept: Vec<Kept>,
}

impl FieldsPass {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let layout = layout(gpu, LABEL, &[Access::Read, Access::Read, Access::Write]);
        let [pipeline] = pipelines(gpu, LABEL, &layout, ["cs_main"])?;
        Ok(Self {
            layout,
            pipeline,
            frame: GrowingBuffer::new("fields frame", wgpu::BufferUsages::STORAGE),
            vertices: GrowingBuffer::new("fields vertices", wgpu::BufferUsages::STORAGE),
            groups: GrowingBuffer::new("fields groups", wgpu::BufferUsages::STORAGE),
            written: None,
            kept: Vec::new(),
        })
    }

    /// Records that weights go on to what is wanted, unless they did for this picture; answers them, eight a vertex, to be drawn with.
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        mesh: &FieldMesh,
        wanted: &FieldsWanted<'_>,
    ) -> wgpu::Buffer {
        let gpu = recording.gpu;
        let (weights, is_new) = self.weights_of(gpu, mesh, wanted.followed.map(|followed| followed.number));
        let passed_secs = wanted.followed.and_then(|followed| followed.passed_secs).filter(|_| !is_new);
        let follow = passed_secs.map_or(1.0, |secs| -(-secs / FOLLOW_SECS).exp_m1());
        if mesh.lent.is_empty() || !(wanted.goes_on || is_new) {
            return weights;
        }
        let frame = self.frame.write(gpu, &[frame_of(mesh, wanted, follow)]).clone();
        if self.written != Some(mesh.number) {
            self.vertices.write(gpu, &mesh.lent);
            self.groups.write(gpu, &mesh.groups);
            self.written = Some(mesh.number);
        }
        let written = |buffer: &GrowingBuffer| buffer.get().expect("they have been written").clone();
        let (vertices, groups) = (written(&self.vertices), written(&self.groups));
        let group = bind(gpu, (LABEL, &self.layout), &[&frame, &vertices, &groups, &weights]);
        let span = recording.timer.span(LABEL);
        let writes = recording.timer.compute_writes(span);
        let mut pass = gpu.begin_compute_pass(recording.encoder, LABEL, writes);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        dispatch(&mut pass, mesh.lent.len() as u32);
        drop(pass);
        weights
    }

    /// The weights of a session, or of nobody's; whether they are new.
    fn weights_of(&mut self, gpu: &Gpu, mesh: &FieldMesh, session: Option<u64>) -> (wgpu::Buffer, bool) {
        let known = self.kept.iter().position(|kept| (kept.session, kept.mesh) == (session, mesh.number));
        if let Some(place) = known {
            let kept = self.kept.remove(place);
            let weights = kept.weights.clone();
            self.kept.insert(0, kept);
            return (weights, false);
        }
        let size = (mesh.lent.len() as u64 * LENT_BYTES).max(LENT_BYTES);
        // Those of the same session on a mesh that is no more drawn are of no use.
        self.kept.retain(|kept| kept.session != session);
        let mut n_bytes = size;
        self.kept.retain(|kept| {
            n_bytes += kept.weights.size();
            n_bytes <= MAX_KEPT_BYTES
        });
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::VERTEX;
        let weights = gpu.buffer("fields weights", size, usage);
        self.kept.insert(0, Kept { session, mesh: mesh.number, weights: weights.clone() });
        (weights, true)
    }
}

fn frame_of(mesh: &FieldMesh, wanted: &FieldsWanted<'_>, follow: f64) -> FieldFrame {
    let mut eyes = [[0.0; 4]; MAX_VIEWS];
    for ((eye, at), is_shown) in eyes.iter_mut().zip(mesh.eyes_in_world()).zip(wanted.is_shown) {
        let shown = if *is_shown { 1.0 } else { 0.0 };
        *eye = (at - mesh.origin_in_world).as_vec3().extend(shown).to_array();
    }
    let (viewer, is_parallel) = match wanted.viewer {
        Viewer::At(eye) => (eye - mesh.origin_in_world, 0),
        Viewer::Along { direction, .. } => (-direction, 1),
    };
    FieldFrame {
        viewer: viewer.as_vec3().to_array(),
        is_parallel,
        n_vertices: mesh.lent.len() as u32,
        most_cameras: wanted.most_cameras as u32,
        depth_m: mesh.depth_m as f32,
        follow: follow as f32,
        is_montage: u32::from(wanted.form == FieldsForm::Montage),
        pad_a: 0,
        pad_b: 0,
        pad_c: 0,
        eyes,
    }
}

pub(super) const MIRRORS: [crate::gpu::Mirror; 3] =
    [FieldFrame::MIRROR, FieldVertex::MIRROR, FieldGroup::MIRROR];
