//! The ingest room seen from outside.
