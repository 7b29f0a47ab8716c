//! What nobody may see of the cameras: the zones in force, and what of the past they and those lifted since still hide.
//!
//! Zones flow in, before cameras start and whenever they are changed. A camera's thread takes them before each frame, and
//! its observation is kept only while they are still in force ([`CameraPrivacy::keep`]): so once a change has been made,
//! nothing that was seen under other zones comes to memory any more, and what was there is hidden. Zones follow the footage: those of
//! a camera hold for every other camera that is fed by the same.

use super::EngineError;
use super::footage::Footage;
use super::sightings::Sightings;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, RwLock};
use videofields_recording::timeline::{Event, EventLog, Timeline};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraSettings, SourceSettings};
use videofields_vision::frame::{BufferPool, CameraId, YuvImage, Zone, ZoneMask};
use videofields_vision::observation::Observation;

/// A zone that is no longer in force, and until when what was seen stays hidden by it.
#[derive(Clone, Debug, PartialEq)]
pub struct LiftedZone {
    /// The zone as it was.
    pub zone: Zone,
    /// When it was lifted: what the camera saw before stays hidden, wherever it was kept.
    pub until: Timestamp,
}

/// A camera's zones as they are to be in force.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Privacy {
    /// The zones.
    pub zones: Arc<[Zone]>,
    /// Zones that were lifted, for what was seen before.
    pub lifted: Arc<[LiftedZone]>,
    /// Which version they are; 0 where nothing was ever changed.
    pub version: i64,
    /// Since when these are in force, by the machine's clock; none where that is not known.
    pub since: Option<Timestamp>,
}

/// A camera's zones as its state tells of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PrivacySummary {
    /// How many there are.
    pub zones: usize,
    /// Which version they are; 0 where nothing was ever changed.
    pub version: i64,
    /// Since when they are in force, RFC 3339; null where there never were any.
    pub since: Option<String>,
}

impl Privacy {
    /// What the configuration says of a camera.
    fn configured(camera: &CameraSettings) -> Self {
        Self { zones: camera.privacy_zones.clone().into(), ..Self::default() }
    }

    pub(super) fn summary(&self) -> PrivacySummary {
        PrivacySummary {
            zones: self.zones.len(),
            version: self.version,
            since: self.since.map(|since| since.to_string()),
        }
    }

    /// What is hidden of a picture of `size_px` that was taken at `at`; none where nothing is.
    pub(super) fn mask_at(&self, at: Timestamp, size_px: (u32, u32)) -> Option<ZoneMask> {
        let polygons: Vec<&[[f64; 2]]> = self.at(at).map(|zone| &zone.polygon[..]).collect();
        (!polygons.is_empty()).then(|| ZoneMask::of(polygons, size_px))
    }

    /// The zones that hide what was seen at `at`.
    pub(super) fn at(&self, at: Timestamp) -> impl Iterator<Item = &Zone> {
        let lifted = self.lifted.iter().filter(move |lifted| at < lifted.until);
        self.zones.iter().chain(lifted.map(|lifted| &lifted.zone))
    }

    /// Whether anything that was seen at an instant or later is hidden.
    pub(super) fn hides_from(&self, from: Timestamp) -> bool {
        self.at(from).next().is_some()
    }
}

/// One camera's zones in force, and how often they were changed.
#[derive(Debug)]
pub(super) struct CameraPrivacy {
    state: Mutex<State>,
    pool: Arc<BufferPool>,
    /// Memory of the camera, once it has any.
    remains: OnceLock<Remains>,
}

#[derive(Debug)]
struct State {
    /// The zones of the camera itself.
    own: Arc<Privacy>,
    /// The zones in force: its own, and those of cameras that are fed by the same.
    privacy: Arc<Privacy>,
    /// Source of the camera.
    fed: Option<Fed>,
    changes: u64,
}

/// Source that feeds a camera, and the identity of what it named when it was opened last.
#[derive(Debug)]
struct Fed {
    source: SourceSettings,
    footage: Footage,
}

impl Fed {
    fn by(source: &SourceSettings) -> Option<Self> {
        Some(Self { source: source.clone(), footage: Footage::of(source)? })
    }
}

impl CameraPrivacy {
    fn new(privacy: Privacy, fed: Option<Fed>) -> Self {
        let own = Arc::new(privacy);
        let state = State { privacy: Arc::clone(&own), own, fed, changes: 0 };
        Self { state: Mutex::new(state), pool: BufferPool::new(1), remains: OnceLock::new() }
    }

    /// What is in force.
    pub(super) fn now(&self) -> Arc<Privacy> {
        Arc::clone(&self.lock().privacy)
    }

    /// Returns the zones of the camera itself.
    pub(super) fn own(&self) -> Arc<Privacy> {
        Arc::clone(&self.lock().own)
    }

    /// What is in force, and a number that another change makes another.
    pub(super) fn numbered(&self) -> (Arc<Privacy>, u64) {
        let state = self.lock();
        (Arc::clone(&state.privacy), state.changes)
    }

    /// Does `keep` with what was seen under the zones of that number, unless these have been changed since; whether it did. No
    /// change comes between.
    pub(super) fn keep(&self, number: u64, keep: impl FnOnce()) -> bool {
        let state = self.lock();
        let is_still = state.changes == number;
        if is_still {
            keep();
        }
        is_still
    }

    /// A recorded picture, with what is hidden of it filled.
    pub(super) fn hide(&self, privacy: &Privacy, image: &Arc<YuvImage>, at: Timestamp) -> Arc<YuvImage> {
        match privacy.mask_at(at, (image.width(), image.height())) {
            Some(mask) => Arc::new(image.masked_of(&self.pool, &Arc::new(mask))),
            None => Arc::clone(image),
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Each field is replaced whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The zones of all cameras. One that comes later brings its own.
#[derive(Debug)]
pub(super) struct Privacies {
    cameras: RwLock<BTreeMap<CameraId, Arc<CameraPrivacy>>>,
    changes: AtomicU64,
}

/// What is remembered of a camera.
pub(super) struct Remains {
    pub(super) timeline: Arc<Timeline>,
    pub(super) sightings: Arc<Sightings>,
    pub(super) events: Arc<EventLog>,
}

impl fmt::Debug for Remains {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Remains").finish_non_exhaustive()
    }
}

impl Privacies {
    /// Those of the configuration.
    pub(super) fn new(cameras: &[CameraSettings]) -> Self {
        let privacies = Self { cameras: RwLock::default(), changes: AtomicU64::new(0) };
        for camera in cameras {
            privacies.of_camera(camera);
        }
        for camera in cameras {
            privacies.join(camera.id.as_str());
        }
        privacies
    }

    /// Those of a camera that is about to run: what is in force of it, or else what its settings say.
    pub(super) fn of_camera(&self, camera: &CameraSettings) -> Arc<CameraPrivacy> {
        let mut cameras = self.cameras.write().unwrap_or_else(PoisonError::into_inner);
        let own = cameras.entry(camera.id.clone());
        let made = || Arc::new(CameraPrivacy::new(Privacy::configured(camera), Fed::by(&camera.source)));
        Arc::clone(own.or_insert_with(made))
    }

    /// Those of a camera that is still to begin: what is given, or else the configuration's.
    pub(super) fn add(&self, camera: &CameraSettings, privacy: Option<Privacy>) {
        let privacy = privacy.unwrap_or_else(|| Privacy::configured(camera));
        let mut cameras = self.cameras.write().unwrap_or_else(PoisonError::into_inner);
        let made = CameraPrivacy::new(privacy, Fed::by(&camera.source));
        cameras.insert(camera.id.clone(), Arc::new(made));
        drop(cameras);
        self.join(camera.id.as_str());
        self.changes.fetch_add(1, Ordering::SeqCst);
    }

    /// Tells what is remembered of a camera that is about to run.
    pub(super) fn remember(&self, camera: &CameraSettings, remains: Remains) {
        if self.of_camera(camera).remains.set(remains).is_err() {
            tracing::error!(camera = %camera.id, "what is remembered of a camera is known already");
        }
    }

    /// Tells that `source`, which feeds a camera, is opened: another file may lie there than before. What holds by that, for this
    /// camera and for those that are fed by the same, is in force before this returns.
    pub(super) fn opened(&self, camera: &str, source: &SourceSettings) {
        // A thread that was left says nothing of what feeds the camera by now.
        let is_fed =
            |own: Arc<CameraPrivacy>| own.lock().fed.as_ref().is_some_and(|fed| fed.source == *source);
        if !self.of(camera).is_ok_and(is_fed) {
            return;
        }
        for concerned in self.set_footage(camera, source) {
            if let Err(error) = self.hold(concerned.as_str()) {
                tracing::error!(camera = %concerned, %error, "privacy zones are not put in force for a file that was opened");
            }
        }
    }

    /// Tells that a camera is fed by `source` from now on. Cameras whose zones may be others by that; the caller has
    /// [`Self::hold`] put them in force.
    pub(super) fn set_footage(&self, camera: &str, source: &SourceSettings) -> Vec<CameraId> {
        let Ok(own) = self.of(camera) else { return Vec::new() };
        let mut concerned = self.sharing(camera);
        own.lock().fed = Fed::by(source);
        concerned.extend(self.sharing(camera));
        concerned.sort();
        concerned.dedup();
        concerned
    }

    /// Tells that a camera is taken away: its zones hold for no other any more. Cameras that it shared its footage with.
    pub(super) fn leave(&self, camera: &str) -> Vec<CameraId> {
        let Ok(own) = self.of(camera) else { return Vec::new() };
        let others = self.sharing(camera);
        own.lock().fed = None;
        others.into_iter().filter(|other| other.as_str() != camera).collect()
    }

    /// Replaces a camera's own zones. Cameras that are fed by the same, itself among them; the caller has [`Self::hold`] put
    /// them in force.
    pub(super) fn set_own(&self, camera: &str, privacy: Privacy) -> Result<Vec<CameraId>, EngineError> {
        self.of(camera)?.lock().own = Arc::new(privacy);
        Ok(self.sharing(camera))
    }

    /// Returns the cameras that are fed by the same as `camera`, itself among them.
    pub(super) fn sharing(&self, camera: &str) -> Vec<CameraId> {
        let cameras = self.cameras.read().unwrap_or_else(PoisonError::into_inner).clone();
        let of = |id: &str| cameras.iter().find(|(other, _)| other.as_str() == id).map(|(_, own)| own);
        let footage = of(camera).and_then(|own| own.lock().fed.as_ref().map(|fed| fed.footage.clone()));
        let is_same = |id: &CameraId, own: &CameraPrivacy| {
            let shows =
                |footage: &Footage| own.lock().fed.as_ref().is_some_and(|fed| fed.footage.is_same(footage));
            id.as_str() == camera || footage.as_ref().is_some_and(shows)
        };
        cameras.iter().filter(|(id, own)| is_same(id, own)).map(|(id, _)| id.clone()).collect()
    }

    /// Returns the zones that hold for `camera`: its own, with those of cameras that are fed by the same.
    fn shared(&self, camera: &str) -> Result<Privacy, EngineError> {
        let own = self.of(camera)?.own();
        let others = self.sharing(camera).into_iter().filter(|other| other.as_str() != camera);
        let (mut zones, mut lifted) = (own.zones.to_vec(), own.lifted.to_vec());
        for other in others {
            let other = self.of(other.as_str())?.own();
            zones.extend(other.zones.iter().filter(|zone| !own.zones.contains(zone)).cloned());
            lifted.extend(other.lifted.iter().filter(|of| !own.lifted.contains(of)).cloned());
        }
        Ok(Privacy { zones: zones.into(), lifted: lifted.into(), ..(*own).clone() })
    }

    /// Puts in force what holds for a camera that has seen nothing yet.
    fn join(&self, camera: &str) {
        if let (Ok(own), Ok(shared)) = (self.of(camera), self.shared(camera)) {
            own.lock().privacy = Arc::new(shared);
        }
    }

    pub(super) fn of(&self, camera: &str) -> Result<Arc<CameraPrivacy>, EngineError> {
        let known = self.cameras.read().unwrap_or_else(PoisonError::into_inner).get(camera).cloned();
        known.ok_or_else(|| EngineError::NoCamera { id: camera.to_owned() })
    }

    /// Those of a camera that ran or runs; of one that never did, none.
    pub(super) fn of_known(&self, camera: &CameraId) -> Arc<CameraPrivacy> {
        self.of(camera.as_str())
            .unwrap_or_else(|_unknown| Arc::new(CameraPrivacy::new(Privacy::default(), None)))
    }

    /// How often any camera's were changed: what was drawn while this changed may show what is hidden by now.
    pub(super) fn changes(&self) -> u64 {
        self.changes.load(Ordering::SeqCst)
    }

    /// Puts the zones in force that hold for a camera by now: nothing is remembered any more that was seen under others, and
    /// what is remembered is hidden, before this returns. Blocks for up to a second where memory holds much.
    pub(super) fn hold(&self, camera: &str) -> Result<(), EngineError> {
        let (own, privacy) = (self.of(camera)?, self.shared(camera)?);
        let mut state = own.lock();
        let before = std::mem::replace(&mut state.privacy, Arc::new(privacy));
        let is_same = before.zones == state.privacy.zones;
        if is_same && before.lifted == state.privacy.lifted {
            return Ok(());
        }
        if !is_same {
            state.changes += 1;
            if let Some(remains) = own.remains.get() {
                hide_remains(&state.privacy, &own.pool, remains, camera);
            }
        }
        self.changes.fetch_add(1, Ordering::SeqCst);
        Ok(())
    }
}

/// Hides what is remembered of a camera.
fn hide_remains(privacy: &Privacy, pool: &Arc<BufferPool>, of: &Remains, camera: &str) {
    of.sightings.clear();
    if privacy.zones.is_empty() {
        return;
    }
    let mut masks = Masks::default();
    // A background is shared by many frames.
    let mut background: Option<(Arc<YuvImage>, Arc<YuvImage>)> = None;
    of.timeline.replace_each(|seen| {
        let size_px = (seen.frame.image.width(), seen.frame.image.height());
        let mut hidden = seen.hidden_by(masks.of(privacy, size_px), pool);
        match &background {
            Some((before, after)) if Arc::ptr_eq(before, &seen.background) => {
                hidden.background = Arc::clone(after);
            }
            _ => background = Some((Arc::clone(&seen.background), Arc::clone(&hidden.background))),
        }
        hidden
    });
    let Some(size_px) = of
        .timeline
        .latest()
        .ok()
        .map(|seen: Observation| (seen.frame.image.width(), seen.frame.image.height()))
    else {
        // Of which size the pictures were that the events are of is not known.
        forget_events(&of.events, camera, |event| event.rect.is_none());
        return;
    };
    let mask = Arc::clone(masks.of(privacy, size_px));
    forget_events(&of.events, camera, |event| {
        event.rect.as_ref().is_none_or(|rect| !mask.touches([rect.x, rect.y], [rect.width, rect.height]))
    });
}

fn forget_events(events: &EventLog, camera: &str, is_kept: impl Fn(&Event) -> bool) {
    if let Ok(camera) = CameraId::new(camera) {
        events.retain(&camera, is_kept);
    }
}

/// What zones hide, by the size of pictures.
#[derive(Default)]
struct Masks(Vec<Arc<ZoneMask>>);

impl Masks {
    fn of(&mut self, privacy: &Privacy, size_px: (u32, u32)) -> &Arc<ZoneMask> {
        let known = self.0.iter().position(|mask| mask.size_px() == size_px);
        let idx = known.unwrap_or_else(|| {
            let polygons = privacy.zones.iter().map(|zone| &zone.polygon[..]);
            self.0.push(Arc::new(ZoneMask::of(polygons, size_px)));
            self.0.len() - 1
        });
        &self.0[idx]
    }
}
