//! The api room seen from outside.
