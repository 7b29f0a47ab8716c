//! Holds the house to its own rules.
