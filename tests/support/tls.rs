//! Certificates made for a test, and a client that trusts one of them alone.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

use rcgen::{
    BasicConstraints, CertificateParams, CertifiedKey, IsCa, KeyPair, date_time_ymd,
    generate_simple_self_signed,
};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::{ClientConfig, ClientConnection, RootCertStore, ServerConfig, StreamOwned};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tempfile::TempDir;

/// File names of a certificate and its key.
const CERTIFICATE: &str = "site.pem";
const PRIVATE_KEY: &str = "site.key";

/// The files of a certificate and its key.
pub struct Files {
    folder: TempDir,
}

impl Files {
    /// Writes a new certificate for localhost, and returns it beside the files.
    pub fn new() -> (Self, CertificateDer<'static>) {
        let files = Self { folder: TempDir::new().unwrap() };
        let made = files.renew();
        (files, made.cert.der().clone())
    }

    /// Returns the folder.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Returns the path of the certificate.
    pub fn certificate(&self) -> PathBuf {
        self.folder.path().join(CERTIFICATE)
    }

    /// Returns the path of the private key.
    pub fn private_key(&self) -> PathBuf {
        self.folder.path().join(PRIVATE_KEY)
    }

    /// Another certificate with another key in their place.
    pub fn renew(&self) -> CertifiedKey<KeyPair> {
        let made = generate_simple_self_signed(["localhost".to_owned()]).unwrap();
        std::fs::write(self.certificate(), made.cert.pem()).unwrap();
        std::fs::write(self.private_key(), made.signing_key.serialize_pem()).unwrap();
        made
    }
}

/// Writes a new certificate that is an authority's own (`CA:TRUE`) into `folder`, named as [`Files`] has them: for the server `name`,
/// and valid until the first day of `end_year`.
pub fn write_authority(folder: &Path, name: &str, end_year: i32) {
    let signing_key = KeyPair::generate().unwrap();
    let mut parameters = CertificateParams::new([name.to_owned()]).unwrap();
    parameters.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    parameters.not_before = date_time_ymd(2010, 1, 1);
    parameters.not_after = date_time_ymd(end_year, 1, 1);
    let certificate = parameters.self_signed(&signing_key).unwrap();
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join(CERTIFICATE), certificate.pem()).unwrap();
    std::fs::write(folder.join(PRIVATE_KEY), signing_key.serialize_pem()).unwrap();
}

/// Returns how a server proves its name by the certificate and the key in these files.
pub fn server(certificate: &Path, private_key: &Path) -> Arc<ServerConfig> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder =
        ServerConfig::builder_with_provider(provider).with_safe_default_protocol_versions().unwrap();
    let certificate = CertificateDer::from_pem_file(certificate).unwrap();
    let private_key = PrivateKeyDer::from_pem_file(private_key).unwrap();
    Arc::new(builder.with_no_client_auth().with_single_cert(vec![certificate], private_key).unwrap())
}

/// Connects, or fails as a test.
pub fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream
}

/// What is answered over an encrypted connection to who trusts `trusted` alone.
///
/// # Errors
/// When there is no connection, or its certificate is not trusted.
pub fn get(address: SocketAddr, trusted: CertificateDer<'static>, target: &str) -> std::io::Result<String> {
    let mut roots = RootCertStore::empty();
    roots.add(trusted).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let name = ServerName::try_from("localhost").unwrap();
    let connection = ClientConnection::new(Arc::new(config), name).unwrap();
    let mut stream = StreamOwned::new(connection, connect(address));
    write!(stream, "GET {target} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n")?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer)?;
    Ok(String::from_utf8_lossy(&answer).into_owned())
}
