//! Fuses many fixed surveillance cameras into one 3D scene, and answers for it over HTTP.
//!
//! The rooms below stand in the order in which data flows; a room uses only rooms above it in this list
//! (`tests/tidy.rs` holds it to that).
//!
//! ```text
//! cameras, files ──ingest──▶ Frame ──background, segment, track──▶ Observation ──▶ timeline
//!                                                                                    │ at time t
//!                                                                                    ▼
//! request (view, time) ──▶ plan ◀────── fuse ──────▶ SceneState (immutable, one instant)
//!                            │
//!                            ▼
//!              render: only the planned passes ──▶ encode ──▶ api: view, camera picture
//! store (SQLite): scenes, backgrounds, texture-to-world maps
//! ```

pub mod error;

pub mod clock;

pub mod memory;

pub mod ending;

pub mod geometry;

pub mod frame;

pub mod access;

pub mod encode;

pub mod config;

pub mod telemetry;

pub mod media;

pub mod store;

pub mod accounts;

pub mod gpu;

pub mod mapping;

pub mod calibrate;

pub mod background;

pub mod segment;

pub mod track;

pub mod condition;

pub mod mesh;

pub mod hull;

pub mod fields;

pub mod effects;

pub mod archive;

pub mod timeline;

pub mod ingest;

pub mod scene;

pub mod sequence;

pub mod fuse;

pub mod plan;

pub mod render;

pub mod wall;

pub mod engine;

pub mod catalog;

pub mod evidence;

pub mod api;

pub mod simulate;

pub mod accuracy;

pub mod daemon;
