//! The configuration read again while the daemon runs: what is at fault is told and changes nothing, what is good takes effect
//! as `config::restart` says of each key.

use super::{configured_scenes, warn_of_unknown_cameras};
use std::sync::Arc;
use videofields_recording::archive::Archive;
use videofields_recording::store::Store;
use videofields_recording::telemetry::Metrics;
use videofields_service::catalog::Catalog;
use videofields_service::engine::Reloader;
use videofields_vision::clock::Clock;
use videofields_vision::config::{Config, ConfigError, Effect, Settings, changed_keys};

/// Reads the configuration: the file, the environment and the command line, as at the start.
pub type Load = Arc<dyn Fn() -> Result<Config, ConfigError> + Send + Sync>;

/// What the daemon goes on with.
pub(super) struct Reload {
    pub(super) load: Load,
    pub(super) catalog: Arc<Catalog>,
    pub(super) engine: Reloader,
    pub(super) archive: Option<Arc<Archive>>,
    pub(super) store: Store,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) metrics: Arc<Metrics>,
    /// As it was at the start: what takes effect at a restart is held against this.
    pub(super) at_start: Settings,
    /// As it was read last, without what was changed through the API. Held while it is read again.
    pub(super) last: tokio::sync::Mutex<Settings>,
}

impl Reload {
    /// Reads the configuration again and goes on with it; where it is at fault, with the last good one.
    pub(super) async fn read_again(&self) {
        let mut last = self.last.lock().await;
        let load = Arc::clone(&self.load);
        let config = match tokio::task::spawn_blocking(move || load()).await {
            Ok(Ok(config)) => config,
            Ok(Err(error)) => {
                for fault in error.to_string().lines() {
                    tracing::error!(fault, "the configuration is at fault; the last good one goes on");
                }
                return self.tell(Outcome::Fault);
            }
            Err(error) => {
                tracing::error!(%error, "reading the configuration broke off; the last good one goes on");
                return self.tell(Outcome::Fault);
            }
        };
        let settings = config.settings();
        let named = |before: &Settings, effect: Effect| {
            let changed = changed_keys(before, settings).into_iter().filter(|key| key.effect == effect);
            changed.map(|key| key.key).collect::<Vec<_>>().join(", ")
        };
        let (at_once, new) = (named(&last, Effect::AtOnce), named(&last, Effect::ForNewCameras));
        let at_restart = named(&self.at_start, Effect::AtRestart);
        let (scenes, n_faulty) = configured_scenes(&config, &self.store, &*self.clock).await;
        let order: Vec<String> = settings.scene.iter().map(|scene| scene.id.clone()).collect();
        let folders = settings.media_folders();
        let applied = self.catalog.reconfigure(
            (&settings.camera, scenes, folders),
            &order,
            |cameras, zones, scenes| {
                warn_of_unknown_cameras(&cameras, &scenes);
                // Threads that end are waited for.
                tokio::task::block_in_place(|| {
                    let failed = self.engine.apply_cameras(&cameras, zones, settings);
                    self.engine.apply_scenes(scenes);
                    failed
                })
            },
        );
        match applied.await {
            Ok(failed) => {
                for (camera, error) in failed {
                    tracing::error!(%camera, error, "a camera's thread cannot be started; it is tried again");
                }
            }
            Err(error) => {
                tracing::error!(%error, "the privacy zones cannot be kept; the last good configuration goes on");
                return self.tell(Outcome::Fault);
            }
        }
        if let Some(archive) = &self.archive {
            archive.reconfigure(settings.archive.clone());
        }
        *last = settings.clone();
        if !at_restart.is_empty() {
            tracing::warn!(
                keys = at_restart,
                "changed keys that take effect when the daemon is started again"
            );
        }
        tracing::info!(at_once, for_new_cameras = new, "the configuration was read again");
        self.tell(if n_faulty == 0 { Outcome::Good } else { Outcome::Fault });
    }

    /// Removes what is too old of the audit log, as the configuration has it that was read last; which went stands in the log.
    pub(super) async fn shorten_audit(&self) {
        let max_age_days = self.last.lock().await.storage.audit_max_age_days;
        if max_age_days <= 0.0 {
            return;
        }
        let age_nanos = (max_age_days * 86_400e9) as i64;
        loop {
            let now = self.clock.now();
            let (last, digest) =
                match self.store.shorten_audit(now.saturating_add_nanos(-age_nanos), now).await {
                    Ok(Some(removed)) => removed,
                    Ok(None) => return,
                    Err(error) => return tracing::error!(%error, "the audit log cannot be shortened"),
                };
            tracing::info!(last, digest, "entries of the audit log are removed for their age");
        }
    }

    /// Tries again what could not be started.
    pub(super) fn mend(&self) {
        self.engine.mend();
    }

    fn tell(&self, outcome: Outcome) {
        self.metrics.config_reload_success.set(i64::from(outcome == Outcome::Good));
        if outcome == Outcome::Good {
            self.metrics.config_reload_timestamp.set(self.clock.now().as_nanos() as f64 * 1e-9);
        }
        // Last: who waits for this one finds the others as they are since.
        self.metrics.config_reloads.inc();
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Good,
    /// The file, or that of a scene, is at fault.
    Fault,
}
