//! `scene`: scenes in and out of other programs' files, without a daemon.

use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use videofields_picture::scene::exchange::{self, ExchangeFormat};
use videofields_picture::scene::{self, FolderImports, ParsedScene, SceneError};
use videofields_vision::error::{Fault, join_faults};

/// Takes scenes to other programs and back: the paper's JSON and glTF.
///
/// What a format cannot hold, and what was left out or guessed, is told on standard error.
#[derive(Debug, clap::Args)]
pub(crate) struct SceneFiles {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Writes a scene document in another format.
    Export {
        /// The scene document.
        file: PathBuf,
        #[command(flatten)]
        to: To,
    },
    /// Makes a scene document of another program's file, and checks it.
    Import {
        /// The file.
        file: PathBuf,
        #[command(flatten)]
        to: To,
    },
}

#[derive(Debug, clap::Args)]
struct To {
    /// videofields, paper, gltf or glb; told from the other file's name if absent (.gltf, .glb, else paper).
    #[arg(long)]
    format: Option<ExchangeFormat>,
    /// Where to write; standard output if absent (of glb, a file is needed).
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl SceneFiles {
    pub(crate) fn run(self) -> Result<()> {
        match self.action {
            Action::Export { file, to } => export(&file, &to),
            Action::Import { file, to } => import(&file, &to),
        }
    }
}

/// The format that is named, or that a file's name tells.
fn format_of(named: Option<ExchangeFormat>, file: Option<&Path>) -> ExchangeFormat {
    let ending = file.and_then(Path::extension).and_then(std::ffi::OsStr::to_str);
    named.unwrap_or(match ending {
        Some("gltf") => ExchangeFormat::Gltf,
        Some("glb") => ExchangeFormat::Glb,
        _ => ExchangeFormat::Paper,
    })
}

/// Returns a scene's id, from its file's name as far as that is one.
fn id_of(file: &Path) -> String {
    let stem = file.file_stem().and_then(std::ffi::OsStr::to_str).unwrap_or_default().to_lowercase();
    if videofields_vision::frame::is_id(&stem) { stem } else { "scene".to_owned() }
}

/// Reads a scene document that the caller names. What it imports lies beside it, also where the name is a link to it.
///
/// # Errors
/// When it cannot be read, or is no scene.
pub(super) fn load(file: &Path) -> Result<ParsedScene> {
    Ok(scene::load_file(&id_of(file), &followed(file), &[])?)
}

/// Returns the file itself where its name is a link. What leads nowhere, or to a pipe, stays as it is named.
fn followed(file: &Path) -> PathBuf {
    file.canonicalize().unwrap_or_else(|_other| file.to_owned())
}

fn export(file: &Path, to: &To) -> Result<()> {
    let parsed = load(file)?;
    let format = format_of(to.format, to.output.as_deref());
    let written = exchange::write(&parsed.scene, format)?;
    warn(&written.warnings);
    put(&written.bytes, to.output.as_deref())
}

fn import(file: &Path, to: &To) -> Result<()> {
    let shown = file.display();
    let length = std::fs::metadata(file).with_context(|| format!("cannot read {shown}"))?.len();
    if length > exchange::MAX_EXCHANGE_BYTES as u64 {
        bail!("{shown} has more than {} bytes", exchange::MAX_EXCHANGE_BYTES);
    }
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {shown}"))?;
    let taken = exchange::take(&bytes, format_of(to.format, Some(file)))?;
    warn(&taken.warnings);
    let imports = FolderImports::beside(&followed(file), &[]);
    let parsed = scene::parse(&id_of(file), &taken.document, imports).map_err(|error| match error {
        SceneError::Faults(faults) => anyhow::Error::msg(join_faults(&taken.told(faults))),
        error => error.into(),
    })?;
    let mut text = parsed.document.to_json().into_bytes();
    text.push(b'\n');
    put(&text, to.output.as_deref())
}

fn warn(warnings: &[Fault]) {
    for warning in warnings {
        super::complain(&warning.to_string());
    }
}

fn put(bytes: &[u8], output: Option<&Path>) -> Result<()> {
    match output {
        Some(file) => std::fs::write(file, bytes).with_context(|| format!("cannot write {}", file.display())),
        None => match std::str::from_utf8(bytes) {
            Ok(text) => super::say(text.trim_end()),
            Err(_binary) => bail!("name a file (--output): this format is no text"),
        },
    }
}
