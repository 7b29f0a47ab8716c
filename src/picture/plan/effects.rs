//! Which effects run after the scene was drawn and why, by which light, and how much beside a piece of a picture they look at.

use super::{Colors, Part, Picture, Plan, Projection, Reason, View};
use crate::fuse::{CameraState, SceneState};
use glam::{DVec2, Vec3};
use videofields_vision::effects::{
    EffectSettings, Harmonics, LightError, LightSource, MattLight, Occlusion, Relight, Stipple,
};
use videofields_vision::frame::linear_from_srgb;

/// Furthest that occlusion looks from a pixel: a tangent, and pixels of the finished picture.
const MOST_TANGENT: f64 = 0.05;
const MOST_REACH_PX: f64 = 96.0;

/// Drawn pixels beside one that its normal and its smoothing look at.
const BESIDE_PX: u32 = 4;

/// What is drawn beside a piece is a multiple of this many pixels, so that coarse pixels and patterns lie as without.
const MARGIN_STEP_PX: u32 = 4;

/// The effects of a picture, as they are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PlannedEffects {
    /// Another light.
    pub relight: Option<PlannedLight>,
    /// Ambient occlusion.
    pub occlusion: Option<Occlusion>,
    /// Dots on paper.
    pub stipple: Option<Stipple>,
}

/// A light, and how much of it is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedLight {
    /// What a white matt surface sends out.
    pub light: MattLight,
    /// 0 to 1.
    pub strength: f32,
}

impl PlannedEffects {
    /// Whether there is none.
    #[must_use]
    pub const fn is_none(&self) -> bool {
        self.relight.is_none() && self.occlusion.is_none() && self.stipple.is_none()
    }

    /// Whether any asks how far what was drawn lies.
    #[must_use]
    pub const fn needs_distances(&self) -> bool {
        self.relight.is_some() || self.occlusion.is_some()
    }

    /// How far occlusion looks in a part's picture at most: a tangent off the axis, of parallel rays metres. It follows from the
    /// part as it is asked for, not from the piece of it that is drawn at once.
    #[must_use]
    pub fn most_reach(&self, part: &View) -> f64 {
        let by_pixels = MOST_REACH_PX * pitch(part);
        let by_world = match part.frustum.projection {
            Projection::Perspective => MOST_TANGENT,
            Projection::Orthographic => self.occlusion.map_or(0.0, |occlusion| f64::from(occlusion.radius_m)),
        };
        by_pixels.min(by_world)
    }

    /// Pixels of the finished picture that are drawn beside a piece of `part` on every side, one of `step_px` of them each way.
    #[must_use]
    pub fn margin_px(&self, part: &View, step_px: u32) -> u32 {
        let mut margin = 0;
        if self.needs_distances() {
            margin += BESIDE_PX * step_px;
        }
        if self.occlusion.is_some() {
            margin += (self.most_reach(part) / pitch(part)).ceil().min(MOST_REACH_PX) as u32;
        }
        if let Some(stipple) = &self.stipple {
            margin += stipple.blur_px;
        }
        margin.next_multiple_of(MARGIN_STEP_PX)
    }

    /// Pixels that are drawn with what lies beside every part, of those that the picture has.
    #[must_use]
    pub fn drawn_share(&self, picture: &Picture) -> f64 {
        let (mut drawn, mut shown) = (0.0, 0.0);
        for Part { view, .. } in &picture.parts {
            let both = f64::from(2 * self.margin_px(view, 1));
            let (width, height) = (f64::from(view.width_px), f64::from(view.height_px));
            drawn += (width + both) * (height + both);
            shown += width * height;
        }
        if shown > 0.0 { drawn / shown } else { 1.0 }
    }
}

/// Extent of a pixel along its shorter side: tangents, of parallel rays metres.
fn pitch(view: &View) -> f64 {
    let along = |side: u32, [first, last]: [f64; 2]| (last - first) / f64::from(side.max(1));
    along(view.width_px, view.frustum.x).min(along(view.height_px, view.frustum.y))
}

/// Where the upper left pixel of a part lies in what patterns are anchored to: columns and rows from where the view's axis meets
/// the picture, which all tiles of a flat wall share; of a picture of several parts from its own upper left, for two eyes from each
/// eye's.
#[must_use]
pub fn anchor_px(picture: &Picture, part: &Part) -> [i64; 2] {
    let Part { view, left_px, top_px } = part;
    if picture.parts.len() > 1 {
        let turn = view.pose.world_from_local;
        let is_eye = picture.parts.iter().all(|other| other.view.pose.world_from_local == turn);
        return if is_eye { [0, 0] } else { [i64::from(*left_px), i64::from(*top_px)] };
    }
    // A little off the middle, so that rounding tells whole and half pixels apart in every piece alike. Saturates.
    let along =
        |side: u32, [first, last]: [f64; 2]| (first / (last - first) * f64::from(side) + 0.25).floor() as i64;
    [along(view.width_px, view.frustum.x), along(view.height_px, view.frustum.y)]
}

/// Decides on effects, of which `wished` are wished for.
pub(super) fn plan(state: &SceneState, wished: &EffectSettings, plan: &mut Plan) {
    let colors = if plan.evens_colors { Colors::Even } else { Colors::Raw };
    let mut reason = |effect, is_on, because: String| plan.reasons.push(Reason { effect, is_on, because });
    let not_asked = || "not asked for".to_owned();
    let relight = wished.relight.as_ref().map(|relight| light_of(state, relight, colors));
    let places = match (&relight, &wished.occlusion) {
        (Some(Ok(_)), Some(_)) => Some("relight and occlusion"),
        (Some(Ok(_)), None) => Some("relight"),
        (_, Some(_)) => Some("occlusion"),
        _ => None,
    };
    match places {
        Some(of) => reason("distance", true, format!("{of}: asks where what was drawn lies")),
        None => reason("distance", false, "no effect asks where what was drawn lies".to_owned()),
    }
    match &relight {
        None => reason("relight", false, not_asked()),
        Some(Ok((_, because))) => reason("relight", true, because.clone()),
        Some(Err(because)) => reason("relight", false, because.clone()),
    }
    match &wished.occlusion {
        None => reason("occlusion", false, not_asked()),
        Some(Occlusion { radius_m, strength }) => {
            let because = format!("asked for: within {radius_m} m, strength {strength}");
            reason("occlusion", true, because);
        }
    }
    match &wished.stipple {
        None => reason("stipple", false, not_asked()),
        Some(Stipple { dot_px, blur_px, .. }) => {
            let because = format!("asked for: dots of {dot_px} px within {blur_px} px");
            reason("stipple", true, because);
        }
    }
    plan.effects = PlannedEffects {
        relight: relight.and_then(Result::ok).map(|(light, _)| light),
        occlusion: wished.occlusion,
        stipple: wished.stipple,
    };
}

/// The light, and where it comes from; or why there is none.
fn light_of(state: &SceneState, relight: &Relight, colors: Colors) -> Result<(PlannedLight, String), String> {
    let (light, from) = match relight.light {
        LightSource::Sky => {
            let light = state.scene.sky.harmonics();
            (light.map_err(|error| format!("the scene's sky: {error}"))?, "the scene's sky".to_owned())
        }
        LightSource::Picture => {
            let light = state.scene.effects.picture;
            (light.ok_or("the scene has no picture of a light")?, "the scene's picture of a light".to_owned())
        }
        LightSource::Camera => {
            let camera = camera_of(state, relight.camera_idx)?;
            let light = light_of_camera(camera, colors);
            let from = format!("what {} sees of the place", camera.id.as_str());
            (light.map_err(|error| format!("{from}: {error}"))?, from)
        }
    };
    let (light, sun) = match &relight.sun {
        Some(sun) => (light.with_sun(sun.direction(), sun.strength), ", with a sun"),
        None => (light, ""),
    };
    let light = MattLight::new(&light, relight.exposure_stops);
    let because = format!("asked for: light from {from}{sun}");
    Ok((PlannedLight { light, strength: relight.strength }, because))
}

fn camera_of(state: &SceneState, camera_idx: Option<usize>) -> Result<&CameraState, String> {
    let Some(idx) = camera_idx else {
        return state.cameras.first().ok_or_else(|| "no camera has a picture".to_owned());
    };
    let Some(member) = state.scene.cameras.get(idx) else {
        return Err("the camera that the light is from is not in the scene".to_owned());
    };
    let found = state.cameras.iter().find(|camera| camera.id == member.id);
    found.ok_or_else(|| format!("{} has no picture", member.id.as_str()))
}

fn light_of_camera(of: &CameraState, colors: Colors) -> Result<Harmonics, LightError> {
    let background = &of.observation.background;
    let size = DVec2::new(f64::from(background.width()), f64::from(background.height()));
    let is_one = of.gain.is_finite() && of.gain.min_element() >= 0.0;
    let gain = if colors == Colors::Even && is_one { of.gain } else { Vec3::ONE };
    Harmonics::of_camera(&of.camera, |texture| {
        let DVec2 { x, y } = (texture * size).floor().max(DVec2::ZERO).min(size - 1.0);
        let (x, y) = (x as u32, y as u32);
        if background.zone_mask().is_some_and(|zones| zones.hides(x, y)) {
            return None;
        }
        let light = background.rgb_at(x, y).map(|code| linear_from_srgb(f32::from(code) / 255.0));
        Some(Vec3::from(light) * gain)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::ViewLimits;
    use glam::DVec3;

    const LIMITS: ViewLimits = ViewLimits { max_side_px: 16_384, max_pixels: 1 << 26 };
    const EYE: DVec3 = DVec3::new(5e5, 5e6, 3.0);
    const ALL: PlannedEffects = PlannedEffects {
        relight: None,
        occlusion: Some(Occlusion { radius_m: 1.5, strength: 1.0 }),
        stipple: Some(Stipple { dot_px: 2, blur_px: 6, contrast: 2.0, shade: 0.5 }),
    };

    #[test]
    fn tiles_of_a_flat_wall_count_from_one_place() {
        let tile = |left_m: f64, bottom_m: f64| {
            let at = |x: f64, z: f64| EYE + DVec3::new(x, 2.0, z);
            let corners = [at(left_m, bottom_m), at(left_m + 1.6, bottom_m), at(left_m, bottom_m + 0.9)];
            Picture::through_window(EYE, corners, (320, 180), &LIMITS).expect("a window")
        };
        // 320 columns of 5 mm; a bezel of 20 mm are 4 of them.
        let anchor = |picture: &Picture| anchor_px(picture, &picture.parts[0]);
        let first = anchor(&tile(-1.6, -0.3));
        assert_eq!(anchor(&tile(0.02, -0.3)), [first[0] + 324, first[1]]);
        assert_eq!(anchor(&tile(-1.6, -1.2)), [first[0], first[1] + 180]);
        for view in [tile(-1.6, -0.3), tile(0.02, -0.3)].map(|of| of.parts[0].view) {
            assert!((ALL.most_reach(&view) - 0.05).abs() < 1e-12);
            assert_eq!(ALL.margin_px(&view, 1) % 4, 0);
        }
    }

    #[test]
    fn both_eyes_count_from_their_own_corner_and_strips_from_the_pictures() {
        let ends = (EYE, EYE + DVec3::X * 8.0);
        let pair = Picture::stereo(ends, 0.9, (640, 360), (0.064, 8.0), &LIMITS).expect("a pair");
        assert!(pair.parts.iter().all(|part| anchor_px(&pair, part) == [0, 0]));
        let round = Picture::panorama(ends, std::f64::consts::TAU, 1.0, (512, 128), &LIMITS).expect("one");
        assert!(round.parts.len() > 2);
        assert!(round.parts.iter().all(|part| anchor_px(&round, part)[0] == i64::from(part.left_px)));
    }

    #[test]
    fn what_is_looked_at_beside_a_piece_is_bounded_at_any_zoom() {
        for fov in [0.01, 0.8, 2.9] {
            for size in [(1, 1), (320, 180), (3840, 2160)] {
                let view = View::new(EYE, EYE + DVec3::X, fov, size.0, size.1, &LIMITS).expect("a view");
                let margin = ALL.margin_px(&view, 4);
                assert!((24..=120).contains(&margin), "{fov} {size:?}: {margin}");
                assert_eq!(PlannedEffects::default().margin_px(&view, 4), 0);
            }
        }
        let map = Picture::map(EYE, 90.0, 0.0, 60.0, (1280, 720), &LIMITS).expect("a map");
        // 1.5 m are 32 of its pixels.
        assert!((ALL.most_reach(&map.parts[0].view) - 1.5).abs() < 1e-6);
        assert_eq!(ALL.margin_px(&map.parts[0].view, 1), 44);
        assert_eq!(PlannedEffects::default().drawn_share(&map), 1.0);
        assert!((ALL.drawn_share(&map) - 1368.0 * 808.0 / (1280.0 * 720.0)).abs() < 1e-12);
    }
}
