//! The accuracy room seen from outside.
