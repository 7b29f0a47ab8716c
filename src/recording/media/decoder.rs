//! Decodes an input: a worker does, and here its pictures, its faults and its numbers come together.

use super::fault::gstreamer_fault;
use super::input::Kind;
use super::pipeline::{Pipeline, codec_of};
use super::worker::{Decoding, Sandbox, Work, WorkerHandle};
use super::{EncodedQueue, Fault, Input, Picture, PlaneReader};
use gstreamer as gst;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Starts a decoding process and returns what holds it.
///
/// # Errors
/// When no process can be started, or it says nothing for a while.
pub fn look_at_sandbox() -> Result<Sandbox, Fault> {
    WorkerHandle::look_at_sandbox()
}

/// Longest time that a worker is waited for while it is not known whether pictures come from it.
const SHORT: Duration = Duration::from_millis(20);

/// An input that is being decoded; that ends when this is dropped.
#[derive(Debug)]
pub struct Decoder {
    /// Comes first, so that a pipeline's threads do not wait for it when they are to end.
    worker: Option<WorkerHandle>,
    camera: Option<Camera>,
}

/// A camera's pipeline in the daemon.
#[derive(Debug)]
struct Camera {
    pipeline: Pipeline,
    /// Reads pictures that come unencoded.
    reader: PlaneReader,
    /// The codec of the frames that were handed over.
    codec: Arc<OnceLock<Option<String>>>,
    /// Fault of a picture that came unencoded.
    fault: Option<Fault>,
}

impl Decoder {
    /// Starts decoding `input`. With `encoded`, the frames that the pictures are decoded from are put there as they come,
    /// each some pictures before its own.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element or no worker can be started; all else shows with the first picture.
    pub fn start(input: Input, encoded: Option<&Arc<EncodedQueue>>) -> Result<Self, Fault> {
        // Frames that come back are GStreamer's here too, though nothing else may ever have used it.
        gst::init().map_err(|error| gstreamer_fault("start", &error))?;
        let times = input.times;
        match input.kind {
            Kind::File(file) => {
                let worker = WorkerHandle::start(Work::File(file, encoded.cloned()), times)?;
                Ok(Self { worker: Some(worker), camera: None })
            }
            Kind::Stream(reader) => {
                let worker = WorkerHandle::start(Work::Stream(reader), times)?;
                Ok(Self { worker: Some(worker), camera: None })
            }
            Kind::Live(source, client) => {
                let worker = WorkerHandle::start(Work::Frames, times)?;
                let (frames, codec) = (worker.frame_feed(), Arc::<OnceLock<_>>::default());
                let known = Arc::clone(&codec);
                let take = Box::new(move |sample: &gst::SampleRef| {
                    known.get_or_init(|| sample.caps().and_then(codec_of));
                    frames.push(sample);
                });
                let pipeline = Pipeline::hand_over((source, client), encoded, take)?;
                let camera = Camera { pipeline, reader: PlaneReader::new(times), codec, fault: None };
                Ok(Self { worker: Some(worker), camera: Some(camera) })
            }
        }
    }

    /// Lets what is live go before the decoding, from now on.
    pub fn lower_priority(&self) {
        if let Some(worker) = &self.worker {
            worker.lower_priority();
        }
    }

    /// Returns the next picture if one comes within `patience`. Of a camera, one that its decoder marks as broken is left out and
    /// counted.
    pub fn pull(&mut self, patience: Duration) -> Option<Picture> {
        let Some(camera) = &mut self.camera else { return self.worker.as_mut()?.pull(patience) };
        if self.worker.is_some() && camera.pipeline.n_arrived() > 0 {
            // Its pictures come unencoded: there is nothing to decode.
            self.worker = None;
        }
        let Some(worker) = &mut self.worker else { return camera.pull(patience) };
        let patience = if camera.codec.get().is_some() { patience } else { patience.min(SHORT) };
        worker.pull(patience)
    }

    /// Returns the number of pictures of a camera that were left out as broken, and of complaints of its decoder, each of which cost
    /// a picture.
    #[must_use]
    pub fn n_damaged(&self) -> u64 {
        self.sum(WorkerHandle::n_damaged, Pipeline::n_damaged)
    }

    /// Returns the number of pictures of a camera that newer ones replaced before they were pulled; one that waits now may be counted.
    #[must_use]
    pub fn n_replaced(&self) -> u64 {
        self.sum(WorkerHandle::n_replaced, Pipeline::n_replaced)
    }

    fn sum(&self, of_worker: impl Fn(&WorkerHandle) -> u64, of_pipeline: impl Fn(&Pipeline) -> u64) -> u64 {
        self.worker.as_ref().map_or(0, of_worker)
            + self.camera.as_ref().map_or(0, |camera| of_pipeline(&camera.pipeline))
    }

    /// Returns true once every picture was pulled.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        match &self.camera {
            Some(camera) => camera.pipeline.has_ended(),
            None => self.worker.as_ref().is_some_and(WorkerHandle::has_ended),
        }
    }

    /// Returns true once a camera's connection has ended, and the last of its encoded frames is in the queue.
    #[must_use]
    pub fn has_handed_over_all(&self) -> bool {
        self.camera.as_ref().is_some_and(|camera| camera.pipeline.has_handed_over_all())
    }

    /// Returns the length of the input in nanoseconds, where that is known, once a picture has come.
    #[must_use]
    pub fn duration_nanos(&self) -> Option<i64> {
        self.worker.as_ref()?.duration_nanos()
    }

    /// Returns the codec of the pictures, such as `h264`, once one has come; none where they come unencoded.
    #[must_use]
    pub fn codec(&self) -> Option<String> {
        match &self.camera {
            Some(camera) => camera.codec.get().cloned().flatten(),
            None => self.worker.as_ref()?.codec(),
        }
    }

    /// Returns the process that decodes it and what holds it; none before it has begun, and where nothing is decoded.
    #[must_use]
    pub fn decoding(&self) -> Option<Decoding> {
        self.worker.as_ref()?.decoding()
    }

    /// Goes on at the key frame before a time; where it stands in an input that cannot be sought in.
    pub fn seek(&mut self, stream_nanos: i64) {
        if let Some(worker) = &mut self.worker {
            worker.seek(stream_nanos);
        }
    }

    /// Returns what went wrong since the last call, if anything did.
    pub fn fault(&mut self) -> Option<Fault> {
        let of_camera =
            self.camera.as_mut().and_then(|camera| camera.fault.take().or_else(|| camera.pipeline.fault()));
        of_camera.or_else(|| self.worker.as_mut()?.take_fault())
    }
}

impl Camera {
    fn pull(&mut self, patience: Duration) -> Option<Picture> {
        let sample = self.pipeline.pull(patience)?;
        let picture = self.reader.picture(&sample);
        picture.map_err(|error| self.fault = Some(Fault::Damaged(error.to_string()))).ok()
    }
}
