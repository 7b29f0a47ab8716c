//! Tells shadows among their candidates: by the structure of what they lie on, and by an owner.
//!
//! Candidates (pixels that are darker or lighter than their background and kept its chromaticity) flow in with the frame and its
//! background; what is neither shadow nor light moves from their bits to those of what moves. Within a shadow, what the frame is of its
//! background changes little from pixel to pixel, however much the background does; a thing hides the background, so there the
//! frame itself changes less than its ratio to the background. Medians over a region's neighbours tell which, and where
//! these are plain the strongest of the changes. Where none is more than noise, a region is shadow only at the feet of something that
//! moves, or where the light beside it changed as much. Where a scene says how large people are and where the ground lies, what is legs,
//! what lies by feet, and what lies on the side where shadows fall (`shadow_direction`) is told by that.
//!
//! `[SSL12]` Sanin, Sanderson and Lovell 2012, Shadow detection: a survey and comparative evaluation of recent methods, section
//! 2.5: candidates by chromaticity, regions of them, and how well their texture is the background's.

use super::components::{Components, Connectivity, Piece, Run, Wanted};
use super::difference::Pair;
use super::object_sizes::ObjectSizes;
use super::shadow_direction::{Caster, ShadowDirection, lies_in_shadow};
use crate::frame::{BitMask, Plane, WORD_PIXELS, quantile};

/// Side of a cell, pixels: gradients and attenuation are gathered by cells, and cells of one attenuation are a region.
const CELL_PX: u32 = 6;

/// Neighbouring cells whose attenuations differ by less than this (of their natural logarithms) are one region ...
const GREATEST_STEP: f32 = 0.10;

/// ... and a cell of fewer pixels says nothing of its attenuation.
const LEAST_CELL_PX: u32 = 4;

/// Bins of how much neighbours differ (of natural logarithms of luma): a hundredth each, the last for all that is more.
const N_STEPS: usize = 32;

/// Steps of the frame over its background are so much smaller than those of the frame alone where the background's structure is
/// kept, and so much larger where it is hidden.
const CLEARLY: f32 = 0.75;

/// Medians of steps below this are no structure, or below so many times what the noise makes.
const PLAIN: f32 = 0.065;
const PLAIN_IN_NOISE: f32 = 1.5;

/// Fewer steps than this in a region say nothing.
const LEAST_STEPS: u32 = 12;

/// Strongest steps decide where medians are plain: those above this share, if there are so many steps in all, and if they are so many
/// times what is plain and the others below this share of them.
const STRONG: f32 = 0.9;
const LEAST_SPARSE_STEPS: u32 = 40;
const STRONG_IN_PLAIN: f32 = 2.0;
const STRONGLY: f32 = 0.5;

/// Light beside a region is looked at so far from its ends, pixels, beyond what the blur carries there ...
const BESIDE_PX: u32 = 5;

/// ... and at no fewer pixels of a side than this. If it changed by this share of what it did within (of logarithms) to every side of
/// which so much is known, it is the light.
const LEAST_BESIDE: u32 = 4;
const LIGHT_BESIDE: f32 = 0.7;

/// A shadow without structure is at most so many times as large as what moves beside it.
const MOST_OWNERS: u32 = 3;

/// ... and lies beneath this share of its height ...
const LEAST_LOW: f32 = 0.6;

/// ... and with structure of its own, as where feet touch the ground and darken it, beneath this share.
const LEAST_LOW_OWN: f32 = 0.8;

/// Standard deviations of a region's rows from their mean to its top, and to its bottom.
const DEVIATIONS_TO_END: f64 = 1.4;

/// What stands there is a body without its legs if it is lower than this, metres ...
const LEAST_BODY_M: f64 = 1.4;

/// ... and with what lies beneath it no taller than this, metres.
const GREATEST_BODY_M: f64 = 2.1;

/// Somebody is at most so wide, metres.
const GREATEST_WIDTH_M: f64 = 1.2;

/// What is no taller than this lies on the ground, metres ...
const GREATEST_FLAT_M: f64 = 0.5;

/// ... and is the shadow of somebody whose feet are no further from it than this, metres: shoes may be as grey as the ground.
const GREATEST_GAP_M: f64 = 0.4;

/// Sums over the pixels of a cell or a region.
#[derive(Clone, Copy, Debug)]
struct Sums {
    n_px: u32,
    /// Luma above black, of the frame and of the background.
    frame: f32,
    background: f32,
    /// Columns and rows, and their squares.
    columns: f64,
    squared_columns: f64,
    rows: f64,
    squared_rows: f64,
    n_steps: u32,
    /// Steps between neighbours by their size: of the frame, and of the frame over its background.
    of_frame: [u32; N_STEPS],
    of_ratio: [u32; N_STEPS],
    of_background: [u32; N_STEPS],
}

impl Default for Sums {
    fn default() -> Self {
        let none = [0; N_STEPS];
        Self {
            n_px: 0,
            frame: 0.0,
            background: 0.0,
            columns: 0.0,
            squared_columns: 0.0,
            rows: 0.0,
            squared_rows: 0.0,
            n_steps: 0,
            of_frame: none,
            of_ratio: none,
            of_background: none,
        }
    }
}

/// Returns the step below which a share of `n` steps lie, by their histogram.
fn step_at(counts: &[u32; N_STEPS], n: u32, share: f32) -> f32 {
    0.01 * quantile(counts.map(|count| count as f32), share * n as f32).unwrap_or(N_STEPS as f32)
}

impl Sums {
    fn add(&mut self, other: &Self) {
        self.n_px += other.n_px;
        self.frame += other.frame;
        self.background += other.background;
        self.columns += other.columns;
        self.squared_columns += other.squared_columns;
        self.rows += other.rows;
        self.squared_rows += other.squared_rows;
        self.n_steps += other.n_steps;
        for step in 0..N_STEPS {
            self.of_frame[step] = self.of_frame[step].saturating_add(other.of_frame[step]);
            self.of_ratio[step] = self.of_ratio[step].saturating_add(other.of_ratio[step]);
            self.of_background[step] = self.of_background[step].saturating_add(other.of_background[step]);
        }
    }

    /// Returns the rows above and below which few pixels lie: of what is evenly long, a tenth of it.
    fn ends(&self) -> [f64; 2] {
        self.ends_of(self.rows, self.squared_rows)
    }

    /// Returns the columns to the left and right of which few pixels lie.
    fn sides(&self) -> [f64; 2] {
        self.ends_of(self.columns, self.squared_columns)
    }

    fn ends_of(&self, sum: f64, squares: f64) -> [f64; 2] {
        let n = f64::from(self.n_px.max(1));
        let mean = sum / n;
        let half = DEVIATIONS_TO_END * (squares / n - mean * mean).max(0.0).sqrt();
        [mean - half, mean + half]
    }

    fn mean_column(&self) -> f64 {
        self.columns / f64::from(self.n_px.max(1))
    }

    /// Returns the mean of its pixels' centres.
    fn middle_px(&self) -> [f64; 2] {
        [self.columns, self.rows].map(|sum| sum / f64::from(self.n_px.max(1)) + 0.5)
    }

    fn attenuation(&self) -> f32 {
        (self.frame / self.background.max(1.0)).clamp(0.0, 4.0)
    }
}

/// Verdict on a region's structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Structure {
    /// That of the background.
    Kept,
    /// Another than the background's.
    Other,
    /// One where the background has none.
    Own,
    /// None that the noise leaves.
    None,
}

/// Judges by the steps of a region whose pixels have noise of `variance` (codes squared).
fn structure(sums: &Sums, variance: f32) -> Structure {
    if sums.n_steps < LEAST_STEPS {
        return Structure::None;
    }
    let of_all = [&sums.of_frame, &sums.of_ratio, &sums.of_background];
    let [frame, ratio, background] = of_all.map(|counts| step_at(counts, sums.n_steps, 0.5));
    // The median of the difference of two pixels with this noise.
    let luma = sums.frame / sums.n_px as f32;
    let noise = 0.6745 * (2.0 * variance).sqrt() / luma.max(1.0);
    let plain = PLAIN.max(PLAIN_IN_NOISE * noise);
    if frame < plain && ratio < plain {
        return sparse_structure(sums, plain);
    }
    if ratio < CLEARLY * frame {
        Structure::Kept
    } else if background < plain {
        Structure::Own
    } else {
        Structure::Other
    }
}

/// Judges by the few strong steps of a region that is plain elsewhere: joints, lines, edges.
fn sparse_structure(sums: &Sums, plain: f32) -> Structure {
    if sums.n_steps < LEAST_SPARSE_STEPS {
        return Structure::None;
    }
    let [frame, ratio] = [&sums.of_frame, &sums.of_ratio].map(|counts| step_at(counts, sums.n_steps, STRONG));
    if frame >= STRONG_IN_PLAIN * plain && ratio < STRONGLY * frame {
        Structure::Kept
    } else if ratio >= STRONG_IN_PLAIN * plain && frame < STRONGLY * ratio {
        Structure::Other
    } else {
        Structure::None
    }
}

/// Cells of one piece that have about one attenuation.
#[derive(Clone, Copy, Debug)]
struct Region {
    sums: Sums,
    structure: Structure,
    /// The largest piece of what moves that it touches.
    owner_idx: Option<u32>,
    is_shadow: bool,
    /// Says that it makes somebody whole who stands on the ground.
    is_legs: bool,
    /// Says that it lies on the ground by somebody's feet.
    is_flat: bool,
    /// Says that it lies where its owner's shadow falls.
    is_fallen: bool,
    /// Background to its left and to its right.
    beside: [Beside; 2],
}

/// Pixels to one side of a region that are background: luma above black of the frame and of the background.
#[derive(Clone, Copy, Debug, Default)]
struct Beside {
    frame: f32,
    background: f32,
    n_px: u32,
}

impl Region {
    /// Returns whether the light beside it changed as within it, so that its outline is only where the change reached the threshold.
    fn is_light(&self) -> bool {
        let within = self.sums.attenuation().max(0.01).ln();
        let mut known = self.beside.iter().filter(|side| side.n_px >= LEAST_BESIDE).peekable();
        known.peek().is_some()
            && known.all(|side| {
                let around = (side.frame.max(1.0) / side.background.max(1.0)).ln();
                around * within > 0.0 && around.abs() >= LIGHT_BESIDE * within.abs()
            })
    }

    /// Returns whether its structure leaves open what it is.
    const fn is_open(&self) -> bool {
        matches!(self.structure, Structure::None | Structure::Own)
    }
}

/// Place of a piece's cells among all.
#[derive(Clone, Copy, Debug)]
struct Place {
    first: usize,
    columns: usize,
    left: u32,
    top: u32,
}

impl Place {
    fn cell(&self, x: u32, y: u32) -> usize {
        self.first + ((y - self.top) / CELL_PX) as usize * self.columns + ((x - self.left) / CELL_PX) as usize
    }

    /// Calls `of` with the cells of a run and the columns within each.
    fn cells(&self, run: &Run, mut of: impl FnMut(usize, u32, u32)) {
        let mut x = run.start;
        while x < run.end {
            let next = (self.left + ((x - self.left) / CELL_PX + 1) * CELL_PX).min(run.end);
            of(self.cell(x, run.y), x, next);
            x = next;
        }
    }
}

/// Somebody whose legs and shadow are one region, and the region of what is parted from it, if anything is.
#[derive(Clone, Copy, Debug)]
struct Parted {
    caster: Caster,
    region_idx: Option<usize>,
}

/// Judges candidates; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Shadows {
    /// Candidates that are darker themselves, or those that are lighter.
    candidates: BitMask,
    places: Vec<Place>,
    cells: Vec<Sums>,
    parents: Vec<u32>,
    region_of: Vec<u32>,
    regions: Vec<Region>,
    /// By region, while shadows are parted from legs.
    parted: Vec<Option<Parted>>,
    /// Pieces of what moves, while owners are looked for.
    owners: Components,
    /// Indices of the first run of each row in it; one more at the end.
    rows: Vec<u32>,
    /// None before the first frame.
    logarithms: Option<Logarithms>,
    /// Variance of the noise in this frame, once it was asked for.
    variance: Option<f32>,
    /// Direction in which shadows fall on the ground of the scene.
    direction: ShadowDirection,
}

impl Shadows {
    /// Begins a frame: what was known of its noise is forgotten.
    pub(super) const fn begin(&mut self) {
        self.variance = None;
    }

    /// Forgets in which direction shadows fall: another scene says where places are.
    pub(super) fn forget_direction(&mut self) {
        self.direction = ShadowDirection::default();
    }

    /// Moves what is no shadow from `shadow` to `moving`, and returns how many pixels are certain to be shadow, since they kept the
    /// structure of their background. `black_code` is luma's code of black; pixels that are darker by less than `least_codes` are
    /// candidates through the blur alone, and stay what they are.
    pub(super) fn judge(
        &mut self,
        pair: &Pair<'_>,
        (black_code, least_codes): (f32, f32),
        (moving, shadow): (&mut BitMask, &mut BitMask),
        (components, sizes): (&mut Components, Option<&ObjectSizes>),
    ) -> u32 {
        self.regions.clear();
        self.candidates.clone_from(shadow);
        leave_rims_out(pair, least_codes, &mut self.candidates);
        components.find(&self.candidates, Wanted::Ones, Connectivity::Four);
        if components.pieces().is_empty() {
            return 0;
        }
        self.find_regions(pair, black_code, [moving, shadow, shadow], components);
        let is_other = |region: &Region| region.structure == Structure::Other;
        self.move_runs(components, (moving, shadow), is_other);
        if self.regions.iter().any(Region::is_open) {
            self.look_beside(pair, black_code, [moving, shadow, shadow], components);
            self.find_owners(moving, components);
            if let Some(sizes) = sizes
                && self.find_legs((moving.width() as u32, moving.height() as u32), sizes)
            {
                self.part_from_legs((moving.width() as u32, moving.height() as u32), sizes);
                self.move_runs(components, (moving, shadow), |of| of.is_legs);
                self.find_owners(moving, components);
            }
            if let Some(sizes) = sizes {
                self.find_flat((moving.width() as u32, moving.height() as u32), sizes);
                self.find_fallen((moving.width() as u32, moving.height() as u32), sizes);
            }
            self.judge_plain();
            self.move_runs(components, (moving, shadow), |of| of.is_open() && !of.is_shadow);
        }
        self.n_kept_px()
    }

    /// Moves those of `lit`, which are lighter than their background and kept its chromaticity, to `shadow` that kept its structure too,
    /// since more light falls on them, and all others to `moving`. Returns how many those are that kept it.
    pub(super) fn judge_lit(
        &mut self,
        pair: &Pair<'_>,
        black_code: f32,
        (moving, shadow, lit): (&mut BitMask, &mut BitMask, &mut BitMask),
        components: &mut Components,
    ) -> u32 {
        components.find(lit, Wanted::Ones, Connectivity::Four);
        if components.pieces().is_empty() {
            return 0;
        }
        self.candidates.clone_from(lit);
        self.find_regions(pair, black_code, [moving, shadow, lit], components);
        self.look_beside(pair, black_code, [moving, shadow, lit], components);
        self.move_runs(components, (shadow, lit), |of| {
            of.structure == Structure::Kept || of.is_open() && of.is_light()
        });
        for (moving, lit) in moving.words_mut().iter_mut().zip(lit.words()) {
            *moving |= lit;
        }
        self.n_kept_px()
    }

    fn n_kept_px(&self) -> u32 {
        let kept = self.regions.iter().filter(|region| region.structure == Structure::Kept);
        kept.map(|region| region.sums.n_px).sum()
    }

    /// Finds the regions of the pieces of the candidates, and judges their structure; `changed` is all that is not background.
    fn find_regions(
        &mut self,
        pair: &Pair<'_>,
        black_code: f32,
        changed: [&BitMask; 3],
        components: &Components,
    ) {
        // Candidates become this or that, and all of them together stay the same.
        let variance = *self.variance.get_or_insert_with(|| noise_variance(pair, changed));
        self.gather(pair, black_code, components);
        self.join(components, variance);
    }

    fn gather(&mut self, pair: &Pair<'_>, black_code: f32, components: &Components) {
        self.places.clear();
        let mut n_cells = 0;
        for piece in components.pieces() {
            let columns = (piece.right - piece.left).div_ceil(CELL_PX) as usize;
            self.places.push(Place { first: n_cells, columns, left: piece.left, top: piece.top });
            n_cells += columns * (piece.bottom - piece.top).div_ceil(CELL_PX) as usize;
        }
        self.cells.clear();
        self.cells.resize(n_cells, Sums::default());
        let planes = [pair.frame[0], pair.background[0]];
        if self.logarithms.as_ref().is_none_or(|of| of.black_code != black_code) {
            self.logarithms = None;
        }
        let logarithms = self.logarithms.get_or_insert_with(|| Logarithms::new(black_code));
        for run in components.runs() {
            let place = self.places[run.piece_idx as usize];
            place.cells(run, |cell, start, end| {
                for x in start..end {
                    gather(
                        &mut self.cells[cell],
                        planes,
                        logarithms,
                        &self.candidates,
                        (x as usize, run.y as usize),
                    );
                }
            });
        }
    }

    /// Joins neighbouring cells of about one attenuation to regions, and judges their structure.
    fn join(&mut self, components: &Components, variance: f32) {
        let cells = &self.cells;
        self.parents.clear();
        self.parents.extend(0..cells.len() as u32);
        let is_alike = |a: usize, b: usize| {
            let (a, b) = (&cells[a], &cells[b]);
            if a.n_px == 0 || b.n_px == 0 {
                return false;
            }
            // A cell too small to tell goes with its neighbour.
            a.n_px < LEAST_CELL_PX
                || b.n_px < LEAST_CELL_PX
                || (a.attenuation().max(0.01).ln() - b.attenuation().max(0.01).ln()).abs() < GREATEST_STEP
        };
        for (place, piece) in self.places.iter().zip(components.pieces()) {
            let n_rows = (piece.bottom - piece.top).div_ceil(CELL_PX) as usize;
            for idx in 0..place.columns * n_rows {
                let at = place.first + idx;
                let beside = (idx % place.columns > 0).then(|| at - 1);
                let above = (idx >= place.columns).then(|| at - place.columns);
                for other in [beside, above].into_iter().flatten().filter(|other| is_alike(at, *other)) {
                    let (a, b) = (root(&mut self.parents, at as u32), root(&mut self.parents, other as u32));
                    self.parents[a.max(b) as usize] = a.min(b);
                }
            }
        }
        self.regions.clear();
        self.region_of.clear();
        self.region_of.resize(cells.len(), 0);
        for (at, cell) in cells.iter().enumerate() {
            // Roots come before those beneath them.
            let of = root(&mut self.parents, at as u32) as usize;
            if of == at {
                self.region_of[at] = self.regions.len() as u32;
                let (sums, structure) = (Sums::default(), Structure::None);
                self.regions.push(Region {
                    sums,
                    structure,
                    owner_idx: None,
                    is_shadow: false,
                    is_legs: false,
                    is_flat: false,
                    is_fallen: false,
                    beside: [Beside::default(); 2],
                });
            } else {
                self.region_of[at] = self.region_of[of];
            }
            let region = &mut self.regions[self.region_of[at] as usize];
            region.sums.add(cell);
        }
        for region in &mut self.regions {
            region.structure = structure(&region.sums, variance);
            region.is_shadow = region.structure == Structure::Kept;
        }
    }

    /// Finds the largest piece of what moves that each region without structure touches.
    fn find_owners(&mut self, moving: &BitMask, components: &Components) {
        self.owners.find(moving, Wanted::Ones, Connectivity::Eight);
        self.regions.iter_mut().for_each(|region| region.owner_idx = None);
        self.rows.clear();
        self.rows.resize(moving.height() + 1, 0);
        for run in self.owners.runs() {
            self.rows[run.y as usize + 1] += 1;
        }
        for y in 0..moving.height() {
            self.rows[y + 1] += self.rows[y];
        }
        let n_rows = moving.height() as u32;
        for run in components.runs() {
            let place = self.places[run.piece_idx as usize];
            for y in run.y.saturating_sub(1)..(run.y + 2).min(n_rows) {
                let runs = self.rows[y as usize] as usize..self.rows[y as usize + 1] as usize;
                let touching = self.owners.runs()[runs].iter().map(|owner| {
                    let start = run.start.max(owner.start.saturating_sub(1));
                    (owner, start)
                });
                for (owner, start) in touching.filter(|(owner, start)| *start < run.end.min(owner.end + 1)) {
                    let region_idx = self.region_of[place.cell(start, run.y)] as usize;
                    touch(&mut self.regions[region_idx], owner.piece_idx, self.owners.pieces());
                }
            }
        }
        self.share_owners();
    }

    /// Gives regions that touch nothing that moves the largest owner of those of their piece.
    fn share_owners(&mut self) {
        let ends = self.places.iter().skip(1).map(|place| place.first).chain([self.cells.len()]);
        for (place, end) in self.places.iter().zip(ends) {
            let own = &self.region_of[place.first..end];
            let owners = own.iter().filter_map(|idx| self.regions[*idx as usize].owner_idx);
            let largest = owners.max_by_key(|owner| self.owners.pieces()[*owner as usize].area_px);
            for idx in own {
                let region = &mut self.regions[*idx as usize];
                region.owner_idx = region.owner_idx.or(largest);
            }
        }
    }

    /// Looks at the pixels to the left and right of every region that are background.
    fn look_beside(
        &mut self,
        pair: &Pair<'_>,
        black_code: f32,
        changed: [&BitMask; 3],
        components: &Components,
    ) {
        let [frame, background] = [pair.frame[0], pair.background[0]];
        for run in components.runs() {
            let place = self.places[run.piece_idx as usize];
            let left = run.start.checked_sub(BESIDE_PX).map(|x| (0, run.start, x));
            let right =
                (run.end + BESIDE_PX <= frame.width).then(|| (1, run.end - 1, run.end + BESIDE_PX - 1));
            for (side, within, x) in [left, right].into_iter().flatten() {
                let (x, y) = (x as usize, run.y as usize);
                if changed.iter().any(|mask| mask.get(x, y)) {
                    continue;
                }
                let region = &mut self.regions[self.region_of[place.cell(within, run.y)] as usize];
                let above_black = |plane: Plane<'_>| (f32::from(plane.row(run.y)[x]) - black_code).max(1.0);
                let beside = &mut region.beside[side];
                beside.frame += above_black(frame);
                beside.background += above_black(background);
                beside.n_px += 1;
            }
        }
    }

    /// Finds the regions whose structure leaves open what they are and that are somebody's legs in a picture of `size_px`; returns true
    /// if there are any.
    fn find_legs(&mut self, size_px: (u32, u32), sizes: &ObjectSizes) -> bool {
        for region in self.regions.iter_mut().filter(|region| region.is_open() && !region.is_light()) {
            let owner = region.owner_idx.map(|owner| &self.owners.pieces()[owner as usize]);
            region.is_legs = owner.is_some_and(|owner| are_legs(&region.sums, owner, (sizes, size_px)));
        }
        self.regions.iter().any(|region| region.is_legs)
    }

    /// Parts the cells that lie where somebody's shadow falls from the regions that are their legs, in a picture of `size_px`.
    fn part_from_legs(&mut self, size_px: (u32, u32), sizes: &ObjectSizes) {
        let Some(direction) = self.direction.known() else { return };
        let n_regions = self.regions.len();
        self.parted.clear();
        self.parted.extend(self.regions.iter().map(|region| {
            let owner = region.owner_idx.filter(|_| region.is_legs)?;
            let owner = self.owners.pieces()[owner as usize];
            let whole = Piece { bottom: region.sums.ends()[1] as u32 + 1, ..owner };
            Some(Parted { caster: caster(&whole, sizes, size_px)?, region_idx: None })
        }));
        for (cell, of) in self.cells.iter().zip(&mut self.region_of) {
            let region_idx = *of as usize;
            let parted = self.parted.get_mut(region_idx).and_then(Option::as_mut);
            let Some(parted) = parted.filter(|_| cell.n_px > 0) else { continue };
            let place_m = sizes.ground_m(cell.middle_px(), size_px);
            if !place_m.is_some_and(|place_m| lies_in_shadow(direction, &parted.caster, place_m)) {
                continue;
            }
            let parted_idx = *parted.region_idx.get_or_insert_with(|| {
                let region = self.regions[region_idx];
                self.regions.push(Region { sums: Sums::default(), is_legs: false, ..region });
                self.regions.len() - 1
            });
            self.regions[parted_idx].sums.add(cell);
            *of = parted_idx as u32;
        }
        debug_assert!(self.regions.len() <= 2 * n_regions, "each region is parted once");
    }

    /// Finds the regions whose structure leaves open what they are and that lie flat on the ground by the feet of somebody in a picture of
    /// `size_px` whom they do not touch: their shadows.
    fn find_flat(&mut self, size_px: (u32, u32), sizes: &ObjectSizes) {
        for region in self.regions.iter_mut().filter(|region| region.is_open() && !region.is_legs) {
            let owners = self.owners.pieces();
            let is_too_small = |owner: u32| region.sums.n_px > MOST_OWNERS * owners[owner as usize].area_px;
            if region.owner_idx.is_none_or(is_too_small) {
                region.is_flat = owners.iter().any(|owner| {
                    region.sums.n_px <= MOST_OWNERS * owner.area_px
                        && lies_by_feet(&region.sums, owner, (sizes, size_px))
                });
            }
        }
    }

    /// Learns in which direction shadows fall from the regions that may be shadow, and finds those of them that lie where their owner's
    /// shadow falls, in a picture of `size_px`.
    fn find_fallen(&mut self, size_px: (u32, u32), sizes: &ObjectSizes) {
        let direction = self.direction.known();
        let may_be_shadow = |region: &&mut Region| region.structure != Structure::Other && !region.is_legs;
        for region in self.regions.iter_mut().filter(may_be_shadow) {
            let owner = region.owner_idx.map(|owner| &self.owners.pieces()[owner as usize]);
            let caster = owner.and_then(|owner| caster(owner, sizes, size_px));
            let place_m = sizes.ground_m(region.sums.middle_px(), size_px);
            let (Some(caster), Some(place_m)) = (caster, place_m) else { continue };
            if region.sums.n_px >= LEAST_STEPS && is_person(&caster) {
                self.direction.note(&caster, place_m);
            }
            region.is_fallen = direction.is_some_and(|direction| lies_in_shadow(direction, &caster, place_m));
        }
    }

    /// Judges regions without structure.
    fn judge_plain(&mut self) {
        for idx in 0..self.regions.len() {
            let region = self.regions[idx];
            if region.is_open() && (region.is_light() || region.is_flat || region.is_fallen) {
                self.regions[idx].is_shadow = true;
                continue;
            }
            let Some(owner) = region.owner_idx.map(|owner| self.owners.pieces()[owner as usize]) else {
                continue;
            };
            if region.is_legs || region.sums.n_px > MOST_OWNERS * owner.area_px {
                continue;
            }
            let is_beneath = |share: f32| {
                region.sums.ends()[0] as f32 >= owner.top as f32 + share * (owner.bottom - owner.top) as f32
            };
            self.regions[idx].is_shadow = match region.structure {
                Structure::None => is_beneath(LEAST_LOW),
                Structure::Own => is_beneath(LEAST_LOW_OWN),
                Structure::Kept | Structure::Other => region.is_shadow,
            };
        }
    }

    /// Moves the pixels of some regions from `shadow` to `moving`.
    fn move_runs(
        &self,
        components: &Components,
        (moving, shadow): (&mut BitMask, &mut BitMask),
        is_moved: impl Fn(&Region) -> bool,
    ) {
        for run in components.runs() {
            self.places[run.piece_idx as usize].cells(run, |cell, start, end| {
                if is_moved(&self.regions[self.region_of[cell] as usize]) {
                    shadow.move_run(moving, run.y as usize, start as usize, end as usize);
                }
            });
        }
    }
}

/// Returns true if a region beneath its owner makes somebody whole who would be too low without it, as they stand in a picture of
/// `size_px`.
fn are_legs(region: &Sums, owner: &Piece, (sizes, size_px): (&ObjectSizes, (u32, u32))) -> bool {
    let height_m = |foot_px: [f64; 2]| {
        sizes.metre_px(foot_px, size_px).map(|metre_px| (foot_px[1] - f64::from(owner.top)) / metre_px)
    };
    let (column, [_, bottom]) = (region.mean_column(), region.ends());
    let is_beneath =
        (f64::from(owner.left)..f64::from(owner.right)).contains(&column) && bottom > f64::from(owner.bottom);
    let alone = height_m([f64::midpoint(owner.left.into(), owner.right.into()), owner.bottom.into()]);
    let together = height_m([column, bottom]);
    is_beneath
        && alone.is_some_and(|height_m| height_m < LEAST_BODY_M)
        && together.is_some_and(|height_m| height_m <= GREATEST_BODY_M)
}

/// Returns true if a region is as low as what lies on the ground, and lies by the feet of its owner in a picture of `size_px`.
fn lies_by_feet(region: &Sums, owner: &Piece, (sizes, size_px): (&ObjectSizes, (u32, u32))) -> bool {
    let foot_px = [f64::midpoint(owner.left.into(), owner.right.into()), f64::from(owner.bottom)];
    let Some(metre_px) = sizes.metre_px(foot_px, size_px) else { return false };
    let ([left, right], [top, bottom]) = (region.sides(), region.ends());
    let gap =
        |[low, high]: [f64; 2], [other_low, other_high]: [f64; 2]| (other_low - high).max(low - other_high);
    let gap_px = GREATEST_GAP_M * metre_px;
    let height_m = (f64::from(owner.bottom) - f64::from(owner.top)) / metre_px;
    bottom - top <= GREATEST_FLAT_M * metre_px
        && (LEAST_BODY_M..=GREATEST_BODY_M).contains(&height_m)
        && gap([top, bottom], [foot_px[1]; 2]) <= gap_px
        && gap([left, right], [owner.left.into(), owner.right.into()]) <= gap_px
}

/// Returns somebody whose piece it is, as they stand in a picture of `size_px`; none where that is not known.
fn caster(owner: &Piece, sizes: &ObjectSizes, size_px: (u32, u32)) -> Option<Caster> {
    let foot_px = [f64::midpoint(owner.left.into(), owner.right.into()), f64::from(owner.bottom)];
    let metre_px = sizes.metre_px(foot_px, size_px)?;
    let height_px = f64::from(owner.bottom - owner.top);
    Some(Caster {
        foot_m: sizes.ground_m(foot_px, size_px)?,
        behind_m: sizes.ground_m([foot_px[0], foot_px[1] - 0.25 * height_px], size_px)?,
        height_m: height_px / metre_px,
        width_m: f64::from(owner.right - owner.left) / metre_px,
    })
}

/// Returns true if something is as tall and wide as a person.
fn is_person(caster: &Caster) -> bool {
    (LEAST_BODY_M..=GREATEST_BODY_M).contains(&caster.height_m) && caster.width_m <= GREATEST_WIDTH_M
}

/// Notes a piece that a region touches, if it is the largest so far.
fn touch(region: &mut Region, owner_idx: u32, pieces: &[Piece]) {
    let area_px = |idx: u32| pieces[idx as usize].area_px;
    if region.owner_idx.is_none_or(|known| area_px(known) < area_px(owner_idx)) {
        region.owner_idx = Some(owner_idx);
    }
}

/// Leaves those out of `shadow` whose own luma, unblurred, is darker by less than `least_codes`.
fn leave_rims_out(pair: &Pair<'_>, least_codes: f32, shadow: &mut BitMask) {
    let [frame, background] = [pair.frame[0], pair.background[0]];
    for y in 0..shadow.height() {
        let (frame, background) = (frame.row(y as u32), background.row(y as u32));
        for (word, bits) in shadow.row_mut(y).iter_mut().enumerate() {
            let mut left = *bits;
            while left != 0 {
                let x = 32 * word + left.trailing_zeros() as usize;
                if f32::from(background[x]) - f32::from(frame[x]) < least_codes {
                    *bits &= !(1 << (x % 32));
                }
                left &= left - 1;
            }
        }
    }
}

fn root(parents: &mut [u32], mut at: u32) -> u32 {
    while parents[at as usize] != at {
        let up = parents[at as usize];
        parents[at as usize] = parents[up as usize];
        at = up;
    }
    at
}

/// Natural logarithms of luma above black by code; black itself counts as one code.
#[derive(Clone, Debug)]
struct Logarithms {
    black_code: f32,
    of_codes: [f32; 256],
}

impl Logarithms {
    fn new(black_code: f32) -> Self {
        Self { black_code, of_codes: std::array::from_fn(|code| (code as f32 - black_code).max(1.0).ln()) }
    }
}

/// Adds a pixel to its cell.
#[inline]
fn gather(
    cell: &mut Sums,
    [frame, background]: [Plane<'_>; 2],
    logarithms: &Logarithms,
    shadow: &BitMask,
    (x, y): (usize, usize),
) {
    let (width, height) = (frame.width as usize, frame.height as usize);
    let (frame_row, background_row) = (frame.row(y as u32), background.row(y as u32));
    let own = [frame_row[x], background_row[x]];
    let above_black = own.map(|code| (f32::from(code) - logarithms.black_code).max(1.0));
    cell.n_px += 1;
    cell.frame += above_black[0];
    cell.background += above_black[1];
    cell.columns += x as f64;
    cell.squared_columns += (x * x) as f64;
    cell.rows += y as f64;
    cell.squared_rows += (y * y) as f64;
    let mut add = |other: [u8; 2]| {
        let step = |idx: usize| {
            logarithms.of_codes[usize::from(other[idx])] - logarithms.of_codes[usize::from(own[idx])]
        };
        let (of_frame, of_background) = (step(0), step(1));
        let bin = |step: f32| ((step.abs() * 100.0) as usize).min(N_STEPS - 1);
        cell.n_steps += 1;
        cell.of_frame[bin(of_frame)] += 1;
        cell.of_ratio[bin(of_frame - of_background)] += 1;
        cell.of_background[bin(of_background)] += 1;
    };
    if x + 1 < width && shadow.get(x + 1, y) {
        add([frame_row[x + 1], background_row[x + 1]]);
    }
    if y + 1 < height && shadow.get(x, y + 1) {
        add([frame.row(y as u32 + 1)[x], background.row(y as u32 + 1)[x]]);
    }
}

/// The variance of a pixel's noise, codes squared: of differences to the background where nothing moves, by their median.
fn noise_variance(pair: &Pair<'_>, changed: [&BitMask; 3]) -> f32 {
    const STEP: usize = 7;
    let [frame, background] = [pair.frame[0], pair.background[0]];
    // Counted in turn in one of four, since one count waits for the last in the same place.
    let mut counts = [[0_u32; 256]; 4];
    for y in (0..frame.height as usize).step_by(STEP) {
        let (frame, background) = (frame.row(y as u32), background.row(y as u32));
        let changed = changed.map(|mask| mask.row(y));
        for x in (0..frame.len()).step_by(STEP) {
            let word = x / WORD_PIXELS;
            let changed = changed[0][word] | changed[1][word] | changed[2][word];
            if (changed >> (x % WORD_PIXELS)) & 1 == 0 {
                counts[x / STEP % 4][usize::from(frame[x].abs_diff(background[x]))] += 1;
            }
        }
    }
    let counts: [u32; 256] = std::array::from_fn(|code| counts.iter().map(|counts| counts[code]).sum());
    let n: u32 = counts.iter().sum();
    // A code stands for what lies half a code to either side.
    let bins = quantile(counts.map(|count| count as f32), 0.5 * n as f32).unwrap_or(0.5);
    let median = (bins - 0.5).max(0.0);
    let deviation = 1.4826 * median;
    (deviation * deviation).clamp(0.5, 400.0)
}

#[cfg(test)]
mod tests;
