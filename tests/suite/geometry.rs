//! The geometry room seen from outside.
