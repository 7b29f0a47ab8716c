//! The simulate room seen from outside.

use std::path::Path;
use videofields::simulate::World;

#[test]
fn look() {
    let world = World::plaza();
    let out = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/pictures");
    std::fs::create_dir_all(&out).unwrap();
    let mut cameras = world.cameras((640, 360)).unwrap();
    use glam::DVec3;
    cameras.push((
        "view-a",
        videofields::simulate::pinhole(
            DVec3::new(0.0, -16.0, 4.0),
            DVec3::new(0.0, 2.0, 1.0),
            0.8,
            (640, 360),
        )
        .unwrap(),
    ));
    cameras.push((
        "view-b",
        videofields::simulate::pinhole(
            DVec3::new(-6.0, -6.0, 1.8),
            DVec3::new(0.0, 0.0, 1.2),
            0.9,
            (640, 360),
        )
        .unwrap(),
    ));
    for (id, camera) in cameras {
        let start = std::time::Instant::now();
        let plate = world.plate(&camera, 3).unwrap();
        let cast = start.elapsed();
        for t in [0.0, 8.0] {
            let truth = world.render_over(&plate, t).unwrap();
            image::save_buffer(
                out.join(format!("{id}-{t}.png")),
                &truth.rgb.data,
                truth.rgb.width,
                truth.rgb.height,
                image::ColorType::Rgb8,
            )
            .unwrap();
        }
        eprintln!("{id}: plate {cast:?}, then {:?}", start.elapsed() - cast);
    }
}

#[test]
fn demo() {
    let out = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/demo-clips");
    let start = std::time::Instant::now();
    let mut options = videofields::simulate::SimulateOptions::new(out);
    options.truth_every_frames = 24;
    options.database = "../../target/demo/videofields.sqlite".into();
    let written = videofields::simulate::write(&World::plaza(), &options).unwrap();
    eprintln!("{written:?} {:?}", start.elapsed());
}

#[test]
fn stats() {
    let world = World::plaza();
    let cameras = world.cameras((640, 360)).unwrap();
    let plates: Vec<_> = cameras.iter().map(|(id, c)| (*id, world.plate(c, 1).unwrap())).collect();
    let mut seen = [[0; 3]; 3];
    let mut biggest = [[0; 3]; 3];
    let mut closest = f64::INFINITY;
    let mut walked = [0.0; 3];
    for i in 0..240 {
        let t = i as f64 * 0.1;
        let f = world.figures(t).unwrap();
        let g = world.figures(t + 0.1).unwrap();
        for a in 0..3 {
            walked[a] += (g[a].foot_in_world - f[a].foot_in_world).length();
            for b in 0..a {
                let d = (f[a].foot_in_world - f[b].foot_in_world).length();
                if d < closest {
                    closest = d;
                    eprintln!("{a} {b} {t} {d}");
                }
            }
        }
        for (c, (_, plate)) in plates.iter().enumerate() {
            let truth = world.render_over(plate, t).unwrap();
            for k in 0..3 {
                let n = truth.instance.data.iter().filter(|v| **v == k as u8 + 1).count();
                if n > 60 {
                    seen[c][k] += 1;
                }
                biggest[c][k] = biggest[c][k].max(n);
            }
        }
    }
    eprintln!("seen {seen:?} biggest {biggest:?} speeds {:?}", walked.map(|w| w / 24.0));
}
