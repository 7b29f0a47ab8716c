//! RTSP cameras.
//!
//! Over TCP by default. What the camera says of the time of capture (RTCP sender reports) comes with the frames.

use super::endpoint::Endpoint;
use super::live::LiveSource;
use super::secret::Credentials;
use super::{IngestError, MediaRoots, StopFlag, Tap};
use crate::media::Input;
use videofields_vision::config::SourceSettings;

/// Begins to connect to the camera at `endpoint`.
pub(super) fn open(
    endpoint: &Endpoint,
    (settings, roots): (&SourceSettings, &MediaRoots),
    stop: &StopFlag,
    tap: Tap,
) -> Result<LiveSource, IngestError> {
    let credentials = Credentials::for_camera(settings, roots, endpoint)?;
    let login = credentials.as_ref().map(Credentials::login);
    let input = Input::rtsp(&endpoint.peer(), settings.transport, login)
        .map_err(|fault| IngestError::of_fault(&endpoint.place(), fault))?;
    LiveSource::start(endpoint.place(), input, tap, stop)
}
