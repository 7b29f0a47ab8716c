//! Where what moves before a camera goes: gathered while it is followed, written when it is gone and every minute of a
//! long stay, so that a daemon that is killed loses little.

use glam::DVec2;
use tokio::runtime::Handle as Runtime;
use videofields_recording::store::{Store, TrackRecord};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;
use videofields_vision::track::{FootPath, Track};

/// Scene time between two writings of what is still there.
const WRITE_NANOS: i64 = 60_000_000_000;

/// Scene time after which what is not followed any more is gone; what went out of the picture may come back before.
const GONE_NANOS: i64 = 3_000_000_000;

/// What was seen for less is left out: most of it is no thing.
const LEAST_NANOS: i64 = 500_000_000;

/// Tracks that wait for a database that fails; older ones are lost. With the longest paths, 3 MiB.
const MAX_WAITING: usize = 1024;

/// Calls of [`Tracks::write`] that are let pass after a failure: each may take as long as the database is waited for.
const PAUSE_CALLS: u32 = 10;

/// Gathers where what moves before one camera goes.
pub(super) struct Tracks {
    camera: CameraId,
    store: Store,
    runtime: Runtime,
    gathered: Gathered,
    /// Calls still to be let pass.
    pause_calls: u32,
}

/// What is followed, and what waits to be written.
#[derive(Debug, Default)]
struct Gathered {
    /// In growing order of their numbers.
    followed: Vec<Followed>,
    waiting: Vec<TrackRecord>,
    /// Time of the frame before.
    before: Option<Timestamp>,
    n_lost: u64,
}

#[derive(Debug)]
struct Followed {
    number: u64,
    path: FootPath,
    /// Largest height, share of the picture's.
    height_share: f64,
    /// Time of the last frame in which it was followed, seen or not.
    followed_at: Timestamp,
    /// End of what was handed over last, the beginning at first.
    written_to: Timestamp,
}

impl Tracks {
    pub(super) fn new(camera: CameraId, store: Store, runtime: Runtime) -> Self {
        Self { camera, store, runtime, gathered: Gathered::default(), pause_calls: 0 }
    }

    /// Takes what was seen in one frame.
    pub(super) fn observe(&mut self, seen: &Observation) {
        let image = &seen.frame.image;
        let size = DVec2::new(image.width().into(), image.height().into());
        self.gathered.observe(seen.frame.timestamp, size, &seen.tracks);
    }

    /// Writes what waits. Blocks for a short write, if anything does.
    pub(super) fn write(&mut self) {
        if self.pause_calls > 0 {
            self.pause_calls -= 1;
            return;
        }
        self.write_now();
    }

    /// Writes all there is: no frame will follow.
    pub(super) fn write_finally(&mut self) {
        self.gathered.end_all();
        self.write_now();
    }

    fn write_now(&mut self) {
        let Gathered { waiting, n_lost, .. } = &mut self.gathered;
        if waiting.is_empty() {
            return;
        }
        if *n_lost > 0 {
            tracing::warn!(camera = %self.camera, n_lost, "tracks lost while the database failed");
            *n_lost = 0;
        }
        match self.runtime.block_on(self.store.put_tracks(&self.camera, waiting)) {
            Ok(()) => waiting.clear(),
            Err(error) => {
                tracing::warn!(camera = %self.camera, %error, n_waiting = waiting.len(), "tracks not written");
                self.pause_calls = PAUSE_CALLS;
            }
        }
    }
}

impl Gathered {
    /// Takes what is followed in a frame of `size_px`, in growing order of numbers.
    fn observe(&mut self, at: Timestamp, size_px: DVec2, tracks: &[Track]) {
        if self.before.is_some_and(|before| at < before) {
            // Of another clock: what goes on goes on as something else.
            self.end_all();
        }
        self.before = Some(at);
        for track in tracks {
            self.follow(at, size_px, track);
        }
        let mut i = 0;
        while let Some(followed) = self.followed.get(i) {
            if at.nanos_since(followed.followed_at) > GONE_NANOS {
                let gone = self.followed.remove(i);
                self.hand_over(&gone);
            } else {
                i += 1;
            }
        }
    }

    fn follow(&mut self, at: Timestamp, size_px: DVec2, track: &Track) {
        // Where it is only predicted it says nothing new.
        let is_seen = track.blob_idx.is_some();
        let foot = (DVec2::from_array(track.foot_in_image) / size_px).to_array();
        let height_share = f64::from(track.rect.height) / size_px.y;
        match self.followed.binary_search_by_key(&track.id, |followed| followed.number) {
            Ok(i) => {
                let followed = &mut self.followed[i];
                followed.followed_at = at;
                if !is_seen {
                    return;
                }
                followed.path.add(at, foot);
                followed.height_share = followed.height_share.max(height_share);
                if followed.path.ended_at().nanos_since(followed.written_to) >= WRITE_NANOS {
                    followed.written_to = followed.path.ended_at();
                    let record = followed.record();
                    self.wait(record);
                }
            }
            Err(i) if is_seen => {
                let Some(path) = FootPath::new(at, foot) else { return };
                let followed =
                    Followed { number: track.id, path, height_share, followed_at: at, written_to: at };
                self.followed.insert(i, followed);
            }
            Err(_) => {}
        }
    }

    /// Ends all that is followed.
    fn end_all(&mut self) {
        for gone in std::mem::take(&mut self.followed) {
            self.hand_over(&gone);
        }
    }

    /// Lets what is gone wait to be written, if it was there for long enough.
    fn hand_over(&mut self, gone: &Followed) {
        let path = &gone.path;
        if path.n_seen() > 1 && path.ended_at().nanos_since(path.began_at()) >= LEAST_NANOS {
            self.wait(gone.record());
        }
    }

    fn wait(&mut self, record: TrackRecord) {
        let key = |of: &TrackRecord| (of.began_at, of.number);
        if let Some(earlier) = self.waiting.iter_mut().find(|waiting| key(waiting) == key(&record)) {
            *earlier = record;
            return;
        }
        if self.waiting.len() == MAX_WAITING {
            self.waiting.remove(0);
            self.n_lost += 1;
        }
        self.waiting.push(record);
    }
}

impl Followed {
    fn record(&self) -> TrackRecord {
        TrackRecord {
            began_at: self.path.began_at(),
            ended_at: self.path.ended_at(),
            number: self.number,
            feet: self.path.feet(),
            height: (self.height_share.clamp(0.0, 1.0) * f64::from(u16::MAX)).round() as u16,
            path: self.path.encode(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::segment::PixelRect;

    const SIZE: DVec2 = DVec2::new(200.0, 100.0);

    fn at(millis: i64) -> Timestamp {
        Timestamp::from_nanos(millis * 1_000_000)
    }

    fn track(id: u64, foot_in_image: [f64; 2]) -> Track {
        Track {
            id,
            rect: PixelRect { x: 0, y: 0, width: 10, height: 25 },
            blob_idx: Some(0),
            foot_in_image,
            velocity_px_per_sec: [0.0; 2],
            first_seen: at(0),
            last_seen: at(0),
            is_in_group: false,
            still_since: None,
        }
    }

    /// A frame at `millis` in which `ids` walk to the right.
    fn show(gathered: &mut Gathered, millis: i64, ids: &[u64]) {
        let tracks: Vec<_> =
            ids.iter().map(|id| track(*id, [(millis as f64 * 0.01).rem_euclid(200.0), 60.0])).collect();
        gathered.observe(at(millis), SIZE, &tracks);
    }

    /// Number, beginning and end of what waits, milliseconds.
    fn waiting(gathered: &Gathered) -> Vec<(u64, i64, i64)> {
        let millis = |at: Timestamp| at.as_nanos() / 1_000_000;
        gathered.waiting.iter().map(|of| (of.number, millis(of.began_at), millis(of.ended_at))).collect()
    }

    #[test]
    fn what_is_gone_is_handed_over_once() {
        let mut gathered = Gathered::default();
        for millis in (0..2000).step_by(100) {
            show(&mut gathered, millis, if millis < 1000 { &[1, 3] } else { &[3] });
        }
        // Out of the picture for a moment.
        for millis in (4000..5000).step_by(100) {
            show(&mut gathered, millis, &[2, 3]);
        }
        assert_eq!(waiting(&gathered), [(1, 0, 900)]);
        show(&mut gathered, 9000, &[]);
        assert_eq!(waiting(&gathered), [(1, 0, 900), (2, 4000, 4900), (3, 0, 4900)]);
        assert!(gathered.followed.is_empty());
        let record = &gathered.waiting[0];
        assert_eq!((record.height, record.feet), (16_384, [[0, 39_321], [2949, 39_321]]));
        let points = FootPath::decode(&record.path).unwrap();
        assert_eq!(points.last().unwrap().at(record.began_at), record.ended_at);
    }

    #[test]
    fn flickers_and_what_shows_no_feet_are_left_out() {
        let mut gathered = Gathered::default();
        show(&mut gathered, 0, &[1, 2, 3]);
        show(&mut gathered, 400, &[1]);
        let outside = [track(2, [50.0, 101.0]), Track { blob_idx: None, ..track(3, [50.0, 60.0]) }];
        for millis in [500, 900, 1500] {
            gathered.observe(at(millis), SIZE, &outside);
        }
        gathered.observe(at(2000), SIZE, &[track(4, [f64::NAN, 1.0]), track(5, [0.0; 2])]);
        gathered.end_all();
        assert_eq!(waiting(&gathered), []);
    }

    #[test]
    fn a_long_stay_is_written_every_minute_in_one_place() {
        let mut gathered = Gathered::default();
        let mut ends = Vec::new();
        for millis in (0..3_600_000).step_by(200) {
            show(&mut gathered, millis, &[1]);
            ends.extend(gathered.waiting.drain(..).map(|record| {
                assert_eq!((record.number, record.began_at), (1, at(0)));
                assert!(record.path.len() < 4096);
                record.ended_at
            }));
        }
        assert_eq!(ends, (1..60).map(|minute| at(60_000 * minute)).collect::<Vec<_>>());
        // While the database fails, the newest state of each waits.
        for millis in (3_600_000..7_200_000).step_by(200) {
            show(&mut gathered, millis, &[1]);
        }
        assert_eq!(waiting(&gathered), [(1, 0, 7_140_000)]);
        gathered.end_all();
        assert_eq!(waiting(&gathered), [(1, 0, 7_199_800)]);
    }

    #[test]
    fn time_that_is_set_back_ends_what_is_followed() {
        let mut gathered = Gathered::default();
        for millis in [10_000, 10_500, 11_000, 5000, 5500, 6000, 6000, 70_000] {
            show(&mut gathered, millis, &[1]);
        }
        gathered.end_all();
        assert_eq!(waiting(&gathered), [(1, 10_000, 11_000), (1, 5000, 70_000)]);
        assert!(gathered.waiting.iter().all(|record| record.ended_at >= record.began_at));
    }

    #[test]
    fn a_database_that_is_gone_costs_no_memory() {
        let mut gathered = Gathered::default();
        for id in 0..MAX_WAITING as u64 + 50 {
            for millis in [0, 600] {
                show(&mut gathered, 10_000 * id as i64 + millis, &[id]);
            }
        }
        gathered.end_all();
        assert_eq!((gathered.waiting.len(), gathered.n_lost), (MAX_WAITING, 50));
        assert_eq!(gathered.waiting[0].number, 50, "the oldest are lost");
        assert!(gathered.followed.is_empty());
    }

    #[test]
    fn rows_wait_for_a_database_that_fails_and_are_written_then() {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("test.sqlite");
        let store = runtime.block_on(Store::open(&path)).unwrap();
        let camera = CameraId::new("gate").unwrap();
        let mut tracks = Tracks::new(camera.clone(), store.clone(), runtime.handle().clone());
        let alter = |sql: &'static str| {
            use sqlx::Connection;
            runtime.block_on(async {
                let url = format!("sqlite://{}", path.display());
                let mut other = sqlx::SqliteConnection::connect(&url).await.unwrap();
                sqlx::raw_sql(sql).execute(&mut other).await.unwrap();
            });
        };
        let kept = || {
            let ends = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
            runtime.block_on(store.tracks(&camera, ends, None, 100)).unwrap().len()
        };
        tracks.write();
        alter("alter table track rename to away");
        for millis in [0, 600, 9000] {
            show(&mut tracks.gathered, millis, if millis < 9000 { &[1, 2] } else { &[3] });
        }
        tracks.write();
        alter("alter table away rename to track");
        for _ in 0..PAUSE_CALLS {
            tracks.write();
            assert_eq!(kept(), 0, "it is not asked again at once");
        }
        tracks.write();
        assert_eq!(kept(), 2);
        show(&mut tracks.gathered, 9600, &[3]);
        tracks.write_finally();
        assert_eq!(kept(), 3);
    }
}
