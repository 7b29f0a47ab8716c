//! The HTTP control interface: one file a resource, over the engine's door and nothing else of the engine.
//!
//! Requests flow in, are held to limits (`guard`), read strictly (`query`) and asked of the [`Handle`]; pictures are
//! encoded off the async threads (`picture`); every failure leaves as a problem document (`error`). GET and
//! HEAD show; what changes something has a method of its own, and is refused where a page of another site asks for it.

mod accuracy;
mod activity;
mod address;
mod admission;
mod alignment;
mod assets;
mod audit;
mod calibration_import;
mod calibration_solve;
mod calibration_vanishing;
mod calibrations;
mod camera_documents;
mod cameras;
mod change_budget;
mod compress;
mod conditions;
mod connection;
mod content;
mod contract;
mod documents;
mod effects;
mod effort;
mod encoding;
mod entities;
mod error;
mod event_stream;
mod events;
mod exports;
mod files;
mod foreground;
mod foreground_writer;
mod frames;
mod guard;
mod guests;
mod health;
mod idempotency;
mod identity;
mod jobs;
mod kept;
mod locate;
mod log_budget;
mod long_questions;
mod looks;
mod metrics;
mod naming;
mod openapi;
mod operation;
mod page;
mod pages;
mod parameters;
mod picture;
mod plan;
mod playheads;
mod present;
mod privacy;
mod query;
mod scene_exchange;
mod scenes;
mod schema;
mod screens;
mod segments;
mod serve;
mod session;
mod shares;
mod snapshot_making;
mod snapshots;
mod sockets;
mod source_discovery;
mod source_files;
mod source_looks;
mod streams;
mod strip;
mod system;
mod tags;
mod timeline;
mod tls;
mod tokens;
mod tracks;
mod tune;
mod turns;
mod users;
mod view;
mod views;
mod wall_rounds;
mod wall_tiles;
mod walls;
mod which_cameras;

pub use serve::{ConnectionTimes, serve, serve_within};
pub use tls::{Tls, TlsError};
pub use view::read_view_request;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::http::Uri;
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::Response;
use error::Problem;
use identity::Identity;
use openapi::Routes;
use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;
use videofields_recording::accounts::{Accounts, Audit};
use videofields_service::catalog::Catalog;
use videofields_service::engine::{EngineError, Handle};
use videofields_service::evidence::Snapshots;
use videofields_service::wall::FrameLock;
use videofields_vision::access::Grants;
use videofields_vision::clock::Clock;
use videofields_vision::config::Network;
use videofields_vision::error::ErrorKind;

/// What requests are held to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Longest path and query together, bytes. Default 2048.
    pub target_bytes: usize,
    /// Most bytes of header fields. Default 16384.
    pub field_bytes: usize,
    /// Longest time until the answer begins; then 503. Default 10 s.
    pub request_time: Duration,
    /// Requests answered at once, strangers', the probes and metrics not counted; more get 503, and so does a user who has as many as
    /// are left for others. Default 64.
    pub requests_at_once: usize,
    /// Most bytes of pictures that clients have asked for and not taken yet, 1 MiB to 1 TiB; more get 503. Default
    /// 256 MiB.
    pub answer_bytes: usize,
    /// Pictures encoded at once; more wait. Default: the machine's processors.
    pub encoders: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            target_bytes: 2048,
            field_bytes: 16_384,
            request_time: Duration::from_secs(10),
            requests_at_once: 64,
            answer_bytes: 256 << 20,
            encoders: std::thread::available_parallelism().map_or(1, std::num::NonZero::get),
        }
    }
}

/// State that every route has at hand: the caller's own, and the one that all requests share. Cheap to clone, which every layer of every
/// request does.
#[derive(Clone)]
struct Api {
    /// The engine as the caller may see it.
    door: Handle,
    /// Who asks.
    identity: Identity,
    /// The connection by which the request came.
    connection: connection::Connection,
    common: Arc<Common>,
}

impl Deref for Api {
    type Target = Common;

    fn deref(&self) -> &Common {
        &self.common
    }
}

/// State that all requests share.
struct Common {
    /// The engine; routes have their caller's `door` instead.
    whole: Handle,
    /// Users and tokens; without, everybody may do everything.
    accounts: Option<Arc<Accounts>>,
    /// Where it is noted what callers do.
    audit: Option<Arc<Audit>>,
    /// What people keep; without, nothing can be changed for good.
    catalog: Option<Arc<Catalog>>,
    /// What people keep as evidence; without, no snapshots are made.
    snapshots: Option<Arc<Snapshots>>,
    clock: Arc<dyn Clock>,
    /// By the clock's monotonic time.
    started: Duration,
    limits: Limits,
    admission: admission::Admission,
    encoders: turns::Turns<String>,
    encoding_pace: encoding::EncodingPace,
    /// Requests with bodies that take a processor for long.
    large_bodies: turns::Turns<String>,
    /// Questions that take a processor for long.
    computations: turns::Turns<String>,
    /// Pictures of the past that are looked for, and drawn.
    replays: turns::Turns<String>,
    streams: shares::Shares<String>,
    listeners: shares::Shares<String>,
    /// Bytes of `Limits::answer_bytes`.
    answers: shares::Shares<String>,
    site: Arc<Site>,
    frames: Arc<FrameLock>,
    rounds: Arc<wall_rounds::Rounds>,
    screens: Arc<screens::Screens>,
    feeds: Arc<foreground::Feeds>,
    /// Of pictures that were shown.
    tags: Arc<tags::KnownTags>,
    /// Lines that strangers may still have written into the log.
    stranger_lines: Arc<log_budget::LogBudget>,
    /// Changes that users may still make.
    change_budget: change_budget::ChangeBudget,
    /// Answers to jobs that were asked for with a key.
    answered: Arc<idempotency::Answered>,
    /// Scenes of other programs that are taken in at once.
    imports: Arc<Semaphore>,
    /// Sources that are looked at at once.
    looks: shares::Shares<String>,
    /// Snapshots that are made at once, and archives of them that are on their way.
    snapshot_makings: shares::Shares<String>,
    archives: shares::Shares<String>,
    /// Searches for cameras in the network at once.
    discoveries: Arc<Semaphore>,
}

impl Api {
    /// What people keep.
    fn catalog(&self) -> Result<&Arc<Catalog>, Problem> {
        self.catalog
            .as_ref()
            .ok_or_else(|| Problem::new(ErrorKind::Unavailable, "nothing is kept by this daemon"))
    }

    /// Asks the engine what may take a while, on a thread that may block; `action` is what a panic broke off.
    async fn ask<T: Send + 'static>(
        &self,
        action: &'static str,
        question: impl FnOnce(Handle) -> Result<T, EngineError> + Send + 'static,
    ) -> Result<T, EngineError> {
        let door = self.door.clone();
        let asked = tokio::task::spawn_blocking(move || question(door)).await;
        asked.unwrap_or_else(|panicked| Err(EngineError::Internal(format!("{action}: {panicked}"))))
    }
}

/// How the daemon is reached.
#[derive(Clone, Debug, Default)]
pub struct Site {
    /// Names by which it may be addressed, beside IP addresses and `localhost`.
    pub hosts: Vec<String>,
    /// Whether connections are encrypted by the daemon itself: browsers are then told to come in no other way.
    pub is_encrypted: bool,
    /// Addresses of proxies that are believed where they say for whom they ask.
    pub trusted_proxies: Vec<Network>,
}

/// Who is let in, and where it is noted what they do.
#[derive(Clone)]
pub struct Trust {
    /// Users and tokens.
    pub accounts: Arc<Accounts>,
    /// What they did.
    pub audit: Arc<Audit>,
    /// What they keep.
    pub catalog: Arc<Catalog>,
    /// What they keep as evidence; none where the folder for it cannot be used.
    pub snapshots: Option<Arc<Snapshots>>,
}

/// The whole interface over `door`, with the default [`Limits`]; `clock` measures what requests take.
pub fn router(door: Handle, trust: Trust, clock: Arc<dyn Clock>, site: Site) -> Router {
    router_within(Limits::default(), (door, Some(trust)), clock, site)
}

/// As [`router`], with limits of the caller's; without `trust` everybody may do everything, and nothing is noted.
pub fn router_within(
    limits: Limits,
    (door, trust): (Handle, Option<Trust>),
    clock: Arc<dyn Clock>,
    site: Site,
) -> Router {
    let frame_lock = Arc::new(FrameLock::new(clock.now(), clock.monotonic()));
    let nobodys = door.within(Arc::new(Grants::nothing()));
    let common = Common {
        whole: door,
        accounts: trust.as_ref().map(|trust| Arc::clone(&trust.accounts)),
        audit: trust.as_ref().map(|trust| Arc::clone(&trust.audit)),
        snapshots: trust.as_ref().and_then(|trust| trust.snapshots.clone()),
        catalog: trust.map(|trust| trust.catalog),
        started: clock.monotonic(),
        clock,
        limits,
        admission: admission::Admission::new(&limits),
        encoders: turns::Turns::new(limits.encoders),
        encoding_pace: encoding::EncodingPace::default(),
        large_bodies: turns::Turns::with_one_for_others(long_questions::at_once()),
        computations: turns::Turns::with_one_for_others(long_questions::at_once()),
        replays: turns::Turns::with_one_for_others(long_questions::at_once()),
        streams: frames::places(),
        listeners: guests::listeners(),
        answers: picture::answers(limits.answer_bytes),
        site: Arc::new(site),
        frames: frame_lock,
        rounds: Arc::default(),
        screens: Arc::default(),
        feeds: Arc::default(),
        tags: Arc::default(),
        stranger_lines: Arc::default(),
        change_budget: change_budget::ChangeBudget::default(),
        answered: Arc::default(),
        imports: Arc::new(Semaphore::new(scene_exchange::AT_ONCE)),
        looks: source_looks::places(),
        snapshot_makings: snapshot_making::places(),
        archives: snapshots::archive_places(),
        discoveries: Arc::new(Semaphore::new(source_discovery::AT_ONCE)),
    };
    let api = Api {
        door: nobodys,
        identity: Identity::everybody(),
        connection: connection::Connection::default(),
        common: Arc::new(common),
    };
    let limited = resources()
        .router()
        .merge(page::routes())
        .layer(DefaultBodyLimit::max(content::MAX_BODY_BYTES))
        .layer(from_fn(tags::spare))
        .layer(from_fn_with_state(api.clone(), guests::bound_listeners))
        .layer(from_fn(compress::mark))
        .layer(compress::layer())
        .layer(from_fn(compress::tell_compressed))
        // Within the limits: what is noted of a change is what came of it, though its caller heard that it takes too long.
        .layer(from_fn_with_state(api.clone(), audit::note))
        .layer(from_fn_with_state(api.clone(), admission::admit));
    probes()
        .router()
        .merge(limited)
        .fallback(no_route)
        .method_not_allowed_fallback(no_method)
        .layer(from_fn_with_state(api.clone(), identity::identify))
        .layer(from_fn_with_state(api.clone(), guard::observe))
        .with_state(api)
}

/// Routes about everything there is.
fn resources() -> Routes {
    let all = [
        contract::routes(),
        system::routes(),
        cameras::routes(),
        locate::routes(),
        tune::routes(),
        camera_documents::routes(),
        source_looks::routes(),
        source_files::routes(),
        source_discovery::routes(),
        privacy::routes(),
        calibrations::routes(),
        calibration_import::routes(),
        calibration_solve::routes(),
        calibration_vanishing::routes(),
        strip::routes(),
        events::routes(),
        scenes::routes(),
        scene_exchange::routes(),
        assets::routes(),
        view::routes(),
        plan::routes(),
        timeline::routes(),
        activity::routes(),
        tracks::routes(),
        alignment::routes(),
        walls::routes(),
        wall_tiles::routes(),
        screens::routes(),
        views::routes(),
        streams::routes(),
        sockets::routes(),
        foreground::routes(),
        event_stream::routes(),
        present::routes(),
        playheads::routes(),
        exports::routes(),
        jobs::routes(),
        snapshots::routes(),
        which_cameras::routes(),
        entities::routes(),
        accuracy::routes(),
        session::routes(),
        users::routes(),
        tokens::routes(),
        audit::routes(),
    ];
    all.into_iter().fold(Routes::of(system::TAG, parameters::NONE), Routes::merge)
}

/// Routes for who watches the daemon: answered also while it has too much to do.
fn probes() -> Routes {
    health::routes().merge(metrics::routes())
}

/// All that the contract describes.
fn described() -> Routes {
    resources().merge(probes())
}

async fn no_route(uri: Uri) -> Problem {
    let shown = query::shown(uri.path());
    let detail =
        format!("there is nothing at {shown}; the interface begins at /api/v1/cameras and /api/v1/scenes");
    Problem::new(ErrorKind::NotFound, detail)
}

/// Of the page's files; every other route says itself what it takes.
async fn no_method() -> Response {
    error::only(&["GET", "HEAD"])
}
