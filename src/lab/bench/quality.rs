//! `bench quality`: what settings cost beside how well they see, on simulated worlds.

use super::folder::Folder;
use crate::report::{Figure, Point, Series, figure_page};
use anyhow::{Context as _, Result, bail, ensure};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields::commands::given::{Tables, camera, pipeline};
use videofields_picture::plan::Spread;
use videofields_picture::scene::{Scene, object_sizes};
use videofields_recording::ingest::{self, MediaRoots, Pipeline};
use videofields_vision::clock::{Clock as _, SystemClock, Timestamp};
use videofields_vision::config::{CameraSettings, SourceSettings};
use videofields_vision::frame::{CameraId, Frame, Mask, YuvImage};
use videofields_vision::measures::MaskScore;
use videofields_vision::segment::{MOVING, ObjectSizes};

/// Share of a clip that is only learned.
const LEARNED_SHARE: f64 = 0.2;

/// Truth that is not scored: outside of the region, unknown.
const UNSCORED: [u8; 2] = [85, 170];

/// The forms that are measured if none is named: what each setting brings and costs by itself.
const FORMS: [(&str, &str); 22] = [
    ("defaults", ""),
    ("half resolution", "segment.resolution=half"),
    ("quarter resolution", "segment.resolution=quarter"),
    ("one mode", "background.modes=1"),
    ("two modes", "background.modes=2"),
    ("four modes", "background.modes=4"),
    ("five modes", "background.modes=5"),
    ("no blur", "segment.blur_sigma_px=0.0"),
    ("blur 1.5 px", "segment.blur_sigma_px=1.5"),
    ("blur 3 px", "segment.blur_sigma_px=3.0"),
    ("delta 0.08", "segment.delta=0.08"),
    ("delta 0.2", "segment.delta=0.2"),
    ("hysteresis", "segment.delta_high=0.2"),
    ("mixture ignored", "segment.mixture=ignore"),
    ("mixture added", "segment.mixture=add"),
    ("no shadows", "segment.shadow_darkest=1.0"),
    ("no highlights", "segment.highlight_brightest=1.0"),
    ("blinking", "segment.suppress_blinking=true"),
    ("holes stay", "segment.max_hole_px=0"),
    ("closing 2 px", "segment.close_radius_px=2"),
    ("no hold", "track.absorb_after_secs=0.0"),
    ("half, no blur", "segment.resolution=half segment.blur_sigma_px=0.0"),
];

/// Measures cost and quality of settings on simulated worlds.
///
/// A world is a folder that `videofields-lab simulate` wrote, with truth for every frame. Every camera of every world is
/// played with every form, the forms in turns at each frame, on one thread; the first fifth of a clip is learned only.
/// Quality is the F-measure of the change detection benchmark, the mean over the cameras; cost the median time of a frame
/// from its planes to blobs and tracks.
#[derive(Debug, clap::Args)]
pub(super) struct Quality {
    /// A folder that `videofields-lab simulate` wrote. Repeatable.
    #[arg(long, value_name = "DIR", required = true)]
    world: Vec<PathBuf>,
    /// A form: its name and its settings, as NAME:KEY=VALUE KEY=VALUE. Repeatable; a list of its own if absent.
    #[arg(long, value_name = "FORM")]
    form: Vec<String>,
    /// Leaves out what the world's scene says of sizes of people, as if no scene had the cameras.
    #[arg(long)]
    without_scene: bool,
    /// Writes F against milliseconds as an SVG picture.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// Settings under a name, and what was found with them.
struct Form {
    name: String,
    camera: CameraSettings,
    /// Of every camera.
    f_measures: Vec<f64>,
    times_ms: Vec<f64>,
}

/// A camera's clip in memory.
struct Clip {
    name: String,
    frames: Vec<(i64, Arc<YuvImage>)>,
    truth: Vec<Mask>,
}

impl Quality {
    pub(super) fn run(&self) -> Result<()> {
        let mut forms = self.forms()?;
        let mut names = Vec::new();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
        for world in &self.world {
            let scene = if self.without_scene { None } else { Some(Folder::open(world)?.scene) };
            for camera in cameras(world)? {
                let clip = Clip::read(world, &camera)?;
                let sizes = scene.as_ref().map(|scene| sizes_of(scene, &camera)).transpose()?;
                pool.install(|| play(&clip, sizes.as_ref(), &mut forms))?;
                names.push(clip.name);
            }
        }
        let mut out = std::io::stdout().lock();
        writeln!(out, "| settings | F, mean | F, least | of camera | ms/frame |")?;
        writeln!(out, "| --- | ---: | ---: | --- | ---: |")?;
        for form in &forms {
            let least = form.f_measures.iter().zip(&names).min_by(|a, b| a.0.total_cmp(b.0));
            let (least, name) = least.context("no camera")?;
            writeln!(
                out,
                "| {} | {:.4} | {least:.4} | {name} | {:.3} |",
                form.name,
                form.mean_f(),
                form.median_ms()
            )?;
        }
        if let Some(path) = &self.plot {
            let text = figure_page(&figure(&forms))?.context("nothing to draw")?;
            std::fs::write(path, text).with_context(|| path.display().to_string())?;
        }
        Ok(())
    }

    fn forms(&self) -> Result<Vec<Form>> {
        let own = self.form.iter().map(|form| form.split_once(':').unwrap_or((form, "")));
        let named: Vec<(&str, &str)> = if self.form.is_empty() { FORMS.to_vec() } else { own.collect() };
        let read = |(name, settings): (&str, &str)| {
            let source = clip_source(Path::new("."));
            let camera = Tables::of_flags(settings.split_whitespace())
                .and_then(|tables| camera(tables, source))
                .with_context(|| format!("form {name}"))?;
            Ok(Form { name: name.to_owned(), camera, f_measures: Vec::new(), times_ms: Vec::new() })
        };
        named.into_iter().map(read).collect()
    }
}

fn clip_source(path: &Path) -> SourceSettings {
    SourceSettings::of_path(path)
}

impl Form {
    fn mean_f(&self) -> f64 {
        self.f_measures.iter().sum::<f64>() / self.f_measures.len() as f64
    }

    fn median_ms(&self) -> f64 {
        Spread::of(&self.times_ms).map_or(f64::NAN, |spread| spread.median)
    }
}

/// The names of a world's cameras.
fn cameras(world: &Path) -> Result<Vec<String>> {
    let clips = world.join("clips");
    let mut cameras = Vec::new();
    for entry in std::fs::read_dir(&clips).with_context(|| clips.display().to_string())? {
        let path = entry?.path();
        let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        if world.join("truth").join(&name).join("label").is_dir() {
            cameras.push(name);
        }
    }
    cameras.sort_unstable();
    cameras.dedup();
    ensure!(!cameras.is_empty(), "{}: no clip with labels in truth/", world.display());
    Ok(cameras)
}

impl Clip {
    fn read(world: &Path, camera: &str) -> Result<Self> {
        let folder = world.join("clips");
        let mut files = std::fs::read_dir(&folder)?.filter_map(|entry| Some(entry.ok()?.path()));
        let path = files
            .find(|path| path.file_stem().is_some_and(|stem| stem == camera))
            .with_context(|| format!("{}: no clip of {camera}", folder.display()))?;
        let source = clip_source(&path);
        let mut source = ingest::open(&source, &MediaRoots::of_caller(&path)?)?;
        let (mut frames, mut truth) = (Vec::new(), Vec::new());
        while let Some(next) = source.next_frame()? {
            let place =
                world.join("truth").join(camera).join("label").join(format!("{:06}.png", next.number));
            let label = image::open(&place).with_context(|| place.display().to_string())?.into_luma8();
            let (width, height) = label.dimensions();
            if (width, height) != (next.image.width(), next.image.height()) {
                bail!("{}: not of its clip's size", place.display());
            }
            truth.push(Mask { width, height, data: label.into_raw().into() });
            frames.push((next.stream_nanos, next.image));
        }
        ensure!(!frames.is_empty(), "{camera} of {} has no frame", world.display());
        let world = world.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Ok(Self { name: format!("{world}/{camera}"), frames, truth })
    }
}

/// Returns the sizes of objects in a camera's pictures.
fn sizes_of(scene: &Scene, camera: &str) -> Result<Arc<ObjectSizes>> {
    let member = scene.cameras.iter().find(|member| member.id.as_str() == camera);
    let member = member.with_context(|| format!("scene {}: no camera {camera}", scene.id))?;
    Ok(Arc::new(object_sizes(scene, member)))
}

/// Plays a clip with every form, the forms in turns at each frame.
fn play(clip: &Clip, sizes: Option<&Arc<ObjectSizes>>, forms: &mut [Form]) -> Result<()> {
    let id = CameraId::new("input")?;
    let clock = SystemClock::new();
    let mut pipelines: Vec<Pipeline> = forms.iter().map(|form| pipeline(&form.camera)).collect();
    for pipeline in &mut pipelines {
        pipeline.set_object_sizes(sizes.cloned());
    }
    let mut scores = vec![MaskScore::default(); forms.len()];
    let first = (LEARNED_SHARE * clip.frames.len() as f64) as usize;
    for (number, ((nanos, image), truth)) in clip.frames.iter().zip(&clip.truth).enumerate() {
        for ((pipeline, form), score) in pipelines.iter_mut().zip(&mut *forms).zip(&mut scores) {
            let frame = Frame {
                camera: id.clone(),
                timestamp: Timestamp::from_nanos(*nanos),
                number: number as u64,
                image: Arc::clone(image),
            };
            let started = clock.monotonic();
            let seen = pipeline.process(frame);
            let took = clock.monotonic().saturating_sub(started);
            pipeline.take_events();
            if number >= first {
                form.times_ms.push(took.as_secs_f64() * 1000.0);
                score.add_scored(
                    &seen.labels,
                    truth,
                    |label| label == MOVING,
                    |truth| (!UNSCORED.contains(&truth)).then_some(truth == 255),
                );
            }
        }
    }
    for (form, score) in forms.iter_mut().zip(&scores) {
        form.f_measures.push(score.f_measure());
    }
    Ok(())
}

/// 1 - F against milliseconds.
fn figure(forms: &[Form]) -> Figure {
    let points = forms.iter().enumerate().map(|(idx, form)| Point {
        x: form.median_ms(),
        y: 1.0 - form.mean_f(),
        label: form.name.clone(),
        is_marked: idx == 0,
        is_large: false,
    });
    Figure {
        title: "Error against cost of a frame, by settings".to_owned(),
        x_name: "milliseconds a frame, one thread".to_owned(),
        y_name: "1 - F, mean over the cameras".to_owned(),
        is_log: false,
        series: vec![Series { name: "settings".to_owned(), points: points.collect(), is_joined: false }],
    }
}
