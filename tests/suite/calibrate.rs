//! The calibrate room seen from outside.
