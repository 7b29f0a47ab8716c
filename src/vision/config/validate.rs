//! What the types of the settings cannot say: ranges, ids, and keys that need one another.

use super::settings::{CameraSettings, Learning, SceneSettings, SegmentSettings, ServerSettings, Settings};
use crate::error::{Gatherer, unknown};
use crate::frame::is_id;
use std::collections::HashSet;
use std::path::Path;

/// Most cameras, those that are made through the API included.
pub const MAX_CAMERAS: usize = 256;
/// Most scenes of one configuration.
pub(super) const MAX_SCENES: usize = 64;
/// Most snapshots that are made by themselves.
pub(super) const MAX_SNAPSHOTS: usize = 64;
const MAX_ROOTS: usize = 64;
const MAX_NETWORKS: usize = 64;
const MAX_HOSTS: usize = 64;
const MAX_NAME_CHARS: usize = 200;
const MAX_PATH_BYTES: usize = 4096;

/// The ids met so far.
#[derive(Debug, Default)]
pub(super) struct Ids {
    pub(super) credentials: HashSet<String>,
    cameras: HashSet<String>,
    scenes: HashSet<String>,
    pub(super) snapshots: HashSet<String>,
}

/// Checks everything.
pub(super) fn check(settings: &Settings, gatherer: &mut Gatherer) {
    check_server(&settings.server, gatherer);
    check_path(&settings.storage.database, "/storage/database", gatherer);
    super::storage::check(&settings.storage, gatherer);
    super::archive::check(&settings.archive, gatherer);
    super::telling::check(&settings.telemetry, gatherer);
    if !(1..=MAX_ROOTS).contains(&settings.media.roots.len()) {
        let message = format!("expected 1 to {MAX_ROOTS} folders, got {}", settings.media.roots.len());
        gatherer.fault("/media/roots", message);
    }
    for (i, root) in settings.media.roots.iter().enumerate() {
        check_path(root, &format!("/media/roots/{i}"), gatherer);
    }
    let n_networks = settings.media.networks.len();
    if n_networks > MAX_NETWORKS {
        gatherer.fault("/media/networks", format!("at most {MAX_NETWORKS} are allowed, got {n_networks}"));
    }
    let mib = f64::from(settings.timeline.mib_per_camera);
    range(gatherer, "/timeline/mib_per_camera", mib, 8.0, 65_536.0, "MiB");
    let mib = f64::from(settings.timeline.replay_mib);
    range(gatherer, "/timeline/replay_mib", mib, 32.0, 65_536.0, "MiB");
    range(gatherer, "/entities/rate_hz", settings.entities.rate_hz, 0.0, 25.0, "times a second");
    let render = &settings.render;
    check_text(&render.adapter, "/render/adapter", gatherer);
    if !matches!(render.samples, 1 | 4) {
        gatherer.fault("/render/samples", format!("expected 1 or 4, got {}", render.samples));
    }
    if !matches!(render.depth_map_side_px, 256 | 512 | 1024 | 2048 | 4096) {
        let message =
            format!("expected 256, 512, 1024, 2048 or 4096 texels, got {}", render.depth_map_side_px);
        gatherer.fault("/render/depth_map_side_px", message);
    }
    range(gatherer, "/render/max_pixels", render.max_pixels as f64, 1.0, 268_435_456.0, "pixels");
    range(gatherer, "/render/queue_length", render.queue_length as f64, 1.0, 1024.0, "pictures");
    range(gatherer, "/render/timeout_secs", render.timeout_secs, 0.1, 10.0, "seconds");
    range(gatherer, "/render/cache_mib", f64::from(render.cache_mib), 0.0, 65_536.0, "MiB");
    let mut ids = Ids::default();
    for (key, count, most) in [
        ("/credentials", settings.credentials.len(), super::credentials::MAX_CREDENTIALS),
        ("/camera", settings.camera.len(), MAX_CAMERAS),
        ("/scene", settings.scene.len(), MAX_SCENES),
        ("/snapshot", settings.snapshot.len(), MAX_SNAPSHOTS),
    ] {
        if count > most {
            gatherer.fault(key, format!("at most {most} are allowed, got {count}"));
        }
    }
    for (i, login) in settings.credentials.iter().enumerate() {
        super::credentials::check(login, &format!("/credentials/{i}"), &mut ids, gatherer);
    }
    for (i, camera) in settings.camera.iter().enumerate() {
        check_camera(camera, &format!("/camera/{i}"), &mut ids, gatherer);
    }
    for (i, scene) in settings.scene.iter().enumerate() {
        check_scene(scene, &format!("/scene/{i}"), &mut ids, gatherer);
    }
    for (i, schedule) in settings.snapshot.iter().enumerate() {
        super::snapshot::check(schedule, &format!("/snapshot/{i}"), &mut ids, gatherer);
    }
}

fn check_server(server: &ServerSettings, gatherer: &mut Gatherer) {
    if !server.listen.ip().is_loopback() && !server.is_encrypted() {
        let message = format!(
            "{} can be reached from other machines, and passwords and pictures would go there unencrypted: set \
             `certificate` and `private_key`, or listen on a loopback address (127.0.0.1 or [::1]) and put a proxy with \
             TLS before it",
            server.listen.ip()
        );
        gatherer.fault("/server/listen", message);
    }
    let pair = [("certificate", &server.certificate), ("private_key", &server.private_key)];
    for (i, (key, path)) in pair.iter().enumerate() {
        let (other, other_path) = pair[1 - i];
        match path.as_os_str().is_empty() {
            true if !other_path.as_os_str().is_empty() => {
                gatherer.fault(format!("/server/{key}"), format!("`{other}` needs a `{key}` beside it"));
            }
            true => {}
            false => check_path(path, &format!("/server/{key}"), gatherer),
        }
    }
    let hosts = &server.hosts;
    if hosts.len() > MAX_HOSTS {
        gatherer
            .fault("/server/hosts", format!("at most {MAX_HOSTS} names are allowed, got {}", hosts.len()));
    }
    let n_proxies = server.trusted_proxies.len();
    if n_proxies > MAX_NETWORKS {
        gatherer
            .fault("/server/trusted_proxies", format!("at most {MAX_NETWORKS} are allowed, got {n_proxies}"));
    }
    for (i, host) in hosts.iter().enumerate() {
        let is_name = (1..=253).contains(&host.len())
            && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_'));
        if !is_name {
            let message = "expected a name of letters, digits, `.`, `-` and `_`, without scheme and port";
            gatherer.fault(format!("/server/hosts/{i}"), message.to_owned());
        }
    }
}

/// Checks the camera at `place`.
pub(super) fn check_camera(camera: &CameraSettings, place: &str, ids: &mut Ids, gatherer: &mut Gatherer) {
    if !ids.cameras.insert(camera.id.to_string()) {
        gatherer
            .fault(format!("{place}/id"), format!("there is another camera `{}`; ids are unique", camera.id));
    }
    check_text(&camera.name, &format!("{place}/name"), gatherer);
    super::source::check(&camera.source, &format!("{place}/source"), gatherer);
    if let Some(named) = &camera.source.credentials
        && !ids.credentials.contains(named)
    {
        let mut known: Vec<&str> = ids.credentials.iter().map(String::as_str).collect();
        known.sort_unstable();
        gatherer.fault(format!("{place}/source/credentials"), unknown("credentials", named, &known));
    }
    super::clock::check(&camera.clock, &camera.source, &format!("{place}/clock"), gatherer);

    crate::frame::check_zones(&camera.privacy_zones, &format!("{place}/privacy_zones"), gatherer);

    let background = &camera.background;
    let at = |key: &str| format!("{place}/background/{key}");
    let numbers = [
        ("modes", background.modes as f64, 1.0, 5.0, "modes"),
        ("tau_secs", background.tau_secs, 0.1, 1e7, "seconds"),
        ("match_threshold", background.match_threshold, 9.0, 16.0, "(squared distance over variance)"),
        ("background_ratio", background.background_ratio, 0.1, 0.99, "(share of the weights)"),
        ("variance_init", background.variance_init, 0.1, 10_000.0, "8-bit levels squared"),
        ("variance_min", background.variance_min, 0.01, 10_000.0, "8-bit levels squared"),
        ("variance_max", background.variance_max, 0.1, 65_025.0, "8-bit levels squared"),
        ("chroma_scale", background.chroma_scale, 0.25, 8.0, "(luma's noise over chroma's)"),
        ("max_step_secs", background.max_step_secs, 0.001, 3600.0, "seconds"),
    ];
    for (key, value, least, most, unit) in numbers {
        range(gatherer, &at(key), value, least, most, unit);
    }
    let (min, init, max) = (background.variance_min, background.variance_init, background.variance_max);
    let is_ordered = min <= init && init <= max;
    // Judged only when the three themselves are sound: a default that stands in for a fault would mislead.
    if !is_ordered && !gatherer.is_faulty(&format!("{place}/background")) {
        let message = format!("variance_min {min} <= variance_init {init} <= variance_max {max} must hold");
        gatherer.fault(at("variance_init"), message);
    }
    match &background.clip {
        Some(clip) => check_path(clip, &at("clip"), gatherer),
        None if background.learning == Learning::Hold && !gatherer.is_faulty(&at("clip")) => {
            gatherer.fault(at("learning"), "`hold` needs a `clip` from which the background was learned");
        }
        None => {}
    }

    check_segment(&camera.segment, &format!("{place}/segment"), gatherer);
    let track = &camera.track;
    let at = |key: &str| format!("{place}/track/{key}");
    range(gatherer, &at("max_miss_secs"), track.max_miss_secs, 0.05, 60.0, "seconds");
    range(gatherer, &at("confirm_secs"), track.confirm_secs, 0.0, 10.0, "seconds");
    range(gatherer, &at("stop_after_secs"), track.stop_after_secs, 0.5, 86_400.0, "seconds");
    range(gatherer, &at("absorb_after_secs"), track.absorb_after_secs, 0.0, 1e7, "seconds");

    let condition = &camera.condition;
    let at = |key: &str| format!("{place}/condition/{key}");
    let numbers = [
        ("frozen_after_secs", condition.frozen_after_secs, 1.0, 3600.0),
        ("begin_after_secs", condition.begin_after_secs, 0.5, 60.0),
        ("accept_after_secs", condition.accept_after_secs, 10.0, 1e7),
    ];
    for (key, value, least, most) in numbers {
        range(gatherer, &at(key), value, least, most, "seconds");
    }
}

/// Checks how foreground is found, at `place`.
pub(super) fn check_segment(segment: &SegmentSettings, place: &str, gatherer: &mut Gatherer) {
    let at = |key: &str| format!("{place}/{key}");
    let numbers = [
        ("delta", segment.delta(), 0.001, 1.0, "(share of full scale)"),
        ("delta_high", segment.delta_high, 0.0, 1.0, "(share of full scale)"),
        ("blur_sigma_px", segment.blur_sigma_px.unwrap_or(1.5), 0.0, 16.0, "pixels"),
        ("shadow_darkest", segment.shadow_darkest, 0.05, 1.0, "(share of the background's luma)"),
        ("shadow_chroma", segment.shadow_chroma, 0.0, 0.5, "(share of full scale)"),
        ("highlight_brightest", segment.highlight_brightest, 1.0, 4.0, "(times the background's luma)"),
        ("close_radius_px", f64::from(segment.close_radius_px), 0.0, 16.0, "pixels"),
        ("max_hole_px", f64::from(segment.max_hole_px), 0.0, 1e9, "pixels"),
        ("min_area_px", f64::from(segment.min_area_px), 0.0, 1e9, "pixels"),
        ("split_valley", segment.split_valley, 0.0, 0.9, "(share of the pixels beside it)"),
    ];
    for (key, value, least, most, unit) in numbers {
        range(gatherer, &at(key), value, least, most, unit);
    }
}

/// Checks the scene at `place`.
pub(super) fn check_scene(scene: &SceneSettings, place: &str, ids: &mut Ids, gatherer: &mut Gatherer) {
    let id = format!("{place}/id");
    if !is_id(&scene.id) {
        let message = format!("invalid id {:?}: {}", scene.id, crate::frame::IdError);
        gatherer.fault(id, message);
    } else if !ids.scenes.insert(scene.id.clone()) {
        gatherer.fault(id, format!("there is another scene `{}`; ids are unique", scene.id));
    }
    check_path(&scene.file, &format!("{place}/file"), gatherer);
}

/// Refuses a number that is not within `least` and `most`.
pub(super) fn range(gatherer: &mut Gatherer, place: &str, value: f64, least: f64, most: f64, unit: &str) {
    // Written so that NaN is outside.
    if !(least..=most).contains(&value) {
        gatherer.fault(place, format!("expected {least} to {most} {unit}, got {value}"));
    }
}

/// Refuses what can be no name for people.
pub(super) fn check_text(text: &str, place: &str, gatherer: &mut Gatherer) {
    if text.chars().count() > MAX_NAME_CHARS || text.chars().any(char::is_control) {
        let message =
            format!("expected at most {MAX_NAME_CHARS} characters, none of them a control character");
        gatherer.fault(place, message);
    }
}

/// Refuses what can be no path.
pub(super) fn check_path(path: &Path, place: &str, gatherer: &mut Gatherer) {
    let bytes = path.as_os_str().as_encoded_bytes();
    if bytes.is_empty() || bytes.len() > MAX_PATH_BYTES || bytes.contains(&0) {
        gatherer.fault(place, format!("expected a path of 1 to {MAX_PATH_BYTES} bytes, none of them NUL"));
    }
}
