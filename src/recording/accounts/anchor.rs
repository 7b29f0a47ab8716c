//! The head of the audit log told elsewhere by HTTP: whoever rewrites the log here cannot take back what was told there.

use crate::media::{ANSWER_TIME, Peer, USER_AGENT, connect};
use crate::store::AuditState;
use http_body_util::Full;
use hyper::Request;
use hyper::body::Bytes;
use hyper::header::{CONNECTION, CONTENT_TYPE, HOST, USER_AGENT as USER_AGENT_HEADER};
use hyper_util::rt::TokioIo;
use serde_json::{Value, json};
use std::time::Duration;
use tokio::time::timeout;
use url::Url;
use videofields_vision::clock::Timestamp;

/// Time for all of it: the name's address, the connection, and the answer.
const TIME: Duration = Duration::from_secs(15);

/// Reason why nobody was told. Holds nothing of the URL but scheme, host and port.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct AnchorError {
    place: String,
    reason: String,
}

/// The newest entry of an audit log, as it is told elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Anchor {
    /// The entry's number.
    pub number: i64,
    /// Its digest, hexadecimal.
    pub digest: String,
    /// The public key and the signature, hexadecimal; none where the log is not signed.
    pub signed: Option<(String, String)>,
}

impl Anchor {
    /// Takes the newest entry as a state has it; none of an empty log.
    #[must_use]
    pub fn of(state: &AuditState) -> Option<Self> {
        let (number, digest) = state.head.clone()?;
        let signed = state.signed.as_ref().map(|signed| &signed.signature);
        let signed = signed.map(|text| (text.key.clone(), text.signature.clone()));
        Some(Self { number, digest, signed })
    }

    fn message(&self, at: Timestamp) -> Value {
        let (key, signature) = self.signed.clone().unzip();
        json!({
            "kind": "videofields audit head", "at": at.to_string(), "number": self.number, "digest": self.digest,
            "key": key, "signature": signature,
        })
    }

    /// Tells it at `url` (POST, JSON); any answer of success will do.
    ///
    /// # Errors
    /// When nobody answers there in 15 s, does not prove its name, or answers otherwise. No redirection is followed.
    pub async fn tell(&self, url: &Url, at: Timestamp) -> Result<(), AnchorError> {
        let place = url.origin().ascii_serialization();
        let told = timeout(TIME, post(url, &place, self.message(at).to_string())).await;
        let told = told.unwrap_or_else(|_elapsed| Err("no answer in time".to_owned()));
        told.map_err(|reason| AnchorError { place, reason })
    }
}

async fn post(url: &Url, place: &str, message: String) -> Result<(), String> {
    let host = url.host_str().ok_or("it has no host")?;
    let port = url.port_or_known_default().ok_or("it has no port")?;
    // Brackets are an URL's.
    let name = host.trim_start_matches('[').trim_end_matches(']').to_owned();
    let found = timeout(ANSWER_TIME, tokio::net::lookup_host((name.as_str(), port))).await;
    let mut found = found
        .map_err(|_elapsed| "its name is not found in time".to_owned())?
        .map_err(|error| format!("its name is not found: {error}"))?;
    let address = found.next().ok_or("its name has no address")?;
    let peer = Peer {
        address,
        host: name.clone(),
        is_encrypted: url.scheme() == "https",
        place: place.to_owned(),
        authority: url.port().map_or_else(|| host.to_owned(), |port| format!("{host}:{port}")),
        url: url.to_string(),
        path_and_query: url.path().to_owned(),
    };
    let stream = connect(&peer).await.map_err(|fault| fault.to_string())?;
    let request = Request::post(peer.path_and_query.as_str())
        .header(HOST, peer.authority.as_str())
        .header(USER_AGENT_HEADER, USER_AGENT)
        .header(CONTENT_TYPE, "application/json")
        .header(CONNECTION, "close")
        .body(Full::new(Bytes::from(message)))
        .map_err(|error| error.to_string())?;
    let (mut sender, connection) =
        hyper::client::conn::http1::handshake::<_, Full<Bytes>>(TokioIo::new(stream))
            .await
            .map_err(|error| error.to_string())?;
    let mut answered = std::pin::pin!(sender.send_request(request));
    // The connection ends with this: what else is said on it is not read.
    let answer = tokio::select! {
        biased;
        answer = &mut answered => answer,
        ended = connection => match ended {
            // It may have brought the answer before.
            Ok(()) => answered.await,
            Err(error) => Err(error),
        },
    };
    let status = answer.map_err(|error| error.to_string())?.status();
    if status.is_success() { Ok(()) } else { Err(format!("it answered {}", status.as_u16())) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpListener;

    /// Returns what came of telling a server that answers once, and what was said to it.
    async fn told(answer: &'static str) -> (Result<(), AnchorError>, String) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}/heads/s3cret", listener.local_addr().unwrap());
        let server = tokio::spawn(async move {
            let (mut stream, _) = listener.accept().await.unwrap();
            let mut said = Vec::new();
            while !said.ends_with(b"}") {
                let mut bytes = [0; 4096];
                let n = stream.read(&mut bytes).await.unwrap();
                said.extend(&bytes[..n]);
            }
            stream.write_all(answer.as_bytes()).await.unwrap();
            String::from_utf8(said).unwrap()
        });
        let anchor = Anchor { number: 7, digest: "ab".repeat(32), signed: None };
        let told = anchor.tell(&url.parse().unwrap(), Timestamp::from_nanos(0)).await;
        (told, server.await.unwrap())
    }

    #[tokio::test]
    async fn a_head_is_told_and_whoever_does_not_take_it_is_known() {
        let (done, said) = told("HTTP/1.1 204 No Content\r\n\r\n").await;
        done.unwrap();
        assert!(said.starts_with("POST /heads/s3cret HTTP/1.1\r\n"), "{said}");
        let body: Value = serde_json::from_str(said.split("\r\n\r\n").nth(1).unwrap()).unwrap();
        assert_eq!(
            body,
            json!({
                "kind": "videofields audit head", "at": "1970-01-01T00:00:00Z", "number": 7, "digest": "ab".repeat(32),
                "key": null, "signature": null,
            })
        );
        for (answer, expected) in [
            ("HTTP/1.1 500 No\r\ncontent-length: 0\r\n\r\n", "it answered 500"),
            ("HTTP/1.1 302 Found\r\nlocation: /\r\ncontent-length: 0\r\n\r\n", "it answered 302"),
            ("", ""),
        ] {
            let error = told(answer).await.0.unwrap_err().to_string();
            assert!(error.contains(expected) && !error.contains("s3cret"), "{error}");
        }
    }
}
