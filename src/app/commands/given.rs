//! A camera's settings from the command line, as `TABLE.KEY=VALUE`.

use anyhow::{Context as _, Result, anyhow, bail};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
use toml::Value;
use videofields_recording::ingest::Pipeline;
use videofields_vision::config::{
    BackgroundSettings, CameraSettings, ConditionSettings, Config, ConfigFault, SegmentSettings, Settings,
    SourceSettings, TrackSettings,
};
use videofields_vision::frame::CameraId;

/// A camera's tables by name, as in a configuration file.
#[derive(Debug, Default)]
pub struct Tables(BTreeMap<String, BTreeMap<String, Value>>);

impl Tables {
    /// What flags such as `segment.delta=0.1` ask for.
    ///
    /// # Errors
    /// When a flag is not `TABLE.KEY=VALUE`.
    pub fn of_flags<'a>(flags: impl Iterator<Item = &'a str>) -> Result<Self> {
        let mut tables = Self::default();
        for flag in flags {
            let (key, value) =
                flag.split_once('=').with_context(|| format!("--set {flag}: expected KEY=VALUE"))?;
            let (section, key) = key.trim().split_once('.').with_context(|| {
                format!("--set {flag}: expected a table and a key, such as segment.delta")
            })?;
            // What is no number, truth value or list in TOML is text.
            let value = match format!("value = {value}").parse::<toml::Table>() {
                Ok(mut parsed) => parsed.remove("value"),
                Err(_) => Some(Value::String(value.trim().to_owned())),
            };
            let table = tables.0.entry(section.to_owned()).or_default();
            table.extend(value.map(|value| (key.to_owned(), value)));
        }
        Ok(tables)
    }

    /// Gives a setting its value if it has none.
    pub fn give(&mut self, section: &str, key: &str, value: Value) {
        self.0.entry(section.to_owned()).or_default().entry(key.to_owned()).or_insert(value);
    }
}

/// What can be given of a camera.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Given {
    background: BackgroundSettings,
    segment: SegmentSettings,
    track: TrackSettings,
    condition: ConditionSettings,
}

impl Given {
    fn from(tables: Tables) -> Result<Self> {
        let tables: toml::Table = tables
            .0
            .into_iter()
            .map(|(name, table)| (name, Value::Table(table.into_iter().collect())))
            .collect();
        tables.try_into().map_err(|error: toml::de::Error| anyhow!("--set: {}", error.message()))
    }
}

/// A camera with these settings, held to the ranges of a configuration file.
///
/// # Errors
/// When a table, key or value is none that a camera has.
pub fn camera(tables: Tables, source: SourceSettings) -> Result<CameraSettings> {
    let Given { background, segment, track, condition } = Given::from(tables)?;
    let id = CameraId::new("input")?;
    let camera = CameraSettings {
        record: false,
        vision: true,
        privacy_zones: Vec::new(),
        background,
        segment,
        track,
        condition,
        ..CameraSettings::new(id, source)
    };
    let all = Settings { camera: vec![camera.clone()], ..Settings::default() };
    match Config::from_settings(all, Path::new(".")) {
        Ok(_) => Ok(camera),
        Err(error) if error.faults().is_empty() => Err(error.into()),
        Err(error) => {
            let flags: Vec<String> = error.faults().iter().map(told).collect();
            bail!("{}", flags.join("; "))
        }
    }
}

/// A setting's fault as that of the flag which gave it.
fn told(fault: &ConfigFault) -> String {
    let key = fault.path.rsplit('.').next().unwrap_or_default();
    let flag = match key {
        "path" => "input".to_owned(),
        "clip" => "background".to_owned(),
        key => key.replace('_', "-"),
    };
    format!("--{flag}: {}", fault.message)
}

/// A pipeline for a camera.
pub fn pipeline(camera: &CameraSettings) -> Pipeline {
    Pipeline::new(&camera.background, &camera.segment)
        .with_track(&camera.track)
        .with_condition(&camera.condition)
}
