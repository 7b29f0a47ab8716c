//! What a ray costs: the plaza, 2000 boxes, a terrain of 65025 cells; through the tree and by trying every solid.
//!
//! Rays are those of a camera's pixels, on all cores; throughput is in rays, so `Melem/s` reads as Mray/s.

#![expect(clippy::unwrap_used, reason = "a benchmark that cannot go on fails where it stands")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::hint::black_box;
use videofields_simulate::{CastOptions, Layers, Shot, SolidHit, Solids, Terrain, World};
use videofields_vision::geometry::{Camera, GroundPolygon, OrientedBox, Ray, Surfaces};

const SIZE_PX: (u32, u32) = (640, 360);

fn rays(camera: &Camera) -> Vec<Ray> {
    let size = DVec2::new(f64::from(SIZE_PX.0), f64::from(SIZE_PX.1));
    let pixels = (0..SIZE_PX.1).flat_map(|y| (0..SIZE_PX.0).map(move |x| (x, y)));
    pixels.filter_map(|(x, y)| camera.ray((DVec2::new(f64::from(x), f64::from(y)) + 0.5) / size)).collect()
}

/// A number in [0, 1): the low bits of a Weyl sequence are even enough to place boxes by.
fn unit(i: u32, k: u32) -> f64 {
    (f64::from(i) * [0.618_033_988, 0.754_877_666, 0.569_840_291, 0.819_172_513][k as usize]).fract()
}

fn ground(half_m: f64) -> GroundPolygon {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    GroundPolygon::new(corners.map(|corner| DVec2::from_array(corner) * half_m).to_vec(), 0.0).unwrap()
}

/// A town of 2000 boxes on 600 m x 600 m.
fn town() -> Solids {
    let boxes = (0..2000).map(|i| {
        let size = DVec3::new(3.0 + 9.0 * unit(i, 2), 3.0 + 9.0 * unit(i, 3), 2.0 + 10.0 * unit(i, 2));
        let place = DVec3::new(unit(i, 0) - 0.5, unit(i, 1) - 0.5, 0.0) * 600.0 + DVec3::Z * size.z * 0.5;
        OrientedBox::new(place, size, f64::from(i)).unwrap()
    });
    Solids::new(Surfaces::of_ground_and_boxes(vec![ground(400.0)], boxes.collect()), None)
}

/// Hills of 256 x 256 posts, 2 m apart.
fn hills() -> Solids {
    let height = |i: u32| {
        let (x, y) = (f64::from(i % 256), f64::from(i / 256));
        4.0 * (x * 0.11).sin() * (y * 0.07).cos() + 0.8 * (x * 0.53 + y * 0.41).sin()
    };
    let terrain = Terrain::new(DVec2::splat(-256.0), 2.0, 256, (0..256 * 256).map(height).collect());
    Solids::new(Surfaces::default(), Some(terrain.unwrap()))
}

fn count(rays: &[Ray], hit: impl Fn(&Ray) -> Option<SolidHit> + Sync) -> usize {
    rays.par_iter().filter(|ray| hit(ray).is_some()).count()
}

fn benchmark(criterion: &mut Criterion) {
    let plaza = World::named("plaza").unwrap();
    let (id, camera) = plaza.cameras(SIZE_PX).unwrap().remove(0);
    let over_town = Camera::pinhole(DVec3::new(-180.0, -260.0, 40.0), DVec3::ZERO, 0.8, SIZE_PX).unwrap();
    let over_hills = Camera::pinhole(DVec3::new(-200.0, -230.0, 30.0), DVec3::ZERO, 0.8, SIZE_PX).unwrap();
    for (name, solids, camera) in [
        ("plaza", plaza.solids(), &camera),
        ("2000 boxes", &town(), &over_town),
        ("terrain", &hills(), &over_hills),
    ] {
        let all = rays(camera);
        let (tree, tried): (Vec<_>, Vec<_>) =
            all.iter().step_by(997).map(|ray| (solids.hit(ray), solids.hit_by_trying_all(ray))).unzip();
        assert!(tree == tried && tree.iter().flatten().count() > tree.len() / 4);
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.throughput(Throughput::Elements(all.len() as u64));
        group
            .bench_function("tree", |bencher| bencher.iter(|| count(black_box(&all), |ray| solids.hit(ray))));
        // So many that the slowest takes about a second.
        let some: Vec<Ray> = all.iter().copied().step_by(if name == "terrain" { 499 } else { 37 }).collect();
        group.throughput(Throughput::Elements(some.len() as u64));
        group.bench_function("every solid", |bencher| {
            bencher.iter(|| count(black_box(&some), |ray| solids.hit_by_trying_all(ray)));
        });
        group.finish();
    }
    let mut group = criterion.benchmark_group("picture of the plaza, 640x360, 3x3 samples");
    group.sample_size(10);
    group.throughput(Throughput::Elements(u64::from(SIZE_PX.0 * SIZE_PX.1) * 9));
    group.bench_function("plate", |bencher| bencher.iter(|| plaza.plate(&camera, 3).unwrap()));
    let shot = Shot { camera: &camera, device: Some(id), time_secs: 8.0 };
    let layers = Layers::ALL;
    let options = CastOptions { layers, ..CastOptions::new(3) };
    group.bench_function("all layers", |bencher| bencher.iter(|| plaza.cast(&shot, &options).unwrap()));
    let plate = plaza.plate(&camera, 3).unwrap();
    group.bench_function("over a plate", |bencher| {
        bencher.iter(|| plaza.cast_over(&plate, Some(id), 8.0).unwrap());
    });
    group.finish();
    let mut group = criterion.benchmark_group("built once");
    group.sample_size(10);
    group.bench_function("2000 boxes", |bencher| bencher.iter(town));
    group.bench_function("terrain", |bencher| bencher.iter(hills));
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
