//! The mapping room seen from outside.
