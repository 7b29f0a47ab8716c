//! Streams built by hand, read whole, in pieces, torn and spoilt.

use super::*;
use proptest::prelude::*;

/// An element.
pub(in crate::archive) fn element(id: u32, body: &[u8]) -> Vec<u8> {
    let mut bytes: Vec<u8> = id.to_be_bytes().into_iter().skip_while(|byte| *byte == 0).collect();
    bytes.extend((body.len() as u64 | 1 << 56).to_be_bytes());
    bytes.extend(body);
    bytes
}

fn open(id: u32) -> Vec<u8> {
    let mut bytes = id.to_be_bytes().to_vec();
    bytes.push(0xff);
    bytes
}

pub(in crate::archive) fn header() -> Vec<u8> {
    let scale = element(id::TIMESTAMP_SCALE, &100_000_u32.to_be_bytes());
    let video = [element(id::PIXEL_WIDTH, &[0, 160]), element(id::PIXEL_HEIGHT, &[120])].concat();
    let track = [element(id::CODEC_ID, b"V_MJPEG\0"), element(0x63a2, &[9; 99]), element(id::VIDEO, &video)];
    [
        element(id::EBML, &[1, 2, 3]),
        open(id::SEGMENT),
        element(id::INFO, &scale),
        element(id::TRACKS, &element(id::TRACK_ENTRY, &track.concat())),
    ]
    .concat()
}

/// A cluster of three blocks of which the first is a key frame, the last in a group.
pub(in crate::archive) fn cluster(ticks: u32) -> Vec<u8> {
    let block = |relative: i16, flags: u8, n: usize| {
        let [high, low] = relative.to_be_bytes();
        [vec![0x81, high, low, flags], vec![0xa3; n]].concat()
    };
    let group =
        [element(id::BLOCK, &block(-200, 0, 40)), element(0x9b, &[1]), element(id::REFERENCE_BLOCK, &[5])];
    [
        open(id::CLUSTER),
        element(id::TIMESTAMP, &ticks.to_be_bytes()),
        element(id::SIMPLE_BLOCK, &block(0, 0x80, 700)),
        element(id::SIMPLE_BLOCK, &block(400, 0, 0)),
        element(id::BLOCK_GROUP, &group.concat()),
    ]
    .concat()
}

fn walk(bytes: &[u8], chunk: usize) -> (Walker, Vec<Block>, Option<Malformed>) {
    let (mut walker, mut blocks) = (Walker::new(), Vec::new());
    for chunk in bytes.chunks(chunk) {
        if let Err(fault) = walker.feed(chunk, &mut |block| blocks.push(block)) {
            return (walker, blocks, Some(fault));
        }
    }
    (walker, blocks, None)
}

fn stream() -> (Vec<u8>, Vec<Block>) {
    let (head, one, two) = (header(), cluster(0), cluster(10_000));
    let (at, then) = (head.len() as u64, (head.len() + one.len()) as u64);
    let bytes = [head, one, two].concat();
    let (_, blocks, fault) = walk(&bytes, bytes.len());
    assert_eq!(fault, None);
    let seen: Vec<_> =
        blocks.iter().map(|b| (b.nanos / TICK_NANOS, b.is_key, b.cluster_offset, b.leads_cluster)).collect();
    assert_eq!(
        seen,
        [
            (0, true, at, true),
            (400, false, at, false),
            (-200, false, at, false),
            (10_000, true, then, true),
            (10_400, false, then, false),
            (9_800, false, then, false),
        ]
    );
    (bytes, blocks)
}

#[test]
fn blocks_come_out_alike_however_the_bytes_go_in() {
    let (bytes, expected) = stream();
    for chunk in [1, 2, 3, 7, 64, 1000] {
        let (walker, blocks, fault) = walk(&bytes, chunk);
        assert_eq!((blocks, fault), (expected.clone(), None), "{chunk}");
        assert_eq!(walker.whole_bytes(), bytes.len() as u64);
        assert_eq!(walker.header_bytes(), Some(header().len() as u64));
        assert_eq!(walker.header(), &Header { codec: "V_MJPEG".to_owned(), size_px: (160, 120) });
    }
}

#[test]
fn a_stream_cut_anywhere_gives_its_whole_blocks() {
    let (bytes, expected) = stream();
    for end in 0..bytes.len() {
        let (walker, blocks, fault) = walk(&bytes[..end], 50);
        let whole: Vec<_> = expected.iter().filter(|block| block.end <= end as u64).copied().collect();
        assert_eq!(walker.whole_bytes(), whole.last().map_or(0, |block| block.end), "{end}");
        assert_eq!((blocks, fault), (whole, None), "{end}");
    }
}

#[test]
fn reading_begins_at_any_cluster() {
    let (bytes, expected) = stream();
    let offset = expected[3].cluster_offset;
    let (mut walker, mut blocks) = (Walker::at_cluster(offset), Vec::new());
    walker.feed(&bytes[offset as usize..], &mut |block| blocks.push(block)).unwrap();
    assert_eq!(blocks, expected[3..]);
}

#[test]
fn what_is_not_ours_is_told_with_its_place() {
    let check = |bytes: Vec<u8>, offset: u64| {
        assert_eq!(walk(&bytes, 33).2, Some(Malformed { offset }), "{bytes:x?}");
    };
    let (bytes, _) = stream();
    check([bytes.clone(), vec![0; 40]].concat(), bytes.len() as u64);
    check([bytes.clone(), element(0xd7, &[1])].concat(), bytes.len() as u64);
    check(b"RIFF....AVI ".to_vec(), 0);
    let scale = element(id::TIMESTAMP_SCALE, &1_000_000_u32.to_be_bytes());
    let foreign = [element(id::EBML, &[]), open(id::SEGMENT), element(id::INFO, &scale)].concat();
    check(foreign, element(id::EBML, &[]).len() as u64 + 5 + element(id::INFO, &[]).len() as u64);
    // A block before its cluster's time, and one too short to have one.
    let untimed = [header(), open(id::CLUSTER), element(id::SIMPLE_BLOCK, &[0x81, 0, 0, 0])].concat();
    check(untimed, header().len() as u64 + 5);
    let short = [bytes.clone(), element(id::SIMPLE_BLOCK, &[0x81, 0, 0])].concat();
    check(short, bytes.len() as u64);
    let mut walker = walk(&bytes, 9).0;
    let fault = walker.feed(&[0], &mut |_| ()).unwrap_err();
    assert_eq!(walker.feed(&cluster(0), &mut |_| panic!("after a fault")), Err(fault));
}

proptest! {
    #![proptest_config(crate::archive::tests::seeded(2000))]
    #[test]
    fn no_bytes_make_it_panic_or_grow(
        at in any::<prop::sample::Index>(),
        put in prop::collection::vec(any::<u8>(), 0..40),
        rest in prop::collection::vec(any::<u8>(), 0..200),
        chunk in 1_usize..60,
    ) {
        let (bytes, _) = stream();
        let mut bytes = bytes;
        let at = at.index(bytes.len());
        let end = (at + put.len()).min(bytes.len());
        bytes.splice(at..end, put);
        for bytes in [bytes, rest] {
            let (walker, blocks, _) = walk(&bytes, chunk);
            prop_assert!(walker.look.capacity() <= 2 * MAX_LOOK_BYTES);
            prop_assert!(walker.whole_bytes() <= bytes.len() as u64);
            prop_assert!(blocks.windows(2).all(|pair| pair[0].end < pair[1].end));
            prop_assert_eq!(walk(&bytes, bytes.len().max(1)).1, blocks);
        }
    }
}
