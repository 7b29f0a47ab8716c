//! `bench`: what the paths that run at every frame cost on this machine, beside the peer that others would use; and what a
//! daemon answers to many at once.

mod background;
mod corpus;
mod deadlines;
mod effects;
mod fields;
mod folder;
mod hull_costs;
pub(crate) mod hulls;
mod load;
pub(crate) mod meshes;
mod placing;
mod playing;
mod quality;
mod views;
mod vision;

use anyhow::Result;

/// Measures what runs at every frame, beside the peer that others would use, and what many callers at once are answered.
#[derive(Debug, clap::Args)]
pub(crate) struct Bench {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Background(background::Background),
    Corpus(corpus::Corpus),
    Deadlines(deadlines::Deadlines),
    Effects(effects::Effects),
    Fields(fields::Fields),
    Hulls(hulls::Hulls),
    Load(load::Load),
    Meshes(meshes::Meshes),
    Placing(placing::Placing),
    Quality(quality::Quality),
    Views(views::Views),
    Vision(vision::Vision),
}

impl Bench {
    pub(crate) fn run(&self) -> Result<()> {
        match &self.what {
            What::Background(background) => background.run(),
            What::Corpus(corpus) => corpus.run(),
            What::Deadlines(deadlines) => deadlines.run(),
            What::Effects(effects) => effects.run(),
            What::Fields(fields) => fields.run(),
            What::Hulls(hulls) => hulls.run(),
            What::Load(load) => load.run(),
            What::Meshes(meshes) => meshes.run(),
            What::Placing(placing) => placing.run(),
            What::Quality(quality) => quality.run(),
            What::Views(views) => views.run(),
            What::Vision(vision) => vision.run(),
        }
    }
}
