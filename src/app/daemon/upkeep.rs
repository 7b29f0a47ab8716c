//! What goes on beside answering: users and certificates are read again, the service manager hears that all is well.

use super::reload::Reload;
use sd_notify::NotifyState;
use std::sync::{Arc, Weak};
use std::time::Duration;
use tokio::signal::unix::Signal;
use videofields_api::Tls;
use videofields_recording::accounts::Accounts;
use videofields_recording::store::{AgeLimits, Store};
use videofields_service::engine::{Handle, Reloader};
use videofields_vision::clock::Clock;
use videofields_vision::config::{CameraSettings, Config};
use videofields_vision::frame::CameraId;

/// How often users and tokens are read again: what another process revoked holds after a minute at the latest.
const ACCOUNTS_PERIOD: Duration = Duration::from_secs(20);

/// How often the certificate is read again.
const CERTIFICATE_PERIOD: Duration = Duration::from_secs(60);

/// How often it is looked for what is too old.
const FORGET_PERIOD: Duration = Duration::from_secs(3600);
/// How often the audit log is looked at for what is too old.
const AUDIT_PERIOD: Duration = Duration::from_secs(3600);

/// How often cameras without a thread are looked for.
const MEND_PERIOD: Duration = Duration::from_secs(10);

/// Longest time in which the engine must answer before it counts as hung.
const ANSWER_TIME: Duration = Duration::from_secs(5);

/// Learns what another process, such as `videofields user`, changed of users and tokens.
pub(super) async fn follow_accounts(accounts: Weak<Accounts>) {
    // Until the daemon lets go of them.
    while let Some(accounts) = accounts.upgrade() {
        if let Err(error) = accounts.reload().await {
            tracing::error!(%error, "users and tokens cannot be read again; those known hold on");
        }
        drop(accounts);
        tokio::time::sleep(ACCOUNTS_PERIOD).await;
    }
}

/// Reads the certificate again once a minute and, with the configuration and the users, whenever SIGHUP asks for it. The service
/// manager hears when that begins and when it is done.
pub(super) async fn follow_signals(
    tls: Option<Arc<Tls>>,
    accounts: Weak<Accounts>,
    configuration: Arc<Reload>,
    mut hangup: Signal,
) {
    loop {
        let is_asked = tokio::select! {
            received = hangup.recv() => match received {
                Some(()) => true,
                None => return,
            },
            () = tokio::time::sleep(CERTIFICATE_PERIOD) => false,
        };
        let Some(accounts) = accounts.upgrade() else { return };
        if is_asked {
            tracing::info!("reading configuration, users and certificate again on SIGHUP");
            tell_reloading();
            if let Err(error) = accounts.reload().await {
                tracing::error!(%error, "users and tokens cannot be read again; those known hold on");
            }
            configuration.read_again().await;
        }
        if let Some(tls) = tls.clone() {
            reload(tls).await;
        }
        if is_asked {
            notify(&[NotifyState::Ready]);
        }
    }
}

/// Tries again, every few seconds, to start cameras whose thread could not be started.
pub(super) async fn mend(configuration: Weak<Reload>) {
    // Until the daemon lets go of it.
    while let Some(configuration) = configuration.upgrade() {
        if let Err(error) = tokio::task::spawn_blocking(move || configuration.mend()).await {
            tracing::error!(%error, "starting cameras broke off");
        }
        tokio::time::sleep(MEND_PERIOD).await;
    }
}

/// Removes what is too old of the audit log, at the start and every hour.
pub(super) async fn shorten_audit(configuration: Weak<Reload>) {
    // Until the daemon lets go of it.
    while let Some(configuration) = configuration.upgrade() {
        configuration.shorten_audit().await;
        drop(configuration);
        tokio::time::sleep(AUDIT_PERIOD).await;
    }
}

fn tell_reloading() {
    match NotifyState::monotonic_usec_now() {
        Ok(now) => notify(&[NotifyState::Reloading, now]),
        Err(error) => tracing::warn!(%error, "the service manager cannot be told"),
    }
}

async fn reload(tls: Arc<Tls>) {
    match tokio::task::spawn_blocking(move || tls.reload()).await {
        Ok(Ok(true)) => tracing::info!("new connections get the new certificate"),
        Ok(Ok(false)) => {}
        Ok(Err(error)) => {
            let error = format!("{:#}", anyhow::Error::from(error));
            tracing::error!(error, "the certificate cannot be read again; the last good one goes on");
        }
        Err(error) => tracing::error!(%error, "reading the certificate broke off"),
    }
}

/// Tells the service manager, where there is one, that requests are answered; and from then on, as often as it asks, that
/// the daemon still answers questions. One that is stuck falls silent, and is started again; of a renderer that hangs in its
/// driver callers are told, and it is opened anew.
pub(super) async fn keep_awake(door: Handle) {
    notify(&[NotifyState::Ready]);
    if let Some(period) = sd_notify::watchdog_enabled() {
        beat(door, period / 2).await;
    }
}

/// Says every `period` that the engine answers, while it does.
async fn beat(door: Handle, period: Duration) -> ! {
    loop {
        let door = door.clone();
        let asked = tokio::task::spawn_blocking(move || door.readiness());
        match tokio::time::timeout(ANSWER_TIME, asked).await {
            Ok(Ok(readiness)) => {
                let [with_frames, all] = readiness.cameras_with_frames;
                let status = format!("{with_frames} of {all} cameras have pictures");
                notify(&[NotifyState::Watchdog, NotifyState::Status(&status)]);
            }
            Ok(Err(error)) => tracing::error!(%error, "asking the engine broke off"),
            Err(_elapsed) => tracing::error!("the engine did not answer within {ANSWER_TIME:?}"),
        }
        tokio::time::sleep(period).await;
    }
}

/// Removes what is older than the configuration allows, at the start and once an hour.
pub(super) async fn forget_old(store: Store, (config, engine): (Config, Reloader), clock: Weak<dyn Clock>) {
    let settings = config.settings();
    let nanos = |days: f64| (days * 86_400e9) as i64;
    let limits = AgeLimits {
        tracks_nanos: nanos(settings.storage.tracks_max_age_days),
        activity_nanos: nanos(settings.storage.activity_max_age_days),
        backgrounds_nanos: nanos(settings.storage.background_history_max_age_days),
    };
    // Until the daemon lets go of it.
    while let Some(clock) = clock.upgrade() {
        // Cameras come and go.
        let cameras = engine.cameras();
        let ids = |wanted: fn(&&CameraSettings) -> bool| -> Vec<CameraId> {
            cameras.iter().filter(wanted).map(|camera| camera.id.clone()).collect()
        };
        // The time of a film with a beginning of its own is not the clock's.
        let (configured, steady) = (ids(|_| true), ids(|camera| camera.source.start.is_some()));
        match store.forget_old(&limits, clock.now(), (&configured, &steady)).await {
            Ok(0) => {}
            Ok(n_rows) => tracing::info!(n_rows, "what was too old was removed"),
            Err(error) => tracing::error!(%error, "what is too old is not removed"),
        }
        drop(clock);
        tokio::time::sleep(FORGET_PERIOD).await;
    }
}

/// Tells the service manager that the daemon ends.
pub(super) fn tell_stopping() {
    notify(&[NotifyState::Stopping]);
}

fn notify(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        tracing::warn!(%error, "the service manager cannot be told");
    }
}
