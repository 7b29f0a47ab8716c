//! Texture fields held to their baseline on the plaza: cameras a little off their calibrations, unevenly exposed.

use glam::{DQuat, DVec3, Vec3};
use videofields::accuracy::{SegmentationRun, Subject};
use videofields_vision::fields::{
    Blend, Field, FieldSettings, Preference, Steps, Tessellation, Topology, View, Weights, shade,
};
use videofields_vision::frame::{Mask, RgbImage, codes_of};
use videofields_vision::geometry::{Camera, Pose};
use videofields_vision::measures::{Pooled, Steadiness, compare, exposed_like};
use videofields_vision::mesh::{Mesh, NO_TRIANGLE, Raster};

/// What came of a way to mix.
#[derive(Default)]
pub(super) struct Outcome {
    pub(super) pooled: Pooled,
    pub(super) steps: Steps,
    /// Of each view.
    steadiness: Vec<Steadiness>,
}

impl Outcome {
    /// Over time, of the views that have a place that stands still, the mean, 8-bit codes squared.
    pub(super) fn flicker(&self) -> f64 {
        let all: Vec<f64> = self.steadiness.iter().filter_map(Steadiness::variance).collect();
        all.iter().sum::<f64>() / all.len() as f64
    }
}

/// Turned by a pixel about all three axes, each camera otherwise, and exposed a tenth off.
fn view(idx: usize, camera: &Camera, picture: &RgbImage) -> View {
    let signs = [DVec3::new(1.0, -1.0, 1.0), DVec3::new(-1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, 1.0)];
    let gains = [Vec3::new(0.9, 1.0, 1.1), Vec3::new(1.1, 1.0, 0.95), Vec3::new(1.0, 0.9, 0.9)];
    let pose = camera.pose();
    let turn = DQuat::from_scaled_axis(signs[idx % 3] / camera.focal_px().x);
    let pose = Pose { world_from_local: (pose.world_from_local * turn).normalize(), ..*pose };
    let camera =
        Camera::new(camera.size_px(), camera.focal_px(), camera.center_px(), *camera.distortion(), pose)
            .expect("a turned camera is one");
    let lights =
        (0..picture.width * picture.height).map(|at| picture.light(at % picture.width, at / picture.width));
    let data = lights.flat_map(|light| codes_of(light * gains[idx % 3])).collect();
    View::new(camera, RgbImage { width: picture.width, height: picture.height, data }, None)
}

/// The plaza's still part by the baseline, by fields without smoothing and by fields, at all instants that are judged.
pub(super) fn judged(subject: &Subject, found: &SegmentationRun) -> [Outcome; 3] {
    let cameras: Vec<Camera> = subject.cameras.iter().map(|of| of.camera.clone()).collect();
    let coarse = Tessellation { longest_m: 4.0, seam_m: 0.5, most_triangles: 1 << 15 };
    let mesh = coarse.of(&subject.scene.surfaces, &cameras);
    let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
    let settings = |smoothing_rounds| FieldSettings {
        preference: Preference::Errors { depth_m: Some(0.1), exponent: 4.0 },
        smoothing_rounds,
        ..FieldSettings::default()
    };
    let smooth = FieldSettings::default().smoothing_rounds;
    let mut outcomes: [Outcome; 3] = Default::default();
    for outcome in &mut outcomes {
        outcome.steadiness = vec![Steadiness::default(); subject.views.len()];
    }
    for frame in subject.judged_frames() {
        let seen = subject
            .cameras
            .iter()
            .map(|of| &found.of_frame(frame, &of.id).expect("judged frames are kept").background);
        let views: Vec<View> = seen
            .zip(&cameras)
            .enumerate()
            .map(|(idx, (of, camera))| view(idx, camera, &of.to_rgb()))
            .collect();
        for (outcome, (rounds, is_baseline)) in
            outcomes.iter_mut().zip([(smooth, true), (0, false), (smooth, false)])
        {
            let mut views = views.clone();
            let field =
                Field::new(&mesh, &topology, &mut views, &settings(rounds)).expect("a mesh and views");
            let here = subject.views.iter().enumerate().flat_map(|(idx, of)| {
                of.frames
                    .iter()
                    .filter(|(at, _)| *at == frame)
                    .map(move |(_, judged)| (idx, &of.camera, judged))
            });
            for (idx, camera, judged) in here {
                let by_viewer = || field.target(&mesh, &views, camera.pose().position_in_world);
                let weights = if is_baseline { field.by_normals() } else { by_viewer() };
                let truth = (&judged.truth.rgb, &judged.still);
                outcome.add(idx, truth, (&mesh, camera), (&field, &views, &weights));
            }
        }
    }
    outcomes
}

impl Outcome {
    fn add(
        &mut self,
        idx: usize,
        (truth, still): (&RgbImage, &Mask),
        (mesh, camera): (&Mesh, &Camera),
        of: (&Field, &[View], &Weights),
    ) {
        let raster = Raster::of(mesh, camera, [truth.width as usize, truth.height as usize]);
        let shaded = shade((mesh, &raster), camera, of, Blend::Mixed);
        let mut part = still.clone();
        let pixels = part.data.iter_mut().zip(raster.triangles()).zip(&shaded.covered.data);
        pixels.for_each(|((part, triangle), covered)| {
            *part = if *triangle == NO_TRIANGLE || *covered == 0 { 0 } else { *part };
        });
        let exposed = exposed_like(truth, &shaded.picture, &part);
        self.pooled.add(&compare(&exposed, &shaded.picture, Some(&part)).expect("something is seen"));
        self.steps = self.steps.plus(shaded.steps);
        self.steadiness[idx].add(&shaded.picture, truth, Some(&part));
    }
}
