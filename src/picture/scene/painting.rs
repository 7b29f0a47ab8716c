//! What documents say of pictures on surfaces and of the sky -> paints, or their faults.

use super::document::{Color, OriginDocument};
use super::paint::{MOST_REPEATS, Paint, Repeated, most_repeats};
use super::paint_document::{
    BoundsDocument, DEFAULT_SKY, ImageryDocument, SkyDocument, TextureDocument, TransformDocument,
};
use super::read::{Placed, range};
use super::texture::{Files, Texture, Wrap};
use super::{Imports, Material, Sky};
use glam::DVec2;
use std::sync::Arc;
use videofields_vision::error::{Gatherer, pointer_to};
use videofields_vision::geometry::{
    ControlPoint, Geodetic, PlaneTransform, Registration, RegistrationError, Shape, SheetKind, register,
};

const MAX_CONTROL_POINTS: usize = 1024;
/// From so many control points on a picture is bent, where nothing else is said.
const HOMOGRAPHY_FROM: usize = 6;
/// Beyond this latitude a picture of even steps in longitude is not worth having.
const MAX_LATITUDE_DEG: f64 = 85.0;
/// How far from the origin a level world may be laid over the earth, metres: it lies 200 m above it there.
const MAX_BOUNDS_M: f64 = 50_000.0;
/// How far a picture between bounds may lie beside itself, metres; half a pixel where that is more.
const MAX_BOUNDS_RESIDUAL_M: f64 = 0.5;
/// Places each way at which bounds are laid over the level world.
const N_BOUNDS_POINTS: u32 = 9;

/// Of what a surface's document says what pictures need.
pub(super) trait Paintable {
    /// Its plain colour.
    fn color(&self) -> Color;
    /// The pictures that repeat over it, by their keys.
    fn textures(&self) -> [(&'static str, SheetKind, Option<&TextureDocument>); 2];
    /// The picture that lies on it.
    fn imagery(&mut self) -> Option<&mut ImageryDocument> {
        None
    }
}

/// A document with its shape and what that looks like.
pub(super) type PaintedShape<D> = (D, (Shape, Material));

/// Paints the surfaces of a scene that is being read.
pub(super) struct Painting<'a> {
    pub(super) files: Files<'a>,
    origin: Option<Geodetic>,
}

impl<'a> Painting<'a> {
    pub(super) fn new(imports: &'a mut dyn Imports, origin: Option<&OriginDocument>) -> Self {
        let place = |origin: &OriginDocument| {
            Geodetic::from_degrees(origin.latitude_deg, origin.longitude_deg, origin.height_m)
        };
        Self { files: Files::new(imports), origin: origin.map(place) }
    }

    /// Paints a shape; no file is opened for what is refused already.
    pub(super) fn painted<D: Paintable>(
        &mut self,
        (mut document, shape): (D, Shape),
        place: &str,
        gatherer: &mut Gatherer,
    ) -> Option<PaintedShape<D>> {
        if gatherer.is_faulty(place) {
            return None;
        }
        let color_srgb = document.color().0;
        let repeated = self.repeated((&document, &shape), place, gatherer);
        let has_texture = document.textures().iter().any(|(_, _, texture)| texture.is_some());
        let registered = match document.imagery() {
            Some(_) if has_texture => {
                let message = "`imagery` and `texture` are both given; a surface has one of them";
                gatherer.fault(pointer_to(place, "imagery"), message);
                return None;
            }
            Some(imagery) => self.registered(imagery, color_srgb, &pointer_to(place, "imagery"), gatherer),
            None => None,
        };
        let paint = registered.or(repeated).map(Arc::new);
        Some((document, (shape, Material { paint, ..Material::plain(color_srgb) })))
    }

    fn repeated<D: Paintable>(
        &mut self,
        (document, shape): (&D, &Shape),
        place: &str,
        gatherer: &mut Gatherer,
    ) -> Option<Paint> {
        let (mut walls, mut level) = (None, None);
        for (key, kind, texture) in document.textures() {
            let Some(TextureDocument { file, size_m }) = texture else { continue };
            let place = pointer_to(place, key);
            for (idx, extent) in size_m.iter().enumerate() {
                let place = pointer_to(&place, "size_m");
                range(gatherer, &place, &idx.to_string(), *extent, 1e-3, 1e5, "metres");
            }
            let size_m = DVec2::from_array(*size_m);
            // So written that what is no number is a fault.
            let repeats = if gatherer.is_faulty(&place) { 0.0 } else { most_repeats(shape, kind, size_m) };
            if repeats > MOST_REPEATS {
                let message = format!(
                    "a picture may repeat at most {MOST_REPEATS} times along a face, but here {repeats:.0} times"
                );
                gatherer.fault(pointer_to(&place, "size_m"), message);
            }
            if gatherer.is_faulty(&place) {
                continue;
            }
            match self.files.picture(file, document.color().0, [Wrap::Repeat; 2]) {
                Ok(picture) => {
                    let slot = if kind == SheetKind::Wall { &mut walls } else { &mut level };
                    *slot = Some(Repeated { picture, size_m });
                }
                Err(message) => gatherer.fault(pointer_to(&place, "file"), message),
            }
        }
        (walls.is_some() || level.is_some()).then_some(Paint::Repeated { walls, level })
    }

    fn registered(
        &mut self,
        imagery: &mut ImageryDocument,
        color_srgb: [u8; 3],
        place: &str,
        gatherer: &mut Gatherer,
    ) -> Option<Paint> {
        let points = &imagery.control_points;
        match (points.is_empty(), &imagery.bounds) {
            (true, None) | (false, Some(_)) => {
                gatherer.fault(place, "expected either `control_points` or `bounds`");
            }
            (true, Some(bounds)) => {
                self.check_bounds(bounds, &pointer_to(place, "bounds"), gatherer);
                if imagery.transform.is_some() {
                    gatherer.fault(pointer_to(place, "transform"), "is for control points, not for bounds");
                }
            }
            (false, None) if points.len() > MAX_CONTROL_POINTS => {
                let message = format!("at most {MAX_CONTROL_POINTS} are allowed, got {}", points.len());
                gatherer.fault(pointer_to(place, "control_points"), message);
            }
            (false, None) => {
                for (idx, point) in points.iter().enumerate() {
                    for (axis, number) in point.world.iter().enumerate() {
                        let place = format!("{place}/control_points/{idx}/world");
                        range(gatherer, &place, &axis.to_string(), *number, -1e8, 1e8, "metres");
                    }
                }
            }
        }
        if gatherer.is_faulty(place) {
            return None;
        }
        let picture = match self.files.picture(&imagery.file, color_srgb, [Wrap::Clamp; 2]) {
            Ok(picture) => picture,
            Err(message) => {
                gatherer.fault(pointer_to(place, "file"), message);
                return None;
            }
        };
        let found = match &imagery.bounds {
            Some(bounds) => self.between(bounds, &picture, &pointer_to(place, "bounds"), gatherer)?,
            None => by_control_points(imagery, &picture, place, gatherer)?,
        };
        imagery.residual_m = Some(found.residual_m);
        tracing::info!(file = imagery.file, residual_m = found.residual_m, "imagery registered");
        Some(Paint::Registered { picture, map: found.map })
    }

    fn check_bounds(&self, bounds: &BoundsDocument, place: &str, gatherer: &mut Gatherer) {
        let BoundsDocument { west_deg, south_deg, east_deg, north_deg } = *bounds;
        for (key, value, most) in [
            ("west_deg", west_deg, 180.0),
            ("south_deg", south_deg, MAX_LATITUDE_DEG),
            ("east_deg", east_deg, 180.0),
            ("north_deg", north_deg, MAX_LATITUDE_DEG),
        ] {
            range(gatherer, place, key, value, -most, most, "degrees");
        }
        if south_deg >= north_deg {
            gatherer.fault(pointer_to(place, "north_deg"), "must lie north of `south_deg`");
        }
        if west_deg == east_deg {
            gatherer.fault(pointer_to(place, "east_deg"), "must lie east of `west_deg`");
        }
        if self.origin.is_none() {
            gatherer.fault(place, "needs the scene's `origin`: where on the earth its world lies");
        }
    }

    /// Where a picture between bounds lies: a grid of its places, laid over the level world through the origin.
    fn between(
        &self,
        bounds: &BoundsDocument,
        picture: &Texture,
        place: &str,
        gatherer: &mut Gatherer,
    ) -> Option<Registration> {
        let origin = self.origin.as_ref()?;
        let BoundsDocument { west_deg, south_deg, east_deg, north_deg } = *bounds;
        // Across the antimeridian longitudes go on beyond 180 degrees.
        let across_deg = (east_deg - west_deg).rem_euclid(360.0);
        let at = |idx: u32| f64::from(idx) / f64::from(N_BOUNDS_POINTS - 1);
        let point = |idx: u32| {
            let texture = DVec2::new(at(idx % N_BOUNDS_POINTS), at(idx / N_BOUNDS_POINTS));
            let longitude_deg = texture.x.mul_add(across_deg, west_deg);
            let latitude_deg = texture.y.mul_add(south_deg - north_deg, north_deg);
            let on_earth = Geodetic {
                height_m: origin.height_m,
                ..Geodetic::from_degrees(latitude_deg, longitude_deg, 0.0)
            };
            ControlPoint { texture, world: origin.east_north_up_m(&on_earth).truncate() }
        };
        let points: Vec<ControlPoint> = (0..N_BOUNDS_POINTS * N_BOUNDS_POINTS).map(point).collect();
        // Beyond a quarter of the way around, the earth's far side lies below the level world's middle.
        let farthest_m = points.iter().map(|point| point.world.length()).fold(0.0, f64::max);
        if farthest_m > MAX_BOUNDS_M || across_deg > 90.0 || north_deg - south_deg > 90.0 {
            let message = format!(
                "must lie within {} km of the scene's origin, beyond which no level world fits the earth; these bounds \
                 reach {across_deg:.3} degrees from west to east",
                MAX_BOUNDS_M / 1e3
            );
            gatherer.fault(place, message);
            return None;
        }
        let found = match register(&points, PlaneTransform::Homography) {
            Ok(found) => found,
            Err(error) => {
                gatherer.fault(place, error.to_string());
                return None;
            }
        };
        let (width_px, height_px) = picture.size_px();
        let [left, right, last] = [0, N_BOUNDS_POINTS - 1, N_BOUNDS_POINTS * N_BOUNDS_POINTS - 1]
            .map(|idx| points[idx as usize].world);
        let pixel_m =
            (left.distance(right) / f64::from(width_px)).max(right.distance(last) / f64::from(height_px));
        let most_m = MAX_BOUNDS_RESIDUAL_M.max(0.5 * pixel_m);
        if found.residual_m > most_m {
            let message = format!(
                "a level world fits these bounds only to {:.2} m (at most {most_m:.2} m are allowed): cut the picture \
                 smaller, or give control points",
                found.residual_m
            );
            gatherer.fault(place, message);
            return None;
        }
        Some(found)
    }

    /// Reads the sky.
    pub(super) fn sky(&mut self, placed: Option<Placed>, gatherer: &mut Gatherer) -> (SkyDocument, Sky) {
        let plain = |Color(color_srgb)| Sky::Plain { color_srgb };
        let fallback = || (SkyDocument::default(), plain(DEFAULT_SKY));
        let Some((value, place)) = placed else { return fallback() };
        let Some(document) = gatherer.read::<SkyDocument>(value, &place) else { return fallback() };
        let sky = match (&document.color_srgb, &document.gradient, &document.picture) {
            (None, None, None) => return fallback(),
            (Some(color), None, None) => plain(*color),
            (None, Some(gradient), None) => Sky::Gradient {
                zenith_srgb: gradient.zenith_srgb.0,
                horizon_srgb: gradient.horizon_srgb.0,
                ground_srgb: gradient.ground_srgb.0,
            },
            (None, None, Some(picture)) => {
                let place = pointer_to(&place, "picture");
                range(gatherer, &place, "yaw_deg", picture.yaw_deg, -360.0, 360.0, "degrees");
                match self.files.picture(&picture.file, [0; 3], [Wrap::Repeat, Wrap::Clamp]) {
                    Ok(texture) => Sky::Picture { texture, yaw_rad: picture.yaw_deg.to_radians() },
                    Err(message) => {
                        gatherer.fault(pointer_to(&place, "file"), message);
                        return fallback();
                    }
                }
            }
            _ => {
                gatherer.fault(place, "expected one of `color_srgb`, `gradient` and `picture`");
                return fallback();
            }
        };
        (document, sky)
    }
}

fn by_control_points(
    imagery: &ImageryDocument,
    picture: &Texture,
    place: &str,
    gatherer: &mut Gatherer,
) -> Option<Registration> {
    let (width, height) = picture.size_px();
    let size = DVec2::new(f64::from(width), f64::from(height));
    for (idx, point) in imagery.control_points.iter().enumerate() {
        let pixel = DVec2::from_array(point.pixel);
        if !(pixel.cmpge(DVec2::ZERO).all() && pixel.cmple(size).all()) {
            let message = format!("lies beside the picture, which has {width} x {height} pixels");
            gatherer.fault(format!("{place}/control_points/{idx}/pixel"), message);
        }
    }
    if gatherer.is_faulty(place) {
        return None;
    }
    let points: Vec<ControlPoint> = imagery
        .control_points
        .iter()
        .map(|point| ControlPoint {
            texture: DVec2::from_array(point.pixel) / size,
            world: DVec2::from_array(point.world),
        })
        .collect();
    let transform = match imagery.transform {
        Some(TransformDocument::Affine) => PlaneTransform::Affine,
        Some(TransformDocument::Homography) => PlaneTransform::Homography,
        None if points.len() >= HOMOGRAPHY_FROM => PlaneTransform::Homography,
        None => PlaneTransform::Affine,
    };
    let fault = |error: RegistrationError| {
        gatherer.fault(pointer_to(place, "control_points"), error.to_string());
    };
    register(&points, transform).map_err(fault).ok()
}
