//! Messages between the daemon and a decoding worker.
//!
//! The daemon takes nothing of what a worker says on trust: a worker may have been taken over by what it decodes.

use super::format::Format;
use super::sandbox::Sandbox;
use crate::media::encoded::FrameKind;
use crate::media::{Fault, Times};
use gstreamer as gst;
use serde::{Deserialize, Serialize};

/// The work of a worker; it has one in its life.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::media) enum Job {
    /// A camera's encoded frames, of which the newest picture counts.
    Frames,
    /// A file, which comes with the message; all of its pictures count.
    File {
        /// True where its encoded frames are wanted back.
        wants_encoded: bool,
    },
    /// The bytes of a file, which the worker asks for.
    Stream,
    /// To try what a worker may not do, and to tell what came of it.
    #[cfg(test)]
    Trial,
}

/// A message from the daemon.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum ToWorker {
    /// The first message.
    Begin(Job, Times),
    /// The format of the frames that follow.
    Format(Format),
    /// A frame; its bytes follow.
    Frame(FrameTimes),
    /// Memory for pictures comes with this message, in answer to `NeedMemory`.
    Memory(Block),
    /// There is no memory for more pictures.
    NoMemory,
    /// Bytes follow, in answer to `NeedBytes`; none at the end.
    Bytes,
    /// Bytes cannot be read.
    Unreadable,
    /// One more picture is wanted.
    Take,
    /// A picture is not in use any more.
    Release(u32),
    /// To go on at the key frame before a stream time, nanoseconds; behind the number of this message.
    Seek(u32, i64),
}

/// A message from a worker.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum FromWorker {
    /// The first message: what it has given up.
    Ready(Sandbox),
    /// Memory for a picture of so many bytes is wanted.
    NeedMemory(u64),
    /// So much of the memory that it got is not in use any more.
    Unmap(u32),
    /// At most so many of the next bytes of the file are wanted.
    NeedBytes(u32),
    /// The format of the encoded frames that follow.
    Format(Format),
    /// A frame as it is encoded; its bytes follow.
    Encoded(EncodedTimes),
    /// Encoded frames that were left out so far, for want of room.
    EncodedDropped(u64),
    /// Its frames are not recorded as they are encoded, so their pictures are.
    WantsPictures,
    /// The codec, and the length in nanoseconds, as far as they are known.
    About(Option<String>, Option<i64>),
    /// A picture.
    Picture(PictureHead),
    /// Pictures that were left out as broken, and those that newer ones replaced, so far.
    Lost { n_damaged: u64, n_replaced: u64 },
    /// The pictures that follow are those behind the time that the message of this number sought.
    Sought(u32),
    /// Nothing further comes, and why.
    Fault(Fault),
    /// Nothing further comes, since the last picture was sent.
    Ended,
}

/// Block of memory for pictures, in slots of the same size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Block {
    /// Its number.
    pub(super) id: u32,
    /// Bytes of each slot, whole pages.
    pub(super) slot_bytes: u64,
    /// Number of slots.
    pub(super) n_slots: u32,
}

/// Times and flags of an encoded frame on its way to a worker, as `GStreamer` has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct FrameTimes {
    pub(super) pts: Option<u64>,
    pub(super) dts: Option<u64>,
    pub(super) duration: Option<u64>,
    pub(super) flags: u32,
    /// Time at which it was taken as its camera says, nanoseconds since 1970.
    pub(super) reference_nanos: Option<i64>,
}

/// Times of an encoded frame on its way from a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct EncodedTimes {
    pub(super) stream_nanos: Option<i64>,
    pub(super) interval_nanos: Option<i64>,
    pub(super) number: Option<u64>,
    pub(super) build: FrameKind,
}

/// A picture's place in memory, its layout and its times.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PictureHead {
    /// Number by which it is released.
    pub(super) ticket: u32,
    /// Block in which it lies.
    pub(super) block: u32,
    /// Slot of that block.
    pub(super) slot: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Bytes from the slot's beginning to each plane.
    pub(super) offsets: [u32; 3],
    pub(super) strides: [u32; 3],
    pub(super) matrix: Matrix,
    pub(super) is_full_range: bool,
    pub(super) stream_nanos: Option<i64>,
    pub(super) interval_nanos: Option<i64>,
    pub(super) reference_nanos: Option<i64>,
    pub(super) encoded_number: Option<u64>,
}

/// A colour matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Matrix {
    Bt601,
    Bt709,
    Bt2020,
}

impl FrameTimes {
    /// Returns those of a buffer, its times moved by what `stream_time` gives.
    pub(super) fn of(
        buffer: &gst::BufferRef,
        stream_time: impl Fn(gst::ClockTime) -> Option<gst::ClockTime>,
        reference_nanos: Option<i64>,
    ) -> Self {
        let nanos = |time: Option<gst::ClockTime>| time.and_then(&stream_time).map(gst::ClockTime::nseconds);
        Self {
            pts: nanos(buffer.pts()),
            dts: nanos(buffer.dts()),
            duration: buffer.duration().map(gst::ClockTime::nseconds),
            flags: buffer.flags().bits(),
            reference_nanos,
        }
    }

    /// Returns a buffer of these bytes at these times.
    pub(super) fn buffer(&self, bytes: Vec<u8>) -> gst::Buffer {
        let mut buffer = gst::Buffer::from_mut_slice(bytes);
        if let Some(buffer) = buffer.get_mut() {
            buffer.set_pts(self.pts.map(gst::ClockTime::from_nseconds));
            buffer.set_dts(self.dts.map(gst::ClockTime::from_nseconds));
            buffer.set_duration(self.duration.map(gst::ClockTime::from_nseconds));
            buffer.set_flags(gst::BufferFlags::from_bits_truncate(self.flags) & KEPT_FLAGS);
            if let Some(nanos) = self.reference_nanos.and_then(|nanos| u64::try_from(nanos).ok()) {
                let since_1970 = gst::Caps::new_empty_simple("timestamp/x-unix");
                let time = gst::ClockTime::from_nseconds(nanos);
                gst::ReferenceTimestampMeta::add(buffer, &since_1970, time, None);
            }
        }
        buffer
    }
}

/// Flags of buffers that say something to decoders.
const KEPT_FLAGS: gst::BufferFlags = gst::BufferFlags::DELTA_UNIT
    .union(gst::BufferFlags::DISCONT)
    .union(gst::BufferFlags::CORRUPTED)
    .union(gst::BufferFlags::HEADER)
    .union(gst::BufferFlags::MARKER)
    .union(gst::BufferFlags::DROPPABLE);
