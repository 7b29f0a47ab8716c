//! Connections on which the other side proves its name by a certificate that this machine trusts.

use super::fault::ConnectionFault;
use rustls::client::WebPkiServerVerifier;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::server::ParsedCertificate;
use rustls::{CertificateError, DigitallySignedStruct, SignatureScheme};
use std::collections::HashSet;
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
        let trusted: HashSet<CertificateDer<'static>> = found.certs.iter().cloned().collect();
        let (n_taken, n_left) = roots.add_parsable_certificates(found.certs);
        tracing::debug!(n_taken, n_left, "trusted certificates are read");
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let builder = rustls::ClientConfig::builder_with_provider(Arc::clone(&provider))
            .with_safe_default_protocol_versions();
        let chains = WebPkiServerVerifier::builder_with_provider(Arc::new(roots), provider).build();
        let verifier = Arc::new(Verifier { chains: chains.ok()?, trusted });
        let config =
            builder.ok()?.dangerous().with_custom_certificate_verifier(verifier).with_no_client_auth();
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

/// Takes a certificate that an authority which this machine trusts vouches for, and one that the machine trusts itself. Cameras often
/// sign their own as if they were an authority (`CA:TRUE`), which the library takes for no server's.
#[derive(Debug)]
struct Verifier {
    chains: Arc<WebPkiServerVerifier>,
    trusted: HashSet<CertificateDer<'static>>,
}

impl ServerCertVerifier for Verifier {
    fn verify_server_cert(
        &self,
        certificate: &CertificateDer<'_>,
        between: &[CertificateDer<'_>],
        name: &ServerName<'_>,
        ocsp_response: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        let verified = self.chains.verify_server_cert(certificate, between, name, ocsp_response, now);
        match verified {
            // Its dates were looked at before that; its name was not.
            Err(error) if is_of_authority(&error) && self.trusted.contains(certificate) => {
                rustls::client::verify_server_name(&ParsedCertificate::try_from(certificate)?, name)?;
                Ok(ServerCertVerified::assertion())
            }
            verified => verified,
        }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        self.chains.verify_tls12_signature(message, certificate, signature)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        self.chains.verify_tls13_signature(message, certificate, signature)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.chains.supported_verify_schemes()
    }
}

/// Returns true where a certificate was refused because it is an authority's.
fn is_of_authority(error: &rustls::Error) -> bool {
    let rustls::Error::InvalidCertificate(CertificateError::Other(cause)) = error else { return false };
    matches!(cause.0.downcast_ref(), Some(webpki::Error::CaUsedAsEndEntity))
}
