//! Messages over a socket, with bytes behind them, and with files where the daemon sends one.

use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::io::Errno;
use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer, SendAncillaryMessage,
    SendFlags,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::{self, IoSlice, IoSliceMut};
use std::mem::MaybeUninit;
use std::os::fd::{BorrowedFd, OwnedFd};
use std::time::Duration;

/// Bytes before a message: its length and that of the bytes behind it.
const PREFIX_BYTES: usize = 8;

/// Longest message.
const MAX_MESSAGE_BYTES: usize = 256 << 10;

/// Most bytes behind a message.
pub(super) const MAX_PAYLOAD_BYTES: usize = 64 << 20;

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 64 << 10;

/// Bytes for which room stays when nothing waits.
const KEPT_BYTES: usize = 1 << 20;

/// Returns the time since some moment, which only grows.
fn monotonic() -> Duration {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    Duration::try_from(now).unwrap_or_default()
}

/// The time until which something is waited for; for ever where there is none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deadline(Option<Duration>);

impl Deadline {
    pub(super) const NEVER: Self = Self(None);

    pub(super) fn after(patience: Duration) -> Self {
        Self(Some(monotonic().saturating_add(patience)))
    }

    /// Waits until a socket is as `wanted`; false where it is not in time.
    fn wait(self, socket: &OwnedFd, wanted: PollFlags) -> bool {
        let mut sockets = [PollFd::new(socket, wanted)];
        let left = self.0.map(|until| until.saturating_sub(monotonic()));
        let left = left.and_then(|left| Timespec::try_from(left).ok());
        matches!(rustix::event::poll(&mut sockets, left.as_ref()), Ok(n) if n > 0)
    }

    pub(super) fn is_over(self) -> bool {
        self.0.is_some_and(|until| monotonic() >= until)
    }
}

/// Sends messages; one at a time.
#[derive(Debug)]
pub(super) struct Sender {
    socket: OwnedFd,
    message: Vec<u8>,
    /// Time for which a message may wait; for ever where there is none.
    patience: Option<Duration>,
    /// True once a message was not sent whole: nothing that followed would be understood.
    is_broken: bool,
}

impl Sender {
    pub(super) const fn new(socket: OwnedFd, patience: Option<Duration>) -> Self {
        Self { socket, message: Vec::new(), patience, is_broken: false }
    }

    /// Sends a message with the bytes behind it, and a file where there is one. Waits where the other side is slow.
    ///
    /// # Errors
    /// When the other side is gone or takes too long; the connection ends then.
    pub(super) fn send(
        &mut self,
        message: &impl Serialize,
        payload: &[u8],
        file: Option<BorrowedFd<'_>>,
    ) -> io::Result<()> {
        self.write(message, payload.len())?;
        let sent = self.send_written(payload, file);
        if sent.is_err() {
            self.shut_down();
        }
        sent
    }

    fn send_written(&self, payload: &[u8], mut file: Option<BorrowedFd<'_>>) -> io::Result<()> {
        if self.is_broken {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let deadline = self.patience.map_or(Deadline::NEVER, Deadline::after);
        let n_bytes = self.message.len() + payload.len();
        let mut n_sent = 0;
        while n_sent < n_bytes {
            let head = IoSlice::new(self.message.get(n_sent..).unwrap_or_default());
            let rest = IoSlice::new(&payload[n_sent.saturating_sub(self.message.len())..]);
            let files = file.as_slice();
            let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(1))];
            let mut control = SendAncillaryBuffer::new(&mut space);
            if !files.is_empty() && !control.push(SendAncillaryMessage::ScmRights(files)) {
                return Err(io::Error::other("no room for a file"));
            }
            let flags = SendFlags::NOSIGNAL | SendFlags::DONTWAIT;
            match rustix::net::sendmsg(&self.socket, &[head, rest], &mut control, flags) {
                Ok(n) => {
                    n_sent += n;
                    file = None;
                }
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => {
                    if !deadline.wait(&self.socket, PollFlags::OUT) {
                        return Err(io::ErrorKind::TimedOut.into());
                    }
                }
                Err(error) => return Err(error.into()),
            }
            if n_sent < n_bytes && deadline.is_over() {
                return Err(io::ErrorKind::TimedOut.into());
            }
        }
        Ok(())
    }

    /// Sends a short message, unless that would have to wait; true where it was sent.
    pub(super) fn try_send(&mut self, message: &impl Serialize) -> bool {
        if self.is_broken || self.write(message, 0).is_err() {
            return false;
        }
        let flags = SendFlags::NOSIGNAL | SendFlags::DONTWAIT;
        match rustix::net::send(&self.socket, &self.message, flags) {
            Ok(n) if n == self.message.len() => true,
            Ok(_cut) => {
                self.shut_down();
                false
            }
            Err(_full) => false,
        }
    }

    /// Sends bytes that are no message.
    #[cfg(test)]
    pub(super) fn send_raw(&self, bytes: &[u8]) {
        let sent = rustix::net::send(&self.socket, bytes, SendFlags::NOSIGNAL);
        assert_eq!(sent, Ok(bytes.len()));
    }

    fn write(&mut self, message: &impl Serialize, payload_bytes: usize) -> io::Result<()> {
        if payload_bytes > MAX_PAYLOAD_BYTES {
            return Err(io::Error::other("more bytes than a message may have"));
        }
        self.message.clear();
        self.message.resize(PREFIX_BYTES, 0);
        let bytes = std::mem::take(&mut self.message);
        self.message = postcard::to_extend(message, bytes).map_err(io::Error::other)?;
        let message_bytes = self.message.len() - PREFIX_BYTES;
        if message_bytes > MAX_MESSAGE_BYTES {
            return Err(io::Error::other("a message is too long"));
        }
        self.message[..4].copy_from_slice(&(message_bytes as u32).to_le_bytes());
        self.message[4..8].copy_from_slice(&(payload_bytes as u32).to_le_bytes());
        Ok(())
    }

    /// Ends the connection, whoever waits for something of it.
    pub(super) fn shut_down(&mut self) {
        self.is_broken = true;
        hang_up(&self.socket);
    }
}

/// Ends the connection of a socket, whoever waits for something of it.
pub(super) fn hang_up(socket: &OwnedFd) {
    if let Err(error) = rustix::net::shutdown(socket, rustix::net::Shutdown::Both) {
        tracing::trace!(%error, "a connection with a worker has ended already");
    }
}

/// Receives messages.
#[derive(Debug)]
pub(super) struct Receiver {
    socket: OwnedFd,
    files: Files,
    bytes: Vec<u8>,
    /// Bytes at the front that were taken.
    n_taken: usize,
    /// Most bytes that may follow a message.
    max_payload_bytes: usize,
}

/// Fate of files that come with messages.
#[derive(Debug)]
pub(super) enum Files {
    /// They are closed unseen.
    Refused,
    /// They are kept until they are taken.
    Kept(Vec<OwnedFd>),
}

/// Outcome of waiting for a message.
#[derive(Debug)]
pub(super) enum Received<M> {
    /// A message, and the bytes behind it.
    Message(M, Vec<u8>),
    /// Nothing came in time.
    Nothing,
    /// The other side is gone, or sent what is none of the protocol.
    Closed,
}

impl Receiver {
    pub(super) const fn new(socket: OwnedFd, files: Files, max_payload_bytes: usize) -> Self {
        Self { socket, files, bytes: Vec::new(), n_taken: 0, max_payload_bytes }
    }

    /// Returns the file that came longest ago and was not taken.
    pub(super) fn take_file(&mut self) -> Option<OwnedFd> {
        match &mut self.files {
            Files::Kept(files) if !files.is_empty() => Some(files.remove(0)),
            _ => None,
        }
    }

    /// Waits for a message.
    pub(super) fn receive<M: DeserializeOwned>(&mut self, deadline: Deadline) -> Received<M> {
        loop {
            match self.parse() {
                Ok(Some((message, payload))) => return Received::Message(message, payload),
                Ok(None) => {}
                Err(error) => {
                    tracing::debug!(%error, "a worker's message is not understood");
                    return Received::Closed;
                }
            }
            if !deadline.wait(&self.socket, PollFlags::IN) {
                return Received::Nothing;
            }
            match self.read() {
                Ok(0) => return Received::Closed,
                Ok(_) | Err(Errno::INTR) => {}
                Err(error) => {
                    tracing::debug!(%error, "a worker's socket cannot be read");
                    return Received::Closed;
                }
            }
            if deadline.is_over() {
                // One that sends a byte now and then has sent no message.
                return match self.parse() {
                    Ok(Some((message, payload))) => Received::Message(message, payload),
                    Ok(None) => Received::Nothing,
                    Err(_unclear) => Received::Closed,
                };
            }
        }
    }

    fn read(&mut self) -> Result<usize, Errno> {
        if self.n_taken > 0 {
            self.bytes.drain(..self.n_taken);
            self.n_taken = 0;
        }
        if self.bytes.is_empty() {
            self.bytes.shrink_to(KEPT_BYTES);
        }
        let n_before = self.bytes.len();
        let missing = self.lengths().map_or(0, |(message, payload)| PREFIX_BYTES + message + payload);
        let n_more = missing.saturating_sub(n_before).max(CHUNK_BYTES);
        self.bytes.resize(n_before + n_more, 0);
        let read = match &mut self.files {
            Files::Refused => {
                rustix::net::recv(&self.socket, &mut self.bytes[n_before..], RecvFlags::empty())
                    .map(|(_filled, n)| n)
            }
            Files::Kept(files) => receive_with_files(&self.socket, &mut self.bytes[n_before..], files),
        };
        self.bytes.truncate(n_before + *read.as_ref().unwrap_or(&0));
        read
    }

    /// Returns the lengths of the first message that was not taken, and of the bytes behind it.
    fn lengths(&self) -> Option<(usize, usize)> {
        let prefix = self.bytes.get(self.n_taken..)?.first_chunk::<PREFIX_BYTES>()?;
        let [a, b, c, d, e, f, g, h] = *prefix;
        let of = |bytes| u32::from_le_bytes(bytes) as usize;
        Some((of([a, b, c, d]), of([e, f, g, h])))
    }

    fn parse<M: DeserializeOwned>(&mut self) -> io::Result<Option<(M, Vec<u8>)>> {
        let Some((message_bytes, payload_bytes)) = self.lengths() else { return Ok(None) };
        if message_bytes > MAX_MESSAGE_BYTES || payload_bytes > self.max_payload_bytes {
            return Err(io::Error::other("a message is too long"));
        }
        let from = self.n_taken + PREFIX_BYTES;
        let Some(rest) = self.bytes.get(from..from + message_bytes + payload_bytes) else { return Ok(None) };
        let (message, payload) = rest.split_at(message_bytes);
        let (message, unread) = postcard::take_from_bytes(message).map_err(io::Error::other)?;
        if !unread.is_empty() {
            return Err(io::Error::other("a message is longer than it should be"));
        }
        let payload = payload.to_vec();
        self.n_taken = from + message_bytes + payload_bytes;
        Ok(Some((message, payload)))
    }
}

/// Receives bytes, and the files that come with them.
fn receive_with_files(socket: &OwnedFd, into: &mut [u8], files: &mut Vec<OwnedFd>) -> Result<usize, Errno> {
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(4))];
    let mut control = RecvAncillaryBuffer::new(&mut space);
    let mut into = [IoSliceMut::new(into)];
    let received = rustix::net::recvmsg(socket, &mut into, &mut control, RecvFlags::CMSG_CLOEXEC)?;
    for message in control.drain() {
        if let RecvAncillaryMessage::ScmRights(came) = message {
            files.extend(came);
        }
    }
    Ok(received.bytes)
}
