//! `bench load`: what a running daemon answers to many callers at once, and what memory it needs for them.

mod beside;
mod client;
mod figures;

use anyhow::{Context as _, Result, bail, ensure};
use beside::Beside;
use client::{Client, Connection, Place};
use figures::{Figures, resident_mib};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use tokio::sync::Barrier;
use tokio::task::JoinSet;
use videofields_vision::clock::{Clock, SystemClock};

/// The wall that is made for the time of measuring.
const WALL: &str = "bench-load";

/// Columns and rows of that wall.
const WALL_TILES: (u32, u32) = (5, 3);

/// Callers in the rows beside other connections.
const CALLERS_BESIDE: u64 = 4;

/// Asks a running daemon from many connections at once, and prints what came back as a table.
///
/// Every caller has a connection of its own and asks again as soon as it is answered. Asked for are: one live fused view by all
/// callers (whoever asks at one instant is answered by one drawing), one camera's live picture, what routes tell in JSON, and
/// a wall of 15 tiles of 400 x 600 pixels, a caller for each tile, which all wait for each other before the next frame. The
/// wall is made for it under the name `bench-load` and taken away afterwards.
#[derive(Debug, clap::Args)]
pub(super) struct Load {
    /// The daemon: http://, an address or name, and a port.
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:8080")]
    url: Place,
    /// A file whose first line is a token; where there are users, one of an operator with `live` of all cameras.
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// Callers at once, one row of the table for each number.
    #[arg(long, value_name = "COUNTS", value_delimiter = ',', default_values_t = [1, 4, 16, 48], value_parser = clap::value_parser!(u64).range(1..=200))]
    clients: Vec<u64>,
    /// Seconds that each row is measured for; a fifth of it before goes uncounted.
    #[arg(long, value_name = "SECONDS", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=3600))]
    seconds: u64,
    /// Measures two of the rows again beside so many readers that take a byte a second, of a stream of pictures and of
    /// events in turns; 0: does not.
    #[arg(long, value_name = "COUNT", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=200))]
    slow_readers: u64,
    /// The same beside so many connections that ask for nothing; 0: does not.
    #[arg(long, value_name = "COUNT", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=50_000))]
    idle: u64,
    /// The scene that is looked at. Default: the first.
    #[arg(long, value_name = "ID")]
    scene: Option<String>,
    /// The daemon's process at this machine: then its memory is told too.
    #[arg(long, value_name = "PID")]
    pid: Option<u32>,
}

/// One row of the table.
struct Row {
    name: String,
    n_callers: u64,
    figures: Figures,
    resident_mib: Option<[u64; 2]>,
}

impl Load {
    pub(super) fn run(&self) -> Result<()> {
        let runtime = tokio::runtime::Runtime::new().context("cannot start the I/O threads")?;
        runtime.block_on(self.measure())
    }

    async fn measure(&self) -> Result<()> {
        let token = self.token_file.as_ref().map(|path| {
            let text =
                std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()));
            text.map(|text| text.lines().next().unwrap_or_default().trim().to_owned())
        });
        let client = Arc::new(Client::new(self.url.clone(), token.transpose()?));
        let scenes = client.json("/api/v1/scenes").await?;
        let cameras = client.json("/api/v1/cameras").await?;
        let first = |list: &Value, of: &str| list[of][0]["id"].as_str().map(str::to_owned);
        let scene = self.scene.clone().or_else(|| first(&scenes, "scenes"));
        let scene = scene.context("the daemon has no scene that could be looked at")?;
        let camera =
            first(&cameras, "cameras").context("the daemon has no camera that could be looked at")?;
        videofields::commands::say(
            "| asked for | callers | answers/s | MiB/s | p50 ms | p99 ms | most ms | refused | failed | memory MiB |",
        )?;
        videofields::commands::say("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | --- |")?;
        let shared = [format!("/api/v1/scenes/{scene}/view.jpg?width=640&height=360")];
        let picture = [format!("/api/v1/cameras/{camera}/frame.jpg")];
        let told = [
            "/api/v1/cameras".to_owned(),
            format!("/api/v1/cameras/{camera}"),
            "/api/v1/scenes".to_owned(),
            format!("/api/v1/scenes/{scene}"),
            "/api/v1/events?limit=100".to_owned(),
            "/healthz".to_owned(),
        ];
        for (name, paths) in [
            ("one live view of 640 x 360", &shared[..]),
            ("one camera's live picture", &picture),
            ("JSON", &told),
        ] {
            for n_callers in &self.clients {
                let row = self.row(name, *n_callers, self.many(&client, paths, *n_callers)).await?;
                print(&row)?;
            }
        }
        for (name, paths) in [("one live view of 640 x 360", &shared[..]), ("JSON", &told)] {
            self.beside(&client, &scene, name, paths).await?;
        }
        let (columns, rows) = WALL_TILES;
        make_wall(&client, &scene).await?;
        let measured =
            self.row("a wall of 15 tiles of 400 x 600", u64::from(columns * rows), self.wall(&client)).await;
        // It goes whatever became of it.
        let removed = client.send("DELETE", &format!("/api/v1/walls/{WALL}"), &[("if-match", "*")], "").await;
        print(&measured?)?;
        ensure!(removed?.status == 204, "the wall {WALL} could not be taken away again");
        Ok(())
    }

    /// A row, and the same beside connections that take little or nothing, where these are asked for.
    async fn beside(&self, client: &Arc<Client>, scene: &str, name: &str, paths: &[String]) -> Result<()> {
        if self.slow_readers == 0 && self.idle == 0 {
            return Ok(());
        }
        let measured =
            |beside: String| self.row(beside, CALLERS_BESIDE, self.many(client, paths, CALLERS_BESIDE));
        print(&measured(format!("{name}, nobody beside")).await?)?;
        if self.slow_readers > 0 {
            let streams =
                [format!("/api/v1/scenes/{scene}/view.mjpeg?rate=30"), "/api/v1/events/stream".to_owned()];
            let _readers = Beside::slow(client, &streams, self.slow_readers);
            print(
                &measured(format!("{name}, beside {} readers of a byte a second", self.slow_readers)).await?,
            )?;
        }
        if self.idle > 0 {
            let _idle = Beside::idle(client, self.idle).await?;
            print(
                &measured(format!("{name}, beside {} connections that ask for nothing", self.idle)).await?,
            )?;
        }
        Ok(())
    }

    /// Measures one row, memory included.
    async fn row(
        &self,
        name: impl Into<String>,
        n_callers: u64,
        measuring: impl Future<Output = Result<Figures>>,
    ) -> Result<Row> {
        let before = self.pid.map(resident_mib).transpose()?;
        let figures = measuring.await?;
        let after = self.pid.map(resident_mib).transpose()?;
        Ok(Row {
            name: name.into(),
            n_callers,
            figures,
            resident_mib: before.zip(after).map(|(a, b)| [a, b]),
        })
    }

    /// So many callers, each asking for one of `paths` after the other.
    async fn many(&self, client: &Arc<Client>, paths: &[String], n_callers: u64) -> Result<Figures> {
        let clock = Arc::new(SystemClock::new());
        let mut callers = JoinSet::new();
        for number in 0..n_callers {
            let caller = Caller::new(client, &clock, self.window());
            let mut paths = paths.to_vec();
            let n_paths = paths.len();
            paths.rotate_left(number as usize % n_paths);
            callers.spawn(caller.ask_in_turns(paths));
        }
        self.sum(callers).await
    }

    /// A caller a tile; all of them ask for the next frame once each has the one before.
    async fn wall(&self, client: &Arc<Client>) -> Result<Figures> {
        let listed = client.json(&format!("/api/v1/walls/{WALL}/tiles")).await?;
        let tiles = listed["tiles"].as_array().context("a wall without tiles")?;
        let names: Vec<&str> = tiles.iter().filter_map(|tile| tile["id"].as_str()).collect();
        let clock = Arc::new(SystemClock::new());
        let step = Arc::new(Step {
            newest: AtomicU64::new(0),
            is_over: AtomicBool::new(false),
            together: Barrier::new(names.len()),
        });
        let mut callers = JoinSet::new();
        for name in names {
            let caller = Caller::new(client, &clock, self.window());
            callers.spawn(caller.ask_in_step(name.to_owned(), Arc::clone(&step)));
        }
        self.sum(callers).await
    }

    /// From when until when answers count.
    fn window(&self) -> [Duration; 2] {
        let warm_up = Duration::from_secs(self.seconds) / 5;
        [warm_up, warm_up + Duration::from_secs(self.seconds)]
    }

    async fn sum(&self, mut callers: JoinSet<Figures>) -> Result<Figures> {
        let mut all = Figures::of(Duration::from_secs(self.seconds));
        while let Some(figures) = callers.join_next().await {
            all.add(figures.context("a caller broke off")?);
        }
        Ok(all)
    }
}

/// What keeps the callers of a wall's tiles in step.
struct Step {
    /// The newest frame that anybody has; 0 before the first.
    newest: AtomicU64,
    is_over: AtomicBool,
    together: Barrier,
}

/// One caller, its connection, and what it met.
struct Caller {
    client: Arc<Client>,
    clock: Arc<SystemClock>,
    window: [Duration; 2],
    connection: Connection,
    figures: Figures,
}

impl Caller {
    fn new(client: &Arc<Client>, clock: &Arc<SystemClock>, window: [Duration; 2]) -> Self {
        let (client, clock) = (Arc::clone(client), Arc::clone(clock));
        Self { client, clock, window, connection: None, figures: Figures::default() }
    }

    fn is_over(&self) -> bool {
        self.clock.monotonic() >= self.window[1]
    }

    /// Asks for one path after the other until its time is over.
    async fn ask_in_turns(mut self, paths: Vec<String>) -> Figures {
        for path in paths.iter().cycle() {
            if self.is_over() {
                break;
            }
            self.ask(path).await;
        }
        self.figures
    }

    /// Asks for a tile of the next frame, whenever everybody has the one before, until somebody's time is over.
    async fn ask_in_step(mut self, tile: String, step: Arc<Step>) -> Figures {
        loop {
            if self.is_over() {
                step.is_over.store(true, Ordering::Release);
            }
            step.together.wait().await;
            // Nobody says so between the two: all leave after the same frame.
            let is_over = step.is_over.load(Ordering::Acquire);
            let newest = step.newest.load(Ordering::Acquire);
            step.together.wait().await;
            if is_over {
                return self.figures;
            }
            let at = if newest == 0 { String::new() } else { format!("?at={}", newest + 1) };
            let frame = self.ask(&format!("/api/v1/walls/{WALL}/tiles/{tile}/frame.jpg{at}")).await;
            step.newest.fetch_max(frame.unwrap_or_default(), Ordering::AcqRel);
        }
    }

    /// Asks once, and notes what came of it if that was in time; the frame of a wall that it was. Whoever is refused or cut
    /// off waits a moment.
    async fn ask(&mut self, path: &str) -> Option<u64> {
        let begun = self.clock.monotonic();
        let answer = self.client.get(&mut self.connection, path).await;
        let ended = self.clock.monotonic();
        let [from, until] = self.window;
        if (from..=until).contains(&ended) {
            self.figures.note(&answer, ended.saturating_sub(begun));
        }
        if !answer.as_ref().is_ok_and(|answer| answer.status == 200) {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        answer.ok().and_then(|answer| answer.wall_frame)
    }
}

async fn make_wall(client: &Client, scene: &str) -> Result<()> {
    let shown = client.json(&format!("/api/v1/scenes/{scene}")).await?;
    let place = |key: &str, default: [f64; 3]| match &shown["view"][key] {
        Value::Null => json!(default),
        place => place.clone(),
    };
    let (columns, rows) = WALL_TILES;
    let document = json!({
        "name": "for measuring",
        "scene": scene,
        "rate_hz": 60,
        "view": {"eye_m": place("eye_m", [0.0, -20.0, 10.0]), "target_m": place("target_m", [0.0, 0.0, 0.0])},
        "surface": {"grid": {
            "columns": columns, "rows": rows, "tile_px": [400, 600], "tile_m": [0.4, 0.6], "gap_m": [0.01, 0.01],
        }},
    });
    let path = format!("/api/v1/walls/{WALL}");
    let made = client.send("PUT", &path, &[("if-none-match", "*")], &document.to_string()).await?;
    if made.status != 201 {
        bail!("the wall {WALL} could not be made: {} {}", made.status, String::from_utf8_lossy(&made.body));
    }
    Ok(())
}

fn print(row: &Row) -> Result<()> {
    let Row { name, n_callers, figures, resident_mib } = row;
    let memory =
        resident_mib.map_or_else(|| "-".to_owned(), |[before, after]| format!("{before}, then {after}"));
    videofields::commands::say(&format!("| {name} | {n_callers} | {} | {memory} |", figures.columns()))
}
