//! The worlds that come with the program, and worlds from files.

use super::super::SimulateError;
use super::super::world::World;
use super::files::{Beneath, NoFiles};
use super::parse;
use std::io::Read;
use std::path::Path;
use videofields_picture::scene::MAX_DOCUMENT_BYTES;
use videofields_vision::error::Fault;

macro_rules! worlds {
    ($($id:literal),* $(,)?) => {
        [$(($id, include_str!(concat!("../../../config/worlds/", $id, ".json")))),*]
    };
}

/// Every world of the catalogue: id and document.
const WORLDS: [(&str, &str); 31] = worlds![
    "plaza",
    "corner",
    "station",
    "carpark12",
    "campus100",
    "crowd40",
    "queue",
    "corridor",
    "yard",
    "effect-light-drift",
    "effect-light-switching",
    "effect-cast-shadows",
    "effect-wet-ground",
    "effect-foliage-motion",
    "effect-camera-shake",
    "effect-motion-blur",
    "effect-rolling-shutter",
    "effect-rain",
    "effect-snow",
    "effect-exposure",
    "effect-noise",
    "effect-compression",
    "effect-drop",
    "effect-late",
    "effect-duplicate",
    "effect-corrupt",
    "effect-clock",
    "effect-jitter",
    "one-camera",
    "no-overlap",
    "same-place"
];

/// The catalogue's ids, in its order.
pub(super) fn ids() -> impl Iterator<Item = &'static str> {
    WORLDS.iter().map(|(id, _)| *id)
}

/// The document of a world of the catalogue.
pub(super) fn text_of(id: &str) -> Option<&'static str> {
    WORLDS.iter().find(|(known, _)| *known == id).map(|(_, text)| *text)
}

impl World {
    /// The worlds that come with the program: their ids and what each is, in a line.
    #[must_use]
    pub fn catalogue() -> Vec<(String, String)> {
        let described = |(id, text): &(&str, &str)| {
            // The catalogue's own texts are JSON, which a test makes sure of.
            let tree: serde_json::Value = serde_json::from_str(text).unwrap_or_default();
            let description = tree.get("description").and_then(serde_json::Value::as_str);
            ((*id).to_owned(), description.unwrap_or_default().to_owned())
        };
        WORLDS.iter().map(described).collect()
    }

    /// The document (JSON) of a world that comes with the program.
    #[must_use]
    pub fn document_of(id: &str) -> Option<&'static str> {
        text_of(id)
    }

    /// The world of the catalogue with this id.
    ///
    /// # Errors
    /// When there is no such world.
    pub fn named(id: &str) -> Result<Self, SimulateError> {
        let text = text_of(id).ok_or_else(|| unknown(id))?;
        Self::from_json(id, text)
    }

    /// The plaza.
    ///
    /// # Panics
    /// Never: its document comes with the program and a test reads it.
    #[must_use]
    pub fn plaza() -> Self {
        Self::named("plaza").expect("the plaza's own document is whole")
    }

    /// The world of the catalogue with this name, or else the one in the file at this path, whose id is its file's
    /// stem.
    ///
    /// # Errors
    /// When there is neither, the file cannot be read, or with every fault of the document.
    pub fn load(name_or_path: &str) -> Result<Self, SimulateError> {
        if text_of(name_or_path).is_some() {
            return Self::named(name_or_path);
        }
        let path = Path::new(name_or_path);
        let looks_like_path = name_or_path.ends_with(".json") || path.components().count() > 1;
        if !looks_like_path && !path.is_file() {
            return Err(unknown(name_or_path));
        }
        let unreadable = |source| SimulateError::Unreadable { path: path.to_owned(), source };
        if !std::fs::metadata(path).map_err(unreadable)?.is_file() {
            let what = "expected a file, but this is none".to_owned();
            return Err(faulty(path, vec![Fault::new("", what)]));
        }
        let file = std::fs::File::open(path).map_err(unreadable)?;
        let mut bytes = Vec::new();
        file.take(MAX_DOCUMENT_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let byte = error.utf8_error().valid_up_to();
            faulty(path, vec![Fault::new("", format!("the document must be UTF-8, but byte {byte} is not"))])
        })?;
        let id = path.file_stem().map(|stem| stem.to_string_lossy().to_lowercase()).unwrap_or_default();
        if !videofields_vision::frame::is_id(&id) {
            let message = format!(
                "the file's name gives the world's id, but {id:?} is none: {}",
                videofields_vision::frame::IdError
            );
            return Err(faulty(path, vec![Fault::new("", message)]));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        parse(&id, &text, &Beneath(folder.to_owned())).map_err(|faults| faulty(path, faults))
    }

    /// The world that a document describes.
    ///
    /// # Errors
    /// With every fault of the document, each at its JSON pointer.
    pub fn from_json(id: &str, text: &str) -> Result<Self, SimulateError> {
        parse(id, text, &NoFiles).map_err(|faults| SimulateError::World { path: id.to_owned(), faults })
    }
}

fn unknown(id: &str) -> SimulateError {
    let ids: Vec<_> = ids().collect();
    SimulateError::UnknownWorld { message: videofields_vision::error::unknown("world", id, &ids) }
}

fn faulty(path: &Path, faults: Vec<Fault>) -> SimulateError {
    SimulateError::World { path: path.display().to_string(), faults }
}
