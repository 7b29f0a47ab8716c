//! What every frame costs before anyone looks: mixture, segmentation, and now and then a checkpoint.

#![expect(clippy::unwrap_used, reason = "a benchmark that cannot go on fails where it stands")]

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use videofields_vision::background::{Format, GaussianMixture};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings};
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};
use videofields_vision::segment::Segmenter;

const WIDTH: u32 = 768;
const HEIGHT: u32 = 576;

/// A noisy floor over which twelve people-sized boxes walk.
fn frame(number: u32) -> YuvImage {
    let layout = YuvLayout::packed(WIDTH, HEIGHT);
    let mut state = number.wrapping_mul(0x9e37_79b9) | 1;
    let mut data: Vec<u8> = (0..YuvLayout::packed_len(WIDTH, HEIGHT))
        .map(|i| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            124 + (state >> if i < layout.offsets[1] { 29 } else { 30 }) as u8
        })
        .collect();
    for person in 0..12 {
        let left = (person * 61 + number * 3) % (WIDTH - 24);
        for y in person * 40..person * 40 + 70 {
            data[(y * WIDTH + left) as usize..][..24].fill(40 + person as u8 * 5);
        }
    }
    YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
}

fn benchmark(criterion: &mut Criterion) {
    let frames: Vec<YuvImage> = (0..64).map(frame).collect();
    let settings = BackgroundSettings::default();
    let mut mixture = GaussianMixture::new(&settings, Format::of(&frames[0]));
    for image in frames.iter().cycle().take(256) {
        mixture.update(image, 0.1).unwrap();
    }
    let mut group = criterion.benchmark_group("768x576");
    group.sample_size(30);
    let mut next = frames.iter().cycle();
    group.bench_function("update", |bencher| {
        bencher.iter(|| mixture.update(next.next().unwrap(), 0.1).unwrap());
    });
    group.bench_function("classify", |bencher| {
        bencher.iter(|| mixture.classify(next.next().unwrap()).unwrap());
    });
    let mut segmenter = Segmenter::new(&SegmentSettings::default());
    group.bench_function("segment", |bencher| {
        bencher.iter(|| {
            let frame = next.next().unwrap();
            black_box(segmenter.segment(frame, mixture.background_planes(), mixture.unmatched(), 0.1))
        });
    });
    group.sample_size(10);
    let encoded = mixture.encode(Timestamp::default()).unwrap();
    group.bench_function("checkpoint written", |bencher| {
        bencher.iter(|| mixture.encode(Timestamp::default()).unwrap());
    });
    group.bench_function("checkpoint read", |bencher| {
        bencher.iter(|| GaussianMixture::decode(&encoded, &settings).unwrap());
    });
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
