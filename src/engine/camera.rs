//! What a camera's thread feeds: its pipeline, its timeline, its checkpoints.

use super::checkpoint::Checkpoints;
use crate::clock::Clock;
use crate::config::{CameraSettings, Learning};
use crate::frame::Frame;
use crate::ingest::{self, FrameConsumer, IngestError, MediaRoots, Pipeline, StopFlag};
use crate::telemetry::{DropReason, Metrics};
use crate::timeline::Timeline;
use std::sync::Arc;

/// Takes a camera's frames: learns, segments, tracks, remembers.
pub(super) struct CameraConsumer {
    settings: CameraSettings,
    roots: MediaRoots,
    pipeline: Pipeline,
    timeline: Arc<Timeline>,
    checkpoints: Checkpoints,
    metrics: Arc<Metrics>,
    clock: Arc<dyn Clock>,
    stop: StopFlag,
    is_prepared: bool,
    /// What is wrong although frames come.
    concern: Option<String>,
}

impl CameraConsumer {
    /// `stop` ends the learning of a background clip.
    pub(super) fn new(
        settings: CameraSettings,
        roots: MediaRoots,
        timeline: Arc<Timeline>,
        checkpoints: Checkpoints,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
        stop: StopFlag,
    ) -> Self {
        let pipeline = Pipeline::new(&settings.background, &settings.segment).with_track(&settings.track);
        Self {
            settings,
            roots,
            pipeline,
            timeline,
            checkpoints,
            metrics,
            clock,
            stop,
            is_prepared: false,
            concern: None,
        }
    }

    /// Before the first frame: the background of the last run, else that of the clip. A held background is always
    /// learned anew, so that another clip takes effect; one that adapts learns a clip that was named since. False
    /// where the camera was stopped meanwhile.
    fn prepare(&mut self, first: &Frame) -> bool {
        let id = &self.settings.id;
        let is_held = self.settings.background.learning == Learning::Hold;
        let is_restored = !is_held && self.checkpoints.restore(&mut self.pipeline, &first.image);
        let Some(clip) = &self.settings.background.clip else { return true };
        if is_restored && self.pipeline.has_learned_clip() {
            return true;
        }
        let rate_hz = ingest::index_rate_hz(&self.settings.source);
        match ingest::learn_clip_stoppable(&mut self.pipeline, clip, rate_hz, &self.roots, &self.stop) {
            Ok(n_frames) => tracing::info!(camera = %id, n_frames, "background clip learned"),
            Err(IngestError::Stopped) => return false,
            Err(error) => {
                tracing::error!(camera = %id, %error, "background clip not learned");
                self.concern = Some(format!("background clip not learned, the background adapts: {error}"));
            }
        }
        true
    }
}

impl FrameConsumer for CameraConsumer {
    fn consume(&mut self, frame: Frame) {
        if !self.is_prepared {
            if !self.prepare(&frame) {
                return;
            }
            self.is_prepared = true;
        }
        let id = self.settings.id.as_str();
        let mut started = self.clock.monotonic();
        let observation = self.pipeline.process_staged(frame, |stage| {
            let ended = self.clock.monotonic();
            self.metrics.observe_stage(id, stage, ended.saturating_sub(started).as_secs_f64());
            started = ended;
        });
        match self.timeline.push(observation) {
            Ok(()) => self.metrics.ingest_frames.with_label_values(&[id]).inc(),
            Err(error) => {
                tracing::debug!(camera = id, %error, "frame out of order");
                self.metrics.count_dropped(id, DropReason::OutOfOrder);
            }
        }
    }

    fn concern(&self) -> Option<&str> {
        self.concern.as_deref()
    }

    fn miss(&mut self) {
        self.metrics.count_dropped(self.settings.id.as_str(), DropReason::Overrun);
    }

    fn tick(&mut self) {
        // What half a clip taught is not kept: the next start would take it for the whole.
        if self.is_prepared {
            self.checkpoints.write_if_due(&self.pipeline);
        }
    }

    fn finish(&mut self) {
        if self.is_prepared {
            self.checkpoints.write_finally(&self.pipeline);
        }
    }
}
