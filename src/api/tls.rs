//! What encrypts connections: a certificate and its key from PEM files, exchanged for newer ones while the server runs.

use rustls::crypto::{CryptoProvider, ring};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::{ClientHello, ResolvesServerCert};
use rustls::sign::CertifiedKey;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use thiserror::Error;
use tokio::net::TcpStream;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;

/// Most bytes of a file; a chain of certificates has some thousands.
const MAX_FILE_BYTES: u64 = 1 << 20;

/// Why connections cannot be encrypted.
#[derive(Debug, Error)]
pub enum TlsError {
    /// A file cannot be read.
    #[error("cannot read {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file has something else than it should.
    #[error("{}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What was expected.
        message: String,
    },
    /// Certificate and key do not go together, or cannot be used.
    #[error("the certificate of {} cannot be used with the key of {}", certificate.display(), private_key.display())]
    Unusable {
        /// The certificate's file.
        certificate: PathBuf,
        /// The key's file.
        private_key: PathBuf,
        /// Why.
        source: rustls::Error,
    },
}

/// A certificate and its key, as they are now. TLS 1.2 and 1.3.
pub struct Tls {
    certificate: PathBuf,
    private_key: PathBuf,
    provider: Arc<CryptoProvider>,
    current: Arc<Current>,
    acceptor: TlsAcceptor,
}

/// What new connections are answered with.
#[derive(Debug)]
struct Current(RwLock<Pair>);

#[derive(Clone, Debug)]
struct Pair {
    key: Arc<CertifiedKey>,
    /// Of both files' bytes.
    digest: [u8; 32],
}

impl ResolvesServerCert for Current {
    fn resolve(&self, _hello: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        Some(Arc::clone(&self.0.read().unwrap_or_else(PoisonError::into_inner).key))
    }
}

impl Tls {
    /// A certificate (PEM, its chain after it) and its private key (PEM: PKCS #8, PKCS #1 or SEC 1, not encrypted).
    ///
    /// # Errors
    /// When a file cannot be read, has something else in it, or the two do not go together.
    pub fn load(certificate: &Path, private_key: &Path) -> Result<Self, TlsError> {
        let provider = Arc::new(ring::default_provider());
        warn_of_readers(private_key);
        let current = Arc::new(Current(RwLock::new(read_pair(certificate, private_key, &provider)?)));
        let unusable = |source| TlsError::Unusable {
            certificate: certificate.to_owned(),
            private_key: private_key.to_owned(),
            source,
        };
        let mut config = rustls::ServerConfig::builder_with_provider(Arc::clone(&provider))
            .with_safe_default_protocol_versions()
            .map_err(unusable)?
            .with_no_client_auth()
            .with_cert_resolver(Arc::clone(&current) as Arc<dyn ResolvesServerCert>);
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Self {
            certificate: certificate.to_owned(),
            private_key: private_key.to_owned(),
            provider,
            current,
            acceptor: TlsAcceptor::from(Arc::new(config)),
        })
    }

    /// Reads both files again, and says whether they had changed. Connections that are open go on as they began.
    ///
    /// # Errors
    /// As [`Tls::load`]; new connections then still get the last good certificate.
    pub fn reload(&self) -> Result<bool, TlsError> {
        let pair = read_pair(&self.certificate, &self.private_key, &self.provider)?;
        let mut current = self.current.0.write().unwrap_or_else(PoisonError::into_inner);
        let is_new = pair.digest != current.digest;
        *current = pair;
        drop(current);
        if is_new {
            warn_of_readers(&self.private_key);
        }
        Ok(is_new)
    }

    /// Agrees on keys with who connected.
    pub(super) async fn accept(&self, stream: TcpStream) -> std::io::Result<TlsStream<TcpStream>> {
        self.acceptor.accept(stream).await
    }
}

fn read_pair(certificate: &Path, private_key: &Path, provider: &CryptoProvider) -> Result<Pair, TlsError> {
    let chain_pem = read(certificate)?;
    let key_pem = read(private_key)?;
    let wrong = |path: &Path, message: String| TlsError::Content { path: path.to_owned(), message };
    let chain = CertificateDer::pem_slice_iter(&chain_pem)
        .collect::<Result<Vec<_>, _>>()
        .map_err(|error| wrong(certificate, format!("expected PEM: {error}")))?;
    if chain.is_empty() {
        return Err(wrong(certificate, "expected a certificate (-----BEGIN CERTIFICATE-----)".to_owned()));
    }
    let key = PrivateKeyDer::from_pem_slice(&key_pem).map_err(|error| {
        let expected = "expected a private key that is not encrypted (-----BEGIN PRIVATE KEY-----)";
        wrong(private_key, format!("{expected}: {error}"))
    })?;
    let key = CertifiedKey::from_der(chain, key, provider).map_err(|source| TlsError::Unusable {
        certificate: certificate.to_owned(),
        private_key: private_key.to_owned(),
        source,
    })?;
    let mut digest = Sha256::new();
    digest.update(Sha256::digest(&chain_pem));
    digest.update(Sha256::digest(&key_pem));
    Ok(Pair { key: Arc::new(key), digest: digest.finalize().into() })
}

fn read(path: &Path) -> Result<Vec<u8>, TlsError> {
    let unreadable = |source| TlsError::Unreadable { path: path.to_owned(), source };
    // Asked before it is opened: opening a pipe would wait for its other end.
    if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(TlsError::Content { path: path.to_owned(), message: "expected a file".to_owned() });
    }
    let mut bytes = Vec::new();
    File::open(path)
        .map_err(unreadable)?
        .take(MAX_FILE_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let message = format!("expected a PEM file of at most {MAX_FILE_BYTES} bytes");
        return Err(TlsError::Content { path: path.to_owned(), message });
    }
    Ok(bytes)
}

/// A key that every user of the machine can read is nobody's secret.
fn warn_of_readers(private_key: &Path) {
    let mode = std::fs::metadata(private_key).map_or(0, |metadata| metadata.mode());
    if mode & 0o007 != 0 {
        let path = private_key.display();
        tracing::warn!(%path, "the private key can be read by every user of this machine: chmod o= it");
    }
}
