//! Fields as a whole, on level ground that cameras look down on.

use super::testing::{facing, grid, looking};
use super::*;
use crate::frame::{Mask, RgbImage};
use crate::mesh::{Mesh, Raster};
use glam::{DVec3, Vec3};

/// Nine by nine metres of ground.
fn ground() -> (Mesh, Topology) {
    let (positions, triangles) = grid(9, 0.0, |_, _| 0.0);
    let topology = Topology::of(&positions, &triangles);
    (Mesh::new(positions, triangles), topology)
}

fn plain(_: f64, _: f64) -> Vec3 {
    Vec3::new(0.2, 0.4, 0.3)
}

fn field(mesh: &Mesh, topology: &Topology, views: &mut [View], settings: &FieldSettings) -> Field {
    let field = Field::new(mesh, topology, views, settings).unwrap();
    for weights in [field.by_normals(), field.target(mesh, views, DVec3::new(4.0, -5.0, 8.0))] {
        for vertex in 0..mesh.positions_m.len() as u32 {
            let sum: f32 = weights.of(vertex).iter().sum();
            assert!(weights.of(vertex).iter().all(|share| (0.0..=1.0 + 1e-6).contains(share)));
            assert!((sum - 1.0).abs() < 1e-5 || sum == 0.0, "{vertex}: {sum}");
        }
    }
    assert!(field.colors().iter().all(|color| color.is_finite()));
    field
}

fn raw() -> FieldSettings {
    FieldSettings { is_evened: false, vote: Some(VoteLevels::default()), ..FieldSettings::default() }
}

#[test]
fn without_seams_whoever_looks_as_the_viewer_does_lends_most() {
    let (mesh, topology) = ground();
    let eyes = [DVec3::new(-6.0, 4.0, 9.0), DVec3::new(4.0, 4.0, 12.0), DVec3::new(14.0, 4.0, 9.0)];
    let mut views: Vec<View> =
        eyes.iter().map(|eye| looking(*eye, DVec3::new(4.0, 4.001, 0.0), plain)).collect();
    let preference = Preference::Directions { exponent: 5.0 };
    let field = field(&mesh, &topology, &mut views, &FieldSettings { preference, ..raw() });
    assert!(field.seams().iter().all(|seams| seams.sum() == 0), "{:?}", field.seams());
    assert!((0..81).all(|vertex| (0..3).all(|view| field.ramp(vertex, view) == 1.0)));
    for (nearest, eye) in eyes.iter().enumerate() {
        let target = field.target(&mesh, &views, *eye * 1.1);
        for vertex in 0..81 {
            let row = target.of(vertex);
            assert!((0..3).all(|view| view == nearest || row[view] < row[nearest]), "{vertex}: {row:?}");
        }
    }
}

#[test]
fn whoever_sees_a_place_finely_lends_more_unless_depths_are_wrong() {
    let (mesh, topology) = ground();
    // One from near and aside, one from far away right behind the viewer.
    let aim = DVec3::new(4.0, 4.001, 0.0);
    let mut views = vec![
        looking(DVec3::new(-2.0, 4.0, 7.0), aim, plain),
        looking(DVec3::new(4.0, 4.0, 40.0), aim, plain),
    ];
    let mut near_of = |depth_m: f64| {
        let preference = Preference::Errors { depth_m: Some(depth_m), exponent: 4.0 };
        let field = field(&mesh, &topology, &mut views, &FieldSettings { preference, ..raw() });
        field.target(&mesh, &views, DVec3::new(4.0, 4.0, 20.0)).of(40)[0]
    };
    assert!(near_of(0.0) > 0.95 && near_of(5.0) < 0.05, "{} {}", near_of(0.0), near_of(5.0));
    assert!(near_of(0.2) > near_of(0.4));
}

#[test]
fn towards_its_seams_a_camera_lends_less() {
    let (mesh, topology) = ground();
    // One that sees all, and one that sees the left of it alone.
    let seen = |x: u32| u8::from(x < 120) * 255;
    let mut views = vec![facing(12.0, plain), facing(12.0, plain)];
    let mask = Mask {
        width: 240,
        height: 240,
        data: (0..240 * 240).map(|i| seen(i % 240)).collect::<Vec<u8>>().into(),
    };
    let picture = views[0].picture().clone();
    views[1] = View::new(views[0].camera().clone(), picture, Some(mask));
    let field = field(&mesh, &topology, &mut views, &FieldSettings { reach_m: Some(3.0), ..raw() });
    let is_left = |vertex: u32| mesh.positions_m[vertex as usize].x < 4.0;
    let n_left = (0..81).filter(|vertex| is_left(*vertex)).count();
    let n_seen = (0..81).filter(|vertex| field.sight(*vertex, 1) == Sight::Seen).count();
    assert!(n_seen >= n_left && field.seams()[1].n_beside > 0 && field.seams()[0].sum() == 0);
    let target = field.target(&mesh, &views, DVec3::new(4.0, 4.0, 20.0));
    let row = |x: u32| target.of(4 * 9 + x)[1];
    assert!(row(0) > row(1) && row(1) > row(2) && row(2) > row(3), "{:?}", [0, 1, 2, 3].map(row));
    assert!((4..9).all(|x| row(x) < 1e-6), "{:?}", [4, 5, 6].map(row));
    // As sharp as it is without smoothing, it ends at the seam itself.
    let sharp = FieldSettings { reach_m: Some(3.0), smoothing_rounds: 0, ..raw() };
    let sharp = Field::new(&mesh, &topology, &mut views, &sharp).unwrap().target(
        &mesh,
        &views,
        DVec3::new(4.0, 4.0, 20.0),
    );
    let step = |of: &Weights| (1..9).map(|x| (of.of(36 + x)[1] - of.of(35 + x)[1]).abs()).fold(0.0, f32::max);
    assert!(
        sharp.of(4 * 9 + 3)[1] < 1e-6 && step(&target) < step(&sharp),
        "{} {}",
        step(&target),
        step(&sharp)
    );
}

#[test]
fn what_is_spread_changes_as_much_and_less_sharply() {
    let (mesh, topology) = ground();
    // All see everything, one darker; one more sees the left of it alone, brighter.
    let mask = Mask {
        width: 240,
        height: 240,
        data: (0..240 * 240).map(|i| u8::from(i % 240 < 120) * 255).collect::<Vec<u8>>().into(),
    };
    let bright = facing(12.0, |_, _| Vec3::splat(0.5));
    let mut views = vec![
        facing(12.0, |_, _| Vec3::splat(0.2)),
        View::new(bright.camera().clone(), bright.picture().clone(), Some(mask)),
    ];
    let camera = views[0].camera().clone();
    let raster = Raster::of(&mesh, &camera, [240, 240]);
    let mut steps = |smoothing_rounds| {
        let settings = FieldSettings { smoothing_rounds, vote: None, distances: Distances::Off, ..raw() };
        let field = field(&mesh, &topology, &mut views, &settings);
        let target = field.target(&mesh, &views, DVec3::new(4.0, 4.0, 20.0));
        shade((&mesh, &raster), &camera, (&field, &views, &target), Blend::Mixed).steps
    };
    let (sharp, smooth) = (steps(0), steps(10));
    let of = |of: Steps| (of.energy().unwrap(), of.sharpness().unwrap());
    let ((sharp_energy, sharp_by), (smooth_energy, smooth_by)) = (of(sharp), of(smooth));
    // Half-way up at one end of the ground already, since it is spread over as much as there is.
    assert!((0.7..1.02).contains(&(smooth_energy / sharp_energy)), "{smooth_energy} {sharp_energy}");
    assert!(smooth_by < 0.75 * sharp_by, "{smooth_by} {sharp_by}");
    assert_eq!(sharp.plus(smooth).n_pairs, 2 * sharp.n_pairs);
    assert_eq!((Steps::default().energy(), Steps::default().sharpness()), (None, None));
}

#[test]
fn depths_are_wrong_by_pixels_unless_somebody_says_better() {
    let (mesh, topology) = ground();
    let depth_m = |height_m: f64, depth_m: Option<f64>| {
        let preference = Preference::Errors { depth_m, exponent: 4.0 };
        let mut views = [facing(height_m, plain), facing(2.0 * height_m, plain)];
        field(&mesh, &topology, &mut views, &FieldSettings { preference, ..raw() }).depth_m()
    };
    // Pixels of the nearer one, right below it 12 / 110 m wide, and half a mean edge where they are small.
    let pixel_m = 12.0 / 110.0;
    assert!((DEPTH_PX * pixel_m..1.6 * DEPTH_PX * pixel_m).contains(&depth_m(12.0, None)));
    assert_eq!(depth_m(12.0, Some(0.25)), 0.25);
    let edge_m = topology.mean_length_m();
    assert!(depth_m(0.05, None) >= 0.5 * edge_m);
}

#[test]
fn everything_seam_falls_back_to_normals_and_nothing_is_lost() {
    let (mesh, topology) = ground();
    // Every other row of vertices is hidden, so that every triangle is a seam.
    let one = facing(12.0, plain);
    let at = |vertex: usize| one.project(mesh.positions_m[vertex]).unwrap().0.y * 240.0;
    let mut data = vec![0_u8; 240 * 240];
    for y in (0..9_usize).step_by(2).map(|row| at(row * 9) as usize) {
        data[y.saturating_sub(3) * 240..(y + 3).min(240) * 240].fill(255);
    }
    let mask = Mask { width: 240, height: 240, data: data.into() };
    let mut views = vec![View::new(one.camera().clone(), one.picture().clone(), Some(mask))];
    let field = field(&mesh, &topology, &mut views, &raw());
    assert_eq!(field.seams()[0].sum(), topology.n_faces());
    let target = field.target(&mesh, &views, DVec3::new(4.0, 4.0, 20.0));
    assert_eq!(target, field.by_normals());
    assert_eq!((0..81).filter(|vertex| target.of(*vertex)[0] == 1.0).count(), 45);
    // What nobody sees has the colour of what is beside it.
    assert!(field.colors().iter().all(|color| (*color - plain(0.0, 0.0)).abs().max_element() < 0.02));
}

#[test]
fn what_no_view_sees_is_filled_and_far_pieces_stay_plain() {
    let (mut mesh, _) = ground();
    let first = mesh.positions_m.len() as u32;
    // A piece that hangs together with nothing and faces away from all cameras.
    mesh.positions_m.extend([
        DVec3::new(1.0, 1.0, -3.0),
        DVec3::new(1.0, 2.0, -3.0),
        DVec3::new(2.0, 1.0, -3.0),
    ]);
    mesh.normals.extend([Vec3::NEG_Z; 3]);
    mesh.triangles.push([first, first + 1, first + 2]);
    let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
    let mut views = vec![facing(12.0, plain), facing(11.0, plain)];
    let field = field(&mesh, &topology, &mut views, &raw());
    let target = field.target(&mesh, &views, DVec3::new(4.0, 4.0, 20.0));
    for vertex in first..first + 3 {
        assert_eq!((target.of(vertex), field.sight(vertex, 0)), ([0.0; 2].as_slice(), Sight::Hidden));
        assert_eq!(field.colors()[vertex as usize], crate::mesh::UNSEEN);
    }
    // A viewer that looks against every camera still sees colours.
    let below = field.target(&mesh, &views, DVec3::new(4.0, 4.0, -20.0));
    assert!((0..81).all(|vertex| (below.of(vertex).iter().sum::<f32>() - 1.0).abs() < 1e-5));
}

#[test]
fn a_board_before_the_ground_hides_it_from_all_but_one() {
    let (positions, triangles) = grid(9, 0.0, |_, _| 0.0);
    let (mut positions, mut triangles) = (positions, triangles);
    let first = positions.len() as u32;
    let board = [(2.5, 2.5), (5.5, 2.5), (5.5, 5.5), (2.5, 5.5)];
    positions.extend(board.map(|(x, y)| DVec3::new(x, y, 6.0)));
    triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    let topology = Topology::of(&positions, &triangles);
    let mesh = Mesh::new(positions, triangles);
    let slanted = looking(DVec3::new(-9.0, 4.0, 2.5), DVec3::new(4.0, 4.001, 0.0), plain);
    for visibility in [Visibility::Depths, Visibility::Dilated, Visibility::Rays] {
        let mut views = vec![facing(12.0, plain), facing(13.0, plain), slanted.clone()];
        let field = field(&mesh, &topology, &mut views, &FieldSettings { visibility, vote: None, ..raw() });
        let middle = 4 * 9 + 4;
        let sights = [0, 1, 2].map(|view| field.sight(middle, view));
        assert_eq!(sights, [Sight::Hidden, Sight::Hidden, Sight::Seen], "{visibility:?}");
        assert!((field.target(&mesh, &views, DVec3::new(4.0, 4.0, 3.0)).of(middle)[2] - 1.0).abs() < 1e-6);
        assert!(field.seams()[0].n_hidden > 0);
        // Beside the board's shadow all is seen.
        assert_eq!([0, 1, 2].map(|view| field.sight(0, view)), [Sight::Seen; 3], "{visibility:?}");
    }
    let mut views = vec![facing(12.0, plain)];
    let field =
        field(&mesh, &topology, &mut views, &FieldSettings { visibility: Visibility::Facing, ..raw() });
    assert_eq!(field.sight(4 * 9 + 4, 0), Sight::Seen);
}

#[test]
fn votes_of_one_two_and_three_views() {
    let (mesh, topology) = ground();
    let other = |_: f64, _: f64| Vec3::new(0.7, 0.1, 0.1);
    let sights_of = |views: &mut [View]| {
        let field = field(&mesh, &topology, views, &raw());
        (0..views.len()).map(|view| field.sight(40, view)).collect::<Vec<Sight>>()
    };
    assert_eq!(sights_of(&mut [facing(12.0, other)]), [Sight::Seen]);
    assert_eq!(sights_of(&mut [facing(12.0, plain), facing(11.0, plain)]), [Sight::Seen; 2]);
    // Of two that disagree neither is believed more: both still lend by normals.
    let mut two = [facing(12.0, plain), facing(11.0, other)];
    assert_eq!(sights_of(&mut two), [Sight::Outvoted; 2]);
    let field = Field::new(&mesh, &topology, &mut two, &raw()).unwrap();
    assert!(field.by_normals().of(40).iter().all(|share| *share > 0.4));
    let mut three = [facing(12.0, plain), facing(11.0, other), facing(13.0, plain)];
    assert_eq!(sights_of(&mut three), [Sight::Seen, Sight::Outvoted, Sight::Seen]);
    let quiet = FieldSettings { vote: None, ..raw() };
    assert_eq!(Field::new(&mesh, &topology, &mut three, &quiet).unwrap().sight(40, 1), Sight::Seen);
}

#[test]
fn textures_of_any_size_and_exposure_agree() {
    let (mesh, topology) = ground();
    let pattern = |x: f64, y: f64| {
        Vec3::new(0.25 + 0.1 * (x * 1.1).sin() as f32, 0.3 + 0.1 * (y * 0.9).cos() as f32, 0.3)
    };
    let dark = |x: f64, y: f64| pattern(x, y) * Vec3::new(0.4, 0.45, 0.6);
    let half = |view: &View| View::new(view.camera().clone(), view.picture().halved().halved(), None);
    let mut views = [facing(12.0, pattern), facing(11.0, dark), half(&facing(13.0, pattern))];
    // In levels whose texels are smaller than the ground is in the pictures.
    let raw = FieldSettings { vote: Some(VoteLevels { finest: 1, coarsest: 3 }), ..raw() };
    let uneven = field(&mesh, &topology, &mut views, &raw);
    assert_eq!(uneven.sight(40, 1), Sight::Outvoted);
    let field = field(&mesh, &topology, &mut views, &FieldSettings { is_evened: true, ..raw });
    assert!((0..81).all(|vertex| (0..3).all(|view| field.sight(vertex, view) == Sight::Seen)));
    let gains = views.each_ref().map(|view| view.gain);
    assert!(
        (gains[1] / gains[0] - Vec3::new(2.5, 1.0 / 0.45, 1.0 / 0.6)).abs().max_element() < 0.06,
        "{gains:?}"
    );
}

#[test]
fn from_one_to_sixty_four_views_and_no_more() {
    let (mesh, topology) = ground();
    for count in [1_usize, 64] {
        let mut views: Vec<View> = (0..count)
            .map(|i| {
                let (sine, cosine) = (i as f64 * 0.1).sin_cos();
                looking(
                    DVec3::new(4.0 + 9.0 * cosine, 4.0 + 9.0 * sine, 9.0),
                    DVec3::new(4.0, 4.0, 0.0),
                    plain,
                )
            })
            .collect();
        let field = field(&mesh, &topology, &mut views, &raw());
        assert!((0..81).all(|vertex| (0..count).all(|view| field.sight(vertex, view) == Sight::Seen)));
    }
    let wrong = |count: usize| {
        Field::new(&mesh, &topology, &mut vec![facing(9.0, plain); count], &raw()).unwrap_err()
    };
    assert_eq!((wrong(0), wrong(65)), (FieldError::Views { count: 0 }, FieldError::Views { count: 65 }));
    let empty = Field::new(&Mesh::default(), &Topology::of(&[], &[]), &mut [facing(9.0, plain)], &raw());
    assert_eq!(empty.unwrap_err(), FieldError::Empty);
}

#[test]
fn junctions_shared_edges_doubles_and_needles_leave_everything_finite() {
    let (mesh, _) = ground();
    let (mut positions, mut triangles) = (mesh.positions_m, mesh.triangles);
    // A T-junction: a point in the middle of an edge that the triangle on its other side does not name.
    let n = positions.len() as u32;
    positions.push(DVec3::new(8.0, 3.5, 0.0));
    positions.push(DVec3::new(9.0, 3.5, 0.0));
    triangles.extend([[3 * 9 + 8, n + 1, n], [n, n + 1, 4 * 9 + 8]]);
    // A third face at an edge, a needle, a triangle twice over the same points, one without an area.
    positions.push(DVec3::new(4.5, 4.0, 1.0));
    positions.push(DVec3::new(4.0, 3.0, 0.0));
    positions.push(DVec3::new(-7.0, 4.0, 1e-9));
    triangles.extend([[40, 41, n + 2], [n + 3, 41, 40], [0, 9, n + 4], [36, 37, 38]]);
    let topology = Topology::of(&positions, &triangles);
    let mesh = Mesh::new(positions, triangles);
    let mut views =
        vec![facing(12.0, plain), looking(DVec3::new(-6.0, 4.0, 9.0), DVec3::new(4.0, 4.0, 0.0), plain)];
    for distances in Distances::ALL {
        let field = field(&mesh, &topology, &mut views, &FieldSettings { distances, ..raw() });
        assert!(
            (0..mesh.positions_m.len() as u32)
                .all(|vertex| (0..2).all(|view| (0.0..=1.0).contains(&field.ramp(vertex, view))))
        );
    }
}

#[test]
fn a_picture_from_a_cameras_own_place_is_that_cameras() {
    let (mesh, topology) = ground();
    let pattern = |x: f64, y: f64| {
        Vec3::new(0.3 + 0.2 * (x * 2.0).sin() as f32, 0.4 + 0.2 * (y * 1.7).cos() as f32, 0.3)
    };
    let mut views =
        vec![facing(12.0, pattern), looking(DVec3::new(-6.0, 4.0, 9.0), DVec3::new(4.0, 4.0, 0.0), pattern)];
    let field = field(&mesh, &topology, &mut views, &raw());
    let camera = views[0].camera().clone();
    let raster = Raster::of(&mesh, &camera, [240, 240]);
    let target = field.target(&mesh, &views, views[0].eye());
    let far_off = |shaded: &Shaded, reference: &RgbImage| {
        let all = shaded.picture.data.iter().zip(&reference.data).enumerate();
        all.filter(|(i, _)| shaded.covered.data[i / 3] > 0).map(|(_, (a, b))| a.abs_diff(*b)).max().unwrap()
    };
    for (blend, most) in [(Blend::Best, 1), (Blend::Mixed, 12), (Blend::Filtered { error_m: 0.0 }, 12)] {
        let shaded = shade((&mesh, &raster), &camera, (&field, &views, &target), blend);
        let n_covered = shaded.covered.data.iter().filter(|value| **value > 0).count();
        assert!(
            n_covered > 5000 && shaded.owners.data.iter().all(|owner| [0, NO_VIEW].contains(owner)),
            "{n_covered}"
        );
        assert!(
            far_off(&shaded, views[0].picture()) <= most,
            "{blend:?}: {}",
            far_off(&shaded, views[0].picture())
        );
    }
    // What is filtered for wrong depths is smoother.
    let coarse = shade(
        (&mesh, &raster),
        &camera,
        (&field, &views, &field.by_normals()),
        Blend::Filtered { error_m: 2.0 },
    );
    assert!(far_off(&coarse, views[0].picture()) > 4);
}
