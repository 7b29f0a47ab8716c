//! Distances along meshes on the device: against the processor's twin, exact distances and known answers.

use super::{renderer, v};
use glam::DVec3;
use videofields_render::SurfaceDistances;
use videofields_vision::fields::{ROUNDS, Topology, bounded, exact};
use videofields_vision::mesh::Mesh;

/// A square of so many vertices each way, a metre apart, moved by up to `uneven` and lifted.
pub(super) fn grid(n: u32, uneven: f64, height_m: impl Fn(f64, f64) -> f64) -> Mesh {
    let wave = |at: u32, salt: f64| uneven * (f64::from(at) * salt).sin();
    let place = |idx: u32| {
        let (x, y) = (f64::from(idx % n) + wave(idx, 12.9898), f64::from(idx / n) + wave(idx, 78.233));
        v(x, y, height_m(x, y))
    };
    let corners = (0..(n - 1) * (n - 1)).flat_map(|cell| {
        let at = cell / (n - 1) * n + cell % (n - 1);
        [[at, at + 1, at + n], [at + 1, at + n + 1, at + n]]
    });
    Mesh::new((0..n * n).map(place).collect(), corners.collect())
}

/// A unit sphere: an octahedron whose triangles are quartered so many times.
pub(super) fn sphere(times: u32) -> Mesh {
    let mut positions = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    let mut triangles =
        vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    for _ in 0..times {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |from: u32, to: u32| {
                *middles.entry([from.min(to), from.max(to)]).or_insert_with(|| {
                    positions.push((positions[from as usize] + positions[to as usize]).normalize());
                    positions.len() as u32 - 1
                })
            };
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    Mesh::new(positions, triangles)
}

/// Greatest and mean error against exact distances in mean edges, of what lies within six; how much too short at most; and the mean and
/// greatest difference to the processor's twin.
fn errors(found: &[f32], mesh: &Mesh, sources: &[u32]) -> [f64; 5] {
    let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
    let edge_m = topology.mean_length_m();
    let exact = exact(&topology, &mesh.positions_m, sources, f64::INFINITY);
    let twin = bounded(&topology, &mesh.positions_m, sources, ROUNDS);
    let near: Vec<usize> = (0..found.len()).filter(|vertex| exact[*vertex] <= 6.0 * edge_m).collect();
    let off = |vertex: &usize| (f64::from(found[*vertex]) - exact[*vertex]) / edge_m;
    let beside = |vertex: &usize| (f64::from(found[*vertex]) - f64::from(twin[*vertex])).abs() / edge_m;
    let n = near.len().max(1) as f64;
    let worst = near.iter().map(off).fold(0.0, f64::max);
    let least = near.iter().map(off).fold(0.0, f64::min);
    let farthest = near.iter().map(beside).fold(0.0, f64::max);
    [worst, near.iter().map(off).sum::<f64>() / n, -least, near.iter().map(beside).sum::<f64>() / n, farthest]
}

#[test]
fn the_device_finds_what_its_twin_finds_for_many_sources_at_once() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let mut finder = SurfaceDistances::new(gpu).expect("the shaders");
    let hills = |x: f64, y: f64| 2.0 * (0.5 * x).sin() * (0.4 * y).cos();
    for (name, mesh, most) in [
        ("plane", grid(41, 0.0, |_, _| 0.0), [1e-3, 1e-4]),
        ("uneven plane", grid(41, 0.3, |_, _| 0.0), [0.02, 0.002]),
        // Two windows a side leave as much of hills out, on the processor too.
        ("hills", grid(41, 0.3, hills), [0.15, 0.005]),
        ("sphere", sphere(4), [0.05, 0.005]),
    ] {
        let n_vertices = mesh.positions_m.len() as u32;
        let lists =
            [vec![n_vertices / 2], vec![5, n_vertices / 3, n_vertices / 3 + 1, n_vertices - 7], vec![]];
        let found = finder.of(gpu, &mesh, &lists, ROUNDS).expect("distances").distances_m;
        for (sources, found) in lists.iter().zip(&found).take(2) {
            let [worst, mean, short, beside, farthest] = errors(found, &mesh, sources);
            assert!(worst <= most[0] && mean <= most[1], "{name}: {worst} {mean}");
            assert!(short < 0.01 && beside < 1e-3, "{name}: {short} too short, {beside} beside the twin");
            assert!(farthest < 0.02, "{name}: {farthest} beside the twin");
        }
        assert!(found[2].iter().all(|at| at.is_infinite()), "{name}: no source");
        let all: Vec<u32> = (0..n_vertices).collect();
        let found = finder.of(gpu, &mesh, &[all], 3).expect("distances").distances_m;
        assert!(found[0].iter().all(|at| *at == 0.0), "{name}: everything a source");
    }
}

#[test]
fn distances_on_a_plane_and_a_sphere_are_those_that_are_known() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let mut finder = SurfaceDistances::new(gpu).expect("the shaders");
    // At map coordinates, as places are relative to the mesh's middle.
    let mut plane = grid(21, 0.0, |_, _| 0.0);
    plane.positions_m.iter_mut().for_each(|at| *at += v(5e5, 5e6, 100.0));
    let source = 10 * 21 + 10;
    let found = finder.of(gpu, &plane, &[vec![source]], ROUNDS).expect("distances").distances_m;
    for (at, found_m) in plane.positions_m.iter().zip(&found[0]) {
        let known_m = at.distance(plane.positions_m[source as usize]);
        if known_m <= 6.0 {
            assert!((f64::from(*found_m) - known_m).abs() < 1e-3, "{at}: {found_m} for {known_m}");
        }
    }
    let sphere = sphere(5);
    let found = finder.of(gpu, &sphere, &[vec![0]], ROUNDS).expect("distances").distances_m;
    for (at, found_m) in sphere.positions_m.iter().zip(&found[0]) {
        let known_m = at.angle_between(sphere.positions_m[0]);
        // Chords of 1/32 of a quarter turn are shorter than their arcs by a 2500th.
        if known_m < 0.25 {
            assert!(
                (f64::from(*found_m) - known_m).abs() < 3e-3 * known_m.max(0.05),
                "{at}: {found_m} for {known_m}"
            );
        }
    }
}

#[test]
fn slivers_sides_of_three_faces_and_nothing_at_all_leave_numbers() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let mut finder = SurfaceDistances::new(gpu).expect("the shaders");
    // A needle among good triangles, thinner and thinner: a sound length by edges remains, never what is no number.
    for thin in [1e-2, 1e-4, 1e-6, 1e-9, 0.0] {
        let positions =
            vec![v(0.0, 0.0, 0.0), v(2.0, 0.0, 0.0), v(1.0, thin, 0.0), v(1.0, 2.0, 0.0), v(1.0, -2.0, 0.0)];
        let triangles = vec![[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 4]];
        let mesh = Mesh::new(positions, triangles);
        let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
        for source in 0..5 {
            let found = finder.of(gpu, &mesh, &[vec![source]], ROUNDS).expect("distances").distances_m;
            let exact = exact(&topology, &mesh.positions_m, &[source], f64::INFINITY);
            for (found, exact) in found[0].iter().zip(&exact) {
                let off = f64::from(*found) - exact;
                assert!(off > -0.01 && !found.is_nan(), "{thin} from {source}: {found} for {exact}");
                assert!(
                    off < 0.05 * (1.0 + exact) || thin < 1e-6,
                    "{thin} from {source}: {found} for {exact}"
                );
            }
        }
    }
    // Three faces at one side, vertices in one place, and one that nothing is of.
    let positions = vec![
        v(0.0, 0.0, 0.0),
        v(1.0, 0.0, 0.0),
        v(0.0, 1.0, 0.0),
        v(0.0, -1.0, 0.0),
        v(0.5, 0.0, 1.0),
        v(0.0, 0.0, 0.0),
        v(9.0, 9.0, 9.0),
    ];
    let mesh = Mesh::new(positions, vec![[0, 1, 2], [1, 0, 3], [0, 1, 4], [5, 2, 4]]);
    let found = finder.of(gpu, &mesh, &[vec![2], vec![6]], ROUNDS).expect("distances").distances_m;
    assert!(found[0][..6].iter().all(|at| at.is_finite()) && found[0][6].is_infinite(), "{found:?}");
    assert!((found[0][0] - 1.0).abs() < 1e-3 && found[0][4] > 1.0, "{found:?}");
    assert_eq!((found[1][6], found[1][0].is_infinite()), (0.0, true));
    let found = finder.of(gpu, &Mesh::default(), &[vec![]], ROUNDS).expect("distances").distances_m;
    assert_eq!(found, vec![Vec::<f32>::new()]);
    let refused = finder.of(gpu, &mesh, &[vec![7]], ROUNDS).unwrap_err();
    assert!(refused.to_string().contains("source 7 of a mesh with 7 vertices"), "{refused}");
}
