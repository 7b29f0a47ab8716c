//! Every metric of the daemon, declared in one place.
//!
//! Names are `videofields_<room>_<what>_<unit>[_total]`. Labels are bounded by the configuration or by the enums
//! here: camera, stage, reason, pass, route template, status. What rooms count goes in; Prometheus's text format
//! comes out. There is no global: whoever makes a [`Metrics`] hands it to those who count.

mod labels;

pub use labels::{
    DropReason, RecordingDrop, RemovalReason, SnapshotFailure, SnapshotRemoval, Stage, ViewRefusal,
};

use prometheus::core::Collector;
use prometheus::{
    Gauge, GaugeVec, Histogram, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge,
    IntGaugeVec, Opts, Registry, TextEncoder,
};

/// All metrics, with their registry. Counting is cheap and takes `&self`; share it in an `Arc`.
#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    /// Frames that became observations. Labels: camera.
    pub ingest_frames: IntCounterVec,
    /// Frames that did not. Labels: camera, reason ([`DropReason`]).
    pub ingest_frames_dropped: IntCounterVec,
    /// Seconds since a camera's newest frame was seen, set when the metrics are asked for. Labels: camera.
    pub ingest_frame_age: GaugeVec,
    /// Seconds that a stage took for one frame. Labels: camera, stage ([`Stage`]).
    pub ingest_stage: HistogramVec,
    /// Events told. Labels: camera, kind.
    pub ingest_events: IntCounterVec,
    /// Privacy zones in force. Labels: camera.
    pub camera_privacy_zones: IntGaugeVec,
    /// Metres on the ground by which a camera sees people elsewhere than other cameras do, 0 where nothing else can be told.
    /// Labels: camera.
    pub camera_calibration_offset: GaugeVec,
    /// Frames written to the archive. Labels: camera.
    pub archive_frames: IntCounterVec,
    /// Bytes written to the archive. Labels: camera.
    pub archive_bytes: IntCounterVec,
    /// Frames that were to be recorded and were not. Labels: camera, reason ([`RecordingDrop`]).
    pub archive_frames_dropped: IntCounterVec,
    /// 1 while a camera that is to be recorded cannot be. Labels: camera.
    pub archive_paused: IntGaugeVec,
    /// Bytes of all recorded segments.
    pub archive_kept: IntGauge,
    /// Segments that retention removed. Labels: reason ([`RemovalReason`]).
    pub archive_segments_removed: IntCounterVec,
    /// Seconds for which the disk was waited for, once every few seconds of a segment.
    pub archive_sync: Histogram,
    /// Bytes of observations kept. Labels: camera.
    pub timeline_kept: IntGaugeVec,
    /// Instants at which everybody before a scene's cameras was placed.
    pub entities_instants: IntCounter,
    /// Instants that were left out, since placing those before took too long.
    pub entities_instants_skipped: IntCounter,
    /// Seconds that placing everybody at one instant took.
    pub entities_instant: Histogram,
    /// Sightings of entities that were lost while the database failed.
    pub entities_lost: IntCounter,
    /// Seconds from taking a request off the queue to its finished picture.
    pub render_picture: Histogram,
    /// Seconds of one turn of the renderer, which draws a picture or some pieces of one.
    pub render_turn: Histogram,
    /// What a picture took, fusing to reading back, over what was expected.
    pub render_expected_ratio: Histogram,
    /// Seconds of one pass on the GPU. Labels: pass.
    pub render_pass: HistogramVec,
    /// Pictures that wait for the renderer.
    pub render_queue_length: IntGauge,
    /// Seconds from a request for a view to where its picture is begun, or found.
    pub render_wait: Histogram,
    /// Views refused. Labels: reason ([`ViewRefusal`]).
    pub render_refused: IntCounterVec,
    /// Views whose callers left before they were answered.
    pub render_abandoned: IntCounter,
    /// Views answered with the picture that another was drawn for.
    pub render_shared: IntCounter,
    /// Views answered with a picture that was kept.
    pub render_cache_hits: IntCounter,
    /// Pictures that were looked for among those kept, and had to be drawn.
    pub render_cache_misses: IntCounter,
    /// Bytes of finished pictures kept.
    pub render_cache: IntGauge,
    /// Times that the GPU's device was made anew.
    pub render_devices_rebuilt: IntCounter,
    /// Times that a scene was made ready to be drawn before anybody asked for a picture of it.
    pub render_warm_ups: IntCounter,
    /// Snapshots made.
    pub evidence_made: IntCounter,
    /// Snapshots that came to nothing. Labels: reason ([`SnapshotFailure`]).
    pub evidence_failures: IntCounterVec,
    /// Snapshots removed. Labels: reason (`asked`, `bytes`, `age`).
    pub evidence_removed: IntCounterVec,
    /// Snapshots that are there.
    pub evidence_kept: IntGauge,
    /// Bytes of all snapshots.
    pub evidence_kept_bytes: IntGauge,
    /// Number of times that the audit log was found otherwise than it was written.
    pub audit_faults: IntCounter,
    /// Number of times that the newest entry of the audit log could not be told elsewhere.
    pub audit_anchors_failed: IntCounter,
    /// Answered requests. Labels: route (its template, never the path itself), status.
    pub api_requests: IntCounterVec,
    /// Seconds from a request to its answer. Labels: route.
    pub api_request: HistogramVec,
    /// How often the configuration was read again, good or at fault.
    pub config_reloads: IntCounter,
    /// 1 where the configuration was good when it was read last, 0 where it was at fault.
    pub config_reload_success: IntGauge,
    /// When a good one was read last, seconds since 1970.
    pub config_reload_timestamp: Gauge,
    /// Seconds since the last good checkpoint, set when the metrics are asked for.
    pub store_checkpoint_age: Gauge,
    /// Seconds that a checkpoint of one camera's background took.
    pub store_checkpoint: Histogram,
    /// Checkpoints that failed, those for the history included.
    pub store_checkpoints_failed: IntCounter,
}

/// Seconds; from well below one frame's interval to where something hangs.
const FRAME_SECONDS: [f64; 12] = [0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 1.0, 5.0];

/// Seconds; what people and disks wait for.
const REQUEST_SECONDS: [f64; 12] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0];

/// Shares of what was expected; within 15 % lie the three around 1.
const EXPECTED_RATIOS: [f64; 12] = [0.25, 0.5, 0.7, 0.85, 0.93, 1.0, 1.07, 1.15, 1.3, 1.5, 2.0, 4.0];

impl Metrics {
    /// All metrics at zero, in a registry of their own.
    #[must_use]
    pub fn new() -> Self {
        let registry = Registry::new();
        let r = &registry;
        let build = int_gauges(r, "build_info", "Always 1; the labels tell what runs.", &["version"]);
        build.with_label_values(&[env!("CARGO_PKG_VERSION")]).set(1);
        Self {
            ingest_frames: counters(
                r,
                "ingest_frames_total",
                "Frames that became observations.",
                &["camera"],
            ),
            ingest_frames_dropped: counters(
                r,
                "ingest_frames_dropped_total",
                "Frames that never became observations, by reason: overrun, out_of_order.",
                &["camera", "reason"],
            ),
            ingest_frame_age: gauges(
                r,
                "ingest_frame_age_seconds",
                "Time since a camera's newest frame was seen.",
                &["camera"],
            ),
            ingest_stage: histograms(
                r,
                "ingest_stage_seconds",
                "Time of one frame in a stage: background, segment, track.",
                &["camera", "stage"],
                &FRAME_SECONDS,
            ),
            ingest_events: counters(
                r,
                "ingest_events_total",
                "Events told: what stopped, was left behind or taken away, and what happened to the picture.",
                &["camera", "kind"],
            ),
            archive_frames: counters(
                r,
                "archive_frames_total",
                "Frames written to the archive.",
                &["camera"],
            ),
            archive_bytes: counters(r, "archive_bytes_total", "Bytes written to the archive.", &["camera"]),
            archive_frames_dropped: counters(
                r,
                "archive_frames_dropped_total",
                "Frames that were to be recorded and were not, by reason: queue_full, no_key_frame, out_of_order, \
                 overlap, paused, stopping.",
                &["camera", "reason"],
            ),
            camera_privacy_zones: int_gauges(
                r,
                "camera_privacy_zones",
                "Privacy zones in force.",
                &["camera"],
            ),
            camera_calibration_offset: gauges(
                r,
                "camera_calibration_offset_metres",
                "Distance on the ground between where a camera sees people and where other cameras do.",
                &["camera"],
            ),
            archive_paused: int_gauges(
                r,
                "archive_paused",
                "1 while a camera that is to be recorded cannot be.",
                &["camera"],
            ),
            archive_kept: int_gauge(r, "archive_kept_bytes", "Bytes of all recorded segments."),
            archive_segments_removed: counters(
                r,
                "archive_segments_removed_total",
                "Segments that retention removed, by reason: bytes, age.",
                &["reason"],
            ),
            archive_sync: histogram(
                r,
                "archive_sync_seconds",
                "Time for which the disk was waited for when a segment was made safe.",
                &REQUEST_SECONDS,
            ),
            timeline_kept: int_gauges(r, "timeline_kept_bytes", "Observations kept in memory.", &["camera"]),
            entities_instants: counter(
                r,
                "entities_instants_total",
                "Instants at which everybody before a scene's cameras was placed.",
            ),
            entities_instants_skipped: counter(
                r,
                "entities_instants_skipped_total",
                "Instants that were left out, since placing those before took too long.",
            ),
            entities_instant: histogram(
                r,
                "entities_instant_seconds",
                "Time that placing everybody at one instant took.",
                &FRAME_SECONDS,
            ),
            entities_lost: counter(
                r,
                "entities_lost_total",
                "Sightings of entities that were lost while the database failed.",
            ),
            render_picture: histogram(
                r,
                "render_picture_seconds",
                "Time from taking a request off the queue to its finished picture.",
                &REQUEST_SECONDS,
            ),
            render_turn: histogram(
                r,
                "render_turn_seconds",
                "Time of one turn of the renderer, a picture or some pieces of one: what another user's small picture waits for.",
                &REQUEST_SECONDS,
            ),
            render_expected_ratio: histogram(
                r,
                "render_expected_ratio",
                "What a picture took over what was expected before it was drawn.",
                &EXPECTED_RATIOS,
            ),
            render_pass: histograms(
                r,
                "render_pass_seconds",
                "Time of one pass on the GPU.",
                &["pass"],
                &FRAME_SECONDS,
            ),
            render_queue_length: int_gauge(r, "render_queue_length", "Pictures that wait for the renderer."),
            render_wait: histogram(
                r,
                "render_wait_seconds",
                "Time from a request for a view to where its picture is begun or found.",
                &REQUEST_SECONDS,
            ),
            render_refused: views_refused(r),
            render_abandoned: counter(
                r,
                "render_abandoned_total",
                "Views whose callers left before they were answered.",
            ),
            render_shared: counter(
                r,
                "render_shared_total",
                "Views answered with the picture that another was drawn for.",
            ),
            render_cache_hits: counter(
                r,
                "render_cache_hits_total",
                "Views answered with a picture that was kept.",
            ),
            render_cache_misses: counter(
                r,
                "render_cache_misses_total",
                "Pictures that were looked for among those kept, and had to be drawn.",
            ),
            render_cache: int_gauge(r, "render_cache_bytes", "Finished pictures kept."),
            render_devices_rebuilt: counter(
                r,
                "render_devices_rebuilt_total",
                "Times that the GPU's device was made anew.",
            ),
            render_warm_ups: counter(
                r,
                "render_warm_ups_total",
                "Times that a scene was made ready to be drawn before anybody asked for a picture of it.",
            ),
            evidence_made: counter(r, "evidence_snapshots_made_total", "Snapshots made."),
            evidence_failures: snapshot_failures(r),
            evidence_removed: snapshots_removed(r),
            evidence_kept: int_gauge(r, "evidence_kept_snapshots", "Snapshots that are there."),
            evidence_kept_bytes: int_gauge(r, "evidence_kept_bytes", "Bytes of all snapshots."),
            api_requests: counters(
                r,
                "api_requests_total",
                "Answered requests by route template and status.",
                &["route", "status"],
            ),
            api_request: histograms(
                r,
                "api_request_seconds",
                "Time from a request to its answer.",
                &["route"],
                &REQUEST_SECONDS,
            ),
            audit_faults: counter(
                r,
                "audit_faults_total",
                "Times that the audit log was found otherwise than this daemon wrote it.",
            ),
            audit_anchors_failed: counter(
                r,
                "audit_anchors_failed_total",
                "Times that the newest entry of the audit log could not be told elsewhere.",
            ),
            config_reloads: counter(
                r,
                "config_reloads_total",
                "Times that the configuration was read again, good or at fault.",
            ),
            config_reload_success: int_gauge(
                r,
                "config_reload_success",
                "1 where the configuration was good when it was read last, 0 where it was at fault.",
            ),
            config_reload_timestamp: gauge(
                r,
                "config_reload_timestamp_seconds",
                "When a good configuration was read last, seconds since 1970.",
            ),
            store_checkpoint_age: gauge(
                r,
                "store_checkpoint_age_seconds",
                "Time since the last good checkpoint of the backgrounds.",
            ),
            store_checkpoint: histogram(
                r,
                "store_checkpoint_seconds",
                "Time of a checkpoint of one camera's background.",
                &REQUEST_SECONDS,
            ),
            store_checkpoints_failed: counter(
                r,
                "store_checkpoints_failed_total",
                "Checkpoints that failed, those for the history included.",
            ),
            registry,
        }
    }

    /// Notes how long a stage took for one frame.
    pub fn observe_stage(&self, camera: &str, stage: Stage, seconds: f64) {
        self.ingest_stage.with_label_values(&[camera, stage.as_str()]).observe(seconds);
    }

    /// Notes `n` dropped frames.
    pub fn count_dropped(&self, camera: &str, reason: DropReason, n: u64) {
        self.ingest_frames_dropped.with_label_values(&[camera, reason.as_str()]).inc_by(n);
    }

    /// Notes a frame that was to be recorded and was not.
    pub fn count_unrecorded(&self, camera: &str, reason: RecordingDrop) {
        self.archive_frames_dropped.with_label_values(&[camera, reason.as_str()]).inc();
    }

    /// Notes a view that was refused.
    pub fn count_refused(&self, reason: ViewRefusal) {
        self.render_refused.with_label_values(&[reason.as_str()]).inc();
    }

    /// Notes a snapshot that came to nothing.
    pub fn count_snapshot_failure(&self, reason: SnapshotFailure) {
        self.evidence_failures.with_label_values(&[reason.as_str()]).inc();
    }

    /// Notes a snapshot that was removed.
    pub fn count_snapshot_removed(&self, reason: SnapshotRemoval) {
        self.evidence_removed.with_label_values(&[reason.as_str()]).inc();
    }

    /// Notes a segment that retention removed.
    pub fn count_removed(&self, reason: RemovalReason) {
        self.archive_segments_removed.with_label_values(&[reason.as_str()]).inc();
    }

    /// Makes the series of a camera that is recorded appear at zero.
    pub fn announce_recording(&self, camera: &str) {
        self.archive_frames.with_label_values(&[camera]).inc_by(0);
        self.archive_bytes.with_label_values(&[camera]).inc_by(0);
        self.archive_paused.with_label_values(&[camera]).add(0);
        for reason in RecordingDrop::ALL {
            self.archive_frames_dropped.with_label_values(&[camera, reason.as_str()]).inc_by(0);
        }
        for reason in RemovalReason::ALL {
            self.archive_segments_removed.with_label_values(&[reason.as_str()]).inc_by(0);
        }
    }

    /// Notes an answered request; `route` is the template, such as `/api/v1/scenes/{id}`.
    pub fn observe_request(&self, route: &str, status: u16, seconds: f64) {
        self.api_requests.with_label_values(&[route, &status.to_string()]).inc();
        self.api_request.with_label_values(&[route]).observe(seconds);
    }

    /// Makes a camera's series appear at zero, so that rates are right from its first frame.
    pub fn announce_camera(&self, camera: &str) {
        self.ingest_frames.with_label_values(&[camera]).inc_by(0);
        self.timeline_kept.with_label_values(&[camera]).add(0);
        self.camera_privacy_zones.with_label_values(&[camera]).add(0);
        self.camera_calibration_offset.with_label_values(&[camera]).add(0.0);
        for reason in DropReason::ALL {
            self.ingest_frames_dropped.with_label_values(&[camera, reason.as_str()]).inc_by(0);
        }
        for stage in Stage::ALL {
            // To ask for a series is to make it; there is nothing to observe yet.
            self.ingest_stage.with_label_values(&[camera, stage.as_str()]).get_sample_count();
        }
    }

    /// Takes up counters that were there before: what became of traces' spans.
    ///
    /// # Errors
    /// When there are others of that name.
    pub fn adopt(&self, counters: &IntCounterVec) -> Result<(), prometheus::Error> {
        self.registry.register(Box::new(counters.clone()))
    }

    /// Drops every series of a camera that is gone, of events those of `kinds`: what is known of it does not change any more.
    pub fn forget_camera(&self, camera: &str, kinds: impl IntoIterator<Item = &'static str>) {
        // A series that there never was cannot be removed, which is as good.
        for counter in [&self.ingest_frames, &self.archive_frames, &self.archive_bytes] {
            drop(counter.remove_label_values(&[camera]));
        }
        for gauge in [&self.archive_paused, &self.timeline_kept, &self.camera_privacy_zones] {
            drop(gauge.remove_label_values(&[camera]));
        }
        drop(self.ingest_frame_age.remove_label_values(&[camera]));
        drop(self.camera_calibration_offset.remove_label_values(&[camera]));
        for reason in DropReason::ALL {
            drop(self.ingest_frames_dropped.remove_label_values(&[camera, reason.as_str()]));
        }
        for reason in RecordingDrop::ALL {
            drop(self.archive_frames_dropped.remove_label_values(&[camera, reason.as_str()]));
        }
        for stage in Stage::ALL {
            drop(self.ingest_stage.remove_label_values(&[camera, stage.as_str()]));
        }
        for kind in kinds {
            drop(self.ingest_events.remove_label_values(&[camera, kind]));
        }
    }

    /// All metrics in Prometheus's text format, version 0.0.4.
    #[must_use]
    pub fn encode(&self) -> String {
        TextEncoder::new()
            .encode_to_string(&self.registry.gather())
            .expect("text is written to memory, and every family has a name and a type")
    }
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}

fn options(name: &str, help: &str) -> Opts {
    Opts::new(format!("videofields_{name}"), help)
}

fn register<C: Collector + Clone + 'static>(registry: &Registry, made: prometheus::Result<C>) -> C {
    let collector = made.expect("the names and labels in this file are well formed");
    registry.register(Box::new(collector.clone())).expect("the names in this file are unique");
    collector
}

fn counter(registry: &Registry, name: &str, help: &str) -> IntCounter {
    register(registry, IntCounter::with_opts(options(name, help)))
}

fn counters(registry: &Registry, name: &str, help: &str, labels: &[&str]) -> IntCounterVec {
    register(registry, IntCounterVec::new(options(name, help), labels))
}

/// The counter of refused views, each of its series at zero.
fn views_refused(registry: &Registry) -> IntCounterVec {
    let refused = counters(
        registry,
        "render_refused_total",
        "Views refused, by reason: queue_full, queue_bytes, user_share, user_bytes, late, no_renderer, deadline.",
        &["reason"],
    );
    for reason in ViewRefusal::ALL {
        refused.with_label_values(&[reason.as_str()]).inc_by(0);
    }
    refused
}

/// The counter of snapshots that came to nothing, each of its series at zero.
fn snapshot_failures(registry: &Registry) -> IntCounterVec {
    let failures = counters(
        registry,
        "evidence_failures_total",
        "Snapshots that came to nothing, by reason: no_room, busy, no_picture, gone, disk, database, internal.",
        &["reason"],
    );
    for reason in SnapshotFailure::ALL {
        failures.with_label_values(&[reason.as_str()]).inc_by(0);
    }
    failures
}

/// The counter of snapshots that were removed, each of its series at zero.
fn snapshots_removed(registry: &Registry) -> IntCounterVec {
    let removed = counters(
        registry,
        "evidence_removed_total",
        "Snapshots removed, by reason: asked, bytes, age.",
        &["reason"],
    );
    for reason in SnapshotRemoval::ALL {
        removed.with_label_values(&[reason.as_str()]).inc_by(0);
    }
    removed
}

fn gauge(registry: &Registry, name: &str, help: &str) -> Gauge {
    register(registry, Gauge::with_opts(options(name, help)))
}

fn gauges(registry: &Registry, name: &str, help: &str, labels: &[&str]) -> GaugeVec {
    register(registry, GaugeVec::new(options(name, help), labels))
}

fn int_gauge(registry: &Registry, name: &str, help: &str) -> IntGauge {
    register(registry, IntGauge::with_opts(options(name, help)))
}

fn int_gauges(registry: &Registry, name: &str, help: &str, labels: &[&str]) -> IntGaugeVec {
    register(registry, IntGaugeVec::new(options(name, help), labels))
}

fn histogram(registry: &Registry, name: &str, help: &str, buckets: &[f64]) -> Histogram {
    let options = HistogramOpts::from(options(name, help)).buckets(buckets.to_vec());
    register(registry, Histogram::with_opts(options))
}

fn histograms(registry: &Registry, name: &str, help: &str, labels: &[&str], buckets: &[f64]) -> HistogramVec {
    let options = HistogramOpts::from(options(name, help)).buckets(buckets.to_vec());
    register(registry, HistogramVec::new(options, labels))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn used() -> Metrics {
        let metrics = Metrics::new();
        metrics.announce_camera("north");
        metrics.announce_recording("north");
        metrics.ingest_frame_age.with_label_values(&["north"]).set(0.5);
        metrics.render_pass.with_label_values(&["surface"]).observe(0.002);
        metrics.observe_request("/api/v1/scenes/{id}", 200, 0.01);
        metrics
    }

    #[test]
    fn the_names_and_labels_are_those_of_the_golden_list() {
        let text = used().encode();
        let mut lines: Vec<String> = text
            .lines()
            .filter_map(|line| line.strip_prefix("# TYPE "))
            .map(|family| {
                let (name, kind) = family.split_once(' ').expect("a name and a type");
                let sample = text.lines().find(|line| line.starts_with(name)).expect("a sample");
                let labels = sample.split_once('{').map_or("", |(_, rest)| rest);
                let labels: Vec<_> = labels
                    .split("\",")
                    .filter_map(|label| label.split_once('='))
                    .map(|(label, _)| label)
                    .filter(|label| *label != "le")
                    .collect();
                format!("{name} {kind} {{{}}}", labels.join(",")).replace(" {}", "")
            })
            .collect();
        lines.sort();
        assert_eq!(lines.join("\n") + "\n", include_str!("../../../tests/golden/metrics.txt"));
    }

    #[test]
    fn every_metric_has_a_help_text() {
        let text = used().encode();
        for family in text.lines().filter_map(|line| line.strip_prefix("# HELP ")) {
            let (name, help) = family.split_once(' ').expect("a name and a help text");
            assert!(name.starts_with("videofields_") && help.ends_with('.'), "{family}");
        }
        let count = |prefix: &str| text.lines().filter(|line| line.starts_with(prefix)).count();
        assert_eq!(count("# HELP "), count("# TYPE "));
    }

    #[test]
    fn what_is_counted_is_told() {
        let metrics = used();
        metrics.ingest_frames.with_label_values(&["north"]).inc();
        metrics.count_dropped("north", DropReason::Overrun, 1);
        metrics.observe_stage("north", Stage::Segment, 0.003);
        let text = metrics.encode();
        for line in [
            "videofields_ingest_frames_total{camera=\"north\"} 1",
            "videofields_ingest_frames_dropped_total{camera=\"north\",reason=\"overrun\"} 1",
            "videofields_ingest_frames_dropped_total{camera=\"north\",reason=\"out_of_order\"} 0",
            "videofields_ingest_stage_seconds_bucket{camera=\"north\",stage=\"segment\",le=\"0.005\"} 1",
            "videofields_ingest_stage_seconds_count{camera=\"north\",stage=\"background\"} 0",
            "videofields_api_requests_total{route=\"/api/v1/scenes/{id}\",status=\"200\"} 1",
        ] {
            assert!(text.lines().any(|told| told == line), "{line} is not in\n{text}");
        }
    }

    #[test]
    fn two_registries_do_not_meet() {
        let (one, other) = (used(), Metrics::new());
        one.store_checkpoints_failed.inc();
        assert_eq!((one.store_checkpoints_failed.get(), other.store_checkpoints_failed.get()), (1, 0));
    }
}
