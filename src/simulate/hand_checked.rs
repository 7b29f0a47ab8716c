//! Truths that were worked out by hand, found again in pictures: texels, depths, shadows' edges, lamps, mirrors, time.
//!
//! Tests alone. The worlds are small and their numbers such that a line of arithmetic gives the answer.

#[cfg(test)]
mod tests {
    use super::super::effects::{
        CameraShake, CastShadows, Casters, Draw, EffectKind, Effects, LightSwitching, MotionBlur,
        RollingShutter, WetGround,
    };
    use super::super::light::{Lamp, Light};
    use super::super::shape::{Part, Shape};
    use super::super::solids::{SolidId, Solids};
    use super::super::{CastOptions, Layers, Shot, Terrain, Truth, World};
    use glam::{DVec2, DVec3};
    use videofields_vision::geometry::{Camera, GroundPolygon, SurfaceId, Surfaces};

    fn options(samples_per_side: u32) -> CastOptions<'static> {
        CastOptions { layers: Layers::ALL, ..CastOptions::new(samples_per_side) }
    }

    fn view(camera: &Camera, time_secs: f64) -> Shot<'_> {
        Shot { camera, device: None, time_secs }
    }

    fn block(low: [f64; 3], high: [f64; 3], color: f64) -> Part {
        let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
        let shape = Shape::block((low + high) * 0.5, [DVec3::X, DVec3::Y, DVec3::Z], (high - low) * 0.5);
        Part { shape, color: DVec3::splat(color) }
    }

    /// A meadow of 100 m x 100 m around the origin with these posts, without effects and actors.
    fn world(posts: Vec<Part>) -> World {
        let corners = [[-50.0, -50.0], [50.0, -50.0], [50.0, 50.0], [-50.0, 50.0]].map(DVec2::from_array);
        let ground = GroundPolygon::new(corners.to_vec(), 0.0).unwrap();
        let surfaces = Surfaces::of_ground_and_boxes(vec![ground], Vec::new());
        let mut world = World::plaza();
        world.actors.clear();
        world.effects = Effects::default();
        world.ground_paints.rotate_left(1);
        world.solids = Solids::with_shapes(surfaces, None, posts, Vec::new());
        world
    }

    /// 200 x 100 pixels, 100 pixels of focal length.
    fn looking(eye: [f64; 3], target: [f64; 3]) -> Camera {
        let fov_y = 2.0 * 0.5_f64.atan();
        Camera::pinhole(DVec3::from_array(eye), DVec3::from_array(target), fov_y, (200, 100)).unwrap()
    }

    fn luminance(truth: &Truth, x: usize, y: usize) -> f64 {
        let width = truth.rgb.width as usize;
        truth.linear.as_ref().unwrap()[y * width + x].iter().map(|value| f64::from(*value)).sum()
    }

    #[test]
    fn a_known_point_lies_at_its_texel_and_at_its_depth() {
        // A wall 10 m ahead from 1 m to 3 m to the right, 3 m high, seen from 2 m: its left edge lies 1/10 of the focal
        // length right of the middle, its top as far above.
        let camera = looking([0.0, 0.0, 2.0], [0.0, 10.0, 2.0]);
        let truth = world(vec![block([1.0, 10.0, 0.0], [3.0, 11.0, 3.0], 0.5)])
            .cast(&view(&camera, 0.0), &options(1))
            .unwrap();
        let depth = |x: usize, y: usize| f64::from(truth.depth_m[y * 200 + x]);
        let normal = |x: usize, y: usize| truth.normals.as_ref().unwrap()[y * 200 + x];
        for (x, y, is_wall) in [
            (110, 40, true),
            (129, 69, true),
            (109, 40, false),
            (110, 39, false),
            (130, 45, false),
            (109, 60, false),
        ] {
            let is_near = (depth(x, y) - 10.0).abs() < 1e-6;
            assert_eq!(is_near, is_wall, "({x}, {y}): {}", depth(x, y));
            assert_eq!(normal(x, y) == [0.0, -1.0, 0.0], is_wall);
        }
        // The ground below the middle of row 80 lies where 30.5 pixels down have grown to 2 m.
        assert!((depth(50, 80) - 2.0 * 100.0 / 30.5).abs() < 1e-5);
        assert_eq!(normal(50, 80), [0.0, 0.0, 1.0]);
        // Level with the eye there is nothing below the horizon.
        assert_eq!((depth(50, 49), normal(50, 49)), (0.0, [0.0; 3]));
    }

    #[test]
    fn a_shadow_ends_where_the_sun_s_height_says() {
        for altitude_deg in [25.0_f64, 45.0, 70.0] {
            let altitude = altitude_deg.to_radians();
            let mut lit = world(vec![block([-1.0, -5.0, 0.0], [1.0, 5.0, 4.0], 0.5)]);
            lit.light.to_sun = DVec3::new(-altitude.cos(), 0.0, altitude.sin());
            let mut shaded = lit.clone();
            shaded.effects.cast_shadows = Some(CastShadows::STILL);
            // From 50 m above; east is right, 2 pixels a metre. A row through the wall's middle.
            let camera = looking([8.0, 0.0, 50.0], [8.0, 0.0, 0.0]);
            let [lit, shaded] =
                [lit, shaded].map(|world| world.cast(&view(&camera, 0.0), &options(16)).unwrap());
            let share = |x: usize| luminance(&shaded, x, 50) / luminance(&lit, x, 50);
            // Just east of the wall, whose foot lies at 86, all is dark; far east nothing is.
            let (dark, bright) = (share(88), share(190));
            assert!(dark < 0.6 && bright > 0.999_999, "{dark} {bright}");
            let width_px: f64 = (88..190).map(|x| (1.0 - share(x)) / (1.0 - dark)).sum();
            let end_m = 8.0 + (88.0 + width_px - 100.0) / 2.0;
            let expected_m = 1.0 + 4.0 / altitude.tan();
            assert!(
                (end_m - expected_m).abs() < 0.05,
                "{altitude_deg} degrees: {end_m} m, not {expected_m} m"
            );
        }
    }

    #[test]
    fn a_wide_sun_s_shadow_has_a_soft_edge_about_the_hard_one() {
        let mut soft = world(vec![block([-1.0, -5.0, 0.0], [1.0, 5.0, 4.0], 0.5)]);
        soft.light.to_sun = DVec3::new(-1.0, 0.0, 1.0).normalize();
        soft.effects.cast_shadows = Some(CastShadows { casters: Casters::Still, sun_diameter_deg: 10.0 });
        let mut hard = soft.clone();
        hard.effects.cast_shadows = Some(CastShadows::STILL);
        let camera = looking([5.0, 0.0, 12.5], [5.0, 0.0, 0.0]);
        let [soft, hard] = [soft, hard].map(|world| world.cast(&view(&camera, 0.0), &options(8)).unwrap());
        let share = |x: usize| luminance(&soft, x, 50) / luminance(&hard, x, 50);
        // The hard edge lies at 5 m, column 100, 8 pixels a metre. The disc's edges stand 40 and 50 degrees high: the
        // shadow is dark until 1 + 4 / tan 50 = 4.36 m and gone from 1 + 4 / tan 40 = 5.77 m on.
        assert!((share(92) - 1.0).abs() < 1e-6 && (share(109) - 1.0).abs() < 1e-6);
        assert!(share(98) > 1.1 && share(102) < 0.95, "{} {}", share(98), share(102));
    }

    #[test]
    fn a_lamp_s_light_falls_off_as_its_distance_squared() {
        let mut lit = world(Vec::new());
        lit.light = Light { sun: DVec3::ZERO, sky: DVec3::ZERO, bounce: DVec3::ZERO, ..lit.light };
        let mut even = lit.clone();
        even.light.sky = DVec3::ONE;
        lit.light.lamps =
            vec![Lamp { place: DVec3::new(0.0, 0.0, 3.0), color: DVec3::splat(9.0), spot: None }];
        let camera = looking([0.0, 0.0, 20.0], [0.0, 0.0, 0.0]);
        let [lit_truth, even_truth] =
            [&lit, &even].map(|world| world.cast(&view(&camera, 0.0), &options(1)).unwrap());
        let mut n_checked = 0;
        for x in (0..200).step_by(7) {
            for y in (0..100).step_by(9) {
                let place = (DVec2::new(x as f64, y as f64) + 0.5 - DVec2::new(100.0, 50.0)) / 5.0;
                let squared = place.length_squared() + 9.0;
                // 9 times the colour, by the slope 3 / distance.
                let expected = 9.0 / squared * 3.0 / squared.sqrt();
                let found = luminance(&lit_truth, x, y) / luminance(&even_truth, x, y);
                assert!((found / expected - 1.0).abs() < 1e-4, "{place}: {found}, not {expected}");
                n_checked += 1;
            }
        }
        assert!(n_checked > 300);
        // Below a shelf that hides the lamp nothing is lit, where lamps cast shadows.
        let shelf = block([3.0, -9.0, 1.5], [4.0, 9.0, 1.6], 0.5);
        lit.solids = Solids::with_shapes(lit.solids.surfaces().clone(), None, vec![shelf], Vec::new());
        let under = |world: &World| {
            let camera = looking([7.0, 0.0, 0.8], [7.0, 0.5, 0.0]);
            luminance(&world.cast(&view(&camera, 0.0), &options(1)).unwrap(), 100, 50)
        };
        let open = under(&lit);
        lit.effects.cast_shadows = Some(CastShadows::STILL);
        assert!(open > 1e-3 && under(&lit) == 0.0);
    }

    #[test]
    fn a_mirrored_wall_ends_where_the_law_of_reflection_says() {
        // A wall 20 m ahead, 3 m high, from 1 m to 3 m to the right, seen from 2 m over a flooded meadow: its top is
        // mirrored where the ray to 3 m below the ground's place of it enters the water, 8 m ahead, 25 pixels down.
        let camera = looking([0.0, 0.0, 2.0], [0.0, 10.0, 2.0]);
        let seen = |color: f64| {
            let mut world = world(vec![block([1.0, 20.0, 0.0], [3.0, 21.0, 3.0], color)]);
            world.effects.wet_ground =
                Some(WetGround { coverage: 1.0, roughness: 0.0, ..WetGround::default() });
            world.cast(&view(&camera, 0.0), &options(1)).unwrap()
        };
        let (dark, bright) = (seen(0.1), seen(0.9));
        for y in 0..100 {
            for x in 0..200 {
                let is_wall = (105..115).contains(&x) && (45..60).contains(&y);
                let is_mirrored = (105..115).contains(&x) && (60..75).contains(&y);
                let differs = luminance(&dark, x, y) != luminance(&bright, x, y);
                assert_eq!(differs, is_wall || is_mirrored, "({x}, {y})");
            }
        }
        // Water mirrors little: 25 pixels down, at 14 degrees, about a third.
        let (wall, mirror) =
            [(110, 50), (110, 73)].map(|(x, y)| luminance(&bright, x, y) - luminance(&dark, x, y)).into();
        assert!((0.2..0.4).contains(&(mirror / wall)), "{}", mirror / wall);
    }

    #[test]
    fn the_shadow_mask_is_where_shadows_of_actors_fall() {
        let mut all = World::plaza();
        all.effects.cast_shadows = Some(CastShadows { casters: Casters::All, sun_diameter_deg: 0.0 });
        let still = World::plaza();
        let mut n_shaded = 0;
        for (id, camera) in still.cameras((160, 90)).unwrap() {
            let shot = Shot { camera: &camera, device: Some(id), time_secs: 8.0 };
            let [all, still] = [&all, &still].map(|world| world.cast(&shot, &options(1)).unwrap());
            assert!(still.shadow.as_ref().unwrap().data.iter().all(|value| *value == 0));
            let mask = all.shadow.as_ref().unwrap();
            for i in 0..160 * 90 {
                let is_darker = all.linear.as_ref().unwrap()[i] != still.linear.as_ref().unwrap()[i];
                let is_still = all.instance.data[i] == 0;
                assert_eq!(mask.data[i] == 255, is_still && is_darker, "{id}, pixel {i}");
                n_shaded += usize::from(mask.data[i] == 255);
            }
            assert_eq!(all.instance, still.instance);
            assert_eq!(all.depth_m, still.depth_m);
        }
        assert!(n_shaded > 20, "{n_shaded} pixels lie in figures' shadows");
    }

    #[test]
    fn a_rolling_shutter_reads_every_row_at_its_time() {
        let mut world = World::plaza();
        world.effects.rolling_shutter = Some(RollingShutter { readout_secs: 0.65 });
        // As many rows as a picture has instants: every row is one of them.
        let (id, camera) = world.cameras((116, 65)).unwrap().remove(1);
        let rolled =
            world.cast(&Shot { camera: &camera, device: Some(id), time_secs: 8.0 }, &options(1)).unwrap();
        let steady = world.render(&camera, 8.0, 1).unwrap();
        assert_ne!(rolled.instance, steady.instance);
        for y in 0..65_u32 {
            let time_secs = 8.0 + 0.01 * (f64::from(y) - 32.0);
            let at_time = world.render(&camera, time_secs, 1).unwrap();
            assert_eq!(rolled.instance.row(y), at_time.instance.row(y), "row {y}");
        }
        // A view takes no time.
        assert_eq!(World::plaza().render(&camera, 8.0, 1).unwrap(), steady);
    }

    #[test]
    fn motion_blur_is_the_mean_over_its_time() {
        let mut world = World::plaza();
        world.effects.motion_blur = Some(MotionBlur { open_secs: 0.3 });
        let (id, camera) = world.cameras((64, 36)).unwrap().remove(1);
        let shot = |time_secs| Shot { camera: &camera, device: Some(id), time_secs };
        let blurred = world.cast(&shot(8.0), &options(8)).unwrap();
        let times = (0..30).map(|k| 8.0 + 0.01 * (f64::from(k) - 14.5));
        let steady: Vec<Truth> =
            times.map(|time| world.cast(&view(&camera, time), &options(8)).unwrap()).collect();
        let (mut n_moving, mut error) = (0, 0.0);
        for y in 0..36 {
            for x in 0..64 {
                let shown: Vec<f64> = steady.iter().map(|truth| luminance(truth, x, y)).collect();
                let mean = shown.iter().sum::<f64>() / 30.0;
                let found = luminance(&blurred, x, y);
                if shown.iter().all(|value| *value == shown[0]) {
                    assert!((found - shown[0]).abs() < 1e-6, "({x}, {y}) stands still");
                } else {
                    n_moving += 1;
                    error += (found - mean).abs();
                }
            }
        }
        assert!(n_moving > 25 && error / f64::from(n_moving) < 0.04, "{error} over {n_moving} pixels");
        // Truth is that of the capture instant.
        assert_eq!(blurred.instance, world.render(&camera, 8.0, 1).unwrap().instance);
    }

    #[test]
    fn a_shaken_camera_sees_what_a_camera_of_its_pose_sees() {
        let mut world = World::plaza();
        let shake = CameraShake { angle_deg: 2.0, shift_m: 0.2, ..CameraShake::default() };
        world.effects.camera_shake = Some(shake);
        let (id, camera) = world.cameras((96, 54)).unwrap().remove(2);
        let shaken =
            world.cast(&Shot { camera: &camera, device: Some(id), time_secs: 3.0 }, &options(1)).unwrap();
        let draw = Draw::of_camera(world.effects.seed, id);
        let pose = shake.pose(camera.pose(), draw, 3.0, &world.entries().tally());
        let moved =
            Camera::new(camera.size_px(), camera.focal_px(), camera.center_px(), *camera.distortion(), pose)
                .unwrap();
        assert_eq!(shaken, world.cast(&view(&moved, 3.0), &options(1)).unwrap());
        assert_ne!(shaken, world.cast(&view(&camera, 3.0), &options(1)).unwrap());
    }

    #[test]
    fn a_power_cut_leaves_its_share_of_all_light() {
        let mut world = World::plaza();
        let (_, camera) = world.cameras((96, 54)).unwrap().remove(0);
        let lit = world.cast(&view(&camera, 8.0), &options(2)).unwrap();
        let switching =
            LightSwitching { period_secs: 10.0, on_share: 0.5, off_gain: 0.25, ..LightSwitching::default() };
        world.effects.light_switching = Some(switching);
        let cut = world.cast(&view(&camera, 8.0), &options(2)).unwrap();
        for (lit, cut) in lit.linear.unwrap().iter().flatten().zip(cut.linear.unwrap().iter().flatten()) {
            assert!((cut - lit * 0.25).abs() < 1e-6, "{cut} of {lit}");
        }
        assert_eq!(lit.instance, cut.instance);
    }

    /// The plaza with a tree, a hill, a lamp and every effect of its scene.
    fn busy_plaza() -> World {
        let mut world = World::plaza();
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let leaves = DVec3::new(0.05, 0.12, 0.03);
        let crown = |x: f64, z: f64| {
            let shape = Shape::ellipsoid(DVec3::new(x, -5.0, z), axes, DVec3::new(1.6, 1.5, 1.1));
            Part { shape, color: leaves }
        };
        let heights = (0..8 * 8).map(|i| 0.05 + 0.2 * f64::from(i * 5 % 7)).collect();
        let hill = Terrain::new(DVec2::new(6.0, -12.0), 1.0, 8, heights).unwrap();
        let trunk = block([-3.1, -5.1, 0.0], [-2.9, -4.9, 3.0], 0.1);
        let surfaces = world.solids.surfaces().clone();
        world.solids =
            Solids::with_shapes(surfaces, Some(hill), vec![trunk], vec![crown(-3.0, 3.6), crown(-2.2, 4.2)]);
        world.terrain_paint = Some(world.ground_paints[1].clone());
        world.light.lamps =
            vec![Lamp { place: DVec3::new(-4.0, 3.0, 4.0), color: DVec3::splat(3.0), spot: None }];
        for kind in EffectKind::ALL.into_iter().take(8) {
            world.effects = world.effects.clone().with(kind);
        }
        world.effects.cast_shadows = Some(CastShadows { casters: Casters::All, sun_diameter_deg: 2.0 });
        world
    }

    #[test]
    fn the_number_of_threads_changes_no_bit() {
        let world = busy_plaza();
        let (id, camera) = world.cameras((80, 45)).unwrap().remove(0);
        let shot = Shot { camera: &camera, device: Some(id), time_secs: 8.0 };
        let cast = |n_threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| world.cast(&shot, &options(2)).unwrap())
        };
        let alone = cast(1);
        for n_threads in [2, 3, 5] {
            assert_eq!(cast(n_threads), alone, "{n_threads} threads");
        }
    }

    #[test]
    fn what_is_cast_over_a_plate_is_what_is_cast() {
        let blurred = Effects {
            motion_blur: Some(MotionBlur::default()),
            rolling_shutter: Some(RollingShutter::default()),
            ..World::plaza().effects().clone()
        };
        let mut moving = World::plaza();
        moving.effects = blurred;
        for (world, lasts) in [(World::plaza(), true), (moving, true), (busy_plaza(), false)] {
            assert_eq!(world.plates_last_for_cameras(), lasts);
            for (id, camera) in world.cameras((64, 36)).unwrap() {
                let plate = world.plate_with(&camera, &options(2)).unwrap();
                for time_secs in [0.0, 8.0, 17.3] {
                    let cast = world
                        .cast(&Shot { camera: &camera, device: Some(id), time_secs }, &options(2))
                        .unwrap();
                    assert_eq!(
                        world.cast_over(&plate, Some(id), time_secs).unwrap(),
                        cast,
                        "{id} at {time_secs}"
                    );
                }
            }
        }
    }

    #[test]
    fn effects_that_are_not_named_are_not_entered() {
        let world = World::plaza();
        let (id, camera) = world.cameras((32, 18)).unwrap().remove(0);
        world.cast(&Shot { camera: &camera, device: Some(id), time_secs: 8.0 }, &options(2)).unwrap();
        for kind in EffectKind::ALL {
            let is_entered = world.entries().count(kind) > 0;
            assert_eq!(is_entered, kind == EffectKind::CastShadows, "{}", kind.id());
        }
        let busy = busy_plaza();
        busy.cast(&Shot { camera: &camera, device: Some(id), time_secs: 8.0 }, &options(2)).unwrap();
        for kind in EffectKind::ALL {
            assert_eq!(busy.entries().count(kind) > 0, busy.effects().names(kind), "{}", kind.id());
        }
    }

    #[test]
    fn progress_is_told_once_a_row() {
        let world = World::plaza();
        let (_, camera) = world.cameras((32, 18)).unwrap().remove(0);
        let told = std::sync::Mutex::new(Vec::new());
        let progress = |done: usize, total: usize| told.lock().unwrap().push((done, total));
        let options = CastOptions { progress: Some(&progress), ..CastOptions::new(1) };
        world.cast(&view(&camera, 0.0), &options).unwrap();
        let mut told = told.into_inner().unwrap();
        told.sort_unstable();
        assert_eq!(told, (1..=18).map(|done| (done, 18)).collect::<Vec<_>>());
    }

    #[test]
    fn a_camera_s_picture_is_shared_among_what_it_shows() {
        let world = busy_plaza();
        let camera = looking([0.0, -14.0, 4.0], [0.0, 2.0, 1.0]);
        let visible = world.visible(&camera);
        let n_sky =
            world.plate(&camera, 1).unwrap().truth().depth_m.iter().filter(|depth| **depth == 0.0).count();
        let n_seen: u64 = visible.iter().map(|share| share.n_pixels).sum();
        assert_eq!(n_seen + n_sky as u64, 200 * 100);
        for solid in [
            SolidId::Surface(SurfaceId::Ground(0)),
            SolidId::Surface(SurfaceId::Box(0)),
            SolidId::Terrain,
            SolidId::Post(0),
            SolidId::Crown(0),
        ] {
            assert!(
                visible.iter().any(|share| share.solid == solid && share.n_pixels > 5),
                "{solid:?}: {visible:?}"
            );
        }
    }
}
