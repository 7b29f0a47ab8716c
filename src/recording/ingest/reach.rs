//! What can go wrong between a camera and its frames. Messages name host and port, never more of a URL.

use crate::media::ConnectionFault;
use std::net::IpAddr;
use std::path::PathBuf;
use videofields_vision::config::UrlError;
use videofields_vision::error::ErrorKind;

/// A camera that is not reached, or sends nothing.
#[derive(Debug, thiserror::Error)]
pub enum CameraError {
    /// Its URL is none.
    #[error(transparent)]
    Url(#[from] UrlError),
    /// Its name is not known.
    #[error("cannot find the address of {host:?}: {detail}")]
    Unknown {
        /// The name.
        host: String,
        /// Why, in the system's words.
        detail: String,
    },
    /// It lies where no camera may be.
    #[error(
        "{place} is {address}, which is in none of the networks of media.networks: add \"{address}\" there to allow it"
    )]
    Forbidden {
        /// Scheme, host and port.
        place: String,
        /// Where it lies.
        address: IpAddr,
    },
    /// It is to log in with credentials that the configuration does not have.
    #[error("the configuration has no credentials {name:?}: {known}")]
    NoCredentials {
        /// Their name.
        name: String,
        /// Names of those that there are.
        known: String,
    },
    /// It is to log in with credentials that may not go there.
    #[error(
        "{place} is in none of the networks of credentials {name:?}: whoever keeps the configuration may add it there"
    )]
    CredentialsElsewhere {
        /// Their name.
        name: String,
        /// Scheme, host and port.
        place: String,
    },
    /// The file with its password cannot be read.
    #[error("cannot read the password in {path:?}: {source}")]
    PasswordFile {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The variable with its password is not there.
    #[error("the environment has no variable {name} with the password, or it is no UTF-8")]
    PasswordVariable {
        /// Its name.
        name: String,
    },
    /// The connection fails.
    #[error("{place} {}", words(*fault))]
    Connection {
        /// Scheme, host and port, or the device.
        place: String,
        /// How.
        fault: ConnectionFault,
    },
    /// Nothing comes.
    #[error("{place} sent no frame for {secs:.1} s")]
    Silent {
        /// Scheme, host and port, or the device.
        place: String,
        /// Seconds waited.
        secs: f64,
    },
    /// The device is not there.
    #[error("there is no device {path:?}: is the camera plugged in?")]
    NoDevice {
        /// As configured.
        path: PathBuf,
    },
    /// What is there is no camera.
    #[error("{path:?} is no V4L2 device: expected one such as /dev/video0")]
    NotADevice {
        /// As configured.
        path: PathBuf,
    },
    /// The device may not be opened.
    #[error(
        "cannot open {path:?}: {source}; who runs the daemon must be in the device's group, usually `video`"
    )]
    DeviceRefused {
        /// As configured.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

impl CameraError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Url(_)
            | Self::Forbidden { .. }
            | Self::NoCredentials { .. }
            | Self::CredentialsElsewhere { .. }
            | Self::PasswordFile { .. }
            | Self::PasswordVariable { .. }
            | Self::NotADevice { .. }
            | Self::Connection {
                fault:
                    ConnectionFault::Unauthorized | ConnectionFault::LoginRefused | ConnectionFault::Redirected,
                ..
            } => ErrorKind::Invalid,
            Self::NoDevice { .. } | Self::Connection { fault: ConnectionFault::NotFound, .. } => {
                ErrorKind::NotFound
            }
            Self::Connection {
                fault:
                    ConnectionFault::NoFormat | ConnectionFault::UnknownLogin | ConnectionFault::NoTransport,
                ..
            } => ErrorKind::Unsupported,
            Self::Unknown { .. }
            | Self::Connection { .. }
            | Self::Silent { .. }
            | Self::DeviceRefused { .. } => ErrorKind::Unavailable,
        }
    }
}

/// What follows the camera's place.
fn words(fault: ConnectionFault) -> String {
    match fault {
        ConnectionFault::Unreachable => "is not reached: nothing listens there, or there is no way there",
        ConnectionFault::TimedOut => "does not answer in time",
        ConnectionFault::Unauthorized => "refuses the user or the password, or wants one",
        ConnectionFault::NotFound => "has no such stream: the URL's path may be wrong",
        ConnectionFault::Status(status) => return format!("answers with status {status}"),
        ConnectionFault::Redirected => {
            "says that the stream is elsewhere, which is not followed: name that URL"
        }
        ConnectionFault::Insecure => "does not prove its name by a certificate that this machine trusts",
        ConnectionFault::Busy => "is in use by another program",
        ConnectionFault::Closed => "ended the connection",
        ConnectionFault::NoFormat => "gives no pictures of the asked-for format and size",
        ConnectionFault::LoginRefused => "refuses the user or the password",
        ConnectionFault::UnknownLogin => {
            "wants a login in a way that is not supported: Basic and Digest (MD5, SHA-256) are"
        }
        ConnectionFault::NoTransport => "gives its stream neither over TCP nor over UDP",
        ConnectionFault::Garbled => {
            "does not answer as a camera of that kind does: is it another service's port?"
        }
    }
    .to_owned()
}
