//! One headless device and what went wrong on it.
//!
//! wgpu reports most failures out of line, through callbacks; they are kept here until [`Gpu::check`] hands them to
//! whoever drew last.

use super::shader::compose;
use super::tally::Tally;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use videofields_vision::error::ErrorKind;

/// How long the device may take to finish what was submitted before it is given up.
const FINISH_WITHIN: Duration = Duration::from_secs(120);

/// What the device or its driver refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No adapter of that name.
    #[error("no Vulkan adapter has {wanted:?} in its name; there are: {found}")]
    NoAdapter {
        /// Part of the name that was asked for.
        wanted: String,
        /// Names of all adapters.
        found: String,
    },
    /// The adapter gives no device.
    #[error("the adapter {adapter} gives no device: {message}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// The driver's words.
        message: String,
    },
    /// The device is gone and must be made anew.
    #[error("the GPU was lost: {message}")]
    Lost {
        /// The driver's words.
        message: String,
    },
    /// Not enough memory for what was asked.
    #[error("the GPU has too little memory: {message}")]
    OutOfMemory {
        /// The driver's words.
        message: String,
    },
    /// A command or resource that breaks the rules: a fault of this program.
    #[error("the GPU refused a command: {message}")]
    Refused {
        /// wgpu's words.
        message: String,
    },
}

impl GpuError {
    /// What a caller can do about it. After `Unavailable` the device must be made anew.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::NoAdapter { .. } | Self::NoDevice { .. } => ErrorKind::Unsupported,
            Self::Lost { .. } => ErrorKind::Unavailable,
            Self::OutOfMemory { .. } => ErrorKind::TooLarge,
            Self::Refused { .. } => ErrorKind::Internal,
        }
    }

    /// Whether the device is gone, so that only a new [`Gpu`] can go on.
    #[must_use]
    pub const fn is_lost(&self) -> bool {
        matches!(self, Self::Lost { .. })
    }
}

impl From<wgpu::Error> for GpuError {
    fn from(error: wgpu::Error) -> Self {
        let message = error.to_string();
        match error {
            wgpu::Error::OutOfMemory { .. } => Self::OutOfMemory { message },
            wgpu::Error::Validation { .. } | wgpu::Error::Internal { .. } => Self::Refused { message },
        }
    }
}

/// What the callbacks reported: the first fault since the last check, and the loss for good.
#[derive(Debug, Default)]
struct Faults {
    first: Option<GpuError>,
    loss: Option<String>,
}

/// A device and its queue. Dropping it frees everything on it.
#[derive(Debug)]
pub struct Gpu {
    /// The device.
    pub device: wgpu::Device,
    /// Its queue.
    pub queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    limits: wgpu::Limits,
    faults: Arc<Mutex<Faults>>,
    pub(super) tally: Tally,
}

impl Gpu {
    /// A device of the best Vulkan adapter (discrete, integrated, virtual, then software) with `adapter_name_part`
    /// in its name, whatever its case; empty takes any.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] and [`GpuError::NoDevice`].
    pub fn new(adapter_name_part: &str) -> Result<Self, GpuError> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN,
            flags: wgpu::InstanceFlags::empty(),
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
        let wanted = adapter_name_part.to_lowercase();
        let found: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
        adapters.retain(|adapter| adapter.get_info().name.to_lowercase().contains(&wanted));
        adapters.sort_by_key(|adapter| preference(adapter.get_info().device_type));
        let Some(adapter) = adapters.into_iter().next() else {
            let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
            return Err(GpuError::NoAdapter { wanted: adapter_name_part.to_owned(), found });
        };
        Self::open(&adapter)
    }

    fn open(adapter: &wgpu::Adapter) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        let limits = adapter.limits();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("videofields"),
            required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
            required_limits: limits.clone(),
            ..wgpu::DeviceDescriptor::default()
        }))
        .map_err(|error| GpuError::NoDevice { adapter: info.name.clone(), message: error.to_string() })?;

        let faults = Arc::new(Mutex::new(Faults::default()));
        let slot = Arc::clone(&faults);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
            slot.first.get_or_insert_with(|| error.into());
        }));
        let slot = Arc::clone(&faults);
        device.set_device_lost_callback(move |reason, message| {
            let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
            slot.loss.get_or_insert_with(|| format!("{reason:?}: {message}"));
        });
        Ok(Self { device, queue, info, limits, faults, tally: Tally::default() })
    }

    /// What loses the device on purpose, from any thread; holds it until it is dropped.
    pub fn loss(&self) -> impl Fn() + Send + Sync + use<> {
        let device = self.device.clone();
        move || device.destroy()
    }

    /// Name of the adapter, as the driver gives it.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// Returns the driver's name and version, in its own words.
    #[must_use]
    pub fn driver(&self) -> (&str, &str) {
        (&self.info.driver, &self.info.driver_info)
    }

    /// Whether the adapter draws on the processor (lavapipe and its like).
    #[must_use]
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Returns the bytes of the device's memory that wgpu holds for buffers and textures, used or kept for later; `None` where the
    /// allocator does not tell.
    #[must_use]
    pub fn memory_bytes(&self) -> Option<u64> {
        Some(self.device.generate_allocator_report()?.total_reserved_bytes)
    }

    /// What the device can do at most.
    #[must_use]
    pub const fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// Whether passes can be timed.
    #[must_use]
    pub fn has_timestamps(&self) -> bool {
        self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// Compiles a shader by its path beneath `shaders/`; the module bears that path as its label.
    ///
    /// # Errors
    /// [`GpuError::Refused`] for a path that is not embedded; what the compiler finds comes with [`Self::check`].
    pub fn shader(&self, path: &str) -> Result<wgpu::ShaderModule, GpuError> {
        let source = compose(path).map_err(|message| GpuError::Refused { message })?;
        Ok(self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(path),
            source: wgpu::ShaderSource::Wgsl(source.into()),
        }))
    }

    /// Hands out the first fault since the last call, if there was one; a loss is handed out every time.
    ///
    /// # Errors
    /// Whatever the device reported.
    pub fn check(&self) -> Result<(), GpuError> {
        let mut faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        let first = faults.first.take();
        if let Some(message) = &faults.loss {
            return Err(GpuError::Lost { message: message.clone() });
        }
        first.map_or(Ok(()), Err)
    }

    /// Waits until the device has finished everything submitted.
    ///
    /// # Errors
    /// A loss (also when it takes longer than two minutes), or what the device reported meanwhile.
    pub fn finish(&self) -> Result<(), GpuError> {
        let waited =
            self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(FINISH_WITHIN) });
        self.check()?;
        waited.map(drop).map_err(|error| GpuError::Lost { message: error.to_string() })
    }
}

const fn preference(device_type: wgpu::DeviceType) -> u8 {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}
