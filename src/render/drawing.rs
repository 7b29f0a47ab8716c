//! Pictures drawn piece by piece, so that others can be drawn between two pieces: what a picture takes is not what others wait for.
//!
//! Which pieces a picture has follows from the picture, its plan and the device alone, never from what is drawn beside it: so its bytes are
//! the same whether it was interrupted or not.

use super::effects::{self, Around};
use super::error::RenderError;
use super::lent_mesh::LentMesh;
use super::mesh::Mesh;
use super::passes::ENLARGE_MARGIN_PX;
use super::patches::Patches;
use super::pieces::{Cursor, Piece, Room};
use super::planned::{check_plan, sequences_bounds};
use super::prepare::{Stand, Uploads};
use super::renderer::{Pictures, Renderer, Shown, ShownFields};
use super::targets::TargetKey;
use crate::gpu::PassTime;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{self, FieldsForm, Part, Picture, Plan, Sampling, View};
use videofields_vision::frame::RgbImage;

/// Largest buffer for reading back that is kept between pictures, bytes.
const MAX_KEPT_READBACK_BYTES: u64 = 64 << 20;

/// Most bytes of targets that one piece of a picture is drawn on: larger pictures are drawn in bands. What a piece takes is what others
/// wait for.
const MAX_PIECE_BYTES: u64 = 64 << 20;

/// A finished picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rendered {
    /// The picture, of the view's size.
    pub image: RgbImage,
    /// Time that the device spent in each pass that ran; empty where it cannot tell.
    pub timings: Vec<PassTime>,
}

/// Number of the next turn of any renderer: what was gathered for one serves no other.
static TURNS: AtomicU64 = AtomicU64::new(1);

/// Progress of a picture that is drawn piece by piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Pieces of it are still to be drawn.
    MoreToDraw,
    /// All of it is there.
    Finished,
}

/// A picture that is being drawn, piece by piece.
#[derive(Debug)]
pub struct Drawing {
    width_px: u32,
    height_px: u32,
    data: Vec<u8>,
    timings: Vec<PassTime>,
    most_pixels: u64,
    part: usize,
    cursor: Cursor,
    /// True until the first piece of the picture is drawn: fields go on once a picture.
    is_first: bool,
    may_pause: bool,
    gathered: Option<Gathered>,
}

impl Drawing {
    fn of(picture: &Picture, plan: &Plan, most_pixels: u64) -> Self {
        let n_bytes = picture.width_px as usize * picture.height_px as usize * 3;
        let forms = [plan.fields, plan.hull_fields, plan.sequence_fields];
        Self {
            width_px: picture.width_px,
            height_px: picture.height_px,
            data: vec![0; n_bytes],
            timings: Vec::new(),
            most_pixels,
            part: 0,
            cursor: Cursor::default(),
            is_first: true,
            // A session's texture fields go on from picture to picture: another one between two pieces would show in the second.
            may_pause: plan.followed.is_none() || forms.iter().all(|form| *form == FieldsForm::Off),
            gathered: None,
        }
    }

    /// Returns true where other pictures may be drawn between two pieces of this one.
    #[must_use]
    pub const fn may_pause(&self) -> bool {
        self.may_pause
    }

    /// Returns the bytes of the picture.
    #[must_use]
    pub const fn n_bytes(&self) -> usize {
        self.data.len()
    }

    /// Returns the picture, as far as it was drawn.
    #[must_use]
    pub fn into_rendered(self) -> Rendered {
        let image = RgbImage { width: self.width_px, height: self.height_px, data: self.data };
        Rendered { image, timings: self.timings }
    }
}

/// Parts of a scene that a drawing shows, and of the renderer what was made ready for it, until another is drawn.
#[derive(Debug)]
struct Gathered {
    turn: u64,
    mesh: Arc<Mesh>,
    patches: Arc<Patches>,
    pictures: Pictures,
    fields: Option<ShownFields>,
    /// Hulls as a mesh, where fields colour them.
    hulls: Option<Arc<LentMesh>>,
    stand: Option<Stand>,
}

/// Returns the pixels beside a piece that are drawn with it, on every side.
fn margin_px(plan: &Plan, view: &View) -> u32 {
    plan.effects.margin_px(view, plan.resolution.step_px())
}

/// Returns what of a part is drawn at once on such a device.
fn room(plan: &Plan, view: &View, limits: &wgpu::Limits) -> Room {
    let effect_bytes = if plan.effects.is_none() { 0 } else { effects::PIXEL_BYTES };
    Room {
        times: plan.sampling.supersampling,
        max_side_px: limits.max_texture_dimension_2d,
        max_bytes: limits.max_buffer_size.min(MAX_PIECE_BYTES),
        pixel_bytes: TargetKey::pixel_bytes(plan.sampling.samples) + effect_bytes,
        margin_px: margin_px(plan, view),
        most_pixels: u64::MAX,
    }
}

/// Returns about how many pieces a picture without effects is drawn in, by its size and sampling.
#[must_use]
pub fn expected_pieces((width_px, height_px): (u32, u32), sampling: Sampling) -> u64 {
    let n_drawn = u64::from(width_px) * u64::from(height_px) * u64::from(sampling.supersampling).pow(2);
    n_drawn.saturating_mul(TargetKey::pixel_bytes(sampling.samples)).div_ceil(MAX_PIECE_BYTES).max(1)
}

impl Renderer {
    /// Draws `picture` of `state` as `plan` says, and waits for it.
    ///
    /// # Errors
    /// As [`Self::render_while`].
    pub fn render(
        &mut self,
        state: &SceneState,
        picture: &Picture,
        plan: &Plan,
    ) -> Result<Rendered, RenderError> {
        let drawn = self.render_while(state, picture, plan, &mut || true)?;
        Ok(drawn.expect("what is wanted to its end is drawn to its end"))
    }

    /// Draws `picture` of `state` as `plan` says while it is `wanted`, which is asked before each of its pieces: `None` once
    /// it is not.
    ///
    /// # Errors
    /// As [`Self::begin`] and [`Self::go_on`].
    pub fn render_while(
        &mut self,
        state: &SceneState,
        picture: &Picture,
        plan: &Plan,
        wanted: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Rendered>, RenderError> {
        let mut drawing = self.begin((state, plan), picture, u64::MAX)?;
        loop {
            if !wanted() {
                return Ok(None);
            }
            if self.go_on(&mut drawing, (state, plan), picture)? == Progress::Finished {
                return Ok(Some(drawing.into_rendered()));
            }
        }
    }

    /// Begins to draw `picture` of `state` as `plan` says, in pieces of about `most_pixels` at most, and of no more than are drawn at once;
    /// nothing is given to the device yet.
    ///
    /// # Errors
    /// A picture beyond [`Self::view_limits`], a plan that was made for another state.
    pub fn begin(
        &self,
        (state, plan): (&SceneState, &Plan),
        picture: &Picture,
        most_pixels: u64,
    ) -> Result<Drawing, RenderError> {
        picture.check(&self.view_limits()).map_err(RenderError::View)?;
        check_plan(state, plan)?;
        Ok(Drawing::of(picture, plan, most_pixels))
    }

    /// Draws the next piece of what was begun with the same state, plan and picture, and waits for it. Others may be drawn between two
    /// pieces, where [`Drawing::may_pause`]: the picture is the same.
    ///
    /// # Errors
    /// Cameras' pictures too large for the device, or what the device reports: after a loss ([`is_lost`](crate::gpu::GpuError::is_lost)) the renderer must be
    /// made anew, after anything else it can go on. A drawing that failed is begun anew.
    pub fn go_on(
        &mut self,
        drawing: &mut Drawing,
        (state, plan): (&SceneState, &Plan),
        picture: &Picture,
    ) -> Result<Progress, RenderError> {
        let gone_on = self.draw_piece(drawing, (state, plan), picture);
        if gone_on.is_err() {
            // Layers may be marked as filled that never were.
            self.backgrounds.clear();
            self.frames.clear();
            self.depth_maps.clear();
            self.textures.clear();
            self.targets.clear();
            self.mesh_fields.clear();
            self.sequences.clear();
            self.turn = 0;
        }
        self.targets.trim();
        self.readback.trim(MAX_KEPT_READBACK_BYTES);
        self.hulls.trim(MAX_KEPT_READBACK_BYTES);
        self.effects.trim(MAX_KEPT_READBACK_BYTES);
        if let Some(average) = &mut self.passes.average {
            average.trim(MAX_KEPT_READBACK_BYTES);
        }
        if let Some(enlarge) = &mut self.passes.enlarge {
            enlarge.trim(MAX_KEPT_READBACK_BYTES);
        }
        gone_on
    }

    /// Gathers what of a scene a drawing shows.
    fn gathered(&mut self, state: &SceneState, plan: &Plan) -> Gathered {
        let (mesh, patches) = self.scenes.of(state, self.depth_maps.side_px());
        let pictures = self.pictures(&mesh, plan);
        let fields = self.fields(state, plan);
        let hulls = match plan.hull_fields {
            FieldsForm::Off => None,
            _ => self.hull_meshes.of(state, plan),
        };
        // A mesh that the device cannot hold is drawn as without fields.
        let hulls = hulls.filter(|mesh| mesh.check(&self.gpu).is_ok());
        self.turn = TURNS.fetch_add(1, Ordering::Relaxed);
        let (turn, stand) = (self.turn, None);
        Gathered { turn, mesh, patches, pictures, fields, hulls, stand }
    }

    fn draw_piece(
        &mut self,
        drawing: &mut Drawing,
        (state, plan): (&SceneState, &Plan),
        picture: &Picture,
    ) -> Result<Progress, RenderError> {
        let Some(part @ Part { view, left_px, top_px }) = picture.parts.get(drawing.part) else {
            return Ok(Progress::Finished);
        };
        self.gpu.check()?;
        let mut gathered = match drawing.gathered.take() {
            // Nothing else was drawn since.
            Some(gathered) if gathered.turn == self.turn => gathered,
            _ => self.gathered(state, plan),
        };
        let beyond = sequences_bounds(state, plan);
        let stand = Stand::of(view, (&gathered.mesh, beyond));
        let mut uploads = Uploads::default();
        if gathered.stand.replace(stand) != Some(stand) {
            let fine = gathered.fields.as_ref().map(|fields| &*fields.mesh);
            let is_meshed = gathered.hulls.is_some();
            uploads = self.prepare(state, picture, (&stand, is_meshed), (plan, &gathered.patches, fine))?;
            self.find_mesh_cameras(state, gathered.hulls.as_deref());
        }
        let (step_px, margin_px) = (plan.resolution.step_px(), margin_px(plan, view));
        let room = Room { most_pixels: drawing.most_pixels, ..room(plan, view, self.gpu.limits()) };
        let Some(Piece { columns, rows }) = drawing.cursor.next(view, room, &self.hulls.dear(plan, view))
        else {
            return Err(RenderError::Plan("a part of a picture has no pixels".to_owned()));
        };
        let row_bytes = picture.width_px as usize * 3;
        let (left, top) = ((left_px + columns.start) as usize, (top_px + rows.start) as usize);
        let anchor_px = plan::anchor_px(picture, part);
        let first = |anchor: i64, start: u32| anchor + i64::from(start) - i64::from(margin_px);
        let around = Around {
            margin_px,
            most_reach: plan.effects.most_reach(view),
            anchor_px: [first(anchor_px[0], columns.start), first(anchor_px[1], rows.start)],
        };
        let is_last = columns.end >= view.width_px && rows.end >= view.height_px;
        let shown = match margin_px {
            0 => view.cropped(columns, rows),
            margin_px => view.cropped(columns, rows).coarse(1, margin_px),
        };
        let size_px = (shown.width_px, shown.height_px);
        let shown = match step_px {
            1 => shown,
            step_px => shown.coarse(step_px, ENLARGE_MARGIN_PX),
        };
        let piece = Shown {
            view: shown,
            size_px,
            around,
            mesh: &gathered.mesh,
            patches: &gathered.patches,
            fields: gathered.fields.as_ref(),
            hulls: gathered.hulls.as_deref(),
            beyond,
            viewer: picture.viewer,
            is_first: std::mem::take(&mut drawing.is_first),
            stand,
            pictures: &gathered.pictures,
        };
        self.submit(state, &piece, plan, &uploads)?;
        self.readback.read_rgb(&self.gpu, &mut drawing.data[top * row_bytes + left * 3..], row_bytes)?;
        for time in self.timer.read(&self.gpu)? {
            match drawing.timings.iter_mut().find(|sum| sum.pass == time.pass) {
                Some(sum) => sum.gpu += time.gpu,
                None => drawing.timings.push(time),
            }
        }
        drawing.gathered = Some(gathered);
        if is_last {
            (drawing.part, drawing.cursor) = (drawing.part + 1, Cursor::default());
        }
        let is_finished = drawing.part >= picture.parts.len();
        Ok(if is_finished { Progress::Finished } else { Progress::MoreToDraw })
    }
}
