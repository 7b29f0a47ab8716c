//! The timeline room seen from outside.
