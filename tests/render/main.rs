//! Tests of whatever draws, and of the scenes that it draws: a program of its own, so that it can be run on any device and driver.

mod fuse;
mod numerics;
mod render;
