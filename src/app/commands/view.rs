//! `view`: one picture of a scene without a daemon.

use anyhow::{Context, Result, bail};
use percent_encoding::{NON_ALPHANUMERIC, utf8_percent_encode};
use std::path::PathBuf;
use std::sync::Arc;
use videofields_api as api;
use videofields_picture::scene;
use videofields_recording::telemetry::{self, LogFormat};
use videofields_service::engine;
use videofields_vision::clock::SystemClock;
use videofields_vision::error::join_faults;
use videofields_vision::{config, encode};

/// Draws one picture of a scene without a daemon.
///
/// Every camera of the scene is played from its start up to the time asked for. Cameras whose configuration names
/// no start begin at 1970-01-01T00:00:00Z, so that --t in nanoseconds is time into the clip. The other flags are
/// those of /api/v1/scenes/{id}/view.
#[derive(Debug, clap::Args)]
pub(crate) struct View {
    /// The configuration (TOML).
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// The scene's id.
    #[arg(long, value_name = "ID")]
    scene: String,
    /// Where the picture goes; its ending, .png, .jpg or .jpeg, says how it is written.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// The viewer's place, metres; the scene's own view if absent.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    eye: Option<String>,
    /// What the viewer looks at, metres; the scene's own view if absent.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    target: Option<String>,
    /// Vertical field of view, degrees, 1 to 170; the scene's own view if absent.
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    fov: Option<String>,
    /// Columns; 1280 if absent.
    #[arg(long, value_name = "PIXELS", allow_hyphen_values = true)]
    width: Option<String>,
    /// Rows; 720 if absent.
    #[arg(long, value_name = "PIXELS", allow_hyphen_values = true)]
    height: Option<String>,
    /// live (each clip's end), an RFC 3339 time, or nanoseconds since 1970; live if absent.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    t: Option<String>,
    /// How moving entities are drawn: billboards, points, hulls, auto or none; billboards if absent.
    #[arg(long, value_name = "STYLE")]
    entities: Option<String>,
    /// perspective, orthographic, map, panorama, stereo or window; perspective if absent.
    #[arg(long, value_name = "KIND", allow_hyphen_values = true)]
    projection: Option<String>,
    /// Width of an orthographic picture or a map, metres.
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    across: Option<String>,
    /// Direction at a map's top, degrees from north towards east; 0 if absent.
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    heading: Option<String>,
    /// Angle that a panorama spans, degrees; 360 if absent.
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    span: Option<String>,
    /// Between the eyes of a stereo pair, metres; 0.064 if absent.
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    eye_distance: Option<String>,
    /// Where a stereo pair's pictures agree, metres; at the target if absent.
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    convergence: Option<String>,
    /// Lower left, lower right and upper left corner of the window that is looked through.
    #[arg(long, value_name = "X,Y,Z,X,Y,Z,X,Y,Z", allow_hyphen_values = true)]
    window: Option<String>,
    /// Whether buildings open where they hide somebody: on (the default) or off.
    #[arg(long, value_name = "ON_OFF", allow_hyphen_values = true)]
    see_through: Option<String>,
    /// Whether exposure and white balance are evened out between cameras: even (the default) or raw.
    #[arg(long, value_name = "EVEN_RAW", allow_hyphen_values = true)]
    colors: Option<String>,
    /// Samples a pixel, 1 or 4; as the configuration has it if absent.
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true)]
    samples: Option<String>,
    /// Pixels each way that are drawn for one and averaged, 1 to 4; 1 if absent.
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true)]
    supersampling: Option<String>,
    /// draft, balanced or exact; balanced if absent.
    #[arg(long, value_name = "PRESET", allow_hyphen_values = true)]
    quality: Option<String>,
    /// How many of the pixels are drawn each way, the others between them: whole, half or quarter.
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true)]
    resolution: Option<String>,
    /// How backgrounds are looked up: nearest, bilinear or levels.
    #[arg(long, value_name = "FORM", allow_hyphen_values = true)]
    filtering: Option<String>,
    /// Most cameras that are blended at a pixel, 1 to 8.
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true)]
    cameras: Option<String>,
    /// Whether what stands before a surface keeps cameras' pictures off it: on or off.
    #[arg(long, value_name = "ON_OFF", allow_hyphen_values = true)]
    depth_maps: Option<String>,
    /// Whether what stands still, and hulls as meshes, are coloured by texture fields: off, normals or montage; off if absent.
    #[arg(long, value_name = "FORM", allow_hyphen_values = true)]
    fields: Option<String>,
    /// By how many cameras one entity is shown, 1 or 2.
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true)]
    sources: Option<String>,
    /// With points, every how manieth texel each way: 1, 2 or 4.
    #[arg(long, value_name = "TEXELS", allow_hyphen_values = true)]
    stride: Option<String>,
    /// With hulls, how their surfaces are found: voxels, trimming, hybrid, csg or rays; rays if absent.
    #[arg(long, value_name = "METHOD")]
    method: Option<String>,
    /// With voxels, how many along the longest side of a hull: 32, 64, 128 or 256.
    #[arg(long, value_name = "COUNT")]
    voxels: Option<String>,
    /// With hulls, cameras that must see somebody: 2 or more; who fewer see is a billboard.
    #[arg(long, value_name = "COUNT")]
    hull_cameras: Option<String>,
    /// With hulls, how cameras are found before whom somebody stands, and lend no colour: off, depths or rays.
    #[arg(long, value_name = "FORM")]
    hull_visibility: Option<String>,
    #[command(flatten)]
    effects: super::effect_flags::EffectFlags,
    /// Says on standard error which effects ran, why, and what each stage took.
    #[arg(long)]
    explain: bool,
}

impl View {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let request = api::read_view_request(&self.scene, &self.query())
            .map_err(|faults| anyhow::anyhow!("{}", join_faults(&faults)))?;
        let is_png = match self.out.extension().and_then(|extension| extension.to_str()) {
            Some("png") => true,
            Some("jpg" | "jpeg") => false,
            _ => bail!("--out must end in .png, .jpg or .jpeg: {}", self.out.display()),
        };
        let config = config::load(&self.config)?;
        let scenes = &config.settings().scene;
        let Some(settings) = scenes.iter().find(|scene| scene.id == self.scene) else {
            let known: Vec<&str> = scenes.iter().map(|scene| scene.id.as_str()).collect();
            bail!("{} has no scene {:?}; it has {known:?}", self.config.display(), self.scene);
        };
        let scene = scene::load_file(&settings.id, &settings.file, config.settings().media_folders())
            .with_context(|| format!("scene {}: {}", settings.id, settings.file.display()))?
            .scene;
        let answer = engine::view_once(&config, &Arc::new(scene), &request, &SystemClock::new())?;
        let bytes = if is_png { encode::png_rgb(&answer.image)? } else { encode::jpeg(&answer.image, 90)? };
        std::fs::write(&self.out, bytes).with_context(|| format!("cannot write {}", self.out.display()))?;
        if self.explain {
            for reason in &answer.plan.reasons {
                let state = if reason.is_on { "on " } else { "off" };
                super::complain(&format!("{state} {}: {}", reason.effect, reason.because));
            }
            for (stage, time) in &answer.timings {
                super::complain(&format!("{stage}: {:.2} ms", time.as_secs_f64() * 1e3));
            }
        }
        Ok(())
    }

    /// The flags as the API's query string, so that both are read by the same rules.
    fn query(&self) -> String {
        let flags = [
            ("eye", &self.eye),
            ("target", &self.target),
            ("fov", &self.fov),
            ("width", &self.width),
            ("height", &self.height),
            ("t", &self.t),
            ("entities", &self.entities),
            ("projection", &self.projection),
            ("across", &self.across),
            ("heading", &self.heading),
            ("span", &self.span),
            ("eye_distance", &self.eye_distance),
            ("convergence", &self.convergence),
            ("window", &self.window),
            ("see_through", &self.see_through),
            ("colors", &self.colors),
            ("samples", &self.samples),
            ("supersampling", &self.supersampling),
            ("quality", &self.quality),
            ("resolution", &self.resolution),
            ("filtering", &self.filtering),
            ("cameras", &self.cameras),
            ("depth_maps", &self.depth_maps),
            ("fields", &self.fields),
            ("sources", &self.sources),
            ("stride", &self.stride),
            ("method", &self.method),
            ("voxels", &self.voxels),
            ("hull_cameras", &self.hull_cameras),
            ("hull_visibility", &self.hull_visibility),
        ];
        let pair = |(name, value): (&str, &Option<String>)| {
            value.as_ref().map(|value| format!("{name}={}", utf8_percent_encode(value, NON_ALPHANUMERIC)))
        };
        flags.into_iter().chain(self.effects.pairs()).filter_map(pair).collect::<Vec<_>>().join("&")
    }
}
