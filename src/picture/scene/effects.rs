//! A scene's effects: its document's settings, and the light of its sky and its pictures.

use super::effects_document::{EffectsDocument, OcclusionDocument, RelightDocument, StippleDocument};
use super::painting::Painting;
use super::read::{Placed, range};
use super::{Scene, Sky, Texture, Wrap};
use glam::Vec3;
use std::f32::consts::{PI, TAU};
use std::ops::RangeInclusive;
use videofields_vision::effects::{
    Asked, EXPOSURE_STOPS, EffectSettings, Harmonics, LightError, LightSource, OCCLUSION_RADIUS_M,
    OCCLUSION_STRENGTH, Occlusion, RELIGHT_STRENGTH, Relight, STIPPLE_BLUR_PX, STIPPLE_CONTRAST,
    STIPPLE_DOT_PX, STIPPLE_SHADE, SUN_AZIMUTH_DEG, SUN_ELEVATION_DEG, SUN_STRENGTH, Stipple, Sun,
};
use videofields_vision::error::{Fault, Gatherer, pointer_to};
use videofields_vision::frame::{CameraId, linear_from_srgb};

/// Most rows of a picture that light is taken of: three bands hold no more.
const LIGHT_ROWS: u32 = 64;

/// Sine below the horizon from which on the ground's colour counts in full: one degree, as shaders/render/sky.wgsl has it.
const HAZE: f32 = 0.017_452_4;

/// What a scene says of effects.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneEffects {
    /// Those that are on where a request does not say.
    pub on: EffectSettings,
    /// Settings of those that are not.
    pub kept: EffectSettings,
    /// The light that is a picture.
    pub picture: Option<Harmonics>,
    /// The camera whose background is the light.
    pub camera: Option<CameraId>,
}

impl Scene {
    /// Which effects a picture has of which a request says so much.
    ///
    /// # Errors
    /// What means nothing here: a setting of an effect that is off, a camera that is not there, a picture that the scene does not
    /// have. The parameter's name is the fault's place.
    pub fn effects_of(&self, asked: &Asked) -> Result<EffectSettings, Fault> {
        let camera_idx = |id: &str| self.cameras.iter().position(|member| member.id.as_str() == id);
        let mut settings = asked.over(&self.effects.on, &self.effects.kept, camera_idx)?;
        if let Some(relight) = &mut settings.relight {
            if relight.light == LightSource::Picture && self.effects.picture.is_none() {
                let message =
                    "the scene has no picture of a light (/effects/relight/picture of its document)";
                return Err(Fault::new("relight", message));
            }
            relight.camera_idx = relight
                .camera_idx
                .or_else(|| self.effects.camera.as_ref().and_then(|camera| camera_idx(camera.as_str())));
        }
        Ok(settings)
    }
}

impl Sky {
    /// The light that comes from a unit direction, linear.
    #[must_use]
    pub fn light_from(&self, direction: Vec3) -> Vec3 {
        match self {
            Self::Plain { color_srgb } => linear(*color_srgb),
            Self::Gradient { zenith_srgb, horizon_srgb, ground_srgb } => {
                let above = linear(*horizon_srgb).lerp(linear(*zenith_srgb), direction.z.max(0.0));
                let share = (-direction.z / HAZE).clamp(0.0, 1.0);
                above.lerp(linear(*ground_srgb), share * share * (3.0 - 2.0 * share))
            }
            Self::Picture { texture, yaw_rad } => all_around(texture, *yaw_rad as f32, direction),
        }
    }

    /// The light of all directions.
    ///
    /// # Errors
    /// Where all of it is black.
    pub fn harmonics(&self) -> Result<Harmonics, LightError> {
        Harmonics::of(|direction| self.light_from(direction))
    }
}

fn linear(color_srgb: [u8; 3]) -> Vec3 {
    Vec3::from(color_srgb.map(|code| linear_from_srgb(f32::from(code) / 255.0)))
}

/// What an equirectangular picture shows in a direction, coarsely.
fn all_around(texture: &Texture, yaw_rad: f32, direction: Vec3) -> Vec3 {
    let levels = texture.levels();
    let coarse = levels.iter().find(|level| level.height_px <= LIGHT_ROWS);
    let Some(level) = coarse.or(levels.last()) else { return Vec3::ZERO };
    let across = direction.truncate().length();
    let azimuth = if across > 1e-6 { direction.y.atan2(direction.x) } else { yaw_rad };
    let u = (0.5 - (azimuth - yaw_rad) / TAU).rem_euclid(1.0);
    let v = (0.5 - direction.z.atan2(across) / PI).clamp(0.0, 1.0);
    let at = |share: f32, side: u32| ((share * side as f32) as u32).min(side - 1) as usize;
    let place = (at(v, level.height_px) * level.width_px as usize + at(u, level.width_px)) * 4;
    let [r, g, b] = [0, 1, 2].map(|channel| level.texels[place + channel]);
    linear([r, g, b])
}

/// Reads a document's effects.
pub(super) fn read(
    placed: Option<Placed>,
    painting: &mut Painting<'_>,
    gatherer: &mut Gatherer,
) -> (EffectsDocument, SceneEffects) {
    let Some((value, place)) = placed else { return Default::default() };
    let Some(document) = gatherer.read::<EffectsDocument>(value, &place) else { return Default::default() };
    let mut effects = SceneEffects::default();
    let split = |on: bool, effects: &mut SceneEffects, put: &dyn Fn(&mut EffectSettings)| {
        put(if on { &mut effects.on } else { &mut effects.kept });
    };
    if let Some(OcclusionDocument { on, radius_m, strength }) = document.occlusion {
        let place = pointer_to(&place, "occlusion");
        check(gatherer, (&place, "radius_m"), radius_m, &OCCLUSION_RADIUS_M, "metres");
        check(gatherer, (&place, "strength"), strength, &OCCLUSION_STRENGTH, "");
        let made = Occlusion { radius_m: radius_m as f32, strength: strength as f32 };
        split(on, &mut effects, &|settings| settings.occlusion = Some(made));
    }
    if let Some(StippleDocument { on, dot_px, blur_px, contrast, shade }) = document.stipple {
        let place = pointer_to(&place, "stipple");
        let whole = |range: &RangeInclusive<u32>| f64::from(*range.start())..=f64::from(*range.end());
        check(gatherer, (&place, "dot_px"), dot_px.into(), &whole(&STIPPLE_DOT_PX), "pixels");
        check(gatherer, (&place, "blur_px"), blur_px.into(), &whole(&STIPPLE_BLUR_PX), "pixels");
        check(gatherer, (&place, "contrast"), contrast, &STIPPLE_CONTRAST, "");
        check(gatherer, (&place, "shade"), shade, &STIPPLE_SHADE, "");
        let made = Stipple { dot_px, blur_px, contrast: contrast as f32, shade: shade as f32 };
        split(on, &mut effects, &|settings| settings.stipple = Some(made));
    }
    if let Some(relight) = &document.relight {
        let place = pointer_to(&place, "relight");
        effects.picture = light_picture(relight, &place, painting, gatherer);
        effects.camera = relight.camera.clone();
        let made = relit(relight, &place, gatherer);
        split(relight.on, &mut effects, &|settings| settings.relight = Some(made));
    }
    (document, effects)
}

fn relit(document: &RelightDocument, place: &str, gatherer: &mut Gatherer) -> Relight {
    check(gatherer, (place, "exposure_stops"), document.exposure_stops, &EXPOSURE_STOPS, "stops");
    check(gatherer, (place, "strength"), document.strength, &RELIGHT_STRENGTH, "");
    let sun = document.sun.map(|sun| {
        let place = pointer_to(place, "sun");
        check(gatherer, (&place, "azimuth_deg"), sun.azimuth_deg, &SUN_AZIMUTH_DEG, "degrees");
        check(gatherer, (&place, "elevation_deg"), sun.elevation_deg, &SUN_ELEVATION_DEG, "degrees");
        check(gatherer, (&place, "strength"), sun.strength, &SUN_STRENGTH, "");
        Sun {
            azimuth_rad: sun.azimuth_deg.to_radians() as f32,
            elevation_rad: sun.elevation_deg.to_radians() as f32,
            strength: sun.strength as f32,
        }
    });
    Relight {
        light: document.light,
        camera_idx: None,
        sun,
        exposure_stops: document.exposure_stops as f32,
        strength: document.strength as f32,
    }
}

fn light_picture(
    document: &RelightDocument,
    place: &str,
    painting: &mut Painting<'_>,
    gatherer: &mut Gatherer,
) -> Option<Harmonics> {
    let Some(picture) = &document.picture else {
        if document.light == LightSource::Picture {
            gatherer.fault(pointer_to(place, "picture"), "is needed where `light` is \"picture\"");
        }
        return None;
    };
    let place = pointer_to(place, "picture");
    range(gatherer, &place, "yaw_deg", picture.yaw_deg, -360.0, 360.0, "degrees");
    let file = pointer_to(&place, "file");
    let texture = match painting.files.picture(&picture.file, [0; 3], [Wrap::Repeat, Wrap::Clamp]) {
        Ok(texture) => texture,
        Err(message) => {
            gatherer.fault(file, message);
            return None;
        }
    };
    let yaw_rad = picture.yaw_deg.to_radians() as f32;
    match Harmonics::of(|direction| all_around(&texture, yaw_rad, direction)) {
        Ok(light) => Some(light),
        Err(error) => {
            gatherer.fault(file, error.to_string());
            None
        }
    }
}

fn check(
    gatherer: &mut Gatherer,
    (place, key): (&str, &str),
    value: f64,
    allowed: &RangeInclusive<f64>,
    unit: &str,
) {
    range(gatherer, place, key, value, *allowed.start(), *allowed.end(), unit);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(texel: impl Fn(u32, u32) -> [u8; 3]) -> Texture {
        let (width, height) = (128, 64);
        let rgb: Vec<u8> = (0..width * height).flat_map(|at| texel(at % width, at / width)).collect();
        Texture::from_rgb((width, height), &rgb, [Wrap::Repeat, Wrap::Clamp])
    }

    #[test]
    fn a_picture_gives_its_light_where_the_sky_shows_it() {
        // The middle column is red, what lies left of it (further north by the picture's way round) green; above is white.
        let texture = picture(|x, y| match (x, y) {
            (_, 0..=3) => [255; 3],
            (48..80, _) => [255, 0, 0],
            (16..48, _) => [0, 255, 0],
            _ => [0, 0, 255],
        });
        let check = |yaw_deg: f32, direction: Vec3, expected: Vec3| {
            let found = all_around(&texture, yaw_deg.to_radians(), direction);
            assert_eq!(found, expected, "{yaw_deg} {direction}");
        };
        check(0.0, Vec3::X, Vec3::X);
        check(0.0, Vec3::Y, Vec3::Y);
        check(0.0, -Vec3::X, Vec3::Z);
        check(0.0, Vec3::Z, Vec3::ONE);
        check(90.0, Vec3::Y, Vec3::X);
        check(360.0, Vec3::new(0.999, -0.01, 0.0).normalize(), Vec3::X);
    }

    #[test]
    fn a_gradient_is_brighter_above_and_a_black_sky_is_no_light() {
        let sky = Sky::Gradient {
            zenith_srgb: [40, 90, 200],
            horizon_srgb: [200, 220, 240],
            ground_srgb: [60, 50, 40],
        };
        assert_eq!(sky.light_from(Vec3::Z), linear([40, 90, 200]));
        assert_eq!(sky.light_from(Vec3::X), linear([200, 220, 240]));
        assert_eq!(sky.light_from(-Vec3::Z), linear([60, 50, 40]));
        assert!(sky.harmonics().is_ok());
        assert_eq!(Sky::Plain { color_srgb: [0; 3] }.harmonics(), Err(LightError::Black));
    }

    fn parsed(effects: &str) -> Result<crate::scene::ParsedScene, Vec<String>> {
        let text = format!("{{\"version\": 1, \"effects\": {effects}}}");
        crate::scene::parse("yard", &text, crate::scene::no_imports)
            .map_err(|error| error.faults().iter().map(|fault| fault.place.clone()).collect())
    }

    #[test]
    fn a_documents_effects_are_read_and_written_again() {
        let parsed = parsed(
            r#"{"occlusion": {"radius_m": 2.5}, "relight": {"on": false, "sun": {"elevation_deg": 10}}, "stipple": {"dot_px": 3}}"#,
        )
        .expect("a scene");
        let SceneEffects { on, kept, .. } = &parsed.scene.effects;
        assert_eq!(on.occlusion, Some(Occlusion { radius_m: 2.5, ..Occlusion::default() }));
        assert_eq!(on.stipple, Some(Stipple { dot_px: 3, ..Stipple::default() }));
        assert_eq!(on.relight, None);
        let sun = kept.relight.and_then(|relight| relight.sun).expect("a sun");
        assert!((sun.elevation_rad - 10_f32.to_radians()).abs() < 1e-6);
        let again = crate::scene::parse("yard", &parsed.document.to_json(), crate::scene::no_imports);
        assert_eq!(again.expect("the same").scene, parsed.scene);
        // What is asked comes over what the scene has.
        let asked = Asked { relight: Some(Some(LightSource::Sky)), stipple: Some(false), ..Asked::default() };
        let found = parsed.scene.effects_of(&asked).expect("settings");
        assert_eq!((found.stipple, found.occlusion), (None, on.occlusion));
        assert_eq!(found.relight.and_then(|relight| relight.sun), Some(sun));
        let asked = Asked { relight: Some(Some(LightSource::Picture)), ..Asked::default() };
        assert_eq!(parsed.scene.effects_of(&asked).expect_err("no picture").place, "relight");
    }

    #[test]
    fn what_is_wrong_with_a_documents_effects_is_told_by_its_place() {
        let check = |effects: &str, place: &str| {
            assert_eq!(parsed(effects).expect_err(place), [place], "{effects}");
        };
        check(r#"{"occlusion": {"radius_m": 0}}"#, "/effects/occlusion/radius_m");
        check(r#"{"occlusion": {"strength": 2.5}}"#, "/effects/occlusion/strength");
        check(r#"{"relight": {"light": "moon"}}"#, "/effects/relight/light");
        check(r#"{"relight": {"light": "picture"}}"#, "/effects/relight/picture");
        check(r#"{"relight": {"light": "camera", "camera": "west"}}"#, "/effects/relight/camera");
        check(r#"{"relight": {"exposure_stops": 5}}"#, "/effects/relight/exposure_stops");
        check(r#"{"relight": {"sun": {"elevation_deg": 91}}}"#, "/effects/relight/sun/elevation_deg");
        check(r#"{"stipple": {"dot_px": 9}}"#, "/effects/stipple/dot_px");
        check(r#"{"stipple": {"shade": 1.5}}"#, "/effects/stipple/shade");
        check(r#"{"bloom": {}}"#, "/effects/bloom");
    }

    #[test]
    fn a_scene_without_the_camera_of_its_light_does_not_tell_of_it() {
        let text = r#"{"version": 1, "effects": {"relight": {"light": "camera", "camera": "west"}}, "cameras": [
            {"id": "west", "calibration": {"image_size_px": [64, 36], "focal_px": [50, 50], "center_px": [32, 18],
             "position_m": [0, 0, 5], "world_from_camera": [0, 0, 0, 1]}}]}"#;
        let whole = crate::scene::parse("yard", text, crate::scene::no_imports).expect("a scene").scene;
        let idx_of = |scene: &Scene| {
            let settings = scene.effects_of(&Asked::default()).expect("settings");
            settings.relight.expect("it is on").camera_idx
        };
        assert_eq!(idx_of(&whole), Some(0));
        let part = whole.with_cameras(|_| false);
        assert_eq!(idx_of(&part), None);
        assert!(whole.document.contains("west") && !part.document.contains("west"), "{}", part.document);
    }
}
