//! Tests that cross rooms, one module a room; what needs one room alone is tested at the foot of its file.

#[path = "../support/mod.rs"]
mod support;

mod accuracy;
mod alignment;
mod api;
mod archive;
mod background;
mod calibrate;
mod config;
mod daemon;
mod deploy;
mod effects;
mod engine;
mod faults;
mod fuse;
mod geometry;
mod hull;
mod ingest;
mod ingest_live;
mod mapping;
mod numerics;
mod recording;
mod render;
mod scene;
mod segment;
mod sequence;
mod simulate;
mod standing;
mod store;
mod timeline;
mod track;
mod worlds;
