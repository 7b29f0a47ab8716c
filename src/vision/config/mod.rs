//! TOML and environment -> validated, immutable settings; every fault with file, line, column and path.
//!
//! A file's text goes in, overlaid by variables `VIDEOFIELDS_SECTION__KEY`; a [`Config`] whose paths are absolute
//! comes out, or all faults of the file at once. Opens nothing that the settings name: whether a camera's file is
//! there is found out when the camera starts, so that one missing file leaves the others working.

mod archive;
mod change;
mod clock;
mod credentials;
mod document;
mod environment;
mod error;
mod feed;
#[cfg(any(test, feature = "fuzzing"))]
pub(crate) mod fuzzing;
mod made;
mod network;
mod resolution;
mod restart;
mod settings;
mod snapshot;
mod source;
mod stage_choice;
mod storage;
mod telling;
mod url;
mod validate;

pub use archive::ArchiveSettings;
pub use change::{CameraChange, Unfit};
pub use clock::ClockSettings;
pub use credentials::CredentialsSettings;
pub use error::{ConfigError, ConfigFault, Origin};
pub use feed::FeedSettings;
pub use made::MadeCamera;
pub use network::{Network, NetworkError};
pub use resolution::Resolution;
pub use restart::{ChangedKey, Effect, KEYS, changed_keys};
pub use settings::*;
pub use snapshot::{SnapshotScheduleSettings, check_annotation};
pub use source::{DeviceFormat, End, Pace, Place, SourceSettings, Timing, Transport};
pub use stage_choice::StageChoice;
pub use storage::StorageSettings;
pub use telling::{LogFormat, LogSettings, TelemetrySettings};
pub use url::{CameraUrl, Scheme, UrlError, UrlParts};
pub use validate::MAX_CAMERAS;

use crate::error::{Fault, Gatherer};
use crate::frame::{CameraId, Zone};
use document::Document;
use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

/// Most bytes of a configuration file.
pub const MAX_FILE_BYTES: u64 = 1 << 20;

/// Settings that were validated. Immutable; every path in it is absolute.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    settings: Settings,
    folder: PathBuf,
}

/// Reads a configuration file, overlaid by this process's environment.
///
/// # Errors
/// When the file cannot be read, or with every fault that it or the environment has.
pub fn load(path: &Path) -> Result<Config, ConfigError> {
    load_with(path, std::env::vars_os())
}

/// As [`load`], overlaid by the variables given.
///
/// # Errors
/// As [`load`].
pub fn load_with(
    path: &Path,
    variables: impl IntoIterator<Item = (OsString, OsString)>,
) -> Result<Config, ConfigError> {
    let text = document::read_text(path)?;
    parse(&text, path, variables)
}

/// As [`load_with`], for text that would stand in a file at `path`.
///
/// # Errors
/// With every fault of the text and the variables.
pub fn parse(
    text: &str,
    path: &Path,
    variables: impl IntoIterator<Item = (OsString, OsString)>,
) -> Result<Config, ConfigError> {
    let mut document = Document::parse(text, path)?;
    let mut gatherer = Gatherer::default();
    environment::overlay(&mut document, variables, &mut gatherer);
    let settings = gather(document.take_tree(), &mut gatherer);
    let faults = gatherer.into_faults();
    if !faults.is_empty() {
        return Err(ConfigError::Faults(faults.iter().map(|fault| document.locate(fault)).collect()));
    }
    let folder = folder_of(path)?;
    Ok(resolve(settings, folder))
}

impl Config {
    /// Validates settings that come from no file, such as a demonstration's; relative paths start at `folder`.
    ///
    /// # Errors
    /// With every fault of the settings.
    pub fn from_settings(settings: Settings, folder: &Path) -> Result<Self, ConfigError> {
        let mut gatherer = Gatherer::default();
        validate::check(&settings, &mut gatherer);
        let faults = gatherer.into_faults();
        if !faults.is_empty() {
            return Err(ConfigError::Faults(faults.iter().map(ConfigFault::of_settings).collect()));
        }
        Ok(resolve(settings, absolute(folder)?))
    }

    /// The settings; every path in them is absolute, every camera has a name.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The same, with other privacy zones of the cameras that `zones` knows.
    #[must_use]
    pub fn with_privacy_zones(&self, zones: impl Fn(&CameraId) -> Option<Vec<Zone>>) -> Self {
        let mut changed = self.clone();
        for camera in &mut changed.settings.camera {
            if let Some(zones) = zones(&camera.id) {
                camera.privacy_zones = zones;
            }
        }
        changed
    }

    /// The folder at which relative paths began: the file's own.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The same with other settings of its cameras, which were validated.
    #[must_use]
    pub fn with_cameras(self, camera: Vec<CameraSettings>) -> Self {
        Self { settings: Settings { camera, ..self.settings }, folder: self.folder }
    }

    /// The same with another address to listen on.
    ///
    /// # Errors
    /// When the address is not a loopback address, and there is no certificate.
    pub fn with_listen(self, listen: std::net::SocketAddr) -> Result<Self, ConfigError> {
        let mut settings = self.settings;
        settings.server.listen = listen;
        Self::from_settings(settings, &self.folder)
    }
}

/// `current` with the members of the JSON object `change` in place of its own.
///
/// # Errors
/// With every fault of the change, each at the JSON pointer of its member.
pub fn changed_segment(
    current: &SegmentSettings,
    change: serde_json::Value,
) -> Result<SegmentSettings, Vec<Fault>> {
    let mut gatherer = Gatherer::default();
    let serde_json::Value::Object(members) = change else {
        return Err(vec![Fault::new("", "expected an object of settings")]);
    };
    let mut whole = serde_json::to_value(current).unwrap_or_default();
    if let serde_json::Value::Object(whole) = &mut whole {
        whole.extend(members);
    }
    let changed = gatherer.read::<SegmentSettings>(whole, "");
    if let Some(changed) = &changed {
        validate::check_segment(changed, "", &mut gatherer);
    }
    let faults = gatherer.into_faults();
    changed.filter(|_| faults.is_empty()).ok_or(faults)
}

/// Reads the tree section by section, so that a fault in one hides none in another, and checks what was read.
fn gather(tree: serde_json::Value, gatherer: &mut Gatherer) -> Settings {
    let Some(mut fields) = gatherer.object(tree, "") else { return Settings::default() };
    macro_rules! section {
        ($key:literal) => {
            fields.take($key).and_then(|(value, place)| gatherer.read(value, &place)).unwrap_or_default()
        };
    }
    let mut settings = Settings {
        server: section!("server"),
        storage: section!("storage"),
        archive: section!("archive"),
        media: section!("media"),
        timeline: section!("timeline"),
        entities: section!("entities"),
        render: section!("render"),
        accuracy: section!("accuracy"),
        log: section!("log"),
        telemetry: section!("telemetry"),
        credentials: Vec::new(),
        camera: Vec::new(),
        scene: Vec::new(),
        snapshot: Vec::new(),
    };
    validate::check(&settings, gatherer);
    let credentials = gatherer.list(fields.take("credentials"), credentials::MAX_CREDENTIALS);
    let cameras = gatherer.list(fields.take("camera"), MAX_CAMERAS);
    let scenes = gatherer.list(fields.take("scene"), validate::MAX_SCENES);
    let snapshots = gatherer.list(fields.take("snapshot"), validate::MAX_SNAPSHOTS);
    // Each is checked with its own place: an element that could not be read must not renumber those after it.
    let mut ids = validate::Ids::default();
    for (value, place) in credentials {
        if let Some(login) = gatherer.read(value, &place) {
            credentials::check(&login, &place, &mut ids, gatherer);
            settings.credentials.push(login);
        }
    }
    for (value, place) in cameras {
        if let Some(source) = value.get("source") {
            source::check_keys(source, &format!("{place}/source"), gatherer);
        }
        if let Some(camera) = gatherer.read(value, &place) {
            validate::check_camera(&camera, &place, &mut ids, gatherer);
            settings.camera.push(camera);
        }
    }
    for (value, place) in scenes {
        if let Some(scene) = gatherer.read(value, &place) {
            validate::check_scene(&scene, &place, &mut ids, gatherer);
            settings.scene.push(scene);
        }
    }
    for (value, place) in snapshots {
        if let Some(schedule) = gatherer.read(value, &place) {
            snapshot::check(&schedule, &place, &mut ids, gatherer);
            settings.snapshot.push(schedule);
        }
    }
    fields.finish(gatherer);
    settings
}

fn folder_of(path: &Path) -> Result<PathBuf, ConfigError> {
    let path = absolute(path)?;
    Ok(path.parent().unwrap_or(&path).to_owned())
}

fn absolute(path: &Path) -> Result<PathBuf, ConfigError> {
    std::path::absolute(path).map_err(|source| ConfigError::Unreadable { path: path.to_owned(), source })
}

/// Makes every path absolute and gives every camera a name.
fn resolve(mut settings: Settings, folder: PathBuf) -> Config {
    let place = |path: &mut PathBuf| {
        *path = folder.join(&*path).components().filter(|part| *part != Component::CurDir).collect();
    };
    place(&mut settings.storage.database);
    let storage = &mut settings.storage;
    if storage.snapshot_folder.as_os_str().is_empty() {
        storage.snapshot_folder = storage.database.with_extension("snapshots");
    } else {
        place(&mut storage.snapshot_folder);
    }
    if storage.audit_head.as_os_str().is_empty() {
        let mut beside = storage.database.clone().into_os_string();
        beside.push(".audit-head");
        storage.audit_head = beside.into();
    } else {
        place(&mut storage.audit_head);
    }
    let keys = [&mut storage.audit_key, &mut storage.audit_key_before];
    keys.into_iter().filter(|key| !key.as_os_str().is_empty()).for_each(place);
    // An empty path says that nothing is recorded, and not the file's own folder.
    if settings.archive.is_on() {
        place(&mut settings.archive.folder);
    }
    if settings.server.is_encrypted() {
        place(&mut settings.server.certificate);
        place(&mut settings.server.private_key);
    }
    settings.media.roots.iter_mut().for_each(place);
    settings.credentials.iter_mut().filter_map(|login| login.password_file.as_mut()).for_each(place);
    for camera in &mut settings.camera {
        camera.source.path.iter_mut().for_each(place);
        camera.source.password_file.iter_mut().for_each(place);
        camera.background.clip.iter_mut().for_each(place);
        if camera.name.is_empty() {
            camera.id.as_str().clone_into(&mut camera.name);
        }
    }
    for scene in &mut settings.scene {
        place(&mut scene.file);
    }
    Config { settings, folder }
}
