//! Who is shown, how often, and how far from their place: entities held against a world's truth.
//!
//! A state, what every pixel of its cameras shows in truth, and where everybody stands go in; counts and distances come
//! out.

use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use videofields_picture::fuse::{Billboard, CameraState, SceneState};
use videofields_simulate::FigurePosition;
use videofields_vision::frame::Mask;
use videofields_vision::measures::distance_figures;
use videofields_vision::segment::{MOVING, PixelRect};

/// Pixels of somebody that a camera must show to count as one that sees them.
pub const LEAST_PX: usize = 40;

/// A source shows a figure whole if so many of its pixels of figures are that one's, if its rectangle and the figure's share so
/// much, and if the figure is seen from where it stands up to its head, but for this share of its height at either end.
const WHOLE_SHARE: f64 = 0.9;
const WHOLE_OVERLAP: f64 = 0.6;
const END_SHARE: f64 = 0.15;

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
    /// Figures whom two cameras or more see *whole* at an instant: nothing but their segmentation and calibration parts what
    /// these see. Whole is a source nine tenths of whose pixels of figures are that figure's, whose rectangle and the
    /// figure's in truth share six tenths of what they cover together, away from the picture's border, from where the figure
    /// stands up to its head.
    pub n_possible: usize,
    /// Of these, those whose whole sights are in two entities or more.
    pub n_parted: usize,
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
        let boxes: Vec<_> = truths.iter().map(|truth| boxes(truth)).collect();
        // Entities of each whole sight, one a camera.
        let mut whole: BTreeMap<u8, Vec<u64>> = BTreeMap::new();
        for entity in &state.entities {
            let mut people = BTreeSet::new();
            for source in &entity.sources {
                let (of, share) = owner(state, truths, source);
                if of == 0 {
                    continue;
                }
                people.insert(of);
                let place = figures.iter().find(|figure| figure.instance == of);
                let is_whole = share >= WHOLE_SHARE
                    && place.zip(boxes[source.camera_idx][usize::from(of)]).is_some_and(|(figure, truth)| {
                        is_whole(&state.cameras[source.camera_idx], source, truth, figure)
                    });
                if is_whole {
                    whole.entry(of).or_default().push(entity.id);
                }
            }
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
        for mut sights in whole.into_values().filter(|sights| sights.len() > 1) {
            self.n_possible += 1;
            sights.dedup();
            self.n_parted += usize::from(sights.len() > 1);
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

    /// Heads of the columns that [`Self::cells`] fills.
    pub const HEADS: [&str; 11] = [
        "seen",
        "missed",
        "seen by two",
        "two entities",
        "whole by two",
        "parted",
        "new id",
        "mixed",
        "nobody",
        "place: mean, m",
        "95 %, m",
    ];

    /// Its row of a table.
    #[must_use]
    pub fn cells(&self) -> [String; 11] {
        let [seen, missed, twice, duplicates, possible, parted, switches, mixed, ghosts] = [
            self.n_seen,
            self.n_missed,
            self.n_seen_twice,
            self.n_duplicates,
            self.n_possible,
            self.n_parted,
            self.n_switches,
            self.n_mixed,
            self.n_ghosts,
        ]
        .map(|count| count.to_string());
        let place_error_m = self.place_error_m();
        let [mean, most] = [0, 1]
            .map(|of| place_error_m.map_or_else(|| "-".to_owned(), |error_m| format!("{:.3}", error_m[of])));
        [seen, missed, twice, duplicates, possible, parted, switches, mixed, ghosts, mean, most]
    }

    /// Mean, 95 % point and largest distance from where an entity stands to the one figure that it shows, on the
    /// ground, metres; `None` where none shows one.
    #[must_use]
    pub fn place_error_m(&self) -> Option<[f64; 3]> {
        distance_figures(self.distances_m.clone())
    }
}

/// Whom most moving pixels of a source show, 0 where most show nobody; and their share of those that show anybody.
fn owner(state: &SceneState, truths: &[&Mask], source: &Billboard) -> (u8, f64) {
    let camera = &state.cameras[source.camera_idx];
    let labels = &camera.observation.labels;
    let truth = truths[source.camera_idx];
    assert_eq!(
        (labels.width, labels.height),
        (truth.width, truth.height),
        "the truth is of the picture's size"
    );
    let mut counts = [0_u32; 256];
    let rect = source.rect;
    for y in rect.y..rect.y + rect.height {
        let is_shown = |x: &u32| labels.get(*x, y) == MOVING && camera.may_show(source.owner, (*x, y));
        for x in (rect.x..rect.x + rect.width).filter(is_shown) {
            counts[usize::from(truth.get(x, y))] += 1;
        }
    }
    let of = (0..=u8::MAX).max_by_key(|of| counts[usize::from(*of)]).unwrap_or(0);
    (of, f64::from(counts[usize::from(of)]) / f64::from(counts[1..].iter().sum::<u32>().max(1)))
}

/// The rectangle around each figure's pixels of a picture, by its value; `None` of who is not there.
fn boxes(truth: &Mask) -> Vec<Option<PixelRect>> {
    let mut ends: Vec<Option<[u32; 4]>> = vec![None; 256];
    for (row, y) in truth.data.chunks_exact(truth.width.max(1) as usize).zip(0..) {
        for (value, x) in row.iter().zip(0..).filter(|(value, _)| **value > 0) {
            let [left, top, right, bottom] = ends[usize::from(*value)].unwrap_or([x, y, x, y]);
            ends[usize::from(*value)] = Some([left.min(x), top, right.max(x), bottom.max(y)]);
        }
    }
    let rect =
        |[x, y, right, bottom]: [u32; 4]| PixelRect { x, y, width: right - x + 1, height: bottom - y + 1 };
    ends.into_iter().map(|ends| ends.map(rect)).collect()
}

/// Whether a source shows all of a figure that lies in `truth`: see [`EntityScore::n_possible`].
fn is_whole(camera: &CameraState, source: &Billboard, truth: PixelRect, figure: &FigurePosition) -> bool {
    let labels = &camera.observation.labels;
    let ends = |of: PixelRect| [of.x, of.y, of.x + of.width, of.y + of.height];
    let ([left, top, right, bottom], [x, y, to_x, to_y]) = (ends(truth), ends(source.rect));
    let common = f64::from(right.min(to_x).saturating_sub(left.max(x)))
        * f64::from(bottom.min(to_y).saturating_sub(top.max(y)));
    let area = |of: PixelRect| f64::from(of.width) * f64::from(of.height);
    let union = area(truth) + area(source.rect) - common;
    let is_inside = left > 0 && top > 0 && right < labels.width && bottom < labels.height;
    // Both ends of the upright line over its place, along the picture's axis that it follows most.
    let end = |up_m: f64| {
        let place = camera.camera.project(figure.foot_in_world + DVec3::Z * up_m)?;
        Some(place.texture * DVec2::new(f64::from(labels.width), f64::from(labels.height)))
    };
    let reaches_both = end(0.0).zip(end(figure.height_m)).is_some_and(|(foot, head)| {
        let along = (head - foot).abs();
        let (foot, head, shown) =
            if along.x > along.y { (foot.x, head.x, [left, right]) } else { (foot.y, head.y, [top, bottom]) };
        let far = |place: f64, end: u32| (place - f64::from(end)).abs();
        let most_px = END_SHARE * (head - foot).abs() + 1.0;
        let [least, most] = shown;
        far(foot.min(head), least) <= most_px && far(foot.max(head), most) <= most_px
    });
    is_inside && reaches_both && common >= WHOLE_OVERLAP * union
}
