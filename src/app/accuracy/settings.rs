//! What can be set of each stage, and how a setting is called.

use videofields_picture::occupancy::Effort;
use videofields_picture::plan::{
    Detail, EntityStyle, FieldsForm, Filtering, HullForm, HullVisibility, MAX_BLENDED_CAMERAS,
    MAX_ENTITY_SOURCES, Sampling, Settings,
};
use videofields_vision::config::{CameraSettings, RenderSettings, Resolution};
use videofields_vision::mapping::{Builder, GridSettings};

/// Steps of the map's grid, metres, from coarse to fine.
const GRID_STEPS_M: [f64; 7] = [1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01];

/// A blur that real footage with its noise is given, pixels: the default of `segment.blur_sigma_px` in large pictures.
const WIDE_BLUR_PX: f64 = 1.5;

/// How foreground is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentationForm {
    /// At which size of the picture.
    pub resolution: Resolution,
    /// Modes a pixel.
    pub modes: usize,
    /// Standard deviation of the blur, full-size pixels.
    pub blur_sigma_px: f64,
}

impl SegmentationForm {
    /// As a camera's own settings have it for pictures of `size_px`.
    #[must_use]
    pub fn of(camera: &CameraSettings, size_px: (u32, u32)) -> Self {
        Self {
            resolution: camera.segment.resolution.chosen_in(size_px),
            modes: camera.background.modes,
            blur_sigma_px: camera.segment.blur_sigma_px_in(size_px),
        }
    }

    /// The camera's settings with this form.
    #[must_use]
    pub fn applied(&self, camera: &CameraSettings) -> CameraSettings {
        let mut camera = camera.clone();
        camera.segment.resolution = self.resolution;
        camera.segment.blur_sigma_px = Some(self.blur_sigma_px);
        camera.background.modes = self.modes;
        camera
    }

    /// One knob after the other around `self`: the knob's name, its value's name, and the form.
    #[must_use]
    pub fn sweep(&self) -> Vec<(&'static str, String, Self)> {
        let resolutions = [Resolution::Quarter, Resolution::Half, Resolution::Full];
        let of_resolution = resolutions
            .map(|resolution| ("resolution", resolution.as_str().to_owned(), Self { resolution, ..*self }));
        let mut modes = vec![1, 3, 5];
        include(&mut modes, self.modes);
        let of_modes = modes.into_iter().map(|modes| ("modes", modes.to_string(), Self { modes, ..*self }));
        let mut blurs = vec![0.0, WIDE_BLUR_PX];
        include(&mut blurs, self.blur_sigma_px);
        let of_blur = blurs
            .into_iter()
            .map(|blur_sigma_px| ("blur", format!("{blur_sigma_px} px"), Self { blur_sigma_px, ..*self }));
        of_resolution.into_iter().chain(of_modes).chain(of_blur).collect()
    }

    /// The whole form in words.
    #[must_use]
    pub fn label(&self) -> String {
        format!("{} resolution, K {}, blur {} px", self.resolution.as_str(), self.modes, self.blur_sigma_px)
    }
}

/// Adds a value to a sorted list that lacks it.
fn include<T: PartialOrd + Copy>(list: &mut Vec<T>, value: T) {
    if !list.contains(&value) {
        let place = list.iter().position(|other| *other > value).unwrap_or(list.len());
        list.insert(place, value);
    }
}

/// The map's builders, cheap to exact, with the knob's value; the last is what the daemon uses.
#[must_use]
pub fn map_forms() -> Vec<(String, Builder)> {
    let grid = |step_m: &f64| (format!("grid {step_m} m"), Builder::Grid(GridSettings { step_m: *step_m }));
    GRID_STEPS_M.iter().map(grid).chain([("ray".to_owned(), Builder::Ray)]).collect()
}

/// Returns efforts with which people are looked for, one knob after the other around the default: the knob's name, its value's name, and
/// the effort.
#[must_use]
pub fn placing_efforts() -> Vec<(&'static str, String, Effort)> {
    let default = Effort::default();
    let columns = [160, 240, 320, 640].map(|most_columns| Effort { most_columns, ..default });
    let sweeps = [1, 2, 3].map(|n_sweeps| Effort { n_sweeps, ..default });
    let cells = [0.15, 0.25, 0.5].map(|cell_m| Effort { cell_m, ..default });
    let columns = columns.into_iter().map(|of| ("columns of masks", of.most_columns.to_string(), of));
    let sweeps = sweeps.into_iter().map(|of| ("sweeps", of.n_sweeps.to_string(), of));
    let cells = cells.into_iter().map(|of| ("cells", format!("{} m", of.cell_m), of));
    columns.chain(sweeps).chain(cells).collect()
}

/// How surfaces are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceForm {
    /// How often a pixel is looked at.
    pub sampling: Sampling,
    /// How many of the pixels are drawn.
    pub resolution: Detail,
    /// Texels each way of the cameras' depth maps; `None` draws without them.
    pub depth_map_side_px: Option<u32>,
    /// Most cameras that are blended at a pixel.
    pub most_cameras: usize,
    /// How cameras' backgrounds are looked up.
    pub filtering: Filtering,
}

impl SurfaceForm {
    /// As the settings have it.
    #[must_use]
    pub const fn of(settings: &RenderSettings) -> Self {
        Self {
            sampling: Sampling { samples: settings.samples, supersampling: 1 },
            resolution: Detail::Whole,
            depth_map_side_px: Some(settings.depth_map_side_px),
            most_cameras: MAX_BLENDED_CAMERAS,
            filtering: Filtering::Levels,
        }
    }

    /// One knob after the other around `self`, where at most `n_cameras` can be blended.
    #[must_use]
    pub fn sweep(&self, n_cameras: usize) -> Vec<(&'static str, String, Self)> {
        let once = |samples| Sampling { samples, supersampling: 1 };
        let of_samples =
            [1, 4].map(|samples| ("samples", samples.to_string(), Self { sampling: once(samples), ..*self }));
        let of_supersampling = [1, 2].map(|supersampling| {
            let sampling = Sampling { supersampling, ..self.sampling };
            ("supersampling", supersampling.to_string(), Self { sampling, ..*self })
        });
        let of_resolution = Detail::ALL
            .map(|(name, resolution)| ("resolution", name.to_owned(), Self { resolution, ..*self }));
        let sides = [None, Some(512), Some(1024), Some(2048)];
        let name = |side: Option<u32>| side.map_or_else(|| "off".to_owned(), |side| format!("{side} px"));
        let of_depth_maps = sides.map(|depth_map_side_px| {
            ("depth maps", name(depth_map_side_px), Self { depth_map_side_px, ..*self })
        });
        let of_filtering = Filtering::ALL
            .map(|(name, filtering)| ("filtering", name.to_owned(), Self { filtering, ..*self }));
        let most = [1, 2, 3, 4, 6].into_iter().filter(|most| *most < n_cameras).chain([self.most_cameras]);
        let of_cameras =
            most.map(|most_cameras| ("cameras", most_cameras.to_string(), Self { most_cameras, ..*self }));
        let mut sweep: Vec<_> = of_samples.into_iter().chain(of_depth_maps).chain(of_supersampling).collect();
        sweep.extend(of_resolution.into_iter().chain(of_filtering).chain(of_cameras));
        sweep
    }

    /// The picture's settings with this form, with entities of `form`.
    #[must_use]
    pub const fn with(&self, form: EntityForm) -> Settings {
        Settings {
            entities: form.style,
            point_stride: form.stride,
            sources: form.sources,
            hull: form.hull,
            most_cameras: self.most_cameras,
            depth_maps: self.depth_map_side_px.is_some(),
            fields: FieldsForm::Off,
            filtering: self.filtering,
            sampling: self.sampling,
            resolution: self.resolution,
        }
    }

    /// The renderer's settings with this form.
    #[must_use]
    pub fn applied(&self, settings: &RenderSettings) -> RenderSettings {
        RenderSettings {
            samples: self.sampling.samples,
            depth_map_side_px: self.depth_map_side_px.unwrap_or(settings.depth_map_side_px),
            ..settings.clone()
        }
    }
}

/// How entities are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntityForm {
    /// In which style.
    pub style: EntityStyle,
    /// With points, every how manieth texel each way.
    pub stride: u32,
    /// With billboards, by how many cameras one entity is shown.
    pub sources: u32,
    /// With hulls, how they are drawn.
    pub hull: HullForm,
}

impl EntityForm {
    /// What is drawn where nothing else is asked for.
    pub const DEFAULT: Self = Self {
        style: EntityStyle::Billboards,
        stride: 1,
        sources: MAX_ENTITY_SOURCES,
        hull: HullForm::EXACT,
    };

    /// Nothing is drawn: what the others are held against.
    pub const NOTHING: Self = Self { style: EntityStyle::None, ..Self::DEFAULT };

    /// All forms from cheap to exact, after nothing.
    pub const ALL: [Self; 8] = [
        Self::NOTHING,
        Self { style: EntityStyle::Points, stride: 4, ..Self::DEFAULT },
        Self { style: EntityStyle::Points, stride: 2, ..Self::DEFAULT },
        Self { style: EntityStyle::Points, stride: 1, ..Self::DEFAULT },
        Self { sources: 1, ..Self::DEFAULT },
        Self::DEFAULT,
        Self { style: EntityStyle::Hulls, hull: HullForm::CHEAP, ..Self::DEFAULT },
        Self { style: EntityStyle::Hulls, ..Self::DEFAULT },
    ];

    /// The form in words.
    #[must_use]
    pub fn label(&self) -> String {
        match self.style {
            EntityStyle::None => "none".to_owned(),
            EntityStyle::Billboards if self.sources == 1 => "billboards, one source".to_owned(),
            EntityStyle::Billboards => "billboards".to_owned(),
            EntityStyle::Points => format!("points, stride {}", self.stride),
            EntityStyle::Hulls if self.hull.texture.visibility == HullVisibility::Off => {
                "hulls, visible or not".to_owned()
            }
            EntityStyle::Hulls => "hulls".to_owned(),
            EntityStyle::Auto => "auto".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_sets_one_knob_and_holds_the_default_once_a_knob() {
        let form = SegmentationForm { resolution: Resolution::Full, modes: 3, blur_sigma_px: 0.6 };
        let sweep = form.sweep();
        let values = |knob: &str| -> Vec<&str> {
            sweep.iter().filter(|(of, ..)| *of == knob).map(|(_, value, _)| value.as_str()).collect()
        };
        assert_eq!(values("resolution"), ["quarter", "half", "full"]);
        assert_eq!(values("modes"), ["1", "3", "5"]);
        assert_eq!(values("blur"), ["0 px", "0.6 px", "1.5 px"]);
        for knob in ["resolution", "modes", "blur"] {
            assert_eq!(
                sweep.iter().filter(|(of, _, found)| *of == knob && *found == form).count(),
                1,
                "{knob}"
            );
        }
        let efforts = placing_efforts();
        for knob in ["columns of masks", "sweeps", "cells"] {
            let of_knob = || efforts.iter().filter(|(of, ..)| *of == knob);
            assert_eq!(of_knob().filter(|(.., effort)| *effort == Effort::default()).count(), 1, "{knob}");
            assert!(of_knob().count() > 2, "{knob}");
        }
        let odd = SegmentationForm { modes: 2, blur_sigma_px: 0.0, ..form };
        assert_eq!(odd.sweep().iter().filter(|(of, ..)| *of == "modes").count(), 4);
        assert_eq!(odd.sweep().iter().filter(|(of, ..)| *of == "blur").count(), 2);
    }
}
