//! A mesh with its cameras' pictures as they were given, and not fused: of recorded sequences, and of who compares.

use super::camera_data::FrameData;
use super::image_array::IMAGE_FORMAT;
use super::lent_mesh::{LentMesh, MeshPart};
use crate::gpu::{Gpu, GpuError, TextureDescriptor};
use glam::DVec3;
use std::sync::Arc;
use videofields_vision::fields::{FieldSettings, MAX_VIEWS, View};
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::Camera;
use videofields_vision::mesh::Mesh;

/// Pictures of cameras, a layer each.
#[derive(Debug)]
struct Pictures {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

/// A picture's columns and rows, and what its light is multiplied by.
type Shown = ([u32; 2], [f32; 3]);

/// A mesh on its way to the device, and the pictures of its cameras there.
#[derive(Debug)]
pub(super) struct GivenMesh {
    pub mesh: LentMesh,
    /// By view.
    shown: Vec<Shown>,
    pictures: Pictures,
}

impl GivenMesh {
    /// Takes the next mesh with its views, whose gains are taken as they are; of what was there `before`, textures and cameras are kept
    /// where they are the same. Another `number` for each mesh; `home_in_world` of its first, if it is not that.
    ///
    /// # Errors
    /// Of a mesh without triangles, of no or too many views, and of more vertices or larger pictures than the device holds.
    pub(super) fn new(
        before: Option<Self>,
        gpu: &Gpu,
        (number, home_in_world): (u64, Option<DVec3>),
        (mesh, views, settings): (&Mesh, &[View], &FieldSettings),
    ) -> Result<Self, GpuError> {
        // Places are carried from mesh to mesh as they are in the world, near where the first was.
        let middle = || mesh.bounds().map_or(DVec3::ZERO, |[low, high]| 0.5 * (low + high));
        let home_in_world = home_in_world.unwrap_or_else(middle);
        let known = before.as_ref().map_or(&[][..], |before| &before.mesh.cameras);
        let camera = |view: &View| {
            let known = known.iter().find(|known| ***known == *view.camera());
            known.map_or_else(|| Arc::new(view.camera().clone()), Arc::clone)
        };
        let cameras = views.iter().map(camera).collect();
        let part = MeshPart { mesh, home_in_world, number: 0, shifts: vec![Some(DVec3::ZERO); views.len()] };
        let (n_triangles, n_views) = (mesh.triangles.len(), views.len());
        let lent = LentMesh::new(number, &[part], cameras, settings).ok_or_else(|| GpuError::Refused {
            message: format!(
                "a field is of a mesh with triangles and 1 to {MAX_VIEWS} views, got {n_triangles} triangles and \
                 {n_views} views"
            ),
        })?;
        lent.check(gpu)?;
        let pictures = uploaded(before.map(|before| before.pictures), gpu, views)?;
        let shown = |view: &View| {
            let picture = view.picture();
            ([picture.width, picture.height], view.gain.to_array())
        };
        Ok(Self { mesh: lent, shown: views.iter().map(shown).collect(), pictures })
    }

    /// Bytes that the pictures take on the device.
    pub(super) fn n_bytes(&self) -> u64 {
        let size = self.pictures.texture.size();
        4 * u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers)
    }

    /// The pictures, a layer a camera.
    pub(super) const fn pictures(&self) -> &wgpu::TextureView {
        &self.pictures.view
    }

    /// Whether any camera's light is multiplied by anything but 1.
    pub(super) fn has_gains(&self) -> bool {
        self.shown.iter().any(|(_, gain)| *gain != [1.0; 3])
    }

    /// Adds its cameras to a frame; answers which of the frame's they are.
    pub(super) fn add_cameras(&self, frame: &mut FrameData, anchor_in_world: DVec3) -> Vec<u32> {
        let whole = self.pictures.texture.size();
        let add = |(layer, (camera, (size, gain))): (u32, (&Arc<Camera>, &Shown))| {
            let data = frame.add(camera, anchor_in_world);
            let [width, height] = size.map(|side| side as f32);
            data.frame_layer = layer;
            data.frame_size_px = [width, height];
            data.frame_scale = [width / whole.width as f32, height / whole.height as f32];
            data.gain = *gain;
            frame.scratch.len() as u32 - 1
        };
        (0..).zip(self.mesh.cameras.iter().zip(&self.shown)).map(add).collect()
    }
}

fn uploaded(before: Option<Pictures>, gpu: &Gpu, views: &[View]) -> Result<Pictures, GpuError> {
    let most = |side: fn(&RgbImage) -> u32| views.iter().map(|view| side(view.picture())).max().unwrap_or(1);
    let size = wgpu::Extent3d {
        width: most(|picture| picture.width),
        height: most(|picture| picture.height),
        // An array of one layer is no array to some devices.
        depth_or_array_layers: (views.len() as u32).max(2),
    };
    let limit = gpu.limits().max_texture_dimension_2d;
    if size.width.max(size.height) > limit {
        let (width, height) = (size.width, size.height);
        let message = format!("pictures of {width} x {height} pixels, at most {limit} each way are allowed");
        return Err(GpuError::Refused { message });
    }
    let pictures = before.filter(|kept| kept.texture.size() == size).unwrap_or_else(|| {
        let texture = gpu.texture(&TextureDescriptor {
            label: Some("mesh pictures"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: IMAGE_FORMAT,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        Pictures { texture, view }
    });
    let mut texels = Vec::new();
    for (layer, view) in (0..).zip(views) {
        let RgbImage { width, height, data } = view.picture();
        let (width, height) = (*width, *height);
        texels.clear();
        texels.reserve(4 * width as usize * height as usize);
        let (colors, _) = data.as_chunks::<3>();
        for (at, [r, g, b]) in (0..).zip(colors) {
            texels.extend([*r, *g, *b, alpha(view, [at % width, at / width])]);
        }
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * width),
            rows_per_image: Some(height),
        };
        let to = wgpu::TexelCopyTextureInfo {
            texture: &pictures.texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        };
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        gpu.upload("mesh pictures", to, (&texels, layout), size);
    }
    Ok(pictures)
}

/// Alpha of a pixel of a view's picture: whether it is of the mesh.
fn alpha(view: &View, [x, y]: [u32; 2]) -> u8 {
    let Some(mask) = view.foreground() else { return 255 };
    let picture = view.picture();
    let at = |place: u32, side: u32, of: u32| {
        (((f64::from(place) + 0.5) / f64::from(side) * f64::from(of)) as u32).min(of.saturating_sub(1))
    };
    let (column, row) = (at(x, picture.width, mask.width), at(y, picture.height, mask.height));
    let value = mask.data.get(row as usize * mask.width as usize + column as usize);
    if value.is_some_and(|value| *value > 0) { 255 } else { 0 }
}
