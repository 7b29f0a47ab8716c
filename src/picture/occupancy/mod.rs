//! Finds the people who together explain the masks of all cameras at one instant, and where each of them stands.
//!
//! Masks of cameras at one instant flow in with their scene; upright people with places and heights flow out. People are put into the
//! scene one after the other, each where they explain most of what nobody explains yet, and are then moved and taken out again as
//! long as that explains more. Knows nothing of who is who.
//!
//! `[FBLF08]` Fleuret, Berclaz, Lengagne, Fua 2008, Multi-camera people tracking with a probabilistic occupancy map: the question, and
//! masks as its only evidence. There the answer is a probability for every cell; here it is a set of people, so that each pixel is
//! explained once.

#[cfg(test)]
pub(crate) mod drawn_people;
mod evidence;
mod grid;
mod owners;
mod silhouette;
mod vehicles;

use crate::scene::Scene;
use evidence::Evidence;
use glam::{DVec2, DVec3};
use grid::{Grid, Known, hidden_of, silhouettes};
pub use owners::OwnerMap;
pub(crate) use owners::{Owned, Owners};
use silhouette::{Axis, Body, FIRST_M, Motion, Outliner, Silhouette, TYPICAL_M, hidden_discs};
use std::collections::BinaryHeap;
use std::sync::Arc;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::{Face, Ray};

/// Least score of somebody who is there: 1 is the whole of their silhouette in one camera.
const LEAST_SCORE: f32 = 0.5;

/// ... and at least this share of all that cameras could see of them: where many look, more must be explained.
const LEAST_SHARE_SEEN: f32 = 0.24;

/// Most that one camera can take from somebody's score.
const MOST_AGAINST: f32 = 0.5;

/// Less of a silhouette than this share says nothing: strips beside others, which cover the rest.
const LEAST_SHARE: f32 = 0.12;

/// Share of their height by which others are taken to be wider to both sides, when strips beside them are told from people ...
const WIDER: f32 = 0.08;

/// ... and share of what they need that somebody must still have then.
const LEAST_BESIDE: f64 = 0.5;

/// Steps by which places and heights are moved, metres, from coarse to fine.
const STEPS_M: [f64; 2] = [0.12, 0.04];

/// Steps of who is expected: coarse ones when they are looked for, fine ones once all are there.
const COARSE_STEPS_M: &[f64] = &[STEPS_M[0]];
const FINE_STEPS_M: &[f64] = &[STEPS_M[1]];

/// Length of a step in the direction of which cameras tell least, over that in the direction of which they tell most.
const LONGEST_STEP: f64 = 1.5;

/// Steps of one size at most.
const MOST_STEPS: usize = 3;

/// Scores that differ by less are the same.
const SAME_SCORE: f64 = 1e-4;

/// Steps are taken only if what somebody explains with their silhouette, moved to where the other body stands, is less by no more than
/// this: an error that is allowed for, not a bound of it.
const MOVED_ERROR: f64 = 0.01;

/// Heights of people, metres.
const HEIGHTS_M: [f64; 2] = [0.9, 2.1];

/// Cost of a height other than the typical one, per square metre of difference.
const HEIGHT_COST: f32 = 1.5;

/// Most cells where people are looked for at one instant, those that most cameras show foreground: masks full of noise have more.
const MOST_CELLS_AT_ONCE: usize = 8192;

/// Most people of one scene at one instant.
const MOST_PEOPLE: usize = 512;

/// Share of the least score with which somebody is there who was expected.
const EXPECTED_SHARE: f32 = 0.6;

/// Share of what they need that is seen at least of somebody who is there, before they are moved by fine steps.
const COARSE_SHARE: f64 = 0.8;

/// Least share of a silhouette, and pixels of it, that must be open, covered by nobody else, for a camera to tell whether somebody is there.
const LOOKED_AT: f32 = 0.5;
const LEAST_LOOKED_AT_PX: f32 = 12.0;

/// Share of these that is foreground, beneath which nobody is there.
const MOST_OF_NOBODY: f32 = 0.2;

/// A camera does not show somebody where more than this share of their silhouette is background.
const MOST_BACKGROUND: f32 = 0.3;

/// Work that is done to find people: what more of it costs in time, less of it costs in accuracy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Columns in which masks are looked at, at most, from 1 on; larger masks are reduced.
    pub most_columns: u32,
    /// Times that everybody is moved and asked again, from 1 on.
    pub n_sweeps: usize,
    /// Side of the cells of the ground in which people are looked for, metres, from 0.05 on. Cells of large scenes are larger.
    pub cell_m: f64,
}

impl Default for Effort {
    fn default() -> Self {
        Self { most_columns: 320, n_sweeps: 2, cell_m: 0.25 }
    }
}

/// Somebody who is known from instants before, where they should be by now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// Place of their feet.
    pub foot_in_world: DVec3,
    /// Metres.
    pub height_m: f64,
}

/// Somebody who stands in a scene.
#[derive(Clone, Debug)]
pub struct Person {
    /// Place of their feet.
    pub foot_in_world: DVec3,
    /// Metres.
    pub height_m: f64,
    /// Sum over cameras of the share of their silhouette that only they explain, less the share that is background.
    pub score: f64,
    silhouettes: Arc<[Option<Silhouette>]>,
    /// Bits of the discs that surfaces hide, by camera.
    hidden: Arc<[u16]>,
    is_expected: bool,
}

impl Person {
    /// Returns the steps by which they are moved once all are there.
    const fn steps_once_all_are_there(&self) -> &'static [f64] {
        if self.is_expected { FINE_STEPS_M } else { &STEPS_M }
    }

    /// Returns the area of somebody's silhouette in a camera's picture with what is hidden of it, pixels of the mask as it is looked at; 0
    /// where the camera does not show them.
    pub(crate) fn area_px(&self, camera_idx: usize) -> f64 {
        self.silhouettes[camera_idx].as_ref().map_or(0.0, |of| f64::from(of.area_px))
    }
}

/// Finds people; keeps its memory from instant to instant.
#[derive(Debug, Default)]
pub struct Occupancy {
    effort: Effort,
    grid: Option<(Arc<Scene>, Grid)>,
    evidence: Vec<Evidence>,
    outliner: Outliner,
    /// By camera of the scene, of a body that is tried, and of where somebody stands now.
    axes: Vec<Option<Axis>>,
    axes_now: Vec<Option<Axis>>,
}

/// Somebody who may be there, by what they would explain.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    score: f32,
    cell: usize,
    /// By its place among [`FIRST_M`].
    height: usize,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let place = |of: &Self| (of.cell, of.height);
        self.score.total_cmp(&other.score).then(place(other).cmp(&place(self)))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Occupancy {
    /// Returns one that finds people with this effort.
    #[must_use]
    pub fn with(effort: Effort) -> Self {
        Self { effort, ..Self::default() }
    }

    /// Returns the effort with which people are found.
    #[must_use]
    pub const fn effort(&self) -> Effort {
        self.effort
    }

    /// Returns the bytes that are kept for a scene and the masks of its cameras.
    #[must_use]
    pub fn memory_bytes(&self) -> usize {
        let grid_bytes = self.grid.as_ref().map_or(0, |(_, grid)| grid.memory_bytes());
        grid_bytes + self.evidence.iter().map(Evidence::memory_bytes).sum::<usize>()
    }

    /// Returns who stands in `scene`; `labels` gives a camera's hard mask, by its place in the scene, if it has one. Those who are
    /// `expected` are looked for first, and less of them must be seen than of others.
    pub fn find<'a>(
        &mut self,
        scene: &Arc<Scene>,
        labels: impl Fn(usize) -> Option<&'a Mask>,
        expected: &[Expected],
    ) -> Vec<Person> {
        let masks: Vec<Option<&Mask>> = (0..scene.cameras.len()).map(labels).collect();
        self.fit(scene, &masks);
        let Some((_, mut grid)) = self.grid.take() else { return Vec::new() };
        let people = self.solve(scene, &mut grid, expected);
        self.grid = Some((Arc::clone(scene), grid));
        people
    }

    /// Leaves somebody out of those whose pixels are covered since they were found.
    pub(crate) fn uncover(&mut self, person: &Person) {
        self.cover_widened(person, -1);
    }

    /// Returns true if a camera looks at a place where somebody would stand, and shows nobody there, by the masks that were looked at last:
    /// at least half of their silhouette is covered by nobody else, and hardly any of that is foreground.
    pub(crate) fn shows_nobody(&mut self, scene: &Scene, camera_idx: usize, body: (DVec3, f64)) -> bool {
        let Some(([n_foreground, n_open], area_px)) = self.count_open(scene, camera_idx, body) else {
            return false;
        };
        let is_looked_at = n_open as f32 >= (LOOKED_AT * area_px).max(LEAST_LOOKED_AT_PX);
        is_looked_at && (n_foreground as f32) < MOST_OF_NOBODY * n_open as f32
    }

    /// Returns true if a camera shows background where it should show somebody who would stand at a place.
    pub(crate) fn shows_background(&mut self, scene: &Scene, camera_idx: usize, body: (DVec3, f64)) -> bool {
        let open = self.count_open(scene, camera_idx, body);
        open.is_some_and(|([n_foreground, n_open], area_px)| {
            (n_open - n_foreground) as f32 > MOST_BACKGROUND * area_px
        })
    }

    /// Counts the pixels of the silhouette that somebody of a height would have at a place in a camera's mask, and that nobody covers: those
    /// that are foreground, and all; with the silhouette's whole area. None if the camera does not look there.
    fn count_open(
        &mut self,
        scene: &Scene,
        camera_idx: usize,
        (foot_in_world, height_m): (DVec3, f64),
    ) -> Option<([u32; 2], f32)> {
        let evidence = &self.evidence[camera_idx];
        let camera = &scene.cameras[camera_idx].camera;
        let is_inside =
            |up_m: f64| camera.project(foot_in_world + DVec3::Z * up_m).is_some_and(|of| of.is_inside());
        if !evidence.is_usable() || !(is_inside(0.0) || is_inside(height_m)) {
            return None;
        }
        let body = Body { foot_in_world, height_m };
        let hidden = hidden_discs(camera, &scene.surfaces, &body);
        let silhouette = self.outliner.silhouette(camera, evidence.size(), &body, hidden)?;
        Some((evidence.count_open(&silhouette), silhouette.area_px))
    }

    /// Takes the masks, and makes the cells anew if the scene or a picture's size is another.
    fn fit(&mut self, scene: &Arc<Scene>, masks: &[Option<&Mask>]) {
        self.evidence.resize_with(masks.len(), Evidence::default);
        let mut sizes = Vec::with_capacity(masks.len());
        for (evidence, mask) in self.evidence.iter_mut().zip(masks) {
            match mask {
                Some(mask) => evidence.load(mask, self.effort.most_columns),
                None => *evidence = Evidence::default(),
            }
            sizes.push(evidence.size());
        }
        let is_known =
            self.grid.as_ref().is_some_and(|(of, grid)| Arc::ptr_eq(of, scene) && grid.is_for(&sizes));
        if !is_known {
            // Cameras that show nothing now may do so again.
            let before = self.grid.take().filter(|(of, _)| Arc::ptr_eq(of, scene)).map(|(_, grid)| grid);
            if let Some(before) = before {
                let absent = sizes.iter_mut().zip(before.sizes()).filter(|(size, _)| size.0 == 0);
                absent.for_each(|(size, known)| *size = *known);
            }
            self.grid = Some((Arc::clone(scene), Grid::new(scene, sizes, self.effort.cell_m)));
        }
    }

    fn solve(&mut self, scene: &Scene, grid: &mut Grid, expected: &[Expected]) -> Vec<Person> {
        let cells = self.cells_with_foreground(grid);
        let filled = cells.iter().filter(|(_, is_filled)| *is_filled).map(|(cell, _)| *cell).collect();
        self.cover_vehicles(scene, grid, filled);
        let mut people: Vec<Person> = Vec::new();
        for expected in expected {
            people.extend(self.look_for(scene, grid.sizes(), expected));
        }
        let mut heap = self.candidates(scene, grid, &cells);
        while let Some(best) = heap.pop().filter(|_| people.len() < MOST_PEOPLE) {
            let Known { silhouettes, hidden } =
                grid.silhouettes(scene, &mut self.outliner, (best.cell, best.height));
            let score = self.score(&silhouettes, FIRST_M[best.height]);
            if score < self.least_score(&silhouettes) {
                continue;
            }
            // Others have covered some of it since it was asked.
            if heap.peek().is_some_and(|next| next.score > score) {
                heap.push(Candidate { score, ..best });
                continue;
            }
            let (foot_in_world, score) = (grid.foot(best.cell), f64::from(score));
            let height_m = FIRST_M[best.height];
            let mut person =
                Person { foot_in_world, height_m, score, silhouettes, hidden, is_expected: false };
            self.improve(scene, grid.sizes(), &mut person, &STEPS_M);
            self.cover(&person, 1);
            people.push(person);
        }
        for sweep in 0..self.effort.n_sweeps.max(1) {
            people.retain_mut(|person| {
                self.cover(person, -1);
                let score = f64::from(self.score(&person.silhouettes, person.height_m));
                // Once everybody was moved, who explains what they did before is taken to stand well.
                if sweep == 0 || (score - person.score).abs() > SAME_SCORE {
                    self.improve(scene, grid.sizes(), person, person.steps_once_all_are_there());
                }
                let is_kept = person.score >= self.needed_score(person);
                if is_kept {
                    self.cover(person, 1);
                }
                is_kept
            });
        }
        self.drop_strips(people)
    }

    /// Leaves out those who explain little but strips beside others, whose bodies are wider than they are taken to be.
    fn drop_strips(&mut self, mut people: Vec<Person>) -> Vec<Person> {
        for person in &people {
            self.cover(person, -1);
            self.cover_widened(person, 1);
        }
        people.sort_by(|a, b| a.score.total_cmp(&b.score));
        people.retain(|person| {
            self.cover_widened(person, -1);
            let score = self.score(&person.silhouettes, person.height_m);
            let is_kept = f64::from(score) >= LEAST_BESIDE * self.needed_score(person);
            if is_kept {
                self.cover_widened(person, 1);
            }
            is_kept
        });
        people
    }

    fn cover_widened(&mut self, person: &Person, by: i16) {
        for (evidence, silhouette) in self.evidence.iter_mut().zip(person.silhouettes.iter()) {
            if let Some(silhouette) = silhouette.as_ref().filter(|_| evidence.is_usable()) {
                evidence.cover(&silhouette.widened(WIDER, evidence.size().0), by);
            }
        }
    }

    /// Returns somebody who is expected if they are near, and covers their pixels.
    fn look_for(&mut self, scene: &Scene, sizes: &[(usize, usize)], expected: &Expected) -> Option<Person> {
        let foot_in_world = ground_at(scene, expected.foot_in_world.truncate(), expected.foot_in_world.z)?;
        let height_m = expected.height_m.clamp(HEIGHTS_M[0], HEIGHTS_M[1]);
        let body = Body { foot_in_world, height_m };
        let hidden = hidden_of(scene, sizes, &body);
        let silhouettes = silhouettes(scene, sizes, &mut self.outliner, &body, &hidden);
        let mut person =
            Person { foot_in_world, height_m, score: 0.0, silhouettes, hidden, is_expected: true };
        self.improve(scene, sizes, &mut person, COARSE_STEPS_M);
        // Fine steps are still to come.
        (person.score >= COARSE_SHARE * self.needed_score(&person)).then(|| {
            self.cover(&person, 1);
            person
        })
    }

    /// Returns the score that somebody needs to be there.
    fn needed_score(&self, person: &Person) -> f64 {
        let share = if person.is_expected { EXPECTED_SHARE } else { 1.0 };
        f64::from(share * self.least_score(&person.silhouettes))
    }

    /// Returns the cells where people may be by the masks, and whether nearly all cameras show foreground there.
    fn cells_with_foreground(&self, grid: &Grid) -> Vec<(usize, bool)> {
        let mut cells: Vec<(usize, f32, bool)> = Vec::new();
        let is_foreground = |camera: usize, pixel: usize| {
            let evidence = &self.evidence[camera];
            evidence.is_usable().then(|| evidence.is_foreground(pixel))
        };
        grid.candidates(is_foreground, |cell, share, is_filled| cells.push((cell, share, is_filled)));
        keep_likeliest(&mut cells, MOST_CELLS_AT_ONCE);
        cells.into_iter().map(|(cell, _, is_filled)| (cell, is_filled)).collect()
    }

    /// Returns who may be in which of `cells`, by what they would explain beside vehicles and people who are covered already. A cell where
    /// that is too little for anybody is left out.
    fn candidates(
        &mut self,
        scene: &Scene,
        grid: &mut Grid,
        cells: &[(usize, bool)],
    ) -> BinaryHeap<Candidate> {
        let mut heap = BinaryHeap::new();
        let is_open_foreground = |camera: usize, pixel: usize| {
            let evidence = &self.evidence[camera];
            let is_open = evidence.is_usable() && !evidence.is_covered(pixel);
            is_open.then(|| evidence.is_foreground(pixel))
        };
        let open = cells.iter().map(|(cell, _)| *cell);
        let open = open.filter(|cell| grid.share_with_foreground(*cell, is_open_foreground).is_some());
        let open: Vec<usize> = open.collect();
        for (cell, height) in
            open.iter().flat_map(|cell| (0..FIRST_M.len()).map(move |height| (*cell, height)))
        {
            let silhouettes = grid.silhouettes(scene, &mut self.outliner, (cell, height)).silhouettes;
            let score = self.score(&silhouettes, FIRST_M[height]);
            if score >= self.least_score(&silhouettes) {
                heap.push(Candidate { score, cell, height });
            }
        }
        heap
    }

    fn cover(&mut self, person: &Person, by: i16) {
        for (evidence, silhouette) in self.evidence.iter_mut().zip(person.silhouettes.iter()) {
            if let Some(silhouette) = silhouette.as_ref().filter(|_| evidence.is_usable()) {
                evidence.cover(silhouette, by);
            }
        }
    }

    /// Returns what somebody with these silhouettes explains of what nobody explains yet.
    fn score(&self, silhouettes: &[Option<Silhouette>], height_m: f64) -> f32 {
        let of_cameras = self.with_evidence(silhouettes).map(|(evidence, silhouette)| {
            share_score(evidence.gain(silhouette) / silhouette.area_px.max(1.0))
        });
        height_score(height_m) + of_cameras.sum::<f32>()
    }

    /// Returns the score that somebody with these silhouettes needs.
    fn least_score(&self, silhouettes: &[Option<Silhouette>]) -> f32 {
        let seen: f32 = self.with_evidence(silhouettes).map(|(_, silhouette)| silhouette.seen_share()).sum();
        LEAST_SCORE.max(LEAST_SHARE_SEEN * seen)
    }

    /// Returns the silhouettes of cameras that say anything, each with its evidence.
    fn with_evidence<'a>(
        &'a self,
        silhouettes: &'a [Option<Silhouette>],
    ) -> impl Iterator<Item = (&'a Evidence, &'a Silhouette)> {
        let all = self.evidence.iter().zip(silhouettes);
        all.filter(|(evidence, _)| evidence.is_usable())
            .filter_map(|(evidence, of)| Some((evidence, of.as_ref()?)))
    }

    /// Moves somebody by steps of these sizes, and makes them taller or smaller, as long as that explains more.
    fn improve(&mut self, scene: &Scene, sizes: &[(usize, usize)], person: &mut Person, steps_m: &[f64]) {
        person.score = f64::from(self.score(&person.silhouettes, person.height_m));
        let directions = self.directions(scene, person);
        for &step_m in steps_m {
            for _ in 0..MOST_STEPS {
                let before = person.score;
                self.step(scene, sizes, person, (&directions, step_m));
                if person.score <= before {
                    break;
                }
            }
        }
    }

    /// Returns the directions over the ground in which pictures of the cameras that show somebody tell most and least of where they stand,
    /// each as long as a step should be: 1 along the first, and up to [`LONGEST_STEP`] along the second. Steps along any other two are no
    /// way to where they stand if cameras look in one line: each of them leads off the narrow ridge of good places.
    fn directions(&self, scene: &Scene, person: &Person) -> [DVec2; 2] {
        let mut information = [0.0; 3];
        let shown = scene.cameras.iter().zip(&self.evidence).zip(person.silhouettes.iter());
        for ((member, evidence), silhouette) in shown {
            let is_shown = evidence.is_usable() && silhouette.is_some();
            let from_camera = person.foot_in_world - member.camera.pose().position_in_world;
            let Some(away) = from_camera.truncate().try_normalize().filter(|_| is_shown) else { continue };
            let distance_m = from_camera.length();
            // A level step across moves the picture by its length over the distance; one away by that times the sine of the angle of view.
            let across =
                (member.camera.focal_px().x / (f64::from(member.camera.size_px().0) * distance_m)).powi(2);
            let along = across * (from_camera.z / distance_m).powi(2);
            let side = away.perp();
            for (sum, [a, b]) in information.iter_mut().zip([[0, 0], [0, 1], [1, 1]]) {
                *sum += across * side[a] * side[b] + along * away[a] * away[b];
            }
        }
        let [xx, xy, yy] = information;
        let (middle, half) = (f64::midpoint(xx, yy), (0.5 * (xx - yy)).hypot(xy));
        let most = DVec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy));
        let ratio = ((middle + half) / (middle - half)).sqrt();
        let longer = if ratio.is_finite() { ratio.clamp(1.0, LONGEST_STEP) } else { 1.0 };
        [most, most.perp() * longer]
    }

    /// Tries a step each way over the ground, and in height.
    fn step(
        &mut self,
        scene: &Scene,
        sizes: &[(usize, usize)],
        person: &mut Person,
        ([most, least], step_m): (&[DVec2; 2], f64),
    ) {
        self.axes_of(scene, sizes, &Body { foot_in_world: person.foot_in_world, height_m: person.height_m });
        let mut axes = std::mem::take(&mut self.axes_now);
        std::mem::swap(&mut axes, &mut self.axes);
        for by in [*most, -*most, *least, -*least] {
            let place = person.foot_in_world.truncate() + by * step_m;
            if let Some(foot_in_world) = ground_at(scene, place, person.foot_in_world.z) {
                let body = Body { foot_in_world, height_m: person.height_m };
                self.try_body(scene, sizes, (person, &mut axes), &body);
            }
        }
        for by in [1.0, -1.0] {
            let height_m = (person.height_m + by * step_m).clamp(HEIGHTS_M[0], HEIGHTS_M[1]);
            let body = Body { foot_in_world: person.foot_in_world, height_m };
            self.try_body(scene, sizes, (person, &mut axes), &body);
        }
        self.axes_now = axes;
    }

    /// Takes another body for somebody, if it explains more. It is made only if what they cover now, moved to where it stands, nearly
    /// does; and surfaces are asked what they hide of it only if it explains more as long as they hide the same of it.
    fn try_body(
        &mut self,
        scene: &Scene,
        sizes: &[(usize, usize)],
        (person, axes): (&mut Person, &mut Vec<Option<Axis>>),
        body: &Body,
    ) {
        self.axes_of(scene, sizes, body);
        let is_hopeless = |score: f32| f64::from(score) < person.score - MOVED_ERROR;
        if self.moved_score(person, axes, body.height_m).is_some_and(is_hopeless) {
            return;
        }
        let mut hidden = Arc::clone(&person.hidden);
        let mut of = silhouettes(scene, sizes, &mut self.outliner, body, &hidden);
        let mut score = f64::from(self.score(&of, body.height_m));
        if score > person.score {
            let exact = hidden_of(scene, sizes, body);
            if exact != hidden {
                of = silhouettes(scene, sizes, &mut self.outliner, body, &exact);
                score = f64::from(self.score(&of, body.height_m));
                hidden = exact;
            }
        }
        if score > person.score {
            let Body { foot_in_world, height_m } = *body;
            let is_expected = person.is_expected;
            *person = Person { foot_in_world, height_m, score, silhouettes: of, hidden, is_expected };
            std::mem::swap(axes, &mut self.axes);
        }
    }

    /// Finds where cameras show the feet and the head of a body.
    fn axes_of(&mut self, scene: &Scene, sizes: &[(usize, usize)], body: &Body) {
        self.axes.clear();
        let of = |(member, size): (&crate::scene::SceneCamera, &(usize, usize))| {
            if size.0 == 0 { None } else { Axis::of(&member.camera, *size, body) }
        };
        self.axes.extend(scene.cameras.iter().zip(sizes).map(of));
    }

    /// Returns about what somebody would explain if they stood where [`Self::axes_of`] found the body, and were as tall; none where
    /// that cannot be told. `axes` are those of where they stand.
    fn moved_score(&self, person: &Person, axes: &[Option<Axis>], height_m: f64) -> Option<f32> {
        let mut score = height_score(height_m);
        let cameras = self.evidence.iter().zip(person.silhouettes.iter()).zip(axes.iter().zip(&self.axes));
        for ((evidence, silhouette), (from, to)) in cameras {
            let Some(silhouette) = silhouette.as_ref().filter(|_| evidence.is_usable()) else { continue };
            let motion = Motion::between(from.as_ref()?, to.as_ref()?)?;
            let area_px = silhouette.area_px * motion.area_scale();
            score += share_score(evidence.moved_gain(silhouette, &motion) / area_px.max(1.0));
        }
        Some(score)
    }
}

/// Keeps so many of cells that most cameras show foreground (with the share of these cameras), in their order.
fn keep_likeliest(cells: &mut Vec<(usize, f32, bool)>, most: usize) {
    if cells.len() > most {
        cells.sort_by(|(a_cell, a, _), (b_cell, b, _)| b.total_cmp(a).then(a_cell.cmp(b_cell)));
        cells.truncate(most);
        cells.sort_by_key(|(cell, ..)| *cell);
    }
}

/// Returns what a height counts against somebody.
fn height_score(height_m: f64) -> f32 {
    -HEIGHT_COST * ((height_m - TYPICAL_M) as f32).powi(2)
}

/// Returns what a camera counts for somebody of whose silhouette it explains a share, less the share that is background.
fn share_score(share: f32) -> f32 {
    if share.abs() < LEAST_SHARE { 0.0 } else { share.max(-MOST_AGAINST) }
}

/// Returns the ground at a place, near a height.
fn ground_at(scene: &Scene, place: DVec2, near_z: f64) -> Option<DVec3> {
    ground_beneath(scene, place.extend(near_z + 0.6)).filter(|ground| near_z + 0.6 - ground.z < 1.2)
}

/// Returns the ground, roof or storey beneath a point; none if what lies beneath is no place to stand.
pub(crate) fn ground_beneath(scene: &Scene, point: DVec3) -> Option<DVec3> {
    let hit = scene.surfaces.hit(&Ray { origin: point, direction: -DVec3::Z }, 0.0)?;
    (hit.face == Face::Top).then_some(hit.point_in_world)
}

#[cfg(test)]
mod tests;
