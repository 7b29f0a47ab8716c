//! Where a pipeline's bytes come from.

use super::Fault;
use super::fault::gstreamer_fault;
use gst::glib;
use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use std::fs::File;
use std::io::Read;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::sync::mpsc::SyncSender;
use std::sync::{Mutex, PoisonError};

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 128 * 1024;

/// The elements at which a pipeline begins, each linked to the next.
///
/// The last one's source pad is linked to whatever reads it.
#[derive(Debug)]
pub struct Input {
    elements: Vec<gst::Element>,
    keep: Keep,
    /// Client that feeds the elements, until it is started.
    client: Mutex<Option<Box<dyn Client>>>,
    memory: Memory,
}

/// Feeds an input's elements from a connection of its own.
pub(super) trait Client: std::fmt::Debug + Send {
    /// Connects, on a thread of its own; what is given back ends the connection when it is dropped. What ends it otherwise
    /// is told to `faults`.
    ///
    /// # Errors
    /// When no thread can be started.
    fn start(self: Box<Self>, faults: SyncSender<Fault>) -> Result<Connection, Fault>;
}

/// A connection at work.
pub(super) type Connection = Box<dyn std::any::Any + Send + Sync>;

/// Where the memory of decoded pictures comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Memory {
    /// From the decoder's pool, for as long as it lives: nothing is allocated once as many pictures were in use as ever
    /// will be. For what runs on and on.
    Pooled,
    /// Every picture's is its own and ends with it: of a decoder that rests, nothing stays but what is held. For looking
    /// back, where a whole group of pictures may be held for a while.
    Own,
}

/// What becomes of pictures that are not taken as they come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// They wait, and so does decoding: files.
    All,
    /// A newer one replaces the one that waits: live.
    Newest,
}

impl Input {
    /// The file at `location`.
    ///
    /// # Errors
    /// When `GStreamer` lacks the element.
    pub fn file(location: &Path) -> Result<Self, Fault> {
        let element = make("filesrc")?;
        element.set_property("location", location);
        Ok(Self::new(vec![element], Keep::All))
    }

    pub(super) const fn new(elements: Vec<gst::Element>, keep: Keep) -> Self {
        Self { elements, keep, client: Mutex::new(None), memory: Memory::Pooled }
    }

    /// Returns the same input, fed by `client`.
    pub(super) fn fed_by(self, client: Box<dyn Client>) -> Self {
        Self { client: Mutex::new(Some(client)), ..self }
    }

    /// Starts what feeds the elements, if that has not happened.
    pub(super) fn start_client(&self, faults: &SyncSender<Fault>) -> Result<Option<Connection>, Fault> {
        let client = self.client.lock().unwrap_or_else(PoisonError::into_inner).take();
        client.map(|client| client.start(faults.clone())).transpose()
    }

    /// What `reader` gives, from its beginning to its end, in any container that needs no seeking.
    ///
    /// # Errors
    /// When `GStreamer` lacks the element.
    pub fn stream(mut reader: impl Read + Send + 'static) -> Result<Self, Fault> {
        let element = make("appsrc")?;
        let source = element.clone().downcast::<gst_app::AppSrc>().map_err(|other| Fault::Gstreamer {
            action: "make an element",
            detail: format!("appsrc is a {}", other.type_()),
        })?;
        let need_data = move |source: &gst_app::AppSrc, _length: u32| {
            let mut chunk = vec![0; CHUNK_BYTES];
            let flow = match reader.read(&mut chunk) {
                Ok(0) => source.end_of_stream(),
                Ok(n_bytes) => {
                    chunk.truncate(n_bytes);
                    source.push_buffer(gst::Buffer::from_mut_slice(chunk))
                }
                Err(error) => {
                    gst::element_error!(source, gst::ResourceError::Read, ("{error}"));
                    Err(gst::FlowError::Error)
                }
            };
            if let Err(error) = flow {
                tracing::debug!(%error, "a stream is read no further");
            }
        };
        source.set_callbacks(gst_app::AppSrcCallbacks::builder().need_data(need_data).build());
        Ok(Self { memory: Memory::Own, ..Self::new(vec![element], Keep::All) })
    }

    /// Puts the input into `pipeline`, and links it to `reader`.
    pub(super) fn link(&self, pipeline: &gst::Pipeline, reader: &gst::Element) -> Result<(), Fault> {
        let fault = |error: &glib::BoolError| gstreamer_fault("build a pipeline", error);
        pipeline.add_many(&self.elements).map_err(|error| fault(&error))?;
        gst::Element::link_many(&self.elements).map_err(|error| fault(&error))?;
        let Some(last) = self.elements.last() else { return Ok(()) };
        last.link(reader).map_err(|error| fault(&error))
    }

    pub(super) const fn memory(&self) -> Memory {
        self.memory
    }

    pub(super) const fn keep(&self) -> Keep {
        self.keep
    }
}

/// The name under which Linux shows an open file, and under which it can be opened again: the same file, whatever
/// became of its path.
#[must_use]
pub fn descriptor_path(file: &File) -> PathBuf {
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// A new element; starts `GStreamer` if nobody has.
pub(super) fn make(name: &'static str) -> Result<gst::Element, Fault> {
    gst::init().map_err(|error| gstreamer_fault("start", &error))?;
    gst::ElementFactory::make(name).build().map_err(|error| gstreamer_fault("make an element", &error))
}
