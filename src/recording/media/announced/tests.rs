//! Headers as encoders write them, and as nobody but an attacker does.

use super::*;
use crate::media::{Decoder, Fault, Input, fault::SIZE_LIMIT};
use gst::prelude::*;
use std::time::Duration;

/// Writes bits, the highest of each byte first.
#[derive(Default)]
struct Written(Vec<bool>);

impl Written {
    fn bits(mut self, value: u32, n_bits: u32) -> Self {
        self.0.extend((0..n_bits).rev().map(|bit| value >> bit & 1 == 1));
        self
    }

    fn exponential(self, value: u32) -> Self {
        let n_bits = (value + 1).ilog2();
        self.bits(0, n_bits).bits(value + 1, n_bits + 1)
    }

    fn bytes(&self) -> Vec<u8> {
        let byte =
            |bits: &[bool]| bits.iter().zip(0..).fold(0, |byte, (bit, at)| byte | u8::from(*bit) << (7 - at));
        self.0.chunks(8).map(byte).collect()
    }

    /// The bytes behind `head`, with what keeps start codes from appearing in them.
    fn unit(&self, head: &[u8]) -> Vec<u8> {
        let mut unit = head.to_vec();
        for byte in self.bytes() {
            if byte <= 3 && unit.ends_with(&[0, 0]) {
                unit.push(3);
            }
            unit.push(byte);
        }
        unit
    }
}

/// A sequence parameter set of H.264 for so many macroblocks, in the form that is written with the most before the size.
fn h264_set(width: u32, height: u32) -> Vec<u8> {
    let set = Written::default().bits(244, 8).bits(0, 8).bits(40, 8).exponential(0).exponential(3).bits(0, 1);
    let mut set = set.exponential(0).exponential(0).bits(0, 1).bits(1, 1);
    for list in 0..12 {
        // The second and the eighth list say all of their numbers, the third that it goes on as it stands; the others are left out.
        set = match list {
            1 => (0..16).fold(set.bits(1, 1), |set, _| set.exponential(1)),
            2 => set.bits(1, 1).exponential(16),
            7 => (0..64).fold(set.bits(1, 1), |set, _| set.exponential(1)),
            _ => set.bits(0, 1),
        };
    }
    let set = set
        .exponential(4)
        .exponential(1)
        .bits(0, 1)
        .exponential(2)
        .exponential(2)
        .exponential(1)
        .exponential(9);
    set.exponential(1)
        .bits(0, 1)
        .exponential(width / 16 - 1)
        .exponential(height / 32 - 1)
        .bits(0, 2)
        .bits(1, 1)
        .bits(0, 2)
        .bits(1, 1)
        .unit(&[0x67])
}

fn h265_set(width: u32, height: u32) -> Vec<u8> {
    let set = Written::default().bits(0, 4).bits(2, 3).bits(1, 1).bits(0, 32).bits(0, 32).bits(0, 32);
    // Two layers: the first with a profile, the second with a level.
    let set = set.bits(0b10_01, 4).bits(0, 12).bits(0, 32).bits(0, 32).bits(0, 24).bits(0, 8);
    set.exponential(0)
        .exponential(3)
        .bits(0, 1)
        .exponential(width)
        .exponential(height)
        .bits(1, 1)
        .unit(&[0x42, 1])
}

/// Returns a sequence header of AV1, with its length.
fn av1_sequence(width: u32, height: u32) -> Vec<u8> {
    let sequence = Written::default().bits(0, 3).bits(1, 1).bits(1, 1).bits(0, 5).bits(15, 4).bits(15, 4);
    let sequence = sequence.bits(width - 1, 16).bits(height - 1, 16).bytes();
    [&[0x0a, sequence.len() as u8][..], &sequence].concat()
}

fn announced(format: &str, bytes: &[u8]) -> Announced {
    gst::init().unwrap();
    let caps: gst::Caps = format.parse().unwrap();
    in_bytes(caps.structure(0).unwrap(), bytes)
}

fn coded(unit: &[u8]) -> Vec<u8> {
    [&[0, 0, 0, 1][..], unit].concat()
}

#[test]
fn the_size_is_read_from_what_encoders_write() {
    gst::init().unwrap();
    let cases = [
        ("x264enc ! video/x-h264,stream-format=byte-stream", "video/x-h264", (160, 128)),
        ("x264enc ! video/x-h264,stream-format=avc", "video/x-h264", (160, 128)),
        ("x264enc ! video/x-h264,profile=high", "video/x-h264", (160, 128)),
        ("x265enc ! video/x-h265,stream-format=byte-stream", "video/x-h265", (160, 120)),
        ("x265enc ! h265parse ! video/x-h265,stream-format=hvc1", "video/x-h265", (160, 120)),
        ("jpegenc", "image/jpeg", (160, 120)),
        ("pngenc", "image/png", (160, 120)),
        ("avenc_bmp", "image/bmp", (160, 120)),
        ("vp8enc deadline=1", "video/x-vp8", (160, 120)),
        ("vp9enc deadline=1 cpu-used=8", "video/x-vp9", (160, 120)),
        ("av1enc cpu-used=8", "video/x-av1", (160, 120)),
        ("avenc_mpeg4", "video/mpeg", (160, 120)),
    ];
    for (encoder, kind, expected) in cases {
        let description = format!(
            "videotestsrc num-buffers=12 ! video/x-raw,width=160,height=120,framerate=10/1 ! videoconvert ! {encoder} ! \
             appsink name=out sync=false"
        );
        let pipeline = gst::parse::launch(&description).unwrap().downcast::<gst::Pipeline>().unwrap();
        let sink = pipeline.by_name("out").unwrap().downcast::<gstreamer_app::AppSink>().unwrap();
        pipeline.set_state(gst::State::Playing).unwrap();
        let mut said = Announced::Nothing;
        let mut n_buffers = 0;
        while let Ok(sample) = sink.pull_sample() {
            let format = sample.caps().unwrap().structure(0).unwrap();
            assert_eq!(format.name(), kind);
            let bytes = sample.buffer().unwrap().map_readable().unwrap();
            said = said.max(in_format(format)).max(in_bytes(format, &bytes));
            n_buffers += 1;
        }
        pipeline.set_state(gst::State::Null).unwrap();
        assert!(n_buffers >= 12, "{encoder}: {n_buffers}");
        assert_eq!(said, Announced::Size(expected), "{encoder}");
    }
}

#[test]
fn every_header_tells_its_size_wherever_it_stands() {
    let size = Announced::Size;
    let byte_stream = "video/x-h264,stream-format=byte-stream";
    let sets = [coded(&h264_set(320, 64)), coded(&[0x41, 9, 9]), coded(&h264_set(16_384, 4096))];
    assert_eq!(announced(byte_stream, &sets[0]), size((320, 64)));
    assert_eq!(announced(byte_stream, &sets.concat()), size((16_384, 4096)), "the second set of a buffer");
    assert_eq!(announced(byte_stream, &sets[1]), Announced::Nothing);
    assert_eq!(announced(byte_stream, &coded(&[0x67, 100, 0])), Announced::Unreadable);
    let with_length = [&[0, 0, 0, 2, 0x41, 9][..], &(sets[2].len() as u32 - 4).to_be_bytes(), &sets[2][4..]];
    assert_eq!(announced("video/x-h264,stream-format=avc", &with_length.concat()), size((16_384, 4096)));
    let set = coded(&h265_set(9000, 40));
    assert_eq!(announced("video/x-h265,stream-format=byte-stream", &set), size((9000, 40)));
    // Units that a decoder finds by start codes though the stream has lengths, or takes for a header.
    let avc = "video/x-h264,stream-format=avc";
    let large = h264_set(16_384, 4096);
    let hidden = [&[0, 0, 0, large.len() as u8 + 6][..], &[0x41, 9, 0, 0, 1], &large, &[0]].concat();
    assert_eq!(announced(avc, &hidden), size((16_384, 4096)));
    assert_eq!(
        announced(avc, &coded(&h264_set(320, 64))),
        size((320, 64)),
        "start codes in place of lengths"
    );
    let header = [&[1, 100, 0, 40, 0xff, 0xe1][..], &(large.len() as u16).to_be_bytes(), &large].concat();
    assert_eq!(announced(avc, &header), size((16_384, 4096)));
    let layer = [&[0x42, 9][..], &h265_set(9000, 40)[2..]].concat();
    assert_eq!(
        announced("video/x-h265,stream-format=byte-stream", &coded(&layer)),
        Announced::Nothing,
        "a set of a layer that is not decoded"
    );
    // The codec's headers, with one set each.
    let with_header = |kind: &str, header: &[u8]| {
        gst::init().unwrap();
        let buffer = gst::Buffer::from_slice(header.to_vec());
        let caps = gst::Caps::builder(kind).field("codec_data", buffer).build();
        in_format(caps.structure(0).unwrap())
    };
    let set = h264_set(16_384, 4096);
    let header = [&[1, 100, 0, 40, 0xff, 0xe1][..], &(set.len() as u16).to_be_bytes(), &set, &[0]].concat();
    assert_eq!(with_header("video/x-h264", &header), size((16_384, 4096)));
    let set = h265_set(9000, 40);
    let header = [&[0; 22][..], &[2, 32, 0, 0, 33, 0, 1], &(set.len() as u16).to_be_bytes(), &set].concat();
    assert_eq!(with_header("video/x-h265", &header), size((9000, 40)));

    let vp8 = [0x10, 0, 0, 0x9d, 1, 0x2a, 0xff, 0x7f, 0xff, 0x3f];
    assert_eq!(announced("video/x-vp8", &vp8), size((16_383, 16_383)), "without the bits of scaling");
    assert_eq!(announced("video/x-vp8", &vp8[..9]), Announced::Unreadable);
    // A frame of VP9 that builds on others may still have a size of its own, and be the second of two.
    let key = Written::default().bits(2, 2).bits(0, 3).bits(0, 1).bits(1, 1).bits(0, 1).bits(0x49_83_42, 24);
    let key = key.bits(1, 3).bits(0, 1).bits(319, 16).bits(239, 16).bytes();
    let delta =
        Written::default().bits(2, 2).bits(0, 3).bits(1, 1).bits(1, 1).bits(0, 1).bits(0, 2).bits(0, 20);
    let delta = delta.bits(0, 3).bits(65_535, 16).bits(99, 16).bytes();
    assert_eq!(announced("video/x-vp9", &key), size((320, 240)));
    assert_eq!(announced("video/x-vp9", &delta), size((65_536, 100)));
    let both = [&key[..], &delta, &[0xc1, key.len() as u8, delta.len() as u8, 0xc1]].concat();
    assert_eq!(announced("video/x-vp9", &both), size((65_536, 100)));
    let temporal_unit = [&[0x12, 0][..], &av1_sequence(65_536, 8)].concat();
    assert_eq!(announced("video/x-av1", &temporal_unit), size((65_536, 8)));
    let bare = gst::Caps::builder("video/x-av1").build();
    let before = |bytes: &[u8]| before_parser(bare.structure(0).unwrap(), bytes);
    assert_eq!(before(&temporal_unit), size((65_536, 8)));
    assert_eq!(before(&temporal_unit[2..]), Announced::Nothing, "a piece that is cut anywhere");
    let layer =
        Written::default().bits(0, 9).bits(1, 1).bits(1, 7).bits(1, 4).bits(0, 1).bits(0, 2).bits(1, 1);
    let layer = layer.bits(25, 16).bits(1, 1).bits(1, 1).bits(1, 5).bits(1, 1).bits(8191, 13).bits(1, 1);
    let layer = [&[0, 0, 1, 0x20][..], &layer.bits(8190, 13).bits(1, 1).bytes()].concat();
    assert_eq!(announced("video/mpeg", &layer), size((8191, 8190)));
    let cut = [0, 0, 1, 0x20, 0];
    for both in [[&layer[..], &cut].concat(), [&cut[..], &layer].concat()] {
        assert_eq!(announced("video/mpeg", &both), size((8191, 8190)), "beside one that cannot be read");
    }
    let studio = Written::default().bits(0, 1).bits(14, 8).bits(0, 30).bits(0, 30);
    assert_eq!(
        announced("video/mpeg", &[&[0, 0, 1, 0x20][..], &studio.bytes()].concat()),
        Announced::Unreadable
    );
    let y4m = |line: &str| announced("application/x-yuv4mpeg", format!("YUV4MPEG2{line}").as_bytes());
    assert_eq!(y4m(" H48 F25:1 W64 Ip\nFRAME\n"), size((64, 48)), "in any order");
    assert_eq!(y4m(" W99999999999 H48\nFRAME"), size((u32::MAX, 48)));
    for line in [" W64 H48", " W64\nFRAME H48\n", " W-64 H48\n", " W64 H\n"] {
        assert_eq!(y4m(line), Announced::Unreadable, "{line:?}");
    }
    let oldest = [&b"BM"[..], &[0; 12], &[12, 0, 0, 0, 0x10, 0x27, 0x20, 0]].concat();
    assert_eq!(announced("image/bmp", &oldest), size((10_000, 32)));
}

#[test]
fn no_bytes_are_read_past_their_end() {
    for kind in [
        "video/x-h264",
        "video/x-h265",
        "image/jpeg",
        "video/x-vp8",
        "video/x-vp9",
        "video/x-av1",
        "video/mpeg",
        "image/png",
        "image/bmp",
        "application/x-yuv4mpeg",
    ] {
        let mut random = 12_345_u64;
        for n_bytes in 0..300 {
            let bytes: Vec<u8> = (0..n_bytes)
                .map(|_| {
                    random = random
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    // Zeros and ones are what start codes are made of.
                    [0, 0, 1, (random >> 40) as u8][(random >> 60) as usize % 4]
                })
                .collect();
            std::hint::black_box(announced(kind, &bytes));
        }
    }
}

#[test]
fn no_size_hides_one_that_is_too_large() {
    // Too many pixels, and a longer side of few.
    let (large, long) = (Announced::Size((8000, 8000)), Announced::Size((8176, 16)));
    for (one, other) in
        [(large, long), (long, large), (Announced::Unreadable, large), (large, Announced::Nothing)]
    {
        assert_eq!(one.max(other), large, "{one:?} and {other:?}");
    }
    let (wide, square) = (Announced::Size((120, 10)), Announced::Size((100, 100)));
    assert_eq!((wide.max(square), square.max(wide)), (square, square), "in either order");
    let sets = [coded(&h264_set(8000, 8000)), coded(&h264_set(8176, 32))].concat();
    assert_eq!(announced("video/x-h264,stream-format=byte-stream", &sets), large);
}

#[test]
fn limits_are_as_they_are_told() {
    assert_eq!(SIZE_LIMIT, format!("{MAX_SIDE} pixels a side and {} megapixels", MAX_PIXELS >> 20));
    assert!(!is_too_large((8192, 4608)) && !is_too_large((7680, 4320)));
    assert!(is_too_large((8193, 1)) && is_too_large((1, 8193)) && is_too_large((8192, 4609)));
}

/// Returns the fault that a file of these bytes comes to.
fn fault_of(bytes: &[u8]) -> Fault {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    std::fs::write(&path, bytes).unwrap();
    let mut decoder = Decoder::start(Input::file(&path).unwrap(), None).unwrap();
    for _ in 0..50 {
        if let Some(picture) = decoder.pull(Duration::from_millis(100)) {
            panic!("a picture came: {:?}", picture.image);
        }
        if let Some(fault) = decoder.fault() {
            return fault;
        }
        if decoder.has_ended() {
            return Fault::Damaged("it ended".to_owned());
        }
    }
    panic!("nothing came");
}

#[test]
fn files_that_claim_too_much_are_refused_for_their_size() {
    let jpeg = |width: u16, height: u16| {
        let [h0, h1] = height.to_be_bytes();
        let [w0, w1] = width.to_be_bytes();
        let frame = [0xff, 0xc0, 0, 17, 8, h0, h1, w0, w1, 3, 1, 0x22, 0, 2, 0x11, 0, 3, 0x11, 0];
        let scan = [0xff, 0xda, 0, 12, 3, 1, 0, 2, 0, 3, 0, 0, 63, 0, 1, 2, 3, 0xff, 0xd9];
        let comment = [&[0xff, 0xfe, 0x40, 0][..], &[32; 0x3ffe]].concat();
        [&[0xff, 0xd8][..], &comment, &frame, &scan].concat()
    };
    let png = |side: u32| {
        let sides = [side.to_be_bytes(), side.to_be_bytes()].concat();
        let head = [&b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"[..], &sides, &[8, 2, 0, 0, 0, 1, 2, 3, 4]].concat();
        [&head[..], &b"\0\0\0\x08IDAT12345678CRC4\0\0\0\0IEND\xaeB`\x82"[..]].concat()
    };
    let bmp = |side: i32| {
        let sides = [side.to_le_bytes(), side.to_le_bytes()].concat();
        let head = [&b"BM"[..], &[0xff, 0xff, 0, 0, 0, 0, 0, 0, 54, 0, 0, 0, 40, 0, 0, 0]].concat();
        [&head[..], &sides, &[1, 0, 24, 0], &[0; 2000]].concat()
    };
    let ivf = |code: &[u8; 4], frame: &[u8]| {
        let head =
            [&b"DKIF\0\0 \0"[..], code, &[64, 0, 48, 0, 25, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]]
                .concat();
        [&head[..], &(frame.len() as u32).to_le_bytes(), &[0; 8], frame].concat()
    };
    let vp8 = [&[0x10, 0, 0, 0x9d, 1, 0x2a, 0xff, 0x3f, 0xff, 0x3f][..], &[0; 90]].concat();
    let key = Written::default().bits(2, 2).bits(0, 3).bits(0, 1).bits(1, 1).bits(0, 1).bits(0x49_83_42, 24);
    let vp9 = [key.bits(1, 3).bits(0, 1).bits(59_999, 16).bits(59_999, 16).bytes(), vec![1; 60]].concat();
    let picture_set = coded(&[0x68, 0xce, 0x38, 0x80]);
    let slice = coded(&[&[0x65, 0x88, 0x84][..], &[0x5a; 60]].concat());
    let h264 = [coded(&h264_set(16_384, 16_384)), picture_set, slice.clone(), slice].concat();
    let h265 =
        [coded(&h265_set(16_384, 16_384)), coded(&[&[38, 1, 0xac][..], &[0x5a; 200]].concat())].concat();
    let av1 = [&[0x12, 0][..], &av1_sequence(65_536, 65_536), &[0x32, 41, 0x10], &[0x5a; 40]].concat();
    for (what, bytes) in [
        ("JPEG", jpeg(60_000, 60_000)),
        ("JPEG of many pixels", jpeg(8000, 8000)),
        ("PNG", png(60_000)),
        ("BMP", bmp(60_000)),
        ("VP8", ivf(b"VP80", &vp8)),
        ("VP9", ivf(b"VP90", &vp9)),
        ("H.264", h264.repeat(3)),
        ("H.265", h265.repeat(3)),
        ("AV1", ivf(b"AV01", &av1)),
        ("YUV4MPEG", b"YUV4MPEG2 W65520 H65520 F10:1 Ip C420\nFRAME\n".repeat(9)),
    ] {
        let fault = fault_of(&bytes);
        assert!(matches!(fault, Fault::TooLarge { .. }), "{what}: {fault:?}");
        assert!(fault.to_string().contains("megapixels"), "{fault}");
    }
}

#[test]
fn formats_that_are_not_named_are_refused_whatever_is_installed() {
    let svg = b"<?xml version=\"1.0\"?><svg xmlns=\"http://www.w3.org/2000/svg\" width=\"32000\" height=\"32000\"/>";
    let webp =
        [&b"RIFF\x1e\0\0\0WEBPVP8 \x12\0\0\0\x10\0\0\x9d\x01\x2a\xff\x3f\xff\x3f"[..], &[0; 8]].concat();
    let jp2 = [&b"\0\0\0\x0cjP  \r\n\x87\n\0\0\0\x14ftypjp2 \0\0\0\0jp2 "[..], &[0; 120]].concat();
    for (name, bytes) in [("SVG", &svg[..]), ("WebP", &webp), ("JPEG 2000", &jp2)] {
        let fault = fault_of(bytes);
        assert!(matches!(&fault, Fault::Refused { format, .. } if format == name), "{name}: {fault:?}");
        assert!(fault.to_string().contains("H.264"), "{fault}");
    }
}

#[test]
fn a_frame_without_a_slice_is_no_picture() {
    gst::init().unwrap();
    let format = |name: &str, packaging: &str| {
        gst::Caps::builder(name).field("stream-format", packaging).build().structure(0).unwrap().to_owned()
    };
    let (avc, hvc1) = (format("video/x-h264", "avc"), format("video/x-h265", "hvc1"));
    let frame = |units: &[u8]| units.iter().flat_map(|first| [0, 0, 0, 3, *first, 1, 2]).collect::<Vec<u8>>();
    for (format, units, content) in [
        (&avc, &[9, 6, 0x41][..], Content::Picture),
        (&avc, &[0x67, 0x68, 0x65], Content::Picture),
        (&avc, &[0x67, 0x68], Content::Headers),
        (&avc, &[9, 6], Content::Nothing),
        (&avc, &[], Content::Nothing),
        (&hvc1, &[32 << 1, 33 << 1, 34 << 1, 19 << 1], Content::Picture),
        (&hvc1, &[35 << 1, 1 << 1], Content::Picture),
        (&hvc1, &[33 << 1], Content::Headers),
        (&hvc1, &[39 << 1], Content::Nothing),
    ] {
        assert_eq!(nal_content(format, &frame(units)), content, "{units:?}");
    }
    // A unit whose length is beyond the frame is there all the same.
    assert_eq!(nal_content(&avc, &[0, 0, 9, 0, 0x41]), Content::Picture);
    assert_eq!(nal_content(&format("image/jpeg", "avc"), &[]), Content::Picture);
    assert_eq!(nal_content(&format("video/x-h264", "byte-stream"), &[0, 0, 1, 9]), Content::Picture);
}
