//! Truths about configurations, whatever stands in the file and in the environment.

use super::credentials::MAX_CREDENTIALS;
use super::validate::{MAX_SCENES, MAX_SNAPSHOTS};
use super::{Config, ConfigError, ConfigFault, MAX_CAMERAS, Origin, Settings, parse};
use crate::error::MAX_FAULTS;
use crate::frame::is_id;
use std::collections::HashSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The file that the text would stand in.
const FILE: &str = "/etc/videofields/videofields.toml";

/// Bytes that making it absolute adds to a path, and more.
const MAX_ADDED_BYTES: usize = 64;

/// Most bytes of a path.
const MAX_PATH_BYTES: usize = 4096;

/// Reads a configuration: it has faults, each in a place that is there and told in one line, or settings within their bounds that are
/// taken once more as they are.
///
/// Variables of the environment follow a byte of zero, `NAME=VALUE` each on a line.
pub fn configuration(data: &[u8]) -> usize {
    let text = String::from_utf8_lossy(data);
    let (text, variables) = text.split_once('\0').unwrap_or((&text, ""));
    let variables: Vec<(OsString, OsString)> = variables
        .lines()
        .filter_map(|line| line.split_once('='))
        .map(|(name, value)| (name.into(), value.into()))
        .collect();
    match parse(text, Path::new(FILE), variables.clone()) {
        Ok(config) => holds_config(&config, data.len()),
        Err(ConfigError::Faults(faults)) => {
            assert!((1..=MAX_FAULTS).contains(&faults.len()), "{} faults", faults.len());
            faults.iter().for_each(|fault| holds_fault(fault, text, &variables));
            0
        }
        Err(error) => panic!("{error}"),
    }
}

fn holds_fault(fault: &ConfigFault, text: &str, variables: &[(OsString, OsString)]) {
    match &fault.origin {
        Origin::File { file, line, column } => {
            assert_eq!(file, Path::new(FILE));
            let written = line.checked_sub(1).and_then(|before| text.split('\n').nth(before));
            let n_chars = written.unwrap_or_else(|| panic!("{fault}: there is no such line")).chars().count();
            assert!((1..=n_chars + 1).contains(column), "{fault}: the line has {n_chars} letters");
        }
        Origin::Environment { variable } => {
            assert!(variables.iter().any(|(name, _)| name.to_str() == Some(variable)), "{fault}");
        }
        Origin::Program => panic!("{fault}: it stands nowhere"),
    }
    assert!(!fault.message.is_empty());
    let shown = [&fault.message, &fault.path];
    assert!(shown.iter().all(|shown| !shown.contains(char::is_control)), "{fault:?}");
}

fn holds_config(config: &Config, n_bytes: usize) -> usize {
    let settings = config.settings();
    let Settings { credentials, camera, scene, snapshot, .. } = settings;
    assert!(camera.len() <= MAX_CAMERAS && scene.len() <= MAX_SCENES, "{settings:?}");
    assert!(snapshot.len() <= MAX_SNAPSHOTS && credentials.len() <= MAX_CREDENTIALS, "{settings:?}");
    let cameras: HashSet<_> = camera.iter().map(|camera| &camera.id).collect();
    let scenes: HashSet<_> = scene.iter().map(|scene| &scene.id).collect();
    assert_eq!((cameras.len(), scenes.len()), (camera.len(), scene.len()), "ids are unique");
    assert!(
        scene.iter().all(|scene| is_id(&scene.id)) && camera.iter().all(|camera| !camera.name.is_empty())
    );
    assert_eq!(config.folder(), Path::new("/etc/videofields"));
    for path in paths(settings) {
        assert!(path.is_absolute(), "{}", path.display());
    }
    for camera in camera {
        assert!(camera.source.url.as_ref().is_none_or(|url| url.parse().is_ok()), "{camera:?}");
    }
    // A path that was nearly too long is too long once it is absolute.
    if n_bytes + MAX_ADDED_BYTES < MAX_PATH_BYTES {
        let again = Config::from_settings(settings.clone(), config.folder());
        assert_eq!(again.unwrap_or_else(|error| panic!("{error}")), *config, "what is valid stays as it is");
    }
    1 + camera.len() + scene.len() + snapshot.len() + credentials.len()
}

/// Paths that are made absolute.
fn paths(settings: &Settings) -> Vec<&PathBuf> {
    let storage = &settings.storage;
    let mut paths = vec![&storage.database, &storage.snapshot_folder, &storage.audit_head];
    paths.extend(&settings.media.roots);
    paths.extend(settings.scene.iter().map(|scene| &scene.file));
    paths.extend(settings.camera.iter().filter_map(|camera| camera.source.path.as_ref()));
    paths
}
