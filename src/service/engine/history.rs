//! When a camera's background goes to its history: an interval of scene time after the last entry.

use videofields_recording::store::{BackgroundHistoryBounds, BackgroundRecord, Store, StoreError};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::StorageSettings;

/// One camera's history of backgrounds.
#[derive(Debug)]
pub(super) struct History {
    interval_nanos: i64,
    bounds: BackgroundHistoryBounds,
    last: Last,
}

/// Scene time of the entry before.
#[derive(Clone, Copy, Debug)]
enum Last {
    /// The store was not asked yet. It must be: restarts bring no entries of their own.
    Unasked,
    /// There is none.
    Never,
    At(Timestamp),
}

impl History {
    /// What the settings ask for; none where they switch it off.
    pub(super) fn new(settings: &StorageSettings) -> Option<Self> {
        let mins = settings.background_history_interval_mins;
        (mins > 0.0).then(|| Self {
            // At least one: a camera that shows nothing new writes the same background again and again.
            interval_nanos: ((mins * 60e9) as i64).max(1),
            bounds: BackgroundHistoryBounds {
                count: settings.background_history_count,
                bytes: u64::from(settings.background_history_mib) << 20,
            },
            last: Last::Unasked,
        })
    }

    /// Keeps `record` if the interval has passed since the last entry, or time has stepped back behind it.
    ///
    /// # Errors
    /// When the store fails, which the next offer tries again, or the record does not fit, which is not tried again
    /// for an interval.
    pub(super) async fn offer(&mut self, store: &Store, record: &BackgroundRecord) -> Result<(), StoreError> {
        if matches!(self.last, Last::Unasked) {
            self.last = store.last_background_history(&record.camera).await?.map_or(Last::Never, Last::At);
        }
        if !self.is_due(record.saved_at) {
            return Ok(());
        }
        let put = store.put_background_history(record, self.bounds).await;
        if matches!(put, Ok(()) | Err(StoreError::TooLarge { .. })) {
            self.last = Last::At(record.saved_at);
        }
        put
    }

    fn is_due(&self, now: Timestamp) -> bool {
        let Last::At(last) = self.last else { return true };
        !(0..self.interval_nanos).contains(&now.nanos_since(last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::frame::{CameraId, ColorMatrix};

    #[test]
    fn an_entry_is_due_after_the_interval_and_whenever_time_steps_back() {
        let settings =
            StorageSettings { background_history_interval_mins: 0.5, ..StorageSettings::default() };
        let mut history = History::new(&settings).unwrap();
        assert_eq!(history.bounds, BackgroundHistoryBounds { count: 48, bytes: 512 << 20 });
        let secs = |secs: i64| Timestamp::from_nanos(secs * 1_000_000_000);
        history.last = Last::Never;
        assert!(history.is_due(secs(0)));
        history.last = Last::At(secs(100));
        assert_eq!([99, 100, 129, 130].map(|now| history.is_due(secs(now))), [true, false, false, true]);
        history.last = Last::At(Timestamp::from_nanos(i64::MIN));
        assert!(history.is_due(Timestamp::from_nanos(i64::MAX)));
        let least = StorageSettings { background_history_interval_mins: 1e-300, ..settings.clone() };
        let mut history = History::new(&least).unwrap();
        history.last = Last::At(secs(1));
        assert!(!history.is_due(secs(1)) && history.is_due(secs(2)));
        let off = StorageSettings { background_history_interval_mins: 0.0, ..settings };
        assert!(History::new(&off).is_none());
    }

    #[tokio::test]
    async fn an_entry_that_does_not_fit_is_not_tried_again_for_an_interval() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&folder.path().join("a.sqlite")).await.unwrap();
        let settings = StorageSettings { background_history_mib: 1, ..StorageSettings::default() };
        let mut history = History::new(&settings).unwrap();
        let record = |mins: i64, n_bytes| BackgroundRecord {
            camera: CameraId::new("north").unwrap(),
            saved_at: Timestamp::from_nanos(mins * 60_000_000_000),
            width: 64,
            height: 48,
            matrix: ColorMatrix::Bt601,
            version: 1,
            bytes: vec![0; n_bytes],
        };
        let error = history.offer(&store, &record(0, (1 << 20) + 1)).await.unwrap_err();
        assert!(matches!(error, StoreError::TooLarge { .. }), "{error}");
        history.offer(&store, &record(59, (1 << 20) + 1)).await.unwrap();
        history.offer(&store, &record(60, 1 << 20)).await.unwrap();
        let kept = store.background_history(&record(0, 0).camera).await.unwrap();
        assert_eq!(kept, [(record(60, 0).saved_at, 64, 48, 1 << 20)]);
    }
}
