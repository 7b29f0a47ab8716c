//! `wall-client`: pulls every tile of a wall as its screens would, and says how well that goes.

mod frames;
mod pull;
mod site;
mod sockets;

use anyhow::{Result, bail};
use frames::Tally;
use serde_json::json;
use site::Site;
use std::path::PathBuf;
use std::time::Duration;
use videofields_vision::clock::{Clock, SystemClock};

/// Pulls every tile of a wall as its screens would, and says how well that goes.
///
/// Tiles that show one frame must show one instant: where two do not, the wall is torn and the exit status is 1. So it is
/// where no frame came whole.
#[derive(Debug, clap::Args)]
pub(crate) struct WallClient {
    /// Where the daemon is: scheme, host and port.
    #[arg(long, value_name = "URL")]
    url: String,
    /// The wall.
    #[arg(long, value_name = "ID")]
    wall: String,
    /// These tiles alone, with commas between them; all if absent.
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    tiles: Vec<String>,
    /// A file that holds a token.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Certificates (PEM) of whoever vouches for the daemon's; those that the machine trusts if absent.
    #[arg(long, value_name = "FILE")]
    certificate: Option<PathBuf>,
    /// For how long, 1 to 86400 s.
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    seconds: u64,
    /// Takes pictures by WebSocket, each tile at its own pace, and does not ask for them one by one.
    #[arg(long)]
    websocket: bool,
    /// Writes what was found as JSON.
    #[arg(long)]
    json: bool,
}

impl WallClient {
    pub(crate) fn run(&self) -> Result<()> {
        let site = Site::new(&self.url, self.token_file.as_deref(), self.certificate.as_deref())?;
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
        let (tally, rate_hz) = runtime.block_on(self.measured(&site))?;
        if self.json {
            super::say(&serde_json::to_string_pretty(&tally.report(rate_hz))?)?;
        } else {
            super::say(&tally.told(rate_hz))?;
        }
        match (tally.n_torn(), tally.n_whole()) {
            (0, 1..) => Ok(()),
            (0, _) => bail!("no frame of {} came whole", self.wall),
            (torn, _) => {
                bail!("{torn} frames of {} are torn: their tiles show different instants", self.wall)
            }
        }
    }

    async fn measured(&self, site: &Site) -> Result<(Tally, f64)> {
        let wall = site.wall(&self.wall).await?;
        let known: Vec<String> = wall.tiles;
        if let Some(unknown) = self.tiles.iter().find(|tile| !known.contains(tile)) {
            bail!("wall {} has no tile {unknown:?}; it has {}", self.wall, known.join(", "));
        }
        let tiles = if self.tiles.is_empty() { known } else { self.tiles.clone() };
        let clock = SystemClock::new();
        let time = Duration::from_secs(self.seconds);
        let wanted = (self.wall.as_str(), tiles.as_slice());
        let tally = match self.websocket {
            true => sockets::measure(site, wanted, time, &clock).await?,
            false => pull::measure(site, wanted, time, &clock).await?,
        };
        tracing::debug!(seconds = clock.monotonic().as_secs_f64(), "measured");
        Ok((tally, wall.rate_hz))
    }
}

/// Quantiles of times, in milliseconds: the median, the 99th of a hundred and the most; none of no time.
fn quantiles(times: &[Duration]) -> serde_json::Value {
    let mut ms: Vec<f64> = times.iter().map(|time| time.as_secs_f64() * 1e3).collect();
    ms.sort_by(f64::total_cmp);
    let at = |share: f64| ms.get(((ms.len() as f64 * share) as usize).min(ms.len().saturating_sub(1)));
    let rounded = |ms: Option<&f64>| ms.map(|ms| (ms * 100.0).round() / 100.0);
    json!({ "p50": rounded(at(0.5)), "p99": rounded(at(0.99)), "max": rounded(ms.last()) })
}
