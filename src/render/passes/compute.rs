//! Layouts and bindings of passes that compute over lists: a buffer of parameters, storage buffers and textures, one thread an entry.
//!
//! Parameters are in a storage buffer too: where a condition or a loop depends on a uniform buffer alone, Mesa's rasteriser (22.3)
//! compiles the shader anew at each draw or dispatch, and keeps what it compiled.

use crate::gpu::{Gpu, GpuError};

/// Threads of a group, and most groups in a row.
const GROUP: u32 = 64;
const MOST_GROUPS: u32 = 65_535;

/// Use that a shader makes of what is bound after its parameters.
#[derive(Clone, Copy)]
pub(super) enum Access {
    /// A storage buffer.
    Read,
    Write,
    /// Arrays of textures.
    Colors,
    Depths,
    Sampler,
}

impl Access {
    fn kind(self) -> wgpu::BindingType {
        let texture = |sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2Array,
            multisampled: false,
        };
        match self {
            Self::Read | Self::Write => wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: matches!(self, Self::Read) },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            Self::Colors => texture(wgpu::TextureSampleType::Float { filterable: true }),
            Self::Depths => texture(wgpu::TextureSampleType::Depth),
            Self::Sampler => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        }
    }
}

/// Returns the layout of a buffer of parameters, and what comes after it.
pub(super) fn layout(gpu: &Gpu, label: &'static str, after: &[Access]) -> wgpu::BindGroupLayout {
    layout_for(gpu, label, (wgpu::ShaderStages::COMPUTE, after))
}

/// Returns such a layout for passes that draw.
pub(super) fn layout_for(
    gpu: &Gpu,
    label: &'static str,
    (visibility, after): (wgpu::ShaderStages, &[Access]),
) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None };
    let mut entries = vec![entry(0, Access::Read.kind())];
    entries.extend((1..).zip(after).map(|(binding, access)| entry(binding, access.kind())));
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
    gpu.device.create_bind_group_layout(&descriptor)
}

/// Buffers in the order of their layout.
pub(super) fn bind(
    gpu: &Gpu,
    of: (&'static str, &wgpu::BindGroupLayout),
    buffers: &[&wgpu::Buffer],
) -> wgpu::BindGroup {
    bind_beside(gpu, of, (buffers, &[]))
}

/// Buffers, and textures and samplers behind them.
pub(super) fn bind_beside(
    gpu: &Gpu,
    (label, layout): (&'static str, &wgpu::BindGroupLayout),
    (buffers, beside): (&[&wgpu::Buffer], &[wgpu::BindingResource<'_>]),
) -> wgpu::BindGroup {
    let buffers = buffers.iter().map(|buffer| buffer.as_entire_binding());
    let entries: Vec<_> = (0..)
        .zip(buffers.chain(beside.iter().cloned()))
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
        .collect();
    let descriptor = wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries };
    gpu.device.create_bind_group(&descriptor)
}

/// Entry points of the shader that is called as its passes are.
pub(super) fn pipelines<const N: usize>(
    gpu: &Gpu,
    label: &'static str,
    layout: &wgpu::BindGroupLayout,
    entry_points: [&str; N],
) -> Result<[wgpu::ComputePipeline; N], GpuError> {
    pipelines_of(gpu, label, (&[Some(layout)], &[]), entry_points)
}

/// The same with several groups, and values of override constants.
pub(super) fn pipelines_of<const N: usize>(
    gpu: &Gpu,
    label: &'static str,
    (bind_group_layouts, constants): (&[Option<&wgpu::BindGroupLayout>], &[(&str, f64)]),
    entry_points: [&str; N],
) -> Result<[wgpu::ComputePipeline; N], GpuError> {
    let module = gpu.shader(&format!("render/{label}.wgsl"))?;
    let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts,
        immediate_size: 0,
    });
    Ok(entry_points.map(|entry_point| {
        gpu.compute_pipeline(
            label,
            &wgpu::ComputePipelineDescriptor {
                label: Some(label),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants,
                    ..wgpu::PipelineCompilationOptions::default()
                },
                cache: None,
            },
        )
    }))
}

/// Runs at least so many threads in groups of [`GROUP`]; of more than one row may have there are several.
pub(super) fn dispatch(pass: &mut wgpu::ComputePass<'_>, threads: u32) {
    let n_groups = threads.div_ceil(GROUP);
    pass.dispatch_workgroups(n_groups.min(MOST_GROUPS), n_groups.div_ceil(MOST_GROUPS), 1);
}

/// A buffer that the device alone writes, of at least as many bytes as were ever asked for.
#[derive(Debug)]
pub(crate) struct DeviceBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl DeviceBuffer {
    /// None yet, for a storage buffer that may be copied and cleared.
    pub(crate) const fn new(label: &'static str) -> Self {
        let usage = wgpu::BufferUsages::STORAGE
            .union(wgpu::BufferUsages::COPY_DST)
            .union(wgpu::BufferUsages::COPY_SRC);
        Self { label, usage, buffer: None }
    }

    /// The buffer with room for so many bytes; what was in a smaller one is lost.
    pub(crate) fn sized(&mut self, gpu: &Gpu, n_bytes: u64) -> wgpu::Buffer {
        let n_bytes = n_bytes.max(16).next_multiple_of(16);
        self.buffer.take_if(|buffer| buffer.size() < n_bytes);
        self.buffer.get_or_insert_with(|| gpu.buffer(self.label, n_bytes, self.usage)).clone()
    }

    /// Bytes that it takes.
    pub(crate) fn n_bytes(&self) -> u64 {
        self.buffer.as_ref().map_or(0, wgpu::Buffer::size)
    }
}
