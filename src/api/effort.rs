//! How exactly a picture is asked for: a preset, a deadline, and every knob by itself.

use super::parameters::{Parameter, words};
use super::query::Query;
use std::ops::RangeInclusive;
use std::time::Duration;
use videofields_picture::fuse::LEAST_VIEWS;
use videofields_picture::plan::{
    Aim, Deadline, Detail, Effort, EntityStyle, FieldsForm, Filtering, HullMethod, HullVisibility,
    MAX_BLENDED_CAMERAS, MAX_ENTITY_CAMERAS, MAX_SUPERSAMPLING, Named, Preset,
};

/// The parameters that are read here.
pub(super) const PARAMETERS: [Parameter; 15] = [
    Parameter::word("quality", || words(&Preset::ALL), "How exactly it is drawn: sets every knob")
        .default_is("balanced"),
    Parameter::number(
        "deadline_ms",
        &DEADLINE_MS,
        "Draws as exactly as is possible in this time, milliseconds; not beside `quality`",
    ),
    Parameter::word("resolution", || words(&Detail::ALL), "How many of the pixels are drawn each way"),
    Parameter::word("samples", || vec!["1", "4"], "Samples a pixel"),
    Parameter::whole(
        "supersampling",
        &(1..=MAX_SUPERSAMPLING as u64),
        "Pixels each way that are drawn for one",
    ),
    Parameter::word("filtering", || words(&Filtering::ALL), "How cameras' backgrounds are looked up"),
    Parameter::whole(
        "cameras",
        &(1..=MAX_BLENDED_CAMERAS as u64),
        "Most cameras whose backgrounds are blended",
    ),
    Parameter::word(
        "depth_maps",
        || vec!["on", "off"],
        "Whether what stands before a surface keeps a camera's picture off it",
    ),
    Parameter::word(
        "fields",
        || words(&FieldsForm::ALL),
        "Whether what stands still, and hulls as meshes, are coloured by texture fields: by who looks squarely, or by whose colours are least beside, smoothly",
    ),
    Parameter::word(
        "sources",
        || vec!["1", "2"],
        "By how many cameras one entity is shown; of `entities=billboards`, and of `hulls` for whom one camera sees",
    ),
    Parameter::word(
        "method",
        || HullMethod::ALL.iter().map(|(word, _)| *word).collect(),
        "How hulls' surfaces are found; of `entities=hulls`",
    ),
    Parameter::word(
        "voxels",
        || vec!["32", "64", "128", "256"],
        "Voxels along the longest side of a hull; of `method=voxels`",
    ),
    Parameter::whole(
        "hull_cameras",
        &(LEAST_VIEWS as u64..=MAX_ENTITY_CAMERAS as u64),
        "Cameras that must see somebody for a hull; of `entities=hulls`",
    ),
    Parameter::word(
        "hull_visibility",
        || HullVisibility::ALL.iter().map(|(word, _)| *word).collect(),
        "How cameras are found before whom something else of the hulls stands: they lend no colour; of `entities=hulls`",
    ),
    Parameter::word(
        "stride",
        || vec!["1", "2", "4"],
        "Every how manieth row of texels becomes points; of `entities=points`",
    ),
];

/// Time to a picture, milliseconds; none is waited for longer than ten seconds.
const DEADLINE_MS: RangeInclusive<f64> = 1.0..=10_000.0;

/// Reads them, for entities of `style`; what means nothing to it is a fault.
pub(super) fn read(query: &mut Query, style: EntityStyle) -> Effort {
    if query.has("quality") {
        query.refuse("deadline_ms", "cannot be asked for together with quality");
    }
    let styles = [
        ("sources", style.has_billboards(), "entities=billboards, entities=hulls and entities=auto"),
        ("stride", style == EntityStyle::Points, "entities=points"),
        ("method", style.has_hulls(), "entities=hulls and entities=auto"),
        ("hull_cameras", style.has_hulls(), "entities=hulls and entities=auto"),
        ("voxels", style.has_hulls(), "entities=hulls and entities=auto"),
        ("hull_visibility", style.has_hulls(), "entities=hulls and entities=auto"),
    ];
    for (parameter, is_meant, named) in styles {
        if !is_meant {
            query.refuse(parameter, &format!("means something to {named} alone"));
        }
    }
    let deadline = query.number("deadline_ms", &DEADLINE_MS, " ms");
    let preset = query.choice("quality", &Preset::ALL).unwrap_or_default();
    let total = deadline.and_then(|ms| Duration::try_from_secs_f64(ms * 1e-3).ok());
    let aim = total.map(|total| Aim::Within(Deadline { total, reserve: Duration::ZERO }));
    let most = u32::try_from(MAX_BLENDED_CAMERAS).unwrap_or(u32::MAX);
    Effort {
        aim: aim.unwrap_or(Aim::Preset(preset)),
        named: Named {
            point_stride: query.choice("stride", &[("1", 1), ("2", 2), ("4", 4)]),
            sources: query.choice("sources", &[("1", 1), ("2", 2)]),
            hull_method: query.choice("method", &HullMethod::ALL),
            hull_cameras: query.whole("hull_cameras", &(LEAST_VIEWS as u32..=MAX_ENTITY_CAMERAS as u32)),
            hull_voxels: query.choice("voxels", &[("32", 32), ("64", 64), ("128", 128), ("256", 256)]),
            hull_visibility: query.choice("hull_visibility", &HullVisibility::ALL),
            most_cameras: query.whole("cameras", &(1..=most)).map(|cameras| cameras as usize),
            depth_maps: query.choice("depth_maps", &[("on", true), ("off", false)]),
            fields: query.choice("fields", &FieldsForm::ALL),
            filtering: query.choice("filtering", &Filtering::ALL),
            samples: query.choice("samples", &[("1", 1), ("4", 4)]),
            supersampling: query.whole("supersampling", &(1..=MAX_SUPERSAMPLING)),
            resolution: query.choice("resolution", &Detail::ALL),
        },
    }
}
