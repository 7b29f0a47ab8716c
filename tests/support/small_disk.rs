//! A disk that is soon full.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A small disk of its own, for as long as it lives.
pub struct SmallDisk(PathBuf);

impl SmallDisk {
    /// A disk of `mib` at `place`, which must not exist yet; none where this process may not mount one.
    pub fn mount(place: &Path, mib: u32) -> Option<Self> {
        std::fs::create_dir(place).expect("a folder to mount on");
        let size = format!("size={mib}m");
        let done =
            Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(place).output().ok()?;
        done.status.success().then(|| Self(place.to_owned()))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let done = Command::new("umount").args(["--lazy"]).arg(&self.0).status();
        assert!(done.is_ok_and(|status| status.success()), "the small disk stays mounted");
    }
}
