//! What a ray at a scene costs: 3 shapes, 1000 shapes of every exact kind, a model of 125000 triangles; through
//! `Surfaces` and by trying every shape.
//!
//! Rays are those of a camera's pixels, on one core; throughput is in rays, so `Melem/s` reads as Mray/s.

#![expect(clippy::unwrap_used, reason = "a benchmark that cannot go on fails where it stands")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec2, DVec3};
use std::hint::black_box;
use videofields_vision::geometry::{
    Camera, Cylinder, ExtrudedFootprint, GroundPolygon, OrientedBox, Ray, Shape, Surfaces, TriangleMesh,
};

const SIZE_PX: (u32, u32) = (160, 90);

fn rays(camera: &Camera) -> Vec<Ray> {
    let size = DVec2::new(f64::from(SIZE_PX.0), f64::from(SIZE_PX.1));
    let pixels = (0..SIZE_PX.1).flat_map(|y| (0..SIZE_PX.0).map(move |x| (x, y)));
    pixels.filter_map(|(x, y)| camera.ray((DVec2::new(f64::from(x), f64::from(y)) + 0.5) / size)).collect()
}

/// A number in [0, 1): the low bits of a Weyl sequence are even enough to place things by.
fn unit(i: u32, k: u32) -> f64 {
    (f64::from(i) * [0.618_033_988, 0.754_877_666, 0.569_840_291, 0.819_172_513][k as usize]).fract()
}

/// Ground, and `n_shapes` less one that stand on it.
fn town(n_shapes: u32) -> Vec<Shape> {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(DVec2::from_array);
    let ground = GroundPolygon::new(corners.map(|corner| corner * 400.0).to_vec(), 0.0).unwrap();
    let standing = (1..n_shapes).map(|i| {
        let size = DVec3::new(3.0 + 9.0 * unit(i, 2), 3.0 + 9.0 * unit(i, 3), 2.0 + 10.0 * unit(i, 2));
        let place = DVec3::new(unit(i, 0) - 0.5, unit(i, 1) - 0.5, 0.0) * 400.0;
        match i % 3 {
            0 => Shape::Cylinder(Cylinder::new(place, 0.5 * size.x, size.z).unwrap()),
            1 => {
                let middle = place + DVec3::Z * size.z * 0.5;
                Shape::Box(OrientedBox::new(middle, size, f64::from(i)).unwrap())
            }
            _ => {
                let outline = corners.map(|corner| place.truncate() + corner * size.truncate() * 0.5);
                Shape::Footprint(ExtrudedFootprint::new(outline.to_vec(), 0.0, size.z).unwrap())
            }
        }
    });
    std::iter::once(Shape::Ground(ground)).chain(standing).collect()
}

/// A rolling sheet of 250 x 250 cells.
fn model() -> Vec<Shape> {
    let n = 251_u32;
    let point = |i: u32| {
        let (x, y) = (f64::from(i % n), f64::from(i / n));
        DVec3::new(x - 125.0, y - 125.0, 4.0 * (x * 0.11).sin() * (y * 0.07).cos())
    };
    let cells = (0..n - 1).flat_map(|row| (0..n - 1).map(move |column| row * n + column));
    let triangles = cells.flat_map(|i| [[i, i + 1, i + n + 1], [i, i + n + 1, i + n]]);
    vec![Shape::Model(TriangleMesh::new((0..n * n).map(point).collect(), triangles.collect()).unwrap())]
}

fn benchmark(criterion: &mut Criterion) {
    let camera = Camera::pinhole(DVec3::new(-150.0, -190.0, 40.0), DVec3::ZERO, 0.8, SIZE_PX).unwrap();
    let all = rays(&camera);
    for (name, shapes) in [("3 shapes", town(3)), ("1000 shapes", town(1000)), ("125000 triangles", model())]
    {
        let surfaces = Surfaces::new(shapes.clone());
        let alone: Vec<Surfaces> = shapes.into_iter().map(|shape| Surfaces::new(vec![shape])).collect();
        let try_all = |ray: &Ray| {
            let hits = alone.iter().filter_map(|surfaces| surfaces.hit(ray, 0.0));
            hits.map(|hit| hit.distance_m).min_by(f64::total_cmp)
        };
        for ray in all.iter().step_by(97) {
            assert_eq!(surfaces.hit(ray, 0.0).map(|hit| hit.distance_m), try_all(ray));
        }
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        group.throughput(Throughput::Elements(all.len() as u64));
        group.bench_function("surfaces", |bencher| {
            bencher.iter(|| black_box(&all).iter().filter(|ray| surfaces.hit(ray, 0.0).is_some()).count());
        });
        if alone.len() > 1 {
            group.bench_function("every shape", |bencher| {
                bencher.iter(|| black_box(&all).iter().filter(|ray| try_all(ray).is_some()).count());
            });
        }
        group.finish();
    }
    let mut group = criterion.benchmark_group("built once");
    group.sample_size(10);
    let (shapes, triangles) = (town(1000), model());
    group.bench_function("1000 shapes", |bencher| bencher.iter(|| Surfaces::new(shapes.clone())));
    group.bench_function("125000 triangles", |bencher| bencher.iter(|| Surfaces::new(triangles.clone())));
    group.finish();
}

criterion_group!(benches, benchmark);
criterion_main!(benches);
