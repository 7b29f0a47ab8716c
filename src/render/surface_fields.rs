//! Texture fields of a mesh that is given with its cameras' pictures, by the device's passes: for recorded meshes, and for who compares
//! and measures.

use super::camera_data::{FrameData, Reach, View as ViewData};
use super::given_mesh::GivenMesh;
use super::lent_mesh::LentMesh;
use super::mesh_fields::{Lent, MeshFields, MeshLook};
use super::passes::{DrawInto, Recording, VALUE_BYTES};
use super::targets::{Place, TargetCache, TargetKey};
use super::{RenderError, View};
use crate::gpu::{Gpu, GpuError, PassTime, Readback, Timer, read};
use glam::DVec3;
use videofields_picture::plan::{FieldsForm, Followed, Picture};
use videofields_vision::clock::Timestamp;
use videofields_vision::fields::{self, FieldSettings};
use videofields_vision::frame::RgbImage;
use videofields_vision::mesh::Mesh;

/// Cameras that are mixed at a place.
const MOST_CAMERAS: usize = 8;

/// What the device found at the vertices of a mesh. By vertex, and of a vertex by view.
#[derive(Clone, Debug)]
pub struct FoundFields {
    /// As the numbers of [`fields::Sight`].
    pub sights: Vec<u32>,
    /// How far from its seams a view sees a vertex, 0 to 1.
    pub ramps: Vec<f32>,
    /// What every view lends.
    pub weights: Vec<f32>,
}

/// A picture of a mesh.
#[derive(Clone, Debug)]
pub struct FieldsPicture {
    /// The picture, black where the mesh is not.
    pub image: RgbImage,
    /// Time that the device spent in each pass that ran; empty where it cannot tell.
    pub timings: Vec<PassTime>,
}

/// Draws meshes that are given, by texture fields; what is kept is used again for the next.
#[derive(Debug)]
pub struct SurfaceFields {
    fields: MeshFields,
    frame: FrameData,
    given: Option<GivenMesh>,
    home_in_world: Option<DVec3>,
    /// How far those who look have come, in a time of its own.
    at: Timestamp,
    targets: TargetCache,
    readback: Readback,
    timer: Timer,
    n_given: u64,
}

impl SurfaceFields {
    /// For a device. Compiles nothing yet.
    #[must_use]
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            fields: MeshFields::default(),
            frame: FrameData::new(gpu),
            given: None,
            home_in_world: None,
            at: Timestamp::default(),
            targets: TargetCache::default(),
            readback: Readback::default(),
            timer: Timer::new(gpu),
            n_given: 0,
        }
    }

    /// Gives the next mesh with its views, whose gains are taken as they are. Of `settings` the vote is not run, rays are depth maps, exact
    /// distances those of windows, and of preferences errors count, to the fourth power.
    ///
    /// **Cost** that of handing over mesh and pictures.
    ///
    /// # Errors
    /// Of a mesh without triangles, of no or too many views, and of pictures that are larger than the device holds.
    pub fn give(
        &mut self,
        gpu: &Gpu,
        mesh: &Mesh,
        views: &[fields::View],
        settings: &FieldSettings,
    ) -> Result<(), GpuError> {
        self.n_given += 1;
        let given = GivenMesh::new(
            self.given.take(),
            gpu,
            (self.n_given, self.home_in_world),
            (mesh, views, settings),
        )?;
        self.home_in_world = Some(given.mesh.home_in_world);
        self.given = Some(given);
        Ok(())
    }

    /// The mesh as `view` shows it, by weights on their way to what `form` wants; the second is what was found of its vertices, where that
    /// is asked for. Of whose weights are followed the time that passed counts, and not which instant it is.
    ///
    /// # Errors
    /// Where nothing was given, what the device reports, and of a mesh that is larger than its buffers hold.
    pub fn picture(
        &mut self,
        gpu: &Gpu,
        view: &View,
        (form, followed): (FieldsForm, Option<Followed>),
        reading: Reading,
    ) -> Result<(FieldsPicture, Option<FoundFields>), RenderError> {
        let nothing = || GpuError::Refused { message: "no mesh was given".to_owned() };
        let Self { fields, frame, given, at, targets, readback, timer, .. } = self;
        let Some(given) = given.as_ref() else { return Err(nothing().into()) };
        let mesh = &given.mesh;
        timer.begin_frame();
        let anchor_in_world = mesh.origin_in_world;
        frame.clear();
        let camera_idx = given.add_cameras(frame, anchor_in_world);
        frame.write_cameras(gpu);
        let reach = Reach { anchor_in_world, depths_m: depths_m(mesh, view) };
        let frame_group = frame.bind(gpu, ViewData::new(view, &reach));
        let key = TargetKey {
            width_px: view.width_px,
            height_px: view.height_px,
            samples: 1,
            is_read: false,
            keeps_depth: false,
        };
        let targets = targets.get(gpu, key);
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("surface fields") };
        let mut encoder = gpu.device.create_command_encoder(&descriptor);
        let mut recording = Recording { gpu, encoder: &mut encoder, timer };
        let passed_secs = followed.and_then(|followed| followed.passed_secs).unwrap_or_default();
        *at = at.saturating_add_nanos((passed_secs * 1e9) as i64);
        let followed = followed.map(|followed| Followed { instant: *at, ..followed });
        let look = MeshLook {
            form,
            viewer: Picture::from(*view).viewer,
            followed,
            goes_on: true,
            gains: 0,
            anchor_in_world,
            camera_idx: &camera_idx,
            most_cameras: MOST_CAMERAS,
        };
        let of = (&frame_group, frame.layout());
        let lent = fields.record(&mut recording, of, (mesh, given.pictures()), &look)?;
        let into = DrawInto {
            targets,
            frame: &frame_group,
            frame_layout: frame.layout(),
            has_gains: given.has_gains(),
            place: Place { clear: Some(wgpu::Color::BLACK), is_last: true },
        };
        fields.show(&mut recording, &into, (&lent, given.pictures()))?;
        let copied = match reading {
            Reading::Picture => None,
            Reading::Vertices => Some(copy_found(&mut recording, &lent)),
        };
        timer.resolve(&mut encoder);
        readback.copy(gpu, &mut encoder, &targets.color);
        gpu.queue.submit([encoder.finish()]);
        let row_bytes = 3 * view.width_px as usize;
        let mut data = vec![0; row_bytes * view.height_px as usize];
        let result = readback.read_rgb(gpu, &mut data, row_bytes);
        if let Err(error) = result {
            fields.clear();
            return Err(error.into());
        }
        let image = RgbImage { width: view.width_px, height: view.height_px, data };
        let found = copied.map(|[sights, values, weights]| found(gpu, [&sights, &values, &weights]));
        Ok((FieldsPicture { image, timings: timer.read(gpu)? }, found.transpose()?))
    }
}

/// What is read back with a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// The picture alone.
    Picture,
    /// What was found at vertices too.
    Vertices,
}

/// Between which distances before the plane through a view's eye the mesh lies, metres.
fn depths_m(mesh: &LentMesh, view: &View) -> [f64; 2] {
    let forward = view.pose.forward_in_world();
    let from_eye = mesh.origin_in_world - view.pose.position_in_world;
    let depth =
        |at: &[f32; 4]| (from_eye + DVec3::new(at[0].into(), at[1].into(), at[2].into())).dot(forward);
    let (least, most) =
        mesh.positions.iter().map(depth).fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), depth| {
            (least.min(depth), most.max(depth))
        });
    let slack = 1e-3 * (most - least).max(1e-3);
    [least - slack, (most + slack).max(least + 2.0 * slack)]
}

/// Records that what was found is copied to where it can be read.
fn copy_found(recording: &mut Recording<'_>, lent: &Lent) -> [wgpu::Buffer; 3] {
    let [n_vertices, _, n_views] = lent.mesh.n;
    let n = u64::from(n_vertices) * u64::from(n_views);
    [(&lent.mesh.sights, 4), (&lent.mesh.values[lent.values], VALUE_BYTES), (&lent.weights, 4)].map(
        |(buffer, bytes)| {
            let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
            let to = recording.gpu.buffer("fields read", n * bytes, usage);
            recording.encoder.copy_buffer_to_buffer(buffer, 0, &to, 0, n * bytes);
            to
        },
    )
}

fn found(gpu: &Gpu, [sights, values, weights]: [&wgpu::Buffer; 3]) -> Result<FoundFields, GpuError> {
    let mut found = FoundFields { sights: Vec::new(), ramps: Vec::new(), weights: Vec::new() };
    let words = |bytes: &[u8]| bytes.as_chunks::<4>().0.to_vec();
    read(gpu, sights, |bytes| found.sights = words(bytes).into_iter().map(u32::from_ne_bytes).collect())?;
    read(gpu, values, |bytes| {
        found.ramps = words(bytes).into_iter().step_by(4).map(f32::from_ne_bytes).collect();
    })?;
    read(gpu, weights, |bytes| found.weights = words(bytes).into_iter().map(f32::from_ne_bytes).collect())?;
    Ok(found)
}
