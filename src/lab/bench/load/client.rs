//! A caller's connections to the daemon that is measured.

use anyhow::{Context as _, Result, anyhow, ensure};
use axum::body::{Body, Bytes, to_bytes};
use axum::http::{Request, header};
use hyper::client::conn::http1::{SendRequest, handshake};
use hyper_util::rt::TokioIo;
use serde_json::Value;
use std::io::ErrorKind;
use std::str::FromStr;
use std::time::Duration;
use tokio::net::{TcpSocket, TcpStream, lookup_host};

/// Longest wait for an answer; the daemon's own bound is 10 s.
const PATIENCE: Duration = Duration::from_secs(30);

/// What the system keeps for a connection that is read slowly, bytes: little, so that the daemon soon has to wait for it.
const SLOW_BUFFER_BYTES: u32 = 4096;

/// Most bytes of an answer.
const MOST_BYTES: usize = 256 << 20;

/// Where the daemon is: a name or an address, and its port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Place(String);

impl FromStr for Place {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = "expected http://HOST:PORT; what is encrypted is not measured here";
        let parsed = url::Url::parse(text).map_err(|error| format!("{expected}: {error}"))?;
        let is_plain = parsed.scheme() == "http"
            && parsed.username().is_empty()
            && parsed.password().is_none()
            && parsed.path() == "/"
            && parsed.query().is_none();
        let host = parsed.host_str().filter(|_| is_plain).ok_or_else(|| expected.to_owned())?;
        Ok(Self(format!("{host}:{}", parsed.port_or_known_default().unwrap_or(80))))
    }
}

/// A whole answer.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) body: Bytes,
    /// The frame of a wall that a tile's picture is of.
    pub(super) wall_frame: Option<u64>,
}

/// A connection; none before the first question, and after one that broke off.
pub(super) type Connection = Option<SendRequest<Body>>;

/// What all callers have in common.
#[derive(Debug)]
pub(super) struct Client {
    place: Place,
    token: Option<String>,
}

impl Client {
    pub(super) const fn new(place: Place, token: Option<String>) -> Self {
        Self { place, token }
    }

    /// Asks over a connection that is kept, or made anew where there is none.
    pub(super) async fn get(&self, connection: &mut Connection, path: &str) -> Result<Answer> {
        let request = self.request("GET", path, &[], "")?;
        let asking = async {
            let mut open = match connection.take().filter(|open| !open.is_closed()) {
                Some(open) => open,
                None => self.connect().await?,
            };
            open.ready().await.context("the connection ended")?;
            let answer = whole(open.send_request(request).await.context("no answer")?).await?;
            *connection = Some(open);
            Ok(answer)
        };
        tokio::time::timeout(PATIENCE, asking).await.map_err(|elapsed| anyhow!("no answer: {elapsed}"))?
    }

    /// Asks once, over a connection of its own.
    pub(super) async fn send(
        &self,
        method: &str,
        path: &str,
        fields: &[(&str, &str)],
        body: &str,
    ) -> Result<Answer> {
        let request = self.request(method, path, fields, body)?;
        let mut open = self.connect().await?;
        whole(open.send_request(request).await.context("no answer")?).await
    }

    /// A bare connection with little room for what comes, over which `path` is asked for, if any; whoever has it reads the answer.
    pub(super) async fn open(&self, path: Option<&str>) -> Result<TcpStream> {
        let nobody = || format!("nobody answers at {}", self.place.0);
        let address = lookup_host(&self.place.0).await.with_context(nobody)?.next().with_context(nobody)?;
        let socket = if address.is_ipv4() { TcpSocket::new_v4() } else { TcpSocket::new_v6() };
        let socket = socket.context("no socket: are there descriptors left (ulimit -n)?")?;
        socket.set_recv_buffer_size(SLOW_BUFFER_BYTES).context("a connection with little room")?;
        let stream = socket.connect(address).await.with_context(nobody)?;
        let Some(path) = path else { return Ok(stream) };
        let token = self
            .token
            .as_ref()
            .map_or_else(String::new, |token| format!("authorization: Bearer {token}\r\n"));
        let head = format!("GET {path} HTTP/1.1\r\nhost: {}\r\n{token}\r\n", self.place.0);
        let mut left = head.as_bytes();
        while !left.is_empty() {
            stream.writable().await.context("the connection ended")?;
            match stream.try_write(left) {
                Ok(n_written) => left = &left[n_written..],
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error).context("the connection ended"),
            }
        }
        Ok(stream)
    }

    /// What stands at `path`, which must be JSON and there.
    pub(super) async fn json(&self, path: &str) -> Result<Value> {
        let answer = self.send("GET", path, &[], "").await?;
        ensure!(answer.status == 200, "{path}: {} {}", answer.status, String::from_utf8_lossy(&answer.body));
        serde_json::from_slice(&answer.body).with_context(|| format!("{path} is no JSON"))
    }

    fn request(
        &self,
        method: &str,
        path: &str,
        fields: &[(&str, &str)],
        body: &str,
    ) -> Result<Request<Body>> {
        let mut request = Request::builder().method(method).uri(path).header(header::HOST, &self.place.0);
        if let Some(token) = &self.token {
            request = request.header(header::AUTHORIZATION, format!("Bearer {token}"));
        }
        for (name, value) in fields {
            request = request.header(*name, *value);
        }
        request.body(Body::from(body.to_owned())).with_context(|| format!("{method} {path} is no request"))
    }

    async fn connect(&self) -> Result<SendRequest<Body>> {
        let stream = TcpStream::connect(&self.place.0).await;
        let stream = stream.with_context(|| format!("nobody answers at {}", self.place.0))?;
        stream.set_nodelay(true).context("a connection without delay")?;
        let (open, conversation) = handshake(TokioIo::new(stream)).await.context("no HTTP")?;
        // It ends with the connection; whoever asks hears of it.
        tokio::spawn(conversation);
        Ok(open)
    }
}

async fn whole(response: axum::http::Response<hyper::body::Incoming>) -> Result<Answer> {
    let (parts, body) = response.into_parts();
    let wall_frame =
        parts.headers.get("videofields-wall-frame").and_then(|value| value.to_str().ok()?.parse().ok());
    let body = to_bytes(Body::new(body), MOST_BYTES).await.context("the answer broke off")?;
    Ok(Answer { status: parts.status.as_u16(), body, wall_frame })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_a_plain_url() {
        assert_eq!("http://127.0.0.1:8080".parse(), Ok(Place("127.0.0.1:8080".to_owned())));
        assert_eq!("http://localhost/".parse(), Ok(Place("localhost:80".to_owned())));
        for text in
            ["127.0.0.1:8080", "https://localhost", "http://a:b@localhost", "http://localhost/api", ""]
        {
            assert!(text.parse::<Place>().is_err(), "{text}");
        }
    }
}
