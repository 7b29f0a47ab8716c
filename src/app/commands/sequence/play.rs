//! `sequence play`: pictures of a sequence as somebody sees it who plays it.

use crate::commands::parse::{parse_point, parse_size};
use crate::commands::progress::Progress;
use crate::commands::{complain, say};
use anyhow::{Context as _, Result, bail, ensure};
use glam::{DQuat, DVec3};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Duration;
use videofields_recording::timeline::{MAX_RATE, Playhead};
use videofields_service::sequence::{CacheCounts, Look, Mixing, Player, PlayerSettings, Sequence};
use videofields_vision::clock::{Clock as _, SystemClock};
use videofields_vision::encode;
use videofields_vision::frame::{CameraId, Mask, RgbImage};
use videofields_vision::geometry::Camera;

/// What is behind a sequence, 8-bit sRGB.
const BEHIND: [u8; 3] = [46, 50, 58];

/// Renders pictures of a sequence while it is played, on the processor.
///
/// Frames that are missing or cannot be read are told, and show nothing; the others go on, and the command fails at its end.
#[derive(Debug, clap::Args)]
pub(super) struct Play {
    /// The manifest, or its folder.
    #[arg(long, value_name = "FILE|DIR")]
    manifest: PathBuf,
    /// Folder for the pictures: 00000.png, 00001.png, ...; made if it is not there.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Looks from one of the sequence's cameras, in its picture's size.
    #[arg(long = "view", value_name = "CAMERA", value_parser = parse_id, conflicts_with_all = ["eye", "target", "hold_back"])]
    view: Option<CameraId>,
    /// Leaves a camera out, looks from there, and tells how far what is seen is from what the camera saw.
    #[arg(long, value_name = "CAMERA", value_parser = parse_id, conflicts_with_all = ["eye", "target", "orbit"])]
    hold_back: Option<CameraId>,
    /// Where the eye is, metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true, requires = "target")]
    eye: Option<DVec3>,
    /// Where it looks, metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true, requires = "eye")]
    target: Option<DVec3>,
    /// Vertical field of view, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 45.0)]
    fov: f64,
    /// Columns and rows.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size, default_value = "960x540")]
    size_px: [u32; 2],
    /// Turns the eye around its target by so many degrees from the first picture to the last, against the clock as seen from above.
    #[arg(long, value_name = "DEGREES", requires = "eye", allow_hyphen_values = true)]
    orbit: Option<f64>,
    /// Seconds after the first frame at which playing begins; its end where --rate is below 0, if absent.
    #[arg(long, value_name = "SECONDS")]
    from: Option<f64>,
    /// Seconds after the first frame at which playing ends; the last frame if absent (the first where --rate is below 0).
    #[arg(long, value_name = "SECONDS")]
    to: Option<f64>,
    /// Pictures a second.
    #[arg(long, value_name = "RATE", default_value_t = 25.0)]
    fps: f64,
    /// Seconds of the sequence a second, -8 to 8 and not 0.
    #[arg(long, value_name = "RATE", default_value_t = 1.0, allow_hyphen_values = true)]
    rate: f64,
    /// How colours are mixed: off (one camera a place), normals, montage (texture fields).
    #[arg(long, default_value = "montage")]
    fields: Mixing,
    /// Memory for frames that are ready, MiB.
    #[arg(long, value_name = "MIB", default_value_t = 512)]
    cache_mib: usize,
    /// Tells what came out as JSON.
    #[arg(long)]
    json: bool,
}

/// What came out.
#[derive(Debug, Default, Serialize)]
struct Outcome {
    n_pictures: u64,
    /// Pictures that show nothing since there was no frame, or none that could be read.
    n_without: u64,
    /// Frames that cannot be read, by what is wrong.
    broken: Vec<String>,
    /// Frames that were shown.
    n_frames: usize,
    n_points_mended: usize,
    n_triangles_mended: usize,
    n_extruded: usize,
    ms_per_picture: f64,
    cache: Option<CacheCounts>,
    held_back: Option<HeldBack>,
}

/// How far pictures are from those of a camera that was held back, in the mean.
#[derive(Debug, Default, Serialize)]
struct HeldBack {
    n_compared: u64,
    rmse: f64,
    psnr_db: f64,
    ssim: f64,
}

impl Play {
    pub(super) fn run(self) -> Result<()> {
        ensure!((0.1..=1000.0).contains(&self.fps), "--fps: expected 0.1 to 1000 pictures a second");
        ensure!(
            self.rate.abs() <= MAX_RATE && self.rate.abs() >= 0.01,
            "--rate: expected 0.01 to 8, either way"
        );
        std::fs::create_dir_all(&self.out).with_context(|| format!("cannot make {}", self.out.display()))?;
        let mut sequence = super::open(&self.manifest)?;
        let mut truth = None;
        let mut viewer = self.viewer(&sequence)?;
        if let Some(id) = &self.hold_back {
            let place = place_of(&sequence, id)?;
            viewer = Some(sequence.cameras()[place].camera.clone());
            sequence = sequence.without(std::slice::from_ref(id));
            truth = Some((super::open(&self.manifest)?, place));
        }
        let Some(viewer) = viewer else {
            bail!("name where to look from: --view, --hold-back, or --eye and --target")
        };
        let settings = PlayerSettings {
            mixing: self.fields,
            cache_bytes: self.cache_mib.saturating_mul(1 << 20),
            ..PlayerSettings::default()
        };
        self.play(Player::new(sequence, settings), &viewer, truth)
    }

    fn viewer(&self, sequence: &Sequence) -> Result<Option<Camera>> {
        if let Some(id) = &self.view {
            return Ok(Some(sequence.cameras()[place_of(sequence, id)?].camera.clone()));
        }
        let (Some(eye), Some(target)) = (self.eye, self.target) else { return Ok(None) };
        Ok(Some(Camera::pinhole(eye, target, self.fov.to_radians(), self.size_px.into())?))
    }

    /// From where the picture is seen that is such a share of the way from the first to the last.
    fn turned(&self, viewer: &Camera, share: f64) -> Result<Camera> {
        let (Some(eye), Some(target), Some(orbit)) = (self.eye, self.target, self.orbit) else {
            return Ok(viewer.clone());
        };
        let turn = DQuat::from_rotation_z((orbit * share).to_radians());
        Ok(Camera::pinhole(
            target + turn * (eye - target),
            target,
            self.fov.to_radians(),
            self.size_px.into(),
        )?)
    }

    fn play(self, mut player: Player, viewer: &Camera, mut truth: Option<(Sequence, usize)>) -> Result<()> {
        let clock = SystemClock::new();
        let extent = player.extent();
        let start = extent.first.unwrap_or(extent.live);
        let length_secs = extent.live.secs_since(start);
        let [first, last] = if self.rate > 0.0 { [0.0, length_secs] } else { [length_secs, 0.0] };
        let (from, to) = (self.from.unwrap_or(first), self.to.unwrap_or(last));
        ensure!(from.is_finite() && to.is_finite(), "--from, --to: expected seconds");
        let n_pictures = ((to - from) / self.rate * self.fps + 1e-9).floor() + 1.0;
        ensure!(
            (1.0..=1e6).contains(&n_pictures),
            "--from {from} --to {to} --rate {}: nothing is played",
            self.rate
        );
        let n_pictures = n_pictures as u64;
        // The machine's time counts in pictures: nothing is left out, however long one takes.
        let mut playhead = Playhead::default();
        playhead.seek(start.saturating_add_nanos((from * 1e9).round() as i64), Duration::ZERO);
        playhead.set_rate(self.rate, Duration::ZERO, extent);
        playhead.play(Duration::ZERO, extent);
        let (mut outcome, mut shown, mut broken) = (Outcome::default(), BTreeSet::new(), BTreeSet::new());
        let mut held = HeldBack::default();
        let mut progress = Progress::new();
        let started = clock.monotonic();
        for picture in 0..n_pictures {
            let now = Duration::from_nanos((picture as f64 / self.fps * 1e9).round() as u64);
            let at = player.position(&playhead, now);
            let camera = self.turned(viewer, picture as f64 / (n_pictures - 1).max(1) as f64)?;
            let look = match player.look(at, &camera) {
                Ok(look) => Some(look),
                Err(error) => {
                    outcome.n_without += 1;
                    if broken.insert(error.to_string()) {
                        progress.finish();
                        complain(&error.to_string());
                    }
                    None
                }
            };
            if let Some(look) = &look
                && shown.insert(look.moment.number)
            {
                let moment = &look.moment;
                outcome.n_points_mended += moment.mended.n_points;
                outcome.n_triangles_mended += moment.mended.n_triangles;
                outcome.n_extruded += moment.n_extruded;
                for (camera, reason) in
                    moment.blind.iter().filter_map(|(camera, reason)| Some((camera, reason.as_ref()?)))
                {
                    let id = &player.sequence().cameras()[*camera].id;
                    complain(&format!("frame {}, camera {id} is blind: {reason}", moment.number));
                }
            }
            if let (Some(look), Some((truth, place))) = (&look, &mut truth) {
                compare(look, (truth, *place), &mut held)?;
            }
            let path = self.out.join(format!("{picture:05}.png"));
            std::fs::write(&path, encode::png_rgb(&before(look.as_ref(), &camera))?)
                .with_context(|| format!("cannot write {}", path.display()))?;
            progress.show(|| format!("picture {} of {n_pictures}", picture + 1));
        }
        progress.finish();
        outcome.ms_per_picture =
            clock.monotonic().saturating_sub(started).as_secs_f64() * 1e3 / n_pictures as f64;
        outcome.n_pictures = n_pictures;
        outcome.n_frames = shown.len();
        outcome.cache = Some(player.counts());
        outcome.broken = broken.into_iter().collect();
        outcome.held_back = truth.is_some().then(|| held.mean());
        self.tell(&outcome)?;
        if outcome.n_without > 0 {
            bail!("{} of {n_pictures} pictures show no frame", outcome.n_without);
        }
        Ok(())
    }

    fn tell(&self, outcome: &Outcome) -> Result<()> {
        if self.json {
            return say(&serde_json::to_string_pretty(outcome)?);
        }
        say(&format!(
            "{} pictures of {} frames, {:.0} ms each; superfluous: {} points, {} triangles; drawn out, and not coloured: {} triangles",
            outcome.n_pictures,
            outcome.n_frames,
            outcome.ms_per_picture,
            outcome.n_points_mended,
            outcome.n_triangles_mended,
            outcome.n_extruded
        ))?;
        if let Some(cache) = outcome.cache {
            say(&format!(
                "frames read {}, found ready {}, let go {}; {} ready in {:.1} MiB",
                cache.n_read,
                cache.n_found,
                cache.n_gone,
                cache.n_kept,
                cache.n_bytes as f64 / f64::from(1 << 20)
            ))?;
        }
        if let Some(HeldBack { n_compared, rmse, psnr_db, ssim }) = &outcome.held_back {
            say(&format!(
                "against {n_compared} pictures: RMSE {rmse:.2}, PSNR {psnr_db:.2} dB, SSIM {ssim:.4}"
            ))?;
        }
        Ok(())
    }
}

impl HeldBack {
    fn mean(self) -> Self {
        let n = self.n_compared.max(1) as f64;
        Self { rmse: self.rmse / n, psnr_db: self.psnr_db / n, ssim: self.ssim / n, ..self }
    }
}

fn parse_id(text: &str) -> Result<CameraId, String> {
    CameraId::new(text).map_err(|error| error.to_string())
}

fn place_of(sequence: &Sequence, id: &CameraId) -> Result<usize> {
    let cameras = sequence.cameras();
    cameras.iter().position(|camera| camera.id == *id).with_context(|| {
        let names: Vec<&str> = cameras.iter().map(|camera| camera.id.as_str()).collect();
        format!("there is no camera {id}; there are {}", names.join(", "))
    })
}

/// What is seen before what is behind it.
fn before(look: Option<&Look>, camera: &Camera) -> RgbImage {
    let (width, height) = camera.size_px();
    let plain = || RgbImage { width, height, data: BEHIND.repeat(width as usize * height as usize) };
    let Some((look, shaded)) = look.and_then(|look| Some((look, look.shaded.as_ref()?))) else {
        return plain();
    };
    let mut picture = shaded.picture.clone();
    for (pixel, is_there) in picture.data.as_chunks_mut().0.iter_mut().zip(&look.is_mesh) {
        if !is_there {
            *pixel = BEHIND;
        }
    }
    picture
}

/// Adds how far a picture is from the one that a camera took of the same frame, where the mesh is covered and the camera saw it.
fn compare(look: &Look, (truth, place): (&mut Sequence, usize), held: &mut HeldBack) -> Result<()> {
    let Some(shaded) = &look.shaded else { return Ok(()) };
    let idx = truth.frame_at(look.moment.at)?;
    let Some(seen) = truth.picture(idx, place)? else { return Ok(()) };
    let mut covered = shaded.covered.clone();
    if let Some(mask) = truth.mask(idx, place)? {
        narrow(&mut covered, &mask);
    }
    if (seen.width, seen.height) != (covered.width, covered.height)
        || covered.data.iter().all(|value| *value == 0)
    {
        return Ok(());
    }
    let evened = videofields_vision::measures::exposed_like(&seen, &shaded.picture, &covered);
    let found = videofields_vision::measures::compare(&evened, &shaded.picture, Some(&covered))?;
    held.n_compared += 1;
    held.rmse += found.rmse;
    // Equal pictures have no bound; such a number is told as what 8 bits tell at best.
    held.psnr_db += found.psnr_db.unwrap_or(EQUAL_DB);
    held.ssim += found.ssim;
    Ok(())
}

/// In place of no difference at all.
const EQUAL_DB: f64 = 99.0;

/// Takes out of a mask what another of the same size does not have.
fn narrow(covered: &mut Mask, mask: &Mask) {
    if (mask.width, mask.height) == (covered.width, covered.height) {
        covered.data.iter_mut().zip(mask.data.iter()).for_each(|(own, other)| *own = (*own).min(*other));
    }
}
