//! Connections on which the other side proves its name by a certificate that this machine trusts.

use super::fault::ConnectionFault;
use rustls::pki_types::ServerName;
use std::sync::{Arc, OnceLock};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;

/// The certificates that this machine trusts, read once.
fn connector() -> Result<TlsConnector, ConnectionFault> {
    static CONNECTOR: OnceLock<Option<TlsConnector>> = OnceLock::new();
    let make = || {
        let mut roots = rustls::RootCertStore::empty();
        let found = rustls_native_certs::load_native_certs();
        for error in &found.errors {
            tracing::warn!(%error, "a trusted certificate is not read");
        }
        let (n_taken, n_left) = roots.add_parsable_certificates(found.certs);
        tracing::debug!(n_taken, n_left, "trusted certificates are read");
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let builder =
            rustls::ClientConfig::builder_with_provider(provider).with_safe_default_protocol_versions();
        let config = builder.ok()?.with_root_certificates(roots).with_no_client_auth();
        Some(TlsConnector::from(Arc::new(config)))
    };
    CONNECTOR.get_or_init(make).clone().ok_or(ConnectionFault::Insecure)
}

/// Encrypts `stream` with the server that proves to be `name`.
///
/// # Errors
/// When it does not, or the connection ends.
pub(super) async fn encrypt(stream: TcpStream, name: &str) -> Result<TlsStream<TcpStream>, ConnectionFault> {
    let name = ServerName::try_from(name.to_owned()).map_err(|_no_name| ConnectionFault::Insecure)?;
    connector()?.connect(name, stream).await.map_err(|error| {
        // TLS gives what it refuses itself as invalid data.
        if error.kind() == std::io::ErrorKind::InvalidData {
            ConnectionFault::Insecure
        } else {
            ConnectionFault::Closed
        }
    })
}
