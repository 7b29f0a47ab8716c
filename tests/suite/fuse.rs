//! The fuse room seen from outside.
