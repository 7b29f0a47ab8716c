//! The order of the stages, and what they make: soft mask, labels, blobs.

use super::blink::Blinking;
use super::components::{Components, Connectivity, Piece, Run, Wanted};
use super::contour::contour;
use super::difference::Pair;
use super::enlarge::Enlarger;
use super::fill::{Closing, Holes, Notches};
use super::flicker::Flicker;
use super::label::Judge;
use super::majority::Majority;
use super::memory::Memory;
use super::object_sizes::ObjectSizes;
use super::repair::{Columns, Surroundings, restore_legs};
use super::shadow::Shadows;
use super::soft::soften;
use super::split::Splitter;
use super::stages::{Running, ShadowWork, Stages};
use super::{Blob, PixelRect};
use crate::config::{MixtureRule, Resolution, SegmentSettings};
use crate::frame::{BitMask, BufferPool, ColorRange, Mask, Plane, YuvImage};
use crate::stage::StageState;
use std::sync::Arc;

/// Masks whose memory waits for the next frame: who keeps frames lets one frame's two go as a new one comes, and may have
/// let two frames go at once.
pub(super) const MAX_SPARE_MASKS: usize = 4;

/// What moves in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// Foreground share of every pixel, 0 to 255, to cut moving things out with smooth edges: at least one half
    /// where `labels` says moving, less than that in the pixels around it, and 0 beyond.
    pub soft_mask: Mask,
    /// [`MOVING`](super::MOVING), [`SHADOW`](super::SHADOW) or [`BACKGROUND`](super::BACKGROUND); every pixel of a blob is
    /// moving, and so are the notches of a blob where they differ faintly, and pieces that are too small for a blob but that noise does
    /// not explain.
    pub labels: Mask,
    /// The 8-connected pieces of the moving pixels that are large enough, those of several upright things parted, in the order of
    /// their first pixels.
    pub blobs: Vec<Blob>,
}

/// Finds what moves; keeps its memory from frame to frame.
///
/// Earlier frames decide on later ones by the noise that they had and by pixels whose verdict turned again and again:
/// [`Memory`].
#[derive(Debug)]
pub struct Segmenter {
    /// As they were given.
    settings: SegmentSettings,
    majority: Majority,
    judge: Judge,
    memory: Memory,
    stages: Stages,
    /// Says that frames are looked at in any order, so that none teaches anything.
    is_review: bool,
    shadows: Shadows,
    columns: Columns,
    surroundings: Surroundings,
    holes: Holes,
    closing: Closing,
    notches: Notches,
    blinking: Blinking,
    moving: BitMask,
    /// `moving` with its notches filled.
    filled: BitMask,
    shadow: BitMask,
    lit: BitMask,
    pieces: Pieces,
    enlarger: Enlarger,
    /// Pixels that never move, in the size of the pictures that are given.
    hidden: Option<BitMask>,
    /// Sizes of objects by where they stand, if a scene has the camera.
    object_sizes: Option<Arc<ObjectSizes>>,
    /// Memory of the masks, in the size of the pictures that are given.
    pool: Arc<BufferPool>,
}

impl Segmenter {
    /// A segmenter with these settings.
    #[must_use]
    pub fn new(settings: &SegmentSettings) -> Self {
        Self {
            judge: Judge::new(),
            settings: settings.clone(),
            majority: Majority::default(),
            memory: Memory::default(),
            stages: Stages::default(),
            is_review: false,
            shadows: Shadows::default(),
            columns: Columns::default(),
            surroundings: Surroundings::default(),
            holes: Holes::default(),
            closing: Closing::default(),
            notches: Notches::default(),
            blinking: Blinking::default(),
            moving: BitMask::default(),
            filled: BitMask::default(),
            shadow: BitMask::default(),
            lit: BitMask::default(),
            pieces: Pieces::default(),
            enlarger: Enlarger::default(),
            hidden: None,
            object_sizes: None,
            pool: BufferPool::new(MAX_SPARE_MASKS),
        }
    }

    /// Returns the same segmenter for frames in any order: it takes from its memory and adds nothing to it.
    #[must_use]
    pub const fn for_review(mut self) -> Self {
        self.is_review = true;
        self
    }

    /// Returns what the next verdict takes from earlier frames.
    #[must_use]
    pub const fn memory(&self) -> &Memory {
        &self.memory
    }

    /// As [`Self::memory`], to be changed or exchanged.
    pub const fn memory_mut(&mut self) -> &mut Memory {
        &mut self.memory
    }

    /// Goes on with other settings from the next frame on.
    pub fn set(&mut self, settings: &SegmentSettings) {
        self.settings = settings.clone();
    }

    /// Sets the sizes of objects. From the next frame on a piece too small for a blob is one if it has at least the area of an object
    /// that stands there and is no part of a larger blob beside it, unless `min_area_px` is set; and heights in metres and places on
    /// the ground are evidence of shadows. None: no scene says how large objects are.
    pub fn set_object_sizes(&mut self, object_sizes: Option<Arc<ObjectSizes>>) {
        if self.object_sizes != object_sizes {
            self.shadows.forget_direction();
        }
        self.object_sizes = object_sizes;
    }

    /// From now on nothing moves at these pixels of the pictures that are given (reduced, if the resolution is): nobody may
    /// see what does. Of pictures of another size nothing is hidden.
    pub fn hide(&mut self, pixels: Option<BitMask>) {
        self.hidden = pixels;
    }

    /// What never moves, if anything is hidden.
    #[must_use]
    pub const fn hidden(&self) -> Option<&BitMask> {
        self.hidden.as_ref()
    }

    /// At which size of the picture it works.
    #[must_use]
    pub const fn resolution(&self) -> Resolution {
        self.settings.resolution
    }

    /// The least area of a blob in pictures of `size_px`, in pixels of what is looked at.
    #[must_use]
    pub fn min_area_px(&self, size_px: (u32, u32)) -> u32 {
        Limits::reduced(&self.settings, size_px, self.factor_in(size_px)).min_area_px
    }

    /// By how much the sides of pictures of `size_px` are reduced.
    fn factor_in(&self, size_px: (u32, u32)) -> u32 {
        self.settings.resolution.factor_in(size_px)
    }

    /// The pixels found moving last, in the size of the pictures that were given: reduced, if the resolution is.
    #[must_use]
    pub const fn moving(&self) -> &BitMask {
        &self.moving
    }

    /// Finds what moves in a picture of `size_px`, of which `frame`, `background` and `unmatched` are reduced by the
    /// settings' resolution; masks and blobs are the full picture's. At full resolution as [`Self::segment`].
    ///
    /// # Panics
    /// As [`Self::segment`].
    #[must_use]
    pub fn segment_reduced(
        &mut self,
        frame: &YuvImage,
        background: [Plane<'_>; 3],
        unmatched: &BitMask,
        dt_secs: f64,
        size_px: (u32, u32),
    ) -> Segmentation {
        let factor = self.factor_in(size_px);
        let (soft_mask, labels) = self.find(frame, background, unmatched, dt_secs, (size_px, factor));
        let limits = Limits::full(&self.settings, size_px);
        if factor == 1 {
            let blobs = self.pieces.blobs(&self.moving, &limits);
            return Segmentation { soft_mask, labels, blobs };
        }
        let object_sizes = self.object_sizes.as_deref();
        self.enlarger.enlarge(
            (&soft_mask, &labels, [&self.moving, &self.filled]),
            size_px,
            factor,
            (&limits, object_sizes),
            &mut self.pieces,
        )
    }

    /// Finds what moves in `frame` before `background` (Y, U and V of the background picture, in the frame's own
    /// matrix and range); `unmatched` is the mixture's verdict, 1 where no background mode matched. `dt_secs` is the
    /// time since the frame before, which counts of turning pixels ask for.
    ///
    /// **Cost** of little but the pixels that may be foreground and the rectangles of blobs, with the rule `require`; linear in all pixels with the
    /// others, with closing and with the suppression of blinking pixels. Once the first frames have passed, nothing is
    /// allocated but the list of blobs, where masks are let go as new ones are made.
    ///
    /// # Panics
    /// When the background or `unmatched` is not of the frame's size.
    #[must_use]
    pub fn segment(
        &mut self,
        frame: &YuvImage,
        background: [Plane<'_>; 3],
        unmatched: &BitMask,
        dt_secs: f64,
    ) -> Segmentation {
        let size_px = (frame.width(), frame.height());
        let (soft_mask, labels) = self.find(frame, background, unmatched, dt_secs, (size_px, 1));
        let blobs = self.pieces.blobs(&self.moving, &Limits::full(&self.settings, size_px));
        Segmentation { soft_mask, labels, blobs }
    }

    /// The soft mask and the labels, in pictures of `size_px` whose sides are reduced by `factor`; leaves the pieces.
    fn find(
        &mut self,
        frame: &YuvImage,
        background: [Plane<'_>; 3],
        unmatched: &BitMask,
        dt_secs: f64,
        (size_px, factor): ((u32, u32), u32),
    ) -> (Mask, Mask) {
        let size = (frame.width(), frame.height());
        assert_eq!((background[0].width, background[0].height), size, "the background has the frame's size");
        let judged = (unmatched.width() as u32, unmatched.height() as u32);
        assert_eq!(judged, size, "the mixture's verdict has the frame's size");
        let pair = Pair { frame: [frame.plane(0), frame.plane(1), frame.plane(2)], background };
        if self.settings.mixture != MixtureRule::Ignore {
            self.majority.compute(unmatched);
        }
        let colors = (frame.matrix(), frame.range());
        let majority =
            if self.settings.mixture == MixtureRule::Ignore { unmatched } else { self.majority.bits() };
        let sigma_px = self.settings.blur_sigma_px_in(size_px);
        self.judge.set_blur(sigma_px / f64::from(factor));
        let mut running = self.stages.begin(&self.settings, &self.memory, dt_secs);
        // Frames in any order say nothing of colours that come and go.
        running.has_blinking &= !self.is_review;
        self.judge.judge(&pair, colors, (majority, &self.memory), (&self.settings, running));
        self.moving.clone_from(&self.judge.moving);
        self.shadow.clone_from(&self.judge.shadow);
        self.lit.clone_from(&self.judge.lit);
        if running.has_blinking {
            self.blinking.observe(&pair, (&self.judge.plain, &self.judge.weak), dt_secs);
        } else if !self.blinking.is_empty() {
            self.blinking = Blinking::default();
        }
        let limits = Limits::reduced(&self.settings, size_px, factor);
        if running.shadow != ShadowWork::None {
            self.judge_shadows(&pair, frame.range(), (running.shadow, limits.min_area_px));
        }
        if !self.is_review {
            self.judge.teach(&pair, colors, dt_secs, &self.settings, &mut self.memory);
        }
        self.repair(factor, running);
        self.leave_hidden_out();
        self.pieces.find(&self.moving);
        self.drop_pieces(&limits, running);
        self.fill_notches(size_px.1 / factor);
        soften(&self.filled, &self.shadow, &self.judge, &self.pool)
    }

    /// Tells shadows from what moves, or only measures how much of it they are.
    fn judge_shadows(&mut self, pair: &Pair<'_>, range: ColorRange, (work, least_px): (ShadowWork, u32)) {
        let (black_code, luma_codes, _) = range.luma_offset_luma_scale_chroma_scale();
        let least_codes = 0.5 * self.settings.delta() as f32 * luma_codes;
        let n_foreground = self.moving.count_ones() + self.shadow.count_ones() + self.lit.count_ones();
        let (moving, shadow, lit) = (&mut self.moving, &mut self.shadow, &mut self.lit);
        let components = &mut self.pieces.components;
        let sizes = self.object_sizes.as_deref();
        self.shadows.begin();
        let n_lit = self.shadows.judge_lit(pair, black_code, (moving, shadow, lit), components);
        let n_certain = n_lit
            + self.shadows.judge(pair, (black_code, least_codes), (moving, shadow), (components, sizes));
        if !self.is_review && n_foreground >= u64::from(least_px) {
            self.stages.observe_shadow(f64::from(n_certain) / n_foreground as f64);
        }
        if work == ShadowWork::Measured {
            for (moving, shadow) in self.moving.words_mut().iter_mut().zip(self.shadow.words_mut()) {
                *moving |= std::mem::take(shadow);
            }
        }
    }

    /// Returns which stages run and why, in the order in which they run.
    #[must_use]
    pub fn stages(&self) -> [StageState; 4] {
        self.stages.states(&self.settings)
    }

    /// Returns the settings.
    #[must_use]
    pub const fn settings(&self) -> &SegmentSettings {
        &self.settings
    }

    fn leave_hidden_out(&mut self) {
        let size = (self.moving.width(), self.moving.height());
        let Some(hidden) = self.hidden.as_ref().filter(|of| (of.width(), of.height()) == size) else {
            return;
        };
        for mask in [&mut self.moving, &mut self.shadow, &mut self.judge.faint] {
            for (word, hidden) in mask.words_mut().iter_mut().zip(hidden.words()) {
                *word &= !hidden;
            }
        }
    }

    /// Fills the notches of blobs, in the mask alone: blobs themselves are parted by them. `height_px` is the picture's.
    fn fill_notches(&mut self, height_px: u32) {
        self.filled.clone_from(&self.moving);
        // Rectangles of pieces may overlap; what lies beyond the first few pictures full of them stays as it is.
        let mut n_px = NOTCH_PICTURES * self.filled.width() as u64 * self.filled.height() as u64;
        for piece_idx in (0..self.pieces.is_blob.len()).filter(|piece_idx| self.pieces.is_blob[*piece_idx]) {
            let piece = &self.pieces.components.pieces()[piece_idx];
            let area_px = u64::from(piece.right - piece.left) * u64::from(piece.bottom - piece.top);
            let Some(left_px) = n_px.checked_sub(area_px) else { break };
            n_px = left_px;
            let piece = (piece, self.pieces.runs(piece_idx));
            self.notches.fill(&mut self.filled, piece, &self.judge.faint, height_px / NOTCH_DIVISOR);
        }
    }

    fn repair(&mut self, factor: u32, running: Running) {
        if running.shadow == ShadowWork::Told {
            self.columns.restore_enclosed_shadow(&mut self.moving, &mut self.shadow);
            self.pieces.components.find(&self.moving, Wanted::Ones, Connectivity::Eight);
            restore_legs(&mut self.moving, &mut self.shadow, self.pieces.components.pieces());
            self.surroundings.restore(&mut self.moving, &mut self.shadow, &mut self.pieces.components);
        }
        self.columns.bridge_gaps(&mut self.moving);
        let close_radius_px = (self.settings.close_radius_px + factor / 2) / factor;
        if close_radius_px > 0 {
            self.closing.close(&mut self.moving, close_radius_px);
        }
        let max_hole_px = self.settings.max_hole_px / (factor * factor);
        if max_hole_px > 0 {
            self.holes.fill(&mut self.moving, &self.judge.weak, max_hole_px, &mut self.pieces.components);
        }
        for (shadow, moving) in self.shadow.words_mut().iter_mut().zip(self.moving.words()) {
            *shadow &= !moving;
        }
    }

    /// Makes background of the pieces that are too small, hardly differ, or blink. Pieces too small for a blob stay in the mask where
    /// they are distinct.
    fn drop_pieces(&mut self, limits: &Limits, running: Running) {
        let (strong, blinking) = (&self.judge.strong, &self.blinking);
        let has_hysteresis = self.settings.delta_high > self.settings.delta();
        for piece_idx in 0..self.pieces.components.pieces().len() {
            let runs = self.pieces.runs(piece_idx);
            let n_strong = |run: &Run| strong.count_run(run.y as usize, run.start as usize, run.end as usize);
            let area_px = self.pieces.components.pieces()[piece_idx].area_px;
            let is_strong =
                |least: u32| !has_hysteresis || runs.iter().map(n_strong).sum::<u32>() >= least.max(1);
            let is_blob = area_px >= limits.min_area_px && is_strong(limits.min_strong_px);
            let is_in_mask = is_blob
                || (limits.min_mask_area_px..limits.min_area_px).contains(&area_px)
                    && is_strong(area_px / STRONG_DIVISOR)
                    && is_distinct(runs, area_px, &self.judge.distinct, &self.memory.flicker);
            let is_kept = is_in_mask && !(running.has_blinking && blinking.is_blinking(runs.iter()));
            if !is_kept {
                for run in runs {
                    self.moving.clear_run(run.y as usize, run.start as usize, run.end as usize);
                }
            }
            self.pieces.is_blob[piece_idx] = is_kept && is_blob;
            self.pieces.is_kept[piece_idx] = is_kept;
        }
        let size_px = (self.moving.width() as u32, self.moving.height() as u32);
        if let Some(object_sizes) = &self.object_sizes {
            self.pieces.add_objects(limits, object_sizes, size_px);
        }
    }
}

/// Returns true if noise does not explain a piece of `area_px` pixels that is too small for a blob: half of it is `distinct`,
/// and at most an eighth flickers.
fn is_distinct(runs: &[Run], area_px: u32, distinct: &BitMask, flicker: &Flicker) -> bool {
    let n_distinct = runs
        .iter()
        .map(|run| distinct.count_run(run.y as usize, run.start as usize, run.end as usize))
        .sum::<u32>();
    2 * n_distinct >= area_px
        && 8 * runs.iter().map(|run| flicker.n_restless(run.y, run.start, run.end)).sum::<u32>() <= area_px
}

/// Pieces of moving pixels with their runs; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    pub(super) components: Components,
    /// The runs, those of a piece together, each piece's from the top down.
    sorted: Vec<Run>,
    /// Where a piece's runs begin in `sorted`; one more at the end.
    begins: Vec<u32>,
    /// Flags of the pieces that stay in the mask.
    is_kept: Vec<bool>,
    /// Flags of the pieces that are blobs.
    is_blob: Vec<bool>,
    /// Numbers of the pieces that are large enough to be blobs wherever they are.
    large: Vec<u32>,
    splitter: Splitter,
    parts: Vec<(u32, u32)>,
    /// Of a part that may have come apart.
    apart: Components,
}

impl Pieces {
    /// Finds the pieces of `moving`; all are blobs at first.
    pub(super) fn find(&mut self, moving: &BitMask) {
        self.components.find(moving, Wanted::Ones, Connectivity::Eight);
        let (n_pieces, runs) = (self.components.pieces().len(), self.components.runs());
        for flags in [&mut self.is_kept, &mut self.is_blob] {
            flags.clear();
            flags.resize(n_pieces, true);
        }
        self.begins.clear();
        self.begins.resize(n_pieces + 1, 0);
        for run in runs {
            self.begins[run.piece_idx as usize + 1] += 1;
        }
        for piece_idx in 0..n_pieces {
            self.begins[piece_idx + 1] += self.begins[piece_idx];
        }
        self.sorted.clear();
        self.sorted.extend_from_slice(runs);
        let mut next = std::mem::take(&mut self.begins);
        for run in runs {
            let place = &mut next[run.piece_idx as usize];
            self.sorted[*place as usize] = *run;
            *place += 1;
        }
        // Each has run on to where the next one begins.
        next.rotate_right(1);
        if let Some(first) = next.first_mut() {
            *first = 0;
        }
        self.begins = next;
    }

    fn runs(&self, piece_idx: usize) -> &[Run] {
        &self.sorted[self.begins[piece_idx] as usize..self.begins[piece_idx + 1] as usize]
    }

    /// Makes no blobs of the pieces below the least area of a blob; calls `gone` with each run of those below the mask's.
    pub(super) fn drop_small(&mut self, limits: &Limits, mut gone: impl FnMut(&Run)) {
        for (piece_idx, piece) in self.components.pieces().iter().enumerate() {
            self.is_blob[piece_idx] &= piece.area_px >= limits.min_area_px;
            if piece.area_px < limits.min_mask_area_px {
                self.is_kept[piece_idx] = false;
                let place = self.begins[piece_idx] as usize..self.begins[piece_idx + 1] as usize;
                self.sorted[place].iter().for_each(&mut gone);
            }
        }
    }

    /// Makes blobs of the kept pieces that are smaller than the least area of a blob, but as large as an object which stands where
    /// they do in a picture of `size_px`, and no parts of a larger blob: beyond a quarter of its longer side.
    pub(super) fn add_objects(&mut self, limits: &Limits, object_sizes: &ObjectSizes, size_px: (u32, u32)) {
        if limits.min_mask_area_px >= limits.min_area_px {
            return;
        }
        let Self { components, is_kept, is_blob, large, .. } = self;
        let pieces = components.pieces();
        large.clear();
        large.extend((0..pieces.len() as u32).filter(|idx| is_blob[*idx as usize]));
        for (piece_idx, piece) in pieces.iter().enumerate() {
            if !is_kept[piece_idx] || is_blob[piece_idx] || piece.area_px >= limits.min_area_px {
                continue;
            }
            is_blob[piece_idx] = f64::from(piece.area_px)
                >= object_sizes.least_area_px(foot_of(piece), size_px)
                && !large.iter().any(|idx| is_beside(piece, &pieces[*idx as usize]));
        }
    }

    /// Returns the pieces that are blobs, those of several upright things parted.
    pub(super) fn blobs(&mut self, moving: &BitMask, limits: &Limits) -> Vec<Blob> {
        let mut blobs = Vec::new();
        let size = (moving.width() as u32, moving.height() as u32);
        for piece_idx in (0..self.is_blob.len()).filter(|piece_idx| self.is_blob[*piece_idx]) {
            let piece = self.components.pieces()[piece_idx];
            let runs = &self.sorted[self.begins[piece_idx] as usize..self.begins[piece_idx + 1] as usize];
            self.parts.clear();
            if limits.split_valley > 0.0 && piece.area_px >= 2 * limits.min_part_px {
                let (valley, least_px) = (limits.split_valley, limits.min_part_px);
                self.parts.extend(self.splitter.parts(runs, piece.left, piece.right, valley, least_px));
            }
            if self.parts.len() < 2 {
                let corners = contour(moving, 0..size.0, (runs[0].start, runs[0].y));
                blobs.push(blob(&piece, size, corners));
                continue;
            }
            for (first, end) in self.parts.iter().copied() {
                let clipped = runs.iter().filter(|run| run.start < end && run.end > first);
                self.apart.find_in_runs(clipped.map(|run| Run {
                    start: run.start.max(first),
                    end: run.end.min(end),
                    ..*run
                }));
                blobs.extend(part(&self.apart, moving, (first, end)));
            }
        }
        blobs
    }
}

/// What is left of a piece in `columns`, as one blob with the outline of its largest piece.
fn part(apart: &Components, moving: &BitMask, columns: (u32, u32)) -> Option<Blob> {
    let mut pieces = apart.pieces().iter().enumerate();
    let (mut largest, mut whole) = pieces.next().map(|(idx, piece)| ((idx, *piece), *piece))?;
    for (piece_idx, piece) in pieces {
        whole.absorb(piece);
        if piece.area_px > largest.1.area_px {
            largest = (piece_idx, *piece);
        }
    }
    let first = apart.runs().iter().find(|run| run.piece_idx as usize == largest.0)?;
    let corners = contour(moving, columns.0..columns.1, (first.start, first.y));
    Some(blob(&whole, (moving.width() as u32, moving.height() as u32), corners))
}

/// Returns the middle of a piece's lowest row, pixels.
fn foot_of(piece: &Piece) -> [f64; 2] {
    let (columns, n_columns) = piece.foot;
    [columns as f64 / f64::from(n_columns) + 0.5, f64::from(piece.bottom) - 0.5]
}

/// Returns true if a piece lies within a quarter of the longer side of another's rectangle, or in it: so near lie parts of one thing
/// that came apart.
fn is_beside(piece: &Piece, other: &Piece) -> bool {
    let margin = (other.right - other.left).max(other.bottom - other.top) / 4;
    piece.left < other.right + margin
        && piece.right + margin > other.left
        && piece.top < other.bottom + margin
        && piece.bottom + margin > other.top
}

fn blob(piece: &Piece, (width, height): (u32, u32), corners: Vec<[u16; 2]>) -> Blob {
    let [foot_x, _] = foot_of(piece);
    Blob {
        rect: PixelRect {
            x: piece.left,
            y: piece.top,
            width: piece.right - piece.left,
            height: piece.bottom - piece.top,
        },
        area_px: piece.area_px,
        foot_in_image: [foot_x, f64::from(piece.bottom)],
        is_truncated: piece.left == 0 || piece.right == width || piece.bottom == height,
        contour: Arc::from(corners),
    }
}

/// What a piece must have to be a blob, in pixels of the picture that is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub(super) min_area_px: u32,
    /// Least area of what a mask shows.
    min_mask_area_px: u32,
    /// Pixels above the high threshold.
    min_strong_px: u32,
    split_valley: f64,
    /// Least area of a part that is split off.
    min_part_px: u32,
}

impl Limits {
    /// For pieces of a picture of `size_px` at full resolution.
    pub(super) fn full(settings: &SegmentSettings, size_px: (u32, u32)) -> Self {
        let min_area_px = settings.min_area_px_in(size_px);
        Self {
            min_area_px,
            min_mask_area_px: settings.min_mask_area_px_in(size_px).min(min_area_px),
            min_strong_px: (min_area_px / STRONG_DIVISOR).max(1),
            split_valley: settings.split_valley,
            min_part_px: min_area_px,
        }
    }

    /// For pieces of a picture of `size_px` whose sides are reduced by `factor`: what just passes for large enough at full
    /// size must not be lost before.
    fn reduced(settings: &SegmentSettings, size_px: (u32, u32), factor: u32) -> Self {
        let full = Self::full(settings, size_px);
        let area = factor * factor;
        Self {
            min_area_px: (full.min_area_px / area).max(1),
            min_mask_area_px: (full.min_mask_area_px / area).max(1),
            min_strong_px: (full.min_strong_px / area).max(1),
            min_part_px: (full.min_part_px / area).max(1),
            ..full
        }
    }
}

/// Notches are closed by at most this part of the picture's height.
const NOTCH_DIVISOR: u32 = 30;

/// Notches are looked for in rectangles of at most so many pictures' pixels together.
const NOTCH_PICTURES: u64 = 4;

/// A blob needs its least area's share of one in so many that differ by more than the high threshold.
const STRONG_DIVISOR: u32 = 4;

#[cfg(test)]
mod tests;
