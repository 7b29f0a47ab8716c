//! Entities as upright rectangles in the world, each textured by the camera that saw it.

use super::{
    Attributes, BySamples, DrawInto, DrawPipeline, LiveFrames, MAIN, Mixing, Recording, Translucent,
    draw_pipeline, read_entry,
};
use crate::gpu::{Gpu, GpuError, GrowingBuffer};
use crate::image_array::ImageArray;
use glam::{DQuat, DVec2, DVec3};
use std::ops::Range;
use videofields_picture::fuse::{Billboard, CameraState, Entity};
use videofields_picture::plan::Viewer;

/// One rectangle. The shader documents the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Instance {
    foot_from_anchor: [f32; 3],
    camera_idx: u32,
    right: [f32; 3],
    height_m: f32,
    turned_right: [f32; 3],
    turned_up: [f32; 3],
    seen_foot: [f32; 3],
    rect: [f32; 4],
    left_right_m: [f32; 2],
    beside_foot: [f32; 3],
    beside_camera_idx: u32,
    beside_right: [f32; 3],
    beside_weight: f32,
    beside_rect: [f32; 4],
    owners: [u32; 2],
}

const ATTRIBUTES: Attributes<15> = wgpu::vertex_attr_array![
    0 => Float32x3, 1 => Uint32, 2 => Float32x3, 3 => Float32, 4 => Float32x3, 5 => Float32x3, 13 => Float32x3,
    6 => Float32x4, 7 => Float32x2, 8 => Float32x3, 9 => Uint32, 10 => Float32x3, 11 => Float32, 12 => Float32x4,
    14 => Uint32x2
];

/// Pixels of the camera's picture by which a rectangle is drawn larger than its blob, for the mask's soft edge.
const EDGE_PX: f64 = 2.5;
/// Angle between a rectangle's front (or back) and a level viewer, seen from above, up to which it stays as it is.
const UNTURNED_RAD: f64 = std::f64::consts::FRAC_PI_3;
/// Elevation of the viewer above which rectangles lean back.
const UPRIGHT_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// A source of an entity, and where shaders find what its camera shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen<'a> {
    billboard: &'a Billboard,
    /// Where it stands in the world: its entity's place, of whom this camera's view of the foot is but one.
    place_in_world: DVec3,
    camera: &'a CameraState,
    camera_idx: usize,
}

impl<'a> Seen<'a> {
    /// `camera_idx` is the shader's.
    pub(crate) fn new(
        (entity, source): (&Entity, &'a Billboard),
        camera: &'a CameraState,
        camera_idx: usize,
    ) -> Self {
        Self { billboard: source, place_in_world: entity.place_of(source), camera, camera_idx }
    }

    pub(crate) const fn place_in_world(&self) -> DVec3 {
        self.place_in_world
    }

    fn frame_size_px(&self) -> (f64, f64) {
        let image = &self.camera.observation.frame.image;
        (f64::from(image.width()), f64::from(image.height()))
    }

    /// The blob's rectangle in texture coordinates: upper left, lower right.
    fn rect(&self) -> [f32; 4] {
        let rect = self.billboard.rect;
        let (width, height) = self.frame_size_px();
        let [x, y] = [f64::from(rect.x), f64::from(rect.y)];
        let [right, bottom] = [x + f64::from(rect.width), y + f64::from(rect.height)];
        [x / width, y / height, right / width, bottom / height].map(|share| share as f32)
    }

    /// What [`EDGE_PX`] are worth at the foot, metres.
    fn edge_m(&self) -> f64 {
        let camera = &self.camera.corrected;
        let distance_m = self.billboard.foot_in_world.distance(camera.pose().position_in_world);
        let frame_px = self.frame_size_px().0 / f64::from(camera.size_px().0);
        EDGE_PX * distance_m / (camera.focal_px().min_element() * frame_px)
    }
}

impl Instance {
    /// The rectangle as its first source has it, where the entity stands and turned towards the viewer; with a second `beside` it and its weight, which
    /// is looked up at the same metres from its own foot.
    pub(crate) fn new(
        first: &Seen<'_>,
        beside: Option<&(Seen<'_>, f32)>,
        anchor_in_world: DVec3,
        viewer: Viewer,
    ) -> Self {
        let Billboard { foot_in_world, right_in_world, .. } = first.billboard;
        let (to_viewer, away) = viewer.seen_from(first.place_in_world);
        let [turned_right, turned_up] = turned_towards(*right_in_world, to_viewer, away);
        let from_anchor = |point: DVec3| (point - anchor_in_world).as_vec3().to_array();
        let direction = |direction: DVec3| direction.as_vec3().to_array();
        // As large as the larger of both, so that neither is cut off.
        let (mut left_right_m, mut height_m) = (first.billboard.left_right_m, first.billboard.height_m);
        let mut edge_m = first.edge_m();
        if let Some((beside, _)) = beside {
            let [left, right] = beside.billboard.left_right_m;
            left_right_m = [left_right_m[0].min(left), left_right_m[1].max(right)];
            height_m = height_m.max(beside.billboard.height_m);
            edge_m = edge_m.max(beside.edge_m());
        }
        let second = beside.map_or(first, |(beside, _)| beside);
        Self {
            foot_from_anchor: from_anchor(first.place_in_world),
            seen_foot: from_anchor(*foot_in_world),
            camera_idx: first.camera_idx as u32,
            right: direction(*right_in_world),
            height_m: (height_m + edge_m) as f32,
            turned_right: direction(turned_right),
            turned_up: direction(turned_up),
            rect: first.rect(),
            left_right_m: [(left_right_m[0] - edge_m) as f32, (left_right_m[1] + edge_m) as f32],
            beside_foot: from_anchor(second.billboard.foot_in_world),
            beside_camera_idx: second.camera_idx as u32,
            beside_right: direction(second.billboard.right_in_world),
            beside_weight: beside.map_or(0.0, |(_, weight)| *weight),
            beside_rect: second.rect(),
            owners: [first, second].map(|seen| u32::from(seen.billboard.owner)),
        }
    }

    /// Whether two sources are shown.
    const fn is_blended(&self) -> bool {
        self.beside_weight > 0.0
    }
}

/// The directions of the base line and of the upright sides once the rectangle is turned towards the viewer: about the
/// vertical, then about its base line. `away` is the level direction away from the viewer.
///
/// A rectangle nearly edge-on would vanish; beyond [`UNTURNED_RAD`] it follows a level viewer, so it is turned by at most
/// 30 degrees and never seen narrower than half its width. From straight above it would vanish too: it leans back from a
/// viewer higher than [`UPRIGHT_RAD`], and faces the more the higher the viewer is, so that from above it lies head
/// upwards in the picture and is never seen lower than two thirds of its height.
fn turned_towards(right_in_world: DVec3, to_viewer: DVec3, away: DVec2) -> [DVec3; 2] {
    let steepness = (to_viewer.z.clamp(-1.0, 1.0).asin() - UPRIGHT_RAD).max(0.0);
    let unturned = UNTURNED_RAD * (1.0 - steepness / UPRIGHT_RAD).max(0.0);
    let towards = -away;
    let along = right_in_world.truncate();
    let front = DVec2::new(along.y, -along.x);
    // Angle of the viewer from the front or the back, whichever is nearer: -pi/2 to pi/2.
    let sideways = towards.dot(along) * towards.dot(front).signum();
    let angle = sideways.atan2(towards.dot(front).abs());
    // Turning towards the viewer's side is against the base line's own sense (front is to its right).
    let excess = angle.signum() * (angle.abs() - unturned).max(0.0);
    let right = DQuat::from_rotation_z(excess) * right_in_world;
    let level = DVec3::new(right.y, -right.x, 0.0);
    let back = if level.truncate().dot(away) >= 0.0 { level } else { -level };
    let (sin, cos) = steepness.sin_cos();
    [right, DVec3::Z * cos + back * sin]
}

/// Draws entities.
#[derive(Debug)]
pub(crate) struct BillboardPass {
    frames: LiveFrames,
    layout: wgpu::BindGroupLayout,
    /// Without a second source, and with; each without gains, and with; each without owners, and with.
    pipelines: [[[BySamples; 2]; 2]; 2],
    /// The same, of depths alone, which gains do not change.
    cutouts: [[BySamples; 2]; 2],
    instances: GrowingBuffer,
    owners: GrowingBuffer,
}

const LABEL: &str = "billboard";

impl BillboardPass {
    pub(crate) fn new(gpu: &Gpu) -> Self {
        let frames = LiveFrames::new(gpu, LABEL);
        let bound = wgpu::BufferUsages::STORAGE;
        let instances = GrowingBuffer::new("billboard instances", wgpu::BufferUsages::VERTEX.union(bound));
        let owners = GrowingBuffer::new("owners of pixels", bound);
        let layout = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(LABEL),
            entries: &[read_entry(0, wgpu::ShaderStages::FRAGMENT)],
        });
        let (pipelines, cutouts) = (Default::default(), Default::default());
        Self { frames, layout, pipelines, cutouts, instances, owners }
    }

    /// Records the rectangles, given from back to front, and among them the surfaces that are translucent: the first of
    /// these after as many rectangles as the first of `ends` says, and so on. `owners` are the words of
    /// [`OwnerData`](crate::owner_data::OwnerData).
    pub(crate) fn record(
        &mut self,
        recording: &mut Recording<'_>,
        into: &DrawInto<'_>,
        (instances, owners): (&[Instance], &[u32]),
        among: Option<(&Translucent, &[u32])>,
        frames: &mut ImageArray,
    ) -> Result<(), GpuError> {
        let gpu = recording.gpu;
        let layout = wgpu::VertexBufferLayout {
            array_stride: size_of::<Instance>() as u64,
            step_mode: wgpu::VertexStepMode::Instance,
            attributes: &ATTRIBUTES,
        };
        let samples = into.targets.samples();
        let is_blended = instances.iter().any(Instance::is_blended);
        let has_owners = !owners.is_empty();
        let bind_groups = [Some(into.frame_layout), Some(&self.frames.layout), Some(&self.layout)];
        let vertices = [Some(layout)];
        // Where depths are kept: what shows more than half has one. After all colours, so that these are as without.
        let cutout = if into.targets.keeps_depth() {
            let wanted = DrawPipeline {
                label: LABEL,
                bind_groups: &bind_groups,
                vertices: &vertices,
                entry_points: ["vs_main", "fs_depth"],
                topology: wgpu::PrimitiveTopology::TriangleStrip,
                mixing: Mixing { blend: None, writes_depth: true, culls_back: false, writes_color: false },
                variant: &[
                    ("HAS_BESIDE", f64::from(u8::from(is_blended))),
                    ("HAS_OWNERS", f64::from(u8::from(has_owners))),
                ],
                samples,
            };
            let cutouts = &mut self.cutouts[usize::from(is_blended)][usize::from(has_owners)];
            Some(cutouts.get(samples, || draw_pipeline(gpu, wanted))?)
        } else {
            None
        };
        let wanted = DrawPipeline {
            label: LABEL,
            bind_groups: &bind_groups,
            vertices: &vertices,
            entry_points: MAIN,
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            mixing: Mixing {
                blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
                writes_depth: false,
                culls_back: false,
                writes_color: true,
            },
            variant: &[
                ("HAS_BESIDE", f64::from(u8::from(is_blended))),
                ("HAS_GAINS", f64::from(u8::from(into.has_gains))),
                ("HAS_OWNERS", f64::from(u8::from(has_owners))),
            ],
            samples,
        };
        let pipeline = self.pipelines[usize::from(is_blended)][usize::from(into.has_gains)]
            [usize::from(has_owners)]
        .get(samples, || draw_pipeline(gpu, wanted))?;
        let textures = self.frames.bind(gpu, frames);
        let buffer = self.instances.write(gpu, instances);
        // Something must be bound even if nobody is told apart; then nothing reads it.
        let owners = if has_owners { self.owners.write(gpu, owners) } else { buffer };
        let owners = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(LABEL),
            layout: &self.layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: owners.as_entire_binding() }],
        });
        let mut pass = recording.draw(LABEL, into);
        let draw = |pass: &mut wgpu::RenderPass<'_>, which: Range<u32>| {
            if !which.is_empty() {
                pass.set_pipeline(pipeline);
                pass.set_bind_group(1, &textures, &[]);
                pass.set_bind_group(2, &owners, &[]);
                pass.set_vertex_buffer(0, buffer.slice(..));
                pass.draw(0..4, which);
            }
        };
        let mut first = 0;
        if let Some((translucent, ends)) = among {
            for (idx, end) in ends.iter().enumerate().take(translucent.len()) {
                draw(&mut pass, first..*end);
                translucent.draw(&mut pass, idx);
                first = *end;
            }
        }
        draw(&mut pass, first..instances.len() as u32);
        if let Some(cutout) = cutout {
            pass.set_pipeline(cutout);
            pass.set_bind_group(1, &textures, &[]);
            pass.set_bind_group(2, &owners, &[]);
            pass.set_vertex_buffer(0, buffer.slice(..));
            pass.draw(0..4, 0..instances.len() as u32);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The share of a rectangle's width and of its height that a viewer sees, and its turned directions.
    fn seen(right: DVec3, to_viewer: DVec3) -> ([f64; 2], [DVec3; 2]) {
        let to_viewer = to_viewer.normalize();
        let away = -to_viewer.truncate().try_normalize().unwrap_or(-DVec2::Y);
        let [turned, up] = turned_towards(right, to_viewer, away);
        assert!((turned.length() - 1.0).abs() < 1e-9 && (up.length() - 1.0).abs() < 1e-9);
        assert!(turned.dot(up).abs() < 1e-9 && up.z > 0.7, "{turned} {up}");
        ([turned, up].map(|side| side.cross(to_viewer).length()), [turned, up])
    }

    #[test]
    fn a_rectangle_is_never_seen_narrower_than_half_nor_lower_than_two_thirds() {
        let right = DVec3::new(0.6, 0.8, 0.0);
        for elevation in (-45..=90).step_by(5) {
            for degrees in 0..360 {
                let (up, level) = f64::from(elevation).to_radians().sin_cos();
                let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
                let ([width, height], [turned, _]) = seen(right, DVec3::new(cos * level, sin * level, up));
                assert!(width >= 0.5 - 1e-9 && height >= 0.66, "{elevation} {degrees}: {width} x {height}");
                if elevation <= 45 {
                    assert!(turned.dot(right) >= 0.866 - 1e-3);
                }
            }
        }
    }

    #[test]
    fn a_rectangle_stays_as_it_is_where_it_is_seen_well() {
        let right = DVec3::new(0.6, 0.8, 0.0);
        let front = DVec3::new(0.8, -0.6, 0.0);
        for to_viewer in [front, -front, front + right, front + DVec3::Z, -front - right * 0.5] {
            let (_, turned) = seen(right, to_viewer);
            assert!((turned[0] - right).length() < 1e-9 && (turned[1] - DVec3::Z).length() < 1e-9);
        }
    }

    #[test]
    fn from_straight_above_the_head_points_upwards_in_the_picture() {
        for away in [DVec2::Y, DVec2::X, DVec2::new(-0.6, 0.8)] {
            let [right, up] = turned_towards(DVec3::new(0.6, 0.8, 0.0), DVec3::Z, away);
            assert!((up.truncate().normalize() - away).length() < 1e-9, "{up}");
            assert!(right.truncate().dot(away).abs() < 1e-9, "{right}");
        }
    }
}
