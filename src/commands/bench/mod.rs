//! `bench`: what the paths that run at every frame cost on this machine, beside the peer that others would use.

mod background;
mod deadlines;
mod quality;
mod views;
mod vision;

use anyhow::Result;

/// Measures what runs at every frame, beside the peer that others would use.
#[derive(Debug, clap::Args)]
pub(crate) struct Bench {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Background(background::Background),
    Deadlines(deadlines::Deadlines),
    Quality(quality::Quality),
    Views(views::Views),
    Vision(vision::Vision),
}

impl Bench {
    pub(crate) fn run(&self) -> Result<()> {
        match &self.what {
            What::Background(background) => background.run(),
            What::Deadlines(deadlines) => deadlines.run(),
            What::Quality(quality) => quality.run(),
            What::Views(views) => views.run(),
            What::Vision(vision) => vision.run(),
        }
    }
}
