//! The simulate room seen from outside.
