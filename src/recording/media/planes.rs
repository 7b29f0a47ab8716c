//! Takes the planes of decoded samples without copying them.

use super::{Picture, frame_number};
use gstreamer as gst;
use gstreamer_video as gst_video;
use serde::{Deserialize, Serialize};
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvError, YuvImage, YuvLayout};

/// Rows from which a picture that names no matrix counts as high definition.
const HIGH_DEFINITION_ROWS: u32 = 720;

/// A sample that is no I420 picture in memory.
#[derive(Debug, thiserror::Error)]
pub(super) enum SampleError {
    /// The sample lacks a part or its caps are not raw I420.
    #[error("{0}")]
    Unusable(&'static str),
    /// The buffer is smaller than its caps promise.
    #[error(transparent)]
    Layout(YuvError),
}

/// Reads samples of one stream; remembers the format between them.
#[derive(Debug, Default)]
pub(super) struct PlaneReader {
    format: Option<Format>,
    times: Times,
}

/// Zero from which the times of pictures count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Times {
    /// The time at which playing begins, as the container's own lists and maps have it.
    #[default]
    Played,
    /// The file's zero, as they are written. Of a recording that is read on from a key frame in its midst, what is
    /// played would count from the key frame or from a picture that is shown before it, and that changes on the way.
    Written,
}

impl Times {
    /// The time of a sample's buffer.
    pub(super) fn nanos(self, sample: &gst::SampleRef, buffer: &gst::BufferRef) -> Option<i64> {
        let time = match self {
            // Matroska's blocks of Windows' codecs (V_MS/VFW/FOURCC), which AVI files hold, have their time as that of decoding.
            Self::Written => buffer.pts().or(buffer.dts()),
            Self::Played => {
                let segment = sample.segment().and_then(|segment| segment.downcast_ref::<gst::ClockTime>());
                segment.and_then(|segment| segment.to_stream_time(buffer.pts()))
            }
        };
        time.and_then(|time| i64::try_from(time.nseconds()).ok())
    }
}

#[derive(Debug)]
struct Format {
    caps: gst::Caps,
    layout: YuvLayout,
    matrix: ColorMatrix,
    range: ColorRange,
    interval_nanos: Option<i64>,
}

impl PlaneReader {
    /// One whose pictures' times count as `times` has it.
    #[must_use]
    pub(super) const fn new(times: Times) -> Self {
        Self { format: None, times }
    }

    /// The picture of `sample`: the decoder's buffer itself, held mapped for as long as the picture lives.
    ///
    /// # Errors
    /// When the sample is no whole I420 picture.
    pub(super) fn picture(&mut self, sample: &gst::Sample) -> Result<Picture, SampleError> {
        let caps = sample.caps().ok_or(SampleError::Unusable("a sample without caps"))?;
        // The format changes rarely, if ever: caps are compared, which is an address in the usual case.
        let format = match self.format.take() {
            Some(format) if format.caps.as_ref() == caps => format,
            _ => Format::of(caps)?,
        };
        let format = self.format.insert(format);
        let buffer = sample.buffer_owned().ok_or(SampleError::Unusable("a sample without a buffer"))?;
        let stream_nanos = self.times.nanos(sample, &buffer);
        let promised = buffer.duration().and_then(|time| i64::try_from(time.nseconds()).ok());
        let (reference_nanos, encoded_number) = (reference_nanos(&buffer), frame_number::of(&buffer));
        let mut layout = format.layout;
        if let Some(meta) = buffer.meta::<gst_video::VideoMeta>() {
            place_planes(&mut layout, meta.offset(), meta.stride())?;
        }
        let mapped = buffer
            .into_mapped_buffer_readable()
            .map_err(|_buffer: gst::Buffer| SampleError::Unusable("a buffer that cannot be read"))?;
        let image =
            YuvImage::new(layout, format.matrix, format.range, mapped).map_err(SampleError::Layout)?;
        let interval_nanos = promised.or(format.interval_nanos);
        Ok(Picture { image, stream_nanos, interval_nanos, reference_nanos, encoded_number })
    }
}

impl Format {
    fn of(caps: &gst::CapsRef) -> Result<Self, SampleError> {
        let info = gst_video::VideoInfo::from_caps(caps).map_err(|_unreadable: gst::glib::BoolError| {
            SampleError::Unusable("caps that are no raw video")
        })?;
        if info.format() != gst_video::VideoFormat::I420 {
            return Err(SampleError::Unusable("a sample that is not I420"));
        }
        let mut layout = YuvLayout::packed(info.width(), info.height());
        place_planes(&mut layout, info.offset(), info.stride())?;
        let names_color = caps.structure(0).is_some_and(|structure| structure.has_field("colorimetry"));
        let (matrix, range) = color(names_color.then(|| info.colorimetry()), info.height());
        let (frames, secs) = (i64::from(info.fps().numer()), i64::from(info.fps().denom()));
        let interval_nanos = (frames > 0).then(|| 1_000_000_000 * secs / frames);
        Ok(Self { caps: caps.to_owned(), layout, matrix, range, interval_nanos })
    }
}

/// Seconds from 1900, where NTP begins, to 1970.
const NTP_EPOCH_SECS: u64 = 2_208_988_800;

/// Returns the time at which the picture in `buffer` was taken as its camera says, nanoseconds since 1970 (UTC).
pub(super) fn reference_nanos(buffer: &gst::BufferRef) -> Option<i64> {
    buffer.iter_meta::<gst::ReferenceTimestampMeta>().find_map(|meta| {
        let since_secs = match meta.reference().structure(0)?.name().as_str() {
            "timestamp/x-ntp" => NTP_EPOCH_SECS,
            "timestamp/x-unix" => 0,
            _ => return None,
        };
        let nanos = meta.timestamp().nseconds().checked_sub(since_secs * 1_000_000_000)?;
        i64::try_from(nanos).ok()
    })
}

fn place_planes(layout: &mut YuvLayout, offsets: &[usize], strides: &[i32]) -> Result<(), SampleError> {
    if offsets.len() < 3 || strides.len() < 3 {
        return Err(SampleError::Unusable("a picture with fewer than three planes"));
    }
    for plane in 0..3 {
        layout.offsets[plane] = offsets[plane];
        layout.strides[plane] =
            usize::try_from(strides[plane]).map_err(|_negative: std::num::TryFromIntError| {
                SampleError::Unusable("rows from bottom to top")
            })?;
    }
    Ok(())
}

/// Returns what a stream says of its colours, completed by what is usual: BT.601 for standard definition, BT.709 from 720
/// rows on, limited range. JPEG decoders name full-range BT.601 themselves.
fn color(named: Option<gst_video::VideoColorimetry>, height: u32) -> (ColorMatrix, ColorRange) {
    let usual = if height < HIGH_DEFINITION_ROWS { ColorMatrix::Bt601 } else { ColorMatrix::Bt709 };
    let Some(named) = named else { return (usual, ColorRange::Limited) };
    let matrix = match named.matrix() {
        // FCC 73.682 differs from BT.601 by about a code, SMPTE 240M from BT.709 by a few.
        gst_video::VideoColorMatrix::Bt601 | gst_video::VideoColorMatrix::Fcc => ColorMatrix::Bt601,
        gst_video::VideoColorMatrix::Bt709 | gst_video::VideoColorMatrix::Smpte240m => ColorMatrix::Bt709,
        gst_video::VideoColorMatrix::Bt2020 => ColorMatrix::Bt2020,
        _ => usual,
    };
    let range = match named.range() {
        gst_video::VideoColorRange::Range0_255 => ColorRange::Full,
        _ => ColorRange::Limited,
    };
    (matrix, range)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(caps: &str, len: usize) -> gst::Sample {
        gst::init().unwrap();
        let caps: gst::Caps = caps.parse().unwrap();
        let mut buffer = gst::Buffer::from_mut_slice(vec![77_u8; len]);
        buffer.make_mut().set_pts(gst::ClockTime::from_mseconds(1500));
        let mut segment = gst::FormattedSegment::<gst::ClockTime>::new();
        segment.set_start(gst::ClockTime::from_mseconds(1000));
        segment.set_time(gst::ClockTime::from_mseconds(200));
        gst::Sample::builder().buffer(&buffer).caps(&caps).segment(&segment).build()
    }

    #[test]
    fn colours_follow_the_caps_and_else_the_size() {
        let check = |height: u32, colorimetry: &str, matrix, range| {
            let caps = format!("video/x-raw,format=I420,width=8,height={height},framerate=25/1{colorimetry}");
            let picture = PlaneReader::default().picture(&sample(&caps, 12 * height as usize)).unwrap();
            assert_eq!((picture.image.matrix(), picture.image.range()), (matrix, range), "{caps}");
            assert_eq!((picture.image.width(), picture.image.height()), (8, height));
            assert_eq!(picture.interval_nanos, Some(40_000_000));
        };
        check(576, "", ColorMatrix::Bt601, ColorRange::Limited);
        check(718, "", ColorMatrix::Bt601, ColorRange::Limited);
        check(720, "", ColorMatrix::Bt709, ColorRange::Limited);
        check(720, ",colorimetry=bt601", ColorMatrix::Bt601, ColorRange::Limited);
        check(480, ",colorimetry=bt709", ColorMatrix::Bt709, ColorRange::Limited);
        check(2160, ",colorimetry=bt2020", ColorMatrix::Bt2020, ColorRange::Limited);
        check(720, ",colorimetry=1:4:0:0", ColorMatrix::Bt601, ColorRange::Full);
        check(1080, ",colorimetry=2:0:0:0", ColorMatrix::Bt709, ColorRange::Limited);
    }

    #[test]
    fn padded_rows_are_taken_as_they_lie() {
        gst::init().unwrap();
        // 16 bytes a row of luma and 8 of the others, for 8 x 4 pixels; padding is 255.
        let (offsets, strides, rows) = ([0, 64, 80], [16, 8, 8], [4, 2, 2]);
        let mut bytes = vec![255_u8; 96];
        let places = (0..3).flat_map(|plane| (0..rows[plane]).map(move |row| (plane, row)));
        for (plane, row) in places {
            let from: usize = offsets[plane] + row * strides[plane];
            bytes[from..from + strides[plane] / 2].fill((plane * 10 + row) as u8);
        }
        let mut buffer = gst::Buffer::from_mut_slice(bytes);
        let (flags, format) = (gst_video::VideoFrameFlags::empty(), gst_video::VideoFormat::I420);
        let strides = strides.map(|stride| stride as i32);
        let buffer_ref = buffer.make_mut();
        gst_video::VideoMeta::add_full(buffer_ref, flags, format, 8, 4, &offsets, &strides).unwrap();
        let caps: gst::Caps = "video/x-raw,format=I420,width=8,height=4".parse().unwrap();
        let sample = gst::Sample::builder().buffer(&buffer).caps(&caps).build();
        let image = PlaneReader::new(Times::Written).picture(&sample).unwrap().image;
        for plane in 0..3 {
            let found = image.plane(plane);
            assert_eq!((found.stride, found.height), (strides[plane] as usize, rows[plane] as u32));
            for y in 0..found.height {
                let expected = vec![(plane * 10) as u8 + y as u8; found.width as usize];
                assert_eq!(found.row(y), expected, "plane {plane}, row {y}");
            }
        }
    }

    #[test]
    fn stream_time_is_mapped_by_the_segment() {
        let caps = "video/x-raw,format=I420,width=8,height=4";
        let picture = PlaneReader::default().picture(&sample(caps, 48)).unwrap();
        assert_eq!(picture.stream_nanos, Some(700_000_000));
        assert_eq!(picture.interval_nanos, None);
    }

    #[test]
    fn samples_that_do_not_hold_their_picture_are_refused() {
        let read = |caps, len| PlaneReader::default().picture(&sample(caps, len));
        let caps = "video/x-raw,format=I420,width=8,height=4";
        assert!(matches!(read(caps, 47), Err(SampleError::Layout(YuvError::Short { .. }))));
        assert!(matches!(
            read("video/x-raw,format=NV12,width=8,height=4", 48),
            Err(SampleError::Unusable(_))
        ));
        assert!(matches!(read("audio/x-raw", 24), Err(SampleError::Unusable(_))));
    }
}
