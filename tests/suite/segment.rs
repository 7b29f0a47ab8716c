//! The segment room seen from outside.
