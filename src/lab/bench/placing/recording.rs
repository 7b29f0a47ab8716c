//! A recording: a folder with clips, a configuration with cameras and a scene, and where everybody was.
//!
//! Its clips are played twice, once to learn and once to be judged, at the instants of its truth.

use super::super::folder::Folder;
use super::judge::Judge;
use super::truth::{self, Instant};
use anyhow::{Context as _, Result, ensure};
use std::path::Path;
use std::sync::Arc;
use videofields::commands::given::pipeline;
use videofields_picture::scene::{Scene, SceneCamera, object_sizes};
use videofields_recording::ingest::{self, MediaRoots, Pipeline, Source, SourceFrame};
use videofields_recording::timeline::REACH_NANOS;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraSettings, End, SegmentSettings, SourceSettings};
use videofields_vision::frame::Frame;
use videofields_vision::observation::Observation;

/// Time between the two passages of clips of one frame, nanoseconds.
const LEAST_STEP_NANOS: i64 = 40_000_000;

/// A recording with all but its pictures.
pub(super) struct Recording {
    scene: Scene,
    /// Settings of the scene's cameras, in its order.
    cameras: Vec<CameraSettings>,
    roots: MediaRoots,
    instants: Vec<Instant>,
}

impl Recording {
    /// Opens the recording in `folder`, at most `rate_hz` instants a second of it.
    ///
    /// # Errors
    /// When it has no configuration of one scene, its truth or a clip cannot be read, or they do not belong together.
    pub(super) fn open(folder: &Path, rate_hz: Option<f64>) -> Result<Self> {
        let Folder { path, settings, scene_path, scene } = Folder::open(folder)?;
        ensure!(!scene.cameras.is_empty(), "{}: the scene has no camera", scene_path.display());
        let known: Vec<&str> = settings.camera.iter().map(|camera| camera.id.as_str()).collect();
        let camera = |id: &str| {
            let camera = settings.camera.iter().find(|camera| camera.id.as_str() == id).cloned();
            let unknown = || videofields_vision::error::unknown("camera", id, &known);
            camera.with_context(|| format!("{}: {} (of {})", scene_path.display(), unknown(), path.display()))
        };
        let cameras = scene.cameras.iter().map(|member| camera(member.id.as_str()));
        let cameras = cameras.collect::<Result<Vec<_>>>()?;
        let instants = truth::read(folder, &scene, rate_hz)?;
        let roots = MediaRoots::new(&[vec![folder.to_owned()], settings.media.roots.clone()].concat())?;
        Ok(Self { scene, cameras, roots, instants })
    }

    /// Returns it with cameras that are segmented by default, whatever its configuration says.
    pub(super) fn segmented_by_default(mut self) -> Self {
        self.cameras.iter_mut().for_each(|camera| camera.segment = SegmentSettings::default());
        self
    }

    pub(super) fn n_cameras(&self) -> usize {
        self.cameras.len()
    }

    /// Plays it twice, and judges the second time. `scene_of` gives the scene in which its cameras are associated.
    ///
    /// # Errors
    /// When a clip cannot be decoded.
    pub(super) fn judge(
        &self,
        judge: &mut Judge<'_>,
        scene_of: impl FnOnce(&Scene) -> Result<Scene>,
    ) -> Result<()> {
        let scene = Arc::new(scene_of(&self.scene)?);
        let members = scene.cameras.iter().zip(&self.cameras);
        let mut players = members.map(|(member, camera)| Player::new(camera, (&scene, member), &self.roots));
        let mut players = players.by_ref().collect::<Result<Vec<_>>>()?;
        let mut length_nanos = 0;
        for player in &mut players {
            length_nanos = length_nanos.max(player.learn(judge)?);
        }
        for player in &mut players {
            player.rewind(&self.roots, length_nanos)?;
        }
        judge.correct(&scene);
        for instant in &self.instants {
            let nanos = (instant.time_secs * 1e9).round() as i64 + length_nanos;
            let mut seen: Vec<Observation> = Vec::new();
            for player in &mut players {
                seen.extend(player.at(nanos)?);
            }
            let state = judge.place(&scene, Timestamp::from_nanos(nanos), &seen);
            judge.score(&state, &instant.figures);
        }
        Ok(())
    }
}

/// One camera's clip on its way through the camera's pipeline.
struct Player<'a> {
    settings: &'a CameraSettings,
    source: Box<dyn Source>,
    pipeline: Pipeline,
    /// Decoded and not yet looked at.
    next: Option<SourceFrame>,
    seen: Option<Observation>,
    /// Time of this passage's first frame, nanoseconds.
    from_nanos: i64,
}

fn open(settings: &CameraSettings, roots: &MediaRoots) -> Result<Box<dyn Source>> {
    let source = SourceSettings { end: End::Stop, ..settings.source.clone() };
    ensure!(source.path.is_some(), "camera {}: expected a clip as its source", settings.id);
    ingest::open(&source, roots).with_context(|| format!("camera {}", settings.id))
}

impl<'a> Player<'a> {
    fn new(
        settings: &'a CameraSettings,
        (scene, member): (&Scene, &SceneCamera),
        roots: &MediaRoots,
    ) -> Result<Self> {
        let source = open(settings, roots)?;
        let mut pipeline = pipeline(settings);
        pipeline.set_object_sizes(Some(Arc::new(object_sizes(scene, member))));
        Ok(Self { settings, source, pipeline, next: None, seen: None, from_nanos: 0 })
    }

    fn decode(&mut self) -> Result<Option<SourceFrame>> {
        self.source.next_frame().with_context(|| format!("camera {}", self.settings.id))
    }

    /// Learns the whole clip; its length, nanoseconds.
    fn learn(&mut self, judge: &mut Judge<'_>) -> Result<i64> {
        let (mut last, mut step) = (0, LEAST_STEP_NANOS);
        while let Some(frame) = self.decode()? {
            if frame.stream_nanos > last {
                (last, step) = (frame.stream_nanos, frame.stream_nanos - last);
            }
            self.look(frame);
            self.seen.iter().for_each(|seen| judge.learn(seen));
        }
        ensure!(self.seen.take().is_some(), "camera {}: its clip has no frame", self.settings.id);
        Ok(last + step)
    }

    /// Begins the clip anew, at this time.
    fn rewind(&mut self, roots: &MediaRoots, from_nanos: i64) -> Result<()> {
        self.source = open(self.settings, roots)?;
        self.from_nanos = from_nanos;
        self.next = self.decode()?;
        Ok(())
    }

    fn look(&mut self, frame: SourceFrame) {
        let frame = Frame {
            camera: self.settings.id.clone(),
            timestamp: Timestamp::from_nanos(self.from_nanos + frame.stream_nanos),
            number: frame.number,
            image: frame.image,
        };
        self.seen = Some(self.pipeline.process(frame));
        self.pipeline.take_events();
    }

    /// Returns the observation of the frame nearest to an instant, if that is near enough.
    fn at(&mut self, nanos: i64) -> Result<Option<Observation>> {
        while let Some(frame) = self.next.take() {
            let away = (self.from_nanos + frame.stream_nanos - nanos).abs();
            let is_nearer = self.seen.as_ref().is_none_or(|seen| away <= away_of(seen, nanos));
            if !is_nearer {
                self.next = Some(frame);
                break;
            }
            self.look(frame);
            self.next = self.decode()?;
        }
        Ok(self.seen.clone().filter(|seen| away_of(seen, nanos) <= REACH_NANOS))
    }
}

fn away_of(seen: &Observation, nanos: i64) -> i64 {
    seen.frame.timestamp.nanos_since(Timestamp::from_nanos(nanos)).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_one_configuration_is_refused() {
        let folder = tempfile::TempDir::new().unwrap();
        let refused = |expected: &str| {
            let error = Recording::open(folder.path(), None).map(|_| ()).unwrap_err();
            assert!(format!("{error:#}").contains(expected), "{error:#}");
        };
        refused("expected one configuration (*.toml), found 0");
        std::fs::write(folder.path().join("a.toml"), "").unwrap();
        refused("a.toml: expected one [[scene]], found 0");
        std::fs::write(folder.path().join("b.toml"), "").unwrap();
        refused("found 2");
    }
}
