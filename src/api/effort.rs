//! How exactly a picture is asked for: a preset, a deadline, and every knob by itself.

use super::query::Query;
use crate::plan::{
    Aim, Deadline, Detail, Effort, EntityStyle, Filtering, MAX_BLENDED_CAMERAS, MAX_SUPERSAMPLING, Named,
    Preset,
};
use std::ops::RangeInclusive;
use std::time::Duration;

/// The parameters that are read here.
pub(super) const PARAMETERS: [&str; 10] = [
    "quality",
    "deadline_ms",
    "resolution",
    "samples",
    "supersampling",
    "filtering",
    "cameras",
    "depth_maps",
    "sources",
    "stride",
];

/// Time to a picture, milliseconds; none is waited for longer than ten seconds.
const DEADLINE_MS: RangeInclusive<f64> = 1.0..=10_000.0;

/// Reads them, for entities of `style`; what means nothing to it is a fault.
pub(super) fn read(query: &mut Query, style: EntityStyle) -> Effort {
    if query.has("quality") {
        query.refuse("deadline_ms", "cannot be asked for together with quality");
    }
    let styles = [
        ("sources", EntityStyle::Billboards, "entities=billboards"),
        ("stride", EntityStyle::Points, "entities=points"),
    ];
    for (parameter, only, named) in styles {
        if style != only {
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
            most_cameras: query.whole("cameras", &(1..=most)).map(|cameras| cameras as usize),
            depth_maps: query.choice("depth_maps", &[("on", true), ("off", false)]),
            filtering: query.choice("filtering", &Filtering::ALL),
            samples: query.choice("samples", &[("1", 1), ("4", 4)]),
            supersampling: query.whole("supersampling", &(1..=MAX_SUPERSAMPLING)),
            resolution: query.choice("resolution", &Detail::ALL),
        },
    }
}
