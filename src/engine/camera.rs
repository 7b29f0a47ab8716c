//! What a camera's thread feeds: its pipeline, its timeline, its checkpoints.

use super::checkpoint::Checkpoints;
use crate::clock::Clock;
use crate::config::{CameraSettings, Learning};
use crate::frame::Frame;
use crate::ingest::{self, FrameConsumer, MediaRoots, Pipeline};
use crate::telemetry::{DropReason, Metrics, Stage};
use crate::timeline::Timeline;
use std::sync::Arc;

/// Takes a camera's frames: learns, segments, remembers.
pub(super) struct CameraConsumer {
    settings: CameraSettings,
    roots: MediaRoots,
    pipeline: Pipeline,
    timeline: Arc<Timeline>,
    checkpoints: Checkpoints,
    metrics: Arc<Metrics>,
    clock: Arc<dyn Clock>,
    is_prepared: bool,
}

impl CameraConsumer {
    pub(super) fn new(
        settings: CameraSettings,
        roots: MediaRoots,
        timeline: Arc<Timeline>,
        checkpoints: Checkpoints,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
    ) -> Self {
        let pipeline = Pipeline::new(&settings.background, &settings.segment);
        Self { settings, roots, pipeline, timeline, checkpoints, metrics, clock, is_prepared: false }
    }

    /// Before the first frame: the background of the last run, else that of the clip. A held background is always
    /// learned anew, so that another clip takes effect.
    fn prepare(&mut self) {
        let id = &self.settings.id;
        let is_held = self.settings.background.learning == Learning::Hold;
        if !is_held && self.checkpoints.restore(&mut self.pipeline) {
            return;
        }
        let Some(clip) = &self.settings.background.clip else { return };
        let rate_hz = ingest::index_rate_hz(&self.settings.source);
        match ingest::learn_clip(&mut self.pipeline, clip, rate_hz, &self.roots) {
            Ok(n_frames) => tracing::info!(camera = %id, n_frames, "background clip learned"),
            Err(error) => tracing::error!(camera = %id, %error, "background clip not learned"),
        }
    }
}

impl FrameConsumer for CameraConsumer {
    fn consume(&mut self, frame: Frame) {
        if !std::mem::replace(&mut self.is_prepared, true) {
            self.prepare();
        }
        let id = self.settings.id.as_str();
        let started = self.clock.monotonic();
        let observation = self.pipeline.process(frame);
        let took = self.clock.monotonic().saturating_sub(started);
        self.metrics.observe_stage(id, Stage::Segment, took.as_secs_f64());
        match self.timeline.push(observation) {
            Ok(()) => self.metrics.ingest_frames.with_label_values(&[id]).inc(),
            Err(error) => {
                tracing::debug!(camera = id, %error, "frame out of order");
                self.metrics.count_dropped(id, DropReason::OutOfOrder);
            }
        }
    }

    fn tick(&mut self) {
        self.checkpoints.write_if_due(&self.pipeline);
    }

    fn finish(&mut self) {
        self.checkpoints.write(&self.pipeline);
    }
}
