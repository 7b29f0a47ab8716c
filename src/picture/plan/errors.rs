//! Which error settings are expected to leave: by the table of measured costs, and before there is one an order alone.
//!
//! A table's rows change one knob at a time. Errors of knobs are taken to be independent, so their squares add up: the square
//! of a setting's error is the default's, and for every knob what its value adds to it or takes from it.

use super::{CostRow, CostTable, Detail, EntityStyle, Filtering, HullVisibility, Sampling, Settings};

/// Squares of errors, 8-bit codes squared: of the still part of pictures, and at people.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Squares {
    still: f64,
    people: f64,
}

/// What a camera that sees through a wall paints, or one too few leaves out, is rare and large, and the few views of a table
/// may show none of it: such a step is never less than this share of what is assumed without a table.
const RARE_SHARE: f64 = 0.05;

/// What a knob's values change: value, and how much it adds to the square.
type Steps = Vec<(u32, f64)>;

/// The errors of settings. See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct Errors {
    is_measured: bool,
    default: Squares,
    resolution: Steps,
    samples: Steps,
    supersampling: Steps,
    filtering: Steps,
    cameras: Steps,
    depth_maps: Steps,
    sources: Steps,
    strides: Steps,
    /// Of hulls beyond billboards, whether visibility is looked at or not.
    hulls: Steps,
}

impl Default for Errors {
    /// No table: what is taken for cheaper leaves more, by about what it left on the plaza. An order, and no error.
    fn default() -> Self {
        Self {
            is_measured: false,
            default: Squares { still: 50.0, people: 1200.0 },
            resolution: vec![(4, 300.0), (2, 90.0), (1, 0.0)],
            samples: vec![(1, 12.0), (4, 0.0)],
            supersampling: vec![(1, 0.0), (2, -6.0)],
            filtering: vec![(0, 20.0), (1, 8.0), (2, 0.0)],
            cameras: vec![(1, 400.0), (2, 120.0), (3, 40.0), (4, 15.0), (6, 5.0), (8, 0.0)],
            depth_maps: vec![(0, 150.0), (1, 0.0)],
            sources: vec![(1, 30.0), (2, 0.0)],
            strides: vec![(4, 700.0), (2, 200.0), (1, 0.0)],
            hulls: vec![(0, 5.0), (1, 0.0)],
        }
    }
}

const fn filtering_number(filtering: Filtering) -> u32 {
    match filtering {
        Filtering::Nearest => 0,
        Filtering::Bilinear => 1,
        Filtering::Levels => 2,
    }
}

impl Errors {
    /// What a table says; `None` where it lacks the default settings' errors or any row of a knob that it may say nothing of.
    #[must_use]
    pub fn of(table: &CostTable) -> Option<Self> {
        let rows_of = |stage: &'static str, knob: &'static str| {
            table.rows.iter().filter(move |row| row.stage == stage && row.knob == knob)
        };
        let square = |row: &CostRow| row.error.filter(|error| error.is_finite()).map(|error| error * error);
        let default_of = |stage, knob| rows_of(stage, knob).find(|row| row.is_default).and_then(square);
        let steps = |knob, value: &dyn Fn(&str) -> Option<u32>| {
            let default = default_of("surfaces", knob)?;
            let step = |row: &CostRow| Some((value(&row.value)?, square(row)? - default));
            let steps: Steps = rows_of("surfaces", knob).filter_map(step).collect();
            (steps.len() > 1).then_some(steps)
        };
        let number = |text: &str| text.parse().ok();
        let detail = |text: &str| {
            Detail::ALL.iter().find(|(word, _)| *word == text).map(|(_, detail)| detail.step_px())
        };
        let filtering = |text: &str| {
            Filtering::ALL.iter().find(|(word, _)| *word == text).map(|(_, of)| filtering_number(*of))
        };
        // Of several sides the least error is the map's.
        let is_on = |text: &str| Some(u32::from(text != "off"));
        let mut depth_maps = steps("depth maps", &is_on)?;
        depth_maps.retain(|(value, _)| *value == 0);
        depth_maps.push((1, 0.0));
        hold_to(&Self::default().depth_maps, &mut depth_maps);
        // One camera alone leaves nothing to choose.
        let mut cameras = steps("cameras", &number).unwrap_or_default();
        hold_to(&Self::default().cameras, &mut cameras);
        let people = default_of("entities", "style")?;
        let styles = |named: &[(&str, u32)], zero: &str| {
            let of =
                |value: &str| rows_of("entities", "style").find(|row| row.value == value).and_then(square);
            let zero = of(zero)?;
            named.iter().map(|(value, number)| Some((*number, of(value)? - zero))).collect::<Option<Steps>>()
        };
        Some(Self {
            is_measured: true,
            default: Squares { still: default_of("surfaces", "resolution")?, people },
            resolution: steps("resolution", &detail)?,
            samples: steps("samples", &number)?,
            supersampling: steps("supersampling", &number)?,
            filtering: steps("filtering", &filtering)?,
            cameras,
            depth_maps,
            sources: styles(&[("billboards, one source", 1), ("billboards", 2)], "billboards")?,
            strides: styles(
                &[("points, stride 4", 4), ("points, stride 2", 2), ("points, stride 1", 1)],
                "points, stride 1",
            )?,
            // Tables from before there were hulls say nothing of them.
            hulls: styles(&[("hulls, visible or not", 0), ("hulls", 1)], "billboards")
                .unwrap_or_else(|| Self::default().hulls),
        })
    }

    /// Whether these are errors, and not an order alone.
    #[must_use]
    pub const fn is_measured(&self) -> bool {
        self.is_measured
    }

    /// The error that settings are expected to leave: root mean square of 8-bit codes, the mean of that of what stands still and
    /// that at people; without people, of what stands still.
    #[must_use]
    pub fn expected(&self, settings: &Settings) -> f64 {
        let Sampling { samples, supersampling } = settings.sampling;
        let pixels = at(&self.resolution, settings.resolution.step_px())
            + at(&self.samples, samples)
            + at(&self.supersampling, supersampling);
        let still = self.default.still
            + pixels
            + at(&self.filtering, filtering_number(settings.filtering))
            + at(&self.cameras, u32::try_from(settings.most_cameras).unwrap_or(u32::MAX))
            + at(&self.depth_maps, u32::from(settings.depth_maps));
        let entities = match settings.entities {
            EntityStyle::None => return still.max(0.0).sqrt(),
            EntityStyle::Billboards => at(&self.sources, settings.sources),
            EntityStyle::Hulls => self.hulls(settings),
            // Each is a hull where that is truer.
            EntityStyle::Auto => self.hulls(settings).min(at(&self.sources, settings.sources)),
            EntityStyle::Points => at(&self.strides, settings.point_stride),
        };
        let people = self.default.people + pixels + entities;
        0.5 * (still.max(0.0).sqrt() + people.max(0.0).sqrt())
    }
}

impl Errors {
    /// What hulls add beyond billboards.
    fn hulls(&self, settings: &Settings) -> f64 {
        at(&self.hulls, u32::from(settings.hull.texture.visibility != HullVisibility::Off))
    }
}

/// Holds what each value adds beyond the greatest one to at least [`RARE_SHARE`] of what it does in `assumed`.
fn hold_to(assumed: &Steps, steps: &mut Steps) {
    let Some((greatest, least)) = steps.iter().max_by_key(|(value, _)| *value).copied() else { return };
    for (value, square) in steps {
        *square = square.max(least + RARE_SHARE * (at(assumed, *value) - at(assumed, greatest)));
    }
}

/// What a value adds: that of the greatest known one up to it, else of the least known.
fn at(steps: &[(u32, f64)], value: u32) -> f64 {
    let below = steps.iter().filter(|(known, _)| *known <= value).max_by_key(|(known, _)| *known);
    let least = || steps.iter().min_by_key(|(known, _)| *known);
    below.or_else(least).map_or(0.0, |(_, square)| *square)
}
