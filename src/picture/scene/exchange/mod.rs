//! Scenes in and out of other programs: the paper's JSON and glTF.
//!
//! Out: a [`Scene`] in, a file out, with a list of what the format has no word for. In: a file in, a scene document of the
//! project's own out, with a list of what was left out; the document is then read like any other, and what is wrong with it is
//! told by its place in the file ([`Taken::told`]). Reads no other file and fetches nothing.
//!
//! | format | world | cameras | what it has no word for |
//! | --- | --- | --- | --- |
//! | `videofields` | z up | as documents have them | nothing |
//! | `paper` | y up | three.js: column-major world matrices, looking along -z | is listed, and left out |
//! | `gltf`, `glb` | y up | nodes with cameras, looking along -z | stands in `extras.videofields` |
//!
//! \[DBV16\] Du, Bista, Varshney 2016, Video Fields, section 3.1: "the position, scaling, and rotation of the cameras (as camera
//! world matrices C) and the 3D models are exported and saved in the JSON format", made by three.js. The paper prints no
//! example; member names here are three.js's.

mod axes;
mod gltf_check;
mod gltf_kinds;
mod gltf_read;
mod gltf_write;
mod paper;

use super::{MAX_DOCUMENT_BYTES, Scene, SceneError};
use serde_json::Value;
use std::fmt;
use std::str::FromStr;
use videofields_vision::error::{Fault, MAX_FAULTS, one_of};

/// Most bytes of a file that is taken in: a document's with the triangles of all that stands.
pub const MAX_EXCHANGE_BYTES: usize = 32 << 20;

/// How a scene is written for others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExchangeFormat {
    /// The project's own document.
    VideoFields,
    /// The paper's JSON.
    Paper,
    /// glTF 2.0 as JSON, its buffer within.
    Gltf,
    /// glTF 2.0 in one binary file.
    Glb,
}

impl ExchangeFormat {
    /// All of them, with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("videofields", Self::VideoFields),
        ("paper", Self::Paper),
        ("gltf", Self::Gltf),
        ("glb", Self::Glb),
    ];

    /// Its media type.
    #[must_use]
    pub const fn content_type(self) -> &'static str {
        match self {
            Self::VideoFields | Self::Paper => "application/json",
            Self::Gltf => "model/gltf+json",
            Self::Glb => "model/gltf-binary",
        }
    }

    /// What its files' names end in.
    #[must_use]
    pub const fn extension(self) -> &'static str {
        match self {
            Self::VideoFields | Self::Paper => "json",
            Self::Gltf => "gltf",
            Self::Glb => "glb",
        }
    }
}

impl fmt::Display for ExchangeFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::ALL.iter().find(|(_, format)| format == self).map_or("", |(name, _)| *name);
        formatter.write_str(name)
    }
}

impl FromStr for ExchangeFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        one_of("format", text, &Self::ALL, |(name, _)| name).map(|(_, format)| format)
    }
}

/// A scene as another program reads it.
#[derive(Clone, Debug, PartialEq)]
pub struct Written {
    /// The file.
    pub bytes: Vec<u8>,
    /// What the format has no word for, each at its place in the scene's document; at most 64.
    pub warnings: Vec<Fault>,
}

/// A scene as another program wrote it.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// The scene document that it makes, not looked at yet.
    pub document: String,
    /// What was left out or guessed, each at its place in the file; at most 64.
    pub warnings: Vec<Fault>,
    /// Where in the file parts of the document come from.
    origins: Vec<(String, String)>,
    /// Where all else comes from.
    rest: &'static str,
}

impl Taken {
    /// Faults of the document at their places in the file.
    #[must_use]
    pub fn told(&self, faults: Vec<Fault>) -> Vec<Fault> {
        faults.into_iter().map(|fault| self.told_one(fault)).collect()
    }

    fn told_one(&self, Fault { place, message }: Fault) -> Fault {
        let within = |part: &str| {
            place
                .strip_prefix(part)
                .filter(|rest| rest.is_empty() || rest.starts_with('/'))
                .map(str::to_owned)
        };
        for (part, origin) in &self.origins {
            match within(part) {
                Some(rest) if rest.is_empty() => return Fault::new(origin.clone(), message),
                Some(rest) => return Fault::new(origin.clone(), format!("{}: {message}", &rest[1..])),
                None => {}
            }
        }
        Fault::new(format!("{}{place}", self.rest), message)
    }
}

/// Writes a scene down.
///
/// # Errors
/// [`SceneError::Faults`] where the scene's own document cannot be read, which is a fault of the daemon.
pub fn write(scene: &Scene, format: ExchangeFormat) -> Result<Written, SceneError> {
    let document = || -> Result<Value, SceneError> {
        let read = serde_json::from_str(&scene.document);
        read.map_err(|error| SceneError::Faults(vec![Fault::new("", error.to_string())]))
    };
    match format {
        ExchangeFormat::VideoFields => {
            Ok(Written { bytes: scene.document.as_bytes().to_vec(), warnings: Vec::new() })
        }
        ExchangeFormat::Paper => Ok(paper::write(&document()?)),
        ExchangeFormat::Gltf => Ok(gltf_write::write(scene, document()?, gltf_write::Container::Json)),
        ExchangeFormat::Glb => Ok(gltf_write::write(scene, document()?, gltf_write::Container::Binary)),
    }
}

/// Reads what another program wrote.
///
/// # Errors
/// [`SceneError::TooLarge`]; [`SceneError::Faults`] with every fault that was found, each with its pointer. Nothing is
/// allocated by what the file claims before that is held against what the file has.
pub fn take(bytes: &[u8], format: ExchangeFormat) -> Result<Taken, SceneError> {
    let most = match format {
        ExchangeFormat::VideoFields | ExchangeFormat::Paper => MAX_DOCUMENT_BYTES,
        ExchangeFormat::Gltf | ExchangeFormat::Glb => MAX_EXCHANGE_BYTES,
    };
    if bytes.len() > most {
        return Err(SceneError::TooLarge { bytes: bytes.len() as u64 });
    }
    match format {
        ExchangeFormat::VideoFields => Ok(Taken {
            document: text(bytes)?.to_owned(),
            warnings: Vec::new(),
            origins: Vec::new(),
            rest: "",
        }),
        ExchangeFormat::Paper => paper::take(text(bytes)?),
        ExchangeFormat::Gltf => gltf_read::take(text(bytes)?, None),
        ExchangeFormat::Glb => {
            let (json, buffer) = gltf_check::chunks(bytes)?;
            gltf_read::take(text(json)?, buffer)
        }
    }
}

fn text(bytes: &[u8]) -> Result<&str, SceneError> {
    std::str::from_utf8(bytes).map_err(|error| {
        let message = format!("the document must be UTF-8, but byte {} is not", error.valid_up_to());
        SceneError::Faults(vec![Fault::new("", message)])
    })
}

/// A bounded list of what is lost.
#[derive(Debug, Default)]
struct Warnings(Vec<Fault>);

impl Warnings {
    fn add(&mut self, place: impl Into<String>, message: impl Into<String>) {
        if self.0.len() < MAX_FAULTS {
            self.0.push(Fault::new(place, message));
        }
    }
}

/// The list `key` of a document's object; nothing where it is absent.
fn list<'a>(document: &'a Value, key: &str) -> &'a [Value] {
    document.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}
