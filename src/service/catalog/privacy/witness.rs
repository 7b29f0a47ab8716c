//! A file beside the database that says which zones were in force last, so that an older database is noticed.

use super::KeptPrivacy;
use super::document::{lifted_from_json, lifted_to_json, zones_from_json, zones_to_json};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Before and behind the database's name: whoever puts another database in its place leaves this where it is.
const NAME: [&str; 2] = ["privacy-", ".json"];

/// What the file says.
#[derive(Debug, Default, Deserialize, Serialize)]
struct Document {
    cameras: BTreeMap<String, Entry>,
}

#[derive(Debug, Deserialize, Serialize)]
struct Entry {
    version: i64,
    /// JSON, as the database has it.
    in_force: String,
    lifted: String,
}

/// What was in force last.
#[derive(Debug, Default)]
pub(super) struct Witness(BTreeMap<String, KeptPrivacy>);

impl Witness {
    pub(super) fn of_all(kept: &BTreeMap<String, KeptPrivacy>) -> Self {
        Self(kept.clone())
    }

    /// What lies beside that database; nothing where there is no such file. One that cannot be read is told of in the log.
    pub(super) fn read(database: &Path) -> Self {
        let path = path_beside(database);
        let text = match std::fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Self::default(),
            Err(error) => {
                tracing::error!(path = %path.display(), %error, "the witness of the privacy zones cannot be read");
                return Self::default();
            }
        };
        Self::parse(&text).unwrap_or_else(|| {
            tracing::error!(path = %path.display(), "the witness of the privacy zones is damaged");
            Self::default()
        })
    }

    fn parse(text: &str) -> Option<Self> {
        let document: Document = serde_json::from_str(text).ok()?;
        let kept = |(camera, entry): (String, Entry)| {
            let (in_force, lifted) =
                (zones_from_json(&entry.in_force).ok()?, lifted_from_json(&entry.lifted).ok()?);
            Some((camera, KeptPrivacy { version: entry.version, in_force, lifted, ..KeptPrivacy::default() }))
        };
        document.cameras.into_iter().map(kept).collect::<Option<_>>().map(Self)
    }

    pub(super) fn of(&self, camera: &str) -> Option<&KeptPrivacy> {
        self.0.get(camera)
    }

    /// Puts this in the place of what lies beside that database; on the disk when it returns.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(super) fn write(&self, database: &Path) -> std::io::Result<()> {
        let broken = |error: super::CatalogError| std::io::Error::other(error.to_string());
        let mut document = Document::default();
        for (camera, kept) in &self.0 {
            let in_force = zones_to_json(&kept.in_force).map_err(broken)?;
            let lifted = lifted_to_json(&kept.lifted).map_err(broken)?;
            document.cameras.insert(camera.clone(), Entry { version: kept.version, in_force, lifted });
        }
        let text = serde_json::to_vec_pretty(&document)?;
        let path = path_beside(database);
        let mut beside = path.clone().into_os_string();
        beside.push(".new");
        let beside = PathBuf::from(beside);
        let mut file = File::create(&beside)?;
        file.write_all(&text)?;
        file.sync_all()?;
        std::fs::rename(&beside, &path)?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
    }
}

fn path_beside(database: &Path) -> PathBuf {
    let [before, behind] = NAME;
    let mut name = std::ffi::OsString::from(before);
    name.push(database.file_name().unwrap_or_default());
    name.push(behind);
    database.with_file_name(name)
}
