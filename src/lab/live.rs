//! A scene without truth: each camera left out in turn, and frames held back from learning.
//!
//! A configuration's scene goes in, figures that say how well its cameras agree come out. Clips are read to their end
//! once, as fast as they go.
//!
//! *Leave one out*: for camera k, the scene is drawn at its place from the other cameras' backgrounds, and compared with
//! its own background where another camera sees the surface. It judges calibration, surfaces and blending together; two
//! cameras' different exposures count as error.
//!
//! *Held back*: once the background is warm, every tenth frame is not learned, only judged. Where a pixel was called
//! background, its luma should be the background's; where it hardly changed from the frame before and to the frame
//! after, it should not be called moving.

use crate::unjudged::{HeldBack, LeftOut, Unjudged, UnjudgedCamera};
use glam::DVec2;
use std::sync::Arc;
use videofields::accuracy::SweepError;
use videofields_picture::fuse;
use videofields_picture::plan::{
    self, Colors, EntityStyle, Frustum, Picture, Preset, Settings, View, Wishes,
};
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::ingest::{self, MediaRoots};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_vision::background::{Format, GaussianMixture};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraSettings, Config, End, Resolution, SegmentSettings};
use videofields_vision::frame::{CameraId, Frame, Mask, RgbImage, YuvImage};
use videofields_vision::geometry::{Camera, Surfaces};
use videofields_vision::measures::{Mean, compare};
use videofields_vision::observation::Observation;
use videofields_vision::segment::{BACKGROUND, MOVING, Segmenter};

/// How much of a scene is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LiveScope {
    /// Most frames of each camera.
    pub max_frames: u64,
    /// Most columns of a picture at a camera's place.
    pub max_width_px: u32,
}

impl LiveScope {
    /// For a report that is kept.
    pub const FULL: Self = Self { max_frames: 1500, max_width_px: 960 };
    /// For a first look.
    pub const QUICK: Self = Self { max_frames: 200, max_width_px: 480 };
}

/// Frames after which a background is warm, and the distance of those held back from then on.
const WARM_UP_FRAMES: u64 = 50;
const HELD_BACK_EVERY: u64 = 10;

/// Luma that a still pixel may change from frame to frame, 8-bit codes: noise.
const STILL_CODES: u8 = 6;

/// What a camera left behind.
struct Learned {
    id: CameraId,
    frame: Frame,
    background: Arc<YuvImage>,
    held_back: HeldBack,
}

/// Judges a scene of `config`; the adapter's name beside what was found. `progress` hears what is being done.
///
/// # Errors
/// When no camera of the scene gives a frame, or there is no device to draw on.
pub fn judge_scene(
    config: &Config,
    scene: &Arc<Scene>,
    scope: &LiveScope,
    progress: &dyn Fn(&str),
) -> Result<(Unjudged, String), SweepError> {
    let settings = config.settings();
    let roots = MediaRoots::of_settings(settings);
    let mut learned = Vec::new();
    for member in &scene.cameras {
        progress(&format!("learning camera {}", member.id));
        let Some(camera) = settings.camera.iter().find(|camera| camera.id == member.id) else {
            progress(&format!("camera {} is not configured and left out", member.id));
            continue;
        };
        match learn(camera, &roots, scope.max_frames) {
            Ok(Some(found)) => learned.push(found),
            Ok(None) => progress(&format!("camera {} has no frame and is left out", member.id)),
            Err(error) => progress(&format!("camera {} is left out: {error}", member.id)),
        }
    }
    if learned.is_empty() {
        return Err(SweepError::NoCamera);
    }
    let mut renderer = Renderer::new(Gpu::new(&settings.render.adapter)?, &settings.render)?;
    let adapter = renderer.gpu().name().to_owned();
    let mut cameras = Vec::new();
    for member in &scene.cameras {
        let Some(own) = learned.iter().find(|learned| learned.id == member.id) else {
            cameras.push(UnjudgedCamera { id: member.id.to_string(), left_out: None, held_back: None });
            continue;
        };
        progress(&format!("leaving camera {} out", member.id));
        let left_out =
            leave_out((&mut renderer, settings.render.samples), scene, member, own, &learned, scope)?;
        let held_back = Some(own.held_back).filter(|held| held.n_frames > 0);
        cameras.push(UnjudgedCamera { id: member.id.to_string(), left_out, held_back });
    }
    Ok((Unjudged { cameras }, adapter))
}

/// Reads a camera's frames; `None` where there are none.
fn learn(
    camera: &CameraSettings,
    roots: &MediaRoots,
    max_frames: u64,
) -> Result<Option<Learned>, ingest::IngestError> {
    let mut source = camera.source.clone();
    source.end = End::Stop;
    let mut frames = ingest::open(&source, roots)?;
    let mut learner: Option<Learner> = None;
    let mut last = None;
    let mut n_frames = 0;
    while n_frames < max_frames {
        let Some(next) = frames.next_frame()? else { break };
        // A picture of another size begins anew.
        let format = Format::of(&next.image);
        let learner = match &mut learner {
            Some(learner) if learner.mixture.format() == format => learner,
            other => other.insert(Learner::new(camera, format)),
        };
        learner.take(&next.image, next.stream_nanos, n_frames);
        n_frames += 1;
        last = Some(next);
    }
    let (Some(learner), Some(last)) = (learner, last) else { return Ok(None) };
    Ok(Some(Learned {
        id: camera.id.clone(),
        frame: Frame {
            camera: camera.id.clone(),
            timestamp: Timestamp::from_nanos(last.stream_nanos),
            number: last.number,
            image: last.image,
        },
        background: Arc::new(learner.mixture.background_picture()),
        held_back: learner.figures(),
    }))
}

/// Learns most frames and judges those held back.
struct Learner {
    mixture: GaussianMixture,
    segmenter: Segmenter,
    /// Stream time of the frame learned last.
    learned_nanos: Option<i64>,
    previous: Option<Arc<YuvImage>>,
    /// The frame held back, with its labels and the one before it, until the one after it comes.
    held: Option<(Arc<YuvImage>, Mask, Arc<YuvImage>)>,
    n_held: u64,
    difference: Mean,
    false_share: Mean,
}

impl Learner {
    fn new(camera: &CameraSettings, format: Format) -> Self {
        let segment = SegmentSettings { resolution: Resolution::Full, ..camera.segment.clone() };
        Self {
            mixture: GaussianMixture::new(&camera.background, format),
            segmenter: Segmenter::new(&segment),
            learned_nanos: None,
            previous: None,
            held: None,
            n_held: 0,
            difference: Mean::default(),
            false_share: Mean::default(),
        }
    }

    fn take(&mut self, image: &Arc<YuvImage>, stream_nanos: i64, number: u64) {
        if let Some((held, labels, before)) = self.held.take() {
            self.judge_still(&held, &labels, [&before, image]);
        }
        let is_held = number >= WARM_UP_FRAMES && number.is_multiple_of(HELD_BACK_EVERY);
        match (is_held, self.previous.clone()) {
            (true, Some(before)) => self.hold_back(image, before),
            _ => {
                let gap_nanos = self.learned_nanos.map_or(0, |last| stream_nanos.saturating_sub(last));
                self.mixture
                    .update(image, gap_nanos as f64 * 1e-9)
                    .expect("the model is of the picture's format");
                self.learned_nanos = Some(stream_nanos);
            }
        }
        self.previous = Some(Arc::clone(image));
    }

    fn hold_back(&mut self, image: &Arc<YuvImage>, before: Arc<YuvImage>) {
        self.mixture.classify(image).expect("the model is of the picture's format");
        let background = self.mixture.background_planes();
        let found = self.segmenter.segment(image, background, self.mixture.unmatched(), 0.0);
        let luma = image.plane(0);
        for y in 0..luma.height {
            let rows = luma.row(y).iter().zip(background[0].row(y)).zip(found.labels.row(y));
            for ((seen, learned), _) in rows.filter(|(_, label)| **label == BACKGROUND) {
                self.difference.add(f64::from(seen.abs_diff(*learned)));
            }
        }
        self.n_held += 1;
        self.held = Some((Arc::clone(image), found.labels, before));
    }

    /// Counts pixels that hardly changed and were called moving.
    fn judge_still(&mut self, held: &YuvImage, labels: &Mask, neighbours: [&YuvImage; 2]) {
        let luma = held.plane(0);
        for y in 0..luma.height {
            let [before, after] = neighbours.map(|image| image.plane(0).row(y));
            let is_still = |x: usize, seen: u8| {
                [before[x], after[x]].iter().all(|other| seen.abs_diff(*other) <= STILL_CODES)
            };
            let pixels = luma.row(y).iter().zip(labels.row(y)).enumerate();
            for (_, (_, label)) in pixels.filter(|(x, (seen, _))| is_still(*x, **seen)) {
                self.false_share.add(f64::from(u8::from(*label == MOVING)));
            }
        }
    }

    fn figures(&self) -> HeldBack {
        HeldBack {
            n_frames: self.n_held,
            mean_difference_codes: self.difference.value(),
            false_share: self.false_share.value(),
        }
    }
}

/// Draws the scene at a camera's place from the others and compares it with the camera's own background.
fn leave_out(
    (renderer, samples): (&mut Renderer, u32),
    scene: &Arc<Scene>,
    member: &SceneCamera,
    own: &Learned,
    learned: &[Learned],
    scope: &LiveScope,
) -> Result<Option<LeftOut>, SweepError> {
    let camera = &member.camera;
    let Some(view) = view_of(camera, scope.max_width_px) else { return Ok(None) };
    let observe = |id: &CameraId| {
        let other = learned.iter().find(|learned| learned.id == *id && learned.id != own.id)?;
        let (width, height) = (other.frame.image.width(), other.frame.image.height());
        let nothing = Arc::new(Mask::filled(width, height, 0));
        Some(Observation {
            frame: other.frame.clone(),
            soft_mask: Arc::clone(&nothing),
            labels: nothing,
            background: Arc::clone(&other.background),
            blobs: Arc::new([]),
            tracks: Arc::new([]),
        })
    };
    let state = fuse::assemble(scene, own.frame.timestamp, observe, None);
    let picture = Picture::from(view);
    let wishes = Wishes {
        settings: Settings { entities: EntityStyle::None, ..Preset::Balanced.settings(samples) },
        see_through: false,
        colors: Colors::Raw,
        effects: Default::default(),
    };
    let plan = plan::make(&state, &picture, wishes);
    let drawn = renderer.render(&state, &picture, &plan)?.image;
    let others: Vec<&Camera> = state.cameras.iter().map(|state| &*state.camera).collect();
    let (expected, mask) = expected(camera, &own.background.to_rgb(), &view, &scene.surfaces, &others);
    let n_seen = mask.data.iter().filter(|value| **value > 0).count();
    let seen_share = n_seen as f64 / mask.data.len().max(1) as f64;
    let comparison = if n_seen > 0 { Some(compare(&expected, &drawn, Some(&mask))?) } else { None };
    Ok(Some(LeftOut {
        seen_share,
        rmse: comparison.map(|of| of.rmse),
        psnr_db: comparison.and_then(|of| of.psnr_db),
        ssim: comparison.map(|of| of.ssim),
    }))
}

/// A pinhole view from a camera's place that holds its picture, as far as one can; `None` for a lens that sees nothing
/// ahead.
fn view_of(camera: &Camera, max_width_px: u32) -> Option<View> {
    /// Tangents beyond this (about 72 degrees) leave too few pixels for the middle.
    const MOST: f64 = 3.0;
    const STEPS: u32 = 16;
    let share = |step: u32| f64::from(step) / f64::from(STEPS);
    let border = (0..=STEPS).flat_map(|step| {
        let at = share(step);
        [DVec2::new(at, 0.0), DVec2::new(at, 1.0), DVec2::new(0.0, at), DVec2::new(1.0, at)]
    });
    let pose = *camera.pose();
    let tangents = border.filter_map(|place| {
        let local = pose.world_from_local.inverse() * camera.ray(place)?.direction;
        (local.z > 0.05).then(|| DVec2::new((local.x / local.z).abs(), (local.y / local.z).abs()))
    });
    let half = tangents.fold(DVec2::ZERO, DVec2::max).min(DVec2::splat(MOST));
    if half.min_element() < 1e-3 {
        return None;
    }
    let width_px = camera.size_px().0.clamp(16, max_width_px.max(16));
    let height_px = (f64::from(width_px) * half.y / half.x).round().clamp(16.0, 8192.0) as u32;
    // Square pixels, so that the picture is as wide as its rows say.
    let frustum = Frustum::around_axis(2.0 * half.y.atan(), width_px, height_px);
    Some(View { pose, frustum, width_px, height_px })
}

/// What a camera's own background shows in `view` from its place, and where: 255 where it has a texel there and
/// another camera sees the surface, else 0.
fn expected(
    camera: &Camera,
    background: &RgbImage,
    view: &View,
    surfaces: &Surfaces,
    others: &[&Camera],
) -> (RgbImage, Mask) {
    let (width, height) = (view.width_px, view.height_px);
    let mut picture = RgbImage { width, height, data: vec![0; width as usize * height as usize * 3] };
    let mut mask = Mask::filled(width, height, 0);
    let pixels = picture.data.chunks_exact_mut(3).zip(&mut mask.data).zip(0_u32..);
    for ((pixel, value), idx) in pixels {
        let at = |place: u32, of: u32| (f64::from(place) + 0.5) / f64::from(of);
        let ray = view.ray(at(idx % width, width), at(idx / width, height));
        let place = camera.project(ray.at(10.0)).filter(|place| place.is_inside());
        let (Some(place), Some(hit)) = (place, surfaces.hit(&ray, 0.0)) else { continue };
        let is_seen = others.iter().any(|other| {
            let from = other.pose().position_in_world;
            (from - hit.point_in_world).dot(hit.normal_in_world) > 0.0
                && other.project(hit.point_in_world).is_some_and(|place| place.is_inside())
                && !surfaces.is_hidden(from, hit.point_in_world)
        });
        pixel.copy_from_slice(&bilinear(background, place.texture));
        *value = if is_seen { 255 } else { 0 };
    }
    (picture, mask)
}

/// A picture's colour at a texture coordinate, between pixel centres.
fn bilinear(picture: &RgbImage, texture: DVec2) -> [u8; 3] {
    let last = DVec2::new(f64::from(picture.width - 1), f64::from(picture.height - 1));
    let size = last + 1.0;
    let place = (texture * size - 0.5).clamp(DVec2::ZERO, last);
    let low = place.floor();
    let part = place - low;
    let high = (low + 1.0).min(last);
    let code = |x: f64, y: f64, channel: usize| {
        f64::from(picture.data[(y as usize * picture.width as usize + x as usize) * 3 + channel])
    };
    [0, 1, 2].map(|channel| {
        let above = code(low.x, low.y, channel) * (1.0 - part.x) + code(high.x, low.y, channel) * part.x;
        let below = code(low.x, high.y, channel) * (1.0 - part.x) + code(high.x, high.y, channel) * part.x;
        (above * (1.0 - part.y) + below * part.y).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_interpolated_between_pixel_centres() {
        let picture = RgbImage { width: 2, height: 1, data: vec![0, 0, 0, 100, 200, 40] };
        assert_eq!(bilinear(&picture, DVec2::new(0.25, 0.5)), [0, 0, 0]);
        assert_eq!(bilinear(&picture, DVec2::new(0.5, 0.5)), [50, 100, 20]);
        assert_eq!(bilinear(&picture, DVec2::new(0.75, 0.0)), [100, 200, 40]);
        assert_eq!(bilinear(&picture, DVec2::new(1.0, 1.0)), [100, 200, 40]);
    }
}
