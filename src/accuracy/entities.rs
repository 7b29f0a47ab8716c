//! Who is shown, how often, and how far from their place: entities held against a world's truth.
//!
//! A state, what every pixel of its cameras shows in truth, and where everybody stands go in; counts and distances come
//! out.

use super::measures::distance_figures;
use crate::frame::Mask;
use crate::fuse::{Entity, SceneState};
use crate::segment::MOVING;
use crate::simulate::FigurePosition;
use std::collections::{BTreeMap, BTreeSet};

/// Pixels of somebody that a camera must show to count as one that sees them.
const LEAST_PX: usize = 40;

/// What entities get right and wrong, counted in figures at instants.
#[derive(Clone, Debug, Default)]
pub struct EntityScore {
    /// Figures whom a camera sees: 40 pixels or more.
    pub n_seen: usize,
    /// Of these, those whom no entity shows.
    pub n_missed: usize,
    /// Figures whom two cameras or more see and an entity shows.
    pub n_seen_twice: usize,
    /// Of these, those whom two entities or more show.
    pub n_duplicates: usize,
    /// Of those seen twice, those whose entity has another id than at their instant before.
    pub n_switches: usize,
    /// Entities of several sources.
    pub n_joined: usize,
    /// Entities whose sources show different figures.
    pub n_mixed: usize,
    /// Entities that show nobody.
    pub n_ghosts: usize,
    /// On the ground, from where an entity stands to the figure that all its sources show.
    distances_m: Vec<f64>,
    last_ids: BTreeMap<u8, u64>,
}

impl EntityScore {
    /// Adds an instant. Instants are added in their order, so that changes of ids are told.
    ///
    /// **Shape** `truths`: for each of the state's cameras, whom each pixel of its picture shows, 0 for nobody.
    ///
    /// # Panics
    /// When a camera has no truth, or one of another size.
    pub fn add(&mut self, state: &SceneState, truths: &[&Mask], figures: &[FigurePosition]) {
        assert_eq!(state.cameras.len(), truths.len(), "every camera has its truth");
        let mut shown: BTreeMap<u8, BTreeSet<u64>> = BTreeMap::new();
        for entity in &state.entities {
            let owners = (0..entity.sources.len()).map(|source| owner(state, truths, entity, source));
            let people: BTreeSet<u8> = owners.filter(|of| *of > 0).collect();
            self.n_joined += usize::from(entity.sources.len() > 1);
            self.n_mixed += usize::from(people.len() > 1);
            self.n_ghosts += usize::from(people.is_empty());
            if let (1, Some(of)) = (people.len(), people.first()) {
                let place = figures.iter().find(|figure| figure.instance == *of);
                let off = |figure: &FigurePosition| entity.foot_in_world - figure.foot_in_world;
                self.distances_m.extend(place.map(|figure| off(figure).truncate().length()));
            }
            for of in people {
                shown.entry(of).or_default().insert(entity.id);
            }
        }
        let mut n_cameras: BTreeMap<u8, usize> = BTreeMap::new();
        for truth in truths {
            let mut counts = [0_usize; 256];
            truth.data.iter().for_each(|value| counts[usize::from(*value)] += 1);
            for of in (1..=u8::MAX).filter(|of| counts[usize::from(*of)] >= LEAST_PX) {
                *n_cameras.entry(of).or_default() += 1;
            }
        }
        self.n_seen += n_cameras.len();
        self.n_missed += n_cameras.keys().filter(|of| !shown.contains_key(of)).count();
        for (of, ids) in shown {
            if let (Some(2..), Some(id)) = (n_cameras.get(&of), ids.first()) {
                self.n_seen_twice += 1;
                self.n_duplicates += usize::from(ids.len() > 1);
                self.n_switches += usize::from(self.last_ids.insert(of, *id).is_some_and(|was| was != *id));
            }
        }
    }

    /// Mean, 95 % point and largest distance from where an entity stands to the one figure that it shows, on the
    /// ground, metres; `None` where none shows one.
    #[must_use]
    pub fn place_error_m(&self) -> Option<[f64; 3]> {
        distance_figures(self.distances_m.clone())
    }
}

/// Whom most moving pixels of a source show; 0 where most show nobody.
fn owner(state: &SceneState, truths: &[&Mask], entity: &Entity, source: usize) -> u8 {
    let billboard = &entity.sources[source];
    let labels = &state.cameras[billboard.camera_idx].observation.labels;
    let truth = truths[billboard.camera_idx];
    assert_eq!(
        (labels.width, labels.height),
        (truth.width, truth.height),
        "the truth is of the picture's size"
    );
    let mut counts = [0_u32; 256];
    let rect = billboard.rect;
    for y in rect.y..rect.y + rect.height {
        for x in (rect.x..rect.x + rect.width).filter(|x| labels.get(*x, y) == MOVING) {
            counts[usize::from(truth.get(x, y))] += 1;
        }
    }
    (0..=u8::MAX).max_by_key(|of| counts[usize::from(*of)]).unwrap_or(0)
}
