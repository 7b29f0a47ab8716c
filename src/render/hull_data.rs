//! What the device knows of entities' hulls: bind group 2 of the passes that find and show them.

use super::passes::{FILTERED, read_entry, texture_entry};
use crate::gpu::{Gpu, GrowingBuffer, TextureDescriptor, mirror};
use glam::{DVec2, DVec3};
use videofields_picture::fuse::{EntityHull, SceneState};
use videofields_picture::plan::{HullMethod, HullVisibility, Plan, Projection, View};
use videofields_vision::frame::Mask;
use videofields_vision::geometry::{Distortion, NEAR_M};
use videofields_vision::hull::{LEAF_EDGES, View as Silhouette};

/// Sides of a layer of masks, texels: what is larger is told by one pixel in several.
const LAYER_SIDES: [u32; 5] = [64, 128, 256, 512, 1024];

/// Most bytes of them all: of many large ones, fewer pixels are told.
const MAX_MASK_BYTES: u64 = 64 << 20;

/// In place of a view, one of the bounds' sides.
const NO_VIEW: u32 = u32::MAX;

/// What is infinite in a tree of boxes, as numbers that can be multiplied.
const FAR: f64 = 1e15;

mirror! { "common/hull.wgsl",
/// The picture that hulls are looked for in.
pub(super) struct HullFrame {
    corner: [f32; 3],
    n_hulls: u32,
    across: [f32; 3],
    tile_columns: u32,
    along: [f32; 3],
    middle_m: f32,
}}

mirror! { "common/hull.wgsl",
/// One entity's hull. The shader documents the fields.
pub(super) struct Hull {
    low: [f32; 3],
    first_view: u32,
    high: [f32; 3],
    n_views: u32,
    rect_px: [f32; 4],
}}

mirror! { "common/hull.wgsl",
/// One camera's silhouette of it. The shader documents the fields.
pub(super) struct HullView {
    camera_idx: u32,
    first_edge: u32,
    first_box: u32,
    n_leaves: u32,
    scale: [f32; 2],
    offset: [f32; 2],
    limit: [f32; 2],
    tile_scale: [f32; 2],
    shift: [f32; 3],
    layer: u32,
    tile_offset: [f32; 2],
    pad_tile: [f32; 2],
}}

/// Bind group 2, and what is written into its buffers.
#[derive(Debug)]
pub(super) struct HullData {
    layout: wgpu::BindGroupLayout,
    sampler: wgpu::Sampler,
    /// Of the picture, and of its valid region.
    frames: [GrowingBuffer; 2],
    hulls: GrowingBuffer,
    views: GrowingBuffer,
    edges: GrowingBuffer,
    boxes: GrowingBuffer,
    /// Faces of cones and bounds, for methods that draw them: hull, view, edge.
    faces: GrowingBuffer,
    /// Distances from outlines, and masks.
    masks: Option<wgpu::Texture>,
    scratch: Scratch,
    /// Of every hull, how many pixels of a camera's mask a metre of it is, at most: nothing of a silhouette is thinner than one.
    mask_px_per_m: Vec<f64>,
    /// How depth maps of all views lie beside each other; none where none are wanted.
    tiles: Option<Tiles>,
    /// Whether any of the views' cameras has a lens that bends.
    has_lenses: bool,
}

/// Depth maps of the views, beside each other in one texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tiles {
    /// Texels a side of one.
    pub side_px: u32,
    /// How many lie beside each other, and how many rows there are of them.
    pub columns: u32,
    pub rows: u32,
}

/// Texels a side of a view's depth map: 2 cm of a person.
const TILE_PX: u32 = 128;

/// Most depth maps beside each other.
const MOST_COLUMNS: u32 = 16;

/// A hull's faces that are drawn in a view's depth map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TileDraw {
    pub view: u32,
    pub hull: usize,
}

/// A hull's part of all faces: those of its cones, and then the six sides of its bounds.
#[derive(Clone, Copy, Debug)]
pub(super) struct HullFaces {
    pub first: u32,
    pub n_edges: u32,
    pub n_views: u32,
}

/// Lists of one frame, kept for their memory.
#[derive(Debug, Default)]
struct Scratch {
    hulls: Vec<Hull>,
    bounds: Vec<[DVec3; 2]>,
    views: Vec<HullView>,
    edges: Vec<[f32; 4]>,
    boxes: Vec<[f32; 4]>,
    faces: Vec<[u32; 3]>,
    of_hulls: Vec<HullFaces>,
    tile_draws: Vec<TileDraw>,
    texels: Vec<u8>,
}

impl HullData {
    pub(super) fn new(gpu: &Gpu) -> Self {
        let visibility = wgpu::ShaderStages::VERTEX_FRAGMENT | wgpu::ShaderStages::COMPUTE;
        let texture = texture_entry(5, wgpu::TextureViewDimension::D2Array, FILTERED);
        let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("hulls"),
            entries: &[
                read_entry(0, visibility),
                read_entry(1, visibility),
                read_entry(2, visibility),
                read_entry(3, visibility),
                read_entry(4, visibility),
                wgpu::BindGroupLayoutEntry { visibility, ..texture },
                wgpu::BindGroupLayoutEntry { binding: 6, visibility, ty: sampler, count: None },
            ],
        });
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("hull masks"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let storage = |label| GrowingBuffer::new(label, wgpu::BufferUsages::STORAGE);
        Self {
            layout,
            sampler,
            frames: [0, 1].map(|_| storage("hull frame")),
            hulls: storage("hulls"),
            views: storage("hull views"),
            edges: storage("hull edges"),
            boxes: storage("hull boxes"),
            faces: GrowingBuffer::new("hull faces", wgpu::BufferUsages::VERTEX),
            masks: None,
            scratch: Scratch::default(),
            mask_px_per_m: Vec::new(),
            tiles: None,
            has_lenses: true,
        }
    }

    /// Whether any of the views' cameras has a lens that bends.
    pub(super) const fn has_lenses(&self) -> bool {
        self.has_lenses
    }

    /// What passes over these hulls are made as: without lenses they leave out what bends.
    pub(super) fn variant(&self) -> [(&'static str, f64); 1] {
        [("HAS_LENSES", f64::from(u8::from(self.has_lenses)))]
    }

    /// Layout of bind group 2.
    pub(super) const fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// Writes the plan's hulls; `shader_idx` tells which of the shader's cameras a camera is.
    pub(super) fn assign(
        &mut self,
        gpu: &Gpu,
        (state, plan): (&SceneState, &Plan),
        anchor: DVec3,
        shader_idx: impl Fn(usize) -> Option<usize>,
    ) {
        let chosen: Vec<&EntityHull> = plan.hulls.iter().map(|idx| &*state.hulls[*idx]).collect();
        let side = |mask: &Mask| mask.width.max(mask.height);
        let largest = chosen.iter().flat_map(|hull| &hull.distances).map(side).max().unwrap_or(1);
        let n_layers = chosen.iter().map(|hull| hull.cameras.len() as u32).sum::<u32>().max(1);
        let layer_px = layer_px(largest, n_layers);
        self.make_room(gpu, layer_px, n_layers);
        let mut views = chosen.iter().flat_map(|of| of.hull.views());
        self.has_lenses = views.any(|view| *view.camera().distortion() != Distortion::None);
        let has_tiles = plan.hull.texture.visibility == HullVisibility::Depths;
        let columns = n_layers.min(MOST_COLUMNS);
        self.tiles = has_tiles.then(|| Tiles { side_px: TILE_PX, columns, rows: n_layers.div_ceil(columns) });
        let Scratch { hulls, bounds, views, edges, boxes, faces, of_hulls, tile_draws, texels } =
            &mut self.scratch;
        hulls.clear();
        bounds.clear();
        views.clear();
        edges.clear();
        boxes.clear();
        faces.clear();
        of_hulls.clear();
        tile_draws.clear();
        let texture = self.masks.as_ref().expect("there is room");
        let draws_faces = has_tiles || !matches!(plan.hull.method, HullMethod::Rays | HullMethod::Voxels);
        self.mask_px_per_m.clear();
        let mut silhouettes: Vec<(&Silhouette, [DVec3; 2])> = Vec::new();
        for of in chosen {
            let finest = of.hull.views().iter().map(|view| mask_px_per_m(view, of.bounds_in_world));
            self.mask_px_per_m.push(finest.fold(0.0, f64::max));
            let first_view = views.len() as u32;
            let first_face = faces.len() as u32;
            for ((camera_idx, view), distances) in of.cameras.iter().zip(of.hull.views()).zip(&of.distances) {
                let stands = state.cameras[*camera_idx].corrected.pose().position_in_world;
                let Some(camera_idx) = shader_idx(*camera_idx) else { continue };
                let layer = views.len() as u32;
                let data = silhouette(view, (camera_idx, stands, layer), texture.width(), (edges, boxes));
                upload(gpu, texture, (distances, layer), texels);
                if draws_faces {
                    let first = data.first_edge;
                    let n_edges = view.outside().edges().len() as u32;
                    faces.extend((first..first + n_edges).map(|edge| [hulls.len() as u32, layer, edge]));
                }
                views.push(data);
                if has_tiles {
                    silhouettes.push((view, of.bounds_in_world));
                }
            }
            if draws_faces {
                let n_edges = faces.len() as u32 - first_face;
                of_hulls.push(HullFaces {
                    first: first_face,
                    n_edges,
                    n_views: views.len() as u32 - first_view,
                });
                faces.extend((0..6).map(|side| [hulls.len() as u32, NO_VIEW, side]));
            }
            let corner = |corner: DVec3| (corner - anchor).as_vec3().to_array();
            let [low, high] = of.bounds_in_world;
            bounds.push(of.bounds_in_world);
            hulls.push(Hull {
                low: corner(low),
                first_view,
                high: corner(high),
                n_views: views.len() as u32 - first_view,
                rect_px: [0.0; 4],
            });
        }
        if has_tiles {
            for (idx, ((view, own), data)) in silhouettes.into_iter().zip(&mut *views).enumerate() {
                set_tile(view, (idx, own), bounds, data, tile_draws);
            }
        }
        self.views.write(gpu, views);
        self.edges.write(gpu, edges);
        self.boxes.write(gpu, boxes);
        if draws_faces {
            self.faces.write(gpu, faces);
        }
    }

    /// Faces of cones and bounds, and how many: for methods that draw them.
    pub(super) fn faces(&self) -> (&wgpu::Buffer, u32) {
        (self.faces.get().expect("hulls are assigned before"), self.scratch.faces.len() as u32)
    }

    /// The same, and which of them are each hull's.
    pub(super) fn faces_by_hull(&self) -> (&wgpu::Buffer, &[HullFaces]) {
        (self.faces().0, &self.scratch.of_hulls)
    }

    /// What of the piece of `size_px` pixels that was bound last may show each hull: left, top, right, bottom.
    pub(super) fn rects_px(&self, size_px: [u32; 2]) -> Vec<[u32; 4]> {
        let [width, height] = size_px;
        let of = |hull: &Hull| {
            let [left, top, right, bottom] = hull.rect_px;
            let ends = [left.floor(), top.floor(), right.ceil(), bottom.ceil()];
            // Negative numbers are 0 as these.
            let [left, top, right, bottom] = ends.map(|at| at as u32);
            [left.min(width), top.min(height), right.min(width), bottom.min(height)]
        };
        self.scratch.hulls.iter().map(of).collect()
    }

    /// Returns of each hull what of a picture of `view` may show it (left, top, right and bottom, in pixels), and how many silhouettes it has.
    pub(super) fn rects_in(&self, view: &View) -> impl Iterator<Item = ([u32; 4], u32)> {
        let size = DVec2::new(f64::from(view.width_px), f64::from(view.height_px));
        self.scratch.hulls.iter().zip(&self.scratch.bounds).map(move |(hull, bounds)| {
            let [left, top, right, bottom] = rect(view, *bounds, size);
            ([left.floor(), top.floor(), right.ceil(), bottom.ceil()].map(|at| at as u32), hull.n_views)
        })
    }

    /// How depth maps of the views lie beside each other, and what is drawn in each; none where none are wanted.
    pub(super) fn tiles(&self) -> Option<(Tiles, &[TileDraw])> {
        self.tiles.map(|tiles| (tiles, self.scratch.tile_draws.as_slice()))
    }

    /// Pixels a side, a power of two up to `most`, of squares that are no larger in `view` than the thinnest that a silhouette of
    /// the hulls can be.
    pub(super) fn coarse_px(&self, view: &View, most: u32) -> u32 {
        let thinnest = |(bounds, mask_px): (&[DVec3; 2], &f64)| {
            let [across, down] = view.pixels_per_metre((bounds[0] + bounds[1]) / 2.0);
            across.min(down) / mask_px.max(1e-9)
        };
        let thinnest =
            self.scratch.bounds.iter().zip(&self.mask_px_per_m).map(thinnest).fold(f64::INFINITY, f64::min);
        (0..).map(|power| most >> power).find(|px| *px <= 1 || f64::from(*px) <= thinnest).unwrap_or(1)
    }

    fn make_room(&mut self, gpu: &Gpu, layer_px: u32, n_layers: u32) {
        let (kept_px, kept) =
            self.masks.as_ref().map_or((0, 0), |kept| (kept.width(), kept.depth_or_array_layers()));
        if kept_px == layer_px && kept >= n_layers {
            return;
        }
        let n_layers = n_layers.next_power_of_two().min(gpu.limits().max_texture_array_layers);
        self.masks = Some(gpu.texture(&TextureDescriptor {
            label: Some("hull masks"),
            // An array of one layer is no array to some devices.
            size: wgpu::Extent3d {
                width: layer_px,
                height: layer_px,
                depth_or_array_layers: n_layers.max(2),
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rg8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        }));
    }

    /// Writes where a piece of a picture of `size_px` pixels looks through, and binds all; the second `which` is another picture of the
    /// same frame. What of the piece may show
    /// any of them, pixels: left, top, right, bottom; none where nothing is in it.
    pub(super) fn bind(
        &mut self,
        gpu: &Gpu,
        (view, anchor): (&View, DVec3),
        (which, [width_px, height_px]): (usize, [u32; 2]),
    ) -> (wgpu::BindGroup, Option<[u32; 4]>) {
        let size = DVec2::new(f64::from(width_px), f64::from(height_px));
        let mut all: Option<[f64; 4]> = None;
        let Scratch { hulls, bounds, .. } = &mut self.scratch;
        for (hull, bounds) in hulls.iter_mut().zip(&*bounds) {
            let rect = rect(view, *bounds, size);
            if which == 0 {
                hull.rect_px = rect.map(|at| at as f32);
            }
            if rect[0] < rect[2] && rect[1] < rect[3] {
                let [left, top, right, bottom] = all.unwrap_or(rect);
                all = Some([left.min(rect[0]), top.min(rect[1]), right.max(rect[2]), bottom.max(rect[3])]);
            }
        }
        let axes = glam::DMat3::from_quat(view.pose.world_from_local);
        let per_pixel = |[first, last]: [f64; 2], n: f64| (last - first) / n;
        let offset = axes.x_axis * view.frustum.x[0] + axes.y_axis * view.frustum.y[0];
        let corner = match view.frustum.projection {
            Projection::Perspective => axes.z_axis + offset,
            Projection::Orthographic => view.pose.position_in_world - anchor + offset,
        };
        // Of parallel rays depths are told from here on.
        let before =
            |[low, high]: &[DVec3; 2]| ((*low + *high) / 2.0 - view.pose.position_in_world).dot(axes.z_axis);
        let middle_m = bounds.iter().map(before).sum::<f64>() / bounds.len().max(1) as f64;
        let direction = |of: DVec3| of.as_vec3().to_array();
        let frame = HullFrame {
            corner: direction(corner),
            n_hulls: hulls.len() as u32,
            across: direction(axes.x_axis * per_pixel(view.frustum.x, size.x)),
            tile_columns: self.tiles.map_or(0, |tiles| tiles.columns),
            along: direction(axes.y_axis * per_pixel(view.frustum.y, size.y)),
            middle_m: middle_m as f32,
        };
        let written = |buffer: &GrowingBuffer| buffer.get().expect("hulls are assigned before").clone();
        let buffers = [
            self.frames[which].write(gpu, &[frame]).clone(),
            self.hulls.write(gpu, hulls).clone(),
            written(&self.views),
            written(&self.edges),
            written(&self.boxes),
        ];
        let texture = self.masks.as_ref().expect("hulls are assigned before");
        let texture = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        let mut entries: Vec<_> = (0..)
            .zip(&buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        entries.push(wgpu::BindGroupEntry {
            binding: 5,
            resource: wgpu::BindingResource::TextureView(&texture),
        });
        entries.push(wgpu::BindGroupEntry {
            binding: 6,
            resource: wgpu::BindingResource::Sampler(&self.sampler),
        });
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("hulls"),
            layout: &self.layout,
            entries: &entries,
        });
        let shown = all.map(|[left, top, right, bottom]| {
            [left.floor() as u32, top.floor() as u32, right.ceil() as u32, bottom.ceil() as u32]
        });
        (group, shown)
    }
}

/// What of a camera's tangent plane may show a box: lower and upper corner; none where part of it is beside or behind the camera.
fn window(view: &Silhouette, [low, high]: [DVec3; 2]) -> Option<[DVec2; 2]> {
    let pose = view.camera().pose();
    let camera_from_world = pose.world_from_local.inverse();
    let corner = |i: usize| {
        let at = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        let local = camera_from_world * (DVec3::new(at(0), at(1), at(2)) - pose.position_in_world);
        (local.z > NEAR_M).then(|| local.truncate() / local.z)
    };
    let corners: Option<Vec<DVec2>> = (0..8).map(corner).collect();
    let nothing = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    Some(corners?.into_iter().fold(nothing, |[a, b], at| [a.min(at), b.max(at)]))
}

/// Where a view's depth map lies in its camera's tangent plane, and which hulls may be in it.
fn set_tile(
    view: &Silhouette,
    (idx, own): (usize, [DVec3; 2]),
    bounds: &[[DVec3; 2]],
    data: &mut HullView,
    draws: &mut Vec<TileDraw>,
) {
    let Some([low, high]) = window(view, own) else { return };
    // A texel more on every side.
    let margin = 1.0 / f64::from(TILE_PX);
    let scale = (1.0 - 2.0 * margin) / (high - low).max(DVec2::splat(1e-9));
    data.tile_scale = scale.as_vec2().to_array();
    data.tile_offset = (margin - low * scale).as_vec2().to_array();
    let is_before = |of: &[DVec3; 2]| {
        window(view, *of).is_none_or(|[first, last]| first.cmple(high).all() && last.cmpge(low).all())
    };
    let before = bounds.iter().enumerate().filter(|(_, of)| is_before(of));
    draws.extend(before.map(|(hull, _)| TileDraw { view: idx as u32, hull }));
}

/// How many pixels of a view's mask a metre in the middle of some bounds is.
fn mask_px_per_m(view: &Silhouette, [low, high]: [DVec3; 2]) -> f64 {
    let camera = view.camera();
    let distance_m = camera.pose().position_in_world.distance((low + high) / 2.0).max(1e-3);
    let mask_px = view.picture_px().x / f64::from(camera.size_px().0);
    camera.focal_px().max_element() * mask_px / distance_m
}

/// A view with its outline and its tree added to `edges` and `boxes`.
fn silhouette(
    view: &Silhouette,
    (camera_idx, stands, layer): (usize, DVec3, u32),
    layer_px: u32,
    (edges, boxes): (&mut Vec<[f32; 4]>, &mut Vec<[f32; 4]>),
) -> HullView {
    let outline = view.outside();
    let (first_edge, first_box) = (edges.len() as u32, boxes.len() as u32);
    let is_empty = outline.edges().is_empty();
    if !is_empty {
        let of = |[from, to]: &[DVec2; 2]| [from.x, from.y, to.x, to.y].map(|at| at.clamp(-FAR, FAR) as f32);
        edges.extend(outline.edges().iter().map(of));
        // Leaves are read whole: an edge of no length is never crossed.
        edges.resize(edges.len().next_multiple_of(LEAF_EDGES), [0.0; 4]);
        debug_assert_eq!(first_edge as usize % LEAF_EDGES, 0);
        boxes.extend(outline.boxes().iter().map(of));
    }
    let [width, height] = view.size_px().map(|side| side as f64);
    let layer_side = f64::from(layer_px);
    let step = f64::from(step_px(view.size_px(), layer_px));
    let [left, top] = view.left_top().map(|first| first as f64);
    // Texel centres of the layer are at pixel 0, step, 2 step, ... of the window, each half a pixel within.
    let scale = view.picture_px() / (step * layer_side);
    let offset = (0.5 - (DVec2::new(left, top) + 0.5) / step) / layer_side;
    let n = DVec2::new((width / step).ceil(), (height / step).ceil());
    HullView {
        camera_idx: camera_idx as u32,
        first_edge,
        first_box,
        n_leaves: if is_empty { 0 } else { outline.boxes().len().div_ceil(2) as u32 },
        scale: scale.as_vec2().to_array(),
        offset: offset.as_vec2().to_array(),
        limit: ((n - 0.5) / layer_side).as_vec2().to_array(),
        tile_scale: [0.0; 2],
        shift: (view.camera().pose().position_in_world - stands).as_vec3().to_array(),
        layer,
        tile_offset: [0.0; 2],
        pad_tile: [0.0; 2],
    }
}

/// Texels a side of layers for so many masks, of which the largest has so many pixels a side.
fn layer_px(largest: u32, n_layers: u32) -> u32 {
    let n_layers = u64::from(n_layers.next_power_of_two());
    let fits = |side: &u32| 2 * u64::from(*side).pow(2) * n_layers <= MAX_MASK_BYTES;
    let fitting = || LAYER_SIDES.into_iter().filter(fits);
    fitting().find(|side| *side >= largest).or_else(|| fitting().next_back()).unwrap_or(LAYER_SIDES[0])
}

/// Every how manieth pixel of a window is a texel of its layer.
fn step_px([width, height]: [usize; 2], layer_px: u32) -> u32 {
    (width.max(height) as u32).div_ceil(layer_px).max(1)
}

fn upload(gpu: &Gpu, texture: &wgpu::Texture, (distances, layer): (&Mask, u32), texels: &mut Vec<u8>) {
    let size = [distances.width as usize, distances.height as usize];
    let step = step_px(size, texture.width());
    texels.clear();
    for y in (0..distances.height).step_by(step as usize) {
        // Inside is what lies within the outline by half a pixel or more.
        let inside = |distance: u8| if distance >= 128 { 255 } else { 0 };
        texels.extend(distances.row(y).iter().step_by(step as usize).flat_map(|of| [*of, inside(*of)]));
    }
    let (width, height) = (distances.width.div_ceil(step), distances.height.div_ceil(step));
    gpu.upload(
        "hull masks",
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        },
        (
            texels,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(2 * width),
                rows_per_image: Some(height),
            },
        ),
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

/// What of a picture of `size` pixels may show a box: all of it where a corner lies behind the eye, nothing where all do.
fn rect(view: &View, [low, high]: [DVec3; 2], size: DVec2) -> [f64; 4] {
    let corner = |i: usize| {
        let at = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        view.project(DVec3::new(at(0), at(1), at(2))).map(DVec2::from_array)
    };
    let seen: Vec<DVec2> = (0..8).filter_map(corner).map(|share| share * size).collect();
    let whole = [0.0, 0.0, size.x, size.y];
    match seen.len() {
        0 => {
            // Around the eye, or behind it.
            let eye = view.pose.position_in_world;
            if eye.cmpge(low).all() && eye.cmple(high).all() { whole } else { [0.0; 4] }
        }
        8 => {
            let (first, last) = seen
                .iter()
                .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(a, b), at| (a.min(*at), b.max(*at)));
            let first = (first - 1.0).clamp(DVec2::ZERO, size);
            let last = (last + 1.0).clamp(DVec2::ZERO, size);
            [first.x, first.y, last.x, last.y]
        }
        _ => whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_keep_their_pixels_as_long_as_there_is_room() {
        for (largest, n_layers, expected) in [
            (1, 1, 64),
            (64, 1, 64),
            (65, 9, 128),
            (300, 36, 512),
            (900, 4, 1024),
            (4000, 4, 1024),
            (900, 256, 256),
        ] {
            assert_eq!(layer_px(largest, n_layers), expected, "{largest} {n_layers}");
        }
    }
}
