//! The store room seen from outside.
