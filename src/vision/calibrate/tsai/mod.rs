//! Calibrations of Tsai's model in the XML of the PETS data sets.
//!
//! \[Tsai87\] Tsai 1987, A versatile camera calibration technique for high-accuracy 3D machine vision metrology
//! using off-the-shelf TV cameras and lenses. Its conventions here: `Xc` = R Xw + T with R = Rz(rz) Ry(ry) Rx(rx);
//! Xu = f xc / zc on the sensor; Xu = Xd (1 + kappa1 rd^2); u = sx Xd / dpx + cx, v = Yd / dpy + cy with pixel
//! centres at integers.
//!
//! Its radial term runs from the distorted to the undistorted picture, ours the other way, so ours is fitted to
//! it over the picture (`fit`) and the fit's residual is handed back. In units of the focal length rd is
//! isotropic, sx and the pixels' sizes only enter the focal lengths in pixels, and kappa1 becomes kappa1 f^2.

mod fit;

use super::xml::{line_of, parse};
use super::{CalibrateError, ImportOptions, Imported, agreed_size, list_names};
use crate::geometry::{Camera, CameraError, Pose};
use glam::{DQuat, DVec2, DVec3};
use roxmltree::{Document, Node};

pub(super) fn import(text: &str, options: &ImportOptions) -> Result<Imported, CalibrateError> {
    let document = parse(text)?;
    let camera = find_camera(&document, options)?;
    let element = |name: &'static str| Element::find(camera, name);
    let (geometry, intrinsic, extrinsic) =
        (element("Geometry")?, element("Intrinsic")?, element("Extrinsic")?);

    let said = [geometry.size("width")?, geometry.size("height")?];
    let size_px = agreed_size(Some(said), options, "/Camera/Geometry")?;
    let focal = intrinsic.positive("focal")?;
    let focal_px = DVec2::new(
        intrinsic.positive("sx")? * focal / geometry.positive("dpx")?,
        focal / geometry.positive("dpy")?,
    );
    let center_px = DVec2::new(intrinsic.number("cx")?, intrinsic.number("cy")?) + 0.5;
    let kappa = intrinsic.number("kappa1")? * focal * focal;

    let metres = options.metres_per_unit.unwrap_or(0.001);
    let translation = extrinsic.vector(["tx", "ty", "tz"])? * metres;
    let [rx, ry, rz] = extrinsic.vector(["rx", "ry", "rz"])?.to_array();
    let camera_from_world =
        DQuat::from_rotation_z(rz) * DQuat::from_rotation_y(ry) * DQuat::from_rotation_x(rx);
    let world_from_local = camera_from_world.inverse();
    let pose = Pose { position_in_world: world_from_local * -translation, world_from_local };

    let fit = fit::inverse_radial(kappa, farthest_corner(size_px, focal_px, center_px));
    let Some((distortion, residual)) = fit else {
        return Err(intrinsic.fault("kappa1", "bends the picture's corners too far for any lens"));
    };
    let camera = Camera::new(size_px, focal_px, center_px, distortion, pose)
        .map_err(|error| CalibrateError::no_camera(place_of(&error), &error))?;
    Ok(Imported { camera, residual_px: Some(residual * focal_px.max_element()) })
}

fn find_camera<'a>(
    document: &'a Document<'a>,
    options: &ImportOptions,
) -> Result<Node<'a, 'a>, CalibrateError> {
    let cameras: Vec<_> = document.descendants().filter(|node| node.has_tag_name("Camera")).collect();
    let name_of = |node: &Node<'a, 'a>| node.attribute("name").unwrap_or_default();
    let known = || list_names(cameras.iter().map(name_of));
    match (&options.camera, cameras.as_slice()) {
        (_, []) => Err(CalibrateError::invalid("/Camera", "the element is missing")),
        (None, [camera]) => Ok(*camera),
        (None, _) => Err(CalibrateError::CameraNotNamed { known: known() }),
        (Some(name), cameras) => cameras
            .iter()
            .find(|camera| name_of(camera) == name)
            .copied()
            .ok_or_else(|| CalibrateError::NoSuchCamera { name: name.clone(), known: known() }),
    }
}

/// An element of numbers.
struct Element<'a> {
    name: &'static str,
    line: u32,
    node: Node<'a, 'a>,
}

impl<'a> Element<'a> {
    fn find(camera: Node<'a, 'a>, name: &'static str) -> Result<Self, CalibrateError> {
        let node = camera.children().find(|node| node.has_tag_name(name)).ok_or_else(|| {
            let line = line_of(camera);
            CalibrateError::invalid(
                format!("/Camera/{name}"),
                format!("the element is missing (line {line})"),
            )
        })?;
        Ok(Self { name, line: line_of(node), node })
    }

    fn fault(&self, attribute: &str, message: &str) -> CalibrateError {
        let place = format!("/Camera/{}/@{attribute}", self.name);
        CalibrateError::invalid(place, format!("{message} (line {})", self.line))
    }

    fn number(&self, attribute: &str) -> Result<f64, CalibrateError> {
        let text = self.node.attribute(attribute).ok_or_else(|| self.fault(attribute, "is missing"))?;
        text.trim()
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite())
            .ok_or_else(|| self.fault(attribute, "must be a finite number"))
    }

    fn positive(&self, attribute: &str) -> Result<f64, CalibrateError> {
        let number = self.number(attribute)?;
        // Bounded so that products and quotients of a few of them stay finite.
        if (1e-12..=1e12).contains(&number) {
            return Ok(number);
        }
        Err(self.fault(attribute, "must lie in 1e-12 to 1e12"))
    }

    fn size(&self, attribute: &str) -> Result<u32, CalibrateError> {
        let number = self.number(attribute)?;
        if number.fract() == 0.0 && (1.0..=65_536.0).contains(&number) {
            return Ok(number as u32);
        }
        Err(self.fault(attribute, "must be a whole number of pixels, 1 to 65536"))
    }

    fn vector(&self, attributes: [&str; 3]) -> Result<DVec3, CalibrateError> {
        let [x, y, z] = attributes.map(|attribute| self.number(attribute));
        Ok(DVec3::new(x?, y?, z?))
    }
}

fn place_of(error: &CameraError) -> &'static str {
    let (CameraError::NotFinite { field } | CameraError::OutOfRange { field, .. }) = error;
    match *field {
        "image size" => "/Camera/Geometry",
        "position" | "rotation" => "/Camera/Extrinsic",
        "distortion" => "/Camera/Intrinsic/@kappa1",
        _ => "/Camera/Intrinsic",
    }
}

/// The largest radius in the distorted picture, units of the focal length.
fn farthest_corner(size_px: (u32, u32), focal_px: DVec2, center_px: DVec2) -> f64 {
    let size = DVec2::new(f64::from(size_px.0), f64::from(size_px.1));
    let corners = [DVec2::ZERO, DVec2::new(size.x, 0.0), DVec2::new(0.0, size.y), size];
    corners.into_iter().map(|corner| ((corner - center_px) / focal_px).length()).fold(0.0, f64::max)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::calibrate) const TEXT: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Camera name="Made_up">
  <Geometry width="768" height="576" ncx="795" nfx="752" dx="4.85e-03" dy="4.65e-03" dpx="5.1e-03" dpy="4.6e-03"/>
  <Intrinsic focal="5.5" kappa1="6.0e-03" cx="324.2" cy="282.5" sx="1.09"/>
  <Extrinsic tx="800" ty="-3100" tz="35000" rx="2.04" ry="-0.89" rz="-0.43"/>
</Camera>"#;

    /// The world point's pixel by \[Tsai87\], written apart from the importer: angles into a matrix by hand, the
    /// radius by bisection.
    fn tsai_pixel(point_mm: [f64; 3]) -> [f64; 2] {
        let ((sa, ca), (sb, cb), (sc, cc)) =
            (2.04_f64.sin_cos(), (-0.89_f64).sin_cos(), (-0.43_f64).sin_cos());
        let rows = [
            [cb * cc, cc * sa * sb - ca * sc, sa * sc + ca * cc * sb],
            [cb * sc, sa * sb * sc + ca * cc, ca * sb * sc - cc * sa],
            [-sb, cb * sa, ca * cb],
        ];
        let [xc, yc, zc] = [0, 1, 2].map(|row: usize| {
            let turned: f64 = rows[row].iter().zip(point_mm).map(|(r, p)| r * p).sum();
            turned + [800.0, -3100.0, 35000.0][row]
        });
        let (xu, yu) = (5.5 * xc / zc, 5.5 * yc / zc);
        let ru = xu.hypot(yu);
        let (mut low, mut high) = (0.0, ru);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            *(if middle * (1.0 + 6.0e-3 * middle * middle) < ru { &mut low } else { &mut high }) = middle;
        }
        let shrink = if ru > 0.0 { low / ru } else { 1.0 };
        [1.09 * xu * shrink / 5.1e-3 + 324.2, yu * shrink / 4.6e-3 + 282.5]
    }

    #[test]
    fn points_land_where_tsai_puts_them() {
        let imported = import(TEXT, &ImportOptions::default()).expect("a camera");
        let residual = imported.residual_px.expect("a fit");
        assert!(residual < 1e-3, "{residual}");
        let mut n_inside = 0;
        for (x, y) in (-20..=20).flat_map(|x| (-20..=20).map(move |y| (f64::from(x), f64::from(y)))) {
            let Some(projection) = imported.camera.project(DVec3::new(x, y, 0.5)) else { continue };
            if !projection.is_inside() {
                continue;
            }
            n_inside += 1;
            let [u, v] = tsai_pixel([x * 1000.0, y * 1000.0, 500.0]);
            let pixel = projection.texture * DVec2::new(768.0, 576.0) - 0.5;
            assert!((pixel - DVec2::new(u, v)).length() < residual + 1e-6, "{x} {y}: {pixel} {u} {v}");
        }
        assert!(n_inside > 300, "{n_inside}");
    }

    #[test]
    fn faults_name_element_and_line() {
        let check = |from: &str, to: &str, expected: &str| {
            assert!(TEXT.contains(from), "{from}");
            let error = import(&TEXT.replace(from, to), &ImportOptions::default()).expect_err(expected);
            assert!(error.to_string().contains(expected), "{error}");
        };
        check("focal=\"5.5\"", "", "/Camera/Intrinsic/@focal: is missing (line 4)");
        check("5.5", "NaN", "/Camera/Intrinsic/@focal: must be a finite number (line 4)");
        check("5.5", "0", "/Camera/Intrinsic/@focal: must lie in");
        check("4.6e-03", "4.6e-11", "/Camera/Intrinsic: focal length");
        check("768", "0", "/Camera/Geometry/@width: must be a whole number");
        check("768", "768.5", "/Camera/Geometry/@width: must be a whole number");
        check("35000", "inf", "/Camera/Extrinsic/@tz");
        check("35000", "1e20", "/Camera/Extrinsic: position");
        check("Extrinsic", "Outside", "/Camera/Extrinsic: the element is missing (line 2)");
        check("</Camera>", "", "line");
        check("6.0e-03", "1e300", "/Camera/Intrinsic/@kappa1: bends");
        check("6.0e-03", "-1e300", "/Camera/Intrinsic/@kappa1: bends");
        check("<Camera name", "<Box name", "line");
    }

    #[test]
    fn units_and_names_are_heeded() {
        let of = |options: ImportOptions| import(TEXT, &options);
        let metres = of(ImportOptions { metres_per_unit: Some(1.0), ..ImportOptions::default() });
        let millimetres = of(ImportOptions::default()).expect("a camera").camera.pose().position_in_world;
        let position = metres.expect("a camera").camera.pose().position_in_world;
        assert!((position * 0.001 - millimetres).length() < 1e-9);
        of(ImportOptions { camera: Some("Made_up".to_owned()), ..ImportOptions::default() })
            .expect("a camera");
        of(ImportOptions { camera: Some("View_001".to_owned()), ..ImportOptions::default() })
            .expect_err("a name");
        of(ImportOptions { image_size_px: Some([640, 480]), ..ImportOptions::default() })
            .expect_err("a size");
    }
}
