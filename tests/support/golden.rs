//! Compares rendered pictures with goldens and twins, and texts with goldens. Every tolerance of a picture lives in this file.
//!
//! `UPDATE_GOLDEN=<name>` (or `all`) rewrites a golden; a failure leaves the picture and its difference in
//! `target/golden/`. Goldens are drawn by lavapipe, so that every machine can check them.

use std::fs;
use std::path::Path;
use videofields_vision::frame::RgbImage;

/// How far two pictures may lie apart.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Mean absolute difference, 8-bit levels.
    pub mean_levels: f64,
    /// A pixel whose worst channel differs by more than this is off.
    pub off_levels: u8,
    /// Share of pixels that may be off.
    pub off_share: f64,
}

/// A picture of the same rasteriser: versions of its compiler round differently.
pub const GOLDEN: Tolerance = Tolerance { mean_levels: 0.3, off_levels: 6, off_share: 0.002 };

/// A picture of another device than goldens are drawn by: edges lie between pixels elsewhere, and texels are weighed in other steps.
pub const OTHER_DEVICE: Tolerance = Tolerance { mean_levels: 1.0, off_levels: 16, off_share: 0.02 };

/// A shader in 32 bits and 8-bit textures against its f64 twin.
pub const TWIN: Tolerance = Tolerance { mean_levels: 0.7, off_levels: 4, off_share: 0.01 };

/// The same scene at map coordinates and at the origin.
pub const MOVED: Tolerance = Tolerance { mean_levels: 0.05, off_levels: 3, off_share: 0.002 };

/// A camera's own picture drawn from its own place: edges of boxes and of people are drawn between pixels.
pub const OWN_PLACE: Tolerance = Tolerance { mean_levels: 1.0, off_levels: 16, off_share: 0.02 };

/// Points and billboards of the same person, within the outline.
pub const SAME_PERSON: Tolerance = Tolerance { mean_levels: 12.0, off_levels: 60, off_share: 0.1 };

/// Most bytes of a golden file.
const MAX_GOLDEN_BYTES: usize = 64 * 1024;

/// Says how two pictures differ beyond `tolerance`, leaving out pixels that `counts` denies.
///
/// # Errors
/// When they differ, in words.
pub fn compare(
    actual: &RgbImage,
    expected: &RgbImage,
    tolerance: Tolerance,
    counts: impl Fn(usize) -> bool,
) -> Result<(), String> {
    let (width, height) = (expected.width, expected.height);
    if (actual.width, actual.height) != (width, height) {
        return Err(format!("{} x {}, expected {width} x {height}", actual.width, actual.height));
    }
    let (mut sum, mut n_off, mut n_compared, mut worst) = (0_u64, 0_u32, 0_u32, (0, 0));
    for (idx, (a, e)) in actual.data.chunks_exact(3).zip(expected.data.chunks_exact(3)).enumerate() {
        if !counts(idx) {
            continue;
        }
        let differences = [0, 1, 2].map(|channel| a[channel].abs_diff(e[channel]));
        sum += differences.iter().map(|difference| u64::from(*difference)).sum::<u64>();
        let most = differences.into_iter().max().unwrap_or(0);
        n_off += u32::from(most > tolerance.off_levels);
        n_compared += 1;
        if most > worst.0 {
            worst = (most, idx);
        }
    }
    if n_compared == 0 {
        return Err("no pixel was compared".to_owned());
    }
    let mean = sum as f64 / (3.0 * f64::from(n_compared));
    let off = f64::from(n_off) / f64::from(n_compared);
    if mean <= tolerance.mean_levels && off <= tolerance.off_share {
        return Ok(());
    }
    let (x, y) = (worst.1 % width as usize, worst.1 / width as usize);
    Err(format!(
        "mean difference {mean:.3}, {:.3} % of {n_compared} pixels off, worst {} at ({x}, {y}); allowed: {tolerance:?}",
        off * 100.0,
        worst.0
    ))
}

/// Holds a picture to the golden `tests/golden/<name>.png`.
///
/// # Panics
/// When it differs, is missing, or is larger than 64 KiB.
pub fn check(name: &str, actual: &RgbImage) {
    let path = crate::root().join("tests/golden").join(name).with_extension("png");
    if std::env::var("UPDATE_GOLDEN").is_ok_and(|wanted| wanted == name || wanted == "all") {
        write_png(&path, actual);
        let len = fs::metadata(&path).expect("it was written").len();
        assert!(
            len <= MAX_GOLDEN_BYTES as u64,
            "{name} has {len} bytes, at most {MAX_GOLDEN_BYTES} are kept"
        );
        return;
    }
    let bytes = fs::read(&path).unwrap_or_else(|error| {
        panic!("{}: {error}; UPDATE_GOLDEN={name} makes it", path.display());
    });
    let golden = image::load_from_memory(&bytes).expect("a golden is a picture").to_rgb8();
    let expected = RgbImage { width: golden.width(), height: golden.height(), data: golden.into_raw() };
    let tolerance = if crate::named_adapter().is_some() { OTHER_DEVICE } else { GOLDEN };
    if let Err(difference) = compare(actual, &expected, tolerance, |_| true) {
        let folder = crate::root().join("target/golden");
        write_png(&folder.join(name).with_extension("actual.png"), actual);
        if actual.data.len() == expected.data.len() {
            let far = |(a, e): (&u8, &u8)| a.abs_diff(*e).saturating_mul(8);
            let data = actual.data.iter().zip(&expected.data).map(far).collect();
            write_png(&folder.join(name).with_extension("difference.png"), &RgbImage { data, ..expected });
        }
        panic!("{name}: {difference}; see {}", folder.display());
    }
}

/// Holds a text to the golden `tests/golden/<file>`; `UPDATE_GOLDEN` takes the name without its ending.
///
/// # Panics
/// When it differs or is missing.
pub fn check_text(file: &str, actual: &str) {
    let path = crate::root().join("tests/golden").join(file);
    let name = file.split('.').next().unwrap_or(file);
    if std::env::var("UPDATE_GOLDEN").is_ok_and(|wanted| wanted == name || wanted == "all") {
        fs::write(&path, actual).expect("a golden is written");
        return;
    }
    let expected = fs::read_to_string(&path).unwrap_or_else(|error| {
        panic!("{}: {error}; UPDATE_GOLDEN={name} makes it", path.display());
    });
    if let Some(difference) = first_difference(actual, &expected) {
        panic!("{file}: {difference}; UPDATE_GOLDEN={name} takes it over where it is meant so");
    }
}

/// The first line in which two texts differ.
fn first_difference(actual: &str, expected: &str) -> Option<String> {
    let (mut actual_lines, mut expected_lines) = (actual.lines(), expected.lines());
    for number in 1.. {
        let (is, was) = (actual_lines.next(), expected_lines.next());
        if is != was {
            let told = |line: Option<&str>| line.map_or("the end".to_owned(), |line| format!("{line:?}"));
            return Some(format!("line {number} is {}, was {}", told(is), told(was)));
        }
        if is.is_none() {
            break;
        }
    }
    (actual != expected).then(|| "the ends of lines differ".to_owned())
}

/// Writes a picture, making its folder.
///
/// # Panics
/// When it cannot be written.
pub fn write_png(path: &Path, picture: &RgbImage) {
    fs::create_dir_all(path.parent().expect("a path of a file has a parent")).expect("a folder");
    image::save_buffer(path, &picture.data, picture.width, picture.height, image::ColorType::Rgb8)
        .expect("a picture is written");
}

#[test]
fn a_picture_that_differs_fails() {
    let picture = RgbImage { width: 40, height: 25, data: vec![100; 3000] };
    assert_eq!(compare(&picture, &picture, GOLDEN, |_| true), Ok(()));
    let mut spotted = picture.clone();
    spotted.data[..9].fill(140);
    assert!(compare(&spotted, &picture, GOLDEN, |_| true).expect_err("three spots").contains("worst 40"));
    assert_eq!(compare(&spotted, &picture, GOLDEN, |idx| idx > 2), Ok(()));
    let brighter = RgbImage { data: vec![102; 3000], ..picture.clone() };
    assert!(compare(&brighter, &picture, GOLDEN, |_| true).is_err());
    let narrow = RgbImage { width: 20, height: 50, data: vec![100; 3000] };
    assert!(compare(&narrow, &picture, GOLDEN, |_| true).is_err());
    assert!(compare(&picture, &picture, GOLDEN, |_| false).is_err());
}

#[test]
fn the_first_line_that_differs_is_told() {
    let check = |actual: &str, expected: &str, told: Option<&str>| {
        assert_eq!(first_difference(actual, expected).as_deref(), told);
    };
    check("a\nb\n", "a\nb\n", None);
    check("a\nc\n", "a\nb\n", Some("line 2 is \"c\", was \"b\""));
    check("a\n", "a\nb\n", Some("line 2 is the end, was \"b\""));
    check("a", "a\n", Some("the ends of lines differ"));
}
