//! `hull`: the visual hull of a set of calibrated pictures, as a mesh.

use super::pictures::{check_names, ending, find, import_cameras, is_same, read, rgb};
use anyhow::{Context as _, Result, bail, ensure};
use glam::DVec3;
use image::DynamicImage;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use videofields_vision::calibrate::{PictureCamera, SetFormat};
use videofields_vision::frame::RgbImage;
use videofields_vision::hull::{self, Agreement, Bounds, Hull as VisualHull, Method, RESOLUTION, View};
use videofields_vision::mesh::Mesh;

/// Makes the visual hull of a thing from calibrated pictures of it, as a closed mesh.
///
/// Cameras come from Middlebury's *_par.txt, OpenCV's YAML, XML or JSON, KITTI's calib.txt or NeRF's transforms.json. Silhouettes are
/// pictures of the cameras' names that are not black inside; or they are found in the pictures themselves: by their transparency
/// where they have any, else by what differs from the colour of the border. What lies beside a camera's picture is not taken away by
/// it. The mesh is in the units and axes of the cameras.
#[derive(Debug, clap::Args)]
pub(crate) struct Hull {
    /// The cameras' file.
    #[arg(long, value_name = "FILE")]
    cameras: PathBuf,
    /// middlebury, opencv, kitti or nerf; told from the text if absent.
    #[arg(long)]
    format: Option<SetFormat>,
    /// Folder of silhouettes: pictures of the cameras' names, black outside.
    #[arg(long, value_name = "DIR", required_unless_present = "images")]
    silhouettes: Option<PathBuf>,
    /// Folder of the pictures: colours of the mesh, and silhouettes where none are given.
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// Codes by which a pixel must differ from the border's colour to be inside, 0 to 254.
    #[arg(long, value_name = "CODES", default_value_t = 22, value_parser = clap::value_parser!(u8).range(..=254))]
    threshold: u8,
    /// Takes the largest piece of every silhouette alone.
    #[arg(long)]
    largest: bool,
    /// image-based (cut by the outlines, to the texel) or voxels.
    #[arg(long, default_value = "image-based")]
    method: Method,
    /// Places of the grid along the longest side, 8 to 1024.
    #[arg(long, default_value_t = 256)]
    resolution: u32,
    /// Corners of the box that is looked at, in the cameras' units; found from the silhouettes if absent.
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, value_parser = parse_bounds)]
    bounds: Option<Bounds>,
    /// Cameras that must see a place for it to be part of the hull; if absent three quarters of them, and no fewer than two.
    #[arg(long, value_name = "COUNT")]
    least_seen: Option<usize>,
    /// Pixels by which outlines may be simplified.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    simplify_px: f64,
    /// Cameras that are left out, and only compared with the hull.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    hold_back: Vec<String>,
    /// Length of the cameras' unit in metres, where it is not a metre.
    #[arg(long, value_name = "METRES")]
    metres_per_unit: Option<f64>,
    /// Prints what came out as JSON.
    #[arg(long)]
    json: bool,
    /// The mesh: .ply or .glb.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// A camera with what it shows.
struct Shot {
    name: String,
    view: View,
    picture: Option<RgbImage>,
}

impl Hull {
    pub(crate) fn run(self) -> Result<()> {
        let ending = ending(&self.out);
        ensure!(
            ["ply", "glb"].contains(&ending.as_str()),
            "--out {}: expected .ply or .glb",
            self.out.display()
        );
        ensure!((0.0..=100.0).contains(&self.simplify_px), "--simplify-px: expected 0 to 100");
        ensure!(RESOLUTION.contains(&self.resolution), "--resolution: expected {RESOLUTION:?}");
        let cameras = self.read_cameras()?;
        let (held, used): (Vec<Shot>, Vec<Shot>) = self
            .shots(cameras)?
            .into_iter()
            .partition(|shot| self.hold_back.iter().any(|name| is_same(name, &shot.name)));
        let views: Vec<View> = used.iter().map(|shot| shot.view.clone()).collect();
        let least_seen = self.least_seen.unwrap_or_else(|| (3 * views.len() / 4).max(2));
        let visual_hull = VisualHull::new(views, least_seen)?;
        let bounds = match self.bounds {
            Some(bounds) => bounds,
            None => Bounds::of(&visual_hull)?,
        };
        let mut mesh = hull::extract(&visual_hull, &bounds, (self.method, self.resolution))?;
        if used.iter().any(|shot| shot.picture.is_some()) {
            let pictures: Vec<Option<RgbImage>> = used.iter().map(|shot| shot.picture.clone()).collect();
            hull::paint(&mut mesh, &visual_hull, &pictures);
        }
        mesh.check()?;
        let path = self.out.display();
        let mut file =
            BufWriter::new(File::create(&self.out).with_context(|| format!("cannot make {path}"))?);
        let written = if ending == "ply" { mesh.write_ply(&mut file) } else { mesh.write_glb(&mut file) };
        written.with_context(|| format!("cannot write {path}"))?;
        file.flush().with_context(|| format!("cannot write {path}"))?;
        self.tell(&mesh, &bounds, (&used, &held))
    }

    fn read_cameras(&self) -> Result<Vec<PictureCamera>> {
        let folders: Vec<&Path> =
            [&self.images, &self.silhouettes].into_iter().flatten().map(PathBuf::as_path).collect();
        import_cameras(&self.cameras, self.format, &folders, self.metres_per_unit)
    }

    /// Every camera that has a silhouette.
    fn shots(&self, cameras: Vec<PictureCamera>) -> Result<Vec<Shot>> {
        check_names("--hold-back", &self.hold_back, &cameras)?;
        let mut shots = Vec::new();
        for PictureCamera { name, camera } in cameras {
            let read_from = |folder: &Option<PathBuf>| match folder.as_deref().and_then(|of| find(of, &name))
            {
                Some(file) => read(&file).map(Some),
                None => Ok(None),
            };
            let picture = read_from(&self.images)?;
            let mask = match read_from(&self.silhouettes)? {
                Some(mask) => {
                    let mask = mask.into_luma8();
                    Some((mask.width() as usize, mask.into_raw().into_iter().map(|code| code > 0).collect()))
                }
                None if self.silhouettes.is_some() => None,
                None => picture.as_ref().map(|picture| self.silhouette(picture)),
            };
            let Some((width, is_inside)) = mask else {
                super::complain(&format!("camera {name} has no picture and is left out"));
                continue;
            };
            let is_inside = match width {
                1.. if self.largest => hull::largest((width, is_inside.len() / width), &is_inside),
                _ => is_inside,
            };
            let view = View::new(camera, (width, is_inside), self.simplify_px)
                .with_context(|| format!("camera {name}"))?;
            if view.n_inside() == 0 {
                bail!(
                    "camera {name}: its silhouette is empty, which leaves no hull; take the picture away or mend it"
                );
            }
            shots.push(Shot { name, view, picture: picture.map(rgb) });
        }
        Ok(shots)
    }

    /// Of a picture that is transparent in part, what is not; of any other what differs from its border.
    fn silhouette(&self, picture: &DynamicImage) -> (usize, Vec<bool>) {
        let width = picture.width() as usize;
        if picture.color().has_alpha() {
            let alphas: Vec<u8> = picture.to_rgba8().chunks_exact(4).map(|pixel| pixel[3]).collect();
            if alphas.iter().any(|alpha| *alpha < 128) {
                return (width, alphas.into_iter().map(|alpha| alpha >= 128).collect());
            }
        }
        (width, hull::silhouette(&rgb(picture.clone()), self.threshold))
    }

    fn tell(&self, mesh: &Mesh, bounds: &Bounds, (used, held): (&[Shot], &[Shot])) -> Result<()> {
        let [low, high] = mesh.bounds().context("the mesh is empty")?;
        let seen = |shot: &Shot| (shot.name.clone(), Agreement::of(mesh, &shot.view));
        let (used, held): (Vec<_>, Vec<_>) =
            (used.iter().map(seen).collect(), held.iter().map(seen).collect());
        if self.json {
            let listed = |all: &[(String, Agreement)]| {
                let one = |(name, seen): &(String, Agreement)| serde_json::json!({ "camera": name, "covered": seen.covered(), "overlap": seen.overlap() });
                all.iter().map(one).collect::<Vec<_>>()
            };
            let told = serde_json::json!({
                "method": self.method.name(),
                "vertices": mesh.positions_m.len(),
                "triangles": mesh.triangles.len(),
                "low_m": low.to_array(),
                "high_m": high.to_array(),
                "volume_m3": mesh.volume_m3(),
                "bounds_m": [bounds.low.to_array(), bounds.high.to_array()],
                "mended": mesh.n_mended,
                "used": listed(&used),
                "held_back": listed(&held),
            });
            return super::say(&serde_json::to_string_pretty(&told)?);
        }
        let point = |of: DVec3| format!("{:.5} {:.5} {:.5}", of.x, of.y, of.z);
        super::say(&format!("{} vertices, {} triangles", mesh.positions_m.len(), mesh.triangles.len()))?;
        super::say(&format!(
            "from {} to {}, {:.6e} cubic metres",
            point(low),
            point(high),
            mesh.volume_m3()
        ))?;
        for (what, all) in [("used", &used), ("held back", &held)] {
            for (name, seen) in all {
                let (covered, overlap) = (100.0 * seen.covered(), 100.0 * seen.overlap());
                super::say(&format!(
                    "{what} {name}: {covered:.2} % of the silhouette covered, overlap {overlap:.2} %"
                ))?;
            }
        }
        Ok(())
    }
}

fn parse_bounds(text: &str) -> Result<Bounds, String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse::<f64>()).collect();
    let wrong = || "expected X0,Y0,Z0,X1,Y1,Z1, the second corner greater in each".to_owned();
    match numbers.map_err(|_no_number| wrong())?[..] {
        [x0, y0, z0, x1, y1, z1] => {
            Bounds::new(DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1)).ok_or_else(wrong)
        }
        _ => Err(wrong()),
    }
}
