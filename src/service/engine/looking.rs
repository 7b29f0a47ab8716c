//! Sources that feed no camera yet: one picture of them, and which there could be.
//!
//! By the same folders and networks that cameras begin with now; what zones hide of cameras that a source feeds already is hidden
//! of it too.

use super::handle::{At, Door};
use super::shared::Shared;
use super::{EngineError, roster::Roster};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields_recording::ingest::{FoundFiles, IngestError, Look, StopFlag, browse, devices, look};
use videofields_recording::onvif::{self, Audience, Discovery};
use videofields_vision::config::{Place, SourceSettings};
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::{BufferPool, YuvImage, ZoneMask};

/// Cameras in the network, and the logins by which one may be asked.
#[derive(Clone, Debug, Default)]
pub struct FoundCameras {
    /// Cameras that were found.
    pub discovery: Discovery,
    /// Ids of the configuration's credentials.
    pub credentials: Vec<String>,
}

/// What could feed a camera.
#[derive(Clone, Debug, Default)]
pub struct FoundSources {
    /// Files beneath the media roots.
    pub files: FoundFiles,
    /// Cameras at this machine.
    pub devices: Vec<PathBuf>,
}

impl Shared {
    /// Looks at a source: [`Door::look`].
    pub(super) fn look_at(
        &self,
        source: &SourceSettings,
        at_secs: f64,
        stop: &StopFlag,
    ) -> Result<Look, EngineError> {
        let roster = self.feeding()?;
        let seen = look(source, at_secs, &roster.roots(), stop).map_err(|error| told(&error, source))?;
        let mut hidden = Vec::new();
        for camera in roster.settings().iter().filter(|camera| camera.source.place() == source.place()) {
            hidden.extend(self.hidden(camera.id.as_str(), At::Live)?);
        }
        Ok(Look { image: masked(&seen.image, &hidden), ..seen })
    }

    /// Looks around: [`Door::find_sources`].
    pub(super) fn sources(&self, under: Option<&Path>, stop: &StopFlag) -> Result<FoundSources, EngineError> {
        let files = browse(&self.feeding()?.roots(), under, stop).map_err(|error| EngineError::Source {
            fault: Fault::new("under", error.to_string()),
            kind: error.kind(),
        })?;
        Ok(FoundSources { files, devices: devices() })
    }

    /// Finds cameras in the network: [`Door::discover`].
    pub(super) fn cameras_in_network(
        &self,
        address: Option<&str>,
        credentials: Option<&str>,
    ) -> Result<FoundCameras, EngineError> {
        let roots = self.feeding()?.roots();
        let wish = (&roots, credentials);
        let discovery = match address {
            None => onvif::discover(Audience::Everybody, wish, &self.clock),
            Some(address) => onvif::device_service(address)
                .and_then(|url| onvif::ask_device(&url, wish, &self.clock))
                .map(|device| Discovery { devices: vec![device], ..Discovery::default() }),
        };
        let discovery = discovery.map_err(|error| EngineError::Source {
            fault: Fault::new(
                if error.is_of_credentials() { "/credentials" } else { "/address" },
                error.to_string(),
            ),
            kind: error.kind(),
        })?;
        let credentials = roots.credentials().iter().map(|login| login.id.clone()).collect();
        Ok(FoundCameras { discovery, credentials })
    }

    fn feeding(&self) -> Result<&Roster, EngineError> {
        self.roster.as_deref().ok_or_else(|| EngineError::Unavailable("no cameras are run".to_owned()))
    }
}

/// What is wrong with a source, where a request's body says it.
fn told(error: &IngestError, source: &SourceSettings) -> EngineError {
    let place = match source.place() {
        Some(Place::Path(_)) => "/source/path",
        Some(Place::Url(_)) => "/source/url",
        Some(Place::Device(_)) => "/source/device",
        None => "/source",
    };
    let fault = match error {
        IngestError::CutAway { .. } => Fault::new("/at_secs", "the file ends before that time"),
        error => Fault::new(place, error.to_string()),
    };
    match error.kind() {
        ErrorKind::Internal => EngineError::Internal(error.to_string()),
        kind => EngineError::Source { fault, kind },
    }
}

fn masked(image: &Arc<YuvImage>, hidden: &[Vec<[f64; 2]>]) -> Arc<YuvImage> {
    if hidden.is_empty() {
        return Arc::clone(image);
    }
    let polygons = hidden.iter().map(|polygon| &polygon[..]);
    let mask = ZoneMask::of(polygons, (image.width(), image.height()));
    Arc::new(image.masked_of(&BufferPool::new(1), &Arc::new(mask)))
}
