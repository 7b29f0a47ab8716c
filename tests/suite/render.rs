//! The render room seen from outside.
