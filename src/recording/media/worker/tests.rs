//! Workers: what they may do, how they end, and what a false one can do to the daemon.

use super::channel::{Deadline, Files, Received, Receiver, Sender};
use super::launch::Process;
use super::message::{Block, FromWorker, Matrix, PictureHead, ToWorker};
use super::*;
use crate::media::{Decoder, EncodedQueue, Fault, Input, Picture, Times};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

const PATIENCE: Duration = Duration::from_secs(10);

fn write_video(folder: &Path) -> PathBuf {
    let path = folder.join("video.mp4");
    crate::media::tests::write_video(&path, "x264enc key-int-max=10 tune=zerolatency", "mp4mux");
    path
}

fn next(decoder: &mut Decoder) -> Result<Picture, Fault> {
    for _ in 0..100 {
        if let Some(picture) = decoder.pull(PATIENCE / 100) {
            return Ok(picture);
        }
        if let Some(fault) = decoder.fault() {
            return Err(fault);
        }
    }
    panic!("nothing came");
}

#[test]
fn a_worker_has_no_file_and_no_variable_of_the_daemon_but_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = write_video(folder.path());
    let mut decoder = Decoder::start(Input::file(&path).unwrap(), None).unwrap();
    next(&mut decoder).unwrap();
    let process = PathBuf::from(format!("/proc/{}", decoder.decoding().unwrap().process_id));
    let files = std::fs::read_dir(process.join("fd")).unwrap();
    let files: Vec<_> = files.map(|file| std::fs::read_link(file.unwrap().path()).unwrap()).collect();
    let is_known = |file: &PathBuf| {
        let kinds = ["socket:", "pipe:", "anon_inode:", "/memfd:videofields-pictures", "/dev/null"];
        *file == path || kinds.iter().any(|kind| file.to_string_lossy().starts_with(kind))
    };
    assert!(files.iter().all(is_known), "{files:?}");
    let variables = std::fs::read(process.join("environ")).unwrap();
    let names: Vec<_> = variables.split(|byte| *byte == 0).map(String::from_utf8_lossy).collect();
    assert!(!names.iter().any(|name| name.starts_with("CARGO")), "{names:?}");
    let sandbox = decoder.decoding().unwrap().sandbox;
    assert!(sandbox.has_limits && sandbox.has_seccomp, "{sandbox:?}");
}

#[test]
fn what_decoding_does_not_need_is_refused_to_a_worker() {
    let victim = trial::victim(std::process::id());
    std::fs::write(&victim, b"kept").unwrap();
    let mut handle = WorkerHandle::start(Work::Trial, Times::Played).unwrap();
    let results = (0..100).find_map(|_| {
        drop(handle.pull(PATIENCE / 100));
        handle.take_fault()
    });
    let Some(Fault::Damaged(results)) = results else { panic!("{results:?}") };
    assert_eq!(std::fs::read(&victim).unwrap(), b"kept");
    std::fs::remove_file(&victim).unwrap();
    let landlock = handle.decoding().unwrap().sandbox.landlock_abi;
    for result in results.split(", ") {
        let (trial, outcome) = result.split_once('=').unwrap();
        let is_allowed = matches!(trial, "thread" | "library" | "memory");
        // Files are Landlock's, which old kernels do not have.
        let is_files = matches!(trial, "read" | "environment") && landlock.is_none();
        assert!(is_files || (outcome == "done") == is_allowed, "{trial}: {outcome}");
    }
    assert_eq!(results.split(", ").count(), 14, "{results}");
}

#[test]
fn a_worker_that_is_killed_ends_its_stream_alone_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = write_video(folder.path());
    let start = || Decoder::start(Input::file(&path).unwrap(), None).unwrap();
    let (mut killed, mut other) = (start(), start());
    let held = next(&mut killed).unwrap();
    next(&mut other).unwrap();
    let number = i32::try_from(killed.decoding().unwrap().process_id).unwrap();
    let process = rustix::process::Pid::from_raw(number).unwrap();
    rustix::process::kill_process(process, rustix::process::Signal::SEGV).unwrap();
    let fault = std::iter::repeat_with(|| next(&mut killed)).find_map(Result::err).unwrap();
    assert!(matches!(&fault, Fault::Worker(how) if how.contains("signal 11")), "{fault}");
    assert!(killed.pull(Duration::ZERO).is_none());
    // The picture that it gave stays readable.
    assert_eq!(held.image.plane(0).row(119).len(), 160);
    let n_others = std::iter::from_fn(|| other.pull(PATIENCE)).count();
    assert_eq!((n_others, other.has_ended()), (39, true));
}

#[test]
fn pictures_that_are_held_do_not_change_and_their_memory_is_used_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = write_video(folder.path());
    let sum = |picture: &Picture| -> u64 {
        let luma = picture.image.plane(0);
        (0..luma.height).flat_map(|y| luma.row(y)).map(|luma| u64::from(*luma)).sum()
    };
    for input in [
        Input::file(&path).unwrap(),
        Input::stream(std::fs::File::open(folder.path().join("video.mp4")).unwrap()),
    ] {
        let mut decoder = Decoder::start(input, None).unwrap();
        let mut held = Vec::new();
        while let Some(picture) = decoder.pull(PATIENCE) {
            let sum = sum(&picture);
            held.push((picture, sum));
        }
        assert_eq!(held.len(), 40);
        assert!(held.iter().all(|(picture, before)| sum(picture) == *before));
    }
    // One at a time, few slots do.
    let mut decoder = Decoder::start(Input::file(&path).unwrap(), None).unwrap();
    while let Some(picture) = decoder.pull(PATIENCE) {
        drop(picture);
    }
    let files = std::fs::read_dir(format!("/proc/{}/fd", decoder.decoding().unwrap().process_id)).unwrap();
    let is_block = |file: &PathBuf| file.to_string_lossy().contains("videofields-pictures");
    let n_blocks =
        files.map(|file| std::fs::read_link(file.unwrap().path()).unwrap()).filter(is_block).count();
    assert!((1..=3).contains(&n_blocks), "{n_blocks} blocks of 16 pictures");
}

/// A worker that is none: the test says what it sends.
struct FakeWorker {
    handle: WorkerHandle,
    sender: Sender,
    receiver: Receiver,
}

impl FakeWorker {
    fn new(work: Work) -> Self {
        let (ours, theirs) = UnixStream::pair().unwrap();
        let process = Process::of_command("sleep", OwnedFd::from(ours));
        let handle = WorkerHandle::with_process(process, work, Times::Played).unwrap();
        let theirs = OwnedFd::from(theirs);
        let receiver = Receiver::new(theirs.try_clone().unwrap(), Files::Kept(Vec::new()), 0);
        Self { handle, sender: Sender::new(theirs, None), receiver }
    }

    fn say(&mut self, message: &FromWorker) -> Option<Picture> {
        self.sender.send(message, &[], None).unwrap();
        self.handle.pull(Duration::from_millis(1))
    }

    /// Gets memory for pictures of so many bytes.
    fn block(&mut self, n_bytes: u64) -> Option<Block> {
        assert!(self.say(&FromWorker::NeedMemory(n_bytes)).is_none());
        loop {
            match self.receiver.receive(Deadline::after(PATIENCE)) {
                Received::Message(ToWorker::Memory(block), _) => return Some(block),
                Received::Message(ToWorker::NoMemory, _) => return None,
                Received::Message(..) => {}
                other => panic!("{other:?}"),
            }
        }
    }

    fn reason(&mut self) -> String {
        match self.handle.take_fault() {
            Some(Fault::Worker(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }
}

fn head(block: Block) -> PictureHead {
    PictureHead {
        ticket: 7,
        block: block.id,
        slot: 0,
        width: 64,
        height: 48,
        offsets: [0, 64 * 48, 64 * 48 + 32 * 24],
        strides: [64, 32, 32],
        matrix: Matrix::Bt601,
        is_full_range: false,
        stream_nanos: Some(5),
        interval_nanos: None,
        reference_nanos: None,
        encoded_number: None,
    }
}

const PICTURE_BYTES: u64 = 64 * 48 * 3 / 2;

/// Makes a picture a false one.
type Change = fn(&mut PictureHead);

#[test]
fn a_false_worker_is_ended_and_told_of() {
    let changes: [(&str, Change); 7] = [
        ("memory that it does not have", |head| head.block += 1),
        ("does not lie in its memory", |head| head.slot = 16),
        ("does not lie in its memory", |head| head.offsets[2] = 1 << 20),
        ("does not lie in its memory", |head| head.strides[0] = u32::MAX),
        ("does not lie in its memory", |head| head.strides[1] = 16),
        ("beyond the limits", |head| (head.width, head.height) = (8200, 2)),
        ("does not lie in its memory", |head| head.height = 0),
    ];
    for (expected, change) in changes {
        let mut worker = FakeWorker::new(Work::Frames);
        let block = worker.block(PICTURE_BYTES).unwrap();
        let mut head = head(block);
        assert!(worker.say(&FromWorker::Picture(head)).is_some(), "the picture is right before the change");
        change(&mut head);
        assert!(worker.say(&FromWorker::Picture(head)).is_none());
        let reason = worker.reason();
        assert!(reason.contains(expected), "{reason}");
    }
    let mut worker = FakeWorker::new(Work::Frames);
    let block = worker.block(PICTURE_BYTES).unwrap();
    worker.sender.send(&FromWorker::Picture(head(block)), &[], None).unwrap();
    worker.sender.send(&FromWorker::Picture(head(block)), &[], None).unwrap();
    worker.sender.send(&FromWorker::Picture(head(block)), &[], None).unwrap();
    let n_pictures = std::iter::from_fn(|| worker.handle.pull(Duration::from_millis(1))).count();
    // Each look asks for one: there is none that was not asked for.
    assert_eq!(n_pictures, 3);
    for (message, expected) in [
        (FromWorker::NeedMemory(0), "memory"),
        (FromWorker::NeedMemory(1 << 40), "memory"),
        (FromWorker::NeedBytes(5), "bytes"),
    ] {
        let mut worker = FakeWorker::new(Work::Frames);
        assert!(worker.say(&message).is_none());
        assert!(worker.reason().contains(expected));
    }
}

#[test]
fn what_is_no_message_ends_a_worker() {
    for bytes in [&[0xff; 64][..], &[1, 0, 0, 0, 0, 0, 0, 0, 99], &[2, 0, 0, 0, 0, 0, 0, 0, 4, 4]] {
        let mut worker = FakeWorker::new(Work::Frames);
        worker.sender.send_raw(bytes);
        assert!(worker.handle.pull(Duration::from_millis(50)).is_none());
        assert!(!worker.reason().is_empty());
    }
}

#[test]
fn a_workers_memory_has_an_end_which_grows_with_what_is_held() {
    let mut worker = FakeWorker::new(Work::File(tempfile::tempfile().unwrap(), None));
    let megabyte = 4 << 20;
    let blocks: Vec<_> = std::iter::from_fn(|| worker.block(megabyte)).collect();
    assert_eq!(blocks.len(), 64, "of one slot each");
    let held = worker.say(&FromWorker::Picture(PictureHead { ..head(blocks[0]) })).unwrap();
    assert!(worker.block(megabyte).is_some());
    assert!(worker.block(megabyte).is_none());
    drop(held);
    assert!(worker.say(&FromWorker::Unmap(blocks[1].id)).is_none());
    assert!(worker.block(megabyte).is_none(), "two more than there may be, less one");
    assert!(worker.say(&FromWorker::Unmap(blocks[2].id)).is_none());
    assert!(worker.block(megabyte).is_some());
}

#[test]
fn texts_of_a_worker_are_short_and_plain() {
    let mut worker = FakeWorker::new(Work::Frames);
    let text = format!("line\n\u{1b}[31m{}", "x".repeat(1000));
    assert!(worker.say(&FromWorker::Fault(Fault::Damaged(text))).is_none());
    let Some(Fault::Damaged(told)) = worker.handle.take_fault() else { panic!("no fault") };
    assert!(told.len() < 310 && !told.chars().any(char::is_control), "{told:?}");
}

#[test]
fn formats_come_back_as_they_were_and_no_others_do() {
    gstreamer::init().unwrap();
    let text = "video/x-h264,stream-format=avc,alignment=au,level=(string)3.1,profile=high,width=640,height=360,\
                framerate=25/1,parsed=true,codec_data=(buffer)0164001fffe1";
    let caps: gstreamer::Caps = text.parse().unwrap();
    assert_eq!(format::Format::of(&caps).unwrap().caps().unwrap(), caps);
    for other in ["video/x-theora,width=8", "audio/x-raw", "application/x-rtp"] {
        assert!(format::Format::of(&other.parse::<gstreamer::Caps>().unwrap()).is_none(), "{other}");
    }
    // Fields of other names are left out.
    let more: gstreamer::Caps = "image/jpeg,width=8,height=9,secret=1".parse().unwrap();
    let told = format::Format::of(&more).unwrap().caps().unwrap();
    assert_eq!(told, "image/jpeg,width=8,height=9".parse::<gstreamer::Caps>().unwrap());
}

#[test]
fn encoded_frames_of_a_file_come_back_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = write_video(folder.path());
    let queue = Arc::new(EncodedQueue::new(1 << 20));
    let mut decoder = Decoder::start(Input::file(&path).unwrap(), Some(&queue)).unwrap();
    while decoder.pull(PATIENCE).is_some() {}
    let frames: Vec<_> = std::iter::from_fn(|| queue.take()).collect();
    let mut demuxer = crate::media::tests::frames_of(&path);
    assert_eq!(frames.len(), 40);
    for frame in frames {
        let bytes = frame.buffer().map_readable().unwrap().to_vec();
        assert_eq!(Some((bytes, frame.is_key)), demuxer.next());
    }
}
