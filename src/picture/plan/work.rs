//! How much work a picture is: what the time that it takes depends on, known before it is drawn.
//!
//! A [`Survey`] is made once of a picture and serves every setting; [`Work`] is what one setting makes of it. Plain numbers,
//! no device and no clock.

use super::coverage;
use super::{
    EntityStyle, FieldsForm, Filtering, HullForm, MAX_BLENDED_CAMERAS, Picture, Plan, PlannedBillboard,
    Sampling, Settings,
};
use crate::fuse::{Billboard, Entity, LEAST_VIEWS, MAX_RUN, SceneState};
use glam::DVec3;

/// Bytes of a megabyte, pixels of a megapixel, runs of a thousand: features are of the order of one.
const MILLION: f64 = 1e6;

/// What time depends on; a [`Work`] holds one number of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// 1.
    One,
    /// Parts of the picture.
    Parts,
    /// Megapixels that are drawn.
    Drawn,
    /// The same where each has several samples, else 0.
    Sampled,
    /// Drawn megapixels of surface.
    Surface,
    /// Drawn megapixels times the cameras that are blended at each, looked up between no texels.
    Nearest,
    /// As `Nearest`, between texels.
    Bilinear,
    /// As `Nearest`, between texels and levels.
    Levels,
    /// The same of the cameras with a depth map.
    DepthTests,
    /// 1 where texture fields run.
    Fields,
    /// The same of the cameras with a lens that bends.
    Lenses,
    /// Drawn megapixels that rectangles cover, times their sources.
    Rectangles,
    /// Rectangles, by the hundred.
    Entities,
    /// Runs of points, by the thousand.
    Points,
    /// Drawn megapixels that hulls' bounds cover, times their silhouettes.
    HullRays,
    /// Silhouettes of hulls, by the hundred.
    Silhouettes,
    /// Silhouettes of hulls that are drawn as meshes, and cameras of recorded ones, by the hundred.
    HullMeshes,
    /// Drawn megapixels times samples where entities are drawn over them, else 0.
    Later,
    /// Megabytes of pictures that are new to the device.
    Uploads,
    /// Depth maps that are not there yet.
    DepthMaps,
    /// Megapixels that are read and written where pixels are averaged or enlarged.
    Resampled,
    /// Megapixels of the finished picture.
    Finished,
    /// Drawn megapixels of a sky that takes a pass.
    Sky,
    /// Drawn megapixels in another light.
    Relit,
    /// Drawn megapixels whose surroundings are looked at.
    Occluded,
    /// Megapixels that are dotted.
    Stippled,
    /// Cameras that saw something of the instant.
    Cameras,
    /// Rectangles of all entities, by the hundred, whether shown or not.
    Sources,
    /// Programs for surfaces that were never drawn with.
    SurfacePrograms,
    /// The same for entities.
    EntityPrograms,
    /// The same for averaging and enlarging.
    ResamplePrograms,
    /// The same for what is done once the scene is drawn.
    EffectPrograms,
}

/// How many features there are.
pub(super) const N_FEATURES: usize = Feature::ALL.len();

impl Feature {
    /// All of them with their names in tables.
    pub const ALL: [(&'static str, Self); 32] = [
        ("one", Self::One),
        ("parts", Self::Parts),
        ("drawn", Self::Drawn),
        ("sampled", Self::Sampled),
        ("surface", Self::Surface),
        ("nearest", Self::Nearest),
        ("bilinear", Self::Bilinear),
        ("levels", Self::Levels),
        ("depth_tests", Self::DepthTests),
        ("fields", Self::Fields),
        ("lenses", Self::Lenses),
        ("rectangles", Self::Rectangles),
        ("entities", Self::Entities),
        ("points", Self::Points),
        ("hull_rays", Self::HullRays),
        ("silhouettes", Self::Silhouettes),
        ("hull_meshes", Self::HullMeshes),
        ("later", Self::Later),
        ("uploads", Self::Uploads),
        ("depth_maps", Self::DepthMaps),
        ("resampled", Self::Resampled),
        ("finished", Self::Finished),
        ("sky", Self::Sky),
        ("relit", Self::Relit),
        ("occluded", Self::Occluded),
        ("stippled", Self::Stippled),
        ("cameras", Self::Cameras),
        ("sources", Self::Sources),
        ("surface_programs", Self::SurfacePrograms),
        ("entity_programs", Self::EntityPrograms),
        ("resample_programs", Self::ResamplePrograms),
        ("effect_programs", Self::EffectPrograms),
    ];
}

/// One number for each [`Feature`], finite and at least 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Work([f64; N_FEATURES]);

impl Work {
    /// How much there is of a feature.
    #[must_use]
    pub const fn of(&self, feature: Feature) -> f64 {
        self.0[feature as usize]
    }

    /// Sets a feature; what is not finite or below 0 counts as none.
    pub const fn set(&mut self, feature: Feature, value: f64) {
        self.0[feature as usize] = if value.is_finite() && value > 0.0 { value } else { 0.0 };
    }
}

/// What the device does not have yet of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pending {
    /// Bytes of cameras' pictures that it must be given.
    pub upload_bytes: u64,
    /// Depth maps that must be drawn.
    pub depth_maps: u32,
    /// Whether the scene itself must be made ready first: cut into patches, its pictures read.
    pub is_unprepared: bool,
}

/// What a picture shows, as far as its cost goes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    size_px: (u32, u32),
    n_parts: usize,
    /// Share of the picture that shows a surface.
    surface_share: f64,
    /// Where at most n cameras are blended at a pixel, from 0 on.
    cameras: Vec<Blended>,
    /// By how many cameras places are seen: a bit for each number from 0 to [`MAX_BLENDED_CAMERAS`].
    seen_by: u16,
    evens_colors: bool,
    /// Pixels that the first sources' rectangles cover, and those of the sources beside them.
    rectangles_px: [f64; 2],
    n_billboards: usize,
    /// Pixels that hulls' bounds cover, times their silhouettes; and how many silhouettes there are.
    hulls_px: f64,
    n_silhouettes: usize,
    /// Cameras of recorded sequences.
    n_recorded: usize,
    /// Runs of points that the entities' blobs come to with every row, about.
    n_runs: f64,
    n_observations: usize,
    n_sources: usize,
    n_opened: usize,
    effects: Effects,
}

/// What is done once the scene is drawn, and the sky.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Effects {
    has_sky: bool,
    is_relit: bool,
    is_occluded: bool,
    is_stippled: bool,
    /// Pixels that are drawn for it, of those that the picture has.
    drawn_share: f64,
}

impl Default for Effects {
    fn default() -> Self {
        let (has_sky, is_relit, is_occluded, is_stippled) = Default::default();
        Self { has_sky, is_relit, is_occluded, is_stippled, drawn_share: 1.0 }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Blended {
    /// Cameras at a pixel of the picture in the mean; of those with a depth map, and with a lens that bends.
    all: f64,
    with_depth_maps: f64,
    with_lenses: f64,
}

/// A program that a pass draws with: one that was never drawn with is made first, which takes its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Program {
    /// Cameras that are blended at a pixel, and what else tells such programs apart.
    Surface(usize, SurfaceForm),
    /// Whether any is shown by two cameras; samples.
    Billboard(bool, u32),
    /// Samples.
    Points(u32),
    /// How hulls are drawn; samples.
    Hull(HullForm, u32),
    /// Pixels drawn for one each way, and drawn one for.
    Resample(u32, u32),
    /// Whether a sky, another light, occlusion and dots; samples.
    Effects([bool; 4], u32),
}

impl Program {
    /// Surfaces, entities, averaging and enlarging, effects: 0 to 3.
    pub(super) const fn pass(self) -> usize {
        match self {
            Self::Surface(..) => 0,
            Self::Billboard(..) | Self::Points(_) | Self::Hull(..) => 1,
            Self::Resample(..) => 2,
            Self::Effects(..) => 3,
        }
    }
}

/// What tells programs for surfaces apart that blend as many cameras.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SurfaceForm {
    /// Whether any camera has a depth map.
    has_depth_maps: bool,
    /// Whether texture fields colour them.
    has_fields: bool,
    /// Whether any has a lens that bends.
    has_lenses: bool,
    /// Whether anything is open.
    has_opened: bool,
    /// Whether colours are multiplied.
    evens_colors: bool,
    /// How backgrounds are looked up: some devices make a program anew for another sampler.
    filtering: Filtering,
    samples: u32,
}

/// The programs that a picture needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Variant {
    /// The numbers of cameras that are blended somewhere, a bit for each.
    blended: u16,
    form: SurfaceForm,
    others: [Option<Program>; 3],
}

impl Variant {
    /// Every one of them.
    pub fn programs(&self) -> impl Iterator<Item = Program> {
        let (blended, form) = (self.blended, self.form);
        let surfaces = (0..=MAX_BLENDED_CAMERAS).filter(move |n| blended & (1 << n) != 0);
        surfaces.map(move |n| Program::Surface(n, form)).chain(self.others.into_iter().flatten())
    }
}

impl Survey {
    /// Looks at `picture` of `state`, of which `plan` is the plan with every camera and source.
    ///
    /// **Cost** some hundred rays through the scene's surfaces, each projected into every camera of the plan.
    #[must_use]
    pub fn of(state: &SceneState, picture: &Picture, plan: &Plan) -> Self {
        let (n_places, seen) = coverage::seen(state, picture, &plan.surface_cameras);
        let share = |n: usize| n as f64 / n_places.max(1) as f64;
        let has_lens = |idx: &usize| {
            *state.cameras[*idx].camera.distortion() != videofields_vision::geometry::Distortion::None
        };
        let blended = |most: usize| {
            let of_all = |is_one: &dyn Fn(&usize) -> bool| {
                let of_place =
                    |cameras: &Vec<usize>| cameras.iter().take(most).filter(|idx| is_one(idx)).count();
                share(seen.iter().map(of_place).sum())
            };
            Blended {
                all: of_all(&|_| true),
                with_depth_maps: of_all(&|idx| plan.depth_map_cameras.contains(idx)),
                with_lenses: of_all(&has_lens),
            }
        };
        let surface_share = share(seen.len());
        let seen_by = seen.iter().fold(0, |bits, cameras| bits | 1 << cameras.len().min(MAX_BLENDED_CAMERAS));
        let cameras = (0..=MAX_BLENDED_CAMERAS.min(plan.surface_cameras.len())).map(blended).collect();
        let area = |of: &PlannedBillboard, source: usize| {
            let entity = &state.entities[of.entity];
            drawn_px(picture, entity, &entity.sources[source])
        };
        let mut rectangles_px = [0.0; 2];
        for planned in &plan.billboards {
            rectangles_px[0] += area(planned, planned.source);
            rectangles_px[1] += planned.beside.map_or(0.0, |beside| area(planned, beside.source));
        }
        // Of hulls that are not made yet: who has several cameras will have one.
        let hulls: Vec<&Entity> =
            state.entities.iter().filter(|entity| entity.sources.len() >= LEAST_VIEWS).collect();
        let of_hull =
            |entity: &&Entity| drawn_px(picture, entity, &entity.sources[0]) * entity.sources.len() as f64;
        let hulls_px = hulls.iter().map(of_hull).sum();
        let n_silhouettes = hulls.iter().map(|entity| entity.sources.len()).sum();
        let runs = |entity: usize, source: usize| {
            let rect = state.entities[entity].sources.get(source).map(|source| source.rect);
            rect.map_or(0.0, |rect| f64::from(rect.width.div_ceil(MAX_RUN)) * f64::from(rect.height))
        };
        // Of points that are not placed yet no more is known than whose they will be.
        let n_runs = match plan.billboards.as_slice() {
            [] => (0..state.entities.len()).map(|entity| runs(entity, 0)).sum(),
            planned => planned.iter().map(|of| runs(of.entity, of.source)).sum(),
        };
        let recorded = |idx: usize| {
            let moment = state.sequences.get(idx).and_then(|at| at.moment.as_ref().ok());
            moment.map_or(0, |moment| moment.views.len())
        };
        let sources = || state.entities.iter().flat_map(|entity| &entity.sources);
        Self {
            size_px: (picture.width_px, picture.height_px),
            n_parts: picture.parts.len(),
            surface_share,
            cameras,
            seen_by,
            evens_colors: plan.evens_colors,
            rectangles_px,
            n_billboards: plan.billboards.len(),
            hulls_px,
            n_silhouettes,
            n_recorded: plan.sequences.iter().map(|idx| recorded(*idx)).sum(),
            n_runs,
            n_observations: state.cameras.len(),
            n_sources: sources().count(),
            n_opened: plan.opened.len(),
            effects: Effects {
                has_sky: plan.sky,
                is_relit: plan.effects.relight.is_some(),
                is_occluded: plan.effects.occlusion.is_some(),
                is_stippled: plan.effects.stipple.is_some(),
                drawn_share: plan.effects.drawn_share(picture),
            },
        }
    }

    /// Megapixels of the finished picture.
    #[must_use]
    pub fn megapixels(&self) -> f64 {
        f64::from(self.size_px.0) * f64::from(self.size_px.1) / MILLION
    }

    /// How much work the picture is with `settings`, where the device lacks `pending`.
    #[must_use]
    pub fn work(&self, settings: &Settings, pending: Pending) -> Work {
        let (_, first) = self.first(settings);
        let finished = self.megapixels();
        let step = f64::from(settings.resolution.step_px());
        let times = f64::from(settings.sampling.supersampling);
        let whole = finished * self.effects.drawn_share;
        let drawn = whole * times * times / (step * step);
        let surface = drawn * self.surface_share;
        let looked_up = drawn * first.all;
        let n_samples = f64::from(settings.sampling.samples);
        // Where rectangles lie over one another, or reach beyond the picture, each pixel of theirs counts once and more.
        let share = |pixels: f64| drawn * pixels / (whole * MILLION).max(1.0);
        let is_billboards = settings.entities.has_billboards();
        let [alone, beside] = self.rectangles_px;
        let rectangles = alone + if settings.sources > 1 { beside } else { 0.0 };
        let stride = f64::from(settings.point_stride);
        let n_runs = if settings.entities == EntityStyle::Points { self.n_runs / stride } else { 0.0 };
        let n_shown = if is_billboards { self.n_billboards } else { 0 };
        let is_hulls = settings.entities.has_hulls();
        let has_entities = n_shown > 0 || n_runs > 0.0 || is_hulls && self.n_silhouettes > 0;
        let is_resampled = step > 1.0 || times > 1.0;
        // Fields know who is hidden.
        let has_fields = settings.fields != FieldsForm::Off;
        let has_depth_maps = settings.depth_maps && !has_fields;
        let only = |is_so: bool, value: f64| if is_so { value } else { 0.0 };
        let is_filtering = |filtering| settings.filtering == filtering;
        let of_hulls = if is_hulls && has_fields { self.n_silhouettes } else { 0 };
        let mut work = Work::default();
        for (feature, value) in [
            (Feature::One, 1.0),
            (Feature::Parts, self.n_parts as f64),
            (Feature::Drawn, drawn),
            (Feature::Sampled, only(n_samples > 1.0, drawn)),
            (Feature::Surface, surface),
            (Feature::Nearest, only(is_filtering(Filtering::Nearest), looked_up)),
            (Feature::Bilinear, only(is_filtering(Filtering::Bilinear), looked_up)),
            (Feature::Levels, only(is_filtering(Filtering::Levels), looked_up)),
            (Feature::DepthTests, only(has_depth_maps, drawn * first.with_depth_maps)),
            (Feature::Fields, only(has_fields, 1.0)),
            (Feature::Lenses, drawn * first.with_lenses),
            (Feature::Rectangles, only(is_billboards, share(rectangles))),
            (Feature::Entities, n_shown as f64 / 100.0),
            (Feature::Points, n_runs / 1000.0),
            (Feature::HullRays, only(is_hulls && !has_fields, share(self.hulls_px))),
            (Feature::Silhouettes, only(is_hulls, self.n_silhouettes as f64 / 100.0)),
            (Feature::HullMeshes, (of_hulls + self.n_recorded) as f64 / 100.0),
            (Feature::Later, only(has_entities, drawn * n_samples)),
            (Feature::Uploads, pending.upload_bytes as f64 / MILLION),
            (Feature::DepthMaps, only(has_depth_maps, f64::from(pending.depth_maps))),
            (Feature::Resampled, only(is_resampled, drawn + whole)),
            (Feature::Finished, finished),
            (Feature::Sky, only(self.effects.has_sky, drawn - surface)),
            (Feature::Relit, only(self.effects.is_relit, drawn)),
            (Feature::Occluded, only(self.effects.is_occluded, drawn)),
            (Feature::Stippled, only(self.effects.is_stippled, whole)),
            (Feature::Cameras, self.n_observations as f64),
            (Feature::Sources, self.n_sources as f64 / 100.0),
        ] {
            work.set(feature, value);
        }
        work
    }

    /// The programs that the picture needs with `settings`.
    #[must_use]
    pub fn variant(&self, settings: &Settings) -> Variant {
        let (n_cameras, first) = self.first(settings);
        let Sampling { samples, supersampling } = settings.sampling;
        let form = SurfaceForm {
            has_depth_maps: settings.depth_maps
                && settings.fields == FieldsForm::Off
                && first.with_depth_maps > 0.0,
            has_fields: settings.fields != FieldsForm::Off,
            has_lenses: first.with_lenses > 0.0,
            has_opened: self.n_opened > 0,
            evens_colors: self.evens_colors,
            filtering: settings.filtering,
            samples,
        };
        let has_beside = settings.sources > 1 && self.rectangles_px[1] > 0.0;
        let entities = match settings.entities {
            EntityStyle::Hulls | EntityStyle::Auto if self.n_silhouettes > 0 => {
                Some(Program::Hull(settings.hull, samples))
            }
            EntityStyle::Billboards | EntityStyle::Hulls | EntityStyle::Auto if self.n_billboards > 0 => {
                Some(Program::Billboard(has_beside, samples))
            }
            EntityStyle::Points if self.n_runs > 0.0 => Some(Program::Points(samples)),
            _ => None,
        };
        let step_px = settings.resolution.step_px();
        let resample = (step_px.max(supersampling) > 1).then_some(Program::Resample(supersampling, step_px));
        // What more cameras see than are blended is drawn with as many as are blended.
        let blended = (0..=MAX_BLENDED_CAMERAS)
            .filter(|n| self.seen_by & (1 << n) != 0)
            .fold(0, |bits, n| bits | 1 << n.min(n_cameras));
        let Effects { has_sky, is_relit, is_occluded, is_stippled, .. } = self.effects;
        let which = [has_sky, is_relit, is_occluded, is_stippled];
        let effects = which.contains(&true).then_some(Program::Effects(which, samples));
        Variant { blended, form, others: [entities, resample, effects] }
    }

    fn first(&self, settings: &Settings) -> (usize, Blended) {
        let n_cameras = settings.most_cameras.min(MAX_BLENDED_CAMERAS).min(self.cameras.len().max(1) - 1);
        (n_cameras, self.cameras.get(n_cameras).copied().unwrap_or_default())
    }
}

/// About how many pixels of a picture a rectangle covers: of the part that shows it largest, never more than the part has.
pub(super) fn drawn_px(picture: &Picture, entity: &Entity, billboard: &Billboard) -> f64 {
    let [left, right] = billboard.left_right_m;
    let foot = entity.place_of(billboard);
    let middle = foot + DVec3::Z * (0.5 * billboard.height_m);
    let radius_m = 0.5 * (right - left).hypot(billboard.height_m);
    let of_part = |part: &super::Part| {
        if !part.view.may_show(middle, radius_m) {
            return 0.0;
        }
        let [across, down] = part.view.pixels_per_metre(middle);
        let (width, height) = (f64::from(part.view.width_px), f64::from(part.view.height_px));
        (across * (right - left).max(0.0)).min(width) * (down * billboard.height_m.max(0.0)).min(height)
    };
    picture.parts.iter().map(of_part).fold(0.0, f64::max)
}

#[cfg(test)]
impl Survey {
    /// A picture of which three quarters show surfaces, half of them seen by each of its cameras.
    pub(super) fn for_tests(size_px: (u32, u32), n_cameras: usize) -> Self {
        let first = |n| Blended { all: 0.4 * n as f64, with_depth_maps: 0.0, with_lenses: 0.0 };
        Self {
            size_px,
            n_parts: 1,
            surface_share: 0.75,
            cameras: (0..=n_cameras).map(first).collect(),
            seen_by: (1 << (n_cameras.min(MAX_BLENDED_CAMERAS) + 1)) - 1,
            n_observations: n_cameras,
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{View, ViewLimits};
    use glam::DMat2;
    use videofields_vision::segment::PixelRect;

    #[test]
    fn an_entity_of_several_cameras_is_in_view_where_it_is_drawn() {
        let source = |x: f64| Billboard {
            camera_idx: 0,
            rect: PixelRect { x: 0, y: 0, width: 9, height: 9 },
            foot_in_world: DVec3::new(x, 0.0, 0.0),
            right_in_world: DVec3::X,
            left_right_m: [-0.3, 0.3],
            height_m: 1.8,
            is_truncated: false,
            owner: 0,
            shown_share: 1.0,
        };
        let entity = |sources: Vec<Billboard>| Entity {
            id: 1,
            foot_in_world: DVec3::ZERO,
            foot_covariance_m2: DMat2::IDENTITY,
            velocity: crate::fuse::Velocity::UNKNOWN,
            reach_m: None,
            height_m: 1.8,
            sources,
        };
        let limits = ViewLimits { max_side_px: 1000, max_pixels: 1_000_000 };
        let looking = |x: f64| -> Picture {
            let (eye, target) = (DVec3::new(x, -10.0, 1.0), DVec3::new(x, 0.0, 1.0));
            View::new(eye, target, 0.3, 64, 64, &limits).expect("a view").into()
        };
        let covered = |entity: &Entity, x: f64| drawn_px(&looking(x), entity, &entity.sources[0]);
        let two = entity(vec![source(6.0), source(-6.0)]);
        assert!(covered(&two, 0.0) > 0.0 && covered(&two, 6.0) == 0.0);
        // Of one camera alone its view is all there is.
        let one = entity(vec![source(6.0)]);
        assert!(covered(&one, 0.0) == 0.0 && covered(&one, 6.0) > 0.0);
    }
}
