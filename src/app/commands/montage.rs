//! `montage`: a mesh coloured by calibrated pictures of it, as from a camera that is held back.

use super::pictures::{check_names, ending, find, import_cameras, is_same, read, rgb, short};
use anyhow::{Context as _, Result, bail, ensure};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;
use videofields_vision::calibrate::{PictureCamera, SetFormat};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::encode;
use videofields_vision::fields::{
    Blend, Distances, Field, FieldSettings, Preference, Shaded, Topology, View, Visibility, VoteLevels,
    Weights, shade,
};
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::mesh::{Mesh, Raster};

/// Most triangles of a mesh.
const MAX_TRIANGLES: usize = 1 << 21;

/// Colours a mesh by calibrated pictures of it, as seen from cameras that are held back, and tells how far that is from what they saw.
///
/// Every camera that is named by --hold-back (or each in turn with --each) is left out; the others lend their colours to the mesh by
/// several ways side by side: `best` takes the one that looks most as the camera does, `normals` mixes all by how straight they look at
/// the surface (Holoportation's way), `filtered` does so in so coarse a level of detail that no ghost is seen, `floating` where optical
/// flow between the pictures says that they show the same, and `fields` by texture fields (Du et al. 2019). The mesh is in the cameras' units and axes.
#[derive(Debug, clap::Args)]
pub(crate) struct Montage {
    /// The mesh: .ply or .obj.
    #[arg(long, value_name = "FILE")]
    mesh: PathBuf,
    /// The cameras' file.
    #[arg(long, value_name = "FILE")]
    cameras: PathBuf,
    /// middlebury, opencv, kitti or nerf; told from the text if absent.
    #[arg(long)]
    format: Option<SetFormat>,
    /// Folder of the pictures.
    #[arg(long, value_name = "DIR")]
    images: PathBuf,
    /// Folder of masks: pictures of the cameras' names, black where the picture shows something else than the mesh.
    #[arg(long, value_name = "DIR")]
    masks: Option<PathBuf>,
    /// Cameras that are left out together and compared with.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', required_unless_present = "each")]
    hold_back: Vec<String>,
    /// Leaves each camera out in turn.
    #[arg(long, conflicts_with = "hold_back")]
    each: bool,
    /// Ways of mixing: best, normals, filtered, floating, fields.
    #[arg(long, value_name = "WAY,...", value_delimiter = ',', default_value = "best,normals,fields")]
    ways: Vec<Way>,
    /// How hidden vertices are found: facing, depths, dilated, rays.
    #[arg(long, default_value = "dilated")]
    visibility: Visibility,
    /// Texels of depth maps along their longer side.
    #[arg(long, value_name = "TEXELS", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(16..=8192))]
    depth_map_px: u32,
    /// Levels of detail in which cameras vote on each other, the coarsest first, such as 4-6; if absent every camera is believed.
    #[arg(long, value_name = "FINEST-COARSEST")]
    vote: Option<VoteLevels>,
    /// How distances from seams are found: off, marching, bounded, exact.
    #[arg(long, default_value = "exact")]
    distances: Distances,
    /// How far from its seams a camera lends in full, in the mesh's units; if absent what fifteen triangles reach.
    #[arg(long, value_name = "LENGTH")]
    reach: Option<f64>,
    /// How often what weights are made of goes halfway to its neighbours' mean, so that they do not step from vertex to vertex.
    #[arg(long, value_name = "ROUNDS", default_value_t = FieldSettings::default().smoothing_rounds, value_parser = clap::value_parser!(u32).range(0..=1000))]
    smoothing: u32,
    /// Leaves the pictures' exposures and white balances as they are; else those that lend are evened out, and what was held back is
    /// compared with as if it had theirs (one gain a channel).
    #[arg(long)]
    uneven: bool,
    /// Exponent of the cosine between the surface's normal and the direction to a camera.
    #[arg(long, value_name = "NUMBER", default_value_t = FieldSettings::default().normal_exponent)]
    normal_exponent: f64,
    /// How wrong depths are taken to be, in the mesh's units: cameras are preferred whose colours are least beside where the viewer sees
    /// them. What sixteen of the finest pixels measure on the mesh if absent, and no less than half of its mean edge.
    #[arg(long, value_name = "LENGTH")]
    depth_error: Option<f64>,
    /// Prefers cameras that look as the viewer does instead, as Du et al. have it: by the cosine between both directions to this power.
    #[arg(long, value_name = "NUMBER", conflicts_with = "depth_error")]
    view_exponent: Option<f64>,
    /// Exponent of the share of all vertices that a camera sees.
    #[arg(long, value_name = "NUMBER", default_value_t = FieldSettings::default().coverage_exponent)]
    coverage_exponent: f64,
    /// Folder for the pictures: what the camera saw, and every way's.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Prints what came out as JSON.
    #[arg(long)]
    json: bool,
}

/// A way of mixing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Way {
    Best,
    Normals,
    Filtered,
    Floating,
    Fields,
}

impl Way {
    const fn name(self) -> &'static str {
        match self {
            Self::Best => "best",
            Self::Normals => "normals",
            Self::Filtered => "filtered",
            Self::Floating => "floating",
            Self::Fields => "fields",
        }
    }
}

/// How far one way's picture is from what a camera saw, where the mesh is covered.
#[derive(Clone, Debug, Serialize)]
struct Score {
    camera: String,
    way: &'static str,
    rmse: f64,
    psnr_db: Option<f64>,
    ssim: f64,
    /// What changes of the weights add to steps from one pixel to the next, in the mean, 8-bit codes.
    seam_energy: Option<f64>,
    /// The same as a root of the mean of squares.
    seam_sharpness: Option<f64>,
    /// Seam energy over what the pictures have themselves.
    seam_ratio: Option<f64>,
    n_pixels: u64,
    ms: f64,
}

struct Shot {
    name: String,
    view: View,
}

impl Montage {
    pub(crate) fn run(self) -> Result<()> {
        let clock = SystemClock::new();
        ensure!(
            self.reach.is_none_or(|reach| reach.is_finite() && reach > 0.0),
            "--reach: expected a length above 0"
        );
        ensure!(
            self.depth_error.is_none_or(|depth| depth.is_finite() && depth >= 0.0),
            "--depth-error: expected a length of 0 or more"
        );
        for (flag, value) in [
            ("--view-exponent", self.view_exponent.unwrap_or_default()),
            ("--normal-exponent", self.normal_exponent),
            ("--coverage-exponent", self.coverage_exponent),
        ] {
            ensure!((0.0..=1000.0).contains(&value), "{flag}: expected 0 to 1000");
        }
        if let Some(folder) = &self.out {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let mesh = read_mesh(&self.mesh)?;
        let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
        let shots = self.shots()?;
        let held: Vec<Vec<String>> = if self.each {
            shots.iter().map(|shot| vec![shot.name.clone()]).collect()
        } else {
            vec![self.hold_back.clone()]
        };
        let mut scores = Vec::new();
        for names in &held {
            let is_held = |shot: &&Shot| names.iter().any(|name| is_same(name, &shot.name));
            let mut views: Vec<View> =
                shots.iter().filter(|shot| !is_held(shot)).map(|shot| shot.view.clone()).collect();
            let started = clock.monotonic();
            let field = Field::new(&mesh, &topology, &mut views, &self.settings())?;
            let took = clock.monotonic().saturating_sub(started);
            self.tell_field(&field, (&mesh, took))?;
            for shot in shots.iter().filter(is_held) {
                scores.extend(self.held_back(shot, &mesh, (&field, &views), &clock)?);
            }
        }
        self.tell(&scores)
    }

    fn settings(&self) -> FieldSettings {
        FieldSettings {
            visibility: self.visibility,
            depth_map_px: self.depth_map_px,
            vote: self.vote,
            distances: self.distances,
            reach_m: self.reach,
            smoothing_rounds: self.smoothing,
            is_evened: !self.uneven,
            preference: match self.view_exponent {
                Some(exponent) => Preference::Directions { exponent },
                None => Preference::Errors { depth_m: self.depth_error, exponent: 4.0 },
            },
            coverage_exponent: self.coverage_exponent,
            normal_exponent: self.normal_exponent,
        }
    }

    /// Every camera that has a picture.
    fn shots(&self) -> Result<Vec<Shot>> {
        let cameras = import_cameras(&self.cameras, self.format, &[&self.images], None)?;
        check_names("--hold-back", &self.hold_back, &cameras)?;
        let mut shots = Vec::new();
        for PictureCamera { name, camera } in cameras {
            let Some(file) = find(&self.images, &name) else {
                super::complain(&format!("camera {name} has no picture and is left out"));
                continue;
            };
            let picture = rgb(read(&file)?);
            let mask = self.masks.as_deref().and_then(|folder| find(folder, &name));
            let mask = mask.map(|file| read(&file)).transpose()?.map(|mask| {
                let mask = mask.into_luma8();
                Mask { width: mask.width(), height: mask.height(), data: mask.into_raw().into() }
            });
            shots.push(Shot { name, view: View::new(camera, picture, mask) });
        }
        ensure!(shots.len() >= 2, "expected at least two cameras with pictures, got {}", shots.len());
        Ok(shots)
    }

    /// One camera that was held back, by every way.
    fn held_back(
        &self,
        shot: &Shot,
        mesh: &Mesh,
        (field, views): (&Field, &[View]),
        clock: &dyn Clock,
    ) -> Result<Vec<Score>> {
        let (camera, truth) = (shot.view.camera(), shot.view.picture());
        let raster = Raster::of(mesh, camera, [truth.width as usize, truth.height as usize]);
        let target = field.target(mesh, views, shot.view.eye());
        let by_normals = field.by_normals();
        let drawn = |way: Way| -> (Shaded, Duration) {
            let started = clock.monotonic();
            let (weights, blend): (&Weights, Blend) = match way {
                Way::Best => (&target, Blend::Best),
                Way::Normals => (&by_normals, Blend::Mixed),
                // Depths are taken to be wrong by an edge's length or so.
                Way::Filtered => (&by_normals, Blend::Filtered { error_m: field.reach_m() / 5.0 }),
                Way::Floating => (&by_normals, Blend::Floating),
                Way::Fields => (&target, Blend::Mixed),
            };
            let shaded = shade((mesh, &raster), camera, (field, views, weights), blend);
            (shaded, clock.monotonic().saturating_sub(started))
        };
        let all: Vec<(Way, Shaded, Duration)> = self
            .ways
            .iter()
            .map(|way| {
                let (shaded, took) = drawn(*way);
                (*way, shaded, took)
            })
            .collect();
        // Where all ways show something, so that all are judged on the same pixels.
        let mut covered = Mask::filled(truth.width, truth.height, 255);
        for (_, shaded, _) in &all {
            covered
                .data
                .iter_mut()
                .zip(shaded.covered.data.iter())
                .for_each(|(all, own)| *all = (*all).min(*own));
        }
        if covered.data.iter().all(|value| *value == 0) {
            bail!("{}: nothing of the mesh is seen by it and by others", shot.name);
        }
        if let Some(folder) = &self.out {
            write(folder, &format!("{}-photograph.png", short(&shot.name)), truth)?;
        }
        let mut scores = Vec::new();
        for (way, shaded, took) in &all {
            let evened = (!self.uneven)
                .then(|| videofields_vision::measures::exposed_like(truth, &shaded.picture, &covered));
            let comparison = videofields_vision::measures::compare(
                evened.as_ref().unwrap_or(truth),
                &shaded.picture,
                Some(&covered),
            )?;
            scores.push(Score {
                camera: short(&shot.name),
                way: way.name(),
                rmse: comparison.rmse,
                psnr_db: comparison.psnr_db,
                ssim: comparison.ssim,
                seam_energy: shaded.steps.energy(),
                seam_sharpness: shaded.steps.sharpness(),
                seam_ratio: shaded.steps.ratio(),
                n_pixels: comparison.n_pixels,
                ms: took.as_secs_f64() * 1e3,
            });
            if let Some(folder) = &self.out {
                write(folder, &format!("{}-{}.png", short(&shot.name), way.name()), &shaded.picture)?;
                let owners = painted(&shaded.owners, views.len());
                write(folder, &format!("{}-{}-owners.png", short(&shot.name), way.name()), &owners)?;
            }
        }
        Ok(scores)
    }

    fn tell_field(&self, field: &Field, (mesh, took): (&Mesh, Duration)) -> Result<()> {
        if self.json {
            return Ok(());
        }
        super::say(&format!(
            "{} triangles, {} views, reach {:.4}: {:.0} ms",
            mesh.triangles.len(),
            field.n_views(),
            field.reach_m(),
            took.as_secs_f64() * 1e3
        ))?;
        for (view, (seams, share)) in field.seams().iter().zip(field.shares()).enumerate() {
            super::say(&format!(
                "  view {view}: sees {:.1} % of the vertices; seams by hiding {}, by votes {}, by borders {}",
                100.0 * share,
                seams.n_hidden,
                seams.n_outvoted,
                seams.n_beside
            ))?;
        }
        Ok(())
    }

    fn tell(&self, scores: &[Score]) -> Result<()> {
        if self.json {
            return super::say(&serde_json::to_string_pretty(scores)?);
        }
        let line = |score: &Score| {
            let of = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2}"));
            super::say(&format!(
                "{:<12} {:<9} RMSE {:6.2}  PSNR {:>6} dB  SSIM {:.4}  seam energy {:>6} sharpness {:>5} ratio {:>5}  {} pixels, {:.0} ms",
                score.camera,
                score.way,
                score.rmse,
                of(score.psnr_db),
                score.ssim,
                score.seam_energy.map_or_else(|| "-".to_owned(), |value| format!("{value:.4}")),
                of(score.seam_sharpness),
                of(score.seam_ratio),
                score.n_pixels,
                score.ms
            ))
        };
        scores.iter().try_for_each(line)?;
        for way in &self.ways {
            let of: Vec<&Score> = scores.iter().filter(|score| score.way == way.name()).collect();
            let mean = |value: &dyn Fn(&Score) -> Option<f64>| {
                let values: Vec<f64> = of.iter().filter_map(|score| value(score)).collect();
                (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
            };
            line(&Score {
                camera: "mean".to_owned(),
                way: way.name(),
                rmse: mean(&|score| Some(score.rmse)).unwrap_or_default(),
                psnr_db: mean(&|score| score.psnr_db),
                ssim: mean(&|score| Some(score.ssim)).unwrap_or_default(),
                seam_energy: mean(&|score| score.seam_energy),
                seam_sharpness: mean(&|score| score.seam_sharpness),
                seam_ratio: mean(&|score| score.seam_ratio),
                n_pixels: of.iter().map(|score| score.n_pixels).sum(),
                ms: mean(&|score| Some(score.ms)).unwrap_or_default(),
            })?;
        }
        Ok(())
    }
}

fn read_mesh(file: &Path) -> Result<Mesh> {
    let path = file.display();
    let bytes = std::fs::read(file).with_context(|| format!("cannot read {path}"))?;
    let mesh = match ending(file).as_str() {
        "ply" => Mesh::read_ply(&bytes, MAX_TRIANGLES),
        "obj" => Mesh::read_obj(&bytes, MAX_TRIANGLES),
        _ => bail!("--mesh {path}: expected .ply or .obj"),
    };
    let (mesh, mended) = mesh.with_context(|| format!("cannot read {path}"))?.mended();
    if !mended.is_none() {
        super::complain(&format!(
            "{path}: {} points and {} triangles were superfluous",
            mended.n_points, mended.n_triangles
        ));
    }
    Ok(mesh)
}

fn write(folder: &Path, name: &str, picture: &RgbImage) -> Result<()> {
    let path = folder.join(name);
    std::fs::write(&path, encode::png_rgb(picture)?)
        .with_context(|| format!("cannot write {}", path.display()))
}

/// Which view lends most, as colours that are far apart.
fn painted(owners: &Mask, n_views: usize) -> RgbImage {
    let color = |owner: u8| -> [u8; 3] {
        if usize::from(owner) >= n_views {
            return [0; 3];
        }
        let hue = f32::from(owner) / n_views as f32 * 6.0;
        let channel = |over: f32| {
            let at = (hue + over).rem_euclid(6.0);
            (255.0 * (2.0 - (at - 3.0).abs()).clamp(0.0, 1.0)) as u8
        };
        [channel(3.0), channel(1.0), channel(5.0)]
    };
    let data = owners.data.iter().flat_map(|owner| color(*owner)).collect();
    RgbImage { width: owners.width, height: owners.height, data }
}
