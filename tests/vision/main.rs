//! Tests of `videofields-vision` that cross rooms, one module a room; what needs one room alone is tested at the foot of its file.

mod calibrate;
mod config;
mod constant;
mod geometry;
mod mapping;
