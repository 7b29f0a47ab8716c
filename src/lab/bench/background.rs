//! `bench background`: the mixture beside OpenCV's.

use anyhow::{Context, Result, bail, ensure};
use image::imageops::{FilterType, resize};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use videofields_picture::plan::Spread;
use videofields_recording::ingest::{self, MediaRoots};
use videofields_vision::background::{Format, GaussianMixture, Hints, ReferenceMixture, simd_levels};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{BackgroundSettings, SourceSettings, Timing};
use videofields_vision::frame::{YuvImage, YuvLayout};

/// Times the background mixture against OpenCV's MOG2 on the same frames.
///
/// The clip is played forward and back; the first frames are learned and not timed. Every form has its
/// turn in every run, so that what else the machine does falls on all alike. Both sides learn at the same rates, with
/// three modes a pixel and without shadows; the mixture takes the decoder's planes and the frame before, MOG2 the same frames as BGR, and
/// neither's conversion is timed. MOG2 runs where --python names an interpreter that can import cv2.
#[derive(Debug, clap::Args)]
pub(super) struct Background {
    /// A video file, or a pattern of numbered pictures such as in%06d.jpg.
    #[arg(long, value_name = "FILE|PATTERN")]
    input: PathBuf,
    /// Frames are scaled to this size; the clip's own if absent.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size_px)]
    size_px: Option<(u32, u32)>,
    /// Frames of the clip that are played.
    #[arg(long, value_name = "COUNT", default_value_t = 100, value_parser = clap::value_parser!(u32).range(2..=1000))]
    frames: u32,
    /// Frames that are learned before the first is timed.
    #[arg(long, value_name = "COUNT", default_value_t = 600, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    warm_up: u32,
    /// Times that every form is run.
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
    runs: u32,
    /// Numbers of threads.
    #[arg(long, value_name = "COUNT", value_delimiter = ',', default_values_t = [1, 2])]
    threads: Vec<usize>,
    /// An interpreter that can import cv2.
    #[arg(long, value_name = "PROGRAM")]
    python: Option<PathBuf>,
    /// A form of the mixture that is timed, such as AVX2 or twin; all if absent. Can be given several times.
    #[arg(long = "form", value_name = "NAME")]
    wanted: Vec<String>,
}

fn size_px(text: &str) -> Result<(u32, u32), String> {
    let sides =
        text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    sides
        .filter(|(width, height)| (1..=16_384).contains(width) && (1..=16_384).contains(height))
        .ok_or_else(|| "expected two numbers from 1 to 16384, such as 1280x720".to_owned())
}

/// Seconds between frames.
const STEP_SECS: f64 = 0.1;

/// What is timed.
enum Form {
    Fast(&'static str, fearless_simd::Level),
    Twin,
    OpenCv(Peer),
}

impl Form {
    /// The median over the timed frames, milliseconds.
    fn time(&self, clip: &Clip, n_threads: usize) -> Result<f64> {
        let (settings, format) = (BackgroundSettings::default(), Format::of(&clip.frames[0]));
        match self {
            Self::Fast(_, level) => {
                let mut model = GaussianMixture::with_level(&settings, format, *level);
                let mut previous = None;
                time(clip, |image| {
                    let hints = Hints { previous, ..Hints::default() };
                    previous = Some(image);
                    model.update_with(image, STEP_SECS, hints).is_ok()
                })
            }
            Self::Twin => {
                // What it costs does not depend on what it has learned.
                let clip = &Clip { frames: clip.frames.clone(), n_warm_up: 20 };
                let mut model = ReferenceMixture::new(&settings, format);
                time(clip, |image| model.update(image, STEP_SECS).is_ok())
            }
            Self::OpenCv(peer) => peer.run(n_threads),
        }
    }

    fn name(&self) -> String {
        match self {
            Self::Fast(level, _) => format!("mixture, {level}"),
            Self::Twin => "scalar twin".to_owned(),
            Self::OpenCv(_) => "OpenCV MOG2".to_owned(),
        }
    }
}

impl Background {
    pub(super) fn run(&self) -> Result<()> {
        let clip = Clip { frames: self.frames()?, n_warm_up: self.warm_up as usize };
        let mut forms: Vec<Form> =
            simd_levels().into_iter().map(|(name, level)| Form::Fast(name, level)).collect();
        forms.push(Form::Twin);
        self.choose(&mut forms)?;
        if let Some(python) = &self.python {
            forms.push(Form::OpenCv(Peer::new(python, &clip)?));
        }
        let mut times_ms = vec![vec![Vec::new(); forms.len()]; self.threads.len()];
        for _ in 0..self.runs {
            for (n_threads, times_ms) in self.threads.iter().zip(&mut times_ms) {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(*n_threads).build()?;
                for (form, times_ms) in forms.iter().zip(times_ms) {
                    times_ms.push(pool.install(|| form.time(&clip, *n_threads))?);
                }
            }
        }
        self.tell(&clip, &forms, &times_ms)
    }

    /// Keeps the forms that were asked for.
    fn choose(&self, forms: &mut Vec<Form>) -> Result<()> {
        let names: Vec<String> = forms.iter().map(Form::name).collect();
        for wanted in &self.wanted {
            let is_known = names.iter().any(|name| name.ends_with(wanted.as_str()));
            ensure!(is_known, "--form {wanted}: this machine has {}", names.join(", "));
        }
        forms.retain(|form| {
            self.wanted.is_empty() || self.wanted.iter().any(|wanted| form.name().ends_with(wanted.as_str()))
        });
        Ok(())
    }

    fn tell(&self, clip: &Clip, forms: &[Form], times_ms: &[Vec<Vec<f64>>]) -> Result<()> {
        let format = Format::of(&clip.frames[0]);
        let agreement = Agreement::of(clip)?;
        let fast = GaussianMixture::new(&BackgroundSettings::default(), format).len_bytes();
        let twin = ReferenceMixture::new(&BackgroundSettings::default(), format).len_bytes();
        let n_pixels = f64::from(format.width) * f64::from(format.height);
        let mut out = std::io::stdout().lock();
        writeln!(
            out,
            "{}: {} frames of {format}, medians of {} runs\n",
            self.input.display(),
            clip.frames.len(),
            self.runs
        )?;
        writeln!(out, "| form | threads | ms/frame | quartiles | against MOG2 | state, bytes/pixel |")?;
        writeln!(out, "| --- | ---: | ---: | ---: | ---: | ---: |")?;
        for (n_threads, times_ms) in self.threads.iter().zip(times_ms) {
            let spreads = times_ms.iter().map(|times| Spread::of(times).context("nothing was timed"));
            let spreads = spreads.collect::<Result<Vec<_>>>()?;
            let peer =
                forms.iter().position(|form| matches!(form, Form::OpenCv(_))).map(|idx| spreads[idx].median);
            for (form, spread) in forms.iter().zip(&spreads) {
                let against = peer.map_or("-".to_owned(), |peer| format!("{:.2}", peer / spread.median));
                let bytes = match form {
                    Form::Fast(..) => format!("{:.1}", fast as f64 / n_pixels),
                    Form::Twin => format!("{:.1}", twin as f64 / n_pixels),
                    // Three modes of a weight, a variance and three means in f32, and their number.
                    Form::OpenCv(_) => "61".to_owned(),
                };
                writeln!(
                    out,
                    "| {} | {n_threads} | {:.3} | {:.3} to {:.3} | {against} | {bytes} |",
                    form.name(),
                    spread.median,
                    spread.lower_quartile,
                    spread.upper_quartile
                )?;
            }
        }
        writeln!(
            out,
            "\nForeground {:.2} % of the pixels; IoU of the mixture's and its scalar twin's {:.4}; {:.1} % of the picture \
             looked at in full.",
            100.0 * agreement.foreground_share,
            agreement.iou,
            100.0 * agreement.visited_share
        )?;
        Ok(())
    }

    /// The clip's first frames, scaled.
    fn frames(&self) -> Result<Vec<Arc<YuvImage>>> {
        let settings = SourceSettings {
            timing: Some(Timing::Index),
            rate_hz: 1.0 / STEP_SECS,
            ..SourceSettings::of_path(&self.input)
        };
        let mut source = ingest::open(&settings, &MediaRoots::of_caller(&self.input)?)?;
        let mut frames: Vec<Arc<YuvImage>> = Vec::new();
        while frames.len() < self.frames as usize {
            let Some(next) = source.next_frame()? else { break };
            let size = self.size_px.unwrap_or((next.image.width(), next.image.height()));
            frames.push(Arc::new(scaled(&next.image, size)?));
        }
        ensure!(frames.len() >= 2, "{} holds fewer than 2 frames", self.input.display());
        Ok(frames)
    }
}

/// Bilinear, each plane by itself, into packed planes.
fn scaled(image: &YuvImage, (width, height): (u32, u32)) -> Result<YuvImage> {
    let mut data = Vec::with_capacity(YuvLayout::packed_len(width, height));
    for index in 0..3 {
        let plane = image.plane(index);
        let rows = (0..plane.height).flat_map(|y| plane.row(y)[..plane.width as usize].iter().copied());
        let plane = image::GrayImage::from_raw(plane.width, plane.height, rows.collect())
            .context("a plane has as many samples as its size says")?;
        let (width, height) =
            if index == 0 { (width, height) } else { (width.div_ceil(2), height.div_ceil(2)) };
        data.extend_from_slice(resize(&plane, width, height, FilterType::Triangle).as_raw());
    }
    Ok(YuvImage::new(YuvLayout::packed(width, height), image.matrix(), image.range(), data)?)
}

/// A clip as it is played: forward and back.
struct Clip {
    frames: Vec<Arc<YuvImage>>,
    n_warm_up: usize,
}

impl Clip {
    /// Frames that are played.
    fn n_played(&self) -> usize {
        self.n_warm_up + self.frames.len()
    }

    /// Every frame that is played, in order, and whether it is timed.
    fn play(&self) -> impl Iterator<Item = (&YuvImage, bool)> {
        let n_frames = self.frames.len();
        (0..self.n_played()).map(move |step| {
            // No frame twice in a row at the ends: equal pixels cost less.
            let place = step % (2 * n_frames - 2);
            let idx = if place < n_frames { place } else { 2 * n_frames - 2 - place };
            (&*self.frames[idx], step >= self.n_warm_up)
        })
    }
}

/// The median over the timed frames, milliseconds.
fn time<'a>(clip: &'a Clip, mut step: impl FnMut(&'a YuvImage) -> bool) -> Result<f64> {
    let clock = SystemClock::new();
    let mut times_ms = Vec::with_capacity(clip.frames.len());
    for (image, is_timed) in clip.play() {
        let started = clock.monotonic();
        ensure!(step(image), "a frame is of another size than the first");
        let took = clock.monotonic().saturating_sub(started);
        if is_timed {
            times_ms.push(took.as_secs_f64() * 1e3);
        }
    }
    Spread::of(&times_ms).map(|spread| spread.median).context("nothing was timed")
}

/// What the mixture and its scalar twin make of the same frames.
struct Agreement {
    /// Intersection over union of their foreground over the timed frames together.
    iou: f64,
    /// Share of the pixels that the twin called foreground.
    foreground_share: f64,
    /// Share of the picture whose modes the mixture all looked at.
    visited_share: f64,
}

impl Agreement {
    fn of(clip: &Clip) -> Result<Self> {
        let (settings, format) = (BackgroundSettings::default(), Format::of(&clip.frames[0]));
        let mut fast = GaussianMixture::new(&settings, format);
        let mut twin = ReferenceMixture::new(&settings, format);
        let (mut n_both, mut n_either, mut n_twin, mut n_pixels) = (0_u64, 0_u64, 0_u64, 0_u64);
        let (mut visited, mut previous) = (0.0, None);
        for (image, is_timed) in clip.play() {
            let hints = Hints { previous, ..Hints::default() };
            let update = fast.update_with(image, STEP_SECS, hints)?;
            previous = Some(image);
            twin.update(image, STEP_SECS)?;
            if !is_timed {
                continue;
            }
            visited += update.visited_share;
            for (a, b) in fast.foreground().data.iter().zip(&twin.foreground().data) {
                n_both += u64::from(a & b & 1);
                n_either += u64::from((a | b) & 1);
                n_twin += u64::from(b & 1);
                n_pixels += 1;
            }
        }
        Ok(Self {
            iou: if n_either == 0 { 1.0 } else { n_both as f64 / n_either as f64 },
            foreground_share: n_twin as f64 / n_pixels as f64,
            visited_share: visited / clip.frames.len() as f64,
        })
    }
}

/// OpenCV behind an interpreter, with the frames in a file.
struct Peer {
    python: PathBuf,
    folder: tempfile::TempDir,
    n_frames: usize,
    n_warm_up: usize,
    width: u32,
    height: u32,
}

/// Prints the median over the timed frames, milliseconds.
const PEER_SCRIPT: &str = r#"
import statistics, sys, time
import cv2, numpy
path, n, warm_up, width, height, threads, least_rate = sys.argv[1], *map(int, sys.argv[2:7]), float(sys.argv[7])
frames = numpy.fromfile(path, numpy.uint8).reshape(n, height, width, 3)
cv2.setNumThreads(threads)
model = cv2.createBackgroundSubtractorMOG2(history=500, varThreshold=16, detectShadows=False)
model.setNMixtures(3)
times = []
for step in range(warm_up + n):
    place = step % (2 * n)
    frame = frames[place if place < n else 2 * n - 1 - place]
    rate = max(least_rate, 1 / (step + 1))
    started = time.perf_counter()
    model.apply(frame, learningRate=rate)
    if step >= warm_up:
        times.append(time.perf_counter() - started)
print(1e3 * statistics.median(times))
"#;

impl Peer {
    fn new(python: &Path, clip: &Clip) -> Result<Self> {
        let frames = &clip.frames;
        let folder = tempfile::tempdir()?;
        let (width, height) = (frames[0].width(), frames[0].height());
        let mut out = BufWriter::new(std::fs::File::create(folder.path().join("frames.bgr"))?);
        for frame in frames {
            let mut rgb = frame.to_rgb().data;
            rgb.as_chunks_mut::<3>().0.iter_mut().for_each(|pixel| pixel.reverse());
            out.write_all(&rgb)?;
        }
        out.flush()?;
        Ok(Self {
            python: python.to_owned(),
            folder,
            n_frames: frames.len(),
            n_warm_up: clip.n_warm_up,
            width,
            height,
        })
    }

    fn run(&self, n_threads: usize) -> Result<f64> {
        let tau_secs = BackgroundSettings::default().tau_secs;
        let least_rate = 1.0 - (-STEP_SECS / tau_secs).exp();
        let size = [self.width as usize, self.height as usize];
        let numbers = [self.n_frames, self.n_warm_up, size[0], size[1], n_threads];
        let output = Command::new(&self.python)
            .args(["-c", PEER_SCRIPT])
            .arg(self.folder.path().join("frames.bgr"))
            .args(numbers.map(|number| number.to_string()))
            .arg(least_rate.to_string())
            .output()
            .with_context(|| format!("cannot run {}", self.python.display()))?;
        if !output.status.success() {
            bail!("{}: {}", self.python.display(), String::from_utf8_lossy(&output.stderr).trim());
        }
        let text = String::from_utf8_lossy(&output.stdout);
        text.trim().parse().with_context(|| format!("OpenCV's time is no number: {}", text.trim()))
    }
}
