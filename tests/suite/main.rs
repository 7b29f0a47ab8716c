//! Tests that cross rooms, one module a room; what needs one room alone is tested at the foot of its file.

mod alignment;
mod api;
mod archive;
mod background;
mod daemon;
mod deploy;
mod engine;
mod faults;
mod hull;
mod ingest;
mod ingest_live;
mod onvif;
mod recording;
mod scene;
mod seeing;
mod segment;
mod sequence;
mod standing;
mod store;
mod timeline;
mod track;
