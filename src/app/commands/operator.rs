//! Who runs a command, and the lines of the audit log that it leaves.

use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use videofields_recording::signing::SigningKey;
use videofields_recording::store::{AuditEntry, NoteSigner};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{self, Config};

/// Where a package has the daemon's configuration.
pub(crate) const CONFIG: &str = "/etc/videofields/videofields.toml";

/// What an entry says of a command that did what it was to do, as HTTP has it.
const DONE: u16 = 200;

/// The daemon's configuration.
#[derive(Debug, clap::Args)]
pub(crate) struct Configured {
    /// The daemon's configuration (TOML).
    #[arg(long = "config", value_name = "FILE", default_value = CONFIG)]
    pub(crate) file: PathBuf,
}

impl Configured {
    pub(crate) fn load(&self) -> Result<Config> {
        Ok(config::load(&self.file)?)
    }
}

/// Who runs this process, as the audit log names them: `cli:` and the user's name, or number where it has none.
pub(crate) fn actor() -> String {
    let user = rustix::process::getuid().as_raw();
    let known = std::fs::read_to_string("/etc/passwd").unwrap_or_default();
    format!("cli:{}", name_of(user, &known).map_or_else(|| user.to_string(), str::to_owned))
}

/// The first name of a user in the lines of passwd(5).
fn name_of(user: u32, known: &str) -> Option<&str> {
    known.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next().filter(|name| !name.is_empty())?;
        let number = fields.nth(1)?;
        (number.parse() == Ok(user)).then_some(name)
    })
}

/// What the audit log is to say of a command that was run.
pub(crate) fn entry(action: &str, target: String) -> AuditEntry {
    let (at, user) = (SystemClock::new().now(), Some(actor()));
    AuditEntry { at, user, action: action.to_owned(), target, status: DONE }
}

/// Returns the key that signs what a command notes in the audit log; none where none is configured, or where whoever runs the
/// command may not read it, which is told.
pub(crate) fn audit_key(config: &Config) -> Option<SigningKey> {
    let storage = &config.settings().storage;
    if !storage.signs_audit() {
        return None;
    }
    let read = SigningKey::read(&storage.audit_key);
    read.inspect_err(|error| {
        super::complain(&format!("warning: the audit log's entry is not signed: {error}"));
    })
    .ok()
}

/// Returns what a command signs with that key.
pub(crate) fn signer<'a>(config: &'a Config, key: Option<&'a SigningKey>) -> Option<NoteSigner<'a>> {
    key.map(|key| NoteSigner { key, head_file: &config.settings().storage.audit_head })
}

/// A path as whoever reads the audit log can find it.
pub(crate) fn whole(path: &Path) -> String {
    std::path::absolute(path).unwrap_or_else(|_no_folder| path.to_owned()).display().to_string()
}

/// Runs what asks the database, on threads of its own.
pub(crate) fn block_on<T>(work: impl Future<Output = Result<T>>) -> Result<T> {
    tokio::runtime::Runtime::new().context("cannot start the I/O threads")?.block_on(work)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn users_are_named_as_the_system_knows_them() {
        let known = "root:x:0:0:root:/root:/bin/sh\nbroken\n:x:7:\nann:x:1000:1000::/:/bin/sh\nalias:x:1000:1000::/:\n";
        assert_eq!(name_of(1000, known), Some("ann"));
        assert_eq!(name_of(0, known), Some("root"));
        assert_eq!((name_of(7, known), name_of(8, known)), (None, None));
        assert!(actor().starts_with("cli:"));
    }
}
