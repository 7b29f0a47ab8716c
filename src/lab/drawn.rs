//! `drawn`: ten pictures of scenes made by code, so that devices and drivers can be held against each other.

use crate::made_scenes::{settings, tiled, yard};
use anyhow::{Context as _, Result};
use std::path::PathBuf;
use videofields::commands::say;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{self, Colors, EntityStyle, Filtering, Picture, Settings, View, Wishes};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_render::Renderer;
use videofields_render::gpu::Gpu;
use videofields_vision::config::RenderSettings;
use videofields_vision::effects::{EffectSettings, LightSource, Occlusion, Relight, Stipple, Sun};
use videofields_vision::encode;

/// Draws ten pictures of scenes made by code, as PNG, to be held against those of another device or driver.
#[derive(Debug, clap::Args)]
pub(crate) struct Drawn {
    /// The folder to write to; made if it is not there. Files of the same names are replaced.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Part of the adapter's name; the first there is if absent.
    #[arg(long, value_name = "NAME", default_value = "")]
    adapter: String,
}

/// A picture to be drawn.
struct Wanted {
    name: &'static str,
    state: SceneState,
    picture: Picture,
    settings: Settings,
    effects: EffectSettings,
}

/// Columns and rows of the pictures.
const SIZE_PX: (u32, u32) = (320, 180);

fn wanted() -> Vec<Wanted> {
    use EntityStyle::{Billboards, None as Nobody, Points};
    let none = EffectSettings::NONE;
    let relight = Some(Relight { sun: Some(Sun::default()), ..Relight::by(LightSource::Sky) });
    let people = |name, style, filtering, samples, effects| {
        let (mut state, picture) = yard(12, SIZE_PX);
        if style == Points {
            state.place_points(1);
        }
        Wanted { name, state, picture, settings: settings(style, filtering, samples), effects }
    };
    let ground = |name, cells, per_cell| {
        let (state, picture) = tiled(cells, per_cell, 0);
        let view = View { width_px: SIZE_PX.0, height_px: SIZE_PX.1, ..picture.parts[0].view };
        let settings = settings(Nobody, Filtering::Levels, 1);
        Wanted { name, state, picture: view.into(), settings, effects: none }
    };
    vec![
        people("nobody", Nobody, Filtering::Levels, 1, none),
        people("billboards", Billboards, Filtering::Levels, 1, none),
        people("billboards-4-samples", Billboards, Filtering::Levels, 4, none),
        people("points", Points, Filtering::Levels, 1, none),
        people("bilinear", Billboards, Filtering::Bilinear, 1, none),
        people("relight", Billboards, Filtering::Levels, 1, EffectSettings { relight, ..none }),
        people(
            "occlusion",
            Billboards,
            Filtering::Levels,
            1,
            EffectSettings { occlusion: Some(Occlusion::default()), ..none },
        ),
        people(
            "stipple",
            Billboards,
            Filtering::Levels,
            1,
            EffectSettings { stipple: Some(Stipple::default()), ..none },
        ),
        ground("three-cameras", [1, 1], 3),
        ground("many-cameras", [8, 3], 3),
    ]
}

impl Drawn {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        std::fs::create_dir_all(&self.out)
            .with_context(|| format!("cannot make the folder {}", self.out.display()))?;
        let mut renderer = Renderer::new(Gpu::new(&self.adapter)?, &RenderSettings::default())?;
        say(renderer.gpu().name())?;
        for Wanted { name, state, picture, settings, effects } in wanted() {
            let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects };
            let plan = plan::make(&state, &picture, wishes);
            let image = renderer.render(&state, &picture, &plan).with_context(|| name.to_owned())?.image;
            let path = self.out.join(name).with_extension("png");
            std::fs::write(&path, encode::png_rgb(&image)?)
                .with_context(|| format!("cannot write {}", path.display()))?;
            say(&path.display().to_string())?;
        }
        Ok(())
    }
}
