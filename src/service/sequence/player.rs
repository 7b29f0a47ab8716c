//! Who looks at a sequence: pictures at instants, by weights that follow over scene time from mesh to mesh.

use super::cache::{Cache, CacheCounts};
use super::moment::read_moment;
use super::{Sequence, SequenceError};
use glam::Vec3;
use std::collections::HashMap;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;
use videofields_recording::timeline::{Extent, Playhead};
use videofields_vision::clock::Timestamp;
use videofields_vision::fields::Moment;
use videofields_vision::fields::{Blend, Distances, Field, FieldSettings, Shaded, Topology, Weights, shade};
use videofields_vision::geometry::Camera;
use videofields_vision::mesh::{NO_TRIANGLE, Raster};

/// How cameras' colours become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mixing {
    /// At each place the one camera that would lend most alone.
    Off,
    /// All that see a place, by how straight they look at the surface.
    Normals,
    /// Texture fields, which follow the viewer over time.
    #[default]
    Montage,
}

impl Mixing {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Off, Self::Normals, Self::Montage];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Normals => "normals",
            Self::Montage => "montage",
        }
    }
}

impl FromStr for Mixing {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|of| of.name() == name)
            .ok_or_else(|| format!("expected one of {}", names()))
    }
}

/// Where fields of frames are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MadeOn {
    /// Here.
    #[default]
    Processor,
    /// On a device, by who draws: frames have none. Gains, by which cameras agree, are those of the first frame that was read in which a
    /// camera shows anything, since one recording is exposed alike.
    Device,
}

/// How a sequence is played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlayerSettings {
    /// How colours are mixed.
    pub mixing: Mixing,
    /// How fields are made.
    pub fields: FieldSettings,
    /// Where they are made.
    pub made_on: MadeOn,
    /// Bytes of frames that are kept ready. Default 512 MiB.
    pub cache_bytes: usize,
}

impl Default for PlayerSettings {
    fn default() -> Self {
        Self {
            mixing: Mixing::default(),
            fields: FieldSettings::default(),
            made_on: MadeOn::Processor,
            cache_bytes: 512 << 20,
        }
    }
}

/// Longer steps of scene time are seeks, whoever asks: nothing would be left of what was before.
const LONGEST_STEP_SECS: f64 = 2.0;

/// By how much more than its rate a playhead may have moved: rounding.
const SLACK_NANOS: i64 = 1_000_000;

/// A sequence, who looks at it, and what they saw last.
#[derive(Debug)]
pub struct Player {
    sequence: Sequence,
    settings: PlayerSettings,
    cache: Cache,
    /// Why frames cannot be read, so that none is tried at every picture.
    broken: HashMap<usize, Arc<SequenceError>>,
    /// What each camera's light is multiplied by, once it showed something.
    gains: Vec<Option<Vec3>>,
    history: Option<History>,
    /// Where a playhead stood when it was last asked, and the machine's time then.
    asked: Option<(Playhead, Timestamp, Duration)>,
    /// Seeks, for whoever wonders why weights jumped.
    n_seeks: u64,
}

/// What was seen last.
#[derive(Debug)]
struct History {
    moment: Arc<Moment>,
    weights: Weights,
    at: Timestamp,
}

/// A picture of a sequence at an instant.
#[derive(Clone, Debug)]
pub struct Look {
    /// The frame that is shown.
    pub moment: Arc<Moment>,
    /// The picture; none of a mesh without triangles.
    pub shaded: Option<Shaded>,
    /// Whether the mesh is seen, pixel by pixel; empty where there is no picture.
    pub is_mesh: Vec<bool>,
}

impl Player {
    /// Begins at nothing that was seen.
    #[must_use]
    pub fn new(sequence: Sequence, settings: PlayerSettings) -> Self {
        Self {
            sequence,
            cache: Cache::new(settings.cache_bytes),
            settings,
            broken: HashMap::new(),
            gains: Vec::new(),
            history: None,
            asked: None,
            n_seeks: 0,
        }
    }

    /// What is played.
    #[must_use]
    pub const fn sequence(&self) -> &Sequence {
        &self.sequence
    }

    /// Where playheads may be: from the first frame, to the last as the present.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.sequence.extent()
    }

    /// What its cache did.
    #[must_use]
    pub fn counts(&self) -> CacheCounts {
        self.cache.counts()
    }

    /// How often it was sought.
    #[must_use]
    pub const fn n_seeks(&self) -> u64 {
        self.n_seeks
    }

    /// What cameras lent to the vertices of the mesh that was seen last; none before, and where nothing follows.
    #[must_use]
    pub fn weights(&self) -> Option<&Weights> {
        self.history.as_ref().map(|history| &history.weights)
    }

    /// Forgets what was seen: what comes next is as if nothing had been before.
    pub fn seek(&mut self) {
        self.n_seeks += u64::from(self.history.is_some());
        self.history = None;
    }

    /// Where a playhead stands at the machine's monotonic time `now`. Where it could not have come there by playing since it was last
    /// asked, that is a seek.
    pub fn position(&mut self, playhead: &Playhead, now: Duration) -> Timestamp {
        let at = playhead.position(now, self.extent());
        if let Some((before, last, since)) = self.asked {
            let rate = playhead.rate().abs().max(before.rate().abs());
            let farthest = now.saturating_sub(since).as_nanos() as f64 * rate;
            if at.nanos_since(last).saturating_abs() > (farthest as i64).saturating_add(SLACK_NANOS) {
                self.seek();
            }
        }
        self.asked = Some((*playhead, at, now));
        at
    }

    /// The frame that answers for an instant, ready.
    ///
    /// # Errors
    /// Where none does, and where its mesh cannot be read: then also whenever it is asked for again, while other frames go on.
    pub fn moment(&mut self, at: Timestamp) -> Result<Arc<Moment>, Arc<SequenceError>> {
        let idx = self.sequence.frame_at(at).map_err(Arc::new)?;
        if let Some(error) = self.broken.get(&idx) {
            return Err(Arc::clone(error));
        }
        if let Some(moment) = self.cache.get(idx) {
            return Ok(moment);
        }
        let is_here = self.settings.made_on == MadeOn::Processor;
        let settings = is_here.then_some(&self.settings.fields);
        match read_moment(&mut self.sequence, idx, settings) {
            Ok(mut moment) => {
                if !is_here {
                    self.even(&mut moment);
                }
                let moment = Arc::new(moment);
                self.cache.put(idx, &moment);
                Ok(moment)
            }
            Err(error) => {
                let error = Arc::new(error);
                self.broken.insert(idx, Arc::clone(&error));
                Err(error)
            }
        }
    }

    /// Gives a frame's views the gains that are known; has those known of cameras that never showed anything before.
    fn even(&mut self, moment: &mut Moment) {
        self.gains.resize(moment.views.len(), None);
        let is_blind = |view: usize| moment.blind.iter().any(|(camera, _)| *camera == view);
        let seeing: Vec<usize> = (0..moment.views.len()).filter(|view| !is_blind(*view)).collect();
        if seeing.iter().any(|view| self.gains[*view].is_none()) {
            // Gains follow from who sees which vertices, and nothing else of a field.
            let settings = FieldSettings {
                distances: Distances::Off,
                smoothing_rounds: 0,
                is_evened: true,
                vote: None,
                ..self.settings.fields
            };
            let topology = Topology::of(&moment.mesh.positions_m, &moment.mesh.triangles);
            if Field::new(&moment.mesh, &topology, &mut moment.views, &settings).is_ok() {
                for view in seeing {
                    self.gains[view].get_or_insert(moment.views[view].gain);
                }
            }
        }
        for (view, gain) in moment.views.iter_mut().zip(&self.gains) {
            view.gain = gain.unwrap_or(Vec3::ONE);
        }
    }

    /// The sequence at an instant of scene time, as `camera` would see it, in its picture's size.
    ///
    /// # Errors
    /// As [`Self::moment`].
    pub fn look(&mut self, at: Timestamp, camera: &Camera) -> Result<Look, Arc<SequenceError>> {
        let moment = self.moment(at)?;
        let Some(field) = &moment.field else {
            self.history = None;
            return Ok(Look { moment, shaded: None, is_mesh: Vec::new() });
        };
        let target = || field.target(&moment.mesh, &moment.views, camera.pose().position_in_world);
        let (width, height) = camera.size_px();
        let raster = Raster::of(&moment.mesh, camera, [width as usize, height as usize]);
        let drawn = |weights: &Weights, blend: Blend| {
            shade((&moment.mesh, &raster), camera, (field, &moment.views, weights), blend)
        };
        let shaded = match self.settings.mixing {
            Mixing::Off => drawn(&target(), Blend::Best),
            Mixing::Normals => drawn(&field.by_normals(), Blend::Mixed),
            Mixing::Montage => {
                let weights = followed(self.history.take(), (&moment, at), target());
                let shaded = drawn(&weights, Blend::Mixed);
                self.history = Some(History { moment: Arc::clone(&moment), weights, at });
                shaded
            }
        };
        let is_mesh = raster.triangles().iter().map(|triangle| *triangle != NO_TRIANGLE).collect();
        Ok(Look { moment, shaded: Some(shaded), is_mesh })
    }
}

/// Weights that follow on from what was seen last towards `target`; the target itself where nothing was, or too long ago.
fn followed(history: Option<History>, (moment, at): (&Arc<Moment>, Timestamp), target: Weights) -> Weights {
    let Some(History { moment: before, weights, at: last }) = history else { return target };
    // Backwards too, where a playhead does.
    let secs = at.secs_since(last).abs();
    if secs > LONGEST_STEP_SECS {
        return target;
    }
    let mut weights = weights;
    if !Arc::ptr_eq(&before, moment) {
        let Some(field) = &moment.field else { return target };
        weights = weights.carried(&before.mesh, &moment.mesh, field.reach_m());
        // Who no longer sees a place would lend another's colours.
        weights.let_go_of_unseen(&target, field);
    }
    weights.follow(&target, secs);
    weights
}
