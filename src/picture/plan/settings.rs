//! How exactly a picture is drawn: every knob in one value, the presets, and what a caller may ask for.

use super::{
    EntityStyle, FieldsForm, HULL_VOXELS, HullForm, HullMethod, HullVisibility, MAX_BLENDED_CAMERAS,
    MAX_ENTITY_CAMERAS, MAX_SUPERSAMPLING, Sampling,
};
use crate::fuse::{HullMaking, HullMemory, LEAST_VIEWS, SceneState};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use videofields_vision::error::Fault;

/// Points are of every row of texels, of one in two or of one in four.
pub const POINT_STRIDES: [u32; 3] = [1, 2, 4];

/// Most sources by which one entity is shown.
pub const MAX_ENTITY_SOURCES: u32 = 2;

/// How cameras' backgrounds are looked up between their texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filtering {
    /// The nearest texel: jagged, and it shimmers far away.
    Nearest,
    /// Between the four nearest: it shimmers far away.
    Bilinear,
    /// Between texels, of levels of detail as fine as the pixel.
    #[default]
    Levels,
}

impl Filtering {
    /// All of them with their words, from cheap to exact.
    pub const ALL: [(&'static str, Self); 3] =
        [("nearest", Self::Nearest), ("bilinear", Self::Bilinear), ("levels", Self::Levels)];

    /// Its word in requests and answers.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Nearest => "nearest",
            Self::Bilinear => "bilinear",
            Self::Levels => "levels",
        }
    }
}

/// How many pixels of a picture are drawn, each way; the others lie between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Detail {
    /// One in four.
    Quarter,
    /// One in two.
    Half,
    /// Every one.
    #[default]
    Whole,
}

impl Detail {
    /// All of them with their words, from cheap to exact.
    pub const ALL: [(&'static str, Self); 3] =
        [("quarter", Self::Quarter), ("half", Self::Half), ("whole", Self::Whole)];

    /// Its word in requests and answers.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Quarter => "quarter",
            Self::Half => "half",
            Self::Whole => "whole",
        }
    }

    /// Pixels each way for which one is drawn.
    #[must_use]
    pub const fn step_px(self) -> u32 {
        match self {
            Self::Quarter => 4,
            Self::Half => 2,
            Self::Whole => 1,
        }
    }
}

/// Every knob of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
pub struct Settings {
    /// How moving entities are drawn.
    pub entities: EntityStyle,
    /// With points, every how manieth row of texels: one of [`POINT_STRIDES`].
    pub point_stride: u32,
    /// With billboards, by how many cameras one entity is shown: 1 to [`MAX_ENTITY_SOURCES`].
    pub sources: u32,
    /// With hulls, how they are drawn.
    pub hull: HullForm,
    /// Most cameras that are blended at a pixel: 1 to [`MAX_BLENDED_CAMERAS`].
    pub most_cameras: usize,
    /// Whether what stands before a surface keeps a camera's picture off it.
    pub depth_maps: bool,
    /// Whether what stands still is coloured by texture fields.
    pub fields: FieldsForm,
    /// How cameras' backgrounds are looked up.
    pub filtering: Filtering,
    /// How often a pixel is looked at.
    pub sampling: Sampling,
    /// How many of the pixels are drawn.
    pub resolution: Detail,
}

impl Default for Settings {
    /// [`Preset::Balanced`] with four samples a pixel.
    fn default() -> Self {
        Preset::Balanced.settings(4)
    }
}

impl Settings {
    /// Holds every knob to its range.
    ///
    /// # Errors
    /// With the parameter of the first knob that is beyond it as the fault's place.
    pub fn check(&self) -> Result<(), Fault> {
        self.sampling.check()?;
        if !POINT_STRIDES.contains(&self.point_stride) {
            return Err(Fault::new("stride", format!("must be 1, 2 or 4, got {}", self.point_stride)));
        }
        if !(1..=MAX_ENTITY_SOURCES).contains(&self.sources) {
            return Err(Fault::new("sources", format!("must be 1 or 2, got {}", self.sources)));
        }
        if !(LEAST_VIEWS as u32..=MAX_ENTITY_CAMERAS as u32).contains(&self.hull.least_cameras) {
            let message =
                format!("must be {LEAST_VIEWS} to {MAX_ENTITY_CAMERAS}, got {}", self.hull.least_cameras);
            return Err(Fault::new("hull_cameras", message));
        }
        if !HULL_VOXELS.contains(&self.hull.n_voxels) {
            return Err(Fault::new(
                "voxels",
                format!("must be 32, 64, 128 or 256, got {}", self.hull.n_voxels),
            ));
        }
        if !(1..=MAX_BLENDED_CAMERAS).contains(&self.most_cameras) {
            let message = format!("must be 1 to {MAX_BLENDED_CAMERAS}, got {}", self.most_cameras);
            return Err(Fault::new("cameras", message));
        }
        if self.resolution != Detail::Whole && self.sampling.supersampling > 1 {
            let message = "must be whole where more than one pixel is drawn for one (supersampling)";
            return Err(Fault::new("resolution", message));
        }
        Ok(())
    }

    /// Adds to `state` what is drawn with these settings and is not always there: points, or hulls.
    /// What hulls `memory` has are not made again.
    pub fn place(&self, state: &mut SceneState, memory: &mut HullMemory) {
        match self.entities {
            EntityStyle::Points => state.place_points(self.point_stride),
            EntityStyle::Hulls | EntityStyle::Auto => {
                let n_voxels = (self.hull.method == HullMethod::Voxels).then_some(self.hull.n_voxels);
                let error_px = super::hulls::OUTLINE_ERROR_PX;
                state.place_hulls(HullMaking { error_px, n_voxels }, memory);
            }
            EntityStyle::Billboards | EntityStyle::None => {}
        }
    }

    /// Every knob that means something to the style, by its parameter, with its value as the parameter has it.
    #[must_use]
    pub fn knobs(&self) -> Vec<(&'static str, String)> {
        let mut knobs = vec![
            ("resolution", self.resolution.as_str().to_owned()),
            ("samples", self.sampling.samples.to_string()),
            ("supersampling", self.sampling.supersampling.to_string()),
            ("filtering", self.filtering.as_str().to_owned()),
            ("cameras", self.most_cameras.to_string()),
            ("depth_maps", if self.depth_maps { "on" } else { "off" }.to_owned()),
            ("fields", self.fields.as_str().to_owned()),
        ];
        match self.entities {
            EntityStyle::Billboards => knobs.push(("sources", self.sources.to_string())),
            EntityStyle::Points => knobs.push(("stride", self.point_stride.to_string())),
            EntityStyle::Hulls | EntityStyle::Auto => {
                knobs.push(("sources", self.sources.to_string()));
                knobs.push(("method", self.hull.method.as_str().to_owned()));
                knobs.push(("hull_visibility", self.hull.texture.visibility.as_str().to_owned()));
                knobs.push(("hull_cameras", self.hull.least_cameras.to_string()));
                if self.hull.method == HullMethod::Voxels {
                    knobs.push(("voxels", self.hull.n_voxels.to_string()));
                }
            }
            EntityStyle::None => {}
        }
        knobs
    }

    /// What of `other` these settings leave out: knobs whose value is cheaper here, by their parameters.
    #[must_use]
    pub fn left_out(&self, other: &Self) -> Vec<&'static str> {
        let cheaper = [
            ("resolution", self.resolution < other.resolution),
            ("samples", self.sampling.samples < other.sampling.samples),
            ("supersampling", self.sampling.supersampling < other.sampling.supersampling),
            ("filtering", self.filtering < other.filtering),
            ("cameras", self.most_cameras < other.most_cameras),
            ("depth_maps", !self.depth_maps && other.depth_maps),
            ("fields", self.fields < other.fields),
            ("sources", self.entities.has_billboards() && self.sources < other.sources),
            (
                "hull_visibility",
                self.entities.has_hulls() && self.hull.texture.visibility < other.hull.texture.visibility,
            ),
            ("stride", self.entities == EntityStyle::Points && self.point_stride > other.point_stride),
        ];
        cheaper.into_iter().filter_map(|(knob, is_cheaper)| is_cheaper.then_some(knob)).collect()
    }
}

/// Named settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// For following somebody with the eyes, as cheap as is still readable: half the pixels each way, one sample each, the
    /// best three cameras looked up between their nearest texels, one camera an entity, points of every fourth row.
    /// Depth maps stay on: without them people's surroundings lie on walls that they do not belong to.
    Draft,
    /// What is drawn where nothing is asked for: every pixel, samples as the configuration has them, up to eight cameras
    /// with levels of detail, two cameras an entity.
    #[default]
    Balanced,
    /// All there is, for stills and evidence: as balanced, with four samples of each of four pixels drawn for one.
    Exact,
}

impl Preset {
    /// All of them with their words.
    pub const ALL: [(&'static str, Self); 3] =
        [("draft", Self::Draft), ("balanced", Self::Balanced), ("exact", Self::Exact)];

    /// Its word in requests and answers.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Balanced => "balanced",
            Self::Exact => "exact",
        }
    }

    /// Its settings, where the configuration has so many `samples` a pixel (1 or 4).
    #[must_use]
    pub const fn settings(self, samples: u32) -> Settings {
        let balanced = Settings {
            entities: EntityStyle::Billboards,
            point_stride: 1,
            sources: MAX_ENTITY_SOURCES,
            hull: HullForm::EXACT,
            most_cameras: MAX_BLENDED_CAMERAS,
            depth_maps: true,
            fields: FieldsForm::Off,
            filtering: Filtering::Levels,
            sampling: Sampling { samples, supersampling: 1 },
            resolution: Detail::Whole,
        };
        match self {
            Self::Draft => Settings {
                point_stride: 4,
                sources: 1,
                hull: HullForm::CHEAP,
                most_cameras: 3,
                filtering: Filtering::Bilinear,
                sampling: Sampling::ONCE,
                resolution: Detail::Half,
                ..balanced
            },
            Self::Balanced => balanced,
            Self::Exact => Settings { sampling: Sampling { samples: 4, supersampling: 2 }, ..balanced },
        }
    }
}

/// Knobs that a caller names; what is not named is the preset's, or chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Named {
    /// See [`Settings::point_stride`].
    pub point_stride: Option<u32>,
    /// See [`Settings::sources`].
    pub sources: Option<u32>,
    /// See [`HullForm::method`].
    pub hull_method: Option<HullMethod>,
    /// See [`HullForm::least_cameras`].
    pub hull_cameras: Option<u32>,
    /// See [`HullForm::n_voxels`].
    pub hull_voxels: Option<u32>,
    /// See [`super::HullTexture::visibility`].
    pub hull_visibility: Option<HullVisibility>,
    /// See [`Settings::most_cameras`].
    pub most_cameras: Option<usize>,
    /// See [`Settings::depth_maps`].
    pub depth_maps: Option<bool>,
    /// See [`Settings::fields`].
    pub fields: Option<FieldsForm>,
    /// See [`Settings::filtering`].
    pub filtering: Option<Filtering>,
    /// See [`Sampling::samples`].
    pub samples: Option<u32>,
    /// See [`Sampling::supersampling`].
    pub supersampling: Option<u32>,
    /// See [`Settings::resolution`].
    pub resolution: Option<Detail>,
}

impl Named {
    fn hull_over(&self, hull: HullForm) -> HullForm {
        let visibility = self.hull_visibility.unwrap_or(hull.texture.visibility);
        HullForm {
            method: self.hull_method.unwrap_or(hull.method),
            n_voxels: self.hull_voxels.unwrap_or(hull.n_voxels),
            least_cameras: self.hull_cameras.unwrap_or(hull.least_cameras),
            texture: super::HullTexture { visibility, ..hull.texture },
        }
    }

    /// `settings` with what is named here in their place.
    #[must_use]
    pub fn over(&self, settings: Settings) -> Settings {
        Settings {
            entities: settings.entities,
            point_stride: self.point_stride.unwrap_or(settings.point_stride),
            sources: self.sources.unwrap_or(settings.sources),
            hull: self.hull_over(settings.hull),
            most_cameras: self.most_cameras.unwrap_or(settings.most_cameras),
            depth_maps: self.depth_maps.unwrap_or(settings.depth_maps),
            fields: self.fields.unwrap_or(settings.fields),
            filtering: self.filtering.unwrap_or(settings.filtering),
            sampling: Sampling {
                samples: self.samples.unwrap_or(settings.sampling.samples),
                supersampling: self.supersampling.unwrap_or(settings.sampling.supersampling),
            },
            resolution: self.resolution.unwrap_or(settings.resolution),
        }
    }
}

/// A time for a picture, from its request on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Deadline {
    /// All of it.
    pub total: Duration,
    /// What of it goes after the drawing, such as for encoding.
    pub reserve: Duration,
}

/// What is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// The settings of a preset.
    Preset(Preset),
    /// The least error that is there in time.
    Within(Deadline),
}

impl Default for Aim {
    fn default() -> Self {
        Self::Preset(Preset::default())
    }
}

/// How exactly, or how soon, a caller wants a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Effort {
    /// What is aimed at.
    pub aim: Aim,
    /// What is not left to it.
    pub named: Named,
}

impl Effort {
    /// The deadline, if there is one.
    #[must_use]
    pub const fn deadline(&self) -> Option<Deadline> {
        match self.aim {
            Aim::Within(deadline) => Some(deadline),
            Aim::Preset(_) => None,
        }
    }

    /// The settings that this means; with a deadline, the most exact that may be chosen. `samples` as the configuration
    /// has them.
    ///
    /// # Errors
    /// As [`Settings::check`].
    pub fn settings(&self, entities: EntityStyle, samples: u32) -> Result<Settings, Fault> {
        let preset = match self.aim {
            Aim::Preset(preset) => preset,
            Aim::Within(_) => Preset::Exact,
        };
        let mut named = self.named;
        // What both are named for cannot be; what is named for one rules the other of a preset or a choice out.
        if named.resolution.is_some_and(|resolution| resolution != Detail::Whole) {
            named.supersampling = named.supersampling.or(Some(1));
        }
        if named.supersampling.is_some_and(|times| times > 1) {
            named.resolution = named.resolution.or(Some(Detail::Whole));
        }
        let settings = Settings { entities, ..named.over(preset.settings(samples)) };
        settings.check()?;
        Ok(settings)
    }
}

/// Every value of every knob that a deadline may choose among, from cheap to exact, but what `named` fixes: at most some
/// hundreds.
#[must_use]
pub fn candidates(entities: EntityStyle, named: &Named) -> Vec<Settings> {
    if entities != EntityStyle::Auto {
        return candidates_of(entities, named);
    }
    let styles = [EntityStyle::Auto, EntityStyle::Billboards, EntityStyle::Points];
    styles.into_iter().flat_map(|style| candidates_of(style, named)).collect()
}

fn candidates_of(entities: EntityStyle, named: &Named) -> Vec<Settings> {
    fn values<T: Copy>(named: Option<T>, all: &[T]) -> Vec<T> {
        named.map_or_else(|| all.to_vec(), |value| vec![value])
    }
    let is_of = |is_so: bool, of: &[u32]| if is_so { of.to_vec() } else { vec![of[of.len() - 1]] };
    let strides = values(named.point_stride, &is_of(entities == EntityStyle::Points, &[4, 2, 1]));
    let sources = values(named.sources, &is_of(entities.has_billboards(), &[1, MAX_ENTITY_SOURCES]));
    let forms: Vec<(u32, u32)> =
        strides.iter().flat_map(|stride| sources.iter().map(|sources| (*stride, *sources))).collect();
    // What is shown by one source at most is shown as cheaply as a hull.
    let hull = |sources: u32| {
        let form = if sources < MAX_ENTITY_SOURCES { HullForm::CHEAP } else { HullForm::EXACT };
        named.hull_over(form)
    };
    let most = values(named.most_cameras, &[1, 2, 3, 4, 6, MAX_BLENDED_CAMERAS]);
    let depth_maps = values(named.depth_maps, &[false, true]);
    let filtering = values(named.filtering, &Filtering::ALL.map(|(_, filtering)| filtering));
    let mut lookups = Vec::new();
    for most_cameras in most {
        for depth_maps in &depth_maps {
            lookups.extend(filtering.iter().map(|filtering| (most_cameras, *depth_maps, *filtering)));
        }
    }
    let mut all = Vec::new();
    for (sampling, resolution) in densities(named) {
        for (point_stride, sources) in &forms {
            all.extend(lookups.iter().map(|(most_cameras, depth_maps, filtering)| Settings {
                entities,
                point_stride: *point_stride,
                sources: *sources,
                hull: hull(*sources),
                most_cameras: *most_cameras,
                depth_maps: *depth_maps,
                // Nothing that a deadline may choose: it takes a scene some time to be made ready for.
                fields: named.fields.unwrap_or_default(),
                filtering: *filtering,
                sampling,
                resolution,
            }));
        }
    }
    all.retain(|settings| settings.check().is_ok());
    all
}

/// How many pixels and samples a deadline may choose among.
fn densities(named: &Named) -> Vec<(Sampling, Detail)> {
    let once = |samples| Sampling { samples, supersampling: 1 };
    let all = [
        (once(1), Detail::Quarter),
        (once(1), Detail::Half),
        (once(4), Detail::Half),
        (once(1), Detail::Whole),
        (once(4), Detail::Whole),
        (Sampling { samples: 4, supersampling: 2 }, Detail::Whole),
    ];
    let mut found: Vec<(Sampling, Detail)> = Vec::new();
    for (sampling, resolution) in all {
        let wanted = (
            Sampling {
                samples: named.samples.unwrap_or(sampling.samples),
                supersampling: named.supersampling.unwrap_or(sampling.supersampling).min(MAX_SUPERSAMPLING),
            },
            named.resolution.unwrap_or(resolution),
        );
        if !found.contains(&wanted) {
            found.push(wanted);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_named_overrides_the_preset() {
        let effort = |preset, named| Effort { aim: Aim::Preset(preset), named };
        let samples = Named { samples: Some(4), ..Named::default() };
        let settings = effort(Preset::Draft, samples).settings(EntityStyle::Points, 1).unwrap();
        assert_eq!(settings.sampling, Sampling { samples: 4, supersampling: 1 });
        assert_eq!((settings.resolution, settings.point_stride), (Detail::Half, 4));
        assert_eq!(settings.entities, EntityStyle::Points);
        // What a preset has is given up for what is named against it; both named is a fault.
        let half = Named { resolution: Some(Detail::Half), ..Named::default() };
        let settings = effort(Preset::Exact, half).settings(EntityStyle::None, 4).unwrap();
        assert_eq!(settings.sampling.supersampling, 1);
        let finer = Named { supersampling: Some(3), ..Named::default() };
        let settings = effort(Preset::Draft, finer).settings(EntityStyle::None, 4).unwrap();
        assert_eq!(settings.resolution, Detail::Whole);
        let both = Named { resolution: Some(Detail::Half), supersampling: Some(2), ..Named::default() };
        let fault = effort(Preset::Draft, both).settings(EntityStyle::None, 4).unwrap_err();
        assert_eq!(fault.place, "resolution");
    }

    #[test]
    fn every_preset_is_within_range_and_each_leaves_out_less_than_the_one_before() {
        for samples in [1, 4] {
            let [draft, balanced, exact] = Preset::ALL.map(|(_, preset)| preset.settings(samples));
            for settings in [draft, balanced, exact] {
                settings.check().unwrap();
                assert!(settings.left_out(&settings).is_empty());
            }
            assert!(draft.left_out(&balanced).contains(&"resolution"));
            assert!(balanced.left_out(&exact).contains(&"supersampling"));
            assert!(balanced.left_out(&draft).is_empty() && exact.left_out(&balanced).is_empty());
        }
        assert_eq!(Settings::default(), Preset::Balanced.settings(4));
    }

    #[test]
    fn a_knob_beyond_its_range_is_a_fault_at_its_parameter() {
        let check = |settings: Settings, place: &str| {
            assert_eq!(settings.check().unwrap_err().place, place, "{settings:?}");
        };
        let good = Settings::default();
        check(Settings { most_cameras: 0, ..good }, "cameras");
        check(Settings { most_cameras: MAX_BLENDED_CAMERAS + 1, ..good }, "cameras");
        check(Settings { sources: 0, ..good }, "sources");
        check(Settings { sources: 3, ..good }, "sources");
        check(Settings { point_stride: 0, ..good }, "stride");
        check(Settings { point_stride: 3, ..good }, "stride");
        check(Settings { sampling: Sampling { samples: 2, supersampling: 1 }, ..good }, "samples");
    }

    #[test]
    fn candidates_hold_to_what_is_named_and_are_few() {
        for style in [EntityStyle::Billboards, EntityStyle::Points, EntityStyle::None] {
            let all = candidates(style, &Named::default());
            assert!((200..=700).contains(&all.len()), "{style:?}: {}", all.len());
            assert!(all.iter().all(|settings| settings.entities == style && settings.check().is_ok()));
            assert!(all.contains(&Settings { entities: style, ..Preset::Exact.settings(4) }));
        }
        let named = Named {
            samples: Some(4),
            resolution: Some(Detail::Quarter),
            most_cameras: Some(5),
            depth_maps: Some(true),
            filtering: Some(Filtering::Nearest),
            sources: Some(1),
            ..Named::default()
        };
        let found = candidates(EntityStyle::Billboards, &named);
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!(found[0], named.over(found[0]));
    }
}
