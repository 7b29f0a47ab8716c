//! The document as it is written.
