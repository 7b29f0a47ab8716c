//! Where a pipeline's bytes come from.

use super::Fault;
use super::fault::gstreamer_fault;
use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app as gst_app;
use std::io::Read;
use std::path::Path;

/// Bytes that are read at once.
const CHUNK_BYTES: usize = 128 * 1024;

/// The element at which a pipeline begins.
///
/// Its source pads, those there and those to come, are linked to whatever reads them; of several streams the first
/// video counts.
#[derive(Debug)]
pub struct Input {
    element: gst::Element,
    keep: Keep,
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
        Ok(Self { element, keep: Keep::All })
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
        Ok(Self { element, keep: Keep::All })
    }

    /// Links the first video of the input to `reader`, now or when it comes.
    pub(super) fn link(&self, reader: &gst::Element) -> Result<(), Fault> {
        self.element.link(reader).map_err(|error| gstreamer_fault("build a pipeline", &error))
    }

    pub(super) const fn element(&self) -> &gst::Element {
        &self.element
    }

    pub(super) const fn keep(&self) -> Keep {
        self.keep
    }
}

/// A new element; starts `GStreamer` if nobody has.
pub(super) fn make(name: &'static str) -> Result<gst::Element, Fault> {
    gst::init().map_err(|error| gstreamer_fault("start", &error))?;
    gst::ElementFactory::make(name).build().map_err(|error| gstreamer_fault("make an element", &error))
}
