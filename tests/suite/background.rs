//! The background room seen from outside.
