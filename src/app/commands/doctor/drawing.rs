//! What draws: the GPU's adapter and driver.

use super::line::Line;
use videofields_render::gpu::Gpu;
use videofields_vision::config::Config;

pub(super) fn look(config: &Config) -> Vec<Line> {
    let wanted = &config.settings().render.adapter;
    vec![match Gpu::new(wanted) {
        Ok(gpu) if gpu.is_software() => Line::warning(
            "drawing",
            gpu.name().to_owned(),
            "no GPU: the processor draws, and slowly",
        )
        .do_this(
            "install the GPU's Vulkan driver, and give the daemon's user /dev/dri (groups video, render)",
        ),
        Ok(gpu) => Line::ok("drawing", gpu.name().to_owned()),
        Err(error) => Line::problem("drawing", "no views can be drawn".to_owned(), error.to_string())
            .do_this(
                "install a Vulkan driver (mesa-vulkan-drivers draws without a GPU), or see `render.adapter`",
            ),
    }]
}
