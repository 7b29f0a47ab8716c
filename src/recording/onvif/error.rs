//! Errors on the way from an address to a device's description.

use crate::ingest::{CameraError, IngestError};
use crate::media::ConnectionFault;
use videofields_vision::error::ErrorKind;

/// Reason for which a device is not described.
#[derive(Debug, thiserror::Error)]
pub enum OnvifError {
    /// Its address is none that may be asked, or it is not reached.
    #[error(transparent)]
    Reach(IngestError),
    /// An address that is none of a device's.
    #[error(
        "expected a camera's address, such as 192.168.1.20, gate.example:8080 or http://192.168.1.20/onvif/device_service, \
         without user and password"
    )]
    NoAddress,
    /// It says more than a device has to say.
    #[error("{place} answers with more than {max_bytes} bytes")]
    TooMuch {
        /// Scheme, host and port.
        place: String,
        /// Most bytes.
        max_bytes: usize,
    },
    /// Its answer is none of ONVIF's.
    #[error("it does not answer as a camera with ONVIF does")]
    NotUnderstood,
    /// It refuses with a fault of its own.
    #[error("it refuses: {code}")]
    Refused {
        /// The fault's code, letters and digits alone.
        code: String,
    },
    /// It has no media service.
    #[error("it names no service that has streams")]
    NoMedia,
    /// The network gives nobody a place to send from.
    #[error("no network is there to ask in: {source}")]
    NoNetwork {
        /// Reason.
        source: std::io::Error,
    },
    /// The threads that ask cannot be started.
    #[error("cannot ask: {source}")]
    Threads {
        /// Reason.
        source: std::io::Error,
    },
    /// No random bytes are given.
    #[error("the machine gives no random bytes")]
    NoRandomness,
}

impl OnvifError {
    /// Returns the failure of a connection to `place`.
    pub(super) fn connection(place: &str, fault: ConnectionFault) -> Self {
        Self::Reach(CameraError::Connection { place: place.to_owned(), fault }.into())
    }

    /// Returns the fault of a connection, where it is one.
    pub(super) const fn fault(&self) -> Option<ConnectionFault> {
        match self {
            Self::Reach(IngestError::Camera(CameraError::Connection { fault, .. })) => Some(*fault),
            _ => None,
        }
    }

    /// Returns whether the device wants a login, or another than it was given.
    #[must_use]
    pub const fn is_of_login(&self) -> bool {
        matches!(
            self.fault(),
            Some(
                ConnectionFault::Unauthorized | ConnectionFault::LoginRefused | ConnectionFault::UnknownLogin
            )
        )
    }

    /// Returns whether the credentials that were named are not there, or may not go there.
    #[must_use]
    pub const fn is_of_credentials(&self) -> bool {
        matches!(
            self,
            Self::Reach(IngestError::Camera(
                CameraError::NoCredentials { .. }
                    | CameraError::CredentialsElsewhere { .. }
                    | CameraError::PasswordFile { .. }
                    | CameraError::PasswordVariable { .. }
            ))
        )
    }

    /// Returns whether another question to the same device may be answered all the same.
    pub(super) const fn is_of_question(&self) -> bool {
        matches!(
            self.fault(),
            None | Some(ConnectionFault::NotFound | ConnectionFault::Status(_) | ConnectionFault::Redirected)
        )
    }

    /// Returns what a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Reach(error) => error.kind(),
            Self::NoAddress => ErrorKind::Invalid,
            Self::TooMuch { .. } | Self::NotUnderstood | Self::Refused { .. } | Self::NoMedia => {
                ErrorKind::Unsupported
            }
            Self::NoNetwork { .. } | Self::Threads { .. } | Self::NoRandomness => ErrorKind::Unavailable,
        }
    }
}
