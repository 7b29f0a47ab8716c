//! Many pictures in one texture array: which layer holds which, and which must be converted anew.
//!
//! Devices without arrays of bindings (lavapipe) can only choose among layers of one texture, so pictures of all
//! sizes share it, each in the upper left of its layer.

use super::RenderError;
use crate::gpu::{Gpu, TextureDescriptor};
use std::sync::{Arc, Weak};
use videofields_vision::frame::{Mask, YuvImage};

/// Sides are rounded up to this, so that the size of every level is exactly half its finer one's.
const SIDE_MULTIPLE: u32 = 16;
/// Least layers: a scene's few cameras fit without a change of allocation.
const LEAST_LAYERS: u32 = 4;

/// Format of the pictures as they are sampled.
pub(super) const IMAGE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// The same bytes as they are converted to: sRGB codes, written as they are.
pub(super) const CODED_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// A picture that a frame needs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted<'a> {
    pub image: &'a Arc<YuvImage>,
    /// Becomes the picture's alpha.
    pub mask: Option<&'a Arc<Mask>>,
}

impl<'a> Wanted<'a> {
    /// A picture that is projected: its alpha is 0 where nobody may see it.
    pub(super) fn in_sight(image: &'a Arc<YuvImage>) -> Self {
        Self { image, mask: image.zone_mask().map(|zones| zones.sight()) }
    }
}

/// A picture of which levels must be made in its layer: the first from the picture itself, uploaded and converted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Job<'a> {
    pub wanted: Wanted<'a>,
    pub layer: u32,
    /// The first level that is not there, and how many there are to be.
    pub levels: [u32; 2],
}

/// Weak, so that a picture's bytes (often the decoder's own buffer) are not held after it was uploaded; its address
/// cannot be taken by another picture meanwhile.
#[derive(Debug, Default)]
struct Slot {
    image: Weak<YuvImage>,
    mask: Option<Weak<Mask>>,
    last_used: u64,
    /// Levels that were made.
    n_levels: u32,
}

/// What one allocation holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct StoreSize {
    width: u32,
    height: u32,
    layers: u32,
    has_masks: bool,
}

/// The textures of one allocation.
#[derive(Debug)]
pub(super) struct Store {
    size: StoreSize,
    texture: wgpu::Texture,
    /// All layers and levels, for sampling.
    pub sampled: wgpu::TextureView,
    /// Y, U and V planes, a layer a picture, and masks where pictures have some.
    pub planes: Vec<wgpu::Texture>,
    pub plane_views: Vec<wgpu::TextureView>,
}

/// An array of pictures.
#[derive(Debug)]
pub(super) struct ImageArray {
    label: &'static str,
    n_levels: u32,
    store: Option<Store>,
    slots: Vec<Slot>,
    frame: u64,
}

impl ImageArray {
    /// An array without layers, with `n_levels` (1 to 5) of detail.
    pub(super) const fn new(label: &'static str, n_levels: u32) -> Self {
        Self { label, n_levels, store: None, slots: Vec::new(), frame: 0 }
    }

    pub(super) const fn n_levels(&self) -> u32 {
        self.n_levels
    }

    /// The textures; a minimal allocation where no picture was ever wanted.
    pub(super) fn store(&mut self, gpu: &Gpu) -> &Store {
        let (label, n_levels) = (self.label, self.n_levels);
        self.store.get_or_insert_with(|| {
            let size = StoreSize { width: SIDE_MULTIPLE, height: SIDE_MULTIPLE, layers: 1, has_masks: false };
            Store::new(gpu, label, n_levels, size)
        })
    }

    /// Share of a layer's width and height that a picture covers.
    pub(super) fn scale(&self, image: &YuvImage) -> [f32; 2] {
        self.store.as_ref().map_or([1.0; 2], |store| {
            let share = |used: u32, all: u32| used as f32 / all as f32;
            [share(image.width(), store.texture.width()), share(image.height(), store.texture.height())]
        })
    }

    /// Whether a picture is in its layer already.
    pub(super) fn has(&self, wanted: &Wanted<'_>) -> bool {
        self.slots.iter().any(|slot| slot.holds(wanted))
    }

    /// Forgets what the layers hold.
    pub(super) fn clear(&mut self) {
        self.store = None;
        self.slots.clear();
    }

    /// Finds a layer for every picture; those that are not in theirs yet with `n_levels` of detail become `jobs`.
    pub(super) fn assign<'a>(
        &mut self,
        gpu: &Gpu,
        (wanted, n_levels): (&[Wanted<'a>], u32),
        layers: &mut Vec<u32>,
        jobs: &mut Vec<Job<'a>>,
    ) -> Result<(), RenderError> {
        layers.clear();
        jobs.clear();
        if wanted.is_empty() {
            return Ok(());
        }
        self.make_room(gpu, wanted)?;
        self.frame += 1;
        layers.resize(wanted.len(), u32::MAX);
        for (wanted, layer) in wanted.iter().zip(layers.iter_mut()) {
            if let Some(idx) = self.slots.iter().position(|slot| slot.holds(wanted)) {
                let slot = &mut self.slots[idx];
                slot.last_used = self.frame;
                *layer = idx as u32;
                if slot.n_levels < n_levels {
                    jobs.push(Job { wanted: *wanted, layer: *layer, levels: [slot.n_levels, n_levels] });
                    slot.n_levels = n_levels;
                }
            }
        }
        for (wanted, layer) in wanted.iter().zip(layers.iter_mut()).filter(|(_, layer)| **layer == u32::MAX) {
            // Two cameras may show one picture: the first of them has just been given a layer.
            let same = jobs.iter().find(|job: &&Job<'a>| Slot::new(&job.wanted, 0, 0).holds(wanted));
            if let Some(job) = same {
                *layer = job.layer;
                continue;
            }
            let (idx, slot) = self
                .slots
                .iter_mut()
                .enumerate()
                .min_by_key(|(_, slot)| slot.last_used)
                .expect("there is room for every wanted picture");
            *slot = Slot::new(wanted, self.frame, n_levels);
            *layer = idx as u32;
            jobs.push(Job { wanted: *wanted, layer: idx as u32, levels: [0, n_levels] });
        }
        Ok(())
    }

    /// Allocates anew when the pictures are too many or too large for what there is.
    fn make_room(&mut self, gpu: &Gpu, wanted: &[Wanted<'_>]) -> Result<(), RenderError> {
        let limits = gpu.limits();
        let (mut width, mut height, mut layers) = (SIDE_MULTIPLE, SIDE_MULTIPLE, LEAST_LAYERS);
        if let Some(store) = &self.store {
            (width, height) = (store.texture.width(), store.texture.height());
            layers = layers.max(store.texture.depth_or_array_layers());
        }
        for Wanted { image, mask } in wanted {
            let limit = limits.max_texture_dimension_2d / SIDE_MULTIPLE * SIDE_MULTIPLE;
            if image.width().max(image.height()) > limit {
                return Err(RenderError::ImageSize { width: image.width(), height: image.height(), limit });
            }
            let frame = (image.width(), image.height());
            if let Some(mask) = mask.map(|mask| (mask.width, mask.height)).filter(|size| *size != frame) {
                return Err(RenderError::MaskSize { mask, frame });
            }
            width = width.max(image.width().next_multiple_of(SIDE_MULTIPLE));
            height = height.max(image.height().next_multiple_of(SIDE_MULTIPLE));
        }
        // Doubling to 16, then by 8: a hundred large pictures are no smaller for being 128.
        let n_wanted = wanted.len() as u32;
        let n_layers =
            if n_wanted <= 16 { n_wanted.next_power_of_two() } else { n_wanted.next_multiple_of(8) };
        layers = layers.max(n_layers);
        if layers > limits.max_texture_array_layers {
            let (needed, limit) = (u64::from(layers), u64::from(limits.max_texture_array_layers));
            return Err(RenderError::TooMany { what: "cameras in one picture", needed, limit });
        }
        let had_masks = self.store.as_ref().is_some_and(|store| store.size.has_masks);
        let has_masks = had_masks || wanted.iter().any(|wanted| wanted.mask.is_some());
        let size = StoreSize { width, height, layers, has_masks };
        if self.store.as_ref().is_none_or(|store| store.size != size) {
            self.clear();
            self.store = Some(Store::new(gpu, self.label, self.n_levels, size));
            self.slots.resize_with(layers as usize, Slot::default);
        }
        Ok(())
    }
}

impl Slot {
    fn new(wanted: &Wanted<'_>, frame: u64, n_levels: u32) -> Self {
        let (image, mask) = (Arc::downgrade(wanted.image), wanted.mask.map(Arc::downgrade));
        Self { image, mask, last_used: frame, n_levels }
    }

    fn holds(&self, wanted: &Wanted<'_>) -> bool {
        std::ptr::eq(self.image.as_ptr(), Arc::as_ptr(wanted.image))
            && self.mask.as_ref().map(Weak::as_ptr) == wanted.mask.map(Arc::as_ptr)
    }
}

impl Store {
    fn new(gpu: &Gpu, label: &'static str, n_levels: u32, size: StoreSize) -> Self {
        let StoreSize { width, height, layers, has_masks } = size;
        let texture = |label, (width, height), mip_level_count, format, usage, view_formats: &[_]| {
            gpu.texture(&TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
                mip_level_count,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats,
            })
        };
        let (full, half) = ((width, height), (width / 2, height / 2));
        let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let image = texture(label, full, n_levels, IMAGE_FORMAT, drawn, &[CODED_FORMAT]);
        let written = wgpu::TextureUsages::COPY_DST;
        let plane = |label, size| texture(label, size, 1, wgpu::TextureFormat::R8Unorm, written, &[]);
        let mut planes: Vec<_> = [full, half, half].map(|size| plane("planes", size)).into();
        planes.extend(has_masks.then(|| plane("masks", full)));
        let array_view = |texture: &wgpu::Texture| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2Array),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        let plane_views = planes.iter().map(array_view).collect();
        Self { size, sampled: array_view(&image), texture: image, planes, plane_views }
    }

    /// One level of one layer, in the format asked for.
    pub(super) fn level(&self, layer: u32, level: u32, format: wgpu::TextureFormat) -> wgpu::TextureView {
        self.texture.create_view(&wgpu::TextureViewDescriptor {
            format: Some(format),
            dimension: Some(wgpu::TextureViewDimension::D2),
            base_mip_level: level,
            mip_level_count: Some(1),
            base_array_layer: layer,
            array_layer_count: Some(1),
            ..wgpu::TextureViewDescriptor::default()
        })
    }
}
