//! An RTSP server in the test's own process: the camera that live sources connect to.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail as tests do")]

use gst::glib;
use gstreamer as gst;
use gstreamer_rtsp_server as gst_rtsp_server;
use gstreamer_rtsp_server::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// The path of the one stream.
const PATH: &str = "/cam";

/// A ball of H.264 in this size, 25 pictures a second; its capsfilter is called `size`.
pub fn ball(width: u32, height: u32) -> String {
    format!(
        "( videotestsrc is-live=true pattern=ball ! capsfilter name=size caps=video/x-raw,format=I420,width={width},height={height},framerate=25/1 ! \
         x264enc tune=zerolatency speed-preset=ultrafast key-int-max=10 threads=1 ! rtph264pay name=pay0 pt=96 config-interval=-1 )"
    )
}

/// The same as motion JPEG.
pub fn jpeg_ball(width: u32, height: u32) -> String {
    format!(
        "( videotestsrc is-live=true pattern=ball ! video/x-raw,format=I420,width={width},height={height},framerate=25/1 ! \
         jpegenc ! rtpjpegpay name=pay0 pt=26 )"
    )
}

/// A running server. It ends, with all its connections, when it is dropped.
pub struct RtspServer {
    port: u16,
    main_loop: glib::MainLoop,
    thread: Option<JoinHandle<()>>,
    media: Arc<Mutex<Option<gst::Element>>>,
}

impl RtspServer {
    /// Serves what `launch` describes on loopback, at `port` (0: any), to everybody or to one user with a password.
    pub fn start(port: u16, launch: &str, login: Option<(&str, &str)>) -> Self {
        gst::init().unwrap();
        let context = glib::MainContext::new();
        let main_loop = glib::MainLoop::new(Some(&context), false);
        let server = gst_rtsp_server::RTSPServer::new();
        // Clients are served by the loop's own thread, which closes them when the loop has ended. Closed by another thread than
        // serves them, a connection without a stream is read again and again, with a message each time.
        server.thread_pool().unwrap().set_max_threads(0);
        server.set_address("127.0.0.1");
        server.set_service(&port.to_string());
        let factory = gst_rtsp_server::RTSPMediaFactory::new();
        factory.set_launch(launch);
        factory.set_shared(true);
        if let Some((user, password)) = login {
            let role = gst::Structure::builder(user)
                .field(gst_rtsp_server::RTSP_PERM_MEDIA_FACTORY_ACCESS.as_str(), true)
                .field(gst_rtsp_server::RTSP_PERM_MEDIA_FACTORY_CONSTRUCT.as_str(), true)
                .build();
            factory.add_role_from_structure(&role);
            let token = gst_rtsp_server::RTSPToken::builder()
                .field(gst_rtsp_server::RTSP_TOKEN_MEDIA_FACTORY_ROLE.as_str(), user)
                .build();
            let auth = gst_rtsp_server::RTSPAuth::new();
            auth.add_basic(&gst_rtsp_server::RTSPAuth::make_basic(user, password), &token);
            server.set_auth(Some(&auth));
        }
        let media: Arc<Mutex<Option<gst::Element>>> = Arc::default();
        let configured = Arc::clone(&media);
        factory.connect_media_configure(move |_factory, made| {
            *configured.lock().unwrap() = Some(made.element());
        });
        server.mount_points().unwrap().add_factory(PATH, factory);
        let source = server.attach(Some(&context)).unwrap();
        let port = u16::try_from(server.bound_port()).unwrap();
        let looped = main_loop.clone();
        let run = move || {
            looped.run();
            if let Some(source) = context.find_source_by_id(&source) {
                source.destroy();
            }
            server.client_filter(Some(
                &mut |_server: &gst_rtsp_server::RTSPServer, client: &gst_rtsp_server::RTSPClient| {
                    client.close();
                    gst_rtsp_server::RTSPFilterResult::Remove
                },
            ));
        };
        let thread = std::thread::Builder::new().name("rtsp-server".to_owned()).spawn(run).unwrap();
        Self { port, main_loop, thread: Some(thread), media }
    }

    /// The stream's URL.
    pub fn url(&self) -> String {
        format!("rtsp://127.0.0.1:{}{PATH}", self.port)
    }

    /// Where it listens.
    pub const fn port(&self) -> u16 {
        self.port
    }

    /// Sends pictures of another size from now on, to those who are connected too.
    pub fn resize(&self, width: i32, height: i32) {
        let element = self.media.lock().unwrap().clone().unwrap();
        let filter = element.downcast::<gst::Bin>().unwrap().by_name("size").unwrap();
        let caps = gst::Caps::builder("video/x-raw").field("format", "I420").field("width", width);
        let caps = caps.field("height", height).field("framerate", gst::Fraction::new(25, 1)).build();
        filter.set_property("caps", caps);
    }
}

impl RtspServer {
    /// Loses every `n`th packet from now on.
    pub fn lose_every(&self, n: u64) {
        let element = self.media.lock().unwrap().clone().unwrap();
        let payloader = element.downcast::<gst::Bin>().unwrap().by_name("pay0").unwrap();
        let n_sent = AtomicU64::new(0);
        let kinds = gst::PadProbeType::BUFFER | gst::PadProbeType::BUFFER_LIST;
        payloader.static_pad("src").unwrap().add_probe(kinds, move |_pad, info| {
            let is_next = || n_sent.fetch_add(1, Ordering::Relaxed) % n == n - 1;
            if let Some(list) = info.buffer_list_mut() {
                // Packets of one picture come as a list.
                list.make_mut().foreach_mut(|buffer, _idx| {
                    ControlFlow::Continue(Some(buffer).filter(|_buffer| !is_next()))
                });
                return gst::PadProbeReturn::Ok;
            }
            if is_next() { gst::PadProbeReturn::Drop } else { gst::PadProbeReturn::Ok }
        });
    }
}

impl Drop for RtspServer {
    fn drop(&mut self) {
        self.main_loop.quit();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }
}
