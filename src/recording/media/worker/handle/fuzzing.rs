//! Truths about the daemon's side of a worker, whatever a worker sends.

use super::super::channel::{Deadline, Files, Received, Receiver};
use super::super::format::Format;
use super::*;
use crate::media::fuzzing::{pieces, without_complaints};
use rustix::net::RecvFlags;
use std::collections::VecDeque;
use std::os::unix::net::UnixStream;

/// Most messages of one worker.
const MAX_TAKEN: usize = 64;

/// Most pictures that are in use at once.
const MAX_HELD: usize = 4;

/// Most bytes behind a message over a socket.
const MAX_BEHIND_BYTES: usize = 16;

/// Takes a worker's messages: pictures lie in memory, counts grow and have an end, texts are short and plain, memory is bounded, and
/// formats are such as the daemon itself would tell.
///
/// The first byte is the work, messages follow one upon the other.
pub fn worker_messages(data: &[u8]) -> usize {
    without_complaints(|| take_all(data))
}

fn take_all(data: &[u8]) -> usize {
    let [work, rest @ ..] = data else { return 0 };
    let mut rest = rest;
    let (ours, theirs) = UnixStream::pair().expect("a socket is made");
    let theirs = OwnedFd::from(theirs);
    let queue = Arc::new(EncodedQueue::new(1 << 20));
    let work = match *work % 3 {
        0 => Work::Frames,
        1 => Work::File(File::open("/dev/null").expect("a file is there"), Some(Arc::clone(&queue))),
        _ => Work::Stream(Box::new(std::io::repeat(7).take(1 << 16))),
    };
    let process = Process::of_command("true", OwnedFd::from(ours));
    let mut handle =
        WorkerHandle::with_process(process, work, Times::Played).expect("a worker is reported to begin");
    let (mut held, mut n_taken) = (VecDeque::new(), 0);
    while n_taken < MAX_TAKEN
        && let Ok((message, behind)) = postcard::take_from_bytes::<FromWorker>(rest)
    {
        rest = behind;
        holds_written(&message);
        handle.ask();
        let payload = behind[..behind.len().min(MAX_BEHIND_BYTES)].to_vec();
        let before = (handle.reported.n_damaged, handle.reported.n_replaced, queue.n_dropped());
        let taken = handle.take(message, payload);
        n_taken += 1;
        holds_told(&handle, &queue, before);
        match taken {
            Ok(picture) => held.extend(picture.inspect(holds_picture)),
            Err(reason) => {
                assert!(reason.starts_with("it ") || reason.starts_with("no "), "{reason}");
                break;
            }
        }
        while held.len() > MAX_HELD {
            held.pop_front();
        }
        hear(&theirs);
    }
    drop(held);
    assert_eq!(handle.link.held_bytes.load(Ordering::Relaxed), 0, "nothing is in use");
    n_taken
}

/// Takes everything that the daemon says, which would wait otherwise.
fn hear(socket: &OwnedFd) {
    let mut bytes = vec![0; 1 << 16];
    while matches!(rustix::net::recv(socket, &mut bytes[..], RecvFlags::DONTWAIT), Ok((_, n)) if n > 0) {}
}

fn holds_written(message: &FromWorker) {
    let written = postcard::to_allocvec(message).expect("a message is written");
    let read: FromWorker = postcard::from_bytes(&written).expect("what is written is read");
    assert_eq!(format!("{read:?}"), format!("{message:?}"));
    if let FromWorker::Format(format) = message
        && let Some(caps) = format.caps()
    {
        assert_eq!(Format::of(&caps).as_ref(), Some(format), "of {caps}");
    }
}

fn holds_told(handle: &WorkerHandle, queue: &EncodedQueue, before: (u64, u64, u64)) {
    let reported = &handle.reported;
    let counts =
        [(before.0, reported.n_damaged), (before.1, reported.n_replaced), (before.2, queue.n_dropped())];
    // The queue leaves out frames for itself too.
    let most = MAX_COUNT + MAX_TAKEN as u64;
    assert!(counts.iter().all(|(before, now)| before <= now && *now <= most), "{counts:?}");
    let is_plain = |text: &str| text.chars().count() <= MAX_LETTERS && !text.contains(char::is_control);
    assert!(reported.codec.as_deref().is_none_or(is_plain), "{reported:?}");
    assert!(reported.duration_nanos.is_none_or(|nanos| (1..=MAX_NANOS).contains(&nanos)), "{reported:?}");
    if let Some(fault) = &reported.fault {
        let text = fault.to_string();
        assert!(text.len() < 9 * MAX_LETTERS && !text.contains(char::is_control), "{text:?}");
    }
    let n_bytes: u64 = handle.blocks.values().map(|block| block.len_bytes()).sum();
    let most = MAX_SPARE_BYTES + (MAX_HELD as u64 + 2) * (MAX_PICTURE_BYTES + (4 << 20));
    assert!(n_bytes <= most, "{n_bytes} bytes of memory");
}

fn holds_picture(picture: &Picture) {
    assert!(!announced::is_too_large((picture.image.width(), picture.image.height())));
    for plane in 0..3 {
        let plane = picture.image.plane(plane);
        for y in [0, plane.height - 1] {
            assert_eq!(plane.row(y).len(), plane.width as usize);
            std::hint::black_box(plane.row(y).last());
        }
    }
    for nanos in [picture.stream_nanos, picture.interval_nanos, picture.reference_nanos] {
        assert!(nanos.is_none_or(|nanos| (0..=MAX_NANOS).contains(&nanos)), "{picture:?}");
    }
}

/// Receives messages over a socket: the same as stand in the bytes, however these are cut.
///
/// The first byte says how the others are cut.
pub fn worker_channel(data: &[u8]) -> usize {
    let [seed, bytes @ ..] = data else { return 0 };
    let (ours, theirs) = UnixStream::pair().expect("a socket is made");
    let theirs = OwnedFd::from(theirs);
    let mut receiver = Receiver::new(OwnedFd::from(ours), Files::Refused, MAX_BEHIND_BYTES);
    let (mut found, mut is_closed) = (Vec::new(), false);
    for piece in pieces(*seed, bytes) {
        let sent = rustix::net::send(&theirs, piece, rustix::net::SendFlags::NOSIGNAL);
        assert_eq!(sent, Ok(piece.len()));
        while !is_closed {
            match receiver.receive::<FromWorker>(Deadline::after(Duration::ZERO)) {
                Received::Message(message, behind) => found.push((format!("{message:?}"), behind)),
                Received::Nothing => break,
                Received::Closed => is_closed = true,
            }
        }
    }
    assert_eq!((&found, is_closed), (&written(bytes).0, written(bytes).1));
    found.len()
}

/// Returns the messages that stand in `bytes`, up to one that is cut, and whether one is none.
fn written(mut bytes: &[u8]) -> (Vec<(String, Vec<u8>)>, bool) {
    let mut found = Vec::new();
    while let Some((lengths, rest)) = bytes.split_first_chunk::<8>() {
        let number =
            |at: usize| lengths[at..at + 4].iter().rev().fold(0, |sum, byte| sum << 8 | usize::from(*byte));
        let (n_message, n_behind) = (number(0), number(4));
        if n_message > 256 << 10 || n_behind > MAX_BEHIND_BYTES {
            return (found, true);
        }
        let Some((whole, rest)) = rest.split_at_checked(n_message + n_behind) else { break };
        let (message, behind) = whole.split_at(n_message);
        match postcard::take_from_bytes::<FromWorker>(message) {
            Ok((message, [])) => found.push((format!("{message:?}"), behind.to_vec())),
            _ => return (found, true),
        }
        bytes = rest;
    }
    (found, false)
}
