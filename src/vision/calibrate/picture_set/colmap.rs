//! COLMAP's models: the cameras and images of a reconstruction, as text or binary; points are passed over.
//!
//! `cameras`: id, model, columns, rows and the model's parameters. `images`: id, quaternion w x y z and translation with
//! p = R X + t (x right, y down, z forward), the camera's id, the picture's path; then its points. Pixel centres are at +0.5, as here.
//! The world is the reconstruction's own, up to scale; its axes are kept.
//!
//! COLMAP 3.9, "Output Format" (<https://colmap.github.io/format.html>), models as in `src/colmap/sensor/models.h`.

use super::numbers::numbers;
use super::{CalibrateError, Found, PictureCamera, pose_in_world, refuse_doubles, shown};
use crate::error::Fault;
use crate::geometry::{Camera, Distortion, Pose};
use glam::{DQuat, DVec2, DVec3};
use std::collections::BTreeMap;

/// Most bytes of a file of points: what has more is no set of pictures that is looked at here.
const MAX_MODEL_BYTES: usize = 1 << 30;

/// COLMAP's models by their numbers in binary files, with how many parameters each has.
const MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EQUIRECTANGULAR", 2),
    ("UNKNOWN", 0),
];

/// The lens of a camera, before it has a place.
struct Lens {
    size_px: (u32, u32),
    focal_px: DVec2,
    center_px: DVec2,
    distortion: Distortion,
}

/// One picture.
struct Image {
    place: String,
    name: String,
    camera: u32,
    /// w x y z.
    rotation: [f64; 4],
    translation: DVec3,
}

/// The cameras of all pictures of a COLMAP model: `cameras` and `images` are the bytes of `cameras.txt` and `images.txt`, or of both
/// `.bin`. Pictures are named by their paths as COLMAP has them.
///
/// # Errors
/// When a file breaks off or is of neither form, a lens is none of ours (then it is named), a picture names no camera, there is none,
/// one twice, or too many, or numbers are no camera. Places are lines of text, or bytes.
pub fn import_colmap(
    cameras: &[u8],
    images: &[u8],
    metres_per_unit: f64,
) -> Result<Vec<PictureCamera>, CalibrateError> {
    if let Some(length) = [cameras.len(), images.len()].into_iter().find(|length| *length > MAX_MODEL_BYTES) {
        return Err(CalibrateError::TooLong { length });
    }
    if !(1e-9..=1e9).contains(&metres_per_unit) {
        return Err(CalibrateError::invalid("metres_per_unit", "must lie in 1e-9 to 1e9"));
    }
    let lenses =
        if is_binary(cameras) { binary_cameras(cameras)? } else { text_cameras(text(cameras, "cameras")?)? };
    let images =
        if is_binary(images) { binary_images(images)? } else { text_images(text(images, "images")?)? };
    let mut found = Vec::with_capacity(images.len());
    for Image { place, name, camera, rotation: [w, x, y, z], translation } in images {
        let (of, lens) = lenses.get(&camera).ok_or_else(|| {
            CalibrateError::invalid(&place, format!("there is no camera {camera} among the cameras"))
        })?;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        if !(rotation.is_finite() && rotation.length() > 1e-6 && translation.is_finite()) {
            return Err(CalibrateError::invalid(
                &place,
                "expected a rotation and a translation of finite numbers",
            ));
        }
        let lens = lens.as_ref().map_err(|model| {
            let names: Vec<&str> = OURS.iter().map(|ours| MODELS[*ours].0).collect();
            let message = format!("lens model {model} is not supported, only {}", names.join(", "));
            CalibrateError::Unsupported(Fault::new(of, message))
        })?;
        let Pose { position_in_world, world_from_local } = pose_in_world(rotation.normalize(), translation);
        let pose = Pose { position_in_world: position_in_world * metres_per_unit, world_from_local };
        let camera = Camera::new(lens.size_px, lens.focal_px, lens.center_px, lens.distortion, pose)
            .map_err(|error| CalibrateError::no_camera(of, &error))?;
        found.push(Found { place, name, camera });
    }
    if found.is_empty() {
        return Err(CalibrateError::invalid("images", "there is no picture"));
    }
    refuse_doubles(&found)?;
    Ok(found.into_iter().map(|Found { name, camera, .. }| PictureCamera { name, camera }).collect())
}

/// Binary files begin with a count of 8 bytes, whose upper ones are 0.
fn is_binary(bytes: &[u8]) -> bool {
    bytes.iter().take(8).any(|byte| *byte == 0)
}

fn text<'a>(bytes: &'a [u8], file: &str) -> Result<&'a str, CalibrateError> {
    std::str::from_utf8(bytes).map_err(|error| {
        let place = format!("{file}, byte {}", error.valid_up_to());
        CalibrateError::invalid(place, "is neither COLMAP's text (UTF-8) nor its binary form")
    })
}

/// Numbers of the models that are cases of our lenses.
const OURS: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 8, 9];

/// Cameras by their ids, with their places; of lenses that are not ours the model's name.
type Lenses = BTreeMap<u32, (String, Result<Lens, String>)>;

fn lens(
    (model, parameters): (usize, &[f64]),
    [width, height]: [u64; 2],
    place: &str,
) -> Result<Result<Lens, String>, CalibrateError> {
    let side = |side: u64| {
        u32::try_from(side).ok().filter(|side| (1..=65_536).contains(side)).ok_or_else(|| {
            CalibrateError::invalid(place, format!("columns and rows must be 1 to 65536, got {side}"))
        })
    };
    let size_px = (side(width)?, side(height)?);
    let p = parameters;
    let brown = |k: [f64; 8]| Distortion::BrownConrady { coefficients: k };
    let fisheye = |k: [f64; 4]| Distortion::Fisheye { coefficients: k };
    // One focal length or two; what follows the principal point.
    let (n_focal, distortion) = match (MODELS[model].0, p) {
        ("SIMPLE_PINHOLE", _) => (1, Distortion::None),
        ("PINHOLE", _) => (2, Distortion::None),
        ("SIMPLE_RADIAL", [.., k]) => (1, brown([*k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
        ("RADIAL", [.., k1, k2]) => (1, brown([*k1, *k2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
        ("OPENCV", [.., k1, k2, p1, p2]) => (2, brown([*k1, *k2, *p1, *p2, 0.0, 0.0, 0.0, 0.0])),
        ("FULL_OPENCV", [_, _, _, _, k @ ..]) => {
            let mut all = [0.0; 8];
            all.copy_from_slice(k);
            (2, brown(all))
        }
        ("OPENCV_FISHEYE", [.., k1, k2, k3, k4]) => (2, fisheye([*k1, *k2, *k3, *k4])),
        ("SIMPLE_RADIAL_FISHEYE", [.., k]) => (1, fisheye([*k, 0.0, 0.0, 0.0])),
        ("RADIAL_FISHEYE", [.., k1, k2]) => (1, fisheye([*k1, *k2, 0.0, 0.0])),
        (name, _) => return Ok(Err(name.to_owned())),
    };
    let focal_px = if n_focal == 1 { DVec2::splat(p[0]) } else { DVec2::new(p[0], p[1]) };
    let center_px = DVec2::new(p[n_focal], p[n_focal + 1]);
    Ok(Ok(Lens { size_px, focal_px, center_px, distortion }))
}

fn add(
    lenses: &mut Lenses,
    id: u32,
    place: String,
    lens: Result<Lens, String>,
) -> Result<(), CalibrateError> {
    if let Some((first, _)) = lenses.get(&id) {
        return Err(CalibrateError::invalid(place, format!("camera {id} is at {first} already")));
    }
    lenses.insert(id, (place, lens));
    Ok(())
}

/// Lines with their places, but for comments.
fn lines<'a>(text: &'a str, file: &'static str) -> impl Iterator<Item = (String, &'a str)> {
    let lines = text.lines().enumerate();
    lines
        .map(move |(idx, line)| (format!("{file}, line {}", idx + 1), line.trim()))
        .filter(|(_, line)| !line.starts_with('#'))
}

fn whole<T: std::str::FromStr>(word: Option<&str>, what: &str, place: &str) -> Result<T, CalibrateError> {
    let word = word.unwrap_or_default();
    word.parse()
        .ok()
        .ok_or_else(|| CalibrateError::invalid(place, format!("expected {what}, got {:?}", shown(word))))
}

fn text_cameras(text: &str) -> Result<Lenses, CalibrateError> {
    let mut lenses = Lenses::new();
    for (place, line) in lines(text, "cameras").filter(|(_, line)| !line.is_empty()) {
        let mut words = line.split_whitespace();
        let id = whole(words.next(), "a camera's id", &place)?;
        let name = words.next().unwrap_or_default();
        let size = [whole(words.next(), "columns", &place)?, whole(words.next(), "rows", &place)?];
        let lens = match MODELS.iter().position(|(of, _)| *of == name) {
            None => Err(shown(name)),
            Some(model) => {
                let rest = words.collect::<Vec<_>>().join(" ");
                let parameters = of_model(&rest, model, &place)?;
                lens((model, &parameters), size, &place)?
            }
        };
        add(&mut lenses, id, place, lens)?;
    }
    Ok(lenses)
}

/// As many finite numbers as a model has.
fn of_model(text: &str, model: usize, place: &str) -> Result<Vec<f64>, CalibrateError> {
    let (name, count) = MODELS[model];
    let words: Vec<&str> = text.split_whitespace().collect();
    if words.len() != count {
        let message = format!("{name} has {count} parameters, got {}", words.len());
        return Err(CalibrateError::invalid(place, message));
    }
    words.iter().map(|word| numbers::<1>(word, place).map(|[number]| number)).collect()
}

fn text_images(text: &str) -> Result<Vec<Image>, CalibrateError> {
    // Lines come in pairs: a picture, and its points, which may be none.
    let mut images = Vec::new();
    let mut rest = lines(text, "images");
    while let Some((place, line)) = rest.next() {
        if line.is_empty() {
            continue;
        }
        let mut words = line.splitn(10, char::is_whitespace);
        let _id: u32 = whole(words.next(), "a picture's id", &place)?;
        let pose: Vec<&str> = words.by_ref().take(7).collect();
        let [w, x, y, z, tx, ty, tz] = numbers(&pose.join(" "), &place)?;
        let camera = whole(words.next(), "a camera's id", &place)?;
        let name = words.next().unwrap_or_default().trim().to_owned();
        if name.is_empty() {
            return Err(CalibrateError::invalid(place, "expected the picture's path as the tenth word"));
        }
        images.push(Image {
            place,
            name,
            camera,
            rotation: [w, x, y, z],
            translation: DVec3::new(tx, ty, tz),
        });
        rest.next();
    }
    Ok(images)
}

/// A binary file that is being read.
struct Bytes<'a> {
    file: &'static str,
    all: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    fn place(&self) -> String {
        format!("{}, byte {}", self.file, self.at)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], CalibrateError> {
        let found = self.at.checked_add(count).and_then(|end| self.all.get(self.at..end));
        let found = found.ok_or_else(|| {
            let message = format!("the file breaks off: expected {count} more bytes");
            CalibrateError::invalid(self.place(), message)
        })?;
        self.at += count;
        Ok(found)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], CalibrateError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    fn u32(&mut self) -> Result<u32, CalibrateError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Result<u64, CalibrateError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn f64(&mut self) -> Result<f64, CalibrateError> {
        let place = self.place();
        let number = f64::from_le_bytes(self.array()?);
        if number.is_finite() {
            return Ok(number);
        }
        Err(CalibrateError::invalid(place, format!("expected a finite number, got {number}")))
    }
}

fn binary_cameras(bytes: &[u8]) -> Result<Lenses, CalibrateError> {
    let mut bytes = Bytes { file: "cameras", all: bytes, at: 0 };
    let mut lenses = Lenses::new();
    for _ in 0..bytes.u64()? {
        let place = bytes.place();
        let (id, model) = (bytes.u32()?, bytes.u32()? as usize);
        let size = [bytes.u64()?, bytes.u64()?];
        // How long an unknown one is nobody can tell, so nothing behind it can be read.
        let Some((_, count)) = MODELS.get(model).filter(|(name, _)| *name != "UNKNOWN") else {
            let message = format!("lens model number {model} is not known");
            return Err(CalibrateError::Unsupported(Fault::new(place, message)));
        };
        let parameters = (0..*count).map(|_| bytes.f64()).collect::<Result<Vec<_>, _>>()?;
        let lens = lens((model, &parameters), size, &place)?;
        add(&mut lenses, id, place, lens)?;
    }
    Ok(lenses)
}

/// Bytes of a point of a picture: where it is, and which point of the world.
const POINT_BYTES: usize = 8 + 8 + 8;

fn binary_images(bytes: &[u8]) -> Result<Vec<Image>, CalibrateError> {
    let mut bytes = Bytes { file: "images", all: bytes, at: 0 };
    let mut images = Vec::new();
    for _ in 0..bytes.u64()? {
        let place = bytes.place();
        bytes.u32()?;
        let rotation = [bytes.f64()?, bytes.f64()?, bytes.f64()?, bytes.f64()?];
        let translation = DVec3::new(bytes.f64()?, bytes.f64()?, bytes.f64()?);
        let camera = bytes.u32()?;
        let rest = &bytes.all[bytes.at..];
        let length = rest.iter().position(|byte| *byte == 0);
        let length =
            length.ok_or_else(|| CalibrateError::invalid(bytes.place(), "the file breaks off in a path"))?;
        let name = std::str::from_utf8(bytes.take(length)?);
        let name = name
            .map_err(|_not_utf8| CalibrateError::invalid(&place, "the picture's path is not UTF-8"))?
            .to_owned();
        bytes.take(1)?;
        let n_points = usize::try_from(bytes.u64()?).unwrap_or(usize::MAX);
        bytes.take(n_points.saturating_mul(POINT_BYTES))?;
        images.push(Image { place, name, camera, rotation, translation });
    }
    Ok(images)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    const CAMERAS: &str = "# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
1 SIMPLE_PINHOLE 640 480 500 320 240
2 PINHOLE 640 480 500 510 320 240
3 SIMPLE_RADIAL 640 480 500 320 240 -0.1
4 RADIAL 640 480 500 320 240 -0.1 0.01
5 OPENCV 640 480 500 510 320 240 -0.1 0.01 0.001 -0.002
6 OPENCV_FISHEYE 640 480 300 310 320 240 0.01 -0.002 0.0001 0
7 FULL_OPENCV 640 480 500 510 320 240 -0.1 0.01 0.001 -0.002 0.003 0.01 0 0
9 SIMPLE_RADIAL_FISHEYE 640 480 300 320 240 0.01
10 RADIAL_FISHEYE 640 480 300 320 240 0.01 -0.002
";

    /// One picture a camera; the second has points and a blank in its name, the first's line of points is empty.
    fn images() -> String {
        let rows = [1, 2, 3, 4, 5, 6, 7, 9, 10].map(|camera| {
            let points = if camera == 2 { "10.5 20.5 7 30 40 -1" } else { "" };
            format!("{camera} 0.5 -0.5 0.5 -0.5 0.1 0.2 {camera} {camera} seen/p {camera}.jpg\n{points}\n")
        });
        format!("# Image list\n{}", rows.concat())
    }

    /// The same as COLMAP writes it in binary.
    fn binary() -> (Vec<u8>, Vec<u8>) {
        let (mut cameras, mut images_bytes) = (9_u64.to_le_bytes().to_vec(), 9_u64.to_le_bytes().to_vec());
        for line in CAMERAS.lines().filter(|line| !line.starts_with('#')) {
            let words: Vec<&str> = line.split(' ').collect();
            cameras.extend(words[0].parse::<u32>().unwrap().to_le_bytes());
            let model = MODELS.iter().position(|(name, _)| *name == words[1]).unwrap() as u32;
            cameras.extend(model.to_le_bytes());
            words[2..4].iter().for_each(|side| cameras.extend(side.parse::<u64>().unwrap().to_le_bytes()));
            words[4..].iter().for_each(|of| cameras.extend(of.parse::<f64>().unwrap().to_le_bytes()));
        }
        let text = images();
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        while let Some(line) = lines.next() {
            let words: Vec<&str> = line.splitn(10, ' ').collect();
            images_bytes.extend(words[0].parse::<u32>().unwrap().to_le_bytes());
            words[1..8].iter().for_each(|of| images_bytes.extend(of.parse::<f64>().unwrap().to_le_bytes()));
            images_bytes.extend(words[8].parse::<u32>().unwrap().to_le_bytes());
            images_bytes.extend(words[9].as_bytes());
            images_bytes.push(0);
            let points: Vec<&str> = lines.next().unwrap().split_whitespace().collect();
            images_bytes.extend((points.len() as u64 / 3).to_le_bytes());
            for point in points.chunks(3) {
                point[..2]
                    .iter()
                    .for_each(|of| images_bytes.extend(of.parse::<f64>().unwrap().to_le_bytes()));
                images_bytes.extend(point[2].parse::<i64>().unwrap().to_le_bytes());
            }
        }
        (cameras, images_bytes)
    }

    #[test]
    fn every_lens_of_ours_shows_places_where_colmaps_formulas_do() {
        let cameras = import_colmap(CAMERAS.as_bytes(), images().as_bytes(), 1.0).expect("a model");
        assert_eq!(cameras.len(), 9);
        for PictureCamera { name, camera } in &cameras {
            let id: f64 = name.trim_start_matches("seen/p ").trim_end_matches(".jpg").parse().unwrap();
            let rotation = DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5);
            let local = DVec3::new(0.3, -0.2, 2.0);
            let place = rotation.inverse() * (local - DVec3::new(0.1, 0.2, id));
            // [COLMAP] models.h, ImgFromCam: u, v, then distortion, then focal length and principal point.
            let (u, v) = (local.x / local.z, local.y / local.z);
            let r2 = u * u + v * v;
            let r = r2.sqrt();
            let theta = r.atan();
            let bent = |k: [f64; 4]| {
                let t2 = theta * theta;
                let scale = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])))) / r;
                DVec2::new(u * scale, v * scale)
            };
            let radial = |k1: f64, k2: f64| DVec2::new(u, v) * (1.0 + k1 * r2 + k2 * r2 * r2);
            let tangential = |p1: f64, p2: f64| {
                DVec2::new(
                    2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u),
                    2.0 * p2 * u * v + p1 * (r2 + 2.0 * v * v),
                )
            };
            let (focal, shown) = match id as u32 {
                1 => (DVec2::splat(500.0), radial(0.0, 0.0)),
                2 => (DVec2::new(500.0, 510.0), radial(0.0, 0.0)),
                3 => (DVec2::splat(500.0), radial(-0.1, 0.0)),
                4 => (DVec2::splat(500.0), radial(-0.1, 0.01)),
                5 => (DVec2::new(500.0, 510.0), radial(-0.1, 0.01) + tangential(0.001, -0.002)),
                6 => (DVec2::new(300.0, 310.0), bent([0.01, -0.002, 0.0001, 0.0])),
                7 => {
                    let above = 1.0 - 0.1 * r2 + 0.01 * r2 * r2 + 0.003 * r2 * r2 * r2;
                    let scale = above / (1.0 + 0.01 * r2);
                    (DVec2::new(500.0, 510.0), DVec2::new(u, v) * scale + tangential(0.001, -0.002))
                }
                9 => (DVec2::splat(300.0), bent([0.01, 0.0, 0.0, 0.0])),
                _ => (DVec2::splat(300.0), bent([0.01, -0.002, 0.0, 0.0])),
            };
            let expected = focal * shown + DVec2::new(320.0, 240.0);
            let seen = camera.project(place).expect("it is seen");
            let found = seen.texture * DVec2::new(640.0, 480.0);
            assert!((found - expected).length() < 1e-9, "{name}: {found} for {expected}");
            assert!((seen.depth_m - 2.0).abs() < 1e-12);
        }
    }

    #[test]
    fn binary_models_are_those_of_text_and_every_beginning_is_refused() {
        let (cameras, images_bytes) = binary();
        let expected = import_colmap(CAMERAS.as_bytes(), images().as_bytes(), 0.5).expect("a model");
        assert_eq!(import_colmap(&cameras, &images_bytes, 0.5).expect("a model"), expected);
        assert_eq!(import_colmap(&cameras, images().as_bytes(), 0.5).expect("a model"), expected);
        let one = import_colmap(&cameras, &images_bytes, 1.0).expect("a model");
        for (half, whole) in expected.iter().zip(&one) {
            let [half, whole] = [half, whole].map(|of| of.camera.pose().position_in_world);
            assert!((half * 2.0 - whole).length() < 1e-12);
        }
        for end in 8..cameras.len() {
            assert!(import_colmap(&cameras[..end], &images_bytes, 1.0).is_err(), "{end}");
        }
        for end in 8..images_bytes.len() {
            assert!(import_colmap(&cameras, &images_bytes[..end], 1.0).is_err(), "{end}");
        }
        let mut many = images_bytes;
        let at = many.len() - 8;
        many[at..].fill(0xff);
        assert!(import_colmap(&cameras, &many, 1.0).is_err(), "as many points as memory has bytes");
    }

    #[test]
    fn faults_name_their_place_and_lenses_their_names() {
        let check = |cameras: &str, images: &str, kind: ErrorKind, expected: &str| {
            let error = import_colmap(cameras.as_bytes(), images.as_bytes(), 1.0).expect_err("a fault");
            assert_eq!((error.kind(), error.to_string().contains(expected)), (kind, true), "{error}");
        };
        let image = "1 1 0 0 0 0 0 0 1 a.jpg\n\n";
        let of = |model: &str, n: usize| format!("1 {model} 640 480{}\n", " 1".repeat(n));
        check(
            &of("FOV", 5),
            image,
            ErrorKind::Unsupported,
            "cameras, line 1: lens model FOV is not supported",
        );
        check(&of("THIN_PRISM_FISHEYE", 12), image, ErrorKind::Unsupported, "THIN_PRISM_FISHEYE");
        check(
            &of("MIRROR", 3),
            image,
            ErrorKind::Unsupported,
            "lens model MIRROR is not supported, only SIMPLE_PINHOLE",
        );
        check(
            &of("PINHOLE", 3),
            image,
            ErrorKind::Invalid,
            "cameras, line 1: PINHOLE has 4 parameters, got 3",
        );
        check("1 PINHOLE 0 480 1 1 1 1\n", image, ErrorKind::Invalid, "1 to 65536");
        check("x PINHOLE 4 4 1 1 1 1\n", image, ErrorKind::Invalid, "a camera's id");
        let pinhole = "1 SIMPLE_PINHOLE 640 480 500 320 240\n";
        check(
            &format!("{pinhole}{pinhole}"),
            image,
            ErrorKind::Invalid,
            "camera 1 is at cameras, line 1 already",
        );
        check(
            pinhole,
            "1 1 0 0 0 0 0 0 7 a.jpg\n\n",
            ErrorKind::Invalid,
            "images, line 1: there is no camera 7",
        );
        check(pinhole, "1 0 0 0 0 0 0 0 1 a.jpg\n\n", ErrorKind::Invalid, "a rotation");
        check(pinhole, "1 1 0 0 0 0 0\n\n", ErrorKind::Invalid, "images, line 1");
        check(pinhole, "1 1 0 0 0 0 0 0 1\n\n", ErrorKind::Invalid, "the picture's path");
        check(pinhole, "", ErrorKind::Invalid, "there is no picture");
        check(pinhole, &image.repeat(2), ErrorKind::Invalid, "already");
        // A lens that no picture has does not matter.
        let both = format!("{pinhole}2 FOV 640 480 1 1 1 1 1\n");
        assert_eq!(import_colmap(both.as_bytes(), image.as_bytes(), 1.0).expect("a model").len(), 1);
        for unit in [0.0, f64::NAN, 1e10] {
            assert!(import_colmap(pinhole.as_bytes(), image.as_bytes(), unit).is_err());
        }
    }
}
