//! Cameras that speak ONVIF: who is in the network, how far their clocks are off, and at which URLs they give their streams.
//!
//! In: networks in which cameras may be, a login, and an address or nobody's in particular. Out: devices, their clocks and streams.
//! All that a device says comes from a stranger: it is bounded, names no host that is then asked, and is not logged. Knows no camera
//! of the daemon's.

mod clock;
mod device;
mod discovery;
mod error;
#[cfg(any(test, feature = "fuzzing"))]
pub(crate) mod fuzzing;
mod http;
mod media;
mod place;
mod probe;
mod soap;
mod token;
mod xml;

pub use clock::ClockOffset;
pub use device::{DeviceReport, Wish, describe, describe_all};
pub use discovery::{Device, Discovery, ask_device, discover};
pub use error::OnvifError;
pub use media::DeviceStream;
pub use place::device_service;
pub use probe::{Audience, FoundDevice, FoundDevices, PROBE_TIME, probe};
