//! Devices as whoever sets up cameras is told of them: found and asked, in one question.

use super::OnvifError;
use super::clock::ClockOffset;
use super::device::{DeviceReport, Wish, describe, describe_all};
use super::media::DeviceStream;
use super::probe::{Audience, FoundDevice, probe};
use crate::ingest::MediaRoots;
use serde::Serialize;
use std::sync::Arc;
use videofields_vision::clock::Clock;
use videofields_vision::config::CameraUrl;

/// A device.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Device {
    /// Its device service at each address from which it answered, the one that was asked first.
    pub services: Vec<CameraUrl>,
    /// Its device service as it tells it, where that is at other hosts.
    pub reported_services: Vec<CameraUrl>,
    /// Address of its endpoint, where it answered a probe.
    pub endpoint: Option<String>,
    /// Its name, where it tells one.
    pub name: Option<String>,
    /// Its maker, where it tells one.
    pub maker: Option<String>,
    /// Its model, where it tells one.
    pub model: Option<String>,
    /// Offset of its clock, where it tells UTC.
    pub clock: Option<ClockOffset>,
    /// Its streams, in its own order.
    pub streams: Vec<DeviceStream>,
    /// Reason for which no more is known.
    pub problem: Option<String>,
}

/// Devices that were found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Discovery {
    /// The devices, by their addresses.
    pub devices: Vec<Device>,
    /// Answers that were left out: not understood, too long, or from where no camera may be.
    pub n_ignored: usize,
    /// True where there may be more.
    pub is_cut: bool,
}

impl Device {
    fn of(found: FoundDevice, report: DeviceReport) -> Self {
        let FoundDevice { endpoint, name, model, services, reported_services } = found;
        let DeviceReport { maker, model: told_model, clock, streams, problem } = report;
        Self {
            services,
            reported_services,
            endpoint: Some(endpoint),
            name,
            maker,
            model: told_model.or(model),
            clock,
            streams,
            problem: problem.map(|problem| problem.to_string()),
        }
    }
}

/// Finds devices and asks each for its clock and, where `credentials` are named, for its streams. Blocks for some seconds.
///
/// # Errors
/// When nobody can be asked. What is wrong with one device is told of it.
pub fn discover(
    audience: Audience,
    (roots, credentials): (&MediaRoots, Option<&str>),
    clock: &Arc<dyn Clock>,
) -> Result<Discovery, OnvifError> {
    let found = probe(audience, roots.networks())?;
    let wish = if credentials.is_some() { Wish::Streams } else { Wish::Clock };
    let urls: Vec<CameraUrl> =
        found.devices.iter().filter_map(|device| device.services.first().cloned()).collect();
    let reports = describe_all(&urls, (roots, credentials), wish, clock);
    let devices = found.devices.into_iter().zip(reports).map(|(found, report)| Device::of(found, report));
    Ok(Discovery { devices: devices.collect(), n_ignored: found.n_ignored, is_cut: found.is_cut })
}

/// Asks the device at one address for its clock, names and streams. Blocks for some seconds.
///
/// # Errors
/// When nothing is known of it: it may not be asked, is not reached, or is no such device.
pub fn ask_device(
    url: &CameraUrl,
    (roots, credentials): (&MediaRoots, Option<&str>),
    clock: &Arc<dyn Clock>,
) -> Result<Device, OnvifError> {
    let report = describe(url, (roots, credentials), Wish::Streams, clock);
    let is_known = report.clock.is_some() || report.model.is_some() || !report.streams.is_empty();
    let DeviceReport { maker, model, clock, streams, problem } = report;
    match problem {
        Some(problem) if !is_known => Err(problem),
        problem => Ok(Device {
            services: vec![url.clone()],
            reported_services: Vec::new(),
            endpoint: None,
            name: None,
            maker,
            model,
            clock,
            streams,
            problem: problem.map(|problem| problem.to_string()),
        }),
    }
}
