//! The settings as they are written: every key with its meaning, unit, range and default.

use super::archive::ArchiveSettings;
use super::clock::ClockSettings;
use super::credentials::CredentialsSettings;
use super::network::{self, Network};
use super::resolution::Resolution;
use super::snapshot::SnapshotScheduleSettings;
use super::source::SourceSettings;
use super::stage_choice::StageChoice;
use super::storage::StorageSettings;
use super::telling::{LogSettings, TelemetrySettings};
use crate::frame::{CameraId, Zone};
use crate::private_files::{MediaFolders, PrivateFiles};
use serde::de::{self, Deserializer};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::net::SocketAddr;
use std::path::PathBuf;

/// The whole configuration. Relative paths start at the configuration file's folder.
#[derive(Clone, Debug, PartialEq, Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The HTTP server.
    pub server: ServerSettings,
    /// The database.
    pub storage: StorageSettings,
    /// The recordings.
    pub archive: ArchiveSettings,
    /// Where media may be read from.
    pub media: MediaSettings,
    /// What is kept of the past.
    pub timeline: TimelineSettings,
    /// Placing of people and other entities.
    pub entities: EntitySettings,
    /// The renderer.
    pub render: RenderSettings,
    /// What is measured of the machine.
    pub accuracy: AccuracySettings,
    /// The log.
    pub log: LogSettings,
    /// Traces of requests.
    pub telemetry: TelemetrySettings,
    /// Logins by name; ids are unique; at most 64.
    pub credentials: Vec<CredentialsSettings>,
    /// The cameras, in any order; ids are unique; at most 256.
    pub camera: Vec<CameraSettings>,
    /// The scenes, the default one first; ids are unique; at most 64.
    pub scene: Vec<SceneSettings>,
    /// Snapshots that the daemon makes by itself; ids are unique; at most 64.
    pub snapshot: Vec<SnapshotScheduleSettings>,
}

impl Settings {
    /// Returns the files that the daemon keeps for itself by these settings.
    #[must_use]
    pub fn private_files(&self) -> PrivateFiles {
        let mut folders = vec![self.storage.snapshot_folder.clone()];
        folders.extend(self.archive.is_on().then(|| self.archive.folder.clone()));
        folders.retain(|folder| !folder.as_os_str().is_empty());
        PrivateFiles::new(folders, Some(self.storage.database.clone()))
    }

    /// Returns the folders beneath which scenes' files and cameras' sources may lie.
    #[must_use]
    pub fn media_folders(&self) -> MediaFolders {
        MediaFolders { roots: self.media.roots.clone(), private: self.private_files() }
    }
}

/// The HTTP server.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServerSettings {
    /// Address and port. Others than loopback addresses need a certificate, and users. Default 127.0.0.1:8080.
    #[serde(deserialize_with = "listen_address")]
    pub listen: SocketAddr,
    /// Names, without port, by which browsers may address the daemon beside IP addresses and `localhost`, such as the
    /// one of a proxy before it; a page of any other name gets nothing. At most 64. Default none.
    pub hosts: Vec<String>,
    /// Addresses, or blocks of them, of proxies before the daemon, at most 64: where they ask, the address in their `X-Forwarded-For` or
    /// `Forwarded` counts as the caller's, by which strangers are limited. Default none.
    pub trusted_proxies: Vec<Network>,
    /// A certificate with its chain, PEM: connections are encrypted with it (TLS 1.2 and 1.3). Empty encrypts nothing.
    /// Read again once a minute and on SIGHUP. Default empty.
    pub certificate: PathBuf,
    /// The certificate's private key, PEM, not encrypted. Default empty.
    pub private_key: PathBuf,
}

impl Default for ServerSettings {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from(([127, 0, 0, 1], 8080)),
            hosts: Vec::new(),
            trusted_proxies: Vec::new(),
            certificate: PathBuf::new(),
            private_key: PathBuf::new(),
        }
    }
}

impl ServerSettings {
    /// Whether connections are encrypted.
    #[must_use]
    pub fn is_encrypted(&self) -> bool {
        !self.certificate.as_os_str().is_empty()
    }
}

/// Where media may be read from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MediaSettings {
    /// Folders beneath which file sources may open files (symbolic links resolved first). What the daemon keeps itself
    /// (recordings, exports, snapshots, databases) is never opened, wherever it lies. Default: the folder `media` beside the
    /// configuration file. 1 to 64 of them.
    pub roots: Vec<PathBuf>,
    /// Blocks of addresses at which cameras may be reached, at most 64. 169.254.169.254 and `fd00:ec2::254`, where clouds
    /// tell a machine its own keys, are reached only where they are named alone. Default: private, loopback and
    /// link-local addresses.
    pub networks: Vec<Network>,
}

impl Default for MediaSettings {
    fn default() -> Self {
        Self { roots: vec![PathBuf::from("media")], networks: network::usual() }
    }
}

/// What is kept of the past.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TimelineSettings {
    /// MiB of observations kept for each camera, 8 to 65536; the oldest go first. Default 256.
    pub mib_per_camera: u32,
    /// MiB of decoders that stand by where recordings are played, 32 to 65536: one takes about 33 MiB for 1280 x 720 and 75
    /// for 1920 x 1080, and a camera without one is sought anew for each frame. Default 512.
    pub replay_mib: u32,
}

impl Default for TimelineSettings {
    fn default() -> Self {
        Self { mib_per_camera: 256, replay_mib: 512 }
    }
}

/// The renderer.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RenderSettings {
    /// Part of the name of the GPU to use, whatever its case; empty takes the best. Default empty.
    pub adapter: String,
    /// Samples a pixel for smooth edges: 1 or 4. Default 4.
    pub samples: u32,
    /// Texels each way of the depth maps that tell what hides surfaces from a camera: 256, 512, 1024, 2048 or 4096.
    /// Default 1024.
    pub depth_map_side_px: u32,
    /// Most pixels of one picture, 1 to 268435456; each side is also held to the GPU's limit. Default 33177600
    /// (7680 x 4320).
    pub max_pixels: u64,
    /// Pictures that may wait for the renderer before more are refused, 1 to 1024; who asks for one that waits already
    /// adds none. Default 32.
    pub queue_length: usize,
    /// Longest that a picture is waited for before it is refused, seconds, 0.1 to 10. Default 8.
    pub timeout_secs: f64,
    /// Finished pictures that are kept to be shown again, MiB, 0 (none) to 65536. Default 64.
    pub cache_mib: u32,
    /// Whether scenes and the device's programs are made ready while nobody asks for a picture, so that the first one does not
    /// wait for them and may have a short deadline. Default true.
    pub warm_up: bool,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            adapter: String::new(),
            samples: 4,
            depth_map_side_px: 1024,
            max_pixels: 33_177_600,
            queue_length: 32,
            timeout_secs: 8.0,
            cache_mib: 64,
            warm_up: true,
        }
    }
}

/// Placing of people and other entities.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EntitySettings {
    /// Times a second at which everybody who is before a scene's cameras is placed, whether anyone asks or not, 0 to 25. With 0 they are
    /// placed when somebody asks, and of the past by the cameras' tracks. Default 5.
    pub rate_hz: f64,
}

impl Default for EntitySettings {
    fn default() -> Self {
        Self { rate_hz: 5.0 }
    }
}

/// What is measured of the machine.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AccuracySettings {
    /// Whether the daemon, once it has started, measures what each step of accuracy costs on this machine, if it has
    /// not before: at most 30 s, and never while a view is asked for. Default true.
    pub measure_at_start: bool,
}

impl Default for AccuracySettings {
    fn default() -> Self {
        Self { measure_at_start: true }
    }
}

/// One camera.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSettings {
    /// Id: 1 to 64 of a-z, 0-9, - and _.
    pub id: CameraId,
    /// Name for people, at most 200 characters, none of them a control character. Default: the id.
    #[serde(default)]
    pub name: String,
    /// Whether frames are taken from its source at all. Default true.
    #[serde(default = "default_enabled")]
    pub enabled: bool,
    /// Where its frames come from.
    pub source: SourceSettings,
    /// What is wrong with its clock.
    #[serde(default)]
    pub clock: ClockSettings,
    /// Whether its stream is recorded where `archive.folder` is set. Default true.
    #[serde(default = "default_record")]
    pub record: bool,
    /// Whether its background is learned and what moves is found; without, its pictures are shown and recorded as they are,
    /// at no other cost. Default true.
    #[serde(default = "default_vision")]
    pub vision: bool,
    /// What of its picture nobody may see, at most 32 zones: filled before anything is done with a picture. What is changed
    /// through the API stands before this. Default none.
    #[serde(default)]
    pub privacy_zones: Vec<Zone>,
    /// How its background is learned.
    #[serde(default)]
    pub background: BackgroundSettings,
    /// How its foreground is found.
    #[serde(default)]
    pub segment: SegmentSettings,
    /// How what moves is followed.
    #[serde(default)]
    pub track: TrackSettings,
    /// How its picture is watched for what makes it useless.
    #[serde(default)]
    pub condition: ConditionSettings,
}

impl CameraSettings {
    /// A camera with the default of everything but its id and source.
    #[must_use]
    pub fn new(id: CameraId, source: SourceSettings) -> Self {
        Self {
            id,
            name: String::new(),
            enabled: default_enabled(),
            source,
            clock: ClockSettings::default(),
            record: default_record(),
            vision: default_vision(),
            privacy_zones: Vec::new(),
            background: BackgroundSettings::default(),
            segment: SegmentSettings::default(),
            track: TrackSettings::default(),
            condition: ConditionSettings::default(),
        }
    }
}

const fn default_enabled() -> bool {
    true
}

const fn default_vision() -> bool {
    true
}

const fn default_record() -> bool {
    true
}

/// An address and a port.
fn listen_address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SocketAddr, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse().map_err(|error| {
        de::Error::custom(format!("{error}: expected an address and a port, such as 127.0.0.1:8080"))
    })
}

/// How a background is learned: the Gaussian mixture's parameters.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BackgroundSettings {
    /// Modes a pixel, 1 to 5. Default 3.
    pub modes: usize,
    /// Seconds in which the past fades to 1/e, 0.1 to 1e7. Default 300.
    pub tau_secs: f64,
    /// Match threshold c^2: squared distance over variance, 9 to 16. Default 11.3, the 99 % point of chi-squared
    /// with 3 degrees of freedom.
    pub match_threshold: f64,
    /// Share of the weights that is background, 0.1 to 0.99. Default 0.7.
    pub background_ratio: f64,
    /// Variance of a new mode, 8-bit levels squared, 0.1 to 10000 and within `variance_min` and `variance_max`.
    /// Default 15.
    pub variance_init: f64,
    /// Least variance, 8-bit levels squared, 0.01 to 10000. Default 4.
    pub variance_min: f64,
    /// Greatest variance, 8-bit levels squared, 0.1 to 65025. Default 75.
    pub variance_max: f64,
    /// How many times less noise chroma has than luma, 0.25 to 8: chroma differences count so many times. Default
    /// 2, which averaging 2 x 2 samples gives; codecs often leave 3 and more.
    pub chroma_scale: f64,
    /// Longest time that one frame stands for, seconds, 0.001 to 3600: a gap in the stream teaches no more than
    /// this. Default 2.
    pub max_step_secs: f64,
    /// A clip (or pattern of pictures) of the empty place that is learned first. Default: none.
    pub clip: Option<PathBuf>,
    /// What follows the clip. Default `adapt`.
    pub learning: Learning,
}

impl Default for BackgroundSettings {
    fn default() -> Self {
        Self {
            modes: 3,
            tau_secs: 300.0,
            match_threshold: 11.3,
            background_ratio: 0.7,
            variance_init: 15.0,
            variance_min: 4.0,
            variance_max: 75.0,
            chroma_scale: 2.0,
            max_step_secs: 2.0,
            clip: None,
            learning: Learning::Adapt,
        }
    }
}

/// Whether a background goes on learning once its clip was learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Learning {
    /// It follows slow changes.
    #[default]
    Adapt,
    /// It stays as the clip left it. Needs a clip.
    Hold,
}

/// How foreground is found.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct SegmentSettings {
    /// At which size of the picture background and foreground are computed; lengths and areas below are the full
    /// picture's whichever it is. Default `auto`.
    pub resolution: Resolution,
    /// Blurred difference that is foreground everywhere, share of full scale, 0.001 to 1. Default: 0.12 before backgrounds of middle
    /// and high luma, less before darker ones as far as the noise allows, and up to three times that where the verdict keeps turning.
    pub delta: Option<f64>,
    /// Hysteresis: a quarter of a blob's least area must differ by more than this, share of full scale, 0 to 1; what
    /// differs less everywhere is background. Not above `delta`, it asks for nothing. Default 0 (off).
    pub delta_high: f64,
    /// Standard deviation of the blur, pixels, 0 (none) to 16. Default: a 240th of the picture's rows less 0.4, 0.6 to 2.
    pub blur_sigma_px: Option<f64>,
    /// How the mixture's own match test counts. Default `require`.
    pub mixture: MixtureRule,
    /// A pixel that kept its chromaticity and at least this share of its background's luma, 0.05 to 1, is in
    /// shadow, not foreground. 1 looks for no shadows. Default 0.5.
    pub shadow_darkest: f64,
    /// Chroma that a shadow may change, share of full scale, 0 to 0.5: outdoors the sky tints shadows. Default
    /// 0.045.
    pub shadow_chroma: f64,
    /// A pixel that kept its chromaticity and has at most this many times its background's luma, 1 to 4, is lit by a
    /// highlight, not foreground, if the background's structure is seen in it or the light beside it changed as much. 1 looks for none.
    /// Default 2.
    pub highlight_brightest: f64,
    /// Whether pieces that mostly flutter (turn from background to foreground and back again and again) are background:
    /// leaves, flags, water, tape. Default: where much of the picture flickers.
    pub suppress_blinking: Option<bool>,
    /// Choice of telling cast shadows from what moves. Default `auto`: while shadows are seen. `shadow_darkest` of 1 looks for none
    /// whatever this says.
    pub shadow: StageChoice,
    /// Choice of raising thresholds where verdicts keep turning. Default `auto`: where enough pixels flicker. A `delta` that is set stays
    /// what it is whatever this says.
    pub flicker: StageChoice,
    /// Choice of shifting the pictures of a shaking camera back. Default `auto`: while it shakes.
    pub shake: StageChoice,
    /// Choice of making the background as light as the whole picture became. `auto`, the default, and `on` are the same: the light is
    /// looked at in every fourth frame, or after 0.16 s, and followed where it changed.
    pub light: StageChoice,
    /// Gaps and notches of the mask that are closed, half their width in pixels, 0 (none) to 16. It also joins what
    /// stands close together. Default 0.
    pub close_radius_px: u32,
    /// Greatest hole in a blob that is filled whatever is seen in it, pixels, 0 (none) to 1e9. Larger ones are filled where
    /// most of their pixels differ by half of `delta`, if this is not 0. Default 64.
    pub max_hole_px: u32,
    /// Least area of a blob, pixels, 1 to 1e9; smaller pieces are background. 0 (default): a blob needs a 1500th of the
    /// picture's pixels, at least 16 (51 at 320 x 240, 614 at 1280 x 720); smaller pieces stay in the mask if noise cannot
    /// explain them, and are blobs too where a scene's calibration says that a square of half a metre (or of its
    /// `entities.min_size_m`) covers no more pixels there.
    pub min_area_px: u32,
    /// A piece is parted into upright things where it has fewer pixels in a column than this share of what it has on
    /// either side, 0 (never) to 0.9: people who touch. Masks are the same. Default 0.5.
    pub split_valley: f64,
}

impl Default for SegmentSettings {
    fn default() -> Self {
        Self {
            resolution: Resolution::Auto,
            delta: None,
            delta_high: 0.0,
            blur_sigma_px: None,
            mixture: MixtureRule::Require,
            shadow_darkest: 0.5,
            shadow_chroma: 0.045,
            highlight_brightest: 2.0,
            suppress_blinking: None,
            shadow: StageChoice::Auto,
            flicker: StageChoice::Auto,
            shake: StageChoice::Auto,
            light: StageChoice::Auto,
            close_radius_px: 0,
            max_hole_px: 64,
            min_area_px: 0,
            split_valley: 0.5,
        }
    }
}

impl SegmentSettings {
    /// Blurred difference that is foreground before backgrounds of middle and high luma, share of full scale, unless it is set.
    pub const DELTA: f64 = 0.12;

    /// Returns whether pieces that mostly flutter are background.
    #[must_use]
    pub const fn blinking_choice(&self) -> StageChoice {
        match self.suppress_blinking {
            None => StageChoice::Auto,
            Some(true) => StageChoice::On,
            Some(false) => StageChoice::Off,
        }
    }

    /// Returns whether thresholds follow the noise.
    #[must_use]
    pub const fn noise_choice(&self) -> StageChoice {
        if self.delta.is_some() { StageChoice::Off } else { StageChoice::Auto }
    }

    /// Returns whether shadows are told from what moves, by both settings that ask for it.
    #[must_use]
    pub fn shadow_choice(&self) -> StageChoice {
        if self.shadow_darkest < 1.0 || self.highlight_brightest > 1.0 {
            self.shadow
        } else {
            StageChoice::Off
        }
    }

    /// Returns whether thresholds rise where verdicts keep turning, by both settings that ask for it.
    #[must_use]
    pub const fn flicker_choice(&self) -> StageChoice {
        if self.delta.is_some() { StageChoice::Off } else { self.flicker }
    }

    /// Returns the blurred difference that is foreground, before what luma, noise and turning verdicts change of it.
    #[must_use]
    pub fn delta(&self) -> f64 {
        self.delta.unwrap_or(Self::DELTA)
    }

    /// The blur in a picture of `size_px`, pixels. What a codec and a lens blur is a share of the picture; below 0.6 a
    /// blur no longer calms the noise, above 2 it costs more than it brings.
    #[must_use]
    pub fn blur_sigma_px_in(&self, size_px: (u32, u32)) -> f64 {
        self.blur_sigma_px.unwrap_or_else(|| (f64::from(size_px.1) / 240.0 - 0.4).clamp(0.6, 2.0))
    }

    /// The least area of a blob in a picture of `size_px`, pixels.
    #[must_use]
    pub fn min_area_px_in(&self, size_px: (u32, u32)) -> u32 {
        /// Of a picture's pixels, the share that the smallest blob has: what a person of a 14th of its height has.
        const LEAST_SHARE: u64 = 1500;
        match self.min_area_px {
            0 => (u64::from(size_px.0) * u64::from(size_px.1) / LEAST_SHARE).max(16) as u32,
            px => px,
        }
    }

    /// Returns true if it is counted how often each pixel's verdict turns.
    #[must_use]
    pub fn counts_turns(&self) -> bool {
        self.flicker_choice() != StageChoice::Off || self.blinking_choice() == StageChoice::Auto
    }

    /// Returns the least area of what a mask shows in a picture of `size_px`, pixels: that of a blob where `min_area_px` is set or
    /// turning verdicts are not counted, since these tell leaves from small things; else the area over which the blur makes noise alike, 4 pi times the square of its sigma, and as if this were at least 0.6 pixels.
    #[must_use]
    pub fn min_mask_area_px_in(&self, size_px: (u32, u32)) -> u32 {
        match self.min_area_px {
            0 if self.counts_turns() => {
                (4.0 * PI * self.blur_sigma_px_in(size_px).max(0.6).powi(2)).ceil() as u32
            }
            _ => self.min_area_px_in(size_px),
        }
    }
}

/// How what moves is followed from frame to frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrackSettings {
    /// Seconds that a track lives on by prediction while nothing shows it, 0.05 to 60. All tracks end where the
    /// frames themselves pause for longer. Where frames come more seldom it is two and a half times from one to the next. Default 1.
    pub max_miss_secs: f64,
    /// Seconds that a thing must have been followed before it is a track, 0 to 10: what flickers for less is none.
    /// Default 0.2.
    pub confirm_secs: f64,
    /// Seconds after which what stands still is told as an event: stopped, or left behind. 0.5 to 86400. Default 10.
    pub stop_after_secs: f64,
    /// Seconds for which the background does not learn who stands and what was left behind, 0 to 1e7; after that it
    /// does, as fast as `background.tau_secs` says. 0 learns them like all else, and tells no events of them. Default
    /// 600.
    pub absorb_after_secs: f64,
}

impl Default for TrackSettings {
    fn default() -> Self {
        Self { max_miss_secs: 1.0, confirm_secs: 0.2, stop_after_secs: 10.0, absorb_after_secs: 600.0 }
    }
}

/// How the mixture's own match test counts when foreground is found. Its verdict at a pixel is that of most pixels
/// of the 5 x 5 around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MixtureRule {
    /// Not at all: the blurred difference decides.
    Ignore,
    /// Both must agree, so that what sways or flickers, which has several modes, stays background.
    #[default]
    Require,
    /// Either suffices, which finds what hardly differs from its background, and more noise.
    Add,
}

/// How a camera's picture is watched: frozen, covered, turned away, or in another light.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConditionSettings {
    /// Whether it is watched at all. Default true.
    pub watch: bool,
    /// Seconds of equal pictures after which the camera is frozen, 1 to 3600. Default 5.
    pub frozen_after_secs: f64,
    /// Seconds for which a picture must be covered or displaced before that is told, and sound again before it ends,
    /// 0.5 to 60. Default 2.
    pub begin_after_secs: f64,
    /// Seconds after which what a displaced camera sees is the place from now on, 10 to 1e7: it is still told that
    /// the camera was moved, but it is no longer told should it come back by itself. Default 600.
    pub accept_after_secs: f64,
}

impl Default for ConditionSettings {
    fn default() -> Self {
        Self { watch: true, frozen_after_secs: 5.0, begin_after_secs: 2.0, accept_after_secs: 600.0 }
    }
}

/// One scene.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSettings {
    /// Id: 1 to 64 of a-z, 0-9, - and _.
    pub id: String,
    /// The scene document (JSON).
    pub file: PathBuf,
}
