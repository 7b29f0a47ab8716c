//! Snapshots: opened at start, made by schedule, and removed when they are old.

use std::sync::{Arc, Weak};
use std::time::Duration;
use videofields_api as api;
use videofields_recording::store::{AuditEntry, Store};
use videofields_recording::telemetry::Metrics;
use videofields_service::engine::{At, BlurAsked, Handle};
use videofields_service::evidence::{Schedule, Scheduled, SnapshotSettings, Snapshots, Subject, Wanted};
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::{Config, SnapshotScheduleSettings};
use videofields_vision::error::join_faults;

/// Between two looks at what has fallen due.
const DUE_PERIOD: Duration = Duration::from_secs(1);

/// Of these looks, every so many also look at what is too old.
const LOOKS_A_RETENTION: u32 = 600;

/// The snapshots. Where their folder cannot be used the daemon goes on without them: cameras come first.
pub(super) async fn open(
    config: &Config,
    store: &Store,
    metrics: &Arc<Metrics>,
    clock: &Arc<dyn Clock>,
) -> Option<Snapshots> {
    let settings = SnapshotSettings::from(&config.settings().storage);
    let opened = Snapshots::open(settings, store.clone(), Arc::clone(metrics), Arc::clone(clock)).await;
    match opened {
        Ok(snapshots) => Some(snapshots),
        Err(error) => {
            tracing::error!(%error, "no snapshots are kept until the next start");
            None
        }
    }
}

/// What the configuration wants to be made by itself. One whose parameters are at fault is told and left out.
pub(super) fn schedule(config: &Config, now: Timestamp) -> Schedule {
    let read = |of: &SnapshotScheduleSettings| {
        let subject = match &of.camera {
            Some(camera) => Ok(Subject::Camera { camera: camera.to_string(), at: At::Live }),
            None => api::read_view_request(&of.scene, &of.parameters).map(|request| Subject::View {
                request: Box::new(request),
                parameters: of.parameters.clone(),
            }),
        };
        match subject {
            Ok(subject) => {
                let blur_people = of.blur_people.then(BlurAsked::default);
                let (note, tags) = (of.note.clone(), of.tags.clone());
                let wanted = Wanted { subject, note, tags, hold: false, blur_people };
                let period_nanos = (of.interval_mins * 60e9) as i64;
                Some(Scheduled { id: of.id.clone(), period_nanos, wanted })
            }
            Err(faults) => {
                let faults = join_faults(&faults);
                tracing::error!(
                    schedule = of.id,
                    faults,
                    "a snapshot that was to be made by itself is left out"
                );
                None
            }
        }
    };
    Schedule::new(config.settings().snapshot.iter().filter_map(read).collect(), now)
}

/// Makes what falls due and removes what is old, until the daemon ends. What is made stands in the audit log, as if somebody had
/// asked for it.
pub(super) async fn keep(
    snapshots: Weak<Snapshots>,
    door: Handle,
    mut schedule: Schedule,
    (store, clock): (Store, Arc<dyn Clock>),
) {
    let mut n_looks = 0_u32;
    // Until the daemon lets go of them.
    while let Some(snapshots) = snapshots.upgrade() {
        if n_looks.is_multiple_of(LOOKS_A_RETENTION)
            && let Err(error) = snapshots.remove_old().await
        {
            tracing::error!(%error, "old snapshots stay for now");
        }
        n_looks = n_looks.wrapping_add(1);
        // What comes to nothing is counted and told where it is made.
        for (id, made) in schedule.make_due(&snapshots, &door, clock.now()).await {
            let Ok(made) = made else { continue };
            let people = if schedule.blurs_people(&id) { "blurred" } else { "seen" };
            let entry = AuditEntry {
                at: clock.now(),
                user: None,
                action: "snapshot by schedule".to_owned(),
                target: format!("/api/v1/snapshots#snapshot={made}&schedule={id}&people={people}"),
                status: 201,
            };
            if let Err(error) = store.append_audit(&entry).await {
                tracing::error!(%error, ?entry, "a snapshot could not be noted in the audit log");
            }
        }
        drop(snapshots);
        tokio::time::sleep(DUE_PERIOD).await;
    }
}
