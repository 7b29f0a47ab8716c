//! Cameras at this machine: V4L2 devices.

use super::live::LiveSource;
use super::{CameraError, IngestError, StopFlag, Tap};
use crate::media::{DeviceWish, Input};
use std::io;
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use videofields_vision::config::SourceSettings;

/// Opens the device at `path`.
pub(super) fn open(
    path: &Path,
    settings: &SourceSettings,
    stop: &StopFlag,
    tap: Tap,
) -> Result<LiveSource, IngestError> {
    check(path)?;
    let place = path.display().to_string();
    let wish = DeviceWish {
        format: settings.format,
        width_px: settings.width_px,
        height_px: settings.height_px,
        rate_hz: settings.rate_hz,
    };
    let input = Input::v4l2(path, &wish).map_err(|fault| IngestError::of_fault(&place, fault))?;
    LiveSource::start(place, input, tap, stop)
}

/// Refuses what is no V4L2 device or may not be opened, links resolved: such as those in `/dev/v4l/by-id`, which stay when
/// devices are numbered otherwise.
fn check(path: &Path) -> Result<(), CameraError> {
    let refused = |source| CameraError::DeviceRefused { path: path.to_path_buf(), source };
    let resolved = match std::fs::canonicalize(path) {
        Ok(resolved) => resolved,
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(CameraError::NoDevice { path: path.to_path_buf() });
        }
        Err(error) => return Err(refused(error)),
    };
    let number = resolved.to_str().and_then(|path| path.strip_prefix("/dev/video"));
    let is_named = number.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()));
    let metadata = std::fs::metadata(&resolved).map_err(refused)?;
    if !is_named || !metadata.file_type().is_char_device() {
        return Err(CameraError::NotADevice { path: path.to_path_buf() });
    }
    std::fs::File::open(&resolved).map(drop).map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::error::ErrorKind;

    #[test]
    fn what_is_no_camera_is_refused_before_it_is_opened() {
        let refuse = |path: &Path, kind: ErrorKind, part: &str| {
            let error = check(path).unwrap_err();
            assert_eq!(error.kind(), kind, "{error}");
            assert!(error.to_string().contains(part), "{error}");
            let settings = SourceSettings { device: Some(path.to_path_buf()), ..SourceSettings::default() };
            assert!(open(path, &settings, &StopFlag::default(), Tap::Closed).is_err());
        };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("video0");
        std::fs::write(&file, b"no device").unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        refuse(Path::new("/dev/video987"), ErrorKind::NotFound, "plugged in");
        refuse(Path::new("/dev/zero"), ErrorKind::Invalid, "no V4L2 device");
        refuse(&link, ErrorKind::Invalid, "no V4L2 device");
        refuse(&file, ErrorKind::Invalid, "no V4L2 device");
        refuse(folder.path(), ErrorKind::Invalid, "no V4L2 device");
        refuse(&file.join("video0"), ErrorKind::Unavailable, "cannot open");
    }
}
