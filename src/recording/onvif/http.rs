//! One question to a device over HTTP, and its answer within bounds. No redirection is followed, and no proxy is asked.

use super::OnvifError;
use crate::media::{ANSWER_TIME, ConnectionFault, Fault, Peer, USER_AGENT, connect};
use http_body_util::{BodyExt, Full, LengthLimitError, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{
    AUTHORIZATION, CONNECTION, CONTENT_TYPE, HOST, USER_AGENT as USER_AGENT_HEADER, WWW_AUTHENTICATE,
};
use hyper::{Request, Response};
use hyper_util::rt::TokioIo;
use tokio::time::timeout;

/// Most bytes of an answer: a device with thirty profiles takes about a tenth of that.
pub(super) const MAX_ANSWER_BYTES: usize = 1 << 20;

/// Most challenges of an answer that are looked at.
const MAX_CHALLENGES: usize = 8;

/// A device's answer.
pub(super) struct Answer {
    /// Its status.
    pub(super) status: u16,
    /// Ways in which it wants to be told who asks.
    pub(super) challenges: Vec<String>,
    /// Its text.
    pub(super) text: String,
}

/// A message and what goes before it.
pub(super) struct HttpMessage<'a> {
    /// Media type of the message.
    pub(super) content_type: &'a str,
    /// Login under which it is sent, where HTTP carries it.
    pub(super) authorization: Option<String>,
    /// The message.
    pub(super) message: String,
}

/// Sends a message to `peer` over a connection of its own.
///
/// # Errors
/// When the device is not reached, does not answer in time, or answers with too much.
pub(super) async fn post(peer: &Peer, letter: HttpMessage<'_>) -> Result<Answer, OnvifError> {
    let fault = |fault| OnvifError::connection(&peer.place, fault);
    let answered = timeout(ANSWER_TIME, exchange(peer, letter)).await;
    answered.map_err(|_elapsed| fault(ConnectionFault::TimedOut))?
}

async fn exchange(peer: &Peer, letter: HttpMessage<'_>) -> Result<Answer, OnvifError> {
    let fault = |fault| OnvifError::connection(&peer.place, fault);
    let stream = connect(peer).await.map_err(|error| match error {
        Fault::Connection(found) => fault(found),
        _ => fault(ConnectionFault::Unreachable),
    })?;
    let mut request = Request::post(peer.path_and_query.as_str())
        .header(HOST, peer.authority.as_str())
        .header(USER_AGENT_HEADER, USER_AGENT)
        .header(CONTENT_TYPE, letter.content_type)
        .header(CONNECTION, "close");
    if let Some(authorization) = letter.authorization {
        request = request.header(AUTHORIZATION, authorization);
    }
    let request = request.body(Full::new(Bytes::from(letter.message)));
    let request = request.map_err(|_unfit| OnvifError::NotUnderstood)?;
    let broken = |error: hyper::Error| {
        fault(if error.is_parse() { ConnectionFault::Garbled } else { ConnectionFault::Closed })
    };
    let mut builder = hyper::client::conn::http1::Builder::new();
    builder
        .title_case_headers(true)
        .ignore_invalid_headers_in_responses(true)
        .allow_spaces_after_header_name_in_responses(true)
        .allow_obsolete_multiline_headers_in_responses(true);
    let (mut sender, connection) =
        builder.handshake::<_, Full<Bytes>>(TokioIo::new(stream)).await.map_err(broken)?;
    // It ends with its answer, or when the answer is dropped.
    tokio::spawn(async move {
        if let Err(error) = connection.await {
            tracing::debug!(%error, "a device's connection ended");
        }
    });
    let response = sender.send_request(request).await.map_err(broken)?;
    let status = response.status().as_u16();
    let challenges = challenges(&response);
    let body = Limited::new(response.into_body(), MAX_ANSWER_BYTES).collect().await;
    let body = body.map_err(|error| {
        if error.is::<LengthLimitError>() {
            OnvifError::TooMuch { place: peer.place.clone(), max_bytes: MAX_ANSWER_BYTES }
        } else {
            fault(ConnectionFault::Closed)
        }
    })?;
    // Names in another encoding are told as far as they can be read.
    let text = String::from_utf8_lossy(&body.to_bytes()).into_owned();
    Ok(Answer { status, challenges, text })
}

fn challenges(response: &Response<Incoming>) -> Vec<String> {
    let challenges = response.headers().get_all(WWW_AUTHENTICATE).iter();
    let challenges = challenges.filter_map(|challenge| challenge.to_str().ok());
    challenges.take(MAX_CHALLENGES).map(str::to_owned).collect()
}
