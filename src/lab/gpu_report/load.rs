//! Keeps the device busy before a picture is timed: cards lower their clocks while they wait, and times would be those of the wait.

use super::Stage;
use anyhow::Result;
use std::time::Duration;
use videofields_render::gpu::Gpu;
use videofields_vision::clock::Clock as _;

/// Values that threads write to; shaders/lab/load.wgsl masks by it.
const N_VALUES: u64 = 1 << 16;

/// Threads of one submission, by 64.
const N_GROUPS: u32 = 4096;

/// Time before the first picture of a case, after which clocks have risen.
const FIRST: Duration = Duration::from_millis(500);

/// Longest time before each further picture.
const MOST: Duration = Duration::from_millis(100);

/// Computes on a device for a while. On one that draws on the processor it does nothing: nobody lowers its clocks.
pub(super) struct Load {
    ready: Option<(wgpu::ComputePipeline, wgpu::BindGroup)>,
}

impl Load {
    pub(super) fn new(gpu: &Gpu) -> Self {
        if gpu.is_software() {
            return Self { ready: None };
        }
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("lab/load.wgsl"),
            source: wgpu::ShaderSource::Wgsl(include_str!("../../../shaders/lab/load.wgsl").into()),
        });
        let descriptor = wgpu::ComputePipelineDescriptor {
            label: Some("load"),
            layout: None,
            module: &module,
            entry_point: Some("cs_main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        };
        let pipeline = gpu.compute_pipeline("load", &descriptor);
        let kept = gpu.buffer("load", 4 * N_VALUES, wgpu::BufferUsages::STORAGE);
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("load"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: kept.as_entire_binding() }],
        });
        Self { ready: Some((pipeline, group)) }
    }

    /// Computes for half a second: before the first picture of a case.
    pub(super) fn first(&self, gpu: &Gpu, stage: &Stage<'_>) -> Result<()> {
        self.run(gpu, stage, FIRST)
    }

    /// Computes for as long as the last picture took, at most a tenth of a second: the device is busy for half of the time then.
    pub(super) fn between(&self, gpu: &Gpu, stage: &Stage<'_>, last: Duration) -> Result<()> {
        self.run(gpu, stage, last.min(MOST))
    }

    fn run(&self, gpu: &Gpu, stage: &Stage<'_>, time: Duration) -> Result<()> {
        let Some((pipeline, group)) = &self.ready else { return Ok(()) };
        let clock = stage.budget.clock;
        let until = clock.monotonic() + time;
        while clock.monotonic() < until {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            let mut pass = gpu.begin_compute_pass(&mut encoder, "load", None);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(N_GROUPS, 1, 1);
            drop(pass);
            gpu.queue.submit([encoder.finish()]);
            gpu.finish()?;
        }
        Ok(())
    }
}
