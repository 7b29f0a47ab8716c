//! Inputs: files, cameras, and the elements at which a pipeline begins.

use super::fault::gstreamer_fault;
use super::{Fault, Times};
use gst::glib;
use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use std::fs::File;
use std::io::Read;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::sync::mpsc::SyncSender;

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 128 * 1024;

/// A source of pictures: a file, a file's bytes, or a camera.
pub struct Input {
    pub(super) kind: Kind,
    pub(super) times: Times,
}

/// A kind of input.
pub(super) enum Kind {
    /// A file; read by a worker.
    File(File),
    /// A file's bytes from their beginning to their end; read by a worker, which asks for them.
    Stream(Box<dyn Read + Send>),
    /// A camera: elements of the daemon, and what feeds them where they do not read by themselves.
    Live(Source, Option<Box<dyn Client>>),
}

impl std::fmt::Debug for Input {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self.kind {
            Kind::File(_) => "Input(file)",
            Kind::Stream(_) => "Input(stream)",
            Kind::Live(..) => "Input(camera)",
        })
    }
}

/// The elements at which a pipeline begins, each linked to the next. The last one's source pad is linked to whatever reads it.
#[derive(Debug)]
pub(super) struct Source {
    elements: Vec<gst::Element>,
    pub(super) keep: Keep,
    pub(super) memory: Memory,
    /// Memory for decoded pictures, where it is not the decoder's own.
    pub(super) allocator: Option<gst::Allocator>,
    file: Option<File>,
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

/// Origin of the memory of decoded pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Memory {
    /// Memory of the decoder's pool, for as long as it lives: nothing is allocated once as many pictures were in use as ever
    /// will be. For what runs on and on.
    Pooled,
    /// Every picture's is its own and ends with it: of a decoder that rests, nothing stays but what is held. For looking
    /// back, where a whole group of pictures may be held for a while.
    Own,
}

/// Fate of pictures that are not taken as they come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keep {
    /// They wait, and so does decoding: files.
    All,
    /// A newer one replaces the one that waits: live.
    Newest,
}

impl Input {
    /// Returns the file at `location` as an input.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn file(location: &Path) -> Result<Self, Fault> {
        let file = File::open(location);
        let file = file.map_err(|error| Fault::Damaged(format!("it cannot be opened: {error}")))?;
        Ok(Self::new(Kind::File(file)))
    }

    /// Returns as an input what `reader` gives, from its beginning to its end, in any container that needs no seeking.
    #[must_use]
    pub fn stream(reader: impl Read + Send + 'static) -> Self {
        Self::new(Kind::Stream(Box::new(reader)))
    }

    /// Returns a camera that `elements` give, fed by `client` where they do not read by themselves.
    pub(super) fn live(elements: Vec<gst::Element>, client: Option<Box<dyn Client>>) -> Self {
        Self::new(Kind::Live(Source::new(elements, Keep::Newest, Memory::Pooled), client))
    }

    const fn new(kind: Kind) -> Self {
        Self { kind, times: Times::Played }
    }

    /// Returns the same input, whose pictures' times count as `times` has it.
    #[must_use]
    pub fn with_times(self, times: Times) -> Self {
        Self { times, ..self }
    }

    /// Returns elements of this process that read it.
    pub(super) fn into_source(self) -> Result<Source, Fault> {
        match self.kind {
            Kind::File(file) => {
                let source = Source::file(&descriptor_path(&file))?;
                Ok(Source { file: Some(file), ..source })
            }
            Kind::Stream(reader) => Source::stream(reader),
            Kind::Live(source, _client) => Ok(source),
        }
    }
}

impl Source {
    pub(super) const fn new(elements: Vec<gst::Element>, keep: Keep, memory: Memory) -> Self {
        Self { elements, keep, memory, allocator: None, file: None }
    }

    /// Returns the file at `location`, which is opened when a pipeline starts.
    ///
    /// # Errors
    /// When `GStreamer` lacks the element.
    pub(super) fn file(location: &Path) -> Result<Self, Fault> {
        let element = make("filesrc")?;
        element.set_property("location", location);
        Ok(Self::new(vec![element], Keep::All, Memory::Pooled))
    }

    /// Returns what `reader` gives, from its beginning to its end.
    ///
    /// # Errors
    /// When `GStreamer` lacks the element.
    pub(super) fn stream(mut reader: impl Read + Send + 'static) -> Result<Self, Fault> {
        let element = make("appsrc")?;
        let source = element.clone().downcast::<gst_app::AppSrc>().map_err(|other| Fault::Gstreamer {
            action: "make an element".into(),
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
        Ok(Self::new(vec![element], Keep::All, Memory::Own))
    }

    /// Returns the same source, whose decoded pictures lie in memory of `allocator`.
    pub(super) fn with_allocator(self, allocator: gst::Allocator) -> Self {
        Self { allocator: Some(allocator), ..self }
    }

    /// Puts the elements into `pipeline`, and links them to `reader`; the file that must stay open while they read.
    pub(super) fn link(self, pipeline: &gst::Pipeline, reader: &gst::Element) -> Result<Option<File>, Fault> {
        let fault = |error: &glib::BoolError| gstreamer_fault("build a pipeline", error);
        pipeline.add_many(&self.elements).map_err(|error| fault(&error))?;
        gst::Element::link_many(&self.elements).map_err(|error| fault(&error))?;
        if let Some(last) = self.elements.last() {
            last.link(reader).map_err(|error| fault(&error))?;
        }
        Ok(self.file)
    }
}

/// The name under which Linux shows an open file, and under which it can be opened again: the same file, whatever
/// became of its path.
#[must_use]
pub fn descriptor_path(file: &File) -> PathBuf {
    PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()))
}

/// Makes an element; starts `GStreamer` if nobody has.
pub(super) fn make(name: &'static str) -> Result<gst::Element, Fault> {
    gst::init().map_err(|error| gstreamer_fault("start", &error))?;
    gst::ElementFactory::make(name).build().map_err(|error| gstreamer_fault("make an element", &error))
}
