//! `cameras`: cameras in the network, before a daemon has them.

mod discover;

use anyhow::Result;

/// Looks for cameras in the network.
#[derive(Debug, clap::Args)]
pub(crate) struct Cameras {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Discover(discover::Discover),
}

impl Cameras {
    pub(crate) fn run(&self) -> Result<()> {
        match &self.action {
            Action::Discover(discover) => discover.run(),
        }
    }
}
