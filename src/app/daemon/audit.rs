//! The audit log while the daemon runs: its signatures, and looks whether it is still as it was left.

use anyhow::{Context, Result};
use std::sync::Arc;
use std::time::Duration;
use videofields_recording::accounts::{Anchor, Audit};
use videofields_recording::signing::SigningKey;
use videofields_recording::store::{AuditKeys, Store};
use videofields_recording::telemetry::Metrics;
use videofields_vision::clock::Clock;
use videofields_vision::config::StorageSettings;

/// Time between two comparisons of the log's end with what was written last.
const LOOK_PERIOD: Duration = Duration::from_secs(10);

/// A pause after a failure is doubled so often at most.
const MAX_DOUBLINGS: u32 = 12;

/// Looks between two at all entries: an hour.
const LOOKS_A_WHOLE: u64 = 360;

/// Signs the audit log from now on, where a key is configured; the key.
///
/// # Errors
/// When the key cannot be read or the database fails: a daemon that is to sign does not run without.
pub(super) async fn sign(
    storage: &StorageSettings,
    store: &Store,
    clock: &dyn Clock,
) -> Result<Option<Arc<SigningKey>>> {
    if !storage.signs_audit() {
        tracing::info!("the audit log is not signed: storage.audit_key names no key");
        return Ok(None);
    }
    let key = SigningKey::read(&storage.audit_key).context("the audit log cannot be signed")?;
    let key = Arc::new(key);
    let is_replaced = !storage.audit_key_before.as_os_str().is_empty();
    let before = match is_replaced.then(|| SigningKey::read(&storage.audit_key_before)).transpose() {
        Ok(before) => before,
        // It has signed that the other takes over, and is needed no more.
        Err(error) if store.audit_signer().await? == Some(key.public()) => {
            tracing::warn!(%error, "storage.audit_key_before can be left out: the audit log is signed with storage.audit_key");
            None
        }
        Err(error) => {
            return Err(error).context("the key of the audit log that was used before cannot be read");
        }
    };
    let keys = AuditKeys { key: Arc::clone(&key), before, head_file: storage.audit_head.clone() };
    store.sign_audit(keys, clock.now()).await.context("the audit log cannot be signed")?;
    Ok(Some(key))
}

/// Tells in the log, and at a URL where one is configured, how far the audit log reaches: at most so often, and only what is new.
/// Tries again what is not taken, later and later, as the newest of then.
pub(super) async fn anchor(store: Store, storage: StorageSettings, tools: (Arc<Metrics>, Arc<dyn Clock>)) {
    let (metrics, clock) = tools;
    let interval = Duration::try_from_secs_f64(storage.audit_anchor_interval_secs).unwrap_or(LOOK_PERIOD);
    let url = storage.anchor_url();
    let (mut logged, mut told, mut n_failures) = (None, None, 0_u32);
    for _ in 0_u64.. {
        let wait = LOOK_PERIOD.saturating_mul(1 << n_failures.saturating_sub(1).min(MAX_DOUBLINGS));
        tokio::time::sleep(if n_failures > 0 { wait.min(interval) } else { interval }).await;
        let Some(anchor) = Anchor::of(&store.audit_state()) else { continue };
        if logged.as_ref() != Some(&anchor) {
            let (key, signature) = anchor.signed.clone().unwrap_or_default();
            let Anchor { number, digest, .. } = &anchor;
            tracing::info!(number, digest, key, signature, "newest entry of the audit log");
            logged = Some(anchor.clone());
        }
        let Some(url) = url.as_ref().filter(|_| told.as_ref() != Some(&anchor)) else { continue };
        match anchor.tell(url, clock.now()).await {
            Ok(()) => (told, n_failures) = (Some(anchor), 0),
            Err(error) => {
                metrics.audit_anchors_failed.inc();
                n_failures = n_failures.saturating_add(1);
                if n_failures == 1 {
                    tracing::warn!(%error, "the newest entry of the audit log cannot be told elsewhere; it is tried again");
                }
            }
        }
    }
}

/// Looks every few seconds whether the log's end is as it was written, and every hour at all of it; counts what is wrong. Tells in the
/// log how often what is noted once came again.
pub(super) async fn watch(
    (store, audit): (Store, Arc<Audit>),
    (metrics, clock): (Arc<Metrics>, Arc<dyn Clock>),
) {
    for n_looks in 0_u64.. {
        let looked = match n_looks % LOOKS_A_WHOLE {
            0 => store.check_whole_audit(clock.now()).await,
            _ => store.check_audit_head(clock.now()).await,
        };
        if let Err(error) = audit.tell_counts(clock.monotonic(), clock.now()).await {
            tracing::error!(%error, "how often something was tried could not be noted in the audit log");
        }
        if let Err(error) = looked {
            tracing::error!(%error, "the audit log cannot be looked at");
        }
        let known = metrics.audit_faults.get();
        metrics.audit_faults.inc_by(store.audit_state().n_faults.saturating_sub(known));
        tokio::time::sleep(LOOK_PERIOD).await;
    }
}
