//! `cameras discover`: cameras that speak ONVIF, their clocks, and their streams as a configuration takes them.

use super::super::operator::CONFIG;
use anyhow::{Context as _, Result, ensure};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields_recording::ingest::MediaRoots;
use videofields_recording::onvif::{
    self, Audience, ClockOffset, Device, DeviceStream, Discovery, device_service,
};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{self, Settings};

/// Most letters of a camera's id that is proposed.
const MAX_ID_LETTERS: usize = 40;

/// Finds cameras that speak ONVIF in the networks that this machine is in, and tells how far their clocks are off.
///
/// With credentials each is asked for its streams too, and these are written as a configuration takes them (TOML; what is told of a
/// camera stands in comments). Only addresses in `media.networks` are asked. Takes a few seconds.
#[derive(Debug, clap::Args)]
pub(crate) struct Discover {
    /// The daemon's configuration (TOML), for its credentials and networks [default: /etc/videofields/videofields.toml, where it is].
    #[arg(long = "config", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Logs in at cameras with these credentials of the configuration, as far as their `networks` reach. Any device there that says it is
    /// a camera is sent a digest of the password.
    #[arg(long, value_name = "ID")]
    credentials: Option<String>,
    /// Asks one camera: HOST, HOST:PORT or the http or https URL of its device service.
    #[arg(long, value_name = "ADDRESS")]
    address: Option<String>,
    /// Writes one JSON object instead.
    #[arg(long)]
    json: bool,
}

impl Discover {
    pub(crate) fn run(&self) -> Result<()> {
        let settings = self.settings()?;
        let roots = MediaRoots::new(&[])?
            .with_networks(&settings.media.networks)
            .with_credentials(&settings.credentials);
        if let Some(name) = &self.credentials {
            let known: Vec<&str> = settings.credentials.iter().map(|known| known.id.as_str()).collect();
            ensure!(
                known.contains(&name.as_str()),
                "--credentials: {}",
                videofields_vision::error::unknown("credentials", name, &known)
            );
        }
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let wish = (&roots, self.credentials.as_deref());
        let found = match &self.address {
            Some(address) => {
                let url = device_service(address).context("--address")?;
                let device = onvif::ask_device(&url, wish, &clock)?;
                Discovery { devices: vec![device], ..Discovery::default() }
            }
            None => onvif::discover(Audience::Everybody, wish, &clock)?,
        };
        if self.json {
            return super::super::say(&serde_json::to_string(&found)?);
        }
        for line in lines(&found, self.credentials.as_deref()) {
            super::super::say(&line)?;
        }
        if found.devices.is_empty() {
            super::super::complain("no camera answered; --address asks one whose address is known");
        }
        if found.n_ignored > 0 {
            super::super::complain(&format!(
                "{} answers were left out: not understood, too long, or from outside media.networks",
                found.n_ignored
            ));
        }
        if found.is_cut {
            super::super::complain("there were too many answers: there may be more cameras");
        }
        Ok(())
    }

    fn settings(&self) -> Result<Settings> {
        let usual = Path::new(CONFIG);
        match &self.config {
            Some(file) => Ok(config::load(file)?.settings().clone()),
            None if usual.is_file() => Ok(config::load(usual)?.settings().clone()),
            None => Ok(Settings::default()),
        }
    }
}

/// Returns what is told, as lines of a configuration.
fn lines(found: &Discovery, credentials: Option<&str>) -> Vec<String> {
    let mut taken = BTreeSet::new();
    found.devices.iter().flat_map(|device| lines_of(device, credentials, &mut taken)).collect()
}

fn lines_of(device: &Device, credentials: Option<&str>, taken: &mut BTreeSet<String>) -> Vec<String> {
    let called = [&device.name, &device.maker, &device.model].into_iter().flatten().map(String::as_str);
    let called: Vec<&str> = called.collect();
    let called = if called.is_empty() { "A camera".to_owned() } else { called.join(", ") };
    let urls = |urls: &[config::CameraUrl]| {
        let urls = urls.iter().filter_map(|url| serde_json::to_value(url).ok()?.as_str().map(str::to_owned));
        urls.collect::<Vec<_>>().join(", ")
    };
    let mut lines = vec![format!("# {called}: {}", urls(&device.services))];
    if !device.reported_services.is_empty() {
        lines.push(format!("#   says that it is at {}", urls(&device.reported_services)));
    }
    lines.push(device.clock.map_or_else(|| "#   does not tell its time".to_owned(), clock_line));
    lines.extend(device.problem.as_ref().map(|problem| format!("#   {problem}")));
    let mut streams = device.streams.iter().filter(|stream| stream.url.is_some()).peekable();
    if streams.peek().is_some() {
        let id = id_of(device, taken);
        lines.extend(["[[camera]]".to_owned(), format!("id = \"{id}\"")]);
        lines.extend(device.name.as_ref().map(|name| format!("name = {}", quoted(name))));
        lines.push("[camera.source]".to_owned());
        for (i, stream) in streams.enumerate() {
            lines.push(format!("# {}", stream_line(stream)));
            let off = if i == 0 { "" } else { "#" };
            let url = stream.url.as_ref().and_then(|url| serde_json::to_string(url).ok());
            lines.extend(url.map(|url| format!("{off}url = {url}")));
        }
        lines.extend(credentials.map(|name| format!("credentials = {}", quoted(name))));
    }
    lines.push(String::new());
    lines
}

fn clock_line(clock: ClockOffset) -> String {
    let way = if clock.secs < 0.0 { "behind" } else { "ahead of" };
    format!(
        "#   its clock is {:.1} s {way} this machine's (to within {:.1} s)",
        clock.secs.abs(),
        clock.error_secs
    )
}

/// Describes a stream in a line: profile, encoding, size and rate.
fn stream_line(stream: &DeviceStream) -> String {
    let size = stream.size_px.map(|[width, height]| format!("{width} x {height}"));
    let rate = stream.rate_hz.map(|rate_hz| format!("{rate_hz} Hz"));
    let parts: Vec<String> = [stream.encoding.clone(), size, rate].into_iter().flatten().collect();
    let host = stream.reported_url.as_ref().and_then(|url| Some(url.parse().ok()?.host.to_string()));
    let host = host.map(|host| format!(" (it says {host} itself)")).unwrap_or_default();
    format!("{}: {}{host}", stream.profile, parts.join(", "))
}

/// Returns an id that no other camera was given: its name's letters, or `camera`.
fn id_of(device: &Device, taken: &mut BTreeSet<String>) -> String {
    let name = device.name.as_ref().or(device.model.as_ref()).map_or("", String::as_str);
    let letters: String = name
        .to_ascii_lowercase()
        .chars()
        .map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' })
        .take(MAX_ID_LETTERS)
        .collect();
    let words: Vec<&str> = letters.split('-').filter(|word| !word.is_empty()).collect();
    let base = if words.is_empty() { "camera".to_owned() } else { words.join("-") };
    let numbered = (2..).map(|number| format!("{base}-{number}"));
    let id = std::iter::once(base.clone()).chain(numbered).find(|id| !taken.contains(id)).unwrap_or(base);
    taken.insert(id.clone());
    id
}

/// Returns a text as TOML and JSON both quote it.
fn quoted(text: &str) -> String {
    serde_json::Value::String(text.to_owned()).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::config::CameraUrl;

    fn device(name: &str) -> Device {
        let stream = |profile: &str, url: Option<&str>| DeviceStream {
            profile: profile.to_owned(),
            encoding: Some("H264".to_owned()),
            size_px: Some([1920, 1080]),
            rate_hz: Some(12.5),
            url: url.map(CameraUrl::new),
            reported_url: Some(CameraUrl::new("rtsp://192.168.0.100/x")),
        };
        Device {
            services: vec![CameraUrl::new("http://10.0.0.7/onvif/device_service")],
            reported_services: vec![CameraUrl::new("http://192.168.0.100/onvif/device_service")],
            endpoint: None,
            name: Some(name.to_owned()),
            maker: None,
            model: Some("X-1".to_owned()),
            clock: Some(ClockOffset { secs: -37.04, error_secs: 0.51 }),
            streams: vec![
                stream("audio", None),
                stream("main", Some("rtsp://10.0.0.7/a?b=\"c\"\\d")),
                stream("sub", Some("rtsp://10.0.0.7/b")),
            ],
            problem: None,
        }
    }

    #[test]
    fn what_is_told_is_a_configuration() {
        let devices = vec![device("North \"Gate\""), device("north gate!"), device("\u{5317}")];
        let login = "[[credentials]]\nid = \"gates\"\nuser = \"a\"\npassword_env = \"B\"\nnetworks = [\"10.0.0.0/8\"]\n";
        let told = lines(&Discovery { devices, ..Discovery::default() }, Some("gates")).join("\n");
        let config = config::parse(&format!("{login}{told}"), Path::new("/etc/a.toml"), []).unwrap();
        let cameras: Vec<_> = config.settings().camera.iter().collect();
        let ids: Vec<_> = cameras.iter().map(|camera| camera.id.as_str()).collect();
        assert_eq!(ids, ["north-gate", "north-gate-2", "camera"]);
        assert_eq!(cameras[0].name, "North \"Gate\"");
        assert_eq!(cameras[0].source.url, Some(CameraUrl::new("rtsp://10.0.0.7/a?b=\"c\"\\d")));
        assert_eq!(cameras[0].source.credentials.as_deref(), Some("gates"));
        assert!(told.contains("37.0 s behind this machine's (to within 0.5 s)"), "{told}");
        assert!(
            told.contains("# sub: H264, 1920 x 1080, 12.5 Hz (it says 192.168.0.100 itself)\n#url = "),
            "{told}"
        );
        let bare = Device { streams: Vec::new(), clock: None, problem: Some("no".to_owned()), ..device("a") };
        let told = lines(&Discovery { devices: vec![bare], ..Discovery::default() }, None).join("\n");
        assert!(told.lines().all(|line| line.is_empty() || line.starts_with('#')), "{told}");
    }
}
