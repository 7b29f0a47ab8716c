//! Distances along surfaces: exact and bounded on the processor, bounded on the device, by triangle count.
//!
//! The device has all vertices of one row as sources and goes as many rounds as fields do; what it finds is read back.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use glam::DVec3;
use videofields_render::SurfaceDistances;
use videofields_render::gpu::Gpu;
use videofields_vision::fields::{ROUNDS, Topology, bounded, exact};
use videofields_vision::mesh::Mesh;

/// Hills of `n` vertices each way, a metre apart.
fn hills(n: u32) -> Mesh {
    let place = |idx: u32| {
        let (x, y) = (f64::from(idx % n), f64::from(idx / n));
        DVec3::new(x, y, 2.0 * (0.5 * x).sin() * (0.4 * y).cos())
    };
    let corners = (0..(n - 1) * (n - 1)).flat_map(|cell| {
        let at = cell / (n - 1) * n + cell % (n - 1);
        [[at, at + 1, at + n], [at + 1, at + n + 1, at + n]]
    });
    Mesh::new((0..n * n).map(place).collect(), corners.collect())
}

fn distances(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("distances");
    group.sample_size(10);
    let Ok(gpu) = Gpu::new("") else { return };
    let mut finder = SurfaceDistances::new(&gpu).expect("the shaders");
    for n in [64, 128, 256] {
        let mesh = hills(n);
        let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
        let sources: Vec<u32> = (0..n).map(|column| n / 2 * n + column).collect();
        let reach_m = 5.0 * topology.mean_length_m();
        let n_triangles = mesh.triangles.len();
        group.bench_function(BenchmarkId::new("exact", n_triangles), |bencher| {
            bencher.iter(|| exact(&topology, &mesh.positions_m, &sources, reach_m));
        });
        group.bench_function(BenchmarkId::new("bounded", n_triangles), |bencher| {
            bencher.iter(|| bounded(&topology, &mesh.positions_m, &sources, ROUNDS));
        });
        let lists = [sources.clone()];
        group.bench_function(BenchmarkId::new("device", n_triangles), |bencher| {
            bencher.iter(|| finder.of(&gpu, &mesh, &lists, ROUNDS).expect("distances"));
        });
    }
    group.finish();
}

criterion_group!(benches, distances);
criterion_main!(benches);
