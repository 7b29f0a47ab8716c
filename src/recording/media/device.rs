//! Inputs from V4L2 devices, and which of the formats that a device lists is taken.

use super::fault::{ConnectionFault, gstreamer_fault};
use super::input::make;
use super::{Fault, Input};
use gst::prelude::*;
use gstreamer as gst;
use std::path::Path;
use videofields_vision::config::DeviceFormat;

/// The size that is looked for where none is asked for.
const USUAL_PX: (u32, u32) = (1920, 1080);

/// What a device is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceWish {
    /// In which form.
    pub format: DeviceFormat,
    /// Columns; none takes the most up to 1920.
    pub width_px: Option<u32>,
    /// Rows; none takes the most up to 1080.
    pub height_px: Option<u32>,
    /// Frames a second; the nearest counts.
    pub rate_hz: f64,
}

impl Input {
    /// The pictures of the V4L2 device at `path`.
    ///
    /// # Errors
    /// When `GStreamer` lacks the element, the device cannot be opened, or it has nothing that is wished.
    pub fn v4l2(path: &Path, wish: &DeviceWish) -> Result<Self, Fault> {
        let element = make("v4l2src")?;
        element.set_property("device", path.display().to_string());
        capture(element, wish)
    }
}

/// What `element` gives of what is wished.
fn capture(element: gst::Element, wish: &DeviceWish) -> Result<Input, Fault> {
    let pad = element.static_pad("src").ok_or_else(no_pad)?;
    let bus = gst::Bus::new();
    element.set_bus(Some(&bus));
    // A device lists its formats once it is open.
    let opened = element.set_state(gst::State::Ready);
    let listed = pad.query_caps(None);
    let closed = element.set_state(gst::State::Null);
    element.set_bus(None);
    if opened.is_err() || closed.is_err() {
        let error = bus.pop_filtered(&[gst::MessageType::Error]);
        let fault = error.as_ref().and_then(|message| match message.view() {
            gst::MessageView::Error(error) => Some(device_fault(error.error().kind::<gst::ResourceError>()?)),
            _ => None,
        });
        return Err(Fault::Connection(fault.unwrap_or(ConnectionFault::Unreachable)));
    }
    let caps = choose(&listed, wish).ok_or(Fault::Connection(ConnectionFault::NoFormat))?;
    tracing::debug!(%caps, "a device's format is chosen");
    build(element, &caps).map_err(|error| gstreamer_fault("build a pipeline", &error))
}

fn build(element: gst::Element, caps: &gst::Caps) -> Result<Input, gst::glib::BoolError> {
    let filter = gst::ElementFactory::make("capsfilter").property("caps", caps).build()?;
    Ok(Input::live(vec![element, filter], None))
}

fn no_pad() -> Fault {
    Fault::Gstreamer { action: "open a device".into(), detail: "its element has no source pad".to_owned() }
}

/// Returns what an error of that kind, which a device's element posts, means.
pub(super) const fn device_fault(kind: gst::ResourceError) -> ConnectionFault {
    match kind {
        gst::ResourceError::NotAuthorized => ConnectionFault::Unauthorized,
        gst::ResourceError::Busy => ConnectionFault::Busy,
        gst::ResourceError::Read | gst::ResourceError::Write | gst::ResourceError::Close => {
            ConnectionFault::Closed
        }
        _ => ConnectionFault::Unreachable,
    }
}

/// The one format of those `listed` that is nearest to what is wished: one fast enough before one that is not, then the
/// size, then the rate, then what costs least to decode. A size that is asked for must be had.
fn choose(listed: &gst::Caps, wish: &DeviceWish) -> Option<gst::Caps> {
    let target = (wish.width_px.unwrap_or(USUAL_PX.0), wish.height_px.unwrap_or(USUAL_PX.1));
    let mut best: Option<((bool, u32, u64, u8), gst::Structure)> = None;
    for (structure, features) in listed.iter_with_features() {
        let Some(rank) = rank(structure.name(), wish.format) else { continue };
        if !(features.is_any() || features.contains(gst::CAPS_FEATURE_MEMORY_SYSTEM_MEMORY)) {
            continue;
        }
        let mut structure = structure.to_owned();
        structure.fixate_field_nearest_int("width", target.0 as i32);
        structure.fixate_field_nearest_int("height", target.1 as i32);
        let wished = gst::Fraction::approximate_f64(wish.rate_hz).unwrap_or(gst::Fraction::new(25, 1));
        if structure.has_field("framerate") {
            structure.fixate_field_nearest_fraction("framerate", wished);
        }
        let side = |name| structure.get::<i32>(name).ok().and_then(|side| u32::try_from(side).ok());
        let (Some(width), Some(height)) = (side("width"), side("height")) else { continue };
        let is_asked = |asked: Option<u32>, side| asked.is_none_or(|asked| asked == side);
        if !is_asked(wish.width_px, width) || !is_asked(wish.height_px, height) {
            continue;
        }
        let rate_hz = structure
            .get::<gst::Fraction>("framerate")
            .map_or(wish.rate_hz, |rate| f64::from(rate.numer()) / f64::from(rate.denom()));
        let is_slow = rate_hz < wish.rate_hz * 0.9;
        let off_px = width.abs_diff(target.0).saturating_add(height.abs_diff(target.1));
        // What is larger than usual costs more than it is worth, unless it was asked for.
        let off_px =
            if width > target.0 || height > target.1 { off_px.saturating_add(1 << 16) } else { off_px };
        let score = (is_slow, off_px, ((rate_hz - wish.rate_hz).abs() * 1000.0) as u64, rank);
        if best.as_ref().is_none_or(|(least, _)| score < *least) {
            best = Some((score, structure));
        }
    }
    best.map(|(_, structure)| {
        let mut caps = gst::Caps::new_empty();
        caps.get_mut().expect("nobody else holds caps just made").append_structure(structure);
        caps
    })
}

/// Whether a media type is wished, and before which others.
fn rank(kind: &str, format: DeviceFormat) -> Option<u8> {
    let (own, rank) = match kind {
        "video/x-raw" => (DeviceFormat::Raw, 0),
        "image/jpeg" => (DeviceFormat::Mjpeg, 1),
        "video/x-h264" => (DeviceFormat::H264, 2),
        _ => return None,
    };
    (format == own || format == DeviceFormat::Auto).then_some(rank)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::media::{Decoder, EncodedQueue};
    use std::sync::Arc;
    use std::time::Duration;

    /// As a usual USB camera lists them: large pictures fast as JPEG alone.
    const LISTED: &str = "video/x-raw,format=YUY2,width=640,height=480,framerate={30/1,15/1}; \
         video/x-raw,format=YUY2,width=1920,height=1080,framerate=5/1; \
         image/jpeg,width=1920,height=1080,framerate={30/1,25/1}; \
         image/jpeg,width=3840,height=2160,framerate=30/1; \
         video/x-h264,width=1280,height=720,framerate=30/1; video/x-bayer,width=1920,height=1080,framerate=25/1";

    fn wish(format: DeviceFormat, size_px: Option<(u32, u32)>, rate_hz: f64) -> DeviceWish {
        DeviceWish {
            format,
            width_px: size_px.map(|size| size.0),
            height_px: size_px.map(|size| size.1),
            rate_hz,
        }
    }

    #[test]
    fn the_nearest_format_that_is_fast_enough_is_taken() {
        gst::init().unwrap();
        let check = |listed: &str, wish: DeviceWish, expected: Option<&str>| {
            let chosen = choose(&listed.parse().unwrap(), &wish);
            assert_eq!(chosen, expected.map(|caps| caps.parse().unwrap()), "{wish:?}");
        };
        let jpeg = "image/jpeg,width=1920,height=1080,framerate=25/1";
        check(LISTED, wish(DeviceFormat::Auto, None, 25.0), Some(jpeg));
        check(LISTED, wish(DeviceFormat::Mjpeg, None, 25.0), Some(jpeg));
        let slow = "video/x-raw,format=YUY2,width=1920,height=1080,framerate=5/1";
        check(LISTED, wish(DeviceFormat::Auto, None, 5.0), Some(slow));
        let small = "video/x-raw,format=YUY2,width=640,height=480,framerate=15/1";
        check(LISTED, wish(DeviceFormat::Auto, Some((640, 480)), 14.0), Some(small));
        let fast = "video/x-raw,format=YUY2,width=640,height=480,framerate=30/1";
        check(LISTED, wish(DeviceFormat::Raw, None, 25.0), Some(fast));
        let h264 = "video/x-h264,width=1280,height=720,framerate=30/1";
        check(LISTED, wish(DeviceFormat::H264, None, 25.0), Some(h264));
        let large = "image/jpeg,width=3840,height=2160,framerate=30/1";
        check(LISTED, wish(DeviceFormat::Auto, Some((3840, 2160)), 25.0), Some(large));
        check(LISTED, wish(DeviceFormat::Auto, Some((800, 600)), 25.0), None);
        check(LISTED, wish(DeviceFormat::H264, Some((640, 480)), 25.0), None);
        check("", wish(DeviceFormat::Auto, None, 25.0), None);
        // Some list ranges.
        let ranges = "video/x-raw,format=YUY2,width=[32,4096],height=[32,4096],framerate=[1/1,60/1]";
        let middle = "video/x-raw,format=YUY2,width=800,height=600,framerate=25/1";
        check(ranges, wish(DeviceFormat::Auto, Some((800, 600)), 25.0), Some(middle));
    }

    #[test]
    fn what_is_captured_is_decoded_and_the_newest_counts() {
        gst::init().unwrap();
        let source = || {
            let source = make("videotestsrc").unwrap();
            source.set_property("is-live", true);
            source
        };
        let input = capture(source(), &wish(DeviceFormat::Raw, Some((320, 240)), 50.0)).unwrap();
        let mut decoder = Decoder::start(input, None).unwrap();
        let picture = (0..100).find_map(|_| decoder.pull(Duration::from_millis(100))).unwrap();
        assert_eq!((picture.image.width(), picture.image.height()), (320, 240));
        assert_eq!(picture.interval_nanos, Some(20_000_000));
        // What is recorded of it is made from its pictures.
        let input = capture(source(), &wish(DeviceFormat::Raw, Some((320, 240)), 50.0)).unwrap();
        let queue = Arc::new(EncodedQueue::new(1 << 20));
        let mut decoder = Decoder::start(input, Some(&queue)).unwrap();
        (0..100).find_map(|_| decoder.pull(Duration::from_millis(100))).unwrap();
        assert!(queue.wants_pictures() && queue.take().is_none());
        let none = capture(source(), &wish(DeviceFormat::H264, None, 25.0)).unwrap_err();
        assert!(matches!(none, Fault::Connection(ConnectionFault::NoFormat)), "{none:?}");
        let missing = Input::v4l2(Path::new("/dev/video-none"), &wish(DeviceFormat::Auto, None, 25.0));
        assert!(matches!(missing, Err(Fault::Connection(_))), "{missing:?}");
    }
}
