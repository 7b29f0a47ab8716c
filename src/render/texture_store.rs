//! The pictures that surfaces and the sky are painted with, on the device: each uploaded once, with its smaller levels.

use super::passes::{FILTERED, SAMPLER_ENTRY, texture_entry};
use crate::gpu::{Gpu, TextureDescriptor};
use std::collections::HashMap;
use std::sync::{Arc, Weak};
use videofields_picture::scene::{Texture, TextureLevel, Wrap};

/// Most bytes that are kept, unless one picture needs more: scenes that are looked at in turns stay.
const MAX_KEPT_BYTES: u64 = 512 << 20;

/// What pictures of surfaces and sky have cost the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextureUse {
    /// Pictures that lie on it.
    pub n_textures: usize,
    /// Their bytes, all levels.
    pub n_bytes: u64,
    /// Pictures that were ever uploaded.
    pub n_uploads: u64,
    /// Bind group layouts and samplers that were made for them.
    pub n_made: usize,
}

/// A picture on the device. Weak, so that no scene's pictures are held after it; their address cannot be taken by another
/// meanwhile.
#[derive(Debug)]
struct Slot {
    texture: Weak<Texture>,
    group: wgpu::BindGroup,
    n_bytes: u64,
    last_used: u64,
}

/// Pictures on the device, each bound with its sampler: bindings 0 and 1 of a group.
#[derive(Debug, Default)]
pub(super) struct TextureStore {
    layout: Option<wgpu::BindGroupLayout>,
    samplers: Vec<([Wrap; 2], wgpu::Sampler)>,
    /// By the picture's address.
    places: HashMap<usize, usize>,
    slots: Vec<Slot>,
    n_draws: u64,
    n_uploads: u64,
}

fn address(texture: &Weak<Texture>) -> usize {
    texture.as_ptr() as usize
}

impl TextureStore {
    /// Layout of the pictures' bind groups.
    pub(super) fn layout(&mut self, gpu: &Gpu) -> &wgpu::BindGroupLayout {
        self.layout.get_or_insert_with(|| {
            gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some("texture"),
                entries: &[texture_entry(0, wgpu::TextureViewDimension::D2, FILTERED), SAMPLER_ENTRY],
            })
        })
    }

    /// The bind groups of what a picture is to be drawn with, uploaded where they were not before. What no scene has any
    /// more is let go of, and beyond the bound what was used longest ago.
    pub(super) fn bind(&mut self, gpu: &Gpu, textures: &[&Arc<Texture>]) -> Vec<wgpu::BindGroup> {
        self.n_draws += 1;
        let n_draws = self.n_draws;
        for texture in textures {
            let found = self.places.get(&(Arc::as_ptr(texture) as usize));
            if let Some(slot) = found.and_then(|place| self.slots.get_mut(*place)) {
                slot.last_used = n_draws;
            }
        }
        let is_new = |texture: &&&Arc<Texture>| !self.places.contains_key(&(Arc::as_ptr(texture) as usize));
        let n_new: u64 = textures.iter().filter(is_new).map(|texture| texture.n_bytes()).sum();
        self.trim(MAX_KEPT_BYTES.saturating_sub(n_new));
        textures.iter().map(|texture| self.bound(gpu, texture)).collect()
    }

    fn bound(&mut self, gpu: &Gpu, texture: &Arc<Texture>) -> wgpu::BindGroup {
        let key = Arc::as_ptr(texture) as usize;
        if let Some(place) = self.places.get(&key) {
            return self.slots[*place].group.clone();
        }
        let view = upload(gpu, texture);
        let sampler = self.sampler(gpu, texture.wraps()).clone();
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("texture"),
            layout: self.layout(gpu),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
            ],
        });
        self.n_uploads += 1;
        self.places.insert(key, self.slots.len());
        let (n_bytes, last_used) = (texture.n_bytes(), self.n_draws);
        self.slots.push(Slot { texture: Arc::downgrade(texture), group: group.clone(), n_bytes, last_used });
        group
    }

    /// Keeps what is in use, and of the rest at most so many bytes, those used last.
    fn trim(&mut self, max_bytes: u64) {
        let n_draws = self.n_draws;
        self.slots.sort_by_key(|slot| std::cmp::Reverse(slot.last_used));
        let mut n_bytes = 0;
        self.slots.retain(|slot| {
            n_bytes += slot.n_bytes;
            slot.last_used == n_draws || (slot.texture.strong_count() > 0 && n_bytes <= max_bytes)
        });
        self.places = self.slots.iter().map(|slot| address(&slot.texture)).zip(0..).collect();
    }

    /// Lets go of everything.
    pub(super) fn clear(&mut self) {
        self.slots.clear();
        self.places.clear();
    }

    /// What it has cost.
    pub(super) fn usage(&self) -> TextureUse {
        TextureUse {
            n_textures: self.slots.len(),
            n_bytes: self.slots.iter().map(|slot| slot.n_bytes).sum(),
            n_uploads: self.n_uploads,
            n_made: self.samplers.len() + usize::from(self.layout.is_some()),
        }
    }

    fn sampler(&mut self, gpu: &Gpu, wraps: [Wrap; 2]) -> &wgpu::Sampler {
        let known = self.samplers.iter().position(|(known, _)| *known == wraps);
        let idx = known.unwrap_or_else(|| {
            let [u, v] = wraps.map(|wrap| match wrap {
                Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
                Wrap::Repeat => wgpu::AddressMode::Repeat,
                Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
            });
            let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("texture"),
                address_mode_u: u,
                address_mode_v: v,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..wgpu::SamplerDescriptor::default()
            });
            self.samplers.push((wraps, sampler));
            self.samplers.len() - 1
        });
        &self.samplers[idx].1
    }
}

/// A picture with those of its levels that the device holds.
fn upload(gpu: &Gpu, texture: &Texture) -> wgpu::TextureView {
    let most = gpu.limits().max_texture_dimension_2d;
    let is_held = |level: &&TextureLevel| level.width_px.max(level.height_px) <= most;
    let levels: Vec<&TextureLevel> = texture.levels().iter().filter(is_held).collect();
    let size = |level: &TextureLevel| wgpu::Extent3d {
        width: level.width_px,
        height: level.height_px,
        depth_or_array_layers: 1,
    };
    let made = gpu.texture(&TextureDescriptor {
        label: Some("texture"),
        size: size(levels[0]),
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8UnormSrgb,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (level, mip_level) in levels.into_iter().zip(0..) {
        gpu.upload(
            "texture",
            wgpu::TexelCopyTextureInfo {
                texture: &made,
                mip_level,
                origin: wgpu::Origin3d::ZERO,
                aspect: wgpu::TextureAspect::All,
            },
            (
                &level.texels,
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(4 * level.width_px),
                    rows_per_image: None,
                },
            ),
            size(level),
        );
    }
    made.create_view(&wgpu::TextureViewDescriptor::default())
}
