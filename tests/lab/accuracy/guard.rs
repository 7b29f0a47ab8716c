//! Holds the quality of every stage to fixed bounds on the plaza: what regresses fails here, whatever the machine.
//!
//! The bounds lie a little beyond what was measured when they were set; nothing is timed.

use videofields::accuracy::{
    Easel, EntityForm, MapRun, OpenGate, Scope, SegmentationForm, SegmentationRun, Stopwatch, SurfaceForm,
};
use videofields_lab::worlds::prepare;
use videofields_picture::plan::EntityStyle;
use videofields_simulate::World;
use videofields_testing::adapter;
use videofields_vision::clock::SystemClock;
use videofields_vision::config::Resolution;
use videofields_vision::mapping::{Builder, GridSettings};

const SCOPE: Scope = Scope {
    n_frames: 20,
    samples_per_side: 2,
    view_size_px: (480, 270),
    n_views: 2,
    n_moments: 2,
    ..Scope::QUICK
};

/// Fails with what was found where it lies outside its bounds.
fn check(what: &str, found: f64, bounds: std::ops::RangeInclusive<f64>) {
    assert!(bounds.contains(&found), "{what} is {found}, outside {bounds:?}");
}

#[test]
fn the_plaza_is_as_accurate_as_it_was() {
    let clock = SystemClock::new();
    let watch = Stopwatch::new(&clock, &OpenGate);
    let subject = prepare(&World::named("plaza").unwrap(), &SCOPE, &watch, &|_step| {}).unwrap();
    assert_eq!((subject.cameras.len(), subject.views.len()), (3, 2));

    let first = &subject.cameras[0];
    let default = SegmentationForm::of(&first.settings, first.size_px());
    let form = |resolution, modes| SegmentationForm { resolution, modes, ..default };
    let f_measure =
        |form: SegmentationForm| SegmentationRun::of(&subject, &form, &watch).unwrap().score.f_measure();
    let found = SegmentationRun::of(&subject, &default, &watch).unwrap();
    check("F at full resolution", found.score.f_measure(), 0.89..=1.0);
    check("precision", found.score.precision().unwrap(), 0.84..=1.0);
    check("recall", found.score.recall().unwrap(), 0.94..=1.0);
    check("F at half resolution", f_measure(form(Resolution::Half, 3)), 0.85..=1.0);
    check("F with a single mode", f_measure(form(Resolution::Full, 1)), 0.88..=1.0);

    let map = |builder| MapRun::of(&subject, builder, 1, &watch).unwrap().measures().1;
    let ray = map(Builder::Ray);
    check("the ray map's worst distance", ray["worst_m"], 0.0..=1e-4);
    check("the ray map's missing share", ray["missing_share"], 0.0..=0.0);
    let grid = map(Builder::Grid(GridSettings { step_m: 0.1 }));
    check("the grid map's mean distance", grid["mean_m"], 0.0..=0.02);
    check("the grid map's missing share", grid["missing_share"], 0.0..=0.02);

    // Fields against their baseline, with cameras that are a pixel off; and against themselves, sharp as they are without smoothing.
    let figures = |of: &super::fields::Outcome| {
        let (psnr_db, ssim) = (of.pooled.psnr_db().unwrap(), of.pooled.ssim().unwrap());
        (psnr_db, ssim, of.steps.energy().unwrap(), of.steps.sharpness().unwrap(), of.flicker())
    };
    let all = super::fields::judged(&subject, &found);
    let [baseline, sharp, fields] = all.each_ref().map(figures);
    let told = format!("baseline {baseline:?}, not smooth {sharp:?}, fields {fields:?}");
    assert!(fields.0 > baseline.0 && fields.1 > baseline.1, "{told}");
    // Where pixels are as large as here, sharper pictures step as much: by no more than a tenth beyond the baseline's.
    assert!(fields.2 < 1.1 * baseline.2, "{told}");
    assert!(fields.0 > sharp.0 && fields.2 < sharp.2, "{told}");
    // Of three cameras whose noise is their own, one alone has three times the variance of the mean of all.
    assert!(fields.4 <= 3.0 * baseline.4, "{told}");

    if adapter("").is_none() {
        return;
    }
    let surface = SurfaceForm::of(&subject.render);
    let mut easel = Easel::new(&subject, surface).unwrap();
    let mut judged = |form| easel.judge(&subject, &found, (surface, form), &watch).unwrap().measures();
    let billboards = judged(EntityForm::DEFAULT);
    check("PSNR of the still part", billboards["still_psnr_db"], 31.5..=60.0);
    check("SSIM of the still part", billboards["still_ssim"], 0.925..=1.0);
    check("seam energy", billboards["seam_energy"], 0.0..=2.2);
    check("flicker", billboards["flicker"], 0.0..=0.1);
    check("IoU of billboards' silhouettes", billboards["silhouette_iou"], 0.46..=1.0);
    let points = judged(EntityForm { style: EntityStyle::Points, ..EntityForm::DEFAULT });
    check("IoU of points' silhouettes", points["silhouette_iou"], 0.40..=1.0);
    check("PSNR at people drawn as points", points["people_psnr_db"], 13.6..=60.0);
}
