//! The accuracy room seen from outside, and what the whole way from clips to a picture is worth by it.
//!
//! Expected figures are scikit-image 0.26's for the same pictures: `structural_similarity(a, b, channel_axis=2,
//! full=True)` and `peak_signal_noise_ratio(a, b)`, masked ones from the map and the squares at the mask's pixels.

mod fields;
mod guard;
mod report;
mod scene;

use glam::DVec3;
use std::sync::Arc;
use videofields_picture::plan::{Colors, Effort, EntityStyle};
use videofields_service::engine::{At, ViewKind, ViewRequest, view_once};
use videofields_simulate::World;
use videofields_vision::clock::{SystemClock, Timestamp};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::geometry::Camera;
use videofields_vision::measures::{AccuracyError, compare};

/// A picture by formula, the same in any language: value = f(x, y, channel) in whole numbers.
fn picture(width: u32, height: u32, value: impl Fn(u32, u32, u32) -> u32) -> RgbImage {
    let mut data = Vec::new();
    for y in 0..height {
        for x in 0..width {
            data.extend((0..3).map(|channel| (value(x, y, channel) % 256) as u8));
        }
    }
    RgbImage { width, height, data }
}

fn waves(x: u32, y: u32, channel: u32) -> u32 {
    (x * x + 3 * y * y + 50 * channel + x * y) / 8
}

fn bent(x: u32, y: u32, channel: u32) -> u32 {
    (waves(x, y, channel) % 256 * 9 + (x * 7 + y * 13 + channel * 31) % 64 * 4) / 10
}

/// Every second band of five columns in the upper 20 of 29 rows.
fn bands() -> Mask {
    let mut mask = Mask::filled(37, 29, 0);
    for (i, value) in mask.data.iter_mut().enumerate() {
        *value = u8::from((i % 37) / 5 % 2 == 0 && i / 37 < 20) * 200;
    }
    mask
}

#[test]
fn figures_agree_with_scikit_image() {
    let check = |a: RgbImage, b: RgbImage, mask: Option<Mask>, expected: (f64, f64, f64, u64)| {
        let found = compare(&a, &b, mask.as_ref()).unwrap();
        let (rmse, psnr_db, ssim, n_pixels) = expected;
        assert!((found.rmse - rmse).abs() < 1e-9, "{found:?}");
        assert!((found.psnr_db.unwrap() - psnr_db).abs() < 1e-9, "{found:?}");
        assert!((found.ssim - ssim).abs() < 1e-9, "{found:?}");
        assert_eq!(found.n_pixels, n_pixels);
    };
    let (a, b) = (|| picture(37, 29, waves), || picture(37, 29, bent));
    check(a(), b(), None, (10.293_049_981_050_086, 27.879_921_976_068_15, 0.945_776_131_149_573_4, 1073));
    check(
        a(),
        b(),
        Some(bands()),
        (10.078_731_732_382_469, 28.062_685_895_619_456, 0.894_023_246_450_284_6, 400),
    );
    // A single window, and pictures that run against each other.
    let rising = picture(7, 7, |x, y, _| x * 30 + y);
    let falling = picture(7, 7, |x, y, _| 200 - x * 20 + y * 3);
    check(
        rising,
        falling,
        None,
        (114.682_169_494_651_6, 6.940_885_606_719_352, -0.800_234_548_974_757_4, 49),
    );
}

#[test]
fn equal_pictures_differ_by_nothing_and_say_so_in_json() {
    for value in [0, 128, 255] {
        let flat = picture(16, 9, |_, _, _| value);
        let found = compare(&flat, &flat, None).unwrap();
        assert_eq!((found.rmse, found.psnr_db, found.n_pixels), (0.0, None, 144));
        assert!((found.ssim - 1.0).abs() < 1e-12);
    }
    let waves = picture(37, 29, waves);
    let found = compare(&waves, &waves, Some(&bands())).unwrap();
    let json: serde_json::Value = serde_json::from_str(&serde_json::to_string(&found).unwrap()).unwrap();
    assert_eq!(json["psnr_db"], serde_json::Value::Null);
    assert_eq!((json["rmse"].as_f64(), json["n_pixels"].as_u64()), (Some(0.0), Some(400)));
    assert!((json["ssim"].as_f64().unwrap() - 1.0).abs() < 1e-12);
}

#[test]
fn black_against_white_is_as_far_as_it_goes() {
    let (black, white) = (picture(9, 9, |_, _, _| 0), picture(9, 9, |_, _, _| 255));
    let found = compare(&black, &white, None).unwrap();
    assert_eq!((found.rmse, found.psnr_db), (255.0, Some(0.0)));
    assert!(found.ssim.abs() < 1e-3);
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let a = || picture(37, 29, waves);
    let check = |b: RgbImage, mask: Option<Mask>, expected: AccuracyError, text: &str| {
        let error = compare(&a(), &b, mask.as_ref()).unwrap_err();
        assert_eq!((&error, error.kind()), (&expected, ErrorKind::Invalid));
        assert_eq!(error.to_string(), text);
    };
    check(
        picture(37, 28, waves),
        None,
        AccuracyError::Size { what: "picture", size: (37, 28), reference: (37, 29) },
        "picture has 37 x 28 pixels, the reference 37 x 29",
    );
    check(
        a(),
        Some(Mask::filled(29, 37, 1)),
        AccuracyError::Size { what: "mask", size: (29, 37), reference: (37, 29) },
        "mask has 29 x 37 pixels, the reference 37 x 29",
    );
    check(
        a(),
        Some(Mask::filled(37, 29, 0)),
        AccuracyError::EmptyMask,
        "the mask selects no pixel: every value is 0",
    );
    let mut short = a();
    short.data.pop();
    let expected = AccuracyError::Length { what: "picture", needed: 3219, available: 3218 };
    check(short, None, expected, "picture needs 3219 bytes for its size, got 3218");
    let small = picture(6, 100, waves);
    assert_eq!(compare(&small, &small, None), Err(AccuracyError::TooSmall { width: 6, height: 100 }));
    let nothing = picture(0, 0, waves);
    assert_eq!(compare(&nothing, &nothing, None), Err(AccuracyError::TooSmall { width: 0, height: 0 }));
    // A size whose bytes no memory could hold is refused like any other that its data does not fill.
    let huge = RgbImage { width: u32::MAX, height: u32::MAX, data: Vec::new() };
    assert!(matches!(compare(&huge, &huge, None), Err(AccuracyError::Length { .. })));
}

/// The demo's clips, from where no camera stands: the still part that a camera sees is true to 28 dB and more, and
/// figures stand where they are.
#[test]
fn the_demo_is_true_where_no_camera_stands() {
    if videofields_testing::adapter("").is_none() {
        return;
    }
    let config_path = videofields_testing::root().join("config/demo/plaza.toml");
    let config = videofields_vision::config::load_with(&config_path, []).unwrap();
    let settings = config.settings();
    let file = &settings.scene[0].file;
    let scene = Arc::new(
        videofields_picture::scene::load_file("plaza", file, settings.media_folders()).unwrap().scene,
    );
    let (eye, target) = (DVec3::new(-24.0, -18.0, 12.0), DVec3::new(2.0, 2.0, 0.0));
    let (fov_y_rad, width_px, height_px, secs) = (45_f64.to_radians(), 480, 270, 18);
    let picture = |style| {
        let at = At::Time(Timestamp::from_nanos(secs * 1_000_000_000));
        let (eye, target, fov_y_rad) = (Some(eye), Some(target), Some(fov_y_rad));
        let scene_id = "plaza".to_owned();
        let request = ViewRequest {
            scene: scene_id,
            kind: ViewKind::Perspective,
            eye,
            target,
            fov_y_rad,
            width_px,
            height_px,
            at,
            style,
            see_through: false,
            colors: Colors::Raw,
            session: None,
            effort: Effort::default(),
            effects: Default::default(),
            horizon: None,
            blur_people: None,
            scope: videofields_vision::access::Scope::all(),
        };
        view_once(&config, &scene, &request, &SystemClock::new()).unwrap().image
    };
    let view = Camera::pinhole(eye, target, fov_y_rad, (width_px, height_px)).unwrap();
    let truth = World::plaza().judged_view(&view, secs as f64, 3, (640, 360)).unwrap();
    let psnr_db = |picture: &RgbImage, part: &Mask| {
        compare(&truth.truth.rgb, picture, Some(part)).unwrap().psnr_db.unwrap()
    };
    let (with_figures, bare) = (picture(EntityStyle::Billboards), picture(EntityStyle::None));
    let still_db = psnr_db(&with_figures, &truth.still);
    assert!(still_db >= 28.0, "the still part differs by {still_db} dB");
    let people = &truth.truth.instance;
    let (people_db, missing_db) = (psnr_db(&with_figures, people), psnr_db(&bare, people));
    assert!(people_db >= 15.0 && people_db > missing_db + 3.0, "people {people_db} dB, bare {missing_db} dB");
}
