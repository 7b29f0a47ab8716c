//! A place whose truth is exact, ready to be judged: what its cameras see, what is true of it, and views where none stands.
//!
//! Knows nothing of where frames and truths come from: the daemon's own are of `courtyard`, developers' of simulated worlds.

use super::SweepError;
use super::gate::{Stopped, Stopwatch};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::Arc;
use videofields_picture::plan::{View, ViewLimits};
use videofields_picture::scene::{Scene, SceneView, object_sizes};
use videofields_recording::ingest::Pipeline;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraSettings, RenderSettings};
use videofields_vision::frame::{CameraId, Frame, Mask, RgbImage, YuvImage};
use videofields_vision::geometry::{Camera, Surfaces};
use videofields_vision::measures::NO_OWNER;

/// How much of a place is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scope {
    /// Columns and rows of the cameras' pictures.
    pub size_px: (u32, u32),
    /// Frames of one period; it is played twice, once to learn and once to judge.
    pub n_frames: u32,
    /// Most cameras; the first ones.
    pub max_cameras: usize,
    /// Samples a pixel, each way, of what cameras see.
    pub samples_per_side: u32,
    /// Columns and rows of the views.
    pub view_size_px: (u32, u32),
    /// Views where no camera stands.
    pub n_views: usize,
    /// Moments at which each view is judged, two frames that follow each other at each.
    pub n_moments: u32,
    /// Times that a map is built.
    pub n_map_builds: u32,
    /// Grids of more points than this are left out, and said to be.
    pub max_grid_points: u64,
    /// Most whole pipelines, and the longest time for all of them, seconds.
    pub max_pipelines: usize,
    /// See [`Self::max_pipelines`].
    pub max_pipelines_secs: f64,
}

impl Scope {
    /// For a report that is kept: some minutes.
    pub const FULL: Self = Self {
        size_px: (640, 360),
        n_frames: 40,
        max_cameras: 12,
        samples_per_side: 3,
        view_size_px: (640, 360),
        n_views: 3,
        n_moments: 3,
        n_map_builds: 5,
        max_grid_points: videofields_vision::mapping::MAX_GRID_POINTS,
        max_pipelines: 40,
        max_pipelines_secs: 900.0,
    };

    /// For a first look: about half a minute.
    pub const QUICK: Self = Self {
        n_frames: 24,
        max_cameras: 4,
        samples_per_side: 2,
        view_size_px: (480, 270),
        n_views: 2,
        n_moments: 1,
        n_map_builds: 3,
        max_grid_points: 1 << 22,
        max_pipelines: 12,
        max_pipelines_secs: 60.0,
        ..Self::FULL
    };

    /// For the daemon, which has 30 s.
    pub const DAEMON: Self = Self {
        n_frames: 16,
        max_cameras: 3,
        samples_per_side: 1,
        n_views: 1,
        n_map_builds: 2,
        max_grid_points: 1 << 20,
        max_pipelines: 8,
        max_pipelines_secs: 8.0,
        ..Self::QUICK
    };
}

impl Scope {
    /// In a sentence.
    #[must_use]
    pub fn told(&self) -> String {
        format!(
            "at most {} cameras of {} x {} pixels as their sensors give them, without codec or delivery, {} frames of the period, played twice; {} views of {} x {} pixels at \
             {} pairs of frames",
            self.max_cameras,
            self.size_px.0,
            self.size_px.1,
            self.n_frames,
            self.n_views,
            self.view_size_px.0,
            self.view_size_px.1,
            self.n_moments
        )
    }
}

/// A camera, with all it sees in one period.
#[derive(Debug)]
pub struct SubjectCamera {
    /// Its id.
    pub id: CameraId,
    /// Its calibration for the scope's picture size.
    pub camera: Camera,
    /// Its settings.
    pub settings: CameraSettings,
    /// Distance along the optical axis of the still world at every pixel's centre, metres; 0 where there is none.
    pub depth_m: Vec<f32>,
    /// Its pictures.
    pub frames: Vec<Arc<YuvImage>>,
    /// What moves in each: a figure's instance, or 0.
    pub instances: Vec<Mask>,
}

impl SubjectCamera {
    /// Columns and rows of its pictures; 0 where it has none.
    #[must_use]
    pub fn size_px(&self) -> (u32, u32) {
        self.frames.first().map_or((0, 0), |frame| (frame.width(), frame.height()))
    }
}

/// Somebody or something that moves, where it truly is at a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubjectFigure {
    /// Number of its pixels in [`SubjectCamera::instances`].
    pub instance: u8,
    /// Low and high corner of the rectangle along the world's axes that it covers of the ground, metres; of somebody on foot both are the
    /// place of their feet.
    pub ground_m: [DVec2; 2],
    /// Says that it is somebody on foot.
    pub is_on_foot: bool,
}

impl SubjectFigure {
    /// Returns the distance of a place from the rectangle, metres; 0 within.
    #[must_use]
    pub fn distance_m(&self, place_m: DVec2) -> f64 {
        let [low, high] = self.ground_m;
        place_m.distance(place_m.clamp(low, high))
    }
}

/// Holds what a view shows in truth.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewTruth {
    /// The picture, 8-bit sRGB.
    pub rgb: RgbImage,
    /// What each pixel's centre shows: 0 what stands still, else somebody's number.
    pub instance: Mask,
    /// Distance of what each pixel's centre shows along the optical axis, metres; 0 where there is nothing.
    /// **Shape** height x width, row-major.
    pub depth_m: Vec<f32>,
}

/// The truth of a view where no camera stands, and what of it the cameras could tell.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedView {
    /// The view.
    pub truth: ViewTruth,
    /// Where a camera sees what stands still there, and nothing that moves is within 2 pixels: 255, else 0.
    pub still: Mask,
}

/// Finds the truth of what a camera shows at an instant, in seconds of the subject's time.
pub type Judge<'a> = dyn FnMut(&Camera, f64) -> Result<JudgedView, SweepError> + 'a;

/// A view where no camera stands, at some frames.
#[derive(Debug)]
pub struct SubjectView {
    /// The view.
    pub view: View,
    /// The same as a camera that stands there.
    pub camera: Camera,
    /// Which camera's picture counts most at each pixel of the still world; [`NO_OWNER`] where none does.
    pub owners: Mask,
    /// By index into the period's frames: pairs of frames that follow each other.
    pub frames: Vec<(usize, JudgedView)>,
}

/// A place made ready.
#[derive(Debug)]
pub struct Subject {
    /// Its id.
    pub id: String,
    /// Its scene.
    pub scene: Arc<Scene>,
    /// The renderer's settings.
    pub render: RenderSettings,
    /// Its cameras, at most the scope's.
    pub cameras: Vec<SubjectCamera>,
    /// Everything that moves, by frame of the period; seen or not.
    pub figures: Vec<Vec<SubjectFigure>>,
    /// Seconds between frames.
    pub interval_secs: f64,
    /// The views.
    pub views: Vec<SubjectView>,
    /// Cameras that there are, those left out by the scope included.
    pub n_world_cameras: usize,
}

impl Subject {
    /// Returns the pipeline of one of its cameras with these settings, which knows sizes of people from the scene as a daemon's does.
    #[must_use]
    pub fn pipeline(&self, camera: &SubjectCamera, settings: &CameraSettings) -> Pipeline {
        let mut pipeline = Pipeline::new(&settings.background, &settings.segment);
        let member = self.scene.cameras.iter().find(|member| member.id == camera.id);
        pipeline.set_object_sizes(member.map(|member| Arc::new(object_sizes(&self.scene, member))));
        pipeline
    }

    /// Frames of a period.
    #[must_use]
    pub fn n_frames(&self) -> usize {
        self.cameras.first().map_or(0, |camera| camera.frames.len())
    }

    /// Which of the period's frames a view is judged at, in order.
    #[must_use]
    pub fn judged_frames(&self) -> Vec<usize> {
        let mut frames: Vec<usize> =
            self.views.iter().flat_map(|view| view.frames.iter().map(|(frame, _)| *frame)).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    /// Scene time of a frame, counted over both periods.
    #[must_use]
    pub fn instant(&self, frame: usize) -> Timestamp {
        Timestamp::from_nanos((frame as f64 * self.interval_secs * 1e9).round() as i64)
    }

    /// A camera's frame, counted over both periods.
    #[must_use]
    pub fn frame(&self, camera: &SubjectCamera, number: usize) -> Frame {
        Frame {
            camera: camera.id.clone(),
            timestamp: self.instant(number),
            number: number as u64,
            image: Arc::clone(&camera.frames[number % camera.frames.len()]),
        }
    }

    /// Where views are judged: the scene's own place and places halfway between neighbouring cameras, widest gap
    /// first, at their mean distance and height, all looking at where the people are on average (`middle`, in the world).
    #[must_use]
    pub fn places(&self, middle: DVec3, scope: &Scope) -> Vec<SceneView> {
        let surfaces = &self.scene.surfaces;
        let mut places: Vec<SceneView> = self.scene.view.into_iter().collect();
        let mut eyes: Vec<DVec3> =
            self.cameras.iter().map(|camera| camera.camera.pose().position_in_world - middle).collect();
        eyes.sort_by(|a, b| a.truncate().to_angle().total_cmp(&b.truncate().to_angle()));
        let mut gaps: Vec<(f64, DVec3, DVec3)> = (0..eyes.len())
            .map(|i| (eyes[i], eyes[(i + 1) % eyes.len()]))
            .map(|(a, b)| {
                let turn =
                    (b.truncate().to_angle() - a.truncate().to_angle()).rem_euclid(std::f64::consts::TAU);
                (if turn == 0.0 { std::f64::consts::TAU } else { turn }, a, b)
            })
            .collect();
        gaps.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (turn, a, b) in gaps {
            let angle = a.truncate().to_angle() + 0.5 * turn;
            let distance = 0.5 * (a.truncate().length() + b.truncate().length());
            let height = middle.z + 0.5 * (a.z + b.z);
            let eye_at =
                |share: f64| (middle.truncate() + DVec2::from_angle(angle) * distance * share).extend(height);
            let target = middle + DVec3::Z;
            // Nearer where something stands in the way.
            let eye = [1.0, 0.8, 0.6, 0.4, 0.25]
                .map(eye_at)
                .into_iter()
                .find(|eye| is_free(surfaces, *eye, target));
            places.extend(eye.map(|eye| SceneView { eye, target, fov_y_rad: 45_f64.to_radians() }));
        }
        places.truncate(scope.n_views);
        places
    }

    /// The view from a place at the scope's moments, with the truth that `judge` finds.
    ///
    /// # Errors
    /// When there can be no view from there, `judge` fails, or the gate ends it.
    pub fn judged_at(
        &self,
        scope: &Scope,
        place: SceneView,
        watch: &Stopwatch<'_>,
        judge: &mut Judge<'_>,
    ) -> Result<SubjectView, SweepError> {
        let (width_px, height_px) = scope.view_size_px;
        let limits = ViewLimits { max_side_px: 16_384, max_pixels: 1 << 28 };
        let view = View::new(place.eye, place.target, place.fov_y_rad, width_px, height_px, &limits)
            .map_err(SweepError::View)?;
        let camera = Camera::pinhole(place.eye, place.target, place.fov_y_rad, scope.view_size_px)
            .map_err(|error| SweepError::Picture(error.to_string()))?;
        let mut frames = Vec::new();
        let n_frames = self.n_frames();
        for moment in 0..scope.n_moments as usize {
            let first = (2 * moment + 1) * n_frames / (2 * scope.n_moments as usize);
            for frame in [first, first + 1] {
                watch.enter()?;
                let frame = frame.min(n_frames - 1);
                let seconds = frame as f64 * self.interval_secs;
                frames.push((frame, judge(&camera, seconds)?));
            }
        }
        watch.enter()?;
        Ok(SubjectView { view, camera, owners: self.owners(&view), frames })
    }

    /// For every pixel of `view` the camera whose background weighs most there, by the renderer's own weights.
    fn owners(&self, view: &View) -> Mask {
        let cameras: Vec<&Camera> = self.cameras.iter().map(|camera| &camera.camera).collect();
        owners(&self.scene.surfaces, &cameras, view)
    }
}

/// For every pixel of `view` the index of the camera whose picture weighs most on the surface there, after "Hybrid" 2004
/// sections 4.3 and 4.4 as the renderer blends (`shaders/render/surface.wgsl`): `V W_f (d_k . n)^5 (d_k . d_v + 1)^5`.
#[must_use]
pub fn owners(surfaces: &Surfaces, cameras: &[&Camera], view: &View) -> Mask {
    const FEATHER: f64 = 0.06;
    let (width, height) = (view.width_px, view.height_px);
    let mut owners = Mask::filled(width, height, NO_OWNER);
    owners.data.par_chunks_mut(width as usize).enumerate().for_each(|(y, row)| {
        for (x, owner) in row.iter_mut().enumerate() {
            let at = |place: usize, of: u32| (place as f64 + 0.5) / f64::from(of);
            let ray = view.ray(at(x, width), at(y, height));
            let Some(hit) = surfaces.hit(&ray, 0.0) else { continue };
            let to_viewer = -ray.direction;
            let normal = if hit.normal_in_world.dot(to_viewer) < 0.0 {
                -hit.normal_in_world
            } else {
                hit.normal_in_world
            };
            let weight = |camera: &Camera| {
                let place = camera.project(hit.point_in_world).filter(|place| place.is_inside())?;
                let inset = place.texture.min(DVec2::ONE - place.texture).min_element();
                let share = (inset / FEATHER).clamp(0.0, 1.0);
                let position = camera.pose().position_in_world;
                let to_camera = (position - hit.point_in_world).normalize_or_zero();
                let squareness = to_camera.dot(normal);
                if squareness <= 0.0 || surfaces.is_hidden(position, hit.point_in_world) {
                    return None;
                }
                let feather = share * share * (3.0 - 2.0 * share);
                Some(feather * (squareness * (to_camera.dot(to_viewer) + 1.0)).powi(5))
            };
            let weights =
                cameras.iter().zip(0..NO_OWNER).filter_map(|(camera, idx)| Some((weight(camera)?, idx)));
            let best = weights.filter(|(weight, _)| *weight > 0.0).max_by(|(a, _), (b, _)| a.total_cmp(b));
            *owner = best.map_or(NO_OWNER, |(_, idx)| idx);
        }
    });
    owners
}

/// Whether a viewer can stand at `eye`: in no solid, nothing between it and the target.
fn is_free(surfaces: &Surfaces, eye: DVec3, target: DVec3) -> bool {
    !surfaces.is_within_solid(eye) && !surfaces.is_hidden(eye, target)
}

impl From<Stopped> for SweepError {
    fn from(_stopped: Stopped) -> Self {
        Self::Stopped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::geometry::{Distortion, GroundPolygon, Pose};

    #[test]
    fn each_side_of_the_ground_belongs_to_the_camera_over_it() {
        let corner = |x, y| DVec2::new(x, y);
        let ground = GroundPolygon::new(
            vec![corner(-9.0, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(-9.0, 9.0)],
            0.0,
        );
        let surfaces = Surfaces::of_ground_and_boxes(vec![ground.unwrap()], Vec::new());
        let camera = |x: f64| {
            let pose = Pose::looking_at(DVec3::new(x, 0.0, 10.0), DVec3::new(x, 0.1, 0.0)).unwrap();
            Camera::new((64, 64), DVec2::splat(32.0), DVec2::splat(32.0), Distortion::None, pose).unwrap()
        };
        let (left, right) = (camera(-6.0), camera(6.0));
        let limits = ViewLimits { max_side_px: 64, max_pixels: 4096 };
        let view = View::new(DVec3::new(0.0, -0.1, 12.0), DVec3::ZERO, 1.4, 32, 32, &limits).unwrap();
        let found = owners(&surfaces, &[&left, &right], &view);
        assert_eq!(found.get(8, 16), 0);
        assert_eq!(found.get(23, 16), 1);
        // Beyond the ground there is nothing to own.
        assert_eq!(found.get(0, 0), NO_OWNER);
        assert_eq!(owners(&surfaces, &[], &view).data, vec![NO_OWNER; 1024].into());
    }
}
