//! The config room seen from outside.
