//! What all cameras have in common: the newest picture, or that there is none yet.
//!
//! A started pipeline flows in, frames flow out; a newer picture replaces one that was not taken. Knows nothing of how the
//! camera is connected (`rtsp`, `http`, `device`).

use super::file::ENCODED_BYTES;
use super::jpeg::push_as_jpeg;
use super::pairing::Pairing;
use super::{CameraError, IngestError, Lost, Polled, Source, SourceFrame, StopFlag, Tap};
use crate::media::{ConnectionFault, Decoder, Decoding, EncodedFrame, EncodedQueue, Fault, Input, Picture};
use std::sync::Arc;
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// How long one look for a frame lasts; the stop flag is heeded between looks.
const LOOK: Duration = Duration::from_millis(100);

/// Longest step between two pictures by which a time that steps back goes on: that of a picture every two seconds.
const MAX_STEP_NANOS: i64 = 2_000_000_000;

/// Longest time that waiting frames may claim before the picture at which a time steps back.
const MAX_WAITING_NANOS: i64 = 10_000_000_000;

/// Most looks for a picture once a connection has ended: packets wait a tenth of a second to be put in order, and the first picture of a
/// young connection for its decoder.
const MAX_DRAINING_LOOKS: u32 = 5;

/// How long who asks for the next frame waits for it, seconds.
const SILENCE_SECS: u64 = 10;

/// A camera that is connected, or about to be.
pub(super) struct LiveSource {
    place: String,
    decoder: Decoder,
    stop: StopFlag,
    /// Takes the encoded frames, where they are wanted.
    encoded: Option<Arc<EncodedQueue>>,
    pairing: Pairing,
    next_number: u64,
    /// The stream's own time of the first frame that has one.
    first_nanos: Option<i64>,
    latest_nanos: i64,
    /// Between two pictures, as the stream promises it.
    interval_nanos: Option<i64>,
    /// Between the last two pictures, by the stream's own time.
    step_nanos: i64,
    connection: Connection,
}

/// State of a connection.
enum Connection {
    /// It goes on.
    Open,
    /// It has ended with this fault, and what came before is still on its way, for so many looks at most.
    Draining(Fault, u32),
    /// Nothing more comes.
    Over,
}

impl LiveSource {
    /// Starts what `input` gives; `place` is what messages call it.
    pub(super) fn start(place: String, input: Input, tap: Tap, stop: &StopFlag) -> Result<Self, IngestError> {
        let encoded = (tap == Tap::Open).then(|| Arc::new(EncodedQueue::new(ENCODED_BYTES)));
        let decoder =
            Decoder::start(input, encoded.as_ref()).map_err(|fault| IngestError::of_fault(&place, fault))?;
        Ok(Self {
            place,
            decoder,
            stop: stop.clone(),
            encoded,
            pairing: Pairing::default(),
            next_number: 0,
            first_nanos: None,
            latest_nanos: 0,
            interval_nanos: None,
            step_nanos: 0,
            connection: Connection::Open,
        })
    }

    /// Takes over the encoded frames that have come.
    fn read_encoded(&mut self) {
        while let Some(frame) = self.encoded.as_ref().and_then(|encoded| encoded.take()) {
            self.pairing.push_frame(frame);
        }
    }

    /// Nanoseconds between two pictures, where the stream says so.
    pub(super) const fn interval_nanos(&self) -> Option<i64> {
        self.interval_nanos
    }

    /// What its pictures are encoded in, once one has come.
    pub(super) fn codec(&self) -> Option<String> {
        self.decoder.codec()
    }

    /// Returns the next picture's frame. Stream time grows whatever the camera says.
    fn frame(&mut self, picture: Picture) -> SourceFrame {
        self.read_encoded();
        if let Some(queue) = self.encoded.as_ref().filter(|queue| queue.wants_pictures()) {
            push_as_jpeg(queue, &picture);
            // A frame is paired before its picture is.
            self.read_encoded();
        }
        self.interval_nanos = picture.interval_nanos.filter(|nanos| *nanos > 0);
        let is_first = self.next_number == 0;
        let least_nanos = if is_first { 0 } else { self.latest_nanos.saturating_add(1) };
        let stream_nanos = picture.stream_nanos.map_or(least_nanos, |nanos| {
            let own = self.first_nanos.map(|first| nanos.saturating_sub(first));
            own.filter(|own| *own >= least_nanos).unwrap_or_else(|| {
                // Time that steps back goes on from where it stands, with room for the frames whose pictures were replaced.
                let interval_nanos = self.interval_nanos.unwrap_or(self.step_nanos).min(MAX_STEP_NANOS);
                let before_nanos = self.pairing.waiting_nanos(nanos).unwrap_or(0).min(MAX_WAITING_NANOS);
                let room_nanos = if is_first { 0 } else { before_nanos + interval_nanos };
                let next_nanos = least_nanos.saturating_add(room_nanos);
                self.first_nanos = Some(nanos.saturating_sub(next_nanos));
                next_nanos
            })
        });
        let step_nanos = stream_nanos.saturating_sub(self.latest_nanos);
        if (0..MAX_STEP_NANOS).contains(&step_nanos) {
            self.step_nanos = step_nanos;
        }
        self.latest_nanos = stream_nanos;
        self.pairing.push_picture(picture.stream_nanos, picture.encoded_number, stream_nanos);
        let number = self.next_number;
        self.next_number += 1;
        let reference = picture.reference_nanos.map(Timestamp::from_nanos);
        SourceFrame { image: Arc::new(picture.image), stream_nanos, number, reference }
    }
}

impl Source for LiveSource {
    fn next_frame(&mut self) -> Result<Option<SourceFrame>, IngestError> {
        for _ in 0..SILENCE_SECS * 1000 / LOOK.as_millis() as u64 {
            if let Polled::Frame(frame) = self.poll()? {
                return Ok(Some(frame));
            }
        }
        Err(CameraError::Silent { place: self.place.clone(), secs: SILENCE_SECS as f64 }.into())
    }

    fn poll(&mut self) -> Result<Polled, IngestError> {
        if self.stop.is_raised() {
            return Err(IngestError::Stopped);
        }
        if let Some(picture) = self.decoder.pull(LOOK) {
            return Ok(Polled::Frame(self.frame(picture)));
        }
        match (std::mem::replace(&mut self.connection, Connection::Over), self.decoder.fault()) {
            (Connection::Open, Some(fault @ Fault::Connection(_))) => {
                self.connection = Connection::Draining(fault, MAX_DRAINING_LOOKS);
            }
            (Connection::Draining(fault, n_looks @ 1..), None)
                if self.next_number == 0 || !self.decoder.has_handed_over_all() =>
            {
                self.connection = Connection::Draining(fault, n_looks - 1);
            }
            (Connection::Open, None) if self.decoder.has_ended() => {
                return Err(IngestError::of_fault(&self.place, Fault::Connection(ConnectionFault::Closed)));
            }
            (Connection::Open, None) => self.connection = Connection::Open,
            (Connection::Draining(fault, _), _) | (_, Some(fault)) => {
                return Err(IngestError::of_fault(&self.place, fault));
            }
            (Connection::Over, None) => return Err(IngestError::Stopped),
        }
        Ok(Polled::Waiting)
    }

    fn take_encoded(&mut self) -> Option<EncodedFrame> {
        self.read_encoded();
        if matches!(self.connection, Connection::Over) {
            self.pairing.take_anyway()
        } else {
            self.pairing.take()
        }
    }

    fn end_encoded(&mut self) {
        self.connection = Connection::Over;
    }

    fn n_encoded_dropped(&self) -> u64 {
        self.encoded.as_ref().map_or(0, |encoded| encoded.n_dropped())
    }

    fn is_live(&self) -> bool {
        true
    }

    fn place(&self) -> &str {
        &self.place
    }

    fn decoding(&self) -> Option<Decoding> {
        self.decoder.decoding()
    }

    fn lost(&self) -> Lost {
        Lost { n_replaced: self.decoder.n_replaced(), n_damaged: self.decoder.n_damaged() }
    }
}
