//! Gives packets the times that the camera gave them, without a wrap.
//!
//! `GStreamer`'s jitter buffer evens times out by when packets came, and takes the steps back of B frames for jitter. So it is left to put
//! packets in order, and times are counted here; scene time is evened out behind the decoder.

use gst::prelude::*;
use gstreamer as gst;
use std::sync::Mutex;
use videofields_vision::lock::lock;

/// Time of the first packet: later than any camera's clock steps back.
const FIRST_NANOS: i64 = 1_000_000_000_000_000;

/// Times of one stream's packets (RFC 3550, 5.1).
#[derive(Debug, Default)]
struct RtpTimes {
    /// Ticks a second.
    rate_hz: Option<u32>,
    /// The newest packet's time as it came, and as it is counted, in nanoseconds.
    newest: Option<(u32, i64)>,
}

impl RtpTimes {
    /// Takes the format of the packets that follow.
    fn set_format(&mut self, caps: &gst::CapsRef) {
        let rate = caps.structure(0).and_then(|format| format.get::<i32>("clock-rate").ok());
        self.rate_hz = rate.and_then(|rate| u32::try_from(rate).ok()).filter(|rate| *rate > 0);
    }

    /// Returns the time of the next packet in nanoseconds; none before a format is known, and of what is no packet. A time is taken to
    /// lie less than half a wrap from the one before.
    fn next(&mut self, packet: &[u8]) -> Option<i64> {
        let rate_hz = self.rate_hz?;
        let ticks = u32::from_be_bytes(packet.get(4..8)?.try_into().ok()?);
        let nanos = self.newest.map_or(FIRST_NANOS, |(before, nanos)| {
            let step = i64::from(ticks.wrapping_sub(before).cast_signed());
            nanos.saturating_add(step.saturating_mul(1_000_000_000) / i64::from(rate_hz)).max(0)
        });
        self.newest = Some((ticks, nanos));
        Some(nanos)
    }
}

/// Has the packets that leave by `pad` bear the camera's times.
pub(super) fn keep_times(pad: &gst::Pad) {
    let times = Mutex::new(RtpTimes::default());
    pad.add_probe(gst::PadProbeType::BUFFER | gst::PadProbeType::EVENT_DOWNSTREAM, move |_pad, info| {
        let mut times = lock(&times);
        if let Some(event) = info.event() {
            if let gst::EventView::Caps(event) = event.view() {
                times.set_format(event.caps());
            }
            return gst::PadProbeReturn::Ok;
        }
        let Some(buffer) = info.buffer_mut() else { return gst::PadProbeReturn::Ok };
        let nanos = buffer.map_readable().ok().and_then(|packet| times.next(&packet));
        if let Some(nanos) = nanos.and_then(|nanos| u64::try_from(nanos).ok()) {
            buffer.make_mut().set_pts(gst::ClockTime::from_nseconds(nanos));
        }
        gst::PadProbeReturn::Ok
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_go_back_and_beyond_a_wrap_as_the_camera_has_them() {
        gst::init().unwrap();
        let mut times = RtpTimes::default();
        let packet = |ticks: u32| [&[0x80, 96, 0, 1][..], &ticks.to_be_bytes(), &[0; 4]].concat();
        assert_eq!(times.next(&packet(7)), None, "its rate is not known");
        let caps = gst::Caps::builder("application/x-rtp").field("clock-rate", 90_000).build();
        times.set_format(&caps);
        let begun = u32::MAX - 8999;
        let mut next = |ticks: u32| times.next(&packet(ticks)).unwrap() - FIRST_NANOS;
        assert_eq!(next(begun), 0);
        assert_eq!(next(begun.wrapping_add(9000)), 100_000_000);
        assert_eq!(next(begun.wrapping_add(3600)), 40_000_000, "a B frame");
        assert_eq!(next(begun.wrapping_add(27_000)), 300_000_000);
        assert_eq!(next(begun.wrapping_sub(900_000)), -10_000_000_000);
        assert_eq!(times.next(&[0x80, 96, 0]), None);
    }

    #[test]
    fn no_time_is_negative_or_overflows() {
        gst::init().unwrap();
        let mut times = RtpTimes::default();
        times.set_format(&gst::Caps::builder("application/x-rtp").field("clock-rate", 1).build());
        for (n, step) in [(30, 0x8000_0000_u32), (30, 0x7fff_ffff)] {
            let mut ticks = 0_u32;
            for _ in 0..n {
                ticks = ticks.wrapping_add(step);
                let packet = [&[0x80, 96, 0, 1][..], &ticks.to_be_bytes(), &[0; 4]].concat();
                assert!(times.next(&packet).unwrap() >= 0);
            }
        }
    }
}
