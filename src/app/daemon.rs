//! Start order, supervision, signals: from a configuration to a running daemon and back.
//!
//! Order: store, scenes, cameras and renderer (`engine`), then the listener; stopped the other way round, so that
//! no request meets half a daemon and every background is written before the store closes.

mod audit;
mod evidence;
mod reload;
mod upkeep;

pub use reload::Load;

use crate::accuracy::{Keeper, KeeperSettings, Scope, Stage};
use anyhow::{Context, Result, bail};
use reload::Reload;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::runtime::Handle as Runtime;
use tokio::signal::unix::{SignalKind, signal};
use tokio::task::JoinSet;
use videofields_api::{self as api, Site, Tls};
use videofields_picture::scene::{self, Scene};
use videofields_recording::accounts::{Accounts, Audit};
use videofields_recording::archive::Archive;
use videofields_recording::signing::SigningKey;
use videofields_recording::store::Store;
use videofields_recording::telemetry::{self, Metrics};
use videofields_service::catalog::{Catalog, ConfiguredScene};
use videofields_service::engine::Engine;
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{CameraSettings, Config, SceneSettings, ServerSettings};

/// Time that a step of measuring in hand is given when the daemon stops.
const FINISH_TIME: Duration = Duration::from_millis(100);

/// Time for the database to be closed: with `engine`'s, less than the 3 s in which the daemon must be gone.
const CLOSE_TIME: Duration = Duration::from_millis(400);

/// Runs the daemon until SIGTERM or SIGINT; `announce` hears the page's URL once requests are answered. On SIGHUP the
/// configuration is what `load` reads then.
///
/// # Errors
/// When the store cannot be opened, the address cannot be taken, the certificate cannot be used, other machines could come
/// in without users, or a thread cannot be started. A camera or scene that fails stops nothing: the API shows its state.
pub fn serve(config: &Config, load: Load, announce: impl FnOnce(&str)) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .thread_name("videofields-io")
        .enable_all()
        .build()
        .context("cannot start the I/O threads")?;
    let outcome = runtime.block_on(run(config, load, announce));
    // A picture that is still being encoded has nobody left to read it.
    runtime.shutdown_background();
    outcome
}

async fn run(config: &Config, load: Load, announce: impl FnOnce(&str)) -> Result<()> {
    let mut terminate = signal(SignalKind::terminate()).context("cannot listen for SIGTERM")?;
    let mut interrupt = signal(SignalKind::interrupt()).context("cannot listen for SIGINT")?;
    let hangup = signal(SignalKind::hangup()).context("cannot listen for SIGHUP")?;
    let settings = config.settings();
    for overlap in settings.media_folders().overlaps() {
        tracing::warn!("{overlap}");
    }
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let tls = load_tls(&settings.server)?;
    // First the address: when another daemon holds it, nothing else should have been touched.
    let listen = settings.server.listen;
    let listener = TcpListener::bind(listen).await.with_context(|| format!("cannot listen on {listen}"))?;
    // Another daemon may hold the database for long: then there is nothing yet to be finished.
    let (store, catalog, key) = tokio::select! {
        opened = open(config, &clock) => opened?,
        _some = terminate.recv() => return Ok(()),
        _some = interrupt.recv() => return Ok(()),
    };
    // Nobody is let in where it is not known who may come in.
    let accounts =
        Accounts::open(store.clone(), Arc::clone(&clock)).await.context("cannot read the users")?;
    let accounts = Arc::new(accounts);
    if accounts.is_open() {
        let way_in = if !listen.ip().is_loopback() {
            Some(format!("{listen} can be reached from other machines"))
        } else if !settings.server.trusted_proxies.is_empty() {
            Some("the proxies of `server.trusted_proxies` let other machines in".to_owned())
        } else {
            None
        };
        if let Some(way_in) = way_in {
            bail!(
                "{way_in}, and while there are no users everybody may do everything: make the first with \
                 `videofields user FILE set NAME --role admin --password`"
            );
        }
    }
    let metrics = Arc::new(Metrics::new());
    if let Some(spans) = telemetry::spans() {
        metrics.adopt(spans).context("spans of traces are counted twice")?;
    }
    let order: Vec<_> = settings.scene.iter().map(|scene| scene.id.clone()).collect();
    let scenes = catalog.scenes(&order);
    // As they were changed while the daemon ran before.
    let in_file = config.settings().clone();
    let config = &config.clone().with_cameras(catalog.cameras());
    warn_of_unknown_cameras(&config.settings().camera, &scenes);
    let snapshots = evidence::open(config, &store, &metrics, &clock).await;
    let snapshots = snapshots.map(|snapshots| Arc::new(snapshots.signed_with(key.clone())));
    // Before any camera: nothing is shown where it is not known what nobody may see.
    let cameras = &config.settings().camera;
    let privacy = catalog.begin_privacy(cameras).await.context("cannot read the privacy zones")?;
    let hidden = config.with_privacy_zones(|id| privacy.get(id).map(|own| own.zones.to_vec()));
    let archive = start_archive(config, &store, &metrics, &clock).await?;
    if let (Some(archive), Some(key)) = (&archive, key) {
        archive.sign_exports(key);
    }
    let engine = Engine::start_recording(
        &hidden,
        scenes,
        store.clone(),
        Arc::clone(&metrics),
        Arc::clone(&clock),
        archive.clone(),
    )?;
    for (camera, privacy) in privacy {
        engine.handle().hold_privacy(camera.as_str(), privacy)?;
    }
    let keeper = start_keeper(config, &engine, &store, &clock)?;
    catalog.restore_playheads(&engine.handle());
    let address = listener.local_addr().context("the listener has no address")?;
    let url = format!("{}://{address}/", if tls.is_some() { "https" } else { "http" });
    tracing::info!(url, "listening");
    announce(&url);

    let stopped = async {
        tokio::select! {
            _some = terminate.recv() => tracing::info!("stopping on SIGTERM"),
            _some = interrupt.recv() => tracing::info!("stopping on SIGINT"),
        }
        upkeep::tell_stopping();
        keeper.request_stop();
        if let Some(archive) = &archive {
            archive.end_exports();
        }
        // Backgrounds are written while the last requests are answered: both together must fit into 3 s.
        engine.request_stop();
    };
    let forgetting = Arc::clone(&clock);
    let audit = Arc::new(Audit::new(store.clone()));
    let catalog = Arc::new(catalog);
    metrics.config_reload_success.set(1);
    metrics.config_reload_timestamp.set(clock.now().as_nanos() as f64 * 1e-9);
    let watched = Arc::clone(&metrics);
    let reload = Arc::new(Reload {
        load,
        catalog: Arc::clone(&catalog),
        engine: engine.reloader(),
        archive: archive.clone(),
        store: store.clone(),
        clock: Arc::clone(&clock),
        metrics,
        at_start: in_file.clone(),
        last: tokio::sync::Mutex::new(in_file),
    });
    let trust = api::Trust {
        accounts: Arc::clone(&accounts),
        audit: Arc::clone(&audit),
        catalog,
        snapshots: snapshots.clone(),
    };
    let site = Site {
        hosts: settings.server.hosts.clone(),
        is_encrypted: tls.is_some(),
        trusted_proxies: settings.server.trusted_proxies.clone(),
    };
    let router = api::router(engine.handle(), trust, Arc::clone(&clock), site);
    let mut upkeep = JoinSet::new();
    upkeep.spawn(upkeep::follow_accounts(Arc::downgrade(&accounts)));
    upkeep.spawn(upkeep::follow_signals(tls.clone(), Arc::downgrade(&accounts), Arc::clone(&reload), hangup));
    upkeep.spawn(upkeep::shorten_audit(Arc::downgrade(&reload)));
    let tools = (watched, Arc::clone(&clock));
    upkeep.spawn(audit::watch((store.clone(), audit), tools.clone()));
    upkeep.spawn(audit::anchor(store.clone(), settings.storage.clone(), tools));
    upkeep.spawn(upkeep::mend(Arc::downgrade(&reload)));
    upkeep.spawn(upkeep::keep_awake(engine.handle()));
    if let Some(snapshots) = snapshots {
        let schedule = evidence::schedule(config, clock.now());
        upkeep.spawn(evidence::keep(
            Arc::downgrade(&snapshots),
            engine.handle(),
            schedule,
            (store.clone(), Arc::clone(&clock)),
        ));
    }
    upkeep.spawn(upkeep::forget_old(
        store.clone(),
        (config.clone(), engine.reloader()),
        Arc::downgrade(&forgetting),
    ));
    api::serve(listener, tls, router, stopped).await;
    upkeep.shutdown().await;
    // Joining threads blocks; nothing else is left to do for this one.
    tokio::task::block_in_place(|| {
        keeper.stop(&*clock, FINISH_TIME);
        engine.stop();
        // Last, so that what the cameras handed over is written.
        if let Some(archive) = archive {
            archive.stop();
        }
    });
    store.close_within(CLOSE_TIME).await?;
    tracing::info!("stopped");
    Ok(())
}

/// What encrypts connections, where the configuration names a certificate.
fn load_tls(server: &ServerSettings) -> Result<Option<Arc<Tls>>> {
    if !server.is_encrypted() {
        return Ok(None);
    }
    let tls =
        Tls::load(&server.certificate, &server.private_key).context("connections cannot be encrypted")?;
    Ok(Some(Arc::new(tls)))
}

/// The recordings, where the configuration names a folder for them.
async fn start_archive(
    config: &Config,
    store: &Store,
    metrics: &Arc<Metrics>,
    clock: &Arc<dyn Clock>,
) -> Result<Option<Arc<Archive>>> {
    let settings = &config.settings().archive;
    if !settings.is_on() {
        return Ok(None);
    }
    let archive =
        Archive::start(settings.clone(), store.clone(), Arc::clone(metrics), Arc::clone(clock)).await;
    Ok(Some(Arc::new(archive.context("cannot start the thread that records")?)))
}

/// The thread that measures what this machine's accuracy costs.
fn start_keeper(config: &Config, engine: &Engine, store: &Store, clock: &Arc<dyn Clock>) -> Result<Keeper> {
    let settings = config.settings();
    let settings = KeeperSettings {
        scope: Scope::DAEMON,
        stages: Stage::of_plans(),
        render: settings.render.clone(),
        measures_at_start: settings.accuracy.measure_at_start,
    };
    Keeper::start(settings, engine.accuracy_board(), store.clone(), Runtime::current(), Arc::clone(clock))
        .context("cannot start the thread that measures costs")
}

async fn open(config: &Config, clock: &Arc<dyn Clock>) -> Result<(Store, Catalog, Option<Arc<SigningKey>>)> {
    let settings = config.settings();
    let store = Store::open(&settings.storage.database).await?;
    // Before anything is noted in it.
    let key = audit::sign(&settings.storage, &store, &**clock).await?;
    let (configured, _n_faulty) = configured_scenes(config, &store, &**clock).await;
    let folders = (config.folder().to_owned(), settings.media_folders());
    let catalog = Catalog::open(store.clone(), Arc::clone(clock), configured, folders).await;
    let catalog =
        catalog.context("cannot read what was kept of scenes, views, walls, cameras and playheads")?;
    Ok((store, catalog.with_cameras(&settings.camera), key))
}

/// The configured scenes. One whose file is at fault is served as it was last good, if the store still has it, and
/// left out otherwise: one bad document takes no other scene down.
/// The number of those at fault beside them.
async fn configured_scenes(
    config: &Config,
    store: &Store,
    clock: &dyn Clock,
) -> (Vec<ConfiguredScene>, usize) {
    let (mut scenes, mut n_faulty) = (Vec::new(), 0);
    for settings in &config.settings().scene {
        let loaded = load_scene(config, settings, store, clock).await.inspect_err(|error| {
            tracing::error!(scene = settings.id, error = format!("{error:#}"), "scene left out");
        });
        let (scene, is_faulty) =
            loaded.map_or((None, true), |(scene, is_old)| (Some(Arc::new(scene)), is_old));
        n_faulty += usize::from(is_faulty);
        scenes.push(ConfiguredScene { id: settings.id.clone(), file: settings.file.clone(), scene });
    }
    (scenes, n_faulty)
}

/// Cameras that a scene calibrates and the configuration does not have are never seen.
fn warn_of_unknown_cameras(cameras: &[CameraSettings], scenes: &[Arc<Scene>]) {
    for scene in scenes {
        for member in &scene.cameras {
            if !cameras.iter().any(|camera| camera.id == member.id) {
                tracing::warn!(scene = scene.id, camera = %member.id, "the scene has a camera that is not configured");
            }
        }
    }
}

/// A scene, and whether it is its last good document, since its file is at fault.
async fn load_scene(
    config: &Config,
    settings: &SceneSettings,
    store: &Store,
    clock: &dyn Clock,
) -> Result<(Scene, bool)> {
    match scene::load_file(&settings.id, &settings.file, config.settings().media_folders()) {
        Ok(parsed) => {
            // A scene that cannot be kept is still a scene.
            if let Err(error) = store.put_scene(&settings.id, &parsed.scene.document, clock.now()).await {
                tracing::error!(scene = settings.id, %error, "scene document not kept");
            }
            Ok((parsed.scene, false))
        }
        Err(error) => {
            let Some(kept) = store.scene(&settings.id).await? else { return Err(error.into()) };
            // Its calibrations stand in it, its models still beside the scene's file.
            let imports = scene::FolderImports::beside(&settings.file, config.settings().media_folders());
            let parsed = scene::parse(&settings.id, &kept.document, imports);
            let then = if parsed.is_ok() { "is served" } else { "cannot be served either" };
            tracing::error!(scene = settings.id, %error, "scene file at fault; its last good document {then}");
            Ok((parsed?.scene, true))
        }
    }
}
