//! The scene room seen from outside.
