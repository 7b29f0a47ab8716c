//! The daemon that is asked: connections, encrypted or not, and single questions.

use anyhow::{Context, Result, bail};
use axum::body::{Body, Bytes, to_bytes};
use hyper::client::conn::http1::{self, SendRequest};
use hyper::header::{AUTHORIZATION, HOST};
use hyper::{HeaderMap, Request, StatusCode};
use hyper_util::rt::TokioIo;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use url::Url;

/// Where Debian and its relatives keep the certificates that the machine trusts.
const TRUSTED: &str = "/etc/ssl/certs/ca-certificates.crt";

/// Most bytes of an answer.
const MAX_BYTES: usize = 256 << 20;

/// A connection, encrypted or not.
pub(super) trait Stream: AsyncRead + AsyncWrite + Unpin + Send {}

impl<S: AsyncRead + AsyncWrite + Unpin + Send> Stream for S {}

/// What a wall says of itself.
#[derive(Debug)]
pub(super) struct WallInfo {
    pub(super) rate_hz: f64,
    pub(super) tiles: Vec<String>,
}

/// The daemon that is asked.
pub(super) struct Site {
    host: String,
    port: u16,
    /// As requests name it.
    authority: String,
    tls: Option<TlsConnector>,
    token: Option<String>,
}

/// A connection that takes one question after the other.
pub(super) struct Connection {
    requests: SendRequest<Body>,
}

impl Site {
    /// The daemon at `url`; of `certificate` must be its own, where connections are encrypted.
    pub(super) fn new(url: &str, token_file: Option<&Path>, certificate: Option<&Path>) -> Result<Self> {
        let url = Url::parse(url).with_context(|| format!("--url {url}"))?;
        let is_encrypted = match url.scheme() {
            "https" => true,
            "http" => false,
            other => bail!("--url: expected http or https, got {other}"),
        };
        if url.path() != "/"
            || url.query().is_some()
            || !url.username().is_empty()
            || url.password().is_some()
        {
            bail!("--url: expected no more than a host and a port");
        }
        let host = url.host_str().context("--url: a host is missing")?.to_owned();
        let port = url.port_or_known_default().context("--url: a port is missing")?;
        let token = token_file.map(|file| {
            let text = std::fs::read_to_string(file);
            text.map(|text| text.trim().to_owned()).with_context(|| format!("cannot read {}", file.display()))
        });
        let tls = is_encrypted.then(|| connector(certificate)).transpose()?;
        Ok(Self { authority: format!("{host}:{port}"), host, port, tls, token: token.transpose()? })
    }

    /// A new connection.
    pub(super) async fn connect(&self) -> Result<Box<dyn Stream>> {
        // An IPv6 address stands in brackets in a URL.
        let host = self.host.trim_start_matches('[').trim_end_matches(']');
        let stream = TcpStream::connect((host, self.port)).await;
        let stream = stream.with_context(|| format!("cannot connect to {}", self.authority))?;
        stream.set_nodelay(true)?;
        let Some(tls) = &self.tls else { return Ok(Box::new(stream)) };
        let name = ServerName::try_from(host.to_owned())?;
        let stream = tls.connect(name, stream).await;
        Ok(Box::new(stream.with_context(|| format!("no agreement with {}", self.authority))?))
    }

    /// A new connection for single questions.
    pub(super) async fn open(&self) -> Result<Connection> {
        let (requests, connection) = http1::handshake(TokioIo::new(self.connect().await?)).await?;
        // It ends with the last question, or when the daemon closes it: then the next question fails.
        tokio::spawn(connection);
        Ok(Connection { requests })
    }

    /// The URL of a WebSocket at `path`.
    pub(super) fn socket_url(&self, path: &str) -> String {
        let scheme = if self.tls.is_some() { "wss" } else { "ws" };
        format!("{scheme}://{}{path}", self.authority)
    }

    /// What shows who asks.
    pub(super) fn bearer(&self) -> Option<String> {
        self.token.as_ref().map(|token| format!("Bearer {token}"))
    }

    /// What a wall says of itself.
    pub(super) async fn wall(&self, id: &str) -> Result<WallInfo> {
        #[derive(Deserialize)]
        struct Answer {
            rate_hz: f64,
            tiles: Vec<Tile>,
        }
        #[derive(Deserialize)]
        struct Tile {
            id: String,
        }
        let (status, _, body) = self.open().await?.get(self, &format!("/api/v1/walls/{id}/tiles")).await?;
        if status != StatusCode::OK {
            bail!("wall {id}: {}", refusal(status, &body));
        }
        let Answer { rate_hz, tiles } = serde_json::from_slice(&body).context("not a daemon's answer")?;
        Ok(WallInfo { rate_hz, tiles: tiles.into_iter().map(|tile| tile.id).collect() })
    }
}

impl Connection {
    /// Status, fields and body of the answer at `path`.
    pub(super) async fn get(&mut self, site: &Site, path: &str) -> Result<(StatusCode, HeaderMap, Bytes)> {
        let request = Request::get(path).header(HOST, &site.authority);
        let request =
            site.bearer().into_iter().fold(request, |request, bearer| request.header(AUTHORIZATION, bearer));
        self.requests.ready().await?;
        let answer = self.requests.send_request(request.body(Body::empty())?).await?;
        let (parts, body) = answer.into_parts();
        let body = to_bytes(Body::new(body), MAX_BYTES).await?;
        Ok((parts.status, parts.headers, body))
    }
}

/// What the daemon says of a refusal.
pub(super) fn refusal(status: StatusCode, body: &[u8]) -> String {
    let problem = serde_json::from_slice::<serde_json::Value>(body).unwrap_or_default();
    match problem["detail"].as_str() {
        Some(detail) => format!("{status}: {detail}"),
        None => status.to_string(),
    }
}

fn connector(certificate: Option<&Path>) -> Result<TlsConnector> {
    let file = certificate.map_or_else(|| PathBuf::from(TRUSTED), Path::to_owned);
    let mut roots = RootCertStore::empty();
    let found = CertificateDer::pem_file_iter(&file);
    for found in found.with_context(|| format!("cannot read {}", file.display()))? {
        let found = found.with_context(|| format!("no certificate: {}", file.display()))?;
        // Among those of the machine may be some that are too old to be understood.
        let added = roots.add(found);
        if certificate.is_some() {
            added.with_context(|| format!("no good certificate: {}", file.display()))?;
        }
    }
    if roots.is_empty() {
        bail!("there is no certificate in {}", file.display());
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()?
        .with_root_certificates(roots)
        .with_no_client_auth();
    Ok(TlsConnector::from(Arc::new(config)))
}
