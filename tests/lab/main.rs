//! Tests of `videofields-lab`: what it measures, and its commands.

mod accuracy;
mod commands;
mod drivers;
mod effects;
